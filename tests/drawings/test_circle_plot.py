"""The figure of `circle-test --plot`, asked through matplotlib."""

from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from busplan.analysis.circle.roundness import CircleTest, circle_test
from busplan.drawings.circle_plot import circle_figure, draw_test
from busplan.profile.shipped import load
from busplan.profile.toml import override

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
def run(*changes: tuple[str, object], periods_us: tuple[float, ...] = (4000.0,), ranked: bool = False) -> CircleTest:
    profile = override(load("paper-4ms").profile, dict(changes))
    return circle_test(profile, periods_us=periods_us, with_contributions=ranked, explain=False)


def columns(test: CircleTest, *, number: int = 2) -> list[list[Axes]]:
    """Axes of the figure, by column."""
    axes = draw_test(test).axes
    return [axes[first::number] for first in range(number)]


def curves(axes: Axes, words: str) -> list[Line2D]:
    return [line for line in axes.get_lines() if str(line.get_label()).startswith(words)]


def heights(line: Line2D) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    return np.asarray(line.get_ydata(), dtype=np.float64)


def said(figure: Figure) -> Iterator[Text]:
    """Texts of the figure, without those of ticks."""
    yield from figure.texts
    for axes in figure.axes:
        yield from (axes.title, *axes.texts, axes.xaxis.label, axes.yaxis.label)
    for legend in figure.legends:
        yield from legend.get_texts()


# --- scales -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_all_periods_have_one_scale(changes: dict[str, object]) -> None:
    test = run(*changes.items(), *PERFECT.items(), periods_us=(2000.0, 8000.0))
    polar, errors = columns(test)
    assert errors[0].get_ylim() == errors[1].get_ylim()
    assert errors[0].get_ylabel() == errors[1].get_ylabel()
    # The error of the longer period is 16 times the other one: the drawn radius has it, too.
    deviations = [max(abs(np.hypot(*line.get_data()) - 1).max() for line in curves(one, "measured")) for one in polar]
    largest = [result.radial_deviation_min_mm or 0.0 for result in test.results]
    assert deviations[1] / deviations[0] == pytest.approx(largest[1] / largest[0], rel=1e-3)
    assert deviations[1] > 10 * deviations[0]


def test_a_period_whose_loop_is_unstable_flattens_no_other() -> None:
    test = run(*HOST.items(), periods_us=(1000.0, 16000.0))
    assert [result.stable for result in test.results] == [True, False]
    polar, errors = columns(test)
    assert errors[0].get_ylim() == errors[1].get_ylim()
    assert errors[0].get_ylim()[1] < 100
    assert [bool(curves(one, "measured")) for one in polar] == [True, False]
    assert "not drawn:\nthe loop is unstable" in [text.get_text() for text in polar[1].texts]


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_the_largest_error_is_drawn_however_many_points_there_are(changes: dict[str, object]) -> None:
    test = run(*changes.items())
    (result,), (simulated,) = test.results, test.runs
    assert simulated is not None
    assert simulated.steps > 30_000
    _, (axes,) = columns(test)
    judged = curves(axes, "measured") + (curves(axes, "the rest") if result.path == "trapezoid" else [])
    assert max(abs(heights(line)).max() for line in judged) == pytest.approx((result.max_contour_error_mm or 0) * 1e3)
    assert all(len(heights(line)) < 10_000 for line in judged)


def test_tiny_errors_are_in_nanometres() -> None:
    test = run(*SMALL.items(), *PERFECT.items(), periods_us=(2000.0,))
    polar, (axes,) = columns(test)
    assert axes.get_ylabel() == "contour error [nm]"
    assert axes.get_ylim()[0] == pytest.approx((test.results[0].max_contour_error_mm or 0) * -1e6, rel=0.1)
    assert " nm a ring\n" in polar[0].texts[-1].get_text()


def test_errors_far_from_zero_are_drawn_without_it() -> None:
    loop = {"servo.velocity_feedforward": 0.0, "servo.position_gain_per_s": 50.0}
    _, (axes,) = columns(run(*TURN.items(), *PERFECT.items(), *loop.items()))
    low, high = axes.get_ylim()
    assert low < high < 0
    assert axes.get_ylabel() == "contour error [um], 0 lies above"


def test_no_error_is_a_picture_too() -> None:
    tiny = {"circle.feed_mm_per_min": 0.01, "circle.radius_mm": 0.001, "circle.ramp_periods": 1}
    test = run(*SMALL.items(), *PERFECT.items(), *tiny.items())
    assert (test.results[0].max_contour_error_mm or 0.0) * 1e3 < 1e-6
    (polar,), _ = columns(test)
    assert polar.texts[-1].get_text().startswith("no contour error\n")


# --- what is told apart -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_the_measured_part_is_apart_from_the_rest(changes: dict[str, object]) -> None:
    test = run(*changes.items())
    (simulated,) = test.runs
    assert simulated is not None
    _, (axes,) = columns(test)
    (measured,) = curves(axes, "measured")
    part, step_s = simulated.measured, simulated.timing.step_us / 1e6
    time_s = np.asarray(measured.get_xdata(), dtype=np.float64)
    assert (time_s[0], time_s[-1]) == pytest.approx(((part.start + 1) * step_s, part.stop * step_s))
    rest = curves(axes, "the rest")
    assert len(rest) == 2
    assert all(line.get_linewidth() < measured.get_linewidth() for line in rest)
    assert not any(same_color(line.get_color(), measured.get_color()) for line in rest)


