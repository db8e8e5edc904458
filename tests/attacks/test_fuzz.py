"""Random and hostile profiles of every kind of bus: every question answers or refuses, and all tell one story.

Keys, ranges and words come from the schema of profiles: what is added there is tried here. For many more profiles than
in a normal run: pytest --hypothesis-profile=thorough tests/attacks/test_fuzz.py
"""

import copy
import csv
import json
import math
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any, Final

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

import busplan
from busplan.buses import kind_names
from busplan.cli import app
from busplan.forms import Form, render
from tests.registers import at_least

Data = dict[str, Any]
Schema = Mapping[str, Any]

SHIPPED: Final = [path.read_text(encoding="utf-8") for path in Path(__file__).parents[2].glob("profiles/*.toml")]
TEXTS: Final = (
    *("x", "Ω µ-Maschine 日本", "\u202eright to left", "a" * 100, "</script>|`*_[a](b)", '"quoted" \\ \'', "=1+1", "-"),
)


@cache
def schema() -> Schema:
    """The schema of profiles, as editors get it."""
    found: Schema = json.loads(CliRunner().invoke(app, ["schema"]).stdout)
    return found


def resolved(part: Schema) -> Schema:
    """The schema behind a reference."""
    found: Schema = schema()["$defs"][part["$ref"].rpartition("/")[2]] if "$ref" in part else part
    return found


class Maker:
    """Makes profiles of a kind: a shipped one, with some keys at values that are anything the schema allows."""

    def __init__(self, rng: Random, kind: str) -> None:
        self.rng = rng
        self.hostility = rng.choice((0.0, 0.05, 0.3, 0.9))
        self.length = rng.choice((1, 2, 3, 8))
        """Of every array of a profile, for those that belong together have one length."""
        self.names = 0
        (self.schema,) = (
            resolved(choice["then"])
            for choice in schema()["allOf"]
            if choice["if"]["properties"]["bus"]["properties"]["kind"]["const"] == kind
        )
        self.data = rng.choice([data for data in map(tomllib.loads, SHIPPED) if data["bus"]["kind"] == kind])

    def profile(self, loads: Callable[[Data], bool]) -> Data:
        """A profile that loads, but for one in eight."""
        data = self.data
        for _ in range(self.rng.choice((0, 1, 3, 10))):
            changed = self.changed(data)
            if loads(changed):
                data = changed
        return self.changed(data) if self.rng.random() < 1 / 8 else data

    def changed(self, data: Data) -> Data:
        """A copy with another value somewhere."""
        changed = copy.deepcopy(data)
        self._change(changed, self.schema)
        return changed

    def _change(self, table: Data, part: Schema) -> None:
        """Change a key of a table, in it or below it."""
        rng = self.rng
        key = rng.choice(list(part["properties"]))
        inner = self.member(part["properties"][key], table.get(key))
        if inner.get("type") == "object" and isinstance(table.get(key), dict):
            self._change(table[key], inner)
        elif inner.get("type") == "array" and self.is_tables(inner):
            tables = table.setdefault(key, [])
            if tables and rng.random() < 0.7:
                self._change(rng.choice(tables), resolved(inner["items"]))
            else:
                more = rng.choice((1, 2, 5, 11, 40) if self.is_hostile() else (1, 1, 2))
                tables += [self.value(inner["items"]) for _ in range(more)]
        elif key in table and key not in part.get("required", ()) and rng.random() < 0.1:
            del table[key]
        else:
            table[key] = self.value(inner)

    def is_tables(self, part: Schema) -> bool:
        """Whether an array is one of tables."""
        return resolved(part["items"]).get("type") == "object"

    def is_hostile(self) -> bool:
        """Whether the next choice is one that nobody would make."""
        return self.rng.random() < self.hostility

    def member(self, part: Schema, value: object = None) -> Schema:
        """One member of a union, but for null: that of a value, where it has one."""
        part = resolved(part)
        members = [resolved(member) for member in part.get("anyOf", part.get("oneOf", ()))]
        members = [member for member in members if member.get("type") != "null"]
        if not members:
            return part
        kind = value.get("kind") if isinstance(value, dict) else None
        same = [member for member in members if member.get("properties", {}).get("kind", {}).get("const") == kind]
        # The example of a union stands beside its members.
        beside = {key: part[key] for key in ("examples", "default") if key in part}
        return {**self.rng.choice(same or members), **beside}

    def value(self, part: Schema) -> Any:
        """Anything that a schema allows."""
        part = self.member(part)
        if "const" in part or "enum" in part:
            return part["const"] if "const" in part else self.rng.choice(part["enum"])
        found: Any
        match part["type"]:
            case "object":
                share, required = self.rng.choice((0.0, 0.2, 0.9)), part.get("required", ())
                keys = part["properties"].items()
                found = {key: self.value(inner) for key, inner in keys if key in required or self.rng.random() < share}
            case "array" if self.is_tables(part):
                found = [self.value(part["items"])]
            case "array":
                found = sorted(self.value(part["items"]) for _ in range(self.length))
            case "string" if part.get("pattern", r"\S") != r"\S":
                self.names += 1
                found = f"n{self.names}"
            case "string":
                found = self.rng.choice(TEXTS)
            case "boolean":
                found = self.rng.random() < 0.5
            case _:
                found = round(self.number(part)) if part["type"] == "integer" else self.number(part)
        return found

    def number(self, part: Schema) -> float:
        """Near an example or the default; or an end of the range, or anything in it."""
        rng = self.rng
        least = part.get("minimum", part.get("exclusiveMinimum", -1e9))
        most = part.get("maximum", part.get("exclusiveMaximum", 1e9))
        usual = [value for value in (*part.get("examples", ()), part.get("default")) if isinstance(value, int | float)]
        if usual and not self.is_hostile():
            found = rng.choice(usual) * rng.choice((1, 1, 0.5, 2, 10 ** rng.uniform(-1, 1)))
        elif rng.random() < 0.5:
            found = rng.choice((least, most, 0, 1, 1e-9, 1e9, math.nextafter(least, math.inf), most * (1 - 1e-12)))
        else:
            found = math.exp(rng.uniform(math.log(max(least, 1e-9)), math.log(max(most, 1e-9))))
        return float(min(max(found, least), most))


