"""The limit that a node is done once a cycle: by hand, in three verdicts, and what plan and compare make of it."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.limits import NODE_LIMIT
from busplan.questions.fit.network import network_of

KINDS = ("ethercat", "sercos3", "sercos2")


def network(kind: str, **changes: Any) -> busplan.Profile:
    """The shipped servo network of a kind at 1 ms, whose drives take 100 us and are measured."""
    own = {"cycle.period_us": 1000.0, "node.execution.base_us": 100.0, "node.execution.uncertainty_us": 5.0}
    if kind == "ethercat":
        own["bus.sync_shift"] = 0.0  # a command waits for the next SYNC0, which asks nothing of the node
    return busplan.load_profile(
        f"{kind}-servo-8",
        changes=own | {key.replace("__", "."): to for key, to in changes.items()},
    )


def test_a_node_is_done_once_a_cycle() -> None:
    for kind in KINDS:
        for base_us, extra_us, verdict in [
            (490, 0, "fits"),
            (400, 90, "fits"),
            (491, 0, "not shown to fit"),
            (500, 10, "not shown to fit"),
            (511, 0, "does not fit"),
        ]:
            one = network(kind, node__execution__base_us=base_us, node__execution__worst_extra_us=extra_us)
            found = busplan.capacity(one).verdicts[0].deciding
            assert found.verdict == verdict
            assert ("node" in found.exceeded) == (verdict == "does not fit")
            assert found.not_shown == (("node",) if verdict == "not shown to fit" else ())
            assert (found.safe_limited_by == "node") == (verdict != "fits")


@given(st.sampled_from(KINDS), st.floats(1, 5000), st.floats(0, 300), st.floats(0, 500))
def test_the_limit_is_that_by_hand(kind: str, base_us: float, uncertainty_us: float, extra_us: float) -> None:
    changes = {"base_us": base_us, "uncertainty_us": uncertainty_us, "worst_extra_us": extra_us}
    one = network_of(network(kind, **{f"node__execution__{key}": value for key, value in changes.items()}))
    busy_us, doubt_us = 2 * (base_us + extra_us), 2 * 2 * uncertainty_us
    assert NODE_LIMIT.shown.shortest_period_us(one) == pytest.approx(busy_us + doubt_us)
    expected = 0 if busy_us + doubt_us <= 1000 else 2 if busy_us - doubt_us > 1000 else 1
    assert NODE_LIMIT.verdict_code(one) == expected


def test_the_slowest_group_counts() -> None:
    group = {"axes": 1, "read_bytes": 8, "write_bytes": 8}
    execution = {"kind": "linear", "grade": "measured", "per_byte_us": 0.0}
    data = {
        "schema_version": 1,
        "name": "press",
        "bus": {"kind": "sercos3"},
        "cycle": {"period_us": 1000.0},
        "group": [
            {"name": "quick", "nodes": 3, **group, "execution": {**execution, "base_us": 480.0, "uncertainty_us": 1.0}},
            {
                "name": "vague",
                "nodes": 2,
                **group,
                "execution": {**execution, "base_us": 470.0, "uncertainty_us": 20.0},
            },
        ],
    }
    one = kind_named("sercos3").profile_model().model_validate(data)
    assert NODE_LIMIT.shown.shortest_period_us(network_of(one)) == pytest.approx(2 * 470 + 4 * 20)
    found = busplan.capacity(one).verdicts[0].deciding
    assert (found.verdict, found.not_shown) == ("not shown to fit", ("node",))
    assert "vague: a node executes for 940.0 +/- 80.0 us of 1000.0 us" in str(busplan.capacity(one))
    # Surely late, though the other may take longer.
    late = busplan.load_profile(one, changes={"group.quick.execution.base_us": 503.0})
    assert busplan.capacity(late).verdicts[0].deciding.verdict == "does not fit"


@pytest.mark.parametrize("kind", KINDS)
def test_a_plan_takes_a_period_in_which_the_nodes_are_done(kind: str) -> None:
    found = busplan.plan(network(kind, node__execution__base_us=700))
    assert found.recommended is not None
    period_us = float(found.recommended.changes["cycle.period_us"])
    assert period_us >= 1420
    assert busplan.capacity(network(kind, node__execution__base_us=700, cycle__period_us=period_us)).results[0].fits


def test_the_smallest_period_of_a_comparison_leaves_the_nodes_their_time() -> None:
    # Once 31.25 us were said for nodes that take 500.
    found = busplan.compare("paper-1ms", buses=KINDS)
    for one in found.compared:
        assert one.smallest.us is not None
        assert one.smallest.us >= NODE_LIMIT.shown.shortest_period_us(one.network)
