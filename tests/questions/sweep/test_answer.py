"""A sweep as columns: the rows of the document, as arrays."""

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import busplan
from tests.extras import needed

GRID: Mapping[str, Any] = {
    "bus.gap_count": [63, "optimal"],
    "cycle.period_us": np.linspace(100, 400, 4),
    "bus.nodes": (1, 3),
}


@pytest.mark.parametrize("models", [["paper", "standard"], ["standard"], ["standard", "paper"]])
def test_columns_are_the_rows_of_the_document(models: list[Any]) -> None:
    answer = busplan.sweep("paper-4ms", vary=GRID, timing_model=models)
    document = answer.to_dict()
    assert (document["points"], document["timing_models"]) == (16, models)
    assert isinstance(answer, Mapping)
    assert len(document["rows"]) == 16 * len(models)
    assert len(answer) == len(answer.columns)
    assert list(answer) == list(answer.columns) == list(document["rows"][0])
    assert list(answer)[: len(GRID) + 1] == [*GRID, "timing_model"]
    for name, column in dict(answer).items():
        expected = [row[name] for row in document["rows"]]
        if column.dtype.kind == "U":
            # A word that is missing, as the verdict of the paper is, is no word.
            expected = [
                " ".join(value) if isinstance(value, list) else "" if value is None else str(value)
                for value in expected
            ]
            assert column.tolist() == expected
        else:
            wanted = [float("nan") if value is None else value for value in expected]
            np.testing.assert_array_equal(column, wanted)
            assert {type(value) for value in column.tolist()} <= {float, *map(type, expected)}
        assert column.shape == (len(document["rows"]),)


def test_numbers_are_numbers_and_words_are_text() -> None:
    answer = busplan.sweep("paper-4ms", vary=GRID)
    kinds = {name: answer[name].dtype.kind for name in answer}
    words = {
        *("bus.gap_count", "timing_model", "binding_term", "limited_by", "exceeded", "not_shown"),
        *("safe_limited_by", "verdict"),
    }
    assert {name for name, kind in kinds.items() if kind == "U"} == words
    assert (kinds["max_axes"], kinds["margin_us"], kinds["fits"], kinds["bus.nodes"]) == ("i", "f", "b", "i")
    assert kinds["gap_count"] == "i"


def test_figures_of_the_verdict_are_the_deciding_models_alone() -> None:
    answer = busplan.sweep("paper-4ms", vary={"bus.nodes": [2, 17]})
    paper, standard = answer["timing_model"] == "paper", answer["timing_model"] == "standard"
    for name in ("bias_us", "margin_corrected_us", "uncertainty_us", "safe_required_us", "safe_nodes", "safe_axes"):
        assert np.isnan(answer[name][paper]).all()
        assert not np.isnan(answer[name][standard]).any()
    assert answer["verdict"].tolist() == ["fits", "", "does not fit", ""]
    assert answer["safe_limited_by"].tolist() == ["time", "", "time", ""]
    alone = busplan.sweep("paper-4ms", vary={"bus.nodes": [2, 17]}, timing_model=["standard"])
    assert alone["safe_nodes"].dtype.kind == "i"  # where none is missing, counts are whole


@pytest.mark.parametrize(
    "values", [range(250, 1001, 250), [250, 500, 750, 1000], np.arange(250, 1001, 250), np.linspace(250, 1000, 4)]
)
def test_values_in_any_form_are_those_of_the_text(values: Any) -> None:
    wanted = busplan.sweep("paper-4ms", vary={"cycle.period_us": "250:1000:250"})
    assert busplan.sweep("paper-4ms", vary={"cycle.period_us": values}).to_json() == wanted.to_json()


def test_whole_numbers_as_floats_count_nodes() -> None:
    answer = busplan.sweep("paper-4ms", vary={"bus.nodes": np.linspace(1, 3, 3)}, timing_model=["paper"])
    assert answer["bus.nodes"].tolist() == [1, 2, 3]


