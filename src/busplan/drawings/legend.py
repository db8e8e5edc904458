"""The legend of a drawing in characters."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.forms.lines import Line

_HEAD: Final = "Legend: "


def legend_lines(words: Sequence[str], *, width: int) -> Iterator[Line]:
    """Write the entries of a legend, wrapped to a width.

    Parameters
    ----------
    words
        The entries.
    width
        Most columns of a line.
    """
    line = _HEAD
    for number, word in enumerate(words):
        piece = word if number == len(words) - 1 else f"{word}, "
        if len(line) + len(piece.rstrip()) > width and line.strip():
            yield Line(line.rstrip(), "drawn")
            line = " " * len(_HEAD)
        line += piece
    yield Line(line.rstrip(), "drawn")
