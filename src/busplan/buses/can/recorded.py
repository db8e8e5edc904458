"""A CAN log beside the plan: period, jitter and data of every message, bits as they were, load, and bursts."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np

from busplan.buses.can.constants import BASE_BITS, FD_FRAME_BYTES, FRAME_BYTES
from busplan.buses.can.cycle import WORST, CanCycle
from busplan.buses.can.equations import bit_us, frame_us
from busplan.buses.can.streams import Stream, streams
from busplan.buses.can.traffic import SYNC
from busplan.buses.network import Network
from busplan.buses.recorded import CLOCK_TOLERANCE, Recorded, RecordedFigure, Sense, day_of
from busplan.elementwise import plain
from busplan.progress import Progress
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.can_messages import SentFrames, faults, listed, longest_stretch, sent_messages
from busplan.recordings.statistics import Floats, expanded, lateness, quantile
from busplan.recordings.words import counted

_NOT_SHOWN: Final = (
    "Not shown by a log: the bit rate, frames that the recorder did not take, when a frame was queued, and the nodes' "
    "own time."
)
_GAP_BITS: Final = 3
"""Idle bits between two frames that still follow each other at once, beside the step of the stamps."""


def recorded(network: Network, path: Path, *, share: float, progress: Progress) -> Recorded:
    """Compare a CAN log with the plan.

    Parameters
    ----------
    network
        The plan, of plain numbers.
    path
        A log of `candump -l`, ASC, BLF or TRC.
    share
        Share of the frames that jitter is to hold for, 0.5..1.
    progress
        Called with the bytes read and those of the file.

    Raises
    ------
    BusplanError
        No log of a single channel with frames.
    """
    frames = read_can(path, progress=progress)
    seen = _Seen(network, frames, share)
    return Recorded(tuple(seen.figures()), tuple(seen.remarks()), seen.edits, day_of(int(frames.start_s * 1e9)))


class _Seen:
    """A log, with what is derived of it once."""

    def __init__(self, network: Network, frames: CanFrames, share: float) -> None:
        self.network, self.frames, self.share = network, frames, share
        self.cycle = CanCycle(network, WORST)
        self.bit_us = plain(bit_us(self.cycle.traffic.bit_rate_kbit_s))
        self.edits: dict[str, Any] = {}
        self.stretch = longest_stretch(frames)
        self.taken, self.times_us = self.stretch.taken, self.stretch.times_us
        self.stamp_us = float(np.diff(self.times_us)[np.diff(self.times_us) > 0].min(initial=np.inf))
        self.by_identifier = sent_messages(frames, self.stretch)
        self.streams = streams(self.cycle.traffic, is_stuffed=True)
        self.unplanned = dict(self.by_identifier)
        self.unseen: list[str] = []

    def figures(self) -> Iterator[RecordedFigure]:
        """All figures."""
        yield from self._load()
        yield from self._cycle()
        responses = {(each.group, each.name): each.phases for each in self.cycle.latencies()}
        unstuffed = streams(self.cycle.traffic, is_stuffed=False)
        labels = _labels(self.streams)
        for stream, least, label in zip(self.streams, unstuffed, labels, strict=True):
            response = responses.get((stream.group, stream.name))
            yield from self._stream(stream, label, _spread_us(stream, plain(least.frame_us), response))
        frames = sum(len(sent.times_us) for sent in self.unplanned.values())
        note = listed([f"{sent.identifier:#x}" for sent in self.unplanned.values()])
        yield RecordedFigure("frames of no message of the plan", "1", 0, frames, None, "at most", frames, note=note)

    def _wire_us(self, *, is_stuffed: bool) -> Floats:
        """Each frame on the wire with the most stuff bits or with none [us]."""
        frames, traffic, taken = self.frames, self.cycle.traffic, self.taken
        us = np.zeros(len(taken))
        for is_fd in (False, True):
            data_bit_rate = plain(traffic.data_bit_rate_kbit_s) if is_fd else 0.0
            own = np.flatnonzero(frames.is_fd[taken] == is_fd)
            if not len(own) or (is_fd and not data_bit_rate):
                continue
            sizes = np.minimum(frames.sizes[taken[own]], FD_FRAME_BYTES if is_fd else FRAME_BYTES)
            us[own] = frame_us(
                sizes,
                identifier_bits=np.where(frames.extended[taken[own]], 29, BASE_BITS),
                bit_rate_kbit_s=traffic.bit_rate_kbit_s,
                data_bit_rate_kbit_s=data_bit_rate,
                is_stuffed=is_stuffed,
            )
        return us

    def _load(self) -> Iterator[RecordedFigure]:
        """Load as it was, beside that of the plan and those of the same frames with worst and without stuff bits."""
        count, is_fd = len(self.taken), self.frames.is_fd[self.taken]
        span_us = float(self.times_us[-1] - self.times_us[0])
        if count < 2 or span_us <= 0:  # noqa: PLR2004 - a distance
            return
        worst_us, none_us = self._wire_us(is_stuffed=True), self._wire_us(is_stuffed=False)
        own_us = np.where(is_fd, worst_us, self.frames.bits[self.taken] * self.bit_us)
        # The first frame ended with its stamp.
        load, worst, none = (float(us[1:].sum()) / span_us for us in (own_us, worst_us, none_us))
        note = "exact bits of each frame, at the bit rate of the profile"
        sense: Sense = "at most"
        if is_fd.any() and not self.has_fd:
            if is_fd.all():
                return
            note, sense = f"{note}; without frames of CAN FD", "shown"
        # A log begins and ends anywhere: it may have a frame more of each identifier than its length has periods.
        _, each = np.unique(
            self.frames.identifiers[self.taken] * 2 + self.frames.extended[self.taken], return_index=True
        )
        doubt = float(own_us[each].sum()) / span_us if sense == "at most" else None
        yield RecordedFigure("load", "share", plain(self.cycle.load), load, doubt, sense, count, note=note)
        yield RecordedFigure("load, worst stuffing of these frames", "share", None, worst, None, "shown", count)
        yield RecordedFigure("load, no stuffing of these frames", "share", None, none, None, "shown", count)
        possible_us = float((worst_us - none_us)[~is_fd].sum())
        if possible_us:
            stuffing = float((own_us - none_us)[~is_fd].sum()) / possible_us
            number = int(np.count_nonzero(~is_fd))
            yield RecordedFigure("stuff bits of the possible ones", "share", None, stuffing, None, "shown", number)
        idle_us = np.diff(self.times_us) - own_us[1:]
        gap_us = _GAP_BITS * self.bit_us
        apart = np.flatnonzero(idle_us > gap_us + min(self.stamp_us, gap_us))
        runs = np.diff(np.concatenate(([-1], apart, [count - 1])))
        yield RecordedFigure("frames at once behind each other", "1", None, int(runs.max()), None, "shown", count)

    def _cycle(self) -> Iterator[RecordedFigure]:
        """The last PDO behind its SYNC."""
        if not self.cycle.traffic.has_cycle:
            return
        sync = next(stream for stream in self.streams if stream.name == SYNC)
        known = self.by_identifier.get((_whole(sync.first), sync.identifier_bits > BASE_BITS))
        pdos = [
            sent.times_us
            for stream in self.streams
            if not stream.is_message and stream.name != SYNC
            for sent in self._of(stream)
        ]
        if known is None or not pdos:
            return
        times_us = np.sort(np.concatenate(pdos))
        number = np.searchsorted(known.times_us, times_us, side="right") - 1
        times_us, number = times_us[number >= 0], number[number >= 0]
        if not len(number):
            return
        last = np.flatnonzero(np.diff(np.concatenate((number, [-1]))))
        behind = quantile(times_us[last] - known.times_us[number[last]], self.share)
        planned_us = _finite(plain(self.cycle.required_us) - plain(self.network.nonperiodic_us))
        doubt = expanded(*(plain(doubt.us) for doubt in self.cycle.doubts()), behind.uncertainty or 0.0)
        yield RecordedFigure(
            "last PDO behind SYNC",
            "us",
            planned_us,
            behind.value,
            doubt,
            "at most",
            len(last),
        )

    def _of(self, stream: Stream) -> list[SentFrames]:
        """What was recorded of its identifiers."""
        is_extended = stream.identifier_bits > BASE_BITS
        first, last = _whole(stream.first), _whole(stream.last)
        return [
            sent
            for (identifier, extended), sent in self.by_identifier.items()
            if extended == is_extended and first <= identifier <= last
        ]

    def _stream(self, stream: Stream, label: str, spread_us: float | None) -> Iterator[RecordedFigure]:
        each = self._of(stream)
        for sent in each:
            self.unplanned.pop((sent.identifier, stream.identifier_bits > BASE_BITS), None)
        missing = _whole(stream.identifiers) - len(each)
        if missing:
            self.unseen.append(label if not each else f"{missing} of {label}")
        if not each:
            return
        several = len(each) > 1
        repeated = [sent for sent in each if len(sent.times_us) > 1]
        key = f"message.{stream.name}" if stream.is_message else ""
        if repeated:
            most_often = min(repeated, key=lambda sent: sent.mean_us)
            yield self._period(stream, label, most_often, key, spread_us, several=several)
            yield self._scatter(stream, label, repeated, key, spread_us, several=several)
        fullest = max(each, key=lambda sent: sent.most_bytes)
        planned_bytes = plain(stream.data_bytes)
        if key and fullest.most_bytes > planned_bytes:
            self.edits[f"{key}.payload_bytes"] = fullest.most_bytes
        yield RecordedFigure(
            f"{label}: data",
            "bytes",
            planned_bytes,
            fullest.most_bytes,
            None,
            "at most",
            sum(len(sent.times_us) for sent in each),
            key and f"{key}.payload_bytes",
        )

    def _period(
        self, stream: Stream, label: str, sent: SentFrames, key: str, spread_us: float | None, *, several: bool
    ) -> RecordedFigure:
        """Mean distance of the frames, of the identifier that comes most often."""
        planned_us, count = plain(stream.period_us), len(sent.times_us)
        # At worst the first frame was the latest that it may be, and the last one the earliest.
        scatter_us = float(np.ptp(sent.grid.late_us)) if sent.grid else planned_us
        scatter_us = scatter_us if spread_us is None else spread_us
        doubt = expanded(scatter_us / (count - 1) / 2, CLOCK_TOLERANCE * planned_us / 3**0.5)
        figure = RecordedFigure(
            f"{label}: period",
            "us",
            planned_us,
            sent.mean_us,
            doubt,
            "at least",
            count,
            f"{key}.period_us" if key else "cycle.period_us",
            _named(sent) if several else "",
        )
        if key and figure.verdict == "outside":
            self.edits[f"{key}.period_us"] = round(sent.mean_us, 1)
        return figure

    def _scatter(
        self, stream: Stream, label: str, each: list[SentFrames], key: str, spread_us: float | None, *, several: bool
    ) -> RecordedFigure:
        """Jitter of the arrival of a periodic message; of others the shortest distance."""
        planned_key = f"{key}.jitter_us" if key else ""
        if all(sent.grid is not None for sent in each):
            found = [(lateness(sent.grid, self.share), sent) for sent in each if sent.grid is not None]
            late, sent = max(found, key=lambda pair: pair[0].value)
            doubt = expanded(late.uncertainty or (sent.grid.doubt_us if sent.grid else 0.0))
            return RecordedFigure(
                f"{label}: jitter of the arrival",
                "us",
                spread_us,
                late.value,
                None if spread_us is None else doubt,
                "shown" if spread_us is None else "at most",
                len(sent.times_us),
                planned_key,
                _named(sent) if several else "",
            )
        nearest = [(-quantile(-np.diff(sent.times_us), self.share).value, sent) for sent in each]
        apart_us, sent = min(nearest, key=lambda pair: pair[0])
        planned_us = None if spread_us is None else max(plain(stream.period_us) - spread_us, 0.0)
        return RecordedFigure(
            f"{label}: shortest distance",
            "us",
            planned_us,
            apart_us,
            None,
            "shown" if planned_us is None else "at least",
            len(sent.times_us) - 1,
            planned_key,
            "not periodic" + (f", {_named(sent)}" if several else ""),
        )

    @property
    def has_fd(self) -> bool:
        """Whether the plan has a data phase of CAN FD."""
        return bool(plain(self.cycle.traffic.data_bit_rate_kbit_s))

    def remarks(self) -> Iterator[str]:
        """What the log has beside the figures."""
        frames = self.frames
        yield from faults(frames, self.stretch)
        if self.unseen:
            yield f"In the plan and not in the log: {', '.join(self.unseen)}."
        fd = int(np.count_nonzero(frames.is_fd))
        if fd:
            words = "in the load with the most stuff bits" if self.has_fd else "in no load, for the plan has none"
            yield f"{counted(fd, 'frame')} of CAN FD: {words}."
        if frames.remote:
            yield f"{counted(frames.remote, 'remote frame')}: the length code is shown as data."
        if frames.errors:
            yield f"{counted(frames.errors, 'error frame')}: in no load."
        yield _NOT_SHOWN


def _labels(each: Sequence[Stream]) -> list[str]:
    """Name of each stream; those of a PDO with several frames are numbered."""
    names = Counter(stream.label for stream in each)
    seen: Counter[str] = Counter()
    labels = []
    for stream in each:
        seen[stream.label] += 1
        labels.append(f"{stream.label} {seen[stream.label]}" if names[stream.label] > 1 else stream.label)
    return labels


def _whole(number: Any) -> int:
    """A plain number that is whole."""
    return int(plain(number))


def _spread_us(stream: Stream, least_us: float, response: Mapping[str, Any] | None) -> float | None:
    """How much the plan lets the arrival of SYNC or a message scatter: R less the shortest frame [us]."""
    if response is None or not (stream.is_message or stream.name == SYNC):
        return None
    return _finite(max(plain(response["worst_response_us"]) - least_us, 0.0))


def _finite(us: float) -> float | None:
    """A planned time; None where a bus that is too full has none."""
    return us if isfinite(us) else None


def _named(sent: SentFrames) -> str:
    return f"identifier {sent.identifier:#x}"
