"""The circle test as one SVG: the magnified circle, the error over time, and the ranked error sources."""

from collections.abc import Sequence
from math import ceil
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from busplan.forms.bars import ROW, SignedBar, draw_bars, draw_zero
from busplan.forms.numbers import decimals_of, period
from busplan.forms.picture import styled
from busplan.forms.plot_area import MARGIN_PERCENT, PlotArea, draw_plot_area, numbers
from busplan.forms.svg import LINE, Scale, drawing, inside, markup, paragraph, text_at
from busplan.questions.circle.contour import contour_profile
from busplan.questions.circle.drawing import (
    HEIGHT,
    CircleDrawing,
    ErrorRange,
    LengthUnit,
    Magnified,
    error_range,
    length_unit,
    magnified,
)
from busplan.questions.circle.figures import CircleFigures, CircleTest
from busplan.sections.machine import ToleranceSection
from busplan.servo.circle import CircleRun
from busplan.servo.contour import contour_error

Floats = NDArray[np.float64]

_MAX_POINTS: Final = 2000
"""Most points of one curve: more would not be visible."""


class Curve(NamedTuple):
    """A part of the move. Of many points, the smallest and the largest error of each stretch are kept."""

    time_s: Floats
    error_um: Floats
    measured: bool


class CircleRow(NamedTuple):
    """One simulated period."""

    result: CircleFigures
    run: CircleRun
    curves: tuple[Curve, ...]

    @property
    def judged(self) -> tuple[Curve, ...]:
        """Curves that mean and largest error are taken from: the whole move on a trapezoid."""
        return tuple(curve for curve in self.curves if curve.measured or self.result.path == "trapezoid")


class Scales(NamedTuple):
    """Scales and limits that all rows share, so that they compare."""

    circle: Magnified | None
    """None if there is no error to show."""
    errors: ErrorRange
    unit: LengthUnit
    tolerance: ToleranceSection


def circle_rows(test: CircleTest) -> list[CircleRow]:
    """Rows of the periods that were simulated.

    Parameters
    ----------
    test
        The circle test.
    """
    pairs = zip(test.results, test.runs, strict=True)
    return [CircleRow(result, run, _curves(run)) for result, run in pairs if run is not None]


def common_scales(rows: Sequence[CircleRow], tolerance: ToleranceSection) -> Scales:
    """Scales of all rows. A row whose table left the circle counts only if there is no other.

    Parameters
    ----------
    rows
        The rows, one or more.
    tolerance
        Limits of the circle.
    """
    shown = [row for row in rows if not row.run.diverged] or rows
    measured = [curve.error_um for row in shown for curve in row.curves if curve.measured]
    judged = [curve.error_um for row in shown for curve in row.judged]
    radius_um = rows[0].result.radius_mm * 1e3
    low_um, high_um = (float(np.clip(end, -radius_um, radius_um)) for end in _ends(judged))
    largest_mm = min(max(map(abs, _ends(measured))), radius_um) / 1e3
    circle = magnified(largest_mm, tolerance_mm=tolerance.max_contour_error_mm)
    errors = error_range(low_um, high_um)
    if circle is not None and circle.tolerance_mm is not None and not errors.zero_outside:
        limit_um = circle.tolerance_mm * 1e3
        errors = ErrorRange(min(errors.bottom_um, -limit_um), max(errors.top_um, limit_um))
    return Scales(circle, errors, length_unit(errors.largest_um), tolerance)


def _ends(errors: Sequence[Floats]) -> tuple[float, float]:
    return min(float(error_um.min()) for error_um in errors), max(float(error_um.max()) for error_um in errors)


