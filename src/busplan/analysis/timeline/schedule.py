"""One communication cycle as a schedule: event after event, each beginning where the one before it ends.

This is the second way to the time that a cycle needs. `capacity` multiplies and adds in closed form; here every phase
of every transaction is laid behind the other, and the last end must be the same.
"""

from collections.abc import Iterable, Iterator
from math import fsum
from typing import Final, Literal, NamedTuple

from busplan.analysis.capacity.cycle import Cycle, cycle, fits_in
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.buses.ieee1394.constants import MAX_NODES
from busplan.buses.ieee1394.timing import Phases, TimingModelName, TransactionKind
from busplan.errors import BusplanError
from busplan.profile.model import Profile

EventKind = Literal[
    "sync",
    "arbitration",
    "request_data",
    "acknowledge",
    "execution",
    "response_data",
    "subaction_gap",
    "arbitration_reset_gap",
    "nonperiodic",
    "idle",
]
Packet = Literal["request", "response"]

MOST_NODES: Final = 1000
"""Nodes that are still laid out one by one: far beyond the 62 of a bus, so that a plan that breaks this limit can be
seen; few enough for a document."""


class Event(NamedTuple):
    """What happens from one moment of the cycle to another."""

    kind: EventKind
    node: int | None
    """Whose transaction it belongs to, from 1; None for what belongs to all."""
    transaction: TransactionKind | None
    packet: Packet | None
    """Which of the transaction's two packets it belongs to, where it belongs to one."""
    start_us: float
    end_us: float

    @property
    def duration_us(self) -> float:
        """How long it takes, or how much of it is inside the window [us]."""
        return self.end_us - self.start_us


class Schedule(NamedTuple):
    """A cycle, or the part of it inside a window."""

    profile: Profile
    figures: CapacityFigures
    """The closed form: what the cycle needs, what it may take, and whether it fits."""
    cycle_events: tuple[Event, ...]
    """The whole cycle, and what is left of its slice."""
    from_us: float
    """Start of the window [us]."""
    to_us: float
    """End of the window [us]."""

    @property
    def end_us(self) -> float:
        """End of the last event, or of the slice where something of it is left [us]."""
        return self.cycle_events[-1].end_us

    @property
    def used_us(self) -> float:
        """End of the last event that is not idle: the required time by addition [us]."""
        last = self.cycle_events[-1]
        return last.start_us if last.kind == "idle" else last.end_us

    @property
    def is_whole(self) -> bool:
        """Whether the window shows all of it."""
        return self.from_us == 0 and self.to_us == self.end_us

    @property
    def events(self) -> tuple[Event, ...]:
        """The events inside the window, cut off at its edges."""
        return tuple(
            event._replace(start_us=max(event.start_us, self.from_us), end_us=min(event.end_us, self.to_us))
            for event in self.cycle_events
            if event.start_us < self.to_us and event.end_us > self.from_us
        )


class Total(NamedTuple):
    """All events of one kind in a window."""

    kind: EventKind
    events: int
    total_us: float
    share: float
    """Of the window, 0..1."""


def schedule(profile: Profile, *, model: TimingModelName | None = None) -> Schedule:
    """Lay out one communication cycle, node by node.

    The synchronous packet, then a read of every node, then a write of every node, then the window for non-periodic
    data, then what is left of the slice. Every node is charged the hops of the farthest one, as in `capacity`. What
    takes no time is no event.

    Parameters
    ----------
    profile
        The network.
    model
        Timing model; without it the one that decides.

    Raises
    ------
    BusplanError
        More nodes than can be laid out one by one.

    References
    ----------
    Paper, section III-C and equation (2), Figs. 4, 5 and 7.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> plan = schedule(load("paper-two-node").profile)
    >>> [event.kind for event in plan.events][:4]
    ['sync', 'arbitration', 'request_data', 'acknowledge']
    >>> abs(plan.used_us - plan.figures.required_us) < 1e-9
    True
    """
    nodes = profile.bus.nodes
    if nodes > MOST_NODES:
        raise BusplanError(
            f"bus.nodes = {nodes}: a timeline shows up to {MOST_NODES} nodes; one bus carries {MAX_NODES:g}"
        )
    model = profile.bus.timing_model if model is None else model
    closed = figures(profile, model=model)
    events = list(_laid_out(_parts(cycle(profile, model=model, nodes=nodes))))
    end_us = events[-1].end_us
    # A slice that is filled but for the rounding of floats has nothing left.
    if not fits_in(closed.available_us, available_us=end_us):
        events.append(Event("idle", None, None, None, end_us, closed.available_us))
    return Schedule(profile, closed, tuple(events), from_us=0.0, to_us=events[-1].end_us)


