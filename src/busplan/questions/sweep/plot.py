"""A figure of a sweep as a picture: curves over one key, heat maps over two."""

from collections.abc import Iterable, Iterator
from itertools import cycle, pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from busplan.buses.figure import NODES, PERIOD, VERDICT, Figure, unit_of
from busplan.buses.network import Network
from busplan.errors import BusplanError
from busplan.forms.blocks import Chart, Sentence, ShownValue, figure_value
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
from busplan.questions.sweep.asked import Sweep, column_figures
from busplan.questions.sweep.grid import Array, Grid
from busplan.questions.sweep.table import Columns
from busplan.sections.base import value_at
from busplan.sections.profile import Profile

_DIGITS: Final = 4
_NO_UNITS: Final = ("_per_s", "_mbit_s", "_mm_s")
"""Ends of keys that a label keeps as they are."""


class PlotScale(NamedTuple):
    """One varied key along an axis."""

    label: str
    """Quantity along the axis, with its unit."""
    places: Array
    """Where its values stand: the values themselves, or 0, 1, 2 and so on for choices."""
    labels: tuple[str, ...]
    """Names of choices; empty on a number line."""
    are_whole: bool
    """Whether all values are whole numbers."""
    own: float | None
    """Place of this design; None if it is not on the axis."""

    @property
    def are_choices(self) -> bool:
        """Whether the values are choices that no number line joins."""
        return bool(self.labels)


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
    values, own = axis, value_at(profile, key)
    are_choices = values.dtype == object or not _on_a_line(values, evenly=as_cells)
    whole = values.dtype != object and bool(np.equal(np.mod(values, 1), 0).all())
    label = key_label(profile, key)
    if not are_choices:
        inside = isinstance(own, int | float) and values.min() <= own <= values.max()
        return PlotScale(label, values, (), whole, float(own) if inside else None)
    names = tuple(_name(value) for value in values.tolist())
    place = names.index(_name(own)) if _name(own) in names else None
    return PlotScale(label, np.arange(values.size), names, whole, place)


def _on_a_line(values: Array, *, evenly: bool) -> bool:
    """Whether numbers ascend, in equal steps if `evenly`."""
    steps = np.diff(values)
    return bool((steps > 0).all() and (not evenly or np.allclose(steps, steps[:1], rtol=1e-6)))


def _name(value: Any) -> str:
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


def plotted_figure(network: Network, name: str) -> tuple[Figure, float]:
    """The registered figure of a column, and the factor to the unit that it is drawn in.

    Parameters
    ----------
    network
        The network.
    name
        Name of the column: a figure, or one of a group.
    """
    figure = column_figures(network).get(name)
    if figure is None:
        return Figure(name, name, "", "", key_label(network.profile, name)), 1.0
    return figure, factor_of(figure_value(figure, 0.0))


def figure_label(figure: Figure) -> str:
    """Name a figure with its unit, as a heading of a table does."""
    unit = figure.column or figure.unit
    return ", ".join(filter(None, (figure.label or figure.key, "" if unit in SILENT_UNITS else unit)))


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
    known = values[np.isfinite(values)]
    return bool((known == known[:1]).all()) and known.size in (0, values.size)


class Plotted(NamedTuple):
    """A figure over one or two keys."""

    figure: Figure
    scales: tuple[PlotScale, ...]
    """Of two, the first is the y axis and the second the x axis."""
    panels: tuple[SweptModel, ...]
    deciding: str
    """The timing model that decides."""
    safety: str
    """The setting of this kind of bus that must be safe."""

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

    @property
    def told(self) -> SweptModel | None:
        """The panel that the caption tells of: that of the model that decides, where it has one."""
        return next((panel for panel in self.panels if panel.model == self.deciding), next(iter(self.panels), None))

    def value_at_own(self, panel: SweptModel) -> float | None:
        """The figure at this design; None if it is no point of the grid."""
        places = []
        for scale in self.scales:
            at_own = np.flatnonzero(scale.places == scale.own) if scale.own is not None else np.array([], dtype=int)
            if not at_own.size:
                return None
            places.append(int(at_own[0]))
        value = float(panel.values[tuple(places)])
        return None if np.isnan(value) else value


def caption(plotted: Plotted) -> str:
    """Say what the figure shows, and where the cycle is shown to fit."""
    panel = plotted.told
    if panel is None:
        return f"No timing model gives {plotted.figure.label or plotted.figure.key} here."
    known = panel.values[np.isfinite(panel.values)]
    own = plotted.value_at_own(panel)
    by = f"by the {panel.model} model"
    design = "" if own is None else f"; this design has {value_text(plotted, own)}"
    name = plotted.figure.label or plotted.figure.key
    if plotted.has_zero and panel.fits is None and known.min() < 0 <= known.max():
        settings = f"{int((known >= 0).sum()):,} of {known.size:,} settings"
        where = "in blue" if len(plotted.scales) > 1 else "above the dashed line"
        return f"A {name} of 0 or more in {settings} {by}, {where}{design}."
    least, most = value_text(plotted, float(known.min())), value_text(plotted, float(known.max()))
    spread = f"{least} to {most}"
    if least == most:
        spread = f"{least} at every setting" if known.size > 1 else least
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


