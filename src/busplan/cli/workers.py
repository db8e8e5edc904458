"""Worker processes: they end with the parent, even if it is killed, and do not hold its streams."""

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
    """The built-in `map`, in other processes."""

    def __call__(self, function: Callable[[Task], Result], tasks: Iterable[Task], /) -> list[Result]:
        """Return the results in the order of the tasks."""


@contextmanager
def workers(number: int) -> Iterator[Map]:
    """Start worker processes and give a `map`, which raises `WorkerLostError` if one of them is killed.

    The standard library's pools may hang when a worker or the parent is killed.
    """
    with ExitStack() as crew:
        # Start Python's resource tracker first, because it would unblock the signals blocked below.
        ensure_running()
        # Signals to the whole process group are for the parent only: workers inherit the blocked mask.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        try:
            pipes = [_started(crew) for _ in range(number)]
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield lambda function, tasks: _shared(pipes, function, tasks)


def _started(crew: ExitStack) -> Connection:
    # Spawn: forking a process with threads is unsafe.
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    crew.enter_context(ours)
    process.start()
    theirs.close()
    crew.callback(process.join)
    # At this point all results are received or no longer needed.
    crew.callback(process.kill)
    return ours


def _shared(pipes: list[Connection], function: Callable[[Task], Result], tasks: Iterable[Task]) -> list[Result]:
    """Send each worker one task at a time."""
    left = enumerate(tasks)
    found: dict[int, Result] = {}
    free, busy = list(pipes), dict[Connection, int]()
    while True:
        # zip takes a worker before a task, so no task is lost.
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
    """Run tasks from the pipe until it is closed."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        while True:
            function, task = pipe.recv()
            pipe.send(_tried(function, task))


def _tried(function: Callable[[Task], Result], task: Task) -> tuple[Result | None, Exception | None]:
    """Result of a task, or its error, which the parent raises."""
    try:
        return function(task), None
    except Exception as error:  # noqa: BLE001 - as above
        return None, error


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
