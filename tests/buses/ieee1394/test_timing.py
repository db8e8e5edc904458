"""The phases of a transaction under both timing models, as `busplan latency` shows them: by hand, and on the bench."""

import re
from collections.abc import Mapping

import pytest

import busplan

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

EXECUTION = {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.0}


def phases_of(kind: str, model: str, **changes: object) -> Mapping[str, float | None]:
    """Phases on the bench: one node, one hop, S400, gap count 63."""
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    bench = busplan.load_profile("paper-two-node", changes={"node.execution": EXECUTION, **keys})
    transactions = busplan.latency(bench, timing_model=model).transactions
    (phases,) = (one.phases for one in transactions if one.transaction == kind)
    return phases


@pytest.mark.parametrize(("payload_bytes", "measured_us"), TABLE_1_MEASURED.items())
def test_standard_is_within_12_percent_of_the_bench_and_paper_13_to_47_below(
    payload_bytes: int, measured_us: float
) -> None:
    paper_us, standard_us = (
        phases_of("write", model, payload__write_bytes=payload_bytes)["request_and_acknowledge_us"] or 0.0
        for model in ("paper", "standard")
    )
    assert standard_us == pytest.approx(measured_us, rel=0.12)
    assert 0.12 < 1 - paper_us / measured_us < 0.47


@pytest.mark.parametrize(("case", "sizes"), PACKETS.items())
def test_standard_packets_have_their_sizes_on_the_wire(case: tuple[str, int], sizes: tuple[int, int]) -> None:
    kind, payload_bytes = case
    phases = phases_of(kind, "standard", **{f"payload__{kind}_bytes": payload_bytes})
    assert (phases["request_bytes"], phases["response_bytes"]) == sizes


@pytest.mark.parametrize("answer", ["unified", "split"])
def test_a_host_slower_than_the_gap_lengthens_a_transaction_by_what_it_is_slower(answer: str) -> None:
    fast, slow = (
        phases_of("write", "standard", node__write_response=answer, host__transaction_us=us) for us in (0.0, 100.0)
    )
    gap_us = fast["idle_us"] or 0.0
    assert gap_us > 0
    assert (slow["transaction_us"] or 0.0) - (fast["transaction_us"] or 0.0) == pytest.approx(100.0 - gap_us)


@pytest.mark.parametrize("kind", ["read", "write"])
def test_paper_charges_the_payload_and_20_bytes_to_both_packets(kind: str) -> None:
    phases = phases_of(kind, "paper", **{f"payload__{kind}_bytes": 13})
    assert (phases["request_bytes"], phases["response_bytes"]) == (33, 33)


def test_every_phase_by_hand() -> None:
    # A read of 12 bytes over two hops at S200 and gap count 7, under the standard's clock.
    phases = phases_of("read", "standard", bus__nodes=2, bus__speed="S200", bus__gap_count=7, payload__read_bytes=12)
    hops_us = 2 * (0.023 + 14 / 98.304)
    arbitration_us = hops_us + 28 / 98.304 + 1.63
    request_us = arbitration_us + hops_us + 160 / 196.608
    response_us = arbitration_us + hops_us + 288 / 196.608
    acknowledge_us = hops_us + 0.25
    latency_us = request_us + response_us + 2 * acknowledge_us + 30.0
    subaction_us, reset_us = (29 + 16 * 7) / 98.304, (53 + 32 * 7) / 98.304
    expected = {
        "hops": 2,
        "gap_count": 7,
        "request_bytes": 20,
        "response_bytes": 36,
        "arbitration_us": arbitration_us,
        "request_data_us": request_us - arbitration_us,
        "response_data_us": response_us - arbitration_us,
        "request_us": request_us,
        "response_us": response_us,
        "acknowledge_us": acknowledge_us,
        "hold_us": 0.0,
        "execution_us": 30.0,
        "worst_extra_us": 0.0,
        "latency_us": latency_us,
        "interval_latency_us": latency_us,
        "request_and_acknowledge_us": request_us + acknowledge_us,
        "request_and_acknowledge_eq15_us": 3.11 + 8 * 12 / 393.216,
        "response_and_acknowledge_us": response_us + acknowledge_us,
        "subaction_gap_us": subaction_us,
        "arbitration_reset_gap_us": reset_us,
        "gaps_us": subaction_us + reset_us,
        "latency_with_gaps_us": latency_us + subaction_us + reset_us,
        # The node executes for longer than the arbitration reset gap: a subaction gap is left to wait for.
        "idle_us": subaction_us,
        "host_us": 0.0,
        "transaction_us": latency_us + subaction_us,
        "all_us": 2 * (latency_us + subaction_us),
    }
    assert phases == pytest.approx(expected, rel=1e-14)