def _map(plotted: Plotted, panel: SweptModel, inner: list[float], levels: list[Entry]) -> ChartGrid:
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
        (number, is_unsafe, fits): ChartCell(entry.ink, "!" if is_unsafe else "", is_inside=fits)
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
    return ChartGrid(_ruler(across, as_cells=True), _ruler(up, as_cells=True, most=8), tuple(rows), tuple(legend), own)


MAX_DRAWN: Final = 250_000
"""Most points of a figure: more would not be visible."""
_MAX_KEYS: Final = 2


_DEFAULT_FIGURES: Final = ("safe_axes", "margin_corrected_us", "margin_us")
"""Columns of which the first that varies is drawn, if none is asked for."""


def is_drawable(grid: Grid) -> bool:
    """Whether a figure over a grid can be drawn."""
    return not _not_drawable(grid)


def _not_drawable(grid: Grid) -> str:
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
    if reason := _not_drawable(grid):
        raise BusplanError(f"{option}: {reason}")


class FigureData:
    """One figure over the whole grid under each timing model.

    Parameters
    ----------
    sweep
        The sweep; its profile is this design, which the picture marks.
    table
        All its columns.
    figure
        Name of the column; by default the safe axes and, where these do not vary, the corrected margin.

    Raises
    ------
    BusplanError
        As `require_drawable`.
    """

    def __init__(self, sweep: Sweep, table: Columns, *, figure: str | None = None) -> None:
        require_drawable(sweep.grid)
        self._network, self._grid, self._models = sweep.network, sweep.grid, sweep.timing_models
        by_model = {name: column.reshape(-1, len(self._models)) for name, column in table.items()}
        self._values = {name: by_model[name].astype(float) for name in ((figure,) if figure else _DEFAULT_FIGURES)}
        bus = sweep.network.bus
        safe = by_model[bus.safety.figure.key].astype(bool) if bus.safety.figure else True
        self._unsafe = ~np.broadcast_to(safe, by_model[VERDICT.key].shape)
        self._fits = (by_model[VERDICT.key] == FITS).any(axis=1)

    def drawing(self, title: str) -> Drawing:
        """Draw the collected values.

        Parameters
        ----------
        title
            Name of the profile, and what was set.
        """
        plotted = self.plotted()
        return sweep_drawing(plotted, title=f"{title}: {plotted.label}{self._fixed()}")

    def chart(self) -> Chart:
        """The picture as a block of a page."""
        drawing = self.drawing(self._network.profile.name)
        return Chart(drawing, Sentence(drawing.words))

    def plotted(self) -> Plotted:
        """The picture's content, in words and in the unit of the figure."""
        keys = self._varied()
        name = self._drawn()
        figure, factor = plotted_figure(self._network, name)
        shape, bus = tuple(self._grid.axes[key].size for key in keys), self._network.bus
        panels = tuple(
            SweptModel(
                model,
                factor * values.reshape(shape),
                unsafe.reshape(shape),
                self._fits.reshape(shape) if model == bus.deciding_model else None,
            )
            for number, (model, values, unsafe) in enumerate(
                zip(self._models, self._values[name].T, self._unsafe.T, strict=True)
            )
            if not np.isnan(values).all()  # a figure that the model does not have
        )
        as_cells = len(keys) == _MAX_KEYS
        scales = tuple(plot_scale(self._network.profile, key, self._grid.axes[key], as_cells=as_cells) for key in keys)
        if not self._is_own():
            scales = tuple(scale._replace(own=None) for scale in scales)
        return Plotted(figure, scales, panels, bus.deciding_model, bus.safety.setting)

    def _drawn(self) -> str:
        """Name of the first figure that varies; if none does, of the first that a timing model has."""
        known = {name: values for name, values in self._values.items() if not np.isnan(values).all()}
        varying = (name for name, values in known.items() if not all(map(is_constant, values.T)))
        return next(varying, next(iter(known or self._values)))

    def _varied(self) -> list[str]:
        """Keys with several values; the only key if none has."""
        varied = [key for key, axis in self._grid.axes.items() if axis.size > 1]
        return varied or [next(iter(self._grid.axes))]

    def _single(self) -> dict[str, object]:
        """Keys with one value."""
        varied = self._varied()
        return {key: axis[:1].tolist()[0] for key, axis in self._grid.axes.items() if key not in varied}

    def _is_own(self) -> bool:
        """Whether the keys with one value have that of this design."""
        return all(value_at(self._network.profile, key) == value for key, value in self._single().items())

    def _fixed(self) -> str:
        return "".join(f"; {key_label(self._network.profile, key)}: {value}" for key, value in self._single().items())
