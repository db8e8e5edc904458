"""A profile loads the code of its own kind of bus, and of no other."""

import json
import subprocess
import sys

import pytest

import busplan
from busplan.buses import kind_named, kind_names
from tests.registers import shipped_names

# One interpreter, from which each profile has a process of its own.
PROGRAM = """
import json, os, sys
import pydantic  # of which every process needs the same
import busplan
for name in sys.argv[1:]:
    child = os.fork()
    if not child:
        busplan.capacity(name)
        print(json.dumps([name, *(one for one in sys.modules if one.startswith("busplan.buses."))]), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


@pytest.mark.slow
def test_a_profile_loads_its_own_kind_of_bus_alone() -> None:
    kind_of = {busplan.load_profile(name).bus.kind: name for name in shipped_names()}
    assert set(kind_of) == set(kind_names())
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *kind_of.values()], capture_output=True, text=True, check=True
    )
    loaded = {name: set(modules) for name, *modules in map(json.loads, done.stdout.split("\n")[:-1])}
    modules = {kind: type(kind_named(kind)).__module__ for kind in kind_of}
    for kind, name in kind_of.items():
        assert loaded[name] & set(modules.values()) == {modules[kind]}
