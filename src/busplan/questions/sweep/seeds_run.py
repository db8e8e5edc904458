"""Circle tests over many seeds: how the figures of each point are spread, and how often the circle fails."""

from collections.abc import Mapping
from statistics import NormalDist
from types import MappingProxyType
from typing import Final

import numpy as np

from busplan.buses.figure import Figure
from busplan.errors import BusplanError
from busplan.questions.circle import CIRCLE_BY_KEY
from busplan.questions.sweep.circles import CIRCLE_COLUMNS
from busplan.questions.sweep.grid import Array, Grid
from busplan.questions.sweep.table import Columns

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
        *(part for key in _SPREAD for part in _spread(key, by_key[key])),
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


def _spread(key: str, values: Array) -> tuple[Array, ...]:
    """Mean, standard deviation, 95 % quantile and worst, in the order of `_PARTS`."""
    # From the first on, so that equal values have exactly their mean, and no deviation.
    first = values[:, :1]
    off = values - first
    std = np.std(off, axis=1, ddof=1) if values.shape[1] > 1 else np.full(len(values), np.nan)
    is_more_better = CIRCLE_BY_KEY[key].better == "more"
    quantile = np.quantile(values, 1 - _SHARE if is_more_better else _SHARE, axis=1)
    worst = values.min(axis=1) if is_more_better else values.max(axis=1)
    return first[:, 0] + off.mean(axis=1), std, quantile, worst
