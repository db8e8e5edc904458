"""Period, lateness and quantiles of events, from their stamps."""

from math import ceil, hypot, inf, log, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
LEAST_EVENTS: Final = 10
"""Events for a period, at least."""
_BLOCK: Final = 500
"""Events of a block, over which a clock counts as even."""
_BLOCKS: Final = range(8, 513)
"""Allowed numbers of blocks."""
_ALONE: Final = 40
"""Number of events below which each is a block."""
_FEW: Final = 6.0
"""Enlargement of the scatter of n events, times n, as a share: 99.9 % bound for n - 2 degrees of freedom."""
_LEAST_ERROR_US: Final = 1e-6
_DRIFT_SIGMAS: Final = 8.0
"""Excess of the blocks' reduced chi-square about a line over 1 that shows clock drift [standard errors]."""
_REACH: Final = 4.0
"""Range about the period in which the most favourable clock is searched [standard errors]."""
_THIRDS: Final = 25
"""Steps of that search, each to two thirds of the range."""
_EARLY_SHARE: Final = 0.999
"""Quantile that counts as the earliest event; stamps of the few before it may be wrong."""
_AHEAD: Final = 20
"""Events after a block that are also read, so that a late event at its end is seen."""
_ROUNDING: Final = 1e-6
"""Events by which float rounding may lift a point over a line."""
_DECIMALS: Final = 9
"""Decimals of a time in seconds; stamps have no more."""
_COVERAGE: Final = 2
"""Coverage factor k of an expanded uncertainty."""


class Quantile(NamedTuple):
    """A quantile of n values."""

    value: float
    uncertainty: float | None
    """Standard uncertainty; None where too few values lie beyond the quantile, as for the largest."""


class Events(NamedTuple):
    """Events that a recorded figure is made of, n of them in any order."""

    values: Floats
    """Value of each in the unit of the figure; of a count, how much each adds to it."""
    times_s: Floats
    """Time of each from the first frame of the recording [s]."""
    frames: npt.NDArray[np.integer[Any]]
    """Number of the frame of each in the recording, from 1."""

    def earliest(self, chosen: npt.NDArray[np.bool_]) -> tuple[float, int]:
        """Time [s] and frame of the earliest of the chosen events, of which there is at least one."""
        places = np.flatnonzero(chosen)
        place = places[np.lexsort((self.frames[places], self.times_s[places]))[0]]
        return round(float(self.times_s[place]), _DECIMALS), int(self.frames[place])


class PeriodicEvents(NamedTuple):
    """Events that come once a period."""

    period_us: float
    uncertainty_us: float
    """Standard uncertainty of the period from the scatter of the events [us]."""
    late_us: Floats
    """Delay of each event against its period, about 0, without drift of the clock [us]."""
    doubt_us: float
    """Standard uncertainty of the delays due to drift of the clock, without that of the period [us]."""
    places: npt.NDArray[np.int64]
    """Number of each event's period, from 0."""

    @property
    def missing(self) -> int:
        """Number of periods without an event."""
        return int(self.places[-1]) + 1 - len(self.places)

    @property
    def gaps(self) -> tuple[npt.NDArray[np.int64], Floats]:
        """Index of each event with periods without one behind it, and the number of these periods."""
        behind = np.diff(self.places) - 1
        before = np.flatnonzero(behind)
        return before, behind[before].astype(np.float64)


class Lateness(NamedTuple):
    """Delay of a quantile of events after the earliest."""

    value: float
    uncertainty: float
    """Standard uncertainty [us]."""
    late_us: Floats
    """Delay of each event after the earliest, by the likeliest period or by the most favourable one: the less [us]."""


def quantile(values: Floats, share: float) -> Quantile:
    """Value that a share 0..1 of one or more values does not exceed, with the uncertainty due to its rank.

    The rank is rounded up, so that the quantile is one of the values.

    Examples
    --------
    >>> quantile(np.arange(1.0, 1001.0), 0.9).value, quantile(np.array([3.0, 1.0]), 1)
    (900.0, Quantile(value=3.0, uncertainty=None))
    """
    ordered = np.sort(values)
    count = len(ordered)
    rank = _rank(count, share)
    spread = _COVERAGE * sqrt(count * share * (1 - share))
    low, high = ceil(rank - spread), ceil(rank + spread)
    value = float(ordered[rank - 1])
    if share == 1 or low < 1 or high > count:
        return Quantile(value, None)
    return Quantile(value, float(ordered[high - 1] - ordered[low - 1]) / (2 * _COVERAGE))


