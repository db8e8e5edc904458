"""Values of the keys that vary in a grid, from text or from Python, checked."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from decimal import Decimal, localcontext
from itertools import islice
from math import isfinite
from typing import Final, TypeGuard

import numpy as np

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.english import listed
from busplan.errors import ArgumentError, BusplanError
from busplan.profile.changes import without_units
from busplan.profile.document import override
from busplan.profile.edit import whole
from busplan.profile.kinds import cycle_keys, dotted_keys, words_of
from busplan.questions.base.arguments import checked_model, items
from busplan.questions.fit.grid import Array, Grid
from busplan.questions.fit.network import changed, model_names
from busplan.sections.profile import CIRCLE_SECTIONS, Profile

_CHECKED_EACH: Final = 100
"""Up to this many values of a key are all checked; of more, the extremes: every valid range is an interval."""
MOST_POINTS: Final = 1_000_000
"""Most points of a sweep, fewer with many columns: a minute of work, and a gigabyte of text."""


def checked_grid(profile: Profile, axes: Mapping[str, Array], *, with_circle: bool) -> Grid:
    """A grid whose values are valid.

    Without `with_circle`, keys that only the circle test reads are refused. BusplanError: a key that is unknown, not a
    number, or without effect here; a value that the schema refuses; too many points.
    """
    require_keys(profile, axes, option="vary", circle_option=None if with_circle else "circle")
    samples = {key: _samples(axis) for key, axis in axes.items()}
    first: dict[str, object] = {key: values[0] for key, values in samples.items()}
    override(profile, first)
    for key, values in samples.items():
        for value in values[1:]:
            override(profile, {**first, key: value})
    # Constraints between keys show at the extremes. A word is neither least nor greatest, and tried with the greatest.
    parts = {key: _numbers_and_words(values) for key, values in samples.items()}
    override(profile, {key: min(numbers, default=samples[key][0]) for key, (numbers, _) in parts.items()})
    override(profile, {key: words[0] if words else max(numbers) for key, (numbers, words) in parts.items()})
    grid = Grid(dict(axes))
    if grid.points > MOST_POINTS:
        raise ArgumentError(f"vary: {grid.points:,} points are more than the {MOST_POINTS:,} a sweep takes; vary less")
    return grid


def require_keys(profile: Profile, keys: Iterable[str], *, option: str, circle_option: str | None) -> None:
    """Refuse keys that cannot vary, whatever their values.

    `option` and `circle_option` name options in messages; `circle_option` is None where circle tests are run.
    BusplanError: a key that is unknown, not a number, or without effect here.
    """
    read = cycle_keys(profile)
    for key in keys:
        of_groups = [f"group.{group.name}.{key.partition('.')[2]}" for group in profile.group]
        if key not in read and set(of_groups) <= {*read} and of_groups:
            raise ArgumentError(
                f"{option} {key}: each group of {profile.name} has its own; give {listed(of_groups, 'or')}"
            )
        _require_known(profile, key, name=f"{option} {key}")
        is_of_circle = key.partition(".")[0] in CIRCLE_SECTIONS
        if key not in read and not (is_of_circle and circle_option is None):
            more = f"; add {circle_option} to run circle tests" if is_of_circle else ""
            raise ArgumentError(f"{option} {key}: no figure of capacity depends on it{more}")


def grid_models(network: Network, grid: Grid, models: Sequence[str] | None) -> tuple[str, ...]:
    """Timing models of a sweep: those that can express every value of the grid.

    BusplanError: one of `models` cannot express a value.
    """
    variants = [changed(network, {key: value}) for key, axis in grid.axes.items() for value in _samples(axis)]
    if models is not None:
        for model in models:
            for variant in variants:
                checked_model(variant, model, name="timing_model")
        return tuple(models)
    return tuple(model for model in model_names(network) if all(model in model_names(variant) for variant in variants))


def _require_known(profile: Profile, key: str, *, name: str) -> None:
    """Refuse a key that does not exist, or that is a section or a list."""
    keys = dotted_keys(profile)
    if any(other.startswith(f"{key}.") for other in keys):
        raise ArgumentError(f"{name}: is a section; expected the key of one number")
    if key not in keys:
        try:
            override(profile, {key: 1}, origin={key: name})  # says what was meant
        except BusplanError as error:
            raise ArgumentError(*error.problems) from None
        raise ArgumentError(f"{name}: the profile has no table {key.rpartition('.')[0]}; add it first")
    if isinstance(keys[key].value, list | tuple):
        raise ArgumentError(f"{name}: is a list; expected the key of one number")


def _samples(axis: Array) -> list[Value]:
    """Values to check: all, or of many the extremes, the words and one fraction. Whole floats become ints."""
    values: list[Value] = axis.tolist()
    if len(values) > _CHECKED_EACH:
        numbers, words = _numbers_and_words(values)
        # A fraction among whole numbers may lie between the extremes.
        fractions = (number for number in numbers if number % 1)
        values = [values[0], min(numbers), max(numbers), *islice(fractions, 1), *words]
    return [*dict.fromkeys(map(whole, values))]


def _numbers_and_words(values: Iterable[Value]) -> tuple[list[int | float], list[str | bool]]:
    numbers, words = [], []
    for value in values:
        if isinstance(value, str | bool):
            words.append(value)
        else:
            numbers.append(value)
    return numbers, words


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

    `name` is that of the argument in messages. BusplanError: not a number or a word of the key, a repeated value, or a
    range that never reaches its end.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> axis_values(load("paper-4ms").profile, "cycle.period_us", "250:1000:*2", name="vary")
    array([ 250,  500, 1000])
    """
    words = words_of(profile, key)
    if isinstance(given, str):
        return _parsed(without_units(given, key=key), name=f"{name} {key}={given}", words=words)
    if isinstance(given, range) and given[MOST_POINTS:]:
        raise ArgumentError(f"{name} {key}: more values than the {MOST_POINTS:,} points a sweep takes; vary less")
    return _listed(items(given, name=f"{name} {key}"), name=f"{name} {key}", words=words)


