"""What a cycle of any bus is: terms that add up, events that add up to them, latencies, and what is not known."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

from busplan.buses.figure import REQUIRED, term_name
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, plain, total


class Term(NamedTuple):
    """A part of the cycle. All terms add up to what the cycle needs."""

    key: str
    """Of its figure."""
    us: Number
    rests_on: str = ""
    """Dotted key of the profile that it comes from, where that is one alone."""

    @property
    def name(self) -> str:
        """What it is called beside the other terms."""
        return term_name(self.key)


class BusEvent(NamedTuple):
    """A stretch of the cycle; it begins where the one before it ends. The events of a term add up to it."""

    kind: str
    """Key of its `EventKind`."""
    term: str
    """Key of the term that it is a part of."""
    us: float
    label: str
    """What it is, and who is at work."""
    node: int | None = None
    """Whose it is, from 1; None for what belongs to all."""
    transaction: str | None = None
    """What it belongs to at a coarse look: the key of an `EventKind` for stretches."""
    packet: str | None = None
    """Which packet of the transaction it belongs to."""


class Doubt(NamedTuple):
    """Something that a cycle rests on and that is not known exactly."""

    key: str
    """Dotted key of the profile, or a name of its own."""
    label: str
    us: Number
    """Standard uncertainty that it gives the cycle: its own, times the sensitivity [us]."""


class LeftOut(NamedTuple):
    """What a cycle could have and a profile does not say: no verdict has it."""

    label: str
    key: str
    """The key that would say it."""


class BusLatency(NamedTuple):
    """How long one thing takes on the bus, part by part."""

    name: str
    payload_bytes: Number | None
    phases: Mapping[str, Number]
    """Figures by key, which are among the kind's `latency_figures`; an infinite one does not exist."""
    group: str = ""
    """Of which group of nodes; empty where all are alike."""

    @property
    def label(self) -> str:
        """What it is called beside the others."""
        return f"{self.group} {self.name}" if self.group else self.name


class BusCycle(ABC):
    """One communication cycle of a network under one timing model.

    What it needs rests on neither the period nor the slice ratio: these say what it is given. The smallest period and
    ratio are computed from that.
    """

    network: Network

    @abstractmethod
    def computed_terms(self) -> tuple[Term, ...]:
        """The cycle in the order of the wire: every term always, 0.0 where it is off."""

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """The terms, computed once: a derivation names the very numbers that are added up."""
        return self.computed_terms()

    @property
    def required_us(self) -> Number:
        """What the whole cycle needs, the sum of its terms: N times (2) [us]."""
        return total(term.us for term in self.terms)

    @property
    def most_required_us(self) -> Number:
        """No less than it needs with any number of nodes up to its own, where one more can make it shorter [us]."""
        return self.required_us

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:  # noqa: ARG002 - most just grow by it
        """What the whole cycle grows by if what it transmits takes longer [us].

        Parameters
        ----------
        extra_us
            By how much it takes longer [us].
        after_us
            By how much it took longer before [us].
        """
        return extra_us

    def bias_us(self) -> Number | None:
        """What the bus takes beyond the timing model, on the mean [us]; None where nobody has measured it."""
        return None

    def sync_jitter_us(self) -> Number:
        """Jitter of the synchronous packet that the cycle's own traffic makes, either way of its mean [us]."""
        return 0.0

    def taking_us(self, group: Group) -> float:
        """From a command's arrival at a node of a group to its effect: the slowest execution of a write [us]."""
        return plain(group.write_execution_us + group.worst_extra_us)

    def sampled_us(self) -> float:
        """When nodes sample the feedback that a cycle carries, from its start; of plain numbers [us]."""
        return 0.0

    def loop_periods(self, *, at_sync: bool) -> int:
        """Whole periods inside a loop on the host, from the cycle of a sample to that of its command [1].

        Parameters
        ----------
        at_sync
            Whether commands take effect at the next synchronous point, which is counted; otherwise they do when they
            arrive, which comes on top.
        """
        return 1 if at_sync else 0

    def doubts(self) -> tuple[Doubt, ...]:
        """What is not known exactly; different inputs are independent."""
        return ()

    def left_out(self) -> tuple[LeftOut, ...]:
        """What the cycle could have and the profile does not say."""
        return ()

    @abstractmethod
    def events(self) -> Iterator[BusEvent]:
        """The same cycle laid out, of plain numbers only."""

    def figures(self) -> Mapping[str, Number | None]:
        """The kind's own figures beside the terms, by key; None for one that these groups of nodes do not have."""
        return {}

    def latencies(self) -> tuple[BusLatency, ...]:
        """How long things take; a kind without transactions has its cycle."""
        phases = {term.key: term.us for term in self.terms} | {REQUIRED.key: self.required_us}
        return (BusLatency("cycle", None, phases),)
