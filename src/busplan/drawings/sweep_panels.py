"""The panels of a sweep's figure: curves, and heat maps. Importing this module needs the extra `plot` (matplotlib)."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator

from busplan.analysis.sweep.grid import Array
from busplan.drawings.sweep_scales import PlotScale
from busplan.drawings.sweep_words import Panel, Plotted

# Colours by Okabe and Ito, which colour-blind readers tell apart.
_CURVES: Final = (("#0072B2", "o", "-"), ("#D55E00", "s", "--"), ("#009E73", "D", ":"))
_OWN: Final = "black"
_ROUND: Final = (1, 2, 5, 10)
"""Steps of ticks, times a power of ten."""
_MOST_MARKED: Final = 100
"""Most points of a curve that have a mark each."""
_MOST_HATCHED: Final = 4000
"""Most unsafe cells with a mark of their own; more are one hatched area."""


def draw_curves(figure: Figure, plotted: Plotted) -> None:
    """Draw a curve for each timing model; choices are points, which no line joins.

    Parameters
    ----------
    figure
        Figure of matplotlib.
    plotted
        What is drawn, over one key.
    """
    axes: Any = figure.subplots()
    (scale,) = plotted.scales
    for panel in plotted.panels:
        colour, marker, line = _CURVES[panel.number % len(_CURVES)]
        marked = scale.are_choices or scale.places.size <= _MOST_MARKED
        axes.plot(
            scale.places,
            panel.values,
            label=f"{panel.model} model",
            color=colour,
            marker=marker if marked else "",
            markersize=7 if scale.are_choices else 4,
            fillstyle="full" if panel is plotted.told else "none",
            linestyle="" if scale.are_choices else line,
        )
        unsafe = panel.unsafe & np.isfinite(panel.values)
        if unsafe.any():
            axes.plot(scale.places[unsafe], panel.values[unsafe], "x", color="black", markersize=12, zorder=4)
    if plotted.has_zero:
        axes.axhline(0.0, color="black", linewidth=1.0, linestyle="--")
    if scale.own is not None:
        axes.axvline(scale.own, color=_OWN, linewidth=1.0, linestyle=(0, (2, 3)), label="this design")
    _label(axes.xaxis, scale)
    if scale.are_choices:
        axes.set_xlim(-0.5, scale.places.size - 0.5)
    axes.set_ylabel(plotted.label)
    if plotted.figure.sort == "count":
        axes.yaxis.set_major_locator(MaxNLocator(integer=True, steps=_ROUND))
    axes.grid(visible=True, linewidth=0.4, color="0.85")
    axes.set_axisbelow(True)
    handles, _ = axes.get_legend_handles_labels()
    if plotted.any_unsafe:
        handles.append(_unsafe_mark(plotted))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)


def draw_maps(figure: Figure, plotted: Plotted) -> None:
    """Draw a heat map for each timing model, all with the same colours.

    Parameters
    ----------
    figure
        Figure of matplotlib.
    plotted
        What is drawn, over two keys.
    """
    up, across = plotted.scales
    panels: Any = figure.subplots(1, max(1, len(plotted.panels)), squeeze=False)[0]
    colours, norm = ("RdBu", _centred(plotted)) if plotted.has_zero else ("viridis", None)
    image: Any = None
    for axes, panel in zip(panels, plotted.panels, strict=False):
        norm = norm or _range(plotted)
        image = axes.pcolormesh(
            across.places, up.places, panel.values, cmap=colours, norm=norm, shading="nearest", rasterized=True
        )
        _mark(axes, plotted, panel)
        _label(axes.xaxis, across)
        _label(axes.yaxis, up)
        axes.set_title(f"{panel.model} model", fontsize=10)
    if image is not None:
        bar = figure.colorbar(image, ax=list(panels), label=plotted.label)
        if plotted.figure.sort == "count":
            bar.set_ticks(MaxNLocator(integer=True, steps=_ROUND))
        if plotted.has_zero:
            bar.set_ticks(_both_sides(image.norm))
    figure.legend(handles=list(_keys(plotted)), loc="outside lower center", ncols=4, frameon=False, fontsize=9)


def _mark(axes: Any, plotted: Plotted, panel: Panel) -> None:
    """Draw the line of zero, the unsafe cells and this design."""
    up, across = plotted.scales
    x, y = _edges(across.places), _edges(up.places)
    if plotted.has_zero:
        axes.add_collection(LineCollection(list(_border(panel.values, x, y)), colors="black", linewidths=2.0))
    rows, columns = np.nonzero(panel.unsafe)
    if rows.size <= _MOST_HATCHED:
        _cross(axes, across.places[columns], up.places[rows])
    else:
        axes.contourf(across.places, up.places, panel.unsafe, levels=[0.5, 1.5], hatches=["xx"], colors="none")
    if up.own is not None and across.own is not None:
        axes.plot([across.own], [up.own], "o", markersize=11, markerfacecolor="none", markeredgecolor="white", mew=4)
        axes.plot([across.own], [up.own], "o", markersize=11, markerfacecolor="none", markeredgecolor=_OWN, mew=2)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])


def _edges(places: Array) -> Array:
    """Edges of cells whose middles are evenly spaced."""
    half = (places[1] - places[0]) / 2 if places.size > 1 else 0.5
    return np.append(places - half, places[-1] + half)


def _border(values: Array, x: Array, y: Array) -> Iterator[list[tuple[float, float]]]:
    """Edges between cells of zero or more and cells below zero."""
    fits, known = values >= 0, np.isfinite(values)
    for row, column in zip(*np.nonzero((fits[:, 1:] != fits[:, :-1]) & known[:, 1:] & known[:, :-1]), strict=True):
        yield [(x[column + 1], y[row]), (x[column + 1], y[row + 1])]
    for row, column in zip(*np.nonzero((fits[1:] != fits[:-1]) & known[1:] & known[:-1]), strict=True):
        yield [(x[column], y[row + 1]), (x[column + 1], y[row + 1])]


def _finite(plotted: Plotted) -> Array:
    found: Array = np.concatenate([one.values[np.isfinite(one.values)] for one in plotted.panels])
    return found


def _range(plotted: Plotted) -> Normalize:
    found = _finite(plotted)
    return Normalize(float(found.min()), float(found.max()))


def _centred(plotted: Plotted) -> Normalize | None:
    """Colours with zero in the middle: red below it, blue above."""
    found = _finite(plotted) if plotted.panels else np.zeros(1)
    least, most = float(found.min()), float(found.max())
    far = max(abs(least), abs(most)) or 1.0
    return TwoSlopeNorm(0.0, least if least < 0 else -far, most if most > 0 else far)


def _label(axis: Any, scale: PlotScale) -> None:
    axis.set_label_text(scale.label)
    if scale.are_choices:
        places, names = scale.marks
        axis.set_ticks(places, names)
    else:
        axis.set_major_locator(MaxNLocator(integer=scale.are_whole, steps=_ROUND))


def _both_sides(norm: Normalize) -> list[float]:
    """Round ticks on either side of zero, which have scales of their own."""
    least, most = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
    below = MaxNLocator(4, steps=_ROUND).tick_values(least, 0.0)
    above = MaxNLocator(6, steps=_ROUND).tick_values(0.0, most)
    return sorted({float(one) for one in (*below, *above) if least <= one <= most})


def _cross(axes: Any, x: Array, y: Array) -> None:
    """Cross out cells, to be seen on any colour."""
    for colour, width in (("white", 3.5), ("black", 1.5)):
        axes.plot(x, y, "x", color=colour, markersize=8, markeredgewidth=width, zorder=4)


def _unsafe_mark(plotted: Plotted) -> Line2D:
    return Line2D([], [], color="black", marker="x", markersize=8, linestyle="", label=f"unsafe {plotted.safety}")


def _keys(plotted: Plotted) -> Iterator[Line2D | Patch | Rectangle]:
    """Entries of the legend of heat maps."""
    if plotted.has_zero:
        yield Line2D([], [], color="black", linewidth=2.0, label=f"{plotted.figure.label} of 0")
    if plotted.any_unsafe:
        yield _unsafe_mark(plotted)
    if all(one.own is not None for one in plotted.scales):
        label = "this design"
        yield Line2D([], [], color=_OWN, marker="o", markersize=9, mfc="none", mew=2, linestyle="", label=label)
    if any(np.isnan(one.values).any() for one in plotted.panels):
        yield Patch(facecolor="white", edgecolor="0.7", label="blank: no value")
