"""The verdict of a circle test in sentences."""

from collections.abc import Iterator

from busplan.analysis.circle.failures import MARGINS, Stated
from busplan.analysis.circle.figures import CIRCLE_BY_KEY
from busplan.analysis.circle.roundness import CircleFigures, failed_measure, to_attack
from busplan.forms.blocks import Code, Part, Sentence, ShownValue, State, Words, figure_value, joined, sentence
from busplan.forms.numbers import period_value
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


def circle_sentences(
    profile: Profile, result: CircleFigures, *, at: str, with_contributions: bool = True
) -> Iterator[Sentence]:
    """Say whether the circle holds what it must, what it does not hold, and which error source to attack first.

    Parameters
    ----------
    profile
        The network and its tolerances.
    result
        The circle test at one period.
    at
        JSON pointer to its figures.
    with_contributions
        If True, the document ranks the error sources.
    """
    period, feed = setup_values(result, at=at)
    subject = (Code(profile.name), " at ", period, " and ", feed)
    verdict = verdict_words(result)
    if result.failures:
        yield Sentence((*subject, ": ", verdict, ", ", *failure_words(result, at=at).parts, "."), verdict.state)
        yield from _attack(result, at=at, with_contributions=with_contributions)
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


def _attack(result: CircleFigures, *, at: str, with_contributions: bool) -> Iterator[Sentence]:
    """Say which error source to attack first for the first contour measure that fails."""
    measure, attack = failed_measure(result), to_attack(result)
    if measure is None:
        return
    label = CIRCLE_BY_KEY[measure].label
    if attack is not None:
        source, removed_mm = attack
        place = (result.contributions or ()).index(source)
        left = f"{at}/contributions/{place}/{measure}" if with_contributions else ""
        yield sentence(
            f"Attack {source_words(source.source)} first: without it the {label} is {{}}, {{}} less.",
            figure_value(CIRCLE_BY_KEY[measure], getattr(source, measure), at=left),
            ShownValue(removed_mm, "removed_mm", "um", 3),
        )
    elif result.contributions is not None:
        yield Sentence((f"No single error source of the profile explains the {label}.",))


def setup_values(result: CircleFigures, *, at: str) -> tuple[ShownValue, ShownValue]:
    """The period and the feed of a test.

    Parameters
    ----------
    result
        The circle test at one period.
    at
        JSON pointer to its figures.
    """
    feed = figure_value(CIRCLE_BY_KEY["feed_mm_per_min"], result.feed_mm_per_min, at=f"{at}/feed_mm_per_min")
    return period_value(result.period_us, at=f"{at}/period_us"), feed


def failure_words(result: CircleFigures, *, at: str) -> Sentence:
    """What the circle does not hold, without a full stop.

    Parameters
    ----------
    result
        The circle test at one period, which fails.
    at
        JSON pointer to its figures.
    """
    each = (Sentence(tuple(_part(part, result, at=at) for part in one.parts())) for one in result.failures)
    return joined(*each, by=", and ")


def _part(part: str | Stated, result: CircleFigures, *, at: str) -> Part:
    if isinstance(part, str):
        return part
    known = getattr(result, part.key, None) == part.value
    return ShownValue(part.value, part.key, part.unit, part.decimals, at=f"{at}/{part.key}" if known else "")


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
