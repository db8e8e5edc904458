"""Circle tests of a sweep, here and on any executor; worker processes that are lost."""

import os
import random
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from multiprocessing import active_children
from typing import Any

import pytest

import busplan
from busplan.cli.workers import workers
from busplan.errors import WorkerLostError

Make = Callable[..., busplan.Profile]

SMALL = {"circle.radius_mm": [10], "servo.position_gain_per_s": range(100, 104), "delivery.seed": range(1, 4)}


class Shuffled(Executor):
    """Runs all that was handed over, in any order, when a result is asked for."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._calls: list[tuple[Future[Any], Callable[[], Any]]] = []
        self.order: list[int] = []

    def submit(self, fn: Callable[..., Any], /, *args: object, **_kwargs: object) -> "Future[Any]":
        number, future = len(self._calls) + len(self.order), _Lazy(self._run)

        def call() -> None:
            self.order.append(number)
            try:
                future.set_result(fn(*args))
            except Exception as error:  # noqa: BLE001 - as every executor
                future.set_exception(error)

        self._calls.append((future, call))
        return future

    def _run(self) -> None:
        calls, self._calls = self._calls, []
        for _, call in self._random.sample(calls, len(calls)):
            call()


class _Lazy(Future[Any]):
    def __init__(self, run_all: Callable[[], None]) -> None:
        super().__init__()
        self._run_all = run_all

    def result(self, timeout: float | None = None) -> Any:
        self._run_all()
        return super().result(timeout)


@pytest.mark.slow
def test_a_sweep_is_the_same_on_every_executor() -> None:
    def document(executor: Executor | None) -> str:
        return busplan.sweep("paper-1ms", vary=SMALL, circle=True, executor=executor).to_json()

    alone, shuffled = document(None), Shuffled(7)
    assert alone.count('"passed"') == 12 * 2
    with ThreadPoolExecutor(3) as threads, workers(1) as processes:
        for executor in (shuffled, threads, processes):
            assert document(executor) == alone
            # It is the caller's, and goes on.
            assert executor.submit(abs, -1).result(timeout=300) == 1
    assert shuffled.order != sorted(shuffled.order)


@pytest.mark.parametrize(("beside", "place"), [({}, ""), ({"bus.nodes": [1, 2]}, "at bus.nodes = 1: ")])
def test_the_first_point_that_cannot_be_run_is_named_before_any_is(beside: dict[str, Any], place: str) -> None:
    executor = Shuffled(1)
    vary = {"circle.feed_mm_per_min": [1000.0, 500_000.0, 600_000.0], **beside}
    with pytest.raises(busplan.BusplanError) as caught:
        busplan.sweep("paper-4ms", vary=vary, circle=True, executor=executor)
    # The key that is refused is named once.
    assert str(caught.value).startswith(f"{place}circle.feed_mm_per_min = 500000.0: axis x reaches ")
    assert not executor.order


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"executor": ThreadPoolExecutor(1)}, "executor: needs circle=True"),
        ({"circle": True, "executor": 3}, "executor 3: expected a concurrent.futures.Executor"),
    ],
)
def test_refusals(options: dict[str, Any], words: str) -> None:
    with pytest.raises(busplan.BusplanError, match=words):
        busplan.sweep("paper-1ms", vary={"bus.nodes": [1]}, **options)


@pytest.fixture
def big(make: Make) -> busplan.Profile:
    circle = {"radius_mm": 10_000.0, "feed_mm_per_min": 3000.0, "ramp_periods": 20}
    return make(circle=circle, cycle__period_us=2000.0, servo={"step_us": 200.0})


@pytest.mark.slow
def test_a_long_sweep_of_circles_says_what_it_costs_before_it_runs(
    big: busplan.Profile, caplog: pytest.LogCaptureFixture
) -> None:
    class Stopped(Executor):
        def map(self, *_: Any, **__: Any) -> Iterator[Any]:
            raise KeyboardInterrupt

    def announced(vary: dict[str, Any], **options: Any) -> list[str]:
        caplog.clear()
        with pytest.raises(KeyboardInterrupt):
            busplan.sweep(big, vary=vary, circle=True, executor=Stopped(), **options)
        return caplog.messages

    # 12,566,780 steps at 2 ms, which take about 2 s; where the cycle does not fit, nothing is simulated.
    assert announced({"cycle.period_us": [2000, 100]}) == []
    (message,) = announced({"delivery.seed": [1, 2, 3]})
    assert message.startswith("circle test: 37,700,340 steps, about ")
    # The memory of one: they run one behind the other.
    assert " and 0.24 GB" in message
    # Of more points than are looked at, the number is that of all.
    (message,) = announced({"delivery.seed": range(1, 1001)}, unlimited=True)
    assert message.startswith("circle test: 12,566,780,000 steps, about ")


# --- worker processes --------------------------------------------------------------------------


def inverse(number: int) -> float:
    return 1 / number


@pytest.mark.slow
def test_a_worker_that_is_lost_is_said_and_none_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    before = active_children()
    stumbles: list[object] = []
    monkeypatch.setattr("threading.excepthook", stumbles.append)
    with workers(2) as crew:
        assert list(crew.map(abs, range(-50, 0))) == list(range(50, 0, -1))
        assert len(active_children()) == len(before) + 2
    assert active_children() == before
    with pytest.raises(ZeroDivisionError), workers(1) as crew:
        list(crew.map(inverse, [1, 0]))
    with pytest.raises(WorkerLostError, match="a worker was killed"), workers(1) as crew:
        list(crew.map(os._exit, range(100)))
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
