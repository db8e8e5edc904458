"""Model, keys and JSON Schema of a profile, by its kind of bus."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from types import UnionType
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from busplan.buses import kind_named, kind_names
from busplan.errors import BusplanError
from busplan.sections.base import Section, value_at
from busplan.sections.profile import CIRCLE_SECTIONS, Profile

_Arrays: TypeAlias = dict[int, tuple[dict[str, dict[str, Any]], list[str]]]
"""Tables of arrays by name, and the names, by identity of the array. They make look-ups among thousands fast."""


def default_of(profile: Profile, key: str) -> object:
    """Default of a key of a profile, as plain data; None if it has none.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> default_of(load("paper-4ms").profile, "bus.gap_count"), default_of(load("paper-4ms").profile, "bus.nodes")
    (63, None)
    """
    section, _, last = key.rpartition(".")
    table = value_at(profile, section) if section else profile
    field = type(table).model_fields[last] if isinstance(table, Section) else None
    if field is None or field.is_required():
        return None
    default = field.get_default(call_default_factory=True)
    return list(default) if isinstance(default, tuple) else default


class KeyValue(NamedTuple):
    """The value of one key."""

    value: object
    """Value of the key, or its default; None if it has neither."""
    source: Literal["file", "default"]


def dotted_keys(profile: Profile) -> dict[str, KeyValue]:
    """Values of all keys of a profile, defaults included, by dotted key in the order of the schema.

    A network without a cycle has no keys of one.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> keys = dotted_keys(load("paper-4ms").profile)
    >>> keys["bus.nodes"], keys["servo.y.drive_lag_us"].source
    (KeyValue(value=2, source='file'), 'default')
    """
    in_file = dict(flat(profile.model_dump(exclude_unset=True)))
    whole = profile.model_dump(exclude=None if profile.has_cycle else {"cycle"})
    return {key: KeyValue(value, "file" if key in in_file else "default") for key, value in flat(whole)}


def flat(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Yield dotted key and value of everything but tables.

    In an array of tables, each table's name is a part of its keys, and the value of the array is the list of names:

    Examples
    --------
    >>> list(flat({"group": [{"name": "drives", "nodes": 2}]}))
    [('group', ['drives']), ('group.drives.nodes', 2)]
    """
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        elif (tables := named_tables(value)) is not None:
            yield f"{prefix}{name}", list(tables)
            for table_name, inner in tables.items():
                yield from flat({key: inner[key] for key in inner if key != NAME}, f"{prefix}{name}.{table_name}.")
        else:
            yield f"{prefix}{name}", value


NAME: Final = "name"
"""Key that names a table of an array of tables."""


def named_tables(value: object) -> dict[str, dict[str, Any]] | None:
    """Tables of an array by name; None if the value is no array of named tables."""
    if not isinstance(value, Sequence) or isinstance(value, str) or not value:
        return None
    tables = {str(inner[NAME]): inner for inner in value if isinstance(inner, dict) and NAME in inner}
    return tables if len(tables) == len(value) else None


def path_of(data: Mapping[str, object], key: str, arrays: _Arrays | None = None) -> tuple[str | int, ...]:
    """Path of a dotted key, with the index of a table in its array instead of its name.

    `arrays` keeps look-ups of arrays from one key of `data` to the next.

    Examples
    --------
    >>> path_of({"group": [{"name": "drives", "nodes": 2}]}, "group.drives.nodes")
    ('group', 0, 'nodes')
    """
    return tuple(step for step, _ in _steps(data, key.split("."), arrays))


def named_path(data: object, path: tuple[str | int, ...], arrays: _Arrays | None = None) -> tuple[str | int, ...]:
    """The path with the names of tables in arrays, where they have names, instead of their indexes.

    `arrays` keeps look-ups of arrays from one path of `data` to the next.
    """
    return tuple(name for _, name in _steps(data, path, arrays))


def _steps(
    data: object, path: Iterable[str | int], arrays: _Arrays | None = None
) -> Iterator[tuple[str | int, str | int]]:
    """Parts of a path, each in two forms that differ for a table in an array: index and name.

    The path may have either.
    """
    arrays = {} if arrays is None else arrays
    for part in path:
        if id(data) not in arrays:
            tables = named_tables(data) or {}
            arrays[id(data)] = tables, list(tables)
        tables, names = arrays[id(data)]
        if part in tables or (isinstance(part, int) and part < len(names)):
            name = names[part] if isinstance(part, int) else part
            yield part if isinstance(part, int) else names.index(name), name
            data = tables[name]
        else:
            yield part, part
            data = data.get(part) if isinstance(data, Mapping) else None


def holder(
    data: dict[str, Any], key: str, *, name: str | None = None, arrays: dict[int, Any] | None = None
) -> tuple[dict[str, Any], str]:
    """Table of a dotted key, created if it is missing, and the name of the key in it.

    `name` is the key's name in messages; None for the key itself. `arrays` keeps look-ups of arrays from one key of
    `data` to the next. BusplanError: a part of the key is a value, or there is no table of that name.
    """
    *sections, last = key.split(".")
    table: object = data
    arrays = {} if arrays is None else arrays
    for number, section in enumerate(sections):
        if not isinstance(table, dict) and id(table) not in arrays:
            arrays[id(table)] = table, named_tables(table)  # with the array, so that its identity stays its own
        _, tables = arrays.get(id(table), (table, None))
        if tables is not None:
            if section not in tables:
                raise BusplanError(
                    f"{name or key}: no {sections[number - 1]} is called {section}; there are {', '.join(tables)}"
                )
            table = tables[section]
        elif isinstance(table, dict):
            table = table.setdefault(section, {})
        else:
            raise BusplanError(f"{name or key}: no such key; {sections[number - 1]} is a value, not a section")
    if not isinstance(table, dict):
        tables = named_tables(table)
        why = f"{sections[-1]} is a value, not a section"
        hint = f"give the name of one, as {sections[-1]}.{next(iter(tables))}.{last}" if tables else why
        raise BusplanError(f"{name or key}: no such key; {hint}")
    return table, last


