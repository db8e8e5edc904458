"""Captures of an EtherCAT master's port with known truth, event by event. It imports nothing of busplan.

A cycle starts by the master's clock and its jitter; its frames follow each other on the wire, and each is stamped when
it starts. It returns when its bytes have been sent and have passed all devices and back, and the host has taken the
rest of its time. `planned` makes the machine of a plan, the keys of a profile's file; what it does beside its plan
stands in `Machine`. Of 40 such captures tshark 4.0 dissects every datagram, and reads each stamp to its step.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from math import lcm
from random import Random
from typing import Any, Final, NamedTuple

MASTER = bytes.fromhex("001122334455")
BYTE_US = 0.08
COPY_US = 0.0035
HOP_US = 0.698
CABLE_US = 0.005
"""Of a metre."""
NOP, APRD, APWR, FPRD, BRD, BWR, LRD, LWR, LRW, ARMW, FRMW = 0, 1, 2, 4, 7, 8, 10, 11, 12, 13, 14
LOGICAL: Final = (LRD, LWR, LRW)
MOST_BYTES: Final = 1498
"""Of all datagrams of a frame."""
Datagram = tuple[int, int, int]
"""Command, address and data bytes."""


class Frame(NamedTuple):
    """A frame, and the working counters with which it returns."""

    datagrams: tuple[Datagram, ...]
    counters: tuple[int, ...]

    @property
    def process_bytes(self) -> int:
        """Its process data."""
        return sum(size for command, _, size in self.datagrams if command in LOGICAL)


@dataclass
class Machine:
    """What the machine does. Numbers of cycles count from 0."""

    period_us: float = 1000.0
    jitter_us: float = 20.0
    """Start of a frame behind the planned one, 0..jitter."""
    host_us: float = 30.0
    host_spread_us: float = 10.0
    """The host takes host_us, and evenly 0..spread more."""
    devices: int = 4
    datagrams: tuple[Datagram, ...] = ((LRW, 0x10000, 80), (FRMW, 0, 8))
    counters: tuple[int, ...] = (12, 4)
    """Of a machine with the same single frame in every cycle."""
    lost: frozenset[int] = frozenset()
    """Cycles whose last frame does not return."""
    wrong: frozenset[int] = frozenset()
    """Cycles whose first frame returns with working counters of 0."""
    skipped: frozenset[int] = frozenset()
    """Cycles in which the master sends nothing."""
    late: dict[int, float] = field(default_factory=dict)
    """Starts that are so much later [us]."""
    has_index: bool = True
    hop_us: float = HOP_US
    frames: tuple[tuple[Frame, ...], ...] = ()
    """Of each cycle in turn, instead of the single one."""
    line_us: float | None = None
    """All devices and cables there and back, instead of hop_us."""
    polls: int = 0
    """Frames on a mailbox behind those of process data, 0..polls in each cycle."""
    poll_bytes: int = 128
    is_normal: bool = False
    """Whether starts have a normal distribution about jitter / 2, else an even one."""
    clock: float = 1.0
    """Period of the master's clock, in those of the recorder's."""
    bend: float = 0.0
    """By what share of it that changes from the first cycle to the last one."""
    form: str = "pcapng ns"
    at_port: bool = True
    """Whether stamps are those of the port, else those of a program that copies frames as they come."""
    dropped: int | None = None
    """Packets that the recorder drops, and says so; None for one that says nothing."""

    @property
    def in_turn(self) -> tuple[tuple[Frame, ...], ...]:
        """Frames of each cycle in turn."""
        return self.frames or ((Frame(self.datagrams, self.counters),),)


class Trip(NamedTuple):
    """A frame that was sent."""

    cycle: int
    frame: Frame
    us: float
    back_us: float
    late_us: float
    """Start of its cycle behind the planned one."""
    host_us: float
    returns: bool = True
    is_wrong: bool = False
    is_poll: bool = False


def wire_us(data_bytes: Sequence[int]) -> float:
    """A frame on the wire, gap included [us]."""
    return float(max(8 + 14 + 2 + sum(size + 12 for size in data_bytes) + 4 + 12, 84) * BYTE_US)


def _wire_us(frames: Sequence[Frame]) -> float:
    return sum(wire_us([size for *_, size in frame.datagrams]) for frame in frames)


def trips(machine: Machine, cycles: int, *, seed: int = 1) -> Iterator[Trip]:
    """All frames of a number of cycles."""
    random = Random(seed)
    line_us = 2 * machine.devices * machine.hop_us if machine.line_us is None else machine.line_us
    poll = Frame(((FPRD, 0, machine.poll_bytes),), (1,))
    for cycle in range(cycles):
        late = random.uniform(0, machine.jitter_us)
        if machine.is_normal:
            late = min(max(random.gauss(machine.jitter_us / 2, machine.jitter_us / 7), 0.0), machine.jitter_us)
        late += machine.late.get(cycle, 0.0)
        host = machine.host_us + random.uniform(0, machine.host_spread_us)
        polls = random.randint(0, machine.polls) if machine.polls else 0
        frames = machine.in_turn[cycle % len(machine.in_turn)]
        if cycle in machine.skipped:
            continue
        start = cycle * machine.period_us * machine.clock * (1 + machine.bend * cycle / cycles) + late
        copied = 0
        for place, frame in enumerate([*frames, *[poll] * polls]):
            own_us = _wire_us([frame])
            copied += frame.process_bytes
            returns = cycle not in machine.lost or place != len(frames) - 1
            is_wrong = cycle in machine.wrong and not place
            back = start + own_us + line_us + copied * COPY_US + host
            yield Trip(cycle, frame, start, back, late, host, returns, is_wrong, is_poll=place >= len(frames))
            start += own_us


def ethernet(
    datagrams: tuple[Datagram, ...],
    *,
    index: int,
    counters: tuple[int, ...],
    master: bytes = MASTER,
    returned: bool = False,
    tag: bytes = b"",
) -> bytes:
    """A frame as it stands in a capture, without check sequence."""
    body = b""
    for number, (command, address, size) in enumerate(datagrams):
        more = 0x8000 if number + 1 < len(datagrams) else 0
        counter = counters[number] if returned else 0
        body += struct.pack("<BBIHH", command, index, address, size | more, 0) + bytes(size)
        body += struct.pack("<H", counter)
    source = bytes([master[0] | 2 * returned]) + master[1:]
    return b"\xff" * 6 + source + tag + b"\x88\xa4" + struct.pack("<H", len(body) | 0x1000) + body


def simulated(machine: Machine, cycles: int, *, seed: int = 1) -> list[tuple[float, bytes]]:
    """Stamps [us] and packets of a number of cycles, in the order of time."""
    return _packets(machine, list(trips(machine, cycles, seed=seed)))


def _packets(machine: Machine, each: list[Trip]) -> list[tuple[float, bytes]]:
    packets = []
    for number, trip in enumerate(each):
        index = (trip.cycle if not machine.frames else number) % 256 if machine.has_index else 0
        datagrams, counters = trip.frame
        packets.append((trip.us, ethernet(datagrams, index=index, counters=counters)))
        if trip.returns:
            counters = (0,) * len(counters) if trip.is_wrong else counters
            back = ethernet(datagrams, index=index, counters=counters, returned=True)
            # A program that copies frames stamps them as fast as it reads them, whatever their length.
            back_us = trip.back_us if machine.at_port else trip.us + 2 + trip.host_us % 3
            packets.append((back_us, back))
    return sorted(packets, key=lambda packet: packet[0])


def recorded(machine: Machine, cycles: int, *, seed: int = 1) -> tuple[bytes, dict[str, float]]:
    """A capture of a machine, which begins anywhere in its second cycle, and the truth of it."""
    random = Random(-seed)
    each = list(trips(machine, cycles + 2, seed=seed))
    start_us = machine.period_us * (1 + random.random())
    packets = [packet for packet in _packets(machine, each) if packet[0] >= start_us]
    for _ in range(machine.dropped or 0):
        packets.pop(random.randrange(len(packets)))
    kind, step = machine.form.split()
    order, start_s = random.choice("<>"), random.randrange(1_500_000_000, 1_800_000_000)
    if kind == "pcap":
        content = pcap(packets, order=order, nano=step == "ns", start_s=start_s)
    else:
        resolution = 9 if step == "ns" else random.choice((6, None))
        content = pcapng(packets, order=order, resolution=resolution, start_s=start_s, dropped=machine.dropped)
    return content, truth(machine, [trip for trip in each if trip.us >= start_us])


def truth(machine: Machine, each: list[Trip]) -> dict[str, float]:
    """What a capture has in truth, by the emulator's own words: times in us, bytes, counts."""
    by_cycle: dict[int, list[Trip]] = {}
    for trip in each:
        if not trip.is_poll:
            by_cycle.setdefault(trip.cycle, []).append(trip)
    whole = [own for own in by_cycle.values() if all(trip.returns for trip in own)]
    most_us = max(map(_wire_us, machine.in_turn))
    fullest = [own for own in whole if _wire_us([trip.frame for trip in own]) == most_us]
    cycles = range(min(by_cycle), max(by_cycle) + 1)
    starts = [own[0].late_us for own in by_cycle.values()]
    back = [trip for trip in each if trip.returns]
    return {
        "period": machine.period_us * machine.clock * (1 + machine.bend),
        "latest start": max(starts) - min(starts),
        "round trip": max(own[-1].back_us - own[0].us for own in fullest),
        "master, least": max(own[-1].host_us for own in fullest),
        "master, most": max(own[-1].host_us for own in whole),
        "frames in a cycle": max(map(len, machine.in_turn)),
        "datagrams": max(sum(size + 12 for frame in own for *_, size in frame.datagrams) for own in machine.in_turn),
        "lost": len(each) - len(back),
        "wrong": sum(trip.is_wrong for trip in back),
        "without a frame": sum(bool(machine.in_turn[at % len(machine.in_turn)]) for at in cycles) - len(by_cycle),
    }


