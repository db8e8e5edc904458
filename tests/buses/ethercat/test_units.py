"""Groups at several rates against all cycles of their common multiple, each written byte by byte."""

from collections.abc import Sequence
from itertools import accumulate, product
from math import lcm
from statistics import fmean
from typing import Any, Final

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.errors import BusplanError
from busplan.questions.fit.network import network_of
from tests.oracles.ethercat_recording import first_cycles
from tests.registers import at_least

BYTE_US: Final = 0.08
E_BUS_US: Final = 2 * 0.1507
EXECUTION: Final = {"kind": "linear", "grade": "measured", "base_us": 40.0, "per_byte_us": 0.0}
Rated = tuple[int, int, int, int]
"""Rate, devices, inputs and outputs of a group."""


def profile(
    groups: Sequence[Rated], *, units: str = "spread", axes: int = 0, starts: Sequence[str] = (), **bus: Any
) -> busplan.Profile:
    return (
        kind_named("ethercat")
        .profile_model()
        .model_validate(
            {
                "schema_version": 1,
                "name": "press",
                "bus": {"kind": "ethercat", "master": "SOEM", "master_us": 20.0, "units": units, **bus},
                "cycle": {"period_us": 500.0},
                "group": [
                    {
                        "name": f"g{place}",
                        "nodes": nodes,
                        "every": every,
                        "read_bytes": read,
                        "write_bytes": write,
                        "axes": axes,
                        "port": "E-bus",
                        "execution": EXECUTION,
                        "starts": (starts[place] if starts else None) or None,
                    }
                    for place, (every, nodes, read, write) in enumerate(groups)
                ],
            }
        )
    )


def frames_of_cycle(
    groups: Sequence[Rated], first: Sequence[int], cycle: int, *, clocks: bool, starts: Sequence[str] = ()
) -> list[int]:
    """Bytes on the wire of each frame of a cycle: devices in their order, a new frame where the next has no room."""
    devices = [
        (read + write, what if number == 0 else "")
        for (every, nodes, read, write), start, what in zip(groups, first, starts or [""] * len(groups), strict=True)
        if (cycle - start) % every == 0
        for number in range(nodes)
    ]
    return frames_of_sizes([size for size, _ in devices], clocks=clocks, starts=[what for _, what in devices])


def frames_of_sizes(sizes: Sequence[int], *, clocks: bool = True, starts: Sequence[str] = ()) -> list[int]:
    """Bytes on the wire of each frame of devices in their order, some of which start a datagram or a frame."""
    held = 20 if clocks else 0
    has_data, frames = False, []
    for size, what in zip(sizes, starts or [""] * len(sizes), strict=True):
        more = size + 12 * (not has_data or what == "datagram")
        if held + more > 1538 - 40 or (has_data and what == "frame"):
            frames.append(held)
            held, more = 0, size + 12
        held, has_data = held + more, True
    return [max(84, 40 + frame) for frame in (*frames, held) if frame]


def written_us(
    groups: Sequence[Rated], first: Sequence[int], *, clocks: bool, starts: Sequence[str] = ()
) -> list[float]:
    """What each cycle of the common multiple needs [us]."""
    way_us = 20 + E_BUS_US * sum(nodes for _, nodes, _, _ in groups)
    cycles = range(lcm(*(every for every, *_ in groups)))
    return [
        way_us + BYTE_US * sum(frames_of_cycle(groups, first, cycle, clocks=clocks, starts=starts)) for cycle in cycles
    ]


def placed(groups: Sequence[Rated], units: str) -> list[int]:
    """First cycle of each group, from 0, as the emulated master places them."""
    sizes = [nodes * (read + write) for _, nodes, read, write in groups]
    return first_cycles([{"every": every} for every, *_ in groups], sizes, is_spread=units == "spread")


def seen(groups: Sequence[Rated], units: str = "spread") -> list[int]:
    """First cycle of each group, from 0, as a timeline lists the cycles."""
    cycles = busplan.timeline(profile(groups, units=units)).to_dict()["distinct_cycles"]
    names = [f"g{place}" for place in range(len(groups))]
    return [
        min(number for cycle in cycles if name in cycle["groups"] for number in cycle["numbers"]) - 1 for name in names
    ]


def deciding(plan: busplan.Profile) -> Any:
    return busplan.capacity(plan, timing_model=["last-byte"]).results[0]


GROUPS = st.lists(
    st.tuples(st.sampled_from([1, 1, 2, 3, 4, 6]), st.integers(1, 40), st.integers(1, 300), st.integers(0, 300)),
    min_size=1,
    max_size=5,
)
STARTS = st.sampled_from(["", "", "datagram", "frame"])


