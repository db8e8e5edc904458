"""Capacity over a grid: the figures of `capacity` for many profiles at once, by the same functions.

Those functions accept arrays, so a profile whose keys hold arrays gives arrays. The values of each key lie along an
axis of their own, so that a figure is computed only over the keys that it depends on. Figures in words are added here.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, lru_cache, partial
from math import inf
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from busplan.buses.cycle import BusCycle
from busplan.buses.figure import CERTAINTY, CIRCLE_REFUSED_BY, FITS, Sort
from busplan.buses.network import Network
from busplan.buses.parts import BROKEN, NOT_SHOWN_KEPT, Limit, Value
from busplan.elementwise import Number
from busplan.questions.fit.certainty import (
    TIME,
    VERDICTS,
    certainty,
    fits_in,
    limit_codes,
    limits_to_be_safe,
    limits_with_time,
    time_code,
    verdict_code,
)
from busplan.questions.fit.circle_refusal import loop_refusals, run_refusals
from busplan.questions.fit.figures import COUNTS, certainty_numbers, numeric_figures
from busplan.questions.fit.loop_delays import acts_at_once, any_jitter_us
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.fit.node_limit import most_nodes
from busplan.questions.sweep.grid import Array, Chunk, Grid
from busplan.sections.base import with_unchecked
from busplan.sections.profile import CIRCLE_SECTIONS, Profile
from busplan.servo.checks import is_multiple

CHUNK_POINTS: Final = 1 << 14
"""Points computed at once: their arrays fit into the processor's cache."""
_CAUSES_KEPT: Final = 1 << 16
"""Most values of which the causes that refuse a circle are kept: about ten megabytes."""

Word: TypeAlias = str | float | list[str] | None
"""Cell of a column that is no array of numbers: a word, a value of a key that also takes words, a list, or nothing."""

_TYPES: Final[Mapping[Sort, type]] = {"number": float, "count": int, "truth": bool}


def figure_names(profile: Profile) -> tuple[str, ...]:
    """Columns of a sweep after the varied keys; `timing_model` is the first, counts of groups are the last."""
    groups = (f"group.{group.name}.{key}" for group in profile.group for key in COUNTS)
    return (*(figure.key for figure in bus_of(profile).figures.capacity), *groups)


def word_figures(profile: Profile) -> tuple[str, ...]:
    """Columns whose values are words."""
    words = [figure.key for figure in bus_of(profile).figures.capacity if figure.sort in ("word", "words")]
    return (*words, *(f"group.{group.name}.{key}" for group in profile.group for key in COUNTS if key in words))


class Column(NamedTuple):
    """One figure over a chunk."""

    values: Array
    """Numbers, truth values, or indexes into `words`; broadcasts to the chunk's shape. NaN for a missing value."""
    words: tuple[Word, ...] | None = None

    @property
    def are_true(self) -> Array:
        """Where a truth value is true; it may be missing."""
        return self.values if self.words is None else np.equal(self.values, self.words.index(True))

    @property
    def are_missing(self) -> Array:
        """Where a truth value is missing."""
        return np.equal(self.values, self.words.index(None)) if self.words else np.zeros_like(self.values)


class SweepBlock(NamedTuple):
    """The figures of a chunk."""

    chunk: Chunk
    varied: dict[str, Column]
    """Values of the varied keys."""
    models: tuple[dict[str, Column], ...]
    """Figures by name, a set for each timing model."""

    def columns(self, name: str) -> list[Column]:
        """One column under each timing model."""
        return [(self.varied if name in self.varied else figures)[name] for figures in self.models]

    def row(self, index: int, names: Sequence[str]) -> dict[str, Word]:
        """One row, by its index in `rows`: a point under one timing model."""
        point, model = divmod(index, len(self.models))
        where = np.unravel_index(point, self.chunk.shape)
        return {name: self._value(self.columns(name)[model], where) for name in names}

    def _value(self, column: Column, where: tuple[np.intp, ...]) -> Word:
        number: float = np.broadcast_to(column.values, self.chunk.shape)[where].item()
        return number if column.words is None else column.words[int(number)]

    def rows(self, name: str) -> Array:
        """One column as a flat array: point by point, and for each point timing model by timing model."""
        return self.interleaved([column.values for column in self.columns(name)])

    def interleaved(self, by_model: Sequence[Array]) -> Array:
        """Arrays that broadcast to the chunk's shape, one for each timing model, in the order of the rows."""
        return np.stack([np.broadcast_to(own, self.chunk.shape).ravel() for own in by_model], axis=1).ravel()


