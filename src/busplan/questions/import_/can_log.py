"""Logs of a CAN bus: candump -l, ASC, BLF, TRC. Identifiers, lengths, periods and jitter, and a least bit rate."""

from collections.abc import Iterable, Iterator
from math import ceil, floor, log10
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from busplan.buses.recorded import CLOCK_TOLERANCE
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.questions.import_.can_database import EXTENDED
from busplan.questions.import_.record import Fact, Reading
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.can_messages import ClockStretch, SentFrames, faults, listed, longest_stretch, sent_messages
from busplan.recordings.statistics import LEAST_EVENTS, Floats, expanded, sporadic_jitter, sporadic_period, step
from busplan.recordings.words import counted

_BIT_RATES: Final = (33.3, 50.0, 83.3, 100.0, 125.0, 250.0, 500.0, 800.0, 1000.0)
"""Usual bit rates [kbit/s]."""
_KEY: Final = "bit_rate_kbit_s"
_USUAL: Final = 500.0
"""Assumed where the log allows it [kbit/s]."""
_CLOCKS: Final = 0.01
"""How far a bit rate and the clock of a recorder are off, and how early a frame may begin, as a share."""
_NEAR: Final = 0.02
"""How far beside a bit rate frames that follow each other at once may seem to be, by their stamps, as a share."""
_ABOUT: Final = 0.9
"""Frames that are this share of a bit rate, or more, seem to follow each other at once."""
_SHARP: Final = 0.8
"""Share of them that are at the bit rate itself, where it is that of the bus."""
_LEAST_US: Final = 30.0
"""No two frames of an identifier are closer [us]."""
_MOST_US: Final = 5e8
"""Longest period: half of what a profile takes, for the deadline may be twice as long [us]."""


class _Timing(NamedTuple):
    """When an identifier is sent."""

    sent: SentFrames
    period_us: float
    jitter_us: float
    uncertainty_us: float | None
    """Expanded uncertainty of the period; None of a message that is not periodic [us]."""


def read(path: Path, name: str, *, progress: Progress) -> Reading:
    """Read a log.

    Parameters
    ----------
    path
        The file.
    name
        Its name in messages.
    progress
        Called with the bytes read and those of the file.

    Raises
    ------
    BusplanError
        The extra is not installed, or it is no log of one channel with frames at several times.
    """
    frames = read_can(path, progress=progress)
    stretch = longest_stretch(frames)
    length_us = float(stretch.times_us[-1] - stretch.times_us[0])
    if not length_us:
        raise BusplanError(f"{name}: has {counted(len(stretch.taken), 'frame')} at one time, so no period")
    machine = Reading("can", "CAN log", name, rank=2, lists_all=False, is_log=True)
    step_us = step(np.rint(stretch.times_us).astype(np.int64) * 1000)
    timings = [_timing(sent, length_us, step_us) for sent in sent_messages(frames, stretch).values()]
    for timing in timings:
        number = timing.sent.identifier + EXTENDED * timing.sent.extended
        machine.messages[number] = dict(_facts(timing, Path(name).name))
    machine.remarks += _remarks(frames, stretch, timings, length_us)
    _bit_rate(machine, frames, stretch, step_us)
    return machine


def _timing(sent: SentFrames, length_us: float, step_us: float) -> _Timing:
    """Period and jitter of an identifier: of its grid, or those that hold all its frames."""
    if sent.grid is not None:
        # The first frame and the last one lie no further beside their places than all do; the grid took off a slope.
        periods, scatter_us = len(sent.times_us) - 1 + sent.grid.missing, float(np.ptp(sent.grid.late_us))
        period_us = float(sent.times_us[-1] - sent.times_us[0]) / periods
        doubt = expanded(scatter_us / periods, CLOCK_TOLERANCE * period_us / 3**0.5) or 0.0
        period_us = _roundest(period_us, doubt / 2)
        if ceil(scatter_us) <= period_us:
            return _Timing(sent, period_us, ceil(scatter_us), doubt)
    period_us = min(max(floor(sporadic_period(sent.times_us, length_us)), ceil(step_us), _LEAST_US), _MOST_US)
    return _Timing(sent, period_us, min(ceil(sporadic_jitter(sent.times_us, period_us)), period_us), None)


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
    sent = timing.sent
    frames = counted(len(sent.times_us), "frame")
    yield "name", Fact(f"id-{sent.identifier:#x}", place)
    yield "identifier", Fact(sent.identifier + EXTENDED * sent.extended, place, "measured")
    if sent.is_fd:
        yield "is_fd", Fact(True, place, "measured")
    yield "payload_bytes", Fact(sent.most_bytes, place, "measured", "the most seen")
    if timing.uncertainty_us is not None:
        yield "period_us", Fact(timing.period_us, place, "measured", f"{frames}, U {timing.uncertainty_us:.2g} us")
        yield from _jitter(timing, place, "of the arrival, the wait for other frames in it")
        return
    yield "period_us", Fact(timing.period_us, place, "measured", f"{frames}, not periodic: as close as they came")
    yield from _jitter(timing, place, "how much sooner than a period it came")
    if timing.jitter_us:
        note = "a period behind the latest start"
        yield "deadline_us", Fact(timing.period_us + timing.jitter_us, place, "derived", note)


