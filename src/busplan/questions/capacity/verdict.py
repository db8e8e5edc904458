"""The verdict on one period, and its card: the lines that sum it up in every form of output."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, sqrt
from typing import Final, NamedTuple

from busplan.buses.bus import Bus
from busplan.buses.cycle import RestsOn
from busplan.buses.network import Network
from busplan.buses.published import Tested, parts_tested
from busplan.buses.rule import contradicts
from busplan.elementwise import FIT_ROUNDING
from busplan.english import listed, nouns, plural
from busplan.errors import BusplanError
from busplan.forms import blocks
from busplan.forms.numbers import known_decimals, known_text, period
from busplan.profile.edit import short_text
from busplan.progress import Progress, ignored
from busplan.questions.base import sentences
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, TIME, is_shown_to_fit
from busplan.questions.fit.cure import NODES, AtPeriod, Changes, Cure, SettingForPeriod, Variants, cure
from busplan.questions.fit.figures import (
    CapacityFigures,
    CycleFigures,
    FitFigures,
    GroupCapacity,
    Judged,
    capacity_figures,
    reset,
    words_behind,
)
from busplan.questions.fit.graded import HeavyAssumption
from busplan.questions.fit.grid import GridPoint, fits_at
from busplan.questions.fit.needs import MissedLimit, SmallestPeriod, missed_limits
from busplan.questions.fit.network import PERIOD, changed, not_applicable
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


_BLANK: Final = blocks.Card(blocks.Sentence(()), blocks.Words(""), None, ())


@dataclass(frozen=True)
class Verdict(Judged):
    """Verdict on one period, by the timing model that decides."""

    setup: tuple[str, ...]
    """Settings of the bus in force, each in a few words."""
    counted: tuple[tuple[int, str], ...]
    """How large the network is: each number with its noun."""
    period_us: float | None
    """None for a network without a cycle."""
    figures: FitFigures
    """Figures of the timing model that decides, asked for or not."""
    others: tuple[FitFigures, ...]
    """Figures of the other models that were asked for."""
    broken_limits: tuple[str, ...]
    """By how much each limit of the bus is broken, or why it is not shown to be kept."""
    missed_limits: tuple[MissedLimit, ...]
    """Keys of [limits] that the network does not keep, each with the reason."""
    fastest: SmallestPeriod | None
    """The shortest period with the verdict "fits"; None for a network without a cycle."""
    best_register: SettingForPeriod | None
    """The setting of a register that makes this period the shortest; None if none does."""
    after_reset: FitFigures | None
    """Figures after a bus reset; None unless the cycle is shown to fit now and not after the reset."""
    assumptions: tuple[HeavyAssumption, ...]
    """Assumptions with a large share of the required time or of its variance."""
    rests_on: tuple[RestsOn, ...]
    """What the profile does not give and the verdict takes for granted, what matters most first."""
    not_applicable: Mapping[str, tuple[str, ...]]
    """Keys in the profile that a timing model has no term for, by the names of those models."""
    warnings: tuple[str, ...]
    """Warnings that hold whatever the verdict."""
    change: Change | None
    """The change that mends what is wrong, or that makes room for one more node on a full bus; None if there is room,
    or if no change is enough."""
    no_change: str
    """Why there is no change, if one was looked for."""
    card: blocks.Card = _BLANK
    """Subject, verdict and the lines that sum it up; they are written from the rest of the verdict."""
    brief_card: blocks.Card = _BLANK
    """The same without the lines that are alike for every period."""

    @property
    def models_agree(self) -> bool | None:
        """Whether `fits` is the same under every model that was asked for; None where there is no other."""
        return all(figures.fits == self.figures.fits for figures in self.others) if self.others else None

    @property
    def all_well(self) -> bool:
        """Whether the cycle is shown to fit, on a safe bus, within [limits]."""
        return self.figures.verdict == FITS and self.figures.safe and not self.missed_limits


class _Trials(NamedTuple):
    """Facts on a network that are known before the figures of what it could become."""

    deciding: FitFigures
    variants: Variants
    missed: tuple[MissedLimit, ...]
    mending: Cure
    """The change that mends what is wrong, or that makes room for one more node on a full bus."""
    mended: GridPoint | None
    """The network after that change, and with one more node where it makes room; None without a change."""
    reset: GridPoint | None
    """The network after a bus reset; None where that does not matter."""


def verdicts_of(
    points: Sequence[GridPoint], results: Sequence[tuple[FitFigures, ...]], *, progress: Progress = ignored
) -> list[Verdict]:
    """Verdicts on networks at their periods; those that differ in their period alone share what it has no part in.

    `results` has the figures of each under the timing models that were asked for.
    """
    variants: dict[object, Variants] = {}
    trials = []
    for number, (point, figures) in enumerate(zip(points, results, strict=True)):
        progress(number, len(points))
        shared = variants.setdefault(point.without(PERIOD), Variants(point.network))
        trials.append(_trials(point.network, figures, shared))
    mended = _fits_after(points, [one.mended for one in trials])
    resets = _fits_after(points, [one.reset for one in trials])
    rows = zip(results, trials, mended, resets, strict=True)
    return [_verdict(point.network, *row) for point, row in zip(points, rows, strict=True)]


def _fits_after(points: Sequence[GridPoint], changed: Sequence[GridPoint | None]) -> list[FitFigures | None]:
    """Figures of points after further changes, under the model that decides; None where there are none."""
    after = {
        place: GridPoint(point.changes | further.changes, further.network)
        for place, (point, further) in enumerate(zip(points, changed, strict=True))
        if further is not None
    }
    fits = fits_at([*after.values()], model=points[0].network.bus.deciding_model)
    found = dict(zip(after, fits, strict=True))
    return [found.get(place) for place in range(len(points))]


def _trials(network: Network, results: tuple[FitFigures, ...], variants: Variants) -> _Trials:
    model = network.bus.deciding_model
    deciding = next((result for result in results if result.timing_model == model), None) or capacity_figures(
        network, model=model
    )
    missed = missed_limits(network)
    mending, mended = _change(AtPeriod(network, variants), deciding, is_missed=bool(missed))
    after = reset(network, deciding)
    of_reset = None if after is None else GridPoint(dict(network.bus.safety.after_reset), after)
    return _Trials(deciding, variants, missed, mending, mended, of_reset)


def _verdict(
    network: Network,
    results: tuple[FitFigures, ...],
    trials: _Trials,
    mended: FitFigures | None,
    after_reset: FitFigures | None,
) -> Verdict:
    bus, deciding, variants, mending = network.bus, trials.deciding, trials.variants, trials.mending
    cycle = bus.cycle(network, model=bus.deciding_model)
    carried = deciding.safe_nodes if isinstance(deciding, CapacityFigures) else None
    verdict = Verdict(
        setup=bus.setup_words(network),
        counted=bus.counted(network),
        period_us=deciding.period_us if isinstance(deciding, CapacityFigures) else None,
        figures=deciding,
        others=tuple(result for result in results if result is not deciding),
        broken_limits=words_behind(deciding, network),
        missed_limits=trials.missed,
        fastest=variants.fastest if network.groups else None,
        best_register=variants.best_register if network.groups else None,
        after_reset=None if after_reset is None or after_reset.verdict == FITS else after_reset,
        assumptions=variants.assumptions(deciding),
        rests_on=cycle.rests_on(),
        not_applicable=not_applicable(network),
        warnings=tuple(bus.warnings(network, nodes=[n for n in (deciding.nodes, carried) if n])),
        change=None if mended is None else Change(mending.changes or {}, mended.nodes, mended),
        no_change=mending.why,
    )
    bus_lines = cycle.card_lines(lambda tried: deciding.verdict == FITS if tried is network else is_shown_to_fit(tried))
    card, brief_card = _cards(verdict, network, bus_lines=bus_lines)
    return replace(verdict, card=card, brief_card=brief_card)


def _change(target: AtPeriod, now: FitFigures, *, is_missed: bool) -> tuple[Cure, GridPoint | None]:
    """The change that mends what is wrong or makes room on a full bus for one more node, and the network after it."""
    more: Changes = {}
    if now.verdict == FITS and now.safe and not is_missed:
        if not isinstance(now, CapacityFigures) or now.safe_nodes is None or now.safe_nodes > now.nodes:
            return Cure({}), None  # there is room, or nobody said which of the groups is to grow
        if now.safe_nodes == MAX_COUNT:
            return Cure(None, f"{MAX_COUNT} nodes are the most that a profile can have"), None
        more = {NODES: now.safe_nodes + 1}
        one_more = target.after(more)
        if one_more is None:
            return Cure(None, _refusal(target.network, more)), None
        target = one_more
    mending = cure(*target)
    after = None if mending.changes is None else target.after(mending.changes)
    return mending, None if after is None else GridPoint({**more, **(mending.changes or {})}, after.network)


def _refusal(network: Network, changes: Changes) -> str:
    try:
        changed(network, changes)
    except BusplanError as error:
        return str(error)
    return ""


_CARD_WORDS: Final = 62
"""Most characters of what the verdict rests on in a line of the card."""
_Line = tuple[str, blocks.Sentence]


def _cards(
    verdict: Verdict, network: Network, *, bus_lines: Iterable[tuple[str, str]]
) -> tuple[blocks.Card, blocks.Card]:
    """Sum up the verdict, how full the period is, what is free, what would fit, and what the verdict rests on.

    The second card is without the lines that are alike for every period.
    """
    counts, cycle = [plural(number, noun) for number, noun in verdict.counted], verdict.cycle
    if cycle:
        counts.append(period(cycle.period_us))
    title = network.bus.title_of(network)
    subject = blocks.Sentence((blocks.Code(network.profile.name), f"  {title}, {', '.join(counts)}"))
    first = (
        *_reasons(verdict),
        *(_times(verdict, cycle, network) if cycle else ()),
        *((label, blocks.Sentence((words,))) for label, words in bus_lines),
        *_room(verdict, network),
        *(_buses(verdict, cycle, network.bus) if cycle else ()),
    )
    last = tuple(_caveats(verdict))
    brief = blocks.Card(subject, _word(verdict), _gauge(verdict, network), (*first, *last))
    tested = parts_tested(network.bus.evidence_for(network))
    basis, details = tuple(_basis(verdict, tested)), tuple(_details(verdict, network, tested))
    return brief._replace(lines=(*first, *basis, *last), details=details), brief


def _word(verdict: Verdict) -> blocks.Words:
    word = verdict.figures.verdict
    but = "" if verdict.all_well or word != FITS else ", BUT"
    state: blocks.State = "passes" if verdict.all_well else "fails" if word == DOES_NOT_FIT or but else "warns"
    return blocks.Words(f"{(word or '').upper()}{but}", state)


def _gauge(verdict: Verdict, network: Network) -> blocks.Gauge | None:
    cycle = verdict.cycle
    state: blocks.State = "passes" if verdict.figures.verdict == FITS else "fails"
    if cycle:
        available_us, whole_us = cycle.available_us, max(cycle.period_us, sentences.used_us(cycle))
        return blocks.Gauge(
            used=sentences.used_us(cycle) / whole_us,
            doubt=(cycle.uncertainty_us or 0.0) / whole_us,
            free_until=available_us * (1 - network.profile.limits.reserve) / whole_us,
            most=available_us / whole_us,
            state=state,
        )
    limit = network.bus.limit("load")
    if limit is None:
        return None
    load, most = limit.value(network), limit.most(network)
    whole = max(1.0, load)
    return blocks.Gauge(load / whole, 0.0, most / whole, 1 / whole, state)


def _reasons(verdict: Verdict) -> Iterator[_Line]:
    """Reasons other than time why the machine does not run as the profile has it."""
    for words in verdict.broken_limits:
        yield "limit", blocks.Sentence((words,), "fails" if verdict.figures.verdict == DOES_NOT_FIT else "warns")
    if not verdict.figures.safe:
        yield "unsafe", blocks.Sentence((verdict.figures.safety.setting,), "fails")
    if verdict.figures.verdict == FITS:
        # Of several groups with too little room, the first.
        first = {missed.key: missed.words for missed in reversed(verdict.missed_limits)}
        yield from (("[limits]", blocks.Sentence((words,), "fails")) for words in reversed(first.values()))


def _times(verdict: Verdict, cycle: CycleFigures, network: Network) -> Iterator[_Line]:
    yield from sentences.time_lines(cycle, network.profile)
    yield "fastest period", _fastest(verdict, cycle, network.bus)


def _fastest(verdict: Verdict, cycle: CycleFigures, bus: Bus) -> blocks.Sentence:
    fastest, best = verdict.fastest, verdict.best_register
    with_best = ""
    if best is not None:
        values = " and ".join(f"{key} = {short_text(value)}" for key, value in best.changes.items())
        with_best = f"; {_rounded_up(best.period_us, cycle, bus)} with {values}"
    if fastest is None or fastest.us is None:
        why = fastest.need.why if fastest else ""
        none = "none, for no period mends the limit" if _beside_limit(verdict, why) is not None else f"none: {why}"
        return blocks.Sentence((f"none{with_best}" if best else none,), "fails")
    key = fastest.need.key
    limited = "" if key == TIME else f", limited by {_limit_label(bus, key)}"
    return blocks.Sentence((f"{_rounded_up(fastest.us, cycle, bus)}{limited}{with_best}",))


def _limit_label(bus: Bus, key: str | None) -> str:
    """A limit in words: its label, or its key."""
    limit = bus.limit(key) if key else None
    return (limit and limit.label) or str(key)


def _rounded_up(us: float, cycle: CycleFigures, bus: Bus) -> str:
    """A period, rounded up to the digits that its uncertainty allows; one of the bus's list stays as it is."""
    if not bus.periods.us:
        scale = 10.0 ** known_decimals(us, cycle.uncertainty_us)
        us = ceil(us * scale * (1 - FIT_ROUNDING)) / scale
    return period(us)


