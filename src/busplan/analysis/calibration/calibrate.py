"""From measured latencies to the execution time of a node: the inverse of equation (3)."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from statistics import fmean, median, stdev
from typing import Final, Literal, NamedTuple

from busplan.analysis.calibration.execution_fit import (
    METHODS,
    ExecutionForm,
    Groups,
    Method,
    fit_execution,
    middles,
    theil_sen,
)
from busplan.analysis.network import bus_of, network_of
from busplan.buses.bus import Halves, Value
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.profile.measurements import Measurement
from busplan.sections.execution import MEASURED_UNCERTAINTY_US, LinearExecution, TableExecution
from busplan.sections.profile import Profile

Way = Literal["timing-model", "measured-halves"]
"""Source of the two halves that are subtracted from a latency."""

OUTLIER_DEVIATIONS: Final = 3.5
"""Robust standard deviations from the fit that make an outlier (Iglewicz and Hoaglin)."""
OUTLIER_SHARE: Final = 0.01
"""Least distance of an outlier from the fit, as a share of its latency: the steps of a timer are no outliers."""
_DEVIATION_PER_MAD: Final = 1.4826
"""Standard deviation of a normal distribution whose median absolute deviation is 1."""
_FEWEST_FOR_OUTLIERS: Final = 3

_EXACT_DECIMALS: Final = 6
"""A picosecond: smaller residuals are rounding of the subtraction."""


class Residual(NamedTuple):
    """One measurement compared with the fit."""

    line: int
    transaction: str
    payload_bytes: int
    latency_us: float
    packets_us: float
    """Both halves, (T1+T2) + (T4+T5), which are subtracted from the latency."""
    execution_us: float
    """T_exec of this measurement."""
    residual_us: float
    """T_exec minus that of the fit."""


class PayloadFit(NamedTuple):
    """All measurements of one payload, times in us."""

    payload_bytes: int
    measurements: int
    latency_us: float
    """T_lant: the mean, or the median of a robust fit."""
    packets_us: float
    execution_us: float
    """T_exec: the mean, or the median of a robust fit."""
    deviation_us: float | None
    """Standard deviation of T_exec over the repetitions; None for a single measurement."""
    range_us: float
    """Largest minus smallest T_exec of the repetitions."""
    fitted_us: float
    """T_exec of the fit."""
    residual_us: float
    """`execution_us` minus `fitted_us`."""
    read_less_write_us: float | None
    """T_exec of the reads minus that of the writes, 0 in the timing model; None without both."""
    request_and_acknowledge_us: float | None
    """T1 + T2, measured."""
    model_request_and_acknowledge_us: float
    """T1 + T2 of the timing model, (13)."""
    unexplained_us: float | None
    """T1 + T2, measured minus modelled."""


class Calibration(NamedTuple):
    """Answer of `calibrate`."""

    profile: Profile
    """The network that was measured."""
    timing_model: str
    way: Way
    method: Method
    execution: LinearExecution | TableExecution
    residuals: tuple[Residual, ...]
    payloads: tuple[PayloadFit, ...]
    rms_residual_us: float
    largest: Residual
    """The measurement farthest from the fit."""
    outliers: tuple[Residual, ...]
    """Measurements farther from the robust fit than the spread of the others explains."""
    uncertainty_us: float | None
    """Standard uncertainty of T_exec, the spread of the measurements about the fit; None where nothing is left over."""
    fit_keys: dict[str, Value]
    """Further keys of [node.execution]: what it was fitted against."""
    at_most_us: float
    """A shorter execution cannot be told from a latency."""
    robust: bool
    """Whether the fit is the robust one, which outliers do not influence."""


def calibrate(
    profile: Profile,
    measurements: Sequence[Measurement],
    *,
    source: str,
    timing_model: str | None = None,
    form: ExecutionForm | None = None,
    robust: bool = False,
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
    timing_model
        Timing model; by default the one that decides.
    form
        Form of the execution time; by default the profile's own. A table has the mean at each payload, a line is fitted
        by least squares to all measurements.
    robust
        If True, use the median at each payload, and the Theil-Sen line through these medians: its slope is the median
        of the slopes between any two payloads, its base the median of the remainders. The line has no tuning constant
        and tolerates about 29 % of wrong payloads.
    grade
        How the execution time is known.

    Returns
    -------
    Calibration
        The execution time, and how well it fits the measurements.

    Raises
    ------
    BusplanError
        A latency shorter than its packets, a payload over the limit of the speed, a line through one payload or
        with a negative part.

    References
    ----------
    Paper, equations (3), (13) and (14); Table I. P. K. Sen, "Estimates of the regression coefficient based on
    Kendall's tau", JASA 63 (1968). B. Iglewicz, D. Hoaglin, "How to Detect and Handle Outliers" (1993).
    """
    model = timing_model or bus_of(profile).deciding_model
    halves = _packets(profile, measurements, model)
    way: Way = "timing-model" if measurements[0].request_and_acknowledge_us is None else "measured-halves"
    second_us = _second_halves_us(measurements, halves)
    raw = [(one, _packets_us(one, halves, second_us)) for one in measurements]
    _require_possible(profile, raw, source=source, way=way, model=model)
    groups: defaultdict[int, list[float]] = defaultdict(list)
    for one, packets_us in raw:
        groups[one.payload_bytes].append(one.latency_us - packets_us)
    chosen = form or profile.node.execution.kind
    fit = fit_execution(groups, chosen, robust=robust, grade=grade, source=source)
    residuals = _residuals(raw, fit)
    return Calibration(
        profile=profile,
        timing_model=model,
        way=way,
        method=METHODS[chosen, robust],
        execution=fit,
        residuals=residuals,
        payloads=tuple(_payload_fits(residuals, measurements, halves, fit, robust=robust)),
        rms_residual_us=fmean(one.residual_us**2 for one in residuals) ** 0.5,
        largest=max(residuals, key=lambda one: abs(one.residual_us)),
        outliers=_outliers(residuals, groups, chosen),
        uncertainty_us=_uncertainty_us(residuals, fit, robust=robust),
        fit_keys=bus_of(profile).fit_keys(network_of(profile), model=model if way == "timing-model" else None),
        at_most_us=max(one.shortest_us for one in halves.values()),
        robust=robust,
    )


