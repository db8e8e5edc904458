"""Simulate an axis with a fixed step, from set-points to the position of its motor, and from there to the table."""

from functools import cache
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from numpy.typing import NDArray

from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.servo.delivery import Arrivals
from busplan.servo.kernel import ROUND, Constants, drag, run_rows
from busplan.servo.parameters import Axis, LoopTiming, Mechanics, refuse
from busplan.servo.rows import KernelRows, kernel_rows, stored_steps, stored_targets_mm
from busplan.servo.runnable import unfit_steps

if TYPE_CHECKING:
    from collections.abc import MutableSequence

Floats = NDArray[np.float64]

Engine = Literal["auto", "python", "compiled"]
_US_PER_S = 1e6
_PER_MILLION = 1e-6

_CHUNK_STEPS = {False: 30_000, True: 250_000}
"""Steps between two progress reports: about 40 ms in plain Python, about 6 ms compiled."""


def compiled_kernel(engine: Engine) -> ModuleType | None:
    """Compiled form of `busplan.servo.kernel`, with the same functions for arrays; None to use that file itself.

    Examples
    --------
    >>> compiled_kernel("python") is None
    True
    """
    kernel = None if engine == "python" else _compiled()
    if engine == "compiled" and kernel is None:
        raise BusplanError(
            "engine 'compiled': busplan was installed without a C compiler; install one and busplan again, "
            "or use 'python'"
        )
    return kernel


@cache
def _compiled() -> ModuleType | None:
    try:
        return import_module("busplan.servo._kernel")
    except ImportError:  # also if it was built for another Python
        return None


def simulate_axis(
    setpoints_mm: Floats,
    *,
    axis: Axis,
    timing: LoopTiming,
    arrivals: Arrivals | None = None,
    progress: Progress | None = None,
    engine: Engine = "auto",
) -> Floats:
    """Simulate an axis over all cycles of a move.

    Parameters
    ----------
    setpoints_mm
        One set-point for each cycle, after the start at rest, shape (cycles + 1,) [mm].
    axis
        Controller, drive and encoder.
    timing
        Timing of the loop.
    arrivals
        When and whether the packets arrive (`busplan.servo.delivery.arrivals`); by default all on time. A loop on the
        host loses a velocity command instead of a set-point and keeps the last command, whatever `on_loss`: holding a
        velocity extrapolates the position.
    progress
        Called from time to time with the steps done and the total.
    engine
        "auto" (compiled if possible), "compiled" or "python"; the result is the same.

    Returns
    -------
    ndarray
        Position at the end of every step, shape (cycles * steps per period,) [mm]; always finite: the velocity
        command is clipped, so even an unstable loop stays within `max_velocity_mm_s` times the duration.

    Raises
    ------
    BusplanError
        Too many steps, an encoder too fine for the travel, or "compiled" without a compiled kernel.

    Notes
    -----
    With the error e = target - encoder(position), sampled each control period h (the step on a node, the period on
    a host), the command is ``u = kp e + ki h sum(e) + kd (e - e before) / h + feed-forward``, clipped to the range
    of the DAC (with anti-windup) and rounded to its levels. The feed-forward uses the velocity and acceleration of the
    set-points.

    A node with linear interpolation moves its target on the line between the last two set-points and reaches the newest
    one after a period; with hold, it uses each set-point a period late. A loop on the host samples at each synchronous
    packet; its command takes effect `delay_us` later, whole periods of which it waits for its turn, and then with the
    next such packet at the latest.

    The drive follows command plus offset as a first-order lag. Coulomb friction, ``-reversal tanh(v / smoothing)``
    with the drive velocity v, disturbs the velocity; the disturbance decays with the time constant of its recovery.

    References
    ----------
    G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems.
    B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, "A survey of models, analysis tools and compensation methods
    for the control of machines with friction", Automatica 30 (7), 1994.

    Examples
    --------
    An ideal drive with velocity feed-forward follows the set-points a period late:

    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0, velocity_feedforward=1.0)
    >>> timing = LoopTiming(period_us=1000.0, step_us=500.0)
    >>> simulate_axis(np.array([0.0, 0.1, 0.2]), axis=axis, timing=timing).round(6).tolist()
    [0.0, 0.0, 0.05, 0.1]
    """
    cycles = len(setpoints_mm) - 1
    arrivals = Arrivals.punctual(cycles) if arrivals is None else arrivals
    position_mm = np.empty(checked_steps(setpoints_mm, axis=axis, timing=timing))
    compiled = compiled_kernel(engine)
    chunk_steps = _CHUNK_STEPS[compiled is not None]
    state, constants, done = _at_rest(setpoints_mm[0], axis, timing), _constants(axis, timing), 0
    for rows in kernel_rows(setpoints_mm, axis=axis, timing=timing, arrivals=arrivals, chunk_steps=chunk_steps):
        out = position_mm[done:]
        # Compiled code checks no bounds.
        if stored_steps(rows) > len(out):
            raise ValueError("rows that store more positions than the move has steps")
        # Plain Python is twice as fast with Python floats as with numpy floats.
        done += compiled.run_rows(state, constants, out, *rows) if compiled else _run_plain(state, constants, rows, out)
        if progress is not None:
            progress(done, len(position_mm))
    return position_mm


