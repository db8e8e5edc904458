"""The circle with its error magnified, as in ballbar reports."""

from math import floor
from typing import Final, NamedTuple

from busplan.forms.charts import Dial, Drawing, Entry, Panel
from busplan.forms.numbers import ROUNDING_UM
from busplan.forms.scale import ring_step
from busplan.questions.circle.contour import ContourProfile
from busplan.servo.path import Direction

_ERROR_SHARE: Final = 0.25
"""Largest drawn error as a share of the drawn radius."""
_WIDEST: Final = 3.0
"""A tolerance is drawn up to this multiple of the largest error: a larger ring would flatten the error."""
_FLAT: Final = 0.1
"""Errors whose spread is a smaller share of the largest would look like one line above zero."""
_NANOMETRES_BELOW_UM: Final = 0.1
TOLERANCE: Final = Entry("tolerance", "tolerance of the largest error", shape="line")


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
        return _ERROR_SHARE / self.largest_mm * radius_mm

    def radius(self, error_mm: float) -> float:
        """Drawn radius of an error, as a multiple of the drawn nominal radius."""
        return 1 + _ERROR_SHARE / self.largest_mm * error_mm

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


def largest_mm(contour: ContourProfile) -> float:
    """Largest contour error around the circle, without its sign [mm]."""
    return max((abs(error) for error in (*contour.low_mm, *contour.high_mm) if error is not None), default=0.0)


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


def dial(contour: ContourProfile, scale: Magnified, direction: Direction) -> Dial:
    """Draw the nominal circle, the rings, the tolerance and the path with its error magnified.

    Parameters
    ----------
    contour
        Contour error around the circle.
    scale
        How much it is magnified.
    direction
        Direction of rotation; the circle starts on the positive x axis.
    """
    low, high = (
        tuple(None if error is None else scale.radius(error) for error in errors)
        for errors in (contour.low_mm, contour.high_mm)
    )
    rings = [(scale.radius(error), Entry("ring")) for error in scale.rings_mm if error]
    rings.append((1.0, Entry("nominal", "nominal circle", shape="line")))
    if scale.tolerance_mm is not None:
        rings += [(scale.radius(error), TOLERANCE) for error in (-scale.tolerance_mm, scale.tolerance_mm)]
    return Dial(Entry("first"), low, high, tuple(rings), (scale.ring_text, "a ring"), direction == "cw")


def circle_drawing(contour: ContourProfile, scale: Magnified, direction: Direction) -> Drawing:
    """Draw the circle alone; parameters as `dial` has them."""
    return Drawing("Circle with its contour error magnified", (Panel(dial(contour, scale, direction)),))
