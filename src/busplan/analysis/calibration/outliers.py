"""Measurements that the others contradict, whatever form the execution time is fitted in.

Three or more repetitions are compared with their median, on the robust spread of all repetitions. What was measured
once or twice is compared with the line through the others and, because an execution time may bend, with its neighbours.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from math import atan, cos, erfc, pi, sin, sqrt
from statistics import fmean, median, median_low
from typing import Final, NamedTuple

from busplan.sections.execution import UNKNOWN_SHARE

OUTLIER_CHANCE: Final = 0.02
"""Chance of an outlier among all measurements of a file where there is none, shared among them (Bonferroni)."""
OUTLIER_SHARE: Final = 0.01
"""Least distance of an outlier, as a share of its latency: the steps of a timer are no outliers."""
DEVIATION_PER_MAD: Final = 1.4826
"""Standard deviation of a normal distribution whose median absolute deviation is 1."""
REPETITIONS_TO_COMPARE: Final = 3
"""Fewest measurements of one payload of which one can be told to be wrong."""
PAYLOADS_TO_COMPARE: Final = 4
"""Fewest payloads of which one can be told to be off a line: two make a line, and a third confirms it."""
_END_BEND: Final = 1.0
"""How much faster than before the slope may change at the last payload."""
_WRONG_SHARE: Final = 0.29
"""Largest share of payloads that may be wrong, that of the Theil-Sen line."""
_MOST_ROUNDS: Final = 32
_NORMAL_FROM: Final = 200
"""Degrees of freedom from which Student's distribution is taken as the normal one."""
_EXACT_US: Final = 1e-6
"""A picosecond: a smaller spread is rounding of the subtraction."""


class Sample(NamedTuple):
    """What one measurement says of the execution time."""

    transaction: str
    payload_bytes: int
    latency_us: float
    execution_us: float
    """T_exec."""


class Screening(NamedTuple):
    """What can be told of outliers; measurements by their place."""

    expected_us: Mapping[int, float]
    """The outliers, with the T_exec that the others say."""
    undecided: tuple[tuple[int, int], ...]
    """Pairs of one payload that contradict each other, and no other measurement says which is right."""
    unchecked_bytes: tuple[int, ...]
    """Payloads with too few measurements to tell an outlier."""


def screen(samples: Sequence[Sample]) -> Screening:
    """Find the measurements that the others contradict.

    Parameters
    ----------
    samples
        Any number of them, in any order.

    References
    ----------
    B. Rosner, "Percentage points for a generalized ESD many-outlier procedure", Technometrics 25 (1983); B. Iglewicz,
    D. Hoaglin, "How to Detect and Handle Outliers" (1993), for the median absolute deviation.

    Examples
    --------
    >>> found = screen([Sample("write", 4, 60.0, time_us) for time_us in (52.1, 200.0, 52.0, 51.9)])
    >>> found.expected_us
    {1: 52.0}
    """
    groups: defaultdict[tuple[str, int], list[int]] = defaultdict(list)
    for place, one in enumerate(samples):
        groups[one.transaction, one.payload_bytes].append(place)
    repeated = _off_their_repetitions(samples, list(groups.values()))
    points = list(_points(samples, list(groups.values()), repeated))
    comparable = len({one.payload_bytes for one in points}) >= PAYLOADS_TO_COMPARE
    single = _off_the_line(points) if comparable else {}
    few = [group for group in groups.values() if len(group) < REPETITIONS_TO_COMPARE]
    return Screening(
        expected_us={**repeated, **single},
        undecided=tuple(_undecided(samples, list(groups.values()), single)),
        unchecked_bytes=() if comparable else tuple(sorted({samples[group[0]].payload_bytes for group in few})),
    )


def chance_beyond(deviations: float, freedom: int) -> float:
    """Chance that a normal value is farther from the mean than these estimated standard deviations.

    Parameters
    ----------
    deviations
        Distance over the estimated standard deviation.
    freedom
        Degrees of freedom of the estimate, at least 1.

    References
    ----------
    M. Abramowitz, I. Stegun, "Handbook of Mathematical Functions" (1964), 26.7.3 and 26.7.4.

    Examples
    --------
    >>> round(chance_beyond(12.706, 1), 4), round(chance_beyond(2.776, 4), 4)
    (0.05, 0.05)
    """
    if freedom >= _NORMAL_FROM:
        return erfc(deviations / sqrt(2))
    angle = atan(deviations / sqrt(freedom))
    odd = freedom % 2
    term, terms = (cos(angle) if odd else 1.0), 0.0
    for step in range(odd, freedom - 1, 2):
        terms += term
        term *= (step + 1) / (step + 2) * cos(angle) ** 2
    return 1 - (2 / pi * (angle + sin(angle) * terms) if odd else sin(angle) * terms)


