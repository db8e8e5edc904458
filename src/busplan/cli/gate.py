"""Commands of the gate: check, diff, rule and schema."""

import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, TypeAlias

import typer

import busplan
from busplan.cli.answering import profile_files, require_apart
from busplan.cli.command import Call, Fails, command, load_each
from busplan.cli.options import TimingModelOption, chosen_model, complete_profile, output_option, require_company
from busplan.cli.output import PlanFailsError, emit_document, emit_text, is_styled, say, terminal_size
from busplan.cli.rewrite import changing, require_changeable, rewrite
from busplan.english import first_of, plural
from busplan.errors import BusplanError
from busplan.files import document_bytes, write_file
from busplan.gate.formats import FORMATS, GateFormat
from busplan.profile.changes import KeyChanges

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from concurrent.futures import Executor
    from contextlib import AbstractContextManager

    from busplan.buses.rule import Severity
    from busplan.forms.blocks import Report
    from busplan.gate.baseline import Baseline
    from busplan.gate.gate import FileResult
    from busplan.gate.report import CheckReport
    from busplan.profile.sources import Collection, ProfileSource
    from busplan.questions.base.answer import Answer

    FormatName = str
else:
    # The choices for typer.
    FormatName = Literal[tuple(FORMATS)]

_WIDTH: Final = 80
"""Columns of a coloured report without a terminal."""
_BUILD_FORMATS: Final = [name for name, report_format in FORMATS.items() if report_format.reader == "builds"]


_OptionOf: TypeAlias = Callable[[str, Any, Any], Any]
"""Value of an option by its name, value and default: as given, or else that of the settings."""


@dataclass(frozen=True)
class _Selection:
    """Findings that count."""

    select: Annotated[
        str | None,
        typer.Option(metavar="CODES", help="Rules that count, as BP1,BP301: beginnings of codes.  [default: all]"),
    ] = None
    ignore: Annotated[
        str | None,
        typer.Option(
            metavar="CODES",
            help="Rules that do not count, as BP112; the longest beginning that matches decides.  [default: none]",
        ),
    ] = None
    show_suppressed: Annotated[
        bool, typer.Option("--show-suppressed", help="Also name suppressed findings, each with its reason.")
    ] = False
    fail_on: Annotated[
        Literal["error", "warning"] | None, typer.Option(help="Least severity that fails the check.  [default: error]")
    ] = None
    exit_zero: Annotated[bool, typer.Option("--exit-zero", help="Exit 0 even with findings; 2 stays 2.")] = False

    def arguments(self, option_of: "_OptionOf") -> dict[str, Any]:
        """Arguments of `check`."""
        return {
            "select": option_of("select", _codes(self.select), ()),
            "ignore": option_of("ignore", _codes(self.ignore), ()),
            "per_file_ignores": option_of("per-file-ignores", None, {}),
        }

    def least(self, option_of: "_OptionOf") -> "Severity | None":
        """Least severity that fails the check; None if no finding does."""
        severity: Severity = option_of("fail-on", self.fail_on, "error")
        return None if self.exit_zero else severity


@dataclass(frozen=True)
class _Circle:
    """Circle tests."""

    circle: Annotated[
        bool | None,
        typer.Option(help="Run the circle test of profiles that ask for one, or leave it out.  [default: run it]"),
    ] = None
    circle_steps: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Largest number of simulated steps per axis of a circle; a longer circle is not run, and BP204 "
            "warns of "
            "it.  [default: 10000000]",
        ),
    ] = None

    def arguments(self, option_of: "_OptionOf") -> dict[str, Any]:
        """Arguments of `check`."""
        circle = option_of("circle", self.circle, True)
        require_company("--circle", {"--circle-steps": self.circle_steps}, is_given=circle)
        steps = option_of("circle-steps", self.circle_steps, None) if circle else None
        return {"circle": circle, **({} if steps is None else {"circle_steps": steps})}


