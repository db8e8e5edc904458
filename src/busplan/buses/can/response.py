"""Worst-case response times of CAN frames, and the wait of a cycle: fixed priorities, no frame interrupts another.

Plain numbers, compiled by Cython when the package is built (types: `_response.pxd`); without a compiler the same file
runs as plain Python. Senders stand in the order of arbitration, and those of equal period and jitter are a group. Frame
m waits for B, the longest frame of a lower priority; for S, what comes once when its busy period begins; and for all
that is queued meanwhile by the senders before it, hp(m):

    t    = B + S + sum over hp(m) and m of ceil((t + J) / T) C                         the busy period
    w(q) = B + S + q C + sum over hp(m) of ceil((w(q) + J + bit) / T) C                the wait of instance q
    R    = the largest J + w(q) - q T + C, over all q with q T < t + J                 the response

`span_us` finds t and w(q), `worst_instance` R, and `responses` B, S and hp(m) of each frame at each point of a sweep.
Of a burst of b frames b - 1 are in S. An error term E(t) would stand beside S, the delay in a buffer beside J.

References
----------
R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised, Real-Time Systems 35, 2007, equations (4)-(12).
"""

# Called as math.ceil, so that compiled code calls that of C.
import math
from array import array
from collections.abc import MutableSequence, Sequence
from typing import Any, NamedTuple

from busplan.buses.can import equations as constants

SATURATED = float(constants.SATURATED)
MOST_STEPS = int(constants.MOST_STEPS)
NEARLY_FULL = 0.99
"""Load above which the wait of a cycle is a bound in closed form [1]."""
BELOW = 1 - 1e-9
"""A bound from below is taken so much lower, so that rounding does not put it above what it bounds."""

Row = Sequence[float]
Results = MutableSequence[float]
Table = Any
"""Numbers with a row for each point, an array."""


class Senders(NamedTuple):
    """Senders in the order of arbitration; tables have a column for each of them."""

    group: Sequence[int]
    """Group of each sender."""
    place: Row
    """Place of the first frame of each sender, ascending."""
    last: Table
    """Place of the last frame, whose response is found."""
    frame_us: Table
    """A frame, C [us]."""
    blocking_us: Table
    """A frame that may block; 0 of a sender that may not [us]."""
    sent_us: Table
    """All frames of a period [us]."""
    enough_us: Table
    """A response that needs no search: a bound that is no longer stands for it [us]."""
    period_us: Table
    """Period T of each group, in columns by group [us]."""
    bit_us: Row
    """Time of a bit at each point [us]."""


class Start(NamedTuple):
    """Start of a busy period."""

    once_us: Table
    """Frames that each sender sends once [us]."""
    jitter_us: Table
    """Jitter J of each group, in columns by group; negative where its first frames come behind the start [us]."""


class Responses(NamedTuple):
    """Responses of the longest start; the others say nothing where R is infinite. Columns stand for the answered."""

    blocking_us: Table
    """B [us]."""
    instance: Table
    """q of the worst instance, the first of equals [1]."""
    wait_us: Table
    """w(q) [us]."""
    us: Table
    """R; infinite where hp(m) and m load the bus by `SATURATED`, or where it takes too many steps to find [us]."""


class Messages(NamedTuple):
    """Messages beside a cycle; tables have a column for each of them."""

    before_us: Table
    """All frames of a period where it goes before the last PDO, otherwise 0 [us]."""
    lower_us: Table
    """A frame where it may block, otherwise 0 [us]."""
    identifiers: Table
    """Nodes that send it [1]."""
    burst: Table
    """Frames that each of them may queue at once, b [1]."""
    period_us: Table
    """Period T [us]."""
    jitter_us: Table
    """Jitter J [us]."""
    deadline_us: Table
    """Deadline D [us]."""


class CycleWaits(NamedTuple):
    """Waits of a cycle at each point."""

    lasts_us: Row
    """w [us]."""
    blocking_us: Row
    """Frames of lower priorities in it [us]."""


