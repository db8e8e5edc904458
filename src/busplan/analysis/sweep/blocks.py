"""Capacity over a grid: the figures of `capacity` for many profiles at once, through the same functions.

Those functions are operators only, so a profile whose keys hold arrays gives arrays. Each key's values lie along an
axis of their own; what a figure does not depend on costs it nothing. Only what is no operator stands here: the whole
number of nodes, the words, and a table's interpolation.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple, get_type_hints

import numpy as np

from busplan.analysis.capacity.cycle import TERM_KEYS, Limit, Term, available_us, cycle, fits_in, limits_broken
from busplan.analysis.capacity.figures import CapacityFigures, numeric_figures
from busplan.analysis.capacity.node_limit import most_nodes, required_by_nodes
from busplan.analysis.sweep.grid import Array, Chunk, Grid
from busplan.buses.ieee1394.constants import MAX_HOPS
from busplan.buses.ieee1394.timing import TimingModelName
from busplan.profile.bus import TableExecution
from busplan.profile.model import Profile
from busplan.sections.base import with_unchecked

CHUNK_POINTS: Final = 1 << 14
"""Points computed at once: their arrays stay in the processor's cache."""

FIGURES: Final = CapacityFigures._fields
"""Columns of a sweep behind the varied keys; `timing_model` is the first."""
WORD_FIGURES: Final = ("timing_model", "binding_term", "limited_by", "exceeded")
"""Those in words."""
_TYPES: Final = get_type_hints(CapacityFigures)
_TERMS: Final[tuple[Term, ...]] = tuple(TERM_KEYS)
_LIMITS: Final[tuple[Limit, ...]] = ("payload", "nodes", "hops", "time")
"""In the order of `CapacityFigures.exceeded`."""
_EXCEEDED: Final = tuple(
    [limit for bit, limit in enumerate(_LIMITS) if code >> bit & 1] for code in range(1 << len(_LIMITS))
)
_DOUBT: Final = 1e-9
"""Share of the time by which a cycle must miss its slice for the root alone to tell: far above any rounding."""


class Column(NamedTuple):
    """One figure over a chunk."""

    values: Array
    """Numbers, truths, or the places of its words; broadcasts to the chunk's shape. NaN is what does not exist."""
    words: tuple[Any, ...] | None = None


class Block(NamedTuple):
    """The figures of a chunk."""

    chunk: Chunk
    varied: dict[str, Column]
    """Values of the varied keys."""
    models: tuple[dict[str, Column], ...]
    """Figures by name, a set for each timing model."""

    def columns(self, name: str) -> list[Column]:
        """One column under each timing model."""
        return [(self.varied if name in self.varied else figures)[name] for figures in self.models]

    def row(self, index: int, names: Sequence[str]) -> dict[str, Any]:
        """One row: a point under one timing model, by its place among `rows`."""
        point, model = divmod(index, len(self.models))
        where = np.unravel_index(point, self.chunk.shape)
        return {name: self._value(self.columns(name)[model], where) for name in names}

    def _value(self, column: Column, where: tuple[Any, ...]) -> Any:
        found = np.broadcast_to(column.values, self.chunk.shape)[where].item()
        return found if column.words is None else column.words[found]

    def rows(self, name: str) -> Array:
        """One column as plain values: a point after the other, a timing model after the other within each."""
        parts = [np.broadcast_to(one.values, self.chunk.shape).ravel() for one in self.columns(name)]
        return np.stack(parts, axis=1).ravel()


def sweep(
    profile: Profile,
    grid: Grid,
    *,
    timing_models: Sequence[TimingModelName],
    chunk_points: int = CHUNK_POINTS,
) -> Iterator[Block]:
    """Compute all figures of `capacity` over a grid.

    Parameters
    ----------
    profile
        The network.
    grid
        Values of its keys, of `checked_grid`.
    timing_models
        Which timing models, in this order.
    chunk_points
        Largest number of points computed at once.

    Yields
    ------
    Block
        One chunk after the other: memory stays flat however large the grid is.

    References
    ----------
    Paper, equations (1)-(11).
    """
    for chunk in grid.chunks(chunk_points):
        yield Block(
            chunk,
            {key: _varied(values) for key, values in chunk.values.items()},
            tuple(_figures(profile, chunk.values, model) for model in timing_models),
        )


def _varied(values: Array) -> Column:
    if values.dtype != object:
        return Column(values)
    return Column(np.arange(values.size, dtype=np.uint8).reshape(values.shape), tuple(values.ravel()))


def _figures(profile: Profile, values: Mapping[str, Array], model: TimingModelName) -> dict[str, Column]:
    """All figures of a chunk under one timing model."""
    for number, (key, own) in enumerate(values.items()):
        if own.dtype == object and own.size > 1:
            # A rule among numbers: each value by itself, put together along its axis.
            parts = [
                _figures(profile, {**values, key: np.take(own, [index], axis=number)}, model)
                for index in range(own.size)
            ]
            return {name: _joined([part[name] for part in parts], axis=number) for name in FIGURES}
    where = _at(profile, values)
    return _columns(where, values, model)


def _joined(parts: list[Column], *, axis: int) -> Column:
    shape = np.broadcast_shapes(*(part.values.shape for part in parts))
    return Column(np.concatenate([np.broadcast_to(part.values, shape) for part in parts], axis=axis), parts[0].words)


