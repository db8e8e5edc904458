"""A few profiles of the fuzzer in a normal run; see `fuzz.py` for many."""

import importlib.util
import sys
from collections import Counter
from pathlib import Path
from random import Random
from types import ModuleType

import pytest

from busplan.buses import kind_names


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    """The fuzzer, whose schema takes a while to make."""
    spec = importlib.util.spec_from_file_location("fuzz", Path(__file__).with_name("fuzz.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["fuzz"] = module
    spec.loader.exec_module(module)
    return module


KINDS = kind_names()


@pytest.mark.parametrize("kind", KINDS)
def test_every_command_keeps_what_it_promises_and_all_tell_one_story(
    kind: str, fuzz: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # Every kind asks every command, and all kinds together every form, but for png, whose library takes seconds.
    every = {one: [form for form in one.forms if form != "png"] for one in fuzz.commands()}
    first = KINDS.index(kind)
    asked = [(one, form) for one, forms in every.items() for form in forms[first :: len(KINDS)] or forms[:1]]
    failures = fuzz.attack(Random(1), kind, asked=asked, counts=Counter(), story=True)
    assert not failures, failures
