"""A cycle of a recording: its shares are those that the machines of the oracles took, and a fault is named."""

from collections.abc import Iterable
from pathlib import Path
from random import Random
from typing import Any, cast

import pytest
import tomli_w
from hypothesis import example, given, settings
from hypothesis import strategies as st

import busplan
from busplan.errors import BusplanError
from tests.oracles import ethercat_recording, request_simulation
from tests.oracles.can_frames import written_bits
from tests.oracles.can_recording import SPACE_BITS, Logged, Machine, Queued, candump, handed_over, nodes_of, simulated
from tests.oracles.random_plans import execution, fitting, pdos
from tests.oracles.request_simulation import Motor, Sent
from tests.registers import at_least

Spans = list[tuple[float, float]]
SEEDS = st.integers(1, 10**6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recordings")


def shown(folder: Path, log: str | bytes, plan: Any, **options: Any) -> busplan.RecordedTimelineAnswer:
    path = folder / ("bus.log" if isinstance(log, str) else "port.pcapng")
    path.write_bytes(log.encode() if isinstance(log, str) else log)
    answer = busplan.timeline(plan, recording=path, **options)
    # Both cycles are without gaps, and the shares add up to them.
    for events, whole_us, name in (
        (answer.events, answer.recorded_us, "recorded_us"),
        (answer.planned_events, answer.planned_us, "planned_us"),
    ):
        assert [event.start_us for event in events] == pytest.approx([0, *(event.end_us for event in events)][:-1])
        assert sum(getattr(share, name) for share in answer.shares) == pytest.approx(whole_us)
    return answer


def inside(spans: Spans, start_us: float, end_us: float) -> float:
    """Length of the union of some spans within bounds."""
    found_us = 0.0
    for begin_us, stop_us in sorted(spans):
        found_us += max(min(stop_us, end_us) - max(begin_us, start_us), 0.0)
        start_us = max(start_us, stop_us)
    return found_us


def told(own: Spans, others: Spans, nodes: Spans, host: Spans, start_us: float, end_us: float) -> dict[str, float]:
    """Time of each share by what the machine did: frames first, then nodes that work, then the host."""
    sums, covered, before_us = {}, Spans(), 0.0
    for name, spans in (("wire", own), ("others", others), ("nodes", nodes), ("host", host)):
        covered = [*covered, *spans]
        whole_us = inside(covered, start_us, end_us)
        sums[name], before_us = whole_us - before_us, whole_us
    return sums | {"unknown": end_us - start_us - before_us}


def agrees(answer: busplan.RecordedTimelineAnswer, truth: dict[str, float]) -> None:
    found = {share.waits_for: share for share in answer.shares}
    for name, us in truth.items():
        share = found.get(cast("Any", name))
        # What is neither planned nor seen may be hidden by stamps as late as others are.
        doubt_us = share.uncertainty_us if share else max(each.uncertainty_us for each in answer.shares)
        assert (share.recorded_us if share else 0.0) == pytest.approx(us, abs=doubt_us + 1e-3), name


def wired(frame: Logged, bit_us: float) -> tuple[float, float]:
    """When a frame has the wire, interframe space included."""
    end_us = frame.us + SPACE_BITS * bit_us
    return end_us - frame.wire_us, end_us


def truth_of_sync(machine: Machine, logged: Iterable[Logged], cycle: int) -> dict[str, float]:
    """What a cycle of SYNC took its time for."""
    bit_us, nodes = 1000 / machine.plan["bus"]["bit_rate_kbit_s"], list(nodes_of(machine.plan))
    streams = (
        {pdo.stream for node in nodes for pdo in node.feedback},
        {pdo.stream for node in nodes for pdo in node.command},
    )
    logged = list(logged)

    def of(names: Iterable[str]) -> list[Logged]:
        return [frame for frame in logged if frame.queued.number == cycle and frame.queued.stream in names]

    (sync,), feedback, commands = of({"SYNC"}), of(streams[0]), of(streams[1])
    own = [sync, *feedback, *commands]
    start_us, end_us = wired(sync, bit_us)[0], max(wired(frame, bit_us)[1] for frame in own)
    others = [frame for frame in logged if frame not in own]
    asked_us = max((frame.us for frame in feedback), default=sync.us)
    return told(
        [wired(frame, bit_us) for frame in own],
        [wired(frame, bit_us) for frame in others],
        [(sync.us, frame.queued.us) for frame in feedback],
        [(asked_us, frame.queued.us) for frame in commands],
        start_us,
        end_us,
    )


def sync_plan(seed: int) -> dict[str, Any]:
    """A machine of groups with SYNC and other messages, classical or FD."""
    random = Random(seed)
    rate, fd = random.choice((500, 1000)), random.random() < 0.3
    return {
        "name": "random",
        "bus": {"kind": "can", "bit_rate_kbit_s": rate, "host_us": random.choice((0, 60, 300))}
        | ({"data_bit_rate_kbit_s": 4 * rate} if fd else {}),
        "cycle": {"period_us": random.choice((10_000, 20_000))},
        "group": [
            {"name": name, "nodes": random.randint(1, 4), "axes": 1, "execution": execution(random, 600)}
            | pdos(random, fd=fd)
            for name in ("drives", "valves")[: random.randint(1, 2)]
        ],
        "message": [
            {"name": "early", "identifier": 0x70, "payload_bytes": 8, "period_us": random.choice((900, 7000))},
            {"name": "late", "identifier": 0x700, "payload_bytes": 5, "period_us": 1300},
        ],
    }


def all_due(seed: int) -> dict[str, Any]:
    """The same with all nodes in every cycle, and no other messages."""
    plan = sync_plan(seed) | {"message": []}
    for group in plan["group"]:
        group.pop("every", None)
    return plan


def written(folder: Path, plan: dict[str, Any]) -> Path:
    path = folder / "random.toml"
    path.write_text(tomli_w.dumps({"schema_version": 1, **plan}))
    return path


@settings(max_examples=at_least(5, 40))
@example(2001, 500.0, 1.0)
@given(SEEDS, st.sampled_from([0.0, 0.0, 50.0, 500.0]), st.sampled_from([1.0, 10.0]))
def test_shares_of_a_cycle_of_sync_are_those_of_the_machine(
    folder: Path, seed: int, latency_us: float, step_us: float
) -> None:
    """Stamps in steps, and by a driver that is late."""
    machine = Machine(sync_plan(seed), cycles=30, seed=seed)
    logged = simulated(machine)
    # How late a driver is shows by the lengths of classical frames.
    is_late = latency_us and "data_bit_rate_kbit_s" not in machine.plan["bus"]
    stamped = list(handed_over(logged, latency_us, Random(seed))) if is_late else logged
    # Any cycle but the first ones, whose groups are not known from so few.
    cycle = Random(seed).randrange(3, 25)
    answer = shown(folder, candump(stamped, step_us=step_us), written(folder, machine.plan), cycle=cycle + 1)
    agrees(answer, truth_of_sync(machine, logged, cycle))
    # The plan beside it is that of a cycle with the same groups.
    nodes, planned = (
        {event.node for event in events if event.waits_for == "wire"}
        for events in (answer.events, answer.planned_events)
    )
    assert nodes == planned


@given(SEEDS, st.booleans())
def test_the_worst_cycle_of_a_machine_with_a_fault_names_it(folder: Path, seed: int, is_host: bool) -> None:
    plan = all_due(seed)
    machine = Machine(plan, cycles=30, seed=seed)
    hit = Random(seed).randrange(3, 25)
    machine.late = {hit: 4000.0} if is_host else {}
    logged = simulated(machine)
    late = None
    if not is_host:
        # The last node answers 4000 us late, and the host waits for it.
        late = [*nodes_of(plan)][-1].feedback[0]
        shifted = []
        (asked_us,) = (f.us for f in logged if f.queued.stream == "SYNC" and f.queued.number == hit)
        last_us = max(f.us for f in logged if f.queued.number == hit and f.identifier == late.identifier)
        for frame in logged:
            is_behind = frame.queued.number == hit and frame.us >= last_us and frame.us > asked_us
            shifted.append(frame._replace(us=frame.us + 4000.0 * is_behind))
        logged = sorted(shifted, key=lambda frame: frame.us)
    answer = shown(folder, candump(logged), written(folder, plan))
    assert (answer.chosen, answer.cycle) == ("worst", hit + 1)
    found = answer.difference
    assert (found.waits_for, found.is_longer) == ("host" if is_host else "nodes", True)
    number = found.frame or 0
    named = logged[number - 1]
    assert found.at_s == pytest.approx((named.us - logged[0].us) / 1e6, abs=2e-6)
    assert f"{named.identifier:#x}" in found.cause
    assert named.queued.number == hit
    if late is not None:
        assert named.identifier == late.identifier
        assert found.node == f"{plan['group'][-1]['name']} {plan['group'][-1]['nodes']}"


def requests_log(sent: list[Sent], frames: dict[tuple[str, int], tuple[int, bytes]]) -> str:
    queued = (Queued(float(frame.queued_us), *frames[frame.sort, frame.number]) for frame in sent)
    return candump(
        Logged(float(frame.end_us - SPACE_BITS), each.identifier, each.data, False, 0)
        for frame, each in zip(sent, queued, strict=True)
    )


@given(SEEDS, st.booleans(), st.booleans())
def test_shares_of_requests_and_answers_are_those_of_the_machine(
    folder: Path, seed: int, polled: bool, has_message: bool
) -> None:
    random, count = Random(seed), 1 + seed % 5
    plan = busplan.load_profile(
        "can-motors-8", changes={"bus.nodes": count, "bus.access": "polled" if polled else "burst"}
    )
    sizes = ("request", 0x141), ("answer", 0x241)
    frames = {(sort, node): (first + node, random.randbytes(8)) for sort, first in sizes for node in range(count)}
    frames["message", 0] = (random.choice((0x10, 0x7F0)), random.randbytes(8))

    def frame(sort: str, node: int) -> request_simulation.Frame:
        identifier, data = frames[sort, node]
        return identifier, written_bits(identifier, data, identifier_bits=11)

    cycles = 12
    motors = [
        Motor(
            (frame("request", node),),
            (frame("answer", node),),
            tuple(random.randint(50, 400) for _ in range(cycles)),
        )
        for node in range(count)
    ]
    host_us = [[random.randint(0, 120) for _ in range(count)] for _ in range(cycles)]
    busy = [(frame("message", 0), list(range(100, 8000 * cycles, 1700)))] if has_message else []
    starts_us = [8000 * cycle for cycle in range(cycles)]
    sent = request_simulation.simulate(motors, busy, starts_us=starts_us, host_us=host_us, polled=polled)
    cycle = 1 + seed % (cycles - 2)
    answer = shown(folder, requests_log(sent, frames), plan, cycle=cycle + 1)
    own = [each for each in sent if each.sort != "message" and each.cycle == cycle]
    asked = {each.number: each.end_us for each in own if each.sort == "request"}
    nodes: Spans = [(asked[each.number], each.queued_us) for each in own if each.sort == "answer"]
    truth = told(
        [(each.start_us, each.end_us) for each in own],
        [(each.start_us, each.end_us) for each in sent if each not in own],
        nodes,
        [(0.0, 8000.0 * cycles)],
        min(each.start_us for each in own),
        max(each.end_us for each in own),
    )
    if not polled:
        # In a burst nodes and host work side by side: the one that ends a wait is named.
        found = {share.waits_for: share for share in answer.shares}
        both = truth.pop("nodes") + truth.pop("host")
        of_both = [found[name] for name in ("nodes", "host") if name in found]
        doubt_us = sum(share.uncertainty_us for share in of_both)
        assert sum(share.recorded_us for share in of_both) == pytest.approx(both, abs=doubt_us + 1e-3)
    agrees(answer, truth)


def test_an_echo_of_789_us_is_56_to_68_percent_wire(folder: Path) -> None:
    """Zahhask45/Team04_DrivaPi: 8 bytes, 11 bits, 500 kbit/s, there and back 789 us (models, section 16)."""
    plan = busplan.load_profile("can-motors-8", changes={"bus.nodes": 1, "bus.bit_rate_kbit_s": 500})
    for data, share in ((b"\x55" * 8, 0.56), (b"\x00" * 8, 0.68)):
        bits = written_bits(0x141, data, identifier_bits=11)
        rows = [
            Logged(10_000.0 * cycle + us, identifier, data, False, bits)
            for cycle in range(20)
            # The 20th cycle is not whole, and the 10th the median one.
            for us, identifier in ((2 * bits, 0x141), (789 + 7 * (cycle - 9), 0x241))
        ]
        answer = shown(folder, candump(rows), plan, cycle="median")
        assert (answer.cycle, answer.cycles) == (10, 19)
        assert answer.recorded_us == pytest.approx(789, abs=1.5)
        (wire, nodes) = answer.shares
        assert (wire.waits_for, nodes.waits_for) == ("wire", "nodes")
        assert 0.56 <= wire.recorded_share <= 0.68
        assert wire.recorded_share == pytest.approx(share, abs=0.06)


def test_what_the_host_waited_for_is_not_told_where_an_answer_never_came(folder: Path) -> None:
    plan = {
        "name": "random",
        "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "host_us": 50, "nodes": 3},
        "cycle": {"period_us": 4000},
        "payload": {"read_bytes": 8, "write_bytes": 8},
        "node": {"axes": 1, "execution": {"kind": "linear", "base_us": 100, "per_byte_us": 0, "grade": "measured"}},
    }
    machine = Machine(plan, cycles=20, no_feedback=frozenset({9}), late={9: 1000.0})
    answer = shown(folder, candump(simulated(machine)), written(folder, plan), cycle=10)
    shares = {share.waits_for: share.recorded_us for share in answer.shares}
    assert shares.get("host", 0.0) <= 1
    assert shares["unknown"] > 1000
    assert "Never came in this cycle: feedback of node 1 (0x181)." in answer.remarks


def rows(*sent: tuple[float, int], cycles: int = 12, hit: int = 5, late: dict[int, float | None]) -> str:
    """A log of frames by their ends in a cycle of 8 ms; in one cycle some come later, or never."""
    frames = []
    for cycle in range(cycles):
        for us, identifier in sent:
            later_us = late.get(identifier, 0.0) if cycle == hit else 0.0
            if later_us is not None:
                frames.append(Logged(8000.0 * cycle + us + later_us, identifier, b"\x55" * 8, False, 0))
    return candump(sorted(frames, key=lambda frame: frame.us))


def test_the_latest_node_is_named_and_not_the_one_with_the_longest_wait(folder: Path) -> None:
    plan = {
        "name": "random",
        "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "host_us": 50, "nodes": 3},
        "cycle": {"period_us": 8000},
        "payload": {"read_bytes": 8, "write_bytes": 8},
        "node": {"axes": 1, "execution": {"kind": "linear", "base_us": 700, "per_byte_us": 0, "grade": "measured"}},
        # Planned, and not in the log: a larger difference, but not a longer share.
        "message": [{"name": "early", "identifier": 0x70, "payload_bytes": 8, "period_us": 1000, "burst": 3}],
    }
    sent = ((0, 0x80), (810, 0x181), (930, 0x182), (1050, 0x183), (1250, 0x201), (1370, 0x202), (1490, 0x203))
    log = rows(*sent, late={0x182: 400.0, 0x183: 400.0, 0x201: 450.0, 0x202: 450.0, 0x203: 450.0})
    answer = shown(folder, log, written(folder, plan))
    found = answer.difference
    assert (answer.cycle, found.waits_for, found.node, found.frame) == (6, "nodes", "node 2", 5 * 7 + 3)
    assert found.late_us == pytest.approx(400, abs=30)


def test_the_adapter_is_in_the_time_of_the_host(folder: Path) -> None:
    plan = busplan.load_profile(
        "can-motors-8", changes={"bus.nodes": 2, "bus.host_read_us": 50, "bus.host_write_us": 70}
    )
    answer = shown(folder, rows((0, 0x141), (300, 0x241), (500, 0x142), (800, 0x242), late={}), plan)
    (host,) = (share for share in answer.shares if share.waits_for == "host")
    assert host.recorded_us == pytest.approx(200 - 115, abs=8)
    assert host.planned_us == pytest.approx(20 + 50 + 70)
    assert "adapter" in {event.waits_for for event in answer.planned_events}
    assert "host and adapter" in str(answer)


@pytest.mark.parametrize("late_us", [None, 500.0])
def test_a_request_behind_one_without_an_answer_waits_for_nobody_knows_whom(
    folder: Path, late_us: float | None
) -> None:
    plan = busplan.load_profile("can-motors-8", changes={"bus.nodes": 2})
    sent = ((0, 0x141), (300, 0x241), (500, 0x142), (800, 0x242))
    answer = shown(folder, rows(*sent, late={0x241: late_us}), plan, cycle=6)
    shares = {share.waits_for: share.recorded_us for share in answer.shares}
    assert shares["unknown"] == pytest.approx(500 - 115, abs=10)
    assert "host" not in shares or not shares["host"]


def test_frames_that_are_handed_over_at_once_go_one_behind_the_other(folder: Path) -> None:
    plan = busplan.load_profile("ethercat-servo-8", changes={"bus.nodes": 2})
    frames = ((12, 0x10000, 700), (14, 0, 8)), ((12, 0x20000, 600),)
    machine = ethercat_recording.Machine(devices=2, schedule=(frames,), counters=())
    packets = ethercat_recording.simulated(machine, 20)
    # The second frame of each cycle is stamped just behind the first one, which the wire still has.
    sent_us = [us for us, content in packets if not content[6] & 2]
    behind = dict(zip(sent_us[1::2], sent_us[::2], strict=True))
    early = [(behind[us] + 0.01 if us in behind else us, content) for us, content in packets]
    logs = packets, early
    first, second = (shown(folder, ethercat_recording.pcapng(sorted(log)), plan, cycle=5).shares for log in logs)
    assert [share.waits_for for share in first] == [share.waits_for for share in second]
    for one, other in zip(first, second, strict=True):
        assert one.recorded_us == pytest.approx(other.recorded_us, abs=0.05)


def test_an_error_frame_and_what_it_destroys_are_not_attributed(folder: Path) -> None:
    machine = Machine(all_due(5), cycles=20, seed=5)
    clean = simulated(machine)
    place = next(index for index, each in enumerate(clean) if each.queued.stream == "SYNC" and each.queued.number == 9)
    machine.destroyed = frozenset({place + 1})
    logged = simulated(machine)
    answer = shown(folder, candump(logged), written(folder, machine.plan), cycle=10)
    (unknown,) = (event for event in answer.events if event.waits_for == "unknown")
    assert unknown.frame == place + 2
    assert unknown.duration_us >= logged[place + 1].wire_us - 8


@settings(max_examples=at_least(4, 40))
@given(SEEDS)
def test_shares_of_an_ethercat_cycle_are_those_of_the_machine(folder: Path, seed: int) -> None:
    keys, path = fitting("ethercat", seed, folder)
    keys["bus"].pop("mailbox_polls", None)
    plan = busplan.load_profile(path, changes={"bus.mailbox_polls": 0})
    machine = ethercat_recording.planned(keys, seed=seed)
    machine.polls, machine.form = 0, "pcapng ns"
    packets = ethercat_recording.simulated(machine, 40, seed=seed)
    answer = shown(folder, ethercat_recording.pcapng(packets), plan, cycle=Random(seed).choice(("worst", "median")))
    trips = list(ethercat_recording.trips(machine, 40, seed=seed))
    first_us = trips[0].us
    begins = {round((trip.us - first_us) / 1e6, 7): trip.cycle for trip in trips[::-1]}
    own = [trip for trip in trips if trip.cycle == begins[round(answer.start_s, 7)]]
    wire_us = sum(ethercat_recording.wire_us([size for *_, size in trip.datagrams]) for trip in own)
    whole_us = own[-1].back_us - own[0].us
    assert answer.recorded_us == pytest.approx(whole_us, abs=0.01)
    shares = {share.waits_for: share for share in answer.shares}
    cables_us = sum(event.duration_us for event in answer.events if event.label == "cables")
    assert shares["wire"].recorded_us - cables_us == pytest.approx(wire_us, abs=0.01)
    rest_us = sum(shares[name].recorded_us for name in ("nodes", "host") if name in shares)
    assert rest_us == pytest.approx(whole_us - wire_us - cables_us, abs=0.01)
    doubt_us = shares["nodes"].uncertainty_us if "nodes" in shares else 0.0
    line_us = 2 * machine.devices * machine.hop_us if machine.line_us is None else machine.line_us
    assert shares["nodes"].recorded_us + cables_us == pytest.approx(line_us, abs=doubt_us + 0.01)


FRAMES = ((12, 0x10000, 700), (14, 0, 8)), ((12, 0x20000, 600),)
WIRE_US = (700 + 12 + 8 + 12 + 40) * 0.08, (600 + 12 + 40) * 0.08
"""61.76 and 52.16 us."""


def of_two_frames(back_us: tuple[float | None, float | None]) -> bytes:
    """A capture of cycles with two frames, the second sent 100 us after the first; in the eighth they return so."""
    packets = []
    for cycle in range(12):
        returns_us = back_us if cycle == 7 else (70.0, 175.0)
        for place, (datagrams, after_us) in enumerate(zip(FRAMES, returns_us, strict=True)):
            counters = (3,) * len(datagrams)
            sent = ethercat_recording.ethernet(datagrams, index=place, counters=counters)
            packets.append((1000.0 * cycle + 100.0 * place, sent))
            if after_us is not None:
                back = ethercat_recording.ethernet(datagrams, index=place, counters=counters, returned=True)
                packets.append((1000.0 * cycle + after_us, back))
    return ethercat_recording.pcapng(sorted(packets))


WAY_US = 0.2, 2 * 2 * 0.698143
"""Two cables of 10 m there and back, and two devices."""


def test_waits_of_an_ethercat_cycle_by_hand(folder: Path) -> None:
    plan = busplan.load_profile(
        "ethercat-servo-8",
        changes={"bus.nodes": 2, "payload.read_bytes": 400, "payload.write_bytes": 250, "node.cable_length_m": 10.0},
    )
    answer = shown(folder, of_two_frames((70.0, 225.0)), plan)
    assert (answer.cycle, answer.cycles, answer.frame) == (8, 12, 29)
    assert answer.start_s == pytest.approx(0.007)
    ends_us = [WIRE_US[0], 61.96, 64.7526, 70, 100, 152.16, 152.36, 155.1526, 225]
    assert [event.end_us for event in answer.events] == pytest.approx(ends_us, abs=1e-3)
    # The plan has 40 us for the host, and 4.593 us for a copy of 1300 bytes, before a frame is back.
    late_us = [0, 0, 0, 0, 30, 0, 0, 0, 225 - 155.1526 - 44.5933]
    assert [event.late_us for event in answer.events] == pytest.approx(late_us, abs=1e-3)
    assert [(event.waits_for, event.label, event.frame) for event in answer.events] == [
        ("wire", "frame 1", 29),
        ("wire", "cables", 30),
        ("nodes", "devices", 30),
        ("host", "return of frame 1", 30),
        ("host", "frame 2", 31),
        ("wire", "frame 2", 31),
        ("wire", "cables", 32),
        ("nodes", "devices", 32),
        ("host", "return of frame 2", 32),
    ]
    # One frame: 40 bytes, 12 of the process data and 20 of the clocks beside 1300.
    parts = [("wire", "headers of frame 1", 72 * 0.08)]
    parts += [("wire", f"data of device {number} of node {number}", 650 * 0.08) for number in (1, 2)]
    ways = [f"{way} device {number}" for way, number in (("to", 1), ("to", 2), ("back from", 2), ("back from", 1))]
    parts += [("wire", f"cable {way} of node {way[-1]}", 0.05) for way in ways]
    parts += [("nodes", f"way {way} of node {way[-1]}", 0.698143) for way in ways]
    parts += [("host", "master", 40.0), ("host", "copy of the data", 4.5933)]
    planned = answer.planned_events
    assert [(event.waits_for, event.label) for event in planned] == [part[:2] for part in parts]
    assert [event.duration_us for event in planned] == pytest.approx([us for *_, us in parts], abs=1e-4)
    # Devices err by 0.1233 us each way, twice that is U; both runs of frames end at a stamp in steps of 5 us.
    doubts_us = {share.waits_for: share.uncertainty_us for share in answer.shares}
    way_us = 2 * 2 * 2 * 0.12333
    assert doubts_us == pytest.approx({"wire": 0, "nodes": way_us, "host": way_us + 10}, abs=1e-3)


def test_waits_for_an_ethercat_frame_that_is_lost_are_nobodys(folder: Path) -> None:
    plan = busplan.load_profile("ethercat-servo-8", changes={"bus.nodes": 2})
    first, second, both = (
        shown(folder, of_two_frames(back_us), plan, cycle=8) for back_us in ((None, 175.0), (70.0, None), (None, None))
    )
    # 40 bytes are copied in a seventh of a microsecond.
    assert first.planned_events[-1].duration_us == pytest.approx(40 * 0.0035333, abs=1e-5)
    lost = [event for event in first.events if event.waits_for == "unknown"]
    assert [(event.label, event.frame) for event in lost] == [("return of frame 1, which is lost", 29)]
    assert (lost[0].start_us, lost[0].end_us) == pytest.approx((WIRE_US[0], 100))
    assert "1 frame of this cycle never came back: 29." in first.remarks
    # Nobody knows how long the last one was waited for.
    assert (second.recorded_us, both.recorded_us) == pytest.approx((100 + WIRE_US[1],) * 2)
    assert "1 frame of this cycle never came back: 31." in second.remarks
    assert "2 frames of this cycle never came back: 29, 30." in both.remarks
    assert [event.label for event in second.events if event.waits_for == "unknown"] == []


def test_captures_without_times_or_process_data_show_no_cycle(folder: Path) -> None:
    machine = ethercat_recording.Machine(devices=8)
    path = folder / "port.pcapng"

    def refused(packets: list[tuple[float, bytes]]) -> str:
        path.write_bytes(ethercat_recording.pcapng(packets))
        with pytest.raises(BusplanError) as error:
            busplan.timeline("ethercat-servo-8", recording=path)
        return str(error.value).removeprefix(f"{path}: ")

    steps = [(us // 1000 * 1000, content) for us, content in ethercat_recording.simulated(machine, 40)]
    assert refused(steps) == "it shows no times: the stamps have steps of 1000 us, and frames return within 0 us"
    machine.datagrams, machine.counters = ((14, 0, 8),), (4,)
    words = "it has no whole cycle: no frame of process data (LRD, LWR, LRW)"
    assert refused(ethercat_recording.simulated(machine, 40)) == words
    with pytest.raises(BusplanError, match="channel can0: a capture of EtherCAT is of one port; only CAN logs have"):
        busplan.timeline("ethercat-servo-8", recording=path, channel="can0")


def test_a_slow_master_is_named(folder: Path) -> None:
    plan = busplan.load_profile("ethercat-servo-8")
    machine = ethercat_recording.Machine(devices=8, datagrams=((12, 0x10000, 160), (14, 0, 8)), host_spread_us=0.0)
    packets = ethercat_recording.simulated(machine, 40)
    late = sorted(packets)[2 * 17 + 1]
    packets = sorted((us + 300.0 if (us, content) == late else us, content) for us, content in packets)
    answer = shown(folder, ethercat_recording.pcapng(packets), plan)
    found = answer.difference
    assert (answer.cycle, found.waits_for, found.is_longer, found.cause) == (18, "host", True, "return of frame 1")
    assert found.frame == 2 * 17 + 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cycle": 21}, r"^cycle 21: .*bus\.log has no such whole cycle; its cycles are 1 to 20$"),
        ({"cycle": "best"}, "^cycle 'best': expected"),
        ({"from_us": 5.0}, "^from_us 5.0: a recording is shown by whole cycles; leave it out$"),
        ({"recording": None, "cycle": "median"}, "^cycle median: needs a recording"),
        ({"recording": None, "channel": "can0"}, "^channel 'can0': needs a recording"),
    ],
)
def test_what_cannot_be_shown_is_said(folder: Path, options: dict[str, Any], message: str) -> None:
    machine = Machine(sync_plan(1), cycles=18)
    path = folder / "bus.log"
    path.write_text(candump(simulated(machine)))
    with pytest.raises(BusplanError, match=message):
        busplan.timeline(written(folder, machine.plan), **cast("Any", {"recording": path, **options}))


def test_recordings_without_a_cycle_are_refused(folder: Path) -> None:
    path = folder / "bus.log"
    path.write_text("(1.0) can0 080#\n(1.1) can0 181#00\n")
    with pytest.raises(BusplanError, match=r"bus\.log: it has no whole cycle: no SYNC comes twice$"):
        busplan.timeline("can-servo-8", recording=path)
    path.write_text("".join(f"({second}.0) can0 080##1\n" for second in range(1, 4)))
    with pytest.raises(BusplanError, match=r"^frame 1 of cycle 1 switches to another bit rate, and the plan has none"):
        busplan.timeline("can-servo-8", recording=path)
    with pytest.raises(BusplanError, match=r"bus\.log: busplan reads no recordings of bus\.kind ieee1394$"):
        busplan.timeline("paper-4ms", recording=path)
    alone = {key: value for key, value in sync_plan(1).items() if key not in ("cycle", "group")}
    del alone["bus"]["host_us"]
    with pytest.raises(BusplanError, match="a network of messages alone has no cycle, which timeline needs"):
        busplan.timeline(written(folder, alone), recording=path)


@pytest.mark.parametrize("access", ["polled", "burst"])
def test_measured_and_timeline_plan_the_same_cycle(tmp_path: Path, access: str) -> None:
    plan = busplan.load_profile("can-fd-motors-8", changes={"bus.access": access})
    path = tmp_path / "r.log"
    busplan.emulate(plan, cycles=30).save(path)
    figures = {figure.quantity: figure.planned for figure in busplan.measured(plan, path).figures}
    shown = busplan.timeline(plan, recording=path)
    assert shown.planned_us == pytest.approx(figures["last answer after the first request"])
