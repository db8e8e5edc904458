"""A figure of a sweep as a picture: curves over one key, heat maps over two."""

from collections.abc import Iterable, Iterator
from itertools import cycle, pairwise
from typing import Final, NamedTuple

import numpy as np

from busplan.buses.figure import NODES, PERIOD, VERDICT, Figure, unit_of
from busplan.errors import BusplanError
from busplan.forms.blocks import ShownValue, figure_value
from busplan.forms.charts import (
    ChartCell,
    ChartGrid,
    Curve,
    Curves,
    Drawing,
    Entry,
    Guide,
    Panel,
    Ruler,
    Shade,
    choices,
    letters,
    numbers,
)
from busplan.forms.inks import LEVELS
from busplan.forms.numbers import SILENT_UNITS, factor_of, figure_text, with_unit
from busplan.forms.scale import ticks
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.network import bus_of
from busplan.questions.sweep.grid import Array, Columns, Grid
from busplan.questions.sweep.table import Sweep, column_figures
from busplan.sections.base import value_at
from busplan.sections.profile import Profile

MAX_DRAWN: Final = 250_000
"""Most points of a figure: more would not be visible."""
_MAX_KEYS: Final = 2
_DEFAULT_FIGURES: Final = ("safe_axes", "margin_corrected_us", "margin_us")
"""Columns of which the first that varies is drawn, if no other is asked for."""
_DIGITS: Final = 4
_NO_UNITS: Final = ("_per_s", "_mbit_s", "_mm_s")
"""Ends of keys that a label keeps as they are."""
_ROOM: Final = 0.06
"""Empty room above and below curves, as a share of their range."""
_MOST_DOTS: Final = 16
"""Most points of a curve that have a mark each."""
_DESIGN: Final = "this design"


def not_drawable(grid: Grid) -> str:
    """The reason why a figure over a grid cannot be drawn; empty if it can."""
    varied = [key for key, axis in grid.axes.items() if axis.size > 1]
    if not grid.axes:
        return "draws figures over one or two keys, and none varies but the seed; vary another"
    if len(varied) > _MAX_KEYS:
        return f"draws one or two keys, and {', '.join(varied)} vary; give the others one value"
    return f"{grid.points:,} points; a figure shows at most {MAX_DRAWN:,}" if grid.points > MAX_DRAWN else ""


def require_drawable(grid: Grid, *, option: str = "the picture of a sweep") -> None:
    """Refuse a figure over a grid that cannot be drawn.

    Parameters
    ----------
    grid
        The varied keys.
    option
        Name of the option that asks for the picture, for messages.

    Raises
    ------
    BusplanError
        More than two keys vary, or there are too many points.
    """
    if reason := not_drawable(grid):
        raise BusplanError(f"{option}: {reason}")


class PlotScale(NamedTuple):
    """One varied key along an axis."""

    label: str
    """Quantity along the axis, with its unit."""
    places: Array
    """Where its values stand: the values themselves, or 0, 1, 2 and so on for choices."""
    labels: tuple[str, ...]
    """Names of choices, which no number line joins; empty on a number line."""
    are_whole: bool
    """Whether all values are whole numbers."""
    design: float | None
    """Place of this design; None if it is not on the axis."""


class SweptModel(NamedTuple):
    """The values under one timing model."""

    model: str
    values: Array
    """In the unit of the label, shaped as the scales; NaN for a missing value."""
    unsafe: Array
    """Where the network is not set safely."""
    fits: Array | None
    """Where the cycle is shown to fit; None under a model that does not decide."""

    @property
    def frontier(self) -> Array | None:
        """`fits`, if it is not the same at all points."""
        return self.fits if self.fits is not None and self.fits.any() and not self.fits.all() else None


def is_constant(values: Array) -> bool:
    """Whether all values are the same number, or missing."""
    finite = values[np.isfinite(values)]
    return bool((finite == finite[:1]).all()) and finite.size in (0, values.size)


