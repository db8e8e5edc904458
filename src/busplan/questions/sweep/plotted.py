"""The figure that a sweep's picture shows: its scales, its values under each timing model, and its caption."""

from typing import Any, Final, NamedTuple

import numpy as np

from busplan.buses.figure import NODES, PERIOD, Figure, unit_of
from busplan.buses.network import Network
from busplan.forms.blocks import ShownValue, figure_value
from busplan.forms.numbers import SILENT_UNITS, factor_of, with_unit
from busplan.questions.fit.network import bus_of
from busplan.questions.sweep.asked import column_figures
from busplan.questions.sweep.grid import Array
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
    >>> from busplan.profile.shipped import load
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
