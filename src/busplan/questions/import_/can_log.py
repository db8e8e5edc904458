"""Logs of a CAN bus: candump -l, ASC, BLF, TRC. Identifiers, lengths, periods, jitter, bursts, and a least bit rate."""

from collections.abc import Iterable, Iterator
from math import floor, log10
from pathlib import Path, PurePath
from typing import Final, NamedTuple

import numpy as np

from busplan.buses.rule import CLOCK_TOLERANCE
from busplan.english import first_of, plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.questions.import_.can import BIT_RATE, LEAST, SHOWN
from busplan.questions.import_.can_database import EXTENDED
from busplan.questions.import_.reading import Fact, Reading, assumed
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.can_timing import (
    LISTED,
    ClockStretch,
    EventModel,
    SentFrames,
    event_model,
    faults,
    frames_by_identifier,
    least_bit_rate,
    longest_stretch,
    stamps_of_no_bus,
    step_us,
)
from busplan.recordings.statistics import LEAST_EVENTS, Floats, expanded

_BIT_RATES: Final = (33.3, 50.0, 83.3, 100.0, 125.0, 250.0, 500.0, 800.0, 1000.0)
"""Usual bit rates [kbit/s]."""
_NEAR: Final = 0.02
"""How far beside a bit rate frames that follow each other at once may seem to be, by their stamps, as a share."""
_ABOUT: Final = 0.9
"""Frames that are this share of a bit rate, or more, seem to follow each other at once."""
_SHARP: Final = 0.8
"""Share of them that are at the bit rate itself, where it is that of the bus."""
_LEAST_US: Final = 30.0
"""No two frames of an identifier are closer [us]."""
_MOST_US: Final = 1e8
"""Longest period, so that several of them are no longer than a profile allows [us]."""
_MOST_DEADLINE_US: Final = 1e9


class _Timing(NamedTuple):
    """When an identifier is sent."""

    sent: SentFrames
    period_us: float
    model: EventModel
    uncertainty_us: float | None
    """Expanded uncertainty of the period; None of a message that is not periodic [us]."""

    @property
    def is_periodic(self) -> bool:
        """Whether it comes once a period."""
        return self.uncertainty_us is not None


def read(path: Path, name: str, *, channel: str | None, progress: Progress) -> Reading:
    """Read a log.

    Parameters
    ----------
    path
        The file.
    name
        Its name in messages.
    channel
        Of several channels, the name of the one that is read.
    progress
        Called with the bytes read and the size of the file [bytes].

    Raises
    ------
    BusplanError
        The extra is not installed, or it is no log of one channel that shows when frames come.
    """
    frames = read_can(path, channel=channel, progress=progress)
    if frames.synthetic:
        raise BusplanError(f"{name}: is {frames.synthetic}: it measures no machine, and its profile is there already")
    stretch = longest_stretch(frames)
    messages = frames_by_identifier(frames, stretch).values()
    least = least_bit_rate(frames, stretch).likely
    _require_times(stretch, messages, least, name)
    machine = Reading("can", "CAN log", name, rank=2, lists_all=False, is_log=True)
    length_us, error_us = float(stretch.times_us[-1] - stretch.times_us[0]), step_us(stretch)
    timings = [_timing(sent, length_us, error_us) for sent in messages]
    for timing in timings:
        number = timing.sent.identifier + EXTENDED * timing.sent.extended
        machine.messages[number] = dict(_facts(timing, PurePath(name).name))
    machine.remarks += _remarks(frames, stretch, timings, length_us)
    _bit_rate(machine, frames, stretch, least)
    return machine


def _require_times(stretch: ClockStretch, messages: Iterable[SentFrames], least_kbit_s: float, name: str) -> None:
    """Refuse a log that does not show when frames come."""
    often = [sent for sent in messages if len(sent.times_us) >= LEAST_EVENTS]
    if not often:
        raise BusplanError(
            f"{name}: {plural(len(stretch.taken), 'frame')}, none of an identifier that comes {LEAST_EVENTS} times: "
            "too few for a plan; record for longer"
        )
    fastest = min(often, key=lambda sent: sent.mean.value)
    error_us = step_us(stretch)
    if not error_us or 2 * error_us > fastest.mean.value:
        steps = f"steps of {error_us:,.0f} us" if error_us else "one time for all frames"
        raise BusplanError(
            f"{name}: its stamps have {steps}, too coarse for {fastest.identifier:#x}, which comes every "
            f"{fastest.mean.value:,.0f} us; record with finer stamps, as `candump -l` has them"
        )
    reason = stamps_of_no_bus(least_kbit_s)
    if reason:
        raise BusplanError(f"{name}: {reason}; record the bus itself, as with `candump -l`")


