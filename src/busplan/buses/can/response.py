"""Worst-case response times: fixed priorities, no frame interrupts another, every instance of the busy period.

References
----------
R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised, Real-Time Systems 35, 2007, equations (4)-(12).
"""

from collections.abc import Callable, Iterable, Sequence
from functools import reduce
from itertools import count, repeat
from math import ceil, inf
from typing import Any, NamedTuple, TypeAlias

from busplan.buses.can.constants import MOST_STEPS, SATURATED
from busplan.elementwise import choose, is_everywhere, larger, rounded_up, smaller

Points: TypeAlias = Any
"""A plain number, or an array of a number for each point; never a traced number."""


class Sender(NamedTuple):
    """Frames that an identifier, or several of the same kind, put on the bus. The numbers may be arrays."""

    frames_us: Points
    """All frames of one instance, in the worst case [us]."""
    period_us: Points
    jitter_us: Points = 0.0
    """Latest queueing of an instance; negative where the first comes so much behind the start [us]."""

    @property
    def load(self) -> Points:
        """Share of the bus, 0..1 [1]."""
        return self.frames_us / self.period_us


class Response(NamedTuple):
    """The worst case of a message: R = J + B + I + q C - (q - b + 1) T + C. The numbers may be arrays."""

    blocking_us: Points
    """B, the longest frame of a lower priority [us]."""
    instance: Points
    """q of the worst instance in the busy period, from 0 [1]."""
    interference_us: Points
    """I, frames of higher priorities that go before it [us]."""
    us: Points
    """R [us]."""


def worst_response(
    own: Sender,
    higher: Sequence[Sender],
    *,
    blocking_us: float,
    bit_us: float,
    first_us: float = 0.0,
    burst: int = 1,
) -> Response | None:
    """Find the worst-case response time of a message.

    Parameters
    ----------
    own
        The message, a frame for each instance.
    higher
        All messages of higher priorities.
    blocking_us
        The longest frame of a lower priority B; 0 where there is none [us].
    bit_us
        Time of a bit [us]: a frame that arrives within it behind the start still takes part in the arbitration.
    first_us
        Frames of higher priorities that come once, when the busy period begins [us].
    burst
        Frames of the message that may come at once b; instance q from b - 1 on comes q - b + 1 periods later [1].

    Returns
    -------
    Response
        Its worst instance, the first of equals. None where the message and those of higher priorities load the bus by 1
        or more, for then the busy period has no end, or where it takes over `MOST_STEPS` to find.

    References
    ----------
    Davis et al. 2007, equations (4)-(12).

    Examples
    --------
    The second instance is the worst:

    >>> worst_response(Sender(1000, 3500), [Sender(1000, 2500), Sender(1000, 3500)], blocking_us=0, bit_us=8)
    Response(blocking_us=0, instance=1, interference_us=5000.0, us=3500.0)
    """
    try:
        return worst_instance(
            own, Demand(higher), blocking_us=blocking_us, bit_us=bit_us, first_us=first_us, burst=burst
        )
    except TooManyStepsError:
        return None


