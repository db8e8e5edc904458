"""Rows of evidence: a comparison is a row and nothing else, and a row that is wrong says where it stands."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import pytest

import busplan
from busplan.buses import kind_names
from busplan.buses.published import Spread, data_file, rows_of
from busplan.errors import BusplanError
from busplan.forms import render
from busplan.questions import evidence as rows

Breaks = Callable[[dict[str, Any]], object]


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The table of SERCOS II, which a test may change."""
    data = deepcopy(data_file("sercos2"))
    monkeypatch.setattr(rows, "data_file", lambda _: data)
    (only,) = data["evidence"]
    return only  # type: ignore[no-any-return]


def test_a_further_measurement_errs_by_the_spread_of_those_before_and_by_that_of_their_mean() -> None:
    # Three captures, 83.53 ns a byte on average, with a standard deviation of 0.81445 ns: times sqrt(1 + 1/3).
    spread = Spread.of([row["published"] for row in rows_of("ethercat", "bytes")])
    assert spread == pytest.approx((0.0835333, 0.00094045), abs=1e-7)


def test_a_new_comparison_is_a_row(table: dict[str, Any]) -> None:
    new = {"quantity": "ring of 7", "published": 470.5, "grade": "measured", "set": {"bus.nodes": 7}}
    table["rows"].append({**new, "figures": ["required_us", 1], "divided_by": {"figures": [2]}})
    table["rows"].append({**new, "quantity": "of a drive", "figures": ["available_us"], "share_of": 5})
    answer = busplan.evidence("sercos2")
    *_, ring, drive = answer.kinds[0].sections[0].comparisons
    plain = busplan.load_profile("sercos2-servo-8", changes={**table["set"], "bus.nodes": 7})
    (figures,) = busplan.capacity(plain, timing_model="worst-stuffing").results
    assert (ring.computed, ring.published) == ((figures.required_us + 1) / 2, 470.5)
    assert (drive.published, drive.computed) == (470.5 / 5, figures.available_us / 5 / 5)  # its table divides by 5, too
    for form in ("table", "markdown", "html", "json", "csv"):
        assert "470.5" in render(answer.report()._replace(is_whole=True), form), form


@pytest.mark.parametrize(
    ("breaks", "message"),
    [
        (lambda table: table.update(metod="x"), "row 'gap at 4 Mbit/s': metod: Extra inputs are not permitted"),
        (lambda table: table["rows"][1].update(metod="x"), "row 'gap at 8 Mbit/s': metod: Extra inputs"),
        (lambda table: table.pop("unit"), "row 'gap at 4 Mbit/s': unit: Field required"),
        (lambda table: table.update(unit="ms"), "unit: Input should be 'us', '1'"),
        (lambda table: table.pop("title"), "[[evidence]] None: title: Field required"),
        (lambda table: table["rows"].clear(), "rows: List should have at least 1 item"),
        (
            lambda table: table["rows"][0].update(published=3),
            "a published figure needs a grade; a computed one has none",
        ),
        (lambda table: table.update(figures=["margn_us"]), "'margn_us' is no number of sercos2-servo-8, a bus of kind"),
        (lambda table: table.update(figures=["verdict"]), "'verdict' is no number"),
        (lambda table: table.update(figures=["circle.roundness"]), "'circle.roundness' is no number"),
        (lambda table: table.update(figures=["latency.read.us"]), "'latency.read.us' is no number"),
        (lambda table: table.update(model="best"), "model: 'best' is none of worst-stuffing, no-stuffing"),
        (lambda table: table.update(profile="sercos4"), "sercos4: no such file"),
        (lambda table: table["rows"][0]["set"].update({"bus.gap": 1}), "bus.gap"),
        (lambda table: table.update(doubt="node"), "doubt: 'node' is no doubt of sercos2-servo-8"),
        (lambda table: table.update(divided_by={"figure": [5]}), "figure: Extra inputs are not permitted"),
    ],
)
def test_a_row_that_is_wrong_is_named_with_its_file(table: dict[str, Any], breaks: Breaks, message: str) -> None:
    breaks(table)
    with pytest.raises(BusplanError) as raised:
        busplan.evidence("sercos2")
    assert str(raised.value).startswith("sercos2.toml: [[evidence]] ")
    assert message in str(raised.value)


def test_a_function_refuses_arguments_that_it_does_not_take(monkeypatch: pytest.MonkeyPatch) -> None:
    data = deepcopy(data_file("can"))
    data["evidence"][0]["rows"][0]["given"]["bits"] = 1
    monkeypatch.setattr(rows, "data_file", lambda _: data)
    with pytest.raises(BusplanError, match=r"can\.toml: .*row '0 bytes.*frame_bits\(\) got an unexpected keyword"):
        busplan.evidence("can")


@pytest.mark.parametrize("kind", kind_names())
def test_what_a_verdict_counts_has_rows(kind: str) -> None:
    (evidence,) = busplan.evidence(kind).kinds
    parts = {**evidence.tested.set_by, **evidence.tested.parts}
    assert not [part for part, words in parts.items() if words.startswith("0 ")]
