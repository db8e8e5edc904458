"""The transactions of a cycle: each with its phases, and the stretches of bus time that it is made of."""

from collections.abc import Iterator, Sequence
from functools import cache
from math import sqrt
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from busplan.buses.cycle import BusEvent, Doubt
from busplan.buses.ieee1394 import figures
from busplan.buses.ieee1394.constants import (
    ARBITRATION_GAP_TICKS,
    BASE_RATE_MBIT_S,
    DATA_RATE_MBIT_S,
    MAX_GAP_COUNT,
    PACKET_OVERHEAD_BYTES,
    PHY_DELAY_HALF_WIDTH_US,
    REFERENCE_CABLE_M,
    safe_gap_count,
)
from busplan.buses.ieee1394.timing import (
    TIMING_MODELS,
    Delays,
    Gaps,
    Link,
    Phases,
    Responder,
    TimingModelName,
    between_packets_us,
    transaction,
)
from busplan.buses.network import Group, Network
from busplan.buses.published import Spread, rows_of
from busplan.elementwise import Number, Traced, choose, is_off, larger, named, plain, total, traced_with, worded
from busplan.sections.base import TransactionKind
from busplan.sourced import Sourced

if TYPE_CHECKING:
    from busplan.buses.ieee1394.timing import Answer


_BENCH: Final = Link(float(DATA_RATE_MBIT_S["S400"]), MAX_GAP_COUNT, 1, float(REFERENCE_CABLE_M))
"""The way of a packet on the bench."""


class ModelResidual(NamedTuple):
    """Measured less computed time of half a transaction [us]."""

    mean_us: Sourced
    uncertainty_us: Sourced
    """Standard uncertainty of the next half: `Spread`."""


def measured_halves_us() -> dict[int, float]:
    """T1 + T2 as measured, by payload in bytes [us]."""
    return {row["set"]["payload.write_bytes"]: row["published"] for row in rows_of("paper", "bias and U")}


@cache
def residual(model: TimingModelName = "standard") -> ModelResidual:
    """Residual of T1 + T2, equation (13), over the rows of the table.

    Parameters
    ----------
    model
        Timing model.

    Examples
    --------
    >>> round(residual().mean_us, 3), round(residual("paper").mean_us, 3)
    (0.827, 3.131)
    """
    differences = [us - _first_half_us(payload_bytes, model) for payload_bytes, us in measured_halves_us().items()]
    spread, source = (
        Spread.of(differences),
        f"paper, Table I, less the {model} model at its {len(differences)} payloads",
    )
    return ModelResidual(
        Sourced(
            spread.mean,
            unit="us",
            grade="derived",
            source=source,
            meaning="what half a transaction takes beyond the model, on the mean",
            symbol="b",
        ),
        Sourced(
            spread.uncertainty,
            unit="us",
            grade="derived",
            source=source,
            meaning="standard uncertainty of that for one more payload",
            symbol="u(b)",
        ),
    )


def _first_half_us(payload_bytes: int, model: TimingModelName) -> float:
    phases = transaction(
        "write",
        model=TIMING_MODELS[model],
        link=_BENCH,
        payload_bytes=payload_bytes,
        overhead_bytes=int(PACKET_OVERHEAD_BYTES),
        responder=Responder(0.0),
    )
    return float(phases.request_and_acknowledge_us)


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
        data_rate_mbit_s=traced_with(DATA_RATE_MBIT_S[bus.speed], network.nodes),
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
    """Hops of the first node of the group."""
    mean: Number
    """Mean hops of the nodes of the group. Times are linear in the hops, so the mean gives their sum."""
    last: Number
    """Hops of the last node of the group."""

    def of_node(self, place: Number) -> Number:
        """Hops of the node at a place in its group, from 0; at the mean place the mean hops."""
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
        way = Ways(1, mean, group.nodes)
        if before is not None:
            way = Ways(before + 1, before + mean, before + group.nodes)
        chain.append(way._replace(mean=named(way.mean, "hops", f"H_mean{group.name and f',{group.name}'}")))
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
        overhead_bytes=group.payload.overhead_bytes,
        responder=responder,
        alone=network.nodes == 1,
        common=common,
    )
    uncertainty_us = group.read_uncertainty_us if is_read else group.write_uncertainty_us
    if isinstance(phases.latency_us, Traced):
        names = {key: f"{LATENCY_SYMBOLS[key]}{suffix}" for key in phases._fields}
        phases = Phases(**{key: named(us, key, names[key]) for key, us in phases._asdict().items()})
    return Exchange(kind, group, link, size, responder, uncertainty_us, phases, tuple(_parts(kind, phases, answer)))


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
    """Model `paper`: both gaps come after the transaction."""
    sub_us, reset_us = plain(phases.subaction_gap_us), plain(phases.arbitration_reset_gap_us)
    subaction = _gap("subaction_gap", sub_us, "subaction gap")
    return (), (subaction, _gap("arbitration_reset_gap", reset_us, "arbitration reset gap"))


