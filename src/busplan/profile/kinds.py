"""Model and keys of a profile, by its kind of bus."""

from collections.abc import Iterator, Mapping
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
_CHANGE_NO_FIGURE: Final = ("bus.kind", "bus.timing_model", "node.execution.kind")
"""Keys that say how the others are read, or what is shown first."""


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


def value_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Dotted keys of a model whose value is one number, word or truth, in the order of the schema."""
    for name, field in model.model_fields.items():
        inner = models_of(field.annotation)
        for one in inner:
            yield from value_keys(one, f"{prefix}{name}.")
        if not inner and (_is_number(field.annotation) or _words(field.annotation)):
            yield f"{prefix}{name}"


def cycle_keys(kind: str) -> tuple[str, ...]:
    """Keys that the cycle of a kind of bus, or its verdict, may depend on."""
    others = {key for key in value_keys(Profile) if key.partition(".")[0] in _NO_PART_OF_A_CYCLE}
    keys = dict.fromkeys(value_keys(profile_model(kind)))
    return tuple(key for key in keys if ("." in key and key not in {*others, *_CHANGE_NO_FIGURE}) or key in _OF_VERDICT)


def words_of(kind: str, key: str) -> tuple[str, ...]:
    """Words allowed for a key, instead of a number or alone; those of a truth are true and false."""
    fields = _fields(profile_model(kind), tuple(key.split(".")))
    return tuple(dict.fromkeys(text for one in fields for text in _words(one.annotation)))


def _is_number(annotation: Any) -> bool:
    if annotation in (int, float):
        return True
    # A literal's arguments are values, and a tuple's are elements.
    return get_origin(annotation) in (Union, UnionType, Annotated) and any(map(_is_number, get_args(annotation)))


def _words(annotation: Any) -> tuple[str, ...]:
    """Words that an annotation allows."""
    if annotation is bool:
        return ("true", "false")
    arguments = get_args(annotation)
    if get_origin(annotation) is Literal:
        return tuple(one for one in arguments if isinstance(one, str))
    if get_origin(annotation) in (Union, UnionType, Annotated):
        return tuple(word for part in arguments for word in _words(part))
    return ()