def _curves(run: CircleRun) -> tuple[Curve, ...]:
    """The measured part, and what lies before and after it; neighbours share a point."""
    error_um = contour_error(run.x_mm, y_mm=run.y_mm, radius_mm=run.path.radius_mm) * 1e3
    start, stop = run.measured.start, min(run.measured.stop, run.steps)
    parts = ((0, start + 1, False), (start, stop, True), (stop - 1, run.steps, False))
    curves = []
    for first, end, measured in parts:
        kept = first + extremes(error_um[first:end], most=_MAX_POINTS)
        time_s = (kept + 1).astype(np.float64) * (run.timing.step_us / 1e6)
        curves.append(Curve(time_s, error_um[kept], measured))
    return tuple(curves)


def extremes(values: Floats, *, most: int) -> NDArray[np.int64]:
    """Choose points that keep the outline of a curve: of each stretch the smallest and the largest.

    Parameters
    ----------
    values
        The curve, shape (n,).
    most
        About how many points are chosen; a shorter curve keeps all [1].

    Returns
    -------
    ndarray
        Indices in ascending order, the first and the last one among them.

    Examples
    --------
    >>> extremes(np.array([0.0, 1.0, 9.0, 2.0, 3.0, -7.0, 4.0, 5.0]), most=4).tolist()
    [0, 2, 5, 7]
    """
    if len(values) <= most:
        return np.arange(len(values))
    width = ceil(2 * len(values) / most)
    whole = len(values) // width
    stretches = values[: whole * width].reshape(whole, width)
    first = np.arange(whole) * width
    rest = whole * width + extremes(values[whole * width :], most=width)
    ends = np.array([0, len(values) - 1])
    return np.unique(np.concatenate((first + stretches.argmin(axis=1), first + stretches.argmax(axis=1), rest, ends)))


_ERRORS: Final = 220
"""Height of the error over time, in px."""
_GAP: Final = 16
_ROOM: Final = 0.08
"""Empty room above and below the errors, as a share of their range."""
_LETTER: Final = 9
"""Width of a bold letter, about, in px."""
_STYLE: Final = """\
.chart .measured { stroke: var(--model-first); stroke-width: 1.4; }
.chart .apart { stroke: var(--model-first); stroke-width: 1; stroke-opacity: .45; }
.chart .during { fill: var(--model-first); fill-opacity: .08; }
.chart .frame { fill: none; stroke: var(--plain); stroke-width: 1.4; stroke-dasharray: 4 3; }
.chart .frame.passes { stroke: var(--good); stroke-dasharray: none; }
.chart .frame.fails { fill: var(--bad); stroke: var(--bad); stroke-dasharray: none; }
.chart .verdict { font-weight: 700; fill: var(--plain); }
.chart .verdict.passes { fill: var(--good); }
.chart .verdict.fails { fill: var(--paper); }
"""
_VERDICTS: Final = {True: "passes", False: "fails", None: ""}
"""Class of the frame of each verdict: an outline, a filled box, a dashed outline."""
_DIRECTIONS: Final = {"ccw": "counter-clockwise", "cw": "clockwise"}


def circle_svg(test: CircleTest, *, note: str = "") -> str:
    """Draw each simulated period on the same scales, one below the other.

    It fills the width of its container, from 320 px on.

    Parameters
    ----------
    test
        The circle test, with at least one simulated period.
    note
        Title, beside the profile's name.
    """
    rows = circle_rows(test)
    scales = common_scales(rows, test.profile.tolerance)
    root = drawing(f"Circle test of {test.profile.name}", css="chart circle-test")
    body = inside(root, x_percent=MARGIN_PERCENT, width_percent=100 - 2 * MARGIN_PERCENT, y=0)
    y = _title(body, test, note)
    for row in rows:
        y = _circle(body, row, scales, y=_head(body, row, scales, y=y + 2 * _GAP))
        y = _errors(body, row, scales, y=y + _GAP)
        y = _ranking(body, row, rows, scales, y=y)
    root.set("height", str(_legend(body, rows, y=y + _GAP) + _GAP))
    return styled(markup(root), css=_STYLE)


