"""Rows of a sweep as files: the characters that `capacity` writes for each point, and typed columns of Parquet."""

import csv
import io
import json
import tomllib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import busplan
from busplan.questions.base.arguments import load_network
from busplan.questions.sweep import checked_sweep, computed, written_rows
from tests.extras import needed

GRIDS: dict[str, tuple[str, dict[str, Any]]] = {
    "decimals": ("paper-4ms", {"cycle.period_us": "100:110:1.7"}),
    "words among numbers": ("paper-1ms", {"cycle.period_us": (250, 333.3), "bus.gap_count": (7, "optimal", 63)}),
    "truths": ("paper-4ms", {"bus.cycle_master": (True, False), "bus.nodes": (1, 16, 17)}),
    "whole numbers": ("sercos2-servo-8", {"cycle.period_us": (1000, 2000)}),
    "CAN": ("can-servo-8", {"cycle.period_us": (1000, 2000, 5000.5)}),
}


def saved(answer: Any, path: Path) -> bytes:
    answer.save(path)
    return path.read_bytes()


@pytest.mark.parametrize("name", GRIDS)
def test_csv_and_json_are_what_capacity_writes_for_each_point(name: str, tmp_path: Path) -> None:
    shipped, vary = GRIDS[name]
    answer = busplan.sweep(shipped, vary=vary)
    text = saved(answer, tmp_path / "rows.csv").decode()
    rows, document = list(csv.reader(io.StringIO(text))), json.loads(saved(answer, tmp_path / "rows.json"))
    wanted_rows, wanted = [list(answer.columns)], []
    for changes in answer.sweep.grid.each_point():
        point = busplan.load_profile(shipped, changes=changes)
        capacity = busplan.capacity(point, timing_model=answer.sweep.timing_models)
        lines = list(csv.reader(io.StringIO(saved(capacity, tmp_path / "one.csv").decode())))
        assert lines[0][1:] == list(answer.columns[len(changes) :])
        start = [str(value).lower() if isinstance(value, bool) else str(value) for value in changes.values()]
        wanted_rows += [start + row[1:] for row in lines[1:]]
        wanted += [{**changes, **{key: row[key] for key in lines[0][1:]}} for row in capacity.to_dict()["results"]]
    assert rows == wanted_rows
    # Not only equal: 4.0 stays 4.0.
    assert list(map(repr, document.pop("rows"))) == list(map(repr, wanted))
    assert (document["schema"], document["command"], document["profile"]) == (1, "sweep", shipped)
    assert (document["points"], document["varied"]) == (
        len(wanted) // len(document["timing_models"]),
        {key: len(axis) for key, axis in answer.sweep.grid.axes.items()},
    )


def test_what_does_not_exist_is_null_and_empty(tmp_path: Path) -> None:
    small = busplan.load_profile("paper-two-node", changes={"circle.radius_mm": 5.0, "circle.ramp_periods": 5})
    # At 100 us the cycle does not fit, which fails; at 2 ms nothing is asked of the circle.
    answer = busplan.sweep(small, vary={"cycle.period_us": [100, 2000]}, timing_model="standard", circle=True)
    first, second = csv.DictReader(io.StringIO(saved(answer, tmp_path / "rows.csv").decode()))
    assert (first["max_contour_error_mm"], first["passed"], second["passed"]) == ("", "false", "")
    rows = answer.to_dict()["rows"]
    assert [(row["phase_margin_deg"] is None, row["passed"]) for row in rows] == [(True, False), (False, None)]
    assert list(answer["passed"]) == [False, None]


@pytest.mark.slow
def test_a_long_table_is_made_of_short_ones(tmp_path: Path) -> None:
    # More points than are computed or written at once.
    vary = {"cycle.nonperiodic_us": range(8500)}
    whole = busplan.sweep("paper-4ms", vary={"bus.nodes": (1, 17), **vary}, timing_model="paper")
    lines = saved(whole, tmp_path / "rows.csv").decode().splitlines()
    short = [busplan.sweep("paper-4ms", vary={"bus.nodes": [n], **vary}, timing_model="paper") for n in (1, 17)]
    assert lines[1:] == [
        line for answer in short for line in saved(answer, tmp_path / "rows.csv").decode().splitlines()[1:]
    ]
    fitting = sum(int(answer["fits"].sum()) for answer in short)
    assert 0 < fitting < 17_000
    assert str(whole).startswith(f"paper-4ms: 17,000 points; {fitting:,} fit by the paper model.")
    assert [row["margin_us"] for row in whole.to_dict()["rows"]] == whole["margin_us"].tolist()


