"""Input of the kernel: the cycles of a move as rows of equal sub-steps.

With the loop on the node, a cycle is one row: the line between two set-points. With the loop on the host, a cycle has
further rows for events off the grid of the steps: samples, and commands that take effect.
"""

from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from busplan.servo.delivery import Arrivals, received_mm
from busplan.servo.kernel import CONTROL, STORE, SWITCH
from busplan.servo.parameters import Axis, LoopTiming

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_Number = TypeVar("_Number", np.float64, np.int64)

_US_PER_S = 1e6


class KernelRows(NamedTuple):
    """Columns of the kernel's rows, all of the same length."""

    substeps: Ints
    """Number of sub-steps in the row [1]."""
    target_mm: Floats
    increment_mm: Floats
    """Target at the first control of the row, and its increment at each further control [mm]."""
    forward_mm_s: Floats
    """Feed-forward velocity [mm/s]."""
    action: Ints
    """Sum of `CONTROL`, `SWITCH` and `STORE`, applied to each sub-step of the row."""
    length_s: Floats
    """Length of a sub-step [s]; 0 for an event without duration."""
    drive_keep: Floats
    drive_shift_s: Floats
    """Decay factor of the drive's lag over a sub-step [1], and its integral [s]."""
    friction_keep: Floats
    friction_shift_s: Floats
    """The same for the friction disturbance [1], [s]."""


