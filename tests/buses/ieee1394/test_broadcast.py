"""The broadcast schedule: by hand, against a simulated bus, and what every question makes of it."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import sqrt
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan

DVRK = busplan.load_profile("dvrk")
ROUNDING_US = 1e-6
CYCLES = 3


def kit(changes: dict[str, Any] | None = None, **more: object) -> busplan.Profile:
    """The da Vinci Research Kit with other values."""
    return busplan.load_profile(
        DVRK, changes={**(changes or {}), **{key.replace("__", "."): us for key, us in more.items()}}
    )


def standard(profile: busplan.Profile) -> Any:
    """Figures by the standard's timing model."""
    (figures,) = busplan.capacity(profile, timing_model="standard").results
    return figures


def required_us(changes: dict[str, Any] | None = None, **more: object) -> float:
    """Time that the cycle of the kit needs, with other values."""
    us: float = standard(kit(changes, **more)).required_us
    return us


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
    assert required_us() == pytest.approx(by_hand_us, rel=1e-12)
    assert by_hand_us == pytest.approx(168.541, abs=5e-4)
    fast_us = 150 / 49.152 + 8 * (WAY_US + 1.63 + data_us(28 + 128))
    assert fast_us == pytest.approx(62.656, abs=5e-4)  # longer than the host's wait of 50 us
    by_hand_us += fast_us - boards_us
    assert required_us(cycle__broadcast_request="isochronous") == pytest.approx(by_hand_us, rel=1e-12)


def test_boards_that_are_only_read_or_only_written_by_hand() -> None:
    none, both = ({f"group.{name}.{way}_bytes": 0 for name in ("full", "partial")} for way in ("read", "write"))
    assert required_us(none) == pytest.approx(QUERY_US + WRITE_US + RESET_US, rel=1e-12)
    boards_us = 8 * (SUB_US + ARBITRATION_US + data_us(28 + 128))
    assert required_us(both) == pytest.approx(QUERY_US + boards_us + RESET_US + HUB_US + RESET_US, rel=1e-12)
    events = busplan.timeline(kit(none)).events
    assert [event.label for event in events if event.transaction] == [
        "host arbitration",
        "commands to all nodes",
        "hub acknowledge",
    ]
    mean_us, gap_term_us = 0.827025, 2 * (63 - 21) / 98.304
    # The query, and the write; or the query, eight broadcasts and two packets of the hub.
    for changes, packets in ((none, 2), (both, 11)):
        figures = standard(kit(changes))
        assert figures.bias_us == pytest.approx(packets * (mean_us + gap_term_us), abs=1e-3)
    host = {"host.transaction_us": 30.0, "host.uncertainty_us": 1.0}
    doubts = [
        {doubt.key: doubt.us for doubt in standard(kit({**changes, **host})).doubts}["host.transaction_us"]
        for changes in (none, both)
    ]
    assert doubts == pytest.approx([1, 2])
    assert [row.transaction for row in busplan.latency(kit(none)).transactions] == ["write", "write"]


SMALL = {f"group.{name}.read_bytes": 4 for name in ("full", "partial")}


def test_with_firmware_up_to_rev_7_each_board_has_a_time_of_its_own() -> None:
    # JHU FireWire.v: 256 N + 150 clocks of 49.152 MHz behind N others; the kit's 128 bytes take longer than 256.
    timed, isochronous = ({"cycle.broadcast_request": request} for request in ("timed", "isochronous"))
    assert required_us(timed) == required_us(isochronous)
    sent_us = WAY_US + 1.63 + data_us(32)
    assert sent_us < 256 / 49.152
    read, *_ = busplan.latency(kit({**timed, **SMALL})).transactions
    assert read.phases["boards_us"] == pytest.approx((150 + 7 * 256) / 49.152 + sent_us, rel=1e-12)


def test_the_hub_is_read_no_earlier_than_the_software_does() -> None:
    # Four bytes of data: 3.052 + 8 (1.323 + 1.63 + 1.323 + 0.651) = 42.5 us, and the host waits 10 + 5 * 8 = 50 us.
    small = kit({"cycle.broadcast_request": "isochronous", **SMALL})
    boards_us = 150 / 49.152 + 8 * (WAY_US + 1.63 + data_us(32))
    wait_us = 50 - boards_us
    assert wait_us > RESET_US
    assert busplan.latency(small).transactions[0].phases["hub_wait_us"] == pytest.approx(wait_us)
    hub_us = ARBITRATION_US + data_us(20) + ACKNOWLEDGE_US + data_us(24 + 8 * 8 + 4) + ACKNOWLEDGE_US
    by_hand_us = QUERY_US + 50 + hub_us + RESET_US + WRITE_US + RESET_US
    assert standard(small).required_us == pytest.approx(by_hand_us, rel=1e-12)
    host_us = {term.key: term.us for term in standard(small).terms}["cycle_host_us"]
    assert host_us == pytest.approx(wait_us - RESET_US)


