"""A table as lines of text, in the width of a terminal: no figure is cut."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby, zip_longest
from typing import Final, NamedTuple

from busplan.english import printable
from busplan.forms.blocks import Cell, Sentence, ShownValue, Table, TableColumn, TableRow, Words
from busplan.forms.lines import BLANK, Line, Mark, Tone, least_width, wrapped
from busplan.forms.numbers import cell_text, left_out_sentence

GAP: Final = 2
"""Blanks between two columns."""
_LEAST_WORDS: Final = 24
"""Narrowest column of wrapped words, unless a word is longer."""


_BROKEN_WORDS: Final = 16
"""Narrowest column of broken words, as a last resort."""


class Extent(NamedTuple):
    """How wide one column is."""

    natural: int
    """Width of its widest cell or heading."""
    least: int
    """Width below which a word, a figure or a heading would be broken."""
    broken: int
    """Width as a last resort: words are broken, figures are not."""

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

    Words are broken before a table is divided.
    """
    if sum(extents[number].broken for number in side) + GAP * (len(side) - 1) <= width:
        return [tuple(side)]
    heads = [number for number in side if number < table.heads]
    while len(heads) > 1 and any(_width([*heads, number], extents) > width for number in side[len(heads) :]):
        heads.pop()
    others = side[len(heads) :]
    runs = [list(run) for _, run in groupby(others, key=lambda number: table.columns[number].group or number)]
    pieces = [
        piece
        for run in runs
        for piece in ([run] if _width([*heads, *run], extents) <= width else [[number] for number in run])
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
    widths = {number: extents[number].least for number in columns}
    spare = width - _width(columns, extents)
    # Columns that need the least come first; what they do not need is left to the others.
    wanting = sorted(columns, key=lambda number: extents[number].natural - extents[number].least)
    for place, number in enumerate(wanting):
        more = min(extents[number].natural - extents[number].least, max(spare, 0) // (len(wanting) - place))
        widths[number] += more
        spare -= more
    # The first columns, which name a row, are broken last.
    for number in reversed(columns):
        less = min(widths[number] - extents[number].broken, max(-spare, 0))
        widths[number] -= less
        spare += less
    return [widths[number] for number in columns]


_FAILS: Final = " !"
"""After a figure that fails, for those who see no colours."""
_TABLE_INDENT: Final = 4
"""Blanks before what stands below its row."""


class _Column(NamedTuple):
    """A column as text."""

    number: int
    is_left: bool
    heads: tuple[str, ...]
    """Unit, heading and group, from the bottom."""
    cells: list[str]
    tones: list[Tone]


class _Placed(NamedTuple):
    """A column at its place in a panel."""

    column: _Column
    start: int
    width: int


def table_lines(table: Table, *, width: int | None = None, is_whole: bool = False, whole_by: str = "") -> list[Line]:
    """Lay out a table: words left, figures right, a rule below the headings, and below it what is left out.

    Parameters
    ----------
    table
        The table. Columns of drawings are left out: the figure is in another column.
    width
        Width of the terminal; None for any width.
    is_whole
        If True, no row and no column is left out.
    whole_by
        Words that tell the reader how to see what is left out.
    """
    rows = [row for row in table.rows if is_whole or not row.is_detail]
    columns = {
        number: _column(table.columns[number], rows, number)
        for number, column in enumerate(table.columns)
        if column.kind != "drawing" and (is_whole or not column.is_detail)
    }
    extents = {
        number: Extent.of(table.columns[number], column.heads, column.cells) for number, column in columns.items()
    }
    chosen = arrangement(table, extents, width=width, is_whole=is_whole)
    lines: list[Line] = []
    for panel in chosen.panels:
        placed = list(_placed([columns[number] for number in panel], shared_widths(panel, extents, width=width)))
        lines += [BLANK] if lines else []
        lines += _heading(placed)
        for at, row in enumerate(rows):
            lines += _row_lines(row, at, placed)
            if panel is chosen.panels[0]:
                lines += _below(at, {table.columns[number].name: columns[number] for number in chosen.below}, width)
    left_out = left_out_sentence(
        len(table.rows) - len(rows),
        [table.columns[number].name for number in chosen.left_out],
        whole_by=whole_by,
    )
    fails = any(cell.endswith(_FAILS) for column in columns.values() for cell in column.cells)
    notes = " ".join(filter(None, ("! fails." * fails, left_out)))
    return [*lines, *(wrapped(Line(notes), width) if notes else [])]


def _column(column: TableColumn, rows: Sequence[TableRow], number: int) -> _Column:
    """The column as text; the first one is indented, and a figure that fails has its mark."""
    heads = tuple(filter(None, (column.unit, column.heading, column.group)))
    cells = [("  " * row.level if number == 0 else "") + _one_line(row.cells[number]) for row in rows]
    failing = [_is_failing_figure(row.cells[number]) for row in rows]
    is_left = column.kind == "words"
    if any(failing):
        blank = "" if is_left else " " * len(_FAILS)
        heads = tuple(f"{head}{blank}" for head in heads)
        cells = [f"{cell}{_FAILS if fails else blank}" for cell, fails in zip(cells, failing, strict=True)]
    return _Column(number, is_left, heads, cells, [_tone(row.cells[number]) for row in rows])


def _one_line(cell: Cell) -> str:
    return printable(" ".join(cell_text(cell).split()))


def _is_failing_figure(cell: Cell) -> bool:
    """Whether a cell is a figure that fails; words say so themselves."""
    return isinstance(cell, ShownValue) and cell.state == "fails" and not isinstance(cell.value, str)


def _tone(cell: Cell) -> Tone:
    return cell.state if isinstance(cell, ShownValue | Words | Sentence) else "neutral"


def _placed(columns: Sequence[_Column], widths: Sequence[int]) -> Iterator[_Placed]:
    start = 0
    for column, width in zip(columns, widths, strict=True):
        yield _Placed(column, start, width)
        start += width + GAP


def _heading(placed: Sequence[_Placed]) -> list[Line]:
    """Heading lines from the top: group, heading and unit, aligned at the bottom; and a rule."""
    stacks = zip_longest(*(place.column.heads for place in placed), fillvalue="")
    lines = [Line(_laid(stack, placed), "heading") for stack in stacks]
    return [*lines[::-1], Line("-" * (placed[-1].start + placed[-1].width), "drawn")]


def _laid(cells: Sequence[str], placed: Sequence[_Placed]) -> str:
    pairs = zip(cells, placed, strict=True)
    return (
        (" " * GAP)
        .join(cell.ljust(place.width) if place.column.is_left else cell.rjust(place.width) for cell, place in pairs)
        .rstrip()
    )


def _row_lines(row: TableRow, at: int, placed: Sequence[_Placed]) -> Iterator[Line]:
    """The row, in several lines if words of it are wrapped; a state is marked where it stands."""
    pieces = [[line.text for line in _cell_lines(place.column.cells[at], place.width)] for place in placed]
    for cells in zip_longest(*pieces, fillvalue=""):
        marks = [
            Mark(begin, begin + len(cell), place.column.tones[at])
            for cell, place in zip(cells, placed, strict=True)
            for begin in [place.start if place.column.is_left else place.start + place.width - len(cell)]
            if place.column.tones[at] != "neutral" and cell
        ]
        if row.highlighted:
            marks.append(Mark(0, placed[-1].start + placed[-1].width + GAP, "heading"))
        yield Line(_laid(cells, placed), "drawn", tuple(marks))


def _cell_lines(cell: str, width: int) -> list[Line]:
    return wrapped(Line(cell), width, hang=len(cell) - len(cell.lstrip()))


def _below(at: int, columns: Mapping[str, _Column], width: int | None) -> list[Line]:
    """Cells that stand below their row, with their headings."""
    lines = (
        Line(f"{' ' * _TABLE_INDENT}{name}: {column.cells[at]}") for name, column in columns.items() if column.cells[at]
    )
    return [piece for line in lines for piece in wrapped(line, width, hang=_TABLE_INDENT + 2)]
