"""Lines of text, plain or with colours.

The layout is ours because a piped report must not pay for loading a renderer.
"""

import io
from collections.abc import Iterable
from typing import Final, Literal, NamedTuple

from busplan.printable import printable

Tone = Literal["passes", "fails", "warns", "title", "heading", "neutral", "drawn"]
"""How a line is meant: a state, a title, words, or what keeps its columns: headings and lines of a table."""
_STYLES: Final[dict[Tone, str]] = {
    "passes": "bold green",
    "fails": "bold red",
    "warns": "yellow",
    "title": "bold",
    "heading": "bold",
    "neutral": "",
    "drawn": "",
}
_NARROWEST: Final = 40


class Mark(NamedTuple):
    """A piece of a line with a tone of its own."""

    start: int
    end: int
    tone: Tone


class Line(NamedTuple):
    """One line, or one sentence that may be wrapped into several."""

    text: str
    tone: Tone = "neutral"
    marks: tuple[Mark, ...] = ()


BLANK: Final = Line("")


def plain_text(lines: Iterable[Line]) -> str:
    """Write lines without colours, each with its line end; nothing in them commands a terminal."""
    return "".join(f"{printable(line.text)}\n" for line in lines)


def styled_text(lines: Iterable[Line]) -> str:
    """Write lines for a terminal, with its colours and in its width; NO_COLOR is honoured."""
    from rich.console import Console
    from rich.text import Text

    buffer = io.StringIO()
    console = Console(file=buffer, force_terminal=True, highlight=False, markup=False, emoji=False)
    # On a terminal too narrow for a sentence, and for the lines of a table, the terminal breaks: no figure is ever cut.
    console.width = max(console.width, _NARROWEST)
    for line in lines:
        text = Text(printable(line.text), style=_STYLES[line.tone])
        for mark in line.marks:
            text.stylize(_STYLES[mark.tone], mark.start, mark.end)
        console.print(text, soft_wrap=line.tone in ("drawn", "heading"))
    return buffer.getvalue()