def kernel_rows(
    setpoints_mm: Floats, *, axis: Axis, timing: LoopTiming, arrivals: Arrivals, chunk_steps: int
) -> Iterator[KernelRows]:
    """Split a move into rows, in chunks, so that memory does not grow with the move.

    Notes
    -----
    The drive is a first-order lag with a command that is constant over the sub-step, so its response is exact
    (zero-order hold): with the drive time constant tau, a lag v - u shrinks by exp(-dt / tau) and moves the axis
    by its integral tau (1 - exp(-dt / tau)).

    References
    ----------
    G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems: zero-order-hold equivalents.

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)
    >>> timing = LoopTiming(period_us=1000.0, step_us=100.0)
    >>> sent_mm, on_time = np.array([0.0, 1.0, 2.0]), Arrivals.punctual(2)
    >>> rows, = kernel_rows(sent_mm, axis=axis, timing=timing, arrivals=on_time, chunk_steps=1000)
    >>> rows.substeps.tolist(), rows.target_mm.tolist(), rows.increment_mm.tolist()
    ([10, 10], [0.0, 0.0], [0.0, 0.1])
    """
    _check(setpoints_mm, arrivals=arrivals, half_us=timing.period_us / 2)
    make = _host_rows
    if timing.loop == "node":
        make = _node_rows
        setpoints_mm = received_mm(setpoints_mm, lost=arrivals.lost, on_loss=arrivals.on_loss)
    cycles = len(setpoints_mm) - 1
    chunk = max(1, chunk_steps // timing.steps_per_period)
    for first in range(0, cycles, chunk):
        some = np.arange(first, min(first + chunk, cycles))
        yield make(setpoints_mm, axis=axis, timing=timing, arrivals=arrivals, cycles=some)


def stored_steps(rows: KernelRows) -> int:
    """Count the positions that the kernel stores for some rows.

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)
    >>> timing = LoopTiming(period_us=1000.0, step_us=500.0)
    >>> rows, = kernel_rows(np.zeros(3), axis=axis, timing=timing, arrivals=Arrivals.punctual(2), chunk_steps=1000)
    >>> stored_steps(rows)
    4
    """
    return int(rows.substeps[(rows.action & STORE) != 0].sum())


def stored_targets_mm(rows: KernelRows) -> Floats:
    """Targets at the end of every stored sub-step.

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)
    >>> timing = LoopTiming(period_us=1000.0, step_us=500.0)
    >>> sent_mm, on_time = np.array([0.0, 0.1, 0.2]), Arrivals.punctual(2)
    >>> rows, = kernel_rows(sent_mm, axis=axis, timing=timing, arrivals=on_time, chunk_steps=1000)
    >>> stored_targets_mm(rows).round(6).tolist()
    [0.0, 0.0, 0.05, 0.1]
    """
    stored = np.where(rows.action & STORE, rows.substeps, 0)
    within = np.arange(stored.sum()) - np.repeat(np.cumsum(stored) - stored, stored) + 1
    return np.asarray(np.repeat(rows.target_mm, stored) + np.repeat(rows.increment_mm, stored) * within)


def _check(setpoints_mm: Floats, *, arrivals: Arrivals, half_us: float) -> None:
    """Refuse input for which rows would store more or fewer positions than there are steps."""
    offsets_us, lost = arrivals.offsets_us, arrivals.lost
    if setpoints_mm.ndim != 1 or len(setpoints_mm) < 2 or not np.isfinite(setpoints_mm).all():  # noqa: PLR2004
        raise ValueError("set-points must be at least two finite numbers")
    if not setpoints_mm.shape == offsets_us.shape == lost.shape:
        raise ValueError(f"{offsets_us.shape} offsets and {lost.shape} losses for {setpoints_mm.shape} set-points")
    if offsets_us[0] != 0 or offsets_us[-1] != 0 or not np.abs(offsets_us).max() <= half_us:
        raise ValueError(f"offsets must begin and end with 0 and stay within {half_us:g} us")


def _node_rows(setpoints_mm: Floats, *, axis: Axis, timing: LoopTiming, arrivals: Arrivals, cycles: Ints) -> KernelRows:
    steps = timing.steps_per_period
    # With hold, the previous set-point is the target of the cycle; with linear, the line starts there.
    ahead = 0 if timing.interpolation == "linear" else -1
    start_mm, end_mm, forward_mm_s = _motion(setpoints_mm, axis=axis, timing=timing, cycles=cycles + ahead)
    offset = arrivals.offsets_us[cycles[0] : cycles[-1] + 2] / timing.step_us
    taken = np.ceil(offset).astype(np.int64)
    available = steps + np.diff(taken)
    if timing.interpolation == "hold":
        return _fill(axis, timing, substeps=available, target_mm=end_mm, forward_mm_s=forward_mm_s)
    slope_mm = (end_mm - start_mm) / steps
    on_line = np.minimum(available, steps)
    # If the next SP is late, the target waits at the end of the line. The feed-forward continues: a step just before a
    # packet must not stop the drive.
    waiting = available - on_line
    late_mm = slope_mm * (taken - offset)[:-1]
    if not waiting.any():
        return _fill(
            axis,
            timing,
            substeps=on_line,
            target_mm=start_mm + late_mm,
            increment_mm=slope_mm,
            forward_mm_s=forward_mm_s,
        )
    return _fill(
        axis,
        timing,
        substeps=_interleave(on_line, waiting),
        target_mm=_interleave(start_mm + late_mm, end_mm),
        increment_mm=_interleave(slope_mm, np.zeros_like(slope_mm)),
        forward_mm_s=np.repeat(forward_mm_s, 2),
    )


def _host_rows(setpoints_mm: Floats, *, axis: Axis, timing: LoopTiming, arrivals: Arrivals, cycles: Ints) -> KernelRows:
    here_mm, _, forward_mm_s = _motion(setpoints_mm, axis=axis, timing=timing, cycles=cycles + 1)
    edges = np.append(cycles, cycles[-1] + 1)
    times = edges * timing.steps_per_period + arrivals.offsets_us[edges] / timing.step_us
    sampled, following = times[:-1], times[1:]
    # A command takes effect with the next SP at the latest, also where it waited for its turn.
    _, rest_us = timing.delay_parts(axis.delay_us)
    switched = np.minimum(sampled + rest_us / timing.step_us, following)
    once, nothing = np.ones_like(cycles), np.zeros_like(sampled)
    pieces = [
        (once, nothing, CONTROL * once),
        *_pieces(sampled, switched),
        (np.where(arrivals.lost[cycles], 0, 1), nothing, SWITCH * once),
        *_pieces(switched, following),
    ]
    substeps, length, action = (_interleave(*column) for column in zip(*pieces, strict=True))
    return _fill(
        axis,
        timing,
        substeps=substeps,
        target_mm=np.repeat(here_mm, len(pieces)),
        forward_mm_s=np.repeat(forward_mm_s, len(pieces)),
        action=action,
        length_s=length * (timing.step_us / _US_PER_S),
    )


def _pieces(start: Floats, stop: Floats) -> list[tuple[Ints, Floats, Ints]]:
    """Count, length in steps and action of the parts between two times: up to the grid, on it, and after it."""
    grid, leave = np.ceil(start), np.floor(stop)
    inside = grid > leave
    head = np.where(inside, stop, grid) - start
    tail = np.where(inside, 0.0, stop - leave)
    body = np.maximum(leave - grid, 0.0)
    return [
        ((head > 0).astype(np.int64), head, np.where(inside, 0, STORE)),
        (body.astype(np.int64), np.ones_like(body), np.full(body.shape, STORE)),
        ((tail > 0).astype(np.int64), tail, np.zeros(tail.shape, dtype=np.int64)),
    ]


def _motion(setpoints_mm: Floats, *, axis: Axis, timing: LoopTiming, cycles: Ints) -> tuple[Floats, Floats, Floats]:
    """Start and end of the line of each of some consecutive cycles [mm], and its feed-forward velocity [mm/s]."""
    around = setpoints_mm[np.clip(np.arange(cycles[0] - 2, cycles[-1] + 1), 0, len(setpoints_mm) - 1)]
    before, start, end = around[:-2], around[1:-1], around[2:]
    period_s = timing.period_us / _US_PER_S
    forward = axis.velocity_feedforward * ((end - start) / period_s)
    if axis.acceleration_feedforward_s:
        forward += axis.acceleration_feedforward_s * ((end - start - (start - before)) / period_s**2)
    return start, end, forward


def _fill(
    axis: Axis,
    timing: LoopTiming,
    *,
    substeps: Ints,
    target_mm: Floats,
    forward_mm_s: Floats,
    increment_mm: Floats | None = None,
    action: Ints | None = None,
    length_s: Floats | None = None,
) -> KernelRows:
    """Make rows with defaults: whole steps that control, switch and store, with a constant target."""
    # Whole steps need a single exponential.
    lengths_s = np.array([timing.step_us / _US_PER_S]) if length_s is None else length_s
    shape = substeps.shape
    timed = (
        lengths_s,
        *_decay(lengths_s, time_constant_s=axis.drive_lag_us / _US_PER_S),
        *_decay(lengths_s, time_constant_s=axis.reversal_recovery_us / _US_PER_S),
    )
    return KernelRows(
        substeps,
        target_mm,
        np.broadcast_to(0.0, shape) if increment_mm is None else increment_mm,
        forward_mm_s,
        np.broadcast_to(CONTROL | SWITCH | STORE, shape) if action is None else action,
        *(np.broadcast_to(column, shape) for column in timed),
    )


def _decay(length_s: Floats, *, time_constant_s: float) -> tuple[Floats, Floats]:
    """Exponential decay over each length [1], and its integral [s]."""
    if time_constant_s == 0.0:
        return np.zeros_like(length_s), np.zeros_like(length_s)
    # A lag far below the step may overflow the exponent, which is harmless.
    with np.errstate(over="ignore", under="ignore"):
        lost = -np.expm1(-length_s / time_constant_s)
    return 1.0 - lost, time_constant_s * lost


def _interleave(*columns: NDArray[_Number]) -> NDArray[_Number]:
    return np.column_stack(columns).ravel()
