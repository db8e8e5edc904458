"""The cheapest change of a profile that makes it fit, or that makes room for more nodes.

Changes are tried from the cheapest: the gap count is one register in each node, the slice ratio is computing time
of the host, the period is what the machine is for. Each is put into the profile and computed again: what is
advised has been seen to work, and its gap count is safe for the nodes it is advised for.
"""

from collections.abc import Iterator, Sequence
from math import ceil
from typing import Final, NamedTuple

from busplan.analysis.capacity.cycle import broken_limits, cycle
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.capacity.node_limit import largest_nodes
from busplan.buses.ieee1394.constants import MAX_HOPS, MAX_NODES, MAX_PAYLOAD_BYTES, safe_gap_count
from busplan.buses.ieee1394.timing import TimingModelName
from busplan.errors import BusplanError
from busplan.profile.model import Profile
from busplan.profile.toml import override

Value = int | float | str

RATIO_STEPS: Final = 10_000
"""A slice ratio is advised in steps of 0.0001, a period in steps of 1 us, always rounded to the safe side."""
MAX_ADVISED_RATIO: Final = 0.9
"""No larger slice ratio is advised: the host computes in what communication leaves of the period. Chosen."""
_SMALLEST_SHARE: Final = 1e-6
"""Below it there is no cure, as a slice ratio has no smaller value; what is divided by it stays finite."""


class Change(NamedTuple):
    """A change of a profile, and what it brings."""

    changes: dict[str, Value]
    """New value by dotted key."""
    nodes: int
    """Nodes that the change is made for."""
    figures: CapacityFigures
    """The capacity after it, under the model it is made for that leaves the least."""


def change_to_fit(profile: Profile, *, models: Sequence[TimingModelName]) -> Change | None:
    """Find the cheapest change after which a profile fits under every one of some timing models.

    Parameters
    ----------
    profile
        A network that does not fit under one of them, or whose gap count is unsafe.
    models
        Timing models.

    Returns
    -------
    Change
        None when no single kind of change does.
    """
    return next(changes_to_fit(profile, models=models), None)


def changes_to_fit(profile: Profile, *, models: Sequence[TimingModelName]) -> Iterator[Change]:
    """Find every kind of change after which a profile fits under every one of some timing models.

    Parameters
    ----------
    profile
        The network.
    models
        Timing models.

    Yields
    ------
    Change
        The cheapest first; no change at all when the profile fits and its gap count is safe.
    """
    cures = structural_cures(profile)
    nodes = int(cures.get("bus.nodes", profile.bus.nodes))
    try:
        cured = override(profile, dict(cures))
    except BusplanError:  # a payload that the bus could carry and the execution table does not know
        return
    for cure in ({}, *_time_cures(cured, nodes, models)):
        after = _after(profile, {**cures, **cure}, models=models)
        # A cable that the gap-count table does not hold for has no safe gap count to advise.
        if after and all(one.fits and one.gap_count_safe for one in after):
            yield Change({**cures, **cure}, nodes, min(after, key=lambda one: one.margin_us))


def change_for_more(profile: Profile, *, model: TimingModelName) -> Change | None:
    """Find the cheapest change after which a fitting profile's period carries more nodes.

    Parameters
    ----------
    profile
        A network that fits.
    model
        Timing model.

    Returns
    -------
    Change
        None when time is not what limits the nodes, or no single kind of change does.
    """
    now = figures(profile, model=model)
    if now.limited_by != "time":
        return None
    best = _largest_by_gap_count(profile, model=model)
    if best > now.max_nodes:
        gap_count = safe_gap_count(profile.bus.hops(best))
        after = _after(profile, {"bus.gap_count": gap_count}, models=[model])
        if after and after[0].max_nodes >= best:
            return Change({"bus.gap_count": gap_count}, best, after[0])
    nodes = now.max_nodes + 1
    if profile.bus.gap_count_for(nodes) < safe_gap_count(profile.bus.hops(nodes)):
        # A gap count that is right for fewer nodes must not carry more.
        return None
    for cure in _time_cures(profile, nodes, [model]):
        after = _after(profile, cure, models=[model])
        if after and after[0].max_nodes >= nodes:
            return Change(cure, nodes, after[0])
    return None


