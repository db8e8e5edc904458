"""The transactions of a cycle: each with its phases, and the stretches of bus time that it is made of."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from busplan.buses.cycle import BusEvent
from busplan.buses.ieee1394 import figures
from busplan.buses.ieee1394.constants import DATA_RATE_MBIT_S, safe_gap_count
from busplan.buses.ieee1394.timing import (
    TIMING_MODELS,
    Delays,
    Link,
    Phases,
    Responder,
    TimingModelName,
    transaction,
)
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, Traced, alike, named, plain, worded
from busplan.sections.transactions import TransactionKind

if TYPE_CHECKING:
    from busplan.buses.ieee1394.idle import Answer

LATENCY_SYMBOLS: Final = {figure.key: figure.symbol for figure in figures.LATENCY}


def hops_of(network: Network) -> Number:
    """Most cable hops [1].

    In a chain they lie between the host and the farthest node. In a tree they are `max_hops`, which the host's own way
    to a node never exceeds.
    """
    most: Number | None = network.profile.bus.max_hops
    return worded(network.nodes, "N: a chain with the host at its end") if most is None else most


def gap_count_of(network: Network) -> Number:
    """Gap count in force [1]."""
    given: Number | str = network.profile.bus.gap_count
    if not isinstance(given, str):
        return given
    return worded(safe_gap_count(hops_of(network)), 'g_safe, for bus.gap_count is "optimal"')


def link_of(network: Network, hops: Number | None = None) -> Link:
    """Rate, gap count and distance of a node.

    Parameters
    ----------
    network
        The network.
    hops
        Cable hops between the host and the node [1]; by default most hops of the bus.
    """
    bus = network.profile.bus
    return Link(
        data_rate_mbit_s=alike(DATA_RATE_MBIT_S[bus.speed], network.nodes),
        gap_count=named(gap_count_of(network), "gap_count", "g"),
        hops=named(hops_of(network), "hops", "H") if hops is None else hops,
        cable_length_m=bus.cable_length_m,
        phy_delay_us=bus.phy_delay_us,
    )


def charges_own_hops(network: Network) -> bool:
    """Whether each node is charged its own way, and not that to the farthest, as a broadcast is: it goes to all."""
    return network.profile.bus.charge_hops == "own" and not is_broadcast(network)


def arbitration_hops(network: Network, link: Link) -> Number:
    """Cable hops that the arbitration of a packet is charged: to the root, which may be at the far end of the bus [1].

    Parameters
    ----------
    network
        The network.
    link
        The way of the packet.
    """
    return link.hops if network.profile.bus.root == "host" else hops_of(network)


def is_broadcast(network: Network) -> bool:
    """Whether the nodes broadcast their data, instead of being read in turn."""
    schedule: str = network.profile.cycle.schedule
    return schedule == "broadcast"


class Ways(NamedTuple):
    """Cable hops between the host and the nodes of a group that each node is charged [1]."""

    first: Number
    """Of the first node of the group."""
    mean: Number
    """Of the nodes of the group, on the mean. What grows with the hops grows by the same with each."""
    last: Number
    """Of the last node of the group."""

    def of_node(self, place: Number) -> Number:
        """Of the node at a place in its group, from 0; at the mean of places the mean of their hops."""
        return self.first if self.first is self.last else self.first + place


def ways(network: Network) -> tuple[Ways, ...]:
    """Hops of each group's nodes: in a chain their place in it, in a tree what the group says."""
    if not charges_own_hops(network):
        return (Ways(*(hops_of(network),) * 3),) * len(network.groups)
    if network.profile.bus.max_hops is not None:
        return tuple(Ways(*(group.node.hops,) * 3) for group in network.groups)
    chain: list[Ways] = []
    for group in network.groups:
        mean = (group.nodes + 1) / 2
        before = chain[-1].last if chain else None
        own = Ways(1, mean, group.nodes)
        if before is not None:
            own = Ways(before + 1, before + mean, before + group.nodes)
        chain.append(own._replace(mean=named(own.mean, "hops", f"H_mean{group.name and f',{group.name}'}")))
    return tuple(chain)


def farthest_link(network: Network, name: str) -> Link:
    """The way that the farthest node of a group is charged, by the name of the group."""
    place = next(
        place for place, group in enumerate(network.groups) if name in [member.name for member in group.members]
    )
    return link_of(network, ways(network)[place].last)


class Exchange(NamedTuple):
    """The same transaction with each node of a group."""

    kind: TransactionKind
    group: Group
    link: Link
    """The way that is charged, of the group's nodes on the mean."""
    payload_bytes: Number
    responder: Responder
    execution_uncertainty_us: Number
    """Standard uncertainty of the execution time [us]."""
    phases: Phases
    parts: tuple[BusEvent, ...]
    """Parts of the transaction in the order of the wire, without those that the answer does not have.

    The idle bus of the gaps is a single part here; `events` divides it.
    """

    @property
    def nodes(self) -> Number:
        """Nodes of the group [1]."""
        return self.group.nodes


