"""Values of a varied key, one by one; as text they are tested with `--vary`."""

import re

import pytest

from busplan.errors import BusplanError
from busplan.questions.sweep.values import listed


def test_a_float_that_is_whole_may_stand_for_a_count() -> None:
    found = listed([1.0, 2.5, 3, 2.0**60, "optimal"], name="nodes", words=("optimal",)).values
    assert found == (1, 2.5, 3, 2.0**60, "optimal")
    assert [type(one) for one in found] == [int, float, int, float, str]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "nodes: no values; give at least one"),
        ([1, True], "nodes: True is not a finite number"),
        ([float("nan")], "nodes: nan is not a finite number"),
        ([float("inf")], "nodes: inf is not a finite number"),
        (["best"], "nodes: 'best' is not a finite number"),
        (["optimal"], "nodes: 'optimal' is not a finite number"),
        ([None], "nodes: None is not a finite number"),
        ([[1]], "nodes: [1] is not a finite number"),
        ([1, 2, 1.0], "nodes: 1.0 is given twice"),
    ],
)
def test_what_is_no_value_is_refused(values: list[object], message: str) -> None:
    with pytest.raises(BusplanError, match=f"^{re.escape(message)}$"):
        listed(values, name="nodes")


def test_a_whole_number_of_any_size_is_one() -> None:
    assert listed([10**400], name="nodes").values == (10**400,)
