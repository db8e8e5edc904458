"""The circle with its error magnified, as in ballbar reports."""

from collections.abc import Iterator, Sequence
from math import cos, radians, sin
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line
from busplan.forms.svg import drawing, markup, text_at
from busplan.questions.circle.characters import contour_lines
from busplan.questions.circle.contour_profile import ContourProfile
from busplan.questions.circle.scale import ERROR_SHARE, Magnified, magnified
from busplan.servo.path import Direction

_WIDTH: Final = 470
HEIGHT: Final = 400
"""Height of the drawing where it is not scaled, in px."""
_NOMINAL: Final = 140
"""Drawn radius of the nominal circle."""
_ARROW: Final = 0.62
"""Radius of the arrow, as a multiple of the nominal one: no error is drawn there."""
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
        largest_mm = max((abs(one) for one in (*profile.low_mm, *profile.high_mm) if one is not None), default=0.0)
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
    for index in (one % size for one in range(first + 1, first + 1 + size)):
        if values[index] is not None:
            run.append(index)
        elif run:
            yield run
            run = []
    if run:
        yield run


def _point(error_mm: float | None, index: int, sectors: int, scale: Magnified) -> str:
    return _place(360 * (index + 0.5) / sectors, _NOMINAL * scale.radius(error_mm or 0.0))
