"""All that a network sends: SYNC, the PDOs of its nodes, and other messages."""

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, lru_cache, reduce
from itertools import islice
from operator import is_
from typing import Any, Final, NamedTuple

from busplan.buses.can.constants import (
    BASE_BITS,
    COMMAND_IDENTIFIER,
    FD_FRAME_BYTES,
    FEEDBACK_IDENTIFIER,
    FRAME_BYTES,
    MOST_PDOS,
)
from busplan.buses.can.equations import share_bytes
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, Traced, choose, is_off, larger, pointwise
from busplan.sections.base import MAX_TIME_US
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

FOLLOWS: Final = -1
"""Instead of an identifier: the next behind those of the group before."""
SYNC: Final = "SYNC"
LOOP: Final = "loop"
"""Name of the way from SYNC to the executed commands."""
NAMES: Final[dict[TransactionKind, str]] = {"read": "feedback", "write": "command"}
"""Names of a node's read payload and its write payload on CAN."""
_FIRST: Final = {"read": FEEDBACK_IDENTIFIER, "write": COMMAND_IDENTIFIER}


class Pdos(NamedTuple):
    """PDOs of a group of nodes in one direction. The numbers may be of any sort."""

    kind: TransactionKind
    group: str
    identifier: Number
    """Of the first frame of the first PDO; `FOLLOWS` for the next behind those of the group before."""
    pdos: Number
    """PDOs of all its nodes [1]."""
    payload_bytes: Number
    """Of each PDO [bytes]."""
    frame_bytes: tuple[float, ...] = (FRAME_BYTES,)
    """Most data of each of its frames in their order; further ones are as the last [bytes]."""
    most_bytes: int = int(MOST_PDOS * FRAME_BYTES)
    """The most that its frames may carry [bytes]."""
    every: Number = 1
    """Cycles from one to the next; all count from the same SYNC [1]."""

    @property
    def name(self) -> str:
        """Name: feedback or command."""
        return NAMES[self.kind]


class Message(NamedTuple):
    """A message beside SYNC and PDOs. The numbers may be of any sort."""

    name: str
    identifier: Number
    payload_bytes: Number
    period_us: Number
    jitter_us: Number
    deadline_us: Number
    identifier_bits: Number = BASE_BITS
    senders: Number = 1
    """Nodes that send it, each with the identifier behind that of the node before [1]."""
    data_bit_rate_kbit_s: Number = 0.0
    """Of an FD frame, that of the bus where it does not switch; 0 for a classical frame."""
    burst: Number = 1
    """Frames that may come at once [1]."""


class MessageList(tuple[Message, ...]):  # noqa: SLOT001 - a tuple's subclass with slots holds no attribute
    """Messages of a network. What rests on them alone is computed once for all networks that have them."""

    @cached_property
    def _hash(self) -> int:
        return tuple.__hash__(self)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """All their numbers in a row."""
        return tuple(number for message in self for number in message[_MESSAGE_WORDS:])

    @cached_property
    def is_plain(self) -> bool:
        """Whether all their numbers are plain."""
        return all(isinstance(number, int | float) for number in self.numbers)

    @cached_property
    def timeless(self) -> "MessageList":
        """The same with all times alike, which identifiers do not rest on."""
        return MessageList(
            message._replace(period_us=1.0, jitter_us=0.0, deadline_us=1.0, data_bit_rate_kbit_s=0.0, burst=1)
            for message in self
        )


class Traffic(NamedTuple):
    """All that is sent. The numbers may be of any sort."""

    period_us: Number
    bit_rate_kbit_s: Number
    data_bit_rate_kbit_s: Number
    """Of SYNC and PDOs as FD frames; 0 where they are classical."""
    identifier_bits: Number
    sync_identifier: Number
    sync_bytes: Number
    read_us: Number
    """The slowest execution of any node, from SYNC to its queued feedback [us]."""
    host_us: Number
    """From the last feedback to the queued commands [us]."""
    pdos: tuple[Pdos, ...]
    messages: MessageList

    @property
    def is_plain(self) -> bool:
        """Whether all its numbers are plain."""
        return self.messages.is_plain and all(isinstance(number, int | float) for number in self._own())

    @property
    def has_cycle(self) -> bool:
        """Whether it has SYNC and PDOs; messages alone have none."""
        return bool(self.pdos)

    @property
    def has_rates(self) -> bool:
        """Whether some PDOs are not in every cycle."""
        return not all(is_off(pdos.every - 1) for pdos in self.pdos)

    def numbers(self) -> tuple[Number, ...]:
        """All its numbers in a row, as `with_numbers` takes them."""
        return (*self._own(), *self.messages.numbers)

    def _own(self) -> tuple[Number, ...]:
        """Its numbers without those of messages."""
        pdos = (getattr(pdos, key) for pdos in self.pdos for key in _OF_PDOS)
        own: tuple[Any, ...] = self[:_OWN_NUMBERS]
        return (*own, *pdos)

    def with_numbers(self, *numbers: Number) -> "Traffic":
        """The same senders with other numbers, in the order of `numbers`."""
        rest: Iterator[Any] = iter(numbers)
        own = tuple(islice(rest, _OWN_NUMBERS))
        pdos = tuple(
            pdos._replace(**dict(zip(_OF_PDOS, islice(rest, len(_OF_PDOS)), strict=True))) for pdos in self.pdos
        )
        messages = self.messages
        if not messages.is_plain:
            count = len(Message._fields) - _MESSAGE_WORDS
            messages = MessageList(Message(message.name, *islice(rest, count)) for message in messages)
        return Traffic._make((*own, pdos, messages))


