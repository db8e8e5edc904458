"""The largest number of nodes that a bus carries, and what keeps it from being larger."""

from collections.abc import Sequence
from math import inf
from typing import Final, NamedTuple

from busplan.analysis.capacity.certainty import limits_to_be_safe
from busplan.analysis.capacity.cycle import limits_with_time
from busplan.analysis.capacity.polynomial import NODES, NoPolynomialError, Polynomial, least
from busplan.analysis.network import network_of
from busplan.buses.network import Network
from busplan.buses.parts import Limit
from busplan.elementwise import Number, choose, larger, smaller, total
from busplan.sections.base import MAX_COUNT
from busplan.sections.profile import Profile


class MostNodes(NamedTuple):
    """A largest number of nodes, and the place of its limit among those asked; arrays broadcast."""

    nodes: Number
    limit: Number


def largest_nodes(profile: Profile, *, model: str, group: str = "") -> tuple[int, str]:
    """Find the largest number of nodes that fits the profile's period, and what keeps it from being larger.

    Parameters
    ----------
    profile
        The network; its own number of nodes plays no part.
    model
        Timing model.
    group
        Name of the group whose nodes are counted, the others as they are; empty where all nodes are alike.

    Returns
    -------
    tuple
        Number of nodes [1], and the key of the limit.

    References
    ----------
    Paper, equations (1)-(11), with (11) solved for N.
    """
    network = network_of(profile).asking(group)
    return _with_key(network, limits_with_time(network, model=model))


def safe_nodes(profile: Profile, *, group: str = "", without: str | None = None) -> tuple[int, str]:
    """Find the largest number of nodes that is shown to fit, with the reserve, on a bus that is set safely for them.

    Each number of nodes has its own cycle, bias, uncertainty and limits; a gap count that follows them does so.

    Parameters
    ----------
    profile
        The network; its own number of nodes plays no part.
    group
        As for `largest_nodes`.
    without
        Key of a limit that is not asked: what would keep nodes off the bus once it is gone.

    Returns
    -------
    tuple
        Number of nodes [1], and the key of the limit.
    """
    network = network_of(profile).asking(group)
    return _with_key(network, [one for one in limits_to_be_safe(network) if one.key != without])


def _with_key(network: Network, limits: Sequence[Limit]) -> tuple[int, str]:
    most = most_nodes(network, limits)
    return int(most.nodes), limits[int(most.limit)].key


def most_nodes(network: Network, limits: Sequence[Limit], *, ceiling: int = MAX_COUNT) -> MostNodes:
    """Find the largest number of nodes within some limits; of equal answers the first limit gives its name.

    Each limit is asked alone, and asks the cycle itself: once, with a polynomial in the place of the number of nodes.
    One that is no polynomial is searched by halves, below what the others allow.

    Parameters
    ----------
    network
        Its own number of nodes plays no part. Its numbers may be arrays.
    limits
        The limits; the value of none falls with the nodes.
    ceiling
        No answer is larger [1].
    """
    closed = [_in_closed_form(limit, network) for limit in limits]
    ceiling = int(min([ceiling, *(_greatest(one) for one in closed if one is not None)]))
    nodes, *others = (
        # One more, so that a limit that keeps the ceiling does not give its name to the answer of another.
        _searched(limit, network, ceiling + 1) if found is None else found
        for limit, found in zip(limits, closed, strict=True)
    )
    place: Number = 0
    for index, most in enumerate(others, start=1):
        less = most < nodes
        nodes, place = choose(less, most, nodes), choose(less, index, place)
    return MostNodes(smaller(nodes, ceiling), place)


def _in_closed_form(limit: Limit, network: Network) -> Number | None:
    """The most nodes within one limit, infinite where they play no part; None where there is no closed form."""
    try:
        at = network.with_nodes(NODES)
        value, most = limit.value(at), limit.bound(at)
        if isinstance(most, Polynomial):
            return None
        if isinstance(value, Polynomial):
            return _with_one_node(value.largest_within(most), limit, network)
        return choose(value > most, 0.0, inf)
    except NoPolynomialError:
        return None


def _with_one_node(nodes: Number, limit: Limit, network: Network) -> Number:
    """The most nodes, where a polynomial gave them: it is the cycle of two nodes or more, so one is asked alone."""
    if least(nodes) > 1:
        return nodes
    return choose(nodes > 1, nodes, choose(limit.is_broken(network.with_nodes(1)), 0.0, 1.0))


_VALUE_COST: Final = 30
"""Operations on each element that the value of a limit takes, about; comparing it takes one."""


def _searched(limit: Limit, network: Network, ceiling: int) -> Number:
    """The most nodes within one limit, in the way that touches fewer elements.

    A value that varies over few axes of an array is cheap: it is asked for every number of nodes, and counted how often
    it holds. Otherwise few numbers of nodes are asked, each on the whole array.
    """
    alone = network.with_nodes(1)
    whole = _size(limit.is_broken(alone))
    if whole == 1:
        return _by_halves(limit, network, ceiling)
    counted = ceiling * (_size(limit.value(alone)) * _VALUE_COST + whole)
    if counted > ceiling.bit_length() * whole * _VALUE_COST:
        return _by_halves(limit, network, ceiling)
    # Once broken, a limit stays broken.
    return total(choose(limit.is_broken(network.with_nodes(nodes)), 0, 1) for nodes in range(1, ceiling + 1))


def _size(number: Number) -> int:
    return int(getattr(number, "size", 1))


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
