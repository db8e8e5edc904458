"""The frames of a CAN network: who sends them, how often, and with what priority."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache, reduce
from itertools import chain, islice, repeat
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from busplan.buses.can.equations import (
    BASE_BITS,
    MAX_IDENTIFIER,
    bit_us,
    c,
    frame_us,
    share_bytes,
)
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, Traced, choose, is_everywhere, is_off, larger, pointwise, smaller, total
from busplan.sections.base import MAX_TIME_US, TRANSACTION_KINDS, TransactionKind
from busplan.sourced import cached

FOLLOWS: Final = -1
"""Stands for the identifier after the last one of the group before."""
SYNC: Final = "SYNC"
REPEATED: Final = "repeated frames"
HOST: Final = "host"
NODE: Final = "node"
"""Sender that is one of nodes that are alike; others are `HOST`, a group, or another device by its name."""
NOT_BY_PRIORITY: Final = ("fifo", "single-buffer")
"""Orders of a queue in which a message may wait for others of its sender, whatever their priority."""
Access: TypeAlias = Literal["sync", "polled", "burst"]
"""How nodes come to send: all at SYNC, each at its request, one after another, or each at one of requests at once."""
LOOP: Final = "loop"
"""Name of the way from SYNC to the executed commands."""
NAMES: Final[dict[TransactionKind, str]] = {"read": "feedback", "write": "command"}
"""Names of a node's read payload and its write payload on CAN."""
_FIRST: Final = {"read": "FEEDBACK_IDENTIFIER", "write": "COMMAND_IDENTIFIER"}


