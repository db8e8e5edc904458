"""The picture of `circle-test --plot`, read by its labels."""

from collections.abc import Callable
from functools import cache
from re import findall
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import numpy as np
import pytest

from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.circle.figures import CircleTest
from busplan.questions.circle.plot import circle_svg
from busplan.questions.circle.roundness import circle_test

SVG = "{http://www.w3.org/2000/svg}"
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
Plots = Callable[[Element], list[Any]]


@cache
def run(*changes: tuple[str, object], periods_us: tuple[float, ...] = (4000.0,), ranked: bool = False) -> CircleTest:
    profile = override(load("paper-4ms").profile, dict(changes))
    return circle_test(profile, periods_us=periods_us, with_contributions=ranked, explain=False)


def picture(test: CircleTest, *, note: str = "") -> Element:
    return fromstring(circle_svg(test, note=note))


def texts(root: Element) -> list[str]:
    return [text.text or "" for text in root.iter(f"{SVG}text")]


def circles(root: Element) -> list[Element]:
    return [one for one in root.iter(f"{SVG}svg") if one.get("class") == "chart circle"]


def farthest(circle: Element) -> float:
    """Largest distance of the path from the nominal circle, in px."""
    (path,) = (one.get("d", "") for one in circle.iter(f"{SVG}path") if one.get("class") == "path")
    (nominal,) = (float(one.get("r", "")) for one in circle.iter(f"{SVG}circle") if one.get("class") == "nominal")
    return max(abs(float(np.hypot(float(x), float(y))) - nominal) for x, y in findall(r"(-?[\d.]+) (-?[\d.]+)", path))


# --- scales -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_all_periods_have_one_scale(changes: dict[str, object], plots: Plots) -> None:
    test = run(*changes.items(), *PERFECT.items(), periods_us=(2000.0, 8000.0))
    root = picture(test)
    one, other = plots(root)
    assert one.up == other.up
    # The error of the longer period is 16 times the other one: the drawn radius has it, too.
    short, long = map(farthest, circles(root))
    largest = [result.radial_deviation_min_mm or 0.0 for result in test.results]
    assert long / short == pytest.approx(largest[1] / largest[0], rel=0.05)
    assert long > 10 * short


def test_a_period_whose_loop_is_unstable_flattens_no_other(plots: Plots) -> None:
    test = run(*HOST.items(), periods_us=(1000.0, 16000.0))
    assert [result.stable for result in test.results] == [True, False]
    root = picture(test)
    one, other = plots(root)
    assert one.up == other.up
    assert one.y(0.0) < 100
    assert len(circles(root)) == 1
    assert "circle not drawn: the loop is unstable" in " ".join(texts(root))


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_the_largest_error_is_drawn_however_many_points_there_are(changes: dict[str, object], plots: Plots) -> None:
    test = run(*changes.items())
    (result,), (simulated,) = test.results, test.runs
    assert simulated is not None
    assert simulated.steps > 30_000
    (plot,) = plots(picture(test))
    judged = plot.values("curve measured") + (plot.values("curve apart") if result.path == "trapezoid" else [])
    assert max(abs(error) for _, error in judged) == pytest.approx((result.max_contour_error_mm or 0) * 1e3, rel=0.01)
    assert all(len(points) < 3000 for paths in plot.paths.values() for points in paths)


def test_tiny_errors_are_in_nanometres(plots: Plots) -> None:
    test = run(*SMALL.items(), *PERFECT.items(), periods_us=(2000.0,))
    root = picture(test)
    (plot,) = plots(root)
    assert "contour error [nm]" in texts(root)
    lowest = min(error for _, error in plot.values("curve measured") + plot.values("curve apart"))
    assert lowest == pytest.approx((test.results[0].max_contour_error_mm or 0) * -1e6, rel=0.1)
    assert any(" nm a ring, " in text for text in texts(root))


def test_errors_far_from_zero_are_drawn_without_it(plots: Plots) -> None:
    loop = {"servo.velocity_feedforward": 0.0, "servo.position_gain_per_s": 50.0}
    root = picture(run(*TURN.items(), *PERFECT.items(), *loop.items()))
    (plot,) = plots(root)
    assert plot.y(1.0) < plot.y(0.0) < 0
    assert "contour error [um], 0 lies above" in texts(root)


def test_no_error_is_a_picture_too() -> None:
    tiny = {"circle.feed_mm_per_min": 0.01, "circle.radius_mm": 0.001, "circle.ramp_periods": 1}
    test = run(*SMALL.items(), *PERFECT.items(), *tiny.items())
    assert (test.results[0].max_contour_error_mm or 0.0) * 1e3 < 1e-6
    root = picture(test)
    assert circles(root) == []
    assert any(text.startswith("no contour error; ") for text in texts(root))


