"""The seam of execution: any executor, a bounded number outstanding, any order of completion, results in order."""

import os
import random
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import closing
from itertools import count
from multiprocessing import active_children
from threading import Condition, Thread
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.cli.workers import workers
from busplan.errors import WorkerLostError
from busplan.questions.sweep.circle_run import chunk_tests
from busplan.questions.sweep.circles import CIRCLE_COLUMNS
from busplan.questions.sweep.execution import Here, run_in_order


class Shuffled(Executor):
    """Runs what was handed over in any order, once nobody hands over more or some are waiting."""

    def __init__(self, seed: int, *, waiting: int = 1) -> None:
        self._random, self._waiting = random.Random(seed), waiting
        self._calls: list[tuple[Future[Any], Callable[..., Any], tuple[object, ...]]] = []
        self._changed, self._is_open = Condition(), True
        self.order: list[object] = []
        self.most = 0
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: object, **_kwargs: object) -> "Future[Any]":
        future: Future[Any] = Future()
        with self._changed:
            self._calls.append((future, fn, args))
            self.most = max(self.most, len(self._calls))
            self._changed.notify()
        return future

    def close(self) -> None:
        with self._changed:
            self._is_open = False
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: len(self._calls) >= self._waiting or not self._is_open, timeout=0.002)
                if not self._calls:
                    if not self._is_open:
                        return
                    continue
                future, function, arguments = self._calls.pop(self._random.randrange(len(self._calls)))
            if future.set_running_or_notify_cancel():
                self.order.append(arguments[0])
                try:
                    future.set_result(function(*arguments))
                except Exception as error:  # noqa: BLE001 - as every executor
                    future.set_exception(error)


@given(seed=st.integers(0, 1000), number=st.integers(0, 40), most=st.integers(1, 12))
def test_results_come_in_order_whatever_the_order_of_completion(seed: int, number: int, most: int) -> None:
    with closing(Shuffled(seed, waiting=min(most, 3))) as executor:
        done: list[int] = []
        results = run_in_order(executor, abs, range(-number, 0), most=most, finished=lambda task, _: done.append(task))
        assert list(results) == list(range(number, 0, -1))
    assert sorted(done) == list(range(-number, 0))
    assert executor.most <= most


def test_the_double_does_change_the_order() -> None:
    with closing(Shuffled(1, waiting=5)) as executor:
        list(run_in_order(executor, abs, range(30), most=10))
    assert executor.order != sorted(executor.order)  # type: ignore[type-var]


def test_tasks_are_taken_only_as_there_is_room() -> None:
    taken: list[int] = []

    def tasks() -> Iterator[int]:
        for number in count():
            taken.append(number)
            yield number

    with closing(Shuffled(3, waiting=4)) as executor:
        results = run_in_order(executor, abs, tasks(), most=7)
        for number, result in zip(range(50), results, strict=False):
            assert result == number
            assert len(taken) <= number + 1 + 7
        results.close()  # type: ignore[attr-defined]
    # Here, each result is there before the next task is taken.
    taken.clear()
    here = run_in_order(Here(), abs, tasks())
    assert [next(here) for _ in range(3)] == [0, 1, 2]
    assert taken == [0, 1, 2]


def inverse(number: int) -> float:
    return 1 / number


@pytest.mark.parametrize("seed", range(5))
def test_the_error_is_that_of_the_first_task_that_failed(seed: int) -> None:
    with closing(Shuffled(seed, waiting=4)) as executor:
        results = run_in_order(executor, inverse, [1, 2, 0, 4, *range(5, 1000)], most=8)
        assert [next(results), next(results)] == [1, 0.5]
        with pytest.raises(ZeroDivisionError):
            next(results)
    # After it, no more is begun.
    assert len(executor.order) <= 2 + 8


