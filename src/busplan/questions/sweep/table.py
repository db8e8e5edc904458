"""Capacity over a grid: the figures of `capacity` for many profiles at once, by the same functions.

Those functions accept arrays, so a profile whose keys hold arrays gives arrays. The values of each key lie along an
axis of their own, so that a figure is computed only over the keys that it depends on. Figures in words are added here.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, lru_cache, partial, reduce
from math import inf, prod
from typing import Final, TypeAlias

import numpy as np

from busplan.buses.cycle import BusCycle
from busplan.buses.figure import CERTAINTY, CIRCLE_REFUSED_BY, FITS, TIMING_MODEL, Sort
from busplan.buses.network import Network
from busplan.buses.parts import BROKEN, NOT_SHOWN_KEPT, Limit, Value
from busplan.elementwise import Number
from busplan.progress import Progress, ignored
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
from busplan.questions.fit.circle_refusal import loop_refusals, refusals, run_refusals
from busplan.questions.fit.figures import COUNTS, certainty_numbers, numeric_figures
from busplan.questions.fit.loop_delays import acts_at_once, any_jitter_us
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.fit.node_limit import most_nodes
from busplan.questions.sweep.grid import Array, Chunk, Grid
from busplan.sections.base import with_all_unchecked, with_unchecked
from busplan.sections.profile import CIRCLE_SECTIONS, Profile
from busplan.servo.checks import is_multiple

CHUNK_POINTS: Final = 1 << 14
"""Points computed at once: their arrays fit into the processor's cache."""
_CAUSES_KEPT: Final = 1 << 16
"""Most values of which the causes that refuse a circle are kept: about ten megabytes."""

_TYPES: Final[Mapping[Sort, type]] = {"number": float, "count": int, "truth": bool}

Columns: TypeAlias = dict[str, Array]
"""Columns by name, a row for each point and timing model, each of shape (rows,).

Numbers (NaN where there is none), truth values, or objects: words, tuples of words, and None where there is none.
"""


def figure_names(profile: Profile) -> tuple[str, ...]:
    """Columns of a sweep after the varied keys; `timing_model` is the first, counts of groups are the last."""
    groups = (f"group.{group.name}.{key}" for group in profile.group for key in COUNTS)
    return (*(figure.key for figure in bus_of(profile).figures.capacity), *groups)


def figure_table(
    profile: Profile,
    grid: Grid,
    *,
    timing_models: Sequence[str],
    group: str = "",
    with_counts: bool = True,
    with_circle: bool = False,
    progress: Progress = ignored,
) -> Columns:
    """Compute all figures of `capacity` over a grid.

    Parameters
    ----------
    profile
        The network.
    grid
        Values of its keys, from `checked_grid`.
    timing_models
        Timing models, in this order.
    group
        Group of the profile whose nodes vary for the most nodes and axes of the whole, the others as they are; empty
        where all nodes are alike.
    with_counts
        Whether there are columns of the most nodes and axes, which take the cycle at other numbers of nodes.
    with_circle
        Whether to ask what refuses a circle of a profile that asks for none, too.
    progress
        Called with the points that are done, and all of them.

    References
    ----------
    Paper, equations (1)-(11).
    """
    causes_at = lru_cache(_CAUSES_KEPT)(partial(_causes, profile, profile.asks_for_circle or with_circle))
    decides = bus_of(profile).deciding_model
    parts: list[Columns] = []
    done = 0
    for chunk in grid.chunks(CHUNK_POINTS):
        figures_of = partial(_figures, profile, chunk.values, group=group)
        by_model = {model: figures_of(model, with_counts=with_counts) for model in timing_models}
        fits = (by_model.get(decides) or figures_of(decides, with_counts=False))[FITS.key]
        refused = {CIRCLE_REFUSED_BY.key: _refused(profile, chunk, fits, causes_at)}
        columns = [{**chunk.values, **figures, **refused} for figures in by_model.values()]
        names = (name for name in (*grid.axes, *figure_names(profile)) if name in columns[0])
        parts.append({name: _interleaved([own[name] for own in columns], chunk.shape) for name in names})
        done += prod(chunk.shape)
        progress(done, grid.points)
    # A part lets go of a column when it is in the table.
    return {name: np.concatenate([part.pop(name) for part in parts]) for name in [*parts[0]]}