@dataclass(frozen=True)
class _Baseline:
    """Baseline."""

    baseline: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="File of recorded axes and margins, below which no profile may fall.  [default: none]"
        ),
    ] = None
    update_baseline: Annotated[
        bool,
        typer.Option(
            "--update-baseline",
            help="Record the present axes, margins and findings in the --baseline file, and drop records without "
            "a profile. Recorded findings no longer count. Exits 0 when it is written.",
        ),
    ] = False
    pass_on_unmatched: Annotated[
        bool,
        typer.Option(
            "--pass-on-unmatched",
            help="Accept profiles without a record in the --baseline file, and records without a profile; "
            "otherwise they exit 2.",
        ),
    ] = False

    def path(self, option_of: "_OptionOf", changes: KeyChanges) -> Path | None:
        """The file, that of the settings included; None without a baseline."""
        path: Path | None = option_of("baseline", self.baseline, None)
        of_baseline = {"--update-baseline": self.update_baseline, "--pass-on-unmatched": self.pass_on_unmatched}
        require_company("--baseline FILE", of_baseline, is_given=path)
        if self.update_baseline and self.pass_on_unmatched:
            raise BusplanError("--pass-on-unmatched: cannot be used with --update-baseline")
        if self.update_baseline and changes.entries:
            raise BusplanError(
                f"--update-baseline: cannot be used with {changes.words}: it records the files as they are"
            )
        if self.update_baseline and path is not None:
            require_changeable(path)
        return path


@dataclass(frozen=True)
class _Recording:
    """Recording of the machine."""

    recording: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Recording of the machine of the only profile, as for `busplan measured`; a figure outside the "
            "plan fails the check.  [default: none]",
        ),
    ] = None
    quantile: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            help="Share of the cycles of --recording that jitter and times must cover, 0.5..1 [1].  [default: 1]",
            show_default=False,
        ),
    ] = 1.0

    def __post_init__(self) -> None:
        require_company("--recording FILE", {"--quantile": self.quantile != 1}, is_given=self.recording)


@dataclass(frozen=True)
class _Written:
    """Report."""

    format_: Annotated[
        FormatName | None,
        typer.Option(
            "--format",
            metavar="FORM",
            help="Form of the report: concise is one line for each finding, full shows the line of the file with the "
            f"value underlined, json is one document; {', '.join(_BUILD_FORMATS[:-1])} and {_BUILD_FORMATS[-1]} "
            "are for build services.  [default: full on a terminal, otherwise concise]",
            envvar="BUSPLAN_FORMAT",
        ),
    ] = None
    output: Annotated[Path | None, output_option("Write the report to FILE")] = None
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No summary on standard error.")] = False
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose", "-v", help="Also list every BP112, and name files without findings and skipped files."
        ),
    ] = False

    @property
    def chosen(self) -> GateFormat:
        """The form; without --format, as a person at a terminal or a program behind a pipe reads it best."""
        return FORMATS[self.format_ or ("full" if self.output is None and sys.stdout.isatty() else "concise")]


@command(
    "It holds for all files, each of which must be valid without it; a finding is at the key in the file, or at its "
    "section.",
    of="profiles",
    answers=False,
)
def check_command(
    call: Call,
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATH",
            help="Profile files, folders (every `*.toml` below that has a `schema_version`), names of shipped "
            "profiles, or - for standard input.",
            autocompletion=complete_profile,
            show_default=False,
        ),
    ],
    selection: _Selection,
    circle: _Circle,
    baseline: _Baseline,
    recording: _Recording,
    written: _Written,
    skip_others: Annotated[
        bool, typer.Option("--skip-others", help="Skip named files without a `schema_version`, and count them.")
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", metavar="N", min=1, help="Number of processes to check with.  [default: 1]"),
    ] = None,
    stdin_filename: Annotated[
        str, typer.Option(metavar="NAME", help="Name of standard input in the report.")
    ] = "<stdin>",
) -> None:
    """Fail a build when a profile no longer fits its bus or its circle.

    Each finding is a line: `path:line:column: CODE severity: message`; of BP112, an assumption, text shows the heaviest
    of each file. `busplan rule CODE` explains it. A comment `# busplan: ignore[CODE] reason` on its line, or alone on
    the line above, suppresses it. A file that is not TOML or not a profile is a finding, too. Options that are not
    given come from the nearest busplan.toml, or else from [tool.busplan] of pyproject.toml. Exits 0 when clean, 1 with
    findings at or above --fail-on, 2 when it could not do the job, as with a missing file; the other files are still
    checked.

    Example: busplan check paper-1ms paper-4ms --format github
    """
    from busplan.gate.selection import nearest_settings
    from busplan.profile.sources import collect

    option_of = nearest_settings(Path.cwd()).option
    skip_others = option_of("skip-others", skip_others or None, False)
    arguments = {**selection.arguments(option_of), **circle.arguments(option_of)}
    known, least = baseline.path(option_of, call.changes), selection.least(option_of)
    updated = known if baseline.update_baseline else None
    collection = collect(paths, stdin_name=stdin_filename, skip_others=skip_others)
    read = [source.path for source in collection.sources if source.failure is None]
    read += [path for path in (recording.recording, known) if path is not None and path != updated]
    require_apart({"--output": written.output, "--baseline": updated}, inputs=read)
    recorded = None if known is None else _read_baseline(known, needed=updated is None)
    with _crew(min(option_of("jobs", jobs, 1), len(collection.sources))) as crew:
        report = busplan.check(
            collection,
            changes=call.changes,
            baseline=None if updated else recorded,
            pass_on_unmatched=baseline.pass_on_unmatched,
            record=baseline.update_baseline,
            recording=recording.recording,
            quantile=recording.quantile,
            skip_others=skip_others,
            executor=crew,
            **arguments,
        )
    lists_all = written.verbose or written.chosen.reader != "people"
    report = report._replace(lists_all=lists_all)
    _write(report, written)
    _say_findings(report, collection, written, selection)
    if baseline.pass_on_unmatched and report.unmatched:
        say(f"warning: {report.unmatched}")
    if updated is not None:
        _update_baseline(updated, collection.sources, report, quiet=written.quiet)
    if not written.quiet:
        from busplan.forms.numbers import sentence_text
        from busplan.questions.base.sentences import changes_sentences

        say(*map(sentence_text, changes_sentences(call.changes)), *_mended(report), report.headline)
    if report.failed:
        raise typer.Exit(2)
    if least is not None and updated is None and report.has_findings(least):
        raise PlanFailsError


