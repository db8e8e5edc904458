"""Answer of `busplan timeline`."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from busplan.buses.figure import MARGIN, REQUIRED, VERDICT
from busplan.buses.limits import IDLE, EventKind
from busplan.elementwise import plain
from busplan.english import nouns
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
    count_value,
    figure_value,
    joined,
    sentence,
    state_of,
)
from busplan.forms.charts import Drawing, Entry, Guide, Lane, Lanes, Panel, Span, numbers
from busplan.forms.numbers import figure_text, period_value, sentence_text, with_unit
from busplan.questions.base.sentences import document, safety_record, story, warning_sentences
from busplan.questions.fit.certainty import FITS, fits_in
from busplan.questions.fit.figures import margin_us
from busplan.questions.fit.network import bus_of, model_names
from busplan.questions.timeline.events import (
    EVENTS,
    SHARE,
    TOTAL,
    CommonMultiple,
    Event,
    Schedule,
    Total,
    drawn_cycle,
    totals,
)
from busplan.sections.profile import Profile

_MOST_EVENT_LANES: Final = 20
"""Up to this many events have a lane each; more are drawn in a lane for each node. A cycle of one node has 20."""
_MOST_BARS: Final = 400
"""Most bars in the lanes of nodes; of more events, a bar is a transaction."""
_NEEDED: Final = Entry("long-gap", "needed", "#")
_LEFT: Final = Entry("fits", "margin", ".")
_BEYOND: Final = Entry("late", "beyond the slice", "!")
_REST: Final = Entry("track", "rest of the period", "-")
_WINDOW: Final = Entry("window", "shown below", "^")
_END: Final = "end of the slice"


class ModelNeeds(NamedTuple):
    """Time of the slice that a timing model needs for the cycle that is drawn."""

    timing_model: str
    required_us: float
    margin_us: float


def model_needs(schedule: Schedule) -> tuple[ModelNeeds, ...]:
    """Time of the slice that each timing model needs which can express the profile.

    Parameters
    ----------
    schedule
        The cycle, under one of them.
    """
    available_us, needs = schedule.figures.available_us, []
    for model in model_names(schedule.network):
        required_us = drawn_cycle(schedule.network, model=model, number=schedule.number).required_us
        left_us = plain(margin_us(required_us, available_us=available_us))
        needs.append(ModelNeeds(model, plain(required_us), left_us))
    return tuple(needs)


def timeline_drawing(schedule: Schedule, *, title: str) -> Drawing:
    """Draw the whole period, and the window below it.

    Parameters
    ----------
    schedule
        The cycle, narrowed to its window.
    title
        Its message in a sentence.
    """
    window = drawn_window(schedule)
    words = sentence_text(charged(window))
    return Drawing(title, (_period(schedule), _lanes(window)), (words,), words, has_characters=True)


def drawn_window(schedule: Schedule) -> Schedule:
    """The part that the lanes show: the window or, without one, the cycle without its idle rest."""
    return schedule._replace(to_us=schedule.used_us) if schedule.is_whole else schedule


def is_coarse(window: Schedule) -> bool:
    """Whether a bar is a whole transaction instead of an event."""
    return len(window.events) > _MOST_BARS


def kind_of(profile: Profile, key: str) -> EventKind:
    """Name and style of an event, or of a stretch of events, on the profile's kind of bus."""
    return bus_of(profile).event_kind(key)


def charged(schedule: Schedule) -> Sentence:
    """Say what is shown, and which distance on the wire each node is charged with."""
    nodes, common, cycle = schedule.figures.nodes, CommonMultiple(schedule), "the cycle"
    if schedule.number is not None and common.cycles > 1:
        cycle = f"cycle {common.number} of {common.cycles}"
    setup = ", ".join((nouns(nodes, "node"), *schedule.network.bus.setup_words(schedule.network)))
    path = schedule.network.bus.path_words(schedule.network)
    return sentence(
        f"{{}} {setup}; {{}} to {{}} of {cycle}{path and f', {path}'}",
        count_value(nodes, "nodes"),
        ShownValue(schedule.from_us, "from_us", "", TOTAL.decimals),
        ShownValue(schedule.to_us, "to_us", "us", TOTAL.decimals),
    )


def overruns(schedule: Schedule) -> bool:
    """Whether the cycle takes more than its slice."""
    return not fits_in(schedule.required_us, available_us=schedule.figures.available_us)


