"""`sweep --circle --cluster`: a real Dask scheduler and two worker processes, one of which is killed in the middle."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest

from busplan import __version__

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="needs distributed: the extra test-all has it")

Run = Callable[..., "subprocess.CompletedProcess[str]"]

SWEEP = ("sweep", "paper-1ms", "--circle", "--vary", "circle.radius_mm=10", "--vary", "servo.position_gain_per_s=100:")


class Cluster(NamedTuple):
    address: str
    workers: list[int]


def until(holds: Callable[[], object], *, seconds: float = 300) -> bool:
    deadline = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


PROCESSES = """
import os, signal, sys, time
from contextlib import suppress
from distributed.cli import dask_scheduler, dask_worker
import busplan.questions.sweep

def start(command, *arguments):
    pid = os.fork()
    if not pid:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(1, 2)
        command.main([*arguments, "--no-dashboard", "--scheduler-file", sys.argv[1]])
    return pid

pids = [start(dask_scheduler, "--host", "127.0.0.1", "--port", "0")]
while not os.path.exists(sys.argv[1]) or not open(sys.argv[1]).read().endswith("}"):
    time.sleep(0.02)
own = ("--no-nanny", "--nthreads", "1", "--local-directory", os.getcwd())
pids += [start(dask_worker, *own) for _ in range(2)]
print(*pids[1:], sep="\\n", flush=True)
signal.signal(signal.SIGTERM, lambda *_: sys.exit())
try:
    signal.pause()
finally:
    for pid in pids:
        with suppress(OSError):
            os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
"""
"""A scheduler and two workers, forked from one process that has loaded what all of them need."""


@pytest.fixture(scope="module")
def environment(no_compiler: Mapping[str, str]) -> dict[str, str]:
    quiet = {"DASK_DISTRIBUTED__DASHBOARD__LINK": "", "DASK_CONFIG": os.devnull}
    return {**os.environ, **no_compiler, **quiet}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory, environment: dict[str, str]) -> Iterator[Cluster]:
    folder = tmp_path_factory.mktemp("cluster")
    told = folder / "scheduler.json"

    with subprocess.Popen(
        [sys.executable, "-c", PROCESSES, str(told)], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
    ) as processes:
        try:
            assert until(lambda: told.exists() and told.read_text().endswith("}"))
            assert processes.stdout is not None
            workers = [int(processes.stdout.readline()) for _ in range(2)]
            yield Cluster(json.loads(told.read_text())["address"], workers)
        finally:
            processes.terminate()


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing(
    cluster: Cluster, environment: dict[str, str], run: Run, tmp_path: Path
) -> None:
    from distributed import Client  # noqa: PLC0415 - an extra

    gains = (*SWEEP[:-1], f"{SWEEP[-1]}129")
    told = tmp_path / "told.txt"
    with (
        Client(cluster.address, set_as_default=False) as client,
        told.open("w") as standard_error,
        subprocess.Popen(
            [sys.executable, "-m", "busplan", *gains, "--cluster", cluster.address, "-o", "there.json"],
            cwd=tmp_path,
            env=environment,
            stderr=standard_error,
        ) as process,
    ):
        client.wait_for_workers(len(cluster.workers))
        ((first, _),) = ((at, pid) for at, pid in client.run(os.getpid).items() if pid == cluster.workers[0])
        # It has results that nobody else has, and is at more.
        assert until(lambda: client.has_what()[first] and client.processing()[first])
        os.kill(cluster.workers[0], signal.SIGKILL)
        process.wait(300)
    said = told.read_text()
    told.unlink()
    assert process.returncode == 0, said
    assert "Warning" not in said
    assert said.endswith("wrote there.json\n")
    assert [path.name for path in tmp_path.iterdir()] == ["there.json"]
    assert run(*gains, "--jobs", "1", "-o", "here.json", cwd=tmp_path).returncode == 0
    assert (tmp_path / "there.json").read_bytes() == (tmp_path / "here.json").read_bytes()


OTHERS = """
import sys
import busplan.cli.workers as cluster
from busplan.__main__ import main

def run(address):
    sys.argv = ["busplan", *sweep, "--cluster", address, "-o", "there.csv"]
    try:
        main()
    except SystemExit as leaving:
        print(leaving.code)

address, *sweep = sys.argv[1:]
cluster._PATIENCE_S, patience_s = 0.5, cluster._PATIENCE_S
run("tcp://127.0.0.1:1")
cluster._PATIENCE_S, cluster.__version__ = patience_s, "99.1"
run(address)
calls = iter([lambda *_: 1, cluster._require_versions])
cluster._require_versions = lambda *arguments: next(calls)(*arguments)
run(address)
"""


@pytest.mark.slow
def test_other_versions_and_a_scheduler_that_does_not_answer_are_said(
    cluster: Cluster, environment: dict[str, str], tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", OTHERS, cluster.address, *SWEEP[:-1], f"{SWEEP[-1]}103"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.stdout == "2\n2\n2\n"
    nobody, *workers = done.stderr.splitlines()
    assert nobody.startswith("--cluster tcp://127.0.0.1:1: no Dask scheduler answers there: ")
    # Before any work, and of a worker that came later before anything is written.
    assert len(workers) == 2
    for said in workers:
        assert "the worker tcp://" in said
        assert said.endswith(f" has busplan {__version__} where 99.1 is here; give it the same version")
    assert list(tmp_path.iterdir()) == []


REFUSED = {
    "--cluster tcp://127.0.0.1:1": "--cluster: needs --circle",
    "--circle --jobs 2 --cluster tcp://127.0.0.1:1": "--jobs: is the number of processes here",
    "--circle --cluster localhost": "--cluster localhost: expected the address of a Dask scheduler, as tcp://",
}


@pytest.mark.parametrize("line", REFUSED)
def test_refusals(refused: Callable[..., str], tmp_path: Path, line: str) -> None:
    said = refused("sweep", "paper-1ms", "--vary", "bus.nodes=1:2", *line.split(), cwd=tmp_path)
    assert REFUSED[line] in said
    assert "\n" not in said


def test_without_the_extra_it_is_said(
    refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("busplan.extras.find_spec", lambda _: None)
    asked = ("sweep", "paper-1ms", "--vary", "bus.nodes=1:2", "--circle", "--cluster", "tcp://127.0.0.1:1")
    said = refused(*asked, cwd=tmp_path)
    assert "--cluster needs distributed: install it with the extra, as in pip install 'busplan[cluster]'" in said
