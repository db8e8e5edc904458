"""A CAN network of 10,000 messages through its commands, as a ratio against reading and checking its file.

The baseline is the profile's own `tomllib` and pydantic in this process, in the same run. The figures are read from the
report; nothing here fails because a machine is slow.
"""

import random
import tomllib
from collections.abc import Callable
from time import perf_counter

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import busplan
from busplan.buses.can.section import CanProfile

MESSAGES = 10_000
ROUNDS = 3
HEAD = """\
schema_version = 1
name = "many"
[bus]
kind = "can"
bit_rate_kbit_s = 1000
identifier_bits = 29
"""
QUESTIONS: dict[str, Callable[[CanProfile], object]] = {
    "capacity": lambda profile: str(busplan.capacity(profile)),
    "latency": lambda profile: busplan.latency(profile, timing_model="worst-stuffing"),
    "check": lambda profile: busplan.check(profile, circle=False),
}


def network(number: int, *, load: float) -> str:
    """A network of messages alone, as TOML."""
    rng, period_us = random.Random(1), number * 130 / load
    return HEAD + "".join(
        f'[[message]]\nname = "m{place}"\nidentifier = {place * 7}\npayload_bytes = {rng.randint(0, 8)}\n'
        f"period_us = {int(period_us * rng.choice((0.7, 1, 1.5, 3)))}\njitter_us = {rng.choice((0, 500, 2000))}\n"
        for place in range(number)
    )


@pytest.mark.parametrize("load", [0.3, 0.75])
@pytest.mark.parametrize("question", QUESTIONS)
def test_ten_thousand_messages(
    benchmark: BenchmarkFixture, question: str, load: float, size: Callable[[int, int], int]
) -> None:
    text = network(size(MESSAGES, 60), load=load)
    least_s = float("inf")

    def read() -> tuple[tuple[CanProfile], dict[str, object]]:
        # A profile of its own for each round: nothing of the one before is remembered.
        nonlocal least_s
        start = perf_counter()
        profile = CanProfile.model_validate(tomllib.loads(text))
        least_s = min(least_s, perf_counter() - start)
        return (profile,), {}

    benchmark.pedantic(QUESTIONS[question], setup=read, rounds=ROUNDS)
    if benchmark.stats is None:  # run, and not measured
        return
    benchmark.extra_info["ratio_to_reading_the_file"] = round(benchmark.stats.stats.min / least_s, 3)
