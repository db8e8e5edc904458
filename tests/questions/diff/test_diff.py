"""Two profiles side by side: which keys differ, which way each figure goes, and what of it is a regression."""

from collections.abc import Callable
from math import nextafter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan

Make = Callable[..., busplan.Profile]

# Written down here a second time, on purpose: a direction that turns round lets regressions through.
MORE = {
    "gap_count_safe", "margin_corrected_us", "safe_nodes", "safe_axes", "fits", "margin_us",
    "max_nodes", "max_axes", "verdict",
}  # fmt: skip
LESS = {
    "safe_min_period_us", "utilisation", "required_us", "min_period_us", "read_latency_us", "read_latency_with_gaps_us",
    "write_latency_us", "write_latency_with_gaps_us", "read_transaction_us", "write_transaction_us",
}  # fmt: skip
NEITHER = {
    "timing_model", "period_us", "nodes", "axes", "hops", "gap_count", "safe_gap_count", "available_us",
    "time_slice_us", "limited_by", "binding_term", "bias_us", "uncertainty_us",
    "cycle_jitter_us",
    "safe_limited_by", "cycle_starts_us", "sync_us", "cycle_arbitration_us", "cycle_data_us", "cycle_acknowledge_us",
    "cycle_hold_us", "cycle_execution_us", "cycle_worst_extra_us", "cycle_idle_us", "cycle_host_us", "retries_us",
    "nonperiodic_us",
}  # fmt: skip
TURNED = {"better": "worse", "worse": "better", "same": "same", "neutral": "neutral"}


def figure(found: busplan.DiffAnswer, part: str, key: str) -> Any:
    (one,) = (one for one in found.figures if (one.part, one.figure.key) == (part, key))
    return one


def test_each_figure_has_its_direction(make: Make) -> None:
    found = busplan.diff(make(name="a"), make(name="b")).figures
    expected = {
        **dict.fromkeys(MORE, "more"),
        **dict.fromkeys(LESS, "less"),
        **dict.fromkeys(NEITHER, "neither"),
    }
    assert {(one.figure.key, one.figure.better) for one in found} == set(expected.items())


# --- keys -------------------------------------------------------------------------------------------------


def test_a_value_that_is_the_default_is_no_difference(make: Make) -> None:
    found = busplan.diff(make(bus__gap_count=63), make(bus__gap_count=63, bus__max_hops=None, limits={}))
    assert found.keys == ()
    assert {one.judgement for one in found.figures} == {"same"}


def test_a_default_is_told_from_what_stands_in_the_file(make: Make) -> None:
    (one,) = busplan.diff(make(), make(cycle__nonperiodic_us=5.0)).keys
    assert one.key == "cycle.nonperiodic_us"
    assert (one.a, one.b) == ((0.0, "default"), (5.0, "file"))


def test_keys_of_one_profile_alone(make: Make) -> None:
    table = {"kind": "table", "payload_bytes": [4, 16], "time_us": [30.0, 40.0]}
    found = {one.key: one for one in busplan.diff(make(), make(node__execution=table)).keys}
    assert set(found) == {
        "node.execution.kind",
        *(f"node.execution.{key}" for key in ("base_us", "per_byte_us", "payload_bytes", "time_us")),
    }
    assert found["node.execution.base_us"].b is None
    assert found["node.execution.time_us"].a is None
    assert found["node.execution.time_us"].b == ((30.0, 40.0), "file")


# --- figures ----------------------------------------------------------------------------------------------