_Halves = Mapping[tuple[str, int], Halves]


def _packets(profile: Profile, measurements: Sequence[Measurement], model: str) -> _Halves:
    """Time of the packets for every transaction and payload that was measured."""
    bus, network = bus_of(profile), network_of(profile)
    return {
        (kind, size): bus.halves(network, model=model, kind=kind, payload_bytes=size)
        for kind, size in dict.fromkeys((one.transaction, one.payload_bytes) for one in measurements)
    }


def _second_halves_us(measurements: Sequence[Measurement], halves: _Halves) -> dict[tuple[str, int], float]:
    """T4 + T5 of each transaction and payload whose T1 + T2 was measured [us].

    It is the T1 + T2 of the smallest payload, where the two packets differ least, and what the sizes of the packets
    change. Two equal halves would charge the payload of a write to its response, too.
    """
    found: dict[tuple[str, int], float] = {}
    for kind in {one.transaction for one in measurements}:
        own = [one for one in measurements if one.transaction == kind]
        smallest = min(one.payload_bytes for one in own)
        measured_us = [one.request_and_acknowledge_us for one in own if one.payload_bytes == smallest]
        first_us = median(us for us in measured_us if us is not None) if None not in measured_us else 0.0
        for size in {one.payload_bytes for one in own}:
            second, first = halves[kind, size], halves[kind, smallest]
            found[kind, size] = first_us + second.response_and_acknowledge_us - first.request_and_acknowledge_us
    return found


def _packets_us(one: Measurement, halves: _Halves, second_us: Mapping[tuple[str, int], float]) -> float:
    """Latency minus T_exec [us]."""
    key = (one.transaction, one.payload_bytes)
    if one.request_and_acknowledge_us is not None:
        return one.request_and_acknowledge_us + second_us[key]
    return halves[key].latency_us


def _uncertainty_us(
    residuals: Sequence[Residual], fit: LinearExecution | TableExecution, *, robust: bool
) -> float | None:
    """Standard deviation of the measurements about the fit [us]; None where the fit uses all of them up."""
    parameters = len(fit.payload_bytes) if isinstance(fit, TableExecution) else 2
    free = len(residuals) - parameters
    if free <= 0:
        return None
    if robust:
        spread_us = _DEVIATION_PER_MAD * median(abs(one.residual_us) for one in residuals)
    else:
        spread_us = (sum(one.residual_us**2 for one in residuals) / free) ** 0.5
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
        f"{source}:{one.line}: payload {one.payload_bytes} bytes is over the {limit} bytes of {payloads.carrier}"
        for one, _ in raw
        if one.payload_bytes > limit
    ]
    short = [(one, packets_us) for one, packets_us in raw if one.latency_us < packets_us]
    problems += [
        f"{source}:{one.line}: latency {one.latency_us:g} us at {one.payload_bytes} bytes is below the "
        f"{packets_us:.3f} us that {needed}"
        for one, packets_us in short
    ]
    if len(short) == len(raw) and way == "timing-model":
        problems.append(f"{source}: every latency is too short: is latency_us in us?")
    if problems:
        raise BusplanError(*problems[:_MOST_SHOWN], *_more(source, len(problems) - _MOST_SHOWN))


