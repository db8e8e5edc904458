"""Whole turns whose measures are known beforehand: from linear systems, from geometry, from symmetry."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from busplan.servo.circle import CircleRun, simulate_circle
from busplan.servo.parameters import Axis, Delivery, LoopTiming, Mechanics
from busplan.servo.path import Direction, circle_path, settling_time_us
from tests.registers import at_least

Loop = Callable[[Axis, LoopTiming], Any]

FEED_MM_S = 100.0
PERIOD_S = 1e-3
NODE = LoopTiming(period_us=1000.0)
EXACT = LoopTiming(period_us=1000.0, step_us=1000.0)
"""No line between set-points: a loop that is on its target a step later is on the circle itself."""


def an_axis(**changes: Any) -> Axis:
    """An ideal drive under a P loop alone."""
    values: dict[str, Any] = {"position_gain_per_s": 50.0, "velocity_feedforward": 0.0}
    return Axis(**(values | changes))


DEADBEAT = an_axis(position_gain_per_s=1000.0)
"""On its target a step of 1 ms later."""


def turn(
    x: Axis,
    y: Axis | None = None,
    *,
    radius_mm: float = 10.0,
    feed_mm_s: float = FEED_MM_S,
    timing: LoopTiming = NODE,
    ramp_periods: int = 20,
    direction: Direction = "ccw",
    extra_us: float = 0.0,
    rest_mm: float = 1e-7,
    **changes: Any,
) -> CircleRun:
    """A whole turn, with less of the lag left than any tolerance here."""
    y = x if y is None else y
    feed = feed_mm_s * 60
    settling_us = settling_time_us(x, y, timing=timing, feed_mm_per_min=feed, rest_mm=rest_mm)
    assert settling_us is not None
    path = circle_path(
        radius_mm,
        feed_mm_per_min=feed,
        period_us=timing.period_us,
        ramp_periods=ramp_periods,
        direction=direction,
        settling_us=settling_us + extra_us,
    )
    return simulate_circle(path, x=x, y=y, timing=timing, **changes)


def deviation_mm(run: CircleRun) -> float:
    """G."""
    found = run.contour.circular_deviation_mm
    assert found is not None
    return found


def sagitta_mm(radius_mm: float) -> float:
    """How far the middle of the line between two set-points lies inside the circle."""
    return (FEED_MM_S * PERIOD_S) ** 2 / (8 * radius_mm)


def follows(loop: Any, angle: float) -> complex:
    """The closed loop at an angle on the unit circle."""
    gain = complex(loop.at(angle / (2 * math.pi * loop.period_s))[0])
    return gain / (1 + gain)


# --- linear systems ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("x", "y", "expected_um", "lowest_um"),
    [
        ({"position_gain_per_s": 50.0}, {"position_gain_per_s": 49.0}, 40.75, None),
        ({"position_gain_per_s": 10.0}, {"position_gain_per_s": 10.0}, 0.0, None),
        (
            {"position_gain_per_s": 100.0, "integral_gain_per_s2": 200.0},
            {"position_gain_per_s": 100.0, "integral_gain_per_s2": 200.0},
            0.0,
            502.0,
        ),
        ({"drive_lag_us": 4000.0}, {"drive_lag_us": 5000.0}, 4.0, None),
    ],
)
def test_two_linear_loops_make_the_ellipse_of_their_frequency_responses(
    reference_loop: Loop, x: dict[str, float], y: dict[str, float], expected_um: float, lowest_um: float | None
) -> None:
    """The semi-axes are r |Tx + Ty| / 2 +- r |Tx - Ty| / 2; G is twice the second."""
    axes = an_axis(**x), an_axis(**y)
    run = turn(*axes, radius_mm=50.0)
    angle = FEED_MM_S / 50.0 * NODE.step_us / 1e6
    # The target moves on lines between set-points: two averages over the ten steps of a period.
    chords = (math.sin(10 * angle / 2) / (10 * math.sin(angle / 2))) ** 2
    response_x, response_y = (follows(reference_loop(axis, NODE), angle) for axis in axes)
    expected = 50.0 * chords * abs(response_x - response_y)
    assert expected * 1e3 == pytest.approx(expected_um, abs=0.05)
    assert deviation_mm(run) == pytest.approx(expected, abs=sagitta_mm(50.0))
    smallest = 50.0 * (chords * (abs(response_x + response_y) - abs(response_x - response_y)) / 2 - 1)
    assert run.contour.radial_deviation_min_mm == pytest.approx(smallest, abs=sagitta_mm(50.0))
    if lowest_um is not None:
        assert smallest * 1e3 == pytest.approx(lowest_um, abs=0.5)


@settings(max_examples=at_least(7))
@given(kp=st.floats(20, 300), ki_share=st.floats(0, 0.5), lag_share=st.floats(0, 0.5))
def test_equal_linear_loops_run_a_round_circle_whatever_they_are(kp: float, ki_share: float, lag_share: float) -> None:
    """Shares of 0.25 are double poles."""
    axis = an_axis(position_gain_per_s=kp, integral_gain_per_s2=ki_share * kp**2, drive_lag_us=lag_share / kp * 1e6)
    time_us = settling_time_us(axis, axis, timing=NODE, feed_mm_per_min=FEED_MM_S * 60, rest_mm=1e-7)
    assume(time_us is not None and time_us < 2e6)
    run = turn(axis)
    assert deviation_mm(run) <= sagitta_mm(10.0)
    assert run.contour.centre_offset_mm == pytest.approx((0, 0), abs=sagitta_mm(10.0))


def test_a_p_loop_cuts_the_circle_as_the_continuous_one_does_in_the_limit() -> None:
    """The step's error is of first order: twice the finer minus the coarser one is of second."""
    coarse, fine = (
        turn(an_axis(), timing=LoopTiming(period_us=1000.0, step_us=step_us)).contour.radius_deviation_mm
        for step_us in (100.0, 50.0)
    )
    turn_per_s = FEED_MM_S / 10.0
    chords = (math.sin(turn_per_s * PERIOD_S / 2) / (turn_per_s * PERIOD_S / 2)) ** 2
    expected = 10.0 * (chords / math.sqrt(1 + (turn_per_s / 50.0) ** 2) - 1)
    assert coarse != pytest.approx(expected, rel=1e-3)
    assert 2 * fine - coarse == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("delays_us", [(0.0, 1000.0), (300.0, 700.0), (1000.0, 1000.0), (1300.0, 3000.0)])
