"""The linear loop: simulated, by its states, in closed form, and by python-control."""

import math
from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from busplan.servo.axis import simulate_axis
from busplan.servo.delivery import Arrivals, arrivals
from busplan.servo.margins import loop_margins
from busplan.servo.parameters import Axis, Delivery, LoopTiming
from tests.extras import needed

Floats = NDArray[np.float64]
Loop = Callable[[Axis, LoopTiming], Any]

CONTROLLERS: list[dict[str, float]] = [
    {"position_gain_per_s": 100.0},
    {"position_gain_per_s": 100.0, "drive_lag_us": 3000.0},
    {"position_gain_per_s": 80.0, "integral_gain_per_s2": 900.0, "drive_lag_us": 2500.0},
    {"position_gain_per_s": 80.0, "derivative_gain": 0.15},
    {"position_gain_per_s": 90.0, "integral_gain_per_s2": 700.0, "derivative_gain": 0.2, "drive_lag_us": 4000.0},
]
NODE = LoopTiming(period_us=500.0, step_us=500.0)
HOST = LoopTiming(period_us=1000.0, step_us=250.0, loop="host")
PLACES = [(NODE, 0.0), (HOST, 0.0), (HOST, 317.0), (HOST, 1000.0), (HOST, 2317.0)]
"""Timing, and delay of the axis."""
LOOPS = [
    (controller, *place)
    for row, controller in enumerate(CONTROLLERS)
    for column, place in enumerate(PLACES)
    if (row + column) % 2 == 0
]
"""Each controller at three places or two, and each place with as many controllers."""


def an_axis(**changes: Any) -> Axis:
    """A loop alone: its response is that of its target."""
    values: dict[str, Any] = {"position_gain_per_s": 100.0, "velocity_feedforward": 0.0, "max_velocity_mm_s": 1e6}
    return Axis(**(values | changes))


@pytest.mark.parametrize(
    ("gain_per_s", "periods"),
    [(500.0, math.log(1000) / math.log(2)), (900.0, 3.0), (1000.0, 1.0), (1500.0, math.log(1000) / math.log(2))],
)
def test_an_error_falls_to_a_thousandth_by_its_share_in_each_period(gain_per_s: float, periods: float) -> None:
    # |1 - kp T| of it is left after a period; where that is nothing, a period is enough.
    timing = LoopTiming(period_us=1000.0, step_us=1000.0)
    assert loop_margins(an_axis(position_gain_per_s=gain_per_s), timing=timing).settling_us == pytest.approx(
        1000 * periods
    )


# --- simulated against its states -----------------------------------------------------------------------------


def test_the_simulated_frequency_response_is_the_loops(reference_loop: Loop) -> None:
    for (controller, timing, delay_us), cycles_per_wave in zip(LOOPS, cycle([50, 200]), strict=False):
        axis, cycles = an_axis(**controller, delay_us=delay_us), 4000
        wave = np.exp(2j * math.pi * np.arange(cycles + 1) / cycles_per_wave)
        real, imaginary = (simulate_axis(part.copy(), axis=axis, timing=timing) for part in (wave.real, wave.imag))
        # At the end of the last period a host aims at the last set-point, a node at the one before.
        aimed = wave[-1] if timing.loop == "host" else wave[-2]
        (gain,) = reference_loop(axis, timing).at(1e6 / timing.period_us / cycles_per_wave)
        assert (real[-1] + 1j * imaginary[-1]) / aimed == pytest.approx(gain / (1 + gain), rel=1e-6)


# --- formulas against python-control -------------------------------------------------------------------------