_MOST_SHOWN: Final = 50


def _more(source: str, hidden: int) -> list[str]:
    return [f"{source}: and {hidden} more problems"] if hidden > 0 else []


def _residuals(raw: Sequence[tuple[Measurement, float]], fit: LinearExecution | TableExecution) -> tuple[Residual, ...]:
    fitted_us = {size: plain(fit.execution_us(size)) for size in {one.payload_bytes for one, _ in raw}}
    found = []
    for one, packets_us in raw:
        execution_us = round(one.latency_us - packets_us, _EXACT_DECIMALS)
        found.append(
            Residual(
                line=one.line,
                transaction=one.transaction,
                payload_bytes=one.payload_bytes,
                latency_us=one.latency_us,
                packets_us=packets_us,
                execution_us=execution_us,
                residual_us=round(execution_us - fitted_us[one.payload_bytes], _EXACT_DECIMALS),
            )
        )
    return tuple(found)


def _outliers(residuals: Sequence[Residual], groups: Groups, form: ExecutionForm) -> tuple[Residual, ...]:
    """Measurements far from the robust fit; the spread is that of the payload (table) or of all payloads (line)."""
    sturdy_us = middles(groups, robust=True)
    if form == "linear":
        base_us, per_byte_us = theil_sen(groups)
        sturdy_us = {size: base_us + per_byte_us * size for size in groups}
    pools: defaultdict[int, list[tuple[Residual, float]]] = defaultdict(list)
    for one in residuals:
        away_us = abs(one.execution_us - sturdy_us[one.payload_bytes])
        pools[one.payload_bytes if form == "table" else 0].append((one, away_us))
    found = []
    for group in pools.values():
        deviation_us = _DEVIATION_PER_MAD * median(away_us for _, away_us in group)
        found += [
            one
            for one, away_us in group
            if len(group) >= _FEWEST_FOR_OUTLIERS
            and away_us > max(OUTLIER_DEVIATIONS * deviation_us, OUTLIER_SHARE * one.latency_us)
        ]
    return tuple(sorted(found))


def _payload_fits(
    residuals: Sequence[Residual],
    measurements: Sequence[Measurement],
    halves: _Halves,
    fit: LinearExecution | TableExecution,
    *,
    robust: bool,
) -> list[PayloadFit]:
    middle = median if robust else fmean
    groups: defaultdict[int, list[tuple[Residual, Measurement]]] = defaultdict(list)
    for one, measured in zip(residuals, measurements, strict=True):
        groups[one.payload_bytes].append((one, measured))

    def of_payload(size: int, group: Sequence[tuple[Residual, Measurement]]) -> PayloadFit:
        times_us = [one.execution_us for one, _ in group]
        by_kind = {
            kind: [one.execution_us for one, _ in group if one.transaction == kind] for kind in ("read", "write")
        }
        measured_us = [one.request_and_acknowledge_us for _, one in group if one.request_and_acknowledge_us is not None]
        fitted_us = plain(fit.execution_us(size))
        half_us = middle(measured_us) if measured_us else None
        model_us = middle([halves[one.transaction, size].request_and_acknowledge_us for one, _ in group])
        return PayloadFit(
            payload_bytes=size,
            measurements=len(group),
            latency_us=middle([one.latency_us for one, _ in group]),
            packets_us=middle([one.packets_us for one, _ in group]),
            execution_us=middle(times_us),
            deviation_us=stdev(times_us) if len(group) > 1 else None,
            range_us=round(max(times_us) - min(times_us), _EXACT_DECIMALS),
            fitted_us=fitted_us,
            residual_us=round(middle(times_us) - fitted_us, _EXACT_DECIMALS),
            read_less_write_us=middle(by_kind["read"]) - middle(by_kind["write"]) if all(by_kind.values()) else None,
            request_and_acknowledge_us=half_us,
            model_request_and_acknowledge_us=model_us,
            unexplained_us=None if half_us is None else half_us - model_us,
        )

    return [of_payload(size, groups[size]) for size in sorted(groups)]
