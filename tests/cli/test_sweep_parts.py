"""`sweep --circle --resume`: a sweep that was killed goes on, to the same bytes, and only the same sweep does."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from busplan.questions.sweep import circle_run
from busplan.questions.sweep.circles import CIRCLE_COLUMNS, CircleChunk, run_chunk

Run = Callable[..., "subprocess.CompletedProcess[str]"]

SMALL = ("--circle", "--vary", "circle.radius_mm=5", "--vary", "servo.position_gain_per_s=100:119")
FORMS = ("csv", "json", "parquet")
"""Rows, a document with an end, and groups of rows."""
SEEDS = (*SMALL, "--vary", "delivery.seed=1:3", "--summary")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, run: Run) -> dict[str, bytes]:
    """The file of a sweep without an interruption, by its ending."""
    folder = tmp_path_factory.mktemp("whole")
    found = {}
    for form in FORMS:
        assert sweep(run, folder, form).returncode == 0
        found[form] = (folder / f"r.{form}").read_bytes()
    assert sorted(path.name for path in folder.iterdir()) == sorted(f"r.{form}" for form in found)
    return found


def sweep(run: Run, folder: Path, form: str, *more: str, grid: tuple[str, ...] = SMALL) -> Any:
    return run("sweep", "paper-1ms", *grid, "--jobs", "1", "-o", f"r.{form}", *more, cwd=folder)


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int | None], list[int]]]:
    """Let the circle tests stop with Ctrl-C after a number of them; gives the numbers of those that were run."""
    ran: list[int] = []

    def after(number: int | None) -> list[int]:
        ran.clear()

        def stopping(chunk: CircleChunk) -> Any:
            if number is not None and len(ran) >= number:
                os.kill(os.getpid(), signal.SIGINT)
            ran.extend(range(chunk.start, chunk.start + len(chunk.points)))
            return run_chunk(chunk)

        monkeypatch.setattr(circle_run, "run_chunk", stopping)
        return ran

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield after
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("form", FORMS)
def test_a_sweep_goes_on_to_the_same_bytes_and_runs_no_test_twice(
    run: Run, tmp_path: Path, whole: dict[str, bytes], stopped: Callable[[int | None], list[int]], form: str
) -> None:
    every: list[int] = []
    for number in (3, 9):
        ran = stopped(number)
        done = sweep(run, tmp_path, form, "--resume")
        assert done.returncode == 130
        every += ran
        assert f"{len(every)} of 20 circle tests are in r.{form}.parts: go on with --resume" in done.stderr
        assert not (tmp_path / f"r.{form}").exists()
    ran = stopped(None)
    done = sweep(run, tmp_path, form, "--resume")
    assert (done.returncode, done.stdout) == (0, "")
    assert sorted(every + ran) == list(range(20))
    assert (tmp_path / f"r.{form}").read_bytes() == whole[form]
    assert not (tmp_path / f"r.{form}.parts").exists()


def test_parts_serve_chunks_of_another_size(
    run: Run,
    tmp_path: Path,
    stopped: Callable[[int | None], list[int]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "whole").mkdir()
    assert sweep(run, tmp_path / "whole", "csv", grid=SEEDS).returncode == 0
    first = stopped(8)
    assert sweep(run, tmp_path, "csv", grid=SEEDS).returncode == 130
    some = list(first)
    # A part that lies apart, as other workers would have done it.
    parts = tmp_path / "r.csv.parts"
    for path in sorted(parts.glob("*.npy")):
        rows = np.load(path)
        assert rows.shape == (len(rows), 1 + len(CIRCLE_COLUMNS))
        np.save(path, rows[rows[:, 0] % 4 != 2])
    monkeypatch.setattr(circle_run, "chunk_tests", lambda number, *, time_s: 7)  # noqa: ARG005
    again = stopped(None)
    assert sweep(run, tmp_path, "csv", "--resume", grid=SEEDS).returncode == 0
    assert sorted(again) == sorted(set(range(60)) - {one for one in some if one % 4 != 2})
    assert (tmp_path / "r.csv").read_bytes() == (tmp_path / "whole" / "r.csv").read_bytes()


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory, run: Run) -> Path:
    """Folder with the parts of a sweep that did not end."""
    folder = tmp_path_factory.mktemp("parts")
    left = iter(range(3))

    def fail(chunk: CircleChunk) -> Any:
        if next(left, None) is None:
            raise MemoryError
        return run_chunk(chunk)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(circle_run, "run_chunk", fail)
        assert sweep(run, folder, "csv").returncode != 0
    assert [path.name for path in folder.iterdir()] == ["r.csv.parts"]
    return folder / "r.csv.parts"


OTHERS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "profile": ((*SMALL, "--set", "cycle.period_us=2000"), "another profile"),
    "grid": ((*SMALL, "--vary", "cycle.period_us=1000,2000"), "another grid, another set of columns"),
    "axis": ((*SMALL[:-1], "servo.position_gain_per_s=100:120"), "another grid"),
    "seeds": (SEEDS, "another range of seeds, another set of columns"),
    "columns": ((*SMALL, "--columns", "passed"), "another set of columns"),
    "models": ((*SMALL, "--timing", "standard"), "another choice of timing models"),
    "form": ((*SMALL, "--format", "jsonl"), "another form (csv there, jsonl here)"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_another_sweep_does_not_go_on(run: Run, tmp_path: Path, parts: Path, name: str) -> None:
    mine = Path(shutil.copytree(parts, tmp_path / "r.csv.parts"))
    grid, words = OTHERS[name]
    done = sweep(run, tmp_path, "csv", "--resume", grid=grid)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"--resume: r.csv.parts is of a sweep with {words}; repeat the command as it was, or delete" in done.stderr
    assert sorted(path.name for path in mine.iterdir()) == sorted(path.name for path in parts.iterdir())
    assert [path.name for path in tmp_path.iterdir()] == ["r.csv.parts"]


def test_another_version_does_not_go_on_and_no_parts_are_overwritten(run: Run, tmp_path: Path, parts: Path) -> None:
    mine = Path(shutil.copytree(parts, tmp_path / "r.csv.parts"))
    done = sweep(run, tmp_path, "csv")
    assert done.returncode == 2
    assert "r.csv.parts: has circle tests of a sweep that did not end; go on with --resume, or delete" in done.stderr
    manifest = json.loads((mine / "sweep.json").read_text())
    manifest["version of busplan"] = "0.0.1"
    (mine / "sweep.json").write_text(json.dumps(manifest))
    done = sweep(run, tmp_path, "csv", "--resume")
    assert done.returncode == 2
    assert "another version of busplan (0.0.1 there, " in done.stderr


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("sweep.json", b"{", "cannot be read"),
        ("sweep.json", b"[]", "another version of busplan"),
        ("000000000000.npy", b"\x93NUMPY", "is no part of a sweep"),
    ],
)
def test_broken_parts_are_refused(run: Run, tmp_path: Path, parts: Path, name: str, content: bytes, words: str) -> None:
    mine = Path(shutil.copytree(parts, tmp_path / "r.csv.parts"))
    (mine / name).write_bytes(content)
    done = sweep(run, tmp_path, "csv", "--resume")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


def test_a_folder_of_another_kind_is_left_alone(run: Run, tmp_path: Path) -> None:
    (tmp_path / "r.csv.parts").mkdir()
    (tmp_path / "r.csv.parts" / "mine.txt").write_text("mine")
    done = sweep(run, tmp_path, "csv", "--resume")
    assert done.returncode == 2
    assert "r.csv.parts: the parts of this sweep would be kept here; move what is in it" in done.stderr


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--resume", "--resume: goes with --circle"),
        ("--circle --resume", "--resume: goes with --output FILE"),
    ],
)
def test_refusals(run: Run, tmp_path: Path, line: str, words: str) -> None:
    done = run("sweep", "paper-1ms", "--vary", "bus.nodes=1:2", *line.split(), cwd=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr


KILLED = """
import os
from pathlib import Path
from busplan.__main__ import main
from busplan.cli.sweep_parts import Parts

