"""Logs of CAN machines with known truth, frame by frame. It imports nothing of busplan.

The bus: whenever it is free, of the frames that wait that of the smallest identifier goes, with its own bits, and
nothing interrupts it. The machine is that of a plan, the keys of a profile's file. Its host sends SYNC by its own
clock; each node that is due answers behind its execution time; behind the last feedback and its own time the host sends
all commands, or at once where it computes in a cycle of its own. Messages come by clocks of their own. What a machine
does beside its plan stands in `Machine`.
"""

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from heapq import heapify, heappop, heappush
from itertools import accumulate, count
from math import ceil
from pathlib import Path
from random import Random
from tomllib import loads
from typing import Any, Final, NamedTuple

from tests.oracles.can_frames import DLC_LENGTHS, fd_written_bits, written_bits

SPACE_BITS: Final = 3
ERROR_BITS: Final = 6 + 6 + 8 + SPACE_BITS
"""Error flags of two nodes behind each other, their delimiter and the interframe space."""
MANNERS: Final = ("periodic", "sporadic", "pairs")
"""How a message comes: each period and evenly 0..jitter later, no sooner than its period, or every second one as late
as its jitter lets it."""


class Queued(NamedTuple):
    """A frame, and when it is queued."""

    us: float
    identifier: int
    data: bytes
    extended: bool = False
    fd: bool = False
    switched: bool = True
    """Whether an FD frame switches to the rate of data."""
    stream: str = ""
    """What it is a frame of."""
    number: int = 0
    """Its cycle, or its place among those of its message."""
    due_us: float = 0.0
    """When it was due by the clock of its sender."""


class Logged(NamedTuple):
    """A frame in a log, stamped at its end, without the interframe space."""

    us: float
    identifier: int
    data: bytes
    extended: bool
    bits: int
    fd: bool = False
    wire_us: float = 0.0
    """On the wire, interframe space included."""
    queued: Queued = Queued(0.0, 0, b"")
    is_error: bool = False
    """Whether it is an error frame; the wire has the destroyed frame and it."""


@lru_cache(maxsize=1 << 14)
def _bits(identifier: int, data: bytes, extended: bool, fd: bool, switched: bool) -> tuple[int, int]:
    """Bits at both rates."""
    identifier_bits = 29 if extended else 11
    if fd:
        return fd_written_bits(identifier, data, identifier_bits=identifier_bits, is_switched=switched)
    return written_bits(identifier, data, identifier_bits=identifier_bits), 0


def bits_of(frame: Queued | Logged) -> int:
    """Length of a frame, interframe space included."""
    return sum(_bits(frame.identifier, frame.data, frame.extended, frame.fd, True))


def arbitrated(
    queued: Iterable[Queued],
    *,
    bit_us: float = 1.0,
    data_bit_us: float | None = None,
    answers: Callable[[Logged], Iterable[Queued]] = lambda _: (),
    destroyed: frozenset[int] = frozenset(),
) -> list[Logged]:
    """All frames in the order in which the bus takes them.

    data_bit_us: without it a quarter of bit_us; answers: what is queued when a frame has arrived; destroyed: places in
    the log of error frames, each in the middle of a frame that then goes again.
    """
    fast_us = bit_us / 4 if data_bit_us is None else data_bit_us
    numbers = count()
    coming = [(frame.us, next(numbers), frame) for frame in queued]
    heapify(coming)
    waiting: list[tuple[tuple[int, int], int, Queued]] = []
    logged: list[Logged] = []
    now_us = 0.0
    while coming or waiting:
        if not waiting:
            now_us = max(now_us, coming[0][0])
        while coming and coming[0][0] <= now_us:
            _, number, frame = heappop(coming)
            # The first 11 bits decide, and of equal ones the base frame goes first.
            order = (frame.identifier, -1) if not frame.extended else (frame.identifier >> 18, frame.identifier)
            heappush(waiting, (order, number, frame))
        order, number, frame = heappop(waiting)
        nominal, fast = _bits(frame.identifier, frame.data, frame.extended, frame.fd, frame.switched)
        wire_us = nominal * bit_us + fast * fast_us
        is_error = len(logged) in destroyed
        if is_error:
            wire_us = wire_us / 2 + ERROR_BITS * bit_us
            heappush(waiting, (order, number, frame))
        now_us += wire_us
        end_us = now_us - SPACE_BITS * bit_us
        one = Logged(end_us, *frame[1:4], nominal + fast, frame.fd, wire_us, frame, is_error)
        logged.append(one)
        for answer in () if is_error else answers(one):
            heappush(coming, (answer.us, next(numbers), answer))
    return logged


