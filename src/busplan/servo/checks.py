"""Declare parameters with their ranges, and check values."""

import math
from collections.abc import Callable, Iterator
from dataclasses import field, fields
from typing import Any, NamedTuple, TypeVar, get_args

from busplan.errors import BusplanError

LARGEST = 1e9
"""A larger gain, length or time is a typing error; products of allowed values do not overflow."""
SHORTEST_STEP_US = 1e-3

_MULTIPLE_TOLERANCE = 1e-9
"""Periods such as 1000 / 3 us are not exact floats; a relative 1e-9 is a microsecond in a quarter of an hour."""
_ROUNDING = 1e-12
_NANOSECONDS = 3
"""Decimals of a time in us."""
_MOST_STEPS_MORE = 100
"""Further numbers of steps in a period that are tried for a round step. Chosen."""
_KNOWN = "known"
_Value = TypeVar("_Value")


class Refused(NamedTuple):
    """One value that cannot be simulated."""

    name: str
    """Name of the parameter for the user."""
    value: object
    """Value as the message shows it."""
    right: str
    """Value or range that would be right."""
    beside: tuple[str, ...] = ()
    """Other parameters that it is refused for, which may be the ones that a user gave."""

    @property
    def message(self) -> str:
        """Message with name, value and what would be right."""
        return f"{self.name} = {self.value}: {self.right}"


class ParameterError(BusplanError):
    """Parameters that cannot be simulated.

    Parameters
    ----------
    *refused
        At least one.
    """

    def __init__(self, *refused: Refused) -> None:
        super().__init__(*(problem.message for problem in refused))
        self.refused = refused

    def __reduce__(self) -> tuple[Callable[..., "ParameterError"], tuple[Refused, ...]]:
        """Pickle with all arguments; by default, an exception is pickled with its message only."""
        return ParameterError, self.refused


def refuse(*refused: Refused) -> None:
    """Raise a single error for all refused values; without any, do nothing.

    Parameters
    ----------
    *refused
        Each value that cannot be simulated.

    Raises
    ------
    ParameterError
        There is at least one.

    Examples
    --------
    >>> refuse()
    >>> refuse(Refused("radius_mm", 0, "must be above 0"))
    Traceback (most recent call last):
    ...
    busplan.servo.checks.ParameterError: radius_mm = 0: must be above 0
    """
    if refused:
        raise ParameterError(*refused)


class Known(NamedTuple):
    """Metadata of a parameter."""

    description: str
    """Description that ends in the unit in brackets."""
    example: object
    least: float | None
    """Smallest value; None for a word, whose type lists the allowed ones."""
    most: float | None
    never: tuple[int, str] | None
    """A value between `least` and `most` that is not allowed, and what would be right."""


class Parameter(NamedTuple):
    """One parameter of a dataclass."""

    name: str
    type: object
    default: object
    known: Known


def parameter(
    default: _Value,
    description: str,
    *,
    example: object,
    least: float | None = None,
    most: float | None = None,
    never: tuple[int, str] | None = None,
) -> _Value:
    """Declare a parameter: a field of a dataclass with its default and metadata."""
    known = Known(description, example, least, most, never)
    return field(default=default, metadata={_KNOWN: known})


def parameters(of: Any) -> Iterator[Parameter]:
    """Yield every parameter of a dataclass, in the order of its fields.

    Parameters
    ----------
    of
        The dataclass, or an instance of it.
    """
    for key in fields(of):
        if _KNOWN in key.metadata:
            yield Parameter(key.name, key.type, key.default, key.metadata[_KNOWN])


def out_of_range(values: Any) -> Iterator[Refused]:
    """Yield every parameter of a dataclass whose value is not allowed.

    Parameters
    ----------
    values
        An instance; its fields are declared by `parameter`.

    Yields
    ------
    Refused
        Each value that is not allowed.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Encoder:
    ...     lines: int = parameter(1000, "Lines of the disc [1]", example=500, least=1, most=100_000)
    >>> [problem.message for problem in out_of_range(Encoder(lines=0))]
    ['lines = 0: must be between 1 and 100000']
    """
    for name, type_, _, known in parameters(values):
        value = getattr(values, name)
        if known.least is None or known.most is None:
            yield from not_one_of(*get_args(type_), **{name: value})
        elif not known.least <= value <= known.most:
            yield Refused(name, value, f"must be between {known.least:g} and {known.most:g}")
        elif known.never is not None and value == known.never[0]:
            yield Refused(name, value, known.never[1])


