"""A full grid of profile values in row-major order."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from itertools import islice, product
from math import prod
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.english import listed
from busplan.errors import BusplanError
from busplan.profile.keys import named_tables
from busplan.profile.kinds import cycle_keys
from busplan.profile.toml import override
from busplan.profile.write import whole
from busplan.questions.base.inputs import known_model
from busplan.questions.fit.network import changed, model_names
from busplan.sections.profile import CIRCLE_SECTIONS, Profile

Array = NDArray[Any]
"""Numbers, truth values, or objects if there are words among them."""

_CHECKED_EACH: Final = 100
"""Up to this many values of a key are all checked; of more, the extremes: every valid range is an interval."""
MOST_POINTS: Final = 1_000_000
"""Most points of a sweep: the work on them takes up to two gigabytes of memory."""


def axis_of(values: Sequence[Value]) -> Array:
    """Values of a key as an array: whole numbers, floats, or objects if there are words among them.

    Parameters
    ----------
    values
        Numbers, and words that the key takes.
    """
    if any(isinstance(value, str | bool) for value in values):
        return np.array(values, dtype=object)
    # NumPy keeps whole numbers beyond 64 bits as objects.
    return np.array(values, dtype=float if any(isinstance(value, float) for value in values) else None)


class Chunk(NamedTuple):
    """A contiguous part of a grid."""

    shape: tuple[int, ...]
    """Points along each axis of the grid."""
    values: dict[str, Array]
    """Values of each key, shaped to broadcast along its own axis."""


class Grid(NamedTuple):
    """Every combination of the values of some keys; the last key changes fastest."""

    axes: dict[str, Array]
    """Values by key, each of shape (values,), as from `axis_of`."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Values of each key."""
        return tuple(axis.size for axis in self.axes.values())

    @property
    def points(self) -> int:
        """How many points."""
        return prod(self.shape)

    def each_point(self) -> Iterator[dict[str, object]]:
        """Values of the keys of each point."""
        points = product(*(axis.tolist() for axis in self.axes.values()))
        return (dict(zip(self.axes, point, strict=True)) for point in points)

    def chunks(self, most: int) -> Iterator[Chunk]:
        """Split the grid.

        Parameters
        ----------
        most
            Largest number of points of a chunk.

        Yields
        ------
        Chunk
            In row-major order.
        """
        # The axis to cut: a chunk has all values of the axes after it and one value of each axis before it.
        cut = next(number for number in range(len(self.shape) + 1) if prod(self.shape[number + 1 :]) <= most)
        width = max(1, most // prod(self.shape[cut + 1 :]))
        parts = [
            *([slice(index, index + 1) for index in range(size)] for size in self.shape[:cut]),
            *([slice(begin, begin + width) for begin in range(0, size, width)] for size in self.shape[cut : cut + 1]),
            *([slice(size)] for size in self.shape[cut + 1 :]),
        ]
        for part in product(*parts):
            values = [axis[own] for axis, own in zip(self.axes.values(), part, strict=True)]
            yield Chunk(tuple(own.size for own in values), dict(zip(self.axes, np.ix_(*values), strict=True)))


def checked_grid(profile: Profile, axes: Mapping[str, Array], *, with_circle: bool) -> Grid:
    """Make a grid after validating its values.

    Parameters
    ----------
    profile
        The network.
    axes
        Values by dotted key.
    with_circle
        If False, keys that only the circle test reads are refused.

    Raises
    ------
    BusplanError
        A key that is unknown, not a number, or without effect here; a value that the profile's schema refuses; too
        many points.
    """
    require_keys(profile, axes, option="vary", circle_option=None if with_circle else "circle")
    samples = {key: _samples(axis) for key, axis in axes.items()}
    first: dict[str, object] = {key: values[0] for key, values in samples.items()}
    override(profile, first)
    for key, values in samples.items():
        for value in values[1:]:
            override(profile, {**first, key: value})
    # Constraints between keys show at the extremes.
    for end in (_least, _greatest):
        override(profile, {key: end(values) for key, values in samples.items()})
    grid = Grid(dict(axes))
    if grid.points > MOST_POINTS:
        raise BusplanError(f"vary: {grid.points:,} points are more than the {MOST_POINTS:,} a sweep takes; vary less")
    return grid


def require_keys(profile: Profile, keys: Iterable[str], *, option: str, circle_option: str | None) -> None:
    """Refuse keys that cannot vary, whatever their values.

    Parameters
    ----------
    profile
        The network.
    keys
        Dotted keys.
    option
        Option that gives them, for messages.
    circle_option
        Option that requests circle tests, for messages; None where they are run.

    Raises
    ------
    BusplanError
        A key that is unknown, not a number, or without effect here.
    """
    read = cycle_keys(profile)
    for key in keys:
        of_groups = [f"group.{group.name}.{key.partition('.')[2]}" for group in profile.group]
        if key not in read and set(of_groups) <= {*read} and of_groups:
            raise BusplanError(
                f"{option} {key}: each group of {profile.name} has its own; give {listed(of_groups, 'or')}"
            )
        _require_known(profile, key, name=f"{option} {key}")
        _require_read(profile, key, name=f"{option} {key}", circle_option=circle_option)


def grid_models(network: Network, grid: Grid, asked: Sequence[str] | None) -> tuple[str, ...]:
    """Timing models of a sweep: those that can express every value of the grid.

    Parameters
    ----------
    network
        The network.
    grid
        Values of its keys.
    asked
        Names of timing models; by default all that can.

    Raises
    ------
    BusplanError
        A model that was asked for cannot express a value.
    """
    variants = [changed(network, {key: value}) for key, axis in grid.axes.items() for value in _samples(axis)]
    if asked is not None:
        for model in asked:
            for variant in variants:
                known_model(variant, model, name="timing_model")
        return tuple(asked)
    return tuple(model for model in model_names(network) if all(model in model_names(variant) for variant in variants))


def _require_known(profile: Profile, key: str, *, name: str) -> None:
    """Refuse a key that does not exist, or that is a section or a list."""
    *tables, last = key.split(".")
    table: Any = profile.model_dump()
    for part in tables:
        named = named_tables(table)
        table = named.get(part) if named else table.get(part) if isinstance(table, dict) else None
    if not isinstance(table, dict) or last not in table:
        section = ".".join(tables)
        siblings = list(table) if isinstance(table, dict) and tables else []
        close = [f"{section}.{sibling}" for sibling in get_close_matches(last, siblings, n=1, cutoff=0.7)]
        read = cycle_keys(profile)
        close = close or get_close_matches(key, read, n=1, cutoff=0.8) * (not siblings)
        known = f"known in {section} are {', '.join(siblings)}" if siblings else f"try {', '.join(read)}"
        hint = f"did you mean {close[0]}?" if close else known
        raise BusplanError(f"{name}: no such key of this profile; {hint}")
    if isinstance(table[last], dict | list | tuple):
        what = "section" if isinstance(table[last], dict) else "list"
        raise BusplanError(f"{name}: is a {what}; expected the key of one number")


def _require_read(profile: Profile, key: str, *, name: str, circle_option: str | None) -> None:
    """Refuse a key that no computed figure depends on; without `circle_option`, circle tests are computed."""
    if key in cycle_keys(profile):
        return
    section = key.partition(".")[0]
    if section not in CIRCLE_SECTIONS:
        raise BusplanError(f"{name}: no figure of capacity depends on it")
    if circle_option is not None:
        raise BusplanError(f"{name}: no figure of capacity depends on it; add {circle_option} to run circle tests")


def _samples(axis: Array) -> list[Value]:
    """Values to check: all, or of many the extremes, the words and one fraction. Whole floats become ints."""
    values: list[Value] = axis.tolist()
    if len(values) > _CHECKED_EACH:
        numbers = [value for value in values if not isinstance(value, str | bool)]
        # A fraction among whole numbers may lie between the extremes.
        fractions = (value for value in numbers if value % 1)
        words = (value for value in values if isinstance(value, str | bool))
        values = [values[0], min(numbers), max(numbers), *islice(fractions, 1), *words]
    return [*dict.fromkeys(map(whole, values))]


def _least(values: list[Value]) -> Value:
    return min((value for value in values if not isinstance(value, str | bool)), default=values[0])


def _greatest(values: list[Value]) -> Value:
    words = [value for value in values if isinstance(value, str | bool)]
    return words[0] if words else max(values)
