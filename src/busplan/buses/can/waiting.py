"""Waits of a cycle for other messages, and worst-case responses: streams as the records that `response` takes."""

from array import array
from collections.abc import Collection, Container, Iterator, Sequence
from functools import cache, reduce
from importlib import import_module
from math import ceil
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from busplan.buses.can import response
from busplan.buses.can.equations import bit_us, c
from busplan.buses.can.streams import Points, Stream, last_place, repeated, repeated_by_place, streams
from busplan.buses.can.traffic import NAMES, SYNC, Traffic, kept
from busplan.elementwise import are_plain, choose, is_everywhere, is_off, larger, smaller, total

if TYPE_CHECKING:
    from numpy.typing import NDArray

_FEEDBACK, _COMMAND = NAMES["read"], NAMES["write"]


class LongestCycle(NamedTuple):
    """The longest cycle, from the queued SYNC to the end of the last command, and what it waits for."""

    lasts_us: Points
    """Time from the queued SYNC to the end of the last command, w [us]."""
    blocking_us: Points
    """Frames of a lower priority than SYNC and all PDOs that go where these leave the bus idle [us]."""
    lower: tuple[Stream, ...]
    """Messages that may block the cycle."""
    most: int
    """Most frames of a lower priority that the cycle waits for [1]."""

    def blocks(self) -> list[Stream]:
        """Message of each frame that blocks, the longest first; of plain numbers."""
        frames: list[Stream] = []
        for message in sorted(self.lower, key=lambda message: -message.frame_us):
            # As many as are there within the cycle, of a message that keeps its deadline.
            count = ceil((self.lasts_us + message.deadline_us) / message.period_us) + message.burst - 1
            frames += [message] * int(min(message.identifiers * count, self.most))
        return frames[: self.most]


def sent_in(cyclic: Sequence[Stream], due: Container[str]) -> list[Stream]:
    """SYNC and the PDOs of some groups."""
    return [stream for stream in cyclic if stream.name == SYNC or stream.group in due]


def longest_cycle(traffic: Traffic, others_us: Points, due: frozenset[str] | None = None) -> LongestCycle:
    """Time of a cycle that takes `others_us` without the frames of other messages, with them [us].

    `due` names the groups whose PDOs are in the cycle; without it the cycle is the fullest, and no other lasts longer.

    SYNC, the feedback of the slowest node and the commands each meet an idle bus, or a bus that has just become busy. A
    frame of a lower priority may have started then: three such frames, the longest that can be there. One of a message
    whose deadline D is kept ends within it, so b - 1 + ceil((w + D) / T) of them are there in w. Frames that go before
    the last PDO go whenever they are queued: b - 1 + ceil((w + J + bit) / T). So do errors: each takes the time of the
    longest frame of all, of those that block, too.

    Nothing of that is still pending from the cycle before: all that was queued by w behind its SYNC has been sent by
    then, and w is within the period less the jitter of SYNC, the least time to the next one.

    In a queue that is not by priority SYNC or a PDO may be behind each message of its sender. So frames go before it
    up to the last identifier of the queue.

    Without SYNC each request meets such a bus, and so does each answer; of requests at once, the last of them and the
    last answer behind an idle bus. Of two bounds the smaller one counts: as many of the longest frames of a lower
    priority, or each of them that can be there.

    PDOs that are not in every cycle are all due in the fullest, and no other cycle lasts longer: it has fewer PDOs, and
    no more of the messages before the last PDO of the fullest. These may block its own PDOs, but each goes once.
    """
    return (_longest_of_plain if are_plain(others_us) else _longest)(traffic, others_us, due)


def _longest(traffic: Traffic, others_us: Points, due: frozenset[str] | None) -> LongestCycle:
    return _longest_cycle(offered(traffic), traffic, others_us, due)


_longest_of_plain: Final = kept(_longest)


