"""`busplan.calibrate`."""

import os
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from pathlib import PurePath
from statistics import median, stdev
from typing import Any, Final, NamedTuple, Protocol

from busplan.buses.network import Network
from busplan.buses.parts import MeasuredLatencies, PacketTime
from busplan.english import plural
from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import Report
from busplan.forms.numbers import sentence_text
from busplan.profile.document import read_bytes
from busplan.profile.measurements import MAX_MEASUREMENTS_BYTES, Measurement, measurements_from, parse_measurements
from busplan.profile.sources import locate_measurements
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import FilePath, ProfileLike, checked_models, load_network, with_its_constants
from busplan.sections.base import TransactionKind
from busplan.sections.cycle import MEASURED_UNCERTAINTY_US, LinearExecution, TableExecution
from busplan.sections.machine import ProfileGroup
from busplan.sections.profile import Profile

_FAR: Final = 3.5
"""Distance from which a measurement is far from the others [robust standard deviations] (Iglewicz and Hoaglin)."""
_OUTLIER_SHARE: Final = 0.01
"""Least distance of an outlier, as a share of its latency [1]. Steps of a timer are no outliers."""
_DEVIATION_PER_MAD: Final = 1.4826
"""Standard deviation of a normal distribution whose median absolute deviation is 1."""
REPETITIONS_TO_COMPARE: Final = 3
"""Measurements of one payload needed to tell an outlier among them."""
_DECIMALS: Final = 6
"""Decimals of a time in us: below a picosecond there is only rounding of the subtraction."""
_MOST_PROBLEMS: Final = 50


class Timed(NamedTuple):
    """A measurement, with the node's execution time."""

    line: int
    transaction: TransactionKind
    payload_bytes: int
    latency_us: float
    packets_us: float
    """Time of the packets, which is subtracted from the latency [us]."""
    execution_us: float
    """Execution time T_exec [us]."""


class Outlier(NamedTuple):
    """A measurement far from the others of its payload: above them a slow execution, below them a contradiction."""

    line: int
    transaction: TransactionKind
    payload_bytes: int
    latency_us: float
    execution_us: float
    off_us: float
    """T_exec less the median of its transaction and payload [us]."""


class PayloadFit(NamedTuple):
    """Measurements of one payload without its outliers; times are in us."""

    payload_bytes: int
    measurements: int
    """Number of all measurements, outliers included."""
    left_out: int
    """Number of outliers."""
    latency_us: float
    """Median of the latency T_lant [us]."""
    packets_us: float
    execution_us: float
    """Median of the execution time T_exec [us]."""
    deviation_us: float | None
    """Standard deviation of T_exec over the repetitions [us]; None for a single measurement."""


def _timed(
    network: Network,
    measurements: Sequence[Measurement],
    packets: Mapping[tuple[TransactionKind, int], PacketTime],
    *,
    source: str,
    model: str,
) -> list[Timed]:
    """T_exec of each measurement by equation (3): its latency less the time of its packets.

    Payloads over the limit of the bus, and latencies shorter than their packets, raise one BusplanError for all.
    """
    payloads = network.bus.payloads(network)
    samples, problems = [], []
    for measurement in measurements:
        line, transaction, size, latency_us = measurement
        packets_us = packets[transaction, size].us
        samples.append(Timed(*measurement, packets_us, round(latency_us - packets_us, _DECIMALS)))
        if size > payloads.most_bytes:
            problems.append(
                f"{source}:{line}: payload {size} bytes is over the {payloads.most_bytes} bytes of {payloads.carrier}"
            )
        if latency_us < packets_us:
            problems.append(
                f"{source}:{line}: latency {latency_us:g} us at {size} bytes is below the {packets_us:.3f} us that the "
                f"packets alone take in the {model} model"
            )
    if all(sample.execution_us < 0 for sample in samples):
        problems.insert(0, f"{source}: every latency is too short: is latency_us in us?")
    more = len(problems) - _MOST_PROBLEMS
    if problems:
        raise BusplanError(*problems[:_MOST_PROBLEMS], *([f"{source}: and {more} more problems"] if more > 0 else []))
    return samples


