"""Capacity of a bus: does the cycle fit its period, with what margin, and how many nodes does it carry?"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import repeat
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self, TypeAlias

from busplan.buses.cycle import BusCycle, Doubt, Term
from busplan.buses.figure import WAITS, BusFigures, OwnFigures, Sort, Wait
from busplan.buses.limits import BROKEN, NOT_SHOWN_KEPT, Limit
from busplan.buses.network import Network
from busplan.buses.parts import Safety
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import Number, choose, existing, is_off, larger, total, within
from busplan.errors import BusplanError
from busplan.questions.fit.certainty import (
    FITS,
    NOT_SHOWN,
    TIME,
    VERDICTS,
    Certainty,
    VerdictWord,
    available_us,
    certainty,
    limit_codes,
    time_code,
    verdict_code,
)
from busplan.questions.fit.most_nodes import MostNodes, most_and_safe_nodes
from busplan.questions.fit.network import trial
from busplan.sections.base import value_at
from busplan.sections.machine import ProfileGroup

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


COUNTS: Final = ("max_nodes", "max_axes", "limited_by", "safe_nodes", "safe_axes", "safe_limited_by")
"""Keys of the node counts: figures of each group, or of the network where all nodes are alike."""


@dataclass(frozen=True)
class GroupCapacity:
    """Nodes of one group that a bus carries, the other groups as they are."""

    name: str
    """Empty where all nodes are alike."""
    nodes: int
    axes: int
    """Axes of all its nodes."""
    max_nodes: int
    """Most nodes that fit."""
    max_axes: int
    """Their axes."""
    limited_by: str
    """Key of the limit that keeps `max_nodes` from being more."""
    safe_nodes: int | None
    """Most nodes that are shown to fit. This and the figures below are None under a model that does not decide."""
    safe_axes: int | None
    """Their axes."""
    safe_limited_by: str | None
    """Key of the limit that keeps `safe_nodes` from being more."""

    @classmethod
    def of(cls, group: ProfileGroup, most: tuple[int, str], safe: tuple[int, str] | None) -> Self:
        """The capacity of a group, from its counts: nodes, and the key of the limit."""
        nodes, axes = int(group.nodes), group.node.axes
        safe_nodes, safe_limit = safe or (None, None)
        safe_axes = None if safe_nodes is None else axes * safe_nodes
        return cls(group.name, nodes, nodes * axes, most[0], axes * most[0], most[1], safe_nodes, safe_axes, safe_limit)


@dataclass(frozen=True)
class FitFigures:
    """Does a network fit, under one timing model? The `figures` of its bus say what each figure means.

    One of messages alone has these figures only; one with a cycle has `CycleFigures`.
    """

    kind: str
    """The kind of bus."""
    bus_figures: BusFigures
    """Figures of the kind of bus."""
    safety: Safety
    """Setting of the bus that is safe or not."""
    timing_model: str
    nodes: int
    axes: int
    exceeded: tuple[str, ...]
    """Keys of the limits that are broken."""
    fits: bool
    """Whether no limit is broken, time among them: required <= available, without bias and uncertainty."""
    not_shown: tuple[str, ...] | None
    """Keys of the limits that are neither broken nor shown to be kept, time among them; None as for `verdict`."""
    verdict: VerdictWord | None
    """None under a timing model that does not decide."""
    safe: bool
    """Whether every safety limit of the bus is kept, such as a gap count that is safe for the hops."""
    own: OwnFigures
    """Figures and terms that only this kind of bus has: the record of the kind, such as `Ieee1394Figures`."""

    @property
    def behind(self) -> tuple[str, ...]:
        """Keys of the limits behind the verdict, without time: those broken, or those not shown to be kept."""
        keys = (self.not_shown or ()) if self.verdict == NOT_SHOWN else self.exceeded
        return tuple(key for key in keys if key != TIME)

    def values(self) -> dict[str, Any]:
        """All figures of the kind of bus by key; None for one that the network does not have."""
        return {**dict.fromkeys(figure.key for figure in self.bus_figures.capacity), **vars(self.own), **vars(self)}

    def by_key(self) -> dict[str, Any]:
        """The figures of the JSON document of `capacity` by key, in its order."""
        values = self.values()
        named = {figure.key: values[figure.key] for figure in self.bus_figures.capacity}
        return {key: list(value) if isinstance(value, tuple) else value for key, value in named.items()}


@dataclass(frozen=True)
class CycleFigures(FitFigures):
    """Does the cycle of a network fit its period, under one timing model?"""

    period_us: float
    available_us: float
    required_us: float
    time_slice_us: float
    required_time_slice_us: float
    terms: tuple[Term, ...]
    """The parts of `required_us`, in the order of the wire."""
    utilisation: float
    margin_us: float
    binding_term: str
    """Name of the largest term."""
    min_period_us: float | None
    """This and `safe_min_period_us` are None if no period that the bus allows is long enough."""
    min_slice_ratio: float
    bias_us: float | None
    """This and the figures below are None under a timing model that does not decide."""
    margin_corrected_us: float | None
    uncertainty_us: float | None
    """None also where U is unknown."""
    safe_required_us: float | None
    least_required_us: float | None
    """`required_us` without the part that is only possible."""
    safe_min_period_us: float | None
    doubts: tuple[Doubt, ...]
    """Components of the uncertainty; empty under a timing model that does not decide."""

    @property
    def waits_us(self) -> dict[Wait, float]:
        """What the cycle waits for, and how long [us]: wire, nodes, adapter, host; all add up to `required_us`."""
        waits_for = {figure.key: figure.waits_for for figure in self.bus_figures.terms}
        waits_us = dict.fromkeys(WAITS, 0.0)
        for term in self.terms:
            waits_us[waits_for[term.key]] += term.us
        return waits_us

    @classmethod
    def of(cls, figures: FitFigures) -> Self:
        """The same figures, for a type checker; BusplanError for those of messages alone, which have no cycle."""
        if isinstance(figures, cls):
            return figures
        raise BusplanError("a network of messages alone has no cycle")


@dataclass(frozen=True)
class CapacityFigures(CycleFigures):
    """Capacity at one period under one timing model: whether the cycle fits, and how many nodes would."""

    counts: tuple[GroupCapacity, ...]
    """How many nodes fit: of each [[group]], or of all where they are alike."""
    groups: tuple[GroupCapacity, ...] = ()
    """One for each [[group]] of the profile."""
    max_nodes: int | None = None
    """Most nodes that fit. This and the figures below are None for a profile with groups."""
    max_axes: int | None = None
    limited_by: str | None = None
    """Key of the limit that keeps `max_nodes` from being more."""
    safe_nodes: int | None = None
    """Most nodes that are shown to fit; None under a timing model that does not decide."""
    safe_axes: int | None = None
    safe_limited_by: str | None = None

    @property
    def most_axes(self) -> int | None:
        """The most axes of the network that are shown to fit, with more nodes of the group with the most axes.

        None without axes, and under a model that does not decide.
        """
        counted = max(self.counts, key=lambda count: count.axes)
        return axes_in_all(self.axes, counted=counted.axes, safe=counted.safe_axes)

    @property
    def of_groups(self) -> dict[str, Any]:
        """Counts of each [[group]] by dotted key, such as group.gantry.max_nodes."""
        return {f"group.{group.name}.{key}": getattr(group, key) for group in self.groups for key in COUNTS}

    def values(self) -> dict[str, Any]:
        """All figures by key, those of groups by their dotted keys."""
        return {**super().values(), **self.of_groups}


def axes_in_all(axes: int, *, counted: int, safe: int | None) -> int | None:
    """The most axes of a network of `axes`, of which one group has `counted` and at most `safe` of it are shown to fit.

    None without axes, and under a model that does not decide.
    """
    if not counted or safe is None:
        return None
    return safe and axes - counted + safe


class Judged:
    """A part of an answer that has the figures of the timing model that decides."""

    figures: FitFigures
    """Figures of the timing model that decides: `CapacityFigures` of a cycle."""

    @property
    def cycle(self) -> CapacityFigures | None:
        """The figures of a cycle; None for messages alone."""
        return self.figures if isinstance(self.figures, CapacityFigures) else None

    @property
    def deciding(self) -> CapacityFigures:
        """The figures of a cycle; BusplanError for messages alone, whose `figures` are fewer."""
        return CapacityFigures.of(self.figures)


def capacity_figures(network: Network, *, model: str) -> FitFigures:
    """Whether a network fits under one timing model; of a cycle `CapacityFigures`, with the nodes that would fit."""
    return with_counts(figures(network, model=model), node_counts(network, model=model))


def with_counts(fit: FitFigures, counts: tuple[GroupCapacity, ...]) -> FitFigures:
    """The figures of a cycle together with the counts of each group; those of messages alone as they are."""
    if not counts:
        return fit
    if counts[0].name:
        return CapacityFigures(**vars(fit), counts=counts, groups=counts)
    return CapacityFigures(**vars(fit), counts=counts, **{key: getattr(counts[0], key) for key in COUNTS})


def node_counts(network: Network, *, model: str) -> tuple[GroupCapacity, ...]:
    """Nodes of each group that fit a network's period, and are shown to fit; of all where they are alike."""
    groups = network.profile.node_groups
    if len(groups) < _MANY_GROUPS or not has_arrays(network):
        found = (
            most_and_safe_nodes(partial(network.with_nodes, group=group.name), network, model=model) for group in groups
        )
        words = [(most.words, safe and safe.words) for most, safe in found]
    else:
        words = _words_of_each(network, model=model)
    return tuple(GroupCapacity.of(group, *counts) for group, counts in zip(groups, words, strict=True))