def _say_findings(report: "CheckReport", collection: "Collection", written: _Written, selection: _Selection) -> None:
    """Say what could not be checked, and what --verbose and --show-suppressed add."""
    say(*(file.failure for file in report.files if file.failure is not None))
    if written.verbose:
        say(*(f"{name}: skipped, claims no schema_version" for name in collection.skipped))
        say(*(f"{file.path}: ok" for file in report.files if file.status == "ok"))
        say(*(f"{file.path}: rests on {words}" for file in report.files if (words := file.rests_on_words)))
    if selection.show_suppressed:
        say(*(line for file in report.files for line in _suppressed_lines(file)))


def _codes(text: str | None) -> list[str] | None:
    return None if text is None else [code.strip() for code in text.split(",")]


def _mended(report: "CheckReport") -> list[str]:
    """Findings that the baseline knows and that are no more."""
    names = [f"{known} in {file.path}" for file in report.files for known in file.mended]
    return [f"mended since the baseline: {first_of(names, 3)}; --update-baseline drops them"] if names else []


def _suppressed_lines(file: "FileResult") -> "Iterator[str]":
    from busplan.gate.finding import finding_line

    for each in file.suppressed:
        yield f"{finding_line(file.path, each.finding)} (suppressed: {each.reason or 'without a reason'})"


def _crew(jobs: int) -> "AbstractContextManager[Executor | None]":
    """Worker processes; None for this process alone, which does not load what starts them."""
    if jobs <= 1:
        return nullcontext()
    from busplan.cli.workers import workers

    return workers(jobs)


def _read_baseline(path: Path, *, needed: bool) -> "Baseline | None":
    """The recorded baseline; None if there is no file yet and none is needed."""
    from busplan.gate.baseline import load_baseline

    return load_baseline(path) if needed or path.exists() else None


def _update_baseline(path: Path, sources: "Sequence[ProfileSource]", report: "CheckReport", *, quiet: bool) -> None:
    """Record the checked profiles; others that are still there keep their record."""
    from busplan.gate.baseline import MODELS, Baseline, Record, known_as, write_baseline

    new = Baseline({}, MODELS, path)
    names = [new.name_of(source) for source in sources]
    checked = zip(names, report.files, strict=True)
    now = {
        name: Record(file.figures, file.keys, tuple(sorted({known_as(one.code, one.key) for one in file.findings})))
        for name, file in checked
        if file.fit is not None
    }
    with changing(path):
        # Read again: another run may have changed it since the check began.
        old = _read_baseline(path, needed=False) or new
        gone = old.without_profile(names)
        kept = {name: record for name, record in old.profiles.items() if old.is_current and name not in gone}
        rewrite(path, write_baseline({**kept, **now}).encode())
    if not quiet:
        findings = sum(len(record.findings) for record in now.values())
        known = f" with {plural(findings, 'known finding')}" if findings else ""
        say(f"recorded {plural(len(now), 'profile')}{known} in {path}")
    if gone:
        say(f"warning: {path}: dropped {', '.join(gone)}: no such profile any more")
    left = [name for name in old.profiles if not old.is_current and name not in (*now, *gone)]
    if left:
        say(f"warning: {path}: dropped {', '.join(left)}, recorded by other timing models; check them, too")


