"""Waits of a cycle for other messages, and the worst-case response of each stream."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import accumulate, chain, islice, repeat
from math import inf
from operator import add
from typing import Any, Final, NamedTuple

from busplan.buses.can.constants import BASE_BITS, MOST_BLOCKS, SATURATED
from busplan.buses.can.equations import bit_us, frame_bits
from busplan.buses.can.response import (
    BELOW,
    Points,
    Response,
    Sender,
    TooManyStepsError,
    settled_us,
    worst_instance,
    worst_response,
)
from busplan.buses.can.streams import Stream, last_place, remembered, streams
from busplan.buses.can.traffic import NAMES, SYNC, Traffic
from busplan.elementwise import choose, is_everywhere, larger, plain, rounded_up, smaller, total

_CYCLIC: Final = (SYNC, *NAMES.values())
_FEEDBACK, _COMMAND = NAMES["read"], NAMES["write"]


class Waits(NamedTuple):
    """Waits of a cycle, from the queued SYNC to the end of the last command."""

    lasts_us: Points
    """All of it [us]."""
    blocking_us: Points
    """Frames of a lower priority than SYNC and all PDOs that go where these leave the bus idle [us]."""
    lower: tuple[Stream, ...]
    """Messages of a lower priority than SYNC and all PDOs, the longest first."""

    def blocks(self) -> Iterator[Stream]:
        """One of them for each frame that goes, of plain numbers."""
        counts = (int(plain(_frames_within(stream, self.lasts_us))) for stream in self.lower)
        each = (repeat(stream, count) for stream, count in zip(self.lower, counts, strict=True))
        return islice(chain.from_iterable(each), int(MOST_BLOCKS))


@remembered(maxsize=256)
def waits(traffic: Traffic, others_us: Points, *, is_stuffed: bool) -> Waits:
    """Find how long a cycle lasts with the frames of other messages.

    Parameters
    ----------
    traffic
        What is sent, as `Sent.of` gives it.
    others_us
        SYNC, the wait for the slowest feedback, all PDOs and the host's own time [us].
    is_stuffed
        Whether the stuff bits of the worst case are counted.

    Notes
    -----
    SYNC, the feedback of the slowest node and the commands each meet an idle bus, or a bus that has just become busy. A
    frame of a lower priority may have started then: three such frames, the longest that can be there. One of a message
    whose deadline D is kept ends within it, so ceil((w + D) / T) of them are there in w. Frames that go before the last
    PDO go whenever they are queued: ceil((w + J + bit) / T). That holds with what is still pending from the cycle
    before, too: the last frame of that cycle started as long before its end as the last frame of this cycle does.
    """
    each = streams(traffic, is_stuffed=is_stuffed)
    last, bit = last_place(stream for stream in each if not stream.is_message), bit_us(traffic.bit_rate_kbit_s)
    messages = [stream for stream in each if stream.is_message]
    higher = [
        Sender(choose(is_higher, stream.sender().frames_us, 0.0), stream.period_us, stream.jitter_us + bit)
        for stream in messages
        if (is_higher := stream.first_place <= last) is not False
    ]
    by_length = sorted(messages, key=lambda stream: -_length(stream, is_stuffed=is_stuffed))
    lower = tuple(stream for stream in by_length if (stream.last_place > last) is not False)

    def blocking_us(span_us: Points) -> Points:
        blocked: Points = 0.0
        left: Points = int(MOST_BLOCKS)
        for stream in lower:
            count = choose(stream.last_place > last, smaller(_frames_within(stream, span_us), left), 0)
            for number in range(int(MOST_BLOCKS)):
                blocked = blocked + choose(count > number, stream.frame_us, 0.0)
            left = left - count
            if is_everywhere(left == 0):
                break
        return blocked

    lasts_us = settled_us(others_us, higher, more_us=blocking_us)
    return Waits(lasts_us, blocking_us(lasts_us), lower)


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


def _frames_within(stream: Stream, span_us: Points) -> Points:
    """Frames of a message of a lower priority that go within a span of time, of which three are enough [1]."""
    each = rounded_up(smaller((span_us + stream.deadline_us) / stream.period_us, int(MOST_BLOCKS)))
    return smaller(stream.identifiers * each, int(MOST_BLOCKS))


def queued_us(each: Sequence[Stream], traffic: Traffic, *, is_stuffed: bool) -> dict[str, Points]:
    """Latest queueing of the last feedback and of all commands behind the start of their cycle, by name [us]."""
    us = {name: total(stream.sender().frames_us for stream in each if stream.name == name) for name in _CYCLIC}
    others_us = total(us.values()) + traffic.read_us + traffic.host_us
    commands_us = waits(traffic, others_us, is_stuffed=is_stuffed).lasts_us - us[_COMMAND]
    return {_FEEDBACK: commands_us - traffic.host_us - us[_FEEDBACK], _COMMAND: commands_us}


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

    def __init__(self, ranked: Sequence[Stream], late: Sequence[str], offset_us: Points, bit_us: Points) -> None:
        self.senders = [
            stream.sender()._replace(jitter_us=-offset_us) if late and not stream.is_message else stream.sender()
            for stream in ranked
        ]
        self.first_us = _sums(
            sender.frames_us * (stream.name in late) for sender, stream in zip(self.senders, ranked, strict=True)
        )
        # ceil(x) is less than x + 1.
        # ceil(x) is no less than x.
        self.least_us = _sums(sender.load * (sender.jitter_us + bit_us) for sender in self.senders)
        self.most_us = _sums(
            sender.frames_us + sender.load * (larger(sender.jitter_us, 0.0) + bit_us) for sender in self.senders
        )


def _sums(numbers: Iterator[Points]) -> list[Points]:
    """Sums of the first of some numbers, from none to all."""
    return [0.0, *accumulate(numbers, add)]


class Messages:
    """All messages of a network: who goes before each, and its worst-case response.

    SYNC comes once a period, and feedback and commands behind it. So a busy period that begins with SYNC meets each
    once a period. One that begins with late feedback, or with late commands, meets these, and the next SYNC with all
    that follows it sooner than a period later.

    Parameters
    ----------
    traffic
        What is sent, as `Sent.of` gives it.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    """

    def __init__(self, traffic: Traffic, *, is_stuffed: bool) -> None:
        each = streams(traffic, is_stuffed=is_stuffed)
        self._ranked = sorted(each, key=lambda stream: stream.block)
        self._ranks = [stream.block for stream in self._ranked]
        self._bit_us = bit_us(traffic.bit_rate_kbit_s)
        period_us, late_us = traffic.period_us, queued_us(each, traffic, is_stuffed=is_stuffed)
        places = (((), 0.0), ((_FEEDBACK, _COMMAND), late_us[_FEEDBACK]), ((_COMMAND,), late_us[_COMMAND]))
        self._starts = [_Start(self._ranked, late, larger(period_us - us, 0.0), self._bit_us) for late, us in places]
        self._loads = _sums(sender.load for sender in self._starts[0].senders)
        frames_us: Iterator[Points] = (stream.frame_us for stream in reversed(self._ranked))
        nothing: Points = 0.0
        self._longest_us: list[Points] = [*accumulate(frames_us, larger, initial=nothing)][::-1]
        """The longest frame from each rank on."""
        self._known: dict[str, Response | None] = {}

    def by_priority(self) -> Iterator[Stream]:
        """The messages, that of the lowest priority first."""
        return (stream for stream in reversed(self._ranked) if stream.is_message)

    def load(self, own: Stream) -> Points:
        """Load of the bus by a message and all that goes before it [1]."""
        return self._loads[self._behind(own)]

    def response(self, own: Stream) -> Response | None:
        """Worst-case response of a message of plain numbers; None where `worst_response` has none."""
        if own.name not in self._known:
            self._known[own.name] = self._worst(own)
        return self._known[own.name]

    def _worst(self, own: Stream) -> Response | None:
        try:
            responses = [*self._responses(own)]
        except TooManyStepsError:
            return None
        known = [response for response in responses if response is not None]
        return max(known, key=lambda response: plain(response.us)) if len(known) == len(responses) else None

    def _responses(self, own: Stream) -> Iterator[Response | None]:
        """The worst instance of a message from each start of a busy period."""
        behind = self._behind(own)
        at = next(place for place, stream in enumerate(self._ranked) if stream.is_message and stream.name == own.name)
        is_single = isinstance(own.identifiers, int) and own.identifiers == 1
        siblings = [] if is_single else [own.sender(own.identifiers - 1)]
        for start in self._starts:
            yield worst_instance(
                own.sender(1),
                start.senders[:at] + siblings + start.senders[at + 1 : behind],
                blocking_us=self._longest_us[behind],
                bit_us=self._bit_us,
                first_us=start.first_us[behind],
            )

    def latest(self) -> tuple[Stream, Response | None]:
        """The message of plain numbers with the largest response over its deadline, and its response."""
        # Bounds come in closed form: few exact responses are left to find.
        ranked = sorted(self.by_priority(), key=self.bound_share, reverse=True)
        latest, largest = ranked[0], 0.0
        for own in ranked:
            if self.bound_share(own) <= largest:
                break
            response = self.response(own)
            share = inf if response is None else response.us / own.deadline_us
            if share > largest:
                latest, largest = own, share
        return latest, self.response(latest)

    def bound_share(self, own: Stream) -> Points:
        """A bound of the response over the deadline; infinite where the load of the bus leaves no response [1]."""
        behind, sender = self._behind(own), own.sender(1)
        load, own_most_us = self._loads[behind], sender.frames_us + sender.load * (sender.jitter_us + self._bit_us)
        starts_us = (start.first_us[behind] + start.most_us[behind] for start in self._starts)
        most_us = reduce(larger, starts_us) - own_most_us + self._longest_us[behind]
        has_response = load < SATURATED
        idle = choose(has_response, 1 - load + sender.load, 1.0)
        return choose(has_response, (own.jitter_us + own.frame_us + most_us / idle) / own.deadline_us, inf)

    def least_share(self, own: Stream) -> Points:
        """Lower bound of the response over the deadline, of a busy period that begins with SYNC [1]."""
        behind, sender = self._behind(own), own.sender(1)
        load, waits_us = self._loads[behind], self._starts[0].least_us[behind] + self._longest_us[behind]
        waits_us = waits_us - sender.load * (sender.jitter_us + self._bit_us)
        has_response = load < SATURATED
        idle = choose(has_response, 1 - load + sender.load, 1.0)
        least_us = own.jitter_us + own.frame_us + waits_us / idle
        return choose(has_response, least_us / own.deadline_us * BELOW, inf)

    def deadline_share(self, own: Stream) -> Points:
        """Response over deadline, or a bound of it that is no more than 1; infinite without a response [1].

        Raises
        ------
        TooManyStepsError
            It takes too many steps to find at some of several points.
        """
        bound = self.bound_share(own)
        tells = (bound <= 1) | (bound == inf)
        if is_everywhere(tells):
            return bound
        if isinstance(bound, float):
            response = self.response(own)
            return inf if response is None else response.us / own.deadline_us
        us = (inf if response is None else response.us for response in self._responses(own))
        return choose(tells, bound, reduce(larger, us) / own.deadline_us)

    def _behind(self, own: Stream) -> int:
        """The first rank behind a message."""
        last: Any = own.last_place
        return bisect_right(self._ranks, last.max() if hasattr(last, "max") else last)


@remembered(maxsize=16)
def messages(traffic: Traffic, *, is_stuffed: bool) -> Messages:
    """The messages of a network; see `Messages`."""
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
    higher, blocking_us = _rivals(own, streams(traffic, is_stuffed=is_stuffed))
    if own.identifiers > 1:
        higher.append(own.sender(own.identifiers - 1))
    bit = plain(bit_us(traffic.bit_rate_kbit_s))
    return worst_response(own.sender(1), higher, blocking_us=plain(blocking_us), bit_us=bit)


def _rivals(own: Stream, each: Sequence[Stream]) -> tuple[list[Sender], Points]:
    """What goes before SYNC or a PDO, and the longest frame that may hold it up [us]."""
    higher = [stream.sender() for stream in each if stream is not own and stream.goes_before(own)]
    lower = (stream for stream in each if not stream.goes_before(own) and (own.name != SYNC or stream.is_message))
    nothing: Points = 0.0
    return higher, reduce(larger, (stream.frame_us for stream in lower), nothing)


def sync_spread_us(traffic: Traffic, *, is_stuffed: bool) -> Points:
    """Delay of SYNC by messages, B + I; infinite where it has no end [us].

    Parameters
    ----------
    traffic
        What is sent, as `Sent.of` gives it.
    is_stuffed
        Whether the stuff bits of the worst case are counted.

    Raises
    ------
    TooManyStepsError
        It takes too many steps to find.
    """
    own, *_ = each = streams(traffic, is_stuffed=is_stuffed)
    higher, blocking_us = _rivals(own, each)
    worst = worst_instance(own.sender(1), higher, blocking_us=blocking_us, bit_us=bit_us(traffic.bit_rate_kbit_s))
    return inf if worst is None else choose(worst.us < inf, worst.blocking_us + worst.interference_us, inf)
