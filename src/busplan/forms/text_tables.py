"""Tables in character columns; figures are never cut or wrapped."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Final, NamedTuple

from busplan.forms.blocks import Cell, Sentence, ShownValue, Table, TableColumn, TableRow, Words
from busplan.forms.columns import cell_text
from busplan.forms.details import left_out_sentence
from busplan.forms.lines import BLANK, Line, Mark, Tone
from busplan.forms.narrowing import GAP, Extent, arrangement, shared_widths
from busplan.forms.wrapping import wrapped
from busplan.printable import printable

_FAILS: Final = " !"
"""Behind a figure that fails, for those who see no colours."""
_INDENT: Final = 4
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


def table_lines(table: Table, *, width: int | None = None, is_whole: bool = False) -> list[Line]:
    """Lay out a table: words left, figures right, a rule below the headings, and below it what is left out.

    Parameters
    ----------
    table
        The table. Columns of drawings are left out: the figure is in another column.
    width
        Width of the terminal; None for any width.
    is_whole
        If True, no row and no column is left out.
    """
    rows = [row for row in table.rows if is_whole or not row.is_detail]
    columns = {
        number: _column(table.columns[number], rows, number)
        for number, column in enumerate(table.columns)
        if column.kind != "drawing" and (is_whole or not column.is_detail)
    }
    extents = {number: Extent.of(table.columns[number], one.heads, one.cells) for number, one in columns.items()}
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
        len(table.rows) - len(rows), [table.columns[number].name for number in chosen.left_out]
    )
    fails = any(cell.endswith(_FAILS) for one in columns.values() for cell in one.cells)
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
    stacks = zip_longest(*(one.column.heads for one in placed), fillvalue="")
    lines = [Line(_laid(stack, placed), "heading") for stack in stacks]
    return [*lines[::-1], Line("-" * (placed[-1].start + placed[-1].width), "drawn")]


def _laid(cells: Sequence[str], placed: Sequence[_Placed]) -> str:
    each = zip(cells, placed, strict=True)
    return (
        (" " * GAP)
        .join(cell.ljust(one.width) if one.column.is_left else cell.rjust(one.width) for cell, one in each)
        .rstrip()
    )


def _row_lines(row: TableRow, at: int, placed: Sequence[_Placed]) -> Iterator[Line]:
    """The row, in several lines if words of it are wrapped; a state is marked where it stands."""
    pieces = [[line.text for line in _cell_lines(one.column.cells[at], one.width)] for one in placed]
    for cells in zip_longest(*pieces, fillvalue=""):
        marks = [
            Mark(begin, begin + len(cell), one.column.tones[at])
            for cell, one in zip(cells, placed, strict=True)
            for begin in [one.start if one.column.is_left else one.start + one.width - len(cell)]
            if one.column.tones[at] != "neutral" and cell
        ]
        if row.highlighted:
            marks.append(Mark(0, placed[-1].start + placed[-1].width + GAP, "heading"))
        yield Line(_laid(cells, placed), "drawn", tuple(marks))


def _cell_lines(cell: str, width: int) -> list[Line]:
    return wrapped(Line(cell), width, hang=len(cell) - len(cell.lstrip()))


def _below(at: int, columns: Mapping[str, _Column], width: int | None) -> list[Line]:
    """Cells that stand below their row, with their headings."""
    lines = (Line(f"{' ' * _INDENT}{name}: {one.cells[at]}") for name, one in columns.items() if one.cells[at])
    return [piece for line in lines for piece in wrapped(line, width, hang=_INDENT + 2)]
