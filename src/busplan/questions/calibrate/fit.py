"""From measured latencies to the execution time of a node: equation (3) solved for T_exec."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from math import sqrt
from statistics import median, stdev
from typing import Final, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import PacketTime
from busplan.errors import BusplanError
from busplan.profile.measurements import Measurement
from busplan.sections.transactions import TransactionKind

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
_MOST_PROBLEMS: Final = 50


class Timed(NamedTuple):
    """One measurement, and what it says of the node."""

    line: int
    transaction: TransactionKind
    payload_bytes: int
    latency_us: float
    packets_us: float
    """Time of the packets, which is subtracted from the latency."""
    execution_us: float
    """T_exec."""


class Outlier(NamedTuple):
    """A measurement far from the others of its payload: above them a slow execution, below them a contradiction."""

    line: int
    transaction: TransactionKind
    payload_bytes: int
    latency_us: float
    execution_us: float
    off_us: float
    """T_exec less the median of its transaction and payload."""


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


def timed(
    network: Network,
    measurements: Sequence[Measurement],
    packets: Mapping[tuple[TransactionKind, int], PacketTime],
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
    off_us = []
    for own in places.values():
        middle_us = median(samples[place].execution_us for place in own)
        if len(own) >= REPETITIONS_TO_COMPARE:
            off_us.append({place: samples[place].execution_us - middle_us for place in own})
    # Long executions may scatter more than short ones, and three of a kind may be alike by chance.
    all_us = _middle_distance_us(us for group in off_us for us in group.values())
    found = {}
    for group in off_us:
        deviation_us = DEVIATION_PER_MAD * max(all_us, _middle_distance_us(group.values()))
        for place, us in group.items():
            if abs(us) > max(OUTLIER_SHARE * samples[place].latency_us, FAR * deviation_us):
                line, transaction, size, latency_us, _, execution_us = samples[place]
                found[place] = Outlier(line, transaction, size, latency_us, execution_us, round(us, _DECIMALS))
    return dict(sorted(found.items()))


def _middle_distance_us(off_us: Iterable[float]) -> float:
    return median([abs(us) for us in off_us] or [0.0])


def payload_fits(samples: Sequence[Timed], left_out: Mapping[int, Outlier]) -> tuple[PayloadFit, ...]:
    """The measurements of each payload, payloads ascending."""
    fits = []
    for size in sorted({sample.payload_bytes for sample in samples}):
        places = [place for place, sample in enumerate(samples) if sample.payload_bytes == size]
        own = [samples[place] for place in places if place not in left_out]
        fits.append(
            PayloadFit(
                payload_bytes=size,
                measurements=len(places),
                left_out=len(places) - len(own),
                latency_us=median(sample.latency_us for sample in own),
                packets_us=median(sample.packets_us for sample in own),
                execution_us=median(sample.execution_us for sample in own),
                deviation_us=stdev(sample.execution_us for sample in own) if len(own) > 1 else None,
            )
        )
    return tuple(fits)


def spread_us(off_us: Sequence[float], *, payloads: int) -> float | None:
    """Standard deviation of measurements about the medians of some payloads [us]; None where none is left over."""
    free = len(off_us) - payloads
    return sqrt(sum(us**2 for us in off_us) / free) if free > 0 else None
