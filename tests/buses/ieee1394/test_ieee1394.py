"""The standard's figures against their public sources."""

from functools import cache
from math import ceil, fsum, sqrt
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.ieee1394 import constants as ieee1394
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.network import network_of


def test_gap_count_table_follows_from_cable_and_phy_delay() -> None:
    for hops in range(1, 24):
        # 2 (4.5 m at 5.05 ns/m + 144 ns) in base-rate ticks, through both gap conditions; 58 and -16 are fitted.
        ticks = 2 * (4.5 * 5.05e-3 + 0.144) * 98.304 * hops
        assert ieee1394.safe_gap_count(hops) == max(ceil((ticks + 58) / 20), ceil((ticks - 16) / 12))


def test_gap_count_beyond_the_table_is_the_power_up_value() -> None:
    assert [ieee1394.safe_gap_count(hops) for hops in (23, 24, 62, 1000)] == [62, 63, 63, 63]


@given(st.integers(1, 100))
def test_gap_count_never_shrinks_with_hops(hops: int) -> None:
    assert ieee1394.safe_gap_count(hops) <= ieee1394.safe_gap_count(hops + 1) <= ieee1394.MAX_GAP_COUNT


@pytest.mark.parametrize("hops", [0, -1])
def test_a_bus_without_hops_is_an_error(hops: int) -> None:
    with pytest.raises(ValueError, match=f"got {hops}"):
        ieee1394.safe_gap_count(hops)


def test_rates_and_limits_by_speed() -> None:
    speeds = [f"S{100 * 2**power}" for power in range(6)]
    assert dict(ieee1394.c.by_key("DATA_RATE_MBIT_S")) == {
        speed: 98.304 * 2**power for power, speed in enumerate(speeds)
    }
    assert dict(ieee1394.c.by_key("MAX_PAYLOAD_BYTES")) == {speed: 512 * 2**power for power, speed in enumerate(speeds)}
    assert (ieee1394.c.MAX_NODES, ieee1394.c.MAX_HOPS) == (62.0, 16.0)


@given(st.integers(0, 5000))
def test_padding_fills_the_last_quadlet(payload_bytes: int) -> None:
    padded = int(ieee1394.padded_bytes(payload_bytes))
    assert padded % 4 == 0
    assert 0 <= padded - payload_bytes < 4


def test_what_no_opened_source_confirms_is_called_so() -> None:
    constants = kind_named("ieee1394").constants.values()
    recalled = {number for number in constants if number.grade == "recalled"}
    # The likeliest readings of two constants of the paper, and the largest packets from S800 on.
    assert recalled == {1.63, 0.25, 4096, 8192, 16384}


@cache
def published() -> list[Any]:
    """Every published figure beside the computed one."""
    (kind,) = busplan.evidence("ieee1394").kinds
    return [comparison for section in kind.sections for comparison in section.comparisons]


def test_published_machines_fit_their_periods() -> None:
    comparisons = [comparison for comparison in published() if "axes of a" in comparison.section]
    periods_us = [(comparison.quantity, comparison.published) for comparison in comparisons[::2]]
    assert periods_us == [("4 axes", 250), ("8 axes", 500)]
    assert all(0 < comparison.computed < (comparison.published or 0.0) for comparison in comparisons)


def test_a_command_that_is_executed_beside_the_bus_counts_as_it_is_executed() -> None:
    host = {"servo.loop": "host", "cycle.period_us": 1000.0, "servo.step_us": 100.0, "circle.radius_mm": 1.0}

    def delay_us(update: str, **changes: object) -> float:
        changed = {**host, "servo.update": update, **{key.replace("__", "."): us for key, us in changes.items()}}
        (circle,) = busplan.circle_test(busplan.load_profile("paper-two-node", changes=changed)).results
        return circle.delay_us

    assert delay_us("next_sync") == delay_us("next_sync", node__write_response="unified") == 1000
    # A unified write is acknowledged at once, and the node takes 36.8 us for it then.
    slower_us = delay_us("on_arrival", node__write_response="unified", node__execution__worst_extra_us=100.0)
    assert slower_us - delay_us("on_arrival", node__write_response="unified") == pytest.approx(100 + 100, abs=1e-9)
    extra: dict[str, object] = {"node__execution__worst_extra_us": 900.0}
    assert delay_us("next_sync", node__read_response="concatenated", node__write_response="unified", **extra) == 2000


def test_the_doubt_of_the_gap_term_is_as_large_at_a_larger_gap_count_as_at_a_smaller() -> None:
    def doubt_us(measured: int, gap_count: int) -> float:
        fitted = {"node.execution.residual": "standard", "node.execution.measured_gap_count": measured}
        bench = busplan.load_profile("paper-two-node", changes={**fitted, "bus.gap_count": gap_count})
        (figures,) = busplan.capacity(bench, timing_model="standard").results
        (us,) = (float(doubt.us) for doubt in figures.doubts if doubt.key == "gap_term")
        return us

    # Four halves of split transactions, each with half of the 4 / 98.304 us that a gap count adds to equation (4).
    by_hand_us = 4 * 2 * 58 / 98.304 / sqrt(3)
    assert doubt_us(63, 5) == doubt_us(5, 63) == pytest.approx(by_hand_us)


