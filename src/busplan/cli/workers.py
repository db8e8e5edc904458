"""Processes that share the work: they end with this one, whatever ended it, and hold none of its streams."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.resource_tracker import ensure_running
from threading import Thread
from typing import Protocol, TypeVar

from busplan.cli.interrupt import ENDING
from busplan.errors import WorkerLostError

Task = TypeVar("Task")
Result = TypeVar("Result")


class Map(Protocol):
    """The built-in `map`, by other processes."""

    def __call__(self, function: Callable[[Task], Result], tasks: Iterable[Task], /) -> list[Result]:
        """Give the answers in the order of the tasks."""


@contextmanager
def workers(number: int) -> Iterator[Map]:
    """Start worker processes; gives a `map` by them, which raises `WorkerLostError` when one of them is killed.

    The standard library's pools do not bear that workers, or their parent, are killed.
    """
    with ExitStack() as crew:
        # Python's own helper for processes lets the signals go that are held here.
        ensure_running()
        # What ends a whole group of processes is for the one that hands the work out: workers never hear of it.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        try:
            pipes = [_started(crew) for _ in range(number)]
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield lambda function, tasks: _shared(pipes, function, tasks)


def _started(crew: ExitStack) -> Connection:
    # Fresh processes: a fork would take this one's threads by surprise.
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    crew.enter_context(ours)
    process.start()
    theirs.close()
    crew.callback(process.join)
    # All answers are there then, or nobody waits for them any more.
    crew.callback(process.kill)
    return ours


def _shared(pipes: list[Connection], function: Callable[[Task], Result], tasks: Iterable[Task]) -> list[Result]:
    """Give each worker one task at a time."""
    left = enumerate(tasks)
    found: dict[int, Result] = {}
    free, busy = list(pipes), dict[Connection, int]()
    while True:
        # First a worker, then a task: each task that is taken is handed out.
        for pipe, (place, task) in zip(free, left, strict=False):
            with _lost():
                pipe.send((function, task))
            busy[pipe] = place
        if not busy:
            return [found[place] for place in sorted(found)]
        ready = wait(busy)
        free = [pipe for pipe in pipes if pipe in ready]
        for pipe in free:
            with _lost():
                answer, error = pipe.recv()
            if error is not None:
                raise error
            found[busy.pop(pipe)] = answer


@contextmanager
def _lost() -> Iterator[None]:
    try:
        yield
    except (EOFError, OSError):
        raise WorkerLostError("a worker was killed (out of memory?)") from None


def _work(pipe: Connection) -> None:
    """Do what comes down the pipe, until the parent is done."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        while True:
            function, task = pipe.recv()
            pipe.send(_tried(function, task))


def _tried(function: Callable[[Task], Result], task: Task) -> tuple[Result | None, Exception | None]:
    """The answer, or the error, which the one that hands the work out tells."""
    try:
        return function(task), None
    except Exception as error:  # noqa: BLE001 - as above
        return None, error


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