# --- what is told apart -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [SMALL, TURN])
def test_the_measured_part_is_shaded_and_apart_from_the_rest(changes: dict[str, object], plots: Plots) -> None:
    test = run(*changes.items())
    (simulated,) = test.runs
    assert simulated is not None
    (plot,) = plots(picture(test))
    part, step_s = simulated.measured, simulated.timing.step_us / 1e6
    times = [(part.start + 1) * step_s, part.stop * step_s]
    measured = plot.values("curve measured")
    assert [measured[0][0], measured[-1][0]] == pytest.approx(times, rel=0.01, abs=0.01)
    (shade,) = (one for one in plot.area.iter(f"{SVG}rect") if one.get("class") == "during")
    start, width = (float(shade.get(key, "").rstrip("%")) / 100 for key in ("x", "width"))
    assert [plot.x(start), plot.x(start + width)] == pytest.approx(times, rel=0.01, abs=0.01)
    assert len(plot.paths["curve apart"]) == 2


def test_a_verdict_is_a_word_in_a_frame_of_its_own() -> None:
    test = run(*SMALL.items())
    (result,) = test.results
    looks = {}
    for passed, word in ((True, "PASSED"), (False, "FAILED"), (None, "NOT JUDGED")):
        root = picture(test._replace(results=(result._replace(passed=passed),)))
        assert word in texts(root)
        (looks[passed],) = (
            one.get("class") for one in root.iter(f"{SVG}rect") if (one.get("class") or "").startswith("frame")
        )
    assert looks == {True: "frame passes", False: "frame fails", None: "frame"}


@pytest.mark.parametrize(("limit_mm", "rings"), [(0.025, 2), (0.010, 2), (1.0, 0)])
def test_the_tolerance_is_dashed_unless_it_lies_far_outside(limit_mm: float, rings: int, plots: Plots) -> None:
    root = picture(run(*SMALL.items(), ("tolerance.max_contour_error_mm", limit_mm)))
    (circle,), (plot,) = circles(root), plots(root)
    assert sum(one.get("class") == "tolerance" for one in circle.iter(f"{SVG}circle")) == rings
    top, height = float(plot.path.get("y")), float(plot.path.get("height"))
    lines = [float(one.get("y1") or 0) for one in plot.area.iter(f"{SVG}line") if one.get("class") == "tolerance"]
    drawn_um = sorted(plot.y((y - top) / height) for y in lines)
    assert drawn_um == pytest.approx([-limit_mm * 1e3, limit_mm * 1e3][:rings], rel=0.02)
    assert f"(limit {limit_mm * 1e3:g} um)" in " ".join(texts(root))
    assert ("tolerance of the largest contour error" in texts(root)) == bool(rings)


@pytest.mark.parametrize(("direction", "words"), [("ccw", "counter-clockwise"), ("cw", "clockwise")])
def test_the_direction_is_named(direction: str, words: str) -> None:
    said = " ".join(texts(picture(run(*TURN.items(), ("circle.direction", direction)))))
    assert f"; {words} " in said


def test_error_sources_stand_below_the_circle_by_rank() -> None:
    test = run(*SMALL.items(), periods_us=(2000.0, 4000.0), ranked=True)
    root = picture(test)
    bars = [one for one in root.iter(f"{SVG}rect") if one.get("class") in ("takes", "hides")]
    ranked = [one for result in test.results for one in result.contributions or ()]
    titles = [one.findtext(f"{SVG}title") or "" for one in bars]
    assert [title.rsplit(",", 1)[0] for title in titles] == [one.source.replace("_", " ") for one in ranked]
    widths = np.array([float(one.get("width", "").rstrip("%")) for one in bars])
    removed = np.array([abs(one.removed_mm) for one in ranked])
    # One scale for both periods.
    assert widths == pytest.approx(removed / removed.max() * widths.max(), abs=0.01)
    assert [one.get("class") == "takes" for one in bars] == [one.removed_mm >= 0 for one in ranked]


# --- texts --------------------------------------------------------------------------------------------------------


def test_the_title_names_grade_changes_and_periods_that_are_not_drawn() -> None:
    test = run(*SMALL.items(), periods_us=(4000.0, 100.0))
    assert " ".join(texts(picture(test, note="--set bus.nodes=3"))).startswith(
        "paper-4ms --set bus.nodes=3 circle test, servo values: 6 assumed, 4 calibrated, 2 published "
        "not drawn, for the bus does not carry it: 100 us 4 ms, "
    )
    (result, missing) = test.results
    ideal = test._replace(results=(result._replace(ideal_drive=True), missing))
    assert "circle test, ideal drive" in texts(picture(ideal))


@pytest.mark.parametrize("name", ["$x_1^2$ " * 12, "W" * 100, "<b>&" * 9])
def test_a_name_is_text_in_lines_that_fit_a_phone(name: str) -> None:
    test = run(*SMALL.items())
    root = picture(test._replace(profile=test.profile.model_copy(update={"name": name})))
    said = texts(root)
    assert "".join("".join(said).split()).startswith("".join(name.split()))
    assert max(map(len, said)) <= 42


def test_each_kind_of_line_is_explained_once() -> None:
    words = texts(picture(run(*SMALL.items(), periods_us=(2000.0, 4000.0))))
    assert [text.split(":")[0] for text in words[-4:]] == [
        *("measured", "the rest", "nominal circle"),
        "tolerance of the largest contour error",
    ]


def test_the_same_test_draws_the_same_picture() -> None:
    test = run(*SMALL.items())
    assert circle_svg(test) == circle_svg(test)
