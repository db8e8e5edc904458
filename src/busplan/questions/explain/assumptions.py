"""Answer of `busplan explain PROFILE`: its assumptions, and all figures, equations and constants."""

from collections.abc import Sequence
from functools import partial
from typing import Final

from busplan.buses.bus import Bus
from busplan.forms.blocks import (
    Cell,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
)
from busplan.questions.explain.derivation import explained_figures
from busplan.questions.explain.formulas import formula_of
from busplan.questions.fit.network import bus_of
from busplan.questions.words.documents import document
from busplan.sections.profile import Profile
from busplan.sourced import DIGITS, EQUATIONS, Input

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
        lambda: (
            assumptions_table(assumptions)._replace(caption=caption),
            _figure_table(profile),
        ),
        partial(assumptions_document, profile, assumptions),
        lambda: figure_rows(profile),
    )


def assumptions_table(assumptions: Sequence[Input]) -> Table:
    """Table of inputs, one row each.

    Parameters
    ----------
    assumptions
        The inputs.
    """
    rows = (TableRow((*input_cells(one), one.meaning)) for one in assumptions)
    return Table((*INPUT_COLUMNS, _MEANING), tuple(rows), stacks=True)


def figure_rows(profile: Profile) -> list[Record]:
    """One row for each figure that can be explained."""
    return [
        {"command": command, "figure": one.key, "symbol": one.symbol, "unit": one.unit}
        | {"reference": one.reference, "meaning": one.meaning}
        for command, one in explained_figures(profile)
    ]


def equation_rows() -> list[Record]:
    """One row for each equation: numbers, formula, function and source."""
    return [
        {
            "reference": one.reference,
            "formula": f"{one.symbol} = {formula_of(one)}",
            "function": name,
            "source": one.source,
        }
        for name, one in sorted(EQUATIONS.items(), key=lambda item: item[1].numbers[0])
    ]


def constant_rows(bus: Bus) -> list[Record]:
    """One row for each constant: value, unit, grade and source."""
    return [
        {"name": name, "value": float(one), "unit": one.unit}
        | {"grade": one.grade, "source": one.source, "meaning": one.meaning}
        for name, one in bus.constants.items()
    ]


def assumptions_document(profile: Profile, assumptions: Sequence[Input]) -> JsonDocument:
    """Document of `busplan explain PROFILE --format json`: the inputs of the figures, and the whole registry."""
    return document(
        "explain",
        profile=profile.name,
        assumptions=[one._asdict() for one in assumptions],
        figures=figure_rows(profile),
        equations=equation_rows(),
        constants=constant_rows(bus_of(profile)),
    )


def input_cells(one: Input) -> tuple[Cell, ...]:
    """Cells of one input."""
    value = ShownValue(one.value, "value", one.unit, digits=DIGITS)
    return Code(one.name), value, one.unit, one.grade, one.source


def _figure_table(profile: Profile) -> Table:
    rows = (
        TableRow((command, Code(one.key), one.reference, one.unit, one.meaning))
        for command, one in explained_figures(profile)
    )
    return Table(_FIGURES, tuple(rows), Sentence(("Figures to explain",)), stacks=True)
