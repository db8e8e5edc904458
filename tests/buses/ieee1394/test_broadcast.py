"""The broadcast schedule: by hand, against a simulated bus, and what every question makes of it."""

import importlib.util
from collections.abc import Callable
from itertools import pairwise
from math import sqrt
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.ieee1394.broadcast import BroadcastCycle
from busplan.buses.ieee1394.kind import packets_of
from busplan.buses.ieee1394.section import Ieee1394Profile
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.questions.fit.circle_refusal import loop_delays_us
from busplan.questions.fit.figures import CapacityFigures
from busplan.questions.fit.network import network_of

DVRK = busplan.load_profile("dvrk")
ROUNDING_US = 1e-6
CYCLES = 3


def _simulation() -> ModuleType:
    path = Path(__file__).parents[2] / "oracles" / "bus_simulation.py"
    spec = importlib.util.spec_from_file_location("bus_simulation", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SIMULATED = _simulation()
BUS = kind_named("ieee1394")


def standard(profile: busplan.Profile) -> CapacityFigures:
    """Figures by the standard's timing model."""
    (figures,) = busplan.capacity(profile, timing_model="standard").results
    return figures


def required_us(profile: busplan.Profile, **changes: object) -> float:
    changed = busplan.load_profile(profile, changes={key.replace("__", "."): value for key, value in changes.items()})
    return standard(changed).required_us


def cycle_of(profile: busplan.Profile) -> BroadcastCycle:
    """Its cycle by the standard's timing model."""
    cycle = BUS.cycle(network_of(profile), model="standard")
    assert isinstance(cycle, BroadcastCycle)
    return cycle


# --- by hand ----------------------------------------------------------------------------------------------

# Eight boards in a chain at S400, gap count 21, 8 hops: a hop 0.023 + 14 / 98.304 = 0.165415 us.
WAY_US = 8 * (0.023 + 14 / 98.304)
ARBITRATION_US = WAY_US + 84 / 98.304 + 1.63
ACKNOWLEDGE_US = WAY_US + 0.25
SUB_US, RESET_US = 365 / 98.304, 725 / 98.304


def data_us(size: int) -> float:
    return WAY_US + 8 * size / 393.216


QUERY_US = ARBITRATION_US + data_us(20) + ACKNOWLEDGE_US
HUB_US = ARBITRATION_US + data_us(20) + ACKNOWLEDGE_US + data_us(24 + 8 * 132 + 4) + ACKNOWLEDGE_US
WRITE_US = ARBITRATION_US + data_us(24 + 8 * 24) + ACKNOWLEDGE_US


def test_the_kit_by_hand_with_both_kinds_of_request() -> None:
    # T_sub is longer than the first board's 150 clocks, 3.052 us.
    boards_us = 8 * (SUB_US + ARBITRATION_US + data_us(28 + 128))
    by_hand_us = QUERY_US + boards_us + RESET_US + HUB_US + RESET_US + WRITE_US + RESET_US
    assert required_us(DVRK) == pytest.approx(by_hand_us, rel=1e-12)
    assert by_hand_us == pytest.approx(168.541, abs=5e-4)
    fast_us = 150 / 49.152 + 8 * (WAY_US + 1.63 + data_us(28 + 128))
    assert fast_us == pytest.approx(62.656, abs=5e-4)  # longer than the host's wait of 50 us
    by_hand_us += fast_us - boards_us
    assert required_us(DVRK, cycle__broadcast_request="isochronous") == pytest.approx(by_hand_us, rel=1e-12)


def test_with_firmware_up_to_rev_7_each_board_has_a_time_of_its_own() -> None:
    # JHU FireWire.v: 256 N + 150 clocks of 49.152 MHz behind N others; the kit's 128 bytes take longer than 256.
    timed: dict[str, object] = {"cycle.broadcast_request": "timed"}
    assert required_us(busplan.load_profile(DVRK, changes=timed)) == required_us(
        DVRK, cycle__broadcast_request="isochronous"
    )
    small = {**timed, **{f"group.{name}.read_bytes": 4 for name in ("full", "partial")}}
    cycle = cycle_of(busplan.load_profile(DVRK, changes=small))
    sent_us = WAY_US + 1.63 + data_us(32)
    assert sent_us < 256 / 49.152
    assert plain(cycle.boards_us) == pytest.approx((150 + 7 * 256) / 49.152 + sent_us, rel=1e-12)


def test_the_hub_is_read_no_earlier_than_the_software_does() -> None:
    # Four bytes of data: 3.052 + 8 (1.323 + 1.63 + 1.323 + 0.651) = 42.5 us, and the host waits 10 + 5 * 8 = 50 us.
    small: dict[str, object] = {"cycle.broadcast_request": "isochronous"}
    small |= {f"group.{name}.read_bytes": 4 for name in ("full", "partial")}
    profile = busplan.load_profile(DVRK, changes=small)
    boards_us = 150 / 49.152 + 8 * (WAY_US + 1.63 + data_us(32))
    cycle = cycle_of(profile)
    assert plain(cycle.late_us) == pytest.approx(50 - boards_us)
    assert plain(cycle.late_us) > RESET_US
    hub_us = ARBITRATION_US + data_us(20) + ACKNOWLEDGE_US + data_us(24 + 8 * 8 + 4) + ACKNOWLEDGE_US
    by_hand_us = QUERY_US + 50 + hub_us + RESET_US + WRITE_US + RESET_US
    assert cycle.required_us == pytest.approx(by_hand_us, rel=1e-12)
    assert {one.key: one.us for one in cycle.terms}["cycle_host_us"] == pytest.approx(50 - boards_us - RESET_US)


def test_the_hosts_own_time_overlaps_the_gaps_three_times() -> None:
    assert required_us(DVRK, host__transaction_us=7.0) == required_us(DVRK)
    assert required_us(DVRK, host__transaction_us=30.0) == pytest.approx(required_us(DVRK) + 3 * (30 - RESET_US))


def test_latency_of_the_data_and_of_a_command() -> None:
    read, write, *_ = busplan.latency(DVRK).transactions
    assert (read.transaction, read.payload_bytes, write.payload_bytes) == ("read", 128, 20)
    boards_us = 8 * (SUB_US + ARBITRATION_US + data_us(28 + 128))
    assert read.phases["latency_us"] == pytest.approx(QUERY_US + boards_us + RESET_US + HUB_US)
    assert (read.phases["query_us"], read.phases["boards_us"], read.phases["hub_wait_us"]) == pytest.approx(
        (QUERY_US, boards_us, RESET_US)
    )
    assert write.phases["latency_us"] == pytest.approx(WRITE_US)
    assert (read.phases["response_bytes"], write.phases["request_bytes"]) == (24 + 8 * 132 + 4, 24 + 8 * 24)
    one = standard(DVRK)
    transactions_us = [one.own[f"{kind}_transaction_us"] for kind in ("read", "write")]
    assert sum(us for us in transactions_us if isinstance(us, float)) == pytest.approx(one.required_us)


def test_bias_and_doubt_count_each_packet_as_half_a_transaction() -> None:
    by_request = {
        request: standard(busplan.load_profile(DVRK, changes={"cycle.broadcast_request": request}))
        for request in ("priority", "isochronous")
    }
    mean_us, gap_term_us = 0.827025, 2 * (63 - 21) / 98.304
    # The query, eight broadcasts, two packets of the hub, and the write; isochronous requests have no gap term.
    assert by_request["priority"].bias_us == pytest.approx(12 * (mean_us + gap_term_us), abs=1e-3)
    assert by_request["isochronous"].bias_us == pytest.approx(12 * mean_us + 4 * gap_term_us, abs=1e-3)


# --- against the simulated bus ----------------------------------------------------------------------------


@st.composite
def buses(draw: st.DrawFn) -> tuple[busplan.Profile, dict[str, Any]]:
    nodes = draw(st.integers(1, 16))
    sizes = {f"{kind}_bytes": draw(st.integers(1, 120)) for kind in ("read", "write")}
    request = draw(st.sampled_from(["isochronous", "priority", "timed"]))
    gap_count = draw(st.integers(5, 63))
    host_us = draw(st.sampled_from([0.0, 3.0, 25.0]))
    first_start_us = draw(st.none() | st.floats(0.0, 125.0))
    profile = Ieee1394Profile.model_validate(
        {
            "schema_version": 1,
            "name": "broadcast",
            "bus": {
                "kind": "ieee1394",
                "speed": "S400",
                "gap_count": gap_count,
                "nodes": nodes,
                "cycle_master": first_start_us is not None,
            },
            "cycle": {
                "period_us": 10_000.0,
                "schedule": "broadcast",
                "broadcast_request": request,
            },
            "payload": sizes,
            "host": {"transaction_us": host_us},
            "node": {"axes": 1, "execution": {"kind": "linear", "base_us": 40.0, "per_byte_us": 0.0}},
        }
    )
    hub = draw(st.sampled_from([1, nodes]))
    scene = {
        "nodes": tuple(SIMULATED.Node(hub, sizes["read_bytes"], sizes["write_bytes"]) for _ in range(nodes)),
        "hops": nodes,
        "gap_count": gap_count,
        "host_us": host_us,
        "first_start_us": first_start_us,
    }
    slot_us = 256 / 49.152 if request == "timed" else 0.0
    return profile, {"scene": SIMULATED.Scene(**scene), "isochronous": request != "priority", "slot_us": slot_us}


@given(drawn=buses())
def test_no_simulated_cycle_takes_longer_than_the_closed_form(drawn: tuple[busplan.Profile, dict[str, Any]]) -> None:
    profile, bus = drawn
    run = SIMULATED.simulate_broadcasts(**bus, cycles=CYCLES)
    longest_us = max(after - before for before, after in pairwise(run.starts_us))
    closed_us = standard(profile).required_us
    assert longest_us <= closed_us + ROUNDING_US
    scene = bus["scene"]
    # Below gap count 8 the first node's 150 clocks end the fairness interval, and the host has its turn earlier.
    if scene.first_start_us is None and scene.nodes[0].hops == scene.hops and scene.reset_gap_us > 150 / 49.152:
        assert longest_us == pytest.approx(closed_us, abs=ROUNDING_US)  # nothing is charged that the bus does not take


# --- limits and the other questions -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "limits"),
    [
        ({}, ()),
        ({"group.full.nodes": 12}, ("hub block",)),  # 16 (128 + 4) + 4 = 2116 bytes
        ({"group.full.nodes": 11}, ()),  # 15 (128 + 4) + 4 = 1984 bytes
        ({"group.full.nodes": 13, "bus.max_hops": 5}, ("broadcasting nodes", "hub block")),
        ({"group.full.write_bytes": 500}, ("write block",)),  # 4 * 504 + 4 * 24 = 2112 bytes
        ({"bus.speed": "S200"}, ("hub block",)),  # 8 * 132 + 4 = 1060 bytes
        ({"bus.speed": "S200", "cycle.schedule": "individual"}, ()),
    ],
)
def test_its_limits_are_its_own(changes: dict[str, object], limits: tuple[str, ...]) -> None:
    changed = busplan.load_profile(DVRK, changes=changes)
    assert tuple(one.key for one in BUS.broken(network_of(changed))) == limits


