"""What tests of answers share."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from busplan.forms.blocks import Report, Sentence, ShownValue, Table


def values_in(item: object) -> Iterator[ShownValue]:
    """Every figure in a block, or in several, in reading order."""
    if isinstance(item, ShownValue):
        yield item
    elif isinstance(item, tuple):
        for one in item:
            yield from values_in(one)


def values_by_key(document: Any, found: dict[str, list[Any]] | None = None) -> dict[str, list[Any]]:
    """All values of a document by their key; a record of one figure says which one it is."""
    found = {} if found is None else found
    if isinstance(document, dict):
        for key, value in document.items():
            found.setdefault(key, []).append(value)
            values_by_key(value, found)
        for name in ("figure", "key"):
            if isinstance(document.get(name), str):
                found.setdefault(document[name], []).extend(document.values())
    elif isinstance(document, list | tuple):
        for one in document:
            values_by_key(one, found)
    return found


def _outside_sentences(blocks: object) -> Iterator[ShownValue]:
    """The figures in cells and beside their names; other sentences also count things, and say what is short."""
    if isinstance(blocks, Table):
        yield from values_in(blocks.rows)
    elif isinstance(blocks, ShownValue):
        yield blocks
    elif isinstance(blocks, tuple) and not isinstance(blocks, Sentence):
        for one in blocks:
            yield from _outside_sentences(one)


def _require(report: Report) -> int:
    known = values_by_key(report.document())
    found = [value for value in _outside_sentences(tuple(report.blocks())) if value.key in known]
    for value in found:
        assert value.value in known[value.key], value
    return len(found)


@pytest.fixture
def values_of_the_document() -> Callable[[Report], int]:
    """Check that every figure in a cell is a value of its key in the JSON; give how many there are."""
    return _require


@pytest.fixture(name="values_in")
def values_in_fixture() -> Callable[[object], Iterator[ShownValue]]:
    """Every figure in a block, or in several, in reading order."""
    return values_in
