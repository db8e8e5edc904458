"""Distance of the bus from the timing model `standard`: the bias, and the uncertainty of each input.

The error of an input is the same in every transaction; different inputs are independent.

References
----------
JCGM 100 (GUM), 5.1; paper, Table I.
"""

from collections.abc import Sequence
from math import sqrt
from typing import Any, Final

from busplan.buses.cycle import Doubt
from busplan.buses.ieee1394.constants import (
    ARBITRATION_GAP_TICKS,
    BASE_RATE_MBIT_S,
    MAX_GAP_COUNT,
    PHY_DELAY_HALF_WIDTH_US,
)
from busplan.buses.ieee1394.idle import Gaps, between_packets_us
from busplan.buses.ieee1394.table_1 import residual
from busplan.buses.ieee1394.timing import Link
from busplan.buses.ieee1394.transactions import ARBITRATION, PACKET_PARTS, Exchange, arbitration_hops
from busplan.buses.network import Network
from busplan.elementwise import Number, alike, choose, is_off, larger, named, total

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
        own = exchange.responder
        if is_off(execution_us if own.answer == "split" else 0.0) and is_off(host_us):
            return 0.0
        answer, bound_us = own.answer, own.execution_us + own.worst_extra_us

        def busy_at(steps: int) -> Number:
            idle_us = between_packets_us(
                answer,
                gaps=gaps,
                execution_us=bound_us + steps * execution_us if steps else bound_us,
                host_us=own.host_us + steps * host_us if steps else own.host_us,
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
    half_width_us = alike(PHY_DELAY_HALF_WIDTH_US, link.hops) if link.phy_delay_us is None else 0.0
    return delays * half_width_us / _RECTANGULAR


def _split_halves(exchanges: Sequence[Exchange]) -> tuple[tuple[Any, Number], ...]:
    """Halves of split transactions in the cycle, each a packet that is acknowledged: by sort of node [1]."""
    counts: dict[int, tuple[Any, list[Number]]] = {}
    for exchange in exchanges:
        if exchange.responder.answer == "split":
            counts.setdefault(id(exchange.group.node), (exchange.group.node, []))[1].append(2 * exchange.nodes)
    return tuple((node, named(total(each), "split_halves", "halves")) for node, each in counts.values())


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
    ticks = alike(ARBITRATION_GAP_TICKS, gap_count) / 2
    return named(ticks * (measured - gap_count) / BASE_RATE_MBIT_S, f"gap_term_{symbol}_us", symbol)
