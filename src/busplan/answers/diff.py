"""`busplan diff`: for people, for a pull request, and as plain data."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from busplan.analysis.comparison.difference import CircleSide, ComparedFigure, Difference, Judgement
from busplan.analysis.network import bus_of, model_names
from busplan.answers.changes import CHANGE_HEADINGS, change_document, change_rows
from busplan.answers.documents import Document, document
from busplan.answers.verdict_sentences import period
from busplan.forms import markdown
from busplan.forms.lines import BLANK, Line, figure_row, plural, table
from busplan.sections.profile import Profile

Arguments = tuple[str, str]
"""A and B as they were typed."""


_HEADINGS: Final = ("figure", "of", "unit", "A", "B", "B - A", "relative", "B is")
_WORDS: Final = 3
"""Columns of words, in front of those of figures."""

_FITS: Final[dict[Judgement, str]] = {"worse": "B does not fit where A does", "better": "B fits where A does not"}
_PASSES: Final[dict[Judgement, str]] = {
    "worse": "B does not pass the circle where A does",
    "better": "B passes the circle where A does not",
}
_MOST_NAMED: Final = 4
"""Figures that a headline names."""
_MOST_KEYS: Final = 20
"""Keys that a comment on a pull request lists."""


def diff_lines(found: Difference, *, arguments: Arguments) -> list[Line]:
    """The verdict, the keys that differ, and every figure of both."""
    lines = [_headline(found), *map(Line, _sides(found, arguments))]
    if not found.keys:
        return lines
    lines.extend(_notes(found))
    changes = table(CHANGE_HEADINGS, change_rows(found.keys), left=len(CHANGE_HEADINGS))
    return [*lines, BLANK, *changes, BLANK, *table(_HEADINGS, map(_cells, found.figures), left=_WORDS)]


def diff_markdown(found: Difference, *, arguments: Arguments) -> str:
    """A comment for a pull request: the verdict, the keys that differ, and the figures that do."""
    # In a table code is text whatever it holds; in a line of its own a bar would need other escapes.
    sides = [
        (side, markdown.code(argument), markdown.code(profile.name))
        for side, argument, profile in zip("AB", arguments, (found.a, found.b), strict=True)
    ]
    lines = [
        f"**busplan diff:** {_headline(found).text}",
        "",
        *markdown.table(("", "given as", "name"), sides, left=len(sides[0])),
    ]
    if found.keys:
        rows = [tuple(map(markdown.code, row)) for row in change_rows(found.keys[:_MOST_KEYS])]
        lines += ["", *markdown.table(CHANGE_HEADINGS, rows, left=len(CHANGE_HEADINGS)), ""]
        hidden = len(found.keys) - len(rows)
        lines += [f"And {plural(hidden, 'more key')}.", ""] if hidden else []
        # Of a circle that one side has not, a note says why: it needs no rows.
        told = [one for one in found.figures if one.judgement != "neutral" or None not in (one.a, one.b)]
        changed = [one for one in told if one.judgement != "same"]
        lines += [*markdown.table(_HEADINGS, map(_markdown_cells, changed), left=_WORDS), ""] if changed else []
        same = len(_named([one for one in told if one.judgement == "same"], found))
        lines += [f"{plural(same, 'figure')} {'is' if same == 1 else 'are'} the same."] if same else []
        lines += [part for note in _notes(found) for part in ("", markdown.escaped(note.text))]
    return "\n".join((*lines, ""))


def diff_document(found: Difference, *, arguments: Arguments) -> Document:
    """Answer of `busplan diff`."""
    circles = found.circles or (None, None)
    a, b = (
        _side_document(argument, profile, circle)
        for argument, profile, circle in zip(arguments, (found.a, found.b), circles, strict=True)
    )
    return document(
        "diff",
        a=a,
        b=b,
        verdict=_headline(found).text,
        same=not found.keys,
        changes=[change_document(one) for one in found.keys],
        figures=[_figure_document(figure) for figure in found.figures],
    )


def regression_words(found: Difference, regressions: Sequence[ComparedFigure], *, tolerance: float) -> str:
    """Say which figures fail a gate."""
    by = f" by more than {tolerance:.12g} %" if tolerance else ""
    names = _named(regressions, found)
    return f"regression: B is worse{by} in {plural(len(names), 'figure')}: {', '.join(names)}"


def _headline(found: Difference) -> Line:
    if not found.keys:
        return Line("A and B are the same profile: every key has the same value.")
    worse, better = found.judged("worse"), found.judged("better")
    if worse or better:
        verdicts = [
            *(*_loud(found, worse), *_counted(found, "worse", worse)),
            *(*_loud(found, better), *_counted(found, "better", better)),
        ]
        return Line(f"{'; '.join(verdicts)}.", "bad" if worse else "good")
    differ = f"{plural(len(found.keys), 'key')} {'differs' if len(found.keys) == 1 else 'differ'}"
    if found.judged("neutral"):
        return Line(f"B is neither better nor worse: {differ}, and only figures that are neither.")
    return Line(f"B is neither better nor worse: {differ}, and no figure.")


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


def _loud(found: Difference, figures: Sequence[ComparedFigure]) -> Iterator[str]:
    judged = {one.figure.key: one.judgement for one in figures}
    models = " and ".join(one.part for one in figures if one.figure.key == "fits")
    if "verdict_fits" in judged:
        yield f"{_FITS[judged['verdict_fits']]} ({f'{models} timing' if models else 'each by the timing that decides'})"
    elif models:
        yield f"{_FITS[judged['fits']]} ({models} timing, which does not change the verdict)"
    for key, words in _loud_figures(found).items():
        if key in judged:
            yield words[judged[key]]


def _counted(found: Difference, judgement: Judgement, figures: Sequence[ComparedFigure]) -> Iterator[str]:
    told = {"verdict_fits", "fits", *_loud_figures(found)}
    names = _named([one for one in figures if one.figure.key not in told], found)
    if names:
        hidden = len(names) - _MOST_NAMED
        more = f" and {hidden} more" if hidden > 0 else ""
        yield f"B is {judgement} in {plural(len(names), 'figure')}: {', '.join(names[:_MOST_NAMED])}{more}"


def _named(figures: Sequence[ComparedFigure], found: Difference) -> list[str]:
    """Names of figures, each once, with the timing model where that is not all of them."""
    models = {*model_names(found.a), *model_names(found.b)}
    parts: dict[str, list[str]] = {}
    for one in figures:
        parts.setdefault(one.figure.label, []).append(one.part)
    return [f"{label} ({of[0]})" if len(of) == 1 and of[0] in models else label for label, of in parts.items()]


def _sides(found: Difference, arguments: Arguments) -> Iterator[str]:
    for side, argument, profile in zip("AB", arguments, (found.a, found.b), strict=True):
        name = "" if profile.name == argument else f" ({profile.name})"
        at = period(profile.cycle.period_us)
        yield f"{side}: {argument}{name} at {at}, the {profile.bus.timing_model} model decides."


def _notes(found: Difference) -> Iterator[Line]:
    """Say why a circle fails or has no figures, and what the figures rest on."""
    executions = (found.a.node.execution.grade, found.b.node.execution.grade)
    yield from _graded("execution time behind these figures is", *executions)
    if found.circles is None:
        return
    for side, circle in zip("AB", found.circles, strict=True):
        if circle.problems:
            state = "FAILED" if circle.simulated else "is not simulated"
            yield Line(f"The circle of {side} {state}: {', and '.join(circle.problems)}.", "warning")
    if any(circle.simulated for circle in found.circles):
        yield from _graded("servo values behind the circle's figures are", found.a.servo.grade, found.b.servo.grade)


def _graded(words: str, a: str | None, b: str | None) -> Iterator[Line]:
    """Say how well something is known on either side; nothing where nobody says."""
    if a or b:
        of_a, of_b = a or "not graded", b or "not graded"
        text = of_a if of_a == of_b else f"{of_a} in A and {of_b} in B"
        yield Line(f"The {words} {text}.", "warning" if "assumed" in (a, b) else "plain")


def _cells(one: ComparedFigure) -> tuple[str, ...]:
    row = figure_row(one.figure)
    a, b = ("-" if value is None else row.write(value) for value in (one.a, one.b))
    return (row.label, one.part, row.unit, a, b, *_changes(one, row.write), one.judgement)


def _changes(one: ComparedFigure, write: Callable[[Any], str]) -> tuple[str, str]:
    """Write the difference and the share that it is; what is but rounding is none."""
    if one.difference is None or one.judgement == "same":
        return "-", "-"
    share = one.relative_difference
    size = write(abs(one.difference))
    return f"{'-' if one.difference < 0 else '+'}{size}", "-" if share is None else f"{share:+.1%}"


def _markdown_cells(one: ComparedFigure) -> tuple[str, ...]:
    # Nothing here is a profile's text: labels, figures and words of ours, none of them markup.
    *cells, judgement = _cells(one)
    return (*cells, f"**{judgement}**" if one.judgement == "worse" else judgement)


def _side_document(argument: str, profile: Profile, circle: CircleSide | None) -> Document:
    return {
        "argument": argument,
        "profile": profile.name,
        "timing_model": profile.bus.timing_model,
        "circle_problems": None if circle is None else list(circle.problems),
    }


def _figure_document(one: ComparedFigure) -> Document:
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
