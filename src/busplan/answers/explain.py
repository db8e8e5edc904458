"""`busplan explain` as text, as Markdown and as plain data."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from busplan.analysis.capacity.figures import capacity
from busplan.analysis.capacity.verdict import verdicts
from busplan.analysis.derivation.explain import Derivation, Explanation, Step
from busplan.analysis.derivation.formulas import formula_of
from busplan.analysis.derivation.trace import Input, short
from busplan.analysis.network import bus_of
from busplan.analysis.register import Command, figures_of
from busplan.answers.documents import Document, Row, capacity_document, document
from busplan.answers.verdict_sentences import period
from busplan.buses.bus import Bus
from busplan.buses.figure import Figure
from busplan.forms import markdown
from busplan.forms.lines import BLANK, Line, table
from busplan.sections.profile import Profile
from busplan.sourced import EQUATIONS

_INPUT_HEADINGS: Final = ("symbol", "name", "value", "unit", "grade", "source")
_FIGURE_HEADINGS: Final = ("command", "figure", "eq", "unit", "what it is")


def figure_rows(bus: Bus) -> list[Row]:
    """One row a figure that can be explained."""
    return [
        {"command": command, "figure": one.key, "symbol": one.symbol, "unit": one.unit}
        | {"reference": one.reference, "meaning": one.meaning}
        for command, one in _all_figures(bus)
    ]


def equation_rows() -> list[Row]:
    """One row an equation: its numbers, formula, function and source."""
    return [
        {
            "reference": one.reference,
            "formula": f"{one.symbol} = {formula_of(one)}",
            "function": name,
            "source": one.source,
        }
        for name, one in sorted(EQUATIONS.items(), key=lambda item: item[1].numbers[0])
    ]


def constant_rows(bus: Bus) -> list[Row]:
    """One row a constant: its value, unit, grade and source."""
    return [
        {"name": name, "value": float(one), "unit": one.unit}
        | {"grade": one.grade, "source": one.source, "meaning": one.meaning}
        for name, one in bus.constants.items()
    ]


def figure_document(profile: Profile, assumptions: Sequence[Input]) -> Document:
    """Answer of `busplan explain PROFILE` as JSON: what the profile's figures rest on, and the whole registry."""
    return document(
        "explain",
        profile=profile.name,
        assumptions=[one._asdict() for one in assumptions],
        figures=figure_rows(bus_of(profile)),
        equations=equation_rows(),
        constants=constant_rows(bus_of(profile)),
    )


def figure_lines(profile: Profile, assumptions: Sequence[Input]) -> list[Line]:
    """Answer of `busplan explain PROFILE` for people: what its figures rest on, and all that can be explained."""
    rows = ([command, one.key, one.reference, one.unit, one.meaning] for command, one in _all_figures(bus_of(profile)))
    return [
        Line(f"What the figures of {profile.name} rest on, the least well known first", "heading"),
        *table(_INPUT_HEADINGS[1:], (_row(one)[1:] for one in assumptions), left=5),
        BLANK,
        Line("Figures to explain", "heading"),
        *table(_FIGURE_HEADINGS, rows, left=5),
    ]


def figure_markdown(profile: Profile, assumptions: Sequence[Input]) -> str:
    """Answer of `busplan explain PROFILE` as Markdown."""
    rows = (
        [command, markdown.code(one.key), one.reference, one.unit, markdown.escaped(one.meaning)]
        for command, one in _all_figures(bus_of(profile))
    )
    inputs = ((markdown.code(name), *map(markdown.escaped, others)) for _, name, *others in map(_row, assumptions))
    return _text(
        [
            f"What the figures of {markdown.code(profile.name)} rest on, the least well known first:",
            "",
            *markdown.table(_INPUT_HEADINGS[1:], inputs, left=5),
            "",
            "Figures to explain:",
            "",
            *markdown.table(_FIGURE_HEADINGS, rows, left=5),
        ]
    )


def in_words(explanation: Explanation) -> Explanation:
    """Put the verdict's sentences, and its change as the document has it, where the figures behind them are derived."""
    return explanation._replace(derivations=tuple(_with_words(one, explanation) for one in explanation.derivations))


def _with_words(one: Derivation, explanation: Explanation) -> Derivation:
    if one.figure.key not in ("text", "warnings", "cheapest_change"):
        return one
    result = capacity(explanation.profile, periods_us=[one.period_us])
    value = capacity_document(result, verdicts(result))["verdicts"][0][one.figure.key]
    *before, last = one.steps
    return one._replace(value=value, steps=(*before, last._replace(value=value)))


def explain_document(explanation: Explanation) -> Document:
    """Answer of `busplan explain PROFILE FIGURE` as JSON."""
    return document(
        "explain",
        profile=explanation.profile.name,
        derivations=[_derivation(one) for one in explanation.derivations],
    )


