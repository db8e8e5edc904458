"""Report of `busplan capacity --sensitivity`: the effect of each small change, and the next bottleneck."""

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Final

from busplan.buses.figure import MARGIN_CORRECTED, SAFE_NODES, VERDICT, BusFigures, by_key, unit_of
from busplan.buses.parts import Safety
from busplan.english import listed, nouns
from busplan.forms import blocks, charts
from busplan.forms.numbers import decimals_of, known_decimals, period_value, sentence_text
from busplan.questions.base.sentences import fields, margin_parts, with_profile
from busplan.questions.capacity import CapacityAnswer
from busplan.questions.capacity.report import capacity_report
from busplan.questions.capacity.sensitivity import Effect, NextBottleneck, NextLimit, Reach, Sensitivity
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import CycleFigures

_DECIMALS: Final = 3
_CHANGE_DIGITS: Final = 4
"""Significant digits of a changed value: enough to show a change of 10 %."""


def sensitivity_report(answer: CapacityAnswer) -> blocks.Report:
    """Report of `capacity --sensitivity`."""
    report, sensitivities = capacity_report(answer), answer.sensitivities
    effects = [[_record(effect, at.now.safety) for effect in at.effects] for at in sensitivities]
    verdicts = [
        {
            **verdict,
            "sensitivity": records,
            "reach": [reach._asdict() for reach in at.reaches],
            "next_bottleneck": _bottleneck_record(at.next_bottleneck, at.now.bus_figures),
        }
        for verdict, records, at in zip(report.document["verdicts"], effects, sensitivities, strict=True)
    ]
    rows = [
        {**fields(at.now, "period_us", "timing_model"), **record}
        for at, records in zip(sensitivities, effects, strict=True)
        for record in records
    ]
    return report._replace(
        blocks=(*report.blocks, *chain.from_iterable(map(_blocks, sensitivities))),
        document={**report.document, "verdicts": verdicts},
        records=with_profile(answer.profile.name, rows),
    )


def _record(effect: Effect, safety: Safety) -> blocks.Record:
    then, safe = effect.then, safety.figure
    return {
        "change": effect.change,
        "key": effect.key,
        "from": effect.before,
        "to": effect.after,
        "margin_change_us": effect.margin_change_us,
        **fields(then, "margin_corrected_us", "uncertainty_us", "verdict", "exceeded", "not_shown"),
        **({} if safe is None else {safe.key: then and then.safe}),
        "note": effect.note or None,
    }


def _bottleneck_record(bottleneck: NextBottleneck, register: BusFigures) -> blocks.Record:
    """The bottleneck now and next, as data and as a sentence; with groups, their limits are a list."""
    limits = [
        {
            "safe_limited_by": limit.limited_by,
            "safe_nodes": limit.safe_nodes,
            "next_safe_limited_by": limit.next_limited_by,
            "next_safe_nodes": limit.next_safe_nodes,
        }
        for limit in bottleneck.limits
    ]
    counts: blocks.Record = limits[0]
    if bottleneck.limits[0].group:
        names = [{"name": limit.group} for limit in bottleneck.limits]
        groups = [{**name, **record} for name, record in zip(names, limits, strict=True)]
        counts = {**dict.fromkeys(counts), "groups": groups}
    return {
        "binding_term": bottleneck.binding_term.name,
        "binding_term_us": bottleneck.binding_term.us,
        "next_binding_term": bottleneck.next_binding_term.name,
        "next_binding_term_us": bottleneck.next_binding_term.us,
        "next_margin_corrected_us": bottleneck.next_margin_corrected_us,
        **counts,
        "text": sentence_text(_bottleneck_sentence(bottleneck, register)),
    }


def _blocks(sensitivity: Sensitivity) -> Iterator[blocks.Block]:
    """Effects of small changes at one period."""
    effects = sensitivity.effects
    yield _table(sensitivity)
    if (drawn := _drawing(sensitivity)) is not None:
        change = _capital(effects[0].change)
        sides = "a bar to the left takes from it, one to the right adds to it"
        yield blocks.Chart(drawn, blocks.Sentence((f"{change} moves the corrected margin most; {sides}, in us",)))
    yield _headline(sensitivity)
    if notes := tuple(
        blocks.Sentence((f"{_capital(effect.change)}: {effect.note}.",)) for effect in effects if effect.note
    ):
        yield blocks.Detail(notes, "why some changes have no effect")
    yield _bottleneck_sentence(sensitivity.next_bottleneck, sensitivity.now.bus_figures)
    if sensitivity.reaches:
        yield _reaches_table(sensitivity.reaches)


