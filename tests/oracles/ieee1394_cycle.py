"""A second, exact implementation of the cycle of IEEE 1394 and of its certainty, from equations and protocol alone."""

from fractions import Fraction
from math import sqrt
from statistics import fmean, stdev
from typing import Any

import busplan

# By hand from the standard's gap-count table, 1 to 23 hops.
GAP_COUNTS = [5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43, 46, 48, 51, 54, 57, 59, 62]


# Table I as printed: payload in bytes, measured T1+T2 in us.
TABLE_1 = [(4, 6), (16, 6.3), (32, 6.6), (64, 7.5), (128, 9.1), (256, 11.5), (512, 16.9), (1024, 27.4)]


def exact_required_us(profile: busplan.Profile, model: str, nodes: int, *, extra_us: float = 0.0) -> Fraction:
    """Required time of a cycle in exact arithmetic, written from the equations and from nothing of busplan.

    What its transactions take beyond the model, `extra_us`, has cycle starts of its own.
    """
    data = profile.model_dump()
    bus, payload, node, cycle = data["bus"], data["payload"], data["node"], data["cycle"]
    rate = {"S100": Fraction("98.304"), "S200": Fraction("196.608"), "S400": Fraction("393.216")}[bus["speed"]]
    base = Fraction("98.304")
    clock = rate if model == "paper" else base
    hops, gap = _setup(bus, nodes)
    phy_us = Fraction(14) / clock if bus["phy_delay_us"] is None else Fraction(bus["phy_delay_us"])
    way_us = hops * (Fraction("0.023") * Fraction(bus["cable_length_m"]) / Fraction("4.5") + phy_us)
    arbitration_us = way_us + Fraction(4 * gap) / clock + Fraction("1.63")
    acknowledge_us = way_us + Fraction("0.25")
    sub_us, reset_us = Fraction(29 + 16 * gap) / clock, Fraction(53 + 32 * gap) / clock
    host_us = Fraction(data["host"]["transaction_us"])
    is_broadcast = cycle["schedule"] == "broadcast"

    def packets(kind: str, size: int) -> tuple[int, int]:
        paper_bytes = size + int(payload["overhead_bytes"])
        return (paper_bytes, paper_bytes) if model == "paper" else _standard_packets(kind, size)

    def data_us(size: int) -> Fraction:
        return way_us + Fraction(8 * size) / rate

    def transaction_us(kind: str) -> Fraction:
        size, execution = payload[f"{kind}_bytes"], node["execution"]
        execution_us = Fraction(execution["base_us"]) + Fraction(execution["per_byte_us"]) * size
        request, response = packets(kind, size)
        half_us = arbitration_us + data_us(request) + acknowledge_us
        answer = node[f"{kind}_response"]
        if model == "paper":
            both_us = half_us + arbitration_us + data_us(response) + acknowledge_us
            return Fraction(both_us + execution_us + Fraction(82 + 48 * gap) / clock)
        if answer == "unified":
            return half_us + max(reset_us, host_us)
        if answer == "concatenated":
            second_us = Fraction(node["response_us"]) + data_us(response) + acknowledge_us
            return Fraction(half_us + second_us + max(reset_us, host_us))
        # Any faster node, too: the largest lies at an end or just below the arbitration reset gap.
        most_us = execution_us + Fraction(execution["worst_extra_us"])
        first_us = reset_us if nodes == 1 else max(sub_us, min(most_us, reset_us))
        waits_us = max(first_us + max(reset_us, host_us), most_us + max(sub_us, host_us))
        return Fraction(half_us + arbitration_us + data_us(response) + acknowledge_us + waits_us)

    total = Fraction(cycle["nonperiodic_us"])
    total += _broadcasts_us(data, nodes) if is_broadcast else nodes * (transaction_us("read") + transaction_us("write"))
    if model == "paper":
        sync = cycle["sync"]
        return total + Fraction(sync["ping_us"]) + Fraction(sync["ping_per_node_us"]) * (nodes - 1)
    if is_broadcast:
        largest = 24 + nodes * _filled(payload["write_bytes"])
    else:
        total += arbitration_us + data_us(20) + reset_us
        largest = max(packets(kind, payload[f"{kind}_bytes"])[0] for kind in ("read", "write"))
    total += cycle["retries"] * (arbitration_us + data_us(largest) + acknowledge_us + reset_us)
    total += Fraction(extra_us)
    if bus["cycle_master"]:
        start_us = reset_us + arbitration_us + way_us + Fraction(160) / base + Fraction(bus["isochronous_us"])
        total += _number_of_starts(total, start_us) * start_us
    # A cycle start before the late host sends delays nothing.
    return Fraction(total + Fraction(bus["sync_jitter_us"]))