def span_us(ahead_us: float, from_us: float, bit_us: float, sent_us: Row, period_us: Row, jitter_us: Row) -> float:
    """The smallest w = ahead + sum of ceil((w + J + bit) / T) C that is no less than `from_us`, which it passes [us].

    In columns by group: all frames C of a period, T and J. A frame takes part in an arbitration that began within a
    bit. Infinite where it takes over `MOST_STEPS` steps to find.
    """
    load, least = 0.0, ahead_us
    for group in range(len(sent_us)):
        load += sent_us[group] / period_us[group]
        least += sent_us[group] / period_us[group] * (jitter_us[group] + bit_us)
    # ceil(x) is no less than x.
    span = max(ahead_us, from_us, least / (1.0 - load) * BELOW)
    for _ in range(MOST_STEPS):
        further = ahead_us
        for group in range(len(sent_us)):
            if sent_us[group] > 0.0:
                further += math.ceil((span + bit_us + jitter_us[group]) / period_us[group]) * sent_us[group]
        if further <= span:
            return span
        span = further
    return math.inf


def bound_us(ahead_us: float, bit_us: float, sent_us: Row, period_us: Row, jitter_us: Row) -> float:
    """A span that `span_us` does not pass: ceil(x) is less than x + 1. From `SATURATED` on it only says full [us]."""
    load, most = 0.0, ahead_us
    for group in range(len(sent_us)):
        load += sent_us[group] / period_us[group]
        most += sent_us[group] + sent_us[group] / period_us[group] * (jitter_us[group] + bit_us)
    return most / (1.0 - min(load, SATURATED))


def worst_instance(
    group: int, own_us: float, ahead_us: float, bit_us: float, sent_us: Results, period_us: Row, jitter_us: Row
) -> tuple[float, float, float]:
    """The worst instance q of a frame C of a group behind B + S, with w(q) and R, below a load of `SATURATED` [1, us].

    The frames of hp(m) and m are in `sent_us`, by group. R is infinite where it takes too many steps to find.
    """
    own_period_us, own_jitter_us, all_us = period_us[group], jitter_us[group], sent_us[group]
    busy_us = span_us(ahead_us, own_us, 0.0, sent_us, period_us, jitter_us)
    sent_us[group] = all_us - own_us
    worst, worst_wait_us, worst_us = 0, 0.0, 0.0
    wait, instance = 0.0, 0
    while instance * own_period_us < busy_us + own_jitter_us:
        first_us, due_us = ahead_us + instance * own_us, instance * own_period_us - own_jitter_us
        # A bound of the response falls from one instance to the next.
        if bound_us(first_us, bit_us, sent_us, period_us, jitter_us) + own_us - due_us <= worst_us:
            break
        # It waits no shorter than the one before it.
        wait = span_us(first_us, wait, bit_us, sent_us, period_us, jitter_us)
        if wait == math.inf or instance == MOST_STEPS:
            worst_us = math.inf
            break
        if wait + own_us - due_us > worst_us:
            worst, worst_wait_us, worst_us = instance, wait, wait + own_us - due_us
        instance += 1
    sent_us[group] = all_us
    return worst, worst_wait_us, worst_us


def responses(answered: Sequence[int], senders: Senders, starts: Sequence[Start]) -> Responses:
    """Worst-case responses of the senders with some ranks at each point, over all starts of the busy period."""
    import numpy as np  # noqa: PLC0415 - only what waits for messages loads it

    found = Responses(*(np.full((len(senders.bit_us), len(answered)), -math.inf) for _ in Responses._fields))
    for start in starts:
        _respond(answered, senders, start, found)
    return found


