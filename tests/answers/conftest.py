"""What tests of answers share."""

from collections.abc import Callable
from typing import Any

import pytest

from busplan.forms.blocks import Report, values_in


def _at(document: Any, pointer: str) -> Any:
    for step in pointer.split("/")[1:]:
        document = document[int(step) if isinstance(document, list | tuple) else step]
    return document


def _require(report: Report) -> int:
    document = report.document()
    found = [value for value in values_in(tuple(report.blocks())) if value.at]
    for value in found:
        assert _at(document, value.at) == value.value, value
        place, name = value.at.rsplit("/", 1)
        record = _at(document, place)
        # A record of one figure says which one it is.
        assert value.key in (name, record.get("figure"), record.get("key")), value
    return len(found)


@pytest.fixture
def values_in_their_places() -> Callable[[Report], int]:
    """Check that every figure of a report stands at its place of the JSON; give how many have one."""
    return _require
