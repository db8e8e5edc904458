"""A direction of a map: a key and its values, given or chosen about what fits."""

from bisect import bisect_right
from math import ceil
from typing import Any, Final, NamedTuple

import numpy as np

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.elementwise import FIT_ROUNDING, plain
from busplan.errors import BusplanError
from busplan.forms.scale import round_numbers
from busplan.profile.write import whole
from busplan.questions.fit.certainty import certainty
from busplan.questions.fit.figures import shortest_period_us
from busplan.questions.fit.network import PERIOD, at_period, varied_nodes
from busplan.questions.fit.node_limit import safe_nodes
from busplan.questions.sweep.grid import Array, require_keys
from busplan.sections.base import MAX_COUNT, MAX_TIME_US, MIN_STEP_US, value_at
from busplan.sections.profile import Profile

AXES: Final = "axes"
"""Key of the direction along the axes of all nodes. No key of a profile: it sets the number of nodes."""
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


def nodes_with(axes: Value, network: Network, *, nodes_key: str) -> int:
    """Number of nodes with which all nodes have so many axes [1].

    Parameters
    ----------
    axes
        Axes of all nodes [1].
    network
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
    >>> from busplan.questions.fit.network import network_of
    >>> nodes_with(12, network_of(load("paper-4ms").profile), nodes_key="bus.nodes")
    3
    """
    alike = next(alike for alike in network.profile.alike_nodes if alike.nodes_key == nodes_key)
    node_axes = int(alike.node.axes)
    axes_beside = int(plain(network.axes)) - int(alike.nodes) * node_axes
    own = axes - axes_beside if isinstance(axes, int) else 0
    if own < max(node_axes, 1) or not node_axes or own % node_axes:
        beside = f" beside {axes_beside} others" if axes_beside else ""
        raise BusplanError(f"axes = {axes}: no whole number of nodes, with {node_axes} axes each{beside}")
    return own // node_axes


def own_value(key: str, network: Network) -> Any:
    """The profile's own value along a direction; None if it has none."""
    return int(plain(network.axes)) if key == AXES else value_at(network.profile, key)


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


def default_direction(key: str, network: Network) -> Direction:
    """Choose the values of `AXES` or of `PERIOD` about what fits.

    Parameters
    ----------
    key
        `AXES` or `PERIOD`.
    network
        The network.
    """
    varied = varied_nodes(network.profile)
    own_us, own_nodes = network.profile.cycle.period_us, int(varied.nodes)
    # A cycle of no node that fits shows the own period alone.
    fit_us = _periods_of_nodes(network, varied.name) or [own_us]
    to_us = max(2 * own_us, 1.25 * fit_us[min(own_nodes, len(fit_us)) - 1], min(4 * own_us, 1.25 * fit_us[-1]))
    from_us = min(own_us, fit_us[0], to_us / 4) / 1.25
    if key == AXES:
        most = bisect_right(fit_us, to_us * (1 + FIT_ROUNDING))
        counts, node_axes = _counts(own_nodes, most), int(varied.node.axes)
        if not node_axes:  # nodes without axes are counted themselves
            return Direction(varied.nodes_key, counts)
        axes_beside = own_value(AXES, network) - own_nodes * node_axes
        return Direction(AXES, tuple(axes_beside + count * node_axes for count in counts))
    least_us, most_us = max(from_us, MIN_STEP_US), min(to_us, MAX_TIME_US)
    known = [known_us for known_us in network.bus.periods.us if least_us <= known_us <= most_us]
    periods_us = (
        known[:: ceil(len(known) / _MOST)] if known else round_numbers(least_us, most_us, most=_MOST, decades=_FACTORS)
    )
    return Direction(PERIOD, tuple(sorted({*periods_us, own_us})))


def _periods_of_nodes(network: Network, group: str) -> list[float]:
    """Shortest periods at which 1, 2, ... nodes of a group are shown to fit; of no more than fit any period [us]."""
    bus = network.bus
    most, _ = safe_nodes(at_period(network, min(MAX_TIME_US, bus.periods.longest_us)), group=group)
    counts = np.arange(1, most + 1)
    cycle = bus.cycle(network.asking(group).with_nodes(counts), model=bus.deciding_model)
    needed_us = np.asarray(certainty(cycle).safe_required_us)
    periods_us = shortest_period_us(cycle.network, needed_us, is_shown=True)
    return [float(us) for us in np.broadcast_to(np.asarray(periods_us), counts.shape)]


def _counts(own: int, most: int) -> tuple[int, ...]:
    """Numbers of nodes, from one to some beyond the most that fit the longest period drawn.

    Steps of one size about this design, to twice its nodes; beyond, steps that grow.
    """
    last = min(max(own + 1, most + _BEYOND), MAX_COUNT)
    near = last if last <= _MOST else min(2 * own, last)
    most = _MOST if near == last else _MOST // 2
    step = next(size for size in (f * 10**p for p in range(7) for f in (1, 2, 5)) if near <= most * size)
    about = range(own % step or step, near + 1, step)
    beyond = round_numbers(near, last, most=_MOST - len(about), decades=_FACTORS) if near < last else []
    return tuple(sorted({1, *about, *(ceil(nodes) for nodes in beyond), last}))
