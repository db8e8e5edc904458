"""Captures of an EtherCAT master's port with known truth, event by event. It imports nothing of busplan.

A cycle starts by the master's clock and its jitter; its frames follow each other on the wire, and each is stamped when
it starts. It returns when its bytes have been sent and have passed all devices and back, and the host has taken the
rest of its time. `planned` makes the machine of a plan, the keys of a profile's file; what it does beside its plan
stands in `Machine`. Of 40 such captures tshark 4.0 dissects every datagram, and reads each stamp to its step.
"""

import struct
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from math import lcm
from random import Random
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

MASTER = bytes.fromhex("001122334455")
BYTE_US = 0.08
COPY_US = 0.0035
HOP_US = 0.698
CABLE_US = 0.005
"""Of a metre."""
NOP, APRD, APWR, FPRD, BRD, BWR, LRD, LWR, LRW, FRMW = 0, 1, 2, 4, 7, 8, 10, 11, 12, 14
MOST_BYTES: Final = 1498
"""Of all datagrams of a frame."""
Datagrams = tuple[tuple[int, int, int], ...]
"""Command, address and data bytes of each."""


@dataclass
class Machine:
    """What the machine does. Cycles are numbered from 0."""

    period_us: float = 1000.0
    jitter_us: float = 20.0
    """Start of a frame behind the planned one, evenly 0..jitter, or of another shape with a spread of about that."""
    shape: Literal["uniform", "normal", "exponential"] = "uniform"
    clock_ppm: float = 0.0
    """How much faster the recorder's clock runs."""
    bend_ppm: float = 0.0
    """How much faster it runs on average by the end."""
    host_us: float = 30.0
    host_spread_us: float = 10.0
    """The host takes host_us, and evenly 0..spread more."""
    devices: int = 4
    datagrams: Datagrams = ((LRW, 0x10000, 80), (FRMW, 0, 8))
    schedule: tuple[tuple[Datagrams, ...], ...] = ()
    """Frames of each cycle, over and over; without it one of `datagrams`."""
    names: tuple[str, ...] = ("",)
    """What goes in each of them, as " with drives and valves"; empty where all cycles are alike."""
    counters: tuple[int, ...] = (12, 4)
    """Working counters of the datagrams; empty for 3 in each."""
    lost: frozenset[int] = frozenset()
    """Cycles whose frames do not return."""
    wrong: frozenset[int] = frozenset()
    """Cycles whose frames return with working counters of 0."""
    skipped: frozenset[int] = frozenset()
    """Cycles in which the master sends nothing."""
    late: dict[int, float] = field(default_factory=dict)
    """Starts that are so much later [us]."""
    has_index: bool = True
    hop_us: float = HOP_US
    line_us: float | None = None
    """All devices and cables there and back, instead of hop_us."""
    polls: int = 0
    """Frames on a mailbox behind those of process data, 0..polls in each cycle."""
    poll_bytes: int = 128
    form: str = "pcapng ns"
    at_port: bool = True
    """Whether stamps are those of the port, else those of a program that copies frames as they come."""
    dropped: int | None = None
    """Packets that the recorder drops, and says so; None for one that says nothing."""

    def frames(self, cycle: int) -> tuple[Datagrams, ...]:
        """Frames with process data of a cycle."""
        return self.schedule[cycle % len(self.schedule)] if self.schedule else (self.datagrams,)


class Trip(NamedTuple):
    """A frame that was sent."""

    cycle: int
    datagrams: Datagrams
    us: float
    back_us: float
    is_poll: bool


def wire_us(data_bytes: Sequence[int]) -> float:
    """A frame on the wire, gap included [us]."""
    return float(max(8 + 14 + 2 + sum(size + 12 for size in data_bytes) + 4 + 12, 84) * BYTE_US)


def starts_and_hosts(machine: Machine, cycles: int, *, seed: int = 1) -> list[tuple[float, float]]:
    """How late each cycle starts, and what the host takes in it [us]."""
    random = Random(seed)
    shapes = {
        "uniform": lambda: random.uniform(0, machine.jitter_us),
        "normal": lambda: min(max(random.gauss(machine.jitter_us / 2, machine.jitter_us / 8), 0.0), machine.jitter_us),
        "exponential": lambda: random.expovariate(6 / machine.jitter_us),
    }
    return [
        (
            shapes[machine.shape]() + machine.late.get(cycle, 0.0),
            machine.host_us + random.uniform(0, machine.host_spread_us),
        )
        for cycle in range(cycles)
    ]


