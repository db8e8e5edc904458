"""Worst-case response times of CAN as Davis et al. 2007 print them, equations (4)-(12), as an oracle.

With errors the busy period and each wait have E(t) of Tindell and Burns 1994 beside them.

It imports nothing of busplan, and takes no short cut: one frame after another, one step after another. Times are whole
numbers of any unit.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple


class Sender(NamedTuple):
    """A message."""

    frame_us: int
    period_us: int
    jitter_us: int = 0
    burst: int = 1
    """So many may be queued at once; then it has as many periods to the next burst."""

    def arrived(self, span_us: int) -> int:
        """Frames that are queued in a span of time."""
        return self.burst - 1 - (-(span_us + self.jitter_us) // self.period_us)


class Errors(NamedTuple):
    """Errors on the wire: so many at once, and one more with each further period."""

    period_us: int
    burst: int = 1

    def taken_us(self, span_us: int, bit_us: int, senders: Sequence[Sender]) -> int:
        """What they take of a span: for each 31 bits and the longest frame."""
        return (self.burst - 1 - (-span_us // self.period_us)) * (31 * bit_us + max(one.frame_us for one in senders))


def response_us(
    own: Sender,
    higher: Sequence[Sender],
    *,
    blocking_us: int,
    bit_us: int,
    most_us: int = 10**9,
    errors: Errors | None = None,
) -> tuple[int, int] | None:
    """Worst-case response of a message and its instance; None without an end.

    Parameters
    ----------
    own, higher
        The message, and all that go before it.
    blocking_us
        The longest frame that may hold it up.
    bit_us
        Time of a bit.
    most_us
        A busy period that is longer has no end.
    errors
        Errors on the wire, if there are any.
    """

    def repeated_us(span: int) -> int:
        return errors.taken_us(span, bit_us, (*higher, own)) if errors else 0

    busy_us = _smallest(
        lambda span: blocking_us + repeated_us(span) + _sent(span, (*higher, own)), own.frame_us, most_us
    )
    found = []
    for instance in range(own.burst - 1, own.arrived(busy_us) if busy_us < most_us else 0):
        first_us = blocking_us + instance * own.frame_us

        def further(span: int, first_us: int = first_us) -> int:
            return first_us + repeated_us(span + own.frame_us) + _sent(span + bit_us, higher)

        late_us = own.jitter_us - (instance - own.burst + 1) * own.period_us
        found.append((late_us + _smallest(further, first_us, most_us) + own.frame_us, -instance))
    if not found:
        return None
    response, instance = max(found)
    return response, -instance


def _sent(span_us: int, senders: Sequence[Sender]) -> int:
    return sum(one.arrived(span_us) * one.frame_us for one in senders)


def _smallest(further: Callable[[int], int], span: int, most: int) -> int:
    while span < (wider := further(span)) and span < most:
        span = wider
    return span