class Pdo(NamedTuple):
    """A frame of a PDO."""

    stream: str
    identifier: int
    size: int


class Node(NamedTuple):
    """A node."""

    every: int
    execution_us: float
    extra_us: float
    """Its slowest answer comes so much later than its execution time."""
    feedback: tuple[Pdo, ...]
    command: tuple[Pdo, ...]


def padded(size: int) -> int:
    """Bytes that a frame has for some data."""
    return DLC_LENGTHS[bisect_left(DLC_LENGTHS, size)]


def nodes_of(plan: dict[str, Any]) -> Iterator[Node]:
    """All nodes of a plan, each with the frames of its PDOs."""
    bus = plan["bus"]
    groups = plan.get("group", ())
    if "node" in plan:
        groups = ({**plan["payload"], **plan["node"], "nodes": bus["nodes"], "name": ""},)
    free = {"feedback": 0x181, "command": 0x201}
    for group in groups:
        each = max(group["axes"], 1) if group.get("pdo_per") == "axis" else 1
        first, frames, read_bytes = {}, {}, 0
        for name, sort in (("command", "write"), ("feedback", "read")):
            said = group.get(f"{name}_pdos")
            fixed, per_axis = (group.get(f"{sort}_bytes{more}", 0) for more in ("", "_per_axis"))
            read_bytes = fixed + per_axis * group["axes"] or sum(said) * each
            frames[name] = list(split(ceil(read_bytes / each), said or [64 if "data_bit_rate_kbit_s" in bus else 8]))
            first[name] = group.get(f"{name}_identifier", free[name])
            free[name] = first[name] + group["nodes"] * each
        execution = group["execution"]
        execution_us = execution["base_us"] + execution["per_byte_us"] * read_bytes
        for node in range(group["nodes"]):
            pdos = [
                tuple(
                    Pdo(_name(group["name"], name, place, len(frames[name])), first[name] + own + 0x100 * place, size)
                    for own in range(node * each, (node + 1) * each)
                    for place, size in enumerate(frames[name])
                )
                for name in ("feedback", "command")
            ]
            yield Node(group.get("every", 1), execution_us, execution.get("worst_extra_us", 0.0), *pdos)


def split(size: int, most: list[int]) -> Iterator[int]:
    """Data of each frame of a PDO; further ones are as the last."""
    for place in count():
        if size <= 0:
            return
        own = min(size, most[min(place, len(most) - 1)])
        yield own
        size -= own


def _name(group: str, name: str, place: int, frames: int) -> str:
    return " ".join(filter(None, (group, name, str(place + 1) if frames > 1 else "")))


@dataclass
class Machine:
    """A machine, its plan and what it does beside it. Cycles are numbered from 0; the log has those from 2 on."""

    plan: dict[str, Any]
    cycles: int = 300
    """Length of its log; of messages alone in periods of the fastest."""
    seed: int = 1
    clock: float = 1.0
    """Period of the host's clock, in those of the recorder's."""
    sync_jitter_us: float = 0.0
    manners: dict[str, str] = field(default_factory=dict)
    """Of messages by name, where it is not drawn."""
    late: dict[int, float] = field(default_factory=dict)
    """Commands that are queued so much later [us]."""
    late_nodes: frozenset[int] | None = None
    """Numbers of the nodes whose commands are; None for all."""
    no_sync: frozenset[int] = frozenset()
    no_commands: frozenset[int] = frozenset()
    no_feedback: frozenset[int] = frozenset()
    """Cycles in which the first node that is due is silent."""
    twice: frozenset[int] = frozenset()
    """Cycles in which it answers twice."""
    destroyed: frozenset[int] = frozenset()
    """Places of error frames."""
    step_us: float = 1.0
    """Of the stamps, which are rounded down."""
    latency_us: float = 0.0
    """How late the driver may be: it takes all frames that have arrived at once."""

    @property
    def period_us(self) -> float:
        """Period of the cycle; of messages alone of the fastest."""
        cycle = self.plan.get("cycle") or min(self.plan["message"], key=lambda message: float(message["period_us"]))
        return float(cycle["period_us"]) * self.clock


