"""The best value of one setting, the others as they are: period, slice ratio, payload, nodes.

What has a closed form is computed, and its neighbours on the grid of settings are tested. The largest payload and the
smallest period that passes the circle are scanned: neither a measured execution table nor a contour error is monotone.
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
"""Runs the circle test of a profile that fits its bus: what it does not hold, nothing when it passes."""

MAX_CIRCLES: Final = 50
"""So many periods in a row are tested for the smallest one that passes the circle. Chosen: some seconds."""


class PeriodSearch(NamedTuple):
    """Smallest period that was found."""

    period_us: float | None
    """None when none was found."""
    bounded_by: str
    proven: bool
    """Whether every smaller one fails; False when the search was cut short."""


class Largest(NamedTuple):
    """Largest value of a setting, 0 when there is none, and what keeps it from being larger."""

    value: int
    bounded_by: str


def required_us(profile: Profile, *, models: Models) -> float:
    """What the cycle needs under the model that needs most [us]."""
    return max(float(cycle_of(profile, model=model).required_us) for model in models)


def smallest_ratio(profile: Profile, *, models: Models) -> float:
    """Smallest slice ratio that the cycle fits with, in steps of 0.0001; above 1 there is none."""
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

    For the bus alone there is a closed form, rounded up to whole us. The circle asks for multiples of the servo's step,
    and each one from there on is tested: the first to pass is the smallest. After `max_circles` of them the strides
    double, and what passes then is not proven to be the smallest.

    Parameters
    ----------
    profile
        The network; its own period plays no part.
    models
        Timing models that it must fit under.
    circle
        The circle test; without it no circle is run.
    max_circles
        How many periods in a row are tested, 1 or more [1].
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
    """Largest payload of read and write alike that fits the period, in the steps of the bus [bytes].

    Every size is tried from the largest one that the bus carries and the execution table knows.
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
    """Largest number of nodes that fits the period, and that the bus as it is set is safe for."""
    most, limit = largest_nodes(profile, model=model)
    bus, network = bus_of(profile), network_of(profile)
    for nodes in range(most, 0, -1):
        unsafe = [one.key for one in bus.limits if one.is_safety and one.is_broken(network.with_nodes(nodes))]
        if not unsafe:
            return Largest(nodes, limit)
        limit = unsafe[0]
    return Largest(0, limit)


def _smallest(estimate: float, *, fits: Callable[[int], bool]) -> int:
    """Smallest whole number above 0 that fits, from its estimate in floats; every larger one must fit too."""
    number = max(1, ceil(estimate))
    while number > 1 and fits(number - 1):
        number -= 1
    while not fits(number):
        number += 1
    return number


def _numbers(first: int, *, in_a_row: int) -> Iterator[int]:
    """Some numbers in a row, then in strides that double."""
    yield from range(first, first + in_a_row)
    number, stride = first + in_a_row - 1, 2
    while True:
        number += stride
        yield number
        stride *= 2


def _times(number: int, step_us: float) -> float:
    """A multiple of a step as it is written: three times 0.1 is 0.3 [us]."""
    return float(number * Decimal(str(step_us)))
