"""The README says what the program does: its output blocks, its reference and its equations are checked."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import pytest
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from busplan.analysis.capacity.figures import capacity
from busplan.analysis.circle.roundness import CircleFigures
from busplan.analysis.derivation.origin import short
from busplan.analysis.latency import latency
from busplan.answers.assumptions import constant_rows, equation_rows
from busplan.answers.capacity import capacity_records
from busplan.answers.latency import latency_records
from busplan.buses import kind_named
from busplan.buses.ieee1394.section import Ieee1394Profile
from busplan.forms.markdown_words import code, table
from busplan.profile.shipped import load, shipped_names
from busplan.sections.machine import AxisOverride

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def shown_runs() -> Iterator[tuple[str, str]]:
    """Each `$ busplan ...` of the README with the output printed below it."""
    for block in CONSOLE.findall(README):
        for run in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = run.partition("\n")
            if command.startswith("busplan"):
                yield command, output


@pytest.mark.parametrize(("command", "output"), list(shown_runs()), ids=lambda text: text[:40])
def test_output_blocks_are_the_programs_own(command: str, output: str, tmp_path: Path) -> None:
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    environment.pop("FORCE_COLOR", None)
    run = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, cwd=tmp_path, env=environment, check=False
    )
    assert run.stdout + run.stderr == output


def test_there_are_blocks_to_check() -> None:
    commands = {command.split()[1] for command, _ in shown_runs()}
    assert commands >= {"capacity", "latency", "circle-test", "paper", "profiles", "init"}


def sections(annotation: Any) -> list[type[BaseModel]]:
    """Models inside an annotation: the section itself, or each member of a union of sections."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (Union, UnionType, Annotated):
        return [model for part in get_args(annotation) for model in sections(part)]
    return []


def reference(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """The README's row of every key of the profile, from the schema itself."""
    for name, field in model.model_fields.items():
        key = f"{prefix}{name}"
        inner = sections(field.annotation)
        if inner == [AxisOverride]:
            yield f"| `{key}` | any key of one axis | none | {field.description} |"
        elif inner:
            for one in inner:
                yield from reference(one, f"{key}.")
        else:
            yield reference_row(model, name, key)


def reference_row(model: type[BaseModel], name: str, key: str) -> str:
    """One row of the reference."""
    field = model.model_fields[name]
    default = "required" if field.default is PydanticUndefined else repr(field.default).replace("'", '"')
    range_ = allowed(model.model_json_schema()["properties"][name])
    return f"| `{key}` | {range_} | {default.replace('None', 'none')} | {field.description} |"


def allowed(schema: dict[str, Any]) -> str:
    """Type and range of a key in words, from its JSON Schema."""
    if "anyOf" in schema:
        return " or ".join(allowed(one) for one in schema["anyOf"] if one.get("type") != "null")
    if "enum" in schema or "const" in schema:
        return ", ".join(str(one) for one in schema.get("enum", [schema.get("const")]))
    if schema["type"] == "array":
        return f"list of {allowed(schema['items'])}"
    if schema["type"] == "string":
        return f"text up to {schema['maxLength']} characters"
    low = f"> {schema['exclusiveMinimum']:g}" if "exclusiveMinimum" in schema else f"{schema['minimum']:g}"
    kind = "whole " if schema["type"] == "integer" else ""
    return f"{kind}{low} to {schema['maximum']:g}"


@pytest.mark.parametrize("row", list(dict.fromkeys(reference(Ieee1394Profile))))
def test_profile_reference_lists_every_key_as_the_schema_has_it(row: str) -> None:
    assert row in README.splitlines()


def test_profile_reference_lists_no_key_that_is_not_there() -> None:
    rows = [
        line
        for line in README.splitlines()
        if re.match(r"\| `[a-z0-9_.]+` \| [^|]+ \| (required|none|\"[a-z]*\"|[\d.]+) \|", line)
    ]
    assert sorted(rows) == sorted(dict.fromkeys(reference(Ieee1394Profile)))


def test_the_example_profile_is_the_shipped_one() -> None:
    blocks = re.findall(r"^```toml\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
    assert (ROOT / "profiles" / "paper-4ms.toml").read_text(encoding="utf-8") in blocks


def registry_tables() -> Iterator[list[str]]:
    """The README's tables of equations and constants, from the registry that `explain` shows."""
    rows = equation_rows()
    yield table(
        list(rows[0]),
        ([row["reference"], code(row["formula"]), code(row["function"]), row["source"]] for row in rows),
        left=4,
    )
    constants = constant_rows(kind_named("ieee1394"))
    cells = [
        [code(row["name"]), short(row["value"]), *(row[key] for key in ("unit", "grade", "source", "meaning"))]
        for row in constants
    ]
    yield table(list(constants[0]), cells, left=6)


@pytest.mark.parametrize("lines", list(registry_tables()), ids=["equations", "constants"])
def test_equations_and_constants_are_those_of_the_registry(lines: list[str]) -> None:
    assert "".join(f"{line}\n" for line in lines) in README


def test_every_json_key_is_listed() -> None:
    profile = load("paper-4ms").profile
    keys = {*latency_records(latency(profile))[0], *capacity_records(capacity(profile))[0], *CircleFigures._fields}
    bus = kind_named("ieee1394")
    assert keys >= {figure.key for figure in (*bus.capacity_figures, *bus.latency_figures)}
    missing = [key for key in sorted(keys) if f"`{key}`" not in README]
    assert missing == []


def test_every_shipped_profile_is_named() -> None:
    assert [name for name in shipped_names() if f"`{name}`" not in README] == []
