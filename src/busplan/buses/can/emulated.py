"""Log of a planned CAN machine: its frames by their arbitration, with the stuff bits of random data."""

from collections.abc import Iterator
from dataclasses import replace
from heapq import heapify, heappop, heappush
from typing import Any, Final, NamedTuple

import numpy as np

from busplan.buses.can.equations import BASE_BITS, FD_LENGTHS, bit_us, c
from busplan.buses.can.streams import Stream, place, streams
from busplan.buses.can.traffic import HOST, NODE, NOT_BY_PRIORITY, SYNC, traffic_of
from busplan.buses.emulation import LEAST_SHARE, Emulation, Emulator, Fault
from busplan.buses.network import Group, Network
from busplan.errors import ArgumentError
from busplan.recordings.can_bits import written_bits
from busplan.recordings.written import candump

_ERROR: Final = "20000088#0000000000000000"
"""An error frame as candump writes it."""
_COUNTED: Final = 240
"""Last number of SYNC's counter, which runs from 1 (CiA 301)."""
_FIFO: Final = NOT_BY_PRIORITY[0]
_PAYLOADS: Final = 16
"""Payloads of a sender that differ."""

MISSING: Final = Fault("missing-cycle", "the host sends no SYNC", "cycles without SYNC")
SILENT: Final = Fault("missing-pdo", "a node sends no feedback", "PDOs missing")
TWICE: Final = Fault("double-pdo", "a node sends its feedback twice", "PDOs twice")
LATE: Final = Fault("late-command", "the host sends its commands late", "last PDO after SYNC", "us", 1.0)
JITTER: Final = Fault("jitter", "the host sends SYNC late", "SYNC: jitter of the arrival", "us", 0.5)
ERRORS: Final = Fault("error-frame", "a frame is destroyed and sent again", "error frames")
LOST: Final = Fault("lost-answer", "a node does not answer a request", "answers missing")
DOUBLE: Final = Fault("double-answer", "a node answers a request twice", "answers twice")
SLOW_NODE: Final = Fault("slow-node", "a node answers late", "request to answer", "us", 0.3)
SLOW_HOST: Final = Fault("slow-host", "the host sends its next request late", "next request of the host", "us", 0.3)
_OF_SYNC: Final = (MISSING, SILENT, TWICE, LATE, JITTER)
_OF_REQUESTS: Final = (LOST, DOUBLE, SLOW_NODE, SLOW_HOST)
FAULTS: Final = (*_OF_SYNC, *_OF_REQUESTS, ERRORS)
_PATIENCE: Final = 2
"""Planned times of an answer after which a host goes on without it."""


class _Sender(NamedTuple):
    """Frames of an identifier."""

    stream: Stream
    """Stream of the identifier."""
    order: int
    """Place in the arbitration."""
    frames: list[tuple[str, float]]
    """Frames as candump writes them, each with its time on the wire [us]."""
    queue: str = ""
    """Name of the queue that it shares with others, where that is not by priority."""


class _Node(NamedTuple):
    """A node that answers requests."""

    group: Group
    requests: tuple[_Sender, ...]
    """Frames of its request, in their order."""
    answers: tuple[_Sender, ...]

    @property
    def answers_us(self) -> float:
        """Planned time from its request to its queued answer [us]."""
        us: float = max(self.group.read_execution_us, self.group.write_execution_us)
        return us


_Queued = tuple[float, int, _Sender, int]
"""Time at which a frame is queued [us], a running number, its sender, and its cycle, or its place in its message."""


def emulated(network: Network, emulation: Emulation) -> bytes:
    """Emulate the log of a machine that keeps its plan, but for the faults.

    With SYNC nodes queue their feedback T_exec behind SYNC, and up to the slowest extra time later; the host queues all
    commands behind the last feedback, its adapter's time, and half to all of its own. SYNC comes evenly within its
    jitter. Without SYNC the host queues each request likewise behind the answer before, or, of all at once, behind the
    request before without the adapter; a node queues its answer T_exec behind its request, and up to the slowest extra
    time later. Messages come each by its period and evenly within its jitter, a burst at once. Of a queue that is not
    by priority one frame is in the arbitration: the first one queued, or of a single buffer the one of the smallest
    identifier when it became free. Data are random. Stamps count from 0.

    Too many frames, and a fault that the plan has no place for, raise a BusplanError.
    """
    traffic = traffic_of(network)
    sort = _Requests if traffic.has_cycle and not traffic.has_sync else _Machine
    return candump(sort(network, emulation).sent())


