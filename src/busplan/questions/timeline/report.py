"""Answer of `busplan timeline`."""

from collections.abc import Iterator
from functools import partial
from typing import Final

from busplan.buses.figure import MARGIN, REQUIRED, VERDICT
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
from busplan.forms.columns import sentence_text
from busplan.forms.numbers import period_value
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.network import bus_of
from busplan.questions.timeline.characters import timeline_lines
from busplan.questions.timeline.events import EVENTS, SHARE, TOTAL, Schedule, Total, totals
from busplan.questions.timeline.kinds import kind_of
from busplan.questions.timeline.lanes import charged, drawn_window, overruns
from busplan.questions.timeline.period import model_bars
from busplan.questions.timeline.svg import STYLE, is_coarse, timeline_svg
from busplan.questions.words.documents import document
from busplan.questions.words.own_picture import OwnPicture
from busplan.questions.words.sentences import refused_circle, safety_record, story, warnings

_TOTAL_FIGURES: Final = (EVENTS, TOTAL, SHARE)


def timeline_report(plan: Schedule) -> Report:
    """Report of `timeline`."""
    return Report(
        Sentence(("Timeline of ", Code(plan.profile.name))),
        lambda: tuple(_blocks(plan)),
        partial(timeline_document, plan),
        partial(timeline_records, plan),
    )


def _blocks(plan: Schedule) -> Iterator[Block]:
    """Whether the cycle fits, the cycle to scale, and the total of each kind of event."""
    yield from refused_circle(plan.profile)
    yield headline(plan)
    yield from (Sentence((words,), "warns") for words in _warnings(plan))
    yield margins_sentence(plan)
    yield timeline_chart(plan)
    yield totals_table(plan)


def headline(plan: Schedule) -> Sentence:
    """Say what the cycle leaves of its slice under its timing model, and the verdict if this model decides."""
    figures = plan.figures
    parts: tuple[Part, ...] = (
        *(Code(plan.profile.name), " at ", period_value(figures.period_us), ": "),
        *story(figures, plan.profile),
        f" by the {figures.timing_model} model",
    )
    if figures.verdict is None:
        return Sentence((*parts, ", which decides nothing."), state_of(figures.fits and figures.safe))
    state = state_of(figures.verdict == FITS and figures.safe)
    verdict = figure_value(VERDICT, figures.verdict)._replace(state=state)
    return Sentence((*parts, "; verdict: ", verdict, "."), state)


def timeline_chart(plan: Schedule) -> Chart:
    """The cycle to scale.

    Parameters
    ----------
    plan
        The schedule, narrowed to its window.
    """
    window = drawn_window(plan)
    caption = joined(_most(window), charged(window), by="; ")
    legend = Sentence(("A bar is a whole transaction.",)) if is_coarse(window) else None
    svg = partial(timeline_svg, plan, title=sentence_text(headline(plan)), inline=True)
    picture = OwnPicture(svg, partial(timeline_lines, plan), stylesheet=STYLE)
    return Chart(picture, caption, legend)


def _most(window: Schedule) -> Sentence:
    """Say what takes most of the window."""
    model = f"by the {window.figures.timing_model} model"
    busy = [one for one in totals(window) if one.kind != IDLE.key]
    if not busy:
        return Sentence((f"Nothing but idle time {model}",))
    most = max(busy, key=lambda one: one.total_us)
    label = kind_of(window.profile, most.kind).label
    taken = ShownValue(most.total_us, TOTAL.key, "us", TOTAL.decimals)
    return sentence(f"Mostly {label}, {{}} {model}", taken)


def margins_sentence(plan: Schedule) -> Sentence:
    """Say what each timing model leaves of the slice."""
    margins = (
        sentence(f"{{}} by the {one.timing_model} model", figure_value(MARGIN, one.figures.margin_us))
        for one in model_bars(plan)
    )
    return joined(Sentence(("Margin of the slice: ",)), joined(*margins, by=", "), Sentence((".",)), by="")


def totals_table(plan: Schedule) -> Table:
    """Total time of each kind of event in the window.

    Parameters
    ----------
    plan
        The schedule, narrowed to its window.
    """
    whole = "the cycle" if overruns(plan) else "the slice"
    part = whole if plan.is_whole else "the window"
    return Table(
        (
            *(TableColumn("kind", kind="words"), TableColumn("eq", kind="words", rank=1)),
            *(TableColumn(figure.label, figure.column or figure.unit) for figure in _TOTAL_FIGURES),
        ),
        tuple(_total_row(plan, one) for one in totals(plan)),
        sentence(f"What takes {part}, {{}}", ShownValue(plan.to_us - plan.from_us, "duration_us", "us", 3)),
    )


def _total_row(plan: Schedule, one: Total) -> TableRow:
    kind = kind_of(plan.profile, one.kind)
    values = (attribute_value(figure, one) for figure in _TOTAL_FIGURES)
    return TableRow((Swatch(kind.ink, kind.mark, kind.label), kind.reference, *values))


def _warnings(plan: Schedule) -> list[str]:
    return warnings(plan.profile, nodes=plan.figures.nodes, most=0)


def _facts(plan: Schedule) -> JsonDocument:
    """The document without events: figures of the whole cycle, and the window."""
    figures = plan.figures
    return document(
        "timeline",
        profile=plan.profile.name,
        timing_model=figures.timing_model,
        period_us=figures.period_us,
        nodes=figures.nodes,
        **{key: getattr(figures, key) for key in bus_of(plan.profile).figures.headings},
        required_us=figures.required_us,
        available_us=figures.available_us,
        margin_us=figures.margin_us,
        exceeded=list(figures.exceeded),
        not_shown=None if figures.not_shown is None else list(figures.not_shown),
        fits=figures.fits,
        circle_refused_by=list(figures.circle_refused_by),
        verdict=figures.verdict,
        **safety_record(figures, plan.profile),
        warnings=_warnings(plan),
        from_us=plan.from_us,
        to_us=plan.to_us,
    )


def timeline_document(plan: Schedule) -> JsonDocument:
    """Document of `busplan timeline --format json`: the cycle's figures, and events and totals of the window."""
    margins = [
        {"timing_model": one.timing_model, REQUIRED.key: one.figures.required_us, MARGIN.key: one.figures.margin_us}
        for one in model_bars(plan)
    ]
    totals_ = [one._asdict() for one in totals(plan)]
    return {**_facts(plan), "margins": margins, "events": _event_records(plan), "totals": totals_}


def timeline_records(plan: Schedule) -> list[Record]:
    """One row for each event, with profile and timing model in front."""
    head = {"profile": plan.profile.name, "timing_model": plan.figures.timing_model}
    return [{**head, **record} for record in _event_records(plan)]


def _event_records(plan: Schedule) -> list[Record]:
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
            "equation": kind_of(plan.profile, event.kind).reference,
        }
        for event in plan.events
    ]
