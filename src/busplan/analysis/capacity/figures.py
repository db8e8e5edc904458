"""Capacity of a bus: does the cycle fit its period, with what margin, and how many nodes does it carry?"""

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

from busplan.analysis.capacity.cycle import Cycle, Limit, Term, available_us, broken_limits, cycle, fits_in
from busplan.analysis.capacity.node_limit import largest_nodes
from busplan.analysis.latency import BOTH_MODELS
from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import gap_count_by_hops
from busplan.buses.ieee1394.timing import TimingModelName
from busplan.profile.model import Profile
from busplan.profile.toml import override


class CapacityFigures(NamedTuple):
    """Capacity at one period under one timing model; what each figure is stands in `busplan.analysis.quantities`."""

    timing_model: TimingModelName
    period_us: float
    nodes: int
    axes: int
    hops: int
    gap_count: int
    safe_gap_count: int
    gap_count_safe: bool
    available_us: float
    required_us: float
    time_slice_us: float
    required_time_slice_us: float
    read_latency_us: float
    write_latency_us: float
    gaps_us: float
    subaction_gap_us: float
    arbitration_reset_gap_us: float
    sync_us: float
    nonperiodic_us: float
    cycle_arbitration_us: float
    cycle_data_us: float
    cycle_acknowledge_us: float
    cycle_execution_us: float
    cycle_gaps_us: float
    binding_term: Term
    utilisation: float
    margin_us: float
    nodes_eq11: float
    max_nodes: int
    max_axes: int
    limited_by: Limit
    min_period_us: float
    min_slice_ratio: float
    exceeded: tuple[Limit, ...]
    fits: bool


class Capacity(NamedTuple):
    """Answer of `capacity`: the profile as it was analysed, and the figures of each period, a set a model."""

    profile: Profile
    periods: tuple[tuple[CapacityFigures, ...], ...]

    @property
    def results(self) -> tuple[CapacityFigures, ...]:
        """All sets of figures in one row."""
        return tuple(chain.from_iterable(self.periods))


def capacity(
    profile: Profile,
    *,
    periods_us: Sequence[float] | None = None,
    timing_models: Sequence[TimingModelName] = BOTH_MODELS,
) -> Capacity:
    """Tell whether the cycle fits its period, and how many nodes would.

    Parameters
    ----------
    profile
        The network.
    periods_us
        Communication periods T_s [us]; without them the profile's own.
    timing_models
        Which timing models, in this order.

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
    periods = [profile.cycle.period_us] if periods_us is None else periods_us
    variants = [
        override(profile, {"cycle.period_us": period}, origin={"cycle.period_us": "period"}) for period in periods
    ]
    return Capacity(
        profile,
        tuple(tuple(figures(variant, model=model) for model in timing_models) for variant in variants),
    )


def figures(profile: Profile, *, model: TimingModelName) -> CapacityFigures:
    """Compute all figures of a profile at its own period under one timing model."""
    now = cycle(profile, model=model, nodes=profile.bus.nodes)
    numbers = numeric_figures(profile, now)
    terms_us = now.terms_us()
    max_nodes, limited_by = largest_nodes(profile, model=model)
    fits_time = fits_in(now.required_us, available_us=available_us(profile))
    exceeded = broken_limits(profile) + (() if fits_time else ("time",))
    return CapacityFigures(
        timing_model=model,
        **numbers,
        binding_term=max(terms_us, key=lambda term: terms_us[term]),
        max_nodes=max_nodes,
        max_axes=profile.node.axes * max_nodes,
        limited_by=limited_by,
        exceeded=exceeded,
        fits=not exceeded,
    )


def numeric_figures(profile: Profile, now: Cycle) -> dict[str, Any]:
    """Figures that follow from a cycle by operators alone.

    Parameters
    ----------
    profile
        The network. Its keys may hold arrays that broadcast (see `sweep`), and so may the cycle's.
    now
        The cycle of its own number of nodes.

    Returns
    -------
    dict
        By the names of `CapacityFigures`; all but words, `max_nodes`, `max_axes` and `fits`.
    """
    bus, period_us, nodes = profile.bus, profile.cycle.period_us, now.nodes
    hops, gap_count = bus.hops(nodes), bus.gap_count_for(nodes)
    safe = gap_count_by_hops(hops)
    given_us, required_us, terms_us = available_us(profile), now.required_us, now.terms_us()
    spare_us = given_us - required_us
    fits = fits_in(required_us, available_us=given_us)
    return {
        "period_us": period_us,
        "nodes": nodes,
        "axes": profile.node.axes * nodes,
        "hops": hops,
        "gap_count": gap_count,
        "safe_gap_count": safe,
        "gap_count_safe": gap_count >= safe,
        "available_us": given_us,
        "required_us": required_us,
        "time_slice_us": equations.time_slice_us(period_us, slice_ratio=profile.cycle.slice_ratio, nodes=nodes),
        "required_time_slice_us": equations.required_time_slice_us(
            now.reads_us,
            writes_us=now.writes_us,
            nonperiodic_us=now.nonperiodic_us,
            sync_us=now.sync_us,
            nodes=nodes,
        ),
        "read_latency_us": now.read.latency_us,
        "write_latency_us": now.write.latency_us,
        "gaps_us": now.read.gaps_us,
        "subaction_gap_us": now.read.subaction_gap_us,
        "arbitration_reset_gap_us": now.read.arbitration_reset_gap_us,
        "sync_us": now.sync_us,
        "nonperiodic_us": now.nonperiodic_us,
        "cycle_arbitration_us": terms_us["arbitration"],
        "cycle_data_us": terms_us["data"],
        "cycle_acknowledge_us": terms_us["acknowledge"],
        "cycle_execution_us": terms_us["execution"],
        "cycle_gaps_us": terms_us["gaps"],
        "utilisation": required_us / given_us,
        # What fits by rounding alone has no margin, and no negative one either.
        "margin_us": spare_us - fits * (spare_us < 0) * spare_us,
        "nodes_eq11": equations.published_nodes(
            given_us,
            sync_us=now.sync_us,
            latency_us=(now.read.latency_us + now.write.latency_us) / 2,
            gaps_us=now.read.gaps_us,
        ),
        "min_period_us": required_us / profile.cycle.slice_ratio,
        "min_slice_ratio": required_us / period_us,
    }
