"""The circle with its error magnified, as in ballbar reports, its error over time, and the ranked error sources."""

from collections.abc import Sequence
from math import floor
from typing import Final, NamedTuple

import numpy as np

from busplan.forms import charts
from busplan.forms.lines import Tone
from busplan.forms.numbers import ROUNDING_UM, decimals_of, period
from busplan.forms.scale import ring_step
from busplan.questions.circle import CircleFigures, CircleTestAnswer
from busplan.questions.circle.shape import ContourProfile, ErrorPart, Floats, Shape
from busplan.sections.machine import ToleranceSection
from busplan.servo.circle import CircleRun
from busplan.servo.path import Direction

_ERROR_SHARE: Final = 0.25
"""Largest drawn error as a share of the drawn radius [1]."""
_WIDEST: Final = 3.0
"""Largest tolerance that is drawn, as a multiple of the largest error. A larger ring would flatten the error."""
_FLAT: Final = 0.1
"""Smallest spread of the errors, as a share of the largest, drawn with zero; less would look like one line."""
_NANOMETRES_BELOW_UM: Final = 0.1
TOLERANCE: Final = charts.Entry("tolerance", "tolerance of the largest error", shape="line")


class LengthUnit(NamedTuple):
    """A unit of written lengths."""

    name: str
    per_um: float
    """Number of units in 1 um."""

    def text(self, length_um: float) -> str:
        """A round length with its unit."""
        return f"{length_um * self.per_um:g} {self.name}"


def length_unit(largest_um: float) -> LengthUnit:
    """Unit in which a small length is not a row of zeros.

    Examples
    --------
    >>> length_unit(19.0).text(5.0), length_unit(0.02).text(0.005)
    ('5 um', '5 nm')
    """
    return LengthUnit("um", 1.0) if largest_um >= _NANOMETRES_BELOW_UM else LengthUnit("nm", 1e3)


class Magnified(NamedTuple):
    """Scale of a circle with its error magnified."""

    largest_mm: float
    """Error at the edge: the largest error, or the tolerance if that is larger [mm]."""
    ring_um: float
    """Distance between rings [um]."""
    tolerance_mm: float | None
    """Tolerance to draw as a ring [mm]; None without one, or for one far outside."""

    def magnification(self, radius_mm: float) -> float:
        """Magnification of the error against the circle [1]."""
        return _ERROR_SHARE / self.largest_mm * radius_mm

    def radius(self, error_mm: float) -> float:
        """Drawn radius of an error, as a multiple of the drawn nominal radius."""
        return 1 + _ERROR_SHARE / self.largest_mm * error_mm

    @property
    def unit(self) -> LengthUnit:
        """Unit of the errors."""
        return length_unit(self.largest_mm * 1e3)

    @property
    def ring_text(self) -> str:
        """Distance between rings with its unit."""
        return self.unit.text(self.ring_um)

    @property
    def rings_mm(self) -> tuple[float, ...]:
        """Errors at the rings, from the innermost to the outermost [mm]; the nominal circle is 0."""
        most = floor(self.largest_mm * 1e3 / self.ring_um + 1e-9)
        return tuple(ring * self.ring_um / 1e3 for ring in range(-most, most + 1))


