"""Each limit of a bus: the largest value that keeps it, the next one, and what is said of that."""

from math import inf
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan.buses import kind_named, kind_names
from busplan.buses.limits import BROKEN, NOT_SHOWN_KEPT
from busplan.questions.fit.network import network_of

Changes = dict[str, Any]
LINEAR: Changes = {"node.execution": {"kind": "linear", "base_us": 20.0, "per_byte_us": 0.0}}
WORST = "is the worst of 9,000 measured cycles, no bound"
KEPT_AND_BROKEN: list[tuple[str, str, Changes, Changes, str, str]] = [
    (
        "paper-4ms",
        "payload",
        LINEAR | {"bus.speed": "S100", "payload.write_bytes": 512},
        {"payload.write_bytes": 513},
        "a payload of 513 bytes is over the 512 bytes of S100",
        "a faster bus or use a smaller payload",
    ),
    (
        "paper-4ms",
        "nodes",
        {"bus.nodes": 62, "bus.max_hops": 16},
        {"bus.nodes": 63},
        "63 nodes are over the 62 of one bus",
        "a second bus has room for 62 more",
    ),
    (
        "paper-4ms",
        "hops",
        {"bus.nodes": 16},
        {"bus.nodes": 17},
        "17 hops are over the 16 of one bus",
        "a tree with bus.max_hops = 16 or less has room for 62 nodes",
    ),
    (
        # Little data, which a block has room for.
        "dvrk",
        "broadcasting nodes",
        {"bus.max_hops": 5, "group.full.nodes": 12, "group.full.read_bytes": 4},
        {"group.full.nodes": 13},
        "17 nodes are over the 16 that a hub collects data of",
        'cycle.schedule = "individual" has no such limit',
    ),
    (
        # 15 and 16 boards of 128 + 4 bytes, and 4 more.
        "dvrk",
        "hub block",
        {"group.full.nodes": 11},
        {"group.full.nodes": 12},
        "the hub's block of 2116 bytes is over the 2048 bytes of S400",
        'read less from each node, or cycle.schedule = "individual" has no such limit',
    ),
    (
        # 4 boards of 484 + 4 or 488 + 4 bytes, and 4 of 20 + 4.
        "dvrk",
        "write block",
        {"group.full.write_bytes": 484},
        {"group.full.write_bytes": 488},
        "the write of 2064 bytes is over the 2048 bytes of S400",
        'write less to each node, or cycle.schedule = "individual" has no such limit',
    ),
    (
        # A cycle start of 27.53 us, of the 125 us from one to the next.
        "paper-4ms",
        "cycle starts",
        {"bus.cycle_master": True, "bus.isochronous_us": 96.4},
        {"bus.isochronous_us": 96.5},
        "a cycle start takes 124.030 us, over 124.000 us: no time is left for the nodes until the next one",
        "reduce bus.isochronous_us, or stop the cycle master",
    ),
    (
        "paper-4ms",
        "arbitration",
        {"bus.speed": "S400"},
        {"bus.speed": "S800"},
        "the arbitration of S800 has no published time, so the cycle is a lower bound",
        "up to S400 every time is known",
    ),
    (
        "paper-4ms",
        "gap table",
        {"bus.gap_count": 7},
        {"bus.gap_count": 6},
        "gap count 6 is unsafe for 2 hops (2 nodes); the smallest safe one is 7",
        "no gap count is known to be safe for cables over 4.5 m",
    ),
    (
        "paper-4ms",
        "wake_up",
        {"bus.sync_jitter_us": 5.5, "bus.sync_jitter_cycles": 9000, "limits.missed_cycles": 1},
        {"limits.missed_cycles": 0},
        f"bus.sync_jitter_us = 5.5 {WORST}",
        "limits.missed_cycles = 1 accepts one later cycle in as many",
    ),
    (
        "ethercat-servo-8",
        "nodes",
        {"bus.nodes": 65535, "cycle.period_us": 1e6},
        {"bus.nodes": 65536},
        "65536 devices are over the 65535 addresses of a segment",
        "a second segment has room for 65535 more",
    ),
    (
        "ethercat-servo-8",
        "payload",
        {"payload.read_bytes": 1474, "payload.write_bytes": 12, "cycle.period_us": 10_000},
        {"payload.read_bytes": 1475},
        "a device of 1487 bytes is over the 1486 bytes of a frame, and no device is split",
        "use a smaller payload",
    ),
    (
        "ethercat-servo-8",
        "cable",
        {"node.cable_length_m": 100},
        {"node.cable_length_m": 100.5},
        "a cable of 100.5 m is over the 100 m of 100BASE-TX",
        "put a device in between",
    ),
    (
        "ethercat-servo-8",
        "sync_window",
        {"bus.master_jitter_us": 19.5, "node.sync_window_us": 19.5},
        {"bus.master_jitter_us": 20},
        "frames move 20.0 us against SYNC0, and a drive allows 19.5 us: a jitter of 19.5 us is allowed",
        "measure bus.master_jitter_us, or make it smaller",
    ),
    (
        "ethercat-servo-8",
        "wake_up",
        {"bus.master_jitter_cycles": 9000, "limits.missed_cycles": 1},
        {"limits.missed_cycles": 0},
        f"bus.master_jitter_us = 20 {WORST}",
        "limits.missed_cycles = 1 accepts one later cycle in as many",
    ),
    (
        "sercos2-servo-8",
        "period",
        {"cycle.period_us": 2000},
        {"cycle.period_us": 1300},
        "the bus allows no period of 1300 us; the next are 1000 and 2000 us",
        "choose a period that the bus allows",
    ),
    (
        "sercos2-servo-8",
        "nodes",
        {"bus.nodes": 254, "cycle.period_us": 65_000},
        {"bus.nodes": 255},
        "255 drives are over the 254 of a ring",
        "a second ring has room for 254 more",
    ),
    (
        # Four bytes are beside the words of each command: 254 times 258 bytes, and 254 times 260.
        "sercos2-servo-8",
        "payload",
        {"bus.nodes": 254, "payload.write_bytes": 254, "cycle.period_us": 65_000},
        {"payload.write_bytes": 255},
        "the MDT has 66040 bytes of data, over 65534",
        "use a smaller payload or a second ring",
    ),
    (
        "sercos3-servo-8",
        "period",
        {"cycle.period_us": 65_000},
        {"cycle.period_us": 66_000},
        "the bus allows no period of 66000 us; the next is 65000 us",
        "choose a period that the bus allows",
    ),
    (
        "sercos3-servo-8",
        "nodes",
        {"bus.nodes": 511, "cycle.period_us": 65_000},
        {"bus.nodes": 512},
        "512 devices are over the 511 of a network",
        "a second network has room for 511 more",
    ),
    (
        # A hot-plug field of 8 and the control of the connection, 2, are beside a device's data.
        "sercos3-servo-8",
        "payload",
        {"bus.nodes": 1, "payload.write_bytes": 1484},
        {"payload.write_bytes": 1485},
        "a device's data make a telegram of 1496 bytes, over 1494",
        "use a smaller payload",
    ),
    (
        # Two devices of 702 bytes a telegram, and four telegrams.
        "sercos3-servo-8",
        "telegrams",
        {"bus.nodes": 8, "payload.write_bytes": 700},
        {"bus.nodes": 9},
        "5 telegrams in one direction are over the 4 of a cycle",
        "use a smaller payload or a second network",
    ),
    (
        "sercos3-servo-8",
        "wake_up",
        {"bus.master_jitter_us": 0.5, "bus.master_jitter_cycles": 9000, "limits.missed_cycles": 1},
        {"limits.missed_cycles": 0},
        f"bus.master_jitter_us = 0.5 {WORST}",
        "limits.missed_cycles = 1 accepts one later cycle in as many",
    ),
    (
        "profibus-drives-6",
        "nodes",
        {"bus.nodes": 125, "cycle.period_us": 100_000},
        {"bus.nodes": 126},
        "126 nodes are over the 125 of a bus",
        "a second bus has room for more",
    ),
    (
        "profibus-drives-6",
        "payload",
        {"payload.write_bytes": 244},
        {"payload.write_bytes": 245},
        "a telegram has 245 bytes of data, over 244",
        "use a smaller payload",
    ),
    (
        "profibus-drives-6",
        "range",
        {"bus.bit_rate_kbit_s": 12_000},
        {"bus.bit_rate_kbit_s": 12_001},
        "12001 kbit/s are over the 12000 of the protocol",
        "use a lower bit rate",
    ),
    (
        "profibus-drives-6",
        "wake_up",
        {"bus.master_jitter_us": 5, "bus.master_jitter_cycles": 9000, "limits.missed_cycles": 1},
        {"limits.missed_cycles": 0},
        f"bus.master_jitter_us = 5 {WORST}",
        "limits.missed_cycles = 1 accepts one later cycle in as many",
    ),
]
ELSEWHERE = {"node": "test_limits.py", "sync0": "ethercat/test_ethercat.py"}
"""Limits on times, and who holds them."""


