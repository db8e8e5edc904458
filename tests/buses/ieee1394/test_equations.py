"""The equations against the paper's own figures, and as operators on arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses import time_slice
from busplan.buses.ieee1394 import equations as eq

PAPER_CLOCK = 393.216
BASE_CLOCK = 98.304

# Table I, theory column, as printed: payload in bytes, T1+T2 in us.
TABLE_1_THEORY = {4: 3.19, 16: 3.44, 32: 3.76, 64: 4.41, 128: 5.71, 256: 8.32, 512: 13.53, 1024: 23.94}


@pytest.mark.parametrize(("payload_bytes", "printed_us"), TABLE_1_THEORY.items())
def test_equation_15_gives_table_1_theory_to_its_two_decimals(payload_bytes: int, printed_us: float) -> None:
    assert round(float(eq.published_request_and_acknowledge_us(payload_bytes)), 2) == printed_us


def test_equations_4_to_6_fall_6_4_ns_short_of_equation_15() -> None:
    # By hand at N = 1, g = 63, 393.216 Mbit/s: three hops, the gap term, 20 bytes, and the two constants.
    by_hand_us = 3 * (0.023 + 14 / 393.216) + 252 / 393.216 + 160 / 393.216 + 1.63 + 0.25
    hop_us = eq.hop_delay_us(4.5, phy_delay_us=eq.phy_delay_us(PAPER_CLOCK))
    arbitration_us = eq.arbitration_phase_us(1, hop_us=hop_us, gap_count=63, gap_clock_mbit_s=PAPER_CLOCK)
    data_us = eq.data_phase_us(1, hop_us=hop_us, packet_bytes=20, data_rate_mbit_s=PAPER_CLOCK)
    acknowledge_us = eq.acknowledge_us(eq.acknowledge_phase_us(1, hop_us=hop_us))
    computed_us = eq.request_and_acknowledge_us(
        eq.request_us(arbitration_us, data_us=data_us), acknowledge_us=acknowledge_us
    )
    assert computed_us == pytest.approx(by_hand_us, rel=1e-15)
    assert eq.published_request_and_acknowledge_us(0) - computed_us == pytest.approx(6.418e-3, abs=1e-6)


@pytest.mark.parametrize(("clock", "printed_us"), [(PAPER_CLOCK, 7.90), (BASE_CLOCK, 31.60)])
def test_equation_10_at_gap_count_63_under_either_clock(clock: float, printed_us: float) -> None:
    assert round(float(eq.gaps_us(63, gap_clock_mbit_s=clock)), 2) == printed_us


@given(gap_count=st.integers(0, 63), clock=st.floats(1, 1e4))
def test_equation_10_is_the_sum_of_its_two_gaps(gap_count: int, clock: float) -> None:
    parts = eq.subaction_gap_us(gap_count, gap_clock_mbit_s=clock) + eq.arbitration_reset_gap_us(
        gap_count, gap_clock_mbit_s=clock
    )
    assert eq.gaps_us(gap_count, gap_clock_mbit_s=clock) == pytest.approx(parts, rel=1e-14)
    assert eq.gaps_us(gap_count, gap_clock_mbit_s=clock) == pytest.approx((82 + 48 * gap_count) / clock, rel=1e-14)


def test_phases_by_hand_under_the_base_clock() -> None:
    hop_us, phy_us = 0.023 + 14 / 98.304, eq.phy_delay_us(BASE_CLOCK)
    assert eq.hop_delay_us(4.5, phy_delay_us=phy_us) == pytest.approx(hop_us, rel=1e-15)
    assert eq.hop_delay_us(9.0, phy_delay_us=phy_us) == pytest.approx(hop_us + 0.023, rel=1e-15)
    assert eq.arbitration_phase_us(3, hop_us=hop_us, gap_count=8, gap_clock_mbit_s=BASE_CLOCK) == pytest.approx(
        3 * hop_us + 32 / 98.304 + 1.63, rel=1e-15
    )
    assert eq.data_phase_us(3, hop_us=hop_us, packet_bytes=36, data_rate_mbit_s=PAPER_CLOCK) == pytest.approx(
        3 * hop_us + 288 / 393.216, rel=1e-15
    )
    assert eq.acknowledge_phase_us(3, hop_us=hop_us) == pytest.approx(3 * hop_us + 0.25, rel=1e-15)


@given(st.lists(st.floats(0, 1e3), min_size=5, max_size=5))
def test_equation_12_says_what_equation_3_says(parts: list[float]) -> None:
    request, ack1, execution, response, ack2 = parts
    latency_us = eq.transaction_latency_us(
        request,
        request_acknowledge_us=ack1,
        execution_us=execution,
        response_us=response,
        response_acknowledge_us=ack2,
    )
    first_half = eq.request_and_acknowledge_us(request, acknowledge_us=ack1)
    second_half = eq.response_and_acknowledge_us(response, acknowledge_us=ack2)
    assert latency_us == pytest.approx(
        eq.interval_latency_us(first_half, t2_us=0.0, t3_us=execution, t4_us=second_half, t5_us=0.0), abs=1e-9
    )


def test_equation_11_inverts_equation_2_where_nothing_depends_on_the_nodes() -> None:
    reads_us = writes_us = 7 * (40.0 + 8.0)
    needed_us = 7 * time_slice.required_time_slice_us(
        reads_us, writes_us=writes_us, nonperiodic_us=0.0, sync_us=0.5, nodes=7
    )
    assert eq.published_nodes(needed_us, sync_us=0.5, latency_us=40.0, gaps_us=8.0) == pytest.approx(7)
    assert time_slice.time_slice_us(2 * needed_us, slice_ratio=0.5, nodes=7) == pytest.approx(needed_us / 7)


ARRAY_CASES = {
    "time_slice_us": ("period_us", "slice_ratio", "nodes"),
    "required_time_slice_us": ("reads_us", "writes_us", "nonperiodic_us", "sync_us", "nodes"),
    "transaction_latency_us": (
        "request_us",
        "request_acknowledge_us",
        "execution_us",
        "response_us",
        "response_acknowledge_us",
    ),
    "phy_delay_us": ("gap_clock_mbit_s",),
    "hop_delay_us": ("cable_length_m", "phy_delay_us"),
    "arbitration_phase_us": ("hops", "hop_us", "gap_count", "gap_clock_mbit_s"),
    "data_phase_us": ("hops", "hop_us", "packet_bytes", "data_rate_mbit_s"),
    "acknowledge_phase_us": ("hops", "hop_us"),
    "request_us": ("arbitration_us", "data_us"),
    "response_us": ("arbitration_us", "data_us"),
    "acknowledge_us": ("acknowledge_phase_us",),
    "subaction_gap_us": ("gap_count", "gap_clock_mbit_s"),
    "arbitration_reset_gap_us": ("gap_count", "gap_clock_mbit_s"),
    "gaps_us": ("gap_count", "gap_clock_mbit_s"),
    "published_nodes": ("available_us", "sync_us", "latency_us", "gaps_us"),
    "interval_latency_us": ("t1_us", "t2_us", "t3_us", "t4_us", "t5_us"),
    "request_and_acknowledge_us": ("request_us", "acknowledge_us"),
    "response_and_acknowledge_us": ("response_us", "acknowledge_us"),
    "published_request_and_acknowledge_us": ("payload_bytes",),
}


PUBLIC = {
    name: value
    for module in (time_slice, eq)
    for name, value in vars(module).items()
    if callable(value) and value.__module__ == module.__name__
}


def test_arrays_broadcast_and_equal_the_scalars() -> None:
    for name, arguments in ARRAY_CASES.items():
        function = PUBLIC[name]
        random = np.random.default_rng(15)
        # Every argument on an axis of its own: the result must have them all.
        values = {
            argument: random.uniform(1, 100, size=2).reshape(
                [2 if axis == index else 1 for axis in range(len(arguments))]
            )
            for index, argument in enumerate(arguments)
        }
        result = function(**values)
        assert result.shape == (2,) * len(arguments)
        for index in np.ndindex(result.shape):
            scalars = {key: float(value.ravel()[index[axis]]) for axis, (key, value) in enumerate(values.items())}
            scalar = function(**scalars)
            assert isinstance(scalar, float)
            assert result[index] == scalar


def test_every_public_function_is_broadcast_tested() -> None:
    assert set(PUBLIC) == set(ARRAY_CASES)


def test_a_rate_of_zero_is_an_error() -> None:
    with pytest.raises(ZeroDivisionError):
        eq.gaps_us(63, gap_clock_mbit_s=0.0)
