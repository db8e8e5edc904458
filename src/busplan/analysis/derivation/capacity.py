"""How the figures of `capacity` are computed: the same functions, given numbers that remember.

Only what is no operator is put into words here: comparisons, and a search's answer.
"""

from collections.abc import Mapping
from typing import Any, Final

from busplan.analysis.capacity.cycle import TERM_KEYS, Cycle, available_us, cycle
from busplan.analysis.capacity.figures import CapacityFigures, figures, numeric_figures
from busplan.analysis.capacity.node_limit import RequiredByNodes, most_nodes, required_by_nodes
from busplan.analysis.derivation.formulas import against
from busplan.analysis.derivation.inputs import traced
from busplan.analysis.derivation.latency import TracedBus, chosen, traced_bus, traced_phases
from busplan.analysis.derivation.trace import Traced, short, value_of
from busplan.analysis.quantities import FIGURES
from busplan.buses.ieee1394.constants import (
    MAX_HOPS,
    MAX_NODES,
    MAX_PAYLOAD_BYTES,
)
from busplan.buses.ieee1394.timing import (
    TimingModelName,
)
from busplan.profile.model import Profile
from busplan.sections.base import with_unchecked


def capacity_figures(profile: Profile, *, model: TimingModelName) -> dict[str, Traced]:
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
        By the keys of `FIGURES["capacity"]`, but for those of the verdict.
    """
    bus, plain = traced_bus(profile, model), figures(profile, model=model)
    where = profile
    for key in ("cycle.period_us", "cycle.slice_ratio", "node.axes"):
        where = with_unchecked(where, key, traced(profile, key))
    found: dict[str, Any] = numeric_figures(where, _cycle(profile, bus)) | {
        "timing_model": chosen(model, "timing_model", "timing model asked for"),
        "hops": bus.link.hops,
        "gap_count": bus.link.gap_count,
        "safe_gap_count": bus.safe_gap_count,
    }
    _name(found)
    found["max_nodes"] = _max_nodes(profile, found, plain)
    _name(found)
    found["max_axes"] = where.node.axes * found["max_nodes"]
    found |= _words(found, plain, limits=_limits(profile))
    _name(found)
    return found


def _name(found: Mapping[str, Any]) -> None:
    for key, figure in FIGURES["capacity"].items():
        if isinstance(found.get(key), Traced):
            found[key].named(key, figure.symbol)


def _cycle(profile: Profile, bus: TracedBus) -> Cycle:
    read, write = (
        traced_phases(profile, "read", bus=bus, of=",read"),
        traced_phases(profile, "write", bus=bus, of=",write"),
    )
    where = profile
    for name in ("ping_us", "ping_per_node_us"):
        where = with_unchecked(where, f"cycle.sync.{name}", traced(profile, f"cycle.sync.{name}"))
    nodes: Any = bus.nodes
    nonperiodic: Any = traced(profile, "cycle.nonperiodic_us")
    sync: Any = where.cycle.sync.sync_us(nodes)
    return Cycle(nodes, read, write, sync.named("sync_us", FIGURES["capacity"]["sync_us"].symbol), nonperiodic)


def _max_nodes(profile: Profile, found: Mapping[str, Any], plain: CapacityFigures) -> Traced:
    """The largest number of nodes, with the polynomial that gives it and the neighbours that prove it."""
    most, limit = most_nodes(profile.bus)
    given_us, model = available_us(profile), plain.timing_model

    def needs(nodes: int, sign: str) -> str:
        return f"T_need({nodes}) = {against(cycle(profile, model=model, nodes=nodes).required_us, sign, given_us)}"

    last, ceiling = plain.max_nodes, f"{most} nodes by {limit}"
    within = [needs(last, "<=")] if last else []
    beyond = [needs(last + 1, ">")] if plain.limited_by == "time" else [f"limit: {plain.limited_by}"]
    root: tuple[Any, ...] = ()
    if not (profile.bus.max_hops is None and isinstance(profile.bus.gap_count, str)):
        three = required_by_nodes(profile, model=model)
        coefficients = [
            Traced(value, formula=words, numbers=short(value)).named(f"c{power}_us", f"c{power}")
            for power, (value, words) in enumerate(zip(three, _COEFFICIENTS, strict=True))
        ]
        # The profile's own function, given numbers that remember; a plain 0 where nothing is to spare.
        real = RequiredByNodes(*coefficients).nodes(found["available_us"])  # type: ignore[arg-type]
        root = (real.named("nodes_real", "N_real"),) if isinstance(real, Traced) else ()
    return Traced(
        last,
        formula=f"the largest whole N with T_need(N) <= alpha T_s, at most {ceiling}",
        numbers=", ".join((*within, *beyond)),
        parts=(found["available_us"], found["required_us"], *root, MAX_NODES, MAX_HOPS),
    )


_COEFFICIENTS: Final = (
    "what does not grow with N in T_need(N) = c0 + c1 N + c2 N^2: T_npd and the first ping",
    "what grows with N: a read and a write with their gaps, and a node's share of the ping",
    "what grows with N^2: in a chain every packet crosses N hops",
)


def _limits(profile: Profile) -> tuple[Any, ...]:
    """The standard's own limits, and the payloads that one of them is for."""
    payloads = (traced(profile, "payload.read_bytes"), traced(profile, "payload.write_bytes"))
    return (*payloads, MAX_PAYLOAD_BYTES[profile.bus.speed], MAX_NODES, MAX_HOPS)


def _words(found: Mapping[str, Any], plain: CapacityFigures, *, limits: tuple[Any, ...]) -> dict[str, Traced]:
    """Figures that are words or truths."""
    required, available = found["required_us"], found["available_us"]
    gaps = (found["gap_count"], found["safe_gap_count"])
    terms = {term: found[key] for term, key in TERM_KEYS.items()}
    broken = Traced(
        list(plain.exceeded),
        formula="which of payload, nodes, hops and time is over its limit",
        numbers=", ".join(plain.exceeded) or "none",
        parts=(required, available, found["hops"], found["nodes"], *limits),
    ).named("exceeded", FIGURES["capacity"]["exceeded"].symbol)
    return {
        "gap_count_safe": Traced(
            plain.gap_count_safe,
            formula="g >= g_safe",
            numbers=" >= ".join(short(one.value) for one in gaps),
            parts=gaps,
        ),
        "binding_term": Traced(
            plain.binding_term,
            formula=f"the largest of {', '.join(terms)}",
            numbers=f"the largest of {', '.join(short(value_of(one)) for one in terms.values())}",
            parts=tuple(one for one in terms.values() if isinstance(one, Traced)),
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
