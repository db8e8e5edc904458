"""Rules of the circle test: does the loop have its margins, does the circle hold its tolerances?

They share one run of the test, only for profiles with a section for it.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Final

from busplan.analysis.circle.check import MOST_STEPS
from busplan.analysis.planning.constraints import refused_step
from busplan.buses.rule import Mending, Rule, RuleProblem
from busplan.errors import BusplanError
from busplan.rules.finding import Subject
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.checks import ParameterError

_NAMED: Final = ("circle", "servo", "delivery", "cycle", "bus")
_NOT_RUN: Final = ("BP203", "BP204")


def circle_problems(subject: Subject, *, most_steps: int = MOST_STEPS) -> Iterator[tuple[str, RuleProblem]]:
    """Run the circle test of a profile, and yield the code of each broken rule with its problem.

    A cycle that does not fit breaks another rule, and has no circle.

    Parameters
    ----------
    subject
        The profile.
    most_steps
        Most simulated steps of each axis: a longer circle is not run.
    """
    from busplan.analysis.circle.failures import STABILITY
    from busplan.analysis.circle.roundness import circle_test, to_attack
    from busplan.analysis.circle.setup import path_steps

    if not subject.profile.asks_for_circle or not subject.deciding.fits:
        return
    try:
        steps = path_steps(subject.profile)
        if steps > most_steps:
            key = _key_of("radius_mm", profile=subject.profile)
            yield "BP204", RuleProblem(key, f"the circle takes {steps:,} steps, more than {most_steps:,}: not run")
            return
        result = circle_test(subject.profile).results[0]
    except ParameterError as error:
        for refused in error.refused:
            key = _key_of(refused.name, *refused.beside, profile=subject.profile)
            # A key that is the parameter says its name already.
            is_said = key.rpartition(".")[2] == refused.name.rpartition(".")[2]
            message = f"{refused.value}: {refused.right}" if is_said else refused.message
            words, _, way_out = message.partition("; ")
            is_step = refused_step(subject.profile, subject.profile.cycle.period_us)
            yield "BP203", RuleProblem(key, words, *(subject.cure() if is_step else Mending(way_out)))
        return
    except BusplanError as error:
        yield from (("BP203", RuleProblem(_key_of(profile=subject.profile), words)) for words in error.problems)
        return
    # A cycle that is not shown to fit has a rule of its own: nothing of the circle mends it.
    failures = [one for one in result.failures if not one.is_of_bus]
    first = to_attack(result)
    attack = "no single error source of the profile explains it" if first is None else f"attack {first[0].source} first"
    for failure in failures:
        stability = failure.name in STABILITY
        # A finding needs a key in the file: a default limit has none.
        said = failure.name in subject.profile.tolerance.model_fields_set
        key = f"tolerance.{failure.name}" if said else "servo.position_gain_per_s"
        gain = subject.profile.servo.position_gain_per_s
        way_out = "lower servo.position_gain_per_s or what delays the loop" if stability and gain else ""
        if failure.name in CONTOUR_MEASURES and failure.value is not None:
            way_out = attack
        yield "BP202" if stability else "BP201", RuleProblem(key, failure.text, way_out)


def _key_of(*names: str, profile: Profile) -> str:
    """Key of the first of some parameters that the profile says, or the nearest section."""
    for name, section in product(names, _NAMED):
        last = name.removeprefix(f"{section}.")
        if last in getattr(profile, section).model_fields_set:
            return f"{section}.{last}"
    return "servo" if "servo" in profile.model_fields_set else "circle"


def answered(subject: Subject, problems: Sequence[tuple[str, RuleProblem]]) -> set[str]:
    """Codes of the rules that were checked: none without a test, one alone if it says why the test was not run."""
    if subject.profile.asks_for_circle and not subject.deciding.fits:
        return set()
    not_run = {code for code, _ in problems if code in _NOT_RUN}
    return not_run or {rule.code for rule in RULES}


RULES: Final = (
    Rule(
        "BP201",
        "circle-tolerance",
        "error",
        "the circle misses a tolerance",
        "The circle test of this profile, at its own period, does not hold a contour tolerance of [tolerance]. "
        "`busplan circle-test PROFILE --contributions` ranks the error sources.",
    ),
    Rule(
        "BP202",
        "no-stability-margin",
        "error",
        "the position loop lacks its stability margin",
        "The discrete position loop, with everything that delays it, is unstable or has less phase or gain margin "
        "than [tolerance] requires. Delay in a loop can make its circle rounder while it reduces the margins, so a "
        "circle without margins fails.",
    ),
    Rule(
        "BP203",
        "circle-impossible",
        "error",
        "the circle test cannot be run",
        "The values of [servo] and [circle] do not go together: the period is no multiple of the step, the drive "
        "cannot reach the feed, the circle is too short for its ramps, or the bus puts more than one period into a "
        "loop on the host.",
    ),
    Rule(
        "BP204",
        "circle-too-long",
        "warning",
        "the circle test is too long for a check, and was not run",
        "The circle of this profile takes more simulated steps than a check allows (--circle-steps, 10,000,000 unless "
        "it says otherwise), so nothing is known of its circle. A faster circle.feed_mm_per_min, a smaller "
        "circle.radius_mm or a longer servo.step_us makes it shorter; `busplan circle-test PROFILE` runs it.",
    ),
)
