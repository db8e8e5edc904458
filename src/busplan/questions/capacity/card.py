"""The card of a verdict: what a person reads first."""

from collections.abc import Iterator
from math import ceil, floor, isfinite, log10
from typing import TYPE_CHECKING, Final

from busplan.buses.published import parts_tested
from busplan.buses.rule import contradicts
from busplan.elementwise import FIT_ROUNDING, plain
from busplan.forms.blocks import Card, Code, Gauge, Sentence, State, Words, joined
from busplan.forms.numbers import listed, period, plural
from busplan.profile.toml import override
from busplan.questions.capacity.verdict import Verdict
from busplan.questions.fit.assumed import heavy_assumptions
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS
from busplan.questions.fit.circle_refusal import circle_refusals
from busplan.questions.fit.figures import CapacityFigures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.constraints import most_asking, shown
from busplan.questions.plan.freedoms import PERIOD
from busplan.questions.words.sentences import broken_limits, change_meanings, settings_sentence, warnings
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.buses.cycle import Term

_FIGURES: Final = 3
"""Digits of a time whose uncertainty is unknown."""
_MOST_DECIMALS: Final = 6
"""Decimals of a time in us: what is below a picosecond is float rounding."""
_Line = tuple[str, Sentence]


def card(verdict: Verdict, profile: Profile, *, is_brief: bool = False) -> Card:
    """Say the verdict, how full the period is, what is free, what would fit, and what the verdict rests on.

    Parameters
    ----------
    verdict
        The verdict on one period.
    profile
        The network.
    is_brief
        Whether lines that are the same for every period are left out.
    """
    figures, bus = verdict.deciding, bus_of(profile)
    counts = [plural(number, noun) for number, noun in bus.counted(network_of(profile))]
    at_period = profile
    if profile.has_cycle:
        at_period = override(profile, {PERIOD: verdict.period_us})
        counts.append(period(verdict.period_us))
    subject = Sentence((Code(profile.name), f"  {bus.title}, {', '.join(counts)}"))
    lines = [
        *_reasons(verdict, at_period),
        *(_times(figures, at_period) if profile.has_cycle else ()),
        *_bus_lines(at_period),
        *_room(verdict, at_period),
    ]
    if not is_brief:
        lines += _rests_on(verdict, at_period)
    return Card(subject, _verdict(verdict), _gauge(figures, at_period), tuple(lines))


def _verdict(verdict: Verdict) -> Words:
    figures = verdict.deciding
    word = (figures.verdict or "").upper()
    but = "" if verdict.all_well or figures.verdict != FITS else ", BUT"
    state: State = "passes" if verdict.all_well else "fails" if figures.verdict == DOES_NOT_FIT or but else "warns"
    return Words(f"{word}{but}", state)


def _gauge(figures: CapacityFigures, profile: Profile) -> Gauge | None:
    if not profile.has_cycle:
        return _load_gauge(figures, profile)
    available_us, whole_us = figures.available_us, max(figures.period_us, _used_us(figures))
    return Gauge(
        used=_used_us(figures) / whole_us,
        doubt=(figures.uncertainty_us or 0.0) / whole_us,
        free_until=available_us * (1 - profile.limits.reserve) / whole_us,
        most=available_us / whole_us,
        state="passes" if figures.verdict == FITS else "fails",
    )


def _load_gauge(figures: CapacityFigures, profile: Profile) -> Gauge | None:
    """The load of a bus without a cycle; None of a kind without a limit of it."""
    limit, network = bus_of(profile).limit("load"), network_of(profile)
    if limit is None:
        return None
    load, most = plain(limit.value(network)), plain(limit.most(network))
    whole = max(1.0, load)
    return Gauge(load / whole, 0.0, most / whole, 1 / whole, "passes" if figures.verdict == FITS else "fails")


def _used_us(figures: CapacityFigures) -> float:
    """Time the cycle takes, with the bias of the model [us]."""
    return figures.available_us - (figures.margin_corrected_us or 0.0)


def _reasons(verdict: Verdict, profile: Profile) -> Iterator[_Line]:
    """Reasons beside time why the machine does not run as the profile has it."""
    figures, bus = verdict.deciding, bus_of(profile)
    for cause in circle_refusals(profile):
        yield "circle", Sentence((f"cannot be run: {cause.message}",), "fails")
    for words in broken_limits(figures, profile):
        yield "limit", Sentence((words,), "fails" if figures.verdict == DOES_NOT_FIT else "warns")
    if not figures.safe:
        yield "unsafe", Sentence((bus.safety.setting,), "fails")
    if figures.verdict == FITS:
        for need in verdict.missed_limits:
            words = need.words(ratio=profile.cycle.slice_ratio, most_us=verdict.period_us)
            yield "[limits]", Sentence((words,), "fails")


def _times(figures: CapacityFigures, profile: Profile) -> Iterator[_Line]:
    doubt_us, margin_us = figures.uncertainty_us, (figures.margin_corrected_us or 0.0)
    of_us = _us(figures.available_us, None)
    share = f"{_used_us(figures) / figures.available_us:.0%}".replace("%", " %")
    of = of_us if profile.cycle.slice_ratio == 1 else f"the {of_us} that the bus may use"
    yield "used", Sentence((f"{_us(_used_us(figures), doubt_us)} us of {of}, {share}",))
    doubt = "" if doubt_us is None else f", +/- {_us(doubt_us, doubt_us)}"
    kept_us = figures.available_us * profile.limits.reserve
    kept = f"; {_us(kept_us, doubt_us)} must stay free" if kept_us else ""
    yield ("short by" if margin_us < 0 else "free"), Sentence((f"{_us(abs(margin_us), doubt_us)} us{doubt}{kept}",))
    yield "fastest period", _fastest(profile, doubt_us)


