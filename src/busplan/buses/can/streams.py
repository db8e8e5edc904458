"""Every frame of a network with its identifiers: which of them collide, and the worst-case response of each."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import chain, combinations, islice, repeat
from math import ceil, inf
from typing import Any, Final, NamedTuple

from busplan.buses.can.constants import FRAME_BYTES, MOST_BLOCKS, MOST_PDOS, PDO_STEP, SATURATED
from busplan.buses.can.equations import bit_us, frame_us
from busplan.buses.can.response import Response, Sender, response_bound_us, settled_us, worst_response
from busplan.buses.can.traffic import FOLLOWS, NAMES, SYNC, Pdos, Traffic
from busplan.elementwise import Number, plain


class Stream(NamedTuple):
    """Frames of one sort, with identifiers one behind the other. Plain numbers."""

    name: str
    group: str
    block: int
    """Identifier from which on the first group has them: a message in a block that grows stays behind it."""
    first: int
    identifiers: int
    """How many identifiers; each sends once in a period [1]."""
    data_bytes: int
    frame_us: float
    period_us: float
    jitter_us: float
    deadline_us: float
    is_message: bool = False
    is_end: bool = True
    """Whether the PDO, or the message, is complete with it."""

    @property
    def last(self) -> int:
        """The last identifier."""
        return self.first + self.identifiers - 1

    @property
    def label(self) -> str:
        """What it is called."""
        return f"{self.group} {self.name}" if self.group else self.name

    def sender(self, count: int) -> Sender:
        """Some of its frames as a source."""
        return Sender(count * self.frame_us, self.period_us, self.jitter_us)

    def goes_before(self, other: "Stream") -> bool:
        """Whether its frames win the arbitration against the last frame of another."""
        return (self.block if other.is_message else self.first) <= other.last


@lru_cache(maxsize=256)
def streams(traffic: Traffic, *, is_stuffed: bool) -> tuple[Stream, ...]:
    """Every stream of a network of plain numbers: SYNC, feedback, command, and other messages.

    Parameters
    ----------
    traffic
        What it sends, in plain numbers.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    """
    return tuple(_streams(traffic, is_stuffed))


def _streams(traffic: Traffic, is_stuffed: bool) -> Iterator[Stream]:
    def wire_us(data_bytes: float) -> float:
        return plain(
            frame_us(
                data_bytes,
                identifier_bits=traffic.identifier_bits,
                bit_rate_kbit_s=traffic.bit_rate_kbit_s,
                is_stuffed=is_stuffed,
            )
        )

    def sent(name: str, first: int, size: int) -> Stream:
        period_us = plain(traffic.period_us)
        return Stream(name, "", first, first, 1, size, wire_us(size), period_us, 0.0, period_us)

    yield sent(SYNC, _int(traffic.sync_identifier), _int(traffic.sync_bytes))
    block = {"read": FOLLOWS, "write": FOLLOWS}
    free = dict(block)
    for one in traffic.pdos:
        said, count = _int(one.identifier), _int(one.pdos)
        first = free[one.kind] if said == FOLLOWS else said
        if said != FOLLOWS:
            block[one.kind] = said
        free[one.kind] = first + count
        sizes = tuple(islice(frame_sizes(one), _MOST_FRAMES))
        for number, size in enumerate(sizes):
            step = number * int(PDO_STEP)
            own = sent(one.name, first + step, size)
            yield own._replace(
                group=one.group, block=block[one.kind] + step, identifiers=count, is_end=number == len(sizes) - 1
            )
    for message in traffic.messages:
        own = sent(message.name, _int(message.identifier), _int(message.payload_bytes))
        times: dict[str, Any] = {key: getattr(message, key) for key in ("period_us", "jitter_us", "deadline_us")}
        yield own._replace(is_message=True, **times)


def frame_sizes(one: Pdos) -> Iterator[int]:
    """Data of each frame of a PDO of plain numbers, of which there may be billions [bytes]."""
    full, rest = divmod(_int(one.payload_bytes), int(FRAME_BYTES))
    return chain(repeat(int(FRAME_BYTES), full), repeat(rest, int(rest > 0)))


_MOST_FRAMES: Final = int(MOST_PDOS) + 1
"""Frames of one PDO that have streams: with one more than a bus allows, its limit is broken already."""


def _int(number: Number) -> int:
    return int(plain(number))


def collisions(each: Sequence[Stream]) -> Iterator[tuple[Stream, Stream, int, int]]:
    """Pairs of streams that share identifiers, with the first they share, and how many."""
    for one, other in combinations(each, 2):
        first = max(one.first, other.first)
        shared = min(one.last, other.last) - first + 1
        if shared > 0:
            yield one, other, first, shared


def load_before(own: Stream, each: Sequence[Stream]) -> float:
    """Load of the bus by one stream and all that go before it, 0..1 [1]."""
    return sum(one.identifiers * one.frame_us / one.period_us for one in each if one is own or one.goes_before(own))


def senders_before(own: Stream, each: Sequence[Stream]) -> Iterator[Stream]:
    """The other streams that go before one."""
    return (one for one in each if one is not own and one.goes_before(own))


class Waits(NamedTuple):
    """What the cycle of plain numbers waits for on the bus, from the queued SYNC to the end of the last command."""

    lasts_us: float
    """All of it [us]."""
    blocks: tuple[Stream, ...]
    """Messages of a lower priority than SYNC and all PDOs, one for each frame that goes where these leave the bus idle;
    the longest first."""

    @property
    def blocking_us(self) -> float:
        """All these frames [us]."""
        return sum(one.frame_us for one in self.blocks)


def is_higher(message: Number, last: Number) -> Number:
    """Whether an identifier goes before the last one of SYNC and all PDOs; of any sort."""
    return message <= last


def last_identifier(each: Sequence[Stream]) -> int:
    """The largest identifier of SYNC and all PDOs."""
    return max(one.last for one in each if not one.is_message)


@lru_cache(maxsize=1024)
def waits(traffic: Traffic, others_us: float, *, is_stuffed: bool) -> Waits:
    """Find how long a cycle lasts with the frames of other messages.

    Parameters
    ----------
    traffic
        What is sent, in plain numbers.
    others_us
        SYNC, the wait for the slowest feedback, all PDOs and the host's own time [us].
    is_stuffed
        Whether the stuff bits of the worst case are counted.

    Notes
    -----
    SYNC, the feedback of the slowest node and the commands each meet an idle bus, or one that has just become busy. A
    frame of a lower priority may have started then: three such frames, the longest that can be there. One of a message
    whose deadline D is kept ends within it, so ceil((w + D) / T) of them are there in w. Frames that go before the last
    PDO go whenever they are queued: ceil((w + J + bit) / T). That holds with what is still pending from the cycle
    before, too: the last frame of that cycle started as long before its end as the last frame of this one does.
    """
    each = streams(traffic, is_stuffed=is_stuffed)
    last, bit = last_identifier(each), plain(bit_us(traffic.bit_rate_kbit_s))
    messages = [one for one in each if one.is_message]
    higher = [one._replace(jitter_us=one.jitter_us + bit).sender(1) for one in messages if is_higher(one.first, last)]
    lower = sorted((one for one in messages if not is_higher(one.first, last)), key=lambda one: -one.frame_us)
    most = int(MOST_BLOCKS)

    def waiting(span_us: float) -> Waits:
        there = (repeat(one, ceil(min((span_us + one.deadline_us) / one.period_us, most))) for one in lower)
        return Waits(span_us, tuple(islice(chain.from_iterable(there), most)))

    return waiting(settled_us(others_us, higher, more_us=lambda span_us: waiting(span_us).blocking_us))


class Start(NamedTuple):
    """A place of the cycle at which a busy period of a stream may begin."""

    higher: tuple[Sender, ...]
    """What goes before it from then on, again and again."""
    first_us: float = 0.0
    """What goes before it once [us]."""


def response(own: Stream, each: Sequence[Stream], traffic: Traffic, *, is_stuffed: bool) -> Response | None:
    """Worst-case response time of the last frame of a stream, which is the longest of the stream's.

    Parameters
    ----------
    own
        The stream.
    each
        All streams, this one among them.
    traffic
        What they are of, in plain numbers.
    is_stuffed
        Whether the stuff bits of the worst case are counted.

    Returns
    -------
    Response
        None where the load up to it is 1 or more, or where its busy period takes too many steps to find.
    """
    found = []
    for start in _starts(own, each, traffic, is_stuffed=is_stuffed):
        one = worst_response(own.sender(1), start.higher, first_us=start.first_us, **_around(own, each, traffic))
        if one is None:
            return None
        found.append(one)
    return max(found, key=lambda one: one.us)


def deadline_share(own: Stream, each: Sequence[Stream], traffic: Traffic) -> float:
    """Response time over deadline, or a bound of it that is no more than 1; infinite without a response time [1]."""
    starts, around = _starts(own, each, traffic, is_stuffed=True), _around(own, each, traffic)
    if load_before(own, each) < SATURATED:
        bound_us = max(response_bound_us(own.sender(1), one.higher, first_us=one.first_us, **around) for one in starts)
        if bound_us <= own.deadline_us:
            return bound_us / own.deadline_us
    found = response(own, each, traffic, is_stuffed=True)
    return inf if found is None else found.us / own.deadline_us


def _around(own: Stream, each: Sequence[Stream], traffic: Traffic) -> dict[str, float]:
    """The longest frame of a lower priority, and the time of a bit [us].

    SYNC is blocked by messages alone: where the cycle fits, its PDOs have gone before the next SYNC.
    """
    lower = (one for one in each if not one.goes_before(own) and one is not own)
    frames_us = (one.frame_us for one in lower if own.name != SYNC or one.is_message)
    return {"blocking_us": max(frames_us, default=0.0), "bit_us": plain(bit_us(traffic.bit_rate_kbit_s))}


def _starts(own: Stream, each: Sequence[Stream], traffic: Traffic, *, is_stuffed: bool) -> list[Start]:
    """Where the busy period of a stream may begin.

    SYNC comes once a period, and feedback and commands behind it. So a busy period that begins with SYNC meets each
    once a period. One that begins with late feedback, or with late commands, meets these, and the next SYNC with all
    that follows it sooner than a period later.
    """
    others = [*senders_before(own, each)]
    if own.identifiers > 1:
        others.append(own._replace(identifiers=own.identifiers - 1))
    at_sync = Start(tuple(one.sender(one.identifiers) for one in others))
    if not own.is_message:
        return [at_sync]
    messages = [one.sender(one.identifiers) for one in others if one.is_message]
    cyclic = [one for one in others if not one.is_message]
    starts = [at_sync]
    queued_us = _queued_us(each, traffic, is_stuffed=is_stuffed)
    for late, late_us in queued_us.items():
        offset_us = max(plain(traffic.period_us) - late_us, 0.0)
        again = (one.sender(one.identifiers)._replace(jitter_us=-offset_us) for one in cyclic)
        first_us = sum(one.identifiers * one.frame_us for one in cyclic if one.name in (late, NAMES["write"]))
        starts.append(Start((*messages, *again), first_us))
    return starts


def _queued_us(each: Sequence[Stream], traffic: Traffic, *, is_stuffed: bool) -> dict[str, float]:
    """How late the last feedback and all commands may be queued behind the start of their cycle [us]."""
    us = {name: sum(one.identifiers * one.frame_us for one in each if one.name == name) for name in _CYCLIC}
    others_us = sum(us.values()) + plain(traffic.read_us) + plain(traffic.host_us)
    commands_us = waits(traffic, others_us, is_stuffed=is_stuffed).lasts_us - us[NAMES["write"]]
    return {NAMES["read"]: commands_us - plain(traffic.host_us) - us[NAMES["read"]], NAMES["write"]: commands_us}


_CYCLIC: Final = (SYNC, *NAMES.values())
