"""Derive the figures of `latency` and `capacity` by calling the functions of the analysis with traced numbers."""

from math import inf
from typing import Final, NamedTuple

from busplan.buses.bus import Bus
from busplan.buses.cycle import BusCycle, BusLatency, Term
from busplan.buses.figure import CERTAINTY, MAX_NODES, SAFE_NODES, by_key
from busplan.buses.network import Network
from busplan.elementwise import Number, Traced, value_of
from busplan.forms.numbers import listed
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.explain.formulas import against, result_of
from busplan.questions.fit.certainty import available_us, certainty
from busplan.questions.fit.circle_refusal import STEP
from busplan.questions.fit.figures import CapacityFigures, capacity, certainty_numbers, figures, numeric_figures
from busplan.questions.fit.inputs import traced, traced_profile
from busplan.questions.fit.network import bus_of, model_names, network_of
from busplan.questions.plan.advice import changeable
from busplan.sections.profile import Profile
from busplan.sourced import Input, Sourced, short


def latency_names(profile: Profile) -> tuple[str, ...]:
    """Names of the transactions in `latency`, or of the cycle."""
    bus = bus_of(profile)
    return tuple(latency.label for latency in bus.cycle(network_of(profile), model=bus.deciding_model).latencies())


class TracedLatencies(NamedTuple):
    """Every transaction of `latency` in traced numbers, and of how many nodes."""

    nodes: Number
    each: tuple[BusLatency, ...]


def traced_latencies(profile: Profile, *, model: str) -> TracedLatencies:
    """Every transaction of `latency` in traced numbers."""
    network = network_of(traced_profile(profile))
    return TracedLatencies(network.nodes, bus_of(profile).cycle(network, model=model).latencies())


def latency_figures(
    profile: Profile, *, model: str, kind: str, latencies: TracedLatencies | None = None
) -> dict[str, Traced]:
    """Derive every figure of one transaction of `latency`.

    Parameters
    ----------
    profile
        The network; the transaction is that of its farthest node.
    model
        Timing model.
    kind
        One of `latency_names`.
    latencies
        All of `traced_latencies`, where they are known.

    Returns
    -------
    dict
        By key, all figures of `latency`; one that this transaction does not have is None.
    """
    latencies = latencies or traced_latencies(profile, model=model)
    (latency,) = (latency for latency in latencies.each if latency.label == kind)
    numbers: dict[str, Number | None] = {
        "timing_model": chosen(model, "timing_model", "timing model asked for"),
        "transaction": chosen(kind, "transaction", "transaction asked for"),
        "payload_bytes": latency.payload_bytes,
        "nodes": latencies.nodes,
        **{key: if_finite(number) for key, number in latency.phases.items()},
    }
    return {
        figure.key: remembered(numbers.get(figure.key), figure.key, figure.symbol)
        for figure in bus_of(profile).figures.latency
    }


def if_finite(number: Number) -> Number:
    """A figure, or None with the inputs of an infinite one, which does not exist."""
    if value_of(number) == inf:
        return result_of(None, "does not exist", (number,))
    return number


def chosen(word: object, key: str, meaning: str) -> Traced:
    """Make an input from an option of the caller."""
    return Traced(word, given=Input(key, key, str(word), "", "given", "asked for", meaning))


def remembered(number: Number | None, key: str, symbol: str) -> Traced:
    """Name a traced figure; a constant becomes a line of its own."""
    if isinstance(number, Traced):
        return number.named(key, symbol)
    if isinstance(number, Sourced):
        return Traced(float(number), formula=number.meaning, numbers=short(number), parts=(number,)).named(key, symbol)
    return Traced(number, formula=short(number), numbers=short(number)).named(key, symbol)


_SENTENCES: Final = "sentences on what the command computes"
OF_DOCUMENT: Final = ("missed_limits", "verdict_after_reset", "uncertainty_parts", "not_in_it", "not_applicable")
"""Figures whose values the document of `capacity` has."""
OF_SENSITIVITY: Final = ("sensitivity", "next_bottleneck")
"""Figures that it has with --sensitivity."""
VERDICT_KEYS: Final = (
    *("models_agree", "reserve", *OF_DOCUMENT, "cheapest_change", "warnings", "text"),
    *OF_SENSITIVITY,
)


