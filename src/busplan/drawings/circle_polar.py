"""The magnified circle of the circle test's figure."""

from typing import Any, Final

import numpy as np

from busplan.drawings.circle_panels import LIMIT_STYLE, curve_style, measure_text
from busplan.drawings.circle_rows import CircleRow, Scales
from busplan.drawings.circle_scale import ERROR_SHARE
from busplan.forms.numbers import decimals_of, period

_VERDICTS: Final[dict[bool | None, tuple[str, dict[str, Any]]]] = {
    True: ("PASSED", {"facecolor": "white", "edgecolor": "#00694E"}),
    False: ("FAILED", {"facecolor": "#A33F00", "edgecolor": "#A33F00"}),
    None: ("NOT JUDGED", {"facecolor": "white", "edgecolor": "0.35", "linestyle": "--"}),
}
"""Word and frame of each verdict: an outline, a filled box, a dashed outline."""
_DIRECTIONS: Final = {"ccw": "counter-clockwise", "cw": "clockwise"}
_FAR: Final = 1 + 1.2 * ERROR_SHARE
"""Radius up to which an error outside the scale is drawn."""
_NEAR: Final = 1 - 1.2 * ERROR_SHARE
_ARROW: Final = 0.62
"""Radius of the arrow: no error is drawn there."""
_ARROW_DEG: Final = (20, 65)
_CROSS: Final = (("X 0°", 1, 0, "left"), ("Y 90°", 0, 1, "center"), ("180°", -1, 0, "right"), ("270°", 0, -1, "center"))


def draw_circle(axes: Any, row: CircleRow, scales: Scales) -> None:
    """Draw the nominal circle, rings, tolerance, axes, direction, start, and the path with its error magnified.

    Parameters
    ----------
    axes
        Axes of matplotlib.
    row
        The period.
    scales
        Scales of all rows.
    """
    axes.set_aspect("equal")
    axes.set_axis_off()
    _head(axes, row)
    _cross(axes)
    _rings(axes, scales)
    first, last = _ARROW_DEG if row.run.path.direction == "ccw" else _ARROW_DEG[::-1]
    _arrow(axes, np.radians(np.linspace(first, last, 20)))
    if not row.run.diverged:
        _path(axes, row, scales)
    axes.text(0.0, 0.0, _centre(row, scales), ha="center", va="center", fontsize=9)


def _head(axes: Any, row: CircleRow) -> None:
    """Write the setup, and the verdict in words and with a frame of its own."""
    result = row.result
    setup = f"{period(result.period_us)}, {result.feed_mm_per_min:g} mm/min, r {result.radius_mm:g} mm"
    word, frame = _VERDICTS[result.passed]
    axes.set_title(setup, fontsize=10, pad=32)
    axes.text(
        0.5,
        1.03,
        word,
        transform=axes.transAxes,
        ha="center",
        va="bottom",
        weight="bold",
        color="white" if result.passed is False else frame["edgecolor"],
        bbox={"boxstyle": "square,pad=0.25", "linewidth": 1.4, **frame},
    )


def _cross(axes: Any) -> None:
    """Draw the two axes with their names and with angles at their ends."""
    far = _FAR + 0.03
    for text, x, y, side in _CROSS:
        axes.plot([0.75 * x, far * x], [0.75 * y, far * y], color="0.8", linewidth=0.6)
        across = "center" if x else "bottom" if y > 0 else "top"
        axes.text((far + 0.03) * x, (far + 0.03) * y, text, ha=side, va=across, fontsize=9)


def _rings(axes: Any, scales: Scales) -> None:
    """Draw the nominal circle, and the rings and the tolerance around it."""
    circle = scales.circle
    _ring(axes, 1.0, color="black", linewidth=0.9, label="nominal circle")
    if circle is None:
        return
    for error_mm in filter(None, circle.rings_mm):
        _ring(axes, circle.radius(error_mm), color="0.8", linewidth=0.6)
    if circle.tolerance_mm is not None:
        for error_mm in (-circle.tolerance_mm, circle.tolerance_mm):
            _ring(axes, circle.radius(error_mm), **LIMIT_STYLE)


def _ring(axes: Any, radius: float, **style: Any) -> None:
    turn = np.linspace(0.0, 2 * np.pi, 361)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), **style)


def _arrow(axes: Any, angle: Any) -> None:
    """Draw an arc inside the circle, with a head at its end."""
    x, y = _ARROW * np.cos(angle), _ARROW * np.sin(angle)
    axes.plot(x, y, color="black", linewidth=1.0)
    axes.annotate("", (x[-1], y[-1]), xytext=(x[-2], y[-2]), arrowprops={"arrowstyle": "->", "color": "black"})


def _path(axes: Any, row: CircleRow, scales: Scales) -> None:
    """Draw the path with its error magnified, and where its measured part begins."""
    for curve in row.curves:
        radius = np.ones_like(curve.error_um) if scales.circle is None else scales.circle.radius(curve.error_um / 1e3)
        radius = np.where((radius >= _NEAR) & (radius <= _FAR), radius, np.nan)
        axes.plot(radius * np.cos(curve.angle), radius * np.sin(curve.angle), **curve_style(row, curve))
        if curve.measured:
            x, y = np.cos(curve.angle[0]), np.sin(curve.angle[0])
            style = {"color": "black", "markeredgecolor": "white", "markersize": 7, "linestyle": "none", "zorder": 4}
            axes.plot([x], [y], marker="o", label="start of the measured part", **style)


def _centre(row: CircleRow, scales: Scales) -> str:
    """What the middle of the circle says: scale, circular deviation, direction."""
    result, circle = row.result, scales.circle
    if row.run.diverged:
        return "not drawn:\nthe table left\nthe circle" if result.stable else "not drawn:\nthe loop is unstable"
    scale = (
        ("no contour error",)
        if circle is None
        else (f"{circle.ring_text} a ring", f"{decimals_of(circle.times(result.radius_mm), 0)} times magnified")
    )
    deviation = measure_text(result.circular_deviation_mm, scales.tolerance.circular_deviation_mm, scales)
    whole = "no G on a trapezoid" if result.path == "trapezoid" else f"G = {deviation}".replace(" (", "\n(")
    return "\n".join((*scale, whole, _DIRECTIONS[row.run.path.direction]))
