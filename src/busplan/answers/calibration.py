"""`busplan calibrate`: for people, and as plain data."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.analysis.calibration.calibrate import OUTLIER_DEVIATIONS, Calibration, PayloadFit
from busplan.analysis.capacity.cycle import cycle_of
from busplan.analysis.network import bus_of, network_of
from busplan.answers.documents import Document, Row, document
from busplan.forms.lines import BLANK, Line, plural, table, us
from busplan.profile.layout import written
from busplan.sections.execution import LinearExecution, TableExecution

SECTION: Final = "node.execution"
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
        f"rms residual {us(result.rms_residual_us)} us"
    )


def calibration_lines(result: Calibration, *, source: str) -> Iterator[Line]:
    """The fit in words, the figures by payload, and the section of the profile."""
    sizes = plural(len(result.payloads), "payload")
    yield Line(
        f"{result.profile.name}: T_exec from {plural(len(result.residuals), 'measurement')} at {sizes}, {source}.",
        "good",
    )
    yield Line(_way(result))
    yield Line(_form(result))
    yield Line(_residual(result))
    yield from (Line(text) for text in _unexplained(result))
    yield from (Line(f"Warning: {text}", "warning") for text in calibration_warnings(result))
    yield BLANK
    yield from _by_payload(result.payloads, measured=result.way == "measured-halves")
    yield BLANK
    yield Line(f"[{SECTION}]", "table")
    yield from (Line(f"{key} = {written(value)}", "table") for key, value in execution_keys(result.execution).items())


def _way(result: Calibration) -> str:
    if result.way == "measured-halves":
        return (
            "T_exec = T_lant - 2 (T1+T2), both as measured; the timing model is not used, and stands beside it to show "
            "what it leaves unexplained."
        )
    network = network_of(result.profile)
    bus = bus_of(result.profile)
    where = ", ".join((bus.payloads(network).carrier, *bus.setup_words(network)))
    return (
        f"T_exec = T_lant - (T1+T2) - (T4+T5), eq (3): both halves by the {result.timing_model} timing model for "
        f"{where}."
    )


def _form(result: Calibration) -> str:
    execution = result.execution
    if execution.kind == "linear":
        meaning = "all measurements" if result.method == "least squares" else "the median at each payload"
        return (
            f"Line: {execution.base_us:g} us + {execution.per_byte_us:g} us/byte * payload, by {result.method} "
            f"through {meaning}."
        )
    return f"Table: the {result.method} at each payload, {execution.range_bytes}."


def _residual(result: Calibration) -> str:
    one = result.largest
    where = f" at {one.payload_bytes} bytes (line {one.line})" if one.residual_us else ""
    repeated = [fit.deviation_us for fit in result.payloads if fit.deviation_us is not None]
    scatter = f" Repetitions scatter by {us(max(repeated))} us at most (standard deviation)." if repeated else ""
    return (
        f"Measured less fitted: rms {us(result.rms_residual_us)} us, largest {us(one.residual_us)} us{where}.{scatter}"
    )


def _unexplained(result: Calibration) -> Iterator[str]:
    model = f"the {result.timing_model} timing model"
    halves = [(fit.unexplained_us, fit) for fit in result.payloads if fit.unexplained_us is not None]
    if halves:
        mean_us = sum(value for value, _ in halves) / len(halves)
        value, fit = max(halves, key=lambda pair: abs(pair[0]))
        share = value / (fit.request_and_acknowledge_us or 1)
        yield (
            f"Left unexplained by {model}: {us(mean_us)} us of T1+T2 on average, {us(value)} us at most "
            f"({share:.0%} of the measured, at {fit.payload_bytes} bytes)."
        )
    kinds = [fit.read_less_write_us for fit in result.payloads if fit.read_less_write_us is not None]
    if kinds:
        worst_us = max(map(abs, kinds))
        yield f"Left unexplained by {model}: T_exec of reads and of writes, which differ by up to {us(worst_us)} us."


def calibration_warnings(result: Calibration) -> list[str]:
    """What to look at before these figures are used."""
    found = []
    if result.outliers:
        lines = ", ".join(str(one.line) for one in result.outliers[:_MOST_LINES])
        more = len(result.outliers) - _MOST_LINES
        effect = "no pull on the robust fit" if result.robust else "with a pull on this fit: see --robust"
        found.append(
            f"{plural(len(result.outliers), 'outlier')}, more than {OUTLIER_DEVIATIONS:g} robust standard deviations "
            f"off: line {lines}{f' and {more} more' if more > 0 else ''}; {effect}."
        )
    execution, payload = result.execution, result.profile.payload
    if isinstance(execution, TableExecution):
        outside = [size for size in (payload.read_bytes, payload.write_bytes) if not execution.covers(size)]
        found += [
            f"the profile's payload of {size} bytes is outside the table, {execution.range_bytes}: measure it, or use "
            "--form linear."
            for size in dict.fromkeys(outside)
        ]
    longest_us = max(fit.execution_us for fit in result.payloads)
    if longest_us > _LONG_EXECUTION_US:
        found.append(f"an execution time of {longest_us:.0f} us is long for a motion node: is latency_us in us?")
    return found


def _by_payload(payloads: Sequence[PayloadFit], *, measured: bool) -> list[Line]:
    def cell(value: float | None) -> str:
        # Three decimals for all: what is less is the rounding of the result.
        return "" if value is None else f"{round(value, 3) + 0:.3f}"

    headings = [
        "payload\nbytes",
        "n",
        "T_lant\nus",
        "packets\nus",
        "T_exec\nus",
        "std dev\nus",
        "fitted\nus",
        "residual\nus",
    ]
    keys = ["latency_us", "packets_us", "execution_us", "deviation_us", "fitted_us", "residual_us"]
    if measured:
        headings += ["T1+T2\nmeasured", "T1+T2\nmodel", "un-\nexplained"]
        keys += ["request_and_acknowledge_us", "model_request_and_acknowledge_us", "unexplained_us"]
    rows = (
        [str(fit.payload_bytes), str(fit.measurements), *(cell(getattr(fit, key)) for key in keys)] for fit in payloads
    )
    return table(headings, rows, left=0)


def calibration_rows(result: Calibration) -> list[Row]:
    """One row a payload."""
    return [fit._asdict() for fit in result.payloads]


def calibration_document(result: Calibration, *, source: str, applied_to: str | None) -> Document:
    """Answer of `busplan calibrate`."""
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
        payloads=calibration_rows(result),
        warnings=calibration_warnings(result),
        applied_to=applied_to,
    )
