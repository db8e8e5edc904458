"""The largest number of nodes that a bus carries, and what keeps it from being larger."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import Limit
from busplan.elementwise import Number, choose, larger, plain, rounded_up, smaller, total
from busplan.questions.fit.certainty import limits_to_be_safe, limits_with_time
from busplan.questions.fit.network import network_of
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
    return _with_key(network, [limit for limit in limits_to_be_safe(network) if limit.key != without])


def _with_key(network: Network, limits: Sequence[Limit]) -> tuple[int, str]:
    most = most_nodes(network, limits)
    return int(plain(most.nodes)), limits[int(plain(most.limit))].key


def most_nodes(network: Network, limits: Sequence[Limit], *, ceiling: int = MAX_COUNT) -> MostNodes:
    """Find the largest number of nodes within some limits; of equal answers the first limit gives its name.

    Each limit is asked by itself, cheap ones first, and below what those before it allow.

    Parameters
    ----------
    network
        Its own number of nodes plays no part. Its numbers may be arrays.
    limits
        The limits; the value of none falls with the nodes.
    ceiling
        No answer is larger [1].
    """
    nodes: Number = ceiling
    # Limits that keep the same ceiling ask one network, whose parts are computed once.
    full = lru_cache(maxsize=1)(network.with_nodes)
    most: dict[int, Number] = {}
    for index in sorted(range(len(limits)), key=lambda index: limits[index].is_slow):
        # One more, so that a limit that keeps the ceiling does not give its name to the answer of another.
        most[index] = _most_within(limits[index], network, full, int(_greatest(nodes)) + 1)
        nodes = smaller(nodes, most[index])
    place: Number = len(limits) - 1  # time, where none keeps any out
    for index in reversed(range(len(limits))):
        place = choose(most[index] <= nodes, index, place)
    return MostNodes(nodes, place)


_VALUE_COST: Final = 30
"""Operations on each element that the value of a limit takes, about; comparing it takes one."""


def _most_within(limit: Limit, network: Network, full: Callable[[int], Network], ceiling: int) -> Number:
    """The most nodes within one limit, which stays broken once it is, in the way that touches fewer elements.

    A value that varies over few axes of an array is cheap: it is asked for every number of nodes, and counted how often
    it holds. Otherwise few numbers of nodes are asked, by halves.
    """
    over = limit.is_broken(full(ceiling))
    whole = _size(over)
    if not _any(over):
        return ceiling
    if whole > 1:
        # A limit that tells without its value is asked everywhere.
        asked = whole if limit.breaks else _size(limit.least_value(network.with_nodes(1)))
        counted = ceiling * (asked * _VALUE_COST + whole)
        if counted <= ceiling.bit_length() * whole * _VALUE_COST:
            broken = (limit.is_broken(network.with_nodes(nodes)) for nodes in range(1, ceiling + 1))
            return total(choose(is_over, 0, 1) for is_over in broken)
    low, high = choose(over, 0, ceiling), choose(over, ceiling - 1, ceiling)
    for _ in range((ceiling - 1).bit_length()):
        middle = larger(rounded_up((low + high) / 2), 1)
        over = limit.is_broken(network.with_nodes(middle))
        low, high = choose(over, low, middle), choose(over, middle - 1, high)
    return low


def _size(number: Number) -> int:
    return int(getattr(number, "size", 1))


def _any(truths: Number) -> bool:
    return bool(truths.any() if hasattr(truths, "any") else truths)


def _greatest(number: Number) -> float:
    return float(number.max()) if hasattr(number, "max") else plain(number)
