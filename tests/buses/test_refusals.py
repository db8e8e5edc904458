"""What the kinds of bus refuse in a profile, beside the bounds of each number: every refusal once."""

from typing import Any

import pytest

import busplan

OWN = {"bits_per_byte": 10, "read_request_bytes": 8, "read_answer_bytes": 6, "write_request_bytes": 7}
"""A protocol of the user's own, which reads and writes one node."""
NO_HOPS = 'missing key: bus.charge_hops = "own" needs the hops of each group of a tree'
NUMBER_OR_OPTIMAL = 'expected a whole number from 0 to 63, or "optimal"'
REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("paper-4ms", {"bus.gap_count": 64}, NUMBER_OR_OPTIMAL),
    ("paper-4ms", {"bus.gap_count": "best"}, NUMBER_OR_OPTIMAL),
    (
        "paper-4ms",
        {"bus.gap_count": "optimal", "bus.cable_length_m": 10},
        (
            "bus.gap_count optimal: the table behind it holds for cables of up to 4.5 m, and cable_length_m is 10: "
            "give the gap count as a number"
        ),
    ),
    (
        "paper-4ms",
        {"bus.cycle_master": False, "bus.isochronous_us": 20},
        "isochronous traffic follows cycle starts, and cycle_master is false: set bus.cycle_master = true",
    ),
    (
        "paper-4ms",
        {"bus.max_hops": 3, "bus.charge_hops": "own"},
        "needs the hops of each node of a tree: describe them as groups, [[group]] with hops",
    ),
    ("dvrk", {"bus.max_hops": 5, "bus.charge_hops": "own", "group.partial.hops": 2}, f"group.full.hops: {NO_HOPS}"),
    ("dvrk", {"bus.max_hops": 5, "bus.charge_hops": "own", "group.full.hops": 2}, f"group.partial.hops: {NO_HOPS}"),
    (
        "dvrk",
        {"group.full.hops": 2},
        "group.full.hops 2: the order of the groups says it in a chain; set bus.max_hops for a tree",
    ),
    ("dvrk", {"bus.max_hops": 5, "group.full.hops": 6}, "group.full.hops 6: is over the 5 hops of bus.max_hops"),
    (
        "ethercat-servo-8",
        {"node.sync_window_us": 1000.5},
        "node.sync_window_us 1000.5: is over cycle.period_us, 1000: a window about SYNC0 is within a period",
    ),
    (
        "dynamixel-arm-14",
        {"bus.protocol": {**OWN, "read_request_bytes": 0}},
        "has no request that reads a node; give read_request_bytes",
    ),
    (
        "dynamixel-arm-14",
        {"bus.protocol": OWN, "bus.requests": "sync"},
        "bus.requests sync: the protocol has none of these; it has single",
    ),
    ("dynamixel-arm-14", {"bus.global_control": True}, "the protocol has no broadcast that opens a cycle"),
    ("dynamixel-arm-14", {"bus.retries": 1}, "a repeated request waits for a timeout; give bus.timeout_us"),
    (
        "dynamixel-arm-14",
        {"bus.protocol": "profinet"},
        'expected "profibus-dp", "modbus-rtu", "dynamixel-2", "feetech", "worldfip" or "mesa-hm2-eth"',
    ),
    ("profibus-drives-6", {"bus.return_delay_us": 5.0}, "PROFIBUS has no return delay; give max_turn_bits"),
]
TAKEN: list[tuple[str, dict[str, Any]]] = [
    ("paper-4ms", {"bus.gap_count": "optimal", "bus.cable_length_m": 4.5}),
    ("paper-4ms", {"bus.cycle_master": True, "bus.isochronous_us": 20}),
    ("dvrk", {"bus.max_hops": 5, "bus.charge_hops": "own", "group.full.hops": 5, "group.partial.hops": 2}),
    ("dvrk", {"bus.max_hops": 5}),
    ("ethercat-servo-8", {"node.sync_window_us": 1000}),
    ("dynamixel-arm-14", {"bus.protocol": OWN, "bus.requests": "single"}),
    ("dynamixel-arm-14", {"bus.retries": 1, "bus.timeout_us": 5000}),
    ("profibus-drives-6", {"bus.retries": 1, "bus.global_control": True}),
]
"""What stands beside a refusal, and is none."""


@pytest.mark.parametrize(("name", "changes", "words"), REFUSED)
def test_what_no_bus_can_be_is_refused_in_words(name: str, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.load_profile(name, changes=changes)
    assert str(refused.value).endswith(words)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("name", "changes"), TAKEN)
def test_what_stands_beside_it_is_taken(name: str, changes: dict[str, Any]) -> None:
    assert busplan.load_profile(name, changes=changes)


@pytest.mark.parametrize(
    ("name", "more"),
    [("paper-4ms", "; latencies in a CSV file are for busplan calibrate"), ("sercos3-servo-8", "")],
)
def test_a_kind_without_recordings_says_what_it_reads(name: str, more: str) -> None:
    plan = busplan.load_profile(name)
    words = f"any.pcap: busplan reads no recordings of bus.kind {plan.bus.kind}"
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.measured(plan, "any.pcap")
    assert str(refused.value) == words + more
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.timeline(plan, recording="any.pcap")
    assert str(refused.value) == words
