"""Timing of a CAN log: clock, frames of each identifier, event models, and least possible bit rate."""

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.english import plural
from busplan.errors import BusplanError
from busplan.recordings.can import CanFrames
from busplan.recordings.statistics import LEAST_EVENTS, Floats, PeriodicEvents, Quantile, ahead, periodic_events

LISTED: Final = 6
"""Identifiers that a sentence lists, at most."""
MOST_BIT_RATE: Final = 1000.0
"""Highest bit rate of classical CAN [kbit/s]."""
_BIT_RATES: Final = (33.3, 50.0, 83.3, 100.0, 125.0, 250.0, 500.0, 800.0, 1000.0)
"""Usual bit rates [kbit/s]."""
_NEAR: Final = 0.02
"""Share by which frames in direct succession may seem to be off a bit rate, by their stamps [1]."""
_ABOUT: Final = 0.9
"""Share of a bit rate from which frames seem to be in direct succession [1]."""
_SHARP: Final = 0.8
"""Share of those frames at the bit rate itself, if it is that of the bus [1]."""
_WINDOWS: Final = (10, 20, 30)
"""Numbers of frames over which stamps show a bit rate. Over two, errors of stamps dominate."""
_LATE_SHARE: Final = 0.05
"""Relative excess over the highest bit rate at which a driver must have read several frames at once [1]."""
_LATEST_US: Final = 1000.0
"""Largest delay of a stamp by a driver that reads several frames at once [us]. Later stamps are not those of a bus."""
_LATE_US: Final = 100.0
"""Largest delay of a stamp by a driver that reads each frame by itself [us]."""
_LEAST_US: Final = 1e-3
_FEW: Final = 3
_STEP_BACK_US: Final = -1000.0
"""Step between stamps below which the next one is of another queue or clock, or of a clock that was set back [us]."""
_QUEUED_US: Final = 0.5e6
"""Longest time for which a recorder's queues deliver their frames one after the other [us]."""
_SEVERAL: Final = 3
"""Number of steps back from which they do not come from a clock that was set back."""
WINDOW_US: Final = 1e6
"""Window of the fullest second [us]."""
_PERIODIC: Final = 0.15
"""Standard deviation of a periodic message, at most, as a share of its period [1]."""
_MISSING: Final = 0.1
"""Periods of a periodic message without a frame, at most, as a share of its frames [1]."""
_ROUNDING: Final = 1e-9
"""Share of a period by which float rounding may lengthen a sum of periods [1]."""


class SentFrames(NamedTuple):
    """All frames of an identifier."""

    identifier: int
    extended: bool
    """Whether the identifier has 29 bits."""
    frames: npt.NDArray[np.int64]
    """Index of each frame in the log."""
    times_us: Floats
    most_bytes: int
    is_fd: bool
    """Whether any of the frames is one of CAN FD."""
    switches: bool
    """Whether all CAN FD frames have their data at the data bit rate (BRS)."""
    periods: PeriodicEvents | None
    """Periods of the message; None if it is not periodic."""

    @property
    def mean(self) -> Quantile:
        """Mean distance of two or more frames [us]; for a periodic message its period, lost frames counted."""
        span_us = float(self.times_us[-1] - self.times_us[0])
        if self.periods is None:
            return Quantile(span_us / (len(self.times_us) - 1), None)
        return mean_period(self.times_us, self.periods)


def mean_period(times_us: Floats, periods: PeriodicEvents) -> Quantile:
    """Mean period from the first event to the last, with its standard uncertainty [us].

    The first and the last event differ in lateness by no more than the range over all events.
    """
    number = int(periods.places[-1])
    return Quantile(float(times_us[-1] - times_us[0]) / number, float(np.ptp(periods.late_us)) / number)


class EventModel(NamedTuple):
    """A message as planned in a profile: at most burst - 1 + ceil((w + jitter) / period) frames in a time w."""

    burst: int
    jitter_us: float


