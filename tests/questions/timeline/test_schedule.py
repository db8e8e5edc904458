"""The schedule against the closed form, against exact arithmetic, and against what a schedule is."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import busplan
from busplan.errors import BusplanError
from tests.oracles.ieee1394_cycle import exact_required_us
from tests.registers import shipped_names

Maker = Callable[..., busplan.Profile]
MOST_REQUIRED_US = 1e6
MOST_NODES = 1000
"""As many as a timeline shows."""
MODELS = ("paper", "standard")


@given(data=st.data())
def test_the_last_event_ends_at_the_closed_forms_required_time(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    results = busplan.capacity(profile).results
    # A broken limit of cycle starts: their number has no end but a round one.
    assume(not any("cycle starts" in result.exceeded for result in results))
    for result in results:
        model = result.timing_model
        plan = busplan.timeline(profile, timing_model=model)
        assert (plan.figures.required_us, plan.figures.exceeded) == (result.required_us, result.exceeded)
        assert plan.figures.required_us < MOST_REQUIRED_US
        assert abs(plan.used_us - plan.figures.required_us) <= 1e-9
        # The addition itself is better than that: a unit in the last place of the exact sum of rounded phases.
        assert abs(plan.used_us - float(exact_required_us(profile, model, profile.node_groups[0].nodes))) <= 1e-9


@given(data=st.data())
def test_events_touch_and_cover_the_slice_or_overrun_it(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    plan = busplan.timeline(data.draw(any_profile))
    events = plan.events
    assert events[0].start_us == 0
    assert all(one.end_us == other.start_us for one, other in pairwise(events))
    assert all(one.start_us < one.end_us for one in events)
    idle = [one for one in events if one.kind == "idle"]
    if "time" in plan.figures.exceeded:
        assert idle == []
        assert plan.end_us > plan.figures.available_us
    elif idle:
        assert idle == [events[-1]]
        assert plan.end_us == plan.figures.available_us
        assert idle[0].duration_us == pytest.approx(plan.figures.margin_us, abs=1e-9)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", [one for one in shipped_names() if one.startswith("paper")])
def test_every_phase_of_a_shipped_profile_stands_in_the_order_of_the_protocol(name: str, model: Any) -> None:
    profile = busplan.load_profile(name)
    plan = busplan.timeline(profile, timing_model=model)
    wanted: list[tuple[object, ...]] = [("sync", None, None, None)]
    read: Any = busplan.latency(profile, timing_model=model).transactions[0].phases
    # A gap is a threshold: what of it has run while the node executes is not waited for again.
    before: tuple[str, ...] = ()
    behind: tuple[str, ...] = ("subaction_gap", "arbitration_reset_gap")
    if model == "standard":
        before = () if read["execution_us"] >= read["subaction_gap_us"] else ("subaction_gap",)
        behind = (
            ("subaction_gap",)
            if read["execution_us"] > read["arbitration_reset_gap_us"]
            else ("arbitration_reset_gap",)
        )
    for kind in ("read", "write"):
        for node in range(1, profile.node_groups[0].nodes + 1):
            wanted += [
                ("arbitration", node, kind, "request"),
                ("request_data", node, kind, "request"),
                ("acknowledge", node, kind, "request"),
                *([("execution", node, kind, None)] if read["execution_us"] else []),
                *((gap, node, kind, None) for gap in before),
                ("arbitration", node, kind, "response"),
                ("response_data", node, kind, "response"),
                ("acknowledge", node, kind, "response"),
                *((gap, node, kind, None) for gap in behind),
            ]
    if profile.cycle.nonperiodic_us:
        wanted.append(("nonperiodic", None, None, None))
    wanted.append(("idle", None, None, None))
    assert [one[:4] for one in plan.events] == wanted
    first = [one for one in plan.events if (one.node, one.transaction) == (1, "read")]
    gaps_us = sum(one.duration_us for one in first if one.term == "cycle_idle_us")
    assert sum(one.duration_us for one in first) - gaps_us == pytest.approx(read["latency_us"])
    assert gaps_us == pytest.approx(read["gaps_us"] if model == "paper" else read["idle_us"])


def test_figure_4_of_the_paper_by_hand(make: Maker) -> None:
    # One node, no gap count, S400: hop 0.023 + 14 / 393.216; 32 bytes a packet; 34.2 us of execution.
    profile = make(bus__nodes=1, bus__gap_count=0, cycle__period_us=400.0)
    hop_us = 0.023 + 14 / 393.216
    lengths = [0.3]
    for _ in range(2):
        arbitration, data, acknowledge = hop_us + 1.63, hop_us + 256 / 393.216, hop_us + 0.25
        packet = [arbitration, data, acknowledge]
        lengths += [*packet, 34.2, *packet, 29 / 393.216, 53 / 393.216]
    plan = busplan.timeline(profile, timing_model="paper")
    assert [one.duration_us for one in plan.events[:-1]] == pytest.approx(lengths)
    assert plan.events[-1].end_us == 200.0


# Gap count 63: T_sub = 1037 / 98.304 = 10.549 us, T_reset = 2069 / 98.304 = 21.047 us.
@pytest.mark.parametrize(
    ("changes", "idle"),
    [
        # The response waits for the rest of T_sub, and no idle period has ended the interval before the next request.
        (
            {"node__execution__base_us": 4.0},
            [("subaction_gap", 1037 / 98.304 - 4), ("arbitration_reset_gap", 21.04696)],
        ),
        # The node takes longer than T_sub, less than T_reset: the response goes at once.
        ({"node__execution__base_us": 15.0}, [("arbitration_reset_gap", 21.04696)]),
        # It takes longer than T_reset; one that took just that would need T_reset again: 2 T_reset - 25 - T_sub.
        (
            {"node__execution__base_us": 25.0},
            [("subaction_gap", 10.54891), ("allowance", 2 * 21.04696 - 25 - 10.54891)],
        ),
        ({"node__execution__base_us": 40.0}, [("subaction_gap", 10.54891)]),
        ({"node__execution__worst_extra_us": 40.0, "node__execution__base_us": 0.0}, [("subaction_gap", 10.54891)]),
        ({"node__read_response": "concatenated"}, [("arbitration_reset_gap", 21.04696)]),
        # The host starts 15 us behind the response, of which 10.549 us are the gap's.
        (
            {"node__execution__base_us": 40.0, "host": {"transaction_us": 15.0}},
            [("subaction_gap", 10.54891), ("host", 15 - 10.54891)],
        ),
    ],
)
def test_idle_periods_of_the_standard_by_hand(
    make: Maker, changes: dict[str, Any], idle: list[tuple[str, float]]
) -> None:
    plan = busplan.timeline(make(node__execution__per_byte_us=0.0, **changes))
    found = [
        (one.kind, one.duration_us)
        for one in plan.events
        if (one.node, one.transaction) == (1, "read") and one.term in ("cycle_idle_us", "cycle_host_us")
    ]
    assert [kind for kind, _ in found] == [kind for kind, _ in idle]
    assert [us for _, us in found] == pytest.approx([us for _, us in idle], abs=1e-5)


@pytest.mark.parametrize("nodes", [62, MOST_NODES])
def test_no_rounding_builds_up_over_many_events(make: Maker, nodes: int) -> None:
    profile = make(bus__nodes=nodes, bus__max_hops=7, cycle__period_us=1e6)
    lengths = [0.3 + 0.1 * (nodes - 1)]
    for one in busplan.latency(profile, timing_model="paper").transactions:
        twice = ("arbitration_us", "acknowledge_us") * 2
        once = ("request_data_us", "execution_us", "response_data_us", "subaction_gap_us", "arbitration_reset_gap_us")
        lengths += nodes * [one.phases[key] or 0.0 for key in (*twice, *once)]
    used_us = busplan.timeline(profile, timing_model="paper").used_us
    assert abs(used_us - math.fsum(lengths)) <= math.ulp(used_us)


def test_a_slice_that_is_filled_exactly_has_nothing_left(make: Maker) -> None:
    needed_us = busplan.timeline(make()).required_us
    for rounding in (-5e-13, 0.0, 5e-13):
        plan = busplan.timeline(make(cycle__period_us=needed_us * 2 * (1 + rounding)))
        assert plan.figures.fits
        assert plan.cycle_events[-1].kind == "subaction_gap"
    assert busplan.timeline(make(cycle__period_us=needed_us * 2 * (1 + 5e-12))).events[-1].kind == "idle"


def test_what_takes_no_time_is_no_event(make: Maker) -> None:
    profile = make(cycle__sync={"ping_us": 0.0, "ping_per_node_us": 0.0}, node__execution__base_us=0.0)
    assert busplan.timeline(profile, timing_model="paper").events[0].kind == "arbitration"
    kinds = {one.kind for one in busplan.timeline(make(bus__cycle_master=False)).events}
    assert not kinds & {"cycle_start", "hold", "worst_extra", "allowance", "host", "retry", "nonperiodic"}
    assert busplan.timeline(make(cycle__nonperiodic_us=7.5)).events[-2].kind == "nonperiodic"


def test_the_window_cuts_events_at_its_edges(make: Maker) -> None:
    plan = busplan.timeline(make())
    part = busplan.timeline(make(), from_us=10.0, to_us=100.0)
    assert (part.events[0].start_us, part.events[-1].end_us) == (10.0, 100.0)
    assert busplan.timeline(make(), to_us=1e6).events == plan.events
    assert (part.figures, part.cycle_events) == (plan.figures, plan.cycle_events)
    assert sum(one.duration_us for one in part.events) == pytest.approx(90.0)
    assert sum(one.share for one in part.totals) == pytest.approx(1.0)
    assert sum(one.events for one in part.totals) == len(part.events)


@pytest.mark.parametrize("kind", ["read", "write"])
def test_a_window_on_one_transaction_holds_it_alone(make: Maker, kind: str) -> None:
    profile = make(bus__nodes=3)
    part = busplan.timeline(profile, transaction=(kind, 2))
    whole = busplan.timeline(profile).events
    assert part.events == tuple(one for one in whole if (one.transaction, one.node) == (kind, 2))
    assert part.events
    cut = busplan.timeline(profile, transaction=(kind, 2), from_us=part.from_us + 1)
    assert (cut.from_us, cut.to_us) == (part.from_us + 1, part.to_us)


def test_totals_are_the_terms_of_the_closed_form(make: Maker) -> None:
    plan = busplan.timeline(make(bus__nodes=5, cycle__nonperiodic_us=12.0))
    found = {one.kind: one.total_us for one in plan.totals}
    closed = plan.figures.values()
    assert found["arbitration"] == pytest.approx(closed["cycle_arbitration_us"])
    assert found["request_data"] + found["response_data"] == pytest.approx(closed["cycle_data_us"])
    assert found["acknowledge"] == pytest.approx(closed["cycle_acknowledge_us"])
    assert found["execution"] == pytest.approx(closed["cycle_execution_us"])
    # Each node executes for longer than T_reset: what is left is one T_sub behind each response.
    assert "arbitration_reset_gap" not in found
    assert found["subaction_gap"] == pytest.approx(closed["cycle_idle_us"])
    assert found["subaction_gap"] == pytest.approx(10 * 1037 / 98.304)
    assert (found["sync"], found["nonperiodic"]) == pytest.approx((closed["sync_us"], 12.0))
    assert found["idle"] == pytest.approx(closed["margin_us"])


@pytest.mark.parametrize(
    ("window", "message"),
    [
        ({"from_us": 2000.0}, "the window from 2000 us shows nothing: the cycle runs from 0 to 2000 us"),
        ({"from_us": 5.0, "to_us": 5.0}, "the window from 5 us to 5 us shows nothing"),
        ({"transaction": ("read", 2), "to_us": 1.0}, "to 1 us shows nothing: the read of node 2 runs from "),
        ({"transaction": ("read", 3)}, "read:3: expected read or write and a node from 1 to 2, as read:1 or write:2"),
    ],
)
def test_an_empty_window_is_refused(make: Maker, window: dict[str, Any], message: str) -> None:
    with pytest.raises(BusplanError, match=message):
        busplan.timeline(make(), **window)


def test_a_million_nodes_are_refused(make: Maker) -> None:
    assert len(busplan.timeline(make(bus__nodes=MOST_NODES, bus__max_hops=3)).events) > 16 * MOST_NODES
    with pytest.raises(BusplanError, match="1000000: a timeline shows up to 1000 nodes; one bus carries 62"):
        busplan.timeline(make(bus__nodes=1_000_000))