def _longest_cycle(
    sent: Sequence[Stream], traffic: Traffic, others_us: Points, due: frozenset[str] | None = None
) -> LongestCycle:
    cyclic = [stream for stream in sent if not stream.is_message]
    bit, fullest = bit_us(traffic.bit_rate_kbit_s), last_place(cyclic)
    messages = [stream for stream in arriving(sent, fullest) if stream.is_message]
    last, most = fullest, int(c.MOST_BLOCKS)
    if due is not None:
        last = last_place(sent_in(cyclic, due))
        # Without PDOs a cycle ends with SYNC, which waits for a single frame.
        most = most if due else 1
        # Of messages before the last PDO of the fullest cycle nothing is pending at SYNC.
        messages = [
            message._replace(
                deadline_us=choose(
                    message.last_place <= fullest,
                    smaller(message.deadline_us, message.jitter_us + bit),
                    message.deadline_us,
                )
            )
            for message in messages
        ]
    if not is_off(traffic.error_burst):
        # A frame that blocks may be repeated, too, where the bus is idle behind it.
        messages.append(repeated(sent, traffic))
    if not messages:
        return LongestCycle(others_us, 0.0, (), most)
    before = [(message, message.first_place <= last) for message in messages]
    lower = [(message, message.last_place > last) for message in messages]
    if not traffic.has_sync:
        return LongestCycle(_of_requests_us(before, lower, traffic, others_us), 0.0, (), 0)
    once_us = total(choose(goes, message.burst_us, 0.0) for message, goes in before)
    lasts_us, blocking_us = _beside_messages(
        most,
        others_us + once_us,
        bit,
        messages,
        before_us=[choose(goes, message.frames_us, 0.0) for message, goes in before],
        lower_us=[choose(blocks, message.frame_us, 0.0) for message, blocks in lower],
    )
    return LongestCycle(lasts_us, blocking_us, tuple(message for message, blocks in lower if blocks is not False), most)


def _of_requests_us(
    before: Sequence[tuple[Stream, Points]], lower: Sequence[tuple[Stream, Points]], traffic: Traffic, others_us: Points
) -> Points:
    """Time of a cycle without SYNC, with messages that go before its last frame, or block it [us]."""
    messages = [message for message, _ in before]
    late = [
        message._replace(jitter_us=choose(blocks, larger(message.jitter_us, message.deadline_us), message.jitter_us))
        for message, blocks in lower
    ]
    longest_us = reduce(larger, (choose(blocks, message.frame_us, 0.0) for message, blocks in lower))
    number = 2 * traffic.requests if traffic.access == "polled" else 2
    bounds_us = []
    for sent, goes, blocked_us in (
        (messages, [goes for _, goes in before], number * longest_us),
        (late, [True] * len(late), 0.0),
    ):
        once_us = total(choose(is_sent, message.burst_us, 0.0) for message, is_sent in zip(sent, goes, strict=True))
        bound_us, _ = _beside_messages(
            int(c.MOST_BLOCKS),
            others_us + blocked_us + once_us,
            bit_us(traffic.bit_rate_kbit_s),
            sent,
            before_us=[choose(is_sent, message.frames_us, 0.0) for message, is_sent in zip(sent, goes, strict=True)],
            lower_us=[0.0] * len(sent),
        )
        bounds_us.append(bound_us)
    return smaller(*bounds_us)


def _beside_messages(
    most: int,
    others_us: Points,
    bit: Points,
    messages: Sequence[Stream],
    *,
    before_us: Sequence[Points],
    lower_us: Sequence[Points],
) -> tuple[Points, Points]:
    """Time of a cycle beside some messages, and what blocks in it, as `response.cycle_waits` finds them [us]."""
    columns: dict[str, Sequence[Points]] = {"before_us": before_us, "lower_us": lower_us}
    of_messages = ("identifiers", "burst", "period_us", "jitter_us", "deadline_us")
    columns |= {key: [getattr(message, key) for message in messages] for key in of_messages}
    shape = _shape([others_us, bit], *columns.values())
    tables = {key: _table(column, shape) for key, column in columns.items()}
    found = _computing().cycle_waits(most, _row(others_us, shape), _row(bit, shape), response.Messages(**tables))
    return _points(found.lasts_us, shape), _points(found.blocking_us, shape)


def before_the_last(traffic: Traffic, due: frozenset[str] | None, name: str) -> tuple[Points, Points]:
    """Whether a message goes before the last frame of a cycle, whose groups are `due`, and how late it comes [us]."""
    sent = offered(traffic)
    cyclic = [stream for stream in sent if not stream.is_message]
    (message,) = (stream for stream in arriving(sent, last_place(cyclic)) if stream.is_message and stream.name == name)
    return message.first_place <= last_place(cyclic if due is None else sent_in(cyclic, due)), message.jitter_us