class Pdos(NamedTuple):
    """PDOs of a group of nodes in one direction. The numbers may be of any sort."""

    kind: TransactionKind
    group: str
    identifier: Number
    """Identifier of the first frame of the first PDO; `FOLLOWS` continues the group before."""
    pdos: Number
    """PDOs of all its nodes [1]."""
    payload_bytes: Number
    """Data of each PDO [bytes]."""
    frame_bytes: tuple[float, ...]
    """Most data of each of its frames in their order; further ones are as the last [bytes]."""
    most_bytes: int
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
    """Data bit rate of an FD frame, without a switch the bit rate of the bus; 0 for a classical frame."""
    burst: Number = 1
    """Frames that may come at once [1]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Traffic:
    """All that is sent. The numbers may be of any sort. Without PDOs it is messages alone."""

    period_us: Number = MAX_TIME_US
    bit_rate_kbit_s: Number
    data_bit_rate_kbit_s: Number = 0.0
    """Data bit rate of SYNC and PDOs as FD frames; 0 for classical frames."""
    identifier_bits: Number = BASE_BITS
    sync_identifier: Number = 0
    sync_bytes: Number = 0
    read_us: Number = 0.0
    """The slowest execution of any node, from SYNC to its queued feedback [us]."""
    host_us: Number = 0.0
    """From the last feedback to the queued commands [us]."""
    sync_jitter_us: Number = 0.0
    """How late SYNC may be queued [us]."""
    error_period_us: Number = MAX_TIME_US
    """From one error on the wire to the next; of bursts the mean time [us]."""
    error_burst: Number = 0
    """Errors that may come at once, each of which repeats a frame; 0 without errors [1]."""
    late_bits: Number = 0.0
    """Nominal bits that each FD frame takes in addition [bits]."""
    clock_tolerance: Number = 0.0
    """How much longer bits may be than they should, a share [1]."""
    pdos: tuple[Pdos, ...] = ()
    messages: tuple[Message, ...] = ()
    is_stuffed: bool = True
    """Whether frames have the stuff bits of the worst case, or none."""
    queues: frozenset[frozenset[tuple[str, str]]] = frozenset()
    """Streams by name and group whose frames share a queue that is not by priority."""
    access: Access = "sync"
    """How nodes come to send."""

    @property
    def has_cycle(self) -> bool:
        """Whether it has PDOs; messages alone have none."""
        return bool(self.pdos)

    @property
    def has_sync(self) -> bool:
        """Whether its cycle begins with SYNC."""
        return self.has_cycle and self.access == "sync"

    @property
    def requests(self) -> Number:
        """Requests of a cycle without SYNC, each with an answer [1]."""
        return total(pdos.pdos for pdos in self.pdos if pdos.kind == "write")

    @property
    def has_rates(self) -> bool:
        """Whether some PDOs are not in every cycle."""
        return not all(is_off(pdos.every - 1) for pdos in self.pdos)

    @cached_property
    def longest(self) -> "Traffic":
        """The same with the slowest oscillator, and FD frames as long as receivers accept; itself where all is so."""
        rates = self.data_bit_rate_kbit_s, *(message.data_bit_rate_kbit_s for message in self.messages)
        if is_off(self.clock_tolerance) and (self.late_bits or all(map(is_off, rates))):
            return self
        slower = 1 + self.clock_tolerance
        messages = (
            message._replace(data_bit_rate_kbit_s=message.data_bit_rate_kbit_s / slower) for message in self.messages
        )
        return replace(
            self,
            bit_rate_kbit_s=self.bit_rate_kbit_s / slower,
            data_bit_rate_kbit_s=self.data_bit_rate_kbit_s / slower,
            messages=tuple(messages),
            late_bits=float(c.FD_LATE_BITS),
            clock_tolerance=0.0,
        )

    def frame_us(self, data_bytes: Number, form: "Traffic | Message") -> Number:
        """Time of a frame [us].

        Parameters
        ----------
        data_bytes
            Its data [bytes].
        form
            What gives its format: this traffic for SYNC and PDOs, or a message.
        """
        return frame_us(
            data_bytes,
            identifier_bits=form.identifier_bits,
            bit_rate_kbit_s=self.bit_rate_kbit_s,
            data_bit_rate_kbit_s=form.data_bit_rate_kbit_s,
            late_bits=self.late_bits,
            is_stuffed=self.is_stuffed,
        )

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
        return pointwise(lambda point, *more: function(self.at(point), *more), self.point, *arguments, words=words)

    @cached_property
    def is_ordered(self) -> bool:
        """Whether identifiers are plain, formats equal or plain, and no number is traced."""
        order = [self.sync_identifier, *(pdos.identifier for pdos in self.pdos)]
        order += (message.identifier for message in self.messages)
        if not all(message.identifier_bits is self.identifier_bits for message in self.messages):
            order += (self.identifier_bits, *(message.identifier_bits for message in self.messages))
        return all(isinstance(number, int | float) for number in order) and not any(
            isinstance(number, Traced) for number in self._numbers
        )

    @cached_property
    def point(self) -> Number:
        """Number of each point; equal points share theirs, and plain traffic has one."""
        points = self._points
        return pointwise(
            lambda *numbers: points.setdefault(numbers, len(points)), *self._numbers, words="all that is sent"
        )

    @cached_property
    def at(self) -> Callable[[float], "Traffic"]:
        """Function of the number of a point to its traffic of plain numbers."""
        if isinstance(self.point, int):
            return lambda _: self
        points = tuple(self._points)
        return lru_cache(maxsize=1024)(lambda point: self._with_numbers(points[int(point)]))

    @cached_property
    def _points(self) -> dict[tuple[float, ...], int]:
        """Numbers of all points that differ, each with its own number."""
        return {}

    @cached_property
    def _numbers(self) -> tuple[Number, ...]:
        """All its numbers in a row, as `_with_numbers` takes them."""
        cycle = (getattr(self, key) for key in _OF_CYCLE)
        pdos = (getattr(pdos, key) for pdos in self.pdos for key in _OF_PDOS)
        return (*cycle, *pdos, *(number for _, *numbers in self.messages for number in numbers))

    def _with_numbers(self, numbers: Iterable[Any]) -> "Traffic":
        """The same senders with other numbers."""
        left = iter(numbers)
        cycle = {key: next(left) for key in _OF_CYCLE}
        pdos = [pdos._replace(**{key: next(left) for key in _OF_PDOS}) for pdos in self.pdos]
        messages = [Message(name, *(next(left) for _ in rest)) for name, *rest in self.messages]
        return replace(self, **cycle, pdos=tuple(pdos), messages=tuple(messages))


_OF_CYCLE: Final = tuple(field.name for field in fields(Traffic))[:-5]
"""Its own numbers: fields before the PDOs and the messages."""
_OF_PDOS: Final = ("identifier", "pdos", "payload_bytes", "every")


_last: tuple[Network, Traffic] | None = None


def traffic_of(network: Network) -> Traffic:
    """Traffic of a network, stuffed. The last result is remembered, for every limit of a network asks for it."""
    global _last  # noqa: PLW0603 - a network may hold arrays, and is told apart by identity alone
    if _last is None or _last[0] is not network:
        _last = network, _traffic(network)
    return _last[1]


def _traffic(network: Network) -> Traffic:
    bus, groups = network.profile.bus, network.groups
    alone = Traffic(
        bit_rate_kbit_s=bus.bit_rate_kbit_s,
        data_bit_rate_kbit_s=0.0 if bus.data_bit_rate_kbit_s is None else bus.data_bit_rate_kbit_s,
        identifier_bits=bus.identifier_bits,
        # Exact clocks are no input of a derivation.
        clock_tolerance=_unless(bus.clock_tolerance, 0),
        error_period_us=MAX_TIME_US if bus.error_period_us is None else bus.error_period_us,
        error_burst=0 if bus.error_period_us is None else 1 if bus.error_burst is None else bus.error_burst,
        messages=tuple(_message(message, bus, network.nodes) for message in network.profile.message),
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
    if not traffic.has_sync:
        return replace(traffic, read_us=answer_us(groups, access=bus.access), host_us=traffic.requests * bus.host_us)
    return replace(
        traffic,
        sync_identifier=bus.sync_identifier,
        sync_bytes=1 if bus.sync_counter else 0,
        # A punctual SYNC is no input of a derivation.
        sync_jitter_us=_unless(bus.sync_jitter_us, 0),
        read_us=reduce(larger, (group.read_execution_us + group.worst_extra_us for group in groups)),
        # Where the host computes in a cycle of its own, it takes no time of this one.
        host_us=choose(bus.pipeline_cycles > 0, 0.0, bus.host_us),
    )


def of_node(group: Group) -> Number:
    """PDOs of a node of a group in one direction [1]."""
    return larger(group.axes, 1) if group.payload.pdo_per == "axis" else 1


def answer_us(groups: Iterable[Group], *, access: Access, uncertainties: int = 0) -> Number:
    """Waits for nodes in a cycle without SYNC: for all of them one by one, or for the slowest [us].

    Parameters
    ----------
    groups
        The nodes. They answer a request when they have executed it, read and write side by side.
    access
        "polled" or "burst".
    uncertainties
        Standard uncertainties of each execution that are added [1].
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

    Of a sender in the cycle no PDO waits for another of its own cycle: a queue of SYNC, or of PDOs, is one of its own.
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
    payload_bytes = share_bytes(group.read_bytes if kind == "read" else group.write_bytes, pdos=number)
    frame_bytes = (c.FRAME_BYTES if bus.data_bit_rate_kbit_s is None else c.FD_FRAME_BYTES,)
    lengths = getattr(payload, f"{NAMES[kind]}_pdos")
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
    burst: Points = 1
    """Frames of each identifier that may come at once [1]."""
    queue_place: Points | None = None
    """Place of the last identifier in its queue, where that is not by priority: it may wait behind that."""
    offered_us: Points = 0.0
    """Of a message in such a queue: the latest instant from which on it is the one that the queue offers [us]."""

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
    def end_place(self) -> Points:
        """Place in the arbitration up to which all frames may go before its last."""
        return self.last_place if self.queue_place is None else self.queue_place

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


