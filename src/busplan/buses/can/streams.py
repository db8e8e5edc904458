"""Frames of a CAN network in the order of arbitration: streams of them, each with its time on the wire."""

from collections.abc import Iterable, Iterator, Sequence
from functools import reduce
from itertools import chain, islice, repeat
from typing import Any, Final, NamedTuple, TypeAlias

from busplan.buses.can.equations import BASE_BITS, MAX_IDENTIFIER, bit_us, c
from busplan.buses.can.traffic import FOLLOWS, REPEATED, SYNC, Message, Pdos, Traffic, kept
from busplan.elementwise import choose, is_everywhere, is_off, larger, smaller

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
    """Frames of one sort, with identifiers in sequence, which are plain where they order streams."""

    name: str
    """SYNC, feedback, command, or the name of a message."""
    group: str
    """Name of the group of a PDO; empty where all nodes are alike."""
    block: int
    """Place of the first frame of the first group: a message in a block that grows stays behind it."""
    first: Points
    """First identifier."""
    identifiers: Points
    """Number of identifiers; each sends once in a period [1]."""
    data_bytes: Points
    """Data of a frame, s [bytes]."""
    frame_us: Points
    """Time of a frame, C [us]."""
    period_us: Points
    """Shortest time between frames of an identifier; of bursts the mean time, T [us]."""
    jitter_us: Points
    """Latest queueing behind the start, J [us]."""
    deadline_us: Points
    """Latest arrival behind the start, D [us]."""
    identifier_bits: Points
    """Length of the identifiers [bits]."""
    is_message: bool = False
    """Whether it is a message, neither SYNC nor a PDO."""
    burst: Points = 1
    """Frames of each identifier that may come at once, b [1]."""
    queue_place: Points | None = None
    """Place of the last identifier in its queue, where that is not by priority: it may wait behind that."""
    offered_us: Points = 0.0
    """Latest instant from which on such a queue offers the message, R - C [us]."""

    @property
    def last(self) -> Points:
        """Last identifier."""
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
        """Place in the arbitration up to which all frames may go before its last one."""
        return self.last_place if self.queue_place is None else self.queue_place

    @property
    def label(self) -> str:
        """Name with that of the group."""
        return f"{self.group} {self.name}" if self.group else self.name

    @property
    def frames_us(self) -> Points:
        """Frames of a period, one of each identifier [us]."""
        return self.identifiers * self.frame_us

    @property
    def burst_us(self) -> Points:
        """Frames that come at once beside the first of each identifier [us]."""
        return (self.burst - 1) * self.frames_us


@kept
def streams(traffic: Traffic) -> tuple[Stream, ...]:
    """All streams of traffic as `Traffic.ask` gives it: SYNC, feedback, commands, and other messages."""
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
    """Repeated frames of some streams, as a sender before all of them: E(t) = (n_burst + ceil(t / T_error) - 1) C.

    An error takes `ERROR_BITS` and the longest of the frames again, for it may hit its last bit.

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
    """Repeated frames as senders by place: their sum is what errors cost a stream and those before it."""
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
    """SYNC, if there is one, and all PDOs."""
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
        first, count, left_bytes = free[pdos.kind], _whole(pdos.number), _whole(pdos.payload_bytes)
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
    """Most data of each frame of a PDO, without end [bytes]."""
    return map(int, chain(pdos.frame_bytes, repeat(pdos.frame_bytes[-1])))


def frame_sizes(pdos: Pdos) -> Iterator[int]:
    """Data of each frame of a PDO of plain numbers; there may be billions [bytes]."""
    left_bytes = int(pdos.payload_bytes)
    for most_bytes in _most_bytes(pdos):
        if left_bytes <= 0:
            return
        yield min(left_bytes, most_bytes)
        left_bytes -= most_bytes


def _whole(number: Points) -> Points:
    """A whole number, as an int where it is plain."""
    return int(number) if isinstance(number, int | float) else number


def last_identifier(sent: Iterable[Stream]) -> Points:
    """Largest identifier of some streams; 0 of none."""
    none: Points = 0
    return reduce(larger, (choose(stream.identifiers > 0, stream.last, 0) for stream in sent), none)


def last_place(sent: Iterable[Stream]) -> Points:
    """Place in the arbitration up to which all frames may go before the last one of some streams."""
    return reduce(larger, (choose(stream.identifiers > 0, stream.end_place, 0) for stream in sent))
