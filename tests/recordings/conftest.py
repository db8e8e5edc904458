"""Emulated machines that the tests of recordings share."""

from collections.abc import Callable
from functools import cache

import pytest

from tests.oracles.emulated import Subject


@pytest.fixture(scope="session")
def subjects(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Subject]:
    """Machines by kind and seed, each made once."""
    return cache(lambda kind, seed: Subject(kind, seed, tmp_path_factory.mktemp(f"{kind}-{seed}")))
