"""Answer of `busplan calibrate`."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.forms.blocks import (
    Block,
    Cell,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    Snippet,
    Table,
    TableColumn,
    TableRow,
    count_value,
    joined,
    sentence,
)
from busplan.forms.numbers import nouns, plural, sentence_text, with_unit
from busplan.profile.write import value_text
from busplan.questions.calibrate.calibration import Calibration, PayloadFit
from busplan.questions.calibrate.sentences import fit_sentences, slow_and_fast, time_value, warning_sentences
from busplan.questions.fit.certainty import cycle_of
from busplan.questions.fit.network import bus_of
from busplan.questions.words.documents import document, with_profile
from busplan.sections.execution import LinearExecution, TableExecution


def section(result: Calibration) -> str:
    """Dotted key of the section that the execution time stands in."""
    return result.nodes.node_key("execution")


_COLUMNS: Final = {
    "payload_bytes": TableColumn("payload", "bytes"),
    "measurements": TableColumn("n"),
    "left_out": TableColumn("left out"),
    "latency_us": TableColumn("T_lant", "us", rank=3),
    "packets_us": TableColumn("packets", "us", rank=2),
    "execution_us": TableColumn("T_exec", "us"),
    "deviation_us": TableColumn("std dev", "us", rank=1),
    "fitted_us": TableColumn("fitted", "us"),
    "residual_us": TableColumn("residual", "us"),
}
_MEASURED_COLUMNS: Final = {
    "request_and_acknowledge_us": TableColumn("measured", "us", group="T1+T2"),
    "model_request_and_acknowledge_us": TableColumn("model", "us", group="T1+T2"),
    "unexplained_us": TableColumn("unexplained", "us", group="T1+T2"),
}
"""Further columns if T1+T2 was measured, too."""


_WORST: Final = "worst_extra_us"
_OF_OUTLIERS: Final = ("expected_us", "off_us")


def execution_keys(result: Calibration) -> dict[str, object]:
    """Keys and values of the execution time, as in a profile."""
    keys = {**result.execution.model_dump(exclude_none=True, exclude={_WORST}), **result.fit_keys}
    if result.uncertainty_us is not None:
        keys["uncertainty_us"] = result.uncertainty_us
    if result.worst_extra_us is not None:
        # The profile may know of a slower one.
        keys[_WORST] = max(result.worst_extra_us, result.nodes.node.execution.worst_extra_us)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in keys.items()}


def execution_changes(result: Calibration) -> dict[str, object]:
    """Changes that set a profile's execution time; None removes a key of the other form, or of the old one."""
    gone = dict.fromkeys((*LinearExecution.model_fields, *TableExecution.model_fields))
    del gone[_WORST]
    return {f"{section(result)}.{key}": value for key, value in {**gone, **execution_keys(result)}.items()}


def execution_section(result: Calibration) -> dict[str, object]:
    """The whole section of the execution time, with what the measurements do not say as it was."""
    old = result.nodes.node.execution
    kept = {_WORST: getattr(old, _WORST)} if _WORST in old.model_fields_set else {}
    return {**kept, **execution_keys(result)}


def provenance(result: Calibration, *, source: str) -> str:
    """Origin of an execution time, as a one-line comment for the profile, without a date."""
    taken = "T1+T2 as measured" if result.way == "measured-halves" else f"packets by the {result.timing_model} model"
    return (
        f"busplan calibrate: {result.execution.kind} ({result.method}) of "
        f"{plural(len(result.residuals), 'measurement')} in {source}, {_doubts(result)}{taken}, "
        f"rms residual {with_unit(time_value(result.rms_residual_us, 'rms_residual_us'))}"
    )


def _doubts(result: Calibration) -> str:
    """Outliers, for a list in words."""
    slow, fast = slow_and_fast(result)
    said = (f"{len(slow)} slow in {_WORST}, " if slow else "", f"{len(fast)} fast left out, " if fast else "")
    return "".join(said)


def calibration_report(result: Calibration, *, source: str, applied_to: str | None) -> Report:
    """Report of `calibrate`.

    Parameters
    ----------
    result
        The calibration.
    source
        Name of the measurements.
    applied_to
        The profile that the execution time was written into; None if it was not written.
    """
    name = result.profile.name
    return Report(
        Sentence(("Execution time of ", Code(name), " from ", Code(source))),
        tuple(_blocks(result, source)),
        calibration_document(result, source=source, applied_to=applied_to),
        with_profile(name, calibration_records(result)),
    )


def _blocks(result: Calibration, source: str) -> Iterator[Block]:
    """The fit in sentences, the figures by payload, and the section for the profile."""
    measurements, sizes = result.measurements, len(result.payloads)
    yield sentence(
        f"{{}}: T_exec from {{}} {nouns(measurements, 'measurement')} at {{}} {nouns(sizes, 'payload')}, {{}}.",
        Code(result.profile.name),
        count_value(measurements, "measurements"),
        count_value(sizes),
        Code(source),
    )
    yield from fit_sentences(result)
    yield from (joined(sentence("Warning: ", state="warns"), warning, by="") for warning in warning_sentences(result))
    yield _by_payload(result.payloads, measured=result.way == "measured-halves")
    keys = (f"{key} = {value_text(value)}" for key, value in execution_keys(result).items())
    where = f"[group.execution]  # of {result.nodes.name}" if result.nodes.name else f"[{section(result)}]"
    yield Snippet((where, *keys))


def _by_payload(payloads: Sequence[PayloadFit], *, measured: bool) -> Table:
    shown = {**_COLUMNS, **(_MEASURED_COLUMNS if measured else {})}
    if not any(fit.left_out for fit in payloads):
        del shown["left_out"]
    rows = (TableRow(tuple(_cell(getattr(fit, key), key) for key in shown)) for fit in payloads)
    return Table(tuple(shown.values()), tuple(rows))


def _cell(value: float | None, key: str) -> Cell:
    """A time has three decimals; further ones are rounding."""
    if value is None:
        return ""
    return time_value(value, key)._replace(fixed=True) if key.endswith("_us") else count_value(value, key)


def calibration_warnings(result: Calibration) -> list[str]:
    """Warnings: things to check before these figures are used."""
    return list(map(sentence_text, warning_sentences(result)))


def calibration_records(result: Calibration) -> list[Record]:
    """One row for each payload."""
    return [fit._asdict() for fit in result.payloads]


def calibration_document(result: Calibration, *, source: str, applied_to: str | None) -> JsonDocument:
    """Document of `busplan calibrate --format json`."""
    bus, cycle = bus_of(result.profile), cycle_of(result.profile, model=result.timing_model)
    figures = cycle.figures()
    return document(
        "calibrate",
        profile=result.profile.name,
        source=source,
        timing_model=result.timing_model,
        nodes=cycle.network.nodes,
        **{key: figures[key] for key in bus.figures.headings},
        way=result.way,
        form=result.execution.kind,
        method=result.method,
        measurements=result.measurements,
        execution=execution_keys(result),
        uncertainty_us=result.uncertainty_us,
        at_most_us=result.at_most_us,
        rms_residual_us=result.rms_residual_us,
        largest_residual={key: value for key, value in result.largest._asdict().items() if key not in _OF_OUTLIERS},
        outliers=[outlier._asdict() for outlier in result.outliers],
        worst_extra_us=result.worst_extra_us,
        unchecked_bytes=list(result.unchecked_bytes),
        payloads=calibration_records(result),
        warnings=calibration_warnings(result),
        applied_to=applied_to,
    )
