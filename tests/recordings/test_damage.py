"""Recordings with damage: what no frame can be is none, becomes no figure, and is said where it begins."""

import os
import subprocess
import sys
import zlib
from collections.abc import Callable
from functools import cache
from math import isfinite
from pathlib import Path
from struct import pack
from typing import TYPE_CHECKING

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.errors import BusplanError
from tests.oracles.can_recording import arbitrated, candump, servo_8
from tests.oracles.ethercat_recording import Machine, pcap, pcapng, simulated

if TYPE_CHECKING:
    from subprocess import CompletedProcess

Run = Callable[..., "CompletedProcess[str]"]
LOGGED = arbitrated(servo_8(40))
MANY = 1_000_000


def broken(answer: busplan.MeasuredAnswer) -> str:
    """Where and why a log is read no further."""
    start = "The log is cut or damaged after frame "
    return next((remark.removeprefix(start) for remark in answer.remarks if remark.startswith(start)), "")


@pytest.mark.parametrize("plan", ["can-servo-8", "ethercat-servo-8"])
def test_a_file_that_cannot_be_read_is_refused_with_its_reason(
    plan: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile, path = busplan.load_profile(plan), tmp_path / "bus.log"
    with pytest.raises(BusplanError, match=r"bus\.log: cannot be read: No such file or directory$"):
        busplan.measured(profile, path)
    path.touch()

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(BusplanError, match=r"bus\.log: cannot be read: Permission denied$"):
        busplan.measured(profile, path)


LINES = {
    "a stamp of nan s": "(nan) can0 181#00",
    "a stamp of inf s": "(inf) can0 181#00",
    "a stamp of 1e+300 s": "(1e300) can0 181#00",
    "a stamp of -1 s": "(-1) can0 181#00",
    "a stamp of 1e+10 s": "(10000000000.000000) can0 181#00",
    "a stamp 23,148.1 days after the one before": "(3700000000.000000) can0 181#00",
    "data of 300 bytes": f"(1700000001.000000) can0 181#{300 * '00'}",
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> busplan.MeasuredAnswer:
    path = tmp_path_factory.mktemp("whole") / "whole.log"
    path.write_text(candump(LOGGED))
    return busplan.measured("can-servo-8", path)


@pytest.mark.parametrize("words", LINES)
def test_what_no_frame_can_be_ends_the_log_and_is_said(
    words: str, whole: busplan.MeasuredAnswer, tmp_path: Path
) -> None:
    damaged = tmp_path / "damaged.log"
    damaged.write_text(f"{candump(LOGGED)}{LINES[words]}\n{candump(LOGGED[:9], start_s=1_700_000_002)}")
    answer = busplan.measured("can-servo-8", damaged)
    assert answer.figures == whole.figures
    assert broken(answer) == f"{len(LOGGED):,}, read up to there: {words}."
    assert [remark for remark in answer.remarks if broken(answer) not in remark] == list(whole.remarks)
    damaged.write_text(f"{LINES[words]}\n{candump(LOGGED)}")
    if "days" not in words:  # of a first frame nobody knows when it came
        with pytest.raises(BusplanError, match="has no CAN frame") as caught:
            busplan.measured("can-servo-8", damaged)
        assert words in str(caught.value)


def test_an_absurd_stamp_makes_no_load_smaller(run: Run, tmp_path: Path) -> None:
    run("init", "plan", "--from", "can-servo-8", cwd=tmp_path)
    path = tmp_path / "plan.toml"
    path.write_text(path.read_text().replace("period_us = 4000", "period_us = 8000"))
    # Of the other lines every figure is that of the whole log.
    for line in ("", LINES["a stamp 23,148.1 days after the one before"]):
        (tmp_path / "bus.log").write_text(f"{candump(LOGGED)}{line}\n")
        done = run("check", "plan.toml", "--no-circle", "--recording", "bus.log", cwd=tmp_path)
        assert (done.returncode, "BP401 error: name: load: " in done.stdout) == (1, True)


def test_stamps_a_day_apart_are_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    day_later = "".join(f"({1_700_086_400 + number}.000000) can0 181#00\n" for number in range(2))
    path.write_text(f"(1700000000.000000) can0 181#00\n{day_later}")
    assert broken(busplan.measured("can-servo-8", path)) == ""
    path.write_text(f"(1700000000.000000) can0 181#00\n{day_later.replace('86400.000000', '86400.000002')}")
    assert broken(busplan.measured("can-servo-8", path)).startswith("1, read up to there: a stamp 1.0 days after")


@pytest.mark.parametrize(
    ("word", "is_damage"),
    [("7FF", False), ("800", True), ("18FEF100", True), ("18FEF100x", False), ("1FFFFFFFx", False)],
)
def test_an_identifier_that_has_no_room_in_its_bits_is_damage(word: str, is_damage: bool, tmp_path: Path) -> None:
    path = tmp_path / "bus.asc"
    head = "date Thu Jan 1 10:00:00.000 am 2024\nbase hex  timestamps absolute\nBegin Triggerblock\n"
    words = ("123", word, "124")
    path.write_text(head + "".join(f"   {number}.0 1  {word} Rx   d 2 00 11\n" for number, word in enumerate(words)))
    answer = busplan.measured("can-servo-8", path)
    (unplanned,) = (figure for figure in answer.figures if figure.quantity.startswith("frames of no message"))
    assert unplanned.recorded == (1 if is_damage else 3)
    identifier = f"{int(word.rstrip('x'), 16):#x}"
    why = f"1, read up to there: an identifier of {identifier}, which has no room in 11 bits."
    assert broken(answer) == (why if is_damage else "")
    assert is_damage or identifier in unplanned.note


EXPLAINED = """\
 (1.000000)  can0  181   [2]  01 02
 (1.001000)  can0  20000004   [8]  00 04 00 00 00 00 60 00   ERRORFRAME
\tcontroller-problem{rx-error-warning}
\terror-counter-tx-rx{{96}{0}}
 (1.002000)  can0  181   [2]  01 02
"""
LOGGED_ERRORS = """\
(1.000000) can0 181#0102
(1.001000) can0 20000004#0004000000006000
(1.001500) can1 20000088#0000000000000000
(1.001700) can1 181#0102
(1.002000) can0 181#0102
"""


@pytest.mark.parametrize("text", [EXPLAINED, LOGGED_ERRORS], ids=["in words", "of two channels"])
def test_every_error_frame_of_the_channel_is_one_and_no_damage(text: str, tmp_path: Path) -> None:
    (tmp_path / "bus.log").write_text(text)
    answer = busplan.measured("can-servo-8", tmp_path / "bus.log", channel="can0")
    recorded = {figure.quantity: figure for figure in answer.figures}
    assert (recorded["error frames"].recorded, recorded["error frames"].first_frame) == (1, 2)
    assert recorded["frames of no message of the plan"].recorded == 0
    assert broken(answer) == ""


@cache
def log(ending: str, folder: str) -> bytes:
    path = Path(folder, f"whole.{ending}")
    with can.Logger(str(path)) as writer:
        for frame in LOGGED[:60]:
            writer(
                can.Message(
                    timestamp=1_700_000_000 + frame.us / 1e6,
                    arbitration_id=frame.identifier,
                    is_extended_id=False,
                    data=frame.data,
                    channel=0,
                )
            )
    return path.read_bytes()


PIECES = st.one_of(
    st.binary(max_size=4), st.sampled_from([b"nan", b"9" * 12, b"-", b"x", b"FFFFFFFFF", b"inf", b" ", b"\n", b"1e99"])
)


@given(
    ending=st.sampled_from(["log", "asc", "trc", "blf"]),
    damages=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 12), PIECES), min_size=1, max_size=3),
)
def test_frames_are_taken_whole_or_not_at_all(
    tmp_path_factory: pytest.TempPathFactory, ending: str, damages: list[tuple[float, int, bytes]]
) -> None:
    folder = tmp_path_factory.mktemp("damaged")
    content = log(ending, str(tmp_path_factory.getbasetemp()))
    for share, cut, piece in damages:
        at = int(share * len(content))
        content = content[:at] + piece + content[at + cut :]
    path = folder / f"bus.{ending}"
    path.write_bytes(content)
    try:
        answer = busplan.measured("can-servo-8", path)
    except BusplanError:
        return
    values = [value for figure in answer.figures for value in (figure.planned, figure.recorded, figure.uncertainty)]
    assert all(value is None or isfinite(value) for value in values)
    assert all(figure.recorded <= 64 for figure in answer.figures if figure.unit == "bytes" and figure.recorded)
    assert answer.day in ("", "1970-01-01") or "2023" <= answer.day[:4] <= "2242"


