"""The most nodes within some limits: against a count, and over arrays."""

from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses.limits import Limit
from busplan.buses.network import Network
from busplan.elementwise import Number, choose, rounded_up
from busplan.questions.fit.figures import most_nodes
from busplan.questions.fit.network import network_of

NETWORK = network_of(busplan.load_profile("paper-4ms"))
FORMS: dict[str, Callable[[Number], Number]] = {
    "line": lambda nodes: nodes,
    "square": lambda nodes: nodes * nodes,
    "steps": lambda nodes: rounded_up(nodes / 3) * 3,
    "none": lambda _nodes: 0,
    "a jump": lambda nodes: choose(nodes > 7, 1e6, nodes),
}


def limit_of(form: str, most: Number, is_slow: bool, *, less: Number = 0) -> Limit:
    def value(network: Network) -> Number:
        return FORMS[form](network.nodes) - less

    return Limit(form, "", value, lambda _network: most, is_slow=is_slow)


limits = st.lists(st.tuples(st.sampled_from(list(FORMS)), st.integers(-1, 120), st.booleans()), min_size=1, max_size=5)


@given(asked=limits, ceiling=st.integers(1, 40))
def test_the_most_are_those_that_a_count_finds_and_the_first_limit_of_equal_ones_gives_its_name(
    asked: list[tuple[str, int, bool]], ceiling: int
) -> None:
    def counted(form: str, most: int) -> int:
        return sum(bool(FORMS[form](nodes) <= most) for nodes in range(1, ceiling + 2))

    found = most_nodes(NETWORK.with_nodes, [limit_of(*one) for one in asked], ceiling=ceiling)
    each = [counted(form, to) for form, to, _ in asked]
    assert found.nodes == min(*each, ceiling)
    if found.nodes < ceiling:
        assert found.limit == each.index(min(each))


@given(asked=limits, shape=st.tuples(st.integers(1, 3), st.integers(1, 40)))
def test_an_array_is_answered_as_each_of_its_points(asked: list[tuple[str, int, bool]], shape: tuple[int, int]) -> None:
    # Values that vary are searched by halves, bounds that do are counted.
    points = np.arange(shape[0])[:, None] + np.arange(shape[1])

    def at(point: Number) -> list[Limit]:
        bounds = [limit_of(form, most + point, is_slow) for form, most, is_slow in asked[::2]]
        return [*bounds, *(limit_of(*one, less=point) for one in asked[1::2])]

    together = most_nodes(NETWORK.with_nodes, at(points), ceiling=30)
    alone = [[most_nodes(NETWORK.with_nodes, at(int(point)), ceiling=30) for point in row] for row in points]
    for name in ("nodes", "limit"):
        whole = np.broadcast_to(np.asarray(getattr(together, name)), points.shape)
        assert whole.tolist() == [[getattr(one, name) for one in row] for row in alone]
