"""The legend of a drawing in characters."""

from collections.abc import Iterator, Sequence
from textwrap import wrap
from typing import Final

from busplan.forms.lines import Line

_HEAD: Final = "Legend: "
_UNBROKEN: Final = "\xa0"
"""A space at which no line ends."""


def legend_lines(words: Sequence[str], *, width: int) -> Iterator[Line]:
    """Write the entries of a legend, wrapped to a width between two entries.

    Parameters
    ----------
    words
        The entries.
    width
        Most columns of a line.
    """
    entries = ", ".join(word.replace(" ", _UNBROKEN) for word in words)
    indent = " " * len(_HEAD)
    for line in wrap(
        entries, width, initial_indent=_HEAD, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    ):
        yield Line(line.replace(_UNBROKEN, " "), "drawn")