_NO_PART_OF_A_CYCLE: Final = (*CIRCLE_SECTIONS, "limits")
"""Sections whose common keys no cycle depends on; a cycle may depend on keys that a kind of bus adds to them."""
_OF_VERDICT: Final = ("limits.reserve", "limits.missed_cycles")
"""Keys of these sections on which a verdict depends."""
_OF_GROUP: Final = ("name", "execution.kind")
"""Keys of a group that determine how its other keys are read."""
_CHANGE_NO_FIGURE: Final = ("bus.kind", "node.execution.kind")
"""Keys that determine how others are read."""
_OF_CYCLE: Final = ("cycle.", "node.", "payload.", "bus.nodes", *_OF_VERDICT)
"""Beginnings of keys that do not matter to a network without a cycle."""


def kind_of(data: Mapping[str, object]) -> str | None:
    """Kind of bus in a profile's data; None if it is missing or unknown."""
    section = data.get("bus")
    kind = section.get("kind") if isinstance(section, Mapping) else None
    return kind if isinstance(kind, str) and kind in kind_names() else None


@cache
def profile_model(kind: str | None) -> type[Profile]:
    """Model of the profiles of a kind of bus; for None, the common model of all kinds."""
    return Profile if kind is None else kind_named(kind).profile_model()


def kinds_with(path: tuple[int | str, ...]) -> list[str]:
    """Kinds of bus whose profiles have a key."""
    return [kind for kind in kind_names() if any(True for _ in _fields(profile_model(kind), path))]


def _fields(model: type[BaseModel], path: tuple[int | str, ...]) -> Iterator[FieldInfo]:
    """Fields of a key, one for each member of a union that has it; for an element, the field of its array."""
    field = model.model_fields.get(str(path[0]))
    inner = [] if field is None else models_of(field.annotation)
    rest = path[2:] if len(path) > 1 and isinstance(path[1], int) else path[1:]
    if field is not None and not rest:
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

    `names` has the names of a profile's tables, for keys with several; `prefix` stands before each key.
    """
    for name, field in model.model_fields.items():
        inner = models_of(field.annotation)
        sections = [f"{name}.{table}" for table in names.get(name, ())] if _are_several(field.annotation) else [name]
        for section, section_model in product(sections, inner):
            yield from value_keys(section_model, {}, f"{prefix}{section}.")
        if _words(field.annotation) or (not inner and _is_number(field.annotation)):
            yield f"{prefix}{name}"


def cycle_keys(profile: Profile) -> tuple[str, ...]:
    """Keys of a profile on which its cycle or its verdict may depend."""
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
    """Words allowed as the value of a key of a profile; true and false for a boolean."""
    path = tuple(part for place, part in enumerate(key.split(".")) if not (place == 1 and key.startswith("group.")))
    fields = _fields(profile_model(profile.bus.kind), path)
    return tuple(dict.fromkeys(text for field in fields for text in _words(field.annotation)))


def _are_several(annotation: Any) -> bool:
    """Whether a key has several tables."""
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
_SCHEMA_ID: Final = "https://json.schemastore.org/busplan.json"


def profile_schema() -> dict[str, Any]:
    """JSON Schema of a profile, draft 2020-12, made by pydantic; `bus.kind` selects the schema of a kind of bus.

    Examples
    --------
    >>> profile_schema()["properties"]["bus"]["properties"]["kind"]["enum"][:2]
    ['ieee1394', 'can']
    """
    from pydantic.json_schema import GenerateJsonSchema, models_json_schema  # noqa: PLC0415 - one command alone needs it

    class WithConstants(GenerateJsonSchema):
        def get_default_value(self, schema: Any) -> Any:
            """Default of a key, also where it is a constant."""
            has_one = "default_factory" in schema and not schema.get("default_factory_takes_data")
            made = schema["default_factory"]() if has_one else None
            return made if isinstance(made, int | float) else super().get_default_value(schema)

    kinds = {kind: profile_model(kind) for kind in kind_names()}
    references, definitions = models_json_schema(
        [(model, "validation") for model in kinds.values()], schema_generator=WithConstants
    )
    # With conditions, validators name the wrong key; with a union, they would say that no member matches.
    chosen = [
        {"if": _has_kind({"const": kind}), "then": references[model, "validation"]} for kind, model in kinds.items()
    ]
    any_kind = _has_kind({"description": "Kind of bus", "enum": list(kinds)}, description="The bus")
    head = {"$schema": _DIALECT, "$id": _SCHEMA_ID, "title": "busplan profile"}
    return {**head, "type": "object", **any_kind, "allOf": chosen, **definitions}


def _has_kind(allowed: dict[str, Any], **more: str) -> dict[str, Any]:
    bus = {**more, "type": "object", "properties": {"kind": allowed}, "required": ["kind"]}
    return {"properties": {"bus": bus}, "required": ["bus"]}
