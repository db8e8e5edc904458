"""Published figures of the dVRK and of the standard beside what the equations give."""

from collections.abc import Mapping
from math import ceil
from typing import Any, Final

from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.broadcast import BroadcastCycle, hub_block_bytes
from busplan.buses.ieee1394.constants import (
    BROADCAST_CLOCK_MHZ,
    BROADCAST_SLOT_CLOCKS,
    DATA_RATE_MBIT_S,
    FIRST_BROADCAST_CLOCKS,
    MAX_GAP_COUNT,
    QUADLET_BYTES,
    REFERENCE_CABLE_M,
    safe_gap_count,
)
from busplan.buses.ieee1394.cycle import Ieee1394Cycle
from busplan.buses.ieee1394.timing import TIMING_MODELS, Link, Responder, transaction
from busplan.buses.network import Network
from busplan.buses.published import Comparison, EvidenceSection
from busplan.elementwise import plain

Published = Mapping[str, Any]
"""The published figures, as a data file of the package holds them."""
_STANDARD: Final = "standard model"
_US: Final = 1e6


def kit_sections(kit: Network, published: Published) -> tuple[EvidenceSection, ...]:
    """Compare what is published of the dVRK with the cycles of its profile.

    Parameters
    ----------
    kit
        The network of the shipped profile.
    published
        The published figures.

    References
    ----------
    Z. Chen, P. Kazanzides, TePRA 2014; JHU mechatronics-software.
    """
    return (
        _gain(kit, published),
        _rates(kit, published),
        _board(kit, published),
        _times(published),
        _hub_block(kit, published),
    )


def _changed(kit: Network, *, host_us: float | None = None, **cycle: str) -> Network:
    """The kit with other words in [cycle], and another time of the host."""
    changes: dict[str, Any] = {"cycle": kit.profile.cycle.model_copy(update=cycle)}
    if host_us is not None:
        changes["host"] = kit.profile.host.model_copy(update={"transaction_us": host_us})
    return kit._replace(profile=kit.profile.model_copy(update=changes))


def _one_by_one_us(kit: Network, host_us: float | None = None) -> float:
    return plain(Ieee1394Cycle(_changed(kit, host_us=host_us, schedule="individual"), "standard").required_us)


def _broadcast_us(kit: Network, host_us: float | None = None) -> float:
    changed = _changed(kit, host_us=host_us, schedule="broadcast", broadcast_request="timed")
    return plain(BroadcastCycle(changed, "standard").required_us)


def _gain(kit: Network, published: Published) -> EvidenceSection:
    title, given = "dVRK: I/O time, one by one over by broadcasts", published["gain"]
    least, enough_us = given["at_least"], _host_for_gain_us(kit, published["gain"]["at_least"])
    gain = _one_by_one_us(kit, 0.0) / _broadcast_us(kit, 0.0)
    return EvidenceSection(
        title,
        f"TePRA 2014, {given['source']}: more than a factor of {least}, with the host's time in each call. Ours is the "
        "bus alone; with so much host time in each call (host.transaction_us) it would reach the factor.",
        (
            Comparison(title, "gain, of the bus alone", "1", least, _STANDARD, gain, given["grade"]),
            Comparison(title, f"host time that makes it {least}", "us", None, _STANDARD, enough_us, "derived"),
        ),
        "dvrk",
    )


def _host_for_gain_us(kit: Network, gain: float) -> float:
    """The host's own time in each call with which the schedules differ by some factor, by halves [us]."""
    low_us, high_us = 0.0, 1000.0
    for _ in range(50):
        middle_us = (low_us + high_us) / 2
        reached = _one_by_one_us(kit, middle_us) >= gain * _broadcast_us(kit, middle_us)
        low_us, high_us = (low_us, middle_us) if reached else (middle_us, high_us)
    return high_us


