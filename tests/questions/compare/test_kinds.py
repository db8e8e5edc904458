"""A machine on several kinds of bus: what stays of it, its smallest period and its most axes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named, kind_names
from busplan.profile.conversion import converted
from busplan.profile.kinds import dotted_keys
from busplan.questions.compare import MachineOnKind, NotOnKind
from busplan.sections.base import MAX_TIME_US, MIN_STEP_US, TRANSACTION_KINDS
from busplan.sections.profile import CIRCLE_SECTIONS, Profile
from tests.registers import SHIPPED_FOLDER, at_least, some

Profiles = Mapping[str, st.SearchStrategy[Profile]]
SOME = settings(max_examples=at_least(2))
KINDS = pytest.mark.parametrize("kind", kind_names())
BOTH = ("ieee1394", "can")
PERIOD, FITS = "cycle.period_us", "fits"
CABLE = "cable_length_m"


def changed(profile: Profile | str, **changes: object) -> Profile:
    return busplan.load_profile(profile, changes={key.replace("__", "."): value for key, value in changes.items()})


INPUTS = changed("gantry-24", group__io__read_bytes=40)
"""Without axes, no PDO of its own takes bytes from it."""


def decided(profile: Profile) -> Any:
    """Its figures under the timing model that decides."""
    (figures,) = busplan.capacity(profile, timing_model=kind_named(profile.bus.kind).deciding_model).results
    return figures


def on_kind(profile: Profile | str, kind: str | None = None) -> MachineOnKind:
    """The machine on a kind of bus, by default its own."""
    own = busplan.load_profile(profile)
    (machine,) = busplan.compare(own, buses=kind or own.bus.kind).compared
    return machine


def assert_same_machine(one: Profile, other: Profile) -> None:
    """The nodes in their order, what travels, how they execute, and all that a circle rests on."""
    assert [each.name for each in other.node_groups] == [each.name for each in one.node_groups]
    for mine, its in zip(one.node_groups, other.node_groups, strict=True):
        for kind in TRANSACTION_KINDS:
            size = int(mine.bytes_of(kind))
            assert its.bytes_of(kind) == size
            assert its.node.execution.execution_us(size) == mine.node.execution.execution_us(size)
    for mine, its in zip(one.node_groups, other.node_groups, strict=True):
        assert (mine.nodes, mine.node.axes) == (its.nodes, its.node.axes)
        said, found = mine.node.execution.model_dump(), its.node.execution.model_dump()
        if other.bus.kind != one.bus.kind:  # nobody has measured it on that bus
            said["grade"] = "assumed"
        assert said.items() >= {key: found[key] for key in said.keys() & found.keys()}.items()
        assert {"kind", "grade", "uncertainty_us", "worst_extra_us"} <= said.keys() & found.keys()
    for key in ("period_us", "slice_ratio", "nonperiodic_us"):
        assert getattr(other.cycle, key) == getattr(one.cycle, key)
    assert other.limits.reserve == one.limits.reserve
    assert other.asks_for_circle == one.asks_for_circle
    for section in CIRCLE_SECTIONS:
        assert getattr(other, section).model_dump(exclude_unset=True) == getattr(one, section).model_dump(
            exclude_unset=True
        )


def assert_accounted(one: Profile, kind: str) -> None:
    """Each key that the profile sets is kept, left out or assumed; each that it does not set is assumed or common."""
    found = converted(one, kind)
    said, new = dotted_keys(one), dotted_keys(found.profile)
    cables_m = {
        key: float(str(each.value))
        for key, each in said.items()
        if key.rpartition(".")[2] == CABLE and each.value and each.source == "file"
    }
    for key, each in new.items():
        if cables_m and key.rpartition(".")[2] == CABLE:
            assert each.value == max(cables_m.values())
            said[key] = each
    for name, key in found.of_host.items():
        assert new[name] == said[key]
        said[name] = said[key]
    assumed = {each.key: each.value for each in found.assumed}
    for key, value in said.items():
        if key in found.of_host.values():
            continue
        out = any(key == each or key.startswith(f"{each}.") for each in found.left_out)
        is_machine = key != "bus.kind" and not key.endswith("execution.grade")
        if value.source == "file" and is_machine:
            assert out or key in assumed or key in cables_m or new[key].value == value.value, key
    for key, value in assumed.items():
        assert new[key].value == value
    for key in new.keys() - said.keys():
        assert key in assumed or new[key].value in (None, ()), key


@KINDS
@SOME
@given(data=st.data())
def test_on_its_own_kind_it_is_what_capacity_gives(kind: str, data: st.DataObject, profiles_by_kind: Profiles) -> None:
    profile = data.draw(profiles_by_kind[kind])
    one, expected = on_kind(profile), decided(profile)
    assert one.profile == profile
    assert {assumed.source for assumed in one.assumed} <= {"profile"}
    assert one.left_out == ()
    assert vars(expected).items() >= vars(one.figures).items()
    if one.best is None:
        assert (one.safe.nodes, one.safe.limited_by) == (expected.safe_nodes, expected.safe_limited_by)
        assert one.safe.axes == expected.safe_axes
    else:
        assert one.safe.nodes >= (expected.safe_nodes or 0)


@KINDS
@SOME
@given(data=st.data())
def test_the_machine_stays_and_every_key_is_accounted_for(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    for other in kind_names():
        longest_m = max(getattr(one.node, "cable_length_m", 0) for one in profile.node_groups)
        if other == "ieee1394" and longest_m > 4.5:
            with pytest.raises(busplan.BusplanError, match="cable_length_m"):
                converted(profile, other)
            continue
        found = converted(profile, other)
        assert found.profile.bus.kind == other
        assert_same_machine(profile, found.profile)
        assert_accounted(profile, other)


def test_the_host_keeps_its_share_of_the_period_and_the_machine_its_cables() -> None:
    for kind in kind_names():
        assert converted(busplan.load_profile("paper-4ms"), kind).profile.cycle.slice_ratio == 0.5
    # A length that nobody has said is that of the other kind.
    for name, kind, key, cable_length_m in (
        ("paper-1ms", "ethercat", "node.cable_length_m", 4.5),
        ("ethercat-servo-8", "ieee1394", "bus.cable_length_m", 2),
        ("gantry-24", "ethercat", "group.drives.cable_length_m", 0),
    ):
        assert dotted_keys(converted(busplan.load_profile(name), kind).profile)[key].value == cable_length_m


OWN_HOSTS = {
    "paper-1ms": {
        "host.transaction_us": 7.0,
        "host.grade": "measured",
        "host.uncertainty_us": 1.0,
        "bus.sync_jitter_us": 30.0,
        "bus.sync_jitter_cycles": 5000,
    },
    "can-servo-8": {
        "bus.host_us": 7.0,
        "bus.host_grade": "measured",
        "bus.host_uncertainty_us": 1.0,
        "bus.sync_jitter_us": 30.0,
        "bus.sync_jitter_cycles": 5000,
    },
    "ethercat-servo-8": {
        "bus.master_us": 7.0,
        "bus.master_grade": "measured",
        "bus.master_uncertainty_us": 1.0,
        "bus.master_jitter_us": 30.0,
        "bus.master_jitter_cycles": 5000,
    },
    "profibus-drives-6": {
        "bus.host_us": 7.0,
        "bus.host_grade": "measured",
        "bus.host_uncertainty_us": 1.0,
        "bus.master_jitter_us": 30.0,
        "bus.master_jitter_cycles": 5000,
    },
}
"""The same host on each kind that knows one."""


@pytest.mark.parametrize("name", OWN_HOSTS)
def test_a_machine_keeps_its_own_host_on_every_kind(name: str) -> None:
    profile = busplan.load_profile(name, changes=OWN_HOSTS[name])
    by_kind = {busplan.load_profile(other).bus.kind: keys for other, keys in OWN_HOSTS.items()}
    answer = busplan.compare(profile)
    for found in answer.compared:
        said = {key: each.value for key, each in dotted_keys(found.profile).items()}
        assert said.items() >= by_kind.get(found.kind, {}).items()
        assert found.assumed_host == ()
        # A worst that was measured stays no bound.
        has_jitter = found.kind != "sercos2"
        assert ("wake_up" in (found.figures.not_shown or ())) is has_jitter
    assert not any("Not ranked" in line for line in str(answer).splitlines())


def test_an_assumed_host_stays_assumed_and_a_pipeline_begins_where_a_kind_allows(tmp_path: Path) -> None:
    profile = busplan.load_profile("ethercat-servo-8", changes={"bus.pipeline_cycles": 0})
    on_can, on_ring = (converted(profile, kind) for kind in ("can", "sercos3"))
    said = {key: each.value for key, each in dotted_keys(on_can.profile).items()}
    assert (said["bus.host_us"], said["bus.host_grade"], said["bus.pipeline_cycles"]) == (40, "assumed", 0)
    assert "bus.pipeline_cycles" in on_ring.left_out
    unranked = {one.name: one.assumed_host for one in busplan.compare(profile, buses=["can", "can-motors"]).compared}
    assert [[key.key for key in keys] for keys in unranked.values()] == [["bus.host_us"]] * 2
    # The comment of a time grades it, too.
    text = (SHIPPED_FOLDER / "profibus-drives-6.toml").read_text(encoding="utf-8")
    path = tmp_path / "drives.toml"
    path.write_text(text.replace("[bus]\n", "[bus]\nhost_us = 50 # assumed\n"))
    on_can = converted(busplan.load_profile(path), "ethercat")
    assert dotted_keys(on_can.profile)["bus.master_grade"].value == "assumed"


@pytest.mark.parametrize(
    "name", ["paper-two-node", "gantry-24", "dvrk", "can-servo-8", "ethercat-servo-8", "sercos3-servo-8"]
)
def test_the_machine_of_a_shipped_profile_stays(name: str) -> None:
    profile = busplan.load_profile(name)
    for other in kind_names():
        assert_same_machine(profile, converted(profile, other).profile)
        assert_accounted(profile, other)


@KINDS
@SOME
@given(data=st.data())
def test_the_smallest_period_fits_and_a_smaller_one_does_not(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    machine = on_kind(profile)
    found, as_set = machine.smallest, profile
    if machine.best is not None:
        profile = busplan.load_profile(profile, changes=dict(machine.best.changes))
    if found.us is None:
        assert found.need.why
        for period_us in (profile.cycle.period_us, 1e6, MAX_TIME_US):
            other = decided(changed(profile, cycle__period_us=period_us))
            assert other.verdict != FITS or not other.safe
        return
    at = decided(changed(profile, cycle__period_us=found.us))
    assert (at.verdict, at.safe) == (FITS, True)
    for smaller_us in (found.us * (1 - 1e-9), found.us * 0.999, found.us * 0.9):
        if smaller_us >= MIN_STEP_US:
            less = decided(changed(profile, cycle__period_us=smaller_us))
            assert less.verdict != FITS
    # Its own period plays no part.
    assert on_kind(changed(as_set, cycle__period_us=found.us)).smallest.us == pytest.approx(found.us, rel=1e-9)


def test_the_smallest_period_of_a_limit_is_exact() -> None:
    # By hand: 8 s + 47 + (34 + 8 s - 1) // 4 bits of a frame (Davis 2007); two nodes, 12 bytes each way in two frames.
    frames_us = 2 * 2 * (135 + 95) + 55
    one = on_kind(changed("paper-1ms", cycle__slice_ratio=1.0), "can")
    assert one.smallest.us == pytest.approx(frames_us / 0.8, rel=1e-9)
    assert busplan.CanFigures.of(one.figures).bus_load == pytest.approx(frames_us / 1000, rel=1e-9)
    # Whatever share of the period is for communication.
    half = changed(one.profile, cycle__slice_ratio=0.5, limits__max_load=0.1)
    assert on_kind(half).smallest.us == pytest.approx(frames_us / 0.1, rel=1e-9)


def test_no_period_mends_a_payload_or_an_unsafe_bus() -> None:
    for machine, why in (
        (on_kind(INPUTS, "can"), "a PDO of 40 bytes is over the 32 bytes of four frames (use a smaller payload)"),
        (on_kind(changed("paper-4ms", cycle__nonperiodic_us=MAX_TIME_US)), "at most 500000000.000 us can be given"),
        (on_kind(changed("sercos3-servo-8", cycle__nonperiodic_us=1e5)), "at most 65000.000 us can be given"),
    ):
        assert machine.smallest.us is None
        assert why in machine.smallest.need.why
    # The next period that the bus has: its drives' execution time is a guess, which would not be done within 250 us.
    assert on_kind("sercos3-servo-8").smallest.us == 500
    assert on_kind(changed("sercos3-servo-8", node__execution__grade="measured")).smallest.us == 250
    unsafe = on_kind(changed("paper-4ms", bus__gap_count=5, bus__nodes=8))
    assert (unsafe.figures.safe, unsafe.smallest.us) == (False, None)
    assert "gap count 5 is unsafe for 8 hops" in unsafe.smallest.need.why
    # Its own bus stays as it is: what mends it is on the card.
    assert unsafe.best is None
    (verdict,) = busplan.capacity(unsafe.profile).to_dict()["verdicts"]
    assert verdict["cheapest_change"]["changes"] == {"bus.gap_count": 21}


def test_a_machine_has_the_settings_of_the_bus_that_it_needs() -> None:
    can = on_kind(changed("gantry-24", cycle__slice_ratio=1.0), "can")
    tried = {one.key: one.value for one in can.assumed if one.source == "setting"}
    assert tried == {"group.drives.pdo_per": "axis", "group.tool.pdo_per": "axis"}
    # Each axis has a PDO of 8 bytes each way, of 9 from the head; inputs and outputs have one each way.
    frames_us = 55 + (2 * 20 + 4 + 2) * 135 + 4 * (135 + 65)
    assert can.smallest.us == pytest.approx(frames_us / 0.8)
    assert not [one for one in on_kind("paper-1ms", "can").assumed if one.source == "setting"]


def counted_nodes(figures: Any, group: str) -> int:
    """The nodes that are shown to fit, of a group or of all."""
    counts = [each.safe_nodes for each in figures.groups if each.name == group] if group else [figures.safe_nodes]
    return counts[0] or 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["can-servo-8", "gantry-24", "dvrk"])
def test_the_points_of_the_curves_are_what_capacity_gives(name: str) -> None:
    found = busplan.compare(name)
    for one in found.compared:
        assert found.profile.cycle.period_us in [point.period_us for point in one.curve]
        assert len(one.curve) >= 3
        for point in some(one.curve, 3):
            at = decided(changed(one.profile, cycle__period_us=point.period_us))
            if one.best is not None:
                free = {**one.best.changes, "cycle.period_us": point.period_us}
                other = decided(busplan.load_profile(one.profile, changes=free))
                at = max(at, other, key=lambda each: counted_nodes(each, found.counted))
            if not found.counted:
                assert (point.nodes, point.axes, point.limited_by) == (at.safe_nodes, at.safe_axes, at.safe_limited_by)
                continue
            # More nodes of one group, beside the axes of the others.
            (counted,) = [group for group in at.groups if group.name == found.counted]
            others = sum(group.nodes * group.axes for group in found.profile.group if group.name != found.counted)
            assert (point.nodes, point.limited_by) == (counted.safe_nodes, counted.safe_limited_by)
            assert point.axes == (others + counted.safe_axes if counted.safe_nodes else 0)


def test_a_machine_without_axes_has_none_to_count() -> None:
    drives = {"group.drives.axes": 0, "group.drives.read_bytes": 8, "group.drives.write_bytes": 8}
    tool = {"group.tool.axes": 0, "group.tool.write_bytes": 8}
    found = on_kind(busplan.load_profile("gantry-24", changes={**drives, **tool})).safe
    assert found.axes is None
    assert found.nodes > 0


def test_a_kind_that_cannot_have_the_machine_says_why() -> None:
    # Cables of 100 m are longer than those of IEEE 1394.
    long = changed("ethercat-servo-8", node__cable_length_m=100.0)
    found = busplan.compare(long, buses=["ethercat", "ieee1394"])
    first, second = found.kinds
    assert isinstance(first, MachineOnKind)
    assert isinstance(second, NotOnKind)
    assert second is found.on("ieee1394")
    assert "cable_length_m is 100" in second.why[0]


def test_kinds_are_checked_and_each_is_taken_once() -> None:
    assert len(busplan.compare("paper-1ms", buses=["can", "ieee1394", "can"]).kinds) == 2
    with pytest.raises(busplan.BusplanError, match=r"buses Can: no kind of bus; there are .*; did you mean can\?"):
        busplan.compare("paper-1ms", buses="Can")
    with pytest.raises(busplan.BusplanError, match="buses: no values; give at least one"):
        busplan.compare("paper-1ms", buses=[])


def test_the_own_kind_comes_first() -> None:
    found = busplan.compare("can-servo-8")
    # CAN FD stands beside the kinds.
    assert [one.is_own for one in found.compared] == [True] + [False] * len(kind_names())
    assert [one.title for one in found.compared][-1] == "CAN FD"
    assert {one.figures.kind for one in found.compared} == set(kind_names())


def test_the_smallest_period_is_of_the_bus_and_not_of_what_a_gate_asks() -> None:
    # A gate that asks for 6 spare nodes asks for a longer period.
    own = busplan.compare("paper-4ms", buses=BOTH)
    gated = busplan.compare(changed("paper-4ms", limits__min_spare_nodes=6), buses=BOTH)
    assert [one.smallest.us for one in gated.compared] == [one.smallest.us for one in own.compared]
