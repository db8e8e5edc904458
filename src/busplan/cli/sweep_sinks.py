"""Destinations for the blocks of a sweep: the top rows, rows as text, or one JSON document."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, BinaryIO, NoReturn, Protocol

from busplan.cli.answering import give, report_with
from busplan.cli.output import document_bytes, emit_document
from busplan.errors import BusplanError
from busplan.forms import Form, render

if TYPE_CHECKING:
    from busplan.analysis.sweep.blocks import SweepBlock
    from busplan.answers.sweep.rows import Style
    from busplan.answers.sweep.top import Tally
    from busplan.cli.sweep_job import SweepJob


class Sink(Protocol):
    """Destination for blocks."""

    def add(self, block: "SweepBlock") -> None:
        """Add a block."""

    def finish(self, *, complete: bool) -> None:
        """End the document; it is marked as partial unless complete."""


def sink_for(job: "SweepJob", file: BinaryIO | None, tally: "Tally") -> Sink:
    """Make the destination of a sweep."""
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
    """Keeps the top rows for an answer at the end."""

    def __init__(self, job: "SweepJob", form: Form, file: BinaryIO | None, tally: "Tally") -> None:
        from busplan.answers.sweep.top import TopRows

        self._job, self._form, self._file, self._tally = job, form, file, tally
        self._rows = TopRows(job.columns, sort_by=job.sort_by, ascending=job.ascending, top=job.top)
        self.add = self._rows.add

    def finish(self, *, complete: bool) -> None:  # noqa: ARG002 - `tally` has the number of points
        """Write the answer."""
        from busplan.answers.sweep.top import sweep_report

        report = report_with(self._job.changes, sweep_report(self._rows, self._tally, document=_not_kept))
        if self._file is None:
            give(report._replace(is_whole=self._job.is_whole), self._form)
        else:
            _write(self._file, render(report, self._form))


def _not_kept() -> NoReturn:
    raise BusplanError("a sweep's document has every row: it is written as the rows come, and not from a few of them")


class _LinesSink:
    """Writes every row as a line."""

    def __init__(self, job: "SweepJob", form: "Style", write: Callable[[str], None]) -> None:
        from busplan.answers.sweep.rows import csv_header, jsonl_header

        self._columns, self._form, self._write = job.columns, form, write
        if form == "csv":
            write(csv_header(job.columns))
        else:
            write(jsonl_header(job.profile.name, job.grid, job.timing_models, changes=job.changes))

    def add(self, block: "SweepBlock") -> None:
        """Write a block."""
        from busplan.answers.sweep.rows import block_text

        self._write(block_text(block, self._columns, style=self._form))

    def finish(self, *, complete: bool) -> None:
        """Do nothing: lines need no end."""


class _JsonSink:
    """Writes one JSON document, block by block."""

    def __init__(self, job: "SweepJob", write: Callable[[str], None]) -> None:
        from busplan.answers.sweep.rows import json_header

        self._columns, self._write = job.columns, write
        write(json_header(job.profile.name, job.grid, job.timing_models, changes=job.changes))

    def add(self, block: "SweepBlock") -> None:
        """Write a block."""
        from busplan.answers.sweep.rows import json_rows

        self._write(json_rows(block, self._columns))

    def finish(self, *, complete: bool) -> None:
        """Close the document; a partial one is valid JSON that says so."""
        from busplan.answers.sweep.rows import json_footer

        self._write(json_footer(complete=complete))
