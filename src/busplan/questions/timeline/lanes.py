"""Common parts of all drawings of a timeline: text and lanes."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from busplan.forms.blocks import Sentence, ShownValue, count_value, figure_value, joined, sentence
from busplan.forms.numbers import figure_text, nouns
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.timeline.events import TOTAL, Event, Schedule
from busplan.questions.timeline.kinds import event_title

MOST_EVENT_LANES: Final = 20
"""Up to this many events have a row each; more are drawn in a row for each node. A cycle of one node has 20."""


class Lane(NamedTuple):
    """One row of a drawing."""

    label: str
    events: tuple[Event, ...]


class Stretch(NamedTuple):
    """Neighbouring events merged into one: a transaction, or a single event of the bus."""

    kind: str
    """Kind of the transaction or of the event."""
    event: Event
    """Event from the start to the end of the stretch."""


def time_text(time_us: float) -> str:
    """Write a time as in tables, without its unit."""
    return figure_text(figure_value(TOTAL, time_us))


def subject(plan: Schedule) -> Sentence:
    """Say what is shown: the number of nodes, and the part of the cycle."""
    nodes = plan.figures.nodes
    setup = ", ".join((nouns(nodes, "node"), *bus_of(plan.profile).setup_words(network_of(plan.profile))))
    return sentence(
        f"{{}} {setup}; {{}} to {{}} of the cycle",
        count_value(nodes, "nodes"),
        ShownValue(plan.from_us, "from_us", "", TOTAL.decimals),
        ShownValue(plan.to_us, "to_us", "us", TOTAL.decimals),
    )


def charged(plan: Schedule) -> Sentence:
    """Say what is shown, and which distance on the wire each node is charged with."""
    return joined(subject(plan), Sentence((bus_of(plan.profile).way_charged(network_of(plan.profile)),)), by=", ")


def overruns(plan: Schedule) -> bool:
    """Whether the cycle takes more than its slice."""
    return "time" in plan.figures.exceeded


def shows_overrun(window: Schedule) -> bool:
    """Whether the window shows time beyond the slice."""
    return overruns(window) and window.to_us > window.figures.available_us


def beyond(plan: Schedule) -> Event:
    """The part of an overrunning cycle beyond its slice."""
    return plan.cycle_events[-1]._replace(start_us=plan.figures.available_us, end_us=plan.end_us)


def drawn_window(plan: Schedule) -> Schedule:
    """The part that the lanes show: the window or, without one, the cycle without its idle rest."""
    return plan._replace(to_us=plan.used_us) if plan.is_whole else plan


def has_event_lanes(plan: Schedule) -> bool:
    """Whether the events are few enough for a lane each."""
    return len(plan.events) <= MOST_EVENT_LANES


def node_lanes(plan: Schedule) -> tuple[Lane, ...]:
    """A lane for the bus, and one for each node with events in the window."""
    lanes: dict[str, list[Event]] = {}
    for event in plan.events:
        lanes.setdefault("bus" if event.node is None else f"node {event.node}", []).append(event)
    # The bus first, then the nodes by number.
    order = sorted(lanes, key=lambda label: (label != "bus", int(label.split()[-1]) if label != "bus" else 0))
    return tuple(Lane(label, tuple(lanes[label])) for label in order)


def only_owner(plan: Schedule) -> str | None:
    """Name of the transaction of all events in the window; None if they have several."""
    owners = {(event.transaction, event.node) for event in plan.events}
    ((kind, node), *others) = owners
    return None if others or node is None else f"{kind} of node {node}"


def event_lanes(plan: Schedule) -> tuple[Lane, ...]:
    """A lane for each event; labels name the transaction if there are several."""
    one_owner = only_owner(plan) is not None
    return tuple(Lane(event.label if one_owner else event_title(event), (event,)) for event in plan.events)


def stretches(events: Sequence[Event]) -> tuple[Stretch, ...]:
    """Merge the events of each transaction."""
    found: list[Stretch] = []
    owner: tuple[object, object] | None = None
    for event in events:
        if event.transaction is not None and (event.node, event.transaction) == owner:
            whole = found[-1].event._replace(end_us=event.end_us)
            found[-1] = found[-1]._replace(event=whole)
            continue
        owner = (event.node, event.transaction)
        found.append(Stretch(event.transaction or event.kind, event))
    return tuple(found)
