"""A cycle of a CAN log as events: its frames, those of others between them, and the waits for nodes and host."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from busplan.buses.can.cycle import WORST_STUFFING, can_cycle
from busplan.buses.can.due import due_pdos
from busplan.buses.can.equations import BASE_BITS
from busplan.buses.can.logged import wire_times
from busplan.buses.can.recorded_cycles import EMERGENCY, Ints, SenderNames, emergencies
from busplan.buses.can.streams import Stream, streams
from busplan.buses.can.traffic import NAMES, SYNC, answer_us
from busplan.buses.network import Network, hyperperiod, numbers_by_due
from busplan.buses.waterfall import (
    MOST_EVENTS,
    Awaited,
    RecordedCycles,
    Waterfall,
    WaterfallEvent,
    from_zero,
    node_names,
    planned_events,
)
from busplan.english import first_of, plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.recordings import can_timing
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.statistics import Floats, periodic_events

if TYPE_CHECKING:
    from pathlib import Path

    from busplan.buses.cycle import BusCycle

_FEEDBACK, _COMMAND = NAMES["read"], NAMES["write"]
_OTHERS: Final = ("blocking", "message", "repeated")
"""Kinds of planned events that are of other traffic."""
_FRAMES: Final = ("sync", "feedback_frame", "command_frame")
"""Kinds of planned events that are frames of the cycle."""
_MOST_CYCLES: Final = 10_000
"""Longest hyperperiod in which the cycle of the same groups is sought; of a longer one the fullest is shown."""
_STAMP_US: Final = 1.0
"""Delay of stamps that is no more than the rounding of logs in microseconds."""
_ROUNDING_US: Final = 1e-6
"""Shortest wait that is no rounding of a float."""


class _Sender(NamedTuple):
    """What sends the frames of an identifier."""

    role: str
    """SYNC, feedback or command; the name of a message, or empty for none of the plan."""
    label: str
    node: str = ""
    ready_us: float = 0.0
    """Planned time of the node from its SYNC or request to the feedback [us]."""
    frame_us: float = 0.0
    """Planned time of the frame [us]."""
    every: int = 1


def recorded_cycles(network: Network, path: "Path", *, channel: str | None, progress: Progress) -> RecordedCycles:
    """The whole cycles of a CAN log; BusplanError for one without."""
    frames = read_can(path, channel=channel, progress=progress)
    try:
        return _CanCycles(network, frames)
    except BusplanError as error:
        raise BusplanError(f"{path}: {error}") from None


class _CanCycles(RecordedCycles):
    """Cycles from SYNC to SYNC, or from one first request to the next."""

    def __init__(self, network: Network, frames: CanFrames) -> None:
        self.network, self.frames, self.synthetic = network, frames, frames.synthetic
        self.cycle = can_cycle(network, WORST_STUFFING)
        traffic = self.traffic = self.cycle.traffic
        stretch = self.stretch = can_timing.longest_stretch(frames)
        self.taken = stretch.taken
        needed, rate = can_timing.least_bit_rate(frames, stretch).surely, traffic.bit_rate_kbit_s
        if needed > rate:
            raise BusplanError(
                f"its frames need {needed:,.0f} kbit/s, and bus.bit_rate_kbit_s = {rate:g}: they do not fit on the "
                "wire of the plan"
            )
        self.step_us = can_timing.step_us(stretch)
        wire = wire_times(
            frames, stretch.taken, bit_rate_kbit_s=rate, data_bit_rate_kbit_s=traffic.data_bit_rate_kbit_s
        )
        self.stamp_error_us = self.step_us + can_timing.late_stamps_us(stretch, wire.least_us)
        self.wire_us = wire.us
        self.stuffing_us = np.where(frames.is_fd[stretch.taken], (wire.worst_us - wire.none_us) / 2, 0.0)
        # A frame ends before the next one begins: a stamp beyond that is late. Of the time since 1970 a float holds
        # whole microseconds.
        sent_us = wire.least_us.cumsum()
        self.ends_us: Floats = np.minimum.accumulate((np.rint(stretch.times_us) - sent_us)[::-1])[::-1] + sent_us
        self.begin_us = float(stretch.times_us[0]) - frames.lead_us
        """Time of the first frame of the recording [us]."""
        self.key = frames.identifiers[stretch.taken] * 2 + frames.extended[stretch.taken]
        self.names = SenderNames(network, streams(traffic))
        self.senders = dict(self._senders())
        self.places = {key: np.flatnonzero(self.key == key) for key in self.senders}
        self.anchor = self._anchor()
        self.cycle_of, self.cycles = self._aligned()
        cyclic = np.flatnonzero(self.cycle_of >= 0)
        self.first, self.last = (np.zeros(int(self.cycle_of.max()) + 1, dtype=np.int64) for _ in range(2))
        self.first[self.cycle_of[self.places[self.anchor]]] = self.places[self.anchor]
        np.maximum.at(self.last, self.cycle_of[cyclic], cyclic)
        self.numbers = (self.cycles + 1).tolist()
        first, last = self.first[self.cycles], self.last[self.cycles]
        self.lengths_us = (self.ends_us[last] - self.ends_us[first] + self.wire_us[first]).tolist()

    def _senders(self) -> Iterator[tuple[int, _Sender]]:
        """Senders by key of their identifier: of all PDOs of the plan, and of all frames of the log."""
        sent, keys = self.names.sent, self.key
        for stream in sent:
            if not stream.is_message:
                cyclic = np.arange(int(stream.first), int(stream.last) + 1) * 2 + (stream.identifier_bits > BASE_BITS)
                keys = np.union1d(keys, cyclic)
        for key in np.unique(keys).tolist():
            identifier, is_extended = divmod(key, 2)
            of_plan = [
                stream
                for stream in sent
                if (stream.identifier_bits > BASE_BITS) == is_extended and stream.first <= identifier <= stream.last
            ]
            yield key, self._of_stream(of_plan[0], identifier) if of_plan else self._unplanned(key)

    def _unplanned(self, key: int) -> _Sender:
        """An identifier that the plan does not have: an emergency, or whatever it is."""
        words = f"{key >> 1:#x}, no message of the plan"
        is_canopen = self.traffic.has_sync and self.names.sent[0].first == EMERGENCY
        found = emergencies(self.frames, self.taken[self.key == key])
        if is_canopen and len(found.frames):
            node = int(found.nodes[0])
            words = f"emergency of {self.names.by_node_id.get(node, f'node-ID {node}')} ({key >> 1:#x})"
        return _Sender("", words)

    def _of_stream(self, stream: Stream, identifier: int) -> _Sender:
        label, frame_us = self.names.name(stream, identifier), float(stream.frame_us)
        if stream.is_message or stream.name == SYNC:
            return _Sender(stream.name, label, frame_us=frame_us)
        group, nodes = next(group for group in self.network.groups if group.name == stream.group), self.names.nodes
        number = (identifier - int(stream.first)) // max(int(stream.identifiers) // len(nodes[stream.group]), 1)
        ready_us = group.read_execution_us + group.worst_extra_us
        if not self.traffic.has_sync:
            ready_us = answer_us([group], access="burst")
        every = max(round(stream.period_us / self.traffic.period_us), 1)
        return _Sender(stream.name, label, nodes[stream.group][number], float(ready_us), frame_us, every)

    def _anchor(self) -> int:
        """Key of the identifier that begins a cycle: SYNC, or of the most frequent requests that behind a pause."""
        role = SYNC if self.traffic.has_sync else _COMMAND
        keys = [key for key, sender in self.senders.items() if sender.role == role and len(self.places[key]) > 1]
        if not keys:
            what = "SYNC" if role == SYNC else "request of any node"
            raise BusplanError(f"it has no whole cycle: no {what} comes twice")
        often = min(self.senders[key].every for key in keys)
        cyclic = np.isin(self.key, [key for key in self.senders if self.senders[key].role in (_FEEDBACK, _COMMAND)])
        # Without the first frame, before which nothing is recorded.
        ends_us = np.where(cyclic, self.ends_us, -np.inf)
        before_us = np.concatenate(([-np.inf], np.maximum.accumulate(ends_us)[:-1]))
        rest_us = self.ends_us - self.wire_us - before_us
        return max(
            (key for key in keys if self.senders[key].every == often),
            key=lambda key: float(np.median(rest_us[self.places[key]][1:])),
        )

    def _aligned(self) -> tuple[Ints, Ints]:
        """Cycle of each frame, -1 for one that is of none, and the cycles that are whole."""
        begins = self.places[self.anchor]
        begin_us = self.ends_us[begins]
        periods = periodic_events(begin_us)
        at = np.arange(len(begins)) if periods is None else periods.places
        numbers = np.arange(int(at[-1]) + 1)
        sync_us, is_sent = np.interp(numbers, at, begin_us), np.isin(numbers, at)
        cycle_of = np.full(len(self.key), -1)
        for key, sender in self.senders.items():
            if sender.role in (_FEEDBACK, _COMMAND) and key != self.anchor:
                places = self.places[key]
                due = due_pdos(sync_us, self.ends_us[places], every=sender.every, is_sent=is_sent)
                cycle_of[places[due.pdos]] = due.cycles
        cycle_of[begins] = at
        # The log may end within the last one.
        return cycle_of, at[:-1]

    def waterfall(self, place: int) -> Waterfall:
        """Events of a cycle."""
        cycle = int(self.cycles[place])
        planned = self._planned(cycle)
        first, last = int(self.first[cycle]), int(self.last[cycle])
        start_us = float(self.ends_us[first] - self.wire_us[first])
        if last - first >= MOST_EVENTS:
            frames = plural(last - first + 1, "frame")
            raise BusplanError(f"cycle {cycle + 1:,} has {frames}: a timeline shows up to {MOST_EVENTS:,} events")
        unknown = np.flatnonzero(self.wire_us[first : last + 1] == 0)
        if len(unknown):
            raise BusplanError(
                f"frame {self.number_of(first + int(unknown[0])):,} of cycle {cycle + 1:,} switches to another "
                "bit rate, and the plan has none: its length is not known; give bus.data_bit_rate_kbit_s"
            )
        waits = _Waits(self, cycle, first, planned)
        events = tuple(
            event._replace(start_us=event.start_us - start_us, end_us=event.end_us - start_us)
            for event in self._events(cycle, first, last, waits)
        )
        return Waterfall(
            self.numbers[place],
            (start_us - self.begin_us) / 1e6,
            self.number_of(first),
            events,
            planned,
            self._doubts_us(events, cycle, slice(first, last + 1)),
            tuple(self._remarks(cycle)),
        )

    def number_of(self, place: int) -> int:
        """Number of a frame in the log."""
        return int(self.frames.numbers[self.taken[place]])

    def _events(self, cycle: int, first: int, last: int, waits: "_Waits") -> Iterator[WaterfallEvent]:
        """Frames and waits of a cycle, at the times of the log [us]."""
        seen = set[int]()
        pieces: list[tuple[float, float]] = []
        held: list[WaterfallEvent] = []
        now_us = float(self.ends_us[first] - self.wire_us[first])
        for place in range(first, last + 1):
            key, number = int(self.key[place]), self.number_of(place)
            sender, end_us = self.senders[key], float(self.ends_us[place])
            begin_us = max(end_us - float(self.wire_us[place]), now_us)
            if begin_us > now_us + _ROUNDING_US:
                destroyed = self._destroyed(now_us, begin_us)
                held += destroyed
                waits_us = destroyed[-1].end_us if destroyed else now_us
                pieces += [(waits_us, begin_us)] if waits_us < begin_us else []
            else:
                begin_us = now_us
            if self.cycle_of[place] != cycle:
                is_pdo = sender.role in (SYNC, _FEEDBACK, _COMMAND)
                label = f"{sender.label}, of another cycle" if is_pdo else sender.label
                held.append(WaterfallEvent("others", label, begin_us, end_us, sender.node, number, end_us - begin_us))
            else:
                yield from sorted((*held, *waits.ended(place, sender, pieces)), key=lambda event: event.start_us)
                late_us, label = end_us - begin_us, f"{sender.label}, again"
                if key not in seen:
                    late_us, label = max(late_us - sender.frame_us, 0.0), sender.label
                seen.add(key)
                yield WaterfallEvent("wire", label, begin_us, end_us, sender.node, number, late_us)
                held, pieces = [], []
            now_us = end_us

    def _destroyed(self, from_us: float, to_us: float) -> list[WaterfallEvent]:
        """Time between two frames up to the last error frame there: how much of it is on the wire is not known."""
        frames = self.frames
        errors_us = np.rint(frames.errors_us)
        inside = np.flatnonzero((errors_us > from_us) & (errors_us <= to_us + self.stamp_error_us))
        if not len(inside):
            return []
        number, end_us = int(frames.error_numbers[inside[-1]]), min(float(errors_us[inside[-1]]), to_us)
        return [WaterfallEvent("unknown", "an error frame, and what it destroyed", from_us, end_us, "", number)]

    def missing(self, cycle: int, role: str) -> list[int]:
        """Keys of the feedback or of the commands that are due in a cycle and never come."""
        found = []
        for key, sender in self.senders.items():
            if sender.role == role:
                cycles = self.cycle_of[self.places[key]]
                cycles = cycles[cycles >= 0]
                rests = np.bincount(cycles % sender.every, minlength=sender.every)
                is_known = sender.every == 1 or len(cycles)
                if is_known and rests.argmax() == cycle % sender.every and cycle not in cycles:
                    found.append(key)
        return found

    def _doubts_us(self, events: Sequence[WaterfallEvent], cycle: int, places: slice) -> dict[Awaited, float]:
        """Largest error of each sum: lengths are exact, and waits of one sort in a row lie between two stamps."""
        stuffing_us, is_own = self.stuffing_us[places], self.cycle_of[places] == cycle
        doubts_us: dict[Awaited, float] = {
            "wire": float(stuffing_us[is_own].sum()),
            "others": float(stuffing_us[~is_own].sum()),
        }
        waited = [event.waits_for for event in events if event.waits_for not in doubts_us]
        rows = Counter(awaited for awaited, _ in groupby(waited))
        # Late stamps may hide a wait.
        waits: tuple[Awaited, ...] = ("nodes", "host", *rows)
        of_row_us, rest_us = self.stamp_error_us, float(stuffing_us.sum())
        return doubts_us | {awaited: rest_us + max(rows[awaited], 1) * of_row_us for awaited in waits}

    def _planned(self, cycle: int) -> tuple[WaterfallEvent, ...]:
        """The planned cycle with the groups that are seen, from its first frame to its last one."""
        rates, here = self.cycle.rates, np.flatnonzero(self.cycle_of == cycle).tolist()
        nodes = {self.senders[int(self.key[place])].node for place in here}
        names, ends = node_names(self.network), np.cumsum([int(group.nodes) for group in self.network.groups])
        is_seen = [not nodes.isdisjoint(part) for part in (names[a:b] for a, b in zip((0, *ends), ends, strict=False))]
        planned: BusCycle = self.cycle
        if 1 < hyperperiod(rates) <= _MOST_CYCLES:
            numbers = {due: found[0] for due, found in numbers_by_due(rates).items()}
            due = min(numbers, key=lambda due: sum(a != b for a, b in zip(due, is_seen, strict=True)))
            planned = self.cycle.at(numbers[due])
        events = [*planned_events(planned.events(), planned.term_figures, others=_OTHERS, names=names)]
        frames = [place for place, (kind, _) in enumerate(events) if kind in _FRAMES]
        if not frames:
            return ()
        # Of requests at once the host makes all but the first behind the first frame.
        others = [event for kind, event in events[: frames[0]] if kind == "host"][1:]
        first, *rest = (event for _, event in events[frames[0] : frames[-1] + 1])
        return from_zero([first, *others, *rest])

    def _remarks(self, cycle: int) -> Iterator[str]:
        yield from can_timing.faults(self.frames, self.stretch)
        missing = [self.senders[key].label for role in (_FEEDBACK, _COMMAND) for key in self.missing(cycle, role)]
        if missing:
            yield f"Never came in this cycle: {first_of(missing, can_timing.LISTED)}."
        yield (
            f"Frames have their length at {self.traffic.bit_rate_kbit_s:g} kbit/s and end with their stamps; these "
            f"have an error of up to {self.stamp_error_us:g} us."
        )
        if self.stamp_error_us > self.step_us + _STAMP_US:
            yield "Frames come closer than the bus allows: stamps are late."
        yield (
            "From the first frame to the last: of the plan SYNC's jitter, the frame that SYNC waits for, and what "
            "comes behind the last frame are left out."
            if self.traffic.has_sync
            else "From the first request to the last answer: the host's time before the first request is left out."
        )


class _Waits:
    """Waits of a cycle while its frames are gone through."""

    def __init__(self, cycles: _CanCycles, cycle: int, first: int, planned: Sequence[WaterfallEvent]) -> None:
        self.cycles, self.has_sync = cycles, cycles.traffic.has_sync
        self.is_burst, bus = cycles.traffic.access == "burst", cycles.network.profile.bus
        of_host = groupby(planned, key=lambda event: event.waits_for in ("host", "adapter"))
        runs_us = (sum(event.duration_us for event in run) for is_host, run in of_host if is_host)
        self.host_us = bus.host_us if self.is_burst else max(runs_us, default=0.0)
        """Planned time of the host and its adapter before a command."""
        self.waits_for_all = self.has_sync and not bus.pipeline_cycles
        self.left = set(np.flatnonzero(cycles.cycle_of == cycle).tolist())
        """Places of frames that are to come."""
        self.missing = {cycles.senders[key].node for key in cycles.missing(cycle, _FEEDBACK)}
        self.asked_us: dict[str, float] = {}
        """End of the request to each node."""
        self.sync_us = self.last_us = float(cycles.ends_us[first])
        self.last: _Sender | None = None

    def ended(self, place: int, sender: _Sender, pieces: Sequence[tuple[float, float]]) -> Iterator[WaterfallEvent]:
        """The pieces of a wait that a frame of the cycle ends."""
        awaited, ready_us = self._awaited(sender)
        for begin_us, end_us in pieces:
            late_us = max(end_us - max(begin_us, ready_us), 0.0)
            number = self.cycles.number_of(place)
            yield WaterfallEvent(awaited, sender.label, begin_us, end_us, sender.node, number, late_us)
        self.left.discard(place)
        self.last, self.last_us = sender, float(self.cycles.ends_us[place])
        if sender.role == _COMMAND:
            self.asked_us[sender.node] = self.last_us

    def _awaited(self, sender: _Sender) -> tuple[Awaited, float]:
        """What the cycle has waited for, and until when the plan waits for it [us]."""
        if sender.role == _FEEDBACK:
            asked_us = self.sync_us if self.has_sync else self.asked_us.get(sender.node, self.last_us)
            return "nodes", asked_us + sender.ready_us
        is_first = self.last is None or self.last.role != _COMMAND
        if self.waits_for_all and is_first and self._lacks_feedback():
            return "unknown", self.last_us
        if not (self.has_sync or self.is_burst) and self.last is not None and self.last.role == _COMMAND:
            # The node that was asked has not answered.
            return ("unknown" if self.last.node != sender.node else "host"), self.last_us
        is_next = self.last is not None and self.last.node != sender.node
        return "host", self.last_us + self.host_us * (is_first or (not self.has_sync and is_next))

    def _lacks_feedback(self) -> bool:
        """Whether feedback is to come, or never comes."""
        roles = (self.cycles.senders[int(self.cycles.key[place])].role for place in self.left)
        return bool(self.missing) or _FEEDBACK in roles