def event_model(times_us: Floats, period_us: float, *, stamp_error_us: float, tolerance: float) -> EventModel:
    """Event model of a period [us] with the least burst or jitter that allows frames at ascending times [us].

    `stamp_error_us` is the largest error of a stamp; `tolerance` is the largest relative error of the clocks, which may
    shorten the period.

    Examples
    --------
    >>> event_model(np.array([0.0, 80, 200]), 100, stamp_error_us=1, tolerance=0)
    EventModel(burst=1, jitter_us=21)
    >>> event_model(np.array([0.0, 0, 200]), 100, stamp_error_us=0, tolerance=0)
    EventModel(burst=1, jitter_us=100)
    >>> event_model(np.array([0.0, 1, 2, 1000]), 300, stamp_error_us=1, tolerance=0)
    EventModel(burst=3, jitter_us=0.0)
    >>> event_model(np.array([38.0, 38, 38, 38]), 1.9, stamp_error_us=0, tolerance=0)
    EventModel(burst=4, jitter_us=0.0)
    """
    jitter_us = float(ahead(times_us, period_us * (1 - tolerance)).max()) + stamp_error_us
    if jitter_us <= period_us:
        return EventModel(1, min(ceil(jitter_us), period_us))
    return EventModel(1 + ceil(jitter_us / period_us - _ROUNDING), 0.0)


class ClockStretch(NamedTuple):
    """Longest part of a log in which its clock was not set back."""

    taken: npt.NDArray[np.int64]
    """Indexes of the frames in the log, in the order of their stamps."""
    times_us: Floats
    """Stamps of the frames, ascending [us]."""
    steps_back: int
    """Number of times that the clock was set back in the whole log."""
    sorted_us: float = 0.0
    """Time by which frames were out of order, before they were sorted [us]."""

    @property
    def length_us(self) -> float:
        """Time from the first stamp to the last [us]."""
        return float(self.times_us[-1] - self.times_us[0])


def longest_stretch(frames: CanFrames) -> ClockStretch:
    """Longest part of a log in which the clock was not set back.

    Small steps back, however many, come from frames of different queues, which are sorted. Stamps of two clocks raise
    BusplanError.
    """
    apart_us = np.diff(frames.times_us)
    back_us = -apart_us[apart_us < _STEP_BACK_US]
    are_queues = len(back_us) >= _SEVERAL and float(back_us.max()) <= _QUEUED_US
    if len(back_us) >= _SEVERAL and not are_queues:
        step_us = float(np.median(back_us))
        if np.count_nonzero(apart_us > step_us / 2) >= len(back_us) - 1:
            raise BusplanError(
                f"its stamps jump back {len(back_us):,} times by about {step_us / 1e6:.3g} s, and forward again: they "
                "are those of two clocks; export the frames of each by themselves, and give one"
            )
    steps_back = np.flatnonzero(apart_us < _STEP_BACK_US) + 1 if not are_queues else np.zeros(0, dtype=np.int64)
    ends = np.concatenate(([0], steps_back, [len(frames.times_us)]))
    longest = int(np.argmax(np.diff(ends)))
    taken = np.arange(ends[longest], ends[longest + 1])
    taken = taken[np.argsort(frames.times_us[taken], kind="stable")]
    late_us = float((np.maximum.accumulate(frames.times_us) - frames.times_us).max()) if are_queues else 0.0
    return ClockStretch(taken, frames.times_us[taken], len(steps_back), late_us)


def frames_by_identifier(frames: CanFrames, stretch: ClockStretch) -> Mapping[tuple[int, bool], SentFrames]:
    """Frames of each identifier, by identifier and whether it has 29 bits, ascending."""
    key = frames.identifiers[stretch.taken] * 2 + frames.extended[stretch.taken]
    order = np.argsort(key, kind="stable")
    messages = {}
    for places in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
        identifier, extended = divmod(int(key[places[0]]), 2)
        times_us, taken = stretch.times_us[places], stretch.taken[places]
        periods = periodic_events(times_us)
        if periods is not None and not _is_periodic(periods, stretch.length_us):
            periods = None
        messages[identifier, bool(extended)] = SentFrames(
            identifier,
            bool(extended),
            taken,
            times_us,
            int(frames.sizes[taken].max()),
            bool(frames.is_fd[taken].any()),
            bool(frames.switched[taken][frames.is_fd[taken]].all()),
            periods,
        )
    return messages


