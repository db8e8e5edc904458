"""Settings of the bus that its packets depend on, and the transactions of the individual schedule."""

from collections.abc import Iterator
from typing import Final, NamedTuple, Self

from busplan.buses.cycle import BusEvent
from busplan.buses.ieee1394.constants import BETA_SPEEDS, c, safe_gap_count
from busplan.buses.ieee1394.timing import Answer, Delays, Link, Phases, Responder, TimingModelName, transaction
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, named, step, worded
from busplan.sections.base import TransactionKind


def is_broadcast(network: Network) -> bool:
    """Whether the nodes broadcast their data instead of being read in turn."""
    schedule: str = network.profile.cycle.schedule
    return schedule == "broadcast"


@step("H", "hops")
def hops_of(network: Network) -> Number:
    """Largest number of cable hops [1].

    In a chain they lie between the host and the farthest node. In a tree they are `max_hops`, which the path from the
    host to a node never exceeds.
    """
    most: Number | None = network.profile.bus.max_hops
    return worded(network.nodes, "N: a chain with the host at its end") if most is None else most


def has_gaps(network: Network) -> bool:
    """Whether the bus arbitrates with gaps, as up to S400."""
    return network.profile.bus.speed not in BETA_SPEEDS


@step("g_safe", "safe_gap_count")
def safe_gap_count_of(network: Network) -> Number:
    """Smallest safe gap count for the hops [1]; 0 without gaps."""
    return safe_gap_count(hops_of(network)) if has_gaps(network) else 0


@step("g", "gap_count")
def gap_count_of(network: Network) -> Number:
    """Gap count in force [1]; 0 without gaps."""
    if not has_gaps(network):
        return 0
    given: Number | str = network.profile.bus.gap_count
    if not isinstance(given, str):
        return given
    return worded(safe_gap_count(hops_of(network)), 'g_safe, for bus.gap_count is "optimal"')


def link_of(network: Network) -> Link:
    """Link to the farthest node: rate, gap count and hops."""
    bus = network.profile.bus
    return Link(
        data_rate_mbit_s=c.by_key("DATA_RATE_MBIT_S")[bus.speed],
        gap_count=gap_count_of(network),
        hops=hops_of(network),
        cable_length_m=bus.cable_length_m,
        phy_delay_us=bus.phy_delay_us,
        has_gaps=has_gaps(network),
    )


def charges_own_hops(network: Network) -> bool:
    """Whether each node is charged its own hops, not those of the farthest; a broadcast goes to all nodes.

    A lower bound counts no more hops than a node's own.
    """
    is_own = network.profile.bus.charge_hops == "own" or not has_gaps(network)
    return is_own and not is_broadcast(network)


class GroupHops(NamedTuple):
    """Cable hops between the host and the nodes of a group, where each node is charged its own [1]."""

    first: Number
    mean: Number
    """Mean hops: times are linear in the hops, so `nodes` times the mean is the group's sum."""
    last: Number
    are_alike: bool = False
    """Whether all nodes have the same hops."""

    @classmethod
    def alike(cls, hops: Number) -> Self:
        """The same hops for all nodes of a group."""
        return cls(hops, hops, hops, are_alike=True)

    def of_node(self, place: Number) -> Number:
        """Hops of the node at a place in its group, counted from 0; at the mean place the mean hops [1]."""
        return self.first if self.are_alike else self.first + place


def group_hops(network: Network) -> tuple[GroupHops, ...]:
    """Hops of each group [1]: in a chain the places of its nodes, in a tree the group's `hops`, else 1."""
    if network.profile.bus.max_hops is not None:
        return tuple(GroupHops.alike(getattr(group.node, "hops", None) or 1) for group in network.groups)
    chain: list[GroupHops] = []
    for group in network.groups:
        hops = GroupHops(1, (group.nodes + 1) / 2, group.nodes)
        if chain:
            before = chain[-1].last
            hops = GroupHops(before + 1, before + hops.mean, before + group.nodes)
        symbol = f"H_mean{group.name and f',{group.name}'}"
        chain.append(hops._replace(mean=named(hops.mean, "hops", symbol)))
    return tuple(chain)


def answers_split(group: Group) -> bool:
    """Whether a group answers reads or writes split: only then is the execution of its nodes on the bus."""
    return "split" in (group.node.read_response, group.node.write_response)


class Exchange(NamedTuple):
    """One transaction that is made with each node of a group."""

    kind: TransactionKind
    group: Group
    delays: Delays
    """Delays that are charged, for the mean node of the group."""
    payload_bytes: Number
    responder: Responder
    execution_uncertainty_us: Number
    """Standard uncertainty of the execution time [us]."""
    phases: Phases
    parts: tuple[BusEvent, ...]
    """Parts of the transaction in the order of the wire; parts that its answer does not have are left out.

    The idle bus of the gaps is a single part here; `events` divides it.
    """

    @property
    def nodes(self) -> Number:
        """Nodes of the group with which it is made: none where there is no data [1]."""
        return self.group.nodes_with(self.kind)