def _write(report: "CheckReport", written: _Written) -> None:
    """Write the report."""
    output, chosen = written.output, written.chosen
    if output is not None:
        write_file(output, document_bytes(chosen.write(report)), overwrite=True)
    elif chosen.reader != "people":
        emit_document(chosen.write(report))
    else:
        width, _ = terminal_size() or (_WIDTH, 0)
        emit_text(chosen.write(report, width=width if is_styled() else None))
    if chosen.repeats:
        say(*FORMATS["concise"].write(report).splitlines())


@command("It holds for both profiles.", of="profiles", reads=lambda a, b, **_: profile_files(a, b))
def diff_command(
    call: Call,
    a: Annotated[
        str,
        typer.Argument(
            autocompletion=complete_profile,
            help="The profile to compare with: a file, a shipped name, - for standard input, or REV:path for a "
            "file as it stood in a git revision, as HEAD~1:profiles/line.toml; the path starts at the "
            "current folder.",
        ),
    ],
    b: Annotated[str, typer.Argument(autocompletion=complete_profile, help="The profile to judge, likewise.")],
    timing_model: TimingModelOption = "both",
    fail_on_regression: Annotated[
        bool, typer.Option("--fail-on-regression", help="Exit 1 when a figure of B is worse.")
    ] = False,
    tolerance: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENT",
            help="With --fail-on-regression: largest accepted loss of a number against A [%].  [default: 0]",
        ),
    ] = None,
) -> "Answer | Fails":
    """Tell what changed between two profiles, and what that does to every figure.

    A sentence gives both verdicts and the figures in which B is better or worse. Below are the keys whose values
    differ, defaults applied, and the figures of capacity that differ, with B - A and its share of A. Settings and what
    describes them (period, nodes, gap count, time available, a single term) are neither better nor worse. JSON and CSV
    list equal figures, too. Times are in us. Markdown is for a pull request. Exits 0 whatever the figures; with
    --fail-on-regression 1 when any figure is worse, under any timing model. --timing-model leaves figures out, but
    never the verdict. `busplan check` with a baseline tells which key cost what.

    Example: busplan diff paper-1ms paper-optimal-gap --fail-on-regression
    """
    require_company("--fail-on-regression", {"--tolerance": tolerance is not None}, is_given=fail_on_regression)
    if tolerance is not None and not (isfinite(tolerance) and tolerance >= 0):
        raise BusplanError(f"--tolerance {tolerance:g}: must be 0 or more, in percent")
    from busplan.profile.sources import load_revision

    first, second = load_each((a, b), lambda argument: call.changes.applied(load_revision(argument).profile))
    difference = busplan.diff(first, second, timing_model=chosen_model(timing_model), arguments=(a, b))
    regressions = difference.regression_words(tolerance_percent=tolerance or 0.0)
    return Fails(difference, regressions) if fail_on_regression and regressions else difference


def complete_code(incomplete: str) -> list[str]:
    """Complete the code of a rule for the shell."""
    from busplan.gate.rules import all_rules

    return [code for code in all_rules() if code.startswith(incomplete)]


@command(of="nothing")
def rule_command(
    code: Annotated[
        str | None,
        typer.Argument(
            autocompletion=complete_code, help="Code or name of a rule, as BP101 or syntax.  [default: all of them]"
        ),
    ] = None,
) -> "Report":
    """Explain a rule of `busplan check`: the problem, why it matters, and the remedy.

    Without a code it lists all rules with their severity. Exits 0.

    Example: busplan rule BP110
    """
    from busplan.gate.rules import rule_answer

    return rule_answer(code)


@command(of="nothing", answers=False)
def schema_command() -> None:
    """Print the JSON Schema of profiles (draft 2020-12), with every description and unit.

    With this file beside a profile, editors that read `#:schema ./busplan.schema.json` at its top complete and check
    it. Exits 0.

    Example: busplan schema > busplan.schema.json
    """
    from busplan.english import to_json
    from busplan.profile.kinds import profile_schema

    emit_document(to_json(profile_schema()))
