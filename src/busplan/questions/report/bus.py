"""Parts of a page on the bus: verdict, timing models, timeline, terms, axes over the period."""

from collections.abc import Iterator
from typing import Final

from busplan.buses.figure import (
    AXES,
    BINDING_TERM,
    LIMITED_BY,
    MARGIN_CORRECTED,
    MAX_AXES,
    MAX_NODES,
    NODES,
    PERIOD,
    REQUIRED,
    SAFE_AXES,
    SAFE_LIMITED_BY,
    SAFE_NODES,
    UNCERTAINTY,
    UTILISATION,
    Figure,
)
from busplan.forms.blocks import (
    Block,
    Chapter,
    Chart,
    Facts,
    Question,
    Sentence,
    ShownValue,
    Swatch,
    Table,
    TableColumn,
    TableRow,
    Words,
    attribute_value,
    count_value,
    sentence,
    state_of,
)
from busplan.forms.numbers import nouns, period_value
from busplan.questions.capacity.report import capacity_table, groups_table
from busplan.questions.capacity.sensitivity_report import sensitivity_blocks
from busplan.questions.capacity.sentences import verdict_sentences
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.latency.report import latency_tables
from busplan.questions.map.report import headline, map_chart, regions_table
from busplan.questions.report.all_answers import AllAnswers
from busplan.questions.report.commands import Sources
from busplan.questions.timeline.report import timeline_chart, totals_table
from busplan.questions.words.axes import AxesDrawing
from busplan.questions.words.terms import LEFT, TermsDrawing

_ORDER: Final = "The terms stand in the order of the table, and what they leave comes last."
_OVER_PERIOD: Final = (SAFE_NODES, SAFE_AXES, SAFE_LIMITED_BY)
"""Under the timing model that decides."""
_CLOSED: Final = (MAX_NODES, MAX_AXES, LIMITED_BY)
"""Under another timing model."""


def bus_question(answer: AllAnswers) -> Question:
    """The question whether the cycle fits, with its verdict."""
    verdict = answer.verdict
    word = str(verdict.deciding.verdict).upper()
    if verdict.deciding.verdict == FITS and not verdict.deciding.safe:
        word = f"UNSAFE {bus_of(answer.profile).safety.setting.upper()}"
    facts = tuple(
        (figure.label, attribute_value(figure, verdict.deciding))
        for figure in (MARGIN_CORRECTED, UNCERTAINTY, SAFE_AXES, UTILISATION, BINDING_TERM)
        if figure is not SAFE_AXES or not answer.profile.group
    )
    return Question(
        "Does the cycle fit its period?",
        Words(word, state_of(verdict.deciding.verdict == FITS and verdict.deciding.safe)),
        tuple(verdict_sentences(verdict, answer.profile)),
        Facts(facts),
    )


def models_part(answer: AllAnswers, sources: Sources) -> Chapter:
    """Capacity and latencies, the timing models side by side."""
    several = len(bus_of(answer.profile).timing_models) > 1
    return Chapter(
        Sentence(("The timing models, side by side" if several else "The timing model",)),
        (
            capacity_table(answer.capacity),
            *([groups_table(answer.capacity)] if answer.profile.group else []),
            *latency_tables(answer.latency),
            sources["capacity"].line,
            sources["latency"].line,
        ),
        "models",
    )


def timeline_part(answer: AllAnswers, sources: Sources) -> Chapter:
    """The timeline, and the total of each kind of event."""
    return Chapter(Sentence(("The cycle to scale",)), tuple(_timeline(answer, sources)), "timeline")