def lateness(events: PeriodicEvents, share: float) -> Lateness:
    """Delay of a quantile of the events after the earliest [us].

    The period is uncertain, so the most favourable one counts, which has the least delay. The uncertainty covers the
    other periods, and the rank if enough events lie beyond the quantile.
    """
    at, early = events.places - float(np.mean(events.places)), max(share, _EARLY_SHARE)

    def spread_us(slope: float) -> float:
        late = events.late_us - slope * at
        return _ranked(late, share) + _ranked(-late, early)

    low, high = -_REACH * events.uncertainty_us, _REACH * events.uncertainty_us
    for _ in range(_THIRDS):
        third = (high - low) / 3
        if spread_us(low + third) < spread_us(high - third):
            high -= third
        else:
            low += third
    late = events.late_us - (low + high) / 2 * at
    latest, earliest = quantile(late, share), quantile(-late, early)
    value = latest.value + earliest.value
    others = max(spread_us(sign * _COVERAGE * events.uncertainty_us) for sign in (-1, 1)) - value
    parts = latest.uncertainty or 0.0, earliest.uncertainty or 0.0, max(others, 0.0) / _COVERAGE, events.doubt_us
    surely_us = np.minimum(late + earliest.value, events.late_us + quantile(-events.late_us, early).value)
    return Lateness(value, hypot(*parts), surely_us)


def _ranked(values: Floats, share: float) -> float:
    """Value that a share of some values does not exceed."""
    place = _rank(len(values), share) - 1
    return float(np.partition(values, place)[place])


def _rank(count: int, share: float) -> int:
    return min(max(ceil(count * share - 1e-9), 1), count)


def periodic_events(times_us: Floats, near_us: float | None = None) -> PeriodicEvents | None:
    """Period of events at ascending times [us], and delay of each; None for too few, or for several at once.

    `near_us` is an estimate of the period; None for the median distance.

    Examples
    --------
    >>> found = periodic_events(np.array([0.0, 100, 200, 301, 400, 500, 600, 700, 900, 1000, 1100]))
    >>> round(found.period_us, 1), found.missing
    (100.0, 1)
    """
    if len(times_us) < LEAST_EVENTS:
        return None
    period_us = _period(times_us, float(np.median(np.diff(times_us))) if near_us is None else near_us)
    if period_us <= 0:
        return None
    places = _places(times_us, period_us)
    late = times_us - times_us[0] - places * period_us
    clock = _clock(places.astype(np.float64), late)
    return PeriodicEvents(period_us + clock.slope_us, clock.error_us, late - clock.at_us, clock.doubt_us, places)


def ahead(times_us: Floats, period_us: float) -> Floats:
    """Time by which each event comes too early: less than k periods after the event k before it [us].

    Its maximum is the least jitter for which events at ascending times fit the period [us].

    References
    ----------
    Richter 2005, standard event models: at most ceil((w + J) / T) events in a time w.

    Examples
    --------
    >>> float(ahead(np.array([0.0, 100, 130, 300]), 100).max())
    70.0
    """
    early = np.arange(len(times_us)) * period_us - times_us
    return np.asarray(early - np.minimum.accumulate(early), dtype=np.float64)


def policed(times_us: Floats, period_us: float, allowed_us: float) -> Floats:
    """Time by which each event at ascending times comes sooner than a period after the last that counts [us].

    An event that comes too soon by more than is allowed does not count for those behind it: of one event too many all
    others are `ahead`, and here only itself.

    References
    ----------
    ITU-T I.371, generic cell rate algorithm.

    Examples
    --------
    >>> times_us = np.array([0.0, 100, 130, 200, 300])
    >>> policed(times_us, 100, 20).tolist(), ahead(times_us, 100).tolist()
    ([0.0, 0.0, 70.0, 0.0, 0.0], [0.0, 0.0, 70.0, 100.0, 100.0])
    """
    early_us, due_us = np.zeros(len(times_us)), -inf
    for place, us in enumerate(times_us.tolist()):
        early_us[place] = max(due_us - us, 0.0)
        if early_us[place] <= allowed_us:
            due_us = max(due_us, us) + period_us
    return early_us


