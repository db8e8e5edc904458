"""Common parts of all drawings of a timeline: text and lanes."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from busplan.buses.parts import EventKind
from busplan.forms.blocks import Sentence, ShownValue, count_value, figure_value, joined, sentence
from busplan.forms.numbers import figure_text, nouns
from busplan.questions.fit.certainty import fits_in
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.timeline.cycles import CommonMultiple
from busplan.questions.timeline.events import TOTAL, Event, Schedule
from busplan.sections.profile import Profile

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


def kind_of(profile: Profile, key: str) -> EventKind:
    """Name and style of an event, or of a stretch of events, on the profile's kind of bus."""
    return bus_of(profile).event_kind(key)


def event_title(event: Event) -> str:
    """Name of an event with its transaction."""
    owner = f"{event.transaction} of node {event.node}: " if event.node is not None else ""
    return f"{owner}{event.label}"


def time_text(time_us: float) -> str:
    """Write a time as in tables, without its unit."""
    return figure_text(figure_value(TOTAL, time_us))


def subject(schedule: Schedule) -> Sentence:
    """Say what is shown: the number of nodes, and the part of the cycle."""
    nodes, common, cycle = schedule.figures.nodes, CommonMultiple(schedule), "the cycle"
    if schedule.number is not None and common.cycles > 1:
        cycle = f"cycle {common.number} of {common.cycles}"
    setup = ", ".join((nouns(nodes, "node"), *bus_of(schedule.profile).setup_words(network_of(schedule.profile))))
    return sentence(
        f"{{}} {setup}; {{}} to {{}} of {cycle}",
        count_value(nodes, "nodes"),
        ShownValue(schedule.from_us, "from_us", "", TOTAL.decimals),
        ShownValue(schedule.to_us, "to_us", "us", TOTAL.decimals),
    )


def charged(schedule: Schedule) -> Sentence:
    """Say what is shown, and which distance on the wire each node is charged with."""
    return joined(
        subject(schedule), Sentence((bus_of(schedule.profile).way_charged(network_of(schedule.profile)),)), by=", "
    )


def overruns(schedule: Schedule) -> bool:
    """Whether the cycle takes more than its slice."""
    return not fits_in(schedule.required_us, available_us=schedule.figures.available_us)


def shows_overrun(window: Schedule) -> bool:
    """Whether the window shows time beyond the slice."""
    return overruns(window) and window.to_us > window.figures.available_us


def beyond(schedule: Schedule) -> Event:
    """The part of an overrunning cycle beyond its slice."""
    return schedule.cycle_events[-1]._replace(start_us=schedule.figures.available_us, end_us=schedule.end_us)


def drawn_window(schedule: Schedule) -> Schedule:
    """The part that the lanes show: the window or, without one, the cycle without its idle rest."""
    return schedule._replace(to_us=schedule.used_us) if schedule.is_whole else schedule


def has_event_lanes(schedule: Schedule) -> bool:
    """Whether the events are few enough for a lane each."""
    return len(schedule.events) <= MOST_EVENT_LANES


def node_lanes(schedule: Schedule) -> tuple[Lane, ...]:
    """A lane for the bus, and one for each node with events in the window."""
    lanes: dict[str, list[Event]] = {}
    for event in schedule.events:
        lanes.setdefault("bus" if event.node is None else f"node {event.node}", []).append(event)
    # The bus first, then the nodes by number.
    order = sorted(lanes, key=lambda label: (label != "bus", int(label.split()[-1]) if label != "bus" else 0))
    return tuple(Lane(label, tuple(lanes[label])) for label in order)


def only_owner(schedule: Schedule) -> str | None:
    """Name of the transaction of all events in the window; None if they have several."""
    owners = {(event.transaction, event.node) for event in schedule.events}
    ((kind, node), *more) = owners
    return None if more or node is None else f"{kind} of node {node}"


def event_lanes(schedule: Schedule) -> tuple[Lane, ...]:
    """A lane for each event; labels name the transaction if there are several."""
    one_owner = only_owner(schedule) is not None
    return tuple(Lane(event.label if one_owner else event_title(event), (event,)) for event in schedule.events)


def stretches(events: Sequence[Event]) -> tuple[Stretch, ...]:
    """Merge the events of each transaction."""
    merged: list[Stretch] = []
    owner: tuple[object, object] | None = None
    for event in events:
        if event.transaction is not None and (event.node, event.transaction) == owner:
            whole = merged[-1].event._replace(end_us=event.end_us)
            merged[-1] = merged[-1]._replace(event=whole)
            continue
        owner = (event.node, event.transaction)
        merged.append(Stretch(event.transaction or event.kind, event))
    return tuple(merged)
