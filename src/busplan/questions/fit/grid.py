"""Figures over a grid: the settings of some keys that a profile can have, and the capacity at each of them."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from busplan.buses.limits import Value
from busplan.buses.network import Network
from busplan.errors import BusplanError
from busplan.questions.fit.figures import (
    CapacityFigures,
    Counts,
    GroupCapacity,
    counts_at,
    figures,
    has_arrays,
    most_and_safe_nodes,
    with_counts,
)
from busplan.questions.fit.network import changed, model_names, trial
from busplan.sections.machine import ProfileGroup
from busplan.sections.profile import varied_nodes

AXES: Final = "axes"
"""Key of a direction along the number of motion axes. It is no key of a profile: it sets the number of nodes."""

_Changes: TypeAlias = tuple[tuple[str, object], ...]


class Setting(NamedTuple):
    """One combination of values that a profile can have."""

    changes: dict[str, object]
    """New values by key of the profile."""
    network: Network
    """The network with them."""

    def without(self, key: str) -> _Changes:
        """Its changes but for one key: settings that share them share what does not depend on the key."""
        return tuple(change for change in self.changes.items() if change[0] != key)


def setting_at(network: Network, values: Mapping[str, Value]) -> Setting | str:
    """The network with a value of each direction, or why there is none."""
    changes: dict[str, object] = {key: value for key, value in values.items() if key != AXES}
    try:
        if AXES in values:
            # The other value may change how many nodes it takes for these axes.
            nodes_key = varied_nodes(network.profile).nodes_key
            changes[nodes_key] = _nodes_with(values[AXES], changed(network, changes), nodes_key=nodes_key)
        return Setting(changes, changed(network, changes))
    except BusplanError as error:
        return error.problems[0]


def _nodes_with(axes: Value, network: Network, *, nodes_key: str) -> int:
    """Number of varied nodes with which the whole network has so many axes [1].

    Raises
    ------
    BusplanError
        No whole number of nodes has so many axes.
    """
    varied = next(nodes for nodes in network.profile.node_groups if nodes.nodes_key == nodes_key)
    node_axes = int(varied.node.axes)
    other_axes = int(network.axes) - int(varied.nodes) * node_axes
    varied_axes = axes - other_axes if isinstance(axes, int) else 0
    if varied_axes < max(node_axes, 1) or not node_axes or varied_axes % node_axes:
        beside = f" beside {other_axes} others" if other_axes else ""
        raise BusplanError(f"axes = {axes}: no whole number of nodes, with {node_axes} axes each{beside}")
    return varied_axes // node_axes


def capacities(network: Network, settings: Sequence[Setting]) -> list[tuple[CapacityFigures, ...]]:
    """Capacity at each setting of a network, under every timing model that can express it.

    The most nodes of a group do not depend on how many it has: settings that differ in nothing else share them.
    """
    models = [model_names(setting.network) for setting in settings]
    results: list[tuple[CapacityFigures, ...]] = [() for _ in settings]
    for model in (model.name for model in network.bus.timing_models):
        places = [place for place, names in enumerate(models) if model in names]
        at = [settings[place] for place in places]
        of_groups = [_counts(at, group, model=model) for group in network.profile.node_groups]
        for place, counts in zip(places, zip(*of_groups, strict=True) if of_groups else [()] * len(at), strict=True):
            results[place] += (with_counts(figures(settings[place].network, model=model), counts),)
    return results


def _counts(settings: Sequence[Setting], group: ProfileGroup, *, model: str) -> list[GroupCapacity]:
    """Capacity of a group at each setting, in arrays where its kind has them."""
    points = {setting.without(group.nodes_key): setting.network for setting in settings}
    words: dict[_Changes, Counts] = {}
    alike: dict[_Changes, list[_Changes]] = {}
    for point, network in points.items():
        if has_arrays(network):
            # What is no number is the same at all points of an array.
            alike.setdefault(tuple((key, None if _is_number(value) else value) for key, value in point), []).append(
                point
            )
        else:
            most, safe = most_and_safe_nodes(network.varying(group.name).with_nodes, network, model=model)
            words[point] = most.words, safe and safe.words
    for of_array in alike.values():
        columns = zip(*([value for _, value in point] for point in of_array), strict=True)
        values = {
            key: np.array(column, float) if _is_number(column[0]) else column[0]
            for (key, _), column in zip(of_array[0], columns, strict=True)
        }
        network = trial(points[of_array[0]], values).varying(group.name)
        found = most_and_safe_nodes(network.with_nodes, network, model=model)
        words |= zip(of_array, counts_at(found, len(of_array)), strict=True)
    return [
        GroupCapacity.of(_group(setting.network, group.name), *words[setting.without(group.nodes_key)])
        for setting in settings
    ]


def _group(network: Network, name: str) -> ProfileGroup:
    return network.varying(name).varied_group


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
