"""What is advised has been seen to work, and is safe."""

from collections.abc import Callable

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from busplan.analysis.capacity.certainty import DOES_NOT_FIT, FITS
from busplan.analysis.capacity.cycle import broken_limits
from busplan.analysis.capacity.figures import capacity, figures
from busplan.analysis.capacity.node_limit import safe_nodes
from busplan.analysis.capacity.verdict import verdicts
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.cures import MAX_ADVISED_RATIO, Change, change_for_more, change_to_fit
from busplan.buses.ieee1394.constants import safe_gap_count
from busplan.buses.ieee1394.transactions import gap_count_of, hops_of
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
from busplan.sections.profile import Profile

Make = Callable[..., Profile]


def is_safe(profile: Profile, change: Change) -> bool:
    network = network_of(override(profile, dict(change.changes))).with_nodes(change.nodes)
    return bool(gap_count_of(network) >= safe_gap_count(hops_of(network)))


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_after_a_change_the_verdict_is_what_it_promises(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    verdict = verdicts(capacity(profile))[0]
    if verdict.change is None:
        return
    changed = override(profile, dict(verdict.change.changes))
    after = figures(changed, model="standard")
    assert is_safe(profile, verdict.change)
    assert changed.cycle.slice_ratio <= max(MAX_ADVISED_RATIO, profile.cycle.slice_ratio)
    if verdict.all_well:
        assert verdict.deciding.safe_nodes is not None
        assert after.safe_nodes is not None
        assert verdict.deciding.safe_nodes < verdict.change.nodes <= after.safe_nodes
    else:
        assert (after.verdict, after.safe) == (FITS, True)


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_there_is_always_a_way_unless_a_bound_is_reached(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    # With linear execution times a payload can shrink, a period grow and a chain become a tree.
    profile = data.draw(any_profile)
    # Nothing that is advised makes a cycle start shorter; a gap count that is safe can make it longer.
    repaired = override(profile, dict(bus_of(profile).repairs(network_of(profile))))
    assume("cycle starts" not in broken_limits(repaired))
    verdict = verdicts(capacity(profile))[0]
    assert verdict.all_well or verdict.change is not None


@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        # The slice must give 287.5 us at gap count 63 and 223.4 us at 7. Short by less than that: a register is enough.
        ({"cycle__period_us": 550.0}, ["bus.gap_count"]),
        ({"cycle__period_us": 350.0, "bus__gap_count": 7}, ["cycle.slice_ratio"]),
        ({"cycle__period_us": 300.0}, ["bus.gap_count", "cycle.slice_ratio"]),
        ({"cycle__period_us": 100.0, "bus__gap_count": 7}, ["cycle.period_us"]),
        ({"payload__write_bytes": 3000, "cycle__period_us": 20_000.0}, ["payload.write_bytes"]),
        ({"payload__write_bytes": 600, "bus__speed": "S100", "cycle__period_us": 2e4}, ["bus.speed"]),
        ({"bus__nodes": 70, "bus__max_hops": 4, "cycle__period_us": 1e6}, ["bus.nodes"]),
        ({"bus__nodes": 20, "cycle__period_us": 1e6}, ["bus.max_hops"]),
        ({"bus__nodes": 20, "cycle__period_us": 6000.0}, ["bus.max_hops", "cycle.slice_ratio"]),
        ({"bus__gap_count": 0}, ["bus.gap_count"]),
        ({"bus__cable_length_m": 10.0, "cycle__period_us": 500.0}, ["cycle.slice_ratio"]),
    ],
)
def test_the_cheapest_change_that_makes_it_fit(make: Make, changes: dict[str, object], keys: list[str]) -> None:
    profile = make(**changes)
    verdict = verdicts(capacity(profile))[0]
    assert not verdict.all_well
    change = change_to_fit(profile)
    assert change is not None
    assert list(change.changes) == keys
    assert change.figures == figures(override(profile, dict(change.changes)), model="standard")
    assert (change.figures.verdict, change.figures.safe) == (FITS, True)