def has_arrays(network: Network) -> bool:
    """Whether its limits are computed for many numbers of nodes at once, in arrays, and not point by point."""
    return not any(limit.is_slow for limit in network.bus.limits)


Counts: TypeAlias = tuple[tuple[int, str], tuple[int, str] | None]
"""Most nodes that fit and the key of the limit, and the same to be shown to fit."""
_MANY_GROUPS: Final = 16
"""From so many groups on, arrays are faster than plain numbers."""
_GROUPS_AT_ONCE: Final = 512


def _words_of_each(network: Network, *, model: str) -> list[Counts]:
    """The counts of each group, the others as they are: a group is a point of an array."""
    import numpy as np

    words: list[Counts] = []
    number = len(network.names)
    for start in range(0, number, _GROUPS_AT_ONCE):
        places = np.arange(start, min(start + _GROUPS_AT_ONCE, number))
        found = most_and_safe_nodes(partial(_with_nodes_of_one, network, places), network, model=model)
        words += counts_at(found, len(places))
    return words


def counts_at(found: tuple[MostNodes, MostNodes | None], points: int) -> list[Counts]:
    """Counts at each point of arrays."""
    most, safe = found
    return [*zip(most.words_at(points), safe.words_at(points) if safe else [None] * points, strict=True)]