_MOST_ROOMS: Final = 5
"""Groups with room that are named."""


def _room(verdict: Verdict, network: Network) -> Iterator[_Line]:
    """Room for more nodes; if there is none, the change that makes room, or that mends what is wrong."""
    cycle = verdict.cycle
    if verdict.all_well and cycle:
        spare = [(count, (count.safe_nodes or 0) - count.nodes) for count in cycle.counts]
        if rooms := [_more(count, number) for count, number in spare if number > 0]:
            others = [f"more nodes of {len(rooms) - _MOST_ROOMS} other groups"] if len(rooms) > _MOST_ROOMS + 1 else []
            yield "room for", blocks.Sentence((listed([*(rooms[:_MOST_ROOMS] if others else rooms), *others], "or"),))
            return
        yield "room for", blocks.Sentence(("no more nodes",))
    change, label = verdict.change, "one more" if verdict.all_well else "cure"
    if change is None:
        if verdict.no_change:
            rest = _beside_limit(verdict, verdict.no_change)
            why = verdict.no_change if rest is None else rest
            yield label, blocks.Sentence((f"none: {why}" if why else "none",))
        return
    meanings = sentences.change_meanings(network.bus)
    settings = sentences.settings_sentence(change.changes, meanings=meanings, quotes=False)
    then, left = change.figures, ""
    if isinstance(then, CycleFigures):
        left = f", which leaves {known_text(then.margin_corrected_us or 0.0, then.uncertainty_us)} us"
    yield label, blocks.joined(settings, blocks.Sentence((left,)), by="")


