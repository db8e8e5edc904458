"""The smallest period that carries a machine, and the settings of a bus without which none does."""

from math import inf
from typing import Final, NamedTuple

from busplan.buses.bus import Bus
from busplan.buses.network import Network
from busplan.elementwise import plain, within
from busplan.forms.numbers import period
from busplan.profile.toml import override
from busplan.questions.fit.certainty import certainty
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.constraints import Changes, Need, keeps_limits, most_asking, shown
from busplan.questions.plan.freedoms import PERIOD, longest_period_us
from busplan.sections.base import MIN_STEP_US
from busplan.sections.profile import Profile

_MOST_TRIES: Final = 64
"""Each try keeps one more limit, so that a few are enough."""
_NEXT: Final = 1 + 1e-9
"""A limit that rounding alone breaks is kept a little later."""
_HALVINGS: Final = 40
"""A limit says from which slice on it is kept to a millionth."""


class SmallestPeriod(NamedTuple):
    """The smallest period at which a profile is shown to fit, of those that its bus allows."""

    us: float | None
    """None if there is none [us]."""
    why: str = ""
    """Why there is none."""


def smallest_period(profile: Profile) -> SmallestPeriod:
    """Find the smallest period at which a profile is shown to fit, on a bus that is set safely.

    Parameters
    ----------
    profile
        The network; its own period plays no part.
    """
    bus, ratio = bus_of(profile), profile.cycle.slice_ratio
    cycle = bus.cycle(network_of(profile), model=bus.deciding_model)
    short_us, found_us = 0.0, _known_us(bus, float(certainty(cycle).safe_required_us) / ratio)
    longest_us = longest_period_us(profile)
    for _ in range(_MOST_TRIES):
        if found_us > longest_us:
            break
        need = _need(profile, found_us)
        if need is None:
            return SmallestPeriod(_known_us(bus, _between(profile, short_us, found_us)))
        if need.period_us(ratio) == inf:
            return SmallestPeriod(None, need.why)
        short_us, found_us = found_us, _known_us(bus, max(need.period_us(ratio), found_us * _NEXT))
    return SmallestPeriod(None, f"it would be over {period(longest_us)}")


def _known_us(bus: Bus, least_us: float) -> float:
    """The shortest period of at least a time that a bus allows; infinite where there is none [us]."""
    return float(plain(bus.periods.from_us(max(MIN_STEP_US, least_us))))


def _need(profile: Profile, period_us: float) -> Need | None:
    """Need that a profile does not meet at a period; None where it is shown to fit."""
    network = network_of(override(profile, {PERIOD: period_us}))
    need = most_asking(shown(network), ratio=profile.cycle.slice_ratio)
    is_given = within(need.period_us(profile.cycle.slice_ratio), period_us)
    return None if is_given and keeps_limits(network) else need


def _between(profile: Profile, short_us: float, long_us: float) -> float:
    """The smallest period between one that is too short, or 0 if none was tried, and one that is long enough [us]."""
    for _ in range(_HALVINGS if short_us else 0):
        middle_us = (short_us + long_us) / 2
        if _need(profile, middle_us) is None:
            long_us = middle_us
        else:
            short_us = middle_us
    return long_us


def needed_settings(profile: Profile) -> Changes:
    """The cheapest setting of the bus with which some slice carries the network, where none does now.

    Parameters
    ----------
    profile
        The network.

    Returns
    -------
    dict
        New value by dotted key; empty where none is needed, or none is enough.
    """
    network = network_of(profile)
    if _is_carried(network):
        return {}
    settings = sorted(bus_of(profile).settings(network), key=lambda setting: setting.cost)
    changes = (dict(values) for setting in settings for values in setting.values)
    return next((change for change in changes if _is_carried(network_of(override(profile, dict(change))))), {})


def _is_carried(network: Network) -> bool:
    """Whether some period carries a network."""
    return all(need.period_us(1.0) < inf for need in shown(network))
