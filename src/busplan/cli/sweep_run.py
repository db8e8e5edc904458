"""Run a sweep: compute, write and count block by block."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from busplan.cli.interrupt import StoppedError, signals_noted, stopped_by
from busplan.cli.output import CANNOT, say
from busplan.cli.progress import progress_bar
from busplan.cli.sweep_job import TOP_FORMS
from busplan.cli.sweep_sinks import sink_for
from busplan.errors import WorkerLostError
from busplan.files import document_bytes, new_file, partial_path
from busplan.progress import Progress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from busplan.analysis.sweep.blocks import SweepBlock
    from busplan.cli.sweep_job import SweepJob
    from busplan.cli.sweep_parts import Parts
    from busplan.drawings.sweep_plot import FigureData


class _StoppedBetweenError(Exception):
    """A signal came: what is in the middle of a block is left out."""


def available_processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_sweep(job: "SweepJob") -> None:
    """Compute, write and draw a sweep.

    Raises
    ------
    BusplanError
        A file cannot be written, a figure cannot be drawn, or the circle test of a point cannot be run.
    StoppedError
        Ctrl-C, SIGTERM, SIGHUP or a lost worker. The partial output is valid and marked as partial.
    """
    from busplan.answers.documents import changes_sentences
    from busplan.answers.sweep.top import Tally
    from busplan.forms.columns import sentence_text

    drawing = _drawing(job)
    if job.jobs is not None and not job.force:
        _require_few(job)
    tally = Tally(job.profile, job.grid, job.timing_models, seeds=job.tests)
    expected = tally.expected
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
            sink = sink_for(job, file, tally)
            takers: list[Callable[[SweepBlock], None]] = [tally.add, sink.add, *([drawing.add] if drawing else [])]
            lost = _work(job, takers, parts, points=sink.points, stopped=lambda: noted() is not None)
        complete = tally.points == expected
        sink.finish(complete=complete)
        if job.form not in TOP_FORMS or file is not None:
            say(*map(sentence_text, (*changes_sentences(job.changes), *tally.sentences())))
        if not complete:
            kept = f"; kept in {partial_path(job.output)}" if job.output else ""
            say(f"{lost or 'interrupted'} after {tally.points:,} of {expected:,} points{kept}")
            if parts is not None and parts.tests:
                all_tests = expected * (job.tests or 1)
                say(f"{parts.tests:,} of {all_tests:,} circle tests are in {parts.folder}: go on with --resume")
            signal = noted()
            raise StoppedError(CANNOT) if signal is None else stopped_by(signal)
        if drawing is not None and plot_file is not None and job.plot_form is not None:
            from busplan.forms.raster import picture

            svg = drawing.svg(", ".join(filter(None, (job.profile.name, job.changes.words))))
            plot_file.write(document_bytes(picture(svg, job.plot_form)))
    for path in (job.output, job.plot):
        if path is not None:
            say(f"wrote {path}")


def _work(
    job: "SweepJob",
    takers: "Sequence[Callable[[SweepBlock], None]]",
    parts: "Parts | None",
    *,
    points: int,
    stopped: Callable[[], bool],
) -> WorkerLostError | None:
    """Pass each block to all takers, until the end or a stop; return the error of a lost worker."""

    def watch(*_: object) -> None:
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


def _drawing(job: "SweepJob") -> "FigureData | None":
    if job.plot is None:
        return None
    from busplan.drawings.sweep_plot import FigureData, default_figure, require_drawable

    require_drawable(job.grid, option="--plot")
    figure = job.figure or default_figure(job.profile)
    return FigureData(job.profile, job.grid, figure=figure, timing_models=job.timing_models)


def _require_few(job: "SweepJob") -> None:
    from busplan.analysis.sweep.circles import require_few

    require_few(job.grid, seeds=job.tests or 1, option="--circle", consent="--force")


def _parts(job: "SweepJob", stack: ExitStack) -> "Parts | None":
    if job.jobs is None or job.output is None:
        return None
    from busplan.cli.sweep_parts import kept_parts

    return stack.enter_context(kept_parts(job, job.output))


@contextmanager
def _blocks(
    job: "SweepJob", parts: "Parts | None", points: int, report: Progress, watch: Callable[[], None]
) -> "Iterator[Iterable[SweepBlock]]":
    """Blocks of a suitable size: as the form wants them, or fewer points where each is a circle test."""
    from busplan.analysis.sweep.blocks import sweep

    if job.jobs is None:
        yield _reported(sweep(job.profile, job.grid, timing_models=job.timing_models, chunk_points=points), job, report)
        return
    from busplan.analysis.sweep.circle_run import NOTHING_KEPT, CircleTests, circle_blocks, require_circles

    tests = CircleTests(job.profile, job.grid, job.seeds)
    with ExitStack() as stack:
        if parts is not None:
            stack.callback(parts.flush)
        where, watch = stack.enter_context(_where(job, tests.number, watch))
        with progress_bar("check of the points") as checked:
            cost = require_circles(tests, where, progress=lambda done: checked(done, tests.grid.points), watch=watch)
        yield circle_blocks(
            tests,
            where,
            timing_models=job.timing_models,
            cost=cost,
            kept=parts or NOTHING_KEPT,
            progress=lambda done: report(done, tests.number),
            watch=watch,
        )


@contextmanager
def _where(job: "SweepJob", tests: int, watch: Callable[[], None]) -> "Iterator[tuple[Executor, Callable[[], None]]]":
    """Executor of circle tests, and what must be watched while it works."""
    if job.cluster is None:
        with executor(min(job.jobs or 1, tests)) as here:
            yield here, watch
        return
    from busplan.cli.cluster import cluster

    with cluster(job.cluster) as (there, look):

        def watch_both() -> None:
            watch()
            look()

        yield there, watch_both


def _reported(blocks: "Iterable[SweepBlock]", job: "SweepJob", report: Progress) -> "Iterator[SweepBlock]":
    for block in blocks:
        yield block
        report(block.chunk.start + block.chunk.points, job.grid.points)


@contextmanager
def executor(jobs: int) -> "Iterator[Executor]":
    """Give an executor that works here, or in other processes.

    Parameters
    ----------
    jobs
        Number of processes [1].
    """
    if jobs == 1:
        from busplan.analysis.sweep.execution import Here

        yield Here()
        return
    from busplan.cli.workers import workers

    with workers(jobs) as crew:
        yield crew
