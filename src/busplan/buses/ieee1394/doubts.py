"""Uncertainty of a cycle: the residual of Table I, the bias by it, and the doubt of each input."""

from collections.abc import Callable, Sequence
from math import sqrt
from typing import Any, Final, NamedTuple

from busplan.buses.cycle import Doubt
from busplan.buses.ieee1394.constants import (
    MAX_GAP_COUNT,
    c,
)
from busplan.buses.ieee1394.timing import (
    Delays,
    Link,
    Responder,
    TimingModelName,
    between_packets_us,
    delays,
    transaction,
)
from busplan.buses.ieee1394.transactions import ARBITRATION, PACKET_PARTS, Exchange
from busplan.buses.network import Network
from busplan.buses.published import Spread, rows_of
from busplan.elementwise import Number, choose, is_off, larger, named, step, total
from busplan.sourced import Sourced, cached

_RECTANGULAR: Final = sqrt(3)
"""Ratio of half a range to its standard uncertainty (JCGM 100, 4.3.7)."""

UNACKNOWLEDGED: Final = 2
"""Delays over all hops in a packet without an acknowledge: of its arbitration and its data [1]."""
ACKNOWLEDGED: Final = 3
"""Delays over all hops in a packet with an acknowledge [1]."""
CONCATENATED: Final = 2
"""Delays over all hops in a concatenated response, which does not arbitrate: of its data and its acknowledge [1]."""


class ModelResidual(NamedTuple):
    """Measured less computed time of half a transaction [us]."""

    mean_us: Sourced
    uncertainty_us: Sourced
    """Standard uncertainty of one further half: `Spread`."""


@cached(maxsize=16)
def residual(model: TimingModelName = "standard") -> ModelResidual:
    """Residual of T1 + T2, equation (13), over the rows of Table I.

    Examples
    --------
    >>> round(residual().mean_us, 3), round(residual("paper").mean_us, 3)
    (0.827, 3.131)
    """
    # Link of the bench.
    bench = Link(float(c.by_key("DATA_RATE_MBIT_S")["S400"]), MAX_GAP_COUNT, 1, float(c.REFERENCE_CABLE_M))
    differences = []
    for row in rows_of("paper", "bias and U"):
        phases = transaction(
            "write",
            model=model,
            delays=delays(bench, model=model),
            payload_bytes=row["set"]["payload.write_bytes"],
            responder=Responder(0.0),
            overhead_bytes=int(c.PACKET_OVERHEAD_BYTES),
        )
        differences.append(row["published"] - float(phases.request_and_acknowledge_us))
    spread = Spread.of(differences)

    def sourced(us: float, meaning: str, symbol: str) -> Sourced:
        source = f"paper, Table I, less the {model} model at its {len(differences)} payloads"
        return Sourced(us, unit="us", grade="derived", source=source, meaning=meaning, symbol=symbol)

    return ModelResidual(
        sourced(spread.mean, "mean time of half a transaction beyond the model", "b"),
        sourced(spread.uncertainty, "standard uncertainty of that for one more payload", "u(b)"),
    )


def gap_term_us(gap_count: Number, *, measured: Number = MAX_GAP_COUNT, symbol: str = "d") -> Number:
    """Half the change of equation (4)'s gap term between two gap counts: d [us].

    The error of the model was measured at gap count `measured`, by default that of Table I.
    """
    ticks = c.ARBITRATION_GAP_TICKS / 2
    return named(ticks * (measured - gap_count) / c.BASE_RATE_MBIT_S, f"gap_term_{symbol}_us", symbol)


def bias_us(exchanges: Sequence[Exchange], network: Network, *, link: Link) -> Number:
    """Mean time of a cycle beyond the model [us]; 0 for a lower bound.

    Half-count (b + d): b is the mean residual of Table I. d is the middle of two readings of it, which a single gap
    count cannot tell apart: the difference is constant, or it stands in the gap term of equation (4). An execution time
    that was fitted against the model contains the error of split transactions, and of no others.
    """
    if not link.has_gaps:
        return 0.0
    gap_count = link.gap_count
    mean_us = residual().mean_us
    of_split = total(
        halves * (choose(_is_fitted(node), 0.0, mean_us) + _split_gap_term_us(node, gap_count))
        for node, halves in _split_halves(exchanges)
    )
    return of_split + _other_halves(exchanges, network) * (mean_us + gap_term_us(gap_count))


