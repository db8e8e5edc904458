"""A cycle of an EtherCAT capture as events: its frames, their way through the devices, and the master's time."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from busplan.buses.ethercat.cycle import LAST_BYTE, EthercatCycle
from busplan.buses.ethercat.frames import cables_us, devices_doubts, devices_us
from busplan.buses.ethercat.recorded import Seen
from busplan.buses.network import Network
from busplan.buses.waterfall import (
    Awaited,
    RecordedCycles,
    Waterfall,
    WaterfallEvent,
    from_zero,
    node_names,
    planned_events,
)
from busplan.english import plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.recordings.ethercat import read_ethercat
from busplan.recordings.statistics import expanded

if TYPE_CHECKING:
    from pathlib import Path

_IN_TRIP: Final = ("overhead", "data", "cable", "device", "master")
"""Kinds of planned events that a capture of the master's port shows, in its order."""
_FRAMES: Final = frozenset(_IN_TRIP[:2])


class _Sent(NamedTuple):
    """A frame of the cycle on the wire."""

    number: int
    """Number in the recording, from 1."""
    start_us: float
    end_us: float
    back_us: float | None
    """Its return; None for a lost one."""
    back_number: int


def recorded_cycles(network: Network, path: "Path", *, progress: Progress) -> RecordedCycles:
    """The whole cycles of a capture of the master's port; BusplanError for one without."""
    try:
        return _EthercatCycles(network, Seen(network, read_ethercat(path, progress=progress), 1.0))
    except BusplanError as error:
        told = f"{path}: "
        raise BusplanError(str(error) if str(error).startswith(told) else f"{told}{error}") from None


