"""Which columns of a table stand side by side on a narrow terminal, which below their row, and which are left out."""

from collections.abc import Sequence
from itertools import groupby
from typing import Final, NamedTuple

from busplan.forms.blocks import Table, TableColumn
from busplan.forms.wrapping import least_width

GAP: Final = 2
"""Blanks between two columns."""
_LEAST_WORDS: Final = 24
"""Narrowest column of wrapped words, unless a word is longer."""


_BROKEN_WORDS: Final = 16
"""Narrowest column of words that are broken."""


class Extent(NamedTuple):
    """How wide one column is."""

    natural: int
    """Width of its widest cell or heading."""
    least: int
    """Width below which a word, a figure or a heading would be broken."""
    broken: int
    """Width that is left to it where nothing else helps: words are broken, figures are not."""

    @classmethod
    def of(cls, column: TableColumn, heads: Sequence[str], cells: Sequence[str]) -> "Extent":
        """The width of a column.

        Parameters
        ----------
        column
            The column.
        heads
            Its headings.
        cells
            Its cells.
        """
        natural = max(map(len, (*heads, *cells)))
        if not column.wraps:
            return cls(natural, natural, natural)
        longest = max((least_width(cell) for cell in cells), default=0)
        least = min(natural, max(_LEAST_WORDS, min(longest, 2 * _LEAST_WORDS), *map(len, heads)))
        return cls(natural, least, min(least, _BROKEN_WORDS))


class Arrangement(NamedTuple):
    """How a table is laid out; columns by their index."""

    panels: tuple[tuple[int, ...], ...]
    """Columns that stand side by side; each further panel continues the table below."""
    below: tuple[int, ...]
    """Columns that stand below their row, in the first panel."""
    left_out: tuple[int, ...]


def arrangement(table: Table, extents: dict[int, Extent], *, width: int | None, is_whole: bool) -> Arrangement:
    """Choose the columns of each panel, so that no figure is cut.

    Parameters
    ----------
    table
        The table.
    extents
        Width of each column that is shown at all.
    width
        Width of the terminal; None for any width.
    is_whole
        If True, no column is left out.
    """
    side, below, left_out = list(extents), list[int](), list[int]()
    ranked = sorted(
        (number for number in extents if table.columns[number].rank),
        key=lambda number: (-table.columns[number].rank, -number),
    )
    for number in ranked:
        if width is None or _width(side, extents) <= width:
            break
        leaves = table.columns[number].leaves
        if leaves == "below" or not is_whole:
            side.remove(number)
            (below if leaves == "below" else left_out).append(number)
    panels = (tuple(side),) if width is None else tuple(_panels(table, side, extents, width))
    return Arrangement(panels, tuple(sorted(below)), tuple(sorted(left_out)))


def _width(columns: Sequence[int], extents: dict[int, Extent]) -> int:
    """Least width of columns side by side."""
    return sum(extents[number].least for number in columns) + GAP * (len(columns) - 1)


def _panels(table: Table, side: Sequence[int], extents: dict[int, Extent], width: int) -> list[tuple[int, ...]]:
    """Divide columns into panels that fit; columns of one group stay together where they can.

    Words are rather broken than a table is divided.
    """
    if sum(extents[number].broken for number in side) + GAP * (len(side) - 1) <= width:
        return [tuple(side)]
    heads = [number for number in side if number < table.heads]
    while len(heads) > 1 and any(_width([*heads, one], extents) > width for one in side[len(heads) :]):
        heads.pop()
    others = side[len(heads) :]
    runs = [list(run) for _, run in groupby(others, key=lambda one: table.columns[one].group or one)]
    pieces = [
        piece
        for run in runs
        for piece in ([run] if _width([*heads, *run], extents) <= width else [[one] for one in run])
    ]
    panels = [[*heads]]
    for piece in pieces:
        if len(panels[-1]) > len(heads) and _width([*panels[-1], *piece], extents) > width:
            panels.append([*heads])
        panels[-1] += piece
    return list(map(tuple, panels))


def shared_widths(columns: Sequence[int], extents: dict[int, Extent], *, width: int | None) -> list[int]:
    """Width of each column of a panel; columns that wrap share what is left.

    Parameters
    ----------
    columns
        The columns of the panel.
    extents
        Width of each.
    width
        Width of the terminal; None for any width.
    """
    if width is None:
        return [extents[number].natural for number in columns]
    found = {number: extents[number].least for number in columns}
    spare = width - _width(columns, extents)
    # The columns that need least come first: what they leave is for the others.
    wanting = sorted(columns, key=lambda number: extents[number].natural - extents[number].least)
    for place, number in enumerate(wanting):
        more = min(extents[number].natural - extents[number].least, max(spare, 0) // (len(wanting) - place))
        found[number] += more
        spare -= more
    # What names a row is broken last.
    for number in reversed(columns):
        less = min(found[number] - extents[number].broken, max(-spare, 0))
        found[number] -= less
        spare += less
    return [found[number] for number in columns]