def test_delays_of_a_host_that_differ_make_an_ellipse(reference_loop: Loop, delays_us: tuple[float, float]) -> None:
    timing = LoopTiming(period_us=1000.0, step_us=1000.0, loop="host")
    axes = [an_axis(delay_us=delay_us) for delay_us in delays_us]
    angle = FEED_MM_S / 10.0 * PERIOD_S
    response_x, response_y = (follows(reference_loop(axis, timing), angle) for axis in axes)
    found = deviation_mm(turn(*axes, timing=timing))
    # Between two points the ellipse turns by an angle: no point stands at its very ends.
    assert found == pytest.approx(10.0 * abs(response_x - response_y), rel=angle**2, abs=1e-6)
    assert (found > 5e-3) == (delays_us[0] != delays_us[1])


# --- geometry ------------------------------------------------------------------------------------------------


def test_a_table_that_is_on_every_setpoint_is_round() -> None:
    run = turn(DEADBEAT, timing=EXACT)
    assert deviation_mm(run) < 1e-9
    assert run.contour.max_contour_error_mm < 1e-9
    assert run.contour.centre_offset_mm == pytest.approx((0, 0), abs=1e-9)


def test_lines_between_setpoints_cost_their_sagitta() -> None:
    radius_mm = 50 / math.pi
    """Where a turn has 1000 lines."""
    run = turn(an_axis(position_gain_per_s=10_000.0), radius_mm=radius_mm)
    assert deviation_mm(run) == pytest.approx(sagitta_mm(radius_mm), rel=1e-5)
    assert run.contour.radial_deviation_min_mm == pytest.approx(-sagitta_mm(radius_mm), rel=1e-5)


@pytest.mark.parametrize(
    ("mechanics", "expected"),
    [
        (Mechanics(squareness_um_per_m=150.0), 150e-6),
        (Mechanics(squareness_um_per_m=-150.0), 150e-6),
        (Mechanics(scale_x_ppm=80.0, scale_y_ppm=-20.0), 100e-6),
        (Mechanics(scale_x_ppm=50.0, scale_y_ppm=50.0), 0.0),
    ],
)
def test_a_crooked_table_shows_by_the_radius(mechanics: Mechanics, expected: float) -> None:
    run = turn(DEADBEAT, timing=EXACT, mechanics=mechanics)
    assert deviation_mm(run) == pytest.approx(10.0 * expected, rel=1e-4, abs=1e-9)


def test_play_in_both_axes_shows_by_nearly_its_width() -> None:
    """b (1 - sqrt(2 b / r) / 2): when an axis turns, its table stands while the motor crosses the gap."""
    backlash_mm = 0.01
    run = turn(DEADBEAT, feed_mm_s=10.0, timing=EXACT, mechanics=Mechanics(backlash_mm=backlash_mm))
    expected = backlash_mm * (1 - math.sqrt(2 * backlash_mm / 10.0) / 2)
    # What the formula leaves out is of the order b / r; and a set-point comes every milliradian.
    assert deviation_mm(run) == pytest.approx(expected, rel=2e-3)


def test_a_skew_makes_an_ellipse_of_feed_times_skew() -> None:
    run = turn(an_axis(position_gain_per_s=10_000.0), delivery=Delivery(skew_us=40.0))
    assert deviation_mm(run) == pytest.approx(FEED_MM_S * 40e-6, abs=sagitta_mm(10.0))


