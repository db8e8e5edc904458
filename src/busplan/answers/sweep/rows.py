"""Rows of a sweep as CSV, JSON lines and one JSON document, a block at a time.

A value is written once for all the rows that share it: that, and one join a row, is what makes millions of rows quick.
"""

from collections.abc import Callable, Iterable, Sequence
from math import isnan
from typing import Any, Final, Literal

import numpy as np

from busplan.analysis.sweep.blocks import Column, SweepBlock
from busplan.analysis.sweep.grid import Array, Grid
from busplan.answers.documents import document
from busplan.forms.blocks import JsonDocument
from busplan.forms.csv_rows import csv_cell
from busplan.printable import json_text

Style = Literal["csv", "jsonl"]
TEXT_POINTS: Final = 4096
"""Points of a block that is written as text: its cells are in memory together."""


def csv_header(columns: Sequence[str]) -> str:
    """First line of a sweep's CSV."""
    return ",".join(columns) + "\n"


def jsonl_header(profile: str, grid: Grid, timing_models: Sequence[str]) -> str:
    """First line of a sweep's JSON lines: what the rows are, and how many make it whole."""
    facts = {**_facts(profile, grid, timing_models), "rows": grid.points * len(timing_models)}
    return json_text(facts) + "\n"


def json_header(profile: str, grid: Grid, timing_models: Sequence[str]) -> str:
    """Beginning of a sweep's JSON document, up to its first row."""
    facts = json_text(_facts(profile, grid, timing_models))
    return facts.removesuffix("}") + ', "rows": [\n'


def json_rows(block: SweepBlock, columns: Sequence[str]) -> str:
    """Write a block's rows for the JSON document, a line each: the lines of JSON lines, with commas between."""
    rows = block_text(block, columns, style="jsonl").removesuffix("\n").replace("\n", ",\n")
    return rows if block.chunk.start == 0 else ",\n" + rows


def json_footer(*, complete: bool) -> str:
    """End of a sweep's JSON document: it is valid JSON even where the sweep was stopped, and says so."""
    return f'\n], "complete": {json_text(complete)}}}\n'


def _facts(profile: str, grid: Grid, timing_models: Sequence[str]) -> JsonDocument:
    """What every JSON form of a sweep begins with."""
    return document(
        "sweep",
        profile=profile,
        varied={key: axis.size for key, axis in grid.axes.items()},
        timing_models=list(timing_models),
        points=grid.points,
    )


def block_text(block: SweepBlock, columns: Sequence[str], *, style: Style) -> str:
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


def _rows(block: SweepBlock, model: int, columns: Sequence[str], style: Style) -> Iterable[str]:
    """Rows of one timing model."""
    separator, opening, closing = (", ", "{", "}\n") if style == "jsonl" else (",", "", "\n")
    cells: list[Array] = []
    for name in columns:
        own = _texts(block.columns(name)[model], style)
        if style == "jsonl":
            own = f"{json_text(name)}: " + own
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
        words = [json_text(word) if style == "jsonl" else str(csv_cell(word)) for word in column.words]
        return words.__getitem__
    if column.values.dtype == bool:
        return ("false", "true").__getitem__
    if column.values.dtype.kind == "f" and np.isnan(column.values).any():
        missing = "null" if style == "jsonl" else ""
        return lambda value: missing if isnan(value) else repr(value)
    return repr
