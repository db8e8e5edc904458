"""Answer of `busplan calibrate`."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from busplan.analysis.calibration.calibrate import OUTLIER_DEVIATIONS, Calibration, PayloadFit
from busplan.analysis.capacity.cycle import cycle_of
from busplan.analysis.network import bus_of, network_of
from busplan.answers.documents import document, with_profile
from busplan.forms.blocks import (
    Block,
    Cell,
    Code,
    Column,
    Document,
    Record,
    Report,
    Row,
    Sentence,
    Snippet,
    Table,
    Value,
    count_value,
    joined,
    sentence,
)
from busplan.forms.numbers import nouns, plural, with_unit
from busplan.forms.terminal import sentence_text
from busplan.profile.layout import written
from busplan.sections.execution import LinearExecution, TableExecution

SECTION: Final = "node.execution"
_DECIMALS: Final = 3
_LINE_DIGITS: Final = 6
"""Significant digits of a line's base and slope."""
_COLUMNS: Final = {
    "payload_bytes": Column("payload", "bytes"),
    "measurements": Column("n"),
    "latency_us": Column("T_lant", "us"),
    "packets_us": Column("packets", "us"),
    "execution_us": Column("T_exec", "us"),
    "deviation_us": Column("std dev", "us"),
    "fitted_us": Column("fitted", "us"),
    "residual_us": Column("residual", "us"),
}
_MEASURED_COLUMNS: Final = {
    "request_and_acknowledge_us": Column("measured", "us", group="T1+T2"),
    "model_request_and_acknowledge_us": Column("model", "us", group="T1+T2"),
    "unexplained_us": Column("unexplained", "us", group="T1+T2"),
}
"""Columns of what was measured beside the latency."""
_MOST_LINES: Final = 10
_LONG_EXECUTION_US: Final = 10_000.0
"""An execution time that no motion node has; latencies in ns under a heading of us have it."""


def execution_keys(execution: LinearExecution | TableExecution) -> dict[str, object]:
    """Keys of the execution time with their values, as a profile has them."""
    return {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in execution.model_dump(exclude_none=True).items()
    }


def execution_changes(execution: LinearExecution | TableExecution) -> dict[str, object]:
    """Changes that make a profile's execution time this one; keys of the other form go (None)."""
    gone = dict.fromkeys((*LinearExecution.model_fields, *TableExecution.model_fields))
    return {f"{SECTION}.{key}": value for key, value in {**gone, **execution_keys(execution)}.items()}


def provenance(result: Calibration, *, source: str) -> str:
    """Where an execution time comes from, in the one line that goes into the profile; the same on any day."""
    taken = "T1+T2 as measured" if result.way == "measured-halves" else f"packets by the {result.timing_model} model"
    return (
        f"busplan calibrate: {result.execution.kind} ({result.method}) of "
        f"{plural(len(result.residuals), 'measurement')} in {source}, {taken}, "
        f"rms residual {with_unit(_time(result.rms_residual_us, 'rms_residual_us'))}"
    )


def calibration_report(result: Calibration, *, source: str, applied_to: str | None) -> Report:
    """Answer the question of `calibrate`.

    Parameters
    ----------
    result
        The calibration.
    source
        What the measurements are called.
    applied_to
        The profile that the execution time was written into; None for none.
    """
    name = result.profile.name
    return Report(
        Sentence(("Execution time of ", Code(name), " from ", Code(source))),
        lambda: tuple(_blocks(result, source)),
        partial(calibration_document, result, source=source, applied_to=applied_to),
        lambda: with_profile(name, calibration_records(result)),
    )


