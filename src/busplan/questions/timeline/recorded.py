"""One cycle of a recording beside the same cycle of the plan: where its time went."""

from dataclasses import dataclass
from math import fsum
from typing import Final, Literal, NamedTuple

from busplan.buses.waterfall import AWAITED, Awaited, RecordedCycles, Waterfall, WaterfallEvent
from busplan.forms.blocks import Report
from busplan.questions.base.answer import Answer
from busplan.sections.profile import Profile

WORST: Final = "worst"
MEDIAN: Final = "median"
_ROUNDING: Final = 1e-9
"""Relative rounding error of a time."""
Chosen = Literal["worst", "median"]


class Share(NamedTuple):
    """Time of a cycle for one of: wire, nodes, adapter, host, other frames, and what cannot be told."""

    waits_for: Awaited
    recorded_us: float
    planned_us: float
    recorded_share: float
    """Share of the recorded cycle, 0..1."""
    planned_share: float
    """Share of the planned cycle, 0..1."""
    uncertainty_us: float
    """Largest error of the recorded time [us]."""

    @property
    def difference_us(self) -> float:
        """Recorded time less planned time [us]."""
        return self.recorded_us - self.planned_us

    @property
    def excess_us(self) -> float:
        """Time by which it is longer than planned; 0 where that may be error [us]."""
        more_us = self.difference_us
        return more_us if more_us > self.uncertainty_us + _ROUNDING * self.recorded_us else 0.0


class Difference(NamedTuple):
    """The share that is longer than planned by most, or, where none is, the one that differs by most."""

    waits_for: Awaited
    recorded_us: float
    planned_us: float
    uncertainty_us: float
    is_longer: bool
    """Whether it is longer than planned by more than its error."""
    cause: str
    """The frame that is latest in it; empty where none is late."""
    node: str
    """Name of its node; empty for frames of none."""
    late_us: float
    """Time that it takes, or is waited for, longer than the plan has for it [us]."""
    frame: int | None
    """Its number in the recording, from 1."""
    at_s: float | None
    """Its end after the first stamp of the recording [s]."""


@dataclass(frozen=True, slots=True, repr=False)
class RecordedTimelineAnswer(Answer):
    """Answer of `timeline` for a recording: one of its cycles beside the same cycle of the plan."""

    profile: Profile
    source: str
    """Name of the recording."""
    chosen: Chosen | None
    """Rule by which the cycle was chosen; None for one that was asked for by its number."""
    cycles: int
    """Whole cycles of the recording [1]."""
    cycle: int
    """Number of the cycle in the recording, from 1."""
    start_s: float
    """Its start after the first stamp of the recording [s]."""
    frame: int
    """Number of its first frame in the recording, from 1."""
    recorded_us: float
    """Time of the cycle, from the start of its first frame to the end of its last one [us]."""
    planned_us: float
    """Time of the same part of the planned cycle [us]."""
    events: tuple[WaterfallEvent, ...]
    """Recorded events, without gaps."""
    planned_events: tuple[WaterfallEvent, ...]
    """Planned events, without gaps."""
    shares: tuple[Share, ...]
    """Times that add up to both cycles; those without any time are left out."""
    difference: Difference
    remarks: tuple[str, ...]
    """Sentences on the cycle, and on what the recording does not show."""
    synthetic: str
    """Words of the recording on its emulation; empty without them."""

    @property
    def difference_us(self) -> float:
        """Recorded time less planned time [us]."""
        return self.recorded_us - self.planned_us

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.timeline.recorded_report import recorded_report

        return recorded_report(self)


def place_of(cycles: RecordedCycles, wanted: int | Chosen) -> int | None:
    """Place of a cycle among the whole ones; None for a number that none of them has."""
    if isinstance(wanted, int):
        return list(cycles.numbers).index(wanted) if wanted in cycles.numbers else None
    by_length = sorted(range(len(cycles.lengths_us)), key=lambda place: cycles.lengths_us[place])
    # Of an even number of cycles the shorter one of the two in the middle; of equal ones the first is the worst.
    return by_length[(len(by_length) - 1) // 2] if wanted == MEDIAN else cycles.lengths_us.index(max(cycles.lengths_us))


def answer_of(
    profile: Profile, source: str, cycles: RecordedCycles, place: int, *, chosen: Chosen | None
) -> RecordedTimelineAnswer:
    """The answer for the cycle at a place."""
    shown = cycles.waterfall(place)
    shares = _shares(shown)
    return RecordedTimelineAnswer(
        profile,
        source,
        chosen,
        len(cycles.numbers),
        shown.number,
        shown.start_s,
        shown.frame,
        shown.events[-1].end_us,
        shown.planned[-1].end_us if shown.planned else 0.0,
        shown.events,
        shown.planned,
        shares,
        _difference(shown, shares),
        shown.remarks,
        cycles.synthetic,
    )


def _shares(shown: Waterfall) -> tuple[Share, ...]:
    def total_us(events: tuple[WaterfallEvent, ...], awaited: Awaited) -> float:
        return fsum(event.duration_us for event in events if _class(event) == awaited)

    shares = []
    recorded_us = shown.events[-1].end_us
    planned_us = shown.planned[-1].end_us if shown.planned else 0.0
    for awaited in AWAITED:
        seen_us, plan_us = total_us(shown.events, awaited), total_us(shown.planned, awaited)
        if seen_us or plan_us:
            of_plan = plan_us / planned_us if planned_us else 0.0
            doubt_us = shown.doubts_us.get(awaited, 0.0)
            shares.append(Share(awaited, seen_us, plan_us, seen_us / recorded_us, of_plan, doubt_us))
    return tuple(shares)


def _class(event: WaterfallEvent) -> Awaited:
    """What an event counts for: a recording does not tell the adapter's time from the host's."""
    return "host" if event.waits_for == "adapter" else event.waits_for


def _difference(shown: Waterfall, shares: tuple[Share, ...]) -> Difference:
    longest = max(shares, key=lambda share: share.excess_us)
    share = longest if longest.excess_us else max(shares, key=lambda share: abs(share.difference_us))
    found = Difference(
        share.waits_for,
        share.recorded_us,
        share.planned_us,
        share.uncertainty_us,
        is_longer=share.excess_us > 0,
        cause="",
        node="",
        late_us=0.0,
        frame=None,
        at_s=None,
    )
    late_us: dict[int | None, float] = {}
    last: dict[int | None, WaterfallEvent] = {}
    for event in shown.events:
        if _class(event) == share.waits_for:
            late_us[event.frame] = late_us.get(event.frame, 0.0) + event.late_us
            last[event.frame] = event
    frame = max(late_us, key=late_us.__getitem__, default=None)
    if not found.is_longer or frame is None or late_us[frame] <= share.uncertainty_us:
        return found
    event = last[frame]
    sent = (each for each in shown.events if each.frame == frame and each.waits_for in ("wire", "others"))
    at_s = shown.start_s + max(event.end_us, *(each.end_us for each in sent), 0.0) / 1e6
    return found._replace(cause=event.label, node=event.node, late_us=late_us[frame], frame=frame, at_s=at_s)
