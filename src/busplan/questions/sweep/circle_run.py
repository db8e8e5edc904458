"""Run the circle tests of a grid in chunks, on any executor: the same blocks whatever the chunks and their order."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from itertools import groupby, islice
from typing import Final, Protocol

from busplan.questions.circle.estimate import NOTHING, Estimate, announce
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.blocks import SweepBlock, sweep
from busplan.questions.sweep.circles import (
    MOST_CIRCLES_UNASKED,
    CircleChunk,
    check_chunk,
    run_chunk,
    with_circles,
)
from busplan.questions.sweep.execution import Here, ignored, run_in_order
from busplan.questions.sweep.grid import Array
from busplan.questions.sweep.seeds_run import with_seeds
from busplan.sections.profile import Profile

_CHUNK_S: Final = 1.5
"""Estimated time of a chunk: long beside the way to a worker, short enough to be lost."""
_EACH_S: Final = 0.002
"""Time of a test without its simulation."""
_FEWEST_CHUNKS: Final = 64
"""So many chunks, if there are tests enough, share out well."""
_CHECKED_AT_ONCE: Final = 500
"""Points of a chunk that is only checked: about a second."""
_BLOCKS: Final = 1000
_BLOCK_TESTS: Final = range(16, 4097)
"""Tests of a block: by the grid alone, so that any executor gives the same row groups."""


class Kept(Protocol):
    """Results of earlier runs, and a place for new ones."""

    def __contains__(self, test: int, /) -> bool:
        """Whether a test is known, by its number."""

    def results(self, start: int, count: int) -> Array:
        """Results of known tests, as from `run_chunk`."""

    def add(self, start: int, results: Array) -> None:
        """Keep the results of a chunk."""


def require_circles(
    asked: Sweep,
    executor: Executor,
    *,
    progress: Callable[[int], None] = ignored,
    watch: Callable[[], None] = ignored,
) -> Estimate:
    """Refuse a grid with a point whose circle test cannot be run, before any is run; say what a long sweep costs.

    Parameters
    ----------
    asked
        The sweep.
    executor
        Where many points are checked.
    progress
        Called with the number of points that are checked, in the order of the grid.
    watch
        As in `run_in_order`.

    Raises
    ------
    BusplanError
        The first such point, as from `check_chunk`.
    """
    cost = NOTHING
    where = executor if asked.grid.points > MOST_CIRCLES_UNASKED else Here()
    chunks = _chunks(asked.profile, enumerate(asked.grid.each_point()), _CHECKED_AT_ONCE)
    for number, one in enumerate(run_in_order(where, check_chunk, chunks, watch=watch), start=1):
        cost = cost.then(one)
        progress(min(number * _CHECKED_AT_ONCE, asked.grid.points))
    cost = cost._replace(steps=asked.tests_each * cost.steps, time_s=asked.tests_each * cost.time_s)
    announce(cost)
    return cost


def circle_blocks(
    asked: Sweep,
    executor: Executor,
    *,
    cost: Estimate,
    kept: Kept | None = None,
    progress: Callable[[int], None] = ignored,
    watch: Callable[[], None] = ignored,
) -> Iterator[SweepBlock]:
    """Compute a sweep with its circle tests.

    Parameters
    ----------
    asked
        The sweep.
    executor
        Where they run; it is not shut down.
    cost
        What all of them cost, from `require_circles`.
    kept
        What need not be computed, and takes what was.
    progress
        Called with the number of tests that are done, in whatever order.
    watch
        As in `run_in_order`.

    Yields
    ------
    SweepBlock
        In the order of the grid.

    Raises
    ------
    Exception
        As `run_in_order`.
    """
    done = 0

    def known(chunk: CircleChunk) -> Array | None:
        if kept is None or chunk.start not in kept:
            return None
        count(chunk)
        return kept.results(chunk.start, len(chunk.points))

    def finished(chunk: CircleChunk, results: Array) -> None:
        if kept is not None:
            kept.add(chunk.start, results)
        count(chunk)

    def count(chunk: CircleChunk) -> None:
        nonlocal done
        done += len(chunk.points)
        progress(done)

    size = chunk_tests(asked.tests, time_s=cost.time_s)
    runs = groupby(enumerate(asked.test_points()), key=lambda test: kept is not None and test[0] in kept)
    chunks = (chunk for _, run in runs for chunk in _chunks(asked.profile, run, size))
    found = run_in_order(executor, run_chunk, chunks, known=known, finished=finished, watch=watch)
    results = (row for chunk in found for row in chunk)
    most = max(1, _within(asked.tests // _BLOCKS, _BLOCK_TESTS) // asked.tests_each)
    for block in sweep(asked.profile, asked.grid, timing_models=asked.timing_models, chunk_points=most):
        yield with_circles(block, results) if asked.seeds is None else with_seeds(block, results, asked.tests_each)


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


def _within(number: int, bounds: range) -> int:
    return min(max(number, bounds[0]), bounds[-1])


def _chunks(profile: Profile, points: Iterable[tuple[int, dict[str, object]]], most: int) -> Iterator[CircleChunk]:
    left = iter(points)
    while part := list(islice(left, most)):
        yield CircleChunk(profile, part[0][0], tuple(point for _, point in part))