def test_a_broken_limit_is_said_by_verdict_and_gate(tmp_path: Path, run: Callable[..., Any]) -> None:
    arguments = ("dvrk", "--set", "group.full.nodes=12")
    said = "the hub's block of 2116 bytes is over the 2048 bytes of S400"
    assert said in run("capacity", *arguments, cwd=tmp_path).stdout
    checked = run("check", *arguments, "--no-circle", cwd=tmp_path)
    assert checked.returncode == 1
    assert (
        f"BP101 error: cycle.period_us: {said} (with --set group.full.nodes=12); less read from each node, or"
        in checked.stdout
    )


def test_no_execution_time_and_no_answer_of_a_node_plays_a_part() -> None:
    slow: dict[str, object] = {f"group.{name}.execution.base_us": 500.0 for name in ("full", "partial")}
    assert required_us(busplan.load_profile(DVRK, changes=slow)) == required_us(DVRK)
    assert not BUS.has_execution(network_of(DVRK))
    with pytest.raises(BusplanError, match="so none can be found"):
        packets_of(network_of(DVRK), "full", "standard", "read", 4)


def test_the_paper_cannot_express_it() -> None:
    plainest = busplan.load_profile(
        "paper-4ms",
        changes={"cycle.schedule": "broadcast", "cycle.broadcast_request": "isochronous"},
    )
    assert BUS.cannot_express(network_of(plainest), model="paper") == ("cycle.schedule",)
    assert [one.timing_model for one in busplan.capacity(plainest).results] == ["standard"]