class Plotted(NamedTuple):
    """A figure over one or two keys."""

    figure: Figure
    scales: tuple[PlotScale, ...]
    """Keys that vary; with two, the first is the y axis and the second the x axis."""
    panels: tuple[SweptModel, ...]
    """One for each timing model that has the figure."""
    safety: str
    """The setting of this kind of bus that must be safe."""
    described: SweptModel | None
    """The panel that the caption describes: that of the model that decides, where it has one."""

    @property
    def label(self) -> str:
        """The figure drawn, with its unit."""
        return figure_label(self.figure)

    @property
    def has_zero(self) -> bool:
        """Whether the figure is a difference, whose zero is a limit."""
        return self.figure.scale is not None

    @property
    def unsafe(self) -> Array:
        """Where the network is not set safely under any timing model."""
        unsafe: Array = np.logical_or.reduce([panel.unsafe for panel in self.panels])
        return unsafe

    @property
    def not_shown(self) -> Array:
        """Where the cycle is not shown to fit, if that differs from setting to setting."""
        frontiers = [~panel.frontier for panel in self.panels if panel.frontier is not None]
        not_shown: Array = np.logical_or.reduce([np.zeros_like(self.unsafe), *frontiers])
        return not_shown

    def design_value(self, panel: SweptModel) -> float | None:
        """The figure at this design; None if it is no point of the grid."""
        places = [np.flatnonzero(scale.places == scale.design) for scale in self.scales if scale.design is not None]
        if len(places) < len(self.scales) or not all(place.size for place in places):
            return None
        value = float(panel.values[tuple(place[0] for place in places)])
        return None if np.isnan(value) else value


def sweep_drawing(sweep: Sweep, table: Columns, *, title: str, figure: str | None = None) -> Drawing:
    """Draw a figure over one key as curves, over two as maps, one for each timing model.

    Parameters
    ----------
    sweep
        The sweep; its profile is this design, which the picture marks.
    table
        All its columns.
    title
        Title of the picture; the figure, and the keys with one value, follow it.
    figure
        Name of a column in numbers; by default the safe axes and, where these do not vary, the corrected margin.

    Raises
    ------
    BusplanError
        As `require_drawable`.
    """
    require_drawable(sweep.grid)
    axes, profile = sweep.grid.axes, sweep.profile
    varied = [key for key, axis in axes.items() if axis.size > 1] or [next(iter(axes))]
    single = {key: axis.tolist()[0] for key, axis in axes.items() if key not in varied}
    is_design = all(value_at(profile, key) == value for key, value in single.items())
    scales = tuple(plot_scale(profile, key, axes[key], as_cells=len(varied) == _MAX_KEYS) for key in varied)
    plotted = _plotted(
        sweep, table, scales if is_design else tuple(scale._replace(design=None) for scale in scales), name=figure
    )
    panels: Iterable[Panel] = ()
    if plotted.panels:
        panels = [_curves(plotted)] if len(scales) == 1 else _maps(plotted)
    fixed = "".join(f"; {key_label(profile, key)}: {value}" for key, value in single.items())
    words = caption(plotted)
    return Drawing(f"{title}: {plotted.label}{fixed}", tuple(panels), (words,), words)


def _plotted(sweep: Sweep, table: Columns, scales: tuple[PlotScale, ...], *, name: str | None) -> Plotted:
    """The values of a figure under each timing model, in the unit that they are drawn in."""
    bus, models = sweep.network.bus, sweep.timing_models
    by_model = {key: column.reshape(-1, len(models)).T for key, column in table.items()}
    candidates = {key: by_model[key].astype(float) for key in ((name,) if name else _DEFAULT_FIGURES)}
    # The first that varies; if none does, the first that a timing model has.
    existing = {key: values for key, values in candidates.items() if not np.isnan(values).all()}
    varying = (key for key, values in existing.items() if not all(map(is_constant, values)))
    drawn = next(varying, next(iter(existing or candidates)))
    figure = column_figures(sweep.network).get(drawn)
    factor = 1.0 if figure is None else factor_of(figure_value(figure, 0.0))
    shape = tuple(scale.places.size for scale in scales)
    panels = {}
    for place, model in enumerate(models):
        values = candidates[drawn][place]
        if np.isnan(values).all():
            continue  # the model does not have the figure
        safe = by_model[bus.safety.figure.key][place].astype(bool) if bus.safety.figure else np.ones(values.size, bool)
        fits = by_model[VERDICT.key][place] == FITS if model == bus.deciding_model else None
        panels[model] = SweptModel(
            model, factor * values.reshape(shape), ~safe.reshape(shape), None if fits is None else fits.reshape(shape)
        )
    return Plotted(
        figure or Figure(drawn, drawn, "", "", key_label(sweep.profile, drawn)),
        scales,
        tuple(panels.values()),
        bus.safety.setting,
        panels.get(bus.deciding_model, next(iter(panels.values()), None)),
    )


