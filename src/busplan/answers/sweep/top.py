"""A sweep for people: how many points fit, and the rows at the top."""

from collections.abc import Sequence
from math import isnan
from typing import Any, Final

import numpy as np

from busplan.analysis.sweep.blocks import Block
from busplan.buses.bus import Bus
from busplan.forms.lines import BLANK, Line, plural, table, us, yes

DEFAULT_COLUMNS: Final = (
    "required_us",
    "available_us",
    "margin_us",
    "utilisation",
    "max_nodes",
    "max_axes",
    "limited_by",
    "fits",
)
"""Figures of a table where none were asked for."""
CIRCLE_COLUMNS: Final = ("mean_contour_error_mm", "max_contour_error_mm", "phase_margin_deg", "passed")
"""And those of circle tests."""


class Tally:
    """Counts a sweep's points, and those that fit, block by block.

    Parameters
    ----------
    bus
        The kind of bus.
    timing_models
        The timing models, in the order of the rows of a point.
    """

    def __init__(self, bus: Bus, timing_models: Sequence[str]) -> None:
        self.points = 0
        self._bus = bus
        self._models = timing_models
        self._fits = [0] * len(timing_models)
        self._unsafe = 0
        self._passed: list[int] | None = None

    @property
    def rows(self) -> int:
        """Rows so far: a point has one under each timing model."""
        return self.points * len(self._models)

    def add(self, block: Block) -> None:
        """Count one more block."""
        points = block.chunk.points
        self.points += points
        for number, figures in enumerate(block.models):
            self._fits[number] += _share(figures["fits"].values, points)
        safety = self._bus.safety_figure
        if safety is not None:
            # The same under every model: how the bus is set is the profile's.
            self._unsafe += points - _share(block.models[0][safety.key].values, points)
        if "passed" in block.models[0]:
            passed = [_share(figures["passed"].values, points) for figures in block.models]
            before = self._passed or [0] * len(passed)
            self._passed = [old + new for old, new in zip(before, passed, strict=True)]

    def lines(self, name: str, *, expected: int) -> list[Line]:
        """Summary of all that was counted."""
        cut = "" if self.points == expected else f" of {expected:,} (interrupted)"
        noun = "point" if self.points == 1 else "points"
        found = [Line(f"{name}: {self.points:,} {noun}{cut}; {self._by_model(self._fits)} fit.")]
        if self._passed is not None:
            found.append(Line(f"The circle holds every tolerance at {self._by_model(self._passed)}."))
        safety = self._bus.safety_figure
        if self._unsafe and safety is not None:
            found.append(
                Line(f"At {self._unsafe:,} points the {self._bus.safety} is unsafe ({safety.key}).", "warning")
            )
        return found

    def _by_model(self, counts: Sequence[int]) -> str:
        return " and ".join(
            f"{count:,} by the {model} model" for count, model in zip(counts, self._models, strict=True)
        )


def _share(flags: Any, points: int) -> int:
    """How many points of a block a flag holds for, from its values before they broadcast."""
    count = int(flags.sum())
    return count * (points // int(flags.size))


class TopRows:
    """The first rows of a sweep, or those with the largest or smallest of one figure, in bounded memory.

    Parameters
    ----------
    columns
        Columns to keep.
    sort_by
        Column to sort by; without it rows stay in the order of the grid.
    ascending
        Smallest first.
    top
        How many rows.
    """

    def __init__(self, columns: Sequence[str], *, sort_by: str | None, ascending: bool, top: int) -> None:
        self._columns, self._sort_by, self._top = columns, sort_by, top
        self._sign = 1.0 if ascending else -1.0
        self._kept: list[tuple[float, dict[str, Any]]] = []

    def add(self, block: Block) -> None:
        """Take one more block."""
        if self._sort_by is None:
            rows = block.chunk.points * len(block.models)
            chosen = range(min(rows, self._top - len(self._kept)))
            self._kept += [(0.0, block.row(index, self._columns)) for index in chosen]
            return
        ranks = self._sign * block.rows(self._sort_by).astype(float)
        worst = self._kept[-1][0] if len(self._kept) >= self._top else np.inf
        # What does not exist (NaN) has no rank; of equals, the first in the grid stays.
        better = np.flatnonzero(ranks < worst)
        best = better[np.argsort(ranks[better], kind="stable")[: self._top]]
        self._kept += [(float(ranks[index]), block.row(int(index), self._columns)) for index in best]
        self._kept = sorted(self._kept, key=lambda pair: pair[0])[: self._top]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows, the best first."""
        return [row for _, row in self._kept]

    def lines(self, tally: Tally, name: str, *, expected: int) -> list[Line]:
        """Summary and table."""
        total = tally.rows
        order = (
            "" if self._sort_by is None else f", {'smallest' if self._sign > 0 else 'largest'} {self._sort_by} first"
        )
        shown = (
            f"{len(self._kept)} of {total:,} rows{order}"
            if len(self._kept) < total
            else f"{plural(total, 'row')}{order}"
        )
        cells = [[_cell(column, row[column]) for column in self._columns] for row in self.rows]
        return [
            *tally.lines(name, expected=expected),
            Line(f"{shown}."),
            BLANK,
            *table(self._columns, cells, left=0),
        ]


def _cell(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return yes(value)
    if isinstance(value, float):
        if isnan(value):
            return "-"
        return f"{value:.6f}" if name.endswith("_mm") else us(value)
    return " ".join(value) or "-" if isinstance(value, list) else str(value)
