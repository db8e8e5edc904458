"""The limit that every node is done once a cycle, for kinds of bus whose cycle holds no execution time."""

from collections.abc import Iterator
from functools import reduce
from typing import Final

from busplan.buses.network import Group, Network
from busplan.buses.parts import COVERAGE, share_limit
from busplan.buses.rule import told_apart
from busplan.elementwise import Number, larger, plain

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


def _shown_us(group: Group) -> Number:
    return busy_us(group) + COVERAGE * busy_doubt_us(group)


def _ends_us(network: Network) -> tuple[Number, Number]:
    """What the slowest nodes execute at least, and what they are shown to execute at most [us]."""
    least_us = (busy_us(group) - COVERAGE * busy_doubt_us(group) for group in network.groups)
    return reduce(larger, least_us), reduce(larger, map(_shown_us, network.groups))


def _middle_us(network: Network) -> Number:
    least_us, most_us = _ends_us(network)
    return (least_us + most_us) / 2


def _doubt_us(network: Network) -> Number:
    least_us, most_us = _ends_us(network)
    return (most_us - least_us) / 2 / COVERAGE


NODE_LIMIT: Final = share_limit(
    NODE,
    "",
    _middle_us,
    share=lambda _network: 1,
    doubt=_doubt_us,
    way_out="a longer period or a faster node would do",
    has_rule=True,
    says=_all_words,
)
"""T_exec(read) + T_exec(write) + both worst extras <= T_s, of every group."""
