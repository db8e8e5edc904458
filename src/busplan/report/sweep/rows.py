"""Rows of a sweep as CSV and JSON lines, a block at a time.

A value is written once for all the rows that share it: that, and one join a row, is what makes millions of rows quick.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from math import isnan
from typing import Any, Final, Literal

import numpy as np

from busplan.analysis.grid import Array, Grid
from busplan.analysis.sweep import Block, Column
from busplan.report.documents import document
from busplan.report.text import csv_cell

Style = Literal["csv", "jsonl"]
TEXT_POINTS: Final = 4096
"""Points of a block that is written as text: its cells are in memory together."""


def csv_header(columns: Sequence[str]) -> str:
    """First line of a sweep's CSV."""
    return ",".join(columns) + "\n"


def jsonl_header(profile: str, grid: Grid, timing_models: Sequence[str]) -> str:
    """First line of a sweep's JSON lines: what the rows are, and how many make it whole."""
    points = grid.points
    facts = document(
        "sweep",
        profile=profile,
        varied={key: axis.size for key, axis in grid.axes.items()},
        timing_models=list(timing_models),
        points=points,
        rows=points * len(timing_models),
    )
    return json.dumps(facts, ensure_ascii=False) + "\n"


def block_text(block: Block, columns: Sequence[str], *, style: Style) -> str:
    """Write a block's rows, each with its line end.

    Parameters
    ----------
    block
        Part of a sweep, of not much more than `TEXT_POINTS`.
    columns
        Which columns, in this order.
    style
        "csv" or "jsonl"; values are written as `capacity --format csv` and `json` write them.
    """
    models = [_rows(block, model, columns, style) for model in range(len(block.models))]
    rows = [""] * (len(models) * block.chunk.points)
    for number, own in enumerate(models):
        rows[number :: len(models)] = own
    return "".join(rows)


def _rows(block: Block, model: int, columns: Sequence[str], style: Style) -> Iterable[str]:
    """Rows of one timing model."""
    separator, opening, closing = (", ", "{", "}\n") if style == "jsonl" else (",", "", "\n")
    cells: list[Array] = []
    for name in columns:
        own = _texts(block.columns(name)[model], style)
        if style == "jsonl":
            own = f"{json.dumps(name)}: " + own
        # Neighbours that vary alike, and less than the rows do, are one cell.
        if cells and cells[-1].shape == own.shape and own.size < block.chunk.points:
            cells[-1] = cells[-1] + separator + own
        else:
            cells.append(own)
    cells[0] = opening + cells[0]
    cells[-1] = cells[-1] + closing
    flat = (np.broadcast_to(own, block.chunk.shape).ravel().tolist() for own in cells)
    return map(separator.join, zip(*flat, strict=True))


def _texts(column: Column, style: Style) -> Array:
    """A column's values as text, in the column's own shape."""
    write = _writer(column, style)
    texts = np.empty(column.values.size, dtype=object)
    texts[:] = list(map(write, column.values.ravel().tolist()))
    return texts.reshape(column.values.shape)


def _writer(column: Column, style: Style) -> Callable[[Any], str]:
    if column.words is not None:
        words = [json.dumps(word) if style == "jsonl" else str(csv_cell(word)) for word in column.words]
        return words.__getitem__
    if column.values.dtype == bool:
        return ("false", "true").__getitem__
    if column.values.dtype.kind == "f" and np.isnan(column.values).any():
        missing = "null" if style == "jsonl" else ""
        return lambda value: missing if isnan(value) else repr(value)
    return repr