def plot_scale(profile: Profile, key: str, axis: Array, *, as_cells: bool) -> PlotScale:
    """Make the scale of a key.

    Words and numbers among words are choices, as are numbers that do not ascend. Others stand on a number line.

    Parameters
    ----------
    profile
        The network: this design.
    key
        Dotted key.
    axis
        Its values.
    as_cells
        If True, numbers that are not evenly spaced are choices, too: cells of a map are equally wide.
    """
    label, design = key_label(profile, key), value_at(profile, key)
    whole = axis.dtype != object and bool(np.equal(np.mod(axis, 1), 0).all())
    if axis.dtype != object and _is_on_a_line(axis, evenly=as_cells):
        inside = isinstance(design, int | float) and axis.min() <= design <= axis.max()
        return PlotScale(label, axis, (), whole, float(design) if inside else None)
    names = tuple(map(_name, axis.tolist()))
    return PlotScale(
        label, np.arange(axis.size), names, whole, names.index(_name(design)) if _name(design) in names else None
    )


def _is_on_a_line(values: Array, *, evenly: bool) -> bool:
    """Whether numbers ascend, in equal steps if `evenly`."""
    steps = np.diff(values)
    return bool((steps > 0).all() and (not evenly or np.allclose(steps, steps[:1], rtol=1e-6)))


