"""Circle tests at the points of a grid or a map: here, or in chunks by an executor, which all give the same results."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from typing import Any, Final, NamedTuple, Protocol, TypeVar

import numpy as np

from busplan.buses.network import Network
from busplan.errors import BusplanError
from busplan.profile.document import override
from busplan.progress import Progress
from busplan.questions.circle.roundness import NOTHING, Estimate, announce, bus, circle_test, estimate, setup
from busplan.questions.fit.circle_refusal import require_circle
from busplan.questions.fit.network import network_of
from busplan.questions.sweep.grid import Array, Grid
from busplan.sections.profile import Profile

Task = TypeVar("Task")
Result = TypeVar("Result")
Point = dict[str, object]
"""Values by dotted key."""

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
"""Most circle tests without force=True: minutes compiled, an hour in plain Python."""
_ESTIMATED: Final = 100
"""Most points whose cost is estimated: that of others is like it."""
_CHUNK_S: Final = 1.5
"""Estimated time of a chunk: long beside the way to a worker, short enough to be lost."""
_EACH_S: Final = 0.002
"""Time of a test without its simulation."""
_FEWEST_CHUNKS: Final = 64
"""So many chunks, if there are tests enough, share out well."""


class Mapper(Protocol):
    """The built-in `map`, here or in other processes."""

    def __call__(self, function: Callable[[Task], Result], tasks: Iterable[Task], /) -> Iterable[Result]:
        """Return the results in the order of the tasks."""


def mapper_of(executor: object, *, circle: bool) -> Mapper:
    """The `map` of an executor; the built-in one without an executor.

    Raises
    ------
    BusplanError
        Not a `concurrent.futures.Executor`, or given without circle tests.
    """
    if executor is None:
        return map
    if not (circle and isinstance(executor, Executor)):
        wrong = f" {executor!r}: expected a concurrent.futures.Executor" if circle else ": goes with circle=True"
        raise BusplanError(f"executor{wrong}")
    mapper: Any = executor.map
    return mapper  # type: ignore[no-any-return]


class CircleOutcome(NamedTuple):
    """Result of a circle test."""

    figures: tuple[float | None, ...]
    """`CIRCLE_COLUMNS`; None for what the circle lacks."""
    failures: tuple[str, ...]
    """Keys of the tolerances that it breaks."""

    @property
    def passed(self) -> bool | None:
        """Whether it holds every tolerance; None where none judges it."""
        passed = self.figures[-1]
        return None if passed is None else bool(passed)


class CircleChunk(NamedTuple):
    """Some points; a process can be handed it."""

    profile: Profile
    points: Sequence[Point]


def run_chunk(chunk: CircleChunk) -> list[CircleOutcome]:
    """Run the circle tests of a chunk."""
    return [_outcome(network_of(override(chunk.profile, point))) for point in chunk.points]


def _outcome(network: Network) -> CircleOutcome:
    (result,) = circle_test(network, explain=False).results
    figures = tuple(getattr(result, name) for name in CIRCLE_COLUMNS)
    return CircleOutcome(figures, tuple(failure.name for failure in result.failures))


def circle_outcomes(
    profile: Profile, points: Sequence[Point], *, mapper: Mapper, progress: Progress
) -> Iterator[CircleOutcome]:
    """Run the circle tests of some points; a long run is announced first.

    Parameters
    ----------
    profile
        The network.
    points
        The points; each has a circle that can be run, or a cycle that does not fit.
    mapper
        How tests are run.
    progress
        Called with the tests that are done, and all of them.

    Yields
    ------
    CircleOutcome
        In the order of the points.
    """
    if not points:
        return
    cost = cost_of(profile, points)
    announce(cost)
    done, size = 0, chunk_tests(len(points), time_s=cost.time_s)
    # A list, for Dask takes no iterator.
    chunks = [CircleChunk(profile, points[start : start + size]) for start in range(0, len(points), size)]
    for outcomes in mapper(run_chunk, chunks):
        done += len(outcomes)
        progress(done, len(points))
        yield from outcomes


def cost_of(profile: Profile, points: Sequence[Point]) -> Estimate:
    """Estimate what the circle tests of some points cost; of many, from some of them."""
    some = np.random.default_rng(0).permutation(len(points))[:_ESTIMATED]
    cost = NOTHING
    for variant in (network_of(override(profile, points[number])) for number in some):
        if bus(variant).fits:
            cost = cost.then(estimate((), [setup(variant)]))
    times = len(points) / len(some)
    return cost._replace(steps=round(times * cost.steps), time_s=times * cost.time_s)


def chunk_tests(number: int, *, time_s: float) -> int:
    """Choose the tests of a chunk: about a second of work, and fewer where there would be few chunks.

    Parameters
    ----------
    number
        All tests.
    time_s
        Estimated time of all.

    Examples
    --------
    >>> chunk_tests(100_000, time_s=6000), chunk_tests(640, time_s=38), chunk_tests(10, time_s=100)
    (24, 10, 1)
    """
    by_time = int(_CHUNK_S / (time_s / number + _EACH_S))
    return max(1, min(by_time, number // _FEWEST_CHUNKS))


def circle_results(profile: Profile, grid: Grid, tests: Grid, *, mapper: Mapper, progress: Progress) -> Array:
    """Run the circle tests of a sweep.

    Parameters
    ----------
    profile
        The network.
    grid
        Points of its rows.
    tests
        The same with the seeds of each.
    mapper, progress
        As for `circle_outcomes`.

    Returns
    -------
    Array
        Shape (CIRCLE_COLUMNS, tests), as float64: truth values are 0 and 1, what is missing is NaN.

    Raises
    ------
    BusplanError
        The first point whose circle test cannot be run, before any is run.
    """
    for point in grid.each_point():
        _require(profile, point)
    outcomes = circle_outcomes(profile, [*tests.each_point()], mapper=mapper, progress=progress)
    return np.array([outcome.figures for outcome in outcomes], dtype=float).T


def _require(profile: Profile, point: Point) -> None:
    try:
        require_circle(network_of(override(profile, point)))
    except BusplanError as error:
        place = ", ".join(f"{key} = {value}" for key, value in point.items())
        raise BusplanError(*(f"at {place}: {problem}" for problem in error.problems)) from None


def require_few(grid: Grid, *, seeds: int) -> None:
    """Refuse more circle tests than anyone runs by mistake.

    Parameters
    ----------
    grid
        The points.
    seeds
        Circle tests of each point.

    Raises
    ------
    BusplanError
        There are too many.
    """
    if grid.points * seeds > MOST_CIRCLES_UNASKED:
        many = f"{grid.points:,} points" if seeds == 1 else f"{grid.points:,} points with {seeds:,} seeds each"
        raise BusplanError(
            f"circle=True: {many} are more circle tests than the {MOST_CIRCLES_UNASKED:,} that are run without "
            "force=True; vary less, or give it"
        )