def not_positive(**values: float) -> Iterator[Refused]:
    """Yield every value that is not above zero.

    Parameters
    ----------
    **values
        Values by the user's name of the parameter.

    Examples
    --------
    >>> [problem.message for problem in not_positive(radius_mm=0)]
    ['radius_mm = 0: must be above 0 and at most 1e+09']
    """
    for name, value in values.items():
        if not 0 < value <= LARGEST:
            yield Refused(name, value, f"must be above 0 and at most {LARGEST:g}")


def negative(**values: float) -> Iterator[Refused]:
    """Yield every value below zero; see `not_positive`.

    Examples
    --------
    >>> [problem.message for problem in negative(drive_lag_us=-1, backlash_mm=0)]
    ['drive_lag_us = -1: must be between 0 and 1e+09']
    """
    for name, value in values.items():
        if not 0 <= value <= LARGEST:
            yield Refused(name, value, f"must be between 0 and {LARGEST:g}")


def not_one_of(*allowed: str, **values: str) -> Iterator[Refused]:
    """Yield every word that is not among the allowed ones.

    Examples
    --------
    >>> [problem.message for problem in not_one_of("ccw", "cw", direction="left")]
    ["direction = 'left': must be one of 'ccw', 'cw'"]
    """
    for name, value in values.items():
        if value not in allowed:
            yield Refused(name, repr(value), f"must be one of {', '.join(map(repr, allowed))}")


def no_multiple(*, period_us: float, step_us: float) -> Iterator[Refused]:
    """Yield the step if the period is not a multiple of it.

    Parameters
    ----------
    period_us, step_us
        Communication period and simulation step, both above 0 [us].

    Yields
    ------
    Refused
        The problem, with a step that fits.

    Examples
    --------
    >>> [problem.message for problem in no_multiple(period_us=1000, step_us=300)]
    ['step_us = 300: the period of 1000 us is no multiple of it; 250 us would fit']
    >>> [problem.message for problem in no_multiple(period_us=1000, step_us=2000)]
    ['step_us = 2000: longer than the period of 1000 us; the period is the longest step that fits']
    """
    if is_multiple(period_us, step_us):
        return
    if step_us > period_us:
        right = f"longer than the period of {period_us:g} us; the period is the longest step that fits"
    else:
        fits_us = dividing_step_us(period_us, most_us=step_us)
        right = f"the period of {period_us:g} us is no multiple of it; {fits_us:.15g} us would fit"
    yield Refused("step_us", step_us, right, ("period_us",))


def is_multiple(period_us: Any, step_us: Any) -> Any:
    """Whether a period is a whole number of steps, of one at least; of numbers or of arrays.

    Examples
    --------
    >>> is_multiple(1000.0, 250.0), is_multiple(1000.0, 300.0), is_multiple(1000.0, 2000.0)
    (True, False, False)
    """
    steps = period_us / step_us
    nearest = (steps + 0.5) // 1
    return (nearest > 0) & (abs(steps - nearest) <= _MULTIPLE_TOLERANCE * steps)


def dividing_step_us(period_us: float, *, most_us: float) -> float:
    """The longest step up to a given step that divides a period, in whole nanoseconds where such a step is near [us].

    Parameters
    ----------
    period_us
        The period [us].
    most_us
        The longest step allowed [us].

    Examples
    --------
    >>> [dividing_step_us(period_us, most_us=100.0) for period_us in (1000.0, 250.0, 50.0, 1000 / 3)]
    [100.0, 62.5, 50.0, 83.33333333333333]
    """
    fewest = math.ceil(period_us / most_us * (1 - _MULTIPLE_TOLERANCE))
    for steps in range(fewest, min(2 * fewest, fewest + _MOST_STEPS_MORE) + 1):
        step_us = round(period_us / steps, _NANOSECONDS)
        if math.isclose(step_us * steps, period_us, rel_tol=_ROUNDING):
            return step_us
    return period_us / fewest
