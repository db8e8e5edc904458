"""A kind's constants are complete, and another value of one travels with the call: never further, never less."""

import ast
import json
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from math import isfinite
from multiprocessing import get_context
from pathlib import Path
from typing import Any, get_args

import pytest

import busplan
from busplan import BusplanError, Profile
from busplan.buses import kind_named, kind_names
from busplan.profile.sources import shipped_names
from busplan.sourced import Grade, constants_changed

BUSES = Path(busplan.__file__).parent / "buses"
ALL = [(kind, name) for kind in kind_names() for name in kind_named(kind).constants]


@pytest.mark.parametrize("kind", kind_names())
def test_every_constant_has_a_value_a_unit_a_grade_and_a_source(kind: str) -> None:
    constants = kind_named(kind).constants
    assert [name for name, number in constants.items() if not isfinite(number)] == []
    assert {number.grade for number in constants.values()} <= set(get_args(Grade))
    for name, number in constants.items():
        assert number.name == name
        assert all((number.unit, number.source, number.meaning)), name


@cache
def shipped() -> tuple[Profile, ...]:
    return tuple(busplan.load_profile(name) for name in shipped_names())


def profiles(kind: str) -> tuple[Profile, ...]:
    return tuple(profile for profile in shipped() if profile.bus.kind == kind)


def figures(profile: Profile) -> Any:
    document = busplan.capacity(profile).to_dict()
    document.pop("changes", None)
    return json.dumps(document)


def inputs(profile: Profile) -> dict[str, tuple[float | str, str]]:
    """What `explain` names behind the figures that decide: value and grade by name."""
    found: dict[str, tuple[float | str, str]] = {}
    model = kind_named(profile.bus.kind).deciding_model
    for figure in ("required_us", "uncertainty_us", "bias_us"):
        with suppress(BusplanError):
            for derived in busplan.explain(profile, figure, timing_model=model).derivations:
                found |= {given.name: (given.value, given.grade) for given in derived.inputs}
    return found


@cache
def unchanged(name: str) -> tuple[str, dict[str, tuple[float | str, str]]]:
    profile = busplan.load_profile(name)
    return figures(profile), inputs(profile)


def changed(profile: Profile, name: str, value: float) -> Profile:
    return busplan.load_profile(profile, changes={f"constants.{name}": value})


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), ALL, ids=lambda part: part)
def test_a_changed_constant_is_assumed_and_leaves_nothing_behind(kind: str, name: str) -> None:
    number, why = float(kind_named(kind).constants[name]), kind_named(kind).constants.fixed.get(name)
    value = 1.5 * number or 1.0
    # One in which it matters, where there is one.
    profile = max(profiles(kind), key=lambda one: name in unchanged(one.name)[1])
    before, named = unchanged(profile.name)
    if why:
        with pytest.raises(BusplanError, match=re.escape(f"cannot be changed: {why}")):
            changed(profile, name, value)
        return
    other = changed(profile, name, value)
    (row,) = (row for row in busplan.explain(other).to_dict()["constants"] if row["name"] == name)
    assert (row["value"], row["grade"]) == (value, "assumed")
    assert row["source"].startswith(f"changed, was {number:g}: ")
    if name in named and name in (now := inputs(other)):
        assert now[name] == (value, "assumed")
    assert (figures(profile), inputs(profile)) == (before, named)
    assert float(kind_named(kind).constants[name]) == number


def test_explain_names_constants_of_every_kind() -> None:
    """So that the property above is no empty one."""
    for kind in kind_names():
        constants = set(kind_named(kind).constants)
        assert any(len(constants & set(unchanged(profile.name)[1])) > 2 for profile in profiles(kind)), kind


TELLING = {
    "paper-4ms": "ARBITRATION_HOLD_US",
    "ethercat-servo-8": "BYTE_US",
    "can-servo-8": "FIXED_BITS",
    "sercos3-servo-8": "BYTE_US",
    "sercos2-servo-8": "FRAME_BYTES",
    "profibus-drives-6": "PROFIBUS[TYPICAL_DELAY_BITS]",
}


@pytest.mark.slow
@pytest.mark.parametrize(("profile", "name"), TELLING.items())
def test_two_values_in_two_threads_are_two_answers(profile: str, name: str) -> None:
    loaded = busplan.load_profile(profile)
    number = float(kind_named(loaded.bus.kind).constants[name])
    each = [changed(loaded, name, number * share) for share in (1.0, 1.25, 1.5)]
    alone = [figures(one) for one in each]
    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(figures, each * 4)) == alone * 4
    assert len(set(alone)) == len(alone)
    assert alone[0] == figures(loaded)


QUESTIONS = [busplan.capacity, busplan.latency, busplan.timeline, busplan.compare, busplan.plan, busplan.map_]