def _title(body: Element, test: CircleTest, note: str) -> int:
    """Name, note, grade of the servo values, and the periods that are not drawn."""
    servo = "ideal drive" if test.results[0].ideal_drive else f"servo values: {test.profile.servo.grades_text}"
    missing = [period(result.period_us) for result, run in zip(test.results, test.runs, strict=True) if run is None]
    without = f"not drawn, for the bus does not carry it: {', '.join(missing)}" if missing else ""
    y = paragraph(body, test.profile.name, y=8, css="head")
    for line in filter(None, (note, f"circle test, {servo}", without)):
        y = paragraph(body, line, y=y, css="small")
    return y


def _head(body: Element, row: CircleRow, scales: Scales, *, y: int) -> int:
    """Write the setup, the verdict in a frame of its own, and what the circle shows."""
    result = row.result
    setup = f"{period(result.period_us)}, {result.feed_mm_per_min:g} mm/min, r {result.radius_mm:g} mm"
    y = paragraph(body, setup, y=y, css="head") + 4
    word, css = result.verdict_word, _VERDICTS[result.passed]
    frame = {"x": "1", "y": str(y), "width": str(_LETTER * len(word) + 16), "height": str(LINE)}
    SubElement(body, "rect", {**frame, "class": f"frame {css}".rstrip()})
    text_at(body, word, x=str(9 + _LETTER * len(word) / 2), y=y + 15, css=f"verdict {css}".rstrip(), anchor="middle")
    y += LINE + 6
    deviation = measure_text(result.circular_deviation_mm, scales.tolerance.circular_deviation_mm, scales)
    whole = "no G on a trapezoid" if result.path == "trapezoid" else f"G = {deviation}"
    return paragraph(body, f"{_shown(row, scales)}; {whole}; {_DIRECTIONS[row.run.path.direction]}", y=y, css="small")


def _shown(row: CircleRow, scales: Scales) -> str:
    """What the circle shows, or why it is not drawn."""
    if row.run.diverged:
        return f"circle not drawn: the {'table left the circle' if row.result.stable else 'loop is unstable'}"
    if scales.circle is None:
        return "no contour error"
    times = decimals_of(scales.circle.times(row.result.radius_mm), 0)
    return f"{scales.circle.ring_text} a ring, {times} times magnified"


def measure_text(value_mm: float | None, limit_mm: float | None, scales: Scales) -> str:
    """Write a measure with its unit, and its tolerance where there is one."""
    unit = scales.unit
    value = "-" if value_mm is None else f"{decimals_of(value_mm * 1e3 * unit.per_um, 3)} {unit.name}"
    return value if limit_mm is None else f"{value} (limit {unit.text(limit_mm * 1e3)})"


def _circle(body: Element, row: CircleRow, scales: Scales, *, y: int) -> int:
    """Draw the circle of the page, on the scale of all periods."""
    if row.run.diverged or scales.circle is None:
        return y
    y += _GAP
    box = SubElement(body, "svg", {"class": "chart circle", "y": str(y), "width": "100%", "height": str(HEIGHT)})
    shape = CircleDrawing(contour_profile(row.run), tolerance_mm=None, direction=row.run.path.direction)
    shape.draw(box, scales.circle)
    return y + HEIGHT


def _errors(body: Element, row: CircleRow, scales: Scales, *, y: int) -> int:
    """Draw the contour error over time, with its mean and maximum above, and return the y below it."""
    errors, unit, tolerance = scales.errors, scales.unit, scales.tolerance
    result, limit_mm = row.result, tolerance.max_contour_error_mm
    mean = measure_text(result.mean_contour_error_mm, tolerance.mean_contour_error_mm, scales)
    largest = measure_text(result.max_contour_error_mm, limit_mm, scales)
    y = paragraph(body, f"mean {mean}, max {largest}", y=y, css="head")
    room_um = _ROOM * (errors.top_um - errors.bottom_um) or 1.0
    label = ", ".join(filter(None, (f"contour error [{unit.name}]", errors.zero_outside)))
    up = numbers(label, (errors.bottom_um - room_um) * unit.per_um, (errors.top_um + room_um) * unit.per_um)
    plot = draw_plot_area(body, numbers("time [s]", 0.0, row.curves[-1].time_s[-1]), up, y=y, height=_ERRORS)
    for curve in row.curves:
        _curve(plot, curve, per_um=unit.per_um)
    if not errors.zero_outside:
        plot.line(y=0.0, css="zero")
    for limit in () if limit_mm is None else (-limit_mm * 1e3 * unit.per_um, limit_mm * 1e3 * unit.per_um):
        if up.low <= limit <= up.high:
            plot.line(y=limit, css="tolerance")
    return plot.bottom