def _interleaved(by_model: Sequence[Array], shape: tuple[int, ...]) -> Array:
    """Arrays that broadcast to a shape, one for each timing model: point by point, and for each model by model."""
    return np.stack([np.broadcast_to(own, shape).ravel() for own in by_model], axis=1).ravel()


def _figures(
    profile: Profile, values: Mapping[str, Array], model: str, *, group: str, with_counts: bool
) -> dict[str, Array]:
    """All figures of a chunk under one timing model; they broadcast to its shape."""
    for number, (key, own) in enumerate(values.items()):
        if own.dtype == object and own.size > 1:
            # Words among numbers: compute each value by itself and join the results along the axis.
            parts = [
                _figures(
                    profile,
                    {**values, key: np.take(own, [index], axis=number)},
                    model,
                    group=group,
                    with_counts=with_counts,
                )
                for index in range(own.size)
            ]
            return {name: _joined([part[name] for part in parts], axis=number) for name in parts[0]}
    figures = _columns(_at(profile, values), model, group=group, with_counts=with_counts)
    return {name: _with_axes(column, len(values)) for name, column in figures.items()}


def _with_axes(column: Array, axes: int) -> Array:
    return column.reshape((1,) * axes) if column.size == 1 else column


def _joined(parts: list[Array], *, axis: int) -> Array:
    shape = np.broadcast_shapes(*(part.shape for part in parts))
    return np.concatenate([np.broadcast_to(part, shape) for part in parts], axis=axis)


def _at(profile: Profile, values: Mapping[str, Array]) -> Profile:
    """Return a copy whose keys hold arrays, unvalidated."""
    return with_all_unchecked(
        profile, {key: own.item() if own.size == 1 else own.astype(float) for key, own in values.items()}
    )


def _columns(where: Profile, model: str, *, group: str, with_counts: bool) -> dict[str, Array]:
    bus, network = bus_of(where), network_of(where)
    cycle = bus.cycle(network, model=model)
    figures = numeric_figures(cycle)
    terms = {term.key: term.us if network.groups else inf for term in cycle.terms}
    limits = limits_with_time(network, model=model)
    late = np.logical_not(np.asarray(fits_in(figures["required_us"], available_us=figures["available_us"])))
    codes = limit_codes(network)
    broken = {**_where(codes, BROKEN), TIME: late}
    numbers = {**figures, **cycle.figures(), **terms, FITS.key: np.logical_not(reduce(np.logical_or, broken.values()))}
    words = {
        TIMING_MODEL.key: _word(model),
        "binding_term": _chosen([term.name for term in cycle.terms], _largest([*terms.values()]))
        if network.groups
        else _word(None),
        "exceeded": _sets(broken),
        **(_certainty(cycle, codes) if model == bus.deciding_model else _UNDECIDED),
        **(_counts(network, limits, model=model, group=group) if with_counts else {}),
    }
    sorts = {figure.key: figure.sort for figure in bus.figures.capacity}
    return {
        key: words[key] if key in words else _number(numbers[key], sorts[key])
        for key in figure_names(network.profile)
        if key != CIRCLE_REFUSED_BY.key and (with_counts or key.rpartition(".")[2] not in COUNTS)
    }


_Causes: TypeAlias = tuple[tuple[str, ...], tuple[str, ...]]
"""Keys for which a circle cannot be run, and those where its cycle fits the bus."""


def _causes(profile: Profile, is_asked: bool, changes: tuple[tuple[str, Value], ...]) -> _Causes:
    if not is_asked:
        return (), ()
    if not profile.has_cycle:
        names = tuple(cause.name for cause in refusals(profile))
        return names, names
    for key, value in changes:
        profile = with_unchecked(profile, key, value)
    of_loop = loop_refusals(profile)
    of_run = run_refusals(profile, of_loop)
    names = tuple(cause.name for cause in of_loop)
    return names, (*names, *(cause.name for cause in of_run))


def _refused(
    profile: Profile, chunk: Chunk, fits: Array, causes_at: Callable[[tuple[tuple[str, Value], ...]], _Causes]
) -> Array:
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
    asked: dict[tuple[object, ...], _Causes] = {}
    always, where_it_fits = np.empty(shape, object), np.empty(shape, object)
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
        always[where], where_it_fits[where] = causes
    keys: Array = always if np.array_equal(always, where_it_fits) else np.where(fits, where_it_fits, always)
    return keys


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


