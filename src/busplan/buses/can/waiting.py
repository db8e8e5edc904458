"""Waits of a cycle for other messages, and worst-case responses: a network's senders in the rows of `response`."""

from array import array
from collections.abc import Container, Iterator, Sequence
from functools import cache, lru_cache
from importlib import import_module
from itertools import chain, islice, repeat
from math import ceil, inf, isclose
from types import ModuleType
from typing import Any, NamedTuple

from busplan.buses.can import response
from busplan.buses.can.equations import MOST_BLOCKS, bit_us
from busplan.buses.can.frames import NAMES, SYNC, Points, Stream, Traffic, last_place, streams
from busplan.elementwise import choose, from_rows, plain, rounded_up, rows, shape_of, smaller, total
from busplan.english import first_of

_FEEDBACK, _COMMAND = NAMES["read"], NAMES["write"]


class Waits(NamedTuple):
    """Waits of a cycle, from the queued SYNC to the end of the last command."""

    lasts_us: Points
    """All of it [us]."""
    blocking_us: Points
    """Frames of a lower priority than SYNC and all PDOs that go where these leave the bus idle [us]."""
    lower: tuple[Stream, ...]
    """Messages that may block it."""
    most: int
    """Frames of a lower priority that it waits for, at most [1]."""

    def blocks(self) -> Iterator[Stream]:
        """One of them for each frame that goes, of plain numbers; the longest first."""
        longest = sorted(self.lower, key=lambda stream: -plain(stream.frame_us))
        each = (repeat(stream, int(plain(_frames_within(stream, self.lasts_us)))) for stream in longest)
        return islice(chain.from_iterable(each), self.most)


def _frames_within(stream: Stream, span_us: Points) -> Points:
    """Frames of a message that keeps its deadline that are there in a span of time [1]."""
    each = rounded_up((span_us + stream.deadline_us) / stream.period_us) + stream.burst - 1
    return smaller(stream.identifiers * each, int(MOST_BLOCKS))


def sent_in(cyclic: Sequence[Stream], due: Container[str]) -> list[Stream]:
    """SYNC and the PDOs of some groups."""
    return [stream for stream in cyclic if stream.name == SYNC or stream.group in due]


def waits(traffic: Traffic, others_us: Points, due: frozenset[str] | None = None, *, is_stuffed: bool) -> Waits:
    """Find how long a cycle lasts with the frames of other messages.

    Parameters
    ----------
    traffic
        What is sent, as `Traffic.ask` gives it.
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
    whose deadline D is kept ends within it, so b - 1 + ceil((w + D) / T) of them are there in w. Frames that go before
    the last PDO go whenever they are queued: b - 1 + ceil((w + J + bit) / T).

    Nothing of that is still pending from the cycle before: all that was queued by w behind its start has been sent by
    then, and w is within the period.

    PDOs that are not in every cycle are all due in the fullest, and no other cycle lasts longer: it has fewer PDOs, and
    no more of the messages before the last PDO of the fullest. These may block its own PDOs, but each goes once.
    """
    each = streams(traffic, is_stuffed=is_stuffed)
    cyclic = [stream for stream in each if not stream.is_message]
    messages = [stream for stream in each if stream.is_message]
    bit, fullest = bit_us(traffic.bit_rate_kbit_s), last_place(cyclic)
    last = fullest if due is None else last_place(sent_in(cyclic, due))
    # Without PDOs a cycle ends with SYNC, which waits for a single frame.
    most = int(MOST_BLOCKS) if due is None or due else 1
    if due is not None:
        # Of messages before the last PDO of the fullest cycle nothing is pending at SYNC.
        messages = [
            stream._replace(
                deadline_us=choose(
                    stream.last_place <= fullest,
                    smaller(stream.deadline_us, stream.jitter_us + bit),
                    stream.deadline_us,
                )
            )
            for stream in messages
        ]
    if not messages:
        return Waits(others_us, 0.0, (), most)
    is_before = [stream.first_place <= last for stream in messages]
    is_lower = [stream.last_place > last for stream in messages]
    pairs = [*zip(messages, is_before, strict=True)]
    at_once_us = total(choose(goes, stream.burst_us, 0.0) for stream, goes in pairs)
    columns = (
        [others_us + at_once_us],
        [bit],
        [choose(goes, stream.frames_us, 0.0) for stream, goes in pairs],
        [choose(lower, stream.frame_us, 0.0) for stream, lower in zip(messages, is_lower, strict=True)],
        [stream.identifiers for stream in messages],
        [stream.burst for stream in messages],
        [stream.period_us for stream in messages],
        [stream.jitter_us for stream in messages],
        [stream.deadline_us for stream in messages],
    )
    shape = shape_of(chain.from_iterable(columns))
    found = rows([0.0], shape), rows([0.0], shape)
    _compute("cycle_waits", most, *(rows(column, shape) for column in columns), found=found)
    lower = tuple(stream for stream, is_one in zip(messages, is_lower, strict=True) if is_one is not False)
    return Waits(from_rows(found[0], 0, shape), from_rows(found[1], 0, shape), lower, most)


