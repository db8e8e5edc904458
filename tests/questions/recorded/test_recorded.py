"""A CAN log without a plan: what a simulated bus sent is found again, and when; and the command with a single file."""

import itertools
import json
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from random import Random
from struct import pack
from tomllib import loads
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.recordings.written import pcapng
from tests.oracles.can_recording import SERVO_8, Logged, Machine, Queued, arbitrated, candump, simulated

if TYPE_CHECKING:
    from subprocess import CompletedProcess

Run = Callable[..., "CompletedProcess[str]"]
Refused = Callable[..., str]


def of_log(logged: list[Logged], folder: Path, **options: Any) -> Any:
    path = folder / "bus.log"
    path.write_text(candump(logged))
    return busplan.recorded(path, **options).contents


@pytest.mark.parametrize("seed", range(3))
def test_what_a_bus_sent_is_found_again_with_its_moments(seed: int, tmp_path: Path) -> None:
    errors = frozenset(Random(seed).sample(range(1500), 4))
    logged = simulated(Machine(loads(SERVO_8.read_text()), 400, seed, destroyed=errors))[:2000]
    found = of_log(logged, tmp_path, bit_rate_kbit_s=1000)

    sent = [(number, frame) for number, frame in enumerate(logged, start=1) if not frame.is_error]
    assert (found.frames, found.error_frames) == (len(sent), len(errors))
    wire_us = sum(frame.wire_us for _, frame in sent[1:])
    assert found.load == pytest.approx(wire_us / (sent[-1][1].us - sent[0][1].us), rel=1e-5)
    gap = max(itertools.pairwise(sent), key=lambda pair: pair[1][1].us - pair[0][1].us)
    assert found.largest_gap_us == pytest.approx(gap[1][1].us - gap[0][1].us, abs=1.1)
    assert found.largest_gap_frame == gap[1][0]
    start_us = sent[0][1].us
    assert found.largest_gap_s == pytest.approx((gap[1][1].us - start_us) / 1e6, abs=2e-6)
    places = sorted(errors)
    assert (found.first_error_frame, found.last_error_frame) == (places[0] + 1, places[-1] + 1)
    assert found.first_error_s == pytest.approx((logged[places[0]].us - start_us) / 1e6, abs=2e-6)

    of_identifier = defaultdict(list)
    for number, frame in sent:
        of_identifier[frame.identifier].append((number, frame.us))
    assert [row.identifier for row in found.identifiers] == sorted(of_identifier)
    for row in found.identifiers:
        frames = of_identifier[row.identifier]
        gaps_us = [after[1] - before[1] for before, after in itertools.pairwise(frames)]
        assert (row.frames, row.first_frame, row.last_frame) == (len(frames), frames[0][0], frames[-1][0])
        assert (row.least_gap_us, row.largest_gap_us) == pytest.approx((min(gaps_us), max(gaps_us)), abs=1.1)
        at = next(number for number, us in frames if abs((us - start_us) / 1e6 - row.largest_gap_s) < 2e-6)
        assert row.largest_gap_frame == at
    assert sum(row.share for row in found.identifiers) == pytest.approx(1)
    assert found.looks_like_canopen
    named = {row.identifier: (row.canopen, row.node, row.comes) for row in found.identifiers}
    assert named[0x80] == ("SYNC", None, "cyclic")
    assert named[0x185] == ("TPDO1", 5, "cyclic")
    assert named[0x203] == ("RPDO1", 3, "cyclic")
    assert (found.emergencies, found.stamp_step_us) == ((), 1)