def test_more_nodes_get_the_gap_count_of_all_of_them(make: Make) -> None:
    change = change_for_more(make(cycle__period_us=1000.0))
    assert change is not None
    assert change.changes == {"bus.gap_count": safe_gap_count(change.nodes)}
    # 500 us: three nodes need 424.4 us at gap count 63, four 565.4.
    assert safe_nodes(make(cycle__period_us=1000.0)) == (3, "time")
    assert (change.figures.safe_nodes or 0) >= change.nodes > 3


@pytest.mark.parametrize("name", shipped_names())
def test_advice_for_shipped_profiles_is_safe(name: str) -> None:
    profile = load(name).profile
    change = verdicts(capacity(profile))[0].change
    assert change is None or is_safe(profile, change)


def test_no_gap_count_is_advised_for_cables_that_the_table_does_not_know(make: Make) -> None:
    profile = make(cycle__period_us=550.0, bus__cable_length_m=20.0)
    change = change_to_fit(profile)
    assert change is not None
    assert "bus.gap_count" not in change.changes


def test_nothing_is_advised_where_the_standard_ends(make: Make) -> None:
    assert change_for_more(make(cycle__period_us=1e6)) is None


def test_no_change_is_promised_that_the_execution_table_does_not_know(make: Make) -> None:
    profile = make(
        payload__write_bytes=4096,
        payload__read_bytes=4096,
        node__execution={"kind": "table", "payload_bytes": [4000, 8000], "time_us": [900.0, 1800.0]},
    )
    assert change_to_fit(profile) is None


@pytest.mark.parametrize("own", ["paper", "standard"])
def test_one_model_decides_whichever_leads(make: Make, own: str) -> None:
    # 220 us: paper needs 197.0 and standard 253.2, of which all doubts take no more than 27.7.
    profile = make(cycle__period_us=440.0, bus__timing_model=own)
    verdict = verdicts(capacity(profile))[0]
    assert (verdict.deciding.timing_model, verdict.deciding.verdict) == ("standard", DOES_NOT_FIT)
    assert [(one.timing_model, one.fits, one.verdict) for one in verdict.others] == [("paper", True, None)]
    assert not verdict.models_agree
    assert verdict.change is not None
    after = figures(override(profile, dict(verdict.change.changes)), model="standard")
    assert (after.verdict, after.safe) == (FITS, True)


@pytest.mark.parametrize(("period_us", "agree"), [(4000.0, True), (440.0, False)])
def test_another_model_asked_for_alone_does_not_decide(make: Make, period_us: float, agree: bool) -> None:
    profile = make(cycle__period_us=period_us)
    verdict = verdicts(capacity(profile, timing_models=["paper"]))[0]
    assert verdict.deciding == figures(profile, model="standard")
    assert [one.timing_model for one in verdict.others] == ["paper"]
    assert verdict.models_agree == agree


@pytest.mark.parametrize(("period_us", "keys"), [(560.0, ["bus.gap_count"]), (580.0, [])])
def test_what_fits_but_is_not_shown_to_gets_advice_too(make: Make, period_us: float, keys: list[str]) -> None:
    # 280 and 290 us: both over the 253.2 us that are needed, and only one over the 287.5 us that show it.
    profile = make(cycle__period_us=period_us)
    assert figures(profile, model="standard").fits
    change = change_to_fit(profile)
    assert change is not None
    assert list(change.changes) == keys


@pytest.mark.parametrize("period_us", [300.0, 4000.0])
def test_a_gap_count_that_no_table_cures_is_not_advised_away(make: Make, period_us: float) -> None:
    # The table holds for cables of 4.5 m: nobody knows what is safe at 10 m.
    profile = make(bus__gap_count=0, bus__cable_length_m=10.0, cycle__period_us=period_us)
    assert change_to_fit(profile) is None
