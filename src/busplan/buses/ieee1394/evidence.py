"""Figures of IEEE 1394 for rows of evidence, beyond those of a cycle."""

from collections.abc import Callable, Mapping
from math import ceil
from typing import Any, Final

from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.broadcast import BroadcastCycle, hub_block_bytes
from busplan.buses.ieee1394.constants import (
    BITS_PER_BYTE,
    c,
    safe_gap_count,
)
from busplan.buses.ieee1394.cycle import Ieee1394Cycle
from busplan.buses.ieee1394.doubts import residual
from busplan.buses.published import data_file


def equation_15_constant_us(_cycle: object, *, nodes: int, gap_count: int, overhead_bytes: int, rounded: bool) -> float:
    """Constant of equation (15): the terms of equations (4)-(6), rounded to two decimals where `rounded` [us]."""
    s400 = c.by_key("DATA_RATE_MBIT_S")["S400"]
    hop_us = nodes * equations.hop_delay_us(c.REFERENCE_CABLE_M, phy_delay_us=equations.phy_delay_us(s400))
    terms_us = (
        *(hop_us, c.ARBITRATION_GAP_TICKS * gap_count / s400, c.ARBITRATION_HOLD_US),
        *(hop_us, BITS_PER_BYTE * overhead_bytes / s400),
        *(hop_us, c.DATA_END_US),
    )
    return sum(round(float(term_us), 2) if rounded else float(term_us) for term_us in terms_us)


def host_for_gain_us(cycle: Ieee1394Cycle, *, gain: float) -> float:
    """Host time at which the individual schedule takes `gain` times the broadcast schedule, by bisection [us]."""
    profile, low_us, high_us = cycle.network.profile, 0.0, 1000.0
    for _ in range(50):
        middle_us = (low_us + high_us) / 2
        host = profile.host.model_copy(update={"transaction_us": middle_us})
        network = cycle.network._replace(profile=profile.model_copy(update={"host": host}))
        one_by_one, broadcast = (kind(network, cycle.model).required_us for kind in (Ieee1394Cycle, BroadcastCycle))
        low_us, high_us = (low_us, middle_us) if one_by_one >= gain * broadcast else (middle_us, high_us)
    return high_us


def gap_counts_met(_cycle: object, *, derived: bool) -> int:
    """Number of entries of the published gap-count table that the program agrees with [1].

    With `derived` they are computed from cable and PHY at the base rate; otherwise they are the program's table.
    """
    table: Any = data_file("ieee1394")["gap_counts"]

    def computed(hops: int) -> float:
        if not derived:
            return safe_gap_count(hops)
        ticks: float = 2 * table["hop_us"] * table["base_rate_mhz"] * hops
        conditions: list[tuple[int, int]] = list(zip(table["offsets"], table["slopes"], strict=True))
        return max(ceil((ticks + offset) / slope) for offset, slope in conditions)

    return sum(computed(hops) == count for hops, count in enumerate(table["by_hops"], start=1))


FUNCTIONS: Final[Mapping[str, Callable[..., Any]]] = {
    "equation_15_us": lambda _, payload_bytes: equations.published_request_and_acknowledge_us(payload_bytes),
    "equation_15_constant_us": equation_15_constant_us,
    "residual_mean_us": lambda cycle: float(residual(cycle.model).mean_us),
    "residual_uncertainty_us": lambda cycle: float(residual(cycle.model).uncertainty_us),
    "host_for_gain_us": host_for_gain_us,
    "board_us": lambda cycle: cycle.arbitration_us + cycle.broadcast_us(cycle.network.groups[0]),
    "hub_block_bytes": lambda cycle: hub_block_bytes(cycle.network),
    "phy_delay_us": lambda cycle: equations.phy_delay_us(cycle.delays.clock_mbit_s),
    "cable_delay_us": lambda _, length_m: equations.hop_delay_us(length_m, phy_delay_us=0.0),
    "gap_counts_met": gap_counts_met,
}