# --- the machine of a plan ----------------------------------------------------------------------------------

DELAYS_US: Final = {"100BASE-TX": HOP_US, "E-bus": 0.1507}


def housekeeping(bus: dict[str, Any], devices: int) -> Iterator[tuple[Datagram, int]]:
    """Datagrams that a master adds to the first frame, each with its working counter."""
    if "housekeeping_bytes" in bus:
        yield from (((BRD, 0x130, size), devices) for size in bus["housekeeping_bytes"])
        return
    master, has_clocks = bus.get("master"), bus.get("distributed_clocks", False)
    if master == "IgH":
        yield (BRD, 0x130, 2), devices
    elif master == "TwinCAT":
        yield from (((NOP, 0, 4), 0), ((BRD, 0x130, 2), devices), ((LRD, 0x9000000, 1), 1))
    elif master == "ethercrab":
        yield from (((FPRD, 0x1300000 + device, 2), 1) for device in range(devices))
    elif master != "SOEM":
        yield from (((NOP, 0, 4), 0), ((APWR, 0, 4), 1), ((BRD, 0x130, 2), devices))
    if has_clocks:
        yield (FRMW, 0x910, 8 if master in ("SOEM", "ethercrab") else 4), devices


def bytes_of(group: dict[str, Any], way: str) -> int:
    """Payload of a device in one direction."""
    return int(group.get(f"{way}_bytes", 0) + group.get(f"{way}_bytes_per_axis", 0) * group["axes"])


