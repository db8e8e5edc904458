"""What every drawing of a timeline shares: its words, its lanes and its scale."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from busplan.analysis.network import bus_of, network_of
from busplan.analysis.timeline.schedule import TOTAL, Event, Schedule
from busplan.drawings.timeline.kinds import event_title
from busplan.forms.blocks import Sentence, ShownValue, count_value, figure_value, joined, sentence
from busplan.forms.numbers import figure_text, nouns

MOST_EVENT_LANES: Final = 20
"""Up to this many events are drawn in a row each; more of them in a row for each node. One node's whole cycle is 20."""


class Lane(NamedTuple):
    """One row of a drawing."""

    label: str
    events: tuple[Event, ...]


class Stretch(NamedTuple):
    """Neighbouring events that belong together at a coarse look: one transaction of a cycle, or one bus event."""

    kind: str
    """Of the transaction, or of the event."""
    event: Event
    """From its start to its end."""


def time_text(time_us: float) -> str:
    """Write a time as tables do, without its unit."""
    return figure_text(figure_value(TOTAL, time_us))


def subject(plan: Schedule) -> Sentence:
    """Say what is shown: how many nodes, and which part of the cycle."""
    nodes = plan.figures.nodes
    setup = ", ".join((nouns(nodes, "node"), *bus_of(plan.profile).setup_words(network_of(plan.profile))))
    return sentence(
        f"{{}} {setup}; {{}} to {{}} of the cycle",
        count_value(nodes, "nodes"),
        ShownValue(plan.from_us, "from_us", "", TOTAL.decimals),
        ShownValue(plan.to_us, "to_us", "us", TOTAL.decimals),
    )


def charged(plan: Schedule) -> Sentence:
    """Say what is shown, and which way on the wire each node is charged."""
    return joined(subject(plan), Sentence((bus_of(plan.profile).way_charged,)), by=", ")


def overruns(plan: Schedule) -> bool:
    """Whether the cycle takes more than its slice."""
    return "time" in plan.figures.exceeded


def beyond(plan: Schedule) -> Event:
    """What of a cycle that overruns lies beyond its slice."""
    return plan.cycle_events[-1]._replace(start_us=plan.figures.available_us, end_us=plan.end_us)


def strip_title(plan: Schedule) -> str:
    """Say what the strip above the lanes shows."""
    slice_us = time_text(plan.figures.available_us)
    if overruns(plan):
        return f"The cycle of {time_text(plan.end_us)} us, beyond its slice of {slice_us} us"
    return f"The slice of {slice_us} us"


def drawn_window(plan: Schedule) -> Schedule:
    """The part that the lanes show: without a window, what the cycle uses; the strip above shows what it leaves."""
    return plan._replace(to_us=plan.used_us) if plan.is_whole else plan


def has_event_lanes(plan: Schedule) -> bool:
    """Whether there are so few events that each has its own lane."""
    return len(plan.events) <= MOST_EVENT_LANES


def node_lanes(plan: Schedule) -> tuple[Lane, ...]:
    """A lane for the bus, and one for each node that is at work in the window."""
    lanes: dict[str, list[Event]] = {}
    for event in plan.events:
        lanes.setdefault("bus" if event.node is None else f"node {event.node}", []).append(event)
    # The bus lane first, wherever the window begins; the nodes follow in the order of their turns.
    order = sorted(lanes, key=lambda label: (label != "bus", int(label.split()[-1]) if label != "bus" else 0))
    return tuple(Lane(label, tuple(lanes[label])) for label in order)


def only_owner(plan: Schedule) -> str | None:
    """Name the transaction that all events of the window belong to, if there is one."""
    owners = {(event.transaction, event.node) for event in plan.events}
    ((kind, node), *others) = owners
    return None if others or node is None else f"{kind} of node {node}"


def event_lanes(plan: Schedule) -> tuple[Lane, ...]:
    """A lane for each event; whose it is, is said where it is not the same for all."""
    one_owner = only_owner(plan) is not None
    return tuple(Lane(event.label if one_owner else event_title(event), (event,)) for event in plan.events)


def stretches(events: Sequence[Event]) -> tuple[Stretch, ...]:
    """Put the events of each transaction together."""
    found: list[Stretch] = []
    owner: tuple[object, object] | None = None
    for event in events:
        if event.node is not None and (event.node, event.transaction) == owner:
            whole = found[-1].event._replace(end_us=event.end_us)
            found[-1] = found[-1]._replace(event=whole)
            continue
        owner = (event.node, event.transaction)
        found.append(Stretch(event.transaction or event.kind, event))
    return tuple(found)
