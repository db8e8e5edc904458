"""One axis: every element of the kernel against what it must do."""

import math
import warnings
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from busplan.errors import BusplanError
from busplan.servo import axis as axis_module
from busplan.servo.axis import simulate_axis
from busplan.servo.delivery import Arrivals, arrivals
from busplan.servo.parameters import Axis, Delivery, LoopTiming
from busplan.servo.rows import KernelRows, kernel_rows
from busplan.servo.runnable import MAX_STEPS

Floats = NDArray[np.float64]

TIMING = LoopTiming(period_us=1000.0, step_us=100.0)
STEP_S = 1e-4


def an_axis(**changes: Any) -> Axis:
    """An ideal drive under a P loop alone."""
    values: dict[str, Any] = {"position_gain_per_s": 100.0, "velocity_feedforward": 0.0, "max_velocity_mm_s": 400.0}
    return Axis(**(values | changes))


def ramp(speed_mm_s: float, *, cycles: int, period_s: float = 1e-3) -> Floats:
    return speed_mm_s * period_s * np.arange(cycles + 1, dtype=np.float64)


# --- closed forms ------------------------------------------------------------------------------------------


def test_with_feed_forward_an_ideal_drive_stands_on_its_target() -> None:
    setpoints = 10 * np.sin(np.linspace(0, 3, 300))
    positions = simulate_axis(setpoints, axis=an_axis(velocity_feedforward=1.0), timing=TIMING)
    line = np.interp(np.arange(1, len(positions) + 1) / 10 - 1, np.arange(300), setpoints)
    np.testing.assert_allclose(positions, line, rtol=0, atol=1e-12)


def test_acceleration_feed_forward_makes_up_for_the_drive_lag() -> None:
    """A drive with lag tau follows a velocity ramp exactly when it is told v + tau a."""
    time_s = np.arange(400, dtype=np.float64) * 1e-3
    setpoints = 0.5 * 300.0 * time_s**2
    lag_us = 5000.0
    plain, helped = (
        simulate_axis(
            setpoints,
            axis=an_axis(velocity_feedforward=1.0, acceleration_feedforward_s=share, drive_lag_us=lag_us),
            timing=TIMING,
        )
        for share in (0.0, lag_us / 1e6)
    )
    line = np.interp(np.arange(1, len(plain) + 1) / 10 - 1, np.arange(400), setpoints)
    # tau a / kp behind without, the curve between set-points and the loop's own step with it.
    assert (line - plain)[-1] == pytest.approx(300 * 5e-3 / 100, rel=1e-2)
    assert abs((line - helped)[-1]) < 0.02 * abs((line - plain)[-1])


def test_a_p_loop_lags_by_speed_over_gain_and_creeps_by_offset_over_gain() -> None:
    speed = 50.0
    moving = simulate_axis(ramp(speed, cycles=400), axis=an_axis(drive_lag_us=2000.0), timing=TIMING)
    target = speed * (np.arange(1, len(moving) + 1) * STEP_S - 1e-3)
    assert (target - moving)[-1] == pytest.approx(speed / 100, rel=1e-9)
    standing = simulate_axis(np.zeros(400), axis=an_axis(drive_offset_mm_s=0.56), timing=TIMING)
    assert standing[-1] == pytest.approx(0.56 / 100, rel=1e-9)


def test_an_integral_takes_the_offset_away() -> None:
    axis = an_axis(drive_offset_mm_s=0.56, integral_gain_per_s2=1000.0, drive_lag_us=2000.0)
    assert abs(simulate_axis(np.zeros(2000), axis=axis, timing=TIMING)[-1]) < 1e-9


def test_a_drive_told_a_velocity_approaches_it_exponentially() -> None:
    """No gain, feed-forward only: the step response of the lag, exact at every step size."""
    lag_s, speed = 5e-3, 20.0
    for step_us in (50.0, 100.0, 500.0):
        timing = LoopTiming(period_us=1000.0, step_us=step_us)
        axis = an_axis(position_gain_per_s=0.0, velocity_feedforward=1.0, drive_lag_us=lag_s * 1e6)
        positions = simulate_axis(ramp(speed, cycles=50), axis=axis, timing=timing)
        time_s = np.arange(1, len(positions) + 1) * step_us / 1e6 - 1e-3
        exact = np.where(time_s > 0, speed * (time_s - lag_s * -np.expm1(-np.maximum(time_s, 0) / lag_s)), 0.0)
        np.testing.assert_allclose(positions, exact, rtol=0, atol=1e-12)


