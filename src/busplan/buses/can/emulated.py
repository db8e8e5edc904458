"""Log of a planned CAN machine: its frames by their arbitration, with the stuff bits of random data."""

from collections.abc import Iterator
from dataclasses import replace
from heapq import heapify, heappop, heappush
from typing import Final, NamedTuple

import numpy as np

from busplan.buses.can.equations import BASE_BITS, FD_LENGTHS, bit_us, c
from busplan.buses.can.streams import Stream, place, streams
from busplan.buses.can.traffic import SYNC, traffic_of
from busplan.buses.emulation import LEAST_SHARE, Emulation, Emulator, Fault
from busplan.buses.network import Network
from busplan.errors import ArgumentError, BusplanError
from busplan.recordings.can import written_bits
from busplan.recordings.written import candump

_ERROR: Final = "20000088#0000000000000000"
"""An error frame as candump writes it."""
_COUNTED: Final = 240
"""Last number of SYNC's counter, which runs from 1 (CiA 301)."""
_PAYLOADS: Final = 16
"""Payloads of a sender that differ."""

MISSING: Final = Fault("missing-cycle", "the host sends no SYNC", "cycles without SYNC")
SILENT: Final = Fault("missing-pdo", "a node sends no feedback", "PDOs missing")
TWICE: Final = Fault("double-pdo", "a node sends its feedback twice", "PDOs twice")
LATE: Final = Fault("late-command", "the host sends its commands late", "last PDO after SYNC", "us", 1.0)
JITTER: Final = Fault("jitter", "the host sends SYNC late", "SYNC: jitter of the arrival", "us", 0.5)
ERRORS: Final = Fault("error-frame", "a frame is destroyed and sent again", "error frames")
FAULTS: Final = (MISSING, SILENT, TWICE, LATE, JITTER, ERRORS)


class _Sender(NamedTuple):
    """Frames of an identifier."""

    stream: Stream
    """Stream of the identifier."""
    order: int
    """Place in the arbitration."""
    frames: list[tuple[str, float]]
    """Frames as candump writes them, each with its time on the wire [us]."""


_Queued = tuple[float, int, _Sender, int]
"""Time at which a frame is queued [us], a running number, its sender, and its cycle, or its place in its message."""


def emulated(network: Network, emulation: Emulation) -> bytes:
    """Emulate the log of a machine that keeps its plan, but for the faults.

    Nodes queue their feedback T_exec behind SYNC, and up to the slowest extra time later; the host queues all commands
    behind the last feedback and half to all of its time. SYNC comes evenly within its jitter. Messages come each by its
    period and evenly within its jitter, a burst at once. Data are random. Stamps count from 0.

    Too many frames, and a fault of a cycle in a network of messages alone, raise a BusplanError.
    """
    return candump(_Machine(network, emulation).sent())


