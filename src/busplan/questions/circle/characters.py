"""The contour error over the angle, in ASCII characters."""

from collections.abc import Iterator
from math import ceil, log10
from typing import Final

from busplan.forms.lines import Line
from busplan.questions.circle.contour_profile import ContourProfile
from busplan.questions.circle.scale import ErrorRange, error_range, length_unit

_COLUMNS: Final = (72, 60, 48, 36, 24)
"""Possible widths of a plot: one column for 5, 6, 7.5, 10 or 15 degrees. The widest that fits is used."""
_ROWS: Final = 9


def contour_lines(profile: ContourProfile, *, width: int) -> list[Line]:
    """Draw the smallest and largest error of each part of the circle, of which one at least is no rounding.

    Parameters
    ----------
    profile
        Contour error around the circle; its number of sectors is a multiple of each of `_COLUMNS`.
    width
        Columns of the whole drawing.
    """
    low_mm = min(value for value in profile.low_mm if value is not None)
    high_mm = max(value for value in profile.high_mm if value is not None)
    scale = error_range(low_mm * 1e3, high_mm * 1e3)
    unit = length_unit(scale.largest_um)
    edges = _edges(scale)
    labels = _labels(edges, per_um=unit.per_um)
    gutter = max(len(text) for text in (*labels, unit.name, "deg"))
    room = width - gutter - len(" |")
    columns = next((one for one in _COLUMNS if one <= room), _COLUMNS[-1])
    axis = "".join(f"{angle:<{columns // 4}}" for angle in (0, 90, 180, 270)).rstrip()
    rows = zip(labels, _rows(profile.condensed(sectors=columns), edges), strict=True)
    return [
        Line(", ".join(filter(None, (f"{unit.name:>{gutter}}", scale.zero_outside))), "drawn"),
        *(Line(f"{text:>{gutter}} |{cells}".rstrip(), "drawn") for text, cells in rows),
        Line(f"{'deg':>{gutter}}  {axis}", "drawn"),
    ]


def _edges(scale: ErrorRange) -> list[float]:
    """Edges of the rows [um], from top to bottom; the ends are those of the scale, without rounding."""
    height_um = (scale.top_um - scale.bottom_um) / _ROWS
    return [*(scale.top_um - number * height_um for number in range(_ROWS)), scale.bottom_um]


def _labels(edges: list[float], *, per_um: float) -> list[str]:
    """Label of each row: both ends of the scale, with digits that tell them apart, and zero."""
    top, bottom = edges[0] * per_um, edges[-1] * per_um
    # A tenth of the scale, or finer.
    decimals = max(1, ceil(1 - log10(top - bottom)))
    ends = {0: _number(top, decimals), _ROWS - 1: _number(bottom, decimals)}
    labels = []
    for number in range(_ROWS):
        zero = ("0",) if _holds_zero(edges, number) else ()
        end = (ends[number],) if number in ends else ()
        labels.append(", ".join(dict.fromkeys((*zero, *end))))
    return labels


def _number(value: float, decimals: int) -> str:
    """Write a number with its sign; 0 if nothing is left of it."""
    text = f"{value:+.{decimals}f}"
    return text if float(text) else "0"


def _rows(profile: ContourProfile, edges: list[float]) -> Iterator[str]:
    """Cells of each row, from top to bottom."""
    for number in range(_ROWS):
        upper, lower = edges[number], edges[number + 1]
        empty = "-" if _holds_zero(edges, number) else " "
        yield "".join(
            "#" if low is not None and high is not None and low * 1e3 <= upper and high * 1e3 >= lower else empty
            for low, high in zip(profile.low_mm, profile.high_mm, strict=True)
        )


def _holds_zero(edges: list[float], number: int) -> bool:
    upper, lower = edges[number], edges[number + 1]
    return lower <= 0.0 < upper or (number == 0 and upper == 0.0)
