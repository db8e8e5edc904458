"""The cheapest change of a profile that makes it fit, or that makes room for more nodes.

Changes are tried from the cheapest: the gap count is one register in each node, the slice ratio is computing time
of the host, the period is what the machine is for. Each is put into the profile and computed again: what is
advised has been seen to work.
"""

from collections.abc import Iterator
from math import ceil
from typing import NamedTuple

from busplan.analysis.capacity import CapacityFigures, broken_limits, cycle, figures
from busplan.errors import BusplanError
from busplan.ieee1394 import MAX_HOPS, MAX_NODES, safe_gap_count
from busplan.profile.model import Profile
from busplan.profile.toml import override
from busplan.timing import TimingModelName

_RATIO_STEPS = 10_000
"""A slice ratio is advised in steps of 0.0001, a period in steps of 1 us, always rounded to the safe side."""


class Change(NamedTuple):
    """A change of a profile, and what it brings."""

    changes: dict[str, int | float]
    """New value by dotted key."""
    figures: CapacityFigures
    """The capacity after it."""


def cheapest_change(profile: Profile, *, model: TimingModelName) -> Change | None:
    """Find the cheapest change of a profile for one timing model.

    Parameters
    ----------
    profile
        The network.
    model
        Timing model that decides.

    Returns
    -------
    Change
        If the profile does not fit: what makes it fit. If it fits and time limits its nodes: what makes room for
        more nodes. None when no single kind of change does.
    """
    now = figures(profile, model=model)
    if now.fits:
        if now.limited_by != "time":
            return None
        cures, nodes = {}, now.max_nodes + 1
    else:
        cures = structural_cures(profile)
        nodes = int(cures.get("bus.nodes", profile.bus.nodes))
    try:
        cured = override(profile, dict(cures))
        candidates = [cures, *({**cures, **cure} for cure in _time_cures(cured, nodes, model))]
    except BusplanError:  # a payload that the bus could carry and the execution table does not know
        return None
    for changes in candidates:
        after = _after(profile, changes, model=model)
        if after is not None and after.max_nodes >= nodes:
            return Change(changes, after)
    return None


def structural_cures(profile: Profile) -> dict[str, int | float]:
    """The nearest values that keep the standard's own limits, for each that a profile breaks."""
    cures: dict[str, int | float] = {}
    for limit in broken_limits(profile):
        if limit == "payload":
            most = profile.bus.max_payload_bytes
            for key in ("read_bytes", "write_bytes"):
                if getattr(profile.payload, key) > most:
                    cures[f"payload.{key}"] = most
        elif limit == "nodes":
            cures["bus.nodes"] = int(MAX_NODES)
        else:
            cures["bus.max_hops"] = int(MAX_HOPS)
    return cures


def _time_cures(profile: Profile, nodes: int, model: TimingModelName) -> Iterator[dict[str, int | float]]:
    """Changes that win time for that many nodes, the cheapest first."""
    bus = profile.bus
    safe = safe_gap_count(bus.hops(nodes))
    if bus.gap_count_for(nodes) > safe:
        yield {"bus.gap_count": safe}
    required_us = cycle(profile, model=model, nodes=nodes).required_us
    ratio = ceil(required_us / profile.cycle.period_us * _RATIO_STEPS) / _RATIO_STEPS
    if ratio <= 1:
        yield {"cycle.slice_ratio": ratio}
    yield {"cycle.period_us": ceil(required_us / profile.cycle.slice_ratio)}


def _after(profile: Profile, changes: dict[str, int | float], *, model: TimingModelName) -> CapacityFigures | None:
    """Capacity after some changes; None where the profile's schema refuses them."""
    try:
        return figures(override(profile, dict(changes)), model=model)
    except BusplanError:
        return None