def test_offsets_of_the_drives_move_the_circle_and_leave_it_round() -> None:
    run = turn(an_axis(drive_offset_mm_s=0.5), an_axis(drive_offset_mm_s=-1.0))
    assert run.contour.centre_offset_mm == pytest.approx((0.5 / 50, -1.0 / 50), abs=1e-6)
    assert deviation_mm(run) <= sagitta_mm(10.0)


# --- what must not matter ------------------------------------------------------------------------------------

MISMATCH = an_axis(), an_axis(position_gain_per_s=49.0, integral_gain_per_s2=100.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"ramp_periods": 0},
        {"ramp_periods": 100},
        {"ramp_periods": 700},
        {"direction": "cw"},
        {"extra_us": 123e3},
        {"extra_us": 700e3, "ramp_periods": 33},
    ],
)
def test_how_the_turn_is_reached_does_not_show(changes: dict[str, Any]) -> None:
    expected, found = (
        turn(*MISMATCH, **known, rest_mm=1e-11) for known in ({"ramp_periods": 20}, {"ramp_periods": 20} | changes)
    )
    assert deviation_mm(found) == pytest.approx(deviation_mm(expected), abs=1e-9)
    for name in ("mean_contour_error_mm", "max_contour_error_mm", "radial_deviation_min_mm", "radius_deviation_mm"):
        assert getattr(found.contour, name) == pytest.approx(getattr(expected.contour, name), abs=1e-9)
    assert deviation_mm(expected) > 0.1


# --- settling ------------------------------------------------------------------------------------------------

HOST = LoopTiming(period_us=1000.0, loop="host")


def test_after_the_settling_time_no_more_than_the_rest_is_left() -> None:
    """Against the same place a turn of 1000 periods later, and not ten times too late."""
    for ramp_periods in [0, 100]:
        for changes, timing in [
            ({"position_gain_per_s": 50.0}, NODE),
            ({"position_gain_per_s": 100.0, "integral_gain_per_s2": 2500.0}, NODE),
            ({"position_gain_per_s": 50.0, "drive_lag_us": 5000.0}, NODE),
            ({"position_gain_per_s": 100.0, "drive_lag_us": 20_000.0}, NODE),
            ({"position_gain_per_s": 300.0, "delay_us": 1000.0}, HOST),
            ({"position_gain_per_s": 20.0, "velocity_feedforward": 1.0, "drive_lag_us": 5000.0}, HOST),
        ]:
            axis, rest_mm, feed = an_axis(**changes), 1e-4, FEED_MM_S * 60
            settling_us = settling_time_us(axis, axis, timing=timing, feed_mm_per_min=feed, rest_mm=rest_mm)
            assert settling_us is not None
            assert settling_us < 1e6
            path = circle_path(
                50 / math.pi, feed_mm_per_min=feed, period_us=1000.0, ramp_periods=ramp_periods, settling_us=1.9e6
            )
            run = simulate_circle(path, x=axis, y=axis, timing=timing)
            ends = round(path.constant_from_us / timing.step_us)
            left_mm = np.zeros(10_000)
            for position in (run.x_mm, run.y_mm):
                early, late = position[ends : ends + 10_000], position[ends + 10_000 : ends + 20_000]
                left_mm = np.maximum(left_mm, np.abs(early - late))
            steps = math.ceil(settling_us / timing.step_us)
            assert left_mm[steps:].max() <= rest_mm
            assert left_mm[round(steps * (0.2 if ramp_periods else 0.5)) :].max() > rest_mm


def test_the_friction_of_the_start_has_gone_before_the_turn_begins() -> None:
    """It recovers in a second, and the loop alone would settle in a quarter of one."""
    axis = an_axis(reversal_mm_s=1.6, reversal_recovery_us=1e6)
    found, settled = (turn(axis, extra_us=extra_us, rest_mm=1e-4) for extra_us in (0.0, 20e6))
    assert deviation_mm(found) == pytest.approx(deviation_mm(settled), abs=1e-4)
    assert found.contour.centre_offset_mm == pytest.approx(settled.contour.centre_offset_mm, abs=1e-4)


def test_even_a_loop_that_has_nothing_to_settle_takes_the_set_points_period() -> None:
    axis = an_axis(position_gain_per_s=200.0)
    assert settling_time_us(axis, axis, timing=NODE, feed_mm_per_min=6000.0, rest_mm=100 / 200.0) == NODE.period_us


def test_an_unstable_or_endless_loop_never_settles() -> None:
    steady, endless, wild = (an_axis(position_gain_per_s=kp) for kp in (50.0, 0.1, 30_000.0))
    for other in (endless, wild, an_axis(position_gain_per_s=0.0)):
        for axes in ((steady, other), (other, steady)):
            assert settling_time_us(*axes, timing=NODE, feed_mm_per_min=6000.0) is None
    assert settling_time_us(steady, steady, timing=NODE, feed_mm_per_min=6000.0) is not None
