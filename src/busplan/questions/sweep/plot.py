"""A figure of a sweep as a picture: curves over one key, heat maps over two."""

from typing import Final

import numpy as np

from busplan.buses.figure import VERDICT
from busplan.errors import BusplanError
from busplan.forms.blocks import Chart, Sentence
from busplan.forms.charts import Drawing
from busplan.questions.fit.certainty import FITS
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.grid import Grid
from busplan.questions.sweep.panels import sweep_drawing
from busplan.questions.sweep.plotted import Plotted, SweptModel, is_constant, key_label, plot_scale, plotted_figure
from busplan.questions.sweep.table import Columns
from busplan.sections.base import value_at

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
