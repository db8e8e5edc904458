"""The circle with its error magnified, as in ballbar reports; in characters, the error over the angle."""

from collections.abc import Iterator, Sequence
from math import ceil, cos, floor, log10, radians, sin
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line
from busplan.forms.numbers import ROUNDING_UM
from busplan.forms.scale import ring_step
from busplan.forms.svg import drawing, markup, text_at
from busplan.questions.circle.contour import ContourProfile
from busplan.servo.path import Direction

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


Number = TypeVar("Number", float, "NDArray[np.float64]")

ERROR_SHARE: Final = 0.25
"""Largest drawn error as a share of the drawn radius."""
_WIDEST: Final = 3.0
"""A tolerance is drawn up to this multiple of the largest error: a larger ring would flatten the error."""
_FLAT: Final = 0.1
"""Errors whose spread is a smaller share of the largest would look like one line above zero."""
_NANOMETRES_BELOW_UM: Final = 0.1


class LengthUnit(NamedTuple):
    """Unit that lengths are written in."""

    name: str
    per_um: float
    """How many of it are 1 um."""

    def text(self, length_um: float) -> str:
        """Write a round length with its unit."""
        return f"{length_um * self.per_um:g} {self.name}"


def length_unit(largest_um: float) -> LengthUnit:
    """Choose a unit in which a small length is no row of zeros.

    Examples
    --------
    >>> length_unit(19.0).text(5.0), length_unit(0.02).text(0.005)
    ('5 um', '5 nm')
    """
    return LengthUnit("um", 1.0) if largest_um >= _NANOMETRES_BELOW_UM else LengthUnit("nm", 1e3)


class Magnified(NamedTuple):
    """Scale of a circle with its error magnified."""

    largest_mm: float
    """Error at the edge: the largest error, or the tolerance if that is larger."""
    ring_um: float
    """Distance between rings."""
    tolerance_mm: float | None
    """Ring of the tolerance; None if there is none or it lies far outside."""

    def times(self, radius_mm: float) -> float:
        """Magnification of the error relative to the circle."""
        return ERROR_SHARE / self.largest_mm * radius_mm

    def radius(self, error_mm: Number) -> Number:
        """Drawn radius of an error, as a multiple of the drawn nominal radius."""
        return 1 + ERROR_SHARE / self.largest_mm * error_mm

    @property
    def unit(self) -> LengthUnit:
        """Unit of its errors."""
        return length_unit(self.largest_mm * 1e3)

    @property
    def ring_text(self) -> str:
        """Distance between rings with its unit."""
        return self.unit.text(self.ring_um)

    @property
    def rings_mm(self) -> tuple[float, ...]:
        """Errors at the rings, from the innermost to the outermost; the nominal circle is 0."""
        most = floor(self.largest_mm * 1e3 / self.ring_um + 1e-9)
        return tuple(ring * self.ring_um / 1e3 for ring in range(-most, most + 1))


def magnified(largest_mm: float, *, tolerance_mm: float | None) -> Magnified | None:
    """Find the scale of a circle; None if there is no error to show.

    Parameters
    ----------
    largest_mm
        Largest contour error, without its sign [mm].
    tolerance_mm
        Largest contour error that is allowed, where there is a limit [mm].

    Examples
    --------
    >>> magnified(0.019, tolerance_mm=0.025).rings_mm
    (-0.02, -0.01, 0.0, 0.01, 0.02)
    """
    if largest_mm * 1e3 < ROUNDING_UM:
        return None
    drawn = tolerance_mm if tolerance_mm is not None and 0 < tolerance_mm <= _WIDEST * largest_mm else None
    edge_mm = max(largest_mm, drawn or 0.0)
    return Magnified(edge_mm, ring_step(edge_mm * 1e3), drawn)


