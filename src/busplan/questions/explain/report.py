"""Answer of `busplan explain PROFILE FIGURE`: every step to a figure, and its inputs."""

from collections.abc import Iterator
from functools import partial
from typing import Final

from busplan.forms import blocks
from busplan.forms.blocks import (
    Block,
    Calculation,
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
from busplan.questions.explain.assumptions import INPUT_COLUMNS, input_cells
from busplan.questions.explain.capacity import OF_DOCUMENT, OF_SENSITIVITY
from busplan.questions.explain.derivation import Derivation, Explanation, Step
from busplan.questions.fit.figures import capacity
from busplan.questions.words.documents import document, with_profile
from busplan.sourced import DIGITS, Input, short

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
    found = _in_words(explanation)
    name = found.profile.name
    return Report(
        Sentence(("Where ", Code(found.derivations[0].figure.key), " of ", Code(name), " comes from")),
        lambda: tuple(_sections(found)),
        partial(_explain_document, found),
        lambda: with_profile(name, [record for one in found.derivations for record in _step_records(one)]),
    )


def _in_words(explanation: Explanation) -> Explanation:
    """Fill in the value of figures that are sentences or changes: the report of `capacity` makes them."""
    return explanation._replace(derivations=tuple(_with_words(one, explanation) for one in explanation.derivations))


def _with_words(one: Derivation, explanation: Explanation) -> Derivation:
    key = one.figure.key
    if key not in (*OF_DOCUMENT, *OF_SENSITIVITY, "text", "warnings", "cheapest_change"):
        return one
    result = capacity(explanation.profile, periods_us=[one.period_us])
    if key in OF_SENSITIVITY:
        found = sensitivity_document(result, verdicts(result), sensitivities(result))
    else:
        found = capacity_document(result, verdicts(result))
    value = found["verdicts"][0][key]
    *before, last = one.steps
    return one._replace(value=value, steps=(*before, last._replace(value=value)))


def _explain_document(explanation: Explanation) -> JsonDocument:
    return document(
        "explain",
        profile=explanation.profile.name,
        derivations=[_derivation(one) for one in explanation.derivations],
    )


def _derivation(one: Derivation) -> JsonDocument:
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


def _step_records(one: Derivation) -> Iterator[Record]:
    """One row for each step; a figure that is itself an input has one row, without a formula."""
    figure = one.figure
    itself = Step(figure.key, figure.symbol, figure.reference, "", "", one.value, figure.unit)
    for number, step in enumerate(one.steps or (itself,), start=1):
        yield {
            "command": one.command,
            "figure": figure.key,
            "timing_model": one.timing_model,
            "transaction": one.transaction,
            "period_us": one.period_us,
            "step": number,
            "reference": step.reference,
            "symbol": step.symbol,
            "formula": step.formula,
            "numbers": step.numbers,
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


def _section(one: Derivation, profile: str, below: Block) -> Chapter:
    """The result, its meaning, every step to it, and what stands below them: the inputs."""
    figure = one.figure
    kind = f"{one.transaction}, " if one.transaction else ""
    title = Sentence(
        (
            *(Code(figure.key), " of ", Code(profile), " at ", period_value(one.period_us)),
            *(f", {kind}{one.timing_model} model: ", *_result_parts(one)),
        )
    )
    about = Sentence((f"{figure.meaning[:1].upper()}{figure.meaning[1:]}; {figure.reference}.",))
    steps = Calculation(tuple(map(_step, one.steps)))
    return Chapter(title, (about, steps, below))


def _result_parts(one: Derivation) -> tuple[Part, ...]:
    """The result in a sentence: one figure, or the keys that a change sets."""
    if isinstance(one.value, dict) and "changes" in one.value:
        settings = (Sentence((Code(key), " = ", ShownValue(new, key))) for key, new in one.value["changes"].items())
        return joined(*settings, by=", ").parts
    found = _result(one.value, one.figure.key, one.figure.unit)
    return (found if isinstance(found, ShownValue) else found.text,)


def _result(value: object, key: str, unit: str) -> ShownValue | Words:
    if value is None or value in ([], {}):
        return _NONE
    if isinstance(value, dict) and "text" in value:
        return Words(value["text"])
    if isinstance(value, dict):
        changes = value.get("changes", value)
        return Words(", ".join(f"{changed} = {new}" for changed, new in changes.items()))
    if isinstance(value, list) and _has_names(value):
        names = (next(one[key] for key in _NAMING if key in one) for one in value)
        return Words(", ".join(names))
    return ShownValue(value, key, unit, digits=DIGITS)


def _has_names(value: object) -> bool:
    """Whether a value has named parts."""
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(one, dict) for one in value))


def _step(step: Step) -> blocks.CalculationStep:
    """A line in symbols and one in numbers; a line that repeats its neighbour is left out."""
    result = _result(step.value, step.key, step.unit)
    said = figure_text(result) if isinstance(result, ShownValue) else result.text
    formula = "" if step.formula == step.symbol else step.formula
    numbers = "" if step.numbers in (formula, short(step.value), said) else step.numbers
    return blocks.CalculationStep(step.reference, step.symbol, formula, numbers, result)


def _inputs(one: Derivation) -> Table:
    rows = (TableRow((Code(given.symbol), *input_cells(given))) for given in one.inputs)
    caption = Sentence((f"It starts from these; the least well known is {one.weakest_grade}.",))
    return Table((_SYMBOL, *INPUT_COLUMNS), tuple(rows), caption, stacks=True)