def sweep(
    profile: Profile,
    grid: Grid,
    *,
    timing_models: Sequence[str],
    chunk_points: int = CHUNK_POINTS,
    with_counts: bool = True,
) -> Iterator[SweepBlock]:
    """Compute all figures of `capacity` over a grid.

    Parameters
    ----------
    profile
        The network.
    grid
        Values of its keys, from `checked_grid`.
    timing_models
        Timing models, in this order.
    chunk_points
        Largest number of points computed at once.
    with_counts
        Whether blocks have the most nodes and axes, which take the cycle at other numbers of nodes.

    Yields
    ------
    SweepBlock
        One chunk at a time: memory does not grow with the grid.

    References
    ----------
    Paper, equations (1)-(11).
    """
    causes_at = lru_cache(_CAUSES_KEPT)(partial(_causes, profile))
    for chunk in grid.chunks(chunk_points):
        by_model = {model: _figures(profile, chunk.values, model, with_counts=with_counts) for model in timing_models}
        decides = bus_of(profile).deciding_model
        own = by_model[decides] if decides in by_model else _figures(profile, chunk.values, decides, with_counts=False)
        refused = {CIRCLE_REFUSED_BY.key: _refused(profile, chunk, own[FITS.key].values, causes_at)}
        yield SweepBlock(
            chunk,
            {key: _varied(values) for key, values in chunk.values.items()},
            tuple({**figures, **refused} for figures in by_model.values()),
        )


def _varied(values: Array) -> Column:
    if values.dtype != object:
        return Column(values)
    return Column(
        np.arange(values.size, dtype=np.min_scalar_type(values.size)).reshape(values.shape), tuple(values.ravel())
    )


def _figures(profile: Profile, values: Mapping[str, Array], model: str, *, with_counts: bool) -> dict[str, Column]:
    """All figures of a chunk under one timing model."""
    for number, (key, own) in enumerate(values.items()):
        if own.dtype == object and own.size > 1:
            # Words among numbers: compute each value by itself and join the results along the axis.
            parts = [
                _figures(profile, {**values, key: np.take(own, [index], axis=number)}, model, with_counts=with_counts)
                for index in range(own.size)
            ]
            return {name: _joined([part[name] for part in parts], axis=number) for name in parts[0]}
    return _columns(_at(profile, values), model, axes=len(values), with_counts=with_counts)


def _joined(parts: list[Column], *, axis: int) -> Column:
    shape = np.broadcast_shapes(*(part.values.shape for part in parts))
    return Column(np.concatenate([np.broadcast_to(part.values, shape) for part in parts], axis=axis), parts[0].words)


def _at(profile: Profile, values: Mapping[str, Array]) -> Profile:
    """Return a copy whose keys hold arrays, unvalidated."""
    for key, own in values.items():
        profile = with_unchecked(profile, key, own.item() if own.size == 1 else own.astype(float))
    return profile


def _columns(where: Profile, model: str, *, axes: int, with_counts: bool) -> dict[str, Column]:
    bus, network = bus_of(where), network_of(where)
    cycle = bus.cycle(network, model=model)
    figures = numeric_figures(cycle)
    terms = {term.key: term.us if network.groups else inf for term in cycle.terms}
    numbers = {**figures, **cycle.figures(), **terms}
    limits = limits_with_time(network, model=model)
    late = np.logical_not(np.asarray(fits_in(figures["required_us"], available_us=figures["available_us"])))
    codes = limit_codes(network)
    exceeded = _sets({**_where(codes, BROKEN), TIME: late})
    numbers |= {"fits": np.equal(exceeded.values, 0)}
    own = _certainty(cycle, codes) if model == bus.deciding_model else _UNDECIDED
    words = {
        **(_counts(network, limits, model=model) if with_counts else {}),
        "timing_model": Column(np.zeros((), np.uint8), (model,)),
        "binding_term": Column(_largest([*terms.values()]), tuple(term.name for term in cycle.terms))
        if network.groups
        else _NO_WORD,
        "exceeded": exceeded,
        **own,
    }
    sorts = {figure.key: figure.sort for figure in bus.figures.capacity}
    columns = {
        key: words[key] if key in words else _number(numbers[key], sorts[key])
        for key in figure_names(network.profile)
        if key != CIRCLE_REFUSED_BY.key and (with_counts or key.rpartition(".")[2] not in COUNTS)
    }
    return {name: column._replace(values=_with_axes(column.values, axes)) for name, column in columns.items()}


