"""`busplan.calibrate`."""

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import PurePath
from statistics import fmean
from typing import Any, Final, Literal, Protocol

from busplan.buses.network import Network
from busplan.buses.parts import MeasuredLatencies
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.numbers import plural, sentence_text, with_unit
from busplan.profile.measurements import MAX_MEASUREMENTS_BYTES, Measurement, measurements_from, parse_measurements
from busplan.profile.shipped import locate_measurements
from busplan.profile.toml import read_bytes
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Path, ProfileLike, checked_models, load_network
from busplan.questions.calibrate.fit import (
    REPETITIONS_TO_COMPARE,
    Execution,
    Outlier,
    PayloadFit,
    fitted,
    outliers,
    payload_fits,
    residual_us,
    timed,
    uncertainty_us,
)
from busplan.sections.alike_nodes import AlikeNodes
from busplan.sections.execution import LinearExecution, TableExecution
from busplan.sections.profile import Profile

_IN_MEMORY: Final = "measurements"
"""Name of measurements that are no file, in messages and documents."""
_WORST: Final = "worst_extra_us"
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
        The execution time T_exec, as the section of a profile.
    measurements
        Number of all measurements, the outliers among them.
    payloads
        All measurements of each payload.
    outliers
        Measurements far from the others, by line: of rows in memory the number of the row, from 1.
    unchecked_bytes
        Payloads with too few measurements to tell an outlier.
    rms_residual_us
        Root mean square of the measurements less the fit.
    uncertainty_us
        Standard uncertainty of T_exec, the spread of the measurements about the fit; None where nothing is left over.
    worst_extra_us
        Time of the slowest execution beyond the fit; None where no outlier is slow.
    at_most_us
        A shorter execution cannot be told from a latency.
    section
        What the measurements say, as keys of that section.
    """

    network: Network
    source: str
    nodes: AlikeNodes
    timing_model: str
    execution: Execution
    measurements: int
    payloads: tuple[PayloadFit, ...]
    outliers: tuple[Outlier, ...]
    unchecked_bytes: tuple[int, ...]
    rms_residual_us: float
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
    def method(self) -> str:
        """How the time at each payload, and the line through them, were found."""
        return "median" if self.execution.kind == "table" else "Theil-Sen"

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
        from busplan.questions.calibrate.report import time_value

        slow = sum(outlier.off_us > 0 for outlier in self.outliers)
        fast = len(self.outliers) - slow
        doubts = (f"{slow} slow in {_WORST}, " if slow else "", f"{fast} fast left out, " if fast else "")
        kept = plural(self.measurements - len(self.outliers), "measurement")
        rms = with_unit(time_value(self.rms_residual_us, "rms_residual_us"))
        note = (
            f"busplan calibrate: {self.execution.kind} ({self.method}) of {kept} in {PurePath(self.source).name}, "
            f"{''.join(doubts)}packets by the {self.timing_model} model, rms residual {rms}"
        )
        return {self.key: note}

    def _headline(self) -> str:
        from busplan.questions.calibrate.report import form_sentence

        return f"{self.profile.name}: {sentence_text(form_sentence(self))}"

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
    form: Literal["table", "linear"] | None = None,
    group: str | None = None,
    timing_model: str | None = None,
    source: str | None = None,
) -> CalibrateAnswer:
    """Find the execution time T_exec of a node from measured latencies.

    T_exec is the latency less the time of its packets. The fit has the median at each payload, as a table or as the
    line of Theil and Sen through it. Measurements far from the others of their payload are in neither: the slow ones
    are what the slowest execution takes more.

    Parameters
    ----------
    profile
        The network that was measured: a `Profile`, a path or a shipped name. It is not changed. The transactions are
        those of its farthest node.
    measurements
        A CSV file, the shipped "table-1.csv", or CSV text of several lines or as bytes; columns by name, as a mapping
        or a data frame; or rows, each a mapping or values in the order of the columns. Columns, n values each:
        payload_bytes, latency_us (T_lant [us]), and where known transaction ("read" or "write").
    form
        Form of the execution time; by default the profile's node.execution.kind.
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
        Not a profile, not measurements (all problems with line and column), no group of that name, latencies shorter
        than their packets, or a line through one payload or with a negative part.

    References
    ----------
    Paper, equation (3).

    Examples
    --------
    >>> import busplan
    >>> rows = [(4, 48.7), (16, 55.2), (64, 80.9), (256, 184.4)]
    >>> answer = busplan.calibrate("paper-two-node", rows, form="linear")
    >>> round(answer.execution.base_us, 2), round(answer.execution.per_byte_us, 3)
    (35.97, 0.516)
    >>> busplan.load_profile("paper-two-node", changes=answer.changes).node.execution.kind
    'linear'
    """
    network = load_network(profile)
    if form not in (None, "table", "linear"):
        raise BusplanError(f"form {form!r}: expected 'table' or 'linear'")
    of_bus = _latencies_of(network)  # refuses a kind without, before a recording of it is read as text
    read, name, shipped = _measured(measurements, name=source or _IN_MEMORY)
    nodes = _nodes(network.profile, group)
    model = network.bus.deciding_model if timing_model is None else checked_models(timing_model, network)[0]
    sizes = dict.fromkeys((measurement.transaction, measurement.payload_bytes) for measurement in read)
    packets = {(kind, size): of_bus.packets(network, nodes.name, model, kind, size) for kind, size in sizes}
    samples = timed(network, read, packets, source=name, model=model)
    left_out = outliers(samples)
    kept = [sample for place, sample in enumerate(samples) if place not in left_out]
    # The shipped example has published figures, so the result is derived.
    execution = fitted(kept, form or nodes.node.execution.kind, grade="derived" if shipped else "measured", source=name)
    residuals_us = [residual_us(sample, execution) for sample in kept]
    doubt_us = uncertainty_us(residuals_us, execution)
    is_slow = any(outlier.off_us > 0 for outlier in left_out.values())
    worst_us = max(residual_us(sample, execution) for sample in samples)
    worst_extra_us = ceil(1000 * worst_us - _PICOSECOND) / 1000 if is_slow else None
    repetitions = Counter((sample.transaction, sample.payload_bytes) for sample in samples)
    few = {size for (_, size), number in repetitions.items() if number < REPETITIONS_TO_COMPARE}
    return CalibrateAnswer(
        network=network,
        source=name,
        nodes=nodes,
        timing_model=model,
        execution=execution,
        measurements=len(read),
        payloads=tuple(payload_fits(samples, left_out, execution)),
        outliers=tuple(left_out.values()),
        unchecked_bytes=tuple(sorted(few)),
        rms_residual_us=fmean(us**2 for us in residuals_us) ** 0.5,
        uncertainty_us=doubt_us,
        worst_extra_us=worst_extra_us,
        at_most_us=max(each.shortest_us for each in packets.values()),
        section=_section(nodes, execution, of_bus.fit_keys(network, model), doubt_us, worst_extra_us),
    )


def _section(
    nodes: AlikeNodes,
    execution: Execution,
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