def change_for_room(profile: Profile, *, model: TimingModelName, nodes: int, utilisation: float = 1.0) -> Change | None:
    """Find the cheapest change after which a bus carries some nodes, and its own use no more than a share of the slice.

    Parameters
    ----------
    profile
        A network that keeps the standard's own limits.
    model
        Timing model.
    nodes
        Nodes that the period must carry [1].
    utilisation
        Share of the slice that they may use, 0..1 [1].

    Returns
    -------
    Change
        None when no single kind of change does.
    """
    if utilisation < _SMALLEST_SHARE:
        return None
    for cure in _time_cures(profile, nodes, [model], share=utilisation):
        after = _after(profile, cure, models=[model])
        if after and after[0].max_nodes >= nodes and after[0].utilisation <= utilisation:
            return Change(cure, nodes, after[0])
    return None


def structural_cures(profile: Profile) -> dict[str, Value]:
    """The nearest values that keep the standard's own limits and a safe gap count, for each that a profile breaks."""
    cures: dict[str, Value] = {}
    bus, payload = profile.bus, profile.payload
    limits = broken_limits(profile)
    if "payload" in limits:
        largest = max(payload.read_bytes, payload.write_bytes)
        faster = [speed for speed, limit in MAX_PAYLOAD_BYTES.items() if largest <= limit]
        if faster:
            cures["bus.speed"] = faster[0]
        else:
            most = bus.max_payload_bytes
            cures |= {f"payload.{key}": most for key in ("read_bytes", "write_bytes") if getattr(payload, key) > most}
    if "nodes" in limits:
        cures["bus.nodes"] = int(MAX_NODES)
    if "hops" in limits:
        cures["bus.max_hops"] = int(MAX_HOPS)
    hops = int(cures.get("bus.max_hops", bus.hops(bus.nodes)))
    if bus.cable_is_standard and bus.gap_count_for(bus.nodes) < safe_gap_count(hops):
        cures["bus.gap_count"] = safe_gap_count(hops)
    return cures


def _largest_by_gap_count(profile: Profile, *, model: TimingModelName) -> int:
    """Largest number of nodes with the gap count that is safe for just them; 0 where the table does not hold."""
    if not profile.bus.cable_is_standard:
        return 0
    return largest_nodes(override(profile, {"bus.gap_count": "optimal"}), model=model)[0]


def _time_cures(
    profile: Profile, nodes: int, models: Sequence[TimingModelName], *, share: float = 1.0
) -> Iterator[dict[str, Value]]:
    """Changes that win time for that many nodes to use a share of the slice, the cheapest first."""
    bus = profile.bus
    gap_cure: dict[str, Value] = {}
    safe = safe_gap_count(bus.hops(nodes))
    if bus.cable_is_standard and bus.gap_count_for(nodes) > safe:
        gap_cure = {"bus.gap_count": safe}
        yield gap_cure
    # A wider slice alone, then with the gap count: one key is a smaller change than two.
    for before in ({}, gap_cure) if gap_cure else ({},):
        required_us = _required_us(override(profile, dict(before)), nodes, models) / share
        ratio = ceil(required_us / profile.cycle.period_us * RATIO_STEPS) / RATIO_STEPS
        if ratio <= MAX_ADVISED_RATIO:
            yield {**before, "cycle.slice_ratio": ratio}
    for before in ({}, gap_cure) if gap_cure else ({},):
        required_us = _required_us(override(profile, dict(before)), nodes, models) / share
        yield {**before, "cycle.period_us": ceil(required_us / profile.cycle.slice_ratio)}


def _required_us(profile: Profile, nodes: int, models: Sequence[TimingModelName]) -> float:
    return max(cycle(profile, model=model, nodes=nodes).required_us for model in models)


def _after(profile: Profile, changes: dict[str, Value], *, models: Sequence[TimingModelName]) -> list[CapacityFigures]:
    """Capacity after some changes under each model; empty where the profile's schema refuses them."""
    try:
        changed = override(profile, dict(changes))
    except BusplanError:
        return []
    return [figures(changed, model=model) for model in models]
