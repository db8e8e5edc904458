"""Waits of a cycle for other messages, and the worst-case response of each stream."""

from bisect import bisect_right
from collections.abc import Container, Iterable, Iterator, Sequence
from functools import cached_property, reduce
from itertools import accumulate, chain, islice, repeat
from math import inf
from operator import add
from typing import Any, Final, NamedTuple

from busplan.buses.can.constants import MOST_BLOCKS, SATURATED
from busplan.buses.can.equations import bit_us
from busplan.buses.can.response import (
    BELOW,
    MANY,
    Demand,
    Points,
    Response,
    Sender,
    TooManyStepsError,
    settled_us,
    worst_instance,
    worst_response,
)
from busplan.buses.can.streams import Stream, columns_of, last_place, message_streams, remembered, streams
from busplan.buses.can.traffic import NAMES, SYNC, Traffic
from busplan.elementwise import choose, is_everywhere, is_off, larger, plain, rounded_up, smaller, total

_CYCLIC: Final = (SYNC, *NAMES.values())
_FRAME, _BLOCK, _BURST = 3, 5, 7
"""Places of a frame, the block and the burst in `columns_of`; numbers of a sender stand before a frame."""
_FEEDBACK, _COMMAND = NAMES["read"], NAMES["write"]


class Waits(NamedTuple):
    """Waits of a cycle, from the queued SYNC to the end of the last command."""

    lasts_us: Points
    """All of it [us]."""
    blocking_us: Points
    """Frames of a lower priority than SYNC and all PDOs that go where these leave the bus idle [us]."""
    lower: tuple[Stream, ...]
    """Messages of a lower priority than SYNC and all PDOs, the longest first."""
    most: int = int(MOST_BLOCKS)
    """Frames of a lower priority that it waits for, at most [1]."""

    def blocks(self) -> Iterator[Stream]:
        """One of them for each frame that goes, of plain numbers."""
        counts = (int(plain(_frames_within(stream, self.lasts_us))) for stream in self.lower)
        each = (repeat(stream, count) for stream, count in zip(self.lower, counts, strict=True))
        return islice(chain.from_iterable(each), self.most)


def sent_in(cyclic: Sequence[Stream], due: Container[str]) -> list[Stream]:
    """SYNC and the PDOs of some groups."""
    return [stream for stream in cyclic if stream.name == SYNC or stream.group in due]


@remembered(maxsize=256)
def waits(traffic: Traffic, others_us: Points, due: frozenset[str] | None = None, *, is_stuffed: bool) -> Waits:
    """Find how long a cycle lasts with the frames of other messages.

    Parameters
    ----------
    traffic
        What is sent, as `Sent.of` gives it.
    others_us
        SYNC, the wait for the slowest feedback, all PDOs and the host's own time [us].
    due
        Names of the groups whose PDOs are in the cycle; without it the fullest cycle, and no other lasts longer.
    is_stuffed
        Whether the stuff bits of the worst case are counted.

    Notes
    -----
    SYNC, the feedback of the slowest node and the commands each meet an idle bus, or a bus that has just become busy. A
    frame of a lower priority may have started then: three such frames, the longest that can be there. One of a message
    whose deadline D is kept ends within it, so ceil((w + D) / T) of them are there in w. Frames that go before the last
    PDO go whenever they are queued: ceil((w + J + bit) / T). Of a message whose frames may come b at once there are
    b - 1 more.

    Nothing of that is still pending from the cycle before: all that was queued by w behind its start has been sent by
    then, and w is within the period.

    PDOs that are not in every cycle are all due in the fullest, and no other cycle lasts longer: it has fewer PDOs, and
    no more of the messages before the last PDO of the fullest. These may block its own PDOs, but each goes once.
    """
    cyclic = [stream for stream in streams(traffic, is_stuffed=is_stuffed) if not stream.is_message]
    fullest = last_place(cyclic)
    # Without PDOs a cycle ends with SYNC, which waits for a single frame.
    most = int(MOST_BLOCKS) if due is None or due else 1
    last = fullest if due is None else last_place(sent_in(cyclic, due))
    bit = bit_us(traffic.bit_rate_kbit_s)
    sent = message_streams(traffic, is_stuffed=is_stuffed)
    before, lower = sent.around(last)
    if due is not None:
        # Of messages before the last PDO of the fullest cycle nothing is pending at SYNC.
        lower = tuple(
            stream._replace(deadline_us=smaller(stream.deadline_us, stream.jitter_us + bit))
            if stream.last_place <= fullest
            else stream
            for stream in lower
        )
    ranked = [sent.each[number] for number in before]
    higher = [
        Sender(
            choose(stream.first_place <= last, stream.sender().frames_us, 0.0), stream.period_us, stream.jitter_us + bit
        )
        for stream in ranked
    ]
    others_us = others_us + total(
        choose(stream.first_place <= last, stream.burst_us(), 0.0) for stream in ranked if not is_off(stream.burst - 1)
    )

    def blocking_us(span_us: Points) -> Points:
        blocked: Points = 0.0
        left: Points = most
        for stream in lower:
            count = choose(stream.last_place > last, smaller(_frames_within(stream, span_us), left), 0)
            for number in range(most):
                blocked = blocked + choose(count > number, stream.frame_us, 0.0)
            left = left - count
            if is_everywhere(left == 0):
                break
        return blocked

    lasts_us = settled_us(others_us, higher, more_us=blocking_us)
    return Waits(lasts_us, blocking_us(lasts_us), lower, most=most)