def _chosen(words: Iterable[object], codes: Array) -> Array:
    """Words by their place."""
    chosen: Array = _words(tuple(words))[np.atleast_1d(codes)]
    return chosen


def _word(word: object) -> Array:
    return _chosen([word], np.zeros(1, int))


@cache
def _words(words: tuple[object, ...]) -> Array:
    return np.fromiter(words, dtype=object, count=len(words))


_NO_NUMBER: Final = np.full((), np.nan)
_UNDECIDED: Final = {
    figure.key: _word(None) if figure.sort in ("word", "words") else _NO_NUMBER
    for figure in CERTAINTY
    if figure.key not in COUNTS
}
"""Figures that a timing model does not have."""


def _number(number: Number | None, sort: Sort) -> Array:
    """Array of the type that the sort of a figure has; NaN for what does not exist."""
    if number is None:
        return _NO_NUMBER
    array: Array = np.asarray(number, dtype=_TYPES[sort])
    return np.where(np.isinf(array), np.nan, array) if sort == "number" else array


def _counts(network: Network, limits: Sequence[Limit], *, model: str, group: str) -> dict[str, Array]:
    """How many nodes fit: of each group, and of the whole where one group varies and the others are as they are."""
    if not network.groups:
        return {**dict.fromkeys(COUNTS, _NO_NUMBER), "limited_by": _word(None), "safe_limited_by": _word(None)}
    counts = {name: _counts_of(network.asking(name), limits, model=model) for name in network.names}
    whole = counts[group]
    if network.is_uniform:
        return whole
    varied = network.asking(group).asked_nodes
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


def _counts_of(network: Network, limits: Sequence[Limit], *, model: str) -> dict[str, Array]:
    most, axes = most_nodes(network, limits), network.asked_nodes.node.axes
    counted = {
        "max_nodes": _number(most.nodes, "count"),
        "max_axes": _number(axes * most.nodes, "count"),
        "limited_by": _chosen([limit.key for limit in limits], np.asarray(most.limit, int)),
    }
    if model != bus_of(network.profile).deciding_model:
        return {**counted, "safe_nodes": _NO_NUMBER, "safe_axes": _NO_NUMBER, "safe_limited_by": _word(None)}
    to_be_safe = limits_to_be_safe(network)
    # No more nodes are shown to fit than fit.
    safe = most_nodes(network, to_be_safe, ceiling=int(np.max(np.asarray(most.nodes))) + 1)
    return {
        **counted,
        "safe_nodes": _number(safe.nodes, "count"),
        "safe_axes": _number(axes * safe.nodes, "count"),
        "safe_limited_by": _chosen([limit.key for limit in to_be_safe], np.asarray(safe.limit, int)),
    }


def _certainty(cycle: BusCycle, limits: Mapping[str, Number]) -> dict[str, Array]:
    """Figures of how sure the verdict is, of a cycle under the timing model that decides."""
    sure = certainty(cycle)
    codes = {**limits, TIME: time_code(sure, cycle.network)}
    sorts = {figure.key: figure.sort for figure in CERTAINTY}
    return {
        **{key: _number(number, sorts[key]) for key, number in certainty_numbers(sure, cycle).items()},
        "not_shown": _sets(_where(codes, NOT_SHOWN_KEPT)),
        "verdict": _chosen(VERDICTS, np.asarray(verdict_code(codes), int)),
    }


def _where(codes: Mapping[str, Number], code: int) -> dict[str, Array]:
    """Where each limit has a verdict."""
    return {key: np.equal(np.asarray(own), code) for key, own in codes.items()}


def _sets(flags: Mapping[str, Array]) -> Array:
    """The keys that are flagged, as a tuple at each point."""
    codes: Array = np.asarray(sum(flag.astype(int) << bit for bit, flag in enumerate(flags.values())))
    words: Array = _combinations(tuple(flags))[np.atleast_1d(codes)]
    return words


@cache
def _combinations(keys: tuple[str, ...]) -> Array:
    """Every set of keys, by the number whose bits are its members."""
    return _words(
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
