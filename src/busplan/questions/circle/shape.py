"""The trace of a circle test condensed for drawings: its error by angle, and over time."""

from math import ceil
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from busplan.servo.circle import CircleRun
from busplan.servo.contour import blocks, contour_error

CONTOUR_SECTORS: Final = 720
"""Sectors of the drawn circle: half a degree each, narrower than a printed line."""


class ContourProfile(NamedTuple):
    """Smallest and largest contour error in equal sectors from the x axis on [mm]; None in one without points."""

    low_mm: tuple[float | None, ...]
    high_mm: tuple[float | None, ...]

    @property
    def largest_mm(self) -> float:
        """Largest contour error, without its sign [mm]."""
        return max((abs(error) for error in (*self.low_mm, *self.high_mm) if error is not None), default=0.0)


def contour_profile(run: CircleRun) -> ContourProfile:
    """Contour error of the measured part of a circle test, by sectors counter-clockwise from the positive x axis."""
    low, high = np.full(CONTOUR_SECTORS, np.inf), np.full(CONTOUR_SECTORS, -np.inf)
    for block in blocks(run.measured):
        x_mm, y_mm = run.x_mm[block], run.y_mm[block]
        error_mm = contour_error(x_mm, y_mm=y_mm, radius_mm=run.path.radius_mm)
        turn = np.arctan2(y_mm, x_mm) / (2 * np.pi) % 1.0
        sector = np.minimum((turn * CONTOUR_SECTORS).astype(np.int64), CONTOUR_SECTORS - 1)
        # Neighbouring points are mostly in the same sector, so each run of them is reduced to its extremes first.
        entered = np.flatnonzero(np.diff(sector, prepend=-1))
        np.minimum.at(low, sector[entered], np.minimum.reduceat(error_mm, entered))
        np.maximum.at(high, sector[entered], np.maximum.reduceat(error_mm, entered))
    return ContourProfile(
        tuple(float(value) if np.isfinite(value) else None for value in low),
        tuple(float(value) if np.isfinite(value) else None for value in high),
    )


Floats = NDArray[np.float64]
_MAX_POINTS: Final = 1000
"""Points of the whole move's curve, smallest and largest of each pixel or so. More would not be visible."""
_LEAST_POINTS: Final = 50
"""Points of a part of the move, however short."""


class ErrorPart(NamedTuple):
    """A part of the move with the points of its error curve, reduced to their extremes if they are many."""

    time_s: Floats
    error_um: Floats
    measured: bool


class Shape(NamedTuple):
    """Contour error of a simulated circle, condensed."""

    contour: ContourProfile | None
    """Contour error by angle in the measured part; None where the table left the circle."""
    parts: tuple[ErrorPart, ...]
    """Contour error over time before, in and after the measured part; neighbours share a point."""

    @classmethod
    def of(cls, run: CircleRun) -> "Shape":
        """Shape of a simulation."""
        return cls(None if run.diverged else contour_profile(run), _parts(run))


def _parts(run: CircleRun) -> tuple[ErrorPart, ...]:
    """Parts before, in and after the measured turn or arc; neighbours share a point."""
    error_um = contour_error(run.x_mm, y_mm=run.y_mm, radius_mm=run.path.radius_mm) * 1e3
    start, stop = run.measured.start, min(run.measured.stop, run.steps)
    ranges = ((0, start + 1, False), (start, stop, True), (stop - 1, run.steps, False))
    parts = []
    for first, end, measured in ranges:
        most = max(_LEAST_POINTS, _MAX_POINTS * (end - first) // run.steps)
        kept = first + extremes(error_um[first:end], most=most)
        time_s = (kept + 1).astype(np.float64) * (run.timing.step_us / 1e6)
        parts.append(ErrorPart(time_s, error_um[kept], measured))
    return tuple(parts)


def extremes(values: Floats, *, most: int) -> NDArray[np.int64]:
    """Indices of points that keep the outline of a curve: smallest and largest of each stretch, first and last.

    They are about `most` points, ascending; a shorter curve keeps all.

    Examples
    --------
    >>> extremes(np.array([0.0, 1.0, 9.0, 2.0, 3.0, -7.0, 4.0, 5.0]), most=4).tolist()
    [0, 2, 5, 7]
    >>> len(extremes(np.linspace(0.0, 1.0, 199), most=20))
    20
    """
    if len(values) <= most:
        return np.arange(len(values))
    width = ceil(2 * len(values) / most)
    firsts = range(0, len(values), width)
    kept = [first + pick(values[first : first + width]) for first in firsts for pick in (np.argmin, np.argmax)]
    return np.unique([0, *kept, len(values) - 1])
