"""Run a sweep: compute, write and count block by block."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final, Literal, NamedTuple, NoReturn, get_args

from busplan.cli.answering import give, report_with
from busplan.cli.interrupt import StoppedError, signals_noted, stopped_by
from busplan.cli.output import CANNOT, emit_document, say
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError, WorkerLostError
from busplan.files import document_bytes, new_file, partial_path
from busplan.forms import Form, Picture, RowsForm, render
from busplan.progress import Progress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from busplan.cli.sweep_parts import Parts
    from busplan.questions.sweep.asked import Sweep
    from busplan.questions.sweep.blocks import SweepBlock
    from busplan.questions.sweep.plot import FigureData
    from busplan.questions.sweep.top import Tally
    from busplan.questions.sweep.writers import RowsWriter

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
    jobs: int | None
    """Processes for circle tests, where there is no cluster; None without circle tests."""
    cluster: str | None
    """Address of a Dask scheduler whose workers run the circle tests."""
    resume: bool
    """If True, go on with the parts of a sweep that did not end."""


class _StoppedBetweenError(Exception):
    """A signal came: what is in the middle of a block is left out."""


def run_sweep(job: SweepJob) -> None:
    """Compute, write and draw a sweep.

    Raises
    ------
    BusplanError
        A file cannot be written, a figure cannot be drawn, or the circle test of a point cannot be run.
    StoppedError
        Ctrl-C, SIGTERM, SIGHUP or a lost worker. The partial output is valid and marked as partial.
    """
    from busplan.forms.columns import sentence_text
    from busplan.questions.sweep.top import Tally
    from busplan.questions.words.documents import changes_sentences

    sweep, drawing, tally = job.sweep, _drawing(job), Tally(job.sweep)
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
            sink = _sink(job, file, tally)
            takers: list[Callable[[SweepBlock], None]] = [tally.add, sink.add, *([drawing.add] if drawing else [])]
            lost = _work(job, takers, parts, points=sink.points, stopped=lambda: noted() is not None)
        complete = tally.points == sweep.grid.points
        sink.finish(complete=complete)
        if job.form not in TOP_FORMS or file is not None:
            say(*map(sentence_text, (*changes_sentences(sweep.changes), *tally.sentences())))
        if not complete:
            kept = f"; kept in {partial_path(job.output)}" if job.output else ""
            signal = noted()
            cause = "interrupted" if lost is None or signal is not None else str(lost)
            say(f"{cause} after {tally.points:,} of {sweep.grid.points:,} points{kept}")
            if parts is not None and parts.tests:
                say(f"{parts.tests:,} of {sweep.tests:,} circle tests are in {parts.folder}: go on with --resume")
            raise StoppedError(CANNOT) if signal is None else stopped_by(signal)
        if drawing is not None and plot_file is not None and job.plot_form is not None:
            from busplan.forms.raster import picture

            svg = drawing.svg(", ".join(filter(None, (sweep.profile.name, sweep.changes.words))))
            plot_file.write(document_bytes(picture(svg, job.plot_form)))
    for path in (job.output, job.plot):
        if path is not None:
            say(f"wrote {path}")


def _work(
    job: SweepJob,
    takers: "Sequence[Callable[[SweepBlock], None]]",
    parts: "Parts | None",
    *,
    points: int,
    stopped: Callable[[], bool],
) -> WorkerLostError | None:
    """Pass each block to all takers, until the end or a stop; return the error of a lost worker."""

    def watch() -> None:
        if stopped():
            raise _StoppedBetweenError

    try:
        with progress_bar("sweep") as report, _blocks(job, parts, points, report, watch) as blocks:
            for block in blocks:
                for take in takers:
                    take(block)
                watch()
    except _StoppedBetweenError:
        return None
    except WorkerLostError as error:
        return error
    return None


def _drawing(job: SweepJob) -> "FigureData | None":
    if job.plot is None:
        return None
    from busplan.questions.sweep.plot import FigureData, require_drawable

    require_drawable(job.sweep.grid, option="--plot")
    return FigureData(job.sweep, figure=job.figure)


def _parts(job: SweepJob, stack: ExitStack) -> "Parts | None":
    if job.jobs is None or job.output is None:
        return None
    from busplan.cli.sweep_parts import kept_parts

    return stack.enter_context(kept_parts(job, job.output))


@contextmanager
def _blocks(
    job: SweepJob, parts: "Parts | None", points: int, report: Progress, watch: Callable[[], None]
) -> "Iterator[Iterable[SweepBlock]]":
    """Blocks of a suitable size: as the form wants them, or fewer points where each is a circle test."""
    from busplan.questions.sweep.blocks import sweep

    asked = job.sweep
    if job.jobs is None:
        blocks = sweep(asked.profile, asked.grid, timing_models=asked.timing_models, chunk_points=points)
        yield _reported(blocks, asked.grid.points, report)
        return
    from busplan.questions.sweep.circle_run import circle_blocks, require_circles

    with ExitStack() as stack:
        if parts is not None:
            stack.callback(parts.flush)
        where, watch = stack.enter_context(_where(job, watch))
        with progress_bar("check of the points") as checked:
            cost = require_circles(asked, where, progress=lambda done: checked(done, asked.grid.points), watch=watch)
        yield circle_blocks(
            asked,
            where,
            cost=cost,
            kept=parts,
            progress=lambda done: report(done, asked.tests),
            watch=watch,
        )


@contextmanager
def _where(job: SweepJob, watch: Callable[[], None]) -> "Iterator[tuple[Executor, Callable[[], None]]]":
    """Executor of circle tests, and what must be watched while it works."""
    if job.cluster is not None:
        from busplan.cli.cluster import cluster

        with cluster(job.cluster) as (there, look):

            def watch_both() -> None:
                watch()
                look()

            yield there, watch_both
        return
    from busplan.cli.workers import executor

    with executor(min(job.jobs or 1, job.sweep.tests)) as here:
        yield here, watch


def _reported(blocks: "Iterable[SweepBlock]", points: int, report: Progress) -> "Iterator[SweepBlock]":
    for block in blocks:
        yield block
        report(block.chunk.start + block.chunk.points, points)


def _sink(job: SweepJob, file: BinaryIO | None, tally: "Tally") -> "RowsWriter":
    """Destination for the blocks: the top rows, or every row."""
    match job.form:
        case "csv" | "json" | "jsonl" | "parquet":
            from busplan.questions.sweep.writers import rows_writer

            return rows_writer(job.form, job.sweep, emit_document if file is None else file.write)
        case _:
            return _TopSink(job, job.form, file, tally)


class _TopSink:
    """Keeps the top rows for an answer at the end."""

    def __init__(self, job: SweepJob, form: Form, file: BinaryIO | None, tally: "Tally") -> None:
        from busplan.questions.sweep.blocks import CHUNK_POINTS
        from busplan.questions.sweep.top import TopRows

        self.points = CHUNK_POINTS
        self._job, self._form, self._file, self._tally = job, form, file, tally
        self._rows = TopRows(job.sweep.columns, sort_by=job.sort_by, ascending=job.ascending, top=job.top)
        self.add = self._rows.add

    def finish(self, *, complete: bool) -> None:  # noqa: ARG002 - `tally` has the number of points
        """Write the answer."""
        from busplan.questions.sweep.top import sweep_report

        report = report_with(self._job.sweep.changes, sweep_report(self._rows, self._tally, document=_not_kept))
        if self._file is None:
            give(report._replace(is_whole=self._job.is_whole), self._form)
        else:
            self._file.write(document_bytes(render(report, self._form)))


def _not_kept() -> NoReturn:
    raise BusplanError("a sweep's document has every row: it is written as the rows come, and not from a few of them")
