"""The recommended change is the cheapest of all there are, and every option does what it says."""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from busplan.analysis.capacity.certainty import FITS
from busplan.analysis.capacity.cycle import broken_limits
from busplan.analysis.capacity.figures import figures
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.cures import MAX_ADVISED_RATIO
from busplan.analysis.planning.options import plan
from busplan.buses.ieee1394.transactions import gap_count_of, hops_of
from busplan.errors import BusplanError
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
from busplan.sections.profile import Profile

Make = Callable[..., Profile]
Safely = Callable[[Profile, int], Fraction]

SAFE = [5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43]
KINDS = [(), ("gap",), ("ratio",), ("gap", "ratio"), ("period",), ("gap", "period")]
KEYS = {"gap": "bus.gap_count", "ratio": "cycle.slice_ratio", "period": "cycle.period_us"}


def working_kinds(profile: Profile, safely: Safely) -> Iterator[tuple[str, ...]]:
    """Kinds of change of which some value works, by trying them all with the second implementation."""
    cycle, network = profile.cycle, network_of(profile)
    hops, own_gap_count = int(hops_of(network)), gap_count_of(network)
    rounding = 1 + Fraction(1, 10**12)
    required = {
        gap_count: safely(override(profile, {"bus.gap_count": gap_count}), profile.alike_nodes[0].nodes)
        for gap_count in (own_gap_count, *range(SAFE[hops - 1], 64))
    }
    for kind in KINDS:
        gap_counts = range(64) if "gap" in kind else [own_gap_count]
        ratios: Sequence[Fraction] = (
            [Fraction(n, 100) for n in range(1, 91)] if "ratio" in kind else [Fraction(cycle.slice_ratio)]
        )
        periods = [Fraction(10**9) if "period" in kind else Fraction(cycle.period_us)]
        safe = [gap_count for gap_count in gap_counts if gap_count >= SAFE[hops - 1]]
        slices = [ratio * period * rounding for ratio, period in product(ratios, periods)]
        if any(required[gap_count] <= slice_us for gap_count, slice_us in product(safe, slices)):
            yield kind


def cycle_starts_leave_no_time(profile: Profile) -> bool:
    """Whether they do so with a gap count that a plan may take: its own, the safe one, or what repairs say."""
    repairs = bus_of(profile).repairs(network_of(profile))
    variants = [{}, repairs, {**repairs, "bus.gap_count": "optimal"}]
    return any("cycle starts" in broken_limits(override(profile, dict(one))) for one in variants)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_recommended_is_the_cheapest_kind_that_an_exhaustive_search_finds(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile], safely: Safely
) -> None:
    one = data.draw(any_profile)
    nodes = data.draw(st.integers(1, 16))
    hops = one.bus.max_hops and min(one.bus.max_hops, 16)
    one = override(one, {"payload.read_bytes": 16, "payload.write_bytes": 64, "bus.max_hops": hops})
    assume(not cycle_starts_leave_no_time(override(one, {"bus.nodes": nodes})))
    found = plan(one, wanted={"bus.nodes": nodes}).recommended
    assert found is not None
    cheapest = next(working_kinds(override(one, {"bus.nodes": nodes}), safely))
    assert list(found.changes) == [KEYS[kind] for kind in cheapest]


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_options_hold_what_they_say(data: st.DataObject, any_profile: st.SearchStrategy[Profile]) -> None:
    profile = data.draw(any_profile)
    wanted = data.draw(
        st.fixed_dictionaries(
            {},
            optional={
                "bus.nodes": st.integers(1, 70),
                "bus.gap_count": st.integers(0, 63) | st.just("optimal"),
                "cycle.period_us": st.floats(10, 1e5),
            },
        )
    )
    result = plan(profile, wanted=dict(wanted))
    assert sum(option.recommended for option in result.options) <= 1
    for option in result.options:
        # The changes alone, put into the profile as it was read, make the network that the figures are of.
        changed = override(profile, dict(result.all_changes(option)))
        assert option.deciding == figures(changed, model="standard")
        assert [one.timing_model for one in option.others] in ([], ["paper"])
        assert option.profile == changed
        assert option.title in ("as it is", "best gap count") or option.deciding.verdict == FITS
        assert option.circle_passed is None
        if option.title != "as it is" and "bus.gap_count" in option.changes:
            assert option.deciding.gap_count_safe
    best = result.recommended
    if best is not None:
        assert best.is_plan
        assert not set(best.changes) & {"bus.nodes", *wanted}
        assert best.profile.cycle.slice_ratio <= max(MAX_ADVISED_RATIO, profile.cycle.slice_ratio)
    else:
        # Only what was asked to stay, a number of nodes that no bus has, or cycle starts can stand in the way.
        assert (
            {"bus.gap_count", "cycle.period_us"} & set(wanted)
            or "nodes" in broken_limits(result.goal)
            or cycle_starts_leave_no_time(result.goal)
        )


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_profiles_have_a_plan(name: str) -> None:
    assert plan(load(name).profile).recommended is not None


def test_nothing_to_change(make: Make) -> None:
    result = plan(make())
    best = result.recommended
    assert best is not None
    assert (best.title, best.changes, result.wanted) == ("as it is", {}, {})


def test_what_was_asked_for_is_part_of_the_changes_but_no_proposal(make: Make) -> None:
    result = plan(make(), wanted={"bus.nodes": 5, "bus.gap_count": 63, "cycle.period_us": 1000.0})
    assert result.wanted == {"bus.nodes": 5, "cycle.period_us": 1000.0}
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
    assert "best gap count" in [one.title for one in result.impossible]
    assert result.recommended is not None
    assert list(result.recommended.changes) == ["cycle.slice_ratio"]


def test_a_circle_that_fails_asks_for_another_period(make: Make) -> None:
    def circle(profile: Profile) -> tuple[str, ...]:
        return () if profile.cycle.period_us == 1300.0 else ("too rough",)

    round_enough = {"max_contour_error_mm": 0.1}
    result = plan(make(cycle__period_us=1000.0, tolerance=round_enough), circle=circle)
    best = result.recommended
    assert best is not None
    assert best.changes == {"cycle.period_us": 1300.0}
    assert (best.circle_passed, best.bounded_by, best.proven) == (True, "circle", True)
    assert result.options[0].circle_failures == ("too rough",)
    kept = plan(make(), wanted={"cycle.period_us": 1000.0}, circle=circle)
    assert kept.recommended is None
    cut = plan(make(cycle__period_us=1000.0), circle=circle, max_circles=1).recommended
    assert cut is None or not cut.proven


def test_the_circle_is_not_run_where_the_bus_does_not_fit(make: Make) -> None:
    def circle(profile: Profile) -> tuple[str, ...]:
        assert figures(profile, model="standard").verdict == FITS
        return ()

    result = plan(make(cycle__period_us=200.0, tolerance={"max_contour_error_mm": 0.1}), circle=circle)
    assert result.options[0].circle_passed is None
    assert result.recommended is not None
    assert result.recommended.circle_passed


def test_a_limit_of_the_standard_is_named_where_no_value_helps(make: Make) -> None:
    result = plan(make(), wanted={"bus.nodes": 20})
    assert ("smallest period", "the standard's limit of hops is broken", True) in result.impossible
    assert result.recommended is not None
    assert "bus.max_hops" in result.recommended.changes
    assert plan(make(bus__max_hops=4), wanted={"bus.nodes": 63}).recommended is None


def test_bad_values_are_refused(make: Make) -> None:
    with pytest.raises(BusplanError, match=r"bus\.nodes 0"):
        plan(make(), wanted={"bus.nodes": 0})
