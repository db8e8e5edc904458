"""What a cycle needs, what its slice gives it, and the limits that it may break, for any kind of bus."""

from collections.abc import Callable
from typing import Final

from busplan.buses.cycle import BusCycle
from busplan.buses.network import Network
from busplan.buses.parts import Limit
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import Number, within
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.profile import Profile

TIME: Final = "time"
"""Key of the limit that is none of the bus: the cycle takes longer than its slice."""


def cycle_of(profile: Profile, *, model: str, nodes: int | None = None) -> BusCycle:
    """The cycle of a profile under a timing model.

    Parameters
    ----------
    profile
        The network.
    model
        Timing model.
    nodes
        Nodes on the bus [1]; without it the profile's own number.
    """
    network = network_of(profile)
    return bus_of(profile).cycle(network if nodes is None else network.with_nodes(nodes), model=model)


def available_us(network: Network) -> Number:
    """Share of the period that is for communication, alpha T_s of (1) [us]."""
    return time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)


def fits_in(required_us: Number, *, available_us: Number) -> Number:
    """Tell whether a cycle fits its share of the period; one that fills it exactly does.

    Examples
    --------
    >>> fits_in(0.1 + 0.2, available_us=0.3)
    True
    """
    return within(required_us, available_us)


def limits_with_time(network: Network, *, model: str) -> tuple[Limit, ...]:
    """The limits of closed forms: those of a network's kind of bus, without safety and doubts, and time the last."""
    bus = bus_of(network.profile)
    time = time_limit(lambda one: bus.cycle(one, model=model).most_required_us)
    return (*(limit.nominal for limit in bus.limits if not limit.is_safety), time)


def time_limit(needed_us: Callable[[Network], Number]) -> Limit:
    """The limit of time: what a network needs [us] against its share of the period."""
    return Limit(
        TIME,
        "{value:.3f} us needed of {most:.3f} us",
        needed_us,
        available_us,
        failure="required_us",
    )