def explain_lines(explanation: Explanation) -> list[Line]:
    """Answer of `busplan explain PROFILE FIGURE` for people."""
    lines: list[Line] = []
    for one in explanation.derivations:
        if lines:
            lines.append(BLANK)
        headline = _headline(one, explanation.profile.name)
        lines.append(Line(f"{headline}: {_result(one.value, one.figure.unit)}", "heading"))
        lines.append(Line(_about(one.figure)))
        for number, step in enumerate(one.steps, start=1):
            lines.extend(_step(number, step))
        lines.extend((BLANK, *_inputs(one)))
    return lines


def explain_markdown(explanation: Explanation) -> str:
    """Answer of `busplan explain PROFILE FIGURE` as Markdown."""
    lines: list[str] = []
    for one in explanation.derivations:
        headline = _headline(one, markdown.code(explanation.profile.name), figure=markdown.code(one.figure.key))
        result = markdown.escaped(_result(one.value, one.figure.unit))
        lines += [f"### {headline}: {result}", "", markdown.escaped(_about(one.figure)), ""]
        steps = (
            [
                str(number),
                step.reference,
                markdown.code(f"{step.symbol} = {step.formula}"),
                markdown.code(step.numbers),
                markdown.escaped(_result(step.value, step.unit)),
            ]
            for number, step in enumerate(one.steps, start=1)
        )
        lines += [*markdown.table(["step", "eq", "formula", "numbers", "result"], steps, left=4), ""]
        cells = ([markdown.code(cell) for cell in row[:2]] + list(map(markdown.escaped, row[2:])) for row in _rows(one))
        lines += [_weakest(one), "", *markdown.table(_INPUT_HEADINGS, cells, left=6), ""]
    return _text(lines[:-1])


def _all_figures(bus: Bus) -> Iterator[tuple[Command, Figure]]:
    yield from ((command, one) for command, figures in figures_of(bus).items() for one in figures.values())


def _derivation(one: Derivation) -> Document:
    return {
        "command": one.command,
        "figure": one.figure.key,
        "symbol": one.figure.symbol,
        "unit": one.figure.unit,
        "reference": one.figure.reference,
        "meaning": one.figure.meaning,
        "timing_model": one.timing_model,
        "transaction": one.transaction,
        "period_us": one.period_us,
        "value": one.value,
        "weakest_grade": one.weakest_grade,
        "steps": [step._asdict() for step in one.steps],
        "inputs": [input_._asdict() for input_ in one.inputs],
    }


def _headline(one: Derivation, profile: str, *, figure: str | None = None) -> str:
    kind = f"{one.transaction}, " if one.transaction else ""
    return f"{figure or one.figure.key} of {profile} at {period(one.period_us)}, {kind}{one.timing_model} model"


def _about(figure: Figure) -> str:
    return f"{figure.meaning[:1].upper()}{figure.meaning[1:]}; {figure.reference}."


def _result(value: Any, unit: str) -> str:
    if isinstance(value, list):
        return ", ".join(map(_item, value)) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} = {new}" for key, new in value["changes"].items())
    return f"{short(value)} {unit}".rstrip() if value is not None else "none"


def _item(value: Any) -> str:
    """One of a list: a number or a word, or what has a name itself."""
    return str(value.get("name", value.get("source"))) if isinstance(value, dict) else short(value)


def _step(number: int, step: Step) -> Iterator[Line]:
    """A line in symbols, one in numbers and the result, each where it says more than the one before."""
    head = f"{number:>3}  {step.reference:<13}  {step.symbol} "
    formula = "" if step.formula == step.symbol else step.formula
    numbers = "" if step.numbers in (formula, short(step.value)) else step.numbers
    distinct = [text for text in (formula, numbers, _result(step.value, step.unit)) if text]
    yield BLANK
    for at, text in enumerate(distinct):
        yield Line(f"{head if at == 0 else ' ' * len(head)}= {text}", "table")


def _rows(one: Derivation) -> Iterator[Sequence[str]]:
    yield from map(_row, one.inputs)


def _row(given: Input) -> Sequence[str]:
    value = ", ".join(map(short, given.value)) if isinstance(given.value, (list, tuple)) else short(given.value)
    return given.symbol, given.name, value, given.unit, given.grade, given.source


def _inputs(one: Derivation) -> list[Line]:
    return [Line(_weakest(one), "heading"), *table(_INPUT_HEADINGS, _rows(one), left=6)]


def _weakest(one: Derivation) -> str:
    return f"It starts from these; the least well known is {one.weakest_grade}."


def _text(lines: Sequence[str]) -> str:
    return "".join(f"{line}\n" for line in lines)
