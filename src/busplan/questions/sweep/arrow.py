"""A sweep as a table of Apache Arrow and as a Parquet file. Importing this module needs the extra `table` (pyarrow).

Columns are typed: float64, int64, bool, and text as a dictionary; what is missing is null. A field has its unit and its
meaning as metadata, the schema has the profile.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import pyarrow as pa
from pyarrow.parquet import write_table

from busplan import __version__
from busplan.buses.figure import Sort, unit_of
from busplan.english import json_text
from busplan.forms.blocks import JsonDocument
from busplan.forms.csv_rows import spelled
from busplan.profile.edit import profile_text
from busplan.questions.sweep.asked import Sweep, column_figures
from busplan.questions.sweep.grid import Array
from busplan.questions.sweep.table import Columns

_GROUP_ROWS: Final = 1 << 16
"""Rows of a row group: readers skip and share out whole groups."""
_WORDS: Final = pa.dictionary(pa.int32(), pa.string())
_TYPES: Final[Mapping[Sort, pa.DataType]] = MappingProxyType(
    {"number": pa.float64(), "count": pa.int64(), "truth": pa.bool_(), "word": _WORDS, "words": _WORDS}
)


def arrow_table(sweep: Sweep, table: Columns, facts: JsonDocument) -> pa.Table:
    """Table with typed columns, which have their units; its metadata say what the rows are of.

    The keys of the metadata are `busplan.version`, `busplan.profile` (TOML) and `busplan.sweep` (the JSON document
    without its rows).

    Parameters
    ----------
    sweep
        The sweep.
    table
        Its columns, or some of them.
    facts
        What comes with its rows.
    """
    metadata = {
        "busplan.version": __version__,
        "busplan.profile": profile_text(sweep.profile),
        "busplan.sweep": json_text(facts),
    }
    schema = pa.schema([_field(sweep, name) for name in table], metadata=metadata)
    return pa.table([_array(table[field.name], field.type) for field in schema], schema=schema)


def _field(sweep: Sweep, name: str) -> pa.Field:
    axis = sweep.grid.axes.get(name)
    if axis is None:
        figure = column_figures(sweep.network)[name]
        return pa.field(name, _TYPES[figure.sort], metadata={"unit": figure.unit, "meaning": figure.meaning})
    are_truths = all(isinstance(value, bool) for value in axis)
    kind = pa.from_numpy_dtype(axis.dtype) if axis.dtype != object else pa.bool_() if are_truths else _WORDS
    return pa.field(name, kind, metadata={"unit": unit_of(name)})


def _array(values: Array, kind: pa.DataType) -> pa.Array:
    """One column: NaN and None are null, and text is as in CSV, null where that is empty."""
    if kind != _WORDS:
        return pa.array(values, type=kind, from_pandas=True)
    texts = {word: str(spelled(word)) or None for word in set(values.tolist())}
    return pa.array([texts[word] for word in values.tolist()], type=kind)


def parquet_bytes(sweep: Sweep, table: Columns, facts: JsonDocument) -> bytes:
    """A Parquet file; as `arrow_table`."""
    sink = pa.BufferOutputStream()
    write_table(arrow_table(sweep, table, facts), sink, row_group_size=_GROUP_ROWS)
    content: bytes = sink.getvalue().to_pybytes()
    return content
