"""A table as lines of text in the width of a terminal. No figure is cut."""

from collections.abc import Iterator, Sequence
from itertools import groupby, zip_longest
from typing import Final, NamedTuple

from busplan.english import printable
from busplan.forms import blocks
from busplan.forms.lines import BLANK, Line, Mark, Tone, least_width, wrapped
from busplan.forms.numbers import cell_text, left_out_sentence

_GAP: Final = 2
"""Blanks between two columns."""
_LEAST_WORDS: Final = 24
"""Width of the narrowest column of wrapped words, unless a word is longer."""
_BROKEN_WORDS: Final = 16
"""Width of the narrowest column of broken words, as a last resort."""
_FAILS: Final = " !"
"""Mark after a figure that fails, for readers without colours."""
_INDENT: Final = 4
"""Blanks before text below its row."""


class _Column(NamedTuple):
    """A column as text."""

    number: int
    """Index of the column in the table."""
    kind: blocks.TableColumn
    heads: tuple[str, ...]
    """Unit, heading and group, from the bottom."""
    cells: list[str]
    tones: list[Tone]
    natural: int
    """Width of the widest cell or heading."""
    least: int
    """Width below which a word, a figure or a heading would be broken."""
    broken: int
    """Width as a last resort, at which words are broken, but not figures."""

    @property
    def is_left(self) -> bool:
        """Whether the column is aligned to the left, as words are."""
        return self.kind.kind == "words"


class _Placed(NamedTuple):
    """A column at its place in a panel."""

    column: _Column
    start: int
    width: int


def table_lines(table: blocks.Table, *, width: int | None, is_whole: bool, whole_by: str) -> list[Line]:
    """Lines of a table: words left, figures right, a rule below the headings, and remarks on what is left out.

    Columns of drawings are left out: another column has the figure. `width` is that of the terminal, None for any; a
    whole table leaves out no row and no other column, and `whole_by` is the advice on seeing one.
    """
    rows = [row for row in table.rows if is_whole or not row.is_detail]
    columns = [
        _column(number, column, rows)
        for number, column in enumerate(table.columns)
        if column.kind != "drawing" and (is_whole or not column.is_detail)
    ]
    side, below, left_out = _arranged(columns, width, is_whole=is_whole)
    panels = [side] if width is None else _panels(side, table.heads, width)
    lines: list[Line] = []
    for panel in panels:
        placed = list(_placed(panel, width))
        lines += [BLANK] if lines else []
        lines += _heading(placed)
        for at, row in enumerate(rows):
            lines += _row_lines(row, at, placed)
            for column in below if panel is panels[0] else ():
                if column.cells[at]:
                    line = Line(f"{' ' * _INDENT}{column.kind.name}: {column.cells[at]}")
                    lines += wrapped(line, width, hang=_INDENT + 2)
    names = [column.kind.name for column in left_out]
    fails = any(cell.endswith(_FAILS) for column in columns for cell in column.cells)
    words = ("! fails." * fails, left_out_sentence(len(table.rows) - len(rows), names, whole_by=whole_by))
    notes = " ".join(filter(None, words))
    return [*lines, *(wrapped(Line(notes), width) if notes else [])]


def _column(number: int, kind: blocks.TableColumn, rows: Sequence[blocks.TableRow]) -> _Column:
    """The column as text. The first one is indented, and a figure that fails has its mark."""
    heads = tuple(filter(None, (kind.unit, kind.heading, kind.group)))
    cells = [("  " * row.level if number == 0 else "") + _one_line(row.cells[number]) for row in rows]
    failing = [_is_failing_figure(row.cells[number]) for row in rows]
    if any(failing):
        blank = "" if kind.kind == "words" else " " * len(_FAILS)
        heads = tuple(f"{head}{blank}" for head in heads)
        cells = [f"{cell}{_FAILS if fails else blank}" for cell, fails in zip(cells, failing, strict=True)]
    natural = least = broken = max(map(len, (*heads, *cells)))
    if kind.wraps:
        longest = max(map(least_width, cells), default=0)
        least = min(natural, max(_LEAST_WORDS, min(longest, 2 * _LEAST_WORDS), *map(len, heads)))
        broken = min(least, _BROKEN_WORDS)
    return _Column(number, kind, heads, cells, [_tone(row.cells[number]) for row in rows], natural, least, broken)


def _one_line(cell: blocks.Cell) -> str:
    return printable(" ".join(cell_text(cell).split()))


def _is_failing_figure(cell: blocks.Cell) -> bool:
    """Whether a cell is a figure that fails. Words that fail say so themselves."""
    return isinstance(cell, blocks.ShownValue) and cell.state == "fails" and not isinstance(cell.value, str)