def worst_instance(
    own: Sender,
    before: "Demand",
    *,
    blocking_us: Points,
    bit_us: Points,
    first_us: Points = 0.0,
    burst: Points = 1,
) -> Response | None:
    """As `worst_response`, of arrays, too: R is infinite at points that have none, and None says that none has one.

    Raises
    ------
    TooManyStepsError
        It takes over `MOST_STEPS` to find, at all points together.
    """
    is_over = before.load + own.load >= SATURATED
    if is_everywhere(is_over):
        return None
    steps, ahead_us = iter(range(int(MOST_STEPS))), blocking_us + first_us
    bound_us = before.bound_us(ahead_us, bit_us=bit_us)
    per_us = own.frames_us / (1 - choose(is_over, 0.0, before.load))
    worst, waits_us = Response(blocking_us, 0, 0.0, choose(is_over, inf, 0.0)), 0.0
    # All of a burst are there at once, and the last of them is the latest.
    for late in count():
        instance = late + burst - 1
        late_us = own.jitter_us + own.frames_us - late * own.period_us
        if late:
            # The bound falls from one instance to the next.
            is_over = is_over | (late_us + bound_us + instance * per_us <= worst.us)
            if is_everywhere(is_over):
                return worst
            if late == 1:
                first_us = ahead_us + (burst - 1) * own.frames_us
                from_us = first_us + own.frames_us + before.frames_us
                busy_us = before.behind(own).settled_us(first_us, steps, from_us=from_us, is_settled=is_over)
            is_over = is_over | (late * own.period_us >= busy_us + own.jitter_us)
            if is_everywhere(is_over):
                return worst
        # It waits at least as long as the instance before it, and for that instance.
        own_us = instance * own.frames_us
        waits_us = before.settled_us(ahead_us + own_us, steps, bit_us=bit_us, from_us=waits_us, is_settled=is_over)
        response = Response(blocking_us, instance, waits_us - blocking_us - own_us, waits_us + late_us)
        is_worse = choose(is_over, False, response.us > worst.us if late else True)
        worst = Response(*(choose(is_worse, new, old) for new, old in zip(response, worst, strict=True)))
    raise AssertionError


def settled_us(
    others_us: Points, senders: Sequence[Sender], *, more_us: Callable[[Points], Points] = lambda _: 0.0
) -> Points:
    """A span of time that ends when everything that arrives in it has been sent [us].

    Parameters
    ----------
    others_us
        What takes time beside the senders [us].
    senders
        What arrives within the span.
    more_us
        What else takes time within a span, which does not fall with it [us].

    Returns
    -------
    float
        The smallest w = others + more(w) + sum ceil((w + J) / T) C. With a load of the senders above 0.99 a bound of it
        in closed form, and from `SATURATED` on a bound that only says that the bus is full.

    Examples
    --------
    >>> settled_us(900.0, [Sender(100, 500)])
    1200.0
    """
    demand = Demand(senders)
    is_full = demand.load > _NEARLY_FULL
    if is_full is False:
        return demand.settled_us(others_us, repeat(0), more_us=more_us)
    bound_us = demand.bound_us(others_us + more_us(inf))
    if is_full is True:
        return bound_us
    return choose(is_full, bound_us, demand.settled_us(others_us, repeat(0), more_us=more_us, is_settled=is_full))


_NEARLY_FULL = 0.99
"""Load above which the smallest span takes too many steps to find."""
BELOW = 1 - 1e-9
"""A bound from below is taken so much lower, so that rounding does not put it above what it bounds."""


def _added(rows: Points) -> Points:
    """Sum of the rows of an array, added in their order."""
    # Of a row of numbers, `sum` adds pairs first; rows of several points it adds one after another.
    return rows.sum(axis=0) if rows.size > len(rows) else rows.cumsum(axis=0)[-1]


MANY = 50
"""Senders from which on arrays are faster."""
_FEW_POINTS = 2000
"""Points up to which a single array of all senders is faster than an array of each."""


class TooManyStepsError(Exception):
    """A span takes too many steps to find."""


