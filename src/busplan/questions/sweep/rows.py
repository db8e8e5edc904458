"""Rows of a sweep as CSV, as one JSON document, and as a table of Apache Arrow or a Parquet file by pyarrow."""

import csv
import io
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

from busplan import __version__
from busplan.buses.figure import unit_of
from busplan.english import json_text
from busplan.forms import RowsForm
from busplan.forms.blocks import JsonDocument
from busplan.forms.csv_rows import csv_cell, spelled
from busplan.profile.edit import profile_text
from busplan.questions.base.sentences import changed_document, document
from busplan.questions.fit.grid import Array
from busplan.questions.sweep.table import Columns, Sweep, column_figures

if TYPE_CHECKING:
    import pyarrow as pa

_ROWS_AT_ONCE: Final = 4096
_GROUP_ROWS: Final = 1 << 16
"""Rows of a row group of Parquet: readers skip and share out whole groups."""
_NUMBERS: Final = {int, float, type(None)}


def sweep_facts(sweep: Sweep) -> JsonDocument:
    """Description of the sweep that comes with its rows: profile, keys, timing models and counts."""
    facts = document(
        "sweep",
        profile=sweep.profile.name,
        varied={key: axis.size for key, axis in sweep.grid.axes.items()},
        timing_models=list(sweep.timing_models),
        **({"group": sweep.group} if sweep.group else {}),
        points=sweep.grid.points,
    )
    return changed_document(facts, sweep.changes)


def written_rows(form: RowsForm, sweep: Sweep, table: Columns) -> Iterator[bytes]:
    """A table as text or bytes, piece by piece; "parquet" needs pyarrow."""
    if form == "parquet":
        yield _parquet(sweep, table)
        return
    for text in (_csv if form == "csv" else _json)(sweep, table):
        yield text.encode("utf-8", "backslashreplace")


def _csv(sweep: Sweep, table: Columns) -> Iterator[str]:
    yield ",".join(table) + "\n"
    for columns in _parts(sweep, table):
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(zip(*map(_csv_cells, columns), strict=True))
        yield text.getvalue()


def _csv_cells(values: list[Any]) -> list[Any]:
    """Cells of a column; the csv module writes numbers, and nothing for None."""
    if _NUMBERS.issuperset(map(type, values)):
        return values
    cells = {value: csv_cell(value) for value in values}
    return [cells[value] for value in values]


def _json(sweep: Sweep, table: Columns) -> Iterator[str]:
    before = json_text(sweep_facts(sweep)).removesuffix("}") + ', "rows": [\n'
    for columns in _parts(sweep, table):
        rows = (json_text(dict(zip(table, row, strict=True))) for row in zip(*columns, strict=True))
        yield before + ",\n".join(rows)
        before = ",\n"
    yield "\n]}\n"


def _parts(sweep: Sweep, table: Columns) -> Iterator[list[list[Any]]]:
    """Plain values of each column, some rows at a time."""
    rows = len(next(iter(table.values())))
    for start in range(0, rows, _ROWS_AT_ONCE):
        yield plain_columns(sweep, {name: values[start : start + _ROWS_AT_ONCE] for name, values in table.items()})


def plain_columns(sweep: Sweep, table: Columns) -> list[list[Any]]:
    """Plain values of each column; None where there is none."""
    figures = column_figures(sweep)
    counts = {name for name, figure in figures.items() if figure.sort == "count"}
    return [_plain(values, is_count=name in counts) for name, values in table.items()]


def _plain(values: Array, *, is_count: bool) -> list[Any]:
    plain: list[Any] = values.tolist()
    if values.dtype.kind != "f":
        return plain
    # Only NaN is not itself. Counts are floats where one of them is missing.
    return [None if value != value else int(value) if is_count else value for value in plain]  # noqa: PLR0124


def plain_rows(sweep: Sweep, table: Columns, places: Array) -> list[dict[str, Any]]:
    """Some rows as plain data, by their number; a tuple becomes a list."""
    columns = plain_columns(sweep, {name: values[places] for name, values in table.items()})
    rows = ([list(value) if isinstance(value, tuple) else value for value in row] for row in zip(*columns, strict=True))
    return [dict(zip(table, row, strict=True)) for row in rows]


def arrow_table(sweep: Sweep, table: Columns) -> "pa.Table":
    """Table of pyarrow: float64, int64, bool, or text as a dictionary; null where there is no value.

    Each field has its unit and meaning as metadata. The metadata of the table are `busplan.version`, `busplan.profile`
    (TOML) and `busplan.sweep` (the JSON document without its rows).
    """
    import pyarrow as pa

    text = pa.dictionary(pa.int32(), pa.string())
    types = {"number": pa.float64(), "count": pa.int64(), "truth": pa.bool_(), "word": text, "words": text}
    figures = column_figures(sweep)
    fields, arrays = [], []
    for name, values in table.items():
        if name in sweep.grid.axes:
            are_truths = all(isinstance(value, bool) for value in sweep.grid.axes[name])
            kind = pa.from_numpy_dtype(values.dtype) if values.dtype != object else pa.bool_() if are_truths else text
            metadata = {"unit": unit_of(name)}
        else:
            kind = types[figures[name].sort]
            metadata = {"unit": figures[name].unit, "meaning": figures[name].meaning}
        fields.append(pa.field(name, kind, metadata=metadata))
        # Text is as in CSV, null where that is empty.
        words = {word: str(spelled(word)) or None for word in set(values.tolist())} if kind == text else {}
        cells = [words[word] for word in values.tolist()] if kind == text else values
        arrays.append(pa.array(cells, type=kind, from_pandas=True))
    facts = {
        "busplan.version": __version__,
        "busplan.profile": profile_text(sweep.profile),
        "busplan.sweep": json_text(sweep_facts(sweep)),
    }
    return pa.table(arrays, schema=pa.schema(fields, metadata=facts))


def _parquet(sweep: Sweep, table: Columns) -> bytes:
    import pyarrow as pa
    from pyarrow.parquet import write_table

    sink = pa.BufferOutputStream()
    write_table(arrow_table(sweep, table), sink, row_group_size=_GROUP_ROWS)
    content: bytes = sink.getvalue().to_pybytes()
    return content
