"""How sure a verdict is: by hand, against a Monte Carlo of the inputs, and what may never make it better."""

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import busplan
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at
from tests.oracles.ieee1394_cycle import exact_safe_required_us
from tests.registers import at_least

Maker = Callable[..., busplan.Profile]
HALVES_US = {4: 6, 16: 6.3, 32: 6.6, 64: 7.5, 128: 9.1, 256: 11.5, 512: 16.9, 1024: 27.4}
"""Paper, Table I: T1 + T2 by payload in bytes, as measured."""
HALF_U_US = 0.24330 * sqrt(1 + 1 / 8)
"""Standard uncertainty of the next half, from the spread of what these have beyond the model."""


def changed(profile: busplan.Profile, changes: dict[str, object]) -> busplan.Profile:
    return busplan.load_profile(profile, changes=changes)


def of(profile: busplan.Profile, model: str = "standard") -> Any:
    (figures,) = busplan.capacity(profile, timing_model=model).results
    return figures


def with_fixed_execution(profile: busplan.Profile, execution_us: float, **changes: Any) -> busplan.Profile:
    execution = {"kind": "linear", "base_us": execution_us, "per_byte_us": 0, **changes}
    return changed(profile, {"node.execution": execution})


@pytest.mark.parametrize(
    ("gap_count", "required_us", "bias_us"),
    # models.md, section 4: six nodes in a chain, 32 bytes, T_exec 44.7 us, derived.
    [(63, 886.8, 19.85), (16, 731.9, 42.8)],
)
def test_six_nodes_by_hand(make: Maker, gap_count: int, required_us: float, bias_us: float) -> None:
    profile = with_fixed_execution(
        make(
            bus__nodes=6,
            bus__gap_count=gap_count,
            bus__cycle_master=False,
            payload__read_bytes=32,
            payload__write_bytes=32,
        ),
        44.7,
        grade="derived",
    )
    figures = of(profile)
    assert figures.required_us == pytest.approx(required_us, abs=0.05)
    assert figures.bias_us == pytest.approx(bias_us, abs=0.05)
    assert figures.margin_corrected_us == pytest.approx(2000 - figures.required_us - (figures.bias_us or 0), rel=1e-12)
    gap_term_us = 2 * (63 - gap_count) / 98.304
    parts_us = {
        "residual": 24 * HALF_U_US,
        "gap_term": 24 * gap_term_us / sqrt(3),
        # Behind an execution longer than the arbitration reset gap the sensitivity is 1 of each transaction.
        "node.execution": 12 / sqrt(3),
        # Six delays of the hops in a transaction, two in the synchronous packet, six hops each.
        "bus.phy_delay_us": (12 * 6 + 2) * 6 * 0.020 / sqrt(3),
        "host.transaction_us": 0.0,
    }
    # At gap count 63, T_exec lies between T_reset and twice T_reset less T_sub in neither case.
    assert {doubt.key: float(doubt.us) for doubt in figures.doubts} == pytest.approx(parts_us, rel=1e-4)
    assert figures.uncertainty_us == pytest.approx(2 * sqrt(sum(us**2 for us in parts_us.values())), rel=1e-4)


@given(data=st.data(), nodes=st.integers(1, 62), reserve=st.floats(0.0, 0.9))
def test_what_a_slice_must_give_is_what_the_second_implementation_says(
    data: st.DataObject,
    nodes: int,
    reserve: float,
    any_profile: st.SearchStrategy[busplan.Profile],
) -> None:
    profile = changed(data.draw(any_profile), {"limits.reserve": reserve, "bus.nodes": nodes})
    assert of(profile).safe_required_us == pytest.approx(float(exact_safe_required_us(profile, nodes)), rel=1e-12)


@pytest.mark.parametrize("name", ["can-servo-8", "sercos2-servo-8", "sercos3-servo-8", "profibus-drives-6"])
def test_where_no_bias_is_known_none_is_taken_off(name: str) -> None:
    figures = busplan.capacity(name).verdicts[0].deciding
    assert (figures.bias_us, figures.margin_corrected_us) == (None, figures.margin_us)


def test_two_nodes_of_the_paper_by_hand(make: Maker) -> None:
    profile = with_fixed_execution(make(cycle__period_us=1000.0, bus__cycle_master=False), 36.433)
    # models.md, section 3: T_sub 10.549, T_reset 21.047, required 262.12 us; the paper has 205.92.
    assert of(profile).required_us == pytest.approx(262.12, abs=0.005)
    assert of(profile, "paper").required_us == pytest.approx(205.92, abs=0.005)
    assert of(profile, "paper").verdict is None


