"""Run a sweep, its circle tests in chunks on any executor: the same blocks whatever the chunks and their order."""

from collections.abc import Generator, Iterable, Iterator
from itertools import groupby, islice
from typing import Final

from busplan.progress import Progress
from busplan.questions.circle.setup import NOTHING, Estimate, announce
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.blocks import CHUNK_POINTS, SweepBlock, sweep
from busplan.questions.sweep.circles import (
    MOST_CIRCLES_UNASKED,
    CircleChunk,
    check_chunk,
    run_chunk,
    with_circles,
)
from busplan.questions.sweep.execution import Here, Work, run_in_order
from busplan.questions.sweep.grid import Array
from busplan.questions.sweep.seeds_run import with_seeds
from busplan.sections.profile import Profile

_TITLE: Final = "sweep"
"""Name of the work in its progress."""
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


def sweep_blocks(asked: Sweep, work: Work, *, chunk_points: int = CHUNK_POINTS) -> Generator[SweepBlock, None, None]:
    """Compute a sweep; memory does not grow with the grid.

    Parameters
    ----------
    asked
        The sweep.
    work
        How it is run.
    chunk_points
        Largest number of points of a block; blocks with circle tests have their own.

    Yields
    ------
    SweepBlock
        In the order of the grid. Close it to end the work early.

    Raises
    ------
    BusplanError
        The first point whose circle test cannot be run, before any is run.
    Exception
        Any error that `work` raises.
    """
    if asked.circle:
        cost = require_circles(asked, work)
        with work.progress(_TITLE) as report:
            for block in _circle_blocks(asked, work, report, cost=cost):
                yield block
                work.watch()
        return
    with work.progress(_TITLE) as report:
        for block in sweep(asked.profile, asked.grid, timing_models=asked.timing_models, chunk_points=chunk_points):
            yield block
            report(block.chunk.start + block.chunk.points, asked.grid.points)
            work.watch()


def require_circles(asked: Sweep, work: Work) -> Estimate:
    """Refuse a grid with a point whose circle test cannot be run, before any is run; say what a long sweep costs.

    Parameters
    ----------
    asked
        The sweep.
    work
        How it is run; few points are checked in this thread.

    Raises
    ------
    BusplanError
        The first such point, as from `check_chunk`.
    """
    cost, points = NOTHING, asked.grid.points
    where = work.executor if points > MOST_CIRCLES_UNASKED else Here()
    chunks = _chunks(asked.profile, enumerate(asked.grid.each_point()), _CHECKED_AT_ONCE)
    with work.progress("check of the points") as report:
        for number, estimate in enumerate(run_in_order(where, check_chunk, chunks, watch=work.watch), start=1):
            cost = cost.then(estimate)
            report(min(number * _CHECKED_AT_ONCE, points), points)
    cost = cost._replace(steps=asked.tests_each * cost.steps, time_s=asked.tests_each * cost.time_s)
    announce(cost)
    return cost


def _circle_blocks(asked: Sweep, work: Work, report: Progress, *, cost: Estimate) -> Iterator[SweepBlock]:
    """Compute a sweep with its circle tests, whose cost is known."""
    done, kept = 0, work.kept

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
        report(done, asked.tests)

    size = chunk_tests(asked.tests, time_s=cost.time_s)
    runs = groupby(enumerate(asked.test_points()), key=lambda test: kept is not None and test[0] in kept)
    chunks = (chunk for _, run in runs for chunk in _chunks(asked.profile, run, size))
    chunk_results = run_in_order(work.executor, run_chunk, chunks, known=known, finished=finished, watch=work.watch)
    results = (row for chunk in chunk_results for row in chunk)
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