def test_a_verdict_is_a_word_in_a_frame_of_its_own() -> None:
    test = run(*SMALL.items())
    (result,) = test.results
    looks = set()
    for passed, word in ((True, "PASSED"), (False, "FAILED"), (None, "NOT JUDGED")):
        (polar,), _ = columns(test._replace(results=(result._replace(passed=passed),)))
        (verdict,) = (text for text in polar.texts if text.get_text() == word)
        frame = verdict.get_bbox_patch()
        assert frame is not None
        looks.add((same_color(frame.get_facecolor(), "white"), frame.get_linestyle()))
    assert len(looks) == 3


@pytest.mark.parametrize(("limit_mm", "rings"), [(0.025, 2), (0.010, 2), (1.0, 0)])
def test_the_tolerance_is_dashed_unless_it_lies_far_outside(limit_mm: float, rings: int) -> None:
    test = run(*SMALL.items(), ("tolerance.max_contour_error_mm", limit_mm))
    (polar,), (axes,) = columns(test)
    assert len(curves(polar, "tolerance")) == rings
    assert sorted(heights(line)[0] for line in curves(axes, "tolerance")) == [-limit_mm * 1e3, limit_mm * 1e3][:rings]
    assert f"(limit {limit_mm * 1e3:g} um)" in axes.get_title()


@pytest.mark.parametrize(("direction", "words"), [("ccw", "counter-clockwise"), ("cw", "clockwise")])
def test_direction_axes_and_start_are_named(direction: str, words: str) -> None:
    (polar,), _ = columns(run(*TURN.items(), ("circle.direction", direction)))
    texts = [text.get_text() for text in polar.texts]
    assert {"X 0°", "Y 90°", "180°", "270°"} <= set(texts)
    assert texts[-1].splitlines()[-1] == words
    (start,) = curves(polar, "start")
    assert np.asarray(start.get_xdata(), dtype=np.float64) == pytest.approx(1.0, abs=0.02)
    assert heights(start) == pytest.approx(0.0, abs=0.02)
    (arrow,) = (line for line in polar.get_lines() if np.allclose(np.hypot(*line.get_data()), 0.62))
    assert (heights(arrow)[-1] > heights(arrow)[0]) == (direction == "ccw")


def test_error_sources_stand_beside_the_circle_by_rank() -> None:
    test = run(*SMALL.items(), periods_us=(2000.0, 4000.0), ranked=True)
    *_, ranking = columns(test, number=3)
    for axes, result in zip(ranking, test.results, strict=True):
        ranked = result.contributions or ()
        assert [text.get_text() for text in axes.get_yticklabels()] == [one.source.replace("_", " ") for one in ranked]
        assert [bar.get_width() for bar in axes.patches] == pytest.approx([one.removed_mm * 1e3 for one in ranked])  # type: ignore[attr-defined]
    assert ranking[0].get_xlim() == ranking[1].get_xlim()


# --- texts --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "periods_us", "ranked"),
    [
        ("paper-4ms", (4000.0,), True),
        ("$x_1^2$ " * 12, (4000.0,), False),
        ("W" * 100, (4000.0,), True),
        ("W" * 100, (1000.0, 2000.0, 4000.0, 8000.0), False),
        ("paper-4ms", (1000.0, 2000.0, 4000.0, 8000.0), True),
    ],
)
def test_no_text_lies_on_another_or_leaves_the_figure(name: str, periods_us: tuple[float, ...], ranked: bool) -> None:
    test = run(*TURN.items(), periods_us=periods_us, ranked=ranked)
    figure = draw_test(test._replace(profile=test.profile.model_copy(update={"name": name})))
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in said(figure) if text.get_text()]
    assert len(boxes) > 10
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 for box in boxes)


def test_the_title_names_grade_and_periods_that_are_not_drawn() -> None:
    test = run(*SMALL.items(), periods_us=(4000.0, 100.0))
    title = draw_test(test).get_suptitle()
    assert title.splitlines() == [
        "paper-4ms",
        "circle test, servo values: 6 assumed, 4 calibrated, 2 published",
        "not drawn, for the bus does not carry it: 100 us",
    ]
    (result, missing) = test.results
    ideal = test._replace(results=(result._replace(ideal_drive=True), missing))
    assert "circle test, ideal drive\n" in draw_test(ideal).get_suptitle()


def test_each_kind_of_line_is_explained_once() -> None:
    figure = draw_test(run(*SMALL.items(), periods_us=(2000.0, 4000.0)))
    (legend,) = figure.legends
    words = [text.get_text().split(":")[0] for text in legend.get_texts()]
    assert sorted(words) == [
        *("measured", "nominal circle", "start of the measured part", "the rest"),
        "tolerance of the largest contour error",
    ]


@pytest.mark.parametrize("file_format", ["png", "svg", "pdf"])
def test_the_same_test_draws_the_same_bytes(file_format: str) -> None:
    test = run(*SMALL.items())
    assert circle_figure(test, file_format=file_format) == circle_figure(test, file_format=file_format)
