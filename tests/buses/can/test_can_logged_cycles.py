"""Cycles of CAN logs written by hand: each event, with what is late in it, is that of pencil and paper."""

from pathlib import Path
from typing import Any

import pytest

import busplan
from tests.oracles.can_log import Log

MEASURED = {"kind": "linear", "grade": "measured", "base_us": 150, "per_byte_us": 0}
PLAN: dict[str, Any] = {
    "schema_version": 1,
    "name": "press",
    "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "pipeline_cycles": 0, "host_us": 100, "host_read_us": 50},
    "cycle": {"period_us": 4000},
    "group": [
        {
            "name": name,
            "nodes": nodes,
            "axes": 1,
            "read_bytes": 8,
            "write_bytes": 8,
            "every": every,
            "execution": MEASURED | {"worst_extra_us": extra_us},
        }
        for name, nodes, every, extra_us in (("fast", 1, 1, 10), ("slow", 2, 2, 0))
    ],
    "message": [{"name": "pairs", "identifier": 0x300, "payload_bytes": 2, "period_us": 6000}],
}


def events(answer: busplan.RecordedTimelineAnswer) -> list[tuple[Any, ...]]:
    """Each event: what it waits for, which frame, from when to when, of which node, and how late."""
    return [
        (
            one.waits_for,
            one.label,
            round(one.start_us, 1),
            round(one.end_us, 1),
            one.node,
            one.frame,
            round(one.late_us, 1),
        )
        for one in answer.events
    ]


def test_a_cycle_of_sync_is_that_by_hand(tmp_path: Path) -> None:
    log = Log()
    log.error(566)
    for cycle in range(12):
        is_slow, is_hit = cycle % 2 == 0, cycle == 6
        log.us = 4000 * (cycle + 1)
        log.frame(0, 0x80, 0)
        log.frame(100, 0x300, 2, is_sent=is_hit)
        log.frame(50, 0x181)
        if is_hit:
            log.frame(20, 0x081)
            log.frame(0, 0x7F0, 1)
            log.frame(0, 0x85, 1)
            log.error(10)
            log.error(20)
            log.us += 5
        if is_slow:
            log.frame(5, 0x182)
            log.frame(0, 0x183)
        if is_hit:
            log.error(15)
            log.frame(0, 0x181)
        log.frame(180, 0x201)
        if is_slow:
            log.frame(20, 0x202)
            log.frame(0, 0x203)
    paths = log.save(tmp_path, PLAN)
    answer = busplan.timeline(paths[0], recording=paths[1], cycle=7)
    # Times count from the first line, at 566 us. Behind SYNC, which ends at 51 us, the fast node has 160 us, each slow
    # one 150; behind the last feedback the host and its adapter have 150. An emergency has 8 bytes.
    assert (answer.cycles, answer.cycle, answer.frame, answer.start_s) == (11, 7, 32, (28_000 - 566) / 1e6)
    fast, slow = ("feedback of fast 1 (0x181)", "fast 1"), ("feedback of slow 1 (0x182)", "slow 1")
    assert events(answer) == [
        ("wire", "SYNC (0x80)", 0, 51, "", 32, 0),
        ("nodes", fast[0], 51, 151, fast[1], 34, 0),
        ("others", "pairs (0x300)", 151, 217, "", 33, 66),
        ("nodes", fast[0], 217, 267, fast[1], 34, 50),
        ("wire", fast[0], 267, 379, fast[1], 34, 0),
        ("nodes", slow[0], 379, 399, slow[1], 40, 20),
        ("others", "emergency of fast 1 (0x81)", 399, 511, "", 35, 112),
        ("others", "0x7f0, no message of the plan", 511, 570, "", 36, 59),
        ("others", "0x85, no message of the plan", 570, 626, "", 37, 56),
        ("unknown", "an error frame, and what it destroyed", 626, 656, "", 39, 0),
        ("nodes", slow[0], 656, 666, slow[1], 40, 10),
        ("wire", slow[0], 666, 778, slow[1], 40, 0),
        ("wire", "feedback of slow 2 (0x183)", 778, 891, "slow 2", 41, 0),
        # Nothing is waited for between an error frame and the frame that begins with its end.
        ("unknown", "an error frame, and what it destroyed", 891, 906, "", 42, 0),
        ("wire", f"{fast[0]}, again", 906, 1018, fast[1], 43, 112),
        ("host", "command of fast 1 (0x201)", 1018, 1198, fast[1], 44, 30),
        ("wire", "command of fast 1 (0x201)", 1198, 1311, fast[1], 44, 0),
        ("host", "command of slow 1 (0x202)", 1311, 1331, slow[1], 45, 20),
        ("wire", "command of slow 1 (0x202)", 1331, 1443, slow[1], 45, 0),
        ("wire", "command of slow 2 (0x203)", 1443, 1555, "slow 2", 46, 0),
    ]
    # Frames of seven PDOs and SYNC, and 135 + 75 us of the plan's. Of the nodes there are two rows of waits.
    shares = [(one.waits_for, one.recorded_us, one.planned_us, round(one.uncertainty_us, 3)) for one in answer.shares]
    assert shares == [
        ("wire", 51 + 112 + 112 + 113 + 112 + 113 + 112 + 112, 55 + 6 * 135, 0),
        ("nodes", 180, 160, 2),
        ("host", 200, 150, 1),
        ("others", 66 + 112 + 59 + 56, 75, 0),
        ("unknown", 45, 0, 2),
    ]


