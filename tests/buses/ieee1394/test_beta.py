"""IEEE 1394b, S800 to S3200: no time of its arbitration is published, so the cycle is a lower bound."""

from math import ceil
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.forms import render

RATES_MBIT_S = {"S800": 786.432, "S1600": 1572.864, "S3200": 3145.728}
LINEAR = {"kind": "linear", "base_us": 5.0, "per_byte_us": 0.01, "grade": "measured", "uncertainty_us": 0.0}


def network(speed: str, **changes: Any) -> busplan.Profile:
    """The paper's machine with a linear execution time, at a speed."""
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    return busplan.load_profile("paper-4ms", changes={"node.execution": LINEAR, "bus.speed": speed, **keys})


def result(profile: busplan.Profile) -> Any:
    (found,) = busplan.capacity(profile, timing_model="standard").results
    return found


def quadlets(payload_bytes: int) -> int:
    return 4 * ceil(payload_bytes / 4)


@given(
    speed=st.sampled_from(sorted(RATES_MBIT_S)),
    nodes=st.integers(1, 16),
    read=st.integers(5, 1000),
    write=st.integers(5, 1000),
    cable_m=st.floats(0.1, 20),
    phy_us=st.sampled_from([None, 0.1]),
    has_tree=st.booleans(),
)
def test_the_bound_is_the_packets_the_executions_and_the_ways_there_and_back(
    *, speed: str, nodes: int, read: int, write: int, cable_m: float, phy_us: float | None, has_tree: bool
) -> None:
    sizes = {"bus__nodes": nodes, "payload__read_bytes": read, "payload__write_bytes": write}
    tree: dict[str, Any] = {"bus__max_hops": 3} if has_tree else {}
    tree |= {"bus__phy_delay_us": phy_us} if phy_us else {}
    found = result(network(speed, bus__cable_length_m=cable_m, **sizes, **tree))
    packet_bytes = 20 + nodes * (20 + 24 + quadlets(read) + 24 + quadlets(write) + 16)
    # In a tree no node is nearer than one hop; in a chain the node's place says it.
    hops = sum(1 if has_tree else node for node in range(1, nodes + 1))
    way_us = 4 * hops * (0.023 * cable_m / 4.5 + (phy_us or 0.0))
    execution_us = nodes * (2 * 5.0 + 0.01 * (read + write))
    assert found.required_us == pytest.approx(8 * packet_bytes / RATES_MBIT_S[speed] + way_us + execution_us, rel=1e-12)
    assert (found.bias_us, found.uncertainty_us) == (0, 0)
    # The bound is below the whole cycle of the fastest speed that is known.
    assert found.required_us < result(network("S400", **sizes, **tree)).required_us


@pytest.mark.slow
@pytest.mark.parametrize("speed", sorted(RATES_MBIT_S))
@pytest.mark.parametrize("schedule", ["individual", "broadcast"])
def test_a_plan_over_the_bound_does_not_fit_and_any_other_is_not_shown_to(speed: str, schedule: str) -> None:
    required_us = result(network(speed, cycle__schedule=schedule)).required_us
    for share, verdict in ((1.01, "not shown to fit"), (0.99, "does not fit"), (1000, "not shown to fit")):
        changed = network(speed, cycle__schedule=schedule, cycle__period_us=2 * share * required_us)
        found = result(changed)
        assert (found.verdict, found.safe_nodes) == (verdict, 0)
        assert found.own.gap_count_safe
        assert not busplan.check(changed).passed


def test_cycle_starts_and_requests_to_broadcast_cost_their_packets_alone() -> None:
    quiet, started = network("S800"), network("S800", bus__cycle_master=True, bus__isochronous_us=10)
    start_us = 10 + 8 * 20 / RATES_MBIT_S["S800"]
    quiet_us, started_us = result(quiet).required_us, result(started).required_us
    starts = round((started_us - quiet_us) / start_us)
    assert started_us - quiet_us == pytest.approx(starts * start_us)
    assert starts == int(started_us / 125) + 1
    # Broadcasts so long that the host's wait for them does not hide how they are asked for.
    broadcast = {"cycle__schedule": "broadcast", "bus__nodes": 16, "payload__read_bytes": 1000}
    by_request = {
        result(network("S800", **broadcast, cycle__broadcast_request=request)).required_us
        for request in ("priority", "isochronous")
    }
    assert len(by_request) == 1


def test_the_answer_says_why_and_no_paper_model_goes_beside_it() -> None:
    answer = busplan.capacity(network("S800"))
    assert [found.timing_model for found in answer.results] == ["standard"]
    said = {line["label"]: line["text"] for line in answer.to_dict()["verdicts"][0]["lines"]}
    assert said["limit"] == "the arbitration of S800 has no published time, so the cycle is a lower bound"
    assert said["rests on"].startswith("packets and cables alone, never measured and ")
    assert said["checked against"] == "no published figures"
    assert said["paper model"] == "not applicable: it has no bus.speed"
    assert "gap count" not in render(answer.report(), "table")


def test_no_execution_time_comes_of_a_bound() -> None:
    with pytest.raises(busplan.BusplanError, match="packets at S800 is known as a lower bound only"):
        busplan.calibrate(network("S800"), [(4, 48.7), (16, 48.9), (32, 57.9)], source="m.csv")
