"""Destinations for the blocks of a sweep: the top rows, or every row."""

from typing import TYPE_CHECKING, BinaryIO, NoReturn

from busplan.cli.answering import give, report_with
from busplan.cli.output import emit_document
from busplan.errors import BusplanError
from busplan.files import document_bytes
from busplan.forms import Form, render

if TYPE_CHECKING:
    from busplan.answers.sweep.top import Tally
    from busplan.answers.sweep.writers import RowsWriter
    from busplan.cli.sweep_job import SweepJob


def sink_for(job: "SweepJob", file: BinaryIO | None, tally: "Tally") -> "RowsWriter":
    """Make the destination of a sweep."""
    match job.form:
        case "csv" | "json" | "jsonl" | "parquet":
            from busplan.answers.sweep.rows import SweepTable
            from busplan.answers.sweep.writers import rows_writer

            table = SweepTable(job.profile, job.grid, job.timing_models, job.columns, job.changes, job.tests)
            return rows_writer(job.form, table, emit_document if file is None else file.write)
        case _:
            return _TopSink(job, job.form, file, tally)


class _TopSink:
    """Keeps the top rows for an answer at the end."""

    def __init__(self, job: "SweepJob", form: Form, file: BinaryIO | None, tally: "Tally") -> None:
        from busplan.analysis.sweep.blocks import CHUNK_POINTS
        from busplan.answers.sweep.top import TopRows

        self.points = CHUNK_POINTS
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
            self._file.write(document_bytes(render(report, self._form)))


def _not_kept() -> NoReturn:
    raise BusplanError("a sweep's document has every row: it is written as the rows come, and not from a few of them")