def test_what_is_due_and_never_comes_is_said(tmp_path: Path) -> None:
    """The slow nodes are due in every second cycle; the second of them never answers in the fifth."""
    log = Log()
    for cycle in range(12):
        log.us = 4000 * (cycle + 1)
        log.frame(0, 0x80, 0)
        log.frame(200, 0x181)
        for after_us, identifier in ((0, 0x182), (0, 0x183)):
            log.frame(after_us, identifier, is_sent=cycle % 2 == 0 and (cycle, identifier) != (4, 0x183))
        for after_us, identifier in ((600, 0x201), (0, 0x202), (0, 0x203)):
            log.frame(after_us, identifier, is_sent=cycle % 2 == 0 or identifier == 0x201)
    paths = log.save(tmp_path, PLAN)
    for cycle, count, planned in ((5, 1, 7), (6, 0, 3), (7, 0, 7)):
        answer = busplan.timeline(paths[0], recording=paths[1], cycle=cycle)
        words = "Never came in this cycle: feedback of slow 2 (0x183)."
        assert answer.remarks.count(words) == count == sum("Never" in remark for remark in answer.remarks)
        # The plan beside it is that of a cycle with the same groups.
        assert sum(one.waits_for == "wire" for one in answer.planned_events) == planned
        # What the host waited for is not known where feedback never came.
        waits = [(one.waits_for, one.label) for one in answer.events if one.waits_for in ("host", "unknown")]
        assert waits == [("unknown" if count else "host", "command of fast 1 (0x201)")]


def test_half_of_the_possible_stuff_bits_of_can_fd_is_in_doubt(tmp_path: Path) -> None:
    """8 bytes: 29 to 32 bits at 1000 kbit/s and 97 to 115 at 2000: 83.5 +/- 6 us. No byte: 33 to 35: 47.5 +/- 2 us."""
    log, data = Log(), "55" * 8
    for cycle in range(12):
        for us, frame in ((0, "080##1"), (301, f"181##1{data}"), (503, f"050##1{data}"), (704, f"201##1{data}")):
            log.lines.append(f"({(5000 + 4000 * cycle + us) / 1e6:.6f}) can0 {frame}\n")
    bus = PLAN["bus"] | {"data_bit_rate_kbit_s": 2000}
    paths = log.save(tmp_path, PLAN | {"bus": bus, "group": PLAN["group"][:1]})
    answer = busplan.timeline(paths[0], recording=paths[1], cycle=5)
    shares = {one.waits_for: (round(one.recorded_us, 1), round(one.uncertainty_us, 1)) for one in answer.shares}
    # Waits lie between two stamps, of 1 us, and are shorter where any frame is longer.
    assert shares == {
        "wire": (47.5 + 2 * 83.5, 2 + 2 * 6),
        "others": (83.5, 6),
        "nodes": (301 - 83.5, 20 + 1),
        "host": (202 - 83.5 + 201 - 83.5, 20 + 1),
    }


HOST_US = {"bus.nodes": 3, "bus.host_us": 90, "bus.host_write_us": 30, "bus.host_read_us": 50}


def requests(log: Log, folder: Path, access: str) -> busplan.RecordedTimelineAnswer:
    """The seventh cycle of a log of three motors, which have 250 us for an answer."""
    (folder / "bus.log").write_text("".join(log.lines))
    plan = busplan.load_profile("can-motors-8", changes={"bus.access": access, **HOST_US})
    return busplan.timeline(plan, recording=folder / "bus.log", cycle=7)


