"""Traffic of a CAN network: who sends what, how often, and in which queue."""

from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache, reduce, wraps
from typing import Any, Concatenate, Final, Literal, NamedTuple, ParamSpec, TypeAlias, TypeVar, cast

from busplan.buses.can.equations import BASE_BITS, c, frame_us, share_bytes
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, Traced, choose, is_off, larger, pointwise, total
from busplan.sections.base import MAX_TIME_US, TRANSACTION_KINDS, TransactionKind
from busplan.sourced import constants_looked_up

FOLLOWS: Final = -1
"""Identifier of a PDO that follows the last one of the group before."""
SYNC: Final = "SYNC"
REPEATED: Final = "repeated frames"
HOST: Final = "host"
NODE: Final = "node"
"""Sender of a message that one of nodes that are alike sends; others are `HOST`, a group, or a device by its name."""
NOT_BY_PRIORITY: Final = ("fifo", "single-buffer")
"""Orders of a queue in which a message may wait for others of its sender, whatever their priority."""
Access: TypeAlias = Literal["sync", "polled", "burst"]
"""Protocol of a cycle: nodes send at SYNC, each at its own request (polled), or each at one of requests at once."""
LOOP: Final = "loop"
"""Name of the way from SYNC to the executed commands."""
NAMES: Final[dict[TransactionKind, str]] = {"read": "feedback", "write": "command"}
"""Names of a node's payloads on CAN, by transaction."""
_FIRST: Final = {"read": "FEEDBACK_IDENTIFIER", "write": "COMMAND_IDENTIFIER"}


class Pdos(NamedTuple):
    """PDOs of a group of nodes in one direction, in numbers of any sort."""

    kind: TransactionKind
    """Direction, as the profile's payload names it."""
    group: str
    """Name of the group; empty where all nodes are alike."""
    identifier: Number
    """Identifier of the first frame of the first PDO; `FOLLOWS` continues the group before."""
    number: Number
    """PDOs of all nodes of the group [1]."""
    payload_bytes: Number
    """Data of each PDO [bytes]."""
    frame_bytes: tuple[float, ...]
    """Most data of each frame of a PDO in their order; further frames are as the last [bytes]."""
    most_bytes: int
    """Most data of all frames of a PDO [bytes]."""
    every: Number = 1
    """Cycles from one PDO to the next, counted from the same SYNC for all [1]."""

    @property
    def name(self) -> str:
        """Direction on CAN: feedback or command."""
        return NAMES[self.kind]


class Message(NamedTuple):
    """A message beside SYNC and PDOs, in numbers of any sort."""

    name: str
    identifier: Number
    """Identifier of its first sender."""
    payload_bytes: Number
    """Data of a frame [bytes]."""
    period_us: Number
    """Shortest time between frames of a sender; of bursts the mean time, T [us]."""
    jitter_us: Number
    """Latest queueing behind the start, J [us]."""
    deadline_us: Number
    """Latest arrival behind the start, D; `NO_DEADLINE_US` without one [us]."""
    identifier_bits: Number = BASE_BITS
    """Length of the identifier [bits]."""
    senders: Number = 1
    """Nodes that send it, each with the identifier behind that of the node before [1]."""
    data_bit_rate_kbit_s: Number = 0.0
    """Data bit rate of an FD frame, without a switch the bit rate of the bus; 0 for a classical frame [kbit/s]."""
    burst: Number = 1
    """Frames of a sender that may come at once, b [1]."""

    def of_all(self, number: Number) -> Number:
        """A time, or a number, of each sender times the senders."""
        return number if is_off(self.senders - 1) else self.senders * number


_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")


def kept(
    function: "Callable[Concatenate[Traffic, _Given], _Result]",
) -> "Callable[Concatenate[Traffic, _Given], _Result]":
    """Decorator of a function of traffic that is computed once: the traffic keeps the result."""

    @wraps(function)
    def of_traffic(traffic: "Traffic", *given: _Given.args, **named: _Given.kwargs) -> _Result:
        key: Hashable = (function, given, *named.items())
        if key not in traffic.results:
            # A search is of plain numbers, and no step of a derivation.
            with constants_looked_up(None):
                traffic.results[key] = function(traffic, *given, **named)
        result: _Result = traffic.results[key]
        return result

    return cast("Callable[Concatenate[Traffic, _Given], _Result]", of_traffic)