def _blocks(result: Calibration, source: str) -> Iterator[Block]:
    """The fit in words, the figures by payload, and the section of the profile."""
    measurements, sizes = len(result.residuals), len(result.payloads)
    yield sentence(
        f"{{}}: T_exec from {{}} {nouns(measurements, 'measurement')} at {{}} {nouns(sizes, 'payload')}, {{}}.",
        Code(result.profile.name),
        count_value(measurements, "measurements", at="/measurements"),
        count_value(sizes),
        Code(source),
    )
    yield _way(result)
    yield _form(result)
    yield _residual(result)
    yield from _unexplained(result)
    yield from (joined(sentence("Warning: ", state="warns"), one, by="") for one in _warnings(result))
    yield _by_payload(result.payloads, measured=result.way == "measured-halves")
    keys = (f"{key} = {written(value)}" for key, value in execution_keys(result.execution).items())
    yield Snippet((f"[{SECTION}]", *keys))


def _time(value_us: float, key: str, *, at: str = "") -> Value:
    return Value(value_us, key, "us", _DECIMALS, at=at)


def _way(result: Calibration) -> Sentence:
    if result.way == "measured-halves":
        return sentence(
            "T_exec = T_lant - 2 (T1+T2), both as measured; the timing model is not used, and stands beside it to show "
            "what it leaves unexplained."
        )
    network = network_of(result.profile)
    bus = bus_of(result.profile)
    where = ", ".join((bus.payloads(network).carrier, *bus.setup_words(network)))
    return sentence(
        f"T_exec = T_lant - (T1+T2) - (T4+T5), eq (3): both halves by the {result.timing_model} timing model for "
        f"{where}."
    )


def _form(result: Calibration) -> Sentence:
    execution = result.execution
    if execution.kind == "linear":
        meaning = "all measurements" if result.method == "least squares" else "the median at each payload"
        return sentence(
            f"Line: {{}} + {{}} * payload, by {result.method} through {meaning}.",
            Value(execution.base_us, "base_us", "us", digits=_LINE_DIGITS, at="/execution/base_us"),
            Value(execution.per_byte_us, "per_byte_us", "us/byte", digits=_LINE_DIGITS, at="/execution/per_byte_us"),
        )
    return sentence(f"Table: the {result.method} at each payload, {execution.range_bytes}.")


def _residual(result: Calibration) -> Sentence:
    one, at = result.largest, "/largest_residual"
    said = sentence(
        "Measured less fitted: rms {}, largest {}",
        _time(result.rms_residual_us, "rms_residual_us", at="/rms_residual_us"),
        _time(one.residual_us, "residual_us", at=f"{at}/residual_us"),
    )
    if one.residual_us:
        place = sentence(
            " at {} (line {})",
            Value(one.payload_bytes, "payload_bytes", "bytes", at=f"{at}/payload_bytes"),
            count_value(one.line, "line", at=f"{at}/line"),
        )
        said = joined(said, place, by="")
    repeated = [(fit.deviation_us, at) for at, fit in enumerate(result.payloads) if fit.deviation_us is not None]
    if not repeated:
        return joined(said, sentence("."), by="")
    most_us, number = max(repeated)
    scatter = _time(most_us, "deviation_us", at=f"/payloads/{number}/deviation_us")
    return joined(said, sentence(". Repetitions scatter by {} at most (standard deviation).", scatter), by="")


def _unexplained(result: Calibration) -> Iterator[Sentence]:
    model = f"the {result.timing_model} timing model"
    halves = [(fit.unexplained_us, at) for at, fit in enumerate(result.payloads) if fit.unexplained_us is not None]
    if halves:
        mean_us = sum(value for value, _ in halves) / len(halves)
        worst_us, number = max(halves, key=lambda pair: abs(pair[0]))
        fit, at = result.payloads[number], f"/payloads/{number}"
        share = worst_us / (fit.request_and_acknowledge_us or 1)
        yield sentence(
            f"Left unexplained by {model}: {{}} of T1+T2 on average, {{}} at most ({{}} of the measured, at {{}}).",
            _time(mean_us, "unexplained_us"),
            _time(worst_us, "unexplained_us", at=f"{at}/unexplained_us"),
            Value(share, "", "%", 0, fixed=True),
            Value(fit.payload_bytes, "payload_bytes", "bytes", at=f"{at}/payload_bytes"),
        )
    kinds = [abs(fit.read_less_write_us) for fit in result.payloads if fit.read_less_write_us is not None]
    if kinds:
        yield sentence(
            f"Left unexplained by {model}: T_exec of reads and of writes, which differ by up to {{}}.",
            _time(max(kinds), "read_less_write_us"),
        )