def first_cycles(groups: list[dict[str, Any]], sizes: list[int], *, is_spread: bool) -> list[int]:
    """First cycle of each group: the faster first, of one rate the larger, where the fullest of its cycles is least."""
    found, filled = [0] * len(groups), [0] * lcm(*(group["every"] for group in groups))
    for place in sorted(range(len(groups)), key=lambda place: (groups[place]["every"], -sizes[place])):
        every = groups[place]["every"]
        if is_spread:
            found[place] = min(range(every), key=lambda start: max(filled[start::every]))
        for cycle in range(found[place], len(filled), every):
            filled[cycle] += sizes[place]
    return found


def frames_of(plan: dict[str, Any]) -> tuple[tuple[Frame, ...], ...]:
    """Frames of each cycle in turn: devices in their order, each whole, a new frame where the next has no room."""
    bus = plan["bus"]
    master = bus.get("master")
    layout = bus.get("process_data", "LRW-shared" if master in ("TwinCAT", "acontis") else "LRW-separate")
    groups = groups_of(plan)
    both = [(bytes_of(group, "read"), bytes_of(group, "write")) for group in groups]
    sizes = [max(pair) if layout == "LRW-shared" else sum(pair) for pair in both]
    totals = [size * group["nodes"] for size, group in zip(sizes, groups, strict=True)]
    first = first_cycles(groups, totals, is_spread=bus.get("units", "spread") == "spread")
    each = list(zip(groups, first, both, sizes, accumulate(totals, initial=0x10000), strict=False))
    added = tuple(housekeeping(bus, sum(group["nodes"] for group in groups)))
    headers = 24 if layout == "LRD-LWR" else 12
    cycles = []
    for cycle in range(lcm(*(group["every"] for group in groups))):
        packed: list[list[tuple[int, int, int]]] = [[]]
        room = MOST_BYTES - headers - sum(size + 12 for (*_, size), _ in added)
        for group, start, (read, write), size, address in each:
            for device in range(group["nodes"] if (cycle - start) % group["every"] == 0 and size else 0):
                if size > room:
                    packed.append([])
                    room = MOST_BYTES - headers
                packed[-1].append((read, write, address + device * size))
                room -= size
        parts = [[*(() if place else added), *_process(own, layout)] for place, own in enumerate(packed)]
        cycles.append(tuple(Frame(*(tuple(column) for column in zip(*own, strict=True))) for own in parts if own))
    return tuple(cycles)


