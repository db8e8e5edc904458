"""The timing models against the bench, by hand, and on arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses.ieee1394.timing import (
    TIMING_MODELS,
    Link,
    Phases,
    Responder,
    TimingModelName,
    transaction,
)
from busplan.sections.base import TRANSACTION_KINDS, TransactionKind

# Table I, experiment, as printed: payload in bytes, T1+T2 in us.
TABLE_1_MEASURED = {4: 6.0, 16: 6.3, 32: 6.6, 64: 7.5, 128: 9.1, 256: 11.5, 512: 16.9, 1024: 27.4}

# Bytes on the wire, CRCs included, as the packet table has them.
PACKETS = {
    ("read", 4): (16, 20),
    ("read", 1): (20, 28),
    ("read", 5): (20, 32),
    ("read", 12): (20, 36),
    ("write", 4): (20, 16),
    ("write", 1): (28, 16),
    ("write", 5): (32, 16),
    ("write", 12): (36, 16),
}

BENCH = Link(data_rate_mbit_s=393.216, gap_count=63, hops=1, cable_length_m=4.5)


def phases_of(
    kind: TransactionKind = "write",
    *,
    model: TimingModelName = "standard",
    payload_bytes: int = 12,
    execution_us: float = 0.0,
    link: Link = BENCH,
) -> Phases:
    return transaction(
        kind,
        model=TIMING_MODELS[model],
        link=link,
        payload_bytes=payload_bytes,
        overhead_bytes=20,
        responder=Responder(execution_us),
    )


@pytest.mark.parametrize(("payload_bytes", "measured_us"), TABLE_1_MEASURED.items())
def test_standard_is_within_12_percent_of_the_bench(payload_bytes: int, measured_us: float) -> None:
    computed_us = phases_of(payload_bytes=payload_bytes).request_and_acknowledge_us
    assert computed_us == pytest.approx(measured_us, rel=0.12)


@pytest.mark.parametrize(("payload_bytes", "measured_us"), TABLE_1_MEASURED.items())
def test_paper_is_12_to_47_percent_below_the_bench(payload_bytes: int, measured_us: float) -> None:
    computed_us = phases_of(model="paper", payload_bytes=payload_bytes).request_and_acknowledge_us
    assert 0.12 < 1 - computed_us / measured_us < 0.47


@pytest.mark.parametrize(("case", "sizes"), PACKETS.items())
def test_standard_packets_have_their_sizes_on_the_wire(
    case: tuple[TransactionKind, int], sizes: tuple[int, int]
) -> None:
    phases = phases_of(case[0], payload_bytes=case[1])
    assert (phases.request_bytes, phases.response_bytes) == sizes


@pytest.mark.parametrize("kind", TRANSACTION_KINDS)
def test_paper_charges_the_payload_and_20_bytes_to_both_packets(kind: TransactionKind) -> None:
    phases = phases_of(kind, model="paper", payload_bytes=13)
    assert (phases.request_bytes, phases.response_bytes) == (33, 33)


def test_every_phase_by_hand() -> None:
    # A read of 12 bytes over two hops at S200 and gap count 7, under the standard's clock.
    link = Link(data_rate_mbit_s=196.608, gap_count=7, hops=2, cable_length_m=4.5)
    phases = phases_of("read", execution_us=30.0, link=link)
    hops_us = 2 * (0.023 + 14 / 98.304)
    arbitration_us = hops_us + 28 / 98.304 + 1.63
    request_us = arbitration_us + hops_us + 160 / 196.608
    response_us = arbitration_us + hops_us + 288 / 196.608
    acknowledge_us = hops_us + 0.25
    expected = {
        "arbitration_us": arbitration_us,
        "request_data_us": request_us - arbitration_us,
        "response_data_us": response_us - arbitration_us,
        "request_us": request_us,
        "response_us": response_us,
        "acknowledge_us": acknowledge_us,
        "execution_us": 30.0,
        "latency_us": request_us + response_us + 2 * acknowledge_us + 30.0,
        "request_and_acknowledge_us": request_us + acknowledge_us,
        "response_and_acknowledge_us": response_us + acknowledge_us,
        "subaction_gap_us": (29 + 16 * 7) / 98.304,
        "arbitration_reset_gap_us": (53 + 32 * 7) / 98.304,
        "gaps_us": (82 + 48 * 7) / 98.304,
        # The node executes for longer than the arbitration reset gap: a subaction gap is left to wait for.
        "idle_us": (29 + 16 * 7) / 98.304,
        "transaction_us": request_us + response_us + 2 * acknowledge_us + 30.0 + (29 + 16 * 7) / 98.304,
    }
    assert {key: getattr(phases, key) for key in expected} == pytest.approx(expected, rel=1e-14)
    assert phases.latency_with_gaps_us == pytest.approx(phases.latency_us + phases.gaps_us, rel=1e-15)


@pytest.mark.parametrize("rate", [98.304, 196.608, 393.216])
def test_at_s100_the_two_models_count_gaps_alike(rate: float) -> None:
    link = Link(data_rate_mbit_s=rate, gap_count=63, hops=1, cable_length_m=4.5)
    paper, standard = (phases_of(model=model, link=link).gaps_us for model in TIMING_MODELS)
    assert standard / paper == pytest.approx(rate / 98.304, rel=1e-15)


@given(
    payload=st.lists(st.integers(1, 4096), min_size=1, max_size=8),
    gap_count=st.integers(0, 63),
    hops=st.integers(1, 40),
    kind=st.sampled_from(TRANSACTION_KINDS),
    model=st.sampled_from(sorted(TIMING_MODELS)),
)
def test_arrays_give_what_scalars_give(
    payload: list[int], gap_count: int, hops: int, kind: TransactionKind, model: TimingModelName
) -> None:
    link = Link(data_rate_mbit_s=393.216, gap_count=gap_count, hops=hops, cable_length_m=4.5)
    arrays = transaction(
        kind,
        model=TIMING_MODELS[model],
        link=link,
        payload_bytes=np.array(payload),
        overhead_bytes=20,
        responder=Responder(12.5),
    )
    for index, size in enumerate(payload):
        one = phases_of(kind, model=model, payload_bytes=size, execution_us=12.5, link=link)
        for name, value in one._asdict().items():
            assert np.broadcast_to(getattr(arrays, name), len(payload))[index] == value, name
