"""Every frame of a network with its identifiers, and which of them collide."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache, reduce
from itertools import accumulate, chain, combinations, islice, product, repeat
from math import inf
from typing import Any, Final, NamedTuple, TypeAlias

from busplan.buses.can.constants import BASE_BITS, MAX_IDENTIFIER, MOST_PDOS, PDO_STEP
from busplan.buses.can.equations import frame_us
from busplan.buses.can.traffic import FOLLOWS, SYNC, Message, Pdos, Traffic
from busplan.elementwise import choose, larger, plain, smaller

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