def magnified(largest_mm: float, *, tolerance_mm: float | None) -> Magnified | None:
    """Scale of a circle, from its largest contour error without sign and its tolerance [mm]; None without an error.

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
        """Larger end of the range, without its sign [um]."""
        return max(abs(self.bottom_um), abs(self.top_um))

    @property
    def zero_outside(self) -> str:
        """Note that zero is outside of the scale; empty if it is inside."""
        if self.bottom_um > 0:
            return "zero is below the scale"
        return "zero is above the scale" if self.top_um < 0 else ""


def error_range(low_um: float, high_um: float) -> ErrorRange:
    """Range of errors from the smallest to the largest [um], with zero unless the errors would look like one line.

    Examples
    --------
    >>> error_range(2.0, 19.0)
    ErrorRange(bottom_um=0.0, top_um=19.0)
    >>> error_range(502.456, 502.458)
    ErrorRange(bottom_um=502.456, top_um=502.458)
    """
    errors = ErrorRange(low_um, high_um)
    if errors.zero_outside and ROUNDING_UM <= high_um - low_um < _FLAT * errors.largest_um:
        return errors
    return ErrorRange(min(0.0, low_um), max(0.0, high_um))


def dial(contour: ContourProfile, scale: Magnified, direction: Direction) -> charts.Dial:
    """Nominal circle, rings, tolerance, and the path with its error magnified, from the positive x axis on."""
    low, high = (
        tuple(None if error is None else scale.radius(error) for error in errors)
        for errors in (contour.low_mm, contour.high_mm)
    )
    rings = [(scale.radius(error), charts.Entry("ring")) for error in scale.rings_mm if error]
    rings.append((1.0, charts.Entry("nominal", "nominal circle", shape="line")))
    if scale.tolerance_mm is not None:
        rings += [(scale.radius(error), TOLERANCE) for error in (-scale.tolerance_mm, scale.tolerance_mm)]
    path = charts.Entry("first", "path with magnified error", shape="line")
    return charts.Dial(path, low, high, tuple(rings), (scale.ring_text, "per ring"), direction == "cw")


class _Row(NamedTuple):
    """One simulated period."""

    result: CircleFigures
    run: CircleRun
    shape: Shape


class _Scales(NamedTuple):
    """Scales and limits of all rows, so that they can be compared."""

    circle: Magnified | None
    """Scale of the circles; None without an error to show."""
    errors: ErrorRange
    unit: LengthUnit
    tolerance: ToleranceSection


def _common_scales(rows: Sequence[_Row], tolerance: ToleranceSection) -> _Scales:
    """Scales of all rows. A row whose table left the circle counts only if there is no other."""
    shown = [row for row in rows if not row.run.diverged] or rows
    measured = [part.error_um for row in shown for part in row.shape.parts if part.measured]
    # Mean and largest error of a trapezoid are those of the whole move.
    judged = measured
    if rows[0].result.path == "trapezoid":
        judged = [part.error_um for row in shown for part in row.shape.parts]
    radius_um = rows[0].result.radius_mm * 1e3
    low_um, high_um = (float(np.clip(end, -radius_um, radius_um)) for end in _ends(judged))
    largest_mm = min(max(map(abs, _ends(measured))), radius_um) / 1e3
    circle = magnified(largest_mm, tolerance_mm=tolerance.max_contour_error_mm)
    errors = error_range(low_um, high_um)
    if circle is not None and circle.tolerance_mm is not None and not errors.zero_outside:
        limit_um = circle.tolerance_mm * 1e3
        errors = ErrorRange(min(errors.bottom_um, -limit_um), max(errors.top_um, limit_um))
    return _Scales(circle, errors, length_unit(errors.largest_um), tolerance)


def _ends(errors: Sequence[Floats]) -> tuple[float, float]:
    return min(float(error_um.min()) for error_um in errors), max(float(error_um.max()) for error_um in errors)


_ROOM: Final = 0.08
"""Empty room above and below the errors, as a share of their range [1]."""
_TONES: Final[dict[bool | None, Tone]] = {True: "passes", False: "fails", None: "neutral"}
_DIRECTIONS: Final = {"ccw": "counter-clockwise", "cw": "clockwise"}


def circle_drawing(test: CircleTestAnswer) -> charts.Drawing:
    """Drawing of each simulated period, at least one, on the same scales, one below the other."""
    simulated = zip(test.results, test.runs, test.shapes, strict=True)
    rows = [_Row(result, run, shape) for result, run, shape in simulated if run is not None and shape is not None]
    scales = _common_scales(rows, test.profile.tolerance)
    servo = "ideal drive" if test.results[0].ideal_drive else f"servo values: {test.profile.servo.grades_text}"
    missing = [period(result.period_us) for result, run in zip(test.results, test.runs, strict=True) if run is None]
    words = [f"circle test, {servo}"]
    if missing:
        words.append(f"not drawn: the bus does not carry {', '.join(missing)}")
    panels = (
        panel for row in rows for panel in (_circle(row, scales), _errors(row, scales), _ranking(row, rows, scales))
    )
    description = f"Circle test of {test.profile.name}"
    return charts.Drawing(test.profile.name, tuple(panel for panel in panels if panel), tuple(words), description)


def _circle(row: _Row, scales: _Scales) -> charts.Panel:
    """Setup, verdict, and the circle on the scale of all periods."""
    result, scale = row.result, scales.circle
    setup = f"{period(result.period_us)}, {result.feed_mm_per_min:g} mm/min, r {result.radius_mm:g} mm"
    deviation = _measure_text(result.circular_deviation_mm, scales.tolerance.circular_deviation_mm, scales)
    whole = "G: not defined on a trapezoid" if result.path == "trapezoid" else f"G = {deviation}"
    words = f"{_shown(row, scales)}; {whole}; {_DIRECTIONS[row.run.path.direction]}"
    plot = None
    if scale is not None and row.shape.contour is not None:
        plot = dial(row.shape.contour, scale, row.run.path.direction)
    return charts.Panel(plot, f"{result.verdict_word}: {setup}", words, _TONES[result.passed])


def _shown(row: _Row, scales: _Scales) -> str:
    """Words on the circle's scale, or on the reason why it is not drawn."""
    if row.run.diverged:
        return f"circle not drawn: the {'table left the circle' if row.result.stable else 'loop is unstable'}"
    if scales.circle is None:
        return "no contour error"
    times = decimals_of(scales.circle.magnification(row.result.radius_mm), 0)
    return f"rings every {scales.circle.ring_text}; error magnified {times} times"


