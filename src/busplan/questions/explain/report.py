"""Answer of `busplan explain`: every step to a figure and its inputs; without one, assumptions and all figures."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.buses.bus import Bus
from busplan.forms import blocks
from busplan.forms.blocks import (
    Block,
    Calculation,
    Cell,
    Chapter,
    Code,
    JsonDocument,
    Part,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    Words,
    joined,
)
from busplan.forms.numbers import figure_text, period_value
from busplan.printable import json_text
from busplan.questions.capacity.report import capacity_document
from busplan.questions.capacity.sensitivity import sensitivities
from busplan.questions.capacity.sensitivity_report import sensitivity_document
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.explain.bus import OF_DOCUMENT, OF_SENSITIVITY
from busplan.questions.explain.derivation import Derivation, Explanation, Step, explained_figures
from busplan.questions.explain.formulas import formula_of
from busplan.questions.fit.figures import capacity
from busplan.questions.fit.network import bus_of
from busplan.questions.words.documents import document, fields, with_profile
from busplan.sections.profile import Profile
from busplan.sourced import DIGITS, EQUATIONS, Input, short

_MEANING: Final = TableColumn("meaning", kind="words", rank=4, leaves="below", wraps=True)
INPUT_COLUMNS: Final = (
    TableColumn("name", kind="words", wraps=True),
    TableColumn("value"),
    TableColumn("unit", kind="words", rank=1, leaves="below", wraps=True),
    TableColumn("grade", kind="words", rank=2, leaves="below"),
    TableColumn("source", kind="words", rank=3, leaves="below", wraps=True),
)
"""Columns of an input: what it is, and how well it is known."""
_FIGURES: Final = (
    *(TableColumn(heading, kind="words") for heading in ("command", "figure")),
    TableColumn("eq", kind="words", rank=2),
    TableColumn("unit", kind="words", rank=1),
    TableColumn("what it is", kind="words", wraps=True),
)


def assumptions_report(profile: Profile, assumptions: Sequence[Input]) -> Report:
    """Report of `explain PROFILE`: the assumptions behind its figures, and all figures that can be explained.

    Parameters
    ----------
    profile
        The network.
    assumptions
        The inputs of its figures.
    """
    caption = Sentence(("What the figures of ", Code(profile.name), " rest on, the least well known first"))
    return Report(
        Sentence(("The figures of ", Code(profile.name))),
        (
            assumptions_table(assumptions)._replace(caption=caption),
            _figure_table(profile),
        ),
        assumptions_document(profile, assumptions),
        figure_rows(profile),
    )


def assumptions_table(assumptions: Sequence[Input]) -> Table:
    """Table of inputs, one row each.

    Parameters
    ----------
    assumptions
        The inputs.
    """
    rows = (TableRow((*input_cells(given), given.meaning)) for given in assumptions)
    return Table((*INPUT_COLUMNS, _MEANING), tuple(rows), stacks=True)


def figure_rows(profile: Profile) -> list[Record]:
    """One row for each figure that can be explained."""
    return [
        {"command": command, "figure": figure.key, **fields(figure, "symbol", "unit", "reference", "meaning")}
        for command, figure in explained_figures(profile)
    ]


def equation_rows() -> list[Record]:
    """One row for each equation: numbers, formula, function and source."""
    return [
        {
            "reference": equation.reference,
            "formula": f"{equation.symbol} = {formula_of(equation)}",
            "function": name,
            "source": equation.source,
        }
        for name, equation in sorted(EQUATIONS.items(), key=lambda item: item[1].numbers[0])
    ]


def constant_rows(bus: Bus) -> list[Record]:
    """One row for each constant: value, unit, grade and source."""
    return [
        {"name": name, "value": float(constant), **fields(constant, "unit", "grade", "source", "meaning")}
        for name, constant in bus.constants.items()
    ]


def assumptions_document(profile: Profile, assumptions: Sequence[Input]) -> JsonDocument:
    """Document of `busplan explain PROFILE --format json`: the inputs of the figures, and the whole registry."""
    return document(
        "explain",
        profile=profile.name,
        assumptions=[given._asdict() for given in assumptions],
        figures=figure_rows(profile),
        equations=equation_rows(),
        constants=constant_rows(bus_of(profile)),
    )


def input_cells(given: Input) -> tuple[Cell, ...]:
    """Cells of one input."""
    value = ShownValue(given.value, "value", given.unit, digits=DIGITS)
    return Code(given.name), value, given.unit, given.grade, given.source


def _figure_table(profile: Profile) -> Table:
    rows = (
        TableRow((command, Code(figure.key), figure.reference, figure.unit, figure.meaning))
        for command, figure in explained_figures(profile)
    )
    return Table(_FIGURES, tuple(rows), Sentence(("Figures to explain",)), stacks=True)


_NONE: Final = Words("none")
_NAMING: Final = ("name", "source", "input", "change")
"""Keys that name a part of a value, the first that it has."""
_MOST_REPEATED: Final = 100
"""A longer list of inputs is not shown again: with 200 messages there are 200 of 800 rows."""
_SYMBOL: Final = TableColumn("symbol", kind="words")


def explain_report(explanation: Explanation) -> Report:
    """Report of `explain PROFILE FIGURE` with a section for each derivation.

    Parameters
    ----------
    explanation
        The derivations.
    """
    filled = _in_words(explanation)
    name = filled.profile.name
    return Report(
        Sentence(("Where ", Code(filled.derivations[0].figure.key), " of ", Code(name), " comes from")),
        tuple(_sections(filled)),
        _explain_document(filled),
        with_profile(name, [record for derivation in filled.derivations for record in _step_records(derivation)]),
    )


def _in_words(explanation: Explanation) -> Explanation:
    """Fill in the value of figures that are sentences or changes: the report of `capacity` makes them."""
    return explanation._replace(
        derivations=tuple(_with_words(derivation, explanation) for derivation in explanation.derivations)
    )


def _with_words(derivation: Derivation, explanation: Explanation) -> Derivation:
    key = derivation.figure.key
    if key not in (*OF_DOCUMENT, *OF_SENSITIVITY, "text", "warnings", "cheapest_change"):
        return derivation
    result = capacity(explanation.profile, periods_us=None if derivation.period_us is None else [derivation.period_us])
    if key in OF_SENSITIVITY:
        answer = sensitivity_document(result, verdicts(result), sensitivities(result))
    else:
        answer = capacity_document(result, verdicts(result))
    value = answer["verdicts"][0][key]
    *before, last = derivation.steps
    return derivation._replace(value=value, steps=(*before, last._replace(value=value)))


def _explain_document(explanation: Explanation) -> JsonDocument:
    return document(
        "explain",
        profile=explanation.profile.name,
        derivations=[_derivation(derivation) for derivation in explanation.derivations],
    )


def _derivation(derivation: Derivation) -> JsonDocument:
    return {
        "command": derivation.command,
        "figure": derivation.figure.key,
        **fields(derivation.figure, "symbol", "unit", "reference", "meaning"),
        **fields(derivation, "timing_model", "transaction", "period_us", "value", "weakest_grade"),
        "steps": [step._asdict() for step in derivation.steps],
        "inputs": [input_._asdict() for input_ in derivation.inputs],
    }


def _step_records(derivation: Derivation) -> Iterator[Record]:
    """One row for each step; a figure that is itself an input has one row, without a formula."""
    figure = derivation.figure
    itself = Step(figure.key, figure.symbol, figure.reference, "", "", derivation.value, figure.unit)
    for number, step in enumerate(derivation.steps or (itself,), start=1):
        yield {
            "command": derivation.command,
            "figure": figure.key,
            **fields(derivation, "timing_model", "transaction", "period_us"),
            "step": number,
            **fields(step, "reference", "symbol", "formula", "numbers"),
            "value": json_text(step.value) if _has_names(step.value) else step.value,
            "unit": step.unit,
        }


def _sections(explanation: Explanation) -> Iterator[Chapter]:
    """A section for each derivation; a long list of inputs stands once."""
    first: dict[tuple[Input, ...], Derivation] = {}
    for derivation in explanation.derivations:
        earlier = first.setdefault(derivation.inputs, derivation)
        is_shown = earlier is derivation or len(derivation.inputs) <= _MOST_REPEATED
        below = _inputs(derivation) if is_shown else _same_inputs(derivation, earlier)
        yield _section(derivation, explanation.profile.name, below)


def _same_inputs(derivation: Derivation, earlier: Derivation) -> Sentence:
    kind = f"{earlier.transaction}, " if earlier.transaction else ""
    words = f"It starts from the {len(derivation.inputs)} inputs of {kind}{earlier.timing_model} model"
    return Sentence((f"{words}; the least well known is {derivation.weakest_grade}.",))


def _section(derivation: Derivation, profile: str, below: Block) -> Chapter:
    """The result, its meaning, every step to it, and what stands below them: the inputs."""
    figure = derivation.figure
    kind = f"{derivation.transaction}, " if derivation.transaction else ""
    title = Sentence(
        (
            *(Code(figure.key), " of ", Code(profile)),
            *(() if derivation.period_us is None else (" at ", period_value(derivation.period_us))),
            *(f", {kind}{derivation.timing_model} model: ", *_result_parts(derivation)),
        )
    )
    about = Sentence((f"{figure.meaning[:1].upper()}{figure.meaning[1:]}; {figure.reference}.",))
    steps = Calculation(tuple(map(_step, derivation.steps)))
    return Chapter(title, (about, steps, below))


def _result_parts(derivation: Derivation) -> tuple[Part, ...]:
    """The result in a sentence: one figure, or the keys that a change sets."""
    if isinstance(derivation.value, dict) and "changes" in derivation.value:
        settings = (
            Sentence((Code(key), " = ", ShownValue(new, key))) for key, new in derivation.value["changes"].items()
        )
        return joined(*settings, by=", ").parts
    result = _result(derivation.value, derivation.figure.key, derivation.figure.unit)
    return (result if isinstance(result, ShownValue) else result.text,)


def _result(value: object, key: str, unit: str) -> ShownValue | Words:
    if value is None or value in ([], {}):
        return _NONE
    if isinstance(value, dict) and "text" in value:
        return Words(value["text"])
    if isinstance(value, dict):
        changes = value.get("changes", value)
        return Words(", ".join(f"{changed} = {new}" for changed, new in changes.items()))
    if isinstance(value, list) and _has_names(value):
        names = (next(item[key] for key in _NAMING if key in item) for item in value)
        return Words(", ".join(names))
    return ShownValue(value, key, unit, digits=DIGITS)


def _has_names(value: object) -> bool:
    """Whether a value has named parts."""
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(item, dict) for item in value))


def _step(step: Step) -> blocks.CalculationStep:
    """A line in symbols and one in numbers; a line that repeats its neighbour is left out."""
    result = _result(step.value, step.key, step.unit)
    said = figure_text(result) if isinstance(result, ShownValue) else result.text
    formula = "" if step.formula == step.symbol else step.formula
    numbers = "" if step.numbers in (formula, short(step.value), said) else step.numbers
    return blocks.CalculationStep(step.reference, step.symbol, formula, numbers, result)


def _inputs(derivation: Derivation) -> Table:
    rows = (TableRow((Code(given.symbol), *input_cells(given))) for given in derivation.inputs)
    caption = Sentence((f"Inputs of this figure; the weakest grade is {derivation.weakest_grade}.",))
    return Table((_SYMBOL, *INPUT_COLUMNS), tuple(rows), caption, stacks=True)
