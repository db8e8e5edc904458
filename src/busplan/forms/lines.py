"""Lines of text, plain or coloured, wrapped at spaces. A figure stays whole and beside its unit."""

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from textwrap import wrap
from typing import Final, Literal, NamedTuple

from busplan.english import printable

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
    """A part of a line with its own tone."""

    start: int
    end: int
    tone: Tone


class Line(NamedTuple):
    """A line of text."""

    text: str
    tone: Tone = "neutral"
    marks: tuple[Mark, ...] = ()


BLANK: Final = Line("")


def plain_text(lines: Iterable[Line]) -> str:
    """Text of lines without colours, each with a newline and with control characters escaped."""
    return "".join(f"{printable(line.text)}\n" for line in lines)


def styled_text(lines: Iterable[Line]) -> str:
    """Text of lines in a terminal's colours; NO_COLOR is honoured."""
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


_BREAK: Final = re.compile(r"(?<!\d)(?<!\+/-) +|(?<=\d) +(?![A-Za-z%])")
"""Places where a line may end: not between a figure and its unit, nor between +/- and its figure."""


def wrapped(line: Line, width: int | None, *, hang: int = 0) -> list[Line]:
    """Wrap a line at spaces, after `hang` spaces from the second line on. A word longer than a line is broken.

    `width` is the largest number of characters of a line; None for any.

    Examples
    --------
    >>> [line.text for line in wrapped(Line("Margin 230.064 us +/- 6.311 us of 500 us."), 20)]
    ['Margin 230.064 us', '+/- 6.311 us of', '500 us.']
    """
    if width is None or len(line.text) <= width:
        return [line]
    lines: list[Line] = []
    for start, end in _spans(line.text, width, hang):
        indent = hang if lines else 0
        marks = (
            Mark(max(mark.start, start) - start + indent, min(mark.end, end) - start + indent, mark.tone)
            for mark in line.marks
            if mark.start < end and mark.end > start
        )
        lines.append(Line(" " * indent + line.text[start:end], line.tone, tuple(marks)))
    return lines


def _spans(text: str, width: int, hang: int) -> Iterator[tuple[int, int]]:
    """Start and end of each line in the text."""
    breaks = [(match.start(), match.end()) for match in _BREAK.finditer(text) if match.start() > hang]
    start, room = 0, width
    while len(text) - start > room:
        fitting = [gap for gap in breaks if start < gap[0] <= start + room]
        end, after = fitting[-1] if fitting else (start + room, start + room)
        yield start, end
        start, room = after, max(width - hang, 1)
    yield start, len(text)


def least_width(text: str) -> int:
    """Width of the longest piece of a text between two possible line ends [columns].

    Examples
    --------
    >>> least_width("ratio 0.73, 300 us")
    6
    """
    return max(map(len, _BREAK.split(text)))


_HEAD: Final = "Legend: "
_UNBROKEN: Final = "\xa0"
"""Space at which no line ends."""


def legend_lines(words: Sequence[str], *, width: int) -> Iterator[Line]:
    """Legend in lines of at most `width` columns, wrapped between two entries."""
    entries = ", ".join(word.replace(" ", _UNBROKEN) for word in words)
    indent = " " * len(_HEAD)
    for line in wrap(
        entries, width, initial_indent=_HEAD, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    ):
        yield Line(line.replace(_UNBROKEN, " "), "drawn")
