"""Rows of a sweep as text: the same bytes as a writer that goes cell by cell."""

import csv
import io
import json
from itertools import cycle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.forms.csv_rows import csv_cell
from busplan.printable import json_text
from busplan.profile.shipped import load
from busplan.questions.fit.network import model_names
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.blocks import Column, SweepBlock, Word, figure_names, sweep
from busplan.questions.sweep.grid import Listed, Steps, Values, checked_grid, grid_models
from busplan.questions.sweep.rows import rows_writer, sweep_facts

SWEEPS: dict[str, tuple[str, dict[str, Values]]] = {
    "one key": ("paper-4ms", {"cycle.period_us": Steps(1000, 37, 10, 20)}),
    "words among numbers": (
        "paper-1ms",
        {"cycle.period_us": Listed((250, 333.3, 4000)), "bus.gap_count": Listed((7, "optimal", 63))},
    ),
    "short last key": ("paper-4ms", {"cycle.period_us": Steps(100, 100, 1, 9), "bus.nodes": Steps(1, 3, 1, 5)}),
    "truths": ("paper-4ms", {"bus.cycle_master": Listed((True, False)), "bus.nodes": Listed((1, 16, 17))}),
    "groups": ("gantry-24", {"cycle.period_us": Steps(1000, 333, 10, 12)}),
    "CAN": ("can-servo-8", {"cycle.period_us": Listed((1000, 2000, 5000.5))}),
}


def blocks(name: str, chunk_points: int) -> tuple[Sweep, list[SweepBlock]]:
    shipped, axes = SWEEPS[name]
    profile = load(shipped).profile
    grid = checked_grid(profile, axes, with_circle=False)
    models = grid_models(profile, grid, None, name="models")
    parts = [holed(one) for one in sweep(profile, grid, timing_models=models, chunk_points=chunk_points)]
    return Sweep(profile, grid, models, (*axes, *figure_names(profile), "holes", "passed")), parts


def holed(block: SweepBlock) -> SweepBlock:
    """Add what a circle has and capacity lacks: numbers and truths that are missing here and there."""
    places = np.arange(block.chunk.start, block.chunk.start + block.chunk.points).reshape(block.chunk.shape)
    numbers = np.where(places % 3 == 1, np.nan, places / -7)
    more = {"holes": Column(numbers), "passed": Column((places % 3).astype(np.uint8), (None, False, True))}
    return block._replace(models=tuple({**one, **more} for one in block.models))


def csv_by_cell(table: Sweep, rows: list[dict[str, Word]]) -> str:
    def text(value: object) -> object:
        missing = isinstance(value, float) and np.isnan(value)
        return "" if missing else repr(value) if isinstance(value, float) else csv_cell(value)

    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows([table.columns, *([text(row[name]) for name in table.columns] for row in rows)])
    return buffer.getvalue()


def jsonl_by_cell(table: Sweep, rows: list[dict[str, Word]]) -> str:
    def lines() -> list[str]:
        plain = (
            {name: None if isinstance(value, float) and np.isnan(value) else value for name, value in row.items()}
            for row in rows
        )
        return [json_text(sweep_facts(table)), *map(json_text, plain)]

    return "".join(f"{line}\n" for line in lines())


def written(form: str, table: Sweep, parts: list[SweepBlock]) -> str:
    found: list[bytes] = []
    writer = rows_writer("csv" if form == "csv" else "jsonl", table, found.append)
    for part in parts:
        writer.add(part)
    writer.finish(complete=True)
    return b"".join(found).decode()


@pytest.mark.parametrize(
    ("name", "chunk_points"), [*zip(SWEEPS, cycle([7, 1000]), strict=False), ("words among numbers", 1)]
)
def test_bytes_are_those_of_a_writer_by_cell(name: str, chunk_points: int) -> None:
    table, parts = blocks(name, chunk_points)
    rows = [part.row(index, table.columns) for part in parts for index in range(part.chunk.points * len(part.models))]
    assert written("csv", table, parts) == csv_by_cell(table, rows)
    assert written("jsonl", table, parts) == jsonl_by_cell(table, rows)


@settings(max_examples=5)
@given(st.data())
def test_any_columns_in_any_order(data: st.DataObject) -> None:
    table, parts = blocks("words among numbers", data.draw(st.integers(1, 9)))
    # Two at least, as a sweep has: the csv module puts an empty cell that stands alone between quotes.
    columns = data.draw(st.lists(st.sampled_from(table.columns), min_size=2, max_size=12, unique=True))
    table = table._replace(columns=tuple(columns))
    rows = [part.row(index, columns) for part in parts for index in range(part.chunk.points * len(part.models))]
    assert written("csv", table, parts) == csv_by_cell(table, rows)
    assert written("jsonl", table, parts) == jsonl_by_cell(table, rows)


def test_floats_read_back_to_the_same_float() -> None:
    table, parts = blocks("one key", 1000)
    text = written("csv", table, parts)
    rows = list(csv.DictReader(io.StringIO(text)))
    lines = [json.loads(line) for line in written("jsonl", table, parts).splitlines()[1:]]
    for name in ("margin_us", "utilisation", "nodes_eq11", "cycle.period_us"):
        expected = np.concatenate([part.rows(name) for part in parts]).tolist()
        assert [float(row[name]) for row in rows] == expected
        assert [line[name] for line in lines] == expected
    assert len(model_names(table.profile)) == 2
