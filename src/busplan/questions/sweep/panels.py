"""The panels of a sweep's picture: curves over one key, heat maps over two."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from busplan.forms.blocks import Drawing
from busplan.forms.picture import styled
from busplan.forms.plot_area import MARGIN_PERCENT, PlotArea, Ruler, choices, draw_across, draw_plot_area, numbers
from busplan.forms.svg import LINE, PHONE, drawing, inside, markup, paragraph, text_at
from busplan.questions.sweep.grid import Array
from busplan.questions.sweep.plotted import Panel, PlotScale, Plotted, caption, is_constant, value_text
from busplan.questions.words.drawings import CURVES, draw_mark

_CURVES: Final = 300
"""Height of curves, in px."""
_CELL: Final = 22
_LEAST_MAP, _MOST_MAP = 150, 420
"""Least and largest height of a heat map, in px."""
_GAP: Final = 12
_ROOM: Final = 0.06
"""Empty room above and below curves, as a share of their range."""
_MOST_MARKED: Final = 100
"""Most points of a curve that have a mark each."""
_MOST_CROSSED: Final = 400
"""Most unsafe cells of a map with a cross each; of more, some have one."""
_LEVELS: Final = 60
"""Colours of a heat map: more would not be told apart."""
_RISING: Final = ((238, 243, 250), (147, 184, 232), (29, 111, 216), (16, 44, 94))
_SIGNED: Final = ((122, 20, 16), (236, 138, 128), (248, 249, 250), (122, 170, 226), (15, 58, 118))
"""Colours of a figure that only rises, and of a difference: red below zero, blue above it, almost white between."""
_CROSS: Final = "M-5 -5L5 5M-5 5L5 -5"
_STYLE: Final = """\
.chart .limit { stroke: var(--ink); stroke-width: 1.2; stroke-dasharray: 6 4; }
.chart .cross { fill: none; stroke: var(--ink); stroke-width: 1.8; }
.chart .cells { shape-rendering: crispEdges; }
.chart .border { fill: none; stroke: #10151c; stroke-width: 2.2; vector-effect: non-scaling-stroke; }
.chart .below { fill: none; stroke: #ffffff; stroke-width: 4.4; }
.chart .above { fill: none; stroke: #10151c; stroke-width: 1.8; }
.chart .unproven { fill: var(--rule); opacity: .6; }
.chart .blank { fill: none; stroke: var(--rule); }
"""


def sweep_svg(plotted: Plotted, *, title: str) -> str:
    """Draw a figure over one key as curves, over two as heat maps, one for each timing model.

    It fills the width of its container, from 320 px on.

    Parameters
    ----------
    plotted
        The figure, its scales and its values.
    title
        Title of the picture.
    """
    root = drawing(caption(plotted), css="chart sweep")
    body = inside(root, x_percent=MARGIN_PERCENT, width_percent=100 - 2 * MARGIN_PERCENT, y=0)
    y = paragraph(body, caption(plotted), y=paragraph(body, title, y=8, css="head"), css="small") + _GAP
    return styled(_drawn(root, body, plotted, y=y), css=_STYLE)


class SweepDrawing(Drawing):
    """The picture of a sweep for a page, which has its title, caption and style sheet.

    Parameters
    ----------
    plotted
        The figure, its scales and its values.
    """

    stylesheet = _STYLE

    def __init__(self, plotted: Plotted) -> None:
        self._plotted = plotted

    def svg(self) -> str:
        """Draw it for a page."""
        root = drawing(caption(self._plotted), css="chart sweep")
        return _drawn(root, root, self._plotted, y=0)


def _drawn(root: Element, body: Element, plotted: Plotted, *, y: int) -> str:
    y = (_curves if len(plotted.scales) == 1 else _maps)(body, plotted, y=y)
    root.set("height", str(y + _GAP))
    return markup(root)


def _ruler(scale: PlotScale, *, as_cells: bool) -> Ruler:
    if scale.are_choices:
        return choices(scale.label, scale.labels, own=None if scale.own is None else int(scale.own))
    low, high = (_edges(scale.places) if as_cells else scale.places)[[0, -1]].tolist()
    return numbers(scale.label, low, high, whole=scale.are_whole)


# --- curves over one key --------------------------------------------------------------------------------------------


def _curves(body: Element, plotted: Plotted, *, y: int) -> int:
    """Draw a curve for each timing model; choices are points, which no line joins. Return the y below them."""
    (scale,) = plotted.scales
    is_count = plotted.figure.sort == "count"
    low, high = _ends(plotted)
    if plotted.has_zero or is_count:
        low, high = min(low, 0.0), max(high, 0.0)
    room = _ROOM * (high - low)
    up = numbers(plotted.label, low - room if low else low, high + room if high else high, whole=is_count)
    plot = draw_plot_area(body, _ruler(scale, as_cells=False), up, y=y, height=_CURVES)
    for panel in plotted.panels:
        _unproven(plot, scale, panel)
    if plotted.has_zero:
        plot.line(y=0.0, css="limit")
    if scale.own is not None:
        plot.line(x=scale.own, css="own")
    for panel in plotted.panels:
        _curve(plot, scale, panel)
    for panel in plotted.panels:
        for place in np.flatnonzero(panel.unsafe & np.isfinite(panel.values)):
            _cross(plot.place(scale.places[place], panel.values[place]), "cross")
    return _legend_of_curves(body, plotted, y=plot.bottom + _GAP)


def _ends(plotted: Plotted) -> tuple[float, float]:
    """Smallest and largest value."""
    known = [panel.values[np.isfinite(panel.values)] for panel in plotted.panels]
    if not known:
        return 0.0, 0.0
    return float(min(values.min() for values in known)), float(max(values.max() for values in known))


def _curve(plot: PlotArea, scale: PlotScale, panel: Panel) -> None:
    css, known = _css(panel), np.isfinite(panel.values)
    if not scale.are_choices:
        d = "".join(
            f"{'L' if joined else 'M'}{plot.point(x, y)}"
            for x, y, joined in zip(
                scale.places[known].tolist(),
                panel.values[known].tolist(),
                np.append(False, known[:-1])[known].tolist(),
                strict=True,
            )
        )
        SubElement(plot.paths, "path", {"class": f"curve {css}", "d": d})
    if scale.are_choices or known.size <= _MOST_MARKED:
        for x, y in zip(scale.places[known].tolist(), panel.values[known].tolist(), strict=True):
            draw_mark(plot.area, css, x=plot.x(x), y=plot.y(y))


def _unproven(plot: PlotArea, scale: PlotScale, panel: Panel) -> None:
    """Shade the settings that are not shown to fit, to the middle between neighbours."""
    if panel.frontier is None:
        return
    middles = (scale.places[1:] + scale.places[:-1]) / 2
    edges = [plot.across.low, *middles.tolist(), plot.across.high]
    d = "".join(
        f"M{plot.point(left, plot.up.low)}L{plot.point(left, plot.up.high)}"
        f"L{plot.point(right, plot.up.high)}L{plot.point(right, plot.up.low)}Z"
        for (left, right), fits in zip(pairwise(edges), panel.frontier.tolist(), strict=True)
        if not fits
    )
    SubElement(plot.paths, "path", {"class": "unproven", "d": d})


def _css(panel: Panel) -> str:
    return CURVES[panel.number % len(CURVES)]


def _cross(place: Element, *css: str) -> None:
    for name in css:
        SubElement(place, "path", {"d": _CROSS, "class": name})


def _legend_of_curves(body: Element, plotted: Plotted, *, y: int) -> int:
    is_joined = not plotted.scales[0].are_choices
    for panel in plotted.panels:
        if is_joined:
            _sample(body, y, f"curve {_css(panel)}")
        draw_mark(body, _css(panel), x="14", y=y + 11)
        y = _entry(body, f"{panel.model} model", y)
    if plotted.has_zero:
        _sample(body, y, "limit")
        y = _entry(body, _zero(plotted), y)
    if plotted.scales[0].own is not None:
        _sample(body, y, "own")
        y = _entry(body, "this design", y)
    if any(panel.frontier is not None for panel in plotted.panels):
        SubElement(body, "rect", {"x": "0", "y": str(y + 4), "width": "28", "height": "12", "class": "unproven"})
        y = _entry(body, "not shown to fit", y)
    return _unsafe_entry(body, plotted, y)


# --- heat maps over two keys ----------------------------------------------------------------------------------------


class _Colours(NamedTuple):
    """Colours of values, in `_LEVELS` levels; zero is in the middle if the figure is a difference."""

    low: float
    high: float
    is_signed: bool

    def levels(self, values: Array) -> Array:
        """Level of each value, from 0."""
        if self.is_signed:
            below, above = self.low or -self.high or -1.0, self.high or -self.low or 1.0
            share = 0.5 + np.where(values < 0, -0.5 * values / below, 0.5 * values / above)
        else:
            share = (values - self.low) / ((self.high - self.low) or 1.0)
        levels: Array = np.clip((share * _LEVELS).astype(np.int64), 0, _LEVELS - 1)
        return levels

    def colour(self, level: int) -> str:
        """Colour of a level, between its two neighbours among the named ones."""
        stops = np.array(_SIGNED if self.is_signed else _RISING)
        at = (level + 0.5) / _LEVELS * (len(stops) - 1)
        first = int(at)
        red, green, blue = (stops[first] + (at - first) * (stops[first + 1] - stops[first])).round().astype(int)
        return f"#{red:02x}{green:02x}{blue:02x}"


def _maps(body: Element, plotted: Plotted, *, y: int) -> int:
    """Draw a heat map for each timing model, all with the same colours, and return the y below them.

    A figure that is the same at every setting is said, not drawn.
    """
    up, across = plotted.scales
    for panel in plotted.panels:
        if is_constant(panel.values) and panel is not plotted.told:  # the caption tells of that
            words = f"{panel.model} model: {value_text(plotted, float(panel.values.flat[0]))} at every setting"
            y = paragraph(body, words, y=y, css="head")
    plotted = plotted._replace(panels=tuple(panel for panel in plotted.panels if not is_constant(panel.values)))
    if not plotted.panels:
        return y
    low, high = _ends(plotted)
    colours = _Colours(*((min(low, 0.0), max(high, 0.0)) if plotted.has_zero else (low, high)), plotted.has_zero)
    for panel in plotted.panels:
        y = paragraph(body, f"{panel.model} model", y=y, css="head")
        height = min(_MOST_MAP, max(_LEAST_MAP, _CELL * up.places.size))
        rulers = (_ruler(scale, as_cells=True) for scale in (across, up))
        plot = draw_plot_area(body, *rulers, y=y, height=height)
        _cells(plot, plotted, panel, colours)
        y = plot.bottom + _GAP
    return _legend_of_maps(body, plotted, y=_bar(body, plotted, colours, y=y) + _GAP)


def _cells(plot: PlotArea, plotted: Plotted, panel: Panel, colours: _Colours) -> None:
    """Draw the cells, the frontier of the verdict or of zero, the unsafe cells and this design."""
    up, across = plotted.scales
    x, y = _edges(across.places), _edges(up.places)
    area = SubElement(plot.paths, "g", {"class": "cells"})
    for level, d in _runs(plot, panel.values, colours, x, y):
        SubElement(area, "path", {"d": d, "fill": colours.colour(level)})
    if panel.fits is not None or plotted.has_zero:
        fits = np.where(np.isfinite(panel.values), panel.values >= 0, np.nan) if panel.fits is None else panel.fits
        d = "".join(f"M{plot.point(*start)}L{plot.point(*end)}" for start, end in _border(fits.astype(float), x, y))
        SubElement(plot.paths, "path", {"class": "border", "d": d})
    rows, columns = np.nonzero(panel.unsafe)
    every = -(-rows.size // _MOST_CROSSED) or 1
    for row, column in zip(rows[::every].tolist(), columns[::every].tolist(), strict=True):
        _cross(plot.place(across.places[column], up.places[row]), "below", "above")
    if up.own is not None and across.own is not None:
        _own(plot.place(across.own, up.own))


def _runs(plot: PlotArea, values: Array, colours: _Colours, x: Array, y: Array) -> Iterator[tuple[int, str]]:
    """One path for each colour: neighbours of a row that have it are one rectangle."""
    known = np.isfinite(values)
    levels = np.where(known, colours.levels(np.where(known, values, 0.0)), -1)
    paths: dict[int, list[str]] = {}
    for row, line in enumerate(levels):
        starts = np.flatnonzero(np.diff(line, prepend=-2)).tolist()
        for start, end in pairwise((*starts, line.size)):
            if line[start] >= 0:
                (left, top), (right, bottom) = (
                    plot.point(x[column], y[edge]).split() for column, edge in ((start, row + 1), (end, row))
                )
                paths.setdefault(int(line[start]), []).append(f"M{left} {top}H{right}V{bottom}H{left}Z")
    for level, pieces in sorted(paths.items()):
        yield level, "".join(pieces)


def _edges(places: Array) -> Array:
    """Edges of cells whose middles are evenly spaced."""
    half = (places[1] - places[0]) / 2 if places.size > 1 else 0.5
    return np.append(places - half, places[-1] + half)


def _border(fits: Array, x: Array, y: Array) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Edges between cells of 1 and cells of 0; NaN has none."""
    known = np.isfinite(fits)
    for row, column in zip(*np.nonzero((fits[:, 1:] != fits[:, :-1]) & known[:, 1:] & known[:, :-1]), strict=True):
        yield (x[column + 1], y[row]), (x[column + 1], y[row + 1])
    for row, column in zip(*np.nonzero((fits[1:] != fits[:-1]) & known[1:] & known[:-1]), strict=True):
        yield (x[column], y[row + 1]), (x[column + 1], y[row + 1])


def _own(place: Element) -> None:
    for css in ("below", "above"):
        SubElement(place, "circle", {"r": "7", "class": css})


def _bar(body: Element, plotted: Plotted, colours: _Colours, *, y: int) -> int:
    """Draw the colours with the values that they stand for, and return the y below them."""
    bar = numbers(plotted.label, colours.low, colours.high, whole=plotted.figure.sort == "count")
    edges = np.linspace(0.0, 1.0, _LEVELS + 1)
    levels = colours.levels(bar.low + (bar.high - bar.low) * (edges[1:] + edges[:-1]) / 2)
    for start, level in zip(edges.tolist(), levels.tolist(), strict=False):
        box = {"x": f"{100 * start:.5g}%", "width": f"{100 / _LEVELS + 0.1:.5g}%", "y": str(y), "height": "14"}
        SubElement(body, "rect", {**box, "fill": colours.colour(level), "class": "cells"})
    draw_across(body, bar, y=y + 14, room=PHONE)
    return y + 14 + 2 * LINE


def _legend_of_maps(body: Element, plotted: Plotted, *, y: int) -> int:
    if any(panel.frontier is not None for panel in plotted.panels):
        _sample(body, y, "zero")
        y = _entry(body, "edge of the settings that are shown to fit", y)
    without_verdict = [panel.model for panel in plotted.panels if panel.fits is None]
    if plotted.has_zero and without_verdict:
        _sample(body, y, "zero")
        y = _entry(body, f"{_zero(plotted)} ({', '.join(without_verdict)} model)", y)
    y = _unsafe_entry(body, plotted, y)
    if all(scale.own is not None for scale in plotted.scales):
        SubElement(body, "circle", {"cx": "14", "cy": str(y + 10), "r": "6", "class": "cross"})
        y = _entry(body, "this design", y)
    if any(np.isnan(panel.values).any() for panel in plotted.panels):
        SubElement(body, "rect", {"x": "7", "y": str(y + 4), "width": "14", "height": "12", "class": "blank"})
        y = _entry(body, "blank: no value", y)
    return y


# --- legends --------------------------------------------------------------------------------------------------------


def _sample(body: Element, y: int, css: str) -> None:
    """Draw a piece of a line beside its entry."""
    SubElement(body, "line", {"x1": "0", "x2": "28", "y1": str(y + 11), "y2": str(y + 11), "class": css})


def _entry(body: Element, words: str, y: int) -> int:
    """Write an entry, and return the y below it."""
    text_at(body, words, x="36", y=y + 15)
    return y + LINE


def _zero(plotted: Plotted) -> str:
    return f"{plotted.figure.label} of 0"


def _unsafe_entry(body: Element, plotted: Plotted, y: int) -> int:
    if not plotted.any_unsafe:
        return y
    place = SubElement(body, "svg", {"x": "14", "y": str(y + 10), "overflow": "visible"})
    _cross(place, "cross")
    return _entry(body, f"unsafe {plotted.safety}", y)