class ErrorRange(NamedTuple):
    """Range of a scale of errors."""

    bottom_um: float
    top_um: float

    @property
    def largest_um(self) -> float:
        """Its end that is further from zero, without its sign."""
        return max(abs(self.bottom_um), abs(self.top_um))

    @property
    def zero_outside(self) -> str:
        """Note that zero is not on the scale; empty if it is."""
        if self.bottom_um > 0:
            return "0 lies below"
        return "0 lies above" if self.top_um < 0 else ""


def error_range(low_um: float, high_um: float) -> ErrorRange:
    """Range from the smallest to the largest error and zero; without zero if the errors would look like one line.

    Parameters
    ----------
    low_um, high_um
        Smallest and largest error, signed [um].

    Examples
    --------
    >>> error_range(2.0, 19.0)
    ErrorRange(bottom_um=0.0, top_um=19.0)
    >>> error_range(502.456, 502.458)
    ErrorRange(bottom_um=502.456, top_um=502.458)
    """
    spread_um, largest_um = high_um - low_um, max(abs(low_um), abs(high_um))
    if low_um * high_um > 0 and ROUNDING_UM <= spread_um < _FLAT * largest_um:
        return ErrorRange(low_um, high_um)
    return ErrorRange(min(0.0, low_um), max(0.0, high_um))


_COLUMNS: Final = (72, 60, 48, 36, 24)
"""Possible widths of a plot: one column for 5, 6, 7.5, 10 or 15 degrees. The widest that fits is used."""
_ROWS: Final = 9


