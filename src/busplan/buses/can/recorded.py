"""A CAN log beside the plan: the bit rate, the load, every cycle, and the data and format of every frame."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import ceil, inf
from pathlib import Path
from typing import Any, Final

import numpy as np

from busplan.buses.can.cycle import WORST_STUFFING, can_cycle
from busplan.buses.can.equations import BASE_BITS, FD_LENGTHS, bit_us
from busplan.buses.can.exchanges import RequestLog
from busplan.buses.can.logged import wire_times
from busplan.buses.can.pdos import PdoCycle
from busplan.buses.can.recorded_cycles import (
    EMERGENCY,
    Ints,
    SenderNames,
    SentPdos,
    emergencies,
    finite,
    joined,
    last_pdos_us,
    pdos_beside_sync,
)
from busplan.buses.can.recorded_messages import MessageLog, spread_us
from busplan.buses.can.requests import RequestCycle
from busplan.buses.can.streams import Stream, streams
from busplan.buses.can.traffic import NAMES, SYNC
from busplan.buses.network import Network
from busplan.buses.rule import SURE, Recorded, RecordedFigure, day_of
from busplan.english import first_of, plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.recordings import can_timing
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.statistics import LEAST_EVENTS, Floats, expanded, periodic_events, quantile

_NOT_SHOWN: Final = "A log does not show the bit rate, frames that the recorder missed, when a frame was queued"
_PERIOD: Final = "cycle.period_us"
_BESIDE_SYNC: Final = ", commands that are always late by whole periods, or the nodes' own time"
_ROUNDING_US: Final = 1.0
_CLASSICAL: Final = "classical CAN"


def recorded(network: Network, path: Path, *, share: float, channel: str | None, progress: Progress) -> Recorded:
    """Compare a CAN log with the plan, a network of plain numbers.

    The log is of `candump -l`, ASC, BLF or TRC, or a capture of SocketCAN; of several channels `channel` names one.
    Jitter is to hold for a share of the frames, 0.5..1. A log without frames, or of two clocks, raises a BusplanError.
    """
    frames = read_can(path, channel=channel, progress=progress)
    try:
        log = _Log(network, frames, share)
    except BusplanError as error:
        raise BusplanError(f"{path}: {error}") from None
    day = day_of(int(frames.start_s * 1e9))
    compared = Recorded(tuple(log.figures()), tuple(log.remarks()), log.edits, day, tuple(log.shows_nothing()))
    return compared.unless_synthetic(frames.synthetic)


class _Log:
    """A log beside the plan."""

    def __init__(self, network: Network, frames: CanFrames, share: float) -> None:
        self.network, self.frames, self.share = network, frames, share
        self.cycle = can_cycle(network, WORST_STUFFING)
        self.traffic = self.cycle.traffic
        self.bit_us = bit_us(self.traffic.bit_rate_kbit_s)
        self.edits: dict[str, Any] = {}
        self.stretch = can_timing.longest_stretch(frames)
        self.taken, self.times_us = self.stretch.taken, self.stretch.times_us
        self.by_identifier = can_timing.frames_by_identifier(frames, self.stretch)
        self.unplanned = dict(self.by_identifier)
        self.unseen: list[str] = []
        self.senders = SenderNames(network, streams(self.traffic))
        self.pdos: list[SentPdos] = []
        """PDOs beside their SYNCs, by identifier; none before they were compared."""
        self.messages = {message.name: message for message in network.profile.message}
        self.least_bit_rate = can_timing.least_bit_rate(frames, self.stretch)
        self.step_us = can_timing.step_us(self.stretch)
        rates = {
            "bit_rate_kbit_s": self.traffic.bit_rate_kbit_s,
            "data_bit_rate_kbit_s": self.traffic.data_bit_rate_kbit_s,
        }
        wire_us = wire_times(frames, self.taken, **rates).least_us
        self.stamp_error_us = self.step_us + can_timing.late_stamps_us(self.stretch, wire_us)
        """Largest error of a stamp: the step of stamps, and what frames come closer than the bus allows [us]."""
        self.message_log = MessageLog(frames, senders=self.senders, share=share, stamp_error_us=self.stamp_error_us)

    @property
    def has_switch(self) -> bool:
        """Whether the plan has a data bit rate of CAN FD."""
        return bool(self.traffic.data_bit_rate_kbit_s)

    def figures(self) -> Iterator[RecordedFigure]:
        """Figures of the log beside those of the plan."""
        least = self.least_bit_rate
        if least.likely:
            yield RecordedFigure(
                "bit rate that the frames need",
                "kbit/s",
                self.traffic.bit_rate_kbit_s,
                least.likely,
                (least.likely - least.surely) / SURE,
                "at most",
                len(self.taken),
                "bus.bit_rate_kbit_s",
            ).located(self.frames.events(least.rates, self.taken))
        yield from self._load()
        errors = self._missed("error frames", self.frames.errors, len(self.times_us) + self.frames.errors)
        yield errors.located(self.frames.error_events())
        yield from self._emergencies()
        yield from self._cycles()
        responses = {(answer.group, answer.name): answer.phases for answer in self.cycle.latencies()}
        unstuffed = streams(replace(self.traffic, is_stuffed=False))
        for stream, shortest, label in zip(self.senders.sent, unstuffed, self.senders.labels, strict=True):
            worst_us = responses.get((stream.group, stream.name), {}).get("worst_response_us", inf)
            yield from self._stream(stream, label, shortest.frame_us, worst_us)
            yield from self._response(stream, label, worst_us)
        count = len(self.taken)
        if unseen := len(self.unseen):
            hidden = f"never in the log: {first_of(self.unseen, can_timing.LISTED)}"
            yield _limited("frames of the plan never in the log", 0, unseen, count, hidden=hidden)
        unplanned = joined(sent.frames for sent in self.unplanned.values())
        note = first_of([f"{sent.identifier:#x}" for sent in self.unplanned.values()], can_timing.LISTED)
        figure = _limited("frames of no message of the plan", 0, len(unplanned), len(unplanned), note=note)
        yield self._located(figure, unplanned)

    def shows_nothing(self) -> Iterator[str]:
        """Reasons why the log as a whole shows no machine within its plan."""
        if max(len(sent.times_us) for sent in self.by_identifier.values()) < LEAST_EVENTS:
            yield f"no identifier comes {LEAST_EVENTS} times: the log is too short"
        if not self.step_us:
            yield "all frames have one stamp"
        elif reason := can_timing.stamps_of_no_bus(self.least_bit_rate.likely):
            yield reason
        period_us = self.traffic.period_us
        if self.traffic.has_cycle and 2 * self.step_us > period_us:
            yield f"its stamps have steps of {self.step_us:,.0f} us, and a cycle lasts {period_us:,.0f}"

    def _located(self, figure: RecordedFigure, frames: Ints, values: Floats | None = None) -> RecordedFigure:
        """The figure with the moments of frames, by their values, or of frames that are counted."""
        return figure.located(self.frames.events(np.ones(len(frames)) if values is None else values, frames))

    def _missed(
        self, quantity: str, number: int | None, events: int, *, note: str = "", hidden: str = ""
    ) -> RecordedFigure:
        most = self.network.profile.limits.missed_cycles
        return _limited(quantity, most, number, events, "limits.missed_cycles", note=note, hidden=hidden)

    def _load(self) -> Iterator[RecordedFigure]:
        """Mean load and that of the fullest second, the planned load, and the frames with the most stuff bits and none.

        A second may be fuller than the plan, which is a mean over longer times: it is not judged.
        """
        count, is_fd = len(self.taken), self.frames.is_fd[self.taken]
        span_us = float(self.times_us[-1] - self.times_us[0])
        is_whole = self.has_switch or not self.frames.switched[self.taken].any()
        if count < 2 or span_us <= 0 or (is_fd.all() and not is_whole):  # noqa: PLR2004 - a distance
            return
        nominal, data = self.traffic.bit_rate_kbit_s, self.traffic.data_bit_rate_kbit_s
        wire_us, worst_us, none_us, _ = wire_times(
            self.frames, self.taken, bit_rate_kbit_s=nominal, data_bit_rate_kbit_s=data
        )
        # The first frame ended with its stamp.
        load, worst, none = (float(us[1:].sum()) / span_us for us in (wire_us, worst_us, none_us))
        # A log begins and ends anywhere: it may have a frame more of each identifier than its length has periods.
        keys = self.frames.identifiers[self.taken] * 2 + self.frames.extended[self.taken]
        more_us = wire_us[np.unique(keys, return_index=True)[1]].sum()
        stuffing_us = (worst_us - none_us)[1:][is_fd[1:]].sum() / 2
        doubt = float(more_us + load * self.stamp_error_us + stuffing_us) / span_us
        note = "mean; exact bits of each classical frame, at the bit rate of the profile"
        planned = self.cycle.load
        if is_whole:
            yield RecordedFigure("load", "share", planned, load, doubt, "at most", count, note=note)
        else:
            note = f"{note}; without frames of CAN FD that switch"
            yield RecordedFigure("load", "share", planned, load, None, "shown", count, note=note)
        loads = can_timing.second_loads(self.times_us, wire_us)
        fullest = RecordedFigure("load, fullest second", "share", planned, float(loads.max()), None, "shown", count)
        yield self._located(fullest, self.taken[: len(loads)], loads)
        yield RecordedFigure("load, worst stuffing of these frames", "share", None, worst, None, "shown", count)
        yield RecordedFigure("load, no stuffing of these frames", "share", None, none, None, "shown", count)
        classical, possible_us = ~is_fd, float((worst_us - none_us)[~is_fd].sum())
        if possible_us:
            stuffing, number = float((wire_us - none_us)[classical].sum()) / possible_us, int(classical.sum())
            yield RecordedFigure("stuff bits of the possible ones", "share", None, stuffing, None, "shown", number)

    def _cycles(self) -> Iterator[RecordedFigure]:
        """SYNCs and PDOs that are missing, and the last PDO after its SYNC."""
        if not self.traffic.has_sync:
            yield from self._requests()
            return
        sync = self.senders.sent[0]
        sent = self.by_identifier.get((sync.first, sync.identifier_bits > BASE_BITS))
        periods = None if sent is None else periodic_events(sent.times_us)
        if sent is None or periods is None:
            few = f"SYNC comes {plural(0 if sent is None else len(sent.times_us), 'time')}"
            yield self._missed("cycles without SYNC", None, 0, hidden=few)
            return
        figure = self._missed("cycles without SYNC", periods.missing, int(periods.places[-1]) + 1)
        before, without = periods.gaps
        yield self._located(figure, sent.frames[before], without)
        self.pdos += pdos_beside_sync(sent, periods, sync.period_us, self.senders, self.by_identifier)
        due = sum(pdos.due for pdos in self.pdos)
        for sort in ("missing", "twice"):
            lost = {pdos.name: getattr(pdos, sort) for pdos in self.pdos}
            notes = [f"{len(frames):,} of {name}" for name, frames in lost.items() if len(frames)]
            # Several may be missing at one SYNC.
            frames, number = np.unique(joined(lost.values()), return_counts=True)
            figure = self._missed(f"PDOs {sort}", int(number.sum()), due, note=first_of(notes, can_timing.LISTED))
            yield self._located(figure, frames, number.astype(np.float64))
        yield from self._after_sync("last PDO after SYNC", self.pdos, self._last_us, self._doubts, _PERIOD)
        yield from self._host()

    def _host(self) -> Iterator[RecordedFigure]:
        """The first command behind the last feedback: a log holds the adapter, the host and the adapter in one."""
        commands = [pdos for pdos in self.pdos if pdos.stream.name == NAMES["write"]]
        cycles = int(joined(pdos.cycles for pdos in self.pdos).max(initial=-1)) + 1
        first_us, last_us, number = np.full(cycles, inf), np.full(cycles, -inf), np.zeros(cycles)
        first = np.zeros(cycles, dtype=np.int64)
        for pdos in self.pdos:
            if pdos.stream.name == NAMES["write"]:
                is_first = pdos.late_us < first_us[pdos.cycles]
                first_us[pdos.cycles[is_first]], first[pdos.cycles[is_first]] = (
                    pdos.late_us[is_first],
                    pdos.frames[is_first],
                )
            else:
                np.maximum.at(last_us, pdos.cycles, pdos.late_us)
            np.add.at(number, pdos.cycles, 1)
        is_whole = number == len(self.pdos)
        gaps_us = (first_us - last_us)[is_whole]
        if not (isinstance(self.cycle, PdoCycle) and self.cycle.waits_for_host and len(gaps_us)):
            return
        us, adapter_us = self.cycle.by_term, self.traffic.adapter_us
        own_us = self.traffic.host_us + adapter_us
        waits_us = us["cycle_blocking_us"] + us["cycle_interference_us"]
        gap = quantile(gaps_us, self.share)
        # A plan that gives none of them rests on none, and is held to its cycle alone.
        is_planned = self.network.profile.bus.model_fields_set & {"host_us", "adapter", "host_write_us", "host_read_us"}
        doubts_us = (doubt.us for doubt in self.cycle.doubts() if doubt.key.startswith("bus."))
        found = RecordedFigure(
            "first command after the last feedback",
            "us",
            finite(own_us + waits_us + max(pdos.stream.frame_us for pdos in commands)),
            gap.value,
            expanded(*doubts_us, gap.uncertainty or 0.0, stamps_us=self.stamp_error_us),
            "at most" if is_planned else "shown",
            len(gaps_us),
            "bus.host_us",
            "planned: bus.host_read_us, bus.host_us, bus.host_write_us, the wait for other frames and its own",
        )
        if found.verdict == "outside":
            # Only their sum counts, so what the adapter's keys do not give is the host's. So is what other frames add.
            shortest = streams(replace(self.traffic, is_stuffed=False))
            least_us = min(stream.frame_us for stream in shortest if stream.name == NAMES["write"])
            doubt_us = expanded(gap.uncertainty or 0.0, stamps_us=self.stamp_error_us) or 0.0
            self.edits["bus.host_us"] = ceil(10 * (gap.value - adapter_us - least_us)) / 10
            self.edits |= {"bus.host_grade": "measured", "bus.host_uncertainty_us": round(doubt_us / 2, 4)}
        yield self._located(found, first[is_whole], gaps_us)

    @property
    def _last_us(self) -> float:
        """Time that a cycle takes from SYNC on, late or not, by the plan [us]."""
        return float(self.cycle.required_us - self.network.nonperiodic_us - self.traffic.sync_jitter_us)

    @property
    def _doubts(self) -> list[float]:
        """Standard uncertainties of this time [us]."""
        return [doubt.us for doubt in self.cycle.doubts()]

    def _after_sync(
        self, quantity: str, some: Sequence[SentPdos], planned_us: float, doubts: Iterable[float], key: str
    ) -> Iterator[RecordedFigure]:
        """Time of the last of some PDOs of each cycle after SYNC; `doubts` are standard uncertainties [us]."""
        if not any(len(pdos.frames) for pdos in some):
            return
        last_us = last_pdos_us(some)
        latest = quantile(last_us, self.share)
        figure = RecordedFigure(
            quantity,
            "us",
            finite(planned_us),
            latest.value,
            expanded(*doubts, latest.uncertainty or 0.0, stamps_us=self.stamp_error_us),
            "at most",
            len(last_us),
            key,
            f"the latest: {max(some, key=lambda pdos: pdos.late_us.max(initial=0.0)).name}",
        )
        yield self._located(figure, joined(pdos.frames for pdos in some), joined(pdos.late_us for pdos in some))

    def _emergencies(self) -> Iterator[RecordedFigure]:
        """Emergencies of nodes, where a network of CANopen has any."""
        if not self.senders.by_node_id or self.senders.sent[0].first != EMERGENCY:
            return
        cyclic = {identifier for _, identifier in self.senders.pdos()}
        others = (sent.frames for sent in self.by_identifier.values() if sent.identifier not in cyclic)
        found = emergencies(self.frames, joined(others))
        if not len(found.frames):
            return
        for identifier in np.unique(self.frames.identifiers[found.frames]).tolist():
            self.unplanned.pop((identifier, False), None)
        is_error = found.codes != 0
        note = found.words(self.frames, self.senders.by_node_id, can_timing.LISTED)
        figure = self._missed("emergencies", int(is_error.sum()), len(found.frames), note=note)
        yield self._located(figure, found.frames[is_error])

    def _response(self, stream: Stream, label: str, worst_us: float) -> Iterator[RecordedFigure]:
        """Response of a PDO after its SYNC."""
        quantity = f"{label}: response"
        sent = [pdos for pdos in self.pdos if pdos.stream == stream]
        if not sent:
            return
        if stream.name == NAMES["write"]:
            # Behind the last command only the slowest execution follows.
            slowest_us = max(group.write_execution_us + group.worst_extra_us for group in self.network.groups)
            yield from self._after_sync(quantity, sent, self._last_us - slowest_us, self._doubts, _PERIOD)
            return
        group = next(group for group in self.network.groups if group.name == stream.group)
        planned_us = group.read_execution_us + group.worst_extra_us + worst_us
        yield from self._after_sync(quantity, sent, planned_us, [group.read_uncertainty_us], group.key("execution"))

    def _requests(self) -> Iterator[RecordedFigure]:
        """Requests and answers of a cycle without SYNC."""
        if not isinstance(self.cycle, RequestCycle):
            return
        log = RequestLog(
            self.cycle,
            self.frames,
            self.stretch,
            self.by_identifier,
            senders=self.senders,
            share=self.share,
            stamp_error_us=self.stamp_error_us,
        )
        yield from log.figures(self._missed)
        self.edits |= log.edits

    def _stream(self, stream: Stream, label: str, shortest_us: float, worst_us: float) -> Iterator[RecordedFigure]:
        """Period, jitter, data and format of a message or of SYNC, and response of a message; else data and format."""
        is_extended = stream.identifier_bits > BASE_BITS
        identifiers = range(stream.first, stream.last + 1)
        found = {identifier: self.by_identifier.get((identifier, is_extended)) for identifier in identifiers}
        recorded = [sent for sent in found.values() if sent is not None]
        for sent in recorded:
            self.unplanned.pop((sent.identifier, is_extended), None)
        missing = [identifier for identifier, sent in found.items() if sent is None]
        self.unseen += [self.senders.name(stream, identifier) for identifier in missing] if recorded else [label]
        if not recorded:
            return
        message = self.messages[stream.name] if stream.is_message else None
        key = f"message.{stream.name}" if message else ""
        early_us = spread_us(stream, shortest_us, worst_us)
        if message:
            yield from self.message_log.message(stream, label, recorded, early_us)
        elif stream.name == SYNC:
            yield from self.message_log.sync(stream, recorded[0], early_us)
        self.edits |= self.message_log.edits
        count, most_bytes = sum(len(sent.times_us) for sent in recorded), max(sent.most_bytes for sent in recorded)
        planned = _format(message.fd, message.brs) if message else _format(self.has_switch, self.has_switch)
        planned_bytes = stream.data_bytes
        if planned != _CLASSICAL:
            planned_bytes = next(length for length in FD_LENGTHS if length >= planned_bytes)
        if message and most_bytes > planned_bytes:
            self.edits[f"{key}.payload_bytes"] = most_bytes
        bytes_key = key and f"{key}.payload_bytes"
        data = RecordedFigure(f"{label}: data", "bytes", planned_bytes, most_bytes, None, "at most", count, bytes_key)
        all_frames = joined(sent.frames for sent in recorded)
        yield self._located(data, all_frames, self.frames.sizes[all_frames].astype(np.float64))
        formats = [(_format(sent.is_fd, sent.switches), sent.frames) for sent in recorded]
        unlike = [(name, frames) for name, frames in formats if name != planned]
        if unlike:
            note = f"{unlike[0][0]} recorded, {planned} planned"
            frames = joined(frames for _, frames in unlike)
            figure = _limited(f"{label}: frames of another format", 0, len(frames), count, key, note=note)
            yield self._located(figure, frames)
        if message:
            yield from self.message_log.response(stream, label, recorded, shortest_us, worst_us)

    def remarks(self) -> Iterator[str]:
        """Sentences on what the log has beside the figures."""
        frames = self.frames
        yield from can_timing.faults(frames, self.stretch)
        fd, switched = (int(np.count_nonzero(flags)) for flags in (frames.is_fd, frames.switched))
        if fd:
            left = f", {switched:,} not counted in the load: the plan has no data bit rate"
            left = left if switched and not self.has_switch else ""
            yield f"{plural(fd, 'frame')} of CAN FD: in the load with half of the possible stuff bits{left}."
        if frames.remote:
            yield f"{plural(frames.remote, 'remote frame')}: the length code is shown as data."
        if self.stamp_error_us > self.step_us + _ROUNDING_US:
            late_us = self.stamp_error_us - self.step_us
            yield f"Frames come up to {late_us:.0f} us closer than the bus allows: stamps are late, and U holds it."
        if self.step_us > 1:
            yield f"Stamps have steps of {self.step_us:g} us."
        yield f"{_NOT_SHOWN}{_BESIDE_SYNC if self.traffic.has_sync else ''}."


def _limited(
    quantity: str, most: int, number: int | None, events: int, key: str = "", *, note: str = "", hidden: str = ""
) -> RecordedFigure:
    """A number that must not exceed another one, without doubt."""
    return RecordedFigure(quantity, "1", most, number, None, "at most", events, key, note, hidden=hidden)


def _format(is_fd: bool, switches: bool) -> str:
    if not is_fd:
        return _CLASSICAL
    return "CAN FD" if switches else "CAN FD without a switch of bit rate"
