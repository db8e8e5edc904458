"""The largest number of nodes that a bus carries, and the limit that sets it."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import Limit
from busplan.elementwise import Number, choose, larger, plain, rounded_up, smaller, total
from busplan.questions.fit.certainty import limits_to_be_safe, limits_with_time
from busplan.sections.base import MAX_COUNT


class MostNodes(NamedTuple):
    """The largest number of nodes, and the index of the limit that sets it; arrays broadcast."""

    nodes: Number
    limit: Number


def largest_nodes(network: Network, *, model: str, group: str = "") -> tuple[int, str]:
    """Find the largest number of nodes that fits its period, and the limit that sets it.

    Parameters
    ----------
    network
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
    network = network.asking(group)
    return _with_key(network, limits_with_time(network, model=model))


def safe_nodes(network: Network, *, group: str = "", without: str | None = None) -> tuple[int, str]:
    """Find the largest number of nodes that is shown to fit, with the reserve, on a bus that is set safely for them.

    Each number of nodes is tried with its own cycle, bias, uncertainty and limits, and its own "optimal" gap count.

    Parameters
    ----------
    network
        The network; its own number of nodes plays no part.
    group
        As for `largest_nodes`.
    without
        Key of a limit that is left out, to find what binds next.

    Returns
    -------
    tuple
        Number of nodes [1], and the key of the limit.
    """
    network = network.asking(group)
    return _with_key(network, [limit for limit in limits_to_be_safe(network) if limit.key != without])


def _with_key(network: Network, limits: Sequence[Limit]) -> tuple[int, str]:
    most = most_nodes(network, limits)
    return int(plain(most.nodes)), limits[int(plain(most.limit))].key


def most_nodes(network: Network, limits: Sequence[Limit], *, ceiling: int = MAX_COUNT) -> MostNodes:
    """Find the largest number of nodes within some limits; where several limits give it, the first is named.

    Each limit is tried by itself, cheap ones first, and only up to what the limits before it allow.

    Parameters
    ----------
    network
        Its own number of nodes plays no part. Its numbers may be arrays.
    limits
        The limits. Their values must not fall as nodes are added.
    ceiling
        No answer is larger [1].
    """
    nodes: Number = ceiling
    # Limits with the same ceiling share one network, whose parts are computed once.
    cached_network = lru_cache(maxsize=1)(network.with_nodes)
    most: dict[int, Number] = {}
    for index in sorted(range(len(limits)), key=lambda index: limits[index].is_slow):
        # One above the ceiling, so that a limit that allows the ceiling is not taken for the limit that sets it.
        most[index] = _most_within(limits[index], network, cached_network, int(_greatest(nodes)) + 1)
        nodes = smaller(nodes, most[index])
    first: Number = len(limits) - 1  # time, if no limit binds
    for index in reversed(range(len(limits))):
        first = choose(most[index] <= nodes, index, first)
    return MostNodes(nodes, first)


_VALUE_COST: Final = 30
"""Operations that the value of a limit takes for each element, roughly; a comparison takes one."""


def _most_within(limit: Limit, network: Network, cached_network: Callable[[int], Network], ceiling: int) -> Number:
    """The most nodes within one limit, which further nodes keep broken.

    There are two ways, and the cheaper is taken. A value that varies over few axes of an array is computed for every
    number of nodes, and the numbers within the limit are counted. Otherwise the numbers of nodes are bisected.
    """
    over = limit.is_broken(cached_network(ceiling))
    elements = _size(over)
    if not _any(over):
        return ceiling
    if elements > 1:
        asked = _size(limit.bound.least_value(network.with_nodes(1)))
        counted = ceiling * (asked * _VALUE_COST + elements)
        if counted <= ceiling.bit_length() * elements * _VALUE_COST:
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


def _any(conditions: Number) -> bool:
    return bool(conditions.any() if hasattr(conditions, "any") else conditions)


def _greatest(number: Number) -> float:
    return float(number.max()) if hasattr(number, "max") else plain(number)
