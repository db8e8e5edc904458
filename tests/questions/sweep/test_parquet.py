"""A sweep as Parquet, read back by pandas, polars and pyarrow."""

import gc
import json
import tomllib
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
import pytest

import busplan
from busplan.buses.figure import unit_of
from busplan.profile.shipped import load
from busplan.questions.sweep.asked import Sweep, column_figures
from busplan.questions.sweep.blocks import figure_names, sweep
from busplan.questions.sweep.circles import CIRCLE_COLUMNS
from busplan.questions.sweep.grid import Listed, Steps, Values, checked_grid, grid_models
from busplan.questions.sweep.rows import rows_writer

pytest.importorskip("pyarrow")

import pyarrow as pa
from pyarrow import parquet as pq

if TYPE_CHECKING:
    from busplan.questions.sweep.blocks import SweepBlock

AXES: dict[str, Values] = {
    "bus.gap_count": Listed((7, "optimal", 63)),
    "bus.nodes": Steps(1, 8, 1, 3),
    "cycle.period_us": Listed((250, 333.3, 4000)),
}


def table_and_blocks(
    axes: dict[str, Values] = AXES, *, chunk_points: int = 10, shipped: str = "paper-4ms"
) -> "tuple[Sweep, list[SweepBlock]]":
    profile = load(shipped).profile
    grid = checked_grid(profile, axes, with_circle=False)
    models = grid_models(profile, grid, None, name="models")
    parts = list(sweep(profile, grid, timing_models=models, chunk_points=chunk_points))
    return Sweep(profile, grid, models, (*axes, *figure_names(profile))), parts


def written(table: Sweep, parts: "list[SweepBlock]", *, complete: bool = True) -> bytes:
    found: list[bytes] = []
    writer = rows_writer("parquet", table, found.append)
    for part in parts:
        writer.add(part)
    writer.finish(complete=complete)
    return b"".join(found)


@pytest.fixture(scope="module")
def whole() -> bytes:
    return written(*table_and_blocks())


def expected() -> dict[str, list[object]]:
    """The columns of the document in JSON; lists as words, and empty ones as nothing, as in CSV."""
    vary = {key: [*axis.part(0, axis.size).tolist()] for key, axis in AXES.items()}
    rows = busplan.sweep("paper-4ms", vary=vary).to_dict()["rows"]
    found = {name: [row[name] for row in rows] for name in rows[0]}
    for name in ("exceeded", "not_shown", "circle_refused_by"):
        found[name] = [" ".join(one or ()) or None for one in found[name]]
    found["bus.gap_count"] = [str(one) for one in found["bus.gap_count"]]
    return found


def test_pandas_reads_the_figures_of_the_document(whole: bytes) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_parquet(BytesIO(whole))
    wanted = expected()
    assert list(frame) == list(wanted)
    for name, values in wanted.items():
        got = [None if pandas.isna(one) else one for one in frame[name].tolist()]
        assert got == values, name
    kinds = {name: str(frame[name].dtype) for name in frame}
    assert {kinds[name] for name in ("timing_model", "limited_by", "verdict", "bus.gap_count")} == {"category"}
    assert (kinds["margin_us"], kinds["max_nodes"], kinds["fits"]) == ("float64", "int64", "bool")
    assert (kinds["bus.nodes"], kinds["cycle.period_us"]) == ("int64", "float64")


def test_polars_reads_the_figures_of_the_document(whole: bytes) -> None:
    polars = pytest.importorskip("polars")
    frame = polars.read_parquet(BytesIO(whole))
    assert frame.to_dict(as_series=False) == expected()
    # A count that only one timing model has is whole all the same.
    assert frame.schema["safe_nodes"] == polars.Int64
    assert frame.schema["verdict"] == polars.Categorical


def test_both_read_the_floats_of_csv() -> None:
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    answer = busplan.sweep("paper-4ms", vary={"cycle.period_us": np.linspace(100, 4000, 300)}, timing_model="standard")
    text = answer._text("csv").encode()  # noqa: SLF001 - what save() writes
    frames = (
        pandas.read_csv(BytesIO(text), engine="python"),
        polars.read_csv(BytesIO(text), infer_schema_length=None),
    )
    for name in ("cycle.period_us", "margin_us", "utilisation", "nodes_eq11", "uncertainty_us"):
        for frame in frames:
            np.testing.assert_array_equal(frame[name].to_numpy(), answer[name], strict=True)