def _with_nodes_of_one(network: Network, places: "NDArray[np.int_]", nodes: Number) -> Network:
    """The network with another number of nodes of one group, at each point of another: `places` are their indices."""
    groups, place = [], 0
    for group in network.groups:
        counts: list[Number] = []
        for member in group.members:
            is_varied = places[0] <= place <= places[-1]
            counts.append(choose(places == place, nodes, member.nodes) if is_varied else member.nodes)
            place += 1
        groups.append(group._replace(nodes=total(counts)))
    return network._replace(groups=tuple(groups))


class FitNumbers(NamedTuple):
    """The figures of a network under one timing model, computed elementwise: the numbers may be arrays."""

    kind: str
    """The kind of bus."""
    bus_figures: BusFigures
    """Figures of the kind of bus."""
    safety: Safety
    """Setting of the bus that is safe or not."""
    model: str
    numbers: Mapping[str, Number | None]
    """Figures of a cycle that every kind of bus has, by key; None for one that the timing model does not have. Empty
    for messages alone.
    """
    own: Mapping[str, Number | None]
    """Figures and terms that only this kind of bus has, by the names of the fields of `record`."""
    record: type[OwnFigures]
    terms: tuple[Term, ...]
    doubts: tuple[Doubt, ...]
    codes: Mapping[str, Number]
    """Verdict on each limit by key, as an index of `VERDICTS`; on time, too, under the model that decides."""
    broken: Mapping[str, Number]
    """Where each limit is broken, by key; time at nominal values is the last."""
    unsafe: Number
    """Where a safety limit is broken."""

    @property
    def decides(self) -> bool:
        """Whether its timing model gives the verdict."""
        return TIME in self.codes

    def at_points(self, points: int) -> Iterator["FitNumbers"]:
        """The plain numbers at each point of arrays of shape (points,)."""
        import numpy as np

        def rows(numbers: Iterable[Number | None]) -> Iterator[tuple[Any, ...]]:
            columns = (repeat(None) if one is None else np.broadcast_to(one, points).tolist() for one in numbers)
            return (row[1:] for row in zip(range(points), *columns, strict=False))

        parts = (self.numbers, self.own, self.codes, self.broken)
        terms, doubts = (rows(part.us for part in parts) for parts in (self.terms, self.doubts))
        for *values, terms_us, doubts_us, (unsafe,) in zip(
            *(rows(part.values()) for part in parts), terms, doubts, rows([self.unsafe]), strict=True
        ):
            numbers, own, codes, broken = (
                dict(zip(part, row, strict=True)) for part, row in zip(parts, values, strict=True)
            )
            yield FitNumbers(
                self.kind,
                self.bus_figures,
                self.safety,
                self.model,
                numbers,
                own,
                self.record,
                tuple(term._replace(us=us) for term, us in zip(self.terms, terms_us, strict=True)),
                tuple(doubt._replace(us=us) for doubt, us in zip(self.doubts, doubts_us, strict=True)),
                codes,
                broken,
                unsafe,
            )

    def figures(self) -> FitFigures:
        """The figures, of plain numbers."""
        exceeded = tuple(key for key, is_broken in self.broken.items() if is_broken)
        not_shown = tuple(key for key, code in self.codes.items() if code == NOT_SHOWN_KEPT)
        shared = {
            "kind": self.kind,
            "bus_figures": self.bus_figures,
            "safety": self.safety,
            "timing_model": self.model,
            "exceeded": exceeded,
            "fits": not exceeded,
            "not_shown": not_shown if self.decides else None,
            "verdict": VERDICTS[int(verdict_code(self.codes))] if self.decides else None,
            "safe": not self.unsafe,
            "own": self.record(**_plain(self.own, self.bus_figures)),
            **_plain(self.numbers, self.bus_figures),
        }
        if not self.terms:
            return FitFigures(**shared)
        binding_term = max(self.terms, key=lambda term: term.us).name
        return CycleFigures(**shared, terms=self.terms, binding_term=binding_term, doubts=self.doubts)


