"""The circle that the host interpolates: one set-point each period, with speed ramps at both ends.

There are two paths. The paper's, `trapezoid`, is one circle with both ramps on it. `iso230-4` has a lead-in of whole
turns until the loops have settled, then one whole turn at constant speed on which everything is measured, then the
ramp down.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from busplan.servo.checks import Refused, negative, not_one_of, not_positive, refuse

Direction = Literal["ccw", "cw"]
Floats = NDArray[np.float64]

MAX_SETPOINTS = 10_000_000
"""Most set-points of a move, 2.8 h at 1 ms; more is a typing error."""

_US_PER_S = 1e6
_S_PER_MIN = 60.0
_ROUNDING_PERIODS = 1e-9
"""Tolerance in periods, so that rounding does not add a period to a move."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CirclePath:
    """Set-points of a move on a circle about the origin.

    Parameters
    ----------
    radius_mm
        Radius [mm].
    feed_mm_per_min
        Speed along the path between the ramps [mm/min].
    period_us
        Time from one set-point to the next [us].
    x_mm, y_mm
        Set-points after the start at time 0, shape (setpoints + 1,) [mm].
    constant_from_us, constant_until_us
        Start and end of the constant speed [us].
    turn_from_us
        Start of the whole turn to measure, which ends with the constant speed [us]; None on a trapezoid.
    settling_us
        Least time at constant speed before that turn [us]; None on a trapezoid.
    direction
        Direction of rotation.
    """

    radius_mm: float
    feed_mm_per_min: float
    period_us: float
    x_mm: Floats
    y_mm: Floats
    constant_from_us: float
    constant_until_us: float
    turn_from_us: float | None = None
    settling_us: float | None = None
    direction: Direction = "ccw"

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


class _Move(NamedTuple):
    """A move along the circle, without its set-points."""

    start_mm: float
    """Place of the start along the circle, 0 at (r, 0)."""
    length_mm: float
    ramp_s: float
    turn_from_s: float | None

    def duration_s(self, feed_mm_s: float) -> float:
        """Duration of the move [s]: each ramp covers half the distance at full feed."""
        return self.length_mm / feed_mm_s + self.ramp_s

    def setpoints(self, feed_mm_s: float, period_s: float) -> int:
        """Number of periods of the move, the last one begun [1]."""
        return math.ceil(self.duration_s(feed_mm_s) / period_s - _ROUNDING_PERIODS)


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
        Time T from one set-point to the next [us].
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
        `MAX_SETPOINTS` periods.

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
    move = _move(radius_mm, feed_mm_s, period_s, ramp_periods, settling_us)
    setpoints = move.setpoints(feed_mm_s, period_s)
    if move.length_mm < feed_mm_s * move.ramp_s:
        refuse(_too_short(radius_mm, feed_mm_per_min=feed_mm_per_min, ramp_s=move.ramp_s))
    if setpoints > MAX_SETPOINTS:
        right = (
            f"the circle takes {setpoints:.3g} periods of {period_us:g} us, more than {MAX_SETPOINTS}; "
            f"choose a faster feed, a smaller radius or a longer period"
        )
        refuse(Refused("feed_mm_per_min", feed_mm_per_min, right, ("radius_mm", "period_us")))
    time_s = np.arange(setpoints + 1, dtype=np.float64) * period_s
    way_mm = _trapezoid(time_s, feed_mm_s=feed_mm_s, ramp_s=move.ramp_s, length_mm=move.length_mm)
    angle = (move.start_mm + way_mm) / radius_mm
    return CirclePath(
        radius_mm=radius_mm,
        feed_mm_per_min=feed_mm_per_min,
        period_us=period_us,
        x_mm=radius_mm * np.cos(angle),
        y_mm=radius_mm * np.sin(angle) * (1 if direction == "ccw" else -1),
        constant_from_us=move.ramp_s * _US_PER_S,
        constant_until_us=(move.duration_s(feed_mm_s) - move.ramp_s) * _US_PER_S,
        turn_from_us=None if move.turn_from_s is None else move.turn_from_s * _US_PER_S,
        settling_us=settling_us,
        direction=direction,
    )


def circle_setpoints(
    radius_mm: float,
    *,
    feed_mm_per_min: float,
    period_us: float,
    ramp_periods: int = 100,
    settling_us: float | None = None,
) -> int:
    """Count the set-points of `circle_path` without computing them.

    Parameters
    ----------
    radius_mm, feed_mm_per_min, period_us, ramp_periods, settling_us
        As for `circle_path`, in range.

    Returns
    -------
    int
        Number of periods that the move takes [1].

    Examples
    --------
    >>> circle_setpoints(320.0, feed_mm_per_min=2500.0, period_us=4000.0)
    12164
    """
    period_s, feed_mm_s = period_us / _US_PER_S, feed_mm_per_min / _S_PER_MIN
    return _move(radius_mm, feed_mm_s, period_s, ramp_periods, settling_us).setpoints(feed_mm_s, period_s)


def _move(radius_mm: float, feed_mm_s: float, period_s: float, ramp_periods: int, settling_us: float | None) -> _Move:
    circle_mm, ramp_s = 2 * math.pi * radius_mm, ramp_periods * period_s
    if settling_us is None:
        return _Move(0.0, circle_mm, ramp_s, None)
    turn_s = circle_mm / feed_mm_s
    turns = max(1, math.ceil((settling_us / _US_PER_S + ramp_s / 2) / turn_s))
    lead_in = math.ceil((turns * turn_s + ramp_s / 2) / period_s - _ROUNDING_PERIODS)
    turn_from_s = lead_in * period_s
    before_mm = feed_mm_s * (turn_from_s - ramp_s / 2)
    return _Move(-before_mm, before_mm + circle_mm + feed_mm_s * ramp_s / 2, ramp_s, turn_from_s)


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


def _too_short(radius_mm: float, *, feed_mm_per_min: float, ramp_s: float) -> Refused:
    length_mm = 2 * math.pi * radius_mm
    reachable = length_mm / ramp_s * _S_PER_MIN
    smallest_mm = feed_mm_per_min / _S_PER_MIN * ramp_s / (2 * math.pi)
    return Refused(
        "feed_mm_per_min",
        feed_mm_per_min,
        f"never reached on a circle of radius_mm = {radius_mm} with ramps of {ramp_s:g} s; "
        f"choose at most {reachable:.6g} mm/min, at least {smallest_mm:.6g} mm, or shorter ramps",
        ("radius_mm", "ramp_periods", "period_us"),
    )
