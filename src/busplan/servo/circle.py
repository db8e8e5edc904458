"""Simulate and measure a circle test."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from busplan.progress import Progress
from busplan.servo.axis import Engine, axis_targets, checked_steps, move_to_table, simulate_axis
from busplan.servo.contour import Contour, contour_error, covered_deg, measure_contour
from busplan.servo.delivery import Arrivals, arrivals
from busplan.servo.margins import LoopMargins, loop_margins
from busplan.servo.parameters import Axis, Delivery, LoopTiming, Mechanics, Refused, refuse
from busplan.servo.path import CirclePath, measured_part
from busplan.servo.runnable import out_of_reach, unfit_delivery

Floats = NDArray[np.float64]

_IDEAL_DELIVERY = Delivery()
_IDEAL_MECHANICS = Mechanics()
FULL_TURN_DEG = 360.0
_FOLLOWING_DEG = 36.0
"""Largest deviation from a full turn that counts as a following error: a tenth of it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """Time series of a simulation, each of shape (n,)."""

    time_us: Floats
    command_x_mm: Floats
    command_y_mm: Floats
    """Targets that the loops followed, with interpolation, delays and losses."""
    x_mm: Floats
    y_mm: Floats
    contour_error_mm: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CircleRun:
    """One simulated circle test."""

    path: CirclePath
    x: Axis
    y: Axis
    timing: LoopTiming
    """Input of the simulation."""
    arrivals_x: Arrivals
    arrivals_y: Arrivals
    """When and whether the packets arrived."""
    x_mm: Floats
    y_mm: Floats
    """Position of the table at the end of every step, shape (steps,) [mm]."""
    contour: Contour
    """Measures; finite even if the loop is unstable."""
    measured: slice
    """Steps at constant speed that are measured: a whole turn, or the settled arc of a trapezoid."""
    margins_x: LoopMargins
    margins_y: LoopMargins
    """Stability of both position loops."""

    @property
    def steps(self) -> int:
        """Number of simulated steps [1]."""
        return len(self.x_mm)

    @property
    def covered_deg(self) -> float:
        """Angle of the table about the centre on the turn or on the whole trapezoid, positive along the path [deg]."""
        if self.path.turn_from_us is None:
            return self._along_path_deg(None)
        # From the end of the step before the turn.
        return self._along_path_deg(slice(self.measured.start - 1, self.measured.stop))

    @property
    def constant_speed_deg(self) -> float:
        """Angle of the measured steps about the centre, positive along the path: 360 on a turn [deg]."""
        return self._along_path_deg(self.measured) if self.path.turn_from_us is None else FULL_TURN_DEG

    def _along_path_deg(self, part: slice | None) -> float:
        forward = 1.0 if self.path.direction == "ccw" else -1.0
        return forward * covered_deg(self.x_mm, y_mm=self.y_mm, part=part)

    @property
    def follows(self) -> bool:
        """Whether the table made one turn with errors up to the radius."""
        return not self.diverged and abs(self.covered_deg - FULL_TURN_DEG) <= _FOLLOWING_DEG

    @property
    def diverged(self) -> bool:
        """Whether a loop is unstable, or a contour error exceeds the radius."""
        stable = self.margins_x.stable and self.margins_y.stable
        return not stable or self.contour.max_contour_error_mm > self.path.radius_mm

    def trace(self, *, every: int = 1) -> Trace:
        """Time, targets, positions and contour error at every n-th step, the first at the end of step n."""
        if every < 1:
            refuse(Refused("every", every, "must be 1 or more"))
        seen = slice(every - 1, None, every)
        target = partial(axis_targets, timing=self.timing, every=every)
        x_mm, y_mm = self.x_mm[seen], self.y_mm[seen]
        return Trace(
            time_us=np.arange(every, self.steps + 1, every, dtype=np.float64) * self.timing.step_us,
            command_x_mm=target(self.path.x_mm, axis=self.x, arrivals=self.arrivals_x),
            command_y_mm=target(self.path.y_mm, axis=self.y, arrivals=self.arrivals_y),
            x_mm=x_mm,
            y_mm=y_mm,
            contour_error_mm=contour_error(x_mm, y_mm=y_mm, radius_mm=self.path.radius_mm),
        )


