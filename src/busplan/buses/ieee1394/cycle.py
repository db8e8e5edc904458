"""One communication cycle on an IEEE 1394 bus: as terms, as events, and the figures that go with it."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Final, NamedTuple

from busplan.buses.bus import BusCycle, BusEvent, BusLatency, Limit, Term
from busplan.buses.figure import AVAILABLE
from busplan.buses.ieee1394 import equations, figures
from busplan.buses.ieee1394.constants import (
    DATA_RATE_MBIT_S,
    MAX_HOPS,
    MAX_NODES,
    MAX_PAYLOAD_BYTES,
    safe_gap_count,
)
from busplan.buses.ieee1394.timing import (
    TIMING_MODELS,
    Link,
    Phases,
    TimingModelName,
    transaction,
)
from busplan.buses.network import TRANSACTION_KINDS, Group, Network, TransactionKind
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import Number, SpecialNumber, alike, named, total, worded

_LATENCY_SYMBOLS: Final = {figure.key: figure.symbol for figure in figures.LATENCY}


def hops_of(network: Network) -> Number:
    """Most cable hops [1].

    In a chain they lie between the host and the farthest node. In a tree they are `max_hops`, which the host's own way
    to a node never exceeds.
    """
    most = network.profile.bus.max_hops
    return worded(network.nodes, "N: a chain with the host at its end") if most is None else most


def gap_count_of(network: Network) -> Number:
    """Gap count in force [1]."""
    given = network.profile.bus.gap_count
    if not isinstance(given, str):
        return given
    return worded(safe_gap_count(hops_of(network)), 'g_safe, for bus.gap_count is "optimal"')


def link_of(network: Network) -> Link:
    """Rate, gap count and distance of the farthest node."""
    bus = network.profile.bus
    return Link(
        data_rate_mbit_s=alike(DATA_RATE_MBIT_S[bus.speed], network.nodes),
        gap_count=named(gap_count_of(network), "gap_count", "g"),
        hops=named(hops_of(network), "hops", "H"),
        cable_length_m=bus.cable_length_m,
    )


class Exchange(NamedTuple):
    """The same transaction with each node of a group."""

    kind: TransactionKind
    nodes: Number
    payload_bytes: Number
    phases: Phases


def exchange(
    network: Network, group: Group, kind: TransactionKind, *, model: TimingModelName, link: Link, suffix: str = ""
) -> Exchange:
    """Take the transaction of a group apart.

    Parameters
    ----------
    network
        The network.
    group
        One of its groups.
    kind
        "read" or "write".
    model
        Timing model.
    link
        The way of the packets.
    suffix
        What tells its symbols from those of other transactions in a derivation.
    """
    is_read = kind == "read"
    size = group.read_bytes if is_read else group.write_bytes
    phases = transaction(
        kind,
        model=TIMING_MODELS[model],
        link=link,
        payload_bytes=size,
        overhead_bytes=network.profile.payload.overhead_bytes,
        execution_us=group.read_execution_us if is_read else group.write_execution_us,
    )
    return Exchange(kind, group.nodes, size, _with_names(phases, suffix))


def _with_names(phases: Phases, suffix: str) -> Phases:
    """The same phases, each with its symbol if they are traced numbers."""
    if not isinstance(phases.latency_us, SpecialNumber):
        return phases
    return Phases(
        **{key: named(value, key, f"{_LATENCY_SYMBOLS[key]}{suffix}") for key, value in phases._asdict().items()}
    )


class Ieee1394Cycle(BusCycle):
    """The synchronous packet, a read and then a write of every node, and the window for non-periodic data.

    Every node is charged the hops of the farthest.

    References
    ----------
    Paper, section III-C and equations (2)-(11), Figs. 4, 5 and 7.
    """

    def __init__(self, network: Network, model: TimingModelName) -> None:
        self.network = network
        self.model = model
        self.link = link_of(network)

    @cached_property
    def exchanges(self) -> tuple[Exchange, ...]:
        """Every transaction of the cycle, group by group."""
        network, model, link = self.network, self.model, self.link
        return tuple(
            exchange(network, group, kind, model=model, link=link, suffix=f",{kind}")  # type: ignore[arg-type]
            for kind in TRANSACTION_KINDS
            for group in network.groups
        )

    @cached_property
    def sync_us(self) -> Number:
        """CTS, the synchronous packet that opens the cycle [us]."""
        sync = self.network.profile.cycle.sync
        return sync.ping_us + sync.ping_per_node_us * (self.network.nodes - 1)

    def computed_terms(self) -> tuple[Term, ...]:
        """The cycle in the order of the wire."""
        own = [(one.nodes, one.phases) for one in self.exchanges]
        return (
            Term("sync_us", self.sync_us),
            Term("cycle_arbitration_us", total(nodes * (2 * half.arbitration_us) for nodes, half in own)),
            Term("cycle_data_us", total(nodes * (half.request_data_us + half.response_data_us) for nodes, half in own)),
            Term("cycle_acknowledge_us", total(nodes * (2 * half.acknowledge_us) for nodes, half in own)),
            Term("cycle_execution_us", total(nodes * half.execution_us for nodes, half in own)),
            Term("cycle_gaps_us", total(nodes * half.gaps_us for nodes, half in own)),
            Term("nonperiodic_us", self.network.nonperiodic_us),
        )

    def figures(self) -> Mapping[str, Number]:
        """How the bus is set, the latencies, and the number of nodes as the paper has it."""
        network, (read, write) = self.network, _one_of_each(self.exchanges)
        safe = safe_gap_count(self.link.hops)
        given_us = time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)
        return {
            "hops": self.link.hops,
            "gap_count": self.link.gap_count,
            "safe_gap_count": safe,
            "gap_count_safe": self.link.gap_count >= named(safe, "safe_gap_count", "g_safe"),
            "read_latency_us": read.latency_us,
            "write_latency_us": write.latency_us,
            "read_latency_with_gaps_us": read.latency_with_gaps_us,
            "write_latency_with_gaps_us": write.latency_with_gaps_us,
            "gaps_us": read.gaps_us,
            "subaction_gap_us": read.subaction_gap_us,
            "arbitration_reset_gap_us": read.arbitration_reset_gap_us,
            "nodes_eq11": equations.published_nodes(
                named(given_us, AVAILABLE.key, AVAILABLE.symbol),
                sync_us=self.sync_us,
                latency_us=(read.latency_us + write.latency_us) / 2,
                gaps_us=read.gaps_us,
            ),
        }

    def latencies(self) -> tuple[BusLatency, ...]:
        """One read and one write of the farthest node."""
        setup = {"hops": self.link.hops, "gap_count": self.link.gap_count}
        (group,) = self.network.groups
        found = (
            exchange(self.network, group, kind, model=self.model, link=self.link)  # type: ignore[arg-type]
            for kind in TRANSACTION_KINDS
        )
        return tuple(BusLatency(one.kind, one.payload_bytes, {**setup, **one.phases._asdict()}) for one in found)

    def events(self) -> Iterator[BusEvent]:
        """The cycle in the order of its protocol, node by node."""
        yield BusEvent("sync", "sync_us", self.sync_us, "synchronous packet")
        for kind in TRANSACTION_KINDS:
            node = 0
            for one in self.exchanges:
                for _ in range(one.nodes if one.kind == kind else 0):
                    node += 1
                    for part in _parts(one.phases):
                        yield part._replace(node=node, transaction=kind)
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")


def _one_of_each(exchanges: tuple[Exchange, ...]) -> tuple[Phases, Phases]:
    """Phases of the read and of the write of the one group."""
    read, write = exchanges
    return read.phases, write.phases


def _parts(phases: Phases) -> Iterator[BusEvent]:
    """One asynchronous transaction and the gaps behind it, equations (3)-(10)."""
    arbitration, data, acknowledge, gaps = (
        f"cycle_{name}_us" for name in ("arbitration", "data", "acknowledge", "gaps")
    )
    request = (
        BusEvent("arbitration", arbitration, phases.arbitration_us, "host arbitration"),
        BusEvent("request_data", data, phases.request_data_us, "host data"),
        BusEvent("acknowledge", acknowledge, phases.acknowledge_us, "node acknowledge"),
    )
    response = (
        BusEvent("arbitration", arbitration, phases.arbitration_us, "node arbitration"),
        BusEvent("response_data", data, phases.response_data_us, "node data"),
        BusEvent("acknowledge", acknowledge, phases.acknowledge_us, "host acknowledge"),
    )
    yield from (event._replace(packet="request") for event in request)
    yield BusEvent("execution", "cycle_execution_us", phases.execution_us, "node execution")
    yield from (event._replace(packet="response") for event in response)
    yield BusEvent("subaction_gap", gaps, phases.subaction_gap_us, "subaction gap")
    yield BusEvent("arbitration_reset_gap", gaps, phases.arbitration_reset_gap_us, "arbitration reset gap")


def _most_payload(network: Network) -> Number:
    return MAX_PAYLOAD_BYTES[network.profile.bus.speed]


LIMITS: Final = (
    Limit(
        "payload",
        "a payload of {value:.0f} bytes is over the {most:.0f} bytes of {bus.speed}",
        lambda network: network.largest_payload_bytes,
        _most_payload,
        way_out="the payload fits no packet",
        failure="payload_bytes",
    ),
    Limit(
        "nodes",
        "{value:.0f} nodes are over the {most:.0f} of one bus",
        lambda network: network.nodes,
        lambda _network: MAX_NODES,
        way_out=f"a second bus has {MAX_NODES:g} more",
    ),
    Limit(
        "hops",
        "{value:.0f} hops are over the {most:.0f} of one bus",
        hops_of,
        lambda _network: MAX_HOPS,
        way_out=f"a tree with bus.max_hops = {MAX_HOPS:g} or less has room for {MAX_NODES:g} nodes",
    ),
    Limit(
        "gap table",
        "gap count {most:.0f} is unsafe for the hops; the smallest safe one is {value:.0f}",
        lambda network: safe_gap_count(hops_of(network)),
        gap_count_of,
        is_safety=True,
    ),
)
"""The standard's own limits. A gap count below the table fits, but is not safe."""
