"""The verdict of `capacity` in sentences."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from busplan.buses.figure import (
    AVAILABLE,
    BIAS,
    MARGIN_CORRECTED,
    REQUIRED,
    SAFE_AXES,
    SAFE_NODES,
    UNCERTAINTY,
    VERDICT,
    by_key,
)
from busplan.buses.rule import contradicts
from busplan.elementwise import plain
from busplan.forms.blocks import (
    Code,
    Record,
    Sentence,
    ShownValue,
    Words,
    attribute_value,
    count_value,
    joined,
    sentence,
    state_of,
)
from busplan.forms.numbers import listed, nouns, period_value
from busplan.profile.toml import override
from busplan.questions.capacity.verdict import Verdict
from busplan.questions.fit.assumed import heavy_assumptions
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS
from busplan.questions.fit.figures import CapacityFigures, GroupCapacity
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.advice import UNTESTED_CIRCLE, changeable
from busplan.questions.plan.freedoms import PERIOD
from busplan.questions.words.sentences import (
    broken_limits,
    change_meanings,
    evidence_sentence,
    execution_grades,
    execution_sentence,
    margin_parts,
    not_applicable,
    refused_circle,
    reset_sentence,
    settings_sentence,
    warning_sentences,
)
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.buses.bus import Bus


def verdict_sentences(verdict: Verdict, profile: Profile) -> Iterator[Sentence]:
    """Say the verdict, what the bus carries, the advised change, and warnings.

    Parameters
    ----------
    verdict
        The verdict.
    profile
        The network.
    """
    figures = verdict.deciding
    if profile.has_cycle:
        yield from refused_circle(override(profile, {PERIOD: verdict.period_us}))
    yield from _missed_limits(verdict, profile)
    yield _headline(verdict, profile)
    yield from not_in_it(profile)
    yield from evidence_sentence(bus_of(profile))
    yield from _other_models(verdict, profile)
    yield from reset_sentence(verdict.after_reset, profile)
    if figures.terms and not broken_limits(figures, profile):
        largest = max(figures.terms, key=lambda term: plain(term.us))
        label = by_key(bus_of(profile).figures.terms)[largest.key].label
        yield sentence(
            f"Largest term: {label}, {{}} of {{}}.",
            ShownValue(largest.us, largest.key, "us", 3),
            attribute_value(REQUIRED, figures),
        )
    if figures.counts:
        yield _carries(figures)
    has_room = verdict.all_well and any((count.safe_nodes or 0) > count.nodes for count in figures.counts)
    is_full = profile.has_cycle and not profile.group
    if not has_room and (verdict.change is not None or is_full or not verdict.all_well):
        yield _advice(verdict, profile)
    yield from _assumed(figures, profile)
    yield from warning_sentences(profile, nodes=figures.nodes, most=figures.safe_nodes or 0)


def _missed_limits(verdict: Verdict, profile: Profile) -> Iterator[Sentence]:
    """Say which keys of [limits] a cycle that fits does not hold."""
    missed = verdict.missed_limits if verdict.deciding.verdict == FITS else ()
    for need in missed:
        subject = (Code(profile.name), " at ", period_value(verdict.period_us), " does not hold its [limits]: ")
        words = need.words(ratio=profile.cycle.slice_ratio, most_us=verdict.period_us)
        yield Sentence((*subject, words, "."), "fails")


def _assumed(figures: CapacityFigures, profile: Profile) -> Iterator[Sentence]:
    """Say which assumptions carry much of the cycle or of its doubt, and how its execution time is known."""
    heavy = heavy_assumptions(figures, profile)
    if heavy:
        said = (f"{listed(assumption.keys, 'and')}, which {assumption.carries}" for assumption in heavy)
        yield Sentence((f"Assumed: {'; '.join(said)}.",), "warns")
    if not (any(assumption.is_execution for assumption in heavy) and execution_grades(profile) == "assumed"):
        yield from execution_sentence(profile)


def _headline(verdict: Verdict, profile: Profile) -> Sentence:
    is_more = verdict.deciding.circle_refused_by or verdict.missed_limits
    alone = ", the bus alone: " if is_more else ": "
    at = (" at ", period_value(verdict.period_us)) if profile.has_cycle else ()
    subject = (Code(profile.name), *at, alone)
    parts = (*subject, *verdict_story(verdict.deciding, profile).parts)
    return Sentence(parts, state_of(verdict.all_well))


def verdict_story(figures: CapacityFigures, profile: Profile) -> Sentence:
    """Say the verdict with its margin, bias, uncertainty and largest doubt.

    Parameters
    ----------
    figures
        Figures under the timing model that decides.
    profile
        The network.
    """
    limits = broken_limits(figures, profile)
    safe = (
        ""
        if figures.safe or figures.verdict == DOES_NOT_FIT
        else f", but with an unsafe {bus_of(profile).safety.setting}"
    )
    why = f", {'; '.join(limits)}" if limits else ""
    state = state_of(figures.verdict == FITS and figures.safe)
    said = sentence(f"{{}}{{}}{why}.", attribute_value(VERDICT, figures)._replace(state=state), Words(safe, state))
    if figures.margin_corrected_us is None or (limits and figures.verdict == DOES_NOT_FIT):
        return said  # whatever the time is
    sentences = [said, _margin(figures, bus_of(profile))]
    largest = next(iter(uncertainty_parts(figures)), None)
    if largest is not None and largest["share"]:
        share = ShownValue(largest["share"], "share", "%", 0)
        sentences.append(sentence(f"Largest doubt: {largest['label']}, {{}} of the variance.", share))
    if profile.limits.reserve:
        reserve = ShownValue(profile.limits.reserve, "reserve", "%", 0)
        sentences.append(sentence("{} of the slice must stay free (limits.reserve).", reserve))
    return joined(*sentences)


def uncertainty_parts(figures: CapacityFigures) -> list[Record]:
    """Parts of the uncertainty, the largest first."""
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


def _margin(figures: CapacityFigures, bus: "Bus") -> Sentence:
    """The margin of {}, as far as it is known."""
    of = attribute_value(AVAILABLE, figures)
    margin = attribute_value(MARGIN_CORRECTED, figures)
    uncertainty = attribute_value(UNCERTAINTY, figures)
    if figures.bias_us is not None:
        bias = attribute_value(BIAS, figures)
        return sentence("Margin {} +/- {} of {}, less a bias of {}.", margin, uncertainty, of, bias)
    (model,) = (model for model in bus.timing_models if model.name == bus.deciding_model)
    unknown = f"{model.error}, so no bias"
    if figures.uncertainty_us is not None:
        return sentence(f"Margin {{}} +/- {{}} of {{}}; {unknown} is corrected.", margin, uncertainty, of)
    return sentence(f"Margin {{}} of {{}}; {unknown} is corrected and no uncertainty given.", margin, of)


def not_in_it(profile: Profile) -> Iterator[Sentence]:
    """Say what the verdict leaves out, with the key that would give it, and what it rests on without one."""
    bus = bus_of(profile)
    cycle = bus.cycle(network_of(profile), model=bus.deciding_model)
    if left := cycle.left_out():
        yield Sentence((f"Not included: {', '.join(f'{missing.label} ({missing.key})' for missing in left)}.",))
    if premises := cycle.premises():
        yield Sentence((f"Rests on {'; '.join(premises)}.",))


def _other_models(verdict: Verdict, profile: Profile) -> Iterator[Sentence]:
    """Say where another timing model contradicts the verdict, and which cannot express the profile."""
    figures = verdict.deciding
    for model in verdict.others:
        if contradicts(model.fits, figures):
            needed = attribute_value(REQUIRED, model)
            available = attribute_value(AVAILABLE, model)
            text = (
                f"The {model.timing_model} model says otherwise: {{}} needed of {{}}. It does not affect the verdict."
            )
            yield sentence(text, needed, available, state="warns")
    yield from not_applicable(profile)


def _carries(figures: CapacityFigures) -> Sentence:
    safely = "" if figures.safe else " on a bus that is set safely"
    if figures.groups:
        groups = (
            sentence(
                f"{group.name} up to {{}} {nouns(group.safe_nodes or 0, 'node')} ({group.safe_limited_by})",
                _safe(group),
            )
            for group in figures.groups
        )
        return Sentence((f"Shown to fit{safely}, one group at a time: ", *joined(*groups, by=", ").parts, "."))
    return Sentence(
        (
            *(f"Shown to fit{safely}: ", *_nodes(figures.safe_nodes or 0, figures.safe_axes or 0).parts),
            f", limited by {figures.safe_limited_by}.",
        )
    )


def _safe(group: GroupCapacity) -> ShownValue:
    return count_value(group.safe_nodes or 0)


def _nodes(nodes: int, axes: int) -> Sentence:
    return sentence(
        f"{{}} {nouns(nodes, 'node')} ({{}} {nouns(axes, 'axis')})",
        count_value(nodes, SAFE_NODES.key),
        count_value(axes, SAFE_AXES.key),
    )


def _advice(verdict: Verdict, profile: Profile) -> Sentence:
    change, figures = verdict.change, verdict.deciding
    if change is None:
        return _no_advice(verdict, profile)
    settings = settings_sentence(change.changes, meanings=change_meanings(bus_of(profile)), quotes=False).parts
    first = f"{period_must_change(profile)} " if PERIOD in change.changes else ""
    untested = f"; {UNTESTED_CIRCLE}" if change.circle_is_untested else ""
    if change.nodes > figures.nodes:
        more = change.nodes - (figures.safe_nodes or 0)
        way = (
            f"{first}Cheapest way to ",
            count_value(more),
            f" more {nouns(more, 'node')}: ",
            *settings,
            ", which carries ",
        )
        carried = _nodes(change.figures.safe_nodes or 0, change.figures.safe_axes or 0).parts
        return Sentence((*way, *carried, untested, "."))
    purpose = "make it fit" if figures.verdict != FITS else "pass `check`" if figures.safe else "make it safe"
    way = (f"{first}Cheapest way to {purpose}: ", *settings)
    if change.figures.margin_corrected_us is None:
        return Sentence((*way, "."))
    return Sentence((*way, ", which leaves a margin of ", *margin_parts(change.figures), untested, "."))


def period_must_change(profile: Profile) -> str:
    """Say that nothing cheaper than another period is enough."""
    *cheaper, _ = changeable(profile)
    return f"The period must change, for no change of {listed(cheaper, 'and')} is enough."


def _no_advice(verdict: Verdict, profile: Profile) -> Sentence:
    """Say that no change is advised, and why."""
    figures = verdict.deciding
    cured = "makes it fit" if figures.verdict != FITS else "makes it safe" if not figures.safe else "passes `check`"
    purpose = "carries more nodes" if verdict.all_well else cured
    words = f"No change of {listed(changeable(profile), 'and')} {purpose}: {verdict.no_change}."
    return Sentence((words,), "neutral" if verdict.all_well else "fails")
