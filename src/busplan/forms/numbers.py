"""Write figures: digits and unit."""

from collections.abc import Sequence
from math import isnan
from typing import Final

from busplan.buses.figure import unit_of
from busplan.forms.blocks import ShownValue

MISSING: Final = "-"
_DIGITS: Final = 12
"""Most digits of a number; further ones are float rounding."""
_FACTORS: Final = {("", "%"): 100.0, ("mm", "um"): 1e3, ("us", "ms"): 1e-3, ("us", "s"): 1e-6, ("us", "us/byte"): 1.0}
"""Factor from the unit of a key to the unit it is written in; the key `per_byte_us` is in us/byte."""
_MILLISECOND_US: Final = 1e3
_SECOND_US: Final = 1e6
SILENT_UNITS: Final = frozenset(("", "1", "nodes", "axes"))
"""Units that a sentence does not repeat behind a figure: a noun names them."""
ROUNDING_UM: Final = 1e-6
"""Lengths below a picometre, in um, are float rounding."""


def figure_text(value: ShownValue) -> str:
    """Write a figure without its unit.

    Examples
    --------
    >>> figure_text(ShownValue(0.0036, "max_contour_error_mm", "um", 3))
    '3.600'
    >>> [figure_text(ShownValue(one)) for one in (None, True, 16.0, ("time", "nodes"))]
    ['-', 'yes', '16', 'time, nodes']
    >>> figure_text(ShownValue([2.38808777, 4000.0], digits=4)), figure_text(ShownValue(-4e-16, decimals=3, fixed=True))
    ('2.388, 4000', '0.000')
    >>> figure_text(ShownValue(1234567)), figure_text(ShownValue(1234567, grouped=True))
    ('1234567', '1,234,567')
    """
    match value.value:
        case None:
            return MISSING
        case bool():
            return "yes" if value.value else "no"
        case int() | float():
            return _number(value)
        case list() | tuple():
            return ", ".join(figure_text(value._replace(value=one)) for one in value.value) or MISSING
    return str(value.value)


def with_unit(value: ShownValue) -> str:
    """Write a figure with its unit, as in a sentence.

    Examples
    --------
    >>> with_unit(ShownValue(3.9691, "margin_us", "us", 3)), with_unit(ShownValue(0.5, "utilisation", "%", 1))
    ('3.969 us', '50.0%')
    """
    return f"{figure_text(value)}{unit_text(value)}"


def unit_text(value: ShownValue) -> str:
    """Unit behind a figure in a sentence, with its space."""
    if value.unit in SILENT_UNITS or figure_text(value) == MISSING:
        return ""
    return "%" if value.unit == "%" else f" {value.unit}"


def decimals_of(number: float, decimals: int, *, signed: bool = False) -> str:
    """Write a number with fixed decimals; one too small for them is written with three digits.

    Examples
    --------
    >>> decimals_of(205.91747, 3), decimals_of(0.0, 3), decimals_of(0.00012, 3), decimals_of(2.5, 1, signed=True)
    ('205.917', '0.000', '0.00012', '+2.5')
    """
    sign = "+" if signed and number > 0 else ""
    if number == 0 or abs(number) >= 10.0**-decimals:
        return f"{sign}{number:.{decimals}f}"
    return f"{sign}{number:.3g}"


def period_value(period_us: float) -> ShownValue:
    """A communication period in s, ms or us, by its size.

    Examples
    --------
    >>> [with_unit(period_value(one)) for one in (4000.0, 250.0, 1234.5, 2e6)]
    ['4 ms', '250 us', '1.2345 ms', '2 s']
    """
    unit = "s" if period_us >= _SECOND_US else "ms" if period_us >= _MILLISECOND_US else "us"
    return ShownValue(period_us, "period_us", unit)


def period(period_us: float) -> str:
    """Write a communication period in s, ms or us, by its size."""
    return with_unit(period_value(period_us))


def plural(number: int, noun: str) -> str:
    """Write a count with its noun.

    Examples
    --------
    >>> plural(1, "node"), plural(2, "node"), plural(8, "axis")
    ('1 node', '2 nodes', '8 axes')
    """
    return f"{number} {nouns(number, noun)}"


def nouns(number: int, noun: str) -> str:
    """Singular or plural of a noun, by its count.

    Examples
    --------
    >>> nouns(1, "axis"), nouns(2, "axis")
    ('axis', 'axes')
    """
    if number == 1:
        return noun
    return f"{noun.removesuffix('is')}es" if noun.endswith("is") else f"{noun}s"


def listed(words: Sequence[str], last: str) -> str:
    """Write a list in words.

    Examples
    --------
    >>> listed(("speed", "slice ratio", "period"), "or")
    'speed, slice ratio or period'
    """
    *before, end = words
    return f"{', '.join(before)} {last} {end}" if before else end


def factor_of(value: ShownValue) -> float:
    """Factor to the unit a value is written in; KeyError for an unknown pair. A key without a unit has that unit."""
    own = unit_of(value.key)
    if own == value.unit or not value.unit or (not own and value.unit != "%"):
        return 1.0
    return _FACTORS[own, value.unit]


def _number(value: ShownValue) -> str:
    factor = factor_of(value)
    number = value.value if factor == 1.0 else value.value * factor
    if isnan(number):
        return MISSING
    if value.unit == "um" and abs(number) < ROUNDING_UM:
        number = 0.0
    if value.decimals is not None:
        # Adding 0.0 turns -0.0 into 0.0.
        number = round(number, value.decimals) + 0.0 if value.fixed else number
        return decimals_of(number, value.decimals, signed=value.signed)
    sign, comma = "+" if value.signed and number > 0 else "", "," if value.grouped else ""
    return f"{number:{sign}{comma}.{value.digits or _DIGITS}g}"
