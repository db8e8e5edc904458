"""Read measured latencies from rows or columns in memory, with the checks of a CSV file."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from busplan.errors import BusplanError
from busplan.profile.measurements import (
    OPTIONAL_COLUMNS,
    REQUIRED_COLUMNS,
    MeasuredCell,
    Measurement,
    measurements_below,
)

_EXPECTED: Final = (
    "expected a CSV file, CSV text, columns by name, or rows: each a mapping, as "
    '{"payload_bytes": 4, "latency_us": 48.7}, or values in the order payload_bytes, latency_us, transaction, '
    "request_and_acknowledge_us"
)


def measurements_from(given: object, *, name: str) -> tuple[Measurement, ...]:
    """Read measurements from columns by name, such as a data frame, or from several rows.

    Parameters
    ----------
    given
        Columns: a mapping, or anything with `keys()` and `[name]`, to values of one length. Or rows: mappings by
        column, or values in the order of the columns. Columns and units are those of a CSV file.
    name
        Name of the measurements in messages.

    Returns
    -------
    tuple
        Measurements in their order; the `line` of each is the number of its row, from 1.

    Raises
    ------
    BusplanError
        Neither columns nor rows, or rows with different columns.
    PlacedError
        All problems of the values, with row and column.

    Examples
    --------
    >>> measurements_from([{"payload_bytes": 4, "latency_us": 48.7}], name="bench")[0].latency_us
    48.7
    >>> measurements_from({"payload_bytes": [4, 16], "latency_us": [48.7, 55.0]}, name="bench")[1].line
    2
    """
    columns, rows = _columns(given, name) if hasattr(given, "keys") else _rows(given, name)
    cells = [(number, _cells(row)) for number, row in enumerate(rows, start=1)]
    return measurements_below(_cells(columns), cells, line=1, name=name)


def _columns(given: Any, name: str) -> tuple[list[Any], list[tuple[Any, ...]]]:
    names = list(given.keys())
    columns = [_plain(given[one]) for one in names]
    if not names or not all(isinstance(one, Iterable) and not isinstance(one, str) for one in columns):
        raise BusplanError(f"{name}: {_EXPECTED}")
    columns = [list(one) for one in columns]
    if len({len(one) for one in columns}) > 1:
        sizes = ", ".join(f"{key} has {len(one)} values" for key, one in zip(names, columns, strict=True))
        raise BusplanError(f"{name}: {sizes}; expected one of each for a measurement")
    return names, list(zip(*columns, strict=True))


def _rows(given: object, name: str) -> tuple[list[Any], list[tuple[Any, ...]]]:
    given = _plain(given)
    if not isinstance(given, Iterable):
        raise BusplanError(f"{name} {given!r}: {_EXPECTED}")
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
    known = (*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS)
    size = len(values[0])
    if not len(REQUIRED_COLUMNS) <= size <= len(known):
        raise BusplanError(f"{name}: {_EXPECTED}")
    return list(known[:size]), values


def _cells(values: Iterable[object]) -> list[MeasuredCell]:
    return [MeasuredCell(str(_plain(value)).strip(), column) for column, value in enumerate(values, start=1)]


def _plain(value: Any) -> Any:
    """Convert NumPy's and pandas' numbers and arrays to Python."""
    return value.tolist() if hasattr(value, "tolist") else value
