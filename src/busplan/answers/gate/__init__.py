"""Formats of the gate's report: each is a class and a line in `FORMATS`."""

from abc import ABC, abstractmethod
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple

if TYPE_CHECKING:
    from busplan.rules.report import CheckReport


class GateFormat(ABC):
    """One format of the gate's report."""

    is_for_people: ClassVar[bool] = False
    """If True, it is written in the encoding of the terminal; otherwise in UTF-8."""

    @abstractmethod
    def write(self, report: "CheckReport") -> str:
        """Write a report."""

    def log(self, report: "CheckReport") -> list[str]:  # noqa: ARG002 - most formats log nothing
        """Further lines for standard error."""
        return []


class Registered(NamedTuple):
    """Location of a format, so that only the requested one is loaded."""

    module: str
    """Module in this folder."""
    name: str
    """Name of the class."""
    is_for_builds: bool = False
    """Whether it is for a build service."""


FORMATS: Final[dict[str, Registered]] = {
    "text": Registered("plain", "Text"),
    "full": Registered("plain", "Full"),
    "json": Registered("documents", "Json"),
    "github": Registered("github", "GitHub", is_for_builds=True),
    "gitlab": Registered("documents", "GitLab", is_for_builds=True),
    "junit": Registered("junit", "JUnit", is_for_builds=True),
    "sarif": Registered("sarif", "Sarif", is_for_builds=True),
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
