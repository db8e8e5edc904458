"""`busplan.calibrate`."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, Literal, Protocol

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.numbers import sentence_text
from busplan.profile.measurements import MAX_MEASUREMENTS_BYTES, Measurement, measurements_from, parse_measurements
from busplan.profile.shipped import locate_measurements
from busplan.profile.toml import read_bytes
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Path, ProfileLike, checked_models, load_profile
from busplan.questions.calibrate import calibration as analysis
from busplan.questions.calibrate.calibration import Calibration, ComparedMeasurement, PayloadFit
from busplan.sections.execution import LinearExecution, TableExecution
from busplan.sections.profile import Profile

_IN_MEMORY = "measurements"
"""Name of measurements that are no file, in messages and documents."""


class Columns(Protocol):
    """Columns by name, such as a mapping or a data frame."""

    def keys(self) -> Iterable[Any]:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any: ...


Measurements = Path | bytes | Columns | Iterable[Mapping[str, Any]] | Iterable[Iterable[Any]]
"""Measured latencies: a CSV file, CSV text, columns by name, or rows."""


@dataclass(frozen=True, slots=True, repr=False)
class CalibrateAnswer(Answer):
    """Answer of `calibrate`.

    Parameters
    ----------
    calibration
        All of the fit: method, residuals, outliers, what the timing model leaves unexplained.
    source
        Name of the measurements: the file, or "measurements".
    """

    calibration: Calibration
    source: str

    @property
    def profile(self) -> Profile:
        """The network that was measured."""
        return self.calibration.profile

    @property
    def execution(self) -> LinearExecution | TableExecution:
        """The execution time T_exec, in us, as the section of a profile."""
        return self.calibration.execution

    @property
    def payloads(self) -> tuple[PayloadFit, ...]:
        """All measurements of each payload, times in us."""
        return self.calibration.payloads

    @property
    def outliers(self) -> tuple[ComparedMeasurement, ...]:
        """Measurements far from the others, by line: of rows in memory the number of the row, from 1."""
        return self.calibration.outliers

    @property
    def changes(self) -> dict[str, object]:
        """The section that `--apply` would write, by its key, for `load_profile(profile, changes=...)`."""
        from busplan.questions.calibrate.report import execution_section, section

        return {section(self.calibration): execution_section(self.calibration)}

    @property
    def edits(self) -> dict[str, object]:
        """The changes that `--apply` makes in the file, by key; None removes a key of the old form."""
        from busplan.questions.calibrate.report import execution_changes

        return execution_changes(self.calibration)

    @property
    def notes(self) -> dict[str, str]:
        """The comment that `--apply` writes above the section, by its key: where the execution time is from."""
        from busplan.questions.calibrate.report import provenance, section

        return {section(self.calibration): provenance(self.calibration, source=PurePath(self.source).name)}

    def _headline(self) -> str:
        from busplan.questions.calibrate.sentences import fit_sentences

        _, form, *_ = fit_sentences(self.calibration)
        return f"{self.profile.name}: {sentence_text(form)}"

    def report(self, *, applied_to: str | None = None) -> Report:
        """The answer in blocks.

        Parameters
        ----------
        applied_to
            The profile's file that the execution time was written into; by default none.
        """
        from busplan.questions.calibrate.report import calibration_report

        return calibration_report(self.calibration, source=self.source, applied_to=applied_to)


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

    Parameters
    ----------
    profile
        The network that was measured: a `Profile`, a path or a shipped name. It is not changed.
    measurements
        A CSV file, the shipped "table-1.csv", or CSV text of several lines or as bytes; columns by name, as a mapping
        or a data frame; or rows, each a mapping or values in the order of the columns. Columns, n values each:
        payload_bytes, latency_us (T_lant [us]), and where known transaction ("read" or "write") and
        request_and_acknowledge_us (T1+T2 [us]).
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
        Not a profile, not measurements (all problems with line and column), or latencies shorter than their packets.

    References
    ----------
    Paper, equations (3), (13), (14); Table I.

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
    network = load_profile(profile)
    if form not in (None, "table", "linear"):
        raise BusplanError(f"form {form!r}: expected 'table' or 'linear'")
    analysis.latencies_of(network)  # refuses a kind without, before a recording of it is read as text
    read, name, shipped = _measured(measurements, name=source or _IN_MEMORY)
    result = analysis.calibrate(
        network,
        read,
        source=name,
        group=group,
        timing_model=None if timing_model is None else checked_models(timing_model, network)[0],
        form=form,
        # The shipped example has published figures, so the result is derived.
        grade="derived" if shipped else "measured",
    )
    return CalibrateAnswer(result, name)


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
