"""Answer of `busplan diff`: for people, for a pull request, and as plain data."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from busplan.analysis.comparison.difference import CircleSide, ComparedFigure, Difference, Judgement
from busplan.analysis.network import bus_of, model_names
from busplan.answers.changes import change_document, change_table
from busplan.answers.documents import document
from busplan.buses.figure import PERIOD, TIMING_MODEL
from busplan.forms.blocks import (
    Block,
    Code,
    Column,
    Document,
    Record,
    Report,
    Row,
    Sentence,
    State,
    Table,
    Value,
    Words,
    count_value,
    figure_value,
    joined,
    sentence,
)
from busplan.forms.numbers import nouns, plural
from busplan.forms.terminal import sentence_text
from busplan.sections.profile import Profile

Arguments = tuple[str, str]
"""A and B as they were typed."""

_SIDES: Final = (
    Column("", kind="words"),
    Column("given as", kind="words"),
    Column("name", kind="words"),
    Column(PERIOD.label, PERIOD.unit),
    Column(TIMING_MODEL.label, kind="words"),
)
_FIGURES: Final = (
    Column("figure", kind="words"),
    Column("of", kind="words"),
    Column("unit", kind="words"),
    Column("A"),
    Column("B"),
    Column("B - A"),
    Column("relative", "%"),
    Column("B is", kind="words"),
)
_STATES: Final[dict[Judgement, State]] = {
    "worse": "fails",
    "better": "passes",
    "same": "neutral",
    "neutral": "neutral",
}
_FITS: Final[dict[Judgement, str]] = {"worse": "B does not fit where A does", "better": "B fits where A does not"}
_PASSES: Final[dict[Judgement, str]] = {
    "worse": "B does not pass the circle where A does",
    "better": "B passes the circle where A does not",
}
_MOST_NAMED: Final = 4
"""Figures that a headline names."""
_MOST_KEYS: Final = 20
"""Keys that a reader is shown: a comment on a pull request is no listing."""


def diff_report(found: Difference, *, arguments: Arguments) -> Report:
    """Answer the question of `diff`.

    Parameters
    ----------
    found
        The difference.
    arguments
        A and B as they were typed.
    """
    a, b = map(Code, arguments)
    return Report(
        Sentence(("Changes from ", a, " to ", b)),
        lambda: tuple(_blocks(found, arguments)),
        partial(diff_document, found, arguments=arguments),
        lambda: diff_records(found),
    )


def diff_document(found: Difference, *, arguments: Arguments) -> Document:
    """Document of `busplan diff --format json`.

    Parameters
    ----------
    found
        The difference.
    arguments
        A and B as they were typed.
    """
    circles = found.circles or (None, None)
    a, b = (
        _side_document(argument, profile, circle)
        for argument, profile, circle in zip(arguments, (found.a, found.b), circles, strict=True)
    )
    return document(
        "diff",
        a=a,
        b=b,
        verdict=sentence_text(_headline(found)),
        same=not found.keys,
        changes=[change_document(one) for one in found.keys],
        figures=diff_records(found),
    )


def diff_records(found: Difference) -> list[Record]:
    """One row a figure, whatever it is judged."""
    return [_figure_record(figure) for figure in found.figures]


def regression_words(found: Difference, regressions: Sequence[ComparedFigure], *, tolerance: float) -> str:
    """Say which figures fail a gate."""
    by = f" by more than {tolerance:.12g} %" if tolerance else ""
    names = _named(regressions, found)
    return f"regression: B is worse{by} in {plural(len(names), 'figure')}: {', '.join(names)}"


def _blocks(found: Difference, arguments: Arguments) -> Iterator[Block]:
    """The verdict, the two sides, the keys that differ, and the figures that do."""
    yield _headline(found)
    yield _sides(found, arguments)
    if not found.keys:
        return
    yield from _notes(found)
    yield change_table(found.keys[:_MOST_KEYS])
    hidden = len(found.keys) - _MOST_KEYS
    if hidden > 0:
        yield sentence(f"And {{}} more {nouns(hidden, 'key')}.", count_value(hidden))
    # Of a circle that one side has not, a note says why: it needs no rows.
    shown = [
        (at, one) for at, one in enumerate(found.figures) if one.judgement != "neutral" or None not in (one.a, one.b)
    ]
    rows = tuple(_row(one, f"/figures/{at}") for at, one in shown if one.judgement != "same")
    if rows:
        yield Table(_FIGURES, rows)
    same = len(_named([one for _, one in shown if one.judgement == "same"], found))
    if same:
        are = "is" if same == 1 else "are"
        yield sentence(
            f"{{}} {nouns(same, 'figure')} {are} the same: JSON and CSV list all figures.", count_value(same)
        )


def _headline(found: Difference) -> Sentence:
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
    """Figures that speak for themselves, beside whether it fits."""
    loud: dict[str, dict[Judgement, str]] = {}
    for bus in (bus_of(found.a), bus_of(found.b)):
        if bus.safety_figure is not None:
            loud[bus.safety_figure.key] = {
                "worse": f"B has an unsafe {bus.safety} where A has a safe one",
                "better": f"B has a safe {bus.safety} where A has an unsafe one",
            }
    return {**loud, "passed": _PASSES}


def _loud(found: Difference, judgement: Judgement) -> Iterator[Sentence]:
    figures = found.judged(judgement)
    judged = {one.figure.key for one in figures}
    models = " and ".join(one.part for one in figures if one.figure.key == "fits")
    state = _STATES[judgement]
    if "verdict_fits" in judged:
        timing = f"{models} timing" if models else "each by the timing that decides"
        yield sentence(f"{_FITS[judgement]} ({timing})", state=state)
    elif models:
        yield sentence(f"{_FITS[judgement]} ({models} timing, which does not change the verdict)", state=state)
    for key, words in _loud_figures(found).items():
        if key in judged:
            yield sentence(words[judgement], state=state)


def _counted(found: Difference, judgement: Judgement) -> Iterator[Sentence]:
    told = {"verdict_fits", "fits", *_loud_figures(found)}
    names = _named([one for one in found.judged(judgement) if one.figure.key not in told], found)
    if not names:
        return
    said = sentence(
        f"B is {judgement} in {{}} {nouns(len(names), 'figure')}: {', '.join(names[:_MOST_NAMED])}",
        count_value(len(names)),
        state=_STATES[judgement],
    )
    hidden = len(names) - _MOST_NAMED
    yield joined(said, sentence("and {} more", count_value(hidden))) if hidden > 0 else said


def _named(figures: Sequence[ComparedFigure], found: Difference) -> list[str]:
    """Names of figures, each once, with the timing model where that is not all of them."""
    models = {*model_names(found.a), *model_names(found.b)}
    parts: dict[str, list[str]] = {}
    for one in figures:
        parts.setdefault(one.figure.label, []).append(one.part)
    return [f"{label} ({of[0]})" if len(of) == 1 and of[0] in models else label for label, of in parts.items()]


def _sides(found: Difference, arguments: Arguments) -> Table:
    period = next(at for at, one in enumerate(found.figures) if one.figure.key == PERIOD.key)
    rows = (
        Row(
            (
                side,
                Code(argument),
                Code(profile.name),
                figure_value(PERIOD, profile.cycle.period_us, at=f"/figures/{period}/{side.lower()}"),
                profile.bus.timing_model,
            )
        )
        for side, argument, profile in zip("AB", arguments, (found.a, found.b), strict=True)
    )
    return Table(_SIDES, tuple(rows))


def _notes(found: Difference) -> Iterator[Sentence]:
    """Say why a circle fails or has no figures, and what the figures rest on."""
    executions = (found.a.node.execution.grade, found.b.node.execution.grade)
    yield from _graded("execution time behind these figures is", *executions)
    if found.circles is None:
        return
    for side, circle in zip("AB", found.circles, strict=True):
        if circle.problems:
            state = "FAILED" if circle.simulated else "is not simulated"
            yield Sentence((f"The circle of {side} {state}: {', and '.join(circle.problems)}.",), "warns")
    if any(circle.simulated for circle in found.circles):
        yield from _graded("servo values behind the circle's figures are", found.a.servo.grade, found.b.servo.grade)


def _graded(words: str, a: str | None, b: str | None) -> Iterator[Sentence]:
    """Say how well something is known on either side; nothing where nobody says."""
    if a or b:
        of_a, of_b = a or "not graded", b or "not graded"
        text = of_a if of_a == of_b else f"{of_a} in A and {of_b} in B"
        yield sentence(f"The {words} {text}.", state="warns" if "assumed" in (a, b) else "neutral")


def _row(one: ComparedFigure, at: str) -> Row:
    figure = one.figure
    a, b, difference = (figure_value(figure, getattr(one, key), at=f"{at}/{key}") for key in ("a", "b", "difference"))
    relative = Value(
        one.relative_difference, "relative_difference", "%", 1, signed=True, at=f"{at}/relative_difference"
    )
    judged = Words(one.judgement, _STATES[one.judgement])
    return Row((figure.label, one.part, b.unit, a, b, difference._replace(signed=True), relative, judged))


def _side_document(argument: str, profile: Profile, circle: CircleSide | None) -> Document:
    return {
        "argument": argument,
        "profile": profile.name,
        "timing_model": profile.bus.timing_model,
        "circle_problems": None if circle is None else list(circle.problems),
    }


def _figure_record(one: ComparedFigure) -> Record:
    return {
        "part": one.part,
        "figure": one.figure.key,
        "better": one.figure.better,
        "a": one.a,
        "b": one.b,
        "difference": one.difference,
        "relative_difference": one.relative_difference,
        "judgement": one.judgement,
    }
