"""The limit that every node is done once a cycle, for kinds of bus whose cycle holds no execution time."""

from collections.abc import Iterator
from typing import Final

from busplan.buses.network import Group, Network
from busplan.buses.parts import COVERAGE, Limit
from busplan.buses.rule import told_apart
from busplan.elementwise import Number, choose, plain

NODE: Final = "node"
"""Key of the limit."""


def busy_us(group: Group) -> Number:
    """What a node executes in a cycle: a read and a write, the slowest of each [us]."""
    return group.read_execution_us + group.write_execution_us + 2 * group.worst_extra_us


def busy_doubt_us(group: Group) -> Number:
    """Standard uncertainty of that: both times are known in one way, and are taken to err together [us]."""
    return group.read_uncertainty_us + group.write_uncertainty_us


def slow_groups(network: Network) -> Iterator[Group]:
    """Groups of plain numbers whose nodes are not shown to be done within the period."""
    for group in network.groups:
        if _shown_us(group) > network.period_us:
            yield group


def busy_words(group: Group, network: Network) -> str:
    """Say how much of each period a node of a group executes; of plain numbers."""
    doubt_us = COVERAGE * plain(busy_doubt_us(group))
    either_way = f" +/- {doubt_us:.1f}" if doubt_us else ""
    busy, most = told_apart(plain(busy_us(group)), plain(network.period_us))
    return f"a node executes for {busy}{either_way} us of {most} us"


def _all_words(network: Network) -> str:
    found = ((one.name, busy_words(one, network)) for one in slow_groups(network))
    return "; ".join(f"{name}: {words}" if name else words for name, words in found)


def shortest_us(network: Network) -> Number:
    """The shortest period in which all nodes are shown to be done [us]."""
    return _slowest(network)[2]


def _shown_us(group: Group) -> Number:
    return busy_us(group) + COVERAGE * busy_doubt_us(group)


def _slowest(network: Network) -> tuple[Number, Number, Number]:
    """Of the group that asks for most: its time, the standard uncertainty, and what both ask for [us]."""
    first, *others = network.groups
    found = busy_us(first), busy_doubt_us(first), _shown_us(first)
    for group in others:
        own = busy_us(group), busy_doubt_us(group), _shown_us(group)
        is_slower = own[2] > found[2]
        found = tuple(choose(is_slower, *pair) for pair in zip(own, found, strict=True))  # type: ignore[assignment]
    return found


NODE_LIMIT: Final = Limit(
    NODE,
    "",
    lambda network: _slowest(network)[0],
    lambda network: network.period_us,
    doubt=lambda network: _slowest(network)[1],
    way_out="a longer period or a faster node would do",
    has_rule=True,
    says=_all_words,
    slice_us=lambda network: plain(shortest_us(network)) * plain(network.slice_ratio),
)
"""T_exec(read) + T_exec(write) + both worst extras <= T_s, of every group."""
