"""A map in ASCII characters."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from busplan.forms.legend import legend_lines
from busplan.forms.lines import BLANK, Line, Mark
from busplan.forms.scale import placed_labels
from busplan.questions.map.cells import Cell, NotDrawn
from busplan.questions.map.labels import LOOKS, Looks, legend_of, look_of, looks_of, value_text
from busplan.questions.map.trade_off import TradeOff

_BRACKETED: Final = 3
"""Columns of a cell with room for brackets."""
_EDGE: Final = " |"
_OWN_ROW: Final = "> "
_OWN_COLUMN: Final = "^"


def map_lines(found: TradeOff, *, width: int) -> list[Line]:
    """Draw a map: a row of characters for each value of `y`, the last on top.

    Parameters
    ----------
    found
        The map.
    width
        Width of the drawing, in columns; a map of many narrow cells may need up to 80.
    """
    labels = [value_text(found.y, one) for one in found.y.values]
    gutter = len(_OWN_ROW) + max(map(len, labels))
    room = width - gutter - len(_EDGE) - 1
    widest = max(_BRACKETED, *(len(value_text(found.x, one)) + 1 for one in found.x.values))
    cell_width = max(1, min(widest, room // len(found.x.values)))
    own_row, own_column = found.own_place or (None, None)
    looks = looks_of(found)
    lines = []
    for number, (label, row) in enumerate(zip(labels, found.rows, strict=True)):
        head = f"{_OWN_ROW if number == own_row else '':<{len(_OWN_ROW)}}{label:>{gutter - len(_OWN_ROW)}}{_EDGE}"
        cells = _cells(row, looks, own=own_column if number == own_row else None, cell_width=cell_width)
        tones = _tones(row, start=len(head), cell_width=cell_width)
        lines.append(Line(f"{head}{cells}|", "drawn", tuple(tones)))
    indent = " " * (gutter + len(_EDGE))
    return [
        *reversed(lines),
        *(Line(f"{indent}{one}".rstrip(), "drawn") for one in _below(found, own_column, cell_width=cell_width)),
        BLANK,
        *legend_lines(_legend(found, looks, is_bracketed=cell_width >= _BRACKETED), width=width),
    ]


def _cells(row: Sequence[Cell | NotDrawn], looks: Looks, *, own: int | None, cell_width: int) -> str:
    """Looks of a row; this design stands in brackets where there is room."""
    texts = [f"{look_of(one, looks).mark if isinstance(one, Cell) else '':^{cell_width}}" for one in row]
    if own is not None and cell_width >= _BRACKETED:
        texts[own] = f"{f'[{texts[own].strip()}]':^{cell_width}}"
    return "".join(texts)


def _tones(row: Sequence[Cell | NotDrawn], *, start: int, cell_width: int) -> Iterator[Mark]:
    """Colours of runs of cells, on a terminal that has them."""
    for tone, run in groupby(row, key=lambda one: LOOKS[one.state].tone if isinstance(one, Cell) else "neutral"):
        end = start + cell_width * len(list(run))
        if tone != "neutral":
            yield Mark(start, end, tone)
        start = end


def _below(found: TradeOff, own: int | None, *, cell_width: int) -> Iterator[str]:
    """A pointer to the column of this design, and values of `x` below their columns as far as there is room."""
    if own is not None:
        yield " " * ((cell_width - 1) // 2 + own * cell_width) + _OWN_COLUMN
    texts = [value_text(found.x, one) for one in found.x.values]
    line = ""
    for column, start in placed_labels(texts, own=own, pitch=cell_width, letter=1).items():
        line = f"{line:<{int(start)}}{texts[column]}"
    yield line


def _legend(found: TradeOff, looks: Looks, *, is_bracketed: bool) -> list[str]:
    entries = [f"{entry.letter} {entry.text}" for entry in legend_of(found, looks)]
    if found.own is not None:
        entries.append("[ ] or > and ^ this design" if is_bracketed else "> and ^ this design")
    return [*entries, "blank cannot exist"] if found.not_drawn else entries
