"""Find the cheapest change of a profile that makes it fit, or that makes room for more nodes.

Changes are tried from the cheapest on: settings of the bus; the slice ratio, which costs computing time of the host;
the period, which costs performance of the machine. Each is put into the profile and computed again, so that advice is
known to work and to be safe for its number of nodes.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from math import ceil
from typing import Final, NamedTuple

from busplan.analysis.capacity.cycle import TIME, available_us, cycle_of, fits_in
from busplan.analysis.capacity.figures import CapacityFigures, figures
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
    """Capacity after the change, under the model with the smallest margin."""


def change_to_fit(profile: Profile, *, models: Sequence[str]) -> Change | None:
    """Find the cheapest change after which a profile fits under all given timing models.

    Parameters
    ----------
    profile
        A network that does not fit under one of them, or is unsafe.
    models
        Timing models.

    Returns
    -------
    Change
        None if no single kind of change is enough.
    """
    return next(changes_to_fit(profile, models=models), None)


def changes_to_fit(profile: Profile, *, models: Sequence[str]) -> Iterator[Change]:
    """Find every kind of change after which a profile fits under all given timing models.

    Parameters
    ----------
    profile
        The network.
    models
        Timing models.

    Yields
    ------
    Change
        The cheapest first; an empty change if the profile fits and is safe already.
    """
    cures = bus_of(profile).repairs(network_of(profile))
    nodes = int(cures.get("bus.nodes", profile.bus.nodes))
    try:
        cured = override(profile, dict(cures))
    except BusplanError:  # the bus could carry the payload, but the execution table does not have it
        return
    for cure in ({}, *_time_cures(cured, nodes, models)):
        after = _after(profile, {**cures, **cure}, models=models)
        if after and all(one.fits and one.safe for one in after):
            yield Change({**cures, **cure}, nodes, min(after, key=lambda one: one.margin_us))


def change_for_more(profile: Profile, *, model: str) -> Change | None:
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
        None if time does not limit the nodes, or no single kind of change is enough.
    """
    now = figures(profile, model=model)
    if now.limited_by != TIME:
        return None
    best, setting = _best_setting(profile, model=model)
    if best > now.max_nodes:
        after = _after(profile, setting, models=[model])
        if after and after[0].max_nodes >= best:
            return Change(setting, best, after[0])
    nodes = now.max_nodes + 1
    if not bus_of(profile).is_safe(network_of(profile).with_nodes(nodes)):
        # The settings are not safe for more nodes.
        return None
    for cure in _time_cures(profile, nodes, [model]):
        after = _after(profile, cure, models=[model])
        if after and after[0].max_nodes >= nodes:
            return Change(cure, nodes, after[0])
    return None


def change_for_room(profile: Profile, *, model: str, nodes: int, utilisation: float = 1.0) -> Change | None:
    """Find the cheapest change after which a bus carries some nodes and uses at most a share of the slice.

    Parameters
    ----------
    profile
        A network within the limits of its bus.
    model
        Timing model.
    nodes
        Nodes that the period must carry [1].
    utilisation
        Share of the slice that they may use, 0..1 [1].

    Returns
    -------
    Change
        None if no single kind of change is enough.
    """
    if utilisation < _SMALLEST_SHARE:
        return None
    for cure in _time_cures(profile, nodes, [model], share=utilisation):
        after = _after(profile, cure, models=[model])
        if after and after[0].max_nodes >= nodes and after[0].utilisation <= utilisation:
            return Change(cure, nodes, after[0])
    return None


def _best_setting(profile: Profile, *, model: str) -> tuple[int, dict[str, Value]]:
    """The most nodes that one setting of the bus allows with a value that is safe for them, and that value."""
    bus, network = bus_of(profile), network_of(profile)
    given_us = available_us(network)

    def fitting(nodes: int) -> dict[str, Value] | None:
        as_it_is: list[dict[str, Value]] = [{}] if bus.is_safe(network.with_nodes(nodes)) else []
        for setting in (*as_it_is, *_settings(profile, nodes)):
            required_us = cycle_of(override(profile, dict(setting)), model=model, nodes=nodes).required_us
            if fits_in(required_us, available_us=given_us):
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


def _time_cures(
    profile: Profile, nodes: int, models: Sequence[str], *, share: float = 1.0
) -> Iterator[dict[str, Value]]:
    """Changes after which a number of nodes uses at most a share of the slice, the cheapest first."""
    own_us = _required_us(profile, nodes, models)
    settings = [
        one for one in _settings(profile, nodes) if _required_us(override(profile, dict(one)), nodes, models) < own_us
    ]
    yield from settings
    # First a larger slice alone, then with a setting: one changed key is cheaper than two.
    for before in ({}, *settings):
        required_us = _required_us(override(profile, dict(before)), nodes, models) / share
        ratio = ceil(required_us / profile.cycle.period_us * RATIO_STEPS) / RATIO_STEPS
        if ratio <= MAX_ADVISED_RATIO:
            yield {**before, "cycle.slice_ratio": ratio}
    for before in ({}, *settings):
        required_us = _required_us(override(profile, dict(before)), nodes, models) / share
        yield {**before, "cycle.period_us": ceil(required_us / profile.cycle.slice_ratio)}


def _required_us(profile: Profile, nodes: int, models: Sequence[str]) -> float:
    return max(float(cycle_of(profile, model=model, nodes=nodes).required_us) for model in models)


def _after(profile: Profile, changes: dict[str, Value], *, models: Sequence[str]) -> list[CapacityFigures]:
    """Capacity after some changes under each model; empty if the profile's schema refuses them."""
    try:
        changed = override(profile, dict(changes))
    except BusplanError:
        return []
    return [figures(changed, model=model) for model in models]
