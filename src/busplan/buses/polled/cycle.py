"""The cycle of a polled bus: request, turn-around and answer of each node."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Final, Literal, cast

from busplan.buses.cycle import BusCycle, BusEvent, Doubt, Premise, Run
from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, OwnFigures
from busplan.buses.limits import EventKind
from busplan.buses.network import Group, Network
from busplan.buses.polled.protocols import ProtocolFigures, Requests, Times, c, protocol_of, times
from busplan.elementwise import Number, choose, is_everywhere, is_off, larger, total
from busplan.sections.base import TRANSACTION_KINDS, TransactionKind
from busplan.sections.cycle import time_uncertainty_us

if TYPE_CHECKING:
    from busplan.buses.polled.section import PolledBus

TimingModelName = Literal["standard", "typical"]
STANDARD: Final[TimingModelName] = "standard"
TYPICAL: Final[TimingModelName] = "typical"

_WIRE: Final = "protocol"
RATE: Final = Figure("bit_rate_kbit_s", "f", "profile", "bit rate", "bit rate, kbit/s", decimals=None)
TERMS: Final = (
    Figure("cycle_once_us", "T_once", _WIRE, "token and GAP, once a cycle", "token and GAP", ink="sync", letter="T"),
    Figure(
        "cycle_global_us", "T_GC", _WIRE, "broadcast that opens the cycle", "global control", ink="sync", letter="S"
    ),
    Figure("cycle_request_us", "T_req", _WIRE, "requests of the master", "requests", ink="out", letter="R"),
    Figure(
        "cycle_turn_us",
        "T_turn",
        _WIRE,
        "waits for answers, nodes' own time included",
        "turn-around",
        ink="work",
        letter="W",
    ),
    Figure("cycle_answer_us", "T_ans", _WIRE, "answers of the nodes", "answers", ink="in", letter="A"),
    Figure("cycle_gap_us", "T_gap", _WIRE, "idle bus before and after telegrams", "idle times", ink="gap", letter="G"),
    Figure(
        "cycle_adapter_us",
        "T_adapter",
        "profile",
        "the host's adapter, for each request with answers",
        "adapter",
        ink="contention",
        letter="U",
    ),
    Figure("cycle_retry_us", "T_retry", "profile", "repeated requests", "retries", ink="contention", letter="Y"),
    Figure(
        "cycle_host_us", "T_host", "profile", "the host between feedback and commands", "host", ink="work", letter="H"
    ),
    NONPERIODIC,
)
_BY_CLOCK: Final = (
    "cycle_once_us",
    "cycle_global_us",
    "cycle_request_us",
    "cycle_answer_us",
    "cycle_gap_us",
    "cycle_retry_us",
)
"""Terms timed by the clocks of the bit rate; of the turn-around they time all but the nodes' own time."""
FIGURES: Final = BusFigures(TERMS, setup=(RATE,), headings=(RATE.key,))


@dataclass(frozen=True)
class PolledFigures(OwnFigures):
    """Figures of polled buses alone, by the keys of `FIGURES`."""

    bit_rate_kbit_s: float
    cycle_once_us: float
    cycle_global_us: float
    cycle_request_us: float
    cycle_turn_us: float
    cycle_answer_us: float
    cycle_gap_us: float
    cycle_adapter_us: float
    cycle_retry_us: float
    cycle_host_us: float
    nonperiodic_us: float


EVENTS: Final = (
    EventKind("once", "token and GAP", _WIRE, "t", "sync"),
    EventKind("global", "global control", _WIRE, "s", "sync"),
    EventKind("gap", "idle time", _WIRE, ",", "gap"),
    EventKind("request", "request", _WIRE, ">", "out"),
    EventKind("turn", "turn-around", _WIRE, "=", "work"),
    EventKind("answer", "answer", _WIRE, "<", "in"),
    EventKind("adapter", "adapter of the host", "profile", "u", "contention"),
    EventKind("retry", "retry", "profile", "y", "contention"),
    EventKind("host", "host", "profile", "h", "work"),
    EventKind("nonperiodic", "non-periodic window", NONPERIODIC.reference, "N", "reserve"),
)
STRETCHES: Final = (
    EventKind("exchange", "exchange", "", "X", "in"),
    EventKind("read", "read", "", "R", "in"),
    EventKind("write", "write", "", "W", "out"),
)


