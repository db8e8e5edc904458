"""Parts of a page: verdicts, timing models, timeline, terms, axes over the period, map, and the circle."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final

from busplan.buses.figure import (
    AXES,
    LIMITED_BY,
    MAX_AXES,
    MAX_NODES,
    NODES,
    PERIOD,
    REQUIRED,
    SAFE_AXES,
    SAFE_LIMITED_BY,
    SAFE_NODES,
    Figure,
)
from busplan.forms.blocks import (
    Block,
    Chapter,
    Chart,
    Facts,
    Question,
    Sentence,
    Swatch,
    Table,
    TableColumn,
    TableRow,
    Words,
    attribute_value,
    count_value,
    sentence,
)
from busplan.forms.numbers import nouns, period_value
from busplan.questions.capacity.report import capacity_table, groups_table
from busplan.questions.capacity.sensitivity_report import sensitivity_blocks
from busplan.questions.capacity.sentences import verdict_sentences
from busplan.questions.circle.figures import CIRCLE_BY_KEY, CircleFigures
from busplan.questions.circle.report import (
    ACT_TOGETHER,
    NO_SOURCES,
    circle_or_reason,
    circle_sentences,
    circle_table,
    contributions_table,
    servo_sentence,
    verdict_words,
)
from busplan.questions.fit.figures import CapacityFigures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.latency.report import latency_tables
from busplan.questions.map.report import headline, map_chart, regions_table
from busplan.questions.report.all_answers import AllAnswers
from busplan.questions.report.commands import Sources
from busplan.questions.timeline.report import timeline_chart, totals_table
from busplan.questions.words.drawings import LEFT, axes_drawing, terms_drawing

_ORDER: Final = "The terms stand in the order of the table, and what they leave comes last."
_OVER_PERIOD: Final = (SAFE_NODES, SAFE_AXES, SAFE_LIMITED_BY)
"""Under the timing model that decides."""
_CLOSED: Final = (MAX_NODES, MAX_AXES, LIMITED_BY)
"""Under another timing model."""


def part(kind: str, title: str, blocks: Iterable[Block]) -> Chapter:
    """A part of a page; `kind` is its name for the style sheet."""
    return Chapter(Sentence((title,)), tuple(blocks), kind)


def parts(answer: AllAnswers, sources: Sources) -> Iterator[Chapter]:
    """Parts of a page about a profile, below its verdict."""
    several = len(bus_of(answer.profile).timing_models) > 1
    by_groups = bool(answer.profile.group)
    yield part("models", f"The timing model{'s, side by side' if several else ''}", _models(answer, sources))
    if answer.sensitivity is None or answer.trade_off is None:
        return  # the rest is of a cycle
    yield part("timeline", "The cycle to scale", _timeline(answer, sources))
    yield part("terms", "Where the microseconds go", _terms(answer, sources))
    moves = (*sensitivity_blocks(answer.sensitivity), sources["capacity"].line)
    yield part("sensitivity", "What moves the margin", moves)
    axes = _groups if by_groups else _axes
    yield part("axes", f"{'Nodes' if by_groups else 'Axes'} against period", axes(answer, sources))
    fits = answer.trade_off
    drawn = (headline(fits), map_chart(fits), regions_table(fits), sources["map"].line)
    yield part("map", "What fits, and what limits it", drawn)
    yield part("circle", "The circle", _circle(answer, sources))
    if answer.circle_figures is not None and answer.circle_figures.contributions is not None:
        yield part("sources", "What to attack", _error_sources(answer.circle_figures, sources))


def _models(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    """Capacity and latencies, the timing models side by side."""
    yield from verdict_sentences(answer.verdict, answer.profile)
    yield capacity_table(answer.capacity)
    if answer.profile.group:
        yield groups_table(answer.capacity)
    yield from latency_tables(answer.latency)
    yield from (sources["capacity"].line, sources["latency"].line)


def _timeline(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    """The timeline, and the total of each kind of event."""
    if answer.schedule is None:
        yield from (Sentence((f"Not drawn: {why}.",)) for why in answer.no_schedule)
        return
    network = network_of(answer.profile)
    limit = bus_of(answer.profile).limit("nodes")
    # More nodes than a bus may have would make a huge drawing; the table has their figures.
    if limit is not None and limit.is_broken(network):
        yield Sentence((f"Not drawn: {limit.words(network)}.",))
    else:
        yield timeline_chart(answer.schedule)
    yield totals_table(answer.schedule)
    yield sources["timeline"].line


def _terms(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    """The terms of the cycle, as bars and as a table."""
    results = answer.capacity.results
    yield Chart(terms_drawing(results), _largest_term(answer), Sentence((_ORDER,)))
    words = (TableColumn("term", kind="words"), TableColumn("eq", kind="words"))
    rows = []
    for term in (*bus_of(answer.profile).figures.terms, LEFT):
        under_each = (attribute_value(term, figures) for figures in results)
        rows.append(TableRow((Swatch(term.ink, term.letter, term.label), term.reference, *under_each)))
    columns = (*words, *(TableColumn(figures.timing_model) for figures in results))
    yield Table(columns, tuple(rows), Sentence(("Terms of the cycle, us",)))
    yield sources["capacity"].line


def _largest_term(answer: AllAnswers) -> Sentence:
    """Say which term takes most, by the model that decides."""
    deciding = answer.verdict.deciding
    term = max(bus_of(answer.profile).figures.terms, key=lambda figure: getattr(deciding, figure.key))
    return sentence(
        f"Of the {{}} that the cycle needs by the {deciding.timing_model} model, {term.label} takes the most, {{}}",
        attribute_value(REQUIRED, deciding),
        attribute_value(term, deciding),
    )


def _axes(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    """The most axes over the period, as a chart and as a table."""
    steps = answer.steps
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
    yield Chart(axes_drawing(answer.profile, steps), caption, Sentence((_curves(answer),)))
    columns = [
        TableColumn(figure.label, kind="words" if figure.sort == "word" else "figures", group=model.timing_model)
        for model in steps
        for figure in _shown_of(model.is_safe)
    ]

    def shown(figures: CapacityFigures) -> Iterator[tuple[Figure, object]]:
        yield from ((figure, figures) for figure in _shown_of(figures.verdict is not None))

    yield _over_period(answer, columns, shown, "Nodes and axes at the profile's own period and about it")
    yield sources["axes"].line


def _groups(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    """The most nodes of each group over the period, as a table."""
    columns = [
        column
        for group in answer.profile.group
        for column in (
            TableColumn(SAFE_NODES.label, group=group.name),
            TableColumn("limited by", kind="words", group=group.name),
        )
    ]

    def shown(figures: CapacityFigures) -> Iterator[tuple[Figure, object]]:
        if figures.verdict is not None:
            yield from ((figure, group) for group in figures.groups for figure in (SAFE_NODES, SAFE_LIMITED_BY))

    caption = "Nodes of each group that a period carries, the others as they are, all shown to fit"
    yield _over_period(answer, columns, shown, caption)
    yield sources["axes"].line


def _over_period(
    answer: AllAnswers,
    columns: Sequence[TableColumn],
    shown: Callable[[CapacityFigures], Iterable[tuple[Figure, object]]],
    caption: str,
) -> Table:
    """A row for each period; `shown` gives figures under a timing model, each with what has it."""
    rows = []
    for results in answer.periods.periods:
        cells = [attribute_value(PERIOD, results[0])]
        cells += (attribute_value(figure, owner) for figures in results for figure, owner in shown(figures))
        rows.append(TableRow(tuple(cells), highlighted=results[0].period_us == answer.profile.cycle.period_us))
    return Table((TableColumn("period", "us"), *columns), tuple(rows), Sentence((caption,)))


def _shown_of(is_safe: bool) -> tuple[Figure, ...]:
    """Figures over the period: nodes shown to fit, or the closed form of a model that does not affect the verdict."""
    return _OVER_PERIOD if is_safe else _CLOSED


def _curves(answer: AllAnswers) -> str:
    """What each curve is."""
    names = [f"{step.timing_model}, {'shown to fit' if step.is_safe else 'the closed form'}" for step in answer.steps]
    return f"The axes that a period carries: {'; '.join(names)}."


_QUESTION: Final = "Is the circle still round?"
_KEYS: Final = (
    *("mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm"),
    *("phase_margin_deg", "gain_margin_db"),
)


def circle_question(answer: AllAnswers) -> Question:
    """The question whether the circle is round, with its verdict."""
    result = answer.circle_figures
    if result is None:
        return Question(
            _QUESTION,
            Words("CANNOT BE RUN", "fails") if answer.no_circle else Words("NOT RUN", "neutral"),
            tuple(Sentence((why,)) for why in _why_not(answer)),
            Facts(()),
        )
    known = (key for key in _KEYS if getattr(result, key) is not None)
    facts = ((CIRCLE_BY_KEY[key].label, attribute_value(CIRCLE_BY_KEY[key], result)) for key in known)
    return Question(
        _QUESTION,
        verdict_words(result),
        (*circle_sentences(answer.profile, result), *servo_sentence(answer.profile, result)),
        Facts(tuple(facts)),
    )


def _why_not(answer: AllAnswers) -> tuple[str, ...]:
    if answer.no_circle:
        return tuple(f"The circle test cannot be run: {why}." for why in answer.no_circle)
    if answer.profile.asks_for_circle:
        return ("The circle test was left out (--no-circle).",)
    return ("The profile has no section for a circle test, so none was run.",)


def _circle(answer: AllAnswers, sources: Sources) -> Iterator[Block]:
    """The magnified circle and its figures."""
    result = answer.circle_figures
    if result is None:
        yield from (Sentence((why,)) for why in _why_not(answer))
        return
    yield circle_or_reason(answer.contour, result, answer.profile)
    yield circle_table((result,))
    yield sources["circle"].line


def _error_sources(result: CircleFigures, sources: Sources) -> Iterator[Block]:
    """The ranked error sources."""
    if result.contributions:
        yield from (contributions_table(result), ACT_TOGETHER, sources["circle"].line)
    else:
        yield NO_SOURCES
