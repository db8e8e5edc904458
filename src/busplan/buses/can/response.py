"""Worst-case response times: fixed priorities, no frame interrupts another, every instance of the busy period.

References
----------
R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised, Real-Time Systems 35, 2007, equations (4)-(12).
"""

from collections.abc import Callable, Sequence
from math import ceil
from typing import NamedTuple

from busplan.buses.can.constants import SATURATED


class Sender(NamedTuple):
    """Frames that one identifier, or several of one kind, put on the bus."""

    frames_us: float
    """All frames of one instance, in the worst case [us]."""
    period_us: float
    jitter_us: float = 0.0

    @property
    def load(self) -> float:
        """Share of the bus, 0..1 [1]."""
        return self.frames_us / self.period_us

    def released_us(self, span_us: float) -> float:
        """Frames that arrive in a span of time, in the worst case [us]."""
        return ceil((span_us + self.jitter_us) / self.period_us) * self.frames_us


class Response(NamedTuple):
    """The worst case of one message: R = J + B + I + q (C - T) + C."""

    blocking_us: float
    """B, the longest frame of a lower priority [us]."""
    instance: int
    """q of the worst instance in the busy period, from 0 [1]."""
    interference_us: float
    """I, frames of higher priorities that go before it [us]."""
    us: float
    """R [us]."""


def worst_response(own: Sender, higher: Sequence[Sender], *, blocking_us: float, bit_us: float) -> Response | None:
    """Find the worst-case response time of one message.

    Parameters
    ----------
    own
        The message, one frame an instance.
    higher
        All messages of higher priorities.
    blocking_us
        The longest frame of a lower priority B; 0 where there is none [us].
    bit_us
        Time of a bit [us]: a frame that arrives within it behind the start still takes part in the arbitration.

    Returns
    -------
    Response
        Its worst instance, the first of equals; None where the message and those of higher priorities load the bus by
        1 or more, for then the busy period has no end.

    References
    ----------
    Davis et al. 2007, equations (4)-(12).

    Examples
    --------
    The second instance is the worst one:

    >>> worst_response(Sender(1000, 3500), [Sender(1000, 2500), Sender(1000, 3500)], blocking_us=0, bit_us=8)
    Response(blocking_us=0, instance=1, interference_us=5000, us=3500.0)
    """
    if sum(one.load for one in (own, *higher)) >= SATURATED:
        return None
    everyone = (own, *higher)
    busy_us = _settled(
        blocking_us + sum(one.frames_us for one in everyone),
        lambda span_us: blocking_us + sum(one.released_us(span_us) for one in everyone),
    )
    worst: Response | None = None
    waits_us = blocking_us
    for instance in range(ceil((busy_us + own.jitter_us) / own.period_us)):
        before_us = blocking_us + instance * own.frames_us
        # It waits at least as long as the instance before it, and for that one.
        waits_us = _settled(
            max(waits_us, before_us),
            lambda span_us, before_us=before_us: (  # type: ignore[misc]
                before_us + sum(one.released_us(span_us + bit_us) for one in higher)
            ),
        )
        us = own.jitter_us + waits_us - instance * own.period_us + own.frames_us
        if worst is None or us > worst.us:
            worst = Response(blocking_us, instance, waits_us - before_us, us)
    return worst


def settled_us(others_us: float, senders: Sequence[Sender]) -> float:
    """A span of time that ends when everything that arrives in it has been sent [us].

    Parameters
    ----------
    others_us
        What takes time beside the senders [us].
    senders
        What arrives within the span.

    Returns
    -------
    float
        The smallest w = others + sum ceil((w + J) / T) C. With a load of the senders above 0.99 a bound of it in closed
        form, and from `SATURATED` on one that says no more than that the bus is full.

    Examples
    --------
    >>> settled_us(900.0, [Sender(100, 500)])
    1200.0
    """
    load = sum(one.load for one in senders)
    if load > _NEARLY_FULL:
        first_us = others_us + sum(one.frames_us + one.load * one.jitter_us for one in senders)
        return first_us / (1 - min(load, SATURATED))
    start_us = others_us + sum(one.frames_us for one in senders)
    return _settled(start_us, lambda span_us: others_us + sum(one.released_us(span_us) for one in senders))


_NEARLY_FULL = 0.99
"""Load above which the smallest span takes too many steps to find."""


def _settled(start_us: float, step: Callable[[float], float]) -> float:
    """The smallest number that a step leaves as it is, from a start that is no larger."""
    while (further_us := step(start_us)) > start_us:
        start_us = further_us
    return start_us