def _rates(kit: Network, published: Published) -> EvidenceSection:
    title, given = "dVRK: the periods that it runs at", published["rates"]
    one_us, all_us = (_US / given[f"{name}_hz"] for name in ("one_by_one", "broadcast"))
    return EvidenceSection(
        title,
        f"TePRA 2014, {given['source']}. A period holds the host's own work, too, so a cycle must be shorter: the "
        "residual is what is left to the host. Requests are timed, as the firmware of 2014 has them; packets are "
        "those of today's firmware, longer than those of 2014.",
        (
            Comparison(title, "one by one", "us", one_us, _STANDARD, _one_by_one_us(kit), given["grade"]),
            Comparison(title, "by broadcasts", "us", all_us, _STANDARD, _broadcast_us(kit), given["grade"]),
        ),
        "dvrk",
    )


def _board(kit: Network, published: Published) -> EvidenceSection:
    title, given = "dVRK: the broadcast of one board", published["wait"]
    sized = kit._replace(groups=tuple(one._replace(read_bytes=given["payload_bytes"]) for one in kit.groups))

    def each_us(hops: int) -> float:
        cycle = BroadcastCycle(_changed(sized, broadcast_request="isochronous"), "standard")
        cycle.link = cycle.link._replace(hops=hops)
        return plain(cycle.arbitration_us + cycle.broadcast_us(sized.groups[0]))

    return EvidenceSection(
        title,
        f"{given['source']}: the host allows {given['per_board_us']} us for each board, of {given['payload_bytes']} "
        "bytes when this was written. Every verdict charges the hops of the farthest.",
        tuple(
            Comparison(
                title,
                f"{hops} hop{'s' * (hops != 1)}",
                "us",
                given["per_board_us"],
                _STANDARD,
                each_us(hops),
                given["grade"],
            )
            for hops in (1, int(plain(kit.nodes)))
        ),
        "dvrk",
    )


def _times(published: Published) -> EvidenceSection:
    title, given = "dVRK: when a board broadcasts, firmware up to Rev 7", published["times"]
    found = (
        ("first board", "first_us", FIRST_BROADCAST_CLOCKS),
        ("each further board", "per_board_us", BROADCAST_SLOT_CLOCKS),
    )
    return EvidenceSection(
        title,
        f"{given['source']}. From Rev 8 on a board sends when it has heard the one before it.",
        tuple(
            Comparison(title, name, "us", given[key], _STANDARD, clocks / BROADCAST_CLOCK_MHZ, given["grade"])
            for name, key, clocks in found
        ),
        "dvrk",
    )


def _hub_block(kit: Network, published: Published) -> EvidenceSection:
    title, given = "dVRK: the block of the hub", published["hub_block"]
    nodes = int(plain(kit.nodes))
    quadlets = given["quadlets_per_board"] * nodes + given["quadlets_of_timing"]
    computed = plain(hub_block_bytes(kit))
    return EvidenceSection(
        title,
        f"{given['source']}: what the software reads.",
        (Comparison(title, f"{nodes} boards", "bytes", QUADLET_BYTES * quadlets, _STANDARD, computed, given["grade"]),),
        "dvrk",
    )


def standard_sections(base: Network, published: Published) -> tuple[EvidenceSection, ...]:
    """Compare what is published of the standard, of machines, and measured elsewhere, with what the equations give.

    Parameters
    ----------
    base
        A network of one group of nodes.
    published
        The published figures.

    References
    ----------
    The sources of the data file.
    """
    return (_delays(published), _gap_counts(published), _round_trip(published), _machines(base, published))


def _machines(base: Network, published: Published) -> EvidenceSection:
    title, given = "IEEE 1394: axes of a machine", published["machines"]
    bus = base.profile.bus.model_copy(update={"speed": given["speed"], "gap_count": "optimal"})
    profile, size = base.profile.model_copy(update={"bus": bus}), given["payload_bytes"]

    def required_us(cycle: type[Ieee1394Cycle | BroadcastCycle], nodes: int) -> float:
        (group,) = base.groups
        group = group._replace(nodes=nodes, read_bytes=size, write_bytes=size)
        group = group._replace(read_execution_us=0.0, write_execution_us=0.0, worst_extra_us=0.0)
        return plain(cycle(base._replace(profile=profile, groups=(group,)), "standard").required_us)

    schedules: dict[str, type[Ieee1394Cycle | BroadcastCycle]] = {
        "reads and writes": Ieee1394Cycle,
        "broadcast": BroadcastCycle,
    }
    return EvidenceSection(
        title,
        f"{given['source']}: axes with their period at {given['speed']}; neither payload nor transactions are said. "
        f"Ours is the bus alone, {size} bytes each way (assumed), no execution, a chain: it is no test, but must fit.",
        tuple(
            Comparison(title, f"{axes} axes", "us", period_us, method, required_us(cycle, axes), given["grade"])
            for axes, period_us in zip(given["axes"], given["period_us"], strict=True)
            for method, cycle in schedules.items()
        ),
        "ieee1394",
    )


