"""How fast a sweep is: against the scalar path, and against the same equations written by hand in NumPy.

A million points, both timing models, all figures. Ratios within one run, in `extra_info`; nothing fails because a
machine is slow. The budgets are 200 times faster than the scalar path, and 3 times the time of the arithmetic by hand.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest

import busplan
from busplan.buses import kind_named
from busplan.buses.ieee1394.doubts import residual
from busplan.profile.document import override
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import network_of
from busplan.questions.sweep.grid import Chunk, Grid
from busplan.questions.sweep.table import CHUNK_POINTS, Sweep, figure_table

MODELS = ("paper", "standard")
GRIDS: dict[str, Callable[[int], dict[str, Any]]] = {
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
SCALAR_POINTS = 300

PROFILE = (
    kind_named("ieee1394")
    .profile_model()
    .model_validate(
        {
            "schema_version": 1,
            "name": "bench",
            "bus": {"kind": "ieee1394", "speed": "S400", "nodes": 2, "timing_model": "standard"},
            "cycle": {"period_us": 4000.0},
            "payload": {"read_bytes": 12, "write_bytes": 12},
            "node": {"axes": 4, "execution": {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}},
        }
    )
)


RATE, GAP, AXES = 393.216, 63, 4
BASE = 98.304
SUB_US, RESET_US = (29 + 16 * GAP) / BASE, (53 + 32 * GAP) / BASE


def keys_of(chunk: Chunk) -> tuple[Any, Any, Any]:
    """Nodes, slice and execution time of a chunk, for a chain at S400 with gap count 63."""
    n = chunk.values.get("bus.nodes", np.array(2)).astype(float)
    available = 0.5 * chunk.values.get("cycle.period_us", np.array(4000.0)).astype(float)
    return n, available, chunk.values.get("node.execution.base_us", np.array(30.0)) + 0.35 * 12


def cycle_by_hand(n: Any, execution: Any, clock: float, packets: tuple[int, int, int, int]) -> dict[str, Any]:
    """One cycle, straight from the equations: in the paper's clock with its gaps, else as the bus runs it."""
    way = (0.023 + 14 / clock) * n
    arbitration, acknowledge = way + 4 * GAP / clock + 1.63, way + 0.25
    read_data = 2 * way + 8 * (packets[0] + packets[1]) / RATE
    write_data = 2 * way + 8 * (packets[2] + packets[3]) / RATE
    read = 2 * arbitration + read_data + 2 * acknowledge + execution
    write = 2 * arbitration + write_data + 2 * acknowledge + execution
    if clock == BASE:
        sync = arbitration + way + 160 / RATE + RESET_US
        idle = busy(n, execution) - execution
    else:
        sync, idle = 0.3 + 0.1 * (n - 1), (82 + 48 * GAP) / clock
    terms = [
        *(sync + 0 * n, n * 4 * arbitration, n * (read_data + write_data), n * 4 * acknowledge),
        *(n * 2 * execution, n * 2 * idle + 0 * n),
    ]
    return {"read": read, "write": write, "sync": sync, "terms": terms, "required": sum(terms)}


def busy(n: Any, execution: Any) -> Any:
    first = np.where(n == 1, RESET_US, np.maximum(SUB_US, np.minimum(execution, RESET_US)))
    return np.maximum(first + RESET_US, execution + SUB_US)


def safe_by_hand(n: Any, execution: Any, packets: tuple[int, int, int, int]) -> dict[str, Any]:
    """What a cycle needs to be shown to fit; nobody has graded the execution time."""
    required = cycle_by_hand(n, execution, BASE, packets)["required"]
    bias = 4 * n * residual().mean_us
    steps = [busy(n, execution * share) for share in (0.8, 1.0, 1.2)]
    swing = 2 * n * np.maximum(steps[2] - steps[1], steps[1] - steps[0]) / 2
    phy = (12 * n + 2) * n * 0.020 / np.sqrt(3)
    doubt = 2 * np.sqrt((4 * n * residual().uncertainty_us) ** 2 + swing**2 + phy**2)
    return {"bias_us": bias + 0 * n, "uncertainty_us": doubt, "safe_required_us": required + bias + doubt}


