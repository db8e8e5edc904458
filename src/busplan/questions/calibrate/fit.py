"""From measured latencies to the execution time of a node: equation (3) solved for T_exec, one rule for outliers."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import combinations
from math import sqrt
from statistics import median, stdev
from typing import Final, Literal, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import Packets
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.profile.measurements import Measurement
from busplan.sections.execution import MEASURED_UNCERTAINTY_US, LinearExecution, TableExecution
from busplan.sections.transactions import TransactionKind

ExecutionForm = Literal["table", "linear"]
Execution = LinearExecution | TableExecution

FAR: Final = 3.5
"""Robust standard deviations from which on a measurement is far from the others (Iglewicz and Hoaglin)."""
OUTLIER_SHARE: Final = 0.01
"""Least distance of an outlier, as a share of its latency: the steps of a timer are no outliers."""
DEVIATION_PER_MAD: Final = 1.4826
"""Standard deviation of a normal distribution whose median absolute deviation is 1."""
REPETITIONS_TO_COMPARE: Final = 3
"""Fewest measurements of one payload of which one can be told to be far off."""
_DECIMALS: Final = 6
"""A picosecond: what is smaller is rounding of the subtraction."""
_TIME_DECIMALS: Final = 3
_PER_BYTE_DECIMALS: Final = 6
"""Rounds by less than a nanosecond even at the largest payload."""
_MOST_PROBLEMS: Final = 50


class Timed(NamedTuple):
    """One measurement, and what it says of the node."""

    line: int
    transaction: str
    payload_bytes: int
    latency_us: float
    packets_us: float
    """Time of the packets, which is subtracted from the latency."""
    execution_us: float
    """T_exec."""


class Outlier(NamedTuple):
    """A measurement far from the others of its payload: above them a slow execution, below them a contradiction."""

    line: int
    transaction: str
    payload_bytes: int
    latency_us: float
    execution_us: float
    off_us: float
    """T_exec less the median of its payload."""


class PayloadFit(NamedTuple):
    """The measurements of one payload, times in us; without its outliers."""

    payload_bytes: int
    measurements: int
    """Number of all, the outliers among them."""
    left_out: int
    """Number of outliers."""
    latency_us: float
    """T_lant: the median."""
    packets_us: float
    execution_us: float
    """T_exec: the median."""
    deviation_us: float | None
    """Standard deviation of T_exec over the repetitions; None for a single measurement."""
    fitted_us: float
    """T_exec of the fit."""
    residual_us: float
    """`execution_us` minus `fitted_us`."""


def timed(
    network: Network,
    measurements: Sequence[Measurement],
    packets: Mapping[tuple[TransactionKind, int], Packets],
    *,
    source: str,
    model: str,
) -> list[Timed]:
    """T_exec of each measurement: its latency less the time of its packets.

    Parameters
    ----------
    network
        The network that was measured.
    measurements
        At least one.
    packets
        Time of the packets by transaction and payload.
    source, model
        Names of the measurements and of the timing model, in messages.

    Raises
    ------
    BusplanError
        Payloads over the limit of the bus, and latencies shorter than their packets, all in one error.

    References
    ----------
    Paper, equation (3).
    """
    payloads = network.bus.payloads(network)
    found, problems = [], []
    for measurement in measurements:
        line, transaction, size, latency_us = measurement
        packets_us = packets[transaction, size].us
        found.append(Timed(*measurement, packets_us, round(latency_us - packets_us, _DECIMALS)))
        if size > payloads.most_bytes:
            problems.append(
                f"{source}:{line}: payload {size} bytes is over the {payloads.most_bytes} bytes of {payloads.carrier}"
            )
        if latency_us < packets_us:
            problems.append(
                f"{source}:{line}: latency {latency_us:g} us at {size} bytes is below the {packets_us:.3f} us that the "
                f"packets alone take in the {model} model"
            )
    if all(sample.execution_us < 0 for sample in found):
        problems.insert(0, f"{source}: every latency is too short: is latency_us in us?")
    more = len(problems) - _MOST_PROBLEMS
    if problems:
        raise BusplanError(*problems[:_MOST_PROBLEMS], *([f"{source}: and {more} more problems"] if more > 0 else []))
    return found


def outliers(samples: Sequence[Timed]) -> dict[int, Outlier]:
    """Find the measurements that are far from the median of three or more of the same transaction and payload.

    Parameters
    ----------
    samples
        Any number of them, in any order.

    Returns
    -------
    dict
        Outliers by their place among the samples.

    References
    ----------
    B. Iglewicz, D. Hoaglin, "How to Detect and Handle Outliers" (1993): the median absolute deviation, and 3.5 of it.

    Examples
    --------
    >>> times_us = (52.1, 200.0, 52.0, 51.9)
    >>> found = outliers([Timed(line, "write", 4, 60.0, 8.0, us) for line, us in enumerate(times_us)])
    >>> {place: round(outlier.off_us, 2) for place, outlier in found.items()}
    {1: 147.95}
    """
    places: defaultdict[tuple[str, int], list[int]] = defaultdict(list)
    for place, sample in enumerate(samples):
        places[sample.transaction, sample.payload_bytes].append(place)
    off_us = {
        group: {place: samples[place].execution_us - median(samples[at].execution_us for at in own) for place in own}
        for group, own in places.items()
        if len(own) >= REPETITIONS_TO_COMPARE
    }
    # Long executions may scatter more than short ones, and three of a kind may be alike by chance.
    all_us = median([abs(us) for own in off_us.values() for us in own.values()] or [0.0])
    found = {}
    for own in off_us.values():
        spread_us = DEVIATION_PER_MAD * max(all_us, median(map(abs, own.values())))
        for place, us in own.items():
            if abs(us) > max(OUTLIER_SHARE * samples[place].latency_us, FAR * spread_us):
                line, transaction, size, latency_us, _, execution_us = samples[place]
                found[place] = Outlier(line, transaction, size, latency_us, execution_us, round(us, _DECIMALS))
    return dict(sorted(found.items()))


def fitted(
    samples: Sequence[Timed], form: ExecutionForm, *, grade: Literal["measured", "derived"], source: str
) -> Execution:
    """Fit an execution time, in whole nanoseconds: the median at each payload, as a table or as the line through it.

    Parameters
    ----------
    samples
        At least one, without outliers.
    form
        "table" or "linear".
    grade
        How the execution time is known.
    source
        Name of the measurements in messages.

    Raises
    ------
    BusplanError
        A line through one payload, or with a negative part.
    """
    times_us = {size: median(us) for size, us in _by_payload(samples).items()}
    if form == "table":
        rounded_us = tuple(round(us, _TIME_DECIMALS) for us in times_us.values())
        return TableExecution(kind="table", payload_bytes=tuple(times_us), time_us=rounded_us, grade=grade)
    if len(times_us) == 1:
        raise BusplanError(f"{source}: all payloads are {min(times_us)} bytes: a line needs two, or use --form table")
    base_us, per_byte_us = theil_sen(times_us)
    base_us, per_byte_us = round(base_us, _TIME_DECIMALS), round(per_byte_us, _PER_BYTE_DECIMALS)
    if base_us < 0 or per_byte_us < 0:
        line = f"{base_us:g} us + {per_byte_us:g} us/byte * payload"
        raise BusplanError(
            f"{source}: the line is {line}, and no part of an execution time is negative: use --form table"
        )
    return LinearExecution(kind="linear", base_us=base_us, per_byte_us=per_byte_us, grade=grade)


def _by_payload(samples: Sequence[Timed]) -> dict[int, list[float]]:
    """T_exec of the samples at each payload [us], payloads ascending."""
    groups: defaultdict[int, list[float]] = defaultdict(list)
    for sample in sorted(samples, key=lambda sample: sample.payload_bytes):
        groups[sample.payload_bytes].append(sample.execution_us)
    return dict(groups)


def theil_sen(times_us: Mapping[int, float]) -> tuple[float, float]:
    """Base [us] and slope [us/byte] of the Theil-Sen line through the time at each payload [us].

    The slope is the median of the slopes between any two payloads, the base the median of the remainders: no tuning
    constant, and about 29 % of the payloads may be wrong.

    References
    ----------
    P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", JASA 63 (1968).

    Examples
    --------
    >>> theil_sen({4: 40.0, 8: 44.0, 12: 48.0, 16: 700.0, 20: 56.0})
    (36.0, 1.0)
    """
    points = list(times_us.items())
    slope = median((y2 - y1) / (x2 - x1) for (x1, y1), (x2, y2) in combinations(points, 2))
    return median(y - slope * x for x, y in points), slope


def residual_us(sample: Timed, execution: Execution) -> float:
    """T_exec of a measurement less that of the fit [us]."""
    return round(sample.execution_us - plain(execution.execution_us(sample.payload_bytes)), _DECIMALS)


def uncertainty_us(residuals_us: Sequence[float], execution: Execution) -> float | None:
    """Standard deviation of the measurements about the fit [us]; None where the fit uses all of them up."""
    free = len(residuals_us) - (len(execution.payload_bytes) if isinstance(execution, TableExecution) else 2)
    if free <= 0:
        return None
    spread_us = sqrt(sum(us**2 for us in residuals_us) / free)
    return round(max(spread_us, float(MEASURED_UNCERTAINTY_US)), _TIME_DECIMALS)


def payload_fits(samples: Sequence[Timed], left_out: Mapping[int, Outlier], execution: Execution) -> list[PayloadFit]:
    """The measurements of each payload, payloads ascending."""
    kept = [sample for place, sample in enumerate(samples) if place not in left_out]
    fits = []
    for size, times_us in _by_payload(kept).items():
        own = [sample for sample in kept if sample.payload_bytes == size]
        far = sum(outlier.payload_bytes == size for outlier in left_out.values())
        own_us = plain(execution.execution_us(size))
        fits.append(
            PayloadFit(
                payload_bytes=size,
                measurements=len(own) + far,
                left_out=far,
                latency_us=median(sample.latency_us for sample in own),
                packets_us=median(sample.packets_us for sample in own),
                execution_us=median(times_us),
                deviation_us=stdev(times_us) if len(own) > 1 else None,
                fitted_us=own_us,
                residual_us=round(median(times_us) - own_us, _DECIMALS),
            )
        )
    return fits
