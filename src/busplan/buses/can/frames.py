"""The frames of a CAN network: who sends them, how often, and with what priority."""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache, reduce
from itertools import accumulate, chain, combinations, islice, product, repeat
from math import inf
from typing import Any, Final, NamedTuple, TypeAlias

from busplan.buses.can.equations import (
    BASE_BITS,
    COMMAND_IDENTIFIER,
    FD_FRAME_BYTES,
    FEEDBACK_IDENTIFIER,
    FRAME_BYTES,
    MAX_IDENTIFIER,
    MOST_PDOS,
    PDO_STEP,
    frame_us,
    share_bytes,
)
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, Traced, choose, is_off, larger, plain, pointwise, smaller
from busplan.sections.base import MAX_TIME_US, TRANSACTION_KINDS, TransactionKind

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
    return group.nodes * _pdos_each(group.payload, group.axes)


_last: tuple[Network, Traffic] | None = None


def traffic_of(network: Network) -> Traffic:
    """Traffic of a network. The last result is remembered, for every limit of a network asks for it."""
    global _last  # noqa: PLW0603 - a network may hold arrays, and is told apart by identity alone
    if _last is None or _last[0] is not network:
        senders = [
            _Senders(
                group.name,
                group.payload,
                pdos_of(group),
                _pdos_each(group.payload, group.axes),
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
    for nodes in profile.node_groups:
        payloads_bytes = tuple(nodes.bytes_of(kind) for kind in TRANSACTION_KINDS)
        each, execution = _pdos_each(nodes.payload, nodes.node.axes), nodes.node.execution
        read_us = execution.execution_us(payloads_bytes[0]) + execution.worst_extra_us
        senders.append(_Senders(nodes.name, nodes.payload, nodes.nodes * each, each, payloads_bytes, read_us))
    return _traffic(profile, senders, profile.cycle.period_us, sum(alike.nodes for alike in profile.node_groups))


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


Points: TypeAlias = Any
"""A plain number, or an array of a number for each point; never a traced number."""


def place(identifier: Points, identifier_bits: Points) -> Points:
    """Place of an identifier in the arbitration, which the smallest wins.

    The first 11 bits decide; of equal ones the base frame goes before all extended ones. Formats that vary from point
    to point are alike for all frames: then the identifiers are their own places.
    """
    if not isinstance(identifier_bits, int | float):
        return identifier
    return identifier * _BEHIND if identifier_bits == BASE_BITS else 2 * identifier + 1


_BEHIND: Final = 2 * (MAX_IDENTIFIER[29] + 1) // (MAX_IDENTIFIER[BASE_BITS] + 1)
"""Places of extended identifiers with the same first 11 bits, and between them."""


class Stream(NamedTuple):
    """Frames of the same sort, with identifiers in sequence. The identifiers that order them are plain."""

    name: str
    group: str
    block: int
    """Place from which on the first group has them: a message in a block that grows stays behind it."""
    first: Points
    identifiers: Points
    """Number of identifiers; each sends once in a period [1]."""
    data_bytes: Points
    frame_us: Points
    period_us: Points
    jitter_us: Points
    deadline_us: Points
    identifier_bits: Points
    is_message: bool = False
    is_end: bool = True
    """Whether the PDO, or the message, is complete with it."""
    burst: Points = 1
    """Frames of each identifier that may come at once [1]."""

    @property
    def last(self) -> Points:
        """The last identifier."""
        return self.first + self.identifiers - 1

    @property
    def first_place(self) -> Points:
        """Place of the first identifier in the arbitration."""
        return place(self.first, self.identifier_bits)

    @property
    def last_place(self) -> Points:
        """Place of the last identifier in the arbitration."""
        return place(self.last, self.identifier_bits)

    @property
    def label(self) -> str:
        """Name beside other streams, with its group."""
        return f"{self.group} {self.name}" if self.group else self.name

    @property
    def frames_us(self) -> Points:
        """A frame of each identifier [us]."""
        return self.identifiers * self.frame_us

    @property
    def burst_us(self) -> Points:
        """Frames that come at once beside the first of each identifier [us]."""
        return (self.burst - 1) * self.frames_us


@lru_cache(maxsize=4)
def streams(traffic: Traffic, *, is_stuffed: bool) -> tuple[Stream, ...]:
    """Every stream of a network: SYNC, feedback, command, and other messages.

    Parameters
    ----------
    traffic
        What it sends, as `Traffic.ask` gives it.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    """
    messages = (_of_message(message, traffic.bit_rate_kbit_s, is_stuffed) for message in traffic.messages)
    return (*_cyclic(traffic, is_stuffed), *messages)


def _of_message(message: Message, bit_rate_kbit_s: Points, is_stuffed: bool) -> Stream:
    first, bits = int(plain(message.identifier)), message.identifier_bits
    us = frame_us(
        message.payload_bytes,
        identifier_bits=bits,
        bit_rate_kbit_s=bit_rate_kbit_s,
        data_bit_rate_kbit_s=message.data_bit_rate_kbit_s,
        is_stuffed=is_stuffed,
    )
    return Stream(
        message.name,
        group="",
        block=place(first, bits),
        first=first,
        identifiers=_whole(message.senders),
        data_bytes=_whole(message.payload_bytes),
        frame_us=us,
        period_us=message.period_us,
        jitter_us=message.jitter_us,
        deadline_us=message.deadline_us,
        identifier_bits=bits,
        is_message=True,
        burst=message.burst,
    )


def _cyclic(traffic: Traffic, is_stuffed: bool) -> Iterator[Stream]:
    """SYNC and all PDOs; none of messages alone."""
    if not traffic.has_cycle:
        return

    def sent(name: str, block: int, size: Points, every: Points = 1, **more: Any) -> Stream:
        us = frame_us(
            size,
            identifier_bits=traffic.identifier_bits,
            bit_rate_kbit_s=traffic.bit_rate_kbit_s,
            data_bit_rate_kbit_s=traffic.data_bit_rate_kbit_s,
            is_stuffed=is_stuffed,
        )
        own: dict[str, Any] = {"group": "", "first": block, "identifiers": 1, **more}
        return Stream(
            name,
            block=place(block, traffic.identifier_bits),
            data_bytes=size,
            frame_us=us,
            period_us=traffic.period_us * every,
            jitter_us=0.0,
            deadline_us=traffic.period_us,
            identifier_bits=traffic.identifier_bits,
            **own,
        )

    yield sent(SYNC, int(plain(traffic.sync_identifier)), _whole(traffic.sync_bytes))
    block = {"read": FOLLOWS, "write": FOLLOWS}
    free: dict[str, Points] = dict(block)
    for pdos in traffic.pdos:
        said, count = int(plain(pdos.identifier)), _whole(pdos.pdos)
        first = free[pdos.kind] if said == FOLLOWS else said
        if said != FOLLOWS:
            block[pdos.kind] = said
        free[pdos.kind] = first + count
        frames, left_bytes = _most_frames(pdos), _whole(pdos.payload_bytes)
        for number, most_bytes in enumerate(islice(_most_bytes(pdos), frames)):
            step = number * int(PDO_STEP)
            own = sent(
                pdos.name,
                block[pdos.kind] + step,
                larger(smaller(left_bytes, most_bytes), 0),
                pdos.every,
                group=pdos.group,
                first=first + step,
                identifiers=count,
                is_end=number == frames - 1,
            )
            is_there = left_bytes > 0  # not at every point of an array
            yield own._replace(identifiers=choose(is_there, count, 0), frame_us=choose(is_there, own.frame_us, 0.0))
            left_bytes = left_bytes - most_bytes


def _most_bytes(pdos: Pdos) -> Iterator[int]:
    """The most data of each frame of a PDO, without end [bytes]."""
    return map(int, chain(pdos.frame_bytes, repeat(pdos.frame_bytes[-1])))


def _most_frames(pdos: Pdos) -> int:
    """Frames of a PDO that have streams, the most at any point."""
    payload: Any = pdos.payload_bytes
    most_bytes = int(payload.max() if hasattr(payload, "max") else payload)
    return sum(1 for before in islice(accumulate(_most_bytes(pdos), initial=0), _MOST_FRAMES) if before < most_bytes)


def frame_sizes(pdos: Pdos) -> Iterator[int]:
    """Data of each frame of a PDO of plain numbers, of which there may be billions [bytes]."""
    left_bytes = int(plain(pdos.payload_bytes))
    for most_bytes in _most_bytes(pdos):
        if left_bytes <= 0:
            return
        yield min(left_bytes, most_bytes)
        left_bytes -= most_bytes


_MOST_FRAMES: Final = int(MOST_PDOS) + 1
"""Frames of a PDO that have streams: one more than a bus allows breaks its limit already."""


def _whole(number: Points) -> Points:
    """A number that is whole, as an int where it is plain."""
    return int(number) if isinstance(number, int | float) else number


def last_identifier(each: Iterable[Stream]) -> Points:
    """The largest identifier of some streams; 0 of none."""
    none: Points = 0
    return reduce(larger, (choose(stream.identifiers > 0, stream.last, 0) for stream in each), none)


def last_place(each: Iterable[Stream]) -> Points:
    """Place of the last identifier of some streams in the arbitration."""
    return reduce(larger, (choose(stream.identifiers > 0, stream.last_place, 0) for stream in each))


def identifiers_twice(traffic: Traffic) -> Points:
    """Number of identifiers that stand twice or more often [1].

    Parameters
    ----------
    traffic
        What is sent, as `Traffic.ask` gives it.
    """
    each = streams(traffic, is_stuffed=True)
    fixed = [stream for stream in each if isinstance(stream.last, int)]
    varied = [stream for stream in each if not isinstance(stream.last, int)]
    twice: Points = sum(shared for *_, shared in collisions(fixed))
    for early, late in chain(combinations(varied, 2), product(varied, fixed)):
        if has_format(early, late.identifier_bits):
            twice = twice + larger(smaller(early.last, late.last) - larger(early.first, late.first) + 1, 0)
    return twice


def has_format(stream: Stream, identifier_bits: Points) -> bool:
    """Whether a stream has identifiers of a length; lengths that vary from point to point are alike."""
    bits = stream.identifier_bits, identifier_bits
    return bits[0] is bits[1] or not all(isinstance(length, int | float) for length in bits) or bits[0] == bits[1]


def collisions(each: Sequence[Stream]) -> Iterator[tuple[Stream, Stream, int, int]]:
    """Pairs of streams of plain numbers that share identifiers, with the first they share, and how many."""
    ordered = sorted((int(plain(stream.first)), place) for place, stream in enumerate(each))
    pairs = [
        sorted((place, behind))
        for number, (_, place) in enumerate(ordered)
        for _, behind in ordered[number + 1 : bisect_right(ordered, (each[place].last, inf), number)]
    ]
    for early, late in sorted(pair for pair in pairs if has_format(each[pair[0]], each[pair[1]].identifier_bits)):
        first = max(each[early].first, each[late].first)
        yield each[early], each[late], first, min(each[early].last, each[late].last) - first + 1
