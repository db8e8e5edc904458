"""How fast a sweep is: against the scalar path, and against the same equations written by hand in NumPy.

Ten million points, both timing models, all figures. Ratios within one run, in `extra_info`; nothing fails because a
machine is slow. The budgets are 200 times faster than the scalar path, and 3 times the time of the arithmetic by hand.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from busplan.questions.sweep.blocks import CHUNK_POINTS, figure_names, sweep

from busplan.buses.ieee1394.section import Ieee1394Profile
from busplan.buses.ieee1394.table_1 import residual
from busplan.forms import RowsForm
from busplan.profile.toml import override
from busplan.questions.fit.figures import figures
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.grid import Chunk, Grid, Steps, checked_grid
from busplan.questions.sweep.rows import TEXT_POINTS, TextForm, rows_writer

MODELS = ("paper", "standard")
GRIDS = {
    "one key": {"cycle.period_us": Steps(1000, 1, 10, 10_000_000)},
    "three keys": {
        "bus.nodes": Steps(1, 1, 1, 16),
        "node.execution.base_us": Steps(0, 1, 10, 625),
        "cycle.period_us": Steps(100, 4, 1, 1000),
    },
    "short last key": {"cycle.period_us": Steps(1000, 1, 10, 2_000_000), "bus.nodes": Steps(1, 1, 1, 5)},
}
SCALAR_POINTS = 300

PROFILE = Ieee1394Profile.model_validate(
    {
        "schema_version": 1,
        "name": "bench",
        "bus": {"kind": "ieee1394", "speed": "S400", "nodes": 2, "timing_model": "standard"},
        "cycle": {"period_us": 4000.0},
        "payload": {"read_bytes": 12, "write_bytes": 12},
        "node": {"axes": 4, "execution": {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}},
    }
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
    points = [chunk.point(0) for chunk in grid.chunks(CHUNK_POINTS)]
    for changes in points[:: max(1, len(points) // SCALAR_POINTS)][:SCALAR_POINTS]:
        variant = override(PROFILE, changes)
        for model in MODELS:
            figures(variant, model=model)


@pytest.mark.parametrize("name", GRIDS)
def test_sweep_of_ten_million_points(benchmark: Any, name: str, size: Callable[[int, int], int]) -> None:
    points = size(10_000_000, 100_000)
    # The longest key goes less far where nothing is measured.
    keys = dict(GRIDS[name])
    longest = max(keys, key=lambda key: keys[key].size)
    keys[longest] = keys[longest]._replace(size=keys[longest].size * points // 10_000_000)
    grid = checked_grid(PROFILE, dict(keys), with_circle=False)
    assert grid.points == points
    assert points > 3 * CHUNK_POINTS

    def run() -> None:
        exhaust(sweep(PROFILE, grid, timing_models=("paper", "standard")))

    # The hand-written one is the same mathematics.
    block = next(iter(sweep(PROFILE, grid, timing_models=("paper", "standard"))))
    _, written = next(all_by_hand(grid))
    for ours, theirs in zip(block.models, written, strict=True):
        shared = {
            "required_us",
            "nodes_eq11",
            "max_nodes",
            "safe_nodes",
            "safe_required_us",
            "bias_us",
            "uncertainty_us",
        }
        for figure in shared & set(theirs):
            np.testing.assert_allclose(
                np.broadcast_to(ours[figure].values, block.chunk.shape),
                np.broadcast_to(theirs[figure], block.chunk.shape),
                rtol=1e-12,
            )
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


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_rows_as_text(benchmark: Any, form: TextForm, size: Callable[[int, int], int]) -> None:
    csv = pytest.importorskip("pyarrow.csv")
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")

    grid = checked_grid(PROFILE, {"cycle.period_us": Steps(1000, 3, 10, size(130_000, 20_000))}, with_circle=False)
    table = Sweep(PROFILE, grid, MODELS, ("cycle.period_us", *figure_names(PROFILE)))
    parts = list(sweep(PROFILE, grid, timing_models=MODELS, chunk_points=TEXT_POINTS))

    def write(form: RowsForm) -> bytes:
        found: list[bytes] = []
        writer = rows_writer(form, table, found.append)
        for part in parts:
            writer.add(part)
        writer.finish(complete=True)
        return b"".join(found)

    theirs = parquet.read_table(arrow.BufferReader(write("parquet")))
    # Taken in turns, so that a busy neighbour slows all.
    times = [
        (seconds(lambda: write(form)), seconds(lambda: csv.write_csv(theirs, arrow.BufferOutputStream())))
        for _ in range(size(5, 1))
    ]
    ours, others = (min(column) for column in zip(*times, strict=True))
    benchmark.extra_info["microseconds_per_row"] = round(ours / grid.points / len(MODELS) * 1e6, 2)
    benchmark.extra_info["times_csv_of_pyarrow"] = round(ours / others, 1)
    benchmark.pedantic(lambda: write(form), rounds=1)


PEAK = """
import resource, subprocess, sys
subprocess.run([sys.executable, "-m", "busplan", *sys.argv[1:]], stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
MEMORY_POINTS = {"table": (3_000_000, 1_000_000), "csv": (300_000, 100_000), "parquet": (1_000_000, 200_000)}
PEAK_MB = {"table": (300, 100), "csv": (300, 100), "parquet": (400, 300)}
"""pyarrow itself takes a good hundred."""


@pytest.mark.parametrize("form", MEMORY_POINTS)
def test_peak_memory_is_flat(benchmark: Any, form: str, tmp_path: Path, size: Callable[[int, int], int]) -> None:
    # Memory is no matter of how busy the machine is: this one is asserted.
    # Even the smaller ones would be over their limit if rows were kept: a point has 490 bytes of figures, 820 of text.
    measured, run_once = MEMORY_POINTS[form]
    periods = f"100:{99 + size(measured, run_once)}"
    arguments = ["sweep", "paper-4ms", "--vary", f"cycle.period_us={periods}", "--format", form]
    if form != "table":
        arguments += ["-o", str(tmp_path / f"out.{form}")]

    def run() -> int:
        found = subprocess.run([sys.executable, "-c", PEAK, *arguments], check=True, capture_output=True, text=True)
        return int(found.stdout) // 1024

    peak_mb = benchmark.pedantic(run, rounds=1)
    benchmark.extra_info["peak_mb"] = peak_mb
    assert peak_mb < size(*PEAK_MB[form])
