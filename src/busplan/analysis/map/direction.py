"""A direction of a map: a key and its values."""

from functools import reduce
from typing import Any, Final, NamedTuple

from busplan.analysis.network import network_of
from busplan.analysis.sweep.grid import Values, require_keys
from busplan.buses.bus import Value
from busplan.buses.network import Group
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.sections.profile import Profile

AXES: Final = "axes"
"""Key of the direction along the axes of all nodes. No key of a profile: it sets the number of nodes."""
PERIOD: Final = "cycle.period_us"
MOST_VALUES: Final = 64
"""Most values of a direction, as many as gap counts: more do not fit into 80 columns."""


class Direction(NamedTuple):
    """One direction of a map."""

    key: str
    """Dotted key of the profile, or `AXES`."""
    values: tuple[Value, ...]
    """In the unit of the key; numbers ascend."""


def varied_nodes(profile: Profile) -> tuple[str, Group]:
    """Key of the number of nodes that `AXES` sets, and the group of these nodes."""
    (group,) = network_of(profile).groups
    return "bus.nodes", group


def profile_key(key: str, profile: Profile) -> str:
    """Key of the profile that a direction sets."""
    return varied_nodes(profile)[0] if key == AXES else key


def profile_value(key: str, value: Value, profile: Profile) -> Value:
    """Value that a direction gives its key of the profile.

    Parameters
    ----------
    key
        Key of the direction.
    value
        Value along it.
    profile
        The profile with the values of the other direction.

    Raises
    ------
    BusplanError
        A number of axes that no whole number of nodes has.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> profile_value("axes", 12, load("paper-4ms").profile)
    3
    """
    if key != AXES:
        return value
    group = varied_nodes(profile)[1]
    others = network_of(profile).axes - group.nodes * group.axes
    nodes = (value - others) / group.axes if not isinstance(value, str) else 0
    if nodes < 1 or nodes != int(nodes):
        beside = f", beside {others} others" if others else ""
        raise BusplanError(f"axes = {value}: no whole number of nodes, with {group.axes} axes each{beside}")
    return int(nodes)


def own_value(key: str, profile: Profile) -> Any:
    """The profile's own value along a direction; None if it has none."""
    if key == AXES:
        return int(plain(network_of(profile).axes))
    return reduce(getattr, key.split("."), profile)


def checked_direction(
    profile: Profile, key: str, values: Values, *, option: str, circle_option: str | None = None
) -> Direction:
    """Make a direction after checking its key and how many values it has.

    The values are not checked: a setting that the profile's schema refuses is not drawn.

    Parameters
    ----------
    profile
        The network.
    key
        Dotted key of the profile, or `AXES`.
    values
        Its values.
    option
        What gives them, for messages.
    circle_option
        What requests circle tests, for messages; None where they are run.

    Raises
    ------
    BusplanError
        A key that is unknown, not a number, or without effect here; too many values.
    """
    if key != AXES:
        require_keys(profile, [key], option=option, circle_option=circle_option)
    if values.size > MOST_VALUES:
        raise BusplanError(
            f"{option} {key}: {values.size:,} values; a map shows up to {MOST_VALUES} of a key. A sweep takes more"
        )
    found = [_whole(one) for one in values.part(0, values.size).tolist()]
    return Direction(key, tuple(found if values.has_words else sorted(found)))


def _whole(value: Value) -> Value:
    return int(value) if isinstance(value, float) and value.is_integer() else value
