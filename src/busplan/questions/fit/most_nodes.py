"""The largest number of nodes that a bus carries."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from math import inf
from typing import Final, NamedTuple

from busplan.buses.limits import Held
from busplan.buses.network import Network
from busplan.elementwise import Number, choose, is_everywhere, larger, rounded_down, smaller
from busplan.questions.fit.certainty import limits_to_be_safe, limits_with_time
from busplan.sections.base import MAX_COUNT


class MostNodes(NamedTuple):
    """The largest number of nodes, and the index of the limit that sets it; arrays broadcast."""

    nodes: Number
    limit: Number
    limits: Sequence[Held]
    """The limits that were tried."""

    @property
    def words(self) -> tuple[int, str]:
        """The number of nodes and the key of the limit, of plain numbers."""
        return int(self.nodes), self.limits[int(self.limit)].key

    def words_at(self, points: int) -> list[tuple[int, str]]:
        """The same at each point of arrays."""
        import numpy as np

        numbers = np.broadcast_arrays(np.asarray(self.nodes), np.asarray(self.limit), np.empty(points))[:2]
        return [(int(nodes), self.limits[int(index)].key) for nodes, index in zip(*numbers, strict=True)]


def safe_nodes(network: Network, *, group: str = "", without: str | None = None) -> tuple[int, str]:
    """Most nodes that are shown to fit, with the reserve, on a bus with safe settings, and the key of the limit.

    Each number of nodes is tried with its own cycle, bias, uncertainty and limits, and its own "optimal" gap count.
    `group` names the group whose nodes are counted, the others as they are; empty where all nodes are alike. `without`
    is a limit that is left out, to find what binds next.
    """
    limits = [limit for limit in limits_to_be_safe(network) if limit.key != without]
    return most_nodes(partial(network.with_nodes, group=group), limits).words


def most_and_safe_nodes(
    with_nodes: Callable[[Number], Network], network: Network, *, model: str
) -> tuple[MostNodes, MostNodes | None]:
    """The most nodes that fit, and that are shown to fit; None under a timing model that does not decide."""
    with_nodes = _remembered(with_nodes)
    most = most_nodes(with_nodes, limits_with_time(network, model=model))
    if model != network.bus.deciding_model:
        return most, None
    # No more nodes are shown to fit than fit.
    ceiling = int(most.nodes.max() if hasattr(most.nodes, "max") else most.nodes) + 1
    return most, most_nodes(with_nodes, limits_to_be_safe(network), ceiling=min(ceiling, MAX_COUNT))


def _remembered(with_nodes: Callable[[Number], Network]) -> Callable[[Number], Network]:
    """The same network for each limit that is tried with so many nodes, so that limits share what it costs."""
    networks: dict[int, Network] = {}

    def of(nodes: Number) -> Network:
        if not isinstance(nodes, int):
            return with_nodes(nodes)
        if nodes not in networks:
            networks[nodes] = with_nodes(nodes)
        return networks[nodes]

    return of


def most_nodes(
    with_nodes: Callable[[Number], Network], limits: Sequence[Held], *, ceiling: int = MAX_COUNT
) -> MostNodes:
    """Largest number of nodes that keeps every limit; of several limits that set it, the first is named.

    Each limit is tried by itself, cheap ones first, and only up to what the limits before it allow. No answer is larger
    than `ceiling` [1]. Values must not fall as nodes are added.
    """
    found = _most_nodes(with_nodes, limits, ceiling=min(ceiling, _PLAUSIBLE))
    if ceiling <= _PLAUSIBLE or is_everywhere(found.nodes < _PLAUSIBLE):
        return found
    return _most_nodes(with_nodes, limits, ceiling=ceiling)


_PLAUSIBLE: Final = 128
"""More nodes are tried only where so many keep every limit: a cycle of a million takes long to count."""


def _most_nodes(with_nodes: Callable[[Number], Network], limits: Sequence[Held], *, ceiling: int) -> MostNodes:
    nodes: Number = ceiling
    most: dict[int, Number] = {}
    order = sorted(range(len(limits)), key=lambda index: limits[index].is_slow)
    for place, index in enumerate(order):
        # One above the ceiling, so that a limit that allows the ceiling is not taken for the limit that sets it.
        still_allowed = int(nodes.max() if hasattr(nodes, "max") else nodes)
        most[index] = _most_within(limits[index], with_nodes, still_allowed + 1)
        nodes = smaller(nodes, most[index])
        if is_everywhere(nodes < 1) and index < min(order[place + 1 :], default=index):
            break  # no other would be named
    first: Number = len(limits) - 1  # time, if no limit binds
    for index in sorted(most, reverse=True):
        first = choose(most[index] <= nodes, index, first)
    return MostNodes(nodes, first, limits)


_HUGE: Final = 1e300
"""A finite number beyond every excess."""
_HALVED_EVERY: Final = 3
"""One step of a search in so many halves the range, whatever the values say."""


def _most_within(limit: Held, with_nodes: Callable[[Number], Network], ceiling: int) -> Number:
    """The largest number of nodes that keeps one limit; every larger number breaks it.

    A value grows almost as the nodes do: the next number tried lies on the line between the last two.
    """
    over = limit.excess(with_nodes(ceiling))
    if is_everywhere(over <= 0):
        return ceiling
    # `low` nodes keep the limit, `high` nodes break it.
    low, high = choose(over > 0, 0, ceiling), choose(over > 0, ceiling, ceiling + 1)
    low_over: Number = -inf
    high_over = choose(over > 0, over, inf)
    tried: Number = 1
    for step in count(1):
        over = limit.excess(with_nodes(tried))
        is_over = over > 0
        low, low_over = choose(is_over, low, tried), choose(is_over, low_over, over)
        high, high_over = choose(is_over, tried, high), choose(is_over, over, high_over)
        if is_everywhere(high - low <= 1):
            break
        span = high_over - low_over
        share = 0.5 if step % _HALVED_EVERY == 0 else choose(span < _HUGE, 0.0 - low_over / smaller(span, _HUGE), 0.5)
        tried = larger(low + 1, smaller(high - 1, rounded_down(low + (high - low) * share)))
    return smaller(low, ceiling)
