"""Capacity of a bus: does the cycle fit its period, with what margin, and how many nodes does it carry?"""

from bisect import bisect_left
from collections.abc import Sequence
from itertools import chain
from math import floor
from typing import Any, Final, Literal, NamedTuple

from busplan import equations
from busplan.analysis.latency import BOTH_MODELS, phases
from busplan.ieee1394 import MAX_HOPS, MAX_NODES, gap_count_by_hops
from busplan.profile.bus import Ieee1394Bus
from busplan.profile.model import Profile
from busplan.profile.toml import override
from busplan.timing import Phases, TimingModelName

Limit = Literal["time", "hops", "nodes", "payload"]
Term = Literal["arbitration", "data", "acknowledge", "execution", "gaps", "sync", "nonperiodic"]

FIT_ROUNDING: Final = 1e-12
"""Relative allowance for the rounding of floats, so that a cycle that fills its slice exactly fits it. It is a
billionth of a crystal's tolerance and buys no time."""


class Cycle(NamedTuple):
    """One communication cycle with a given number of nodes."""

    nodes: int
    read: Phases
    write: Phases
    sync_us: float
    """CTS of (2)."""
    nonperiodic_us: float
    """T_npd of (2)."""

    @property
    def reads_us(self) -> float:
        """T_r of (2): all read transactions with their gaps."""
        return self.nodes * self.read.latency_with_gaps_us

    @property
    def writes_us(self) -> float:
        """T_w of (2): all write transactions with their gaps."""
        return self.nodes * self.write.latency_with_gaps_us

    @property
    def required_us(self) -> float:
        """What the whole cycle needs: N times (2)."""
        return self.reads_us + self.writes_us + self.nonperiodic_us + self.sync_us

    def terms_us(self) -> dict[Term, float]:
        """Take the required time apart; the parts add up to it."""
        both = (self.read, self.write)
        return {
            "arbitration": self.nodes * sum(2 * half.arbitration_us for half in both),
            "data": self.nodes * sum(half.request_data_us + half.response_data_us for half in both),
            "acknowledge": self.nodes * sum(2 * half.acknowledge_us for half in both),
            "execution": self.nodes * sum(half.execution_us for half in both),
            "gaps": self.nodes * sum(half.gaps_us for half in both),
            "sync": self.sync_us,
            "nonperiodic": self.nonperiodic_us,
        }


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


def fits_in(required_us: float, *, available_us: float) -> bool:
    """Tell whether a cycle fits its share of the period; one that fills it exactly does.

    Examples
    --------
    >>> fits_in(0.1 + 0.2, available_us=0.3)
    True
    """
    return required_us <= available_us * (1 + FIT_ROUNDING)