_OWN_NUMBERS: Final = len(Traffic._fields) - 2
"""Fields before the PDOs and the messages."""
_OF_PDOS: Final = ("identifier", "pdos", "payload_bytes", "every")
_MESSAGE_WORDS: Final = 1
"""Fields of words, which stand before the numbers."""


class Sent:
    """Traffic whose numbers may be of any sort, to be asked with functions that put its senders in order.

    Parameters
    ----------
    traffic
        What is sent.
    """

    def __init__(self, traffic: Traffic) -> None:
        self.traffic = traffic
        self._known: Callable[[int], Traffic]

    def of(self, function: Callable[..., Any], *arguments: Number, words: str) -> Number:
        """Result of a function of the traffic.

        Parameters
        ----------
        function
            Takes traffic of plain numbers and arrays, with plain identifiers and sizes of messages, and `arguments`. It
            is called once, or for each point alone where those vary or a derivation is recorded.
        arguments
            Arguments behind the traffic.
        words
            What a derivation says of it.
        """
        if self.is_ordered:
            result: Number = function(self.traffic, *arguments)
            return result
        return self.of_points(function, *arguments, words=words)

    def of_points(self, function: Callable[..., float], *arguments: Number, words: str) -> Number:
        """Result of a function of traffic of plain numbers, point by point; arguments as `of` has them."""
        return pointwise(lambda at, *more: function(self.at(at), *more), self.place, *arguments, words=words)

    def at(self, place: float) -> Traffic:
        """The traffic of plain numbers at a place."""
        return self._known(int(place))

    @cached_property
    def is_ordered(self) -> bool:
        """Whether identifiers and sizes of messages are plain, formats alike or plain, and no number is traced."""
        traffic = self.traffic
        if traffic.is_plain:
            return True
        messages = (number for message in traffic.messages for number in (message.identifier, message.payload_bytes))
        order = [traffic.sync_identifier, *(pdos.identifier for pdos in traffic.pdos), *messages]
        if not all(message.identifier_bits is traffic.identifier_bits for message in traffic.messages):
            order += (traffic.identifier_bits, *(message.identifier_bits for message in traffic.messages))
        if not all(is_off(message.data_bit_rate_kbit_s) for message in traffic.messages):
            # Which of an FD frame and any other frame is longer rests on the rates and the format.
            order += (traffic.bit_rate_kbit_s, traffic.data_bit_rate_kbit_s, traffic.identifier_bits)
        return all(isinstance(number, int | float) for number in order) and not any(
            isinstance(number, Traced) for number in traffic.numbers()
        )

    @cached_property
    def place(self) -> Number:
        """The place of the traffic of each point; points that are alike share it."""
        if self.traffic.is_plain:
            self._known = lambda _: self.traffic
            return 0
        places: dict[tuple[float, ...], int] = {}
        place = pointwise(
            lambda *numbers: places.setdefault(numbers, len(places)), *self.traffic.numbers(), words="all that is sent"
        )
        rows = tuple(places)
        self._known = lru_cache(maxsize=1024)(lambda at: self.traffic.with_numbers(*rows[at]))
        return place


class _Senders(NamedTuple):
    """Nodes that send alike, as a network or a profile has them."""

    name: str
    payload: Any
    pdos: Number
    """PDOs of all its nodes in either direction [1]."""
    pdos_each: Number
    """PDOs of a node in either direction [1]."""
    payloads_bytes: tuple[Number, ...]
    """Of a node, in the order of `TRANSACTION_KINDS` [bytes]."""
    read_us: Number
    """Slowest execution of a read [us]."""


def _pdos_each(payload: Any, axes: Number) -> Number:
    """PDOs of a node in either direction [1]."""
    return larger(axes, 1) if payload.pdo_per == "axis" else 1


def pdos_of(group: Group) -> Number:
    """PDOs of all nodes of a group in either direction [1]."""
    return group.nodes * _pdos_each(group.said.payload, group.axes)


_last: tuple[Network, Traffic] | None = None


def traffic_of(network: Network) -> Traffic:
    """Traffic of a network. The last result is remembered, for every limit of a network asks for it."""
    global _last  # noqa: PLW0603 - a network may hold arrays, and is told apart by identity alone
    if _last is None or _last[0] is not network:
        senders = [
            _Senders(
                group.name,
                group.said.payload,
                pdos_of(group),
                _pdos_each(group.said.payload, group.axes),
                (group.read_bytes, group.write_bytes),
                group.read_execution_us + group.worst_extra_us,
            )
            for group in network.groups
        ]
        _last = network, _traffic(network.profile, senders, network.period_us, network.nodes)
    return _last[1]


