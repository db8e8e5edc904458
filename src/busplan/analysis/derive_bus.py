"""How the figures of `latency` and `capacity` are computed: the same functions, given numbers that remember.

Only what is no operator is put into words here: the table of gap counts, the sizes of packets, a search's answer.
"""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple, get_args

from busplan.analysis.capacity import CapacityFigures, figures, numeric_figures
from busplan.analysis.cycle import Cycle, Term, available_us, cycle
from busplan.analysis.given import given, traced
from busplan.analysis.node_limit import RequiredByNodes, most_nodes, required_by_nodes
from busplan.analysis.quantities import FIGURES
from busplan.analysis.trace import Input, Traced, against, constant, short, written
from busplan.ieee1394 import (
    BLOCK_READ_REQUEST_BYTES,
    BLOCK_READ_RESPONSE_OVERHEAD_BYTES,
    BLOCK_WRITE_REQUEST_OVERHEAD_BYTES,
    DATA_RATE_MBIT_S,
    GAP_COUNT_TABLE_HOPS,
    MAX_GAP_COUNT,
    MAX_HOPS,
    MAX_NODES,
    MAX_PAYLOAD_BYTES,
    QUADLET_BYTES,
    QUADLET_READ_REQUEST_BYTES,
    QUADLET_READ_RESPONSE_BYTES,
    QUADLET_WRITE_REQUEST_BYTES,
    WRITE_RESPONSE_BYTES,
    gap_count_by_hops,
    padded_bytes,
)
from busplan.profile.model import Profile
from busplan.profile.sections import with_unchecked
from busplan.sourced import Sourced
from busplan.timing import (
    TIMING_MODELS,
    Link,
    PacketSizes,
    Phases,
    TimingModel,
    TimingModelName,
    TransactionKind,
    transaction,
)

_TERM_KEYS: Final[Mapping[Term, str]] = {
    term: f"{term}_us" if term in ("sync", "nonperiodic") else f"cycle_{term}_us" for term in get_args(Term)
}
_PLAIN_PACKETS: Final = {
    ("read", "request_bytes", True): QUADLET_READ_REQUEST_BYTES,
    ("read", "request_bytes", False): BLOCK_READ_REQUEST_BYTES,
    ("read", "response_bytes", True): QUADLET_READ_RESPONSE_BYTES,
    ("write", "request_bytes", True): QUADLET_WRITE_REQUEST_BYTES,
    ("write", "response_bytes", True): WRITE_RESPONSE_BYTES,
    ("write", "response_bytes", False): WRITE_RESPONSE_BYTES,
}
"""Packets of the standard's model of one size, by transaction, packet, and whether the payload is a quadlet."""
_BLOCK_PACKETS: Final = {
    ("read", "response_bytes"): BLOCK_READ_RESPONSE_OVERHEAD_BYTES,
    ("write", "request_bytes"): BLOCK_WRITE_REQUEST_OVERHEAD_BYTES,
}
"""Those that carry a payload, without it."""


class _Bus(NamedTuple):
    """What every transaction of a profile starts from, as numbers that remember."""

    nodes: Traced
    link: Link
    model: TimingModel
    safe_gap_count: Traced


def latency_figures(profile: Profile, *, model: TimingModelName, kind: TransactionKind) -> dict[str, Traced]:
    """Derive every figure of one transaction of `latency`.

    Parameters
    ----------
    profile
        The network; the transaction is that of its farthest node.
    model
        Timing model.
    kind
        "read" or "write".

    Returns
    -------
    dict
        By the keys of `FIGURES["latency"]`.
    """
    bus = _bus(profile, model)
    return {
        "timing_model": chosen(model, "timing_model", "timing model asked for"),
        "transaction": chosen(kind, "transaction", "transaction asked for"),
        "payload_bytes": traced(profile, f"payload.{kind}_bytes"),
        "nodes": bus.nodes,
        **bus.link._asdict(),
        **_phases(profile, kind, bus=bus, of="")._asdict(),
    }


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
    bus, plain = _bus(profile, model), figures(profile, model=model)
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


def chosen(word: object, key: str, meaning: str) -> Traced:
    """Give what was asked for as the start of a derivation."""
    return Traced(word, given=Input(key, key, str(word), "", "given", "asked for", meaning))


def _as_number(number: Sourced, symbol: str) -> Traced:
    """A constant that has a symbol of its own in formulas."""
    return Traced(float(number), given=constant(number, symbol=symbol))


def _name(found: Mapping[str, Any]) -> None:
    for key, figure in FIGURES["capacity"].items():
        if isinstance(found.get(key), Traced):
            found[key].named(key, figure.symbol)


