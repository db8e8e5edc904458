"""Wrap lines at spaces; a figure stays whole and beside its unit."""

import re
from collections.abc import Iterator
from typing import Final

from busplan.forms.lines import Line, Mark

_BREAK: Final = re.compile(r"(?<!\d)(?<!\+/-) +|(?<=\d) +(?![A-Za-z%])")
"""Where a line may end: not between a figure and its unit, nor between +/- and its figure."""


def wrapped(line: Line, width: int | None, *, hang: int = 0) -> list[Line]:
    """Wrap a line at spaces; a word longer than a line is broken.

    Parameters
    ----------
    line
        The line.
    width
        Most characters of a line; None for any number.
    hang
        Spaces before each line but the first.

    Examples
    --------
    >>> [one.text for one in wrapped(Line("Margin 230.064 us +/- 6.311 us of 500 us."), 20)]
    ['Margin 230.064 us', '+/- 6.311 us of', '500 us.']
    """
    if width is None or len(line.text) <= width:
        return [line]
    found: list[Line] = []
    for start, end in _spans(line.text, width, hang):
        indent = hang if found else 0
        marks = (
            Mark(max(one.start, start) - start + indent, min(one.end, end) - start + indent, one.tone)
            for one in line.marks
            if one.start < end and one.end > start
        )
        found.append(Line(" " * indent + line.text[start:end], line.tone, tuple(marks)))
    return found


def _spans(text: str, width: int, hang: int) -> Iterator[tuple[int, int]]:
    """Start and end of each line in the text."""
    breaks = [(match.start(), match.end()) for match in _BREAK.finditer(text) if match.start() > hang]
    start, room = 0, width
    while len(text) - start > room:
        fitting = [one for one in breaks if start < one[0] <= start + room]
        end, after = fitting[-1] if fitting else (start + room, start + room)
        yield start, end
        start, room = after, max(width - hang, 1)
    yield start, len(text)


def least_width(text: str) -> int:
    """Width of the longest piece of a text that no line break divides.

    Examples
    --------
    >>> least_width("ratio 0.73, 300 us")
    6
    """
    return max(map(len, _BREAK.split(text)))
