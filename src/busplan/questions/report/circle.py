"""Parts of a page on the circle test: verdict, drawing, figures, ranked error sources."""

from collections.abc import Iterator
from typing import Final

from busplan.forms.blocks import Block, Chapter, Facts, Question, Sentence, Words, attribute_value
from busplan.questions.circle.figures import CIRCLE_BY_KEY
from busplan.questions.circle.report import (
    ACT_TOGETHER,
    NO_SOURCES,
    circle_drawing,
    circle_sentences,
    circle_table,
    contributions_table,
    servo_sentence,
    verdict_words,
)
from busplan.questions.report.all_answers import AllAnswers
from busplan.questions.report.commands import Sources

_QUESTION: Final = "Is the circle still round?"
_KEYS: Final = (
    *("mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm"),
    *("phase_margin_deg", "gain_margin_db"),
)


def circle_question(answer: AllAnswers) -> Question:
    """The question whether the circle is round, with its verdict."""
    result = answer.circle_figures
    if result is None:
        return Question(
            _QUESTION,
            Words("CANNOT BE RUN", "fails") if answer.no_circle else Words("NOT RUN", "neutral"),
            tuple(Sentence((why,)) for why in _why_not(answer)),
            Facts(()),
        )
    known = (key for key in _KEYS if getattr(result, key) is not None)
    facts = ((CIRCLE_BY_KEY[key].label, attribute_value(CIRCLE_BY_KEY[key], result)) for key in known)
    return Question(
        _QUESTION,
        verdict_words(result),
        (*circle_sentences(answer.profile, result), *servo_sentence(answer.profile, result)),
        Facts(tuple(facts)),
    )


def _why_not(answer: AllAnswers) -> tuple[str, ...]:
    if answer.no_circle:
        return tuple(f"The circle test cannot be run: {why}." for why in answer.no_circle)
    if answer.profile.asks_for_circle:
        return ("The circle test was left out (--no-circle).",)
    return ("The profile has no section for a circle test, so none was run.",)


def circle_part(answer: AllAnswers, sources: Sources) -> Chapter:
    """The magnified circle and its figures."""
    return Chapter(Sentence(("The circle",)), tuple(_circle(answer, sources)), "circle")


def _circle(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    result = answer.circle_figures
    if result is None:
        yield from (Sentence((why,)) for why in _why_not(answer))
        return
    yield circle_drawing(answer.contour, result, answer.profile)
    yield circle_table((result,))
    yield sources["circle"].line


def sources_part(answer: AllAnswers, sources: Sources) -> Chapter | None:
    """The ranked error sources; None without a simulation."""
    result = answer.circle_figures
    if result is None or result.contributions is None:
        return None
    title = Sentence(("What to attack",))
    if not result.contributions:
        return Chapter(title, (NO_SOURCES,), "sources")
    return Chapter(title, (contributions_table(result), ACT_TOGETHER, sources["circle"].line), "sources")
