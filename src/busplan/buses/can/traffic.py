"""All that a network sends: SYNC, the PDOs of its nodes, and other messages."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache, reduce
from itertools import islice
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Traffic:
    """All that is sent. The numbers may be of any sort. Without PDOs it is messages alone."""

    period_us: Number = MAX_TIME_US
    bit_rate_kbit_s: Number
    data_bit_rate_kbit_s: Number = 0.0
    """Of SYNC and PDOs as FD frames; 0 where they are classical."""
    identifier_bits: Number = BASE_BITS
    sync_identifier: Number = 0
    sync_bytes: Number = 0
    read_us: Number = 0.0
    """The slowest execution of any node, from SYNC to its queued feedback [us]."""
    host_us: Number = 0.0
    """From the last feedback to the queued commands [us]."""
    pdos: tuple[Pdos, ...] = ()
    messages: tuple[Message, ...] = ()

    @property
    def has_cycle(self) -> bool:
        """Whether it has SYNC and PDOs; messages alone have none."""
        return bool(self.pdos)

    @property
    def has_rates(self) -> bool:
        """Whether some PDOs are not in every cycle."""
        return not all(is_off(pdos.every - 1) for pdos in self.pdos)

    def ask(self, function: Callable[..., Any], *arguments: Number, words: str) -> Number:
        """Result of a function of the traffic.

        Parameters
        ----------
        function
            Takes traffic of plain numbers and arrays, with plain identifiers, and `arguments`. It is called once, or
            for each point alone where identifiers vary or a derivation is recorded.
        arguments
            Arguments behind the traffic.
        words
            What a derivation says of it.
        """
        if self.is_ordered:
            result: Number = function(self, *arguments)
            return result
        return self.ask_points(function, *arguments, words=words)

    def ask_points(self, function: Callable[..., float], *arguments: Number, words: str) -> Number:
        """Result of a function of traffic of plain numbers, point by point; arguments as `ask` has them."""
        return pointwise(lambda at, *more: function(self.at(at), *more), self.place, *arguments, words=words)

    @cached_property
    def is_ordered(self) -> bool:
        """Whether identifiers are plain, formats alike or plain, and no number is traced."""
        order = [self.sync_identifier, *(pdos.identifier for pdos in self.pdos)]
        order += (message.identifier for message in self.messages)
        if not all(message.identifier_bits is self.identifier_bits for message in self.messages):
            order += (self.identifier_bits, *(message.identifier_bits for message in self.messages))
        return all(isinstance(number, int | float) for number in order) and not any(
            isinstance(number, Traced) for number in self._numbers
        )

    @cached_property
    def place(self) -> Number:
        """The place of the traffic of each point; points that are alike share it, and plain traffic has one."""
        places = self._places
        return pointwise(
            lambda *numbers: places.setdefault(numbers, len(places)), *self._numbers, words="all that is sent"
        )

    def at(self, place: float) -> "Traffic":
        """The traffic of plain numbers at a place."""
        return self if isinstance(self.place, int) else self._made(int(place))

    @cached_property
    def _places(self) -> dict[tuple[float, ...], int]:
        return {}

    @cached_property
    def _made(self) -> Callable[[int], "Traffic"]:
        rows = tuple(self._places)
        return lru_cache(maxsize=1024)(lambda place: self._with_numbers(iter(rows[place])))

    @cached_property
    def _numbers(self) -> tuple[Number, ...]:
        """All its numbers in a row, as `_with_numbers` takes them."""
        own = (getattr(self, key) for key in _OWN)
        pdos = (getattr(pdos, key) for pdos in self.pdos for key in _OF_PDOS)
        return (*own, *pdos, *(number for message in self.messages for number in message[_MESSAGE_WORDS:]))

    def _with_numbers(self, rest: Iterator[Any]) -> "Traffic":
        """The same senders with other numbers."""
        own = dict(zip(_OWN, islice(rest, len(_OWN)), strict=True))
        pdos = [each._replace(**dict(zip(_OF_PDOS, islice(rest, len(_OF_PDOS)), strict=True))) for each in self.pdos]
        count = len(Message._fields) - _MESSAGE_WORDS
        messages = (Message(each.name, *islice(rest, count)) for each in self.messages)
        return Traffic(**own, pdos=tuple(pdos), messages=tuple(messages))

    def without_times(self) -> "Traffic":
        """The same identifiers with all times alike, where a point is asked alone: alike points are computed once."""
        if self.is_ordered:
            return self
        messages = (
            each._replace(period_us=1.0, jitter_us=0.0, deadline_us=1.0, data_bit_rate_kbit_s=0.0, burst=1)
            for each in self.messages
        )
        return replace(
            self,
            period_us=1.0,
            bit_rate_kbit_s=1.0,
            data_bit_rate_kbit_s=0.0,
            read_us=0.0,
            host_us=0.0,
            messages=tuple(messages),
        )


_OWN: Final = tuple(field.name for field in fields(Traffic))[:-2]
"""Fields before the PDOs and the messages."""
_OF_PDOS: Final = ("identifier", "pdos", "payload_bytes", "every")
_MESSAGE_WORDS: Final = 1
"""Fields of words, which stand before the numbers."""


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
        bit_rate_kbit_s=bus.bit_rate_kbit_s,
        data_bit_rate_kbit_s=0.0 if bus.data_bit_rate_kbit_s is None else bus.data_bit_rate_kbit_s,
        identifier_bits=bus.identifier_bits,
        messages=tuple(_message(message, bus, nodes) for message in profile.message),
    )
    if not senders:
        return alone
    return replace(
        alone,
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
        # A burst of one is none, and no input of a derivation.
        1 if isinstance(said.burst, Traced) and said.burst.value == 1 else said.burst,
    )