class WorstCase(NamedTuple):
    """Worst case of a message: R = J + B + I + q C - (q - b + 1) T + C."""

    blocking_us: Points
    """Longest frame of a lower priority, B [us]."""
    instance: Points
    """Worst instance q in the busy period, from 0 [1]."""
    interference_us: Points
    """Frames of higher priorities that go before it, I [us]."""
    us: Points
    """Response R; infinite without an end, and then the rest says nothing [us]."""


@kept
def message_responses(traffic: Traffic, *, is_verdict: bool = False) -> tuple[tuple[Stream, WorstCase], ...]:
    """Every message in the order of the profile, with its worst-case response.

    For a verdict a bound, without parts, is enough where it shows that a deadline is kept.
    """
    sent = offered(traffic)
    messages = [number for number, stream in enumerate(sent) if stream.is_message]
    enough_us = [stream.deadline_us for stream in sent] if is_verdict else None
    worst = _worst(sent, messages, busy_starts(sent, traffic), traffic, enough_us=enough_us)
    return tuple((sent[number], response) for number, response in worst.items())


@kept
def offered(traffic: Traffic) -> tuple[Stream, ...]:
    """Every stream, with the instant from which on its queue offers it: R - C, the smallest that agrees with itself.

    References
    ----------
    R. I. Davis, S. Kollmann, V. Pollex, F. Slomka, Controller Area Network (CAN) schedulability analysis with FIFO
    queues, ECRTS 2011: what waits in such a queue comes to others with the buffering delay as jitter. R. I. Davis,
    N. Navet, Controller Area Network (CAN) schedulability analysis for messages with arbitrary deadlines in FIFO and
    work-conserving queues, WFCS 2012: in a queue of any order a message may wait for each other one of it.
    """
    sent = streams(traffic)
    queued = [number for number, stream in enumerate(sent) if stream.is_message and stream.queue_place is not None]
    for _ in range(_ROUNDS if queued else 0):
        before, worst = sent, _worst(sent, queued, busy_starts(sent, traffic), traffic)
        sent = tuple(
            stream._replace(offered_us=smaller(worst[number].us - stream.frame_us, _NEVER_US))
            if number in worst
            else stream
            for number, stream in enumerate(sent)
        )
        if all(is_everywhere(sent[number].offered_us <= before[number].offered_us) for number in queued):
            return sent
    if not queued:
        return sent
    # Where they agree at some points only.
    return tuple(
        stream._replace(offered_us=choose(stream.offered_us <= earlier.offered_us, stream.offered_us, _NEVER_US))
        for stream, earlier in zip(sent, before, strict=True)
    )


_ROUNDS: Final = 100
"""Most rounds until the delays in queues agree."""
_NEVER_US: Final = 1e12
"""Delay without an end [us]: more than a period may be, and finite, for it is divided by periods."""


def arriving(sent: Sequence[Stream], end: Points) -> list[Stream]:
    """Streams as they come to those that go before a place: a message of a queue that reaches behind it comes late.

    Where its queue does not reach so far, all that it waits for goes before the place, too.
    """
    return [
        stream
        if stream.queue_place is None or not stream.is_message
        else stream._replace(jitter_us=choose(stream.queue_place > end, stream.offered_us, stream.jitter_us))
        for stream in sent
    ]


def sync_response(traffic: Traffic) -> WorstCase:
    """Worst-case response of SYNC.

    SYNC is blocked by messages alone: where the cycle fits, its PDOs have gone before the next SYNC.
    """
    sent = beside_sync(offered(traffic))
    return _worst(sent, [0], [BusyStart()], traffic, blocks=[stream.is_message for stream in sent])[0]


def beside_sync(sent: tuple[Stream, ...]) -> tuple[Stream, ...]:
    """SYNC and the streams that it may wait for: in a queue it is behind messages alone."""
    if sent[0].queue_place is None:
        return sent
    return (sent[0], *(stream for stream in sent if stream.is_message))