def simulate_circle(
    path: CirclePath,
    *,
    x: Axis,
    y: Axis,
    timing: LoopTiming,
    delivery: Delivery = _IDEAL_DELIVERY,
    mechanics: Mechanics = _IDEAL_MECHANICS,
    progress: Progress | None = None,
    engine: Engine = "auto",
) -> CircleRun:
    """Simulate a circle test on two axes and measure it.

    Parameters
    ----------
    path
        Set-points of the circle (`busplan.servo.path.circle_path`).
    x, y
        The axes.
    timing
        Timing of the loops; its period must be that of the path.
    delivery
        Delivery of the set-points; perfect by default.
    mechanics
        Errors between encoders and table; none by default.
    progress
        Called from time to time with the steps done and the total of both axes.
    engine
        "auto" (compiled if possible), "compiled" or "python"; the result is the same.

    Returns
    -------
    CircleRun
        Positions, measures and margins.

    Raises
    ------
    BusplanError
        The periods differ, a drive cannot reach the feed, jitter and skew are too large for the period, there are
        too many steps, or "compiled" without a compiled kernel.

    Notes
    -----
    On a path with a whole turn, everything is measured on that turn. On a trapezoid, mean and largest contour error are
    those of the whole move. The other measures begin a period after the set-points have reached the feed, when the
    loops have settled to a thousandth, at the latest after a fifth of the constant speed, and end when the set-points
    slow down; there is no circular deviation G.

    References
    ----------
    ISO 230-4, Test code for machine tools: circular tests for numerically controlled machine tools.

    Examples
    --------
    Two P loops lag behind and cut the circle by r (1 / sqrt(1 + (w / kp)^2) - 1), w = feed / r:

    >>> from busplan.servo.path import circle_path, settling_time_us
    >>> axis, timing = Axis(position_gain_per_s=50.0, velocity_feedforward=0.0), LoopTiming(period_us=1000.0)
    >>> settling_us = settling_time_us(axis, axis, timing=timing, feed_mm_per_min=6000.0)
    >>> path = circle_path(50.0, feed_mm_per_min=6000.0, period_us=1000.0, settling_us=settling_us)
    >>> run = simulate_circle(path, x=axis, y=axis, timing=timing)
    >>> round(run.contour.radius_deviation_mm, 3), round(50 * (1 / (1 + (2 / 50) ** 2) ** 0.5 - 1), 3)
    (-0.04, -0.04)
    >>> abs(run.contour.circular_deviation_mm) < 1e-4
    True
    """
    check_circle(path, x=x, y=y, timing=timing, delivery=delivery)
    received = partial(arrivals, delivery, cycles=path.setpoints, period_us=path.period_us)
    arrivals_x, arrivals_y = received(name="x"), received(name="y")
    total = 2 * path.setpoints * timing.steps_per_period

    def report(done_before: int, done: int, _axis_total: int) -> None:
        if progress is not None:
            progress(done_before + done, total)

    run = partial(simulate_axis, timing=timing, engine=engine)
    x_mm = run(path.x_mm, axis=x, arrivals=arrivals_x, progress=partial(report, 0))
    y_mm = run(path.y_mm, axis=y, arrivals=arrivals_y, progress=partial(report, total // 2))
    move_to_table(x_mm, y_mm=y_mm, mechanics=mechanics, engine=engine)
    margins_x, margins_y = loop_margins(x, timing=timing), loop_margins(y, timing=timing)
    part = measured_part(path, timing=timing, margins=(margins_x, margins_y))
    return CircleRun(
        path=path,
        x=x,
        y=y,
        timing=timing,
        arrivals_x=arrivals_x,
        arrivals_y=arrivals_y,
        x_mm=x_mm,
        y_mm=y_mm,
        contour=measure_contour(x_mm, y_mm=y_mm, radius_mm=path.radius_mm, part=part.steps, turn_share=part.turn_share),
        measured=part.steps,
        margins_x=margins_x,
        margins_y=margins_y,
    )


def check_circle(
    path: CirclePath, *, x: Axis, y: Axis, timing: LoopTiming, delivery: Delivery = _IDEAL_DELIVERY
) -> None:
    """Check the arguments of `simulate_circle` without simulating.

    Examples
    --------
    >>> from busplan.servo.path import circle_path
    >>> path = circle_path(50.0, feed_mm_per_min=6000.0, period_us=1000.0)
    >>> axis = Axis(position_gain_per_s=50.0, max_velocity_mm_s=400.0)
    >>> check_circle(path, x=axis, y=axis, timing=LoopTiming(period_us=1000.0))
    """
    refused = []
    if path.period_us != timing.period_us:
        right = f"the set-points of the path come every {path.period_us} us"
        refused.append(Refused("period_us", timing.period_us, right))
    for name, axis in (("x", x), ("y", y)):
        refused.extend(out_of_reach(axis, name=name, feed_mm_per_min=path.feed_mm_per_min))
    refuse(*refused, *unfit_delivery(delivery, period_us=timing.period_us))
    checked_steps(path.x_mm, axis=x, timing=timing)
    checked_steps(path.y_mm, axis=y, timing=timing)
