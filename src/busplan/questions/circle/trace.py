"""Simulated steps of a circle test, as rows of a CSV file."""

from collections.abc import Iterator
from typing import Final

from busplan.forms.blocks import Record
from busplan.questions.circle.record import CircleTest

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
