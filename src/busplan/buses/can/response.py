"""Worst-case response times of CAN frames, and the wait of a cycle: fixed priorities, no frame interrupts another.

Plain numbers, compiled by Cython when the package is built (types: `_response.pxd`); without a compiler the same file
runs as plain Python. Senders stand in the order of arbitration, and those of equal period and jitter are a group. Frame
m waits for B, the longest frame of a lower priority; for S, what comes once when its busy period begins; and for all
that is queued meanwhile by the senders before it, hp(m):

    t    = B + S + sum over hp(m) and m of ceil((t + J) / T) C                         the busy period
    w(q) = B + S + q C + sum over hp(m) of ceil((w(q) + J + bit) / T) C                the wait of instance q
    R    = the largest J + w(q) - q T + C, over all q with q T < t + J                 the response

Of a burst of b frames b - 1 are in S. An error term E(t) would stand beside S, the delay in a buffer beside J.

References
----------
R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised, Real-Time Systems 35, 2007, equations (4)-(12).
"""

# Called as math.ceil, so that compiled code calls that of C.
import math
from collections.abc import MutableSequence, Sequence

from busplan.buses.can import equations as constants

SATURATED = float(constants.SATURATED)
MOST_STEPS = int(constants.MOST_STEPS)
NEARLY_FULL = 0.99
"""Load above which the wait of a cycle is a bound in closed form [1]."""
BELOW = 1 - 1e-9
"""A bound from below is taken so much lower, so that rounding does not put it above what it bounds."""

Row = Sequence[float]
Rows = Sequence[Row]
"""A row for each point."""
Results = MutableSequence[float]


def span_us(ahead_us: float, from_us: float, bit_us: float, sent_us: Row, period_us: Row, jitter_us: Row) -> float:
    """The smallest w = ahead + sum of ceil((w + J + bit) / T) C that is no less than a span that it is known to pass.

    Parameters
    ----------
    ahead_us
        What takes time beside the groups [us].
    from_us
        The span that it is known to pass [us].
    bit_us
        Time in which a frame still takes part in an arbitration that has begun [us].
    sent_us, period_us, jitter_us
        Of each group: all frames of a period, the period, and the jitter, which is negative where the first of them
        come so much behind the start [us].

    Returns
    -------
    float
        w [us]; infinite where it takes over `MOST_STEPS` steps to find.
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
    """The worst instance of a frame, where the load of the bus is below `SATURATED`.

    Parameters
    ----------
    group
        Its group, whose period and jitter it has.
    own_us
        The frame C [us].
    ahead_us
        B + S [us].
    bit_us
        Time of a bit [us].
    sent_us
        Of each group, all frames of a period of hp(m) and of m [us].
    period_us, jitter_us
        Of each group [us].

    Returns
    -------
    tuple
        q, the first of equals [1]; w(q), R [us]. R is infinite where it takes too many steps to find.
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


