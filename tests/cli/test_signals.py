"""What ends a run: exit codes, what is kept, and that nothing is left behind, no process and no file."""

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

PROFILE = Path(__file__).parents[2] / "profiles" / "paper-1ms.toml"
CIRCLES = ("sweep", "p.toml", "--circle", "--jobs", "2", "--vary")
SWEEP = (*CIRCLES, "circle.radius_mm=10,320", "--vary", "servo.position_gain_per_s=100:119")
"""Small circles first, and large ones: rows come early, and the run has long to go."""
# Whoever runs the tests may ignore signals, and children inherit that.
PROGRAM = """
import signal
from busplan.__main__ import main
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.{hangup})
    main()
"""


@pytest.fixture
def folder(tmp_path: Path, no_compiler: Mapping[str, str], monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, value in no_compiler.items():
        monkeypatch.setenv(name, value)
    (tmp_path / "p.toml").write_bytes(PROFILE.read_bytes())
    return tmp_path


@contextmanager
def running(*arguments: str, folder: Path, hangup: str = "SIG_DFL") -> Iterator["subprocess.Popen[str]"]:
    """Start the program, in a group of its own, with pipes for its streams."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(hangup=hangup), *arguments],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def until(holds: Callable[[], object], *, seconds: float = 20) -> bool:
    deadline = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def workers_of(process: "subprocess.Popen[str]") -> list[int]:
    """Worker processes, once each of them has begun its work: it has let go of the program's streams."""
    with suppress(OSError):
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        return [int(pid) for pid in children if Path(f"/proc/{pid}/fd/1").readlink() == Path(os.devnull)]
    return []


def rows_written(process: "subprocess.Popen[str]", folder: Path) -> bool:
    """Whether bytes stand in the file in the making."""
    with suppress(OSError):
        for path in Path(f"/proc/{process.pid}/fd").iterdir():
            # Parts are written in a folder of their own, which is open, too.
            if path.readlink().parent == folder and path.is_file() and path.stat().st_size:
                return True
    return False


def alive(pid: int) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def rows(path: Path) -> int:
    table = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    assert len({len(row) for row in table}) == 1
    return len(table) - 1


@pytest.mark.parametrize(
    ("name", "code", "whole_group"),
    # A terminal signals the whole group: the workers are to leave each signal to the parent.
    [("SIGTERM", 143, False), ("SIGHUP", 129, True), ("SIGINT", 130, True)],
)
def test_a_sweep_that_is_ended_keeps_its_rows(folder: Path, name: str, code: int, whole_group: bool) -> None:
    with running(*SWEEP, "-o", "c.csv", folder=folder) as process:
        assert until(lambda: rows_written(process, folder))
        assert until(lambda: len(workers_of(process)) == 2)
        started = workers_of(process)
        (os.killpg if whole_group else os.kill)(process.pid, getattr(signal, name))
        _, said = process.communicate(timeout=20)
    assert process.returncode == code
    assert "kept in c.partial.csv" in said
    assert "Traceback" not in said
    assert not any(map(alive, started))
    assert sorted(path.name for path in folder.iterdir()) == ["c.csv.parts", "c.partial.csv", "p.toml"]
    assert rows(folder / "c.partial.csv") > 0
    assert "circle tests are in c.csv.parts: go on with --resume" in said


def test_a_hangup_that_nohup_ignores_stays_ignored(folder: Path) -> None:
    short = (*CIRCLES, "circle.radius_mm=10", "--vary", "servo.position_gain_per_s=100:105")
    with running(*short, "-o", "c.csv", folder=folder, hangup="SIG_IGN") as process:
        assert until(lambda: workers_of(process))
        os.killpg(process.pid, signal.SIGHUP)
        _, said = process.communicate(timeout=30)
    assert process.returncode == 0, said
    assert rows(folder / "c.csv") == 12


@pytest.mark.parametrize("name", ["sweep", "check"])
def test_workers_and_files_end_with_a_process_that_is_killed(folder: Path, name: str) -> None:
    with running(*(SWEEP if name == "sweep" else many_files(folder)), "-o", "c.csv", folder=folder) as process:
        assert until(lambda: len(workers_of(process)) == 2)
        started = workers_of(process)
        process.kill()
        # Both streams end: nobody holds them.
        process.communicate(timeout=20)
        assert process.returncode == -signal.SIGKILL
        assert until(lambda: not any(map(alive, started)), seconds=5)
    assert {path.name for path in folder.iterdir() if path.suffix != ".toml"} <= {"c.csv.parts"}


def many_files(folder: Path) -> tuple[str, ...]:
    for number in range(80):
        (folder / f"{number}.toml").write_bytes(PROFILE.read_bytes())
    return "check", ".", "--jobs", "2"


@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGINT", 130)])
def test_a_check_that_is_ended_ends_its_workers(folder: Path, name: str, code: int) -> None:
    with running(*many_files(folder), folder=folder) as process:
        assert until(lambda: len(workers_of(process)) == 2)
        started = workers_of(process)
        process.send_signal(getattr(signal, name))
        document, said = process.communicate(timeout=20)
    assert (process.returncode, document) == (code, "")
    assert "Traceback" not in said
    assert not any(map(alive, started))


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_any_command_ends_with_the_code_of_its_signal(folder: Path, name: str) -> None:
    program = "import os, time; from busplan.__main__ import main; os.fsync = lambda _: time.sleep(30); main()"
    with subprocess.Popen(
        [sys.executable, "-c", program, "init", "x"], cwd=folder, stderr=subprocess.PIPE, text=True
    ) as process:
        assert until(lambda: rows_written(process, folder))
        process.send_signal(getattr(signal, name))
        _, said = process.communicate(timeout=20)
    assert (process.returncode, said) == (128 + getattr(signal, name), "")
    assert not (folder / "x.toml").exists()


@pytest.mark.parametrize("name", ["sweep", "check"])
def test_a_worker_that_is_killed_is_said(folder: Path, name: str) -> None:
    arguments = (*SWEEP, "-o", "c.csv") if name == "sweep" else many_files(folder)
    with running(*arguments, folder=folder) as process:
        assert until(lambda: len(workers_of(process)) == 2)
        assert name == "check" or until(lambda: rows_written(process, folder))
        started = workers_of(process)
        os.kill(started[0], signal.SIGKILL)
        document, said = process.communicate(timeout=20)
    assert (process.returncode, document) == (2, "")
    assert "a worker was killed (out of memory?)" in said
    assert "busplan itself failed" not in said
    assert not any(map(alive, started))
    if name == "sweep":
        assert "kept in c.partial.csv" in said
        assert rows(folder / "c.partial.csv") > 0


def test_a_worker_ends_in_the_middle_of_its_work(tmp_path: Path) -> None:
    waiting = "import time; from busplan.cli.workers import workers\n"
    waiting += "with workers(1) as crew:\n    crew.submit(time.sleep, 60).result()"
    with subprocess.Popen([sys.executable, "-c", waiting], cwd=tmp_path, text=True) as process:
        assert until(lambda: workers_of(process))
        started = workers_of(process)
        time.sleep(0.2)
        process.kill()
        process.wait()
    assert until(lambda: not any(map(alive, started)), seconds=5)
