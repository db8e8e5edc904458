"""Fit the execution time to measurements: a table of medians, or a line through them."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from statistics import median
from typing import Final, Literal

from busplan.errors import BusplanError
from busplan.sections.execution import LinearExecution, TableExecution

ExecutionForm = Literal["table", "linear"]
Method = Literal["median", "Theil-Sen"]
Groups = Mapping[int, Sequence[float]]
"""T_exec of the measurements at each payload [us]."""

METHODS: Final[Mapping[ExecutionForm, Method]] = {"table": "median", "linear": "Theil-Sen"}
"""Fit method by form."""

_TIME_DECIMALS: Final = 3
_PER_BYTE_DECIMALS: Final = 6
"""Rounds by less than a nanosecond even at the largest payload."""


def fit_execution(
    groups: Groups, form: ExecutionForm, *, grade: Literal["measured", "derived"], source: str
) -> LinearExecution | TableExecution:
    """Fit an execution time to T_exec by payload, in whole nanoseconds.

    Parameters
    ----------
    groups
        T_exec of the measurements at each payload [us].
    form
        "table" or "linear".
    grade
        How the execution time is known.
    source
        Name of the measurements in messages.

    Raises
    ------
    BusplanError
        A line through one payload, or with a negative part.
    """
    if form == "table":
        times_us = {size: round(time_us, _TIME_DECIMALS) for size, time_us in medians(groups).items()}
        return TableExecution(
            kind="table", payload_bytes=tuple(times_us), time_us=tuple(times_us.values()), grade=grade
        )
    if len(groups) == 1:
        raise BusplanError(f"{source}: all payloads are {min(groups)} bytes: a line needs two, or use --form table")
    base_us, per_byte_us = theil_sen(groups)
    base_us, per_byte_us = round(base_us, _TIME_DECIMALS), round(per_byte_us, _PER_BYTE_DECIMALS)
    if base_us < 0 or per_byte_us < 0:
        line = f"{base_us:g} us + {per_byte_us:g} us/byte * payload"
        raise BusplanError(
            f"{source}: the line is {line}, and no part of an execution time is negative: use --form table"
        )
    return LinearExecution(kind="linear", base_us=base_us, per_byte_us=per_byte_us, grade=grade)


def medians(groups: Groups) -> dict[int, float]:
    """Median at each payload [us], by payload."""
    return {size: median(groups[size]) for size in sorted(groups)}


def theil_sen(groups: Groups) -> tuple[float, float]:
    """Base [us] and slope [us/byte] of the Theil-Sen line through the median at each payload.

    The slope is the median of the slopes between any two payloads, the base the median of the remainders.

    References
    ----------
    P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", JASA 63 (1968).

    Examples
    --------
    >>> theil_sen({4: [40.0], 8: [44.0], 12: [48.0, 48.0, 900.0], 16: [700.0], 20: [56.0]})
    (36.0, 1.0)
    """
    points = list(medians(groups).items())
    slope = median((y2 - y1) / (x2 - x1) for (x1, y1), (x2, y2) in combinations(points, 2))
    return median(y - slope * x for x, y in points), slope
