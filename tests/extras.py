"""Large libraries that few tests take: the extra test-all has them."""

from typing import Any

import pytest


def needed(name: str) -> Any:
    """Import a library, or skip what needs it."""
    return pytest.importorskip(name, reason=f"needs {name}: pip install --editable '.[test-all]'")
