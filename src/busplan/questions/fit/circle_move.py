"""The loops and the length of a profile's circle, from which it is told whether the circle can be run."""

from dataclasses import replace
from math import inf
from typing import Final

from busplan.questions.fit.circle_refusal import AXIS_NAMES, axis_of, move_of, require_circle
from busplan.questions.fit.loop_delays import loop_delays_us
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.measured_part import REST_MM, settling_time_us
from busplan.servo.parameters import FINEST_ENCODER_MM, Axis, LoopTiming

_REST_SHARE: Final = 1e-3
"""What settling may leave of the smallest contour tolerance."""


def loop_timing(profile: Profile) -> LoopTiming:
    """Timing of a profile's position loops, in a circle that can be run."""
    servo = profile.servo
    return LoopTiming(
        period_us=profile.cycle.period_us, step_us=servo.step_us, loop=servo.loop, interpolation=servo.interpolation
    )


def loop_axes(profile: Profile) -> tuple[Axis, Axis]:
    """Both axes of a profile with the delays of their loops, in a circle that can be run."""
    x, y = (
        replace(axis_of(profile, name), delay_us=delay_us)
        for name, delay_us in zip(AXIS_NAMES, loop_delays_us(profile), strict=True)
    )
    return x, y


def path_steps(profile: Profile) -> int:
    """Count the simulated steps of each axis; nothing is simulated [1].

    Raises
    ------
    ParameterError
        The circle cannot be run.
    """
    require_circle(profile)
    return path_setpoints(profile) * loop_timing(profile).steps_per_period


def path_setpoints(profile: Profile) -> int:
    """Count the set-points of a profile's circle, which can be run [1]."""
    return move_of(profile, path_settling_us(profile)).setpoints


def path_settling_us(profile: Profile) -> float | None:
    """Time of the lead-in at constant speed: None on a trapezoid, infinite if the loops do not settle [us]."""
    if profile.circle.path == "trapezoid":
        return None
    tolerances_mm = [getattr(profile.tolerance, name) for name in CONTOUR_MEASURES]
    least_mm = min((one for one in tolerances_mm if one), default=None)
    x, y = loop_axes(profile)
    found = settling_time_us(
        x,
        y,
        timing=loop_timing(profile),
        feed_mm_per_min=profile.circle.feed_mm_per_min,
        rest_mm=REST_MM if least_mm is None else max(_REST_SHARE * least_mm, FINEST_ENCODER_MM),
    )
    return inf if found is None else found
