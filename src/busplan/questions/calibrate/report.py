"""Answer of `busplan calibrate`."""

from collections.abc import Iterator
from typing import Final

from busplan.english import nouns
from busplan.forms import blocks
from busplan.forms.numbers import sentence_text
from busplan.profile.edit import value_text
from busplan.questions.base.sentences import document, fields, with_profile
from busplan.questions.calibrate import REPETITIONS_TO_COMPARE, CalibrateAnswer, Outlier
from busplan.sections.base import TRANSACTION_KINDS

_COLUMNS: Final = {
    "payload_bytes": blocks.TableColumn("payload", "bytes"),
    "measurements": blocks.TableColumn("n"),
    "left_out": blocks.TableColumn("left out"),
    "latency_us": blocks.TableColumn("T_lant", "us", rank=3),
    "packets_us": blocks.TableColumn("packets", "us", rank=2),
    "execution_us": blocks.TableColumn("T_exec", "us"),
    "deviation_us": blocks.TableColumn("std dev", "us", rank=1),
}
_DECIMALS: Final = 3
_MOST_LINES: Final = 10
_LONG_EXECUTION_US: Final = 10_000.0
"""Time longer than any motion node's execution [us]; latencies that show it are probably in ns."""


def time_value(value_us: float, key: str) -> blocks.ShownValue:
    """A time of a calibration."""
    return blocks.ShownValue(value_us, key, "us", _DECIMALS)


def calibration_report(answer: CalibrateAnswer, *, applied_to: str | None) -> blocks.Report:
    """Report of `calibrate`; `applied_to` is the profile into which the execution time was written, or None."""
    name = answer.profile.name
    payloads = [fit._asdict() for fit in answer.payloads]
    warned = [*_warnings(answer)]
    return blocks.Report(
        blocks.Sentence(("Execution time of ", blocks.Code(name), " from ", blocks.Code(answer.source))),
        tuple(_blocks(answer, warned)),
        document(
            "calibrate",
            profile=name,
            **fields(answer, "source", "timing_model"),
            nodes=sum(group.nodes for group in answer.profile.node_groups),
            **answer.headings,
            measurements=answer.measurements,
            execution=answer.section,
            **fields(answer, "uncertainty_us", "at_most_us"),
            outliers=[outlier._asdict() for outlier in answer.outliers],
            **fields(answer, "worst_extra_us", "unchecked_bytes"),
            payloads=payloads,
            warnings=[sentence_text(warning) for warning in warned],
            applied_to=applied_to,
        ),
        with_profile(name, payloads),
    )


def _blocks(answer: CalibrateAnswer, warned: list[blocks.Sentence]) -> Iterator[blocks.Block]:
    """The fit in sentences, the figures by payload, and the section for the profile."""
    yield fit_sentence(answer)
    where = ", ".join(answer.setup)
    yield blocks.sentence(f"T_exec = T_lant - packets, eq (3): by the {answer.timing_model} timing model for {where}.")
    if answer.unchecked_bytes:
        sizes = ", ".join(map(str, answer.unchecked_bytes))
        words = f"that needs {REPETITIONS_TO_COMPARE} measurements of a payload"
        yield blocks.sentence(f"Outliers cannot be found at {sizes} bytes: {words}.")
    yield from (blocks.joined(blocks.sentence("Warning: ", state="warns"), warning, by="") for warning in warned)
    absent = {"left_out"} if not answer.outliers else set()
    if all(fit.deviation_us is None for fit in answer.payloads):
        absent.add("deviation_us")
    shown = {key: column for key, column in _COLUMNS.items() if key not in absent}
    rows = (blocks.TableRow(tuple(_cell(getattr(fit, key), key) for key in shown)) for fit in answer.payloads)
    yield blocks.Table(tuple(shown.values()), tuple(rows))
    keys = (f"{key} = {value_text(value)}" for key, value in answer.section.items())
    header = f"[group.execution]  # of {answer.nodes.name}" if answer.nodes.name else f"[{answer.key}]"
    yield blocks.Snippet((header, *keys))