def _table(sensitivity: Sensitivity) -> blocks.Table:
    """Every change with what it does to the margin, the largest effect first."""
    caption = blocks.sentence(
        f"What moves the corrected margin of {{}} at {{}}, by the {sensitivity.now.timing_model} model",
        margin_parts(sensitivity.now)[0],
        period_value(sensitivity.now.period_us),
    )
    columns = (
        blocks.TableColumn("what changes", kind="words"),
        blocks.TableColumn("from -> to", kind="words", rank=1),
        blocks.TableColumn("change", "us", group="corrected margin"),
        blocks.TableColumn("then", "us", group="corrected margin"),
        blocks.TableColumn("verdict then", kind="words", wraps=True),
    )
    rows = (
        blocks.TableRow(
            (
                effect.change,
                _step(effect),
                _change_value(effect, sensitivity),
                _then_value(effect),
                _verdict(effect.then),
            ),
            is_detail=bool(effect.note),
        )
        for effect in sensitivity.effects
    )
    return blocks.Table(columns, tuple(rows), caption)


def _change_value(effect: Effect, sensitivity: Sensitivity) -> blocks.ShownValue:
    """Change of the margin, in the digits that the margin has."""
    change_us, now = effect.margin_change_us, sensitivity.now
    decimals = min(_DECIMALS, max(0, known_decimals(change_us or 0.0, now.uncertainty_us)))
    return blocks.ShownValue(change_us, "margin_change_us", "us", decimals, signed=True)


def _then_value(effect: Effect) -> blocks.ShownValue:
    """The margin after a change, in the digits that its uncertainty allows."""
    margin_us, uncertainty_us = None, None
    if effect.then is not None:
        margin_us, uncertainty_us = effect.then.margin_corrected_us, effect.then.uncertainty_us
    decimals = known_decimals(margin_us or 0.0, uncertainty_us)
    return blocks.figure_value(MARGIN_CORRECTED, margin_us)._replace(decimals=min(_DECIMALS, max(0, decimals)))


def _reaches_table(reaches: Sequence[Reach]) -> blocks.Table:
    """Table of the growth that each quantity allows."""
    columns = (
        blocks.TableColumn("quantity", kind="words"),
        blocks.TableColumn("now"),
        blocks.TableColumn("up to"),
        blocks.TableColumn("then broken", kind="words"),
    )
    rows = (
        blocks.TableRow(
            (
                reach.quantity,
                blocks.ShownValue(reach.now, reach.key, digits=_CHANGE_DIGITS),
                blocks.ShownValue(reach.most, reach.key, digits=_CHANGE_DIGITS),
                ", ".join(reach.limited_by) or "nothing",
            )
        )
        for reach in reaches
    )
    return blocks.Table(
        columns, tuple(rows), blocks.Sentence(("Largest value of each quantity alone before a limit breaks",))
    )


def _step(effect: Effect) -> blocks.Cell:
    """The value before and after; nothing if the change has no single value."""
    if effect.before is None or effect.after is None:
        return ""
    before = blocks.ShownValue(effect.before, effect.key, digits=_CHANGE_DIGITS)
    after = blocks.ShownValue(effect.after, effect.key, unit_of(effect.key), digits=_CHANGE_DIGITS)
    return blocks.sentence("{} -> {}", before, after)


def _verdict(then: CycleFigures | None) -> blocks.Cell:
    """The verdict with the broken limits, or with the setting that is unsafe."""
    if then is None:
        return blocks.figure_value(VERDICT, None)
    why = list(then.behind)
    is_well = then.verdict == FITS and then.safe
    if not why and then.verdict == FITS and not then.safe:
        why = [f"unsafe {then.safety.setting}"]
    shown = blocks.figure_value(VERDICT, then.verdict)
    return blocks.Sentence((shown, *(f", {reason}" for reason in why)), "neutral" if is_well else "fails")


