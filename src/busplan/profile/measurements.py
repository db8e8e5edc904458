"""Measured latencies from CSV, rows or columns; every problem has its line and column."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from io import StringIO
from typing import Any, Final, NamedTuple

from busplan.english import plural
from busplan.errors import BusplanError, PlacedError, PlacedProblem, ProblemKind
from busplan.profile.document import text_of
from busplan.sections.base import MAX_COUNT, MAX_TIME_US, TRANSACTION_KINDS, TransactionKind

MAX_MEASUREMENTS_BYTES: Final = 20_000_000
"""A larger file is something else."""
_MOST_ROWS: Final = 400_000
"""Most measurements that are read; they bound time and memory."""

REQUIRED_COLUMNS: Final = ("payload_bytes", "latency_us")
OPTIONAL_COLUMNS: Final = ("transaction",)
_COLUMNS: Final = (*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS)
_EXPECTED: Final = f"expected {','.join(REQUIRED_COLUMNS)} and, where known, {','.join(OPTIONAL_COLUMNS)}"

_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_OTHER_DELIMITER: Final = re.compile(r"[;\t|]|(?<=[a-z]) +(?=[a-z])")
_DELIMITER_NAMES: Final = {"\t": "tabs", ";": "semicolons", "|": "bars"}
_QUANTITY: Final = re.compile(r"(?P<quantity>payload|latency)(?P<unit>.*)")
_TIMES: Final = {
    **dict.fromkeys(("", "usec", "µs", "μs"), ""),  # the micro sign, and the Greek letter that looks like it
    **dict.fromkeys(("ms", "msec"), "multiply by 1000"),
    **dict.fromkeys(("s", "sec"), "multiply by 1000000"),
    "ns": "divide by 1000",
}
_SIZES: Final = {"": "", "byte": "", "b": "", "bits": "divide by 8", "quadlets": "multiply by 4"}
"""Conversion of a unit in a column's name; empty for a unit that may already be ours."""


class Measurement(NamedTuple):
    """One measured transaction, or the mean of many."""

    line: int
    """Line in the file, from 1."""
    transaction: TransactionKind
    payload_bytes: int
    latency_us: float
    """Measured latency T_lant [us]."""


class MeasuredCell(NamedTuple):
    """One value of a line, without surrounding spaces and quotes."""

    text: str
    column: int
    """Column of its first character in the line, from 1."""


def parse_measurements(content: bytes, *, name: str) -> tuple[Measurement, ...]:
    r"""Read measurements, at least one, from the bytes of a CSV file.

    The first line that is neither empty nor a comment (#) is the header. Columns are payload_bytes and latency_us, and
    optionally transaction (read or write, default write), in any order. Values are separated by commas; numbers have a
    decimal point. All problems of the file are raised as one PlacedError.

    Examples
    --------
    >>> parse_measurements(b"payload_bytes,latency_us\n4,48.7\n", name="bench.csv")[0].latency_us
    48.7
    """
    if len(content) > MAX_MEASUREMENTS_BYTES:
        message = f"the file is larger than {MAX_MEASUREMENTS_BYTES:,} bytes; give fewer repetitions"
        raise PlacedError(name, (PlacedProblem(1, 1, "syntax", message),))
    rows = _rows(text_of(content, name=name, wanted="save it as CSV in UTF-8"))
    line, header = next(rows, (1, []))
    if not header:
        raise PlacedError(name, (PlacedProblem(1, 1, "missing-key", f"no header; {_EXPECTED}"),))
    return measurements_below(header, rows, line=line, name=name)


def measurements_below(
    header: Sequence[MeasuredCell], rows: Iterable[tuple[int, Sequence[MeasuredCell]]], *, line: int, name: str
) -> tuple[Measurement, ...]:
    """Read the rows below a header, each with its line from 1; `line` is that of the header.

    All problems are raised as one PlacedError, and too many rows.
    """
    problems = list(_header_problems(line, header))
    if problems:
        raise PlacedError(name, tuple(problems))
    columns = [cell.text for cell in header]
    measurements: list[Measurement] = []
    for count, (number, cells) in enumerate(rows, start=1):
        if count > _MOST_ROWS:
            message = f"more than {_MOST_ROWS:,} measurements; give fewer repetitions"
            raise PlacedError(name, (PlacedProblem(number, 1, "out-of-range", message),))
        result = _measurement(number, dict(zip(columns, cells, strict=False)), cells, columns)
        if isinstance(result, Measurement):
            measurements.append(result)
        else:
            problems += sorted(result)
    if problems:
        raise PlacedError(name, tuple(problems))
    if not measurements:
        raise PlacedError(name, (PlacedProblem(line, 1, "missing-key", "no measurement below the header"),))
    return tuple(measurements)