def test_emergencies_have_node_code_register_and_moment(tmp_path: Path) -> None:
    queued = [Queued(us, 0x80, b"") for us in range(0, 100_000, 1000)]
    faults = [
        (10_500, 3, b"\x10\x82\x11"),
        (20_500, 3, b"\x10\x82\x11"),
        (40_500, 3, bytes(3)),
        (50_500, 9, b"\0\x43\4"),
        (60_500, 3, b"\x11\x82\x10"),
    ]
    queued += [Queued(us, 0x80 + node, data + bytes(5)) for us, node, data in faults]
    found = of_log(arbitrated(queued), tmp_path)
    shown = [
        (one.node, one.error_code, one.register, one.messages, one.first_frame, one.last_frame)
        for one in found.emergencies
    ]
    once = [(3, 0, 0, 1, 44, 44), (9, 0x4300, 4, 1, 55, 55), (3, 0x8211, 0x10, 1, 66, 66)]
    assert shown == [(3, 0x8210, 0x11, 2, 12, 23), *once]
    assert [one.first_s for one in found.emergencies] == pytest.approx([0.0106, 0.0406, 0.0506, 0.0606], abs=1e-4)


def test_a_log_that_is_not_canopen_gets_no_names(tmp_path: Path) -> None:
    queued = [Queued(us, identifier, bytes(8)) for us in range(0, 100_000, 1000) for identifier in (0x80, 0x185, 0x705)]
    found = of_log(arbitrated(queued), tmp_path)
    assert not found.looks_like_canopen
    assert {(row.canopen, row.node) for row in found.identifiers} == {(None, None)}
    assert found.emergencies == ()


def test_bursts_events_and_single_frames_are_told_apart(tmp_path: Path) -> None:
    random = Random(1)
    bursts = [Queued(1_000_000 * number + 700 * place, 0x100, b"1") for number in range(20) for place in range(5)]
    events_us = [random.uniform(0, 2e7) for _ in range(200)]
    events = [Queued(us, 0x200, b"12") for us in events_us]
    even = [Queued(100_000 * number + 50, 0x300, bytes(number % 3)) for number in range(200) if number != 50]
    found = of_log(arbitrated([*bursts, *events, *even, Queued(5e6, 0x400, b"")]), tmp_path)
    comes = {row.identifier: (row.comes, row.burst, row.missing) for row in found.identifiers}
    assert comes == {
        0x100: ("burst", 5, 0),
        0x200: ("event", None, 0),
        0x300: ("cyclic", None, 1),
        0x400: ("once", None, 0),
    }
    lengths = {row.identifier: (row.least_bytes, row.most_bytes) for row in found.identifiers}
    assert lengths[0x300] == (0, 2)
    even_row = found.identifiers[2]
    assert even_row.period_us == pytest.approx(100_000, rel=1e-4)
    assert (even_row.largest_gap_us, even_row.largest_gap_s) == pytest.approx((200_000, 5.1), rel=1e-3)


def test_a_bit_rate_is_assumed_given_or_asked_for(tmp_path: Path) -> None:
    row = [Queued(20_000 * number, 0x100 + place, bytes(8)) for number in range(50) for place in range(6)]
    shown = of_log(arbitrated(row, bit_us=2), tmp_path)
    assert (shown.bit_rate_kbit_s, shown.bit_rate_is_assumed) == (500, True)
    alone = arbitrated([Queued(20_000 * number, 0x100, bytes(8)) for number in range(50)], bit_us=2)
    asked = of_log(alone, tmp_path)
    assert (asked.bit_rate_kbit_s, asked.load, asked.identifiers[0].share) == (None, None, 1)
    given = of_log(alone, tmp_path, bit_rate_kbit_s=500)
    assert given.fullest_load == pytest.approx(asked.possible_loads[500.0])
    assert not given.bit_rate_is_assumed
    with pytest.raises(busplan.BusplanError, match="need at least"):
        of_log(arbitrated(row, bit_us=2), tmp_path, bit_rate_kbit_s=50)


def test_what_the_recorder_dropped_is_said(tmp_path: Path) -> None:
    frames = [(number * 1_000_000, pack(">IBB2x", 0x123, 1, 0) + b"\1") for number in range(20)]
    dropped = pack("<HHQ", 5, 8, 7) + bytes(4)
    body = pack("<III", 0, 0, 0) + dropped
    size = pack("<I", len(body) + 12)
    path = tmp_path / "bus.pcapng"
    path.write_bytes(pcapng(frames, link=227, origin="a test") + pack("<I", 5) + size + body + size)
    answer = busplan.recorded(path)
    assert answer.contents.dropped_frames == 7
    assert "The recorder dropped 7 frames" in str(answer)


