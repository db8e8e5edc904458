"""A machine on several kinds of bus: what stays of it, its smallest period, its most axes and its circle."""

from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.buses import kind_names
from busplan.errors import BusplanError
from busplan.profile.conversion import converted
from busplan.profile.keys import dotted_keys
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.circle.roundness import circle_test
from busplan.questions.compare.kinds import (
    MachineOnKind,
    NotOnKind,
    SafeAxes,
    checked_kinds,
    compare,
    most_safe_axes,
)
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import capacity, figures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.freedoms import PERIOD
from busplan.questions.plan.smallest_period import smallest_period
from busplan.sections.base import MAX_TIME_US, MIN_STEP_US
from busplan.sections.profile import CIRCLE_SECTIONS, Profile
from busplan.sections.transactions import TRANSACTION_KINDS

Profiles = Mapping[str, st.SearchStrategy[Profile]]
SOME = settings(max_examples=4)
KINDS = pytest.mark.parametrize("kind", kind_names())
BOTH = ("ieee1394", "can")
CABLES = ("cable_length_m", "cable_m")
"""Length of a cable, by the names of two kinds."""
GANTRY = load("gantry-24").profile
INPUTS = override(GANTRY, {"group.io.read_bytes": 40})
"""Without axes, no PDO of its own takes bytes from it."""


def decided(profile: Profile) -> object:
    return figures(profile, model=bus_of(profile).deciding_model)


def assert_same_machine(one: Profile, other: Profile) -> None:
    """The nodes in their order, what travels, how they execute, and all that a circle rests on."""
    assert [each.name for each in other.alike_nodes] == [each.name for each in one.alike_nodes]
    for mine, its in zip(network_of(one).alike, network_of(other).alike, strict=True):
        for kind in TRANSACTION_KINDS:
            size = int(mine.bytes_of(kind))
            assert its.bytes_of(kind) == size
            assert its.node.execution.execution_us(size) == mine.node.execution.execution_us(size)
    for mine, its in zip(one.alike_nodes, other.alike_nodes, strict=True):
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
        if key.rpartition(".")[2] in CABLES and each.value and each.source == "file"
    }
    for key, each in new.items():
        if cables_m and key.rpartition(".")[2] in CABLES:
            assert each.value == max(cables_m.values())
            said[key] = each
    assumed = {each.key: each.value for each in found.assumed}
    for key, value in said.items():
        out = any(key == each or key.startswith(f"{each}.") for each in found.left_out)
        is_machine = key not in {"bus.kind", "bus.timing_model"} and not key.endswith("execution.grade")
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
    (one,) = compare(profile, kinds=[kind]).kinds
    assert isinstance(one, MachineOnKind)
    assert one.profile is profile
    assert (one.assumed, one.left_out) == ((), ())
    (expected,) = capacity(profile, timing_models=[bus_of(profile).deciding_model]).results
    assert one.figures == expected
    assert (one.safe.nodes, one.safe.limited_by) == (expected.safe_nodes, expected.safe_limited_by)
    assert one.safe.axes == expected.safe_axes


