"""`busplan.emulate`: its machine keeps its plan, each fault is found, independent readers read it, and it is no proof.

What is written is held against the emulators of the tests, which share no code with it.
"""

import re
import struct
import subprocess
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from shutil import which
from tomllib import loads
from typing import Any, NamedTuple

import can
import pytest

import busplan
from busplan.buses import kind_named, kind_names
from busplan.buses.emulation import Fault
from busplan.recordings.written import pcapng
from tests.oracles import can_recording, ethercat_recording
from tests.oracles.can_frames import fd_written_bits, written_bits
from tests.oracles.random_plans import Plan, fitting
from tests.registers import at_least

Run = Callable[..., "subprocess.CompletedProcess[str]"]
Refused = Callable[..., str]

PROFILES = Path(__file__).parents[3] / "profiles"
SHIPPED = ("ethercat-servo-8", "can-servo-8", "canopen-6", "can-fd-arm-7")
SEEDS = {"can": range(10), "ethercat": range(6)}
OF_REQUESTS = ("lost-answer", "double-answer", "slow-node", "slow-host")
"""Faults of a machine without SYNC."""
FAULTS = {
    kind: [fault for fault in kind_named(kind).emulator().faults if fault.name not in OF_REQUESTS]  # type: ignore[union-attr]
    for kind in SEEDS
}
LOGICAL = {10: "LRD", 11: "LWR", 12: "LRW"}
needs_wireshark = pytest.mark.skipif(not (which("tshark") and which("capinfos")), reason="no Wireshark")


class Machine(NamedTuple):
    """A profile's file, and its keys."""

    kind: str
    path: Path
    plan: Plan

    @property
    def ending(self) -> str:
        return ".log" if self.kind == "can" else ".pcapng"


Machines = Callable[[str, int], Machine]
CleanFigures = Callable[[str, int], Mapping[str, float | None]]


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Machines:
    """Random profiles that fit, by kind and seed."""

    def of(kind: str, seed: int) -> Machine:
        plan, path = fitting(kind, seed, tmp_path_factory.mktemp(f"{kind}-{seed}"))
        return Machine(kind, path, plan)

    return cache(of)


@pytest.fixture(scope="module")
def clean_figures(machines: Machines, tmp_path_factory: pytest.TempPathFactory) -> CleanFigures:
    """What is recorded of random machines without a fault, by kind and seed."""
    folder = tmp_path_factory.mktemp("clean")

    def of(kind: str, seed: int) -> Mapping[str, float | None]:
        answer = measured(machines(kind, seed), folder, cycles=300)
        return {figure.quantity: figure.recorded for figure in answer.figures}

    return cache(of)


def shipped(name: str) -> Machine:
    plan = loads((PROFILES / f"{name}.toml").read_text())
    return Machine(plan["bus"]["kind"], PROFILES / f"{name}.toml", plan)


def measured(machine: Machine, folder: Path, **options: Any) -> busplan.MeasuredAnswer:
    """What `measured` finds in a recording that is emulated."""
    path = folder / f"recording{machine.ending}"
    busplan.emulate(machine.path, **options).save(path)
    return busplan.measured(machine.path, path)


def require_within(answer: busplan.MeasuredAnswer) -> None:
    judged = [figure for figure in answer.figures if not figure.quantity.startswith("frames of the plan never")]
    beside = [(figure.quantity, figure.verdict, figure.hidden) for figure in judged if figure.verdict != "within"]
    assert [figure for figure in beside if figure[1] is not None] == []
    assert sum(figure.verdict == "within" for figure in judged) >= 3
    assert len(answer.shows_nothing) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_machine_without_faults_keeps_its_plan(name: str, tmp_path: Path) -> None:
    require_within(measured(shipped(name), tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(at_least(3)))
@pytest.mark.parametrize("kind", SEEDS)
def test_a_random_machine_without_faults_keeps_its_plan(
    kind: str, seed: int, machines: Machines, tmp_path: Path
) -> None:
    require_within(measured(machines(kind, seed), tmp_path, cycles=400, seed=seed + 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "fault"),
    [(kind, fault) for kind, faults in FAULTS.items() for fault in faults],
    ids=lambda value: getattr(value, "name", value),
)
def test_each_fault_is_found_as_often_and_as_late_as_it_is(
    kind: str, fault: Fault, machines: Machines, clean_figures: CleanFigures, tmp_path: Path
) -> None:
    tried = 0
    for seed in SEEDS[kind]:
        machine = machines(kind, seed)
        if kind == "can" and "cycle" not in machine.plan and fault.name != "error-frame":
            continue
        period_us = machine.plan.get("cycle", {}).get("period_us", 0)
        clean = clean_figures(kind, seed)
        # More than the five of the default, and the default time.
        value = 7 if fault.unit == "1" else None
        answer = measured(machine, tmp_path, cycles=300, fault={fault.name: value})
        figure = next(figure for figure in answer.figures if figure.quantity == fault.shown_as)
        assert figure.verdict == "outside", (seed, figure)
        assert figure.recorded is not None
        if fault.unit == "1":
            assert (clean[fault.shown_as], figure.recorded) == (0, 7)
        else:
            # The late cycle is one of many, and may be early otherwise.
            assert 0.7 * fault.default * period_us <= figure.recorded <= (fault.default + 1) * period_us
        tried += 1
        if tried == at_least(3):
            break
    assert tried >= 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fault", "value_us", "verdict", "words"),
    [
        ("can-servo-8", "late-command", 600, "within", "the plan allows this, so last PDO after SYNC is within"),
        ("can-servo-8", "jitter", 100, "within", "the plan allows this, so SYNC: jitter of the arrival is within"),
        ("can-servo-8", "late-command", 1200, "not shown", "so measured cannot show last PDO after SYNC as outside"),
        ("can-servo-8", "late-command", 3000, "outside", "measured shows last PDO after SYNC"),
        ("ethercat-servo-8", "jitter", 10, "outside", "measured shows latest start"),
    ],
)
def test_what_is_said_of_a_fault_is_what_measured_says(
    name: str, fault: str, value_us: float, verdict: str, words: str, tmp_path: Path
) -> None:
    machine = shipped(name)
    emulated = busplan.emulate(machine.path, fault={fault: value_us})
    path = tmp_path / f"recording{machine.ending}"
    emulated.save(path)
    (record,) = emulated.to_dict()["faults"]
    figures = busplan.measured(machine.path, path).figures
    assert {figure.quantity: figure.verdict for figure in figures}[record["shown_as"]] == verdict
    assert record["is_inside_plan"] == (verdict == "within")
    assert words in str(emulated)