def _more(count: GroupCapacity, number: int) -> str:
    """More nodes of a group, or of all, that are shown to fit, and their axes."""
    if count.name:
        axes = (count.safe_axes or 0) - count.axes
        return f"{number:,} more {nouns(number, 'node')} of {count.name}" + (
            f" ({plural(axes, 'axis')})" if axes else ""
        )
    in_all = [
        plural(number, noun) for number, noun in ((count.safe_nodes, "node"), (count.safe_axes, "axis")) if number
    ]
    return f"{number:,} more {nouns(number, 'node')}: {', '.join(in_all)} in all"


def _beside_limit(verdict: Verdict, why: str) -> str | None:
    """Part of a reason beside the words of a limit that stand on the card already; None where it has other words."""
    for words in verdict.broken_limits:
        if why.startswith(words):
            return why.removeprefix(words).strip(" ()")
    return None


def rests_on_words(rests_on: Sequence[RestsOn], *, most: int | None) -> str:
    """Premises of a verdict in words: all, or the first that a line of some characters holds and how many more."""
    words = [*dict.fromkeys(part.words for part in rests_on)]
    if most is None or len(", ".join(words)) <= most:
        return ", ".join(words)
    for count in range(len(words) - 1, 0, -1):
        text = f"{', '.join(words[:count])} and {len(words) - count} more"
        if len(text) <= most:
            break
    return text