_Causes: TypeAlias = tuple[tuple[str, ...], tuple[str, ...]]
"""Keys for which a circle cannot be run, and those where its cycle fits the bus."""


def _causes(profile: Profile, changes: tuple[tuple[str, Value], ...]) -> _Causes:
    for key, value in changes:
        profile = with_unchecked(profile, key, value)
    of_loop = loop_refusals(profile) if profile.asks_for_circle else ()
    of_run = run_refusals(profile, of_loop) if profile.asks_for_circle else ()
    names = tuple(cause.name for cause in of_loop)
    return names, (*names, *(cause.name for cause in of_run))


def _refused(
    profile: Profile, chunk: Chunk, fits: Array, causes_at: Callable[[tuple[tuple[str, Value], ...]], _Causes]
) -> Column:
    """Keys for which the circle of each point cannot be run.

    They are asked point by point, but only over the keys that they rest on: the period, those of the circle, rates of
    groups, and those of the jitter; all where the bus is in the loop or in the skew. A point whose step is refused is
    asked for no move: points that differ in their steps and jitter alone are asked once.

    Parameters
    ----------
    profile
        The network.
    chunk
        The points.
    fits
        Where the cycle fits the bus: elsewhere there is no circle to be run.
    causes_at
        `_causes` of the profile, which knows what it was asked before: chunks share values.
    """
    is_apart = profile.servo.loop == "node" and acts_at_once(profile)
    is_known = is_apart and all(own.dtype != object for own in chunk.values.values())
    group = _with_axes(_without_steps(_at(profile, chunk.values)) if is_known else np.zeros((), int), len(chunk.shape))
    read = [
        (number, key, own.ravel().tolist())
        for number, (key, own) in enumerate(chunk.values.items())
        if not is_known or key.startswith(_ASKED) or key.endswith(_RATE) or group.shape[number] > 1
    ]
    shape = [1] * len(chunk.shape)
    for number, _, _ in read:
        shape[number] = chunk.shape[number]
    group = np.broadcast_to(group, shape)
    known: dict[tuple[str, ...], int] = {}
    asked: dict[tuple[object, ...], _Causes] = {}
    always, where_it_fits = np.zeros(shape, np.intp), np.zeros(shape, np.intp)
    for where in np.ndindex(*shape):
        changes = tuple((key, values[where[number]]) for number, key, values in read)
        if group[where]:
            alike = (
                group[where],
                *(change for change in changes if change[0].startswith(_DRIVES) or change[0].endswith(_RATE)),
            )
            causes = asked[alike] = asked.get(alike) or causes_at(changes)
        else:
            causes = causes_at(changes)
        always[where], where_it_fits[where] = (known.setdefault(names, len(known)) for names in causes)
    codes = always if np.array_equal(always, where_it_fits) else np.where(fits, where_it_fits, always)
    return Column(codes.astype(np.min_scalar_type(len(known))), tuple(map(list, known)))


_ASKED: Final = (*(f"{section}." for section in CIRCLE_SECTIONS), "cycle.period_us")
"""Keys that the causes rest on, whatever the bus."""
_RATE: Final = ".every"
"""End of the keys by which all axes of a group may be at a slower rate."""
_DRIVES: Final = tuple(key for key in _ASKED if key not in ("delivery.", "cycle.period_us"))


def _without_steps(at: Profile) -> Array:
    """A number above 0 where the step does not divide the period, which tells whether the delivery keeps its order.

    The loops are closed on nodes with a clock in common.
    """
    half_us, skew_us = at.cycle.period_us / 2, abs(at.delivery.skew_us)
    late = skew_us + any_jitter_us(at) > half_us
    late_alone = skew_us + at.delivery.jitter_us > half_us
    is_divided = is_multiple(at.cycle.period_us, at.servo.step_us)
    return np.where(is_divided, 0, 1 + np.asarray(late) + 2 * np.asarray(late_alone))


_NO_WORD: Final = Column(np.zeros((), np.uint8), (None,))
_NO_NUMBER: Final = Column(np.full((), np.nan))
_UNDECIDED: Final = {
    figure.key: _NO_WORD if figure.sort in ("word", "words") else _NO_NUMBER
    for figure in CERTAINTY
    if figure.key not in COUNTS
}
"""Figures that a timing model does not have."""


