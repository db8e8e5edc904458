"""A direction of a map: a key and its values."""

from typing import Any, Final, NamedTuple

from busplan.buses.parts import Value
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.profile.write import whole
from busplan.questions.fit.network import network_of, varied_nodes
from busplan.questions.sweep.grid import Values, require_keys
from busplan.sections.base import value_at
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


def profile_key(key: str, profile: Profile) -> str:
    """Key of the profile that a direction sets."""
    return varied_nodes(profile).nodes_key if key == AXES else key


def nodes_with(axes: Value, profile: Profile, *, nodes_key: str) -> int:
    """Number of nodes with which all nodes have so many axes [1].

    Parameters
    ----------
    axes
        Axes of all nodes [1].
    profile
        The network, with the other direction's value.
    nodes_key
        Dotted key of the number.

    Raises
    ------
    BusplanError
        No whole number of nodes has so many axes.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> nodes_with(12, load("paper-4ms").profile, nodes_key="bus.nodes")
    3
    """
    alike = next(one for one in profile.alike_nodes if one.nodes_key == nodes_key)
    each = int(alike.node.axes)
    others = int(plain(network_of(profile).axes)) - int(alike.nodes) * each
    own = axes - others if isinstance(axes, int) else 0
    if own < max(each, 1) or not each or own % each:
        beside = f" beside {others} others" if others else ""
        raise BusplanError(f"axes = {axes}: no whole number of nodes, with {each} axes each{beside}")
    return own // each


def own_value(key: str, profile: Profile) -> Any:
    """The profile's own value along a direction; None if it has none."""
    return int(plain(network_of(profile).axes)) if key == AXES else value_at(profile, key)


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
    found = [whole(one) for one in values.part(0, values.size).tolist()]
    return Direction(key, tuple(found if values.has_words else sorted(found)))
