"""The cycle of a polled bus: request, turn-around and answer of each node."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import product
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, TypeAlias, cast

from busplan.buses.cycle import ALL, BUT_FIRST, FIRST, BusCycle, BusEvent, Doubt, Premise, Rounds, Run
from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, OwnFigures
from busplan.buses.network import Group, Network
from busplan.buses.parts import EventKind
from busplan.buses.polled.protocols import (
    TOGETHER,
    AdapterFigures,
    ProtocolFigures,
    Requests,
    Times,
    adapter_of,
    protocol_of,
    times,
)
from busplan.elementwise import Number, choose, is_everywhere, is_off, larger, named, total
from busplan.sections.base import TRANSACTION_KINDS, TransactionKind

if TYPE_CHECKING:
    from busplan.buses.polled.section import PolledBus

_Kind: TypeAlias = Literal["exchange", "read", "write"]
_Share: TypeAlias = Callable[[ProtocolFigures, Number, Number], Number]
"""Data of a telegram, of those that share the data of a node."""
TimingModelName = Literal["standard", "typical"]
STANDARD: Final[TimingModelName] = "standard"
TYPICAL: Final[TimingModelName] = "typical"

_WIRE: Final = "protocol"
RATE: Final = Figure("bit_rate_kbit_s", "f", "profile", "bit rate", "bit rate, kbit/s", decimals=None)
TERMS: Final = (
    Figure(
        "cycle_jitter_us",
        "J",
        "profile",
        "how late the master may start a cycle",
        "master's jitter",
        ink="contention",
        letter="J",
        waits_for="host",
    ),
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
        waits_for="nodes",
    ),
    Figure("cycle_answer_us", "T_ans", _WIRE, "answers of the nodes", "answers", ink="in", letter="A"),
    Figure("cycle_gap_us", "T_gap", _WIRE, "idle bus before and after telegrams", "idle times", ink="gap", letter="G"),
    Figure(
        "cycle_adapter_us",
        "T_adapter",
        "profile",
        "the host's adapter, at most, for each request with answers",
        "adapter",
        ink="contention",
        letter="U",
        waits_for="adapter",
    ),
    Figure("cycle_retry_us", "T_retry", "profile", "repeated requests", "retries", ink="contention", letter="Y"),
    Figure(
        "cycle_host_us",
        "T_host",
        "profile",
        "the host between feedback and commands",
        "host",
        ink="work",
        letter="H",
        waits_for="host",
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
LEAST_ADAPTER: Final = Figure(
    "least_cycle_adapter_us",
    "T_adapter,least",
    "profile",
    "the host's adapter, at least: its timer runs beside the wire",
    "adapter, at least",
)
FIGURES: Final = BusFigures(TERMS, setup=(RATE,), headings=(RATE.key,), added=(LEAST_ADAPTER,), table=(LEAST_ADAPTER,))


@dataclass(frozen=True)
class PolledFigures(OwnFigures):
    """Figures of polled buses alone, by the keys of `FIGURES`."""

    bit_rate_kbit_s: float
    cycle_jitter_us: float
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
    least_cycle_adapter_us: float


EVENTS: Final = (
    EventKind("jitter", "master's jitter", "profile", "j", "contention"),
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
    Premise("bus.master_jitter_us", "cycles without jitter", 50.0),
    Premise("bus.adapter", "no adapter", "ftdi-low-latency"),
    Premise("bus.retries", "no repeated requests", 1),
    Premise("bus.max_turn_bits", "answers as the protocol says"),
    Premise("bus.reads", "one read per node", 2),
    Premise("bus.writes", "one write per node", 2),
    Premise("", "no stuffed bytes", applies=lambda cycle: protocol_of(cycle.network.profile.bus).is_stuffed),
)


class _Exchange(NamedTuple):
    """A request, and its answers."""

    request_bytes: Number
    answer_bytes: Number = 0
    answers: Number = 0
    """Number of answers [1]."""

    @property
    def is_answered(self) -> bool:
        """Whether any node answers."""
        return not is_everywhere(self.answer_bytes <= 0)


def _has(kind: _Kind, group: Group) -> bool:
    """Whether nodes of a group have exchanges of a kind; in an array, at any point."""
    return kind == "exchange" or group.has(kind)


def _if_any(kind: _Kind, group: Group, number: Number) -> Number:
    """A number of exchanges of a kind; 0 where the nodes of a group have none."""
    return number if kind == "exchange" else group.if_any(kind, number)


class PolledCycle(BusCycle):
    """All feedback, then all commands; or an exchange with each node in turn.

    An adapter of the host adds at most its timer and a USB frame to each exchange. At least, its timer runs beside the
    wire, from the last packet of the exchange before: `is_least`.
    """

    term_figures = TERMS
    record = PolledFigures
    premises = PREMISES
    command_events = (("exchange", "request"), ("write", "request"))

    def __init__(self, network: Network, model: str, *, is_least: bool | None = None) -> None:
        self.network = network
        self.bus = cast("PolledBus", network.profile.bus)
        """Section [bus] of the profile."""
        self.model = model
        self.is_typical = model == TYPICAL
        self.is_least = self.is_typical if is_least is None else is_least
        """Whether the adapter takes its least time."""

    @property
    def _protocol(self) -> ProtocolFigures:
        return protocol_of(self.bus)

    @cached_property
    def _times(self) -> Times:
        return times(self.network)

    @cached_property
    def _adapter(self) -> AdapterFigures:
        return adapter_of(self.bus)

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
        """The master's jitter, token, broadcast, reads, the host, writes, retries, and the non-periodic window."""
        bus, late = self.bus, "latest start of the cycle"
        yield BusEvent("jitter", "cycle_jitter_us", bus.master_jitter_us, late, rests_on="bus.master_jitter_us")
        yield BusEvent("once", "cycle_once_us", self._times.once, "token and GAP")
        if bus.global_control:
            idle_us = self._times.before + self._times.silent
            global_us = self._wire_us(self._protocol.global_bytes) + idle_us
            yield BusEvent("global", "cycle_global_us", global_us, "global control")
        host = BusEvent("host", "cycle_host_us", bus.host_us, "host", rests_on="bus.host_us")
        if self.way == "exchange":
            yield host
        for kind in self._kinds:
            for place in (place for place, group in enumerate(self.network.groups) if _has(kind, group)):
                yield from self._together(kind, place) if self.way in TOGETHER else (self._single(kind, place),)
            if kind == "read":
                yield host
        yield BusEvent("retry", "cycle_retry_us", self._retry_us, "repeated requests")
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    @property
    def _kinds(self) -> tuple[_Kind, ...]:
        """Kinds of exchanges, in their order."""
        return ("exchange",) if self.way == "exchange" else TRANSACTION_KINDS

    @property
    def _retry_us(self) -> Number:
        """Time of repeated requests: the longest kind of request, without an answer, each with its timeout [us].

        At least, a repeated request hides in a wait for the adapter.
        """
        retries: Number = self.bus.retries
        if is_off(retries):
            return 0.0
        longest_us = reduce(larger, map(self._longest_us, self.network.groups))
        retry_us = self._times.before + longest_us + self._times.timeout
        if self.is_least and self._waits:
            retry_us = larger(retry_us - reduce(larger, self._waits.values()), 0.0)
        return retries * retry_us

    def _longest_us(self, group: Group) -> Number:
        kinds = TRANSACTION_KINDS[:1] if self.way in TOGETHER else self._kinds
        longest = ((kind, self._exchange(kind, group, ProtocolFigures.most_data_bytes)) for kind in kinds)
        sizes = (_if_any(kind, group, exchange.request_bytes) for kind, exchange in longest)
        return self._wire_us(reduce(larger, sizes))

    def _times_a_cycle(self, kind: _Kind) -> Number:
        return {"read": self.bus.reads, "write": self.bus.writes}.get(kind, 1)

    def _exchange(self, kind: _Kind, group: Group, share: _Share = ProtocolFigures.data_bytes) -> _Exchange:
        """The exchange of a kind with a node of a group, or with all of them together.

        Where requests share the data of a node, it is one with the mean `share`, or another.
        """
        protocol, nodes = self._protocol, group.nodes
        requests = self._times_a_cycle(kind)
        read_bytes, written_bytes = (share(protocol, size, requests) for size in (group.read_bytes, group.write_bytes))
        if kind == "exchange":
            return _Exchange(*self._both_ways(group, read_bytes, written_bytes), 1)
        if kind == "write" and self.way in TOGETHER:
            return _Exchange(protocol.sync_write_bytes + nodes * (protocol.sync_node_bytes + written_bytes))
        if kind == "write":
            return _Exchange(protocol.write_request_bytes + written_bytes, protocol.write_answer_bytes, 1)
        answer = protocol.read_answer_bytes + read_bytes
        if self.way == "single":
            return _Exchange(protocol.read_request_bytes, answer, 1)
        request = protocol.sync_read_bytes + nodes * protocol.sync_node_bytes
        if self.way == "sync":
            return _Exchange(request, answer, nodes)
        return _Exchange(request, protocol.fast_answer_bytes + nodes * (protocol.fast_node_bytes + read_bytes), 1)

    def _both_ways(self, group: Group, read_bytes: Number, written_bytes: Number) -> tuple[Number, Number]:
        """Request and answer of an exchange with a node; with data one way alone, a read or a write [bytes].

        A protocol without these sends an exchange that is empty in the other direction.
        """
        protocol = self._protocol
        request, answer = protocol.exchange_request_bytes + written_bytes, protocol.exchange_answer_bytes + read_bytes
        alone: dict[TransactionKind, tuple[Number, Number]] = {
            "write": (protocol.read_request_bytes, protocol.read_answer_bytes),
            "read": (protocol.write_request_bytes, protocol.write_answer_bytes),
        }
        for missing, (asked, answered) in alone.items():
            is_there: Number = group.bytes_of(missing) > 0
            if is_everywhere(is_there) or is_everywhere(asked <= 0) or is_everywhere(answered <= 0):
                continue
            request = choose(is_there, request, asked + written_bytes)
            answer = choose(is_there, answer, answered + read_bytes)
        return request, answer

    def _execution_us(self, kind: _Kind, group: Group) -> Number:
        """Own time of a node before it answers [us]; 0 where it answers from a buffer."""
        if self._protocol.is_buffered:
            return 0.0
        return reduce(larger, map(group.slowest_us, TRANSACTION_KINDS if kind == "exchange" else (kind,)))

    @cached_property
    def _waits(self) -> dict[tuple[_Kind, int], Number]:
        """Least time that the adapter adds to an exchange behind another, by kind and group, in their order [us]."""
        waits: dict[tuple[_Kind, int], Number] = {}
        for kind, (place, group) in product(self._kinds, enumerate(self.network.groups)):
            least, most = (
                self._exchange(kind, group, share)
                for share in (ProtocolFigures.least_data_bytes, ProtocolFigures.most_data_bytes)
            )
            if most.is_answered and _has(kind, group):
                answer_us = self._turn_us + self._execution_us(kind, group) + self._wire_us(most.answer_bytes)
                wire_us = self._wire_us(most.request_bytes) + most.answers * answer_us
                exchange_us = self._times.before + wire_us + self._times.after
                named(exchange_us, f"{kind}_exchange_us", "_".join(filter(None, ("w", kind, group.members[0].name))))
                sizes = [each.answers * each.answer_bytes for each in (least, most)]
                are_alike = is_everywhere(self._times_a_cycle(kind) <= 1)
                waits[kind, place] = self._adapter.least_wait_us(exchange_us, sizes[are_alike:])
        return waits

    def _adapter_events(self, kind: _Kind, place: int) -> Iterator[BusEvent]:
        """Time of the adapter at the end of an exchange.

        At least, none for the first of a cycle, where the timer has run on; the host's time hides in the one after it.
        """

        def event(us: Number, rounds: Rounds = ALL) -> BusEvent:
            return BusEvent("adapter", "cycle_adapter_us", us, "adapter", None, kind, None, self._adapter_key, rounds)

        adapter = self._adapter
        if not self.is_least or adapter.is_off:
            yield event(0.0 if adapter.is_off else adapter.timer_us + adapter.frame_us)
            return
        group, wait_us = self.network.groups[place], self._waits[kind, place]
        before = list(self._waits)[: list(self._waits).index((kind, place))]
        ahead, reads = (
            total(_if_any(kind, self.network.groups[at], 1) for kind, at in before if kind in kinds)
            for kinds in ((kind,), ("read",))
        )
        if before and is_everywhere(ahead > 0):
            yield event(_if_any(kind, group, wait_us))
            return
        behind_host_us = larger(wait_us - self.bus.host_us, 0.0) if kind == "write" else 0.0
        first_us = choose(ahead > 0, wait_us, choose(reads > 0, behind_host_us, 0.0))
        yield event(_if_any(kind, group, first_us), FIRST)
        yield event(_if_any(kind, group, wait_us), BUT_FIRST)

    @property
    def _adapter_key(self) -> str:
        """Dotted key that sets the time of the adapter."""
        is_own = self.bus.adapter is not None and not isinstance(self.bus.adapter, str)
        return "bus.adapter.timer_us" if is_own else "bus.adapter"

    def possible_us(self) -> Number:
        """Part of the cycle that the adapter may hide behind the wire [us]."""
        if self.is_least or self._adapter.is_off:
            return 0.0
        terms = ("cycle_adapter_us", "cycle_retry_us")
        return total(self.by_term[term] - self._least.by_term[term] for term in terms)

    @cached_property
    def _least(self) -> "PolledCycle":
        """The same cycle with the least time of the adapter."""
        return self if self.is_least else PolledCycle(self.network, self.model, is_least=True)

    def _answer(self, kind: _Kind, size: Number, group: Group) -> tuple[BusEvent, ...]:
        turn_us = self._turn_us + self._execution_us(kind, group)
        return (
            BusEvent("turn", "cycle_turn_us", turn_us, "turn-around", transaction=kind),
            BusEvent("answer", "cycle_answer_us", self._wire_us(size), "answer", transaction=kind),
        )

    def _around(self, kind: _Kind, place: int, label: str) -> tuple[tuple[BusEvent, ...], tuple[BusEvent, ...]]:
        """What comes before the answers, idle time and request, and behind them, idle time and adapter."""
        exchange = self._exchange(kind, self.network.groups[place])
        after_us = self._times.after if exchange.is_answered else self._times.silent
        request_us = self._wire_us(exchange.request_bytes)
        before = (
            BusEvent("gap", "cycle_gap_us", self._times.before, "idle time before a request", transaction=kind),
            BusEvent("request", "cycle_request_us", request_us, label, transaction=kind),
        )
        after = BusEvent("gap", "cycle_gap_us", after_us, "idle time", transaction=kind)
        return before, (after, *(self._adapter_events(kind, place) if exchange.is_answered else ()))

    def _single(self, kind: _Kind, place: int) -> Run:
        """One request for each node of a group."""
        group = self.network.groups[place]
        exchange, (before, after) = self._exchange(kind, group), self._around(kind, place, f"{kind} request")
        answers = self._answer(kind, exchange.answer_bytes, group) if exchange.is_answered else ()
        rounds = _if_any(kind, group, group.nodes * self._times_a_cycle(kind))
        return Run((*before, *answers, *after), rounds, place)

    def _together(self, kind: _Kind, place: int) -> Iterator[Run]:
        """One request for all nodes of a group: all answer a read, in turn or in one telegram, and none a write."""
        group = self.network.groups[place]
        rounds = _if_any(kind, group, self._times_a_cycle(kind))
        exchange, (before, after) = self._exchange(kind, group), self._around(kind, place, f"{self.way} {kind}")
        answers = self._answer(kind, exchange.answer_bytes, group) if exchange.is_answered else ()
        if not answers or self.way == "fast-sync":
            yield Run((*before, *answers, *after), rounds)
            return
        yield Run(before, rounds)
        yield Run(answers, group.nodes * rounds, place)
        yield Run(after, rounds)

    def _answers(self, group: Group, kind: TransactionKind) -> Number:
        """Number of answers of a group's nodes in a cycle to requests of a kind [1]."""
        if self.way == "exchange":
            return group.nodes if kind == "read" else 0
        exchange, rounds = self._exchange(kind, group), self._times_a_cycle(kind)
        if not exchange.is_answered:
            return 0
        return _if_any(kind, group, rounds * (group.nodes if self.way == "single" else exchange.answers))

    def part_us(self, *, kind: str) -> float:
        """Time of the exchanges of a kind, "read", "write" or "exchange", in plain numbers [us]."""
        parts = (run._replace(events=tuple(e for e in run.events if e.transaction == kind)) for run in self.runs)
        return sum(us for part in parts for _, us in part.counted_us(part.times or 1))

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubts of turn-around and clocks, for all nodes together; and of the nodes' own time.

        The clocks of master and nodes count as one: a divider errs alike in all UARTs of a type.
        """
        groups, between = self.network.groups, self._times
        answers = total(self._answers(group, kind) for group in groups for kind in TRANSACTION_KINDS)
        half_us = 0.0 if self.is_typical else (between.longest_turn - between.typical_turn) / 2
        timed_us = total((*(self.by_term[key] for key in _BY_CLOCK), answers * self._turn_us))
        doubts = [
            Doubt("bus.max_turn_bits", "turn-around of a node", answers * half_us / 2),
            Doubt("bus.clock_tolerance", "clocks of the bit rate", timed_us * self._clock_tolerance / 3**0.5),
        ]
        doubts.append(Doubt("bus.host_us", "the host's own time", self.bus.host_doubt_us))
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

    def sync_jitter_us(self) -> Number:
        """Half of the master's jitter: all of a cycle moves with its start [us]."""
        return self.bus.master_jitter_us / 2

    def figures(self) -> Mapping[str, Number | None]:
        """The bit rate, and the least time of the adapter."""
        least_us = self._least.by_term["cycle_adapter_us"]
        return {RATE.key: self.bus.bit_rate_kbit_s, LEAST_ADAPTER.key: least_us}

    def loop_periods(self, *, at_sync: bool) -> int:
        """Periods inside a loop [1]: one more in an exchange, whose command uses the last cycle's feedback."""
        return int(at_sync) + int(self.way == "exchange")
