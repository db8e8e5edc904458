"""Logs of a simulated CAN bus: what was sent is found again, to the bit; what the log hides is said."""

import json
from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import can
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import busplan
from busplan.errors import BusplanError
from busplan.recordings.can_bits import written_bits
from tests.oracles.can_recording import Logged, Queued, arbitrated, bits_of, candump, servo_8
from tests.registers import at_least

if TYPE_CHECKING:
    from subprocess import CompletedProcess

Run = Callable[..., "CompletedProcess[str]"]
PLAN = "can-servo-8"
LOGGED = arbitrated(servo_8(300))


def of_log(text: str, tmp_path: Path, *, plan: Any = PLAN, **options: Any) -> busplan.MeasuredAnswer:
    path = tmp_path / "bus.log"
    path.write_text(text)
    return busplan.measured(plan, path, **options)


def figure(answer: busplan.MeasuredAnswer, start: str) -> Any:
    (recorded,) = (figure for figure in answer.figures if f"{figure.quantity} ".startswith(start))
    return recorded


frames = st.builds(
    Queued,
    st.just(0.0),
    st.integers(0, 0x7FF),
    st.binary(max_size=8) | st.sampled_from([bytes(8), b"\xff" * 8, b"\x0f" * 8, b"\xc3" * 5]),
    st.booleans(),
    st.just(False),
)


@given(st.lists(frames, min_size=1, max_size=50), st.integers(0, 0x3FFFF))
def test_the_bits_of_a_frame_are_those_written_one_by_one(frames: list[Queued], lower: int) -> None:
    frames = [
        frame._replace(identifier=frame.identifier << 18 | lower) if frame.extended else frame for frame in frames
    ]
    bits = written_bits(
        np.array([frame.identifier for frame in frames]),
        np.array([frame.extended for frame in frames]),
        np.zeros(len(frames), dtype=np.bool_),
        np.array([len(frame.data) for frame in frames]),
        np.array([int.from_bytes(frame.data.ljust(8, b"\0"), "big") for frame in frames], dtype=np.uint64),
    )
    assert bits.tolist() == [bits_of(frame) for frame in frames]


@pytest.mark.parametrize("seed", range(at_least(2)))
def test_a_machine_within_its_plan_is_found_to_be(tmp_path: Path, seed: int) -> None:
    logged = arbitrated(servo_8(300, seed=seed))
    answer = of_log(candump(logged), tmp_path)
    assert [figure.quantity for figure in answer.outside] == []
    assert answer.edits == {}
    assert answer.day == "2023-11-14"
    # Every bit is counted: the load is that of the simulation.
    load = sum(frame.bits for frame in logged[1:]) / (logged[-1].us - logged[0].us)
    assert figure(answer, "load ").recorded == pytest.approx(load, rel=1e-6)
    none, worst = (figure(answer, f"load, {sort}").recorded or 0 for sort in ("no", "worst"))
    assert none < load < worst
    assert figure(answer, "SYNC: period").recorded == pytest.approx(4000, abs=0.5)
    jitter = figure(answer, "heartbeats: sooner than its period")
    # Of the worst frame nothing but its stamp is uncertain: by its step of 1 us, and by as much where it was rounded.
    assert (jitter.unit, 1 <= jitter.uncertainty <= 2) == ("us", True)
    assert figure(answer, "sdo-request: period").note == "not periodic"
    starts = [frame.us for frame in logged if frame.identifier == 0x80]
    last = max(
        frame.us - starts[bisect_right(starts, frame.us) - 1] for frame in logged if 0x181 <= frame.identifier <= 0x208
    )
    assert figure(answer, "last PDO after SYNC").recorded == pytest.approx(last, abs=1)


def test_the_load_is_the_mean_and_that_of_the_fullest_second(tmp_path: Path) -> None:
    """A second of traffic in a minute."""
    logged = [Logged(k * 1000.0, 0x100, b"\x5a" * 8, False, 0) for k in range(1001)]
    logged += [Logged(k * 1e6, 0x101, b"\x5a" * 8, False, 0) for k in range(2, 61)]
    answer = of_log(candump(logged), tmp_path)
    mean, fullest = figure(answer, "load "), figure(answer, "load, fullest second")
    us = bits_of(logged[0]._replace(us=0.0))
    assert mean.recorded == pytest.approx((1000 + 59) * us / 60e6, rel=0.01)
    assert fullest.recorded == pytest.approx(1000 * us / 1e6, rel=0.01)
    assert (fullest.planned, fullest.verdict) == (mean.planned, None)