def _delays(published: Published) -> EvidenceSection:
    title, phy, cable = "IEEE 1394: delays of a PHY and of a cable", published["phy"], published["cable"]
    rate_mbit_s = DATA_RATE_MBIT_S["S400"]
    clocks = {f"{name} model": model.gap_clock_mbit_s(rate_mbit_s) for name, model in TIMING_MODELS.items()}
    cable_us = plain(equations.hop_delay_us(cable["length_m"], phy_delay_us=0.0))
    published_us = cable["delay_us_per_m"] * cable["length_m"]
    return EvidenceSection(
        title,
        f"{phy['source']}, the worst case; {cable['source']}. The paper counts the PHY's 14 ticks in the data rate.",
        (
            *(
                Comparison(
                    title,
                    "PHY",
                    "us",
                    phy["delay_us"],
                    method,
                    plain(equations.phy_delay_us(clock)),
                    phy["grade"],
                )
                for method, clock in clocks.items()
            ),
            Comparison(
                title, f"cable of {cable['length_m']:g} m", "us", published_us, _STANDARD, cable_us, cable["grade"]
            ),
        ),
        "ieee1394",
    )


def _gap_counts(published: Published) -> EvidenceSection:
    title, given, phy, cable = (
        "IEEE 1394: smallest safe gap counts",
        published["gap_counts"],
        published["phy"],
        published["cable"],
    )
    hop_us: float = cable["delay_us_per_m"] * cable["length_m"] + phy["delay_us"]

    def derived(hops: int) -> int:
        ticks: float = 2 * hop_us * given["base_rate_mhz"] * hops
        conditions: list[tuple[int, int]] = list(zip(given["offsets"], given["slopes"], strict=True))
        return max(ceil((ticks + offset) / slope) for offset, slope in conditions)

    table = list(enumerate(given["by_hops"], start=1))
    found = {
        "table of busplan": [plain(safe_gap_count(hops)) == count for hops, count in table],
        "delays at the base rate": [derived(hops) == count for hops, count in table],
    }
    return EvidenceSection(
        title,
        f"{given['source']}: how many of its entries are met. Two offsets of the derivation are fitted; its slope "
        "follows from cable and PHY at the base rate alone, and would be four times as steep at S400's.",
        tuple(
            Comparison(title, "entries met", "1", len(table), method, sum(met), given["grade"])
            for method, met in found.items()
        ),
        "ieee1394",
    )


def _round_trip(published: Published) -> EvidenceSection:
    title, given = "IEEE 1394: a round trip between two computers", published["round_trip"]
    link = Link(
        data_rate_mbit_s=float(DATA_RATE_MBIT_S["S400"]),
        gap_count=MAX_GAP_COUNT,
        hops=given["nodes"] - 1,
        cable_length_m=float(REFERENCE_CABLE_M),
    )

    def both_ways_us(size: int) -> float:
        phases = transaction(
            "write",
            model=TIMING_MODELS["standard"],
            link=link,
            payload_bytes=size,
            overhead_bytes=0,
            responder=Responder(0.0, answer="unified"),
        )
        return 2 * plain(phases.request_and_acknowledge_us)

    return EvidenceSection(
        title,
        f"{given['source']}: {given['nodes']} nodes, FCP, a write each way. Ours is both writes on the wire at "
        f"gap count {MAX_GAP_COUNT} and S400, which the abstract does not say; the rest is the software of both.",
        tuple(
            Comparison(
                title, f"{size} byte{'s' * (size != 1)}", "us", us, _STANDARD, both_ways_us(size), given["grade"]
            )
            for size, us in zip(given["payload_bytes"], given["latency_us"], strict=True)
        ),
        "ieee1394",
    )
