"""Processes of this machine and of a cluster, for circles of a sweep."""

import logging
import os
import platform
import re
import signal
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from busplan import __version__
from busplan.cli.output import ENDING, say
from busplan.errors import BusplanError, WorkerLostError
from busplan.extras import require_extra

if TYPE_CHECKING:
    from distributed import Client


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
    before = active_children()
    with _signals_blocked():  # also for Python's resource tracker, which starts here
        # Spawn: forking a process with threads is unsafe.
        crew = _Workers(number, mp_context=get_context("spawn"), initializer=_begin)
    try:
        yield crew
    except BrokenProcessPool:
        raise WorkerLostError("a worker was killed (out of memory?)") from None
    finally:
        for process in active_children():
            if process not in before:
                process.kill()
        # The executor's own thread joins them: a second one that did would take their exit codes from it.
        crew.shutdown(cancel_futures=True)


class _Workers(ProcessPoolExecutor):
    def submit(self, fn: Callable[..., Result], /, *args: object, **kwargs: object) -> "Future[Result]":
        """Let a worker call a function; workers and threads are started when they are needed first."""
        with _signals_blocked():
            future = super().submit(fn, *args, **kwargs)
        # Calls end with their workers. The executor's thread stumbles over a cancelled one when it sees them killed.
        future.cancel = lambda: False  # type: ignore[method-assign]
        return future


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Processes and threads that start meanwhile never get signals: those of a group are for this thread alone."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
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


_PATIENCE_S: Final = 5.0
"""Longest time until a scheduler answers."""
_ADDRESS: Final = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]{1,5}")


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Give the executor of a Dask cluster. Tests of a worker that dies run on another; without workers, they wait.

    Parameters
    ----------
    address
        Of the scheduler, as tcp://HOST:8786.

    Raises
    ------
    BusplanError
        The extra is missing, no scheduler answers, or a worker has other versions.
    WorkerLostError
        The scheduler ended, or the same tests were on several workers that died.
    """
    require_extra("distributed", extra="cluster", option="--cluster", module="distributed")
    from distributed import KilledWorker

    # Dask tells of lost workers and schedulers in its log.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    client = _connected(address)
    try:
        if not _require_versions(client, address):
            say(f"the cluster {address} has no workers; the tests wait for one, and Ctrl-C ends them")
        yield client.get_executor(pure=False)
        _require_versions(client, address)  # of workers that came meanwhile, before anything is written
    except KilledWorker as error:
        raise WorkerLostError(f"--cluster: several workers died of the same tests (out of memory?): {error}") from None
    except CancelledError:
        raise WorkerLostError(f"the Dask scheduler {address} ended") from None
    except ImportError as error:
        raise BusplanError(f"--cluster {address}: a worker does not load busplan {__version__}: {error}") from None
    finally:
        client.close(timeout=_PATIENCE_S)


def versions() -> dict[str, str]:
    """Versions on which the figures may depend."""
    return {"Python": platform.python_version(), "busplan": __version__, "numpy": np.__version__}


def _connected(address: str) -> "Client":
    from distributed import Client

    if not _ADDRESS.fullmatch(address):
        raise BusplanError(f"--cluster {address}: expected the address of a Dask scheduler, as tcp://HOST:8786")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of versions that differ: those that matter are refused
            return Client(address, timeout=_PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise BusplanError(f"--cluster {address}: no Dask scheduler answers there: {error}") from None


def _require_versions(client: "Client", address: str) -> int:
    """Refuse workers with other versions, by their names; return how many workers there are."""
    ours, problems = versions(), []
    workers = client.run(versions, on_error="return")
    for worker, theirs in sorted(workers.items()):
        if isinstance(theirs, dict):
            wrong = ", ".join(
                f"{name} {theirs[name]} where {here} is here" for name, here in ours.items() if theirs[name] != here
            )
        else:
            wrong = f"no busplan {__version__} that loads ({theirs})"
        if wrong:
            problems.append(f"--cluster {address}: the worker {worker} has {wrong}; give it the same version")
    if problems:
        raise BusplanError(*problems)
    return len(workers)
