"""Answer of `busplan capacity`."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from busplan.buses import figure
from busplan.buses.figure import BusFigures, Figure
from busplan.english import nouns
from busplan.forms import blocks
from busplan.forms.numbers import period, sentence_text
from busplan.questions.base import sentences
from busplan.questions.capacity import CapacityAnswer
from busplan.questions.capacity.verdict import Change, Verdict, uncertainty_parts
from busplan.questions.fit.certainty import FITS, TIME
from busplan.questions.fit.figures import COUNTS, CapacityFigures, FitFigures


def capacity_report(answer: CapacityAnswer) -> blocks.Report:
    """Report of `capacity`; in CSV, figures of a group have columns with its name."""
    name = answer.profile.name
    results, records = [], []
    for figures in answer.figures:
        result = record = figures.by_key()
        if isinstance(figures, CapacityFigures) and figures.groups:
            result, record = {**result, "groups": list(map(vars, figures.groups))}, {**result, **figures.of_groups}
        results.append(result)
        records.append(record)
    return blocks.Report(
        blocks.Sentence(("Capacity of ", blocks.Code(name))),
        tuple(_blocks(answer)),
        sentences.document(
            "capacity",
            profile=name,
            results=results,
            verdicts=[_verdict(answer, verdict) for verdict in answer.verdicts],
        ),
        sentences.with_profile(name, records),
    )


def _blocks(answer: CapacityAnswer) -> Iterator[blocks.Block]:
    """Verdict of each period, and the figures of all, the timing models side by side."""
    for number, verdict in enumerate(answer.verdicts, start=1):
        yield verdict.card if number == len(answer.verdicts) else verdict.brief_card
    rests_on = [_rests_on_table(answer.verdicts[-1])] if answer.verdicts[-1].rests_on else []
    yield blocks.Detail((*rests_on, _table(answer), *([_groups_table(answer)] if answer.profile.group else [])))


_GROUP_BY_DECIDING: Final[tuple[Figure, ...]] = (figure.SAFE_NODES, figure.SAFE_AXES, figure.SAFE_LIMITED_BY)
"""Figures of a group by the timing model that decides."""
_GROUP_BY_OTHER: Final[tuple[Figure, ...]] = (figure.MAX_NODES, figure.LIMITED_BY)
"""Figures of a group by another timing model."""
_CERTAINTY: Final = (figure.MARGIN_CORRECTED, figure.UNCERTAINTY, figure.BIAS)
_VERDICT: Final = (figure.VERDICT, figure.FITS, *_CERTAINTY, *_GROUP_BY_DECIDING)


def _table(answer: CapacityAnswer) -> blocks.Table:
    """Figures of all periods, the timing models side by side."""
    first = answer.verdicts[0]
    setup, counts = ", ".join(first.setup), first.counted
    caption = blocks.sentence(
        f"{', '.join(f'{{}} {nouns(number, noun)}' for number, noun in counts)}{setup and f'; {setup}'}",
        *(blocks.count_value(number, nouns(2, noun)) for number, noun in counts),
    )
    rows = [row for row in _rows(first.figures.bus_figures) if not (answer.profile.group and row[0].key in COUNTS)]
    if not answer.profile.has_cycle:
        results = [figures.values() for figures in answer.figures]
        rows = [row for row in rows if any(values[row[0].key] is not None for values in results)]
    return sentences.figure_table(
        rows,
        list(_columns(answer)),
        caption=caption,
        state=_state,
    )


def _rows(register: BusFigures) -> list[tuple[Figure, int]]:
    """The verdict's figures, the cycle and its terms, the slice, what the kind of bus adds, and what would fit.

    Terms are of level 1.
    """
    above = (*_VERDICT, figure.SAFE_MIN_PERIOD, figure.AVAILABLE, figure.REQUIRED)
    below = (
        *(figure.MARGIN, figure.UTILISATION, figure.TIME_SLICE, figure.REQUIRED_TIME_SLICE),
        *register.table,
        *(figure.MIN_PERIOD, figure.MIN_SLICE_RATIO, figure.MAX_NODES, figure.MAX_AXES, figure.LIMITED_BY),
    )
    return [*((row, 0) for row in above), *((term, 1) for term in register.terms), *((row, 0) for row in below)]


def _columns(answer: CapacityAnswer) -> Iterator[sentences.FigureColumn]:
    """A column for each period and timing model, the model that decides first."""
    deciding = answer.verdicts[0].figures.timing_model
    for results, verdict in zip(answer.periods, answer.verdicts, strict=True):
        several = len(answer.periods) > 1
        group = period(verdict.period_us) if several and verdict.period_us else ""
        for figures in sorted(results, key=lambda figures: figures.timing_model != deciding):
            rank = 1 if several and len(results) > 1 and figures.timing_model != deciding else 0
            yield sentences.FigureColumn(
                blocks.TableColumn(figures.timing_model, group=group, rank=rank), figures.values()
            )


def _state(row: Figure, values: Mapping[str, Any]) -> blocks.State:
    """State of a figure that, by itself, decides whether the cycle fits."""
    match row:
        case figure.VERDICT:
            return "neutral" if values["verdict"] is None else blocks.state_of(values["verdict"] == FITS)
        case figure.MARGIN_CORRECTED:
            needed_us = values["safe_required_us"]
            is_short = needed_us is not None and needed_us > values["available_us"]
            return "fails" if is_short else "neutral"
        case figure.MARGIN:
            return "fails" if TIME in values["exceeded"] else "neutral"
    return "neutral"


def _rests_on_table(verdict: Verdict) -> blocks.Table:
    """Table of what the verdict takes for granted: what the profile does not give, and a measured wake-up."""
    rows = (blocks.TableRow((part.words, blocks.Code(part.key) if part.key else "none")) for part in verdict.rests_on)
    columns = blocks.TableColumn("premise", kind="words"), blocks.TableColumn("key", kind="words")
    return blocks.Table(columns, tuple(rows), blocks.Sentence(("Premises of the verdict",)))


def _groups_table(answer: CapacityAnswer) -> blocks.Table:
    """Table of the nodes of each group that fit each period, the other groups as they are."""
    columns = [blocks.TableColumn("group", kind="words"), blocks.TableColumn("nodes"), blocks.TableColumn("axes")]
    results = [figures for figures in answer.figures if isinstance(figures, CapacityFigures)]
    shown = [(figures, _GROUP_BY_OTHER if figures.verdict is None else _GROUP_BY_DECIDING) for figures in results]
    for figures, chosen in shown:
        at = f"{period(figures.period_us)}, " if len(answer.periods) > 1 else ""
        columns += (
            blocks.TableColumn(
                column.label, kind="words" if column.sort == "word" else "figures", group=f"{at}{figures.timing_model}"
            )
            for column in chosen
        )
    rows = []
    for place, group in enumerate(results[0].groups):
        head = (
            blocks.Code(group.name),
            blocks.count_value(group.nodes, "nodes"),
            blocks.count_value(group.axes, "axes"),
        )
        cells = (
            blocks.attribute_value(column, figures.groups[place]) for figures, chosen in shown for column in chosen
        )
        rows.append(blocks.TableRow((*head, *cells)))
    return blocks.Table(
        tuple(columns), tuple(rows), blocks.Sentence(("Nodes of each group, with the other groups unchanged",))
    )


def _chosen(figures: FitFigures, *keys: str) -> blocks.Record:
    """Some figures by key; None for one that messages alone do not have."""
    values = figures.by_key()
    return {key: values[key] for key in keys}


def _change_record(change: Change) -> blocks.Record:
    return {
        "changes": change.changes,
        "nodes": change.nodes,
        **_chosen(change.figures, "fits", "margin_us", "verdict", "margin_corrected_us", "uncertainty_us"),
    }


def _verdict(answer: CapacityAnswer, verdict: Verdict) -> blocks.Record:
    change, figures, summary = verdict.change, verdict.figures, verdict.card.whole
    lines = [(label, sentence_text(line)) for label, line in summary.lines]
    text = "; ".join(f"{label}: {line}" for label, line in lines)
    return {
        "period_us": verdict.period_us,
        **_chosen(figures, "timing_model", "verdict", "fits"),
        "missed_limits": [*dict.fromkeys(missed.key for missed in verdict.missed_limits)],
        "models_agree": verdict.models_agree,
        "verdict_after_reset": None if verdict.after_reset is None else verdict.after_reset.verdict,
        **sentences.safety_record(figures),
        **_chosen(figures, "available_us", "required_us", "margin_us"),
        **_chosen(figures, *(row.key for row in figure.CERTAINTY if row is not figure.VERDICT)),
        "waits": {f"{wait}_us": us for wait, us in verdict.cycle.waits_us.items()} if verdict.cycle else {},
        "uncertainty_parts": uncertainty_parts(verdict.cycle) if verdict.cycle else [],
        "reserve": answer.profile.limits.reserve,
        "rests_on": [{"key": part.key or None, "words": part.words} for part in verdict.rests_on],
        "not_applicable": {model: list(keys) for model, keys in verdict.not_applicable.items()},
        "cheapest_change": change and _change_record(change),
        "fastest_period_us": verdict.fastest and verdict.fastest.us,
        "faster_with": verdict.best_register
        and {"changes": verdict.best_register.changes, "period_us": verdict.best_register.period_us},
        "warnings": list(verdict.warnings),
        "text": f"{sentence_text(summary.subject)}: {summary.verdict.text}. {text}.",
        "lines": [{"label": label, "text": line} for label, line in lines],
    }
