"""The picture of a circle test: magnified alike, in units that can be read, with its verdict and its tolerances."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import busplan

SMALL = {"circle.radius_mm": 25.0, "circle.ramp_periods": 20}
TURN = {**SMALL, "circle.path": "iso230-4"}
HOST = {**SMALL, "servo.loop": "host"}
PERFECT = {
    "servo.drive_lag_us": 0.0,
    "servo.drive_offset_mm_s": 0.0,
    "servo.dac_bits": 0,
    "servo.encoder_resolution_mm": 0.0,
    "servo.reversal_mm_s": 0.0,
}


@cache
def run(
    *changes: tuple[str, object], periods_us: tuple[float, ...] = (4000.0,), ranked: bool = False
) -> busplan.CircleTestAnswer:
    profile = busplan.load_profile("paper-4ms", changes=dict(changes))
    return busplan.circle_test(profile, period_us=list(periods_us), contributions=ranked)


def plots(drawing: Any, part: str) -> list[Any]:
    """Plots that have a part: curves, the outer edge of a circle, or lanes of bars."""
    return [panel.plot for panel in drawing.panels if hasattr(panel.plot, part)]


def heads(drawing: Any) -> list[Any]:
    """The panel with the verdict of each period."""
    return [panel for panel in drawing.panels if " mm/min, r " in panel.title]


def values(plot: Any, ink: str) -> list[tuple[float, float]]:
    return [(x, y or 0.0) for curve in plot.curves if curve.entry.ink == ink for x, y in curve.points]


def farthest(circle: Any) -> Any:
    return max(abs(radius - 1) for radius in (*circle.inner, *circle.outer) if radius is not None)


# --- scales


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_all_periods_have_one_scale(changes: dict[str, object]) -> None:
    test = run(*changes.items(), *PERFECT.items(), periods_us=(2000.0, 8000.0))
    drawing = test.drawing()
    short, long = plots(drawing, "curves")
    assert short.up == long.up
    # The error of the longer period is 16 times the other one: the drawn radius has it, too.
    least, most = map(farthest, plots(drawing, "outer"))
    largest = [result.radial_deviation_min_mm or 0.0 for result in test.results]
    assert most / least == pytest.approx(largest[1] / largest[0], rel=0.05)
    assert most > 10 * least


def test_a_period_whose_loop_is_unstable_flattens_no_other() -> None:
    test = run(*HOST.items(), periods_us=(1000.0, 16000.0))
    assert [result.stable for result in test.results] == [True, False]
    drawing = test.drawing()
    short, long = plots(drawing, "curves")
    assert short.up == long.up
    assert short.up.high < 100
    assert len(plots(drawing, "outer")) == 1
    assert heads(drawing)[1].words.startswith("circle not drawn: the loop is unstable")


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_the_largest_error_is_drawn_however_many_points_there_are(changes: dict[str, object]) -> None:
    test = run(*changes.items())
    (result,), (simulated,) = test.results, test.runs
    assert simulated is not None
    assert simulated.steps > 30_000
    (plot,) = plots(test.drawing(), "curves")
    judged = values(plot, "first") + (values(plot, "apart") if result.path == "trapezoid" else [])
    assert max(abs(error) for _, error in judged) == pytest.approx((result.max_contour_error_mm or 0) * 1e3)
    assert all(len(curve.points) < 3000 for curve in plot.curves)


def test_no_error_is_a_picture_too() -> None:
    tiny = {"circle.feed_mm_per_min": 0.01, "circle.radius_mm": 0.001, "circle.ramp_periods": 1}
    test = run(*SMALL.items(), *PERFECT.items(), *tiny.items())
    assert (test.results[0].max_contour_error_mm or 0.0) * 1e3 < 1e-6
    assert plots(test.drawing(), "outer") == []
    assert heads(test.drawing())[0].words.startswith("no contour error; ")
    assert test.svg()


# --- what is told apart


@pytest.mark.parametrize(
    ("passed", "word", "tone"),
    [(True, "PASSED", "passes"), (False, "FAILED", "fails"), (None, "NOT JUDGED", "neutral")],
)
def test_a_verdict_is_a_word_and_a_colour(passed: bool | None, word: str, tone: str) -> None:
    test = run(*SMALL.items())
    (result,) = test.results
    (head,) = heads(replace(test, results=(result._replace(passed=passed),)).drawing())
    assert head.title == f"{word}: 4 ms, 2500 mm/min, r 25 mm"
    assert head.tone == tone


@pytest.mark.parametrize(("limit_mm", "rings"), [(0.025, 2), (0.010, 2), (1.0, 0)])
def test_the_tolerance_is_drawn_unless_it_lies_far_outside(limit_mm: float, rings: int) -> None:
    test = run(*SMALL.items(), ("tolerance.max_contour_error_mm", limit_mm))
    drawing, (result,) = test.drawing(), test.results
    (circle,), (plot,) = plots(drawing, "outer"), plots(drawing, "curves")
    radii = sorted(radius for radius, entry in circle.rings if entry.ink == "tolerance")
    assert len(radii) == rings
    # The circle is magnified as its tolerance is.
    radial_mm = max(abs(result.radial_deviation_min_mm or 0.0), abs(result.radial_deviation_max_mm or 0.0))
    for radius, sign in zip(radii, (-1, 1), strict=False):
        assert (radius - 1) / farthest(circle) == pytest.approx(sign * limit_mm / radial_mm)
    drawn_um = sorted(guide.y or 0.0 for guide in plot.guides if guide.entry.ink == "tolerance")
    assert drawn_um == pytest.approx([-limit_mm * 1e3, limit_mm * 1e3][:rings])
    assert f"(limit {limit_mm * 1e3:g} um)" in " ".join(panel.title for panel in drawing.panels)
    assert ("tolerance of the largest error" in {guide.entry.words for guide in plot.guides}) == bool(rings)


def test_error_sources_stand_below_the_circle_by_rank() -> None:
    test = run(*SMALL.items(), periods_us=(2000.0, 4000.0), ranked=True)
    both = plots(test.drawing(), "lanes")
    # One scale for both periods.
    assert both[0].across == both[1].across
    for plot, result in zip(both, test.results, strict=True):
        ranked = result.contributions or ()
        assert [lane.label for lane in plot.lanes] == [source.words for source in ranked]
        sizes = np.array([span.end + span.start for lane in plot.lanes for span in lane.spans])
        assert sizes == pytest.approx([source.removed_mm * 1e3 for source in ranked])


def test_the_words_name_grade_and_periods_that_are_not_drawn() -> None:
    drawing = run(*SMALL.items(), periods_us=(4000.0, 100.0)).drawing()
    assert (drawing.title, *drawing.words) == (
        *("paper-4ms", "circle test, servo values: 6 assumed, 4 calibrated, 2 published"),
        "not drawn: the bus does not carry 100 us",
    )
