"""Contour error around the circle, condensed for drawing."""

from typing import NamedTuple

import numpy as np

from busplan.servo.circle import CircleRun
from busplan.servo.contour import blocks, contour_error


class ContourProfile(NamedTuple):
    """Smallest and largest contour error in each of equal sectors from the x axis on, in mm; None where none fell."""

    low_mm: tuple[float | None, ...]
    high_mm: tuple[float | None, ...]


def contour_profile(run: CircleRun, *, sectors: int) -> ContourProfile:
    """Condense the part at constant speed of a circle test.

    Parameters
    ----------
    run
        The simulation.
    sectors
        Number of equal sectors [1].

    Returns
    -------
    ContourProfile
        Sector 0 begins on the positive x axis; sectors follow counter-clockwise.
    """
    low, high = np.full(sectors, np.inf), np.full(sectors, -np.inf)
    for block in blocks(run.constant_speed):
        x_mm, y_mm = run.x_mm[block], run.y_mm[block]
        error_mm = contour_error(x_mm, y_mm=y_mm, radius_mm=run.path.radius_mm)
        turn = np.arctan2(y_mm, x_mm) / (2 * np.pi) % 1.0
        sector = np.minimum((turn * sectors).astype(np.int64), sectors - 1)
        np.minimum.at(low, sector, error_mm)
        np.maximum.at(high, sector, error_mm)
    return ContourProfile(
        tuple(float(value) if np.isfinite(value) else None for value in low),
        tuple(float(value) if np.isfinite(value) else None for value in high),
    )
