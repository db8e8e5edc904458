"""Answer of `busplan explain`: every step to a figure and its inputs; without one, assumptions and all figures."""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from busplan.buses.figure import MARGIN_CORRECTED
from busplan.english import plural
from busplan.forms.blocks import (
    Block,
    Calculation,
    CalculationStep,
    Cell,
    Chapter,
    Code,
    Detail,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    Words,
    figure_value,
    sentence,
)
from busplan.forms.numbers import figure_text, period_value
from busplan.questions.base.sentences import document, fields, with_profile
from busplan.questions.explain import ExplainAnswer
from busplan.questions.explain.derivation import GRADES, Derivation, Step
from busplan.sourced import DIGITS, Input, short

_INPUTS: Final = (
    TableColumn("name", kind="words", wraps=True),
    TableColumn("value"),
    TableColumn("unit", kind="words", rank=2, leaves="below", wraps=True),
    TableColumn("grade", kind="words", rank=3, leaves="below"),
    TableColumn("source", kind="words", rank=4, leaves="below", wraps=True),
)
"""Columns of an input and its grade."""
_KNOWN: Final = tuple(
    column._replace(is_detail=True) if column.heading == "source" else column._replace(leaves="out")
    for column in _INPUTS
)
"""Columns of an input, with the source only in a whole answer."""
_MOST_INPUTS: Final = 8
"""Inputs in an answer that is not whole."""
_SYMBOL: Final = TableColumn("symbol", kind="words", rank=1, leaves="below")
_MEANING: Final = TableColumn("meaning", kind="words", rank=5, leaves="below", wraps=True)
_USED: Final = (
    TableColumn("from", kind="words"),
    TableColumn("value"),
    TableColumn("unit", kind="words"),
    TableColumn("by", kind="words"),
)
_FIGURES: Final = (
    *(TableColumn(heading, kind="words") for heading in ("command", "figure")),
    TableColumn("source", kind="words", rank=2),
    TableColumn("unit", kind="words", rank=1),
    TableColumn("meaning", kind="words", wraps=True),
)


def assumptions_report(answer: ExplainAnswer) -> Report:
    """Report of `explain PROFILE`: the inputs on which the verdict rests, and the figures that can be explained."""
    profile, assumptions, figures = answer.profile, answer.assumptions, answer.figures
    inputs = (
        TableRow((*_input_cells(given), given.meaning), is_detail=number >= _MOST_INPUTS)
        for number, given in enumerate(assumptions)
    )
    rows = (
        TableRow((command, Code(figure.key), figure.reference, figure.unit, figure.meaning))
        for command, figure in figures
    )
    caption = Sentence(("Inputs of the verdict on ", Code(profile.name), ", the least certain first"))
    records = [
        {"command": command, "figure": figure.key, **fields(figure, "symbol", "unit", "reference", "meaning")}
        for command, figure in figures
    ]
    table = Table(_FIGURES, tuple(rows), Sentence(("Figures to explain",)), stacks=True)
    names = dict.fromkeys(figure.key for _, figure in figures)
    return Report(
        Sentence(("The figures of ", Code(profile.name))),
        (
            Table((*_KNOWN, _MEANING), tuple(inputs), caption, stacks=True),
            Detail((table,), f"{plural(len(names), 'figure')} to explain", (_example(profile.name, names),)),
        ),
        document(
            "explain",
            profile=profile.name,
            assumptions=[given._asdict() for given in assumptions],
            figures=records,
            equations=list(answer.equations),
            constants=list(answer.constants),
        ),
        records,
    )


def _example(name: str, figures: Iterable[str]) -> Sentence:
    """How to ask for a figure: the required time, or the first where a profile has no cycle."""
    figure = "required_us" if "required_us" in figures else next(iter(figures), "FIGURE")
    return Sentence((Code(f"busplan explain {name} {figure}"), " explains a figure."))


def explain_report(name: str, derivations: Sequence[Derivation]) -> Report:
    """Report of `explain PROFILE FIGURE`, with a section for each of one or more derivations."""
    figures = dict.fromkeys(derivation.figure.key for derivation in derivations)
    return Report(
        Sentence(("Derivation of ", Code(", ".join(figures)), " in ", Code(name))),
        tuple(_sections(name, derivations)),
        document("explain", profile=name, derivations=list(map(_record, derivations))),
        with_profile(name, [record for derivation in derivations for record in _step_records(derivation)]),
    )


def _record(derivation: Derivation) -> Record:
    return {
        "command": derivation.command,
        "figure": derivation.figure.key,
        **fields(derivation.figure, "symbol", "unit"),
        "reference": derivation.reference,
        "meaning": derivation.figure.meaning,
        **fields(derivation, "timing_model", "transaction", "period_us", "value", "weakest_grade"),
        "steps": [step._asdict() for step in derivation.steps],
        "inputs": [given._asdict() for given in derivation.inputs],
    }


def _step_records(derivation: Derivation) -> Iterator[Record]:
    """Rows of steps; a figure that is itself an input has one row, without a formula."""
    figure = derivation.figure
    itself = Step(figure.key, figure.symbol, figure.reference, "", "", derivation.value, figure.unit)
    for number, step in enumerate(derivation.steps or (itself,), start=1):
        yield {
            "command": derivation.command,
            "figure": figure.key,
            **fields(derivation, "timing_model", "transaction", "period_us"),
            "step": number,
            **fields(step, "reference", "symbol", "formula", "numbers", "value", "unit"),
        }


