"""Reports of the gate: text, JSON, SARIF, JUnit, and formats for builds."""

import os
import re
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path, PurePath
from textwrap import wrap
from typing import Any, Final, NamedTuple
from unicodedata import category, east_asian_width
from urllib.parse import quote
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from busplan import __version__
from busplan.buses.rule import Rule, Severity
from busplan.english import nouns, plural, printable, printable_lines, to_json, told_apart
from busplan.forms import blocks, markdown, terminal
from busplan.forms.lines import BLANK, Line, Mark, Tone, plain_text, styled_text
from busplan.forms.markdown import code, escaped, table
from busplan.forms.numbers import MISSING, sentence_text
from busplan.gate.finding import Finding, finding_line, finding_parts
from busplan.gate.gate import FileResult, Fit, Suppressed
from busplan.gate.rules import all_rules, rule_report
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.questions.base.sentences import changed_document, changes_sentences, document


class Summary(NamedTuple):
    """Counts of one run of the gate."""

    files: int
    errors: int
    warnings: int
    circles_not_run: int = 0
    suppressed: int = 0


class Located(NamedTuple):
    """A finding with its file, and a fingerprint independent of lines and of other rules' findings."""

    path: str
    finding: Finding
    source: str
    fingerprint: str


class CheckReport(NamedTuple):
    """Result of a run of the gate."""

    files: tuple[FileResult, ...]
    """Files, each with its `status`, its `findings` and, if it could not be checked, its `failure`."""
    changes: KeyChanges = NO_CHANGES
    """Changes made in every file."""
    others: int = 0
    """Number of files skipped because they are no profiles."""
    unmatched: str = ""
    """Message on profiles without a record and records without a profile; empty where there are none."""
    lists_all: bool = False
    """Whether people read every finding of a rule that is otherwise told once a file."""

    @property
    def summary(self) -> Summary:
        """Number of files, errors, warnings, circle tests that were not run, and suppressed findings."""
        severities = [finding.severity for file in self.files for finding in file.findings]
        not_run = sum(file.circle_not_run for file in self.files)
        suppressed = sum(len(file.suppressed) for file in self.files)
        return Summary(len(self.files), severities.count("error"), severities.count("warning"), not_run, suppressed)

    @property
    def failed(self) -> bool:
        """Whether a file could not be checked."""
        return any(file.failure is not None for file in self.files)

    def has_findings(self, least: Severity) -> bool:
        """Whether there are findings at or above a severity."""
        return self.summary.errors > 0 or (least == "warning" and self.summary.warnings > 0)

    @property
    def located(self) -> tuple[Located, ...]:
        """All findings by file and place."""
        located = []
        for file in self.files:
            seen: dict[tuple[str, str], int] = {}
            for finding, source in zip(file.findings, file.source, strict=True):
                same = (finding.code, finding.key)
                number = seen[same] = seen.get(same, -1) + 1
                located.append(Located(file.path, finding, source, _fingerprint(file.path, finding, str(number))))
        return tuple(located)

    @property
    def told(self) -> tuple[Located, ...]:
        """Findings for people; for a rule that is told once a file, only the heaviest."""
        if self.lists_all:
            return self.located
        heaviest: dict[tuple[str, str], Located] = {}
        for located in sorted(self.located, key=lambda located: -located.finding.weight):
            heaviest.setdefault((located.path, located.finding.code), located)
        return tuple(
            located
            for located in self.located
            if located.finding.code not in _TOLD_ONCE or located in heaviest.values()
        )


def _fingerprint(path: str, finding: Finding, number: str) -> str:
    mark = f"{path}\0{finding.code}\0{finding.key}\0{number}"
    return sha256(mark.encode("utf-8", "surrogatepass")).hexdigest()


_TOLD_ONCE: Final = ("BP112",)
"""Rules of which text has one finding of each file."""