@given(
    st.lists(
        st.tuples(st.sampled_from([0, 1, 2, 30, 150, 230, 600, 2000, 100_000]), st.sampled_from([0x80, 0x181, 0x7FF])),
        min_size=2,
        max_size=90,
    ),
    st.integers(1, 6),
)
@example([(100_000, 0x181), *[(2, 0x181)] * 4] * 8, 6)
def test_no_doubt_is_negative(steps: list[tuple[int, int]], repeated: int) -> None:
    """Of no figure: of batches that a driver reads at once, of bursts, or of a few frames."""
    stamps = np.cumsum([us for us, _ in steps * repeated])
    identifiers = [identifier for _, identifier in steps * repeated]
    rows = [Logged(us, each, bytes(8), False, 0) for us, each in zip(stamps.tolist(), identifiers, strict=True)]
    with TemporaryDirectory() as folder:
        answer = of_log(candump(rows), Path(folder))
    assert [row for row in answer.figures if (row.uncertainty or 0.0) < 0] == []


def test_a_log_of_two_clocks_is_refused(tmp_path: Path) -> None:
    text = "".join(f"({k / 1000 + s:.6f}) can0 181#00\n" for k in range(40) for s in (0, 19))
    with pytest.raises(BusplanError, match=r"bus.log: its stamps jump back 39 times by about 19 s, and forward again"):
        of_log(text, tmp_path)


def test_every_format_has_the_same_frames(tmp_path: Path) -> None:
    logged = [*LOGGED[:400], Logged(LOGGED[400].us, 0x18FF0102, b"\1\2\3", True, 0)]
    exact: busplan.MeasuredAnswer | None = None
    for ending in ("log", "asc", "blf", "trc"):
        path = tmp_path / f"bus.{ending}"
        with can.Logger(str(path)) as writer:
            for frame in logged:
                writer(
                    can.Message(
                        timestamp=1_700_000_000 + frame.us / 1e6,
                        arbitration_id=frame.identifier,
                        is_extended_id=frame.extended,
                        data=frame.data,
                        channel=0,
                    )
                )
        answer = busplan.measured(PLAN, path)
        exact = exact or answer
        step_us = 200 if ending == "trc" else 4
        assert [figure.quantity for figure in answer.figures] == [figure.quantity for figure in exact.figures]
        for row, of_log in zip(answer.figures, exact.figures, strict=True):
            allowed = {"us": step_us, "share": 0.001, "kbit/s": 1000}.get(row.unit, 0)
            assert row.recorded == pytest.approx(of_log.recorded, abs=allowed), (ending, row.quantity)
        assert figure(answer, "frames of no message").note == "0x18ff0102"
        assert not any("damaged" in remark for remark in answer.remarks)


def test_what_is_planned_and_not_seen_and_seen_and_not_planned_is_said(tmp_path: Path) -> None:
    gone = {0x708, 0x183, 0x601}
    logged = [frame for frame in LOGGED if frame.identifier not in gone]
    logged += [Logged(k * 900.0 + 3, 0x7FF - k % 2, b"\1", False, 0) for k in range(20)]
    logged += [Logged(50.0, 0x181, b"", True, 0)]
    answer = of_log(candump(sorted(logged)), tmp_path)
    unseen = figure(answer, "frames of the plan never in the log")
    assert (unseen.hidden, unseen.verdict) == (
        "never in the log: feedback of node 3 (0x183), sdo-request, heartbeats",
        "not shown",
    )
    assert figure(answer, "PDOs missing").note == "299 of feedback of node 3 (0x183)"
    assert figure(answer, "last PDO after SYNC").recorded > 0
    unplanned = figure(answer, "frames of no message")
    # 0x181 of 29 bits is not the feedback of 11.
    assert (unplanned.recorded, unplanned.note, unplanned.verdict) == (21, "0x181, 0x7fe, 0x7ff", "outside")


def test_a_message_that_comes_more_often_or_longer_is_outside_and_measured(tmp_path: Path) -> None:
    plan = busplan.load_profile(PLAN, changes={"message.heartbeats.period_us": 70_000})
    logged = [frame._replace(data=b"\5\6") if frame.identifier == 0x708 else frame for frame in LOGGED]
    answer = of_log(candump(logged), tmp_path, plan=plan)
    assert [figure.quantity for figure in answer.outside] == ["heartbeats: period", "heartbeats: data"]
    assert answer.edits["message.heartbeats.payload_bytes"] == 2
    assert answer.edits["message.heartbeats.period_us"] == pytest.approx(50_000, rel=2e-3)