class _Host:
    """The host and the nodes of a machine while they run."""

    def __init__(self, machine: Machine) -> None:
        self.machine, self.random, bus = machine, Random(machine.seed), machine.plan["bus"]
        self.nodes = tuple(nodes_of(machine.plan))
        self.feedback = {pdo.stream for node in self.nodes for pdo in node.feedback}
        self.full = self.random.randrange(240)
        """So many cycles before the first one all PDOs went."""
        self.extended, self.fd = bus.get("identifier_bits") == 29, "data_bit_rate_kbit_s" in bus
        self.host_share = self.random.random()
        """When a host that computes in a cycle of its own sends commands, in the time of the slowest answer."""
        self.missing: dict[int, int] = {}
        """Feedback frames that have not arrived, by cycle."""
        self.values: dict[tuple[int, int], list[bytes]] = {}

    def data(self, identifier: int, size: int) -> bytes:
        """One of the eight values that a frame has."""
        values = self.values.setdefault((identifier, size), [])
        if not values:
            values += [self.random.randbytes(size) for _ in range(7)] + [bytes(size)]
        return self.random.choice(values)

    def sent(self, us: float, pdo: Pdo, cycle: int) -> Queued:
        """A frame of the cycle."""
        data, due_us = self.data(pdo.identifier, padded(pdo.size)), cycle * self.machine.period_us
        return Queued(us, pdo.identifier, data, self.extended, self.fd, True, pdo.stream, cycle, due_us)

    def syncs(self) -> Iterator[Queued]:
        """SYNC of each cycle."""
        bus, machine = self.machine.plan["bus"], self.machine
        sync = Pdo("SYNC", bus.get("sync_identifier", 0x80), int(bus.get("sync_counter", False)))
        for cycle in range(machine.cycles + 3) if self.nodes else ():
            late_us = self.random.uniform(0, machine.sync_jitter_us)
            if cycle not in machine.no_sync:
                yield self.sent(cycle * machine.period_us + late_us, sync, cycle)

    def messages(self) -> Iterator[Queued]:
        """All other messages."""
        machine, random, bus = self.machine, self.random, self.machine.plan["bus"]
        for message in machine.plan.get("message", ()):
            manner = machine.manners.get(message["name"]) or random.choice(MANNERS)
            bits, fd = message.get("identifier_bits", bus.get("identifier_bits", 11)), message.get("fd", False)
            # As many frames at once as a burst has, so that the mean period is the planned one.
            burst = message.get("burst", 1)
            for node in range(1, len(self.nodes) + 1) if message.get("per_node") else (0,):
                identifier = message["identifier"] + node
                period_us = message["period_us"] * burst * (1 + random.uniform(-3e-5, 3e-5))
                due_us, number = random.uniform(0, period_us), 0
                while due_us < (machine.cycles + 3) * machine.period_us:
                    late_us = message.get("jitter_us", 0.0) * (number % 2 if manner == "pairs" else random.random())
                    for place in range(number * burst, (number + 1) * burst):
                        data = self.data(
                            identifier, padded(message["payload_bytes"]) if fd else message["payload_bytes"]
                        )
                        more = fd, message.get("brs", True), message["name"], place, due_us
                        yield Queued(due_us + late_us, identifier, data, bits == 29, *more)
                    due_us += period_us + (random.expovariate(1 / period_us) if manner == "sporadic" else 0)
                    number += 1

    def answers(self, frame: Logged) -> Iterator[Queued]:
        """What nodes queue when SYNC has arrived, and the host when the last feedback has."""
        machine, bus, cycle, stream = self.machine, self.machine.plan["bus"], frame.queued.number, frame.queued.stream
        if stream == "SYNC":
            due = [node for node in self.nodes if (cycle + self.full) % node.every == 0]
            self.missing[cycle] = sum(len(node.feedback) for node in due)
            for place, node in enumerate(due):
                ready_us = frame.us + self.random.uniform(0.5, 1) * node.execution_us
                ready_us += self.random.uniform(0, node.extra_us)
                times = 1 if place else 1 - (cycle in machine.no_feedback) + (cycle in machine.twice)
                self.missing[cycle] += (times - 1) * len(node.feedback)
                yield from (self.sent(ready_us, pdo, cycle) for pdo in node.feedback * times)
            if bus.get("pipeline_cycles", 0):
                slowest_us = max((node.execution_us + node.extra_us for node in due), default=0.0)
                share = self.host_share * self.random.uniform(0.9, 1)
                yield from self.commands(frame.us + share * slowest_us, cycle)
        elif stream in self.feedback:
            self.missing[cycle] -= 1
            if not self.missing[cycle] and not bus.get("pipeline_cycles", 0):
                adapter_us = bus.get("host_read_us", 0.0) + bus.get("host_write_us", 0.0)
                host_us = self.random.uniform(0.5, 1) * bus.get("host_us", 0.0)
                yield from self.commands(frame.us + host_us + adapter_us, cycle)

    def commands(self, us: float, cycle: int) -> Iterator[Queued]:
        """The commands of a cycle."""
        machine = self.machine
        for number, node in enumerate(self.nodes):
            if (cycle + self.full) % node.every == 0 and cycle not in machine.no_commands:
                is_late = machine.late_nodes is None or number in machine.late_nodes
                late_us = machine.late.get(cycle, 0.0) * is_late
                yield from (self.sent(us + late_us, pdo, cycle) for pdo in node.command)