class _Machine:
    """Host and nodes with the frames that they queue."""

    def __init__(self, network: Network, emulation: Emulation) -> None:
        self.network, self.emulation, self.random = network, emulation, emulation.random
        self.traffic, self.period_us = traffic_of(network), _period_us(network)
        self.end_us = emulation.cycles * self.period_us
        self._require_place()
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
        self.pending: dict[str, list[tuple[int, int, _Sender, int]]] = {}
        """Frames of each queue that is not by priority, the one in the arbitration first."""

    def _require_place(self) -> None:
        """Raise BusplanError for a fault that the plan has no place for."""
        traffic, bus = self.traffic, self.network.profile.bus
        none = "a network of messages alone has no SYNC and no PDOs"
        known: tuple[Fault, ...] = ()
        if traffic.has_sync:
            none, known = "with SYNC nodes answer no requests", _OF_SYNC
        elif traffic.has_cycle:
            none, known = f'bus.access = "{bus.access}" has no SYNC', _OF_REQUESTS
        others = [name for name in self.emulation.faults if name not in {fault.name for fault in (*known, ERRORS)}]
        if others:
            raise ArgumentError(f"fault {min(others)}: {none}")

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
            order, taken = place(identifier, stream.identifier_bits), list(zip(frames, wires_us, strict=True))
            yield _Sender(stream, order, taken, self._queue(stream, message, identifier - int(stream.first)))

    def _queue(self, stream: Stream, message: Any, number: int) -> str:
        """Name of the queue of a sender, by its place in its stream; empty where all that it sends goes by priority."""
        profile, sender = self.network.profile, HOST
        members = [member for member in profile.node_groups for _ in range(member.nodes)]
        if message:
            if message.sender is None and not message.per_node:
                return ""
            sender = message.sender or ""
            first = next((place for place, member in enumerate(members) if (member.name or NODE) == sender), -1)
            at = number if message.per_node else first
        elif stream.name == "feedback":
            group = next(group for group in self.network.groups if group.name == stream.group)
            places = [place for place, member in enumerate(members) if member in group.members]
            at = places[number * len(places) // int(stream.identifiers)]
        else:
            at = -1
        node = members[at].node if at >= 0 else None
        order = (node.queue if node is not None else None) or profile.bus.queue
        return f"{at if node is not None else sender} {order}" if order in NOT_BY_PRIORITY else ""

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
            now_us += self.random.uniform(LEAST_SHARE, 1) * self.traffic.host_us + self.traffic.adapter_us
            late_us = self.emulation.faults.get(LATE.name, 0.0) * (cycle in self.hit[LATE])
            yield from (self._at(now_us + late_us, command, cycle) for command in self._due("command", cycle))

    def _offer(self, waiting: list[tuple[int, int, _Sender, int]], queued: tuple[int, int, _Sender, int]) -> None:
        """Put a frame into the arbitration, or into its queue behind the one that is there."""
        queue = queued[2].queue
        held = self.pending.setdefault(queue, []) if queue else []
        held.append(queued)
        if not queue or len(held) == 1:
            heappush(waiting, queued)

    def _next_of(self, waiting: list[tuple[int, int, _Sender, int]], queue: str) -> None:
        """Put the next frame of a queue, whose first one has been sent, into the arbitration."""
        held = self.pending[queue]
        del held[0]
        if held:
            chosen = 0 if queue.endswith(_FIFO) else held.index(min(held, key=lambda queued: queued[:2]))
            held.insert(0, held.pop(chosen))
            heappush(waiting, held[0])

    def sent(self) -> Iterator[tuple[int, str]]:
        """Stamp of each frame at its end [us], and the frame: of those that wait the one of the first priority goes."""
        coming, waiting = list(self._alone()), list[tuple[int, int, _Sender, int]]()
        heapify(coming)
        errors = sorted(self.hit[ERRORS])
        now_us, free = 0.0, ""
        while coming or waiting or free:
            now_us = now_us if waiting or free else max(now_us, coming[0][0])
            while coming and coming[0][0] <= now_us:
                _, running, sender, number = heappop(coming)
                self._offer(waiting, (sender.order, running, sender, number))
            if free:
                self._next_of(waiting, free)
                free = ""
                continue
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
            else:
                free = sender.queue
            now_us += wire_us
            if now_us >= self.end_us:
                return
            yield int(now_us), frame
            for answer in () if is_destroyed else self._answers(sender, number, now_us):
                heappush(coming, answer)


class _Requests(_Machine):
    """A machine whose nodes answer requests."""

    def __init__(self, network: Network, emulation: Emulation) -> None:
        super().__init__(network, emulation)
        self.is_burst = self.traffic.access == "burst"
        self.nodes = [node for group in network.groups for node in self._nodes(group)]
        self.place_of = {
            sender.order: number for number, node in enumerate(self.nodes) for sender in (*node.requests, *node.answers)
        }
        self.hit_place = {fault: self._place(fault) for fault in _OF_REQUESTS}
        self.frames_left: dict[tuple[str, int, int], int] = {}
        """Frames of a request or an answer that have not arrived, by name, number of the node, and cycle."""

    def _nodes(self, group: Group) -> Iterator[_Node]:
        """Nodes of a group in the order of their requests, one a PDO."""
        frames = {
            name: [
                [sender for sender in self.senders if sender.stream is stream]
                for stream in dict.fromkeys(sender.stream for sender in self.senders)
                if (stream.name, stream.group) == (name, group.name) and not stream.is_message
            ]
            for name in ("command", "feedback")
        }
        for requests, answers in zip(
            zip(*frames["command"], strict=True), zip(*frames["feedback"], strict=True), strict=True
        ):
            yield _Node(group, requests, answers)

    def _place(self, fault: Fault) -> int:
        """Number of the node that a fault hits: the second one, where there are several."""
        if fault is SLOW_HOST and fault.name in self.emulation.faults and len(self.nodes) == 1:
            raise ArgumentError(f"fault {fault.name}: there is one node, and no next request in its cycle")
        return min(1, len(self.nodes) - 1)

    def _is_hit(self, fault: Fault, number: int, cycle: int) -> bool:
        return self.hit_place[fault] == number and cycle in self.hit[fault]

    def _alone(self) -> Iterator[_Queued]:
        yield from super()._alone()
        if not self.is_burst:
            yield from self._request(0, 0, 0.0)
            return
        for cycle in range(self.emulation.cycles):
            queued_us = cycle * self.period_us
            for number, node in enumerate(self.nodes):
                queued_us += self._host_us(number, cycle)
                yield from self._sent(node.requests, "command", number, cycle, queued_us)

    def _host_us(self, number: int, cycle: int) -> float:
        """Time that the host and its adapter take for a request [us]."""
        bus = self.network.profile.bus
        own_us: float = self.random.uniform(LEAST_SHARE, 1) * bus.host_us
        # Of requests at once all go through the adapter side by side.
        own_us += 0.0 if self.is_burst else bus.write_us + bus.read_us
        return own_us + self.emulation.faults.get(SLOW_HOST.name, 0.0) * self._is_hit(SLOW_HOST, number, cycle)

    def _sent(
        self, senders: tuple[_Sender, ...], name: str, number: int, cycle: int, queued_us: float
    ) -> Iterator[_Queued]:
        self.frames_left[name, number, cycle] = len(senders)
        yield from (self._at(queued_us, sender, cycle) for sender in senders)

    def _request(self, number: int, cycle: int, now_us: float) -> Iterator[_Queued]:
        """The request to the next node of a cycle; behind the last one the next cycle begins."""
        if number < len(self.nodes):
            queued_us = now_us + self._host_us(number, cycle)
            yield from self._sent(self.nodes[number].requests, "command", number, cycle, queued_us)
        elif (cycle := cycle + 1) < self.emulation.cycles:
            yield from self._request(0, cycle, max(now_us, cycle * self.period_us))

    def _answers(self, sender: _Sender, cycle: int, now_us: float) -> Iterator[_Queued]:
        """Frames that a node queues when its request has arrived, and the host when the answer has."""
        name = sender.stream.name
        if sender.stream.is_message:
            return
        number = self.place_of[sender.order]
        self.frames_left[name, number, cycle] -= 1
        if self.frames_left[name, number, cycle]:
            return
        node = self.nodes[number]
        if name == "feedback":
            if not self.is_burst:
                yield from self._request(number + 1, cycle, now_us)
        elif self._is_hit(LOST, number, cycle):
            if not self.is_burst:
                patience_us = _PATIENCE * (node.answers_us + node.group.worst_extra_us)
                patience_us += sum(answer.stream.frame_us for answer in node.answers)
                yield from self._request(number + 1, cycle, now_us + patience_us)
        else:
            late_us = self.random.uniform(0, node.group.worst_extra_us)
            late_us += self.emulation.faults.get(SLOW_NODE.name, 0.0) * self._is_hit(SLOW_NODE, number, cycle)
            queued_us = now_us + node.answers_us + late_us
            yield from self._sent(node.answers, "feedback", number, cycle, queued_us)
            if self._is_hit(DOUBLE, number, cycle):
                yield from (self._at(queued_us, answer, cycle) for answer in node.answers)


def _period_us(network: Network) -> float:
    traffic = traffic_of(network)
    return traffic.period_us if traffic.has_cycle else min(message.period_us for message in traffic.messages)


EMULATOR: Final = Emulator(FAULTS, (".log", ".candump"), _period_us, emulated)
