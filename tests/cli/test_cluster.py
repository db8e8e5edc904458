"""`sweep --circle --cluster`: a real Dask scheduler and two worker processes, one of which is killed in the middle."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest

from busplan import __version__

pytest.importorskip("distributed")

Run = Callable[..., "subprocess.CompletedProcess[str]"]

SWEEP = ("sweep", "paper-1ms", "--circle", "--vary", "circle.radius_mm=10", "--vary", "servo.position_gain_per_s=100:")


class Cluster(NamedTuple):
    address: str
    workers: list["subprocess.Popen[bytes]"]


def until(holds: Callable[[], object], *, seconds: float = 60) -> bool:
    deadline = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


@pytest.fixture(scope="module")
def environment(no_compiler: Mapping[str, str]) -> dict[str, str]:
    quiet = {"DASK_DISTRIBUTED__DASHBOARD__LINK": "", "DASK_CONFIG": os.devnull}
    return {**os.environ, **no_compiler, **quiet}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory, environment: dict[str, str]) -> Iterator[Cluster]:
    folder = tmp_path_factory.mktemp("cluster")
    told = folder / "scheduler.json"

    def start(stack: ExitStack, module: str, *arguments: str) -> "subprocess.Popen[bytes]":
        process = stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{module}", *arguments, "--no-dashboard"],
                cwd=folder,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        )
        stack.callback(process.kill)
        return process

    with ExitStack() as stack:
        start(stack, "dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(told))
        own = ("--scheduler-file", str(told), "--no-nanny", "--nthreads", "1", "--local-directory", str(folder))
        assert until(lambda: told.exists() and told.read_text().endswith("}"))
        workers = [start(stack, "dask_worker", *own) for _ in range(2)]
        yield Cluster(json.loads(told.read_text())["address"], workers)


def test_a_worker_that_is_killed_loses_nothing_and_is_said(
    cluster: Cluster, environment: dict[str, str], run: Run, tmp_path: Path
) -> None:
    gains = (*SWEEP[:-1], f"{SWEEP[-1]}179")
    with subprocess.Popen(
        [sys.executable, "-m", "busplan", *gains, "--cluster", cluster.address, "-o", "there.jsonl"],
        cwd=tmp_path,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert until(lambda: list(tmp_path.glob("there.jsonl.parts/*.npy")))
        cluster.workers[0].send_signal(signal.SIGKILL)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert said.count(" left the cluster, which has 1 worker; its tests are run again by another\n") == 1
    assert "Warning" not in said
    assert said.endswith("wrote there.jsonl\n")
    assert [path.name for path in tmp_path.iterdir()] == ["there.jsonl"]
    assert run(*gains, "--jobs", "1", "-o", "here.jsonl", cwd=tmp_path).returncode == 0
    assert (tmp_path / "there.jsonl").read_bytes() == (tmp_path / "here.jsonl").read_bytes()


OTHER = """
import busplan.cli.cluster as cluster
from busplan.__main__ import main
cluster.__version__ = "99.1"
if {late}:
    cluster._require_versions = lambda *_: None
main()
"""


@pytest.mark.parametrize("late", [False, True])
def test_workers_with_another_version_are_refused_by_its_name(
    cluster: Cluster, environment: dict[str, str], tmp_path: Path, late: bool
) -> None:
    arguments = (*SWEEP[:-1], f"{SWEEP[-1]}103", "--cluster", cluster.address, "-o", "there.csv")
    done = subprocess.run(
        [sys.executable, "-c", OTHER.format(late=late), *arguments],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert f" has busplan {__version__} where 99.1 is here; give it the same version\n" in done.stderr
    assert done.stderr.count("\n") == 1
    assert ("the worker tcp://" in done.stderr) is not late
    assert list(tmp_path.iterdir()) == []


REFUSED = {
    "--cluster tcp://127.0.0.1:1": "--cluster: goes with --circle",
    "--circle --jobs 2 --cluster tcp://127.0.0.1:1": "--jobs: is the number of processes here",
    "--circle --cluster localhost": "--cluster localhost: expected the address of a Dask scheduler, as tcp://",
}


@pytest.mark.parametrize("line", REFUSED)
def test_refusals(refused: Callable[..., str], tmp_path: Path, line: str) -> None:
    said = refused("sweep", "paper-1ms", "--vary", "bus.nodes=1:2", *line.split(), cwd=tmp_path)
    assert REFUSED[line] in said
    assert "\n" not in said


def test_a_scheduler_that_does_not_answer_is_said(refused: Callable[..., str], tmp_path: Path) -> None:
    impatient = "import busplan.cli.cluster as cluster; cluster._PATIENCE_S = 0.5\n"
    impatient += "from busplan.__main__ import main; main()"
    asked = ("sweep", "paper-1ms", "--vary", "bus.nodes=1:2", "--circle", "--cluster", "tcp://127.0.0.1:1")
    said = refused(*asked, cwd=tmp_path, python=("-c", impatient))
    assert "--cluster tcp://127.0.0.1:1: no Dask scheduler answers there: " in said
    assert "\n" not in said


def test_without_the_extra_it_is_said(
    refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("busplan.extras.find_spec", lambda _: None)
    asked = ("sweep", "paper-1ms", "--vary", "bus.nodes=1:2", "--circle", "--cluster", "tcp://127.0.0.1:1")
    said = refused(*asked, cwd=tmp_path)
    assert "--cluster needs distributed: install it with the extra, as in pip install 'busplan[cluster]'" in said