def by_hand(chunk: Chunk, clock: float, packets: tuple[int, int, int, int]) -> dict[str, Any]:
    """All figures of a chunk."""
    n, available, execution = keys_of(chunk)
    one = cycle_by_hand(n, execution, clock, packets)
    required, gaps = one["required"], (82 + 48 * GAP) / clock
    best, binding = one["terms"][0], np.uint8(0)
    for index, term in enumerate(one["terms"][1:], start=1):
        binding = np.where(term > best, np.uint8(index), binding)  # type: ignore[assignment]
        best = np.maximum(term, best)

    def most(need: Callable[[float], Any]) -> Any:
        return sum((need(number) <= available).astype(np.int64) for number in range(1, 17))

    max_nodes = most(lambda number: cycle_by_hand(np.array(float(number)), execution, clock, packets)["required"])
    fits = required <= available
    found = {
        "axes": AXES * n,
        "available_us": available,
        "required_us": required,
        "time_slice_us": available / n,
        "required_time_slice_us": required / n,
        "read_latency_us": one["read"],
        "write_latency_us": one["write"],
        "sync_us": one["sync"],
        "binding": binding,
        "utilisation": required / available,
        "margin_us": available - required,
        "nodes_eq11": (available - one["sync"]) / (2 * ((one["read"] + one["write"]) / 2 + gaps)),
        "max_nodes": max_nodes,
        "max_axes": AXES * max_nodes,
        "min_period_us": required / 0.5,
        "fits": fits & (n <= 16),
    }
    if clock == BASE:
        found |= safe_by_hand(n, execution, packets)
        found["safe_nodes"] = most(
            lambda number: safe_by_hand(np.array(float(number)), execution, packets)["safe_required_us"]
        )
        found["margin_corrected_us"] = available - required - found["bias_us"]
    return found


def all_by_hand(grid: Grid) -> Iterator[tuple[Chunk, list[dict[str, Any]]]]:
    """The same chunks as a sweep, by hand."""
    for chunk in grid.chunks(CHUNK_POINTS):
        yield chunk, [by_hand(chunk, 393.216, (32, 32, 32, 32)), by_hand(chunk, BASE, (20, 36, 36, 16))]


def exhaust(items: Iterator[Any]) -> None:
    for _ in items:
        pass


def seconds(run: Callable[[], object]) -> float:
    start = perf_counter()
    run()
    return perf_counter() - start


def scalar_loop(grid: Grid) -> None:
    """The scalar path for points spread over the grid."""
    for changes in islice(grid.each_point(), 0, None, max(1, grid.points // SCALAR_POINTS)):
        variant = network_of(override(PROFILE, changes))
        for model in MODELS:
            figures(variant, model=model)


@pytest.mark.parametrize("name", GRIDS)
def test_sweep_of_a_million_points(benchmark: Any, name: str, size: Callable[[int, int], int]) -> None:
    grid = Grid(GRIDS[name](size(1_000_000, 100_000)))
    assert grid.points > 3 * CHUNK_POINTS

    def run() -> dict[str, Any]:
        return figure_table(Sweep(network_of(PROFILE), grid, MODELS, group=""))

    # The hand-written one is the same mathematics.
    table, (chunk, written) = run(), next(all_by_hand(grid))
    for number, theirs in enumerate(written):
        for figure in ("required_us", "nodes_eq11", "max_nodes", "safe_nodes", "safe_required_us", "uncertainty_us"):
            if figure in theirs:
                wanted = np.broadcast_to(theirs[figure], chunk.shape).ravel()
                found = table[figure][number :: len(MODELS)][: wanted.size]
                np.testing.assert_allclose(found, wanted, rtol=1e-12)
    # Taken in turns, so that a busy neighbour slows all.
    times = [
        (seconds(run), seconds(lambda: exhaust(all_by_hand(grid))), seconds(lambda: scalar_loop(grid)))
        for _ in range(size(7, 1))
    ]
    swept, by_hand_s, scalar = (min(column) for column in zip(*times, strict=True))
    benchmark.extra_info["points"] = grid.points
    benchmark.extra_info["nanoseconds_per_point"] = round(swept / grid.points * 1e9, 1)
    benchmark.extra_info["times_faster_than_scalar"] = round(scalar / SCALAR_POINTS / (swept / grid.points))
    benchmark.extra_info["times_numpy_by_hand"] = round(swept / by_hand_s, 2)
    benchmark.pedantic(run, rounds=1)


@pytest.mark.parametrize("form", ["csv", "json", "parquet"])
def test_rows_of_a_file(benchmark: Any, form: str, tmp_path: Path, size: Callable[[int, int], int]) -> None:
    if form == "parquet":
        pytest.importorskip("pyarrow")
    answer = busplan.sweep(PROFILE, vary={"cycle.period_us": range(1000, 1000 + size(130_000, 20_000))})

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