def test_the_hosts_own_time_overlaps_the_gaps_three_times() -> None:
    assert required_us(host__transaction_us=7.0) == required_us()
    assert required_us(host__transaction_us=30.0) == pytest.approx(required_us() + 3 * (30 - RESET_US))


def test_latency_of_the_data_and_of_a_command() -> None:
    read, write, *_ = busplan.latency(DVRK).transactions
    assert (read.transaction, read.payload_bytes, write.payload_bytes) == ("read", 128, 20)
    boards_us = 8 * (SUB_US + ARBITRATION_US + data_us(28 + 128))
    assert read.phases["latency_us"] == pytest.approx(QUERY_US + boards_us + RESET_US + HUB_US)
    assert (read.phases["query_us"], read.phases["boards_us"], read.phases["hub_wait_us"]) == pytest.approx(
        (QUERY_US, boards_us, RESET_US)
    )
    assert write.phases["latency_us"] == pytest.approx(WRITE_US)
    assert (read.phases["idle_us"], write.phases["idle_us"]) == pytest.approx((8 * SUB_US + 2 * RESET_US, RESET_US))
    assert (read.phases["response_bytes"], write.phases["request_bytes"]) == (24 + 8 * 132 + 4, 24 + 8 * 24)
    transactions_us = [row.phases["transaction_us"] or 0.0 for row in (read, write)]
    assert sum(transactions_us) == pytest.approx(required_us())


def test_bias_and_doubt_count_each_packet_as_half_a_transaction() -> None:
    priority, isochronous = (
        standard(kit(cycle__broadcast_request=request)).bias_us for request in ("priority", "isochronous")
    )
    mean_us, gap_term_us = 0.827025, 2 * (63 - 21) / 98.304
    # The query, eight broadcasts, two packets of the hub, and the write; isochronous requests have no gap term.
    assert priority == pytest.approx(12 * (mean_us + gap_term_us), abs=1e-3)
    assert isochronous == pytest.approx(12 * mean_us + 4 * gap_term_us, abs=1e-3)


def test_the_doubt_of_the_host_counts_where_its_time_is_not_hidden() -> None:
    def doubt_us(changes: dict[str, Any], **host: float) -> float:
        changes = {**changes, **{f"host.{key}": us for key, us in host.items()}}
        (us,) = (doubt.us for doubt in standard(kit(changes)).doubts if doubt.key == "host.transaction_us")
        return float(us)

    # Longer than the gap of 7.375 us before the hub, before the write and before the next cycle.
    assert doubt_us({}, transaction_us=30.0, uncertainty_us=1.0) == pytest.approx(3)
    assert doubt_us({}, transaction_us=1.0, uncertainty_us=0.2) == 0
    # The wait of 10 + 5 N us ends later than the gap before the hub does.
    early = {"cycle.broadcast_request": "isochronous", **SMALL}
    assert doubt_us(early, transaction_us=1.0, uncertainty_us=0.2) == pytest.approx(0.2)


def test_the_timeline_names_what_goes_on_the_bus_and_who_waits_for_what() -> None:
    changes = {**SMALL, "cycle.broadcast_request": "timed", "host.transaction_us": 30.0, "cycle.period_us": 2000.0}
    events = busplan.timeline(kit(changes)).events
    assert [(event.label, event.node, event.transaction, event.packet) for event in events[:8]] == [
        ("query to all nodes", None, None, None),
        ("wait of the node", 1, "read", "response"),
        ("node arbitration", 1, "read", "response"),
        ("node broadcast", 1, "read", "response"),
        ("wait of the node", 2, "read", "response"),
        ("node arbitration", 2, "read", "response"),
        ("node broadcast", 2, "read", "response"),
        ("wait of the node", 3, "read", "response"),
    ]
    assert [(event.label, event.transaction, event.packet) for event in events if event.node is None] == [
        ("query to all nodes", None, None),
        ("arbitration reset gap before the hub is read", None, None),
        ("host's own time before the hub is read", None, None),
        ("host arbitration", "read", "request"),
        ("host request to the hub", "read", "request"),
        ("hub acknowledge", "read", "request"),
        ("hub's block of all data", "read", "response"),
        ("host acknowledge", "read", "response"),
        ("arbitration reset gap after the hub's block", None, None),
        ("host's own time after the hub's block", None, None),
        ("host arbitration", "write", "request"),
        ("commands to all nodes", "write", "request"),
        ("hub acknowledge", "write", "request"),
        ("arbitration reset gap after the write", None, None),
        ("host's own time after the write", None, None),
        ("idle", None, None),
    ]
    by_priority = busplan.timeline(DVRK).events[1]
    assert (by_priority.label, by_priority.node) == ("subaction gap before the broadcast", 1)


