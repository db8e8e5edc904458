"""Settings of a bus without which no period carries a machine."""

from math import inf

from busplan.buses.network import Network
from busplan.profile.toml import override
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.constraints import shown
from busplan.questions.plan.machine import Changes
from busplan.sections.profile import Profile


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
    each = sorted(bus_of(profile).settings(network), key=lambda setting: setting.cost)
    changes = (dict(values) for setting in each for values in setting.values)
    return next((one for one in changes if _is_carried(network_of(override(profile, dict(one))))), {})


def _is_carried(network: Network) -> bool:
    """Whether some period carries a network."""
    return all(need.period_us(1.0) < inf for need in shown(network))