kept = Parts.flush

def flush(self):
    kept(self)
    if list(Path("r.csv.parts").glob("*.npy")):
        os.kill(os.getpid(), 9)

Parts.flush = flush
main()
"""
"""The program, which is killed when it has kept a part."""


def test_a_sweep_that_was_killed_goes_on(run: Run, tmp_path: Path) -> None:
    grid = (*SMALL[:-1], "servo.position_gain_per_s=100:179", "--jobs")
    command = ("sweep", "paper-1ms", *grid, "2", "-o", "r.csv")
    process = subprocess.run([sys.executable, "-c", KILLED, *command], cwd=tmp_path, check=False, timeout=300)
    assert process.returncode == -signal.SIGKILL
    assert [path.name for path in tmp_path.iterdir()] == ["r.csv.parts"]
    done = run("sweep", "paper-1ms", *grid, "1", "-o", "r.csv", "--resume", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["r.csv"]
    rows = list(csv.DictReader((tmp_path / "r.csv").read_text(encoding="utf-8").splitlines()))
    assert [int(row["servo.position_gain_per_s"]) for row in rows] == [gain for gain in range(100, 180) for _ in "ab"]


@pytest.mark.parametrize("more", [(), ("--resume",)])
def test_another_run_of_the_sweep_is_refused_and_harms_nothing(
    run: Run, tmp_path: Path, whole: dict[str, bytes], monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...]
) -> None:
    refusals: list[Any] = []

    def meanwhile(chunk: CircleChunk) -> Any:
        if chunk.start and not refusals:
            refusals.append(sweep(run, tmp_path, "csv", *more))
        return run_chunk(chunk)

    monkeypatch.setattr(circle_run, "run_chunk", meanwhile)
    assert sweep(run, tmp_path, "csv").returncode == 0
    assert refusals[0].returncode == 2
    assert "r.csv.parts: another run is at this sweep; wait for its end" in refusals[0].stderr
    assert (tmp_path / "r.csv").read_bytes() == whole["csv"]
    assert [path.name for path in tmp_path.iterdir()] == ["r.csv"]
