"""What moves the margin, of `busplan capacity --sensitivity`: sentences, a table and a chart for each period."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from busplan.buses.figure import MARGIN_CORRECTED, VERDICT, unit_of
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
    figure_value,
    joined,
    sentence,
)
from busplan.forms.numbers import listed, period_value
from busplan.questions.capacity.drawing import SensitivityDrawing
from busplan.questions.capacity.next_bottleneck import next_bottleneck_record, next_bottleneck_sentence
from busplan.questions.capacity.report import capacity_document, capacity_report
from busplan.questions.capacity.sensitivity import Effect, Sensitivity, Standing
from busplan.questions.capacity.verdict import Verdict
from busplan.questions.fit.certainty import FITS, limits_behind
from busplan.questions.fit.figures import Capacity
from busplan.questions.fit.network import bus_of
from busplan.questions.words.documents import with_profile
from busplan.sections.profile import Profile

_DIGITS = 4
"""Digits of what changes: enough to see a tenth of it."""


def sensitivity_report(result: Capacity, verdicts: Sequence[Verdict], found: Sequence[Sensitivity]) -> Report:
    """Report of `capacity --sensitivity`.

    Parameters
    ----------
    result
        The capacity.
    verdicts
        One for each period.
    found
        What moves the margin, one for each period.
    """
    report = capacity_report(result, verdicts)
    return report._replace(
        blocks=lambda: (*report.blocks(), *_of_periods(found)),
        document=partial(sensitivity_document, result, verdicts, found),
        records=lambda: with_profile(result.profile.name, [row for one in found for row in _rows(one)]),
    )


def _of_periods(found: Sequence[Sensitivity]) -> Iterator[Block]:
    for one in found:
        yield from sensitivity_blocks(one)


def sensitivity_blocks(found: Sensitivity) -> Iterator[Block]:
    """What moves the margin at one period.

    Parameters
    ----------
    found
        The effects of all changes.
    """
    yield sensitivity_table(found)
    drawn = SensitivityDrawing(found)
    if not drawn.is_empty:
        change = _capital(found.effects[0].change)
        sides = "a bar to the left takes from it, one to the right adds to it"
        caption = Sentence((f"{change} moves the margin most; {sides}, in us",))
        legend = Sentence(("The red line is where nothing is left of the margin.",)) if drawn.shows_the_end else None
        yield Chart(drawn, caption, legend)
    yield _headline(found)
    yield from (Sentence((f"{_capital(one.change)}: {one.note}.",)) for one in found.effects if one.note)
    yield next_bottleneck_sentence(found.next_bottleneck, found.profile)


def sensitivity_table(found: Sensitivity) -> Table:
    """Every change with what it does to the margin, the largest effect first.

    Parameters
    ----------
    found
        The effects of all changes.
    """
    caption = sentence(
        f"What moves the margin of {{}} at {{}}, by the {found.timing_model} model",
        figure_value(MARGIN_CORRECTED, found.now.margin_corrected_us),
        period_value(found.profile.cycle.period_us),
    )
    columns = (
        TableColumn("what changes", kind="words"),
        TableColumn("from -> to", kind="words", rank=1),
        TableColumn("change", "us", group="margin"),
        TableColumn("then", "us", group="margin"),
        TableColumn("verdict then", kind="words", wraps=True),
    )
    rows = (TableRow(tuple(_cells(one, found))) for one in found.effects)
    return Table(columns, tuple(rows), caption)


def _cells(one: Effect, found: Sensitivity) -> Iterator[Cell]:
    yield one.change
    yield _step(one)
    yield ShownValue(one.margin_change_us, "margin_change_us", "us", 3, signed=True)
    then = None if one.then is None else one.then.margin_corrected_us
    yield figure_value(MARGIN_CORRECTED, then)
    yield _verdict(one.then, found.profile)


def _step(one: Effect) -> Cell:
    """From which value to which; nothing where the change has no single one."""
    if one.before is None or one.after is None:
        return ""
    before = ShownValue(one.before, one.key, digits=_DIGITS)
    after = ShownValue(one.after, one.key, unit_of(one.key), digits=_DIGITS)
    return sentence("{} -> {}", before, after)


def _verdict(then: Standing | None, profile: Profile) -> Cell:
    """The verdict with the limits that are broken, or that the bus is unsafe."""
    shown = figure_value(VERDICT, None if then is None else then.verdict)
    if then is None:
        return shown
    why = list(limits_behind(then))
    if not why and then.verdict == FITS and not then.safe:
        why = [f"unsafe {bus_of(profile).safety.setting}"]
    return Sentence((shown, *(f", {one}" for one in why)), "neutral" if _is_well(then) else "fails")


def _is_well(one: Standing) -> bool:
    return one.verdict == FITS and one.safe


def _headline(found: Sensitivity) -> Sentence:
    """Say which change moves the margin most, and after which ones all is no longer well."""
    first = found.effects[0]
    if not first.margin_change_us:
        return Sentence(("None of these changes moves the margin.",))
    then = None if first.then is None else first.then.margin_corrected_us
    most = sentence(
        f"{_capital(first.change)} moves the margin most, by {{}} to {{}}.",
        ShownValue(first.margin_change_us, "margin_change_us", "us", 3, signed=True),
        figure_value(MARGIN_CORRECTED, then),
    )
    return joined(most, *_after_each(found))


def _after_each(found: Sensitivity) -> Iterator[Sentence]:
    """Say what becomes of a cycle that is shown to fit."""
    if found.now.verdict != FITS:
        return
    made = [(one.change, one.then) for one in found.effects if one.then is not None]
    lost = [change for change, then in made if then.verdict != FITS]
    unsafe = [change for change, then in made if then.verdict == FITS and found.now.safe and not then.safe]
    if lost:
        yield Sentence((f"The cycle is no longer shown to fit after {listed(lost, 'or')}.",))
    if unsafe:
        yield Sentence((f"Its {bus_of(found.profile).safety.setting} is unsafe after {listed(unsafe, 'or')}.",))
    if not lost and not unsafe:
        yield Sentence(("The cycle is shown to fit after each of them alone.",))


def _capital(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


def sensitivity_document(result: Capacity, verdicts: Sequence[Verdict], found: Sequence[Sensitivity]) -> JsonDocument:
    """Document of `busplan capacity --sensitivity --format json`: that of `capacity`, with more in each verdict."""
    whole = capacity_document(result, verdicts)
    for verdict, one in zip(whole["verdicts"], found, strict=True):
        verdict["sensitivity"] = [_record(effect, one.profile) for effect in one.effects]
        verdict["next_bottleneck"] = next_bottleneck_record(one.next_bottleneck, one.profile)
    return whole


def _rows(found: Sensitivity) -> Iterator[Record]:
    """One row for each change."""
    for one in found.effects:
        yield {
            "period_us": found.profile.cycle.period_us,
            "timing_model": found.timing_model,
            **_record(one, found.profile),
        }


def _record(one: Effect, profile: Profile) -> Record:
    then = one.then
    safety = bus_of(profile).safety.figure
    own: dict[str, Any] = {} if safety is None else {safety.key: None if then is None else then.safe}
    return {
        "change": one.change,
        "key": one.key,
        "from": one.before,
        "to": one.after,
        "margin_change_us": one.margin_change_us,
        "margin_corrected_us": None if then is None else then.margin_corrected_us,
        "uncertainty_us": None if then is None else then.uncertainty_us,
        "verdict": None if then is None else then.verdict,
        "exceeded": None if then is None else list(then.exceeded),
        "not_shown": None if then is None else list(then.not_shown),
        **own,
        "note": one.note or None,
    }
