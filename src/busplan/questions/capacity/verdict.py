"""The verdict on one period, and its card: the lines that sum it up in every form of output."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, floor, isfinite, log10
from typing import Final, TypeAlias

from busplan.buses.cycle import LeftOut
from busplan.buses.network import Network
from busplan.buses.rule import contradicts
from busplan.elementwise import FIT_ROUNDING, plain
from busplan.english import listed, nouns, plural
from busplan.errors import BusplanError
from busplan.forms.blocks import Card, Code, Gauge, Record, Sentence, State, Words, joined
from busplan.forms.numbers import period
from busplan.profile.edit import short_text
from busplan.questions.base.sentences import change_meanings, checked_against, settings_sentence
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, TIME, is_shown_to_fit
from busplan.questions.fit.figures import (
    CapacityFigures,
    FitFigures,
    after_reset,
    capacity_figures,
    figures,
    limits_behind,
)
from busplan.questions.fit.inputs import HeavyAssumption, heavy_assumptions
from busplan.questions.fit.network import changed
from busplan.questions.plan.search import (
    NODES,
    Changes,
    SettingForPeriod,
    SmallestPeriod,
    best_register,
    cure,
    cure_by_setting,
    missed_limits,
    smallest_period,
)
from busplan.sections.base import MAX_COUNT


@dataclass(frozen=True)
class Change:
    """A change of a network, and what it achieves."""

    changes: Changes
    """New value by dotted key, the dearest change first."""
    nodes: int
    """Number of nodes after the change."""
    figures: FitFigures
    """Figures after the change, under the model that decides."""


@dataclass(frozen=True)
class Verdict:
    """Verdict on one period, by the timing model that decides."""

    network: Network
    """The network at its period."""
    period_us: float
    """None for a network without a cycle."""
    deciding: CapacityFigures
    """Figures of the timing model that decides, asked for or not."""
    others: tuple[CapacityFigures, ...]
    """Figures of the other models that were asked for."""
    broken_limits: tuple[str, ...]
    """By how much each limit of the bus is broken, or why it is not shown to be kept."""
    missed_limits: tuple[tuple[str, str], ...]
    """Keys of [limits] that the network does not keep, each with the reason."""
    fastest: SmallestPeriod | None
    """The shortest period with the verdict "fits"; None for a network without a cycle."""
    best_register: SettingForPeriod | None
    """The setting of a register that makes this period the shortest; None if none does."""
    after_reset: FitFigures | None
    """Figures after a bus reset; None unless the cycle is shown to fit now and not after the reset."""
    assumptions: tuple[HeavyAssumption, ...]
    """Assumptions with a large share of the required time or of its variance."""
    left_out: tuple[LeftOut, ...]
    """Keys not set that could add time to the cycle."""
    premises: tuple[str, ...]
    """Premises of the verdict that no key of the profile states."""
    bus_lines: tuple[tuple[str, str], ...]
    """Lines of the card that only this kind of bus has: label and words."""
    warnings: tuple[str, ...]
    """Warnings that hold whatever the verdict."""
    change: Change | None
    """The change that mends what is wrong, or that makes room for one more node on a full bus; None if there is room,
    or if no change is enough."""
    no_change: str
    """Why there is no change, if one was looked for."""
    setting: Change | None = None
    """A setting of the bus that mends what is wrong, too, where `change` is a longer period."""

    @property
    def models_agree(self) -> bool | None:
        """Whether `fits` is the same under every model that was asked for; None where there is no other."""
        return all(figures.fits == self.deciding.fits for figures in self.others) if self.others else None

    @property
    def all_well(self) -> bool:
        """Whether the cycle is shown to fit, on a safe bus, within [limits]."""
        return self.deciding.verdict == FITS and self.deciding.safe and not self.missed_limits

    @property
    def has_room(self) -> bool:
        """Whether more nodes of some group are shown to fit."""
        return any((count.safe_nodes or 0) > count.nodes for count in self.deciding.counts)


Fastest: TypeAlias = tuple[SmallestPeriod | None, SettingForPeriod | None]
"""`fastest` and `best_register` of a verdict."""


def verdict_of(network: Network, results: tuple[CapacityFigures, ...], *, fastest: Fastest | None = None) -> Verdict:
    """Judge a network at its period.

    Parameters
    ----------
    network
        The network.
    results
        Its figures under the timing models that were asked for.
    fastest
        Those of the same network at another period, if they are known: they are the same.
    """
    bus = network.bus
    model = bus.deciding_model
    deciding = next((result for result in results if result.timing_model == model), None) or capacity_figures(
        network, model=model
    )
    cycle, period_us = bus.cycle(network, model=model), deciding.period_us
    ratio = float(plain(network.slice_ratio))
    missed = {need.key: need.words(ratio=ratio, most_us=period_us) for need in missed_limits(network)}
    change, no_change = _change(network, deciding, is_missed=bool(missed))
    least, best = fastest or _fastest_of(network)
    return Verdict(
        network=network,
        period_us=period_us,
        deciding=deciding,
        others=tuple(result for result in results if result is not deciding),
        broken_limits=tuple(limit.words(network) for limit in limits_behind(deciding, network)),
        missed_limits=tuple(missed.items()),
        fastest=least,
        best_register=best,
        after_reset=after_reset(network, deciding),
        assumptions=heavy_assumptions(deciding, network),
        left_out=cycle.left_out(),
        premises=cycle.premises(),
        bus_lines=cycle.card_lines(is_shown_to_fit),
        warnings=tuple(bus.warnings(network, nodes=[n for n in (deciding.nodes, deciding.safe_nodes or 0) if n])),
        change=change,
        no_change=no_change,
        setting=None if change is None else _setting(network, deciding, change),
    )


def _fastest_of(network: Network) -> Fastest:
    """The shortest period of a network as it is set, and the setting of a register that makes it the shortest."""
    if not network.groups:
        return None, None
    least = smallest_period(network, is_safe=False, with_limits=False)
    return least, best_register(network, least)


def _change(network: Network, now: CapacityFigures, *, is_missed: bool) -> tuple[Change | None, str]:
    """The change that mends what is wrong or makes room on a full bus for one more node, or why there is none."""
    if now.verdict != FITS or not now.safe or is_missed:
        target = network
    elif now.safe_nodes is None or now.safe_nodes > now.nodes:
        return None, ""  # there is room, or nobody said which of the groups is to grow
    elif now.safe_nodes == MAX_COUNT:
        return None, f"{MAX_COUNT} nodes are the most that a profile can have"
    else:
        try:
            target = changed(network, {NODES: now.safe_nodes + 1})
        except BusplanError as error:
            return None, str(error)
    mending = cure(target)
    if mending.changes is None:
        return None, mending.why
    after = figures(changed(target, mending.changes), model=now.timing_model)
    return Change(mending.changes, int(plain(target.nodes)), after), ""


def _setting(network: Network, now: CapacityFigures, change: Change) -> Change | None:
    """A setting of the bus that mends a network, where the change is a longer period."""
    target = changed(network, {NODES: change.nodes}) if change.nodes != int(plain(network.nodes)) else network
    values = cure_by_setting(target, instead_of=change.changes)
    if values is None:
        return None
    return Change(values, change.nodes, figures(changed(target, values), model=now.timing_model))


_DIGITS: Final = 3
"""Significant digits of a time whose uncertainty is unknown."""
_MOST_DECIMALS: Final = 6
"""Most decimals of a time in us: below a picosecond there is only float rounding."""
_Line = tuple[str, Sentence]


def card(verdict: Verdict, *, is_brief: bool = False) -> Card:
    """Sum up the verdict, how full the period is, what is free, what would fit, and what the verdict rests on.

    Parameters
    ----------
    verdict
        The verdict on one period.
    is_brief
        Whether lines that are the same for every period are left out.
    """
    network, bus = verdict.network, verdict.network.bus
    counts = [plural(number, noun) for number, noun in bus.counted(network)]
    if network.groups:
        counts.append(period(verdict.period_us))
    subject = Sentence((Code(network.profile.name), f"  {bus.title_of(network)}, {', '.join(counts)}"))
    lines = [
        *_reasons(verdict),
        *(_times(verdict) if network.groups else ()),
        *((label, Sentence((words,))) for label, words in verdict.bus_lines),
        *_room(verdict),
        *_buses(verdict.deciding),
    ]
    if not is_brief:
        lines += _basis(verdict)
    lines += _caveats(verdict)
    return Card(subject, _word(verdict), _gauge(verdict), tuple(lines))


def _word(verdict: Verdict) -> Words:
    word = verdict.deciding.verdict
    but = "" if verdict.all_well or word != FITS else ", BUT"
    state: State = "passes" if verdict.all_well else "fails" if word == DOES_NOT_FIT or but else "warns"
    return Words(f"{(word or '').upper()}{but}", state)


def _gauge(verdict: Verdict) -> Gauge | None:
    figures, network = verdict.deciding, verdict.network
    state: State = "passes" if figures.verdict == FITS else "fails"
    if network.groups:
        available_us, whole_us = figures.available_us, max(figures.period_us, _used_us(figures))
        return Gauge(
            used=_used_us(figures) / whole_us,
            doubt=(figures.uncertainty_us or 0.0) / whole_us,
            free_until=available_us * (1 - network.profile.limits.reserve) / whole_us,
            most=available_us / whole_us,
            state=state,
        )
    limit = network.bus.limit("load")
    if limit is None:
        return None
    load, most = plain(limit.value(network)), plain(limit.most(network))
    whole = max(1.0, load)
    return Gauge(load / whole, 0.0, most / whole, 1 / whole, state)


def _used_us(figures: CapacityFigures) -> float:
    """Time the cycle takes, with the bias of the model [us]."""
    return figures.available_us - (figures.margin_corrected_us or 0.0)


def _reasons(verdict: Verdict) -> Iterator[_Line]:
    """Reasons other than time why the machine does not run as the profile has it."""
    for words in verdict.broken_limits:
        yield "limit", Sentence((words,), "fails" if verdict.deciding.verdict == DOES_NOT_FIT else "warns")
    if not verdict.deciding.safe:
        yield "unsafe", Sentence((verdict.network.bus.safety.setting,), "fails")
    if verdict.deciding.verdict == FITS:
        yield from (("[limits]", Sentence((words,), "fails")) for _, words in verdict.missed_limits)


def _times(verdict: Verdict) -> Iterator[_Line]:
    figures, network, given_us = verdict.deciding, verdict.network, verdict.deciding.available_us
    uncertainty_us, margin_us = figures.uncertainty_us, figures.margin_corrected_us or 0.0
    used_us, whole = _used_us(figures), _us(given_us, None)
    whole = whole if network.slice_ratio == 1 else f"the {whole} that the bus may use"
    bias = f", {_us(figures.bias_us, None)} of it bias of the model" if figures.bias_us else ""
    yield "used", Sentence((f"{_us(used_us, uncertainty_us)} us of {whole}, {_percent(used_us / given_us)}{bias}",))
    doubt = "" if uncertainty_us is None else f", +/- {_us(uncertainty_us, uncertainty_us)}"
    reserve_us = given_us * network.profile.limits.reserve
    reserve = f"; {_us(reserve_us, uncertainty_us)} must stay free" if reserve_us else ""
    margin = f"{_us(abs(margin_us), uncertainty_us)} us{doubt}"
    yield ("short by" if margin_us < 0 else "free"), Sentence((f"{margin}{reserve}",))
    yield "fastest period", _fastest(verdict)


def _fastest(verdict: Verdict) -> Sentence:
    fastest, best = verdict.fastest, verdict.best_register
    with_best = ""
    if best is not None:
        values = " and ".join(f"{key} = {short_text(value)}" for key, value in best.changes.items())
        with_best = f"; {_rounded_up(verdict, best.period_us)} with {values}"
    if fastest is None or fastest.us is None:
        why = fastest.need.why if fastest else ""
        return Sentence((f"none as set{with_best}" if best else f"none: {why}",), "fails")
    limited = "" if fastest.need.key == TIME else f", limited by {fastest.need.key}"
    as_set = " as set" if best else ""
    return Sentence((f"{_rounded_up(verdict, fastest.us)}{as_set}{limited}{with_best}",))


def _rounded_up(verdict: Verdict, us: float) -> str:
    """A period, rounded up to the digits that its uncertainty allows; one of the bus's list stays as it is."""
    if not verdict.network.bus.periods.us:
        scale = 10.0 ** _decimals(us, verdict.deciding.uncertainty_us)
        us = ceil(us * scale * (1 - FIT_ROUNDING)) / scale
    return period(us)