def _is_periodic(periods: PeriodicEvents, length_us: float) -> bool:
    """Whether events come once a period for a second, or all of a shorter log. A short row of them is a burst."""
    late_us, rows_us = float(np.std(periods.late_us)), (float(periods.places[-1]) + 1) * periods.period_us
    is_row = rows_us >= min(WINDOW_US, (1 - _MISSING) * length_us)
    is_even = late_us <= _PERIODIC * periods.period_us and periods.missing <= _MISSING * len(periods.late_us)
    return is_row and is_even


def second_loads(times_us: Floats, wire_us: Floats) -> Floats:
    """Load of the second from each frame on, or of all of a shorter log, whose first frame ended with its stamp [1].

    Of n frames, stamps are ascending and not all alike, and `wire_us` are the times on the wire [us]. The result has
    shape (n,), or (1,) for a shorter log.

    Examples
    --------
    >>> float(second_loads(np.array([0.0, 0.5e6, 1.2e6, 2.3e6]), np.array([100.0, 200, 300, 400])).max())
    0.0005
    >>> second_loads(np.array([0.0, 1e3]), np.array([100.0, 200])).tolist()
    [0.2]
    """
    span_us = float(times_us[-1] - times_us[0])
    if span_us < WINDOW_US:
        return np.array([float(wire_us[1:].sum()) / span_us])
    sent_us = np.concatenate(([0.0], np.cumsum(wire_us)))
    ends = np.searchsorted(times_us, times_us + WINDOW_US, side="left")
    return np.asarray(sent_us[ends] - sent_us[:-1]) / WINDOW_US


def step_us(stretch: ClockStretch) -> float:
    """Step of the stamps, which logs write in microseconds: greatest common divisor of their distances [us].

    One or two different distances, none of them 0, show exactly periodic frames but no step, which is then 1 us.
    """
    apart_us = np.unique(np.diff(np.rint(stretch.times_us).astype(np.int64)))
    if len(apart_us) < _FEW and apart_us.all():
        return 1.0
    return float(np.gcd.reduce(apart_us))


class LeastBitRate(NamedTuple):
    """Lower bounds of the bus's bit rate [kbit/s]."""

    likely: float
    """Bound for stamps as late as with most drivers."""
    surely: float
    """Bound for stamps up to a millisecond late."""
    rates: Floats
    """Likely bound from the frames from each frame of the stretch on, n of them; 0 where too few follow."""


def least_bit_rate(frames: CanFrames, stretch: ClockStretch) -> LeastBitRate:
    """Least possible bit rate of the bus, since frames do not overlap; 0 for too few frames.

    Frames are stamped at their ends or, by some controllers, at their starts. In either case at least the smaller sum
    of bits lies between two stamps. A stamp may be wrong by its step and by the delay of a driver: where frames come
    closer than on any bus, a driver read several at once, and the first stamp is late by as much as they take.
    """
    bits, times_us = frames.bits[stretch.taken].astype(np.float64), stretch.times_us
    sent, error_us = np.concatenate(([0.0], np.cumsum(bits))), step_us(stretch)

    def rates(count: int, late_us: float) -> Floats:
        window_us = times_us[count:] - times_us[:-count] + error_us + late_us
        between = np.minimum(sent[count + 1 :] - sent[1:-count], sent[count:-1] - sent[: -count - 1])
        return np.asarray(1000 * between / np.maximum(window_us, _LEAST_US), dtype=np.float64)

    def most(windows: Sequence[int], late_us: float) -> Floats:
        of_first = np.zeros(len(bits))
        for count in windows:
            if len(bits) > count:
                np.maximum(of_first[:-count], rates(count, late_us), out=of_first[:-count])
        return of_first

    closer = rates(1, 0.0) > MOST_BIT_RATE * (1 + _LATE_SHARE) if len(bits) > 1 else np.zeros(0, dtype=np.bool_)
    windows: Sequence[int] = (4, *_WINDOWS)
    late_us = _LATE_US
    if np.count_nonzero(closer) >= LEAST_EVENTS:
        starts, ends = (np.flatnonzero(np.diff(np.concatenate(([0], closer, [0]))) == step) for step in (1, -1))
        at_once_us = float((sent[ends + 1] - sent[starts]).max()) * 1000 / MOST_BIT_RATE
        windows, late_us = _WINDOWS, min(at_once_us, _LATEST_US)
    likely = most(windows, late_us)
    return LeastBitRate(float(likely.max()), float(most(windows, _LATEST_US).max()), likely)


