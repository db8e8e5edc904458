"""Circle tests over a grid: one for each point and timing model, in any process."""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from busplan.analysis.capacity.figures import figures
from busplan.analysis.circle.roundness import circle_test
from busplan.analysis.circle.setup import bus, loop_timing, setup
from busplan.analysis.network import model_names
from busplan.analysis.sweep.blocks import Column, SweepBlock, figure_names
from busplan.analysis.sweep.grid import Array, Grid
from busplan.errors import BusplanError
from busplan.profile.toml import override
from busplan.sections.profile import Profile

CIRCLE_COLUMNS: Final = (
    "mean_contour_error_mm",
    "max_contour_error_mm",
    "circular_deviation_mm",
    "phase_margin_deg",
    "gain_margin_db",
    "passed",
)
"""Columns of circle tests, named as in `circle-test`."""
MOST_CIRCLES_UNASKED: Final = 1000
"""Most circle tests without --force: minutes with numba, an hour without."""

Figures = tuple[float | bool | None, ...]


def all_columns(profile: Profile, grid: Grid, *, with_circle: bool) -> tuple[str, ...]:
    """All columns of a sweep: the varied keys, the figures of `capacity`, and those of circle tests."""
    return (*grid.axes, *figure_names(profile), *(CIRCLE_COLUMNS if with_circle else ()))


class CircleTask(NamedTuple):
    """The circle tests of one point; picklable."""

    profile: Profile
    changes: dict[str, object]
    timing_models: tuple[str, ...]


def run_task(task: CircleTask) -> list[Figures]:
    """Run the circle test of a point with each timing model deciding."""
    found: dict[str, Figures] = {}
    on_node: Figures | None = None
    for model in task.timing_models:
        profile = override(task.profile, {**task.changes, "bus.timing_model": model})
        if on_node is not None and bus(profile).fits:
            found[model] = on_node
            continue
        (result,) = circle_test(profile, explain=False).results
        found[model] = tuple(getattr(result, name) for name in CIRCLE_COLUMNS)
        if result.bus_fits and result.loop == "node":
            # A loop on the node depends only on whether the bus fits: the other models' circle is the same.
            on_node = found[model]
    return [found[model] for model in task.timing_models]


def require_circles(profile: Profile, grid: Grid) -> None:
    """Refuse a grid with a point whose circle test cannot be run, before any is run.

    Raises
    ------
    BusplanError
        The first such point and the reason: its period is no multiple of the step, the drive cannot reach the feed,
        or the circle is too short for its ramps.
    """
    for chunk in grid.chunks(1):
        changes = chunk.point(0)
        variant = override(profile, changes)
        try:
            # A point that fits under no model is not simulated.
            carried = any(figures(variant, model=model).fits for model in model_names(variant))
            _ = setup(variant) if carried else loop_timing(variant)
        except BusplanError as error:
            point = ", ".join(f"{key} = {value}" for key, value in changes.items())
            raise BusplanError(*(f"at {point}: {problem}" for problem in error.problems)) from None


def with_circles(
    profile: Profile,
    block: SweepBlock,
    *,
    timing_models: Sequence[str],
    run: Callable[[Iterable[CircleTask]], Iterable[list[Figures]]],
) -> SweepBlock:
    """Add the columns of circle tests to a block.

    Parameters
    ----------
    profile
        The network.
    block
        Capacity of the points.
    timing_models
        Timing models of the block.
    run
        Maps `run_task` over tasks, in this or other processes, in order.
    """
    models = tuple(timing_models)
    tasks = (CircleTask(profile, block.chunk.point(index), models) for index in range(block.chunk.points))
    results = list(run(tasks))
    return block._replace(
        models=tuple(
            {
                **figures,
                **{
                    name: Column(_array([point[number][place] for point in results]).reshape(block.chunk.shape))
                    for place, name in enumerate(CIRCLE_COLUMNS)
                },
            }
            for number, figures in enumerate(block.models)
        )
    )


def _array(values: Sequence[float | None]) -> Array:
    """Array of truth values, or of numbers with NaN for None."""
    if all(isinstance(value, bool) for value in values):
        return np.array(values, dtype=bool)
    return np.array([np.nan if value is None else value for value in values], dtype=float)
