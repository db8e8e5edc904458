"""Which steps of a move are measured: a whole turn once the loops have settled, or the settled arc of a trapezoid."""

import math
from typing import NamedTuple

from busplan.servo.margins import LoopMargins, loop_margins
from busplan.servo.parameters import Axis, LoopTiming
from busplan.servo.path import CirclePath
from busplan.servo.runnable import LONGEST_SETTLING_US

_SETTLING_SHARE = 0.2
"""Largest share of a trapezoid's constant speed that the measures leave out for settling."""
REST_MM = 1e-4
"""Remaining lag that counts as settled, where no tolerance says how round the circle must be."""
_ROUNDING_STEPS = 1e-9
_S_PER_MIN = 60.0


def settling_time_us(
    x: Axis, y: Axis, *, timing: LoopTiming, feed_mm_per_min: float, rest_mm: float = REST_MM
) -> float | None:
    """Time at constant speed in which both loops settle.

    Parameters
    ----------
    x, y, timing
        As for `busplan.servo.circle.simulate_circle`.
    feed_mm_per_min
        Speed along the path [mm/min].
    rest_mm
        What may be left of the lag behind the path, above 0 [mm].

    Returns
    -------
    float or None
        The time [us]; None if a loop is unstable, or takes more than `LONGEST_SETTLING_US`.

    Notes
    -----
    A loop that starts to move is off by its following error, at most v / kp. With the spectral radius rho of the linear
    loop, about rho^n of it is left after n control periods; `LoopMargins.time_to_us` allows for a double pole.
    Friction puts an axis off by at most ``reversal / kp``, which fades with its recovery: that of the start must go,
    too.

    Examples
    --------
    >>> axis, timing = Axis(position_gain_per_s=100.0, max_velocity_mm_s=400.0), LoopTiming(period_us=1000.0)
    >>> round(settling_time_us(axis, axis, timing=timing, feed_mm_per_min=6000.0) / 1e3)
    118
    """
    times_us = []
    for axis in (x, y):
        lag_mm = feed_mm_per_min / _S_PER_MIN / axis.position_gain_per_s if axis.position_gain_per_s else math.inf
        margins = loop_margins(axis, timing=timing)
        times_us.append(margins.time_to_us(rest_mm / lag_mm) if margins.stable and lag_mm < math.inf else math.inf)
        if times_us[-1] < math.inf:
            friction_mm = axis.reversal_mm_s / axis.position_gain_per_s
            times_us.append(axis.reversal_recovery_us * math.log(max(friction_mm / rest_mm, 1.0)))
    settling_us = max(times_us) + timing.period_us
    return settling_us if settling_us <= LONGEST_SETTLING_US else None


class MeasuredPart(NamedTuple):
    """Steps that are measured; a position is that at the end of its step."""

    steps: slice
    turn_share: float | None
    """Share of the last step that belongs to a turn; None for an arc."""


def measured_part(path: CirclePath, *, timing: LoopTiming, margins: tuple[LoopMargins, ...]) -> MeasuredPart:
    """Steps that are measured: the whole turn where the path has it, else its settled arc.

    Parameters
    ----------
    path
        The move.
    timing
        Timing of the loops.
    margins
        Those of both loops, which say how fast they settle.

    Examples
    --------
    >>> from busplan.servo.path import circle_path
    >>> path = circle_path(1.0, feed_mm_per_min=600.0, period_us=1000.0, ramp_periods=0, settling_us=0.0)
    >>> part = measured_part(path, timing=LoopTiming(period_us=1000.0), margins=())
    >>> part.steps, round(part.turn_share, 3)
    (slice(6290, 12574, None), 0.185)
    """
    if path.turn_from_us is None:
        return _settled_arc(path, timing=timing, margins=margins)
    return _turn(path, timing, from_us=path.turn_from_us)


def _turn(path: CirclePath, timing: LoopTiming, *, from_us: float) -> MeasuredPart:
    """Steps of the whole turn at constant speed."""
    first = round(from_us / timing.step_us)
    turn = path.turn_us / timing.step_us
    count = max(1, math.ceil(turn - _ROUNDING_STEPS))
    return MeasuredPart(slice(first, first + count), min(1.0, turn - (count - 1)))


def _settled_arc(path: CirclePath, *, timing: LoopTiming, margins: tuple[LoopMargins, ...]) -> MeasuredPart:
    """Steps at constant speed without settling; at least one."""
    start, stop = path.constant_from_us + path.period_us, path.constant_until_us
    settling = max(0.0 if margin.settling_us is None else margin.settling_us for margin in margins)
    start += min(settling, _SETTLING_SHARE * max(stop - start, 0.0))
    first = math.ceil(start / timing.step_us) - 1
    last = max(math.floor(stop / timing.step_us), first + 1)
    return MeasuredPart(slice(first, last), None)
