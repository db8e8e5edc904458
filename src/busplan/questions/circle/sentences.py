"""The verdict of a circle test in sentences."""

from collections.abc import Iterator

from busplan.forms.blocks import Code, Part, Sentence, ShownValue, State, Words, attribute_value, joined, sentence
from busplan.forms.numbers import period_value
from busplan.questions.circle.failures import MARGINS, Stated
from busplan.questions.circle.figures import CIRCLE_BY_KEY
from busplan.questions.circle.record import CircleFigures
from busplan.questions.circle.roundness import failed_measure, to_attack
from busplan.sections.profile import Profile


def verdict_words(result: CircleFigures) -> Words:
    """The verdict in a word or two.

    Parameters
    ----------
    result
        The circle test at one period.
    """
    if result.stable is None:
        return Words("NOT RUN", "fails")
    if result.passed is None:
        return Words("NOT JUDGED", "warns")
    return Words("PASSED", "passes") if result.passed else Words("FAILED", "fails")


def circle_sentences(profile: Profile, result: CircleFigures) -> Iterator[Sentence]:
    """Say whether the circle holds what it must, what it does not hold, and which error source to attack first.

    Parameters
    ----------
    profile
        The network and its tolerances.
    result
        The circle test at one period.
    """
    period, feed = setup_values(result)
    subject = (Code(profile.name), " at ", period, " and ", feed)
    verdict = verdict_words(result)
    if result.failures:
        yield Sentence((*subject, ": ", verdict, ", ", *failure_words(result).parts, "."), verdict.state)
        yield from _attack(result)
        return
    said = "the circle holds every tolerance" if result.passed else f"{verdict.text}: no contour tolerance is asked for"
    yield Sentence((*subject, ": ", Words(said, verdict.state), "."), verdict.state)
    yield sentence(
        "The loop is stable, with a phase margin of {}{} or more and a gain margin of {}{} or more.",
        *(
            part
            for key, unit in MARGINS.items()
            for part in (
                ShownValue(getattr(profile.tolerance, key), key, unit, None),
                "" if key in profile.tolerance.model_fields_set else " (default)",
            )
        ),
    )


def _attack(result: CircleFigures) -> Iterator[Sentence]:
    """Say which error source to attack first for the first contour measure that fails."""
    measure, attack = failed_measure(result), to_attack(result)
    if measure is None:
        return
    label = CIRCLE_BY_KEY[measure].label
    if attack is not None:
        source, removed_mm = attack
        yield sentence(
            f"Attack {source_words(source.source)} first: without it the {label} is {{}}, {{}} less.",
            attribute_value(CIRCLE_BY_KEY[measure], source),
            ShownValue(removed_mm, "removed_mm", "um", 3),
        )
    elif result.contributions is not None:
        yield Sentence((f"No single error source of the profile explains the {label}.",))


def setup_values(result: CircleFigures) -> tuple[ShownValue, ShownValue]:
    """The period and the feed of a test.

    Parameters
    ----------
    result
        The circle test at one period.
    """
    return period_value(result.period_us), attribute_value(CIRCLE_BY_KEY["feed_mm_per_min"], result)


def failure_words(result: CircleFigures) -> Sentence:
    """What the circle does not hold, without a full stop.

    Parameters
    ----------
    result
        The circle test at one period, which fails.
    """
    each = (Sentence(tuple(map(_part, one.parts()))) for one in result.failures)
    return joined(*each, by=", and ")


def _part(part: str | Stated) -> Part:
    if isinstance(part, str):
        return part
    return ShownValue(part.value, part.key, part.unit, part.decimals)


def servo_sentence(profile: Profile, result: CircleFigures) -> Iterator[Sentence]:
    """Say how the servo values behind the figures are known; nothing without a simulation.

    Parameters
    ----------
    profile
        The profile.
    result
        The circle test at one period.
    """
    if result.stable is None:
        return
    if result.ideal_drive:
        yield Sentence(("The profile has no [servo]: an ideal drive was simulated.",), "warns")
        return
    state: State = "warns" if result.servo_grade == "assumed" else "neutral"
    yield Sentence((f"The servo values that the profile gives are {profile.servo.grades_text}.",), state)


def source_words(source: str) -> str:
    """Name of an error source in words."""
    return source.replace("_", " ")