def check_report(report: CheckReport) -> blocks.Report:
    """Report of `check`."""
    return blocks.Report(
        blocks.Sentence(("Check of profiles",)),
        tuple(_sentences(report)),
        check_document(report),
        [{"path": located.path, **located.finding.record} for located in report.located],
    )


def _sentences(report: CheckReport) -> Iterator[blocks.Sentence]:
    """Each finding, each file that could not be checked, and the summary."""
    for located in report.told:
        place, words = finding_parts(located.path, located.finding)
        yield blocks.Sentence(
            (blocks.Code(place), f" {words}"), "fails" if located.finding.severity == "error" else "warns"
        )
    yield from (blocks.Sentence((file.failure,), "fails") for file in report.files if file.failure is not None)
    yield summary_sentence(report)


def summary_sentence(report: CheckReport) -> blocks.Sentence:
    """Sentence with the number of profiles checked, and of what was found."""
    counts = report.summary
    failed = sum(file.failure is not None for file in report.files)
    checked = counts.files - failed
    summary = blocks.sentence(
        f"checked {{}} {nouns(checked, 'profile')}: {{}} {nouns(counts.errors, 'error')}, "
        f"{{}} {nouns(counts.warnings, 'warning')}",
        blocks.count_value(checked, "files"),
        blocks.count_value(counts.errors, "errors"),
        blocks.count_value(counts.warnings, "warnings"),
        state=_state(report),
    )
    parts = (
        (failed, "{} could not be checked"),
        (counts.circles_not_run, f"{{}} {nouns(counts.circles_not_run, 'circle test')} not run"),
        (counts.suppressed, f"{{}} {nouns(counts.suppressed, 'finding')} suppressed"),
        (len(report.located) - len(report.told), "{} similar findings not shown (--verbose)"),
        (report.others, f"skipped {{}} {nouns(report.others, 'file')} without a schema_version"),
    )
    return blocks.joined(
        summary, *(blocks.sentence(words, blocks.count_value(number)) for number, words in parts if number), by="; "
    )


def _state(report: CheckReport) -> blocks.State:
    if report.failed or report.has_findings("error"):
        return "fails"
    return "warns" if report.has_findings("warning") else "passes"


def check_document(report: CheckReport) -> blocks.JsonDocument:
    """Document of `busplan check --format json`."""
    files = []
    for file in report.files:
        content = {
            "path": file.path,
            "profile": file.profile,
            "status": file.status,
            **_fit_record(file.fit or Fit()),
            "findings": [finding.record for finding in file.findings],
            "suppressed": [{**each.finding.record, "by": each.by, "reason": each.reason} for each in file.suppressed],
        }
        files.append(content if file.failure is None else {**content, "failure": file.failure})
    return changed_document(document("check", files=files, summary=report.summary._asdict()), report.changes)


TONES: Final[dict[Severity, Tone]] = {"error": "fails", "warning": "warns"}
"""Colour of each severity, in addition to its word."""


def marked_line(text: str, path: str, finding: Finding) -> Line:
    """A line with its place, code and severity marked, with which it begins."""
    place, words = finding_parts(path, finding)
    start = len(printable(place)) + 1
    severity = Mark(start, start + words.index(": "), TONES[finding.severity])
    return Line(text, "drawn", (Mark(0, start, "title"), severity))


def concise(report: CheckReport, *, width: int | None = None) -> str:
    """One line for each finding; in colours for a width, at which the terminal breaks the lines itself."""
    lines = [
        marked_line(finding_line(located.path, located.finding), located.path, located.finding)
        for located in report.told
    ]
    return plain_text(lines) if width is None else styled_text(lines)


WIDTH: Final = 100
"""Columns of the widest line: sentences are wrapped, and source lines cut."""
_INDENT: Final = 4 * " "
_CUT: Final = "..."
_UNBROKEN: Final = "\xa0"
"""Space at which no line ends; printable text has none."""
_NUMBER_AND_WORD: Final = re.compile(r"(?<=[0-9]) (?=[a-z])")


