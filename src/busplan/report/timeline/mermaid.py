"""A timeline as a Mermaid gantt chart."""

import re
from collections.abc import Iterator
from typing import Final

from busplan.analysis.schedule import Event, Schedule
from busplan.report.timeline.kinds import event_label
from busplan.report.timeline.lanes import Stretch, headline, stretches

MOST_EVENTS: Final = 40
"""Mermaid gives each task a row: up to this many events are shown each, more of them transaction by transaction."""
_NS_PER_US: Final = 1000
_FINE_US: Final = 20.0
"""Window below which whole us are too coarse for the axis."""
_PLAIN: Final = re.compile(r"[^A-Za-z0-9 .,()+/-]")
_TAGS: Final = {
    "execution": "active, ",
    "subaction_gap": "done, ",
    "arbitration_reset_gap": "done, ",
    "idle": "done, ",
}


def timeline_mermaid(plan: Schedule) -> str:
    """Write a gantt chart; one second of Mermaid's clock stands for one us, so that its axis counts us.

    Parameters
    ----------
    plan
        The schedule, narrowed to its window.
    """
    fine = plan.to_us - plan.from_us < _FINE_US
    head = [
        "gantt",
        f"    title {escaped(headline(plan))}",
        "    dateFormat x",
        f"    axisFormat {'%s.%L' if fine else '%s'} us",
    ]
    return "\n".join((*head, *_body(plan))) + "\n"


def escaped(text: str) -> str:
    """Write text so that nothing of it is Mermaid's syntax: all but plain characters as entity codes.

    Examples
    --------
    >>> escaped("a: 5%")
    'a#58; 5#37;'
    """
    return _PLAIN.sub(lambda match: f"#{ord(match[0])};", text)


def _body(plan: Schedule) -> Iterator[str]:
    events = plan.events
    parts = (
        [Stretch(event_label(event), event.kind, event) for event in events]
        if len(events) <= MOST_EVENTS
        else stretches(events)
    )
    section = ""
    for part in parts:
        name = _section(part.event, by_transaction=len(events) <= MOST_EVENTS)
        if name != section:
            yield f"    section {name}"
            section = name
        yield f"    {_name(part)} :{_tag(part, plan)}{_ns(part.event.start_us)}, {_ns(part.event.end_us)}"


def _section(event: Event, *, by_transaction: bool) -> str:
    if event.node is None:
        return "bus"
    return f"{event.transaction} of node {event.node}" if by_transaction else f"{event.transaction}s"


def _name(part: Stretch) -> str:
    """Nothing here is the user's."""
    by_node = part.label in ("read", "write")
    label = f"node {part.event.node}" if by_node else part.label.replace("_", " ")
    return f"{label}, {part.event.duration_us:.3f} us"


def _tag(part: Stretch, plan: Schedule) -> str:
    if "time" in plan.figures.exceeded and part.event.end_us > plan.figures.available_us:
        return "crit, "
    return "" if part.label in ("read", "write") else _TAGS.get(part.kind, "")


def _ns(time_us: float) -> int:
    return round(time_us * _NS_PER_US)
