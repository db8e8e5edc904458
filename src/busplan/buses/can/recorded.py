"""A CAN log beside the plan: the bit rate, the load, every cycle, and the period, bursts and data of every message."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.can.cycle import WORST, CanCycle
from busplan.buses.can.equations import BASE_BITS, FD_FRAME_BYTES, FD_LENGTHS, FRAME_BYTES, bit_us, frame_us
from busplan.buses.can.frames import SYNC, Stream, streams
from busplan.buses.network import Network
from busplan.buses.rule import CLOCK_TOLERANCE, SURE, Recorded, RecordedFigure, Sense, day_of
from busplan.elementwise import plain
from busplan.english import first_of, plural
from busplan.progress import Progress
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.can_timing import (
    LISTED,
    SentFrames,
    event_model,
    faults,
    least_bit_rate,
    longest_stretch,
    mean_period,
    sent_messages,
    stamps_of_no_bus,
    step_us,
)
from busplan.recordings.statistics import LEAST_EVENTS, Floats, ahead, expanded, grid, lateness, quantile

_NOT_SHOWN: Final = (
    "Not shown by a log: the bit rate, frames that the recorder did not take, when a frame was queued, commands that "
    "are always late by whole periods, and the nodes' own time."
)
_GAP_BITS: Final = 3
"""Idle bits between two frames that still follow each other at once, beside the step of the stamps."""
_MADE_UP: Final = 10
"""Due cycles within which a PDO that is missing may still come."""
_BLOCK: Final = 50
"""Due cycles over which PDOs of every n-th SYNC keep their place among the SYNCs."""
_ROUNDING_US: Final = 1.0
_CLASSICAL: Final = "classical CAN"
_TOO_FEW: Final = f"fewer than {LEAST_EVENTS} frames"


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
    return Recorded(
        tuple(seen.figures()),
        tuple(seen.remarks()),
        seen.edits,
        day_of(int(frames.start_s * 1e9)),
        tuple(seen.shows_nothing()),
    )


class Due(NamedTuple):
    """PDOs of an identifier beside the SYNCs that asked for them."""

    cycles: npt.NDArray[np.int64]
    """Number of the SYNC that asked for each PDO."""
    late_us: Floats
    """Each PDO after it [us]."""
    due: int
    """PDOs that were due."""
    missing: int
    twice: int


def due_pdos(sync_us: Floats, times_us: Floats, *, every: int, is_sent: npt.NDArray[np.bool_] | None = None) -> Due:
    """Tell which SYNC asked for each PDO.

    A PDO comes once for each SYNC that it is due at. Two after one SYNC, where one before had none, are late: they came
    in their order. One that never comes is missing. A lag of whole periods that never changes cannot be seen.

    Parameters
    ----------
    sync_us
        Ascending times of SYNC, one a period, n of them [us].
    times_us
        Ascending times of the PDO, m of them, each after some SYNC [us].
    every
        It is due at every n-th SYNC.
    is_sent
        Whether each SYNC was sent; PDOs may come for those that were not, and need not. By default all were.

    Examples
    --------
    The second of five is late, so that it comes with the third; the fifth SYNC is the last, and nobody knows of it:

    >>> due_pdos(np.arange(5) * 100.0, np.array([30.0, 210, 230, 330]), every=1)[1:]
    (array([ 30., 110.,  30.,  30.]), 4, 0, 0)
    """
    sent = np.ones(len(sync_us), dtype=np.bool_) if is_sent is None else is_sent
    asked = _due_at(sync_us, times_us, every, sent)
    cycles = np.searchsorted(sync_us[asked], times_us, side="right") - 1
    times_us, cycles = times_us[cycles >= 0], cycles[cycles >= 0]
    # After the last SYNC the log may end.
    whole = len(asked) - 1
    counts = np.bincount(cycles, minlength=len(asked))[:whole]
    first = np.searchsorted(cycles, np.arange(len(asked) + 1))
    missing: list[int] = []
    twice = 0
    for place in np.flatnonzero(counts != 1).tolist():
        if not counts[place]:
            missing += [place] if sent[asked[place]] else []
            continue
        for number in range(int(counts[place]) - 1):
            if not missing or place - missing[-1] > _MADE_UP:
                # The log may begin with a PDO of a SYNC before it.
                twice += int(counts[place]) - 1 - number if place else 0
                break
            cycles[first[missing.pop() + 1] : first[place + 1] - 1 - number] -= 1
    return Due(asked[cycles], times_us - sync_us[asked[cycles]], int(sent[asked[:whole]].sum()), len(missing), twice)


def _due_at(sync_us: Floats, times_us: Floats, every: int, is_sent: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Numbers of the SYNCs at which a PDO of every n-th is due: where most of some neighbours come.

    Nodes count the SYNCs that they get, a host counts periods: of both the one is taken by which more PDOs are due.
    """
    count = np.arange(len(sync_us))
    if every == 1:
        return count
    comes = np.bincount(np.searchsorted(sync_us, times_us, side="right"), minlength=len(sync_us) + 1)[1:] > 0
    found = (_most_common(comes, number % every, every) for number in (count, is_sent.cumsum()))
    return max(found, key=lambda due: int(np.count_nonzero(comes[due])))