@cached(maxsize=4)
def streams(traffic: Traffic) -> tuple[Stream, ...]:
    """Every stream of a network: SYNC, feedback, command, and other messages.

    Parameters
    ----------
    traffic
        What it sends, as `Traffic.ask` gives it.
    """
    sent = (*_cyclic(traffic), *(_of_message(message, traffic) for message in traffic.messages))
    for queue in traffic.queues:
        end = last_place(stream for stream in sent if (stream.name, stream.group) in queue)
        sent = tuple(
            stream._replace(queue_place=end if stream.queue_place is None else larger(stream.queue_place, end))
            if (stream.name, stream.group) in queue
            else stream
            for stream in sent
        )
    return sent


def _of_message(message: Message, traffic: Traffic) -> Stream:
    first = int(message.identifier)
    return Stream(
        message.name,
        group="",
        block=place(first, message.identifier_bits),
        first=first,
        identifiers=_whole(message.senders),
        data_bytes=_whole(message.payload_bytes),
        frame_us=traffic.frame_us(message.payload_bytes, message),
        period_us=message.period_us,
        jitter_us=message.jitter_us,
        deadline_us=message.deadline_us,
        identifier_bits=message.identifier_bits,
        is_message=True,
        burst=message.burst,
    )


def repeated(sent: Sequence[Stream], traffic: Traffic) -> Stream:
    """What errors cost some streams, as a sender before all of them: E(t) = (n_burst + ceil(t / T_error) - 1) C.

    An error takes `ERROR_BITS` and the longest of their frames again, for it may hit its last bit.

    Parameters
    ----------
    sent
        The streams whose frames may be repeated.
    traffic
        What is sent, with the errors.

    References
    ----------
    K. Tindell, A. Burns, Guaranteeing message latencies on Controller Area Network, 1994. There E is of w + C with the
    frame's own C; the caller adds the longest C.
    """
    longest_us = reduce(larger, (stream.frame_us for stream in sent))
    us = c.ERROR_BITS * bit_us(traffic.bit_rate_kbit_s) + longest_us
    times_us = {"frame_us": us, "period_us": traffic.error_period_us, "jitter_us": 0.0}
    errors = sent[0]._replace(name=REPEATED, group="", block=-1, first=-1, identifiers=1, is_message=True)
    return errors._replace(**times_us, burst=traffic.error_burst)