@dataclass(frozen=True, eq=False, kw_only=True)
class Traffic:
    """Everything that is sent on a bus, in numbers of any sort; without PDOs messages alone.

    A search takes plain numbers: `ask` hands it the traffic of a point.
    """

    period_us: Number = MAX_TIME_US
    """Period of the cycle [us]."""
    bit_rate_kbit_s: Number
    """Nominal bit rate [kbit/s]."""
    data_bit_rate_kbit_s: Number = 0.0
    """Data bit rate of SYNC and PDOs as FD frames; 0 for classical frames [kbit/s]."""
    identifier_bits: Number = BASE_BITS
    """Length of the identifiers of SYNC and PDOs [bits]."""
    sync_identifier: Number = 0
    """Identifier of SYNC."""
    sync_bytes: Number = 0
    """Data of SYNC [bytes]."""
    read_us: Number = 0.0
    """Slowest execution of any node, from SYNC to its queued feedback [us]."""
    host_us: Number = 0.0
    """Host's time from the last feedback to the queued commands [us]."""
    adapter_us: Number = 0.0
    """Time of the host's adapter in the cycle [us]."""
    lag_us: Number = 0.0
    """Time of the adapter in the age of feedback and command that is in no cycle [us]."""
    sync_jitter_us: Number = 0.0
    """Latest queueing of SYNC behind the start of its period [us]."""
    error_period_us: Number = MAX_TIME_US
    """Time from one error on the wire to the next; of bursts the mean time [us]."""
    error_burst: Number = 0
    """Errors that may come at once, each of which repeats a frame; 0 without errors [1]."""
    late_bits: Number = 0.0
    """Nominal bits that each FD frame takes in addition [bits]."""
    clock_tolerance: Number = 0.0
    """Share by which bits may be longer than they should [1]."""
    pdos: tuple[Pdos, ...] = ()
    """PDOs, all feedback first."""
    messages: tuple[Message, ...] = ()
    """Messages beside SYNC and PDOs."""
    is_stuffed: bool = True
    """Whether frames have the stuff bits of the worst case, or none."""
    queues: frozenset[frozenset[tuple[str, str]]] = frozenset()
    """Streams by name and group whose frames share a queue that is not by priority."""
    access: Access = "sync"
    """Protocol of the cycle."""

    @property
    def has_cycle(self) -> bool:
        """Whether it has PDOs; messages alone have none."""
        return bool(self.pdos)

    @property
    def has_sync(self) -> bool:
        """Whether its cycle begins with SYNC."""
        return self.has_cycle and self.access == "sync"

    @cached_property
    def results(self) -> dict[Hashable, Any]:
        """Results of functions of this traffic, as `kept` keeps them."""
        return {}

    @property
    def requests(self) -> Number:
        """Requests of a cycle without SYNC, each with an answer [1]."""
        return total(pdos.number for pdos in self.pdos if pdos.kind == "write")

    @property
    def has_rates(self) -> bool:
        """Whether some PDOs are not in every cycle."""
        return not all(is_off(pdos.every - 1) for pdos in self.pdos)

    @cached_property
    def longest(self) -> "Traffic":
        """Traffic with the slowest oscillator, and FD frames as long as receivers accept; itself where all is so."""
        rates = self.data_bit_rate_kbit_s, *(message.data_bit_rate_kbit_s for message in self.messages)
        if is_off(self.clock_tolerance) and (self.late_bits or all(map(is_off, rates))):
            return self
        slower = 1 + self.clock_tolerance

        def slowed(rate_kbit_s: Number) -> Number:
            return rate_kbit_s if is_off(rate_kbit_s) else rate_kbit_s / slower

        messages = (
            message._replace(data_bit_rate_kbit_s=slowed(message.data_bit_rate_kbit_s)) for message in self.messages
        )
        return replace(
            self,
            bit_rate_kbit_s=slowed(self.bit_rate_kbit_s),
            data_bit_rate_kbit_s=slowed(self.data_bit_rate_kbit_s),
            messages=tuple(messages),
            late_bits=float(c.FD_LATE_BITS),
            clock_tolerance=0.0,
        )

    def frame_us(self, data_bytes: Number, form: "Traffic | Message") -> Number:
        """Time of a frame in the format of SYNC and PDOs, which is that of the traffic, or of a message [us]."""
        return frame_us(
            data_bytes,
            identifier_bits=form.identifier_bits,
            bit_rate_kbit_s=self.bit_rate_kbit_s,
            data_bit_rate_kbit_s=form.data_bit_rate_kbit_s,
            late_bits=self.late_bits,
            is_stuffed=self.is_stuffed,
        )

    def ask(self, function: Callable[..., Any], *arguments: Number, words: str) -> Number:
        """Result of a search over the traffic, in `words` for a derivation.

        The function takes traffic without traced numbers, and the arguments. It is called once where all order in the
        arbitration is plain, and else for each point alone: arrays of points differ then in their times only.
        """
        if self.is_ordered:
            result: Number = function(self, *arguments)
            return result
        return pointwise(lambda point, *more: function(self.at(point), *more), self.point, *arguments, words=words)

    @cached_property
    def is_ordered(self) -> bool:
        """Whether identifiers are plain, formats equal or plain, and no number traced."""
        order = [self.sync_identifier, *(pdos.identifier for pdos in self.pdos)]
        order += (message.identifier for message in self.messages)
        if not all(message.identifier_bits is self.identifier_bits for message in self.messages):
            order += (self.identifier_bits, *(message.identifier_bits for message in self.messages))
        return all(isinstance(number, int | float) for number in order) and not any(
            isinstance(number, Traced) for number in self._numbers
        )

    @cached_property
    def point(self) -> Number:
        """Number of each point, equal points alike; 0 for plain traffic."""
        points = self._points
        return pointwise(
            lambda *numbers: points.setdefault(numbers, len(points)), *self._numbers, words="all that is sent"
        )

    @cached_property
    def at(self) -> Callable[[float], "Traffic"]:
        """Function from the number of a point to the traffic of plain numbers there."""
        if isinstance(self.point, int):
            return lambda _: self
        points = tuple(self._points)
        return lru_cache(maxsize=1024)(lambda point: self._with_numbers(points[int(point)]))

    @cached_property
    def _points(self) -> dict[tuple[float, ...], int]:
        """Number of each point that differs from the others, by all its numbers."""
        return {}

    @cached_property
    def _numbers(self) -> tuple[Number, ...]:
        """All numbers in a row, as `_with_numbers` takes them."""
        cycle = (getattr(self, key) for key in _OF_CYCLE)
        pdos = (getattr(pdos, key) for pdos in self.pdos for key in _OF_PDOS)
        return (*cycle, *pdos, *(number for _, *numbers in self.messages for number in numbers))

    def _with_numbers(self, numbers: Iterable[Any]) -> "Traffic":
        """Traffic of the same senders in other numbers."""
        left = iter(numbers)
        cycle = {key: next(left) for key in _OF_CYCLE}
        pdos = [pdos._replace(**{key: next(left) for key in _OF_PDOS}) for pdos in self.pdos]
        messages = [Message(name, *(next(left) for _ in rest)) for name, *rest in self.messages]
        return replace(self, **cycle, pdos=tuple(pdos), messages=tuple(messages))


