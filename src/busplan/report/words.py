"""Verdicts in words that a person can act on."""

from collections.abc import Iterator

from busplan.analysis.capacity import CapacityFigures, Limit
from busplan.analysis.verdict import Verdict
from busplan.ieee1394 import MAX_HOPS, MAX_NODES, REFERENCE_CABLE_M
from busplan.profile.model import Profile
from busplan.report.lines import Line, plural, us


def period(value_us: float) -> str:
    """Write a period as people say it.

    Examples
    --------
    >>> period(4000.0), period(250.0), period(1234.5)
    ('4 ms', '250 us', '1.2345 ms')
    """
    return f"{value_us / 1000:g} ms" if value_us >= 1000 else f"{value_us:g} us"  # noqa: PLR2004


def verdict_lines(verdict: Verdict, profile: Profile) -> Iterator[Line]:
    """Say what the verdict is, what the bus carries, what to change, and what to beware of."""
    yield _headline(verdict, profile)
    if not verdict.models_agree:
        yield Line(f"The {verdict.deciding.timing_model} model decides.")
    figures = verdict.deciding
    yield Line(f"Largest term: {figures.binding_term}, {us(binding_us(figures))} us of {us(figures.required_us)} us.")
    yield Line(
        f"The bus carries {_nodes(figures.max_nodes, figures.max_axes)} at this period, "
        f"limited by {figures.limited_by}."
    )
    yield _advice(verdict)
    yield from _warnings(figures, profile)


def binding_us(figures: CapacityFigures) -> float:
    """Size of the largest term [us]."""
    key = figures.binding_term
    own_key = f"{key}_us" if key in ("sync", "nonperiodic") else f"cycle_{key}_us"
    return float(getattr(figures, own_key))


def _headline(verdict: Verdict, profile: Profile) -> Line:
    subject = f"{profile.name} at {period(verdict.period_us)}"
    figures = verdict.deciding
    if not verdict.models_agree:
        stories = "; ".join(f"{one.timing_model}: {_story(one, profile)}" for one in (figures, *verdict.others))
        return Line(f"{subject}: THE MODELS DISAGREE. {stories}.", "bad")
    others = "".join(f"; {other.timing_model} agrees" for other in verdict.others)
    return Line(
        f"{subject}: {_story(figures, profile)} ({figures.timing_model} model{others}).",
        "good" if figures.fits else "bad",
    )


def _story(figures: CapacityFigures, profile: Profile) -> str:
    if figures.fits:
        return (
            f"fits, {us(figures.margin_us)} us to spare, "
            f"{figures.utilisation:.1%} of {us(figures.available_us)} us used"
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


def _nodes(nodes: int, axes: int) -> str:
    return f"{plural(nodes, 'node')} ({axes} axes)"


def _advice(verdict: Verdict) -> Line:
    change, figures = verdict.change, verdict.advised
    if change is not None:
        settings = ", ".join(f"{key} = {value}" for key, value in change.changes.items())
        most = _nodes(change.figures.max_nodes, change.figures.max_axes)
        if figures.fits:
            more = plural(change.figures.max_nodes - figures.max_nodes, "more node")
            return Line(f"Cheapest way to {more}: {settings}, which carries {most}.")
        which = "" if verdict.models_agree else f" the {figures.timing_model} model"
        spare = f"{us(change.figures.margin_us)} us to spare"
        return Line(f"Cheapest way to make it fit{which}: {settings}, which gives {spare} and {most} at most.")
    if figures.fits:
        return Line(f"No setting of the cycle carries more nodes: the standard's {figures.limited_by} end here.")
    return Line("No single kind of change makes it fit.", "bad")


def _warnings(figures: CapacityFigures, profile: Profile) -> Iterator[Line]:
    if figures.gap_count < figures.safe_gap_count:
        yield Line(
            f"Warning: gap count {figures.gap_count} is unsafe for {figures.hops} hops; "
            f"the smallest safe one is {figures.safe_gap_count}.",
            "warning",
        )
    if profile.bus.cable_length_m > REFERENCE_CABLE_M:
        yield Line(
            f"Warning: cables of {profile.bus.cable_length_m:g} m are longer than the {REFERENCE_CABLE_M:g} m "
            "that the gap-count table holds for.",
            "warning",
        )