@pytest.mark.parametrize(
    ("name", "key", "kept", "broken", "words", "advice"),
    KEPT_AND_BROKEN,
    ids=[f"{name} {key}" for name, key, *_ in KEPT_AND_BROKEN],
)
def test_a_limit_holds_up_to_its_bound(
    name: str, key: str, kept: Changes, broken: Changes, words: str, advice: str
) -> None:
    within, beyond = (network_of(busplan.load_profile(name, changes=changes)) for changes in (kept, kept | broken))
    bus = within.bus
    before, after = ({limit.key for limit in bus.limits if limit.verdict_code(network)} for network in (within, beyond))
    # Data of 511 devices never go in four telegrams of SERCOS III.
    assert before == ({"telegrams"} if "512 devices" in words else set())
    assert after - before == {key}
    limit = bus.limit(key)
    assert limit is not None
    assert (limit.words(beyond), limit.advice(beyond)) == (words, advice)
    # What is not known is only not shown; an unsafe gap count is no matter of the cycle.
    is_unknown, is_safety = key in ("arbitration", "wake_up"), key == "gap table"
    assert (limit in bus.broken(beyond)) is not (is_unknown or is_safety)
    assert (bus.is_safe(within), bus.is_safe(beyond)) == (True, not is_safety)


def test_every_limit_is_here() -> None:
    kinds = {name: busplan.load_profile(name).bus.kind for name in {name for name, *_ in KEPT_AND_BROKEN}}
    for kind in kind_names():
        keys = {limit.key for limit in kind_named(kind).limits}
        here = {key for name, key, *_ in KEPT_AND_BROKEN if kinds[name] == kind}
        assert here | (keys & ELSEWHERE.keys()) == keys or kind == "can"  # test_can*.py


QUEUES = """schema_version = 1
name = "queues"
bus = {{kind = "can", bit_rate_kbit_s = 500, queue = "{}"}}
"""
MESSAGE = """[[message]]
name = "m{}"
identifier = {}
sender = "host"
payload_bytes = 8
period_us = 500
"""


@pytest.mark.parametrize(("queue", "code"), [("priority", BROKEN), ("fifo", NOT_SHOWN_KEPT)])
def test_what_is_only_perhaps_endless_is_not_broken(queue: str, code: int, tmp_path: Path) -> None:
    # Two frames of 270 us in 500 us: of a queue of unknown order nobody knows which of them waits without end.
    (tmp_path / "queues.toml").write_text(QUEUES.format(queue) + MESSAGE.format(1, 1) + MESSAGE.format(2, 2))
    network = network_of(busplan.load_profile(tmp_path / "queues.toml"))
    deadline = network.bus.limit("deadline")
    assert deadline is not None
    assert (deadline.value(network), deadline.verdict_code(network)) == (inf, code)
