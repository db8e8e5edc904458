"""Tables of registered figures: one row for each figure, one column for each owner."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from busplan.buses.figure import Figure
from busplan.forms.blocks import Sentence, Table, TableColumn, TableRow, attribute_value


class Owner(NamedTuple):
    """An object with figures: one column."""

    column: TableColumn
    figures: object
    """Object that has the figures as attributes."""
    at: str
    """JSON pointer to it."""


def figure_table(
    rows: Iterable[tuple[Figure, int]], owners: Sequence[Owner], *, caption: Sentence, unit: bool = True
) -> Table:
    """Table of figures, the owners side by side.

    Parameters
    ----------
    rows
        Figures with their levels.
    owners
        One for each column.
    caption
        Caption of the table.
    unit
        If False, the column of units is left out: the caption says the unit.
    """
    head = (TableColumn("figure", kind="words"), TableColumn("eq", kind="words"), TableColumn("unit", kind="words"))
    columns = (*head[: 3 if unit else 2], *(owner.column for owner in owners))
    return Table(columns, tuple(_row(figure, level, owners, unit=unit) for figure, level in rows), caption)


def _row(figure: Figure, level: int, owners: Sequence[Owner], *, unit: bool) -> TableRow:
    words = (figure.label, figure.reference, figure.column or figure.unit)[: 3 if unit else 2]
    return TableRow((*words, *(attribute_value(figure, owner.figures, at=owner.at) for owner in owners)), level)
