"""The limit that a node is done once a cycle: by hand, in three verdicts, and what plan and compare make of it."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan

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
    one = network(kind, **{f"node__execution__{key}": value for key, value in changes.items()})
    found = busplan.capacity(one).verdicts[0].deciding
    busy_us, doubt_us = 2 * (base_us + extra_us), 2 * 2 * uncertainty_us
    assert ("node" in found.exceeded) == (busy_us - doubt_us > 1000)
    assert ("node" in (found.not_shown or ())) == (busy_us - doubt_us <= 1000 < busy_us + doubt_us)
    # Nothing else asks for more than a fifth of the period.
    assert found.min_period_us is not None
    assert found.min_period_us >= busy_us * (1 - 1e-12)
    assert found.safe_min_period_us is None or found.safe_min_period_us >= (busy_us + doubt_us) * (1 - 1e-12)


PRESS = """
schema_version = 1
name = "press"
bus = {kind = "sercos3"}
cycle = {period_us = 1000}
"""
GROUP = """
[[group]]
name = "{name}"
nodes = 3
axes = 1
read_bytes = 8
write_bytes = 8
execution = {{kind = "linear", grade = "measured", base_us = {base_us}, per_byte_us = 0, uncertainty_us = {doubt_us}}}
"""


def test_the_slowest_group_counts(tmp_path: Path) -> None:
    groups = GROUP.format(name="quick", base_us=480, doubt_us=1) + GROUP.format(name="vague", base_us=470, doubt_us=20)
    (tmp_path / "press.toml").write_text(PRESS + groups, encoding="utf-8")
    one = busplan.load_profile(tmp_path / "press.toml")
    found = busplan.capacity(one).verdicts[0].deciding
    assert (found.verdict, found.not_shown) == ("not shown to fit", ("node",))
    # 2 x 470 + 4 x 20 us: the next period that SERCOS III knows is 1,250 us.
    assert (found.min_period_us, found.safe_min_period_us) == (1000, 1250)
    assert "vague: a node's execution takes 940.0 +/- 80.0 us of its 1000.0 us" in str(busplan.capacity(one))
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
        # A read and a write of 36.73 us, and as much again as two tenths of them, for nobody has measured it there.
        assert one.smallest.us >= 2 * 36.73 * 1.2
