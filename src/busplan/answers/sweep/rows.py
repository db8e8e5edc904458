"""Rows of a sweep as CSV, JSON lines and one JSON document, block by block.

For speed, whole columns are written at a time, and a value once for all rows that share it. A row is a record of texts
with padding, which is left out at the end.
"""

from collections.abc import Iterator, Sequence
from io import BytesIO
from itertools import groupby
from math import prod
from typing import Final, Literal, NamedTuple

import numpy as np

from busplan.analysis.sweep.blocks import Column, SweepBlock, Word
from busplan.analysis.sweep.grid import Array, Grid
from busplan.answers.documents import changed_document, document
from busplan.forms.blocks import JsonDocument
from busplan.forms.csv_rows import csv_cell
from busplan.forms.float_texts import Texts, float_texts, unpadded
from busplan.printable import json_text
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.sections.profile import Profile

Style = Literal["csv", "jsonl"]
TEXT_POINTS: Final = 8192
"""Points of a block written as text: all its cells are in memory at once."""
_ROWS_AT_ONCE: Final = 256
"""Rows that are joined at once."""
_RANGE: Final = 4
"""Whole numbers within this many times their count are written by their range."""


class SweepTable(NamedTuple):
    """What the rows of a sweep are of."""

    profile: Profile
    """The network, with its changes."""
    grid: Grid
    timing_models: tuple[str, ...]
    columns: tuple[str, ...]
    changes: KeyChanges = NO_CHANGES
    seeds: int | None = None
    """Circle tests that a point's row summarises; None where there is no summary."""

    @property
    def facts(self) -> JsonDocument:
        """What a reader must know besides the rows, and how many there are."""
        facts = document(
            "sweep",
            profile=self.profile.name,
            varied={key: axis.size for key, axis in self.grid.axes.items()},
            timing_models=list(self.timing_models),
            points=self.grid.points,
            **({} if self.seeds is None else {"seeds": self.seeds}),
            rows=self.grid.points * len(self.timing_models),
        )
        return changed_document(facts, self.changes)


def csv_header(columns: Sequence[str]) -> bytes:
    """First line of a sweep's CSV."""
    return _encoded(",".join(columns) + "\n")


def jsonl_header(table: SweepTable) -> bytes:
    """First line of a sweep's JSON lines: what the rows are, and how many a complete sweep has."""
    return _encoded(json_text(table.facts) + "\n")


def json_header(table: SweepTable) -> bytes:
    """Start of a sweep's JSON document, up to its first row."""
    facts = {key: value for key, value in table.facts.items() if key != "rows"}
    return _encoded(json_text(facts).removesuffix("}") + ', "rows": [\n')


def json_rows(block: SweepBlock, columns: Sequence[str]) -> bytes:
    """Write a block's rows for the JSON document, one per line, separated by commas."""
    rows = block_rows(block, columns, style="jsonl").removesuffix(b"\n").replace(b"\n", b",\n")
    return rows if block.chunk.start == 0 else b",\n" + rows


def json_footer(*, complete: bool) -> bytes:
    """End of a sweep's JSON document, also of a stopped sweep: valid JSON that says whether it is complete."""
    return _encoded(f'\n], "complete": {json_text(complete)}}}\n')


def block_rows(block: SweepBlock, columns: Sequence[str], *, style: Style) -> bytes:
    """Write a block's rows in UTF-8, each with its line end.

    Parameters
    ----------
    block
        Part of a sweep, of about `TEXT_POINTS` or fewer.
    columns
        Which columns, in this order.
    style
        "csv" or "jsonl"; values are written as in `capacity --format csv` and `json`.
    """
    texts = [_texts_by_model(block.columns(name), style) for name in columns]
    cells = (cell for own in zip(*texts, strict=True) for cell in _cells(own, columns, style))
    # Neighbouring cells of the same shape, smaller than the block, are joined once.
    joined: list[_Cells] = []
    for shape, group in groupby(cells, key=lambda one: one.texts.shape):
        alike = list(group)
        joined += alike if shape == block.chunk.shape else [_trimmed(alike)]
    written = BytesIO()
    written.writelines(_joined(joined, shape=block.chunk.shape))
    return written.getvalue()


