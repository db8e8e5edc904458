"""Report of `busplan timeline`: text, drawing, table and JSON."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import ceil
from typing import Final

from busplan.buses.figure import MARGIN, REQUIRED, VERDICT
from busplan.english import nouns
from busplan.forms import blocks, charts
from busplan.forms.numbers import figure_text, period_value, sentence_text, with_unit
from busplan.questions.base import sentences
from busplan.questions.fit.certainty import FITS
from busplan.questions.timeline.events import (
    EVENTS,
    MOST_LISTED,
    SHARE,
    TOTAL,
    Event,
    ModelNeeds,
    Schedule,
    Total,
    totals,
)

_MOST_EVENT_LANES: Final = 20
"""Most events with a lane each; more are drawn in a lane for each node. A cycle of one node has 20."""
_MOST_LANES: Final = 128
"""Most lanes of nodes; with more nodes, neighbours share a lane."""
_MOST_BARS: Final = 400
"""Most events with a bar each; of more, each transaction has one."""
_NEEDED: Final = charts.Entry("long-gap", "needed", "#")
_LEFT: Final = charts.Entry("fits", "margin", ".")
_BEYOND: Final = charts.Entry("late", "beyond the slice", "!")
_REST: Final = charts.Entry("track", "rest of the period", "-")
_WINDOW: Final = charts.Entry("window", "shown below", "^")


def timeline_report(schedule: Schedule) -> blocks.Report:
    """Report of `timeline`: whether the cycle fits, the cycle to scale, and the total of each kind of event."""
    needs, summary = schedule.needs, _headline(schedule)
    return blocks.Report(
        blocks.Sentence(("Timeline of ", blocks.Code(schedule.profile.name))),
        (
            summary,
            *sentences.warning_sentences(schedule.warnings),
            *([_margins(needs)] if len(needs) > 1 else []),
            *(blocks.Sentence((words,)) for words in _cycle_words(schedule)),
            _chart(schedule, title=sentence_text(summary)),
            _totals_table(schedule),
        ),
        _document(schedule),
        _records(schedule),
    )


def _headline(schedule: Schedule) -> blocks.Sentence:
    """Say the verdict as `capacity` does; under a model that does not decide, what it leaves of the slice."""
    figures = schedule.figures
    name: tuple[blocks.Part, ...] = (blocks.Code(schedule.profile.name), " at ", period_value(figures.period_us), ": ")
    which = " in the fullest cycle" if schedule.number is not None and schedule.cycles > 1 else ""
    if figures.verdict is None:
        words = (
            *sentences.margin_words(figures, schedule.broken_limits),
            f" by the {figures.timing_model} model{which}",
        )
        return blocks.Sentence(
            (*name, *words, ", which does not affect the verdict."), blocks.state_of(figures.fits and figures.safe)
        )
    state = blocks.state_of(figures.verdict == FITS and figures.safe)
    verdict = blocks.figure_value(VERDICT, figures.verdict)._replace(state=state)
    lines = (f"{label} {sentence_text(line)}" for label, line in sentences.time_lines(figures, schedule.profile))
    said = f" by the {figures.timing_model} model{which}; {'; '.join((*schedule.broken_limits, *lines))}."
    return blocks.Sentence((*name, verdict, said), state)


def _margins(needs: Sequence[ModelNeeds]) -> blocks.Sentence:
    """Say what each timing model leaves of the slice."""
    margins = (
        blocks.sentence(f"{{}} by the {model.timing_model} model", blocks.figure_value(MARGIN, model.free_us))
        for model in needs
    )
    return blocks.joined(
        blocks.Sentence(("Margin of the slice: ",)), blocks.joined(*margins, by=", "), blocks.Sentence((".",)), by=""
    )


def _cycle_words(schedule: Schedule) -> Iterator[str]:
    """Say which cycle is drawn, and what each needs; nothing if all are alike and none was asked for."""
    number, is_uniform = schedule.drawn, not schedule.profile.group

    def due_words(names: Sequence[str], due: int) -> str:
        if is_uniform:
            return "all nodes" if due else "no node"
        return ", ".join(names) or "no group"

    if schedule.cycles == 1:
        if schedule.number is not None:
            yield "All cycles are alike."
        return
    drawn = "the fullest"
    if schedule.number is not None:
        drawn = f"cycle {number}, with {due_words(schedule.due, len(schedule.due))}"
        if schedule.number != number:
            yield f"Cycle {schedule.number} repeats cycle {number}."
    if schedule.distinct is None:
        listed = f"More than {MOST_LISTED} cycles are not listed."
    else:
        needs = (
            f"{', '.join(map(str, cycle.numbers))}: {due_words(cycle.groups, cycle.nodes)} ({cycle.required_us:.3f} us)"
            for cycle in schedule.distinct
        )
        listed = f"Cycles {'; '.join(needs)}."
    meet = "The nodes are due" if is_uniform else "The groups meet"
    yield f"{meet} every {schedule.cycles} cycles; this is {drawn}. {listed}"


def _chart(schedule: Schedule, *, title: str) -> blocks.Chart:
    """The whole period to scale, and below it the window or, without one, the cycle without its idle rest."""
    window = schedule._replace(to_us=schedule.used_us) if schedule.is_whole else schedule
    lanes, legend = _lanes(window)
    words = _window_words(window)
    text = sentence_text(words)
    drawing = charts.Drawing(title, (_period(schedule), lanes), (text,), text, has_characters=True)
    return blocks.Chart(drawing, words, blocks.Sentence((legend,)) if legend else None)


def _window_words(window: Schedule) -> blocks.Sentence:
    """Say which nodes and which part of the cycle are shown, and which distance on the wire each node counts."""
    nodes, path, cycle = window.figures.nodes, window.path, "the cycle"
    if window.number is not None and window.cycles > 1:
        cycle = f"cycle {window.drawn} of {window.cycles}"
    setup = ", ".join((nouns(nodes, "node"), *window.setup))
    return blocks.sentence(
        f"{{}} {setup}; {{}} to {{}} of {cycle}{path and f', {path}'}",
        blocks.count_value(nodes, "nodes"),
        blocks.ShownValue(window.from_us, "from_us", "", TOTAL.decimals),
        blocks.ShownValue(window.to_us, "to_us", "us", TOTAL.decimals),
    )


def _period(schedule: Schedule) -> charts.Panel:
    """The whole period, transaction by transaction, and what each timing model needs and leaves of its slice."""
    figures, needs, end_us = schedule.figures, schedule.needs, schedule.end_us
    slice_us, period_us = figures.available_us, figures.period_us
    scale_us = max(period_us, end_us, *(slice_us - model.free_us for model in needs))
    lanes = [charts.Lane("cycle", (*_transactions(schedule, schedule.cycle_events), *_part(_REST, end_us, period_us)))]
    for model in needs:
        used_us = slice_us - model.free_us
        parts = (
            *_part(_NEEDED, 0.0, min(used_us, slice_us)),
            *_part(_LEFT, used_us, slice_us),
            *_part(_BEYOND, slice_us, used_us),
            *_part(_REST, max(used_us, slice_us), period_us),
        )
        left = with_unit(blocks.figure_value(MARGIN, abs(model.free_us)))
        words = f"{left} short" if model.free_us < 0 else f"margin {left}"
        needed = with_unit(blocks.figure_value(REQUIRED, used_us))
        lanes.append(charts.Lane(model.timing_model, parts, f"{needed} needed, {words}", is_thin=True))
    slice_words, title = _time(slice_us), f"The period of {_time(period_us)} us"
    if schedule.overruns:
        lanes.append(_over(schedule))
        title = f"{title}: its cycle of {_time(end_us)} us is beyond its slice of {slice_words} us"
    else:
        title = f"{title} and its slice of {slice_words} us"
    if not schedule.is_whole:
        lanes.append(charts.Lane("window", tuple(_part(_WINDOW, schedule.from_us, schedule.to_us)), is_thin=True))
    return charts.Panel(_plot(schedule, scale_us, lanes), title)


def _lanes(window: Schedule) -> tuple[charts.Panel, str]:
    """The window, and what a bar is: a lane for each event if they are few, else one for the bus and for each node."""
    title, events, legend = f"{_time(window.from_us)} to {_time(window.to_us)} us", window.events, ""
    has_each = len(events) <= _MOST_EVENT_LANES
    if has_each:
        owners = {(event.transaction, event.node) for event in events}
        ((kind, node), *more) = owners
        is_single = not more and node is not None
        title = f"{f'The {kind} of node {node}' if is_single else 'Events'}, {title}"
        lanes = [
            charts.Lane(
                event.label if is_single else _title(event),
                tuple(_events(window, [event])),
                f"{_time(event.duration_us)} us",
            )
            for event in events
        ]
    else:
        title = f"{title} by node"
        nodes = sorted({event.node for event in events if event.node is not None})
        size = ceil(len(nodes) / _MOST_LANES) or 1
        shared = [nodes[start : start + size] for start in range(0, len(nodes), size)]
        lane_of = {node: number for number, members in enumerate(shared, start=1) for node in members}
        of_lane: list[list[Event]] = [[] for _ in range(len(shared) + 1)]
        for event in events:
            of_lane[lane_of.get(event.node or 0, 0)].append(event)
        draw = _events
        if len(events) > _MOST_BARS:
            draw, legend = _transactions, "A bar is a whole transaction."
        names = _names_of_nodes(window)
        ends = (list(dict.fromkeys((names[members[0] - 1], names[members[-1] - 1]))) for members in shared)
        labels = ["bus", *(" to ".join(pair).replace("node ", "nodes ", len(pair) - 1) for pair in ends)]
        labels = [label.replace(" to node ", " to ") for label in labels]
        drawn = ((label, tuple(draw(window, in_lane))) for label, in_lane in zip(labels, of_lane, strict=True))
        lanes = [charts.Lane(label, bars) for label, bars in drawn if bars]
    if window.overruns and window.to_us > window.figures.available_us:
        lanes.append(_over(window))
    plot = _plot(window, window.to_us, lanes, start_us=window.from_us, is_beside=not has_each)
    return charts.Panel(plot, title), legend


def _plot(
    schedule: Schedule, end_us: float, lanes: Sequence[charts.Lane], *, start_us: float = 0.0, **layout: bool
) -> charts.Lanes:
    """Lanes on a scale of time, with the end of the slice if the scale goes beyond it."""
    slice_us = schedule.figures.available_us
    end = charts.Entry("edge" if schedule.overruns else "limit", "end of the slice", shape="line")
    guides = (charts.Guide(end, x=slice_us),) if start_us < slice_us < end_us else ()
    return charts.Lanes(charts.numbers("us", start_us, end_us), tuple(lanes), guides, **layout)


def _names_of_nodes(window: Schedule) -> list[str]:
    """Name of each node of the cycle: its number, or its group and its number in it."""
    groups = window.profile.node_groups
    names = [f"{group.name} {number}" for group in groups if group.name for number in range(1, int(group.nodes) + 1)]
    nodes = int(window.figures.nodes)
    return names if len(names) == nodes else [f"node {number}" for number in range(1, nodes + 1)]


def _over(schedule: Schedule) -> charts.Lane:
    return charts.Lane("over", tuple(_part(_BEYOND, schedule.figures.available_us, schedule.end_us)), is_thin=True)


def _part(entry: charts.Entry, start_us: float, end_us: float) -> Iterator[charts.Span]:
    """A part of the period, if it takes any time."""
    if end_us > start_us:
        yield charts.Span(entry, start_us, end_us, _tip(entry.words, start_us, end_us))


def _events(schedule: Schedule, events: Sequence[Event]) -> Iterator[charts.Span]:
    """A bar for each event."""
    for event in events:
        yield _bar(schedule, event.kind, _title(event), event.start_us, event.end_us)


def _transactions(schedule: Schedule, events: Sequence[Event]) -> Iterator[charts.Span]:
    """A bar for each transaction, and for each event of the bus."""

    def owner(numbered: tuple[int, Event]) -> tuple[object, ...]:
        number, event = numbered
        return (event.node, event.transaction) if event.transaction else (number,)

    for _, members in groupby(enumerate(events), owner):
        (_, first), *more = members
        kind = first.transaction or first.kind
        label = schedule.kinds[kind].label
        title = label if first.node is None else f"{kind} of node {first.node}"
        yield _bar(schedule, kind, title, first.start_us, more[-1][1].end_us if more else first.end_us)


def _bar(schedule: Schedule, kind: str, title: str, start_us: float, end_us: float) -> charts.Span:
    look = schedule.kinds[kind]
    return charts.Span(charts.Entry(look.ink, look.label, look.mark), start_us, end_us, _tip(title, start_us, end_us))


def _title(event: Event) -> str:
    """Label of an event, with its transaction."""
    return event.label if event.node is None else f"{event.transaction} of node {event.node}: {event.label}"


def _tip(title: str, start_us: float, end_us: float) -> str:
    return f"{title}, {_time(end_us - start_us)} us: {_time(start_us)} to {_time(end_us)} us"


def _time(time_us: float) -> str:
    """Write a time as in tables, without its unit."""
    return figure_text(blocks.figure_value(TOTAL, time_us))


_TOTAL_FIGURES: Final = (EVENTS, TOTAL, SHARE)


def _totals_table(schedule: Schedule) -> blocks.Table:
    """Total time of each kind of event in the window."""
    whole = "the cycle" if schedule.overruns else "the slice"
    part = whole if schedule.is_whole else "the window"
    return blocks.Table(
        (
            *(blocks.TableColumn("kind", kind="words"), blocks.TableColumn("source", kind="words", rank=1)),
            *(blocks.TableColumn(figure.label, figure.column or figure.unit) for figure in _TOTAL_FIGURES),
        ),
        tuple(_total_row(schedule, total) for total in totals(schedule)),
        blocks.sentence(
            f"Use of {part}, {{}}", blocks.ShownValue(schedule.to_us - schedule.from_us, "duration_us", "us", 3)
        ),
    )


def _total_row(schedule: Schedule, total: Total) -> blocks.TableRow:
    kind = schedule.kinds[total.kind]
    values = (blocks.attribute_value(figure, total) for figure in _TOTAL_FIGURES)
    return blocks.TableRow((blocks.Swatch(kind.ink, kind.mark, kind.label), kind.reference, *values))


def _document(schedule: Schedule) -> blocks.JsonDocument:
    """Document of `busplan timeline --format json`: the cycle's figures, and events and totals of the window."""
    figures, distinct = schedule.figures, schedule.distinct
    values = figures.values()
    return sentences.document(
        "timeline",
        profile=schedule.profile.name,
        **sentences.fields(figures, "timing_model", "period_us", "nodes"),
        **{key: values[key] for key in figures.bus_figures.headings},
        cycle=schedule.drawn,
        common_multiple=schedule.cycles,
        distinct_cycles=None if distinct is None else [cycle._asdict() for cycle in distinct],
        required_us=schedule.required_us,
        available_us=figures.available_us,
        **sentences.fields(schedule, "margin_us", "margin_corrected_us", "uncertainty_us"),
        **sentences.fields(figures, "exceeded", "not_shown", "fits", "verdict"),
        **sentences.safety_record(figures),
        warnings=list(schedule.warnings),
        **sentences.fields(schedule, "from_us", "to_us"),
        margins=[model._asdict() for model in schedule.needs],
        events=_event_records(schedule),
        totals=[total._asdict() for total in totals(schedule)],
    )


def _records(schedule: Schedule) -> list[blocks.Record]:
    """One row for each event, with profile and timing model in front."""
    head = {"profile": schedule.profile.name, "timing_model": schedule.figures.timing_model}
    return [{**head, **record} for record in _event_records(schedule)]


def _event_records(schedule: Schedule) -> list[blocks.Record]:
    """One row for each event of the window."""
    keys = ("kind", "node", "transaction", "packet", "start_us", "end_us", "duration_us")
    return [
        {**sentences.fields(event, *keys), "equation": schedule.kinds[event.kind].reference}
        for event in schedule.events
    ]
