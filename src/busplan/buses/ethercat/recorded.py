"""Capture of the master's port compared with the plan: period, jitter, round trips, bytes, and lost frames."""

from collections.abc import Iterator, Sequence
from math import ceil
from operator import attrgetter
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.ethercat.cycle import LAST_BYTE, EthercatCycle
from busplan.buses.ethercat.equations import (
    c,
    frame_bytes,
    sending_us,
)
from busplan.buses.ethercat.frames import (
    UnitCycle,
    cables_us,
    devices_doubts,
    devices_us,
    has_rates,
    housekeeping_bytes,
)
from busplan.buses.ethercat.port_times import line_delays
from busplan.buses.ethercat.recorded_cycles import Ints, SeenCycles, seen_cycles, trips
from busplan.buses.network import Network
from busplan.buses.rule import Recorded, RecordedFigure, clocks_us, day_of, latest_start
from busplan.english import plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.recordings.capture import MOST_PACKETS
from busplan.recordings.ethercat import COMMANDS, Datagram, EthercatFrames, read_ethercat
from busplan.recordings.statistics import (
    LEAST_EVENTS,
    Floats,
    Quantile,
    expanded,
    lateness,
    line,
    quantile,
    step,
)

_PERIOD: Final = "cycle.period_us"
_MASTER: Final = "bus.master_us"
_JITTER: Final = "bus.master_jitter_us"
_MISSED: Final = "limits.missed_cycles"
_STEP_BACK_NS: Final = 50_000
"""Least step back of a stamp that means a clock set back; a smaller step may come from two capture queues [ns]."""
_TWO_STAMPS: Final = 0.5
"""Standard uncertainty, in steps of the stamps, of the longest of many differences; its error is one step at most."""
_LEAST_SPAN_BYTES: Final = 200
"""Least range of frame sizes that shows the time of a byte; the host's time depends on the size, too [bytes]."""
_BITS: Final = 8
"""Bits of a byte."""
_STRAY: Final = 0.01
"""Share of frames that may have a wrong stamp or a wrong partner."""


class _CycleValues(NamedTuple):
    """Values of each of n cycles with process data."""

    frames: Ints
    """Number of frames of process data [1]."""
    is_back: npt.NDArray[np.bool_]
    """Whether all frames returned."""
    trips_us: Floats
    """Round trip, from the first frame sent to the last one returned [us]."""
    host_us: Floats
    """The master's own time: round trip less wire, bias of the bytes, and planned devices and cables [us]."""
    data_bytes: npt.NDArray[Any]
    datagrams_bytes: npt.NDArray[Any]
    """All datagrams [bytes]."""


def recorded(network: Network, path: Path, *, share: float, progress: Progress) -> Recorded:
    """Comparison of a capture at the master's port, a pcap or pcapng file, with the plan.

    `network` has plain numbers. `share` is the quantile of cycles for jitter and the master's time, 0.5..1. `progress`
    is called with the bytes read and the size of the file [bytes]. Raises `BusplanError` where the file is no capture,
    or has no EtherCAT frames that can be compared.
    """
    frames = read_ethercat(path, progress=progress)
    if not frames.returned.any():
        raise BusplanError(
            f"{path}: none of its {len(frames.times_ns):,} EtherCAT frames returned; record both ways of the port"
        )
    seen = Seen(network, frames, share)
    figures = tuple(seen.figures())
    day = day_of(int(frames.times_ns[0]))
    compared = Recorded(figures, tuple(seen.remarks()), seen.edits(), day, seen.shows_nothing())
    return compared.unless_synthetic(frames.notes.synthetic)