def _by_idle_period(exchanged: Exchange) -> _Divided:
    """Model `standard`: the gap that each idle period waits for, and the allowance for a faster node."""
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


_RECTANGULAR = sqrt(3)
"""Half of a range over its standard uncertainty (JCGM 100, 4.3.7)."""


def bias_us(exchanges: Sequence[Exchange], network: Network, *, gap_count: Number) -> Number:
    """Mean time of a cycle beyond the model [us].

    Half-count (b + d): b is the mean residual of Table I. d is the middle of two readings of it, which a single gap
    count cannot tell apart: that the difference is constant, and that it stands in the gap term of equation (4). An
    execution time that was fitted against the model holds the error of split transactions, and of no others.

    Parameters
    ----------
    exchanges
        Every transaction of the cycle.
    network
        The network.
    gap_count
        Gap count in force [1].
    """
    mean_us = residual().mean_us
    of_split = total(
        halves * (choose(_is_fitted(node), 0.0, mean_us) + _gap_term_us(_measured_at(node), gap_count, "d_split"))
        for node, halves in _split_halves(exchanges)
    )
    of_others = mean_us + _gap_term_us(MAX_GAP_COUNT, gap_count, "d")
    return of_split + _other_halves(exchanges, network) * of_others


def of_cycle(
    exchanges: Sequence[Exchange], network: Network, *, link: Link, gaps: Gaps, hop_delays: Number
) -> tuple[Doubt, ...]:
    """The standard uncertainty of a cycle by each of its inputs.

    Parameters
    ----------
    exchanges
        Every transaction of the cycle.
    network
        The network.
    link
        The way of the packets.
    gaps
        The gaps.
    hop_delays
        How often the delay of all hops stands in the cycle beside its transactions [1].
    """
    host, split, other_halves = network.profile.host, _split_halves(exchanges), _other_halves(exchanges, network)
    spread_us = residual().uncertainty_us
    # One reading is wrong by the same share in all: signs count.
    of_split_us = total(halves * _gap_term_us(_measured_at(node), link.gap_count, "d_split") for node, halves in split)
    gap_term_us = of_split_us + other_halves * _gap_term_us(MAX_GAP_COUNT, link.gap_count, "d")
    of_packets = total(exchange.nodes * _hop_delays(exchange, network) for exchange in exchanges)

    def swing_us(exchange: Exchange, execution_us: Number, host_us: Number) -> Number:
        """Change by a standard uncertainty: half the larger of two steps, two uncertainties up and two down.

        The cycle never falls with either time and has kinks, at which a central difference covers too little.
        """
        responder = exchange.responder
        if is_off(execution_us if responder.answer == "split" else 0.0) and is_off(host_us):
            return 0.0
        answer, bound_us = responder.answer, responder.execution_us + responder.worst_extra_us

        def busy_at(steps: int) -> Number:
            idle_us = between_packets_us(
                answer,
                gaps=gaps,
                execution_us=bound_us + steps * execution_us if steps else bound_us,
                host_us=responder.host_us + steps * host_us if steps else responder.host_us,
            )
            return named(idle_us, "busy_us", f"busy{steps:+d}u" if steps else "busy")

        above_us, own_us, below_us = busy_at(2), busy_at(0), busy_at(-2)
        return larger(above_us - own_us, own_us - below_us) / 2

    return (
        Doubt(
            "residual",
            _LABELS["residual"],
            total(halves * choose(_is_fitted(node), 0.0, spread_us) for node, halves in split)
            + other_halves * spread_us,
        ),
        Doubt("gap_term", _LABELS["gap_term"], larger(gap_term_us, -1 * gap_term_us) / _RECTANGULAR),
        Doubt(
            "node.execution" if network.is_uniform else "group.execution",
            "execution time",
            # Times of several groups are measured, or guessed, in the same way: they are taken to err together.
            total(
                exchange.nodes * swing_us(exchange, exchange.execution_uncertainty_us, 0.0) for exchange in exchanges
            ),
        ),
        Doubt(
            "bus.phy_delay_us",
            _LABELS["bus.phy_delay_us"],
            _phy_doubt_us(of_packets + hop_delays * link.hops, link),
        ),
        Doubt(
            "host.transaction_us",
            _LABELS["host.transaction_us"],
            total(exchange.nodes * swing_us(exchange, 0.0, host.standard_uncertainty_us) for exchange in exchanges),
        ),
    )