def test_halving_the_step_halves_the_distance_to_the_continuous_loop() -> None:
    """The loop on the node is a zero-order hold of half a step: first order."""
    gain, lag_s, cycles = 80.0, 4e-3, 60
    poles = np.roots([lag_s, 1.0, gain])
    end_s = (cycles - 1) * 1e-3
    # Error of the continuous loop on a ramp of 1 mm/s that starts at rest: tau e" + e' + kp e = 1, e(0) = 0, e'(0) = 1.
    weights = np.linalg.solve(np.array([[1, 1], poles]), np.array([-1 / gain, 1.0]))
    exact = end_s - (1 / gain + (weights * np.exp(poles * end_s)).sum().real)
    errors = []
    for step_us in (50.0, 25.0, 12.5, 6.25):
        axis = an_axis(position_gain_per_s=gain, drive_lag_us=lag_s * 1e6)
        timing = LoopTiming(period_us=1000.0, step_us=step_us)
        errors.append(simulate_axis(ramp(1.0, cycles=cycles), axis=axis, timing=timing)[-1] - exact)
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    np.testing.assert_allclose(ratios, 2.0, rtol=0.05)


def test_a_start_from_rest_costs_the_friction_times_its_recovery_and_a_reversal_twice_that() -> None:
    axis = an_axis(
        position_gain_per_s=0.0,
        velocity_feedforward=1.0,
        reversal_mm_s=1.6,
        reversal_recovery_us=10_000.0,
        reversal_smoothing_mm_s=0.5,
    )
    there_and_back = 50e-3 * np.concatenate([np.arange(200), np.arange(199, -1, -1)])
    positions = simulate_axis(there_and_back, axis=axis, timing=LoopTiming(period_us=1000.0, step_us=10.0))
    at_turn = positions[200 * 100] - 199 * 50e-3
    at_end = positions[-1] - 50e-3
    assert at_turn == pytest.approx(-1.6 * 10e-3, rel=2e-3)
    assert at_end - at_turn == pytest.approx(2 * 1.6 * 10e-3, rel=2e-3)


# --- resolution and saturation -----------------------------------------------------------------------------


def test_the_loop_does_not_see_below_half_an_encoder_count() -> None:
    axis = an_axis(encoder_resolution_mm=0.01)
    start = 5.0
    for shift, moves in ((0.0, False), (0.01, True)):
        setpoints = np.full(100, start + shift)
        setpoints[0] = start
        assert (np.abs(np.diff(simulate_axis(setpoints, axis=axis, timing=TIMING))) > 0).any() == moves
    positions = simulate_axis(np.append(start, np.full(200, start + 1.0)), axis=axis, timing=TIMING)
    assert positions[-1] == pytest.approx(start + 1.0, abs=0.5001 * 0.01)
    assert positions[-1] != start + 1.0


def test_an_axis_that_starts_between_two_counts_gets_no_kick_from_its_derivative() -> None:
    axis = an_axis(position_gain_per_s=0.0, derivative_gain=1.0, encoder_resolution_mm=0.01)
    np.testing.assert_array_equal(simulate_axis(np.full(5, 5.004), axis=axis, timing=TIMING), 5.004)


def test_the_dac_has_exactly_its_levels_between_its_limits() -> None:
    axis = an_axis(position_gain_per_s=50.0, max_velocity_mm_s=8.0, dac_bits=4)
    far = simulate_axis(np.append(0.0, np.full(3000, 3.0)), axis=axis, timing=TIMING)
    back = simulate_axis(np.append(0.0, np.full(3000, -3.0)), axis=axis, timing=TIMING)
    speeds = np.concatenate([np.diff(far), np.diff(back)]) / STEP_S
    levels = np.unique(speeds.round(6))
    np.testing.assert_array_equal(levels, np.arange(-8.0, 8.0))


def test_a_velocity_beyond_the_limit_is_clipped() -> None:
    positions = simulate_axis(np.append(0.0, np.full(1000, 500.0)), axis=an_axis(max_velocity_mm_s=10.0), timing=TIMING)
    assert np.diff(positions).max() == pytest.approx(10.0 * STEP_S)


def test_the_integral_does_not_wind_up() -> None:
    """Half a second at the limit with an integral of 8 mm s would overshoot by far more than the step."""
    axis = an_axis(position_gain_per_s=50.0, integral_gain_per_s2=600.0, max_velocity_mm_s=100.0)
    positions = simulate_axis(np.append(0.0, np.full(2000, 50.0)), axis=axis, timing=TIMING)
    assert positions.max() < 50 * 1.02
    assert positions[-1] == pytest.approx(50.0, abs=1e-6)
    back = simulate_axis(np.append(0.0, np.full(2000, -50.0)), axis=axis, timing=TIMING)
    np.testing.assert_allclose(back, -positions, rtol=0, atol=1e-12)


# --- chunks -----------------------------------------------------------------------------------------------

