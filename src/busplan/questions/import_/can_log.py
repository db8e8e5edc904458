"""Logs of a CAN bus: candump -l, ASC, BLF, TRC. Identifiers, lengths, periods, jitter, bursts, and a least bit rate."""

from collections.abc import Iterable, Iterator, Sequence
from math import floor, log10
from pathlib import Path, PurePath
from typing import Final, NamedTuple

import numpy as np

from busplan.buses.can.equations import BASE_BITS, USUAL_DATA_BIT_RATE, frame_us
from busplan.buses.rule import clocks_us
from busplan.english import first_of, plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.questions.import_.can import (
    ASK,
    BIT_RATE,
    FULLEST,
    LEAST,
    MOST_OF_FULLEST,
    SENT,
    SHOWN,
    MostLoad,
    timing_facts,
)
from busplan.questions.import_.can_database import EXTENDED
from busplan.questions.import_.reading import Fact, Reading, assumed
from busplan.recordings import can_timing
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.statistics import LEAST_EVENTS, Floats, ahead, expanded, steady_rate

_LEAST_US: Final = 30.0
"""Least distance of two frames of an identifier [us]."""
_MOST_US: Final = 1e8
"""Longest period, so that several of them are no longer than a profile allows [us]."""
_LONGER: Final = 1.5
"""Factor from one window to the next."""
_ALWAYS: Final = 0.9
"""Least share of the log in which a periodic message comes, so that its period is that of the whole log [1]."""
_ROUNDED: Final = 0.005
"""Largest rounding of the period of a message that is not periodic, as a share [1]."""
_MORE_JITTER: Final = 0.05
"""Largest jitter that rounding a period may add [periods]."""


class _Timing(NamedTuple):
    """Timing of an identifier."""

    sent: can_timing.SentFrames
    period_us: float
    model: can_timing.EventModel
    uncertainty_us: float | None
    """Expanded uncertainty of the period [us]; None for a message that is not periodic."""

    @property
    def is_periodic(self) -> bool:
        """Whether the message comes once a period."""
        return self.uncertainty_us is not None


def read(path: Path, name: str, *, channel: str | None, progress: Progress) -> Reading:
    """Read a log; `channel` is the name of the one to read of several.

    Progress is called with the bytes read and the size of the file [bytes]. A file that is no log of one channel that
    shows when frames come raises BusplanError, and so does a missing extra.
    """
    frames = read_can(path, channel=channel, progress=progress)
    if frames.synthetic:
        raise BusplanError(f"{name}: is {frames.synthetic}: it measures no machine, and its profile is there already")
    try:
        stretch = can_timing.longest_stretch(frames)
    except BusplanError as error:
        raise BusplanError(f"{name}: {error}") from None
    messages = list(can_timing.frames_by_identifier(frames, stretch).values())
    least = can_timing.least_bit_rate(frames, stretch)
    _require_times(stretch, messages, least.likely, name)
    machine = Reading("can", "CAN log", name, rank=2, lists_all=False, is_log=True)
    timings = _timings(messages, stretch)
    for timing in timings:
        number = timing.sent.identifier + EXTENDED * timing.sent.extended
        machine.messages[number] = dict(_facts(timing, stretch, PurePath(name).name))
    machine.remarks += _remarks(frames, stretch, timings)
    fullest = _fullest(messages, stretch)
    machine.bus[FULLEST] = Fact(fullest)
    _bit_rate(machine, frames, stretch, least, fullest)
    return machine


def _require_times(
    stretch: can_timing.ClockStretch, messages: Iterable[can_timing.SentFrames], least_kbit_s: float, name: str
) -> None:
    """Raise BusplanError for a log that does not show when frames come."""
    often = [sent for sent in messages if len(sent.times_us) >= LEAST_EVENTS]
    if not often:
        raise BusplanError(
            f"{name}: {plural(len(stretch.taken), 'frame')}, none of an identifier that comes {LEAST_EVENTS} times: "
            "too few for a plan; record for longer"
        )
    fastest = max(often, key=lambda sent: len(sent.times_us))
    mean_us, error_us = stretch.length_us / len(fastest.times_us), can_timing.step_us(stretch)
    if not error_us or 2 * error_us > mean_us:
        steps = f"steps of {error_us:,.0f} us" if error_us else "one time for all frames"
        raise BusplanError(
            f"{name}: its stamps have {steps}, too coarse for {fastest.identifier:#x}, which comes every "
            f"{mean_us:,.0f} us; record with finer stamps, as `candump -l` has them"
        )
    reason = can_timing.stamps_of_no_bus(least_kbit_s)
    if reason:
        raise BusplanError(f"{name}: {reason}; record the bus itself, as with `candump -l`")


