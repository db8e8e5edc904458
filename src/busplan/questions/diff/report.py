"""Answer of `busplan diff`: a sentence, the keys and the figures that differ, and its document."""

from collections.abc import Iterator, Sequence
from itertools import takewhile
from operator import eq
from typing import Final

from busplan.english import listed, plural
from busplan.forms import blocks
from busplan.forms.numbers import MISSING, figure_text, sentence_text
from busplan.profile.edit import value_text
from busplan.profile.kinds import KeyValue
from busplan.questions.base.sentences import document, fields
from busplan.questions.diff import ComparedFigure, DiffAnswer, DiffSide, Judgement
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS

_KEYS: Final = (
    blocks.TableColumn("key", kind="words", wraps=True),
    *(blocks.TableColumn(heading, kind="words", wraps=True) for heading in ("A", "B")),
)
_FIGURES: Final = (
    blocks.TableColumn("figure", kind="words"),
    blocks.TableColumn("of", kind="words"),
    blocks.TableColumn("unit", kind="words"),
    blocks.TableColumn("A"),
    blocks.TableColumn("B"),
    blocks.TableColumn("B - A"),
    blocks.TableColumn("relative", "%", rank=1),
    blocks.TableColumn("B is", kind="words"),
)
_STATES: Final[dict[Judgement, blocks.State]] = {
    "worse": "fails",
    "better": "passes",
    "same": "neutral",
    "neutral": "neutral",
}
"""State of each judgement on B."""
_MOST_NAMED: Final = 4
"""Figures that the sentence names, at most."""
_MOST_KEYS: Final = 12
"""Keys shown to a reader without --all, at most; JSON lists all."""
_ALL_DIGITS: Final = 17
"""Digits that distinguish any two floats."""
_MOST_CHARACTERS: Final = 60
"""Length up to which a value is shown in full [characters]."""
_CONTEXT: Final = 8
"""Characters shown before the first one that differs."""


def diff_report(answer: DiffAnswer) -> blocks.Report:
    """Report of `diff`."""
    summary = _sentence(answer)
    records = [
        {
            "part": compared.part,
            "figure": compared.figure.key,
            "better": compared.figure.better,
            **fields(compared, "a", "b", "difference", "relative_difference", "judgement"),
        }
        for compared in answer.figures
    ]
    changes = [
        {
            "key": change.key,
            "a": change.a and change.a.value,
            "a_source": "absent" if change.a is None else change.a.source,
            "b": change.b and change.b.value,
            "b_source": "absent" if change.b is None else change.b.source,
        }
        for change in answer.keys
    ]
    return blocks.Report(
        blocks.Sentence(("Changes from ", blocks.Code(answer.a.argument), " to ", blocks.Code(answer.b.argument))),
        tuple(_blocks(answer, summary)),
        document(
            "diff",
            a=_side_record(answer.a),
            b=_side_record(answer.b),
            text=sentence_text(summary),
            same=answer.same,
            changes=changes,
            figures=records,
        ),
        records,
    )


def regression_words(answer: DiffAnswer, *, tolerance_percent: float) -> str:
    """Message that names the figures of B that are worse; empty without any."""
    names = _names(answer.regressions(tolerance_percent=tolerance_percent))
    by = f" by more than {tolerance_percent:.12g} %" if tolerance_percent else ""
    return f"regression: B is worse{by} in {plural(len(names), 'figure')}: {', '.join(names)}" if names else ""


def _sentence(answer: DiffAnswer) -> blocks.Sentence:
    """Sentence with the verdicts of both, and with the figures in which B is worse and better."""
    sides = ((" (A) ", answer.a), (" (B) ", answer.b))
    parts = [part for label, side in sides for part in (blocks.Code(side.argument), f"{label}{_verdict(side)}", ", ")][
        :-1
    ]
    judged = [words for judgement in ("worse", "better") if (words := _judged(answer, judgement))]
    if answer.same:
        rest = "every key has the same value"
    else:
        rest = f"B is {', and '.join(judged)}" if judged else "no figure is better or worse"
    state: blocks.State = "fails" if answer.judged("worse") else "passes" if judged else "neutral"
    return blocks.Sentence((*parts, f"; {rest}."), state)