class Seen:
    """A recording, and the values that several figures derive from it."""

    def __init__(self, network: Network, frames: EthercatFrames, share: float) -> None:
        self.network, self.frames, self.share = network, frames, share
        steps_back = np.diff(frames.times_ns) < -_STEP_BACK_NS
        self.steps_back = int(np.count_nonzero(steps_back))
        self.stamp_us = step(frames.times_ns)
        self.trips = trips(frames)
        self.trips_us = (frames.times_ns[self.trips.returned] - frames.times_ns[self.trips.sent]) / 1000
        self.delays = line_delays(frames.latches, frames.unlatched)
        self.dropped = frames.notes.dropped + frames.cut
        """Number of packets that the recorder reports as dropped, or that it cut."""
        self.own_reads = _own_reads(network, frames.layouts)
        """Datagrams of the master itself that have a logical address."""
        process = [tuple(filter(self._is_process_data, layout)) for layout in frames.layouts]
        datagrams = np.array([_datagrams_bytes(layout) for layout in frames.layouts])
        wire_us = np.array([sending_us(frame_bytes(size)) for size in datagrams.tolist()])
        self.datagrams_bytes, self.wire_us = datagrams[frames.layout], wire_us[frames.layout]
        self.data_bytes = np.array([float(sum(part.data_bytes for part in parts)) for parts in process])[frames.layout]
        self.is_data = np.array([bool(parts) for parts in process])[frames.layout]
        self.cycles: SeenCycles | None = None
        sent = np.flatnonzero(self.is_data & ~frames.returned)
        if len(sent):
            # Where the clock was set back, only the longest stretch between such steps counts.
            stretch = np.concatenate(([0], np.cumsum(steps_back)))[sent]
            sent = sent[stretch == np.bincount(stretch).argmax()]
            sent = sent[np.argsort(frames.times_ns[sent], kind="stable")]
            times_us = (frames.times_ns[sent] - frames.times_ns[sent[0]]) / 1000
            numbers = {parts: number for number, parts in enumerate(dict.fromkeys(process))}
            kinds = np.array([numbers[parts] for parts in process])[frames.layout[sent]]
            self.cycles = seen_cycles(sent, times_us, kinds, self.data_bytes[sent], network)
        self.bad_stamps = self._why_bad_stamps()
        """Reason why stamps give no durations; empty where they do."""
        self.jitter: dict[str, object] = {}
        self.master: Quantile | None = None
        self.master_bytes: list[int] | None = None
        """Data of the master's own datagrams, if not as planned [bytes]."""

    def _is_process_data(self, part: Datagram) -> bool:
        return part.is_logical and part not in self.own_reads

    def _why_bad_stamps(self) -> str:
        count = len(self.trips_us)
        if not count:
            return "no frame that it has as sent is among those that returned"
        typical_us = quantile(self.trips_us, 0.5).value
        if self.cycles is not None and self.cycles.in_bursts:
            return "the frames were stamped in bursts, and not as they passed the port"
        if self.early > _STRAY * count:
            return (
                f"{self.early:,} of {plural(count, 'frame')} returned sooner than it takes to send them: the stamps "
                "were not taken at the master's port"
            )
        if typical_us <= self.stamp_us:
            return f"the stamps have steps of {self.stamp_us:g} us, and frames return within {typical_us:g} us"
        return ""

    @property
    def early(self) -> int:
        """Number of frames that returned sooner than it takes to send them."""
        least_us = self.wire_us[self.trips.sent] - sending_us(c.GAP_BYTES) - 2 * self.stamp_us
        return int(np.count_nonzero(self.trips_us < least_us))

    @property
    def too_few(self) -> str:
        """Reason why the recording has too few cycles for a period; empty where it has enough, or stamps in bursts."""
        if self.cycles is None or self.cycles.periods is not None or self.cycles.in_bursts:
            return ""
        return f"{plural(len(self.cycles.first), 'cycle')}, but a period needs at least {LEAST_EVENTS}"

    def shows_nothing(self) -> tuple[str, ...]:
        """Reasons why the recording cannot show that the machine keeps its plan."""
        reasons = (
            "" if self.cycles else "it has no frame of process data (LRD, LWR, LRW)",
            self.too_few and f"it has {self.too_few}",
            self.bad_stamps,
            self._dropped,
        )
        return tuple(filter(None, reasons))

    @property
    def _dropped(self) -> str:
        return f"the recorder dropped or cut {plural(self.dropped, 'packet')}" if self.dropped else ""

    def figures(self) -> Iterator[RecordedFigure]:
        """All recorded figures."""
        if self.cycles is not None:
            yield from self._period(self.cycles)
            yield from self._cycles(self.cycles)
        yield from self._lost()
        yield from self._byte()
        yield from self.delays.figures(self.network)

    def _period(self, cycles: SeenCycles) -> Iterator[RecordedFigure]:
        """Figures of the period and of the latest start of a cycle."""
        periods, count = cycles.periods, len(cycles.first)
        period_us, jitter_us = self.network.period_us, self.network.profile.bus.master_jitter_us
        period = RecordedFigure("period", "us", period_us, None, None, "equal", count, _PERIOD)
        start = RecordedFigure("latest start", "us", jitter_us, None, None, "at most", count, _JITTER)
        if periods is None:
            yield from (figure._replace(hidden=self.too_few or self.bad_stamps) for figure in (period, start))
            return
        doubt = expanded(periods.uncertainty_us, clocks_us(period_us), self.stamp_us / count)
        yield period._replace(recorded=periods.period_us, uncertainty=doubt)
        deviation_us = float(np.std(np.diff(periods.late_us)))
        yield RecordedFigure("standard deviation of the period", "us", None, deviation_us, None, "shown", count - 1)
        latest = lateness(periods, self.share)
        is_hidden = self.stamp_us > max(jitter_us, latest.value)
        # The worst of more cycles stays where the recording keeps it.
        planned = self.network.profile.bus.master_jitter_cycles
        is_kept = latest.value <= jitter_us and planned is not None and planned >= count
        if not (is_hidden or self.bad_stamps or is_kept):
            self.jitter = latest_start(_JITTER, _up(latest.value), events=count, share=self.share)
        start = start._replace(
            recorded=latest.value,
            uncertainty=expanded(latest.uncertainty, self.stamp_us * _TWO_STAMPS),
            hidden=f"stamps have steps of {self.stamp_us:g} us" if is_hidden else "",
        )
        yield start.located(self.frames.events(latest.late_us, cycles.first))

    def _cycles(self, cycles: SeenCycles) -> Iterator[RecordedFigure]:
        """Figures of missing cycles, then of the times and layout of each kind of cycle."""
        per_cycle = self._values(cycles)
        if cycles.periods is None:
            everywhere = np.arange(len(cycles.first))
            yield from self._times(cycles.sorts[0], "", cycles, per_cycle, (everywhere, everywhere))
            return
        frames, data_bytes = (_usual(values, cycles.sort) for values in (per_cycle.frames, per_cycle.data_bytes))
        has_less = (per_cycle.frames < frames) | (per_cycle.data_bytes < data_bytes)
        yield self._without_frame(cycles, np.flatnonzero(has_less))
        whole = per_cycle.is_back & (per_cycle.frames == frames) & (per_cycle.data_bytes == data_bytes)
        for index, sort in enumerate(cycles.sorts):
            names = [group.name for group, is_due in zip(self.network.groups, sort.due, strict=True) if is_due]
            with_names = f" with {' and '.join(names) or 'no group'}" if has_rates(self.network) else ""
            of_sort = np.flatnonzero(whole & (cycles.sort == index))
            if sort.data_bytes:
                of_master = () if index else (of_sort, np.flatnonzero(whole))
                yield from self._times(sort, with_names, cycles, per_cycle, (of_sort, *of_master))
            yield from self._layout(sort, with_names, cycles, of_sort, per_cycle)

    def _values(self, cycles: SeenCycles) -> _CycleValues:
        """Values of each cycle."""
        times_ns, number, count = self.frames.times_ns, cycles.number, len(cycles.first)
        back = np.full(len(times_ns), -1)
        back[self.trips.sent] = self.trips.returned
        back = back[cycles.frames]
        frames = np.bincount(number, minlength=count)
        is_back = np.bincount(number, weights=back >= 0, minlength=count) == frames
        end_ns = np.full(count, np.iinfo(np.int64).min)
        np.maximum.at(end_ns, number[back >= 0], times_ns[back[back >= 0]])
        trips_us = np.where(is_back, (end_ns - times_ns[cycles.first]) / 1000, 0.0)
        wire_us, data_bytes, datagrams_bytes = (
            np.bincount(number, weights=values[cycles.frames])
            for values in (self.wire_us, self.data_bytes, self.datagrams_bytes)
        )
        way_us = devices_us(self.network) + cables_us(self.network) + self.delays.more_us(self.network)
        host_us = trips_us - wire_us - data_bytes * c.BYTE_BIAS_US - way_us
        return _CycleValues(frames, is_back, trips_us, host_us, data_bytes, datagrams_bytes)

    def _without_frame(self, cycles: SeenCycles, with_less: Ints) -> RecordedFigure:
        """Figure of cycles without a frame, or with less in their frames than most cycles of their kind.

        Those without a frame are at the cycle before them.
        """
        longest, missing = int(cycles.gaps.max(initial=0)), int(cycles.gaps.sum())
        notes = []
        if longest > 1:
            at = int(cycles.gaps.argmax())
            first, end = cycles.first[at : at + 2]
            pause_us = (self.frames.times_ns[end] - self.frames.times_ns[first]) / 1000
            notes.append(f"{longest:,} in a row, {pause_us / 1e6:.3g} s without set-points")
        if len(with_less):
            notes.append(f"{len(with_less):,} with less than most have")
        events = missing + len(cycles.first)
        number, before = missing + len(with_less), np.flatnonzero(cycles.gaps)
        figure = self._missed("cycles without a frame", number, events, ", ".join(notes), self._dropped)
        places = cycles.first[np.concatenate((before, with_less))]
        each = np.concatenate((cycles.gaps[before], np.ones(len(with_less), dtype=np.int64))).astype(np.float64)
        return figure.located(self.frames.events(each, places))

    def _missed(self, quantity: str, number: int, events: int, note: str, hides: str = "") -> RecordedFigure:
        """A count held against `limits.missed_cycles`; hidden where dropped packets may explain the excess."""
        limit = self.network.profile.limits.missed_cycles
        hidden = hides if number - self.dropped <= limit else ""
        return RecordedFigure(quantity, "1", limit, number, None, "at most", events, _MISSED, note, hidden=hidden)

    def _counted(self, quantity: str, places: Ints, events: int, note: str, hides: str = "") -> RecordedFigure:
        """A number of frames held against `limits.missed_cycles`."""
        figure = self._missed(quantity, len(places), events, note, hides)
        return figure.located(self.frames.events(np.ones(len(places)), places))

    def _times(
        self, sort: UnitCycle, with_names: str, cycles: SeenCycles, per_cycle: _CycleValues, places: tuple[Ints, ...]
    ) -> Iterator[RecordedFigure]:
        """Round trip of a kind of cycle, and the master's time.

        `places` are the cycles of the kind, and the sets of cycles of which the master's time is the largest, if any.
        """
        of_sort, *of_master = places
        trips_us, bus, count = per_cycle.trips_us[of_sort], self.network.profile.bus, len(of_sort)
        planned = EthercatCycle(self.network, LAST_BYTE, sort.numbers[0])
        in_trip = ("cycle_master_us", "cycle_frames_us", "cycle_data_us", "cycle_devices_us", "cycle_cable_us")
        planned_us = sum(planned.by_term[key] for key in in_trip) + planned.bias_us()
        few = f"{plural(count, 'whole cycle')}, and a figure takes {LEAST_EVENTS}" if count < LEAST_EVENTS else ""
        hidden = self.bad_stamps or few
        trip = RecordedFigure(f"round trip{with_names}", "us", planned_us, None, None, "at most", count, hidden=hidden)
        master = RecordedFigure(
            "master's time", "us", bus.master_us, None, None, "at most", count, _MASTER, hidden=hidden
        )
        if hidden:
            yield from (trip, master) if of_master else (trip,)
            return
        doubts = [
            *(doubt.us for doubt in devices_doubts(self.network)),
            planned.process_bytes * c.BYTE_BIAS_UNCERTAINTY_US,
            bus.master_doubt_us,
            self.stamp_us * _TWO_STAMPS,
        ]
        if of_master:
            typical_us = quantile(trips_us, 0.5).value
            yield RecordedFigure("round trip, median", "us", None, typical_us, None, "shown", count)
        longest = quantile(trips_us, self.share)
        trip = trip._replace(recorded=longest.value, uncertainty=expanded(*doubts, longest.uncertainty or 0.0))
        yield trip.located(self.frames.events(trips_us, cycles.first[of_sort]))
        if of_master:
            most = max(of_master, key=lambda some: quantile(per_cycle.host_us[some], self.share).value)
            host_us = per_cycle.host_us[most]
            self.master = quantile(host_us, self.share)
            yield master._replace(
                recorded=self.master.value,
                uncertainty=expanded(*doubts, self.master.uncertainty or 0.0),
                events=len(host_us),
                note=f"median {quantile(host_us, 0.5).value:.1f}: round trip less wire, devices and cables",
            ).located(self.frames.events(host_us, cycles.first[most]))

    def _layout(
        self, sort: UnitCycle, with_names: str, cycles: SeenCycles, of_sort: Ints, per_cycle: _CycleValues
    ) -> Iterator[RecordedFigure]:
        """Frames of a kind of cycle, and their datagrams."""
        count, planned = len(of_sort), EthercatCycle(self.network, LAST_BYTE, sort.numbers[0]).packing
        if sort.data_bytes:
            name, frames = f"frames in a cycle{with_names}", int(per_cycle.frames[of_sort[0]]) if count else None
            hidden = "" if count else "no such cycle is in the recording"
            figure = RecordedFigure(name, "1", planned.frames, frames, None, "equal", count, hidden=hidden)
            number = per_cycle.frames[of_sort].astype(np.float64)
            yield figure.located(self.frames.events(number, cycles.first[of_sort]))
        if not count:
            return
        # The middle one of the most frequent cycles is shown: now and then a master adds a datagram.
        sizes, often = np.unique(per_cycle.datagrams_bytes[of_sort], return_counts=True)
        usual_bytes = sizes[often.argmax()]
        usual = of_sort[per_cycle.datagrams_bytes[of_sort] == usual_bytes]
        places = cycles.frames[cycles.number == usual[len(usual) // 2]]
        layouts = [self.frames.layouts[layout] for layout in self.frames.layout[places]]
        figure = RecordedFigure(
            f"datagrams of a cycle{with_names}",
            "bytes",
            planned.datagrams_bytes,
            float(usual_bytes),
            None,
            "at most",
            count,
            note=" | ".join(
                " ".join(f"{COMMANDS.get(part.command, part.command)} {part.data_bytes}" for part in layout)
                for layout in layouts
            ),
        )
        yield figure.located(self.frames.events(per_cycle.datagrams_bytes[of_sort], cycles.first[of_sort]))
        added = [part for layout in layouts for part in layout if not self._is_process_data(part)]
        if sort is cycles.sorts[0] and _datagrams_bytes(added) != housekeeping_bytes(self.network):
            self.master_bytes = [part.data_bytes for part in added]

    def _lost(self) -> Iterator[RecordedFigure]:
        """Figures of frames that did not return, and of frames with a wrong working counter."""
        frames, trips = self.frames, self.trips
        sent = int(np.count_nonzero(~frames.returned))
        yield self._counted("lost frames", trips.lost, sent, "", self._dropped)
        back = trips.returned[self.is_data[trips.returned]]
        if len(back):
            right = _usual(frames.counters[back], frames.layout[back])
            wrong = back[frames.counters[back] != right]
            note = "the most frequent ones are taken for right"
            yield self._counted("wrong working counters", wrong, len(back), note)

    def _byte(self) -> Iterator[RecordedFigure]:
        """Time of a byte, from frames that were alone on the ring: others wait for those before them."""
        if self.bad_stamps:
            return
        sent_ns, back_ns = self.frames.times_ns[self.trips.sent], self.frames.times_ns[self.trips.returned]
        order = np.argsort(sent_ns, kind="stable")
        last_ns = np.maximum.accumulate(back_ns[order])
        alone = order[np.concatenate(([True], sent_ns[order][1:] >= last_ns[:-1]))]
        sizes = self.wire_us[self.trips.sent[alone]] / c.BYTE_US
        if sizes.max() - sizes.min() < _LEAST_SPAN_BYTES:
            return
        fitted = line(sizes, self.trips_us[alone], self.stamp_us * _TWO_STAMPS)
        if fitted is None:
            return
        slope, error = fitted
        doubt = expanded(error, c.BYTE_BIAS_UNCERTAINTY_US) or 0.0
        is_hidden = slope + doubt < c.BYTE_US
        yield RecordedFigure(
            "time of a byte",
            "us",
            c.BYTE_US + c.BYTE_BIAS_US,
            slope,
            doubt,
            "at most",
            len(sizes),
            note=f"round trips of {int(sizes.min())} to {int(sizes.max())} bytes on the wire",
            is_mean=True,
            hidden="less than on the wire: the host waits for more than the frame" if is_hidden else "",
        )

    def remarks(self) -> Iterator[str]:
        """Sentences on other contents of the recording, and on what it does not show."""
        frames, notes = self.frames, self.frames.notes
        if notes.broken_at is not None:
            why = f"has more than {MOST_PACKETS:,} packets, and goes on" if notes.is_long else "is cut or damaged"
            yield f"The file {why} from byte {notes.broken_at:,} on: read up to there."
        if self.steps_back:
            yield (f"Its clock was set back {plural(self.steps_back, 'time')}: the longest stretch between is used.")
        if self.cycles is not None and self.cycles.left_out:
            yield (
                f"{plural(self.cycles.left_out, 'frame')} of process data at its ends are left out: the master was "
                "starting or stopping, and more cycles are missing than present, or a cycle is only partly captured."
            )
        if self.trips.unsent:
            yield f"{plural(self.trips.unsent, 'frame')} returned without having been seen to be sent."
        if frames.cut:
            yield f"Left out: {plural(frames.cut, 'EtherCAT frame')} that the recorder cut; record whole packets."
        if left_out := frames.others + notes.left_out:
            yield f"Left out: {plural(left_out, 'packet')} of other protocols or interfaces, or without a time."
        if not self.bad_stamps and self.early:
            yield (
                f"{plural(self.early, 'frame')} returned sooner than it takes to send them: their stamps were not "
                "taken at the master's port."
            )
        if self.master is not None and self.master.value < 0:
            yield "Round trips are shorter than with the profile's devices: the machine has fewer or faster ones."
        yield from self.delays.remarks
        yield f"Stamps have steps of {self.stamp_us:g} us."
        yield (
            "A capture of the master's port does not show its time from the task to the stamp of a frame, SYNC0, "
            "or the devices' own time."
        )

    def edits(self) -> dict[str, object]:
        """New value of each measured key; None removes a key."""
        edits: dict[str, object] = {**self.delays.edits(self.network)}
        if self.master is not None and self.master.value > 0:
            edits[_MASTER] = _up(self.master.value)
            edits["bus.master_grade"] = "measured"
            # The cycle already counts the uncertainty of the devices' delays.
            doubt = expanded(self.master.uncertainty, self.stamp_us * _TWO_STAMPS)
            edits["bus.master_uncertainty_us"] = None if doubt is None else round(doubt / 2, 4)
        edits |= self.jitter
        if self.master_bytes is not None:
            edits["bus.housekeeping_bytes"] = self.master_bytes
        return edits


def _usual(values: npt.NDArray[Any], sort: Ints) -> npt.NDArray[Any]:
    """Most frequent value in the same kind of cycle or frame, for each of n values."""
    usual = np.zeros_like(values)
    for number in np.unique(sort):
        distinct, often = np.unique(values[sort == number], return_counts=True)
        usual[sort == number] = distinct[often.argmax()]
    return usual


def _up(us: float) -> float:
    """A time rounded up to a nanosecond, so that it covers what was measured [us]."""
    return ceil(us * 1000) / 1000


def _own_reads(network: Network, layouts: Sequence[tuple[Datagram, ...]]) -> frozenset[Datagram]:
    """Reads of the master's own with a logical address, such as TwinCAT's of the state of all mailboxes.

    Such a read (LRD) follows process data that already bring inputs. Its size is one that the plan gives the master, or
    at most a bit of each device.
    """
    found: set[Datagram] = set()
    planned: Sequence[int] | None = network.profile.bus.housekeeping_bytes
    sizes = range(1, ceil(network.nodes / _BITS) + 1) if planned is None else planned
    for layout in layouts:
        logical = sorted((part for part in layout if part.is_logical), key=attrgetter("address"))
        names = [COMMANDS[part.command] for part in logical]
        if names[-1:] == ["LRD"] and {"LRD", "LRW"} & set(names[:-1]) and logical[-1].data_bytes in sizes:
            found.add(logical[-1])
    return frozenset(found)


def _datagrams_bytes(parts: Sequence[Datagram]) -> float:
    return sum(part.data_bytes + c.DATAGRAM_BYTES for part in parts)