def broadcast_bias_us(halves: Number, *, with_gap: Number, gap_count: Number) -> Number:
    """Mean time of a cycle of the broadcast schedule beyond the model [us].

    Parameters
    ----------
    halves
        Packets of the cycle, each half a transaction; a packet without an acknowledge counts like any [1].
    with_gap
        Those of them whose arbitration has the gap term of equation (4) [1].
    gap_count
        Gap count in force [1].
    """
    return halves * residual().mean_us + with_gap * _gap_term_us(MAX_GAP_COUNT, gap_count, "d")


def of_broadcast(
    halves: Number, *, with_gap: Number, link: Link, hop_delays: Number, host_swing_us: Number
) -> tuple[Doubt, ...]:
    """The standard uncertainty of a cycle of the broadcast schedule by each of its inputs.

    Parameters
    ----------
    halves, with_gap
        As in `broadcast_bias_us`.
    link
        The way of the packets.
    hop_delays
        How often the delay of all hops stands in the cycle [1].
    host_swing_us
        Change by a standard uncertainty of the host's own time [us].
    """
    gap_term_us = with_gap * _gap_term_us(MAX_GAP_COUNT, link.gap_count, "d")
    return (
        Doubt("residual", _LABELS["residual"], halves * residual().uncertainty_us),
        Doubt("gap_term", _LABELS["gap_term"], larger(gap_term_us, -1 * gap_term_us) / _RECTANGULAR),
        Doubt("bus.phy_delay_us", _LABELS["bus.phy_delay_us"], _phy_doubt_us(hop_delays * link.hops, link)),
        Doubt("host.transaction_us", _LABELS["host.transaction_us"], host_swing_us),
    )


_LABELS: Final = {
    "residual": "residual of Table I",
    "gap_term": "gap term of eq (4)",
    "bus.phy_delay_us": "PHY delay",
    "host.transaction_us": "host time",
}


def _hop_delays(exchange: Exchange, network: Network) -> Number:
    """Delays of hops in a transaction: arbitrations over the way to the root, other parts over its own [1]."""
    packets = [part.term for part in exchange.parts if part.term in PACKET_PARTS]
    arbitrations = packets.count(ARBITRATION)
    hops = (len(packets) - arbitrations) * exchange.link.hops
    return hops + arbitrations * arbitration_hops(network, exchange.link)


def _phy_doubt_us(delays: Number, link: Link) -> Number:
    """Standard uncertainty of some PHY delays [us]; 0 where the profile gives them."""
    half_width_us = traced_with(PHY_DELAY_HALF_WIDTH_US, link.hops) if link.phy_delay_us is None else 0.0
    return delays * half_width_us / _RECTANGULAR


def _split_halves(exchanges: Sequence[Exchange]) -> tuple[tuple[Any, Number], ...]:
    """Halves of split transactions in the cycle, each a packet that is acknowledged: by sort of node [1]."""
    counts: dict[int, tuple[Any, list[Number]]] = {}
    for exchange in exchanges:
        if exchange.responder.answer == "split":
            counts.setdefault(id(exchange.group.node), (exchange.group.node, []))[1].append(2 * exchange.nodes)
    return tuple((node, named(total(halves), "split_halves", "halves")) for node, halves in counts.values())


def _other_halves(exchanges: Sequence[Exchange], network: Network) -> Number:
    """Halves of all other transactions in the cycle, and retries [1]."""
    unsplit = [exchange for exchange in exchanges if exchange.responder.answer != "split"]
    halves = total(exchange.nodes * (1 if exchange.responder.answer == "unified" else 2) for exchange in unsplit)
    return named(halves + network.profile.cycle.retries, "other_halves", "halves_other")


def _is_fitted(node: Any) -> Number:
    """Whether an execution time holds the error of the model, because it was fitted against it: a truth."""
    truth: Number = node.execution.residual == "standard"
    return truth


def _measured_at(node: Any) -> Number:
    """Gap count at which the error of split transactions is known [1]."""
    return choose(_is_fitted(node), node.execution.measured_gap_count, MAX_GAP_COUNT)


def _gap_term_us(measured: Number, gap_count: Number, symbol: str) -> Number:
    """Half of what the gap term changes from the gap count that was measured to the gap count in force: d [us]."""
    ticks = traced_with(ARBITRATION_GAP_TICKS, gap_count) / 2
    return named(ticks * (measured - gap_count) / BASE_RATE_MBIT_S, f"gap_term_{symbol}_us", symbol)
