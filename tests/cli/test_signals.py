"""What ends a run: exit codes, and that nothing is changed or left behind, no process and no file."""

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import pytest

PROFILE = Path(__file__).parents[2] / "profiles" / "paper-1ms.toml"
CIRCLES = ("sweep", "p.toml", "--circle", "--jobs", "2", "--vary")
SWEEP = (*CIRCLES, "circle.radius_mm=320", "--vary", "servo.position_gain_per_s=100:119")
"""Large circles: the run has long to go."""
FIRST = """
import os, signal, time
os.setsid()
with open("../started", "w") as file:
    file.write(str(os.getpid()))
{first}
"""


class Running(NamedTuple):
    """The program at its work, and who waits for it."""

    pid: int
    waiting: "subprocess.Popen[str]"

    def end(self, *, seconds: float = 300) -> tuple[int, str, str]:
        """Exit code, document and what is said."""
        document, said = self.waiting.communicate(timeout=seconds)
        return self.waiting.returncode, document, said


Start = Callable[..., AbstractContextManager[Running]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "p.toml").write_bytes(PROFILE.read_bytes())
    return folder


@pytest.fixture
def running(program: Path, folder: Path, no_compiler: Mapping[str, str]) -> Start:
    """Start the program, in a group of its own, with pipes for its streams."""

    @contextmanager
    def start(*arguments: str, first: str = "") -> Iterator[Running]:
        with subprocess.Popen(
            [program, *arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **no_compiler, "FORK_FIRST": FIRST.format(first=first)},
        ) as process:
            started = folder.parent / "started"
            assert until(lambda: started.exists() and started.read_text())
            pid = int(started.read_text())
            try:
                yield Running(pid, process)
            finally:
                with suppress(ProcessLookupError):
                    os.killpg(pid, signal.SIGKILL)

    return start


def until(holds: Callable[[], object], *, seconds: float = 300) -> bool:
    deadline = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def workers_of(pid: int) -> list[int]:
    """Worker processes, once each of them has begun its work: it has let go of the program's streams."""
    with suppress(OSError):
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return [int(child) for child in children if Path(f"/proc/{child}/fd/1").readlink() == Path(os.devnull)]
    return []


def is_written(pid: int, folder: Path) -> bool:
    """Whether bytes stand in a file in the making."""
    with suppress(OSError):
        for path in Path(f"/proc/{pid}/fd").iterdir():
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "code", "whole_group"),
    # A terminal signals the whole group: the workers are to leave each signal to the parent.
    [("SIGTERM", 143, False), ("SIGHUP", 129, True), ("SIGINT", 130, True)],
)
def test_a_sweep_that_is_ended_leaves_what_was_there(
    running: Start, folder: Path, name: str, code: int, whole_group: bool
) -> None:
    (folder / "c.csv").write_text("old", encoding="utf-8")
    with running(*SWEEP, "-o", "c.csv") as process:
        assert until(lambda: len(workers_of(process.pid)) == 2)
        started = workers_of(process.pid)
        (os.killpg if whole_group else os.kill)(process.pid, getattr(signal, name))
        ended, _, said = process.end()
    assert (ended, said) == (code, "")
    assert not any(map(alive, started))
    assert sorted(path.name for path in folder.iterdir()) == ["c.csv", "p.toml"]
    assert (folder / "c.csv").read_text(encoding="utf-8") == "old"


def test_rows_in_the_making_are_no_file_either(running: Start, folder: Path) -> None:
    (folder / "c.csv").write_text("old", encoding="utf-8")
    with running("sweep", "p.toml", "--vary", "cycle.nonperiodic_us=1:200000", "-o", "c.csv") as process:
        assert until(lambda: is_written(process.pid, folder))
        os.kill(process.pid, signal.SIGINT)
        ended, _, said = process.end()
    assert (ended, said) == (130, "")
    assert sorted(path.name for path in folder.iterdir()) == ["c.csv", "p.toml"]
    assert (folder / "c.csv").read_text(encoding="utf-8") == "old"


@pytest.mark.slow
def test_a_hangup_that_nohup_ignores_stays_ignored(running: Start, folder: Path) -> None:
    short = (*CIRCLES, "circle.radius_mm=5", "--vary", "servo.position_gain_per_s=100:119")
    with running(*short, "-o", "c.csv", first="signal.signal(signal.SIGHUP, signal.SIG_IGN)") as process:
        assert until(lambda: workers_of(process.pid))
        os.killpg(process.pid, signal.SIGHUP)
        ended, _, said = process.end()
    assert ended == 0, said
    assert rows(folder / "c.csv") == 40


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sweep", "check"])
def test_workers_and_files_end_with_a_process_that_is_killed(running: Start, folder: Path, name: str) -> None:
    with running(*(SWEEP if name == "sweep" else many_files(folder)), "-o", "c.csv") as process:
        assert until(lambda: len(workers_of(process.pid)) == 2)
        started = workers_of(process.pid)
        os.kill(process.pid, signal.SIGKILL)
        # Both streams end: nobody holds them.
        ended, *_ = process.end()
        assert ended == -signal.SIGKILL
        assert until(lambda: not any(map(alive, started)))
    assert all(path.suffix == ".toml" for path in folder.iterdir())


def many_files(folder: Path) -> tuple[str, ...]:
    for number in range(80):
        (folder / f"{number}.toml").write_bytes(PROFILE.read_bytes())
    return "check", ".", "--jobs", "2"


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_any_command_ends_with_the_code_of_its_signal(running: Start, folder: Path, name: str) -> None:
    with running("init", "x", first="os.fsync = lambda _: time.sleep(30)") as process:
        assert until(lambda: is_written(process.pid, folder))
        os.kill(process.pid, getattr(signal, name))
        ended, _, said = process.end()
    assert (ended, said) == (128 + getattr(signal, name), "")
    assert not (folder / "x.toml").exists()


def interpreted(code: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=False)


def test_nothing_is_loaded_before_ctrl_c_is_heard() -> None:
    code = "import sys; before = {*sys.modules}; import busplan.__main__; print(*sorted({*sys.modules} - before))"
    assert set(interpreted(code).stdout.split()) <= {"busplan", "busplan.__main__", "atexit", "gc", "os"}


@pytest.mark.parametrize("name", ["busplan.cli", "typer", "busplan.cli.analyse", "pydantic"])
def test_ctrl_c_while_the_program_loads_ends_it_without_a_word(name: str) -> None:
    code = f"""
import os, signal, sys
class Loading:
    def find_spec(name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Loading)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a script's background jobs ignore it
sys.argv = ["busplan", "capacity", "paper-4ms"]
from busplan.__main__ import main
main()
"""
    ended = interpreted(code)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sweep", "check"])
def test_a_worker_that_is_killed_is_said(running: Start, folder: Path, name: str) -> None:
    arguments = (*SWEEP, "-o", "c.csv") if name == "sweep" else many_files(folder)
    with running(*arguments) as process:
        assert until(lambda: len(workers_of(process.pid)) == 2)
        started = workers_of(process.pid)
        os.kill(started[0], signal.SIGKILL)
        ended, document, said = process.end()
    assert (ended, document) == (2, "")
    assert "a worker was killed (out of memory?)" in said
    assert "busplan itself failed" not in said
    assert not any(map(alive, started))
    assert not (folder / "c.csv").exists()