def _frames_within(stream: Stream, span_us: Points) -> Points:
    """Frames of a message of a lower priority that go within a span of time, of which three are enough [1]."""
    each = rounded_up(smaller((span_us + stream.deadline_us) / stream.period_us, int(MOST_BLOCKS)))
    return smaller(stream.identifiers * (each + stream.burst - 1), int(MOST_BLOCKS))


def queued_us(each: Sequence[Stream], traffic: Traffic, *, is_stuffed: bool) -> dict[str, Points]:
    """Latest queueing of the last feedback and of all commands behind the start of their cycle, by name [us]."""
    cyclic = [stream for stream in each if not stream.is_message]
    us = {name: total(stream.sender().frames_us for stream in cyclic if stream.name == name) for name in _CYCLIC}
    others_us = total(us.values()) + traffic.read_us + traffic.host_us
    commands_us = waits(traffic, others_us, is_stuffed=is_stuffed).lasts_us - us[_COMMAND]
    return {_FEEDBACK: commands_us - traffic.host_us - us[_FEEDBACK], _COMMAND: commands_us}


class _Start:
    """A place of the cycle at which a busy period of a message may begin: what goes before it, by priority.

    Parameters
    ----------
    senders
        All senders, in the order of arbitration; or arrays of all of them.
    is_late
        Of each, whether it is late: it comes at once, and again in the next cycle.
    bursts_us
        Frames of each that come at once beside the first [us].
    groups
        Of arrays, the number of the period and jitter of each, from 0.
    bit_us
        Time of a bit [us].
    """

    def __init__(
        self,
        senders: Sequence[Sender] | Sender,
        is_late: Sequence[bool],
        bursts_us: Points,
        bit_us: Points,
        groups: Points = None,
    ) -> None:
        self.senders = senders

        def least_us(sender: Sender) -> Points:
            # ceil(x) is no less than x.
            return sender.load * (sender.jitter_us + bit_us)

        def most_us(sender: Sender) -> Points:
            # ceil(x) is less than x + 1.
            return sender.frames_us + sender.load * (larger(sender.jitter_us, 0.0) + bit_us)

        if isinstance(senders, Sender):
            import numpy as np

            _, first = np.unique(groups, return_index=True)
            self.times_us = senders.period_us[first], senders.jitter_us[first]
            """Period and jitter of each group [us]."""
            self.first_us = _sums_of_array(senders.frames_us * is_late + bursts_us)
            self.least_us, self.most_us = _sums_of_array(least_us(senders)), _sums_of_array(most_us(senders))
        else:
            parts = zip(senders, is_late, bursts_us, strict=True)
            self.first_us = _sums(sender.frames_us * late + burst_us for sender, late, burst_us in parts)
            self.least_us, self.most_us = _sums(map(least_us, senders)), _sums(map(most_us, senders))


def _sums(numbers: Iterable[Points]) -> Points:
    """Sums of the first of some numbers, from none to all."""
    return [0.0, *accumulate(numbers, add)]


def _sums_of_array(numbers: Points) -> Points:
    """Sums of the first numbers of an array, from none to all."""
    import numpy as np  # of many senders alone

    return np.append(0.0, numbers.cumsum())