PREMISES: Final = (
    Premise("bus.host_us", "an instant host", 100.0),
    Premise("bus.adapter_us", "no adapter", 1000.0),
    Premise("bus.retries", "no repeated requests", 1),
    Premise("bus.max_turn_bits", "answers as the protocol says"),
    Premise("bus.reads", "one read per node", 2),
    Premise("bus.writes", "one write per node", 2),
    Premise("", "no stuffed bytes", applies=lambda cycle: protocol_of(cycle.network.profile.bus).is_stuffed),
)


class PolledCycle(BusCycle):
    """All feedback, then all commands; or an exchange with each node in turn."""

    term_figures = TERMS
    record = PolledFigures
    premises = PREMISES
    command_events = (("exchange", "request"), ("write", "request"))

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.bus = cast("PolledBus", network.profile.bus)
        """Section [bus] of the profile."""
        self.is_typical = model == TYPICAL

    @property
    def _protocol(self) -> ProtocolFigures:
        return protocol_of(self.bus)

    @cached_property
    def _times(self) -> Times:
        return times(self.network)

    @property
    def way(self) -> Requests:
        """The way that nodes are asked."""
        return self.bus.requests or self._protocol.requests[0]

    @cached_property
    def _turn_us(self) -> Number:
        """Wait for an answer [us]: the middle of typical and longest, so that U reaches both."""
        between = self._times
        is_exact = self.is_typical or between.longest_turn is between.typical_turn
        return between.typical_turn if is_exact else (between.typical_turn + between.longest_turn) / 2

    @property
    def _clock_tolerance(self) -> Number:
        """Largest error of the bit rate, as a share of it [1]."""
        given = self.bus.clock_tolerance
        return self._protocol.clock_tolerance if given is None else given

    def _wire_us(self, size: Number) -> Number:
        """Time of a telegram of `size` bytes [us]."""
        return size * self._protocol.bits_per_byte * 1000 / self.bus.bit_rate_kbit_s

    def written(self) -> Iterator[BusEvent | Run]:
        """Token, broadcast, reads, the host, writes, repeated requests, and the non-periodic window."""
        bus, groups = self.bus, tuple(enumerate(self.network.groups))
        yield BusEvent("once", "cycle_once_us", self._times.once, "token and GAP")
        if bus.global_control:
            idle_us = self._times.before + self._times.silent
            global_us = self._wire_us(self._protocol.global_bytes) + idle_us
            yield BusEvent("global", "cycle_global_us", global_us, "global control")
        host = BusEvent("host", "cycle_host_us", bus.host_us, "host", rests_on="bus.host_us")
        if self.way == "exchange":
            yield host
            for place, group in groups:
                yield self._single("exchange", place, group)
        for kind in TRANSACTION_KINDS if self.way != "exchange" else ():
            for place, group in groups:
                yield from self._sync(kind, place, group) if self.way == "sync" else (self._single(kind, place, group),)
            if kind == "read":
                yield host
        yield BusEvent("retry", "cycle_retry_us", self._retry_us, "repeated requests")
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    @property
    def _retry_us(self) -> Number:
        """Time of repeated requests: the longest kind of request, without an answer, each with its timeout [us]."""
        retries: Number = self.bus.retries
        if is_off(retries):
            return 0.0
        longest_us = reduce(larger, map(self._longest_us, self.network.groups))
        return retries * (self._times.before + longest_us + self._times.timeout)

    def _longest_us(self, group: Group) -> Number:
        protocol = self._protocol
        if self.way == "exchange":
            return self._wire_us(self._exchange_bytes(group)[0])
        if self.way == "sync":
            asked = group.nodes_with("read") * protocol.sync_node_bytes
            return self._wire_us(group.if_any("read", protocol.sync_read_bytes + asked))
        read = group.if_any("read", protocol.read_request_bytes)
        return self._wire_us(
            larger(read, group.if_any("write", protocol.write_request_bytes + self._data("write", group)))
        )

    def _times_a_cycle(self, kind: TransactionKind) -> Number:
        return self.bus.reads if kind == "read" else self.bus.writes

    def _data(self, kind: TransactionKind, group: Group) -> Number:
        """Mean data of a request of a node [bytes]."""
        size = group.bytes_of(kind)
        return self._protocol.data_bytes(size, self._times_a_cycle(kind))

    def _exchange_bytes(self, group: Group) -> tuple[Number, Number]:
        """Request and answer of an exchange with a node; with data one way alone, a read or a write [bytes].

        A protocol without these sends an exchange that is empty in the other direction.
        """
        protocol = self._protocol
        read, write = (protocol.data_bytes(group.bytes_of(kind)) for kind in TRANSACTION_KINDS)
        sizes: tuple[Number, Number] = protocol.exchange_request_bytes + write, protocol.exchange_answer_bytes + read
        alone: dict[TransactionKind, tuple[Number, Number]] = {
            "write": (protocol.read_request_bytes, protocol.read_answer_bytes),
            "read": (protocol.write_request_bytes, protocol.write_answer_bytes),
        }
        for missing, (request, answer) in alone.items():
            is_there: Number = group.bytes_of(missing) > 0
            if is_everywhere(is_there) or is_everywhere(request <= 0) or is_everywhere(answer <= 0):
                continue
            one_way = (request + write, answer + read)
            sizes = choose(is_there, sizes[0], one_way[0]), choose(is_there, sizes[1], one_way[1])
        return sizes

    def _execution_us(self, kind: Literal["exchange", "read", "write"], group: Group) -> Number:
        """Own time of a node before it answers [us]; 0 where it answers from a buffer."""
        if self._protocol.is_buffered:
            return 0.0
        return reduce(larger, map(group.slowest_us, TRANSACTION_KINDS if kind == "exchange" else (kind,)))

    def _answer(self, kind: Literal["exchange", "read", "write"], size: Number, group: Group) -> tuple[BusEvent, ...]:
        turn_us = self._turn_us + self._execution_us(kind, group)
        return (
            BusEvent("turn", "cycle_turn_us", turn_us, "turn-around", transaction=kind),
            BusEvent("answer", "cycle_answer_us", self._wire_us(size), "answer", transaction=kind),
        )

    def _around(self, kind: str, *inner: BusEvent, is_answered: bool) -> tuple[BusEvent, ...]:
        """A request with the idle times before and after it, and the adapter."""
        adapter_us = self.bus.adapter_us if is_answered else 0.0
        after_us = self._times.after if is_answered else self._times.silent
        return (
            BusEvent("gap", "cycle_gap_us", self._times.before, "idle time before a request", transaction=kind),
            *inner,
            BusEvent("gap", "cycle_gap_us", after_us, "idle time", transaction=kind),
            BusEvent("adapter", "cycle_adapter_us", adapter_us, "adapter", transaction=kind, rests_on="bus.adapter_us"),
        )

    def _single(self, kind: Literal["exchange", "read", "write"], place: int, group: Group) -> Run:
        """One request for each node of a group."""
        protocol = self._protocol
        rounds = group.nodes if kind == "exchange" else group.nodes_with(kind)
        if kind == "exchange":
            request, answer = self._exchange_bytes(group)
        elif kind == "read":
            request, answer = protocol.read_request_bytes, protocol.read_answer_bytes + self._data(kind, group)
            rounds = rounds * self._times_a_cycle(kind)
        else:
            request, answer = protocol.write_request_bytes + self._data(kind, group), protocol.write_answer_bytes
            rounds = rounds * self._times_a_cycle(kind)
        sent = BusEvent("request", "cycle_request_us", self._wire_us(request), f"{kind} request", transaction=kind)
        answers = () if is_everywhere(answer <= 0) else self._answer(kind, answer, group)
        return Run(self._around(kind, sent, *answers, is_answered=bool(answers)), rounds, place)

    def _sync(self, kind: TransactionKind, place: int, group: Group) -> Iterator[Run]:
        """One request for all nodes of a group: all answer a read in turn, and none answers a write."""
        protocol, data = self._protocol, self._data(kind, group)
        size: Number = protocol.sync_read_bytes if kind == "read" else protocol.sync_write_bytes
        size = size + group.nodes * (protocol.sync_node_bytes + (0 if kind == "read" else data))
        sent = BusEvent("request", "cycle_request_us", self._wire_us(size), f"sync {kind}", transaction=kind)
        before, request, *after = self._around(kind, sent, is_answered=kind == "read")
        rounds = group.if_any(kind, self._times_a_cycle(kind))
        if kind == "write":
            yield Run((before, request, *after), rounds)
            return
        yield Run((before, request), rounds)
        answer = self._answer(kind, protocol.read_answer_bytes + data, group)
        yield Run(answer, group.nodes * rounds, place)
        yield Run(tuple(after), rounds)

    def _answers(self, group: Group, kind: str) -> Number:
        """Number of answers of a group's nodes in a cycle to requests of a kind [1]."""
        if self.way == "exchange":
            return group.nodes if kind == "read" else 0
        if kind == "read":
            return group.nodes_with("read") * self._times_a_cycle("read")
        is_answered = self.way == "single" and not is_everywhere(self._protocol.write_answer_bytes <= 0)
        return group.nodes_with("write") * self._times_a_cycle("write") if is_answered else 0

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubts of turn-around and clocks, for all nodes together; of the adapter; and of the nodes' own time.

        The clocks of master and nodes count as one: a divider errs alike in all UARTs of a type.
        """
        groups, between = self.network.groups, self._times
        answers = total(self._answers(group, kind) for group in groups for kind in TRANSACTION_KINDS)
        half_us = 0.0 if self.is_typical else (between.longest_turn - between.typical_turn) / 2
        timed_us = total((*(self.by_term[key] for key in _BY_CLOCK), answers * self._turn_us))
        doubts = [
            Doubt("bus.max_turn_bits", "turn-around of a node", answers * half_us / 2),
            Doubt("bus.clock_tolerance", "clocks of the bit rate", timed_us * self._clock_tolerance / 3**0.5),
            Doubt(
                "bus.adapter_us", "adapter of the host", self.by_term["cycle_adapter_us"] * c["SHARES[ADAPTER_SHARE]"]
            ),
        ]
        host_us: Number = time_uncertainty_us(self.bus.host_us, is_guess=False)
        doubts.append(Doubt("bus.host_us", "the host's own time", host_us))
        if not self._protocol.is_buffered:
            execution_us: list[Number] = []
            for group in groups:
                reads, writes = self._answers(group, "read"), self._answers(group, "write")
                us = reads * group.read_uncertainty_us + writes * group.write_uncertainty_us
                if self.way == "exchange":
                    us = reads * larger(group.read_uncertainty_us, group.write_uncertainty_us)
                execution_us.append(us)
            # Times of several groups are measured, or guessed, in the same way: they are taken to err together.
            key = "node.execution" if self.network.is_uniform else "group.execution"
            doubts.append(Doubt(key, "execution time", total(execution_us)))
        return tuple(doubts)

    def figures(self) -> Mapping[str, Number | None]:
        """The bit rate."""
        return {RATE.key: self.bus.bit_rate_kbit_s}

    def loop_periods(self, *, at_sync: bool) -> int:
        """Periods inside a loop [1]: one more in an exchange, whose command uses the last cycle's feedback."""
        return int(at_sync) + int(self.way == "exchange")
