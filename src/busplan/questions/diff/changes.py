"""Keys whose values differ between two profiles, written so that the difference is visible."""

from collections.abc import Iterable, Sequence
from itertools import takewhile
from operator import eq
from typing import Final

from busplan.forms.blocks import Cell, Code, JsonDocument, Sentence, ShownValue, Table, TableColumn, TableRow
from busplan.forms.numbers import MISSING, figure_text
from busplan.printable import json_text
from busplan.profile.keys import KeyValue
from busplan.profile.write import value_text
from busplan.questions.diff.difference import KeyDifference

_COLUMNS: Final = (
    TableColumn("key", kind="words", wraps=True),
    *(TableColumn(heading, kind="words", wraps=True) for heading in ("A", "B")),
)
_ALL_DIGITS: Final = 17
"""Digits that distinguish any two floats."""
_MOST_ITEMS: Final = 8
"""Longest list shown in full."""
_MOST_CHARACTERS: Final = 40
"""Longest text shown in full."""
_CONTEXT: Final = 8
"""Characters shown before the first one that differs."""


def change_table(keys: Iterable[KeyDifference]) -> Table:
    """One row for each key: its values in A and B, with a note if a value is a default."""
    rows = ((Code(one.key), _cell(one.key, one.a, one.b), _cell(one.key, one.b, one.a)) for one in keys)
    return Table(_COLUMNS, tuple(map(TableRow, rows)))


def _cell(key: str, value: KeyValue | None, other: KeyValue | None) -> Cell:
    """One side of a difference; the other side decides which part or how many digits of a long value are shown."""
    if value is None:
        return MISSING
    own, beside = value.value, None if other is None else other.value
    shown: ShownValue | Code
    if isinstance(own, int | float) and not isinstance(own, bool):
        shown = ShownValue(own, key)
        if (
            own != beside
            and isinstance(beside, int | float)
            and figure_text(shown) == figure_text(shown._replace(value=beside))
        ):
            shown = shown._replace(digits=_ALL_DIGITS)
    else:
        shown = Code(shown_value(own, beside))
    return shown if value.source == "file" else Sentence((shown, " (default)"))


def shown_value(value: object, other: object = None) -> str:
    """Write a value as TOML; of a long one, only the part that differs from the other.

    Examples
    --------
    >>> shown_value(4000.0), shown_value(None), shown_value("S400"), shown_value(False), shown_value(["sdo"])
    ('4000', 'none', '"S400"', 'false', '["sdo"]')
    >>> shown_value((1, 2, 3, 4, 5, 6, 7, 8, 10), (1, 2, 3, 4, 5, 6, 7, 9, 10))
    '[7 alike, 8, 1 alike]'
    """
    match value:
        case None:
            return "none"
        case str():
            return _text(value, other if isinstance(other, str) else "")
        case tuple() | list():
            return _list(tuple(value), tuple(other) if isinstance(other, tuple | list) else ())
        case bool():
            return value_text(value)
        case float():
            return repr(value).removesuffix(".0")
    return str(value)


def _alike(one: Sequence[object], other: Sequence[object]) -> int:
    """Length of the common beginning of two sequences."""
    return sum(takewhile(bool, map(eq, one, other)))


def _list(items: tuple[object, ...], other: tuple[object, ...]) -> str:
    if len(items) <= _MOST_ITEMS:
        return f"[{', '.join(map(shown_value, items))}]"
    before = _alike(items, other)
    after = _alike(items[before:][::-1], other[before:][::-1])
    middle = items[before : len(items) - after]
    more = len(middle) - _MOST_ITEMS
    parts = (
        *([f"{before} alike"] if before else []),
        *map(shown_value, middle[:_MOST_ITEMS]),
        *([f"{more} more"] if more > 0 else []),
        *([f"{after} alike"] if after else []),
    )
    return f"[{', '.join(parts)}]"


def _text(text: str, other: str) -> str:
    if len(text) <= _MOST_CHARACTERS:
        return json_text(text)
    start = max(0, _alike(text, other) - _CONTEXT)
    end = start + _MOST_CHARACTERS
    piece = json_text(text[start:end])
    return f"{'..' if start else ''}{piece}{'..' if end < len(text) else ''}"


def change_document(one: KeyDifference) -> JsonDocument:
    """A difference as plain data, both values in full."""
    return {
        "key": one.key,
        "a": one.a and one.a.value,
        "a_source": "absent" if one.a is None else one.a.source,
        "b": one.b and one.b.value,
        "b_source": "absent" if one.b is None else one.b.source,
    }