class Response(NamedTuple):
    """The worst case of a message: R = J + B + I + q C - (q - b + 1) T + C."""

    blocking_us: Points
    """B, the longest frame of a lower priority [us]."""
    instance: Points
    """q of the worst instance in the busy period, from 0 [1]."""
    interference_us: Points
    """I, frames of higher priorities that go before it [us]."""
    us: Points
    """R; infinite without an end, and then the rest says nothing [us]."""


@lru_cache(maxsize=4)
def message_responses(
    traffic: Traffic, *, is_stuffed: bool, is_verdict: bool = False
) -> tuple[tuple[Stream, Response], ...]:
    """Every message in the order of the profile, with its worst-case response.

    Parameters
    ----------
    traffic
        What is sent, as `Traffic.ask` gives it.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    is_verdict
        Whether a bound, without parts, is enough where it shows that a deadline is kept.

    """
    each, starts = streams(traffic, is_stuffed=is_stuffed), _starts(traffic, is_stuffed=is_stuffed)
    asked = [number for number, stream in enumerate(each) if stream.is_message]
    enough_us = [stream.deadline_us for stream in each] if is_verdict else None
    found = _worst(each, asked, starts, bit=bit_us(traffic.bit_rate_kbit_s), enough_us=enough_us)
    return tuple((each[number], response) for number, response in found.items())


def sync_response(traffic: Traffic, *, is_stuffed: bool) -> Response:
    """Worst-case response of SYNC, with arguments as `message_responses` has them.

    SYNC is blocked by messages alone: where the cycle fits, its PDOs have gone before the next SYNC.
    """
    each = streams(traffic, is_stuffed=is_stuffed)
    blocks = [stream.is_message for stream in each]
    return _worst(each, [0], [_Start()], bit=bit_us(traffic.bit_rate_kbit_s), blocks=blocks)[0]


@lru_cache(maxsize=4)
def responses(traffic: Traffic, *, is_stuffed: bool) -> tuple[tuple[Stream, Response], ...]:
    """SYNC, the last stream of each PDO, and every message, with the worst-case response of its last frame.

    Arguments are as `message_responses` has them, in plain numbers.
    """
    each = streams(traffic, is_stuffed=is_stuffed)
    pdos = [number for number, stream in enumerate(each) if number and stream.is_end and not stream.is_message]
    own = [stream._replace(block=stream.first_place) for stream in each]
    found = {0: sync_response(traffic, is_stuffed=is_stuffed)} if traffic.has_cycle else {}
    found |= _worst(own, pdos, [_Start()], bit=bit_us(traffic.bit_rate_kbit_s))
    return (
        *((each[number], response) for number, response in found.items()),
        *message_responses(traffic, is_stuffed=is_stuffed),
    )


def counted(traffic: Traffic, place: int, *, is_stuffed: bool) -> tuple[str, str]:
    """Frames in a response of `responses`, in words: the one that blocks, and those that go before it, by number.

    Parameters
    ----------
    traffic
        What is sent, in plain numbers.
    place
        Place of the response.
    is_stuffed
        Whether the stuff bits of the worst case are counted.
    """
    own, worst = responses(traffic, is_stuffed=is_stuffed)[place]
    higher, blocking = [], [""]
    for one in streams(traffic, is_stuffed=is_stuffed):
        if (one.block if own.is_message else one.first_place) <= own.last_place:
            higher.append(one)
        elif one.frame_us == worst.blocking_us and (one.is_message or own.name != SYNC):
            blocking.append(one.label)
    waited_us = worst.blocking_us + worst.interference_us + worst.instance * own.frame_us
    window_us = waited_us + plain(bit_us(traffic.bit_rate_kbit_s))
    for start in _starts(traffic, is_stuffed=is_stuffed) if own.is_message else [_Start()]:
        numbers = [
            (one.identifiers - (one == own))
            * (ceil((window_us + start.jitter_us(one)) / one.period_us) + one.burst - 1 + (one.name in start.late))
            for one in higher
        ]
        us = sum(n * one.frame_us for n, one in zip(numbers, higher, strict=True))
        if isclose(us, worst.interference_us, abs_tol=1e-6):
            each = [f"{n} {one.label} of {one.frame_us:g} us" for n, one in zip(numbers, higher, strict=True) if n]
            return blocking[:2][-1], first_of(each, _LISTED)
    return "", ""


_LISTED = 20
"""Senders whose frames are listed, at most."""


class _Start(NamedTuple):
    """Where in the cycle a busy period begins: late PDOs come at once, and all that is of the cycle in the next one."""

    late: Container[str] = ()
    late_us: Points = 0.0
    """So long behind the start of their cycle they come [us]."""
    period_us: Points = 0.0
    """Period of the cycle [us]."""

    def jitter_us(self, stream: Stream) -> Points:
        """Latest queueing of a stream; negative where the first comes so much behind the start [us]."""
        if stream.is_message or not self.late:
            return stream.jitter_us
        # Late ones come again with their own period. Of the others any may be due in the next cycle.
        again_us = stream.period_us if stream.name in self.late else self.period_us
        return smaller(self.late_us - again_us, 0.0)


