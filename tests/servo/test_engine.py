"""Compiled code is a gain and never a condition."""

import sys
from types import ModuleType

import pytest

from busplan.servo.engine import compiled
from busplan.servo.kernel import run_rows


@pytest.mark.parametrize("error", [EOFError("empty"), ValueError("garbage"), KeyError("x"), OSError("read-only")])
def test_a_damaged_cache_leaves_plain_python(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def njit(*_: object, **__: object) -> None:
        raise error

    broken = ModuleType("numba")
    broken.njit = njit  # type: ignore[attr-defined]  # a module takes any name
    monkeypatch.setitem(sys.modules, "numba", broken)
    assert compiled.__wrapped__(run_rows, "") is None


def test_a_numba_that_does_not_load_leaves_plain_python(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("broken")
    (folder / "numba.py").write_text("raise SystemError('wrong numpy')", encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    assert compiled.__wrapped__(run_rows, "") is None
