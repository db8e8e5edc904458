"""How the figures of `capacity` are computed: the functions of the analysis itself, given traced numbers.

Only what is no operator is put into words here: words, truths, and a search's answer.
"""

from typing import Any

from busplan.analysis.capacity.cycle import available_us, cycle_of
from busplan.analysis.capacity.figures import CapacityFigures, figures, numeric_figures
from busplan.analysis.derivation.formulas import against
from busplan.analysis.derivation.inputs import traced_profile
from busplan.analysis.derivation.latency import chosen, remembered
from busplan.analysis.derivation.trace import Traced, short
from busplan.analysis.network import bus_of, network_of
from busplan.buses.bus import Bus, Term
from busplan.buses.figure import by_key
from busplan.buses.network import Network
from busplan.sections.profile import Profile


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
        By the keys of the figures that the bus has for `capacity`, but for those of the verdict.
    """
    bus, plain = bus_of(profile), figures(profile, model=model)
    network = network_of(traced_profile(profile))
    cycle = bus.cycle(network, model=model)
    found: dict[str, Any] = {
        "timing_model": chosen(model, "timing_model", "timing model asked for"),
        **{term.key: term.us for term in cycle.terms},
        **cycle.figures(),
        **numeric_figures(cycle),
    }
    known = by_key(bus.capacity_figures)
    named = {key: remembered(number, key, known[key].symbol) for key, number in found.items() if key in known}
    limits = _limits(bus, network)
    named["max_nodes"] = _max_nodes(profile, plain, (*limits, named["available_us"], named["required_us"]))
    named["max_nodes"].named("max_nodes", known["max_nodes"].symbol)
    named["max_axes"] = network.groups[0].axes * named["max_nodes"]
    named |= _words(named, plain, cycle.terms, limits)
    for key, number in named.items():
        number.named(key, known[key].symbol)
    return named


def _max_nodes(profile: Profile, plain: CapacityFigures, parts: tuple[Any, ...]) -> Traced:
    """The largest number of nodes, with the neighbours that prove it."""
    given_us, last = available_us(network_of(profile)), plain.max_nodes

    def needs(nodes: int, sign: str) -> str:
        needed_us = cycle_of(profile, model=plain.timing_model, nodes=nodes).required_us
        return f"T_need({nodes}) = {against(needed_us, sign, given_us)}"

    within = [needs(last, "<=")] if last else []
    beyond = [needs(last + 1, ">")] if plain.limited_by == "time" else [f"limit: {plain.limited_by}"]
    limits = " and ".join(limit.key for limit in bus_of(profile).limits if not limit.is_safety)
    return Traced(
        last,
        formula=f"the largest whole N with T_need(N) <= alpha T_s, within the limits of {limits}",
        numbers=", ".join((*within, *beyond)),
        parts=parts,
    )


def _limits(bus: Bus, network: Network) -> tuple[Any, ...]:
    """The bus's own limits, and what each is for."""
    pairs = ((limit.value(network), limit.most(network)) for limit in bus.limits if not limit.is_safety)
    return tuple(one for pair in pairs for one in pair)


def _words(
    found: dict[str, Traced], plain: CapacityFigures, terms: tuple[Term, ...], limits: tuple[Any, ...]
) -> dict[str, Traced]:
    """Figures that are words or truths."""
    required, available = found["required_us"], found["available_us"]
    sizes = tuple(found[term.key] for term in terms)
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
            numbers=f"the largest of {', '.join(short(one.value) for one in sizes)}",
            parts=sizes,
        ),
        "limited_by": Traced(
            plain.limited_by,
            formula="what keeps N_max + 1 nodes off the bus",
            numbers=f"what keeps {plain.max_nodes + 1} nodes off it",
            parts=(found["max_nodes"],),
        ),
        "exceeded": broken,
        "fits": Traced(
            plain.fits,
            formula="T_need <= alpha T_s, and no limit is broken",
            numbers=f"{against(required.value, '<=', available.value)}, broken: {broken.numbers}",
            parts=(required, available, broken),
        ),
    }
