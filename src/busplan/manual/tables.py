"""Tables of the reference pages: keys, constants, equations and figures."""

import json
import re
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

from pydantic import BaseModel

from busplan.buses import kind_named
from busplan.buses.figure import Figure
from busplan.forms.markdown import code, table
from busplan.profile.kinds import models_of
from busplan.questions.circle import CIRCLE_BY_KEY
from busplan.questions.explain import explain
from busplan.questions.explain.derivation import constant_rows, figures_of
from busplan.sections.machine import AxisOverride
from busplan.sourced import short

_COMMON = "ieee1394"
"""Kind whose keys the page of keys has; that of a further kind has what keys it adds."""
_EXAMPLE = "paper-4ms"
_MOST = 1_000_000
"""Largest values from here on are left to the JSON Schema."""


def made_table(what: str, of: str) -> list[str]:
    """Lines of the table that a page asks for.

    Examples
    --------
    >>> made_table("constants", "sercos2")[0]
    '| constant of `sercos2` | value | grade | meaning |'
    """
    if what == "keys":
        return _key_table(of)
    if what == "constants":
        return _constant_table(of)
    if what == "equations":
        return _equation_table()
    return _figure_table("`circle-test`", CIRCLE_BY_KEY.values()) if of else _figure_table(what[:-1], _other_figures())


def _key_table(kind: str) -> list[str]:
    rows = dict.fromkeys(_keys(kind_named(kind).profile_model()))
    if kind == _COMMON:
        return ["| key | values (default) | meaning |", "|---|---|---|", *rows]
    common = set(_keys(kind_named(_COMMON).profile_model()))
    own = (row for row in rows if row not in common)
    return [f"| key of `{kind}` | values (default) | meaning |", "|---|---|---|", *own]


def _keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """A row for each key of a profile."""
    for name, field in model.model_fields.items():
        key, inner = f"{prefix}{name}", models_of(field.annotation)
        if name == "message":
            (message,) = inner
            yield from (_key_row(message, own, f"message.NAME.{own}") for own in message.model_fields)
        elif name == "group":
            (group,) = inner
            owns = [one for one in ("name", "nodes", "axes", "hops") if one in group.model_fields]
            yield from (_key_row(group, own, f"group.NAME.{own}") for own in owns)
            yield "| `group.NAME` | any other key of `[payload]` and `[node]` | As there, for its nodes |"
        elif name == "grades":
            (grades,) = {_values(schema) for schema in _properties(inner[0]).values()}
            yield f"| `{key}.KEY` | {grades} | How servo.KEY is known, where not as servo.grade says |"
        elif inner == [AxisOverride]:
            yield f"| `{key}` | any key of one axis | {field.description} |"
        elif inner:
            for one in inner:
                yield from _keys(one, f"{key}.")
        else:
            yield _key_row(model, name, key)


def _key_row(model: type[BaseModel], name: str, key: str) -> str:
    """Row of a key, without the unit that the key ends in."""
    field = model.model_fields[name]
    values = _values(_properties(model)[name])
    if key == "bus.nodes":
        values = f"{values}, required without groups"
    elif field.is_required():
        values = f"{values}, required"
    elif (default := field.get_default(call_default_factory=True)) is not None:
        values = f"{values} ({json.dumps(default)})"
    meaning = re.sub(r" \[[^]]*\]$", "", field.description or "")
    return f"| `{key}` | {values} | {meaning} |"


@cache
def _properties(model: type[BaseModel]) -> dict[str, Any]:
    """JSON Schema of each key of a section."""
    found: dict[str, Any] = model.model_json_schema()["properties"]
    return found


def _values(schema: dict[str, Any]) -> str:
    """Type and range of a key in words, from its JSON Schema."""
    if "anyOf" in schema:
        return " or ".join(_values(one) for one in schema["anyOf"] if one.get("type") != "null")
    if "enum" in schema or "const" in schema:
        return ", ".join(str(one) for one in schema.get("enum", [schema.get("const")]))
    if schema["type"] == "boolean":
        return "true, false"
    if schema["type"] == "array":
        return f"list of {_values(schema['items'])}"
    if schema["type"] == "string":
        letters = " of letters, digits, - and _" if schema.get("pattern", "").startswith("^[A-Za-z]") else ""
        return f"text up to {schema['maxLength']} characters{letters}"
    return _range(schema)


def _range(schema: dict[str, Any]) -> str:
    """Range of a number in words."""
    whole = "whole " if schema["type"] == "integer" else ""
    if schema.get("minimum", 0) <= -_MOST:
        return f"{whole}number"
    is_open = schema["maximum"] >= _MOST
    if "exclusiveMinimum" in schema:
        least = f"over {schema['exclusiveMinimum']:g}"
        return f"{whole}{least}" if is_open else f"{whole}{least}, to {schema['maximum']:g}"
    return f"{whole}{schema['minimum']:g} " + ("or more" if is_open else f"to {schema['maximum']:g}")


def _constant_table(kind: str) -> list[str]:
    """Constants of a kind that nobody has published; `explain` has all of them, with their sources."""
    cells = [
        [code(row["name"]), f"{short(row['value'])} {row['unit']}".removesuffix(" 1"), row["grade"], row["meaning"]]
        for row in constant_rows(kind_named(kind))
        if row["grade"] != "published"
    ]
    return table([f"constant of `{kind}`", "value", "grade", "meaning"], cells, left=4)


def _equation_table() -> list[str]:
    cells = (
        [row["reference"], code(row["formula"]), re.sub("Paper, section |, equations? [^;]*", "", row["source"])]
        for row in explain(_EXAMPLE).to_dict()["equations"]
    )
    return table(["equation", "formula", "section of the paper"], cells, left=3)


def _figure_table(head: str, figures: Iterable[Figure]) -> list[str]:
    """Meanings of figures; a key ends in its unit, and `explain` shows symbols."""
    cells = ([code(figure.key), figure.meaning, figure.reference] for figure in figures)
    return table([head, "meaning", "reference"], cells, left=3)


def _other_figures() -> Iterable[Figure]:
    """Figures of the common kind that `explain` does not list."""
    listed = {figure.key for _, figure in explain(_EXAMPLE).figures}
    registers = figures_of(kind_named(_COMMON)).values()
    return {key: figure for one in registers for key, figure in one.items() if key not in listed}.values()