def _room(verdict: Verdict) -> Iterator[_Line]:
    """Room for more nodes; if there is none, the change that makes room, or that mends what is wrong."""
    figures = verdict.deciding
    if verdict.all_well and verdict.has_room:
        spare = {count.name: (count.safe_nodes or 0) - count.nodes for count in figures.counts}
        rooms = (
            f"{number} more {f'of {name}' if name else nouns(number, 'node')}"
            for name, number in spare.items()
            if number > 0
        )
        yield "room for", Sentence((listed([*rooms], "or"),))
        return
    if verdict.all_well and verdict.network.groups:
        yield "room for", Sentence(("no more nodes",))
    change, label = verdict.change, "one more" if verdict.all_well else "cure"
    if change is None:
        if verdict.no_change:
            yield label, Sentence((f"none: {verdict.no_change}",))
        return
    # The cheaper for the machine first.
    for name, one in zip((label, "or"), filter(None, (verdict.setting, change)), strict=False):
        meanings = change_meanings(verdict.network.bus)
        settings = settings_sentence(one.changes, meanings=meanings, quotes=False)
        left_us = one.figures.margin_corrected_us
        left = "" if left_us is None else f", which leaves {_us(left_us, one.figures.uncertainty_us)} us"
        yield name, joined(settings, Sentence((left,)), by="")


