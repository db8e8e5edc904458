"""Findings as lines: for people, editors and build logs."""

from typing import Final

from busplan.buses.rule import Severity
from busplan.forms.lines import Line, Mark, Tone, plain_text, styled_text
from busplan.gate.finding import Finding
from busplan.gate.formats import GateFormat
from busplan.gate.report import CheckReport
from busplan.printable import printable

TONES: Final[dict[Severity, Tone]] = {"error": "fails", "warning": "warns"}
"""Colour of each severity, which is always said in a word, too."""


def finding_parts(path: str, finding: Finding) -> tuple[str, str]:
    """Place and message of a finding."""
    return f"{path}:{finding.line}:{finding.column}:", f"{finding.code} {finding.severity}: {finding.message}"


def finding_line(path: str, finding: Finding) -> str:
    """Write path:line:column: CODE severity: message."""
    return printable(" ".join(finding_parts(path, finding)))


def marked_line(text: str, path: str, finding: Finding) -> Line:
    """Mark the place, the code and the severity of a line that begins with them."""
    place, words = finding_parts(path, finding)
    start = len(printable(place)) + 1
    said = Mark(start, start + words.index(": "), TONES[finding.severity])
    return Line(text, "drawn", (Mark(0, start, "title"), said))


class Concise(GateFormat):
    """One line for each finding."""

    def write(self, report: CheckReport) -> str:
        """Write the lines."""
        return plain_text(_lines(report))

    def on_terminal(self, report: CheckReport, *, width: int) -> str:  # noqa: ARG002 - a line is a line
        """Write the lines in colours; a terminal breaks them itself, so that each can be copied."""
        return styled_text(_lines(report))


def _lines(report: CheckReport) -> list[Line]:
    return [marked_line(finding_line(one.path, one.finding), one.path, one.finding) for one in report.located]
