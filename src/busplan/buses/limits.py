"""Limits that several kinds of bus have: a period that the bus allows, and nodes that finish within the period."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from functools import reduce
from math import inf
from typing import Final, NamedTuple

from busplan.buses.network import Group, Network
from busplan.buses.parts import COVERAGE, Bound, Limit, share_of_period
from busplan.buses.rule import Rule, RuleProblem, RuleSubject, told_apart
from busplan.elementwise import FIT_ROUNDING, Number, choose, larger, next_entry, plain


class Periods(NamedTuple):
    """Communication periods that a kind of bus allows, ascending; empty if it allows every period [us]."""

    us: tuple[float, ...] = ()

    @property
    def longest_us(self) -> float:
        """The longest of them; infinite where every period will do [us]."""
        return self.us[-1] if self.us else inf

    def allows(self, period_us: float) -> bool:
        """Whether a period is one of them.

        Examples
        --------
        >>> Periods((250.0, 500.0)).allows(300.0), Periods().allows(300.0)
        (False, True)
        """
        return not self.us or period_us in self.us

    def from_us(self, least_us: Number) -> Number:
        """The shortest of them that is at least a time, float rounding aside; infinite where none is [us].

        Parameters
        ----------
        least_us
            The time [us]; of any sort.

        Examples
        --------
        >>> Periods((250.0, 500.0)).from_us(250.1), Periods().from_us(250.1)
        (500.0, 250.1)
        """
        if not self.us:
            return least_us
        return next_entry(self.us, least_us * (1 - FIT_ROUNDING), words="the next period that the bus allows")

    def neighbours(self, period_us: float) -> tuple[float, ...]:
        """The next shorter and the next longer period that the bus allows, where they exist [us].

        Examples
        --------
        >>> Periods((250.0, 500.0)).neighbours(300.0), Periods((250.0, 500.0)).neighbours(100.0)
        ((250.0, 500.0), (250.0,))
        """
        shorter = self.us[: bisect_left(self.us, period_us)][-1:]
        return (*shorter, *self.us[bisect_right(self.us, period_us) :][:1])

    def refusal(self, period_us: float) -> str:
        """Say that a period is none of them, and which are next to it.

        Examples
        --------
        >>> Periods((250.0, 500.0)).refusal(300.0)
        'the bus allows no period of 300 us; the next are 250 and 500 us'
        """
        near = " and ".join(f"{us:g}" for us in self.neighbours(period_us))
        are = "are" if len(self.neighbours(period_us)) > 1 else "is"
        return f"the bus allows no period of {period_us:g} us; the next {are} {near} us"


ANY_PERIOD: Final = Periods()
"""Every period will do."""

PERIOD_LIMIT: Final = "period"
"""Key of the limit."""


def period_limit(periods: Periods) -> Limit:
    """The limit that the bus must allow the period.

    Parameters
    ----------
    periods
        The periods that it allows.
    """
    return Limit(
        PERIOD_LIMIT,
        lambda network: periods.refusal(plain(network.period_us)),
        Bound(lambda network: choose(periods.from_us(network.period_us) > network.period_us, 1, 0), lambda _network: 0),
        way_out="a period that the bus allows will do",
        role="period",
        has_rule=True,
    )


def period_rule(code: str, periods: Periods, *, kind: str, source: str) -> Rule:
    """The rule that reports a period that the bus does not allow, with its neighbours.

    Parameters
    ----------
    code
        Its code.
    periods
        The periods that it allows.
    kind
        Name of the kind of bus.
    source
        The periods in words, with their source.
    """

    def unknown_period(subject: RuleSubject) -> Iterator[RuleProblem]:
        period_us = subject.profile.cycle.period_us
        if not periods.allows(period_us):
            yield RuleProblem("cycle.period_us", periods.refusal(period_us), *subject.cure())

    return Rule(
        code,
        f"{kind}-unknown-period",
        "error",
        "the bus does not allow this period",
        f"The bus runs only at some communication periods: {source}. A profile with another period loads, and capacity "
        "gives its figures, but it does not fit. The message names the next shorter and the next longer period.",
        unknown_period,
    )


NODE: Final = "node"
"""Key of the limit."""


def busy_us(group: Group) -> Number:
    """Execution time of a node in a cycle: a read and a write, the slowest of each [us]."""
    return group.read_execution_us + group.write_execution_us + 2 * group.worst_extra_us


def busy_doubt_us(group: Group) -> Number:
    """Standard uncertainty of that time: read and write are known in the same way, so they err together [us]."""
    return group.read_uncertainty_us + group.write_uncertainty_us


def slow_groups(network: Network) -> Iterator[Group]:
    """Groups of plain numbers whose nodes are not shown to finish within the period."""
    for group in network.groups:
        if _shown_us(group) > _period_us(group, network):
            yield group


def busy_words(group: Group, network: Network) -> str:
    """Say how much of each of its periods a node of a group executes; of plain numbers."""
    doubt_us = COVERAGE * plain(busy_doubt_us(group))
    either_way = f" +/- {doubt_us:.1f}" if doubt_us else ""
    busy, most = told_apart(plain(busy_us(group)), plain(_period_us(group, network)))
    return f"a node executes for {busy}{either_way} us of {most} us"


def _all_words(network: Network) -> str:
    busy = ((group.name, busy_words(group, network)) for group in slow_groups(network))
    return "; ".join(f"{name}: {words}" if name else words for name, words in busy)


def _period_us(group: Group, network: Network) -> Number:
    """From a cycle with the group's data to the next [us]."""
    return network.period_us * group.every if group.is_slower else network.period_us


def _shown_us(group: Group) -> Number:
    return busy_us(group) + COVERAGE * busy_doubt_us(group)


def _of_a_cycle(us: Number, group: Group) -> Number:
    """The share of a single cycle in a time that may take n of them [us]."""
    return us / group.every if group.is_slower else us


def _ends_us(network: Network) -> tuple[Number, Number]:
    """Execution time of the slowest nodes in a cycle, less and plus its expanded uncertainty [us]."""
    if not network.groups:
        return 0.0, 0.0
    least_us = (_of_a_cycle(busy_us(group) - COVERAGE * busy_doubt_us(group), group) for group in network.groups)
    return reduce(larger, least_us), reduce(larger, (_of_a_cycle(_shown_us(group), group) for group in network.groups))


def _middle_us(network: Network) -> Number:
    least_us, most_us = _ends_us(network)
    return (least_us + most_us) / 2


def _doubt_us(network: Network) -> Number:
    least_us, most_us = _ends_us(network)
    return (most_us - least_us) / 2 / COVERAGE


NODE_LIMIT: Final = Limit(
    NODE,
    _all_words,
    *share_of_period(_middle_us, share=lambda _network: 1, doubt=_doubt_us),
    way_out="a longer period or a faster node would do",
    has_rule=True,
)
"""T_exec(read) + T_exec(write) + both worst extras <= n T_s, of every group with data in every n-th cycle."""
