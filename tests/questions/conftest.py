"""Random profiles of every kind of bus, and figures in blocks."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.forms.blocks import ShownValue


def profile_of(data: dict[str, Any]) -> busplan.Profile:
    """The profile that a file with these values holds."""
    return kind_named(data["bus"]["kind"]).profile_model().model_validate(data)


def make_profile(**changes: Any) -> busplan.Profile:
    """Make a profile from a plain one and new values by dotted key with __ for the dot."""
    data: dict[str, Any] = {
        "schema_version": 1,
        "name": "test",
        "bus": {"kind": "ieee1394", "speed": "S400", "gap_count": 63, "nodes": 2},
        "cycle": {"period_us": 4000.0, "slice_ratio": 0.5, "sync": {}},
        "payload": {"read_bytes": 12, "write_bytes": 12},
        "node": {"axes": 4, "execution": {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}},
    }
    for key, value in changes.items():
        *tables, last = key.split("__")
        table = data
        for name in tables:
            table = table.setdefault(name, {})
        table[last] = value
    return profile_of(data)


def often_few(few: int, most: int) -> st.SearchStrategy[int]:
    """Numbers from 1, half of them few: some plans fit, and some do not."""
    return st.one_of(st.integers(1, few), st.integers(1, most))


RATIOS = st.one_of(st.just(1.0), st.floats(0.1, 1.0))
# A strategy costs more to make than to draw from: each is made once.
TRUTHS = st.booleans()
OF_ALL: dict[str, st.SearchStrategy[Any]] = {
    "node__execution__grade": st.sampled_from([None, "measured", "derived", "assumed"]),
    "node__execution__residual": st.sampled_from(["none", "paper", "standard"]),
    "node__execution__measured_gap_count": st.integers(0, 63),
    "bus__speed": st.sampled_from(["S100", "S200", "S400"]),
    "bus__gap_count": st.one_of(st.integers(0, 63), st.just("optimal")),
    "bus__nodes": often_few(6, 80),
    "bus__max_hops": st.one_of(st.none(), st.integers(1, 20)),
    "bus__cable_length_m": st.sampled_from([0.5, 2.0, 4.5]),
    "cycle__period_us": st.floats(1.0, 50_000.0),
    "cycle__slice_ratio": st.floats(0.01, 1.0),
    "cycle__nonperiodic_us": st.one_of(st.just(0.0), st.floats(0.0, 500.0)),
    "cycle__sync__ping_us": st.floats(0.0, 5.0),
    "cycle__sync__ping_per_node_us": st.floats(0.0, 5.0),
    "payload__read_bytes": often_few(64, 3000),
    "payload__write_bytes": often_few(64, 3000),
    "payload__overhead_bytes": st.integers(0, 40),
    "node__axes": st.integers(1, 8),
    "node__execution__base_us": st.floats(0.0, 100.0),
    "node__execution__per_byte_us": st.floats(0.0, 1.0),
}
OF_STANDARD: dict[str, st.SearchStrategy[Any]] = {
    "bus__phy_delay_us": st.one_of(st.none(), st.floats(0.01, 0.2)),
    "cycle__retries": st.integers(0, 5),
    "cycle__schedule": st.sampled_from(["individual", "broadcast"]),
    "cycle__broadcast_request": st.sampled_from(["isochronous", "priority", "timed"]),
    "host__transaction_us": st.one_of(st.just(0.0), st.floats(0.0, 60.0)),
    "bus__sync_jitter_us": st.one_of(st.just(0.0), st.floats(0.0, 300.0)),
    "node__read_response": st.sampled_from(["split", "concatenated"]),
    "node__write_response": st.sampled_from(["split", "unified"]),
    "node__response_us": st.floats(0.0, 1.63),
    "node__execution__worst_extra_us": st.floats(0.0, 10.0),
}
"""What the paper cannot express."""
ISOCHRONOUS_US = st.floats(0.0, 40.0)
HUB_NODES = st.integers(1, 18)
"""A hub collects of 16 nodes; some are beyond it."""


@st.composite
def profiles(draw: st.DrawFn) -> busplan.Profile:
    """Random profiles over the whole range that a plan may have; half of them with what the paper cannot express."""
    chosen: dict[str, Any] = {key: draw(one) for key, one in OF_ALL.items()}
    if draw(TRUTHS):
        chosen |= {key: draw(one) for key, one in OF_STANDARD.items()}
        chosen["bus__cycle_master"] = draw(TRUTHS)
        if chosen["bus__cycle_master"]:
            chosen["bus__isochronous_us"] = draw(ISOCHRONOUS_US)
        if chosen["cycle__schedule"] == "broadcast":
            chosen["bus__nodes"] = draw(HUB_NODES)
    return make_profile(**chosen)


@pytest.fixture(scope="session")
def make() -> Callable[..., busplan.Profile]:
    """Maker of profiles."""
    return make_profile


@pytest.fixture(scope="session")
def any_profile() -> st.SearchStrategy[busplan.Profile]:
    """Random profiles."""
    return profiles()


@pytest.fixture(scope="session")
def profiles_by_kind() -> dict[str, st.SearchStrategy[busplan.Profile]]:
    """Random profiles of every kind of bus; a new kind is tried on all that holds of any by a line here."""
    return {
        "ieee1394": profiles(),
        "can": can_profiles(),
        "ethercat": ethercat_profiles(),
        "sercos3": sercos_profiles(_sercos3_bus()),
        "sercos2": sercos_profiles(_sercos2_bus()),
        "polled": sercos_profiles(_polled_bus(), (2000.0, 10_000.0, 50_000.0)),
    }


def _polled_bus() -> st.SearchStrategy[dict[str, Any]]:
    """Each protocol with each way to ask, global control and retries where it has them."""
    ways = {
        "profibus-dp": ["exchange"],
        "modbus-rtu": ["exchange", "single"],
        "dynamixel-2": ["sync", "fast-sync", "single"],
        "feetech": ["sync", "single"],
        "worldfip": ["single"],
        "mesa-hm2-eth": ["single"],
    }

    def of_protocol(protocol: str) -> st.SearchStrategy[dict[str, Any]]:
        is_profibus = protocol == "profibus-dp"
        return st.fixed_dictionaries(
            {
                "kind": st.just("polled"),
                "protocol": st.just(protocol),
                "nodes": often_few(3, 20),
                "bit_rate_kbit_s": st.sampled_from([115.2, 500.0, 1000.0]),
                "requests": st.sampled_from(ways[protocol]),
                "reads": st.integers(1, 3),
                "writes": st.integers(1, 3),
                "adapter": st.sampled_from(
                    ["none", "ftdi-low-latency", "ftdi", {"timer_us": 500.0, "packet_bytes": 8}]
                ),
                "host_us": st.floats(0.0, 200.0),
                "master_jitter_us": st.one_of(st.just(0.0), st.floats(0.0, 300.0)),
                "global_control": st.just(is_profibus),
                "retries": st.integers(0, 2),
                "timeout_us": st.floats(0.0, 3000.0),
                "max_turn_bits": st.one_of(st.none(), st.floats(40.0, 100.0)),
                "return_delay_us": st.none() if is_profibus else st.one_of(st.none(), st.floats(0.0, 500.0)),
            }
        )

    return st.sampled_from(sorted(ways)).flatmap(of_protocol)


def _sercos3_bus() -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries(
        {
            "kind": st.just("sercos3"),
            "nodes": often_few(3, 20),
            "version": st.sampled_from(["V1.0", "V1.1"]),
            "hot_plug_field": st.sampled_from(["first", "all"]),
            "timing_method": st.sampled_from(["mdt-at-ucc", "mdt-ucc-at", "at-last"]),
            "gap_bytes": st.integers(12, 60),
            "device_delay_us": st.floats(0.0, 2.0),
            "master_jitter_us": st.floats(0.0, 5.0),
            "master_delay_us": st.floats(0.0, 5.0),
        }
    )


def _sercos2_bus() -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries(
        {
            "kind": st.just("sercos2"),
            "nodes": often_few(3, 20),
            "data_rate_mbit_s": st.sampled_from([2, 4, 8, 16]),
            "at_gap_us": st.floats(0.0, 20.0),
            "at_start_us": st.one_of(st.none(), st.floats(0.0, 20.0)),
            "turnaround_us": st.floats(0.0, 20.0),
            "recovery_us": st.floats(0.0, 20.0),
        }
    )


@st.composite
def sercos_profiles(
    draw: st.DrawFn,
    bus: st.SearchStrategy[dict[str, Any]],
    periods_us: tuple[float, ...] = (125.0, 250.0, 500.0, 1000.0, 1100.0),
) -> busplan.Profile:
    """Random profiles of a SERCOS or polled bus, at periods that SERCOS allows and at one that it does not."""
    own = draw(bus)
    data = {
        "schema_version": 1,
        "name": "test",
        "bus": own,
        "cycle": {
            "period_us": draw(st.sampled_from(periods_us)),
            "slice_ratio": draw(RATIOS),
            "nonperiodic_us": draw(st.sampled_from([0.0, 0.0, 55.5])),
        },
        "payload": {"read_bytes": draw(often_few(16, 200)), "write_bytes": draw(often_few(16, 200))},
        "node": {
            "axes": draw(st.integers(1, 3)),
            "execution": {"kind": "linear", "base_us": draw(st.floats(0.0, 100.0)), "per_byte_us": 0.1},
        },
    }
    return profile_of(data)


@st.composite
def can_profiles(draw: st.DrawFn) -> busplan.Profile:
    """Random profiles of a CAN bus, on some of which other messages run, with room for a few dozen nodes at most."""
    messages = [
        {
            "name": f"m{place}",
            "identifier": draw(st.integers(0, 0x7FF)),
            "payload_bytes": draw(st.integers(0, 8)),
            "period_us": float(draw(st.integers(2000, 20_000))),
            "jitter_us": float(draw(st.integers(0, 2000))),
            "deadline_us": draw(st.one_of(st.none(), st.none(), st.floats(500.0, 20_000.0))),
        }
        for place in range(draw(st.sampled_from([0, 0, 1, 3])))
    ]
    data = {
        "schema_version": 1,
        "name": "test",
        "bus": {
            "kind": "can",
            "bit_rate_kbit_s": draw(st.sampled_from([250, 500, 1000])),
            "identifier_bits": draw(st.sampled_from([11, 29])),
            "nodes": draw(often_few(3, 20)),
            "sync_counter": draw(st.booleans()),
        },
        "cycle": {
            "period_us": draw(st.one_of(st.floats(300.0, 6000.0), st.floats(3000.0, 20_000.0))),
            "slice_ratio": draw(RATIOS),
            "nonperiodic_us": draw(st.sampled_from([0.0, 0.0, 55.5])),
        },
        "payload": {
            "pdo_per": draw(st.sampled_from(["node", "axis"])),
            "read_bytes": draw(often_few(8, 40)),
            "write_bytes": draw(often_few(8, 40)),
        },
        "node": {
            "axes": draw(st.integers(1, 3)),
            "execution": {
                "kind": "linear",
                "grade": draw(st.sampled_from([None, "measured", "derived", "assumed"])),
                "base_us": draw(st.floats(0.0, 100.0)),
                "per_byte_us": draw(st.floats(0.0, 1.0)),
                "worst_extra_us": draw(st.sampled_from([0.0, 30.5])),
            },
        },
        "limits": {"max_load": draw(st.sampled_from([0.5, 0.8, 0.999]))},
        "message": messages,
    }
    return profile_of(data)


@st.composite
def ethercat_profiles(draw: st.DrawFn) -> busplan.Profile:
    """Random profiles of an EtherCAT segment, from a frame that is padded to several, with room for some hundred."""
    data = {
        "schema_version": 1,
        "name": "test",
        "bus": {
            "kind": "ethercat",
            "nodes": draw(often_few(5, 40)),
            "master": draw(st.sampled_from([None, "SOEM", "TwinCAT"])),
            "process_data": draw(st.sampled_from([None, "LRW-shared", "LRD-LWR"])),
            "distributed_clocks": draw(st.booleans()),
            "mailbox_polls": draw(st.integers(0, 2)),
            "mailbox_bytes": draw(st.sampled_from([1, 128, 1486])),
            "master_us": draw(st.sampled_from([0.0, 12.5])),
            "master_uncertainty_us": draw(st.sampled_from([None, 2.0])),
            "master_jitter_us": draw(st.sampled_from([0.0, 7.5])),
            "sync_shift": draw(st.sampled_from([0.0, 0.5])),
        },
        "cycle": {
            "period_us": draw(st.floats(60.0, 900.0)),
            "slice_ratio": draw(RATIOS),
            "nonperiodic_us": draw(st.sampled_from([0.0, 0.0, 55.5])),
        },
        "payload": {"read_bytes": draw(often_few(16, 800)), "write_bytes": draw(often_few(16, 800))},
        "node": {
            "axes": draw(st.integers(1, 3)),
            "port": draw(st.sampled_from(["100BASE-TX", "E-bus"])),
            "delay_us": draw(st.one_of(st.none(), st.floats(0.5, 1.0))),
            "cable_length_m": draw(st.sampled_from([0.0, 2.5, 100.0, 101.0])),
            "execution": {"kind": "linear", "grade": "assumed", "base_us": 50.0, "per_byte_us": 0.1},
        },
    }
    return profile_of(data)


def values_in(item: object) -> Iterator[ShownValue]:
    """Every figure in a block, or in several, in reading order."""
    if isinstance(item, ShownValue):
        yield item
    elif isinstance(item, tuple):
        for one in item:
            yield from values_in(one)


@pytest.fixture(name="values_in")
def values_in_fixture() -> Callable[[object], Iterator[ShownValue]]:
    """Every figure in a block, or in several, in reading order."""
    return values_in