def _jitter(timing: _Timing, place: str, note: str) -> Iterator[tuple[str, Fact]]:
    if timing.jitter_us:
        yield "jitter_us", Fact(timing.jitter_us, place, "measured", note)


def _remarks(frames: CanFrames, stretch: ClockStretch, timings: list[_Timing], length_us: float) -> Iterator[str]:
    yield from faults(frames, stretch)
    number = counted(len(stretch.taken), "frame")
    yield f"The log has {number} of {counted(len(timings), 'identifier')} in {length_us / 1e6:.3g} s"
    if frames.errors:
        yield f"{counted(frames.errors, 'error frame')}: in no load"
    if frames.remote:
        yield f"{counted(frames.remote, 'remote frame')}: taken with the data of the length code"
    seldom = [timing for timing in timings if len(timing.sent.times_us) < LEAST_EVENTS]
    if seldom:
        yield f"fewer than {LEAST_EVENTS} frames, so a longer log knows the period better: {_names(seldom)}"
    often = [timing for timing in timings if len(timing.sent.times_us) >= LEAST_EVENTS]
    bursts = [timing for timing in often if timing.uncertainty_us is None]
    if bursts:
        planned = sum(length_us / timing.period_us for timing in bursts)
        more = planned / sum(len(timing.sent.times_us) for timing in bursts)
        yield (
            f"not periodic: {_names(bursts)}; the closest frames of the log are planned for all time, {more:.2g} times "
            "as many as it has of them: where you know the shortest period, write that"
        )


def _names(timings: Iterable[_Timing]) -> str:
    return listed([f"{timing.sent.identifier:#x}" for timing in timings])


def _bit_rate(machine: Reading, frames: CanFrames, stretch: ClockStretch, step_us: float) -> None:
    """The bit rate that frames behind each other show, or the least usual one that the log allows where 500 is too low.

    Frames do not overlap. They are stamped at their ends, or by some controllers at their starts: the shorter of two
    lies between both stamps in either case. A single stamp may be wrong, ten are not.
    """
    bits, apart_us = frames.bits[stretch.taken].astype(np.float64), np.diff(stretch.times_us)
    least = 1000 * float(bits[1:].sum()) / (float(apart_us.sum()) + step_us)
    rates = 1000 * np.minimum(bits[1:], bits[:-1]) / (apart_us + step_us)
    if len(rates) >= LEAST_EVENTS:
        closest = float(np.partition(rates, -LEAST_EVENTS)[-LEAST_EVENTS])
        # Where no bit rate allows such stamps a driver took several frames at once.
        least = max(least, closest) if closest <= _BIT_RATES[-1] * (1 + _CLOCKS) else least
    allowed = [rate for rate in _BIT_RATES if least <= rate * (1 + _CLOCKS)]
    shown = [rate for rate in allowed if _is_shown(rate, 1000 * bits[1:] / np.maximum(apart_us, step_us))]
    said = f"no less than {least:.3g} kbit/s by the log, for frames do not overlap"
    if shown:
        said = f"{shown[0]:g} kbit/s by frames of the log that follow each other at once"
        machine.bus[_KEY] = Fact(shown[0], "", "assumed", "frames of the log follow each other at once by it")
    elif allowed and allowed[0] > _USUAL:
        machine.bus[_KEY] = Fact(allowed[0], "", "assumed", f"the least usual one that is {said}")
    if shown or 0 < len(allowed) < len(_BIT_RATES):
        machine.remarks.append(f"The bit rate is {said}")


def _is_shown(bit_rate_kbit_s: float, rates: Floats) -> bool:
    """Whether frames follow the ones before as at a bit rate, and hardly any closer or a little later."""
    near = np.count_nonzero(np.abs(rates / bit_rate_kbit_s - 1) <= _NEAR)
    return bool(near >= LEAST_EVENTS and near >= _SHARP * np.count_nonzero(rates >= _ABOUT * bit_rate_kbit_s))
