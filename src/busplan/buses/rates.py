"""Groups at several rates: which of them are due in which cycle of the common multiple of their rates."""

from collections.abc import Iterable, Mapping, Sequence
from math import lcm
from typing import NamedTuple


class Rate(NamedTuple):
    """Of a group whose data go in every n-th cycle; of plain numbers."""

    every: int
    """n [1]."""
    first: int = 1
    """First of its cycles, from 1 to n."""

    def is_due(self, number: int) -> bool:
        """Whether its data go in a cycle, from 1."""
        return (number - self.first) % self.every == 0


def common_multiple(rates: Iterable[Rate]) -> int:
    """Cycles until all groups meet again, however many [1]."""
    return lcm(*(rate.every for rate in rates))


def numbers_by_due(rates: Sequence[Rate]) -> Mapping[tuple[bool, ...], tuple[int, ...]]:
    """Cycles of the common multiple by which groups are due in them, in the order of their first.

    Examples
    --------
    >>> numbers_by_due([Rate(1), Rate(3, first=2)])
    {(True, False): (1, 3), (True, True): (2,)}
    """
    numbers: dict[tuple[bool, ...], list[int]] = {}
    for number in range(1, common_multiple(rates) + 1):
        numbers.setdefault(tuple(rate.is_due(number) for rate in rates), []).append(number)
    return {due: tuple(each) for due, each in numbers.items()}