def _timings(messages: Sequence[can_timing.SentFrames], stretch: can_timing.ClockStretch) -> list[_Timing]:
    """Event models of the identifiers that allow all frames, with little more load than the fullest second.

    A periodic message has its period. Any other one has the rate and the burst of its arrival curve at a window of a
    second. Identifiers that come at different times may then have more load than any second has. So the window grows,
    since rates fall with it as bursts grow, until the load is `MOST_OF_FULLEST` of the fullest second, or bursts would
    have grown by more frames than that has.
    """
    longest_us = [_longest_us(sent) for sent in messages]
    most = MOST_OF_FULLEST * float(can_timing.second_loads(*_wire_us(messages, longest_us)).max())
    window_us, share = can_timing.WINDOW_US, 1.0
    rows = [sent.periods is not None for sent in messages]
    before: list[_Timing] = []
    most_at_once_us = 0.0
    while True:
        timings = [
            _periodic(sent, stretch) if is_row else _steady(sent, stretch, window_us, share)
            for sent, is_row in zip(messages, rows, strict=True)
        ]
        loads = [us / timing.period_us for us, timing in zip(longest_us, timings, strict=True)]
        at_once_us = sum(us * timing.model.burst for us, timing in zip(longest_us, timings, strict=True))
        most_at_once_us = most_at_once_us or at_once_us + most / MOST_OF_FULLEST * can_timing.WINDOW_US
        if at_once_us > most_at_once_us:
            return before
        if sum(loads) <= most or share < 1:
            return timings
        before = timings
        if window_us == can_timing.WINDOW_US:
            rows = [is_row and _is_always(sent, stretch) for sent, is_row in zip(messages, rows, strict=True)]
        if window_us > stretch.length_us:
            periodic = sum(load for load, is_row in zip(loads, rows, strict=True) if is_row)
            share = max((most * (1 - _ROUNDED) - periodic) / max(sum(loads) - periodic, 1e-9), 0.1)
            share = min(share, 1 - _ROUNDED)
        window_us *= _LONGER


def _is_always(sent: can_timing.SentFrames, stretch: can_timing.ClockStretch) -> bool:
    """Whether a periodic message comes during nearly all of the log."""
    return float(sent.times_us[-1] - sent.times_us[0]) + sent.mean.value >= _ALWAYS * stretch.length_us


def _longest_us(
    sent: can_timing.SentFrames, bit_rate_kbit_s: float = 500.0, data_bit_rate_kbit_s: float = USUAL_DATA_BIT_RATE
) -> float:
    """Time on the wire of an identifier's longest frame, with the most stuff bits [us]."""
    switched = max(data_bit_rate_kbit_s, bit_rate_kbit_s) if sent.switches else bit_rate_kbit_s
    us = frame_us(
        sent.most_bytes,
        identifier_bits=29 if sent.extended else BASE_BITS,
        bit_rate_kbit_s=bit_rate_kbit_s,
        data_bit_rate_kbit_s=switched if sent.is_fd else 0.0,
        is_stuffed=True,
    )
    return float(us)


def _wire_us(messages: Sequence[can_timing.SentFrames], longest_us: Sequence[float]) -> tuple[Floats, Floats]:
    """Stamps of all frames, ascending, and times on the wire, each as of the longest frame of its identifier [us]."""
    times_us = np.concatenate([sent.times_us for sent in messages])
    wire_us = np.repeat(longest_us, [len(sent.times_us) for sent in messages])
    order = np.argsort(times_us, kind="stable")
    return times_us[order], wire_us[order]


