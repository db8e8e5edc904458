"""Rules of the gate that only a kind of bus has: what each says, and where it says nothing."""

from typing import Any

import pytest

import busplan
from busplan.buses import kind_named

LINEAR = {"kind": "linear", "base_us": 20.0, "per_byte_us": 0.0}
WASTED = "BP110 bus.gap_count: gap count 63 is above the 7 that 2 hops need; 7 saves 75.2 us a cycle and wins 1 node"
SYNC0 = "a larger bus.sync_shift moves SYNC0 later; cheapest cure:"
FOUND: list[tuple[str, dict[str, Any], list[str]]] = [
    # Two nodes: each of 8 packets arbitrates, each of 4 transactions has an idle gap, and counts of 56 are saved.
    (
        "paper-4ms",
        {},
        [WASTED],
    ),
    (
        "paper-4ms",
        {"cycle.period_us": 526},
        [
            "BP102 cycle.period_us: the paper's equations say that it fits; the verdict is: does not fit",
            WASTED,
        ],
    ),
    (
        "dvrk",
        {"bus.gap_count": 63},
        ["BP110 bus.gap_count: gap count 63 is above the 21 that 8 hops need; 21 saves 114.5 us a cycle"],
    ),
    # No time is left, and no table holds.
    ("paper-4ms", {"bus.cycle_master": True, "bus.isochronous_us": 125}, []),
    ("paper-4ms", {"bus.cable_length_m": 10}, []),
    (
        "paper-4ms",
        {"bus.gap_count": 6},
        [
            (
                "BP109 bus.gap_count: gap count 6 is unsafe for 2 hops (2 nodes); the smallest safe one is 7; "
                "cheapest cure: bus.gap_count = 7"
            )
        ],
    ),
    (
        "paper-4ms",
        {"bus.gap_count": 7, "cycle.period_us": 500},
        [
            (
                "BP113 bus.gap_count: fits at 7, does not fit at 63 after a bus reset: "
                "corrected margin -19.9 +/- 6.3 us; have the bus manager write the gap count after each reset"
            )
        ],
    ),
    # It fits at 63, too; and it does not fit before a reset either.
    ("paper-4ms", {"bus.gap_count": 7, "cycle.period_us": 800}, []),
    ("paper-4ms", {"bus.gap_count": 7, "cycle.period_us": 300}, []),
    (
        "dvrk",
        {"group.full.nodes": 70},
        [
            "BP106 group.partial.nodes: 74 nodes are over the 62 of one bus; move the other nodes to a second bus",
            "BP107 group.partial.nodes: 74 hops are over the 16 of one bus; use a tree with bus.max_hops = 16 or less",
        ],
    ),
    (
        "paper-4ms",
        {"bus.max_hops": 17, "bus.gap_count": "optimal"},
        ["BP107 bus.max_hops: 17 hops are over the 16 of one bus; rewire the tree"],
    ),
    (
        "paper-4ms",
        {"node.execution": LINEAR, "bus.gap_count": 7, "payload.read_bytes": 6}
        | {"bus.speed": "S100", "payload.write_bytes": 516},
        [
            'BP108 payload.write_bytes: 516 bytes are over the 512 bytes of a packet at S100; use bus.speed = "S200"',
            (
                "BP111 payload.read_bytes: 6 bytes are not whole quadlets; 8 bytes travel on the wire; "
                "set the payload to 8"
            ),
        ],
    ),
    (
        "paper-4ms",
        {"node.execution": LINEAR, "bus.speed": "S3200", "payload.write_bytes": 16388},
        [
            (
                "BP108 payload.write_bytes: 16388 bytes are over the 16384 bytes of a packet at S3200; "
                "divide it among several transactions"
            )
        ],
    ),
    (
        "ethercat-servo-8",
        {"bus.sync_shift": 0.3, "bus.master_jitter_us": 2000},
        [
            (
                "BP132 bus.sync_shift: the last command comes at 2189.8 +/- 124.4 us, SYNC0 at 300.0 us: "
                f"2 cycles late; {SYNC0} cycle.period_us = 2580, bus.sync_shift = 0.9"
            )
        ],
    ),
    (
        "ethercat-servo-8",
        {"bus.master_jitter_us": 250},
        [
            (
                "BP132 bus.sync_shift: the last command comes at 439.8 +/- 124.4 us, SYNC0 at 500.0 us: "
                f"maybe 1 cycle late; {SYNC0} bus.sync_shift = 0.6"
            )
        ],
    ),
    (
        "ethercat-servo-8",
        {"bus.distributed_clocks": False},
        [
            (
                "BP131 bus.distributed_clocks: without them each drive acts when its frame passes, "
                "one after the other; set bus.distributed_clocks = true if the drives have them; "
                "cheapest cure: bus.distributed_clocks = true"
            )
        ],
    ),
    (
        "sercos3-servo-8",
        {"cycle.period_us": 300},
        [
            (
                "BP141 cycle.period_us: the bus allows no period of 300 us; the next are 250 and 500 us; "
                "the period must change; cheapest cure: cycle.period_us = 500"
            )
        ],
    ),
]


@pytest.mark.parametrize(("name", "changes", "words"), FOUND)
def test_a_rule_says_what_is_wrong_and_nothing_else(name: str, changes: dict[str, Any], words: list[str]) -> None:
    plan = busplan.load_profile(name, changes=changes)
    codes = {rule.code for rule in kind_named(plan.bus.kind).rules}
    (file,) = busplan.check(plan, circle=False).files
    assert file.failure is None
    assert sorted(f"{one.code} {one.message}" for one in file.findings if one.code in codes) == words
