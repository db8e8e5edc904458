"""Make the input of a circle simulation from a profile: path, axes, timing, delivery and mechanics."""

from typing import Any

from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.circle.contributions import Setup
from busplan.analysis.network import bus_of
from busplan.sections.base import Section
from busplan.sections.profile import Profile
from busplan.servo.checks import parameters
from busplan.servo.circle import check_circle
from busplan.servo.parameters import Axis, Delivery, LoopTiming, Mechanics
from busplan.servo.path import circle_path


def bus(profile: Profile) -> CapacityFigures:
    """Capacity under the timing model that decides."""
    return figures(profile, model=bus_of(profile).deciding_model)


def setup(profile: Profile) -> Setup:
    """Input of a profile's circle simulation.

    Raises
    ------
    BusplanError
        As `circle_test`.
    """
    circle, servo, delivery, mechanics = profile.circle, profile.servo, profile.delivery, profile.mechanics
    one = Setup(
        path=circle_path(
            circle.radius_mm,
            feed_mm_per_min=circle.feed_mm_per_min,
            period_us=profile.cycle.period_us,
            ramp_periods=circle.ramp_periods,
            direction=circle.direction,
        ),
        x=Axis(**servo.axis_keys("x")),
        y=Axis(**servo.axis_keys("y")),
        timing=loop_timing(profile),
        delivery=Delivery(**_parameters_in(delivery, Delivery)),
        mechanics=Mechanics(**_parameters_in(mechanics, Mechanics)),
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
    period_us, servo = profile.cycle.period_us, profile.servo
    return LoopTiming(
        period_us=period_us,
        step_us=servo.step_us,
        loop=servo.loop,
        interpolation=servo.interpolation,
        # A cycle that does not fit is never simulated; its delay must not stop the report that says so.
        delay_us=min(bus(profile).required_us, period_us) if servo.loop == "host" else 0.0,
    )


def _parameters_in(section: Section, of: type) -> dict[str, Any]:
    """The parameters of the servo core in a section, to which a kind of bus may have added keys."""
    return section.model_dump(include={one.name for one in parameters(of)})
