"""Formats of the gate's report: each is a class and a line in `FORMATS`."""

from abc import ABC, abstractmethod
from importlib import import_module
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

if TYPE_CHECKING:
    from busplan.gate.report import CheckReport


class GateFormat(ABC):
    """One format of the gate's report."""

    @abstractmethod
    def write(self, report: "CheckReport") -> str:
        """Write a report."""

    def on_terminal(self, report: "CheckReport", *, width: int) -> str:  # noqa: ARG002 - most formats have one look
        """Write a report in the colours of a terminal.

        Parameters
        ----------
        report
            The report.
        width
            Width of sentences and source lines, in columns.
        """
        return self.write(report)

    def log(self, report: "CheckReport") -> list[str]:  # noqa: ARG002 - most formats log nothing
        """Further lines for standard error."""
        return []


class Registered(NamedTuple):
    """Location of a format, so that only the requested one is loaded."""

    module: str
    """Module in this folder."""
    name: str
    """Name of the class."""
    reader: Literal["people", "programs", "builds"]
    """Who reads it. Only what people read is in the encoding of the terminal; all else is UTF-8."""


FORMATS: Final[dict[str, Registered]] = {
    "concise": Registered("plain", "Concise", "people"),
    "full": Registered("full", "Full", "people"),
    "text": Registered("plain", "Concise", "people"),
    "json": Registered("documents", "Json", "programs"),
    "github": Registered("github", "GitHub", "builds"),
    "gitlab": Registered("documents", "GitLab", "builds"),
    "junit": Registered("junit", "JUnit", "builds"),
    "sarif": Registered("sarif", "Sarif", "builds"),
    "markdown": Registered("markdown", "Markdown", "builds"),
}
"""Every format by its name, in the order of the help."""


def gate_format(name: str) -> GateFormat:
    """Load one of the formats.

    Parameters
    ----------
    name
        One of `FORMATS`.
    """
    place = FORMATS[name]
    made: type[GateFormat] = getattr(import_module(f"{__name__}.{place.module}"), place.name)
    return made()