class _Cells(NamedTuple):
    """A column's values as text, each with the same text in front."""

    front: bytes
    texts: Texts
    """In the column's own shape."""

    @property
    def widths(self) -> tuple[tuple[str, int], ...]:
        """Parts with their widths [bytes]."""
        return ("front", len(self.front)), ("text", self.texts.itemsize)


def _cells(texts: Sequence[Texts], columns: Sequence[str], style: Style) -> Iterator[_Cells]:
    """Cells of one timing model, the last one with the line end."""
    separator, opening, closing = (", ", "{", "}\n") if style == "jsonl" else (",", "", "\n")
    for number, (name, own) in enumerate(zip(columns, texts, strict=True)):
        key = f"{json_text(name)}: " if style == "jsonl" else ""
        yield _Cells(_encoded((separator if number else opening) + key), own)
    yield _Cells(_encoded(closing), np.full((1,) * texts[0].ndim, b""))


def _trimmed(cells: Sequence[_Cells]) -> _Cells:
    """Join cells of one shape."""
    shape = cells[0].texts.shape
    return _Cells(b"", np.array([*_joined(cells, shape=shape, at_once=1)]).reshape(shape))


def _joined(cells: Sequence[_Cells], *, shape: tuple[int, ...], at_once: int = _ROWS_AT_ONCE) -> Iterator[bytes]:
    """Join cells, one behind the other, some rows at a time: a small record stays in the processor's cache."""
    points = prod(shape)
    layout = [
        (f"{part}_{number}", f"S{max(1, width)}") for number, one in enumerate(cells) for part, width in one.widths
    ]
    records = np.empty(min(points, at_once), dtype=layout)
    varying = {}
    for number, one in enumerate(cells):
        records[f"front_{number}"] = one.front
        if one.texts.size == 1:
            records[f"text_{number}"] = one.texts.item()
        else:
            varying[f"text_{number}"] = np.broadcast_to(one.texts, shape).ravel()
    for start in range(0, points, at_once):
        part = records[: points - start]
        for name, texts in varying.items():
            part[name] = texts[start : start + at_once]
        yield unpadded(part.tobytes())


def _texts_by_model(columns: Sequence[Column], style: Style) -> list[Texts]:
    """Texts of one column under each timing model; what is the same under several is written once."""
    found: list[Texts] = []
    for number, column in enumerate(columns):
        same = (place for place in range(number) if _is_same(column, columns[place]))
        place = next(same, None)
        found.append(_texts(column, style) if place is None else found[place])
    return found


def _is_same(one: Column, other: Column) -> bool:
    return one.words == other.words and np.array_equal(one.values, other.values)


def _texts(column: Column, style: Style) -> Texts:
    """A column's values as text, in the column's own shape."""
    values = column.values
    if column.words is not None:
        # Words that do not occur would make every cell as long as themselves.
        counts = np.bincount(values.ravel(), minlength=len(column.words))
        words = (_word(word, style) if count else "" for word, count in zip(column.words, counts, strict=True))
        return np.array([_encoded(word) for word in words])[values]
    if values.dtype == bool:
        return np.array([b"false", b"true"])[values.astype(np.uint8)]
    if values.dtype.kind == "f":
        return float_texts(values.ravel(), missing=b"null" if style == "jsonl" else b"").reshape(values.shape)
    return _whole_texts(values)


def _whole_texts(values: Array) -> Texts:
    """Write whole numbers."""
    least, most = int(values.min()), int(values.max())
    if most - least > _RANGE * values.size:
        found: Texts = values.astype(bytes)
    else:
        found = np.arange(least, most + 1).astype(bytes)[values - least]
    return found


def _word(word: Word, style: Style) -> str:
    return json_text(word) if style == "jsonl" else str(csv_cell(word))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "backslashreplace")
