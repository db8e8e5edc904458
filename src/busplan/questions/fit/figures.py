"""Capacity of a bus: does the cycle fit its period, with what margin, and how many nodes does it carry?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from math import inf
from typing import Any, Final, NamedTuple

from busplan.buses import kind_named
from busplan.buses.cycle import BusCycle, Doubt, Term
from busplan.buses.figure import BIAS, CERTAINTY, MARGIN_CORRECTED, SAFE_MIN_PERIOD, SAFE_REQUIRED, UNCERTAINTY
from busplan.buses.network import Network
from busplan.buses.parts import BROKEN, NOT_SHOWN_KEPT
from busplan.buses.time_slice import required_time_slice_us, time_slice_us
from busplan.elementwise import Number, choose, existing, larger, plain
from busplan.profile.toml import at_periods, override
from busplan.questions.fit.certainty import (
    FITS,
    TIME,
    VERDICTS,
    Certainty,
    VerdictWord,
    available_us,
    certainty,
    fits_in,
    limit_codes,
    time_code,
    verdict_code,
)
from busplan.questions.fit.circle_refusal import circle_refusals
from busplan.questions.fit.figure_values import FigureValues
from busplan.questions.fit.network import bus_of, model_names, network_of
from busplan.questions.fit.node_limit import largest_nodes, safe_nodes
from busplan.sections.profile import Profile

COUNTS: Final = ("max_nodes", "max_axes", "limited_by", "safe_nodes", "safe_axes", "safe_limited_by")
"""Figures that each group has for itself; where all nodes are alike, they are those of the whole."""


@dataclass(frozen=True, eq=False)
class GroupCapacity:
    """How many nodes of one group a bus carries, the other groups as they are.

    The largest and the safe number are each computed when they are first read.
    """

    name: str
    """Empty where all nodes are alike."""
    nodes: int
    axes: int
    """Of all its nodes."""
    node_axes: int = field(repr=False)
    timing_model: str = field(repr=False)
    profile: Profile = field(repr=False)

    @cached_property
    def _largest(self) -> tuple[int, str]:
        return largest_nodes(self.profile, model=self.timing_model, group=self.name)

    @cached_property
    def _safe(self) -> tuple[int, str] | tuple[None, None]:
        decides = self.timing_model == bus_of(self.profile).deciding_model
        return safe_nodes(self.profile, group=self.name) if decides else (None, None)

    @property
    def max_nodes(self) -> int:
        """Most nodes that fit."""
        return self._largest[0]

    @property
    def max_axes(self) -> int:
        """Their axes."""
        return self.node_axes * self.max_nodes

    @property
    def limited_by(self) -> str:
        """Key of the limit that keeps `max_nodes` from being more."""
        return self._largest[1]

    @property
    def safe_nodes(self) -> int | None:
        """Most nodes that are shown to fit; this and the figures below exist for the timing model that decides."""
        return self._safe[0]

    @property
    def safe_axes(self) -> int | None:
        """Their axes."""
        return None if self.safe_nodes is None else self.node_axes * self.safe_nodes

    @property
    def safe_limited_by(self) -> str | None:
        """Key of the limit that keeps `safe_nodes` from being more."""
        return self._safe[1]

    def record(self) -> dict[str, Any]:
        """All its figures by key."""
        return {key: getattr(self, key) for key in ("name", "nodes", "axes", *COUNTS)}

    def __eq__(self, other: object) -> bool:
        # Two networks may have one capacity.
        return isinstance(other, GroupCapacity) and self.record() == other.record()

    def __hash__(self) -> int:
        return hash((self.name, self.nodes, self.axes))


class CapacityFigures(NamedTuple):
    """Capacity at one period under one timing model; the `figures` of its bus say what each figure means.

    Figures that only its kind of bus has, terms and numbers of nodes are attributes like all others. A network of
    messages alone has no cycle: then every figure of the cycle, its period among them, is None, whatever its type says.
    """

    kind: str
    """The kind of bus."""
    timing_model: str
    period_us: float
    nodes: int
    axes: int
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
    """This and `safe_min_period_us` are None where no period that the bus allows is long enough."""
    min_slice_ratio: float
    exceeded: tuple[str, ...]
    """Keys of the limits that are broken."""
    fits: bool
    """Whether no limit is broken, time among them: required <= available, without bias and uncertainty."""
    circle_refused_by: tuple[str, ...]
    """Keys that prevent the profile's circle test from running."""
    bias_us: float | None
    """This and the figures below exist for the timing model that decides."""
    margin_corrected_us: float | None
    uncertainty_us: float | None
    """None also where it is unknown."""
    safe_required_us: float | None
    safe_min_period_us: float | None
    not_shown: tuple[str, ...] | None
    """Keys of the limits that are neither broken nor shown to be kept, time among them."""
    verdict: VerdictWord | None
    doubts: tuple[Doubt, ...]
    """Parts of the uncertainty."""
    counts: tuple[GroupCapacity, ...]
    """How many nodes fit: of each [[group]], or of all where they are alike."""
    safe: bool
    """Whether every safety limit of the bus is kept, as a gap count that is safe for the hops."""
    own: FigureValues
    """Figures that only this kind of bus has."""

    @property
    def groups(self) -> tuple[GroupCapacity, ...]:
        """One for each [[group]] of the profile."""
        return self.counts if self._whole is None else ()

    @property
    def _whole(self) -> GroupCapacity | None:
        """The nodes, where all are alike; groups have figures of their own, and those of the whole are None."""
        first = self.counts[0] if self.counts else None
        return None if first is None or first.name else first

    @property
    def max_nodes(self) -> int | None:
        """Most nodes that fit; None with groups."""
        return None if self._whole is None else self._whole.max_nodes

    @property
    def max_axes(self) -> int | None:
        """Their axes."""
        return None if self._whole is None else self._whole.max_axes

    @property
    def limited_by(self) -> str | None:
        """Key of the limit that keeps `max_nodes` from being more."""
        return None if self._whole is None else self._whole.limited_by

    @property
    def safe_nodes(self) -> int | None:
        """Most nodes that are shown to fit; None with groups, and under a timing model that does not decide."""
        return None if self._whole is None else self._whole.safe_nodes

    @property
    def safe_axes(self) -> int | None:
        """Their axes."""
        return None if self._whole is None else self._whole.safe_axes

    @property
    def safe_limited_by(self) -> str | None:
        """Key of the limit that keeps `safe_nodes` from being more."""
        return None if self._whole is None else self._whole.safe_limited_by

    def __getattr__(self, key: str) -> Any:
        # Figures of the kind and terms are attributes as all others are; only what is no field comes here.
        if not key.startswith("_"):
            if not self.terms and any(key == figure.key for figure in kind_named(self.kind).figures.terms):
                return None
            if key in self.own:
                return self.own[key]
            for term in self.terms:
                if term.key == key:
                    return term.us
        raise AttributeError(f"a bus of kind {self.kind} has no figure {key!r}")

    def by_key(self) -> dict[str, Any]:
        """The figures of the document by key, in its order."""
        named = {figure.key: getattr(self, figure.key) for figure in kind_named(self.kind).figures.capacity}
        return {key: list(value) if isinstance(value, tuple) else value for key, value in named.items()}


