"""The workers of a Dask scheduler, as Dask's own executor. Importing this module does not need the extra `cluster`."""

import logging
import platform
import re
import warnings
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

import numpy as np

from busplan import __version__
from busplan.cli.output import say
from busplan.errors import BusplanError, WorkerLostError

if TYPE_CHECKING:
    from distributed import Client

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
        No scheduler answers, or a worker has other versions.
    WorkerLostError
        The scheduler ended, or the same tests were on several workers that died.
    """
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
                f"{name} {theirs[name]} where {own} is here" for name, own in ours.items() if theirs[name] != own
            )
        else:
            wrong = f"no busplan {__version__} that loads ({theirs})"
        if wrong:
            problems.append(f"--cluster {address}: the worker {worker} has {wrong}; give it the same version")
    if problems:
        raise BusplanError(*problems)
    return len(workers)
