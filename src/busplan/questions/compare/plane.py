"""What all drawings of a comparison say: its lines, their marks and colours, and both logarithmic scales."""

from collections.abc import Sequence
from math import log10
from string import ascii_uppercase
from typing import Final, NamedTuple

from busplan.buses.figure import Ink
from busplan.elementwise import plain
from busplan.forms.numbers import period
from busplan.forms.scale import round_numbers
from busplan.questions.compare.kinds import KindComparison, MachineOnKind
from busplan.questions.fit.network import bus_of, network_of

INKS_OF_LINES: Final[tuple[Ink, ...]] = ("request", "contention", "work", "sync", "acknowledge", "response", "reserve")
"""Colours of the lines; each has a letter, too."""
_LEAST_TOP: Final = 10
_MOST_LABELS: Final = 7


class KindLine(NamedTuple):
    """The line of a kind of bus."""

    letter: str
    ink: Ink
    title: str
    points: tuple[tuple[float, int], ...]
    """Period [us] and axes of each point; one that carries none has no place on the scale."""


class Plane(NamedTuple):
    """Both scales, from 0 to 1."""

    from_us: float
    to_us: float
    top_axes: int

    def x(self, period_us: float) -> float:
        """Place of a period."""
        return log10(period_us / self.from_us) / log10(self.to_us / self.from_us)

    def y(self, axes: int) -> float:
        """Place of a number of axes, 1 or more."""
        return log10(axes) / log10(self.top_axes)


def kind_lines(found: KindComparison) -> tuple[KindLine, ...]:
    """A line for each kind that can have the machine; its letter is one of the kind's name."""
    taken: set[str] = set()
    lines = []
    for number, one in enumerate(found.compared):
        letters = [each for each in f"{one.profile.bus.kind.upper()}{ascii_uppercase}" if each in ascii_uppercase]
        letter = next((each for each in letters if each not in taken), "#")
        taken.add(letter)
        own, points = " (this profile)" if one.is_own else "", _points(one)
        none = "" if points else ": none"
        ink = INKS_OF_LINES[number % len(INKS_OF_LINES)]
        lines.append(KindLine(letter, ink, f"{bus_of(one.profile).title}{own}{none}", points))
    return tuple(lines)


def _points(one: MachineOnKind) -> tuple[tuple[float, int], ...]:
    return tuple((each.period_us, each.axes) for each in one.curve if each.axes)


def plane_of(found: KindComparison) -> Plane:
    """The scales that hold every line and the machine itself."""
    periods_us = [each.period_us for one in found.compared for each in one.curve]
    axes = [each.axes or 1 for one in found.compared for each in one.curve]
    return Plane(min(periods_us), max(periods_us), max(_LEAST_TOP, own_axes(found), *axes))


def own_axes(found: KindComparison) -> int:
    """Axes of the machine."""
    return int(plain(network_of(found.profile).axes))


def axes_labels(plane: Plane) -> list[int]:
    """Round numbers of axes to label, as few as can be read."""
    return [int(one) for one in round_numbers(1, plane.top_axes, most=_MOST_LABELS)]


def period_labels(found: KindComparison) -> list[tuple[float, str]]:
    """Periods of the points with their text, the machine's own among them."""
    return [(us, period(us)) for us in _periods_us(found.compared)]


def _periods_us(compared: Sequence[MachineOnKind]) -> list[float]:
    return sorted({each.period_us for one in compared for each in one.curve})
