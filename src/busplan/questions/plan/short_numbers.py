"""Numbers that are advised: short to write, for they stand in a file, or those of a list."""

from bisect import bisect_left
from decimal import ROUND_CEILING, Decimal
from math import ceil, inf
from typing import Final, NamedTuple, Protocol

from busplan.elementwise import FIT_ROUNDING


class NumberGrid(Protocol):
    """Numbers at places from 1 on, ascending."""

    def number(self, place: int) -> float:
        """The number at a place; infinite beyond the last."""

    def place(self, least: float) -> int:
        """The place of the smallest number that is no less than another one, but for float rounding."""


class ListedNumbers(NamedTuple):
    """Numbers of a list.

    Parameters
    ----------
    numbers
        They, ascending.

    Examples
    --------
    >>> known = ListedNumbers((250.0, 500.0))
    >>> known.place(300.0), known.number(2), known.number(3)
    (2, 500.0, inf)
    """

    numbers: tuple[float, ...]

    def number(self, place: int) -> float:
        """The number at a place; infinite beyond the last."""
        return self.numbers[place - 1] if place <= len(self.numbers) else inf

    def place(self, least: float) -> int:
        """The place of the smallest number that is no less than another one, but for float rounding."""
        return bisect_left(self.numbers, least * (1 - FIT_ROUNDING)) + 1


class ShortNumbers(NamedTuple):
    """The multiples of a step that have a few significant digits, in decimal arithmetic: 3 * 0.1 is 0.3.

    Parameters
    ----------
    step
        The smallest number, in its own unit.
    digits
        Most significant digits of the multiple: with two, 98, 99, 100, 110, 120 steps.
    """

    step: float
    digits: int

    def number(self, place: int) -> float:
        """The number at a place from 1 on, ascending.

        Examples
        --------
        >>> [ShortNumbers(0.1, 1).number(place) for place in (1, 9, 10, 11)]
        [0.1, 0.9, 1.0, 2.0]
        """
        return float(self._multiple(place) * Decimal(str(self.step)))

    def place(self, least: float) -> int:
        """The place of the smallest number that is no less than another one, but for float rounding.

        Examples
        --------
        >>> [ShortNumbers(100, 3).number(ShortNumbers(100, 3).place(least)) for least in (0, 1087.2, 1100, 123_456)]
        [100.0, 1100.0, 1100.0, 124000.0]
        """
        steps = ceil(Decimal(least * (1 - FIT_ROUNDING)) / Decimal(str(self.step)))
        blocks = max(0, len(str(steps)) - self.digits)
        rounded = int((Decimal(steps) / 10**blocks).to_integral_value(ROUND_CEILING))
        first: int = 10 ** (self.digits - 1)
        return max(1, rounded + blocks * 9 * first)

    def _multiple(self, place: int) -> int:
        first: int = 10 ** (self.digits - 1)
        blocks = max(0, (place - first) // (9 * first))
        scale: int = 10**blocks
        return (place - blocks * 9 * first) * scale


RATIOS: Final = ShortNumbers(0.01, 2)
"""Slice ratios that are advised."""
MOST_RATIO: Final = 0.9
"""Largest slice ratio that is advised: the host computes in the rest of the period. Chosen."""
PERIOD_DIGITS: Final = 3
"""Significant digits of a period that is advised, in its step."""
PERIOD_STEP_US: Final = 1.0
"""Step of periods where no circle asks for another [us]."""