def figures(network: Network, *, model: str) -> FitFigures:
    """Whether a network fits under one timing model."""
    return fit_numbers(network, model=model).figures()


def cycle_figures(network: Network, *, model: str) -> CycleFigures:
    """Whether a network with a cycle fits its own period under one timing model; BusplanError without a cycle."""
    return CycleFigures.of(figures(network, model=model))


def fit_numbers(network: Network, *, model: str) -> FitNumbers:
    """The figures of a network under one timing model, computed elementwise."""
    bus, cycle, has_cycle = network.bus, network.bus.cycle(network, model=model), bool(network.groups)
    numbers: dict[str, Number | None] = {"nodes": 0, "axes": 0}
    late: Number = False
    terms: tuple[Term, ...] = ()
    doubts: tuple[Doubt, ...] = ()
    if has_cycle:
        numbers |= numeric_figures(cycle)
        terms, late = cycle.terms, within(cycle.required_us, available_us(network)) == 0
    codes = limit_codes(network)
    broken = {**{key: code == BROKEN for key, code in codes.items()}, TIME: late}
    if model == bus.deciding_model:
        certain = certainty(cycle)
        codes[TIME], doubts = time_code(certain, network), certain.doubts
        if has_cycle:
            numbers |= certainty_numbers(certain, cycle)
    elif has_cycle:
        numbers |= dict.fromkeys(_CERTAINTY_KEYS)
    own = {**cycle.figures(), **{term.key: term.us for term in terms}}
    unsafe = total(limit.is_surely_broken(network) for limit in bus.limits if limit.role == "safety") > 0
    return FitNumbers(
        bus.kind, bus.figures, bus.safety, model, numbers, own, cycle.record, terms, doubts, codes, broken, unsafe
    )


def _plain(numbers: Mapping[str, Number | None], register: BusFigures) -> dict[str, Any]:
    """The numbers as plain ones, of the type that each figure has; None for an infinite one, which does not exist."""
    types = _types(register)
    plain = {key: None if number is None else existing(number) for key, number in numbers.items()}
    return {key: None if number is None else types.get(key, float)(number) for key, number in plain.items()}


TYPES: Final[Mapping[Sort, type]] = {"number": float, "count": int, "truth": bool}
"""Type of the plain number of a figure, by its sort."""


@cache
def _types(register: BusFigures) -> Mapping[str, type]:
    """Type of each number of `capacity` by its key."""
    return {figure.key: TYPES[figure.sort] for figure in register.capacity if figure.sort in TYPES}