def _outliers(samples: Sequence[Timed]) -> dict[int, Outlier]:
    """Measurements by index that are far from the median of three or more of the same transaction and payload.

    References
    ----------
    B. Iglewicz, D. Hoaglin, "How to Detect and Handle Outliers" (1993): the median absolute deviation, and 3.5 of it.
    """
    places: defaultdict[tuple[str, int], list[int]] = defaultdict(list)
    for place, sample in enumerate(samples):
        places[sample.transaction, sample.payload_bytes].append(place)
    repeated_us = []
    for group in places.values():
        if len(group) >= REPETITIONS_TO_COMPARE:
            middle_us = median(samples[place].execution_us for place in group)
            repeated_us.append({place: samples[place].execution_us - middle_us for place in group})
    # Long executions may scatter more than short ones, and three of a kind may be equal by chance.
    all_us = _middle_distance_us(us for group in repeated_us for us in group.values())
    outliers = {}
    for off_us in repeated_us:
        deviation_us = _DEVIATION_PER_MAD * max(all_us, _middle_distance_us(off_us.values()))
        for place, us in off_us.items():
            if abs(us) > max(_OUTLIER_SHARE * samples[place].latency_us, _FAR * deviation_us):
                line, transaction, size, latency_us, _, execution_us = samples[place]
                outliers[place] = Outlier(line, transaction, size, latency_us, execution_us, round(us, _DECIMALS))
    return dict(sorted(outliers.items()))


def _middle_distance_us(off_us: Iterable[float]) -> float:
    return median([abs(us) for us in off_us] or [0.0])


def _payload_fits(samples: Sequence[Timed], left_out: Mapping[int, Outlier]) -> tuple[PayloadFit, ...]:
    """Measurements of each payload, payloads ascending."""
    places_by_size: defaultdict[int, list[int]] = defaultdict(list)
    for place, sample in enumerate(samples):
        places_by_size[sample.payload_bytes].append(place)
    fits = []
    for size, places in sorted(places_by_size.items()):
        kept = [samples[place] for place in places if place not in left_out]
        fits.append(
            PayloadFit(
                payload_bytes=size,
                measurements=len(places),
                left_out=len(places) - len(kept),
                latency_us=median(sample.latency_us for sample in kept),
                packets_us=median(sample.packets_us for sample in kept),
                execution_us=median(sample.execution_us for sample in kept),
                deviation_us=stdev(sample.execution_us for sample in kept) if len(kept) > 1 else None,
            )
        )
    return tuple(fits)


_IN_MEMORY: Final = "measurements"
"""Name of measurements that are no file, in messages and documents."""
_WORST: Final = "worst_extra_us"
_TIME_DECIMALS: Final = 3
_PICOSECOND: Final = 1e-3
"""A picosecond [ns]. An excess that rounding adds is no nanosecond."""


class Columns(Protocol):
    """Columns by name, such as a mapping or a data frame."""

    def keys(self) -> Iterable[Any]:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any: ...


Measurements = FilePath | bytes | Columns | Iterable[Mapping[str, Any]] | Iterable[Iterable[Any]]
"""Measured latencies: a CSV file, CSV text, columns by name, or rows."""


