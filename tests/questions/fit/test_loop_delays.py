"""A loop on the host takes as long in `latency` as in the circle test."""

from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
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
