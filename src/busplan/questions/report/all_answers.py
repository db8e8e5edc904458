"""All answers for one profile, as a page shows them; each comes from the function of its command."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from busplan.errors import BusplanError
from busplan.progress import Progress, part_of
from busplan.questions.capacity.sensitivity import Sensitivity, sensitivity
from busplan.questions.capacity.verdict import Verdict, verdicts
from busplan.questions.circle.contour import ContourProfile, drawn_profile
from busplan.questions.circle.figures import CircleFigures, CircleTest
from busplan.questions.circle.roundness import circle_test
from busplan.questions.explain.derivation import assumptions
from busplan.questions.fit.circle_refusal import circle_refusals
from busplan.questions.fit.figures import Capacity, capacity
from busplan.questions.fit.network import bus_of, model_names
from busplan.questions.fit.node_steps import NodeSteps, node_steps
from busplan.questions.latency.figures import LatencyResult, latency
from busplan.questions.map.trade_off import TradeOff, trade_off
from busplan.questions.timeline.events import Schedule, schedule
from busplan.sections.base import MAX_TIME_US, MIN_STEP_US
from busplan.sections.profile import Profile
from busplan.sourced import Input

_PERIOD_FACTORS: Final = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)


class AllAnswers(NamedTuple):
    """All answers for one profile; an answer that cannot be computed is None, with the reason."""

    profile: Profile
    capacity: Capacity
    verdict: Verdict
    sensitivity: Sensitivity | None
    """This, the schedule and the map are None of a network without a cycle."""
    latency: LatencyResult
    schedule: Schedule | None
    no_schedule: tuple[str, ...]
    """Why there is no schedule."""
    steps: tuple[NodeSteps, ...]
    """Nodes over the period, under each timing model; empty where nodes are in groups."""
    periods: Capacity
    """Capacity at several periods around and including the profile's own."""
    trade_off: TradeOff | None
    """Period against axes, without circle tests."""
    circle: CircleTest | None
    """The test with its contributions but without its simulation, which `contour` condenses."""
    contour: ContourProfile | None
    """Contour error around the circle; None if the table did not follow it."""
    no_circle: tuple[str, ...]
    """Why the circle test that the profile asks for cannot be run."""
    assumptions: tuple[Input, ...]
    """Inputs of the figures, the least well known first."""

    @property
    def circle_figures(self) -> CircleFigures | None:
        """Figures of the circle test at the profile's period."""
        return None if self.circle is None else self.circle.results[0]


def all_answers(profile: Profile, *, with_circle: bool = True, progress: Progress | None = None) -> AllAnswers:
    """Compute all answers for a profile.

    Parameters
    ----------
    profile
        The network.
    with_circle
        Run the circle test, if the profile asks for one.
    progress
        As for `circle_test`.
    """
    bus = capacity(profile)
    if not profile.has_cycle:
        return AllAnswers(
            profile=profile,
            capacity=bus,
            verdict=verdicts(bus)[0],
            sensitivity=None,
            latency=latency(profile),
            schedule=None,
            no_schedule=(),
            steps=(),
            periods=bus,
            trade_off=None,
            circle=None,
            contour=None,
            no_circle=(),
            assumptions=assumptions(profile),
        )
    own_us = profile.cycle.period_us
    near_us = (own_us * factor for factor in _PERIOD_FACTORS if MIN_STEP_US <= own_us * factor <= MAX_TIME_US)
    periods_us = [us for us in near_us if us == own_us or bus_of(profile).periods.allows(us)]
    plan, no_schedule = _schedule(profile)
    no_circle = tuple(cause.message for cause in circle_refusals(profile))
    is_run = with_circle and profile.asks_for_circle and not no_circle
    circle, contour = _circle(profile, progress) if is_run else (None, None)
    return AllAnswers(
        profile=profile,
        capacity=bus,
        verdict=verdicts(bus)[0],
        sensitivity=sensitivity(profile),
        latency=latency(profile),
        schedule=plan,
        no_schedule=no_schedule,
        steps=() if profile.group else tuple(node_steps(profile, model=model) for model in model_names(profile)),
        periods=capacity(profile, periods_us=periods_us),
        trade_off=trade_off(profile),
        circle=circle,
        contour=contour,
        no_circle=no_circle,
        assumptions=assumptions(profile),
    )


def answers_of_each(
    profiles: Sequence[Profile], *, with_circle: bool = True, progress: Progress | None = None
) -> list[AllAnswers]:
    """Compute all answers for each of several profiles, with one progress for all.

    Parameters
    ----------
    profiles, with_circle, progress
        As for `all_answers`.
    """
    return [
        all_answers(
            profile,
            with_circle=with_circle,
            progress=None if progress is None else part_of(progress, number=number, of=len(profiles)),
        )
        for number, profile in enumerate(profiles)
    ]


def _schedule(profile: Profile) -> tuple[Schedule | None, tuple[str, ...]]:
    try:
        return schedule(profile), ()
    except BusplanError as error:
        return None, error.problems


def _circle(profile: Profile, progress: Progress | None) -> tuple[CircleTest, ContourProfile | None]:
    test = circle_test(profile, with_contributions=True, progress=progress)
    (run,) = test.runs
    # A simulation has half a million positions, and a page may have many profiles: keep only the condensed error.
    return test._replace(runs=(None,)), drawn_profile(run)
