"""The circle with its error magnified, as in ballbar reports."""

from collections.abc import Iterator, Sequence
from math import ceil, cos, pi, sin
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from busplan.analysis.circle.contour_profile import ContourProfile
from busplan.drawings.circle_characters import contour_lines
from busplan.forms.blocks import Drawing
from busplan.forms.lines import Line
from busplan.forms.numbers import ROUNDING_UM
from busplan.forms.scale import ring_step
from busplan.forms.svg import drawing, markup, text_at

_WIDTH: Final = 470
_HEIGHT: Final = 400
_NOMINAL: Final = 140
"""Drawn radius of the nominal circle."""
ERROR_SHARE: Final = 0.25
"""Largest drawn error as a share of the drawn radius."""
_WIDEST: Final = 3.0
"""A tolerance is drawn up to this multiple of the largest error: a larger ring would flatten the error."""


class Magnified(NamedTuple):
    """Scale of a drawing."""

    largest_mm: float
    """Error at the edge: the largest error, or the tolerance if that is larger."""
    ring_um: float
    """Distance between rings."""
    tolerance_mm: float | None
    """Ring of the tolerance; None if there is none or it lies far outside."""

    def times(self, radius_mm: float) -> float:
        """Magnification of the error relative to the circle."""
        return ERROR_SHARE / self.largest_mm * radius_mm

    def radius(self, error_mm: float) -> float:
        """Drawn radius of an error."""
        return _NOMINAL * (1 + ERROR_SHARE * error_mm / self.largest_mm)


def magnified(profile: ContourProfile, *, tolerance_mm: float | None) -> Magnified | None:
    """Find the scale of a drawing; None if there is no error to show.

    Parameters
    ----------
    profile
        Contour error around the circle.
    tolerance_mm
        Largest contour error that is allowed, where there is a limit [mm].
    """
    largest_mm = max((abs(one) for one in (*profile.low_mm, *profile.high_mm) if one is not None), default=0.0)
    if largest_mm * 1e3 < ROUNDING_UM:
        return None
    drawn = tolerance_mm if tolerance_mm is not None and 0 < tolerance_mm <= _WIDEST * largest_mm else None
    edge_mm = max(largest_mm, drawn or 0.0)
    return Magnified(edge_mm, ring_step(edge_mm * 1e3), drawn)


class CircleDrawing(Drawing):
    """Nominal circle, rings, tolerance and the path with its error magnified; in characters, the error over the angle.

    Parameters
    ----------
    profile
        Contour error around the circle.
    tolerance_mm
        Largest contour error that is allowed, where there is a limit [mm].
    """

    shape = "round"

    def __init__(self, profile: ContourProfile, *, tolerance_mm: float | None) -> None:
        self._profile = profile
        self.scale = magnified(profile, tolerance_mm=tolerance_mm)

    def svg(self) -> str | None:
        """Draw the magnified circle; None if there is no error to show."""
        scale = self.scale
        if scale is None:
            return None
        root = drawing("Circle with its contour error magnified", css="chart circle")
        root.set("viewBox", f"{-_WIDTH // 2} {-_HEIGHT // 2} {_WIDTH} {_HEIGHT}")
        _cross(root)
        rings = ceil(scale.largest_mm * 1e3 / scale.ring_um)
        for ring in range(-rings, rings + 1):
            _ring(root, scale.radius(ring * scale.ring_um / 1e3), css="nominal" if ring == 0 else "ring")
        for error_mm in () if scale.tolerance_mm is None else (-scale.tolerance_mm, scale.tolerance_mm):
            _ring(root, scale.radius(error_mm), css="tolerance")
        SubElement(root, "path", {"class": "path", "d": "".join(_outlines(self._profile, scale))})
        text_at(root, f"{scale.ring_um:g} um", x="0", y=-6, css="centre", anchor="middle")
        text_at(root, "a ring", x="0", y=16, css="centre", anchor="middle")
        return markup(root)

    def characters(self, width: int) -> list[Line] | None:
        """Draw the error over the angle; None if there is no error to show."""
        return None if self.scale is None else contour_lines(self._profile, width=width)


def _cross(root: Element) -> None:
    """Draw the two axes with angles at their ends."""
    far = _NOMINAL * (1 + ERROR_SHARE) + 8
    for number, (x, y, anchor) in enumerate(((1, 0, "start"), (0, -1, "middle"), (-1, 0, "end"), (0, 1, "middle"))):
        line = {"x1": x * 40, "y1": y * 40, "x2": x * far, "y2": y * far}
        SubElement(root, "line", {**{key: f"{value:g}" for key, value in line.items()}, "class": "rule"})
        text_at(root, f"{90 * number}°", x=f"{x * (far + 4):g}", y=round(y * (far + 9)) + 5, anchor=anchor)


def _ring(root: Element, radius: float, *, css: str) -> None:
    SubElement(root, "circle", {"r": f"{radius:.1f}", "class": css})


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
    angle, radius = 2 * pi * (index + 0.5) / sectors, scale.radius(error_mm or 0.0)
    return f"{radius * cos(angle):.1f} {-radius * sin(angle):.1f}"
