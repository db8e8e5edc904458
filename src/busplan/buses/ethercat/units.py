"""Groups at several rates: which of them go in which cycle, and the fullest cycle of their common multiple."""

from collections.abc import Sequence
from functools import lru_cache
from math import lcm
from typing import Final, NamedTuple

from busplan.buses.ethercat.equations import overhead_bytes
from busplan.buses.ethercat.packing import Devices, pack
from busplan.buses.rates import Rate, numbers_by_due
from busplan.elementwise import plain
from busplan.errors import BusplanError

MOST_CYCLES: Final = 1000
"""Longest common multiple of the rates that is looked through [1]."""


class Unit(NamedTuple):
    """The devices of a group, whose process data go in every n-th cycle; of plain numbers."""

    every: int
    """n [1]."""
    devices: int
    data_bytes: float
    """Bytes of each in a frame [bytes]."""


class UnitCycle(NamedTuple):
    """Cycles with the same units in them."""

    due: tuple[bool, ...]
    """Whether each unit goes."""
    numbers: tuple[int, ...]
    """Which of the common multiple, from 1."""
    wire_bytes: float
    """All frames of process data on the wire [bytes]."""
    last_bytes: float
    """Datagrams of the last frame [bytes]."""
    data_bytes: float
    """All process data [bytes]."""


def common_multiple(rates: Sequence[int]) -> int:
    """Cycles until all units meet again [1].

    Raises
    ------
    BusplanError
        More than are looked through.
    """
    cycles = lcm(*rates)
    if cycles > MOST_CYCLES:
        shown = ", ".join(map(str, sorted(set(rates))))
        raise BusplanError(f"rates of {shown} meet every {cycles} cycles; {MOST_CYCLES} are looked through at most")
    return cycles


def starts(units: Sequence[Unit], *, is_spread: bool) -> tuple[int, ...]:
    """First cycle of each unit, from 0.

    Spread, the faster unit is placed first, of one rate the larger, each where the fullest of its cycles has the fewest
    bytes so far. Together, all start in the first.

    Examples
    --------
    >>> starts([Unit(1, 8, 20), Unit(2, 4, 10), Unit(4, 1, 30), Unit(4, 2, 10)], is_spread=True)
    (0, 0, 1, 3)
    """
    found = [0] * len(units)
    cycles = common_multiple([unit.every for unit in units])
    filled = [0.0] * cycles
    sizes = [unit.devices * unit.data_bytes for unit in units]
    for place in sorted(range(len(units)), key=lambda place: (units[place].every, -sizes[place])):
        every = units[place].every
        if is_spread:
            found[place] = min(range(every), key=lambda start: max(filled[start::every]))
        for cycle in range(found[place], cycles, every):
            filled[cycle] += sizes[place]
    return tuple(found)


def unit_rates(units: Sequence[Unit], *, is_spread: bool) -> tuple[Rate, ...]:
    """The rate of each unit with its first cycle."""
    first = starts(units, is_spread=is_spread)
    return tuple(Rate(unit.every, start + 1) for unit, start in zip(units, first, strict=True))


@lru_cache(maxsize=1 << 12)
def unit_cycles(
    units: tuple[Unit, ...], *, is_spread: bool, datagrams: int, first_bytes: float
) -> tuple[UnitCycle, ...]:
    """The cycles of the common multiple that differ, the fullest first.

    Parameters
    ----------
    units
        In the order of the segment.
    is_spread
        Whether units at slower rates go in different cycles as evenly as possible; otherwise they meet.
    datagrams, first_bytes
        As `pack` takes them.

    Raises
    ------
    BusplanError
        The rates meet too seldom.
    """
    packed = []
    for due, numbers in numbers_by_due(unit_rates(units, is_spread=is_spread)).items():
        own = [Devices(unit.devices, unit.data_bytes * is_due) for unit, is_due in zip(units, due, strict=True)]
        frames = pack(own, datagrams=datagrams, first_bytes=first_bytes)
        wire_bytes = plain(
            frames.frames * overhead_bytes(frames.frames) + frames.datagrams_bytes + frames.padding_bytes
        )
        data_bytes = plain(sum(one.number * one.data_bytes for one in own))
        packed.append(UnitCycle(due, numbers, wire_bytes, plain(frames.last_bytes), data_bytes))
    return tuple(sorted(packed, key=lambda cycle: (-cycle.wire_bytes, -cycle.data_bytes)))