@pytest.mark.slow
def test_a_table_has_every_column_and_null_where_nothing_is() -> None:
    pd, pl, _ = map(needed, ("pandas", "polars", "pyarrow"))
    answer = busplan.sweep("paper-4ms", vary={**GRID, "cycle.nonperiodic_us": range(1500)})
    arrow, pandas, polars = answer.to_arrow(), answer.to_pandas(), answer.to_polars()
    assert list(pandas) == polars.columns == arrow.column_names == list(answer)
    rows = len(answer["fits"])
    assert list(pl.DataFrame(answer).columns) == list(answer)
    assert len(pandas) == len(polars) == arrow.num_rows == rows
    for name in ("bus.gap_count", "verdict", "safe_limited_by"):
        words = [word or None for word in answer[name].tolist()]
        assert arrow[name].to_pylist() == polars[name].to_list() == words
        assert [None if pd.isna(word) else word for word in pandas[name]] == words
    assert (
        polars["safe_axes"].null_count() == pandas["safe_axes"].isna().sum() == np.isnan(answer["safe_axes"]).sum() > 0
    )
    assert polars.schema["max_axes"] == pl.Int64
    assert arrow.schema.field("margin_us").metadata[b"unit"] == b"us"


def test_pandas_makes_no_column_of_the_names() -> None:
    pd = needed("pandas")
    answer = busplan.sweep("paper-4ms", vary={"bus.nodes": [1, 2]})
    with pytest.raises(busplan.BusplanError, match=r"to_pandas\(\) gives a data frame, dict\(answer\) a dict"):
        pd.DataFrame(answer)
    assert list(pd.DataFrame(dict(answer))) == list(answer)
    assert answer == answer  # noqa: PLR0124 - a mapping of arrays would compare these
    assert len({answer, answer}) == 1


def test_pandas_needs_no_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    needed("pandas")
    for name in ("pyarrow", "pyarrow.parquet"):
        monkeypatch.setitem(sys.modules, name, None)
    answer = busplan.sweep("paper-4ms", vary={"bus.gap_count": [63, "optimal"], "bus.cycle_master": [True, False]})
    frame = answer.to_pandas()
    kinds = {name: str(frame[name].dtype) for name in ("margin_us", "max_axes", "fits", "bus.cycle_master", "verdict")}
    assert kinds == {
        "margin_us": "float64", "max_axes": "int64", "fits": "bool", "bus.cycle_master": "bool", "verdict": "category"
    }  # fmt: skip
    assert frame["bus.gap_count"].cat.categories.tolist() == ["63", "optimal"]


def test_xarray_has_a_dimension_for_each_key() -> None:
    xarray = needed("xarray")
    answer = busplan.sweep("paper-4ms", vary=GRID)
    dataset = answer.to_xarray()
    assert isinstance(dataset, xarray.Dataset)
    assert dict(dataset.sizes) == {"bus.gap_count": 2, "cycle.period_us": 4, "bus.nodes": 2, "timing_model": 2}
    for row in answer.to_dict()["rows"]:
        point = dataset.sel({name: row[name] for name in dataset.dims})
        for name in ("margin_us", "safe_axes", "fits", "limited_by"):
            assert point[name].item() == row[name] or (row[name] is None and np.isnan(point[name].item()))
    assert dataset["margin_us"].attrs["units"] == dataset["cycle.period_us"].attrs["units"] == "us"
    assert dataset["margin_us"].attrs["long_name"]