def steady_rate(times_us: Floats, window_us: float) -> float:
    """Slope of the arrival curve's concave hull at a window: the most events of windows about so long [1/us].

    The arrival curve is the largest number n of events within a time w, anywhere; times are ascending [us]. Of all
    rates r with the burst b for which b + r w bounds the curve, this one has the least b + r w at the window. It is 0
    if all events come in less time.

    References
    ----------
    J.-Y. Le Boudec, P. Thiran, Network Calculus, 2001: arrival curves, and token buckets that hold them.

    Examples
    --------
    Five at once, each second:

    >>> times_us = np.repeat(np.arange(10) * 1e6, 5)
    >>> steady_rate(times_us, 1e3), steady_rate(np.zeros(5), 1e3)
    (5e-06, 0.0)
    """
    count, span_us = len(times_us), float(times_us[-1] - times_us[0])
    if span_us <= window_us:
        return 0.0
    order = np.arange(count)
    left, right = (1, 0.0), (count, span_us)
    while True:
        rate = (right[0] - left[0]) / (right[1] - left[1])
        excess = order - rate * times_us
        least = np.minimum.accumulate(excess)
        last = int(np.argmax(excess - least))
        first = int(np.argmax(excess[: last + 1] == least[last]))
        number, apart_us = last - first + 1, float(times_us[last] - times_us[first])
        # No point of the curve lies above the line from the one before the window to the one behind it.
        if number <= left[0] + rate * (apart_us - left[1]) + _ROUNDING or not left[1] < apart_us < right[1]:
            if apart_us == left[1] == 0 and number > left[0]:
                left = (number, 0.0)
                continue
            return rate
        if apart_us <= window_us:
            left = (number, apart_us)
        else:
            right = (number, apart_us)


