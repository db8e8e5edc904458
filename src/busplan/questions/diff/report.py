"""Answer of `busplan diff`."""

from collections.abc import Iterator
from functools import partial
from typing import Final

from busplan.buses.figure import PERIOD, TIMING_MODEL
from busplan.forms.blocks import (
    Block,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    Words,
    count_value,
    figure_value,
    joined,
    sentence,
)
from busplan.forms.columns import sentence_text
from busplan.forms.numbers import nouns
from busplan.questions.diff.changes import change_document, change_table
from busplan.questions.diff.difference import CircleSide, ComparedFigure, Difference
from busplan.questions.diff.headline import STATES, headline, named
from busplan.questions.fit.circle_refusal import circle_refusals
from busplan.questions.words.documents import document
from busplan.questions.words.sentences import execution_grades, not_applicable, refused_circle
from busplan.sections.profile import Profile

Arguments = tuple[str, str]
"""A and B as they were typed."""

_SIDES: Final = (
    TableColumn("", kind="words"),
    TableColumn("given as", kind="words", wraps=True),
    TableColumn("name", kind="words", wraps=True),
    TableColumn(PERIOD.label, PERIOD.unit),
    TableColumn(TIMING_MODEL.label, kind="words"),
)
_FIGURES: Final = (
    TableColumn("figure", kind="words"),
    TableColumn("of", kind="words"),
    TableColumn("unit", kind="words"),
    TableColumn("A"),
    TableColumn("B"),
    TableColumn("B - A"),
    TableColumn("relative", "%", rank=1),
    TableColumn("B is", kind="words"),
)
_MOST_KEYS: Final = 20
"""Most keys shown to a reader; JSON lists all."""


def diff_report(found: Difference, *, arguments: Arguments) -> Report:
    """Report of `diff`.

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


def diff_document(found: Difference, *, arguments: Arguments) -> JsonDocument:
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
        verdict=sentence_text(headline(found)),
        same=not found.keys,
        changes=[change_document(one) for one in found.keys],
        figures=diff_records(found),
    )


def diff_records(found: Difference) -> list[Record]:
    """One row for each figure, whatever its judgement."""
    return [_figure_record(figure) for figure in found.figures]


def _blocks(found: Difference, arguments: Arguments) -> Iterator[Block]:
    """The verdict, the two sides, the keys that differ, and the figures that differ."""
    yield headline(found)
    yield _sides(found, arguments)
    if not found.keys:
        yield from refused_circle(found.a)
        return
    yield from _notes(found)
    yield change_table(found.keys[:_MOST_KEYS])
    hidden = len(found.keys) - _MOST_KEYS
    if hidden > 0:
        yield sentence(f"And {{}} more {nouns(hidden, 'key')}.", count_value(hidden))
    # If one side has no circle, a note says why, and its figures need no rows.
    shown = [one for one in found.figures if one.judgement != "neutral" or None not in (one.a, one.b)]
    if any(one.judgement != "same" for one in shown):
        yield Table(_FIGURES, tuple(map(_row, shown)), heads=3)
    same = len(named([one for one in shown if one.judgement == "same"], found))
    if same:
        are = "is" if same == 1 else "are"
        yield sentence(f"{{}} {nouns(same, 'figure')} {are} the same.", count_value(same))


def _sides(found: Difference, arguments: Arguments) -> Table:
    rows = (
        TableRow(
            (
                side,
                Code(argument),
                Code(profile.name),
                figure_value(PERIOD, profile.cycle.period_us),
                profile.bus.timing_model,
            )
        )
        for side, argument, profile in zip("AB", arguments, (found.a, found.b), strict=True)
    )
    return Table(_SIDES, tuple(rows))


def _notes(found: Difference) -> Iterator[Sentence]:
    """Say why a circle fails or has no figures, and how well the inputs of the figures are known."""
    for side, profile in zip("AB", (found.a, found.b), strict=True):
        yield from (joined(sentence(f"{side}:"), one) for one in not_applicable(profile))
    executions = (execution_grades(found.a), execution_grades(found.b))
    yield from _graded("execution time behind these figures is", *executions)
    if found.circles is None:
        yield from (
            joined(sentence(f"{side}:"), words)
            for side, profile in zip("AB", (found.a, found.b), strict=True)
            for words in refused_circle(profile)
        )
        return
    for side, circle in zip("AB", found.circles, strict=True):
        if circle.problems:
            state = "FAILED" if circle.simulated else "is not simulated"
            yield Sentence((f"The circle of {side} {state}: {', and '.join(circle.problems)}.",), "warns")
    if any(circle.simulated for circle in found.circles):
        grades = (one.servo.grades_given[0] for one in (found.a, found.b))
        yield from _graded("servo values behind the circle's figures are", *grades)


def _graded(words: str, a: str | None, b: str | None) -> Iterator[Sentence]:
    """Say how well something is known on each side; nothing if neither side has a grade."""
    if a or b:
        of_a, of_b = a or "not graded", b or "not graded"
        text = of_a if of_a == of_b else f"{of_a} in A and {of_b} in B"
        yield sentence(f"The {words} {text}.", state="warns" if "assumed" in text else "neutral")


def _row(one: ComparedFigure) -> TableRow:
    figure = one.figure
    a, b, difference = (figure_value(figure, getattr(one, key)) for key in ("a", "b", "difference"))
    relative = ShownValue(one.relative_difference, "relative_difference", "%", 1, signed=True)
    judged = Words(one.judgement, STATES[one.judgement])
    cells = (figure.label, one.part, b.unit, a, b, difference._replace(signed=True), relative, judged)
    return TableRow(cells, is_detail=one.judgement == "same")


def _side_document(argument: str, profile: Profile, circle: CircleSide | None) -> JsonDocument:
    return {
        "argument": argument,
        "profile": profile.name,
        "timing_model": profile.bus.timing_model,
        "circle_problems": None if circle is None else list(circle.problems),
        "circle_refused_by": [cause.name for cause in circle_refusals(profile)],
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
