"""Rows of a sweep as CSV, as one JSON document, and as a table of Apache Arrow or a Parquet file by pyarrow."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from busplan import __version__
from busplan.buses.figure import unit_of
from busplan.english import json_text
from busplan.forms import RowsForm
from busplan.forms.blocks import JsonDocument
from busplan.forms.csv_rows import csv_cell, spelled
from busplan.profile.edit import profile_text
from busplan.questions.base.sentences import changed_document, document
from busplan.questions.fit.grid import Array
from busplan.questions.sweep.table import Part, Sweep, column_figures

if TYPE_CHECKING:
    import pyarrow as pa

_TEXT_CELLS: Final = 250_000
"""Most cells that are text at once: they take tens of megabytes."""
_GROUP_ROWS: Final = 1 << 16
"""Least rows of a row group of Parquet, but for the last: readers skip and share out whole groups."""
_GROUP_CELLS: Final = 4_000_000
"""Cells of a row group, whose rows are fewer in a wide table."""
_NUMBERS: Final = {int, float}


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


def written_rows(form: RowsForm, sweep: Sweep, parts: Iterable[Part]) -> Iterator[bytes]:
    """The rows of a sweep as text or bytes, piece by piece; "parquet" needs pyarrow."""
    if form == "parquet":
        yield from _parquet(sweep, parts)
        return
    pieces = (piece for part in parts for piece in part.cut(_TEXT_CELLS // sweep.point_cells))
    for text in (_csv if form == "csv" else _json)(sweep, pieces):
        yield text.encode("utf-8", "backslashreplace")


def _csv(sweep: Sweep, parts: Iterable[Part]) -> Iterator[str]:
    before = ",".join(sweep.columns) + "\n"
    for part in parts:
        yield before + "".join(f"{','.join(row)}\n" for row in _text_rows(sweep, part, _csv_text))
        before = ""


@cache
def _csv_text(value: object) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(("", csv_cell(value)))
    return text.getvalue().removeprefix(",")


def _json(sweep: Sweep, parts: Iterable[Part]) -> Iterator[str]:
    before = json_text(sweep_facts(sweep)).removesuffix("}") + ', "rows": [\n'
    names = (json_text(name).replace("%", "%%") for name in sweep.columns)
    row_text = "{" + ", ".join(f"{name}: %s" for name in names) + "}"
    for part in parts:
        yield before + ",\n".join(row_text % row for row in _text_rows(sweep, part, _json_text))
        before = ",\n"
    yield "\n]}\n"


_json_text = cache(json_text)


def _text_rows(sweep: Sweep, part: Part, write: Callable[[object], str]) -> Iterator[tuple[str, ...]]:
    """Rows as text; `write` makes that of what is no number. A value is written once for all rows that it is in."""
    counts = _counts(sweep)

    def texts(values: Array, *, is_count: bool) -> Array:
        plain = _plain(values.ravel(), is_count=is_count)
        cells = (repr(value) if type(value) in _NUMBERS else write(value) for value in plain)
        return np.fromiter(cells, dtype=object, count=values.size).reshape(values.shape)

    columns = (part.column(name, partial(texts, is_count=name in counts)).tolist() for name in sweep.columns)
    return zip(*columns, strict=True)


def _counts(sweep: Sweep) -> set[str]:
    """Names of the columns of whole numbers."""
    return {name for name, figure in column_figures(sweep).items() if figure.sort == "count"}


def _plain(values: Array, *, is_count: bool) -> list[Any]:
    """Plain values of a column; None where there is none."""
    plain: list[Any] = values.tolist()
    if values.dtype.kind != "f":
        return plain
    # Only NaN is not itself. Counts are floats where one of them is missing.
    return [None if value != value else int(value) if is_count else value for value in plain]  # noqa: PLR0124


def first_rows(sweep: Sweep, part: Part, names: Sequence[str], most: int) -> list[dict[str, Any]]:
    """The first rows of a part as plain data; a tuple becomes a list."""
    counts = _counts(sweep)
    columns = [_plain(part.column(name)[:most], is_count=name in counts) for name in names]
    rows = ([list(value) if isinstance(value, tuple) else value for value in row] for row in zip(*columns, strict=True))
    return [dict(zip(names, row, strict=True)) for row in rows]


def arrow_table(sweep: Sweep, parts: Iterable[Part]) -> "pa.Table":
    """Table of pyarrow: float64, int64, bool, or text as a dictionary; null where there is no value.

    Each field has its unit and meaning as metadata. The metadata of the table are `busplan.version`, `busplan.profile`
    (TOML) and `busplan.sweep` (the JSON document without its rows).
    """
    import pyarrow as pa

    schema = _schema(sweep)
    tables = [pa.table([_arrow(part.column(field.name), field.type) for field in schema], schema) for part in parts]
    return pa.concat_tables(tables).unify_dictionaries().combine_chunks()


def _schema(sweep: Sweep) -> "pa.Schema":
    import pyarrow as pa

    text = pa.dictionary(pa.int32(), pa.string())
    types = {"number": pa.float64(), "count": pa.int64(), "truth": pa.bool_(), "word": text, "words": text}
    figures = column_figures(sweep)
    fields = []
    for name in sweep.columns:
        if name in sweep.grid.axes:
            axis = sweep.grid.axes[name]
            are_truths = all(isinstance(value, bool) for value in axis)
            kind = pa.from_numpy_dtype(axis.dtype) if axis.dtype != object else pa.bool_() if are_truths else text
            metadata = {"unit": unit_of(name)}
        else:
            kind = types[figures[name].sort]
            metadata = {"unit": figures[name].unit, "meaning": figures[name].meaning}
        fields.append(pa.field(name, kind, metadata=metadata))
    facts = {
        "busplan.version": __version__,
        "busplan.profile": profile_text(sweep.profile),
        "busplan.sweep": json_text(sweep_facts(sweep)),
    }
    return pa.schema(fields, metadata=facts)


def _arrow(values: Array, kind: "pa.DataType") -> "pa.Array":
    import pyarrow as pa

    if not pa.types.is_dictionary(kind):
        return pa.array(values, type=kind, from_pandas=True)
    # Text is as in CSV, null where that is empty.
    words = {word: str(spelled(word)) or None for word in set(values.tolist())}
    return pa.array([words[word] for word in values.tolist()], type=kind)


def _parquet(sweep: Sweep, parts: Iterable[Part]) -> Iterator[bytes]:
    from pyarrow.parquet import ParquetWriter

    sink = io.BytesIO()
    with ParquetWriter(sink, _schema(sweep)) as writer:
        for group in _groups(sweep, parts):
            writer.write_table(arrow_table(sweep, group))
            yield sink.getvalue()
            sink.seek(0)
            sink.truncate()
    yield sink.getvalue()


def _groups(sweep: Sweep, parts: Iterable[Part]) -> Iterator[list[Part]]:
    """Parts that together have the rows of a row group; the last have the rest."""
    least = min(_GROUP_ROWS, _GROUP_CELLS // len(sweep.columns)) // len(sweep.timing_models)
    group: list[Part] = []
    for part in parts:
        group.append(part)
        if sum(part.points for part in group) >= least:
            yield group
            group = []
    if group:
        yield group
