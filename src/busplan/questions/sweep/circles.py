"""Circle tests at the points of a grid or a map: here, or in chunks by an executor, which all give the same results."""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from typing import Final

import numpy as np

from busplan.errors import BusplanError
from busplan.profile.document import override
from busplan.progress import Progress, part_of
from busplan.questions.circle import CircleFigures
from busplan.questions.circle.roundness import Estimate, announce, estimate, run_circles, setup_of
from busplan.questions.fit.circle_setup import refusals
from busplan.questions.fit.figures import figures
from busplan.questions.fit.grid import Array, Grid
from busplan.questions.fit.network import network_of
from busplan.sections.profile import Profile
from busplan.sourced import constants_changed

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
"""Most circle tests without unlimited=True: minutes compiled, an hour in plain Python."""
MOST_CIRCLES: Final = 100_000
"""Most circle tests of a sweep: an hour of several processors. Each has its values in memory."""
_ESTIMATED: Final = 100
"""Most points whose cost is estimated: that of others is like it."""
_CHUNK_S: Final = 1.5
"""Estimated time of a chunk: long beside the way to a worker, short enough to be lost."""
_EACH_S: Final = 0.002
"""Time of a test without its simulation."""
_FEWEST_CHUNKS: Final = 64
"""So many chunks, if there are tests enough, share out well."""


def require_executor(executor: object, *, circle: bool) -> None:
    """Refuse what is no `concurrent.futures.Executor`, and any without circle tests."""
    if executor is not None and not (circle and isinstance(executor, Executor)):
        wrong = f" {executor!r}: expected a concurrent.futures.Executor" if circle else ": needs circle=True"
        raise BusplanError(f"executor{wrong}")


def run_points(
    profile: Profile, points: Sequence[Point], *, executor: Executor | None, progress: Progress
) -> Iterator[CircleFigures]:
    """Circle tests of some points in their order; a long run is announced first.

    Each point has a circle that can be run, or a cycle that does not fit. Tests run in this thread without `executor`.
    """
    if not points:
        return
    cost = cost_of(profile, points)
    announce(cost)
    done, size = 0, chunk_tests(len(points), time_s=cost.time_s)
    # A list, for Dask takes no iterator.
    chunks = [(profile, points[start : start + size]) for start in range(0, len(points), size)]
    for results in map(_run_chunk, chunks) if executor is None else executor.map(_run_chunk, chunks):
        done += len(results)
        progress(done, len(points))
        yield from results


def _run_chunk(chunk: tuple[Profile, Sequence[Point]]) -> list[CircleFigures]:
    """Run the circle tests of some points, perhaps in another process."""
    profile, points = chunk
    with constants_changed(profile.constants):
        networks = (network_of(override(profile, point)) for point in points)
        return [result for network in networks for result in run_circles(network, explain=False).results]


def cost_of(profile: Profile, points: Sequence[Point]) -> Estimate:
    """Estimate what the circle tests of some points cost; of many, from some of them."""
    some = np.random.default_rng(0).permutation(len(points))[:_ESTIMATED]
    variants = (network_of(override(profile, points[number])) for number in some)
    fitting = (network for network in variants if figures(network, model=network.bus.deciding_model).fits)
    cost = estimate((), map(setup_of, fitting))
    times = len(points) / len(some)
    return cost._replace(steps=round(times * cost.steps), time_s=times * cost.time_s)


def chunk_tests(number: int, *, time_s: float) -> int:
    """Number of tests of a chunk: about a second of work, and fewer where there would be few chunks.

    `time_s` is the estimated time of all tests.

    Examples
    --------
    >>> chunk_tests(100_000, time_s=6000), chunk_tests(640, time_s=38), chunk_tests(10, time_s=100)
    (24, 10, 1)
    """
    by_time = int(_CHUNK_S / (time_s / number + _EACH_S))
    return max(1, min(by_time, number // _FEWEST_CHUNKS))


def circle_results(profile: Profile, grid: Grid, *, executor: Executor | None, progress: Progress) -> Array:
    """Results of the circle tests of a sweep: an array of shape (CIRCLE_COLUMNS, points), float64.

    Truth values are 0 and 1, what is missing is NaN. BusplanError: the first point whose circle test cannot be run,
    before any is run.
    """
    checking, testing = (part_of(progress, number=number, of=2) for number in range(2))
    for number, point in enumerate(grid.each_point(), start=1):
        causes = refusals(network_of(override(profile, point)))
        if causes:
            places = [[f"{key} = {value}" for key, value in point.items() if key != cause.name] for cause in causes]
            raise BusplanError(
                *(
                    f"at {', '.join(place)}: {cause.message}" if place else cause.message
                    for place, cause in zip(places, causes, strict=True)
                )
            )
        checking(number, grid.points)
    figures = np.empty((len(CIRCLE_COLUMNS), grid.points))
    results = run_points(profile, [*grid.each_point()], executor=executor, progress=testing)
    for place, result in enumerate(results):
        figures[:, place] = [getattr(result, name) for name in CIRCLE_COLUMNS]
    return figures


def require_few(grid: Grid, *, unlimited: bool) -> None:
    """Refuse more circle tests than anyone runs by mistake, and more than a sweep takes."""
    most = MOST_CIRCLES if unlimited else MOST_CIRCLES_UNASKED
    if grid.points > most:
        words = "a sweep takes; vary less" if unlimited else "are run without unlimited=True; vary less, or give it"
        raise BusplanError(f"circle=True: {grid.points:,} points are more circle tests than the {most:,} that {words}")
