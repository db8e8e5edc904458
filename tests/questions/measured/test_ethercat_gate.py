"""What an EtherCAT machine does wrong is an error of `check --recording`, and what a capture cannot show is said."""

import tomllib
from dataclasses import replace
from math import hypot
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from tests.oracles.ethercat_recording import (
    FRMW,
    LRD,
    LRW,
    Datagrams,
    Machine,
    ethernet,
    pcapng,
    planned,
    simulated,
    start_up,
    starts_and_hosts,
    statistics,
)
from tests.registers import at_least

Packets = list[tuple[float, bytes]]
BUS = """schema_version = 1
name = "machine"
[bus]
kind = "ethercat"
master = "SOEM"
distributed_clocks = true
master_us = 25
master_grade = "measured"
master_uncertainty_us = 0.1
master_jitter_us = 10
[cycle]
period_us = 1000
"""
GROUP = """[[group]]
name = "{name}"
nodes = {nodes}
axes = 0
read_bytes = {size}
write_bytes = {size}
every = {every}
node.delay_us = 0.698
"""


def plan_of(*groups: tuple[int, int, int], more: str = "") -> str:
    """Number of devices, bytes of each way and rate of each group."""
    text = BUS + more
    for place, (nodes, size, every) in enumerate(groups):
        text += GROUP.format(name=f"g{place}", nodes=nodes, size=size, every=every).replace("node.", "")
    return text


def cycle(size: int) -> tuple[Datagrams, ...]:
    """A cycle of one frame with process data."""
    return (((LRW, 0x10000, size), (FRMW, 0, 8)),) if size else ()


TWO = plan_of((4, 8, 2), (4, 8, 2))
"""Two units of 64 bytes, each in every second cycle."""
FOUR = plan_of((4, 8, 1), (2, 5, 2), (2, 10, 2))
"""The fullest cycle has 104 bytes, the other 84."""
QUARTERS = plan_of((2, 4, 1), (2, 30, 4))
"""16 bytes in each cycle, 120 more in one of four."""
PLAIN = plan_of((8, 8, 1))
MACHINE = Machine(
    jitter_us=10,
    host_us=22.0,
    host_spread_us=2.9,
    devices=8,
    counters=(),
    hop_us=0.698,
    schedule=(cycle(104), cycle(84)),
)
SHORT_LINE = replace(MACHINE, devices=4)


def judged(
    packets: Packets, folder: Path, *, plan: str = FOUR, more: bytes = b"", **options: Any
) -> tuple[busplan.MeasuredAnswer, dict[str, str]]:
    """The answer, and the code of each BP40x of `check --recording` by its first words."""
    profile, capture = folder / "plan.toml", folder / "capture.pcapng"
    profile.write_text(plan)
    capture.write_bytes(pcapng(packets, **options) + more)
    answer = busplan.check(profile, recording=capture)
    findings = [finding for finding in answer.files[0].findings if finding.code.startswith("BP40")]
    assert answer.passed == (not any(finding.severity == "error" for finding in findings))
    words = {finding.problem.partition(": ")[2].removeprefix("not shown: "): finding.code for finding in findings}
    return busplan.measured(profile, capture), {text.partition(": ")[0]: code for text, code in words.items()}


def compared(packets: Packets, folder: Path, plan: str = FOUR) -> busplan.MeasuredAnswer:
    """The answer alone."""
    (folder / "capture.pcapng").write_bytes(pcapng(packets))
    (folder / "plan.toml").write_text(plan)
    return busplan.measured(folder / "plan.toml", folder / "capture.pcapng")


def recorded(answer: busplan.MeasuredAnswer, quantity: str) -> float | None:
    return next(figure.recorded for figure in answer.figures if figure.quantity == quantity)


def test_a_machine_within_its_plan_has_no_finding(tmp_path: Path) -> None:
    assert judged(simulated(MACHINE, 1000), tmp_path)[1] == {}


