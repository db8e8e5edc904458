"""Round tick marks for any scale."""

from collections.abc import Sequence
from math import ceil, floor, log10
from typing import NamedTuple


class RoundStep(NamedTuple):
    """A step of 1, 2 or 5 times a power of ten."""

    factor: int
    power: int

    @property
    def size(self) -> float:
        """The step as a number."""
        return self.factor * 10.0**self.power


class Tick(NamedTuple):
    """One tick mark of a scale."""

    at: float
    label: str


def round_steps(near: float) -> tuple[RoundStep, ...]:
    """Round steps around a size above 0, from a tenth of its power of ten to ten times that.

    Examples
    --------
    >>> [step.size for step in round_steps(30.0)]
    [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0]
    """
    power = floor(log10(near))
    return tuple(RoundStep(factor, power + more) for more in (-1, 0, 1) for factor in (1, 2, 5))


def ring_step(largest: float) -> float:
    """Round step that divides `largest`, or somewhat less, into two to five parts.

    Examples
    --------
    >>> ring_step(3.0), ring_step(12.0)
    (1.0, 5.0)
    """
    return max(step.size for step in round_steps(largest / 2) if step.size <= largest / 2)


def round_numbers(
    low: float, high: float, *, most: int, decades: Sequence[Sequence[float]] = ((1, 2, 5), (1, 3), (1,))
) -> list[float]:
    """Numbers for the labels of a logarithmic scale: 1, 2 and 5 times powers of ten, fewer if these are too many.

    `low` must be above 0, and `most` at least 1. `decades` are choices of the labels from 1 to 10, the finest first; of
    the last one every n-th is taken.

    Examples
    --------
    >>> round_numbers(0.9, 40.0, most=6), round_numbers(0.9, 400.0, most=6)
    ([1.0, 2.0, 5.0, 10.0, 20.0], [1.0, 3.0, 10.0, 30.0, 100.0, 300.0])
    """
    powers = range(floor(log10(low)), ceil(log10(high)) + 1)
    for factors in decades:
        numbers = [float(f"{factor}e{power}") for power in powers for factor in factors]
        inside = [number for number in numbers if low <= number <= high]
        if len(inside) <= most:
            return inside
    return inside[:: ceil(len(inside) / most)]


def ticks(low: float, high: float, *, most: int) -> tuple[Tick, ...]:
    """At most `most` tick marks inside a window, spaced 1, 2 or 5 times a power of ten.

    Examples
    --------
    >>> [tick.label for tick in ticks(0.4, 51.0, most=6)]
    ['10', '20', '30', '40', '50']
    >>> [tick.label for tick in ticks(0.0, 0.3, most=4)]
    ['0.0', '0.1', '0.2', '0.3']
    """
    # A longer step gives at most `most` marks, wherever the window begins.
    smallest = (high - low) / most * (1 + 1e-6)
    step = next(size for size in round_steps(smallest) if size.size > smallest)
    first, last = ceil(low / step.size - 1e-9), floor(high / step.size + 1e-9)
    decimals = max(0, -step.power)
    return tuple(Tick(number * step.size, f"{number * step.size:.{decimals}f}") for number in range(first, last + 1))


def placed(
    labels: Sequence[tuple[float, float]], *, room: float, gap: float = 0.0, own: int | None = None
) -> dict[int, float]:
    """Starts of labels, by index, around their places; this design's label comes first, and none touches another.

    Labels are places and sizes. `room` is the end of the scale, `gap` the least distance of two labels, `own` the label
    of this design. A label without room is left out.

    Examples
    --------
    >>> placed([(1.5, 1), (4.5, 2), (7.5, 3), (10.5, 2)], room=12, gap=1, own=3)
    {0: 1.0, 1: 3.5, 3: 9.5}
    """
    starts: dict[int, float] = {}
    for number in sorted(range(len(labels)), key=lambda label: label != own):
        place, size = labels[number]
        start = min(max(0.0, place - size / 2), room - size)
        taken = ((begin, begin + labels[label][1]) for label, begin in starts.items())
        if all(start >= end + gap or start + size + gap <= begin for begin, end in taken):
            starts[number] = start
    return dict(sorted(starts.items()))
