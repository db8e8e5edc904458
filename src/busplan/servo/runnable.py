"""Inputs of the simulation of a circle: its move, its steps, its drives and the delivery of its set-points.

Nothing is simulated, and nothing needs numpy, so that every command can say why a circle cannot be run.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from busplan.servo.parameters import Axis, Delivery, LoopTiming, Refused

MAX_SETPOINTS = 1_000_000
"""Most set-points of a move, 17 minutes at 1 ms; they take 200 MB."""
MAX_STEPS = 12_000_000
"""Most steps of a move: positions of two axes, and what is computed from them, take 220 MB."""
LONGEST_SETTLING_US = 60e6
"""Longest lead-in in which loops may settle [us]."""

_US_PER_S = 1e6
_S_PER_MIN = 60.0
_ROUNDING_PERIODS = 1e-9
"""Tolerance in periods, so that rounding does not add a period to a move."""
_LARGEST_COUNT = 2.0**51
"""Largest number that `busplan.servo.kernel.ROUND` rounds exactly."""


class Move(NamedTuple):
    """A move along the circle, without its set-points."""

    start_mm: float
    """Place of the start along the circle, 0 at (r, 0)."""
    length_mm: float
    feed_mm_per_min: float
    period_us: float
    ramp_s: float
    turn_from_s: float | None
    """Start of the whole turn that is measured; None on a trapezoid."""

    @property
    def duration_s(self) -> float:
        """Duration of the move [s]: each ramp covers half the distance at full feed."""
        return self.length_mm / (self.feed_mm_per_min / _S_PER_MIN) + self.ramp_s

    @property
    def setpoints(self) -> int:
        """Set-points of the move, the last partial period included [1]."""
        return math.ceil(self.duration_s / (self.period_us / _US_PER_S) - _ROUNDING_PERIODS)


def move_along(
    radius_mm: float,
    *,
    feed_mm_per_min: float,
    period_us: float,
    ramp_periods: int = 100,
    settling_us: float | None = None,
) -> Move:
    """Lay out the move of `circle_path` without its set-points.

    Examples
    --------
    >>> move_along(320.0, feed_mm_per_min=2500.0, period_us=4000.0).setpoints
    12164
    """
    period_s, feed_mm_s = period_us / _US_PER_S, feed_mm_per_min / _S_PER_MIN
    circle_mm, ramp_s = 2 * math.pi * radius_mm, ramp_periods * period_s
    if settling_us is None:
        return Move(0.0, circle_mm, feed_mm_per_min, period_us, ramp_s, None)
    turn_s = circle_mm / feed_mm_s
    turns = max(1, math.ceil((settling_us / _US_PER_S + ramp_s / 2) / turn_s))
    lead_in = math.ceil((turns * turn_s + ramp_s / 2) / period_s - _ROUNDING_PERIODS)
    turn_from_s = lead_in * period_s
    before_mm = feed_mm_s * (turn_from_s - ramp_s / 2)
    length_mm = before_mm + circle_mm + feed_mm_s * ramp_s / 2
    return Move(-before_mm, length_mm, feed_mm_per_min, period_us, ramp_s, turn_from_s)


def unfit_move(move: Move, *, radius_mm: float) -> Iterator[Refused]:
    """Refuse a move that never reaches its feed, or that takes too many set-points."""
    feed_mm_s = move.feed_mm_per_min / _S_PER_MIN
    if move.length_mm < feed_mm_s * move.ramp_s:
        reachable = move.length_mm / move.ramp_s * _S_PER_MIN
        smallest_mm = feed_mm_s * move.ramp_s / (2 * math.pi)
        yield Refused(
            "feed_mm_per_min",
            move.feed_mm_per_min,
            f"never reached on a circle of radius_mm = {radius_mm} with ramps of {move.ramp_s:g} s; "
            f"choose at most {reachable:.6g} mm/min, at least {smallest_mm:.6g} mm, or shorter ramps",
            ("radius_mm", "ramp_periods", "period_us"),
        )
    elif move.setpoints > MAX_SETPOINTS:
        right = (
            f"the circle takes {move.setpoints:.3g} periods of {move.period_us:g} us, more than {MAX_SETPOINTS}; "
            f"choose a faster feed, a smaller radius or a longer period"
        )
        yield Refused("feed_mm_per_min", move.feed_mm_per_min, right, ("radius_mm", "period_us"))


def unfit_steps(setpoints: int, *, reach_mm: float, axis: Axis, timing: LoopTiming) -> Iterator[Refused]:
    """Refuse a move with too many steps for memory, or an encoder too fine for its travel."""
    steps = setpoints * timing.steps_per_period
    if steps > MAX_STEPS:
        right = f"the move takes {steps} steps, more than {MAX_STEPS}; choose a longer step or a shorter move"
        yield Refused("step_us", timing.step_us, right, ("feed_mm_per_min", "radius_mm"))
    travel_mm = reach_mm + axis.max_velocity_mm_s * setpoints * timing.period_us / _US_PER_S
    if travel_mm > _LARGEST_COUNT * axis.encoder_resolution_mm > 0:
        right = (
            f"too fine for {travel_mm:.3g} mm of travel; "
            f"choose at least {travel_mm / _LARGEST_COUNT:.3g} mm, or 0 (ideal)"
        )
        yield Refused("encoder_resolution_mm", axis.encoder_resolution_mm, right)


def out_of_reach(axis: Axis, *, name: str, feed_mm_per_min: float) -> Iterator[Refused]:
    """Refuse a drive that cannot reach the feed in both directions."""
    highest_mm_s, offset_mm_s = axis.highest_command_mm_s, abs(axis.drive_offset_mm_s)
    levels = f" and dac_bits = {axis.dac_bits}" if axis.dac_bits else ""
    if offset_mm_s >= highest_mm_s:
        yield Refused(
            "drive_offset_mm_s",
            axis.drive_offset_mm_s,
            f"axis {name} commands at most {highest_mm_s:g} mm/s with "
            f"max_velocity_mm_s = {axis.max_velocity_mm_s}{levels}; the offset must stay below it",
            ("max_velocity_mm_s",),
        )
    elif feed_mm_per_min / _S_PER_MIN >= highest_mm_s - offset_mm_s:
        yield Refused(
            "feed_mm_per_min",
            feed_mm_per_min,
            f"axis {name} reaches {(highest_mm_s - offset_mm_s) * _S_PER_MIN:g} mm/min with "
            f"max_velocity_mm_s = {axis.max_velocity_mm_s}{levels}; the feed must stay below it",
            ("max_velocity_mm_s", "drive_offset_mm_s"),
        )


def unfit_delivery(delivery: Delivery, *, period_us: float) -> Iterator[Refused]:
    """Refuse a delivery that would change the order of packets: jitter and skew beyond half the period."""
    if abs(delivery.skew_us) + delivery.jitter_us > period_us / 2:
        both = f"{delivery.jitter_us} and skew_us = {delivery.skew_us}"
        right = f"together they must not exceed half the period, {period_us / 2:g} us"
        yield Refused("jitter_us", both, right, ("skew_us", "period_us"))