class Demand:
    """Demand of several senders on the bus.

    Parameters
    ----------
    senders
        The senders.
    """

    def __init__(self, senders: Sequence[Sender]) -> None:
        self._senders = senders
        self.load: Points = 0.0
        """Share of the bus, 0..1 [1]."""
        self.frames_us: Points = 0.0
        """One instance of each [us]."""
        self._of_jitter_us: Points = 0.0
        self._known_rows: dict[int, Sequence[Points]] = {}
        for frames_us, period_us, jitter_us in senders:
            load = frames_us / period_us
            self.load = self.load + load
            self.frames_us = self.frames_us + frames_us
            self._of_jitter_us = self._of_jitter_us + load * jitter_us

    @classmethod
    def of_many(cls, senders: Sender) -> "Demand":
        """Demand of senders, one or more, in arrays of all of them; of a row of points each, where frames are so."""
        demand = cls(())
        axes = senders.frames_us.ndim - 1
        demand._known_rows[axes] = senders
        sums = (_added(each) for each in (senders.load, senders.frames_us, senders.load * senders.jitter_us))
        demand.load, demand.frames_us, demand._of_jitter_us = sums if axes else map(float, sums)
        return demand

    def behind(self, own: Sender) -> "Demand":
        """The same with one more sender, as the first."""
        if self._senders or not self._known_rows:
            return Demand((own, *self._senders))
        import numpy as np

        (rows,) = self._known_rows.values()
        shape = np.shape(own.frames_us)
        several = ((first, np.broadcast_to(rest, (len(rest), *shape))) for first, rest in zip(own, rows, strict=True))
        return Demand.of_many(Sender(*(np.concatenate([[first], rest]) for first, rest in several)))

    def in_window_us(self, window_us: Points) -> Points:
        """Frames that arrive in a window of time, sum ceil((window + J) / T) C, added in their order [us]."""
        is_plain = isinstance(window_us + self._of_jitter_us, float)
        if len(self._senders) < MANY and is_plain and not self._known_rows:
            return reduce(lambda sum_us, own: sum_us + ceil((window_us + own[2]) / own[1]) * own[0], self._senders, 0.0)
        if (self._senders or self._known_rows) and getattr(window_us, "size", 1) < _FEW_POINTS:
            import numpy as np

            us, period_us, jitter_us = self._rows(getattr(window_us, "ndim", 0))
            found_us: Points = _added(np.ceil((window_us + jitter_us) / period_us) * us)
            return float(found_us) if is_plain else found_us
        found_us = 0.0
        for frames_us, period_us, jitter_us in self._senders:
            found_us = found_us + rounded_up((window_us + jitter_us) / period_us) * frames_us
        return found_us

    def _rows(self, axes: int) -> Sequence[Points]:
        """Frames, periods and jitters, each as an array of all senders over so many axes of points."""
        if axes not in self._known_rows:
            import numpy as np

            columns = []
            for column in zip(*self._senders, strict=True):
                shape = np.broadcast_shapes((1,) * axes, *{getattr(numbers, "shape", ()) for numbers in column})
                rows = np.empty((len(column), *shape))
                for place, numbers in enumerate(column):
                    rows[place] = numbers
                columns.append(rows)
            self._known_rows[axes] = columns
        return self._known_rows[axes]

    def bound_us(self, before_us: Points, *, bit_us: Points = 0.0) -> Points:
        """A span that is no shorter than the smallest w = before + sum ceil((w + J + bit) / T) C [us].

        ceil(x) is less than x + 1, so w <= (before + sum (1 + (J + bit) / T) C) / (1 - load).
        """
        most_us = before_us + self.frames_us + self._of_jitter_us + self.load * bit_us
        return most_us / (1 - smaller(self.load, SATURATED))

    def settled_us(
        self,
        before_us: Points,
        steps: Iterable[int],
        *,
        bit_us: Points = 0.0,
        from_us: Points = 0.0,
        more_us: Callable[[Points], Points] = lambda _: 0.0,
        is_settled: Points = False,
    ) -> Points:
        """The smallest w = before + more(w) + sum ceil((w + J + bit) / T) C that is no less than `from_us` [us].

        The load is below 1, but for the points of an array that are settled; `steps` are as many as may be taken.
        """
        # ceil(x) is no less than x: no solution lies below that of the sum without rounding.
        least_us = (before_us + self._of_jitter_us + self.load * bit_us) / (1 - choose(is_settled, 0.0, self.load))
        span_us = larger(larger(from_us, before_us), least_us * BELOW)
        for _ in steps:
            further_us = before_us + more_us(span_us) + self.in_window_us(span_us + bit_us)
            is_end = further_us <= span_us
            if is_everywhere(is_end | is_settled):
                return span_us
            span_us = larger(further_us, span_us)
        raise TooManyStepsError