def _number(number: Number | None, sort: Sort) -> Column:
    return _NO_NUMBER if number is None else Column(_typed(number, sort))


def _counts(network: Network, limits: Sequence[Limit], *, model: str) -> dict[str, Column]:
    """How many nodes fit: of the whole where all are alike, otherwise of each group, the others as they are."""
    whole = {**dict.fromkeys(COUNTS, _NO_NUMBER), "limited_by": _NO_WORD, "safe_limited_by": _NO_WORD}
    if network.is_uniform:
        return _counts_of(network, limits, model=model)
    counts = ((name, _counts_of(network.asking(name), limits, model=model)) for name in network.names)
    return {**whole, **{f"group.{name}.{key}": column for name, columns in counts for key, column in columns.items()}}


def _counts_of(network: Network, limits: Sequence[Limit], *, model: str) -> dict[str, Column]:
    most, axes = most_nodes(network, limits), network.asked_nodes.node.axes
    counted = {
        "max_nodes": _number(most.nodes, "count"),
        "max_axes": _number(axes * most.nodes, "count"),
        "limited_by": Column(np.asarray(most.limit, np.uint8), tuple(limit.key for limit in limits)),
    }
    if model != network.bus.deciding_model:
        return {**counted, "safe_nodes": _NO_NUMBER, "safe_axes": _NO_NUMBER, "safe_limited_by": _NO_WORD}
    to_be_safe = limits_to_be_safe(network)
    # No more nodes are shown to fit than fit.
    safe = most_nodes(network, to_be_safe, ceiling=int(np.max(np.asarray(most.nodes))) + 1)
    return {
        **counted,
        "safe_nodes": _number(safe.nodes, "count"),
        "safe_axes": _number(axes * safe.nodes, "count"),
        "safe_limited_by": Column(np.asarray(safe.limit, np.uint8), tuple(limit.key for limit in to_be_safe)),
    }


def _certainty(cycle: BusCycle, limits: Mapping[str, Number]) -> dict[str, Column]:
    """Figures of how sure the verdict is, of a cycle under the timing model that decides."""
    sure = certainty(cycle)
    codes = {**limits, TIME: time_code(sure, cycle.network)}
    sorts = {figure.key: figure.sort for figure in CERTAINTY}
    return {
        **{key: _number(number, sorts[key]) for key, number in certainty_numbers(sure, cycle).items()},
        "not_shown": _sets(_where(codes, NOT_SHOWN_KEPT)),
        "verdict": Column(np.asarray(verdict_code(codes), np.uint8), VERDICTS),
    }


def _where(codes: Mapping[str, Number], code: int) -> dict[str, Array]:
    """Where each limit has a verdict."""
    return {key: np.equal(np.asarray(own), code) for key, own in codes.items()}


def _sets(flags: Mapping[str, Array]) -> Column:
    """The limits that are flagged, as one word for each set of them."""
    bits = np.min_scalar_type((1 << len(flags)) - 1)
    codes: Array = np.asarray(sum(flag * bits.type(1 << bit) for bit, flag in enumerate(flags.values())))
    return Column(codes, _combinations(tuple(flags)))


@cache
def _combinations(keys: tuple[str, ...]) -> tuple[list[str], ...]:
    """Every set of limits, by the number whose bits are its members."""
    return tuple([key for bit, key in enumerate(keys) if code >> bit & 1] for code in range(1 << len(keys)))


def _typed(number: Number, sort: Sort) -> Array:
    """Array of the type that the sort of a figure has; NaN for what does not exist."""
    array: Array = np.asarray(number, dtype=_TYPES[sort])
    return np.where(np.isinf(array), np.nan, array) if sort == "number" else array


def _with_axes(values: Number, axes: int) -> Array:
    array = np.asarray(values)
    return array.reshape((1,) * axes) if array.ndim == 0 else array


def _largest(terms: list[Number]) -> Array:
    """Index of the largest term; the first one among equals."""
    best, *rest = map(np.asarray, terms)
    place = np.zeros((), np.uint8)
    for index, term in enumerate(rest, start=1):
        place = np.where(np.greater(term, best), np.uint8(index), place)
        best = np.maximum(term, best)
    return place