_OF_CYCLE: Final = tuple(field.name for field in fields(Traffic) if field.type is Number)
"""Fields of traffic that are a number."""
_OF_PDOS: Final = ("identifier", "number", "payload_bytes", "every")
"""Fields of PDOs that are a number."""


_LAST: Final[list[tuple[Network, Traffic]]] = []
"""The last networks and their traffic, the latest at the end."""
_REMEMBERED: Final = 4


def traffic_of(network: Network) -> Traffic:
    """Traffic of a network, with the stuff bits of the worst case.

    The last ones are remembered, for each limit of a network asks again. A network may hold arrays, so it is no key of
    a table and is told apart by identity.
    """
    found = next((pair for pair in reversed(_LAST) if pair[0] is network), None) or (network, _traffic_of(network))
    if not _LAST or _LAST[-1] is not found:
        _LAST[:] = [*(pair for pair in _LAST if pair is not found), found][-_REMEMBERED:]
    return found[1]


def _traffic_of(network: Network) -> Traffic:
    bus, groups, nodes = network.profile.bus, network.groups, network.nodes
    alone = Traffic(
        bit_rate_kbit_s=bus.bit_rate_kbit_s,
        data_bit_rate_kbit_s=0.0 if bus.data_bit_rate_kbit_s is None else bus.data_bit_rate_kbit_s,
        identifier_bits=bus.identifier_bits,
        # Exact clocks are no input of a derivation.
        clock_tolerance=_unless(bus.clock_tolerance, 0),
        error_period_us=MAX_TIME_US if bus.error_period_us is None else bus.error_period_us,
        error_burst=0 if bus.error_period_us is None else 1 if bus.error_burst is None else bus.error_burst,
        messages=tuple(_message(message, bus, nodes) for message in network.profile.message),
    )
    alone = replace(alone, queues=frozenset(_queues(network)))
    if not groups:
        return alone
    traffic = replace(
        alone,
        period_us=network.period_us,
        access=bus.access,
        pdos=tuple(
            _pdos(group, bus, kind, is_first=group is groups[0]) for kind in TRANSACTION_KINDS for group in groups
        ),
    )
    adapter_us = bus.write_us + bus.read_us
    if not traffic.has_sync:
        return replace(
            traffic,
            read_us=answer_us(groups, access=bus.access),
            host_us=traffic.requests * bus.host_us,
            adapter_us=adapter_us if bus.access == "burst" or is_off(adapter_us) else traffic.requests * adapter_us,
        )
    has_adapter = not is_off(adapter_us)
    return replace(
        traffic,
        adapter_us=choose(bus.pipeline_cycles > 0, 0.0, adapter_us) if has_adapter else 0.0,
        lag_us=choose(bus.pipeline_cycles > 0, adapter_us, 0.0) if has_adapter else 0.0,
        sync_identifier=bus.sync_identifier,
        sync_bytes=1 if bus.sync_counter else 0,
        # A punctual SYNC is no input of a derivation.
        sync_jitter_us=_unless(bus.sync_jitter_us, 0),
        read_us=reduce(larger, (group.slowest_us("read") for group in groups)),
        # Where the host computes in a cycle of its own, it takes no time of this one.
        host_us=choose(bus.pipeline_cycles > 0, 0.0, bus.host_us),
    )