@pytest.mark.parametrize("form", ["csv", "json", pytest.param("parquet", marks=pytest.mark.slow)])
def test_the_first_rows_are_written_before_the_last_are_computed(form: Any) -> None:
    if form == "parquet":
        needed("pyarrow")
    network = load_network(busplan.load_profile("paper-4ms"))
    vary = {"cycle.nonperiodic_us": np.arange(100_000)}
    sweep = checked_sweep(network, vary, timing_models=["paper"], circle=False, unlimited=False)
    done = [0]
    pieces = written_rows(form, sweep, computed(sweep, progress=lambda now, _: done.append(now)))
    assert next(pieces)
    assert done[-1] < 100_000
    pieces.close()  # type: ignore[attr-defined]


# --- Parquet ----------------------------------------------------------------------------------------------

VARY: dict[str, Any] = {
    "bus.gap_count": (7, "optimal", 63),
    "bus.nodes": (1, 9, 17),
    "cycle.period_us": (250, 333.3, 4000),
}


@pytest.fixture(scope="module")
def parquet(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    needed("pyarrow")
    return saved(busplan.sweep("paper-4ms", vary=VARY), tmp_path_factory.mktemp("rows") / "rows.parquet")


def expected() -> dict[str, list[object]]:
    """The columns of the document in JSON; lists as words, and empty ones as nothing, as in CSV."""
    rows = busplan.sweep("paper-4ms", vary=VARY).to_dict()["rows"]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    for name in ("exceeded", "not_shown"):
        columns[name] = [" ".join(words or ()) or None for words in columns[name]]
    columns["bus.gap_count"] = [str(count) for count in columns["bus.gap_count"]]
    return columns


def test_pandas_reads_the_figures_of_the_document(parquet: bytes) -> None:
    pandas = needed("pandas")
    frame = pandas.read_parquet(BytesIO(parquet))
    wanted = expected()
    assert list(frame) == list(wanted)
    for name, values in wanted.items():
        got = [None if pandas.isna(value) else value for value in frame[name].tolist()]
        assert got == values, name
    kinds = {name: str(frame[name].dtype) for name in frame}
    assert {kinds[name] for name in ("timing_model", "limited_by", "verdict", "bus.gap_count")} == {"category"}
    assert (kinds["margin_us"], kinds["max_nodes"], kinds["fits"]) == ("float64", "int64", "bool")
    assert (kinds["bus.nodes"], kinds["cycle.period_us"]) == ("int64", "float64")


def test_the_schema_says_what_the_rows_are_of(parquet: bytes) -> None:
    schema = needed("pyarrow.parquet").read_schema(BytesIO(parquet))
    assert tomllib.loads(schema.metadata[b"busplan.profile"].decode())["name"] == "paper-4ms"
    facts = json.loads(schema.metadata[b"busplan.sweep"])
    document = busplan.sweep("paper-4ms", vary=VARY).to_dict()
    assert facts == {key: value for key, value in document.items() if key != "rows"}
    assert schema.metadata[b"busplan.version"].decode() == busplan.__version__
    for name, unit in (("margin_us", b"us"), ("cycle.period_us", b"us"), ("max_axes", b"")):
        assert schema.field(name).metadata[b"unit"] == unit, name
    assert all(b"meaning" in field.metadata for field in schema if field.name not in VARY)
    assert schema.field("max_axes").metadata[b"meaning"] == b"axes of the largest number of nodes that fits"


def test_truths_that_vary_are_truths() -> None:
    needed("pyarrow")
    table = busplan.sweep("paper-4ms", vary={"bus.cycle_master": (False, True)}).to_arrow()
    assert table["bus.cycle_master"].to_pylist() == [False, True]


def test_counts_of_groups_and_figures_of_circles_are_typed() -> None:
    pa = needed("pyarrow")
    table = busplan.sweep("gantry-24", vary={"cycle.period_us": (500, 1000)}).to_arrow()
    counts = [name for name in table.column_names if name.endswith("safe_nodes")]
    assert len(counts) == 4
    assert {table.schema.field(name).type for name in counts} == {pa.int64()}
    answer = busplan.sweep("paper-two-node", vary={"circle.radius_mm": [10.0]}, circle=True)
    row, wanted = answer.to_arrow().to_pylist()[0], answer.to_dict()["rows"][0]
    assert row["mean_contour_error_mm"] > 0
    for name in ("mean_contour_error_mm", "max_contour_error_mm", "phase_margin_deg", "passed"):
        assert row[name] == wanted[name]
    assert row["passed"] is None
