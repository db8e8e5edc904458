"""How a command names a profile that is in memory."""

from collections.abc import Mapping

from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChange, KeyChanges
from busplan.profile.keys import dotted_keys
from busplan.profile.shipped import load, shipped_names
from busplan.profile.write import value_text
from busplan.questions.base.inputs import values_by_key
from busplan.sections.profile import Profile

Origin = tuple[str, KeyChanges]
"""A PROFILE argument, and the changes of that profile by options."""


def origin_of(profile: Profile) -> Origin:
    """Tell a PROFILE argument and the `--set` options that give a profile.

    Parameters
    ----------
    profile
        Any profile.

    Returns
    -------
    tuple
        The shipped profile of its name with the changes that make it equal; or a file of its name, NAME.toml, where
        no changes can.

    Examples
    --------
    >>> from busplan.profile.toml import override
    >>> changed = override(load("paper-4ms").profile, {"bus.nodes": 3})
    >>> origin_of(changed)[0], origin_of(changed)[1].words
    ('paper-4ms', '--set bus.nodes=3')
    """
    changes = _changes_of_shipped(profile) if profile.name in shipped_names() else None
    return (f"{profile.name}.toml", NO_CHANGES) if changes is None else (profile.name, changes)


def key_changes(values: Mapping[str, object]) -> KeyChanges:
    """Changes of a profile from new values by dotted key, as `--set` options say them.

    Raises
    ------
    BusplanError
        Not new values by key, two of them overlap, or a value that TOML has not.
    """
    return KeyChanges(tuple(_key_change(key, value) for key, value in values_by_key(values, name="changes").items()))


def _key_change(key: str, value: object) -> KeyChange:
    try:
        return KeyChange(key, value, text=f"{key}={value_text(value)}")
    except (TypeError, ValueError):
        raise BusplanError(f"changes {key}: {value!r} is no value of a profile") from None


def _changes_of_shipped(profile: Profile) -> KeyChanges | None:
    """Changes from the shipped profile of the same name; None if none lead to it."""
    shipped = load(profile.name).profile
    old, new = dotted_keys(shipped), dotted_keys(profile)
    differing = {key: one.value for key, one in new.items() if key not in old or old[key].value != one.value}
    try:
        changes = key_changes(differing)
        return changes if changes.applied(shipped) == profile else None
    except (BusplanError, TypeError):  # a key that is gone, or a group of its own, is no value that an option sets
        return None