def test_jitter_and_late_cycles_are_outside(tmp_path: Path) -> None:
    late = [frame._replace(us=frame.us + 3000 * (frame.identifier == 0x208)) for frame in servo_8(100)]
    shaken = arbitrated(servo_8(300, sync_jitter_us=900))
    jitter = figure(of_log(candump(shaken), tmp_path), "SYNC: jitter")
    assert (jitter.recorded, jitter.verdict) == (pytest.approx(900, abs=150), "outside")
    # The drives may be slower than assumed; where their time is measured, the PDO is late.
    assert figure(of_log(candump(arbitrated(late)), tmp_path), "last PDO").verdict == "not shown"
    plan = busplan.load_profile(PLAN, changes={"node.execution.grade": "measured"})
    answer = of_log(candump(arbitrated(late)), tmp_path, plan=plan)
    assert [figure.quantity for figure in answer.outside] == ["last PDO after SYNC", "command: response"]


def test_every_frame_of_a_pdo_has_a_name_of_its_own(tmp_path: Path) -> None:
    answer = of_log(candump(LOGGED), tmp_path, plan="canopen-6")
    assert figure(answer, "feedback 1: data").recorded == 8
    assert "feedback 2, command 2," in figure(answer, "frames of the plan never in the log").hidden


def test_a_plan_that_is_too_full_has_no_response_to_stand_beside(tmp_path: Path) -> None:
    plan = busplan.load_profile(PLAN, changes={"bus.bit_rate_kbit_s": 125})
    answer = of_log(candump(LOGGED), tmp_path, plan=plan)
    assert figure(answer, "sdo-request: sooner").planned is None
    assert "NaN" not in answer.to_json()
    assert "Infinity" not in answer.to_json()


def test_stamps_that_are_late_are_said_and_doubted(tmp_path: Path) -> None:
    frame = Queued(0.0, 0x300, b"\xaa" * 8, False, False)
    bits = bits_of(frame)  # at 1000 kbit/s a microsecond each

    def answer(late_us: float) -> busplan.MeasuredAnswer:
        """Frames directly after each other, of which each fourth is stamped late."""
        stamps_us = (bits * place + (late_us if place % 4 == 1 else 0.0) for place in range(400))
        return of_log(candump([Logged(us, 0x300, frame.data, False, bits) for us in stamps_us]), tmp_path)

    # Of a frame that none follows nobody sees how late it is: as late again as it is long.
    in_time, late = answer(0.0), answer(40.0)
    words = "Frames come up to {} us closer than the bus allows: stamps are late, and U holds it."
    assert words.format(40 + bits) in late.remarks
    assert not any("closer than the bus allows" in remark for remark in in_time.remarks)
    doubts = [figure(log, "load ").uncertainty or 0.0 for log in (late, in_time)]
    assert doubts[0] - doubts[1] == pytest.approx((40 + bits) / (399 * bits), rel=1e-3)


