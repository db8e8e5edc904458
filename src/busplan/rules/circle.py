"""Rules of the circle test: does the loop have its margin, does the circle hold its tolerances?

They share one run of the test, made only for profiles that say something of servo, circle or tolerance.
"""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.buses.rule import Rule, RuleProblem
from busplan.rules.finding import Subject
from busplan.sections.profile import Profile
from busplan.servo.checks import ParameterError

_NAMED: Final = ("circle", "servo", "delivery", "cycle")


def circle_problems(subject: Subject) -> Iterator[tuple[str, RuleProblem]]:
    """Run the circle test of a profile: the code of each rule that is broken, with its problem.

    A cycle that does not fit has its own rule, and no circle.
    """
    from busplan.analysis.circle.failures import CONTOUR_MEASURES
    from busplan.analysis.circle.roundness import circle_test, to_attack

    if not subject.profile.asks_for_circle or not subject.deciding.fits:
        return
    try:
        result = circle_test(subject.profile).results[0]
    except ParameterError as error:
        for refused in error.refused:
            yield "BP203", RuleProblem(_key_of(refused.name, subject.profile), refused.message)
        return
    first = to_attack(result)
    attack = (
        "; no single error source of the profile explains it" if first is None else f"; attack {first[0].source} first"
    )
    for failure in result.failures:
        stability = failure.name in ("stability", "min_phase_margin_deg", "min_gain_margin_db")
        # Margins have default limits: what is not said in the file cannot be where its finding stands.
        name = "circular_deviation_mm" if failure.name == "constant_speed_deg" else failure.name
        said = name in subject.profile.tolerance.model_fields_set
        key = f"tolerance.{name}" if said else "servo.position_gain_per_s"
        cure = "; lower servo.position_gain_per_s or what delays the loop" if stability else ""
        if failure.name in CONTOUR_MEASURES:
            cure = attack
        yield "BP202" if stability else "BP201", RuleProblem(key, f"{failure.text}{cure}")


def _key_of(name: str, profile: Profile) -> str:
    """Key of a parameter of the servo core, where the file says it."""
    for section in _NAMED:
        if name in getattr(profile, section).model_fields_set:
            return f"{section}.{name}"
    return "servo" if "servo" in profile.model_fields_set else "circle"


def answered(subject: Subject, problems: Sequence[tuple[str, RuleProblem]]) -> set[str]:
    """Codes of the rules that have an answer: none without a test, one alone where the test could not be run."""
    if subject.profile.asks_for_circle and not subject.deciding.fits:
        return set()
    impossible = {code for code, _ in problems if code == "BP203"}
    return impossible or {rule.code for rule in RULES}


RULES: Final = (
    Rule(
        "BP201",
        "circle-tolerance",
        "error",
        "the circle misses a tolerance",
        "The circle test of this profile, at its own period, does not hold a contour tolerance of [tolerance]. "
        "`busplan circle-test PROFILE --contributions` ranks what makes it so.",
    ),
    Rule(
        "BP202",
        "no-stability-margin",
        "error",
        "the position loop lacks its stability margin",
        "The discrete position loop, with everything that delays it, is unstable or has less phase or gain margin "
        "than [tolerance] asks for. Delay inside a loop makes its circle better while it eats the margin, so no "
        "circle passes without one.",
    ),
    Rule(
        "BP203",
        "circle-impossible",
        "error",
        "the circle test cannot be run",
        "The values of [servo] and [circle] do not go together: the period is no multiple of the step, the drive "
        "cannot reach the feed, or the circle is too short for its ramps.",
    ),
)
