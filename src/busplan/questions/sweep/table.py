"""A sweep, checked, and its table part by part: the figures of `capacity` for many profiles at once.

The functions of `capacity` accept arrays, so a profile whose keys hold arrays gives arrays. The values of each key lie
along an axis of their own, so that a figure is computed, and written, only over the keys that it depends on. Figures in
words are added here.
"""

import gc
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, partial, reduce
from itertools import chain, product
from math import prod
from typing import Final, NamedTuple

import numpy as np

from busplan.buses.figure import FITS, TIMING_MODEL, BusFigures, Figure, Sort, by_key
from busplan.buses.limits import NOT_SHOWN_KEPT
from busplan.buses.network import Network
from busplan.buses.parts import Safety
from busplan.elementwise import Number
from busplan.errors import ArgumentError, BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.progress import Progress, ignored
from busplan.questions.circle import CIRCLE_FIGURES
from busplan.questions.fit.certainty import VERDICTS, verdict_code
from busplan.questions.fit.figures import COUNTS, TYPES, fit_numbers
from busplan.questions.fit.grid import Array, Grid, require_few_tables, tables_in
from busplan.questions.fit.most_nodes import MostNodes, most_and_safe_nodes
from busplan.questions.fit.network import network_of
from busplan.questions.sweep.circles import CIRCLE_COLUMNS, require_few
from busplan.questions.sweep.values import axis_values, checked_grid, grid_models
from busplan.sections.base import with_all_unchecked
from busplan.sections.profile import Profile, varied_nodes

_PART_POINTS: Final = 1 << 14
"""Most points computed at once: their arrays fit into the processor's cache."""
_PART_CELLS: Final = 8_000_000
"""Most cells computed at once, of eight bytes each."""
_TABLE_CELLS: Final = 20
"""Numbers of each group or message at a point while its figures are computed, about."""
MOST_CELLS: Final = 200_000_000
"""Most cells of the table: a million points of one kind of nodes, fewer of many groups. As text it has gigabytes."""
_MOST_TABLES: Final = 20_000_000
"""Most groups and messages of all points together: minutes of work."""
MOST_GROUPS: Final = 128
"""Most groups, enough for each node of CANopen: the most nodes of each are searched, and each search counts all."""

Columns = dict[str, Array]
"""Columns by name.

Numbers (NaN where there is none), truth values, or objects: words, tuples of words, and None where there is none.
"""


class Chunk(NamedTuple):
    """A contiguous part of a grid."""

    shape: tuple[int, ...]
    """Points along each axis of the grid."""
    values: dict[str, Array]
    """Values of each key, shaped to broadcast along its own axis."""


def chunks(grid: Grid, most: int) -> Iterator[Chunk]:
    """Chunks of a grid in row-major order, of at most `most` points."""
    for places in cuts(grid.shape, most):
        values = [axis[place] for axis, place in zip(grid.axes.values(), places, strict=True)]
        yield Chunk(tuple(map(len, values)), dict(zip(grid.axes, np.ix_(*values), strict=True)))