def trips(machine: Machine, cycles: int, *, seed: int = 1) -> Iterator[Trip]:
    """All frames of a number of cycles."""
    random = Random(f"polls {seed}")
    line_us = 2 * machine.devices * machine.hop_us if machine.line_us is None else machine.line_us
    for cycle, (late_us, host_us) in enumerate(starts_and_hosts(machine, cycles, seed=seed)):
        if cycle in machine.skipped:
            continue
        faster = 1 + (machine.clock_ppm + machine.bend_ppm * cycle / cycles) / 1e6
        us, way_us = cycle * machine.period_us * faster + late_us, line_us
        frames = machine.frames(cycle)
        polls = (((FPRD, 0, machine.poll_bytes),),) * random.randint(0, machine.polls)
        for place, datagrams in enumerate((*frames, *polls)):
            start_us, us = us, us + wire_us([size for *_, size in datagrams])
            way_us += sum(size for command, _, size in datagrams if command in (LRD, LWR, LRW)) * COPY_US
            yield Trip(cycle, datagrams, start_us, us + way_us + host_us, is_poll=place >= len(frames))


def ethernet(
    datagrams: Datagrams,
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


class Packet(NamedTuple):
    """A packet of a capture."""

    us: float
    content: bytes
    trip: Trip
    returned: bool


def simulated(machine: Machine, cycles: int, *, seed: int = 1) -> list[tuple[float, bytes]]:
    """Stamps [us] and packets of a number of cycles, in the order of time."""
    return [packet[:2] for packet in packets_of(machine, cycles, seed=seed)]


def packets_of(machine: Machine, cycles: int, *, seed: int) -> list[Packet]:
    """Packets of a number of cycles, in the order of time."""
    packets = []
    for trip in trips(machine, cycles, seed=seed):
        index = trip.cycle % 256 if machine.has_index else 0
        counters = (machine.counters if not trip.is_poll else ()) or (3,) * len(trip.datagrams)
        packets.append(Packet(trip.us, ethernet(trip.datagrams, index=index, counters=counters), trip, returned=False))
        if trip.cycle not in machine.lost:
            counters = (0,) * len(counters) if trip.cycle in machine.wrong else counters
            back = ethernet(trip.datagrams, index=index, counters=counters, returned=True)
            # A program that copies frames stamps them as fast as it reads them, whatever their length.
            back_us = trip.back_us if machine.at_port else trip.us + 2 + trip.back_us % 3
            packets.append(Packet(back_us, back, trip, returned=True))
    return sorted(packets, key=lambda packet: packet.us)


def in_capture(machine: Machine, cycles: int, *, seed: int) -> list[Packet]:
    """Packets of a capture that drops none, from anywhere in the second cycle on."""
    start_us = machine.period_us * (1 + Random(-seed).random())
    return [packet for packet in packets_of(machine, cycles + 2, seed=seed) if packet.us >= start_us]


def recorded(machine: Machine, cycles: int, *, seed: int = 1) -> tuple[bytes, dict[str, float]]:
    """A capture of a machine, which begins anywhere in its second cycle, and the truth of it."""
    random = Random(-seed)
    start_us = machine.period_us * (1 + random.random())
    packets = [packet[:2] for packet in in_capture(machine, cycles, seed=seed)]
    for _ in range(machine.dropped or 0):
        packets.pop(random.randrange(len(packets)))
    kind, step = machine.form.split()
    order, start_s = random.choice("<>"), random.randrange(1_500_000_000, 1_800_000_000)
    if kind == "pcap":
        content = pcap(packets, order=order, nano=step == "ns", start_s=start_s)
    else:
        resolution = 9 if step == "ns" else random.choice((6, None))
        content = pcapng(packets, order=order, resolution=resolution, start_s=start_s)
        content += b"" if machine.dropped is None else statistics(5, machine.dropped, order=order)
    return content, truth(machine, cycles + 2, start_us, seed=seed)


def truth(machine: Machine, cycles: int, start_us: float, *, seed: int) -> dict[str, float]:
    """What a capture has in truth, by the emulator's own words: times in us, bytes, counts.

    Round trip, frames and bytes are those of the fullest cycle, and of each sort of cycle by its name.
    """
    sent = [trip for trip in trips(machine, cycles, seed=seed) if trip.us >= start_us]
    begun: dict[int, list[Trip]] = defaultdict(list)
    for trip in sent:
        if not trip.is_poll:
            begun[trip.cycle].append(trip)
    by_cycle = {
        cycle: begun_trips for cycle, begun_trips in begun.items() if len(begun_trips) == len(machine.frames(cycle))
    }
    sorts: dict[str, dict[int, list[Trip]]] = defaultdict(dict)
    for cycle in by_cycle.keys() - machine.lost:
        sorts[machine.names[cycle % len(machine.names)]][cycle] = by_cycle[cycle]
    late_us, host_us = zip(*starts_and_hosts(machine, cycles, seed=seed), strict=True)
    due = [cycle for cycle in range(min(by_cycle), max(by_cycle) + 1) if machine.frames(cycle)]
    truth: dict[str, float] = {
        "period": machine.period_us * (1 + (machine.clock_ppm + machine.bend_ppm) / 1e6),
        "latest start": max(late_us[cycle] for cycle in by_cycle) - min(late_us[cycle] for cycle in by_cycle),
        "lost": sum(trip.cycle in machine.lost for trip in sent),
        "wrong": sum(trip.cycle in machine.wrong for trip in sent),
        "without a frame": len(due) - len(by_cycle),
    }
    fullest = max(sorts.values(), key=lambda of_sort: sum(map(_wire_us, next(iter(of_sort.values())))))
    for name, of_sort in (*sorts.items(), ("", fullest)):
        frames = next(iter(of_sort.values()))
        truth[f"frames in a cycle{name}"] = len(frames)
        truth[f"datagrams of a cycle{name}"] = sum(size + 12 for trip in frames for size in _sizes(trip))
        truth[f"round trip{name}"] = max(trip[-1].back_us - trip[0].us for trip in of_sort.values())
    truth["master, least"] = max(host_us[cycle] for cycle in fullest)
    truth["master, most"] = max(host_us[cycle] for of_sort in sorts.values() for cycle in of_sort)
    return truth


def _sizes(trip: Trip) -> list[int]:
    return [size for *_, size in trip.datagrams]


def _wire_us(trip: Trip) -> float:
    return wire_us(_sizes(trip))


# --- the machine of a plan ----------------------------------------------------------------------------------

DELAYS_US: Final = {"100BASE-TX": HOP_US, "E-bus": 0.1507}
FORMS: Final = ("pcapng ns", "pcapng us", "pcap ns", "pcap us")


def housekeeping(bus: dict[str, Any], devices: int) -> Datagrams:
    """Datagrams that a master adds to the first frame."""
    if "housekeeping_bytes" in bus:
        return tuple((BRD, 0x130, size) for size in bus["housekeeping_bytes"])
    master = bus.get("master", "")
    added: dict[str, Datagrams] = {
        "SOEM": (),
        "IgH": ((BRD, 0x130, 2),),
        "TwinCAT": ((NOP, 0, 4), (BRD, 0x130, 2), (LRD, 0x9000000, 1)),
        "ethercrab": tuple((FPRD, 0x1300000 + device, 2) for device in range(devices)),
    }
    as_acontis: Datagrams = ((NOP, 0, 4), (APWR, 0, 4), (BRD, 0x130, 2))
    clocks = ((FRMW, 0x910, 8 if master in ("SOEM", "ethercrab") else 4),) if bus.get("distributed_clocks") else ()
    return (*added.get(master, as_acontis), *clocks)


def bytes_of(group: dict[str, Any], way: str) -> int:
    """Payload of a device in one direction."""
    return int(group.get(f"{way}_bytes", 0) + group.get(f"{way}_bytes_per_axis", 0) * group["axes"])


def first_cycles(groups: list[dict[str, Any]], sizes: list[int], *, is_spread: bool) -> list[int]:
    """First cycle of each group: the faster first, of one rate the larger, where the fullest of its cycles is least."""
    starts, filled = [0] * len(groups), [0] * lcm(*(group["every"] for group in groups))
    for place in sorted(range(len(groups)), key=lambda place: (groups[place]["every"], -sizes[place])):
        every = groups[place]["every"]
        if is_spread:
            starts[place] = min(range(every), key=lambda start: max(filled[start::every]))
        for cycle in range(starts[place], len(filled), every):
            filled[cycle] += sizes[place]
    return starts


def schedule_of(plan: dict[str, Any]) -> Iterator[tuple[str, tuple[Datagrams, ...]]]:
    """Names and frames of each cycle in turn: devices in their order, a new frame where the next has no room."""
    bus, groups = plan["bus"], groups_of(plan)
    is_shared = bus.get("master") in ("TwinCAT", "acontis")
    layout = bus.get("process_data", "LRW-shared" if is_shared else "LRW-separate")
    both = [(bytes_of(group, "read"), bytes_of(group, "write")) for group in groups]
    sizes = [max(pair) if layout == "LRW-shared" else sum(pair) for pair in both]
    totals = [size * group["nodes"] for size, group in zip(sizes, groups, strict=True)]
    first = first_cycles(groups, totals, is_spread=bus.get("units", "spread") == "spread")
    units = list(zip(groups, first, both, sizes, accumulate(totals, initial=0x10000), strict=False))
    added = housekeeping(bus, sum(group["nodes"] for group in groups))
    most = MOST_BYTES - (24 if layout == "LRD-LWR" else 12)
    cycles = lcm(*(group["every"] for group in groups))
    for cycle in range(cycles):
        due = [unit for unit in units if (cycle - unit[1]) % unit[0]["every"] == 0]
        packed: list[list[tuple[int, int, int]]] = [[]]
        room = most - sum(size + 12 for *_, size in added)
        for group, _, (read, write), size, address in due:
            for device in range(group["nodes"] if size else 0):
                if size > room:
                    packed.append([])
                    room = most
                packed[-1].append((read, write, address + device * size))
                room -= size
        frames = [(*(() if place else added), *_process(devices, layout)) for place, devices in enumerate(packed)]
        names = f" with {' and '.join(own[0]['name'] for own in due) or 'no group'}" if cycles > 1 else ""
        yield names, tuple(filter(None, frames))


def _process(devices: list[tuple[int, int, int]], layout: str) -> Datagrams:
    """Datagrams of the process data of some devices: what each is read and written, and its logical address."""
    if not devices:
        return ()
    address = devices[0][2]
    if layout == "LRD-LWR":
        reads, writes = sum(read for read, *_ in devices), sum(write for _, write, _ in devices)
        return (LRD, address, reads), (LWR, address + 0x800000, writes)
    return ((LRW, address, sum(max(pair) if layout == "LRW-shared" else sum(pair) for *pair, _ in devices)),)


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
        line_us += 2 * group["nodes"] * (delay_us + group.get("cable_length_m", 0) * CABLE_US)
    host_us, jitter_us = bus.get("master_us", 0.0), bus.get("master_jitter_us", 0.0)
    least = random.uniform(0.4, 0.95)
    cycles = list(schedule_of(plan))
    turn = random.randrange(len(cycles))
    names, schedule = zip(*cycles[turn:], *cycles[:turn], strict=True)
    return Machine(
        period_us=plan["cycle"]["period_us"],
        jitter_us=jitter_us * random.choice((1.0, random.uniform(0.2, 1))),
        shape=random.choice(("uniform", "normal")),
        clock_ppm=random.uniform(-40, 40),
        bend_ppm=random.choice((0.0, random.uniform(-10, 10))),
        host_us=host_us * least,
        host_spread_us=host_us * (1 - least) * random.choice((1.0, random.random())),
        schedule=schedule,
        names=names,
        counters=(),
        has_index=random.random() < 0.8,
        line_us=line_us,
        polls=bus.get("mailbox_polls", 0),
        poll_bytes=bus.get("mailbox_bytes", 128),
        form=random.choice(FORMS),
        dropped=random.choice((None, 0)),
    )


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


def statistics(code: int, dropped: int, *, order: str = "<") -> bytes:
    """An interface statistics block of pcapng: packets that the interface (5) or the system (7) dropped."""
    size = 24 + 12 + 4
    return struct.pack(f"{order}IIIIIHHQHHI", 5, size, 0, 0, 0, code, 8, dropped, 0, 0, size)


def pcapng(
    packets: list[tuple[float, bytes]],
    *,
    order: str = "<",
    resolution: int | None = 9,
    start_s: int = 1_700_000_000,
    dropped_before: Mapping[int, int] = MappingProxyType({}),
) -> bytes:
    """A pcapng file of an interface with a resolution of its stamps, 10^-n s; None for the default, 1 us.

    dropped_before: packets that the recorder says it dropped, by the number of the packet behind them.
    """
    options = b"" if resolution is None else struct.pack(f"{order}HHB3xHH", 9, 1, resolution, 0, 0)
    written = struct.pack(f"{order}IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    size = 20 + len(options)
    written += struct.pack(f"{order}IIHHI", 1, size, 1, 0, 65535) + options + struct.pack(f"{order}I", size)
    parts = [written]
    for number, (time_us, packet) in enumerate(packets):
        time_ns = start_s * 10**9 + round(time_us * 1000)
        ticks = time_ns * 10 ** (6 if resolution is None else resolution) // 10**9
        filled = packet + bytes(-len(packet) % 4)
        if number in dropped_before:
            filled += struct.pack(f"{order}HHQHH", 4, 8, dropped_before[number], 0, 0)
        size = 32 + len(filled)
        head = struct.pack(f"{order}IIIIIII", 6, size, 0, ticks >> 32, ticks & 0xFFFFFFFF, len(packet), len(packet))
        parts.append(head + filled + struct.pack(f"{order}I", size))
    return b"".join(parts)
