"""Every row of a sweep, block by block, in one form.

A writer has two halves. `encode` makes bytes of one block; it keeps nothing, can be pickled, and runs in any process
and in any order. `join` takes these bytes in the order of the grid and writes the file.
"""

from collections.abc import Callable
from functools import partial
from typing import Protocol, assert_never

from busplan.analysis.sweep.blocks import SweepBlock
from busplan.answers.sweep.rows import (
    TEXT_POINTS,
    SweepTable,
    block_rows,
    csv_header,
    json_footer,
    json_header,
    json_rows,
    jsonl_header,
)
from busplan.forms import RowsForm

Write = Callable[[bytes], object]
Encode = Callable[[SweepBlock], bytes]


class RowsWriter(Protocol):
    """Writes the rows of a sweep."""

    points: int
    """Good size of a block."""

    @property
    def encode(self) -> Encode:
        """Make bytes of a block: a function that can be pickled, and called anywhere."""

    def begin(self) -> None:
        """Write what stands before the rows."""

    def join(self, encoded: bytes) -> None:
        """Add an encoded block; blocks come in the order of the grid."""

    def end(self, *, complete: bool) -> None:
        """Write what stands behind the rows: the file is valid, and says if it is not complete."""


def rows_writer(form: RowsForm, table: SweepTable, write: Write) -> RowsWriter:
    """Make the writer of a form.

    Parameters
    ----------
    form
        The form.
    table
        What the rows are of.
    write
        Writes bytes to the destination.
    """
    match form:
        case "csv":
            encode = partial(block_rows, columns=table.columns, style="csv")
            return _TextWriter(write, encode, csv_header(table.columns))
        case "jsonl":
            encode = partial(block_rows, columns=table.columns, style="jsonl")
            return _TextWriter(write, encode, jsonl_header(table))
        case "json":
            return _TextWriter(write, partial(json_rows, columns=table.columns), json_header(table), json_footer)
        case "parquet":
            from busplan.answers.sweep.parquet import ParquetWriter

            return ParquetWriter(table, write)
        case _:
            assert_never(form)


def _nothing(*, complete: bool) -> bytes:  # noqa: ARG001 - lines need no end: fewer than announced are a part
    return b""


class _TextWriter:
    """Writes rows as text."""

    points = TEXT_POINTS

    def __init__(self, write: Write, encode: Encode, header: bytes, footer: Callable[..., bytes] = _nothing) -> None:
        self.encode: Encode = encode
        self._write, self._header, self._footer = write, header, footer

    def begin(self) -> None:
        """Write the header."""
        self._write(self._header)

    def join(self, encoded: bytes) -> None:
        """Write a block."""
        self._write(encoded)

    def end(self, *, complete: bool) -> None:
        """Write the footer."""
        self._write(self._footer(complete=complete))
