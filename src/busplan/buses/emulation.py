"""What a kind of bus is asked to emulate: a recording as the planned machine would give it, with named faults."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from random import Random
from typing import Final, Literal, NamedTuple

from busplan.buses.network import Network
from busplan.errors import BusplanError

TIMES: Final = 5
"""How often a fault happens, where nothing says otherwise."""
LEAST_SHARE: Final = 0.5
"""The host takes this share of its planned time, or more."""
MOST_FRAMES: Final = 500_000
_FIRST: Final = 3
"""Cycles before the first fault, which there may be the machine's start."""
_ONE_OF: Final = 4
"""A fault hits at most one of so many cycles."""


class Fault(NamedTuple):
    """A fault that an emulated machine may have."""

    name: str
    words: str
    """What the machine does."""
    shown_as: str
    """Figure of `measured` that shows it."""
    unit: Literal["1", "us"] = "1"
    """Meaning of its value: how often it happens, or how late."""
    default: float = TIMES
    """Value without one given; of a time, in periods."""


@dataclass
class Emulation:
    """How a machine is to be emulated."""

    cycles: int
    """Length of the recording; of messages alone in periods of the fastest."""
    random: Random
    faults: Mapping[str, float]
    """Value of each fault, by name."""
    origin: str
    """By what, and from what, in words."""
    _hit: set[int] = field(default_factory=set)

    def drawn(self, fault: Fault, among: Iterable[int]) -> frozenset[int]:
        """Cycles that a fault hits, except cycles of other faults; none unless it is asked for.

        Raises
        ------
        BusplanError
            More than a quarter of the cycles that it can happen in.
        """
        if fault.name not in self.faults:
            return frozenset()
        number = int(self.faults[fault.name]) if fault.unit == "1" else TIMES
        free = [cycle for cycle in among if cycle >= _FIRST and cycle not in self._hit]
        if number > len(free) // _ONE_OF:
            why = f"of {len(free):,} cycles that may have it, it takes a quarter at most; give more cycles"
            raise BusplanError(f"fault {fault.name}: {number:,} times; {why}")
        drawn = frozenset(self.random.sample(free, number))
        self._hit |= drawn
        return drawn

    def require_few(self, frames: float) -> None:
        """Refuse a recording that is too large.

        Raises
        ------
        BusplanError
            More than `MOST_FRAMES`.
        """
        if frames > MOST_FRAMES:
            raise BusplanError(f"{frames:,.0f} frames; a recording has up to {MOST_FRAMES:,}: give fewer cycles")


class Emulator(NamedTuple):
    """What a kind of bus emulates."""

    faults: tuple[Fault, ...]
    endings: tuple[str, ...]
    """Endings that a file of its recordings may have."""
    period_us: Callable[[Network], float]
    """Period of the cycle; of messages alone that of the fastest [us]."""
    emulated: Callable[[Network, Emulation], bytes]
    """The recording of a network of plain numbers."""