# --- against the simulated bus ----------------------------------------------------------------------------


class Drawn(NamedTuple):
    """A bus to simulate."""

    changes: dict[str, Any]
    """What the kit has otherwise."""
    request: str
    hub_hops: int
    first_start_us: float | None

    def starts_us(self, simulated: ModuleType) -> Sequence[float]:
        """When each of some cycles starts."""
        group, gap_count = self.changes["group"][0], self.changes["bus.gap_count"]
        node = simulated.Node(self.hub_hops, group["read_bytes"], group["write_bytes"])
        scene = simulated.Scene(
            nodes=(node,) * group["nodes"],
            hops=group["nodes"],
            gap_count=gap_count,
            host_us=self.changes["host.transaction_us"],
            first_start_us=self.first_start_us,
        )
        slot_us = 256 / 49.152 if self.request == "timed" else 0.0
        run = simulated.simulate_broadcasts(
            scene, isochronous=self.request != "priority", slot_us=slot_us, cycles=CYCLES
        )
        starts_us: Sequence[float] = run.starts_us
        return starts_us


@st.composite
def buses(draw: st.DrawFn) -> Drawn:
    nodes, request = draw(st.integers(1, 16)), draw(st.sampled_from(["isochronous", "priority", "timed"]))
    first_start_us = draw(st.none() | st.floats(0.0, 125.0))
    group = {
        "name": "boards",
        "nodes": nodes,
        "axes": 1,
        **{f"{kind}_bytes": draw(st.integers(1, 120)) for kind in ("read", "write")},
        "execution": {"kind": "linear", "base_us": 40.0, "per_byte_us": 0.0},
    }
    changes = {
        "bus.gap_count": draw(st.integers(5, 63)),
        "bus.cycle_master": first_start_us is not None,
        "cycle.period_us": 10_000.0,
        "cycle.broadcast_request": request,
        "host.transaction_us": draw(st.sampled_from([0.0, 3.0, 25.0])),
        "group": [group],
    }
    return Drawn(changes, request, draw(st.sampled_from([1, nodes])), first_start_us)


@given(drawn=buses())
def test_no_simulated_cycle_takes_longer_than_the_closed_form(drawn: Drawn, simulated: ModuleType) -> None:
    longest_us = max(after - before for before, after in pairwise(drawn.starts_us(simulated)))
    closed_us = required_us(drawn.changes)
    assert longest_us <= closed_us + ROUNDING_US
    is_hub_farthest = drawn.hub_hops == drawn.changes["group"][0]["nodes"]
    # Below gap count 8 the first node's 150 clocks end the fairness interval, and the host has its turn earlier.
    reset_gap_us = (53 + 32 * drawn.changes["bus.gap_count"]) / 98.304
    if drawn.first_start_us is None and is_hub_farthest and reset_gap_us > 150 / 49.152:
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
    assert standard(kit({**changes, "cycle.period_us": 100_000.0})).exceeded == limits


def test_a_broken_limit_is_said_by_verdict_and_gate(tmp_path: Path, run: Callable[..., Any]) -> None:
    arguments = ("dvrk", "--set", "group.full.nodes=12")
    words = "the hub's block of 2116 bytes is over the 2048 bytes of S400"
    assert words in run("capacity", *arguments, cwd=tmp_path).stdout
    checked = run("check", *arguments, "--no-circle", cwd=tmp_path)
    assert checked.returncode == 1
    assert (
        f"BP101 error: cycle.period_us: {words} (with --set group.full.nodes=12); read less from each node, or"
        in checked.stdout
    )


def test_no_execution_time_of_a_node_plays_a_part_and_none_can_be_calibrated() -> None:
    slow = {f"group.{name}.execution.base_us": 500.0 for name in ("full", "partial")}
    assert required_us(slow) == required_us()
    with pytest.raises(busplan.BusplanError, match="so none can be found from a latency"):
        busplan.calibrate(DVRK, [(4, 50.0), (8, 51.0)], group="full", source="m.csv")


