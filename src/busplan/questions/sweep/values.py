"""Values of a key in a sweep: from the text of an option, or from single values."""

import re
from collections.abc import Collection, Iterable
from decimal import Decimal, localcontext
from math import isfinite
from typing import Final, TypeGuard

import numpy as np

from busplan.errors import BusplanError
from busplan.profile.kinds import words_of
from busplan.questions.base.inputs import items
from busplan.questions.sweep.grid import MOST_POINTS, Array, axis_of
from busplan.sections.profile import Profile

_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][+-]?[0-9]{1,2})?")
_FORMS: Final = (
    "expected values between commas (250,500,1000), a range A:B in steps of 1 (1:62), A:B:STEP (0.1:0.9:0.1), "
    "A:B:*FACTOR (125:8000:*2) or A:B:#COUNT (100:4000:#40)"
)
_EXACT: Final = 2**53
"""Whole numbers below this are exact as floats."""
_MAX_DECIMALS: Final = 22
"""Powers of ten up to this are exact as floats."""
_MOST_LISTED: Final = 10_000


def axis_values(profile: Profile, key: str, given: str | Iterable[object], *, name: str) -> Array:
    """Values of a key as an array: from text as on the command line, a range, or several values.

    Parameters
    ----------
    profile
        The network.
    key
        Dotted key.
    given
        The values.
    name
        Name of the argument in messages.

    Raises
    ------
    BusplanError
        Not values of the key.
    """
    words = words_of(profile, key)
    if isinstance(given, str):
        return parse_values(given, name=f"{name} {key}={given}", words=words)
    if isinstance(given, range) and given[MOST_POINTS:]:
        raise BusplanError(f"{name} {key}: more values than the {MOST_POINTS:,} points a sweep takes; vary less")
    return listed(items(given, name=f"{name} {key}"), name=f"{name} {key}", words=words)


def parse_values(text: str, *, name: str, words: Collection[str] = ()) -> Array:
    """Parse the text of some values.

    Parameters
    ----------
    text
        Values between commas, a range A:B in steps of 1, A:B:STEP, A:B:*FACTOR or A:B:#COUNT.
    name
        Name of the values in messages.
    words
        Words allowed instead of a number.

    Raises
    ------
    BusplanError
        Not a number, a repeated value, or a range that never reaches its end.

    Examples
    --------
    >>> parse_values("250:1000:*2", name="vary")
    array([ 250,  500, 1000])
    """
    if ":" in text:
        return _range(name, text)
    parts = map(str.strip, text.split(","))
    return listed(
        (part if part in words else _plain(_number(name, part, words)) for part in parts), name=name, words=words
    )


def listed(values: Iterable[object], *, name: str, words: Collection[str] = ()) -> Array:
    """Make an axis from single values.

    Parameters
    ----------
    values
        Finite numbers or words. A whole float becomes an int.
    name
        Name of the values in messages.
    words
        Words allowed among the values; true and false stand for truths.

    Raises
    ------
    BusplanError
        No values, one that is not allowed, or a repeated one.
    """
    unique: dict[int | float | str, None] = {}
    for given in values:
        value = _TRUTHS.get(given, given) if isinstance(given, str) and given in words else given
        if not _is_value(value, words):
            known = f" and none of {', '.join(words)}" if words else ""
            raise BusplanError(f"{name}: {value!r} is not a finite number{known}")
        if value in unique:
            raise BusplanError(f"{name}: {value} is given twice")
        unique[int(value) if isinstance(value, float) and _is_whole(value) else value] = None
    if not unique:
        raise BusplanError(f"{name}: no values; give at least one")
    return axis_of([*unique])


_TRUTHS: Final = {"true": True, "false": False}


def _is_value(value: object, words: Collection[str]) -> TypeGuard[int | float | str]:
    if isinstance(value, bool):
        return "true" in words
    if isinstance(value, float):
        return isfinite(value)
    return value in words if isinstance(value, str) else isinstance(value, int)


def _is_whole(number: float) -> bool:
    return number.is_integer() and abs(number) < _EXACT


def _range(name: str, text: str) -> Array:
    parts = [part.strip() for part in text.split(":")]
    if len(parts) not in {2, 3}:
        raise BusplanError(f"{name}: {_FORMS}")
    first, last = (_number(name, part) for part in parts[:2])
    third = parts[2] if len(parts) > 2 else "1"  # noqa: PLR2004
    if third.startswith("*"):
        return _geometric(name, first, last, _number(name, third[1:]))
    if third.startswith("#"):
        return _even(name, first, last, third[1:].strip())
    step = _number(name, third)
    if step == 0 or (last - first) * step < 0:
        raise BusplanError(f"{name}: steps of {third} never lead from {parts[0]} to {parts[1]}")
    with localcontext(prec=100):
        return _steps(name, first, step, int((last - first) // step) + 1)


def _steps(name: str, first: Decimal, step: Decimal, size: int) -> Array:
    if size == 1:
        return axis_of([_plain(first)])
    decimals = max(0, *(-int(number.normalize().as_tuple().exponent) for number in (first, step)))
    start, stride = (int(number.scaleb(decimals)) for number in (first, step))
    if decimals > _MAX_DECIMALS or max(abs(start), abs(start + stride * size)) >= _EXACT:
        raise BusplanError(f"{name}: more digits than a number here can hold; use A:B:#COUNT")
    whole = start + stride * _numbered(name, size)
    return whole / float(10**decimals) if decimals else whole


def _numbered(name: str, size: int) -> Array:
    """Whole numbers from 0, one for each value."""
    if size > MOST_POINTS:
        raise BusplanError(f"{name}: {size:,} values are more than the {MOST_POINTS:,} points a sweep takes; vary less")
    return np.arange(size)


def _geometric(name: str, first: Decimal, last: Decimal, factor: Decimal) -> Array:
    if factor <= 0 or factor == 1 or first <= 0 or last <= 0 or (last - first) * (factor - 1) < 0:
        raise BusplanError(f"{name}: multiplying by {factor} never leads from {first} to {last}")
    values: list[int | float] = []
    with localcontext(prec=50):
        while (last - first) * (factor - 1) >= 0:
            values.append(_plain(first))
            if len(values) > _MOST_LISTED:
                raise BusplanError(f"{name}: more than {_MOST_LISTED:,} values; take a larger factor")
            first *= factor
    return axis_of(values)


def _even(name: str, first: Decimal, last: Decimal, count: str) -> Array:
    if not re.fullmatch(r"[0-9]{1,12}", count) or int(count) < 2:  # noqa: PLR2004
        raise BusplanError(f"{name}: expected a count of 2 or more after the #")
    if first == last:
        raise BusplanError(f"{name}: {count} values from {first} to {last} are one")
    step = (last - first) / (int(count) - 1)
    if all(number == number.to_integral_value() for number in (first, step)):
        return _steps(name, first, step, int(count))
    share = _numbered(name, int(count)) / (int(count) - 1)
    return float(first) * (1 - share) + float(last) * share


def _number(name: str, part: str, words: Collection[str] = ()) -> Decimal:
    if not _NUMBER.fullmatch(part):
        known = f" and none of {', '.join(words)}" if words else ""
        raise BusplanError(f"{name}: {part!r} is not a number{known}; {_FORMS}")
    return Decimal(part)


def _plain(number: Decimal) -> int | float:
    """A whole number as int, any other as the nearest float."""
    return int(number) if number == number.to_integral_value() else float(number)
