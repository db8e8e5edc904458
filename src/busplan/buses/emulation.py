"""Emulation of a recording as the planned machine would give it, with named faults."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from random import Random
from typing import Final, Literal, NamedTuple

from busplan.buses.network import Network
from busplan.errors import ArgumentError, BusplanError

TIMES: Final = 5
"""Number of times that a fault happens by default."""
LEAST_SHARE: Final = 0.5
"""Least share of its planned time that the host takes."""
MOST_FRAMES: Final = 500_000
MOST_BYTES: Final = 120_000_000
"""Most bytes of all frames: they are in memory several times."""
_FIRST: Final = 3
"""Cycles before the first fault, since a fault there may pass for the machine's start."""
_ONE_OF: Final = 4
"""Number of cycles of which a fault hits at most one."""


class Fault(NamedTuple):
    """A fault that an emulated machine may have."""

    name: str
    words: str
    """Action of the machine, in words."""
    shown_as: str
    """Figure of `measured` that shows the fault."""
    unit: Literal["1", "us"] = "1"
    """Unit of the value: a number of times, or a delay."""
    default: float = TIMES
    """Value by default; a time is in periods."""


@dataclass
class Emulation:
    """Length, faults and random numbers of an emulation."""

    cycles: int
    """Length of the recording in cycles; for messages alone, in periods of the fastest."""
    random: Random
    faults: Mapping[str, float]
    """Value of each fault, by name."""
    origin: str
    """Tool and source of the recording, in words."""
    _hit: set[int] = field(default_factory=set)

    def drawn(self, fault: Fault, among: Iterable[int]) -> frozenset[int]:
        """Cycles that a fault hits, except cycles of other faults; none unless it is asked for.

        More than a quarter of the cycles that it can happen in raises `BusplanError`.
        """
        if fault.name not in self.faults:
            return frozenset()
        number = int(self.faults[fault.name]) if fault.unit == "1" else TIMES
        possible = [*among]
        if not possible:
            raise ArgumentError(f"fault {fault.name}: no cycle of this plan may have it")
        free = [cycle for cycle in possible if cycle >= _FIRST and cycle not in self._hit]
        if number > len(free) // _ONE_OF:
            why = f"of {len(free):,} cycles that may have it, it takes a quarter at most; give more cycles"
            raise ArgumentError(f"fault {fault.name}: {number:,} times; {why}")
        drawn = frozenset(self.random.sample(free, number))
        self._hit |= drawn
        return drawn

    def require_few(self, frames: float, *, frames_bytes: float = 0) -> None:
        """Refuse a recording of more than `MOST_FRAMES`, or of more than `MOST_BYTES`, with a `BusplanError`."""
        if frames > MOST_FRAMES:
            raise BusplanError(f"{frames:,.0f} frames; a recording has up to {MOST_FRAMES:,}: give fewer cycles")
        if frames_bytes > MOST_BYTES:
            raise BusplanError(f"{frames_bytes:,.0f} bytes; a recording has up to {MOST_BYTES:,}: give fewer cycles")


class Emulator(NamedTuple):
    """Emulation of a kind of bus."""

    faults: tuple[Fault, ...]
    endings: tuple[str, ...]
    """Endings that a file of its recordings may have."""
    period_us: Callable[[Network], float]
    """Period of the cycle [us]; for messages alone, that of the fastest."""
    emulated: Callable[[Network, Emulation], bytes]
    """Recording of a network of plain numbers."""