@pytest.mark.parametrize(
    ("read", "write", "halves", "phys"),
    # A half is a packet with its acknowledge. A PHY delays a packet by its arbitration, its data and its acknowledge:
    # a split transaction six times, a concatenated one without the second arbitration, a unified one three times.
    [("split", "split", 4, 12), ("concatenated", "unified", 3, 8), ("split", "unified", 3, 9)],
)
def test_bias_and_doubts_of_a_cycle_by_hand(read: str, write: str, halves: int, phys: int) -> None:
    answers = {"node.read_response": read, "node.write_response": write}
    bench = busplan.load_profile("paper-1ms", changes={**answers, "bus.gap_count": 33, "cycle.retries": 2})
    (figures,) = busplan.capacity(bench, timing_model="standard").results
    # Two nodes two hops away, and the retries; 0.827 us a half, by Table I, and half of the gap term, 4 ticks a count.
    halves = 2 * halves + 2
    gap_term_us = 2 * (63 - 33) / 98.304
    assert figures.bias_us == pytest.approx(halves * (0.827025 + gap_term_us), abs=1e-5)
    doubts = {doubt.key: doubt.us for doubt in figures.doubts}
    # Of eight payloads of Table I, 0.258 us; the synchronous packet has no acknowledge.
    assert doubts["residual"] == pytest.approx(halves * 0.2580614, abs=1e-5)
    assert doubts["gap_term"] == pytest.approx(halves * gap_term_us / sqrt(3))
    assert doubts["bus.phy_delay_us"] == pytest.approx((2 * phys + 2 * 3 + 2) * 2 * 0.02 / sqrt(3))


def test_the_longest_latency_is_that_of_the_farthest_node() -> None:
    def figures(charge_hops: str) -> Any:
        changes = {"bus.nodes": 5, "node.read_response": "concatenated", "bus.charge_hops": charge_hops}
        return (
            busplan.capacity(busplan.load_profile("paper-1ms", changes=changes), timing_model="standard").results[0].own
        )

    # The fifth node has as many hops of its own as all are charged where the farthest counts.
    farthest, own = figures("farthest"), figures("own")
    for key in ("read_latency_us", "write_latency_us", "read_transaction_us", "write_latency_with_gaps_us"):
        assert getattr(own, key) == pytest.approx(getattr(farthest, key))
    # Two packets and two acknowledges of a read go over 3 hops on average, and not over 5.
    assert farthest.reads_us - own.reads_us == pytest.approx(5 * 4 * 2 * (0.023 + 14 / 98.304))


def test_equation_11_is_for_nodes_that_are_alike_and_read_and_written() -> None:
    def nodes(name: str, **changes: int) -> Any:
        keys = {f"payload.{key}": size for key, size in changes.items()}
        return busplan.capacity(busplan.load_profile(name, changes=keys), timing_model="standard").results[0].own

    # (alpha T_s - CTS) over a read and a write with both gaps behind each; alpha is a half.
    one, sync_us = nodes("paper-1ms", read_bytes=16, write_bytes=64), nodes("paper-1ms").sync_us
    pair_us = one.read_latency_with_gaps_us + one.write_latency_with_gaps_us
    assert one.nodes_eq11 == pytest.approx((500 - sync_us) / pair_us)
    assert [nodes("paper-1ms", **{way: 0}).nodes_eq11 for way in ("read_bytes", "write_bytes")] == [None, None]
    assert nodes("gantry-24").nodes_eq11 is None


@pytest.mark.parametrize(
    ("name", "model"),
    [("paper-4ms", "paper"), ("paper-4ms", "standard"), ("gantry-24", "standard"), ("dvrk", "standard")],
)
@pytest.mark.parametrize("changes", [{}, {"cycle.retries": 2, "bus.cycle_master": True}])
def test_equation_2_sums_all_that_the_cycle_needs(name: str, model: str, changes: dict[str, object]) -> None:
    changes = {} if model == "paper" else changes
    profile = busplan.load_profile(name, changes={**changes, "cycle.nonperiodic_us": 17.0})
    (figures,) = busplan.capacity(profile, timing_model=model).to_dict()["results"]
    beside_us = figures["cycle_starts_us"] + figures["retries_us"]
    parts_us = figures["reads_us"] + figures["writes_us"] + 17.0 + figures["sync_us"] + beside_us
    assert figures["required_time_slice_us"] * figures["nodes"] == pytest.approx(parts_us, rel=1e-13)
    assert parts_us == pytest.approx(figures["required_us"], rel=1e-13)


