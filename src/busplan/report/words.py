"""Verdicts in words that a person can act on."""

from collections.abc import Iterator
from typing import Final

from busplan.analysis.capacity.cycle import TERM_KEYS, Limit
from busplan.analysis.capacity.figures import CapacityFigures
from busplan.analysis.capacity.verdict import Verdict
from busplan.buses.ieee1394.constants import MAX_HOPS, MAX_NODES, REFERENCE_CABLE_M, safe_gap_count
from busplan.profile.bus import Ieee1394Bus
from busplan.profile.model import Profile
from busplan.report.lines import Line, plural, us

MEANING: Final = {
    "bus.max_hops": "rewired as a tree",
    "bus.nodes": "the others on a second bus",
    "bus.speed": "if all nodes can",
}
"""What a change means on the machine, where its key does not say so."""


def period(value_us: float) -> str:
    """Write a period as people say it.

    Examples
    --------
    >>> period(4000.0), period(250.0), period(1234.5), period(2e6)
    ('4 ms', '250 us', '1.2345 ms', '2 s')
    """
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if value_us >= size:
            return f"{value_us / size:.12g} {unit}"
    return f"{value_us:.12g} us"


def verdict_lines(verdict: Verdict, profile: Profile) -> Iterator[Line]:
    """Say what the verdict is, what the bus carries, what to change, and what to beware of."""
    yield _headline(verdict, profile)
    if not verdict.models_agree:
        yield Line(f"The {verdict.deciding.timing_model} model decides.")
    figures = verdict.deciding
    yield Line(f"Largest term: {figures.binding_term}, {us(binding_us(figures))} us of {us(figures.required_us)} us.")
    yield Line(_carries(verdict))
    yield _advice(verdict, profile)
    yield from execution_line(profile)
    for warning in warnings(profile, nodes=figures.nodes, most=figures.max_nodes):
        yield Line(warning, "warning")


def binding_us(figures: CapacityFigures) -> float:
    """Size of the largest term [us]."""
    return float(getattr(figures, TERM_KEYS[figures.binding_term]))


def warnings(profile: Profile, *, nodes: int, most: int) -> list[str]:
    """What to beware of, whatever the verdict: gap count, cable, hops.

    Parameters
    ----------
    profile
        The network.
    nodes
        Nodes on the bus [1].
    most
        Largest number of nodes that the report speaks of [1].
    """
    bus = profile.bus
    found = []
    for number in (nodes, most):
        hops = bus.hops(number)
        if number and bus.gap_count_for(number) < safe_gap_count(hops):
            found.append(
                f"Warning: gap count {bus.gap_count_for(number)} is unsafe for {plural(hops, 'hop')} "
                f"({plural(number, 'node')}); the smallest safe one is {safe_gap_count(hops)}{_table_limit(bus)}."
            )
            break
    if not bus.cable_is_standard:
        found.append(
            f"Warning: cables of {bus.cable_length_m:g} m are longer than the {REFERENCE_CABLE_M:g} m that the "
            "gap-count table holds for."
        )
    return found


def _table_limit(bus: Ieee1394Bus) -> str:
    """What a safe gap count is safe for, where the cables are longer."""
    return "" if bus.cable_is_standard else f" for cables of up to {REFERENCE_CABLE_M:g} m"


def execution_line(profile: Profile) -> Iterator[Line]:
    """Say how the execution time is known, wherever a figure is shown that rests on it; nothing where nobody says."""
    grade = profile.node.execution.grade
    if grade is not None:
        text = f"The execution time behind these figures is {grade}."
        yield Line(text, "warning" if grade == "assumed" else "plain")