def _timing(sent: SentFrames, length_us: float, stamp_error_us: float) -> _Timing:
    """Period, jitter and burst that hold all frames of an identifier."""
    if sent.periods is not None:
        period_us, error_us = sent.mean
        doubt = expanded(error_us, CLOCK_TOLERANCE * period_us / 3**0.5) or 0.0
        period_us = _roundest(period_us, doubt / 2)
    else:
        # A frame more may lie in a log of this length.
        doubt, period_us = None, min(max(floor(length_us / (len(sent.times_us) + 1)), _LEAST_US), _MOST_US)
    stamp_error_us = stamp_error_us if len(sent.times_us) > 1 else 0.0
    model = event_model(sent.times_us, period_us, stamp_error_us=stamp_error_us, tolerance=float(CLOCK_TOLERANCE))
    return _Timing(sent, period_us, model, doubt)


def _roundest(value: float, doubt: float) -> float:
    """The number with the fewest digits that lies no further from a value than its doubt.

    Examples
    --------
    >>> _roundest(9999.87, 0.6), _roundest(9998.04, 0.6)
    (10000.0, 9998.0)
    """
    for digits in range(-floor(log10(value)) - 1, 3):
        rounded = round(value, digits)
        if rounded and abs(rounded - value) <= doubt:
            return rounded
    return round(value, 3)


def _facts(timing: _Timing, place: str) -> Iterator[tuple[str, Fact]]:
    sent, (burst, jitter_us) = timing.sent, timing.model
    frames = plural(len(sent.times_us), "frame")
    yield "name", Fact(f"id-{sent.identifier:#x}", place)
    yield "identifier", Fact(sent.identifier + EXTENDED * sent.extended, place, "measured")
    if sent.is_fd:
        yield "is_fd", Fact(True, place, "measured")
        yield "switches", Fact(sent.switches, place, "measured")
    yield "payload_bytes", Fact(sent.most_bytes, place, "measured", "the most seen")
    kind = f"U {timing.uncertainty_us:.2g} us" if timing.is_periodic else "not periodic: the mean distance"
    yield "period_us", Fact(timing.period_us, place, "measured", f"{frames}, {kind}")
    if jitter_us:
        note = "of the arrival, the wait for other frames in it" if timing.is_periodic else "the soonest after another"
        yield "jitter_us", Fact(jitter_us, place, "measured", note)
    if burst > 1:
        yield "burst", Fact(burst, place, "measured", "so many come together")
        deadline_us, note = burst * timing.period_us, "the time in which so many more come"
    else:
        deadline_us, note = timing.period_us + jitter_us, "a period after the latest start"
    if burst > 1 or (jitter_us and not timing.is_periodic):
        yield "deadline_us", Fact(min(deadline_us, _MOST_DEADLINE_US), place, "derived", note)


def _remarks(frames: CanFrames, stretch: ClockStretch, timings: list[_Timing], length_us: float) -> Iterator[str]:
    yield from faults(frames, stretch)
    number = plural(len(stretch.taken), "frame")
    yield f"The log has {number} of {plural(len(timings), 'identifier')} in {length_us / 1e6:.3g} s"
    if frames.errors:
        yield f"{plural(frames.errors, 'error frame')}: in no load"
    if frames.remote:
        yield f"{plural(frames.remote, 'remote frame')}: taken with the data of the length code"
    seldom = [timing for timing in timings if len(timing.sent.times_us) < LEAST_EVENTS]
    if seldom:
        yield f"fewer than {LEAST_EVENTS} frames, so a longer log knows the period better: {_names(seldom)}"
    bursts = [timing for timing in timings if timing.model.burst > 1]
    if bursts:
        yield f"in bursts, each with the most that the log has together: {_names(bursts)}"


def _names(timings: Iterable[_Timing]) -> str:
    return first_of([f"{timing.sent.identifier:#x}" for timing in timings], LISTED)


def _bit_rate(machine: Reading, frames: CanFrames, stretch: ClockStretch, least_kbit_s: float) -> None:
    """The bit rate that frames directly after each other show, or the least usual one that the log allows."""
    if not least_kbit_s:
        return
    machine.bus[LEAST] = Fact(least_kbit_s)
    bits, apart_us = frames.bits[stretch.taken][1:], np.diff(stretch.times_us)
    rates = 1000 * bits / np.maximum(apart_us, 1e-3)
    allowed = [rate for rate in _BIT_RATES if rate >= least_kbit_s]
    shown = [rate for rate in allowed if _is_shown(rate, rates)]
    why = f"no less than {least_kbit_s:.3g} kbit/s by the log, for frames do not overlap"
    if shown:
        why = f"{shown[0]:g} kbit/s by frames of the log directly after each other"
        machine.bus[BIT_RATE] = machine.bus[SHOWN] = assumed(shown[0], "by frames of the log directly after each other")
    else:
        machine.bus[BIT_RATE] = assumed(allowed[0], f"the least usual one that is {why}")
    machine.remarks.append(f"The bit rate is {why}")


def _is_shown(bit_rate_kbit_s: float, rates: Floats) -> bool:
    """Whether frames follow the ones before as at a bit rate, and hardly any closer or a little later."""
    near = np.count_nonzero(np.abs(rates / bit_rate_kbit_s - 1) <= _NEAR)
    return bool(near >= LEAST_EVENTS and near >= _SHARP * np.count_nonzero(rates >= _ABOUT * bit_rate_kbit_s))
