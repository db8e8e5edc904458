"""Make the input of a circle simulation from a profile: path, axes, timing, delivery and mechanics."""

from math import inf
from typing import Any, Final

from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.circle.contributions import Setup
from busplan.analysis.circle.delays import jitter_us, loop_delays_us, skew_us
from busplan.analysis.network import bus_of
from busplan.sections.base import Section
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.checks import ParameterError, Refused, parameters
from busplan.servo.circle import check_circle
from busplan.servo.measured_part import REST_MM, settling_time_us
from busplan.servo.parameters import Axis, Delivery, LoopTiming, Mechanics
from busplan.servo.path import circle_path, circle_setpoints

_REST_SHARE: Final = 1e-3
"""What settling may leave of the smallest contour tolerance."""


def bus(profile: Profile) -> CapacityFigures:
    """Capacity under the timing model that decides, without the numbers of nodes that no circle asks for."""
    return figures(profile, model=bus_of(profile).deciding_model, with_counts=False)


def setup(profile: Profile) -> Setup:
    """Input of a profile's circle simulation.

    Raises
    ------
    BusplanError
        As `circle_test`.
    """
    circle, delivery, mechanics = profile.circle, profile.delivery, profile.mechanics
    (x, y), timing = loop_axes(profile), loop_timing(profile)
    settling_us = path_settling_us(profile)
    one = Setup(
        path=circle_path(
            circle.radius_mm,
            feed_mm_per_min=circle.feed_mm_per_min,
            period_us=profile.cycle.period_us,
            ramp_periods=circle.ramp_periods,
            direction=circle.direction,
            settling_us=0.0 if settling_us == inf else settling_us,
        ),
        x=x,
        y=y,
        timing=timing,
        delivery=Delivery(
            **_parameters_in(delivery, Delivery)
            | {"jitter_us": jitter_us(profile), "skew_us": delivery.skew_us + skew_us(profile)}
        ),
        mechanics=Mechanics(**_parameters_in(mechanics, Mechanics)),
        settled=settling_us != inf,
    )
    check_circle(one.path, x=one.x, y=one.y, timing=one.timing, delivery=one.delivery)
    return one


def loop_timing(profile: Profile) -> LoopTiming:
    """Timing of a profile's position loops.

    Raises
    ------
    BusplanError
        The period is no multiple of the step.
    """
    servo = profile.servo
    try:
        return LoopTiming(
            period_us=profile.cycle.period_us, step_us=servo.step_us, loop=servo.loop, interpolation=servo.interpolation
        )
    except ParameterError as error:
        if "step_us" in servo.model_fields_set:
            raise
        default = (one._replace(right=f"{one.right}; it is the default of servo.step_us") for one in error.refused)
        raise ParameterError(*default) from None


def loop_axes(profile: Profile) -> tuple[Axis, Axis]:
    """Both axes of a profile with the delays of their loops.

    Raises
    ------
    BusplanError
        The bus puts more than a period into a loop on the host.
    """
    x_us, y_us = loop_delays_us(profile)
    period_us = profile.cycle.period_us
    if max(x_us, y_us) > period_us:
        why = f"the bus puts {max(x_us, y_us):g} us into a loop over it, and the circle test knows one period"
        right = f'{why}, {period_us:g} us, at most; close the loop on the node, servo.loop = "node"'
        raise ParameterError(Refused("servo.loop", '"host"', right))
    servo = profile.servo
    return Axis(**servo.axis_keys("x"), delay_us=x_us), Axis(**servo.axis_keys("y"), delay_us=y_us)


def path_steps(profile: Profile) -> int:
    """Count the simulated steps of each axis; nothing is simulated [1].

    Raises
    ------
    BusplanError
        The period is no multiple of the step.
    """
    timing = loop_timing(profile)
    return path_setpoints(profile) * timing.steps_per_period


def path_setpoints(profile: Profile) -> int:
    """Count the set-points of a profile's circle [1]."""
    circle, settling_us = profile.circle, path_settling_us(profile)
    return circle_setpoints(
        circle.radius_mm,
        feed_mm_per_min=circle.feed_mm_per_min,
        period_us=profile.cycle.period_us,
        ramp_periods=circle.ramp_periods,
        settling_us=0.0 if settling_us == inf else settling_us,
    )


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
        rest_mm=REST_MM if least_mm is None else _REST_SHARE * least_mm,
    )
    return inf if found is None else found


def _parameters_in(section: Section, of: type) -> dict[str, Any]:
    """The parameters of the servo core in a section, to which a kind of bus may have added keys."""
    return section.model_dump(include={one.name for one in parameters(of)})
