"""Names of the events of a timeline."""

from busplan.buses.parts import EventKind
from busplan.questions.fit.network import bus_of
from busplan.questions.timeline.events import Event
from busplan.sections.profile import Profile


def kind_of(profile: Profile, key: str) -> EventKind:
    """Name and style of an event, or of a stretch of events, on the profile's kind of bus."""
    return bus_of(profile).event_kind(key)


def event_title(event: Event) -> str:
    """Name of an event with its transaction."""
    owner = f"{event.transaction} of node {event.node}: " if event.node is not None else ""
    return f"{owner}{event.label}"
