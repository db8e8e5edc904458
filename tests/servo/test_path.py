"""The circle's set-points."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.servo.parameters import LoopTiming
from busplan.servo.path import circle_path, measured_part
from busplan.servo.runnable import MAX_SETPOINTS, move_along, unfit_move


@pytest.mark.parametrize(
    ("period_us", "feed_mm_per_min", "duration_s"), [(4000.0, 2500.0, 48.656), (1000.0, 10_000.0, 12.164)]
)
def test_the_papers_moves(period_us: float, feed_mm_per_min: float, duration_s: float) -> None:
    path = circle_path(320.0, feed_mm_per_min=feed_mm_per_min, period_us=period_us, ramp_periods=100)
    assert path.setpoints == 12164
    assert path.duration_us == duration_s * 1e6


@given(
    radius_mm=st.floats(0.1, 1000),
    feed_mm_per_min=st.floats(100, 20_000),
    period_us=st.sampled_from([250.0, 1000.0, 4000.0]),
    ramp_periods=st.integers(0, 200),
)
def test_every_setpoint_is_on_the_circle_and_none_faster_than_the_feed(
    radius_mm: float, feed_mm_per_min: float, period_us: float, ramp_periods: int
) -> None:
    feed_mm_s, ramp_s = feed_mm_per_min / 60, ramp_periods * period_us / 1e6
    assume(2 * math.pi * radius_mm > feed_mm_s * ramp_s)
    assume(2 * math.pi * radius_mm / feed_mm_s / period_us * 1e6 < 50_000)
    path = circle_path(radius_mm, feed_mm_per_min=feed_mm_per_min, period_us=period_us, ramp_periods=ramp_periods)
    np.testing.assert_allclose(np.hypot(path.x_mm, path.y_mm), radius_mm, rtol=1e-14)
    assert (path.x_mm[0], path.y_mm[0]) == (radius_mm, 0.0)
    assert path.x_mm[-1] == pytest.approx(radius_mm, rel=1e-12)
    assert abs(path.y_mm[-1]) < 1e-12 * radius_mm
    chords = np.hypot(np.diff(path.x_mm), np.diff(path.y_mm))
    assert chords.max() <= feed_mm_s * period_us / 1e6 * (1 + 1e-9) + 1e-13 * radius_mm


def test_the_speed_is_a_trapezoid() -> None:
    path = circle_path(100.0, feed_mm_per_min=6000.0, period_us=1000.0, ramp_periods=50)
    way = np.unwrap(np.arctan2(path.y_mm, path.x_mm)) * 100.0
    speed = np.diff(way) / 1e-3
    middle = (np.arange(path.setpoints) + 0.5) * 1000.0
    end = (2 * math.pi * 100 / 100 + 0.05) * 1e6
    np.testing.assert_allclose(speed[:50], 100 * middle[:50] / 50_000, rtol=1e-9)
    steady = (middle > path.constant_from_us) & (middle < path.constant_until_us - 1000)
    np.testing.assert_allclose(speed[steady], 100.0, rtol=1e-9)
    slowing = (middle > path.constant_until_us + 1000) & (middle < end - 1000)
    np.testing.assert_allclose(speed[slowing], 100 * (end - middle[slowing]) / 50_000, rtol=1e-9)
    assert path.constant_until_us == pytest.approx(end - 50_000)


def test_clockwise_is_the_mirror_image() -> None:
    ccw, cw = (circle_path(10.0, feed_mm_per_min=600.0, period_us=1000.0, direction=d) for d in ("ccw", "cw"))
    np.testing.assert_array_equal(ccw.x_mm, cw.x_mm)
    np.testing.assert_array_equal(ccw.y_mm, -cw.y_mm)
    assert ccw.y_mm[10] > 0


def test_without_ramps_every_chord_but_the_last_is_alike() -> None:
    path = circle_path(10.0, feed_mm_per_min=600.0, period_us=1000.0, ramp_periods=0)
    chords = np.hypot(np.diff(path.x_mm), np.diff(path.y_mm))
    np.testing.assert_allclose(chords[:-1], chords[0], rtol=1e-9)
    assert path.setpoints == math.ceil(2 * math.pi * 10 / 10 / 1e-3)


def test_a_move_that_ends_on_a_period_gains_none() -> None:
    feed_mm_per_min = 2 * math.pi * 7.0 / 1.0 * 60
    assert circle_path(7.0, feed_mm_per_min=feed_mm_per_min, period_us=1000.0, ramp_periods=100).setpoints == 1100
    for radius_mm in (1.0, 2.0, 7.0):
        feed_mm_per_min = 2 * math.pi * radius_mm / 0.25 * 60
        path = circle_path(
            radius_mm, feed_mm_per_min=feed_mm_per_min, period_us=1000.0, ramp_periods=20, settling_us=0.0
        )
        assert path.turn_from_us == 260e3
        assert path.setpoints == 530


@given(
    radius_mm=st.floats(0.5, 100),
    feed_mm_per_min=st.floats(1000, 20_000),
    period_us=st.sampled_from([250.0, 1000.0, 4000.0]),
    ramp_periods=st.integers(0, 300),
    settling_us=st.floats(0, 1e6),
)
def test_a_turn_at_constant_speed_follows_a_lead_in_of_whole_turns(
    radius_mm: float, feed_mm_per_min: float, period_us: float, ramp_periods: int, settling_us: float
) -> None:
    feed_mm_s = feed_mm_per_min / 60
    assume(3 * 2 * math.pi * radius_mm / feed_mm_s / period_us * 1e6 < 50_000)
    known: dict[str, Any] = {
        "feed_mm_per_min": feed_mm_per_min, "period_us": period_us, "settling_us": settling_us,
    }  # fmt: skip
    path = circle_path(radius_mm, ramp_periods=ramp_periods, **known)
    assert path.turn_from_us is not None
    start, rounding_us = round(path.turn_from_us / period_us), 1e-6 * period_us
    assert path.turn_from_us == pytest.approx(start * period_us, abs=rounding_us)
    assert (path.x_mm[start], path.y_mm[start]) == pytest.approx((radius_mm, 0.0), abs=1e-9 * radius_mm)
    assert path.turn_us == pytest.approx(2 * math.pi * radius_mm / feed_mm_s * 1e6)
    assert path.constant_until_us - path.turn_from_us == pytest.approx(path.turn_us)
    assert path.turn_from_us - path.constant_from_us >= settling_us - rounding_us
    assert path.constant_from_us == pytest.approx(ramp_periods * period_us)
    # Along the circle: a ramp, the feed, and a ramp that mirrors the first.
    way_mm = np.unwrap(np.arctan2(path.y_mm, path.x_mm)) * radius_mm
    assert way_mm[start] - way_mm[0] >= 2 * math.pi * radius_mm * (1 - 1e-9)
    steady = way_mm[ramp_periods : math.floor(path.constant_until_us / period_us) + 1]
    np.testing.assert_allclose(np.diff(steady), feed_mm_s * period_us / 1e6, rtol=1e-6)
    assert np.diff(way_mm).max() <= feed_mm_s * period_us / 1e6 * (1 + 1e-6)
    ramp_mm = feed_mm_s * ramp_periods * period_us / 2e6
    assert way_mm[ramp_periods] - way_mm[0] == pytest.approx(ramp_mm, abs=1e-6)
    assert way_mm[-1] - way_mm[start] == pytest.approx(2 * math.pi * radius_mm + ramp_mm, abs=1e-6)
    assert path.setpoints == move_along(radius_mm, ramp_periods=ramp_periods, **known).setpoints
    # Not a turn more than is needed.
    needed_us = path.turn_us + settling_us + path.constant_from_us
    assert path.turn_from_us <= needed_us + period_us + rounding_us


@pytest.mark.parametrize("settling_us", [-1.0, math.inf, math.nan])
def test_a_bad_settling_time_is_refused(settling_us: float) -> None:
    with pytest.raises(BusplanError, match=r"^settling_us = "):
        circle_path(10.0, feed_mm_per_min=600.0, period_us=1000.0, settling_us=settling_us)


def test_a_circle_too_short_for_its_feed_is_refused_with_what_would_do() -> None:
    with pytest.raises(BusplanError, match=r"never reached.*at most 18849\.6 mm/min, at least 0\.53") as caught:
        circle_path(0.5, feed_mm_per_min=20_000.0, period_us=100.0, ramp_periods=100)
    assert "radius_mm = 0.5" in str(caught.value)
    circle_path(0.5, feed_mm_per_min=18_849.5, period_us=100.0, ramp_periods=100)


def test_a_million_set_points_are_a_circle_and_one_more_is_none() -> None:
    # A turn of a second in periods of 1 us; a ramp of a period makes it one period longer.
    turn: dict[str, Any] = {"feed_mm_per_min": 60 * 2 * math.pi, "period_us": 1.0, "settling_us": None}
    moves = [move_along(1.0, ramp_periods=ramp, **turn) for ramp in (0, 1)]
    assert [(move.setpoints, [*unfit_move(move, radius_mm=1.0)] == []) for move in moves] == [
        (MAX_SETPOINTS, True),
        (MAX_SETPOINTS + 1, False),
    ]


@pytest.mark.parametrize(("turn_us", "steps", "share"), [(80.0, 1, 0.8), (120.0, 2, 0.2), (250.0, 3, 0.5)])
def test_a_turn_has_as_many_steps_of_100_us_as_it_begins(turn_us: float, steps: int, share: float) -> None:
    feed_mm_per_min = 60 * 2 * math.pi * 1e-3 / (turn_us * 1e-6)
    path = circle_path(1e-3, feed_mm_per_min=feed_mm_per_min, period_us=1000.0, ramp_periods=0, settling_us=0.0)
    part = measured_part(path, timing=LoopTiming(period_us=1000.0), margins=())
    assert part.steps.stop - part.steps.start == steps
    assert part.turn_share == pytest.approx(share)


def test_all_bad_values_are_reported_together() -> None:
    with pytest.raises(BusplanError) as caught:
        circle_path(0.0, feed_mm_per_min=math.inf, period_us=math.nan, ramp_periods=-1, direction="up")  # type: ignore[arg-type]
    names = ("radius_mm", "feed_mm_per_min", "period_us", "ramp_periods", "direction")
    assert [problem.split(" = ")[0] for problem in caught.value.problems] == list(names)


def test_a_move_without_end_is_refused() -> None:
    for settling_us in (None, 0.0):
        with pytest.raises(BusplanError, match=str(MAX_SETPOINTS)):
            circle_path(320.0, feed_mm_per_min=1e-3, period_us=1000.0, settling_us=settling_us)
