"""A progress bar on stderr for work longer than a second, if stderr is a terminal."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from busplan.progress import Progress

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

_PATIENCE_S = 1.0


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """Give a function that takes the work done and the total work.

    Parameters
    ----------
    title
        Name of the work.
    """
    started = monotonic()
    bar: Bar | None = None

    def report(done: int, total: int) -> None:
        nonlocal bar
        if bar is None:
            if not sys.stderr.isatty() or monotonic() - started < _PATIENCE_S:
                return
            bar = _start()
            bar.add_task(title)
        bar.update(bar.task_ids[0], completed=done, total=total)

    try:
        yield report
    finally:
        if bar is not None:
            bar.stop()


def _start() -> "Bar":
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(console=Console(stderr=True), transient=True)
    bar.start()
    return bar
