"""The largest number of nodes that a bus carries, and what keeps it from being larger."""

from math import inf
from typing import NamedTuple

from busplan.analysis.capacity.cycle import limits_with_time
from busplan.analysis.capacity.polynomial import NODES, NoPolynomialError, Polynomial
from busplan.analysis.network import network_of
from busplan.buses.bus import Limit
from busplan.buses.network import Network
from busplan.elementwise import Number, choose, larger
from busplan.sections.base import MAX_COUNT
from busplan.sections.profile import Profile


class MostNodes(NamedTuple):
    """A largest number of nodes, and the place of its limit among `limits_with_time`; arrays broadcast."""

    nodes: Number
    limit: Number


def largest_nodes(profile: Profile, *, model: str) -> tuple[int, str]:
    """Find the largest number of nodes that fits the profile's period, and what keeps it from being larger.

    Parameters
    ----------
    profile
        The network; its own number of nodes plays no part.
    model
        Timing model.

    Returns
    -------
    tuple
        Number of nodes [1], and the key of the limit.

    References
    ----------
    Paper, equations (1)-(11), with (11) solved for N.
    """
    network = network_of(profile)
    most = most_nodes(network, model=model)
    return int(most.nodes), limits_with_time(network, model=model)[int(most.limit)].key


def most_nodes(network: Network, *, model: str) -> MostNodes:
    """Find the largest number of nodes within every limit; of equal answers the first limit gives its name.

    Each limit is asked alone, and asks the cycle itself: once, with a polynomial in the place of the number of nodes.
    One that is no polynomial is searched by halves, below what the others allow.

    Parameters
    ----------
    network
        Its own number of nodes plays no part. Its numbers may be arrays.
    model
        Timing model.
    """
    limits = limits_with_time(network, model=model)
    closed = [_in_closed_form(limit, network) for limit in limits]
    ceiling = int(min([MAX_COUNT, *(_greatest(one) for one in closed if one is not None)]))
    nodes: Number = None
    place: Number = 0
    for index, (limit, found) in enumerate(zip(limits, closed, strict=True)):
        most = _by_halves(limit, network, ceiling) if found is None else found
        if nodes is None:
            nodes = most
        else:
            less = most < nodes
            nodes, place = choose(less, most, nodes), choose(less, index, place)
    return MostNodes(nodes, place)


def _in_closed_form(limit: Limit, network: Network) -> Number | None:
    """The most nodes within one limit, infinite where they play no part; None where there is no closed form."""
    try:
        at = network.with_nodes(NODES)
        value, most = limit.value(at), limit.most(at)
        if isinstance(most, Polynomial):
            return None
        if isinstance(value, Polynomial):
            return value.largest_within(most)
        return choose(value > most, 0.0, inf)
    except NoPolynomialError:
        return None


def _by_halves(limit: Limit, network: Network, ceiling: int) -> Number:
    """The most nodes within one limit, whose value never falls with the nodes."""
    low: Number = 0
    high: Number = ceiling
    for _ in range(ceiling.bit_length()):
        middle = larger((low + high + 1) // 2, 1)
        over = limit.is_broken(network.with_nodes(middle))
        low, high = choose(over, low, middle), choose(over, middle - 1, high)
    return low


def _greatest(number: Number) -> float:
    return float(number.max()) if hasattr(number, "max") else float(number)
