"""The plan is the least change there is, found by trying all; and what is written passes the gate."""

from collections.abc import Callable, Iterator, Sequence
from itertools import count, cycle, product
from math import inf
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from busplan.buses.ieee1394.constants import safe_gap_count
from busplan.buses.ieee1394.transactions import gap_count_of, hops_of
from busplan.buses.parts import Cost
from busplan.elementwise import FIT_ROUNDING
from busplan.errors import BusplanError
from busplan.gate.gate import check_document
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import decode, override
from busplan.profile.write import profile_text
from busplan.questions.circle.check import CircleCheck
from busplan.questions.fit.certainty import FITS, available_us, certainty, cycle_of
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.advice import cure
from busplan.questions.plan.constraints import needs, with_payload_within
from busplan.questions.plan.freedoms import PERIOD, Freedom, ShortNumbers, freed
from busplan.questions.plan.planning import plan
from busplan.questions.plan.search import Search
from busplan.sections.profile import Profile

Make = Callable[..., Profile]
ALL = ("gap_count", "slice_ratio", "responses", "payload", "period", "nodes")


def least(profile: Profile, free: Sequence[str] | None = None) -> dict[str, Any] | None:
    """The least change, without what `plan` says besides."""
    found = Search(profile).least(freed(profile, free))
    return None if found is None else dict(found)


def errors_of(profile: Profile, *, with_circle: bool = False) -> list[str]:
    """The errors of the gate on what would be written."""
    text = profile_text(profile).encode()
    found = check_document(decode(text, name="new.toml"), with_circle=with_circle, record=False).findings
    return [one.message for one in found if one.severity == "error"]


limits: st.SearchStrategy[dict[str, object]] = st.fixed_dictionaries(
    {},
    optional={
        "limits.reserve": st.sampled_from([0.1, 0.2, 0.5]),
        "limits.max_utilisation": st.sampled_from([0.05, 0.3, 0.6, 0.8, 1.0]),
        "limits.min_spare_nodes": st.integers(0, 6),
        "limits.min_spare_axes": st.integers(0, 12),
    },
)


@given(data=st.data())
def test_what_a_plan_writes_passes_the_gate(data: st.DataObject, any_profile: st.SearchStrategy[Profile]) -> None:
    profile = override(data.draw(any_profile), data.draw(limits))
    free = data.draw(st.none() | st.lists(st.sampled_from(ALL), min_size=1, unique=True))
    if free is not None and "payload" in free:  # every size is tried, which takes a while of large ones
        profile = override(profile, {"payload.read_bytes": 12, "payload.write_bytes": data.draw(st.integers(1, 40))})
    found, errors = least(profile, free), errors_of(profile)
    if found is None:
        assert errors
    else:
        assert errors_of(override(profile, found)) == []
        assert (errors == []) == (found == {})


