"""Rules of the circle test: does the loop have its margin, does the circle hold its tolerances?

They share one run of the test, made only for profiles that say something of servo, circle or tolerance.
"""

from collections.abc import Iterator
from typing import Final

from busplan.errors import BusplanError
from busplan.rules.finding import Problem, Rule, Subject

_KEYS: Final = {"stability": "servo.position_gain_per_s"}


def circle_problems(subject: Subject) -> Iterator[tuple[str, Problem]]:
    """Run the circle test of a profile: the code of each rule that is broken, with its problem.

    A cycle that does not fit has its own rule, and no circle.
    """
    from busplan.analysis.circle_test import circle_test

    if not subject.profile.asks_for_circle or not subject.deciding.fits:
        return
    try:
        result = circle_test(subject.profile).results[0]
    except BusplanError as error:
        for message in error.problems:
            yield "BP203", Problem("servo" if "servo" in subject.profile.model_fields_set else "circle", message)
        return
    worst = result.contributions[0] if result.contributions else None
    attack = f"; attack {worst.source} first" if worst is not None and worst.removed_mm > 0 else ""
    for failure in result.failures:
        stability = failure.name in ("stability", "min_phase_margin_deg", "min_gain_margin_db")
        key = _KEYS.get(failure.name, f"tolerance.{failure.name}")
        cure = "; lower servo.position_gain_per_s or what delays the loop" if stability else attack
        yield "BP202" if stability else "BP201", Problem(key, f"{failure.text}{cure}")


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
