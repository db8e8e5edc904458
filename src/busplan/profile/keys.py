"""A profile as dotted keys with their values."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from busplan.errors import BusplanError
from busplan.sections.base import Section, value_at
from busplan.sections.profile import Profile

_Known: TypeAlias = dict[int, tuple[dict[str, dict[str, Any]], list[str]]]


def default_of(profile: Profile, key: str) -> object:
    """Default value of a key that a profile has, as plain data; None if it has none.

    Examples
    --------
    >>> from busplan.profile.shipped import load
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
    """None if the key has neither a value nor a default."""
    source: Literal["file", "default"]


def dotted_keys(profile: Profile) -> dict[str, KeyValue]:
    """List all keys of a profile, including those with default values; none of a cycle where there is none.

    Parameters
    ----------
    profile
        Any profile.

    Returns
    -------
    dict
        Values by dotted key, in the order of the schema.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> keys = dotted_keys(load("paper-4ms").profile)
    >>> keys["bus.nodes"], keys["servo.y.drive_lag_us"].source
    (KeyValue(value=2, source='file'), 'default')
    """
    said = dict(flat(profile.model_dump(exclude_unset=True)))
    whole = profile.model_dump(exclude=None if profile.has_cycle else {"cycle"})
    return {key: KeyValue(value, "file" if key in said else "default") for key, value in flat(whole)}


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


def path_of(data: Mapping[str, object], key: str, known: _Known | None = None) -> tuple[str | int, ...]:
    """Path of a dotted key, with the index of a table in its array instead of its name.

    Parameters
    ----------
    data
        The tables.
    key
        The key.
    known
        Remembers the names of arrays from one key of `data` to the next.

    Examples
    --------
    >>> path_of({"group": [{"name": "drives", "nodes": 2}]}, "group.drives.nodes")
    ('group', 0, 'nodes')
    """
    return tuple(step for step, _ in _steps(data, key.split("."), known))


def named_path(data: object, path: tuple[str | int, ...], known: _Known | None = None) -> tuple[str | int, ...]:
    """The path with the names of tables in arrays instead of their indexes, where they have names.

    Parameters
    ----------
    data
        The tables.
    path
        The path.
    known
        Remembers the names of arrays from one path of `data` to the next.
    """
    return tuple(name for _, name in _steps(data, path, known))


def _steps(
    data: object, path: Iterable[str | int], known: _Known | None = None
) -> Iterator[tuple[str | int, str | int]]:
    """Each part of a path; that of a table in an array as its index and as its name, whichever the path has."""
    known = {} if known is None else known
    for part in path:
        if id(data) not in known:
            tables = named_tables(data) or {}
            known[id(data)] = tables, list(tables)
        tables, names = known[id(data)]
        if part in tables or (isinstance(part, int) and part < len(names)):
            name = names[part] if isinstance(part, int) else part
            yield part if isinstance(part, int) else names.index(name), name
            data = tables[name]
        else:
            yield part, part
            data = data.get(part) if isinstance(data, Mapping) else None


def holder(data: dict[str, Any], key: str, *, name: str | None = None) -> tuple[dict[str, Any], str]:
    """Find the table of a dotted key, created if it is missing, and the name of the key in it.

    Parameters
    ----------
    data
        The tables.
    key
        The dotted key.
    name
        What messages call the key; by default the key.

    Raises
    ------
    BusplanError
        A part of the key is a value, or there is no table of that name.
    """
    *sections, last = key.split(".")
    table: object = data
    for number, section in enumerate(sections):
        tables = named_tables(table)
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
        known = f"give the name of one, as {sections[-1]}.{next(iter(tables))}.{last}" if tables else why
        raise BusplanError(f"{name or key}: no such key; {known}")
    return table, last
