"""Worst-case latencies: the parts of a response, and the frames that a derivation names."""

from collections.abc import Mapping
from math import ceil, inf, isclose
from typing import Final, NamedTuple

from busplan.buses.can.equations import bit_us
from busplan.buses.can.streams import Points, Stream, repeated, repeated_by_place, streams
from busplan.buses.can.traffic import NO_DEADLINE_US, SYNC, Traffic, kept
from busplan.buses.can.waiting import BusyStart, arriving, beside_sync, busy_starts, offered, worst_cases
from busplan.elementwise import Number, Traced, choose, is_off, named, total, value_of
from busplan.english import first_of

_QUEUES: Final = "Davis 2011, 2012"
"""Source of a response in a queue that is not by priority: Davis, Kollmann, Pollex, Slomka; Davis, Navet."""


def phases(traffic: Traffic, place: int, name: str) -> dict[str, Number]:
    """Figures of a latency: those of the response of a name at a place of `responses`; of no arrays."""

    def figure(key: str, words: str, *behind: Number) -> Number:
        def of(traffic: Traffic, *_: Number) -> float:
            stream, worst = worst_cases(traffic)[place]
            if key in Stream._fields or key == "last":
                number: float = getattr(stream, key)
            else:
                number = getattr(worst, key) if worst.us < inf else inf
            return number

        return traffic.ask(of, *behind, words=words)

    said = _said(traffic, place, name)
    frame_us = figure("frame_us", f"the last frame of {name}")
    instance = figure("instance", f"the worst instance of {name} in the busy period, from 0")
    period_us = named(figure("period_us", f"period of {name}"), "period_us", "T")
    periods = instance
    if any(value_of(message.burst) > 1 for message in traffic.messages if message.name == name):
        burst = named(figure("burst", f"frames of {name} that may come at once"), "burst", "b")
        periods = instance - burst + 1
    parts_us = {
        "jitter_us": named(figure("jitter_us", f"how late {name} may be queued"), "jitter_us", "J"),
        "blocking_us": named(
            figure(
                "blocking_us", f"the longest frame of a lower priority than {said.lower}{said.blocks}", *said.behind
            ),
            "blocking_us",
            f"B{said.of_queue}",
            said.source,
        ),
        "interference_us": named(
            figure("interference_us", f"frames {said.higher}, in its worst instance{said.before}", *said.behind),
            "interference_us",
            f"I{said.of_queue}",
            said.source,
        ),
        "backlog_us": named(
            choose(instance < inf, instance * frame_us - periods * period_us, instance), "backlog_us", "q (C - T)"
        ),
        "frame_us": named(frame_us, "frame_us", "C"),
        "execution_us": 0.0,
        "adapter_us": 0.0,
        "pipeline_us": 0.0,
        "sync_wait_us": 0.0,
    }
    own = (message for message in traffic.messages if message.name == name)
    has_deadline = not any(message.deadline_us is NO_DEADLINE_US for message in own)
    return numbered(
        parts_us,
        said.source,
        identifier=figure("last", f"identifier of {name}"),
        data_bytes=figure("data_bytes", f"data of {name}"),
        instance=instance,
        deadline_us=figure("deadline_us", f"deadline of {name}") if has_deadline else inf,
    )


class _Said(NamedTuple):
    """Words of a derivation on the frames of a response."""

    blocks: str = ""
    """The frame that blocks, where a derivation is recorded."""
    before: str = ""
    """The frames that go before, where a derivation is recorded."""
    lower: str = ""
    """Name or symbol of what a frame of a lower priority is behind."""
    higher: str = ""
    """Sort of the frames that go before."""
    of_queue: str = ""
    """Argument of B and I in a queue that is not by priority."""
    source: str = ""
    """Source of the response in such a queue."""
    behind: tuple[Number, ...] = ()
    """Last identifier in such a queue, L."""


