"""A summary over seeds: against Python's statistics of the single circles, and published intervals."""

import statistics
from functools import cache
from typing import Any

import numpy as np
import pytest

import busplan

JITTER = {"circle.radius_mm": 2.0, "circle.ramp_periods": 2, "circle.feed_mm_per_min": 6000.0}
CIRCLE = busplan.load_profile("paper-4ms", changes={**JITTER, "delivery.jitter_us": 200.0, "tolerance": {}})
"""A short circle, which is another one with each seed."""
SPREAD = ("mean_contour_error_mm", "max_contour_error_mm", "phase_margin_deg", "gain_margin_db")


def circles(profile: busplan.Profile, seeds: int, *, summary: bool) -> busplan.SweepAnswer:
    vary = {"delivery.seed": range(seeds)}
    return busplan.sweep(profile, vary=vary, circle=True, summary=summary, timing_model="standard")


@cache
def errors_mm() -> list[float]:
    errors: list[float] = circles(CIRCLE, 263, summary=False)["max_contour_error_mm"].tolist()
    return errors


def summary_of(profile: busplan.Profile, seeds: int) -> dict[str, Any]:
    (row,) = circles(profile, seeds, summary=True).to_dict()["rows"]
    return dict(row)


def failing(failed: int, tests: int) -> busplan.Profile:
    """A profile with a tolerance that so many of the first seeds break."""
    ordered = sorted(errors_mm()[:tests])
    limit_mm = statistics.fmean([*ordered, 2 * ordered[-1]][tests - failed - 1 : tests - failed + 1])
    return busplan.load_profile(CIRCLE, changes={"tolerance.max_contour_error_mm": limit_mm})


def test_figures_are_those_of_the_statistics_module() -> None:
    single, summary = circles(CIRCLE, 40, summary=False), summary_of(CIRCLE, 40)
    assert summary["seeds"] == 40
    for key in SPREAD:
        values = single[key].tolist()
        stem, _, unit = key.rpartition("_")
        mean, std, p95, worst = (summary[f"{stem}_{part}_{unit}"] for part in ("mean", "std", "p95", "worst"))
        assert (mean, std) == pytest.approx((statistics.fmean(values), statistics.stdev(values)), rel=1e-9, abs=1e-12)
        steps = statistics.quantiles(values, n=20, method="inclusive")
        assert (p95, worst) == (pytest.approx(steps[-1], rel=1e-12), max(values))
        # Margins are of the loop: no seed changes them.
        assert ("margin" in key) == (std == 0)


@pytest.mark.parametrize(
    ("failed", "tests", "low", "high"),
    # Newcombe, Two-sided confidence intervals for the single proportion, 1998, table I, method 3.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_the_interval_of_the_share_is_the_published_one(failed: int, tests: int, low: float, high: float) -> None:
    summary = summary_of(failing(failed, tests), tests)
    assert summary["failed_share"] == failed / tests
    assert (summary["failed_share_low"], summary["failed_share_high"]) == pytest.approx((low, high), abs=5e-5)
    assert failed or summary["failed_share_low"] == 0.0


def test_the_interval_of_seeds_that_all_fail_ends_at_one() -> None:
    tight = busplan.load_profile(CIRCLE, changes={"tolerance.max_contour_error_mm": 0.001})
    summary = summary_of(tight, 20)
    assert (summary["failed_share"], summary["failed_share_high"]) == (1.0, 1.0)
    assert summary["failed_share_low"] == pytest.approx(1 - 0.1611, abs=5e-5)


def test_seeds_that_change_nothing_have_no_deviation() -> None:
    still = busplan.load_profile(CIRCLE, changes={"delivery.jitter_us": 0.0})
    answer = circles(still, 7, summary=True)
    assert answer["max_contour_error_std_mm"].tolist() == [0.0]
    assert len({answer[f"max_contour_error_{part}_mm"].item() for part in ("mean", "p95", "worst")}) == 1
    assert "At 1 point all seeds gave the same circle" in str(answer)


def test_what_any_seed_lacks_is_missing() -> None:
    # No tolerance judges the circle, and a trapezoid has no circular deviation.
    summary = summary_of(CIRCLE, 2)
    missing = [key for key, value in summary.items() if value is None]
    assert {key for key in missing if key.startswith("failed")} == {
        "failed_share",
        "failed_share_low",
        "failed_share_high",
    }
    assert {key for key in missing if "circular" in key} == {
        f"circular_deviation_{part}_mm" for part in ("mean", "std", "p95", "worst")
    }
    alone = circles(CIRCLE, 1, summary=True)
    assert alone["max_contour_error_mean_mm"].tolist() == errors_mm()[:1]
    assert np.isnan(alone["max_contour_error_std_mm"]).all()


def test_the_seed_leaves_the_grid_wherever_it_stands() -> None:
    seeds, gains = {"delivery.seed": range(1, 4)}, {"servo.position_gain_per_s": [50.0, 60.0]}
    first = busplan.sweep(CIRCLE, vary={**seeds, **gains}, circle=True, summary=True)
    last = busplan.sweep(CIRCLE, vary={**gains, **seeds}, circle=True, summary=True)
    assert "delivery.seed" not in first.columns
    assert (first.to_dict()["points"], first.to_dict()["seeds"]) == (2, 3)
    assert first.to_json() == last.to_json()
    alone = busplan.sweep(CIRCLE, vary=seeds, circle=True, summary=True).to_dict()
    assert (alone["points"], alone["varied"], alone["rows"][0]["seeds"]) == (1, {}, 3)
    with pytest.raises(busplan.BusplanError, match=r"summary: is over seeds, and none vary"):
        busplan.sweep(CIRCLE, vary=gains, circle=True, summary=True)