def _respond(answered: Sequence[int], senders: Senders, start: Start, found: Responses) -> None:
    """Enter the responses from one start, where they are longer than those found so far."""
    group, place, last, frame_us, enough_us = (
        senders.group,
        senders.place,
        senders.last,
        senders.frame_us,
        senders.enough_us,
    )
    blocks_us, sent_us, period_us, bit_us = senders.blocking_us, senders.sent_us, senders.period_us, senders.bit_us
    once_us, jitter_us = start.once_us, start.jitter_us
    blocking_us, instance, wait_us, response_us = found.blocking_us, found.instance, found.wait_us, found.us
    count, groups = len(place), period_us.shape[1]
    longest_us: Results = array("d", [0.0] * (count + 1))
    before_us: Results = array("d", [0.0] * groups)
    for point in range(len(bit_us)):
        ends, frames, blocks = last[point], frame_us[point], blocks_us[point]
        sent, once, periods, jitters = sent_us[point], once_us[point], period_us[point], jitter_us[point]
        for rank in range(count - 1, -1, -1):
            longest_us[rank] = max(longest_us[rank + 1], blocks[rank])
        rank, load, first_us = 0, 0.0, 0.0
        for number in range(len(answered)):
            sender = answered[number]
            if number == 0 or place[rank - 1] > ends[sender]:
                rank, load, first_us = 0, 0.0, 0.0
                for index in range(groups):
                    before_us[index] = 0.0
            while rank < count and place[rank] <= ends[sender]:
                before_us[group[rank]] += sent[rank]
                load += sent[rank] / periods[group[rank]]
                first_us += once[rank]
                rank += 1
            ahead_us = longest_us[rank] + first_us
            worst, wait, response = 0.0, 0.0, math.inf
            if load < SATURATED:
                # The busy period holds all of it.
                response = jitters[group[sender]] + bound_us(ahead_us, 0.0, before_us, periods, jitters)
                if response > enough_us[point][sender]:
                    worst, wait, response = worst_instance(
                        group[sender], frames[sender], ahead_us, bit_us[point], before_us, periods, jitters
                    )
            if response > response_us[point][number]:
                blocking_us[point][number], instance[point][number] = longest_us[rank], worst
                wait_us[point][number], response_us[point][number] = wait, response


def cycle_waits(most: int, others_us: Row, bit_us: Row, messages: Messages) -> CycleWaits:
    """Time of a cycle beside other messages at each point, of which `most` frames may block it.

    It is the smallest w = others + blocked(w) + sum over the messages before the last PDO of ceil((w + J + bit) / T) C.
    With a load of these messages over `NEARLY_FULL` w is a bound in closed form, which from `SATURATED` on only says
    that the bus is full.
    """
    before_us, lower_us, identifiers, burst = (
        messages.before_us,
        messages.lower_us,
        messages.identifiers,
        messages.burst,
    )
    period_us, jitter_us, deadline_us = messages.period_us, messages.jitter_us, messages.deadline_us
    lasts_us: Results = array("d", [0.0] * len(bit_us))
    blocked_us: Results = array("d", [0.0] * len(bit_us))
    for point in range(len(bit_us)):
        before, lower, periods, jitters = before_us[point], lower_us[point], period_us[point], jitter_us[point]
        numbers, bursts, deadlines = identifiers[point], burst[point], deadline_us[point]
        ahead_us, bit, span, load, blocked, longer = others_us[point], bit_us[point], 0.0, 0.0, -1.0, 0.0
        for message in range(len(before)):
            load += before[message] / periods[message]
        while longer > blocked and load <= NEARLY_FULL:
            blocked = longer
            span = span_us(ahead_us + blocked, span, bit, before, periods, jitters)
            longer = blocking_us(span, most, lower, numbers, bursts, periods, deadlines)
        if load > NEARLY_FULL or span == math.inf:
            blocked = blocking_us(math.inf, most, lower, numbers, bursts, periods, deadlines)
            span = bound_us(ahead_us + blocked, bit, before, periods, jitters)
            blocked = blocking_us(span, most, lower, numbers, bursts, periods, deadlines)
        lasts_us[point], blocked_us[point] = span, blocked
    return CycleWaits(lasts_us, blocked_us)


def blocking_us(
    span: float, most: int, lower_us: Row, identifiers: Row, burst: Row, period_us: Row, deadline_us: Row
) -> float:
    """The `most` longest frames that block within a span of time, three or fewer [us].

    Of a message that keeps its deadline D there are b - 1 + ceil((w + D) / T) frames, of each node.
    """
    first, second, third = 0.0, 0.0, 0.0
    for message in range(len(lower_us)):
        us = lower_us[message]
        if us > third:
            queued = math.ceil(min((span + deadline_us[message]) / period_us[message], 3.0)) + burst[message] - 1
            for _ in range(int(min(identifiers[message] * queued, 3.0))):
                if us > first:
                    first, second, third = us, first, second
                elif us > second:
                    second, third = us, second
                elif us > third:
                    third = us
    return first if most == 1 else first + second + third