frames = st.builds(
    Queued,
    st.integers(0, 10**6).map(float),
    st.integers(0, 0x7FF) | st.sampled_from([0, 0x80, 0x81, 0x581, 0x601, 0x701]),
    st.binary(max_size=8),
    st.booleans(),
)


@given(st.lists(frames, min_size=1, max_size=40))
def test_any_log_gives_a_document_in_every_form(tmp_path_factory: pytest.TempPathFactory, frames: list[Queued]) -> None:
    path = tmp_path_factory.mktemp("log") / "bus.log"
    path.write_text(candump(arbitrated(frames)))
    answer = busplan.recorded(path)
    document = answer.to_dict()
    assert document["frames"] == sum(row["frames"] for row in document["identifiers"]) == len(frames)
    for ending in (".txt", ".md", ".html", ".csv"):
        answer.save(path.with_suffix(ending))


def test_a_file_alone_is_a_log(run: Run, refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "bus.log").write_text(candump(simulated(Machine(loads(SERVO_8.read_text()), 50))))
    done = run("measured", "bus.log", "--format", "json", cwd=tmp_path)
    document = json.loads(done.stdout)
    assert (done.returncode, document["command"], document["profile"]) == (0, "measured", None)
    said = run("measured", "bus.log", cwd=tmp_path).stdout
    assert "busplan import bus.log -o machine.toml" in said
    assert run("measured", "can-servo-8", "bus.log", cwd=tmp_path).returncode == 0

    assert "is a profile: give a recording" in refused("measured", "can-servo-8", cwd=tmp_path)
    assert "is a profile: give a recording" in refused("measured", "machine.toml", cwd=tmp_path)
    assert "--apply: needs a profile" in refused("measured", "bus.log", "--apply", cwd=tmp_path)
    assert "--bit-rate: the profile has it" in refused(
        "measured", "can-servo-8", "bus.log", "--bit-rate", "500", cwd=tmp_path
    )
    capture = Path(__file__).parents[1] / "measured" / "files" / "capture.pcapng"
    assert "a capture of EtherCAT needs its profile" in refused("measured", str(capture), cwd=tmp_path)


def test_stamps_of_can_fd_are_late_where_frames_come_closer_than_the_bus_sends_them(run: Run, tmp_path: Path) -> None:
    """Ten frames of 64 bytes in a row, all with the stamp of the last: at 1 and 5 Mbit/s each takes 135 us or more."""
    frames = [f"{0x181 + number:X}##1{'00' * 64}" for number in range(10)]
    lines = [f"({1_700_000_000 + cycle / 100:.6f}) can0 {frame}\n" for cycle in range(50) for frame in frames]
    (tmp_path / "bus.log").write_text("".join(lines))
    rates = ("--bit-rate", "1000", "--data-bit-rate", "5000")
    found = json.loads(run("measured", "bus.log", *rates, "--format", "json", cwd=tmp_path).stdout)
    assert 9 * 135 < found["late_stamps_us"] < 11 * 165


def test_a_data_bit_rate_that_nobody_gave_makes_no_stamp_late(run: Run, tmp_path: Path) -> None:
    run("emulate", "can-fd-motors-8", "--cycles", "50", "-o", "bus.log", cwd=tmp_path)
    assert json.loads(run("measured", "bus.log", "--format", "json", cwd=tmp_path).stdout)["late_stamps_us"] == 0


def test_a_fault_that_no_cycle_may_have_is_refused_as_that(run: Run, tmp_path: Path) -> None:
    plan = ("can-servo-8", "--set", "payload.read_bytes=0")
    done = run("emulate", *plan, "--fault", "missing-pdo", "-o", "bus.log", cwd=tmp_path)
    assert (done.returncode, "no cycle of this plan may have it" in done.stderr) == (2, True)