def _buses(figures: CapacityFigures) -> Iterator[_Line]:
    """How many such buses would carry all nodes, where one is not shown to."""
    most = figures.safe_nodes or 0
    if 0 < most < figures.nodes:
        yield "buses", Sentence((f"{ceil(figures.nodes / most)} such buses, of {plural(most, 'node')} or fewer",))


def _basis(verdict: Verdict) -> Iterator[_Line]:
    """The largest part, and what the verdict assumes, leaves out, and was checked against."""
    figures, network, bus = verdict.deciding, verdict.network, verdict.network.bus
    if figures.terms:
        largest = max(figures.terms, key=lambda term: plain(term.us))
        us = _us(plain(largest.us), figures.uncertainty_us)
        yield "largest part", Sentence((f"{bus.figures.term_label(largest.name)}, {us} us",))
    parts = uncertainty_parts(figures)
    if parts and parts[0]["share"]:
        yield "largest doubt", Sentence((f"{parts[0]['label']}, {_percent(parts[0]['share'])} of the variance",))
    if network.groups and figures.bias_us is None:
        (error,) = (model.error for model in bus.timing_models if model.name == figures.timing_model)
        uncertainty = ", no uncertainty given" if figures.uncertainty_us is None else ""
        yield "bias", Sentence((f"none corrected{uncertainty}: {error}",))
    for assumption in verdict.assumptions:
        them = "it" if len(assumption.keys) == 1 else "them"
        yield "assumed", Sentence((f"{listed(assumption.keys, 'and')}: measure {them} first",), "warns")
    if verdict.left_out:
        yield "not included", Sentence((", ".join(dict.fromkeys(part.label for part in verdict.left_out)),))
    if verdict.premises:
        yield "rests on", Sentence(("; ".join(verdict.premises),))
    yield "checked against", Sentence((checked_against(bus.evidence_for(network), has_cycle=bool(network.groups)),))
    for model in bus.timing_models:
        if missing := bus.cannot_express(network, model=model.name):
            yield f"{model.name} model", Sentence((f"not applicable: it has no {', '.join(missing)}",))