FULL = {
    "velocity_feedforward": 0.97,
    "acceleration_feedforward_s": 0.004,
    "integral_gain_per_s2": 300.0,
    "derivative_gain": 0.01,
    "drive_lag_us": 6000.0,
    "drive_offset_mm_s": -0.4,
    "dac_bits": 14,
    "encoder_resolution_mm": 0.0005,
    "reversal_mm_s": 1.1,
    "reversal_recovery_us": 8000.0,
    "reversal_smoothing_mm_s": 0.3,
}


@pytest.mark.parametrize("loop", ["node", "host"])
def test_chunks_do_not_show(monkeypatch: pytest.MonkeyPatch, loop: str) -> None:
    timing = LoopTiming(period_us=1000.0, loop=loop)  # type: ignore[arg-type]
    arriving = arrivals(Delivery(jitter_us=90.0), name="x", cycles=300, period_us=1000.0)
    setpoints = 20 * np.sin(np.linspace(0, 3, 301))
    kwargs = {"axis": an_axis(**FULL, delay_us=770.0), "timing": timing, "arrivals": arriving, "engine": "python"}
    whole = simulate_axis(setpoints, **kwargs)  # type: ignore[arg-type]
    monkeypatch.setattr(axis_module, "_CHUNK_STEPS", {False: 70, True: 70})
    told: list[tuple[int, int]] = []
    chunked = simulate_axis(setpoints, **kwargs, progress=lambda *counts: told.append(counts))  # type: ignore[arg-type]
    np.testing.assert_array_equal(chunked, whole)
    assert len(told) == math.ceil(300 / 7)
    assert told == sorted(told)
    assert told[-1] == (len(whole), len(whole)) == (3000, 3000)


# --- bad input ---------------------------------------------------------------------------------------------


@given(
    gains=st.tuples(st.floats(0, 1e9), st.floats(0, 1e9), st.floats(0, 1e9)),
    lag_us=st.floats(0, 1e9),
    offset=st.floats(-1e6, 1e6),
    resolution_mm=st.sampled_from([0.0, 1e-6, 0.001, 10.0]),
    bits=st.sampled_from([0, 2, 16, 32]),
    friction=st.floats(0, 1e6),
    recovery_us=st.floats(0, 1e9),
    loop=st.sampled_from(["node", "host"]),
)
def test_no_axis_however_unstable_leaves_the_numbers(
    gains: tuple[float, float, float],
    lag_us: float,
    offset: float,
    resolution_mm: float,
    bits: int,
    friction: float,
    recovery_us: float,
    loop: str,
) -> None:
    kp, ki, kd = gains
    axis = an_axis(
        position_gain_per_s=kp,
        integral_gain_per_s2=ki,
        derivative_gain=kd,
        drive_lag_us=lag_us,
        drive_offset_mm_s=offset,
        encoder_resolution_mm=resolution_mm,
        dac_bits=bits,
        reversal_mm_s=friction,
        reversal_recovery_us=recovery_us,
        reversal_smoothing_mm_s=1e-6,
        delay_us=500.0,
    )
    timing = LoopTiming(period_us=1000.0, loop=loop)  # type: ignore[arg-type]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isfinite(simulate_axis(np.sin(np.arange(60.0)), axis=axis, timing=timing)).all()


def test_bad_values_are_named() -> None:
    cases: list[tuple[dict[str, float], str]] = [
        ({"position_gain_per_s": math.nan}, "position_gain_per_s"),
        ({"position_gain_per_s": -1.0}, "position_gain_per_s"),
        ({"integral_gain_per_s2": math.inf}, "integral_gain_per_s2"),
        ({"derivative_gain": -0.1}, "derivative_gain"),
        ({"velocity_feedforward": math.nan}, "velocity_feedforward"),
        ({"acceleration_feedforward_s": math.inf}, "acceleration_feedforward_s"),
        ({"drive_lag_us": -1.0}, "drive_lag_us"),
        ({"drive_offset_mm_s": math.nan}, "drive_offset_mm_s"),
        ({"max_velocity_mm_s": 0.0}, "max_velocity_mm_s"),
        ({"dac_bits": 1}, "dac_bits"),
        ({"dac_bits": 33}, "dac_bits"),
        ({"encoder_resolution_mm": 1e-12}, "encoder_resolution_mm"),
        ({"reversal_smoothing_mm_s": 0.0}, "reversal_smoothing_mm_s"),
        ({"delay_us": -1.0}, "delay_us"),
        ({"delay_us": math.nan}, "delay_us"),
    ]
    for bad, name in cases:
        with pytest.raises(BusplanError, match=f"^{name} = "):
            an_axis(**bad)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"step_us": 2000.0}, "step_us = 2000.0: longer than the period of 1000 us"),
        (
            {"step_us": 300.0},
            "step_us = 300.0: the period of 1000 us is no multiple of it; 250 us would fit",
        ),
        ({"step_us": 0.0}, "step_us = 0.0: must be between 0.001 and 1e+09"),
        ({"period_us": math.nan}, "period_us = nan: must be above 0"),
        ({"loop": "cloud"}, "loop = 'cloud': must be one of 'node', 'host'"),
        ({"interpolation": "cubic"}, "interpolation = 'cubic': must be one of 'linear', 'hold'"),
    ],
)
def test_a_timing_that_cannot_be_simulated_says_what_would_do(bad: dict[str, Any], message: str) -> None:
    values: dict[str, Any] = {"period_us": 1000.0}
    with pytest.raises(BusplanError) as caught:
        LoopTiming(**(values | bad))
    assert str(caught.value).startswith(message)