def test_a_gap_count_has_no_relative_change_and_other_numbers_have_one() -> None:
    plan = busplan.load_profile("paper-1ms", changes={"bus.gap_count": 7, "bus.max_hops": 3})
    for one in busplan.diff("paper-1ms", plan).figures:
        if one.difference is not None and one.a:
            relative = None if one.figure.key in ("gap_count", "safe_gap_count") else one.difference / one.a
            assert one.relative_difference == relative, one.figure.key


def test_only_broadcasts_are_collected_in_blocks() -> None:
    # 20 nodes of 128 bytes: a hub holds 16, and a packet of S400 2048 bytes.
    many = {"bus.nodes": 20, "bus.max_hops": 6, "cycle.period_us": 20_000.0}
    many |= {"payload.read_bytes": 128, "payload.write_bytes": 128}
    for schedule, exceeded in {
        "individual": (),
        "broadcast": ("broadcasting nodes", "hub block", "write block"),
    }.items():
        plan = busplan.load_profile("paper-1ms", changes={**many, "cycle.schedule": schedule})
        assert busplan.capacity(plan).results[0].exceeded == exceeded


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        ("paper-1ms", {"bus.nodes": 17}, ("BP107", "bus.nodes")),
        ("paper-1ms", {"bus.nodes": 63, "bus.max_hops": 6}, ("BP106", "bus.nodes")),
        ("gantry-24", {"group.drives.nodes": 17}, ("BP107", "group.io.nodes")),
        (
            "gantry-24",
            {"group.drives.nodes": 63, "bus.max_hops": 6, "bus.charge_hops": "farthest"},
            ("BP106", "group.io.nodes"),
        ),
        ("paper-1ms", {"bus.max_hops": 17}, ("BP107", "bus.max_hops")),
    ],
)
def test_what_is_too_many_is_said_at_the_key_of_the_last_nodes(
    name: str, changes: dict[str, object], expected: tuple[str, str]
) -> None:
    found = busplan.check(busplan.load_profile(name, changes=changes), circle=False).findings
    assert [(one.finding.code, one.finding.key) for one in found if one.finding.code in ("BP106", "BP107")] == [
        expected
    ]


@pytest.mark.parametrize("nodes", [2, 6])
def test_a_cycle_start_goes_between_the_first_rounds_that_are_due_after_it(nodes: int) -> None:
    changes = {"bus.cycle_master": True, "bus.nodes": nodes}
    cycle: Any = deciding_cycle(network_of(busplan.load_profile("paper-1ms", changes=changes)))
    now_us, before_us, starts = 0.0, -1.0, 0
    for each in map(list, cycle.each_round()):
        is_start = each[0].kind == "cycle_start"
        due_us = 125.0 * starts
        assert is_start or now_us < due_us or starts == cycle.number_of_starts
        assert not is_start or now_us >= due_us > before_us
        starts, before_us = starts + is_start, before_us if is_start else now_us
        now_us += fsum(event.us for event in each)
    assert starts == cycle.number_of_starts > 2


def test_the_gap_count_table_is_met_by_both_methods() -> None:
    methods = ("table of busplan", "delays at the base rate")
    met = {row.method: (row.published, row.computed) for row in published() if row.method in methods}
    assert met == dict.fromkeys(methods, (23, 23))


def test_the_constant_of_equation_15_is_a_sum_of_rounded_terms() -> None:
    (constant,) = (row for row in published() if row.method == "terms rounded first")
    assert constant.published == 3.11
    assert constant.computed == pytest.approx(3.11, abs=1e-9)


@pytest.mark.parametrize("period_us", [250.0, 540.0])
def test_a_finding_has_the_margin_of_capacity(period_us: float) -> None:
    plan = busplan.load_profile("paper-1ms", changes={"cycle.period_us": period_us})
    deciding = busplan.capacity(plan).results[0]
    margin = f"corrected margin {deciding.margin_corrected_us:.1f} +/- {deciding.uncertainty_us:.1f} us"
    assert any(margin in one.finding.message for one in busplan.check(plan, circle=False).findings)


@pytest.mark.parametrize("charge_hops", ["farthest", "own"])
def test_events_of_all_nodes_add_up_to_the_cycle(charge_hops: str) -> None:
    changes = {"bus.nodes": 5, "bus.charge_hops": charge_hops}
    cycle = deciding_cycle(network_of(busplan.load_profile("paper-1ms", changes=changes)))
    assert fsum(event.us for event in cycle.events()) == pytest.approx(cycle.required_us)


@pytest.mark.parametrize(("nodes", "sync_us"), [(1, 0.3), (4, 0.6)])
def test_the_papers_packet_that_opens_the_cycle_takes_a_ping_and_more_for_each_other_node(
    nodes: int, sync_us: float
) -> None:
    (paper,) = busplan.capacity(
        busplan.load_profile("paper-4ms", changes={"bus.nodes": nodes}), timing_model="paper"
    ).results
    assert paper.values()["sync_us"] == pytest.approx(sync_us)