def _most_common(comes: npt.NDArray[np.bool_], rest: npt.NDArray[np.int64], every: int) -> npt.NDArray[np.int64]:
    """Numbers of the SYNCs whose rest is the most common one of their block among those after which a PDO comes."""
    blocks = np.array_split(np.arange(len(rest)), max(len(rest) // (_BLOCK * every), 1))
    most = [int(np.bincount(rest[block[comes[block]]], minlength=every).argmax()) for block in blocks]
    return np.concatenate([block[rest[block] == own] for block, own in zip(blocks, most, strict=True)])


class _Seen:
    """A log, with what is derived of it once."""

    def __init__(self, network: Network, frames: CanFrames, share: float) -> None:
        self.network, self.frames, self.share = network, frames, share
        self.cycle = CanCycle(network, WORST)
        self.bit_us = plain(bit_us(self.cycle.traffic.bit_rate_kbit_s))
        self.edits: dict[str, Any] = {}
        self.stretch = longest_stretch(frames)
        self.taken, self.times_us = self.stretch.taken, self.stretch.times_us
        self.by_identifier = sent_messages(frames, self.stretch)
        self.streams = streams(self.cycle.traffic, is_stuffed=True)
        self.unplanned = dict(self.by_identifier)
        self.unseen: list[str] = []
        self.missed_cycles = network.profile.limits.missed_cycles
        self.least_bit_rate = least_bit_rate(frames, self.stretch)
        self.step_us = step_us(self.stretch)
        self.stamp_error_us = self.step_us + self._late_stamps_us()
        """How far stamps may be wrong: their step, and what frames come closer than the bus allows [us]."""

    def _late_stamps_us(self) -> float:
        """How much closer frames come than the bus sends them, stamped at their ends or at their starts [us]."""
        sent_us = np.concatenate(([0.0], self.frames.bits[self.taken].cumsum() * self.bit_us))
        ahead_us = [wire_us - self.times_us for wire_us in (sent_us[1:], sent_us[:-1])]
        late_us = min(float((us - np.minimum.accumulate(us)).max()) for us in ahead_us)
        # A frame that no other one follows so soon may be as late, and as late again as the longest frame is.
        return late_us + float(self.frames.bits.max()) * self.bit_us if late_us > self.step_us else late_us

    def figures(self) -> Iterator[RecordedFigure]:
        """All figures."""
        yield from self._bit_rate()
        yield from self._load()
        yield RecordedFigure(
            "error frames",
            "1",
            self.missed_cycles,
            self.frames.errors,
            None,
            "at most",
            len(self.times_us) + self.frames.errors,
            "limits.missed_cycles",
        )
        yield from self._cycles()
        responses = {(each.group, each.name): each.phases for each in self.cycle.latencies()}
        unstuffed = streams(self.cycle.traffic, is_stuffed=False)
        labels = _labels(self.streams)
        for stream, least, label in zip(self.streams, unstuffed, labels, strict=True):
            response = responses.get((stream.group, stream.name))
            yield from self._stream(stream, label, self._spread_us(stream, plain(least.frame_us), response))
        if self.unseen:
            yield RecordedFigure(
                "frames of the plan never in the log",
                "1",
                0,
                len(self.unseen),
                None,
                "at most",
                len(self.taken),
                hidden=f"never in the log: {first_of(self.unseen, LISTED)}",
            )
        frames = sum(len(sent.times_us) for sent in self.unplanned.values())
        note = first_of([f"{sent.identifier:#x}" for sent in self.unplanned.values()], LISTED)
        yield RecordedFigure("frames of no message of the plan", "1", 0, frames, None, "at most", frames, note=note)

    def shows_nothing(self) -> Iterator[str]:
        """Why the log as a whole shows no machine within its plan."""
        often = max(len(sent.times_us) for sent in self.by_identifier.values())
        if often < LEAST_EVENTS:
            yield f"no identifier comes {LEAST_EVENTS} times: the log is too short"
        if not self.step_us:
            yield "all frames have one stamp"
        elif reason := stamps_of_no_bus(self.least_bit_rate.likely):
            yield reason
        period_us = plain(self.cycle.traffic.period_us) if self.cycle.traffic.has_cycle else np.inf
        if 2 * self.step_us > period_us:
            yield f"its stamps have steps of {self.step_us:,.0f} us, and a cycle lasts {period_us:,.0f}"

    def _bit_rate(self) -> Iterator[RecordedFigure]:
        least = self.least_bit_rate
        if least.likely:
            yield RecordedFigure(
                "bit rate that the frames need",
                "kbit/s",
                plain(self.cycle.traffic.bit_rate_kbit_s),
                least.likely,
                (least.likely - least.surely) / SURE,
                "at most",
                len(self.taken),
                "bus.bit_rate_kbit_s",
            )

    def _wire_us(self, *, is_stuffed: bool) -> Floats:
        """Each frame on the wire with the most stuff bits or with none [us]."""
        frames, traffic, taken = self.frames, self.cycle.traffic, self.taken
        us = np.zeros(len(taken))
        nominal, data = plain(traffic.bit_rate_kbit_s), plain(traffic.data_bit_rate_kbit_s)
        is_fd, switched = frames.is_fd[taken], frames.switched[taken]
        sorts = [(~is_fd, 0.0), (is_fd & ~switched, nominal)]
        if data:
            sorts.append((is_fd & switched, data))
        for own, rate in sorts:
            us[own] = frame_us(
                np.minimum(frames.sizes[taken[own]], FD_FRAME_BYTES if rate else FRAME_BYTES),
                identifier_bits=np.where(frames.extended[taken[own]], 29, BASE_BITS),
                bit_rate_kbit_s=nominal,
                data_bit_rate_kbit_s=rate,
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
        # Of CAN FD the stuff bits are not known: any number of the possible ones.
        own_us = np.where(is_fd, (worst_us + none_us) / 2, self.frames.bits[self.taken] * self.bit_us)
        stuffing_us = float((worst_us - none_us)[1:][is_fd[1:]].sum()) / 2
        # The first frame ended with its stamp.
        load, worst, none = (float(us[1:].sum()) / span_us for us in (own_us, worst_us, none_us))
        note = "exact bits of each classical frame, at the bit rate of the profile"
        sense: Sense = "at most"
        unknown = self.frames.switched[self.taken].any() and not self.has_switch
        if unknown:
            if is_fd.all():
                return
            note, sense = f"{note}; without frames of CAN FD that switch", "shown"
        # A log begins and ends anywhere: it may have a frame more of each identifier than its length has periods.
        _, each = np.unique(
            self.frames.identifiers[self.taken] * 2 + self.frames.extended[self.taken], return_index=True
        )
        doubt_us = float(own_us[each].sum() + load * self.stamp_error_us + stuffing_us)
        doubt = doubt_us / span_us if sense == "at most" else None
        yield RecordedFigure("load", "share", plain(self.cycle.load), load, doubt, sense, count, note=note)
        yield RecordedFigure("load, worst stuffing of these frames", "share", None, worst, None, "shown", count)
        yield RecordedFigure("load, no stuffing of these frames", "share", None, none, None, "shown", count)
        possible_us = float((worst_us - none_us)[~is_fd].sum())
        if possible_us:
            stuffing = float((own_us - none_us)[~is_fd].sum()) / possible_us
            number = int(np.count_nonzero(~is_fd))
            yield RecordedFigure("stuff bits of the possible ones", "share", None, stuffing, None, "shown", number)
        apart_us = np.diff(self.times_us) - own_us[1:]
        gap_us = _GAP_BITS * self.bit_us
        runs = np.diff(
            np.concatenate(([-1], np.flatnonzero(apart_us > gap_us + min(self.step_us, gap_us)), [count - 1]))
        )
        yield RecordedFigure("frames directly after each other", "1", None, int(runs.max()), None, "shown", count)

    def _cycles(self) -> Iterator[RecordedFigure]:
        """SYNCs and PDOs that are missing, and the last PDO after its SYNC."""
        if not self.cycle.traffic.has_cycle:
            return
        sync = next(stream for stream in self.streams if stream.name == SYNC)
        known = self.by_identifier.get((_whole(sync.first), sync.identifier_bits > BASE_BITS))
        periods = None if known is None else grid(known.times_us)
        if known is None or periods is None:
            few = f"SYNC comes {plural(0 if known is None else len(known.times_us), 'time')}"
            yield self._missed("cycles without SYNC", None, 0, hidden=few)
            return
        yield self._missed("cycles without SYNC", periods.missing, int(periods.places[-1]) + 1)
        number = np.arange(periods.places[-1] + 1)
        sync_us, is_sent = np.interp(number, periods.places, known.times_us), np.isin(number, periods.places)
        behind_us = np.full(len(number), -np.inf)
        lost: dict[str, list[str]] = {"missing": [], "twice": []}
        counts = Counter[str]()
        for stream in self.streams:
            if stream.is_message or stream.name == SYNC:
                continue
            every = round(plain(stream.period_us) / plain(sync.period_us))
            for identifier in range(_whole(stream.first), _whole(stream.last) + 1):
                sent = self.by_identifier.get((identifier, stream.identifier_bits > BASE_BITS))
                times_us = np.zeros(0) if sent is None else sent.times_us
                due = due_pdos(sync_us, times_us, every=every, is_sent=is_sent)
                np.maximum.at(behind_us, due.cycles, due.late_us)
                counts.update(due=due.due, missing=due.missing, twice=due.twice)
                for name, notes in lost.items():
                    if number := getattr(due, name):
                        notes.append(f"{number:,} of {identifier:#x}")
        for name, notes in lost.items():
            yield self._missed(f"PDOs {name}", counts[name], counts["due"], note=first_of(notes, LISTED))
        behind_us = behind_us[behind_us >= 0]
        if not len(behind_us):
            return
        behind = quantile(behind_us, self.share)
        planned_us = _finite(plain(self.cycle.required_us) - plain(self.network.nonperiodic_us))
        doubt = expanded(*(plain(doubt.us) for doubt in self.cycle.doubts()), behind.uncertainty or 0.0)
        yield RecordedFigure(
            "last PDO after SYNC",
            "us",
            planned_us,
            behind.value,
            None if doubt is None else doubt + self.stamp_error_us,
            "at most",
            len(behind_us),
            "cycle.period_us",
        )

    def _missed(
        self, quantity: str, number: int | None, events: int, *, note: str = "", hidden: str = ""
    ) -> RecordedFigure:
        key = "limits.missed_cycles"
        return RecordedFigure(
            quantity, "1", self.missed_cycles, number, None, "at most", events, key, note, hidden=hidden
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
        if stream.is_message:
            yield from self._message(stream, label, each, spread_us)
        elif stream.name == SYNC:
            yield from self._sync(stream, each[0], spread_us)
        fullest = max(each, key=lambda sent: sent.most_bytes)
        planned_bytes = plain(stream.data_bytes)
        if self._planned_format(stream) != _CLASSICAL:
            planned_bytes = next(length for length in FD_LENGTHS if length >= planned_bytes)
        key = f"message.{stream.name}" if stream.is_message else ""
        count = sum(len(sent.times_us) for sent in each)
        if key and fullest.most_bytes > planned_bytes:
            self.edits[f"{key}.payload_bytes"] = fullest.most_bytes
        yield RecordedFigure(
            f"{label}: data",
            "bytes",
            planned_bytes,
            fullest.most_bytes,
            None,
            "at most",
            count,
            key and f"{key}.payload_bytes",
        )
        others = [sent for sent in each if self._format(sent) != self._planned_format(stream)]
        if others:
            note = f"{self._format(others[0])} recorded, {self._planned_format(stream)} planned"
            frames = sum(len(sent.times_us) for sent in others)
            yield RecordedFigure(
                f"{label}: frames of another format", "1", 0, frames, None, "at most", count, key, note
            )

    def _format(self, sent: SentFrames) -> str:
        if not sent.is_fd:
            return _CLASSICAL
        return "CAN FD" if sent.switches else "CAN FD without a switch of bit rate"

    def _planned_format(self, stream: Stream) -> str:
        if not stream.is_message:
            return "CAN FD" if self.has_switch else _CLASSICAL
        message = self._said(stream)
        if not message.fd:
            return _CLASSICAL
        return "CAN FD" if message.brs else "CAN FD without a switch of bit rate"

    def _sync(self, stream: Stream, sent: SentFrames, spread_us: float | None) -> Iterator[RecordedFigure]:
        """Period of SYNC, equal to that of the plan, and its jitter."""
        periods, planned_us, count = grid(sent.times_us), plain(stream.period_us), len(sent.times_us)
        if periods is None:
            mean_us = sent.mean.value if count > 1 else None
            yield RecordedFigure(
                "SYNC: period", "us", planned_us, mean_us, None, "equal", count, "cycle.period_us", hidden=_TOO_FEW
            )
            return
        clocks_us = CLOCK_TOLERANCE * planned_us / 3**0.5
        mean = mean_period(sent.times_us, periods)
        doubt = expanded(mean.uncertainty, float(clocks_us), self.stamp_error_us / count)
        yield RecordedFigure(
            "SYNC: period", "us", planned_us, mean.value, doubt, "equal", count, "cycle.period_us", is_mean=True
        )
        late = lateness(periods, self.share)
        doubt = expanded(late.uncertainty or 0.0)
        if spread_us is not None:
            yield RecordedFigure(
                "SYNC: jitter of the arrival",
                "us",
                spread_us,
                late.value,
                None if doubt is None else doubt + self.stamp_error_us,
                "at most",
                count,
            )

    def _message(
        self, stream: Stream, label: str, each: list[SentFrames], spread_us: float | None
    ) -> Iterator[RecordedFigure]:
        """Mean distance of a message, and how much sooner it comes than its period; of the identifier that is worst."""
        key, planned_us, several = f"message.{stream.name}", plain(stream.period_us), len(each) > 1
        repeated = [sent for sent in each if len(sent.times_us) > 1]
        if not repeated:
            return
        often = min(repeated, key=lambda sent: sent.mean.value)
        count = len(often.times_us)
        scatter_us = planned_us if spread_us is None else spread_us
        clocks_us = float(CLOCK_TOLERANCE * planned_us / 3**0.5)
        # At worst the first frame was the latest that it may be, and the last one the earliest.
        error_us = scatter_us / (count - 1) / 2 if often.mean.uncertainty is None else often.mean.uncertainty
        is_known = count >= LEAST_EVENTS
        notes = [_named(often) if several else "", "" if often.grid else "not periodic"]
        if often.grid and often.grid.missing:
            notes.append(f"{often.grid.missing:,} of {often.grid.places[-1] + 1:,} periods without a frame")
        period = RecordedFigure(
            f"{label}: period",
            "us",
            planned_us,
            often.mean.value,
            expanded(error_us, clocks_us, self.stamp_error_us / (count - 1)) if is_known else None,
            "at least" if is_known else "shown",
            count,
            f"{key}.period_us",
            ", ".join(filter(None, (*notes, "" if is_known else _TOO_FEW))),
            is_mean=True,
        )
        if is_known and period.verdict == "outside":
            self.edits[f"{key}.period_us"] = planned_us = round(often.mean.value, 1)
        yield period
        own_period_us = planned_us * (1 - float(CLOCK_TOLERANCE))
        found = [(quantile(ahead(sent.times_us, own_period_us), self.share), sent) for sent in repeated]
        sooner, sent = max(found, key=lambda pair: pair[0].value)
        figure = RecordedFigure(
            f"{label}: sooner than its period",
            "us",
            spread_us,
            sooner.value,
            None if spread_us is None else (expanded(sooner.uncertainty or 0.0) or 0.0) + self.stamp_error_us,
            "shown" if spread_us is None else "at most",
            len(sent.times_us),
            f"{key}.jitter_us",
            _named(sent) if several else "",
        )
        yield figure
        if figure.verdict == "outside":
            model = event_model(
                sent.times_us, planned_us, stamp_error_us=self.stamp_error_us, tolerance=float(CLOCK_TOLERANCE)
            )
            self.edits[f"{key}.jitter_us"] = model.jitter_us
            if model.burst > 1:
                self.edits[f"{key}.burst"] = model.burst

    def _spread_us(self, stream: Stream, least_us: float, response: Mapping[str, Any] | None) -> float | None:
        """How much the plan lets SYNC or a message arrive sooner than its period: R less the shortest frame [us].

        All of a burst may come with its first.
        """
        if response is None or not (stream.is_message or stream.name == SYNC):
            return None
        burst = self._said(stream).burst if stream.is_message else 1
        together_us = (burst - 1) * plain(stream.period_us)
        return _finite(max(plain(response["worst_response_us"]) - least_us, 0.0) + together_us)

    def _said(self, stream: Stream) -> Any:
        """The message in the profile."""
        return next(message for message in self.network.profile.message if message.name == stream.name)

    @property
    def has_switch(self) -> bool:
        """Whether the plan has a data bit rate of CAN FD."""
        return bool(plain(self.cycle.traffic.data_bit_rate_kbit_s))

    def remarks(self) -> Iterator[str]:
        """What the log has beside the figures."""
        frames = self.frames
        yield from faults(frames, self.stretch)
        fd, switched = (int(np.count_nonzero(flags)) for flags in (frames.is_fd, frames.switched))
        if fd:
            left = (
                f", {switched:,} in no load, for the plan has no data bit rate"
                if switched and not self.has_switch
                else ""
            )
            yield f"{plural(fd, 'frame')} of CAN FD: in the load with half of the possible stuff bits{left}."
        if frames.remote:
            yield f"{plural(frames.remote, 'remote frame')}: the length code is shown as data."
        if self.stamp_error_us > self.step_us + _ROUNDING_US:
            yield (
                f"Frames come up to {self.stamp_error_us - self.step_us:.0f} us closer than the bus allows: stamps are "
                "late, and U holds it."
            )
        if self.step_us > 1:
            yield f"Stamps have steps of {self.step_us:g} us."
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


def _finite(us: float) -> float | None:
    """A planned time; None where a bus that is too full has none."""
    return us if isfinite(us) else None


def _named(sent: SentFrames) -> str:
    """Its identifier."""
    return f"{sent.identifier:#x}"