def of_node(group: Group) -> Number:
    """PDOs of a node of a group in one direction [1]."""
    return larger(group.axes, 1) if group.payload.pdo_per == "axis" else 1


def answer_us(groups: Iterable[Group], *, access: Access, uncertainties: int = 0) -> Number:
    """Wait for nodes that answer requests: for all one by one (polled), or for the slowest (burst) [us].

    A node answers when it has executed the request, read and write side by side; some standard uncertainties are added
    to each execution.
    """
    each_us = [
        larger(
            group.read_execution_us + uncertainties * group.read_uncertainty_us,
            group.write_execution_us + uncertainties * group.write_uncertainty_us,
        )
        + group.worst_extra_us
        for group in groups
    ]
    if access == "burst":
        return reduce(larger, each_us)
    return total(group.nodes * of_node(group) * us for group, us in zip(groups, each_us, strict=True))


def _queues(network: Network) -> Iterator[frozenset[tuple[str, str]]]:
    """Streams that share a queue which is not by priority: messages of a sender, with each stream of its cycle.

    No PDO of a sender waits for another one of the same cycle: each stream of the cycle has a queue with the messages.
    """
    profile, groups = network.profile, network.groups
    group_of = {member.name or NODE: group for group in groups for member in group.members}
    sent: dict[str, set[tuple[str, str]]] = {}
    for message in profile.message:
        for sender in group_of if message.per_node else (message.sender,):
            order = group_of[sender].node.queue if sender in group_of else None
            if sender is not None and (order or profile.bus.queue) in NOT_BY_PRIORITY:
                sent.setdefault(sender, set()).add((message.name, ""))
    for sender, messages in sent.items():
        cycle = [(NAMES["read"], group_of[sender].name)] if sender in group_of else []
        if sender == HOST and groups:
            cycle = [(SYNC, ""), *((NAMES["write"], group.name) for group in groups)]
        yield from (frozenset({stream, *messages}) for stream in cycle)
        yield frozenset(messages)


def _pdos(group: Group, bus: Any, kind: TransactionKind, *, is_first: bool) -> Pdos:
    payload = group.payload
    identifier = getattr(payload, f"{NAMES[kind]}_identifier")
    if identifier is None:
        identifier = int(c[_FIRST[kind]]) if is_first else FOLLOWS
    number = of_node(group)
    payload_bytes = share_bytes(group.bytes_of(kind), pdos=number)
    frame_bytes = (c.FRAME_BYTES if bus.data_bit_rate_kbit_s is None else c.FD_FRAME_BYTES,)
    # No PDOs have no lengths.
    lengths = getattr(payload, f"{NAMES[kind]}_pdos") or None
    return Pdos(
        kind,
        group.name,
        identifier,
        group.nodes * number,
        payload_bytes,
        frame_bytes=frame_bytes if lengths is None else lengths,
        most_bytes=int(c.MOST_PDOS * frame_bytes[0]) if lengths is None else sum(lengths),
        every=payload.every,
    )


def _message(message: Any, bus: Any, nodes: Number) -> Message:
    return Message(
        message.name,
        message.identifier + 1 if message.per_node else message.identifier,
        message.payload_bytes,
        message.period_us,
        message.jitter_us,
        _deadline_us(message),
        bus.identifier_bits if message.identifier_bits is None else message.identifier_bits,
        nodes if message.per_node else 1,
        0.0 if not message.fd else bus.data_bit_rate_kbit_s if message.brs else bus.bit_rate_kbit_s,
        # A burst of one is none.
        _unless(message.burst, 1),
    )


NO_DEADLINE_US: Final = 1e12
"""Deadline of a message that has none [us]: more than any other, and finite, for it is divided by periods."""


def _deadline_us(message: Any) -> Number:
    deadline_us: Number | Literal["none"] | None = message.deadline_us
    if isinstance(deadline_us, str):
        return NO_DEADLINE_US
    period_us: Number = message.period_us
    return period_us if deadline_us is None else deadline_us


def _unless(number: Number, none: int) -> Number:
    """A number; what says nothing is no input of a derivation."""
    return none if isinstance(number, Traced) and number.value == none else number