@dataclass(frozen=True, slots=True, repr=False)
class CalibrateAnswer(Answer):
    """Answer of `calibrate`; times are in us."""

    profile: Profile
    """Network that was measured."""
    setup: tuple[str, ...]
    """Carrier of a payload, and the settings of the bus in force, each in a few words."""
    headings: Mapping[str, object]
    """Figures on the settings of the bus, by key."""
    source: str
    """Name of the measurements: the file, or "measurements"."""
    nodes: ProfileGroup
    """Nodes that were measured."""
    timing_model: str
    """Timing model of the packets."""
    execution: TableExecution
    """Execution time T_exec as the section of a profile: the median at each payload."""
    measurements: int
    """Number of all measurements, outliers included."""
    payloads: tuple[PayloadFit, ...]
    """All measurements of each payload."""
    outliers: tuple[Outlier, ...]
    """Measurements far from the others, by line; for rows in memory, by number of the row, from 1."""
    unchecked_bytes: tuple[int, ...]
    """Payloads with too few measurements to tell an outlier."""
    uncertainty_us: float | None
    """Standard uncertainty of T_exec [us], the spread of the measurements about the medians; None where none is
    repeated.
    """
    worst_extra_us: float | None
    """Time of the slowest execution beyond the median [us]; None without a slow outlier."""
    at_most_us: float
    """Smallest execution time that a latency shows [us]."""
    section: dict[str, object]
    """Keys and values of that section, from the measurements."""

    @property
    def key(self) -> str:
        """Dotted key of the section with the execution time."""
        return self.nodes.node_key("execution")

    @property
    def changes(self) -> dict[str, object]:
        """The section that `--apply` would write, by its key, for `load_profile(profile, changes=...)`."""
        old = self.nodes.node.execution
        kept = {_WORST: getattr(old, _WORST)} if _WORST in old.model_fields_set else {}
        return {self.key: {**kept, **self.section}}

    @property
    def edits(self) -> dict[str, object]:
        """Changes that `--apply` makes in the file, by key; None removes a key of the old form."""
        gone = dict.fromkeys((*LinearExecution.model_fields, *TableExecution.model_fields))
        del gone[_WORST]  # A slow execution that was once seen can happen again.
        return {f"{self.key}.{key}": value for key, value in {**gone, **self.section}.items()}

    @property
    def notes(self) -> dict[str, str]:
        """Comment that `--apply` writes above the section, by its key: the source of the execution time."""
        slow = sum(outlier.off_us > 0 for outlier in self.outliers)
        fast = len(self.outliers) - slow
        doubts = (f"{slow} slow in {_WORST}, " if slow else "", f"{fast} fast left out, " if fast else "")
        kept = plural(self.measurements - len(self.outliers), "measurement")
        note = f"busplan calibrate: median of {kept} in {PurePath(self.source).name}, {''.join(doubts)}packets by the "
        return {self.key: f"{note}{self.timing_model} model"}

    def _headline(self) -> str:
        from busplan.questions.calibrate.report import fit_sentence

        return sentence_text(fit_sentence(self))

    def report(self, *, applied_to: str | None = None) -> Report:
        """The answer in blocks.

        Parameters
        ----------
        applied_to
            File of the profile into which the execution time was written; by default none.
        """
        from busplan.questions.calibrate.report import calibration_report

        return calibration_report(self, applied_to=applied_to)


@with_its_constants
def calibrate(
    profile: ProfileLike,
    measurements: Measurements,
    *,
    group: str | None = None,
    timing_model: str | None = None,
    source: str | None = None,
) -> CalibrateAnswer:
    """Find the execution time T_exec of a node from measured latencies.

    T_exec is the latency less the time of its packets; for each payload the median counts. Measurements far from the
    others of their payload are left out; the slow ones give the extra time of the slowest execution.

    Parameters
    ----------
    profile
        The network that was measured: a `Profile`, a path or a shipped name. It is not changed. The transactions are
        those of its farthest node.
    measurements
        A CSV file, the shipped "table-1.csv", or CSV text of several lines or as bytes; columns by name, as a mapping
        or a data frame; or rows, each a mapping or values in the order of the columns. Columns, n values each:
        payload_bytes, latency_us (T_lant [us]), and where known transaction ("read" or "write").
    group
        Name of the measured group of nodes; by default the only one of the profile.
    timing_model
        Name of the timing model for the time of the packets; by default the one that decides.
    source
        Name of measurements that are no file, in messages and documents; by default "measurements".

    Returns
    -------
    CalibrateAnswer
        Times are in us. Its `changes` go into `load_profile`.

    Raises
    ------
    BusplanError
        Not a profile, not measurements (all problems with line and column), no group of that name, or latencies
        shorter
        than their packets.

    References
    ----------
    Paper, equation (3).

    Examples
    --------
    >>> import busplan
    >>> rows = [(4, 48.7), (16, 55.2), (64, 80.9), (256, 184.4)]
    >>> answer = busplan.calibrate("paper-two-node", rows)
    >>> answer.execution.time_us
    (38.088, 44.181, 68.905, 168.498)
    >>> busplan.load_profile("paper-two-node", changes=answer.changes).node.execution.grade
    'measured'
    """
    network = load_network(profile)
    latencies = _latencies_of(network)  # This refuses a kind without them, before a recording of it is read as text.
    read, name, shipped = _measured(measurements, name=source or _IN_MEMORY)
    nodes = _nodes(network.profile, group)
    model = network.bus.deciding_model if timing_model is None else checked_models(timing_model, network)[0]
    sizes = dict.fromkeys((measurement.transaction, measurement.payload_bytes) for measurement in read)
    packets = {(kind, size): latencies.packets(network, nodes.name, model, kind, size) for kind, size in sizes}
    samples = _timed(network, read, packets, source=name, model=model)
    left_out = _outliers(samples)
    payloads = _payload_fits(samples, left_out)
    times_us = {fit.payload_bytes: round(fit.execution_us, _TIME_DECIMALS) for fit in payloads}
    off_us = [sample.execution_us - times_us[sample.payload_bytes] for sample in samples]
    kept_us = [us for place, us in enumerate(off_us) if place not in left_out]
    free = len(kept_us) - len(payloads)
    uncertainty_us = None
    if free > 0:
        spread_us = sqrt(sum(us**2 for us in kept_us) / free)
        uncertainty_us = round(max(spread_us, float(MEASURED_UNCERTAINTY_US)), _TIME_DECIMALS)
    is_slow = any(outlier.off_us > 0 for outlier in left_out.values())
    worst_extra_us = ceil(1000 * max(off_us) - _PICOSECOND) / 1000 if is_slow else None
    execution = TableExecution(
        kind="table",
        payload_bytes=tuple(times_us),
        time_us=tuple(times_us.values()),
        # The shipped example has published figures.
        grade="derived" if shipped else "measured",
    )
    repetitions = Counter((sample.transaction, sample.payload_bytes) for sample in samples)
    few = {size for (_, size), number in repetitions.items() if number < REPETITIONS_TO_COMPARE}
    set_up = network.bus.cycle(network, model=model).figures()
    return CalibrateAnswer(
        profile=network.profile,
        setup=(network.bus.payloads(network).carrier, *network.bus.setup_words(network)),
        headings={key: set_up[key] for key in network.bus.figures.headings},
        source=name,
        nodes=nodes,
        timing_model=model,
        execution=execution,
        measurements=len(read),
        payloads=payloads,
        outliers=tuple(left_out.values()),
        unchecked_bytes=tuple(sorted(few)),
        uncertainty_us=uncertainty_us,
        worst_extra_us=worst_extra_us,
        at_most_us=max(packet.shortest_us for packet in packets.values()),
        section=_section(nodes, execution, latencies.fit_keys(network, model), uncertainty_us, worst_extra_us),
    )


