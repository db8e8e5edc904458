"""The seam of execution: tasks on any executor, a bounded number at once, done in any order, given in theirs."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager
from itertools import islice
from typing import Final, NamedTuple, Protocol, TypeVar

from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.questions.sweep.grid import Array

Task = TypeVar("Task")
Result = TypeVar("Result")

MOST_OUTSTANDING: Final = 512
"""Most tasks that are handed over and not given back: a cluster has enough to do, and memory stays flat."""
_GLANCE_S: Final = 0.2
"""Longest time between two calls of `watch`."""


class Here(Executor):
    """Runs each task at once, in this thread."""

    def submit(self, fn: Callable[..., Result], /, *args: object, **kwargs: object) -> "Future[Result]":
        """Run a task.

        Parameters
        ----------
        fn
            A function.
        *args, **kwargs
            Its arguments.
        """
        future: Future[Result] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - who asks for the result gets it
            future.set_exception(error)
        return future


def require_executor(executor: object, *, circle: bool) -> None:
    """Refuse an executor that is none, or that has no circle tests to run.

    Raises
    ------
    BusplanError
        Not a `concurrent.futures.Executor`, or given without circle tests.
    """
    if executor is not None and not (circle and isinstance(executor, Executor)):
        wrong = f" {executor!r}: expected a concurrent.futures.Executor" if circle else ": goes with circle=True"
        raise BusplanError(f"executor{wrong}")


def unknown(_task: object) -> None:
    """Know no result: every task is run."""


def _same(result: Result) -> Result:
    return result


def ignored(*_: object) -> None:
    """Do nothing."""


@contextmanager
def unreported(_title: str) -> Iterator[Progress]:
    """Report no progress."""
    yield ignored


class Kept(Protocol):
    """Results of earlier runs, and a place for new ones."""

    def __contains__(self, test: int, /) -> bool:
        """Whether a test is known, by its number."""

    def results(self, start: int, count: int) -> Array:
        """Results of known tests, as from `run_chunk`."""

    def add(self, start: int, results: Array) -> None:
        """Keep the results of a chunk."""


class Work(NamedTuple):
    """How the work of a sweep is run; its answer does not depend on that."""

    executor: Executor = Here()
    """Where circle tests run; it is not shut down."""
    progress: Callable[[str], AbstractContextManager[Progress]] = unreported
    """Opens the progress of a piece of work, by its name."""
    watch: Callable[[], None] = ignored
    """Called after each block, with circle tests some times a second; what it raises ends the work."""
    kept: Kept | None = None
    """Circle tests that need not be run; it takes those that were."""


def run_in_order(
    executor: Executor,
    function: Callable[[Task], Result],
    tasks: Iterable[Task],
    *,
    known: Callable[[Task], Result | None] = unknown,
    finished: Callable[[Task, Result], None] = ignored,
    watch: Callable[[], None] = ignored,
    most: int = MOST_OUTSTANDING,
) -> Iterator[Result]:
    """Run tasks on an executor, which is not shut down.

    Parameters
    ----------
    executor
        Where they run.
    function
        The work: for other processes, a function at the top of its module.
    tasks
        Its arguments; they are taken as there is room.
    known
        A result that need not be computed, or None.
    finished
        Called with each task that was run, as soon as it is done.
    watch
        Called some times a second and after each task; what it raises ends the run.
    most
        Most tasks that are handed over and not given back.

    Yields
    ------
    Result
        In the order of the tasks.

    Raises
    ------
    Exception
        The error of the first task that failed, after the results of those before it.
    CancelledError
        The executor cancelled a task.
    """
    order: deque[Future[Result]] = deque()
    running: dict[Future[Result], Task] = {}
    left = _handed_over(executor, function, tasks, known, running)
    is_open = True
    try:
        while is_open or order:
            # A task that is done is looked at before another is handed over.
            while is_open and len(order) < most and not any(map(Future.done, (*islice(order, 1), *running))):
                following = [*islice(left, 1)]
                is_open = bool(following)
                order.extend(following)
            if order and not order[0].done():
                wait(running, _GLANCE_S, FIRST_COMPLETED)
            for future in filter(Future.done, tuple(running)):
                task = running.pop(future)
                if future.cancelled() or future.exception() is not None:
                    is_open = False
                else:
                    finished(task, future.result())
            watch()
            while order and order[0] not in running:
                yield order.popleft().result()
    except BrokenExecutor:
        running.clear()  # it ends its calls itself, and stumbles over one that is cancelled meanwhile
        raise
    finally:
        for future in running:
            future.cancel()


def _handed_over(
    executor: Executor,
    function: Callable[[Task], Result],
    tasks: Iterable[Task],
    known: Callable[[Task], Result | None],
    running: dict[Future[Result], Task],
) -> Iterator[Future[Result]]:
    """Hand over one task after the other; those that are run stand in `running`."""
    for task in tasks:
        result = known(task)
        if result is not None:
            yield Here().submit(_same, result)
            continue
        future = executor.submit(function, task)
        running[future] = task
        yield future