def test_several_faults_are_all_there_and_hit_cycles_of_their_own(machines: Machines, tmp_path: Path) -> None:
    for kind, faults in FAULTS.items():
        seed = next(seed for seed in SEEDS[kind] if "cycle" in machines(kind, seed).plan)
        answer = measured(machines(kind, seed), tmp_path, cycles=300, fault={fault.name: None for fault in faults})
        assert {fault.shown_as for fault in faults} <= {figure.quantity for figure in answer.outside}
    often = {"missing-cycle": 60, "lost-frame": 60, "wrong-working-counter": 60}
    answer = measured(shipped("ethercat-servo-8"), tmp_path, cycles=600, fault=often)
    recorded = {figure.quantity: figure.recorded for figure in answer.figures}
    shown_as = {fault.shown_as for fault in FAULTS["ethercat"] if fault.name in often}
    assert {recorded[name] for name in shown_as} == {60}


@pytest.mark.parametrize("access", ["polled", pytest.param("burst", marks=pytest.mark.slow)])
def test_motors_without_sync_keep_their_plan_and_show_each_fault(access: str, tmp_path: Path) -> None:
    plan = busplan.load_profile("can-motors-8", changes={"bus.access": access})

    def recorded(emulated: busplan.EmulateAnswer) -> busplan.MeasuredAnswer:
        emulated.save(tmp_path / "motors.log")
        return busplan.measured(plan, tmp_path / "motors.log")

    clean = recorded(busplan.emulate(plan, cycles=100))
    assert clean.outside == ()
    assert {figure.verdict for figure in clean.figures} == {None, "within"}
    for name in (*OF_REQUESTS, "error-frame"):
        emulated = busplan.emulate(plan, cycles=100, fault={name: 7 if name == "lost-answer" else None})
        assert (emulated.inside, emulated.unsure) == ((), ())
        outside = {figure.quantity: figure.recorded for figure in recorded(emulated).outside}
        assert emulated.described[0].shown_as in outside
        assert name != "lost-answer" or outside["answers missing"] == 7


def test_the_time_of_the_host_between_requests_has_its_adapter_in_it(tmp_path: Path) -> None:
    plan = busplan.load_profile("can-motors-8", changes={"bus.host_write_us": 60, "bus.host_read_us": 90})
    busplan.emulate(plan, cycles=200).save(tmp_path / "motors.log")
    assert busplan.measured(plan, tmp_path / "motors.log").outside == ()
    found = busplan.measured("can-motors-8", tmp_path / "motors.log")
    (host,) = (figure for figure in found.figures if figure.quantity == "next request of the host")
    assert (host.planned, host.verdict) == (20, "outside")
    assert host.recorded == pytest.approx(170, abs=3)


def test_a_fault_has_its_place(refused: Refused, tmp_path: Path) -> None:
    log = str(tmp_path / "any.log")
    assert "has no SYNC" in refused("emulate", "can-motors-8", "--fault", "late-command", "-o", log)
    assert "nodes answer no requests" in refused("emulate", "can-servo-8", "--fault", "slow-node", "-o", log)
    one = ("--set", "bus.nodes=1", "--fault", "slow-host")
    assert "no next request" in refused("emulate", "can-motors-8", *one, "-o", log)


