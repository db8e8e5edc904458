"""What a whole process costs, as a ratio against loading the libraries alone, in the same run.

The figures are read from the report; nothing here fails because a machine is slow. The budget is 1.4 for `capacity`.
"""

import subprocess
import sys
from collections.abc import Callable
from time import perf_counter

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

BASELINE = [sys.executable, "-c", "import typer; from pydantic import BaseModel; import rich.table"]
ROUNDS = 8


def seconds(command: list[str]) -> float:
    start = perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return perf_counter() - start


@pytest.mark.parametrize("arguments", [["capacity", "paper-4ms"], ["latency", "paper-4ms"], ["--help"]])
def test_whole_process(benchmark: BenchmarkFixture, arguments: list[str], size: Callable[[int, int], int]) -> None:
    command = [sys.executable, "-m", "busplan", *arguments]
    for first in (command, BASELINE)[: size(2, 0)]:
        seconds(first)
    # Taken in turns, so that a busy moment of the machine meets both.
    baseline: list[float] = []
    benchmark.pedantic(lambda: seconds(command), setup=lambda: baseline.append(seconds(BASELINE)), rounds=ROUNDS)
    if benchmark.stats is None:  # run, and not measured
        return
    benchmark.extra_info["ratio_to_loading_the_libraries"] = round(benchmark.stats.stats.min / min(baseline), 3)
