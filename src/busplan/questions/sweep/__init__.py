"""`busplan.sweep`."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, NoReturn

import numpy as np

from busplan.buses.figure import TIMING_MODEL, unit_of
from busplan.errors import BusplanError
from busplan.extras import require_extra, require_pyarrow
from busplan.forms import ROWS_ENDINGS, RowsForm
from busplan.forms.blocks import Chart, Code, Report, Sentence
from busplan.forms.charts import Drawing
from busplan.forms.csv_rows import spelled
from busplan.progress import Progress, ignored
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import (
    Models,
    ProfileLike,
    checked_models,
    key_changes,
    load_network,
    with_its_constants,
)
from busplan.questions.circle import CIRCLE_BY_KEY
from busplan.questions.sweep.circles import CIRCLE_COLUMNS, circle_results, require_executor, summaries
from busplan.questions.sweep.digest import default_columns, sentences, top_rows
from busplan.questions.sweep.grid import Array, Columns, axis_values
from busplan.questions.sweep.plot import not_drawable, require_drawable, sweep_drawing
from busplan.questions.sweep.rows import arrow_table, written_rows
from busplan.questions.sweep.table import Sweep, checked_sweep, column_figures, figure_table
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    import xarray as xr

__all__ = ["SweepAnswer", "axis_values", "checked_sweep", "computed", "require_drawable", "sweep"]

_SHOWN: Final = 20
"""Rows of the report."""


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class SweepAnswer(Answer, Mapping[str, Array]):
    """Answer of `sweep`: columns by name, with a row for each point and timing model, in the order of the grid.

    `answer["max_axes"]` is a new array of shape (rows,): numbers (NaN if missing) or words ("" if missing).

    Parameters
    ----------
    sweep
        Its grid, timing models and options.
    table
        Its columns.
    """

    sweep: Sweep
    table: Columns

    @property
    def profile(self) -> Profile:
        """The network."""
        return self.sweep.profile

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns: the varied keys, the figures of `capacity`, and those of circle tests."""
        return tuple(self.table)

    def __getitem__(self, name: str) -> Array:
        if name not in self.table:
            raise KeyError(f"no column {name!r}; there are {', '.join(self.table)}")
        column = self.table[name]
        words = set(column.tolist()) if column.dtype == object else set()
        if name in self.sweep.numbers or all(isinstance(word, bool) for word in words):
            return column.copy()
        texts = {word: str(spelled(word)) for word in words}
        return np.array([texts[word] for word in column.tolist()])

    def __iter__(self) -> Iterator[str]:
        return iter(self.table)

    def __len__(self) -> int:
        return len(self.table)

    # A mapping would compare its columns: arrays, which have no single truth.
    __eq__, __hash__ = object.__eq__, object.__hash__

    def __array__(self, *_: object, **__: object) -> NoReturn:
        # pandas.DataFrame takes the columns of a dict alone; of this mapping it would make a column of their names.
        raise BusplanError("columns of several types are no array; to_pandas() gives a data frame, dict(answer) a dict")

    def to_pandas(self) -> "pd.DataFrame":
        """Make a data frame of pandas; words are categories.

        Raises
        ------
        BusplanError
            pandas is not installed.
        """
        require_extra("pandas", option="to_pandas()", module="pandas")
        import pandas as pd

        columns = {name: column.tolist() if column.dtype.kind == "U" else column for name, column in self.items()}
        words = {
            name: pd.Categorical([word or None for word in texts], [*dict.fromkeys(filter(None, texts))])
            for name, texts in columns.items()
            if isinstance(texts, list)
        }
        return pd.DataFrame({**columns, **words}).infer_objects()

    def to_xarray(self) -> "xr.Dataset":
        """Make a dataset of xarray: a dimension for each varied key, by its name, and `timing_model`.

        Each figure has its `units` and its `long_name`.

        Raises
        ------
        BusplanError
            xarray is not installed.
        """
        require_extra("xarray", option="to_xarray()", module="xarray")
        import xarray as xr

        sizes = {
            **{key: axis.size for key, axis in self.sweep.grid.axes.items()},
            TIMING_MODEL.key: len(self.sweep.timing_models),
        }
        figures = column_figures(self.sweep.network)
        variables = {
            name: (
                tuple(sizes),
                column.reshape(tuple(sizes.values())),
                {"units": figures[name].unit, "long_name": figures[name].meaning},
            )
            for name, column in self.items()
            if name not in sizes
        }
        coordinates = {key: (key, axis, {"units": unit_of(key)}) for key, axis in self.sweep.grid.axes.items()}
        return xr.Dataset(variables, {**coordinates, TIMING_MODEL.key: [*self.sweep.timing_models]})

    def to_arrow(self) -> "pa.Table":
        """Make a table of Apache Arrow (extra `table`): typed columns with unit and meaning, null where none is.

        Raises
        ------
        BusplanError
            pyarrow is not installed.
        """
        require_pyarrow("to_arrow()")
        return arrow_table(self.sweep, self.table)

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
        return b"".join(self.rows_in("json")).decode()

    def rows_in(self, form: RowsForm, columns: Sequence[str] | None = None) -> Iterator[bytes]:
        """Write every row, piece by piece.

        Parameters
        ----------
        form
            The form; "parquet" needs the extra `table`.
        columns
            Names of columns, behind the varied keys and the timing model; by default all.

        Raises
        ------
        BusplanError
            No such column.
        """
        names = self._behind_keys(columns or self.columns)
        return written_rows(form, self.sweep, {name: self.table[name] for name in names})

    def _behind_keys(self, columns: Iterable[str]) -> tuple[str, ...]:
        self.sweep.require_columns(columns, name="columns")
        return tuple(dict.fromkeys((*self.sweep.grid.axes, TIMING_MODEL.key, *columns)))

    def _contents(self) -> Mapping[str, Callable[[], str | bytes]]:
        rows = {ending: partial(self._bytes_in, form) for ending, form in ROWS_ENDINGS.items()}
        return {**Answer._contents(self), **rows}  # noqa: SLF001 - super() knows no class with slots made anew

    def _bytes_in(self, form: RowsForm) -> bytes:
        return b"".join(self.rows_in(form))

    def drawing(self, *, figure: str | None = None) -> Drawing:
        """Draw a figure over one or two varied keys: the picture of `busplan sweep --plot`.

        Parameters
        ----------
        figure
            Name of a column in numbers; by default the safe axes and, where these do not vary, the corrected margin.

        Raises
        ------
        BusplanError
            No column in numbers, more than two keys vary, or there are too many points.
        """
        self.sweep.require_number(figure, name="figure")
        title = ", ".join(filter(None, (self.profile.name, self.sweep.changes.words)))
        return sweep_drawing(self.sweep, self.table, title=title, figure=figure)

    def _repr_html_(self) -> str:
        from busplan.forms.html import fragment

        report = self._shown()
        if not not_drawable(self.sweep.grid):
            drawing = sweep_drawing(self.sweep, self.table, title=self.profile.name)
            report = report._replace(blocks=(*report.blocks, Chart(drawing, Sentence(drawing.words))))
        return fragment(report)

    def sentences(self) -> tuple[Sentence, ...]:
        """How many points there are, how many fit, and what is wrong at others."""
        return tuple(sentences(self.sweep, self.table))

    def report(
        self,
        *,
        columns: Sequence[str] | None = None,
        top: int = _SHOWN,
        sort_by: str | None = None,
        ascending: bool = False,
    ) -> Report:
        """The answer in blocks, with some rows.

        Parameters
        ----------
        columns
            Names of columns, behind the varied keys and the timing model, and before `sort_by`; by default the main
            ones.
        top
            Most rows.
        sort_by
            Column in numbers to sort by; by default rows are in the order of the grid.
        ascending
            Smallest first.

        Raises
        ------
        BusplanError
            No such column, or none in numbers.
        """
        self.sweep.require_number(sort_by, name="sort_by")
        shown = self._behind_keys((*(columns or default_columns(self.sweep)), *([sort_by] if sort_by else [])))
        rows = top_rows(self.sweep, self.table, columns=shown, top=top, sort_by=sort_by, ascending=ascending)
        return Report(Sentence(("Sweep of ", Code(self.profile.name))), (*self.sentences(), *rows), {})


