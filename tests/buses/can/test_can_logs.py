"""Logs written by hand: every figure, with its doubt and its frames, and every new key is that of pencil and paper."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import pytest

import busplan
from tests.oracles.can_log import Log


def measured(plan: dict[str, Any], log: Log, folder: Path) -> busplan.MeasuredAnswer:
    return busplan.measured(*log.save(folder, plan))


def rounded(number: Any) -> Any:
    return round(number, 1) if isinstance(number, float) else number


def rounded_edits(answer: busplan.MeasuredAnswer) -> dict[str, Any]:
    """New keys, numbers to the microsecond."""
    edits: dict[str, Any] = dict(answer.edits)
    return {key: value if isinstance(value, str | None) else round(value) for key, value in edits.items()}


def rows(answer: busplan.MeasuredAnswer) -> Iterator[tuple[Any, ...]]:
    """Each figure: planned, recorded, U; events, verdict, the first and the worst frame; note."""
    for one in answer.figures:
        values = map(rounded, (one.planned, one.recorded, one.uncertainty))
        yield one.quantity, *values, one.events, one.verdict, one.first_frame, one.worst_frame, one.note


MEASURED = {"kind": "linear", "grade": "measured", "base_us": 150, "per_byte_us": 0}
ARM: dict[str, Any] = {
    "schema_version": 1,
    "name": "arm",
    "bus": {
        "kind": "can",
        "bit_rate_kbit_s": 1000,
        "access": "polled",
        "host_us": 90,
        "host_grade": "measured",
        "host_write_us": 30,
        "host_read_us": 50,
    },
    "cycle": {"period_us": 4000},
    "group": [
        {
            "name": "arm",
            "nodes": 2,
            "axes": 1,
            "read_bytes": 8,
            "write_bytes": 8,
            "command_identifier": 0x141,
            "feedback_identifier": 0x241,
            "execution": {
                "kind": "linear",
                "grade": "measured",
                "base_us": 150,
                "per_byte_us": 0,
                "worst_extra_us": 20,
            },
        },
        {
            "name": "hand",
            "nodes": 1,
            "axes": 1,
            "read_bytes": 12,
            "write_bytes": 8,
            "command_identifier": 0x161,
            "feedback_identifier": 0x261,
            "execution": {"kind": "table", "grade": "measured", "payload_bytes": [8, 64], "time_us": [300, 300]},
        },
    ],
}


def polled() -> Log:
    """Twelve cycles, the first and the last in part: 160, 165 and 280 us of the nodes, 150 us of the host."""
    log = Log()
    log.frame(0, 0x161)
    log.frame(280, 0x261)
    log.frame(0, 0x361, 4)
    for cycle in range(1, 13):
        if cycle == 8:
            continue
        log.us = 4000 * cycle
        log.frame(0, 0x141)
        if cycle == 2:  # a frame of lower priority: the answer behind it took 100 us or more
            log.frame(100, 0x700, 3)
            log.frame(0, 0x241)
        elif cycle == 9:  # asked again
            log.frame(200, 0x141)
            log.frame(160, 0x241)
        elif cycle != 4:  # where it never answers
            log.frame(163 if cycle == 1 else 160, 0x241)
        if cycle == 12:
            break
        if cycle == 3:  # one of higher priority: the request behind it may have been queued as early as that
            log.frame(60, 0x050, 1)
        log.frame({3: 0, 4: 500}.get(cycle, 150), 0x142)
        log.frame({5: 400, 6: 450}.get(cycle, 165), 0x242)
        if cycle == 7:
            log.frame(3, 0x242)
        log.frame({7: 40, 10: 300}.get(cycle, 150), 0x161)
        log.frame(290 if cycle == 10 else 280, 0x261)
        log.frame(0, 0x361, 4)
    return log


def test_requests_one_by_one_are_those_by_hand(tmp_path: Path) -> None:
    answer = measured(ARM, polled(), tmp_path)
    # Stamps are known to 1 us, and the space of 3 bits behind a frame may be in them: 4 us. A period of 4 ms by two
    # clocks of 100 ppm: 2 sqrt(0.4^2 / 3 + (4 / 11)^2) = 0.9. Three requests, two of 150 + 20 us and one of 300: frames
    # of 3 * 135 + 2 * 135 + 135 + 95, and between them 640 of the nodes, twice 90 of the host and twice 80 of its
    # adapter; of these 10 % of each of three: 4 + 2 sqrt(27^2 + 9^2 + 15^2).
    slow = "arm 2; without waits for other frames"
    host = "behind the answer before, without waits for other frames; median 150.0 us"
    asked = [row for row in rows(answer) if row[0] not in ("load", "error frames") and "data" not in row[0]]
    assert asked[5:-1] == [
        ("cycle: period", 4000, 4000, 0.9, 11, "within", None, None, ""),
        ("cycles without requests", 0, 1, None, 12, "outside", 55, 55, ""),
        ("requests missing", 0, 0, None, 30, "within", None, None, ""),
        ("requests twice", 0, 1, None, 30, "outside", 56, 56, "1 of arm 1"),
        ("last answer after the first request", 1885, 1969, 68.3, 10, "not shown", 39, 62, ""),
        ("answers missing", 0, 2, None, 30, "outside", 27, 27, "2 of arm 1"),
        ("answers twice", 0, 1, None, 30, "outside", 51, 51, "1 of arm 2"),
        ("request to answer", 170, 450, 4, 10, "outside", 36, 43, slow),
        ("arm 1: request to answer", 170, 163, 4, 10, "within", None, 5, "median 160.0 us"),
        ("arm 2: request to answer", 170, 450, 4, 10, "outside", 36, 43, "median 165.0 us"),
        ("hand 1: request to answer", 300, 290, 4, 11, "within", None, 68, "median 280.0 us"),
        ("next request of the host", 170, 300, 4, 19, "outside", 67, 67, host),
    ]
    # Of 19 answers of the arm that nothing hides, ten take up to 165 us, and 80 of the host's 300 are its adapter's.
    arm = {"kind": "linear", "base_us": 165, "per_byte_us": 0, "grade": "measured", "uncertainty_us": 2}
    hand = {**arm, "base_us": 280, "worst_extra_us": 10, "payload_bytes": None, "time_us": None}
    assert rounded_edits(answer) == {
        **{f"group.arm.execution.{key}": value for key, value in {**arm, "worst_extra_us": 285}.items()},
        **{f"group.hand.execution.{key}": value for key, value in hand.items()},
        "bus.host_us": 220,
        "bus.host_grade": "measured",
        "bus.host_uncertainty_us": 2,
    }


def at_once() -> Log:
    """Twelve cycles, the first and the last in part: requests 20 us apart, the answers 60 us behind them."""
    log = Log()
    log.frame(0, 0x361, 4)
    for cycle in range(1, 13):
        log.us = 4000 * cycle
        log.frame(0, 0x141)
        if cycle == 4:
            log.frame(10, 0x700, 3)
        log.frame({3: 150, 4: 0}.get(cycle, 20), 0x142)
        if cycle == 6:  # the third is not asked, and nobody answers
            continue
        if cycle == 7:
            log.frame(20, 0x142)
        log.frame(20, 0x161)
        log.frame(200 if cycle == 5 else 60, 0x241)
        if cycle == 12:
            break
        log.frame(0, 0x242)
        log.frame(100, 0x261)
        log.frame(0, 0x361, 4)
    return log


def test_requests_at_once_are_those_by_hand(tmp_path: Path) -> None:
    answer = measured(ARM | {"bus": ARM["bus"] | {"access": "burst"}}, at_once(), tmp_path)
    # An answer of the first node begins behind two more requests: 20 + 112 + 20 + 112 + 60 = 324 us, and 140 more. That
    # of the second is directly behind it, and may have been queued as soon as it began, 132 us sooner. That of the hand
    # begins 60 + 113 + 112 + 100 = 385 us behind its request. All frames again, 300 us of the slowest node, and 180 of
    # the host; its adapter counts once: 4 + 2 sqrt(27^2 + 3^2 + 5^2).
    slow = "arm 1; without waits for other frames"
    host = "behind the request before, without waits for other frames; median 20.0 us"
    asked = [row for row in rows(answer) if row[0] not in ("load", "error frames") and "data" not in row[0]]
    assert asked[5:-1] == [
        ("cycle: period", 4000, 4000, 0.8, 12, "within", None, None, ""),
        ("cycles without requests", 0, 0, None, 12, "within", None, None, ""),
        ("requests missing", 0, 1, None, 33, "outside", 38, 38, "1 of hand 1"),
        ("requests twice", 0, 1, None, 33, "outside", 42, 42, "1 of arm 2"),
        ("last answer after the first request", 1385, 1092, 59.2, 10, "within", None, 37, ""),
        ("answers missing", 0, 3, None, 33, "outside", 38, 38, "1 of arm 1, 2 of arm 2"),
        ("answers twice", 0, 0, None, 33, "within", None, None, ""),
        ("request to answer", 170, 464, 4, 11, "outside", 5, 34, slow),
        ("arm 1: request to answer", 170, 464, 4, 11, "outside", 5, 34, "median 324.0 us"),
        ("arm 2: request to answer", 170, 332, 4, 10, "outside", 6, 35, "other frames may hide it"),
        ("hand 1: request to answer", 300, 525, 4, 10, "outside", 7, 36, "median 385.0 us"),
        ("next request of the host", 90, 150, 4, 23, "outside", 17, 17, host),
    ]
    # The host's time between requests at once is no part of a cycle that waits for it.
    assert not [key for key in answer.edits if key.startswith("bus.")]
    edits = rounded_edits(answer)
    assert [edits[f"group.{name}.execution.base_us"] for name in ("arm", "hand")] == [324, 385]


def test_nodes_that_never_answer_or_are_never_asked_hide_no_other(tmp_path: Path) -> None:
    log = Log()
    for cycle in range(20):
        log.us = 8000 * cycle
        for node, answer_us in enumerate((160, 170, None)):
            log.frame(100, 0x141 + node)
            if answer_us:
                log.frame(answer_us, 0x241 + node)
        if cycle == 9:
            log.frame(100, 0x244)
    plan = busplan.load_profile("can-motors-8", changes={"bus.nodes": 4})
    (tmp_path / "bus.log").write_text("".join(log.lines))
    found = {row[0]: row[1:] for row in rows(busplan.measured(plan, tmp_path / "bus.log"))}
    # Eight frames of 135 us, 250 us of each node, and three times 20 of the host between them.
    planned_us = 8 * 135 + 4 * 250 + 3 * 20
    assert found["last answer after the first request"][:2] == (planned_us, 112 + 160 + 113 + 100 + 112 + 170 + 112)
    (share,) = (one for one in busplan.measured(plan, tmp_path / "bus.log").figures if one.quantity.startswith("wire"))
    assert share.planned == 8 * 135 / planned_us
    # The fourth is never asked, and what it sends answers nothing. In the last cycle a log may end before it.
    assert (found["requests missing"][1], found["requests missing"][-1]) == (19, "19 of node 4")
    assert found["answers missing"][:2] == (0, 19)
    assert found["answers missing"][-1] == "19 of node 3"
    assert found["request to answer"][:2] == (250, 170)
    assert [name for name in found if name.endswith(": request to answer")] == [
        "node 1: request to answer",
        "node 2: request to answer",
    ]


def test_a_log_may_begin_within_a_request(tmp_path: Path) -> None:
    """A request of two frames, of whose first cycle the log has only the second one."""
    log = Log()
    for cycle in range(12):
        log.us = 8000 * cycle
        if cycle:
            log.frame(0, 0x141)
        log.frame(0, 0x241, 4)
        log.frame(150, 0x181)
    one = {"bus.nodes": 1, "payload.write_bytes": 12, "payload.feedback_identifier": 0x181}
    (tmp_path / "bus.log").write_text("".join(log.lines))
    answer = busplan.measured(busplan.load_profile("can-motors-8", changes=one), tmp_path / "bus.log")
    found = {row[0]: row[1:] for row in rows(answer)}
    assert found["cycle: period"][1] == 8000
    assert found["last answer after the first request"][1] == sum(frame.bits for frame in log.frames[2:5]) + 150


PRESS: dict[str, Any] = {
    "schema_version": 1,
    "name": "press",
    "bus": {
        "kind": "can",
        "bit_rate_kbit_s": 1000,
        "pipeline_cycles": 0,
        "sync_jitter_us": 20,
        "host_us": 100,
        "host_grade": "measured",
        "host_write_us": 30,
        "host_read_us": 50,
    },
    "cycle": {"period_us": 4000},
    "group": [
        {
            "name": name,
            "nodes": 1,
            "axes": 1,
            "read_bytes": size,
            "write_bytes": 8,
            "every": every,
            "execution": {
                "kind": "linear",
                "grade": "measured",
                "base_us": 150,
                "per_byte_us": 0,
                "worst_extra_us": 10,
            },
        }
        for name, size, every in (("fast", 8, 1), ("slow", 4, 2))
    ],
    "message": [
        {"name": "beats", "identifier": 0x700, "per_node": True, "payload_bytes": 1, "period_us": 8000},
        {"name": "pairs", "identifier": 0x300, "payload_bytes": 2, "period_us": 6000, "burst": 2},
        {"name": "often", "identifier": 0x302, "payload_bytes": 4, "period_us": 4000, "burst": 2, "jitter_us": 100},
        {"name": "rare", "identifier": 0x180, "identifier_bits": 29, "payload_bytes": 1, "period_us": 1000000},
        {"name": "never", "identifier": 0x680, "payload_bytes": 8, "period_us": 1000000},
    ],
}


def press() -> Log:
    """Twenty cycles, with a fault in some of them."""
    log = Log()
    for cycle in range(20):
        is_slow = cycle % 2 == 0
        start_us = log.us = 4000 * cycle + 600 * (cycle == 7)
        log.frame(0, 0x80, 0, is_sent=cycle != 12)
        log.frame(500 if cycle == 9 else 150, 0x181)
        if is_slow and cycle != 4:
            log.frame(0, 0x182, 5 if cycle == 8 else 4)
        log.frame({15: 300, 16: 900}.get(cycle, 180), 0x201)
        if is_slow and cycle != 4:
            log.frame(0, 0x202)
        log.frame(10, 0x201, is_sent=cycle == 3)
        if cycle == 13:
            log.error(20)
            log.error(100)
        log.us = start_us + 2000
        if is_slow:
            log.frame(40 * (cycle == 6), 0x701, 1)
            log.us = start_us + 2500 - {10: 250, 18: 90}.get(cycle, 0)
            log.frame(0, 0x702, 1)
        if cycle % 3 == 0:
            log.us = start_us + 3000
            for _ in range(3 if cycle == 15 else 2):
                log.frame(0, 0x300, 2)
        log.us = 4000 * cycle + 3500
        log.frame(0, 0x302, 5 if cycle == 8 else 4)
        log.frame(0, 0x180, 1, extended=True, is_sent=cycle in (5, 6))
    return log


def test_a_cycle_of_sync_is_that_by_hand(tmp_path: Path) -> None:
    answer = measured(PRESS, press(), tmp_path)
    # Planned: SYNC of 55 us, twice 160 of the nodes, feedback of 135 + 95, 100 of the host and 80 of its adapter, and
    # commands of 270; three frames of lower priorities, 135 + 135 + 95, and one of 90 that goes before all. 10 % of the
    # host and of each way through its adapter: 1 + 2 sqrt(10^2 + 3^2 + 5^2). SYNC may be late by 20 us and two frames.
    after_sync_us, host_us = 55 + 320 + 230 + 180 + 270 + 365 + 90, 180 + 365 + 90 + 135
    answers = busplan.latency(tmp_path / "plan.toml", timing_model=["worst-stuffing"]).transactions
    us = {f"{one.group} {one.transaction}".strip(): one.phases["worst_response_us"] or 0 for one in answers}
    late = "the latest: {} 1 ({})".format
    beats = "beats of slow 1 (0x702)"
    host = "planned: bus.host_read_us, bus.host_us, bus.host_write_us, the wait for other frames and its own"
    jitter = "planned: bus.sync_jitter_us, the wait for other frames and stuff bits"
    missing = "1 of feedback of slow 1 (0x182), 1 of command of slow 1 (0x202)"
    once = "not periodic, fewer than 10 frames"
    assert [*rows(answer)][6:] == [
        ("error frames", 0, 2, None, 137, "outside", 94, 94, ""),
        ("cycles without SYNC", 0, 1, None, 20, "outside", 78, 78, ""),
        ("PDOs missing", 0, 2, None, 52, "outside", 30, 30, missing),
        ("PDOs twice", 0, 1, None, 52, "outside", 26, 26, "1 of command of fast 1 (0x201)"),
        ("last PDO after SYNC", after_sync_us, 1468, 24.2, 20, "within", None, 116, late("command of slow", "0x202")),
        ("first command after the last feedback", host_us, 1013, 24.2, 9, "outside", 115, 115, host),
        ("SYNC: period", 4000, 4000, ANY, 19, "within", None, None, ""),
        ("SYNC: jitter of the arrival", us["SYNC"] - 47, 600, ANY, 19, "outside", 52, 52, jitter),
        ("SYNC: data", 0, 0, None, 19, "within", None, 1, ""),
        ("fast feedback: data", 8, 8, None, 20, "within", None, 2, ""),
        (
            "fast feedback: response",
            160 + us["fast feedback"],
            612,
            1.1,
            20,
            "outside",
            65,
            65,
            late("feedback of fast", "0x181"),
        ),
        ("slow feedback: data", 4, 5, None, 9, "outside", 58, 58, ""),
        (
            "slow feedback: response",
            160 + us["slow feedback"],
            351,
            1.1,
            9,
            "within",
            None,
            58,
            late("feedback of slow", "0x182"),
        ),
        ("fast command: data", 8, 8, None, 21, "within", None, 4, ""),
        (
            "fast command: response",
            after_sync_us - 160,
            1356,
            24.2,
            20,
            "not shown",
            115,
            115,
            late("command of fast", "0x201"),
        ),
        ("slow command: data", 8, 8, None, 9, "within", None, 5, ""),
        (
            "slow command: response",
            after_sync_us - 160,
            1468,
            24.2,
            9,
            "outside",
            116,
            116,
            late("command of slow", "0x202"),
        ),
        ("beats: period", 8000, 7990, ANY, 10, "within", None, None, beats),
        ("beats: sooner than its period", us["beats"] - 55, 249.2, 1, 10, "within", None, 76, beats),
        ("beats: data", 1, 1, None, 20, "within", None, 6, ""),
        ("beats: response", us["beats"], 250 + 55, None, 10, None, None, 118, beats),
        # 15 frames, the bound for the first and the last of which is 6867 us: 6867 / 14.
        ("pairs: period", 6000, 5147.6, 490.5, 15, "outside", None, None, "not periodic"),
        ("pairs: sooner than its period", us["pairs"] - 63 + 6000, 10162.2, 1, 15, "outside", 110, 110, ""),
        ("pairs: data", 2, 2, None, 15, "within", None, 8, ""),
        # A plan of pairs that may be 100 us late allows 20 frames that are 4100 us sooner: 4100 / 19.
        ("often: period", 4000, 4000, 215.8, 20, "within", None, None, ""),
        ("often: sooner than its period", us["often"] - 79 + 4000, 7.6, 1, 20, "within", None, 69, ""),
        ("often: data", 4, 5, None, 20, "outside", 63, 63, ""),
        ("often: response", us["often"], 8 + 79, None, 20, None, None, 63, ""),
        ("rare: period", 1_000_000, 4000, None, 2, None, None, None, once),
        ("rare: sooner than its period", us["rare"] - 75, 995_900, 1, 2, "outside", 51, 51, ""),
        ("rare: data", 1, 1, None, 2, "within", None, 40, ""),
        ("frames of the plan never in the log", 0, 1, None, 135, "not shown", None, None, ""),
        ("frames of no message of the plan", 0, 0, None, 0, "within", None, None, ""),
    ]
    keys = {one.quantity: one.key for one in answer.figures}
    assert {
        key for name, key in keys.items() if name.endswith("data") and name.split()[0] in ("SYNC:", "fast", "slow")
    } == {""}
    assert {keys[f"often: {name}"] for name in ("period", "sooner than its period", "data")} == {
        f"message.often.{name}_{unit}" for name, unit in (("period", "us"), ("jitter", "us"), ("payload", "bytes"))
    }
    assert (keys["fast feedback: response"], keys["fast command: response"]) == (
        "group.fast.execution",
        "cycle.period_us",
    )
    # Of the host's 1013 us 80 are its adapter's and 111 at least its command's.
    edits = {
        "bus.host_us": 822,
        "bus.host_uncertainty_us": 0.5,
        "bus.sync_jitter_us": 600.1,
        "bus.sync_jitter_cycles": 19,
        "message.pairs.period_us": 5147.6,
        "message.pairs.jitter_us": 0,
        "message.pairs.burst": 3,
        "message.often.payload_bytes": 5,
        "message.rare.jitter_us": 995_901,
    }
    assert answer.edits == {**edits, "bus.host_grade": "measured"}


def test_the_load_of_a_log_is_that_by_hand(tmp_path: Path) -> None:
    """The same log, whose first frame ended with its stamp: SYNC, of 51 bits. Lengths are those of Davis 2007."""
    log = press()
    found = {one.quantity: one for one in measured(PRESS, log, tmp_path).figures}
    span_us, bits = 79_582 - 51, sum(frame.bits for frame in log.frames)
    worst, least = (
        sum((extended if frame.extended else base) + each * frame.size for frame in log.frames)
        for base, extended, each in ((55, 80, 10), (47, 67, 8))
    )
    expected = {
        "load": (bits - 51) / span_us,
        "load, fullest second": (bits - 51) / span_us,
        "load, worst stuffing of these frames": (worst - 55) / span_us,
        "load, no stuffing of these frames": (least - 47) / span_us,
        "stuff bits of the possible ones": (bits - least) / (worst - least),
    }
    assert {name: found[name].recorded for name in expected} == pytest.approx(expected)
    # A frame more of each identifier, and the step of the stamps, 1 us.
    each = {frame[::2]: frame.bits for frame in reversed(log.frames)}
    assert found["load"].uncertainty == pytest.approx((sum(each.values()) + expected["load"]) / span_us)
    planned = (55 + 135 + 135) / 4000 + (95 + 135 + 2 * 65) / 8000 + 75 / 6000 + 95 / 4000 + (90 + 135) / 1e6
    assert found["load"].planned == pytest.approx(planned)


@pytest.mark.parametrize(("step_us", "is_shown"), [(2000, True), (2500, False)])
def test_stamps_of_a_step_over_half_a_cycle_show_nothing(step_us: int, is_shown: bool, tmp_path: Path) -> None:
    log = Log()
    for place in (0, 1, 3, 4, 5, 8, 9, 10, 11, 12, 14, 15):
        log.us = place * step_us - 51
        log.frame(0, 0x80, 0)
    reasons = measured(PRESS, log, tmp_path).shows_nothing
    words = "its stamps have steps of 2,500 us, and a cycle lasts 4,000"
    assert reasons == (() if is_shown else (words,))


SLOW = PRESS["group"][1] | {"nodes": 1, "every": 3, "axes": 2, "pdo_per": "axis", "read_bytes": 8, "write_bytes": 8}
OF_SLOW = {key: part for key, part in PRESS.items() if key != "message"} | {"group": [SLOW]}


def every_third(*, lost: int, silent: int, is_counted: bool) -> Log:
    """310 cycles; one SYNC is lost, and PDOs go with every third one that comes, or with every third period."""
    log, count = Log(), 0
    for cycle in range(310):
        log.us = 4000 * cycle
        log.frame(0, 0x80, 0, is_sent=cycle != lost)
        number = count if is_counted else cycle
        count += cycle != lost
        if number % 3 == 1 and not (is_counted and cycle == lost):
            for place in range(2):
                log.frame(150 if place == 0 else 0, 0x181 + place, 4, is_sent=(cycle, place) != (silent, 1))
            for place in range(2):
                log.frame(250 if place == 0 else 0, 0x201 + place, 4)
    return log


@pytest.mark.parametrize("is_counted", [True, False])
def test_pdos_of_every_third_sync_count_the_syncs_or_the_periods(is_counted: bool, tmp_path: Path) -> None:
    """SYNC 20 is lost, so that PDOs which count them come a cycle later from then on."""
    log = every_third(lost=20, silent=301 + is_counted, is_counted=is_counted)
    found = {row[0]: row[1:] for row in rows(measured(OF_SLOW, log, tmp_path))}
    # 103 of 310 periods have four PDOs; in the last of them the log may end.
    assert found["PDOs missing"][1:4] == (1, None, 4 * 102)
    assert found["PDOs missing"][-1] == "1 of feedback of slow 1, axis 2 (0x182)"
    assert found["PDOs twice"][1] == 0
    assert found["last PDO after SYNC"][1] == 150 + 250 + sum(frame.bits for frame in log.frames[2:6])


def test_cycles_of_requests_at_once_begin_where_a_node_is_asked_again(tmp_path: Path) -> None:
    """The second group is asked first, for its identifier is smaller, and a cycle leaves no pause of 90 %."""
    log = Log()
    for cycle in range(12):
        log.us = 1000 * cycle
        log.frame(0, 0x101)
        log.frame(0, 0x201)
        log.frame(20, 0x101, is_sent=cycle == 7)  # asked twice, too soon for another cycle
        log.frame(20, 0x181)
        log.frame(0, 0x281)
    identifiers = (("first", 0x201, 0x181), ("second", 0x101, 0x281))
    nodes = [
        ARM["group"][0] | {"name": name, "nodes": 1, "command_identifier": command, "feedback_identifier": feedback}
        for name, command, feedback in identifiers
    ]
    bus = {"kind": "can", "bit_rate_kbit_s": 1000, "access": "burst"}
    plan = ARM | {"bus": bus, "cycle": {"period_us": 1000}, "group": nodes}
    found = {row[0]: row[1:] for row in rows(measured(plan, log, tmp_path))}
    assert found["cycle: period"][1:5] == (1000, ANY, 12, "within")
    assert found["cycles without requests"][1:4] == (0, None, 12)
    # In the twelfth cycle the log may end.
    assert found["requests missing"][1:4] == (0, None, 22)
    assert found["requests twice"][1:4] == (1, None, 22)
    assert found["last answer after the first request"][1] == log.us - 11_000


def test_half_of_the_possible_stuff_bits_of_can_fd_is_in_doubt(tmp_path: Path) -> None:
    """8 bytes: 29 to 32 bits at 1000 kbit/s and 97 to 115 at 2000 (ISO 11898-1), so 83.5 us, known to 6."""
    log = Log()
    for cycle in range(12):
        for us, identifier in ((0, 0x141), (301, 0x241)):
            log.lines.append(f"({(5000 + 4000 * cycle + us) / 1e6:.6f}) can0 {identifier:X}##1{'55' * 8}\n")
    (tmp_path / "bus.log").write_text("".join(log.lines))
    plan = busplan.load_profile("can-motors-8", changes={"bus.nodes": 1, "bus.data_bit_rate_kbit_s": 2000})
    found = {row[0]: row[1:] for row in rows(busplan.measured(plan, tmp_path / "bus.log"))}
    # Beside the doubt of 1 us by the stamps, and of 3 us by the space behind a frame.
    assert found["request to answer"][1:3] == (301 - 83.5, 1 + 3 + 6)