def test_a_third_of_a_millisecond_divides_it() -> None:
    assert LoopTiming(period_us=1000.0, step_us=1000 / 3).steps_per_period == 3
    assert LoopTiming(period_us=1000.0, step_us=0.1).steps_per_period == 10_000


def test_too_many_steps_are_refused() -> None:
    with pytest.raises(BusplanError, match=str(MAX_STEPS)):
        simulate_axis(np.zeros(100_000), axis=an_axis(), timing=LoopTiming(period_us=1000.0, step_us=1.0))


def test_an_encoder_too_fine_for_the_travel_is_refused() -> None:
    setpoints = np.linspace(0, -1e7, 10)
    with pytest.raises(BusplanError, match=r"too fine for 1e\+07 mm of travel; choose at least 4\.44e-09 mm"):
        simulate_axis(setpoints, axis=an_axis(encoder_resolution_mm=1e-9), timing=TIMING)
    # A drive may run away all the time: 1e6 mm/s for 10,000 periods of 1 ms.
    fast = an_axis(encoder_resolution_mm=1e-9, max_velocity_mm_s=1e6)
    with pytest.raises(BusplanError, match=r"too fine for 1e\+07 mm of travel; choose at least 4\.44e-09 mm"):
        simulate_axis(np.zeros(10_000), axis=fast, timing=TIMING)


@pytest.mark.parametrize(
    ("setpoints", "offsets_us"),
    [
        (np.zeros(1), np.zeros(1)),
        (np.array([0.0, math.nan]), np.zeros(2)),
        (np.zeros(5), np.zeros(4)),
        (np.zeros(3), np.array([1.0, 0.0, 0.0])),
        (np.zeros(3), np.array([0.0, 0.0, 1.0])),
        (np.zeros(3), np.array([0.0, 500.5, 0.0])),
        (np.zeros(3), np.array([0.0, -500.5, 0.0])),
    ],
)
def test_arrivals_that_do_not_fit_never_reach_the_kernel(setpoints: Floats, offsets_us: Floats) -> None:
    arriving = Arrivals(offsets_us=offsets_us, lost=np.zeros(len(offsets_us), dtype=bool))
    with pytest.raises(ValueError, match=r"must|for"):
        simulate_axis(setpoints, axis=an_axis(), timing=TIMING, arrivals=arriving)


def test_a_setpoint_may_be_half_a_period_early_or_late() -> None:
    for half_us in (-500.0, 500.0):
        arriving = Arrivals(offsets_us=np.array([0.0, half_us, 0.0]), lost=np.zeros(3, dtype=bool))
        assert not simulate_axis(np.zeros(3), axis=an_axis(), timing=TIMING, arrivals=arriving).any()


def test_on_time_is_the_default() -> None:
    setpoints = ramp(10.0, cycles=30)
    expected = simulate_axis(setpoints, axis=an_axis(), timing=TIMING, arrivals=Arrivals.punctual(30))
    np.testing.assert_array_equal(simulate_axis(setpoints, axis=an_axis(), timing=TIMING), expected)


@pytest.mark.parametrize("name", ["python", "auto"])
def test_rows_that_store_beyond_the_end_are_refused_before_compiled_code_writes_there(
    monkeypatch: pytest.MonkeyPatch, name: Literal["python", "auto"]
) -> None:
    def too_many(*arguments: Any, **options: Any) -> Iterator[KernelRows]:
        for rows in kernel_rows(*arguments, **options):
            yield rows._replace(substeps=rows.substeps + 1)

    monkeypatch.setattr("busplan.servo.axis.kernel_rows", too_many)
    with pytest.raises(ValueError, match="store more positions than the move has steps"):
        simulate_axis(ramp(10.0, cycles=20), axis=an_axis(), timing=TIMING, engine=name)
