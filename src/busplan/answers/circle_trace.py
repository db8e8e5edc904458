"""The simulated steps of a circle test, as rows of a CSV file."""

from collections.abc import Iterator
from typing import Final

from busplan.analysis.circle.roundness import CircleTest
from busplan.forms.blocks import Record

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
"""Rows that are turned into Python's numbers together."""


def trace_records(test: CircleTest, *, every: int) -> Iterator[Record]:
    """One row for every n-th step of each simulated period.

    Parameters
    ----------
    test
        The circle test.
    every
        One of how many steps is written [1].
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
            # Python's own floats take four times the memory of numpy's.
            block = [column[start : start + _BLOCK].tolist() for column in columns]
            for values in zip(*block, strict=True):
                yield dict(zip(TRACE_COLUMNS, (result.period_us, *values), strict=True))
