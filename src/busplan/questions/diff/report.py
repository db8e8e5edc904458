"""Answer of `busplan diff`: its headline, keys and figures that differ, and its document."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import takewhile
from operator import eq
from typing import Final

from busplan.buses.figure import PERIOD, TIMING_MODEL
from busplan.forms.blocks import (
    Block,
    Cell,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    State,
    Table,
    TableColumn,
    TableRow,
    Words,
    count_value,
    figure_value,
    joined,
    sentence,
)
from busplan.forms.numbers import MISSING, figure_text, nouns, plural, sentence_text
from busplan.printable import json_text
from busplan.profile.keys import KeyValue
from busplan.profile.write import value_text
from busplan.questions.diff.difference import CircleSide, ComparedFigure, Difference, Judgement, KeyDifference
from busplan.questions.fit.circle_refusal import circle_refusals
from busplan.questions.fit.network import bus_of, model_names, network_of
from busplan.questions.words.documents import document, fields
from busplan.questions.words.sentences import execution_grades, not_applicable, refused_circle
from busplan.sections.profile import Profile

_COLUMNS: Final = (
    TableColumn("key", kind="words", wraps=True),
    *(TableColumn(heading, kind="words", wraps=True) for heading in ("A", "B")),
)
_ALL_DIGITS: Final = 17
"""Digits that distinguish any two floats."""
_MOST_ITEMS: Final = 8
"""Longest list shown in full."""
_MOST_CHARACTERS: Final = 40
"""Longest text shown in full."""
_CONTEXT: Final = 8
"""Characters shown before the first one that differs."""


def change_table(keys: Iterable[KeyDifference]) -> Table:
    """One row for each key: its values in A and B, with a note if a value is a default."""
    rows = (
        (
            Code(difference.key),
            _cell(difference.key, difference.a, difference.b),
            _cell(difference.key, difference.b, difference.a),
        )
        for difference in keys
    )
    return Table(_COLUMNS, tuple(map(TableRow, rows)))


def _cell(key: str, value: KeyValue | None, opposite: KeyValue | None) -> Cell:
    """One side of a difference; the other side decides which part or how many digits of a long value are shown."""
    if value is None:
        return MISSING
    own, beside = value.value, None if opposite is None else opposite.value
    shown: ShownValue | Code
    if isinstance(own, int | float) and not isinstance(own, bool):
        shown = ShownValue(own, key)
        if (
            own != beside
            and isinstance(beside, int | float)
            and figure_text(shown) == figure_text(shown._replace(value=beside))
        ):
            shown = shown._replace(digits=_ALL_DIGITS)
    else:
        shown = Code(shown_value(own, beside))
    return shown if value.source == "file" else Sentence((shown, " (default)"))


def shown_value(value: object, opposite: object = None) -> str:
    """Write a value as TOML; of a long one, only the part that differs from the other.

    Examples
    --------
    >>> shown_value(4000.0), shown_value(None), shown_value("S400"), shown_value(False), shown_value(["sdo"])
    ('4000', 'none', '"S400"', 'false', '["sdo"]')
    >>> shown_value((1, 2, 3, 4, 5, 6, 7, 8, 10), (1, 2, 3, 4, 5, 6, 7, 9, 10))
    '[7 alike, 8, 1 alike]'
    """
    match value:
        case None:
            return "none"
        case str():
            return _text(value, opposite if isinstance(opposite, str) else "")
        case tuple() | list():
            return _list(tuple(value), tuple(opposite) if isinstance(opposite, tuple | list) else ())
        case bool():
            return value_text(value)
        case float():
            return repr(value).removesuffix(".0")
    return str(value)


def _alike(left: Sequence[object], right: Sequence[object]) -> int:
    """Length of the common beginning of two sequences."""
    return sum(takewhile(bool, map(eq, left, right)))


def _list(items: tuple[object, ...], opposite: tuple[object, ...]) -> str:
    if len(items) <= _MOST_ITEMS:
        return f"[{', '.join(map(shown_value, items))}]"
    before = _alike(items, opposite)
    after = _alike(items[before:][::-1], opposite[before:][::-1])
    middle = items[before : len(items) - after]
    more = len(middle) - _MOST_ITEMS
    parts = (
        *([f"{before} alike"] if before else []),
        *map(shown_value, middle[:_MOST_ITEMS]),
        *([f"{more} more"] if more > 0 else []),
        *([f"{after} alike"] if after else []),
    )
    return f"[{', '.join(parts)}]"


def _text(text: str, opposite: str) -> str:
    if len(text) <= _MOST_CHARACTERS:
        return json_text(text)
    start = max(0, _alike(text, opposite) - _CONTEXT)
    end = start + _MOST_CHARACTERS
    piece = json_text(text[start:end])
    return f"{'..' if start else ''}{piece}{'..' if end < len(text) else ''}"


def change_document(difference: KeyDifference) -> JsonDocument:
    """A difference as plain data, both values in full."""
    return {
        "key": difference.key,
        "a": difference.a and difference.a.value,
        "a_source": "absent" if difference.a is None else difference.a.source,
        "b": difference.b and difference.b.value,
        "b_source": "absent" if difference.b is None else difference.b.source,
    }


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


def headline(difference: Difference) -> Sentence:
    """The verdict: where B is worse, and where it is better."""
    if not difference.keys:
        return sentence("A and B are the same profile: every key has the same value.")
    verdicts = [
        verdict
        for judgement in ("worse", "better")
        for verdict in (*_loud(difference, judgement), *_counted(difference, judgement))
    ]
    if verdicts:
        said = joined(*verdicts, by="; ")
        return said._replace(parts=(*said.parts, "."))
    keys = len(difference.keys)
    figures = "and only figures that are neither" if difference.judged("neutral") else "and no figure"
    return sentence(
        f"B is neither better nor worse: {{}} {nouns(keys, 'key')} {'differs' if keys == 1 else 'differ'}, {figures}.",
        count_value(keys),
    )


def _loud_figures(difference: Difference) -> dict[str, dict[Judgement, str]]:
    """Sentences for the figures that have their own, apart from whether the cycle fits."""
    loud: dict[str, dict[Judgement, str]] = {}
    for bus in (bus_of(difference.a), bus_of(difference.b)):
        if bus.safety.figure is not None:
            loud[bus.safety.figure.key] = {
                "worse": f"B has an unsafe {bus.safety.setting} where A has a safe one",
                "better": f"B has a safe {bus.safety.setting} where A has an unsafe one",
            }
    return {**loud, "passed": _PASSES}


def _loud(difference: Difference, judgement: Judgement) -> Iterator[Sentence]:
    figures = difference.judged(judgement)
    judged = {compared.figure.key for compared in figures}
    models = " and ".join(compared.part for compared in figures if compared.figure.key == "fits")
    state = STATES[judgement]
    if "shown_to_fit" in judged:
        yield sentence(_SHOWN[judgement], state=state)
    elif models:
        form = f"{_FITS[judgement]} by the closed form of {models}, which does not change the verdict"
        yield sentence(form, state=state)
    for key, words in _loud_figures(difference).items():
        if key in judged:
            yield sentence(words[judgement], state=state)


def _counted(difference: Difference, judgement: Judgement) -> Iterator[Sentence]:
    told = {"shown_to_fit", "verdict", "fits", *_loud_figures(difference)}
    names = named(
        [compared for compared in difference.judged(judgement) if compared.figure.key not in told], difference
    )
    if not names:
        return
    said = sentence(
        f"B is {judgement} in {{}} {nouns(len(names), 'figure')}: {', '.join(names[:_MOST_NAMED])}",
        count_value(len(names)),
        state=STATES[judgement],
    )
    hidden = len(names) - _MOST_NAMED
    yield joined(said, sentence("and {} more", count_value(hidden))) if hidden > 0 else said


def named(figures: Sequence[ComparedFigure], difference: Difference) -> list[str]:
    """Names of figures, each once, with the timing model if only one judges it so."""
    models = {*model_names(difference.a), *model_names(difference.b)}
    parts: dict[str, list[str]] = {}
    for compared in figures:
        parts.setdefault(compared.figure.label, []).append(compared.part)
    return [f"{label} ({of[0]})" if len(of) == 1 and of[0] in models else label for label, of in parts.items()]


def regression_words(difference: Difference, regressions: Sequence[ComparedFigure], *, tolerance: float) -> str:
    """Message that lists the regressions."""
    by = f" by more than {tolerance:.12g} %" if tolerance else ""
    names = named(regressions, difference)
    return f"regression: B is worse{by} in {plural(len(names), 'figure')}: {', '.join(names)}"


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


def diff_report(difference: Difference, *, arguments: Arguments) -> Report:
    """Report of `diff`.

    Parameters
    ----------
    difference
        The difference.
    arguments
        A and B as they were typed.
    """
    a, b = map(Code, arguments)
    return Report(
        Sentence(("Changes from ", a, " to ", b)),
        tuple(_blocks(difference, arguments)),
        diff_document(difference, arguments=arguments),
        diff_records(difference),
    )


def diff_document(difference: Difference, *, arguments: Arguments) -> JsonDocument:
    """Document of `busplan diff --format json`.

    Parameters
    ----------
    difference
        The difference.
    arguments
        A and B as they were typed.
    """
    circles = difference.circles or (None, None)
    a, b = (
        _side_document(argument, profile, circle)
        for argument, profile, circle in zip(arguments, (difference.a, difference.b), circles, strict=True)
    )
    return document(
        "diff",
        a=a,
        b=b,
        verdict=sentence_text(headline(difference)),
        same=not difference.keys,
        changes=[change_document(change) for change in difference.keys],
        figures=diff_records(difference),
    )


def diff_records(difference: Difference) -> list[Record]:
    """One row for each figure, whatever its judgement."""
    return [_figure_record(figure) for figure in difference.figures]


def _blocks(difference: Difference, arguments: Arguments) -> Iterator[Block]:
    """The verdict, the two sides, the keys that differ, and the figures that differ."""
    yield headline(difference)
    yield _sides(difference, arguments)
    if not difference.keys:
        yield from refused_circle(difference.a)
        return
    yield from _notes(difference)
    yield change_table(difference.keys[:_MOST_KEYS])
    hidden = len(difference.keys) - _MOST_KEYS
    if hidden > 0:
        yield sentence(f"And {{}} more {nouns(hidden, 'key')}.", count_value(hidden))
    # If one side has no circle, a note says why, and its figures need no rows.
    shown = [
        figure for figure in difference.figures if figure.judgement != "neutral" or None not in (figure.a, figure.b)
    ]
    if any(compared.judgement != "same" for compared in shown):
        yield Table(_FIGURES, tuple(map(_row, shown)), heads=3)
    same = len(named([compared for compared in shown if compared.judgement == "same"], difference))
    if same:
        are = "is" if same == 1 else "are"
        yield sentence(f"{{}} {nouns(same, 'figure')} {are} the same.", count_value(same))


def _sides(difference: Difference, arguments: Arguments) -> Table:
    rows = (
        TableRow(
            (
                side,
                Code(argument),
                Code(profile.name),
                figure_value(PERIOD, profile.cycle.period_us if profile.has_cycle else None),
                profile.bus.timing_model,
            )
        )
        for side, argument, profile in zip("AB", arguments, (difference.a, difference.b), strict=True)
    )
    return Table(_SIDES, tuple(rows))


def _notes(difference: Difference) -> Iterator[Sentence]:
    """Say why a circle fails or has no figures, and how well the inputs of the figures are known."""
    for side, profile in zip("AB", (difference.a, difference.b), strict=True):
        yield from (joined(sentence(f"{side}:"), reason) for reason in not_applicable(network_of(profile)))
    executions = (execution_grades(difference.a), execution_grades(difference.b))
    yield from _graded("execution time behind these figures is", *executions)
    if difference.circles is None:
        yield from (
            joined(sentence(f"{side}:"), words)
            for side, profile in zip("AB", (difference.a, difference.b), strict=True)
            for words in refused_circle(profile)
        )
        return
    for side, circle in zip("AB", difference.circles, strict=True):
        if circle.problems:
            state = "FAILED" if circle.simulated else "is not simulated"
            yield Sentence((f"The circle of {side} {state}: {', and '.join(circle.problems)}.",), "warns")
    if any(circle.simulated for circle in difference.circles):
        grades = (profile.servo.grades_given[0] for profile in (difference.a, difference.b))
        yield from _graded("servo values behind the circle's figures are", *grades)


def _graded(words: str, a: str | None, b: str | None) -> Iterator[Sentence]:
    """Say how well something is known on each side; nothing if neither side has a grade."""
    if a or b:
        of_a, of_b = a or "not graded", b or "not graded"
        text = of_a if of_a == of_b else f"{of_a} in A and {of_b} in B"
        yield sentence(f"The {words} {text}.", state="warns" if "assumed" in text else "neutral")


def _row(compared: ComparedFigure) -> TableRow:
    figure = compared.figure
    a, b, difference = (figure_value(figure, getattr(compared, key)) for key in ("a", "b", "difference"))
    relative = ShownValue(compared.relative_difference, "relative_difference", "%", 1, signed=True)
    judged = Words(compared.judgement, STATES[compared.judgement])
    cells = (figure.label, compared.part, b.unit, a, b, difference._replace(signed=True), relative, judged)
    return TableRow(cells, is_detail=compared.judgement == "same")


def _side_document(argument: str, profile: Profile, circle: CircleSide | None) -> JsonDocument:
    return {
        "argument": argument,
        "profile": profile.name,
        "timing_model": profile.bus.timing_model,
        "circle_problems": None if circle is None else list(circle.problems),
        "circle_refused_by": [cause.name for cause in circle_refusals(profile)],
    }


def _figure_record(compared: ComparedFigure) -> Record:
    return {
        "part": compared.part,
        "figure": compared.figure.key,
        "better": compared.figure.better,
        **fields(compared, "a", "b", "difference", "relative_difference", "judgement"),
    }