QUEUED = """\
schema_version = 1
name = "queues"
[bus]
kind = "can"
bit_rate_kbit_s = 500
queue = "{}"
[[message]]
name = "often"
identifier = 0x100
sender = "host"
payload_bytes = 8
period_us = 10000
deadline_us = "none"
[[message]]
name = "row"
identifier = 0x{}00
sender = "{}"
payload_bytes = 8
period_us = 20130
burst = 10
deadline_us = "none"
[[message]]
name = "last"
identifier = 0x700
sender = "host"
payload_bytes = 8
period_us = 9970
deadline_us = "none"
"""


@pytest.mark.parametrize(
    ("queue", "sender", "least", "most"),
    [
        ("priority", "host", 0, 1),
        ("priority", "other", 0, 1),
        ("fifo", "host", 8, 11),
        ("single-buffer", "host", 0, 1),
        ("single-buffer", "other", 5, 11),
    ],
)
def test_a_queue_keeps_a_message_waiting(queue: str, sender: str, least: int, most: int, tmp_path: Path) -> None:
    """A row of ten frames is before a message in a FIFO, and before what is in its single buffer."""
    text = QUEUED.format(queue, 3, sender).replace('sender = "other"\n', "")
    (tmp_path / "queues.toml").write_text(text)
    busplan.emulate(tmp_path / "queues.toml", cycles=2000).save(tmp_path / "queues.log")
    sent = [frame for frame in logged((tmp_path / "queues.log").read_bytes()) if frame.identifier == 0x100]
    late_us = [frame.us - sent[0].us - 10_000 * number for number, frame in enumerate(sent)]
    frame_us = 226
    assert least * frame_us <= max(late_us) - min(late_us) <= (most + 0.2) * 1.2 * frame_us


DRIVE = """\
[cycle]
period_us = 50000
slice_ratio = 1
[[group]]
name = "drive"
nodes = 2
axes = 1
read_bytes = 8
write_bytes = 8
queue = "fifo"
[group.execution]
kind = "linear"
grade = "measured"
base_us = 100
per_byte_us = 0
"""


def test_a_node_has_a_queue_of_its_own(tmp_path: Path) -> None:
    """The first node sends the row and what waits behind it; the queue of the bus is by priority."""
    text = QUEUED.format("priority", 3, "drive").replace('"host"', '"drive"') + DRIVE
    (tmp_path / "drive.toml").write_text(text)
    content = busplan.emulate(tmp_path / "drive.toml", cycles=200).content
    sent = [frame.us for frame in logged(content) if frame.identifier == 0x100]
    late_us = [us - sent[0] - 10_000 * number for number, us in enumerate(sent)]
    assert max(late_us) - min(late_us) >= 8 * 226


def test_a_plan_that_does_not_fit_is_emulated_as_it_is(tmp_path: Path) -> None:
    slow = busplan.load_profile("can-servo-8", changes={"bus.bit_rate_kbit_s": 250})
    busplan.emulate(slow, cycles=100).save(tmp_path / "slow.log")
    answer = busplan.measured("can-servo-8", tmp_path / "slow.log")
    assert "last PDO after SYNC" in {figure.quantity for figure in answer.outside}
    assert logged((tmp_path / "slow.log").read_bytes())[-1].us < 400_000
    # A frame lasts 18.6 us and a mailbox poll 14.4, and each waits for the one before.
    short = busplan.load_profile("ethercat-servo-8", changes={"cycle.period_us": 25, "bus.master_jitter_us": 0})
    stamps = [time_ns for time_ns, packet in packets(busplan.emulate(short, cycles=100).content) if not packet[6] & 2]
    assert len(stamps) == 200
    assert min(after - before for before, after in pairwise(stamps)) >= 14_000


@pytest.mark.parametrize("name", SHIPPED[:2])
def test_the_same_seed_gives_the_same_bytes(name: str) -> None:
    contents = [busplan.emulate(name, cycles=50, seed=seed, fault={"jitter": None}).content for seed in (3, 3, 4)]
    assert contents[0] == contents[1] != contents[2]


def test_a_duration_is_a_number_of_cycles() -> None:
    by_cycles, by_time = busplan.emulate("can-servo-8", cycles=25), busplan.emulate("can-servo-8", duration_us=99_000)
    assert (by_time.cycles, by_time.duration_us, by_time.content) == (25, 100_000, by_cycles.content)


# --- against other emulators and readers ----------------------------------------------------------------------