def _buses(verdict: Verdict, cycle: CapacityFigures, bus: Bus) -> Iterator[_Line]:
    """Number of such buses that would carry all nodes, where one is not shown to."""
    most = cycle.safe_nodes or 0
    if 0 < most < cycle.nodes:
        yield "buses", blocks.Sentence((f"{ceil(cycle.nodes / most)} such buses, of {plural(most, 'node')} or fewer",))
    elif most == 0 and cycle.verdict != FITS and not cycle.groups and not verdict.change:
        limit = _limit_label(bus, cycle.safe_limited_by)
        yield "buses", blocks.Sentence((f"no number: a single node is not shown to fit, limited by {limit}",))


def _basis(verdict: Verdict, tested: Tested) -> Iterator[_Line]:
    """The largest term and the largest doubt, and what the verdict assumes, leaves out, and was never measured."""
    if verdict.cycle:
        yield from _largest(verdict.cycle)
    if verdict.assumptions:
        yield "assumed", blocks.Sentence((_assumed_words(verdict.assumptions),), "warns")
    if verdict.rests_on:
        yield "rests on", blocks.Sentence((rests_on_words(verdict.rests_on, most=_CARD_WORDS),))
    if verdict.cycle and (never := sentences.never_measured(tested)):
        yield "never measured", blocks.Sentence((never,))


