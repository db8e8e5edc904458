"""Facts about keys belong to keys that profiles of the kind have; and no number of a bus is negative."""

from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import BaseModel

from busplan.buses import kind_named, kind_names
from busplan.profile.kinds import models_of


def has(models: list[type[BaseModel]], key: str) -> bool:
    name, _, rest = key.partition(".")
    fields = [model.model_fields[name] for model in models if name in model.model_fields]
    return bool(fields) and (not rest or has([inner for one in fields for inner in models_of(one.annotation)], rest))


@pytest.mark.parametrize("kind", kind_names())
def test_every_key_is_one_of_the_profile(kind: str) -> None:
    bus = kind_named(kind)
    assert [key for key in bus.keys if not has([bus.profile_model()], key)] == []
    roles = [key.role for key in bus.keys.values() if key.role]
    assert len(roles) == len(set(roles))


def numbers(schema: dict[str, Any], key: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Schema of each number that a key may take, alone or in a list or table."""
    if schema.get("type") in ("number", "integer") and not {"enum", "const"} & schema.keys():
        yield key, schema
    for inner in ("items", "additionalProperties"):
        if isinstance(schema.get(inner), dict):
            yield from numbers(schema[inner], key)
    for one in schema.get("anyOf", ()):
        yield from numbers(one, key)
    for name, one in schema.get("properties", {}).items():
        yield from numbers(one, f"{key}.{name}")


@pytest.mark.parametrize("kind", kind_names())
def test_no_number_of_a_bus_is_negative(kind: str) -> None:
    sections = kind_named(kind).profile_model().model_json_schema()["$defs"]
    of_circle = ("AxisOverride", "DeliverySection", "MechanicsSection", "ServoSection")
    found = [pair for name, one in sections.items() if name not in of_circle for pair in numbers(one, name)]
    assert len(found) > 20
    assert [key for key, one in found if one.get("minimum", one.get("exclusiveMinimum", -1)) < 0] == []


@pytest.mark.parametrize("kind", kind_names())
def test_each_term_has_its_own_label(kind: str) -> None:
    figures = kind_named(kind).figures
    for figure in figures.terms:
        short = figure.key.removeprefix("cycle_").removesuffix("_us")
        assert figures.term_label(short) == figure.label
    assert figures.term_label(None) == ""


@pytest.mark.parametrize("kind", kind_names())
def test_a_new_section_sets_no_key_that_it_proposes(kind: str) -> None:
    bus = kind_named(kind)
    for variant in ("", *bus.starter.variants):
        known = bus.hosts(variant)
        for host in (None, *known):
            lines = bus.new_section(host, variant).splitlines()
            keys = [line.removeprefix("# ").partition("=")[0].strip() for line in lines if "=" in line]
            assert len(keys) == len({*keys}), (variant, host)
            if host is not None:
                own, wake_up = (bus.key_of(role).removeprefix("bus.") for role in ("host", "wake-up"))
                given = {
                    key: value
                    for key, value in ((own, known[host].own_us.get(kind)), (wake_up, known[host].jitter_us))
                    if value and key
                }
                assert all(any(line.startswith(f"{key} = {value} ") for line in lines) for key, value in given.items())
