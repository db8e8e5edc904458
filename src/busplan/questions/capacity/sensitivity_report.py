"""Report of `busplan capacity --sensitivity`: sentences, a table and a chart for each period."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from busplan.buses.cycle import Term
from busplan.buses.figure import MARGIN_CORRECTED, SAFE_NODES, VERDICT, by_key, unit_of
from busplan.buses.network import Network
from busplan.english import listed, nouns
from busplan.forms.blocks import (
    Block,
    Cell,
    Chart,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    count_value,
    figure_value,
    joined,
    sentence,
)
from busplan.forms.charts import Drawing, Entry, Guide, Lane, Lanes, Panel, Span, numbers
from busplan.forms.numbers import decimals_of, period_value, sentence_text
from busplan.questions.capacity import CapacityAnswer
from busplan.questions.capacity.report import capacity_report
from busplan.questions.capacity.sensitivity import Effect, NextBottleneck, NextLimit, Sensitivity, Standing
from busplan.questions.fit.certainty import FITS, limits_behind
from busplan.questions.words.documents import fields, with_profile

_DECIMALS: Final = 3


def sensitivity_drawing(sensitivity: Sensitivity) -> Drawing | None:
    """Draw a bar for each change that can be made, on one scale; None if nothing moves the margin.

    Parameters
    ----------
    sensitivity
        Effects of small changes.
    """
    moved = [(effect.change, effect.margin_change_us) for effect in sensitivity.effects]
    changes = [(change, us) for change, us in moved if us is not None]
    least, most = (choose((us for _, us in changes), default=0.0) for choose in (min, max))
    least, most, left_us = min(least, 0.0), max(most, 0.0), sensitivity.now.margin_corrected_us
    if least == most:
        return None
    lanes = tuple(
        Lane(change, tuple(_bar(us)), f"{decimals_of(us, _DECIMALS, signed=True)} us", is_thin=True)
        for change, us in changes
    )
    guides = [Guide(Entry("zero"), x=0.0)]
    if least <= -left_us < 0:
        guides.append(Guide(Entry("edge", "nothing is left of the margin", shape="line"), x=-left_us))
    title = "What each small change does to the corrected margin"
    return Drawing(title, (Panel(Lanes(numbers("us", least, most), lanes, tuple(guides))),))


def _bar(us: float) -> Iterator[Span]:
    if us < 0:
        yield Span(Entry("takes", "takes from the margin"), us, 0.0)
    elif us > 0:
        yield Span(Entry("hides", "adds to it"), 0.0, us)


def next_bottleneck_sentence(bottlenecks: NextBottleneck, network: Network) -> Sentence:
    """Say what binds once the largest term, or the limit of the nodes, is gone.

    Parameters
    ----------
    bottlenecks
        The bottleneck now, and the next one.
    network
        The network.
    """
    term, behind = (_term(term, network) for term in (bottlenecks.binding_term, bottlenecks.next_binding_term))
    term_us, behind_us, margin_us = (
        ShownValue(us, key, "us", 3)
        for us, key in (
            (bottlenecks.binding_term.us, "binding_term_us"),
            (bottlenecks.next_binding_term.us, "next_binding_term_us"),
            (bottlenecks.next_margin_corrected_us, "next_margin_corrected_us"),
        )
    )
    if bottlenecks.is_gone:
        text = f"Next bottleneck: without {term}, now {{}}, the largest term is {behind}, {{}}, and the margin {{}}"
        of_term = sentence(text, term_us, behind_us, margin_us)
    else:
        text = f"Next bottleneck: after {term}, {{}}, which no key takes away, comes {behind}, {{}}"
        of_term = sentence(text, term_us, behind_us)
    limits = map(_limit, bottlenecks.limits)
    return joined(joined(of_term, *limits, by="; "), Sentence((".",)), by="")


def _limit(limit: NextLimit) -> Sentence:
    """Say what limits the nodes, or those of a group, now and next."""
    of = f" of {limit.group}" if limit.group else ""
    return sentence(
        f"without the limit of {limit.limited_by}, now at {{}} {nouns(limit.safe_nodes, 'node')}{of}, the next limit "
        f"is {limit.next_limited_by}, at {{}} {nouns(limit.next_safe_nodes, 'node')}",
        count_value(limit.safe_nodes, SAFE_NODES.key),
        count_value(limit.next_safe_nodes, "next_safe_nodes"),
    )


def _term(term: Term, network: Network) -> str:
    return by_key(network.bus.figures.terms)[term.key].label


def next_bottleneck_record(bottleneck: NextBottleneck, network: Network) -> Record:
    """Of the document: what binds now and next, with the sentence that says it."""
    return {
        "binding_term": bottleneck.binding_term.name,
        "binding_term_us": bottleneck.binding_term.us,
        "next_binding_term": bottleneck.next_binding_term.name,
        "next_binding_term_us": bottleneck.next_binding_term.us,
        "next_margin_corrected_us": bottleneck.next_margin_corrected_us,
        **_limits(bottleneck.limits),
        "text": sentence_text(next_bottleneck_sentence(bottleneck, network)),
    }


def _limits(limits: Sequence[NextLimit]) -> Record:
    """Limit of the nodes; of groups a list, and nothing for the whole."""
    records = [
        {
            "safe_limited_by": limit.limited_by,
            "safe_nodes": limit.safe_nodes,
            "next_safe_limited_by": limit.next_limited_by,
            "next_safe_nodes": limit.next_safe_nodes,
        }
        for limit in limits
    ]
    if not limits[0].group:
        return records[0]
    named = [{"name": limit.group, **record} for limit, record in zip(limits, records, strict=True)]
    return {**dict.fromkeys(records[0]), "groups": named}


_DIGITS = 4
"""Digits of what changes: enough to see a tenth of it."""


def sensitivity_report(answer: CapacityAnswer) -> Report:
    """Report of `capacity --sensitivity`."""
    report, sensitivities = capacity_report(answer), answer.sensitivities
    return report._replace(
        blocks=(*report.blocks, *_of_periods(sensitivities)),
        document=_document(report.document, sensitivities),
        records=with_profile(answer.profile.name, [row for sensitivity in sensitivities for row in _rows(sensitivity)]),
        is_card_enough=False,
    )


def _of_periods(sensitivities: Sequence[Sensitivity]) -> Iterator[Block]:
    for sensitivity in sensitivities:
        yield from sensitivity_blocks(sensitivity)


def sensitivity_blocks(sensitivity: Sensitivity) -> Iterator[Block]:
    """Effects of small changes at one period.

    Parameters
    ----------
    sensitivity
        The effects of all changes.
    """
    yield sensitivity_table(sensitivity)
    drawn = sensitivity_drawing(sensitivity)
    if drawn is not None:
        change = _capital(sensitivity.effects[0].change)
        sides = "a bar to the left takes from it, one to the right adds to it"
        yield Chart(drawn, Sentence((f"{change} moves the margin most; {sides}, in us",)))
    yield _headline(sensitivity)
    yield from (
        Sentence((f"{_capital(effect.change)}: {effect.note}.",)) for effect in sensitivity.effects if effect.note
    )
    yield next_bottleneck_sentence(sensitivity.next_bottleneck, sensitivity.network)


def sensitivity_table(sensitivity: Sensitivity) -> Table:
    """Every change with what it does to the margin, the largest effect first.

    Parameters
    ----------
    sensitivity
        The effects of all changes.
    """
    caption = sentence(
        f"What moves the margin of {{}} at {{}}, by the {sensitivity.timing_model} model",
        figure_value(MARGIN_CORRECTED, sensitivity.now.margin_corrected_us),
        period_value(sensitivity.network.profile.cycle.period_us),
    )
    columns = (
        TableColumn("what changes", kind="words"),
        TableColumn("from -> to", kind="words", rank=1),
        TableColumn("change", "us", group="margin"),
        TableColumn("then", "us", group="margin"),
        TableColumn("verdict then", kind="words", wraps=True),
    )
    rows = (TableRow(tuple(_cells(effect, sensitivity))) for effect in sensitivity.effects)
    return Table(columns, tuple(rows), caption)


def _cells(effect: Effect, sensitivity: Sensitivity) -> Iterator[Cell]:
    yield effect.change
    yield _step(effect)
    yield ShownValue(effect.margin_change_us, "margin_change_us", "us", 3, signed=True)
    then = None if effect.then is None else effect.then.margin_corrected_us
    yield figure_value(MARGIN_CORRECTED, then)
    yield _verdict(effect.then, sensitivity.network)


def _step(effect: Effect) -> Cell:
    """From which value to which; nothing where the change has no single one."""
    if effect.before is None or effect.after is None:
        return ""
    before = ShownValue(effect.before, effect.key, digits=_DIGITS)
    after = ShownValue(effect.after, effect.key, unit_of(effect.key), digits=_DIGITS)
    return sentence("{} -> {}", before, after)


def _verdict(then: Standing | None, network: Network) -> Cell:
    """The verdict with the limits that are broken, or that the bus is unsafe."""
    shown = figure_value(VERDICT, None if then is None else then.verdict)
    if then is None:
        return shown
    why = list(limits_behind(then))
    if not why and then.verdict == FITS and not then.safe:
        why = [f"unsafe {network.bus.safety.setting}"]
    return Sentence((shown, *(f", {reason}" for reason in why)), "neutral" if _is_well(then) else "fails")


def _is_well(standing: Standing) -> bool:
    return standing.verdict == FITS and standing.safe


def _headline(sensitivity: Sensitivity) -> Sentence:
    """Say which change moves the margin most, and after which ones all is no longer well."""
    first = sensitivity.effects[0]
    if not first.margin_change_us:
        return Sentence(("None of these changes moves the margin.",))
    then = None if first.then is None else first.then.margin_corrected_us
    most = sentence(
        f"{_capital(first.change)} moves the margin most, by {{}} to {{}}.",
        ShownValue(first.margin_change_us, "margin_change_us", "us", 3, signed=True),
        figure_value(MARGIN_CORRECTED, then),
    )
    return joined(most, *_after_each(sensitivity))


def _after_each(sensitivity: Sensitivity) -> Iterator[Sentence]:
    """Say what becomes of a cycle that is shown to fit."""
    if sensitivity.now.verdict != FITS:
        return
    made = [(effect.change, effect.then) for effect in sensitivity.effects if effect.then is not None]
    lost = [change for change, then in made if then.verdict != FITS]
    unsafe = [change for change, then in made if then.verdict == FITS and sensitivity.now.safe and not then.safe]
    if lost:
        yield Sentence((f"The cycle is no longer shown to fit after {listed(lost, 'or')}.",))
    if unsafe:
        yield Sentence((f"Its {sensitivity.network.bus.safety.setting} is unsafe after {listed(unsafe, 'or')}.",))
    if not lost and not unsafe:
        yield Sentence(("The cycle is shown to fit after each of them alone.",))


def _capital(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


def _document(whole: Mapping[str, Any], sensitivities: Sequence[Sensitivity]) -> JsonDocument:
    """That of `capacity`, with more in each verdict."""
    verdicts = [
        {
            **verdict,
            "sensitivity": [_record(effect, sensitivity.network) for effect in sensitivity.effects],
            "next_bottleneck": next_bottleneck_record(sensitivity.next_bottleneck, sensitivity.network),
        }
        for verdict, sensitivity in zip(whole["verdicts"], sensitivities, strict=True)
    ]
    return {**whole, "verdicts": verdicts}


def _rows(sensitivity: Sensitivity) -> Iterator[Record]:
    """One row for each change."""
    for effect in sensitivity.effects:
        yield {
            "period_us": sensitivity.network.profile.cycle.period_us,
            "timing_model": sensitivity.timing_model,
            **_record(effect, sensitivity.network),
        }


def _record(effect: Effect, network: Network) -> Record:
    then = effect.then
    safety = network.bus.safety.figure
    own: dict[str, Any] = {} if safety is None else {safety.key: None if then is None else then.safe}
    return {
        "change": effect.change,
        "key": effect.key,
        "from": effect.before,
        "to": effect.after,
        "margin_change_us": effect.margin_change_us,
        **fields(then, "margin_corrected_us", "uncertainty_us", "verdict", "exceeded", "not_shown"),
        **own,
        "note": effect.note or None,
    }
