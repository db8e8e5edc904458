"""Groups of unlike nodes: equal ones are a uniform bus, unlike ones add up, and each is counted for itself."""

import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from math import fsum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.cycle import BusCycle
from busplan.errors import BusplanError
from busplan.profile.edit import profile_text
from busplan.profile.sources import load
from busplan.questions.fit.figures import COUNTS, CapacityFigures
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at
from tests.registers import at_least

GANTRY = busplan.load_profile("gantry-24")


def changed(profile: busplan.Profile, changes: Mapping[str, object]) -> busplan.Profile:
    return busplan.load_profile(profile, changes=changes)


def figures(profile: busplan.Profile, model: str = "standard") -> CapacityFigures:
    (figures,) = busplan.capacity(profile, timing_model=model).results
    return figures


def cycle_of(profile: busplan.Profile, model: str = "standard") -> BusCycle:
    network = network_of(profile)
    return network.bus.cycle(network, model=model)


def profile_of(data: dict[str, Any]) -> busplan.Profile:
    return kind_named("ieee1394").profile_model().model_validate(data)


def in_groups(profile: busplan.Profile, parts: list[int]) -> busplan.Profile:
    """The same nodes in groups of these sizes."""
    data = profile.model_dump(exclude_unset=True)
    node, payload = data.pop("node"), data.pop("payload")
    del data["bus"]["nodes"]
    names = "abcdef"
    data["group"] = [{**node, **payload, "name": names[place], "nodes": nodes} for place, nodes in enumerate(parts)]
    return profile_of(data)


@st.composite
def groups(draw: st.DrawFn, name: str) -> dict[str, Any]:
    axes = draw(st.integers(0, 6))
    payload: dict[str, int] = {}
    for kind in ("read", "write"):
        each = draw(st.none() | st.integers(1, 100)) if axes else None
        if each is not None:
            payload[f"{kind}_bytes_per_axis"] = each
        if each is None or draw(st.booleans()):
            payload[f"{kind}_bytes"] = draw(st.integers(1, 600))
    return {
        "name": name,
        "nodes": draw(st.integers(1, 8)),
        "axes": axes,
        **payload,
        "execution": {
            "kind": "linear",
            "base_us": draw(st.floats(0, 80)),
            "per_byte_us": draw(st.floats(0, 1)),
            "worst_extra_us": draw(st.sampled_from([0.0, 3.0])),
            "grade": draw(st.sampled_from(["measured", "assumed"])),
            "residual": draw(st.sampled_from(["none", "standard"])),
        },
        "read_response": draw(st.sampled_from(["split", "concatenated"])),
        "write_response": draw(st.sampled_from(["split", "unified"])),
        "hops": draw(st.integers(1, 5)),
    }


@st.composite
def grouped(draw: st.DrawFn) -> busplan.Profile:
    """Random profiles with one to three groups, in a chain or a tree, with each way to charge hops."""
    tree = draw(st.booleans())
    each = [draw(groups(name)) for name in "abc"[: draw(st.integers(1, 3))]]
    for one in each:
        if not tree:
            del one["hops"]
    return profile_of(
        {
            "schema_version": 1,
            "name": "grouped",
            "bus": {
                "kind": "ieee1394",
                "speed": draw(st.sampled_from(["S100", "S400"])),
                "gap_count": draw(st.sampled_from([63, 20, "optimal"])),
                "charge_hops": draw(st.sampled_from(["farthest", "own"])),
                **({"max_hops": 5} if tree else {}),
                "cycle_master": draw(st.booleans()),
            },
            "host": {"transaction_us": draw(st.sampled_from([0.0, 12.5]))},
            "cycle": {
                "period_us": draw(st.floats(300, 20_000)),
                "slice_ratio": draw(st.floats(0.3, 1.0)),
                "retries": draw(st.sampled_from([0, 2])),
                "schedule": draw(st.sampled_from(["individual", "broadcast"])),
                "broadcast_request": draw(st.sampled_from(["isochronous", "priority", "timed"])),
            },
            "group": each,
            "limits": {"reserve": draw(st.sampled_from([0.0, 0.15]))},
        }
    )


# --- equal groups -----------------------------------------------------------------------------------------


