"""The parts of a chapter that the bus fills: verdict, timing models, timeline, terms, axes over the period."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from busplan.analysis.all_answers import AllAnswers
from busplan.analysis.latency import Transaction
from busplan.analysis.network import bus_of, network_of
from busplan.answers.capacity import capacity_table_rows
from busplan.answers.latency import latency_table_rows
from busplan.answers.page.content import Chart, Part, Row, ShownVerdict, SourceCommand, Swatch, Table, TableColumn
from busplan.answers.verdict_sentences import verdict_lines
from busplan.buses.figure import unit_of
from busplan.drawings.axes import axes_chart
from busplan.drawings.terms import LEFT, terms_chart
from busplan.drawings.timeline.kinds import kind_of
from busplan.drawings.timeline.lanes import charged, drawn_window
from busplan.drawings.timeline.mermaid import timeline_mermaid
from busplan.drawings.timeline.svg import is_coarse, timeline_svg
from busplan.forms.lines import GridRow, count, percent, plural, us, yes

Sources = Mapping[str, SourceCommand]

_HEAD: Final = (TableColumn("", "words"), TableColumn("eq", "words"), TableColumn("unit", "words"))


def plain(value: float) -> str:
    """Write a setting as it was given, without noise.

    Examples
    --------
    >>> plain(4000.0), plain(0.25)
    ('4000', '0.25')
    """
    return f"{value:.12g}"


def bus_verdict(answer: AllAnswers, sources: Sources) -> ShownVerdict:
    """Does the cycle fit, and do the timing models agree?"""
    verdict, source = answer.verdict, sources["capacity"]
    word = "FITS" if verdict.deciding.fits else "DOES NOT FIT"
    if not verdict.models_agree:
        word = "MODELS DISAGREE"
    elif verdict.deciding.fits and not verdict.deciding.safe:
        word = f"UNSAFE {bus_of(answer.profile).safety.upper()}"
    own = next(index for index, one in enumerate(answer.capacity.results) if one is verdict.deciding)
    margins = (
        (f"margin, {one.timing_model}", source.figure(f"/results/{index}/margin_us", us, "us"))
        for index, one in enumerate(answer.capacity.results)
    )
    return ShownVerdict(
        "Does the cycle fit its period?",
        word,
        "good" if verdict.all_well else "bad",
        tuple(line.text for line in verdict_lines(verdict, answer.capacity.profile)),
        source.anchor,
        "/verdicts/0/text",
        (
            *margins,
            ("utilisation", source.figure(f"/results/{own}/utilisation", percent, "%")),
            ("largest term", source.figure(f"/results/{own}/binding_term", str)),
            ("most axes", source.figure(f"/results/{own}/max_axes", count)),
        ),
    )


def models_part(answer: AllAnswers, sources: Sources) -> Part:
    """The timing models side by side: the whole cycle, and the latencies."""
    results, transactions = answer.capacity.results, answer.latency.transactions
    decides, bus = answer.profile.bus.timing_model, bus_of(answer.profile)
    cycle = _grid(
        f"The cycle; the {decides} model decides",
        (*_HEAD, *(TableColumn(one.timing_model) for one in results)),
        capacity_table_rows(bus),
        sources["capacity"],
        [f"/results/{index}" for index in range(len(results))],
    )
    columns = (TableColumn(one.timing_model, group=_group(one)) for one in transactions)
    halves = _grid(
        f"Latency in us, {bus.latency_subject(network_of(answer.profile))}",
        (*_HEAD[:2], *columns),
        latency_table_rows(bus),
        sources["latency"],
        [f"/transactions/{index}" for index in range(len(transactions))],
    )
    return Part(
        "models",
        "The timing models, side by side" if len(bus.timing_models) > 1 else "The timing model",
        tables=(cycle, halves),
        commands=_ids(sources, "capacity", "latency"),
    )


def _grid(
    caption: str,
    columns: Sequence[TableColumn],
    rows: Sequence[GridRow],
    source: SourceCommand,
    owners: Sequence[str],
) -> Table:
    """Figures of several owners side by side, rows as in the terminal."""
    words = len(columns) - len(owners)
    return Table(
        caption,
        tuple(columns),
        tuple(
            Row(
                (
                    *(row.label.strip(), row.reference, row.unit)[:words],
                    *(source.figure(f"{owner}/{row.key}", row.write, row.unit or unit_of(row.key)) for owner in owners),
                ),
                level=int(row.label.startswith(" ")),
            )
            for row in rows
        ),
    )


def _group(one: Transaction) -> str:
    return one.transaction if one.payload_bytes is None else f"{one.transaction} {one.payload_bytes} B"


def timeline_part(answer: AllAnswers, sources: Sources) -> Part:
    """The cycle to scale."""
    title = "The cycle to scale"
    if answer.schedule is None:
        return Part("timeline", title, lines=tuple(f"Not drawn: {why}." for why in answer.no_schedule))
    plan, source = answer.schedule, sources["timeline"]
    caption = f"One communication cycle by the {plan.figures.timing_model} model: {charged(plan)}."
    if is_coarse(drawn_window(plan)):
        caption += " A bar is a whole transaction."
    # The table below says what more nodes take than a bus may have; drawn, they would be a page of their own.
    network = network_of(answer.profile)
    limit = bus_of(answer.profile).limit("nodes")
    over = limit is not None and bool(limit.is_broken(network))
    charts = () if over else (Chart("wide", caption, timeline_svg(plan, inline=True), timeline_mermaid(plan)),)
    lines = (f"Not drawn: {limit.words(network)}.",) if limit is not None and over else ()
    totals = source.value("/totals")
    table = Table(
        "What takes the slice" if plan.figures.fits else "What takes the cycle",
        (
            TableColumn("kind", "words"),
            TableColumn("eq", "words"),
            TableColumn("events"),
            TableColumn("us"),
            TableColumn("%"),
        ),
        tuple(
            Row(
                (
                    Swatch(kind.ink, "", kind.label),
                    kind.reference,
                    source.figure(f"/totals/{index}/events", count),
                    source.figure(f"/totals/{index}/total_us", us, "us"),
                    source.figure(f"/totals/{index}/share", percent, "%"),
                )
            )
            for index, one in enumerate(totals)
            for kind in (kind_of(answer.profile, one["kind"]),)
        ),
    )
    return Part("timeline", title, lines, (), charts, (table,), _ids(sources, "timeline"))


def terms_part(answer: AllAnswers, sources: Sources) -> Part:
    """Where the microseconds go."""
    results, source = answer.capacity.results, sources["capacity"]
    chart = Chart(
        "wide", "The terms of the cycle, in the order of the table, and what they leave.", terms_chart(results)
    )
    table = Table(
        "Terms of the cycle, us",
        (TableColumn("term", "words"), TableColumn("eq", "words"), *(TableColumn(one.timing_model) for one in results)),
        tuple(
            Row(
                (
                    Swatch(term.ink, term.letter, term.label),
                    term.reference,
                    *(source.figure(f"/results/{index}/{term.key}", us, "us") for index in range(len(results))),
                )
            )
            for term in (*bus_of(answer.profile).term_figures, LEFT)
        ),
    )
    return Part("terms", "Where the microseconds go", charts=(chart,), tables=(table,), commands=(source.anchor,))


def axes_part(answer: AllAnswers, sources: Sources) -> Part:
    """Axes against period."""
    source, models = sources["axes"], len(answer.steps)
    nodes, axes = answer.profile.bus.nodes, answer.profile.bus.nodes * answer.profile.node.axes
    chart = Chart(
        "wide",
        f"Most axes that a period carries{_curves(answer)}; the point is this profile's own {plural(axes, 'axis')}, on "
        f"{plural(nodes, 'node')}.",
        axes_chart(answer.profile, answer.steps),
    )
    columns = [
        TableColumn(word, "words" if word == "limited by" else "figures", one.timing_model)
        for one in answer.steps
        for word in ("nodes", "axes", "limited by")
    ]
    writers: dict[str, Any] = {"max_nodes": count, "max_axes": count, "limited_by": str}
    rows = []
    for number, figures in enumerate(answer.periods.periods):
        places = [f"/results/{number * models + model}" for model in range(models)]
        rows.append(
            Row(
                (
                    source.figure(f"{places[0]}/period_us", plain, "us"),
                    *(source.figure(f"{place}/{key}", write) for place in places for key, write in writers.items()),
                ),
                level=2 if figures[0].period_us == answer.profile.cycle.period_us else 0,
            )
        )
    table = Table(
        "Most nodes and axes; the profile's own period in bold", (TableColumn("period, us"), *columns), tuple(rows)
    )
    return Part("axes", "Axes against period", charts=(chart,), tables=(table,), commands=(source.anchor,))


def _curves(answer: AllAnswers) -> str:
    """How the curves of the timing models are told apart."""
    if len(answer.steps) == 1:
        return ""
    return f": {answer.steps[0].timing_model} solid with a square, {answer.steps[1].timing_model} dashed with a diamond"


def _ids(sources: Sources, *names: str) -> tuple[str, ...]:
    return tuple(sources[name].anchor for name in names)


def fit_word(fits: object) -> str:
    """Write whether something fits, with a sign that needs no colour."""
    return f"{'✓' if fits else '✗'} {yes(fits)}"
