"""Floats as text: the characters of Python's own `repr`, whatever the float."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from busplan.forms.float_texts import float_texts, unpadded

RANDOM = np.random.default_rng(20)
MANY = 20_000
NEAR_POWERS = [
    np.nextafter(power, towards)
    for power in (*(10.0**exponent for exponent in range(-5, 18)), *(2.0**exponent for exponent in range(-30, 60)))
    for towards in (-np.inf, power, np.inf)
]
ODD = 2.0 * np.arange(MANY) + 1
ARRAYS = {
    "as figures are": RANDOM.uniform(0, 4000, MANY),
    "of any size": 10 ** RANDOM.uniform(-2.5, 8.5, MANY) * RANDOM.choice([-1, 1], MANY),
    "with one decimal": np.round(RANDOM.uniform(-4000, 4000, MANY), 1),
    "whole": RANDOM.integers(0, 10**9, MANY).astype(float),
    "sums of decimals": RANDOM.integers(1, 10**7, MANY) / 1000 * 3,
    "halfway between 16 digits": 8e6 + ODD / 1024,
    "of all mantissas": 0.9 + ODD / 2**53,
    "of any bits": RANDOM.integers(-(2**63), 2**63 - 1, MANY).view(float),
    "beside powers": np.array(NEAR_POWERS * 2),
    "zeros": np.tile([0.0, -0.0, 1.0, np.inf, -np.inf], 40),
}


def texts(values: NDArray[np.float64]) -> list[bytes]:
    return [unpadded(one) for one in float_texts(values).tolist()]


@pytest.mark.parametrize("name", ARRAYS)
def test_floats_are_written_as_repr_does(name: str) -> None:
    values = ARRAYS[name]
    assert values.size > 100
    values = values[~np.isnan(values)]
    assert texts(values) == [repr(one).encode() for one in values.tolist()]


@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=20))
def test_any_floats_are_written_as_repr_does(few: list[float]) -> None:
    # Enough of them that they are not written one by one.
    values = np.array(few * 101)
    assert texts(values)[: len(few)] == [repr(one).encode() for one in few]


@pytest.mark.parametrize("times", [1, 200])
def test_what_is_missing_has_its_own_text(times: int) -> None:
    values = np.array([1.5, np.nan] * times)
    assert [unpadded(one) for one in float_texts(values, missing=b"null").tolist()] == [b"1.5", b"null"] * times
