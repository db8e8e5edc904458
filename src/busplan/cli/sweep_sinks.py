"""Where the blocks of a sweep go: the rows at the top, rows as text, one JSON document or an archive of columns."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NoReturn, Protocol

from busplan.cli.answering import give
from busplan.cli.output import document_bytes, emit_document
from busplan.errors import BusplanError
from busplan.forms import Form, render

if TYPE_CHECKING:
    from busplan.analysis.sweep.blocks import Block
    from busplan.answers.sweep.rows import Style
    from busplan.answers.sweep.top import Tally
    from busplan.cli.npz import Archive, NpzColumns
    from busplan.cli.sweep_job import SweepJob


class Sink(Protocol):
    """Where blocks go."""

    def add(self, block: "Block") -> None:
        """Take one more block."""

    def finish(self, *, complete: bool) -> None:
        """End the document; without all blocks it is a partial one."""


@contextmanager
def opened_sink(job: "SweepJob", file: BinaryIO | None, tally: "Tally") -> Iterator[Sink]:
    """Where the document goes."""
    write = emit_document if file is None else partial(_write, file)
    match job.form:
        case "csv" | "jsonl":
            yield _LinesSink(job, job.form, write)
        case "json":
            yield _JsonSink(job, write)
        case "npz":
            from busplan.cli.npz import NpzColumns

            folder = Path(os.path.realpath(job.output)).parent if job.output else None
            with NpzColumns(job.columns, folder=folder) as columns:
                yield _NpzSink(job, file or _Pipe(), columns)
        case _:
            yield _TopSink(job, job.form, file, tally)


def _write(file: BinaryIO, text: str) -> None:
    file.write(document_bytes(text))


class _Pipe:
    """Standard output as a file that cannot go back, for an archive."""

    def write(self, data: bytes, /) -> int:
        emit_document(data)
        return len(data)

    def flush(self) -> None:
        """Nothing is held back."""

    def close(self) -> None:
        """It stays open for others."""


class _TopSink:
    """Keeps the rows at the top, for an answer at the end."""

    def __init__(self, job: "SweepJob", form: Form, file: BinaryIO | None, tally: "Tally") -> None:
        from busplan.answers.sweep.top import TopRows

        self._job, self._form, self._file, self._tally = job, form, file, tally
        self._rows = TopRows(job.columns, sort_by=job.sort_by, ascending=job.ascending, top=job.top)
        self.add = self._rows.add

    def finish(self, *, complete: bool) -> None:  # noqa: ARG002 - the tally knows
        """Write the answer."""
        from busplan.answers.sweep.top import sweep_report

        name, expected = self._job.profile.name, self._job.grid.points
        report = sweep_report(self._rows, self._tally, name=name, expected=expected, document=_not_kept)
        if self._file is None:
            give(report, self._form)
        else:
            _write(self._file, render(report, self._form))


def _not_kept() -> NoReturn:
    raise BusplanError("a sweep's document has every row: it is written as the rows come, and not from a few of them")


class _LinesSink:
    """Writes every row as it comes, and each ends itself."""

    def __init__(self, job: "SweepJob", form: "Style", write: Callable[[str], None]) -> None:
        from busplan.answers.sweep.rows import csv_header, jsonl_header

        self._columns, self._form, self._write = job.columns, form, write
        write(csv_header(job.columns) if form == "csv" else jsonl_header(job.profile.name, job.grid, job.timing_models))

    def add(self, block: "Block") -> None:
        """Write one more block."""
        from busplan.answers.sweep.rows import block_text

        self._write(block_text(block, self._columns, style=self._form))

    def finish(self, *, complete: bool) -> None:
        """Nothing is left to write."""


class _JsonSink:
    """Writes one document, row by row."""

    def __init__(self, job: "SweepJob", write: Callable[[str], None]) -> None:
        from busplan.answers.sweep.rows import json_header

        self._columns, self._write = job.columns, write
        write(json_header(job.profile.name, job.grid, job.timing_models))

    def add(self, block: "Block") -> None:
        """Write one more block."""
        from busplan.answers.sweep.rows import json_rows

        self._write(json_rows(block, self._columns))

    def finish(self, *, complete: bool) -> None:
        """Close the document; one that is not whole says so, and is still JSON."""
        from busplan.answers.sweep.rows import json_footer

        self._write(json_footer(complete=complete))


class _NpzSink:
    """Collects columns, for an archive at the end."""

    def __init__(self, job: "SweepJob", file: "Archive", columns: "NpzColumns") -> None:
        self._job, self._file, self._columns = job, file, columns
        self.add = columns.add

    def finish(self, *, complete: bool) -> None:
        """Write the archive, with what a reader must know of it."""
        from busplan.answers.documents import document

        facts = document("sweep", profile=self._job.profile.name, points=self._job.grid.points, complete=complete)
        self._columns.write(self._file, facts)
