"""What the kernel runs through, against the most literal reading of the same rules."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from busplan.servo.axis import axis_targets
from busplan.servo.delivery import Arrivals
from busplan.servo.kernel import CONTROL, STORE, SWITCH
from busplan.servo.parameters import Axis, Interpolation, LoopTiming
from busplan.servo.rows import kernel_rows

Floats = NDArray[np.float64]

STEPS = 8
PERIOD_US = 100.0 * STEPS
AXIS = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0, drive_lag_us=3000.0)
SETPOINTS = np.array([1.0, 1.0, 3.0, 2.0, 2.5, -1.0, 0.0, 0.0])
CYCLES = len(SETPOINTS) - 1

offsets = st.lists(st.integers(-390 * 8, 390 * 8), min_size=CYCLES - 1, max_size=CYCLES - 1).map(
    lambda eighths: np.array([0.0, *eighths, 0.0]) / 8
)


def literal_target(time_us: float, *, offsets_us: Floats, interpolation: Interpolation) -> float:
    """What a node aims at: find the last packet that has arrived, and go on from there."""
    arrived = [k for k in range(CYCLES) if k * PERIOD_US + offsets_us[k] <= time_us]
    k = arrived[-1]
    end, start = SETPOINTS[max(k, 0)], SETPOINTS[max(k - 1, 0)]
    if interpolation == "hold":
        return float(start)
    share = min((time_us - k * PERIOD_US - offsets_us[k]) / PERIOD_US, 1.0)
    return float(start + share * (end - start))


@pytest.mark.parametrize("interpolation", ["linear", "hold"])
@given(offsets_us=offsets)
def test_the_target_of_a_node_is_the_line_from_the_last_packet_that_arrived(
    interpolation: Interpolation, offsets_us: Floats
) -> None:
    timing = LoopTiming(period_us=PERIOD_US, step_us=100.0, interpolation=interpolation)
    arrivals = Arrivals(offsets_us=offsets_us, lost=np.zeros(CYCLES + 1, dtype=bool))
    aimed: list[float] = []
    for rows in kernel_rows(SETPOINTS, axis=AXIS, timing=timing, arrivals=arrivals, chunk_steps=2 * STEPS):
        for n, start, slope in zip(rows.substeps, rows.target_mm, rows.increment_mm, strict=True):
            aimed += [start + i * slope for i in range(n)]
    expected = [
        literal_target(100.0 * i, offsets_us=offsets_us, interpolation=interpolation) for i in range(CYCLES * STEPS)
    ]
    np.testing.assert_allclose(aimed, expected, rtol=0, atol=1e-12)


@given(offsets_us=offsets, delay_us=st.floats(0, 2 * PERIOD_US))
def test_the_rows_of_a_host_loop_cover_time_without_gap_and_store_on_the_grid(
    offsets_us: Floats, delay_us: float
) -> None:
    axis, timing = replace(AXIS, delay_us=delay_us), LoopTiming(period_us=PERIOD_US, step_us=100.0, loop="host")
    arrivals = Arrivals(offsets_us=offsets_us, lost=np.zeros(CYCLES + 1, dtype=bool))
    time_us, sampled, switched, stored = 0.0, [], [], []
    for rows in kernel_rows(SETPOINTS, axis=axis, timing=timing, arrivals=arrivals, chunk_steps=3 * STEPS):
        for n, action, length_s in zip(rows.substeps, rows.action, rows.length_s, strict=True):
            sampled += [time_us] if action & CONTROL and n else []
            switched += [time_us] if action & SWITCH and n else []
            for _ in range(n):
                time_us += length_s * 1e6
                stored += [time_us] if action & STORE else []
    at = np.arange(CYCLES) * PERIOD_US + offsets_us[:-1]
    following = np.append(at[1:], CYCLES * PERIOD_US)
    np.testing.assert_allclose(sampled, at, atol=1e-8)
    # A command takes effect with the next packet at the latest; one that is older waited for its turn.
    rest_us = delay_us - PERIOD_US * (delay_us > PERIOD_US)
    np.testing.assert_allclose(switched, np.minimum(at + rest_us, following), atol=1e-8)
    np.testing.assert_allclose(stored, 100.0 * np.arange(1, CYCLES * STEPS + 1), atol=1e-8)


@pytest.mark.parametrize("loop", ["node", "host"])
@pytest.mark.parametrize("every", [1, 3, 7])
def test_targets_are_told_at_the_ends_of_the_steps(loop: str, every: int) -> None:
    timing = LoopTiming(period_us=PERIOD_US, step_us=100.0, loop=loop)  # type: ignore[arg-type]
    targets = axis_targets(SETPOINTS, axis=AXIS, timing=timing)
    assert targets.shape == (CYCLES * STEPS,)
    expected = (
        np.repeat(SETPOINTS[:-1], STEPS)
        if loop == "host"
        else np.concatenate(
            [np.linspace(a, b, STEPS + 1)[1:] for a, b in zip([1.0, *SETPOINTS], SETPOINTS[:-1], strict=False)]
        )
    )
    np.testing.assert_allclose(targets, expected, atol=1e-12)
    some = axis_targets(SETPOINTS, axis=AXIS, timing=timing, every=every)
    np.testing.assert_array_equal(some, targets[every - 1 :: every])


def test_a_lost_command_of_a_host_loop_never_takes_effect() -> None:
    axis, timing = replace(AXIS, delay_us=50.0), LoopTiming(period_us=PERIOD_US, step_us=100.0, loop="host")
    lost = np.zeros(CYCLES + 1, dtype=bool)
    lost[2] = True
    arrivals = Arrivals(offsets_us=np.zeros(CYCLES + 1), lost=lost)
    (rows,) = kernel_rows(SETPOINTS, axis=axis, timing=timing, arrivals=arrivals, chunk_steps=1000)
    assert rows.substeps[rows.action == SWITCH].tolist() == [1, 1, 0, 1, 1, 1, 1]


def test_a_late_node_waits_at_the_end_of_its_line_with_its_feed_forward() -> None:
    axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0, velocity_feedforward=0.5)
    timing = LoopTiming(period_us=PERIOD_US, step_us=100.0)
    offsets_us = np.zeros(CYCLES + 1)
    offsets_us[3] = 250.0
    arrivals = Arrivals(offsets_us=offsets_us, lost=np.zeros(CYCLES + 1, dtype=bool))
    (rows,) = kernel_rows(SETPOINTS, axis=axis, timing=timing, arrivals=arrivals, chunk_steps=1000)
    targets = zip(rows.substeps, rows.target_mm, rows.forward_mm_s, strict=True)
    waits = [(n, mm, forward) for n, mm, forward in targets if n == 3]
    assert waits == [(3, 3.0, pytest.approx(0.5 * 2.0 / (PERIOD_US / 1e6)))]
    assert (rows.substeps >= 0).all()
    assert rows.substeps.sum() == CYCLES * STEPS