def _period(schedule: Schedule) -> Panel:
    """The whole period, transaction by transaction, and what each timing model needs and leaves of its slice."""
    figures, needs = schedule.figures, model_needs(schedule)
    slice_us, period_us, end_us = figures.available_us, figures.period_us, schedule.end_us
    lanes = [Lane("cycle", (*_stretches(schedule, schedule.cycle_events), *_part(_REST, end_us, period_us)))]
    for model in needs:
        used_us = max(model.required_us, slice_us)
        parts = (
            *_part(_NEEDED, 0.0, min(model.required_us, slice_us)),
            *_part(_LEFT, model.required_us, slice_us),
            *_part(_BEYOND, slice_us, model.required_us),
            *_part(_REST, used_us, period_us),
        )
        left = with_unit(figure_value(MARGIN, abs(model.margin_us)))
        words = f"{left} short" if model.margin_us < 0 else f"margin {left}"
        needed = with_unit(figure_value(REQUIRED, model.required_us))
        lanes.append(Lane(model.timing_model, parts, f"{needed} needed, {words}", is_thin=True))
    slice_words, title = _time(slice_us), f"The period of {_time(period_us)} us"
    if overruns(schedule):
        lanes.append(_over(schedule))
        title = f"{title}: its cycle of {_time(end_us)} us is beyond its slice of {slice_words} us"
    else:
        title = f"{title} and its slice of {slice_words} us"
    if not schedule.is_whole:
        lanes.append(Lane("window", tuple(_part(_WINDOW, schedule.from_us, schedule.to_us)), is_thin=True))
    return Panel(_plot(schedule, max(period_us, end_us, *(model.required_us for model in needs)), lanes), title)


def _plot(schedule: Schedule, end_us: float, lanes: Sequence[Lane], *, start_us: float = 0.0, **layout: bool) -> Lanes:
    """Lanes on a scale of time, with the end of the slice if the scale goes beyond it."""
    slice_us = schedule.figures.available_us
    end = Entry("edge" if overruns(schedule) else "limit", _END, shape="line")
    guides = (Guide(end, x=slice_us),) if start_us < slice_us < end_us else ()
    return Lanes(numbers("us", start_us, end_us), tuple(lanes), guides, **layout)


def _part(entry: Entry, start_us: float, end_us: float) -> Iterator[Span]:
    """A part of the period, if it takes any time."""
    if end_us > start_us:
        yield Span(entry, start_us, end_us, _tip(entry.words, start_us, end_us))


def _over(schedule: Schedule) -> Lane:
    return Lane("over", tuple(_part(_BEYOND, schedule.figures.available_us, schedule.end_us)), is_thin=True)


def _lanes(window: Schedule) -> Panel:
    """The window: a lane for each event where they are few, else one for the bus and each node."""
    title, events = f"{_time(window.from_us)} to {_time(window.to_us)} us", window.events
    owners = {(event.transaction, event.node) for event in events}
    has_each = len(events) <= _MOST_EVENT_LANES
    if has_each:
        ((kind, node), *more) = owners
        is_one = not more and node is not None
        title = f"{f'The {kind} of node {node}' if is_one else 'Events'}, {title}"
        lanes = [
            Lane(
                event.label if is_one else _title(event),
                tuple(_bars(window, [event])),
                f"{_time(event.duration_us)} us",
            )
            for event in events
        ]
    else:
        title = f"{title} by node"
        of_node: dict[int, list[Event]] = {}
        for event in events:
            of_node.setdefault(event.node or 0, []).append(event)
        draw = _stretches if is_coarse(window) else _bars
        lanes = [
            Lane(f"node {node}" if node else "bus", tuple(draw(window, of_node[node]))) for node in sorted(of_node)
        ]
    if overruns(window) and window.to_us > window.figures.available_us:
        lanes.append(_over(window))
    return Panel(_plot(window, window.to_us, lanes, start_us=window.from_us, is_beside=not has_each), title)


def _bars(schedule: Schedule, events: Sequence[Event]) -> Iterator[Span]:
    """A bar for each event."""
    for event in events:
        yield _bar(schedule, event.kind, _title(event), event.start_us, event.end_us)


def _stretches(schedule: Schedule, events: Sequence[Event]) -> Iterator[Span]:
    """A bar for each transaction, and for each event of the bus."""
    merged: list[tuple[Event, float]] = []
    for event in events:
        last = merged[-1][0] if merged else None
        if last and event.transaction and (event.node, event.transaction) == (last.node, last.transaction):
            merged[-1] = last, event.end_us
        else:
            merged.append((event, event.end_us))
    for event, end_us in merged:
        kind = event.transaction or event.kind
        owner = kind_of(schedule.profile, kind).label if event.node is None else f"{kind} of node {event.node}"
        yield _bar(schedule, kind, owner, event.start_us, end_us)


def _bar(schedule: Schedule, kind: str, title: str, start_us: float, end_us: float) -> Span:
    look = kind_of(schedule.profile, kind)
    return Span(Entry(look.ink, look.label, look.mark), start_us, end_us, _tip(title, start_us, end_us))


def _title(event: Event) -> str:
    """Name of an event with its transaction."""
    return event.label if event.node is None else f"{event.transaction} of node {event.node}: {event.label}"


def _tip(title: str, start_us: float, end_us: float) -> str:
    return f"{title}, {_time(end_us - start_us)} us: {_time(start_us)} to {_time(end_us)} us"


def _time(time_us: float) -> str:
    """Write a time as in tables, without its unit."""
    return figure_text(figure_value(TOTAL, time_us))


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
