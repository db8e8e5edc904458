"""Processes that share the work: they end with this one, whatever ended it, and hold none of its streams."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread
from typing import Protocol, TypeVar

from busplan.cli.interrupt import ENDING
from busplan.errors import WorkerLostError

Task = TypeVar("Task")
Answer = TypeVar("Answer")


class Map(Protocol):
    """The built-in `map`, by other processes."""

    def __call__(
        self, function: Callable[[Task], Answer], tasks: Iterable[Task], /, *, chunksize: int = 1
    ) -> Iterator[Answer]:
        """Give the answers in the order of the tasks."""


@contextmanager
def workers(number: int) -> Iterator[Map]:
    """Start worker processes; gives a `map` by them, which raises `WorkerLostError` when one of them is killed."""
    # Fresh processes: a fork would take this one's threads by surprise.
    pool = ProcessPoolExecutor(number, mp_context=get_context("spawn"), initializer=_begin)

    def map_(function: Callable[[Task], Answer], tasks: Iterable[Task], /, *, chunksize: int = 1) -> Iterator[Answer]:
        try:
            yield from pool.map(function, tasks, chunksize=chunksize)
        except BrokenProcessPool:
            raise WorkerLostError("a worker was killed (out of memory?)") from None

    try:
        yield map_
    finally:
        # All answers are there, or nobody waits for them any more.
        for child in active_children():
            child.kill()
        pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """Prepare a worker: it listens to its parent alone."""
    # What ends a whole group of processes is for the one that hands the work out.
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
