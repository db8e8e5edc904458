"""Formats of the gate's report. `busplan.gate.report`, which writes them, loads only when needed."""

from collections.abc import Callable
from importlib import import_module
from typing import Final, Literal, NamedTuple


class GateFormat(NamedTuple):
    """A format of the gate's report."""

    function: str
    """Function of `busplan.gate.report` that turns a report into text; for people, at the `width` of a terminal."""
    reader: Literal["people", "programs", "builds"]
    """Readers of the format. Only a format for people takes the terminal's encoding; others are UTF-8."""
    repeats: bool = False
    """Whether the concise lines go to standard error, too: GitHub shows ten annotations of a severity in a step."""

    @property
    def write(self) -> Callable[..., str]:
        """Function that writes a report."""
        function: Callable[..., str] = getattr(import_module("busplan.gate.report"), self.function)
        return function


FORMATS: Final[dict[str, GateFormat]] = {
    "concise": GateFormat("concise", "people"),
    "full": GateFormat("full", "people"),
    "json": GateFormat("json", "programs"),
    "github": GateFormat("github", "builds", repeats=True),
    "gitlab": GateFormat("gitlab", "builds"),
    "junit": GateFormat("junit", "builds"),
    "sarif": GateFormat("sarif", "builds"),
    "markdown": GateFormat("markdown_report", "builds"),
}
"""Formats by name, in the order of the help."""
