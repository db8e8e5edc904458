"""The steps of the largest number of nodes are those that `capacity` finds at any period."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses.ieee1394.timing import TimingModelName
from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.fit.figures import figures
from busplan.questions.fit.node_steps import node_steps
from busplan.sections.profile import Profile

BASE = load("paper-4ms").profile
MODELS = st.sampled_from(["paper", "standard"])


@given(
    model=MODELS,
    period_us=st.floats(1.0, 1e6),
    gap_count=st.sampled_from([5, 20, 63, "optimal"]),
    max_hops=st.sampled_from([None, 1, 3, 16, 17]),
    axes=st.integers(1, 8),
    nonperiodic_us=st.sampled_from([0.0, 300.0]),
)
def test_any_period_carries_what_capacity_says(
    model: TimingModelName,
    period_us: float,
    gap_count: int | str,
    max_hops: int | None,
    axes: int,
    nonperiodic_us: float,
) -> None:
    changes: dict[str, object] = {
        "bus.gap_count": gap_count,
        "node.axes": axes,
        "cycle.nonperiodic_us": nonperiodic_us,
        "cycle.period_us": period_us,
    }
    profile = override(BASE, changes | ({} if max_hops is None else {"bus.max_hops": max_hops}))
    steps = node_steps(profile, model=model)
    found = figures(profile, model=model)
    assert steps.is_safe == (model == "standard")
    assert steps.max_axes(period_us) == (found.safe_axes if steps.is_safe else found.max_axes)
    assert all(one < other for one, other in pairwise(steps.from_us))


@pytest.mark.parametrize("model", ["paper", "standard"])
def test_each_step_is_where_one_more_node_begins_to_fit(model: TimingModelName) -> None:
    def most(profile: Profile) -> int | None:
        found = figures(profile, model=model)
        return found.safe_nodes if model == "standard" else found.max_nodes

    steps = node_steps(BASE, model=model)
    assert steps.from_us
    for nodes, from_us in enumerate(steps.from_us, start=1):
        at, before = (
            most(override(BASE, {"cycle.period_us": period_us})) for period_us in (from_us, from_us * (1 - 1e-9))
        )
        assert (at, before) == (nodes, nodes - 1)
        # What fits but for the rounding of floats fits here too.
        near_us = from_us * (1 - 5e-13)
        assert most(override(BASE, {"cycle.period_us": near_us})) == nodes
        assert steps.max_axes(near_us) == nodes * BASE.alike_nodes[0].node.axes
        found = figures(override(BASE, {"bus.nodes": nodes}), model=model)
        smallest_us = found.safe_min_period_us if model == "standard" else found.min_period_us
        assert smallest_us == pytest.approx(from_us)


def test_what_no_period_carries_has_no_steps() -> None:
    profile = override(BASE, {"node.execution": {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.0}})
    steps = node_steps(override(profile, {"payload.read_bytes": 4096}), model="paper")
    assert (steps.from_us, steps.limited_by, steps.max_axes(1e9)) == ((), "payload", 0)
    with pytest.raises(BusplanError):
        override(profile, {"payload.read_bytes": 0})