def simulated(machine: Machine) -> list[Logged]:
    """All that the bus carries, from cycle 0 on."""
    host, bus = _Host(machine), machine.plan["bus"]
    return arbitrated(
        [*host.syncs(), *host.messages()],
        bit_us=1000 / bus["bit_rate_kbit_s"],
        data_bit_us=1000 / bus.get("data_bit_rate_kbit_s", bus["bit_rate_kbit_s"]),
        answers=host.answers,
        destroyed=machine.destroyed,
    )


def recorded(machine: Machine) -> tuple[bytes, dict[str, float]]:
    """A machine's log, which begins and ends anywhere in a cycle, and the truth of it."""
    logged, stamped, start_s = in_log(machine)
    return candump(stamped, start_s=start_s, step_us=machine.step_us).encode(), truth(machine, logged)


def in_log(machine: Machine) -> tuple[list[Logged], list[Logged], float]:
    """Frames of a machine's log, the same with the stamps of its recorder, and the time at which they begin [s]."""
    random = Random(-machine.seed)
    start_us = (1 + random.random()) * machine.period_us
    end_us = start_us + machine.cycles * machine.period_us
    logged = [frame for frame in simulated(machine) if start_us <= frame.us < end_us]
    stamped = list(handed_over(logged, machine.latency_us, random)) if machine.latency_us else logged
    return logged, stamped, 1_700_000_000 + random.random()


