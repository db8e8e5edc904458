"""Fit four servo parameters to the four contour figures of the paper, and print what is left of them.

    python tests/oracles/fit_servo.py

This is a calibration, not a validation: the paper gives four figures and no servo parameter, and four free parameters
meet four figures. That the set is physical (a drive lag of milliseconds, friction of millimetres a second) is all it
says for the model. The other parameters are assumed: proportional control with full velocity feed-forward, a 1 um
encoder, the paper's 16-bit DAC over +/- 400 mm/s, a recovery in 10 ms, a smooth sign over 0.5 mm/s.

The maximum is one sample out of half a million, so it steps with the encoder counts; the fit uses difference steps
that are wide against that and ends where the steps let it.
"""

import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from busplan.servo.circle import CircleRun, simulate_circle
from busplan.servo.parameters import Axis, LoopTiming
from busplan.servo.path import circle_path

RADIUS_MM = 320.0
RUNS = ((4000.0, 2500.0), (1000.0, 10000.0))
"""Period [us] and feed [mm/min] of the two tests: G. Gu et al., IEEE Trans. Ind. Electron. 57 (12), section IV-B."""
PUBLISHED_MM = np.array([0.0036, 0.0187, 0.0049, 0.0219])
"""Mean and maximum contour error of the first run, then of the second (section IV-B)."""
FITTED = ("position_gain_per_s", "drive_lag_us", "drive_offset_mm_s", "reversal_mm_s")
CALIBRATED = np.array([143.0, 7500.0, 0.56, 1.6])
"""The calibrated set, rounded; all four figures within 2 %."""


def calibrated_axis(fitted: Sequence[float] | NDArray[np.float64] = CALIBRATED) -> Axis:
    """The axis with the four fitted parameters, in the order of `FITTED`."""
    gain, lag, offset, reversal = (float(value) for value in fitted)
    return Axis(
        position_gain_per_s=gain,
        velocity_feedforward=1.0,
        drive_lag_us=lag,
        drive_offset_mm_s=offset,
        max_velocity_mm_s=400.0,
        dac_bits=16,
        encoder_resolution_mm=0.001,
        reversal_mm_s=reversal,
        reversal_recovery_us=10_000.0,
        reversal_smoothing_mm_s=0.5,
    )


def run(axis: Axis, *, period_us: float, feed_mm_per_min: float) -> CircleRun:
    """The paper's circle at one of its periods."""
    path = circle_path(RADIUS_MM, feed_mm_per_min=feed_mm_per_min, period_us=period_us, ramp_periods=100)
    return simulate_circle(path, x=axis, y=axis, timing=LoopTiming(period_us=period_us, step_us=100.0))


def deviations(fitted: Sequence[float] | NDArray[np.float64] = CALIBRATED) -> NDArray[np.float64]:
    """Each figure of the simulation relative to the published one, minus 1."""
    axis = calibrated_axis(fitted)
    found = []
    for period_us, feed_mm_per_min in RUNS:
        contour = run(axis, period_us=period_us, feed_mm_per_min=feed_mm_per_min).contour
        found += [contour.mean_contour_error_mm, contour.max_contour_error_mm]
    return np.asarray(np.array(found) / PUBLISHED_MM - 1)


def fit(*, evaluations: int = 30) -> NDArray[np.float64]:
    """The four parameters with the least squared relative deviations, from a rough guess."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - only who fits anew pays

    guess = np.array([100.0, 5000.0, 0.4, 1.0])
    solution = least_squares(
        lambda share: deviations(share * guess), np.ones(4), bounds=(0.2, 5.0), diff_step=0.02, max_nfev=evaluations
    )
    return np.asarray(solution.x * guess)


def report(title: str, fitted: NDArray[np.float64]) -> str:
    """One block of text: the parameters, the figures, the deviations."""
    left = deviations(fitted)
    rows = [title, *(f"  {name:22} {value:10.4g}" for name, value in zip(FITTED, fitted, strict=True))]
    for i, (period_us, _) in enumerate(RUNS):
        for j, what in enumerate(("mean", "max")):
            at = 2 * i + j
            rows.append(
                f"  {what:4} at {period_us / 1000:g} ms: {PUBLISHED_MM[at] * (1 + left[at]):.5f} mm, "
                f"published {PUBLISHED_MM[at]:.4f} mm, {left[at]:+.2%}"
            )
    return "\n".join(rows)


if __name__ == "__main__":
    sys.stdout.write(report("fitted (a calibration, not a validation)", fit()) + "\n")
    sys.stdout.write(report("shipped: the same, rounded", CALIBRATED) + "\n")