def calibration_warnings(result: Calibration) -> list[str]:
    """What to look at before these figures are used."""
    return list(map(sentence_text, _warnings(result)))


def _warnings(result: Calibration) -> Iterator[Sentence]:
    if result.outliers:
        yield _outliers(result)
    execution, payload = result.execution, result.profile.payload
    if isinstance(execution, TableExecution):
        outside = [size for size in (payload.read_bytes, payload.write_bytes) if not execution.covers(size)]
        for size in dict.fromkeys(outside):
            yield sentence(
                f"the profile's payload of {{}} is outside the table, {execution.range_bytes}: measure it, or use "
                "--form linear.",
                Value(size, "payload_bytes", "bytes"),
            )
    longest_us = max(fit.execution_us for fit in result.payloads)
    if longest_us > _LONG_EXECUTION_US:
        yield sentence(
            "an execution time of {} is long for a motion node: is latency_us in us?",
            Value(longest_us, "execution_us", "us", 0),
        )


def _outliers(result: Calibration) -> Sentence:
    number = len(result.outliers)
    shown = result.outliers[:_MOST_LINES]
    lines = [sentence("{}", count_value(one.line, "line", at=f"/outliers/{at}/line")) for at, one in enumerate(shown)]
    said = joined(
        sentence(
            f"{{}} {nouns(number, 'outlier')}, more than {{}} robust standard deviations off: line ",
            count_value(number),
            count_value(OUTLIER_DEVIATIONS),
        ),
        joined(*lines, by=", "),
        by="",
    )
    if number > _MOST_LINES:
        said = joined(said, sentence("and {} more", count_value(number - _MOST_LINES)))
    effect = "no pull on the robust fit" if result.robust else "with a pull on this fit: see --robust"
    return joined(said, sentence(f"; {effect}."), by="")


def _by_payload(payloads: Sequence[PayloadFit], *, measured: bool) -> Table:
    shown = {**_COLUMNS, **(_MEASURED_COLUMNS if measured else {})}
    rows = (
        Row(tuple(_cell(getattr(fit, key), key, f"/payloads/{number}/{key}") for key in shown))
        for number, fit in enumerate(payloads)
    )
    return Table(tuple(shown.values()), tuple(rows))


def _cell(value: float | None, key: str, at: str) -> Cell:
    """Three decimals for all times: what is less is the rounding of the result."""
    if value is None:
        return ""
    return _time(value, key, at=at)._replace(fixed=True) if key.endswith("_us") else count_value(value, key, at=at)


def calibration_records(result: Calibration) -> list[Record]:
    """One row a payload."""
    return [fit._asdict() for fit in result.payloads]


def calibration_document(result: Calibration, *, source: str, applied_to: str | None) -> Document:
    """Document of `busplan calibrate --format json`."""
    bus, cycle = bus_of(result.profile), cycle_of(result.profile, model=result.timing_model)
    figures = cycle.figures()
    return document(
        "calibrate",
        profile=result.profile.name,
        source=source,
        timing_model=result.timing_model,
        nodes=cycle.network.nodes,
        **{key: figures[key] for key in bus.facts},
        way=result.way,
        form=result.execution.kind,
        method=result.method,
        robust=result.robust,
        measurements=len(result.residuals),
        execution=execution_keys(result.execution),
        rms_residual_us=result.rms_residual_us,
        largest_residual=result.largest._asdict(),
        outliers=[one._asdict() for one in result.outliers],
        payloads=calibration_records(result),
        warnings=calibration_warnings(result),
        applied_to=applied_to,
    )