def _measure_text(value_mm: float | None, limit_mm: float | None, scales: _Scales) -> str:
    """A measure with its unit, and with its tolerance if it has one."""
    unit = scales.unit
    value = "-" if value_mm is None else f"{decimals_of(value_mm * 1e3 * unit.per_um, 3)} {unit.name}"
    return value if limit_mm is None else f"{value} (limit {unit.text(limit_mm * 1e3)})"


def _errors(row: _Row, scales: _Scales) -> charts.Panel:
    """Contour error over time, with mean and maximum above; the measured part is strong and shaded."""
    errors, per_um, tolerance = scales.errors, scales.unit.per_um, scales.tolerance
    result, limit_mm = row.result, tolerance.max_contour_error_mm
    mean = _measure_text(result.mean_contour_error_mm, tolerance.mean_contour_error_mm, scales)
    largest = _measure_text(result.max_contour_error_mm, limit_mm, scales)
    label = ", ".join(filter(None, (f"contour error [{scales.unit.name}]", errors.zero_outside)))
    up = charts.numbers(label, errors.bottom_um * per_um, errors.top_um * per_um, room=_ROOM)
    guides = [] if errors.zero_outside else [charts.Guide(charts.Entry("zero"), y=0.0)]
    limits = () if limit_mm is None else (-limit_mm * 1e3 * per_um, limit_mm * 1e3 * per_um)
    guides += [charts.Guide(TOLERANCE, y=limit) for limit in limits if up.low <= limit <= up.high]
    curves = tuple(_curve(part, up, row, per_um=per_um) for part in row.shape.parts)
    during = (
        charts.Shade(charts.Entry("during"), *part.time_s[[0, -1]].tolist())
        for part in row.shape.parts
        if part.measured
    )
    across = charts.numbers("time [s]", 0.0, float(row.shape.parts[-1].time_s[-1]))
    return charts.Panel(charts.Curves(across, up, curves, tuple(guides), tuple(during)), f"mean {mean}, max {largest}")


def _curve(part: ErrorPart, up: charts.Ruler, row: _Row, *, per_um: float) -> charts.Curve:
    """Error curve of a part of the move. Errors far off the scale are clipped: nothing draws huge numbers."""
    spread, is_turn = up.high - up.low, row.result.path != "trapezoid"
    errors = np.clip(part.error_um * per_um, up.low - spread, up.high + spread)
    if part.measured:
        entry = charts.Entry(
            "first", "measured: one whole turn" if is_turn else "measured: arc at constant speed", shape="line"
        )
    else:
        words = "not measured: lead-in and ramps" if is_turn else "not measured: ramps and settling"
        entry = charts.Entry("apart", words, shape="line")
    return charts.Curve(entry, tuple(zip(part.time_s.tolist(), errors.tolist(), strict=True)))


def _ranking(row: _Row, rows: Sequence[_Row], scales: _Scales) -> charts.Panel | None:
    """Shares of the error sources in the largest error, the largest first.

    Periods whose table followed the circle share one scale, all others a second.
    """
    if not row.result.contributions:
        return None
    unit = scales.unit
    on_scale = [drawn for drawn in rows if drawn.run.diverged == row.run.diverged]
    taken = [source.removed_mm * 1e3 * unit.per_um for drawn in on_scale for source in drawn.result.contributions or ()]
    lanes = []
    for source in row.result.contributions:
        value = source.removed_mm * 1e3 * unit.per_um
        bar = charts.Span(charts.Entry("takes" if value >= 0 else "hides"), min(value, 0.0), max(value, 0.0))
        note = f"{decimals_of(value, 3, signed=True)} {unit.name}"
        lanes.append(charts.Lane(source.source.replace("_", " "), (bar,), note, is_thin=True))
    low, high = min(0.0, *taken), max(0.0, *taken)
    scale = charts.numbers(unit.name, low, high if high > low else low + 1.0)
    title = "Increase of the largest error by each source"
    return charts.Panel(charts.Lanes(scale, tuple(lanes), (charts.Guide(charts.Entry("zero"), x=0.0),)), title)