def test_own_hops_are_not_charged_for_what_goes_to_all() -> None:
    assert required_us(DVRK, bus__charge_hops="own") == required_us(DVRK)
    assert BUS.path_words(network_of(DVRK)) == "every packet at the hops of the farthest"


def test_a_command_arrives_at_all_nodes_at_once() -> None:
    host = busplan.load_profile(DVRK, changes={"servo.loop": "host", "servo.update": "on_arrival"})
    x_us, y_us = loop_delays_us(network_of(host))
    boards_us = 8 * (SUB_US + ARBITRATION_US + data_us(28 + 128))
    before_us = QUERY_US + boards_us + RESET_US + HUB_US + RESET_US
    assert x_us == y_us == pytest.approx(before_us + WRITE_US - ACKNOWLEDGE_US)


def test_the_kit_is_that_of_its_sources() -> None:
    assert (network_of(DVRK).nodes, network_of(DVRK).axes) == (8, 28)  # TePRA 2014, abstract
    # mechatronics-software, BasePort.cpp, Rev 8 with QLA: 33 quadlets a board, and one of timing behind all.
    assert busplan.latency(DVRK).transactions[0].phases["response_bytes"] == 24 + 4 * (8 * 33 + 1)
    assert {group.write_bytes for group in network_of(DVRK).groups} == {4 * 5}


