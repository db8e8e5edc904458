"""Model and keys of a profile, by its kind of bus."""

from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Annotated, Any, Final, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from busplan.buses import kind_named, kind_names
from busplan.sections.profile import CIRCLE_SECTIONS, Profile

_NO_PART_OF_A_CYCLE: Final = (*CIRCLE_SECTIONS, "limits")
"""Sections whose common keys no cycle depends on; a cycle may depend on keys that a kind of bus adds to them."""


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
    if field is not None and (len(path) == 1 or not inner):
        yield field
    for one in inner if len(path) > 1 else []:
        yield from _fields(one, path[1:])


def models_of(annotation: Any) -> list[type[BaseModel]]:
    """Models inside an annotation: the section itself, or each member of a union of sections."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (Union, UnionType, Annotated):
        return [model for part in get_args(annotation) for model in models_of(part)]
    return []


def number_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Dotted keys of a model whose value is a number, in the order of the schema."""
    for name, field in model.model_fields.items():
        inner = models_of(field.annotation)
        for one in inner:
            yield from number_keys(one, f"{prefix}{name}.")
        if not inner and _is_number(field.annotation):
            yield f"{prefix}{name}"


def cycle_keys(kind: str) -> tuple[str, ...]:
    """Numeric keys that the cycle of a kind of bus may depend on."""
    others = {key for key in number_keys(Profile) if key.partition(".")[0] in _NO_PART_OF_A_CYCLE}
    keys = dict.fromkeys(number_keys(profile_model(kind)))
    return tuple(key for key in keys if "." in key and key not in others)


def words_of(kind: str, key: str) -> tuple[str, ...]:
    """Words that a key allows instead of a number."""
    fields = _fields(profile_model(kind), tuple(key.split(".")))
    return tuple(text for one in fields if _is_number(one.annotation) for text in _texts(one.annotation))


def _is_number(annotation: Any) -> bool:
    if annotation in (int, float):
        return True
    # Do not look into literals and tuples.
    return get_origin(annotation) in (Union, UnionType, Annotated) and any(map(_is_number, get_args(annotation)))


def _texts(annotation: Any) -> Iterator[str]:
    if isinstance(annotation, str):
        yield annotation
    for part in get_args(annotation):
        yield from _texts(part)
