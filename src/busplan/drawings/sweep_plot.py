"""A sweep as a matplotlib figure: curves over one key, heat maps over two. Needs the extra `plot`."""

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from busplan.analysis.sweep.blocks import SweepBlock
from busplan.analysis.sweep.grid import Array, Grid
from busplan.drawings.circle_plot import metadata, require_matplotlib
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_DRAWN: Final = 250_000
"""Most points of a figure: more would not be visible."""
_MAX_KEYS: Final = 2


def require_drawable(grid: Grid) -> None:
    """Refuse a grid that cannot be drawn, before it is computed.

    Raises
    ------
    BusplanError
        More than two keys vary, there are too many points, or matplotlib is not installed.
    """
    varied = [key for key, axis in grid.axes.items() if axis.size > 1]
    if len(varied) > _MAX_KEYS:
        raise BusplanError(f"--plot: draws one or two keys, and {', '.join(varied)} vary; give the others one value")
    if grid.points > MAX_DRAWN:
        raise BusplanError(f"--plot: {grid.points:,} points; a figure shows at most {MAX_DRAWN:,}")
    require_matplotlib()


class FigureData:
    """One figure over the whole grid under each timing model, collected block by block."""

    def __init__(self, grid: Grid, *, figure: str, timing_models: Sequence[str]) -> None:
        self._grid, self._figure, self._models = grid, figure, timing_models
        self._values = np.full((grid.points, len(timing_models)), np.nan)

    def add(self, block: SweepBlock) -> None:
        """Add a block."""
        start = block.chunk.start
        rows = block.rows(self._figure).reshape(-1, len(self._models))
        self._values[start : start + block.chunk.points] = rows

    def draw(self, title: str, *, file_format: str) -> bytes:
        """Draw the collected values, the timing models side by side; the same sweep gives the same bytes.

        Parameters
        ----------
        title
            Name of the profile.
        file_format
            png, svg or pdf.
        """
        from matplotlib import rc_context
        from matplotlib.figure import Figure

        varied = [key for key, axis in self._grid.axes.items() if axis.size > 1] or [next(iter(self._grid.axes))]
        buffer = BytesIO()
        with rc_context({"text.parse_math": False, "svg.hashsalt": "busplan"}):
            is_map = len(varied) == _MAX_KEYS
            figure = Figure(figsize=(6.0 * (len(self._models) if is_map else 1.3), 4.8), layout="constrained")
            fixed = ", ".join(
                f"{key} = {axis.part(0, 1)[0]}" for key, axis in self._grid.axes.items() if key not in varied
            )
            figure.suptitle(f"{title}: {self._figure}{f', {fixed}' if fixed else ''}")
            if is_map:
                self._maps(figure, varied)
            else:
                self._curves(figure.subplots(), varied[0])
            figure.savefig(buffer, format=file_format, dpi=120, metadata=metadata(file_format))
        return buffer.getvalue()

    def _curves(self, axes: "Axes", key: str) -> None:
        places, labels = self._places(key)
        # Mark single points only if there are few.
        marker = "." if len(places) <= 100 else ""  # noqa: PLR2004
        for number, model in enumerate(self._models):
            if np.isnan(self._values[:, number]).all():
                continue  # a figure that the model does not have
            axes.plot(places, self._values[:, number], label=model, marker=marker, linestyle=("-", "--")[number % 2])
        if labels is not None:
            axes.set_xticks(places, labels)
        axes.set_xlabel(key)
        axes.set_ylabel(self._figure)
        axes.grid(visible=True, linewidth=0.4, color="0.85")
        axes.legend(title="timing model")

    def _maps(self, figure: Any, varied: Sequence[str]) -> None:
        down, across = varied
        shape = (self._grid.axes[down].size, self._grid.axes[across].size)
        finite = self._values[np.isfinite(self._values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        (y, y_labels), (x, x_labels) = self._places(down), self._places(across)
        for number, axes in enumerate(figure.subplots(1, len(self._models), squeeze=False)[0]):
            image = axes.pcolormesh(
                x, y, self._values[:, number].reshape(shape), vmin=low, vmax=high, shading="nearest", rasterized=True
            )
            if x_labels is not None:
                axes.set_xticks(x, x_labels)
            if y_labels is not None:
                axes.set_yticks(y, y_labels)
            axes.set_xlabel(across)
            axes.set_ylabel(down)
            axes.set_title(f"{self._models[number]} model")
        figure.colorbar(image, ax=figure.axes, label=self._figure)

    def _places(self, key: str) -> tuple[Array, list[str] | None]:
        """Positions of a key's values along its axis, and their labels unless these are the numbers."""
        values = self._grid.axes[key].part(0, self._grid.axes[key].size)
        if values.dtype == object or not (np.diff(values) > 0).all():
            return np.arange(values.size), [str(one) for one in values]
        return values, None
