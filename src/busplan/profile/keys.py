"""A profile as dotted keys with their values."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple

from busplan.errors import BusplanError
from busplan.sections.profile import Profile


class KeyValue(NamedTuple):
    """The value of one key."""

    value: object
    """None if the key has neither a value nor a default."""
    source: Literal["file", "default"]


def dotted_keys(profile: Profile) -> dict[str, KeyValue]:
    """List all keys of a profile, including those with default values.

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
    return {key: KeyValue(value, "file" if key in said else "default") for key, value in flat(profile.model_dump())}


def flat(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Yield dotted key and value of everything but tables."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


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
        A part of the key is a value.
    """
    *tables, last = key.split(".")
    for table in tables:
        data = data.setdefault(table, {})
        if not isinstance(data, dict):
            raise BusplanError(f"{name or key}: no such key; {table} is a value, not a section")
    return data, last
