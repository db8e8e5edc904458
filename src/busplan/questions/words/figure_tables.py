"""Tables of registered figures: one row for each figure, one column for each owner."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, NamedTuple

from busplan.buses.figure import Figure
from busplan.forms.blocks import Sentence, ShownValue, State, Table, TableColumn, TableRow, attribute_value

_FIRST_TO_LEAVE: Final = 9
"""Rank of the equations: a narrow terminal has the figures rather."""


class Owner(NamedTuple):
    """An object with figures: one column."""

    column: TableColumn
    figures: object
    """Object that has the figures as attributes."""


def figure_table(
    rows: Iterable[tuple[Figure, int]],
    owners: Sequence[Owner],
    *,
    caption: Sentence,
    unit: bool = True,
    hides_equations: bool = False,
    is_detail: Callable[[Figure], bool] = lambda _figure: False,
    state: Callable[[Figure, Any], State] = lambda _figure, _figures: "neutral",
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
    hides_equations
        If True, the column of equations and sources is shown only in a whole answer.
    is_detail
        Whether the row of a figure is shown only in a whole answer.
    state
        State of a figure of an owner's object, beside that of a truth.
    """
    head = [
        TableColumn("figure", kind="words"),
        TableColumn("eq", kind="words", rank=_FIRST_TO_LEAVE, is_detail=hides_equations),
    ]
    head += [TableColumn("unit", kind="words")] if unit else []
    shown = []
    for figure, level in rows:
        words = (figure.label, figure.reference, figure.column or figure.unit)[: len(head)]
        values = (_value(figure, owner, state) for owner in owners)
        shown.append(TableRow((*words, *values), level, is_detail=is_detail(figure)))
    # Each panel of a narrow terminal says the unit again.
    return Table((*head, *(owner.column for owner in owners)), tuple(shown), caption, heads=len(head))


def _value(figure: Figure, owner: Owner, state: Callable[[Figure, Any], State]) -> ShownValue:
    found, own = attribute_value(figure, owner.figures), state(figure, owner.figures)
    return found if own == "neutral" else found._replace(state=own)