def _rows(text: str) -> Iterator[tuple[int, list[MeasuredCell]]]:
    """Lines with values, each with its number."""
    for number, line in enumerate(StringIO(text, newline=None), start=1):
        values = line.partition("#")[0]
        if values.strip():
            yield number, list(_cells(values))


def _cells(values: str) -> Iterator[MeasuredCell]:
    column = 1
    for written in values.split(","):
        text = written.strip()
        start = column + len(written) - len(written.lstrip())
        quoted = len(text) > 1 and text[0] == text[-1] == '"'
        yield MeasuredCell(text[1:-1].strip() if quoted else text, start)
        column += len(written) + 1


def _header_problems(line: int, header: Sequence[MeasuredCell]) -> Iterator[PlacedProblem]:
    def problem(cell: MeasuredCell, message: str, kind: ProblemKind = "unknown-key") -> PlacedProblem:
        return PlacedProblem(line, cell.column, kind, message)

    names = [cell.text for cell in header]
    delimiter_match = _OTHER_DELIMITER.search(names[0])
    if delimiter_match and len(names) == 1:
        delimiter = _DELIMITER_NAMES.get(delimiter_match.group(), "spaces")
        message = f"{delimiter} between the columns; expected commas, and a point in numbers: 4,48.7"
        yield problem(header[0], message, "syntax")
        return
    if all(_NUMBER.fullmatch(name) for name in names):
        yield problem(header[0], f"the first line has no names of columns; {_EXPECTED}", "missing-key")
        return
    for index, cell in enumerate(header):
        if cell.text in names[:index]:
            yield problem(cell, f"column {cell.text} is there twice", "inconsistent")
        elif cell.text not in _COLUMNS:
            yield problem(cell, f"column {_shown(cell.text)}: {_meant(cell.text)}")
    for name in REQUIRED_COLUMNS:
        # A column with another name or unit has its own message already.
        if name not in names and not any(
            column.strip().lower().startswith(name.partition("_")[0]) for column in names if column not in _COLUMNS
        ):
            yield problem(header[0], f"column {name} is missing; {_EXPECTED}", "missing-key")


def _meant(written: str) -> str:
    """Advice for an unknown column."""
    match = _QUANTITY.fullmatch(written.strip().lower())
    if match:
        quantity = match["quantity"]
        name = next(column for column in _COLUMNS if column.startswith(quantity))
        unit = match["unit"].strip(" _-.,()[]/")
        units = _SIZES if quantity == "payload" else _TIMES
        right_unit = name.rpartition("_")[2]
        if units.get(unit):
            return f"its unit looks like {unit}; give {right_unit} in a column {name} ({units[unit]})"
        if unit in units or unit == right_unit:
            return f"call it {name} if it is in {right_unit}"
    close = get_close_matches(written.lower(), _COLUMNS, n=1)
    return f"unknown; did you mean {close[0]}?" if close else f"unknown; {_EXPECTED}"


def _measurement(
    line: int, values: dict[str, MeasuredCell], cells: Sequence[MeasuredCell], columns: Sequence[str]
) -> Measurement | list[PlacedProblem]:
    """Parse one line, or list all its problems."""
    if len(cells) != len(columns):
        hint = "; is there a decimal comma? Write 48.7" if len(cells) > len(columns) else ""
        message = f"{plural(len(cells), 'value')} for {len(columns)} columns{hint}"
        return [PlacedProblem(line, 1, "inconsistent", message)]
    problems: list[PlacedProblem] = []

    def refuse(name: str, kind: ProblemKind, message: str) -> None:
        cell = values[name]
        problems.append(PlacedProblem(line, cell.column, kind, f"{name} {_shown(cell.text)}: {message}"))

    def number(name: str, *, most: float) -> float:
        text = values[name].text
        value = float(text) if _NUMBER.fullmatch(text) else None
        if value is None:
            refuse(name, "wrong-type", "expected a number with a point, as 48.7")
        elif not 0 < value <= most:
            refuse(name, "out-of-range", f"must be greater than 0 and no more than {most:,.12g}")
        elif name == "payload_bytes" and not value.is_integer():
            refuse(name, "wrong-type", "must be a whole number")
        return value or 0.0

    payload_bytes = number("payload_bytes", most=MAX_COUNT)
    latency_us = number("latency_us", most=MAX_TIME_US)
    kind = values["transaction"].text.lower() if "transaction" in values else "write"
    transaction = next((known_kind for known_kind in TRANSACTION_KINDS if known_kind == kind), None)
    if transaction is None:
        refuse("transaction", "out-of-range", "expected read or write")
        return problems
    return problems or Measurement(line, transaction, int(payload_bytes), latency_us)