QUESTIONS: Final[Mapping[str, Callable[[busplan.Profile], Any]]] = {
    "latency": busplan.latency,
    "explain": busplan.explain,
    "explain a figure": lambda profile: busplan.explain(profile, "required_us"),
    "sensitivity": lambda profile: busplan.capacity(profile, sensitivity=True),
    "timeline": busplan.timeline,
    "plan": busplan.plan,
    "map": lambda profile: busplan.map_(
        profile, x={"cycle.slice_ratio": [profile.cycle.slice_ratio]}, y={"limits.reserve": [profile.limits.reserve]}
    ),
    "sweep": lambda profile: busplan.sweep(profile, vary={"cycle.slice_ratio": [profile.cycle.slice_ratio]}),
    "compare": lambda profile: busplan.compare(profile, buses=profile.bus.kind),
    "check": lambda profile: busplan.check(profile, circle=False),
    "diff": lambda profile: busplan.diff(profile, profile),
    "report": lambda profile: busplan.report(profile, circle=False),
}
TELLERS: Final[Mapping[str, Callable[[Any], Data]]] = {
    "timeline": lambda document: document if document["verdict"] is not None else {},
    "plan": lambda document: document["options"][0],
    "map": lambda document: document["design"],
    "sweep": lambda document: deciding(document["rows"]),
    "compare": lambda document: document["buses"][0],
    "check": lambda document: document["files"][0],
    "diff": lambda document: document["a"],
    "report": lambda document: document["profiles"][0]["answers"]["capacity"]["verdicts"][0],
}
"""Where a document tells the verdict and what it rests on."""
TOLD: Final = (
    *("verdict", "fits", "exceeded", "margin_corrected_us", "uncertainty_us"),
    *("required_us", "available_us", "safe_nodes", "safe_axes", "safe_limited_by"),
)
FORMS: Final[tuple[Form, ...]] = ("table", "markdown", "html", "csv", "json")


def deciding(rows: list[Data]) -> Data:
    """The row of the timing model that decides."""
    return next(row for row in rows if row["verdict"] is not None)


def others(told: Data, capacity: Data) -> Iterator[str]:
    """Keys that an answer tells otherwise than capacity."""
    for key in TOLD:
        # Groups have counts of their own, and only one of them may be counted.
        if key not in told or (key.startswith("safe_") and None in (told[key], capacity[key])):
            continue
        # With a setting that is free to change there may be more.
        if key.startswith("safe_") and told.get("smallest_period_with"):
            continue
        expected = capacity[key]
        if isinstance(expected, float):
            expected = pytest.approx(expected, rel=1e-9, abs=1e-6)
        if told[key] != expected:
            yield key


def require_forms(answer: Any) -> None:
    """Each form of an answer is one."""
    for form in FORMS:
        try:
            text = render(answer.report(), form)
        except busplan.BusplanError:  # several tables, which are no CSV
            assert form == "csv"
            continue
        if form == "json":
            json.loads(text, parse_constant=pytest.fail)
        if form == "csv":
            assert len({len(row) for row in csv.reader(StringIO(text, newline=""), strict=True)}) <= 1
    if picture := answer._repr_svg_():
        ET.XML(picture)


@pytest.mark.slow
@pytest.mark.parametrize("kind", kind_names())
@settings(max_examples=at_least(2))
@given(seed=st.integers(0, 1 << 32))
def test_every_question_answers_or_refuses_and_all_tell_one_story(
    kind: str, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / f"{kind}.toml"

    def loads(data: Data) -> bool:
        path.write_text(tomli_w.dumps(data), encoding="utf-8")
        try:
            busplan.load_profile(path)
        except busplan.BusplanError:
            return False
        return True

    if not loads(Maker(Random(seed), kind).profile(loads)):
        assert not busplan.check(path, circle=False).passed
        return
    profile = busplan.load_profile(path)
    capacity = busplan.capacity(profile).to_dict()
    verdict = {**deciding(capacity["results"]), **capacity["verdicts"][0]}
    assert list(others(capacity["verdicts"][0], deciding(capacity["results"]))) == []
    is_well = verdict["verdict"] == "fits" and not verdict["missed_limits"]
    for name, ask in QUESTIONS.items():
        try:
            answer = ask(profile)
        except busplan.BusplanError:  # what asks for a cycle of a network of messages, or for too many events
            continue
        require_forms(answer)
        told = TELLERS[name](answer.to_dict()) if name in TELLERS else {}
        assert list(others(told, verdict)) == [], name
        if name == "plan":
            assert is_well or told["held_by"] is not None
        if name == "check":
            assert is_well or told["status"] == "findings"
