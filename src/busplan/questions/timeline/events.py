"""One communication cycle as a schedule: each event begins where the one before it ends.

`capacity` counts the events of the cycle by runs; here they are laid out and added one by one, and the end of the last
one must be the same.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import islice
from math import fsum
from typing import Final, NamedTuple

from busplan.buses.cycle import BusCycle, BusEvent
from busplan.buses.figure import Figure
from busplan.buses.limits import IDLE
from busplan.buses.network import Group, Network, common_multiple, numbers_by_due
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.questions.fit.certainty import fits_in
from busplan.questions.fit.figures import FitFigures, figures, margin_us
from busplan.questions.fit.network import leading_model
from busplan.sections.profile import Profile

MOST_NODES: Final = 1000
"""Most nodes laid out one by one: far more than a bus may have, so that a profile beyond its limit can be shown."""
MOST_EVENTS: Final = 50_000
"""Most events: those of so many nodes, and more retries or cycle starts than anyone can look at."""

EVENTS: Final = Figure("events", "n", "schedule", "events of one kind in the window", "events", sort="count")
TOTAL: Final = Figure("total_us", "t", "schedule", "what the events of one kind take together", "time")
SHARE: Final = Figure("share", "s", "schedule", "share of the window that they take, 0..1", "share", "%", decimals=2)


class Event(NamedTuple):
    """One event of the cycle."""

    kind: str
    """Key of its kind, defined by the bus."""
    node: int | None
    """Node of its transaction, from 1; None for an event of the whole bus."""
    transaction: str | None
    packet: str | None
    """Packet of the transaction, if it belongs to one."""
    start_us: float
    end_us: float
    term: str
    """Key of the term that it is a part of; empty for idle time."""
    label: str
    """The event in words, with the node or device that causes it."""

    @property
    def duration_us(self) -> float:
        """Duration, clipped to the window [us]."""
        return self.end_us - self.start_us


class Schedule(NamedTuple):
    """A cycle, or the part of it inside a window."""

    network: Network
    figures: FitFigures
    """Closed form of the cycle that the verdict is for: time needed, time available, and whether it fits."""
    cycle_events: tuple[Event, ...]
    """Events of the whole cycle, and the idle rest of its slice."""
    from_us: float
    """Start of the window [us]."""
    to_us: float
    """End of the window [us]."""
    required_us: float
    """Closed form of the time that the cycle needs [us]."""
    number: int | None = None
    """Which cycle of the common multiple of the rates was asked for, from 1; None for that of the verdict."""

    @property
    def profile(self) -> Profile:
        """The profile of the network."""
        profile: Profile = self.network.profile
        return profile

    @property
    def end_us(self) -> float:
        """End of the cycle or of its slice, whichever is later [us]."""
        return self.cycle_events[-1].end_us

    @property
    def used_us(self) -> float:
        """End of the last event that is not idle: the required time as a sum of events [us]."""
        last = self.cycle_events[-1]
        return last.start_us if last.kind == IDLE.key else last.end_us

    @property
    def margin_us(self) -> float:
        """Time that the cycle leaves of its slice [us]."""
        return plain(margin_us(self.required_us, available_us=self.figures.available_us))

    @property
    def is_whole(self) -> bool:
        """Whether the window is the whole cycle."""
        return self.from_us == 0 and self.to_us == self.end_us

    @property
    def events(self) -> tuple[Event, ...]:
        """Events inside the window, clipped to it."""
        return tuple(
            event._replace(start_us=max(event.start_us, self.from_us), end_us=min(event.end_us, self.to_us))
            for event in self.cycle_events
            if event.start_us < self.to_us and event.end_us > self.from_us
        )


class Total(NamedTuple):
    """Sum of the events of one kind in a window."""

    kind: str
    events: int
    total_us: float
    share: float
    """Share of the window, 0..1."""


def drawn_cycle(network: Network, *, model: str, number: int | None) -> BusCycle:
    """The cycle that a timeline shows under a timing model; parameters as `schedule` has them."""
    cycle = network.bus.cycle(network, model=model)
    return cycle if number is None else cycle.at(number)


def schedule(network: Network, *, model: str | None = None, number: int | None = None) -> Schedule:
    """Lay out one communication cycle, node by node.

    The events of the bus, then the idle rest of the slice. There are no events of zero duration.

    Parameters
    ----------
    network
        The network.
    model
        Timing model; without it the one whose figures lead.
    number
        Cycle of the common multiple of the rates of groups, from 1; without it the cycle that the verdict is for.

    Raises
    ------
    BusplanError
        More nodes or events than can be laid out one by one.

    References
    ----------
    Paper, section III-C and equation (2), Figs. 4, 5 and 7.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> from busplan.questions.fit.network import network_of
    >>> cycle = schedule(network_of(load("paper-two-node").profile))
    >>> [event.kind for event in cycle.events][2:5]
    ['request_data', 'acknowledge', 'execution']
    >>> abs(cycle.used_us - cycle.figures.required_us) < 1e-9
    True
    """
    nodes = int(plain(network.nodes))
    if nodes > MOST_NODES:
        limit = network.bus.limit("nodes")
        carries = "" if limit is None else f"; one bus carries {limit.most(network):g}"
        where = "bus.nodes" if network.is_uniform else "nodes of all groups"
        raise BusplanError(f"{where} = {nodes}: a timeline shows up to {MOST_NODES} nodes{carries}")
    model = leading_model(network) if model is None else model
    closed, cycle = figures(network, model=model), drawn_cycle(network, model=model, number=number)
    events = list(islice(_laid_out(cycle.events()), MOST_EVENTS + 1))
    if len(events) > MOST_EVENTS:
        raise BusplanError(f"a timeline shows up to {MOST_EVENTS:,} events, and this cycle has more")
    end_us = events[-1].end_us
    # A rest that is only float rounding is no idle time.
    if not fits_in(closed.available_us, available_us=end_us):
        events.append(Event(IDLE.key, None, None, None, end_us, closed.available_us, "", IDLE.label))
    return Schedule(
        network,
        closed,
        tuple(events),
        from_us=0.0,
        to_us=events[-1].end_us,
        required_us=plain(cycle.required_us),
        number=number,
    )


def zoom(
    laid_out: Schedule,
    *,
    from_us: float | None = None,
    to_us: float | None = None,
    transaction: tuple[str, int] | None = None,
) -> Schedule:
    """Narrow the window of a schedule to the intersection of all given limits.

    Parameters
    ----------
    laid_out
        The schedule.
    from_us, to_us
        Start and end of the window, from the start of the cycle [us]; by default the schedule's own.
    transaction
        One transaction with its gaps: ("read", 1).

    Raises
    ------
    BusplanError
        The window is empty.
    """
    start_us = max(laid_out.from_us, laid_out.from_us if from_us is None else from_us)
    end_us = min(laid_out.to_us, laid_out.to_us if to_us is None else to_us)
    span = f"the cycle runs from 0 to {laid_out.end_us:.12g} us"
    if transaction is not None:
        own = [event for event in laid_out.cycle_events if (event.transaction, event.node) == transaction]
        if not own:
            raise BusplanError(f"{transaction[0]}:{transaction[1]}: no such transaction in this cycle")
        start_us, end_us = max(start_us, own[0].start_us), min(end_us, own[-1].end_us)
        owner = f"the {transaction[0]} of node {transaction[1]}"
        span = f"{owner} runs from {own[0].start_us:.12g} to {own[-1].end_us:.12g} us"
    if not start_us < end_us:
        shown = " ".join(
            f"{word} {value:.12g} us" for word, value in (("from", from_us), ("to", to_us)) if value is not None
        )
        raise BusplanError(f"the window {shown} shows nothing: {span}")
    return laid_out._replace(from_us=start_us, to_us=end_us)


def totals(laid_out: Schedule) -> tuple[Total, ...]:
    """Sum the events of a window by kind, in order of first appearance."""
    sums: dict[str, list[float]] = {}
    for event in laid_out.events:
        sums.setdefault(event.kind, []).append(event.duration_us)
    window_us = laid_out.to_us - laid_out.from_us
    return tuple(Total(kind, len(parts), fsum(parts), fsum(parts) / window_us) for kind, parts in sums.items())


def _laid_out(parts: Iterable[BusEvent]) -> Iterator[Event]:
    """Place events one after the other.

    Compensated summation (Neumaier) keeps rounding from growing with the number of events.
    """
    total_us = lost_us = start_us = 0.0
    for part in parts:
        us = plain(part.us)
        larger_us, smaller_us = max(total_us, us), min(total_us, us)
        total_us = larger_us + smaller_us
        lost_us += (larger_us - total_us) + smaller_us
        end_us = total_us + lost_us
        if end_us > start_us:
            yield Event(part.kind, part.node, part.transaction, part.packet, start_us, end_us, part.term, part.label)
            start_us = end_us


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
    return tuple(member.name for group in groups for member in group.members if member.name)
