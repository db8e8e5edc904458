"""A second, exact implementation of the cycle, and profiles to try it on."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import strategies as st

from busplan.buses.ieee1394.section import Ieee1394Profile
from busplan.sections.profile import Profile

# By hand from the standard's gap-count table, 1 to 23 hops.
GAP_COUNTS = [5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43, 46, 48, 51, 54, 57, 59, 62]


def exact_required_us(profile: Profile, model: str, nodes: int) -> Fraction:
    """Required time of a cycle in exact arithmetic, written from the equations and from nothing of busplan."""
    data = profile.model_dump()
    bus, payload, node, cycle = data["bus"], data["payload"], data["node"], data["cycle"]
    rate = {"S100": Fraction("98.304"), "S200": Fraction("196.608"), "S400": Fraction("393.216")}[bus["speed"]]
    base = Fraction("98.304")
    clock = rate if model == "paper" else base
    hops = nodes if bus["max_hops"] is None else bus["max_hops"]
    gap = bus["gap_count"]
    if gap == "optimal":
        gap = GAP_COUNTS[hops - 1] if hops <= 23 else 63
    phy_us = Fraction(14) / clock if bus["phy_delay_us"] is None else Fraction(bus["phy_delay_us"])
    way_us = hops * (Fraction("0.023") * Fraction(bus["cable_length_m"]) / Fraction("4.5") + phy_us)
    arbitration_us = way_us + Fraction(4 * gap) / clock + Fraction("1.63")
    acknowledge_us = way_us + Fraction("0.25")
    sub_us, reset_us = Fraction(29 + 16 * gap) / clock, Fraction(53 + 32 * gap) / clock
    host_us = Fraction(data["host"]["transaction_us"])

    def packets(kind: str, size: int) -> tuple[int, int]:
        if model == "paper":
            return size + payload["overhead_bytes"], size + payload["overhead_bytes"]
        padded = -(-size // 4) * 4
        if kind == "read":
            return (16, 20) if size == 4 else (20, 24 + padded)
        return (20, 16) if size == 4 else (24 + padded, 16)

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
            return both_us + execution_us + Fraction(82 + 48 * gap) / clock
        if answer == "unified":
            return half_us + max(reset_us, host_us)
        if answer == "concatenated":
            second_us = Fraction(node["response_us"]) + data_us(response) + acknowledge_us
            return half_us + second_us + max(reset_us, host_us)
        # Any faster node, too: the largest lies at an end or just below the arbitration reset gap.
        most_us = execution_us + Fraction(execution["worst_extra_us"])
        first_us = reset_us if nodes == 1 else max(sub_us, min(most_us, reset_us))
        waits_us = max(first_us + max(reset_us, host_us), most_us + max(sub_us, host_us))
        return half_us + arbitration_us + data_us(response) + acknowledge_us + waits_us

    total = Fraction(cycle["nonperiodic_us"]) + nodes * (transaction_us("read") + transaction_us("write"))
    if model == "paper":
        sync = cycle["sync"]
        return total + Fraction(sync["ping_us"]) + Fraction(sync["ping_per_node_us"]) * (nodes - 1)
    total += arbitration_us + data_us(20) + reset_us
    largest = max(packets(kind, payload[f"{kind}_bytes"])[0] for kind in ("read", "write"))
    total += cycle["retries"] * (arbitration_us + data_us(largest) + acknowledge_us + reset_us)
    if bus["cycle_master"]:
        start_us = reset_us + arbitration_us + way_us + Fraction(160) / base + Fraction(bus["isochronous_us"])
        starts = 1
        if start_us > 124:  # no time is left: a broken limit, and any finite number
            starts = total // 1 + 1
        while start_us <= 124 and starts != (total + starts * start_us) // 125 + 1:
            starts += 1
        total += starts * start_us
    return total


def make_profile(**changes: Any) -> Profile:
    """Make a profile from a plain one and new values by dotted key with __ for the dot."""
    data: dict[str, Any] = {
        "schema_version": 1,
        "name": "test",
        "bus": {"kind": "ieee1394", "speed": "S400", "gap_count": 63, "nodes": 2, "timing_model": "standard"},
        "cycle": {"period_us": 4000.0, "slice_ratio": 0.5, "sync": {}},
        "payload": {"read_bytes": 12, "write_bytes": 12},
        "node": {"axes": 4, "execution": {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}},
    }
    for key, value in changes.items():
        *tables, last = key.split("__")
        table = data
        for name in tables:
            table = table[name]
        table[last] = value
    return Ieee1394Profile.model_validate(data)


@st.composite
def profiles(draw: st.DrawFn) -> Profile:
    """Random profiles over the whole range that a plan may have; half of them with what the paper cannot express."""
    master = draw(st.booleans())
    own: dict[str, Any] = {
        "bus__cycle_master": master,
        "bus__isochronous_us": draw(st.floats(0.0, 125.0)) if master else 0.0,
        "bus__phy_delay_us": draw(st.one_of(st.none(), st.floats(0.01, 0.2))),
        "cycle__retries": draw(st.integers(0, 5)),
        "host": {"transaction_us": draw(st.one_of(st.just(0.0), st.floats(0.0, 60.0)))},
        "node__read_response": draw(st.sampled_from(["split", "concatenated"])),
        "node__write_response": draw(st.sampled_from(["split", "unified"])),
        "node__response_us": draw(st.floats(0.0, 1.63)),
        "node__execution__worst_extra_us": draw(st.floats(0.0, 10.0)),
    }
    return make_profile(
        **(own if draw(st.booleans()) else {}),
        node__execution__grade=draw(st.sampled_from([None, "measured", "derived", "assumed"])),
        node__execution__residual=draw(st.sampled_from(["none", "paper", "standard"])),
        node__execution__measured_gap_count=draw(st.integers(0, 63)),
        bus__speed=draw(st.sampled_from(["S100", "S200", "S400"])),
        bus__gap_count=draw(st.one_of(st.integers(0, 63), st.just("optimal"))),
        bus__nodes=draw(st.integers(1, 80)),
        bus__max_hops=draw(st.one_of(st.none(), st.integers(1, 20))),
        bus__cable_length_m=draw(st.sampled_from([0.5, 2.0, 4.5])),
        bus__timing_model=draw(st.sampled_from(["paper", "standard"])),
        cycle__period_us=draw(st.floats(1.0, 50_000.0)),
        cycle__slice_ratio=draw(st.floats(0.01, 1.0)),
        cycle__nonperiodic_us=draw(st.one_of(st.just(0.0), st.floats(0.0, 500.0))),
        cycle__sync__ping_us=draw(st.floats(0.0, 5.0)),
        cycle__sync__ping_per_node_us=draw(st.floats(0.0, 5.0)),
        payload__read_bytes=draw(st.integers(1, 3000)),
        payload__write_bytes=draw(st.integers(1, 3000)),
        payload__overhead_bytes=draw(st.integers(0, 40)),
        node__axes=draw(st.integers(1, 8)),
        node__execution__base_us=draw(st.floats(0.0, 100.0)),
        node__execution__per_byte_us=draw(st.floats(0.0, 1.0)),
    )


@pytest.fixture(scope="session")
def make() -> Callable[..., Profile]:
    """Maker of profiles."""
    return make_profile


@pytest.fixture(scope="session")
def exact() -> Callable[[Profile, str, int], Fraction]:
    """The exact second implementation."""
    return exact_required_us


@pytest.fixture(scope="session")
def any_profile() -> st.SearchStrategy[Profile]:
    """Random profiles."""
    return profiles()


@pytest.fixture(scope="session")
def profiles_by_kind() -> dict[str, st.SearchStrategy[Profile]]:
    """Random profiles of every kind of bus; a new kind is tried on all that holds of any by a line here."""
    return {"ieee1394": profiles()}