def _verdict(side: DiffSide) -> str:
    word = side.verdict or ""
    buts = [
        *([] if side.figures.safe else [f"{side.figures.safety.setting} is unsafe"]),
        *([f"it does not meet {listed(side.missed_limits, 'and')}"] if side.missed_limits else []),
    ]
    verdict = word if word in (FITS, DOES_NOT_FIT) else f"is {word}"
    return f"{verdict}{', but' if word == FITS else ', and'} {' and '.join(buts)}" if buts else verdict


def _judged(answer: DiffAnswer, judgement: Judgement) -> str:
    names = _names(answer.judged(judgement))
    more = len(names) - _MOST_NAMED
    shown = [*names[:_MOST_NAMED], *([f"{more} more"] if more > 0 else [])]
    return f"{judgement} in {plural(len(names), 'figure')}: {listed(shown, 'and')}" if names else ""


def _names(figures: Sequence[ComparedFigure]) -> list[str]:
    """Names of figures, each once, with the timing model if only one judges it so."""
    parts: dict[str, list[str]] = {}
    for compared in figures:
        parts.setdefault(compared.figure.label, []).append(compared.part)
    of_all = ["plan"], ["deciding"]
    return [f"{label} ({of[0]})" if len(of) == 1 and of not in of_all else label for label, of in parts.items()]


def _blocks(answer: DiffAnswer, summary: blocks.Sentence) -> Iterator[blocks.Block]:
    yield summary
    if answer.keys:
        rows = (
            blocks.TableRow(
                (blocks.Code(key.key), _cell(key.key, key.a, key.b), _cell(key.key, key.b, key.a)),
                is_detail=number >= _MOST_KEYS or {key.a and key.a.source, key.b and key.b.source} == {None, "default"},
            )
            for number, key in enumerate(answer.keys)
        )
        yield blocks.Table(_KEYS, tuple(rows))
    # Figures that only one of two kinds of bus has are no difference.
    differ = [
        figure
        for figure in answer.figures
        if figure.judgement in ("worse", "better")
        or (figure.judgement == "neutral" and None not in (figure.a, figure.b))
    ]
    if differ:
        deciding = {"plan", *(side.figures.timing_model for side in (answer.a, answer.b))}
        first = [figure for figure in differ if figure.judgement != "neutral" and figure.part in deciding] or differ
        rows = (_row(figure)._replace(is_detail=figure not in first) for figure in differ)
        yield blocks.Table(_FIGURES, tuple(rows), heads=3)


def _cell(key: str, value: KeyValue | None, opposite: KeyValue | None) -> blocks.Cell:
    """One side of a difference. The other side decides which part or how many digits of a long value are shown."""
    if value is None:
        return MISSING
    here, there = value.value, None if opposite is None else opposite.value
    shown: blocks.ShownValue | blocks.Code | str
    if here is None:
        shown = "none"
    elif isinstance(here, int | float) and not isinstance(here, bool):
        shown = blocks.ShownValue(here, key)
        if here != there and figure_text(shown) == figure_text(shown._replace(value=there)):
            shown = shown._replace(digits=_ALL_DIGITS)
    else:
        shown = blocks.Code(excerpt(value_text(here), "" if there is None else value_text(there)))
    return shown if value.source == "file" else blocks.Sentence((shown, " (default)"))


def excerpt(text: str, opposite: str = "") -> str:
    """Part of a long text where it begins to differ from the other.

    Examples
    --------
    >>> excerpt("[4, 16]"), excerpt("a" * 70 + "b", "a" * 70 + "c")
    ('[4, 16]', '..aaaaaaaab')
    """
    if len(text) <= _MOST_CHARACTERS:
        return text
    start = max(0, sum(takewhile(bool, map(eq, text, opposite))) - _CONTEXT)
    end = start + _MOST_CHARACTERS
    return f"{'..' if start else ''}{text[start:end]}{'..' if end < len(text) else ''}"


def _row(compared: ComparedFigure) -> blocks.TableRow:
    figure = compared.figure
    a, b, difference = (blocks.figure_value(figure, getattr(compared, key)) for key in ("a", "b", "difference"))
    relative = blocks.ShownValue(compared.relative_difference, "relative_difference", "%", 1, signed=True)
    judged = blocks.Words(compared.judgement, _STATES[compared.judgement])
    return blocks.TableRow(
        (figure.label, compared.part, b.unit, a, b, difference._replace(signed=True), relative, judged)
    )


def _side_record(side: DiffSide) -> blocks.Record:
    return {
        "argument": side.argument,
        "profile": side.profile.name,
        "verdict": side.verdict,
        "missed_limits": list(side.missed_limits),
    }