def test_the_schema_says_what_the_rows_are_of(whole: bytes) -> None:
    schema = pq.read_schema(BytesIO(whole))
    table, _ = table_and_blocks()
    assert tomllib.loads(schema.metadata[b"busplan.profile"].decode())["name"] == "paper-4ms"
    assert busplan.load_profile(table.profile) == table.profile
    facts = json.loads(schema.metadata[b"busplan.sweep"])
    assert (facts["schema"], facts["profile"], facts["timing_models"]) == (1, "paper-4ms", list(table.timing_models))
    assert (facts["points"], facts["rows"]) == (27, 54)
    assert schema.metadata[b"busplan.version"].decode() == busplan.__version__
    figures = column_figures(table.profile)
    for field in schema:
        assert field.metadata[b"unit"].decode() == unit_of(field.name)
        if field.name in figures:
            assert field.metadata[b"meaning"].decode() == figures[field.name].meaning
    assert schema.field("margin_us").metadata[b"unit"] == b"us"


@pytest.mark.parametrize("complete", [True, False])
def test_a_part_is_a_file_that_says_so(complete: bool) -> None:
    table, parts = table_and_blocks()
    some = parts if complete else parts[:2]
    file = pq.ParquetFile(BytesIO(written(table, some, complete=complete)))
    assert json.loads(file.metadata.metadata[b"busplan.complete"]) is complete
    assert file.metadata.num_rows == sum(len(table.timing_models) * part.chunk.points for part in some)
    # Not one block: a file without rows is read, too.
    none = pq.read_table(BytesIO(written(table, [], complete=False)))
    assert (none.num_rows, none.column_names) == (0, list(table.columns))


def test_small_blocks_share_a_row_group(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("busplan.questions.sweep.parquet.GROUP_ROWS", 30)
    table, parts = table_and_blocks(chunk_points=9)
    file = pq.ParquetFile(BytesIO(written(table, parts)))
    sizes = [file.metadata.row_group(number).num_rows for number in range(file.num_row_groups)]
    assert sizes == [36, 18]
    assert file.read().to_pydict() == pq.read_table(BytesIO(written(*table_and_blocks(chunk_points=1)))).to_pydict()


def test_truths_that_vary_are_truths() -> None:
    axes: dict[str, Values] = {"bus.cycle_master": Listed((False, True))}
    found = pq.read_table(BytesIO(written(*table_and_blocks(axes, chunk_points=1))))
    assert found["bus.cycle_master"].to_pylist() == [False, True]


def test_counts_of_groups_and_figures_of_circles_are_typed() -> None:
    table, parts = table_and_blocks({"cycle.period_us": Listed((500, 1000))}, shipped="gantry-24")
    found = pq.read_table(BytesIO(written(table, parts)))
    counts = [name for name in figure_names(table.profile) if name.endswith(".safe_nodes")]
    assert counts
    assert {found.schema.field(name).type for name in counts} == {pa.int64()}
    assert found["max_nodes"].null_count == found.num_rows
    answer = busplan.sweep("paper-two-node", vary={"circle.radius_mm": [10.0]}, circle=True)
    circles = answer.sweep
    row = pq.read_table(BytesIO(written(circles, list(answer.blocks)))).to_pylist()[0]
    assert {name: row[name] for name in CIRCLE_COLUMNS} == {
        name: answer.to_dict()["rows"][0][name] for name in CIRCLE_COLUMNS
    }
    assert row["passed"] is None


def test_an_error_of_the_work_writes_nothing_more(monkeypatch: pytest.MonkeyPatch) -> None:
    table, parts = table_and_blocks()
    found: list[bytes] = []
    writer = rows_writer("parquet", table, found.append)
    monkeypatch.setattr("busplan.questions.sweep.parquet.GROUP_ROWS", 10)
    writer.add(parts[0])
    before = len(found)
    assert before
    # As when a later point cannot be computed: pyarrow ends its file when nobody holds it.
    del writer
    gc.collect()
    assert len(found) == before


def test_an_error_of_the_destination_is_the_callers() -> None:
    table, parts = table_and_blocks()

    def full(_: bytes) -> None:
        raise busplan.BusplanError("rows.parquet: cannot be written: No space left on device")

    writer = rows_writer("parquet", table, full)
    with pytest.raises(busplan.BusplanError, match="No space left"):
        writer.finish(complete=True)
    del writer, parts
    gc.collect()