def exchange(
    network: Network,
    group: Group,
    kind: TransactionKind,
    *,
    model: TimingModelName,
    link: Link,
    common: Delays | None = None,
    suffix: str = "",
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
    common
        The delays that all transactions share, where they have been computed.
    suffix
        Ending of its symbols in a derivation, which tells them from those of other transactions.
    """
    is_read, node = kind == "read", group.node
    size = group.read_bytes if is_read else group.write_bytes
    answer: Answer = node.read_response if is_read else node.write_response
    responder = Responder(
        execution_us=group.read_execution_us if is_read else group.write_execution_us,
        answer=answer,
        worst_extra_us=group.worst_extra_us,
        hold_us=node.response_us,
        host_us=network.profile.host.transaction_us,
    )
    phases = transaction(
        kind,
        model=TIMING_MODELS[model],
        link=link,
        payload_bytes=size,
        overhead_bytes=group.said.payload.overhead_bytes,
        responder=responder,
        alone=network.nodes == 1,
        common=common,
    )
    uncertainty_us = group.read_uncertainty_us if is_read else group.write_uncertainty_us
    phases = _with_names(phases, suffix)
    return Exchange(kind, group, link, size, responder, uncertainty_us, phases, tuple(_parts(kind, phases, answer)))


def _with_names(phases: Phases, suffix: str) -> Phases:
    """The same phases, each with its symbol if they are traced numbers."""
    if not isinstance(phases.latency_us, Traced):
        return phases
    return Phases(
        **{key: named(value, key, f"{LATENCY_SYMBOLS[key]}{suffix}") for key, value in phases._asdict().items()}
    )


Who = Literal["host", "node"]
ARBITRATION: Final = "cycle_arbitration_us"
PACKET_PARTS: Final = (ARBITRATION, "cycle_data_us", "cycle_acknowledge_us")
"""Terms whose parts are the way of a packet over the hops."""


def _parts(kind: TransactionKind, phases: Phases, answer: "Answer") -> Iterator[BusEvent]:
    def part(name: str, term: str, us: Number, label: str, packet: str | None = None) -> BusEvent:
        return BusEvent(name, f"cycle_{term}_us", us, label, transaction=kind, packet=packet)

    def packet(name: str, sender: Who, *, arbitrates: bool) -> Iterator[BusEvent]:
        data_us = phases.request_data_us if name == "request" else phases.response_data_us
        receiver: Who = "node" if sender == "host" else "host"
        if arbitrates:
            yield part("arbitration", "arbitration", phases.arbitration_us, f"{sender} arbitration", name)
        yield part(f"{name}_data", "data", data_us, f"{sender} data", name)
        yield part("acknowledge", "acknowledge", phases.acknowledge_us, f"{receiver} acknowledge", name)

    yield from packet("request", "host", arbitrates=True)
    if answer == "split":
        yield part("execution", "execution", phases.execution_us, "node execution")
        yield part("worst_extra", "worst_extra", phases.worst_extra_us, "slowest execution")
    if answer == "concatenated":
        yield part("hold", "hold", phases.hold_us, "node holds the bus")
    if answer != "unified":
        yield from packet("response", "node", arbitrates=answer == "split")
    yield part("idle", "idle", phases.idle_us, "idle bus of the gaps")
    host = part("host", "host", phases.host_us, "host's own time beyond the gaps")
    yield host._replace(rests_on="host.transaction_us")


def events(exchanged: Exchange, *, model: TimingModelName) -> Iterator[BusEvent]:
    """The parts of a transaction, of plain numbers; its idle bus is divided by idle period and gap."""
    before, behind = _added_up(exchanged.phases) if model == "paper" else _by_idle_period(exchanged)
    for part in exchanged.parts:
        if part.kind == "idle":
            yield from (gap._replace(transaction=exchanged.kind) for gap in behind)
        else:
            yield part
            if part.kind == "worst_extra":
                yield from (gap._replace(transaction=exchanged.kind) for gap in before)


_Divided = tuple[tuple[BusEvent, ...], tuple[BusEvent, ...]]
"""Idle bus of a transaction before its response, and after it."""


def _gap(kind: str, us: float, label: str) -> BusEvent:
    return BusEvent(kind, "cycle_idle_us", us, label)


def _added_up(phases: Phases) -> _Divided:
    """Both gaps after the transaction."""
    sub_us, reset_us = plain(phases.subaction_gap_us), plain(phases.arbitration_reset_gap_us)
    subaction = _gap("subaction_gap", sub_us, "subaction gap")
    return (), (subaction, _gap("arbitration_reset_gap", reset_us, "arbitration reset gap"))


def _by_idle_period(exchanged: Exchange) -> _Divided:
    """The gap that each idle period waits for, and what a faster node would take beyond."""
    phases = exchanged.phases
    sub_us, reset_us = plain(phases.subaction_gap_us), plain(phases.arbitration_reset_gap_us)
    idle_us = plain(phases.idle_us)
    if exchanged.responder.answer != "split":
        return (), (_gap("arbitration_reset_gap", idle_us, "arbitration reset gap after the transaction"),)
    execution_us = plain(phases.execution_us) + plain(phases.worst_extra_us)
    before_us = max(sub_us - execution_us, 0.0)
    behind_us = idle_us - before_us
    has_run = execution_us > reset_us
    allowance_us = behind_us - (sub_us if has_run else reset_us)
    allowance_us = allowance_us if allowance_us > _ROUNDING_US else 0.0
    gap_us = behind_us - allowance_us
    return (
        (_gap("subaction_gap", before_us, "rest of the subaction gap before the response"),),
        (
            _gap("subaction_gap", gap_us, "subaction gap after the response")
            if has_run
            else _gap("arbitration_reset_gap", gap_us, "arbitration reset gap after the response"),
            _gap("allowance", allowance_us, "allowance for a faster node"),
        ),
    )


_ROUNDING_US: Final = 1e-9
"""A difference of times below this is the rounding of floats."""