def full(report: CheckReport, *, width: int | None = None) -> str:
    """Each finding with its line of the file; in colours for the width of a terminal, in columns."""
    return plain_text(_lines(report, WIDTH)) if width is None else styled_text(_lines(report, min(width, WIDTH)))


def _lines(report: CheckReport, width: int) -> Iterator[Line]:
    for located in report.told:
        yield from _heading(located, width)
        yield from _source(located, width)
        yield from _mending(located, width)
        yield BLANK


def _heading(located: Located, width: int) -> Iterator[Line]:
    """Place, code and severity, which editors read, then the problem, wrapped."""
    place, words = finding_parts(located.path, located.finding)
    head = printable(f"{place} {words.removesuffix(located.finding.message)}")
    first, *rest = _wrapped(located.finding.problem, width, first=head)
    yield marked_line(first, located.path, located.finding)
    yield from (Line(line, "drawn") for line in rest)


def _source(located: Located, width: int) -> Iterator[Line]:
    number, finding = str(located.finding.line), located.finding
    margin = f"{' ' * len(number)} | "
    shown = _shown(located.source, finding.marked_column - 1, finding.marked_end_column - 1, width - len(margin))
    under = f"{margin}{' ' * _columns(shown.before)}"
    carets = "^" * max(_columns(shown.marked), 1)
    named = f"{under}{carets} {finding.rule}"
    marked = named if len(named) <= width else f"{under}{carets}"
    yield Line(margin.rstrip(), "drawn")
    yield Line(f"{number} | {shown.before}{shown.marked}{shown.after}".rstrip(), "drawn")
    yield Line(marked, "drawn", (Mark(len(under), len(marked), TONES[finding.severity]),))


def _mending(located: Located, width: int) -> Iterator[Line]:
    if located.finding.help:
        yield from (Line(line, "drawn") for line in _wrapped(located.finding.help, width, first="help: "))
    if located.finding.cure:
        yield Line("cheapest cure:", "drawn")
        yield from (Line(f"{_INDENT}{line}", "drawn") for line in located.finding.cure.split("\n"))


