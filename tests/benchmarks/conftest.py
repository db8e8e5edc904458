"""Benchmarks are measured in full, and otherwise run once and small, only so that they do not rot."""

from collections.abc import Callable
from typing import TypeVar

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

Size = TypeVar("Size")
SizeOf = Callable[[Size, Size], Size]


@pytest.fixture
def size(benchmark: BenchmarkFixture) -> SizeOf[int]:
    """Choose between the size that is measured (`--benchmark-enable`) and the one that shows that it runs."""
    return lambda measured, run: run if benchmark.disabled else measured