def test_the_bus_alone_gains_about_two() -> None:
    # models.md, section 6: the published factor of 4 holds host time in each call.
    one_by_one_us = required_us(DVRK, cycle__schedule="individual")
    assert 1.5 < one_by_one_us / required_us(DVRK) < 2.5
    called_us = [
        required_us(DVRK, cycle__schedule=word, host__transaction_us=40.0) for word in ("individual", "broadcast")
    ]
    assert called_us[0] / called_us[1] > 3


@pytest.mark.parametrize("schedule", ["individual", "broadcast"])
@pytest.mark.parametrize("retries", [0, 1, 4])
@pytest.mark.parametrize("cycle_master", [False, True])
def test_the_doubt_of_a_phy_is_as_large_as_the_time_that_it_moves(
    schedule: str, retries: int, cycle_master: bool
) -> None:
    """A PHY that is 1 ns slower makes the cycle slower once for each time that its delay stands in it."""
    changes = {"cycle.schedule": schedule, "cycle.retries": retries, "bus.cycle_master": cycle_master}

    def required_us(phy_us: float) -> float:
        profile = busplan.load_profile("dvrk", changes={**changes, "bus.gap_count": 21, "bus.phy_delay_us": phy_us})
        return busplan.capacity(profile, timing_model="standard").results[0].required_us

    own_us, step_us = 14 / 98.304, 0.001
    counted = (required_us(own_us + step_us) - required_us(own_us)) / step_us
    profile = busplan.load_profile("dvrk", changes={**changes, "bus.gap_count": 21})
    (doubt_us,) = (one.us for one in busplan.capacity(profile).verdicts[0].deciding.doubts if "phy" in one.key)
    # 20 ns either way, none likelier than another.
    assert doubt_us == pytest.approx(counted * 0.02 / sqrt(3), rel=1e-6)
