"""What a number must be, and what is said when it is not."""

import math
from collections.abc import Iterator

from busplan.errors import BusplanError

LARGEST = 1e9
"""Beyond this a gain, a length or a time is a slip of the keyboard; products of them stay far from overflow."""

_MULTIPLE_TOLERANCE = 1e-9
"""Periods such as 1000 / 3 us are no exact floats; a relative 1e-9 is a microsecond in a quarter of an hour."""


def refuse(*problems: str) -> None:
    """Raise all problems together; no problem, no exception.

    Parameters
    ----------
    *problems
        One complete message each.

    Raises
    ------
    BusplanError
        There is at least one problem.

    Examples
    --------
    >>> refuse()
    >>> refuse("radius_mm = 0: must be above 0")
    Traceback (most recent call last):
    ...
    busplan.errors.BusplanError: radius_mm = 0: must be above 0
    """
    if problems:
        raise BusplanError(*problems)


def not_finite(**values: float) -> Iterator[str]:
    """Yield a problem for every value that is no usable number.

    Parameters
    ----------
    **values
        Name and value, the name as the user knows it.

    Yields
    ------
    str
        What is wrong with which value, and what would be right.

    Examples
    --------
    >>> list(not_finite(skew_us=float("nan"), jitter_us=1.0))
    ['skew_us = nan: must be a number between -1e+09 and 1e+09']
    """
    for name, value in values.items():
        if not abs(value) <= LARGEST:
            yield f"{name} = {value}: must be a number between {-LARGEST:g} and {LARGEST:g}"


def not_positive(**values: float) -> Iterator[str]:
    """Yield a problem for every value that is not above zero; see `not_finite`.

    Examples
    --------
    >>> list(not_positive(radius_mm=0))
    ['radius_mm = 0: must be above 0 and at most 1e+09']
    """
    for name, value in values.items():
        if not 0 < value <= LARGEST:
            yield f"{name} = {value}: must be above 0 and at most {LARGEST:g}"


def negative(**values: float) -> Iterator[str]:
    """Yield a problem for every value below zero; see `not_finite`.

    Examples
    --------
    >>> list(negative(drive_lag_us=-1, backlash_mm=0))
    ['drive_lag_us = -1: must be between 0 and 1e+09']
    """
    for name, value in values.items():
        if not 0 <= value <= LARGEST:
            yield f"{name} = {value}: must be between 0 and {LARGEST:g}"


def not_one_of(*allowed: str, **values: str) -> Iterator[str]:
    """Yield a problem for every word that is not among the allowed ones.

    Examples
    --------
    >>> list(not_one_of("ccw", "cw", direction="left"))
    ["direction = 'left': must be one of 'ccw', 'cw'"]
    """
    for name, value in values.items():
        if value not in allowed:
            yield f"{name} = {value!r}: must be one of {', '.join(map(repr, allowed))}"


def no_multiple(*, period_us: float, step_us: float) -> Iterator[str]:
    """Yield the problem of a period that is no whole number of steps.

    Parameters
    ----------
    period_us, step_us
        Communication period and simulation step, both above 0 [us].

    Yields
    ------
    str
        What is wrong, with the nearest steps that fit.

    Examples
    --------
    >>> list(no_multiple(period_us=1000, step_us=300))
    ['step_us = 300: the period of 1000 us is no multiple of it; 333.333 or 250 us would fit']
    >>> list(no_multiple(period_us=1000, step_us=2000))
    ['step_us = 2000: longer than the period of 1000 us; the period is the longest step that fits']
    """
    steps = period_us / step_us
    if round(steps) == 0 or steps < 1 - _MULTIPLE_TOLERANCE:
        yield (
            f"step_us = {step_us}: longer than the period of {period_us:g} us; the period is the longest step that fits"
        )
    elif abs(steps - round(steps)) > _MULTIPLE_TOLERANCE * steps:
        longer, shorter = period_us / math.floor(steps), period_us / math.ceil(steps)
        yield (
            f"step_us = {step_us}: the period of {period_us:g} us is no multiple of it; "
            f"{longer:.6g} or {shorter:.6g} us would fit"
        )