class Capacity(NamedTuple):
    """The profile as it was analysed, and for each period a set of figures for each timing model."""

    profile: Profile
    periods: tuple[tuple[CapacityFigures, ...], ...]

    @property
    def results(self) -> tuple[CapacityFigures, ...]:
        """All sets of figures, period by period."""
        return tuple(chain.from_iterable(self.periods))


def capacity(
    profile: Profile,
    *,
    periods_us: Sequence[float] | None = None,
    timing_models: Sequence[str] | None = None,
) -> Capacity:
    """Tell whether the cycle fits its period, and how many nodes would.

    Parameters
    ----------
    profile
        The network.
    periods_us
        Communication periods T_s [us]; without them the profile's own.
    timing_models
        Which timing models, in this order; without them all of the kind of bus.

    Returns
    -------
    Capacity
        Figures for each period and model, in this nesting.

    Raises
    ------
    BusplanError
        A period that the profile's schema refuses.

    References
    ----------
    Paper, equations (1), (2), (11).
    """
    models = model_names(profile) if timing_models is None else timing_models
    variants = at_periods(profile, periods_us)
    return Capacity(
        profile,
        tuple(tuple(figures(variant, model=model) for model in models) for variant in variants),
    )


def figures(profile: Profile, *, model: str) -> CapacityFigures:
    """Compute all figures of a profile at its own period under one timing model.

    Parameters
    ----------
    profile
        The network.
    model
        Timing model.
    """
    network = network_of(profile)
    bus = bus_of(profile)
    cycle = bus.cycle(network, model=model)
    numbers: dict[str, Any] = {key: existing(number) for key, number in numeric_figures(cycle).items()}
    own = FigureValues({key: None if number is None else plain(number) for key, number in cycle.figures().items()})
    overruns = profile.has_cycle and not fits_in(numbers["required_us"], available_us=numbers["available_us"])
    codes = limit_codes(network)
    broken = tuple(key for key, code in codes.items() if code == BROKEN)
    exceeded = (*broken, *((TIME,) if overruns else ()))
    decides = model == bus.deciding_model
    terms = cycle.terms if profile.has_cycle else ()
    counts = (
        GroupCapacity(alike.name, int(alike.nodes), int(alike.nodes) * alike.node.axes, alike.node.axes, model, profile)
        for alike in profile.alike_nodes
    )
    return CapacityFigures(
        kind=bus.kind,
        timing_model=model,
        **numbers,
        terms=terms,
        binding_term=max(terms, key=lambda term: plain(term.us)).name if terms else _NO_TERM,
        exceeded=exceeded,
        fits=not exceeded,
        circle_refused_by=tuple(cause.name for cause in circle_refusals(profile)),
        **(_certainty_figures(cycle, codes) if decides else _UNDECIDED),
        counts=tuple(counts),
        safe=bus.is_safe(network),
        own=own,
    )


