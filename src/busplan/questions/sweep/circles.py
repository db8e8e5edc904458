"""Circle tests at the points of a grid or a map: here, or in chunks by an executor, which all give the same results.

A summary has one row for many seeds: how the figures are spread, and how often the circle fails.
"""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from statistics import NormalDist
from types import MappingProxyType
from typing import Final

import numpy as np

from busplan.buses.figure import Figure
from busplan.errors import BusplanError
from busplan.profile.document import override
from busplan.progress import Progress
from busplan.questions.circle import CIRCLE_BY_KEY, CircleFigures
from busplan.questions.circle.roundness import Estimate, announce, estimate, run_circles, setup_of
from busplan.questions.fit.circle_setup import refusals
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import network_of
from busplan.questions.sweep.grid import Array, Columns, Grid
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
_ESTIMATED: Final = 100
"""Most points whose cost is estimated: that of others is like it."""
_CHUNK_S: Final = 1.5
"""Estimated time of a chunk: long beside the way to a worker, short enough to be lost."""
_EACH_S: Final = 0.002
"""Time of a test without its simulation."""
_FEWEST_CHUNKS: Final = 64
"""So many chunks, if there are tests enough, share out well."""


def require_executor(executor: object, *, circle: bool) -> None:
    """Refuse what is no executor, and any without circle tests.

    Raises
    ------
    BusplanError
        Not a `concurrent.futures.Executor`, or given without circle tests.
    """
    if executor is not None and not (circle and isinstance(executor, Executor)):
        wrong = f" {executor!r}: expected a concurrent.futures.Executor" if circle else ": goes with circle=True"
        raise BusplanError(f"executor{wrong}")


def run_points(
    profile: Profile, points: Sequence[Point], *, executor: Executor | None, progress: Progress
) -> Iterator[CircleFigures]:
    """Run the circle tests of some points; a long run is announced first.

    Parameters
    ----------
    profile
        The network.
    points
        The points; each has a circle that can be run, or a cycle that does not fit.
    executor
        Where tests run; None for this thread.
    progress
        Called with the tests that are done, and all of them.

    Yields
    ------
    CircleFigures
        In the order of the points.
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


def circle_results(
    profile: Profile, grid: Grid, tests: Grid, *, executor: Executor | None, progress: Progress
) -> Array:
    """Run the circle tests of a sweep.

    Parameters
    ----------
    profile
        The network.
    grid
        Points of its rows.
    tests
        The same with the seeds of each.
    executor, progress
        As for `run_points`.

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
        causes = refusals(network_of(override(profile, point)))
        if causes:
            places = [[f"{key} = {value}" for key, value in point.items() if key != cause.name] for cause in causes]
            raise BusplanError(
                *(
                    f"at {', '.join(place)}: {cause.message}" if place else cause.message
                    for place, cause in zip(places, causes, strict=True)
                )
            )
    results = run_points(profile, [*tests.each_point()], executor=executor, progress=progress)
    return np.array([[getattr(result, name) for name in CIRCLE_COLUMNS] for result in results], dtype=float).T


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
            "unlimited=True; vary less, or give it"
        )


SEED: Final = "delivery.seed"
"""The key that a summary is over."""
_SHARE: Final = 0.95
_PARTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "mean": "mean over the seeds: {}",
        "std": "sample standard deviation over the seeds: {}",
        "p95": "what 95 % of the seeds are no worse than: {}",
        "worst": "worst of all seeds: {}",
    }
)
_SPREAD: Final = tuple(key for key in CIRCLE_COLUMNS if CIRCLE_BY_KEY[key].sort == "number")


def _key(key: str, part: str) -> str:
    """Name of a part: the unit stays the end.

    Examples
    --------
    >>> _key("max_contour_error_mm", "p95")
    'max_contour_error_p95_mm'
    """
    stem, _, unit = key.rpartition("_")
    return f"{stem}_{part}_{unit}"


