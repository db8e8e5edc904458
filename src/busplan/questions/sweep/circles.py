"""Circle tests over a grid: one for each point, in any order and in any process."""

from collections.abc import Iterator
from itertools import islice
from typing import Final, NamedTuple

import numpy as np

from busplan.errors import BusplanError
from busplan.profile.toml import override
from busplan.questions.circle.figures import CIRCLE_BY_KEY
from busplan.questions.circle.roundness import circle_test
from busplan.questions.circle.setup import NOTHING, Estimate, bus, estimate, setup
from busplan.questions.fit.circle_refusal import require_circle
from busplan.questions.sweep.blocks import Column, SweepBlock
from busplan.questions.sweep.grid import Array, Grid
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
"""Most circle tests without --force: minutes compiled, an hour in plain Python."""

_TRUTHS: Final = (None, False, True)
"""Values of a column of truth values that may be missing, in the order of sorting."""


class CircleChunk(NamedTuple):
    """Some points next to each other; a process can be handed it."""

    profile: Profile
    start: int
    """Number of the first test, in the order of the grid."""
    points: tuple[dict[str, object], ...]
    """Values of the varied keys."""


def run_chunk(chunk: CircleChunk) -> Array:
    """Run the circle tests of a chunk.

    Returns
    -------
    Array
        Shape (points, CIRCLE_COLUMNS), as float64: truth values are 0 and 1, what is missing is NaN.
    """
    return np.array([_run(chunk.profile, point) for point in chunk.points], dtype=float)


def _run(profile: Profile, point: dict[str, object]) -> list[float | None]:
    (result,) = circle_test(override(profile, point), explain=False).results
    return [getattr(result, name) for name in CIRCLE_COLUMNS]


def require_few(grid: Grid, *, seeds: int, option: str, consent: str) -> None:
    """Refuse more circle tests than anyone runs by mistake.

    Parameters
    ----------
    grid
        The points.
    seeds
        Circle tests of each point.
    option, consent
        Options that request circle tests and that allow any number, for messages.

    Raises
    ------
    BusplanError
        There are too many.
    """
    if grid.points * seeds > MOST_CIRCLES_UNASKED:
        many = f"{grid.points:,} points" if seeds == 1 else f"{grid.points:,} points with {seeds:,} seeds each"
        raise BusplanError(
            f"{option}: {many} are more circle tests than the {MOST_CIRCLES_UNASKED:,} that are run without {consent}; "
            "vary less, or give it"
        )


def check_chunk(chunk: CircleChunk) -> Estimate:
    """Refuse a point whose circle test cannot be run; else say what all cost.

    Raises
    ------
    BusplanError
        The first such point and the reason.
    """
    cost = NOTHING
    for changes in chunk.points:
        variant = override(chunk.profile, changes)
        try:
            if bus(variant).fits:
                cost = cost.then(estimate((), [setup(variant)]))
            else:  # it has an answer, but no circle
                require_circle(variant)
        except BusplanError as error:
            point = ", ".join(f"{key} = {value}" for key, value in changes.items())
            raise BusplanError(*(f"at {point}: {problem}" for problem in error.problems)) from None
    return cost


def with_circles(block: SweepBlock, results: Iterator[Array]) -> SweepBlock:
    """Add the columns of circle tests to a block: one test a point, the same beside every timing model.

    Parameters
    ----------
    block
        Its capacity.
    results
        Those of its points, and of those after them, each of shape (CIRCLE_COLUMNS,).
    """
    columns = np.array([*islice(results, block.chunk.points)]).T.reshape(-1, *block.chunk.shape)
    circles = {name: _column(name, values) for name, values in zip(CIRCLE_COLUMNS, columns, strict=True)}
    return block._replace(models=tuple({**figures, **circles} for figures in block.models))


def _column(name: str, values: Array) -> Column:
    """Column of numbers, or of truth values, which may be missing."""
    if CIRCLE_BY_KEY[name].sort != "truth":
        return Column(values)
    missing = np.isnan(values)
    if missing.any():
        return Column(np.where(missing, 0, 1 + values).astype(np.uint8), _TRUTHS)
    return Column(values.astype(bool))
