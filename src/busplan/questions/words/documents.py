"""Common parts of all answers: JSON documents, CSV rows, and tables of registered figures."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from busplan.buses.figure import Figure
from busplan.forms.blocks import (
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    State,
    Table,
    TableColumn,
    TableRow,
    attribute_value,
    joined,
)
from busplan.profile.changes import KeyChanges

JSON_SCHEMA: Final = 1


def document(command: str, **content: object) -> JsonDocument:
    """JSON document of a command: schema version, command name and content."""
    return {"schema": JSON_SCHEMA, "command": command, **content}


def fields(owner: object, *names: str) -> Record:
    """Attributes by name as plain data: a tuple becomes a list, and all are None where there is no owner."""
    values = {name: getattr(owner, name) if owner is not None else None for name in names}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def with_profile(name: str, records: Sequence[Record]) -> list[Record]:
    """Rows for CSV with the profile's name in front, so that tables of several runs can be joined."""
    return [{"profile": name, **record} for record in records]


def parts_by(parts: Mapping[str, str]) -> list[Record]:
    """Parts of a kind's model that published figures set or test, each with those figures."""
    return [{"part": part, "by": words} for part, words in parts.items()]


def changed_document(content: Mapping[str, Any], changes: KeyChanges) -> JsonDocument:
    """Add the new values by --set to a document, as `changes`; `diff` has other `changes` already."""
    if not changes.by_set:
        return dict(content)
    name = "changes" if "changes" not in content else "changes_of_both"
    head = {key: content[key] for key in ("schema", "command")}
    return {**head, name: {change.key: change.value for change in changes.by_set}, **content}


def changed_report(report: Report, changes: KeyChanges) -> Report:
    """Name the --set options in an answer: in a sentence at its top, and in its JSON document."""
    return report._replace(
        blocks=(*changes_sentences(changes), *report.blocks),
        document=changed_document(report.document, changes),
    )


def changes_sentences(changes: KeyChanges) -> list[Sentence]:
    """Name the --set options in a sentence, because what is computed is not what the file says; empty without them."""
    options = [Sentence((Code(change.typed),)) for change in changes.by_set]
    return [joined(Sentence(("With ",)), joined(*options, by=" and "), Sentence((".",)), by="")] if options else []


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
    equation = TableColumn("eq", kind="words", rank=_FIRST_TO_LEAVE, is_detail=hides_equations)
    head = [TableColumn("figure", kind="words"), equation]
    head += [TableColumn("unit", kind="words")] if unit else []
    shown = []
    for figure, level in rows:
        words = (figure.label, figure.reference, figure.column or figure.unit)[: len(head)]
        values = (_value(figure, owner, state) for owner in owners)
        shown.append(TableRow((*words, *values), level, is_detail=is_detail(figure)))
    # Each panel of a narrow terminal says the unit again.
    return Table((*head, *(owner.column for owner in owners)), tuple(shown), caption, heads=len(head))


def _value(figure: Figure, owner: Owner, state: Callable[[Figure, Any], State]) -> ShownValue:
    value, own = attribute_value(figure, owner.figures), state(figure, owner.figures)
    return value if own == "neutral" else value._replace(state=own)
