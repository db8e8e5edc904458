"""Rules of the circle test: does the loop have its margins, does the circle hold its tolerances?

They share one run of the test, for profiles with a section for it.
"""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.buses.rule import RuleProblem
from busplan.gate.finding import Subject
from busplan.questions.fit.circle_refusal import path_steps, refusals
from busplan.sections.base import value_at
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.checks import Refused

MOST_STEPS: Final = 10_000_000
"""Most steps of a circle that the gate runs: seconds, and a few hundred megabytes."""
_NOT_RUN: Final = ("BP203", "BP204")


def circle_problems(subject: Subject) -> Iterator[tuple[str, RuleProblem]]:
    """Run the circle test of a profile, and yield the code of each broken rule with its problem.

    A circle that cannot be run is said whether or not it was to be run. A cycle that does not fit breaks another rule,
    and has no circle.

    Parameters
    ----------
    subject
        The profile, and the most simulated steps of each axis: a longer circle is not run.
    """
    profile, network, most_steps = subject.profile, subject.network, subject.circle_steps
    refused = refusals(network) if profile.asks_for_circle else ()
    yield from (("BP203", _refused(cause, profile)) for cause in refused)
    if refused or most_steps is None or not profile.asks_for_circle or not subject.deciding.fits:
        return
    from busplan.questions.circle.failures import STABILITY
    from busplan.questions.circle.roundness import circle_test, to_attack

    steps = path_steps(network)
    if steps > most_steps:
        words = f"the circle takes {steps:,} steps, more than {most_steps:,}: not run"
        yield "BP204", RuleProblem(_key_in_file("circle.radius_mm", profile=profile), words)
        return
    result = circle_test(network).results[0]
    # A cycle that is not shown to fit has a rule of its own: nothing of the circle mends it.
    failures = [failure for failure in result.failures if not failure.is_of_bus]
    first = to_attack(result)
    attack = "no single error source of the profile explains it" if first is None else f"attack {first[0].source} first"
    for failure in failures:
        stability = failure.name in STABILITY
        # A finding needs a key in the file: a default limit has none.
        said = failure.name in profile.tolerance.model_fields_set
        key = f"tolerance.{failure.name}" if said else "servo.position_gain_per_s"
        gain = profile.servo.position_gain_per_s
        way_out = "lower servo.position_gain_per_s or what delays the loop" if stability and gain else ""
        if failure.name in CONTOUR_MEASURES and failure.value is not None:
            way_out = attack
        yield "BP202" if stability else "BP201", RuleProblem(key, failure.text, way_out)


def _refused(cause: Refused, profile: Profile) -> RuleProblem:
    """Why a circle cannot be run, at a key of the file."""
    key = _key_in_file(cause.name, *cause.beside, profile=profile)
    # A key that is the cause says its name already.
    words, _, way_out = (f"{cause.value}: {cause.right}" if key == cause.name else cause.message).partition("; ")
    return RuleProblem(key, words, way_out)


def _key_in_file(*keys: str, profile: Profile) -> str:
    """The first of some keys that the profile sets, or the nearest section."""
    for key in keys:
        section, _, name = key.rpartition(".")
        if name in value_at(profile, section).model_fields_set:
            return key
    return "servo" if "servo" in profile.model_fields_set else "circle"


def answered(subject: Subject, problems: Sequence[tuple[str, RuleProblem]]) -> set[str]:
    """Codes of the rules that were checked; without a test, only that of the rule that says why there is none."""
    not_run = {code for code, _ in problems if code in _NOT_RUN}
    if not_run:
        return not_run
    is_run = subject.circle_steps is not None and (subject.deciding.fits or not subject.profile.asks_for_circle)
    return {"BP201", "BP202", *_NOT_RUN} if is_run else {"BP203"}
