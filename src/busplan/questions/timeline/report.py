"""Answer of `busplan timeline`."""

from collections.abc import Iterator
from typing import Final

from busplan.buses.figure import MARGIN, VERDICT
from busplan.buses.parts import IDLE
from busplan.forms.blocks import (
    Block,
    Chart,
    Code,
    JsonDocument,
    Part,
    Record,
    Report,
    Sentence,
    ShownValue,
    Swatch,
    Table,
    TableColumn,
    TableRow,
    attribute_value,
    figure_value,
    joined,
    sentence,
    state_of,
)
from busplan.forms.numbers import period_value, sentence_text
from busplan.questions.fit.certainty import FITS
from busplan.questions.timeline.cycles import CommonMultiple
from busplan.questions.timeline.drawing import (
    charged,
    drawn_window,
    is_coarse,
    kind_of,
    model_needs,
    overruns,
    timeline_drawing,
)
from busplan.questions.timeline.events import EVENTS, SHARE, TOTAL, Schedule, Total, totals
from busplan.questions.words.documents import document
from busplan.questions.words.sentences import safety_record, story, warning_sentences

_TOTAL_FIGURES: Final = (EVENTS, TOTAL, SHARE)


def timeline_report(schedule: Schedule) -> Report:
    """Report of `timeline`."""
    return Report(
        Sentence(("Timeline of ", Code(schedule.profile.name))),
        tuple(_blocks(schedule)),
        timeline_document(schedule),
        timeline_records(schedule),
    )


def _blocks(schedule: Schedule) -> Iterator[Block]:
    """Whether the cycle fits, the cycle to scale, and the total of each kind of event."""
    yield headline(schedule)
    yield from warning_sentences(schedule.network)
    yield margins_sentence(schedule)
    yield from (Sentence((words,)) for words in CommonMultiple(schedule).sentences())
    yield timeline_chart(schedule)
    yield totals_table(schedule)


def headline(schedule: Schedule) -> Sentence:
    """Say what the fullest cycle leaves of its slice by its timing model, and the verdict if this model decides."""
    figures = schedule.figures
    parts: tuple[Part, ...] = (
        *(Code(schedule.profile.name), " at ", period_value(figures.period_us), ": "),
        *story(figures, schedule.network),
        f" by the {figures.timing_model} model",
        *((" in the fullest cycle",) if schedule.number is not None and CommonMultiple(schedule).cycles > 1 else ()),
    )
    if figures.verdict is None:
        return Sentence((*parts, ", which does not affect the verdict."), state_of(figures.fits and figures.safe))
    state = state_of(figures.verdict == FITS and figures.safe)
    verdict = figure_value(VERDICT, figures.verdict)._replace(state=state)
    return Sentence((*parts, "; verdict: ", verdict, "."), state)


def timeline_chart(schedule: Schedule) -> Chart:
    """The cycle to scale.

    Parameters
    ----------
    schedule
        The cycle, narrowed to its window.
    """
    window = drawn_window(schedule)
    caption = joined(_most(window), charged(window), by="; ")
    legend = Sentence(("A bar is a whole transaction.",)) if is_coarse(window) else None
    return Chart(timeline_drawing(schedule, title=sentence_text(headline(schedule))), caption, legend)


def _most(window: Schedule) -> Sentence:
    """Say what takes most of the window."""
    model = f"by the {window.figures.timing_model} model"
    busy = [total for total in totals(window) if total.kind != IDLE.key]
    if not busy:
        return Sentence((f"Nothing but idle time {model}",))
    most = max(busy, key=lambda total: total.total_us)
    label = kind_of(window.profile, most.kind).label
    taken = ShownValue(most.total_us, TOTAL.key, "us", TOTAL.decimals)
    return sentence(f"Mostly {label}, {{}} {model}", taken)


def margins_sentence(schedule: Schedule) -> Sentence:
    """Say what each timing model leaves of the slice."""
    margins = (
        sentence(f"{{}} by the {model.timing_model} model", figure_value(MARGIN, model.margin_us))
        for model in model_needs(schedule)
    )
    return joined(Sentence(("Margin of the slice: ",)), joined(*margins, by=", "), Sentence((".",)), by="")


def totals_table(schedule: Schedule) -> Table:
    """Total time of each kind of event in the window.

    Parameters
    ----------
    schedule
        The cycle, narrowed to its window.
    """
    whole = "the cycle" if overruns(schedule) else "the slice"
    part = whole if schedule.is_whole else "the window"
    return Table(
        (
            *(TableColumn("kind", kind="words"), TableColumn("eq", kind="words", rank=1)),
            *(TableColumn(figure.label, figure.column or figure.unit) for figure in _TOTAL_FIGURES),
        ),
        tuple(_total_row(schedule, total) for total in totals(schedule)),
        sentence(f"What takes {part}, {{}}", ShownValue(schedule.to_us - schedule.from_us, "duration_us", "us", 3)),
    )


def _total_row(schedule: Schedule, total: Total) -> TableRow:
    kind = kind_of(schedule.profile, total.kind)
    values = (attribute_value(figure, total) for figure in _TOTAL_FIGURES)
    return TableRow((Swatch(kind.ink, kind.mark, kind.label), kind.reference, *values))


def _facts(schedule: Schedule) -> JsonDocument:
    """The document without events: the cycle that is drawn, the verdict, the cycles that differ, and the window."""
    figures, common = schedule.figures, CommonMultiple(schedule)
    values = figures.values()
    return document(
        "timeline",
        profile=schedule.profile.name,
        timing_model=figures.timing_model,
        period_us=figures.period_us,
        nodes=figures.nodes,
        **{key: values[key] for key in schedule.network.bus.figures.headings},
        cycle=common.number,
        common_multiple=common.cycles,
        distinct_cycles=None if common.distinct is None else [alike._asdict() for alike in common.distinct],
        required_us=schedule.required_us,
        available_us=figures.available_us,
        margin_us=schedule.margin_us,
        exceeded=list(figures.exceeded),
        not_shown=None if figures.not_shown is None else list(figures.not_shown),
        fits=figures.fits,
        verdict=figures.verdict,
        **safety_record(figures, schedule.network),
        warnings=schedule.network.bus.warnings(schedule.network, nodes=[figures.nodes]),
        from_us=schedule.from_us,
        to_us=schedule.to_us,
    )


def timeline_document(schedule: Schedule) -> JsonDocument:
    """Document of `busplan timeline --format json`: the cycle's figures, and events and totals of the window."""
    margins = [model._asdict() for model in model_needs(schedule)]
    totals_ = [total._asdict() for total in totals(schedule)]
    return {**_facts(schedule), "margins": margins, "events": _event_records(schedule), "totals": totals_}


def timeline_records(schedule: Schedule) -> list[Record]:
    """One row for each event, with profile and timing model in front."""
    head = {"profile": schedule.profile.name, "timing_model": schedule.figures.timing_model}
    return [{**head, **record} for record in _event_records(schedule)]


def _event_records(schedule: Schedule) -> list[Record]:
    """One row for each event of the window."""
    return [
        {
            "kind": event.kind,
            "node": event.node,
            "transaction": event.transaction,
            "packet": event.packet,
            "start_us": event.start_us,
            "end_us": event.end_us,
            "duration_us": event.duration_us,
            "equation": kind_of(schedule.profile, event.kind).reference,
        }
        for event in schedule.events
    ]