def capacity_figures(profile: Profile, *, model: str) -> dict[str, Traced]:
    """Derive every figure of `capacity` at the profile's own period.

    Parameters
    ----------
    profile
        The network.
    model
        Timing model.

    Returns
    -------
    dict
        By key, all figures of `capacity` except those of the verdict.
    """
    bus, plain = bus_of(profile), figures(profile, model=model)
    network = network_of(traced_profile(profile))
    cycle = bus.cycle(network, model=model)
    numbers: dict[str, Number] = {
        "timing_model": chosen(model, "timing_model", "timing model asked for"),
        **{term.key: term.us for term in cycle.terms},
        **{key: number for key, number in cycle.figures().items() if number is not None},
        **numeric_figures(cycle),
    }
    if not profile.has_cycle:
        numbers = {key: number for key, number in numbers.items() if getattr(plain, key) is not None}
    known = by_key(bus.figures.capacity)
    named = {
        key: remembered(if_finite(number), key, known[key].symbol) for key, number in numbers.items() if key in known
    }
    if network.is_uniform:
        named |= _most(network, plain, model=model)
    else:
        why, parts = _NO_CYCLE, _limits(bus, network)
        if profile.has_cycle:
            why, parts = _OF_GROUPS, (named["required_us"], named["available_us"])
        certain = known.keys() if model == bus.deciding_model else known.keys() - by_key(CERTAINTY).keys()
        named |= {
            key: result_of(None, why, parts) for key in certain if key not in named and getattr(plain, key) is None
        }
    named |= {
        key: result_of(None, "none for this network", (named["required_us"],))
        for key, number in cycle.figures().items()
        if number is None and key not in named
    }
    if model == bus.deciding_model:
        named |= _certainty(profile, cycle, plain)
    named |= _words(named, plain, cycle.terms, _limits(bus, network))
    named["circle_refused_by"] = result_of(
        list(plain.circle_refused_by),
        "what of the period, the servo, the circle and the delivery does not go together",
        (named["period_us"], traced(profile, STEP)) if profile.has_cycle else (),
    )
    for key, number in named.items():
        number.named(key, known[key].symbol)
    return named


_OF_GROUPS: Final = "each group of nodes has its own: see the groups of capacity"
_NO_CYCLE: Final = "none: messages alone have no cycle"


def _most(network: Network, plain: CapacityFigures, *, model: str) -> dict[str, Traced]:
    """The largest number of nodes, and what follows from it."""
    bus = bus_of(network.profile)
    # It does not depend on the profile's own: replace that by a number that is no input.
    searched = network.with_nodes(Traced((plain.max_nodes or 0) + 1))
    needed_us = bus.cycle(searched, model=model).required_us
    most = result_of(
        plain.max_nodes,
        f"a search: the largest whole N with T_need <= alpha T_s, within the limits of {_limit_names(bus)}",
        (*_limits(bus, searched), available_us(network), needed_us),
    ).named("max_nodes", MAX_NODES.symbol)
    return {
        "max_nodes": most,
        "max_axes": network.asked_nodes.node.axes * most,
        "limited_by": result_of(plain.limited_by, "a search: what keeps N_max + 1 nodes off the bus", (most,)),
    }


def _certainty(profile: Profile, cycle: BusCycle, plain: CapacityFigures) -> dict[str, Traced]:
    """Figures of how sure the verdict is; the budget of the uncertainty is its steps."""
    network, bus, known = cycle.network, bus_of(profile), by_key(CERTAINTY)
    weighed = certainty(cycle)
    for doubt in weighed.doubts:
        remembered(doubt.us, f"{doubt.key}.uncertainty_us", f"u({doubt.label})")
    numbers = certainty_numbers(weighed, cycle)
    named = {
        key: remembered(if_finite(number), key, known[key].symbol)
        for key, number in numbers.items()
        if number is not None
    }
    if network.is_uniform:
        named |= _most_safe(network, plain)
    limits = _limits(bus, network)
    if not profile.has_cycle:
        return {
            "not_shown": result_of(list(plain.not_shown or ()), "which limits are not shown to be kept", limits),
            "verdict": result_of(plain.verdict, "fits where no limit is broken", limits),
        }
    named["not_shown"] = Traced(
        list(plain.not_shown or ()),
        formula="which limits are neither broken nor shown to be kept, time among them",
        numbers=", ".join(plain.not_shown or ()) or "none",
        parts=(named["safe_required_us"], named["uncertainty_us"], *limits),
    )
    named["verdict"] = Traced(
        plain.verdict,
        formula="fits where T_safe <= alpha T_s and every limit is shown to be kept, does not fit where margin_c + U < "
        "0 or a limit is broken",
        numbers=(
            f"T_safe {short(value_of(named['safe_required_us']))}, alpha T_s {short(plain.available_us)}, margin_c + U "
            f"{short((plain.margin_corrected_us or 0) + (plain.uncertainty_us or 0))}, broken: "
            f"{', '.join(plain.exceeded) or 'none'}, not shown: {', '.join(plain.not_shown or ()) or 'none'}"
        ),
        parts=(
            named["safe_required_us"],
            named["margin_corrected_us"],
            named["uncertainty_us"],
            *limits,
        ),
    )
    return named


