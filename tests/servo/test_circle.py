"""The circle test as a whole: what theory says of circles, and what must never happen."""

import math
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from busplan.errors import BusplanError
from busplan.servo import axis as axis_module
from busplan.servo import contour as contour_module
from busplan.servo.axis import simulate_axis
from busplan.servo.circle import CircleRun, check_circle, simulate_circle
from busplan.servo.contour import contour_error
from busplan.servo.delivery import Arrivals
from busplan.servo.margins import LoopMargins
from busplan.servo.parameters import Axis, Delivery, LoopTiming, Mechanics
from busplan.servo.path import CirclePath, circle_path

Floats = NDArray[np.float64]

RADIUS_MM = 50.0
FEED_MM_PER_MIN = 6000.0
FEED_MM_S = FEED_MM_PER_MIN / 60
TURN_PER_S = FEED_MM_S / RADIUS_MM
"""Angular speed w [rad/s]."""


def an_axis(**changes: Any) -> Axis:
    """An ideal drive under a P loop alone."""
    values: dict[str, Any] = {"position_gain_per_s": 50.0, "velocity_feedforward": 0.0, "max_velocity_mm_s": 400.0}
    return Axis(**(values | changes))


def a_path(period_us: float = 1000.0, **changes: Any) -> CirclePath:
    values: dict[str, Any] = {"feed_mm_per_min": FEED_MM_PER_MIN, "ramp_periods": 100}
    return circle_path(RADIUS_MM, period_us=period_us, **(values | changes))


def a_run(axis: Axis, y: Axis | None = None, *, timing: LoopTiming | None = None, **changes: Any) -> CircleRun:
    timing = timing or LoopTiming(period_us=1000.0)
    return simulate_circle(a_path(timing.period_us), x=axis, y=axis if y is None else y, timing=timing, **changes)


def deadbeat(step_us: float, **changes: Any) -> Axis:
    """An axis that stands on its target one step later: kp times the step is 1."""
    return an_axis(position_gain_per_s=1e6 / step_us, **changes)