def test_cycles_without_a_frame_are_an_error_and_the_longest_run_is_said(tmp_path: Path) -> None:
    seldom = replace(MACHINE, skipped=frozenset(range(50, 2000, 100)))
    assert judged(simulated(seldom, 2000), tmp_path)[1] == {"cycles without a frame": "BP401"}
    allowed = FOUR + "[limits]\nmissed_cycles = 20\n"
    assert judged(simulated(seldom, 2000), tmp_path, plan=allowed)[1] == {}
    row = replace(MACHINE, skipped=frozenset(range(700, 1300)))
    answer, codes = judged(simulated(row, 2000), tmp_path)
    (figure,) = answer.outside
    assert (figure.recorded, figure.events) == (600, 2000)
    assert figure.note == "600 in a row, 0.601 s without set-points"
    assert codes == {"cycles without a frame": "BP401"}


def with_gaps(seed: int) -> tuple[str, Machine]:
    """A random plan with empty cycles and a machine that keeps it; most masters send nothing in an empty cycle."""
    random = Random(seed)
    master = random.choice(("TwinCAT", "TwinCAT", "SOEM", "IgH", "acontis"))
    rates = random.choice(((2,), (3, 6), (2, 3), (2, 4), (4, 6), (3, 3), (8, 4)))
    text = plan_of(*((random.randint(1, 6), random.randint(1, 9), every) for every in rates))
    text = text.replace('"SOEM"', f'"{master}"\nunits = "{random.choice(("spread", "together"))}"')
    machine = planned(tomllib.loads(text), seed=seed)
    if random.random() < 0.7:
        frames = zip(machine.schedule, machine.names, strict=True)
        machine.schedule = tuple(() if name == " with no group" else of_cycle for of_cycle, name in frames)
    return text, machine


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_empty_cycles_miss_nothing_wherever_a_capture_begins_and_others_do(seed: int, tmp_path: Path) -> None:
    plan, machine = with_gaps(seed)
    turns = len(machine.schedule)
    filled = [cycle for cycle in range(60, 60 + turns) if machine.names[cycle % turns] != " with no group"]
    for start in range(turns):
        for skipped in (frozenset[int](), frozenset({filled[start % len(filled)]})):
            sent = simulated(replace(machine, skipped=skipped), 150 + start)
            answer, codes = judged(
                [packet for packet in sent if packet[0] >= start * machine.period_us], tmp_path, plan=plan
            )
            assert recorded(answer, "cycles without a frame") == len(skipped)
            # TwinCAT's read of the state of all mailboxes is a datagram of its own, as planned.
            assert "bus.housekeeping_bytes" not in answer.edits
            assert codes == ({"cycles without a frame": "BP401"} if skipped else {})


OF_THREE = cycle(64), cycle(32), ()
"""Of three cycles the last is empty."""
THIRDS = plan_of((4, 8, 3), (4, 4, 3))


@pytest.mark.parametrize("held", [1, 2, 3])
def test_a_period_that_a_master_does_not_count_shifts_the_empty_cycles_behind_it(held: int, tmp_path: Path) -> None:
    # The master holds twice, for some periods, and goes on where it was.
    once = (*OF_THREE * 30, *OF_THREE[:1], *[()] * held, *OF_THREE[1:])
    machine = replace(MACHINE, schedule=(*once * 2, *OF_THREE * 30))
    answer, codes = judged(simulated(machine, len(machine.schedule)), tmp_path, plan=THIRDS)
    figures = {figure.quantity: figure.events for figure in answer.figures}
    assert (figures["round trip with g0"], figures["round trip with g1"]) == (92, 92)
    assert recorded(answer, "cycles without a frame") == 2 * {1: 1, 2: 1, 3: 2}[held]
    assert codes == {"cycles without a frame": "BP401"}


def test_a_cycle_with_less_behind_a_missing_one_is_no_other_cycle(tmp_path: Path) -> None:
    machine = replace(MACHINE, schedule=(*OF_THREE * 30, cycle(64), (), (), cycle(32), *OF_THREE[1:], *OF_THREE * 30))
    answer, _ = judged(simulated(machine, len(machine.schedule)), tmp_path, plan=THIRDS)
    assert recorded(answer, "cycles without a frame") == 2


