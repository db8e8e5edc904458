"""What a cycle of plain numbers waits for, and the worst-case response of each stream."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import accumulate, chain, islice, repeat
from math import ceil, inf
from typing import Final, NamedTuple

from busplan.buses.can.constants import MOST_BLOCKS, SATURATED
from busplan.buses.can.equations import bit_us
from busplan.buses.can.response import Response, settled_us, worst_response
from busplan.buses.can.streams import Stream, streams
from busplan.buses.can.traffic import NAMES, SYNC, Traffic
from busplan.elementwise import Number, plain

_CYCLIC: Final = (SYNC, *NAMES.values())
_FEEDBACK, _COMMAND = NAMES["read"], NAMES["write"]


class Waits(NamedTuple):
    """What a cycle waits for, from the queued SYNC to the end of the last command."""

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


@lru_cache(maxsize=256)
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
    higher = [one._replace(jitter_us=one.jitter_us + bit).sender() for one in messages if is_higher(one.first, last)]
    lower = sorted((one for one in messages if not is_higher(one.first, last)), key=lambda one: -one.frame_us)
    most = int(MOST_BLOCKS)

    def waiting(span_us: float) -> Waits:
        there = (repeat(one, ceil(min((span_us + one.deadline_us) / one.period_us, most))) for one in lower)
        return Waits(span_us, tuple(islice(chain.from_iterable(there), most)))

    return waiting(settled_us(others_us, higher, more_us=lambda span_us: waiting(span_us).blocking_us))


def queued_us(each: Sequence[Stream], traffic: Traffic, *, is_stuffed: bool) -> dict[str, float]:
    """How late the last feedback and all commands may be queued behind the start of their cycle, by name [us]."""
    us = {name: sum(one.sender().frames_us for one in each if one.name == name) for name in _CYCLIC}
    others_us = sum(us.values()) + plain(traffic.read_us) + plain(traffic.host_us)
    commands_us = waits(traffic, others_us, is_stuffed=is_stuffed).lasts_us - us[_COMMAND]
    return {_FEEDBACK: commands_us - plain(traffic.host_us) - us[_FEEDBACK], _COMMAND: commands_us}


class _Start:
    """A place of the cycle at which a busy period of a message may begin: what goes before it, by priority.

    Parameters
    ----------
    ranked
        All streams, in the order of arbitration.
    late
        Names of those that are late, which come at once, and again in the next cycle.
    offset_us
        From the start of the busy period to that of the next cycle [us].
    bit_us
        Time of a bit [us].
    """

    def __init__(self, ranked: Sequence[Stream], late: Sequence[str], offset_us: float, bit_us: float) -> None:
        self.senders = [
            one.sender()._replace(jitter_us=-offset_us) if late and not one.is_message else one.sender()
            for one in ranked
        ]
        self.first_us = _sums(
            one.frames_us * (stream.name in late) for one, stream in zip(self.senders, ranked, strict=True)
        )
        # ceil(x) is less than x + 1.
        self.most_us = _sums(one.frames_us + one.load * (max(one.jitter_us, 0.0) + bit_us) for one in self.senders)


def _sums(numbers: Iterator[float]) -> list[float]:
    """Sums of the first of some numbers, from none to all."""
    return [0.0, *accumulate(numbers)]


class Messages:
    """All messages of a network: who goes before each, and its worst-case response.

    SYNC comes once a period, and feedback and commands behind it. So a busy period that begins with SYNC meets each
    once a period. One that begins with late feedback, or with late commands, meets these, and the next SYNC with all
    that follows it sooner than a period later.

    Parameters
    ----------
    traffic
        What is sent, in plain numbers.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    """

    def __init__(self, traffic: Traffic, *, is_stuffed: bool) -> None:
        each = streams(traffic, is_stuffed=is_stuffed)
        self._ranked = sorted(each, key=_rank)
        self._ranks = [_rank(one) for one in self._ranked]
        self._bit_us = plain(bit_us(traffic.bit_rate_kbit_s))
        period_us, late_us = plain(traffic.period_us), queued_us(each, traffic, is_stuffed=is_stuffed)
        places = (((), 0.0), ((_FEEDBACK, _COMMAND), late_us[_FEEDBACK]), ((_COMMAND,), late_us[_COMMAND]))
        self._starts = [_Start(self._ranked, late, max(period_us - us, 0.0), self._bit_us) for late, us in places]
        self._loads = _sums(one.load for one in self._starts[0].senders)
        frames_us = (one.frame_us for one in reversed(self._ranked))
        self._longest_us = [*accumulate(frames_us, max, initial=0.0)][::-1]
        """The longest frame from each rank on."""

    def by_priority(self) -> Iterator[Stream]:
        """The messages, that of the lowest priority first."""
        return (one for one in reversed(self._ranked) if one.is_message)

    def load(self, own: Stream) -> float:
        """Load of the bus by a message and all that goes before it [1]."""
        return self._loads[self._behind(own)]

    def response(self, own: Stream) -> Response | None:
        """Worst-case response of a message; None where `worst_response` has none."""
        behind, found = self._behind(own), []
        at = self._ranked.index(own)
        for start in self._starts:
            one = worst_response(
                own.sender(),
                start.senders[:at] + start.senders[at + 1 : behind],
                blocking_us=self._longest_us[behind],
                bit_us=self._bit_us,
                first_us=start.first_us[behind],
            )
            if one is None:
                return None
            found.append(one)
        return max(found, key=lambda one: one.us)

    def deadline_share(self, own: Stream) -> float:
        """Response over deadline, or a bound of it that is no more than 1; infinite without a response [1]."""
        behind, sender = self._behind(own), own.sender()
        if self._loads[behind] < SATURATED:
            blocking_us, own_most_us = (
                self._longest_us[behind],
                sender.frames_us + sender.load * (sender.jitter_us + self._bit_us),
            )
            most_us = (
                max(one.first_us[behind] + one.most_us[behind] for one in self._starts) - own_most_us + blocking_us
            )
            bound_us = own.jitter_us + own.frame_us + most_us / (1 - self._loads[behind] + sender.load)
            if bound_us <= own.deadline_us:
                return bound_us / own.deadline_us
        found = self.response(own)
        return inf if found is None else found.us / own.deadline_us

    def _behind(self, own: Stream) -> int:
        """The first rank behind a message."""
        return bisect_right(self._ranks, own.first)


def _rank(one: Stream) -> int:
    return one.first if one.is_message else one.block


@lru_cache(maxsize=16)
def messages(traffic: Traffic, *, is_stuffed: bool) -> Messages:
    """The messages of a network of plain numbers; see `Messages`."""
    return Messages(traffic, is_stuffed=is_stuffed)


def response(own: Stream, traffic: Traffic, *, is_stuffed: bool) -> Response | None:
    """Worst-case response time of the last frame of a stream, which is the longest of the stream's.

    SYNC is blocked by messages alone: where the cycle fits, its PDOs have gone before the next SYNC.

    Parameters
    ----------
    own
        The stream.
    traffic
        What it is of, in plain numbers.
    is_stuffed
        Whether the stuff bits of the worst case are counted.

    Returns
    -------
    Response
        None where the load up to it is 1 or more, or where its busy period takes too many steps to find.
    """
    if own.is_message:
        return messages(traffic, is_stuffed=is_stuffed).response(own)
    others = [one for one in streams(traffic, is_stuffed=is_stuffed) if one is not own]
    lower_us = (one.frame_us for one in others if not one.goes_before(own) and (own.name != SYNC or one.is_message))
    higher = [one.sender() for one in others if one.goes_before(own)]
    if own.identifiers > 1:
        higher.append(own.sender(own.identifiers - 1))
    blocking_us, bit = max(lower_us, default=0.0), plain(bit_us(traffic.bit_rate_kbit_s))
    return worst_response(own.sender(1), higher, blocking_us=blocking_us, bit_us=bit)
