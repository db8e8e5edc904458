"""The best value of one setting, the others as they are: period, slice ratio, payload.

A closed form gives an estimate, and its neighbours on the grid of settings are tested. The largest payload and the
smallest period that passes the circle are searched linearly: neither an execution table nor a contour error is
monotone.
"""

from collections.abc import Callable, Iterator
from decimal import Decimal
from math import ceil
from typing import Final, NamedTuple

from busplan.analysis.capacity.cycle import available_us, fits_in
from busplan.analysis.latency import with_payload
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.cures import RATIO_STEPS, safe_required_us
from busplan.profile.toml import override
from busplan.sections.base import MAX_TIME_US
from busplan.sections.execution import TableExecution
from busplan.sections.profile import Profile

FindCircleFailures = Callable[[Profile], tuple[str, ...]]
"""Runs the circle test of a profile that fits its bus: what it does not hold, nothing when it passes."""

MAX_CIRCLES: Final = 50
"""Consecutive periods tested for the smallest one that passes the circle. Chosen: takes some seconds."""


class PeriodSearch(NamedTuple):
    """Result of a search for the smallest period."""

    period_us: float | None
    """None if none was found."""
    bounded_by: str
    proven: bool
    """Whether every smaller period is known to fail; False if the search was cut short."""


class Largest(NamedTuple):
    """Largest value of a setting, 0 if there is none, and the limit that bounds it."""

    value: int
    bounded_by: str


def smallest_ratio(profile: Profile) -> float:
    """Smallest slice ratio that the cycle is shown to fit with, in steps of 0.0001; above 1 there is none."""
    needed_us, period_us = safe_required_us(profile), profile.cycle.period_us
    steps = _smallest(
        needed_us / period_us * RATIO_STEPS,
        fits=lambda number: bool(fits_in(needed_us, available_us=number / RATIO_STEPS * period_us)),
    )
    return steps / RATIO_STEPS


def smallest_period(
    profile: Profile, *, circle: FindCircleFailures | None = None, max_circles: int = MAX_CIRCLES
) -> PeriodSearch:
    """Find the smallest period that the cycle is shown to fit in and that passes the circle.

    For the bus alone, a closed form is rounded up to whole us. With a circle, multiples of the servo's step are tested
    from there on, and the first one to pass is the smallest. After `max_circles` of them the strides double, and a
    period that passes then is not proven to be the smallest.

    Parameters
    ----------
    profile
        The network; its own period plays no part.
    circle
        Function that runs the circle test; None for none.
    max_circles
        Number of consecutive periods to test, 1 or more [1].
    """
    needed_us, ratio = safe_required_us(profile), profile.cycle.slice_ratio
    step_us = 1.0 if circle is None else profile.servo.step_us
    first = _smallest(
        needed_us / ratio / step_us,
        fits=lambda number: bool(fits_in(needed_us, available_us=ratio * _times(number, step_us))),
    )
    if _times(first, step_us) > MAX_TIME_US:
        return PeriodSearch(None, "time", proven=True)
    for tried, number in enumerate(_numbers(first, in_a_row=max_circles)):
        period_us, proven = _times(number, step_us), tried < max_circles
        if period_us > MAX_TIME_US:
            return PeriodSearch(None, "circle", proven=proven)
        if circle is None or not circle(override(profile, {"cycle.period_us": period_us})):
            return PeriodSearch(period_us, "circle" if tried else "time", proven=proven)
    raise AssertionError("the numbers never end")


def largest_payload(profile: Profile) -> Largest:
    """Largest payload of read and write alike that is shown to fit the period, in the steps of the bus [bytes].

    Every size is tried, from the largest one that the bus carries and the execution table covers.
    """
    network, execution = network_of(profile), profile.alike_nodes[0].node.execution
    payloads = bus_of(profile).payloads(network)
    smallest = step = payloads.step_bytes
    most = Largest(payloads.most_bytes, payloads.bound)
    if isinstance(execution, TableExecution):
        smallest = max(smallest, ceil(execution.payload_bytes[0] / step) * step)
        known = execution.payload_bytes[-1] // step * step
        most = min(most, Largest(known, "execution"), key=lambda one: one.value)
    given_us = available_us(network)
    for size in range(most.value, smallest - 1, -step):
        if fits_in(safe_required_us(with_payload(profile, size)), available_us=given_us):
            return most if size == most.value else Largest(size, "time")
    return Largest(0, "execution" if most.value < smallest else "time")


def _smallest(estimate: float, *, fits: Callable[[int], bool]) -> int:
    """Smallest whole number above 0 that fits, near an estimate; every larger one must fit, too."""
    number = max(1, ceil(estimate))
    while number > 1 and fits(number - 1):
        number -= 1
    while not fits(number):
        number += 1
    return number


def _numbers(first: int, *, in_a_row: int) -> Iterator[int]:
    """Consecutive numbers, then numbers in strides that double."""
    yield from range(first, first + in_a_row)
    number, stride = first + in_a_row - 1, 2
    while True:
        number += stride
        yield number
        stride *= 2


def _times(number: int, step_us: float) -> float:
    """A multiple of a step in decimal arithmetic: 3 * 0.1 is 0.3 [us]."""
    return float(number * Decimal(str(step_us)))