@kept
def worst_cases(traffic: Traffic) -> tuple[tuple[Stream, WorstCase], ...]:
    """SYNC, the last stream of each PDO, and every message, with the worst-case response of its last frame.

    Without SYNC a PDO may wait for each other one, as if all were queued at once: messages gather behind those before.
    Numbers are plain.
    """
    sent = offered(traffic)
    sync = [(sent[0], sync_response(traffic))] if traffic.has_sync else []
    # The last frame of each PDO.
    ends = {
        (stream.name, stream.group): number
        for number, stream in enumerate(sent)
        if stream.name != SYNC and not stream.is_message
    }
    # Each PDO is behind those of smaller identifiers; a message, behind the whole block before it.
    by_place = [stream._replace(block=stream.first_place) for stream in sent]
    pdos = [
        (sent[number], worst) for number, worst in _worst(by_place, [*ends.values()], [BusyStart()], traffic).items()
    ]
    return (*sync, *pdos, *message_responses(traffic))


class BusyStart(NamedTuple):
    """Instant at which a busy period begins: late PDOs come at once, and all of the cycle in the next one."""

    late: Container[str] = ()
    """Names of the late PDOs."""
    late_us: Points = 0.0
    """Time of the late PDOs from the start of their cycle [us]."""
    period_us: Points = 0.0
    """Period of the cycle [us]."""

    def jitter_us(self, stream: Stream) -> Points:
        """Latest queueing of a stream; negative where the first frame comes so much behind the start [us]."""
        if stream.is_message or not self.late:
            return stream.jitter_us
        # Late ones come again with their own period. Of the others any may be due in the next cycle. Where the first
        # SYNC was late and the others are not, all come sooner by its jitter.
        again_us = stream.period_us if stream.name in self.late else self.period_us
        return smaller(self.late_us + stream.jitter_us - again_us, 0.0)


def busy_starts(sent: Sequence[Stream], traffic: Traffic) -> list[BusyStart]:
    """Instants at which a busy period of a message may begin: it has the worst of these.

    SYNC comes once a period, sooner by its jitter, and feedback and commands behind it. So a busy period that begins
    with SYNC meets each once a period. One that begins with late feedback, or with late commands, meets these, and the
    next SYNC with all that follows it sooner than a period later. Behind messages of their queue, and without SYNC,
    these may be as late as the end of the cycle; SYNC behind such messages begins no other busy period, for all that is
    before it then is sent in this cycle.
    """
    if not traffic.has_cycle:
        return [BusyStart()]
    us = dict.fromkeys((SYNC, _FEEDBACK, _COMMAND), 0.0)
    for stream in sent:
        if not stream.is_message:
            us[stream.name] = us[stream.name] + stream.frames_us
    others_us = total(us.values()) + traffic.read_us + traffic.host_us + traffic.adapter_us
    lasts_us = _longest_cycle(sent, traffic, others_us).lasts_us
    if not traffic.has_sync or any(stream.queue_place is not None and not stream.is_message for stream in sent):
        return [BusyStart(), BusyStart((_FEEDBACK, _COMMAND), lasts_us, traffic.period_us)]
    commands_us = lasts_us - us[_COMMAND]
    feedback_us = commands_us - traffic.host_us - traffic.adapter_us - us[_FEEDBACK]
    return [
        BusyStart(),
        BusyStart((_FEEDBACK, _COMMAND), feedback_us, traffic.period_us),
        BusyStart((_COMMAND,), commands_us, traffic.period_us),
    ]


def _worst(
    sent: Sequence[Stream],
    answered: Collection[int],
    begun: Sequence[BusyStart],
    traffic: Traffic,
    *,
    blocks: Sequence[bool] | None = None,
    enough_us: Sequence[Points] | None = None,
) -> dict[int, WorstCase]:
    """Worst-case response of the last frame of some streams, the longest of each stream, by their numbers in `sent`.

    All identifiers from `block` on go before a stream. Each other stream may hold it up, unless `blocks` says no. Where
    a bound is no longer than what is enough, it stands for the response.
    """
    levels: dict[object, list[int]] = {}
    queue_places = [stream.queue_place for stream in sent if stream.queue_place is not None]
    for number in answered:
        end_place = sent[number].end_place
        later = [place > end_place for place in queue_places]
        # Those before the same ends of queues meet all others alike.
        is_plain = all(isinstance(is_it, bool) for is_it in later)
        levels.setdefault(sum(later) if is_plain else f"message {number}", []).append(number)
    worst: dict[int, WorstCase] = {}
    for numbers in levels.values():
        seen = arriving(sent, sent[numbers[0]].end_place)
        worst |= _searched(seen, numbers, begun, traffic, blocks=blocks, enough_us=enough_us)
    return {number: worst[number] for number in answered}