def packets(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Stamps [ns] and packets of a little-endian pcapng file."""
    at = 0
    while at < len(content):
        kind, size = struct.unpack_from("<II", content, at)
        assert struct.unpack_from("<I", content, at + size - 4) == (size,)
        if kind == 6:
            _, high, low, kept, whole = struct.unpack_from("<IIIII", content, at + 8)
            assert kept == whole
            yield high << 32 | low, content[at + 28 : at + 28 + kept]
        at += size
    assert at == len(content)


def datagrams(packet: bytes) -> list[tuple[int, int, int, int]]:
    """Command, address, data bytes and working counter of each datagram."""
    assert packet[:6] + packet[12:14] == b"\xff" * 6 + b"\x88\xa4"
    (length,) = struct.unpack_from("<H", packet, 14)
    assert length >> 12 == 1
    found, at, more = [], 16, True
    while more:
        command, _, address, size, _ = struct.unpack_from("<BBIHH", packet, at)
        more, size = bool(size & 0x8000), size & 0x7FF
        at += 12 + size
        found.append((command, address, size, *struct.unpack_from("<H", packet, at - 2)))
    assert at == 16 + (length & 0x7FF)
    assert len(packet) == max(at, 60)
    return found


@pytest.mark.parametrize("seed", range(at_least(4)))
def test_ethercat_frames_are_those_of_another_emulator(seed: int, machines: Machines) -> None:
    machine = machines("ethercat", seed)
    schedule = [frames for _, frames in ethercat_recording.schedule_of(machine.plan)]
    devices = sum(group["nodes"] for group in ethercat_recording.groups_of(machine.plan))
    bus, cycles = machine.plan["bus"], 3 * len(schedule)
    period_ns, jitter_ns = (int(1000 * us) for us in (machine.plan["cycle"]["period_us"], bus["master_jitter_us"]))
    sent: dict[int, list[Any]] = defaultdict(list)
    counters: dict[Any, set[Any]] = defaultdict(set)
    for time_ns, packet in packets(busplan.emulate(machine.path, cycles=cycles).content):
        parts = datagrams(packet)
        if packet[6] & 2:
            counters[tuple(part[0] for part in parts)].add(tuple(part[3] for part in parts))
        else:
            sent[time_ns // period_ns].append(parts)
            assert {part[3] for part in parts} == {0}
            if len(sent[time_ns // period_ns]) == 1:
                assert time_ns % period_ns <= jitter_ns
    for cycle in range(cycles):
        planned = schedule[cycle % len(schedule)]
        polls = sent[cycle][len(planned) :]
        assert [size for (_, _, size, _), *_ in polls] == [128] * bus.get("mailbox_polls", 0)
        for frame, expected in zip(sent[cycle], planned, strict=False):
            assert sorted(part[2] for part in frame) == sorted(size for *_, size in expected)
            logical = [[part[:3] for part in parts if part[0] in LOGICAL] for parts in (frame, expected)]
            assert sorted(logical[0]) == sorted(logical[1])
    for commands, seen in counters.items():
        for command, counter in zip(commands, zip(*seen, strict=True), strict=True):
            # A broadcast and the clocks pass all devices; a read or a write of a device adds 1, 2 of a write in LRW.
            most = {7: devices, 13: devices, 14: devices, 0: 0, 2: 1, 4: 1, 12: 3 * devices}.get(command, devices)
            assert max(counter) <= most
            if command in (7, 13, 14):
                assert set(counter) == {devices}


THREE = """\
schema_version = 1
name = "three"
[bus]
kind = "ethercat"
distributed_clocks = true
master_us = 20
{}
[cycle]
period_us = 1000
[[group]]
name = "io"
nodes = 1
axes = 0
every = 2
read_bytes = 2
write_bytes = 0
[[group]]
name = "drives"
nodes = 2
axes = 0
read_bytes = 6
write_bytes = 4
"""
BRD_STATE, APWR_TIME, ARMW_TIME = (7, 0x1300003, 2, 3), (2, 0x9100003, 4, 1), (13, 0x9100003, 4, 3)
ACONTIS = [(0, 0, 4, 0), APWR_TIME, BRD_STATE, ARMW_TIME]


@pytest.mark.parametrize(
    ("bus", "own", "both", "drives"),
    # An LRW counts 1 for each device that it reads, and 2 for each that it writes; io has no outputs.
    [
        ('master = "SOEM"', [(14, 0x9101001, 8, 3)], [(12, 0x10000, 22, 7)], [(12, 0x10002, 20, 6)]),
        ('master = "IgH"', [BRD_STATE, (14, 0x9101001, 4, 3)], [(12, 0x10000, 22, 7)], [(12, 0x10002, 20, 6)]),
        (
            'master = "ethercrab"',
            [(14, 0x9101001, 8, 3), *((4, 0x1301001 + place, 2, 1) for place in range(3))],
            [(12, 0x10000, 22, 7)],
            [(12, 0x10002, 20, 6)],
        ),
        (
            'master = "TwinCAT"',
            [(0, 0, 4, 0), BRD_STATE, (10, 0x9000000, 1, 3), ARMW_TIME],
            [(12, 0x10000, 14, 7)],
            [(12, 0x10002, 12, 6)],
        ),
        ('master = "acontis"', ACONTIS, [(12, 0x10000, 14, 7)], [(12, 0x10002, 12, 6)]),
        ("", ACONTIS, [(12, 0x10000, 22, 7)], [(12, 0x10002, 20, 6)]),
        (
            'housekeeping_bytes = [3, 5]\nprocess_data = "LRD-LWR"',
            [(0, 0, 3, 0), (0, 0, 5, 0)],
            [(10, 0x10000, 14, 3), (11, 0x810000, 8, 2)],
            [(10, 0x10002, 12, 2), (11, 0x810002, 8, 2)],
        ),
    ],
)
def test_datagrams_of_each_master_by_hand(
    bus: str, own: list[Any], both: list[Any], drives: list[Any], tmp_path: Path
) -> None:
    """Command, address, data bytes and working counter of each, as returned."""
    (tmp_path / "three.toml").write_text(THREE.format(bus))
    seen = [packet for _, packet in packets(busplan.emulate(tmp_path / "three.toml", cycles=4).content)]
    assert [datagrams(packet) for packet in seen[1::2]] == [own + both, own + drives] * 2
    for sent, back in zip(seen[::2], seen[1::2], strict=True):
        # Each device adds 1 to an address by place, and what comes back is what was sent but for states.
        sent_parts, back_parts = datagrams(sent), datagrams(back)
        passed = {address: address - 3 if command in (2, 7, 13) else address for command, address, *_ in back_parts}
        assert sent_parts == [(command, passed[address], size, 0) for command, address, size, _ in back_parts]
        at, states = 16, 0
        for _, address, size, _ in back_parts:
            data = [packet[at + 10 : at + 10 + size] for packet in (sent, back)]
            is_state = address >> 16 == 0x130
            assert data[1] == (b"\x08\x00" if is_state else data[0])
            assert not is_state or data[0] == b"\0\0"
            at, states = at + 12 + size, states + is_state


def test_an_ethercat_frame_returns_after_its_wire_its_way_and_half_to_all_of_the_host(tmp_path: Path) -> None:
    text = THREE.format('master = "SOEM"\nmailbox_polls = 2\nmailbox_bytes = 16\nmaster_jitter_us = 30')
    (tmp_path / "three.toml").write_text(text)
    stamps: dict[Any, list[float]] = defaultdict(list)
    for time_ns, packet in packets(busplan.emulate(tmp_path / "three.toml", cycles=300).content):
        (command, address, size, _), *_ = datagrams(packet)
        cycle, time_us = time_ns // 1_000_000, time_ns / 1000 % 1000
        assert packet[17] == cycle % 256
        # A frame of process data begins with the clocks; two polls of the three devices follow it, in turn.
        place = 0 if command == 14 else 1 + (address - 0x10801001 - 2 * cycle) % 3
        assert command == 14 or (command, size) == (4, 16)
        stamps[place, bool(packet[6] & 2)].append(time_us)
    assert {key: len(times) for key, times in stamps.items()} == {
        (n, way): 300 for n in range(3) for way in (False, True)
    }
    starts = stamps[0, False]
    assert 0 <= min(starts) < 1
    assert 29 < max(starts) < 30
    # 40 bytes, 20 of the clocks, 12 and 22 or 20 of the process data; a poll has 84, the least on the wire.
    for odd, size in ((0, 22), (1, 20)):
        wire_us, copy_us, way_us = (72 + size) * 0.08, size * 0.0035333, 3 * 2 * 0.698143
        hosts = [
            back - sent - wire_us - copy_us - way_us
            for sent, back in zip(starts[odd::2], stamps[0, True][odd::2], strict=True)
        ]
        assert 10 - 0.002 < min(hosts) < 10.5
        assert 19.5 < max(hosts) < 20.002
        for number in (1, 2):
            polls = stamps[number, False][odd::2]
            assert [poll - start for poll, start in zip(polls, starts[odd::2], strict=True)] == pytest.approx(
                [wire_us + (number - 1) * 84 * 0.08] * 150, abs=0.003
            )


def test_state_checks_of_many_devices_fill_frames_of_their_own(tmp_path: Path) -> None:
    text = (PROFILES / "ethercat-servo-8.toml").read_text()
    text = text.replace('master = "SOEM"', 'master = "ethercrab"').replace("nodes = 8 ", "nodes = 250 ")
    path = tmp_path / "long.toml"
    path.write_text(re.sub("period_us = 1000", "period_us = 8000", text))
    seen = [packet for _, packet in packets(busplan.emulate(path, cycles=20).content)]
    assert max(map(len, seen)) <= 1514
    machine = Machine("ethercat", path, {})
    checks = sum(part[0] == 4 and part[1] >> 16 == 0x130 for packet in seen for part in datagrams(packet))
    assert checks == 2 * 20 * 250
    figures = {figure.quantity: figure for figure in measured(machine, tmp_path, cycles=50).figures}
    assert figures["round trip"].verdict == figures["lost frames"].verdict == "within"


LINE = re.compile(r"\((\d{10})\.(\d{6})\) synthetic ([0-9A-F]{3}|[0-9A-F]{8})(##?)([01]?)((?:[0-9A-F]{2})*)\n")


class Sent(NamedTuple):
    us: int
    identifier: int
    is_extended: bool
    is_fd: bool
    switched: bool
    data: bytes


def logged(content: bytes) -> list[Sent]:
    frames = []
    for line in content.decode().splitlines(keepends=True):
        match = LINE.fullmatch(line)
        assert match, line
        seconds, part, identifier, mark, switch, data = match.groups()
        assert bool(switch) == (mark == "##")
        stamp_us = int(seconds) * 1_000_000 + int(part)
        frame = stamp_us, int(identifier, 16), len(identifier) == 8, mark == "##", switch == "1", bytes.fromhex(data)
        frames.append(Sent(*frame))
    return frames


@pytest.mark.parametrize("seed", range(at_least(4)))
def test_can_frames_take_their_time_on_the_wire_and_are_those_of_another_emulator(
    seed: int, machines: Machines
) -> None:
    plan, path = machines("can", seed)[2:0:-1]
    bus = plan["bus"]
    frames = logged(busplan.emulate(path, cycles=60).content)
    bit_us, data_bit_us = 1000 / bus["bit_rate_kbit_s"], 1000 / bus.get("data_bit_rate_kbit_s", 1)
    for before, frame in pairwise(frames):
        bits = 29 if frame.is_extended else 11
        if frame.is_fd:
            # Half of the possible stuff bits: 15 % beside those that the frame would have, at most.
            switched = fd_written_bits(frame.identifier, frame.data, identifier_bits=bits, is_switched=frame.switched)
            wire_us = 0.85 * (switched[0] * bit_us + switched[1] * data_bit_us)
        else:
            wire_us = written_bits(frame.identifier, frame.data, identifier_bits=bits) * bit_us
        assert frame.us - before.us >= wire_us - 1
    if "cycle" not in plan:
        return
    period_us, sync = plan["cycle"]["period_us"], bus.get("sync_identifier", 0x80)
    seen: dict[int, dict[int, int]] = defaultdict(dict)
    cycle = -1
    for frame in frames:
        cycle += frame.identifier == sync
        seen[cycle][frame.identifier] = len(frame.data)
        if frame.identifier == sync and bus.get("sync_counter"):
            assert frame.data[0] == cycle + 1
    assert cycle == 59
    assert frames[-1].us < 60 * period_us
    for cycle in range(60):
        due = [node for node in can_recording.nodes_of(plan) if cycle % node.every == 0]
        for node in due:
            for pdo in node.feedback + node.command:
                size = can_recording.padded(pdo.size) if "data_bit_rate_kbit_s" in bus else pdo.size
                assert seen[cycle].get(pdo.identifier) == size


def test_commands_come_behind_the_last_feedback_and_the_first_of_those_that_wait_goes() -> None:
    frames = logged(busplan.emulate("can-servo-8", cycles=200).content)
    cycle: list[int] = []
    for frame in frames:
        if frame.identifier == 0x80:
            cycle = []
        if 0x181 <= frame.identifier <= 0x208:
            cycle.append(frame.identifier)
        if len(cycle) == 16:
            # Feedback as its nodes have it; the commands are queued all at once.
            assert sorted(cycle[:8]) == list(range(0x181, 0x189))
            assert cycle[8:] == list(range(0x201, 0x209))


@pytest.mark.parametrize("name", SHIPPED[1::2])
def test_python_can_reads_what_is_written(name: str, tmp_path: Path) -> None:
    answer = busplan.emulate(name, cycles=60, fault={"error-frame": 2})
    answer.save(tmp_path / "bus.candump")
    read = list(can.CanutilsLogReader(str(tmp_path / "bus.candump")))
    assert len(read) == answer.content.count(b"\n")
    assert sum(message.is_error_frame for message in read) == 2
    assert {message.channel for message in read if not message.is_error_frame} == {"synthetic"}
    assert {message.is_fd for message in read if not message.is_error_frame} == {name == "can-fd-arm-7"}


@needs_wireshark
@pytest.mark.parametrize("name", SHIPPED)
def test_wireshark_reads_what_is_written(name: str, tmp_path: Path) -> None:
    machine = shipped(name)
    path = tmp_path / f"recording{machine.ending}"
    busplan.emulate(name, cycles=40).save(path)

    def lines(*command: str) -> list[str]:
        done = subprocess.run([*command, str(path)], check=True, capture_output=True, text=True)
        return done.stdout.splitlines()

    assert lines("tshark", "-Y", "_ws.malformed", "-r") == []
    if machine.kind == "ethercat":
        assert len(lines("tshark", "-Y", "ecat", "-r")) == len(list(packets(path.read_bytes())))
        comment = f"synthetic: emulated by busplan {busplan.__version__} from {name}"
        said = [" ".join(line.split()) for line in lines("capinfos", "-k", "-I")]
        assert f"Capture comment: {comment}" in said
        assert "Name = synthetic" in said
    else:
        assert len(lines("tshark", "-r")) == path.read_bytes().count(b"\n")


# --- it is no measurement -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED[:2])
def test_a_synthetic_recording_never_counts_as_a_measurement(name: str, run: Run, tmp_path: Path) -> None:
    machine = shipped(name)
    recording = f"recording{machine.ending}"
    (tmp_path / "mine.toml").write_bytes(machine.path.read_bytes())
    # A machine that differs from its plan, so that there is something to write.
    changed = "bus.master_us=60" if machine.kind == "ethercat" else "message.heartbeats.period_us=20000"
    made = run("emulate", "mine.toml", "--set", changed, "-o", recording, cwd=tmp_path)
    assert made.returncode == 0
    assert "Synthetic recording of" in made.stderr
    answer = busplan.measured(tmp_path / "mine.toml", tmp_path / recording)
    assert answer.edits == {}
    assert "synthetic" in answer.shows_nothing[0]
    applied = run("measured", "mine.toml", recording, "--apply", cwd=tmp_path)
    assert applied.returncode == 2
    assert "synthetic" in applied.stderr
    assert (tmp_path / "mine.toml").read_bytes() == machine.path.read_bytes()
    judged = run("check", "mine.toml", "--no-circle", "--recording", recording, cwd=tmp_path)
    assert judged.returncode == 1
    assert re.search(r"BP403 error: .*synthetic", judged.stdout)
    if machine.kind == "can":
        imported = run("import", recording, "-o", "new.toml", cwd=tmp_path)
        assert imported.returncode == 2
        assert "synthetic" in imported.stderr
        assert not (tmp_path / "new.toml").exists()


def test_a_capture_is_synthetic_by_its_comment_or_by_its_frames(tmp_path: Path) -> None:
    seen = list(packets(busplan.emulate("ethercat-servo-8", cycles=30).content))
    path = tmp_path / "converted.pcap"
    path.write_bytes(ethercat_recording.pcap([(time_ns / 1000, packet) for time_ns, packet in seen]))
    assert "synthetic" in busplan.measured("ethercat-servo-8", path).shows_nothing[0]
    others = [(time_ns, packet[:8] + b"\x5f" + packet[9:]) for time_ns, packet in seen]
    path.write_bytes(pcapng(others, link=1, origin="by its comment"))
    assert busplan.measured("ethercat-servo-8", path).shows_nothing[0].startswith("synthetic: by its comment;")
    path.write_bytes(ethercat_recording.pcap([(time_ns / 1000, packet) for time_ns, packet in others]))
    assert busplan.measured("ethercat-servo-8", path).shows_nothing == ()


def test_a_comment_commands_no_terminal(tmp_path: Path) -> None:
    content = busplan.emulate("ethercat-servo-8", cycles=30).content
    path = tmp_path / "hostile.pcapng"
    path.write_bytes(content.replace(b"emulated by", b"\x1b[2J\r\n\x07  \xff\xfe"))
    (reason,) = busplan.measured("ethercat-servo-8", path).shows_nothing
    assert reason.isprintable()
    assert reason.startswith("synthetic: ")


def test_a_recording_of_a_machine_is_not_synthetic() -> None:
    path = Path(__file__).parents[1] / "measured" / "files" / "capture.pcapng"
    assert not any("synthetic" in reason for reason in busplan.measured("ethercat-servo-8", path).shows_nothing)


# --- the command ----------------------------------------------------------------------------------------------


def test_the_command_writes_the_answer_of_the_function(run: Run, tmp_path: Path) -> None:
    options = ("--duration", "120ms", "--seed", "5", "--fault", "late-command=3ms", "--fault", "error-frame=2")
    done = run("emulate", "can-servo-8", *options, "-o", "log.candump", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    fault = {"late-command": 3000.0, "error-frame": 2}
    answer = busplan.emulate("can-servo-8", duration_us=120_000, seed=5, fault=fault)
    assert (tmp_path / "log.candump").read_bytes() == answer.content
    assert done.stderr.splitlines() == [
        "wrote log.candump",
        "Synthetic recording of can-servo-8: 30 cycles, 0.12 s, seed 5. It is not a measurement.",
        "late-command: the host sends its commands late, 5 times, 3000 us; measured shows last PDO after SYNC.",
        "error-frame: a frame is destroyed and sent again, 2 times; measured shows error frames.",
    ]
    assert run("emulate", "can-servo-8", *options, cwd=tmp_path).stdout.encode() == answer.content
    assert answer.to_dict()["faults"][0]["name"] == "late-command"


def test_the_help_names_all_faults() -> None:
    from busplan.cli.design import emulate_command  # noqa: PLC0415 - what only this test reads

    words = " ".join((emulate_command.__doc__ or "").split())
    *of_sync, error = (fault.name for fault in FAULTS["can"])
    assert f"Faults of EtherCAT: {', '.join(fault.name for fault in FAULTS['ethercat'])}." in words
    can = f"{error}; with SYNC {', '.join(of_sync)}; without it {', '.join(OF_REQUESTS)}"
    assert f"Faults of CAN: {can}." in words


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("paper-4ms", "-o", "x.log"), "bus.kind ieee1394 cannot be emulated; only can and ethercat are"),
        (("can-servo-8", "-o", "x.pcapng"), "--output x.pcapng: expected a name ending in .log, .candump"),
        (("ethercat-servo-8", "-o", "x.pcap"), "--output x.pcap: expected a name ending in .pcapng"),
        (("can-servo-8", "--fault", "jiter"), "there are missing-cycle, missing-pdo, double-pdo, late-command, jitter"),
        (("can-servo-8", "--fault", "jitter=0us"), "fault jitter: 0; expected a time above zero"),
        (("can-servo-8", "--fault", "missing-pdo=5us"), "fault missing-pdo '5us': expected a whole number from 1"),
        (("can-servo-8", "--fault", "jitter=5"), "--fault jitter 5: expected a time with its unit"),
        (("can-servo-8", "--fault", "missing-pdo=0"), "expected a whole number from 1"),
        (("can-servo-8", "--cycles", "10", "--fault", "missing-pdo"), "it takes a quarter at most"),
        (("can-servo-8", "--cycles", "10", "--duration", "1s"), "--cycles and --duration: give one of them"),
        (("can-servo-8", "--cycles", "0"), "--cycles 0: expected a whole number from 1"),
        (("can-servo-8", "--duration", "0s"), "--duration 0 us: expected a recording of 1 to 1,000,000 cycles of 4000"),
        (
            ("can-servo-8", "--fault", "jitter=100s"),
            "--fault jitter: 100000000 us; expected a time below that of the recording, 4000000 us",
        ),
        (("can-servo-8", "--seed", "0"), "seed 0: expected a whole number from 1"),
        (("can-servo-8", "--cycles", "1000000"), "a recording has up to 500,000: give fewer cycles"),
        (("ethercat-servo-8", "--duration", "1000s"), "a recording has up to 500,000: give fewer cycles"),
        (
            ("ethercat-servo-8", "--set", "payload.read_bytes=150", "--cycles", "50000"),
            "bytes; a recording has up to 120,000,000: give fewer cycles",
        ),
    ],
)
def test_what_cannot_be_emulated_is_refused_and_nothing_is_written(
    arguments: tuple[str, ...], words: str, run: Run, tmp_path: Path
) -> None:
    if "-o" not in arguments:
        old = "old.pcapng" if arguments[0].startswith("ethercat") else "old.log"
        arguments = (*arguments, "-o", old)
        (tmp_path / old).write_text("as it was")
    done = run("emulate", *arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert {path.read_text() for path in tmp_path.iterdir()} <= {"as it was"}


def test_messages_alone_have_no_fault_of_a_cycle(tmp_path: Path) -> None:
    path = tmp_path / "body.toml"
    message = '[[message]]\nname = "a"\nidentifier = 1\npayload_bytes = 8\nperiod_us = 10000\n'
    path.write_text(f'schema_version = 1\nname = "body"\n[bus]\nkind = "can"\nbit_rate_kbit_s = 500\n{message}')
    with pytest.raises(busplan.BusplanError, match="fault jitter: a network of messages alone has no SYNC"):
        busplan.emulate(path, fault={"jitter": None})
    answer = measured(Machine("can", path, {}), tmp_path, cycles=100, fault={"error-frame": 3})
    assert "error frames" in [figure.quantity for figure in answer.outside]


@pytest.mark.parametrize(("cycles", "said"), [(22, "18"), (23, "19")])
def test_the_first_cycles_have_no_fault_and_the_last_ends_where_the_log_does(cycles: int, said: str) -> None:
    with pytest.raises(busplan.BusplanError, match=f"fault missing-pdo: 5 times; of {said} cycles that may have it"):
        busplan.emulate("can-servo-8", cycles=cycles, fault={"missing-pdo": 5})


@pytest.mark.parametrize(
    ("name", "fault", "share"),
    [
        ("can-servo-8", "jitter", 0.5),
        ("can-servo-8", "late-command", 1.0),
        ("ethercat-servo-8", "jitter", 0.25),
        ("can-motors-8", "slow-node", 0.3),
        ("can-motors-8", "slow-host", 0.3),
    ],
)
def test_a_fault_without_a_time_takes_its_share_of_the_period(name: str, fault: str, share: float) -> None:
    us = share * busplan.load_profile(name).cycle.period_us
    ours, given = (busplan.emulate(name, cycles=40, fault={fault: to}) for to in (None, us))
    assert ours.content == given.content


def test_only_kinds_whose_recordings_are_read_are_emulated() -> None:
    kinds: Mapping[str, Any] = {name: kind_named(name) for name in kind_names()}
    assert [bool(kind.recordings) for kind in kinds.values()] == [bool(kind.emulator()) for kind in kinds.values()]