def _curve(plot: PlotArea, curve: Curve, *, per_um: float) -> None:
    """Draw a part of the move: the measured part bold and shaded, the rest pale."""
    if curve.measured:
        start, end = (plot.across.share(float(curve.time_s[end])) for end in (0, -1))
        box = {"x": f"{100 * start:.5g}%", "width": f"{100 * (end - start):.5g}%", "y": str(plot.top)}
        SubElement(plot.area, "rect", {**box, "height": str(plot.height), "class": "during"})
    # Far outside, the place of a point does not matter; a huge coordinate cannot be drawn.
    spread = plot.up.high - plot.up.low
    errors = np.clip(curve.error_um * per_um, plot.up.low - spread, plot.up.high + spread)
    points = (plot.point(float(x), float(error)) for x, error in zip(curve.time_s, errors, strict=True))
    css = "measured" if curve.measured else "apart"
    SubElement(plot.paths, "path", {"class": f"curve {css}", "d": f"M{'L'.join(points)}"})


def _ranking(body: Element, row: CircleRow, rows: Sequence[CircleRow], scales: Scales, *, y: int) -> int:
    """Draw what each error source takes from the largest error, largest first, and return the y below it.

    Periods whose table followed the circle share a scale; the others share a second.
    """
    if not row.result.contributions:
        return y
    unit = scales.unit
    y = (
        paragraph(
            body, f"Each error source removed in turn: taken from the largest error [{unit.name}]", y=y, css="head"
        )
        + 4
    )
    alike = [drawn for drawn in rows if drawn.run.diverged == row.run.diverged]
    taken = [source.removed_mm * 1e3 * unit.per_um for row in alike for source in row.result.contributions or ()]
    low, high = min(0.0, *taken), max(0.0, *taken)
    scale = Scale(low, high if high > low else low + 1.0)
    bars = []
    for source in row.result.contributions:
        value = source.removed_mm * 1e3 * unit.per_um
        words = decimals_of(value, 3, signed=True)
        bars.append(
            SignedBar(source.source.replace("_", " "), value, words, unit.name, "takes" if value >= 0 else "hides")
        )
    bottom = y + ROW * len(bars)
    draw_zero(body, scale, top=y, bottom=bottom)
    draw_bars(body, bars, scale, y=y)
    return scale.marks(SubElement(body, "g"), top=bottom, bottom=bottom)


def _legend(body: Element, rows: Sequence[CircleRow], *, y: int) -> int:
    """Explain each kind of line that is drawn once, and return the y below."""
    drawn = {element.get("class") for element in body.iter()}
    turn = rows[0].result.path != "trapezoid"
    entries = {
        "curve measured": "measured: one whole turn" if turn else "measured: arc at constant speed",
        "curve apart": "the rest: lead-in and ramps" if turn else "the rest: ramps and settling",
        "nominal": "nominal circle",
        "tolerance": "tolerance of the largest contour error",
    }
    for css, words in entries.items():
        if css not in drawn:
            continue
        SubElement(body, "line", {"x1": "0", "x2": "28", "y1": str(y + 11), "y2": str(y + 11), "class": css})
        text_at(body, words, x="36", y=y + 15)
        y += LINE
    return y