def _name(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else value if isinstance(value, str) else f"{value:.6g}"


def key_label(profile: Profile, key: str) -> str:
    """Name a key in words, with its unit.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> profile = load("paper-4ms").profile
    >>> [key_label(profile, key) for key in ("cycle.period_us", "bus.gap_count", "payload.read_bytes")]
    ['period T_s, us', 'gap count', 'payload read, bytes']
    """
    setup = {f"bus.{setting.key}": setting for setting in bus_of(profile).figures.setup}
    figure = {"cycle.period_us": PERIOD, "bus.nodes": NODES, **setup}.get(key)
    if figure is not None:
        return figure_label(figure)
    unit = "" if key.endswith(_NO_UNITS) else unit_of(key)
    name = key.removesuffix(f"_{unit.replace('/', '_per_')}".lower()) if unit else key
    return ", ".join(filter(None, (name.replace(".", " ").replace("_", " "), unit)))


def figure_label(figure: Figure) -> str:
    """Name a figure with its unit, as a heading of a table does."""
    unit = figure.column or figure.unit
    return ", ".join(filter(None, (figure.label or figure.key, "" if unit in SILENT_UNITS else unit)))


def caption(plotted: Plotted) -> str:
    """Say what the figure shows, and where the cycle is shown to fit."""
    panel = plotted.described
    if panel is None:
        return f"No timing model gives {plotted.figure.label or plotted.figure.key} here."
    finite = panel.values[np.isfinite(panel.values)]
    design_value = plotted.design_value(panel)
    by = f"by the {panel.model} model"
    design = "" if design_value is None else f"; this design has {value_text(plotted, design_value)}"
    name = plotted.figure.label or plotted.figure.key
    if plotted.has_zero and panel.fits is None and finite.min() < 0 <= finite.max():
        settings = f"{int((finite >= 0).sum()):,} of {finite.size:,} settings"
        where = "in blue" if len(plotted.scales) > 1 else "above the dashed line"
        return f"A {name} of 0 or more in {settings} {by}, {where}{design}."
    least, most = value_text(plotted, float(finite.min())), value_text(plotted, float(finite.max()))
    spread = f"{least} to {most}"
    if least == most:
        spread = f"{least} at every setting" if finite.size > 1 else least
    return f"{name[:1].upper()}{name[1:]} {by}: {spread}{design}.{_fitting(plotted, panel)}"


def _fitting(plotted: Plotted, panel: SweptModel) -> str:
    """Say at how many settings the cycle is shown to fit, and how they are drawn."""
    if panel.fits is None:
        return ""
    fitting, settings = int(panel.fits.sum()), panel.fits.size
    if panel.frontier is None:
        return " Every setting is shown to fit." if fitting else " No setting is shown to fit."
    drawn = ", outside the grey"
    if len(plotted.scales) > 1:
        drawn = "" if is_constant(panel.values) else ", on one side of the line"
    return f" Shown to fit: {fitting:,} of {settings:,} settings{drawn}."


def value_text(plotted: Plotted, value: float) -> str:
    """Write a value of the figure with its unit."""
    shown = shown_value(value)._replace(unit=plotted.figure.column or plotted.figure.unit)
    return with_unit(shown._replace(value=value / factor_of(shown)))


def shown_value(value: float) -> ShownValue:
    """A number with enough digits, and all before the point."""
    return ShownValue(value, digits=max(_DIGITS, len(f"{abs(value):.0f}")))


def _ruler(scale: PlotScale, *, as_cells: bool, most: int = 6) -> Ruler:
    if scale.labels:
        return choices(scale.label, scale.labels, own=scale.design)
    half = (scale.places[1] - scale.places[0]) / 2 if as_cells and scale.places.size > 1 else 0.5 * as_cells
    low, high = float(scale.places[0] - half), float(scale.places[-1] + half)
    return numbers(scale.label, low, high, most=most, whole=scale.are_whole)


def _ends(plotted: Plotted) -> tuple[float, float]:
    """Smallest and largest value."""
    finite = [panel.values[np.isfinite(panel.values)] for panel in plotted.panels] or [np.zeros(1)]
    return float(min(values.min() for values in finite)), float(max(values.max() for values in finite))


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
    guides += [] if scale.design is None else [Guide(Entry("own", _DESIGN, shape="line"), x=scale.design)]
    marks = letters(panel.model for panel in plotted.panels)
    curves = (
        Curve(
            Entry(ink, f"{panel.model} model", mark, "line"),
            tuple(zip(scale.places.tolist(), _existing(panel.values), strict=True)),
            has_dots=bool(scale.labels) or scale.places.size <= _MOST_DOTS,
            has_line=not scale.labels,
        )
        for panel, mark, ink in zip(plotted.panels, marks, cycle(("first", "second")))
    )
    up = numbers(plotted.label, low, high, whole=is_count, room=_ROOM)
    return Panel(Curves(across, up, tuple(curves), tuple(guides), tuple(shades)))


def _existing(values: Array) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _runs(edges: list[float], chosen: Array) -> Iterator[tuple[float, float]]:
    """Ends of each run of chosen settings, to the middle between neighbours."""
    changes = np.flatnonzero(np.diff(chosen.astype(int), prepend=0, append=0)).tolist()
    return ((edges[start], edges[end]) for start, end in zip(changes[::2], changes[1::2], strict=True))


def _maps(plotted: Plotted) -> Iterator[Panel]:
    """A map for each timing model, all with the same colours; a figure that is always the same is said instead."""
    varying = tuple(panel for panel in plotted.panels if not is_constant(panel.values))
    for panel in plotted.panels:
        if is_constant(panel.values) and panel is not plotted.described:  # the caption tells of that
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


def _map(plotted: Plotted, panel: SweptModel, inner: list[float], levels: list[Entry]) -> ChartGrid:
    """Cells in the colours of their values, with the edge of what is shown to fit, unsafe settings and this design."""
    up, across = plotted.scales
    exists = np.isfinite(panel.values)
    levels_of = np.searchsorted(inner, np.where(exists, panel.values, 0.0), side="right")
    legend = list(levels)
    if panel.frontier is not None:
        legend.append(Entry("border", "edge of what is shown to fit", shape="line"))
    if panel.unsafe.any():
        legend.append(Entry("blank", f"unsafe {plotted.safety}", "!"))
    if up.design is not None and across.design is not None:
        legend.append(Entry("frame", _DESIGN))
    if not exists.all():
        legend.append(Entry("blank", "blank: no value"))
    looks = {
        (number, is_unsafe, fits): ChartCell(entry.ink, "!" if is_unsafe else "", is_inside=fits)
        for number, entry in enumerate(levels)
        for is_unsafe in (False, True)
        for fits in (None, False, True)
    }
    fits = np.full(panel.values.shape, None) if panel.fits is None else panel.fits
    rows = (
        tuple(
            looks[level, is_unsafe, is_inside] if value_exists else None
            for value_exists, level, is_unsafe, is_inside in zip(*(part.tolist() for part in parts), strict=True)
        )
        for parts in zip(exists, levels_of, panel.unsafe, fits, strict=True)
    )
    design = None if up.design is None or across.design is None else (across.design, up.design)
    return ChartGrid(
        _ruler(across, as_cells=True), _ruler(up, as_cells=True, most=8), tuple(rows), tuple(legend), design
    )