@pytest.mark.slow  # as the next one, it loads python-control
@pytest.mark.parametrize(("controller", "timing", "delay_us"), LOOPS)
def test_the_margins_are_python_controls(
    reference_loop: Loop, controller: dict[str, float], timing: LoopTiming, delay_us: float
) -> None:
    control = needed("control")
    axis = an_axis(**controller, delay_us=delay_us)
    found = loop_margins(axis, timing=timing)
    # Sampled finely: its polynomials in z lose too many digits for these loops, and it says so.
    frequency_hz = np.geomspace(0.01, 0.5e6 / timing.control_period_us, 1000)
    loop = reference_loop(axis, timing)
    gains = loop.at(frequency_hz)
    same = control.ss(loop.a, loop.b[:, None], loop.c, loop.d, loop.period_s)
    z = np.exp(2j * math.pi * frequency_hz[::100] * loop.period_s)
    np.testing.assert_allclose(gains[::100], same(z), rtol=1e-10)
    sampled = control.frd(gains, 2 * math.pi * frequency_hz)
    gain, phase_deg, _, _, crossover, _ = control.stability_margins(sampled)
    # It looks for changes of sign only; at half the control rate the phase arrives at -180 degrees without one.
    at_nyquist = gains[-1].real
    gain = min(gain, -1 / at_nyquist if at_nyquist < 0 else math.inf)
    assert found.stable
    assert found.phase_margin_deg == pytest.approx(phase_deg, rel=1e-5)
    assert found.gain_margin_db == pytest.approx(20 * math.log10(gain), rel=1e-5)
    assert found.crossover_hz == pytest.approx(crossover / (2 * math.pi), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("kp", [20.0, 143.0, 400.0, 1500.0])
@pytest.mark.parametrize("lag_us", [0.0, 3000.0, 20_000.0])
def test_a_host_that_is_one_period_late_is_python_controls_own_sampling_and_a_delay(kp: float, lag_us: float) -> None:
    control = needed("control")
    period_s = HOST.period_us / 1e6
    drive = control.tf([1], [lag_us / 1e6, 1, 0] if lag_us else [1, 0])
    loop = kp * control.sample_system(drive, period_s, method="zoh") * control.tf([1], [1, 0], period_s)
    slowest = np.abs(control.poles(control.feedback(loop, 1))).max()
    found = loop_margins(an_axis(position_gain_per_s=kp, drive_lag_us=lag_us, delay_us=1000.0), timing=HOST)
    assert found.stable == (slowest < 1)
    if not found.stable:
        return
    frequency_hz = np.geomspace(0.1, 500.0, 1000)
    # Its default way warns of lost digits.
    gain, phase_deg, _, crossover = control.margin(
        control.frd(loop(np.exp(2j * math.pi * frequency_hz * period_s)), 2 * math.pi * frequency_hz)
    )
    assert found.settling_us == pytest.approx(1000 * math.log(1e-3) / math.log(slowest), rel=1e-6)
    assert found.phase_margin_deg == pytest.approx(phase_deg, rel=1e-5)
    assert found.gain_margin_db == pytest.approx(20 * math.log10(gain), rel=1e-5)
    assert found.crossover_hz == pytest.approx(crossover / (2 * math.pi), rel=1e-5)


def test_each_period_of_a_delay_takes_its_phase() -> None:
    first, longer = (loop_margins(an_axis(delay_us=delay_us), timing=HOST) for delay_us in (1000.0, 5000.0))
    assert first.crossover_hz == longer.crossover_hz
    lost_deg = 360 * (first.crossover_hz or 0) * 4000.0e-6
    assert longer.phase_margin_deg == pytest.approx((first.phase_margin_deg or 0) - lost_deg)
    assert loop_margins(an_axis(delay_us=5000.0), timing=NODE) == loop_margins(an_axis(), timing=NODE)


@pytest.mark.parametrize("share", [0.05, 1e-2, 1e-5])
def test_after_its_time_no_more_than_the_share_of_a_double_pole_is_left(share: float) -> None:
    """A P loop with a lag of 1 / (4 kp) has a double pole at 2 kp; and the time is not far too long."""
    axis = an_axis(position_gain_per_s=50.0, drive_lag_us=5000.0)
    found = loop_margins(axis, timing=LoopTiming(period_us=1000.0, step_us=10.0))
    constants = found.time_to_us(share) / 1e6 * 2 * 50.0
    left = (1 + constants) * math.exp(-constants)
    assert 0.5 * share < left <= share * (1 + 1e-3)


def test_an_unstable_loop_takes_for_ever_and_what_has_gone_takes_no_time() -> None:
    assert loop_margins(an_axis(position_gain_per_s=2500.0), timing=HOST).time_to_us(0.5) == math.inf
    assert loop_margins(an_axis(), timing=HOST).time_to_us(2.0) == 0.0


plants = st.fixed_dictionaries(
    {
        "position_gain_per_s": st.floats(0.1, 3000),
        "integral_gain_per_s2": st.one_of(st.just(0.0), st.floats(0.1, 1e5)),
        "derivative_gain": st.one_of(st.just(0.0), st.floats(0.001, 3)),
        "drive_lag_us": st.one_of(st.just(0.0), st.floats(10, 1e5)),
    }
)
DEADBEAT = {"position_gain_per_s": 1000.0, "integral_gain_per_s2": 0.0, "derivative_gain": 0.0, "drive_lag_us": 0.0}
delays = st.one_of(st.sampled_from([0.0, 1000.0, 2000.0]), st.floats(0, 1000), st.floats(1000, 5000))


@given(plant=plants, delay_us=delays)
@example(plant=DEADBEAT, delay_us=0.0)
@example(plant=DEADBEAT | {"position_gain_per_s": 999.0}, delay_us=0.0)
def test_stability_is_where_the_poles_are(reference_loop: Loop, plant: dict[str, float], delay_us: float) -> None:
    axis, timing = an_axis(**plant, delay_us=delay_us), HOST
    loop = reference_loop(axis, timing)
    radius = np.abs(np.linalg.eigvals(loop.a - np.outer(loop.b, loop.c) / (1 + loop.d))).max()
    assume(abs(radius - 1) > 1e-9)
    found = loop_margins(axis, timing=timing)
    assert found.stable == (radius < 1)
    if not found.stable:
        assert (found.phase_margin_deg, found.gain_margin_db, found.crossover_hz, found.settling_us) == (None,) * 4
        return
    assert found.settling_us is not None
    if radius > 0.1:
        assert found.settling_us == pytest.approx(1000 * math.log(1e-3) / math.log(radius), rel=1e-4)
    else:
        # Four poles may lie at z = 0, where rounding moves each by its fourth root.
        assert found.settling_us is not None
        assert 1e-3 ** (1000 / found.settling_us) == pytest.approx(radius, abs=1e-3)


@given(plant=plants, delay_us=delays)
def test_no_crossover_is_missed(reference_loop: Loop, plant: dict[str, float], delay_us: float) -> None:
    """Against a search on a grid, which can only find what lies between two of its points."""
    axis, timing = an_axis(**plant, delay_us=delay_us), HOST
    found = loop_margins(axis, timing=timing)
    assume(found.stable)
    frequency_hz = np.geomspace(1e-5, 500.0, 20_000)
    loop = reference_loop(axis, timing)
    gain = loop.at(frequency_hz)
    size = np.abs(gain)
    passes = np.flatnonzero((size[:-1] > 1) != (size[1:] > 1))
    turns = np.abs(np.degrees(np.angle(-gain)))
    searched = [min(turns[i], turns[i + 1]) for i in passes.tolist()]
    if searched:
        assert found.phase_margin_deg == pytest.approx(min(searched), abs=0.5)
        assert found.crossover_hz is not None
        (at,) = loop.at(found.crossover_hz)
        assert abs(at) == pytest.approx(1, abs=1e-6)
        assert abs(math.degrees(np.angle(-at))) == pytest.approx(found.phase_margin_deg, abs=1e-6)
    opposed = np.flatnonzero((gain.imag[:-1] > 0) != (gain.imag[1:] > 0))
    opposed = opposed[gain.real[opposed] < 0]
    changes = [*np.abs(20 * np.log10(size[opposed]))]
    if gain.real[-1] < 0:
        changes.append(abs(20 * math.log10(size[-1])))
    if changes:
        assert found.gain_margin_db == pytest.approx(min(changes), abs=0.05)


# --- closed forms of the margins -----------------------------------------------------------------------------


@pytest.mark.parametrize(("delay_us", "limit"), [(0.0, 2.0), (500.0, 2.0), (1000.0, 1.0)])
def test_a_p_loop_is_stable_up_to_its_limit(delay_us: float, limit: float) -> None:
    """Ideal drive: z (z - 1) + kp ((T - Td) z + Td) has its roots inside up to kp T = 2 and 1 / (Td / T)."""
    for share, stable in ((0.999, True), (1.001, False)):
        axis = an_axis(position_gain_per_s=share * limit * 1000, delay_us=delay_us)
        found = loop_margins(axis, timing=HOST)
        assert found.stable == stable
        if stable:
            assert found.gain_margin_db == pytest.approx(-20 * math.log10(share), rel=1e-6)


def test_a_fast_sampled_loop_has_the_margins_of_the_continuous_one() -> None:
    kp, lag_s = 143.0, 7.5e-3
    axis = an_axis(position_gain_per_s=kp, drive_lag_us=lag_s * 1e6)
    found = loop_margins(axis, timing=LoopTiming(period_us=1000.0, step_us=0.1))
    crossing = math.sqrt((math.sqrt(1 + (2 * kp * lag_s) ** 2) - 1) / 2) / lag_s
    assert found.crossover_hz == pytest.approx(crossing / (2 * math.pi), rel=1e-4)
    assert found.phase_margin_deg == pytest.approx(90 - math.degrees(math.atan(crossing * lag_s)), rel=1e-4)


def test_an_integral_may_not_be_weakened_below_its_own_margin_either() -> None:
    """Continuous, the loop is stable for (1 + kd) kp > tau ki: here down to 0.625 of its gain."""
    axis = an_axis(position_gain_per_s=40.0, integral_gain_per_s2=3000.0, derivative_gain=0.8, drive_lag_us=20_000.0)
    timing = LoopTiming(period_us=1000.0, step_us=10.0)
    margin_db = loop_margins(axis, timing=timing).gain_margin_db
    assert margin_db is not None
    assert margin_db == pytest.approx(-20 * math.log10(0.625), rel=0.01)

    def is_stable(change_db: float) -> bool:
        gain = 10 ** (change_db / 20)
        changed = an_axis(
            position_gain_per_s=40.0 * gain,
            integral_gain_per_s2=3000.0 * gain,
            derivative_gain=0.8 * gain,
            drive_lag_us=20_000.0,
        )
        return loop_margins(changed, timing=timing).stable

    assert all(is_stable(change_db) for change_db in np.linspace(-margin_db + 0.05, margin_db - 0.05, 9))
    assert not is_stable(-margin_db - 0.05)
    assert is_stable(margin_db + 0.05)


def test_without_a_gain_there_is_no_loop() -> None:
    assert not loop_margins(an_axis(position_gain_per_s=0.0), timing=NODE).stable


def test_resolution_and_feed_forward_are_not_part_of_the_loop() -> None:
    plain = loop_margins(an_axis(), timing=HOST)
    assert loop_margins(an_axis(velocity_feedforward=1.0, encoder_resolution_mm=0.1), timing=HOST) == plain
    assert plain != loop_margins(an_axis(), timing=NODE)


# --- the loop on the host ------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay_us", [0.0, 123.4, 500.0, 999.0, 1000.0])
def test_the_step_of_a_host_loop_decides_only_where_one_looks(delay_us: float) -> None:
    axis = an_axis(drive_lag_us=4000.0, integral_gain_per_s2=200.0, velocity_feedforward=0.9, delay_us=delay_us)
    setpoints = np.sin(np.arange(300) / 20)
    coarse, fine = (
        simulate_axis(setpoints, axis=axis, timing=LoopTiming(period_us=1000.0, step_us=step_us, loop="host"))
        for step_us in (500.0, 62.5)
    )
    np.testing.assert_allclose(fine[7::8], coarse, rtol=0, atol=1e-12)


def test_a_host_without_delay_at_the_rate_of_a_node_is_that_node_one_period_early() -> None:
    setpoints = np.sin(np.arange(300) / 20)
    axis = an_axis(drive_lag_us=4000.0, integral_gain_per_s2=200.0, derivative_gain=0.05)
    node = simulate_axis(setpoints, axis=axis, timing=LoopTiming(period_us=1000.0, step_us=1000.0))
    host = simulate_axis(setpoints, axis=axis, timing=LoopTiming(period_us=1000.0, step_us=1000.0, loop="host"))
    np.testing.assert_allclose(node[1:], host[:-1], rtol=0, atol=1e-12)


def literal_host(setpoints: Floats, *, axis: Axis, timing: LoopTiming, arriving: Arrivals, times_us: Floats) -> Floats:
    """A host loop from one event to the next, in time order, with the exact step response of the drive in between."""
    lag_s = axis.drive_lag_us / 1e6
    cycles = len(setpoints) - 1
    at = np.arange(cycles + 1) * timing.period_us + arriving.offsets_us
    events: list[tuple[float, float, int]] = [(t, 2, 0) for t in times_us]
    # A command takes effect with the next packet at the latest; an older one has waited for its turn.
    waited = max(math.ceil(axis.delay_us / timing.period_us) - 1, 0)
    rest_us = axis.delay_us - waited * timing.period_us
    for k in range(cycles):
        events.append((at[k], 1, k))
        events.append((min(at[k] + rest_us, at[k + 1]), 0 if rest_us else 1.5, k))
    position, velocity, command, integral, now, seen = setpoints[0], 0.0, 0.0, 0.0, 0.0, []
    commands: dict[int, float] = {}
    for time_us, kind, k in sorted(events):
        passed = (time_us - now) / 1e6
        kept = math.exp(-passed / lag_s)
        position += command * passed + (velocity - command) * lag_s * (1 - kept)
        velocity = command + (velocity - command) * kept
        now = time_us
        if kind == 2:
            seen.append(position)
        elif kind == 1:
            error = setpoints[k] - position
            integral += error * timing.period_us / 1e6
            forward = axis.velocity_feedforward * (setpoints[k + 1] - setpoints[k]) / (timing.period_us / 1e6)
            commands[k] = axis.position_gain_per_s * error + axis.integral_gain_per_s2 * integral + forward
        elif not arriving.lost[k]:
            command = commands.get(k - waited, 0.0)
    return np.array(seen)


def test_a_host_loop_is_what_its_events_make_of_it() -> None:
    for delay_us in [0.0, 250.0, 731.0, 1000.0, 1400.0, 3000.0]:
        for delivery in [Delivery(), Delivery(jitter_us=170.0, skew_us=23.0, loss_probability=0.1, seed=4)]:
            axis = an_axis(drive_lag_us=4000.0, integral_gain_per_s2=200.0, velocity_feedforward=0.9, delay_us=delay_us)
            timing = LoopTiming(period_us=1000.0, step_us=200.0, loop="host")
            setpoints = np.sin(np.arange(200) / 20)
            arriving = arrivals(delivery, name="y", cycles=199, period_us=1000.0)
            found = simulate_axis(setpoints, axis=axis, timing=timing, arrivals=arriving)
            times_us = 200.0 * np.arange(1, 199 * 5 + 1, dtype=np.float64)
            expected = literal_host(setpoints, axis=axis, timing=timing, arriving=arriving, times_us=times_us)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