def _at(profile: Profile, values: Mapping[str, Array]) -> Profile:
    """A profile whose keys hold arrays: never checked, for functions of operators only."""
    for key, own in values.items():
        profile = with_unchecked(profile, key, own.item() if own.size == 1 else own.astype(float))
    execution = profile.node.execution
    if isinstance(execution, TableExecution):
        profile = with_unchecked(profile, "node.execution", _TableOfArrays(execution))
    return profile


class _TableOfArrays:
    """An execution table that takes arrays of payloads, all of them inside it."""

    def __init__(self, table: TableExecution) -> None:
        self._table = table
        self._payload_bytes = np.array(table.payload_bytes, dtype=float)
        self._time_us = np.array(table.time_us, dtype=float)

    def execution_us(self, payload_bytes: Any) -> Any:
        """Execution time T_exec with that payload, as `TableExecution.execution_us` gives it [us]."""
        if np.ndim(payload_bytes) == 0:
            return self._table.execution_us(payload_bytes)
        index = np.searchsorted(self._payload_bytes, payload_bytes)
        left = np.maximum(index - 1, 0)
        x0, y0 = self._payload_bytes[left], self._time_us[left]
        x1, y1 = self._payload_bytes[index], self._time_us[index]
        return np.where(x1 == payload_bytes, y1, y0 + (y1 - y0) * (payload_bytes - x0) / np.where(x1 > x0, x1 - x0, 1))


def _columns(where: Profile, values: Mapping[str, Array], model: TimingModelName) -> dict[str, Column]:
    now = cycle(where, model=model, nodes=where.bus.nodes)
    numbers = numeric_figures(where, now)
    max_nodes, limited_by = _largest_nodes(where, values, model)
    late = np.logical_not(fits_in(numbers["required_us"], available_us=numbers["available_us"]))
    terms_us = [numbers[key] for key in TERM_KEYS.values()]
    broken = limits_broken(where)
    flags = [*(broken[limit] for limit in _LIMITS[:-1]), late]
    exceeded: Any = sum(flag * np.uint8(1 << bit) for bit, flag in enumerate(flags))
    numbers |= {"max_nodes": max_nodes, "max_axes": where.node.axes * max_nodes, "fits": np.equal(exceeded, 0)}
    words = {
        "timing_model": Column(np.zeros((), np.uint8), (model,)),
        "binding_term": Column(_largest(terms_us), _TERMS),
        "limited_by": Column(limited_by, _LIMITS),
        "exceeded": Column(exceeded, _EXCEEDED),
    }
    columns = {**words, **{name: Column(_typed(name, number)) for name, number in numbers.items()}}
    axes = len(values)
    return {name: columns[name]._replace(values=_with_axes(columns[name].values, axes)) for name in FIGURES}


def _typed(name: str, number: Any) -> Array:
    """Counts as whole numbers and all else as `capacity` has it, whatever it was computed in."""
    return np.asarray(number, dtype=_TYPES[name])


def _with_axes(values: Any, axes: int) -> Array:
    found = np.asarray(values)
    return found.reshape((1,) * axes) if found.ndim == 0 else found


def _largest(terms: list[Any]) -> Any:
    """Place of the largest of some terms, the first of equals."""
    best: Any = terms[0]
    place: Any = np.uint8(0)
    for index, term in enumerate(terms[1:], start=1):
        place = np.where(np.greater(term, best), np.uint8(index), place)
        best = np.maximum(term, best)
    return place


def _largest_nodes(where: Profile, values: Mapping[str, Array], model: TimingModelName) -> tuple[Any, Any]:
    """`largest_nodes` for arrays: the number, and the place of its limit."""
    bus = where.bus
    most, structural = most_nodes(bus)
    given_us = available_us(where)

    def fits(profile: Profile, nodes: Any, given_us: Any) -> Any:
        return fits_in(cycle(profile, model=model, nodes=nodes).required_us, available_us=given_us)

    if bus.max_hops is None and isinstance(bus.gap_count, str):
        # Required time grows with each node: those that fit are the first ones.
        answer: Any = sum(np.asarray(fits(where, nodes, given_us)).astype(np.int64) for nodes in range(1, most + 1))
    else:
        required = required_by_nodes(where, model=model)
        root = np.asarray(required.nodes(given_us))
        near = np.rint(root)
        off = np.abs(root - near)
        answer = np.minimum(np.floor(root), most)
        # First by one bound for all, which is one comparison each; what it leaves, by its own.
        doubt = off <= _DOUBT * np.max(given_us) / np.min(required.c1_us)
        if np.any(doubt):
            doubt = doubt & (off * required.c1_us <= _DOUBT * given_us) & (near >= 1) & (near <= most)
        if np.any(doubt):
            # So close to a whole number that rounding decides: there the cycle itself tells.
            shape = np.broadcast_shapes(doubt.shape, *(own.shape for own in values.values()))
            mask = np.broadcast_to(doubt, shape)
            arrays = {key: own for key, own in values.items() if own.size > 1}
            few = _at(where, {key: np.broadcast_to(own, shape)[mask] for key, own in arrays.items()})
            near = np.broadcast_to(near, shape)[mask]
            answer = np.broadcast_to(answer, shape).copy()
            answer[mask] = near - ~np.asarray(fits(few, near, available_us(few)))
    limit = np.where(np.equal(answer, most), np.uint8(_LIMITS.index(structural)), np.uint8(_LIMITS.index("time")))
    blocked = {"hops": bus.max_hops is not None and bus.max_hops > MAX_HOPS, "payload": limits_broken(where)["payload"]}
    for name, flag in blocked.items():
        if np.any(flag):
            answer = np.where(flag, 0, answer)
            limit = np.where(flag, np.uint8(_LIMITS.index(name)), limit)
    return answer, limit