@pytest.mark.parametrize(("starts", "more_us"), [("datagram", 12 * BYTE_US), ("frame", (40 + 12) * BYTE_US)])
def test_a_domain_costs_a_header_and_a_task_a_frame_of_groups_that_are_alike_too(starts: str, more_us: float) -> None:
    groups = [(1, 10, 12, 12)] * 3
    one, each = (deciding(profile(groups, starts=what)).required_us for what in (["", "", ""], ["", starts, starts]))
    assert each - one == pytest.approx(2 * more_us, rel=1e-9)
    # What begins with the first group begins there anyway.
    assert deciding(profile(groups, starts=[starts, "", ""])).required_us == one


@pytest.mark.parametrize(("size", "frames"), [(474, 1), (475, 2)])
def test_the_header_of_a_domain_takes_room_of_the_frame(size: int, frames: int) -> None:
    # 1486 bytes of data with one header; the second header takes 12 of them.
    plan = profile([(1, 1, 1000, 0), (1, 1, size, 0)], starts=["", "datagram"])
    result = deciding(plan)
    assert result.own.frames == frames
    drawn_us = sum(event.duration_us for event in busplan.timeline(plan).cycle_events if event.term)
    assert drawn_us == pytest.approx(result.required_us, rel=1e-12)


@settings(max_examples=at_least(7, 60))
@given(GROUPS, st.sampled_from(["spread", "together"]), st.booleans(), st.lists(STARTS, min_size=5, max_size=5))
def test_the_verdict_is_that_of_the_fullest_cycle_and_the_load_that_of_the_mean(
    groups: list[Rated], units: str, clocks: bool, starts: list[str]
) -> None:
    starts = starts[: len(groups)]
    plan = profile(groups, units=units, distributed_clocks=clocks, starts=starts)
    each_us = written_us(groups, placed(groups, units), clocks=clocks, starts=starts)
    result = deciding(plan)
    assert result.required_us == pytest.approx(max(each_us), rel=1e-12)
    assert result.own.mean_utilisation == pytest.approx(fmean(each_us) / 500, rel=1e-12)
    events = busplan.timeline(plan).cycle_events
    assert sum(event.duration_us for event in events if event.term) == pytest.approx(result.required_us, rel=1e-12)


def moved_us(groups: Sequence[Rated], first: Sequence[int], watched: int) -> float:
    """How far the ends of a device's frame lie apart, the most of any of a group [us]: every cycle written out."""
    ends: dict[int, list[float]] = {}
    for cycle in range(lcm(*(every for every, *_ in groups))):
        devices, sizes = [], []
        for place, ((every, nodes, read, write), start) in enumerate(zip(groups, first, strict=True)):
            if (cycle - start) % every == 0:
                devices += [place * 1000 + number for number in range(nodes)]
                sizes += [read + write] * nodes
        for count, device in enumerate(devices):
            if device // 1000 == watched:
                # Devices behind it may fill its frame up, but need not: the frames of all, less those begun behind it.
                before = frames_of_sizes(sizes[: count + 1])
                ends.setdefault(device, []).append(BYTE_US * sum(frames_of_sizes(sizes)[: len(before)]))
    return max(max(each) - min(each) for each in ends.values())


@pytest.mark.slow
@settings(max_examples=at_least(15))
@given(GROUPS, st.sampled_from(["spread", "together"]), st.data())
def test_a_frame_moves_against_sync0_as_units_make_it_longer(
    groups: list[Rated], units: str, data: st.DataObject
) -> None:
    watched = data.draw(st.integers(0, len(groups) - 1))
    us = moved_us(groups, placed(groups, units), watched)
    assume(us + 11 < profile(groups).cycle.period_us)  # a window is within a period

    def verdict(window_us: float, jitter_us: float = 0.0, **bus: Any) -> str:
        plan = profile(groups, units=units, master_jitter_us=jitter_us, **{"distributed_clocks": True, **bus})
        own = deciding(busplan.load_profile(plan, changes={f"group.g{watched}.sync_window_us": window_us}))
        states = {"broken": own.exceeded, "not shown": own.not_shown or ()}
        return next((state for state, keys in states.items() if "sync_window" in keys), "kept")

    # The master's jitter adds to it; one that is not given may be any.
    for jitter_us in (0.5, 10):
        assert verdict(us + jitter_us + 1e-3, jitter_us) == "kept"
        assert verdict(us + jitter_us - 1e-3, jitter_us) == "broken"
    assert verdict(profile(groups).cycle.period_us) == "not shown"
    if us:
        assert verdict(us - 1e-3) == "broken"
    assert verdict(max(us / 2, 1e-3), distributed_clocks=False) == "kept"