def _figure(key: str, part: str) -> Figure:
    figure = CIRCLE_BY_KEY[key]
    words = _PARTS[part]
    better = "less" if part == "std" else figure.better
    label = f"{figure.label}, {part}"
    return figure._replace(key=_key(key, part), meaning=words.format(figure.meaning), label=label, better=better)


_OF_PASSED: Final = "share of the seeds whose circle fails, 0..1; null where a circle is not judged"
SUMMARY_FIGURES: Final = (
    Figure("seeds", "n", "profile", "circle tests, one for each seed", "seeds", "1", "count"),
    Figure("failed_share", "failed", "simulation", _OF_PASSED, "failed", "%", decimals=2, better="less"),
    *(
        Figure(
            f"failed_share_{end}",
            f"failed, {end}",
            "Wilson 1927",
            f"{end} end of its 95 % interval: what seeds that were not tested may give",
            f"failed, {end} end",
            "%",
            decimals=2,
            better="less",
        )
        for end in ("low", "high")
    ),
    *(_figure(key, part) for key in _SPREAD for part in _PARTS),
)
"""Figures of a summary, in place of the columns of circle tests."""
SUMMARY_COLUMNS: Final = tuple(figure.key for figure in SUMMARY_FIGURES)


def without_seed(grid: Grid) -> tuple[Grid, Array]:
    """Split a grid into that of the other keys, and the seeds.

    Parameters
    ----------
    grid
        All varied keys.

    Raises
    ------
    BusplanError
        No seed varies.
    """
    if SEED not in grid.axes:
        raise BusplanError(f"summary: is over seeds, and none vary; add {SEED} and its values, as {SEED}=1:1000")
    return Grid({key: axis for key, axis in grid.axes.items() if key != SEED}), grid.axes[SEED]


def summaries(results: Array) -> Columns:
    """Summarise circle tests over seeds: `SUMMARY_COLUMNS`; NaN for what a circle lacks.

    Parameters
    ----------
    results
        Shape (CIRCLE_COLUMNS, points, seeds), as from `circle_results`.

    Returns
    -------
    dict
        Each of shape (points,).
    """
    by_key = dict(zip(CIRCLE_COLUMNS, results, strict=True))
    points, seeds = by_key["passed"].shape
    # Where no error source matters, a seed says nothing of the tolerance.
    is_judged = ~np.isnan(by_key["passed"])
    failed = np.where(is_judged.any(axis=1), np.sum(is_judged & (by_key["passed"] == 0), axis=1), np.nan)
    columns = (
        np.full(points, seeds),
        *_shares(failed, seeds),
        *(part for key in _SPREAD for part in _spread(by_key[key])),
    )
    return dict(zip(SUMMARY_COLUMNS, columns, strict=True))


def _shares(failed: Array, tests: int) -> tuple[Array, ...]:
    """Share of tests that failed, and its 95 % interval.

    References
    ----------
    Wilson, Probable inference, the law of succession, and statistical inference, 1927.
    """
    z = NormalDist().inv_cdf((1 + _SHARE) / 2)
    middle = (failed + z**2 / 2) / (tests + z**2)
    half = z / (tests + z**2) * np.sqrt(failed * (tests - failed) / tests + z**2 / 4)
    # Exactly 0 and 1 at the ends, whatever rounding gives.
    low = np.where(failed == 0, 0.0, middle - half)
    high = np.where(failed == tests, 1.0, middle + half)
    return failed / tests, low, high


def _spread(values: Array) -> tuple[Array, ...]:
    """Mean, standard deviation, 95 % quantile and worst, in the order of `_PARTS`.

    Errors are worse the larger they are; margins are of the loop, the same with every seed.
    """
    # From the first on, so that equal values have exactly their mean, and no deviation.
    first = values[:, :1]
    off = values - first
    std = np.std(off, axis=1, ddof=1) if values.shape[1] > 1 else np.full(len(values), np.nan)
    return first[:, 0] + off.mean(axis=1), std, np.quantile(values, _SHARE, axis=1), values.max(axis=1)
