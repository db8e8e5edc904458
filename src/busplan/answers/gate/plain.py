"""Findings as lines: for people, editors and build logs."""

from collections.abc import Iterator
from typing import Final
from unicodedata import category, east_asian_width

from busplan.answers.gate import GateFormat
from busplan.printable import printable
from busplan.rules.finding import Finding
from busplan.rules.report import CheckReport

_WIDEST: Final = 160
"""Longest source line shown whole; of a longer one `full` shows the part around the finding."""


def finding_parts(path: str, finding: Finding) -> tuple[str, str]:
    """Place and message of a finding."""
    return f"{path}:{finding.line}:{finding.column}:", f"{finding.code} {finding.message}"


def finding_line(path: str, finding: Finding) -> str:
    """Write path:line:column: CODE message."""
    return printable(" ".join(finding_parts(path, finding)))


class Text(GateFormat):
    """One line for each finding."""

    def write(self, report: CheckReport) -> str:
        """Write the lines."""
        return "".join(f"{finding_line(one.path, one.finding)}\n" for one in report.located)


class Full(GateFormat):
    """Each finding with its line of the file and a caret below its column."""

    def write(self, report: CheckReport) -> str:
        """Write the lines of each finding."""
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
    """A source line as shown, and its part before an offset."""
    harmless = "\t".join(printable(part, write=lambda _: " ") for part in source.split("\t"))
    if len(harmless) <= _WIDEST:
        return harmless, harmless[:offset]
    start = max(0, min(offset - _WIDEST // 2, len(harmless) - _WIDEST))
    before = f"{'...' if start else ''}{harmless[start:offset]}"
    after = harmless[offset : start + _WIDEST]
    return f"{before}{after}{'...' if start + _WIDEST < len(harmless) else ''}", before


def _space(character: str) -> str:
    """Spaces as wide as a character; a tab stays a tab, whatever its width."""
    if character == "\t":
        return character
    if category(character) in ("Mn", "Me"):
        return ""
    return "  " if east_asian_width(character) in "WF" else " "