def test_what_is_known_is_not_run_and_what_is_watched_may_stop() -> None:
    with closing(Shuffled(2, waiting=2)) as executor:
        assert list(run_in_order(executor, abs, range(9), known=lambda task: -task if task % 3 else None)) == [
            0, -1, -2, 3, -4, -5, 6, -7, -8,
        ]  # fmt: skip
        assert sorted(executor.order) == [0, 3, 6]  # type: ignore[type-var]

    def stop() -> None:
        raise KeyError("stop")

    waiting = Shuffled(0, waiting=1000)
    with closing(waiting), pytest.raises(KeyError):
        list(run_in_order(waiting, abs, range(10), watch=stop))


def test_what_the_executor_cancels_ends_the_run() -> None:
    class Cancelling(Executor):
        def submit(self, _fn: Callable[..., Any], /, *_args: object, **_kwargs: object) -> "Future[Any]":
            future: Future[Any] = Future()
            future.cancel()
            return future

    with pytest.raises(CancelledError):
        list(run_in_order(Cancelling(), abs, [1]))


# --- worker processes --------------------------------------------------------------------------


def test_a_worker_that_is_lost_is_said_and_none_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    before = active_children()
    stumbles: list[object] = []
    monkeypatch.setattr("threading.excepthook", stumbles.append)
    with workers(2) as crew:
        assert list(run_in_order(crew, abs, range(-50, 0), most=9)) == list(range(50, 0, -1))
        assert len(active_children()) == len(before) + 2
    assert active_children() == before
    with pytest.raises(ZeroDivisionError), workers(1) as crew:
        list(run_in_order(crew, inverse, [1, 0]))
    with pytest.raises(WorkerLostError, match="a worker was killed"), workers(1) as crew:
        list(run_in_order(crew, os._exit, range(100)))
    assert active_children() == before
    with workers(1) as crew:
        calls = [crew.submit(time.sleep, 0.1) for _ in range(9)]
        calls[0].result()
        for call in calls:
            call.cancel()
        for process in set(active_children()) - set(before):
            process.kill()
        assert calls[1].exception(timeout=300)
    assert active_children() == before
    assert not stumbles


# --- a sweep ----------------------------------------------------------------------------------------------

SMALL = {"circle.radius_mm": [10], "servo.position_gain_per_s": range(100, 104), "delivery.seed": range(1, 4)}


def test_a_sweep_is_the_same_on_every_executor() -> None:
    def document(executor: Executor | None, *, summary: bool = False) -> str:
        return busplan.sweep("paper-1ms", vary=SMALL, circle=True, executor=executor, summary=summary).to_json()

    alone, summary = document(None), document(None, summary=True)
    assert alone.count('"passed"') == 12 * 2
    assert all(name in alone for name in CIRCLE_COLUMNS)
    with (
        closing(Shuffled(7, waiting=5)) as shuffled,
        ThreadPoolExecutor(3) as threads,
        workers(1) as own,
    ):
        for executor in (shuffled, threads, own):
            assert document(executor) == alone
            assert document(executor, summary=True) == summary
            # It is the caller's, and goes on.
            assert executor.submit(abs, -1).result(timeout=300) == 1


def test_many_points_are_checked_on_the_executor_and_the_first_that_fails_is_named() -> None:
    with closing(Shuffled(1)) as executor, pytest.raises(busplan.BusplanError) as caught:
        busplan.sweep(
            "paper-4ms", vary={"cycle.period_us": range(1000, 2001)}, circle=True, force=True, executor=executor
        )
    assert str(caught.value).startswith("at cycle.period_us = 1001: servo.step_us")
    assert executor.order


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"executor": Here()}, "executor: goes with circle=True"),
        ({"circle": True, "executor": 3}, "executor 3: expected a concurrent.futures.Executor"),
    ],
)
def test_refusals(options: dict[str, Any], words: str) -> None:
    with pytest.raises(busplan.BusplanError, match=words):
        busplan.sweep("paper-1ms", vary=SMALL, **options)


def test_a_chunk_is_about_a_second_of_work_and_a_few_tests_are_shared_out() -> None:
    for each_s in [1e-3, 0.06, 0.4, 20.0]:
        for number in [1, 10, 1000, 10**7]:
            size = chunk_tests(number, time_s=number * each_s)
            assert size == 1 or number / size >= 64
            if number == 10**7 and each_s < 3:
                assert 0.3 <= size * each_s <= 3