@settings(max_examples=at_least(5, 40))
@given(data=st.data(), parts=st.lists(st.integers(1, 20), min_size=1, max_size=4), own=st.booleans())
def test_equal_neighbours_are_the_uniform_bus_to_the_bit(
    data: st.DataObject, parts: list[int], own: bool, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    drawn = data.draw(any_profile)
    charged = {"bus.charge_hops": "own"} if own and not value_at(drawn, "bus.max_hops") else {}
    profile = changed(drawn, {"bus.nodes": sum(parts), **charged})
    split = in_groups(profile, parts)
    for uniform, grouped in zip(busplan.capacity(profile).results, busplan.capacity(split).results, strict=True):
        assert (grouped.timing_model, grouped.terms) == (uniform.timing_model, uniform.terms)
        whole = {key: value for key, value in uniform.by_key().items() if key not in {*COUNTS, "nodes_eq11"}}
        assert {key: grouped.by_key()[key] for key in whole} == whole
        lanes, lanes_of_groups = (busplan.timeline(bus, timing_model=uniform.timing_model) for bus in (profile, split))
        assert lanes_of_groups.events == lanes.events
        for nodes, group in zip(parts, grouped.groups, strict=True):
            # The other groups are there already; a bus that is too full with one more node of any carries none.
            for key in ("max_nodes", "safe_nodes"):
                most = getattr(uniform, key)
                expected = None if most is None else max(most - (sum(parts) - nodes), 0)
                assert getattr(group, key) == expected
        assert all(getattr(grouped, key) is None for key in COUNTS)


def test_equal_groups_that_are_no_neighbours_stay_apart() -> None:
    drives, tool, _ = GANTRY.group
    data = GANTRY.model_dump(exclude_unset=True)
    data["group"] = [{**data["group"][0], "name": name} for name in "ab"]
    assert len(network_of(profile_of(data)).groups) == 1
    data["group"].insert(1, GANTRY.model_dump(exclude_unset=True)["group"][1])
    network = network_of(profile_of(data))
    assert [group.name for group in network.groups] == ["a", "tool", "b"]
    assert network.nodes == 2 * drives.nodes + tool.nodes


# --- unlike groups ----------------------------------------------------------------------------------------


@settings(max_examples=at_least(5, 40))
@given(profile=grouped())
def test_events_add_up_to_the_terms(profile: busplan.Profile) -> None:
    for figures_of_model in busplan.capacity(profile).results:
        cycle = cycle_of(profile, figures_of_model.timing_model)
        of_events: dict[str, list[float]] = defaultdict(list)
        for event in cycle.events():
            of_events[event.term].append(event.us)
        for term in cycle.terms:
            assert fsum(of_events.pop(term.key, [])) == pytest.approx(term.us, rel=1e-12, abs=1e-12)
        assert not of_events


@pytest.mark.slow
@given(profile=grouped())
def test_each_group_is_counted_as_a_brute_search_counts_it(profile: busplan.Profile) -> None:
    """One node more at a time, the others as they are, each a profile of its own."""
    for group in figures(profile).groups:
        axes = group.axes // group.nodes
        assert (group.max_axes, group.safe_axes) == (axes * group.max_nodes, axes * (group.safe_nodes or 0))
        for most, key in ((group.max_nodes, "fits"), (group.safe_nodes or 0, "is_shown")):
            for nodes in {most, most + 1} - {0}:
                then = figures(changed(profile, {f"group.{group.name}.nodes": nodes}))
                fits = {"fits": then.fits, "is_shown": then.verdict == "fits" and then.safe}
                assert fits[key] == (nodes <= most), (group.name, key)


@settings(max_examples=at_least(6, 40))
@given(profile=grouped())
def test_own_hops_never_take_longer_than_those_of_the_farthest(profile: busplan.Profile) -> None:
    own, farthest = (changed(profile, {"bus.charge_hops": word}) for word in ("own", "farthest"))
    for shorter, longer in zip(figures(own).terms, figures(farthest).terms, strict=True):
        assert shorter.us <= longer.us + 1e-9, shorter.key


@settings(max_examples=at_least(4, 40))
@given(profile=grouped())
def test_a_derivation_gives_the_figures(profile: busplan.Profile) -> None:
    for of_model in busplan.capacity(profile).results:
        values = of_model.values()
        for key in ("required_us", "margin_us", "read_latency_us", "axes"):
            if values[key] is not None:
                (derivation,) = busplan.explain(profile, key, timing_model=of_model.timing_model).derivations
                assert derivation.value == values[key]


@settings(max_examples=at_least(3, 24))
@given(profile=grouped(), nodes=st.lists(st.integers(1, 20), min_size=2, max_size=4, unique=True))
def test_a_sweep_gives_what_each_profile_gives(profile: busplan.Profile, nodes: list[int]) -> None:
    name = profile.group[-1].name
    vary = {f"group.{name}.nodes": nodes, f"group.{profile.group[0].name}.axes": [1, 2]}
    answer = busplan.sweep(profile, vary=vary)
    models, rows = answer.sweep.timing_models, answer.to_dict()["rows"]
    assert len(rows) == len(nodes) * 2 * len(models)
    for row in rows:
        alone = figures(changed(profile, {key: row[key] for key in vary}), row["timing_model"])
        own = {f"group.{one.name}.{key}": getattr(one, key) for one in alone.groups for key in COUNTS}
        # Those of the whole are of the group that varies.
        whole = {key: value for key, value in alone.by_key().items() if key not in COUNTS}
        for key, value in {**whole, **own}.items():
            assert row[key] == (pytest.approx(value, rel=1e-9, abs=1e-9) if isinstance(value, float) else value), key


def test_the_figures_of_the_gantry_by_hand() -> None:
    """Execution: 4 nodes of 40 B twice, one of 36 and 32 B, one read of 8 B; a table has 45.4 us at 32, 54.7 at 64."""

    def between_us(size: int) -> float:
        return 45.4 + (54.7 - 45.4) * (size - 32) / (64 - 32)

    gantry = figures(GANTRY)
    (term,) = (term for term in gantry.terms if term.name == "execution")
    assert term.us == pytest.approx(4 * 2 * between_us(40) + between_us(36) + 45.4 + (5 + 0.8))
    assert (gantry.nodes, gantry.axes, busplan.Ieee1394Figures.of(gantry).hops) == (6, 24, 6)


def test_set_points_of_the_circle_arrive_at_nodes_with_axes() -> None:
    """x is on the first node that has axes, y on the last."""
    data = changed(GANTRY, {"servo.loop": "host", "servo.update": "on_arrival"}).model_dump(exclude_unset=True)
    before = busplan.circle_test(profile_of(data)).results[0]
    data["group"] = [*data["group"][:-1], {**data["group"][-1], "axes": 1}]
    after = busplan.circle_test(profile_of(data)).results[0]
    assert after.delay_x_us == before.delay_x_us
    assert after.delay_y_us > before.delay_y_us


# --- what a profile may say -------------------------------------------------------------------------------


def gantry_with(old: str, new: str) -> str:
    text = load("gantry-24").document.text
    assert old in text
    return text.replace(old, new, 1)


def read(text: str, folder: Path) -> busplan.Profile:
    file = folder / "x.toml"
    file.write_text(text, encoding="utf-8")
    return busplan.load_profile(file)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name = "tool" ', 'name = "drives" ', 'group[1].name = "drives": there is a group of this name'),
        ("axes = 0", "axes = 0\nread_bytes_per_axis = 4\nread_bytess = 1", "read_bytess: unknown key"),
        (
            "read_bytes = 8             # assumed\n",
            "read_bytes_per_axis = 4\n",
            "group.io.read_bytes_per_axis = 4: makes a payload of 0 bytes: the group has no axes; give read_bytes",
        ),
        ("nodes = 4\n", "", "group.drives.nodes: missing key. Nodes of the group; for example nodes = 2"),
        ("nodes = 4\n", "nodes = 0\n", "group.drives.nodes = 0: must be 1 or more"),
        ("[cycle]", "nodes = 6\n[cycle]", "bus.nodes = 6: this profile has groups; set group.NAME.nodes instead"),
        ("[limits]", "[node]\naxes = 1\n[limits]", "node.execution: missing section"),
        ("axes = 4\n", "axes = 4\nhops = 2\n", "group.tool.hops = 2: the order of the groups says it in a chain"),
        (
            'charge_hops = "own" ',
            'charge_hops = "own"\nmax_hops = 3 ',
            "group.drives.hops: missing key: bus.charge_hops",
        ),
        ('kind = "linear"\ngrade', 'kind = "linea"\ngrade', 'group.io.execution.kind = "linea": expected'),
    ],
)
def test_a_fault_of_a_group_is_named_with_its_place(old: str, new: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(BusplanError) as caught:
        read(gantry_with(old, new), tmp_path)
    (problem,) = (problem for problem in caught.value.problems if said in problem)
    assert re.search(r"x\.toml:\d+:\d+: ", problem)


def test_a_tree_charges_the_hops_of_its_groups(tmp_path: Path) -> None:
    text = gantry_with('charge_hops = "own" ', 'charge_hops = "own"\nmax_hops = 3 ')
    for axes in ("axes = 5", "axes = 4", "axes = 0"):
        text = text.replace(axes, f"{axes}\nhops = 2", 1)
    tree = read(text, tmp_path)
    assert {transaction.phases["hops"] for transaction in busplan.latency(tree).transactions} == {2}
    assert busplan.Ieee1394Figures.of(figures(tree)).hops == 3


@given(profile=grouped())
def test_a_written_profile_reads_to_the_same(profile: busplan.Profile) -> None:
    with TemporaryDirectory() as folder:
        assert read(profile_text(profile), Path(folder)) == profile


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"group.drive.nodes": 3}, "group.drive.nodes: no group is called drive; there are drives, tool, io"),
        ({"group.nodes": 3}, "group.nodes: no such key; give the name of one, as group.drives.nodes"),
        ({"bus.nodes": 5}, "bus.nodes 5: this profile has groups; set group.NAME.nodes"),
        ({"group.io.axes": -1}, "group.io.axes -1: must be 0 or more"),
    ],
)
def test_a_change_of_a_group_is_checked_as_the_file(changes: dict[str, object], said: str) -> None:
    with pytest.raises(BusplanError, match=said.replace("[", r"\[").replace("]", r"\]")):
        changed(GANTRY, changes)


