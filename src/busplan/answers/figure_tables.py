"""Tables of registered figures: figures down, what they belong to across."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from busplan.buses.figure import Figure
from busplan.forms.blocks import Cell, Sentence, State, Table, TableColumn, TableRow, figure_value


class Owner(NamedTuple):
    """What has figures: one column."""

    column: TableColumn
    figures: object
    """Figures are its attributes."""
    at: str
    """Its place in the JSON document."""


def figure_table(
    rows: Iterable[tuple[Figure, int]], owners: Sequence[Owner], *, caption: Sentence, unit: bool = True
) -> Table:
    """Lay figures out side by side.

    Parameters
    ----------
    rows
        Figures with their levels.
    owners
        One a column.
    caption
        What the table shows.
    unit
        Whether units have a column; otherwise the caption says the unit of all.
    """
    head = (TableColumn("figure", kind="words"), TableColumn("eq", kind="words"), TableColumn("unit", kind="words"))
    columns = (*head[: 3 if unit else 2], *(owner.column for owner in owners))
    return Table(columns, tuple(_row(figure, level, owners, unit=unit) for figure, level in rows), caption)


def _row(figure: Figure, level: int, owners: Sequence[Owner], *, unit: bool) -> TableRow:
    words = (figure.label, figure.reference, figure.column or figure.unit)[: 3 if unit else 2]
    return TableRow((*words, *(_cell(figure, owner) for owner in owners)), level)


def _cell(figure: Figure, owner: Owner) -> Cell:
    value = getattr(owner.figures, figure.key)
    return figure_value(figure, value, at=f"{owner.at}/{figure.key}", state=cell_state(figure, value))


def cell_state(figure: Figure, value: object) -> State:
    """What a value says of the plan where it stands alone: a truth that should be and is not fails."""
    return "fails" if figure.sort == "truth" and figure.better == "more" and value is False else "neutral"
