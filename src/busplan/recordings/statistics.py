"""Periods, lateness and quantiles of stamps."""

from math import ceil, hypot, inf, sqrt
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
LEAST_EVENTS: Final = 10
"""Fewest events that have a period."""
_BLOCK: Final = 500
"""Events over which a clock runs evenly."""
_LEAST_BLOCKS: Final = 4
_LEAST_ERROR_US: Final = 1e-6
_ROUNDING_US: Final = 1e-3
"""What the rounding of times may add to a jitter [us]."""
_LEAST_STEP: Final = 1e-9
"""Where a search by halves ends, as a share of the value."""
_DRIFT_SIGMAS: Final = 10.0
"""How far beyond 1 the mean square of the distances of medians from a line, in their standard errors, is a drift."""
_EARLY_SHARE: Final = 0.999
"""Share of the events that are taken for no earlier than the earliest: a stamp may be wrong."""
_AHEAD: Final = 20
"""Events behind a block that tell a late one at its end."""
_COVERAGE: Final = 2
"""Standard uncertainties of an expanded one."""
_MEDIAN_SHARE: Final = 1.2533
"""Standard error of a median, of that of a mean of normal values: sqrt(pi / 2)."""
_QUARTILES_OF_NORMAL: Final = 1.349
"""Distance of the quartiles of a normal distribution in standard deviations."""


class Quantile(NamedTuple):
    """A quantile of n values."""

    value: float
    uncertainty: float | None
    """Standard uncertainty; None where too few values lie beyond to say it, as beyond the largest."""


class PeriodicEvents(NamedTuple):
    """Events that come once a period."""

    period_us: float
    uncertainty_us: float
    """Standard uncertainty of the period, of what the events scatter."""
    late_us: Floats
    """Each event behind its place in the period, the middle of them at 0, without the drift of clocks [us]."""
    doubt_us: float
    """Standard uncertainty of the places [us]."""
    places: npt.NDArray[np.int64]
    """Number of the period of each event, from 0."""

    @property
    def missing(self) -> int:
        """Periods without an event."""
        return int(self.places[-1]) + 1 - len(self.places)


def quantile(values: Floats, share: float) -> Quantile:
    """The value that a share of some values does not exceed, with the uncertainty of its rank.

    Parameters
    ----------
    values
        Values, n of them, at least one.
    share
        The share, 0..1; the value itself is one of those given, rounded up.

    Examples
    --------
    >>> quantile(np.arange(1.0, 1001.0), 0.9).value, quantile(np.array([3.0, 1.0]), 1)
    (900.0, Quantile(value=3.0, uncertainty=None))
    """
    ordered = np.sort(values)
    count = len(ordered)
    rank = min(max(ceil(count * share - 1e-9), 1), count)
    spread = _COVERAGE * sqrt(count * share * (1 - share))
    low, high = ceil(rank - spread), ceil(rank + spread)
    value = float(ordered[rank - 1])
    if share == 1 or low < 1 or high > count:
        return Quantile(value, None)
    return Quantile(value, float(ordered[high - 1] - ordered[low - 1]) / (2 * _COVERAGE))


def lateness(events: PeriodicEvents, share: float) -> Quantile:
    """How much the latest events, but for a share of them, are behind the earliest ones [us]."""
    latest, earliest = quantile(events.late_us, share), quantile(-events.late_us, max(share, _EARLY_SHARE))
    known = expanded(latest.uncertainty, earliest.uncertainty or 0.0, events.doubt_us)
    return Quantile(latest.value + earliest.value, None if known is None else known / _COVERAGE)


def middle(values: Floats) -> Quantile:
    """Median of some values, with its standard error by their quartiles; None of fewer than four."""
    low, value, high = (float(part) for part in np.quantile(values, (0.25, 0.5, 0.75)))
    if len(values) < 4:  # noqa: PLR2004 - quartiles
        return Quantile(value, None)
    return Quantile(value, _MEDIAN_SHARE * (high - low) / _QUARTILES_OF_NORMAL / sqrt(len(values)))


def grid(times_us: Floats) -> PeriodicEvents | None:
    """Find the period of events, and how late each is; None of too few events, or of several at once.

    Parameters
    ----------
    times_us
        Ascending times, n of them [us].

    Examples
    --------
    >>> found = grid(np.array([0.0, 100, 200, 301, 400, 500, 600, 700, 900, 1000, 1100]))
    >>> round(found.period_us, 3), found.missing
    (100.0, 1)
    """
    if len(times_us) < LEAST_EVENTS:
        return None
    period_us = _period(times_us)
    if period_us <= 0:
        return None
    places = _places(times_us, period_us)
    late = times_us - times_us[0] - places * period_us
    late, slope, error, bend_us = _without_drift(places.astype(np.float64), late)
    # The places of the first and of the last event scatter as all do.
    doubt_us = hypot(float(np.std(late)) * sqrt(3 / len(late)), bend_us)
    return PeriodicEvents(period_us + slope, error, late, doubt_us, places)


