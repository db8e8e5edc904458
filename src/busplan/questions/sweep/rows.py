"""Rows of a sweep as CSV, JSON lines and one JSON document, block by block."""

from collections.abc import Callable, Iterator, Sequence
from types import MappingProxyType
from typing import Final, Literal, NamedTuple, Protocol

import numpy as np

from busplan.forms import RowsForm
from busplan.forms.blocks import JsonDocument
from busplan.forms.csv_rows import csv_cell
from busplan.printable import json_text
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.blocks import Column, SweepBlock
from busplan.questions.sweep.grid import Array
from busplan.questions.words.documents import changed_document, document

TextForm = Literal["csv", "json", "jsonl"]
TEXT_POINTS: Final = 4096
"""Points of a block written as text: all its cells are in memory at once."""


def sweep_facts(sweep: Sweep) -> JsonDocument:
    """Description of the sweep that comes with its rows: profile, keys, timing models and counts."""
    facts = document(
        "sweep",
        profile=sweep.profile.name,
        varied={key: axis.size for key, axis in sweep.grid.axes.items()},
        timing_models=list(sweep.timing_models),
        points=sweep.grid.points,
        **({} if sweep.seeds is None else {"seeds": sweep.seeds.size}),
        rows=sweep.grid.points * len(sweep.timing_models),
    )
    return changed_document(facts, sweep.changes)


def _header(form: TextForm, sweep: Sweep) -> str:
    """Text before the first row."""
    if form == "csv":
        return ",".join(sweep.columns) + "\n"
    if form == "jsonl":
        return json_text(sweep_facts(sweep)) + "\n"
    facts = {key: value for key, value in sweep_facts(sweep).items() if key != "rows"}
    return json_text(facts).removesuffix("}") + ', "rows": [\n'


class _Layout(NamedTuple):
    between: str
    """Text between two rows."""
    blocks: str
    """Text between two blocks."""
    behind: str
    """Text at the end of a block."""


_LINES: Final = _Layout("\n", "", "\n")
_LAYOUTS: Final = MappingProxyType({"csv": _LINES, "jsonl": _LINES, "json": _Layout(",\n", ",\n", "")})


class TextWriter:
    """Writes rows as text in UTF-8.

    Parameters
    ----------
    form
        "csv"; "jsonl", whose first line describes the sweep; or "json", one document.
    sweep
        The sweep that gives the rows.
    write
        Writes bytes to the destination.
    """

    points = TEXT_POINTS

    def __init__(self, form: TextForm, sweep: Sweep, write: Callable[[bytes], object]) -> None:
        self._form, self._columns, self._write = form, sweep.columns, write
        self._layout, self._header = _LAYOUTS[form], _header(form, sweep)

    def add(self, block: SweepBlock) -> None:
        """Write a block."""
        rows = block_rows(block, self._columns, is_json=self._form != "csv")
        self._say((self._header or self._layout.blocks) + self._layout.between.join(rows) + self._layout.behind)
        self._header = ""

    def finish(self, *, complete: bool) -> None:
        """Write what follows the rows; lines need no end, for fewer than announced are a part."""
        self._say(self._header + (f'\n], "complete": {json_text(complete)}}}\n' if self._form == "json" else ""))

    def _say(self, text: str) -> None:
        self._write(text.encode("utf-8", "backslashreplace"))


def block_rows(block: SweepBlock, columns: Sequence[str], *, is_json: bool) -> Iterator[str]:
    """Write a block's rows without line ends, as `capacity` writes them: floats as their shortest digits.

    Parameters
    ----------
    block
        Part of a sweep.
    columns
        Which columns, in this order.
    is_json
        Rows are JSON objects instead of lines of CSV.
    """
    cells = [block.interleaved(_texts_by_model(block, name, is_json=is_json)).tolist() for name in columns]
    if is_json:
        return map("{{{}}}".format, map(", ".join, zip(*cells, strict=True)))
    return map(",".join, zip(*cells, strict=True))


def _texts_by_model(block: SweepBlock, name: str, *, is_json: bool) -> list[Array]:
    """Texts of one column under each timing model; what is the same under several is written once."""
    columns = block.columns(name)
    front = f"{json_text(name)}: " if is_json else ""
    written: list[Array] = []
    for column in columns:
        same = next(
            (texts for texts, earlier in zip(written, columns, strict=False) if _is_same(column, earlier)), None
        )
        written.append(_texts(column, front, is_json=is_json) if same is None else same)
    return written


def _is_same(column: Column, earlier: Column) -> bool:
    return column.words == earlier.words and np.array_equal(column.values, earlier.values)


def _texts(column: Column, front: str, *, is_json: bool) -> Array:
    """A column's values as text, in the column's own shape."""
    values = column.values
    if column.words is not None:
        words = [json_text(word) if is_json else str(csv_cell(word)) for word in column.words]
        texts = [words[index] for index in values.ravel().tolist()]
    elif values.dtype == bool:
        texts = ["true" if value else "false" for value in values.ravel().tolist()]
    else:
        texts = [*map(repr, values.ravel().tolist())]
        if np.isnan(values).any():
            missing = "null" if is_json else ""
            texts = [missing if text == "nan" else text for text in texts]
    return np.array([front + text for text in texts] if front else texts, dtype=object).reshape(values.shape)


class RowsWriter(Protocol):
    """Writes the rows of a sweep; nothing before the first block, for a point may be refused."""

    points: int
    """Good size of a block."""

    def add(self, block: SweepBlock) -> None:
        """Write a block; blocks come in the order of the grid."""

    def finish(self, *, complete: bool) -> None:
        """Write what follows the rows: the file is valid, and says if it is not complete."""


def rows_writer(form: RowsForm, sweep: Sweep, write: Callable[[bytes], object]) -> RowsWriter:
    """Make the writer of a form.

    Parameters
    ----------
    form
        The form.
    sweep
        The sweep that gives the rows.
    write
        Writes bytes to the destination.
    """
    if form != "parquet":
        return TextWriter(form, sweep, write)
    from busplan.questions.sweep.parquet import ParquetWriter

    return ParquetWriter(sweep, write)