def _is_beyond(deviations: float, freedom: int, tests: int) -> bool:
    return chance_beyond(deviations, freedom) < OUTLIER_CHANCE / tests


def _distances_us(samples: Sequence[Sample], group: Sequence[int]) -> list[float]:
    """Distance of each from the median of its group [us]; the smallest is left out, for the median follows it."""
    middle_us = median(samples[one].execution_us for one in group)
    return sorted(abs(samples[one].execution_us - middle_us) for one in group)[1:]


def _spread_us(distances_us: Sequence[float]) -> float:
    """Robust standard deviation [us]; no figure may be exactly 0."""
    return max(DEVIATION_PER_MAD * median_low(distances_us), _EXACT_US)


def _off_their_repetitions(samples: Sequence[Sample], groups: Sequence[Sequence[int]]) -> dict[int, float]:
    """Outliers among three or more repetitions, with the median of the others."""
    all_us = [one for group in groups if len(group) > 1 for one in _distances_us(samples, group)]
    found: dict[int, float] = {}
    for group in groups:
        if len(group) < REPETITIONS_TO_COMPARE:
            continue
        middle_us = median(samples[one].execution_us for one in group)
        # Long executions may scatter more than short ones.
        scale_us = max(_spread_us(all_us), _spread_us(_distances_us(samples, group)))
        off = [
            one
            for one in group
            if abs(samples[one].execution_us - middle_us) > OUTLIER_SHARE * samples[one].latency_us
            and _is_beyond(abs(samples[one].execution_us - middle_us) / scale_us, max(len(all_us) - 1, 1), len(samples))
        ]
        rest_us = median(samples[one].execution_us for one in group if one not in set(off))
        found |= dict.fromkeys(off, rest_us)
    return found


class _Point(NamedTuple):
    """One point of the line."""

    place: int | None
    """Place of the measurement; None for the median of three or more, which is no outlier."""
    payload_bytes: int
    latency_us: float
    execution_us: float


def _points(
    samples: Sequence[Sample], groups: Sequence[Sequence[int]], left_out: Mapping[int, float]
) -> Iterator[_Point]:
    for group in groups:
        first = samples[group[0]]
        if len(group) < REPETITIONS_TO_COMPARE:
            yield from (_Point(one, first.payload_bytes, *samples[one][2:]) for one in group)
        else:
            rest_us = median(samples[one].execution_us for one in group if one not in left_out)
            yield _Point(None, first.payload_bytes, first.latency_us, rest_us)


def _off_the_line(points: Sequence[_Point]) -> dict[int, float]:
    """Outliers among what was measured once or twice, with the T_exec of the line through the others.

    Leave out the point that is farthest from the line through the others, in its standard deviations, and repeat; the
    last one that is too far for chance, and all before it, are suspects. So one outlier hides no other. A suspect that
    continues its neighbours as a curve would is none.
    """
    payloads = len({one.payload_bytes for one in points})
    rest, taken, suspects = list(points), list[_Point](), 0
    for _ in range(min(max(1, int(_WRONG_SHARE * payloads)), _MOST_ROUNDS)):
        line = _Line(rest)
        singles = [one for one in rest if one.place is not None]
        if line.freedom < 1 or not singles:
            break
        deviations, worst = max((line.deviations(one), one) for one in singles)
        rest.remove(worst)
        taken.append(worst)
        if _is_beyond(deviations, line.freedom, len(rest) + 1):
            suspects = len(taken)
    rest += taken[suspects:]
    outliers = []
    for one in reversed(taken[:suspects]):
        least_us, most_us = _continued_us(rest, one.payload_bytes)
        slack_us = min(OUTLIER_SHARE * one.latency_us, 2 * _Line(rest).spread_us)
        if least_us - slack_us <= one.execution_us <= most_us + slack_us:
            rest.append(one)
        else:
            outliers.append(one)
    line = _Line(rest)
    return {
        one.place: line.at(one.payload_bytes)
        for one in outliers
        if one.place is not None and abs(one.execution_us - line.at(one.payload_bytes)) > OUTLIER_SHARE * one.latency_us
    }


