"""The number of nodes as a polynomial, against counting and against Python's own arithmetic."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.analysis.capacity.polynomial import NODES, NoPolynomialError, Polynomial
from busplan.elementwise import choose, from_table, interpolated, larger, rounded_up

WHOLE = st.integers(0, 50)
MANY = st.integers(0, 10**7)


@given(c0=WHOLE, c1=st.integers(1, 50), c2=WHOLE, most=MANY)
def test_the_largest_within_a_bound_is_the_one_that_fits_and_its_successor_does_not(
    c0: int, c1: int, c2: int, most: int
) -> None:
    one = Polynomial(c0, c1, c2)
    largest = one.largest_within(most)
    assert largest == int(largest) >= 0
    assert one.at(largest + 1) > most
    assert largest == 0 or one.at(largest) <= most


@given(c1=st.floats(0.01, 50), c2=st.floats(0, 50), nodes=st.integers(1, 100_000))
def test_a_bound_that_is_met_exactly_is_kept(c1: float, c2: float, nodes: int) -> None:
    one = Polynomial(0, c1, c2)
    assert one.largest_within(one.at(nodes)) == nodes


def test_arrays_of_bounds_and_coefficients_are_answered_one_by_one() -> None:
    c1, most = np.array([1.0, 2.0, 5.0])[:, None], np.array([0.0, 9.0, 1e6])
    found = Polynomial(3.0, c1, 0.5).largest_within(most)
    alone = [[Polynomial(3.0, float(one), 0.5).largest_within(float(two)) for two in most] for one in c1.ravel()]
    assert np.asarray(found).tolist() == alone


@given(a=WHOLE, b=WHOLE, c=st.integers(1, 50), nodes=st.integers(0, 1000))
def test_arithmetic_is_that_of_its_values(a: int, b: int, c: int, nodes: int) -> None:
    def of(number: Polynomial | int) -> Polynomial | float:
        return (a - number) + (number * b - 3) * number / c - (-number)

    formula = of(NODES)
    assert isinstance(formula, Polynomial)
    assert formula.at(nodes) == pytest.approx(of(nodes))


@pytest.mark.parametrize(
    "ask",
    [
        lambda: NODES > 3,
        lambda: larger(NODES, 3.0),
        lambda: choose(NODES, 1, 2),
        lambda: rounded_up(NODES),
        lambda: 1 / NODES,
        lambda: NODES**2,
        lambda: from_table((1.0, 2.0), NODES, words="a table"),
        lambda: interpolated((1.0, 2.0), (1.0, 2.0), NODES, words="a table"),
        lambda: (NODES * NODES * NODES).largest_within(9),
        lambda: (5 - NODES).largest_within(9),
        lambda: bool(NODES),
        lambda: float(NODES),
    ],
)
def test_what_has_no_such_form_is_noticed(ask: object) -> None:
    assert callable(ask)
    with pytest.raises((NoPolynomialError, TypeError)):
        ask()