def _process(own: list[tuple[int, int, int]], layout: str) -> Iterator[tuple[Datagram, int]]:
    """Datagrams of process data of some devices."""
    if not own:
        return
    reads, writes = sum(bool(read) for read, *_ in own), sum(bool(write) for _, write, _ in own)
    address = own[0][2]
    if layout == "LRD-LWR":
        yield (LRD, address, sum(read for read, *_ in own)), reads
        yield (LWR, address + 0x800000, sum(write for _, write, _ in own)), writes
        return
    size = sum(max(read, write) if layout == "LRW-shared" else read + write for read, write, _ in own)
    yield (LRW, address, size), reads + 2 * writes


def groups_of(plan: dict[str, Any]) -> list[dict[str, Any]]:
    """Groups of devices, or all that are alike."""
    if "node" in plan:
        return [{**plan["payload"], **plan["node"], "nodes": plan["bus"]["nodes"], "every": 1}]
    return [{"every": 1, **group} for group in plan["group"]]


def planned(plan: dict[str, Any], *, seed: int) -> Machine:
    """A machine that keeps a plan, at its limits or below; devices of a port differ from others as kinds do."""
    random, bus = Random(seed), plan["bus"]
    more_us = {port: random.uniform(-0.1, 0.1) * delay_us for port, delay_us in DELAYS_US.items()}
    line_us = 0.0
    for group in groups_of(plan):
        port = group.get("port", "100BASE-TX")
        delay_us = group.get("delay_us", DELAYS_US[port] + more_us[port])
        line_us += 2 * group["nodes"] * (delay_us + group.get("cable_m", 0) * CABLE_US)
    host_us, jitter_us = bus.get("master_us", 0.0), bus.get("master_jitter_us", 0.0)
    least = random.uniform(0.4, 0.95)
    frames = frames_of(plan)
    turn = random.randrange(len(frames))
    return Machine(
        period_us=plan["cycle"]["period_us"],
        jitter_us=jitter_us * random.choice((1.0, random.uniform(0.2, 1))),
        host_us=host_us * least,
        host_spread_us=host_us * (1 - least) * random.choice((1.0, random.random())),
        has_index=random.random() < 0.8,
        frames=frames[turn:] + frames[:turn],
        line_us=line_us,
        polls=bus.get("mailbox_polls", 0),
        poll_bytes=bus.get("mailbox_bytes", 128),
        is_normal=random.random() < 0.5,
        clock=1 + random.uniform(-4e-5, 4e-5),
        bend=random.choice((0.0, random.uniform(-1e-5, 1e-5))),
        form=random.choice(FORMS),
        dropped=random.choice((None, 0)),
    )


FORMS: Final = ("pcapng ns", "pcapng us", "pcap ns", "pcap us")


# --- files, and a start with the clocks of devices ----------------------------------------------------------


