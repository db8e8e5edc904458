"""The cycles of the common multiple of the rates of groups: which of them is drawn, and what each needs."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Final, NamedTuple

from busplan.buses.network import Group
from busplan.buses.rates import common_multiple, numbers_by_due
from busplan.elementwise import plain
from busplan.questions.timeline.events import Schedule

MOST_LISTED: Final = 64
"""Cycles of a common multiple that are listed [1]."""


class DistinctCycle(NamedTuple):
    """Cycles in which the same groups are due."""

    numbers: tuple[int, ...]
    """Which of the common multiple, from 1."""
    groups: tuple[str, ...]
    """Names of the groups that are due; empty where all nodes are alike."""
    nodes: int
    """Nodes that are due [1]."""
    required_us: float
    """Time that each of these cycles needs [us]."""


class CommonMultiple:
    """The cycles until all groups meet again, of which a schedule shows one.

    Parameters
    ----------
    schedule
        The cycle that is drawn.
    """

    def __init__(self, schedule: Schedule) -> None:
        self._schedule = schedule
        self._cycle = schedule.network.bus.cycle(schedule.network, model=schedule.figures.timing_model)
        self._rates = self._cycle.rates

    @cached_property
    def cycles(self) -> int:
        """How many they are [1]."""
        return common_multiple(self._rates)

    @cached_property
    def number(self) -> int:
        """Which of them is drawn, from 1."""
        asked = self._schedule.number
        return self._cycle.fullest if asked is None else (asked - 1) % self.cycles + 1

    @cached_property
    def distinct(self) -> tuple[DistinctCycle, ...] | None:
        """Those that differ, the longest first; None where there are more cycles than are listed."""
        if self.cycles > MOST_LISTED:
            return None
        each = map(self._distinct, numbers_by_due(self._rates).values())
        return tuple(sorted(each, key=lambda distinct: -distinct.required_us))

    def _distinct(self, numbers: tuple[int, ...]) -> DistinctCycle:
        due = self._due(numbers[0])
        nodes = sum(int(plain(group.nodes)) for group in due)
        return DistinctCycle(numbers, _names(due), nodes, plain(self._cycle.at(numbers[0]).required_us))

    def _due(self, number: int) -> list[Group]:
        both = zip(self._cycle.network.groups, self._rates, strict=True)
        return [group for group, rate in both if rate.is_due(number)]

    def sentences(self) -> Iterator[str]:
        """Say which cycle is drawn, and what each needs; nothing where all are alike and none was asked for."""
        asked = self._schedule.number
        if self.cycles == 1:
            if asked is not None:
                yield "All cycles are alike."
            return
        if asked not in (None, self.number):
            yield f"Cycle {asked} repeats cycle {self.number}."
        meet = "The nodes are due" if self._cycle.network.is_uniform else "The groups meet"
        yield f"{meet} every {self.cycles} cycles; this is {self._drawn}. {self._listed}"

    @property
    def _drawn(self) -> str:
        """The cycle that is drawn, in words."""
        if self._schedule.number is None:
            return "the fullest"
        due = self._due(self.number)
        return f"cycle {self.number}, with {self._words(_names(due), len(due))}"

    @property
    def _listed(self) -> str:
        """What each cycle needs, in words."""
        if self.distinct is None:
            return f"More than {MOST_LISTED} cycles are not listed."
        each = []
        for numbers, groups, nodes, required_us in self.distinct:
            each.append(f"{', '.join(map(str, numbers))}: {self._words(groups, nodes)} ({required_us:.3f} us)")
        return f"Cycles {'; '.join(each)}."

    def _words(self, names: Sequence[str], due: int) -> str:
        """Groups that are due, in words; where all nodes are alike, all of them or none."""
        if self._cycle.network.is_uniform:
            return "all nodes" if due else "no node"
        return ", ".join(names) or "no group"


def _names(groups: Sequence[Group]) -> tuple[str, ...]:
    """Names of groups of the profile."""
    return tuple(alike.name for group in groups for alike in group.members or (group.said,) if alike.name)
