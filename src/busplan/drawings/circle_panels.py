"""The panels of the circle test's figure: error over time, and ranked error sources."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from busplan.drawings.circle_rows import CircleRow, Curve, Scales
from busplan.forms.numbers import decimals_of

# Colours by Okabe and Ito, which colour-blind readers tell apart.
_MEASURED: Final = "#0072B2"
_REST: Final = "#8FB8D0"
_LIMIT: Final = "#D55E00"
_SHADE: Final = "#E6F0F6"
LIMIT_STYLE: Final = {
    "color": _LIMIT,
    "linewidth": 1.1,
    "linestyle": "--",
    "label": "tolerance of the largest contour error",
}
_ROOM: Final = 0.08
"""Empty room above and below the errors, as a share of their range."""


def curve_style(row: CircleRow, curve: Curve) -> dict[str, Any]:
    """Line of a part of the move: the measured one strong, the rest thin and pale."""
    turn = row.result.path != "trapezoid"
    if curve.measured:
        part = "measured: one whole turn" if turn else "measured: arc at constant speed"
        return {"color": _MEASURED, "linewidth": 1.2, "label": part, "zorder": 3}
    part = "the rest: lead-in and ramps" if turn else "the rest: ramps and settling"
    return {"color": _REST, "linewidth": 0.6, "label": part, "zorder": 2}


def draw_errors(axes: Any, row: CircleRow, scales: Scales) -> None:
    """Draw the contour error over time, with its mean and maximum in the title.

    Parameters
    ----------
    axes
        Axes of matplotlib.
    row
        The period.
    scales
        Scales of all rows. What lies outside leaves the picture.
    """
    errors, unit, tolerance = scales.errors, scales.unit, scales.tolerance
    room_um = _ROOM * (errors.top_um - errors.bottom_um) or 1.0
    bottom_um, top_um = errors.bottom_um - room_um, errors.top_um + room_um
    axes.set_ylim(bottom_um * unit.per_um, top_um * unit.per_um)
    for curve in row.curves:
        # Far outside, the place of a point does not matter; a huge one cannot be drawn.
        error_um = np.clip(curve.error_um, 2 * bottom_um - top_um, 2 * top_um - bottom_um)
        axes.plot(curve.time_s, error_um * unit.per_um, **curve_style(row, curve))
        if curve.measured:
            axes.axvspan(curve.time_s[0], curve.time_s[-1], color=_SHADE, zorder=0)
    if not errors.zero_outside:
        axes.axhline(0.0, color="black", linewidth=0.8)
    limit_mm = tolerance.max_contour_error_mm
    for limit_um in () if limit_mm is None else (-limit_mm * 1e3, limit_mm * 1e3):
        if bottom_um <= limit_um <= top_um:
            axes.axhline(limit_um * unit.per_um, **LIMIT_STYLE)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(", ".join(filter(None, (f"contour error [{unit.name}]", errors.zero_outside))))
    axes.ticklabel_format(axis="y", style="plain", useOffset=False)
    axes.grid(visible=True, linewidth=0.4, color="0.85")
    result = row.result
    mean = measure_text(result.mean_contour_error_mm, tolerance.mean_contour_error_mm, scales)
    largest = measure_text(result.max_contour_error_mm, limit_mm, scales)
    axes.set_title(f"mean {mean}, max {largest}", fontsize=10)


def measure_text(value_mm: float | None, limit_mm: float | None, scales: Scales) -> str:
    """Write a measure with its unit, and its tolerance where there is one."""
    unit = scales.unit
    value = "-" if value_mm is None else f"{decimals_of(value_mm * 1e3 * unit.per_um, 3)} {unit.name}"
    return value if limit_mm is None else f"{value} (limit {unit.text(limit_mm * 1e3)})"


def draw_ranking(axes: Any, row: CircleRow, rows: Sequence[CircleRow], scales: Scales) -> None:
    """Draw what each error source takes from the largest error, largest first; one that hides another is hollow.

    Parameters
    ----------
    axes
        Axes of matplotlib.
    row
        The period.
    rows
        All rows. Those whose table followed the circle share a scale, the others another one.
    scales
        Scales of all rows.
    """
    ranked = row.result.contributions
    if not ranked:
        axes.set_axis_off()
        return
    unit = scales.unit
    alike = [each for each in rows if each.run.diverged == row.run.diverged]
    all_taken = [one.removed_mm * 1e3 * unit.per_um for each in alike for one in each.result.contributions or ()]
    low, high = min(0.0, *all_taken), max(0.0, *all_taken)
    room = (high - low) or 1.0
    axes.set_xlim(low - 0.05 * room, high + 0.35 * room)
    for place, one in enumerate(ranked):
        taken = one.removed_mm * 1e3 * unit.per_um
        fill = {"color": _MEASURED} if taken >= 0 else {"facecolor": "white", "edgecolor": _LIMIT, "linewidth": 1.2}
        axes.barh(place, taken, height=0.6, **fill)
        axes.annotate(
            decimals_of(taken, 3, signed=True),
            (max(taken, 0.0), place),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.locator_params(axis="x", nbins=4)
    axes.set_yticks(range(len(ranked)), [one.source.replace("_", " ") for one in ranked], fontsize=9)
    axes.set_ylim(len(ranked) - 0.4, -0.6)
    axes.set_xlabel(f"taken from the largest error [{unit.name}]")
    axes.set_title("each error source removed in turn", fontsize=10)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