def _cell(value: float | None, key: str) -> blocks.Cell:
    """A cell with a count, or with a time to three decimals, since further ones are rounding."""
    if value is None:
        return ""
    return time_value(value, key)._replace(fixed=True) if key.endswith("_us") else blocks.count_value(value, key)


def fit_sentence(answer: CalibrateAnswer) -> blocks.Sentence:
    """Sentence on the measurements whose median is the execution time."""
    number, sizes = answer.measurements, len(answer.payloads)
    without = ", without the outliers" if answer.outliers else ""
    return blocks.sentence(
        f"{{}}: T_exec is the median at each payload, of {{}} {nouns(number, 'measurement')} at {{}} "
        f"{nouns(sizes, 'payload')}{without}, {{}}.",
        blocks.Code(answer.profile.name),
        blocks.count_value(number, "measurements"),
        blocks.count_value(sizes),
        blocks.Code(answer.source),
    )


def _warnings(answer: CalibrateAnswer) -> Iterator[blocks.Sentence]:
    """Sentences on what to check before these figures are used."""
    for word, outliers in (
        ("slow", [outlier for outlier in answer.outliers if outlier.off_us > 0]),
        ("fast", [outlier for outlier in answer.outliers if outlier.off_us <= 0]),
    ):
        if outliers:
            yield _outliers(outliers, word, answer.worst_extra_us or 0.0)
    execution = answer.execution
    sizes = dict.fromkeys(int(answer.nodes.bytes_of(kind)) for kind in TRANSACTION_KINDS)
    for size in sizes:
        if not execution.covers(size):
            yield blocks.sentence(
                f"the profile's payload of {{}} is outside the measured range, {execution.range_bytes}: measure it.",
                blocks.ShownValue(size, "payload_bytes", "bytes"),
            )
    short = [fit for fit in answer.payloads if fit.execution_us <= answer.at_most_us]
    if short:
        yield blocks.sentence(
            "the bus waits {} before any response, so shorter executions do not show in a latency: T_exec may be "
            f"less at {', '.join(str(fit.payload_bytes) for fit in short)} bytes.",
            time_value(answer.at_most_us, "at_most_us"),
        )
    longest_us = max(fit.execution_us for fit in answer.payloads)
    if longest_us > _LONG_EXECUTION_US:
        yield blocks.sentence(
            "an execution time of {} is long for a motion node: is latency_us in us?",
            blocks.ShownValue(longest_us, "execution_us", "us", 0),
        )


def _outliers(outliers: list[Outlier], word: str, worst_us: float) -> blocks.Sentence:
    """Sentence on the slow executions, or on the measurements that others contradict, by their lines."""
    count, more = len(outliers), len(outliers) - _MOST_LINES
    lines = blocks.joined(*(_outlier(outlier) for outlier in outliers[:_MOST_LINES]), by=", ")
    parts = [
        blocks.sentence(f"{{}} {word} {nouns(count, 'measurement')}: ", blocks.count_value(count)),
        lines,
        *([blocks.sentence(" and {} more", blocks.count_value(more))] if more > 0 else []),
    ]
    if word == "fast":
        parts.append(blocks.sentence("; left out: measure again."))
    else:
        worst = time_value(worst_us, "worst_extra_us")
        parts.append(blocks.sentence("; left out. The slowest execution takes {} longer, worst_extra_us.", worst))
    return blocks.joined(*parts, by="")


def _outlier(outlier: Outlier) -> blocks.Sentence:
    return blocks.sentence(
        "line {} ({} at {}: T_exec {} off the median)",
        blocks.count_value(outlier.line, "line"),
        blocks.ShownValue(outlier.latency_us, "latency_us", "us"),
        blocks.ShownValue(outlier.payload_bytes, "payload_bytes", "bytes"),
        time_value(outlier.off_us, "off_us")._replace(signed=True, decimals=1),
    )
