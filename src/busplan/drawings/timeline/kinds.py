"""How the events of a timeline are called."""

from busplan.analysis.network import bus_of
from busplan.analysis.timeline.schedule import Event
from busplan.buses.bus import EventKind
from busplan.sections.profile import Profile


def kind_of(profile: Profile, key: str) -> EventKind:
    """How an event, or a stretch of events, is called and drawn on the profile's kind of bus."""
    return bus_of(profile).event_kind(key)


def event_title(event: Event) -> str:
    """Name one event with the transaction it belongs to."""
    owner = f"{event.transaction} of node {event.node}: " if event.node is not None else ""
    return f"{owner}{event.label}"