def test_phases_of_answers_that_need_no_arbitration_by_hand() -> None:
    # As above; the node holds the bus for 1.2 us, or its acknowledge is the answer. Nobody waits for its execution.
    changes = {"bus__nodes": 2, "bus__speed": "S200", "bus__gap_count": 7, "node__execution__worst_extra_us": 9.0}
    hops_us = 2 * (0.023 + 14 / 98.304)
    arbitration_us, acknowledge_us = hops_us + 28 / 98.304 + 1.63, hops_us + 0.25
    read = phases_of(
        "read", "standard", **changes, payload__read_bytes=12, node__read_response="concatenated", node__response_us=1.2
    )
    request_us, response_us = arbitration_us + hops_us + 160 / 196.608, hops_us + 288 / 196.608
    latency_us, reset_us = request_us + response_us + 2 * acknowledge_us + 1.2, (53 + 32 * 7) / 98.304
    expected = {
        "response_us": response_us,
        "response_and_acknowledge_us": response_us + acknowledge_us,
        "hold_us": 1.2,
        "execution_us": 0.0,
        "worst_extra_us": 0.0,
        "latency_us": latency_us,
        "interval_latency_us": latency_us,
        "idle_us": reset_us,
        "transaction_us": latency_us + reset_us,
    }
    assert {key: read[key] for key in expected} == pytest.approx(expected, rel=1e-14)
    written = phases_of("write", "standard", **changes, payload__write_bytes=12, node__write_response="unified")
    request_us = arbitration_us + hops_us + 288 / 196.608
    none = ("response_bytes", "response_data_us", "response_us", "response_and_acknowledge_us", "hold_us")
    latency_us = request_us + acknowledge_us
    expected = dict.fromkeys((*none, "execution_us", "worst_extra_us"), 0.0) | {
        "latency_us": latency_us,
        "interval_latency_us": latency_us,
        "idle_us": reset_us,
        "transaction_us": latency_us + reset_us,
    }
    assert {key: written[key] for key in expected} == pytest.approx(expected, rel=1e-14)


SUB_US, RESET_US = (29 + 16 * 63) / 98.304, (53 + 32 * 63) / 98.304
"""10.549 and 21.047 us."""


@pytest.mark.parametrize(
    ("model", "changes", "idle"),
    [
        # The paper's gaps run by the clock of S400, four times as fast.
        ("paper", {}, [("subaction gap", SUB_US / 4), ("arbitration reset gap", RESET_US / 4)]),
        (
            "standard",
            {"node__read_response": "concatenated"},
            [("arbitration reset gap after the transaction", RESET_US)],
        ),
        # A node that is ready before the subaction gap waits for it; one that is later than the reset gap waits again.
        (
            "standard",
            {"node__execution__base_us": 2.0},
            [
                ("rest of the subaction gap before the response", SUB_US - 2),
                ("arbitration reset gap after the response", RESET_US),
            ],
        ),
        (
            "standard",
            {"node__execution__base_us": 15.0},
            [("arbitration reset gap after the response", RESET_US)],
        ),
        ("standard", {"node__execution__base_us": 40.0}, [("subaction gap after the response", SUB_US)]),
        # A node that is alone with its host may have had its turn, and then waits for the reset gap.
        (
            "standard",
            {"node__execution__base_us": 2.0, "bus__nodes": 1},
            [
                ("rest of the subaction gap before the response", SUB_US - 2),
                ("arbitration reset gap after the response", RESET_US),
                ("allowance for a faster node", RESET_US - SUB_US),
            ],
        ),
        # At most 25 us: a node that is ready with the reset gap makes the next request wait for longer.
        (
            "standard",
            {"node__execution__base_us": 15.0, "node__execution__worst_extra_us": 10.0},
            [
                ("subaction gap after the response", SUB_US),
                ("allowance for a faster node", 2 * RESET_US - 25 - SUB_US),
            ],
        ),
    ],
)
def test_idle_bus_of_a_transaction_by_hand(
    model: str, changes: dict[str, object], idle: list[tuple[str, float]]
) -> None:
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    bench = busplan.load_profile("paper-two-node", changes={"node.execution": EXECUTION, "bus.nodes": 2, **keys})
    gaps = ("subaction_gap", "arbitration_reset_gap", "allowance")
    events = busplan.timeline(bench, timing_model=model).cycle_events
    found = [
        (one.label, one.duration_us)
        for one in events
        if one.kind in gaps and one.transaction == "read" and one.node == 1
    ]
    assert [label for label, _ in found] == [label for label, _ in idle]
    assert [us for _, us in found] == pytest.approx([us for _, us in idle])


def test_a_known_execution_is_found_in_its_latency_and_no_answer_but_a_split_one_shows_it() -> None:
    bench = busplan.load_profile("paper-two-node", changes={"node.execution": EXECUTION})
    latency_us = phases_of("write", "standard")["latency_us"] or 0.0
    rows = [(4, latency_us), (4, latency_us + 7.5)]
    found = busplan.calibrate(bench, rows, source="m.csv").execution
    assert found.time_us == pytest.approx((33.75,), abs=1e-3)
    for changes, words in (
        ({"bus.speed": "S800"}, "the time of packets at S800 is known as a lower bound only: no execution time can be"),
        (
            {"node.write_response": "unified"},
            (
                'node.write_response = "unified": a unified write has no execution time on the bus, so none can be '
                'found from its latency; leave its lines out, or calibrate with node.write_response = "split"'
            ),
        ),
        (
            {"cycle.schedule": "broadcast"},
            (
                'cycle.schedule = "broadcast": no execution time is on the bus, so none can be found from a latency; '
                'calibrate with cycle.schedule = "individual"'
            ),
        ),
    ):
        with pytest.raises(busplan.BusplanError, match=re.escape(words)):
            busplan.calibrate(busplan.load_profile(bench, changes=changes), rows, source="m.csv")


@pytest.mark.parametrize(("speed", "times"), [("S100", 1), ("S200", 2), ("S400", 4)])
def test_at_s100_the_two_models_count_gaps_alike(speed: str, times: int) -> None:
    paper_us, standard_us = (phases_of("read", model, bus__speed=speed)["gaps_us"] for model in ("paper", "standard"))
    assert (standard_us or 0.0) / (paper_us or 1.0) == pytest.approx(times, rel=1e-15)