@KINDS
@SOME
@given(data=st.data())
def test_the_machine_stays_and_every_key_is_accounted_for(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    for other in kind_names():
        longest_m = max(getattr(one.node, "cable_m", 0) for one in profile.alike_nodes)
        if other == "ieee1394" and longest_m > 4.5:
            with pytest.raises(BusplanError, match="cable_length_m"):
                converted(profile, other)
            continue
        found = converted(profile, other)
        assert found.profile.bus.kind == other
        assert_same_machine(profile, found.profile)
        assert_accounted(profile, other)


def test_the_host_keeps_its_share_of_the_period_and_the_machine_its_cables() -> None:
    for kind in kind_names():
        assert converted(load("paper-4ms").profile, kind).profile.cycle.slice_ratio == 0.5
    # A length that nobody has said is that of the other kind.
    for name, kind, key, cable_m in (
        ("paper-1ms", "ethercat", "node.cable_m", 4.5),
        ("ethercat-servo-8", "ieee1394", "bus.cable_length_m", 2),
        ("gantry-24", "ethercat", "group.drives.cable_m", 0),
    ):
        assert dotted_keys(converted(load(name).profile, kind).profile)[key].value == cable_m


@pytest.mark.parametrize(
    "name", ["paper-two-node", "gantry-24", "dvrk", "can-servo-8", "ethercat-servo-8", "sercos3-servo-8"]
)
def test_the_machine_of_a_shipped_profile_stays(name: str) -> None:
    profile = load(name).profile
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
    found = smallest_period(profile)
    bus = bus_of(profile)
    if found.us is None:
        assert found.why
        for period_us in (profile.cycle.period_us, 1e6, MAX_TIME_US):
            other = figures(override(profile, {PERIOD: period_us}), model=bus.deciding_model)
            assert other.verdict != FITS or not other.safe
        return
    at = figures(override(profile, {PERIOD: found.us}), model=bus.deciding_model)
    assert (at.verdict, at.safe) == (FITS, True)
    for smaller_us in (found.us * (1 - 1e-9), found.us * 0.999, found.us * 0.9):
        if smaller_us >= MIN_STEP_US:
            less = figures(override(profile, {PERIOD: smaller_us}), model=bus.deciding_model)
            assert less.verdict != FITS
    # Its own period plays no part.
    assert smallest_period(override(profile, {PERIOD: found.us})).us == pytest.approx(found.us, rel=1e-9)


def test_the_smallest_period_of_a_limit_is_exact() -> None:
    # By hand: 8 s + 47 + (34 + 8 s - 1) // 4 bits of a frame (Davis 2007); two nodes, 12 bytes each way in two frames.
    frames_us = 2 * 2 * (135 + 95) + 55
    machine = override(load("paper-1ms").profile, {"cycle.slice_ratio": 1.0})
    (one,) = compare(machine, kinds=["can"]).compared
    assert one.smallest.us == pytest.approx(frames_us / 0.8, rel=1e-9)
    assert one.figures.bus_load == pytest.approx(frames_us / 1000, rel=1e-9)
    # Whatever share of the period is for communication.
    half = override(one.profile, {"cycle.slice_ratio": 0.5, "limits.max_load": 0.1})
    assert smallest_period(half).us == pytest.approx(frames_us / 0.1, rel=1e-9)


def test_no_period_mends_a_payload_or_an_unsafe_bus() -> None:
    (can,) = compare(INPUTS, kinds=["can"]).compared
    assert can.smallest == (None, "a PDO of 40 bytes is over the 32 bytes of four frames (a smaller payload would do)")
    unsafe = smallest_period(override(load("paper-4ms").profile, {"bus.gap_count": 5, "bus.nodes": 8}))
    assert unsafe.us is None
    assert "gap count" in unsafe.why
    endless = smallest_period(override(load("paper-4ms").profile, {"cycle.nonperiodic_us": MAX_TIME_US}))
    assert endless == (None, "it would be over 1000 s")
    known = override(load("sercos3-servo-8").profile, {"cycle.nonperiodic_us": 1e5})
    assert smallest_period(known) == (None, "it would be over 65 ms")
    assert smallest_period(load("sercos3-servo-8").profile).us == 250


def test_a_machine_has_the_settings_of_the_bus_that_it_needs() -> None:
    (can,) = compare(override(GANTRY, {"cycle.slice_ratio": 1.0}), kinds=["can"]).compared
    tried = {one.key: one.value for one in can.assumed if one.source == "setting"}
    assert tried == {"group.drives.pdo_per": "axis", "group.tool.pdo_per": "axis"}
    # Each axis has a PDO of 8 bytes each way, of 9 from the head; inputs and outputs have one each way.
    frames_us = 55 + (2 * 20 + 4 + 2) * 135 + 4 * (135 + 65)
    assert can.smallest.us == pytest.approx(frames_us / 0.8)
    (paper,) = compare(load("paper-1ms").profile, kinds=["can"]).compared
    assert not [one for one in paper.assumed if one.source == "setting"]


@pytest.mark.parametrize("name", ["can-servo-8", "gantry-24", "dvrk"])
def test_the_points_of_the_curves_are_what_capacity_gives(name: str) -> None:
    profile = load(name).profile
    found = compare(profile)
    for one in found.compared:
        assert profile.cycle.period_us in [point.period_us for point in one.curve]
        assert len(one.curve) >= 3
        for point in one.curve:
            at = decided(override(one.profile, {PERIOD: point.period_us}))
            assert_counts(point, at, found.counted, profile)


def assert_counts(point: SafeAxes, at: object, group: str, profile: Profile) -> None:
    """The count of a point is that of all nodes, or of the group that is counted beside the axes of the others."""
    if not group:
        assert (point.nodes, point.axes, point.limited_by) == (at.safe_nodes, at.safe_axes, at.safe_limited_by)  # type: ignore[attr-defined]
        return
    (counted,) = [one for one in at.groups if one.name == group]  # type: ignore[attr-defined]
    others = sum(one.nodes * one.axes for one in profile.group if one.name != group)
    assert (point.nodes, point.limited_by) == (counted.safe_nodes, counted.safe_limited_by)
    assert point.axes == (others + counted.safe_axes if counted.safe_nodes else 0)


def test_a_machine_without_axes_has_none_to_count() -> None:
    inputs = override(GANTRY, {"group.drives.axes": 0, "group.drives.read_bytes": 8, "group.drives.write_bytes": 8})
    inputs = override(inputs, {"group.tool.axes": 0, "group.tool.write_bytes": 8})
    found = most_safe_axes(inputs)
    assert found.axes is None
    assert found.nodes > 0


def test_a_circle_is_that_of_the_smallest_period_and_its_step() -> None:
    profile = load("paper-1ms").profile
    found = compare(profile, kinds=BOTH, with_circle=True)
    for one in found.compared:
        assert one.circle is not None
        assert one.circle.figures is not None
        alone = override(one.profile, {PERIOD: one.smallest.us, "servo.step_us": one.circle.step_us})
        assert one.circle.figures == circle_test(alone, explain=False).results[0]
        assert one.circle.step_us <= profile.servo.step_us
    assert {one.figures.kind: one.circle.figures.passed for one in found.compared} == {"ieee1394": True, "can": True}  # type: ignore[union-attr]


def test_a_circle_that_cannot_be_run_says_why() -> None:
    fast = override(load("paper-1ms").profile, {"circle.feed_mm_per_min": 60_000.0, "circle.radius_mm": 1.0})
    (one,) = compare(fast, kinds=["can"], with_circle=True).compared
    assert one.circle is not None
    assert one.circle.figures is None
    assert one.circle.problems
    (none,) = compare(INPUTS, kinds=["can"], with_circle=True).compared
    assert none.circle is None


def test_a_kind_that_cannot_have_the_machine_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    can = bus_of(load("can-servo-8").profile)
    monkeypatch.setattr(type(can), "starter", can.starter._replace(bus='[bus]\nkind = "can"'))
    first, second = compare(GANTRY, kinds=BOTH).kinds
    assert isinstance(first, MachineOnKind)
    assert isinstance(second, NotOnKind)
    assert (second.kind, len(second.why)) == ("can", 1)
    assert second.why[0].startswith("bus.bit_rate_kbit_s: missing key. Bit rate of the bus")


def test_kinds_are_checked_and_each_is_taken_once() -> None:
    assert checked_kinds(["can", "ieee1394", "can"], option="--buses") == ("can", "ieee1394")
    with pytest.raises(BusplanError, match=r"--buses Can: no kind of bus; there are .*; did you mean can\?"):
        checked_kinds(["Can"], option="--buses")
    with pytest.raises(BusplanError, match="no kind of bus"):
        checked_kinds([], option="buses")


def test_the_own_kind_comes_first() -> None:
    found = compare(load("can-servo-8").profile)
    assert next(iter(found.compared)).is_own
    assert {one.figures.kind for one in found.compared} == set(kind_names())
