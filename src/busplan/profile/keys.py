"""A profile as dotted keys: each value in force, and whether the file says it."""

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

from busplan.sections.profile import Profile


class KeyValue(NamedTuple):
    """The value of one key."""

    value: object
    """None where nothing is said and nothing is assumed."""
    source: Literal["file", "default"]


def dotted_keys(profile: Profile) -> dict[str, KeyValue]:
    """Take a profile apart into its keys, those with their defaults among them.

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
    said = dict(_flat(profile.model_dump(exclude_unset=True)))
    return {key: KeyValue(value, "file" if key in said else "default") for key, value in _flat(profile.model_dump())}


def _flat(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
