"""The cheapest change after which a profile is shown to fit, or that makes room for more nodes.

Changes are tried from the cheapest on: settings of the bus; the slice ratio, which costs computing time of the host;
the period, which costs performance of the machine. Each is put into the profile and computed again, so that advice is
known to work and to be safe for its number of nodes.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import Final, NamedTuple

from busplan.analysis.capacity.certainty import FITS, certainty
from busplan.analysis.capacity.cycle import TIME, available_us, cycle_of, fits_in
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.capacity.node_limit import safe_nodes
from busplan.analysis.network import bus_of, network_of
from busplan.buses.bus import Value
from busplan.errors import BusplanError
from busplan.profile.toml import override
from busplan.sections.base import MAX_COUNT
from busplan.sections.profile import Profile

RATIO_STEPS: Final = 10_000
"""A slice ratio is advised in steps of 0.0001 and a period in steps of 1 us, both rounded to the safe side."""
MAX_ADVISED_RATIO: Final = 0.9
"""Largest slice ratio advised: the host computes in the rest of the period. Chosen."""
_SMALLEST_SHARE: Final = 1e-6
"""Smallest share of the slice to find a cure for: the smallest slice ratio. It keeps quotients finite."""


def changeable(profile: Profile, *, structure: bool = True) -> tuple[str, ...]:
    """Names of what may be changed in a network, the cheapest first.

    Parameters
    ----------
    profile
        The network.
    structure
        If True, include changes that need new hardware.
    """
    bus = bus_of(profile)
    settings = (setting.label for setting in bus.settings(network_of(profile)))
    return (*settings, "slice ratio", "period", *(bus.structural_changes if structure else ()))


def listed(words: Sequence[str], last: str) -> str:
    """Write a list in words.

    Examples
    --------
    >>> listed(("speed", "slice ratio", "period"), "or")
    'speed, slice ratio or period'
    """
    *before, end = words
    return f"{', '.join(before)} {last} {end}" if before else end


class Change(NamedTuple):
    """A change of a profile, and its effect."""

    changes: dict[str, Value]
    """New value by dotted key."""
    nodes: int
    """Nodes that the change is made for."""
    figures: CapacityFigures
    """The capacity after it, under the model that decides."""


def change_to_fit(profile: Profile) -> Change | None:
    """Find the cheapest change after which a profile is shown to fit on a bus that is set safely.

    Parameters
    ----------
    profile
        A network that is not shown to fit, or that is unsafe.

    Returns
    -------
    Change
        None if no single kind of change is enough.
    """
    return next(changes_to_fit(profile), None)


def changes_to_fit(profile: Profile) -> Iterator[Change]:
    """Find every kind of change after which a profile is shown to fit on a bus that is set safely.

    Parameters
    ----------
    profile
        The network.

    Yields
    ------
    Change
        The cheapest first; an empty change if the profile fits and is safe already.
    """
    cures = bus_of(profile).repairs(network_of(profile))
    nodes = int(cures.get("bus.nodes", network_of(profile).nodes))
    try:
        cured = override(profile, dict(cures))
    except BusplanError:  # the bus could carry the payload, but the execution table does not have it
        return
    for cure in ({}, *_time_cures(cured, nodes)):
        after = _after(profile, {**cures, **cure})
        if after is not None and after.verdict == FITS and after.safe:
            yield Change({**cures, **cure}, nodes, after)


def change_for_more(profile: Profile, *, now: CapacityFigures | None = None) -> Change | None:
    """Find the cheapest change after which a fitting profile's period carries more safe nodes.

    Parameters
    ----------
    profile
        A network that fits.
    now
        Its figures under the model that decides, where they have been computed.

    Returns
    -------
    Change
        None when neither time nor a setting limits the nodes, or no single kind of change does.
    """
    bus = bus_of(profile)
    most, limit = safe_nodes(profile) if now is None else (now.safe_nodes or 0, now.safe_limited_by or TIME)
    bound = bus.limit(limit)
    if bound is not None and not bound.is_safety:
        return None
    best, setting = _best_setting(profile)
    if best > most:
        after = _after(profile, setting)
        if after is not None and _carries(after, best):
            return Change(setting, best, after)
    nodes = most + 1
    if not bus.is_safe(network_of(profile).with_nodes(nodes)):
        # What is safe for fewer nodes must not carry more.
        return None
    for cure in _time_cures(profile, nodes):
        after = _after(profile, cure)
        if after is not None and _carries(after, nodes):
            return Change(cure, nodes, after)
    return None


def change_for_room(profile: Profile, *, nodes: int, utilisation: float = 1.0) -> Change | None:
    """Find the cheapest change after which a bus carries some safe nodes, and its own take a share of the slice.

    Parameters
    ----------
    profile
        A network that keeps the limits of its bus.
    nodes
        Nodes that the period must carry [1].
    utilisation
        Share of the slice that the profile's own nodes may use, 0..1 [1].

    Returns
    -------
    Change
        None if no single kind of change is enough.
    """
    if utilisation < _SMALLEST_SHARE:
        return None
    for cure in _time_cures(profile, nodes, share=utilisation):
        after = _after(profile, cure)
        if after is not None and _carries(after, nodes) and after.utilisation <= utilisation:
            return Change(cure, nodes, after)
    return None


def _carries(after: CapacityFigures, nodes: int) -> bool:
    return after.safe_nodes is not None and after.safe_nodes >= nodes


def safe_required_us(profile: Profile, *, nodes: int | None = None) -> float:
    """What the slice must give for a cycle to be shown to fit, with the reserve [us].

    Parameters
    ----------
    profile
        The network.
    nodes
        Nodes on the bus [1]; without it the profile's own number.
    """
    cycle = cycle_of(profile, model=bus_of(profile).deciding_model, nodes=nodes)
    return float(certainty(cycle).safe_required_us)


def _best_setting(profile: Profile) -> tuple[int, dict[str, Value]]:
    """The most nodes that one setting of the bus carries with a value that is safe for just them, and that value."""
    bus, network = bus_of(profile), network_of(profile)
    given_us = available_us(network)

    def fitting(nodes: int) -> dict[str, Value] | None:
        as_it_is: list[dict[str, Value]] = [{}] if bus.is_safe(network.with_nodes(nodes)) else []
        for setting in (*as_it_is, *_settings(profile, nodes)):
            needed_us = safe_required_us(override(profile, dict(setting)), nodes=nodes)
            if fits_in(needed_us, available_us=given_us):
                return setting
        return None

    # Time grows with the nodes, so the numbers that fit come first.
    best = bisect_right(range(1, _ceiling(profile) + 1), x=False, key=lambda nodes: fitting(nodes) is None)
    return best, (fitting(best) or {}) if best else {}


def _settings(profile: Profile, nodes: int) -> list[dict[str, Value]]:
    """Values of the settings of the bus that are safe for a number of nodes, the cheapest change first."""
    settings = bus_of(profile).settings(network_of(profile).with_nodes(nodes))
    return [{setting.key: value} for setting in settings for value in setting.values]


def _ceiling(profile: Profile) -> int:
    """Most nodes within the limits of the bus, ignoring time."""
    network, bus = network_of(profile), bus_of(profile)

    def is_over(nodes: int) -> bool:
        return bool(bus.broken(network.with_nodes(nodes)))

    most = 1
    while most < MAX_COUNT and not is_over(most):
        most *= 2
    return bisect_right(range(1, most + 1), x=False, key=is_over)


def _time_cures(profile: Profile, nodes: int, *, share: float = 1.0) -> Iterator[dict[str, Value]]:
    """Changes that win time for that many nodes to use a share of the slice, the cheapest first."""

    def needed_us(setting: Mapping[str, Value]) -> float:
        return _needed_us(override(profile, dict(setting)), nodes, share)

    own_us = needed_us({})
    settings = [one for one in _settings(profile, nodes) if needed_us(one) < own_us]
    yield from settings
    # First a larger slice alone, then with a setting: one changed key is cheaper than two.
    for before in ({}, *settings):
        ratio = ceil(needed_us(before) / profile.cycle.period_us * RATIO_STEPS) / RATIO_STEPS
        if ratio <= MAX_ADVISED_RATIO:
            yield {**before, "cycle.slice_ratio": ratio}
    for before in ({}, *settings):
        yield {**before, "cycle.period_us": ceil(needed_us(before) / profile.cycle.slice_ratio)}


def _needed_us(profile: Profile, nodes: int, share: float) -> float:
    """What the slice must give: to be shown to fit, and to use no more than a share of it [us]."""
    shown_us = safe_required_us(profile, nodes=nodes)
    if share >= 1:
        return shown_us
    cycle = cycle_of(profile, model=bus_of(profile).deciding_model, nodes=nodes)
    return max(shown_us, float(cycle.required_us) / share)


def _after(profile: Profile, changes: dict[str, Value]) -> CapacityFigures | None:
    """Capacity after some changes under the model that decides; None where the profile's schema refuses them."""
    try:
        changed = override(profile, dict(changes))
    except BusplanError:
        return None
    return figures(changed, model=bus_of(changed).deciding_model)