def settled(run: CircleRun) -> Floats:
    """Contour error well after the ramp."""
    part = slice(run.steps // 3, run.measured.stop)
    return contour_error(run.x_mm[part], y_mm=run.y_mm[part], radius_mm=RADIUS_MM)


# --- closed forms ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lag_us", [0.0, 3000.0])
def test_a_sampled_p_loop_cuts_the_circle_by_its_own_frequency_response(lag_us: float) -> None:
    step_s, kp, lag_s = 1e-3, 50.0, lag_us / 1e6
    run = a_run(an_axis(drive_lag_us=lag_us), timing=LoopTiming(period_us=1000.0, step_us=1000.0))
    z = np.exp(1j * TURN_PER_S * step_s)
    plant = step_s / (z - 1) - (
        lag_s * (1 - math.exp(-step_s / lag_s)) / (z - math.exp(-step_s / lag_s)) if lag_s else 0
    )
    expected = RADIUS_MM * (abs(kp * plant / (1 + kp * plant)) - 1)
    assert settled(run) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("delay_us", [0.0, 400.0, 1000.0])
def test_a_delay_inside_the_loop_makes_the_circle_larger_and_the_margin_smaller(delay_us: float) -> None:
    """The command is held for a period: half of one more, on average."""
    kp, jw = 50.0, 1j * TURN_PER_S
    timing = LoopTiming(period_us=1000.0, step_us=1000.0, loop="host")
    run = a_run(an_axis(delay_us=delay_us), timing=timing)
    inside_s = delay_us / 1e6 + 0.5e-3
    expected = RADIUS_MM * (kp / abs(jw + kp * np.exp(-jw * inside_s)) - 1)
    assert settled(run) == pytest.approx(expected, rel=1e-3)
    assert run.margins_x.phase_margin_deg == pytest.approx(90 - math.degrees(kp * inside_s), abs=0.01)


def test_held_setpoints_shrink_the_circle_by_a_sinc_and_lines_by_its_square() -> None:
    """A loop too slow for the stairs follows their fundamental."""
    period_us = 10_000.0
    radius = {}
    for interpolation in ("hold", "linear"):
        timing = LoopTiming(period_us=period_us, step_us=100.0, interpolation=interpolation)
        path = a_path(period_us, ramp_periods=20, settling_us=1e6)
        axis = an_axis(position_gain_per_s=10.0)
        run = simulate_circle(path, x=axis, y=axis, timing=timing)
        radius[interpolation] = np.hypot(run.x_mm[run.measured], run.y_mm[run.measured]).mean()
    step_s, kp = 1e-4, 10.0
    loop = abs(kp * step_s / (np.exp(1j * TURN_PER_S * step_s) - 1 + kp * step_s))
    sinc = np.sinc(TURN_PER_S * period_us / 1e6 / 2 / math.pi)
    assert RADIUS_MM * loop - radius["hold"] == pytest.approx(RADIUS_MM * loop * (1 - sinc), rel=0.02)
    assert RADIUS_MM * loop - radius["linear"] == pytest.approx(RADIUS_MM * loop * (1 - sinc**2), rel=0.02)


# --- symmetry ----------------------------------------------------------------------------------------------


def test_clockwise_is_the_mirror_image() -> None:
    axis = an_axis(drive_lag_us=3000.0, reversal_mm_s=1.0, reversal_recovery_us=1e4, reversal_smoothing_mm_s=0.5)
    timing = LoopTiming(period_us=1000.0)
    ccw, cw = (simulate_circle(a_path(direction=d), x=axis, y=axis, timing=timing) for d in ("ccw", "cw"))
    np.testing.assert_array_equal(ccw.x_mm, cw.x_mm)
    np.testing.assert_array_equal(ccw.y_mm, -cw.y_mm)


def test_an_equal_delay_outside_the_loops_leaves_the_circle_as_it_is() -> None:
    axis, timing, path = an_axis(drive_lag_us=3000.0), LoopTiming(period_us=1000.0), a_path()
    late = Arrivals(offsets_us=np.full(path.setpoints + 1, 300.0), lost=np.zeros(path.setpoints + 1, dtype=bool))
    late.offsets_us[[0, -1]] = 0.0
    on_time, delayed = (
        [simulate_axis(way, axis=axis, timing=timing, arrivals=arriving) for way in (path.x_mm, path.y_mm)]
        for arriving in (None, late)
    )
    errors = [contour_error(x, y_mm=y, radius_mm=RADIUS_MM) for x, y in (on_time, delayed)]
    np.testing.assert_allclose(errors[1][3:-10], errors[0][:-13], rtol=0, atol=1e-9)
    assert np.abs(on_time[0] - delayed[0]).max() > 0.01


def test_host_and_node_agree_on_a_circle_when_nothing_separates_them() -> None:
    timing = {"period_us": 500.0, "step_us": 500.0}
    node, host = (a_run(an_axis(), timing=LoopTiming(**timing, loop=loop)) for loop in ("node", "host"))  # type: ignore[arg-type]
    errors = [np.hypot(run.x_mm, run.y_mm) - RADIUS_MM for run in (node, host)]
    np.testing.assert_allclose(errors[0][1:], errors[1][:-1], rtol=0, atol=1e-9)


# --- a whole turn ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_exactly_the_turn_is_measured(direction: str) -> None:
    path = a_path(settling_us=10e3, direction=direction)
    run = simulate_circle(path, x=deadbeat(100.0), y=deadbeat(100.0), timing=LoopTiming(period_us=1000.0))
    assert path.turn_from_us is not None
    assert run.measured.start * 100 == path.turn_from_us
    # pi seconds: the last of the steps ends after the turn does.
    assert run.measured.stop - run.measured.start == math.ceil(math.pi * 1e4)
    assert run.constant_speed_deg == 360.0
    assert run.covered_deg == pytest.approx(360.0, abs=0.02)
    assert run.follows
    assert run.contour.max_contour_error_mm < 1e-4


@pytest.mark.parametrize(
    ("edge", "beyond", "counts"), [("start", 0, 1), ("start", -1, 0), ("stop", -1, 1), ("stop", 0, 0)]
)
def test_what_goes_wrong_before_and_after_the_turn_does_not_count(edge: str, beyond: int, counts: int) -> None:
    path, axis, timing = a_path(settling_us=10e3), deadbeat(1000.0), LoopTiming(period_us=1000.0, step_us=1000.0)
    measured = simulate_circle(path, x=axis, y=axis, timing=timing).measured
    # At the end of a step the table is on the set-point before it.
    wrong = getattr(measured, edge) + beyond - 1
    path.x_mm[wrong] *= 1 + 1e-3
    path.y_mm[wrong] *= 1 + 1e-3
    run = simulate_circle(path, x=axis, y=axis, timing=timing)
    assert run.measured == measured
    assert run.contour.max_contour_error_mm == pytest.approx(counts * RADIUS_MM * 1e-3, abs=1e-9)


@pytest.mark.parametrize("radius_mm", [5.0, 5.004, 5.008, 5.012])
def test_the_measures_of_a_turn_do_not_depend_on_where_its_last_step_ends(radius_mm: float) -> None:
    """With a scale error s, the contour error is r s / 2 cos 2 angle; what is left is of second order in a step."""
    path = circle_path(radius_mm, feed_mm_per_min=FEED_MM_PER_MIN, period_us=1000.0, settling_us=10e3)
    perfect, timing = deadbeat(1000.0), LoopTiming(period_us=1000.0, step_us=1000.0)
    mechanics = Mechanics(scale_x_ppm=500.0, scale_y_ppm=-500.0)
    run = simulate_circle(path, x=perfect, y=perfect, timing=timing, mechanics=mechanics)
    second_order = (FEED_MM_S * 1e-3 / radius_mm) ** 2
    assert run.contour.mean_contour_error_mm == pytest.approx(radius_mm * 1e-3 / math.pi, rel=second_order)
    assert run.contour.centre_offset_mm == pytest.approx((0, 0), abs=radius_mm * 1e-3 * second_order)


def test_without_a_turn_there_is_no_circular_deviation() -> None:
    run = a_run(an_axis())
    assert run.contour.circular_deviation_mm is None
    assert run.covered_deg == pytest.approx(360.0, abs=0.5)
    assert 300 < run.constant_speed_deg < 360


# --- what a bus does ---------------------------------------------------------------------------------------


def test_common_jitter_harms_little_and_skew_of_the_same_size_much() -> None:
    axis, path, timing = an_axis(position_gain_per_s=200.0), a_path(settling_us=0.0), LoopTiming(period_us=1000.0)
    calm, shaken, skewed = (
        np.ptp(contour_error(run.x_mm[run.measured], y_mm=run.y_mm[run.measured], radius_mm=RADIUS_MM))
        for run in (
            simulate_circle(path, x=axis, y=axis, timing=timing, delivery=delivery)
            for delivery in (Delivery(), Delivery(jitter_us=50.0), Delivery(skew_us=50.0))
        )
    )
    assert calm < shaken < 0.3 * skewed


def test_losses_harm_and_extrapolation_heals_most_of_them() -> None:
    axis = an_axis(position_gain_per_s=150.0, velocity_feedforward=1.0)
    none, held, extrapolated = (
        a_run(axis, delivery=delivery).contour.mean_contour_error_mm
        for delivery in (
            Delivery(),
            Delivery(loss_probability=0.02, on_loss="hold"),
            Delivery(loss_probability=0.02, on_loss="extrapolate"),
        )
    )
    assert held > 5 * none
    assert extrapolated < 0.2 * held


@pytest.mark.parametrize("loop", ["node", "host"])
def test_the_seed_decides_the_run(loop: str) -> None:
    timing = LoopTiming(period_us=1000.0, loop=loop)  # type: ignore[arg-type]
    runs = [
        a_run(
            an_axis(delay_us=300.0), timing=timing, delivery=Delivery(jitter_us=20.0, loss_probability=0.01, seed=seed)
        )
        for seed in (1, 1, 2)
    ]
    assert runs[0].contour == runs[1].contour
    assert runs[0].contour != runs[2].contour


# --- result ------------------------------------------------------------------------------------------------


def test_the_trace_tells_times_targets_and_positions() -> None:
    run = a_run(deadbeat(100.0, velocity_feedforward=1.0), delivery=Delivery(skew_us=30.0))
    trace = run.trace(every=7)
    np.testing.assert_allclose(trace.time_us, 700.0 * np.arange(1, run.steps // 7 + 1))
    np.testing.assert_array_equal(trace.x_mm, run.x_mm[6::7])
    np.testing.assert_array_equal(trace.y_mm, run.y_mm[6::7])
    np.testing.assert_allclose(trace.contour_error_mm, np.hypot(trace.x_mm, trace.y_mm) - RADIUS_MM, atol=1e-13)
    for command, position in ((trace.command_x_mm, trace.x_mm), (trace.command_y_mm, trace.y_mm)):
        assert command.shape == position.shape
        np.testing.assert_allclose(command, position, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(run.trace().x_mm, run.x_mm)
    with pytest.raises(BusplanError, match="every = 0"):
        run.trace(every=0)


def test_progress_goes_up_to_the_end() -> None:
    told: list[tuple[int, int]] = []
    run = a_run(an_axis(), progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (2 * run.steps, 2 * run.steps)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_the_part_at_constant_speed_waits_for_the_loop_and_ends_with_the_feed() -> None:
    path, timing = a_path(), LoopTiming(period_us=1000.0)
    run = a_run(an_axis())
    settling_us = run.margins_x.settling_us
    assert settling_us is not None
    assert settling_us == pytest.approx(math.log(1000) / 50 * 1e6, rel=5e-3)
    assert run.measured.start * 100 == pytest.approx(path.constant_from_us + 1000 + settling_us, abs=100)
    assert run.measured.stop * 100 == pytest.approx(path.constant_until_us, abs=100)
    slow = simulate_circle(path, x=an_axis(position_gain_per_s=0.5), y=an_axis(), timing=timing)
    whole_us = path.constant_until_us - path.constant_from_us - 1000
    assert slow.measured.start * 100 == pytest.approx(path.constant_from_us + 1000 + whole_us / 5, abs=100)


def test_a_circle_of_ramps_only_still_has_measures() -> None:
    path = circle_path(1.0, feed_mm_per_min=2 * math.pi * 10 * 60, period_us=1000.0, ramp_periods=100)
    run = simulate_circle(path, x=an_axis(), y=an_axis(), timing=LoopTiming(period_us=1000.0))
    assert run.measured.stop - run.measured.start == 1
    assert run.contour.radius_deviation_mm < 0


def test_memory_grows_by_no_more_than_16_bytes_a_step_and_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(axis_module, "_CHUNK_STEPS", {False: 1000, True: 1000})
    monkeypatch.setattr(contour_module, "_BLOCK", 1000)
    timing = LoopTiming(period_us=1000.0)
    everything = {
        "delivery": Delivery(jitter_us=5.0, skew_us=5.0, loss_probability=0.01),
        "mechanics": Mechanics(backlash_mm=0.01, scale_x_ppm=5.0, scale_y_ppm=-5.0, squareness_um_per_m=10.0),
    }

    def peak(radius_mm: float) -> tuple[int, int]:
        path = circle_path(radius_mm, feed_mm_per_min=FEED_MM_PER_MIN, period_us=1000.0)
        tracemalloc.start()
        run = simulate_circle(path, x=an_axis(), y=an_axis(), timing=timing, **everything)  # type: ignore[arg-type]
        _, highest = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return highest, run.steps

    peak(10.0)
    (short, few), (long, many) = peak(20.0), peak(60.0)
    assert (long - short) / (2 * (many - few)) <= 16


# --- bad input ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("loop", "gain"), [("node", 21_000.0), ("host", 700.0)])
def test_an_unstable_loop_ends_as_one(loop: str, gain: float) -> None:
    timing = LoopTiming(period_us=2000.0, loop=loop)  # type: ignore[arg-type]
    run = a_run(an_axis(position_gain_per_s=gain, delay_us=2000.0), timing=timing)
    assert run.diverged
    assert run.margins_x.phase_margin_deg is None
    assert math.isfinite(run.contour.mean_contour_error_mm)
    assert run.contour.max_contour_error_mm > 0.01
    assert not a_run(an_axis(delay_us=2000.0), timing=timing).diverged


def test_one_unstable_loop_is_enough_to_diverge() -> None:
    # Slow to grow: within a turn the error stays far below the radius.
    run = a_run(an_axis())
    assert not run.diverged
    assert replace(run, margins_x=LoopMargins(stable=False)).diverged
    assert replace(run, margins_y=LoopMargins(stable=False)).diverged


def test_a_table_that_runs_away_has_diverged() -> None:
    runaway = an_axis(position_gain_per_s=1.0, drive_offset_mm_s=250.0)
    assert a_run(runaway).diverged


def test_a_feed_beyond_the_drive_is_refused_axis_by_axis_and_beside_a_late_delivery() -> None:
    slow = an_axis(max_velocity_mm_s=90.0)
    with pytest.raises(BusplanError) as caught:
        a_run(an_axis(max_velocity_mm_s=101.0, drive_offset_mm_s=-2.0), slow, delivery=Delivery(jitter_us=501.0))
    assert len(caught.value.problems) == 3
    assert "axis x reaches 5940 mm/min" in caught.value.problems[0]
    assert "axis y reaches 5400 mm/min" in caught.value.problems[1]


def test_a_path_of_another_period_is_refused() -> None:
    with pytest.raises(BusplanError, match=r"period_us = 2000\.0: .* every 1000\.0 us"):
        simulate_circle(a_path(), x=an_axis(), y=an_axis(), timing=LoopTiming(period_us=2000.0))


@given(
    kp=st.floats(0, 5000),
    ki=st.floats(0, 1e5),
    kd=st.floats(0, 5),
    lag_us=st.floats(0, 5e4),
    loop=st.sampled_from(["node", "host"]),
    interpolation=st.sampled_from(["linear", "hold"]),
    on_loss=st.sampled_from(["hold", "extrapolate"]),
    loss=st.floats(0, 1),
    jitter_us=st.floats(0, 400),
    skew_us=st.floats(-100, 100),
    backlash_mm=st.floats(0, 1),
    settling_us=st.sampled_from([None, 0.0]),
)
def test_whatever_is_set_the_measures_are_finite(**drawn: Any) -> None:
    settling_us = drawn["settling_us"]
    path = circle_path(5.0, feed_mm_per_min=6000.0, period_us=1000.0, ramp_periods=20, settling_us=settling_us)
    axis = an_axis(
        position_gain_per_s=drawn["kp"],
        integral_gain_per_s2=drawn["ki"],
        derivative_gain=drawn["kd"],
        drive_lag_us=drawn["lag_us"],
        delay_us=321.0,
    )
    timing = LoopTiming(period_us=1000.0, step_us=250.0, loop=drawn["loop"], interpolation=drawn["interpolation"])
    delivery = Delivery(
        jitter_us=drawn["jitter_us"],
        skew_us=drawn["skew_us"],
        loss_probability=drawn["loss"],
        on_loss=drawn["on_loss"],
    )
    mechanics = Mechanics(backlash_mm=drawn["backlash_mm"])
    contour = simulate_circle(path, x=axis, y=axis, timing=timing, delivery=delivery, mechanics=mechanics).contour
    numbers = [
        contour.mean_contour_error_mm,
        contour.max_contour_error_mm,
        contour.radial_deviation_min_mm,
        contour.radial_deviation_max_mm,
        0.0 if contour.circular_deviation_mm is None else contour.circular_deviation_mm,
        contour.radius_deviation_mm,
        *contour.centre_offset_mm,
    ]
    assert np.isfinite(numbers).all()
    assert (contour.circular_deviation_mm is None) == (settling_us is None)
    assert contour.radial_deviation_min_mm <= contour.radial_deviation_max_mm
    assert 0 <= contour.mean_contour_error_mm <= contour.max_contour_error_mm


def test_the_highest_level_of_the_dac_limits_the_feed() -> None:
    # Two bits command -100, -50, 0 and 50 mm/s.
    path, timing = circle_path(50.0, feed_mm_per_min=3000.0, period_us=1000.0), LoopTiming(period_us=1000.0)
    ideal = Axis(position_gain_per_s=50.0, max_velocity_mm_s=100.0)
    check_circle(path, x=ideal, y=ideal, timing=timing)
    with pytest.raises(
        BusplanError, match=r"axis y reaches 3000 mm/min with max_velocity_mm_s = 100\.0 and dac_bits = 2"
    ):
        check_circle(path, x=ideal, y=replace(ideal, dac_bits=2), timing=timing)


def test_an_offset_beyond_the_reach_is_blamed_itself() -> None:
    path = circle_path(50.0, feed_mm_per_min=3000.0, period_us=1000.0)
    axis = Axis(position_gain_per_s=50.0, max_velocity_mm_s=100.0, drive_offset_mm_s=-150.0)
    with pytest.raises(BusplanError, match=r"drive_offset_mm_s = -150\.0: axis x commands at most 100 mm/s"):
        check_circle(path, x=axis, y=axis, timing=LoopTiming(period_us=1000.0))