def _fullest(messages: Sequence[can_timing.SentFrames], stretch: can_timing.ClockStretch) -> MostLoad:
    """Load of the log's fullest second by bit rates, and number of its seconds with frames."""

    def load(bit_rate_kbit_s: float, data_bit_rate_kbit_s: float = USUAL_DATA_BIT_RATE) -> float:
        us = [_longest_us(sent, bit_rate_kbit_s, data_bit_rate_kbit_s) for sent in messages]
        return float(can_timing.second_loads(*_wire_us(messages, us)).max())

    seconds = np.unique((stretch.times_us - stretch.times_us[0]) // can_timing.WINDOW_US)
    return MostLoad(load, len(seconds), int(seconds[-1]) + 1)


def _periodic(sent: can_timing.SentFrames, stretch: can_timing.ClockStretch) -> _Timing:
    """Period and jitter of a message that comes once a period."""
    period_us, error_us = sent.mean
    doubt_us = expanded(error_us, clocks_us(period_us)) or 0.0
    return _covering(sent, period_us, doubt_us / 2, stretch)._replace(uncertainty_us=doubt_us)


def _steady(sent: can_timing.SentFrames, stretch: can_timing.ClockStretch, window_us: float, share: float) -> _Timing:
    """Rate and burst of a message that is not periodic; the rate is at least a share of the log's mean rate."""
    rate = max(steady_rate(sent.times_us, window_us), share * len(sent.times_us) / stretch.length_us)
    period_us = min(max(1 / rate, _LEAST_US), _MOST_US)
    return _covering(sent, period_us, _ROUNDED * period_us, stretch)


def _covering(
    sent: can_timing.SentFrames, period_us: float, doubt_us: float, stretch: can_timing.ClockStretch
) -> _Timing:
    """A period rounded within a doubt [us], with the jitter or burst that allows all frames."""
    times_us, error_us = sent.times_us, can_timing.step_us(stretch) if len(sent.times_us) > 1 else 0.0
    least_us = float(ahead(times_us, period_us).max()) + _MORE_JITTER * period_us

    def allows(rounded_us: float) -> bool:
        return rounded_us <= period_us or float(ahead(times_us, rounded_us).max()) <= least_us

    period_us = next(filter(allows, _roundings(period_us, doubt_us)), period_us)
    return _Timing(
        sent, period_us, can_timing.event_model(times_us, period_us, stamp_error_us=error_us, tolerance=0.0), None
    )


def _roundings(value: float, doubt: float) -> Iterator[float]:
    """Numbers no further from a value than its doubt, those with the fewest digits first, the last one just below it.

    Examples
    --------
    >>> next(_roundings(9999.87, 0.6)), list(_roundings(9998.74, 0.8))
    (10000.0, [9999.0, 9998.0, 9998.7, 9998.74])
    """
    for digits in range(-floor(log10(value)) - 1, 3):
        step = 10.0**-digits
        for rounded in dict.fromkeys((round(value, digits), round(floor(value / step) * step, 3))):
            if rounded > 0 and abs(rounded - value) <= doubt:
                yield rounded


def _facts(timing: _Timing, stretch: can_timing.ClockStretch, place: str) -> Iterator[tuple[str, Fact]]:
    sent, model = timing.sent, timing.model
    frames = plural(len(sent.times_us), "frame")
    yield "name", Fact(f"id-{sent.identifier:#x}", place)
    yield "identifier", Fact(sent.identifier + EXTENDED * sent.extended, place, "measured")
    if sent.is_fd:
        yield "is_fd", Fact(True, place, "measured")
        yield "switches", Fact(sent.switches, place, "measured")
    yield "payload_bytes", Fact(sent.most_bytes, place, "measured", "the most seen")
    kind = (
        f"U {timing.uncertainty_us:.2g} us" if timing.is_periodic else ("not periodic: largest rate over a longer time")
    )
    yield "period_us", Fact(timing.period_us, place, "measured", f"{frames}, {kind}")
    yield from timing_facts(model, timing.period_us, place, is_periodic=timing.is_periodic)
    yield SENT, Fact((sent.times_us, can_timing.step_us(stretch)))


def _remarks(frames: CanFrames, stretch: can_timing.ClockStretch, timings: list[_Timing]) -> Iterator[str]:
    yield from can_timing.faults(frames, stretch)
    number = plural(len(stretch.taken), "frame")
    yield f"The log has {number} of {plural(len(timings), 'identifier')} in {stretch.length_us / 1e6:.3g} s"
    if frames.errors:
        yield f"{plural(frames.errors, 'error frame')}: not counted in the load"
    if frames.remote:
        yield f"{plural(frames.remote, 'remote frame')}: taken with the data of the length code"
    seldom = [timing for timing in timings if len(timing.sent.times_us) < LEAST_EVENTS]
    if seldom:
        yield f"fewer than {LEAST_EVENTS} frames, so a longer log knows the period better: {_names(seldom)}"
    bursts = [timing for timing in timings if timing.model.burst > 1]
    if bursts:
        yield f"in bursts, each with the largest burst in the log: {_names(bursts)}"


def _names(timings: Iterable[_Timing]) -> str:
    return first_of([f"{timing.sent.identifier:#x}" for timing in timings], can_timing.LISTED)


def _bit_rate(
    machine: Reading,
    frames: CanFrames,
    stretch: can_timing.ClockStretch,
    least: can_timing.LeastBitRate,
    fullest: MostLoad,
) -> None:
    """Bit rate that frames in direct succession show; else the question for it."""
    machine.bus[LEAST] = Fact(least)
    possible = can_timing.possible_bit_rates(least)
    shown = can_timing.shown_bit_rate(frames, stretch, possible)
    if shown is not None:
        by = "from back-to-back frames in the log"
        machine.bus[BIT_RATE] = machine.bus[SHOWN] = assumed(shown, by)
        machine.remarks.append(f"The bit rate is {shown:g} kbit/s, {by}")
        return
    loads = [(rate, fullest.load(rate)) for rate in possible]
    listed = [f"{100 * load:.2g} % at {rate:g}" for rate, load in loads if load <= 1]
    machine.bus[ASK] = Fact(
        f"{machine.file}: does not show the bit rate of its bus, on which all times depend; give --bit-rate RATE, "
        f"in kbit/s. The load of its fullest second is {', '.join(listed) or 'over 100 % at any'}"
    )