def _starts(traffic: Traffic, *, is_stuffed: bool) -> list[_Start]:
    """Where a busy period of a message may begin: it has the worst of these.

    SYNC comes once a period, and feedback and commands behind it. So a busy period that begins with SYNC meets each
    once a period. One that begins with late feedback, or with late commands, meets these, and the next SYNC with all
    that follows it sooner than a period later.
    """
    if not traffic.has_cycle:
        return [_Start()]
    us = dict.fromkeys((SYNC, _FEEDBACK, _COMMAND), 0.0)
    for stream in streams(traffic, is_stuffed=is_stuffed):
        if not stream.is_message:
            us[stream.name] = us[stream.name] + stream.frames_us
    others_us = total(us.values()) + traffic.read_us + traffic.host_us
    commands_us = waits(traffic, others_us, is_stuffed=is_stuffed).lasts_us - us[_COMMAND]
    feedback_us = commands_us - traffic.host_us - us[_FEEDBACK]
    return [
        _Start(),
        _Start((_FEEDBACK, _COMMAND), feedback_us, traffic.period_us),
        _Start((_COMMAND,), commands_us, traffic.period_us),
    ]


def _worst(
    each: Sequence[Stream],
    asked: Sequence[int],
    starts: Sequence[_Start],
    *,
    bit: Points,
    blocks: Sequence[bool] | None = None,
    enough_us: Sequence[Points] | None = None,
) -> dict[int, Response]:
    """Worst-case response of the last frame of some streams, which is the longest of the stream's, by their numbers.

    Parameters
    ----------
    each
        Every stream; all identifiers from `block` on go first.
    asked
        Numbers of those that are asked for.
    starts
        Where a busy period may begin.
    bit
        Time of a bit [us].
    blocks
        Whether each may hold up one that goes before it; without it all may.
    enough_us
        Of each, a response that a bound may show it to have [us].
    """
    if not asked:
        return {}
    order = sorted(range(len(each)), key=lambda number: each[number].block)
    ranked, rank_of = [each[number] for number in order], sorted(range(len(each)), key=order.__getitem__)
    # Senders of equal period and jitters are a group: there are fewer groups than senders.
    times_us = [(own.period_us, *(start.jitter_us(own) for start in starts)) for own in ranked]
    groups: dict[Any, int] = {}
    group = [groups.setdefault(tuple(map(_token, us)), len(groups)) for us in times_us]
    period_us, *jitters_us = zip(*dict(zip(group, times_us, strict=True)).values(), strict=True)
    columns = (
        [own.last_place for own in ranked],
        [own.frame_us for own in ranked],
        [own.frame_us if blocks is None or blocks[number] else 0.0 for number, own in zip(order, ranked, strict=True)],
        [own.frames_us for own in ranked],
        [0.0 if enough_us is None else enough_us[number] for number in order],
        period_us,
        [bit],
    )
    once_us = [[own.burst_us + (own.name in start.late) * own.frames_us for own in ranked] for start in starts]
    shape = shape_of(chain.from_iterable((*columns, *jitters_us, *once_us)))
    integers = array("q", [rank_of[number] for number in asked]), array("q", group)
    places = array("d", [own.block for own in ranked])
    found = [rows([-inf] * len(asked), shape) for _ in range(4)]
    for own_once_us, own_jitter_us in zip(once_us, jitters_us, strict=True):
        _compute(
            "responses",
            *integers,
            places,
            *(rows(column, shape) for column in (*columns, own_once_us, own_jitter_us)),
            array("d", [0.0] * (len(ranked) + 1)),
            array("d", [0.0] * len(groups)),
            found=found,
        )
    worst = {}
    for place, number in enumerate(asked):
        blocked_us, late, wait_us, us = (from_rows(each_found, place, shape) for each_found in found)
        instance = (late if shape else int(plain(late))) + each[number].burst - 1
        interference_us = wait_us - blocked_us - instance * each[number].frame_us
        worst[number] = Response(blocked_us, instance, interference_us, us)
    return worst


def _token(number: Points) -> float:
    """A number as a key: equal plain numbers are one, an array is only itself."""
    return number if isinstance(number, int | float) else id(number)


def _compute(name: str, *numbers: Any, found: Sequence[Any]) -> None:
    """Write the results of a function of `response` into rows that are there."""
    if (compiled := _compiled()) is not None:
        getattr(compiled, name)(*numbers, *found)
        return
    lists = [each.tolist() for each in found]
    getattr(response, name)(*(each if isinstance(each, int) else each.tolist() for each in numbers), *lists)
    for rows_of, new in zip(found, lists, strict=True):
        for point, row in enumerate(new):
            for place, number in enumerate(row):
                rows_of[point, place] = number


@cache
def _compiled() -> ModuleType | None:
    """The compiled form of `response`; None where there is none."""
    try:
        return import_module("busplan.buses.can._response")
    except ImportError:  # also if it was built for another Python
        return None
