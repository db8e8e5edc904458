"""`busplan import` of a CAN log: what a simulated bus was given is found again, and the log is within the profile."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

import can
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import busplan
from busplan.recordings.can_timing import event_model
from tests.oracles.can_recording import Logged, Queued, arbitrated, bits_of, candump
from tests.registers import some

Run = Callable[..., Any]
BIT_RATES: Final = (33.3, 50, 83.3, 100, 125, 250, 500, 800, 1000)


class Network(NamedTuple):
    """A bus of known messages."""

    bit_rate_kbit_s: float
    logged: list[Logged]
    periods_us: dict[tuple[int, bool], float]
    """Of each periodic message."""
    fd: set[tuple[int, bool]]


def random_network(seed: int, *, span_us: float = 3e6) -> Network:
    """Periodic messages of either format, with jitter, some of CAN FD, and events in bursts."""
    random = Random(seed)
    bit_rate = random.choice(BIT_RATES)
    slow = max(1.0, 500 / bit_rate)
    queued: list[Queued] = []
    periods: dict[tuple[int, bool], float] = {}
    load, most, fd_share = 0.0, random.uniform(0.1, 0.6), random.choice([0, 0, 0.5, 1])
    aligned, zero = random.random() < 0.3, random.random() < 0.3
    while load < most:
        extended = random.random() < 0.4
        identifier = random.randrange(1 << 29 if extended else 1 << 11)
        fd = random.random() < fd_share
        size = random.choice([3, 8, 16, 48]) if fd else random.randint(0, 8)
        period = random.choice([5, 10, 13.7, 20, 50, 100, 200]) * 1000 * slow * (1 + random.uniform(-5e-5, 5e-5))
        if (identifier, extended) in periods:
            continue
        load += 160_000 / bit_rate / period
        jitter, start = random.choice([0, 0.01, 0.1]) * period, 0 if aligned else random.uniform(0, period)
        periods[identifier, extended] = period
        while start < span_us * slow:
            data = bytes(size) if zero else random.randbytes(size)
            queued.append(Queued(start + random.uniform(0, jitter), identifier, data, extended, fd))
            start += period
    for identifier in random.sample(range(1 << 11), 2):
        start = random.uniform(0, span_us * slow)
        while start < span_us * slow and (identifier, False) not in periods:
            queued += [
                Queued(start + k * 700, identifier, random.randbytes(8)) for k in range(random.choice([1, 1, 2]))
            ]
            start += random.expovariate(1 / random.choice([1e5, 1e6]))
    fd_messages = {(frame.identifier, frame.extended) for frame in queued if frame.fd}
    return Network(bit_rate, arbitrated(queued, bit_us=1000 / bit_rate), periods, fd_messages)


def imported(text: str, folder: Path, *, bit_rate_kbit_s: float | None = None) -> busplan.ImportAnswer:
    (folder / "drive.log").write_text(text, encoding="utf-8")
    return busplan.import_profile(folder / "drive.log", bit_rate_kbit_s=bit_rate_kbit_s)


def can_profile(answer: busplan.ImportAnswer) -> Any:
    """The profile, with the keys of CAN."""
    return answer.profile


def keys_of(answer: busplan.ImportAnswer) -> dict[tuple[int, bool], Any]:
    """Messages by identifier, and whether it has 29 bits."""
    profile = can_profile(answer)
    usual = profile.bus.identifier_bits
    return {(message.identifier, (message.identifier_bits or usual) == 29): message for message in profile.message}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(25))
def test_the_log_is_within_the_profile_that_is_made_of_it(seed: int, tmp_path: Path) -> None:
    network = random_network(seed)
    answer = imported(candump(network.logged), tmp_path, bit_rate_kbit_s=network.bit_rate_kbit_s)
    seen = busplan.measured(answer.profile, tmp_path / "drive.log")
    assert [figure.quantity for figure in seen.outside] == []
    messages = keys_of(answer)
    assert set(messages) == {(frame.identifier, frame.extended) for frame in network.logged}
    assert {key for key, message in messages.items() if message.fd} == network.fd
    doubts = {row.section: row.fact.note for row in answer.rows if row.key == "period_us"}
    periodic = 0
    for key, period_us in network.periods_us.items():
        if key not in messages:
            continue
        note = doubts[f"message.{messages[key].name}"]
        if ", U " in note:
            periodic += 1
            uncertainty_us = float(note.rpartition(", U ")[2].removesuffix(" us"))
            assert messages[key].period_us == pytest.approx(period_us, abs=uncertainty_us)
    assert periodic > len(network.periods_us) / 3


def test_each_value_says_where_it_is_from(tmp_path: Path) -> None:
    random = Random(1)
    queued = [Queued(k * 10_000.0, 0x18FEF1FE, random.randbytes(8), extended=True) for k in range(200)]
    queued += [Queued(k * 20_000.0 + 40, 0x0CF00400, random.randbytes(3), extended=True) for k in range(100)]
    queued += [Queued(700_300.0, 0x80, b"")]
    text = imported(candump(arbitrated(queued, bit_us=4)), tmp_path).text
    assert text.partition("\n\n")[2].splitlines() == [
        "[bus]",
        'kind = "can"               # published: drive.log:1',
        "bit_rate_kbit_s = 250      # assumed: from back-to-back frames in the log",
        "identifier_bits = 29       # published: used by most messages, drive.log:1",
        "",
        "[[message]]",
        'name = "id-0x80"',
        "identifier = 128           # measured: 0x80, drive.log",
        "identifier_bits = 11       # measured: drive.log",
        "payload_bytes = 0          # measured: the most seen, drive.log",
        "period_us = 1990000        # measured: 1 frame, not periodic: largest rate over a longer time, drive.log",
        'deadline_us = "none"       # assumed: not given, and the message is not periodic',
        "",
        "[[message]]",
        'name = "id-0xcf00400"',
        "identifier = 217056256     # measured: 0xcf00400, drive.log",
        "payload_bytes = 3          # measured: the most seen, drive.log",
        "period_us = 20000          # measured: 100 frames, U 4.8 us, drive.log",
        "jitter_us = 212            # measured: of the arrival, waiting for other frames included, drive.log",
        "",
        "[[message]]",
        'name = "id-0x18fef1fe"',
        "identifier = 419361278     # measured: 0x18fef1fe, drive.log",
        "payload_bytes = 8          # measured: the most seen, drive.log",
        "period_us = 10000          # measured: 200 frames, U 1.2 us, drive.log",
        "jitter_us = 29             # measured: of the arrival, waiting for other frames included, drive.log",
    ]


events = st.lists(st.integers(0, 10_000), min_size=1, max_size=12).map(sorted)


@given(events, st.floats(1, 20_000))
@example([38, 38, 38, 38], 1.9)
def test_no_time_of_a_log_has_more_events_than_the_model_allows(each: list[int], period_us: float) -> None:
    """Of any k + 1 events in a row at most a burst comes at once: the rest takes its periods, less the jitter."""
    burst, jitter_us = event_model(np.array(each, dtype=np.float64), period_us, stamp_error_us=0.0, tolerance=0.0)
    apart = [(j - i, each[j] - each[i]) for j in range(len(each)) for i in range(j)]
    early = [k * period_us - us for k, us in apart]
    assert all(k <= burst - 1 + (us + jitter_us) / period_us + 1e-9 for k, us in apart)
    # A burst or a jitter less does not hold them.
    if burst > 1:
        assert jitter_us == 0
        assert burst - 2 <= max(early) / period_us + 1e-9 <= burst - 1 + 2e-9
    else:
        assert jitter_us - 1 <= max([0.0, *early]) <= min(jitter_us, period_us) + 1e-6


@pytest.mark.parametrize("bit_rate", some(BIT_RATES, 4))
def test_frames_at_once_behind_each_other_show_the_bit_rate(bit_rate: float, tmp_path: Path) -> None:
    random = Random(5)
    periods = {0x100 + k: 1000 * random.choice([5, 10, 20]) * max(1, 500 / bit_rate) for k in range(12)}
    queued = [
        Queued(k * period + random.uniform(0, 500), identifier, random.randbytes(8))
        for identifier, period in periods.items()
        for k in range(150)
    ]
    answer = imported(candump(arbitrated(queued, bit_us=1000 / bit_rate)), tmp_path)
    assert can_profile(answer).bus.bit_rate_kbit_s == bit_rate
    assert f"The bit rate is {bit_rate:g} kbit/s, from back-to-back frames in the log" in answer.remarks


FRAME: Final = Logged(0, 0x2AA, b"\xa5" * 8, extended=False, bits=0)


def spaced(gaps_us: list[float]) -> str:
    """Frames of 111 bits so far from each other."""
    assert bits_of(FRAME) == 111
    return candump([FRAME._replace(us=us) for us in np.cumsum(gaps_us)])


@pytest.mark.parametrize(
    ("gaps_us", "lowest", "least"),
    [
        # 111 bits in 180 us are 617 kbit/s: stamps of two may be wrong.
        ([180, 4001] * 40, 83.3, "52.3"),
        # 444 bits in 720 us, and 100 us for a late stamp: 541 kbit/s; with one a millisecond late, less.
        ([180, 180, 180, 180, 4001] * 40, 500, "258"),
        ([4001, 180] * 9 + [2000] * 100, 83.3, "61.8"),
        # A driver hands several frames over at once: long windows say something.
        ([10, 11, 10, 4000] * 40, 250, "122"),
        # Frames as close as by 125, and as many a little later: chance.
        ([888, 4001] * 12 + [*range(910, 980)], 125, "116"),
        # Stamps of a step of 1 ms.
        ([5000.0, 0, 4000] * 300, 50, "40.4"),
        ([5000.0, 6000] * 300, 33.3, "20.1"),
    ],
)
def test_frames_do_not_overlap(gaps_us: list[float], lowest: float, least: str, tmp_path: Path) -> None:
    """Rates at which they would are none of those that a plan may have."""
    text = spaced(gaps_us)
    with pytest.raises(busplan.BusplanError, match=rf"The load of its fullest second is \d+ % at {lowest:g}, "):
        imported(text, tmp_path)
    with pytest.raises(busplan.BusplanError, match=f"frames of the log need at least {least} kbit/s"):
        imported(text, tmp_path, bit_rate_kbit_s=float(least) - 1)
    assert can_profile(imported(text, tmp_path, bit_rate_kbit_s=lowest)).bus.bit_rate_kbit_s == lowest


def test_periods_without_a_frame_do_not_make_a_period_longer(tmp_path: Path) -> None:
    frames = [Logged(k * 10_000.0 + k % 3, 0x181, bytes(8), False, 0) for k in range(300) if k % 20 != 7]
    (message,) = can_profile(imported(candump(frames), tmp_path, bit_rate_kbit_s=500)).message
    assert message.period_us == 10_000
    assert 2 <= message.jitter_us <= 4


def test_a_log_may_end_with_a_frame_more_than_its_length_has_periods(tmp_path: Path) -> None:
    queued = [Queued(k * 10_000.0 + start, 0x180 + start, b"\x3c" * 8) for k in range(10) for start in range(4)]
    answer = imported(candump(arbitrated(queued)), tmp_path)
    figures = busplan.measured(answer.profile, tmp_path / "drive.log").figures
    (load,) = (figure for figure in figures if figure.quantity == "load")
    assert load.recorded > load.planned  # type: ignore[operator]
    assert load.verdict == "not shown"


DATABASE = """VERSION ""
BO_ 257 Engine: 8 ECU
BO_ 258 Door: 8 ECU
BO_ 128 Wake: 2 ECU
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 257 20;
BA_ "GenMsgCycleTime" BO_ 128 100;
"""


def test_a_database_gives_names_and_periods_and_the_log_the_rest(tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text(DATABASE)
    random = Random(2)
    # The engine sends in pairs, more often than the database says.
    starts = [k * 30_000.0 + near for k in range(100) for near in (0, 200)]
    queued = [Queued(us, 257, random.randbytes(8)) for us in starts]
    queued += [Queued(k * 50_000.0, 258, random.randbytes(4)) for k in range(60)]
    queued += [Queued(k * 50_000.0 + 9, 300, random.randbytes(12), fd=True) for k in range(60)]
    text = candump(arbitrated(queued))
    for files in (["drive.log", "car.dbc"], ["car.dbc", "drive.log"]):
        (tmp_path / "drive.log").write_text(text)
        answer = busplan.import_profile([tmp_path / name for name in files])
        messages: dict[str, Any] = {message.name: message for message in can_profile(answer).message}
        assert sorted(messages) == ["Door", "Engine", "id-0x12c"]
        engine, door = messages["Engine"], messages["Door"]
        assert (engine.period_us, engine.jitter_us) == pytest.approx((15_000, 14_800), rel=0.05)
        assert (door.payload_bytes, door.period_us) == (8, 50_000)
        assert messages["id-0x12c"].fd
        assert any(remark.startswith("left out, never in ") and "Wake" in remark for remark in answer.remarks)
        assert any(", every 20,000 by car.dbc:2: the log's is used" in remark for remark in answer.remarks)


def test_a_log_that_needs_more_than_the_bit_rate_of_a_database_has_its_own(tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text(DATABASE + 'BA_DEF_ "Baudrate" INT 0 1000000;\nBA_ "Baudrate" 500;\n')
    random = Random(2)
    queued = [Queued(k * 20_000.0, 257 + more, random.randbytes(8)) for k in range(60) for more in (0, 1, 43, 44, 45)]
    slow, fast = (candump(arbitrated(queued, bit_us=us)) for us in (2.0, 1.0))
    rates = []
    for text in (slow, fast):
        (tmp_path / "drive.log").write_text(text)
        answer = busplan.import_profile([tmp_path / "drive.log", tmp_path / "car.dbc"])
        rates.append(can_profile(answer).bus.bit_rate_kbit_s)
    assert rates == [500, 1000]
    assert any("car.dbc says 500 kbit/s and " in remark for remark in answer.remarks)


def test_0x80_is_sync_in_a_profile_with_nodes_alone(tmp_path: Path) -> None:
    (tmp_path / "car.dbc").write_text(DATABASE)
    node = Path(__file__).parent / "files" / "axis-5.dcf"
    alone: Any = busplan.import_profile(tmp_path / "car.dbc").profile
    assert [message.name for message in alone.message] == ["Wake", "Engine"]
    beside: Any = busplan.import_profile([node, tmp_path / "car.dbc"]).profile
    assert [message.name for message in beside.message if message.name in ("Wake", "Engine")] == ["Engine"]


@pytest.mark.parametrize("ending", ["asc", "blf", "trc"])
def test_every_format_of_a_log_is_known_by_its_content(ending: str, tmp_path: Path, run: Run) -> None:
    random = Random(3)
    with can.Logger(str(tmp_path / f"bus.{ending}")) as writer:
        for k in range(60):
            for identifier, extended in ((0x181, False), (0x18FEF1FE, True)):
                stamp = 1_700_000_000 + k * 0.01 + extended * 0.001
                data = random.randbytes(8)
                writer(
                    can.Message(
                        timestamp=stamp, arbitration_id=identifier, is_extended_id=extended, data=data, channel=0
                    )
                )
    (tmp_path / f"bus.{ending}").rename(tmp_path / "bus.txt")
    done = run("import", "bus.txt", "-o", "bus.toml", "--bit-rate", "500", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "The log has 120 frames of 2 identifiers in 0.591 s" in done.stderr.splitlines()
    loaded: Any = busplan.load_profile(tmp_path / "bus.toml")
    assert [message.period_us for message in loaded.message] == [10_000, 10_000]
    measured = run("measured", "bus.toml", "bus.txt", cwd=tmp_path)
    assert ": 10 of 10 figures within the plan." in measured.stdout


def coarse(logged: list[Logged], step_us: float) -> list[Logged]:
    """The frames with stamps of a step."""
    return [frame._replace(us=frame.us // step_us * step_us) for frame in logged]


def random_queue(*, jitter_us: float = 300.0) -> list[Queued]:
    random = Random(8)
    periods = {0x100 + 16 * k: random.choice([10_000, 20_000, 50_000]) for k in range(20)}
    return [
        Queued(k * period + random.uniform(0, jitter_us), identifier, random.randbytes(8))
        for identifier, period in periods.items()
        for k in range(3_000_000 // period)
    ]


def test_a_bus_of_250_kbit_s_is_not_taken_for_500_by_coarse_stamps(tmp_path: Path) -> None:
    logged = coarse(arbitrated(random_queue(), bit_us=4.0), 100.0)
    with pytest.raises(busplan.BusplanError, match=r"The load of its fullest second is .*%  ?at 250, "):
        imported(candump(logged), tmp_path)


@cache
def shaken() -> tuple[list[Queued], list[Logged]]:
    queued = random_queue(jitter_us=800.0)
    return queued, arbitrated(queued, bit_us=2.0)


@pytest.mark.parametrize("step_us", [pytest.param(1.0, marks=pytest.mark.slow), 100.0, 1000.0])
def test_no_response_is_below_the_delay_of_a_bus_with_coarse_stamps(step_us: float, tmp_path: Path) -> None:
    queued, logged = shaken()
    answer = imported(candump(coarse(logged, step_us)), tmp_path, bit_rate_kbit_s=500)
    names = {message.identifier: message.name for message in can_profile(answer).message}
    rows = [row for row in busplan.latency(answer.profile).transactions if row.timing_model == "worst-stuffing"]
    responses: dict[str, Any] = {row.transaction: row.phases["worst_response_us"] for row in rows}
    for identifier, name in names.items():
        starts = sorted(frame.us for frame in queued if frame.identifier == identifier)
        ends = [frame.us + 3 * 2.0 for frame in logged if frame.identifier == identifier]
        # From the place of its period on, less the latest queueing: what the plan calls its response.
        assert responses[name] >= max(end - start for start, end in zip(starts, ends, strict=True))
    assert busplan.measured(answer.profile, tmp_path / "drive.log").outside == ()


def test_stamps_of_whole_seconds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(busplan.BusplanError, match="stamps have steps of 1,000,000 us, too coarse for 0x1") as refused:
        imported(candump(coarse(arbitrated(random_queue()), 1e6)), tmp_path)
    assert "record with finer stamps" in str(refused.value)


def test_frames_that_no_bus_carries_are_refused(tmp_path: Path) -> None:
    replayed = [frame._replace(us=27.0 * k) for k, frame in enumerate(arbitrated(random_queue())[:400])]
    with pytest.raises(
        busplan.BusplanError, match="kbit/s, more than a CAN bus has: the stamps are not those of the bus"
    ):
        imported(candump(replayed), tmp_path)


def test_fd_frames_without_a_switch_are_planned_without(tmp_path: Path) -> None:
    queued = [Queued(k * 5000.0 + node * 400, 0x200 + node, bytes(64), fd=True) for k in range(100) for node in (1, 2)]
    text = candump(arbitrated(queued)).replace("##1", "##0")
    answer = imported(text, tmp_path, bit_rate_kbit_s=500)
    assert all(message.fd and not message.brs for message in can_profile(answer).message)
    assert can_profile(answer).bus.data_bit_rate_kbit_s is None
    (figures, *_) = busplan.capacity(answer.profile).figures
    # Two frames of 64 bytes in 5 ms, all of it at the nominal rate.
    us = 712 * 1000 / can_profile(answer).bus.bit_rate_kbit_s
    assert busplan.CanMessageFigures.of(figures).bus_load == pytest.approx(2 * us / 5000, rel=0.03)
    assert busplan.measured(answer.profile, tmp_path / "drive.log").outside == ()
    # A plan with a switch of bit rate is not that of this machine.
    plan = answer.profile.model_dump(exclude_unset=True)
    plan["bus"]["data_bit_rate_kbit_s"] = 2000
    for message in plan["message"]:
        del message["brs"]
    outside = busplan.measured(type(answer.profile)(**plan), tmp_path / "drive.log").outside
    assert [figure.quantity for figure in outside] == [
        "load",
        "id-0x201: frames of another format",
        "id-0x202: frames of another format",
    ]


LINE = "(1700000000.{:06d}) can0 {}\n"
LINES = "".join(LINE.format(k * 1000, "181#0011") for k in range(40))
TWO_CLOCKS = "".join(f"({k / 1000 + s:.6f}) can0 181#0011\n" for k in range(400) for s in (0, 19))
REFUSED = {
    "one frame": (LINE.format(0, "181#00"), "drive.log: 1 frame, none of an identifier that comes 10 times"),
    "one time": (LINE.format(7, "181#00") * 19, "drive.log: its stamps have one time for all frames"),
    "two clocks": (TWO_CLOCKS, "drive.log: its stamps jump back 399 times by about 19 s, and forward again"),
    "errors alone": (LINE.format(0, "20000080#0000000000000000"), "has no CAN frame but 1 error frame"),
    "two channels": (
        LINES + LINES.replace("can0", "can1"),
        "has frames of 2 channels: can0 (40 frames), can1 (40 frames); --channel NAME reads one",
    ),
    "cut at once": ("(1700000000.000000) can0 181#", "drive.log: 1 frame, none of an identifier that comes 10 times"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_log_without_periods_is_refused(case: str, tmp_path: Path) -> None:
    text, words = REFUSED[case]
    with pytest.raises(busplan.BusplanError) as refused:
        imported(text, tmp_path)
    assert words in str(refused.value)


LAST = "".join(LINES.splitlines(keepends=True)[-9:])
QUEUES = "".join(
    f"({block / 10 + k / 100 + late_s:.6f}) can0 {identifier}#0011\n"
    for block in range(20)
    for identifier, late_s in (("201", 0), ("101", 0.003))
    for k in range(10)
)
SAID = {
    "cut": (
        LINES + "(17000",
        "The log is cut or damaged after frame 40, read up to there: line 41 is not a candump line",
    ),
    "clock": (
        LAST + LINES,
        "Its clock was set back 1 time: the longest stretch between is used.",
    ),
    "queues": (QUEUES, "Its frames are up to 87 ms out of order, as from several queues: sorted."),
    "errors": (LINES + LINE.format(99_000, "20000080#0000000000000000"), "1 error frame: not counted in the load"),
    "remote": (LINES + LINE.format(99_000, "182#R8"), "1 remote frame: taken with the data of the length code"),
    "seldom": (
        LINES + LINE.format(99_000, "182#"),
        "fewer than 10 frames, so a longer log knows the period better: 0x182",
    ),
}


@pytest.mark.parametrize("case", SAID)
def test_what_a_log_hides_is_said(case: str, tmp_path: Path) -> None:
    text, words = SAID[case]
    answer = imported(text, tmp_path, bit_rate_kbit_s=500)
    assert any(remark.startswith(words) for remark in answer.remarks), answer.remarks
    outside = busplan.measured(answer.profile, tmp_path / "drive.log").outside
    assert [figure.quantity for figure in outside] == ["error frames"] * (case == "errors")


def test_bursts_are_planned_as_bursts(tmp_path: Path) -> None:
    starts = [k * 100_000.0 + near for k in range(50) for near in (0, 400, 800)]
    lines = candump([Logged(us, 0x7E8, bytes(8), False, 0) for us in starts])
    answer = imported(lines, tmp_path, bit_rate_kbit_s=500)
    assert "in bursts, each with the largest burst in the log: 0x7e8" in answer.remarks
    (message,) = can_profile(answer).message
    # Their mean distance, and not that of the closest.
    assert message.burst == 3
    assert message.period_us == pytest.approx(100_000 / 3, rel=0.05)
    assert busplan.measured(answer.profile, tmp_path / "drive.log").outside == ()


@pytest.mark.slow
def test_many_identifiers_and_any_bytes_are_no_crash(tmp_path: Path) -> None:
    random = Random(4)
    often = [(k * 100_000 + 7, "7FF#00") for k in range(10)]
    frames = [(k * 300, f"{random.randrange(1500):03X}#{random.randbytes(8).hex()}") for k in range(3300)] + often
    frames.sort()
    answer = imported("".join(LINE.format(us, frame) for us, frame in frames), tmp_path, bit_rate_kbit_s=500)
    assert len(can_profile(answer).message) > 1200
    text = LINES.encode()
    for _ in range(60):
        damaged = bytearray(text)
        for _ in range(random.randint(1, 4)):
            damaged[random.randrange(len(damaged))] = random.randrange(256)
        (tmp_path / "drive.log").write_bytes(damaged[: random.randrange(len(damaged))])
        try:
            busplan.import_profile(tmp_path / "drive.log", bit_rate_kbit_s=500)
        except busplan.BusplanError as error:
            assert len(error.problems) == 1  # noqa: PT017


def test_a_log_does_not_go_beside_another(tmp_path: Path, run: Run) -> None:
    for name in ("a.log", "b.log"):
        (tmp_path / name).write_text(LINES)
    two = run("import", "a.log", "b.log", cwd=tmp_path)
    assert (two.returncode, two.stderr) == (2, "a.log and b.log are both logs; give the longer one\n")
    piped = run("import", "-", stdin=LINES, cwd=tmp_path)
    assert (piped.returncode, piped.stderr) == (2, "<stdin>: a recording is read from a file\n")
