"""`busplan.calibrate`."""

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import PurePath
from typing import Any, Final, Protocol

from busplan.buses.network import Network
from busplan.buses.parts import MeasuredLatencies
from busplan.english import plural
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.numbers import sentence_text
from busplan.profile.measurements import MAX_MEASUREMENTS_BYTES, Measurement, measurements_from, parse_measurements
from busplan.profile.shipped import locate_measurements
from busplan.profile.toml import read_bytes
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Path, ProfileLike, checked_models, load_network
from busplan.questions.calibrate.fit import (
    REPETITIONS_TO_COMPARE,
    Outlier,
    PayloadFit,
    outliers,
    payload_fits,
    spread_us,
    timed,
)
from busplan.sections.alike_nodes import AlikeNodes
from busplan.sections.execution import MEASURED_UNCERTAINTY_US, LinearExecution, TableExecution
from busplan.sections.profile import Profile

_IN_MEMORY: Final = "measurements"
"""Name of measurements that are no file, in messages and documents."""
_WORST: Final = "worst_extra_us"
_TIME_DECIMALS: Final = 3
_PICOSECOND: Final = 1e-3
"""A picosecond in nanoseconds: what rounding adds is no nanosecond."""


class Columns(Protocol):
    """Columns by name, such as a mapping or a data frame."""

    def keys(self) -> Iterable[Any]:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any: ...


Measurements = Path | bytes | Columns | Iterable[Mapping[str, Any]] | Iterable[Iterable[Any]]
"""Measured latencies: a CSV file, CSV text, columns by name, or rows."""


@dataclass(frozen=True, slots=True, repr=False)
class CalibrateAnswer(Answer):
    """Answer of `calibrate`; times are in us.

    Parameters
    ----------
    network
        The network that was measured.
    source
        Name of the measurements: the file, or "measurements".
    nodes
        The nodes that were measured.
    timing_model
        Timing model of the packets.
    execution
        The execution time T_exec as the section of a profile: the median at each payload.
    measurements
        Number of all measurements, the outliers among them.
    payloads
        All measurements of each payload.
    outliers
        Measurements far from the others, by line: of rows in memory the number of the row, from 1.
    unchecked_bytes
        Payloads with too few measurements to tell an outlier.
    uncertainty_us
        Standard uncertainty of T_exec, the spread of the measurements about the medians; None where none is repeated.
    worst_extra_us
        Time of the slowest execution beyond the median; None where no outlier is slow.
    at_most_us
        A shorter execution cannot be told from a latency.
    section
        What the measurements say, as keys of that section.
    """

    network: Network
    source: str
    nodes: AlikeNodes
    timing_model: str
    execution: TableExecution
    measurements: int
    payloads: tuple[PayloadFit, ...]
    outliers: tuple[Outlier, ...]
    unchecked_bytes: tuple[int, ...]
    uncertainty_us: float | None
    worst_extra_us: float | None
    at_most_us: float
    section: dict[str, object]

    @property
    def profile(self) -> Profile:
        """The profile that was measured."""
        profile: Profile = self.network.profile
        return profile

    @property
    def key(self) -> str:
        """Dotted key of the section that the execution time stands in."""
        return self.nodes.node_key("execution")

    @property
    def changes(self) -> dict[str, object]:
        """The section that `--apply` would write, by its key, for `load_profile(profile, changes=...)`."""
        old = self.nodes.node.execution
        kept = {_WORST: getattr(old, _WORST)} if _WORST in old.model_fields_set else {}
        return {self.key: {**kept, **self.section}}

    @property
    def edits(self) -> dict[str, object]:
        """The changes that `--apply` makes in the file, by key; None removes a key of the old form."""
        gone = dict.fromkeys((*LinearExecution.model_fields, *TableExecution.model_fields))
        del gone[_WORST]  # what was once seen can happen again
        return {f"{self.key}.{key}": value for key, value in {**gone, **self.section}.items()}

    @property
    def notes(self) -> dict[str, str]:
        """The comment that `--apply` writes above the section, by its key: where the execution time is from."""
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
            The profile's file that the execution time was written into; by default none.
        """
        from busplan.questions.calibrate.report import calibration_report

        return calibration_report(self, applied_to=applied_to)


def calibrate(
    profile: ProfileLike,
    measurements: Measurements,
    *,
    group: str | None = None,
    timing_model: str | None = None,
    source: str | None = None,
) -> CalibrateAnswer:
    """Find the execution time T_exec of a node from measured latencies.

    T_exec is the latency less the time of its packets, and of each payload the median. Measurements far from the others
    of their payload are left out: the slow ones are what the slowest execution takes more.

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
        Name of the group of nodes that was measured; by default the one that the profile has.
    timing_model
        Name of the timing model that says what the packets take; by default the one that decides.
    source
        Name of measurements that are no file, in messages and documents; by default "measurements".

    Returns
    -------
    CalibrateAnswer
        Times are in us. Its `changes` go into `load_profile`.

    Raises
    ------
    BusplanError
        Not a profile, not measurements (all problems with line and column), no group of that name, or latencies shorter
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
    of_bus = _latencies_of(network)  # refuses a kind without, before a recording of it is read as text
    read, name, shipped = _measured(measurements, name=source or _IN_MEMORY)
    nodes = _nodes(network.profile, group)
    model = network.bus.deciding_model if timing_model is None else checked_models(timing_model, network)[0]
    sizes = dict.fromkeys((measurement.transaction, measurement.payload_bytes) for measurement in read)
    packets = {(kind, size): of_bus.packets(network, nodes.name, model, kind, size) for kind, size in sizes}
    samples = timed(network, read, packets, source=name, model=model)
    left_out = outliers(samples)
    payloads = payload_fits(samples, left_out)
    times_us = {fit.payload_bytes: round(fit.execution_us, _TIME_DECIMALS) for fit in payloads}
    off_us = [sample.execution_us - times_us[sample.payload_bytes] for sample in samples]
    kept_us = [us for place, us in enumerate(off_us) if place not in left_out]
    doubt_us = spread_us(kept_us, payloads=len(payloads))
    if doubt_us is not None:
        doubt_us = round(max(doubt_us, float(MEASURED_UNCERTAINTY_US)), _TIME_DECIMALS)
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
    return CalibrateAnswer(
        network=network,
        source=name,
        nodes=nodes,
        timing_model=model,
        execution=execution,
        measurements=len(read),
        payloads=payloads,
        outliers=tuple(left_out.values()),
        unchecked_bytes=tuple(sorted(few)),
        uncertainty_us=doubt_us,
        worst_extra_us=worst_extra_us,
        at_most_us=max(each.shortest_us for each in packets.values()),
        section=_section(nodes, execution, of_bus.fit_keys(network, model), doubt_us, worst_extra_us),
    )


def _section(
    nodes: AlikeNodes,
    execution: TableExecution,
    fit_keys: Mapping[str, object],
    doubt_us: float | None,
    worst_extra_us: float | None,
) -> dict[str, object]:
    """Keys and values of an execution time, as in a profile."""
    keys = {**execution.model_dump(exclude_none=True, exclude={_WORST}), **fit_keys}
    if doubt_us is not None:
        keys["uncertainty_us"] = doubt_us
    if worst_extra_us is not None:
        # The profile may know of a slower one.
        keys[_WORST] = max(worst_extra_us, nodes.node.execution.worst_extra_us)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in keys.items()}


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


def _latencies_of(network: Network) -> MeasuredLatencies:
    """How the kind of bus finds execution times from latencies."""
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