def cycle(profile: Profile, *, model: TimingModelName, nodes: int, payload_bytes: int | None = None) -> Cycle:
    """Put a cycle together, with any number of nodes on the profile's bus.

    Parameters
    ----------
    profile
        The network.
    model
        Timing model.
    nodes
        Nodes on the bus, 1 or more [1].
    payload_bytes
        Payload of read and write alike [bytes]; without it the profile's own of each.
    """
    read_bytes, write_bytes = (
        (profile.payload.read_bytes, profile.payload.write_bytes)
        if payload_bytes is None
        else (payload_bytes, payload_bytes)
    )
    return Cycle(
        nodes=nodes,
        read=phases(profile, "read", model=model, payload_bytes=read_bytes, nodes=nodes),
        write=phases(profile, "write", model=model, payload_bytes=write_bytes, nodes=nodes),
        sync_us=profile.cycle.sync.sync_us(nodes),
        nonperiodic_us=profile.cycle.nonperiodic_us,
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


def available_us(profile: Profile) -> float:
    """Share of the period that is for communication, alpha T_s of (1) [us]."""
    return profile.cycle.slice_ratio * profile.cycle.period_us


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


def limits_broken(profile: Profile) -> dict[Limit, bool]:
    """Whether a profile breaks each of the standard's own limits, whatever the time; arrays broadcast."""
    bus, payload = profile.bus, profile.payload
    most_bytes = bus.max_payload_bytes
    return {
        "payload": (payload.read_bytes > most_bytes) | (payload.write_bytes > most_bytes),
        "nodes": bus.nodes > MAX_NODES,
        "hops": bus.hops(bus.nodes) > MAX_HOPS,
    }


def broken_limits(profile: Profile) -> tuple[Limit, ...]:
    """Tell which of the standard's own limits a profile breaks, whatever the time."""
    return tuple(limit for limit, is_broken in limits_broken(profile).items() if is_broken)


def most_nodes(bus: Ieee1394Bus) -> tuple[int, Limit]:
    """Nodes that the standard allows on a bus, whatever the time, and the limit that says so."""
    return (int(min(MAX_NODES, MAX_HOPS)), "hops") if bus.max_hops is None else (int(MAX_NODES), "nodes")


def largest_nodes(profile: Profile, *, model: TimingModelName) -> tuple[int, Limit]:
    """Find the largest number of nodes that fits the profile's period, and what keeps it from being larger.

    Required time is c0 + c1 N + c2 N^2: in a chain each packet crosses N hops, and there are N transactions of
    each kind; in a tree the hops stay, and c2 is zero. The root is the answer but for rounding, which the test of
    its neighbours takes out. An "optimal" gap count in a chain grows with N by the table, and the required time with
    both; there the at most 16 rows are halved until one is left.

    Parameters
    ----------
    profile
        The network; its own number of nodes plays no part.
    model
        Timing model.

    Returns
    -------
    tuple
        Number of nodes [1], and the limit.

    References
    ----------
    Paper, equations (1)-(11), with (11) solved for N.
    """
    bus = profile.bus
    is_chain = bus.max_hops is None
    if limits_broken(profile)["payload"]:
        return 0, "payload"
    if not is_chain and bus.hops(1) > MAX_HOPS:
        return 0, "hops"
    most, structural = most_nodes(bus)
    given_us = available_us(profile)

    def fits(nodes: int) -> bool:
        return fits_in(cycle(profile, model=model, nodes=nodes).required_us, available_us=given_us)

    if is_chain and bus.gap_count == "optimal":
        answer = bisect_left(range(1, most + 1), x=True, key=lambda nodes: not fits(nodes))
    else:
        answer = min(most, floor(required_by_nodes(profile, model=model).nodes(given_us)) + 1)
        while answer and not fits(answer):
            answer -= 1
    return answer, structural if answer == most else "time"


class RequiredByNodes(NamedTuple):
    """Required time over the number of nodes, c0 + c1 N + c2 N^2, with a gap count that is fixed."""

    c0_us: float
    c1_us: float
    c2_us: float

    def nodes(self, available_us: float) -> float:
        """Largest real N whose cycle fits, but for rounding; 0 when there is none. Arrays broadcast."""
        spare_us = available_us - self.c0_us
        spare_us = spare_us * (spare_us > 0)
        # The form without cancellation: c2 may be zero, c1 is not. The power is an operator, and a root for arrays too.
        root: float = (self.c1_us * self.c1_us + 4 * self.c2_us * spare_us) ** 0.5
        return 2 * spare_us / (self.c1_us + root)


def required_by_nodes(profile: Profile, *, model: TimingModelName) -> RequiredByNodes:
    """Required time as a polynomial of the number of nodes; arrays broadcast."""
    # One and two nodes, and the cycle of none, give the three coefficients through the equations themselves.
    one, two = (cycle(profile, model=model, nodes=nodes) for nodes in (1, 2))
    latencies_one = one.read.latency_with_gaps_us + one.write.latency_with_gaps_us
    latencies_two = two.read.latency_with_gaps_us + two.write.latency_with_gaps_us
    sync_per_node_us = two.sync_us - one.sync_us
    c2 = latencies_two - latencies_one
    return RequiredByNodes(
        c0_us=one.nonperiodic_us + one.sync_us - sync_per_node_us,
        c1_us=latencies_one - c2 + sync_per_node_us,
        c2_us=c2,
    )
