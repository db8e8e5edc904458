"""`busplan report` as a whole process, as a ratio against the circle test with contributions that it contains.

The figures are read from the report; nothing here fails because a machine is slow. The budget is 1.5.
"""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

from pytest_benchmark.fixture import BenchmarkFixture

ROUNDS = 3


def seconds(*arguments: str, cwd: Path) -> float:
    start = perf_counter()
    subprocess.run([sys.executable, "-m", "busplan", *arguments], check=True, cwd=cwd, stdout=subprocess.DEVNULL)
    return perf_counter() - start


def test_whole_process(benchmark: BenchmarkFixture, tmp_path: Path, size: Callable[[int, int], int]) -> None:
    page = ("report", "paper-4ms", "-o", "report.html")
    circle = ("circle-test", "paper-4ms", "--contributions")
    # The first run of all may compile.
    for first in (circle, page)[: size(2, 0)]:
        seconds(*first, cwd=tmp_path)
    least: list[float] = []
    # In turns, so that a busy moment of the machine meets both.
    benchmark.pedantic(
        lambda: seconds(*page, cwd=tmp_path), setup=lambda: least.append(seconds(*circle, cwd=tmp_path)), rounds=ROUNDS
    )
    if benchmark.stats is None:  # run, and not measured
        return
    benchmark.extra_info["ratio_to_the_circle_test"] = round(benchmark.stats.stats.min / min(least), 3)
    benchmark.extra_info["kilobytes"] = round((tmp_path / "report.html").stat().st_size / 1e3, 1)
