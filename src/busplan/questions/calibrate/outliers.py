"""Measurements far from the others: slow executions, and fast ones that the others contradict.

Three or more repetitions are compared with their median. A payload that was measured once or twice is compared with the
line through all payloads; but an execution time may bend, so it is off only where it breaks the order, too: no smaller
payload takes as long, or no larger one is as short.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, pairwise
from math import inf
from statistics import median, median_low
from typing import Final, NamedTuple

from busplan.questions.calibrate.execution_fit import theil_sen

FAR: Final = 3.5
"""Robust standard deviations from which on a measurement is far from the others (Iglewicz and Hoaglin)."""
OUTLIER_SHARE: Final = 0.01
"""Least distance of an outlier, as a share of its latency: the steps of a timer are no outliers."""
DEVIATION_PER_MAD: Final = 1.4826
"""Standard deviation of a normal distribution whose median absolute deviation is 1."""
REPETITIONS_TO_COMPARE: Final = 3
"""Fewest measurements of one payload of which one can be told to be far off."""
PAYLOADS_TO_COMPARE: Final = 4
"""Fewest payloads of which one can be told to be off a line: two make a line, and a third confirms it."""


class Sample(NamedTuple):
    """Execution time derived from one measurement."""

    transaction: str
    payload_bytes: int
    latency_us: float
    execution_us: float
    """T_exec."""


class Screening(NamedTuple):
    """Outliers among the samples, by their index; and payloads that cannot be screened."""

    expected_us: Mapping[int, float]
    """The outliers, with the T_exec that the others say: above it they are slow executions."""
    unchecked_bytes: tuple[int, ...]
    """Payloads with too few measurements to tell an outlier."""


def screen(samples: Sequence[Sample]) -> Screening:
    """Find the measurements that are far from the others.

    Parameters
    ----------
    samples
        Any number of them, in any order.

    References
    ----------
    B. Iglewicz, D. Hoaglin, "How to Detect and Handle Outliers" (1993): the median absolute deviation, and 3.5 of it.

    Examples
    --------
    >>> screening = screen([Sample("write", 4, 60.0, time_us) for time_us in (52.1, 200.0, 52.0, 51.9)])
    >>> screening.expected_us
    {1: 52.0}
    """
    groups: defaultdict[tuple[str, int], list[int]] = defaultdict(list)
    for place, sample in enumerate(samples):
        groups[sample.transaction, sample.payload_bytes].append(place)
    few = [group for group in groups.values() if len(group) < REPETITIONS_TO_COMPARE]
    comparable = len({sample.payload_bytes for sample in samples}) >= PAYLOADS_TO_COMPARE
    repeated = dict(_off_their_repetitions(samples, list(groups.values())))
    single = dict(_off_the_line(samples, list(chain(*few)), repeated)) if comparable else {}
    return Screening(
        expected_us={**repeated, **single},
        unchecked_bytes=() if comparable else tuple(sorted({samples[group[0]].payload_bytes for group in few})),
    )


def _is_far(off_us: float, sample: Sample, spread_us: float) -> bool:
    return abs(off_us) > max(OUTLIER_SHARE * sample.latency_us, FAR * spread_us)


def _distances_us(samples: Sequence[Sample], group: Sequence[int]) -> list[float]:
    """Distance of each from the median of its group [us]; the smallest is left out, for the median follows it."""
    middle_us = median(samples[place].execution_us for place in group)
    return sorted(abs(samples[place].execution_us - middle_us) for place in group)[1:]


def _off_their_repetitions(samples: Sequence[Sample], groups: Sequence[Sequence[int]]) -> Iterator[tuple[int, float]]:
    """Samples far from the median of three or more repetitions, by index, with the median of the others [us]."""
    repeated = [_distances_us(samples, group) for group in groups if len(group) > 1]
    all_us = median_low(chain(*repeated)) if repeated else 0.0
    for group in groups:
        if len(group) < REPETITIONS_TO_COMPARE:
            continue
        middle_us = median(samples[place].execution_us for place in group)
        # Long executions may scatter more than short ones.
        spread_us = DEVIATION_PER_MAD * max(all_us, median_low(_distances_us(samples, group)))
        off = [place for place in group if _is_far(samples[place].execution_us - middle_us, samples[place], spread_us)]
        rest_us = [samples[place].execution_us for place in group if place not in off]
        yield from ((place, median(rest_us or [middle_us])) for place in off)


def _off_the_line(
    samples: Sequence[Sample], few: Sequence[int], left_out: Mapping[int, float]
) -> Iterator[tuple[int, float]]:
    """Samples of payloads measured once or twice that are off the line through all, by index, with its T_exec [us]."""
    groups: defaultdict[int, list[float]] = defaultdict(list)
    for place, sample in enumerate(samples):
        if place not in left_out:
            groups[sample.payload_bytes].append(sample.execution_us)
    base_us, per_byte_us = theil_sen(groups)
    middle_us = {size: median(values) for size, values in sorted(groups.items())}
    spread_us = DEVIATION_PER_MAD * median(abs(us - base_us - per_byte_us * size) for size, us in middle_us.items())
    smaller_us = {size: middle_us[before] for before, size in pairwise(middle_us)}
    larger_us = {size: middle_us[behind] for size, behind in pairwise(middle_us)}
    for place in few:
        sample = samples[place]
        line_us = base_us + per_byte_us * sample.payload_bytes
        size, off_us = sample.payload_bytes, sample.execution_us - line_us
        in_order = smaller_us.get(size, -inf) <= sample.execution_us <= larger_us.get(size, inf)
        if not in_order and _is_far(off_us, sample, spread_us):
            yield place, line_us
