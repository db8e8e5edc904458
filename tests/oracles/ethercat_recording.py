"""Captures of an EtherCAT master's port, simulated event by event with known truth, and written bit for bit.

A frame starts when the master's task is done, and its stamp is taken there; it returns when its bytes have been sent
and have passed all devices and back, and the host has taken the rest of its time.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from random import Random
from types import MappingProxyType
from typing import Literal

MASTER = bytes.fromhex("001122334455")
BYTE_US = 0.08
COPY_US = 0.0035
HOP_US = 0.698
LRW, BRD, FRMW, FPRD, APRD, BWR = 12, 7, 14, 4, 1, 8
Datagrams = tuple[tuple[int, int, int], ...]
"""Command, address and data bytes of each."""


@dataclass
class Machine:
    """What the machine does."""

    period_us: float = 1000.0
    jitter_us: float = 20.0
    """Start of a frame behind the planned one, evenly 0..jitter, or of another shape with a spread of about that."""
    shape: Literal["uniform", "normal", "exponential"] = "uniform"
    clock_ppm: float = 0.0
    """How much faster the recorder's clock runs."""
    host_us: float = 30.0
    host_spread_us: float = 10.0
    """The host takes host_us, and evenly 0..spread more."""
    devices: int = 4
    datagrams: Datagrams = ((LRW, 0x10000, 80), (FRMW, 0, 8))
    schedule: tuple[tuple[Datagrams, ...], ...] = ()
    """Frames of each cycle, over and over; without it one of `datagrams`."""
    counters: tuple[int, ...] = (12, 4)
    """Working counters of the datagrams; empty for 3 in each."""
    lost: frozenset[int] = frozenset()
    wrong: frozenset[int] = frozenset()
    skipped: frozenset[int] = frozenset()
    """Cycles in which the master sends nothing."""
    late: dict[int, float] = field(default_factory=dict)
    """Starts that are so much later [us]."""
    has_index: bool = True
    hop_us: float = HOP_US


def wire_us(data_bytes: tuple[int, ...]) -> float:
    """A frame on the wire, gap included [us]."""
    return float(max(8 + 14 + 2 + sum(size + 12 for size in data_bytes) + 4 + 12, 84) * BYTE_US)


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


def starts_and_hosts(machine: Machine, cycles: int, *, seed: int = 1) -> list[tuple[float, float]]:
    """How late each cycle starts, and what the host takes in it [us]."""
    random = Random(seed)
    shapes = {
        "uniform": lambda: random.uniform(0, machine.jitter_us),
        "normal": lambda: max(random.gauss(machine.jitter_us / 2, machine.jitter_us / 8), 0.0),
        "exponential": lambda: random.expovariate(6 / machine.jitter_us),
    }
    return [
        (
            shapes[machine.shape]() + machine.late.get(cycle, 0.0),
            machine.host_us + random.uniform(0, machine.host_spread_us),
        )
        for cycle in range(cycles)
    ]


def simulated(machine: Machine, cycles: int, *, seed: int = 1) -> list[tuple[float, bytes]]:
    """Stamps [us] and packets of a number of cycles, in the order of time.

    Frames of a cycle are sent one behind the other; each returns when it has passed all devices.
    """
    schedule = machine.schedule or ((machine.datagrams,),)
    packets = []
    for cycle, (late, host) in enumerate(starts_and_hosts(machine, cycles, seed=seed)):
        if cycle in machine.skipped:
            continue
        start = cycle * machine.period_us + late
        index = cycle % 256 if machine.has_index else 0
        way = 2 * machine.devices * machine.hop_us
        for datagrams in schedule[cycle % len(schedule)]:
            counters = machine.counters or (3,) * len(datagrams)
            packets.append((start, ethernet(datagrams, index=index, counters=counters)))
            sizes = tuple(size for *_, size in datagrams)
            start += wire_us(sizes)
            way += sum(size for command, _, size in datagrams if command in (10, 11, 12)) * COPY_US
            if cycle not in machine.lost:
                counted = (0,) * len(sizes) if cycle in machine.wrong else counters
                packets.append((start + way + host, ethernet(datagrams, index=index, counters=counted, returned=True)))
    faster = 1 + machine.clock_ppm / 1e6
    return sorted(((time * faster, packet) for time, packet in packets), key=lambda packet: packet[0])


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
