"""Contour data of a simulation, for drawings and files: the error around the circle, and every step."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from busplan.forms.blocks import Record
from busplan.questions.circle.figures import CircleTest
from busplan.servo.circle import CircleRun
from busplan.servo.contour import blocks, contour_error

CONTOUR_SECTORS: Final = 720
"""Sectors of the drawn circle: half a degree each, narrower than a printed line."""


class ContourProfile(NamedTuple):
    """Smallest and largest contour error in equal sectors from the x axis on [mm]; None in a sector without points."""

    low_mm: tuple[float | None, ...]
    high_mm: tuple[float | None, ...]


def contour_profile(run: CircleRun) -> ContourProfile:
    """Condense the measured part of a circle test.

    Parameters
    ----------
    run
        The simulation.

    Returns
    -------
    ContourProfile
        Sector 0 begins on the positive x axis; sectors follow counter-clockwise.
    """
    low, high = np.full(CONTOUR_SECTORS, np.inf), np.full(CONTOUR_SECTORS, -np.inf)
    for block in blocks(run.measured):
        x_mm, y_mm = run.x_mm[block], run.y_mm[block]
        error_mm = contour_error(x_mm, y_mm=y_mm, radius_mm=run.path.radius_mm)
        turn = np.arctan2(y_mm, x_mm) / (2 * np.pi) % 1.0
        sector = np.minimum((turn * CONTOUR_SECTORS).astype(np.int64), CONTOUR_SECTORS - 1)
        # Neighbouring points are mostly in the same sector: only the extremes of each stay are looked at one by one.
        entered = np.flatnonzero(np.diff(sector, prepend=-1))
        np.minimum.at(low, sector[entered], np.minimum.reduceat(error_mm, entered))
        np.maximum.at(high, sector[entered], np.maximum.reduceat(error_mm, entered))
    return ContourProfile(
        tuple(float(value) if np.isfinite(value) else None for value in low),
        tuple(float(value) if np.isfinite(value) else None for value in high),
    )


def drawn_profile(run: CircleRun | None) -> ContourProfile | None:
    """Condense a circle test for drawing; None if the table did not follow the circle or was not simulated.

    Parameters
    ----------
    run
        The simulation.
    """
    return None if run is None or run.diverged else contour_profile(run)


TRACE_COLUMNS: Final = (
    "period_us",
    "time_us",
    "command_x_mm",
    "command_y_mm",
    "x_mm",
    "y_mm",
    "contour_error_mm",
)

_BLOCK: Final = 4096
"""Rows converted to Python numbers at a time."""


def trace_records(test: CircleTest, *, every: int) -> Iterator[Record]:
    """One row for every n-th step of each simulated period.

    Parameters
    ----------
    test
        The circle test.
    every
        n, 1 or more [1].
    """
    for result, run in zip(test.results, test.runs, strict=True):
        if run is None:
            continue
        trace = run.trace(every=every)
        columns = (
            trace.time_us,
            trace.command_x_mm,
            trace.command_y_mm,
            trace.x_mm,
            trace.y_mm,
            trace.contour_error_mm,
        )
        for start in range(0, len(trace.time_us), _BLOCK):
            # Python floats take four times the memory of numpy floats.
            block = [column[start : start + _BLOCK].tolist() for column in columns]
            for values in zip(*block, strict=True):
                yield dict(zip(TRACE_COLUMNS, (result.period_us, *values), strict=True))
