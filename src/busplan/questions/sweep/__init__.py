"""`busplan.sweep`."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, NoReturn

import numpy as np

from busplan.buses.figure import TIMING_MODEL, unit_of
from busplan.errors import BusplanError
from busplan.extras import require_extra, require_pyarrow
from busplan.forms import ROWS_ENDINGS, RowsForm
from busplan.forms.blocks import Report, Sentence
from busplan.forms.csv_rows import spelled
from busplan.progress import Progress, ignored
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    Models,
    ProfileLike,
    checked_models,
    key_changes,
    load_network,
    with_its_constants,
)
from busplan.questions.circle import CIRCLE_BY_KEY
from busplan.questions.fit.grid import Array
from busplan.questions.sweep.circles import CIRCLE_COLUMNS, circle_results, require_executor
from busplan.questions.sweep.digest import Digest
from busplan.questions.sweep.rows import arrow_table, written_rows
from busplan.questions.sweep.table import Part, Sweep, checked_sweep, column_figures, parts_of
from busplan.questions.sweep.values import axis_values
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    import xarray as xr

__all__ = ["SHOWN", "Digest", "SweepAnswer", "axis_values", "checked_sweep", "computed", "sweep", "written_rows"]

SHOWN: Final = 20
"""Rows of the report."""


@dataclass(frozen=True, repr=False, eq=False)
class SweepAnswer(Answer, Mapping[str, Array]):
    """Answer of `sweep`: columns by name, with a row for each point and timing model, in the order of the grid.

    `answer["max_axes"]` is a new array of shape (rows,): numbers (NaN if missing) or words ("" if missing).

    Parameters
    ----------
    sweep
        Its grid, timing models and options.
    parts
        Its table, part by part.
    """

    sweep: Sweep
    parts: tuple[Part, ...]

    @property
    def profile(self) -> Profile:
        """The network."""
        return self.sweep.profile

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns: the varied keys, the figures of `capacity`, and those of circle tests."""
        return self.sweep.columns

    def __getitem__(self, name: str) -> Array:
        if name not in self.columns:
            raise KeyError(f"no column {name!r}; there are {', '.join(self.columns)}")
        column = np.concatenate([part.column(name) for part in self.parts])
        words = set(column.tolist()) if column.dtype == object else set()
        figure = column_figures(self.sweep).get(name)
        if (figure and "word" not in figure.sort) or all(isinstance(word, bool) for word in words):
            return column
        texts = {word: str(spelled(word)) for word in words}
        return np.array([texts[word] for word in column.tolist()])

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

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
        figures = column_figures(self.sweep)
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
        return arrow_table(self.sweep, self.parts)

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

    def rows_in(self, form: RowsForm) -> Iterator[bytes]:
        """Write every row, piece by piece; "parquet" needs the extra `table`."""
        return written_rows(form, self.sweep, self.parts)

    def _contents(self) -> Mapping[str, Callable[[], str | bytes]]:
        rows = {ending: partial(self._bytes_in, form) for ending, form in ROWS_ENDINGS.items()}
        return {**super()._contents(), **rows}

    def _bytes_in(self, form: RowsForm) -> bytes:
        return b"".join(self.rows_in(form))

    def sentences(self) -> tuple[Sentence, ...]:
        """Sentences on the number of points, on those that fit, and on what is wrong at others."""
        return tuple(self._digest(most=0).sentences())

    def report(self, *, most: int | None = SHOWN) -> Report:
        """The answer in blocks, with its first rows; None for every row."""
        return self._digest(most=self.sweep.rows if most is None else most).report()

    def _digest(self, *, most: int) -> Digest:
        return Digest(self.sweep, most=most).take(self.parts)


@with_its_constants
def sweep(
    profile: ProfileLike,
    *,
    vary: Mapping[str, str | Iterable[object]],
    timing_model: Models | None = None,
    circle: bool = False,
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
    circle
        Also run the circle test of every point, and add its columns (errors in mm, margins).
    unlimited
        Allow up to 100,000 circle tests, not 1,000.
    executor
        With `circle`: where the tests run, in chunks of about a second; by default in this thread. Any
        `concurrent.futures.Executor` gives the same answer, and is not shut down. Worker processes must have this
        version of busplan.
    progress
        Called now and then with the part that is done, and the whole.

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
        circle=circle,
        unlimited=unlimited,
        changes=key_changes({f"constants.{name}": value for name, value in network.profile.constants}),
    )
    return SweepAnswer(checked, tuple(computed(checked, executor=executor, progress=progress)))


def computed(sweep: Sweep, *, executor: Executor | None = None, progress: Progress = ignored) -> Iterator[Part]:
    """The table of a sweep, part by part; circle tests are run at once.

    BusplanError: the circle test of a point cannot be run. Errors that `executor` raises pass through.
    """
    require_executor(executor, circle=sweep.circle)
    if not sweep.circle:
        return parts_of(sweep, progress=progress)
    return _with_circles(sweep, circle_results(sweep.profile, sweep.grid, executor=executor, progress=progress))


def _with_circles(sweep: Sweep, results: Array) -> Iterator[Part]:
    """Parts with the columns of circle tests: one test a point, the same under every timing model."""
    done = 0
    for part in parts_of(sweep):
        here = results[:, done : done + part.points]
        done += part.points
        circles = {
            name: _typed(name, values).reshape(part.shape) for name, values in zip(CIRCLE_COLUMNS, here, strict=True)
        }
        yield part._replace(by_model=tuple({**columns, **circles} for columns in part.by_model))


def _typed(name: str, values: Array) -> Array:
    """A figure of circles as numbers, or as truth values, None where one is missing."""
    if CIRCLE_BY_KEY[name].sort != "truth":
        return values
    return np.array([None if np.isnan(value) else bool(value) for value in values.tolist()])
