"""References that owe nothing to the code under test, by numpy and scipy."""

import importlib.util
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from busplan.servo.parameters import Axis, LoopTiming
from tests.extras import needed

Floats = NDArray[np.float64]


class Sampled(NamedTuple):
    """A sampled system of one input and one output: states, input, output, passage."""

    a: Floats
    b: Floats
    c: Floats
    d: float
    period_s: float

    def at(self, frequency_hz: Any) -> NDArray[np.complex128]:
        """Its response at each frequency."""
        z = np.exp(2j * math.pi * np.atleast_1d(frequency_hz) * self.period_s)[:, None, None]
        inputs = np.broadcast_to(self.b[:, None], (len(z), len(self.b), 1))
        return np.asarray(np.linalg.solve(z * np.eye(len(self.b)) - self.a, inputs)[:, :, 0] @ self.c + self.d)

    def behind(self, first: "Sampled") -> "Sampled":
        """This system with the output of another as its input."""
        above = np.hstack([first.a, np.zeros((len(first.b), len(self.b)))])
        below = np.hstack([np.outer(self.b, first.c), self.a])
        states, inputs = np.vstack([above, below]), np.append(first.b, self.b * first.d)
        return Sampled(states, inputs, np.append(self.d * first.c, self.c), self.d * first.d, self.period_s)


Loop = Callable[[Axis, LoopTiming], Sampled]


def held(a: Floats, b: Floats, time_s: float) -> tuple[Floats, Floats]:
    """Transition and input matrix over a time with constant input, by the matrix exponential."""
    size = len(a)
    block = np.zeros((size + 1, size + 1))
    block[:size, :size], block[:size, size] = a, b
    moved = needed("scipy.linalg").expm(block * time_s)
    return moved[:size, :size], moved[:size, size]


def plant(axis: Axis, *, period_s: float, delay_s: float) -> Sampled:
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
    return Sampled(transition, np.append(late, 1.0), np.eye(1, size + 1)[0], 0.0, period_s)


def open_loop(axis: Axis, timing: LoopTiming) -> Sampled:
    period_s = timing.control_period_us / 1e6
    delay_s = axis.delay_us / 1e6 if timing.loop == "host" else 0.0
    # A delay of whole periods and a rest: each period is a shift.
    waiting = max(math.ceil(delay_s / period_s - 1e-9) - 1, 0)
    # The sum of all errors and the last one, where they have a gain.
    gains = np.array([axis.integral_gain_per_s2 * period_s, axis.derivative_gain / period_s])
    kept = gains > 0
    controller = Sampled(
        np.diag([1.0, 0.0])[kept][:, kept],
        np.ones(2)[kept],
        (gains * [1, -1])[kept],
        axis.position_gain_per_s + gains.sum(),
        period_s,
    )
    drive = plant(axis, period_s=period_s, delay_s=delay_s - waiting * period_s)
    if not waiting:
        return drive.behind(controller)
    shifts = Sampled(np.eye(waiting, k=-1), np.eye(waiting)[0], np.eye(waiting)[-1], 0.0, period_s)
    return drive.behind(shifts.behind(controller))


@pytest.fixture(scope="session")
def reference_loop() -> Loop:
    """The open position loop, sampled; from its description, not from busplan's formulas."""
    needed("scipy")
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
