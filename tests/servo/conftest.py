"""References that owe nothing to the code under test: scipy and python-control."""

import importlib.util
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from busplan.servo.parameters import Axis, LoopTiming
from tests.extras import needed

if TYPE_CHECKING:
    import control

Floats = NDArray[np.float64]
Loop = Callable[[Axis, LoopTiming], "control.StateSpace"]


def held(a: Floats, b: Floats, time_s: float) -> tuple[Floats, Floats]:
    """Transition and input matrix over a time with constant input, by the matrix exponential."""
    size = len(a)
    block = np.zeros((size + 1, size + 1))
    block[:size, :size], block[:size, size] = a, b
    moved = needed("scipy.linalg").expm(block * time_s)
    return moved[:size, :size], moved[:size, size]


def plant(axis: Axis, *, period_s: float, delay_s: float) -> "control.StateSpace":
    """Drive and integrator, sampled, with the command delayed by a part of the period."""
    lag_s = axis.drive_lag_us / 1e6
    if lag_s:
        a, b = np.array([[0.0, 1.0], [0.0, -1 / lag_s]]), np.array([0.0, 1 / lag_s])
    else:
        a, b = np.zeros((1, 1)), np.ones(1)
    whole, _ = held(a, b, period_s)
    rest, late = held(a, b, period_s - delay_s)
    _, early = held(a, b, delay_s)
    size = len(a)
    transition = np.zeros((size + 1, size + 1))
    transition[:size, :size], transition[:size, size] = whole, rest @ early
    return needed("control").ss(transition, np.append(late, 1.0)[:, None], np.eye(1, size + 1), 0, period_s)


def open_loop(axis: Axis, timing: LoopTiming) -> "control.StateSpace":
    control = needed("control")  # it loads pyplot, and only its own tests pay
    period_s = timing.control_period_us / 1e6
    delay_s = axis.delay_us / 1e6 if timing.loop == "host" else 0.0
    # A delay of whole periods and a rest: each period is a shift.
    waiting = max(math.ceil(delay_s / period_s - 1e-9) - 1, 0)
    controller = control.tf([axis.position_gain_per_s], [1], period_s)
    if axis.integral_gain_per_s2:
        controller += control.tf([axis.integral_gain_per_s2 * period_s, 0], [1, -1], period_s)
    if axis.derivative_gain:
        gain = axis.derivative_gain / period_s
        controller += control.tf([gain, -gain], [1, 0], period_s)
    if waiting:
        controller *= control.tf([1], [1, *[0] * waiting], period_s)
    return plant(axis, period_s=period_s, delay_s=delay_s - waiting * period_s) * control.ss(controller)


@pytest.fixture(scope="session")
def reference_loop() -> Loop:
    """The open position loop, sampled; from its description, not from busplan's formulas."""
    needed("control")
    return open_loop


@pytest.fixture(scope="session")
def calibration() -> ModuleType:
    """The script that fits the paper's figures."""
    path = Path(__file__).parents[1] / "oracles" / "fit_servo.py"
    spec = importlib.util.spec_from_file_location("fit_servo", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