@given(data=st.data())
def test_the_other_way_round_everything_turns(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    a, b = data.draw(any_profile), data.draw(any_profile)
    there, back = busplan.diff(a, b), busplan.diff(b, a)
    assert {one.key for one in there.keys} == {one.key for one in back.keys}
    for one, other in zip(there.figures, back.figures, strict=True):
        assert (one.a, one.b) == (other.b, other.a)
        assert TURNED[one.judgement] == other.judgement
        assert one.difference is None or one.difference == -(other.difference or 0)
        if one.judgement in ("better", "worse") and one.difference is not None:
            assert (one.difference > 0) == ((one.judgement == "better") == (one.figure.key in MORE))


@pytest.mark.parametrize("share", [1e-9 * 0.9, 1e-9 * 1.1])
def test_what_rounding_can_make_is_the_same(make: Make, share: float) -> None:
    # The whole cycle is the time that is kept free, but for a part that vanishes beside it.
    a = make(cycle__nonperiodic_us=1e8, cycle__period_us=1e9)
    b = busplan.load_profile(a, changes={"cycle.nonperiodic_us": 1e8 * (1 + share)})
    expected = "same" if share < 1e-9 else "worse"
    assert figure(busplan.diff(a, b), "paper", "required_us").judgement == expected


def test_the_last_digit_of_a_margin_is_rounding(make: Make) -> None:
    # A margin is what two larger times leave: next to none of it, their rounding is all of it.
    a = make(cycle__period_us=1000.0)
    required = figure(busplan.diff(a, a), "paper", "required_us").a
    full = busplan.load_profile(a, changes={"cycle.slice_ratio": required / 1000})
    less = busplan.load_profile(full, changes={"cycle.slice_ratio": nextafter(nextafter(full.cycle.slice_ratio, 0), 0)})
    more = busplan.load_profile(full, changes={"cycle.slice_ratio": full.cycle.slice_ratio * (1 + 1e-12)})
    for a, b in ((full, less), (full, more), (more, full)):
        margin = figure(busplan.diff(a, b), "paper", "margin_us")
        assert (margin.judgement, margin.relative_difference) == ("same", None)
    assert figure(busplan.diff(more, full), "paper", "margin_us").a > 0


def test_a_difference_is_signed_and_a_share_is_of_the_size_of_a(make: Make) -> None:
    a, b = make(cycle__period_us=300.0), make(cycle__period_us=3000.0)
    margin = figure(busplan.diff(a, b, timing_model=["standard"]), "standard", "margin_us")
    assert margin.a < 0 < margin.b
    assert margin.difference == pytest.approx(1350.0)
    assert margin.relative_difference == pytest.approx(1350.0 / -margin.a)
    assert margin.judgement == "better"
    period = figure(busplan.diff(b, a), "plan", "period_us")
    assert (period.difference, period.relative_difference, period.judgement) == (-2700.0, -0.9, "neutral")


def test_only_the_models_asked_for_and_always_the_verdict(make: Make) -> None:
    # 500 us: the paper's timing carries four nodes, 399.4 us; three are shown to fit, 424.4 us, and four need 565.4.
    a = make(cycle__period_us=1000.0, bus__nodes=3, bus__cycle_master=False)
    b = busplan.load_profile(a, changes={"bus.nodes": 4})
    found = busplan.diff(a, b, timing_model=["paper"])
    assert {one.part for one in found.figures} == {"plan", "paper"}
    verdict = figure(found, "plan", "verdict")
    assert (verdict.a, verdict.b, verdict.judgement) == ("fits", "not shown to fit", "worse")
    assert figure(found, "paper", "fits").judgement == "same"
    assert [one.figure.key for one in found.regressions(tolerance_percent=1e11)] == ["verdict"]


def test_a_model_that_cannot_express_both_is_not_compared(make: Make) -> None:
    a, b = make(), make(node__write_response="unified")
    for one, other in ((a, b), (b, a)):
        assert {each.part for each in busplan.diff(one, other).figures} == {"plan", "standard"}


def test_a_gap_count_that_makes_all_better_is_no_regression_by_its_bias(make: Make) -> None:
    found = busplan.diff(make(), make(bus__gap_count="optimal"))
    bias = figure(found, "plan", "bias_us")
    # Eight halves, each 2 (63 - 7) / 98.304 us further from the measured gap count.
    assert bias.difference == pytest.approx(8 * 2 * 56 / 98.304)
    assert bias.judgement == "neutral"
    assert found.regressions() == ()


# --- the gate ---------------------------------------------------------------------------------------------


def test_a_tolerance_allows_a_share_of_the_figure_of_a(make: Make) -> None:
    # 550 us: 10 us more change no number of nodes, of either model or shown.
    a = make(cycle__period_us=1100.0, cycle__nonperiodic_us=0.0)
    b = busplan.load_profile(a, changes={"cycle.nonperiodic_us": 10.0})
    found = busplan.diff(a, b)
    assert {one.figure.key for one in found.regressions()} == {
        "margin_corrected_us",
        "safe_min_period_us",
        "margin_us",
        "utilisation",
        "required_us",
        "min_period_us",
    }
    required = figure(found, "paper", "required_us")
    share = required.relative_difference
    assert share is not None
    assert not required.is_regression(tolerance=share)
    assert required.is_regression(tolerance=share * (1 - 1e-6))
    assert found.regressions(tolerance_percent=100) == ()
    assert busplan.diff(b, a).regressions() == ()


def test_what_is_no_number_is_never_tolerated(make: Make) -> None:
    a, b = make(cycle__period_us=1000.0), make(cycle__period_us=200.0)
    worse = {(one.part, one.figure.key) for one in busplan.diff(a, b).regressions(tolerance_percent=1e11)}
    assert worse == {("plan", "verdict"), ("paper", "fits"), ("standard", "fits")}


@pytest.mark.parametrize("percent", [-1, float("nan"), float("inf"), "5"])
def test_a_tolerance_that_is_none_is_refused(make: Make, percent: Any) -> None:
    with pytest.raises(busplan.BusplanError, match="tolerance_percent"):
        busplan.diff(make(), make()).regressions(tolerance_percent=percent)


def test_regressions_are_named_with_the_timing_that_has_them() -> None:
    paper = busplan.load_profile("paper-1ms")
    found = busplan.diff(paper, busplan.load_profile(paper, changes={"cycle.nonperiodic_us": 250}))
    assert found.regression_words(tolerance_percent=80) == (
        "regression: B is worse by more than 80 % in 8 figures: verdict, corrected margin, "
        "period with enough time, no limit broken (standard), margin, utilisation, required time, smallest period"
    )
    assert found.regression_words(tolerance_percent=0).startswith("regression: B is worse in ")
    assert busplan.diff(paper, paper).regression_words() == ""


def test_two_kinds_of_bus_are_compared_by_the_models_that_decide() -> None:
    found = busplan.diff("paper-1ms", "can-servo-8")
    assert {one.part for one in found.figures} == {"plan", "deciding"}
    assert figure(found, "deciding", "sync_us").judgement == "neutral"
    with pytest.raises(busplan.BusplanError, match="have no timing model in common; leave it out"):
        busplan.diff("paper-1ms", "can-servo-8", timing_model="standard")
