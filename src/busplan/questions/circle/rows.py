"""What each row of the circle test's figure shows, and the scales that all rows share."""

from collections.abc import Sequence
from math import ceil
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from busplan.questions.circle.record import CircleFigures, CircleTest
from busplan.questions.circle.scale import ErrorRange, LengthUnit, Magnified, error_range, length_unit, magnified
from busplan.sections.machine import ToleranceSection
from busplan.servo.circle import CircleRun
from busplan.servo.contour import contour_error

Floats = NDArray[np.float64]

_MAX_POINTS: Final = 2000
"""Most points of one curve: more would not be visible."""


class Curve(NamedTuple):
    """A part of the move. Of many points, the smallest and the largest error of each stretch are kept."""

    time_s: Floats
    error_um: Floats
    measured: bool


class CircleRow(NamedTuple):
    """One simulated period."""

    result: CircleFigures
    run: CircleRun
    curves: tuple[Curve, ...]

    @property
    def judged(self) -> tuple[Curve, ...]:
        """Curves that mean and largest error are taken from: the whole move on a trapezoid."""
        return tuple(curve for curve in self.curves if curve.measured or self.result.path == "trapezoid")


class Scales(NamedTuple):
    """What all rows share, so that they compare."""

    circle: Magnified | None
    """None if there is no error to show."""
    errors: ErrorRange
    unit: LengthUnit
    tolerance: ToleranceSection


def circle_rows(test: CircleTest) -> list[CircleRow]:
    """Rows of the periods that were simulated.

    Parameters
    ----------
    test
        The circle test.
    """
    pairs = zip(test.results, test.runs, strict=True)
    return [CircleRow(result, run, _curves(run)) for result, run in pairs if run is not None]


def common_scales(rows: Sequence[CircleRow], tolerance: ToleranceSection) -> Scales:
    """Scales of all rows. A row whose table left the circle counts only if there is no other.

    Parameters
    ----------
    rows
        The rows, one or more.
    tolerance
        What the circle must hold.
    """
    shown = [row for row in rows if not row.run.diverged] or rows
    measured = [curve.error_um for row in shown for curve in row.curves if curve.measured]
    judged = [curve.error_um for row in shown for curve in row.judged]
    radius_um = rows[0].result.radius_mm * 1e3
    low_um, high_um = (float(np.clip(end, -radius_um, radius_um)) for end in _ends(judged))
    largest_mm = min(max(map(abs, _ends(measured))), radius_um) / 1e3
    circle = magnified(largest_mm, tolerance_mm=tolerance.max_contour_error_mm)
    errors = error_range(low_um, high_um)
    if circle is not None and circle.tolerance_mm is not None and not errors.zero_outside:
        limit_um = circle.tolerance_mm * 1e3
        errors = ErrorRange(min(errors.bottom_um, -limit_um), max(errors.top_um, limit_um))
    return Scales(circle, errors, length_unit(errors.largest_um), tolerance)


def _ends(errors: Sequence[Floats]) -> tuple[float, float]:
    return min(float(one.min()) for one in errors), max(float(one.max()) for one in errors)


def _curves(run: CircleRun) -> tuple[Curve, ...]:
    """The measured part, and what lies before and behind it; neighbours share a point."""
    error_um = contour_error(run.x_mm, y_mm=run.y_mm, radius_mm=run.path.radius_mm) * 1e3
    start, stop = run.measured.start, min(run.measured.stop, run.steps)
    parts = ((0, start + 1, False), (start, stop, True), (stop - 1, run.steps, False))
    curves = []
    for first, end, measured in parts:
        kept = first + extremes(error_um[first:end], most=_MAX_POINTS)
        time_s = (kept + 1).astype(np.float64) * (run.timing.step_us / 1e6)
        curves.append(Curve(time_s, error_um[kept], measured))
    return tuple(curves)


def extremes(values: Floats, *, most: int) -> NDArray[np.int64]:
    """Choose points that keep the outline of a curve: of each stretch the smallest and the largest.

    Parameters
    ----------
    values
        The curve, shape (n,).
    most
        About how many points are chosen; a shorter curve keeps all [1].

    Returns
    -------
    ndarray
        Indices in ascending order, the first and the last one among them.

    Examples
    --------
    >>> extremes(np.array([0.0, 1.0, 9.0, 2.0, 3.0, -7.0, 4.0, 5.0]), most=4).tolist()
    [0, 2, 5, 7]
    """
    if len(values) <= most:
        return np.arange(len(values))
    width = ceil(2 * len(values) / most)
    whole = len(values) // width
    stretches = values[: whole * width].reshape(whole, width)
    first = np.arange(whole) * width
    rest = whole * width + extremes(values[whole * width :], most=width)
    ends = np.array([0, len(values) - 1])
    return np.unique(np.concatenate((first + stretches.argmin(axis=1), first + stretches.argmax(axis=1), rest, ends)))