def _section(
    nodes: ProfileGroup,
    execution: TableExecution,
    fit_keys: Mapping[str, object],
    uncertainty_us: float | None,
    worst_extra_us: float | None,
) -> dict[str, object]:
    """Keys and values of an execution time, as in a profile."""
    keys = {**execution.model_dump(exclude_none=True, exclude={_WORST}), **fit_keys}
    if uncertainty_us is not None:
        keys["uncertainty_us"] = uncertainty_us
    if worst_extra_us is not None:
        # The profile may know of a slower one.
        keys[_WORST] = max(worst_extra_us, nodes.node.execution.worst_extra_us)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in keys.items()}


def _nodes(profile: Profile, group: str | None) -> ProfileGroup:
    """Nodes that were measured."""
    by_name = {nodes.name: nodes for nodes in profile.node_groups}
    if group is None and len(by_name) == 1:
        return profile.node_groups[0]
    if group in by_name:
        return by_name[group]
    known = f"the groups {', '.join(by_name)}" if profile.group else "no groups"
    if group is None:
        raise BusplanError(f"{profile.name} has {known}; give the group that was measured")
    raise ArgumentError(f"group {group}: {profile.name} has {known}")


def _latencies_of(network: Network) -> MeasuredLatencies:
    """Method by which the kind of bus finds execution times from latencies."""
    bus = network.bus
    if bus.calibration is None:
        way_out = f"; {bus.recordings} is for busplan measured" if bus.recordings else ""
        raise BusplanError(
            f"bus.kind {bus.kind}: {bus.title} has no transactions to find an execution time from{way_out}"
        )
    return bus.calibration


def _measured(given: Measurements, *, name: str) -> tuple[tuple[Measurement, ...], str, bool]:
    """Measurements, their name, and whether they are the shipped example."""
    if isinstance(given, bytes) or (isinstance(given, str) and "\n" in given):
        return parse_measurements(given if isinstance(given, bytes) else given.encode(), name=name), name, False
    if isinstance(given, str | os.PathLike):
        text = os.fspath(given)
        if text == "-":
            raise BusplanError("-: standard input is read by the command line alone; give a file or its text")
        path, name, shipped = locate_measurements(text)
        content = read_bytes(path, name=name, limit=MAX_MEASUREMENTS_BYTES)
        return parse_measurements(content, name=name), name, shipped
    return measurements_from(given, name=name), name, False