def _period(times_us: Floats, period_us: float) -> float:
    """Period from medians over ever longer distances [us]. Each estimate shows how many periods the next one spans."""
    lag = 1
    while period_us > 0:
        lag = min(lag * 8, len(times_us) // 2)
        apart = times_us[lag:] - times_us[:-lag]
        period_us = float(np.median(apart / np.maximum(np.rint(apart / period_us), 1)))
        if lag == len(times_us) // 2:
            break
    return period_us


def _places(times_us: Floats, period_us: float) -> npt.NDArray[np.int64]:
    """Number of each event's period, from 0, in blocks that follow the drift of the clock."""
    places = np.empty(len(times_us), dtype=np.int64)
    planned_us, number = float(times_us[0]), 0
    for first in range(0, len(times_us), _BLOCK):
        some_us = times_us[first : first + _BLOCK + _AHEAD]
        order = np.arange(len(some_us))
        place = np.rint((some_us - planned_us) / period_us).astype(np.int64)
        # Of two events in one period, the first is late by more than half a period and belongs to the period before.
        place = np.maximum(np.minimum.accumulate((place - order)[::-1])[::-1] + order, order)[:_BLOCK]
        places[first : first + _BLOCK] = number + place
        behind = int(place[-1]) + 1
        planned_us += float(np.median(some_us[:_BLOCK] - planned_us - place * period_us)) + behind * period_us
        number += behind
    return places


class _Clock(NamedTuple):
    """The clock of some events, compared with an ideal clock."""

    at_us: Floats
    """Difference at each event [us]."""
    slope_us: float
    """Difference per period [us]."""
    error_us: float
    """Standard uncertainty of the slope [us]."""
    doubt_us: float
    """Standard uncertainty of the differences, without that of the slope [us]."""


def _clock(places: Floats, late: Floats) -> _Clock:
    """A line through the means of blocks of events, in several pieces where the clock drifts.

    Outliers are clipped. The scatter is that of consecutive events, which drift does not change.
    """
    count = len(late)
    if count >= _ALONE:
        count = min(max(count // _BLOCK, _BLOCKS.start), _BLOCKS.stop - 1)
    blocks = np.array_split(np.arange(len(late)), count)
    sizes = np.array([len(block) for block in blocks])
    at = np.array([places[block].mean() for block in blocks])
    middle_us = np.repeat([np.median(late[block]) for block in blocks], sizes)
    low, high = np.quantile(late - middle_us, (0.05, 0.95))
    kept = middle_us + np.clip(late - middle_us, 2 * low - high, 2 * high - low)
    scatter_us = max(sqrt(float(np.mean(np.diff(kept) ** 2)) / 2) * (1 + _FEW / len(late)), _LEAST_ERROR_US)
    weight = np.sqrt(sizes) / scatter_us
    means = np.array([kept[block].mean() for block in blocks]) * weight
    pieces = 1
    while True:
        knots = np.interp(np.linspace(0, count - 1, pieces + 1), np.arange(count), at)
        knots[[0, -1]] = places[[0, -1]]
        parts = np.stack([np.interp(at, knots, bend) for bend in np.eye(pieces + 1)], axis=1) * weight[:, None]
        heights = np.linalg.lstsq(parts, means, rcond=None)[0]
        free = count - pieces - 1
        misfit = float(np.sum((means - parts @ heights) ** 2)) / free
        if misfit <= 1 + _DRIFT_SIGMAS * sqrt(2 / free) or 4 * pieces > count:
            break
        pieces *= 2
    covariance = np.linalg.inv(parts.T @ parts) * max(misfit, 1.0)
    length = float(knots[-1] - knots[0])
    slope_us = float(heights[-1] - heights[0]) / length
    error_us = sqrt(float(covariance[0, 0] + covariance[-1, -1] - 2 * covariance[0, -1])) / length
    # Residual of the blocks about the pieces, and the largest of so many normal errors.
    left_us = sqrt(max(misfit - 1.0, 0.0) * float(np.mean(weight**-2)))
    bent_us = sqrt(2 * log(pieces + 1) * float(covariance.diagonal().max())) if pieces > 1 else 0.0
    return _Clock(np.interp(places, knots, heights), slope_us, error_us, hypot(left_us, bent_us))


def line(sizes: Floats, values: Floats, doubt: float) -> tuple[float, float] | None:
    """Slope of the medians of values over their sizes, with its standard uncertainty; None for fewer than two sizes.

    Sizes with fewer than ten values are left out. If the medians scatter about the line more than their errors explain,
    the Birge ratio enlarges the uncertainty. `doubt` is a standard uncertainty common to all values of a size, in their
    unit.
    """
    rows = []
    for size in np.unique(sizes):
        of_size = values[sizes == size]
        if len(of_size) >= LEAST_EVENTS:
            median = quantile(of_size, 0.5)
            rows.append((float(size), median.value, max(hypot(median.uncertainty or 0.0, doubt), _LEAST_ERROR_US)))
    if len(rows) < 2:  # noqa: PLR2004 - a line
        return None
    x, y, error_of = (np.array(part) for part in zip(*rows, strict=True))
    weight = 1 / error_of**2
    mean_x, mean_y = np.average(x, weights=weight), np.average(y, weights=weight)
    spread = float(np.sum(weight * (x - mean_x) ** 2))
    slope = float(np.sum(weight * (x - mean_x) * (y - mean_y))) / spread
    left = y - mean_y - slope * (x - mean_x)
    birge = sqrt(float(np.sum(weight * left**2)) / (len(rows) - 2)) if len(rows) > 2 else 1.0  # noqa: PLR2004
    return slope, max(birge, 1.0) / sqrt(spread)


def step(times_ns: npt.NDArray[np.int64]) -> float:
    """Step of the stamps: greatest common divisor of their distances [us]."""
    return int(np.gcd.reduce(np.abs(np.diff(times_ns)))) / 1000


def expanded(*uncertainties: float | None, stamps_us: float = 0.0) -> float | None:
    """Expanded uncertainty, twice the root sum of squares, and the error of stamps; None if a part is None."""
    total = sqrt(sum(inf if part is None else part**2 for part in uncertainties))
    return None if total == inf else _COVERAGE * total + stamps_us