@pytest.mark.parametrize(
    ("method", "library"), [("pandas", "pandas"), ("polars", "polars"), ("arrow", "pyarrow"), ("xarray", "xarray")]
)
def test_a_missing_library_is_named(method: str, library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = busplan.sweep("paper-4ms", vary={"bus.nodes": [1]})
    monkeypatch.setattr("busplan.extras.find_spec", lambda _: None)
    with pytest.raises(busplan.BusplanError, match=rf"^to_{method}\(\) needs {library}: install it"):
        getattr(answer, f"to_{method}")()


def test_an_array_is_the_callers_own() -> None:
    answer = busplan.sweep("paper-4ms", vary={"bus.nodes": [1, 2]})
    answer["max_axes"][:] = -1
    answer["bus.nodes"][:] = -1
    assert answer["max_axes"].min() > 0
    assert answer["bus.nodes"].tolist() == [1, 1, 2, 2]


def test_circle_tests_add_their_columns() -> None:
    vary = {"cycle.period_us": [100.0, 4000.0], "circle.radius_mm": [10.0]}
    answer = busplan.sweep("paper-4ms", vary=vary, circle=True)
    assert answer.columns[-1] == "passed"
    (result,) = busplan.circle_test(busplan.load_profile("paper-4ms", changes={"circle.radius_mm": 10.0})).results
    assert np.isnan(answer["max_contour_error_mm"][:2]).all()
    assert answer["max_contour_error_mm"][2] == result.max_contour_error_mm
    assert answer["passed"].tolist() == [False, False, result.passed, result.passed]
    assert answer.to_dict()["rows"][0]["max_contour_error_mm"] is None
    assert "The circle holds every tolerance at" in str(answer)


def test_circles_without_a_contour_tolerance_are_not_judged() -> None:
    vary = {"circle.radius_mm": [10.0], "servo.position_gain_per_s": [50.0, 30_000.0]}
    both = str(busplan.sweep("paper-two-node", vary=vary, circle=True))
    assert "The circle is not judged at 1: no contour tolerance is asked for, or no error source matters." in both
    assert "The circle holds every tolerance at 0 " in both
    unjudged = str(busplan.sweep("paper-two-node", vary={"circle.radius_mm": [10.0]}, circle=True))
    assert "not judged" in unjudged
    assert "holds every tolerance" not in unjudged
    judged = str(busplan.sweep("paper-4ms", vary={"circle.radius_mm": [10.0]}, circle=True))
    assert "not judged" not in judged


def test_a_column_that_is_not_there_is_a_key_error() -> None:
    answer = busplan.sweep("paper-4ms", vary={"bus.nodes": [1]})
    with pytest.raises(KeyError, match=r"no column 'axis'; there are bus\.nodes, timing_model"):
        _ = answer["axis"]
    assert "axis" not in answer
    assert "max_axes" in answer


def test_what_makes_no_sweep_is_refused() -> None:
    cases: list[tuple[Any, Any, str]] = [
        ({}, {}, "vary {}: expected keys of the profile and their values"),
        ({"bus.nods": [1]}, {}, "vary bus.nods: unknown key; did you mean nodes?"),
        ({"bus.nodes": []}, {}, "vary bus.nodes: no values; give at least one"),
        ({"bus.nodes": range(0)}, {}, "vary bus.nodes: no values; give at least one"),
        ({"bus.nodes": 3}, {}, "vary bus.nodes 3: expected several values, as a list"),
        ({"bus.nodes": "1:x"}, {}, "vary bus.nodes=1:x: 'x' is not a number"),
        ({"bus.nodes": "2:1"}, {}, "vary bus.nodes=2:1: steps of 1 never lead from 2 to 1"),
        ({"bus.nodes": [1, 1]}, {}, "vary bus.nodes: 1 is given twice"),
        ({"bus.nodes": [1, 2.5]}, {}, "bus.nodes 2.5: expected a whole number"),
        ({"bus.nodes": [True]}, {}, "vary bus.nodes: True is not a finite number"),
        ({"bus.nodes": range(10**30, 10**30 + 2)}, {}, f"bus.nodes {10**30}: must be 1,000,000 or less"),
        ({"bus.nodes": [10**400]}, {}, "bus.nodes 1000000000"),
        ({"bus.nodes": [float("inf")]}, {}, "vary bus.nodes: inf is not a finite number"),
        ({"bus.nodes": ["optimal"]}, {}, "vary bus.nodes: 'optimal' is not a finite number"),
        ({"bus.gap_count": [63, "best"]}, {}, "vary bus.gap_count: 'best' is not a finite number and none of optimal"),
        ({"bus.nodes": [None]}, {}, "vary bus.nodes: None is not a finite number"),
        ({"bus.nodes": [1, 2, 1.0]}, {}, "vary bus.nodes: 1.0 is given twice"),
        ({"cycle.period_us": np.array([1.0, np.nan])}, {}, "vary cycle.period_us: nan is not a finite number"),
        ({"cycle.period_us": np.ones((2, 2))}, {}, "vary cycle.period_us: [1.0, 1.0] is not a finite number"),
        ({"cycle.period_us": range(1, 1_000_002)}, {}, "more values than the 1,000,000 points a sweep takes"),
        ({"cycle.period_us": "1:1e9"}, {}, "vary cycle.period_us=1:1e9: 1,000,000,000 values are more than"),
        ({"cycle.period_us": "1:10000", "bus.nodes": "1:101"}, {}, "vary: 1,010,000 points are more than"),
        (
            {"servo.drive_lag_us": [1]},
            {},
            "vary servo.drive_lag_us: no figure of capacity depends on it; add circle",
        ),
        ({"cycle.period_us": range(1, 1002)}, {"circle": True}, "that are run without unlimited=True"),
        (
            {"cycle.period_us": range(1, 100_002)},
            {"circle": True, "unlimited": True},
            "circle=True: 100,001 points are more circle tests than the 100,000 that a sweep takes; vary less",
        ),
        (
            {"circle.feed_mm_per_min": [1000.0, 500_000.0]},
            {"circle": True},
            "circle.feed_mm_per_min = 500000.0: axis x reaches 23965.7 mm/min",
        ),
    ]
    for vary, options, message in cases:
        with pytest.raises(busplan.BusplanError, match=re.escape(message)):
            busplan.sweep("paper-4ms", vary=vary, **options)


@pytest.mark.parametrize(
    ("groups", "points", "message"),
    [
        (129, 2, "many: 129 groups are more than the 128 a sweep takes"),
        (128, 400_000, "vary: 400,000 points of 812 columns are too many for a sweep; vary less: 123,152 points"),
    ],
)
def test_many_groups_allow_fewer_points(groups: int, points: int, message: str, tmp_path: Path) -> None:
    """Each group has columns of its own, so a million points of many groups would fill the memory."""
    lines = ["schema_version = 1", 'name = "many"', "[bus]", 'kind = "ethercat"', "[cycle]", "period_us = 20000"]
    for number in range(groups):
        lines += ["[[group]]", f'name = "g{number}"', "nodes = 1", "axes = 1", "read_bytes = 4", "write_bytes = 4"]
        lines += ["execution = {kind = 'linear', base_us = 20, per_byte_us = 0}"]
    (tmp_path / "many.toml").write_text("\n".join(lines))
    with pytest.raises(busplan.BusplanError, match=re.escape(message)):
        busplan.sweep(tmp_path / "many.toml", vary={"cycle.period_us": f"1000:20000:#{points}"})


def test_many_messages_allow_fewer_points(tmp_path: Path) -> None:
    lines = ["schema_version = 1", 'name = "many"', "[bus]", 'kind = "can"', "bit_rate_kbit_s = 1000"]
    for number in range(400):
        lines += ["[[message]]", f'name = "m{number}"', f"identifier = {number}", "payload_bytes = 8"]
        lines += ["period_us = 100000"]
    (tmp_path / "many.toml").write_text("\n".join(lines))
    words = "50,001 settings of 400 groups and messages take too long: give values for up to 50,000 settings"
    with pytest.raises(busplan.BusplanError, match=words):
        busplan.sweep(tmp_path / "many.toml", vary={"bus.bit_rate_kbit_s": "500:1000:#50001"})