def _parsed(text: str, *, name: str, words: Collection[str]) -> Array:
    """Values from text as on the command line: between commas, or a range."""
    if ":" in text:
        return _range(name, text)
    parts = map(str.strip, text.split(","))
    return _listed(
        (part if part in words else _plain(_number(name, part, words)) for part in parts), name=name, words=words
    )


def _listed(values: Iterable[object], *, name: str, words: Collection[str]) -> Array:
    """Single values: finite numbers, or words that the key takes. A whole float becomes an int."""
    unique: dict[int | float | str, None] = {}
    for given in values:
        value = _TRUTHS.get(given, given) if isinstance(given, str) and given in words else given
        if not _is_value(value, words):
            more = f" and none of {', '.join(words)}" if words else ""
            raise ArgumentError(f"{name}: {value!r} is not a finite number{more}")
        if value in unique:
            raise ArgumentError(f"{name}: {value} is given twice")
        unique[int(value) if isinstance(value, float) and _is_whole(value) else value] = None
    if not unique:
        raise ArgumentError(f"{name}: no values; give at least one")
    return _axis_of([*unique])


_TRUTHS: Final = {"true": True, "false": False}


def _is_value(value: object, words: Collection[str]) -> TypeGuard[int | float | str]:
    if isinstance(value, bool):
        return "true" in words
    if isinstance(value, float):
        return isfinite(value)
    return value in words if isinstance(value, str) else isinstance(value, int)


def _is_whole(number: float) -> bool:
    return number.is_integer() and abs(number) < _EXACT


def _axis_of(values: Sequence[Value]) -> Array:
    if any(isinstance(value, str | bool) for value in values):
        return np.array(values, dtype=object)
    # NumPy keeps whole numbers beyond 64 bits as objects.
    return np.array(values, dtype=float if any(isinstance(value, float) for value in values) else None)


def _range(name: str, text: str) -> Array:
    parts = [part.strip() for part in text.split(":")]
    if len(parts) not in {2, 3}:
        raise ArgumentError(f"{name}: {_FORMS}")
    first, last = (_number(name, part) for part in parts[:2])
    third = parts[2] if len(parts) > 2 else "1"  # noqa: PLR2004
    if third.startswith("*"):
        return _geometric(name, first, last, _number(name, third[1:]))
    if third.startswith("#"):
        return _even(name, first, last, third[1:].strip())
    step = _number(name, third)
    if step == 0 or (last - first) * step < 0:
        raise ArgumentError(f"{name}: steps of {third} never lead from {parts[0]} to {parts[1]}")
    with localcontext(prec=100):
        return _steps(name, first, step, int((last - first) // step) + 1)


def _steps(name: str, first: Decimal, step: Decimal, size: int) -> Array:
    if size == 1:
        return _axis_of([_plain(first)])
    decimals = max(0, *(-int(number.normalize().as_tuple().exponent) for number in (first, step)))
    start, stride = (int(number.scaleb(decimals)) for number in (first, step))
    if decimals > _MAX_DECIMALS or max(abs(start), abs(start + stride * size)) >= _EXACT:
        raise ArgumentError(f"{name}: more digits than a number here can hold; use A:B:#COUNT")
    whole = start + stride * _numbered(name, size)
    return whole / float(10**decimals) if decimals else whole


def _numbered(name: str, size: int) -> Array:
    """Whole numbers from 0, one for each value."""
    if size > MOST_POINTS:
        most = f"the {MOST_POINTS:,} points a sweep takes"
        raise ArgumentError(f"{name}: {size:,} values are more than {most}; vary less")
    return np.arange(size)


def _geometric(name: str, first: Decimal, last: Decimal, factor: Decimal) -> Array:
    if factor <= 0 or factor == 1 or first <= 0 or last <= 0 or (last - first) * (factor - 1) < 0:
        raise ArgumentError(f"{name}: multiplying by {factor} never leads from {first} to {last}")
    values: list[int | float] = []
    with localcontext(prec=50):
        while (last - first) * (factor - 1) >= 0:
            values.append(_plain(first))
            if len(values) > _MOST_LISTED:
                raise ArgumentError(f"{name}: more than {_MOST_LISTED:,} values; take a larger factor")
            first *= factor
    return _axis_of(values)


def _even(name: str, first: Decimal, last: Decimal, count: str) -> Array:
    if not re.fullmatch(r"[0-9]{1,12}", count) or int(count) < 2:  # noqa: PLR2004
        raise ArgumentError(f"{name}: expected a count of 2 or more after the #")
    if first == last:
        raise ArgumentError(f"{name}: {count} values from {first} to {last} are one")
    step = (last - first) / (int(count) - 1)
    if all(number == number.to_integral_value() for number in (first, step)):
        return _steps(name, first, step, int(count))
    share = _numbered(name, int(count)) / (int(count) - 1)
    return float(first) * (1 - share) + float(last) * share


def _number(name: str, part: str, words: Collection[str] = ()) -> Decimal:
    if not _NUMBER.fullmatch(part):
        more = f" and none of {', '.join(words)}" if words else ""
        raise ArgumentError(f"{name}: {part!r} is not a number{more}; {_FORMS}")
    return Decimal(part)


def _plain(number: Decimal) -> int | float:
    """A whole number as int, any other as the nearest float."""
    return int(number) if number == number.to_integral_value() else float(number)