def test_a_clock_that_is_set_back_is_said(tmp_path: Path) -> None:
    middle = LOGGED[len(LOGGED) * 2 // 3].us
    logged = [frame._replace(us=frame.us - (frame.us > middle) * 1e6) for frame in LOGGED]
    answer = of_log(candump(logged), tmp_path)
    assert "Its clock was set back 1 time: the longest stretch between is used." in answer.remarks
    assert figure(answer, "SYNC: period").verdict == "within"
    assert figure(answer, "SYNC: period").events in {200, 201}


def test_errors_remote_frames_and_can_fd_are_said(tmp_path: Path) -> None:
    more = "(1700000000.000001) can0 123#R\n(1700000000.000002) can0 20000080#0000000000000000\n"
    fd = "(1700000000.000003) can0 124##1" + "AA" * 16 + "\n"
    answer = of_log(more + fd + candump(LOGGED), tmp_path)
    words = (
        "1 frame of CAN FD: in the load with half of the possible stuff bits, 1 not counted in the load: the "
        "plan has no "
    )
    assert f"{words}data bit rate." in answer.remarks
    assert "1 remote frame: the length code is shown as data." in answer.remarks
    assert figure(answer, "error frames").recorded == 1


def test_frames_of_can_fd_are_in_the_load_with_half_of_the_possible_stuff_bits(tmp_path: Path) -> None:
    lines = [
        f"({1_700_000_000 + cycle // 1000}.{cycle % 1000:03d}000) can0 181##1{'5A' * 12}\n" for cycle in range(2000)
    ]
    answer = of_log("".join(lines), tmp_path, plan="can-fd-arm-7")
    assert "2,000 frames of CAN FD: in the load with half of the possible stuff bits." in answer.remarks
    plan: Any = busplan.load_profile("can-fd-arm-7")
    nominal_us, data_us = 1000 / plan.bus.bit_rate_kbit_s, 1000 / plan.bus.data_bit_rate_kbit_s
    least_us, most_us = 29 * nominal_us + 129 * data_us, 32 * nominal_us + 155 * data_us
    load = figure(answer, "load ")
    assert load.recorded == pytest.approx((least_us + most_us) / 2 / 1000, rel=0.01)
    assert load.uncertainty == pytest.approx((most_us - least_us) / 2 / 1000, rel=0.05)


def test_stuffing_is_that_of_classical_frames(tmp_path: Path) -> None:
    fd = "".join(f"(1700000005.{number:06d}) can0 7F0##1{'00' * 64}\n" for number in range(0, 999_000, 1000))
    alone, mixed = (of_log(candump(LOGGED) + more, tmp_path, plan="can-fd-arm-7") for more in ("", fd))
    stuffing = [figure(answer, "stuff bits").recorded for answer in (alone, mixed)]
    assert stuffing[0] == pytest.approx(stuffing[1], rel=1e-3)


def test_a_long_length_code_of_a_classical_frame_is_one_of_8_bytes(tmp_path: Path) -> None:
    head = "date Sam Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\ninternal events logged\n"
    frames = [f"{k / 100:.6f} 1  181  Tx   d {'8AF'[k % 3]} 00 11 22 33 44 55 66 77\n" for k in range(60)]
    (tmp_path / "bus.asc").write_text(head + "".join(frames))
    answer = busplan.measured(PLAN, tmp_path / "bus.asc")
    assert figure(answer, "feedback: data").recorded == 8
    assert not any("CAN FD" in remark for remark in answer.remarks)
    codes = np.array([8, 10, 15])
    data = np.full(3, 0x0011223344556677, dtype=np.uint64)
    written = written_bits(np.full(3, 0x181), np.zeros(3, bool), np.zeros(3, bool), codes, data)
    load = sum(written[k % 3] for k in range(1, 60)) / 590_000
    assert figure(answer, "load ").recorded == pytest.approx(load, rel=1e-6)
    # Counted one by one, each with the other code in its length field and CRC.
    words = [f"{0x181:012b}000{code:04b}{0x0011223344556677:064b}" for code in codes]
    for word, bits in zip(words, written, strict=True):
        crc = 0
        for bit in word:
            crc = (crc << 1 & 0x7FFF) ^ (0x4599 if (crc >> 14) != int(bit) else 0)
        sent = ""
        for bit in f"{word}{crc:015b}":
            sent += bit
            if len(sent) > 4 and len(set(sent[-5:])) == 1:
                sent += str(1 - int(bit))
        assert bits == len(sent) + 13


@pytest.mark.parametrize(
    ("stamps_us", "kbit_s", "surely_kbit_s"),
    [
        # The most frames that count together are 30. Each stamp is one step, 1 us, and a slow driver's 100 us wide.
        ([1000 * number for number in range(40)], 30 * 58e3 / (30_000 + 1 + 100), 30 * 58e3 / 31_001),
        # Three at a time, 1 us apart: the driver read them at once, each by up to the 174 us that they take at
        # 1 Mbit/s. Of 20 frames in a row the shortest take six distances of 3 ms and two steps.
        (
            [3000 * (number // 3) + number % 3 for number in range(60)],
            20 * 58e3 / (18_002 + 1 + 3 * 58),
            20 * 58e3 / 19_003,
        ),
    ],
)
def test_the_bit_rate_that_frames_need_is_that_counted_by_hand(
    stamps_us: list[int], kbit_s: float, surely_kbit_s: float, tmp_path: Path
) -> None:
    # 58 bits: 44 + 8 and 3 of the interframe space, and 3 stuff bits.
    text = "".join(f"({us / 1e6:.6f}) can0 014#01\n" for us in stamps_us)
    needed = figure(of_log(text, tmp_path), "bit rate that")
    assert needed.recorded == pytest.approx(kbit_s, rel=1e-6)
    # Stamps that may be 1 ms late need less; what lies between are 3.29 standard uncertainties, and U is two.
    assert needed.uncertainty == pytest.approx((kbit_s - surely_kbit_s) * 2 / 3.29)


def test_a_load_without_its_can_fd_frames_is_not_judged(tmp_path: Path) -> None:
    fd = "".join(f"(17000000{second}.000000) can0 080##1{'5A' * 64}\n" for second in range(10, 20))
    answer = of_log(fd, tmp_path)
    assert not [figure for figure in answer.figures if figure.quantity.startswith("load")]
    mixed = of_log(candump(LOGGED) + fd, tmp_path)
    assert figure(mixed, "load ").verdict is None
    assert figure(mixed, "load ").note.endswith("without frames of CAN FD that switch")


def test_a_damaged_log_says_where(tmp_path: Path) -> None:
    text = candump(LOGGED[:100])
    answer = of_log(text + "(1700000001.0000) can0 zz#\n", tmp_path)
    assert any(
        remark.startswith("The log is cut or damaged after frame 100, read up to there: ") for remark in answer.remarks
    )
    for ending in ("blf", "asc", "trc"):
        path = tmp_path / f"bus.{ending}"
        with can.Logger(str(path)) as writer:
            for frame in LOGGED[:200]:
                writer(
                    can.Message(
                        timestamp=frame.us / 1e6, arbitration_id=frame.identifier, data=frame.data, is_extended_id=False
                    )
                )
        content, random = path.read_bytes(), Random(1)
        for _ in range(at_least(5)):
            # python-can's reader of BLF leaves a file open whose head is cut.
            end = random.randrange(200 if ending == "blf" else 4, len(content))
            path.write_bytes(content[:end] + random.choice((b"", b"\xff\0\n", b"nonsense\n")))
            try:
                busplan.measured(PLAN, path)
            except BusplanError:
                continue


def test_what_cannot_be_told_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refusal(text: str) -> str:
        with pytest.raises(BusplanError) as caught:
            of_log(text, tmp_path)
        return str(caught.value).removeprefix(f"{tmp_path}/")

    two = candump(LOGGED[:30]) + candump(LOGGED[30:40], channel="can1")
    named = "can0 (30 frames), can1 (10 frames); --channel NAME reads one"
    assert refusal(two) == f"bus.log: has frames of 2 channels: {named}"
    assert refusal("a,b\n") == (
        "bus.log: is not a CAN log in a known format: text of candump, Vector's ASC and BLF, PEAK's TRC, captures "
        "of SocketCAN"
    )
    assert refusal("(1700000000.000000) can0 \n").startswith("bus.log: is not a CAN log")
    assert refusal("") == "bus.log: has no CAN frame"
    monkeypatch.setattr("busplan.extras.find_spec", lambda _name: None)
    assert "install it with the extra, as in pip install 'busplan[import]'" in refusal("date Mon")


def test_apply_writes_the_keys_of_a_message(run: Run, tmp_path: Path) -> None:
    run("init", "arm", "--from", PLAN, cwd=tmp_path)
    path = tmp_path / "arm.toml"
    path.write_text(path.read_text().replace("period_us = 50000", "period_us = 70000"))
    (tmp_path / "bus.log").write_text(candump(LOGGED))
    done = run("measured", "arm.toml", "bus.log", "--apply", "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["measured"] == {"message.heartbeats.period_us": pytest.approx(50_000, rel=2e-3)}
    profile: Any = busplan.load_profile(path)
    assert profile.message[2].period_us == pytest.approx(50_000, rel=2e-3)
    assert "# busplan measured: the worst of " in path.read_text()
    again = run("measured", "arm.toml", "bus.log", "--apply", cwd=tmp_path)
    assert again.returncode == 2
    assert "--apply: bus.log shows no value of a key" in again.stderr


def test_steps_of_stamps_are_said(tmp_path: Path) -> None:
    logged = arbitrated(servo_8(60, seed=1))
    for step_us in (2, 10):
        coarse = [frame._replace(us=frame.us // step_us * step_us) for frame in logged]
        words = f"Stamps have steps of {step_us} us."
        assert [words in of_log(candump(one), tmp_path).remarks for one in (logged, coarse)] == [False, True]
    assert not any("steps of" in remark for remark in of_log(candump(logged), tmp_path).remarks)


def test_a_pdo_outside_its_own_bound_is_outside_even_where_the_cycle_fits(tmp_path: Path) -> None:
    """A host that may take 5 ms of 10: feedback has 1,470 us, and once that of the eighth node takes 6,500."""
    measured = {"node.execution.grade": "measured", "bus.host_grade": "measured"}
    plan = busplan.load_profile(
        PLAN, changes={"cycle.period_us": 10_000, "bus.pipeline_cycles": 0, "bus.host_us": 5000, **measured}
    )
    late_us = {40: 6200.0}
    queued = []
    for cycle in range(100):
        start_us, more_us = cycle * 10_000.0, late_us.get(cycle, 0.0)
        queued.append(Queued(start_us, 0x80, b""))
        queued += [Queued(start_us + 150 + more_us * (node == 8), 0x180 + node, bytes(8)) for node in range(1, 9)]
        queued += [Queued(start_us + 1200 + max(more_us - 900, 0), 0x200 + node, bytes(8)) for node in range(1, 9)]
    logged = arbitrated(queued)
    answer = of_log(candump(logged), tmp_path, plan=plan)
    feedback = figure(answer, "feedback: response")
    assert [figure.quantity for figure in answer.outside] == ["feedback: response"]
    assert not any(key.startswith("bus.host") for key in answer.edits)  # the host is within its plan
    (at,) = (place for place, frame in enumerate(logged) if frame.queued.us == 406_350.0)
    assert (feedback.key, feedback.note) == ("node.execution", "the latest: feedback of node 8 (0x188)")
    assert (feedback.first_frame, feedback.worst_frame) == (at + 1, at + 1)
    assert feedback.first_s == pytest.approx((logged[at].us - logged[0].us) / 1e6, abs=2e-6)
    assert f"first at {feedback.first_s:.6f} s, frame {at + 1}" in str(answer)
    on_time = figure(answer, "command: response")
    assert (on_time.verdict, on_time.first_frame) == ("within", None)


def test_emergencies_are_named_and_not_unplanned(tmp_path: Path) -> None:
    """CiA 301: 0x80 and the node-ID; error code, the lower byte first, error register, five bytes of the maker."""
    more = [
        (100_000.0, 0x83, "308111AABBCCDDEE"),
        (200_000.0, 0x83, "308111AABBCCDDEF"),
        (300_000.0, 0x83, "0000000000000000"),
        (400_000.0, 0xA0, "1043800000000000"),
        # Of another length, and so none.
        (500_000.0, 0x84, "3081"),
    ]
    logged = [*LOGGED, *(Logged(us, identifier, bytes.fromhex(data), False, 0) for us, identifier, data in more)]
    # Nor is one of 29 bits.
    logged.append(Logged(600_000.0, 0x85, bytes(8), True, 0))
    logged.sort(key=lambda frame: frame.us)
    answer = of_log(candump(logged), tmp_path)
    found, sent_us = figure(answer, "emergencies"), [us for us, *_ in more]
    places = [place for place, frame in enumerate(logged, start=1) if frame.us in sent_us]
    times_s = [(us - logged[0].us) / 1e6 for us in sent_us]
    assert (found.planned, found.recorded, found.verdict, found.key) == (0, 3, "outside", "limits.missed_cycles")
    assert found.note.split("; ") == [
        f"node 3: error 0x8130, register 0x11, 2 times, first at {times_s[0]:.6f} s, frame {places[0]}",
        f"node 3: no error any more at {times_s[2]:.6f} s, frame {places[2]}",
        f"node-ID 32: error 0x4310, register 0x80 at {times_s[3]:.6f} s, frame {places[3]}",
    ]
    assert (found.first_frame, found.worst_frame) == (places[0], places[0])
    # 0x685 to 0x68C are of no node by CiA 301, and so 0x89 is none of those that send them.
    other = busplan.load_profile(PLAN, changes={"payload.feedback_identifier": 0x685})
    sent = Logged(100_000.0, 0x89, bytes.fromhex("308111AABBCCDDEE"), False, 0)
    told = figure(of_log(candump(sorted([*LOGGED, sent], key=lambda frame: frame.us)), tmp_path, plan=other), "emergen")
    assert told.note.startswith("node-ID 9: error 0x8130")
    assert figure(answer, "frames of no message").note == "0x84, 0x85"
