"""Scales of a sweep's figure: what lies along an axis, in words and units, and where each value stands."""

from typing import Any, Final, NamedTuple

import numpy as np

from busplan.buses.figure import NODES, PERIOD, Figure, unit_of
from busplan.forms.blocks import figure_value
from busplan.forms.numbers import SILENT_UNITS, factor_of
from busplan.profile.kinds import words_of
from busplan.questions.fit.network import bus_of
from busplan.questions.sweep.asked import column_figures
from busplan.questions.sweep.grid import Array, Values
from busplan.sections.base import value_at
from busplan.sections.profile import Profile

_NO_UNITS: Final = ("_per_s", "_mbit_s", "_mm_s")
"""Ends of keys that a label keeps as they are."""


class PlotScale(NamedTuple):
    """One varied key along an axis."""

    label: str
    """What it is, with its unit."""
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


def plot_scale(profile: Profile, key: str, axis: Values, *, as_cells: bool) -> PlotScale:
    """Make the scale of a key.

    Words, and numbers of a key that takes words, too, such as a gap count, are choices; so are numbers that do not
    ascend. Others stand on a number line.

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
    values, own = axis.part(0, axis.size), value_at(profile, key)
    are_words = values.dtype == object or bool(words_of(profile, key))
    are_choices = are_words or not _on_a_line(values, evenly=as_cells)
    whole = values.dtype != object and bool(np.equal(np.mod(values, 1), 0).all())
    label = key_label(profile, key)
    if not are_choices:
        inside = isinstance(own, int | float) and values.min() <= own <= values.max()
        return PlotScale(label, values, (), whole, float(own) if inside else None)
    names = tuple(_name(one) for one in values.tolist())
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
    setup = {f"bus.{one.key}": one for one in bus_of(profile).figures.setup}
    figure = {"cycle.period_us": PERIOD, "bus.nodes": NODES, **setup}.get(key)
    if figure is not None:
        return figure_label(figure)
    unit = "" if key.endswith(_NO_UNITS) else unit_of(key)
    name = key.removesuffix(f"_{unit.replace('/', '_per_')}".lower()) if unit else key
    return ", ".join(filter(None, (name.replace(".", " ").replace("_", " "), unit)))


def plotted_figure(profile: Profile, name: str) -> tuple[Figure, float]:
    """The registered figure of a column, and the factor to the unit that it is drawn in.

    Parameters
    ----------
    profile
        The network.
    name
        Name of the column: a figure, or one of a group.
    """
    figure = column_figures(profile).get(name)
    if figure is None:
        return Figure(name, name, "", "", key_label(profile, name)), 1.0
    return figure, factor_of(figure_value(figure, 0.0))


def figure_label(figure: Figure) -> str:
    """Name a figure with its unit, as a heading of a table does."""
    unit = figure.column or figure.unit
    return ", ".join(filter(None, (figure.label or figure.key, "" if unit in SILENT_UNITS else unit)))