def test_a_cycle_that_lacks_a_frame_or_data_of_most_lacks_one(tmp_path: Path) -> None:
    # Of four cycles the fullest, but three times without its slow unit.
    lean = {101, 501, 901}
    fuller, leaner = (
        replace(SHORT_LINE, schedule=(cycle(16), cycle(size), cycle(16), cycle(16))) for size in (136, 16)
    )
    packets = [packet for packet in simulated(fuller, 1200) if packet[0] // 1000 not in lean]
    packets += [packet for packet in simulated(leaner, 1200) if packet[0] // 1000 in lean]
    answer, codes = judged(sorted(packets, key=lambda packet: packet[0]), tmp_path, plan=QUARTERS)
    assert codes == {"cycles without a frame": "BP401"}
    assert answer.outside[0].note == "3 with less than most have"


def test_lost_frames_and_wrong_counters_count_against_the_same_limit(tmp_path: Path) -> None:
    machine = replace(MACHINE, lost=frozenset({100, 200}), wrong=frozenset({300, 400}))
    lost = {"lost frames": "BP401", "wrong working counters": "BP401"}
    assert judged(simulated(machine, 1000), tmp_path)[1] == lost
    assert judged(simulated(machine, 1000), tmp_path, plan=FOUR + "[limits]\nmissed_cycles = 2\n")[1] == {}


def in_turn(
    trips_us: dict[int, float], late_us: dict[int, float], *, usual_us: tuple[float, float] = (50.0, 46.0)
) -> Packets:
    """A capture of `FOUR`: cycles of 104 and 84 bytes return after the usual times, but some, and some start late."""
    packets = []
    for number in range(201):
        (frame,) = MACHINE.schedule[number % 2]
        start_us = 1000.0 * number + late_us.get(number, 0.0)
        back_us = start_us + trips_us.get(number, usual_us[number % 2])
        for time, counters, returned in ((start_us, (), False), (back_us, (30 - number % 2, 8), True)):
            packets.append((time, ethernet(frame, index=number % 256, counters=counters, returned=returned)))
    return packets


def test_every_figure_of_a_capture_by_hand(tmp_path: Path) -> None:
    answer = compared(in_turn({30: 53.5, 71: 57.0}, {100: 7.5}), tmp_path)
    # On the wire 40 bytes, 12 of the process data and 20 of the clocks; 8 devices of 0.698 us; 3.533 ns for a byte.
    way_us, copies_us = 16 * 0.698, (104 * 0.0035333, 84 * 0.0035333)
    wires_us = (72 + 104) * 0.08, (72 + 84) * 0.08
    trips_us = [25 + wire_us + copy_us + way_us for wire_us, copy_us in zip(wires_us, copies_us, strict=True)]
    host_us = 57 - wires_us[1] - copies_us[1] - way_us
    # Measured devices err by 10 ns / sqrt(12) each way, bytes by 0.94045 ns, the master by 0.1 us, stamps by 0.25 us.
    common = 16 * 0.010 / 12**0.5 / 8**0.5, 0.1, 0.25
    doubts_us = [2 * hypot(*common, size * 0.00094045) for size in (104, 84)]
    clock_us = 2 * 1000 * 100e-6 / 3**0.5
    expected: list[tuple[str, float | None, float | None, float | None, int, str | None]] = [
        ("period", 1000, 1000, clock_us, 201, "within"),
        ("standard deviation of the period", None, 0.75, None, 200, None),
        ("latest start", 10, 7.5, 0.5, 201, "within"),
        ("cycles without a frame", 0, 0, None, 201, "within"),
        ("round trip, median", None, 50, None, 101, None),
        ("round trip with g0 and g2", trips_us[0], 53.5, doubts_us[0], 101, "outside"),
        ("master's time", 25, host_us, doubts_us[0], 201, "outside"),
        ("frames in a cycle with g0 and g2", 1, 1, None, 101, "within"),
        ("datagrams of a cycle with g0 and g2", 136, 136, None, 101, "within"),
        ("round trip with g0 and g1", trips_us[1], 57, doubts_us[1], 100, "outside"),
        ("frames in a cycle with g0 and g1", 1, 1, None, 100, "within"),
        ("datagrams of a cycle with g0 and g1", 116, 116, None, 100, "within"),
        ("lost frames", 0, 0, None, 201, "within"),
        ("wrong working counters", 0, 0, None, 201, "within"),
    ]
    found = answer.figures
    assert [(one.quantity, one.events, one.verdict) for one in found] == [(row[0], *row[4:]) for row in expected]
    for place, name in enumerate(("planned", "recorded", "uncertainty"), start=1):
        values = [getattr(one, name) for one in found]
        assert [value is None for value in values] == [row[place] is None for row in expected], name
        assert [value or 0 for value in values] == pytest.approx([row[place] or 0 for row in expected], abs=2e-3)
    by_name = {one.quantity: one for one in found}
    assert by_name["master's time"].note == "median 24.4: round trip less wire, devices and cables"
    assert by_name["datagrams of a cycle with g0 and g2"].note == "LRW 104 FRMW 8"
    # Frames are numbered from 1, and each is there twice; a trip is at the frame that is sent.
    worst = {name: (one.first_s, one.first_frame, one.worst_frame) for name, one in by_name.items() if one.first_s}
    assert worst == {
        "round trip with g0 and g2": (0.030, 61, 61),
        "master's time": (0.030, 61, 143),
        "round trip with g0 and g1": (0.071, 143, 143),
    }
    assert by_name["latest start"].worst_frame == 201
    # Rounded up to a nanosecond; of the worst case nobody knows U.
    assert answer.edits == {
        "bus.master_us": pytest.approx(33.056, abs=1e-9),
        "bus.master_grade": "measured",
        "bus.master_uncertainty_us": None,
        "bus.master_jitter_us": pytest.approx(7.5, abs=0.0011),
        "bus.master_jitter_cycles": 201,
    }
    # Four of five cycles take 24.384 us at most, as most of those do: the steps of the stamps alone are doubted.
    often = busplan.measured(tmp_path / "plan.toml", tmp_path / "capture.pcapng", quantile=0.8).edits
    assert (often["bus.master_us"], often["bus.master_uncertainty_us"]) == pytest.approx((24.385, 0.25), abs=1e-3)


def test_a_master_that_takes_less_than_nothing_shows_other_devices(tmp_path: Path) -> None:
    # 0.34 us sooner than wire, copy and devices take, in the cycles that take longest.
    answer = compared(in_turn({}, {}, usual_us=(25.2, 23.6)), tmp_path)
    assert recorded(answer, "master's time") == pytest.approx(-0.3448, abs=1e-4)
    words = "Round trips are shorter than with the profile's devices: the machine has fewer or faster ones."
    assert words in answer.remarks
    assert "bus.master_us" not in answer.edits


@pytest.mark.parametrize(("cycles", "is_missing"), [(9, False), (10, True)])
def test_ten_cycles_in_a_row_are_operation(cycles: int, is_missing: bool, tmp_path: Path) -> None:
    packets = simulated(MACHINE, 60)
    for kept in (
        [packet for packet in packets if packet[0] < 29_900 or packet[0] > (60 - cycles) * 1000 - 100],
        [packet for packet in packets if packet[0] < cycles * 1000 - 100 or packet[0] > 29_900],
    ):
        answer = compared(kept, tmp_path)
        assert recorded(answer, "cycles without a frame") == (30 - cycles if is_missing else 0)
        words = f"{cycles} frames of process data at its ends are left out"
        assert any(words in remark for remark in answer.remarks) is not is_missing


@pytest.mark.parametrize(
    ("nodes", "planned", "size", "edit"),
    # A bit of each device at most, or what the plan gives the master; else it is process data.
    [(8, None, 1, [1, 8]), (8, None, 2, None), (9, None, 2, [2, 8]), (8, [8, 5], 5, None), (8, [8, 5], 1, [8])],
)
def test_a_read_of_the_state_of_all_mailboxes_is_the_masters(
    nodes: int, planned: list[int] | None, size: int, edit: list[int] | None, tmp_path: Path
) -> None:
    plan = plan_of((nodes, 4, 1))
    if planned is not None:
        plan = plan.replace("master_us", f"housekeeping_bytes = {planned}\nmaster_us", 1)
    frame = ((LRW, 0x10000, 8 * nodes), (LRD, 0x900_0000, size), (FRMW, 0x910_1001, 8))
    answer = compared(simulated(replace(MACHINE, devices=nodes, schedule=((frame,),)), 40), tmp_path, plan=plan)
    assert answer.edits.get("bus.housekeeping_bytes") == edit


@pytest.mark.parametrize(("trip_us", "is_early"), [(12.5, False), (12.0, True)])
def test_a_frame_is_back_no_sooner_than_it_is_sent(trip_us: float, is_early: bool, tmp_path: Path) -> None:
    # 164 bytes without the gap of 12 are 13.12 us; of two stamps in steps of 0.5 us each may err by one.
    answer = compared(in_turn({30: trip_us, 32: 50.5}, {}), tmp_path)
    assert any("1 frame returned sooner than it takes" in remark for remark in answer.remarks) is is_early


@pytest.mark.parametrize("first", [0, 1])
def test_two_units_in_turn_are_one_frame_a_cycle(tmp_path: Path, first: int) -> None:
    machine = replace(MACHINE, host_us=23.0, host_spread_us=0.5, schedule=(cycle(64),))
    answer, codes = judged(simulated(machine, 1001)[2 * first :], tmp_path, plan=TWO)
    assert codes == {}
    assert recorded(answer, "period") == pytest.approx(1000, abs=0.01)
    assert recorded(answer, "frames in a cycle with g0") == 1
    assert answer.edits["bus.master_us"] == pytest.approx(23.5, abs=0.05)


@pytest.mark.parametrize("first", range(4))
def test_each_cycle_is_held_against_the_one_of_its_number(tmp_path: Path, first: int) -> None:
    schedule = [cycle(16), cycle(16), cycle(16), cycle(16)]
    schedule[first] = cycle(136)
    # The fullest cycles take more of the host.
    machine = replace(SHORT_LINE, schedule=tuple(schedule))
    packets = [
        (time + 200 * (len(frame) > 100 and bool(frame[6] & 2)), frame) for time, frame in simulated(machine, 1000)
    ]
    answer, codes = judged(packets, tmp_path, plan=QUARTERS)
    assert codes == {"round trip with g0 and g1": "BP401", "master's time": "BP401"}
    trips = [figure for figure in answer.figures if figure.quantity.startswith("round trip with")]
    assert [(figure.quantity, figure.events) for figure in trips] == [
        ("round trip with g0 and g1", 250),
        ("round trip with g0", 750),
    ]
    assert trips[0].planned == pytest.approx(trips[1].planned + 120 * 0.0835, abs=0.05)  # type: ignore[operator]
    assert recorded(answer, "cycles without a frame") == 0
    assert recorded(answer, "datagrams of a cycle with g0 and g1") == 16 + 120 + 12 + 20
    assert recorded(answer, "datagrams of a cycle with g0") == 16 + 12 + 20


def test_a_cycle_without_process_data_has_no_frame_to_miss(tmp_path: Path) -> None:
    plan, machine = plan_of((4, 8, 3)), replace(SHORT_LINE, schedule=(cycle(0), cycle(64), cycle(0)))
    answer, codes = judged(simulated(machine, 1000), tmp_path, plan=plan)
    assert codes == {}
    assert recorded(answer, "period") == pytest.approx(1000, abs=0.01)
    lacks = replace(machine, skipped=frozenset({301, 601}))
    answer, codes = judged(simulated(lacks, 1000), tmp_path, plan=plan)
    assert codes == {"cycles without a frame": "BP401"}
    assert recorded(answer, "cycles without a frame") == 2


@pytest.mark.parametrize(("every", "shift"), [(4, 3), (12, 1)])
def test_a_master_that_goes_on_with_its_own_count_misses_a_cycle_and_no_more(
    every: int, shift: int, tmp_path: Path
) -> None:
    schedule = (cycle(136), *[cycle(16)] * (every - 1))
    before, behind = (replace(SHORT_LINE, schedule=schedule[shift:] + schedule[:shift]) for shift in (0, shift))
    packets = [packet for packet in simulated(before, 600) if packet[0] < 299_500]
    packets += [packet for packet in simulated(behind, 600) if packet[0] > 300_500]
    answer, codes = judged(packets, tmp_path, plan=plan_of((2, 4, 1), (2, 30, every)))
    assert codes == {"cycles without a frame": "BP401"}
    assert recorded(answer, "cycles without a frame") == 1


def test_a_new_count_begins_with_the_first_cycle_behind_a_gap(tmp_path: Path) -> None:
    # The fullest cycles are the last before the gap and the first behind it.
    before, behind = (
        replace(SHORT_LINE, schedule=tuple(cycle(136 if place == fullest else 16) for place in range(4)))
        for fullest in (3, 1)
    )
    packets = [packet for packet in simulated(before, 600) if packet[0] < 299_900]
    packets += [packet for packet in simulated(behind, 600) if packet[0] > 300_900]
    answer, codes = judged(packets, tmp_path, plan=QUARTERS)
    assert codes == {"cycles without a frame": "BP401"}
    assert recorded(answer, "cycles without a frame") == 1
    events = {figure.quantity: figure.events for figure in answer.figures}
    assert events["datagrams of a cycle with g0 and g1"] == 150
    assert events["datagrams of a cycle with g0"] == 599 - 150


def test_a_machine_of_another_plan_is_outside_it(tmp_path: Path) -> None:
    machine = replace(MACHINE, schedule=(cycle(124),))
    assert judged(simulated(machine, 600), tmp_path)[1]["datagrams of a cycle with g0 and g1"] == "BP401"
    slow = replace(MACHINE, period_us=2000)
    assert judged(simulated(slow, 600), tmp_path)[1] == {"period": "BP401"}
    never = replace(MACHINE, schedule=(cycle(16),))
    assert "frames in a cycle with g0 and g1" not in judged(simulated(never, 600), tmp_path, plan=QUARTERS)[1]
    rates, _ = judged(simulated(MACHINE, 600), tmp_path, plan=PLAIN)
    assert recorded(rates, "period") == pytest.approx(1000, abs=0.01)
    assert recorded(rates, "frames in a cycle") == 1
    assert rates.edits["bus.master_us"] == pytest.approx(24.9, abs=0.1)


def test_the_start_of_a_master_is_no_missing_cycle(tmp_path: Path) -> None:
    packets = simulated(MACHINE, 1200)
    started = [packet for packet in packets if packet[0] < 1500 or 40_000 < packet[0] < 41_500 or packet[0] > 199_500]
    answer, codes = judged(started, tmp_path)
    assert codes == {}
    assert any("4 frames of process data at its ends are left out" in remark for remark in answer.remarks)


def test_the_end_of_a_master_is_no_missing_cycle(tmp_path: Path) -> None:
    packets = simulated(MACHINE, 1200)
    ended = [
        packet for packet in packets if packet[0] < 399_500 or 449_900 < packet[0] < 450_900 or packet[0] > 1.1985e6
    ]
    answer, codes = judged(ended, tmp_path)
    assert codes == {}
    assert any("2 frames of process data at its ends are left out" in remark for remark in answer.remarks)
    assert next(figure.events for figure in answer.figures if figure.quantity == "period") == 400


def test_each_group_has_the_mean_of_its_devices_by_port_times(tmp_path: Path) -> None:
    of_ports, _, _ = plan_of((1, 8, 1), (2, 8, 1), (1, 8, 1), (1, 8, 1)).rpartition("delay_us")
    plan = of_ports.replace('name = "g2"', 'name = "g2"\ncable_length_m = 200')
    # Two starts of the machine: means of 0.6, 1.0, 0.8 and 0.7 us. A start before them had fewer devices.
    starts = (
        start_up(hops_ns, clocks_ns=tuple(range(5, 6 + len(hops_ns))))
        for hops_ns in ((300, 300), (500, 900, 800, 600), (700, 1100, 800, 800))
    )
    started = [(time - 1000 * (2 - place), frame) for place, start in enumerate(starts) for time, frame in start]
    # Only the delays of the two devices of g1 are changed; g2 has a cable of 1 us one way.
    line_us = 2 * (0.698 + 0.6 + 1.0 + 0.698 + 1.0 + 0.7)
    machine = replace(
        SHORT_LINE, jitter_us=0.5, host_us=20.0, host_spread_us=0.0, devices=5, line_us=line_us, schedule=(cycle(80),)
    )
    answer = compared(started + simulated(machine, 50), tmp_path, plan=plan)
    step_us = 0.010 / 12**0.5
    shown = [figure for figure in answer.figures if "delay of device" in figure.quantity]
    assert [(figure.quantity, figure.verdict, figure.events) for figure in shown] == [
        ("delay of device 2", None, 2),
        ("delay of device 3", None, 2),
        ("mean delay of devices 2 to 3", "outside", 2),
        ("delay of device 4", "within", 2),
        ("delay of device 5", "within", 2),
    ]
    assert [figure.recorded for figure in shown] == pytest.approx([0.6, 1.0, 0.8, 0.8, 0.7])
    # Device 5 is planned with the mean of 14 of 100BASE-TX, 0.6981 us, and errs as one of them, by 0.1233 us.
    assert [figure.planned for figure in shown] == pytest.approx([0.698, 0.698, 0.698, 1.698, 0.6981], abs=0.0001)
    assert [figure.uncertainty for figure in shown] == pytest.approx(
        [2 * step_us * root for root in (2**0.5, 2**0.5, 1, 2**0.5)] + [2 * hypot(0.1233, step_us)], abs=0.0001
    )
    # What is shorter than its planned cable changes nothing.
    assert {key: value for key, value in answer.edits.items() if key.endswith("delay_us")} == pytest.approx(
        {"group.g1.delay_us": 0.8, "group.g3.delay_us": 0.7}
    )
    assert answer.edits["bus.master_us"] == pytest.approx(20, abs=0.02)


@settings(max_examples=at_least(10, 80))
@given(
    st.sampled_from(["uniform", "normal", "exponential"]),
    st.floats(0.5, 30.0),
    st.floats(-40.0, 40.0),
    st.integers(100, 2500),
    st.integers(1, 10**6),
)
def test_a_machine_exactly_on_its_plan_is_never_outside(
    tmp_path_factory: pytest.TempPathFactory, shape: Any, jitter_us: float, clock_ppm: float, cycles: int, seed: int
) -> None:
    machine = replace(MACHINE, shape=shape, jitter_us=jitter_us, clock_ppm=clock_ppm)
    late_us, host_us = zip(*starts_and_hosts(machine, cycles, seed=seed), strict=True)
    plan = FOUR.replace("master_jitter_us = 10", f"master_jitter_us = {max(late_us) - min(late_us) + 1e-3}")
    plan = plan.replace("master_us = 25", f"master_us = {max(host_us) + 1e-3}")
    answer, codes = judged(simulated(machine, cycles, seed=seed), tmp_path_factory.mktemp("plan"), plan=plan)
    assert "BP401" not in codes.values()
    assert not answer.shows_nothing


def test_the_worst_start_is_within_its_u(tmp_path: Path) -> None:
    # Jitter spread evenly over 10 us, for which a line through medians makes the extremes too large.
    for seed, cycles in enumerate((30, 100, 300, 1000, 3000)):
        machine = replace(MACHINE, clock_ppm=40.0)
        late_us, _ = zip(*starts_and_hosts(machine, cycles, seed=seed), strict=True)
        answer, _ = judged(simulated(machine, cycles, seed=seed), tmp_path)
        (latest,) = (figure for figure in answer.figures if figure.quantity == "latest start")
        assert latest.verdict == "within"
        assert latest.recorded == pytest.approx(max(late_us) - min(late_us), abs=latest.uncertainty)


def test_stamps_of_no_port_say_no_time(tmp_path: Path) -> None:
    # Frames of 800 bytes and of 40, whose trips would show the time of a byte.
    packets = simulated(replace(MACHINE, schedule=(cycle(800), cycle(40))), 1000)
    back_at_once = [(time - 95 * bool(frame[6] & 2), frame) for time, frame in packets]
    coarse = [(time // 1000 * 1000, frame) for time, frame in packets]
    in_bursts = [(time // 20_000 * 20_000 + place % 40, frame) for place, (time, frame) in enumerate(packets)]
    at_one_time = [(0.0, frame) for _, frame in packets]
    for stamped, words in (
        (back_at_once, "returned sooner than it takes to send them"),
        (coarse, "the stamps have steps of 1000 us"),
        (in_bursts, "stamped in bursts"),
        (at_one_time, "stamped in bursts"),
    ):
        answer, codes = judged(stamped, tmp_path, plan=plan_of((8, 5, 1), (2, 190, 2)))
        assert set(codes.values()) == {"BP403"}
        assert words in " ".join(answer.shows_nothing)
        assert answer.edits == {}
        hidden = [figure for figure in answer.figures if figure.hidden]
        assert any(figure.quantity.startswith("round trip") for figure in hidden)
        assert any(figure.quantity == "master's time" for figure in hidden)
        assert all(figure.recorded is None for figure in hidden if figure.unit == "us" and "trip" in figure.quantity)
        assert not any(figure.quantity == "time of a byte" for figure in answer.figures)


def test_a_byte_faster_than_the_wire_is_no_figure(tmp_path: Path) -> None:
    # Frames of two sizes return at the next tick of the host: 100 us, whatever their size.
    schedule = (cycle(40), cycle(400))
    plan = plan_of((4, 5, 1), (4, 45, 2)).replace("master_us = 25", "master_us = 100")
    packets = [
        (time if not frame[6] & 2 else time // 1000 * 1000 + 100 + time % 1, frame)
        for time, frame in simulated(replace(MACHINE, jitter_us=0.5, schedule=schedule), 1000)
    ]
    answer, _ = judged(packets, tmp_path, plan=plan)
    (byte,) = (figure for figure in answer.figures if figure.quantity == "time of a byte")
    assert (byte.verdict, byte.hidden) == ("not shown", "less than on the wire: the host waits for more than the frame")


def test_steps_that_hide_the_jitter_are_said(tmp_path: Path) -> None:
    answer, codes = judged([(time // 20 * 20, frame) for time, frame in simulated(MACHINE, 1000)], tmp_path)
    assert codes["latest start"] == "BP402"
    assert "bus.master_jitter_us" not in answer.edits


def test_what_the_recorder_dropped_is_not_missing(tmp_path: Path) -> None:
    packets = simulated(MACHINE, 1000)
    less = [packet for place, packet in enumerate(packets) if place not in {200, 201, 605}]
    ways: tuple[tuple[bytes, dict[str, Any]], ...] = (
        (statistics(5, 3), {}),
        (statistics(7, 3), {}),
        (b"", {"dropped_before": {200: 2, 603: 1}}),
    )
    for more, options in ways:
        answer, codes = judged(less, tmp_path, more=more, **options)
        assert set(codes.values()) == {"BP403"}
        assert answer.shows_nothing == ("the recorder dropped or cut 3 packets",)
        hidden = {figure.quantity: figure.recorded for figure in answer.figures if figure.hidden}
        assert hidden == {"cycles without a frame": 1, "lost frames": 1}
    # What is more than was dropped is missing.
    gone = [packet for packet in packets if not 300_000 < packet[0] < 400_000]
    assert judged(gone, tmp_path, more=statistics(5, 3))[1]["cycles without a frame"] == "BP401"


def test_few_cycles_show_nothing(tmp_path: Path) -> None:
    answer, codes = judged(simulated(MACHINE, 9), tmp_path)
    assert answer.shows_nothing == ("it has 9 cycles, but a period needs at least 10",)
    assert set(codes.values()) == {"BP403"}
    assert answer.edits == {}
    enough = replace(MACHINE, schedule=(cycle(128),))
    assert judged(simulated(enough, 10), tmp_path, plan=PLAIN)[1] == {}
    # Of two sorts of cycle each is too few.
    few = judged(simulated(MACHINE, 18), tmp_path)[1]
    assert few == {"round trip with g0 and g2": "BP402", "master's time": "BP402", "round trip with g0 and g1": "BP402"}


def test_a_plan_that_a_recording_was_written_into_holds_it(tmp_path: Path) -> None:
    # The host takes longest in a cycle that is not the fullest.
    packets = simulated(replace(MACHINE, jitter_us=33.3, host_us=91.7), 1001)
    answer, codes = judged(packets, tmp_path)
    assert set(codes.values()) == {"BP401"}
    keys = {key: value for key, value in answer.edits.items() if value is not None}
    again = busplan.measured(busplan.load_profile(tmp_path / "plan.toml", changes=keys), tmp_path / "capture.pcapng")
    assert {figure.verdict for figure in again.figures} == {None, "within"}