def _largest(cycle: CycleFigures) -> Iterator[_Line]:
    """What a cycle waits for, its largest term and its largest doubt."""
    waits = (f"{wait} {known_text(us, cycle.uncertainty_us)} us" for wait, us in cycle.waits_us.items() if us)
    # What is used has the correction, too.
    bias = known_text(cycle.bias_us or 0.0, cycle.uncertainty_us)
    rest = f"; correction {bias} us" if float(bias) else ""
    yield "waits for", blocks.Sentence((", ".join(waits) + rest,))
    term = max(cycle.terms, key=lambda term: term.us)
    us = known_text(term.us, cycle.uncertainty_us)
    yield "largest term", blocks.Sentence((f"{cycle.bus_figures.term_label(term.name)}, {us} us",))
    parts = uncertainty_parts(cycle)
    if parts and parts[0]["share"]:
        part_us = (cycle.uncertainty_us or 0.0) * sqrt(parts[0]["share"])
        words = f"{parts[0]['label']}, +/- {known_text(part_us, cycle.uncertainty_us)} us"
        yield "largest doubt", blocks.Sentence((words,))
    if cycle.uncertainty_us is None:
        yield "doubt", blocks.Sentence(("not known",), "warns")


def _assumed_words(assumptions: Sequence[HeavyAssumption]) -> str:
    """Assumptions that carry the verdict, and how to find their values."""
    rates = [key for assumption in assumptions for key in assumption.keys if assumption.is_bit_rate]
    others = [key for assumption in assumptions for key in assumption.keys if key not in rates]
    them = "it" if len(others) == 1 else "them"
    words = (
        f"{listed(others, 'and')}: measure {them} first" if others else "",
        f"{listed(rates, 'and')}: look it up in the configuration of the nodes" if rates else "",
    )
    return "; ".join(filter(None, words))


def _details(verdict: Verdict, network: Network, tested: Tested) -> Iterator[_Line]:
    """Lines that the answer needs only when somebody asks: the correction, the published figures, other models."""
    cycle = verdict.cycle
    if cycle and cycle.bias_us:
        words = "included in used: measured buses take this much longer than the timing model"
        yield "correction", blocks.Sentence((f"{known_text(cycle.bias_us, None)} us {words}",))
    elif cycle and cycle.bias_us is None:
        (error,) = (model.error for model in network.bus.timing_models if model.name == cycle.timing_model)
        yield "correction", blocks.Sentence((f"none: {error}",))
    yield "checked against", blocks.Sentence((sentences.checked_against(tested, with_untested=False),))
    for model, missing in verdict.not_applicable.items():
        yield f"{model} model", blocks.Sentence((f"not applicable: it has no {', '.join(missing)}",))


def _caveats(verdict: Verdict) -> Iterator[_Line]:
    """Reasons against the verdict at its period: another model, a bus reset, a warning."""
    cycle = verdict.cycle
    for other in verdict.others:
        if cycle and isinstance(other, CycleFigures) and contradicts(other.fits, cycle):
            needed_us = known_text(other.required_us, cycle.uncertainty_us)
            fits = "fits" if other.fits else "does not fit"
            words = f"{fits}: {needed_us} us of {known_text(other.available_us, None)}"
            decides = f"; the {cycle.timing_model} model decides"
            yield f"{other.timing_model} model", blocks.Sentence((f"{words}{decides}",), "warns")
    if verdict.after_reset is not None:
        keys = ", ".join(f"{key} = {value}" for key, value in verdict.after_reset.safety.after_reset.items())
        yield "bus reset", blocks.Sentence((f"{verdict.after_reset.verdict} while it leaves {keys}",), "warns")
    yield from (("beware", blocks.Sentence((warning,), "warns")) for warning in verdict.warnings)


def uncertainty_parts(cycle: CycleFigures) -> list[blocks.Record]:
    """Components of the uncertainty, the largest first."""
    whole = sum(float(doubt.us) ** 2 for doubt in cycle.doubts)
    return [
        {
            "input": doubt.key,
            "label": doubt.label,
            "standard_uncertainty_us": float(doubt.us),
            "share": float(doubt.us) ** 2 / whole if whole else 0.0,
        }
        for doubt in sorted(cycle.doubts, key=lambda doubt: -float(doubt.us))
    ]
