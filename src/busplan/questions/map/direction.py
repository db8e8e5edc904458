"""A direction of a map: a key and its values, given or chosen about what fits."""

from math import ceil
from typing import Any, Final, NamedTuple

from busplan.buses.parts import Value
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.forms.scale import round_numbers
from busplan.profile.write import whole
from busplan.questions.fit.circle_refusal import step_refusals
from busplan.questions.fit.network import bus_of, network_of, varied_nodes
from busplan.questions.fit.node_steps import NodeSteps, node_steps, telling_periods
from busplan.questions.sweep.grid import Array, require_keys
from busplan.sections.base import MAX_COUNT, MAX_TIME_US, MIN_STEP_US, value_at
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
    alike = next(alike for alike in profile.alike_nodes if alike.nodes_key == nodes_key)
    node_axes = int(alike.node.axes)
    axes_beside = int(plain(network_of(profile).axes)) - int(alike.nodes) * node_axes
    own = axes - axes_beside if isinstance(axes, int) else 0
    if own < max(node_axes, 1) or not node_axes or own % node_axes:
        beside = f" beside {axes_beside} others" if axes_beside else ""
        raise BusplanError(f"axes = {axes}: no whole number of nodes, with {node_axes} axes each{beside}")
    return own // node_axes


def own_value(key: str, profile: Profile) -> Any:
    """The profile's own value along a direction; None if it has none."""
    return int(plain(network_of(profile).axes)) if key == AXES else value_at(profile, key)


def checked_direction(
    profile: Profile, key: str, values: Array, *, option: str, circle_option: str | None = None
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
        Option or key that gives them, for messages.
    circle_option
        Option or key that asks for circle tests, for messages; None where they are run.

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
    numbers = [whole(value) for value in values.tolist()]
    return Direction(key, tuple(numbers if values.dtype == object else sorted(numbers)))


_FACTORS: Final = ((1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8), (1, 2, 5), (1,))
"""Round numbers of a decade, the finest choice first."""
_MOST: Final = 20
"""Most values of a direction, but for the profile's own."""
_BEYOND: Final = 2
"""Nodes drawn beyond the most that fit."""


def default_direction(key: str, profile: Profile, *, with_circle: bool) -> Direction:
    """Choose the values of `AXES` or of `PERIOD` about what fits.

    Parameters
    ----------
    key
        `AXES` or `PERIOD`.
    profile
        The network.
    with_circle
        Whether circles are run, though the profile may not ask for one.
    """
    varied = varied_nodes(profile)
    steps = node_steps(profile, model=bus_of(profile).deciding_model, group=varied.name)
    from_us, to_us = telling_periods(profile, [steps])
    if key == AXES:
        nodes, node_axes = _nodes(steps, to_us), int(varied.node.axes)
        if not node_axes:  # nodes without axes are counted themselves
            return Direction(varied.nodes_key, nodes)
        axes_beside = own_value(AXES, profile) - steps.own_nodes * node_axes
        return Direction(AXES, tuple(axes_beside + count * node_axes for count in nodes))
    own_us = own_value(PERIOD, profile)
    least_us, most_us = max(from_us, MIN_STEP_US), min(to_us, MAX_TIME_US)
    known = [known_us for known_us in bus_of(profile).periods.us if least_us <= known_us <= most_us]
    periods_us = (
        known[:: ceil(len(known) / _MOST)] if known else round_numbers(least_us, most_us, most=_MOST, decades=_FACTORS)
    )
    if with_circle or profile.asks_for_circle:
        # Periods whose circle can be run; all, where the step goes with none.
        periods_us = [period_us for period_us in periods_us if not any(step_refusals(profile, period_us))] or periods_us
    return Direction(PERIOD, tuple(sorted({*periods_us, own_us})))


def _nodes(steps: NodeSteps, to_us: float) -> tuple[int, ...]:
    """Numbers of nodes, from one to some beyond the most that fit the longest period drawn.

    Steps of one size about this design, to twice its nodes; beyond, steps that grow.
    """
    own = steps.own_nodes
    last = min(max(own + 1, steps.max_nodes(to_us) + _BEYOND), MAX_COUNT)
    near = last if last <= _MOST else min(2 * own, last)
    most = _MOST if near == last else _MOST // 2
    step = next(size for size in (f * 10**p for p in range(7) for f in (1, 2, 5)) if near <= most * size)
    about = range(own % step or step, near + 1, step)
    beyond = round_numbers(near, last, most=_MOST - len(about), decades=_FACTORS) if near < last else []
    return tuple(sorted({1, *about, *(ceil(nodes) for nodes in beyond), last}))
