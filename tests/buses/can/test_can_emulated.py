"""The emulated log of a machine without chance: each stamp, and what each fault does to it, is that by hand."""

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import groupby
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest

import busplan
from tests.buses.can.machines import loaded
from tests.oracles.can_frames import written_bits

EXECUTION = {"kind": "linear", "grade": "measured", "base_us": 100, "per_byte_us": 0}
CYCLES = 64


@cache
def bits_of(name: str, data: str) -> int:
    """Length of a frame; 0 of an error frame."""
    return written_bits(int(name, 16), bytes.fromhex(data), identifier_bits=11) if len(name) == 3 else 0


class Sent(NamedTuple):
    """A frame of a log at 1000 kbit/s: a bit is a microsecond."""

    us: int
    """Its end, rounded down."""
    identifier: int
    bits: int


def machine(**bus: Any) -> busplan.Profile:
    """A host that takes no time, its adapter, and two nodes that take 100 us."""
    return loaded(
        {
            "schema_version": 1,
            "name": "line",
            "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": 2, "host_write_us": 30, "host_read_us": 50, **bus},
            "cycle": {"period_us": 4000},
            "payload": {"read_bytes": 8, "write_bytes": 8},
            "node": {"axes": 1, "execution": EXECUTION},
        }
    )


def cycles(plan: busplan.Profile, faults: Mapping[str, float | None] = MappingProxyType({})) -> dict[int, list[Sent]]:
    """Frames of each cycle of an emulated log, at times in it."""
    content = busplan.emulate(plan, cycles=CYCLES, seed=2, fault=faults).content

    def sent() -> Iterator[Sent]:
        for line in content.decode().splitlines():
            stamp, _, frame = line.split()
            name, data = frame.split("#")
            yield Sent(round(float(stamp.strip("()")) * 1e6), int(name, 16), bits_of(name, data))

    of_cycle = {int(number): list(some) for number, some in groupby(sent(), key=lambda frame: (frame.us - 1) // 4000)}
    return {
        number: [frame._replace(us=frame.us - 4000 * number) for frame in some] for number, some in of_cycle.items()
    }


def gaps(frames: list[Sent]) -> list[tuple[int, int]]:
    """Identifier of each frame, and the time between the one before it, or the start of the cycle, and its start."""
    before = [0, *(frame.us for frame in frames)]
    return [(frame.identifier, frame.us - frame.bits - us) for frame, us in zip(frames, before, strict=False)]


SYNC = [(0x80, 0), (0x181, 100), (0x182, 0), (0x201, 80), (0x202, 0)]
POLLED = [(0x201, 80), (0x181, 100), (0x202, 80), (0x182, 100), (0x203, 80), (0x183, 100)]
ERROR = 0x20000088


def test_a_cycle_of_sync_is_that_by_hand_but_where_a_fault_hits_it() -> None:
    late: dict[str, float | None] = {"late-command": 700, "jitter": 700}
    faults = {"missing-cycle": None, "missing-pdo": None, "double-pdo": None, "error-frame": None, **late}
    found = cycles(machine(pipeline_cycles=0), faults)
    hit: tuple[list[tuple[int, int]], ...] = (
        [],
        [SYNC[0], (0x182, 100), *SYNC[3:]],
        [*SYNC[:2], (0x181, 0), *SYNC[2:]],
        # Half of the 51 bits of SYNC, and 31 bits until it goes again.
        [(ERROR, 56), *SYNC],
        [*SYNC[:3], (0x201, 780), SYNC[4]],
        [(0x80, 700), *SYNC[1:]],
    )
    of_each = Counter(tuple(gaps(found.get(number, []))) for number in range(CYCLES))
    assert of_each == {tuple(SYNC): CYCLES - 5 * len(hit)} | {tuple(each): 5 for each in hit}


def test_requests_one_by_one_are_those_by_hand_but_where_a_fault_hits_the_second() -> None:
    faults = {"lost-answer": None, "double-answer": None, "slow-node": 700, "slow-host": 700}
    found = cycles(machine(access="polled", nodes=3), faults)
    hit = (
        # The host waits for twice the time of the node and for a frame of 135 us.
        [*POLLED[:3], (0x203, 200 + 135 + 80), POLLED[5]],
        [*POLLED[:4], (0x182, 0), (0x203, 0), POLLED[5]],
        [*POLLED[:3], (0x182, 800), *POLLED[4:]],
        [*POLLED[:2], (0x202, 780), *POLLED[3:]],
    )
    of_each = Counter(tuple(gaps(frames)) for frames in found.values())
    assert of_each == {tuple(POLLED): CYCLES - 5 * len(hit)} | {tuple(each): 5 for each in hit}


def test_a_node_answers_when_the_slower_of_its_two_sides_has_executed() -> None:
    """10 us a byte, of which it sends two and gets eight."""
    sides = {"node.execution.per_byte_us": 10, "payload.read_bytes": 2}
    found = cycles(busplan.load_profile(machine(access="polled"), changes=sides))
    usual = tuple((identifier, 80 if identifier > 0x200 else 180) for identifier in (0x201, 0x181, 0x202, 0x182))
    assert {tuple(gaps(frames)) for frames in found.values()} == {usual}


def test_requests_at_once_wait_for_the_host_alone() -> None:
    """Of requests at once the adapter is in none but the first; what it has sent does not wait for the next."""
    plan = machine(access="burst", nodes=3)
    # Behind the second request the first answer waits, and has the smaller identifier.
    usual = [(0x201, 0), (0x202, 0), (0x181, 0), (0x182, 0), (0x203, 0), (0x183, 100)]
    assert {tuple(gaps(frames)) for frames in cycles(plan).values()} == {tuple(usual)}
    hit = [frames for frames in cycles(plan, {"slow-host": 700}).values() if gaps(frames) != usual]
    assert len(hit) == 5
    for frames in hit:
        assert [frame.identifier for frame in frames] == [0x201, 0x181, 0x202, 0x203, 0x182, 0x183]
        assert [frames[place].us - frames[place].bits for place in (1, 2)] == [frames[0].us + 100, 700]


def test_times_of_chance_stay_within_the_plan_and_fill_it() -> None:
    """SYNC up to 40 us late, nodes up to 60 us later than 100, and of the host's 200 us half or more."""
    base = machine(pipeline_cycles=0, sync_jitter_us=40, host_us=200, nodes=1)
    plan = busplan.load_profile(base, changes={"node.execution.worst_extra_us": 60})
    found = [gaps(frames) for frames in cycles(plan).values()]
    for place, (least_us, most_us) in enumerate(((0, 40), (100, 160), (180, 280))):
        us = [each[place][1] for each in found]
        assert least_us <= min(us) < least_us + 0.2 * (most_us - least_us)
        assert most_us - 0.2 * (most_us - least_us) < max(us) <= most_us


def test_the_counter_of_sync_runs_from_1_to_240() -> None:
    content = busplan.emulate(machine(sync_counter=True), cycles=250).content.decode()
    counts = [int(line.split("#")[1], 16) for line in content.splitlines() if " 080#" in line]
    assert counts == [*range(1, 241), *range(1, 11)]


def test_frames_of_can_fd_have_half_of_their_possible_stuff_bits() -> None:
    """At 1000 and 2000 kbit/s: SYNC 45.5 to 49.5 us, and PDOs of 8 bytes 77.5 to 89.5 us (ISO 11898-1)."""
    content = busplan.emulate(machine(pipeline_cycles=0, data_bit_rate_kbit_s=2000), cycles=20).content.decode()
    stamps = [round(float(line.split()[0].strip("()")) * 1e6) for line in content.splitlines()[:5]]
    ends_us = [47.5, 47.5 + 100 + 83.5, 231 + 83.5, 314.5 + 80 + 83.5, 478 + 83.5]
    assert stamps == [int(us) for us in ends_us]
    assert {line.split()[2][:6] for line in content.splitlines()[1:5]} == {
        f"{name}##1" for name in (181, 182, 201, 202)
    }


def test_a_burst_comes_at_once() -> None:
    message = {"name": "row", "identifier": 1, "payload_bytes": 8, "period_us": 1000, "burst": 3, "deadline_us": "none"}
    bus = {"kind": "can", "bit_rate_kbit_s": 1000}
    plan = loaded({"schema_version": 1, "name": "row", "bus": bus, "message": [message]})
    content = busplan.emulate(plan, cycles=100).content.decode()
    stamps = [float(line.split()[0].strip("()")) * 1e6 for line in content.splitlines()]
    starts = [us - bits_of("001", line.split("#")[1]) for us, line in zip(stamps, content.splitlines(), strict=True)]
    assert 96 <= len(stamps) <= 102
    assert starts[1::3] == pytest.approx(stamps[: len(starts[1::3]) * 3 : 3], abs=1.1)
    assert all(
        after - before == pytest.approx(3000, abs=1.1) for before, after in zip(starts[::3], starts[3::3], strict=False)
    )