@pytest.mark.parametrize(("window_us", "is_kept"), [(16.001, True), (15.999, False)])
def test_the_fullest_cycle_need_not_be_that_in_which_a_window_frame_ends_last(
    window_us: float, *, is_kept: bool
) -> None:
    # 1400 bytes do not fit behind the drive's 200 in a frame; in the other cycle 200 bytes more go before it.
    groups = [(2, 1, 100, 100), (1, 1, 100, 100), (2, 1, 1000, 400)]
    plan = busplan.load_profile(
        profile(groups, distributed_clocks=True, master_jitter_us=1e-6), changes={"group.g1.sync_window_us": window_us}
    )
    assert ("sync_window" not in deciding(plan).exceeded) == is_kept
    window = kind_named("ethercat").limit("sync_window")
    assert window is not None
    words = f"g1: frames move 16.0 us against SYNC0, and a drive allows {window_us:g} us: "
    allowed = "a jitter of 0.001 us is allowed" if is_kept else "no jitter is small enough"
    assert window.words(network_of(plan)) == words + allowed


@pytest.mark.slow
@settings(max_examples=at_least(5))
@given(GROUPS, st.sampled_from(["spread", "together"]), st.booleans())
def test_a_timeline_draws_each_cycle_of_the_common_multiple(groups: list[Rated], units: str, clocks: bool) -> None:
    plan, first = profile(groups, units=units, distributed_clocks=clocks), placed(groups, units)
    ends = [*accumulate(nodes for _, nodes, _, _ in groups)]
    for cycle, us in enumerate(written_us(groups, first, clocks=clocks)):
        drawn = busplan.timeline(plan, timing_model="last-byte", cycle=cycle + 1)
        assert drawn.required_us == pytest.approx(us, rel=1e-12)
        assert sum(event.duration_us for event in drawn.cycle_events if event.term) == pytest.approx(us, rel=1e-12)
        due = [(cycle - start) % every == 0 for (every, *_), start in zip(groups, first, strict=True)]
        assert {event.node for event in drawn.cycle_events if event.kind == "data"} == {
            device
            for end, (_, nodes, *_), is_due in zip(ends, groups, due, strict=True)
            for device in range(end - nodes + 1, end + 1)
            if is_due
        }
        (alike,) = (alike for alike in drawn.to_dict()["distinct_cycles"] if cycle + 1 in alike["numbers"])
        assert alike["groups"] == [f"g{place}" for place, is_due in enumerate(due) if is_due]
        assert alike["required_us"] == drawn.required_us
    whole = busplan.timeline(plan)
    assert whole.cycle_events == busplan.timeline(plan, cycle=whole.to_dict()["cycle"]).cycle_events


@settings(max_examples=at_least(5, 40))
@given(GROUPS)
def test_together_the_fullest_cycle_is_that_without_rates(groups: list[Rated]) -> None:
    without = deciding(profile([(1, nodes, read, write) for _, nodes, read, write in groups]))
    result = deciding(profile(groups, units="together"))
    assert result.required_us == pytest.approx(without.required_us, rel=1e-12)
    assert result.own.process_bytes == without.own.process_bytes
    assert result.uncertainty_us == pytest.approx(without.uncertainty_us, rel=1e-12)


def test_the_fullest_cycle_has_its_number() -> None:
    whole = busplan.timeline(profile([(2, 1, 100, 0), (4, 1, 90, 0), (4, 1, 60, 0), (4, 1, 50, 0)]))
    assert whole.to_dict()["cycle"] == 4
    assert {event.node for event in whole.events if event.kind == "data"} == {3, 4}


def test_a_cycle_without_process_data_sends_no_frame() -> None:
    plan = profile([(2, 1, 100, 0)])
    last_byte, vendors = (busplan.timeline(plan, timing_model=model, cycle=2) for model in ("last-byte", "vendors"))
    assert {event.kind for event in vendors.cycle_events} == {"master", "device", "idle"}
    assert vendors.required_us == last_byte.required_us == 20 + E_BUS_US
    (result,) = busplan.capacity(plan, timing_model=["vendors"]).results
    assert busplan.EthercatFigures.of(result).mean_utilisation == pytest.approx(
        (result.required_us + vendors.required_us) / 2 / 500
    )


