"""How far the bus may be from the timing model `standard`: its bias, and what is not known exactly.

One input's error is the same in every transaction; different inputs are independent.

References
----------
JCGM 100 (GUM), 5.1; paper, Table I.
"""

from collections.abc import Sequence
from math import sqrt

from busplan.buses.bus import Doubt
from busplan.buses.ieee1394.constants import (
    ARBITRATION_GAP_TICKS,
    BASE_RATE_MBIT_S,
    MAX_GAP_COUNT,
    PHY_DELAY_HALF_WIDTH_US,
)
from busplan.buses.ieee1394.idle import Gaps, busy_us
from busplan.buses.ieee1394.table_1 import residual
from busplan.buses.ieee1394.timing import Link
from busplan.buses.ieee1394.transactions import PACKET_PARTS, Exchange
from busplan.buses.network import Network
from busplan.elementwise import Number, choose, larger, named, total

_RECTANGULAR = sqrt(3)
"""Half of a range over its standard uncertainty (JCGM 100, 4.3.7)."""


def bias_us(exchanges: Sequence[Exchange], network: Network, *, gap_count: Number) -> Number:
    """What a cycle takes beyond the model, on the mean [us].

    Half-count (b + d): b is the mean residual of Table I. d is the middle of two readings of it, which one gap count
    cannot tell apart: that the difference is constant, and that it stands in the gap term of equation (4).

    Parameters
    ----------
    exchanges
        Every transaction of the cycle.
    network
        The network.
    gap_count
        Gap count in force [1].
    """
    return _halves(exchanges, network) * (_mean_us(network) + _gap_term_us(network, gap_count))


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
    halves, host = _halves(exchanges, network), network.profile.host
    gap_term_us = _gap_term_us(network, link.gap_count)
    of_packets = total(one.nodes * sum(part.term in PACKET_PARTS for part in one.parts) for one in exchanges)
    phy_us = PHY_DELAY_HALF_WIDTH_US / _RECTANGULAR if link.phy_delay_us is None else 0.0

    def swing_us(one: Exchange, execution_us: Number, host_us: Number) -> Number:
        """What one standard uncertainty changes, as the larger of two steps of two: up and down.

        The cycle never falls with either time and has kinks, at which a central difference covers too little.
        """
        own = one.responder
        if _is_zero(execution_us if own.answer == "split" else 0.0) and _is_zero(host_us):
            return 0.0
        answer, bound_us = own.answer, own.execution_us + own.worst_extra_us

        def busy_at(steps: int) -> Number:
            found_us = busy_us(
                answer,
                gaps=gaps,
                execution_us=bound_us + steps * execution_us if steps else bound_us,
                host_us=own.host_us + steps * host_us if steps else own.host_us,
            )
            return named(found_us, "busy_us", f"busy{steps:+d}u" if steps else "busy")

        above_us, own_us, below_us = busy_at(2), busy_at(0), busy_at(-2)
        return larger(above_us - own_us, own_us - below_us) / 2

    return (
        Doubt("residual", "residual of Table I", halves * _spread_us(network)),
        Doubt("gap_term", "gap term of eq (4)", halves * larger(gap_term_us, -1 * gap_term_us) / _RECTANGULAR),
        Doubt(
            "node.execution",
            "execution time",
            total(one.nodes * swing_us(one, one.execution_uncertainty_us, 0.0) for one in exchanges),
        ),
        Doubt("bus.phy_delay_us", "PHY delay", (of_packets + hop_delays) * link.hops * phy_us),
        Doubt(
            "host.transaction_us",
            "host time",
            total(one.nodes * swing_us(one, 0.0, host.standard_uncertainty_us) for one in exchanges),
        ),
    )


def _is_zero(number: Number) -> bool:
    """Whether a plain number is 0: what is off costs no time."""
    return isinstance(number, (int, float)) and number == 0


def _halves(exchanges: Sequence[Exchange], network: Network) -> Number:
    """How often half a transaction stands in the cycle: a packet that is acknowledged."""
    halves = total(one.nodes * (1 if one.responder.answer == "unified" else 2) for one in exchanges)
    return named(halves + network.profile.cycle.retries, "halves", "halves")


def _mean_us(network: Network) -> Number:
    return choose(_is_fitted(network), 0.0, residual().mean_us)


def _spread_us(network: Network) -> Number:
    return choose(_is_fitted(network), 0.0, residual().uncertainty_us)


def _is_fitted(network: Network) -> Number:
    """Whether the execution time holds the error of the model, because it was fitted against it: a truth."""
    truth: Number = network.profile.node.execution.residual == "standard"
    return truth


def _gap_term_us(network: Network, gap_count: Number) -> Number:
    """Half of what the gap term changes from the gap count that was measured to the one in force: d [us]."""
    measured = choose(_is_fitted(network), network.profile.node.execution.measured_gap_count, MAX_GAP_COUNT)
    ticks = ARBITRATION_GAP_TICKS / 2
    return named(ticks * (measured - gap_count) / BASE_RATE_MBIT_S, "gap_term_us", "d")
