"""Rows of a sweep as CSV, JSON lines and one JSON document, block by block.

For speed, a value is written once for all rows that share it, and each row is a single join.
"""

from collections.abc import Callable, Iterable, Sequence
from math import isnan
from typing import Any, Final, Literal

import numpy as np

from busplan.analysis.sweep.blocks import Column, SweepBlock
from busplan.analysis.sweep.grid import Array, Grid
from busplan.answers.documents import changed_document, document
from busplan.forms.blocks import JsonDocument
from busplan.forms.csv_rows import csv_cell
from busplan.printable import json_text
from busplan.profile.changes import NO_CHANGES, KeyChanges

Style = Literal["csv", "jsonl"]
TEXT_POINTS: Final = 4096
"""Points of a block written as text: all its cells are in memory at once."""


def csv_header(columns: Sequence[str]) -> str:
    """First line of a sweep's CSV."""
    return ",".join(columns) + "\n"


def jsonl_header(profile: str, grid: Grid, timing_models: Sequence[str], *, changes: KeyChanges = NO_CHANGES) -> str:
    """First line of a sweep's JSON lines: what the rows are, and how many a complete sweep has."""
    facts = {**_facts(profile, grid, timing_models, changes), "rows": grid.points * len(timing_models)}
    return json_text(facts) + "\n"


def json_header(profile: str, grid: Grid, timing_models: Sequence[str], *, changes: KeyChanges = NO_CHANGES) -> str:
    """Start of a sweep's JSON document, up to its first row."""
    facts = json_text(_facts(profile, grid, timing_models, changes))
    return facts.removesuffix("}") + ', "rows": [\n'


def json_rows(block: SweepBlock, columns: Sequence[str]) -> str:
    """Write a block's rows for the JSON document, one per line, separated by commas."""
    rows = block_text(block, columns, style="jsonl").removesuffix("\n").replace("\n", ",\n")
    return rows if block.chunk.start == 0 else ",\n" + rows


def json_footer(*, complete: bool) -> str:
    """End of a sweep's JSON document, also of a stopped sweep: valid JSON that says whether it is complete."""
    return f'\n], "complete": {json_text(complete)}}}\n'


def _facts(profile: str, grid: Grid, timing_models: Sequence[str], changes: KeyChanges) -> JsonDocument:
    """Common beginning of the JSON forms of a sweep."""
    facts = document(
        "sweep",
        profile=profile,
        varied={key: axis.size for key, axis in grid.axes.items()},
        timing_models=list(timing_models),
        points=grid.points,
    )
    return changed_document(facts, changes)


def block_text(block: SweepBlock, columns: Sequence[str], *, style: Style) -> str:
    """Write a block's rows, each with its line end.

    Parameters
    ----------
    block
        Part of a sweep, of about `TEXT_POINTS` or fewer.
    columns
        Which columns, in this order.
    style
        "csv" or "jsonl"; values are written as in `capacity --format csv` and `json`.
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
        # Neighbouring cells of the same shape, smaller than the block, are joined once.
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
        words = [
            json_text(word) if style == "jsonl" else "" if word is None else str(csv_cell(word))
            for word in column.words
        ]
        return words.__getitem__
    if column.values.dtype == bool:
        return ("false", "true").__getitem__
    if column.values.dtype.kind == "f" and np.isnan(column.values).any():
        missing = "null" if style == "jsonl" else ""
        return lambda value: missing if isnan(value) else repr(value)
    return repr
