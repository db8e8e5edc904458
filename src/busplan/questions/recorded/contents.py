"""What a CAN log has: identifiers, when they come, the load of the bus, errors, and what the stamps show."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from busplan.buses.can.equations import BASE_BITS, MOST_DATA_BIT_RATE, USUAL_DATA_BIT_RATE
from busplan.buses.can.logged import WireTimes, wire_times
from busplan.buses.can.recorded_cycles import emergencies
from busplan.buses.rule import day_of
from busplan.english import plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.recordings import can_timing, canopen
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.statistics import Floats

Comes = Literal["cyclic", "burst", "event", "once"]
"""cyclic: once a period. burst: several at once, then a pause. event: neither. once: a single frame."""
_CLOSE: Final = 0.1
"""Distance of the frames of a burst, at most, as a share of the mean distance in the log [1]."""
_BURSTS: Final = 1 / 3
"""Least share of such distances in bursts; of events that come by chance a tenth are so close [1]."""


class RecordedIdentifier(NamedTuple):
    """Frames of an identifier."""

    identifier: int
    identifier_bits: int
    """11 or 29."""
    frame_format: Literal["CAN", "CAN FD", "CAN FD without a switch"]
    """Format of its frames; without a switch data go at the nominal bit rate."""
    canopen: str | None
    """What CANopen would call it; None where the log does not look like CANopen, or CANopen has no name for it."""
    node: int | None
    """Node-ID that CANopen would give it."""
    frames: int
    comes: Comes
    period_us: float | None
    """Mean period of cyclic frames, missing ones counted [us]."""
    missing: int
    """Periods of cyclic frames without a frame."""
    burst: int | None
    """Most frames of a burst."""
    median_gap_us: float | None
    """Median time from frame to frame; None of a single frame [us]."""
    least_gap_us: float | None
    largest_gap_us: float | None
    largest_gap_s: float | None
    """When the largest gap ended [s]."""
    largest_gap_frame: int | None
    """Number of the frame that ended it."""
    least_bytes: int
    most_bytes: int
    load: float | None
    """Share of the time in which its frames are on the wire; None without a bit rate [1]."""
    share: float | None
    """Its share of all time on the wire; None where that depends on a bit rate that is not known [1]."""
    first_s: float
    """When the first frame came [s]."""
    first_frame: int
    """Number of the first frame in the file, from 1."""
    last_s: float
    last_frame: int


class RecordedEmergency(NamedTuple):
    """Emergency messages of one node with one error."""

    node: int
    error_code: int
    """0 says that an error is over."""
    register: int
    """Error register."""
    messages: int
    first_s: float
    first_frame: int
    last_s: float
    last_frame: int


class _Moment(NamedTuple):
    at_s: float
    frame: int


_Ends: TypeAlias = tuple[float | None, int | None]


class _Gaps(NamedTuple):
    """When frames of an identifier come: fields of a `RecordedIdentifier`."""

    comes: Comes
    period_us: float | None = None
    missing: int = 0
    burst: int | None = None
    median_us: float | None = None
    least_us: float | None = None
    largest_us: float | None = None
    largest_s: float | None = None
    largest_frame: int | None = None


@dataclass(frozen=True, slots=True)
class LogContents:
    """What a log has. Times count from the first frame; numbers of frames are those of the file, from 1."""

    day: str
    """Day of the first stamp in UTC; empty if stamps do not tell it."""
    frames: int
    duration_s: float
    bit_rate_kbit_s: float | None
    """Bit rate of the load: given, or that of frames back to back; None where neither is known [kbit/s]."""
    bit_rate_is_assumed: bool
    data_bit_rate_kbit_s: float | None
    """Bit rate of data of CAN FD, where frames switch to it [kbit/s]."""
    data_bit_rate_is_assumed: bool
    least_bit_rate_kbit_s: float
    """Bit rate that the frames need, at least [kbit/s]."""
    load: float | None
    """Mean load of the bus [1]."""
    fullest_load: float | None
    """Load of the fullest second [1]."""
    possible_loads: Mapping[float, float]
    """Load of the fullest second by usual bit rates [kbit/s], where the log does not show which it is."""
    largest_gap_us: float | None
    """Longest time without a frame [us]."""
    largest_gap_s: float | None
    largest_gap_frame: int | None
    error_frames: int
    first_error_s: float | None
    """When the first error frame came; None where its stamp does not say it [s]."""
    first_error_frame: int | None
    last_error_s: float | None
    last_error_frame: int | None
    dropped_frames: int | None
    """Frames that the recorder dropped; None where the format does not count them."""
    remote_frames: int
    stamp_step_us: float
    """Step of the stamps; 0 where all frames have one [us]."""
    late_stamps_us: float
    """How late stamps are at least, by frames closer than the bus sends them, or than any bus does [us]."""
    looks_like_canopen: bool
    identifiers: tuple[RecordedIdentifier, ...]
    emergencies: tuple[RecordedEmergency, ...]
    remarks: tuple[str, ...]
    is_synthetic: bool


def log_contents(
    path: Path,
    *,
    bit_rate_kbit_s: float | None,
    data_bit_rate_kbit_s: float | None,
    channel: str | None,
    progress: Progress,
) -> LogContents:
    """Read a log and say what it has.

    A file that is no log, that is of several channels, or whose frames need a higher bit rate than the given one,
    raises BusplanError.
    """
    frames = read_can(path, channel=channel, progress=progress)
    try:
        stretch = can_timing.longest_stretch(frames)
    except BusplanError as error:
        raise BusplanError(f"{path}: {error}") from None
    least = can_timing.least_bit_rate(frames, stretch)
    if bit_rate_kbit_s is not None:
        can_timing.require_bit_rate(bit_rate_kbit_s, least)
    return _Log(frames, stretch, least, bit_rate_kbit_s, data_bit_rate_kbit_s).contents()


class _Log:
    """Frames of a log, each with its time on the wire."""

    def __init__(
        self,
        frames: CanFrames,
        stretch: can_timing.ClockStretch,
        least: can_timing.LeastBitRate,
        bit_rate_kbit_s: float | None,
        data_bit_rate_kbit_s: float | None,
    ) -> None:
        self.frames, self.stretch, self.least = frames, stretch, least
        self.messages = can_timing.frames_by_identifier(frames, stretch)
        self.canopen = canopen.is_likely(self.messages.values(), frames)
        self.possible = can_timing.possible_bit_rates(least)
        shown = can_timing.shown_bit_rate(frames, stretch, self.possible)
        self.is_given, self.rate = bit_rate_kbit_s is not None, bit_rate_kbit_s or shown
        self.switches = bool(frames.switched[stretch.taken].any())
        self.is_data_given = data_bit_rate_kbit_s is not None
        self.data_rate = data_bit_rate_kbit_s or USUAL_DATA_BIT_RATE
        # The share of each identifier is the same at any bit rate, unless there are two.
        rate = self.rate or can_timing.MOST_BIT_RATE
        self.wire_us = self._wire(rate, self.data_rate).us
        # No rate that is only usual makes a stamp late.
        self.least_us = self._wire(rate, data_bit_rate_kbit_s or MOST_DATA_BIT_RATE).least_us

    def _wire(self, rate: float, data_rate: float) -> WireTimes:
        data_rate = max(data_rate, rate)
        return wire_times(self.frames, self.stretch.taken, bit_rate_kbit_s=rate, data_bit_rate_kbit_s=data_rate)

    def _at(self, index: int) -> _Moment:
        """Time and number of a frame by its index in the log."""
        return _Moment(
            _rounded(self.frames.times_us[index] + self.frames.lead_us) / 1e6, int(self.frames.numbers[index])
        )

    def _load(self, wire_us: Floats) -> float | None:
        """Share of the time; the first frame ended with its stamp."""
        span_us = self.stretch.length_us
        return float(wire_us[1:].sum()) / span_us if span_us > 0 else None

    def _fullest(self, wire_us: Floats) -> float | None:
        return (
            float(can_timing.second_loads(self.stretch.times_us, wire_us).max()) if self.stretch.length_us > 0 else None
        )

    def contents(self) -> LogContents:
        """All that the log has."""
        frames, stretch = self.frames, self.stretch
        gaps_us = np.diff(stretch.times_us)
        widest = int(gaps_us.argmax()) if len(gaps_us) else None
        none: _Ends = (None, None)
        gap: _Ends = none if widest is None else self._at(int(stretch.taken[widest + 1]))
        first_error, last_error = (self._error(place) if frames.errors else none for place in (0, -1))
        rates = () if self.rate else self.possible
        possible = {rate: self._fullest(self._wire(rate, self.data_rate).us) for rate in rates}
        return LogContents(
            day_of(int(frames.start_s * 1e9)),
            len(stretch.taken),
            stretch.length_us / 1e6,
            self.rate,
            self.rate is not None and not self.is_given,
            max(self.data_rate, self.rate or 0.0) if self.switches else None,
            self.switches and not self.is_data_given,
            self.least.surely,
            self._load(self.wire_us) if self.rate else None,
            self._fullest(self.wire_us) if self.rate else None,
            MappingProxyType({rate: load for rate, load in possible.items() if load is not None and load <= 1}),
            None if widest is None else _rounded(gaps_us[widest]),
            *gap,
            frames.errors,
            *first_error,
            *last_error,
            frames.dropped,
            frames.remote,
            can_timing.step_us(stretch) if len(gaps_us) else 0.0,
            _rounded(can_timing.late_stamps_us(stretch, self.least_us)),
            self.canopen,
            tuple(self._identifiers()),
            tuple(self._emergencies()),
            tuple(self._remarks()),
            bool(frames.synthetic),
        )

    def _error(self, place: int) -> _Ends:
        at_us = float(self.frames.errors_us[place])
        # A text of candump may give error frames no time.
        is_known = -can_timing.WINDOW_US <= at_us <= float(self.frames.times_us.max()) + can_timing.WINDOW_US
        return _rounded(at_us + self.frames.lead_us) / 1e6 if is_known else None, int(self.frames.error_numbers[place])

    def _identifiers(self) -> list[RecordedIdentifier]:
        all_us = float(self.wire_us.sum())
        is_shared = self.rate is not None or not self.frames.is_fd[self.stretch.taken].any()
        wire_us = np.zeros(len(self.frames.times_us))
        wire_us[self.stretch.taken] = self.wire_us
        found = []
        for sent in self.messages.values():
            own_us = float(wire_us[sent.frames].sum())
            role = canopen.role(sent) if self.canopen else None
            found.append(
                RecordedIdentifier(
                    sent.identifier,
                    29 if sent.extended else BASE_BITS,
                    "CAN" if not sent.is_fd else "CAN FD" if sent.switches else "CAN FD without a switch",
                    role and role.name,
                    role and role.node,
                    len(sent.frames),
                    *self._gaps(sent),
                    int(self.frames.sizes[sent.frames].min()),
                    sent.most_bytes,
                    own_us / self.stretch.length_us if self.rate and self.stretch.length_us else None,
                    own_us / all_us if is_shared and all_us else None,
                    *self._at(int(sent.frames[0])),
                    *self._at(int(sent.frames[-1])),
                )
            )
        return found

    def _gaps(self, sent: can_timing.SentFrames) -> _Gaps:
        gaps_us, periods = np.diff(sent.times_us), sent.periods
        if not len(gaps_us):
            return _Gaps("once")
        is_close = gaps_us < _CLOSE * self.stretch.length_us / len(gaps_us)
        comes: Comes = "cyclic" if periods else "burst" if is_close.mean() >= _BURSTS else "event"
        widest = int(gaps_us.argmax())
        return _Gaps(
            comes,
            sent.mean.value if periods else None,
            periods.missing if periods else 0,
            _longest_row(is_close) + 1 if comes == "burst" else None,
            _rounded(np.median(gaps_us)),
            _rounded(gaps_us.min()),
            _rounded(gaps_us[widest]),
            *self._at(int(sent.frames[widest + 1])),
        )

    def _emergencies(self) -> list[RecordedEmergency]:
        if not self.canopen:
            return []
        found = emergencies(self.frames, self.stretch.taken)
        keys = found.nodes << 24 | found.codes << 8 | found.registers
        _, first, counts = np.unique(keys, return_index=True, return_counts=True)
        last = len(keys) - 1 - np.unique(keys[::-1], return_index=True)[1]
        rows = sorted(zip(first.tolist(), last.tolist(), counts.tolist(), strict=True))
        return [
            RecordedEmergency(
                int(found.nodes[one]),
                int(found.codes[one]),
                int(found.registers[one]),
                count,
                *self._at(int(found.frames[one])),
                *self._at(int(found.frames[end])),
            )
            for one, end, count in rows
        ]

    def _remarks(self) -> list[str]:
        frames = self.frames
        remarks = [*can_timing.faults(frames, self.stretch)]
        if reason := can_timing.stamps_of_no_bus(self.least.likely):
            remarks.append(f"{reason[0].upper()}{reason[1:]}.")
        if frames.remote:
            remarks.append(f"{plural(frames.remote, 'remote frame')}: the length code is shown as data.")
        if fd := int(np.count_nonzero(frames.is_fd)):
            remarks.append(f"{plural(fd, 'frame')} of CAN FD: in the load with half of the possible stuff bits.")
        if frames.synthetic:
            remarks.append(f"The log is {frames.synthetic}: no machine was recorded.")
        return remarks


def _rounded(us: np.floating[Any] | float) -> float:
    """A time without the error of its subtraction [us]."""
    return round(float(us), 3)


def _longest_row(flags: npt.NDArray[np.bool_]) -> int:
    """Length of the longest row of true flags."""
    ends = np.flatnonzero(np.diff(np.concatenate(([0], flags, [0]))))
    return int((ends[1::2] - ends[::2]).max(initial=0))
