"""The verdict of `capacity` in sentences."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from busplan.analysis.capacity.assumed import heavy_assumptions
from busplan.analysis.capacity.certainty import DOES_NOT_FIT, FITS, limits_behind
from busplan.analysis.capacity.cycle import TIME
from busplan.analysis.capacity.figures import CapacityFigures, GroupCapacity
from busplan.analysis.capacity.verdict import Verdict
from busplan.analysis.circle.refusal import circle_refusals
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.advice import UNTESTED_CIRCLE, changeable
from busplan.analysis.planning.freedoms import PERIOD
from busplan.answers.key_values import settings_sentence
from busplan.buses.figure import (
    AVAILABLE,
    BIAS,
    MARGIN,
    MARGIN_CORRECTED,
    REQUIRED,
    SAFE_AXES,
    SAFE_NODES,
    UNCERTAINTY,
    UTILISATION,
    VERDICT,
    by_key,
)
from busplan.buses.published import parts_tested
from busplan.buses.rule import contradicts
from busplan.elementwise import plain
from busplan.forms.blocks import (
    Code,
    Part,
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
    yield from refused_circle(override(profile, {PERIOD: verdict.period_us}))
    yield from _missed_limits(verdict, profile)
    yield _headline(verdict, profile)
    yield from not_in_it(profile)
    yield from evidence_sentence(bus_of(profile))
    yield from _other_models(verdict, profile)
    yield from reset_sentence(verdict.after_reset, profile)
    if not _broken_limits(figures, profile):
        largest = max(figures.terms, key=lambda term: plain(term.us))
        label = by_key(bus_of(profile).term_figures)[largest.key].label
        yield sentence(
            f"Largest term: {label}, {{}} of {{}}.",
            ShownValue(largest.us, largest.key, "us", 3),
            attribute_value(REQUIRED, figures),
        )
    yield _carries(figures)
    if verdict.change is not None or not (verdict.all_well and profile.group):
        yield _advice(verdict, profile)
    yield from _assumed(figures, profile)
    yield from warning_sentences(profile, nodes=figures.nodes, most=figures.safe_nodes or 0)


def refused_circle(profile: Profile) -> Iterator[Sentence]:
    """Say why the circle that a profile asks for cannot be run; nothing where it can.

    It stands first in every answer with a verdict: a plan whose circle nobody can run is none.
    """
    causes = circle_refusals(profile)
    if causes:
        subject = ("The circle of ", Code(profile.name), " cannot be run at ", period_value(profile.cycle.period_us))
        yield Sentence((*subject, ": ", ", and ".join(cause.message for cause in causes), "."), "fails")


def _missed_limits(verdict: Verdict, profile: Profile) -> Iterator[Sentence]:
    """Say which keys of [limits] a cycle that fits does not hold."""
    missed = verdict.missed_limits if verdict.deciding.verdict == FITS else ()
    for need in missed:
        subject = (Code(profile.name), " at ", period_value(verdict.period_us), " does not hold its [limits]: ")
        words = need.words(ratio=profile.cycle.slice_ratio, most_us=verdict.period_us)
        yield Sentence((*subject, words, "."), "fails")


def warnings(profile: Profile, *, nodes: int, most: int) -> list[str]:
    """Warnings, whatever the verdict.

    Parameters
    ----------
    profile
        The network.
    nodes
        Nodes on the bus [1].
    most
        Largest number of nodes in the report [1]; 0 if it has none.
    """
    return bus_of(profile).warnings(network_of(profile), nodes=[number for number in (nodes, most) if number])


def warning_sentences(profile: Profile, *, nodes: int, most: int) -> Iterator[Sentence]:
    """Warnings as sentences; see `warnings`."""
    return (Sentence((words,), "warns") for words in warnings(profile, nodes=nodes, most=most))


def _assumed(figures: CapacityFigures, profile: Profile) -> Iterator[Sentence]:
    """Say which assumptions carry much of the cycle or of its doubt, and how its execution time is known."""
    heavy = heavy_assumptions(figures, profile)
    if heavy:
        said = (f"{listed(one.keys, 'and')}, which {one.carries}" for one in heavy)
        yield Sentence((f"Assumed: {'; '.join(said)}.",), "warns")
    if not (any(one.is_execution for one in heavy) and execution_grades(profile) == "assumed"):
        yield from execution_sentence(profile)


def execution_sentence(profile: Profile, *, of_latency: bool = False) -> Iterator[Sentence]:
    """Say how the execution time behind the figures is known; nothing without a grade, or where none is in them.

    Parameters
    ----------
    profile
        The network.
    of_latency
        Whether the figures are latencies, and not those of the cycle.
    """
    grades, bus, network = execution_grades(profile), bus_of(profile), network_of(profile)
    has_execution = bus.latency_has_execution(network) if of_latency else bus.has_execution(network)
    if grades is not None and has_execution:
        text = f"The execution time behind these figures is {grades}."
        yield sentence(text, state="warns" if "assumed" in grades else "neutral")


def execution_grades(profile: Profile) -> str | None:
    """Grade of the execution time; where groups differ, each with the groups that have it. None without a grade."""
    names: dict[str, list[str]] = {}
    for one in profile.alike_nodes:
        names.setdefault(one.node.execution.grade or "without a grade", []).append(one.name)
    if len(names) == 1:
        return profile.alike_nodes[0].node.execution.grade  # type: ignore[no-any-return]
    return ", ".join(f"{grade} of {' and '.join(each)}" for grade, each in names.items())


def _headline(verdict: Verdict, profile: Profile) -> Sentence:
    is_more = verdict.deciding.circle_refused_by or verdict.missed_limits
    alone = ", the bus alone: " if is_more else ": "
    subject = (Code(profile.name), " at ", period_value(verdict.period_us), alone)
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
    limits = _broken_limits(figures, profile)
    safe = "" if figures.safe or figures.verdict == DOES_NOT_FIT else f", but with an unsafe {bus_of(profile).safety}"
    why = f", {'; '.join(limits)}" if limits else ""
    state = state_of(figures.verdict == FITS and figures.safe)
    said = sentence(f"{{}}{{}}{why}.", attribute_value(VERDICT, figures)._replace(state=state), Words(safe, state))
    if limits and figures.verdict == DOES_NOT_FIT:
        return said  # whatever the time is
    found = [said, _margin(figures, bus_of(profile))]
    largest = next(iter(uncertainty_parts(figures)), None)
    if largest is not None and largest["share"]:
        share = ShownValue(largest["share"], "share", "%", 0)
        found.append(sentence(f"Largest doubt: {largest['label']}, {{}} of U squared.", share))
    if profile.limits.reserve:
        reserve = ShownValue(profile.limits.reserve, "reserve", "%", 0)
        found.append(sentence("{} of the slice must stay free (limits.reserve).", reserve))
    return joined(*found)


def uncertainty_parts(figures: CapacityFigures) -> list[Record]:
    """What the uncertainty is made of, the largest first."""
    whole = sum(float(one.us) ** 2 for one in figures.doubts)
    return [
        {
            "input": one.key,
            "label": one.label,
            "standard_uncertainty_us": float(one.us),
            "share": float(one.us) ** 2 / whole if whole else 0.0,
        }
        for one in sorted(figures.doubts, key=lambda one: -float(one.us))
    ]


def _margin(figures: CapacityFigures, bus: "Bus") -> Sentence:
    """The margin of {}, as far as it is known."""
    of = attribute_value(AVAILABLE, figures)
    margin = attribute_value(MARGIN_CORRECTED, figures)
    uncertainty = attribute_value(UNCERTAINTY, figures)
    if figures.bias_us is not None:
        bias = attribute_value(BIAS, figures)
        return sentence("Margin {} +/- {} of {}, less a bias of {}.", margin, uncertainty, of, bias)
    unknown = f"{bus.model_error}, so no bias"
    if figures.uncertainty_us is not None:
        return sentence(f"Margin {{}} +/- {{}} of {{}}; {unknown} is in it.", margin, uncertainty, of)
    return sentence(f"Margin {{}} of {{}}; {unknown} and no uncertainty are in it.", margin, of)


def _broken_limits(figures: CapacityFigures, profile: Profile) -> list[str]:
    """Say by how much each limit of the bus is broken, or why it is not shown to be kept."""
    broken = map(bus_of(profile).limit, limits_behind(figures))
    network = network_of(profile)._replace(period_us=figures.period_us)
    return [limit.words(network) for limit in broken if limit is not None]


def not_in_it(profile: Profile) -> Iterator[Sentence]:
    """Say what the verdict leaves out, with the key that would say it; nothing if it leaves nothing out."""
    bus = bus_of(profile)
    left = bus.cycle(network_of(profile), model=bus.deciding_model).left_out()
    if left:
        yield Sentence((f"Not in it: {', '.join(f'{one.label} ({one.key})' for one in left)}.",))


def evidence_sentence(bus: "Bus") -> Iterator[Sentence]:
    """Say by part what of a kind figures of others set and test; nothing where they test all of it."""
    found = parts_tested(bus.evidence_data)
    kind = f"{bus.title} (kind {bus.kind})"
    if not found.parts:
        yield Sentence((f"No figure that others have published or measured tests the model of {kind}.",))
    elif found.untested:
        said = {"set by figures of others": found.set_by, "tested by others": found.parts}
        each = (
            f"{how}: {', '.join(f'{part} ({by})' for part, by in parts.items())}"
            for how, parts in said.items()
            if parts
        )
        yield Sentence((f"Of {kind} {'; '.join(each)}; not tested: {', '.join(found.untested)}.",))


def _other_models(verdict: Verdict, profile: Profile) -> Iterator[Sentence]:
    """Say where another timing model contradicts the verdict, and which cannot express the profile."""
    figures = verdict.deciding
    for other in verdict.others:
        if contradicts(other.fits, figures):
            needed = attribute_value(REQUIRED, other)
            available = attribute_value(AVAILABLE, other)
            text = f"The {other.timing_model} model says otherwise: {{}} needed of {{}}. It decides nothing."
            yield sentence(text, needed, available, state="warns")
    yield from not_applicable(profile)


def not_applicable(profile: Profile) -> Iterator[Sentence]:
    """Say which timing models cannot express a profile, and why."""
    bus = bus_of(profile)
    for model in bus.timing_models:
        keys = bus.cannot_express(network_of(profile), model=model.name)
        if keys:
            yield Sentence((f"The {model.name} model is not applicable: it has no {', '.join(keys)}.",))


def reset_sentence(after: CapacityFigures | None, profile: Profile) -> Iterator[Sentence]:
    """Say that a plan stops fitting at a bus reset; nothing if it does not."""
    if after is not None:
        keys = ", ".join(f"{key} = {value}" for key, value in bus_of(profile).reset_changes.items())
        text = f"After a bus reset, with {keys} until it is set again, the verdict is: {after.verdict}."
        yield sentence(text, state="warns")


def story(figures: CapacityFigures, profile: Profile) -> tuple[Part, ...]:
    """Say what a cycle leaves of its slice under one timing model, or what it lacks; no verdict.

    Parameters
    ----------
    figures
        The figures.
    profile
        The network.
    """
    available = attribute_value(AVAILABLE, figures)
    if figures.fits:
        used = attribute_value(UTILISATION, figures)._replace(decimals=1)
        return sentence("{} to spare, {} of {} used", attribute_value(MARGIN, figures), used, available).parts
    short = ShownValue(-figures.margin_us, MARGIN.key, "us", 3)
    reasons = [Sentence((words,)) for words in _broken_limits(figures, profile)]
    if TIME in figures.exceeded:
        reasons.append(sentence("{} short, {} needed of {}", short, attribute_value(REQUIRED, figures), available))
    return joined(*reasons, by=", and ").parts


def _carries(figures: CapacityFigures) -> Sentence:
    safely = "" if figures.safe else " on a bus that is set safely"
    if figures.groups:
        each = (
            sentence(f"{one.name} up to {{}} {nouns(one.safe_nodes or 0, 'node')} ({one.safe_limited_by})", _safe(one))
            for one in figures.groups
        )
        return Sentence((f"Shown to fit{safely}, one group at a time: ", *joined(*each, by=", ").parts, "."))
    return Sentence(
        (
            *(f"Shown to fit{safely}: ", *_nodes(figures.safe_nodes or 0, figures.safe_axes or 0).parts),
            f", limited by {figures.safe_limited_by}.",
        )
    )


def _safe(one: GroupCapacity) -> ShownValue:
    return count_value(one.safe_nodes or 0)


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
    settings = settings_sentence(change.changes, meanings=bus_of(profile).change_meanings, quotes=False).parts
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
    way = (f"{first}Cheapest way to {purpose}: ", *settings, ", which leaves a margin of ")
    return Sentence((*way, *margin_parts(change.figures), untested, "."))


def margin_parts(figures: CapacityFigures) -> tuple[Part, ...]:
    """A corrected margin with its uncertainty, as far as that is known.

    Parameters
    ----------
    figures
        Figures under the timing model that decides.
    """
    margin, doubt = (attribute_value(one, figures) for one in (MARGIN_CORRECTED, UNCERTAINTY))
    return (margin,) if figures.uncertainty_us is None else (margin, " +/- ", doubt)


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
