"""`busplan.sweep`.

A sweep that is too large for memory is computed block by block: `checked_sweep`, `sweep_blocks`, and a `Digest`, a
`FigureData` or a writer that takes the blocks.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, NoReturn

import numpy as np

from busplan.errors import BusplanError
from busplan.extras import require_extra, require_pyarrow
from busplan.forms import ROWS_ENDINGS, RowsForm
from busplan.forms.blocks import Report
from busplan.forms.charts import Drawing
from busplan.forms.csv_rows import spelled
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Models, ProfileLike, checked_models, load_profile
from busplan.questions.sweep.asked import Sweep, checked_sweep
from busplan.questions.sweep.blocks import Column, SweepBlock
from busplan.questions.sweep.circle_run import sweep_blocks
from busplan.questions.sweep.digest import Digest, default_columns
from busplan.questions.sweep.execution import Here, Work, require_executor
from busplan.questions.sweep.grid import Array, Grid
from busplan.questions.sweep.plot import FigureData, is_drawable
from busplan.questions.sweep.rows import rows_writer
from busplan.questions.sweep.values import axis_values
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa

__all__ = [
    "Digest",
    "FigureData",
    "Here",
    "SweepAnswer",
    "Work",
    "axis_values",
    "checked_sweep",
    "default_columns",
    "rows_writer",
    "sweep",
    "sweep_blocks",
]

MOST_POINTS: Final = 2_000_000
"""Most points, about half a gigabyte of memory. The command line has no such limit."""
_SHOWN: Final = 20
"""Rows of the report."""


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class SweepAnswer(Answer, Mapping[str, Array]):
    """Answer of `sweep`: columns by name, with a row for each point and timing model, in the order of the grid.

    `answer["max_axes"]` is a new array of shape (rows,): numbers (NaN if missing) or words ("" if missing).

    Parameters
    ----------
    sweep
        The sweep as asked for.
    blocks
        The figures, block by block.
    """

    sweep: Sweep
    blocks: tuple[SweepBlock, ...]

    @property
    def profile(self) -> Profile:
        """The network."""
        return self.sweep.profile

    @property
    def grid(self) -> Grid:
        """The varied keys and their values."""
        return self.sweep.grid

    @property
    def timing_models(self) -> tuple[str, ...]:
        """The timing models, in the order of the rows of a point."""
        return self.sweep.timing_models

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns: the varied keys, the figures of `capacity`, and those of circle tests."""
        return self.sweep.columns

    def __getitem__(self, name: str) -> Array:
        if name not in self.columns:
            raise KeyError(f"no column {name!r}; there are {', '.join(self.columns)}")
        return np.concatenate(
            [block.interleaved([_spelled(column) for column in block.columns(name)]) for block in self.blocks]
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    # A mapping would compare its columns: arrays, which have no single truth.
    __eq__, __hash__ = object.__eq__, object.__hash__

    def __array__(self, *_: object, **__: object) -> NoReturn:
        # pandas.DataFrame takes the columns of a dict alone; of this mapping it would make a column of their names.
        raise BusplanError("columns of several types are no array; to_pandas() gives a data frame, dict(answer) a dict")

    def to_arrow(self) -> "pa.Table":
        """Make a table of Apache Arrow (extra `table`): typed columns with unit and meaning, null where none is.

        Raises
        ------
        BusplanError
            pyarrow is not installed.
        """
        require_pyarrow("to_arrow()")
        from busplan.questions.sweep.parquet import arrow_table

        return arrow_table(self.sweep, self.blocks)

    def to_pandas(self) -> "pd.DataFrame":
        """Make a data frame of pandas from `to_arrow`; words are categories.

        Raises
        ------
        BusplanError
            pandas or pyarrow is not installed.
        """
        require_extra("pandas", option="to_pandas()", module="pandas")
        require_pyarrow("to_pandas()")
        return self.to_arrow().to_pandas()

    def to_polars(self) -> "pl.DataFrame":
        """Make a data frame of polars from `to_arrow`; words are categories.

        Raises
        ------
        BusplanError
            polars or pyarrow is not installed.
        """
        require_extra("polars", option="to_polars()", module="polars")
        require_pyarrow("to_polars()")
        import polars as pl

        return pl.DataFrame(self.to_arrow())

    def to_json(self) -> str:
        """Write the document of `busplan sweep --format json`."""
        return self._rows_in("json").decode()

    def _contents(self) -> Mapping[str, Callable[[], str | bytes]]:
        rows = {ending: partial(self._rows_in, form) for ending, form in ROWS_ENDINGS.items()}
        return {**Answer._contents(self), **rows}  # noqa: SLF001 - super() knows no class with slots made anew

    def drawing(self) -> Drawing:
        """The picture of `busplan sweep --plot`.

        Raises
        ------
        BusplanError
            More than two keys vary, or there are too many points.
        """
        return self._figure().drawing(self.profile.name)

    def _repr_html_(self) -> str:
        from busplan.forms.html import fragment

        report = self._shown()
        charts = [self._figure().chart()] if is_drawable(self.grid) else []
        return fragment(report._replace(blocks=lambda: (*report.blocks(), *charts)))

    def _figure(self) -> FigureData:
        figure = FigureData(self.sweep)
        for block in self.blocks:
            figure.add(block)
        return figure

    def _rows_in(self, form: RowsForm) -> bytes:
        """Every row in a form."""
        written: list[bytes] = []
        writer = rows_writer(form, self.sweep, written.append)
        for block in self.blocks:
            writer.add(block)
        writer.finish(complete=True)
        return b"".join(written)

    def report(self) -> Report:
        """The answer in blocks."""
        shown = dict.fromkeys((*self.grid.axes, "timing_model", *default_columns(self.sweep)))
        digest = Digest(self.sweep._replace(columns=tuple(shown)), top=_SHOWN)
        for block in self.blocks:
            digest.add(block)
        return digest.report(document=lambda: json.loads(self.to_json()))


def _spelled(column: Column) -> Array:
    if column.words is None:
        return column.values
    if any(isinstance(word, bool) for word in column.words):
        return np.array(column.words, dtype=object)[column.values]
    words: Array = np.array([str(spelled(word)) for word in column.words])
    return words[column.values]


def sweep(
    profile: ProfileLike,
    *,
    vary: Mapping[str, str | Iterable[object]],
    timing_model: Models | None = None,
    circle: bool = False,
    summary: bool = False,
    force: bool = False,
    executor: Executor | None = None,
) -> SweepAnswer:
    """Compute capacity over a grid: any keys of the profile, every combination.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    vary
        Values by dotted key, in the key's unit: a list, range or array of shape (n,), or text as on the command line:
        "250:8000:250". They may include words that a key takes, such as "optimal". The last key changes fastest.
    timing_model
        Name of a timing model, or several in this order; by default all of the kind of bus. IEEE 1394 has "paper" for
        the paper's equations as published, and "standard" for the standard's clock and packets.
    circle
        Also run the circle test of every point, and add its columns (errors in mm, margins).
    summary
        With `circle` and values of delivery.seed: a row for each point of the other keys, with mean, sample standard
        deviation, 95 % quantile and worst of each figure of the circle over the seeds, and the share that failed.
    force
        Allow more than 1,000 circle tests.
    executor
        With `circle`: where the tests run, in chunks of about a second; by default in this thread. Any
        `concurrent.futures.Executor` gives the same answer, and is not shut down. Worker processes must have this
        version of busplan.

    Returns
    -------
    SweepAnswer
        Columns by name, each an array of shape (points * timing models,), point by point, and for each point timing
        model by timing model.

    Raises
    ------
    BusplanError
        Not a profile, an invalid key or value, a point whose circle test cannot be run, or too many points.
    Exception
        Any error that `executor` raises.

    References
    ----------
    Paper, equations (1)-(11).

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.sweep("paper-4ms", vary={"cycle.period_us": [500, 1000, 4000]}, timing_model="standard")
    >>> answer["safe_axes"]
    array([ 4, 12, 52])
    >>> answer["limited_by"].tolist()
    ['time', 'time', 'time']
    """
    require_executor(executor, circle=circle)
    network = load_profile(profile)
    models = None if timing_model is None else checked_models(timing_model, network)
    if not isinstance(vary, Mapping) or not vary or not all(isinstance(key, str) for key in vary):
        raise BusplanError(
            f'vary {vary!r}: expected keys of the profile and their values, as {{"bus.nodes": range(1, 17)}}'
        )
    if summary and not circle:
        raise BusplanError("summary=True: goes with circle=True")
    asked = checked_sweep(network, vary, timing_models=models, circle=circle, summary=summary, force=force)
    if asked.grid.points > MOST_POINTS:
        raise BusplanError(
            f"vary: {asked.grid.points:,} points are more than the {MOST_POINTS:,} that are kept in memory; vary less, "
            "or write them with busplan sweep -o FILE.csv"
        )
    return SweepAnswer(asked, tuple(sweep_blocks(asked, Work(executor or Here()))))
