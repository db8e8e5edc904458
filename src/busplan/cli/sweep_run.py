"""A sweep on its way: blocks are computed, written and counted one by one."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final, NamedTuple, Protocol

from busplan.cli.interrupt import StoppedError, signals_noted, stopped_by
from busplan.cli.output import CANNOT, document_bytes, emit, emit_document, new_file, partial_path, say
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError, WorkerLostError

if TYPE_CHECKING:
    from busplan.analysis.grid import Grid
    from busplan.analysis.sweep import Block
    from busplan.analysis.sweep_circle import CircleTask, Figures
    from busplan.cli.npz import Archive, NpzColumns
    from busplan.cli.sweep import SweepFormat
    from busplan.profile.model import Profile
    from busplan.report.sweep.figure import FigureData
    from busplan.report.sweep.top import Tally
    from busplan.timing import TimingModelName

_CIRCLES_AT_ONCE: Final = 4
"""Points that each process tests between two looks at signals."""


class SweepJob(NamedTuple):
    """What is asked for, each value checked."""

    profile: "Profile"
    grid: "Grid"
    timing_models: "tuple[TimingModelName, ...]"
    columns: tuple[str, ...]
    format_: "SweepFormat"
    output: Path | None
    top: int
    sort_by: str | None
    ascending: bool
    plot: Path | None
    plot_format: str | None
    figure: str
    jobs: int | None
    """Processes for circle tests; None without them."""
    force: bool
    """Whether their number does not matter."""


class _Sink(Protocol):
    """Where blocks go."""

    def add(self, block: "Block") -> None:
        """Take one more block."""

    def finish(self, *, complete: bool) -> None:
        """End the document; without all blocks it is a partial one."""


def available_processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_sweep(job: SweepJob) -> None:
    """Compute, write and draw a sweep.

    Raises
    ------
    BusplanError
        A file that cannot be written, a figure that cannot be drawn, or a point without a circle test.
    StoppedError
        Ctrl-C, SIGTERM, SIGHUP or a lost worker; what was written is valid, and says that it is partial.
    """
    from busplan.report.sweep.top import Tally

    drawing = _drawing(job)
    if job.jobs is not None:
        _require_circles(job)
    tally, expected = Tally(job.timing_models), job.grid.points
    with ExitStack() as stack:
        with signals_noted() as noted:
            # Opened before the work: a path that cannot be written is said at once.
            plot_file = stack.enter_context(new_file(job.plot, overwrite=True)) if job.plot else None
            file = stack.enter_context(new_file(job.output, overwrite=True, keeps_partial=True)) if job.output else None
            sink = stack.enter_context(_sink(job, file, tally))
            takers: list[Callable[[Block], None]] = [tally.add, sink.add, *([drawing.add] if drawing else [])]
            lost = _work(job, takers, progress=lambda: (tally.points, expected), stopped=lambda: noted() is not None)
        complete = tally.points == expected
        sink.finish(complete=complete)
        if job.format_ != "table" or file is not None:
            say(*(line.text for line in tally.lines(job.profile.name, expected=expected)))
        if not complete:
            kept = f"; kept in {partial_path(job.output)}" if job.output else ""
            say(f"{lost or 'interrupted'} after {tally.points:,} of {expected:,} points{kept}")
            signal = noted()
            raise StoppedError(CANNOT) if signal is None else stopped_by(signal)
        if drawing is not None and plot_file is not None and job.plot_format is not None:
            plot_file.write(drawing.draw(job.profile.name, file_format=job.plot_format))
    for path in (job.output, job.plot):
        if path is not None:
            say(f"wrote {path}")


def _work(
    job: SweepJob,
    takers: "Sequence[Callable[[Block], None]]",
    *,
    progress: Callable[[], tuple[int, int]],
    stopped: Callable[[], bool],
) -> WorkerLostError | None:
    """Hand each block to all takers, until all are done, or what stops it; gives the error of a lost worker."""
    try:
        with progress_bar("sweep") as report, _blocks(job) as blocks:
            for block in blocks:
                for take in takers:
                    take(block)
                report(*progress())
                if stopped():
                    break
    except WorkerLostError as error:
        return error
    return None


def _drawing(job: SweepJob) -> "FigureData | None":
    if job.plot is None:
        return None
    from busplan.report.sweep.figure import FigureData, require_drawable

    require_drawable(job.grid)
    return FigureData(job.grid, figure=job.figure, timing_models=job.timing_models)


def _require_circles(job: SweepJob) -> None:
    from busplan.analysis.sweep_circle import MAX_CIRCLES, require_circles

    if job.grid.points > MAX_CIRCLES and not job.force:
        raise BusplanError(
            f"--circle: {job.grid.points:,} points are more circle tests than the {MAX_CIRCLES:,} that are run without "
            "--force; vary less, or give it"
        )
    require_circles(job.profile, job.grid)


@contextmanager
def _blocks(job: SweepJob) -> "Iterator[Iterable[Block]]":
    """Blocks of a size that suits what is done with them."""
    from busplan.analysis.sweep import CHUNK_POINTS, sweep
    from busplan.report.sweep.rows import TEXT_POINTS

    if job.jobs is None:
        chunk_points = TEXT_POINTS if job.format_ in {"csv", "jsonl", "json"} else CHUNK_POINTS
        yield sweep(job.profile, job.grid, timing_models=job.timing_models, chunk_points=chunk_points)
        return
    from busplan.analysis.sweep_circle import with_circles

    few = sweep(job.profile, job.grid, timing_models=job.timing_models, chunk_points=_CIRCLES_AT_ONCE * job.jobs)
    with _circle_runner(min(job.jobs, job.grid.points)) as run:
        yield (with_circles(job.profile, block, timing_models=job.timing_models, run=run) for block in few)


@contextmanager
def _circle_runner(jobs: int) -> "Iterator[Callable[[Iterable[CircleTask]], Iterable[list[Figures]]]]":
    """Give a function that runs circle tests here, or in other processes."""
    from busplan.analysis.sweep_circle import run_task

    if jobs == 1:
        yield lambda tasks: map(run_task, tasks)
        return
    from busplan.cli.workers import workers

    with workers(jobs) as map_:
        yield lambda tasks: map_(run_task, tasks)


@contextmanager
def _sink(job: SweepJob, file: BinaryIO | None, tally: "Tally") -> Iterator[_Sink]:
    """Where the document goes."""
    if job.format_ == "table":
        yield _TableSink(job, file, tally)
    elif job.format_ == "npz":
        from busplan.cli.npz import NpzColumns

        folder = Path(os.path.realpath(job.output)).parent if job.output else None
        with NpzColumns(job.columns, folder=folder) as columns:
            yield _NpzSink(job, file or _Pipe(), columns)
    else:
        sink = _JsonSink if job.format_ == "json" else _TextSink
        yield sink(job, emit_document if file is None else lambda text: _write(file, text))


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


class _TableSink:
    """Keeps the rows at the top, for a table at the end."""

    def __init__(self, job: SweepJob, file: BinaryIO | None, tally: "Tally") -> None:
        from busplan.report.sweep.top import TopRows

        self._job, self._file, self._tally = job, file, tally
        self._rows = TopRows(job.columns, sort_by=job.sort_by, ascending=job.ascending, top=job.top)
        self.add = self._rows.add

    def finish(self, *, complete: bool) -> None:  # noqa: ARG002 - the tally knows
        """Write the table."""
        lines = self._rows.lines(self._tally, self._job.profile.name, expected=self._job.grid.points)
        if self._file is None:
            emit(lines)
        else:
            _write(self._file, "".join(f"{line.text}\n" for line in lines))


class _TextSink:
    """Writes every row as it comes, and each ends itself."""

    def __init__(self, job: SweepJob, write: Callable[[str], None]) -> None:
        from busplan.report.sweep.rows import csv_header, jsonl_header

        self._job, self._write = job, write
        if job.format_ == "csv":
            write(csv_header(job.columns))
        else:
            write(jsonl_header(job.profile.name, job.grid, job.timing_models))

    def add(self, block: "Block") -> None:
        """Write one more block."""
        from busplan.report.sweep.rows import block_text

        self._write(block_text(block, self._job.columns, style="csv" if self._job.format_ == "csv" else "jsonl"))

    def finish(self, *, complete: bool) -> None:
        """Nothing is left to write."""


class _JsonSink:
    """Writes one document, row by row."""

    def __init__(self, job: SweepJob, write: Callable[[str], None]) -> None:
        from busplan.report.sweep.rows import json_header

        self._columns, self._write = job.columns, write
        write(json_header(job.profile.name, job.grid, job.timing_models))

    def add(self, block: "Block") -> None:
        """Write one more block."""
        from busplan.report.sweep.rows import json_rows

        self._write(json_rows(block, self._columns))

    def finish(self, *, complete: bool) -> None:
        """Close the document; one that is not whole says so, and is still JSON."""
        from busplan.report.sweep.rows import json_footer

        self._write(json_footer(complete=complete))


class _NpzSink:
    """Collects columns, for an archive at the end."""

    def __init__(self, job: SweepJob, file: "Archive", columns: "NpzColumns") -> None:
        self._job, self._file, self._columns = job, file, columns
        self.add = columns.add

    def finish(self, *, complete: bool) -> None:
        """Write the archive, with what a reader must know of it."""
        from busplan.report.documents import document

        facts = document("sweep", profile=self._job.profile.name, points=self._job.grid.points, complete=complete)
        self._columns.write(self._file, facts)
