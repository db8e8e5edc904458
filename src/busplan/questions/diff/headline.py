"""Headline of a difference: where B is worse than A, and where it is better."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.forms.blocks import Sentence, State, count_value, joined, sentence
from busplan.forms.numbers import nouns, plural
from busplan.questions.diff.difference import ComparedFigure, Difference, Judgement
from busplan.questions.fit.network import bus_of, model_names

STATES: Final[dict[Judgement, State]] = {
    "worse": "fails",
    "better": "passes",
    "same": "neutral",
    "neutral": "neutral",
}
"""State of a judgement on B."""
_SHOWN: Final[dict[Judgement, str]] = {
    "worse": "B is not shown to fit where A is",
    "better": "B is shown to fit where A is not",
}
_FITS: Final[dict[Judgement, str]] = {"worse": "B does not fit where A does", "better": "B fits where A does not"}
_PASSES: Final[dict[Judgement, str]] = {
    "worse": "B does not pass the circle where A does",
    "better": "B passes the circle where A does not",
}
_MOST_NAMED: Final = 4
"""Most figures that a headline names."""


def headline(found: Difference) -> Sentence:
    """The verdict: where B is worse, and where it is better."""
    if not found.keys:
        return sentence("A and B are the same profile: every key has the same value.")
    verdicts = [
        one for judgement in ("worse", "better") for one in (*_loud(found, judgement), *_counted(found, judgement))
    ]
    if verdicts:
        said = joined(*verdicts, by="; ")
        return said._replace(parts=(*said.parts, "."))
    keys = len(found.keys)
    figures = "and only figures that are neither" if found.judged("neutral") else "and no figure"
    return sentence(
        f"B is neither better nor worse: {{}} {nouns(keys, 'key')} {'differs' if keys == 1 else 'differ'}, {figures}.",
        count_value(keys),
    )


def _loud_figures(found: Difference) -> dict[str, dict[Judgement, str]]:
    """Sentences for the figures that have their own, apart from whether the cycle fits."""
    loud: dict[str, dict[Judgement, str]] = {}
    for bus in (bus_of(found.a), bus_of(found.b)):
        if bus.safety.figure is not None:
            loud[bus.safety.figure.key] = {
                "worse": f"B has an unsafe {bus.safety.setting} where A has a safe one",
                "better": f"B has a safe {bus.safety.setting} where A has an unsafe one",
            }
    return {**loud, "passed": _PASSES}


def _loud(found: Difference, judgement: Judgement) -> Iterator[Sentence]:
    figures = found.judged(judgement)
    judged = {one.figure.key for one in figures}
    models = " and ".join(one.part for one in figures if one.figure.key == "fits")
    state = STATES[judgement]
    if "shown_to_fit" in judged:
        yield sentence(_SHOWN[judgement], state=state)
    elif models:
        form = f"{_FITS[judgement]} by the closed form of {models}, which does not change the verdict"
        yield sentence(form, state=state)
    for key, words in _loud_figures(found).items():
        if key in judged:
            yield sentence(words[judgement], state=state)


def _counted(found: Difference, judgement: Judgement) -> Iterator[Sentence]:
    told = {"shown_to_fit", "verdict", "fits", *_loud_figures(found)}
    names = named([one for one in found.judged(judgement) if one.figure.key not in told], found)
    if not names:
        return
    said = sentence(
        f"B is {judgement} in {{}} {nouns(len(names), 'figure')}: {', '.join(names[:_MOST_NAMED])}",
        count_value(len(names)),
        state=STATES[judgement],
    )
    hidden = len(names) - _MOST_NAMED
    yield joined(said, sentence("and {} more", count_value(hidden))) if hidden > 0 else said


def named(figures: Sequence[ComparedFigure], found: Difference) -> list[str]:
    """Names of figures, each once, with the timing model if only one judges it so."""
    models = {*model_names(found.a), *model_names(found.b)}
    parts: dict[str, list[str]] = {}
    for one in figures:
        parts.setdefault(one.figure.label, []).append(one.part)
    return [f"{label} ({of[0]})" if len(of) == 1 and of[0] in models else label for label, of in parts.items()]


def regression_words(found: Difference, regressions: Sequence[ComparedFigure], *, tolerance: float) -> str:
    """Message that lists the regressions."""
    by = f" by more than {tolerance:.12g} %" if tolerance else ""
    names = named(regressions, found)
    return f"regression: B is worse{by} in {plural(len(names), 'figure')}: {', '.join(names)}"
