"""Model, keys and JSON Schema of a profile, by its kind of bus."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from types import UnionType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from busplan.buses import kind_named, kind_names
from busplan.sections.profile import CIRCLE_SECTIONS, Profile

_NO_PART_OF_A_CYCLE: Final = (*CIRCLE_SECTIONS, "limits")
"""Sections whose common keys no cycle depends on; a cycle may depend on keys that a kind of bus adds to them."""
_OF_VERDICT: Final = ("limits.reserve",)
"""Keys of these sections that a verdict depends on."""
_OF_GROUP: Final = ("name", "execution.kind")
"""Keys of a group that say how the others are read."""
_CHANGE_NO_FIGURE: Final = ("bus.kind", "bus.timing_model", "node.execution.kind")
"""Keys that say how the others are read, or what is shown first."""
_OF_CYCLE: Final = ("cycle.", "node.", "payload.", "bus.nodes", *_OF_VERDICT)
"""Beginnings of keys that no figure of a network without a cycle depends on."""


def kind_of(data: Mapping[str, object]) -> str | None:
    """The kind of bus in a profile's data; None if it is missing or unknown."""
    section = data.get("bus")
    kind = section.get("kind") if isinstance(section, Mapping) else None
    return kind if isinstance(kind, str) and kind in kind_names() else None


def profile_model(kind: str | None) -> type[Profile]:
    """Model of the profiles of a kind of bus; for None, the common model of all kinds."""
    return Profile if kind is None else kind_named(kind).profile_model()


def is_of_a_kind(path: tuple[int | str, ...]) -> bool:
    """Whether any kind of bus has a key; then it may be valid once the kind is known."""
    return any(True for kind in kind_names() for _ in _fields(profile_model(kind), path))


def _fields(model: type[BaseModel], path: tuple[int | str, ...]) -> Iterator[FieldInfo]:
    """Fields of a key, one for each member of a union that has it; for an element, the field of its array."""
    field = model.model_fields.get(str(path[0]))
    inner = [] if field is None else models_of(field.annotation)
    rest = path[2:] if len(path) > 1 and isinstance(path[1], int) else path[1:]
    if field is not None and not (rest and inner):
        yield field
    for section in inner if rest else []:
        yield from _fields(section, rest)


def models_of(annotation: Any) -> list[type[BaseModel]]:
    """Models inside an annotation: the section itself, or each member of a union of sections."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (Union, UnionType, Annotated, tuple):
        return [model for part in get_args(annotation) for model in models_of(part)]
    return []


def value_keys(model: type[BaseModel], names: Mapping[str, Sequence[str]], prefix: str = "") -> Iterator[str]:
    """Dotted keys of a model whose value is a number, a word or a boolean, in the order of the schema.

    Parameters
    ----------
    model
        The model.
    names
        Names of the tables that a profile has of a key with several.
    prefix
        What stands before each key.
    """
    for name, field in model.model_fields.items():
        inner = models_of(field.annotation)
        sections = [f"{name}.{table}" for table in names.get(name, ())] if _are_several(field.annotation) else [name]
        for section, section_model in product(sections, inner):
            yield from value_keys(section_model, {}, f"{prefix}{section}.")
        if not inner and (_is_number(field.annotation) or _words(field.annotation)):
            yield f"{prefix}{name}"


def cycle_keys(profile: Profile) -> tuple[str, ...]:
    """Keys of a profile that its cycle, or its verdict, may depend on."""
    model = profile_model(profile.bus.kind)
    several = [name for name, field in model.model_fields.items() if _are_several(field.annotation)]
    tables = tuple((name, tuple(table.name for table in getattr(profile, name))) for name in several)
    keys = _cycle_keys(model, tables)
    return keys if profile.has_cycle else tuple(key for key in keys if not key.startswith(_OF_CYCLE))


@cache
def _cycle_keys(model: type[Profile], several: tuple[tuple[str, tuple[str, ...]], ...]) -> tuple[str, ...]:
    names = dict(several)
    groups = names["group"]
    others = {key for key in value_keys(Profile, {}) if key.partition(".")[0] in _NO_PART_OF_A_CYCLE}
    without = {*others, *_CHANGE_NO_FIGURE, *(f"group.{group}.{key}" for group in groups for key in _OF_GROUP)}
    unused = ("node.", "payload.", "bus.nodes") if groups else ()
    keys = dict.fromkeys(value_keys(model, names))
    read = (key for key in keys if "." in key and key not in without and not key.startswith(unused))
    return (*read, *_OF_VERDICT)


def words_of(profile: Profile, key: str) -> tuple[str, ...]:
    """Words that a key of a profile may have as its value; for a boolean, true and false."""
    path = tuple(part for place, part in enumerate(key.split(".")) if not (place == 1 and key.startswith("group.")))
    fields = _fields(profile_model(profile.bus.kind), path)
    return tuple(dict.fromkeys(text for field in fields for text in _words(field.annotation)))


def _are_several(annotation: Any) -> bool:
    """Whether a key has several tables."""
    if get_origin(annotation) is Annotated:
        return _are_several(get_args(annotation)[0])
    return get_origin(annotation) is tuple


def _is_number(annotation: Any) -> bool:
    if annotation in (int, float):
        return True
    if get_origin(annotation) is Literal:
        return any(type(word) is int for word in get_args(annotation))
    # A tuple's arguments are elements.
    return get_origin(annotation) in (Union, UnionType, Annotated) and any(map(_is_number, get_args(annotation)))


def _words(annotation: Any) -> tuple[str, ...]:
    """Words that an annotation allows."""
    if annotation is bool:
        return ("true", "false")
    arguments = get_args(annotation)
    if get_origin(annotation) is Literal:
        return tuple(word for word in arguments if isinstance(word, str))
    if get_origin(annotation) in (Union, UnionType, Annotated):
        return tuple(word for part in arguments for word in _words(part))
    return ()


_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def profile_schema() -> dict[str, Any]:
    """Return the JSON Schema of a profile, draft 2020-12, made by pydantic.

    Returns
    -------
    dict
        The schema; `bus.kind` selects that of a kind of bus.

    Examples
    --------
    >>> profile_schema()["properties"]["bus"]["properties"]["kind"]["enum"][:2]
    ['ieee1394', 'can']
    """
    from pydantic.json_schema import models_json_schema  # noqa: PLC0415 - one command alone needs it

    kinds = {kind: profile_model(kind) for kind in kind_names()}
    references, definitions = models_json_schema([(model, "validation") for model in kinds.values()])
    # With conditions, validators name the wrong key; with a union, they would say that no member matches.
    chosen = [
        {"if": _has_kind({"const": kind}), "then": references[model, "validation"]} for kind, model in kinds.items()
    ]
    known = _has_kind({"description": "Kind of bus", "enum": list(kinds)}, description="The bus")
    return {"$schema": _DIALECT, "type": "object", **known, "allOf": chosen, **definitions}


def _has_kind(allowed: dict[str, Any], **more: str) -> dict[str, Any]:
    bus = {**more, "type": "object", "properties": {"kind": allowed}, "required": ["kind"]}
    return {"properties": {"bus": bus}, "required": ["bus"]}
