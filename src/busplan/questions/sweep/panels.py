"""The charts of a sweep's picture: curves over one key, maps of colours over two."""

from collections.abc import Iterable, Iterator
from itertools import cycle, pairwise
from typing import Final

import numpy as np

from busplan.forms.charts import (
    Cell,
    Curve,
    Curves,
    Drawing,
    Entry,
    Grid,
    Guide,
    Panel,
    Ruler,
    Shade,
    choices,
    letters,
    numbers,
)
from busplan.forms.numbers import figure_text
from busplan.forms.picture import LEVELS
from busplan.forms.scale import ticks
from busplan.questions.sweep.grid import Array
from busplan.questions.sweep.plotted import (
    PlotScale,
    Plotted,
    SweptModel,
    caption,
    is_constant,
    shown_value,
    value_text,
)

_ROOM: Final = 0.06
"""Empty room above and below curves, as a share of their range."""
_MOST_DOTS: Final = 16
"""Most points of a curve that have its mark each."""
_OWN: Final = "this design"


def sweep_drawing(plotted: Plotted, *, title: str) -> Drawing:
    """Draw a figure over one key as curves, over two as maps, one for each timing model.

    Parameters
    ----------
    plotted
        The figure, its scales and its values.
    title
        Title of the picture.
    """
    panels: Iterable[Panel] = ()
    if plotted.panels:
        panels = [_curves(plotted)] if len(plotted.scales) == 1 else _maps(plotted)
    return Drawing(title, tuple(panels), (caption(plotted),), caption(plotted))


def _ruler(scale: PlotScale, *, as_cells: bool, most: int = 6) -> Ruler:
    if scale.are_choices:
        return choices(scale.label, scale.labels, own=scale.own)
    half = (scale.places[1] - scale.places[0]) / 2 if as_cells and scale.places.size > 1 else 0.5 * as_cells
    low, high = float(scale.places[0] - half), float(scale.places[-1] + half)
    return numbers(scale.label, low, high, most=most, whole=scale.are_whole)


def _ends(plotted: Plotted) -> tuple[float, float]:
    """Smallest and largest value."""
    known = [panel.values[np.isfinite(panel.values)] for panel in plotted.panels] or [np.zeros(1)]
    return float(min(values.min() for values in known)), float(max(values.max() for values in known))


def _curves(plotted: Plotted) -> Panel:
    """A curve for each timing model; choices are points, which no line joins."""
    (scale,), (low, high) = plotted.scales, _ends(plotted)
    is_count = plotted.figure.sort == "count"
    if plotted.has_zero or is_count:
        low, high = min(low, 0.0), max(high, 0.0)
    across = _ruler(scale, as_cells=False)
    middles = ((scale.places[1:] + scale.places[:-1]) / 2).tolist()
    edges = [across.low, *middles, across.high]
    shades = [Shade(Entry("gap", "not shown to fit"), *ends) for ends in _runs(edges, plotted.not_shown)]
    shades += [Shade(Entry("unsafe", f"unsafe {plotted.safety}", "!"), *ends) for ends in _runs(edges, plotted.unsafe)]
    guides = [Guide(Entry("limit", f"{plotted.figure.label} of 0", shape="line"), y=0.0)] if plotted.has_zero else []
    guides += [] if scale.own is None else [Guide(Entry("own", _OWN, shape="line"), x=scale.own)]
    marks = letters(panel.model for panel in plotted.panels)
    curves = (
        Curve(
            Entry(ink, f"{panel.model} model", mark, "line"),
            tuple(zip(scale.places.tolist(), _known(panel.values), strict=True)),
            has_dots=scale.are_choices or scale.places.size <= _MOST_DOTS,
            has_line=not scale.are_choices,
        )
        for panel, mark, ink in zip(plotted.panels, marks, cycle(("first", "second")))
    )
    up = numbers(plotted.label, low, high, whole=is_count, room=_ROOM)
    return Panel(Curves(across, up, tuple(curves), tuple(guides), tuple(shades)))


def _known(values: Array) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _runs(edges: list[float], chosen: Array) -> Iterator[tuple[float, float]]:
    """Ends of each run of chosen settings, to the middle between neighbours."""
    changes = np.flatnonzero(np.diff(chosen.astype(int), prepend=0, append=0)).tolist()
    return ((edges[start], edges[end]) for start, end in zip(changes[::2], changes[1::2], strict=True))


def _maps(plotted: Plotted) -> Iterator[Panel]:
    """A map for each timing model, all with the same colours; a figure that is always the same is said instead."""
    varying = tuple(panel for panel in plotted.panels if not is_constant(panel.values))
    for panel in plotted.panels:
        if is_constant(panel.values) and panel is not plotted.told:  # the caption tells of that
            value = value_text(plotted, float(panel.values.flat[0]))
            yield Panel(None, f"{panel.model} model: {value} at every setting")
    low, high = _ends(plotted._replace(panels=varying))
    inner = [tick.at for tick in ticks(low, high, most=LEVELS) if low < tick.at < high] if varying else []
    levels = _levels(plotted, [low, *inner, high])
    for panel in varying:
        yield Panel(_map(plotted, panel, inner, levels), f"{panel.model} model")


def _levels(plotted: Plotted, edges: list[float]) -> list[Entry]:
    """Colours and the values that they stand for; those of a difference grow stronger from zero to both sides."""
    size = len(edges) - 1
    below = sum(edge < 0 for edge in edges[:-1]) if plotted.has_zero else 0
    strongest = max(1, below - 1, size - below - 1)
    entries = []
    for number, (start, end) in enumerate(pairwise(edges)):
        side, steps = ("above", number - below) if number >= below else ("below", below - 1 - number)
        last = end - 1 if plotted.figure.sort == "count" and number + 1 < size else end
        words = f"{figure_text(shown_value(start))} to {value_text(plotted, last)}"
        entries.append(Entry(f"{side}-{round(steps / strongest * (LEVELS - 1))}", words))
    return entries


def _map(plotted: Plotted, panel: SweptModel, inner: list[float], levels: list[Entry]) -> Grid:
    """Cells in the colours of their values, with the edge of what is shown to fit, unsafe settings and this design."""
    up, across = plotted.scales
    known = np.isfinite(panel.values)
    numbers_ = np.searchsorted(inner, np.where(known, panel.values, 0.0), side="right")
    legend = list(levels)
    if panel.frontier is not None:
        legend.append(Entry("border", "edge of what is shown to fit", shape="line"))
    if panel.unsafe.any():
        legend.append(Entry("blank", f"unsafe {plotted.safety}", "!"))
    if up.own is not None and across.own is not None:
        legend.append(Entry("frame", _OWN))
    if not known.all():
        legend.append(Entry("blank", "blank: no value"))
    looks = {
        (number, is_unsafe, fits): Cell(entry.ink, "!" if is_unsafe else "", is_inside=fits)
        for number, entry in enumerate(levels)
        for is_unsafe in (False, True)
        for fits in (None, False, True)
    }
    fits = np.full(panel.values.shape, None) if panel.fits is None else panel.fits
    rows = (
        tuple(
            looks[level, is_unsafe, is_inside] if is_known else None
            for is_known, level, is_unsafe, is_inside in zip(*(part.tolist() for part in parts), strict=True)
        )
        for parts in zip(known, numbers_, panel.unsafe, fits, strict=True)
    )
    own = None if up.own is None or across.own is None else (across.own, up.own)
    return Grid(_ruler(across, as_cells=True), _ruler(up, as_cells=True, most=8), tuple(rows), tuple(legend), own)