def require_bit_rate(bit_rate_kbit_s: float, least: LeastBitRate) -> None:
    """Raise BusplanError for a bit rate at which the frames of a log would overlap [kbit/s]."""
    if bit_rate_kbit_s < least.surely:
        raise BusplanError(
            f"bit rate {bit_rate_kbit_s:g}: frames of the log need at least {least.surely:.3g} kbit/s, because they do "
            "not overlap"
        )


def possible_bit_rates(least: LeastBitRate) -> list[float]:
    """Usual bit rates that are no less than a least one [kbit/s]."""
    return [rate for rate in _BIT_RATES if rate >= least.surely]


def shown_bit_rate(frames: CanFrames, stretch: ClockStretch, possible: Sequence[float]) -> float | None:
    """Least of some bit rates at which frames follow each other; None where none is shown [kbit/s]."""
    bits, apart_us = frames.bits[stretch.taken][1:], np.diff(stretch.times_us)
    rates = 1000 * bits / np.maximum(apart_us, _LEAST_US)
    return next((rate for rate in possible if _is_shown(rate, rates)), None)


def _is_shown(bit_rate_kbit_s: float, rates: Floats) -> bool:
    """Whether frames follow each other as at a bit rate, with hardly any closer or a little later."""
    near = np.count_nonzero(np.abs(rates / bit_rate_kbit_s - 1) <= _NEAR)
    return bool(near >= LEAST_EVENTS and near >= _SHARP * np.count_nonzero(rates >= _ABOUT * bit_rate_kbit_s))


def late_stamps_us(stretch: ClockStretch, wire_us: Floats) -> float:
    """Time by which frames come closer than the bus sends them, stamped at their ends or at their starts [us].

    `wire_us` is the least time of each frame of the stretch on the wire [us].
    """
    sent_us = np.concatenate(([0.0], wire_us.cumsum()))
    ahead_us = [us - stretch.times_us for us in (sent_us[1:], sent_us[:-1])]
    late_us = min(float((us - np.minimum.accumulate(us)).max()) for us in ahead_us)
    # A frame that no other one follows so soon may be as late, and as late again as the longest frame is.
    return late_us + float(wire_us.max()) if late_us > step_us(stretch) else late_us


def stamps_of_no_bus(bit_rate_kbit_s: float) -> str:
    """Reason why a least bit rate shows stamps of no bus; empty where they may be of one."""
    if bit_rate_kbit_s <= MOST_BIT_RATE:
        return ""
    return (
        f"its frames need {bit_rate_kbit_s:,.0f} kbit/s, more than a CAN bus has: the stamps are not those of the bus"
    )


def faults(frames: CanFrames, stretch: ClockStretch) -> Iterator[str]:
    """Sentences on damage of a log, and on its clock."""
    if frames.broken:
        yield f"The log is cut or damaged after frame {len(frames.times_us):,}, read up to there: {frames.broken}."
    if stretch.steps_back:
        yield f"Its clock was set back {plural(stretch.steps_back, 'time')}: the longest stretch between is used."
    if stretch.sorted_us:
        yield f"Its frames are up to {stretch.sorted_us / 1000:.3g} ms out of order, as from several queues: sorted."