@with_its_constants
def sweep(
    profile: ProfileLike,
    *,
    vary: Mapping[str, str | Iterable[object]],
    timing_model: Models | None = None,
    group: str | None = None,
    circle: bool = False,
    summary: bool = False,
    unlimited: bool = False,
    executor: Executor | None = None,
    progress: Progress = ignored,
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
    group
        Of a profile with groups, the name of the one whose nodes vary for the most and the safe nodes and axes; the
        others are as they are. By default that with the most axes.
    circle
        Also run the circle test of every point, and add its columns (errors in mm, margins).
    summary
        With `circle` and values of delivery.seed: a row for each point of the other keys, with mean, sample standard
        deviation, 95 % quantile and worst of each figure of the circle over the seeds, and the share that failed.
    unlimited
        Allow more than 1,000 circle tests.
    executor
        With `circle`: where the tests run, in chunks of about a second; by default in this thread. Any
        `concurrent.futures.Executor` gives the same answer, and is not shut down. Worker processes must have this
        version of busplan.
    progress
        Called now and then with the points, or the circle tests, that are done, and all of them [1].

    Returns
    -------
    SweepAnswer
        Columns by name, each an array of shape (points * timing models,), point by point, and for each point timing
        model by timing model.

    Raises
    ------
    BusplanError
        Not a profile, an invalid key or value, a point whose circle test cannot be run, or more than a million points.
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
    network = load_network(profile)
    models = None if timing_model is None else checked_models(timing_model, network)
    if not isinstance(vary, Mapping) or not vary or not all(isinstance(key, str) for key in vary):
        raise BusplanError(
            f'vary {vary!r}: expected keys of the profile and their values, as {{"bus.nodes": range(1, 17)}}'
        )
    checked = checked_sweep(
        network,
        vary,
        timing_models=models,
        group=group,
        circle=circle,
        summary=summary,
        unlimited=unlimited,
        changes=key_changes({f"constants.{name}": value for name, value in network.profile.constants}),
    )
    return computed(checked, executor=executor, progress=progress)


def computed(sweep: Sweep, *, executor: Executor | None = None, progress: Progress = ignored) -> SweepAnswer:
    """Compute a sweep.

    Parameters
    ----------
    sweep
        The sweep.
    executor, progress
        As for `sweep`.

    Raises
    ------
    BusplanError
        A point whose circle test cannot be run.
    Exception
        Any error that `executor` raises.
    """
    require_executor(executor, circle=sweep.circle)
    table = figure_table(sweep, progress=ignored if sweep.circle else progress)
    if sweep.circle:
        results = circle_results(sweep.profile, sweep.grid, sweep.tests, executor=executor, progress=progress)
        of_points = (
            {name: _typed(name, values) for name, values in zip(CIRCLE_COLUMNS, results, strict=True)}
            if sweep.seeds is None
            else summaries(results.reshape(len(CIRCLE_COLUMNS), sweep.grid.points, -1))
        )
        # One test a point, the same beside every timing model.
        models = len(sweep.timing_models)
        table |= {name: np.repeat(values, models) for name, values in of_points.items()}
    return SweepAnswer(sweep, table)


def _typed(name: str, values: Array) -> Array:
    """A figure of circles as numbers, or as truth values, None where one is missing."""
    if CIRCLE_BY_KEY[name].sort != "truth":
        return values
    return np.array([None if np.isnan(value) else bool(value) for value in values.tolist()])