def _wrapped(text: str, width: int, *, first: str) -> list[str]:
    """Lines of a sentence, broken between words but not between a number and its unit."""
    lines = wrap(
        _NUMBER_AND_WORD.sub(_UNBROKEN, printable(text)),
        width,
        initial_indent=first,
        subsequent_indent=_INDENT,
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
    return [line.replace(_UNBROKEN, " ") for line in lines]


class _Shown(NamedTuple):
    """A source line as shown, in three parts around the mark."""

    before: str
    marked: str
    after: str


def _shown(source: str, start: int, end: int, width: int) -> _Shown:
    """Cut a source line around its mark; tabs become spaces, so that the carets stand below the mark."""
    parts = source[:start], source[start:end], source[end:]
    before, marked, after = (
        printable(part, write=lambda character: _INDENT if character == "\t" else " ") for part in parts
    )
    if _columns(before + marked + after) <= width:
        return _Shown(before, marked, after)
    room = width - 2 * len(_CUT)
    marked, rest = marked[:room], marked[room:]
    kept = max(room - len(marked), 0)
    behind = (rest + after)[: max(kept - len(before), kept // 2)]
    ahead = before[max(len(before) - (kept - len(behind)), 0) :]
    return _Shown(
        f"{_CUT if ahead != before else ''}{ahead}", marked, f"{behind}{_CUT if behind != rest + after else ''}"
    )


def _columns(text: str) -> int:
    """Width of a text in a terminal [columns]."""
    return sum(
        0 if category(character) in ("Mn", "Me") else 2 if east_asian_width(character) in "WF" else 1
        for character in text
    )


def json(report: CheckReport) -> str:
    """The document of `busplan check`."""
    return to_json(check_document(report))


def gitlab(report: CheckReport) -> str:
    """GitLab's code quality report: one issue for each finding."""
    issues = [
        {
            "description": f"{located.finding.code} {located.finding.message}",
            "check_name": located.finding.rule,
            "fingerprint": located.fingerprint,
            "severity": "major" if located.finding.severity == "error" else "minor",
            "location": {"path": PurePath(located.path).as_posix(), "lines": {"begin": located.finding.line}},
        }
        for located in report.located
    ]
    return to_json(issues)


_SCHEMA: Final = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif(report: CheckReport) -> str:
    """One SARIF run with all rules and results; files that could not be checked are notifications."""
    failures = [file for file in report.files if file.failure is not None]
    run = {
        "tool": {
            "driver": {
                "name": "busplan",
                "semanticVersion": __version__,
                "rules": [_rule(rule) for rule in all_rules().values()],
            }
        },
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                "executionSuccessful": not failures,
                "toolExecutionNotifications": [
                    {"level": "error", "message": {"text": file.failure}} for file in failures
                ],
            }
        ],
        "results": [
            *(_result(located) for located in report.located),
            *(_suppressed_result(file.path, each) for file in report.files for each in file.suppressed),
        ],
    }
    document = {"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}
    return to_json(document)


def _rule(rule: Rule) -> blocks.JsonDocument:
    page = rule_report(rule)
    return {
        "id": rule.code,
        "name": "".join(word.capitalize() for word in rule.name.split("-")),
        "shortDescription": {"text": rule.summary},
        "fullDescription": {"text": rule.explanation},
        "help": {"text": terminal.text(page), "markdown": markdown.text(page)},
        "defaultConfiguration": {"level": rule.severity},
    }


def _result(located: Located) -> blocks.JsonDocument:
    finding = located.finding
    return {
        "ruleId": finding.code,
        "ruleIndex": list(all_rules()).index(finding.code),
        "level": finding.severity,
        "message": {"text": finding.message},
        "locations": [
            {
                "physicalLocation": {
                    "artifactLocation": _artifact(located.path),
                    "region": {
                        "startLine": finding.line,
                        "startColumn": finding.column,
                        "endColumn": finding.marked_end_column,
                    },
                }
            }
        ],
        "partialFingerprints": {"busplanFinding/v1": located.fingerprint},
        # SARIF's own fixes are edits of a file, but a cure may be a key that the file does not have.
        **({"properties": {"cure": finding.cure}} if finding.cure else {}),
    }


def _suppressed_result(path: str, suppressed: Suppressed) -> blocks.JsonDocument:
    kind = "inSource" if suppressed.by == "comment" else "external"
    located = Located(path, suppressed.finding, "", _fingerprint(path, suppressed.finding, "suppressed"))
    why = {"justification": suppressed.reason} if suppressed.reason else {}
    return {**_result(located), "suppressions": [{"kind": kind, **why}]}


def _artifact(path: str) -> dict[str, str]:
    """URI of a file, relative to the working folder if the file is below it."""
    pure = PurePath(path)
    if pure.is_absolute() or ".." in pure.parts:
        return {"uri": Path(path).resolve().as_uri()}
    return {"uri": quote(os.fsencode(pure.as_posix())), "uriBaseId": "%SRCROOT%"}


def github(report: CheckReport) -> str:
    """Workflow commands, one for each finding.

    GitHub shows it next to the line of the file, by its path from the root.
    """
    lines = []
    paths = {file.path: _from_root(file.path) for file in report.files}
    for path, finding, _, _ in report.located:
        place = {
            "file": paths.get(path, path),
            "line": finding.line,
            "col": finding.column,
            "title": f"{finding.code} {finding.rule}",
        }
        properties = ",".join(
            f"{name}={_escaped(str(value)).replace(':', '%3A').replace(',', '%2C')}" for name, value in place.items()
        )
        lines.append(f"::{finding.severity} {properties}::{_escaped(finding.message)}\n")
    return "".join(lines)


def _from_root(path: str) -> str:
    """Path of a file from the root of its git working tree; other paths stay as they are."""
    try:
        whole = Path(os.path.abspath(path))  # noqa: PTH100 - a link keeps its own name
        root = next(folder for folder in whole.parents if (folder / ".git").exists())
        return whole.relative_to(root).as_posix() if whole.exists() else path
    except (OSError, StopIteration, ValueError):
        return path


def _escaped(text: str) -> str:
    """Escape line ends as GitHub does. It has no escape for other control characters."""
    return printable(text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A"))


_NO_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(report: CheckReport) -> str:
    """Test cases by profile: errors are failures, files that could not be checked errors, warnings output."""
    failures = sum(any(finding.severity == "error" for finding in file.findings) for file in report.files)
    errors = sum(file.failure is not None for file in report.files)
    counts = {"tests": str(len(report.files)), "failures": str(failures), "errors": str(errors)}
    root = Element("testsuites", {"name": "busplan check", **counts})
    suite = SubElement(root, "testsuite", {"name": "busplan check", **counts})
    for file in report.files:
        case = SubElement(suite, "testcase", classname="busplan.check", name=_clean(file.path), file=_clean(file.path))
        if file.failure is not None:
            SubElement(case, "error", message=_clean(file.failure))
        for severity, tag in (("error", "failure"), ("warning", "system-out")):
            findings = [finding for finding in file.findings if finding.severity == severity]
            if findings:
                first = {"message": _clean(findings[0].message), "type": findings[0].code} if tag == "failure" else {}
                lines = "\n".join(finding_line(file.path, finding) for finding in findings)
                SubElement(case, tag, first).text = _clean(lines)
    indent(root)
    return tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _clean(text: str) -> str:
    return _NO_XML.sub("?", printable_lines(text))


_PROFILES: Final = ("profile", "result", "verdict", "corrected margin, us")
_FINDINGS: Final = ("place", "rule", "severity", "problem", "remedy")


def _fit_record(fit: Fit) -> dict[str, Any]:
    rests_on = [{"key": part.key or None, "words": part.words} for part in fit.rests_on]
    return {**fit._asdict(), "rests_on": rests_on}


def markdown_report(report: CheckReport) -> str:
    """Table of the profiles with their verdicts, and table of the findings; an empty one is left out."""
    sentences = (*changes_sentences(report.changes), summary_sentence(report))
    lines = ["### Check of profiles", "", escaped(" ".join(map(sentence_text, sentences)))]
    if report.files:
        lines += ["", *table(_PROFILES, map(_profile, report.files), left=3)]
    if report.told:
        lines += ["", *table(_FINDINGS, map(_finding_row, report.told), left=len(_FINDINGS))]
    return "".join(f"{line}\n" for line in lines)


def _profile(file: FileResult) -> list[str]:
    fit = file.fit or Fit()
    margin = MISSING
    if fit.margin_corrected_us is not None:
        doubt = "" if fit.uncertainty_us is None else f" +/- {fit.uncertainty_us:.1f}"
        margin = f"{told_apart(fit.margin_corrected_us, 0.0)[0]}{doubt}"
    return [code(file.path), _profile_result(file), fit.verdict or MISSING, margin]


def _profile_result(file: FileResult) -> str:
    if file.failure is not None:
        return f"**could not be checked**: {escaped(file.failure)}"
    severities = [finding.severity for finding in file.findings]
    counts = [
        plural(severities.count(severity), severity) for severity in ("error", "warning") if severity in severities
    ]
    words = ", ".join(counts) or "passes"
    return f"**{words}**" if "error" in severities else words


def _finding_row(located: Located) -> list[str]:
    finding = located.finding
    mending = [escaped(finding.help)] if finding.help else []
    mending += map(code, finding.cure.split("\n")) if finding.cure else []
    place = code(f"{located.path}:{finding.line}:{finding.column}")
    words = [escaped(f"{finding.code} {finding.rule}"), finding.severity, escaped(finding.problem)]
    return [place, *words, "<br>".join(mending)]