def _caveats(verdict: Verdict) -> Iterator[_Line]:
    """What speaks against the verdict at its period: another model, a bus reset, a warning."""
    deciding = verdict.deciding
    for other in verdict.others:
        if contradicts(other.fits, deciding):
            needed_us = _us(other.required_us, deciding.uncertainty_us)
            words = f"says otherwise, {needed_us} us needed of {_us(other.available_us, None)}, but does not decide"
            yield f"{other.timing_model} model", Sentence((words,), "warns")
    if verdict.after_reset is not None:
        keys = ", ".join(f"{key} = {value}" for key, value in verdict.network.bus.safety.after_reset.items())
        yield "bus reset", Sentence((f"{verdict.after_reset.verdict} while it leaves {keys}",), "warns")
    yield from (("beware", Sentence((warning,), "warns")) for warning in verdict.warnings)


def uncertainty_parts(figures: CapacityFigures) -> list[Record]:
    """Components of the uncertainty, the largest first."""
    whole = sum(float(doubt.us) ** 2 for doubt in figures.doubts)
    return [
        {
            "input": doubt.key,
            "label": doubt.label,
            "standard_uncertainty_us": float(doubt.us),
            "share": float(doubt.us) ** 2 / whole if whole else 0.0,
        }
        for doubt in sorted(figures.doubts, key=lambda doubt: -float(doubt.us))
    ]


def _percent(share: float) -> str:
    return f"{share:.0%}".replace("%", " %")


def _us(us: float, uncertainty_us: float | None) -> str:
    """A time with as many digits as its uncertainty allows."""
    return f"{us:.{_decimals(us, uncertainty_us)}f}"


def _decimals(us: float, uncertainty_us: float | None) -> int:
    """Decimals down to the first digit of the uncertainty; without one, for `_DIGITS` significant digits."""
    if uncertainty_us and isfinite(uncertainty_us):
        decimals = -floor(log10(uncertainty_us))
    else:
        decimals = _DIGITS - 1 - floor(log10(abs(us))) if us else 0
    return min(max(0, decimals), _MOST_DECIMALS)
