"""The rows of a record as CSV."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from busplan.errors import BusplanError
from busplan.forms.blocks import Report

_BLOCK: Final = 1 << 16
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
"""How a text begins that spreadsheets take for a formula: it may run a program, or send the sheet away."""


def to_csv(rows: Sequence[Mapping[str, object]]) -> str:
    """Write rows of the same keys as CSV with a header; a list becomes words with spaces between.

    Raises
    ------
    ValueError
        A row has a key that the first has not.
    """
    return "".join(csv_blocks(rows, columns=list(rows[0]))) if rows else ""


def csv_blocks(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> Iterator[str]:
    """Write rows as CSV block by block, so that a long table needs no memory of its own.

    Raises
    ------
    ValueError
        A row has a key that is no column.
    """
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, fieldnames=columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: csv_cell(value) for key, value in row.items()})
        if buffer.tell() > _BLOCK:
            yield buffer.getvalue()
            buffer.seek(0)
            buffer.truncate()
    yield buffer.getvalue()


def csv_cell(value: object) -> object:
    """Make a value what a cell holds: a text that a spreadsheet would run as a formula begins with an apostrophe.

    Examples
    --------
    >>> csv_cell("=1+1"), csv_cell(-1.5), csv_cell(["time", "nodes"]), csv_cell(True)
    ("'=1+1", -1.5, 'time nodes', 'true')
    """
    cell = spelled(value)
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell


def spelled(value: object) -> object:
    """Write a truth in small letters, and a list as words; anything else stays what it is."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return " ".join(map(str, value))
    return value


def text(report: Report) -> str:
    """Write the rows of an answer.

    Raises
    ------
    BusplanError
        Its figures are no one table.
    """
    if report.records is None:
        raise BusplanError("CSV is one table, and this answer has several; its JSON has all of them")
    return to_csv(report.records())