def contour_lines(profile: ContourProfile, *, width: int) -> list[Line]:
    """Draw the smallest and largest error of each part of the circle; at least one is more than rounding.

    Where every part has all of these errors there is nothing to see over the angle, and a line says so.

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
    columns = next((number for number in _COLUMNS if number <= room), _COLUMNS[-1])
    axis = "".join(f"{angle:<{columns // 4}}" for angle in (0, 90, 180, 270)).rstrip()
    rows = [*_rows(profile.condensed(sectors=columns), edges)]
    if all(set(cells) == {"#"} for cells in rows):
        bottom, top = (labels[row].rpartition(" ")[2] for row in (-1, 0))
        return [Line(f"At every angle the error is from {bottom} to {top} {unit.name}", "drawn")]
    return [
        Line(", ".join(filter(None, (f"{unit.name:>{gutter}}", scale.zero_outside))), "drawn"),
        *(Line(f"{text:>{gutter}} |{cells}".rstrip(), "drawn") for text, cells in zip(labels, rows, strict=True)),
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


_WIDTH: Final = 470
HEIGHT: Final = 400
"""Height of the drawing where it is not scaled, in px."""
_NOMINAL: Final = 140
"""Drawn radius of the nominal circle."""
_ARROW: Final = 0.62
"""Radius of the arrow, as a multiple of the nominal radius: no error is drawn there."""
_ARROW_DEG: Final = (20, 65)


class CircleDrawing(Drawing):
    """Nominal circle, rings, tolerance and the path with its error magnified; in characters, the error over the angle.

    Parameters
    ----------
    profile
        Contour error around the circle.
    tolerance_mm
        Largest contour error that is allowed, where there is a limit [mm].
    direction
        Direction of rotation; the circle starts on the positive x axis.
    """

    shape = "round"

    def __init__(self, profile: ContourProfile, *, tolerance_mm: float | None, direction: Direction) -> None:
        self._profile = profile
        self._direction = direction
        largest_mm = max(
            (abs(error) for error in (*profile.low_mm, *profile.high_mm) if error is not None), default=0.0
        )
        self.scale = magnified(largest_mm, tolerance_mm=tolerance_mm)

    def svg(self) -> str | None:
        """Draw the magnified circle; None if there is no error to show."""
        if self.scale is None:
            return None
        root = drawing("Circle with its contour error magnified", css="chart circle")
        self.draw(root, self.scale)
        return markup(root)

    def draw(self, root: Element, scale: Magnified) -> None:
        """Draw the magnified circle into an SVG, whose coordinates are set; several that are compared share a scale."""
        root.set("viewBox", f"{-_WIDTH // 2} {-HEIGHT // 2} {_WIDTH} {HEIGHT}")
        _cross(root)
        for error_mm in scale.rings_mm:
            _ring(root, scale.radius(error_mm), css="ring" if error_mm else "nominal")
        for error_mm in () if scale.tolerance_mm is None else (-scale.tolerance_mm, scale.tolerance_mm):
            _ring(root, scale.radius(error_mm), css="tolerance")
        SubElement(root, "path", {"class": "path", "d": "".join(_outlines(self._profile, scale))})
        SubElement(root, "path", {"class": "direction", "d": _arrow(self._direction)})
        SubElement(root, "circle", {"cx": f"{_NOMINAL}", "r": "4", "class": "point"})
        text_at(root, scale.ring_text, x="0", y=-6, css="centre", anchor="middle")
        text_at(root, "a ring", x="0", y=16, css="centre", anchor="middle")

    def characters(self, width: int) -> list[Line] | None:
        """Draw the error over the angle; None if there is no error to show."""
        return None if self.scale is None else contour_lines(self._profile, width=width)


def _cross(root: Element) -> None:
    """Draw the two axes with their names and with angles at their ends."""
    far = _NOMINAL * (1 + ERROR_SHARE) + 8
    ends = (("X 0°", 1, 0, "start"), ("Y 90°", 0, -1, "middle"), ("180°", -1, 0, "end"), ("270°", 0, 1, "middle"))
    for text, x, y, anchor in ends:
        line = {"x1": x * 40, "y1": y * 40, "x2": x * far, "y2": y * far}
        SubElement(root, "line", {**{key: f"{value:g}" for key, value in line.items()}, "class": "rule"})
        text_at(root, text, x=f"{x * (far + 4):g}", y=round(y * (far + 9)) + 5, anchor=anchor)


def _ring(root: Element, radius: float, *, css: str) -> None:
    SubElement(root, "circle", {"r": f"{_NOMINAL * radius:.1f}", "class": css})


def _arrow(direction: Direction) -> str:
    """An arc inside the circle with a head at its end."""
    start, end = _ARROW_DEG if direction == "ccw" else reversed(_ARROW_DEG)
    back, size = end + (start - end) / 5, _ARROW * _NOMINAL
    sweep = 0 if direction == "ccw" else 1
    arc = f"M{_place(start, size)}A{size:.1f} {size:.1f} 0 0 {sweep} {_place(end, size)}"
    return f"{arc}M{_place(back, size - 6)}L{_place(end, size)}L{_place(back, size + 6)}"


def _place(angle_deg: float, radius: float) -> str:
    """Coordinates; y points down in SVG."""
    return f"{radius * cos(radians(angle_deg)):.1f} {-radius * sin(radians(angle_deg)):.1f}"


def _outlines(profile: ContourProfile, scale: Magnified) -> Iterator[str]:
    """Outlines of the band between smallest and largest error, one for each part of the circle without a gap."""
    sectors = len(profile.low_mm)
    for run in _runs(profile.low_mm):
        out = [_point(profile.high_mm[index], index, sectors, scale) for index in run]
        back = [_point(profile.low_mm[index], index, sectors, scale) for index in run]
        if len(run) == sectors:
            yield f"M{'L'.join(out)}ZM{'L'.join(reversed(back))}Z"
        else:
            yield f"M{'L'.join((*out, *reversed(back)))}Z"


def _runs(values: Sequence[float | None]) -> Iterator[list[int]]:
    """Runs of neighbouring sectors that have a value; one run may wrap around the end."""
    size = len(values)
    first = next((index for index in range(size) if values[index] is None), -1)
    run: list[int] = []
    for index in (place % size for place in range(first + 1, first + 1 + size)):
        if values[index] is not None:
            run.append(index)
        elif run:
            yield run
            run = []
    if run:
        yield run


def _point(error_mm: float | None, index: int, sectors: int, scale: Magnified) -> str:
    return _place(360 * (index + 0.5) / sectors, _NOMINAL * scale.radius(error_mm or 0.0))