@pytest.mark.parametrize("form", ["pcap", "pcapng"])
def test_a_packet_of_another_century_ends_a_capture(form: str, tmp_path: Path) -> None:
    write: Callable[..., bytes] = pcap if form == "pcap" else pcapng
    packets = simulated(Machine(), 200)
    late = [(us + (2e15 if place == 150 else 0), packet) for place, (us, packet) in enumerate(packets)]
    path = tmp_path / "capture"
    path.write_bytes(write(packets[:150]))
    expected = busplan.measured("ethercat-servo-8", path)
    path.write_bytes(write(late))
    answer = busplan.measured("ethercat-servo-8", path)
    assert answer.figures == expected.figures
    (remark,) = (remark for remark in answer.remarks if remark not in expected.remarks)
    words, _, at = remark.removesuffix(" on: read up to there.").rpartition(" ")
    assert words == "The file is cut or damaged from byte"
    # It is the first packet behind those.
    assert 0 <= int(at.replace(",", "")) - len(write(packets[:150])) <= 32


PEAK = """
import busplan
print(*busplan.measured("can-servo-8", "bus.blf").remarks, sep="\\n")
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


def object_of(kind: int, content: bytes) -> bytes:
    size = 16 + len(content)
    return pack("<4sHHII", b"LOBJ", 16, 1, size, kind) + content + bytes(size % 4)


@pytest.mark.slow
def test_a_container_is_inflated_no_further_than_one_can_be(tmp_path: Path) -> None:
    whole, path = log("blf", str(tmp_path)), tmp_path / "bus.blf"

    def peak_kb(*containers: bytes) -> tuple[list[str], int]:
        """What is said of the log with more containers, and the memory at the peak."""
        objects = (object_of(10, pack("<H6xII", 2, 0, 0) + data) for data in containers)
        path.write_bytes(whole + b"".join(objects))
        done = subprocess.run(
            [sys.executable, "-c", PEAK], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300
        )
        *remarks, peak = done.stdout.splitlines()
        return remarks, int(peak)

    _, usual_kb = peak_kb()
    deflating = zlib.compressobj()
    bomb = b"".join((*(deflating.compress(bytes(MANY)) for _ in range(300)), deflating.flush()))
    # An object that goes on from one container to the next is held as it grows.
    longest = object_of(1, b"")[:8] + pack("<II", 0xFFFFFF00, 1)
    small = zlib.compress(longest + bytes(6 * MANY))
    for content in ([bomb], [small] * 50):
        remarks, kb = peak_kb(*content)
        assert any(remark.endswith(": a container of over 16,000,000 bytes.") for remark in remarks)
        assert kb < usual_kb + 150_000
    path.write_bytes(whole + object_of(10, pack("<H6xII", 3, 0, 0) + b"?"))
    why = broken(busplan.measured("can-servo-8", path))
    assert why.endswith("read up to there: a container that is compressed by method 3.")


@pytest.mark.parametrize("command", [("measured", "can-servo-8"), ("measured", "ethercat-servo-8"), ("import",)])
def test_a_pipe_that_nobody_writes_is_refused(run: Run, tmp_path: Path, command: tuple[str, ...]) -> None:
    os.mkfifo(tmp_path / "pipe")
    done = run(*command, "pipe", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "pipe: is a named pipe; give a regular file\n")
    if command[0] == "measured":
        done = run("check", command[1], "--no-circle", "--recording", "pipe", cwd=tmp_path)
        assert (done.returncode, "pipe: is a named pipe; give a regular file" in done.stderr) == (2, True)


@pytest.mark.parametrize("start", ["", "date Mon ", ";$FILEVERSION=1.1\n;"])
def test_a_line_is_read_no_further_than_one_can_be(start: str, run: Run, tmp_path: Path) -> None:
    with (tmp_path / "long.log").open("w") as file:
        file.write(start or candump(LOGGED))
        file.writelines(["x" * MANY] * 100)
    outcome = run("measured", "can-servo-8", "long.log", cwd=tmp_path)
    assert "a line of 4,096 bytes or more" in outcome.stdout + outcome.stderr
    assert outcome.returncode == (2 if start else 0)


@pytest.mark.skipif(sys.platform == "win32", reason="devices have other names there")
@pytest.mark.parametrize("path", ["/dev/zero", "."])
@pytest.mark.parametrize("profile", ["can-servo-8", "ethercat-servo-8"])
def test_what_is_no_file_is_refused(path: str, profile: str) -> None:
    with pytest.raises(BusplanError, match=r"is a (device|directory); give a regular file"):
        busplan.measured(profile, path)


def test_many_channels_and_long_names_are_shortened(tmp_path: Path) -> None:
    log = tmp_path / "channels.log"
    log.write_text("".join(f"(1.{number:06d}) {'c' * 500}{number} 181#00\n" for number in range(9)))
    with pytest.raises(BusplanError, match=r"9 channels.* and 1 more") as caught:
        busplan.measured("can-servo-8", log)
    assert len(str(caught.value)) < 1000


def test_a_log_of_more_identifiers_than_any_machine_has_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "identifiers.log"
    log.write_text("".join(f"({number / 1000:.6f}) can0 {number:08X}#11\n" for number in range(20_001)))
    with pytest.raises(BusplanError, match=r"has 20,001 identifiers; of a log at most 20,000 are read"):
        busplan.measured("can-servo-8", log)


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="this system does not list open files")
def test_a_damaged_blf_is_closed(tmp_path: Path) -> None:
    log = tmp_path / "damaged.blf"
    log.write_bytes(b"LOGG" + b"\0" * 200)
    with pytest.raises(BusplanError):
        busplan.measured("can-servo-8", log)
    numbers = [path for path in Path("/proc/self/fd").iterdir() if path.exists()]
    assert log.resolve() not in [path.resolve() for path in numbers]