def truth(machine: Machine, logged: list[Logged]) -> dict[str, float]:
    """What a log has in truth, by the emulator's own words: times and periods in us, shares 0..1, counts."""
    sent = [frame for frame in logged if not frame.is_error]
    streams: dict[str, dict[int, list[Logged]]] = defaultdict(lambda: defaultdict(list))
    for frame in sent:
        streams[frame.queued.stream][frame.identifier].append(frame)
    syncs = {frame.queued.number: frame.us for frame in sent if frame.queued.stream == "SYNC"}
    pdos = {pdo.stream: node.every for node in nodes_of(machine.plan) for pdo in node.feedback + node.command}
    pdos["SYNC"] = 1
    found: dict[str, float] = defaultdict(float, {"error frames": len(logged) - len(sent)})
    if len(logged) > 1:
        found["load"] = sum(frame.wire_us for frame in logged[1:]) / (logged[-1].us - logged[0].us)
    of_syncs = (frame for frame in sent if frame.queued.stream in pdos and frame.queued.number in syncs)
    found["last PDO"] = max((frame.us - syncs[frame.queued.number] for frame in of_syncs), default=0.0)
    found |= {"SYNC missing": 0, "PDOs missing": 0, "PDOs twice": 0}
    if syncs:
        found["SYNC missing"] = max(syncs) + 1 - min(syncs) - len(syncs)
    periods_us = {message["name"]: message["period_us"] for message in machine.plan.get("message", ())}
    for stream, each in streams.items():
        every = pdos.get(stream, 1)
        for frames in each.values():
            numbers, first, last = {frame.queued.number for frame in frames}, frames[0].queued, frames[-1].queued
            found[f"{stream} data"] = max(found[f"{stream} data"], *(len(frame.data) for frame in frames))
            late_us = [frame.us - frame.queued.due_us for frame in frames]
            found[f"{stream} jitter"] = max(found[f"{stream} jitter"], max(late_us) - min(late_us))
            if last.number > first.number:
                period_us = every * (last.due_us - first.due_us) / (last.number - first.number)
                found[f"{stream} period"] = min(found.get(f"{stream} period", period_us), period_us)
            if stream in periods_us:
                found[f"{stream} sooner"] = max(found[f"{stream} sooner"], _sooner_us(frames, periods_us[stream]))
            elif stream != "SYNC":
                of_syncs_us = [frame.us - syncs[number] for frame in frames if (number := frame.queued.number) in syncs]
                found[f"{stream} response"] = max(found[f"{stream} response"], *of_syncs_us, 0.0)
                # What the last SYNC asked for may come when the log has ended.
                due = sorted(number for number in syncs if (number - first.number) % every == 0)[:-1]
                found["PDOs missing"] += len(set(due) - numbers)
                found["PDOs twice"] += len(frames) - len(numbers)
    return dict(found)


def _sooner_us(frames: list[Logged], period_us: float) -> float:
    """How much sooner frames come than a period by a clock that is 100 ppm fast."""
    early_us = [place * period_us * 0.9999 - frame.us for place, frame in enumerate(frames)]
    return max(early - least for early, least in zip(early_us, accumulate(early_us, min), strict=True))


def handed_over(logged: list[Logged], latency_us: float, random: Random) -> Iterator[Logged]:
    """Stamps of a driver that is late: frames that wait for it follow each other as fast as it takes them."""
    awake_us = last_us = 0.0
    for frame in logged:
        if frame.us > awake_us:
            awake_us = frame.us + random.uniform(0, latency_us)
        last_us = max(awake_us, last_us + 4)
        yield frame._replace(us=last_us)


def candump(
    logged: Iterable[Logged], *, start_s: float = 1_700_000_000, channel: str = "can0", step_us: float = 1.0
) -> str:
    """A log of `candump -l`."""
    lines = []
    for frame in logged:
        time_us = int((start_s * 10**6 + frame.us) // step_us * step_us)
        name = f"{frame.identifier:08X}" if frame.extended else f"{frame.identifier:03X}"
        data = f"{f'#{int(frame.queued.switched)}' * frame.fd}{frame.data.hex().upper()}"
        what = "20000088#0000000000000000" if frame.is_error else f"{name}#{data}"
        lines.append(f"({time_us // 10**6}.{time_us % 10**6:06d}) {channel} {what}\n")
    return "".join(lines)


SERVO_8: Final = Path(__file__).parents[2] / "profiles" / "can-servo-8.toml"


def servo_8(cycles: int, *, seed: int = 1, sync_jitter_us: float = 0.0) -> list[Queued]:
    """What the machine of can-servo-8 queues, within its plan."""
    manners = {"sdo-request": "sporadic", "sdo-response": "sporadic", "heartbeats": "periodic"}
    machine = Machine(loads(SERVO_8.read_text()), cycles, seed, sync_jitter_us=sync_jitter_us, manners=manners)
    return [frame.queued for frame in simulated(machine) if frame.us < cycles * machine.period_us]
