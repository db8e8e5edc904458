"""Every frame of a network with its identifiers, and which of them collide."""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache, reduce
from itertools import chain, combinations, repeat
from typing import Any, Final, NamedTuple, TypeVar

from busplan.buses.can.constants import FRAME_BYTES, MOST_PDOS, PDO_STEP
from busplan.buses.can.equations import frame_us
from busplan.buses.can.response import Points, Sender
from busplan.buses.can.traffic import FOLLOWS, SYNC, Pdos, Traffic
from busplan.elementwise import choose, larger, plain, rounded_up, smaller, total

Found = TypeVar("Found")


class Stream(NamedTuple):
    """Frames of the same sort, with identifiers in sequence. The identifiers that order them are plain."""

    name: str
    group: str
    block: int
    """Identifier from which on the first group has them: a message in a block that grows stays behind it."""
    first: Points
    identifiers: Points
    """Number of identifiers; each sends once in a period [1]."""
    data_bytes: Points
    frame_us: Points
    period_us: Points
    jitter_us: Points
    deadline_us: Points
    is_message: bool = False
    is_end: bool = True
    """Whether the PDO, or the message, is complete with it."""

    @property
    def last(self) -> Points:
        """The last identifier."""
        return self.first + self.identifiers - 1

    @property
    def label(self) -> str:
        """Name beside other streams, with its group."""
        return f"{self.group} {self.name}" if self.group else self.name

    def sender(self, count: Points | None = None) -> Sender:
        """Its frames, or some of them, as a source."""
        return Sender((self.identifiers if count is None else count) * self.frame_us, self.period_us, self.jitter_us)

    def goes_before(self, stream: "Stream") -> bool:
        """Whether its frames win the arbitration against the last frame of another; of plain numbers."""
        return bool((self.block if stream.is_message else self.first) <= stream.last)


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
    return tuple(_streams(traffic, is_stuffed))


def _streams(traffic: Traffic, is_stuffed: bool) -> Iterator[Stream]:
    def sent(name: str, block: int, size: Points, **more: Any) -> Stream:
        us = frame_us(
            size,
            identifier_bits=traffic.identifier_bits,
            bit_rate_kbit_s=traffic.bit_rate_kbit_s,
            is_stuffed=is_stuffed,
        )
        own: dict[str, Any] = {"period_us": traffic.period_us, "jitter_us": 0.0, "deadline_us": traffic.period_us}
        return Stream(
            name,
            **{"group": "", "first": block, "identifiers": 1, **own, **more},
            block=block,
            data_bytes=size,
            frame_us=us,
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
        frames = _most_frames(pdos)
        for number in range(frames):
            step = number * int(PDO_STEP)
            left_bytes = _whole(pdos.payload_bytes) - number * int(FRAME_BYTES)
            own = sent(
                pdos.name,
                block[pdos.kind] + step,
                larger(smaller(left_bytes, int(FRAME_BYTES)), 0),
                group=pdos.group,
                first=first + step,
                identifiers=count,
                is_end=number == frames - 1,
            )
            is_there = left_bytes > 0  # not at every point of an array
            yield own._replace(identifiers=choose(is_there, count, 0), frame_us=choose(is_there, own.frame_us, 0.0))
    for message in traffic.messages:
        times = {key: getattr(message, key) for key in ("period_us", "jitter_us", "deadline_us")}
        yield sent(
            message.name, int(plain(message.identifier)), int(plain(message.payload_bytes)), is_message=True, **times
        )


def _most_frames(pdos: Pdos) -> int:
    """Frames of a PDO that have streams, the most at any point."""
    frames: Any = rounded_up(pdos.payload_bytes / FRAME_BYTES)
    return min(int(frames.max() if hasattr(frames, "max") else frames), _MOST_FRAMES)


def frame_sizes(pdos: Pdos) -> Iterator[int]:
    """Data of each frame of a PDO of plain numbers, of which there may be billions [bytes]."""
    full, rest = divmod(int(plain(pdos.payload_bytes)), int(FRAME_BYTES))
    return chain(repeat(int(FRAME_BYTES), full), repeat(rest, int(rest > 0)))


_MOST_FRAMES: Final = int(MOST_PDOS) + 1
"""Frames of a PDO that have streams: one more than a bus allows breaks its limit already."""


def _whole(number: Points) -> Points:
    """A number that is whole, as an int where it is plain."""
    return int(number) if isinstance(number, int | float) else number


def last_identifier(each: Iterable[Stream]) -> Points:
    """The largest identifier of some streams."""
    return reduce(larger, (choose(stream.identifiers > 0, stream.last, 0) for stream in each))


def identifiers_twice(each: Sequence[Stream]) -> Points:
    """Number of identifiers that stand twice or more often [1]."""
    if all(isinstance(stream.last, int) for stream in each):
        return sum(shared for *_, shared in collisions(each))
    return total(
        larger(smaller(early.last, late.last) - larger(early.first, late.first) + 1, 0)
        for early, late in combinations(each, 2)
    )


def collisions(each: Sequence[Stream]) -> Iterator[tuple[Stream, Stream, int, int]]:
    """Pairs of streams of plain numbers that share identifiers, with the first they share, and how many."""
    ordered = sorted(range(len(each)), key=lambda place: plain(each[place].first))
    firsts = [plain(each[place].first) for place in ordered]
    pairs = (
        sorted((place, behind))
        for number, place in enumerate(ordered)
        for behind in ordered[number + 1 : bisect_right(firsts, each[place].last)]
    )
    for early, late in sorted(pairs):
        first = max(each[early].first, each[late].first)
        yield each[early], each[late], first, min(each[early].last, each[late].last) - first + 1