def axis_targets(
    setpoints_mm: Floats, *, axis: Axis, timing: LoopTiming, arrivals: Arrivals | None = None, every: int = 1
) -> Floats:
    """Targets that `simulate_axis` follows, at the end of every n-th step [mm].

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)
    >>> timing = LoopTiming(period_us=1000.0, step_us=500.0)
    >>> axis_targets(np.array([0.0, 0.1, 0.2]), axis=axis, timing=timing, every=2).round(6).tolist()
    [0.0, 0.1]
    """
    arrivals = Arrivals.punctual(len(setpoints_mm) - 1) if arrivals is None else arrivals
    kept, passed = [np.empty(0)], 0
    for rows in kernel_rows(setpoints_mm, axis=axis, timing=timing, arrivals=arrivals, chunk_steps=_CHUNK_STEPS[False]):
        targets = stored_targets_mm(rows)
        kept.append(targets[(-1 - passed) % every :: every])
        passed += len(targets)
    return np.concatenate(kept)


def _run_plain(state: Floats, constants: Constants, rows: KernelRows, out: Floats) -> int:
    floats = state.tolist()
    stored = run_rows(
        floats, constants, cast("MutableSequence[float]", out.data), *(column.tolist() for column in rows)
    )
    state[:] = floats
    return stored


def _at_rest(position_mm: float, axis: Axis, timing: LoopTiming) -> Floats:
    """State of the kernel for an axis at rest on its target; commands that wait there are zero."""
    resolution = axis.encoder_resolution_mm
    error = position_mm - (position_mm * (1 / resolution) + ROUND - ROUND) * resolution if resolution else 0.0
    waiting = timing.delay_parts(axis.delay_us)[0] if timing.loop == "host" else 0
    return np.array([position_mm, 0.0, 0.0, 0.0, 0.0, 0.0, error, *[0.0] * waiting])


def _constants(axis: Axis, timing: LoopTiming) -> Constants:
    """Constants of the kernel, as `Constants` lists them."""
    period_s = timing.control_period_us / _US_PER_S
    limit = axis.max_velocity_mm_s
    level = axis.level_mm_s
    return (
        axis.position_gain_per_s,
        axis.integral_gain_per_s2,
        axis.derivative_gain / period_s,
        period_s,
        1 / axis.encoder_resolution_mm if axis.encoder_resolution_mm else 0.0,
        axis.encoder_resolution_mm,
        -limit,
        axis.highest_command_mm_s,
        1 / level if level else 0.0,
        level,
        axis.drive_offset_mm_s,
        axis.reversal_mm_s,
        1 / axis.reversal_smoothing_mm_s if axis.reversal_mm_s else 0.0,
    )


def checked_steps(setpoints_mm: Floats, *, axis: Axis, timing: LoopTiming) -> int:
    """Count the steps of a move; refuse too many for memory and arithmetic.

    Examples
    --------
    >>> axis = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0)
    >>> checked_steps(np.zeros(3), axis=axis, timing=LoopTiming(period_us=1000.0, step_us=500.0))
    4
    """
    cycles = len(setpoints_mm) - 1
    refuse(*unfit_steps(cycles, reach_mm=float(np.abs(setpoints_mm).max()), axis=axis, timing=timing))
    return cycles * timing.steps_per_period


def move_to_table(x_mm: Floats, *, y_mm: Floats, mechanics: Mechanics, engine: Engine = "auto") -> None:
    """Convert positions of the motors to positions of the table, in place.

    References
    ----------
    ISO 230-4, on what circular tests show: reversal, scale mismatch and squareness errors.

    Examples
    --------
    >>> x, y = np.array([1000.0, 0.0]), np.array([0.0, 1000.0])
    >>> move_to_table(x, y_mm=y, mechanics=Mechanics(scale_x_ppm=5.0, squareness_um_per_m=3.0))
    >>> x.tolist(), y.tolist()
    ([1000.005, 0.003], [0.0, 1000.0])
    """
    if mechanics.backlash_mm:
        add_backlash(x_mm, backlash_mm=mechanics.backlash_mm, engine=engine)
        add_backlash(y_mm, backlash_mm=mechanics.backlash_mm, engine=engine)
    x_mm *= 1 + mechanics.scale_x_ppm * _PER_MILLION
    y_mm *= 1 + mechanics.scale_y_ppm * _PER_MILLION
    if mechanics.squareness_um_per_m:
        x_mm += y_mm * (mechanics.squareness_um_per_m * _PER_MILLION)


def add_backlash(position_mm: Floats, *, backlash_mm: float, engine: Engine = "auto") -> None:
    """Convert positions of a motor to those of a table behind a backlash, in place.

    Notes
    -----
    The motor starts in the middle of the gap, and the table does not move until the motor reaches one side of it. This
    is the play operator, ``table = min(max(table, motor - b / 2), motor + b / 2)``.

    References
    ----------
    M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis, Springer 1989.

    Examples
    --------
    >>> position = np.array([0.0, 3.0, 2.0, 0.0])
    >>> add_backlash(position, backlash_mm=2.0)
    >>> position.tolist()
    [0.0, 2.0, 2.0, 1.0]
    """
    compiled = compiled_kernel(engine)
    if compiled is not None:
        compiled.drag(position_mm, backlash_mm / 2)
    else:
        drag(cast("MutableSequence[float]", position_mm.data), backlash_mm / 2)