def test_a_cycle_without_process_data_has_the_masters_datagrams_alone() -> None:
    # NOP 4, APWR 4, BRD 2 and ARMW 4, 12 bytes each beside their data, and 40 of the frame.
    plan = profile([(2, 1, 100, 0)], master="acontis", distributed_clocks=True)
    filled_us, empty_us = (busplan.timeline(plan, timing_model="last-byte", cycle=cycle) for cycle in (1, 2))
    assert filled_us.required_us == pytest.approx(20 + E_BUS_US + (40 + 62 + 12 + 100) * BYTE_US)
    assert empty_us.required_us == pytest.approx(20 + E_BUS_US + (40 + 62) * BYTE_US)
    drawn_us = sum(event.duration_us for event in empty_us.cycle_events if event.term)
    assert drawn_us == pytest.approx(empty_us.required_us)
    mean_us = (filled_us.required_us + empty_us.required_us) / 2
    assert deciding(plan).own.mean_utilisation == pytest.approx(mean_us / 500)


@given(st.lists(st.integers(1, 100), min_size=2, max_size=5), st.integers(2, 4))
def test_units_of_one_rate_are_spread_within_a_third_of_the_most_even(sizes: list[int], every: int) -> None:
    def fullest(first: Sequence[int]) -> int:
        return max(
            sum(size for size, plan in zip(sizes, first, strict=True) if plan == cycle) for cycle in range(every)
        )

    best = min(map(fullest, product(range(every), repeat=len(sizes))))
    assert best <= fullest(seen([(every, 1, size, 0) for size in sizes])) <= best * 4 / 3


def test_units_of_several_rates_find_the_gaps_of_each_other() -> None:
    faster_last = [(4, 1, 8, 0), (4, 1, 8, 0), (2, 1, 6, 0), (1, 1, 5, 0)]
    assert seen(faster_last) == [1, 3, 0, 0]
    assert seen(faster_last, "together") == [0, 0, 0, 0]
    # The last one goes where no cycle gets over 11, although there are more bytes in those cycles together.
    assert seen([(2, 1, 6, 0), (4, 1, 10, 0), (4, 1, 1, 0), (6, 1, 5, 0)]) == [0, 1, 3, 0]


def test_a_rate_of_1_is_what_no_rate_is() -> None:
    groups = [(1, 8, 20, 12), (1, 3, 60, 0)]
    plan = profile(groups, distributed_clocks=True)
    data = plan.model_dump(exclude_unset=True)
    for group in data["group"]:
        del group["every"]
    del data["bus"]["units"]
    assert deciding(plan).by_key() == deciding(kind_named("ethercat").profile_model().model_validate(data)).by_key()
    assert deciding(plan).own.mean_utilisation == deciding(plan).utilisation


def test_neighbours_with_the_same_keys_have_cycles_of_their_own() -> None:
    assert deciding(profile([(2, 20, 60, 0), (2, 20, 60, 0)])).own.process_bytes == 20 * 60


@pytest.mark.slow
def test_a_sweep_has_what_each_profile_has() -> None:
    plan = profile([(1, 4, 20, 12), (2, 10, 60, 0), (4, 8, 90, 30), (4, 5, 33, 0)], distributed_clocks=True)
    keys = ("group.g1.every", "group.g2.nodes", "group.g3.read_bytes")
    values: dict[str, list[Any]] = {keys[0]: [1, 2, 4, 6], keys[1]: [1, 30, 60], keys[2]: [0, 33, 300]}
    swept = busplan.sweep(plan, vary=values, timing_model=["last-byte", "vendors"])
    rows = [dict(zip(swept, row, strict=True)) for row in zip(*(swept[name].tolist() for name in swept), strict=True)]
    assert len(rows) == 2 * 4 * 3 * 3
    for row in rows[::5]:
        at = busplan.load_profile(plan, changes={key: row[key] for key in keys})
        (alone,) = busplan.capacity(at, timing_model=[row["timing_model"]]).results
        for key in ("required_us", "mean_utilisation", "frames", "process_bytes", "command_us", "utilisation"):
            assert row[key] == pytest.approx(alone.values()[key], rel=1e-12), key


def test_a_node_of_a_slower_group_has_its_own_period_to_finish_in() -> None:
    slow: dict[str, object] = {"group.g1.execution.base_us": 700.0}
    assert deciding(busplan.load_profile(profile([(1, 4, 20, 12), (3, 4, 20, 12)]), changes=slow)).fits
    assert "node" in deciding(busplan.load_profile(profile([(1, 4, 20, 12), (2, 4, 20, 12)]), changes=slow)).exceeded


