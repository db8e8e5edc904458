"""What is advised has been seen to work."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.analysis.advice import cheapest_change
from busplan.analysis.capacity import capacity, figures
from busplan.analysis.verdict import verdicts
from busplan.profile.model import Profile
from busplan.profile.toml import override
from busplan.timing import TIMING_MODELS, TimingModelName

Make = Callable[..., Profile]


@settings(max_examples=200, deadline=None)
@given(data=st.data(), model=st.sampled_from(sorted(TIMING_MODELS)))
def test_a_change_does_what_it_promises(
    data: st.DataObject, model: TimingModelName, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    now = figures(profile, model=model)
    change = cheapest_change(profile, model=model)
    if change is None:
        assert now.fits
        assert now.limited_by != "time"
        return
    after = figures(override(profile, dict(change.changes)), model=model)
    assert after == change.figures
    assert after.fits
    assert after.max_nodes > now.max_nodes or not now.fits


@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        # Short by less than the gaps that hops do not need: a register is enough.
        ({"cycle__period_us": 600.0}, ["bus.gap_count"]),
        ({"cycle__period_us": 300.0, "bus__gap_count": 7}, ["cycle.slice_ratio"]),
        ({"cycle__period_us": 100.0, "bus__gap_count": 7}, ["cycle.period_us"]),
        ({"payload__write_bytes": 3000, "cycle__period_us": 20_000.0}, ["payload.write_bytes"]),
        ({"bus__nodes": 70, "bus__max_hops": 4, "cycle__period_us": 1e6}, ["bus.nodes"]),
        ({"bus__nodes": 20, "cycle__period_us": 1e6}, ["bus.max_hops"]),
        ({"bus__nodes": 20}, ["bus.max_hops", "cycle.slice_ratio"]),
    ],
)
def test_the_cheapest_change_that_makes_it_fit(make: Make, changes: dict[str, object], keys: list[str]) -> None:
    profile = make(**changes)
    assert not figures(profile, model="standard").fits
    change = cheapest_change(profile, model="standard")
    assert change is not None
    assert list(change.changes) == keys
    assert change.figures.fits


def test_a_fitting_profile_is_told_how_to_carry_more(make: Make) -> None:
    change = cheapest_change(make(cycle__period_us=1000.0), model="standard")
    assert change is not None
    assert change.changes == {"bus.gap_count": 10}
    assert change.figures.max_nodes > figures(make(cycle__period_us=1000.0), model="standard").max_nodes


def test_nothing_is_advised_where_the_standard_ends(make: Make) -> None:
    assert cheapest_change(make(cycle__period_us=1e6), model="standard") is None


def test_no_change_is_promised_that_the_execution_table_does_not_know(make: Make) -> None:
    profile = make(
        payload__write_bytes=4096,
        payload__read_bytes=4096,
        node__execution={"kind": "table", "payload_bytes": [4000, 8000], "time_us": [900.0, 1800.0]},
    )
    assert cheapest_change(profile, model="standard") is None


def test_the_profiles_own_model_decides(make: Make) -> None:
    # Between what the paper's clock and the standard's clock need.
    profile = make(cycle__period_us=500.0, bus__timing_model="standard")
    verdict = verdicts(capacity(profile))[0]
    assert verdict.deciding.timing_model == "standard"
    assert (verdict.deciding.fits, verdict.models_agree) == (False, False)
    other = verdicts(capacity(override(profile, {"bus.timing_model": "paper"})))[0]
    assert (other.deciding.fits, other.models_agree) == (True, False)


def test_a_model_asked_for_alone_decides_alone(make: Make) -> None:
    verdict = verdicts(capacity(make(), timing_models=["paper"]))[0]
    assert (verdict.deciding.timing_model, verdict.others, verdict.models_agree) == ("paper", (), True)
