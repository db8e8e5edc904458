"""Worker processes: they end with the parent, even if it is killed, and do not hold its streams."""

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running
from queue import Empty, SimpleQueue
from threading import Event, Thread
from typing import Any, NamedTuple, TypeVar

from busplan.cli.interrupt import ENDING
from busplan.errors import WorkerLostError

Result = TypeVar("Result")


@contextmanager
def workers(number: int) -> Iterator["Workers"]:
    """Start worker processes and give their executor; at the end they are killed, whatever they do.

    Parameters
    ----------
    number
        How many.
    """
    crew = Workers(number)
    try:
        yield crew
    finally:
        crew.kill()


class _Call(NamedTuple):
    future: "Future[Any]"
    function: Callable[..., Any]
    arguments: tuple[object, ...]
    named: dict[str, object]


class Workers(Executor):
    """An executor of worker processes. A result of a lost one, and all after it, is a `WorkerLostError`.

    The standard library's pools may hang when a worker or the parent is killed.

    Parameters
    ----------
    number
        How many.
    """

    def __init__(self, number: int) -> None:
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        self._is_lost = Event()
        self._is_shut = False
        # Start Python's resource tracker first, because it would unblock the signals blocked below.
        ensure_running()
        # Signals to the whole process group are for the parent only: workers inherit the blocked mask.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        try:
            self._crew = [_started() for _ in range(number)]
            # Threads of the parent leave signals to its main thread in the same way.
            self._threads = [Thread(target=self._serve, args=(pipe,), daemon=True) for _, pipe in self._crew]
            for thread in self._threads:
                thread.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def submit(self, fn: Callable[..., Result], /, *args: object, **kwargs: object) -> "Future[Result]":
        """Let the next free worker call a function."""
        if self._is_shut:
            raise RuntimeError("the workers are shut down")
        future: Future[Result] = Future()
        self._calls.put(_Call(future, fn, args, kwargs))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; the workers end after the last one."""
        if cancel_futures:
            with suppress(Empty):
                while True:
                    call = self._calls.get_nowait()
                    if call is not None:
                        call.future.cancel()
        self._is_shut = True
        for _ in self._threads:
            self._calls.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def kill(self) -> None:
        """End the workers at once."""
        self.shutdown(wait=False, cancel_futures=True)
        for process, _ in self._crew:
            process.kill()
        for process, _ in self._crew:
            process.join()
        for thread in self._threads:
            thread.join()

    def _serve(self, pipe: Connection) -> None:
        """Give one worker one call at a time."""
        with pipe:
            while (call := self._calls.get()) is not None:
                if call.future.set_running_or_notify_cancel():
                    try:
                        call.future.set_result(self._answer(pipe, call))
                    except Exception as error:  # noqa: BLE001 - who asks for the result gets it
                        call.future.set_exception(error)

    def _answer(self, pipe: Connection, call: _Call) -> object:
        if not self._is_lost.is_set():
            try:
                pipe.send((call.function, call.arguments, call.named))
                answer, error = pipe.recv()
            except (EOFError, OSError):
                self._is_lost.set()
            else:
                if error is not None:
                    raise error
                return answer
        raise WorkerLostError("a worker was killed (out of memory?)")


def _started() -> tuple[BaseProcess, Connection]:
    # Spawn: forking a process with threads is unsafe.
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    return process, ours


def _work(pipe: Connection) -> None:
    """Run calls from the pipe until it is closed."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        while True:
            function, arguments, named = pipe.recv()
            pipe.send(_tried(function, arguments, named))


def _tried(
    function: Callable[..., Result], arguments: tuple[object, ...], named: dict[str, object]
) -> tuple[Result | None, Exception | None]:
    """Result of a call, or its error, which the parent raises."""
    try:
        return function(*arguments, **named), None
    except Exception as error:  # noqa: BLE001 - as above
        return None, error


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
