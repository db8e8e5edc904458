"""`--vary KEY=SPEC`: what a key of the profile goes through."""

import re
from decimal import Decimal, localcontext
from typing import TYPE_CHECKING, Final

from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.analysis.grid import Values

_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][+-]?[0-9]{1,2})?")
_FORMS: Final = (
    "expected values between commas (250,500,1000), a range A:B in steps of 1 (1:62), A:B:STEP (0.1:0.9:0.1), "
    "A:B:*FACTOR (125:8000:*2) or A:B:#COUNT (100:4000:#40)"
)
_EXACT: Final = 2**53
"""Whole numbers up to this are exact as floats."""
_MAX_DECIMALS: Final = 22
"""Powers of ten up to this are exact as floats."""
_MOST_LISTED: Final = 10_000
_WORDS: Final = ("optimal",)


def parse_axes(texts: list[str]) -> dict[str, "Values"]:
    """Read every --vary, in their order.

    Raises
    ------
    BusplanError
        None of them, a key twice, or no values that make sense.
    """
    if not texts:
        raise BusplanError("--vary: nothing to vary; give a key of the profile and its values, as bus.nodes=1:62")
    axes: dict[str, Values] = {}
    for text in texts:
        key, equals, spec = (part.strip() for part in text.partition("="))
        if not equals or not key or not spec:
            raise BusplanError(f"--vary {text}: expected KEY=VALUES, as bus.nodes=1:62 or cycle.period_us=250,500,1000")
        if key in axes:
            raise BusplanError(f"--vary {text}: {key} is varied already; give all its values at once")
        axes[key] = _values(text, spec)
    return axes


def _values(text: str, spec: str) -> "Values":
    from busplan.analysis.grid import Listed

    if ":" in spec:
        return _range(text, spec)
    values = tuple(part if part in _WORDS else _plain(_number(text, part)) for part in map(str.strip, spec.split(",")))
    if len(set(values)) < len(values):
        twice = next(value for index, value in enumerate(values) if value in values[:index])
        raise BusplanError(f"--vary {text}: {twice} is there twice")
    return Listed(values)


def _range(text: str, spec: str) -> "Values":
    parts = [part.strip() for part in spec.split(":")]
    if len(parts) not in {2, 3}:
        raise BusplanError(f"--vary {text}: {_FORMS}")
    first, last = (_number(text, part) for part in parts[:2])
    third = parts[2] if len(parts) > 2 else "1"  # noqa: PLR2004
    if third.startswith("*"):
        return _geometric(text, first, last, _number(text, third[1:]))
    if third.startswith("#"):
        return _even(text, first, last, third[1:].strip())
    step = _number(text, third)
    if step == 0 or (last - first) * step < 0:
        raise BusplanError(f"--vary {text}: steps of {third} never lead from {parts[0]} to {parts[1]}")
    with localcontext(prec=100):
        return _steps(text, first, step, int((last - first) // step) + 1)


def _steps(text: str, first: Decimal, step: Decimal, size: int) -> "Values":
    from busplan.analysis.grid import Steps

    decimals = max(0, *(-int(one.normalize().as_tuple().exponent) for one in (first, step)))
    start, stride = (int(one.scaleb(decimals)) for one in (first, step))
    if decimals > _MAX_DECIMALS or max(abs(start), abs(start + stride * size)) >= _EXACT:
        raise BusplanError(f"--vary {text}: more digits than a number here can hold; use A:B:#COUNT")
    return Steps(start, stride, 10**decimals, size)


def _geometric(text: str, first: Decimal, last: Decimal, factor: Decimal) -> "Values":
    from busplan.analysis.grid import Listed

    if factor <= 0 or factor == 1 or first <= 0 or last <= 0 or (last - first) * (factor - 1) < 0:
        raise BusplanError(f"--vary {text}: multiplying by {factor} never leads from {first} to {last}")
    values: list[int | float] = []
    with localcontext(prec=50):
        while (last - first) * (factor - 1) >= 0:
            values.append(_plain(first))
            if len(values) > _MOST_LISTED:
                raise BusplanError(f"--vary {text}: more than {_MOST_LISTED:,} values; take a larger factor")
            first *= factor
    return Listed(tuple(values))


def _even(text: str, first: Decimal, last: Decimal, count: str) -> "Values":
    from busplan.analysis.grid import Even

    if not re.fullmatch(r"[0-9]{1,12}", count) or int(count) < 2:  # noqa: PLR2004
        raise BusplanError(f"--vary {text}: expected a count of 2 or more behind the #")
    if first == last:
        raise BusplanError(f"--vary {text}: {count} values from {first} to {last} are one")
    step = (last - first) / (int(count) - 1)
    if all(one == one.to_integral_value() for one in (first, step)):
        return _steps(text, first, step, int(count))
    return Even(float(first), float(last), int(count))


def _number(text: str, part: str) -> Decimal:
    if not _NUMBER.fullmatch(part):
        raise BusplanError(f"--vary {text}: {part!r} is no number; {_FORMS}")
    return Decimal(part)


def _plain(number: Decimal) -> int | float:
    """A whole number as one, so that it may stand for a count; any other as the nearest float."""
    return int(number) if number == number.to_integral_value() and abs(number) < 2**63 else float(number)
