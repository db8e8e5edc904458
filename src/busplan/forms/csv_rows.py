"""Rows of an answer as CSV."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from busplan.errors import BusplanError
from busplan.forms.blocks import Report

_BLOCK: Final = 1 << 16
_LONGEST_CELL: Final = 32_767
"""Length of the longest cell in a spreadsheet [characters]. Python's csv module reads four times as many."""
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
"""First characters of a text that spreadsheets run as a formula. It could start a program or send data away."""


def to_csv(rows: Sequence[Mapping[str, object]]) -> str:
    """CSV of rows with the same keys, with a header; a list becomes words separated by spaces.

    A row with a key that the first row lacks raises ValueError.
    """
    return "".join(csv_blocks(rows, columns=list(rows[0]))) if rows else ""


def csv_blocks(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> Iterator[str]:
    """CSV of rows, block by block, so that memory does not grow with the table.

    A row with a key that is not a column raises ValueError.
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
    """Value of a CSV cell. A text that a spreadsheet would run as a formula gets an apostrophe in front.

    A text too long for a spreadsheet is replaced by a remark.

    Examples
    --------
    >>> csv_cell("=1+1"), csv_cell(-1.5), csv_cell(["time", "nodes"]), csv_cell(True), csv_cell(None)
    ("'=1+1", -1.5, 'time nodes', 'true', '')
    """
    cell = spelled(value)
    if not isinstance(cell, str):
        return cell
    if len(cell) > _LONGEST_CELL:
        return f"({len(cell):,} characters, too long for a cell: --format json has them)"
    return f"'{cell}" if cell.startswith(_FORMULA) else cell


def spelled(value: object) -> object:
    """A boolean in lower case, a list as words and a missing value as nothing; any other value unchanged."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return " ".join(map(str, value))
    return value


def text(report: Report) -> str:
    """CSV of an answer. One with more than one table raises BusplanError."""
    if report.records is None:
        raise BusplanError("--format csv: this answer has several tables and CSV holds one; use --format json")
    return to_csv(report.records)
