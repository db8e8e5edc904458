"""The contour error over the angle, in ASCII characters."""

from collections.abc import Iterator
from typing import Final

from busplan.analysis.circle.contour_profile import ContourProfile
from busplan.forms.lines import Line
from busplan.forms.numbers import ROUNDING_UM

_COLUMNS: Final = (72, 60, 48, 36, 24)
"""Possible widths of a plot: one column for 5, 6, 7.5, 10 or 15 degrees. The widest that fits is used."""
_ROWS: Final = 9

_ONE_DIGIT_UM: Final = 0.05
"""Larger errors are written with one decimal."""


def contour_lines(profile: ContourProfile, *, width: int) -> list[Line]:
    """Draw the smallest and largest error of each part of the circle.

    Parameters
    ----------
    profile
        Contour error around the circle; its number of sectors is a multiple of each of `_COLUMNS`.
    width
        Columns of the whole drawing.
    """
    bottom = min((0.0, *(value for value in profile.low_mm if value is not None)))
    top = max((0.0, *(value for value in profile.high_mm if value is not None)))
    ends = _label(top), _label(bottom)
    gutter = max(len(text) for text in (*ends, "deg"))
    room = width - gutter - len(" |")
    columns = next((one for one in _COLUMNS if one <= room), _COLUMNS[-1])
    axis = "".join(f"{angle:<{columns // 4}}" for angle in (0, 90, 180, 270)).rstrip()
    return [
        Line(f"{'um':>{gutter}}", "drawn"),
        *(
            Line(f"{text:>{gutter}} |{cells}".rstrip(), "drawn")
            for text, cells in _rows(profile.condensed(sectors=columns), bottom, top, ends)
        ),
        Line(f"{'deg':>{gutter}}  {axis}", "drawn"),
    ]


def _rows(profile: ContourProfile, bottom: float, top: float, ends: tuple[str, str]) -> Iterator[tuple[str, str]]:
    """Label and cells of each row, from top to bottom."""
    height = (top - bottom) / _ROWS
    labels = {0: ends[0], _ROWS - 1: ends[1]}
    for number in range(_ROWS):
        upper = top - number * height
        lower = upper - height
        zero = lower <= 0.0 < upper or (upper == 0.0 == top and number == 0)
        cells = (
            _cell(low, high, lower=lower, upper=upper, zero=zero)
            for low, high in zip(profile.low_mm, profile.high_mm, strict=True)
        )
        yield labels.get(number, "0" if zero else ""), "".join(cells)


def _cell(low: float | None, high: float | None, *, lower: float, upper: float, zero: bool) -> str:
    if low is not None and high is not None and low <= upper and high >= lower:
        return "#"
    return "-" if zero else " "


def _label(value_mm: float) -> str:
    """Label of an end of the scale, with enough digits to differ from 0."""
    value_um = value_mm * 1e3
    if abs(value_um) < ROUNDING_UM:
        return "0"
    return f"{value_um:+.1f}" if abs(value_um) >= _ONE_DIGIT_UM else f"{value_um:+.1g}"
