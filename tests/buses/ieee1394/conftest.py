"""The simulated bus, which knows none of the closed forms."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def simulated() -> ModuleType:
    """The module tests/oracles/bus_simulation.py, which sends packet by packet."""
    path = Path(__file__).parents[2] / "oracles" / "bus_simulation.py"
    spec = importlib.util.spec_from_file_location("bus_simulation", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