class _Line:
    """Least-squares line through points."""

    def __init__(self, points: Sequence[_Point]) -> None:
        self._number = len(points)
        self._mean_bytes = fmean(one.payload_bytes for one in points)
        self._mean_us = fmean(one.execution_us for one in points)
        self._width = sum((one.payload_bytes - self._mean_bytes) ** 2 for one in points)
        shared = sum((one.payload_bytes - self._mean_bytes) * one.execution_us for one in points)
        self._slope = shared / self._width if self._width else 0.0
        self._squares = sum((one.execution_us - self.at(one.payload_bytes)) ** 2 for one in points)
        self.freedom = self._number - 3
        """Degrees of freedom of the line through all but one."""

    def at(self, payload_bytes: float) -> float:
        """T_exec of the line [us]."""
        return self._mean_us + self._slope * (payload_bytes - self._mean_bytes)

    @property
    def spread_us(self) -> float:
        """Standard deviation of its points [us]."""
        return sqrt(self._squares / max(self._number - 2, 1))

    def deviations(self, one: _Point) -> float:
        """Distance of one of its points from the line through the others, in standard deviations of that distance."""
        away = one.payload_bytes - self._mean_bytes
        apart = 1 - 1 / self._number - (away**2 / self._width if self._width else 0.0)
        if apart < _EXACT_US:
            return 0.0
        residual_us = abs(one.execution_us - self.at(one.payload_bytes))
        others = max(self._squares - residual_us**2 / apart, 0.0) / self.freedom
        return residual_us / sqrt(apart) / max(sqrt(others), _EXACT_US)


def _continued_us(points: Sequence[_Point], payload_bytes: int) -> tuple[float, float]:
    """Least and largest T_exec of a curve through its neighbours that bends one way [us].

    Between its neighbours, such a curve lies between their chord and the lines that continue it from either side. At
    an end, the slope changes as it did before, at most _END_BEND times as fast. Another measurement of that payload
    says more than any curve.
    """
    groups: defaultdict[int, list[float]] = defaultdict(list)
    for one in points:
        groups[one.payload_bytes].append(one.execution_us)
    beside = groups.pop(payload_bytes, None)
    if beside:
        return min(beside), max(beside)
    middle = [(size, median(values)) for size, values in sorted(groups.items())]
    below = [one for one in middle if one[0] < payload_bytes][::-1]
    above = [one for one in middle if one[0] > payload_bytes]
    if below and above:
        found = [_through(below[0], above[0], payload_bytes)]
        found += [_through(side[0], side[1], payload_bytes) for side in (below, above) if len(side) > 1]
        return min(found), max(found)
    (x1, y1), (x2, y2), (x3, y3) = (below or above)[:3]
    near, far = (y1 - y2) / (x1 - x2), (y2 - y3) / (x2 - x3)
    bend = _END_BEND * abs((near - far) / (x1 - x3) * (payload_bytes - x2))
    ends = [y1 + (near + change) * (payload_bytes - x1) for change in (-bend, bend)]
    return min(ends), max(ends)


def _through(one: tuple[float, float], other: tuple[float, float], x: float) -> float:
    """Value at x of the line through two points."""
    return one[1] + (other[1] - one[1]) * (x - one[0]) / (other[0] - one[0])


def _undecided(
    samples: Sequence[Sample], groups: Sequence[Sequence[int]], outliers: Mapping[int, float]
) -> Iterator[tuple[int, int]]:
    """Pairs that contradict each other, while the line names neither."""
    pairs = [group for group in groups if len(group) == REPETITIONS_TO_COMPARE - 1]
    repeated = [group for group in groups if len(group) > 1]
    distances = {id(group): _distances_us(samples, group) for group in repeated}
    for pair in pairs:
        if outliers.keys() & set(pair):
            continue
        first, second = pair
        gap_us = abs(samples[first].execution_us - samples[second].execution_us)
        others_us = [one for group in repeated if group is not pair for one in distances[id(group)]]
        floor_us = OUTLIER_SHARE * max(samples[one].latency_us for one in pair)
        if not others_us:
            apart = gap_us > UNKNOWN_SHARE * max(samples[one].execution_us for one in pair)
        else:
            apart = gap_us > floor_us and _is_beyond(gap_us / 2 / _spread_us(others_us), len(others_us), len(samples))
        if apart:
            yield first, second