def _bus(profile: Profile, model: TimingModelName) -> _Bus:
    bus, nodes = profile.bus, traced(profile, "bus.nodes")
    if bus.max_hops is None:
        chain = "N: a chain with the host at its end"
        hops = Traced(bus.hops(bus.nodes), formula=chain, numbers=short(bus.nodes), parts=(nodes,)).named("hops", "H")
    else:
        hops = traced(profile, "bus.max_hops")
    safe = Traced(
        gap_count_by_hops(hops.value),
        formula=f"the table of smallest safe gap counts at H hops; {MAX_GAP_COUNT} beyond it",
        numbers=f"the table at {short(hops.value)} of its {short(float(GAP_COUNT_TABLE_HOPS))} hops",
        parts=(hops, GAP_COUNT_TABLE_HOPS),
    ).named("safe_gap_count", "g_safe")
    gap_count = traced(profile, "bus.gap_count")
    if isinstance(bus.gap_count, str):
        optimal = 'g_safe, for bus.gap_count is "optimal"'
        gap_count = Traced(safe.value, formula=optimal, numbers=short(safe.value), parts=(safe, gap_count))
        gap_count.named("gap_count", "g")
    rate = _as_number(DATA_RATE_MBIT_S[bus.speed], "R")
    # The link holds what operators can compute with; its types say what they give.
    link: Any = Link(rate, gap_count, hops, traced(profile, "bus.cable_length_m"))  # type: ignore[arg-type]
    return _Bus(nodes, link, _model(model), safe)


def _model(name: TimingModelName) -> TimingModel:
    """The timing model, whose clock and packets say where they come from."""
    plain = TIMING_MODELS[name]

    def clock(data_rate_mbit_s: Any) -> Any:
        found = plain.gap_clock_mbit_s(data_rate_mbit_s)
        return _as_number(found, "C") if isinstance(found, Sourced) else found

    def packets(kind: TransactionKind, payload_bytes: Any, overhead_bytes: Any) -> Any:
        if name == "paper":
            request, response = plain.packets(kind, payload_bytes, overhead_bytes)
            # One expression gives both sizes; a packet has a name of its own.
            other: Any = Traced(_plain(response), operation="add", parts=(payload_bytes, overhead_bytes))
            return PacketSizes(request, other)
        sizes = plain.packets(kind, payload_bytes.value, overhead_bytes.value)
        return PacketSizes(*(_packet(kind, packet, size, payload_bytes) for packet, size in sizes._asdict().items()))  # type: ignore[arg-type]

    return plain._replace(gap_clock_mbit_s=clock, packets=packets)


def _packet(kind: TransactionKind, packet: str, size: float, payload: Traced) -> Traced:
    """A packet of the standard's model."""
    plain = _PLAIN_PACKETS.get((kind, packet, payload.value == QUADLET_BYTES))
    if plain is not None:
        return Traced(size, formula=plain.meaning, numbers=short(size), parts=(plain, payload))
    block = _BLOCK_PACKETS[kind, packet]
    return Traced(
        size,
        formula=f"{short(float(block))} + {payload.symbol} in whole quadlets",
        numbers=f"{short(float(block))} + {padded_bytes(payload.value)}",
        parts=(block, payload),
    )


def _phases(profile: Profile, kind: TransactionKind, *, bus: _Bus, of: str) -> Phases:
    """All phases of a transaction, each with its symbol; `of` tells those of a read and a write apart."""
    payload: Any = traced(profile, f"payload.{kind}_bytes")
    overhead: Any = traced(profile, "payload.overhead_bytes")
    found = transaction(
        kind,
        model=bus.model,
        link=bus.link,
        payload_bytes=payload,
        overhead_bytes=overhead,
        execution_us=_execution_us(profile, payload),
    )
    for key, value in found._asdict().items():
        value.named(key, f"{FIGURES['latency'][key].symbol}{of}")
    return found


def _execution_us(profile: Profile, payload: Any) -> Any:
    where, key = profile, "node.execution"
    execution = profile.node.execution
    if execution.kind == "linear":
        for name in ("base_us", "per_byte_us"):
            where = with_unchecked(where, f"{key}.{name}", traced(profile, f"{key}.{name}"))
        return where.node.execution.execution_us(payload)
    # The table's own function interpolates; at a payload that the table has, there is nothing to compute.
    found = execution.execution_us(payload)
    in_symbols, in_numbers = (
        (written(found, in_numbers=False), written(found, in_numbers=True))
        if isinstance(found, Traced)
        else (f"the table at {payload.symbol}", f"the table at {short(payload.value)} bytes")
    )
    table = given(profile, f"{key}.time_us")._replace(symbol="table", value=f"{len(execution.time_us)} points")
    return Traced(
        _plain(found), formula=in_symbols, numbers=in_numbers, parts=(payload, Traced(table.value, given=table))
    )


def _cycle(profile: Profile, bus: _Bus) -> Cycle:
    read, write = (
        _phases(profile, "read", bus=bus, of=",read"),
        _phases(profile, "write", bus=bus, of=",write"),
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
    terms = {term: found[key] for term, key in _TERM_KEYS.items()}
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
            numbers=f"the largest of {', '.join(short(_plain(one)) for one in terms.values())}",
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


def _plain(one: Any) -> Any:
    return one.value if isinstance(one, Traced) else one