def responses(
    answered: Sequence[int],
    group: Sequence[int],
    place: Row,
    last: Rows,
    frame_us: Rows,
    blocking_us: Rows,
    sent_us: Rows,
    enough_us: Rows,
    period_us: Rows,
    bit_us: Rows,
    once_us: Rows,
    jitter_us: Rows,
    longest_us: Results,
    before_us: Results,
    blocked_us: Sequence[Results],
    instance: Sequence[Results],
    wait_us: Sequence[Results],
    response_us: Sequence[Results],
) -> None:
    """Find the worst-case response of some senders at each point, from one start of the busy period.

    Parameters
    ----------
    answered
        Rank of each sender whose response is computed.
    group, place
        Of each sender by its rank: its group, and place of its first frame in the arbitration, ascending.
    last, frame_us, blocking_us, sent_us, enough_us
        Of each sender by its rank: place of its last frame, whose response is found; a frame [us]; the same, or 0 where
        it may not block [us]; all its frames of a period [us]; a response that needs no search, for a bound that is no
        longer stands for it [us].
    period_us
        Of each group [us].
    bit_us
        Time of a bit [us].
    once_us, jitter_us
        At this start: what each sender sends once, and the jitter of each group [us].
    longest_us, before_us
        Room for a number of each sender and one more, and of each group.
    blocked_us, instance, wait_us, response_us
        Results, where the response is longer than what is there: B [us], q [1], w(q), R [us]. R is infinite where hp(m)
        and m load the bus by `SATURATED`, or where it takes too many steps to find. Then the rest says nothing.
    """
    senders = len(place)
    for point in range(len(bit_us)):
        ends, frames, blocking = last[point], frame_us[point], blocking_us[point]
        sent, once, periods, jitters = sent_us[point], once_us[point], period_us[point], jitter_us[point]
        longest_us[senders] = 0.0
        for rank in range(senders - 1, -1, -1):
            longest_us[rank] = max(longest_us[rank + 1], blocking[rank])
        rank, load, first_us = 0, 0.0, 0.0
        for number in range(len(answered)):
            sender = answered[number]
            if number == 0 or place[rank - 1] > ends[sender]:
                rank, load, first_us = 0, 0.0, 0.0
                for index in range(len(before_us)):
                    before_us[index] = 0.0
            while rank < senders and place[rank] <= ends[sender]:
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
                        group[sender], frames[sender], ahead_us, bit_us[point][0], before_us, periods, jitters
                    )
            if response > response_us[point][number]:
                blocked_us[point][number], instance[point][number] = longest_us[rank], worst
                wait_us[point][number], response_us[point][number] = wait, response


def cycle_waits(
    most: int,
    others_us: Rows,
    bit_us: Rows,
    before_us: Rows,
    lower_us: Rows,
    identifiers: Rows,
    burst: Rows,
    period_us: Rows,
    jitter_us: Rows,
    deadline_us: Rows,
    lasts_us: Sequence[Results],
    blocked_us: Sequence[Results],
) -> None:
    """Find how long a cycle lasts with the frames of other messages, at each point.

    Parameters
    ----------
    most
        Frames of lower priorities that it waits for, at most [1].
    others_us
        What takes time beside these frames [us].
    bit_us
        Time of a bit [us].
    before_us, lower_us
        Of each message: all its frames of a period where it goes before the last PDO, or a frame where one may block;
        otherwise 0 [us].
    identifiers, burst
        Of each message: how many nodes send it, and how many frames each of them may queue at once [1].
    period_us, jitter_us, deadline_us
        Of each message [us].
    lasts_us, blocked_us
        Results: w = others + blocked(w) + sum over the messages before the last PDO of ceil((w + J + bit) / T) C, the
        smallest, and the frames that block in it [us]. With a load of these messages over `NEARLY_FULL` w is a bound in
        closed form, which from `SATURATED` on only says that the bus is full.
    """
    for point in range(len(bit_us)):
        before, lower, periods, jitters = before_us[point], lower_us[point], period_us[point], jitter_us[point]
        numbers, bursts, deadlines = identifiers[point], burst[point], deadline_us[point]
        ahead_us, bit, span, load, blocked, longer = others_us[point][0], bit_us[point][0], 0.0, 0.0, -1.0, 0.0
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
        lasts_us[point][0], blocked_us[point][0] = span, blocked


def blocking_us(
    span: float, most: int, lower_us: Row, identifiers: Row, burst: Row, period_us: Row, deadline_us: Row
) -> float:
    """The longest frames that block within a span of time, three or fewer [us].

    Of a message that keeps its deadline D there are b - 1 + ceil((w + D) / T) frames, of each node.

    Parameters
    ----------
    span
        The span w [us].
    most
        Number of frames, at most 3 [1].
    lower_us, identifiers, burst, period_us, deadline_us
        As `cycle_waits` takes them.
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