def register(command: int, address: int, at: int, data: bytes, counter: int, *, returned: bool) -> bytes:
    """A frame of one datagram on registers, as it stands in a capture."""
    body = struct.pack("<BBHHHH", command, 7, address, at, len(data), 0) + data + struct.pack("<H", counter)
    source = bytes([MASTER[0] | 2 * returned]) + MASTER[1:]
    return b"\xff" * 6 + source + b"\x88\xa4" + struct.pack("<H", len(body) | 0x1000) + body


def start_up(
    hops_ns: tuple[int, ...], *, clocks_ns: tuple[int, ...], ports: int = 1, read: int = FPRD, width: int = 16
) -> list[tuple[float, bytes]]:
    """A master that latches and reads the port times of a line, 1 ms before the first cycle.

    hops_ns: one way from each device to the next; clocks_ns: what each device's own clock shows as the frame enters
    it; ports: the one that leads on; read: command; width: bytes of a read.
    """
    count = len(clocks_ns)
    packets = [
        (
            register(BWR, 0, 0x900, bytes(4), 0, returned=False),
            register(BWR, count, 0x900, bytes(4), count, returned=True),
        )
    ]
    for number, entered in enumerate(clocks_ns):
        times = [0, 0, 0, 0]
        times[0] = entered % 2**32
        if number + 1 < count:
            times[ports] = (entered + 2 * sum(hops_ns[number:])) % 2**32
        data = struct.pack("<4I", *times)
        # The address by place counts up in each device that it passes.
        sent, back = (-number & 0xFFFF, count - number) if read == APRD else (0x1000 + number,) * 2
        for at in range(0, 16, width):
            part = data[at : at + width]
            packets.append(
                (
                    register(read, sent, 0x900 + at, bytes(width), 0, returned=False),
                    register(read, back, 0x900 + at, part, 1, returned=True),
                )
            )
    times_us = [-1000 + 20.0 * place for place in range(len(packets))]
    return [
        (time + late, frame)
        for time, pair in zip(times_us, packets, strict=True)
        for late, frame in zip((0, 15), pair, strict=True)
    ]


def pcap(
    packets: list[tuple[float, bytes]], *, order: str = "<", nano: bool = True, start_s: int = 1_700_000_000
) -> bytes:
    """A pcap file."""
    written = struct.pack(f"{order}IHHiIII", 0xA1B23C4D if nano else 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    for time_us, packet in packets:
        time_ns = start_s * 10**9 + round(time_us * 1000)
        part = time_ns % 10**9 // (1 if nano else 1000)
        written += struct.pack(f"{order}IIII", time_ns // 10**9, part, len(packet), len(packet)) + packet
    return written


def pcapng(
    packets: list[tuple[float, bytes]],
    *,
    order: str = "<",
    resolution: int | None = 9,
    start_s: int = 1_700_000_000,
    dropped: int | None = None,
) -> bytes:
    """A pcapng file of an interface with a resolution of its stamps, 10^-n s; None for the default, 1 us.

    dropped: packets that the block of the interface's statistics says to be dropped; None for no such block.
    """
    options = b"" if resolution is None else struct.pack(f"{order}HHB3xHH", 9, 1, resolution, 0, 0)
    written = struct.pack(f"{order}IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    size = 20 + len(options)
    written += struct.pack(f"{order}IIHHI", 1, size, 1, 0, 65535) + options + struct.pack(f"{order}I", size)
    parts = [written]
    for time_us, packet in packets:
        time_ns = start_s * 10**9 + round(time_us * 1000)
        ticks = time_ns * 10 ** (6 if resolution is None else resolution) // 10**9
        filled = packet + bytes(-len(packet) % 4)
        size = 32 + len(filled)
        head = struct.pack(f"{order}IIIIIII", 6, size, 0, ticks >> 32, ticks & 0xFFFFFFFF, len(packet), len(packet))
        parts.append(head + filled + struct.pack(f"{order}I", size))
    if dropped is not None:
        # isb_ifrecv and isb_ifdrop, at the time of the last packet.
        counts = struct.pack(f"{order}HHQHHQHH", 4, 8, len(packets) + dropped, 5, 8, dropped, 0, 0)
        head = struct.pack(f"{order}IIIII", 5, 24 + len(counts), 0, ticks >> 32, ticks & 0xFFFFFFFF)
        parts.append(head + counts + struct.pack(f"{order}I", 24 + len(counts)))
    return b"".join(parts)