def of_cycle(
    exchanges: Sequence[Exchange], network: Network, *, delays: Delays, hop_delays: Number
) -> tuple[Doubt, ...]:
    """Standard uncertainty of a cycle of the individual schedule by each of its inputs.

    `delays` are those to the farthest node. `hop_delays` counts how often the delay of all hops stands in the cycle
    outside its transactions [1].
    """
    host_doubt_us: Number = network.profile.host.standard_uncertainty_us
    split, other_halves = _split_halves(exchanges), _other_halves(exchanges, network)
    link, spread_us = delays.link, residual().uncertainty_us
    # A wrong reading errs by the same share everywhere, so signs count.
    of_split_us = total(halves * _split_gap_term_us(node, link.gap_count) for node, halves in split)
    of_packets = total(exchange.nodes * _hop_delays(exchange) for exchange in exchanges)

    def busy_swing_us(exchange: Exchange, execution_doubt_us: Number, host_doubt_us: Number) -> Number:
        """Change of a transaction by a standard uncertainty of its execution time or of the host's time [us]."""
        responder = exchange.responder
        if is_off(execution_doubt_us if responder.answer == "split" else 0.0) and is_off(host_doubt_us):
            return 0.0
        bound_us = responder.execution_us + responder.worst_extra_us

        def busy_us(steps: int) -> Number:
            between_us = between_packets_us(
                responder.answer,
                gaps=delays.gaps,
                execution_us=bound_us + steps * execution_doubt_us if steps else bound_us,
                host_us=responder.host_us + steps * host_doubt_us if steps else responder.host_us,
            )
            return named(between_us, "busy_us", f"busy{steps:+d}u" if steps else "busy")

        return swing_us(busy_us)

    return of_inputs(
        residual_us=total(halves * choose(_is_fitted(node), 0.0, spread_us) for node, halves in split)
        + other_halves * spread_us,
        gap_term_us=of_split_us + other_halves * gap_term_us(link.gap_count),
        execution=Doubt(
            "node.execution" if network.is_uniform else "group.execution",
            "execution time",
            # Times of several groups are measured, or guessed, in the same way: they are taken to err together.
            total(
                exchange.nodes * busy_swing_us(exchange, exchange.execution_uncertainty_us, 0.0)
                for exchange in exchanges
            ),
        ),
        phy_delays=of_packets + hop_delays * link.hops,
        link=link,
        host_us=total(exchange.nodes * busy_swing_us(exchange, 0.0, host_doubt_us) for exchange in exchanges),
    )


def of_inputs(
    *,
    residual_us: Number,
    gap_term_us: Number,
    phy_delays: Number,
    link: Link,
    host_us: Number,
    execution: Doubt | None = None,
) -> tuple[Doubt, ...]:
    """Standard uncertainty of a cycle by each of its inputs.

    `gap_term_us` is the sum of the gap terms d [us], and `phy_delays` counts how often the delay of a PHY stands in the
    cycle [1]. A profile that gives the delay of a PHY leaves no doubt of it. `execution` is None for a cycle without
    execution times.
    """
    if not link.has_gaps:
        # Times left out of a lower bound carry no doubt: only the verdict "does not fit" rests on the bound.
        residual_us = gap_term_us = phy_delays = 0.0
    half_width_us = c.PHY_DELAY_HALF_WIDTH_US if link.phy_delay_us is None else 0.0
    return (
        Doubt("residual", "residual of Table I", residual_us),
        Doubt("gap_term", "gap term of eq (4)", larger(gap_term_us, -1 * gap_term_us) / _RECTANGULAR),
        *((execution,) if execution else ()),
        Doubt("bus.phy_delay_us", "PHY delay", phy_delays * half_width_us / _RECTANGULAR),
        Doubt("host.transaction_us", "host time", host_us),
    )


def swing_us(time_us: Callable[[int], Number]) -> Number:
    """Change by one standard uncertainty [us]: half the larger of two steps, two uncertainties up and two down.

    `time_us` gives the time at a number of standard uncertainties. The cycle never falls with a time and has kinks, at
    which a central difference covers too little.
    """
    above_us, planned_us, below_us = time_us(2), time_us(0), time_us(-2)
    return larger(above_us - planned_us, planned_us - below_us) / 2


def _hop_delays(exchange: Exchange) -> Number:
    """Hop delays in a transaction: those of arbitrations to the root, those of other parts to the node [1]."""
    packets = [part.term for part in exchange.parts if part.term in PACKET_PARTS]
    arbitrations = packets.count(ARBITRATION)
    hops = (len(packets) - arbitrations) * exchange.delays.link.hops
    return hops + arbitrations * exchange.delays.arbitration_hops


def _split_halves(exchanges: Sequence[Exchange]) -> tuple[tuple[Any, Number], ...]:
    """Halves of split transactions in the cycle, by sort of node; a half is a packet with its acknowledge [1]."""
    counts: dict[int, tuple[Any, list[Number]]] = {}
    for exchange in exchanges:
        if exchange.responder.answer == "split":
            counts.setdefault(id(exchange.group.node), (exchange.group.node, []))[1].append(2 * exchange.nodes)
    return tuple((node, named(total(halves), "split_halves", "halves")) for node, halves in counts.values())


@step("halves_other")
def _other_halves(exchanges: Sequence[Exchange], network: Network) -> Number:
    """Halves of all other transactions in the cycle, and retries [1]."""
    unsplit = [exchange for exchange in exchanges if exchange.responder.answer != "split"]
    halves = total(exchange.nodes * (1 if exchange.responder.answer == "unified" else 2) for exchange in unsplit)
    return halves + network.profile.cycle.retries


def _is_fitted(node: Any) -> Number:
    """Whether the execution time contains the error of the model because it was fitted against it (a truth)."""
    truth: Number = node.execution.residual == "standard"
    return truth


def _split_gap_term_us(node: Any, gap_count: Number) -> Number:
    """Gap term of a split transaction, from the gap count at which its error is known [us]."""
    measured = choose(_is_fitted(node), node.execution.measured_gap_count, MAX_GAP_COUNT)
    return gap_term_us(gap_count, measured=measured, symbol="d_split")