_CERTAINTY_KEYS: Final = (
    "bias_us",
    "margin_corrected_us",
    "uncertainty_us",
    "safe_required_us",
    "least_required_us",
    "safe_min_period_us",
)
"""Figures of a cycle that only the timing model that decides has."""


def certainty_numbers(certain: Certainty, cycle: BusCycle) -> dict[str, Number | None]:
    """Figures of the certainty of the verdict, computed elementwise."""
    uncertainty_us = certain.uncertainty_us
    if certain.bias_us is None:  # with neither a bias nor an uncertainty, U is unknown
        uncertainty_us = choose(uncertainty_us > 0, uncertainty_us, inf)
    return {
        "bias_us": certain.bias_us,
        "margin_corrected_us": certain.margin_corrected_us,
        "uncertainty_us": uncertainty_us,
        "safe_required_us": certain.safe_required_us,
        "least_required_us": _least_us(cycle.required_us, certain.possible_us),
        "safe_min_period_us": shortest_period_us(cycle.network, certain.safe_required_us, is_shown=True),
    }


def _least_us(required_us: Number, possible_us: Number) -> Number:
    return required_us if is_off(possible_us) else required_us - possible_us


def numeric_figures(cycle: BusCycle) -> dict[str, Number]:
    """Figures that every kind of bus has, computed from a cycle elementwise; infinite for one that does not exist.

    Keys are those of `CycleFigures`.
    """
    network = cycle.network
    period_us, ratio, nodes = network.period_us, network.slice_ratio, network.nodes
    given_us, required_us = available_us(network), cycle.required_us
    return {
        "period_us": period_us,
        "nodes": nodes,
        "axes": network.axes,
        "available_us": given_us,
        "required_us": required_us,
        "time_slice_us": time_slice_us(period_us, slice_ratio=ratio, nodes=nodes),
        "required_time_slice_us": cycle.required_time_slice_us,
        "utilisation": required_us / given_us,
        "margin_us": margin_us(required_us, available_us=given_us),
        "min_period_us": shortest_period_us(network, required_us),
        "min_slice_ratio": required_us / period_us,
    }


def margin_us(required_us: Number, *, available_us: Number) -> Number:
    """Margin of a cycle: the available time less the required time [us]."""
    spare_us = available_us - required_us
    # A cycle that fits only within rounding has a margin of 0, not a negative one.
    fits = within(required_us, available_us)
    return choose(spare_us < 0, choose(fits, 0.0, spare_us), spare_us)


def shortest_period_us(network: Network, needed_us: Number, *, is_shown: bool = False) -> Number:
    """The shortest period that the bus allows and that is long enough for a cycle; infinite where there is none [us].

    The network's own period plays no part. With `is_shown` the period keeps the other limits with their uncertainty;
    otherwise at nominal values.
    """
    bus = network.bus
    period_us = bus.periods.shortest_us(needed_us / network.slice_ratio)
    for limit in bus.limits:
        if limit.has_period and not limit.is_slow:
            kept = limit.shown if is_shown else limit.nominal
            period_us = larger(period_us, bus.periods.shortest_us(kept.shortest_period_us(network)))
    return period_us


def limits_behind(figures: FitFigures, network: Network) -> tuple[Limit, ...]:
    """The limits of the bus behind a verdict, without time: those broken, or those not shown to be kept."""
    return tuple(limit for limit in network.bus.limits if limit.key in figures.behind)


def words_behind(figures: FitFigures, network: Network) -> tuple[str, ...]:
    """By how much each limit behind a verdict is broken, or why it is not shown to be kept."""
    return tuple(limit.words(network) for limit in limits_behind(figures, network))


def reset(network: Network, now: FitFigures) -> Network | None:
    """The network after a bus reset; None where it is not shown to fit now, or where a reset changes nothing."""
    changes = network.bus.safety.after_reset
    if now.verdict != FITS or all(value_at(network.profile, key) == value for key, value in changes.items()):
        return None
    return trial(network, changes)


def after_reset(network: Network, now: FitFigures) -> FitFigures | None:
    """Figures of a network after a bus reset; None unless it is shown to fit now and not after the reset."""
    network_then = reset(network, now)
    then = None if network_then is None else figures(network_then, model=now.timing_model)
    return None if then is None or then.verdict == FITS else then
