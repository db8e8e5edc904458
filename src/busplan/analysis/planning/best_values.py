"""The best value of one setting with the others unchanged: period, slice ratio, payload, nodes.

A closed form gives an estimate, and its neighbours on the grid of settings are tested. The largest payload and the
smallest period that passes the circle are searched linearly: neither an execution table nor a contour error is
monotone.
"""

from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from math import ceil
from typing import Final, NamedTuple

from busplan.analysis.capacity.cycle import available_us, cycle_of, fits_in
from busplan.analysis.capacity.node_limit import largest_nodes
from busplan.analysis.latency import with_payload
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.cures import RATIO_STEPS
from busplan.profile.toml import override
from busplan.sections.base import MAX_TIME_US
from busplan.sections.execution import TableExecution
from busplan.sections.profile import Profile

Models = Sequence[str]
FindCircleFailures = Callable[[Profile], tuple[str, ...]]
"""Runs the circle test of a profile that fits its bus and returns its failures; empty if it passes."""

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


def required_us(profile: Profile, *, models: Models) -> float:
    """Time that the cycle needs under the slowest model [us]."""
    return max(float(cycle_of(profile, model=model).required_us) for model in models)


def smallest_ratio(profile: Profile, *, models: Models) -> float:
    """Smallest slice ratio at which the cycle fits, in steps of 0.0001; if it is above 1, none does."""
    needed_us, period_us = required_us(profile, models=models), profile.cycle.period_us
    steps = _smallest(
        needed_us / period_us * RATIO_STEPS,
        fits=lambda number: fits_in(needed_us, available_us=number / RATIO_STEPS * period_us),
    )
    return steps / RATIO_STEPS


def smallest_period(
    profile: Profile, *, models: Models, circle: FindCircleFailures | None = None, max_circles: int = MAX_CIRCLES
) -> PeriodSearch:
    """Find the smallest period that the cycle fits in and that passes the circle.

    For the bus alone, a closed form is rounded up to whole us. With a circle, multiples of the servo's step are tested
    from there on, and the first one to pass is the smallest. After `max_circles` of them the strides double, and a
    period that passes then is not proven to be the smallest.

    Parameters
    ----------
    profile
        The network; its own period is ignored.
    models
        Timing models that it must fit under.
    circle
        Function that runs the circle test; None for none.
    max_circles
        Number of consecutive periods to test, 1 or more [1].
    """
    needed_us, ratio = required_us(profile, models=models), profile.cycle.slice_ratio
    step_us = 1.0 if circle is None else profile.servo.step_us
    first = _smallest(
        needed_us / ratio / step_us,
        fits=lambda number: fits_in(needed_us, available_us=ratio * _times(number, step_us)),
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


def largest_payload(profile: Profile, *, model: str) -> Largest:
    """Largest common payload of read and write that fits the period, in steps of the bus [bytes].

    Every size is tried, from the largest one that the bus carries and the execution table covers.
    """
    network, execution = network_of(profile), profile.node.execution
    payloads = bus_of(profile).payloads(network)
    smallest = step = payloads.step_bytes
    most = Largest(payloads.most_bytes, payloads.bound)
    if isinstance(execution, TableExecution):
        smallest = max(smallest, ceil(execution.payload_bytes[0] / step) * step)
        known = execution.payload_bytes[-1] // step * step
        most = min(most, Largest(known, "execution"), key=lambda one: one.value)
    given_us = available_us(network)
    for size in range(most.value, smallest - 1, -step):
        if fits_in(cycle_of(with_payload(profile, size), model=model).required_us, available_us=given_us):
            return most if size == most.value else Largest(size, "time")
    return Largest(0, "execution" if most.value < smallest else "time")


def most_nodes(profile: Profile, *, model: str) -> Largest:
    """Largest number of nodes that fits the period and is safe with the settings of the bus."""
    most, limit = largest_nodes(profile, model=model)
    bus, network = bus_of(profile), network_of(profile)
    for nodes in range(most, 0, -1):
        unsafe = [one.key for one in bus.limits if one.is_safety and one.is_broken(network.with_nodes(nodes))]
        if not unsafe:
            return Largest(nodes, limit)
        limit = unsafe[0]
    return Largest(0, limit)


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
