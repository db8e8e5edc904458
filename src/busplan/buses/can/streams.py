"""Every frame of a network with its identifiers, and which of them collide."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import chain, islice, repeat
from typing import Any, Final, NamedTuple

from busplan.buses.can.constants import FRAME_BYTES, MOST_PDOS, PDO_STEP
from busplan.buses.can.equations import frame_us
from busplan.buses.can.response import Sender
from busplan.buses.can.traffic import FOLLOWS, SYNC, Pdos, Traffic
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

    def sender(self, count: int | None = None) -> Sender:
        """Its frames, or some of them, as a source."""
        return Sender((self.identifiers if count is None else count) * self.frame_us, self.period_us, self.jitter_us)

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
    ordered = sorted(range(len(each)), key=lambda place: each[place].first)
    firsts = [each[place].first for place in ordered]
    pairs = (
        sorted((place, other))
        for number, place in enumerate(ordered)
        for other in ordered[number + 1 : bisect_right(firsts, each[place].last)]
    )
    for place, other in sorted(pairs):
        first = max(each[place].first, each[other].first)
        yield each[place], each[other], first, min(each[place].last, each[other].last) - first + 1