def ahead(times_us: Floats, period_us: float) -> Floats:
    """How much sooner each event comes than a period behind each other allows, seen from any event before it [us].

    The largest is the least jitter with which events are those of the period.

    Parameters
    ----------
    times_us
        Ascending times, n of them [us].
    period_us
        The period [us].

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


def _period(times_us: Floats) -> float:
    """The period: medians over ever longer distances, each of which says how many periods the next one is."""
    lag, period_us = 1, float(np.median(np.diff(times_us)))
    while period_us > 0:
        lag = min(lag * 8, len(times_us) // 2)
        apart = times_us[lag:] - times_us[:-lag]
        period_us = float(np.median(apart / np.maximum(np.rint(apart / period_us), 1)))
        if lag == len(times_us) // 2:
            break
    return period_us


def _places(times_us: Floats, period_us: float) -> npt.NDArray[np.int64]:
    """Number of the period of each event; blocks follow the drift of a clock."""
    places = np.empty(len(times_us), dtype=np.int64)
    planned_us, number = float(times_us[0]), 0
    for first in range(0, len(times_us), _BLOCK):
        ahead = times_us[first : first + _BLOCK + _AHEAD]
        order = np.arange(len(ahead))
        place = np.rint((ahead - planned_us) / period_us).astype(np.int64)
        # Of two events with one place the first is late by more than half a period, for none has the place of another.
        place = np.maximum(np.minimum.accumulate((place - order)[::-1])[::-1] + order, order)[:_BLOCK]
        places[first : first + _BLOCK] = number + place
        behind = int(place[-1]) + 1
        planned_us += float(np.median(ahead[:_BLOCK] - planned_us - place * period_us)) + behind * period_us
        number += behind
    return places


def _without_drift(places: Floats, late: Floats) -> tuple[Floats, float, float, float]:
    """Lateness about a straight line, its slope and the standard error of that; where clocks drift, about a bent one.

    The last value is the standard error of the bends. The line goes through medians of blocks. A clock drifts where
    they lie further off than they scatter.
    """
    blocks = np.array_split(np.arange(len(late)), max(len(late) // _BLOCK, _LEAST_BLOCKS))
    at = np.array([places[block].mean() for block in blocks])
    found = [middle(late[block]) for block in blocks]
    value = np.array([median.value for median in found])
    error_of = np.array([max(median.uncertainty or 0.0, _LEAST_ERROR_US) for median in found])
    weight = 1 / error_of**2
    centre, level = np.average(at, weights=weight), np.average(value, weights=weight)
    spread = float(np.sum(weight * (at - centre) ** 2))
    slope = float(np.sum(weight * (at - centre) * (value - level))) / spread
    left = value - level - slope * (at - centre)
    free = len(blocks) - 2
    misfit = float(np.sum(weight * left**2)) / free
    straight, bend_us = level + slope * (places - centre), 0.0
    if misfit > 1 + _DRIFT_SIGMAS * sqrt(2 / free):
        straight, bend_us = straight + np.interp(places, at, left), float(np.mean(error_of))
    return late - straight, slope, sqrt(max(misfit, 1.0) / spread), bend_us


def line(sizes: Floats, values: Floats) -> tuple[float, float] | None:
    """Slope of the medians of values over their sizes, with its standard uncertainty; None of fewer than two sizes.

    Sizes with fewer than ten values are left out. Where medians scatter more about the line than their own errors say,
    the uncertainty is as much larger (Birge).

    Parameters
    ----------
    sizes, values
        Of n things.
    """
    rows = []
    for size in np.unique(sizes):
        of_size = values[sizes == size]
        if len(of_size) >= LEAST_EVENTS:
            value, error = middle(of_size)
            rows.append((float(size), value, max(error or 0.0, _LEAST_ERROR_US)))
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
    """Step of the stamps: the largest time that all distances are multiples of [us]."""
    apart = np.diff(times_ns)
    found = int(np.gcd.reduce(np.abs(apart))) if len(apart) else 0
    return found / 1000


def expanded(*uncertainties: float | None) -> float | None:
    """Expanded uncertainty, twice the root sum of squares; None where a part is not known."""
    total = sqrt(sum(inf if part is None else part**2 for part in uncertainties))
    return None if total == inf else _COVERAGE * total
