"""Rows of a sweep as an Apache Parquet file. Importing this module needs the extra `table` (pyarrow).

Columns are typed: float64, int64, bool, and text as a dictionary; what is missing is null. A field has its unit and its
meaning as metadata, the schema has the profile.
"""

import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pyarrow as pa
from pyarrow.parquet import ParquetWriter as FileWriter

from busplan import __version__
from busplan.buses.figure import Figure, Sort, unit_of
from busplan.forms.csv_rows import spelled
from busplan.printable import json_text
from busplan.profile.write import profile_text
from busplan.questions.sweep.asked import Sweep, column_figures
from busplan.questions.sweep.blocks import Column, SweepBlock
from busplan.questions.sweep.grid import Array, Values
from busplan.questions.sweep.rows import sweep_facts

BLOCK_POINTS: Final = 1 << 14
"""Points of a block, which are encoded at once."""
GROUP_ROWS: Final = 1 << 16
"""Fewest rows of a row group but the last: readers skip and share out whole groups."""
_WORDS: Final = pa.dictionary(pa.int32(), pa.string())
_TYPES: Final[Mapping[Sort, pa.DataType]] = MappingProxyType(
    {"number": pa.float64(), "count": pa.int64(), "truth": pa.bool_(), "word": _WORDS, "words": _WORDS}
)

_NUMPY: Final = MappingProxyType({pa.float64(): np.float64, pa.int64(): np.int64, pa.bool_(): np.bool_})
"""NumPy's types; older versions of pyarrow name them only where pandas is installed."""


def table_schema(sweep: Sweep) -> pa.Schema:
    """Types of the columns, with their units; metadata say what the rows are of.

    The keys of the metadata are `busplan.version`, `busplan.profile` (TOML) and `busplan.sweep` (the first line of JSON
    lines). At the end of a file comes `busplan.complete`.
    """
    figures = column_figures(sweep.profile)
    fields = [
        _axis_field(name, sweep.grid.axes[name]) if name in sweep.grid.axes else _field(name, figures[name])
        for name in sweep.columns
    ]
    metadata = {
        "busplan.version": __version__,
        "busplan.profile": profile_text(sweep.profile),
        "busplan.sweep": json_text(sweep_facts(sweep)),
    }
    return pa.schema(fields, metadata=metadata)


def arrow_table(sweep: Sweep, blocks: Iterable[SweepBlock]) -> pa.Table:
    """Table of some blocks; each text is once in the dictionary of its column."""
    schema = table_schema(sweep)
    return pa.concat_tables([_table(schema, block) for block in blocks]).unify_dictionaries()


def _table(schema: pa.Schema, block: SweepBlock) -> pa.Table:
    return pa.table([_array(block, field.name, field.type) for field in schema], schema=schema)


def _axis_field(key: str, axis: Values) -> pa.Field:
    return pa.field(key, _axis_type(axis), metadata={"unit": unit_of(key)})


def _field(name: str, figure: Figure) -> pa.Field:
    return pa.field(name, _TYPES[figure.sort], metadata={"unit": figure.unit, "meaning": figure.meaning})


def _axis_type(axis: Values) -> pa.DataType:
    values = axis.part(0, axis.size if axis.has_words else 1)
    if values.dtype == object:
        return pa.bool_() if all(isinstance(value, bool) for value in values) else _WORDS
    return pa.from_numpy_dtype(values.dtype)


def _array(block: SweepBlock, name: str, kind: pa.DataType) -> pa.Array:
    """One column of a block."""
    if kind == _WORDS:
        return _words(block, name)
    values = block.interleaved([_numbers(column) for column in block.columns(name)])
    missing = np.isnan(values)
    return pa.array(np.where(missing, 0, values).astype(_NUMPY[kind]), mask=missing)


def _words(block: SweepBlock, name: str) -> pa.Array:
    """Text as in CSV, each once in the dictionary; what is empty there is null."""
    columns = block.columns(name)
    texts = [[str(spelled(word)) for word in column.words or ()] for column in columns]
    known = dict.fromkeys(text for own in texts for text in own if text)
    codes = {text: code for code, text in enumerate(known)}
    own_codes = [
        np.array([codes.get(text, -1) for text in own], dtype=np.int32)[column.values]
        for own, column in zip(texts, columns, strict=True)
    ]
    values = block.interleaved(own_codes)
    indices = pa.array(values, mask=values < 0)
    return pa.DictionaryArray.from_arrays(indices, pa.array(list(known), type=pa.string()))


def _numbers(column: Column) -> Array:
    """Numbers or truth values; NaN where they are missing."""
    if column.words is None:
        return column.values
    return np.array([np.nan if word is None else word for word in column.words], dtype=float)[column.values]


class ParquetWriter:
    """Writes rows as a Parquet file, a row group for some blocks.

    Parameters
    ----------
    sweep
        The sweep that gives the rows.
    write
        Writes bytes to the destination, which need not be seekable.
    """

    points = BLOCK_POINTS

    def __init__(self, sweep: Sweep, write: Callable[[bytes], object]) -> None:
        self._schema = table_schema(sweep)
        self._stream = _Stream(write)
        self._pending: list[pa.Table] = []

    def add(self, block: SweepBlock) -> None:
        """Add a block."""
        self._pending.append(_table(self._schema, block))
        if sum(part.num_rows for part in self._pending) >= GROUP_ROWS:
            self._write_group()

    def finish(self, *, complete: bool) -> None:
        """Write the footer."""
        if self._pending:
            self._write_group()
        self._file.add_key_value_metadata({"busplan.complete": json_text(complete)})
        with self._stream.open():
            self._file.close()

    @cached_property
    def _file(self) -> FileWriter:
        with self._stream.open():
            return FileWriter(self._stream, self._schema)

    def _write_group(self) -> None:
        group, file = pa.concat_tables(self._pending).unify_dictionaries(), self._file
        self._pending = []
        with self._stream.open():
            file.write_table(group, row_group_size=group.num_rows)


class _Stream(io.RawIOBase):
    """A destination that is written to only while it is open: after an error, pyarrow still writes a footer."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write, self._is_open = write, False

    @contextmanager
    def open(self) -> Iterator[None]:
        """Let what is written pass; an error ends that for good."""
        self._is_open = True
        try:
            yield
        finally:
            self._is_open = False

    def writable(self) -> bool:
        """True."""
        return True

    def write(self, data: Any) -> int:
        """Write bytes."""
        if self._is_open:
            self._write(bytes(data))
        return len(data)