def test_groups_can_take_the_place_of_the_nodes(make: Callable[..., busplan.Profile]) -> None:
    data = GANTRY.model_dump(exclude_unset=True)
    with pytest.raises(BusplanError, match=r"bus\.nodes: this profile has groups"):
        changed(make(), {"group": data["group"]})


# --- what to set ------------------------------------------------------------------------------------------


@settings(max_examples=at_least(5, 28))
@given(
    profile=grouped(),
    limits=st.fixed_dictionaries(
        {},
        optional={
            "limits.max_utilisation": st.sampled_from([0.3, 0.8]),
            "limits.min_spare_nodes": st.integers(0, 3),
            "limits.min_spare_axes": st.integers(0, 9),
        },
    ),
)
def test_what_a_plan_writes_for_groups_passes_the_gate(profile: busplan.Profile, limits: dict[str, object]) -> None:
    best = busplan.plan(changed(profile, limits)).recommended
    if best is None:
        return
    (file,) = busplan.check(best.profile, circle=False).files
    assert [one.message for one in file.findings if one.severity == "error"] == []


def test_a_plan_names_what_it_cannot_ask_of_groups() -> None:
    with pytest.raises(
        BusplanError,
        match=r"axes 30: .* differ; say --set group\.drives\.nodes=6 or --set group\.tool\.nodes=3$",
    ):
        busplan.plan(GANTRY, axes=30)
    with pytest.raises(BusplanError, match="nodes: there is nothing of that name to free"):
        busplan.plan(GANTRY, free=["nodes"])


