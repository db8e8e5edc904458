"""A few profiles of the fuzzer in a normal run; see `fuzz.py` for many."""

import importlib.util
import sys
from collections import Counter
from pathlib import Path
from random import Random
from types import ModuleType

import pytest

from busplan.buses import kind_names


def _fuzz() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fuzz", Path(__file__).with_name("fuzz.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["fuzz"] = module
    spec.loader.exec_module(module)
    return module


fuzz = _fuzz()
EVERY = [(command, form) for command in fuzz.commands() for form in command.forms]


@pytest.mark.parametrize("kind", kind_names())
def test_every_command_and_form_keeps_what_it_promises(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shares = 4
    for share in range(shares):
        asked = EVERY[share::shares]
        failures = fuzz.attack(Random(f"{kind} {share}"), kind, asked=asked, counts=Counter())
        assert not failures, failures