@given(payload=st.sampled_from(list(HALVES_US)), nodes=st.integers(1, 16))
def test_the_bias_at_gap_count_63_is_the_residual_of_the_table(make: Maker, payload: int, nodes: int) -> None:
    alone = {"bus__nodes": nodes, "bus__cycle_master": False}
    profile = make(**alone, payload__read_bytes=payload, payload__write_bytes=payload)
    mean_us = np.mean([us - _half_us(make, payload_bytes) for payload_bytes, us in HALVES_US.items()])
    assert of(profile).bias_us == pytest.approx(4 * nodes * mean_us, rel=1e-9)


def _half_us(make: Maker, size: int) -> float:
    profile = make(bus__nodes=1, payload__read_bytes=size, payload__write_bytes=size)
    (_, write) = busplan.latency(profile, timing_model="standard").transactions
    return write.phases["request_and_acknowledge_us"] or 0.0


def test_half_a_transaction_for_a_unified_write(make: Maker) -> None:
    split = of(make(bus__nodes=4))
    unified = of(make(bus__nodes=4, node__write_response="unified"))
    assert unified.bias_us == pytest.approx(3 / 4 * (split.bias_us or 0), rel=1e-12)


def test_an_execution_fitted_against_the_model_holds_its_residual(make: Maker) -> None:
    fitted = {"node__execution__residual": "standard", "node__execution__measured_gap_count": 16}
    figures = of(make(bus__gap_count=16, **fitted))
    assert figures.bias_us == pytest.approx(0.0, abs=1e-9)
    assert {doubt.key for doubt in figures.doubts if doubt.us} == {"node.execution", "bus.phy_delay_us"}
    # From the gap count that was measured to another the gap term counts again.
    assert of(make(bus__gap_count=10, **fitted)).bias_us == pytest.approx(8 * 2 * 6 / 98.304, rel=1e-9)


@pytest.mark.parametrize(
    ("grade", "uncertainty_us"),
    [
        ("measured", 0.1 / sqrt(12)),
        ("derived", 1 / sqrt(3)),
        ("calibrated", 4.0),
        ("assumed", 40 / sqrt(3)),
        (None, 4.0),
    ],
)
def test_an_execution_is_as_uncertain_as_its_grade(make: Maker, grade: str | None, uncertainty_us: float) -> None:
    profile = with_fixed_execution(make(), 40.0, **({} if grade is None else {"grade": grade}))
    (doubt_us,) = (doubt.us for doubt in of(profile).doubts if doubt.key == "node.execution")
    assert doubt_us == pytest.approx(4 * uncertainty_us, rel=1e-9)
    given_u = with_fixed_execution(make(), 40.0, uncertainty_us=0.25)
    (doubt_us,) = (doubt.us for doubt in of(given_u).doubts if doubt.key == "node.execution")
    assert doubt_us == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"node__execution__base_us": 60.0},
        {"bus__gap_count": 16},
        {"host": {"transaction_us": 30.0, "uncertainty_us": 1.5}},
        {"node__execution__base_us": 2.0, "node__execution__per_byte_us": 0.0},
        {"bus__max_hops": 16, "bus__nodes": 40, "bus__gap_count": 43},
        {
            "node__execution__base_us": 60.0,
            "node__write_response": "unified",
            "cycle__retries": 3,
            "bus__phy_delay_us": 0.1,
        },
    ],
)
def test_the_uncertainty_is_that_of_a_monte_carlo_of_the_inputs(make: Maker, changes: dict[str, Any]) -> None:
    # Cycle starts come in whole numbers: with them the cycle has steps, and no standard deviation tells its bound.
    profile = make(bus__cycle_master=False, **changes)
    assert of(profile).uncertainty_us == pytest.approx(2 * np.std(_drawn_us(profile)), rel=0.02)


@pytest.mark.parametrize("execution_us", [10.6, 21.1, 28.0, 31.55, 34.0])
def test_where_the_cycle_has_a_kink_it_still_covers_95_percent_on_one_side(make: Maker, execution_us: float) -> None:
    # T_exec near T_sub, T_reset and 2 T_reset - T_sub: a central difference would cover 84 % at the last one.
    profile = make(node__execution__base_us=execution_us, node__execution__per_byte_us=0.0)
    figures = of(profile)
    assert np.mean(_drawn_us(profile) <= figures.required_us + (figures.uncertainty_us or 0)) >= 0.95


