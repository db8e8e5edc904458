"""Logs of a CAN bus, simulated frame by frame: the queued frame of the smallest identifier goes when the bus is free.

It imports nothing of busplan; the bits of each frame are written one by one.
"""

import importlib.util
from heapq import heapify, heappop, heappush
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

_spec = importlib.util.spec_from_file_location(
    "frames_bit_by_bit", Path(__file__).parents[1] / "buses" / "can" / "test_frames.py"
)
assert _spec is not None
assert _spec.loader is not None
_frames: Any = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_frames)


class Queued(NamedTuple):
    """A frame, and when it is queued."""

    us: float
    identifier: int
    data: bytes
    extended: bool = False
    fd: bool = False


class Logged(NamedTuple):
    """A frame in a log, stamped at its end, without the interframe space."""

    us: float
    identifier: int
    data: bytes
    extended: bool
    bits: int
    fd: bool = False


def bits_of(frame: Queued | Logged) -> int:
    """Length of a frame, interframe space included; of CAN FD without stuff bits, with data at four times the rate."""
    if frame.fd:
        size = len(frame.data)
        return (48 if frame.extended else 29) + (5 + 8 * size + (28 if size <= 16 else 33)) // 4
    bits: int = _frames.written_bits(frame.identifier, frame.data, identifier_bits=29 if frame.extended else 11)
    return bits


def arbitrated(queued: list[Queued], *, bit_us: float = 1.0) -> list[Logged]:
    """All frames in the order in which the bus takes them."""
    waiting: list[tuple[int, int, Queued]] = []
    left = sorted(queued)[::-1]
    logged, now_us = [], 0.0
    while left or waiting:
        if not waiting:
            now_us = max(now_us, left[-1].us)
        while left and left[-1].us <= now_us:
            frame = left.pop()
            place = (frame.identifier << 18, 0) if not frame.extended else (frame.identifier, 1)
            heappush(waiting, (place[0] * 2 + place[1], len(left), frame))
        frame = heappop(waiting)[2]
        bits = bits_of(frame)
        now_us += bits * bit_us
        logged.append(Logged(now_us - 3 * bit_us, frame.identifier, frame.data, frame.extended, bits, frame.fd))
    return logged


def servo_8(cycles: int, *, seed: int = 1, sync_jitter_us: float = 0.0) -> list[Queued]:
    """What the machine of can-servo-8 queues, within its plan."""
    random = Random(seed)
    queued: list[Queued] = []
    for cycle in range(cycles):
        start = cycle * 4000.0 + random.uniform(0, sync_jitter_us)
        queued.append(Queued(start, 0x80, b""))
        for node in range(8):
            ready = start + 47 + random.uniform(100, 200)
            queued.append(Queued(ready, 0x181 + node, random.randbytes(8)))
            queued.append(Queued(start + 1500 + random.uniform(0, 20), 0x201 + node, random.randbytes(8)))
    span = cycles * 4000.0
    heartbeat = random.uniform(0, 50_000)
    while heartbeat < span:
        queued.append(Queued(heartbeat, 0x708, b"\x05"))
        heartbeat += 50_000
    request = 5_000.0
    while request < span:
        queued.append(Queued(request + random.uniform(0, 1000), 0x601, random.randbytes(8)))
        queued.append(Queued(request + 3000 + random.uniform(0, 1000), 0x581, random.randbytes(8)))
        request += 20_000 + random.choice((0, 0, 15_000, 40_000))
    heapify(queued)
    return queued


def candump(logged: list[Logged], *, start_s: float = 1_700_000_000, channel: str = "can0") -> str:
    """A log of `candump -l`."""
    lines = []
    for frame in logged:
        time_us = round(start_s * 10**6 + frame.us)
        name = f"{frame.identifier:08X}" if frame.extended else f"{frame.identifier:03X}"
        lines.append(
            f"({time_us // 10**6}.{time_us % 10**6:06d}) {channel} {name}#{'#1' * frame.fd}{frame.data.hex().upper()}\n"
        )
    return "".join(lines)
