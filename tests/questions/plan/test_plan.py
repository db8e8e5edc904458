"""`busplan.plan`: one thing is changed at a time, the cheapest first, until the goal holds; what it writes passes."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from tests.registers import at_least, shipped_of_each_kind

Make = Callable[..., busplan.Profile]
ALL = ("gap_count", "slice_ratio", "responses", "payload", "period", "nodes")


def changed(profile: busplan.Profile, changes: dict[str, Any]) -> busplan.Profile:
    return busplan.load_profile(profile, changes=changes)


def errors_of(profile: busplan.Profile) -> list[str]:
    """The errors of the gate on what would be written, the circle left out."""
    (file,) = busplan.check(profile, circle=False).files
    return [finding.message for finding in file.findings if finding.severity == "error"]


def changes_of(profile: busplan.Profile, free: Sequence[str] | None = None, **asked: Any) -> dict[str, Any] | None:
    option = busplan.plan(profile, free=free, **asked).recommended
    return None if option is None else option.changes


limits: st.SearchStrategy[dict[str, object]] = st.fixed_dictionaries(
    {},
    optional={
        "limits.reserve": st.sampled_from([0.1, 0.2, 0.5]),
        "limits.max_utilisation": st.sampled_from([0.05, 0.3, 0.6, 0.8, 1.0]),
        "limits.min_spare_nodes": st.integers(0, 6),
        "limits.min_spare_axes": st.integers(0, 12),
    },
)


@settings(max_examples=at_least(5, 40))
@given(data=st.data())
def test_what_a_plan_writes_passes_the_gate(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = changed(data.draw(any_profile), data.draw(limits))
    free = data.draw(st.none() | st.lists(st.sampled_from(ALL), min_size=1, unique=True))
    answer, errors = busplan.plan(profile, free=free), errors_of(profile)
    best = answer.recommended
    assert (best is None) == (answer.binding is not None)
    if best is None:
        assert errors
        assert answer.binding is not None
        assert answer.binding.why
    else:
        assert errors_of(best.profile) == []
        assert (errors == []) == (best.changes == {})
    for relaxation in answer.relaxations:
        assert errors_of(changed(profile, dict(relaxation.changes))) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["can", "ethercat", "sercos2", "sercos3"])
@settings(max_examples=at_least(7))
@given(data=st.data())
def test_other_kinds_of_bus_have_plans_too(
    kind: str, data: st.DataObject, profiles_by_kind: dict[str, st.SearchStrategy[busplan.Profile]]
) -> None:
    best = busplan.plan(data.draw(profiles_by_kind[kind])).recommended
    assert best is None or errors_of(best.profile) == []


@pytest.mark.parametrize("name", shipped_of_each_kind())
def test_shipped_profiles_have_a_plan(name: str) -> None:
    assert busplan.plan(name).recommended is not None


# --- by trying other changes -------------------------------------------------------------------------------------


def single_changes(profile: busplan.Profile, name: str) -> Iterator[dict[str, Any]]:
    """Every value of a single thing, the least change first."""
    write = profile.node_groups[0].payload.write_bytes or 0
    read = profile.node_groups[0].payload.read_bytes or 0
    match name:
        case "slice_ratio":
            own = profile.cycle.slice_ratio
            yield from ({"cycle.slice_ratio": n / 100} for n in range(1, 91) if n / 100 > own)
        case "period":
            own = profile.cycle.period_us
            yield from ({"cycle.period_us": float(us)} for us in range(int(own) + 1, 1000) if us > own)
            yield from ({"cycle.period_us": float(us)} for us in range(1000, 10_000, 10) if us > own)
            yield from ({"cycle.period_us": float(us)} for us in range(10_000, 100_000, 100) if us > own)
        case "payload":
            for size in range(max(read, write) // 4 * 4, 0, -4):
                cut = {f"payload.{kind}_bytes": size for kind, own in (("read", read), ("write", write)) if own > size}
                if cut:
                    yield cut
        case "nodes":
            yield from ({"bus.nodes": nodes} for nodes in range(profile.node_groups[0].nodes - 1, 0, -1))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slice_ratio", "period", "payload", "nodes"])
@given(data=st.data())
def test_the_least_change_that_is_enough_is_taken(name: str, data: st.DataObject, make: Make) -> None:
    profile = changed(
        make(
            cycle__period_us=data.draw(st.sampled_from([90.0, 200.0, 450.0, 700.0])),
            cycle__slice_ratio=data.draw(st.sampled_from([0.3, 0.5, 0.8])),
        ),
        {
            "bus.nodes": data.draw(st.integers(1, 5)),
            "bus.gap_count": "optimal",
            "payload.write_bytes": data.draw(st.sampled_from([4, 120, 600, 1500])),
            "limits.reserve": data.draw(st.sampled_from([0.0, 0.2])),
        },
    )
    if not errors_of(profile):
        assert changes_of(profile, [name]) == {}
        return
    changes, planned = list(single_changes(profile, name)), changes_of(profile, [name])
    assert planned is None or (planned in changes and not errors_of(changed(profile, planned)))
    # Of the smaller changes the next one and some others are tried: none is enough.
    smaller = changes if planned is None else changes[: changes.index(planned)]
    for change in (*smaller[:: len(smaller) // 3 + 1], *smaller[-1:]):
        assert errors_of(changed(profile, change))


ETHERCAT: dict[str, Any] = {"payload.read_bytes": 400, "payload.write_bytes": 700, "cycle.period_us": 700}


@pytest.mark.parametrize(
    ("name", "changes", "free", "planned", "less"),
    [
        # A slice of 237.4 us: in 400 us a share of 0.594, and a period of 474.8 us at the profile's half.
        ("", {"cycle.period_us": 400.0}, "slice_ratio", {"cycle.slice_ratio": 0.6}, {"cycle.slice_ratio": 0.59}),
        # Of two that ask for more the larger counts: 192.04 us are to be 70 % of the slice at most.
        (
            "",
            {"cycle.period_us": 400.0, "limits.max_utilisation": 0.7},
            "slice_ratio",
            {"cycle.slice_ratio": 0.69},
            {"cycle.slice_ratio": 0.68},
        ),
        ("", {"cycle.period_us": 400.0}, "period", {"cycle.period_us": 475.0}, {"cycle.period_us": 474.0}),
        ("", {"cycle.period_us": 2000.0, "bus.nodes": 9}, "nodes", {"bus.nodes": 7}, {"bus.nodes": 8}),
        # One node less, and the last one: a cycle of two takes 237.4 us.
        ("", {"cycle.period_us": 2000.0, "bus.nodes": 8}, "nodes", {"bus.nodes": 7}, {"bus.nodes": 8}),
        ("", {"cycle.period_us": 400.0, "bus.nodes": 3}, "nodes", {"bus.nodes": 1}, {"bus.nodes": 2}),
        # Quadlets of the larger payload alone, and of both; single bytes.
        (
            "",
            {"cycle.period_us": 800.0, "payload.write_bytes": 600},
            "payload",
            {"payload.write_bytes": 180},
            {"payload.write_bytes": 184},
        ),
        (
            "",
            {"cycle.period_us": 800.0, "payload.write_bytes": 700, "payload.read_bytes": 500},
            "payload",
            {"payload.read_bytes": 96, "payload.write_bytes": 96},
            {"payload.read_bytes": 100, "payload.write_bytes": 100},
        ),
        (
            "ethercat-servo-8",
            {**ETHERCAT, "bus.sync_shift": 0.7},
            "payload",
            {"payload.read_bytes": 123, "payload.write_bytes": 123},
            {"payload.read_bytes": 124, "payload.write_bytes": 124},
        ),
        (
            "dynamixel-arm-14",
            {"payload.read_bytes": 60, "payload.write_bytes": 40},
            "payload",
            {"payload.read_bytes": 11, "payload.write_bytes": 11},
            {"payload.read_bytes": 12, "payload.write_bytes": 12},
        ),
        # The setting is safe for four nodes more, as many as [limits] asks for: ten hops, not six.
        (
            "",
            {"cycle.period_us": 3200.0, "bus.nodes": 6, "bus.gap_count": 63, "limits.min_spare_nodes": 4},
            "gap_count",
            {"bus.gap_count": 26},
            {"bus.gap_count": 25},
        ),
    ],
)
def test_each_thing_is_changed_by_as_little_as_is_enough(
    name: str,
    changes: dict[str, Any],
    free: str,
    planned: dict[str, Any],
    less: dict[str, Any],
    make: Make,
) -> None:
    profile = changed(busplan.load_profile(name) if name else make(bus__gap_count="optimal"), changes)
    assert errors_of(profile)
    assert changes_of(profile, [free]) == planned
    assert errors_of(changed(profile, planned)) == []
    assert errors_of(changed(profile, less))


def test_a_payload_is_cut_by_axes_where_it_is_given_so() -> None:
    """Down to a byte of each axis, and the period does the rest."""
    read, write = "group.{}.read_bytes_per_axis", "group.{}.write_bytes_per_axis"
    # What was given a value stays, whatever it costs.
    asked = {"group.drives.nodes": 9, write.format("drives"): 7}
    found = busplan.plan("gantry-24", changes=asked, free=["payload", "period"]).recommended_changes
    assert found is not None
    assert {key: found[key] for key in found if key != "cycle.period_us"} == {
        **asked,
        read.format("drives"): 1,
        # 4 bytes of the probe are read beside those of four axes: 8 bytes are left of each payload.
        read.format("tool"): 1,
        write.format("tool"): 2,
    }


def test_two_things_are_changed_where_no_single_one_is_enough(make: Make) -> None:
    # The slice must give 370.1 us at gap count 63 and 237.4 us at 7; of 300 us, 0.9 is 270 us.
    profile = make(cycle__period_us=300.0)
    for name in ("gap_count", "slice_ratio"):
        assert changes_of(profile, [name]) is None
    found = changes_of(profile, ["gap_count", "slice_ratio"])
    assert found == {"cycle.slice_ratio": 0.8, "bus.gap_count": 7}
    assert errors_of(changed(profile, found)) == []


def test_what_is_not_needed_beside_the_last_change_stays_as_it_was() -> None:
    # A larger slice was tried first and is not enough; the next period of SERCOS II is enough without it.
    slow = {"bus.data_rate_mbit_s": 2, "cycle.period_us": 1000.0, "cycle.slice_ratio": 0.8}
    profile = busplan.load_profile("sercos2-servo-8", changes=slow)
    assert busplan.plan(profile).options[1].changes == {"cycle.slice_ratio": 0.9}
    assert changes_of(profile) == {"cycle.period_us": 2000.0}


# --- steps, what is kept, and what stands in the way --------------------------------------------------------------


def test_every_step_changes_one_thing_more_until_one_is_enough() -> None:
    answer = busplan.plan("paper-1ms", nodes=8)
    assert [(one.title, one.recommended, one.held_by) for one in answer.options] == [
        ("as it is", False, "time"),
        ("gap count", False, "time"),
        ("+ slice ratio", False, "time"),
        ("+ responses", True, None),
    ]
    # A step that is not enough goes as far as it can.
    assert answer.options[2].changes == {"cycle.slice_ratio": 0.9, "bus.gap_count": 21}
    assert answer.period_is_kept is True
    slower = busplan.plan("paper-1ms", nodes=8, free=["gap_count", "slice_ratio", "period"])
    assert [one.title for one in slower.options] == ["as it is", "gap count", "+ slice ratio", "+ period"]
    assert slower.options[2].changes == answer.options[2].changes
    assert slower.period_is_kept is False


def test_where_too_few_nodes_are_still_too_many_a_single_one_comes_nearest(make: Make) -> None:
    answer = busplan.plan(make(bus__gap_count="optimal", bus__nodes=5, cycle__period_us=100.0), free=["nodes"])
    assert [(one.changes, one.held_by) for one in answer.options] == [({}, "time"), ({"bus.nodes": 1}, "time")]


def test_nothing_to_change(make: Make) -> None:
    answer = busplan.plan(make())
    assert [(one.title, one.changes, one.recommended) for one in answer.options] == [("as it is", {}, True)]
    assert (answer.wanted, answer.binding, answer.relaxations) == ({}, None, ())
    assert [freedom.name for freedom in answer.free] == ["gap_count", "slice_ratio", "responses", "schedule", "period"]


def test_what_was_asked_for_is_kept_and_part_of_the_changes(make: Make) -> None:
    wanted = {"bus.nodes": 5, "bus.gap_count": 63, "cycle.period_us": 1000.0}
    answer = busplan.plan(make(), changes=wanted)
    assert answer.wanted == {"bus.nodes": 5, "cycle.period_us": 1000.0}
    assert [freedom.name for freedom in answer.free] == ["slice_ratio", "responses", "schedule"]
    assert answer.recommended is not None
    assert answer.recommended_changes == {
        "bus.nodes": 5,
        "cycle.period_us": 1000.0,
        "node.read_response": "concatenated",
        "cycle.slice_ratio": answer.recommended.changes["cycle.slice_ratio"],
    }
    with pytest.raises(busplan.BusplanError, match=r"free period: cycle\.period_us was given a value"):
        busplan.plan(make(), period_us=1000.0, free=["period"])


def test_an_unsafe_gap_count_is_never_recommended(make: Make) -> None:
    assert busplan.plan(make(), changes={"bus.gap_count": 3}).recommended is None
    assert busplan.plan(make(bus__gap_count=3)).recommended is not None
    # Nobody knows a safe one for cables that the table does not hold for.
    assert busplan.plan(make(bus__gap_count=3, bus__cable_length_m=10.0)).recommended is None


def test_a_bus_with_some_periods_takes_the_nearest_that_holds() -> None:
    assert changes_of(busplan.load_profile("sercos3-servo-8"), period_us=None) == {}
    odd = busplan.load_profile("sercos3-servo-8", changes={"cycle.period_us": 300, "node.execution.grade": "measured"})
    assert changes_of(odd) == {"cycle.period_us": 250.0}
    full = busplan.load_profile("sercos3-servo-8", changes={"bus.nodes": 100})
    assert changes_of(full) == {"cycle.period_us": 750.0}


def test_what_stands_in_the_way_is_said_with_what_would_be_enough() -> None:
    answer = busplan.plan("ethercat-servo-8", period_us=125)
    assert answer.binding is not None
    assert answer.binding.why == "node needs a period of 480.940 us, and 125.000 us is the longest"
    assert [(one.relaxed, one.changes) for one in answer.relaxations] == [
        ("period", {"cycle.period_us": 481.0, "bus.sync_shift": 0.7})
    ]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"nodes": 0}, "bus.nodes 0"),
        ({"nodes": 4, "axes": 16}, "nodes 4 and axes 16: give one of them"),
        ({"free": ["steps"]}, "free steps: there is nothing of that name to free on a bus of kind ieee1394"),
        ({"free": []}, "free: no values"),
    ],
)
def test_goals_that_no_profile_can_have_are_refused(asked: dict[str, Any], words: str) -> None:
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.plan("paper-1ms", **asked)
    assert words in str(refused.value)


# --- the change that `capacity` and `check` advise -----------------------------------------------------------------


@settings(max_examples=at_least(6, 40))
@given(data=st.data())
def test_capacity_and_check_advise_what_plan_finds(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = changed(data.draw(any_profile), data.draw(limits))
    verdict, planned = busplan.capacity(profile).verdicts[0], changes_of(profile)
    if not verdict.all_well:
        assert (None if verdict.change is None else verdict.change.changes) == planned
        assert (verdict.change is None) == bool(verdict.no_change)
    elif any((count.safe_nodes or 0) > count.nodes for count in verdict.deciding.counts):
        assert (verdict.change, verdict.no_change) == (None, "")
    elif verdict.change is not None:
        more = changed(profile, {"bus.nodes": verdict.change.nodes, **dict(verdict.change.changes)})
        assert verdict.change.nodes == profile.node_groups[0].nodes + 1
        assert errors_of(changed(more, {"limits.min_spare_nodes": 0, "limits.min_spare_axes": 0})) == []


def test_every_pair_of_freedoms_gives_what_each_gives_alone(make: Make) -> None:
    profile = make(cycle__period_us=280.0)
    for first, second in product(("gap_count", "slice_ratio"), ("payload", "period")):
        alone = changes_of(profile, [first])
        if alone is not None:
            assert changes_of(profile, [first, second]) == alone


def test_a_row_that_changes_nothing_is_a_word_below_the_table() -> None:
    lines = str(busplan.plan("can-servo-8", nodes=30)).splitlines()
    rows = [line for line in lines if " deadline " in line]
    assert [row.split()[:3] for row in rows] == [["as", "it", "is"]]
    assert "-4890 +/- 350" in rows[0]
    assert "No help: slice ratio, bit rate, length of identifiers, period." in lines


def test_what_was_asked_for_is_named_where_nothing_else_changes() -> None:
    said = str(busplan.plan("paper-4ms", nodes=3)).splitlines()[0]
    assert "(12 axes) at 4 ms: bus.nodes = 3 is all that changes; it fits with a corrected margin of " in said


@pytest.mark.parametrize(
    ("axes", "wanted"), [(8, {}), (9, {"bus.nodes": 3}), (12, {"bus.nodes": 3}), (3, {"bus.nodes": 1})]
)
def test_axes_are_on_as_many_nodes_as_it_takes(axes: int, wanted: dict[str, int]) -> None:
    # Four on each; there are two nodes.
    assert busplan.plan("paper-4ms", axes=axes).wanted == wanted


def test_a_change_of_a_group_has_the_meaning_of_the_key() -> None:
    said = str(busplan.plan("gantry-24", period_us=800.0)).splitlines()[0]
    assert 'group.drives.read_response = "concatenated" (if the nodes can)' in said
