"""A summary over seeds: against Python's statistics and published intervals."""

import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.questions.sweep.circles import CIRCLE_COLUMNS
from busplan.questions.sweep.grid import Array
from busplan.questions.sweep.seeds_run import SUMMARY_COLUMNS, summaries

LENGTHS = st.floats(1e-6, 10.0)


def results(errors: list[float], *, margins: list[float] | None = None, limit: float | None = 1.0) -> Array:
    own = {
        "mean_contour_error_mm": [0.5 * one for one in errors],
        "max_contour_error_mm": errors,
        "circular_deviation_mm": [None] * len(errors),
        "phase_margin_deg": margins or [50.1] * len(errors),
        "gain_margin_db": [12.0] * len(errors),
        "passed": [None if limit is None else one <= limit for one in errors],
    }
    return np.array([own[name] for name in CIRCLE_COLUMNS], dtype=float)


def summary(found: Array) -> dict[str, float]:
    """The summary of one point, that of the second of two."""
    both = summaries(np.stack([np.zeros_like(found), found], axis=1))
    return {name: column[1] for name, column in both.items()}


@given(st.lists(LENGTHS, min_size=2, max_size=50))
def test_figures_are_those_of_the_statistics_module(errors: list[float]) -> None:
    found = summary(results(errors, margins=errors))
    assert tuple(found) == SUMMARY_COLUMNS
    assert found["seeds"] == len(errors)
    for name, ending in (("max_contour_error", "mm"), ("phase_margin", "deg")):
        assert found[f"{name}_mean_{ending}"] == pytest.approx(statistics.fmean(errors), rel=1e-12)
        assert found[f"{name}_std_{ending}"] == pytest.approx(statistics.stdev(errors), rel=1e-9, abs=1e-12)
    steps = statistics.quantiles(errors, n=20, method="inclusive")
    assert found["max_contour_error_p95_mm"] == pytest.approx(steps[-1], rel=1e-12)
    assert found["max_contour_error_worst_mm"] == max(errors)
    # A margin is better the more it is: the bad end is the low one.
    assert found["phase_margin_p95_deg"] == pytest.approx(steps[0], rel=1e-12)
    assert found["phase_margin_worst_deg"] == min(errors)
    assert found["failed_share"] == sum(one > 1.0 for one in errors) / len(errors)


@pytest.mark.parametrize(
    ("failed", "tests", "low", "high"),
    # Newcombe, Two-sided confidence intervals for the single proportion, 1998, table I, method 3.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_the_interval_of_the_share_is_the_published_one(failed: int, tests: int, low: float, high: float) -> None:
    found = summary(results([2.0] * failed + [0.5] * (tests - failed)))
    assert (found["failed_share_low"], found["failed_share_high"]) == pytest.approx((low, high), abs=5e-5)
    other = summary(results([0.5] * failed + [2.0] * (tests - failed)))
    assert other["failed_share_high"] == pytest.approx(1 - low, abs=5e-5)
    assert failed or (found["failed_share_low"], other["failed_share_high"]) == (0.0, 1.0)


@given(LENGTHS, st.integers(2, 40))
def test_seeds_that_change_nothing_have_no_deviation(error: float, seeds: int) -> None:
    found = summary(results([error] * seeds))
    assert found["max_contour_error_std_mm"] == 0.0
    parts = ("mean", "p95", "worst")
    assert {found[f"max_contour_error_{part}_mm"] for part in parts} == {error}


def test_what_any_seed_lacks_is_missing() -> None:
    found = summary(results([0.1, 0.2], limit=None))
    missing = [name for name, value in found.items() if np.isnan(value)]
    assert missing == [name for name in SUMMARY_COLUMNS if "failed" in name or "deviation" in name.partition("_")[2]]
    one = summary(results([0.1]))
    assert one["max_contour_error_mean_mm"] == 0.1
    assert np.isnan(one["max_contour_error_std_mm"])
    mixed = summary(np.concatenate([results([0.1]), results([0.1], limit=None)], axis=1))
    assert mixed["failed_share"] == 0


def test_the_seed_leaves_the_grid_wherever_it_stands() -> None:
    seeds, gains = {"delivery.seed": range(1, 4)}, {"servo.position_gain_per_s": [50.0, 60.0]}
    own = busplan.load_profile("paper-4ms", changes={"circle.radius_mm": 10.0, "delivery.jitter_us": 50.0})
    first = busplan.sweep(own, vary={**seeds, **gains}, circle=True, summary=True)
    last = busplan.sweep(own, vary={**gains, **seeds}, circle=True, summary=True)
    assert "delivery.seed" not in first.columns
    assert (first.to_dict()["points"], first.to_dict()["seeds"]) == (2, 3)
    assert first.to_json() == last.to_json()
    alone = busplan.sweep(own, vary=seeds, circle=True, summary=True).to_dict()
    assert (alone["points"], alone["varied"], alone["rows"][0]["seeds"]) == (1, {}, 3)
    with pytest.raises(busplan.BusplanError, match=r"summary: is over seeds, and none vary"):
        busplan.sweep(own, vary=gains, circle=True, summary=True)
