"""Findings as lines: for people, for editors, and for GitHub's log."""

from collections.abc import Iterator
from typing import Final
from unicodedata import category, east_asian_width

from busplan.printable import printable
from busplan.rules.finding import Finding
from busplan.rules.report import CheckReport

_WIDEST: Final = 160
"""Of a line that is longer, `full` shows what stands around the finding."""


def finding_line(path: str, finding: Finding) -> str:
    """Write path:line:column: CODE message."""
    return printable(f"{path}:{finding.line}:{finding.column}: {finding.code} {finding.message}")


def summary_line(report: CheckReport) -> str:
    """Say how many profiles were checked, and what was found."""
    counts = report.summary
    failed = sum(file.failure is not None for file in report.files)
    words = (("profile", counts.files - failed), ("error", counts.errors), ("warning", counts.warnings))
    profiles, errors, warnings = (f"{number} {word}{'s' * (number != 1)}" for word, number in words)
    return f"checked {profiles}: {errors}, {warnings}{f'; {failed} could not be checked' if failed else ''}"


def as_text(report: CheckReport) -> str:
    """One line a finding."""
    return "".join(f"{finding_line(one.path, one.finding)}\n" for one in report.located)


def as_full(report: CheckReport) -> str:
    """Each finding with its line of the file and a caret below its column."""
    return "".join(f"{line}\n" for line in _full(report))


def _full(report: CheckReport) -> Iterator[str]:
    for one in report.located:
        number = str(one.finding.line)
        margin = " " * len(number)
        source, before = _shown(one.source, one.finding.column - 1)
        indent = "".join(map(_space, before))
        yield f"{finding_line(one.path, one.finding)}"
        yield f"{margin} |"
        yield f"{number} | {source}"
        yield f"{margin} | {indent}^ {one.finding.rule} ({one.finding.severity})"
        yield ""


def _shown(source: str, offset: int) -> tuple[str, str]:
    """Give a line as it is shown, and what of it stands before an offset."""
    harmless = "\t".join(printable(part, write=lambda _: " ") for part in source.split("\t"))
    if len(harmless) <= _WIDEST:
        return harmless, harmless[:offset]
    start = max(0, min(offset - _WIDEST // 2, len(harmless) - _WIDEST))
    before = f"{'...' if start else ''}{harmless[start:offset]}"
    after = harmless[offset : start + _WIDEST]
    return f"{before}{after}{'...' if start + _WIDEST < len(harmless) else ''}", before


def _space(character: str) -> str:
    """As much space as a character takes; a tab stays one, so that its width does not matter."""
    if character == "\t":
        return character
    if category(character) in ("Mn", "Me"):
        return ""
    return "  " if east_asian_width(character) in "WF" else " "


def as_github(report: CheckReport) -> str:
    """One workflow command a finding, which GitHub shows beside the line of the file."""
    return "".join(f"{line}\n" for line in _github(report))


def _github(report: CheckReport) -> Iterator[str]:
    for one in report.located:
        finding = one.finding
        properties = {
            "file": one.path,
            "line": str(finding.line),
            "col": str(finding.column),
            "title": f"{finding.code} {finding.rule}",
        }
        said = ",".join(f"{name}={_escaped(value, property_=True)}" for name, value in properties.items())
        yield f"::{finding.severity} {said}::{_escaped(finding.message, property_=False)}"


def _escaped(text: str, *, property_: bool) -> str:
    text = text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    # What GitHub has no escape for commands no terminal either.
    return printable(text.replace(":", "%3A").replace(",", "%2C") if property_ else text)