_NO_TERM: Final[Any] = None
_UNDECIDED: Final[dict[str, Any]] = {
    **{figure.key: None for figure in CERTAINTY if figure.key not in COUNTS},
    "doubts": (),
}


def _certainty_figures(cycle: BusCycle, limits: Mapping[str, Number]) -> dict[str, Any]:
    """Figures of how sure the verdict is, by the names of `CapacityFigures`, without counts."""
    weighed = certainty(cycle)
    codes = {**limits, TIME: time_code(weighed, cycle.network)}
    return {
        **{
            key: None if number is None else existing(number)
            for key, number in certainty_numbers(weighed, cycle).items()
        },
        "not_shown": tuple(key for key, code in codes.items() if code == NOT_SHOWN_KEPT),
        "verdict": VERDICTS[int(verdict_code(codes))],
        "doubts": weighed.doubts,
    }


def certainty_numbers(weighed: Certainty, cycle: BusCycle) -> dict[str, Number | None]:
    """Figures of how sure the verdict is that follow by operators alone.

    Parameters
    ----------
    weighed
        The certainty of the cycle. Its numbers may be of any sort.
    cycle
        The cycle under the timing model that decides.
    """
    if not cycle.network.groups:
        return {figure.key: None for figure in (BIAS, MARGIN_CORRECTED, UNCERTAINTY, SAFE_REQUIRED, SAFE_MIN_PERIOD)}
    return {
        "bias_us": weighed.bias_us,
        "margin_corrected_us": weighed.margin_corrected_us,
        "uncertainty_us": weighed.known_uncertainty_us,
        "safe_required_us": weighed.safe_required_us,
        "safe_min_period_us": shortest_period_us(cycle.network, weighed.safe_required_us, is_shown=True),
    }


_OF_CYCLE: Final = (
    "period_us",
    "available_us",
    "required_us",
    "time_slice_us",
    "required_time_slice_us",
    "utilisation",
    "margin_us",
    "min_period_us",
    "min_slice_ratio",
)
"""Figures that a network without a cycle does not have."""


def numeric_figures(cycle: BusCycle) -> dict[str, Number]:
    """Figures of every kind of bus that follow from a cycle by operators alone.

    Parameters
    ----------
    cycle
        The cycle of the network's own number of nodes. Its numbers may be of any sort.

    Returns
    -------
    dict
        By the names of `CapacityFigures`; infinite what does not exist, as figures of a cycle without nodes.
    """
    if not cycle.network.groups:
        return {"nodes": 0, "axes": 0, **dict.fromkeys(_OF_CYCLE, inf)}
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
        "required_time_slice_us": required_time_slice_us(required_us, nodes=nodes),
        "utilisation": required_us / given_us,
        "margin_us": margin_us(required_us, available_us=given_us),
        "min_period_us": shortest_period_us(network, required_us),
        "min_slice_ratio": required_us / period_us,
    }


def margin_us(required_us: Number, *, available_us: Number) -> Number:
    """What a cycle leaves of its share of the period [us]."""
    spare_us = available_us - required_us
    # What fits by rounding alone has no margin, and no negative one either.
    fits = fits_in(required_us, available_us=available_us)
    return choose(spare_us < 0, choose(fits, 0.0, spare_us), spare_us)


def shortest_period_us(network: Network, needed_us: Number, *, is_shown: bool = False) -> Number:
    """The shortest period that the bus allows and that is long enough for a cycle; infinite where there is none [us].

    Parameters
    ----------
    network
        The network; its own period plays no part. Its numbers may be of any sort.
    needed_us
        Time that the cycle needs [us].
    is_shown
        Whether limits must be shown to be kept; otherwise the uncertainty of their values plays no part.
    """
    bus = bus_of(network.profile)
    period_us = bus.periods.from_us(needed_us / network.slice_ratio)
    for limit in bus.limits:
        if limit.period is not None:
            period_us = larger(
                period_us, bus.periods.from_us((limit.shown if is_shown else limit.nominal).period_us(network))
            )
    return period_us


def after_reset(profile: Profile, deciding: CapacityFigures) -> CapacityFigures | None:
    """Figures of a network after a bus reset; None unless it is shown to fit now and not after the reset.

    Parameters
    ----------
    profile
        The network.
    deciding
        Its figures under the model that decides.
    """
    changes = bus_of(profile).safety.after_reset
    if deciding.verdict != FITS or not changes:
        return None
    reset = override(profile, dict(changes))
    if reset == profile:
        return None
    after = figures(reset, model=deciding.timing_model)
    return None if after.verdict == FITS else after
