"""Compiled code is a gain and never a condition: the same bits with and without it."""

import subprocess
import sys
from collections.abc import Mapping
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan import servo
from busplan.errors import BusplanError
from busplan.servo import axis as simulation
from busplan.servo.axis import add_backlash, compiled_kernel, simulate_axis
from busplan.servo.delivery import arrivals
from busplan.servo.parameters import Axis, Delivery, LoopTiming

KERNEL = "busplan.servo._kernel"
WAVE = 20 * np.sin(np.linspace(0, 3, 301))

needs_compiled = pytest.mark.skipif(find_spec(KERNEL) is None, reason="the kernel is not compiled here")

axes = st.builds(
    Axis,
    position_gain_per_s=st.floats(1, 300),
    integral_gain_per_s2=st.sampled_from([0.0, 400.0]),
    derivative_gain=st.sampled_from([0.0, 0.01]),
    velocity_feedforward=st.sampled_from([0.0, 0.97]),
    acceleration_feedforward_s=st.sampled_from([0.0, 0.004]),
    drive_lag_us=st.sampled_from([0.0, 6000.0]),
    drive_offset_mm_s=st.floats(-1, 1),
    max_velocity_mm_s=st.sampled_from([400.0, 5.0]),
    dac_bits=st.sampled_from([0, 14]),
    encoder_resolution_mm=st.sampled_from([0.0, 0.0005]),
    reversal_mm_s=st.sampled_from([0.0, 1.1]),
    delay_us=st.floats(0, 1000),
)
timings = st.builds(
    LoopTiming,
    period_us=st.just(1000.0),
    loop=st.sampled_from(["node", "host"]),
    interpolation=st.sampled_from(["linear", "hold"]),
)


@needs_compiled
@given(axis=axes, timing=timings, backlash_mm=st.floats(0.001, 1))
def test_both_engines_give_the_same_bits(axis: Axis, timing: LoopTiming, backlash_mm: float) -> None:
    delivery = Delivery(jitter_us=30.0, skew_us=11.0, loss_probability=0.02, on_loss="extrapolate")
    arriving = arrivals(delivery, name="y", cycles=300, period_us=1000.0)
    results = []
    for name in ("python", "compiled"):
        position = simulate_axis(WAVE, axis=axis, timing=timing, arrivals=arriving, engine=name)
        motor = position.copy()
        add_backlash(position, backlash_mm=backlash_mm, engine=name)
        results.append((motor.tobytes(), position.tobytes()))
    assert results[0] == results[1]


@needs_compiled
def test_auto_is_compiled_where_it_can_be() -> None:
    assert compiled_kernel("auto") is compiled_kernel("compiled") is sys.modules[KERNEL]
    assert compiled_kernel("python") is None


@pytest.fixture
def afresh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for the compiled kernel anew, as a process that starts does."""
    monkeypatch.setattr(simulation, "_compiled", simulation._compiled.__wrapped__)  # noqa: SLF001
    monkeypatch.delitem(sys.modules, KERNEL, raising=False)


@pytest.mark.usefixtures("afresh")
@pytest.mark.parametrize("content", [None, b"", b"built for another Python"], ids=["none", "empty", "garbage"])
def test_without_an_extension_that_loads_plain_python_runs_and_compiled_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / f"_kernel{EXTENSION_SUFFIXES[0]}").write_bytes(content)
    monkeypatch.setattr(servo, "__path__", [str(tmp_path)])
    known: dict[str, Any] = {"axis": Axis(drive_lag_us=3000.0), "timing": LoopTiming(period_us=1000.0)}
    expected = simulate_axis(WAVE, **known, engine="python")
    np.testing.assert_array_equal(simulate_axis(WAVE, **known), expected)
    with pytest.raises(BusplanError, match=r"engine 'compiled': .* install one and busplan again, or use 'python'"):
        simulate_axis(WAVE, **known, engine="compiled")


def test_a_process_can_be_started_as_if_nothing_were_compiled(no_compiler: Mapping[str, str]) -> None:
    """What other rooms rely on when they ask for plain Python."""
    program = "from busplan.servo.axis import compiled_kernel; print(compiled_kernel('auto'))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=no_compiler)
    assert done.stdout == "None\n"
