"""Lines of text, plain or coloured.

Plain lines are laid out here, so that piped output does not load rich.
"""

import io
from collections.abc import Iterable
from typing import Final, Literal, NamedTuple

from busplan.printable import printable

Tone = Literal["passes", "fails", "warns", "title", "heading", "neutral", "drawn"]
"""Style of a line."""
_STYLES: Final[dict[Tone, str]] = {
    "passes": "bold green",
    "fails": "bold red",
    "warns": "yellow",
    "title": "bold",
    "heading": "bold",
    "neutral": "",
    "drawn": "",
}


class Mark(NamedTuple):
    """Part of a line with its own tone."""

    start: int
    end: int
    tone: Tone


class Line(NamedTuple):
    """One line."""

    text: str
    tone: Tone = "neutral"
    marks: tuple[Mark, ...] = ()


BLANK: Final = Line("")


def plain_text(lines: Iterable[Line]) -> str:
    """Write lines without colours, each with a newline and with control characters escaped."""
    return "".join(f"{printable(line.text)}\n" for line in lines)


def styled_text(lines: Iterable[Line]) -> str:
    """Write lines for a terminal, in its colours; NO_COLOR is honoured."""
    from rich.console import Console
    from rich.text import Text

    buffer = io.StringIO()
    console = Console(file=buffer, force_terminal=True, highlight=False, markup=False, emoji=False)
    for line in lines:
        text = Text(printable(line.text), style=_STYLES[line.tone])
        for mark in line.marks:
            text.stylize(_STYLES[mark.tone], mark.start, mark.end)
        console.print(text, soft_wrap=True)
    return buffer.getvalue()