class _Machine:
    """Host and nodes with the frames that they queue."""

    def __init__(self, network: Network, emulation: Emulation) -> None:
        self.network, self.emulation, self.random = network, emulation, emulation.random
        self.traffic, self.period_us = traffic_of(network), _period_us(network)
        if self.traffic.has_cycle and not self.traffic.has_sync:
            raise BusplanError(f'a log with SYNC is emulated, and bus.access = "{self.traffic.access}" has none')
        self.end_us = emulation.cycles * self.period_us
        if not self.traffic.has_cycle and (others := emulation.faults.keys() - {ERRORS.name}):
            raise ArgumentError(f"fault {min(others)}: a network of messages alone has no SYNC and no PDOs")
        sent, unstuffed = streams(self.traffic), streams(replace(self.traffic, is_stuffed=False))
        emulation.require_few(sum(stream.identifiers * self.end_us / stream.period_us for stream in sent))
        self.senders = [sender for pair in zip(sent, unstuffed, strict=True) for sender in self._senders(*pair)]
        # After the last frame of a sender nobody knows whether one is missing.
        cycles = range(emulation.cycles - int(max((pdos.every for pdos in self.traffic.pdos), default=1)))
        due = {name: [cycle for cycle in cycles if self._due(name, cycle)] for name in ("feedback", "command")}
        among = {SILENT: due["feedback"], TWICE: due["feedback"], LATE: due["command"]}
        self.hit = {fault: emulation.drawn(fault, among.get(fault, cycles)) for fault in FAULTS}
        self.left: dict[int, int] = {}
        """Feedback frames that have not arrived, by cycle."""
        self.queued = 0
        """Frames queued so far."""

    def _senders(self, stream: Stream, unstuffed: Stream) -> Iterator[_Sender]:
        """Senders of a stream, which is also given without stuff bits: one an identifier, with random data."""
        bus, is_extended = self.network.profile.bus, stream.identifier_bits > BASE_BITS
        message = next((part for part in self.network.profile.message if part.name == stream.name), None)
        is_fd = message.fd if message else bus.data_bit_rate_kbit_s is not None
        mark = f"##{int(message.brs if message else True)}" if is_fd else "#"
        size = next(length for length in FD_LENGTHS if length >= stream.data_bytes) if is_fd else stream.data_bytes
        for identifier in range(int(stream.first), int(stream.last) + 1):
            data = [self.random.randbytes(int(size)) for _ in range(_PAYLOADS)]
            if stream.name == SYNC and stream.data_bytes:
                data = [bytes([number + 1]).ljust(int(size), b"\0") for number in range(_COUNTED)]
            # Of CAN FD half of the possible stuff bits.
            wires_us = [(stream.frame_us + unstuffed.frame_us) / 2] * len(data)
            if not is_fd:
                flags = np.full(len(data), is_extended), np.zeros(len(data), dtype=np.bool_), np.full(len(data), size)
                first = [int.from_bytes(part.ljust(int(c.FRAME_BYTES), b"\0"), "big") for part in data]
                bits = written_bits(np.full(len(data), identifier), *flags, np.array(first, dtype=np.uint64))
                wires_us = (bits * bit_us(self.traffic.bit_rate_kbit_s)).tolist()
            name = f"{identifier:0{8 if is_extended else 3}X}{mark}"
            frames = [f"{name}{part.hex().upper()}" for part in data]
            yield _Sender(stream, place(identifier, stream.identifier_bits), list(zip(frames, wires_us, strict=True)))

    def _due(self, name: str, cycle: int) -> list[_Sender]:
        """Senders of SYNC, feedback or commands that a cycle has."""
        return [
            sender
            for sender in self.senders
            if sender.stream.name == name and not cycle % round(sender.stream.period_us / self.period_us)
        ]

    def _at(self, us: float, sender: _Sender, number: int) -> _Queued:
        self.queued += 1
        return us, self.queued, sender, number

    def _alone(self) -> Iterator[_Queued]:
        """SYNCs and messages, which wait for no other frame."""
        late_us, own_us = self.emulation.faults.get(JITTER.name, 0.0), self.traffic.sync_jitter_us
        for sender in self.senders:
            stream = sender.stream
            if stream.name == SYNC:
                for cycle in sorted(set(range(self.emulation.cycles)) - self.hit[MISSING]):
                    queued_us = cycle * self.period_us + late_us * (cycle in self.hit[JITTER])
                    if own_us:
                        queued_us += self.random.uniform(0, own_us)
                    yield self._at(queued_us, sender, cycle)
            if stream.is_message:
                due_us = self.random.uniform(0, stream.period_us * stream.burst)
                while due_us < self.end_us:
                    queued_us = due_us + self.random.uniform(0, stream.jitter_us)
                    yield from (self._at(queued_us, sender, number) for number in range(int(stream.burst)))
                    due_us += stream.period_us * stream.burst

    def _answers(self, sender: _Sender, cycle: int, now_us: float) -> Iterator[_Queued]:
        """Frames that nodes queue when SYNC has arrived, and the host when the last feedback has."""
        if sender.stream.name == SYNC:
            feedback = self._due("feedback", cycle)
            # The first node is silent, or sends twice.
            feedback = feedback[:1] * (cycle in self.hit[TWICE]) + feedback[cycle in self.hit[SILENT] :]
            self.left[cycle] = len(feedback)
            for answer in feedback:
                group = next(group for group in self.network.groups if group.name == answer.stream.group)
                extra_us = self.random.uniform(0, group.worst_extra_us)
                yield self._at(now_us + group.read_execution_us + extra_us, answer, cycle)
        elif sender.stream.name == "feedback":
            self.left[cycle] -= 1
        else:
            return
        if not self.left[cycle]:
            now_us += self.random.uniform(LEAST_SHARE, 1) * self.traffic.host_us
            late_us = self.emulation.faults.get(LATE.name, 0.0) * (cycle in self.hit[LATE])
            yield from (self._at(now_us + late_us, command, cycle) for command in self._due("command", cycle))

    def sent(self) -> Iterator[tuple[int, str]]:
        """Stamp of each frame at its end [us], and the frame: of those that wait the one of the first priority goes."""
        coming, waiting = list(self._alone()), list[tuple[int, int, _Sender, int]]()
        heapify(coming)
        errors = sorted(self.hit[ERRORS])
        now_us = 0.0
        while coming or waiting:
            now_us = now_us if waiting else max(now_us, coming[0][0])
            while coming and coming[0][0] <= now_us:
                _, running, sender, number = heappop(coming)
                heappush(waiting, (sender.order, running, sender, number))
            _, running, sender, number = heappop(waiting)
            is_counter = sender.stream.name == SYNC
            frame, wire_us = (
                sender.frames[number % len(sender.frames)] if is_counter else self.random.choice(sender.frames)
            )
            is_destroyed = bool(errors) and errors[0] * self.period_us <= now_us
            if is_destroyed:
                del errors[0]
                frame, wire_us = _ERROR, wire_us / 2 + (c.ERROR_BITS * bit_us(self.traffic.bit_rate_kbit_s))
                heappush(waiting, (sender.order, running, sender, number))
            now_us += wire_us
            if now_us >= self.end_us:
                return
            yield int(now_us), frame
            for answer in () if is_destroyed else self._answers(sender, number, now_us):
                heappush(coming, answer)


def _period_us(network: Network) -> float:
    traffic = traffic_of(network)
    return traffic.period_us if traffic.has_cycle else min(message.period_us for message in traffic.messages)


EMULATOR: Final = Emulator(FAULTS, (".log", ".candump"), _period_us, emulated)
