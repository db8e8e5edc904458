"""A loop on the host takes as long in `latency` as in the circle test."""

from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.questions.fit.circle_setup import loop_delays_us
from busplan.questions.fit.network import network_of
from tests.oracles.random_plans import fitting


def loop_us(profile: busplan.Profile) -> float:
    """The longest loop in `latency` [us]; of EtherCAT's groups those in every cycle."""
    slower = {group.name for group in profile.node_groups if getattr(group.payload, "every", 1) > 1}
    return max(
        row.phases.get("worst_response_us") or row.phases["end_to_end_us"] or 0.0
        for row in busplan.latency(profile).transactions
        if row.transaction == "loop" and row.timing_model in ("worst-stuffing", "last-byte") and row.group not in slower
    )


@pytest.mark.slow
@given(seed=st.integers(0, 2**32), kind=st.sampled_from(["can", "ethercat"]))
def test_the_circle_has_the_delay_of_the_loop(seed: int, kind: str, tmp_path: Path) -> None:
    plan, path = fitting(kind, seed, tmp_path)
    groups = plan.get("group", [{"axes": 1, **plan.get("payload", {})}])
    rates = {group.get("every", 1) for group in groups}
    # The circle is that of the groups in every cycle; CAN's loop is that of the slowest.
    is_refused = not any(group["axes"] and group.get("every", 1) == 1 for group in groups)
    if "cycle" not in plan or is_refused or (kind == "can" and len(rates) > 1):
        return
    random = Random(seed)
    at_sync, pipeline = random.random() < 0.5, random.randint(0, 3)
    changes: dict[str, object] = {"servo.loop": "host", "bus.pipeline_cycles": pipeline}
    changes["servo.update"] = "next_sync" if at_sync else "on_arrival"
    if kind == "ethercat":
        changes["bus.sync_shift"] = random.choice((0.0, 0.3, 0.9))
        at_sync = at_sync and plan["bus"]["distributed_clocks"]
    profile = busplan.load_profile(path, changes=changes)
    delay_us, longest_us = max(loop_delays_us(network_of(profile))), loop_us(profile)
    if at_sync or not ("group" in plan or "data_bit_rate_kbit_s" in plan["bus"]):
        assert delay_us == pytest.approx(longest_us)
    else:
        # The loop also has groups that are not the last, and the late bits of CAN FD.
        assert delay_us <= longest_us + 1e-9


@pytest.mark.parametrize(
    ("name", "more", "apart_us"),
    [
        # Seven frames of 135 us. The adapter's time is in the loop, and in no cycle.
        ("can-servo-8", {"bus.host_write_us": 100.0, "bus.host_read_us": 150.0}, 7 * 135),
        ("ethercat-servo-8", {"bus.sync_shift": 0.3}, 4.957),
    ],
)
@pytest.mark.parametrize("update", ["next_sync", "on_arrival"])
def test_the_last_axis_has_the_delay_of_the_loop_and_the_first_a_shorter_one(
    name: str, more: dict[str, object], apart_us: float, update: str
) -> None:
    profile = busplan.load_profile(name, changes={"servo.loop": "host", "servo.update": update, **more})
    first_us, last_us = loop_delays_us(network_of(profile))
    assert last_us == pytest.approx(loop_us(profile))
    assert last_us - first_us == pytest.approx(apart_us if update == "on_arrival" else 0)


def test_the_axes_of_a_loop_on_the_host_are_on_nodes_with_feedback_and_commands() -> None:
    """Of three groups of two, the first has no commands and the last no axes: x and y are next to each other."""
    data = busplan.load_profile("ethercat-servo-8", changes={"servo.loop": "host"}).model_dump(exclude_unset=True)
    node, payload, _ = data.pop("node"), data.pop("payload"), data["bus"].pop("nodes")
    own: tuple[dict[str, object], ...] = ({"write_bytes": 0}, {}, {"axes": 0})
    data["group"] = [{**node, **payload, "nodes": 2, "name": name, **one} for name, one in zip("abc", own, strict=True)]
    data["servo"]["update"] = "on_arrival"
    network = network_of(kind_named("ethercat").profile_model().model_validate(data))
    first_us, last_us = loop_delays_us(network)
    # 4.957 us from the first to the last of eight.
    assert last_us - first_us == pytest.approx(4.957 / 7, abs=1e-3)
    # The drives of a, with axes and without commands, and those of c have their frame earlier and later.
    cycle = network.bus.cycle(network, model="last-byte")
    assert last_us - cycle.arrival_us(4) == pytest.approx(first_us - cycle.arrival_us(3))
    assert cycle.arrival_us(1) < cycle.arrival_us(3) < cycle.arrival_us(6)