def test_a_plan_sets_the_payload_of_each_group_before_the_period() -> None:
    found = busplan.plan(GANTRY, changes={"group.drives.nodes": 9}, free=["payload", "period"]).recommended_changes
    assert found is not None
    assert set(found) == {"cycle.period_us", "group.drives.nodes"} | {
        f"group.{key}_bytes_per_axis" for key in ("drives.read", "drives.write", "tool.read", "tool.write")
    }
    assert busplan.capacity(changed(GANTRY, found | {"group.drives.nodes": 9})).verdict == "fits"


@pytest.mark.parametrize("key", ["min_spare_nodes", "min_spare_axes"])
def test_room_is_asked_for_in_each_group(key: str) -> None:
    # 7 axes are on two nodes of drives, which have five, and on two of tool, which have four.
    asked = changed(GANTRY, {f"limits.{key}": 2 if key == "min_spare_nodes" else 7})
    assert {missed.key for missed in busplan.capacity(asked).verdicts[0].missed_limits} == {f"limits.{key}"}
    best = busplan.plan(asked).recommended
    assert best is not None
    for name, nodes in (("drives", 6), ("tool", 3), ("io", 3)):
        assert busplan.capacity(changed(best.profile, {f"group.{name}.nodes": nodes})).verdict == "fits"