def test_the_paper_cannot_express_it() -> None:
    changes = {"cycle.schedule": "broadcast", "cycle.broadcast_request": "isochronous"}
    paper = busplan.capacity(busplan.load_profile("paper-4ms", changes=changes))
    assert [figures.timing_model for figures in paper.results] == ["standard"]
    (line,) = (one["text"] for one in paper.to_dict()["verdicts"][0]["lines"] if one["label"] == "paper model")
    assert "cycle.schedule" in line


def test_own_hops_are_not_charged_for_what_goes_to_all() -> None:
    assert required_us(bus__charge_hops="own") == required_us()
    assert "every packet at the hops of the farthest" in str(busplan.timeline(DVRK))


def test_a_command_arrives_at_all_nodes_at_once() -> None:
    (circle,) = busplan.circle_test(kit(servo__loop="host", servo__update="on_arrival")).results
    boards_us = 8 * (SUB_US + ARBITRATION_US + data_us(28 + 128))
    before_us = QUERY_US + boards_us + RESET_US + HUB_US + RESET_US
    assert (circle.delay_x_us, circle.delay_y_us) == pytest.approx((before_us + WRITE_US - ACKNOWLEDGE_US,) * 2)


def test_the_kit_is_that_of_its_sources() -> None:
    figures = standard(DVRK)
    assert (figures.nodes, figures.axes) == (8, 28)  # TePRA 2014, abstract
    # mechatronics-software, BasePort.cpp, Rev 8 with QLA: 33 quadlets a board, and one of timing behind all.
    read, write, *_ = busplan.latency(DVRK).transactions
    assert read.phases["response_bytes"] == 24 + 4 * (8 * 33 + 1)
    assert write.payload_bytes == 4 * 5


def test_the_bus_alone_gains_about_two() -> None:
    # models.md, section 6: the published factor of 4 holds host time in each call.
    assert 1.5 < required_us(cycle__schedule="individual") / required_us() < 2.5
    one_by_one_us, broadcasts_us = (
        required_us(cycle__schedule=schedule, host__transaction_us=40.0) for schedule in ("individual", "broadcast")
    )
    assert one_by_one_us / broadcasts_us > 3


@pytest.mark.parametrize("schedule", ["individual", "broadcast"])
@pytest.mark.parametrize("retries", [0, 4])
@pytest.mark.parametrize("cycle_master", [False, True])
def test_the_doubt_of_a_phy_is_as_large_as_the_time_that_it_moves(
    schedule: str, retries: int, cycle_master: bool
) -> None:
    """A PHY that is 1 ns slower makes the cycle slower once for each time that its delay stands in it."""
    changes = {
        "cycle.schedule": schedule,
        "cycle.retries": retries,
        "bus.cycle_master": cycle_master,
        "bus.gap_count": 21,
    }
    phy_us, step_us = 14 / 98.304, 0.001
    before_us, after_us = (required_us(changes, bus__phy_delay_us=us) for us in (phy_us, phy_us + step_us))
    (doubt_us,) = (doubt.us for doubt in standard(kit(changes)).doubts if doubt.key == "bus.phy_delay_us")
    # 20 ns either way, none likelier than another.
    assert doubt_us == pytest.approx((after_us - before_us) / step_us * 0.02 / sqrt(3), rel=1e-6)


@pytest.mark.parametrize("schedule", ["individual", "broadcast"])
@pytest.mark.parametrize("gap_count", [21, 63])
def test_both_gaps_follow_a_transaction(schedule: str, gap_count: int) -> None:
    own = standard(kit(cycle__schedule=schedule, bus__gap_count=gap_count)).own
    gaps_us = (82 + 48 * gap_count) / 98.304  # the paper's equation (10), by the standard's clock
    assert own.read_latency_with_gaps_us - own.read_latency_us == pytest.approx(gaps_us)
    assert own.write_latency_with_gaps_us - own.write_latency_us == pytest.approx(gaps_us)


@pytest.mark.parametrize("request_", ["timed", "isochronous", "priority"])
def test_a_latency_names_the_schedule_of_broadcasts(request_: str) -> None:
    words = f"broadcast schedule by {request_} requests"
    assert words in busplan.latency(kit(cycle__broadcast_request=request_)).subject
    assert words not in busplan.latency(kit(cycle__schedule="individual")).subject
