"""What is advised has been seen to work, and is safe."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.analysis.capacity.figures import capacity, figures
from busplan.analysis.capacity.verdict import verdicts
from busplan.analysis.network import network_of
from busplan.analysis.planning.cures import MAX_ADVISED_RATIO, Change, change_for_more, change_to_fit
from busplan.buses.ieee1394.constants import safe_gap_count
from busplan.buses.ieee1394.cycle import gap_count_of, hops_of
from busplan.buses.ieee1394.timing import TIMING_MODELS, TimingModelName
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
from busplan.sections.profile import Profile

Make = Callable[..., Profile]
BOTH: tuple[TimingModelName, ...] = tuple(TIMING_MODELS)


def is_safe(profile: Profile, change: Change) -> bool:
    network = network_of(override(profile, dict(change.changes))).with_nodes(change.nodes)
    return bool(gap_count_of(network) >= safe_gap_count(hops_of(network)))


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_a_change_does_what_it_promises_under_every_model(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    verdict = verdicts(capacity(profile))[0]
    if verdict.change is None:
        return
    changed = override(profile, dict(verdict.change.changes))
    after = [figures(changed, model=model) for model in BOTH]
    assert is_safe(profile, verdict.change)
    assert changed.cycle.slice_ratio <= max(MAX_ADVISED_RATIO, profile.cycle.slice_ratio)
    if verdict.all_well:
        deciding = figures(changed, model=verdict.deciding.timing_model)
        assert verdict.deciding.max_nodes < verdict.change.nodes <= deciding.max_nodes
    else:
        assert all(one.fits for one in after)


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_there_is_always_a_way_unless_a_bound_is_reached(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    # With linear execution times a payload can shrink, a period grow and a chain become a tree.
    profile = data.draw(any_profile)
    verdict = verdicts(capacity(profile))[0]
    assert verdict.all_well or verdict.change is not None


@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        # Short by less than the gaps that hops do not need: a register is enough.
        ({"cycle__period_us": 600.0}, ["bus.gap_count"]),
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
    change = change_to_fit(profile, models=BOTH)
    assert change is not None
    assert list(change.changes) == keys
    assert change.figures.fits


def test_more_nodes_get_the_gap_count_of_all_of_them(make: Make) -> None:
    change = change_for_more(make(cycle__period_us=1000.0), model="standard")
    assert change is not None
    assert change.changes == {"bus.gap_count": safe_gap_count(change.nodes)}
    assert change.figures.max_nodes >= change.nodes > 3


@pytest.mark.parametrize("name", shipped_names())
def test_advice_for_shipped_profiles_is_safe(name: str) -> None:
    profile = load(name).profile
    change = verdicts(capacity(profile))[0].change
    assert change is None or is_safe(profile, change)


def test_no_gap_count_is_advised_for_cables_that_the_table_does_not_know(make: Make) -> None:
    profile = make(cycle__period_us=600.0, bus__cable_length_m=20.0)
    change = change_to_fit(profile, models=BOTH)
    assert change is not None
    assert "bus.gap_count" not in change.changes


def test_nothing_is_advised_where_the_standard_ends(make: Make) -> None:
    assert change_for_more(make(cycle__period_us=1e6), model="standard") is None


def test_no_change_is_promised_that_the_execution_table_does_not_know(make: Make) -> None:
    profile = make(
        payload__write_bytes=4096,
        payload__read_bytes=4096,
        node__execution={"kind": "table", "payload_bytes": [4000, 8000], "time_us": [900.0, 1800.0]},
    )
    assert change_to_fit(profile, models=BOTH) is None


def test_the_profiles_own_model_decides(make: Make) -> None:
    # Between what the paper's clock and the standard's clock need.
    profile = make(cycle__period_us=500.0, bus__timing_model="standard")
    verdict = verdicts(capacity(profile))[0]
    assert verdict.deciding.timing_model == "standard"
    assert (verdict.deciding.fits, verdict.models_agree) == (False, False)
    other = verdicts(capacity(override(profile, {"bus.timing_model": "paper"})))[0]
    assert (other.deciding.fits, other.models_agree) == (True, False)
    # Where they disagree, the change makes both fit.
    assert other.change is not None
    changed = override(profile, dict(other.change.changes))
    assert all(figures(changed, model=model).fits for model in BOTH)


def test_a_model_asked_for_alone_decides_alone(make: Make) -> None:
    verdict = verdicts(capacity(make(), timing_models=["paper"]))[0]
    assert (verdict.deciding.timing_model, verdict.others, verdict.models_agree) == ("paper", (), True)


@pytest.mark.parametrize("period_us", [300.0, 4000.0])
def test_a_gap_count_that_no_table_cures_is_not_advised_away(make: Make, period_us: float) -> None:
    # The table holds for cables of 4.5 m: nobody knows what is safe at 10 m.
    profile = make(bus__gap_count=0, bus__cable_length_m=10.0, cycle__period_us=period_us)
    assert change_to_fit(profile, models=BOTH) is None