def _sections(name: str, derivations: Iterable[Derivation]) -> Iterator[Chapter]:
    """Sections of derivations; inputs that several share are listed once."""
    first: dict[tuple[Input, ...], Derivation] = {}
    for derivation in derivations:
        earlier = first.setdefault(derivation.inputs, derivation)
        same = f"Inputs: as for {earlier.figure.key}, {_of(earlier)}."
        yield _section(derivation, name, _inputs(derivation) if earlier is derivation else Sentence((same,)))


def _of(derivation: Derivation) -> str:
    """Transaction and timing model."""
    return f"{f'{derivation.transaction}, ' if derivation.transaction else ''}{derivation.timing_model} model"


def _section(derivation: Derivation, name: str, below: Block) -> Chapter:
    """Section with the result, its meaning, every step to it, and the inputs below them."""
    figure = derivation.figure
    period = () if derivation.period_us is None else (" at ", period_value(derivation.period_us))
    result = _result(derivation.value, figure.key, figure.unit)
    title = Sentence((Code(figure.key), " of ", Code(name), *period, f", {_of(derivation)}: ", result))
    about = Sentence((f"{figure.meaning[:1].upper()}{figure.meaning[1:]}; {derivation.reference}.",))
    steps = Calculation(tuple(map(_step, derivation.steps)))
    uses = tuple(_used_by_the_verdict(derivation))
    if len(derivation.steps) <= _MOST_STEPS and len(derivation.inputs) <= _MOST_INPUTS:
        return Chapter(title, (about, steps, below, *uses))
    adds = f"{plural(len(derivation.steps), 'step')} and {plural(len(derivation.inputs), 'input')}"
    return Chapter(title, (about, Detail((steps, below), adds, tuple(_last_step(derivation))), *uses))


def _used_by_the_verdict(derivation: Derivation) -> Iterator[Sentence]:
    """The margin that the verdict uses, after one that it does not."""
    if derivation.corrected_us is not None:
        value = figure_value(MARGIN_CORRECTED, derivation.corrected_us)
        yield sentence("The verdict uses {}, {}.", Code(MARGIN_CORRECTED.key), value)


_MOST_STEPS: Final = 4
"""Steps of the longest derivation that every answer shows whole."""


def _last_step(derivation: Derivation) -> Iterator[Block]:
    """Last step, the steps from which it takes its numbers, and the inputs that are known the least."""
    *before, last = derivation.steps or (None,)
    if last is not None:
        used = [step for step in before if re.search(rf"(?<!\w){re.escape(step.symbol)}(?!\w)", last.formula)]
        # What another source than the figure's says of it, beside that source's other steps.
        special = [step for step in used if step.reference == last.reference != derivation.figure.reference]
        yield Calculation((*map(_step, special), _step(last)))
        rows = (
            TableRow((Code(step.symbol), _result(step.value, step.key, ""), step.unit, step.reference)) for step in used
        )
        if used:
            yield Table(_USED, tuple(rows))
    known = (given for given in derivation.inputs if given.grade in GRADES[:-1] and _plays_a_part(given, derivation))
    weak = sorted(known, key=lambda given: GRADES.index(given.grade))[:_MOST_INPUTS]
    rows = (TableRow((Code(given.symbol), *_input_cells(given))) for given in weak)
    caption = Sentence((f"Inputs, the least certain first; the weakest grade is {derivation.weakest_grade}",))
    yield Table((_SYMBOL._replace(leaves="out"), *_KNOWN), tuple(rows), caption)


def _plays_a_part(given: Input, derivation: Derivation) -> bool:
    """Whether an input matters to a transaction's figure. One of a message that no step names does not."""
    section, _, rest = given.name.partition(".")
    name = rest.rpartition(".")[0]
    if section != "message" or derivation.transaction in (None, name):
        return True
    return any(re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", step.formula) for step in derivation.steps)


def _result(value: object, key: str, unit: str) -> ShownValue | Words:
    return Words("none") if value is None else ShownValue(value, key, unit, digits=DIGITS)


def _step(step: Step) -> CalculationStep:
    """A line in symbols and one in numbers, without a line that repeats its neighbour."""
    result = _result(step.value, step.key, step.unit)
    text = result.text if isinstance(result, Words) else figure_text(result)
    formula = "" if step.formula in (step.symbol, text) else step.formula
    numbers = "" if step.numbers in (formula, short(step.value), text) else step.numbers
    return CalculationStep(step.reference, step.symbol, formula, numbers, result)


def _inputs(derivation: Derivation) -> Table:
    rows = (TableRow((Code(given.symbol), *_input_cells(given))) for given in derivation.inputs)
    caption = Sentence((f"Inputs of this figure; the weakest grade is {derivation.weakest_grade}.",))
    return Table((_SYMBOL, *_INPUTS), tuple(rows), caption, stacks=True)


def _input_cells(given: Input) -> tuple[Cell, ...]:
    value = ShownValue(given.value, "value", given.unit, digits=DIGITS)
    return Code(given.name), value, given.unit, given.grade, given.source
