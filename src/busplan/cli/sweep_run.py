"""Run a sweep: compute, write and count block by block."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final, Literal, NamedTuple, Protocol, cast, get_args

from busplan.cli.answering import give, report_with
from busplan.cli.interrupt import StoppedError, signals_noted, stopped_by
from busplan.cli.output import CANNOT, emit_document, say
from busplan.cli.progress import progress_bar
from busplan.errors import WorkerLostError
from busplan.files import document_bytes, new_file, partial_path
from busplan.forms import Form, Picture, RowsForm, render

if TYPE_CHECKING:
    from busplan.cli.sweep_parts import Parts
    from busplan.questions.sweep import Digest, FigureData, Work
    from busplan.questions.sweep.asked import Sweep
    from busplan.questions.sweep.blocks import SweepBlock
    from busplan.questions.sweep.rows import RowsWriter

SweepForm = Literal[Form, RowsForm]
TOP_FORMS: Final = tuple(form for form in get_args(Form) if form not in get_args(RowsForm))
"""Forms with the top rows, for people."""


class SweepJob(NamedTuple):
    """A sweep, and where its answer goes."""

    sweep: "Sweep"
    """With the columns to write."""
    form: SweepForm
    output: Path | None
    top: int
    is_whole: bool
    """If True, a narrow terminal leaves out no column of the top rows."""
    sort_by: str | None
    ascending: bool
    plot: Path | None
    plot_form: Picture | None
    figure: str | None
    """Column of the picture; None for the default one."""
    jobs: int
    """Processes for circle tests, where there is no cluster."""
    cluster: str | None
    """Address of a Dask scheduler whose workers run the circle tests."""
    resume: bool
    """If True, go on with the parts of a sweep that did not end."""


class _Taker(Protocol):
    """Consumer of the blocks of a sweep, in order."""

    def add(self, block: "SweepBlock") -> None:
        """Take one more block."""


class _StoppedBetweenError(Exception):
    """A signal came in the middle of a block, which is left out."""


def run_sweep(job: SweepJob) -> None:
    """Compute, write and draw a sweep.

    Raises
    ------
    BusplanError
        A file cannot be written, a figure cannot be drawn, or the circle test of a point cannot be run.
    StoppedError
        Ctrl-C, SIGTERM, SIGHUP or a lost worker. The partial output is valid and marked as partial.
    """
    from busplan.forms.numbers import sentence_text
    from busplan.questions.sweep import Digest
    from busplan.questions.words.documents import changes_sentences

    sweep, drawing = job.sweep, _drawing(job)
    is_top = job.form in TOP_FORMS
    digest = Digest(sweep, top=job.top if is_top else 0, sort_by=job.sort_by, ascending=job.ascending)
    with ExitStack() as stack:
        # Left last: parts go when their file is complete.
        parts = _parts(job, stack)
        with signals_noted() as noted:
            # Opened before the work, so that a path that cannot be written fails at once.
            plot_file = stack.enter_context(new_file(job.plot, overwrite=True)) if job.plot else None
            file = (
                stack.enter_context(new_file(job.output, overwrite=True, keeps_after=StoppedError))
                if job.output
                else None
            )
            writer = _writer(job, file)
            takers = [taker for taker in (digest, writer, drawing) if taker is not None]
            lost = _work(job, takers, parts, writer, stopped=lambda: noted() is not None)
        complete = digest.points == sweep.grid.points
        if writer is None:
            _write_top(job, digest, file)
        else:
            writer.finish(complete=complete)
        if not is_top or file is not None:
            say(*map(sentence_text, (*changes_sentences(sweep.changes), *digest.sentences())))
        if not complete:
            kept = f"; kept in {partial_path(job.output)}" if job.output else ""
            signal = noted()
            cause = "interrupted" if lost is None or signal is not None else str(lost)
            say(f"{cause} after {digest.points:,} of {sweep.grid.points:,} points{kept}")
            if parts is not None and parts.tests:
                say(f"{parts.tests:,} of {sweep.tests:,} circle tests are in {parts.folder}: go on with --resume")
            raise StoppedError(CANNOT) if signal is None else stopped_by(signal)
        if drawing is not None and plot_file is not None and job.plot_form is not None:
            from busplan.forms.svg import content

            drawn = drawing.drawing(", ".join(filter(None, (sweep.profile.name, sweep.changes.words))))
            plot_file.write(document_bytes(content(drawn, job.plot_form)))
    for path in (job.output, job.plot):
        if path is not None:
            say(f"wrote {path}")


def _work(
    job: SweepJob,
    takers: "Sequence[_Taker]",
    parts: "Parts | None",
    writer: "RowsWriter | None",
    *,
    stopped: Callable[[], bool],
) -> WorkerLostError | None:
    """Pass each block to all takers, until the end or a stop; return the error of a lost worker."""
    from busplan.questions.sweep import sweep_blocks

    def watch() -> None:
        if stopped():
            raise _StoppedBetweenError

    sizes = {} if writer is None else {"chunk_points": writer.points}
    try:
        with _how(job, parts, watch) as work, closing(sweep_blocks(job.sweep, work, **sizes)) as blocks:
            for block in blocks:
                for taker in takers:
                    taker.add(block)
    except _StoppedBetweenError:
        return None
    except WorkerLostError as error:
        return error
    return None


def _drawing(job: SweepJob) -> "FigureData | None":
    if job.plot is None:
        return None
    from busplan.questions.sweep import FigureData

    return FigureData(job.sweep, figure=job.figure, option="--plot")


def _parts(job: SweepJob, stack: ExitStack) -> "Parts | None":
    if not job.sweep.circle or job.output is None:
        return None
    from busplan.cli.sweep_parts import kept_parts

    return stack.enter_context(kept_parts(job, job.output))


@contextmanager
def _how(job: SweepJob, parts: "Parts | None", watch: Callable[[], None]) -> "Iterator[Work]":
    """How the work is run: capacity in this thread, circle tests in worker processes or on a cluster."""
    from busplan.questions.sweep import Work

    work = Work(progress=progress_bar, watch=watch, kept=parts)
    with ExitStack() as stack:
        if parts is not None:
            stack.callback(parts.flush)
        if job.cluster is not None:
            from busplan.cli.cluster import cluster

            there, look = stack.enter_context(cluster(job.cluster))

            def watch_both() -> None:
                watch()
                look()

            work = work._replace(executor=there, watch=watch_both)
        elif job.sweep.circle:
            from busplan.cli.workers import executor

            work = work._replace(executor=stack.enter_context(executor(min(job.jobs, job.sweep.tests))))
        yield work


def _writer(job: SweepJob, file: BinaryIO | None) -> "RowsWriter | None":
    """Writer of every row; None where the answer has the top rows."""
    match job.form:
        case "csv" | "json" | "jsonl" | "parquet":
            from busplan.questions.sweep import rows_writer

            return rows_writer(job.form, job.sweep, emit_document if file is None else file.write)
        case _:
            return None


def _write_top(job: SweepJob, digest: "Digest", file: BinaryIO | None) -> None:
    """Write the answer with the top rows."""
    report = report_with(job.sweep.changes, digest.report())
    if file is None:
        give(report._replace(is_whole=job.is_whole), cast("Form", job.form))
    else:
        file.write(document_bytes(render(report, cast("Form", job.form))))
