"""Answer of `busplan explain`: every step to a figure and its inputs; without one, assumptions and all figures."""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from busplan.buses.figure import MARGIN_CORRECTED
from busplan.english import plural
from busplan.forms import blocks
from busplan.forms.numbers import figure_text, period_value
from busplan.questions.base.sentences import document, fields, with_profile
from busplan.questions.explain import ExplainAnswer
from busplan.questions.explain.derivation import GRADES, Derivation, Step
from busplan.sourced import DIGITS, Input, short

_INPUTS: Final = (
    blocks.TableColumn("name", kind="words", wraps=True),
    blocks.TableColumn("value"),
    blocks.TableColumn("unit", kind="words", rank=2, leaves="below", wraps=True),
    blocks.TableColumn("grade", kind="words", rank=3, leaves="below"),
    blocks.TableColumn("source", kind="words", rank=4, leaves="below", wraps=True),
)
"""Columns of an input and its grade."""
_KNOWN: Final = tuple(
    column._replace(is_detail=True) if column.heading == "source" else column._replace(leaves="out")
    for column in _INPUTS
)
"""Columns of an input, with the source only in a whole answer."""
_MOST_INPUTS: Final = 8
"""Inputs in an answer that is not whole."""
_SYMBOL: Final = blocks.TableColumn("symbol", kind="words", rank=1, leaves="below")
_MEANING: Final = blocks.TableColumn("meaning", kind="words", rank=5, leaves="below", wraps=True)
_USED: Final = (
    blocks.TableColumn("from", kind="words"),
    blocks.TableColumn("value"),
    blocks.TableColumn("unit", kind="words"),
    blocks.TableColumn("by", kind="words"),
)
_FIGURES: Final = (
    *(blocks.TableColumn(heading, kind="words") for heading in ("command", "figure")),
    blocks.TableColumn("source", kind="words", rank=2),
    blocks.TableColumn("unit", kind="words", rank=1),
    blocks.TableColumn("meaning", kind="words", wraps=True),
)


