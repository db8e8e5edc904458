"""What a figure of a sweep shows, and its caption: one sentence that says what to see."""

from typing import NamedTuple

import numpy as np

from busplan.buses.figure import Figure
from busplan.forms.blocks import ShownValue
from busplan.forms.numbers import with_unit
from busplan.questions.sweep.grid import Array
from busplan.questions.sweep.scales import PlotScale, figure_label

_DIGITS = 4


class Panel(NamedTuple):
    """The values under one timing model."""

    model: str
    number: int
    """Number of the model among those asked for, from 0: its colour."""
    values: Array
    """In the unit of the label, shaped as the scales; NaN for a missing value."""
    unsafe: Array
    """Where the network is not set safely."""


class Plotted(NamedTuple):
    """A figure over one or two keys."""

    figure: Figure
    scales: tuple[PlotScale, ...]
    """Of two, the first lies up and the second across."""
    panels: tuple[Panel, ...]
    deciding: str
    """The timing model that decides."""
    safety: str
    """What must be set safely on this kind of bus."""

    @property
    def label(self) -> str:
        """What is drawn, with its unit."""
        return figure_label(self.figure)

    @property
    def has_zero(self) -> bool:
        """Whether the figure is a difference, whose zero is a limit."""
        return self.figure.scale is not None

    @property
    def any_unsafe(self) -> bool:
        """Whether a point is not set safely."""
        return any(bool(one.unsafe.any()) for one in self.panels)

    @property
    def told(self) -> Panel | None:
        """The panel that the caption tells of: that of the model that decides, where it has one."""
        return next((one for one in self.panels if one.model == self.deciding), next(iter(self.panels), None))

    def value_at_own(self, panel: Panel) -> float | None:
        """The figure at this design; None if it is no point of the grid."""
        places = []
        for one in self.scales:
            found = np.flatnonzero(one.places == one.own) if one.own is not None else np.array([], dtype=int)
            if not found.size:
                return None
            places.append(int(found[0]))
        value = float(panel.values[tuple(places)])
        return None if np.isnan(value) else value


def caption(plotted: Plotted) -> str:
    """Say in one sentence what the figure shows."""
    panel = plotted.told
    if panel is None:
        return f"No timing model gives {plotted.figure.label or plotted.figure.key} here."
    known = panel.values[np.isfinite(panel.values)]
    own = plotted.value_at_own(panel)
    by = f"by the {panel.model} model"
    design = "" if own is None else f"; this design has {_text(plotted, own)}"
    name = plotted.figure.label or plotted.figure.key
    if plotted.has_zero and known.min() < 0 <= known.max():
        fitting, line = int((known >= 0).sum()), "line" if len(plotted.scales) > 1 else "dashed line"
        settings = f"{fitting:,} of {known.size:,} settings"
        return f"A {name} of 0 or more in {settings} {by}, on one side of the {line}{design}."
    least, most = _text(plotted, float(known.min())), _text(plotted, float(known.max()))
    spread = least if least == most else f"{least} to {most}"
    return f"{name[:1].upper()}{name[1:]} {by}: {spread}{design}."


def _text(plotted: Plotted, value: float) -> str:
    unit = plotted.figure.column or plotted.figure.unit
    return with_unit(ShownValue(value, unit=unit, digits=_DIGITS))
