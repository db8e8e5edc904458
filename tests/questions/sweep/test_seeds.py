"""A summary over seeds: against Python's statistics and published intervals."""

import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.questions.sweep.asked import column_figures
from busplan.questions.sweep.circles import CIRCLE_COLUMNS
from busplan.questions.sweep.grid import Array, Grid
from busplan.questions.sweep.seeds_run import SUMMARY_COLUMNS, summaries, without_seed

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
    seeds, periods = np.arange(1, 10), np.array([1000, 4000])
    for key in ("delivery.seed", "cycle.period_us"):
        axes = {"delivery.seed": seeds, "cycle.period_us": periods}
        grid, found = without_seed(Grid({key: axes.pop(key), **axes}))
        assert (list(grid.axes), found.tolist()) == (["cycle.period_us"], seeds.tolist())
    alone, _ = without_seed(Grid({"delivery.seed": seeds}))
    assert (alone.points, [chunk.shape for chunk in alone.chunks(7)], [*alone.each_point()]) == (1, [()], [{}])
    with pytest.raises(BusplanError, match=r"summary: is over seeds, and none vary"):
        without_seed(Grid({"cycle.period_us": periods}))


def test_every_column_has_its_figure_with_its_unit() -> None:
    figures = column_figures(load("paper-4ms").profile)
    units = {name: figures[name].unit for name in SUMMARY_COLUMNS}
    assert {unit for name, unit in units.items() if "contour_error" in name or "deviation_" in name} == {"mm"}
    assert units["phase_margin_p95_deg"] == "deg"
