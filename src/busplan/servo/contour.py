"""Contour error of a move, and the measures of circular tests in ISO 230-4."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_BLOCK = 1 << 13
"""Points computed at once: they fit into the cache, and are too few for numpy's BLAS to share out among threads, so
that sums are the same on any number of processors."""
_ITERATIONS = 20
_CONVERGED_MM = 1e-10
_DEG_PER_TURN = 360.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Contour:
    """Measures of a circular test. "The part" is the stretch at constant speed: on a whole turn, that turn."""

    mean_contour_error_mm: float
    max_contour_error_mm: float
    """Mean and maximum of the absolute contour error: of a whole turn, or of the whole move [mm]."""
    radial_deviation_min_mm: float
    radial_deviation_max_mm: float
    """Smallest and largest contour error, signed, over the part: F_min and F_max [mm]."""
    circular_deviation_mm: float | None
    """Circular deviation G: largest minus smallest distance from the least-squares centre of a whole turn [mm]. None
    without a whole turn: the least-squares centre of an arc is not that of the circle."""
    centre_offset_mm: tuple[float, float]
    """Least-squares centre of the part, x and y [mm]."""
    radius_deviation_mm: float
    """Least-squares radius of the part minus the nominal radius [mm]."""


def contour_error(x_mm: Floats, *, y_mm: Floats, radius_mm: float) -> Floats:
    """Contour error of points about the centre of the circle, ``sqrt(x^2 + y^2) - r``: positive outside [mm].

    References
    ----------
    ISO 230-4, radial deviation F.

    Examples
    --------
    >>> contour_error(np.array([3.0, 0.0]), y_mm=np.array([4.0, 4.5]), radius_mm=5.0).tolist()
    [0.0, -0.5]
    """
    return _distance_mm(x_mm, y_mm) - radius_mm


def _distance_mm(x_mm: Floats, y_mm: Floats) -> Floats:
    # Five times faster than np.hypot and as exact: lengths are far from where squares overflow.
    return np.asarray(np.sqrt(x_mm * x_mm + y_mm * y_mm))


def measure_contour(
    x_mm: Floats, *, y_mm: Floats, radius_mm: float, part: slice, turn_share: float | None = None
) -> Contour:
    """Measure a move.

    Parameters
    ----------
    x_mm, y_mm
        Positions of the table about the centre of the nominal circle, in equal steps of time, shape (n,) each [mm].
    radius_mm
        Nominal radius [mm].
    part
        Points at constant speed, one or more; a slice with start and stop.
    turn_share
        None: the part is an arc, and mean and maximum are those of the whole move. A number: the part is exactly one
        turn, everything is measured on it, and its last step counts by this share [1].

    Returns
    -------
    Contour
        All measures.

    References
    ----------
    ISO 230-4: radial deviations F_max and F_min; circular deviation G, here about the least-squares centre.

    Examples
    --------
    A circle with a radius 2 um too large and a centre 1 um off:

    >>> angle = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    >>> x, y = 100.002 * np.cos(angle) + 0.001, 100.002 * np.sin(angle)
    >>> measures = measure_contour(x, y_mm=y, radius_mm=100.0, part=slice(0, 1000), turn_share=1.0)
    >>> round(measures.circular_deviation_mm, 9), round(measures.radius_deviation_mm, 9)
    (0.0, 0.002)
    >>> round(measures.radial_deviation_min_mm, 9), round(measures.radial_deviation_max_mm, 9)
    (0.001, 0.003)
    """
    whole = slice(0, len(x_mm)) if turn_share is None else part
    missing = 0.0 if turn_share is None else 1.0 - turn_share
    total, largest = 0.0, 0.0
    for block in blocks(whole):
        error = np.abs(contour_error(x_mm[block], y_mm=y_mm[block], radius_mm=radius_mm))
        total += float(error.sum())
        largest = max(largest, float(error.max()))
    total -= missing * float(error[-1])
    x_mm, y_mm = x_mm[part], y_mm[part]
    nominal = _Fit.about((0.0, 0.0), x_mm, y_mm, radius_mm, missing)
    fitted = nominal.best(x_mm, y_mm)
    return Contour(
        mean_contour_error_mm=total / (whole.stop - whole.start - missing),
        max_contour_error_mm=largest,
        radial_deviation_min_mm=nominal.lowest_mm,
        radial_deviation_max_mm=nominal.highest_mm,
        circular_deviation_mm=None if turn_share is None else fitted.highest_mm - fitted.lowest_mm,
        centre_offset_mm=fitted.best_centre_mm,
        radius_deviation_mm=fitted.deviation_mm,
    )


def covered_deg(x_mm: Floats, *, y_mm: Floats, part: slice | None = None) -> float:
    """Angle from the first to the last point about the centre, with whole turns; positive anticlockwise [deg].

    Notes
    -----
    Contour errors do not show it: a table that stands still on the circle has none.

    Examples
    --------
    >>> angle = np.linspace(0.0, -3.0 * np.pi, 1000)
    >>> round(covered_deg(np.cos(angle), y_mm=np.sin(angle)), 6)
    -540.0
    """
    if part is not None:
        x_mm, y_mm = x_mm[part], y_mm[part]

    def turns(points: Sequence[int] | NDArray[np.intp]) -> Floats:
        return np.asarray(np.arctan2(y_mm[points], x_mm[points]) / (2 * np.pi))

    # Angles jump by a turn at half the circle, and only between points on both sides of the x axis.
    before = np.flatnonzero(np.diff(np.signbit(y_mm)))
    jumps = np.rint(turns(before + 1) - turns(before))
    first, last = turns([0, -1])
    total = float(last - first - jumps.sum())
    return total * _DEG_PER_TURN


class _Fit(NamedTuple):
    """One pass over the points: their distances from a centre, and the least-squares circle as seen from there.

    Its Gauss-Newton steps are for the centre and the deviation of the radius. The equations contain only small
    differences from the nominal circle, so they resolve a nanometre on a metre; fits of x^2 + y^2 do not. If the
    solution is not unique (an axis that stands still), that of smallest norm is taken.

    References
    ----------
    A. B. Forbes, Least-squares best-fit geometric elements, NPL report DITC 140/89, 1989.
    """

    centre_mm: tuple[float, float]
    radius_mm: float
    missing: float
    """Share of the last point that does not count."""
    lowest_mm: float
    highest_mm: float
    """Smallest and largest distance from the centre, minus the nominal radius."""
    step_mm: tuple[float, float]
    """Step from this centre to the best centre, to first order."""
    deviation_mm: float
    """Radius of the best circle minus the nominal radius, to first order."""

    @classmethod
    def about(
        cls, centre_mm: tuple[float, float], x_mm: Floats, y_mm: Floats, radius_mm: float, missing: float
    ) -> "_Fit":
        lowest, highest = np.inf, -np.inf
        normal, right = np.zeros((3, 3)), np.zeros(3)
        for block in blocks(slice(0, len(x_mm))):
            x, y = x_mm[block] - centre_mm[0], y_mm[block] - centre_mm[1]
            distance = _distance_mm(x, y)
            error = distance - radius_mm
            lowest, highest = min(lowest, float(error.min())), max(highest, float(error.max()))
            np.maximum(distance, np.finfo(float).tiny, out=distance)
            directions = (np.divide(x, distance, out=x), np.divide(y, distance, out=y), np.ones_like(x))
            _add(normal, right, directions, error)
        last = [direction[-1:] for direction in directions]
        _add(normal, right, last, -missing * error[-1:], weight=-missing)
        a, b, deviation = np.linalg.lstsq(normal, right, rcond=None)[0].tolist()
        return cls(centre_mm, radius_mm, missing, lowest, highest, (a, b), deviation)

    @property
    def best_centre_mm(self) -> tuple[float, float]:
        """The best centre as seen from this centre."""
        return self.centre_mm[0] + self.step_mm[0], self.centre_mm[1] + self.step_mm[1]

    def best(self, x_mm: Floats, y_mm: Floats) -> "_Fit":
        """Step to the best centre."""
        fit = self
        for _ in range(_ITERATIONS):
            if max(map(abs, fit.step_mm)) <= _CONVERGED_MM:
                break
            fit = _Fit.about(fit.best_centre_mm, x_mm, y_mm, self.radius_mm, self.missing)
        return fit


def _add(normal: Floats, right: Floats, directions: Sequence[Floats], error: Floats, *, weight: float = 1.0) -> None:
    """Add points to the normal equations of the best circle."""
    for row, direction in enumerate(directions):
        right[row] += direction @ error
        for column in range(row, 3):
            normal[row, column] += weight * (direction @ directions[column])
            normal[column, row] = normal[row, column]


def blocks(part: slice) -> Iterator[slice]:
    """Split a part of the positions into blocks, to save memory.

    Examples
    --------
    >>> list(blocks(slice(10, 20)))
    [slice(10, 20, None)]
    """
    for start in range(part.start, part.stop, _BLOCK):
        yield slice(start, min(start + _BLOCK, part.stop))
