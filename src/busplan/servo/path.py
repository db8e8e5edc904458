"""The circle that the host interpolates, a set-point each period with speed ramps at both ends, and its measured part.

There are two paths. The paper's, `trapezoid`, is one circle with both ramps on it. `iso230-4` has a lead-in of whole
turns until the loops have settled, then one whole turn at constant speed on which everything is measured, then the
ramp down.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from busplan.servo.margins import LoopMargins, loop_margins
from busplan.servo.parameters import Axis, LoopTiming, negative, not_one_of, not_positive, refuse
from busplan.servo.runnable import LONGEST_SETTLING_US, move_along, unfit_move

Direction = Literal["ccw", "cw"]
Floats = NDArray[np.float64]

_US_PER_S = 1e6
_S_PER_MIN = 60.0
_SETTLING_SHARE = 0.2
"""Largest share of a trapezoid's constant speed that the measures leave out for settling."""
REST_MM = 1e-4
"""Remaining lag that counts as settled, where no tolerance says how round the circle must be."""
_ROUNDING_STEPS = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CirclePath:
    """Set-points of a move on a circle about the origin."""

    radius_mm: float
    """Radius [mm]."""
    feed_mm_per_min: float
    """Speed along the path between the ramps [mm/min]."""
    period_us: float
    """Time between set-points [us]."""
    x_mm: Floats
    y_mm: Floats
    """Set-points after the start at time 0, shape (setpoints + 1,) [mm]."""
    constant_from_us: float
    constant_until_us: float
    """Start and end of the constant speed [us]."""
    turn_from_us: float | None = None
    """Start of the whole turn to measure, which ends with the constant speed [us]; None on a trapezoid."""
    settling_us: float | None = None
    """Least time at constant speed before that turn [us]; None on a trapezoid."""
    direction: Direction = "ccw"
    """Direction of rotation."""

    @property
    def setpoints(self) -> int:
        """Number of set-points, equal to the number of periods of the move [1]."""
        return len(self.x_mm) - 1

    @property
    def duration_us(self) -> float:
        """Duration of the move [us]."""
        return self.setpoints * self.period_us

    @property
    def feed_mm_s(self) -> float:
        """Speed along the path between the ramps [mm/s]."""
        return self.feed_mm_per_min / _S_PER_MIN

    @property
    def turn_us(self) -> float:
        """Time for one turn at the feed [us]."""
        return 2 * math.pi * self.radius_mm / self.feed_mm_s * _US_PER_S