@settings(max_examples=8)
@given(data=st.data())
def test_a_plan_is_that_change_and_what_would_be_enough_is_enough(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    sizes = {"payload.read_bytes": 12, "payload.write_bytes": data.draw(st.integers(1, 40))}
    profile = override(data.draw(any_profile), {**data.draw(limits), **sizes})
    free = data.draw(st.sampled_from([None, ["gap_count", "slice_ratio"], ["slice_ratio"]]))
    found, changes = plan(profile, free=free), least(profile, free)
    assert (None if found.recommended is None else found.recommended.changes) == changes
    assert (found.binding is None) == (changes is not None)
    assert found.binding is None or found.binding.why
    for one in found.relaxations:
        weaker = {} if one.value is None else {one.relaxed: one.value}
        assert errors_of(override(found.goal, {**weaker, **one.changes})) == []
    # One file has one answer.
    if free is None:
        assert cure(profile).changes == changes
    for option in found.options:
        assert option.deciding == figures(option.profile, model="standard")
        assert option.passes == holds(option.profile)


# --- by brute force ---------------------------------------------------------------------------------------


def holds(profile: Profile) -> bool:
    """Whether a profile holds every constraint, by the figures of `capacity` alone."""
    if not certainty(cycle_of(profile, model="standard")).safe_required_us <= available_us(network_of(profile)):
        return False  # soon told of most
    one, asked = figures(profile, model="standard"), profile.limits
    return (
        one.verdict == FITS
        and one.safe
        and (asked.max_utilisation is None or one.utilisation <= asked.max_utilisation * (1 + FIT_ROUNDING))
        and (one.safe_nodes or 0) - one.nodes >= (asked.min_spare_nodes or 0)
        and (one.safe_axes or 0) - one.axes >= (asked.min_spare_axes or 0)
    )


def every_point(profile: Profile, *, periods_us: Sequence[float], names: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Every point of a small grid, by the definition: the dearest setting changes least, then the next dearest."""
    own, spare = int(network_of(profile).nodes), profile.limits.min_spare_nodes or 0
    ratios = [n / 100 for n in range(1, 91) if n / 100 > profile.cycle.slice_ratio]
    read, write = profile.alike_nodes[0].payload.read_bytes or 0, profile.alike_nodes[0].payload.write_bytes or 0
    caps = [size for size in range(2048, 0, -4) if size < max(read, write)]
    answers: list[dict[str, Any]] = [
        {"node.read_response": "concatenated"},
        {"node.write_response": "unified"},
        {"node.read_response": "concatenated", "node.write_response": "unified"},
    ]
    values: dict[str, list[dict[str, Any]]] = {
        "nodes": [{"bus.nodes": nodes} for nodes in range(own - 1, 0, -1)],
        "period": [{"cycle.period_us": period_us} for period_us in periods_us],
        "payload": [
            {
                **({"payload.read_bytes": size} if size < read else {}),
                **({"payload.write_bytes": size} if size < write else {}),
            }
            for size in caps
        ],
        "responses": answers,
        "slice_ratio": [{"cycle.slice_ratio": ratio} for ratio in ratios],
    }
    for chosen in product(*([{}, *values[name]] for name in values if name in names)):
        point = {key: value for part in chosen for key, value in part.items()}
        yield point
        if "gap_count" in names:
            most = int(point.get("bus.nodes", own)) + spare
            hops = int(hops_of(network_of(profile).with_nodes(most)))
            yield {**point, "bus.gap_count": safe_gap_count(hops)}


@settings(max_examples=10)
@given(data=st.data())
def test_no_cheaper_point_of_a_grid_passes(data: st.DataObject, make: Make) -> None:
    own_us = data.draw(st.sampled_from([90.0, 200.0, 450.0, 1000.0]))
    ratio = data.draw(st.sampled_from([0.5, 0.8, 0.85, 0.95]))
    names = data.draw(
        st.sampled_from(
            [
                ("gap_count", "slice_ratio"),
                ("gap_count", "slice_ratio", "responses"),
                ("gap_count", "slice_ratio", "period"),
                ("gap_count", "responses", "payload"),
                ("gap_count", "payload", "period"),
                ("slice_ratio", "nodes"),
                ("gap_count", "period", "nodes"),
            ]
        )
    )
    profile = override(
        make(cycle__period_us=own_us, cycle__slice_ratio=ratio),
        {
            "bus.nodes": data.draw(st.integers(1, 5)),
            "bus.gap_count": data.draw(st.sampled_from([3, 7, 20, 63, "optimal"])),
            "payload.write_bytes": data.draw(st.sampled_from([4, 10, 24])),
            "limits.reserve": data.draw(st.sampled_from([0.0, 0.2])),
            "limits.min_spare_nodes": data.draw(st.sampled_from([0, 1])),
            "limits.max_utilisation": data.draw(st.sampled_from([None, 0.6])),
        },
    )
    grid, found = ShortNumbers(1.0, 3), least(profile, names)
    longest_us = (found or {}).get("cycle.period_us", own_us)
    # Up to the one that was found, and beyond: it is the first that passes.
    last = grid.place(longest_us) + 2
    periods_us = [us for us in map(grid.number, range(max(1, last - 20), last)) if us > own_us]
    points = every_point(profile, periods_us=periods_us, names=names)
    assert found == next((point for point in points if holds(override(profile, point))), None)


# --- what no single change does -------------------------------------------------------------------------------


def test_two_keys_are_changed_where_no_single_one_is_enough(make: Make) -> None:
    # The slice must give 287.5 us at gap count 63 and 223.4 us at 7; of 300 us, 0.9 is 270 us.
    profile = make(cycle__period_us=300.0)
    for name in ("gap_count", "slice_ratio"):
        assert least(profile, [name]) is None
    found = least(profile, ["gap_count", "slice_ratio"])
    assert found == {"cycle.slice_ratio": 0.75, "bus.gap_count": 7}
    assert errors_of(override(profile, found)) == []


def test_three_keys_are_changed_where_no_two_are_enough(make: Make) -> None:
    profile = make(cycle__period_us=250.0, bus__nodes=3, payload={"read_bytes": 120, "write_bytes": 120})
    names = ("slice_ratio", "responses", "payload")
    for one in names:
        assert least(profile, [name for name in names if name != one]) is None
    found = least(profile, names)
    assert found is not None
    assert errors_of(override(profile, found)) == []
    assert {key.partition(".")[0] for key in found} == {"cycle", "node", "payload"}


def test_a_gap_count_is_that_of_the_nodes_after_a_change(make: Make) -> None:
    profile = make(bus__nodes=10, bus__gap_count=63, cycle__period_us=700.0)
    found = least(profile, ["gap_count", "slice_ratio", "nodes"])
    assert found is not None
    assert found["bus.gap_count"] == safe_gap_count(found["bus.nodes"]) < safe_gap_count(10)
    # One node more does not pass, whatever the others are.
    assert least(override(profile, {"bus.nodes": found["bus.nodes"] + 1}), ["gap_count", "slice_ratio"]) is None


def test_room_for_more_nodes_has_a_gap_count_that_is_safe_for_them(make: Make) -> None:
    profile = make(bus__gap_count=7, cycle__period_us=2000.0, limits={"min_spare_nodes": 4})
    found = least(profile)
    assert found == {"bus.gap_count": safe_gap_count(6)}
    assert (figures(override(profile, found), model="standard").safe_nodes or 0) >= 6


# --- the period is a requirement ----------------------------------------------------------------------------


def test_the_period_changes_only_where_nothing_cheaper_is_enough_and_comes_first() -> None:
    paper = load("paper-1ms").profile
    found = plan(paper, wanted={"bus.nodes": 8})
    best = found.recommended
    assert best is not None
    assert list(best.changes.items()) == [
        ("cycle.period_us", 1200.0),
        ("cycle.slice_ratio", 0.83),
        ("bus.gap_count", 21),
    ]
    assert found.period_is_kept is False
    assert plan(paper, wanted={"bus.nodes": 7}).period_is_kept is True
    # The smallest period of all with these settings: one step less fails.
    assert plan(paper, wanted={"bus.nodes": 8, "cycle.period_us": 1100.0}).recommended is None


def test_a_period_is_a_multiple_of_the_step_of_the_circle(make: Make) -> None:
    profile = make(cycle__period_us=1050.0, servo={"step_us": 100.0})
    # Without a circle test, too: `circle-test` would refuse the period. A step that is given stays.
    for wanted, changes in (
        ({}, {"servo.step_us": 87.5}),
        ({"servo.step_us": 100.0}, {"cycle.period_us": 1000.0}),
    ):
        found = plan(profile, wanted=wanted).recommended
        assert found is not None
        assert found.changes == changes
    kept = plan(profile, free=["gap_count", "slice_ratio"])
    assert kept.recommended is None
    assert kept.binding is not None
    assert (kept.binding.key, kept.binding.slice_us) == ("servo.step_us", inf)
    assert [one.relaxed for one in kept.relaxations] == ["step", "period"]


def test_a_circle_that_fails_asks_for_the_nearest_period_on_either_side(make: Make) -> None:
    asked = []

    def circle(profile: Profile) -> tuple[str, ...]:
        asked.append(profile.cycle.period_us)
        return () if profile.cycle.period_us in (600.0, 1300.0) else ("too rough",)

    own = make(cycle__period_us=1000.0, tolerance={"max_contour_error_mm": 0.1})
    found = plan(own, circle=circle).recommended
    assert found is not None
    assert found.changes == {"cycle.period_us": 1300.0}
    assert (found.circle_passed, found.proven) == (True, True)
    nearer = plan(override(own, {"cycle.period_us": 900.0}), circle=circle).recommended
    assert nearer is not None
    assert nearer.changes["cycle.period_us"] == 600.0
    kept = plan(own, wanted={"cycle.period_us": 1000.0}, circle=circle)
    assert kept.recommended is None
    assert kept.binding is not None
    assert (kept.binding.key, kept.binding.why) == ("circle", "too rough")
    assert {one.relaxed for one in kept.relaxations} == {"period", "circle"}
    cut = plan(own, circle=circle, max_circles=1).recommended
    assert cut is None or not cut.proven


def test_the_circle_is_asked_last_and_only_of_what_holds_everything_else(make: Make) -> None:
    asked: list[Profile] = []

    def circle(profile: Profile) -> tuple[str, ...]:
        asked.append(profile)
        return ()

    own = make(cycle__period_us=300.0, servo={"step_us": 100.0}, limits={"max_utilisation": 0.7})
    found = plan(own, circle=circle).recommended
    assert found is not None
    assert asked
    assert all(holds(profile) for profile in asked)
    asked.clear()
    assert plan(make(cycle__period_us=300.0), circle=circle).recommended is not None
    assert asked == []  # the profile asks for none


# --- known bad cases ----------------------------------------------------------------------------------------


def test_a_limit_that_the_gate_holds_is_held_by_the_plan() -> None:
    tight = override(load("paper-1ms").profile, {"limits.max_utilisation": 0.8, "bus.nodes": 4})
    best = plan(tight).recommended
    assert best is not None
    assert best.deciding.utilisation <= 0.8 * (1 + FIT_ROUNDING)
    assert errors_of(best.profile, with_circle=True) == []


def test_a_plan_has_more_to_spare_than_it_is_unsure_of(make: Make) -> None:
    for nodes in range(1, 12):
        goal = make(bus__nodes=nodes)
        one = figures(override(goal, least(goal) or {}), model="standard")
        assert one.margin_corrected_us is not None
        assert one.margin_corrected_us >= (one.uncertainty_us or 0)


@pytest.mark.parametrize(("name", "nodes"), list(zip(shipped_names(), cycle([3, 11]), strict=False)))
def test_what_is_written_for_a_shipped_profile_passes_the_gate_with_its_circle(name: str, nodes: int) -> None:
    profile = load(name).profile
    best = plan(profile, wanted={profile.alike_nodes[0].nodes_key: nodes}, circle=CircleCheck()).recommended
    assert best is not None
    assert errors_of(best.profile, with_circle=True) == []


# --- nothing found ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "binding", "relaxed"),
    [
        ({"bus__nodes": 20}, "hops", {"nodes"}),
        ({"bus__nodes": 70, "bus__max_hops": 4}, "nodes", {"nodes"}),
        ({"payload__write_bytes": 3000}, "payload", {"payload"}),
        ({"bus__gap_count": 3, "bus__cable_length_m": 10.0}, "gap table", set()),
        ({"limits": {"max_utilisation": 0.0}}, "limits.max_utilisation", {"limits.max_utilisation"}),
        ({"limits": {"min_spare_nodes": 15}}, "limits.min_spare_nodes", {"nodes", "limits.min_spare_nodes"}),
        ({"limits": {"min_spare_axes": 57}}, "limits.min_spare_axes", {"nodes", "limits.min_spare_axes"}),
    ],
)
def test_without_a_plan_it_says_what_binds_and_what_would_be_enough(
    make: Make, changes: dict[str, Any], binding: str, relaxed: set[str]
) -> None:
    found = plan(make(**changes))
    assert found.recommended is None
    assert found.binding is not None
    assert found.binding.key == binding
    assert {one.relaxed for one in found.relaxations} == relaxed


@pytest.mark.parametrize(
    ("key", "value", "enough", "tighter"),
    [
        ("limits.reserve", 0.9, 0.75, 0.76),
        ("limits.max_utilisation", 0.1, 0.2, 0.19),
        ("limits.min_spare_nodes", 12, 5, 6),
    ],
)
def test_a_limit_is_relaxed_no_more_than_it_takes(
    make: Make, key: str, value: float, enough: float, tighter: float
) -> None:
    found = plan(make(cycle__period_us=1000.0), wanted={key: value}, free=["gap_count", "slice_ratio"])
    (one,) = (each for each in found.relaxations if each.relaxed == key)
    assert one.value == enough
    assert holds(override(found.goal, {key: one.value, **one.changes}))
    assert least(override(found.goal, {key: tighter}), ["gap_count", "slice_ratio"]) is None


def test_the_schedule_is_freed_where_nothing_cheaper_is_enough(make: Make) -> None:
    tight = make(bus__nodes=10, cycle__period_us=300.0)
    assert least(tight, ["gap_count", "slice_ratio", "responses"]) is None
    found = least(tight, ["gap_count", "slice_ratio", "schedule"])
    assert found is not None
    assert found["cycle.schedule"] == "broadcast"
    assert errors_of(override(tight, dict(found)), with_circle=False) == []
    assert plan(tight).free == ("gap_count", "slice_ratio", "period")  # not without being asked


@pytest.mark.parametrize(
    ("free", "wanted", "words"),
    [
        (
            ["cabling"],
            {},
            "free cabling: there is nothing of that name to free on a bus of kind ieee1394; there are gap",
        ),
        (["wiring", "speed"], {}, "free wiring: there is nothing"),
        (["period"], {"cycle.period_us": 1000.0}, "free period: cycle.period_us was given a value, which is kept"),
        (["nodes"], {"bus.nodes": 4}, "free nodes: bus.nodes was given a value"),
    ],
)
def test_what_cannot_be_freed_is_said(make: Make, free: list[str], wanted: dict[str, Any], words: str) -> None:
    with pytest.raises(BusplanError) as caught:
        plan(make(), wanted=wanted, free=free)
    assert str(caught.value).startswith(words)


# --- parts --------------------------------------------------------------------------------------------------


@given(step=st.sampled_from([0.1, 1.0, 12.5, 100.0, 333.3]), digits=st.integers(1, 4), number=st.floats(0.0, 1e9))
def test_a_grid_has_the_smallest_number_that_is_no_less(step: float, digits: int, number: float) -> None:
    grid = ShortNumbers(step, digits)
    place = grid.place(number)
    assert grid.number(place) >= number * (1 - 1e-11)
    assert place == 1 or grid.number(place - 1) < number
    assert grid.place(grid.number(place)) == place
    assert grid.number(place) < grid.number(place + 1)


@given(data=st.data())
def test_neither_period_nor_slice_ratio_changes_what_is_needed(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = override(data.draw(any_profile), data.draw(limits))
    other: dict[str, object] = {
        "cycle.period_us": data.draw(st.floats(10, 1e5)),
        "cycle.slice_ratio": data.draw(st.floats(0.01, 1.0)),
    }
    assert needs(override(profile, other)) == needs(profile)


@given(data=st.data())
def test_every_setting_of_the_bus_is_safe_and_saves_time(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    network = network_of(profile)
    for setting in bus_of(profile).settings(network):
        for value in setting.values:
            assert set(value) <= set(setting.keys)
            changed = network_of(override(profile, dict(value)))
            assert setting.name != "gap_count" or gap_count_of(changed) == safe_gap_count(hops_of(changed))
            if setting.name == "responses":
                assume(network.profile.node.response_us <= 1.63)
                cycles = [bus_of(profile).cycle(one, model="standard").required_us for one in (changed, network)]
                assert cycles[0] <= cycles[1]


def test_a_search_that_has_tried_enough_gives_up_and_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    profile = load("paper-1ms").profile
    levels = freed(profile, None)
    assert Search(profile).least(levels) == {}
    monkeypatch.setattr("busplan.questions.plan.search._MOST_TRIES", 0)
    endless = Freedom("x", "x", Cost.PERIOD, (PERIOD,), lambda *_: ({PERIOD: float(n)} for n in count(1)))
    for freedoms in (levels, [endless]):
        search = Search(profile)
        assert search.least(freedoms) is None
        assert not search.proven


def test_a_payload_that_no_axis_adds_to_is_cut_at_its_fixed_part() -> None:
    changes: dict[str, Any] = {"group.io.read_bytes": 400, "group.io.read_bytes_per_axis": 5, "cycle.period_us": 500.0}
    wide = override(load("gantry-24").profile, changes)
    cut = with_payload_within(wide, 100)
    assert cut is not None
    assert cut["group.io.read_bytes"] == 100
    assert plan(wide, free=["payload"]).profile is not None