@pytest.mark.slow
@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question.__name__)
def test_an_answer_is_drawn_with_its_own_constants_whatever_was_asked_since(question: Callable[..., Any]) -> None:
    slow = busplan.load_profile("paper-1ms", changes={"constants.ARBITRATION_HOLD_US": 8})
    first, plain = question(slow), question("paper-1ms")
    drawn, own = first.to_dict(), plain.to_dict()
    assert drawn.pop("changes") == {"constants.ARBITRATION_HOLD_US": 8.0}
    assert drawn != own
    assert "With --set constants.ARBITRATION_HOLD_US=8" in str(first)
    assert "constants" not in str(plain)
    with constants_changed((("ARBITRATION_HOLD_US", 3.0),)):
        again = question(slow).to_dict()
        again.pop("changes")
        assert (again, question("paper-1ms").to_dict(), plain.to_dict()) == (drawn, own, own)


def test_diff_shows_what_a_constant_does() -> None:
    slow = busplan.load_profile("paper-1ms", changes={"constants.ARBITRATION_HOLD_US": 8})
    answer = busplan.diff("paper-1ms", slow, timing_model="standard")
    keys = {row.key: row.b.value for row in answer.keys if row.b is not None}
    # That of node.response_us is a default, which is the constant.
    assert keys == {"constants.ARBITRATION_HOLD_US": 8.0, "node.response_us": 8.0}
    (required,) = (row for row in answer.figures if row.figure.key == "required_us")
    assert required.b > required.a
    assert busplan.diff(slow, slow).same


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as started:
        yield started


def test_a_worker_process_and_a_sweep_see_it(pool: ProcessPoolExecutor) -> None:
    slow = busplan.load_profile("paper-1ms", changes={"constants.ARBITRATION_HOLD_US": 30, "circle.radius_mm": 5})
    of_process = busplan.sweep(slow, vary={"bus.nodes": [1, 2]}, circle=True, executor=pool)
    here, plain = (
        busplan.sweep(one, vary={"bus.nodes": [1, 2]}, circle=True)
        for one in (slow, busplan.load_profile("paper-1ms", changes={"circle.radius_mm": 5}))
    )
    assert of_process.to_json() == here.to_json() != plain.to_json()
    assert here["required_us"][0] > plain["required_us"][0]


def test_check_takes_it_for_files_and_for_profiles_in_memory(pool: ProcessPoolExecutor) -> None:
    slow = {"constants.ARBITRATION_HOLD_US": 400}
    assert busplan.check("paper-1ms").passed
    assert not busplan.check("paper-1ms", changes=slow).passed
    assert not busplan.check(busplan.load_profile("paper-1ms", changes=slow)).passed
    assert not busplan.check("paper-1ms", changes=slow, executor=pool).passed
    assert busplan.check("paper-1ms").passed


def at_import(node: ast.AST) -> Iterator[ast.Attribute]:
    """Constants that are looked up when a module is imported, where no call has changed any."""
    if isinstance(node, ast.Lambda):
        return
    if isinstance(node, ast.FunctionDef):
        inner: list[ast.AST] = [*node.decorator_list, *node.args.defaults, *filter(None, node.args.kw_defaults)]
    else:
        inner = [*ast.iter_child_nodes(node)]
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "c":
        yield node
    for child in inner:
        yield from at_import(child)


@pytest.mark.parametrize("module", sorted(BUSES.glob("*/*.py")), ids=lambda path: f"{path.parent.name}.{path.stem}")
def test_a_constant_is_looked_up_in_the_call(module: Path) -> None:
    found = {node.attr for node in at_import(ast.parse(module.read_text(encoding="utf-8")))}
    assert found <= {"unchanged", "computed", "beside"}


@pytest.mark.parametrize(
    "folder", sorted(path.parent for path in BUSES.glob("*/__init__.py")), ids=lambda path: path.name
)
def test_names_in_formulas_are_constants_and_each_constant_is_used(folder: Path) -> None:
    texts = "".join(path.read_text(encoding="utf-8") for path in folder.glob("*.py"))
    used = set(re.findall(r"\bc\.([A-Z][A-Z0-9_]+)", texts))
    named = set(re.findall(r"[\"\[]([A-Z][A-Z0-9_]+)[\"\[\]]", texts))
    kinds = [
        kind for kind in kind_names() if type(kind_named(kind)).__module__.startswith(f"busplan.buses.{folder.name}.")
    ]
    constants = {name for kind in kinds for name in kind_named(kind).constants}
    assert used <= constants
    # A table that says more than constants is looked up by what it says: a protocol by its name.
    tables = {table for kind in kinds for table in kind_named(kind).constants.beside}
    assert {name.partition("[")[0] for name in constants} <= used | named | tables | {"SHARES"}