def repeated_by_place(sent: Sequence[Stream], traffic: Traffic) -> Iterator[Stream]:
    """What errors cost each stream and those before it, as senders that add up to it; none without errors."""
    if is_off(traffic.error_burst):
        return
    # Errors count until the frame itself has gone; one that is queued takes part in an arbitration for a bit.
    jitter_us = reduce(larger, (stream.frame_us for stream in sent)) - bit_us(traffic.bit_rate_kbit_s)
    before_us: Points = 0.0
    for stream in sorted(sent, key=lambda stream: stream.block):
        cost = repeated([stream], traffic)
        longer_us = larger(before_us, cost.frame_us)
        yield cost._replace(block=stream.block, frame_us=longer_us - before_us, jitter_us=jitter_us)
        before_us = longer_us


def _cyclic(traffic: Traffic) -> Iterator[Stream]:
    """SYNC, if there is one, and all PDOs; none of messages alone."""
    if not traffic.has_cycle:
        return
    first, size = int(traffic.sync_identifier), _whole(traffic.sync_bytes)
    sync = Stream(
        SYNC,
        group="",
        block=place(first, traffic.identifier_bits),
        first=first,
        identifiers=1,
        data_bytes=size,
        frame_us=traffic.frame_us(size, traffic),
        period_us=traffic.period_us,
        jitter_us=traffic.sync_jitter_us,
        deadline_us=traffic.period_us,
        identifier_bits=traffic.identifier_bits,
    )
    if traffic.has_sync:
        yield sync
    blocks: dict[str, int] = {}
    free: dict[str, Points] = {}
    # One more than a bus allows breaks its limit already.
    most_frames = int(c.MOST_PDOS) + 1
    for pdos in traffic.pdos:
        if (identifier := int(pdos.identifier)) != FOLLOWS:
            blocks[pdos.kind] = free[pdos.kind] = identifier
        first, count, left_bytes = free[pdos.kind], _whole(pdos.pdos), _whole(pdos.payload_bytes)
        free[pdos.kind] = first + count
        for number, most_bytes in enumerate(islice(_most_bytes(pdos), most_frames)):
            is_there, size = left_bytes > 0, larger(smaller(left_bytes, most_bytes), 0)
            if is_everywhere(left_bytes <= 0):
                break
            step = number * int(c.PDO_STEP)
            yield sync._replace(
                name=pdos.name,
                group=pdos.group,
                block=place(blocks[pdos.kind] + step, traffic.identifier_bits),
                first=first + step,
                identifiers=choose(is_there, count, 0),
                data_bytes=size,
                frame_us=choose(is_there, traffic.frame_us(size, traffic), 0.0),
                period_us=traffic.period_us * pdos.every,
            )
            left_bytes = left_bytes - most_bytes


def _most_bytes(pdos: Pdos) -> Iterator[int]:
    """The most data of each frame of a PDO, without end [bytes]."""
    return map(int, chain(pdos.frame_bytes, repeat(pdos.frame_bytes[-1])))


def frame_sizes(pdos: Pdos) -> Iterator[int]:
    """Data of each frame of a PDO of plain numbers, of which there may be billions [bytes]."""
    left_bytes = int(pdos.payload_bytes)
    for most_bytes in _most_bytes(pdos):
        if left_bytes <= 0:
            return
        yield min(left_bytes, most_bytes)
        left_bytes -= most_bytes


def _whole(number: Points) -> Points:
    """A number that is whole, as an int where it is plain."""
    return int(number) if isinstance(number, int | float) else number


def last_identifier(sent: Iterable[Stream]) -> Points:
    """The largest identifier of some streams; 0 of none."""
    none: Points = 0
    return reduce(larger, (choose(stream.identifiers > 0, stream.last, 0) for stream in sent), none)


def last_place(sent: Iterable[Stream]) -> Points:
    """Place up to which all frames may go before the last of some streams."""
    return reduce(larger, (choose(stream.identifiers > 0, stream.end_place, 0) for stream in sent))
