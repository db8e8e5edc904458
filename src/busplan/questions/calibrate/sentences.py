"""Sentences on the fit of a calibration, each figure with its place in the document of `calibrate`."""

from collections.abc import Iterator
from typing import Final

from busplan.forms.blocks import Sentence, ShownValue, count_value, joined, sentence
from busplan.forms.numbers import nouns
from busplan.questions.calibrate.calibration import Calibration, ComparedMeasurement
from busplan.questions.calibrate.outliers import PAYLOADS_TO_COMPARE, REPETITIONS_TO_COMPARE
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.execution import TableExecution
from busplan.sections.transactions import TRANSACTION_KINDS

_LINE_DIGITS: Final = 6
"""Significant digits of a line's base and slope."""
_DECIMALS: Final = 3
_MOST_LINES: Final = 10
_LONG_EXECUTION_US: Final = 10_000.0
"""Longer than the execution time of any motion node: the latencies are probably in ns."""


def time_value(value_us: float, key: str) -> ShownValue:
    """A time of a calibration."""
    return ShownValue(value_us, key, "us", _DECIMALS)


def fit_sentences(result: Calibration) -> Iterator[Sentence]:
    """Say how the execution time was found, its form, its fit, and what the timing model leaves unexplained."""
    yield _way(result)
    yield _form(result)
    yield _residual(result)
    yield from _unexplained(result)
    if result.unchecked_bytes:
        yield _unchecked(result)


def _unchecked(result: Calibration) -> Sentence:
    payloads = joined(*(sentence("{}", count_value(size, "payload_bytes")) for size in result.unchecked_bytes), by=", ")
    return joined(
        sentence("No outlier can be told at "),
        payloads,
        sentence(
            f" bytes: it takes {REPETITIONS_TO_COMPARE} measurements of a payload, or {PAYLOADS_TO_COMPARE} payloads."
        ),
        by="",
    )


def _way(result: Calibration) -> Sentence:
    if result.way == "measured-halves":
        return sentence(
            "T_exec = T_lant - (T1+T2) - (T4+T5): the first half as measured, the second as that of the smallest "
            f"payload, with the sizes of packets by the {result.timing_model} timing model."
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
        without = ", without the outliers" if result.outliers else ""
        return sentence(
            f"Line: {{}} + {{}} * payload, by {result.method} through the median at each payload{without}.",
            ShownValue(execution.base_us, "base_us", "us", digits=_LINE_DIGITS),
            ShownValue(execution.per_byte_us, "per_byte_us", "us/byte", digits=_LINE_DIGITS),
        )
    return sentence(f"Table: the {result.method} at each payload, {execution.range_bytes}.")


def _residual(result: Calibration) -> Sentence:
    largest = result.largest
    said = sentence(
        "Measured less fitted: rms {}, largest {}",
        time_value(result.rms_residual_us, "rms_residual_us"),
        time_value(largest.residual_us or 0.0, "residual_us"),
    )
    if largest.residual_us:
        place = sentence(
            " at {} (line {})",
            ShownValue(largest.payload_bytes, "payload_bytes", "bytes"),
            count_value(largest.line, "line"),
        )
        said = joined(said, place, by="")
    repeated = [fit.deviation_us for fit in result.payloads if fit.deviation_us is not None]
    if not repeated:
        return joined(said, sentence("."), by="")
    scatter = time_value(max(repeated), "deviation_us")
    return joined(said, sentence(". Repetitions scatter by {} at most (standard deviation).", scatter), by="")


def _unexplained(result: Calibration) -> Iterator[Sentence]:
    model = f"the {result.timing_model} timing model"
    halves = [(fit.unexplained_us, fit) for fit in result.payloads if fit.unexplained_us is not None]
    if halves:
        mean_us = sum(value for value, _ in halves) / len(halves)
        worst_us, fit = max(halves, key=lambda pair: abs(pair[0]))
        share = worst_us / (fit.request_and_acknowledge_us or 1)
        yield sentence(
            f"Left unexplained by {model}: {{}} of T1+T2 on average, {{}} at most ({{}} of the measured, at {{}}).",
            time_value(mean_us, "unexplained_us"),
            time_value(worst_us, "unexplained_us"),
            ShownValue(share, "", "%", 0, fixed=True),
            ShownValue(fit.payload_bytes, "payload_bytes", "bytes"),
        )
    kinds = [abs(fit.read_less_write_us) for fit in result.payloads if fit.read_less_write_us is not None]
    if kinds:
        yield sentence(
            f"Left unexplained by {model}: T_exec of reads and of writes, which differ by up to {{}}.",
            time_value(max(kinds), "read_less_write_us"),
        )


def warning_sentences(result: Calibration) -> Iterator[Sentence]:
    """Say what to check before using these figures."""
    yield from _outliers(result)
    execution = result.execution
    if isinstance(execution, TableExecution):
        outside = [size for kind in TRANSACTION_KINDS if not execution.covers(size := int(result.nodes.bytes_of(kind)))]
        for size in dict.fromkeys(outside):
            yield sentence(
                f"the profile's payload of {{}} is outside the table, {execution.range_bytes}: measure it, or use "
                "--form linear.",
                ShownValue(size, "payload_bytes", "bytes"),
            )
    short = [fit for fit in result.payloads if fit.execution_us <= result.at_most_us]
    if short:
        yield sentence(
            "the bus waits {} before any response, so a shorter execution cannot be told from a latency: T_exec is "
            f"at most that at {', '.join(str(fit.payload_bytes) for fit in short)} bytes.",
            time_value(result.at_most_us, "at_most_us"),
        )
    longest_us = max(fit.execution_us for fit in result.payloads)
    if longest_us > _LONG_EXECUTION_US:
        yield sentence(
            "an execution time of {} is long for a motion node: is latency_us in us?",
            ShownValue(longest_us, "execution_us", "us", 0),
        )


def slow_and_fast(result: Calibration) -> tuple[list[ComparedMeasurement], list[ComparedMeasurement]]:
    """The outliers that are slow executions, and those that the others contradict."""
    slow = [outlier for outlier in result.outliers if outlier.off_us > 0]
    return slow, [outlier for outlier in result.outliers if outlier.off_us <= 0]


def _outliers(result: Calibration) -> Iterator[Sentence]:
    """Name the slow executions, and the measurements that the others contradict."""
    for outliers, word in zip(slow_and_fast(result), ("slow", "fast"), strict=True):
        if not outliers:
            continue
        said = joined(
            sentence(f"{{}} {word} {nouns(len(outliers), 'measurement')}: ", count_value(len(outliers))),
            joined(*(_outlier(outlier) for outlier in outliers[:_MOST_LINES]), by=", "),
            by="",
        )
        if len(outliers) > _MOST_LINES:
            said = joined(said, sentence("and {} more", count_value(len(outliers) - _MOST_LINES)))
        yield joined(said, _effect(result, word), by="")


def _effect(result: Calibration, word: str) -> Sentence:
    if word == "fast":
        return sentence("; left out of the fit; measure again.")
    worst = time_value(result.worst_extra_us or 0.0, "worst_extra_us")
    return sentence("; not in the fit: the slowest execution takes {} more, worst_extra_us.", worst)


def _outlier(outlier: ComparedMeasurement) -> Sentence:
    return sentence(
        "line {} ({} at {}: T_exec {} off what the others say)",
        count_value(outlier.line, "line"),
        ShownValue(outlier.latency_us, "latency_us", "us"),
        ShownValue(outlier.payload_bytes, "payload_bytes", "bytes"),
        time_value(outlier.off_us, "off_us")._replace(signed=True, decimals=1),
    )
