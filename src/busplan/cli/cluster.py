"""The workers of a Dask scheduler as an executor. Importing this module does not need the extra `cluster`."""

import logging
import platform
import re
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from functools import partial
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from busplan import __version__
from busplan.cli.output import say
from busplan.errors import BusplanError, WorkerLostError
from busplan.forms.numbers import nouns

if TYPE_CHECKING:
    from distributed import Client
    from distributed import Future as DaskFuture

Result = TypeVar("Result")

_PATIENCE_S: Final = 5.0
"""Longest time until a scheduler answers."""
_LOOKS_S: Final = 1.0
"""Time between two looks at the workers."""
_ADDRESS: Final = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]{1,5}")


@contextmanager
def cluster(address: str) -> Iterator[tuple[Executor, Callable[[], None]]]:
    """Give the executor of a Dask cluster, and a function to call now and then, which says what becomes of it.

    A worker that dies is said, and Dask hands its tests to another; without workers, the tests wait.

    Parameters
    ----------
    address
        Of the scheduler, as tcp://HOST:8786.

    Raises
    ------
    BusplanError
        No scheduler answers, or a worker has other versions.
    WorkerLostError
        The scheduler ended, or the same tests were on several workers that died.
    """
    from distributed import KilledWorker

    # Dask tells of lost workers and schedulers in its log; they are said here.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    client = _connected(address)
    there = _Cluster(client)
    try:
        _require_versions(client, address)
        yield there, _Crew(client, address).look
    except KilledWorker as error:
        raise WorkerLostError(f"--cluster: several workers died of the same tests (out of memory?): {error}") from None
    except CancelledError:
        raise _ended(address) from None
    except ImportError as error:
        raise BusplanError(f"--cluster {address}: a worker does not load busplan {__version__}: {error}") from None
    finally:
        there.end()
        client.close(timeout=_PATIENCE_S)


def versions() -> dict[str, str]:
    """Versions on which the figures may depend."""
    return {"Python": platform.python_version(), "busplan": __version__, "numpy": np.__version__}


def checked(expected: dict[str, str], function: Callable[..., Result], *arguments: object) -> Result:
    """Call a function where the versions are the expected ones: a worker may come late.

    Raises
    ------
    BusplanError
        They differ.
    """
    wrong = _differences(versions(), expected)
    if wrong:
        raise BusplanError(f"--cluster: a worker on {platform.node()} has {wrong}; give it the same version")
    return function(*arguments)


def _differences(theirs: dict[str, str], ours: dict[str, str]) -> str:
    return ", ".join(f"{name} {theirs[name]} where {own} is here" for name, own in ours.items() if theirs[name] != own)


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


def _require_versions(client: "Client", address: str) -> None:
    """Refuse workers with other versions, by their names."""
    ours, problems = versions(), []
    for worker, theirs in sorted(client.run(versions, on_error="return").items()):
        if isinstance(theirs, dict):
            wrong = _differences(theirs, ours)
        else:
            wrong = f"no busplan {__version__} that loads ({theirs})"
        if wrong:
            problems.append(f"--cluster {address}: the worker {worker} has {wrong}; give it the same version")
    if problems:
        raise BusplanError(*problems)


def _ended(address: str) -> WorkerLostError:
    return WorkerLostError(f"the Dask scheduler {address} ended")


class _Cluster(Executor):
    """The workers, with a check of versions in front of each call.

    The client's own executor takes a result for an error if its worker dies while it is fetched; the client's futures
    fetch it again.
    """

    def __init__(self, client: "Client") -> None:
        self._client, self._versions, self._is_over = client, versions(), Event()

    def submit(self, fn: Callable[..., Result], /, *args: object, **kwargs: object) -> "Future[Result]":
        """Let a worker call a function, without named arguments."""
        future: Future[Result] = Future()
        # Not pure: a call has a new name, and nothing is hashed.
        there = self._client.submit(checked, self._versions, fn, *args, **kwargs, pure=False)
        there.add_done_callback(partial(self._fetch, future))
        return future

    def end(self) -> None:
        """Fetch no more results: Dask's thread for it does not end before they are there."""
        self._is_over.set()

    def _fetch(self, future: "Future[Result]", there: "DaskFuture[Result]") -> None:
        """Take over the outcome of a call; it may be computed again while it is fetched."""
        while not self._is_over.is_set():
            try:
                result = there.result(timeout=_LOOKS_S)
            except CancelledError:
                future.cancel()
            except Exception as error:  # noqa: BLE001 - who asks for the result gets it
                if isinstance(error, TimeoutError) and there.status != "error":
                    continue
                if future.set_running_or_notify_cancel():
                    future.set_exception(error)
            else:
                if future.set_running_or_notify_cancel():
                    future.set_result(result)
            return


class _Crew:
    """The workers, as of the last look."""

    def __init__(self, client: "Client", address: str) -> None:
        self._client, self._address = client, address
        self._workers: set[str] | None = None
        self._looked_s = -_LOOKS_S

    def look(self) -> None:
        """Say which workers are gone, and when there are none.

        Raises
        ------
        WorkerLostError
            The scheduler ended.
        """
        if monotonic() - self._looked_s < _LOOKS_S:
            return
        try:
            workers = set(self._client.nthreads())
        except (OSError, ValueError, RuntimeError):
            raise _ended(self._address) from None
        self._looked_s = monotonic()
        number = f"{len(workers)} {nouns(len(workers), 'worker')}"
        for gone in sorted((self._workers or set()) - workers):
            say(f"the worker {gone} left the cluster, which has {number}; its tests are run again by another")
        if not workers and self._workers != workers:
            say(f"the cluster {self._address} has no workers; the tests wait for one, and Ctrl-C ends them")
        elif workers and self._workers == set():
            say(f"the cluster has {number}; the tests go on")
        self._workers = workers
