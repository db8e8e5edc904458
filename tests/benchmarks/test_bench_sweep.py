"""How fast a sweep is, against the same answers of `capacity` one by one.

A million points, both timing models, all figures. Ratios within one run, in `extra_info`; nothing fails because a
machine is slow. The budget is 200 times faster than point by point.
"""

import subprocess
import sys
from collections.abc import Callable, Mapping
from itertools import islice, product
from math import prod
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest

import busplan

GRIDS: Mapping[str, Callable[[int], dict[str, Any]]] = {
    "one key": lambda points: {"cycle.period_us": 100 + np.arange(points) / 10},
    "three keys": lambda points: {
        "bus.nodes": np.arange(1, 17),
        "node.execution.base_us": np.arange(50) / 10,
        "cycle.period_us": 100 + np.arange(points // 800) * 4,
    },
    "short last key": lambda points: {
        "cycle.period_us": 100 + np.arange(points // 5) / 10,
        "bus.nodes": np.arange(1, 6),
    },
}
ALONE = 100
"""Points that are asked one by one."""


@pytest.fixture(scope="module")
def profile() -> busplan.Profile:
    execution = {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}
    return busplan.load_profile("paper-4ms", changes={"node.execution": execution})


def seconds(run: Callable[[], object]) -> float:
    start = perf_counter()
    run()
    return perf_counter() - start


@pytest.mark.parametrize("name", GRIDS)
def test_sweep_of_a_million_points(
    benchmark: Any, name: str, size: Callable[[int, int], int], profile: busplan.Profile
) -> None:
    vary = GRIDS[name](size(1_000_000, 100_000))
    points = prod(map(len, vary.values()))
    assert points >= size(1_000_000, 100_000)

    def run() -> busplan.SweepAnswer:
        return busplan.sweep(profile, vary=vary)

    def one_by_one() -> None:
        for values in islice(product(*vary.values()), 0, None, points // ALONE):
            busplan.capacity(busplan.load_profile(profile, changes=dict(zip(vary, values, strict=True))))

    # Taken in turns, so that a busy neighbour slows all.
    times = [(seconds(run), seconds(one_by_one)) for _ in range(size(7, 1))]
    swept, alone = (min(column) for column in zip(*times, strict=True))
    benchmark.extra_info["points"] = points
    benchmark.extra_info["nanoseconds_per_point"] = round(swept / points * 1e9, 1)
    benchmark.extra_info["times_faster_than_one_by_one"] = round(alone / ALONE / (swept / points))
    benchmark.pedantic(run, rounds=1)


@pytest.mark.parametrize("form", ["csv", "json", "parquet"])
def test_rows_of_a_file(
    benchmark: Any, form: str, tmp_path: Path, size: Callable[[int, int], int], profile: busplan.Profile
) -> None:
    if form == "parquet":
        pytest.importorskip("pyarrow")
    answer = busplan.sweep(profile, vary={"cycle.period_us": range(1000, 1000 + size(130_000, 20_000))})

    def write() -> None:
        answer.save(tmp_path / f"rows.{form}")

    benchmark.extra_info["microseconds_per_row"] = round(seconds(write) / answer["fits"].size * 1e6, 2)
    benchmark.pedantic(write, rounds=1)


PEAK = """
import resource, subprocess, sys
subprocess.run([sys.executable, "-m", "busplan", *sys.argv[1:]], stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


@pytest.mark.parametrize("form", ["table", "csv", "parquet"])
def test_peak_memory_is_that_of_the_figures(
    benchmark: Any, form: str, tmp_path: Path, size: Callable[[int, int], int]
) -> None:
    # Memory is no matter of how busy the machine is: this one is asserted.
    points = size(260_000, 100_000)
    arguments = ["sweep", "paper-4ms", "--vary", f"cycle.period_us=100:{99 + points}", "--format", form]
    if form != "table":
        arguments += ["-o", str(tmp_path / f"out.{form}")]

    def run() -> int:
        found = subprocess.run([sys.executable, "-c", PEAK, *arguments], check=True, capture_output=True, text=True)
        return int(found.stdout) // 1024

    peak_mb = benchmark.pedantic(run, rounds=1)
    benchmark.extra_info["peak_mb"] = peak_mb
    # A point has 1.1 kB of figures under two timing models, as text 1.1 kB more, a piece at a time; pyarrow takes a
    # good hundred MB, and its table is there beside the figures.
    assert peak_mb < (300 if form == "parquet" else 150) + points * 1.5e-3
