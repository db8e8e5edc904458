"""Answer of `busplan capacity`."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from busplan.buses import figure
from busplan.buses.bus import Bus
from busplan.buses.figure import Figure
from busplan.english import nouns
from busplan.forms.blocks import (
    Block,
    Cell,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    State,
    Table,
    TableColumn,
    TableRow,
    attribute_value,
    count_value,
    sentence,
    state_of,
)
from busplan.forms.numbers import period, sentence_text
from busplan.questions.base.sentences import Owner, document, fields, figure_table, safety_record, with_profile
from busplan.questions.capacity import CapacityAnswer
from busplan.questions.capacity.lines import Verdict, card, card_text, uncertainty_parts
from busplan.questions.fit.certainty import FITS, TIME
from busplan.questions.fit.figures import COUNTS, CapacityFigures
from busplan.questions.fit.network import leading_model


def capacity_report(answer: CapacityAnswer) -> Report:
    """Report of `capacity`."""
    return Report(
        Sentence(("Capacity of ", Code(answer.profile.name))),
        tuple(_blocks(answer)),
        capacity_document(answer),
        with_profile(answer.profile.name, capacity_records(answer)),
        is_card_enough=True,
    )


def _blocks(answer: CapacityAnswer) -> Iterator[Block]:
    """Verdict of each period, and the figures of all, the timing models side by side."""
    for number, verdict in enumerate(answer.verdicts, start=1):
        yield card(verdict, is_brief=number < len(answer.verdicts))
    yield capacity_table(answer)
    if answer.profile.group:
        yield groups_table(answer)


def capacity_table(answer: CapacityAnswer) -> Table:
    """Figures of all periods, the timing models side by side; figures that do not decide are details.

    Parameters
    ----------
    answer
        The answer.
    """
    network = answer.verdicts[0].network
    profile, bus = network.profile, network.bus
    setup = ", ".join(bus.setup_words(network))
    counts = bus.counted(network)
    caption = sentence(
        f"{', '.join(f'{{}} {nouns(number, noun)}' for number, noun in counts)}{setup and f'; {setup}'}",
        *(count_value(number, nouns(2, noun)) for number, noun in counts),
    )
    owners = list(_owners(answer))
    rows, shown = [row for row in _rows(bus) if not (profile.group and row[0].key in COUNTS)], _DECIDES
    if not profile.has_cycle:
        results = [figures.values() for figures in answer.results]
        rows = [row for row in rows if any(values[row[0].key] is not None for values in results)]
        shown |= {figure.key for figure in bus.figures.table}
    shown |= {term.key for figures in answer.results for term in figures.terms if term.us}
    return figure_table(
        rows,
        owners,
        caption=caption,
        hides_equations=True,
        is_detail=lambda figure: figure.key not in shown,
        state=_state,
    )


def _owners(answer: CapacityAnswer) -> Iterator[Owner]:
    """A column for each period and timing model, the profile's own model first."""
    network = answer.verdicts[0].network
    leading, deciding = leading_model(network), network.bus.deciding_model
    for results in answer.periods:
        several = len(answer.periods) > 1
        group = period(results[0].period_us) if several else ""
        for figures in sorted(results, key=lambda figures: figures.timing_model != leading):
            rank = 1 if several and len(results) > 1 and figures.timing_model != deciding else 0
            yield Owner(TableColumn(figures.timing_model, group=group, rank=rank), figures.values())


def _state(key: Figure, values: Mapping[str, Any]) -> State:
    """State of a figure that, by itself, decides whether the cycle fits."""
    match key:
        case figure.VERDICT:
            return "neutral" if values["verdict"] is None else state_of(values["verdict"] == FITS)
        case figure.MARGIN_CORRECTED:
            needed_us = values["safe_required_us"]
            is_short = needed_us is not None and needed_us > values["available_us"]
            return "fails" if is_short else "neutral"
        case figure.MARGIN:
            return "fails" if TIME in values["exceeded"] else "neutral"
    return "neutral"


def groups_table(answer: CapacityAnswer) -> Table:
    """How many nodes of each group fit each period, the other groups as they are.

    Parameters
    ----------
    answer
        The answer.
    """
    columns = [TableColumn("group", kind="words"), TableColumn("nodes"), TableColumn("axes")]
    shown: list[tuple[int, tuple[Figure, ...]]] = []
    for number, figures in enumerate(answer.results):
        keys = _GROUP_CLOSED if figures.verdict is None else _GROUP_SAFE
        shown.append((number, keys))
        models = (
            f"{period(figures.period_us)}, {figures.timing_model}" if len(answer.periods) > 1 else figures.timing_model
        )
        columns += (
            TableColumn(key.label, kind="words" if key.sort == "word" else "figures", group=models) for key in keys
        )
    rows = []
    for place, group in enumerate(answer.results[0].groups):
        cells: list[Cell] = [Code(group.name), count_value(group.nodes, "nodes"), count_value(group.axes, "axes")]
        for number, keys in shown:
            cells += (attribute_value(key, answer.results[number].groups[place]) for key in keys)
        rows.append(TableRow(tuple(cells)))
    return Table(tuple(columns), tuple(rows), Sentence(("Nodes of each group, the others as they are",)))