def _most_safe(network: Network, plain: CapacityFigures) -> dict[str, Traced]:
    """The largest number of nodes that is shown to fit, and what follows from it."""
    bus = bus_of(network.profile)
    beyond = network.with_nodes(Traced((plain.safe_nodes or 0) + 1))
    needed_us = certainty(bus.cycle(beyond, model=bus.deciding_model)).safe_required_us
    most = result_of(
        plain.safe_nodes,
        "a search: the largest whole N with T_safe <= alpha T_s, on a bus set safely for N, within the limits of "
        f"{_limit_names(bus)}",
        (*_limits(bus, beyond, with_safety=True), needed_us, available_us(network)),
    ).named("safe_nodes", SAFE_NODES.symbol)
    return {
        "safe_nodes": most,
        "safe_axes": network.asked_nodes.node.axes * most,
        "safe_limited_by": result_of(
            plain.safe_limited_by, "a search: what keeps N_safe + 1 nodes off the bus", (most,)
        ),
    }


def _limit_names(bus: Bus) -> str:
    return " and ".join(limit.key for limit in bus.limits if not limit.is_safety)


def _limits(bus: Bus, network: Network, *, with_safety: bool = False) -> tuple[Number, ...]:
    """Values, bounds and uncertainties of the limits of the bus."""
    limits = (limit for limit in bus.limits if with_safety or not limit.is_safety)
    limit_numbers = ((limit.value(network), limit.most(network), limit.uncertainty(network)) for limit in limits)
    return tuple(number for numbers in limit_numbers for number in numbers)


def _words(
    named: dict[str, Traced], plain: CapacityFigures, terms: tuple[Term, ...], limits: tuple[Number, ...]
) -> dict[str, Traced]:
    """Figures that are words or truth values."""
    if not plain.terms:
        broken = result_of(list(plain.exceeded), "which limits are broken", limits)
        return {"exceeded": broken, "fits": result_of(plain.fits, "no limit is broken", limits)}
    required, available = named["required_us"], named["available_us"]
    sizes = tuple(named[term.key] for term in terms)
    broken = Traced(
        list(plain.exceeded),
        formula="which limits are exceeded, time among them",
        numbers=", ".join(plain.exceeded) or "none",
        parts=(required, available, *limits),
    ).named("exceeded", "broken")
    return {
        "binding_term": Traced(
            plain.binding_term,
            formula=f"the largest of {', '.join(term.name for term in terms)}",
            numbers=f"the largest of {', '.join(short(size.value) for size in sizes)}",
            parts=sizes,
        ),
        "exceeded": broken,
        "fits": Traced(
            plain.fits,
            formula="T_need <= alpha T_s, and no limit is broken",
            numbers=f"{against(required.value, '<=', available.value)}, broken: {broken.numbers}",
            parts=(required, available, broken),
        ),
    }


def verdict_figure(profile: Profile, key: str, *, model: str) -> Traced:
    """Derive a figure of the verdict, which compares the models."""
    others = (name for name in model_names(profile) if name != model)
    (verdict,) = verdicts(capacity(profile, timing_models=(model, *others)))
    bus, derived = bus_of(profile), [capacity_figures(profile, model=name) for name in model_names(profile)]
    fits = tuple(figures["fits"] for figures in derived)
    judged = tuple(figures[key] for figures in derived for key in ("verdict", "safe_nodes") if key in figures)
    safety = () if bus.safety.figure is None else (bus.safety.figure.key,)
    safe = tuple(figures[key] for figures in derived for key in safety)
    if key == "models_agree":
        return result_of(verdict.models_agree, "a comparison: fits is the same under every timing model", fits)
    if key == "reserve":
        return traced(profile, "limits.reserve")
    (deciding,) = (figures for figures in derived if "uncertainty_us" in figures)
    # The report fills in the values of changes, lists and sentences.
    if key in OF_DOCUMENT:
        return result_of(None, _SENTENCES, (deciding["uncertainty_us"],))
    if key in OF_SENSITIVITY:
        words = "the cycle computed anew, after each change or without what binds"
        return result_of(None, words, (deciding["margin_corrected_us"], *judged))
    if key == "cheapest_change":
        is_for_more = verdict.change is not None and verdict.change.nodes > verdict.deciding.nodes
        purpose = "carries another node" if is_for_more else "holds every constraint of a plan"
        words = f"a search: the least change of {listed(changeable(profile), 'and')} that {purpose}"
        return result_of(None, words, (*judged, *safe))
    warned: tuple[Number, ...] = tuple(
        number
        for name, key in bus.keys.items()
        if key.warned_at is not None
        for number in (traced(profile, name), key.warned_at)
    )
    return result_of(None, _SENTENCES, (*safe, *warned) if key == "warnings" else (*fits, *judged, *safe, *warned))
