"""What moves the margin: each row is the capacity of the profile with that change written in."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.sections.base import value_at
from tests.registers import at_least, shipped_of_each_kind, some

Maker = Callable[..., busplan.Profile]
TABLE = {"kind": "table", "payload_bytes": [4, 12, 14], "time_us": [30.0, 34.0, 40.0]}


def with_longer_execution(profile: busplan.Profile) -> dict[str, Any]:
    execution: Any = profile.node_groups[0].node.execution
    if execution.kind == "table":
        return {"node.execution.time_us": [1.1 * us for us in execution.time_us]}
    return {
        "node.execution.base_us": 1.1 * execution.base_us,
        "node.execution.per_byte_us": 1.1 * execution.per_byte_us,
    }


WRITTEN: dict[str, Callable[[busplan.Profile], dict[str, Any]]] = {
    "execution time +10%": with_longer_execution,
    "one more node": lambda profile: {"bus.nodes": profile.node_groups[0].nodes + 1},
    "one more axis per node": lambda profile: {"node.axes": profile.node_groups[0].node.axes + 1},
    "payload +4 bytes": lambda profile: {
        f"payload.{kind}_bytes": 4 + (getattr(profile.payload, f"{kind}_bytes") or 0) for kind in ("read", "write")
    },
    "one more hop": lambda profile: {"bus.max_hops": value_at(profile, "bus.max_hops") + 1},
    "one more busy retry": lambda profile: {"cycle.retries": value_at(profile, "cycle.retries") + 1},
    "host time +10 us": lambda profile: {"host.transaction_us": profile.host.transaction_us + 10},  # type: ignore[attr-defined]
    "host's jitter +10 us": lambda profile: {"bus.sync_jitter_us": value_at(profile, "bus.sync_jitter_us") + 10},
    "a bus reset": lambda _one: {"bus.gap_count": 63},
}
"""Each change as a user would write it into the file."""


def changed(profile: busplan.Profile, changes: Mapping[str, object]) -> busplan.Profile:
    return busplan.load_profile(profile, changes=changes)


def figures(profile: busplan.Profile) -> Any:
    """Figures under the timing model that decides."""
    return busplan.capacity(profile).verdicts[0].deciding


def effects(profile: busplan.Profile) -> dict[str, Any]:
    (sensitivity,) = busplan.capacity(profile, sensitivity=True).sensitivities
    return {effect.change: effect for effect in sensitivity.effects}


def next_bottleneck(profile: busplan.Profile) -> Any:
    return busplan.capacity(profile, sensitivity=True).sensitivities[0].next_bottleneck


@settings(max_examples=at_least(4, 40))
@given(data=st.data(), per_axis=st.sampled_from([None, 1, 8]), reserve=st.sampled_from([0.0, 0.2]))
def test_each_row_is_the_capacity_of_the_profile_with_that_change_and_the_largest_comes_first(
    data: st.DataObject, per_axis: int | None, reserve: float, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    changes = {"payload.read_bytes_per_axis": per_axis, "limits.reserve": reserve}
    profile = changed(data.draw(any_profile), changes)
    before, by_change = figures(profile), effects(profile)
    assert set(by_change) == set(WRITTEN)
    # What cannot be made comes last.
    sizes = [-1.0 if effect.margin_change_us is None else abs(effect.margin_change_us) for effect in by_change.values()]
    assert sizes == sorted(sizes, reverse=True)
    for change, effect in by_change.items():
        if change == "one more hop" and value_at(profile, "bus.max_hops") is None:
            assert (effect.margin_change_us, effect.then) == (None, None)
            assert effect.note
            continue
        after = figures(changed(profile, WRITTEN[change](profile)))
        assert effect.then is not None
        assert effect.then.margin_corrected_us == pytest.approx(after.margin_corrected_us, rel=1e-9, abs=1e-6)
        assert effect.then.uncertainty_us == pytest.approx(after.uncertainty_us, rel=1e-9, abs=1e-6)
        assert effect.margin_change_us == pytest.approx(
            (after.margin_corrected_us or 0) - (before.margin_corrected_us or 0), rel=1e-9, abs=1e-6
        )
        assert (effect.then.verdict, effect.then.safe, effect.then.exceeded) == (
            after.verdict,
            after.safe,
            after.exceeded,
        )


def test_what_adds_to_the_margin_has_its_place_by_its_size(make: Maker) -> None:
    # Table I has such a fall between 4 and 16 bytes, of 0.1 us.
    falling = {"kind": "table", "payload_bytes": [4, 8], "time_us": [200.0, 100.0]}
    ranked = [*effects(make(node__execution=falling, payload__read_bytes=4, payload__write_bytes=4)).values()]
    assert [effect.change for effect in ranked[:3]] == ["one more node", "payload +4 bytes", "execution time +10%"]
    assert [(effect.margin_change_us or 0) > 0 for effect in ranked[:3]] == [False, True, False]


def test_a_change_that_changes_nothing_gives_0_and_says_why(make: Maker) -> None:
    by_change = effects(make())
    for change, note in (
        ("a bus reset", "it is set so already"),
        ("one more axis per node", "no payload follows the axes"),
        ("host time +10 us", "the gaps after the transactions hide it"),
    ):
        assert (by_change[change].margin_change_us, by_change[change].note) == (0.0, note)
    assert (by_change["a bus reset"].before, by_change["a bus reset"].after) == (63, 63)
    off = effects(make(node__read_response="concatenated", node__write_response="unified"))
    execution = off["execution time +10%"]
    assert (execution.margin_change_us, execution.note) == (0.0, "no execution time is on the bus")
    moved = effects(make(bus__gap_count=8, payload__read_bytes_per_axis=8))
    assert [moved[change].note for change in ("a bus reset", "one more axis per node", "host time +10 us")] == [""] * 3


def test_a_payload_outside_the_table_is_not_known(make: Maker) -> None:
    by_change = effects(make(node__execution=TABLE, payload__read_bytes_per_axis=None))
    effect = by_change["payload +4 bytes"]
    assert (effect.margin_change_us, effect.then, effect.before, effect.after) == (None, None, 12, 16)
    assert effect.note == "not known: 16 bytes is outside the execution table, 4 to 14 bytes"
    data = {"node__execution": TABLE, "payload__write_bytes": 4, "payload__read_bytes": 2}
    axis = effects(make(**data, payload__read_bytes_per_axis=3))["one more axis per node"]
    assert (axis.then, axis.note) == (None, "not known: 17 bytes is outside the execution table, 4 to 14 bytes")
    # Between its points it is as known as before.
    profile = changed(make(node__execution=TABLE), {"payload.read_bytes": 4, "payload.write_bytes": 8})
    after = figures(changed(profile, {"payload.read_bytes": 8, "payload.write_bytes": 12}))
    then = effects(profile)["payload +4 bytes"].then
    assert then is not None
    assert then.margin_corrected_us == after.margin_corrected_us


def test_hops_follow_the_nodes_in_a_chain_and_not_in_a_tree(make: Maker) -> None:
    chain, tree = effects(make(bus__nodes=4)), effects(make(bus__nodes=4, bus__max_hops=4))
    assert chain["one more hop"].note == "in a chain the hops follow the nodes"
    assert (tree["one more hop"].before, tree["one more hop"].after) == (4, 5)
    hop_us, node_us = tree["one more hop"].margin_change_us, tree["one more node"].margin_change_us
    assert hop_us is not None
    assert node_us is not None
    # Another node of the chain brings its hop, too, which all five are then charged.
    assert chain["one more node"].margin_change_us == pytest.approx(node_us + hop_us * 62 / 50, rel=1e-3)


def test_what_changes_has_its_values_where_they_are_one(make: Maker) -> None:
    same, unlike = effects(make()), effects(make(payload__write_bytes=16))
    assert (same["execution time +10%"].before, same["execution time +10%"].key) == (
        pytest.approx(34.2),
        "execution_us",
    )
    assert (same["payload +4 bytes"].before, same["payload +4 bytes"].after) == (12, 16)
    for change in ("execution time +10%", "payload +4 bytes"):
        assert (unlike[change].before, unlike[change].after) == (None, None)
        assert unlike[change].margin_change_us


def test_a_change_that_the_profile_refuses_is_said_so(make: Maker) -> None:
    effect = effects(make(cycle__retries=1_000_000))["one more busy retry"]
    assert effect.then is None
    assert effect.note == "cycle.retries 1000001: must be 1,000,000 or less"


def test_each_group_has_a_node_and_an_axis_more_in_turn() -> None:
    gantry = busplan.load_profile("gantry-24")
    rows, now = effects(gantry), figures(gantry)
    for group in gantry.group[::2]:
        for change, key, more in (
            (f"one more node in {group.name}", "nodes", group.nodes + 1),
            (f"one more axis per node in {group.name}", "axes", group.axes + 1),
        ):
            row = rows[change]
            assert (row.key, row.before, row.after) == (f"group.{group.name}.{key}", more - 1, more)
            then = figures(changed(gantry, {row.key: more}))
            assert row.then is not None
            assert row.then.margin_corrected_us == then.margin_corrected_us
            moved_us = (row.then.margin_corrected_us or 0) - (now.margin_corrected_us or 0)
            assert row.margin_change_us == moved_us
    assert rows["one more axis per node in io"].note == "no payload follows the axes"
    assert [limit.group for limit in next_bottleneck(gantry).limits] == ["drives", "tool", "io"]


def test_each_period_has_its_margins_and_the_same_changes_of_them(make: Maker) -> None:
    long, short = busplan.capacity(make(bus__nodes=9), period_us=[4000.0, 2000.0], sensitivity=True).sensitivities
    changes = [[effect.margin_change_us for effect in sensitivity.effects] for sensitivity in (long, short)]
    assert changes[0] == pytest.approx(changes[1], nan_ok=False, abs=1e-9)
    assert long.now.margin_corrected_us == pytest.approx((short.now.margin_corrected_us or 0) + 1000)
    assert (long.now.verdict, short.now.verdict) == ("fits", "does not fit")


# --- the next bottleneck ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", some(shipped_of_each_kind(), 4))
def test_without_execution_the_cycle_is_that_of_nodes_that_need_no_time(name: str) -> None:
    profile = busplan.load_profile(name)
    bottleneck = next_bottleneck(profile)
    execution = {"kind": "linear", "base_us": 0, "per_byte_us": 0, "grade": "derived"}
    idle = {nodes.node_key("execution"): execution for nodes in profile.node_groups}
    without = figures(changed(profile, idle))
    if bottleneck.binding_term.name == "execution":
        assert bottleneck.next_binding_term.name == without.binding_term
        assert bottleneck.next_margin_corrected_us == without.margin_corrected_us
    elif bottleneck.next_margin_corrected_us is not None:
        # A key takes the term away: of every kind the first, of this kind the others.
        removals = ({"cycle.nonperiodic_us": 0}, *kind_named(profile.bus.kind).term_removals)
        margins = [figures(changed(profile, removal)).margin_corrected_us for removal in removals]
        assert bottleneck.next_margin_corrected_us in margins


def test_less_execution_leaves_the_bus_idle_for_longer() -> None:
    # The bench of Table I: 73.6 us of execution gone make 10.5 us of margin.
    profile = busplan.load_profile("paper-two-node")
    bottleneck, now_us = next_bottleneck(profile), figures(profile).margin_corrected_us
    assert bottleneck.binding_term.us == pytest.approx(73.6)
    assert (bottleneck.next_margin_corrected_us or 0) - (now_us or 0) == pytest.approx(10.51, abs=0.005)


@pytest.mark.parametrize(
    ("changes", "binding", "is_gone"),
    [
        ({"cycle__nonperiodic_us": 900.0}, "nonperiodic_us", True),
        ({"cycle__retries": 60}, "retries_us", True),
        ({"host": {"transaction_us": 300.0}}, "cycle_host_us", True),
        ({"bus__cycle_master": True, "bus__isochronous_us": 80.0}, "cycle_starts_us", True),
        ({"node__execution__base_us": 0.0, "node__execution__per_byte_us": 0.0}, "cycle_idle_us", False),
    ],
)
def test_a_term_goes_with_its_cause(make: Maker, changes: dict[str, Any], binding: str, is_gone: bool) -> None:
    bottleneck = next_bottleneck(make(**changes))
    assert (bottleneck.binding_term.key, bottleneck.next_margin_corrected_us is not None) == (binding, is_gone)
    assert bottleneck.next_binding_term.key != binding


@settings(max_examples=at_least(5, 40))
@given(data=st.data())
def test_without_the_limit_the_next_one_keeps_one_node_more_off(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    (limit,) = next_bottleneck(profile).limits

    def is_kept(nodes: int) -> bool:
        then = figures(changed(profile, {"bus.nodes": nodes}))
        broken = {*then.exceeded, *(then.not_shown or ()), *(() if then.safe else ("gap table",))}
        late = (then.safe_required_us or 0) > then.available_us * (1 + 1e-12)
        return not broken - {"time", limit.limited_by} and not (late and limit.limited_by != "time")

    assert limit.next_safe_nodes == 0 or is_kept(limit.next_safe_nodes)
    assert not is_kept(limit.next_safe_nodes + 1)
    assert limit.next_safe_nodes >= limit.safe_nodes
    assert limit.next_limited_by != limit.limited_by


def test_a_change_that_moves_no_margin_says_what_it_takes_from_other_limits() -> None:
    def of_execution(base_us: float) -> Any:
        execution = {"base_us": base_us, "per_byte_us": 0.0, "uncertainty_us": 0.0, "worst_extra_us": 0.0}
        changes = {f"node.execution.{key}": value for key, value in execution.items()}
        profile = changed(busplan.load_profile("ethercat-servo-8"), changes)
        return next(effect for effect in effects(profile).values() if effect.key == "execution_us")

    exact = of_execution(100.0)
    assert exact.margin_change_us == 0
    why, node, sync0 = exact.note.split("; ")
    assert why == "no execution time is on the bus"
    assert node == "it takes 20.0 us of the 800.0 us before the limit of node"
    assert sync0.startswith("it takes 10.0 us of the ")
    assert sync0.endswith(" us before the limit of sync0")
    assert "it adds 120.0 us to the 200.0 us beyond the limit of node" in of_execution(600.0).note