def zoom(
    plan: Schedule,
    *,
    from_us: float | None = None,
    to_us: float | None = None,
    transaction: tuple[TransactionKind, int] | None = None,
) -> Schedule:
    """Narrow the window of a schedule; several limits all hold.

    Parameters
    ----------
    plan
        The schedule.
    from_us, to_us
        Start and end of the window, counted from the start of the cycle [us]; without them the schedule's own.
    transaction
        One transaction with its gaps, as ("read", 1).

    Raises
    ------
    BusplanError
        Nothing is left inside.
    """
    start_us = max(plan.from_us, plan.from_us if from_us is None else from_us)
    end_us = min(plan.to_us, plan.to_us if to_us is None else to_us)
    span = f"the cycle runs from 0 to {plan.end_us:.12g} us"
    if transaction is not None:
        own = [event for event in plan.cycle_events if (event.transaction, event.node) == transaction]
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
    return plan._replace(from_us=start_us, to_us=end_us)


def totals(plan: Schedule) -> tuple[Total, ...]:
    """Add up the events of a window by kind, in the order in which they first come."""
    sums: dict[EventKind, list[float]] = {}
    for event in plan.events:
        sums.setdefault(event.kind, []).append(event.duration_us)
    window_us = plan.to_us - plan.from_us
    return tuple(Total(kind, len(parts), fsum(parts), fsum(parts) / window_us) for kind, parts in sums.items())


_Part = tuple[EventKind, int | None, TransactionKind | None, Packet | None, float]
"""An event before it has its place: all of it, and how long it takes [us]."""


def _parts(now: Cycle) -> Iterator[_Part]:
    """A cycle in the order of its protocol."""
    yield "sync", None, None, None, now.sync_us
    halves: tuple[tuple[TransactionKind, Phases], ...] = (("read", now.read), ("write", now.write))
    for kind, phases in halves:
        for node in range(1, now.nodes + 1):
            yield from _transaction(kind, node, phases)
    yield "nonperiodic", None, None, None, now.nonperiodic_us


def _transaction(kind: TransactionKind, node: int, phases: Phases) -> Iterator[_Part]:
    """One asynchronous transaction and the gaps behind it, equations (3)-(10)."""
    yield "arbitration", node, kind, "request", phases.arbitration_us
    yield "request_data", node, kind, "request", phases.request_data_us
    yield "acknowledge", node, kind, "request", phases.acknowledge_us
    yield "execution", node, kind, None, phases.execution_us
    yield "arbitration", node, kind, "response", phases.arbitration_us
    yield "response_data", node, kind, "response", phases.response_data_us
    yield "acknowledge", node, kind, "response", phases.acknowledge_us
    yield "subaction_gap", node, kind, None, phases.subaction_gap_us
    yield "arbitration_reset_gap", node, kind, None, phases.arbitration_reset_gap_us


def _laid_out(parts: Iterable[_Part]) -> Iterator[Event]:
    """Put parts one behind the other.

    The sum carries what each addition loses (Neumaier), so that an error cannot grow with the number of events.
    """
    total_us = lost_us = start_us = 0.0
    for kind, node, transaction, packet, duration_us in parts:
        larger_us, smaller_us = max(total_us, duration_us), min(total_us, duration_us)
        total_us = larger_us + smaller_us
        lost_us += (larger_us - total_us) + smaller_us
        end_us = total_us + lost_us
        if end_us > start_us:
            yield Event(kind, node, transaction, packet, start_us, end_us)
            start_us = end_us
