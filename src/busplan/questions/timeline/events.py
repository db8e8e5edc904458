"""One communication cycle as a schedule: each event begins where the one before it ends.

`capacity` sums the events of the cycle by runs; here they are laid out and added one by one, and must end at the same
time.
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from math import fsum
from typing import Final, NamedTuple

from busplan.buses.cycle import BusCycle, BusEvent
from busplan.buses.figure import Figure
from busplan.buses.network import Group, Network, hyperperiod, numbers_by_due
from busplan.buses.parts import IDLE, EventKind
from busplan.elementwise import Number, existing, is_over
from busplan.errors import BusplanError
from busplan.questions.fit.certainty import available_us, certainty
from busplan.questions.fit.figures import CycleFigures, certainty_numbers, cycle_figures, margin_us, words_behind
from busplan.questions.fit.network import model_names, warnings_of
from busplan.sections.profile import Profile

MOST_NODES: Final = 1000
"""Most nodes laid out one by one: far more than a bus may have, so that a profile beyond its limit can be shown."""
MOST_EVENTS: Final = 50_000
"""Most events: those of so many nodes, and more retries or cycle starts than anyone can look at."""
MOST_LISTED: Final = 64
"""Longest hyperperiod whose cycles are listed [1]."""

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


class ModelNeeds(NamedTuple):
    """Time that the drawn cycle needs under a timing model."""

    timing_model: str
    required_us: float
    margin_us: float
    """What it leaves of the slice, by the timing model alone."""
    margin_corrected_us: float | None
    """The same less the bias, as in the verdict; None under a model that does not decide."""

    @property
    def free_us(self) -> float:
        """Unused time of the slice, as far as its model knows [us]."""
        return self.margin_us if self.margin_corrected_us is None else self.margin_corrected_us


class DistinctCycle(NamedTuple):
    """Cycles in which the same groups are due."""

    numbers: tuple[int, ...]
    """Their numbers in the hyperperiod, from 1."""
    groups: tuple[str, ...]
    """Names of the groups that are due; empty where all nodes are alike."""
    nodes: int
    """Nodes that are due [1]."""
    required_us: float
    """Time that each of these cycles needs [us]."""


class Schedule(NamedTuple):
    """A cycle, or the part of it inside a window."""

    profile: Profile
    figures: CycleFigures
    """Closed form of the cycle that the verdict is for: time needed, time available, and whether it fits."""
    broken_limits: tuple[str, ...]
    """By how much each limit of the bus is broken, or why it is not shown to be kept."""
    cycle_events: tuple[Event, ...]
    """Events of the whole cycle, and the idle rest of its slice, if any."""
    kinds: Mapping[str, EventKind]
    """Name and colour of each kind of event, and of each sequence of events, by key."""
    from_us: float
    """Start of the window [us]."""
    to_us: float
    """End of the window [us]."""
    required_us: float
    """Closed form of the time that the cycle needs [us]."""
    overruns: bool
    """Whether the cycle takes more than its slice."""
    margin_us: float
    """Time that the cycle leaves of its slice [us]."""
    margin_corrected_us: float | None
    """The same less the bias; None under a model that does not decide [us]."""
    uncertainty_us: float | None
    """Expanded uncertainty of that; None where it is unknown, too [us]."""
    needs: tuple[ModelNeeds, ...]
    """What the cycle needs under each timing model that applies."""
    number: int | None
    """Number of the cycle that was asked for, from 1; None for that of the verdict."""
    cycles: int
    """Hyperperiod: cycles after which the groups repeat [1]."""
    drawn: int
    """Number in the hyperperiod of the cycle that is laid out, from 1."""
    due: tuple[str, ...]
    """Names of the groups whose data are in it; an empty name where all nodes are alike."""
    distinct: tuple[DistinctCycle, ...] | None
    """The distinct cycles of the hyperperiod, the longest first; None for more than can be listed."""
    setup: tuple[str, ...]
    """Settings of the bus in force, each in a few words."""
    path: str
    """Which distance on the wire each node is charged with; empty where there is no choice."""
    warnings: tuple[str, ...]
    """Warnings that hold whatever the verdict."""

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


def schedule(network: Network, *, model: str | None = None, number: int | None = None) -> Schedule:
    """One communication cycle, node by node.

    First come the events of the bus, then the idle rest of the slice. No event has zero duration. `number` is that of
    the cycle, from 1; by default the cycle that the verdict is for. BusplanError: more nodes or events than can be laid
    out one by one.

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
    nodes = int(network.nodes)
    if nodes > MOST_NODES:
        limit = network.bus.limit("nodes")
        carries = "" if limit is None else f"; one bus carries {limit.most(network):g}"
        where = "bus.nodes" if network.is_uniform else "nodes of all groups"
        raise BusplanError(f"{where} = {nodes}: a timeline shows up to {MOST_NODES} nodes{carries}")
    bus, model = network.bus, network.bus.deciding_model if model is None else model
    closed, of_verdict = cycle_figures(network, model=model), bus.cycle(network, model=model)
    cycle, cycles = _numbered(of_verdict, number), hyperperiod(of_verdict.rates)
    events = list(islice(_laid_out(cycle.events()), MOST_EVENTS + 1))
    if len(events) > MOST_EVENTS:
        raise BusplanError(f"a timeline shows up to {MOST_EVENTS:,} events, and this cycle has more")
    end_us = events[-1].end_us
    # A rest that is only float rounding is no idle time.
    if is_over(closed.available_us, end_us):
        events.append(Event(IDLE.key, None, None, None, end_us, closed.available_us, "", IDLE.label))
    drawn = of_verdict.fullest if number is None else (number - 1) % cycles + 1
    return Schedule(
        network.profile,
        closed,
        words_behind(closed, network),
        tuple(events),
        kinds={kind.key: kind for kind in (*bus.stretch_kinds, IDLE, *bus.event_kinds)},
        from_us=0.0,
        to_us=events[-1].end_us,
        required_us=cycle.required_us,
        overruns=bool(is_over(cycle.required_us, closed.available_us)),
        margin_us=margin_us(cycle.required_us, available_us=closed.available_us),
        **_certainty(cycle, model),
        needs=tuple(
            _needs(cycle if other == model else _numbered(bus.cycle(network, model=other), number), other)
            for other in model_names(network)
        ),
        number=number,
        cycles=cycles,
        drawn=drawn,
        due=tuple(member.name for group in _due_groups(of_verdict, drawn) for member in group.members),
        distinct=_distinct_cycles(of_verdict) if cycles <= MOST_LISTED else None,
        setup=bus.setup_words(network),
        path=bus.path_words(network),
        warnings=warnings_of(network),
    )


