"""Every frame of a network with its identifiers, and which of them collide."""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, lru_cache, reduce
from itertools import accumulate, chain, combinations, islice, product, repeat
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

from busplan.buses.can.constants import BASE_BITS, MAX_IDENTIFIER, MOST_PDOS, PDO_STEP
from busplan.buses.can.equations import frame_bits, frame_us
from busplan.buses.can.response import Points, Sender
from busplan.buses.can.traffic import FOLLOWS, SYNC, Message, MessageList, Pdos, Traffic
from busplan.elementwise import choose, larger, plain, smaller, total

if TYPE_CHECKING:
    from numpy.typing import NDArray

Found = TypeVar("Found")


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

    def sender(self, count: Points | None = None) -> Sender:
        """Its frames, or some of them, as a source."""
        return Sender((self.identifiers if count is None else count) * self.frame_us, self.period_us, self.jitter_us)

    def burst_us(self, count: Points | None = None) -> Points:
        """Frames that come at once beside the first, of all its identifiers or of some of them [us]."""
        return (self.burst - 1) * self.sender(count).frames_us

    def goes_before(self, stream: "Stream") -> Points:
        """Whether its frames win the arbitration against the last frame of another."""
        return (self.block if stream.is_message else self.first_place) <= stream.last_place


def remembered(*, maxsize: int) -> "Callable[[Callable[..., Found]], Callable[..., Found]]":
    """Remember what a function of traffic gives for plain numbers; arrays are computed each time."""

    def of(function: Callable[..., Found]) -> Callable[..., Found]:
        known = lru_cache(maxsize=maxsize)(function)

        def ask(traffic: Traffic, *arguments: Any, is_stuffed: bool) -> Found:
            try:
                hash((traffic, arguments))
            except TypeError:
                return function(traffic, *arguments, is_stuffed=is_stuffed)
            return known(traffic, *arguments, is_stuffed=is_stuffed)

        return ask

    return of


@remembered(maxsize=256)
def streams(traffic: Traffic, *, is_stuffed: bool) -> tuple[Stream, ...]:
    """Every stream of a network: SYNC, feedback, command, and other messages.

    Parameters
    ----------
    traffic
        What it sends, as `Sent.of` gives it.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    """
    return (*_cyclic(traffic, is_stuffed), *message_streams(traffic, is_stuffed=is_stuffed).each)


class MessageStreams:
    """The streams of all messages, and what rests on them alone.

    Parameters
    ----------
    each
        The streams, in the order of the profile.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    """

    def __init__(self, each: tuple[Stream, ...], *, is_stuffed: bool) -> None:
        self.each = each
        self.by_length = sorted(each, key=lambda stream: -_length(stream, is_stuffed=is_stuffed))
        self._known: dict[Points, tuple[list[int], tuple[Stream, ...]]] = {}

    @cached_property
    def load(self) -> Points:
        """Share of the bus, 0..1 [1]."""
        return total(stream.sender().load for stream in self.each)

    @cached_property
    def twice(self) -> int:
        """Number of identifiers that stand twice among messages, without those that vary from point to point [1]."""
        fixed = [stream for stream in self.each if isinstance(stream.last, int)]
        return sum(shared for *_, shared in collisions(fixed))

    def around(self, last: Points) -> tuple[list[int], tuple[Stream, ...]]:
        """Numbers of messages that may go before a place in the arbitration, and those behind it, the longest first."""
        if not isinstance(last, int):
            return self._around(last)
        if last not in self._known:
            self._known[last] = self._around(last)
        return self._known[last]

    def _around(self, last: Points) -> tuple[list[int], tuple[Stream, ...]]:
        before = [number for number, stream in enumerate(self.each) if (stream.first_place <= last) is not False]
        return before, tuple(stream for stream in self.by_length if (stream.last_place > last) is not False)

    @cached_property
    def columns(self) -> "NDArray[Any]":
        """As `columns_of` of all of them."""
        return columns_of(self.each)

    @cached_property
    def groups(self) -> "NDArray[Any]":
        """Of each, the number of its pair of period and jitter, from 0: many messages have few of them."""
        import numpy as np

        _, period_us, jitter_us, *_ = self.columns
        return np.unique(period_us + 1j * jitter_us, return_inverse=True)[1].ravel()


def columns_of(each: Iterable[Stream]) -> "NDArray[Any]":
    """Of plain streams: all frames, period, jitter, a frame, deadline, block, last place and burst."""
    import numpy as np  # of many streams alone

    rows = [(*own.sender(), own.frame_us, own.deadline_us, own.block, own.last_place, own.burst_us()) for own in each]
    return np.array(rows, dtype=float).reshape(len(rows), _COLUMNS).T


_COLUMNS: Final = 8
"""Numbers of a stream in `columns_of`."""


def message_streams(traffic: Traffic, *, is_stuffed: bool) -> MessageStreams:
    """The streams of the messages; those of plain numbers are remembered."""
    make = _known_messages if traffic.messages.is_plain and isinstance(traffic.bit_rate_kbit_s, int | float) else _made
    return make(traffic.messages, traffic.bit_rate_kbit_s, is_stuffed)


def _made(messages: MessageList, bit_rate_kbit_s: Points, is_stuffed: bool) -> MessageStreams:
    each = tuple(_of_message(message, bit_rate_kbit_s, is_stuffed) for message in messages)
    return MessageStreams(each, is_stuffed=is_stuffed)


def _of_message(message: Message, bit_rate_kbit_s: Points, is_stuffed: bool) -> Stream:
    first, size, bits = int(plain(message.identifier)), int(plain(message.payload_bytes)), message.identifier_bits
    us = frame_us(
        size,
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
        data_bytes=size,
        frame_us=us,
        period_us=message.period_us,
        jitter_us=message.jitter_us,
        deadline_us=message.deadline_us,
        identifier_bits=bits,
        is_message=True,
        burst=message.burst,
    )


_known_messages: Callable[..., MessageStreams] = lru_cache(maxsize=8)(_made)


def _length(stream: Stream, *, is_stuffed: bool) -> float:
    """Number by which the frames of messages are in order of their length, at every point of arrays."""
    if isinstance(stream.frame_us, float):
        return stream.frame_us
    # Bit rates, and formats that are no plain numbers, are the same for all messages.
    bits = stream.identifier_bits
    return plain(
        frame_bits(
            stream.data_bytes,
            identifier_bits=bits if isinstance(bits, int | float) else BASE_BITS,
            is_stuffed=is_stuffed,
        )
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
        What is sent, as `Sent.of` gives it.
    """
    each, sent = streams(traffic, is_stuffed=True), message_streams(traffic, is_stuffed=True)
    fixed = [stream for stream in each if isinstance(stream.last, int)]
    varied = [stream for stream in each if not isinstance(stream.last, int)]
    cyclic = [stream for stream in fixed if not stream.is_message]
    least, most = min((own.first for own in cyclic), default=0), max((own.last for own in cyclic), default=-1)
    near = [own for own in fixed if own.is_message and own.first <= most and own.last >= least]
    # Pairs of messages are the same whatever the nodes.
    twice: Points = sent.twice + sum(
        shared for early, late, _, shared in collisions([*cyclic, *near]) if not (early.is_message and late.is_message)
    )
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
