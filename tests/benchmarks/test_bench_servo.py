"""How fast the servo core is, as ratios within one run; nothing is asserted about time.

`pytest tests/benchmarks --benchmark-enable` prints the table; the ratios stand in `extra_info` of the saved JSON. The
budget is 1.3 of the same loop in C.
"""

import ctypes
import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from busplan.servo.axis import Engine, compiled_kernel, simulate_axis
from busplan.servo.circle import simulate_circle
from busplan.servo.parameters import Axis, LoopTiming
from busplan.servo.path import circle_path

Floats = NDArray[np.float64]

AXIS = Axis(
    position_gain_per_s=143.0,
    velocity_feedforward=1.0,
    drive_lag_us=7500.0,
    drive_offset_mm_s=0.56,
    max_velocity_mm_s=400.0,
    dac_bits=16,
    encoder_resolution_mm=0.001,
    reversal_mm_s=1.6,
    reversal_recovery_us=10_000.0,
    reversal_smoothing_mm_s=0.5,
)
PATH = circle_path(320.0, feed_mm_per_min=2500.0, period_us=4000.0)
"""The paper's slow test: 48.656 s, 486,560 steps of 100 us on each of two axes."""
TIMING = LoopTiming(period_us=4000.0, step_us=100.0)
SETPOINTS = (PATH.x_mm, PATH.y_mm)

needs_compiled = pytest.mark.skipif(compiled_kernel("auto") is None, reason="the kernel is not compiled here")
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc to build the C kernel with")


def both_axes(engine: Engine) -> list[Floats]:
    return [simulate_axis(setpoints, axis=AXIS, timing=TIMING, engine=engine) for setpoints in SETPOINTS]


def best_of(run: Callable[[], object], *, rounds: int) -> float:
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def c_constants() -> list[float]:
    level, step = 2 * AXIS.max_velocity_mm_s / 2**AXIS.dac_bits, TIMING.step_us / 1e6
    lag, recovery = AXIS.drive_lag_us / 1e6, AXIS.reversal_recovery_us / 1e6
    lagging, fading = -math.expm1(-step / lag), -math.expm1(-step / recovery)
    controller = [AXIS.position_gain_per_s, 0.0, 0.0, step]
    encoder = [1 / AXIS.encoder_resolution_mm, AXIS.encoder_resolution_mm]
    dac = [-AXIS.max_velocity_mm_s, AXIS.max_velocity_mm_s - level, 1 / level, level]
    drive = [AXIS.drive_offset_mm_s, AXIS.reversal_mm_s, 1 / AXIS.reversal_smoothing_mm_s, AXIS.velocity_feedforward]
    return [*controller, *encoder, *dac, *drive, 1 - lagging, lag * lagging, 1 - fading, recovery * fading]


@pytest.fixture(scope="module")
def c_axes(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], list[Floats]]:
    library = tmp_path_factory.mktemp("kernel") / "kernel.so"
    source = Path(__file__).with_name("kernel.c")
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    run_axis = ctypes.CDLL(str(library)).run_axis
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    run_axis.argtypes = [pointer, pointer, ctypes.c_size_t, ctypes.c_size_t, ctypes.c_double, pointer]
    run_axis.restype = None
    constants = np.array(c_constants())

    def run() -> list[Floats]:
        positions = []
        for setpoints in SETPOINTS:
            out = np.empty(PATH.setpoints * TIMING.steps_per_period)
            run_axis(constants, setpoints, PATH.setpoints, TIMING.steps_per_period, TIMING.period_us / 1e6, out)
            positions.append(out)
        return positions

    return run


@needs_gcc
@needs_compiled
def test_compiled_kernel_against_c(
    benchmark: Any, c_axes: Callable[[], list[Floats]], size: Callable[[int, int], int]
) -> None:
    for found, expected in zip(both_axes("compiled"), c_axes(), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    # Taken in turns, so that a busy neighbour slows both.
    pairs = [(best_of(lambda: both_axes("compiled"), rounds=1), best_of(c_axes, rounds=1)) for _ in range(size(15, 1))]
    compiled, in_c = (min(times) for times in zip(*pairs, strict=True))
    benchmark.extra_info["c_seconds"] = in_c
    benchmark.extra_info["ratio_to_c"] = round(compiled / in_c, 3)
    benchmark.pedantic(both_axes, args=("compiled",), rounds=3)


@needs_gcc
def test_c_kernel(benchmark: Any, c_axes: Callable[[], list[Floats]]) -> None:
    benchmark.pedantic(c_axes, rounds=3, warmup_rounds=1)


def test_plain_kernel(benchmark: Any) -> None:
    benchmark.extra_info["steps"] = 2 * PATH.setpoints * TIMING.steps_per_period
    benchmark.pedantic(both_axes, args=("python",), rounds=1)


@needs_compiled
def test_whole_process(benchmark: Any, no_compiler: Mapping[str, str], size: Callable[[int, int], int]) -> None:
    """`busplan circle-test paper-4ms`, compiled and plain, against `--help`."""

    def run(*arguments: str, env: Mapping[str, str] | None = None) -> None:
        command = [sys.executable, "-m", "busplan", *arguments]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **(env or {})})

    test = partial(run, "circle-test", "paper-4ms")
    cases = {"compiled": test, "plain": partial(test, env=no_compiler), "help": partial(run, "--help")}
    # Taken in turns, so that a busy neighbour slows all.
    rounds = [{name: best_of(case, rounds=1) for name, case in cases.items()} for _ in range(size(5, 1))]
    seconds = {name: min(one[name] for one in rounds) for name in cases}
    benchmark.extra_info |= {f"{name}_seconds": round(took, 3) for name, took in seconds.items()}
    benchmark.extra_info["ratio_of_plain"] = round(seconds["plain"] / seconds["compiled"], 2)
    benchmark.pedantic(test, rounds=1)


def test_whole_circle_test(benchmark: Any) -> None:
    run = benchmark.pedantic(simulate_circle, args=(PATH,), kwargs={"x": AXIS, "y": AXIS, "timing": TIMING}, rounds=1)
    assert run.steps == 486_560
