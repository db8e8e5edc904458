"""A plan says the steps of its search and what the network could reach; every option does what it says."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
from busplan.questions.circle.check import CircleCheck
from busplan.questions.circle.roundness import circle_test
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import figures
from busplan.questions.fit.node_limit import safe_nodes
from busplan.questions.plan.freedoms import freed
from busplan.questions.plan.options import Option
from busplan.questions.plan.planning import plan
from busplan.questions.plan.search import Search
from busplan.sections.profile import Profile

Make = Callable[..., Profile]
Safely = Callable[[Profile, int], Fraction]
Carries = Callable[[Profile, int], bool]
Around = Callable[[int, Callable[[int], bool]], list[int]]

GAP_COUNTS = [5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43, 46, 48, 51, 54, 57, 59, 62]


def titled(title: str, profile: Profile, **asked: Any) -> Option:
    (found,) = (one for one in plan(profile, **asked).options if one.title == title)
    return found


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_profiles_have_a_plan(name: str) -> None:
    assert plan(load(name).profile).recommended is not None


def test_nothing_to_change(make: Make) -> None:
    result = plan(make())
    best = result.recommended
    assert best is not None
    assert (best.title, best.changes, result.wanted) == ("as it is", {}, {})
    assert (result.period_is_kept, result.binding, result.relaxations) == (True, None, ())
    assert result.free == ("gap_count", "slice_ratio", "period")


def test_every_step_frees_one_setting_more_until_one_is_enough() -> None:
    result = plan(load("paper-1ms").profile, wanted={"bus.nodes": 8})
    steps = [(one.title, one.passes, one.recommended, one.held_by) for one in result.options[:4]]
    assert steps == [
        ("as it is", False, False, "time"),
        ("gap count", False, False, "time"),
        ("+ slice ratio", False, False, "time"),
        ("+ period", True, True, None),
    ]
    # A step that is not enough goes as far as it can.
    assert result.options[2].changes == {"cycle.slice_ratio": 0.9, "bus.gap_count": 21}
    assert [one.title for one in result.options[4:]] == ["smallest period", "most nodes"]
    assert [one.title for one in result.impossible] == ["largest payload"]


def test_what_was_asked_for_is_part_of_the_changes_but_no_proposal(make: Make) -> None:
    result = plan(make(), wanted={"bus.nodes": 5, "bus.gap_count": 63, "cycle.period_us": 1000.0})
    assert result.wanted == {"bus.nodes": 5, "cycle.period_us": 1000.0}
    assert result.free == ("slice_ratio",)
    best = result.recommended
    assert best is not None
    assert list(best.changes) == ["cycle.slice_ratio"]
    assert list(result.all_changes(best)) == ["bus.nodes", "cycle.period_us", "cycle.slice_ratio"]


def test_an_unsafe_gap_count_is_never_recommended_even_when_asked_for(make: Make) -> None:
    assert plan(make(), wanted={"bus.gap_count": 3}).recommended is None
    assert plan(make(bus__gap_count=3)).recommended is not None
    assert plan(make(bus__gap_count=3, bus__cable_length_m=10.0)).recommended is None


def test_no_gap_count_for_cables_that_the_table_does_not_know(make: Make) -> None:
    result = plan(make(bus__cable_length_m=10.0, cycle__period_us=550.0))
    assert all("bus.gap_count" not in option.changes for option in result.options)
    assert result.recommended is not None
    assert list(result.recommended.changes) == ["cycle.slice_ratio"]


def test_a_reserve_that_is_asked_for_is_kept_and_part_of_the_changes(make: Make) -> None:
    result = plan(make(), wanted={"limits.reserve": 0.2, "cycle.period_us": 600.0})
    best = result.recommended
    assert best is not None
    assert result.all_changes(best)["limits.reserve"] == 0.2
    one = best.deciding
    assert (one.margin_corrected_us or 0) - (one.uncertainty_us or 0) >= 0.2 * one.available_us


def test_the_circle_is_not_run_where_the_bus_does_not_fit(make: Make) -> None:
    def circle(profile: Profile) -> tuple[str, ...]:
        assert figures(profile, model="standard").verdict == FITS
        return ()

    result = plan(make(cycle__period_us=200.0, tolerance={"max_contour_error_mm": 0.1}), circle=circle)
    assert result.options[0].circle_passed is None
    assert result.recommended is not None
    assert result.recommended.circle_passed


def test_bad_values_are_refused(make: Make) -> None:
    with pytest.raises(BusplanError, match=r"bus\.nodes 0"):
        plan(make(), wanted={"bus.nodes": 0})


# --- what the network could reach ---------------------------------------------------------------------------


def test_the_smallest_period_is_the_first_that_a_count_finds(make: Make) -> None:
    for nodes in (1, 8):
        goal = make(bus__nodes=nodes)
        found = titled("smallest period", goal)
        period_us = found.deciding.period_us
        assert found.passes
        shorter = override(goal, {"cycle.period_us": period_us - (10 if period_us > 1000 else 1)})
        assert Search(shorter).least(freed(shorter, ["gap_count", "slice_ratio"])) is None


def test_the_smallest_period_passes_the_circle_however_it_grows(make: Make) -> None:
    # The mean error falls with the period here, because the ramps grow: a bisection from above would not find this.
    circle = {"radius_mm": 20.0, "feed_mm_per_min": 3000.0, "ramp_periods": 20}
    profile = make(
        servo={"position_gain_per_s": 50.0, "velocity_feedforward": 0.0, "step_us": 500.0},
        circle=circle,
        cycle__period_us=4000.0,
        bus__gap_count=7,
    )
    grid = [500.0 * n for n in range(1, 40)]
    means = circle_test(profile, periods_us=grid, explain=False).results
    wanted_mm = next(one.mean_contour_error_mm for one in means if one.period_us == 5000.0)
    strict = override(profile, {"tolerance.mean_contour_error_mm": wanted_mm})
    passing = [one.period_us for one in circle_test(strict, periods_us=grid, explain=False).results if one.passed]
    found = titled("smallest period", strict, circle=CircleCheck())
    assert (found.deciding.period_us, found.held_by, found.proven) == (passing[0], "circle", True)
    assert 500.0 < passing[0] <= 5000.0


def test_a_circle_that_never_passes_ends_the_search_without_a_proof(make: Make) -> None:
    goal = make(tolerance={"max_contour_error_mm": 0.1})
    result = plan(goal, circle=lambda _: ("no",), max_circles=5)
    assert result.recommended is None
    (why,) = (one for one in result.impossible if one.title == "smallest period")
    assert (why.reason, why.proven) == ("no", False)


def test_no_period_beyond_the_schema(make: Make) -> None:
    goal = make(cycle__slice_ratio=1e-6, cycle__nonperiodic_us=2000.0)
    result = plan(goal, free=["gap_count", "period"])
    assert result.recommended is None
    assert "it would be over 1000 s" in [one.reason for one in result.impossible]


def test_a_payload_stays_inside_the_execution_table_which_need_not_ascend(make: Make) -> None:
    def table(times: list[float], *, sizes: tuple[int, ...] = (10, 100, 203), period: float) -> Any:
        execution = {"kind": "table", "payload_bytes": list(sizes), "time_us": times}
        payload = {"read_bytes": sizes[0], "write_bytes": sizes[0]}
        goal = make(node__execution=execution, cycle__period_us=period, payload=payload)
        result = plan(goal, free=["gap_count"])
        options = [one for one in result.options if one.title == "largest payload"]
        if options:
            return options[0].changes["payload.read_bytes"], options[0].held_by
        return next(one.reason for one in result.impossible if one.title == "largest payload")

    assert table([30.0, 60.0, 90.0], period=1e4) == (200, "execution")
    # 100 bytes take longer than 200: a search that takes the time for monotone stops below them.
    assert table([30.0, 500.0, 40.0], period=1000.0) == (200, "execution")
    assert table([30.0, 60.0, 90.0], period=10.0).startswith("not even the smallest fits: the cycle needs a slice of ")
    assert table([9.0, 9.1, 9.2], sizes=(9, 10, 11), period=1e4) == (
        "the execution table holds no whole step of the payload"
    )


@given(data=st.data())
def test_most_nodes_are_safe_for_their_gap_count(
    data: st.DataObject,
    any_profile: st.SearchStrategy[Profile],
    safely: Safely,
    start: Safely,
    carries: Carries,
    around: Around,
) -> None:
    profile = override(data.draw(any_profile), {"payload.read_bytes": 12, "payload.write_bytes": 12})
    bus, cycle = profile.bus, profile.cycle

    def safe(hops: int) -> int:
        return GAP_COUNTS[hops - 1] if hops <= len(GAP_COUNTS) else 63

    def good(nodes: int) -> bool:
        hops = bus.max_hops or nodes
        gap_count = safe(hops) if bus.gap_count == "optimal" else bus.gap_count
        given_us = Fraction(cycle.slice_ratio) * Fraction(cycle.period_us) * (1 + Fraction(1, 10**12))
        is_carried = carries(profile, nodes) and start(profile, nodes) <= 124
        is_possible = hops <= 16 and gap_count >= safe(hops) and is_carried
        return is_possible and safely(profile, nodes) <= given_us

    found, _ = safe_nodes(profile)
    assert around(found, good) == [found][:found]


def test_values_that_need_each_other_are_asked_together() -> None:
    result = plan(load("dvrk").profile, wanted={"bus.cycle_master": True, "bus.isochronous_us": 120.0})
    assert result.wanted == {"bus.cycle_master": True, "bus.isochronous_us": 120.0}
    assert result.binding is not None
    assert result.binding.key == "cycle starts"
