"""A full grid of profile values in row-major order, in chunks: no axis is in memory as a whole."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from math import prod
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from busplan.buses.parts import Value
from busplan.errors import BusplanError
from busplan.profile.keys import named_tables
from busplan.profile.kinds import cycle_keys
from busplan.profile.toml import override
from busplan.profile.write import whole
from busplan.questions.base.inputs import known_model
from busplan.questions.fit.network import model_names
from busplan.sections.profile import CIRCLE_SECTIONS, Profile

Array = NDArray[Any]
"""Numbers, truth values, or objects if there are words among them."""

_CHECKED_EACH: Final = 100
"""Up to this many values of a key are all checked; of more, the extremes: every valid range is an interval."""
_POINTS_AT_ONCE: Final = 4096
MAX_POINTS: Final = 10**12
"""A larger grid would take weeks, so it is probably a typing error."""


class Listed(NamedTuple):
    """Single values: numbers, and words that the profile allows."""

    values: tuple[Value, ...]

    @property
    def size(self) -> int:
        """How many values."""
        return len(self.values)

    def part(self, start: int, stop: int) -> Array:
        """Values from index `start` to before `stop`."""
        # All parts of the axis have one type.
        common = (
            object if self.has_words else float if any(isinstance(value, float) for value in self.values) else np.int64
        )
        return np.array(self.values[start:stop], dtype=common)

    @property
    def has_words(self) -> bool:
        """Whether a value is a word."""
        return any(isinstance(value, str | bool) for value in self.values)


class Steps(NamedTuple):
    """Evenly spaced values (first + i step) / scale; exact decimals, because all three are whole numbers."""

    first: int
    step: int
    scale: int
    size: int
    has_words: bool = False

    def part(self, start: int, stop: int) -> Array:
        """Values from index `start` to before `stop`."""
        whole = self.first + self.step * np.arange(start, stop, dtype=np.int64)
        return whole if self.scale == 1 else whole / self.scale


class Even(NamedTuple):
    """A number of evenly spaced values, both ends included."""

    first: float
    last: float
    size: int
    has_words: bool = False

    def part(self, start: int, stop: int) -> Array:
        """Values from index `start` to before `stop`."""
        share = np.arange(start, stop) / (self.size - 1)
        return self.first * (1 - share) + self.last * share


Values = Listed | Steps | Even


class Chunk(NamedTuple):
    """A contiguous part of a grid."""

    start: int
    """Index of its first point."""
    shape: tuple[int, ...]
    """Points along each axis of the grid."""
    values: dict[str, Array]
    """Values of each key, shaped to broadcast along its own axis."""

    @property
    def points(self) -> int:
        """How many points."""
        return prod(self.shape)

    def point(self, index: int) -> dict[str, object]:
        """Values of one of its points by key."""
        where = np.unravel_index(index, self.shape)
        return {
            key: np.broadcast_to(values, self.shape)[where].item()
            if values.dtype != object
            else np.broadcast_to(values, self.shape)[where]
            for key, values in self.values.items()
        }


class Grid(NamedTuple):
    """Every combination of the values of some keys; the last key changes fastest."""

    axes: dict[str, Values]

    @property
    def points(self) -> int:
        """How many points."""
        return prod(axis.size for axis in self.axes.values())

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
        sizes = [axis.size for axis in self.axes.values()]
        if not sizes:
            yield self._chunk(0, [])
            return
        # Find the axis to cut: a chunk has all values of the axes after it and one value of each axis before it.
        cut, behind = len(sizes) - 1, 1
        while cut and behind * sizes[cut] <= most:
            behind *= sizes[cut]
            cut -= 1
        width = max(1, most // behind)
        start = 0
        for before in range(prod(sizes[:cut])):
            fixed = [int(index) for index in np.unravel_index(before, sizes[:cut])] if cut else []
            for begin in range(0, sizes[cut], width):
                end = min(begin + width, sizes[cut])
                parts = [(index, index + 1) for index in fixed] + [(begin, end)]
                parts += [(0, size) for size in sizes[cut + 1 :]]
                chunk = self._chunk(start, parts)
                yield chunk
                start += chunk.points

    def each_point(self) -> Iterator[dict[str, object]]:
        """Values of the keys of each point."""
        # Some at a time: an axis that is a list is looked through for each chunk.
        return (chunk.point(index) for chunk in self.chunks(_POINTS_AT_ONCE) for index in range(chunk.points))

    def _chunk(self, start: int, parts: list[tuple[int, int]]) -> Chunk:
        shape = tuple(stop - first for first, stop in parts)
        values = {}
        for number, (key, axis) in enumerate(self.axes.items()):
            own = [1] * len(shape)
            own[number] = shape[number]
            values[key] = axis.part(*parts[number]).reshape(own)
        return Chunk(start, shape, values)


def checked_grid(
    profile: Profile,
    axes: Mapping[str, Values],
    *,
    with_circle: bool,
    option: str = "--vary",
    circle_option: str = "--circle",
) -> Grid:
    """Make a grid after validating its values.

    Parameters
    ----------
    profile
        The network.
    axes
        Values by dotted key.
    with_circle
        If False, keys that only the circle test reads are refused.
    option, circle_option
        Names in messages of the values, and of the option that requests circle tests.

    Raises
    ------
    BusplanError
        A key that is unknown, not a number, or without effect here; a value that the profile's schema refuses.
    """
    require_keys(profile, axes, option=option, circle_option=None if with_circle else circle_option)
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
    if grid.points > MAX_POINTS:
        raise BusplanError(
            f"{option}: {grid.points:,} points are more than the {MAX_POINTS:,} a sweep takes; vary less"
        )
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
    for key in keys:
        _require_known(profile, key, name=f"{option} {key}")
        _require_read(profile, key, name=f"{option} {key}", circle_option=circle_option)


def grid_models(profile: Profile, grid: Grid, asked: Sequence[str] | None, *, name: str) -> tuple[str, ...]:
    """Timing models of a sweep: those that can express every value of the grid.

    Parameters
    ----------
    profile
        The network.
    grid
        Values of its keys.
    asked
        Names of timing models; by default all that can.
    name
        Name of the timing models in messages.

    Raises
    ------
    BusplanError
        A model that was asked for cannot express a value.
    """
    variants = [override(profile, {key: value}) for key, axis in grid.axes.items() for value in _samples(axis)]
    if asked is not None:
        for model in asked:
            for variant in variants:
                known_model(variant, model, name=name)
        return tuple(asked)
    return tuple(model for model in model_names(profile) if all(model in model_names(variant) for variant in variants))


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


def _samples(axis: Values) -> list[Value]:
    """Values to check: all, or of many the extremes, the words and one fraction. Whole floats become ints."""
    if isinstance(axis, Listed):
        if axis.size <= _CHECKED_EACH:
            return list(dict.fromkeys(axis.values))
        numbers = [value for value in axis.values if not isinstance(value, str | bool)]
        # A fraction among whole numbers may lie between the extremes.
        fractions = [value for value in numbers if isinstance(value, float)][:1]
        words = set(axis.values) - set(numbers)
        return [*dict.fromkeys((axis.values[0], min(numbers), max(numbers), *fractions, *words))]
    # In equal steps from a whole number, the second value is a fraction if any is.
    chosen = range(axis.size) if axis.size <= _CHECKED_EACH else (0, 1, axis.size - 1)
    values = (axis.part(index, index + 1).item() for index in chosen)
    return list(map(whole, values))


def _least(values: list[Value]) -> Value:
    return min((value for value in values if not isinstance(value, str | bool)), default=values[0])


def _greatest(values: list[Value]) -> Value:
    words = [value for value in values if isinstance(value, str | bool)]
    return words[0] if words else max(values)
