"""A grid: values of some keys, the networks at its points, and their figures, in arrays where a kind has them."""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

from busplan.buses.network import Network
from busplan.errors import BusplanError
from busplan.questions.fit.figures import (
    Counts,
    FitFigures,
    GroupCapacity,
    counts_at,
    fit_numbers,
    has_arrays,
    with_counts,
)
from busplan.questions.fit.most_nodes import most_and_safe_nodes
from busplan.questions.fit.network import changed, model_names, trial
from busplan.sections.machine import ProfileGroup
from busplan.sections.profile import Profile, varied_nodes

if TYPE_CHECKING:
    from numpy.typing import NDArray

Array: TypeAlias = "NDArray[Any]"
"""Numbers, truth values, or objects if there are words among them."""
AXES: Final = "axes"
"""Key of a direction along the number of motion axes. It is no key of a profile: it sets the number of nodes."""

_Changes: TypeAlias = tuple[tuple[str, object], ...]


MOST_TABLES: Final = 50_000
"""Most groups and messages of all settings of a picture together."""


def tables_in(profile: Profile) -> int:
    """Number of groups and messages of a profile."""
    return len(profile.node_groups) + len(getattr(profile, "message", ()))


def require_few_tables(network: Network, *, settings: int, most: int = MOST_TABLES) -> None:
    """Refuse a grid whose settings all together have too many groups and messages."""
    tables = tables_in(network.profile)
    if settings * tables > most:
        raise BusplanError(
            f"{settings:,} settings of {tables:,} groups and messages take too long: give values for up to "
            f"{most // tables:,} settings"
        )


class Grid(NamedTuple):
    """Every combination of the values of some keys; the last key changes fastest."""

    axes: dict[str, Array]
    """Values by key, each of shape (values,): whole numbers, floats, or objects if there are words among them."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Values of each key."""
        return tuple(axis.size for axis in self.axes.values())

    @property
    def points(self) -> int:
        """Number of points."""
        return prod(self.shape)

    def each_point(self) -> Iterator[dict[str, object]]:
        """Values of the keys of each point."""
        points = product(*(axis.tolist() for axis in self.axes.values()))
        return (dict(zip(self.axes, point, strict=True)) for point in points)


class GridPoint(NamedTuple):
    """A point of a grid that a profile can have."""

    changes: dict[str, object]
    """New values by key of the profile."""
    network: Network
    """The network with them."""

    def without(self, key: str) -> _Changes:
        """Changes of the point but for one key: points that share them share what does not depend on the key."""
        return tuple(change for change in self.changes.items() if change[0] != key)


class GridPoints(NamedTuple):
    """The points of a grid by their number, the last key changing fastest."""

    possible: dict[int, GridPoint]
    refused: dict[int, str]
    """Reason why a profile cannot have the point."""


def points_of(network: Network, grid: Grid) -> GridPoints:
    """The network at each point of a grid; `AXES` may be one of its keys."""
    points = GridPoints({}, {})
    # The other values may change how many nodes it takes for the axes.
    others: dict[_Changes, Network] = {}
    for number, values in enumerate(grid.each_point()):
        changes: dict[str, object] = {key: value for key, value in values.items() if key != AXES}
        try:
            if AXES in values:
                if (known := tuple(changes.items())) not in others:
                    others[known] = changed(network, changes)
                nodes_key = varied_nodes(network.profile).nodes_key
                changes[nodes_key] = _nodes_with(values[AXES], others[known], nodes_key=nodes_key)
            points.possible[number] = GridPoint(changes, changed(network, changes))
        except BusplanError as error:
            points.refused[number] = error.problems[0]
    return points


def _nodes_with(axes: object, network: Network, *, nodes_key: str) -> int:
    """Number of varied nodes with which the whole network has so many axes [1].

    BusplanError: no whole number of nodes has so many axes.
    """
    varied = next(nodes for nodes in network.profile.node_groups if nodes.nodes_key == nodes_key)
    node_axes = int(varied.node.axes)
    other_axes = int(network.axes) - int(varied.nodes) * node_axes
    varied_axes = axes - other_axes if isinstance(axes, int) else 0
    if varied_axes < node_axes or not node_axes or varied_axes % node_axes:
        beside = f" beside {other_axes} others" if other_axes else ""
        raise BusplanError(f"axes = {axes}: no whole number of nodes, with {node_axes} axes each{beside}")
    return varied_axes // node_axes


def fits_at(points: Sequence[GridPoint], *, model: str) -> list[FitFigures]:
    """Whether the network at each point fits its own period under a timing model that can express it."""
    found: dict[int, FitFigures] = {}
    for places, network in _in_arrays(points):
        numbers = fit_numbers(network, model=model)
        each = numbers.at_points(len(places)) if len(places) > 1 else [numbers]
        found |= {place: at.figures() for place, at in zip(places, each, strict=True)}
    return [found[place] for place in range(len(points))]


def capacities(network: Network, points: Sequence[GridPoint]) -> list[tuple[FitFigures, ...]]:
    """Capacity at each point of a network's grid, under every timing model that can express it.

    The most nodes of a group do not depend on how many it has: points that differ in nothing else share them.
    """
    models = [model_names(point.network) for point in points]
    results: list[tuple[FitFigures, ...]] = [() for _ in points]
    for model in (model.name for model in network.bus.timing_models):
        places = [place for place, names in enumerate(models) if model in names]
        at = [points[place] for place in places]
        of_groups = [_counts(at, group, model=model) for group in network.profile.node_groups]
        for place, fit, *counts in zip(places, fits_at(at, model=model), *of_groups, strict=True):
            results[place] += (with_counts(fit, tuple(counts)),)
    return results


def _counts(points: Sequence[GridPoint], group: ProfileGroup, *, model: str) -> list[GroupCapacity]:
    """Capacity of a group at each point."""
    keys = [point.without(group.nodes_key) for point in points]
    different = dict(zip(keys, points, strict=True))
    names: list[_Changes] = [*different]
    counts: dict[_Changes, Counts] = {}
    for places, network in _in_arrays([*different.values()], without=group.nodes_key):
        found = most_and_safe_nodes(partial(network.with_nodes, group=group.name), network, model=model)
        counts |= zip((names[place] for place in places), counts_at(found, len(places)), strict=True)
    return [
        GroupCapacity.of(point.network.group_named(group.name), *counts[key])
        for point, key in zip(points, keys, strict=True)
    ]


def _in_arrays(points: Sequence[GridPoint], *, without: str = "") -> Iterator[tuple[list[int], Network]]:
    """Networks that stand for several points: the places of the points, and each.

    They hold arrays, but where nodes are counted, whose key is `without`, only of a kind that counts them in arrays.
    """
    alike: dict[object, list[int]] = {}
    for place, point in enumerate(points):
        # What is no number is the same at all points of an array.
        words = tuple((key, None if _is_number(value) else value) for key, value in point.without(without))
        alike.setdefault(words if not without or has_arrays(point.network) else place, []).append(place)
    for places in alike.values():
        first = points[places[0]]
        if len(places) == 1:
            yield places, first.network
            continue
        import numpy as np

        values = {
            key: np.array([points[place].changes[key] for place in places], float) if _is_number(value) else value
            for key, value in first.without(without)
        }
        yield places, trial(first.network, values)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
