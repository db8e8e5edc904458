"""Where the blocks of a sweep go: the rows at the top, rows as text, or one JSON document."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, BinaryIO, NoReturn, Protocol

from busplan.cli.answering import give
from busplan.cli.output import document_bytes, emit_document
from busplan.errors import BusplanError
from busplan.forms import Form, render

if TYPE_CHECKING:
    from busplan.analysis.sweep.blocks import SweepBlock
    from busplan.answers.sweep.rows import Style
    from busplan.answers.sweep.top import Tally
    from busplan.cli.sweep_job import SweepJob


class Sink(Protocol):
    """Where blocks go."""

    def add(self, block: "SweepBlock") -> None:
        """Take one more block."""

    def finish(self, *, complete: bool) -> None:
        """End the document; without all blocks it is a partial one."""


def sink_for(job: "SweepJob", file: BinaryIO | None, tally: "Tally") -> Sink:
    """Where the document goes."""
    write = emit_document if file is None else partial(_write, file)
    match job.form:
        case "csv" | "jsonl":
            return _LinesSink(job, job.form, write)
        case "json":
            return _JsonSink(job, write)
        case _:
            return _TopSink(job, job.form, file, tally)


def _write(file: BinaryIO, text: str) -> None:
    file.write(document_bytes(text))


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

    def add(self, block: "SweepBlock") -> None:
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

    def add(self, block: "SweepBlock") -> None:
        """Write one more block."""
        from busplan.answers.sweep.rows import json_rows

        self._write(json_rows(block, self._columns))

    def finish(self, *, complete: bool) -> None:
        """Close the document; one that is not whole says so, and is still JSON."""
        from busplan.answers.sweep.rows import json_footer

        self._write(json_footer(complete=complete))