def circle_path(
    radius_mm: float,
    *,
    feed_mm_per_min: float,
    period_us: float,
    ramp_periods: int = 100,
    direction: Direction = "ccw",
    settling_us: float | None = None,
) -> CirclePath:
    """Sample a move on a circle, with trapezoidal speed along the path.

    Parameters
    ----------
    radius_mm
        Radius r [mm].
    feed_mm_per_min
        Speed F along the path between the ramps [mm/min].
    period_us
        Time T between set-points [us].
    ramp_periods
        Length of the speed ramp at each end, in periods; 0 starts and stops at full feed [1].
    direction
        "ccw" (anticlockwise, towards +y first) or "cw".
    settling_us
        None: a trapezoid, one full circle from (r, 0) back to (r, 0). A time: a lead-in of at least one whole turn,
        with at least this time at constant speed, then one whole turn from (r, 0) at constant speed (ISO 230-4), then
        the ramp down [us].

    Returns
    -------
    CirclePath
        The set-points and the times between which the speed is constant.

    Raises
    ------
    BusplanError
        A value is out of range, a trapezoid is so short that the feed is never reached, or the move takes more than
        `runnable.MAX_SETPOINTS` periods.

    Notes
    -----
    With ramps of duration R a trapezoid takes D = 2 pi r / F + R: each ramp covers half the distance at full feed. The
    number of set-points is D / T, rounded up; the path ends within the last period. The turn of ISO 230-4 begins with a
    set-point at (r, 0), so the lead-in begins up to one set-point before it.

    References
    ----------
    The durations of the circle test in G. Gu et al., IEEE Transactions on Industrial Electronics 57 (12), 2010,
    section IV-B, follow from 100 ramp periods at either period.

    Examples
    --------
    >>> slow = circle_path(320.0, feed_mm_per_min=2500.0, period_us=4000.0)
    >>> slow.setpoints, slow.duration_us / 1e6
    (12164, 48.656)
    >>> fast = circle_path(320.0, feed_mm_per_min=10000.0, period_us=1000.0)
    >>> fast.setpoints, fast.duration_us / 1e6
    (12164, 12.164)
    >>> turn = circle_path(320.0, feed_mm_per_min=10000.0, period_us=1000.0, settling_us=200e3)
    >>> turn.turn_from_us / 1e6, round(turn.constant_until_us / 1e6, 6), turn.duration_us / 1e6
    (12.114, 24.177716, 24.278)
    """
    refuse(
        *not_positive(radius_mm=radius_mm, feed_mm_per_min=feed_mm_per_min, period_us=period_us),
        *negative(ramp_periods=ramp_periods, settling_us=settling_us or 0.0),
        *not_one_of("ccw", "cw", direction=direction),
    )
    period_s, feed_mm_s = period_us / _US_PER_S, feed_mm_per_min / _S_PER_MIN
    move = move_along(
        radius_mm,
        feed_mm_per_min=feed_mm_per_min,
        period_us=period_us,
        ramp_periods=ramp_periods,
        settling_us=settling_us,
    )
    refuse(*unfit_move(move, radius_mm=radius_mm))
    time_s = np.arange(move.setpoints + 1, dtype=np.float64) * period_s
    way_mm = _trapezoid(time_s, feed_mm_s=feed_mm_s, ramp_s=move.ramp_s, length_mm=move.length_mm)
    angle = (move.start_mm + way_mm) / radius_mm
    return CirclePath(
        radius_mm=radius_mm,
        feed_mm_per_min=feed_mm_per_min,
        period_us=period_us,
        x_mm=radius_mm * np.cos(angle),
        y_mm=radius_mm * np.sin(angle) * (1 if direction == "ccw" else -1),
        constant_from_us=move.ramp_s * _US_PER_S,
        constant_until_us=(move.duration_s - move.ramp_s) * _US_PER_S,
        turn_from_us=None if move.turn_from_s is None else move.turn_from_s * _US_PER_S,
        settling_us=settling_us,
        direction=direction,
    )


def _trapezoid(time_s: Floats, *, feed_mm_s: float, ramp_s: float, length_mm: float) -> Floats:
    """Distance covered at each time [mm]."""
    if ramp_s == 0.0:
        return np.minimum(feed_mm_s * time_s, length_mm)
    left_s = np.maximum(length_mm / feed_mm_s + ramp_s - time_s, 0.0)
    # The end is the mirror image of the start.
    start_mm = _speeding_up(time_s, feed_mm_s=feed_mm_s, ramp_s=ramp_s)
    end_mm = length_mm - _speeding_up(left_s, feed_mm_s=feed_mm_s, ramp_s=ramp_s)
    return np.where(time_s < left_s, start_mm, end_mm)


def _speeding_up(time_s: Floats, *, feed_mm_s: float, ramp_s: float) -> Floats:
    ramp_mm = feed_mm_s * time_s**2 / (2 * ramp_s)
    return np.where(time_s < ramp_s, ramp_mm, feed_mm_s * (time_s - ramp_s / 2))


def settling_time_us(
    x: Axis, y: Axis, *, timing: LoopTiming, feed_mm_per_min: float, rest_mm: float = REST_MM
) -> float | None:
    """Time at constant speed until both loops settle to `rest_mm` [us]; None if unstable or over `LONGEST_SETTLING_US`.

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

    Examples
    --------
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
