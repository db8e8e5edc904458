"""Traced numbers: what they write down is what was computed."""

import inspect
import re
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses import time_slice
from busplan.buses.ieee1394 import equations
from busplan.elementwise import Traced, total
from busplan.questions.explain.formula import formula_of, formula_text, inputs, lines
from busplan.sourced import EQUATIONS, Input

# As the paper prints them, in this program's symbols; hop and the delay of a PHY, which the paper writes out in each,
# are equations of their own.
PRINTED = {
    "time_slice_us": "alpha T_s / N",
    "required_time_slice_us": "(T_r + T_w + T_npd + CTS) / N",
    "transaction_latency_us": "T_req + T_ack1 + T_exec + T_resp + T_ack2",
    "phy_delay_us": "14 / C",
    "hop_delay_us": "0.023 L / 4.5 + T_phy",
    "arbitration_phase_us": "hop H + 4 g / C + 1.63",
    "data_phase_us": "hop H + 8 B / R",
    "acknowledge_phase_us": "hop H + 0.25",
    "request_us": "ArbP + DTP",
    "response_us": "ArbP + DTP",
    "acknowledge_us": "AckP",
    "subaction_gap_us": "(29 + 16 g) / C",
    "arbitration_reset_gap_us": "(53 + 32 g) / C",
    "gaps_us": "(82 + 48 g) / C",
    "published_nodes": "(alpha T_s - CTS) / (2 (T_lant + T_sum))",
    "interval_latency_us": "T1 + T2 + T3 + T4 + T5",
    "request_and_acknowledge_us": "T_req + T_ack",
    "response_and_acknowledge_us": "T_resp + T_ack",
    "published_request_and_acknowledge_us": "3.11 + 8 P / 393.216",
}


def number(value: float, symbol: str = "x") -> Traced:
    return Traced(value, given=Input(symbol, symbol, value, "1", "given", "test", "a number"))


def test_every_equation_writes_itself_down_as_printed() -> None:
    for name in EQUATIONS:
        assert formula_of(EQUATIONS[name]) == PRINTED[name]


def test_the_formula_in_a_docstring_is_the_one_that_is_computed() -> None:
    for name in EQUATIONS:
        equation = EQUATIONS[name]
        assert f"{equation.symbol} = {PRINTED[name]} [" in str(equation.function.__doc__)
        assert f"References\n    ----------\n    {equation.source}." in str(equation.function.__doc__)


def test_the_registry_holds_equations_1_to_15() -> None:
    whole = [equation.numbers for equation in EQUATIONS.values() if not equation.part]
    # Each module enters its own when it is loaded.
    assert sorted(whole) == [(number,) for number in range(1, 16)]
    assert [one for one in whole if one > (2,)] == [(number,) for number in range(3, 16)]
    functions = {
        name
        for module in (time_slice, equations)
        for name, one in vars(module).items()
        if inspect.isfunction(one) and one.__module__ == module.__name__
    }
    assert set(EQUATIONS) == functions


LEAF = st.integers(1, 9).map(lambda value: number(float(value), f"x{value}"))
OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda left, right: left + right,
    "-": lambda left, right: left - right,
    "*": lambda left, right: left * right,
    "/": lambda left, right: left / right if right != 0 else left,
}


def applied(operation: str, left: Any, right: Any) -> Any:
    """Compute with traced numbers; plain ones alone stay whole, for a fraction is written with seven digits."""
    return OPERATIONS[operation](left, right) if isinstance(left, Traced) or isinstance(right, Traced) else left


EXPRESSION = st.recursive(
    LEAF | st.integers(2, 9),
    lambda inner: st.tuples(st.sampled_from(sorted(OPERATIONS)), inner, inner).map(lambda one: applied(*one)),
    max_leaves=8,
)


@given(EXPRESSION)
def test_any_expression_reads_back_as_its_value_in_numbers_and_in_symbols(expression: Any) -> None:
    if not isinstance(expression, Traced):
        return
    in_numbers = formula_text(expression, in_numbers=True)
    if expression.operation:
        assert eval(in_numbers) == pytest.approx(expression.value, rel=1e-5, abs=1e-9)
        symbols = {f"x{value}": float(value) for value in range(1, 10)}
        in_symbols = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", formula_text(expression, in_numbers=False))
        assert eval(in_symbols, symbols) == pytest.approx(expression.value, rel=1e-5, abs=1e-9)


def test_a_sum_of_thousands_is_short_and_has_all_its_inputs() -> None:
    each = [Traced(float(n), given=Input(f"x{n}", f"key{n}", n, "", "given", "", "")) for n in range(5000)]
    whole = 2 * total(one * 3 for one in each)
    assert isinstance(whole, Traced)
    text = formula_text(whole, in_numbers=False)
    assert text == "2 (x0 * 3 + x1 * 3 + x2 * 3 + ... 4996 more ... + x4999 * 3)"
    assert len(list(inputs(whole))) == 5000
    assert list(lines(whole)) == [whole]
