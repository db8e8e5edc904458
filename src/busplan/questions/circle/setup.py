"""Make the input of a circle simulation from a profile: path, axes, timing, delivery and mechanics."""

from math import inf

from busplan.questions.circle.contributions import Setup
from busplan.questions.fit.circle_move import loop_axes, loop_timing, path_settling_us
from busplan.questions.fit.circle_refusal import delivery_of, parameters_in, require_circle
from busplan.questions.fit.figures import CapacityFigures, figures
from busplan.questions.fit.network import bus_of
from busplan.sections.profile import Profile
from busplan.servo.parameters import Mechanics
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
    require_circle(profile)
    circle, settling_us = profile.circle, path_settling_us(profile)
    x, y = loop_axes(profile)
    return Setup(
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
        timing=loop_timing(profile),
        delivery=delivery_of(profile),
        mechanics=Mechanics(**parameters_in(profile.mechanics, Mechanics)),
        settled=settling_us != inf,
    )
