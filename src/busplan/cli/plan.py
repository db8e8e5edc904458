"""`busplan plan`."""

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from busplan.cli.answering import answer, report_with
from busplan.cli.changes import takes_changes
from busplan.cli.destinations import profile_files, require_apart
from busplan.cli.options import STANDARD_OUTPUT, AllOption, FormatOption, ProfileArgument, option
from busplan.cli.output import PlanFailsError, emit_document, message_width, say
from busplan.cli.rewrite import apply_changes, require_own_file
from busplan.errors import BusplanError
from busplan.files import NewFile, new_file
from busplan.forms import ENDINGS, Form
from busplan.printable import printable
from busplan.profile.changes import NO_CHANGES, KeyChange, KeyChanges

if TYPE_CHECKING:
    from busplan.forms.blocks import Report
    from busplan.profile.toml import LoadedProfile
    from busplan.questions.plan import PlanAnswer

_PROFILE_ENDINGS = ("", ".toml")
_MAX_AXES = 1_000_000
_LONGEST_NAME = 100
_LONGEST_DESCRIPTION = 2000


@takes_changes(
    "Part of the goal: it is kept, and --apply and -o write it.",
    period=" with its unit, as 4ms, 250us or 0.001s; it is then kept.  "
    "[default: the profile's cycle.period_us, which may be changed]",
)
def plan_command(
    profile: ProfileArgument,
    nodes: Annotated[
        int | None,
        option(
            "--nodes N", "Goal: number of distributed nodes, the host not counted.  [default: the profile's bus.nodes]"
        ),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    axes: Annotated[
        int | None,
        option(
            "--axes N",
            "Goal: number of axes, instead of --nodes; the nodes follow from the profile's node.axes.  [default: "
            "those of the nodes]",
            min=1,
            max=_MAX_AXES,
        ),
    ] = None,
    free: Annotated[
        str | None,
        option(
            "--free NAMES",
            "Settings that may change, with commas, in the order of their cost: gap_count, slice_ratio, responses "
            "(reads concatenated, writes unified), schedule (where the bus has one), payload (less), period, nodes "
            "(fewer).  [default: gap_count,slice_ratio,period]",
        ),
    ] = None,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply", help="Write the recommended values into PROFILE, a file; comments and layout stay as they are."
        ),
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help=f"A name ending in {', '.join(ENDINGS)}: write the report there; an old file is replaced. Any other "
            "name, as NEW.toml: write a copy of PROFILE with the recommended values, whose name is that of the file; - "
            "is standard output, and the report goes to standard error.  [default: no file, and the report to standard "
            "output]",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Let -o NEW.toml overwrite a file that is already there.")
    ] = False,
    all_: AllOption = False,
    format_: FormatOption = None,
) -> None:
    """Tell what to set for a number of nodes or axes: gap count, slice ratio, period, or several of them.

    It changes one thing at a time, the cheapest first and as little as possible, until the goal is shown to fit with
    its reserve, at a safe gap count, within all [limits]; --free lists them by cost. The slice ratio goes up to 0.9;
    the period changes only if nothing cheaper is enough. Values given by an option are kept.

    The table has a row for each thing that was tried. Margins are in us, less the model's bias. Without a plan the
    answer names what prevents it and what would be enough. `busplan manual plan` has more. Exits 0 when there is a
    plan, 1 when there is none.

    Example: busplan plan paper-1ms --axes 16
    """
    if nodes is not None:
        changes = KeyChanges((KeyChange("bus.nodes", nodes, "--nodes", str(nodes)), *changes.each))
    report_file = output if output is not None and output.suffix.lower() in ENDINGS else None
    if report_file is None and output is not None and output.suffix.lower() not in _PROFILE_ENDINGS:
        raise BusplanError(
            f"--output {output}: expected a name ending in .toml for the profile, or in {', '.join(ENDINGS)} for the "
            "report"
        )
    new = None if report_file is not None else output
    _check_options(changes, axes=axes, apply=apply, new=new, force=force, format_=format_)
    piped = new == STANDARD_OUTPUT
    require_apart({"--output": None if piped else new}, inputs=profile_files(profile), of_profiles=True)
    with answer(format_, report_file, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.profile.shipped import load
        from busplan.questions.plan import plan

        if apply:
            require_own_file(profile)
        loaded = load(profile)
        with ExitStack() as files:
            # Opened before the search, so that a path that cannot be written fails at once.
            file = files.enter_context(new_file(new, overwrite=force)) if new and not piped else None
            result = plan(
                loaded.profile,
                axes=axes,
                wanted=changes,
                free=None if free is None else [name.strip() for name in free.split(",")],
            )
            if new is not None:
                _write_profile(loaded, result, file, name=None if piped else new.stem)
        if result.recommended is None:
            if apply or new:
                say(f"{profile if apply else new}: not written, for there is no plan")
        elif apply:
            _apply(loaded, result)
        elif file is not None:
            say(f"wrote {new}")
        (partial(_say_report, changes) if piped else give)(result.report())
    if result.recommended is None:
        raise PlanFailsError


def _check_options(
    changes: KeyChanges, *, axes: int | None, apply: bool, new: Path | None, force: bool, format_: Form | None
) -> None:
    problems = []
    if axes is not None:
        nodes = [change.typed for change in changes.each if change.key == "bus.nodes"]
        problems += [f"{typed} and --axes {axes}: give one of them" for typed in nodes]
    if apply and new is not None:
        problems.append(f"--apply and -o {new}: give one of them; -o leaves PROFILE as it is")
    if new == STANDARD_OUTPUT and format_ not in (None, "table"):
        problems.append(f"--format {format_} and -o -: standard output takes one document; give -o a file")
    if force and new is None:
        problems.append("--force: goes with -o NEW.toml")
    if problems:
        raise BusplanError(*problems)


def _apply(loaded: "LoadedProfile", result: "PlanAnswer") -> None:
    """Write the recommended values into the profile's file."""
    if not result.recommended_changes:
        say(f"{loaded.document.name}: nothing to change, left as it is")
        return
    apply_changes(loaded.document, _choices(result), are_choices=True)
    say(f"changed {loaded.document.name}: {result.recommended_words}")


def _write_profile(loaded: "LoadedProfile", result: "PlanAnswer", file: NewFile | None, *, name: str | None) -> None:
    """Write the recommended profile to its file or standard output; without a plan, an old file stays unchanged.

    A file is another plan than that of the profile: it has a name of its own, and what its description says is said
    of the profile that it comes from.
    """
    if result.recommended is not None:
        from busplan.profile.edit import edited_copy

        profile, choices = loaded.profile, _choices(result)
        if name is not None:
            choices["name"] = printable(name).strip()[:_LONGEST_NAME] or profile.name
            said = f"A plan of {profile.name}, which is: {profile.description.strip()}"[:_LONGEST_DESCRIPTION]
            choices |= {"description": said} if profile.description.strip() else {}
        write = emit_document if file is None else file.write
        write(edited_copy(loaded, choices))
    elif file is not None:
        file.abandon()


def _choices(result: "PlanAnswer") -> dict[str, object]:
    """The recommended values by key, as a file has them."""
    from busplan.profile.write import whole

    return {key: whole(value) for key, value in (result.recommended_changes or {}).items()}


def _say_report(changes: KeyChanges, report: "Report") -> None:
    """Write the report to standard error: standard output has the profile."""
    from busplan.forms.terminal import block_lines

    say(*(line.text for line in block_lines(report_with(changes, report).blocks, width=message_width())))