def assumptions_report(answer: ExplainAnswer) -> blocks.Report:
    """Report of `explain PROFILE`: the inputs on which the verdict rests, and the figures that can be explained."""
    profile, assumptions, figures = answer.profile, answer.assumptions, answer.figures
    inputs = (
        blocks.TableRow((*_input_cells(given), given.meaning), is_detail=number >= _MOST_INPUTS)
        for number, given in enumerate(assumptions)
    )
    rows = (
        blocks.TableRow((command, blocks.Code(figure.key), figure.reference, figure.unit, figure.meaning))
        for command, figure in figures
    )
    caption = blocks.Sentence(("Inputs of the verdict on ", blocks.Code(profile.name), ", the least certain first"))
    records = [
        {"command": command, "figure": figure.key, **fields(figure, "symbol", "unit", "reference", "meaning")}
        for command, figure in figures
    ]
    table = blocks.Table(_FIGURES, tuple(rows), blocks.Sentence(("Figures to explain",)), stacks=True)
    names = dict.fromkeys(figure.key for _, figure in figures)
    return blocks.Report(
        blocks.Sentence(("The figures of ", blocks.Code(profile.name))),
        (
            blocks.Table((*_KNOWN, _MEANING), tuple(inputs), caption, stacks=True),
            blocks.Detail((table,), f"{plural(len(names), 'figure')} to explain", (_example(profile.name, names),)),
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


def _example(name: str, figures: Iterable[str]) -> blocks.Sentence:
    """A question for a figure as an example: the required time, or the first where a profile has no cycle."""
    figure = "required_us" if "required_us" in figures else next(iter(figures), "FIGURE")
    return blocks.Sentence((blocks.Code(f"busplan explain {name} {figure}"), " explains a figure."))


def explain_report(name: str, derivations: Sequence[Derivation]) -> blocks.Report:
    """Report of `explain PROFILE FIGURE`, with a section for each of one or more derivations."""
    figures = dict.fromkeys(derivation.figure.key for derivation in derivations)
    return blocks.Report(
        blocks.Sentence(("Derivation of ", blocks.Code(", ".join(figures)), " in ", blocks.Code(name))),
        tuple(_sections(name, derivations)),
        document("explain", profile=name, derivations=list(map(_record, derivations))),
        with_profile(name, [record for derivation in derivations for record in _step_records(derivation)]),
    )


def _record(derivation: Derivation) -> blocks.Record:
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


def _step_records(derivation: Derivation) -> Iterator[blocks.Record]:
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


def _sections(name: str, derivations: Iterable[Derivation]) -> Iterator[blocks.Chapter]:
    """Sections of derivations; inputs that several share are listed once."""
    first: dict[tuple[Input, ...], Derivation] = {}
    for derivation in derivations:
        earlier = first.setdefault(derivation.inputs, derivation)
        same = f"Inputs: as for {earlier.figure.key}, {_of(earlier)}."
        yield _section(derivation, name, _inputs(derivation) if earlier is derivation else blocks.Sentence((same,)))


def _of(derivation: Derivation) -> str:
    """Transaction and timing model."""
    return f"{f'{derivation.transaction}, ' if derivation.transaction else ''}{derivation.timing_model} model"


def _section(derivation: Derivation, name: str, below: blocks.Block) -> blocks.Chapter:
    """Section with the result, its meaning, every step to it, and the inputs below them."""
    figure = derivation.figure
    period = () if derivation.period_us is None else (" at ", period_value(derivation.period_us))
    result = _result(derivation.value, figure.key, figure.unit)
    title = blocks.Sentence(
        (blocks.Code(figure.key), " of ", blocks.Code(name), *period, f", {_of(derivation)}: ", result)
    )
    about = blocks.Sentence((f"{figure.meaning[:1].upper()}{figure.meaning[1:]}; {derivation.reference}.",))
    steps = blocks.Calculation(tuple(map(_step, derivation.steps)))
    uses = tuple(_used_by_the_verdict(derivation))
    if len(derivation.steps) <= _MOST_STEPS and len(derivation.inputs) <= _MOST_INPUTS:
        return blocks.Chapter(title, (about, steps, below, *uses))
    adds = f"{plural(len(derivation.steps), 'step')} and {plural(len(derivation.inputs), 'input')}"
    return blocks.Chapter(title, (about, blocks.Detail((steps, below), adds, tuple(_last_step(derivation))), *uses))


def _used_by_the_verdict(derivation: Derivation) -> Iterator[blocks.Sentence]:
    """The margin that the verdict uses, after one that it does not."""
    if derivation.corrected_us is not None:
        value = blocks.figure_value(MARGIN_CORRECTED, derivation.corrected_us)
        yield blocks.sentence("The verdict uses {}, {}.", blocks.Code(MARGIN_CORRECTED.key), value)


_MOST_STEPS: Final = 4
"""Steps of the longest derivation that every answer shows whole."""


def _last_step(derivation: Derivation) -> Iterator[blocks.Block]:
    """Last step, the steps from which it takes its numbers, and the inputs that are known the least."""
    *before, last = derivation.steps or (None,)
    if last is not None:
        used = [step for step in before if re.search(rf"(?<!\w){re.escape(step.symbol)}(?!\w)", last.formula)]
        # What another source than the figure's says of it, beside that source's other steps.
        special = [step for step in used if step.reference == last.reference != derivation.figure.reference]
        yield blocks.Calculation((*map(_step, special), _step(last)))
        rows = (
            blocks.TableRow((blocks.Code(step.symbol), _result(step.value, step.key, ""), step.unit, step.reference))
            for step in used
        )
        if used:
            yield blocks.Table(_USED, tuple(rows))
    known = (given for given in derivation.inputs if given.grade in GRADES[:-1] and _plays_a_part(given, derivation))
    weak = sorted(known, key=lambda given: GRADES.index(given.grade))[:_MOST_INPUTS]
    rows = (blocks.TableRow((blocks.Code(given.symbol), *_input_cells(given))) for given in weak)
    caption = blocks.Sentence((f"Inputs, the least certain first; the weakest grade is {derivation.weakest_grade}",))
    yield blocks.Table((_SYMBOL._replace(leaves="out"), *_KNOWN), tuple(rows), caption)


def _plays_a_part(given: Input, derivation: Derivation) -> bool:
    """Whether an input matters to a transaction's figure. One of a message that no step names does not."""
    section, _, rest = given.name.partition(".")
    name = rest.rpartition(".")[0]
    if section != "message" or derivation.transaction in (None, name):
        return True
    return any(re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", step.formula) for step in derivation.steps)


def _result(value: object, key: str, unit: str) -> blocks.ShownValue | blocks.Words:
    return blocks.Words("none") if value is None else blocks.ShownValue(value, key, unit, digits=DIGITS)


def _step(step: Step) -> blocks.CalculationStep:
    """A line in symbols and one in numbers, without a line that repeats its neighbour."""
    result = _result(step.value, step.key, step.unit)
    text = result.text if isinstance(result, blocks.Words) else figure_text(result)
    formula = "" if step.formula in (step.symbol, text) else step.formula
    numbers = "" if step.numbers in (formula, short(step.value), text) else step.numbers
    return blocks.CalculationStep(step.reference, step.symbol, formula, numbers, result)


def _inputs(derivation: Derivation) -> blocks.Table:
    rows = (blocks.TableRow((blocks.Code(given.symbol), *_input_cells(given))) for given in derivation.inputs)
    caption = blocks.Sentence((f"Inputs of this figure; the weakest grade is {derivation.weakest_grade}.",))
    return blocks.Table((_SYMBOL, *_INPUTS), tuple(rows), caption, stacks=True)


def _input_cells(given: Input) -> tuple[blocks.Cell, ...]:
    value = blocks.ShownValue(given.value, "value", given.unit, digits=DIGITS)
    return blocks.Code(given.name), value, given.unit, given.grade, given.source
