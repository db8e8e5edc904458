"""Findings as workflow commands, which GitHub shows next to the line of the file."""

from busplan.gate.formats import GateFormat
from busplan.gate.formats.plain import Concise
from busplan.gate.report import CheckReport, Located
from busplan.printable import printable


class GitHub(GateFormat):
    """One workflow command for each finding."""

    def write(self, report: CheckReport) -> str:
        """Write the commands."""
        return "".join(f"{_command(one)}\n" for one in report.located)

    def log(self, report: CheckReport) -> list[str]:
        """Every finding: GitHub shows only ten annotations of a severity in a step."""
        return Concise().write(report).splitlines()


def _command(one: Located) -> str:
    finding = one.finding
    properties = {
        "file": one.path,
        "line": str(finding.line),
        "col": str(finding.column),
        "title": f"{finding.code} {finding.rule}",
    }
    said = ",".join(f"{name}={_escaped(value, property_=True)}" for name, value in properties.items())
    return f"::{finding.severity} {said}::{_escaped(finding.message, property_=False)}"


def _escaped(text: str, *, property_: bool) -> str:
    text = text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    # GitHub has no escape for other control characters.
    return printable(text.replace(":", "%3A").replace(",", "%2C") if property_ else text)