def exchange(
    network: Network, group: Group, kind: TransactionKind, *, model: TimingModelName, delays: Delays
) -> Exchange:
    """The transaction `kind` of a group, taken apart into its phases."""
    is_read, node = kind == "read", group.node
    answer: Answer = node.read_response if is_read else node.write_response
    payload_bytes = group.bytes_of(kind)
    responder = Responder(
        execution_us=group.read_execution_us if is_read else group.write_execution_us,
        answer=answer,
        worst_extra_us=group.worst_extra_us,
        hold_us=node.response_us,
        host_us=network.profile.host.transaction_us,
    )
    phases = transaction(
        kind,
        model=model,
        delays=delays,
        payload_bytes=payload_bytes,
        responder=responder,
        overhead_bytes=group.payload.overhead_bytes,
    )
    uncertainty_us = group.read_uncertainty_us if is_read else group.write_uncertainty_us
    parts = tuple(_parts(kind, phases, answer))
    return Exchange(kind, group, delays, payload_bytes, responder, uncertainty_us, phases, parts)


ARBITRATION: Final = "cycle_arbitration_us"
PACKET_PARTS: Final = (ARBITRATION, "cycle_data_us", "cycle_acknowledge_us")
"""Terms whose parts are charged the hops of a packet."""


def _parts(kind: TransactionKind, phases: Phases, answer: Answer) -> Iterator[BusEvent]:
    def part(name: str, term: str, us: Number, label: str, packet: str | None = None) -> BusEvent:
        return BusEvent(name, f"cycle_{term}_us", us, label, transaction=kind, packet=packet)

    yield part("arbitration", "arbitration", phases.arbitration_us, "host arbitration", "request")
    yield part("request_data", "data", phases.request_data_us, "host data", "request")
    yield part("acknowledge", "acknowledge", phases.acknowledge_us, "node acknowledge", "request")
    if answer == "split":
        yield part("execution", "execution", phases.execution_us, "node execution")
        yield part("worst_extra", "worst_extra", phases.worst_extra_us, "slowest execution")
        yield part("arbitration", "arbitration", phases.arbitration_us, "node arbitration", "response")
    if answer == "concatenated":
        yield part("hold", "hold", phases.hold_us, "node holds the bus")
    if answer != "unified":
        yield part("response_data", "data", phases.response_data_us, "node data", "response")
        yield part("acknowledge", "acknowledge", phases.acknowledge_us, "host acknowledge", "response")
    yield part("idle", "idle", phases.idle_us, "idle bus of the gaps")
    host = part("host", "host", phases.host_us, "host's own time beyond the gaps")
    yield host._replace(rests_on="host.transaction_us")


def events(exchanged: Exchange, *, model: TimingModelName) -> Iterator[BusEvent]:
    """Events of a transaction, in plain numbers; its idle bus is divided into idle periods and gaps."""
    before, behind = _idle_periods(exchanged, model)
    for part in exchanged.parts:
        if part.kind == "idle":
            yield from behind
        else:
            yield part
            if part.kind == "worst_extra":
                yield from before


_ROUNDING_US: Final = 1e-9
"""Differences of times below this are rounding of floats."""


def _idle_periods(exchanged: Exchange, model: TimingModelName) -> tuple[list[BusEvent], list[BusEvent]]:
    """Idle bus before the response of a transaction, and after it: gaps and the allowance for a faster node."""
    phases = exchanged.phases
    sub_us, reset_us = phases.subaction_gap_us, phases.arbitration_reset_gap_us
    idle_us = phases.idle_us

    def gap(kind: str, us: float, label: str) -> BusEvent:
        return BusEvent(kind, "cycle_idle_us", us, label, transaction=exchanged.kind)

    if model == "paper":
        return [], [
            gap("subaction_gap", sub_us, "subaction gap"),
            gap("arbitration_reset_gap", reset_us, "arbitration reset gap"),
        ]
    if exchanged.responder.answer != "split":
        return [], [gap("arbitration_reset_gap", idle_us, "arbitration reset gap after the transaction")]
    execution_us = phases.execution_us + phases.worst_extra_us
    before_us = max(sub_us - execution_us, 0.0)
    behind_us = idle_us - before_us
    # A response later than the arbitration reset gap is followed by a subaction gap alone.
    is_late = execution_us > reset_us
    allowance_us = behind_us - (sub_us if is_late else reset_us)
    allowance_us = allowance_us if allowance_us > _ROUNDING_US else 0.0
    gap_us = behind_us - allowance_us
    return [gap("subaction_gap", before_us, "rest of the subaction gap before the response")], [
        gap("subaction_gap", gap_us, "subaction gap after the response")
        if is_late
        else gap("arbitration_reset_gap", gap_us, "arbitration reset gap after the response"),
        gap("allowance", allowance_us, "allowance for a faster node"),
    ]