def _tone(cell: blocks.Cell) -> Tone:
    return cell.state if isinstance(cell, blocks.ShownValue | blocks.Words | blocks.Sentence) else "neutral"


def _arranged(
    columns: Sequence[_Column], width: int | None, *, is_whole: bool
) -> tuple[list[_Column], list[_Column], list[_Column]]:
    """Columns side by side, columns below their row, and columns left out."""
    side, below, left_out = list(columns), list[_Column](), list[_Column]()
    ranked = [column for column in columns if column.kind.rank]
    for column in sorted(ranked, key=lambda column: (-column.kind.rank, -column.number)):
        if width is None or _width(side) <= width:
            break
        if column.kind.leaves == "below" or not is_whole:
            side.remove(column)
            (below if column.kind.leaves == "below" else left_out).append(column)
    return side, sorted(below), sorted(left_out)


def _width(columns: Sequence[_Column]) -> int:
    """Least width of columns side by side."""
    return sum(column.least for column in columns) + _GAP * (len(columns) - 1)


def _panels(side: list[_Column], heads: int, width: int) -> list[list[_Column]]:
    """Divide columns into panels that fit, with columns of one group together where possible.

    Words are broken before a table is divided.
    """
    if sum(column.broken for column in side) + _GAP * (len(side) - 1) <= width:
        return [side]
    first = [column for column in side if column.number < heads]
    while len(first) > 1 and any(_width([*first, column]) > width for column in side[len(first) :]):
        first.pop()
    runs = [list(run) for _, run in groupby(side[len(first) :], key=lambda column: column.kind.group or column.number)]
    pieces = [
        piece for run in runs for piece in ([run] if _width([*first, *run]) <= width else [[column] for column in run])
    ]
    panels = [[*first]]
    for piece in pieces:
        if len(panels[-1]) > len(first) and _width([*panels[-1], *piece]) > width:
            panels.append([*first])
        panels[-1] += piece
    return panels


def _placed(columns: Sequence[_Column], width: int | None) -> Iterator[_Placed]:
    """Columns with their widths; those that wrap share the rest."""
    widths = {column.number: column.natural if width is None else column.least for column in columns}
    if width is not None:
        spare = width - _width(columns)
        # Columns with the smallest wants come first, and leave the rest to the others.
        wanting = sorted(columns, key=lambda column: column.natural - column.least)
        for place, column in enumerate(wanting):
            more = min(column.natural - column.least, max(spare, 0) // (len(wanting) - place))
            widths[column.number] += more
            spare -= more
        # The first columns, which name a row, are broken last.
        for column in reversed(columns):
            less = min(widths[column.number] - column.broken, max(-spare, 0))
            widths[column.number] -= less
            spare += less
    start = 0
    for column in columns:
        yield _Placed(column, start, widths[column.number])
        start += widths[column.number] + _GAP


def _heading(placed: Sequence[_Placed]) -> list[Line]:
    """Heading lines from the top: group, heading and unit, aligned at the bottom, and a rule."""
    stacks = zip_longest(*(place.column.heads for place in placed), fillvalue="")
    lines = [Line(_laid(stack, placed), "heading") for stack in stacks]
    return [*lines[::-1], Line("-" * (placed[-1].start + placed[-1].width), "drawn")]


def _laid(cells: Sequence[str], placed: Sequence[_Placed]) -> str:
    pairs = zip(cells, placed, strict=True)
    pieces = (cell.ljust(place.width) if place.column.is_left else cell.rjust(place.width) for cell, place in pairs)
    return (" " * _GAP).join(pieces).rstrip()


def _row_lines(row: blocks.TableRow, at: int, placed: Sequence[_Placed]) -> Iterator[Line]:
    """Lines of a row, several if words in it are wrapped; each state is marked."""
    pieces = [[line.text for line in _cell_lines(place.column.cells[at], place.width)] for place in placed]
    for cells in zip_longest(*pieces, fillvalue=""):
        marks = [
            Mark(begin, begin + len(cell), place.column.tones[at])
            for cell, place in zip(cells, placed, strict=True)
            for begin in [place.start if place.column.is_left else place.start + place.width - len(cell)]
            if place.column.tones[at] != "neutral" and cell
        ]
        if row.highlighted:
            marks.append(Mark(0, placed[-1].start + placed[-1].width + _GAP, "heading"))
        yield Line(_laid(cells, placed), "drawn", tuple(marks))


def _cell_lines(cell: str, width: int) -> list[Line]:
    return wrapped(Line(cell), width, hang=len(cell) - len(cell.lstrip()))