def traffic_of_profile(profile: Any) -> Traffic:
    """Traffic of a profile with plain numbers, each of its groups by itself."""
    senders = []
    for nodes in profile.alike_nodes:
        payloads_bytes = tuple(nodes.bytes_of(kind) for kind in TRANSACTION_KINDS)
        each, execution = _pdos_each(nodes.payload, nodes.node.axes), nodes.node.execution
        read_us = execution.execution_us(payloads_bytes[0]) + execution.worst_extra_us
        senders.append(_Senders(nodes.name, nodes.payload, nodes.nodes * each, each, payloads_bytes, read_us))
    return _traffic(profile, senders, profile.cycle.period_us, sum(alike.nodes for alike in profile.alike_nodes))


def without_times(traffic: Traffic) -> Traffic:
    """Traffic of the same identifiers, with all times alike: over arrays of times they are computed once."""
    if traffic.is_plain:
        return traffic
    own = traffic._replace(period_us=1.0, bit_rate_kbit_s=1.0, data_bit_rate_kbit_s=0.0, read_us=0.0, host_us=0.0)
    return own._replace(messages=traffic.messages.timeless)


def host_us(bus: Any) -> Number:
    """The host's own time within the cycle: none where it computes in a cycle of its own [us].

    Parameters
    ----------
    bus
        Section [bus]; its numbers may be of any sort.
    """
    return choose(bus.pipeline_cycles > 0, 0.0, bus.host_us)


def _traffic(profile: Any, senders: Sequence[_Senders], period_us: Number, nodes: Number) -> Traffic:
    bus = profile.bus
    alone = Traffic(
        period_us=MAX_TIME_US,
        bit_rate_kbit_s=bus.bit_rate_kbit_s,
        data_bit_rate_kbit_s=0.0 if bus.data_bit_rate_kbit_s is None else bus.data_bit_rate_kbit_s,
        identifier_bits=bus.identifier_bits,
        sync_identifier=0,
        sync_bytes=0,
        read_us=0.0,
        host_us=0.0,
        pdos=(),
        messages=_messages(profile.message, bus, nodes),
    )
    if not senders:
        return alone
    return alone._replace(
        period_us=period_us,
        sync_identifier=bus.sync_identifier,
        sync_bytes=1 if bus.sync_counter else 0,
        read_us=reduce(larger, (sender.read_us for sender in senders)),
        host_us=host_us(bus),
        pdos=tuple(
            _pdos(sender, bus, kind, number, is_first=not place)
            for number, kind in enumerate(TRANSACTION_KINDS)
            for place, sender in enumerate(senders)
        ),
    )


_known: tuple[tuple[Any, ...], MessageList, bool] | None = None
"""What messages rest on, the messages, and whether they rest on the number of nodes."""


def _messages(said: tuple[Any, ...], bus: Any, nodes: Number) -> MessageList:
    """Messages of a profile. The last result is remembered: searches change the nodes and times of a network."""
    global _known  # noqa: PLW0603 - a profile may hold arrays, and is told apart by identity alone
    key = nodes, bus.identifier_bits, bus.bit_rate_kbit_s, bus.data_bit_rate_kbit_s, *said
    if _known is not None and len(key) == len(_known[0]):
        has_same_nodes, *rest_same = map(is_, key, _known[0])
        if all(rest_same) and (has_same_nodes or not _known[2]):
            return _known[1]
    messages = MessageList(_message(message, bus, nodes) for message in said)
    _known = key, messages, any(message.per_node for message in said)
    return messages


def _pdos(sender: _Senders, bus: Any, kind: TransactionKind, number: int, *, is_first: bool) -> Pdos:
    identifier = getattr(sender.payload, f"{NAMES[kind]}_identifier")
    if identifier is None:
        identifier = int(_FIRST[kind]) if is_first else FOLLOWS
    payload_bytes = share_bytes(sender.payloads_bytes[number], pdos=sender.pdos_each)
    pdos = Pdos(kind, sender.name, identifier, sender.pdos, payload_bytes, every=sender.payload.every)
    lengths = getattr(sender.payload, f"{NAMES[kind]}_pdos")
    if lengths is not None:
        return pdos._replace(frame_bytes=lengths, most_bytes=sum(lengths))
    if bus.data_bit_rate_kbit_s is None:
        return pdos
    return pdos._replace(frame_bytes=(FD_FRAME_BYTES,), most_bytes=int(MOST_PDOS * FD_FRAME_BYTES))


def _message(said: Any, bus: Any, nodes: Number) -> Message:
    deadline_us = said.period_us if said.deadline_us is None else said.deadline_us
    return Message(
        said.name,
        said.identifier + 1 if said.per_node else said.identifier,
        said.payload_bytes,
        said.period_us,
        said.jitter_us,
        deadline_us,
        bus.identifier_bits if said.identifier_bits is None else said.identifier_bits,
        nodes if said.per_node else 1,
        0.0 if not said.fd else bus.data_bit_rate_kbit_s if said.brs else bus.bit_rate_kbit_s,
        said.burst,
    )