_GROUP_SAFE: Final[tuple[Figure, ...]] = (figure.SAFE_NODES, figure.SAFE_AXES, figure.SAFE_LIMITED_BY)
"""Under the timing model that decides."""
_GROUP_CLOSED: Final[tuple[Figure, ...]] = (figure.MAX_NODES, figure.LIMITED_BY)
"""Under another timing model."""


_DECIDES: Final = frozenset(
    row.key
    for row in (
        *(figure.VERDICT, figure.FITS, figure.MARGIN_CORRECTED, figure.UNCERTAINTY, figure.BIAS),
        *(figure.SAFE_NODES, figure.SAFE_AXES, figure.SAFE_LIMITED_BY),
        *(figure.AVAILABLE, figure.REQUIRED, figure.MARGIN),
    )
)
"""Figures that are no detail; beside them the terms that take time."""


def _rows(bus: Bus) -> list[tuple[Figure, int]]:
    """The verdict's figures, the cycle and its terms, the slice, what the kind of bus adds, and what would fit.

    Terms are of level 1.
    """
    above = (
        *(figure.VERDICT, figure.FITS, figure.MARGIN_CORRECTED, figure.UNCERTAINTY, figure.BIAS),
        *(figure.SAFE_NODES, figure.SAFE_AXES, figure.SAFE_LIMITED_BY, figure.SAFE_MIN_PERIOD),
        *(figure.AVAILABLE, figure.REQUIRED),
    )
    below = (
        *(figure.MARGIN, figure.UTILISATION, figure.TIME_SLICE, figure.REQUIRED_TIME_SLICE),
        *bus.figures.table,
        *(figure.MIN_PERIOD, figure.MIN_SLICE_RATIO, figure.MAX_NODES, figure.MAX_AXES, figure.LIMITED_BY),
    )
    return [
        *((row, 0) for row in above),
        *((term, 1) for term in bus.figures.terms),
        *((row, 0) for row in below),
    ]


def capacity_records(answer: CapacityAnswer) -> list[Record]:
    """One row for each period and timing model; figures of a group are in columns of its name."""
    return [
        {
            **figures.by_key(),
            **{f"group.{group.name}.{key}": getattr(group, key) for group in figures.groups for key in COUNTS},
        }
        for figures in answer.results
    ]


def capacity_document(answer: CapacityAnswer) -> JsonDocument:
    """Document of `busplan capacity --format json`."""
    results = [
        {**figures.by_key(), **({"groups": list(map(vars, figures.groups))} if figures.groups else {})}
        for figures in answer.results
    ]
    return document(
        "capacity",
        profile=answer.profile.name,
        results=results,
        verdicts=list(map(_verdict, answer.verdicts)),
    )


def _verdict(verdict: Verdict) -> JsonDocument:
    change, figures, bus = verdict.change, verdict.deciding, verdict.network.bus
    unable = {model.name: bus.cannot_express(verdict.network, model=model.name) for model in bus.timing_models}
    words = card(verdict)
    return {
        "period_us": verdict.period_us,
        **fields(figures, "timing_model", "verdict", "fits"),
        "missed_limits": [key for key, _ in verdict.missed_limits],
        "models_agree": verdict.models_agree,
        "verdict_after_reset": None if verdict.after_reset is None else verdict.after_reset.verdict,
        **safety_record(figures, verdict.network),
        **fields(figures, "available_us", "required_us", "margin_us"),
        **certainty_record(figures),
        "uncertainty_parts": uncertainty_parts(figures),
        "reserve": verdict.network.profile.limits.reserve,
        "not_in_it": [part.key for part in verdict.left_out],
        "not_applicable": {model: list(keys) for model, keys in unable.items() if keys},
        "cheapest_change": change
        and {
            "changes": change.changes,
            "nodes": change.nodes,
            **fields(change.figures, "fits", "margin_us", "verdict", "margin_corrected_us", "uncertainty_us"),
        },
        "fastest_period_us": verdict.fastest and verdict.fastest.us,
        "warnings": list(verdict.warnings),
        "text": card_text(words),
        "lines": [{"label": label, "text": sentence_text(line)} for label, line in words.lines],
    }


def certainty_record(figures: CapacityFigures) -> Record:
    """Figures of how sure the verdict is, without its word."""
    return fields(figures, *(key.key for key in figure.CERTAINTY if key is not figure.VERDICT))