def cuts(shape: tuple[int, ...], most: int) -> Iterator[tuple[slice, ...]]:
    """Slices that cut an array of a shape into parts of at most `most` elements, in row-major order."""
    # The axis to cut: a part has all values of the axes after it and one value of each axis before it.
    cut = next(number for number in range(len(shape) + 1) if prod(shape[number + 1 :]) <= most)
    width = max(1, most // prod(shape[cut + 1 :]))
    places = [
        *([slice(index, index + 1) for index in range(size)] for size in shape[:cut]),
        *([slice(begin, min(begin + width, size)) for begin in range(0, size, width)] for size in shape[cut : cut + 1]),
        *([slice(0, size)] for size in shape[cut + 1 :]),
    ]
    return product(*places)


class Part(NamedTuple):
    """The table of a contiguous part of the grid."""

    shape: tuple[int, ...]
    """Points along each axis of the grid."""
    by_model: tuple[Columns, ...]
    """Columns under each timing model, which broadcast to the shape."""

    @property
    def points(self) -> int:
        """Number of points."""
        return prod(self.shape)

    def cut(self, most: int) -> "Iterator[Part]":
        """Smaller parts, of at most `most` points, or of one."""
        for places in cuts(self.shape, max(1, most)):

            def at(values: Array, places: Sequence[slice] = places) -> Array:
                # What does not depend on a key has one value along its axis.
                return values[
                    tuple(place if size > 1 else slice(1) for place, size in zip(places, values.shape, strict=True))
                ]

            shape = tuple(place.stop - place.start for place in places)
            yield Part(
                shape, tuple({name: at(column) for name, column in columns.items()} for columns in self.by_model)
            )

    def count(self, flags: Array) -> int:
        """Number of points with a flag."""
        return int(np.count_nonzero(np.broadcast_to(flags, self.shape)))

    def column(self, name: str, write: Callable[[Array], Array] = np.asarray) -> Array:
        """A column, a row for each point and timing model, of shape (rows,); `write` changes its different values."""
        by_model = [np.broadcast_to(write(columns[name]), self.shape).ravel() for columns in self.by_model]
        return np.stack(by_model, axis=1).ravel()


class Sweep(NamedTuple):
    """A sweep to compute: a row for each point of a grid and each timing model."""

    profile: Profile
    """The network, with its changes."""
    bus_figures: BusFigures
    """Figures of the kind of bus."""
    safety: Safety
    """Setting of the bus that is safe or not."""
    deciding_model: str
    """The timing model that gives the verdict."""
    grid: Grid
    """Points of the rows."""
    timing_models: tuple[str, ...]
    group: str
    """Group whose nodes vary for the most nodes and axes of the whole; empty where all nodes are alike."""
    circle: bool = False
    """If True, the circle test of each point is run."""
    changes: KeyChanges = NO_CHANGES

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns: the varied keys, the figures of `capacity`, and those of circle tests."""
        return (
            *self.grid.axes,
            *figure_names(self.profile, self.bus_figures),
            *(CIRCLE_COLUMNS if self.circle else ()),
        )

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.grid.points * len(self.timing_models)

    @property
    def point_cells(self) -> int:
        """Cells of a point."""
        return len(self.columns) * len(self.timing_models)


def checked_sweep(
    network: Network,
    vary: Mapping[str, str | Iterable[object]],
    *,
    timing_models: Sequence[str] | None,
    circle: bool,
    unlimited: bool,
    changes: KeyChanges = NO_CHANGES,
) -> Sweep:
    """A sweep whose options are checked.

    BusplanError: as `axis_values`, `checked_grid`, `grid_models` and `require_few`.
    """
    profile, bus = network.profile, network.bus
    axes = {key: axis_values(profile, key, given, name="vary") for key, given in vary.items()}
    grid = checked_grid(profile, axes, with_circle=circle)
    models = grid_models(network, grid, timing_models)
    varied = varied_nodes(profile).name if profile.group else ""
    if circle:
        require_few(grid, unlimited=unlimited)
    sweep = Sweep(profile, bus.figures, bus.safety, bus.deciding_model, grid, models, varied, circle, changes)
    _require_few_cells(sweep)
    require_few_tables(network, settings=grid.points, most=_MOST_TABLES)
    return sweep


def _require_few_cells(sweep: Sweep) -> None:
    """Refuse a sweep that takes too long or too much memory because of its groups."""
    groups, columns = len(sweep.profile.group), len(sweep.columns)
    if groups > MOST_GROUPS:
        raise BusplanError(
            f"{sweep.profile.name}: {groups:,} groups are more than the {MOST_GROUPS:,} a sweep takes; join like groups"
        )
    most = MOST_CELLS // sweep.point_cells
    if sweep.grid.points > most:
        raise ArgumentError(
            f"vary: {sweep.grid.points:,} points of {columns:,} columns are too many for a sweep; vary "
            f"less: {most:,} points"
        )


def figure_names(profile: Profile, register: BusFigures) -> tuple[str, ...]:
    """Columns of a sweep after the varied keys; `timing_model` is the first, counts of groups are the last."""
    groups = (f"group.{group.name}.{key}" for group in profile.group for key in COUNTS)
    return (*(figure.key for figure in register.capacity), *groups)


def column_figures(sweep: Sweep) -> dict[str, Figure]:
    """Registered figures of a sweep's columns; a group's figure has the name of the group."""
    figures = by_key((*CIRCLE_FIGURES, *sweep.bus_figures.capacity))
    groups = {
        f"group.{group.name}.{key}": figures[key]._replace(label=f"{figures[key].label} of {group.name}")
        for group in sweep.profile.group
        for key in COUNTS
    }
    return {**figures, **groups}


def parts_of(sweep: Sweep, *, progress: Progress = ignored) -> Iterator[Part]:
    """All figures of `capacity` over the grid of a sweep, part by part in its order.

    References
    ----------
    Paper, equations (1)-(11).
    """
    grid, profile = sweep.grid, sweep.profile
    done = 0
    point_cells = max(sweep.point_cells, _TABLE_CELLS * tables_in(profile))
    for chunk in chunks(grid, max(1, min(_PART_POINTS, _PART_CELLS // point_cells))):
        by_model = (_figures(profile, chunk.values, model, group=sweep.group) for model in sweep.timing_models)
        part = Part(chunk.shape, tuple({**chunk.values, **figures} for figures in by_model))
        yield part
        done += part.points
        progress(done, grid.points)
        # The events of a cycle refer to it, and Python counts objects, not the size of the arrays that they hold.
        gc.collect()


def _figures(profile: Profile, values: Mapping[str, Array], model: str, *, group: str) -> dict[str, Array]:
    """All figures of a chunk under one timing model; they broadcast to its shape."""
    for place, (key, axis) in enumerate(values.items()):
        if axis.dtype == object and axis.size > 1:
            # Words among numbers: compute each word by itself, and join the results along the axis.
            alike = _numbers_and_words(axis.ravel().tolist())
            parts = [
                _figures(profile, {**values, key: _taken(axis, indices, place)}, model, group=group)
                for indices in alike
            ]
            return {name: _joined([part[name] for part in parts], alike, axis=place) for name in parts[0]}
    at_points = {key: axis.item() if axis.size == 1 else axis.astype(float) for key, axis in values.items()}
    figures = _columns(network_of(with_all_unchecked(profile, at_points)), model, group=group)
    one = (1,) * len(values)
    return {name: column.reshape(one) if column.size == 1 else column for name, column in figures.items()}


def _numbers_and_words(values: Sequence[object]) -> list[list[int]]:
    """Places of the numbers, together, and of each word."""
    is_word = [isinstance(value, str | bool) for value in values]
    numbers = [place for place, word in enumerate(is_word) if not word]
    return [*([numbers] if numbers else []), *([place] for place, word in enumerate(is_word) if word)]


def _taken(axis: Array, indices: list[int], place: int) -> Array:
    taken: Array = np.take(axis, indices, axis=place)
    return taken.astype(float) if len(indices) > 1 else taken


def _joined(parts: Sequence[Array], places: Sequence[list[int]], *, axis: int) -> Array:
    """One array of parts, each with its places along an axis."""
    rest = np.broadcast_shapes(*(part.take([0], axis).shape for part in parts))
    shapes = ((*rest[:axis], len(own), *rest[axis + 1 :]) for own in places)
    joined = np.concatenate([np.broadcast_to(part, shape) for part, shape in zip(parts, shapes, strict=True)], axis)
    return joined.take(np.argsort([*chain(*places)]), axis)


def _columns(network: Network, model: str, *, group: str) -> dict[str, Array]:
    """All figures of a network whose keys hold arrays."""
    fit = fit_numbers(network, model=model)
    numbers = {**fit.numbers, **fit.own, FITS.key: np.logical_not(reduce(np.logical_or, fit.broken.values()))}
    words = {
        TIMING_MODEL.key: _objects([model]),
        "binding_term": _chosen([term.name for term in fit.terms], _largest([term.us for term in fit.terms]))
        if fit.terms
        else _objects([None]),
        "exceeded": _sets(fit.broken),
        "not_shown": _sets({key: np.equal(code, NOT_SHOWN_KEPT) for key, code in fit.codes.items()})
        if fit.decides
        else _objects([None]),
        "verdict": _chosen(VERDICTS, np.asarray(verdict_code(fit.codes), int)) if fit.decides else _objects([None]),
        **_counts(network, model=model, group=group),
    }
    bus = network.bus
    sorts = {figure.key: figure.sort for figure in bus.figures.capacity}
    return {
        key: words[key] if key in words else _number(numbers.get(key), sorts[key])
        for key in figure_names(network.profile, bus.figures)
    }


def _objects(words: Sequence[object]) -> Array:
    return np.fromiter(words, dtype=object, count=len(words))


def _chosen(words: Sequence[object], codes: Array) -> Array:
    """Words by their place."""
    chosen: Array = _objects(words)[np.atleast_1d(codes)]
    return chosen


_NO_NUMBER: Final = np.full((), np.nan)


def _number(number: Number | None, sort: Sort) -> Array:
    """Array of the type that the sort of a figure has; NaN for what does not exist."""
    if number is None:
        return _NO_NUMBER
    array: Array = np.asarray(number, dtype=TYPES[sort])
    return np.where(np.isinf(array), np.nan, array) if sort == "number" else array


def _counts(network: Network, *, model: str, group: str) -> dict[str, Array]:
    """Nodes that fit: of each group, and of the whole where one group varies and the others are as they are."""
    if not network.groups:
        return {
            **dict.fromkeys(COUNTS, _NO_NUMBER),
            "limited_by": _objects([None]),
            "safe_limited_by": _objects([None]),
        }
    counts = {name: _counts_of(network, name, model=model) for name in network.names}
    whole = counts[group]
    if network.is_uniform:
        return whole
    varied = network.group_named(group)
    beside = {"nodes": network.nodes - varied.nodes, "axes": network.axes - varied.nodes * varied.node.axes}
    # Where not even one of its nodes fits, there is no number of the whole.
    more = {
        f"{most}_{what}": np.where(
            whole[f"{most}_nodes"] > 0, whole[f"{most}_{what}"] + number, whole[f"{most}_{what}"]
        )
        for most in ("max", "safe")
        for what, number in beside.items()
    }
    of_groups = {f"group.{name}.{key}": column for name in counts for key, column in counts[name].items()}
    return {**whole, **{key: column.astype(whole[key].dtype) for key, column in more.items()}, **of_groups}


def _counts_of(network: Network, group: str, *, model: str) -> dict[str, Array]:
    most, safe = most_and_safe_nodes(partial(network.with_nodes, group=group), network, model=model)
    axes = network.group_named(group).node.axes
    return {
        "max_nodes": _number(most.nodes, "count"),
        "max_axes": _number(axes * most.nodes, "count"),
        "limited_by": _limit_keys(most),
        "safe_nodes": _number(safe.nodes, "count") if safe else _NO_NUMBER,
        "safe_axes": _number(axes * safe.nodes, "count") if safe else _NO_NUMBER,
        "safe_limited_by": _limit_keys(safe) if safe else _objects([None]),
    }


def _limit_keys(most: MostNodes) -> Array:
    return _chosen([limit.key for limit in most.limits], np.asarray(most.limit, int))


def _sets(flags: Mapping[str, Number]) -> Array:
    """The keys that are flagged, as a tuple at each point."""
    codes: Array = np.asarray(sum(np.asarray(flag, int) << bit for bit, flag in enumerate(flags.values())))
    words: Array = _combinations(tuple(flags))[np.atleast_1d(codes)]
    return words


@cache
def _combinations(keys: tuple[str, ...]) -> Array:
    """Every set of keys, by the number whose bits are its members."""
    return _objects(
        tuple(tuple(key for bit, key in enumerate(keys) if code >> bit & 1) for code in range(1 << len(keys)))
    )


def _largest(terms: list[Number]) -> Array:
    """Index of the largest term; the first one among equals."""
    best, *rest = map(np.asarray, terms)
    place = np.zeros((), int)
    for index, term in enumerate(rest, start=1):
        place = np.where(np.greater(term, best), index, place)
        best = np.maximum(term, best)
    return place
