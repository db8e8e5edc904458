"""How the figures of `latency` are computed: the equations themselves, given numbers that remember.

Only what is no operator is put into words here: the table of gap counts, the sizes of packets, an execution table.
"""

from typing import Any, Final, NamedTuple

from busplan.analysis.derivation.formulas import written
from busplan.analysis.derivation.inputs import given, traced
from busplan.analysis.derivation.trace import Input, Traced, constant, short, value_of
from busplan.analysis.quantities import FIGURES
from busplan.buses.ieee1394.constants import (
    BLOCK_READ_REQUEST_BYTES,
    BLOCK_READ_RESPONSE_OVERHEAD_BYTES,
    BLOCK_WRITE_REQUEST_OVERHEAD_BYTES,
    DATA_RATE_MBIT_S,
    GAP_COUNT_TABLE_HOPS,
    MAX_GAP_COUNT,
    QUADLET_BYTES,
    QUADLET_READ_REQUEST_BYTES,
    QUADLET_READ_RESPONSE_BYTES,
    QUADLET_WRITE_REQUEST_BYTES,
    WRITE_RESPONSE_BYTES,
    gap_count_by_hops,
    padded_bytes,
)
from busplan.buses.ieee1394.timing import (
    TIMING_MODELS,
    Link,
    PacketSizes,
    Phases,
    TimingModel,
    TimingModelName,
    TransactionKind,
    transaction,
)
from busplan.profile.model import Profile
from busplan.sections.base import with_unchecked
from busplan.sourced import Sourced

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


class TracedBus(NamedTuple):
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
    bus = traced_bus(profile, model)
    return {
        "timing_model": chosen(model, "timing_model", "timing model asked for"),
        "transaction": chosen(kind, "transaction", "transaction asked for"),
        "payload_bytes": traced(profile, f"payload.{kind}_bytes"),
        "nodes": bus.nodes,
        **bus.link._asdict(),
        **traced_phases(profile, kind, bus=bus, of="")._asdict(),
    }


def chosen(word: object, key: str, meaning: str) -> Traced:
    """Give what was asked for as the start of a derivation."""
    return Traced(word, given=Input(key, key, str(word), "", "given", "asked for", meaning))


def _as_number(number: Sourced, symbol: str) -> Traced:
    """A constant that has a symbol of its own in formulas."""
    return Traced(float(number), given=constant(number, symbol=symbol))


def traced_bus(profile: Profile, model: TimingModelName) -> TracedBus:
    """What every transaction of a profile starts from under a timing model, as numbers that remember."""
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
    return TracedBus(nodes, link, _model(model), safe)


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
            other: Any = Traced(value_of(response), operation="add", parts=(payload_bytes, overhead_bytes))
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


def traced_phases(profile: Profile, kind: TransactionKind, *, bus: TracedBus, of: str) -> Phases:
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
        value_of(found), formula=in_symbols, numbers=in_numbers, parts=(payload, Traced(table.value, given=table))
    )
