"""CAN networks of many messages, and a sweep of a machine on CAN: compiled, and in plain Python.

The goals: compiled, 1,000 messages within a second and 10,000 points of `can-servo-8` within five; in plain Python, 100
messages within a second. The figures are read from the report; nothing here fails because a machine is slow.
"""

import random
import tomllib
from collections.abc import Callable
from contextlib import nullcontext
from unittest import mock

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import busplan
from busplan.buses import kind_named

ROUNDS = 3
HEAD = """\
schema_version = 1
name = "many"
[bus]
kind = "can"
bit_rate_kbit_s = 1000
identifier_bits = 29
"""
QUESTIONS: dict[str, Callable[[busplan.Profile], object]] = {
    "capacity": lambda profile: str(busplan.capacity(profile)),
    "latency": lambda profile: busplan.latency(profile, timing_model="worst-stuffing"),
    "check": lambda profile: busplan.check(profile, circle=False),
}


def network(number: int, *, load: float) -> busplan.Profile:
    """A network of messages alone, of unlike periods."""
    rng, period_us = random.Random(1), number * 130 / load
    text = HEAD + "".join(
        f'[[message]]\nname = "m{place}"\nidentifier = {place * 7}\npayload_bytes = {rng.randint(0, 8)}\n'
        f"period_us = {int(period_us * rng.uniform(0.5, 3))}\njitter_us = {rng.choice((0, 500, 2000))}\n"
        for place in range(number)
    )
    return kind_named("can").profile_model().model_validate(tomllib.loads(text))


@pytest.mark.parametrize("load", [0.3, 0.75])
@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize(("form", "count"), [("compiled", 1000), ("python", 100)])
def test_many_messages(
    benchmark: BenchmarkFixture, question: str, load: float, form: str, count: int, size: Callable[[int, int], int]
) -> None:
    number = size(count, 20)

    def made() -> tuple[tuple[busplan.Profile], dict[str, object]]:
        # A profile of its own for each round: nothing of the one before is remembered.
        return (network(number, load=load),), {}

    with mock.patch("busplan.buses.can.waiting._compiled", return_value=None) if form == "python" else nullcontext():
        benchmark.pedantic(QUESTIONS[question], setup=made, rounds=ROUNDS)


@pytest.mark.parametrize("key", ["bus.nodes", "bus.bit_rate_kbit_s"])
def test_a_sweep_of_a_machine(benchmark: BenchmarkFixture, key: str, size: Callable[[int, int], int]) -> None:
    values = {"bus.nodes": range(1, 11), "bus.bit_rate_kbit_s": range(100, 1001, 100)}[key]
    periods_us = [1000 + 10 * place for place in range(size(1000, 5))]
    benchmark.pedantic(
        lambda: busplan.sweep("can-servo-8", vary={"cycle.period_us": periods_us, key: [*values]}), rounds=ROUNDS
    )
