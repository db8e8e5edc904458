"""From measured latencies to the execution time of a node: the inverse of equation (3)."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from math import ceil, sqrt
from statistics import fmean, median, stdev
from typing import Final, Literal, NamedTuple

from busplan.buses.parts import Halves, MeasuredLatencies, Value
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.profile.measurements import Measurement
from busplan.questions.calibrate.execution_fit import METHODS, ExecutionForm, Method, fit_execution
from busplan.questions.calibrate.outliers import Sample, screen
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.alike_nodes import AlikeNodes
from busplan.sections.execution import MEASURED_UNCERTAINTY_US, LinearExecution, TableExecution
from busplan.sections.profile import Profile

Way = Literal["timing-model", "measured-halves"]
"""Source of the two halves that are subtracted from a latency."""

_PICOSECOND: Final = 1e-3
"""A picosecond in nanoseconds: what rounding adds is no nanosecond."""
_EXACT_DECIMALS: Final = 6
"""A picosecond: smaller residuals are rounding of the subtraction."""


class ComparedMeasurement(NamedTuple):
    """One measurement compared with the fit and, where it is an outlier, with the other measurements.

    An outlier above the others is a slow execution, which belongs to `worst_extra_us`; the others contradict one below.
    """

    line: int
    transaction: str
    payload_bytes: int
    latency_us: float
    packets_us: float
    """Both halves, (T1+T2) + (T4+T5), which are subtracted from the latency."""
    execution_us: float
    """T_exec of this measurement."""
    residual_us: float | None
    """T_exec minus that of the fit; None for an outlier outside a table."""
    expected_us: float | None
    """T_exec that the other measurements say of an outlier; None in the fit."""
    off_us: float
    """`execution_us` minus `expected_us`; 0 in the fit."""


class PayloadFit(NamedTuple):
    """All measurements of one payload, times in us.

    Times are of those in the fit; where none is, because all were left out, of all.
    """

    payload_bytes: int
    measurements: int
    latency_us: float
    """T_lant: the median."""
    packets_us: float
    execution_us: float
    """T_exec: the median."""
    deviation_us: float | None
    """Standard deviation of T_exec over the repetitions; None for a single measurement."""
    range_us: float
    """Largest minus smallest T_exec of the repetitions."""
    fitted_us: float | None
    """T_exec of the fit; None outside a table."""
    residual_us: float | None
    """`execution_us` minus `fitted_us`."""
    read_less_write_us: float | None
    """T_exec of the reads minus that of the writes, 0 in the timing model; None without both."""
    request_and_acknowledge_us: float | None
    """T1 + T2, measured."""
    model_request_and_acknowledge_us: float
    """T1 + T2 of the timing model, (13)."""
    unexplained_us: float | None
    """T1 + T2, measured minus modelled."""
    left_out: int
    """Outliers among the measurements that are not in the fit."""


class Calibration(NamedTuple):
    """Answer of `calibrate`."""

    profile: Profile
    """The network that was measured."""
    nodes: AlikeNodes
    """The nodes that were measured."""
    timing_model: str
    way: Way
    method: Method
    execution: LinearExecution | TableExecution
    measurements: int
    """Number of all measurements, the outliers among them."""
    residuals: tuple[ComparedMeasurement, ...]
    """Of the measurements in the fit."""
    payloads: tuple[PayloadFit, ...]
    rms_residual_us: float
    largest: ComparedMeasurement
    """The measurement farthest from the fit."""
    outliers: tuple[ComparedMeasurement, ...]
    """Measurements far from the others, slow or fast."""
    worst_extra_us: float | None
    """Time of the slowest execution beyond the fit; None where no measurement outside the fit is slow."""
    unchecked_bytes: tuple[int, ...]
    """Payloads with too few measurements to tell an outlier."""
    uncertainty_us: float | None
    """Standard uncertainty of T_exec, the spread of the measurements about the fit; None where nothing is left over."""
    fit_keys: dict[str, Value]
    """Further keys of [node.execution]: what it was fitted against."""
    at_most_us: float
    """A shorter execution cannot be told from a latency."""


def calibrate(
    profile: Profile,
    measurements: Sequence[Measurement],
    *,
    source: str,
    group: str | None = None,
    timing_model: str | None = None,
    form: ExecutionForm | None = None,
    grade: Literal["measured", "derived"] = "measured",
) -> Calibration:
    """Find the execution time of a node from measured latencies.

    T_exec is the latency minus both halves: T1 + T2 as measured, and T4 + T5 as that of the smallest payload with
    the packets' own sizes; or, where T1 + T2 was not measured, both halves of the
    timing model.

    Parameters
    ----------
    profile
        The network that was measured; the transactions are those of its farthest node.
    measurements
        At least one; either all or none have T1 + T2.
    source
        Name of the measurements in messages.
    group
        Name of the group of nodes that was measured, of a profile with groups.
    timing_model
        Timing model; by default the one that decides.
    form
        Form of the execution time; by default the profile's own. A table has the median at each payload, a line is that
        of Theil and Sen through these medians, which has no tuning constant and tolerates about 29 % of wrong payloads.
        Outliers are in neither: the slow ones are what the slowest execution takes more, and the others contradict the
        fast ones.
    grade
        How the execution time is known.

    Returns
    -------
    Calibration
        The execution time, and how well it fits the measurements.

    Raises
    ------
    BusplanError
        No group of that name, a latency shorter than its packets, a payload over the limit of the speed, a line through
        one payload or with a negative part.

    References
    ----------
    Paper, equations (3), (13) and (14); Table I. P. K. Sen, "Estimates of the regression coefficient based on
    Kendall's tau", JASA 63 (1968). Outliers: `outliers.screen`.
    """
    model = timing_model or bus_of(profile).deciding_model
    nodes = _nodes(profile, group)
    halves = _packets(profile, nodes, measurements, model)
    way: Way = "timing-model" if measurements[0].request_and_acknowledge_us is None else "measured-halves"
    raw = _with_packets(measurements, measurements, halves)
    _require_possible(profile, raw, source=source, way=way, model=model)
    screening = screen(
        [
            Sample(
                measurement.transaction, measurement.payload_bytes, measurement.latency_us, measurement.latency_us - us
            )
            for measurement, us in raw
        ]
    )
    left_out = frozenset(screening.expected_us)
    kept = [place for place in range(len(raw)) if place not in left_out]
    if left_out:
        # The smallest payload gives T4 + T5 to all others: that of an outlier would stay in them.
        raw = _with_packets(measurements, [measurements[place] for place in kept], halves)
    groups: defaultdict[int, list[float]] = defaultdict(list)
    for measurement, packets_us in (raw[place] for place in kept):
        groups[measurement.payload_bytes].append(measurement.latency_us - packets_us)
    chosen = form or nodes.node.execution.kind
    fit = fit_execution(groups, chosen, grade=grade, source=source)
    fitted_us = {
        size: plain(fit.execution_us(size))
        for size in {measurement.payload_bytes for measurement, _ in raw}
        if fit.covers(size)
    }
    compared = [
        _compared(measurement, packets_us, fitted_us.get(measurement.payload_bytes), screening.expected_us.get(place))
        for place, (measurement, packets_us) in enumerate(raw)
    ]
    residuals, outliers = (tuple(compared[place] for place in places) for places in (kept, sorted(left_out)))
    residuals_us = _residuals_us(residuals)
    return Calibration(
        profile=profile,
        nodes=nodes,
        timing_model=model,
        way=way,
        method=METHODS[chosen],
        execution=fit,
        measurements=len(measurements),
        residuals=residuals,
        payloads=tuple(_payload_fits(measurements, compared, halves, fitted_us)),
        rms_residual_us=fmean(us**2 for us in residuals_us) ** 0.5,
        largest=max(residuals, key=lambda measurement: abs(measurement.residual_us or 0.0)),
        outliers=outliers,
        worst_extra_us=_worst_extra_us(outliers, residuals_us),
        unchecked_bytes=screening.unchecked_bytes,
        uncertainty_us=_uncertainty_us(residuals_us, fit),
        fit_keys=latencies_of(profile).fit_keys(network_of(profile), model if way == "timing-model" else None),
        at_most_us=max(half.shortest_us for half in halves.values()),
    )


_Halves = Mapping[tuple[str, int], Halves]


def _nodes(profile: Profile, group: str | None) -> AlikeNodes:
    """The nodes that were measured."""
    by_name = {alike.name: alike for alike in profile.alike_nodes}
    if group is None and len(by_name) == 1:
        return profile.alike_nodes[0]
    if group in by_name:
        return by_name[group]
    known = f"the groups {', '.join(by_name)}" if profile.group else "no groups"
    if group is None:
        raise BusplanError(f"{profile.name} has {known}; give the group that was measured")
    raise BusplanError(f"group {group}: {profile.name} has {known}")


def _packets(profile: Profile, nodes: AlikeNodes, measurements: Sequence[Measurement], model: str) -> _Halves:
    """Time of the packets for every transaction and payload that was measured."""
    halves, network = latencies_of(profile).halves, network_of(profile)
    return {
        (kind, size): halves(network, nodes.name, model, kind, size)
        for kind, size in dict.fromkeys(
            (measurement.transaction, measurement.payload_bytes) for measurement in measurements
        )
    }


def latencies_of(profile: Profile) -> MeasuredLatencies:
    """How the kind of bus finds execution times from latencies.

    Raises
    ------
    BusplanError
        It has no transactions whose latency could be measured.
    """
    bus = bus_of(profile)
    if bus.calibration is None:
        way_out = f"; {bus.recordings} is for busplan measured" if bus.recordings else ""
        raise BusplanError(
            f"bus.kind {bus.kind}: {bus.title} has no transactions to find an execution time from{way_out}"
        )
    return bus.calibration


def _with_packets(
    measurements: Sequence[Measurement], trusted: Sequence[Measurement], halves: _Halves
) -> list[tuple[Measurement, float]]:
    """Each measurement with its latency minus T_exec [us]."""
    second_us = _second_halves_us(measurements, trusted, halves)
    return [(measurement, _packets_us(measurement, halves, second_us)) for measurement in measurements]


def _second_halves_us(
    measurements: Sequence[Measurement], trusted: Sequence[Measurement], halves: _Halves
) -> dict[tuple[str, int], float]:
    """T4 + T5 of each transaction and payload whose T1 + T2 was measured [us].

    It is the T1 + T2 of the smallest payload that is trusted, where the two packets differ least, and what the sizes of
    the packets change. Two equal halves would charge the payload of a write to its response, too.
    """
    second_halves_us: dict[tuple[str, int], float] = {}
    for kind in {measurement.transaction for measurement in measurements}:
        own = [measurement for measurement in measurements if measurement.transaction == kind]
        sure = [measurement for measurement in trusted if measurement.transaction == kind] or own
        smallest = min(measurement.payload_bytes for measurement in sure)
        measured_us = [
            measurement.request_and_acknowledge_us for measurement in sure if measurement.payload_bytes == smallest
        ]
        first_us = median(us for us in measured_us if us is not None) if None not in measured_us else 0.0
        for size in {measurement.payload_bytes for measurement in own}:
            second, first = halves[kind, size], halves[kind, smallest]
            second_halves_us[kind, size] = (
                first_us + second.response_and_acknowledge_us - first.request_and_acknowledge_us
            )
    return second_halves_us


def _packets_us(measurement: Measurement, halves: _Halves, second_us: Mapping[tuple[str, int], float]) -> float:
    """Latency minus T_exec [us]."""
    key = (measurement.transaction, measurement.payload_bytes)
    if measurement.request_and_acknowledge_us is not None:
        return measurement.request_and_acknowledge_us + second_us[key]
    return halves[key].latency_us


def _uncertainty_us(residuals_us: Sequence[float], fit: LinearExecution | TableExecution) -> float | None:
    """Standard deviation of the measurements about the fit [us]; None where the fit uses all of them up."""
    parameters = len(fit.payload_bytes) if isinstance(fit, TableExecution) else 2
    free = len(residuals_us) - parameters
    if free <= 0:
        return None
    spread_us = sqrt(sum(us**2 for us in residuals_us) / free)
    return round(max(spread_us, float(MEASURED_UNCERTAINTY_US)), 3)


def _require_possible(
    profile: Profile, raw: Sequence[tuple[Measurement, float]], *, source: str, way: Way, model: str
) -> None:
    """Refuse measurements that are impossible on this bus, all in one error."""
    payloads = bus_of(profile).payloads(network_of(profile))
    limit = payloads.most_bytes
    needed = (
        "its T1 + T2 and T4 + T5 are" if way == "measured-halves" else f"the packets alone take in the {model} model"
    )
    problems = [
        f"{source}:{measurement.line}: payload {measurement.payload_bytes} bytes is over the {limit} bytes of "
        f"{payloads.carrier}"
        for measurement, _ in raw
        if measurement.payload_bytes > limit
    ]
    short = [(measurement, packets_us) for measurement, packets_us in raw if measurement.latency_us < packets_us]
    problems += [
        f"{source}:{measurement.line}: latency {measurement.latency_us:g} us at {measurement.payload_bytes} bytes is "
        f"below the {packets_us:.3f} us that {needed}"
        for measurement, packets_us in short
    ]
    if len(short) == len(raw) and way == "timing-model":
        problems.append(f"{source}: every latency is too short: is latency_us in us?")
    if problems:
        raise BusplanError(*problems[:_MOST_SHOWN], *_more(source, len(problems) - _MOST_SHOWN))


_MOST_SHOWN: Final = 50


def _more(source: str, hidden: int) -> list[str]:
    return [f"{source}: and {hidden} more problems"] if hidden > 0 else []


def _compared(
    measurement: Measurement, packets_us: float, fitted_us: float | None, expected_us: float | None
) -> ComparedMeasurement:
    """Compare a measurement with the fit, where that covers its payload, and with what the others say [us]."""
    execution_us = round(measurement.latency_us - packets_us, _EXACT_DECIMALS)
    expected_us = None if expected_us is None else round(expected_us, _EXACT_DECIMALS)
    return ComparedMeasurement(
        line=measurement.line,
        transaction=measurement.transaction,
        payload_bytes=measurement.payload_bytes,
        latency_us=measurement.latency_us,
        packets_us=packets_us,
        execution_us=execution_us,
        residual_us=None if fitted_us is None else round(execution_us - fitted_us, _EXACT_DECIMALS),
        expected_us=expected_us,
        off_us=0.0 if expected_us is None else round(execution_us - expected_us, _EXACT_DECIMALS),
    )


def _residuals_us(compared: Sequence[ComparedMeasurement]) -> list[float]:
    """Residuals of measurements that the fit covers [us]."""
    return [measurement.residual_us for measurement in compared if measurement.residual_us is not None]


def _worst_extra_us(outliers: Sequence[ComparedMeasurement], residuals_us: Sequence[float]) -> float | None:
    """Time of the slowest of all measurements beyond the fit, where some are slow [us]."""
    slow = [outlier for outlier in outliers if outlier.off_us > 0]
    if not slow:
        return None
    worst_us = max(
        *(outlier.off_us if outlier.residual_us is None else outlier.residual_us for outlier in slow), *residuals_us
    )
    return ceil(1000 * worst_us - _PICOSECOND) / 1000


def _payload_fits(
    measurements: Sequence[Measurement],
    compared: Sequence[ComparedMeasurement],
    halves: _Halves,
    fitted_us: Mapping[int, float],
) -> list[PayloadFit]:
    groups: defaultdict[int, list[int]] = defaultdict(list)
    for place, measurement in enumerate(compared):
        groups[measurement.payload_bytes].append(place)

    def of_payload(size: int, places: Sequence[int]) -> PayloadFit:
        in_fit = [place for place in places if compared[place].expected_us is None]
        group = [compared[place] for place in in_fit or places]
        times_us = [measurement.execution_us for measurement in group]
        by_kind = {
            kind: [measurement.execution_us for measurement in group if measurement.transaction == kind]
            for kind in ("read", "write")
        }
        halves_us = (measurements[place].request_and_acknowledge_us for place in in_fit or places)
        measured_us = [us for us in halves_us if us is not None]
        own_us = fitted_us.get(size)
        half_us = median(measured_us) if measured_us else None
        model_us = median([halves[measurement.transaction, size].request_and_acknowledge_us for measurement in group])
        return PayloadFit(
            payload_bytes=size,
            measurements=len(places),
            latency_us=median([measurement.latency_us for measurement in group]),
            packets_us=median([measurement.packets_us for measurement in group]),
            execution_us=median(times_us),
            deviation_us=stdev(times_us) if len(group) > 1 else None,
            range_us=round(max(times_us) - min(times_us), _EXACT_DECIMALS),
            fitted_us=own_us,
            residual_us=None if own_us is None else round(median(times_us) - own_us, _EXACT_DECIMALS),
            read_less_write_us=median(by_kind["read"]) - median(by_kind["write"]) if all(by_kind.values()) else None,
            request_and_acknowledge_us=half_us,
            model_request_and_acknowledge_us=model_us,
            unexplained_us=None if half_us is None else half_us - model_us,
            left_out=len(places) - len(in_fit),
        )

    return [of_payload(size, groups[size]) for size in sorted(groups)]
