"""A cycle of a recording as events, beside the same cycle of the plan: frames, and what the bus waits for."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from busplan.buses.figure import WAITS, Figure, Wait
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.buses.cycle import BusEvent
    from busplan.buses.network import Network

Awaited = Literal[Wait, "others", "unknown"]
"""What a stretch of a cycle is for; others are frames that are not of the cycle."""
AWAITED: Final[tuple[Awaited, ...]] = (*WAITS, "others", "unknown")
MOST_EVENTS: Final = 50_000
"""Most events of a cycle: more than anyone can look at."""


class WaterfallEvent(NamedTuple):
    """A stretch of a cycle: a frame, or a wait for one."""

    waits_for: Awaited
    label: str
    """The frame, or the one that ends the wait, in words."""
    start_us: float
    end_us: float
    node: str = ""
    """Name of the node whose frame it is; empty for others."""
    frame: int | None = None
    """Number of that frame in the recording, from 1; None in a plan."""
    late_us: float = 0.0
    """Time that it takes longer than the plan has for it [us]."""

    @property
    def duration_us(self) -> float:
        """Duration [us]."""
        return self.end_us - self.start_us


class Waterfall(NamedTuple):
    """A cycle of a recording, and the same cycle of the plan."""

    number: int
    """Number of the cycle in the recording, from 1."""
    start_s: float
    """Start of the cycle after the first stamp of the recording [s]."""
    frame: int
    """Number of its first frame in the recording, from 1."""
    events: tuple[WaterfallEvent, ...]
    """The cycle without gaps, from the start of its first frame to the end of its last one."""
    planned: tuple[WaterfallEvent, ...]
    """The part of the planned cycle that a recording shows, without gaps."""
    doubts_us: Mapping[Awaited, float]
    """Largest error of the time for each, by the stamps and by lengths that are not known [us]."""
    remarks: tuple[str, ...]
    """Sentences on the cycle, and on what of the plan no recording shows."""


class RecordedCycles(ABC):
    """The whole cycles of a recording, at least one."""

    numbers: Sequence[int]
    """Number of each in the recording, from 1; those that are not whole are left out."""
    lengths_us: Sequence[float]
    """Time of each, from the start of its first frame to the end of its last one [us]."""
    synthetic: str
    """Words of the recording on its emulation; empty without them."""

    @abstractmethod
    def waterfall(self, place: int) -> Waterfall:
        """The events of a cycle, by its place among the whole ones."""


def planned_events(
    events: "Iterable[BusEvent]", figures: Iterable[Figure], *, others: Iterable[str] = (), names: Sequence[str] = ()
) -> Iterator[tuple[str, WaterfallEvent]]:
    """Events of a planned cycle in their order, each from 0 and with its kind.

    `figures` are those of its terms, `others` the kinds that are of other traffic, `names` those of the nodes. Too many
    events raise BusplanError.
    """
    waits = {figure.key: figure.waits_for for figure in figures}
    for number, event in enumerate(islice(events, MOST_EVENTS + 1)):
        if number == MOST_EVENTS:
            raise BusplanError(f"a timeline shows up to {MOST_EVENTS:,} events, and this cycle has more")
        if not event.us:
            continue
        node = names[event.node - 1] if event.node and event.node <= len(names) else ""
        label = f"{event.label} of {node}" if node else event.label
        awaited: Awaited = "others" if event.kind in others else waits[event.term]
        yield event.kind, WaterfallEvent(awaited, label, 0.0, float(event.us), node)


def from_zero(events: Iterable[WaterfallEvent]) -> tuple[WaterfallEvent, ...]:
    """Events one behind the other, the first at 0."""
    placed: list[WaterfallEvent] = []
    for event in events:
        start_us = placed[-1].end_us if placed else 0.0
        placed.append(event._replace(start_us=start_us, end_us=start_us + event.duration_us))
    return tuple(placed)


def node_names(network: "Network") -> list[str]:
    """Name of each node: its number, or its group and its number in it."""
    groups = network.profile.node_groups
    return [f"{group.name or 'node'} {number}" for group in groups for number in range(1, int(group.nodes) + 1)]