def _drawing(sensitivity: Sensitivity) -> charts.Drawing | None:
    """A bar for each change that can be made, on one scale; None if nothing moves the margin."""
    moved = [(effect.change, effect.margin_change_us) for effect in sensitivity.effects]
    changes = [(change, us) for change, us in moved if us is not None]
    least, most = (pick((0.0, *(us for _, us in changes))) for pick in (min, max))
    left_us = sensitivity.now.margin_corrected_us or 0.0
    if least == most:
        return None
    lanes = tuple(
        charts.Lane(change, tuple(_bar(us)), f"{decimals_of(us, _DECIMALS, signed=True)} us", is_thin=True)
        for change, us in changes
    )
    guides = [charts.Guide(charts.Entry("zero"), x=0.0)]
    if least <= -left_us < 0:
        guides.append(
            charts.Guide(charts.Entry("edge", "nothing is left of the corrected margin", shape="line"), x=-left_us)
        )
    title = "What each small change does to the corrected margin"
    return charts.Drawing(title, (charts.Panel(charts.Lanes(charts.numbers("us", least, most), lanes, tuple(guides))),))


def _bar(us: float) -> Iterator[charts.Span]:
    if us < 0:
        yield charts.Span(charts.Entry("takes", "takes from the corrected margin"), us, 0.0)
    elif us > 0:
        yield charts.Span(charts.Entry("hides", "adds to it"), 0.0, us)


def _headline(sensitivity: Sensitivity) -> blocks.Sentence:
    """Say which change moves the margin most, and after which ones the cycle no longer fits or the bus is unsafe."""
    first = sensitivity.effects[0]
    if not first.margin_change_us:
        return blocks.Sentence(("None of these changes moves the corrected margin.",))
    most = blocks.sentence(
        f"{_capital(first.change)} moves the corrected margin most, by {{}} to {{}}.",
        _change_value(first, sensitivity),
        _then_value(first),
    )
    return blocks.joined(most, *_after_each(sensitivity))


def _after_each(sensitivity: Sensitivity) -> Iterator[blocks.Sentence]:
    """Say after which changes a cycle that is shown to fit no longer is, or its bus is unsafe."""
    if sensitivity.now.verdict != FITS:
        return
    made = [(effect.change, effect.then) for effect in sensitivity.effects if effect.then is not None]
    lost = [change for change, then in made if then.verdict != FITS]
    unsafe = [change for change, then in made if then.verdict == FITS and sensitivity.now.safe and not then.safe]
    if lost:
        yield blocks.Sentence((f"The cycle is no longer shown to fit after {listed(lost, 'or')}.",))
    if unsafe:
        yield blocks.Sentence((f"Its {sensitivity.now.safety.setting} is unsafe after {listed(unsafe, 'or')}.",))
    if not lost and not unsafe:
        yield blocks.Sentence(("The cycle is shown to fit after each of them alone.",))


def _bottleneck_sentence(bottleneck: NextBottleneck, register: BusFigures) -> blocks.Sentence:
    """Say what binds once the largest term, or the limit of the nodes, is gone."""
    now, next_term = bottleneck.binding_term, bottleneck.next_binding_term
    labels = by_key(register.terms)
    label, next_label = labels[now.key].label, labels[next_term.key].label
    us = blocks.ShownValue(now.us, "binding_term_us", "us", known_decimals(now.us, None))
    next_us = blocks.ShownValue(next_term.us, "next_binding_term_us", "us", known_decimals(next_term.us, None))
    if bottleneck.next_margin_corrected_us is not None:
        margin_us = bottleneck.next_margin_corrected_us
        margin = blocks.ShownValue(margin_us, "next_margin_corrected_us", "us", known_decimals(margin_us, None))
        text = (
            f"Next bottleneck: without {label}, now {{}}, the largest term is {next_label}, {{}}, "
            "and the corrected margin {}"
        )
        of_term = blocks.sentence(text, us, next_us, margin)
    else:
        then = f"the next term is {next_label}, {{}}"
        of_term = blocks.sentence(f"Next bottleneck: no key removes {label}, {{}}; {then}", us, next_us)
    return blocks.joined(
        blocks.joined(of_term, *map(_limit, bottleneck.limits), by="; "), blocks.Sentence((".",)), by=""
    )


def _limit(limit: NextLimit) -> blocks.Sentence:
    """Say what limits the nodes, or those of a group, now and next."""
    of = f" of {limit.group}" if limit.group else ""
    return blocks.sentence(
        f"without the limit of {limit.limited_by}, now at {{}} {nouns(limit.safe_nodes, 'node')}{of}, the next limit "
        f"is {limit.next_limited_by}, at {{}} {nouns(limit.next_safe_nodes, 'node')}",
        blocks.count_value(limit.safe_nodes, SAFE_NODES.key),
        blocks.count_value(limit.next_safe_nodes, "next_safe_nodes"),
    )


def _capital(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"