def _drawn_us(profile: busplan.Profile) -> NDArray[np.float64]:
    """Cycles, each input drawn anew and the same in every transaction."""
    draws, random = 100_000, np.random.default_rng(1394)
    network = network_of(profile)
    (group,) = network.groups
    own: Any = profile
    cycle: Any = network.bus.cycle(network, model="standard")
    halves = profile.node_groups[0].nodes * (3 if own.node.write_response == "unified" else 4) + own.cycle.retries
    gap_term_us = 2 * (63 - cycle.figures()["gap_count"]) / 98.304
    normal = random.standard_normal
    uniform = random.uniform(-1, 1, draws)
    host, phy_us = own.host, own.bus.phy_delay_us
    host_u_us = host.transaction_us * 0.1 if host.uncertainty_us is None else host.uncertainty_us
    shift = normal(draws)
    varied = {
        "host": host.model_copy(update={"transaction_us": host.transaction_us + host_u_us * normal(draws)}),
        "bus": own.bus.model_copy(
            update={"phy_delay_us": 14 / 98.304 + random.uniform(-0.020, 0.020, draws) if phy_us is None else phy_us}
        ),
    }
    executions = {
        f"{kind}_execution_us": getattr(group, f"{kind}_execution_us") * (1 + 0.1 * shift) for kind in ("read", "write")
    }
    drawn = network._replace(groups=(group._replace(**executions),), profile=profile.model_copy(update=varied))
    required_us = network.bus.cycle(drawn, model="standard").required_us
    return np.asarray(required_us + halves * (HALF_U_US * normal(draws) + gap_term_us * uniform))


@settings(max_examples=at_least(4, 40))
@given(data=st.data())
def test_more_bias_or_reserve_never_improves_and_more_uncertainty_never_shows(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    before = of(profile)
    reserve = data.draw(st.floats(0.0, 0.9))
    with_reserve = of(changed(profile, {"limits.reserve": reserve}))
    assert _rank(with_reserve) >= _rank(before)
    assert (with_reserve.safe_nodes or 0) <= (before.safe_nodes or 0)
    doubtful = of(changed(profile, {"node.execution.uncertainty_us": 1e3}))
    assert doubtful.verdict != "fits" or before.verdict == "fits"
    fitted = changed(profile, {"node.execution.residual": "standard", "node.execution.measured_gap_count": 63})
    biased = changed(profile, {"node.execution.residual": "none"})
    assert _rank(of(biased)) >= _rank(of(fitted))


def _rank(figures: Any) -> int:
    return ("fits", "not shown to fit", "does not fit").index(figures.verdict)


@settings(max_examples=at_least(5, 40))
@given(data=st.data())
def test_no_faster_node_and_no_shorter_cable_makes_a_verdict_worse(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = changed(data.draw(any_profile), {"node.execution.uncertainty_us": 0.5})
    before = of(profile)
    execution: Any = profile.node_groups[0].node.execution
    share = data.draw(st.floats(0.0, 1.0))
    faster = of(changed(profile, {"node.execution.base_us": execution.base_us * share}))
    shorter = of(changed(profile, {"bus.cable_length_m": value_at(profile, "bus.cable_length_m") * max(share, 0.01)}))
    for after in (faster, shorter):
        assert _rank(after) <= _rank(before)
        assert (after.safe_nodes or 0) >= (before.safe_nodes or 0)
        assert after.required_us <= before.required_us * (1 + 1e-12)


def test_the_three_verdicts_lie_where_the_margin_crosses_the_uncertainty(make: Maker) -> None:
    figures = of(make())
    assert figures.uncertainty_us is not None
    needed_us, doubt_us = figures.required_us + (figures.bias_us or 0), figures.uncertainty_us
    verdicts = {
        period_us: of(make(cycle__period_us=period_us, cycle__slice_ratio=1.0)).verdict
        for period_us in (
            needed_us + doubt_us + 1e-6,
            needed_us + doubt_us - 1e-6,
            needed_us - doubt_us + 1e-6,
            needed_us - doubt_us - 1e-6,
        )
    }
    assert list(verdicts.values()) == ["fits", "not shown to fit", "not shown to fit", "does not fit"]


def test_a_reserve_is_a_share_of_the_slice(make: Maker) -> None:
    figures = of(make())
    assert figures.safe_required_us is not None
    period_us = figures.safe_required_us / 0.85
    for step_us, verdict in ((1e-6, "fits"), (-1e-6, "not shown to fit")):
        reserved = make(cycle__period_us=period_us + step_us, cycle__slice_ratio=1.0, limits={"reserve": 0.15})
        assert of(reserved).verdict == verdict


def test_a_broken_limit_does_not_fit_whatever_the_time(make: Maker) -> None:
    figures = of(make(bus__nodes=17, cycle__period_us=1e6))
    assert (figures.verdict, figures.exceeded) == ("does not fit", ("hops",))
