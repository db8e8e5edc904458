"""Worker processes: they end with this process, even if it is killed, and leave its signals and streams to it."""

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread
from typing import TypeVar

from busplan.cli.interrupt import ENDING
from busplan.errors import WorkerLostError

Result = TypeVar("Result")


def available_processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def executor(number: int) -> Iterator[Executor | None]:
    """Give an executor of several processes, as `workers`; None for this process alone."""
    if number == 1:
        yield None
        return
    with workers(number) as crew:
        yield crew


@contextmanager
def workers(number: int) -> Iterator[Executor]:
    """Give an executor of worker processes; at the end they are killed, whatever they do.

    Parameters
    ----------
    number
        How many.

    Raises
    ------
    WorkerLostError
        A worker was killed.
    """
    others = active_children()
    with _signals_blocked():  # also for Python's resource tracker, which starts here
        # Spawn: forking a process with threads is unsafe.
        crew = _Workers(number, mp_context=get_context("spawn"), initializer=_begin)
    try:
        yield crew
    except BrokenProcessPool:
        raise WorkerLostError("a worker was killed (out of memory?)") from None
    finally:
        for process in active_children():
            if process not in others:
                process.kill()
        # The executor's own thread joins them: a second one that did would take their exit codes from it.
        crew.shutdown(cancel_futures=True)


class _Workers(ProcessPoolExecutor):
    def submit(self, fn: Callable[..., Result], /, *args: object, **kwargs: object) -> "Future[Result]":
        """Let a worker call a function; workers and threads are started when they are needed first."""
        with _signals_blocked():
            future = super().submit(fn, *args, **kwargs)
        # Calls end with their workers. The executor's thread stumbles over a cancelled one when it sees them killed.
        future.cancel = _refuse  # type: ignore[method-assign]
        return future


def _refuse() -> bool:
    return False


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Processes and threads that start meanwhile never get signals: those of a group are for this thread alone."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
