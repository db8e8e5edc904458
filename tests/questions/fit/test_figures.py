"""Capacity against an exact second implementation, brute force, and the limits of the standard."""

from collections.abc import Callable
from fractions import Fraction
from math import fsum
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.questions.fit.figures import after_reset, cycle_figures
from busplan.questions.fit.figures import figures as figures_of
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at
from tests.oracles.ieee1394_cycle import carries_broadcasts, exact_cycle_start_us, exact_required_us
from tests.registers import at_least, some

Make = Callable[..., busplan.Profile]

MODELS = st.sampled_from(["paper", "standard"])


@given(data=st.data())
def test_max_nodes_is_the_largest_that_fits_in_exact_arithmetic(
    data: st.DataObject,
    any_profile: st.SearchStrategy[busplan.Profile],
) -> None:
    profile = data.draw(any_profile)
    limit = {"S100": 512, "S200": 1024, "S400": 2048}[value_at(profile, "bus.speed")]
    available = Fraction(profile.cycle.slice_ratio) * Fraction(profile.cycle.period_us)

    largest_bytes = max(profile.node_groups[0].bytes_of(kind) for kind in ("read", "write"))

    def good(nodes: int, model: str) -> bool:
        hops = nodes if value_at(profile, "bus.max_hops") is None else value_at(profile, "bus.max_hops")
        # A float's rounding in the product of two floats is no reason to refuse an exact fit.
        return (
            bool(largest_bytes <= limit)
            and hops <= 16
            and carries_broadcasts(profile, nodes)
            and exact_cycle_start_us(profile, nodes) <= 124
            and exact_required_us(profile, model, nodes) <= available * (1 + Fraction(1, 10**12))
        )

    for figures in busplan.capacity(profile).results:
        most = figures.max_nodes
        assert most is not None
        # What is good has no gaps: once broken, a limit stays broken, as is tested of every kind.
        tried = {nodes for nodes in (most, most + 1, most + 2, (most + 62) // 2, 62) if 1 <= nodes <= 62}
        assert [nodes for nodes in sorted(tried) if good(nodes, figures.timing_model)] == [most][:most]


@settings(max_examples=at_least(5, 40))
@given(data=st.data(), nodes=st.integers(1, 62))
def test_a_cycle_that_fits_exactly_fits(
    data: st.DataObject, nodes: int, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = busplan.load_profile(data.draw(any_profile), changes={"bus.nodes": nodes})
    for figures in busplan.capacity(profile).results:
        exact_us = figures.required_us / profile.cycle.slice_ratio
        at, below = busplan.capacity(
            profile, period_us=[exact_us, exact_us * (1 - 1e-9)], timing_model=figures.timing_model
        ).results
        assert at.max_nodes is not None
        assert below.max_nodes is not None
        # One node more needs at least the time of its transactions: nothing rounds up to it.
        assert at.max_nodes == nodes if at.limited_by == "time" else at.max_nodes <= nodes
        assert below.max_nodes < nodes


@given(data=st.data())
def test_required_time_equals_the_exact_one(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    nodes = profile.node_groups[0].nodes
    for figures in busplan.capacity(profile).results:
        expected_us = float(exact_required_us(profile, figures.timing_model, nodes))
        assert figures.required_us == pytest.approx(expected_us, rel=1e-13)


@given(data=st.data())
def test_the_figures_of_a_profile_agree_with_each_other(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    figures = data.draw(st.sampled_from(busplan.capacity(profile).results))
    assert fsum(term.us for term in figures.terms) == pytest.approx(figures.required_us, rel=1e-12)
    assert {term.key: getattr(figures.own, term.key) for term in figures.terms} == {
        term.key: term.us for term in figures.terms
    }
    assert figures.required_time_slice_us * figures.nodes == pytest.approx(figures.required_us, rel=1e-13)
    values = figures.values()
    assert figures.max_nodes is not None
    assert figures.fits == (figures.nodes <= figures.max_nodes) == (not figures.exceeded)
    assert ("time" in figures.exceeded) == (figures.margin_us < 0)
    assert figures.margin_us == pytest.approx(
        figures.available_us - figures.required_us, abs=1e-9 * figures.required_us
    )
    assert figures.utilisation == pytest.approx(figures.required_us / figures.available_us)
    assert figures.max_axes == profile.node_groups[0].node.axes * figures.max_nodes
    assert figures.axes == profile.node_groups[0].node.axes * figures.nodes
    assert figures.time_slice_us * figures.nodes == pytest.approx(figures.available_us)
    assert values["gaps_us"] == pytest.approx(values["subaction_gap_us"] + values["arbitration_reset_gap_us"])
    assert figures.min_period_us is not None
    assert figures.min_period_us * profile.cycle.slice_ratio == pytest.approx(figures.required_us)
    assert figures.min_slice_ratio * profile.cycle.period_us == pytest.approx(figures.required_us)
    if figures.timing_model == "paper":
        assert {figures.bias_us, figures.safe_required_us, figures.safe_nodes, figures.verdict, figures.doubts} == {
            None,
            (),
        }
        return
    assert figures.bias_us is not None
    assert figures.safe_required_us is not None
    assert figures.safe_nodes is not None
    corrected_us = figures.available_us - figures.required_us - figures.bias_us
    assert figures.margin_corrected_us == pytest.approx(corrected_us, abs=1e-9 * figures.required_us)
    shown_us = figures.required_us + figures.bias_us + (figures.uncertainty_us or 0)
    assert figures.safe_required_us == pytest.approx(shown_us)
    assert figures.safe_min_period_us == pytest.approx(figures.safe_required_us / profile.cycle.slice_ratio)
    assert figures.safe_axes == profile.node_groups[0].node.axes * figures.safe_nodes
    assert (figures.verdict == "fits" and figures.safe) == (figures.nodes <= figures.safe_nodes)


@settings(max_examples=at_least(5, 40))
@given(data=st.data())
def test_the_smallest_period_fits_and_nothing_below_it(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    for figures in busplan.capacity(profile).results:
        smallest_us = figures.min_period_us
        assert smallest_us is not None
        at, below = busplan.capacity(
            profile, period_us=[smallest_us, smallest_us * (1 - 1e-9)], timing_model=figures.timing_model
        ).results
        assert "time" not in at.exceeded
        assert at.margin_us == pytest.approx(0.0, abs=1e-9 * at.required_us)
        assert "time" in below.exceeded


GROWING = {
    "bus__gap_count": st.integers(0, 63),
    "payload__read_bytes": st.integers(1, 2048),
    "payload__write_bytes": st.integers(5, 2048),
    "payload__overhead_bytes": st.integers(0, 100),
    "node__execution__base_us": st.floats(0, 100),
    "node__execution__per_byte_us": st.floats(0, 1),
    "cycle__nonperiodic_us": st.floats(0, 1000),
    "cycle__sync__ping_us": st.floats(0, 100),
    "cycle__sync__ping_per_node_us": st.floats(0, 100),
    "bus__cable_length_m": st.floats(0.1, 100),
}


@pytest.mark.parametrize("key", some(GROWING, 5))
@settings(max_examples=at_least(2, 12))  # of each key
@given(data=st.data(), model=MODELS, period_us=st.floats(50, 20_000))
def test_max_nodes_never_grows_with_what_costs_time(
    key: str, data: st.DataObject, model: str, period_us: float, make: Make
) -> None:
    small, large = sorted((data.draw(GROWING[key]), data.draw(GROWING[key])))
    few, many = (only(make(cycle__period_us=period_us, **{key: value}), model).max_nodes for value in (large, small))
    assert few is not None
    assert many is not None
    assert few <= many


def test_a_payload_of_exactly_a_quadlet_is_cheaper_than_a_smaller_one(make: Make) -> None:
    # The one place where the standard model is not monotone: 4 bytes travel as a quadlet, 1 to 3 as a block.
    small, quadlet = (
        only(make(payload__write_bytes=size, node__execution__per_byte_us=0.0)).required_us for size in (3, 4)
    )
    assert quadlet < small


@settings(max_examples=at_least(6, 40))
@given(data=st.data(), periods=st.lists(st.floats(1, 50_000), min_size=2, max_size=2))
def test_max_nodes_never_shrinks_with_the_period(
    data: st.DataObject, periods: list[float], any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    shorter, longer = busplan.capacity(data.draw(any_profile), period_us=sorted(periods)).periods
    for few, many in zip(shorter, longer, strict=True):
        assert (few.values()["max_nodes"] or 0) <= (many.values()["max_nodes"] or 0)


def only(profile: busplan.Profile, model: str = "standard") -> Any:
    return busplan.capacity(profile, timing_model=model).results[0]


@pytest.mark.parametrize(("speed", "limit_bytes"), [("S100", 512), ("S200", 1024), ("S400", 2048)])
def test_a_payload_over_the_speeds_limit_carries_no_node(make: Make, speed: str, limit_bytes: int) -> None:
    at, over = (
        only(make(bus__speed=speed, payload__write_bytes=size, cycle__period_us=1e6))
        for size in (limit_bytes, limit_bytes + 1)
    )
    assert at.fits
    assert (over.max_nodes, over.limited_by, over.exceeded, over.fits) == (0, "payload", ("payload",), False)


def test_a_chain_ends_at_16_hops(make: Make) -> None:
    at, over = (only(make(bus__nodes=nodes, cycle__period_us=1e6)) for nodes in (16, 17))
    assert (at.fits, at.max_nodes, at.limited_by) == (True, 16, "hops")
    assert (over.fits, over.max_nodes, over.exceeded) == (False, 16, ("hops",))


def test_a_tree_ends_at_62_nodes(make: Make) -> None:
    at, over = (only(make(bus__nodes=nodes, bus__max_hops=4, cycle__period_us=1e6)) for nodes in (62, 63))
    assert (at.fits, at.max_nodes, at.limited_by) == (True, 62, "nodes")
    assert (over.fits, over.max_nodes, over.exceeded) == (False, 62, ("nodes",))


def test_a_tree_of_more_than_16_hops_carries_no_node(make: Make) -> None:
    figures = only(make(bus__max_hops=17, cycle__period_us=1e6))
    assert (figures.max_nodes, figures.limited_by, figures.exceeded) == (0, "hops", ("hops",))


def test_every_broken_limit_is_named(make: Make) -> None:
    figures = only(make(bus__nodes=70, payload__read_bytes=3000))
    assert figures.exceeded == ("payload", "nodes", "hops", "time")


def test_a_period_too_short_for_anything_carries_no_node(make: Make) -> None:
    figures = only(make(cycle__period_us=1e-3))
    assert (figures.max_nodes, figures.limited_by, figures.fits) == (0, "time", False)


def test_optimal_gap_count_follows_the_chain(make: Make) -> None:
    three, ten = (only(make(bus__gap_count="optimal", bus__nodes=nodes)) for nodes in (3, 10))
    assert (three.own.gap_count, ten.own.gap_count) == (8, 26)
    assert (three.own.safe_gap_count, three.safe, ten.safe) == (8, True, True)


def test_the_paper_promises_half_as_many_nodes_again(make: Make) -> None:
    # With execution out of the way and a tree that holds the hops, the gap terms decide.
    profile = make(bus__max_hops=1, node__execution__base_us=0.0, node__execution__per_byte_us=0.0)
    paper, standard = (only(profile, model).required_us for model in ("paper", "standard"))
    assert standard / paper > 1.5


def test_results_nest_periods_then_models_as_asked(make: Make) -> None:
    result = busplan.capacity(make(), period_us=[1000.0, 500.0, 1000.0], timing_model=["standard", "paper"])
    assert [(figures.period_us, figures.timing_model) for figures in result.results] == [
        (1000.0, "standard"),
        (1000.0, "paper"),
        (500.0, "standard"),
        (500.0, "paper"),
        (1000.0, "standard"),
        (1000.0, "paper"),
    ]


def test_the_binding_term_is_the_largest(make: Make) -> None:
    assert only(make()).binding_term == "execution"
    assert only(make(node__execution__base_us=0.0, node__execution__per_byte_us=0.0)).binding_term == "idle"
    assert only(make(host={"transaction_us": 200.0})).binding_term == "host"
    assert only(make(cycle__nonperiodic_us=900.0)).binding_term == "nonperiodic"


def test_equation_11_as_published_at_the_profiles_own_nodes(make: Make) -> None:
    figures = only(make(), "paper").values()
    by_hand = (figures["available_us"] - 0.4) / (2 * (figures["read_latency_us"] + figures["gaps_us"]))
    assert figures["read_latency_us"] == figures["write_latency_us"]
    assert figures["nodes_eq11"] == pytest.approx(by_hand, rel=1e-14)


def test_figures_of_another_kind_are_refused() -> None:
    (result, *_) = busplan.capacity("paper-4ms").results
    with pytest.raises(busplan.BusplanError, match="the figures are Ieee1394Figures, not CanFigures"):
        busplan.CanFigures.of(result)


@pytest.mark.parametrize(("adapter", "adapter_us"), [("none", 0), ("ftdi-low-latency", 2000), ("ftdi", 17_000)])
def test_what_is_needed_at_least_is_needed_without_what_is_only_possible(adapter: str, adapter_us: float) -> None:
    # 14 answers, two requests and the host; an adapter keeps what it has read for up to its timer, or sends it at once.
    profile = busplan.load_profile("dynamixel-arm-14", changes={"bus.adapter": adapter, "cycle.period_us": 5500})
    figures = busplan.capacity(profile).verdicts[0].deciding
    assert (figures.least_required_us, figures.required_us) == (5368.0, 5368.0 + adapter_us)
    # 323 us of doubt are more than the 132 us left. What is only possible does not make a cycle too long for certain.
    assert figures.verdict == "not shown to fit"
    assert figures.exceeded == (("time",) if adapter_us else ())


@pytest.mark.parametrize(
    ("period_us", "gap_count", "then"),
    [
        # At gap count 63 a slice of 264.109 us is shown to be enough, and 255.497 us is the least that may be.
        (510.9, "optimal", "does not fit"),
        (511.1, "optimal", "not shown to fit"),
        (528.2, "optimal", "not shown to fit"),
        (528.3, "optimal", None),
        # A plan that is not shown to fit now, or that is as after a reset already, says nothing of one.
        (400.0, "optimal", None),
        (4000.0, 63, None),
    ],
)
def test_a_reset_is_told_where_the_cycle_fits_before_it_and_not_after_it(
    period_us: float, gap_count: object, then: str | None, make: Make
) -> None:
    bus = {"bus__gap_count": gap_count, "bus__cycle_master": False}
    network = network_of(make(**bus, cycle__period_us=period_us, node__execution__grade="measured"))
    after = after_reset(network, figures_of(network, model="standard"))
    assert (None if after is None else after.verdict) == then


def test_where_neither_a_bias_nor_a_doubt_is_known_u_is_unknown_and_not_0() -> None:
    exact = {"kind": "linear", "grade": "measured", "base_us": 100, "per_byte_us": 0, "uncertainty_us": 0}
    network = network_of(busplan.load_profile("can-servo-8", changes={"node.execution": exact}))
    fit = cycle_figures(network, model=network.bus.deciding_model)
    assert [doubt.us for doubt in fit.doubts] == [0.0, 0.0]
    assert (fit.bias_us, fit.uncertainty_us) == (None, None)