# --- each node's own way ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "root", "steps"), [("request_data", None, 1), ("arbitration", None, 0), ("arbitration", "host", 1)]
)
def test_each_node_is_drawn_at_its_own_hops(
    make: Callable[..., busplan.Profile], kind: str, root: str | None, steps: int
) -> None:
    """Arbitration goes to the root, which may lie at the end of the chain."""
    profile = make(bus__nodes=4, bus__charge_hops="own", bus__root=root)
    hop_us = 0.023 + 14 / 98.304
    first_us: dict[int, float] = {}
    for event in cycle_of(profile).events():
        if event.kind == kind and event.transaction == "read" and event.node is not None:
            first_us.setdefault(event.node, event.us)
    assert list(first_us) == [1, 2, 3, 4]
    steps_us = [first_us[node + 1] - first_us[node] for node in (1, 2, 3)]
    assert steps_us == pytest.approx([steps * hop_us] * 3, rel=1e-9)


@pytest.mark.parametrize(("root", "parts"), [("host", 12), (None, 8)])
def test_the_doubt_of_phys_is_that_of_each_nodes_own_way(
    make: Callable[..., busplan.Profile], root: str | None, parts: int
) -> None:
    """Three nodes: 1 + 2 + 3 hops instead of 3 * 3, for the six parts of a read's and of a write's packets.

    Two of the six arbitrate, and do so over the own way only where the host is the root.
    """
    own, farthest = (
        next(doubt for doubt in figures(profile).doubts if doubt.key == "bus.phy_delay_us")
        for profile in (make(bus__nodes=3, bus__charge_hops="own", bus__root=root), make(bus__nodes=3))
    )
    each_us = 0.020 / 3**0.5
    assert farthest.us - own.us == pytest.approx(parts * (9 - 6) * each_us, rel=1e-9)


@pytest.mark.parametrize(("name", "group"), [("gantry-24", "drives"), ("paper-4ms", "")])
def test_the_most_axes_are_those_of_the_largest_network_that_is_shown_to_fit(name: str, group: str) -> None:
    # With more nodes of the group with the most axes, one by one.
    profile = busplan.load_profile(name, changes={"cycle.period_us": 2500})
    key = f"group.{group}.nodes" if group else "bus.nodes"
    nodes, most = next(one.nodes for one in profile.node_groups if one.name == group), 0
    while (found := figures(changed(profile, {key: nodes}))).verdict == "fits" and found.safe:
        nodes, most = nodes + 1, found.axes
    assert most > figures(profile).axes
    assert figures(profile).most_axes == most


def test_a_network_of_messages_has_neither_nodes_nor_axes() -> None:
    message = {"name": "m", "identifier": 1, "payload_bytes": 8, "period_us": 10_000}
    bus = {"kind": "can", "bit_rate_kbit_s": 500}
    data = {"schema_version": 1, "name": "messages", "bus": bus, "message": [message]}
    verdict = busplan.capacity(kind_named("can").profile_model().model_validate(data)).verdicts[0]
    alone = verdict.figures
    assert verdict.cycle is None
    with pytest.raises(BusplanError, match="a network of messages alone has no cycle"):
        _ = verdict.deciding
    assert (alone.nodes, alone.axes, hasattr(alone, "most_axes")) == (0, 0, False)
