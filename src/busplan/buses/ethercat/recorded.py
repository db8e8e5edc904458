"""A capture of the master's port beside the plan: period, jitter, round trips, bytes, and what got lost."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.ethercat.cycle import LAST_BYTE, EthercatCycle
from busplan.buses.ethercat.equations import (
    BYTE_BIAS_UNCERTAINTY_US,
    BYTE_BIAS_US,
    BYTE_US,
    DATAGRAM_BYTES,
    GAP_BYTES,
    device_us,
    frame_bytes,
    sending_us,
)
from busplan.buses.ethercat.ports import line_delays
from busplan.buses.ethercat.traffic import cables_us, devices_doubts, devices_us, housekeeping_bytes
from busplan.buses.network import Network
from busplan.buses.recorded import CLOCK_TOLERANCE, Recorded, RecordedFigure, day_of
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.recordings.ethercat import COMMANDS, Datagram, EthercatFrames, read_ethercat
from busplan.recordings.statistics import Floats, Quantile, expanded, grid, lateness, line, middle, quantile, step
from busplan.recordings.words import counted

_MASTER: Final = "bus.master_us"
_JITTER: Final = "bus.master_jitter_us"
_STEP_BACK_NS: Final = 50_000
"""Stamps of neighbours are so far out of order only where a clock was set; less is the order of two queues [ns]."""
_GAP_US: Final = plain(sending_us(GAP_BYTES))
_TWO_STAMPS: Final = 6**-0.5
"""Standard uncertainty of the distance of two stamps, in their step (JCGM 100, 4.3.7)."""
_LEAST_SPAN_BYTES: Final = 200
"""Least distance of the sizes of frames that says what a byte takes: the host takes them differently, too [bytes]."""
_NOT_SHOWN: Final = (
    "Not shown by a capture of the master's port: its time from the task to the stamp of a frame, SYNC0, and the "
    "devices' own time."
)


class _Trips(NamedTuple):
    """Frames that were sent, each with the one that returned."""

    sent: npt.NDArray[np.int64]
    returned: npt.NDArray[np.int64]
    """Places of both in the recording."""
    lost: npt.NDArray[np.int64]
    """Places of frames that did not return."""
    unsent: int
    """Returned frames that were not seen to be sent."""


class _Cycles(NamedTuple):
    """Cycles with as many frames as most have, all returned."""

    frames: int
    """Of each [1]."""
    starts: npt.NDArray[np.int64]
    """Places of their first frames."""
    trips_us: Floats
    """From the first frame sent to the last one returned [us]."""
    wire_us: Floats
    """All frames on the wire [us]."""


def recorded(network: Network, path: Path, *, share: float, progress: Progress) -> Recorded:
    """Compare a capture with the plan.

    Parameters
    ----------
    network
        The plan, of plain numbers.
    path
        A pcap or pcapng file, recorded at the master's port.
    share
        Share of the cycles that jitter and the master's time are to hold for, 0.5..1.
    progress
        Called with the bytes read and those of the file.

    Raises
    ------
    BusplanError
        No capture, or nothing of EtherCAT that can be compared in it.
    """
    frames = read_ethercat(path, progress=progress)
    if not frames.returned.any():
        raise BusplanError(
            f"{path}: none of its {len(frames.times_ns):,} EtherCAT frames returned; record both ways of the port"
        )
    seen = _Seen(network, frames, share)
    return Recorded(tuple(seen.figures()), tuple(seen.remarks()), seen.edits(), day_of(int(frames.times_ns[0])))


class _Seen:
    """A recording, with what is derived of it once."""

    def __init__(self, network: Network, frames: EthercatFrames, share: float) -> None:
        self.network, self.frames, self.share = network, frames, share
        self.cycle = EthercatCycle(network, LAST_BYTE)
        steps_back = np.diff(frames.times_ns) < -_STEP_BACK_NS
        self.steps_back = int(np.count_nonzero(steps_back))
        self.stretch = np.concatenate(([0], np.cumsum(steps_back)))
        """Number of the stretch between two steps of the clock that each frame lies in."""
        self.stamp_us = step(frames.times_ns)
        self.wire_us = np.array([_wire_us(layout) for layout in frames.layouts])[frames.layout]
        self.trips = _trips(frames)
        self.delays = line_delays(frames.latches, frames.unlatched)
        self.has_period = False
        self.jitter: Quantile | None = None
        self.master: Quantile | None = None
        self.own_bytes: tuple[int, ...] | None = None
        """Data of the master's own datagrams, where they are not as planned [bytes]."""
        self._cycles()

    def _cycles(self) -> None:
        """Find the frames of process data, and which of them begins a cycle."""
        frames = self.frames
        has_data = np.array([any(part.is_process_data for part in layout) for layout in frames.layouts])
        self.is_data = has_data[frames.layout]
        places = np.flatnonzero(self.is_data & ~frames.returned)
        self.starts = places[:0]
        if not len(places):
            return
        layouts, counts = np.unique(frames.layout[places], return_counts=True)
        # All frames of a cycle come as often, but for those at the ends of the recording.
        often = counts >= counts.max() - 1
        leading = layouts[np.argmax(counts)]
        if np.count_nonzero(often) > 1:
            leading = self._after_pauses(places, set(layouts[often].tolist()))
        starts = places[frames.layout[places] == leading]
        # Of several stretches of the clock the longest is taken.
        stretches, sizes = np.unique(self.stretch[starts], return_counts=True)
        self.starts = starts[self.stretch[starts] == stretches[np.argmax(sizes)]]

    def _after_pauses(self, places: npt.NDArray[np.int64], often: set[int]) -> int:
        """The layout that most often comes behind a pause: the first frame of a cycle."""
        apart = np.diff(self.frames.times_ns[places])
        behind = self.frames.layout[places[1:]][apart > (apart.min() + apart.max()) / 2]
        known = Counter(value for value in behind.tolist() if value in often)
        return known.most_common(1)[0][0] if known else min(often)

    @property
    def times_us(self) -> Floats:
        """When each cycle begins, from the first [us]."""
        times = self.frames.times_ns[self.starts]
        return np.asarray((times - times[0]) / 1000, dtype=np.float64)

    def _whole_cycles(self) -> _Cycles:
        """Cycles whose frames have all returned."""
        frames, starts = self.frames, self.starts
        sent = np.flatnonzero(self.is_data & ~frames.returned & (self.stretch == self.stretch[starts[0]]))
        number = np.searchsorted(starts, sent, side="right") - 1
        sent, number = sent[number >= 0], number[number >= 0]
        back = np.full(len(frames.times_ns), -1)
        back[self.trips.sent] = self.trips.returned
        back = back[sent]
        count = np.bincount(number, minlength=len(starts))
        usual = int(np.bincount(count).argmax())
        returned = np.bincount(number, weights=back >= 0, minlength=len(starts))
        end_ns = np.full(len(starts), np.iinfo(np.int64).min)
        np.maximum.at(end_ns, number[back >= 0], frames.times_ns[back[back >= 0]])
        wire_us = np.bincount(number, weights=self.wire_us[sent], minlength=len(starts))
        whole = (returned == count) & (count == usual)
        trips_us = (end_ns[whole] - frames.times_ns[starts[whole]]) / 1000
        return _Cycles(usual, starts[whole], trips_us, wire_us[whole])

    def figures(self) -> Iterator[RecordedFigure]:
        """All figures."""
        if len(self.starts):
            yield from self._period()
            cycles = self._whole_cycles()
            yield from self._host(cycles)
            yield from self._layout(cycles)
        yield from self._lost()
        yield from self._byte()
        yield from self.delays.figures(self.network)

    def _period(self) -> Iterator[RecordedFigure]:
        found = grid(self.times_us)
        self.has_period = found is not None
        if found is None:
            return
        count, planned_us = len(self.starts), plain(self.network.period_us)
        apart_us = np.diff(self.times_us)
        doubt = expanded(found.uncertainty_us, CLOCK_TOLERANCE * planned_us / 3**0.5, self.stamp_us / len(apart_us))
        note = f"{counted(found.missing, 'period')} without a frame" if found.missing else ""
        yield RecordedFigure(
            "period", "us", planned_us, found.period_us, doubt, "equal", count, "cycle.period_us", note
        )
        deviation_us = float(np.std(np.diff(found.late_us)))
        yield RecordedFigure("standard deviation of the period", "us", None, deviation_us, None, "shown", count - 1)
        self.jitter = lateness(found, self.share)
        doubt = expanded(self.jitter.uncertainty or found.doubt_us, self.stamp_us * _TWO_STAMPS)
        planned_us = plain(self.network.profile.bus.master_jitter_us)
        yield RecordedFigure(
            "latest start",
            "us",
            planned_us,
            self.jitter.value,
            doubt,
            "at most",
            count,
            _JITTER,
        )

    def _host(self, cycles: _Cycles) -> Iterator[RecordedFigure]:
        count = len(cycles.starts)
        if not count:
            return
        bus, terms = self.network.profile.bus, self.cycle.by_term
        way_us = plain(devices_us(self.network)) + plain(cables_us(self.network))
        bias_us = plain(self.cycle.bias_us())
        known = ("cycle_master_us", "cycle_frames_us", "cycle_data_us", "cycle_devices_us", "cycle_cable_us")
        planned_us = sum(plain(terms[key]) for key in known) + bias_us
        bytes_us = plain(self.cycle.process_bytes) * BYTE_BIAS_UNCERTAINTY_US
        way_doubts = [plain(device_us(doubt.one_way_us)) for doubt in devices_doubts(self.network)]
        plan_doubts = [*way_doubts, bytes_us, plain(bus.master_doubt_us)]
        stamps_us = self.stamp_us * _TWO_STAMPS
        trip, typical = quantile(cycles.trips_us, self.share), middle(cycles.trips_us)
        yield RecordedFigure("round trip, median", "us", None, typical.value, None, "shown", count)
        doubt = expanded(*plan_doubts, trip.uncertainty or 0.0, stamps_us)
        yield RecordedFigure("round trip", "us", planned_us, trip.value, doubt, "at most", count)
        host_us = cycles.trips_us - cycles.wire_us - way_us - self.delays.more_us(self.network) - bias_us
        self.master = quantile(host_us, self.share)
        yield RecordedFigure(
            "master's time",
            "us",
            plain(bus.master_us),
            self.master.value,
            expanded(*plan_doubts, self.master.uncertainty or 0.0, stamps_us),
            "at most",
            count,
            _MASTER,
            f"median {middle(host_us).value:.1f}: round trip less wire, devices and cables",
        )

    def _layout(self, cycles: _Cycles) -> Iterator[RecordedFigure]:
        """Frames of a cycle, and their datagrams."""
        count, planned = len(cycles.starts), self.cycle.packing
        yield RecordedFigure("frames in a cycle", "1", plain(planned.frames), cycles.frames, None, "equal", count)
        if not count:
            return
        frames = self.frames
        places = np.flatnonzero(self.is_data & ~frames.returned)
        # A cycle in the middle: the first ones may be of a bus that starts.
        at = int(np.searchsorted(places, cycles.starts[count // 2]))
        layouts = [frames.layouts[layout] for layout in frames.layout[places[at : at + cycles.frames]]]
        parts = [part for layout in layouts for part in layout]
        note = " | ".join(" ".join(map(_words, layout)) for layout in layouts)
        yield RecordedFigure(
            "datagrams of a cycle",
            "bytes",
            plain(planned.datagrams_bytes),
            _datagrams_bytes(parts),
            None,
            "at most",
            count,
            note=note,
        )
        own = [part for part in parts if not part.is_process_data]
        if _datagrams_bytes(own) != plain(housekeeping_bytes(self.network)):
            self.own_bytes = tuple(part.data_bytes for part in own)

    def _lost(self) -> Iterator[RecordedFigure]:
        frames, trips = self.frames, self.trips
        sent = int(np.count_nonzero(~frames.returned))
        yield RecordedFigure("lost frames", "1", 0, len(trips.lost), None, "at most", sent)
        wrong = total = 0
        back = trips.returned[self.is_data[trips.returned]]
        for layout in np.unique(frames.layout[back]):
            counts = np.bincount(frames.counters[back[frames.layout[back] == layout]])
            total += int(counts.sum())
            wrong += int(counts.sum() - counts.max())
        if total:
            note = "the most frequent ones are taken for right"
            yield RecordedFigure("wrong working counters", "1", 0, wrong, None, "at most", total, note=note)

    def _byte(self) -> Iterator[RecordedFigure]:
        trips = self.trips
        sizes = self.wire_us[trips.sent] / BYTE_US
        times_us = (self.frames.times_ns[trips.returned] - self.frames.times_ns[trips.sent]) / 1000
        if not len(sizes) or sizes.max() - sizes.min() < _LEAST_SPAN_BYTES:
            return
        fitted = line(sizes, times_us)
        if fitted is None:
            return
        slope, error = fitted
        doubt = expanded(error, BYTE_BIAS_UNCERTAINTY_US)
        planned = BYTE_US + BYTE_BIAS_US
        note = f"round trips of {int(sizes.min())} to {int(sizes.max())} bytes on the wire"
        yield RecordedFigure("time of a byte", "us", planned, slope, doubt, "at most", len(sizes), note=note)

    def remarks(self) -> Iterator[str]:
        """What the recording has beside the figures."""
        frames, notes = self.frames, self.frames.notes
        if notes.broken_at is not None:
            yield f"The file is cut or damaged from byte {notes.broken_at:,} on: read up to there."
        if not len(self.starts):
            yield "It has no frame of process data (LRD, LWR, LRW), so no period, no jitter and no time of the master."
        elif not self.has_period:
            yield f"It has {counted(len(self.starts), 'cycle')}, too few for a period."
        if self.steps_back:
            yield (
                f"Its clock was set back {counted(self.steps_back, 'time')}: cycles are those of the longest stretch "
                "between, round trips over a step are left out."
            )
        if self.trips.unsent:
            yield f"{counted(self.trips.unsent, 'frame')} returned without having been seen to be sent."
        if frames.cut:
            yield f"Left out: {counted(frames.cut, 'EtherCAT frame')} that the recorder cut; record whole packets."
        left_out = frames.others + notes.other_links + notes.without_time
        if left_out:
            yield f"Left out: {counted(left_out, 'packet')} of other protocols or interfaces, or without a time."
        times_us = (frames.times_ns[self.trips.returned] - frames.times_ns[self.trips.sent]) / 1000
        short = int(np.count_nonzero(times_us < self.wire_us[self.trips.sent] - _GAP_US - 2 * self.stamp_us))
        if short:
            yield (
                f"{counted(short, 'frame')} returned sooner than it takes to send them: the stamps were not taken at "
                "the master's port."
            )
        if self.master is not None and self.master.value < 0:
            yield "The machine is faster than wire and devices of the profile, which has more of them than it."
        yield from self.delays.remarks
        yield f"Stamps have steps of {self.stamp_us:g} us."
        yield _NOT_SHOWN

    def edits(self) -> dict[str, object]:
        """New value of each key that was measured; None removes one."""
        edits: dict[str, Any] = {**self.delays.edits(self.network)}
        if self.master is not None and self.master.value > 0:
            edits[_MASTER] = round(self.master.value, 3)
            edits["bus.master_grade"] = "measured"
            # What the delays of devices leave open is an uncertainty of the cycle already.
            doubt = expanded(self.master.uncertainty, self.stamp_us * _TWO_STAMPS)
            edits["bus.master_uncertainty_us"] = None if doubt is None else round(doubt / 2, 4)
        if self.jitter is not None:
            edits[_JITTER] = round(self.jitter.value, 3)
        if self.own_bytes is not None:
            edits["bus.housekeeping_bytes"] = list(self.own_bytes)
        return edits


def _words(part: Datagram) -> str:
    return f"{COMMANDS.get(part.command, part.command)} {part.data_bytes}"


def _wire_us(layout: tuple[Datagram, ...]) -> float:
    """A frame on the wire [us]."""
    return plain(sending_us(frame_bytes(_datagrams_bytes(layout))))


def _datagrams_bytes(parts: Sequence[Datagram]) -> float:
    return sum(part.data_bytes + plain(DATAGRAM_BYTES) for part in parts)


def _trips(frames: EthercatFrames) -> _Trips:
    """Tell which frame returned as which.

    Frames keep their order on the ring, so those of the same datagrams and indexes return in the order in which they
    were sent. Of more frames that were sent than returned before the next was sent, the earliest are lost.
    """
    order = np.argsort(frames.key, kind="stable")
    key, returned = frames.key[order], frames.returned[order]
    changes = np.flatnonzero((np.diff(key) != 0) | (np.diff(returned.view(np.int8)) != 0)) + 1
    first = np.concatenate(([0], changes))
    length = np.diff(np.concatenate((first, [len(order)])))
    answered = ~returned[first[:-1]] & returned[first[1:]] & (key[first[:-1]] == key[first[1:]])
    run = np.flatnonzero(answered)
    sent, back = length[run], length[run + 1]
    pairs = np.minimum(sent, back)
    within = np.arange(pairs.sum()) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    sent_at = order[np.repeat(first[run] + sent - pairs, pairs) + within]
    back_at = order[np.repeat(first[run + 1], pairs) + within]
    is_paired = np.zeros(len(order), dtype=np.bool_)
    is_paired[sent_at] = is_paired[back_at] = True
    lost = np.flatnonzero(~is_paired & ~frames.returned)
    # Frames behind the last one that returned may still be on their way.
    lost = lost[lost < (back_at.max() if len(back_at) else 0)]
    unsent = int(np.count_nonzero(~is_paired & frames.returned))
    kept = frames.times_ns[back_at] >= frames.times_ns[sent_at]
    return _Trips(sent_at[kept], back_at[kept], lost, unsent)
