"""Formats of the gate's report: each is a function and a line in `FORMATS`."""

from collections.abc import Callable
from importlib import import_module
from typing import Final, Literal, NamedTuple


class GateFormat(NamedTuple):
    """A format of the gate's report."""

    module: str
    """Module in this folder; only that of the requested format is loaded."""
    function: str
    """Its function: a report to its text. That of a format for people takes the `width` of a terminal, too."""
    reader: Literal["people", "programs", "builds"]
    """Who reads it. Only what people read is in the encoding of the terminal; all else is UTF-8."""
    repeats: bool = False
    """If True, the concise lines go to standard error, too: GitHub shows ten annotations of a severity in a step."""

    @property
    def write(self) -> Callable[..., str]:
        """Function that writes a report."""
        function: Callable[..., str] = getattr(import_module(f"{__name__}.{self.module}"), self.function)
        return function


FORMATS: Final[dict[str, GateFormat]] = {
    "concise": GateFormat("text", "concise", "people"),
    "full": GateFormat("text", "full", "people"),
    "json": GateFormat("documents", "json", "programs"),
    "github": GateFormat("builds", "github", "builds", repeats=True),
    "gitlab": GateFormat("documents", "gitlab", "builds"),
    "junit": GateFormat("builds", "junit", "builds"),
    "sarif": GateFormat("documents", "sarif", "builds"),
    "markdown": GateFormat("builds", "markdown", "builds"),
}
"""Every format by its name, in the order of the help."""
