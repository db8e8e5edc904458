"""A timeline as a Mermaid gantt chart."""

import re
from collections.abc import Iterator, Mapping
from typing import Final

from busplan.analysis.timeline.schedule import Event, Schedule
from busplan.buses.figure import Ink
from busplan.drawings.timeline.kinds import kind_of
from busplan.drawings.timeline.lanes import Stretch, overruns, stretches

MOST_EVENTS: Final = 40
"""Up to this many events are a task each; more are merged by transaction, because every task takes a row."""
_NS_PER_US: Final = 1000
_FINE_US: Final = 20.0
"""In a shorter window, the axis needs fractions of a us."""
_PLAIN: Final = re.compile(r"[^A-Za-z0-9 .,()+/-]")
_TAGS: Final[Mapping[Ink, str]] = {"work": "active, ", "gap": "done, ", "long-gap": "done, ", "idle": "done, "}


def timeline_mermaid(plan: Schedule, *, title: str) -> str:
    """Write a gantt chart; one second of Mermaid's clock is one us, so that the axis counts us.

    Parameters
    ----------
    plan
        The schedule, narrowed to its window.
    title
        Title: its message in a sentence.
    """
    fine = plan.to_us - plan.from_us < _FINE_US
    head = [
        "gantt",
        f"    title {escaped(title)}",
        "    dateFormat x",
        f"    axisFormat {'%s.%L' if fine else '%s'} us",
    ]
    return "\n".join((*head, *_body(plan))) + "\n"


def escaped(text: str) -> str:
    """Escape text for Mermaid: all but plain characters become entity codes.

    Examples
    --------
    >>> escaped("a: 5%")
    'a#58; 5#37;'
    """
    return _PLAIN.sub(lambda match: f"#{ord(match[0])};", text)


def _body(plan: Schedule) -> Iterator[str]:
    events = plan.events
    single = len(events) <= MOST_EVENTS
    parts = (
        [(event.label, event) for event in events]
        if single
        else [(_stretch_label(plan, one), one.event) for one in stretches(events)]
    )
    section = ""
    for label, event in parts:
        name = _section(event, plan, by_transaction=single)
        if name != section:
            yield f"    section {name}"
            section = name
        tag = _tag(event, plan) if single or event.node is None else _over_tag(event, plan)
        yield f"    {label}, {event.duration_us:.3f} us :{tag}{_ns(event.start_us)}, {_ns(event.end_us)}"


def _section(event: Event, plan: Schedule, *, by_transaction: bool) -> str:
    if event.node is None:
        own = [one.start_us for one in plan.cycle_events if one.node is not None]
        return "start of the cycle" if own and event.start_us < own[0] else "end of the cycle"
    return f"{event.transaction} of node {event.node}" if by_transaction else f"{event.transaction}s"


def _stretch_label(plan: Schedule, one: Stretch) -> str:
    return kind_of(plan.profile, one.kind).label if one.event.node is None else f"node {one.event.node}"


def _tag(event: Event, plan: Schedule) -> str:
    return _over_tag(event, plan) or _TAGS.get(kind_of(plan.profile, event.kind).ink, "")


def _over_tag(event: Event, plan: Schedule) -> str:
    return "crit, " if overruns(plan) and event.end_us > plan.figures.available_us else ""


def _ns(time_us: float) -> int:
    return round(time_us * _NS_PER_US)