def _fastest(profile: Profile, doubt_us: float | None) -> Sentence:
    """The shortest period at which the verdict is that it fits, up to the digits of the doubt, and what asks for it."""
    network, periods = network_of(profile), bus_of(profile).periods
    time, *others = shown(network, is_safe=False)
    least = most_asking((time, *others), ratio=profile.cycle.slice_ratio)
    if least.why:
        return Sentence(("none: no period keeps the limit",), "fails")
    time_us, least_us = (plain(periods.from_us(need.period_us(profile.cycle.slice_ratio))) for need in (time, least))
    if not isfinite(least_us):
        return Sentence(("no period that the bus allows is long enough",), "fails")
    limited = f", limited by {least.key}" if least_us > time_us else ""
    return Sentence((f"{period(least_us if periods.us else _up(least_us, doubt_us))}{limited}",))


def _bus_lines(profile: Profile) -> Iterator[_Line]:
    """Lines that only this kind of bus has."""
    bus = bus_of(profile)
    lines = bus.cycle(network_of(profile), model=bus.deciding_model).card_lines()
    return ((label, Sentence((words,))) for label, words in lines)


def _room(verdict: Verdict, profile: Profile) -> Iterator[_Line]:
    """Room for more nodes; without it the change that makes room, or that mends what is wrong."""
    figures = verdict.deciding
    spare = [(count.name or "nodes", (count.safe_nodes or 0) - count.nodes) for count in figures.counts]
    if verdict.all_well and any(number > 0 for _, number in spare):
        rooms = (
            f"{number} more{f' of {name}' if figures.groups else f' {name}'}" for name, number in spare if number > 0
        )
        yield "room for", Sentence((listed([*rooms], "or"),))
        return
    if verdict.all_well and profile.has_cycle:
        yield "room for", Sentence(("no more nodes",))
    change, label = verdict.change, "one more" if verdict.all_well else "cure"
    if change is None:
        if verdict.no_change:
            yield label, Sentence((f"none: {verdict.no_change}",))
        return
    meanings = change_meanings(bus_of(profile))
    settings = settings_sentence(change.changes, meanings=meanings, quotes=False)
    after = change.figures
    has_margin = after.margin_corrected_us is not None
    left = f", which leaves {_us(after.margin_corrected_us or 0.0, after.uncertainty_us)} us" if has_margin else ""
    untested = "; this changes the circle" if change.circle_is_untested else ""
    yield label, joined(settings, Sentence((f"{left}{untested}",)), by="")


def _rests_on(verdict: Verdict, profile: Profile) -> Iterator[_Line]:
    """The largest part, and what the verdict assumes, leaves out, or rests on without a test."""
    figures, bus = verdict.deciding, bus_of(profile)
    if figures.terms:
        largest: Term = max(figures.terms, key=lambda term: plain(term.us))
        us = _us(plain(largest.us), figures.uncertainty_us)
        yield "largest part", Sentence((f"{bus.figures.term_label(largest.name)}, {us} us",))
    for assumption in heavy_assumptions(figures, profile):
        them = "it" if len(assumption.keys) == 1 else "them"
        yield "assumed", Sentence((f"{listed(assumption.keys, 'and')}: measure {them} first",), "warns")
    cycle = bus.cycle(network_of(profile), model=bus.deciding_model)
    if left_out := cycle.left_out():
        yield "not included", Sentence((", ".join(dict.fromkeys(part.label for part in left_out)),))
    if premises := cycle.premises():
        yield "rests on", Sentence(("; ".join(premises),))
    tested = parts_tested(bus.evidence_data)
    words = "; ".join(
        filter(
            None,
            (
                ", ".join(f"{part} ({by})" for part, by in tested.parts.items()),
                f"not tested: {', '.join(tested.untested)}" if tested.untested and profile.has_cycle else "",
            ),
        )
    )
    yield "tested", Sentence((words or "not against published figures",))
    for model in verdict.others:
        if contradicts(model.fits, figures):
            said = f"{_us(model.required_us, figures.uncertainty_us)} us needed of {_us(model.available_us, None)}"
            yield f"{model.timing_model} model", Sentence((f"says otherwise, {said}, but does not decide",), "warns")
    if verdict.after_reset is not None:
        keys = ", ".join(f"{key} = {value}" for key, value in bus.safety.after_reset.items())
        yield "bus reset", Sentence((f"{verdict.after_reset.verdict} while it leaves {keys}",), "warns")
    for warning in warnings(profile, nodes=figures.nodes, most=figures.safe_nodes or 0):
        yield "beware", Sentence((warning,), "warns")


def _us(us: float, doubt_us: float | None) -> str:
    """A time in digits that its doubt allows."""
    return f"{us:.{_decimals(us, doubt_us)}f}"


def _up(us: float, doubt_us: float | None) -> float:
    """A time rounded up to the digits that its doubt allows."""
    scale: float = 10.0 ** _decimals(us, doubt_us)
    return ceil(us * scale * (1 - FIT_ROUNDING)) / scale


def _decimals(us: float, doubt_us: float | None) -> int:
    """Decimals down to the first digit of the doubt, or of three digits without one."""
    if doubt_us and isfinite(doubt_us):
        decimals = -floor(log10(doubt_us))
    else:
        decimals = _FIGURES - 1 - floor(log10(us)) if us else 0
    return min(max(0, decimals), _MOST_DECIMALS)