def _numbered(cycle: BusCycle, number: int | None) -> BusCycle:
    """The cycle with a number; None for the one that the verdict is for."""
    return cycle if number is None else cycle.at(number)


def _needs(cycle: BusCycle, model: str) -> ModelNeeds:
    """Time that a cycle needs under its timing model, and what it leaves of the slice."""
    margin = margin_us(cycle.required_us, available_us=available_us(cycle.network))
    return ModelNeeds(model, cycle.required_us, margin, _certainty(cycle, model)["margin_corrected_us"])


def _certainty(cycle: BusCycle, model: str) -> dict[str, float | None]:
    """The corrected margin of a cycle and its uncertainty [us]; None under a model that does not decide."""
    numbers: Mapping[str, Number | None] = {}
    if model == cycle.network.bus.deciding_model:
        numbers = certainty_numbers(certainty(cycle), cycle)
    found = {key: numbers.get(key) for key in ("margin_corrected_us", "uncertainty_us")}
    return {key: None if number is None else existing(number) for key, number in found.items()}


def zoom(
    laid_out: Schedule,
    *,
    from_us: float | None = None,
    to_us: float | None = None,
    transaction: tuple[str, int] | None = None,
) -> Schedule:
    """A schedule whose window is what all given bounds have in common.

    `from_us` and `to_us` count from the start of the cycle [us]; `transaction` is one with its gaps: ("read", 1).
    BusplanError: the window is empty.
    """
    start_us = max(laid_out.from_us, laid_out.from_us if from_us is None else from_us)
    end_us = min(laid_out.to_us, laid_out.to_us if to_us is None else to_us)
    span = f"the cycle runs from 0 to {laid_out.end_us:.12g} us"
    if transaction is not None:
        of_transaction = [event for event in laid_out.cycle_events if (event.transaction, event.node) == transaction]
        if not of_transaction:
            raise BusplanError(f"{transaction[0]}:{transaction[1]}: no such transaction in this cycle")
        first_us, last_us = of_transaction[0].start_us, of_transaction[-1].end_us
        start_us, end_us = max(start_us, first_us), min(end_us, last_us)
        span = f"the {transaction[0]} of node {transaction[1]} runs from {first_us:.12g} to {last_us:.12g} us"
    if not start_us < end_us:
        shown = " ".join(
            f"{word} {value:.12g} us" for word, value in (("from", from_us), ("to", to_us)) if value is not None
        )
        raise BusplanError(f"the window {shown} shows nothing: {span}")
    return laid_out._replace(from_us=start_us, to_us=end_us)


def totals(laid_out: Schedule) -> tuple[Total, ...]:
    """Sums of the events of a window by kind, in order of first appearance."""
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
        us = part.us
        larger_us, smaller_us = max(total_us, us), min(total_us, us)
        total_us = larger_us + smaller_us
        lost_us += (larger_us - total_us) + smaller_us
        end_us = total_us + lost_us
        if end_us > start_us:
            yield Event(part.kind, part.node, part.transaction, part.packet, start_us, end_us, part.term, part.label)
            start_us = end_us


def _distinct_cycles(cycle: BusCycle) -> tuple[DistinctCycle, ...]:
    """The distinct cycles of the hyperperiod, the longest first."""
    distinct = (
        DistinctCycle(
            numbers,
            tuple(member.name for group in due for member in group.members if member.name),
            sum(int(group.nodes) for group in due),
            cycle.at(numbers[0]).required_us,
        )
        for numbers in numbers_by_due(cycle.rates).values()
        for due in [_due_groups(cycle, numbers[0])]
    )
    return tuple(sorted(distinct, key=lambda each: -each.required_us))


def _due_groups(cycle: BusCycle, number: int) -> list[Group]:
    """Groups whose data are in a cycle of the hyperperiod."""
    pairs = zip(cycle.network.groups, cycle.rates, strict=True)
    return [group for group, rate in pairs if rate.is_due(number)]