def test_requests_one_by_one_are_those_by_hand(tmp_path: Path) -> None:
    log = Log()
    for cycle in range(12):
        log.us = 4000 * (cycle + 1)
        for node, host_us in enumerate((0, 210, 500 if cycle == 6 else 210)):
            log.frame(host_us, 0x141 + node)
            log.frame(260, 0x241 + node, is_sent=node != 1 or cycle != 6)
    answer = requests(log, tmp_path, "polled")
    # The host has 90 us, and 80 more for its adapter. Nobody knows what it awaits behind a request that has no answer.
    assert events(answer) == [
        ("wire", "command of node 1 (0x141)", 0, 112, "node 1", 37, 0),
        ("nodes", "feedback of node 1 (0x241)", 112, 372, "node 1", 38, 10),
        ("wire", "feedback of node 1 (0x241)", 372, 485, "node 1", 38, 0),
        ("host", "command of node 2 (0x142)", 485, 695, "node 2", 39, 40),
        ("wire", "command of node 2 (0x142)", 695, 807, "node 2", 39, 0),
        ("unknown", "command of node 3 (0x143)", 807, 1679, "node 3", 40, 872),
        ("wire", "command of node 3 (0x143)", 1679, 1790, "node 3", 40, 0),
        ("nodes", "feedback of node 3 (0x243)", 1790, 2050, "node 3", 41, 10),
        ("wire", "feedback of node 3 (0x243)", 2050, 2161, "node 3", 41, 0),
    ]
    assert answer.planned_us == 6 * 135 + 3 * 250 + 2 * (90 + 80)
    first = busplan.timeline(answer.profile, recording=tmp_path / "bus.log", cycle=1)
    assert first.recorded_us == sum(frame.bits for frame in log.frames[:6]) + 3 * 260 + 2 * 210
    assert answer.remarks == (
        "Never came in this cycle: feedback of node 2 (0x242).",
        "Frames have their length at 1000 kbit/s and end with their stamps; these have an error of up to 1 us.",
        "From the first request to the last answer: the host's time before the first request is left out.",
    )


def test_requests_at_once_are_those_by_hand(tmp_path: Path) -> None:
    log = Log()
    for cycle in range(12):
        log.us = 4000 * (cycle + 1)
        for after_us, identifier in ((0, 0x141), (120, 0x142), (50, 0x241), (30, 0x143), (300, 0x242), (20, 0x243)):
            log.frame(after_us, identifier)
    answer = requests(log, tmp_path, "burst")
    # The first node has until 112 + 250, the second until 344 + 250; the host has 90 us for each request.
    assert events(answer) == [
        ("wire", "command of node 1 (0x141)", 0, 112, "node 1", 37, 0),
        ("host", "command of node 2 (0x142)", 112, 232, "node 2", 38, 30),
        ("wire", "command of node 2 (0x142)", 232, 344, "node 2", 38, 0),
        ("nodes", "feedback of node 1 (0x241)", 344, 394, "node 1", 39, 32),
        ("wire", "feedback of node 1 (0x241)", 394, 507, "node 1", 39, 0),
        ("host", "command of node 3 (0x143)", 507, 537, "node 3", 40, 0),
        ("wire", "command of node 3 (0x143)", 537, 648, "node 3", 40, 0),
        ("nodes", "feedback of node 2 (0x242)", 648, 948, "node 2", 41, 300),
        ("wire", "feedback of node 2 (0x242)", 948, 1060, "node 2", 41, 0),
        ("nodes", "feedback of node 3 (0x243)", 1060, 1080, "node 3", 42, 20),
        ("wire", "feedback of node 3 (0x243)", 1080, 1191, "node 3", 42, 0),
    ]
    # Of three times of the host two are behind the first frame.
    assert answer.planned_us == 6 * 135 + 250 + 2 * 90


def test_a_stamp_beyond_the_next_frame_is_late(tmp_path: Path) -> None:
    """The first command ends before the second begins, whatever its stamp says; others may be as late, and a frame."""

    def shown(late_us: int) -> busplan.RecordedTimelineAnswer:
        log = Log()
        for cycle in range(12):
            log.us = 4000 * (cycle + 1)
            for after_us, identifier in ((0, 0x80), (200, 0x181), (200 + late_us, 0x201), (-late_us, 0x202)):
                log.frame(after_us, identifier, 0 if identifier == 0x80 else 8)
        paths = log.save(tmp_path, PLAN | {"group": [PLAN["group"][0] | {"nodes": 2}]})
        return busplan.timeline(paths[0], recording=paths[1], cycle=5)

    in_time, late = shown(0), shown(60)
    assert events(late) == events(in_time)
    error = "Frames have their length at 1000 kbit/s and end with their stamps; these have an error of up to {} us."
    assert error.format(1) in in_time.remarks
    # The longest frame has 113 bits.
    assert {error.format(1 + 60 + 113), "Frames come closer than the bus allows: stamps are late."} <= {*late.remarks}
    assert not any("closer" in remark for remark in in_time.remarks)


def test_frames_that_the_bus_of_the_plan_does_not_carry_are_refused(tmp_path: Path) -> None:
    log = Log()
    for _ in range(40):
        log.frame(38, 0x181)
    paths = log.save(tmp_path, PLAN | {"bus": PLAN["bus"] | {"bit_rate_kbit_s": 500}})
    # 30 frames of 112 bits in 30 times 150 us, a stamp of 1 us, and 1 ms by which a driver may be late.
    words = f"its frames need {30 * 112e3 / 5501:.0f} kbit/s, and bus.bit_rate_kbit_s = 500: they do not fit"
    with pytest.raises(busplan.BusplanError, match=words):
        busplan.timeline(paths[0], recording=paths[1])