def _filled(size: int) -> int:
    """A payload in whole quadlets, with the quadlet before it."""
    return -(-size // 4) * 4 + 4


def _broadcasts_us(data: dict[str, Any], nodes: int) -> Fraction:
    """One query, a broadcast of each node, one read of the hub, one write, the steps of the protocol one by one."""
    bus, payload, cycle, host_us = data["bus"], data["payload"], data["cycle"], Fraction(data["host"]["transaction_us"])
    hops, gap = _setup(bus, nodes)
    base, rate = Fraction("98.304"), {"S100": 1, "S200": 2, "S400": 4}[bus["speed"]] * Fraction("98.304")
    phy_us = Fraction(14) / base if bus["phy_delay_us"] is None else Fraction(bus["phy_delay_us"])
    way_us = hops * (Fraction("0.023") * Fraction(bus["cable_length_m"]) / Fraction("4.5") + phy_us)
    sub_us, reset_us, hold_us = Fraction(29 + 16 * gap) / base, Fraction(53 + 32 * gap) / base, Fraction("1.63")
    is_fast = cycle["broadcast_request"] != "priority"
    slot_us = Fraction(256) / Fraction("49.152") if cycle["broadcast_request"] == "timed" else 0
    gap_us, asked_us = (0, way_us + hold_us) if is_fast else (sub_us, way_us + hold_us + Fraction(4 * gap) / base)

    def sent_us(size: int) -> Fraction:
        """Arbitration and data of a packet of the host."""
        return way_us + hold_us + Fraction(4 * gap) / base + way_us + Fraction(8 * size) / rate

    acknowledge_us = way_us + Fraction("0.25")
    now_us = asked_at_us = sent_us(20) + acknowledge_us
    now_us += max(Fraction(0), Fraction(150) / Fraction("49.152") - gap_us)
    first_us = now_us
    for place in range(nodes):
        now_us = max(now_us, first_us + place * slot_us)
        now_us += gap_us + asked_us + way_us + Fraction(8 * (24 + _filled(payload["read_bytes"]))) / rate
    now_us = max(now_us + reset_us, max(now_us, asked_at_us + 10 + 5 * nodes) + host_us)
    now_us += sent_us(20) + acknowledge_us
    now_us += way_us + Fraction(8 * (24 + nodes * _filled(payload["read_bytes"]) + 4)) / rate + acknowledge_us
    now_us += max(reset_us, host_us)
    now_us += sent_us(24 + nodes * _filled(payload["write_bytes"])) + acknowledge_us
    return Fraction(now_us + max(reset_us, host_us))


def _setup(bus: dict[str, Any], nodes: int) -> tuple[int, int]:
    """Hops, and gap count in force."""
    hops = int(nodes if bus["max_hops"] is None else bus["max_hops"])
    if bus["gap_count"] == "optimal":
        return hops, GAP_COUNTS[hops - 1] if hops <= 23 else 63
    return hops, int(bus["gap_count"])


def _standard_packets(kind: str, size: int) -> tuple[int, int]:
    """Bytes of request and response."""
    padded = -(-size // 4) * 4
    if kind == "read":
        return (16, 20) if size == 4 else (20, 24 + padded)
    return (20, 16) if size == 4 else (24 + padded, 16)


def _number_of_starts(others_us: Fraction, start_us: Fraction) -> int:
    """The smallest fixed point; where no time is left, which is a broken limit, any finite number."""
    if start_us > 124:
        return int(others_us) + 1
    starts = 1
    while starts != (others_us + starts * start_us) // 125 + 1:
        starts += 1
    return starts


def table_1_residuals_us() -> list[float]:
    """What each row of Table I has beyond (13) at one hop and gap count 63, with the standard's clock and packets."""
    hop_us = 0.023 + 14 / 98.304
    fixed_us = (hop_us + 4 * 63 / 98.304 + 1.63) + hop_us + (hop_us + 0.25)
    return [us - fixed_us - 8 * (20 if size == 4 else 24 + size) / 393.216 for size, us in TABLE_1]


def _host_doubt_us(host: dict[str, Any]) -> float:
    """Standard uncertainty of the host's time [us]."""
    share = 1 / sqrt(3) if host["grade"] == "assumed" else 0.1
    return float(share * host["transaction_us"] if host["uncertainty_us"] is None else host["uncertainty_us"])


def exact_safe_required_us(profile: busplan.Profile, nodes: int) -> Fraction:
    """What the slice must give for a cycle to be shown to fit; exact but for its bias and its uncertainty."""
    data = profile.model_dump()
    if data["cycle"]["schedule"] == "broadcast":
        return _safe_broadcasts_us(profile, nodes)
    bus, node, host, retries = data["bus"], data["node"], data["host"], data["cycle"]["retries"]
    execution = node["execution"]
    hops, gap = _setup(bus, nodes)
    is_fitted = execution["residual"] == "standard"
    residuals_us = table_1_residuals_us()
    mean_us, spread_us = fmean(residuals_us), stdev(residuals_us) * sqrt(1 + 1 / 8)
    gap_term_us = 2 * (63 - gap) / 98.304
    # A fitted execution time holds the error of the transactions that have one, the split ones, and of no others.
    split_mean_us, split_spread_us, split_gap_term_us = mean_us, spread_us, gap_term_us
    if is_fitted:
        split_mean_us, split_spread_us = 0.0, 0.0
        split_gap_term_us = 2 * (execution["measured_gap_count"] - gap) / 98.304
    sub_us, reset_us = (29 + 16 * gap) / 98.304, (53 + 32 * gap) / 98.304
    answers = {kind: node[f"{kind}_response"] for kind in ("read", "write")}
    split = nodes * sum(2 for answer in answers.values() if answer == "split")
    others = nodes * sum({"split": 0, "unified": 1, "concatenated": 2}[answer] for answer in answers.values()) + retries

    def waits_us(answer: str, execution_us: float, host_us: float) -> float:
        if answer != "split":
            return max(reset_us, host_us)
        first_us = reset_us if nodes == 1 else max(sub_us, min(execution_us, reset_us))
        return max(first_us + max(reset_us, host_us), execution_us + max(sub_us, host_us))

    def swing_us(kind: str, *, execution_us: float, host_us: float) -> float:
        """The larger of two standard uncertainties up and two down, halved: at a kink more than a central step."""
        own_us = execution["base_us"] + execution["per_byte_us"] * data["payload"][f"{kind}_bytes"]
        at = [
            waits_us(
                answers[kind],
                own_us + execution["worst_extra_us"] + step * execution_us,
                host["transaction_us"] + step * host_us,
            )
            for step in (-2, 0, 2)
        ]
        return max(at[2] - at[1], at[1] - at[0]) / 2

    def execution_doubt_us(kind: str) -> float:
        own_us = execution["base_us"] + execution["per_byte_us"] * data["payload"][f"{kind}_bytes"]
        by_grade = {"measured": 0.1 / sqrt(12), "derived": 1 / sqrt(3), "assumed": own_us / sqrt(3)}
        said_us = execution["uncertainty_us"]
        return float(by_grade.get(execution["grade"], 0.1 * own_us) if said_us is None else said_us)

    host_doubt_us = _host_doubt_us(host)
    # The delay of all hops stands once in each arbitration, in each packet's data and in each acknowledge.
    hop_delays = nodes * sum({"split": 6, "concatenated": 5, "unified": 3}[answer] for answer in answers.values())
    hop_delays += 2 + 3 * retries + 2 * _starts(profile, nodes)
    doubts_us = (
        split * split_spread_us + others * spread_us,
        (split * split_gap_term_us + others * gap_term_us) / sqrt(3),
        nodes * sum(swing_us(kind, execution_us=execution_doubt_us(kind), host_us=0.0) for kind in answers),
        0.0 if bus["phy_delay_us"] is not None else hop_delays * hops * 0.020 / sqrt(3),
        nodes * sum(swing_us(kind, execution_us=0.0, host_us=host_doubt_us) for kind in answers),
    )
    bias_us = split * (split_mean_us + split_gap_term_us) + others * (mean_us + gap_term_us)
    extra_us = bias_us + 2 * sqrt(sum(us**2 for us in doubts_us))
    needed = exact_required_us(profile, "standard", nodes, extra_us=extra_us)
    return needed / (1 - Fraction(data["limits"]["reserve"]))


def _safe_broadcasts_us(profile: busplan.Profile, nodes: int) -> Fraction:
    """The same for the broadcast schedule: each of its packets is half a transaction."""
    data = profile.model_dump()
    bus, host, cycle = data["bus"], data["host"], data["cycle"]
    hops, gap = _setup(bus, nodes)
    residuals_us = table_1_residuals_us()
    packets = nodes + 4 + cycle["retries"]
    with_gap = packets if cycle["broadcast_request"] == "priority" else packets - nodes
    gap_term_us = 2 * (63 - gap) / 98.304
    step_us = _host_doubt_us(host)

    def at(steps: int) -> float:
        """The cycle with another time of the host, without starts: only the difference is used."""
        return float(
            exact_required_us(_with(profile, host_us=host["transaction_us"] + steps * step_us), "standard", nodes)
        )

    own_us = at(0)
    hop_delays = 11 + 2 * nodes + 3 * cycle["retries"] + 2 * _starts(profile, nodes)
    doubts_us = (
        packets * stdev(residuals_us) * sqrt(1 + 1 / 8),
        with_gap * gap_term_us / sqrt(3),
        0.0 if bus["phy_delay_us"] is not None else hop_delays * hops * 0.020 / sqrt(3),
        max(at(2) - own_us, own_us - at(-2)) / 2,
    )
    extra_us = packets * fmean(residuals_us) + with_gap * gap_term_us + 2 * sqrt(sum(us**2 for us in doubts_us))
    needed = exact_required_us(profile, "standard", nodes, extra_us=extra_us)
    return needed / (1 - Fraction(data["limits"]["reserve"]))


def carries_broadcasts(profile: busplan.Profile, nodes: int) -> bool:
    """Whether a hub collects the data of so many nodes, and its block and the write fit a packet."""
    data = profile.model_dump()
    if data["cycle"]["schedule"] != "broadcast":
        return True
    most = {"S100": 512, "S200": 1024, "S400": 2048}[data["bus"]["speed"]]
    read, write = (_filled(data["payload"][f"{kind}_bytes"]) for kind in ("read", "write"))
    return nodes <= 16 and nodes * read + 4 <= most and nodes * write <= most


def _with(profile: busplan.Profile, *, host_us: float) -> busplan.Profile:
    """The same network without cycle starts, with another time of the host."""
    plain: Any = profile
    bus = plain.bus.model_copy(update={"cycle_master": False})
    host = plain.host.model_copy(update={"transaction_us": host_us})
    return profile.model_copy(update={"bus": bus, "host": host})


def _starts(profile: busplan.Profile, nodes: int) -> int:
    """Cycle starts in a cycle, from what it needs with and without them."""
    bus: Any = profile.bus
    if not bus.cycle_master:
        return 0
    alone = profile.model_copy(update={"bus": bus.model_copy(update={"cycle_master": False})})
    others_us = exact_required_us(alone, "standard", nodes)
    required_us = exact_required_us(profile, "standard", nodes)
    return round((required_us - others_us) / exact_cycle_start_us(profile, nodes))


def exact_cycle_start_us(profile: busplan.Profile, nodes: int) -> Fraction:
    """What one cycle start costs; 0 where none are sent. Beyond 124 us there is no time for anything else."""
    bus: Any = profile.bus
    if not bus.cycle_master:
        return Fraction(0)
    hops, gap = _setup(bus.model_dump(), nodes)
    phy_us = Fraction(14) / Fraction("98.304") if bus.phy_delay_us is None else Fraction(bus.phy_delay_us)
    hop_us = Fraction("0.023") * Fraction(bus.cable_length_m) / Fraction("4.5") + phy_us
    gaps_us = Fraction(53 + 32 * gap + 4 * gap + 160) / Fraction("98.304") + Fraction("1.63")
    return gaps_us + 2 * hops * hop_us + Fraction(bus.isochronous_us)