def _timeline(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    if answer.schedule is None:
        yield from (Sentence((f"Not drawn: {why}.",)) for why in answer.no_schedule)
        return
    source, network = sources["timeline"], network_of(answer.profile)
    limit = bus_of(answer.profile).limit("nodes")
    # More nodes than a bus may have would make a huge drawing; the table has their figures.
    if limit is not None and limit.is_broken(network):
        yield Sentence((f"Not drawn: {limit.words(network)}.",))
    else:
        yield timeline_chart(answer.schedule)
    yield totals_table(answer.schedule)
    yield source.line


def terms_part(answer: AllAnswers, sources: Sources) -> Chapter:
    """The terms of the cycle, as bars and as a table."""
    results, source = answer.capacity.results, sources["capacity"]
    terms = (*bus_of(answer.profile).figures.terms, LEFT)
    words = (TableColumn("term", kind="words"), TableColumn("eq", kind="words"))
    table = Table(
        (*words, *(TableColumn(one.timing_model) for one in results)),
        tuple(
            TableRow((Swatch(term.ink, term.letter, term.label), term.reference, *_of(term, answer))) for term in terms
        ),
        Sentence(("Terms of the cycle, us",)),
    )
    chart = Chart(TermsDrawing(results), _largest_term(answer), Sentence((_ORDER,)))
    blocks = (chart, table, source.line)
    return Chapter(Sentence(("Where the microseconds go",)), blocks, "terms")


def _largest_term(answer: AllAnswers) -> Sentence:
    """Say which term takes most, by the model that decides."""
    deciding = answer.verdict.deciding
    term = max(bus_of(answer.profile).figures.terms, key=lambda one: getattr(deciding, one.key))
    return sentence(
        f"Of the {{}} that the cycle needs by the {deciding.timing_model} model, {term.label} takes the most, {{}}",
        attribute_value(REQUIRED, deciding),
        attribute_value(term, deciding),
    )


def _of(term: Figure, answer: AllAnswers) -> Iterator[ShownValue]:
    """A term under each timing model."""
    return (attribute_value(term, one) for one in answer.capacity.results)


def sensitivity_part(answer: AllAnswers, sources: Sources) -> Chapter:
    """What moves the margin, and what binds next."""
    blocks = (*sensitivity_blocks(answer.sensitivity), sources["capacity"].line)
    return Chapter(Sentence(("What moves the margin",)), blocks, "sensitivity")


def axes_part(answer: AllAnswers, sources: Sources) -> Chapter:
    """The most axes over the period, as a chart and as a table; of groups, the most nodes of each."""
    if answer.profile.group:
        return _groups_part(answer, sources)
    source, steps = sources["axes"], answer.steps
    network = network_of(answer.profile)
    nodes, axes = int(network.nodes), int(network.axes)
    deciding = answer.verdict.deciding
    most = deciding.safe_axes or 0
    caption = sentence(
        f"At {{}} a bus carries {{}} {nouns(most, 'axis')} shown to fit, and this profile has {{}}, "
        f"on {{}} {nouns(nodes, 'node')}",
        period_value(deciding.period_us),
        count_value(most, SAFE_AXES.key),
        count_value(axes, AXES.key),
        count_value(nodes, NODES.key),
    )
    table = Table(
        (
            TableColumn("period", "us"),
            *(
                TableColumn(figure.label, kind="words" if figure.sort == "word" else "figures", group=one.timing_model)
                for one in steps
                for figure in _shown_of(one.is_safe)
            ),
        ),
        tuple(_over_period(answer)),
        Sentence(("Nodes and axes at the profile's own period and about it",)),
    )
    chart = Chart(AxesDrawing(answer.profile, steps), caption, Sentence((_curves(answer),)))
    return Chapter(Sentence(("Axes against period",)), (chart, table, source.line), "axes")


def map_part(answer: AllAnswers, sources: Sources) -> Chapter:
    """The map of period against axes, and what limits each region."""
    found = answer.trade_off
    blocks = (headline(found), map_chart(found), regions_table(found), sources["map"].line)
    return Chapter(Sentence(("What fits, and what limits it",)), blocks, "map")


def _groups_part(answer: AllAnswers, sources: Sources) -> Chapter:
    source = sources["axes"]
    columns = [TableColumn("period", "us")]
    for one in answer.profile.group:
        columns += (
            TableColumn(SAFE_NODES.label, group=one.name),
            TableColumn("limited by", kind="words", group=one.name),
        )
    rows = []
    for results in answer.periods.periods:
        cells = [attribute_value(PERIOD, results[0])]
        for figures in results:
            for group in figures.groups if figures.verdict is not None else ():
                cells += (attribute_value(figure, group) for figure in (SAFE_NODES, SAFE_LIMITED_BY))
        rows.append(TableRow(tuple(cells), highlighted=results[0].period_us == answer.profile.cycle.period_us))
    caption = Sentence(("Nodes of each group that a period carries, the others as they are, all shown to fit",))
    table = Table(tuple(columns), tuple(rows), caption)
    return Chapter(Sentence(("Nodes against period",)), (table, source.line), "axes")


def _over_period(answer: AllAnswers) -> Iterator[TableRow]:
    """One row for each period; the timing models one after the other."""
    for results in answer.periods.periods:
        period_us = results[0].period_us
        cells = [attribute_value(PERIOD, results[0])]
        for one in results:
            shown = _shown_of(one.verdict is not None)
            cells += (attribute_value(figure, one) for figure in shown)
        yield TableRow(tuple(cells), highlighted=period_us == answer.profile.cycle.period_us)


def _shown_of(is_safe: bool) -> tuple[Figure, ...]:
    """What is shown over the period: what is shown to fit, or the closed form of a model that decides nothing."""
    return _OVER_PERIOD if is_safe else _CLOSED


def _curves(answer: AllAnswers) -> str:
    """Legend of the curves."""
    names = [f"{one.timing_model}, {'shown to fit' if one.is_safe else 'the closed form'}" for one in answer.steps]
    marks = ("solid with a square", "dashed with a diamond")
    curves = (f"{name}: {mark}" for name, mark in zip(names, marks, strict=False))
    return f"The axes that a period carries, {'; '.join(curves)}; the point is this profile's own."