class _EthercatCycles(RecordedCycles):
    """Cycles of process data, each from its first frame sent to the last one that returns."""

    def __init__(self, network: Network, seen: Seen) -> None:
        if seen.cycles is None:
            raise BusplanError("it has no whole cycle: no frame of process data (LRD, LWR, LRW)")
        if seen.bad_stamps:
            raise BusplanError(f"it shows no times: {seen.bad_stamps}")
        self.network, self.seen, self.cycles = network, seen, seen.cycles
        self.synthetic = seen.frames.notes.synthetic
        periods, count = seen.cycles.periods, len(seen.cycles.first)
        self.numbers = (1 + (np.arange(count) if periods is None else periods.places)).tolist()
        self.times_us = (seen.frames.times_ns - (seen.frames.notes.start_ns or 0)) / 1000
        self.back = np.full(len(self.times_us), -1)
        self.back[seen.trips.sent] = seen.trips.returned
        ends_us = np.full(count, -np.inf)
        sent, number = seen.cycles.frames, seen.cycles.number
        np.maximum.at(ends_us, number, self.times_us[sent] + seen.wire_us[sent])
        is_back = self.back[sent] >= 0
        np.maximum.at(ends_us, number[is_back], self.times_us[self.back[sent[is_back]]])
        self.lengths_us = (ends_us - self.times_us[seen.cycles.first]).tolist()

    def waterfall(self, place: int) -> Waterfall:
        """Events of a cycle."""
        sent = self._sent(place)
        start_us = sent[0].start_us
        planned = self._planned(place)
        host_us = sum(event.duration_us for event in planned if event.waits_for == "host")
        events = from_zero(self._events(sent, host_us))
        lost = [frame.number for frame in sent if frame.back_us is None]
        runs = 1 + sum(frame.end_us < after.start_us for frame, after in pairwise(sent))
        stamps_us = self.seen.stamp_us * runs
        way_us = expanded(*(doubt.us for doubt in devices_doubts(self.network))) or 0.0
        doubts_us: dict[Awaited, float] = {"nodes": way_us, "host": way_us + stamps_us}
        return Waterfall(
            self.numbers[place],
            start_us / 1e6,
            sent[0].number,
            events,
            planned,
            doubts_us | ({"unknown": stamps_us} if lost else {}),
            tuple(self._remarks(lost)),
        )

    def _number(self, frame: int) -> int:
        """Number of a frame in the recording."""
        return int(self.seen.frames.numbers[frame])

    def _sent(self, place: int) -> list[_Sent]:
        """Frames of a cycle; one that is handed over early waits for the frame before it."""
        sent: list[_Sent] = []
        for frame in self.cycles.frames[self.cycles.number == place].tolist():
            start_us = max(float(self.times_us[frame]), sent[-1].end_us if sent else 0.0)
            back = int(self.back[frame])
            back_us = float(self.times_us[back]) if back >= 0 else None
            end_us = start_us + float(self.seen.wire_us[frame])
            sent.append(_Sent(self._number(frame), start_us, end_us, back_us, self._number(back)))
        return sent

    def _events(self, sent: list[_Sent], host_us: float) -> Iterator[WaterfallEvent]:
        """Frames one behind the other, and what is waited for between them and at their end [us]."""
        last_us = max(frame.back_us or 0.0 for frame in sent)
        for index, frame in enumerate(sent):
            after = sent[index + 1] if index + 1 < len(sent) else None
            yield WaterfallEvent("wire", f"frame {index + 1}", frame.start_us, frame.end_us, "", frame.number)
            until_us = max(last_us, frame.end_us) if after is None else after.start_us
            yield from self._gap(frame, after, until_us, index + 1, host_us)

    def _gap(
        self, frame: _Sent, after: _Sent | None, until_us: float, index: int, host_us: float
    ) -> Iterator[WaterfallEvent]:
        """The wait behind a frame, for its return or for the next one; the host's time in the plan is given."""
        now_us, back_us = frame.end_us, frame.back_us
        label = f"return of frame {index}"
        if back_us is None and until_us > now_us:
            yield WaterfallEvent("unknown", f"{label}, which is lost", now_us, until_us, "", frame.number)
            return
        if back_us is not None and now_us < back_us <= until_us:
            ways: tuple[tuple[Awaited, str, float], ...] = (
                ("wire", "cables", float(cables_us(self.network))),
                ("nodes", "devices", float(devices_us(self.network) + self.seen.delays.more_us(self.network))),
            )
            for awaited, name, us in ways:
                end_us = min(now_us + us, back_us)
                if end_us > now_us:
                    yield WaterfallEvent(awaited, name, now_us, end_us, "", frame.back_number)
                    now_us = end_us
            if back_us > now_us:
                late_us = max(back_us - now_us - host_us, 0.0)
                yield WaterfallEvent("host", label, now_us, back_us, "", frame.back_number, late_us)
                now_us = back_us
        if until_us > now_us:
            number = frame.back_number if after is None else after.number
            label = label if after is None else f"frame {index + 1}"
            yield WaterfallEvent("host", label, now_us, until_us, "", number, until_us - now_us)

    def _planned(self, place: int) -> tuple[WaterfallEvent, ...]:
        """The planned round trip, with the master's time at its end, where a capture shows it."""
        cycle = EthercatCycle(self.network, LAST_BYTE, self.cycles.sorts[self.cycles.sort[place]].numbers[0])
        events = [*planned_events(cycle.events(), cycle.term_figures, names=node_names(self.network))]
        parts = [event for kind, event in events if kind in _FRAMES]
        for wanted in _IN_TRIP[2:]:
            parts += [event for kind, event in events if kind == wanted]
        if (bias_us := float(cycle.bias_us())) > 0:
            parts.append(WaterfallEvent("host", "copy of the data", 0.0, bias_us))
        return from_zero(parts)

    def _remarks(self, lost: list[int]) -> Iterator[str]:
        if lost:
            numbers = ", ".join(map(str, lost))
            yield f"{plural(len(lost), 'frame')} of this cycle never came back: {numbers}."
        yield (
            "From the first frame sent to the last return: devices and cables take what they have in the plan, and the "
            "rest of each return is the master's. Its jitter and mailbox polls are left out."
        )
        yield f"Stamps have steps of {self.seen.stamp_us:g} us."