_AT_ONCE: Final = 2**17
"""Numbers of an array of messages and what goes before each, so that it stays in the processor's memory."""
_LEAST_AT_ONCE: Final = 8
"""Messages from which on arrays of them are faster."""


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
        self._bit_us = bit_us(traffic.bit_rate_kbit_s)
        self._columns: Points = None
        """As `columns_of` of all streams, where they are many and plain."""
        if traffic.is_plain and len(traffic.messages) >= MANY:
            import numpy as np  # of many messages alone

            sent = message_streams(traffic, is_stuffed=is_stuffed)
            cyclic = len(each) - len(sent.each)
            columns = np.append(columns_of(each[:cyclic]), sent.columns, axis=1)
            order = columns[_BLOCK].argsort(kind="stable")
            self._groups = np.append(np.arange(cyclic), cyclic + sent.groups)[order]
            self._columns = columns[:, order]
            self._is_message = order >= cyclic
            self._ranked = [each[place] for place in order.tolist()]
        else:
            self._ranked = sorted(each, key=lambda stream: stream.block)
        self._ranks = [stream.block for stream in self._ranked]
        places: list[tuple[tuple[str, ...], Points]] = [((), 0.0)]
        if traffic.has_cycle:
            late_us = queued_us(each, traffic, is_stuffed=is_stuffed)
            places += ((_FEEDBACK, _COMMAND), late_us[_FEEDBACK]), ((_COMMAND,), late_us[_COMMAND])
        self._starts = [self._start(late, us, traffic.period_us) for late, us in places]
        if self._columns is None:
            self._loads = _sums(sender.load for sender in self._starts[0].senders)
            frames_us: Iterator[Points] = (stream.frame_us for stream in reversed(self._ranked))
            nothing: Points = 0.0
            longest_us: Points = [*accumulate(frames_us, larger, initial=nothing)]
        else:
            self._loads = _sums_of_array(Sender(*self._columns[:_FRAME]).load)
            longest_us = np.append(0.0, np.maximum.accumulate(self._columns[_FRAME][::-1]))
        self._longest_us: Points = longest_us[::-1]
        """The longest frame from each rank on."""
        self._known: dict[str, Response | None] = {}

    def _start(self, late: Sequence[str], late_us: Points, period_us: Points) -> _Start:
        """The start of a busy period when some are late, so long behind the start of their cycle [us].

        These come again with their own period. Of the others any may be due in the next cycle.
        """
        is_late = [stream.name in late for stream in self._ranked]
        offsets_us: list[Points] = [
            larger((stream.period_us if own_late else period_us) - late_us, 0.0)
            for stream, own_late in zip(self._ranked, is_late, strict=True)
            if not stream.is_message
        ]
        if self._columns is None:
            rest = iter(offsets_us)
            senders = [
                stream.sender()._replace(jitter_us=-next(rest)) if late and not stream.is_message else stream.sender()
                for stream in self._ranked
            ]
            return _Start(senders, is_late, [stream.burst_us() for stream in self._ranked], self._bit_us)
        frames_us, period_us, jitter_us = self._columns[:_FRAME]
        if late:
            jitter_us = jitter_us.copy()
            jitter_us[~self._is_message] = [-us for us in offsets_us]
        own = Sender(frames_us, period_us, jitter_us)
        return _Start(own, is_late, self._columns[_BURST], self._bit_us, self._groups)

    @cached_property
    def _ranks_by_name(self) -> dict[str, int]:
        return {stream.name: rank for rank, stream in enumerate(self._ranked) if stream.is_message}

    @cached_property
    def _all(self) -> tuple[Points, Sender, Points]:
        """Of all messages of plain numbers, the lowest priority first: first rank behind, a single frame, deadline."""
        import numpy as np

        _, period_us, jitter_us, frame_us, deadline_us, _, last, _ = self._columns[:, self._is_message][:, ::-1]
        behind = np.searchsorted(self._columns[_BLOCK], last, side="right")
        return behind, Sender(frame_us, period_us, jitter_us), deadline_us

    def bounds(self) -> Iterator[tuple[Stream, Points]]:
        """All messages, that of the lowest priority first, each with its `bound_share`."""
        if self._columns is None:
            return ((stream, self.bound_share(stream)) for stream in self.by_priority())
        return zip(self.by_priority(), self._bound(*self._all).tolist(), strict=True)

    def largest_bound(self) -> Points:
        """The largest `bound_share` of any message."""
        if self._columns is None:
            return reduce(larger, (share for _, share in self.bounds()))
        return float(self._bound(*self._all).max())

    def may_be_late(self) -> list[tuple[Stream, float]]:
        """Plain messages that bounds do not show to be in time, the largest bound first, with their bounds."""
        if self._columns is None:
            over = [(own, plain(bound)) for own, bound in self.bounds() if bound > 1]
        else:
            bounds, each = self._bound(*self._all), [*self.by_priority()]
            over = [(each[place], float(bounds[place])) for place in (bounds > 1).nonzero()[0].tolist()]
        return sorted(over, key=lambda pair: -pair[1])

    def largest_least(self) -> Points:
        """The largest `least_share` of any message."""
        if self._columns is None:
            return reduce(larger, map(self.least_share, self.by_priority()))
        return float(self._least(*self._all).max())

    def by_priority(self) -> Iterator[Stream]:
        """The messages, that of the lowest priority first."""
        return (stream for stream in reversed(self._ranked) if stream.is_message)

    def load(self, own: Stream) -> Points:
        """Load of the bus by a message and all that goes before it [1]."""
        load = self._loads[self._behind(own)]
        return load if self._columns is None else float(load)

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
        for start, before in zip(self._starts, self._before(own, behind), strict=True):
            blocking_us, first_us = self._longest_us[behind], start.first_us[behind]
            if self._columns is not None:
                blocking_us, first_us = float(blocking_us), float(first_us)
            yield worst_instance(
                own.sender(1),
                before,
                blocking_us=blocking_us,
                bit_us=self._bit_us,
                first_us=first_us - own.burst_us(1),
                burst=own.burst,
            )

    def _before(self, own: Stream, behind: int) -> Iterator[Demand]:
        """What goes before a message, other nodes' of its name among them, from each start of a busy period."""
        at = self._ranks_by_name[own.name]
        is_single = isinstance(own.identifiers, int) and own.identifiers == 1
        siblings = [] if is_single else [own.sender(own.identifiers - 1)]
        if self._columns is None:
            for start in self._starts:
                yield Demand([*start.senders[:at], *siblings, *start.senders[at + 1 : behind]])
            return
        import numpy as np

        frames_us = self._columns[0, :behind].copy()
        frames_us[at] = sum(sender.frames_us for sender in siblings)
        of_groups_us = np.bincount(self._groups[:behind], frames_us)
        for start in self._starts:
            yield Demand.of_many(Sender(of_groups_us, *(each[: len(of_groups_us)] for each in start.times_us)))

    def responses(self, each: Iterable[Stream]) -> Iterator[tuple[Stream, Response | None]]:
        """Several messages of plain numbers with their `response`; where they are many, of more and more at a time."""
        waiting, size = iter(each), 1
        while some := [*islice(waiting, size)]:
            if self._columns is not None:
                asked = sorted((own for own in some if own.name not in self._known), key=self._behind)
                self._known.update(zip((own.name for own in asked), self._worst_of(asked), strict=True))
                most = _AT_ONCE // (int(self._groups.max()) + 1)
                size = min(4 * size, max(most, _LEAST_AT_ONCE))
            yield from ((own, self.response(own)) for own in some)

    def find_all(self) -> None:
        """Find the responses of all messages of plain numbers together; `response` then knows them."""
        for _ in self.responses(self.by_priority()):
            pass

    def _worst_of(self, each: Sequence[Stream]) -> list[Response | None]:
        """Worst-case responses of messages, in the order of priorities; of several in arrays of all of them."""
        if len(each) < _LEAST_AT_ONCE:
            return [self._worst(own) for own in each]
        try:
            starts = [*self._responses_of(each)]
        except TooManyStepsError:
            middle = len(each) // 2
            return [*self._worst_of(each[:middle]), *self._worst_of(each[middle:])]
        known = [start for start in starts if start is not None]
        if len(known) < len(starts):
            return [None for _ in each]
        rows = ([Response(*row) for row in zip(*(part.tolist() for part in start), strict=True)] for start in known)
        worst = (max(row, key=lambda response: plain(response.us)) for row in zip(*rows, strict=True))
        return [None if response.us == inf else response for response in worst]

    def _responses_of(self, each: Sequence[Stream]) -> Iterator[Response | None]:
        """The worst instances of several messages from each start of a busy period, as arrays of all of them."""
        import numpy as np

        behind = [self._behind(own) for own in each]
        groups, place = np.unique(self._groups[: behind[-1]], return_inverse=True)
        of_groups_us = np.zeros((len(groups), len(each)))
        for number, (own, end) in enumerate(zip(each, behind, strict=True)):
            frames_us = self._columns[0, :end].copy()
            frames_us[self._ranks_by_name[own.name]] = (own.identifiers - 1) * own.frame_us
            of_groups_us[:, number] = np.bincount(place[:end], frames_us, len(groups))
        own_all = Sender(*np.array([own.sender(1) for own in each]).T)
        burst, bursts_us = np.array([(own.burst, own.burst_us(1)) for own in each]).T
        for start in self._starts:
            times_us = (times[groups, np.newaxis] for times in start.times_us)
            yield worst_instance(
                own_all,
                Demand.of_many(Sender(of_groups_us, *times_us)),
                blocking_us=self._longest_us[behind],
                bit_us=self._bit_us,
                first_us=start.first_us[behind] - bursts_us,
                burst=burst,
            )

    def latest(self) -> tuple[Stream, Response | None]:
        """The message of plain numbers with the largest response over its deadline, and its response."""
        # Bounds come in closed form: few exact responses are left to find.
        ranked = sorted(self.bounds(), key=lambda pair: plain(pair[1]), reverse=True)
        latest, largest = ranked[0][0], 0.0
        worst = self.responses(own for own, _ in ranked)
        for _, bound in ranked:
            if bound <= largest:
                break
            own, response = next(worst)
            share = inf if response is None else response.us / own.deadline_us
            if share > largest:
                latest, largest = own, share
        return latest, self.response(latest)

    def bound_share(self, own: Stream) -> Points:
        """A bound of the response over the deadline; infinite where the load of the bus leaves no response [1]."""
        return self._bound(self._behind(own), own.sender(1), own.deadline_us)

    def _bound(self, behind: Points, own: Sender, deadline_us: Points) -> Points:
        load, own_most_us = self._loads[behind], own.frames_us + own.load * (own.jitter_us + self._bit_us)
        starts_us = (start.first_us[behind] + start.most_us[behind] for start in self._starts)
        most_us = reduce(larger, starts_us) - own_most_us + self._longest_us[behind]
        has_response = load < SATURATED
        idle = choose(has_response, 1 - load + own.load, 1.0)
        return choose(has_response, (own.jitter_us + own.frames_us + most_us / idle) / deadline_us, inf)

    def least_share(self, own: Stream) -> Points:
        """Lower bound of the response over the deadline, of a busy period that begins with SYNC [1]."""
        return self._least(self._behind(own), own.sender(1), own.deadline_us)

    def _least(self, behind: Points, own: Sender, deadline_us: Points) -> Points:
        load, waits_us = self._loads[behind], self._starts[0].least_us[behind] + self._longest_us[behind]
        waits_us = waits_us - own.load * (own.jitter_us + self._bit_us)
        has_response = load < SATURATED
        idle = choose(has_response, 1 - load + own.load, 1.0)
        least_us = own.jitter_us + own.frames_us + waits_us / idle
        return choose(has_response, least_us / deadline_us * BELOW, inf)

    def deadline_shares(self) -> Iterator[tuple[Stream, Points]]:
        """All messages, that of the lowest priority first, each with its `deadline_share`."""
        each = [*self.bounds()]
        if self._columns is not None:
            worst = self.responses(own for own, bound in each if 1 < bound < inf)
        for own, bound in each:
            if self._columns is not None and 1 < bound < inf:
                next(worst)  # which `deadline_share` then knows
            yield own, self.deadline_share(own, bound)

    def deadline_share(self, own: Stream, bound: Points) -> Points:
        """Response over deadline, or its bound where that is no more than 1; infinite without a response [1].

        Raises
        ------
        TooManyStepsError
            It takes too many steps to find at some of several points.
        """
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
    higher, blocking_us, first_us = _rivals(own, streams(traffic, is_stuffed=is_stuffed))
    if own.identifiers > 1:
        higher.append(own.sender(own.identifiers - 1))
    bit = plain(bit_us(traffic.bit_rate_kbit_s))
    return worst_response(own.sender(1), higher, blocking_us=plain(blocking_us), bit_us=bit, first_us=plain(first_us))


def _rivals(own: Stream, each: Iterable[Stream]) -> tuple[list[Sender], Points, Points]:
    """What goes before SYNC or a PDO, the longest frame that may hold it up [us], and what comes at once [us]."""
    higher: list[Sender] = []
    blocking_us: Points = 0.0
    first_us: Points = 0.0
    for stream in each:
        is_higher = stream.goes_before(own)
        if stream is not own and is_higher is not False:
            sender = stream.sender()
            higher.append(sender._replace(frames_us=choose(is_higher, sender.frames_us, 0.0)))
            first_us = first_us + choose(is_higher, stream.burst_us(), 0.0)
        if is_higher is not True and (own.name != SYNC or stream.is_message):
            blocking_us = larger(blocking_us, choose(is_higher, 0.0, stream.frame_us))
    return higher, blocking_us, first_us


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
    higher, blocking_us, first_us = _rivals(own, each)
    worst = worst_instance(
        own.sender(1),
        Demand(higher),
        blocking_us=blocking_us,
        bit_us=bit_us(traffic.bit_rate_kbit_s),
        first_us=first_us,
    )
    return inf if worst is None else choose(worst.us < inf, worst.blocking_us + worst.interference_us, inf)