def _searched(
    sent: Sequence[Stream],
    answered: Sequence[int],
    begun: Sequence[BusyStart],
    traffic: Traffic,
    *,
    blocks: Sequence[bool] | None,
    enough_us: Sequence[Points] | None,
) -> Iterator[tuple[int, WorstCase]]:
    """Responses of streams that meet the others alike, as `response.responses` finds them."""
    both = [*sent, *repeated_by_place(sent, traffic)]
    order = sorted(range(len(both)), key=lambda number: both[number].block)
    ranked, rank_of = [both[number] for number in order], {number: rank for rank, number in enumerate(order)}
    # Senders of equal period and jitters are a group: there are fewer groups than senders.
    times_us = [(stream.period_us, *(start.jitter_us(stream) for start in begun)) for stream in ranked]
    groups: dict[Any, int] = {}
    group = [groups.setdefault(tuple(map(_token, us)), len(groups)) for us in times_us]
    period_us, *jitters_us = zip(*dict(zip(group, times_us, strict=True)).values(), strict=True)
    onces_us = [
        [stream.burst_us + (stream.name in start.late) * stream.frames_us for stream in ranked] for start in begun
    ]
    columns = {
        "last": [stream.end_place for stream in ranked],
        "frame_us": [stream.frame_us for stream in ranked],
        "blocking_us": [
            both[number].frame_us if number < len(sent) and (blocks is None or blocks[number]) else 0.0
            for number in order
        ],
        "sent_us": [stream.frames_us for stream in ranked],
        "enough_us": [0.0 if enough_us is None or number >= len(sent) else enough_us[number] for number in order],
        "period_us": period_us,
    }
    bit = bit_us(traffic.bit_rate_kbit_s)
    shape = _shape([bit], *columns.values(), *onces_us, *jitters_us)
    found = _computing().responses(
        array("q", [rank_of[number] for number in answered]),
        response.Senders(
            group=array("q", group),
            place=array("d", [stream.block for stream in ranked]),
            bit_us=_row(bit, shape),
            **{key: _table(column, shape) for key, column in columns.items()},
        ),
        [
            response.Start(_table(once_us, shape), _table(jitter_us, shape))
            for once_us, jitter_us in zip(onces_us, jitters_us, strict=True)
        ],
    )
    for place, number in enumerate(answered):
        blocked_us, late, wait_us, us = (_points(table[:, place], shape) for table in found)
        instance = (late if shape else int(late)) + sent[number].burst - 1
        interference_us = wait_us - blocked_us - instance * sent[number].frame_us
        yield number, WorstCase(blocked_us, instance, interference_us, us)


def _token(number: Points) -> float:
    """A number as a key: equal plain numbers are one, an array is only itself."""
    return number if isinstance(number, int | float) else id(number)


def _shape(*columns: Sequence[Points]) -> tuple[int, ...]:
    """Shape of the points of all columns together; empty where all numbers are plain."""
    import numpy as np  # noqa: PLC0415 - only what waits for messages loads it

    return np.broadcast_shapes(*{getattr(number, "shape", ()) for column in columns for number in column})


def _table(column: Sequence[Points], shape: tuple[int, ...]) -> "NDArray[Any]":
    """A row of the numbers of a column for each point."""
    import numpy as np  # noqa: PLC0415 - only what waits for messages loads it

    if not shape:
        return np.array([column], dtype=float)
    return np.stack([np.broadcast_to(number, shape).ravel() for number in column], axis=1).astype(float)


def _row(number: Points, shape: tuple[int, ...]) -> Any:
    """A number at each point."""
    return _table([number], shape)[:, 0]


def _points(row: Any, shape: tuple[int, ...]) -> Points:
    """Numbers of each point in the shape of the points."""
    if not shape:
        return float(row[0])
    import numpy as np  # noqa: PLC0415 - only what waits for messages loads it

    return np.asarray(row).reshape(shape)


def _computing() -> Any:
    """`response`, compiled where it can be."""
    return _compiled() or response


@cache
def _compiled() -> ModuleType | None:
    """`response` compiled; None without a compiler."""
    try:
        return import_module("busplan.buses.can._response")
    except ImportError:  # also if it was built for another Python
        return None