def test_latencies_of_a_slower_group_are_of_its_own_period() -> None:
    both = busplan.latency(profile([(1, 4, 20, 12), (4, 4, 20, 12)]), timing_model=["last-byte"]).transactions
    by_name = {(latency.group, latency.transaction): latency.phases for latency in both}
    assert by_name["g0", "command"]["pipeline_us"] == 500
    assert by_name["g1", "command"]["pipeline_us"] == 2000
    assert by_name["g1", "feedback"]["frame_wait_us"] == 2000 - 40


def test_rates_that_meet_too_seldom_are_refused() -> None:
    with pytest.raises(
        BusplanError, match="repeat together only after 999000 cycles; busplan computes at most 1000"
    ) as refused:
        busplan.load_profile(
            profile([(1, 4, 20, 12), (1, 4, 20, 12)]), changes={"group.g0.every": 999, "group.g1.every": 1000}
        )
    assert "group.g1.every" in str(refused.value)


@pytest.mark.parametrize(
    ("groups", "most", "words"),
    [(100, 40, "40 of 100 groups"), (138, 2, "2 of 138 groups"), (139, 1, "138 groups at")],
)
def test_of_many_groups_only_a_short_hyperperiod_is_computed(groups: int, most: int, words: str) -> None:
    many = profile([(1, 1, 20 + number % 2, 12) for number in range(groups)])
    assert busplan.load_profile(many, changes={"group.g1.every": most})
    with pytest.raises(BusplanError, match=f"only after {most + 1} cycles; busplan computes at most {words}"):
        busplan.load_profile(many, changes={"group.g1.every": most + 1})


def test_a_circle_needs_axes_in_every_cycle() -> None:
    plan = profile([(1, 4, 20, 12), (2, 4, 20, 12)], axes=1, distributed_clocks=True)
    circle = busplan.load_profile(plan, changes={"circle.radius_mm": 10.0})
    assert busplan.circle_test(circle).results
    with pytest.raises(BusplanError, match=r"group\.g0\.every"):
        busplan.circle_test(busplan.load_profile(circle, changes={"group.g0.every": 2}))
    assert deciding(busplan.load_profile(circle, changes={"group.g0.every": 2})).verdict == "fits"
    # Axes without commands have no set-points.
    with pytest.raises(BusplanError, match=r"group\.g1\.every"):
        busplan.circle_test(busplan.load_profile(circle, changes={"group.g0.write_bytes": 0, "group.g1.axes": 1}))


def test_a_drive_may_work_as_long_as_its_own_cycles() -> None:
    """Before SYNC0 and behind it: 2 x 300 us are over 500 us, and under two cycles."""
    plan = profile([(1, 4, 20, 12), (2, 4, 20, 12)], axes=1, distributed_clocks=True, sync_shift=0.0)
    for group, exceeds in (("g0", True), ("g1", False)):
        slow = busplan.load_profile(plan, changes={f"group.{group}.execution.base_us": 300.0})
        assert ("node" in deciding(slow).exceeded) == exceeds
    both = busplan.load_profile(plan, changes={f"group.{group}.execution.base_us": 300.0 for group in ("g0", "g1")})
    (line,) = (line for line in str(busplan.capacity(both)).splitlines() if "  limit  " in line)
    assert line.endswith("  g0: a node's execution takes 600.0 +/- 0.1 us of its 500.0 us")


def test_terminals_without_data_and_axes_without_a_byte_are_a_group() -> None:
    assert deciding(profile([(1, 4, 20, 12), (1, 3, 0, 0)])).verdict == "fits"


def test_the_largest_device_counts_whatever_its_cycle() -> None:
    assert "payload" in deciding(profile([(1, 9, 400, 0), (2, 1, 1487, 0), (2, 9, 400, 0)])).exceeded


def test_the_timeline_lists_the_cycles_of_the_common_multiple() -> None:
    plan = profile([(1, 1, 100, 0), (2, 1, 400, 0), (2, 1, 200, 0)])
    us = [20 + 3 * E_BUS_US + BYTE_US * (52 + size) for size in (500, 300)]
    words = "The groups meet every 2 cycles; this is the fullest. "
    assert f"{words}Cycles 1: g0, g1 ({us[0]:.3f} us); 2: g0, g2 ({us[1]:.3f} us).\n" in str(busplan.timeline(plan))
    many = str(busplan.timeline(busplan.load_profile(plan, changes={"group.g1.every": 65})))
    assert "every 130 cycles; this is the fullest. More than 64 cycles are not listed.\n" in many
    assert "cycles" not in str(busplan.timeline(profile([(1, 1, 100, 0)])))
    _, vendors = busplan.capacity(plan).results
    assert f"({vendors.required_us:.3f} us)" in str(busplan.timeline(plan, timing_model="vendors"))