def _headline(verdict: Verdict, profile: Profile) -> Line:
    subject = f"{profile.name} at {period(verdict.period_us)}"
    figures = verdict.deciding
    same = all(other.exceeded == figures.exceeded for other in verdict.others)
    if verdict.models_agree and same:
        others = "".join(f"; {other.timing_model} agrees" for other in verdict.others)
        text = f"{subject}: {story(figures, profile)} ({figures.timing_model} model{others})."
    else:
        loud = "" if verdict.models_agree else " THE MODELS DISAGREE."
        stories = "; ".join(f"{one.timing_model}: {story(one, profile)}" for one in verdict.all_figures)
        text = f"{subject}:{loud} {stories}."
    return Line(text, "good" if verdict.all_well else "bad")


def story(figures: CapacityFigures, profile: Profile) -> str:
    """Say of one set of figures whether it fits, and by how much or why not."""
    if figures.fits:
        safe = "" if figures.gap_count_safe else ", but only with an unsafe gap count"
        return (
            f"fits, {us(figures.margin_us)} us to spare, {figures.utilisation:.1%} of "
            f"{us(figures.available_us)} us used{safe}"
        )
    reasons = ", and ".join(_reason(limit, figures, profile) for limit in figures.exceeded)
    return f"does not fit, {reasons}"


def _reason(limit: Limit, figures: CapacityFigures, profile: Profile) -> str:
    match limit:
        case "time":
            needed = f"{us(figures.required_us)} us needed of {us(figures.available_us)} us"
            return f"{us(-figures.margin_us)} us short, {needed}"
        case "payload":
            payload = max(profile.payload.read_bytes, profile.payload.write_bytes)
            limit_bytes = profile.bus.max_payload_bytes
            return f"a payload of {payload} bytes is over the {limit_bytes} bytes of {profile.bus.speed}"
        case "nodes":
            return f"{figures.nodes} nodes are over the {MAX_NODES:g} of one bus"
        case "hops":
            return f"{figures.hops} hops are over the {MAX_HOPS:g} of one bus"


def _carries(verdict: Verdict) -> str:
    answers = dict.fromkeys((one.max_nodes, one.max_axes, one.limited_by) for one in verdict.all_figures)
    if len(answers) == 1:
        ((nodes, axes, limit),) = answers
        return f"The bus carries {_nodes(nodes, axes)}, limited by {limit}."
    stories = (
        f"{_nodes(one.max_nodes, one.max_axes)} by the {one.timing_model} model, limited by {one.limited_by}"
        for one in verdict.all_figures
    )
    return f"The bus carries {'; '.join(stories)}."


def _nodes(nodes: int, axes: int) -> str:
    return f"{plural(nodes, 'node')} ({plural(axes, 'axis')})"


def _advice(verdict: Verdict, profile: Profile) -> Line:
    change, figures = verdict.change, verdict.deciding
    if change is None:
        if not verdict.all_well:
            if all(one.fits for one in verdict.all_figures):
                return Line("No gap count is known to be safe for cables of this length.", "bad")
            return Line("No change of gap count, slice ratio, period, speed or wiring alone makes it fit.", "bad")
        if figures.limited_by == "time":
            return Line("No change of gap count, slice ratio or period alone carries more nodes.")
        limit = f"{MAX_HOPS:g} hops" if figures.limited_by == "hops" else f"{MAX_NODES:g} nodes"
        return Line(f"No setting carries more nodes: {limit} are the standard's limit.")
    settings = ", ".join(_setting(key, value) for key, value in change.changes.items())
    spare = f"{us(change.figures.margin_us)} us to spare"
    if verdict.all_well:
        more = plural(change.nodes - figures.max_nodes, "more node")
        carried = _nodes(change.nodes, change.nodes * profile.node.axes)
        return Line(f"Cheapest way to {more} ({figures.timing_model} model): {settings}, which carries {carried}.")
    models = " and ".join(one.timing_model for one in verdict.all_figures)
    purpose = "make it safe" if all(one.fits for one in verdict.all_figures) else "make it fit"
    return Line(f"Cheapest way to {purpose} ({models}): {settings}, which leaves {spare}.")


def _setting(key: str, value: object) -> str:
    meaning = f" ({MEANING[key]})" if key in MEANING else ""
    return f"{key} = {value}{meaning}"