def _shown(text: str) -> str:
    """Quote a value, shortened."""
    return repr(text if len(text) <= 40 else f"{text[:40]}...")  # noqa: PLR2004


_EXPECTED_TABLE: Final = (
    "expected a CSV file, CSV text, columns by name, or rows: each a mapping, as "
    '{"payload_bytes": 4, "latency_us": 48.7}, or values in the order payload_bytes, latency_us, transaction'
)


def measurements_from(given: object, *, name: str) -> tuple[Measurement, ...]:
    """Read measurements from columns by name, such as a data frame, or from rows; `line` is the row's number, from 1.

    Columns are a mapping, or anything with `keys()` and `[name]`, to values of one length. Rows are mappings by column,
    or values in the order of the columns. Names and units are those of a CSV file. Other data raise BusplanError, as do
    rows with different columns; problems of values raise PlacedError, with row and column.

    Examples
    --------
    >>> measurements_from([{"payload_bytes": 4, "latency_us": 48.7}], name="bench")[0].latency_us
    48.7
    >>> measurements_from({"payload_bytes": [4, 16], "latency_us": [48.7, 55.0]}, name="bench")[1].line
    2
    """
    columns, rows = _given_columns(given, name) if hasattr(given, "keys") else _given_rows(given, name)
    cells = [(number, _given_cells(row)) for number, row in enumerate(rows, start=1)]
    return measurements_below(_given_cells(columns), cells, line=1, name=name)


def _given_columns(given: Any, name: str) -> tuple[list[Any], list[tuple[Any, ...]]]:
    names = list(given.keys())
    columns = [_plain(given[column_name]) for column_name in names]
    if not names or not all(isinstance(column, Iterable) and not isinstance(column, str) for column in columns):
        raise BusplanError(f"{name}: {_EXPECTED_TABLE}")
    columns = [list(column) for column in columns]
    if len({len(column) for column in columns}) > 1:
        sizes = ", ".join(f"{key} has {len(column)} values" for key, column in zip(names, columns, strict=True))
        raise BusplanError(f"{name}: {sizes}; expected one of each for a measurement")
    return names, list(zip(*columns, strict=True))


def _given_rows(given: object, name: str) -> tuple[list[Any], list[tuple[Any, ...]]]:
    given = _plain(given)
    if not isinstance(given, Iterable):
        raise BusplanError(f"{name} {given!r}: {_EXPECTED_TABLE}")
    rows = list(given)
    if all(isinstance(row, Mapping) for row in rows):
        columns = list(rows[0]) if rows else list(REQUIRED_COLUMNS)
        for number, row in enumerate(rows, start=1):
            if set(row) != set(columns):
                raise BusplanError(
                    f"{name}: row {number} has {', '.join(map(str, row))}, and row 1 has {', '.join(map(str, columns))}"
                )
        return columns, [tuple(row[column] for column in columns) for row in rows]
    values = [tuple(_plain(row)) if isinstance(_plain(row), list | tuple) else () for row in rows]
    columns = [*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS]
    size = len(values[0])
    if not len(REQUIRED_COLUMNS) <= size <= len(columns):
        raise BusplanError(f"{name}: {_EXPECTED_TABLE}")
    return columns[:size], values


def _given_cells(values: Iterable[object]) -> list[MeasuredCell]:
    return [MeasuredCell(str(_plain(value)).strip(), column) for column, value in enumerate(values, start=1)]


def _plain(value: Any) -> Any:
    """Convert NumPy's and pandas' numbers and arrays to Python."""
    return value.tolist() if hasattr(value, "tolist") else value
