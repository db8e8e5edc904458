"""A kind's constants are complete: what its TOML files leave out is computed."""

from math import isfinite
from typing import get_args

import pytest

from busplan.buses import kind_named, kind_names
from busplan.sourced import Grade


@pytest.mark.parametrize("kind", kind_names())
def test_every_constant_has_a_value_a_unit_a_grade_and_a_source(kind: str) -> None:
    constants = kind_named(kind).constants
    assert [name for name, number in constants.items() if not isfinite(number)] == []
    assert {number.grade for number in constants.values()} <= set(get_args(Grade))
    for name, number in constants.items():
        assert number.name == name
        assert all((number.unit, number.source, number.meaning)), name