def _said(traffic: Traffic, place: int, name: str) -> _Said:
    """Words on the response of a name at a place of `responses`: the frames counted, and what its queue does."""
    point, lower, higher = traffic.point, name, f"of higher priorities before {name}"
    if not isinstance(point, Traced):
        return _Said(lower=lower, higher=higher)
    there = traffic.at(point.value)
    blocks, before = (f": {frames}" if frames else "" for frames in _counted(there, place))
    last = _last_in_queue(there, place)
    if last is None:
        return _Said(blocks, before, lower, higher)
    is_late = any(message.name == name for message in traffic.messages)
    words = (
        f"the lowest priority in the queue, {int(last.last):#x} of {last.label}: "
        f"{name} waits for all before it{', and comes to others R - C later' if is_late else ''} "
        "(Davis, Kollmann, Pollex, Slomka 2011; Davis, Navet 2012)"
    )
    identifier = traffic.ask(lambda _: last.last, words=words)
    behind = (named(identifier, "last_in_queue", "L", _QUEUES),)
    higher = f"of its queue and of higher priorities than L before {name}"
    return _Said(blocks, before, "L", higher, "(L)", _QUEUES, behind)


def numbered(parts_us: Mapping[str, Number], source: str = "", **figures: Number) -> dict[str, Number]:
    """Figures of a latency with the sum of its parts, and its source where it is not that of the figure."""
    deadline_us = figures.pop("deadline_us")
    response_us = named(total(parts_us.values()), "worst_response_us", "R", source)
    return {**figures, **parts_us, "worst_response_us": response_us, "deadline_us": deadline_us}


@kept
def _last_in_queue(traffic: Traffic, place: int) -> Stream | None:
    """Stream of the lowest priority in the queue of a response; None where the queue is by priority."""
    answered, _ = worst_cases(traffic)[place]
    return next((stream for stream in streams(traffic) if stream.last_place == answered.queue_place), None)


@kept
def _counted(traffic: Traffic, place: int) -> tuple[str, str]:
    """Frames in a response, in words: the one that blocks, and those that go before, by number."""
    answered, worst = worst_cases(traffic)[place]
    higher, blocking, sent = [], "", offered(traffic)
    if answered.name == SYNC:
        sent = beside_sync(sent)
    for stream in arriving(sent, answered.end_place):
        if (stream.block if answered.is_message else stream.first_place) <= answered.end_place:
            higher.append(stream)
        elif not blocking and stream.frame_us == worst.blocking_us and (stream.is_message or answered.name != SYNC):
            blocking = stream.label
    if not is_off(traffic.error_burst):
        # The same number of errors hits each place.
        errors = [*repeated_by_place(streams(traffic), traffic)]
        higher.append(repeated(higher, traffic)._replace(jitter_us=errors[0].jitter_us))
    waited_us = worst.blocking_us + worst.interference_us + worst.instance * answered.frame_us
    window_us = waited_us + bit_us(traffic.bit_rate_kbit_s)
    for start in busy_starts(sent, traffic) if answered.is_message else [BusyStart()]:
        numbers = [
            (stream.identifiers - (stream == answered))
            * (
                ceil((window_us + start.jitter_us(stream)) / stream.period_us)
                + stream.burst
                - 1
                + (stream.name in start.late)
            )
            for stream in higher
        ]
        before = [(number, stream) for number, stream in zip(numbers, higher, strict=True) if number]
        us = sum(number * stream.frame_us for number, stream in before)
        if isclose(us, worst.interference_us, abs_tol=1e-6):
            return blocking, first_of(
                [
                    f"{number} {stream.label} of {stream.frame_us:g} us{_held(stream, answered.end_place)}"
                    for number, stream in before
                ],
                _LISTED,
            )
    return "", ""


def _held(stream: Stream, end: Points) -> str:
    """Time that a stream may stay in its queue, in words; empty where it comes when it is queued."""
    if not stream.is_message or stream.queue_place is None or stream.queue_place <= end:
        return ""
    return f", which its queue may hold up to {stream.jitter_us:g} us"


_LISTED: Final = 20
"""Most senders whose frames are listed."""
