"""Circle tests over many seeds: how the figures of each point are spread, and how often the circle fails."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from math import nan, sqrt
from statistics import NormalDist
from types import MappingProxyType
from typing import Final

import numpy as np

from busplan.buses.figure import Figure
from busplan.errors import BusplanError
from busplan.questions.circle.figures import CIRCLE_BY_KEY
from busplan.questions.sweep.blocks import Column, SweepBlock
from busplan.questions.sweep.circles import CIRCLE_COLUMNS
from busplan.questions.sweep.grid import Array, Grid, Values

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
    own = CIRCLE_BY_KEY[key]
    words = _PARTS[part]
    better = "less" if part == "std" else own.better
    label = f"{own.label}, {part}"
    return own._replace(key=_key(key, part), meaning=words.format(own.meaning), label=label, better=better)


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


def without_seed(grid: Grid, *, option: str) -> tuple[Grid, Values]:
    """Split a grid into that of the other keys, and the seeds.

    Parameters
    ----------
    grid
        All varied keys.
    option
        Names of the option that asks for a summary and of the option that gives the values, for messages.

    Raises
    ------
    BusplanError
        No seed varies.
    """
    if SEED not in grid.axes:
        raise BusplanError(f"{option}: is over seeds, and none vary; add {SEED} and its values, as {SEED}=1:1000")
    return Grid({key: axis for key, axis in grid.axes.items() if key != SEED}), grid.axes[SEED]


def with_seeds(block: SweepBlock, results: Iterator[Array], seeds: int) -> SweepBlock:
    """Add the columns of a summary to a block: a circle test for each point and seed, the same beside every model.

    Parameters
    ----------
    block
        Its capacity.
    results
        Those of its points, each with every seed, and of those after them, each of shape (CIRCLE_COLUMNS,).
    seeds
        Tests of each point.
    """
    rows = [summary(np.array([*islice(results, seeds)])) for _ in range(block.chunk.points)]
    columns = {name: _column([row[name] for row in rows], shape=block.chunk.shape) for name in SUMMARY_COLUMNS}
    return block._replace(models=tuple({**figures, **columns} for figures in block.models))


def _column(values: Sequence[float], *, shape: tuple[int, ...]) -> Column:
    return Column(np.array(values).reshape(shape))


def summary(results: Array) -> dict[str, float]:
    """Summarise the circle tests of one point: `SUMMARY_COLUMNS`; NaN for what a circle lacks.

    Parameters
    ----------
    results
        Shape (seeds, CIRCLE_COLUMNS), as from `run_chunk`.
    """
    by_key = dict(zip(CIRCLE_COLUMNS, results.T, strict=True))
    judged = by_key["passed"][~np.isnan(by_key["passed"])]
    failed = float(np.sum(1 - judged)) if len(judged) else float("nan")
    spreads = (_spread(key, by_key[key]) for key in _SPREAD)
    numbers = (len(results), *_shares(failed, len(results)), *(number for own in spreads for number in own))
    return dict(zip(SUMMARY_COLUMNS, numbers, strict=True))


def _shares(failed: float, tests: int) -> tuple[float, ...]:
    """Share of tests that failed, and its 95 % interval.

    References
    ----------
    Wilson, Probable inference, the law of succession, and statistical inference, 1927.
    """
    z = NormalDist().inv_cdf((1 + _SHARE) / 2)
    middle = (failed + z**2 / 2) / (tests + z**2)
    half = z / (tests + z**2) * sqrt(failed * (tests - failed) / tests + z**2 / 4)
    # Exactly 0 and 1 at the ends, whatever rounding gives.
    low = 0.0 if failed == 0 else middle - half
    high = 1.0 if failed == tests else middle + half
    return failed / tests, low, high


def _spread(key: str, values: Array) -> tuple[float, ...]:
    """Mean, standard deviation, 95 % quantile and worst, in the order of `_PARTS`."""
    # From the first on, so that equal values have exactly their mean, and no deviation.
    off = values - values[0]
    std = float(np.std(off, ddof=1)) if values.size > 1 else nan
    is_more_better = CIRCLE_BY_KEY[key].better == "more"
    quantile = np.quantile(values, 1 - _SHARE if is_more_better else _SHARE)
    worst = values.min() if is_more_better else values.max()
    return float(values[0] + off.mean()), std, float(quantile), float(worst)
