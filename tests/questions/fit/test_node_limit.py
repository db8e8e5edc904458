"""The most nodes within some limits: against a count, and over arrays."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses.limits import ExactLimit, Held
from busplan.buses.network import Network
from busplan.elementwise import Number, choose, rounded_up
from busplan.questions.fit.certainty import limits_with_time
from busplan.questions.fit.figures import node_counts
from busplan.questions.fit.most_nodes import most_nodes, safe_nodes
from busplan.questions.fit.network import network_of

NETWORK = network_of(busplan.load_profile("paper-4ms"))
FORMS: dict[str, Callable[[Number], Number]] = {
    "line": lambda nodes: nodes,
    "square": lambda nodes: nodes * nodes,
    "steps": lambda nodes: rounded_up(nodes / 3) * 3,
    "none": lambda _nodes: 0,
    "a jump": lambda nodes: choose(nodes > 7, 1e6, nodes),
}


def limit_of(form: str, most: Number, is_slow: bool, *, less: Number = 0) -> Held:
    def value(network: Network) -> Number:
        return FORMS[form](network.nodes) - less

    return ExactLimit(form, "", value, lambda _network: most, is_slow=is_slow).nominal


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
    points = np.arange(shape[0])[:, None] + np.arange(shape[1])

    def at(point: Number) -> list[Held]:
        bounds = [limit_of(form, most + point, is_slow) for form, most, is_slow in asked[::2]]
        return [*bounds, *(limit_of(*one, less=point) for one in asked[1::2])]

    together = most_nodes(NETWORK.with_nodes, at(points), ceiling=30)
    alone = [[most_nodes(NETWORK.with_nodes, at(int(point)), ceiling=30) for point in row] for row in points]
    for name in ("nodes", "limit"):
        whole = np.broadcast_to(np.asarray(getattr(together, name)), points.shape)
        assert whole.tolist() == [[getattr(one, name) for one in row] for row in alone]


@pytest.mark.parametrize("most", [127, 128, 129, 1000])
def test_a_bus_for_hundreds_of_nodes_is_counted_to_the_end(most: int) -> None:
    limits = [limit_of("line", 5000, False), limit_of("line", most, False)]
    assert most_nodes(NETWORK.with_nodes, limits)[:2] == (most, 1)
    found = most_nodes(NETWORK.with_nodes, [limit_of("line", np.array([5, most]), False)])
    assert np.asarray(found.nodes).tolist() == [5, most]


def test_a_limit_that_is_just_kept_by_any_number_is_not_the_one_that_sets_it() -> None:
    just_kept = limit_of("none", np.array([-1, 0]), True)
    found = most_nodes(NETWORK.with_nodes, [just_kept, limit_of("line", 20, False)])
    assert found.words_at(2) == [(0, "none"), (20, "line")]


def groups_of(kind: str, number: int) -> str:
    """A profile of groups that are not alike."""
    group = """
[[group]]
name = "g{place}"
nodes = {nodes}
axes = 1
read_bytes = {size}
write_bytes = 6
execution = {{ kind = "linear", grade = "assumed", base_us = 1, per_byte_us = 0.1 }}
"""
    start = f"""schema_version = 1
name = "many"
[bus]
kind = "{kind}"
{'speed = "S400"' if kind == "ieee1394" else ""}
{"max_hops = 8" if kind == "ieee1394" else ""}
[cycle]
period_us = 8000
slice_ratio = 0.9
"""
    return start + "".join(
        group.format(place=place, nodes=place % 3 + 1, size=4 + place % 5) for place in range(number)
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ethercat", "ieee1394"])
def test_of_many_groups_the_most_nodes_of_each_fit_and_one_more_does_not(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "many.toml"
    path.write_text(groups_of(kind, 18))
    decides = busplan.capacity(path).verdicts[0].deciding
    assert len(decides.groups) == 18
    for count in decides.groups[::6]:
        key = f"group.{count.name}.nodes"
        assert count.safe_nodes is not None
        assert 0 < count.safe_nodes <= count.max_nodes
        for nodes, fits, is_shown in (
            (count.safe_nodes, True, True),
            (count.safe_nodes + 1, count.safe_nodes < count.max_nodes, False),
            (count.max_nodes + 1, False, False),
        ):
            answer = busplan.capacity(busplan.load_profile(path, changes={key: nodes}))
            now = answer.verdicts[0].deciding
            assert (now.fits, now.verdict == "fits" and now.safe) == (fits, is_shown)


def test_the_counts_of_many_groups_at_once_are_those_of_each_alone(tmp_path: Path) -> None:
    """From sixteen groups on they are points of an array; some of them are alike, and so one in the cycle."""
    path = tmp_path / "many.toml"
    path.write_text(groups_of("ieee1394", 18).replace("read_bytes = 5", "read_bytes = 4"))
    network = network_of(busplan.load_profile(path))
    assert len(network.groups) < len(network.profile.node_groups) == 18
    limits = limits_with_time(network, model="standard")
    found = node_counts(network, model="standard")
    for count in found[::6]:
        most = most_nodes(partial(network.with_nodes, group=count.name), limits)
        assert (count.max_nodes, count.limited_by) == most.words
        assert (count.safe_nodes, count.safe_limited_by) == safe_nodes(network, group=count.name)
    assert len({count.max_nodes for count in found}) > 1
