"""Limits of a kind of bus: what is held against what, which periods there are, and whether a node is done in time."""

from abc import ABC, abstractmethod
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import reduce
from math import inf
from typing import Final, Literal, NamedTuple

from busplan.buses.network import Group, Network
from busplan.buses.rule import RuleProblem, RuleSubject
from busplan.elementwise import FIT_ROUNDING, Number, choose, is_off, is_over, larger, next_entry, smaller, total
from busplan.english import told_apart
from busplan.sections.base import TRANSACTION_KINDS, beside

COVERAGE: Final = 2
"""Coverage factor k: k standard uncertainties cover at least 95 %, on one side (JCGM 100, 6.2)."""
KEPT, NOT_SHOWN_KEPT, BROKEN = range(3)
"""Verdicts on a limit, the best first."""


_MOST: Final = 1e300
"""A number above every value of a plan, small enough to be subtracted from infinity."""


Role = Literal["cycle", "safety", "period"]


class Limit(ABC):
    """A value that must not exceed a bound, with its doubt and its words.

    Value and doubt must not decrease as nodes are added.
    """

    key: str
    label = ""
    """What limits, in a few words, where the key does not say it."""
    way_out = ""
    """Advice for a network that has no room for more nodes because of this limit: a format with `most`, and with the
    constants of the kind as `c`."""
    role: Role = "cycle"
    """cycle: a part of the verdict. safety: not a part of the verdict, but no advice breaks it. period: depends on the
    period alone, and a plan chooses no period that breaks it."""
    place = "cycle.period_us"
    """Key at which the rule of the verdict reports it."""
    has_rule = False
    """Whether a rule of the kind reports the broken limit; otherwise the rule of the verdict does."""
    has_period = False
    """Whether a longer period keeps it."""
    is_slow = False
    """Whether its value and period are slow to compute, and of plain numbers: it is evaluated last."""
    of_deadlines = False
    """Whether it must be kept for messages to be shown to keep their deadlines."""

    @abstractmethod
    def value(self, network: Network) -> Number:
        """The value."""

    @abstractmethod
    def most(self, network: Network) -> Number:
        """The bound."""

    @abstractmethod
    def words(self, network: Network) -> str:
        """Sentence on the excess over the bound, or on why the limit is not shown to be kept; of plain numbers."""

    def doubt(self, network: Network) -> Number:  # noqa: ARG002 - most are exact
        """Standard uncertainty of value - bound."""
        return 0.0

    def perhaps(self, network: Network) -> Number:  # noqa: ARG002 - most are exact
        """Part of the value that is only possible: it can leave the limit not shown, but not break it."""
        return 0.0

    def advice(self, network: Network) -> str:
        """`way_out` for a network."""
        bound = {"most": self.most(network)} if "{most" in self.way_out else {}
        return self.way_out.format(**bound, c=network.bus.constants)

    def shortest_period_us(self, network: Network, *, is_shown: bool) -> Number:  # noqa: ARG002 - most have none
        """Shortest period at which it is kept, or shown to be kept; infinite where no longer period helps [us]."""
        return inf

    @property
    def nominal(self) -> "Held":
        """The limit on the value without its uncertainty."""
        return Held(self, is_shown=False)

    @property
    def shown(self) -> "Held":
        """The limit on value + U: a network that keeps it is shown to keep this one."""
        return Held(self, is_shown=True)

    @property
    def is_exact(self) -> bool:
        """Whether its value has neither doubt nor a part that is only possible."""
        return not self.has_doubt and type(self).perhaps is Limit.perhaps

    @property
    def has_doubt(self) -> bool:
        """Whether its value has a standard uncertainty."""
        return type(self).doubt is not Limit.doubt

    def uncertainty(self, network: Network) -> Number:
        """Expanded uncertainty U of the value, two standard uncertainties."""
        doubt = self.doubt(network)
        return 0.0 if is_off(doubt) else COVERAGE * doubt

    def least_value(self, network: Network) -> Number:
        """Lower bound of the value: value - U, without the part that is only possible."""
        least, possible = self.value(network) - self.uncertainty(network), self.perhaps(network)
        return least if is_off(possible) else choose(possible < inf, least - smaller(possible, _MOST), -inf)

    def is_surely_broken(self, network: Network) -> Number:
        """Whether the lower bound of the value is over the bound: a bool, or an array of them."""
        return is_over(self.least_value(network), self.most(network))

    def verdict_code(self, network: Network) -> Number:
        """Verdict: `KEPT`, `NOT_SHOWN_KEPT` or `BROKEN`."""
        surely = choose(self.is_surely_broken(network), BROKEN, KEPT)
        if self.is_exact:
            return surely
        return larger(surely, choose(self.shown.is_broken(network), NOT_SHOWN_KEPT, KEPT))


class Held(NamedTuple):
    """A limit that a value is held against: the nominal value, or value + U."""

    limit: Limit
    is_shown: bool

    @property
    def key(self) -> str:
        """Key of the limit."""
        return self.limit.key

    @property
    def is_slow(self) -> bool:
        """Whether it is slow to compute."""
        return self.limit.is_slow

    def value(self, network: Network) -> Number:
        """The value, with U if it must be shown."""
        value = self.limit.value(network)
        return value + self.limit.uncertainty(network) if self.is_shown else value

    def excess(self, network: Network) -> Number:
        """Excess of the value over the bound; above 0 where broken."""
        return self.value(network) - self.limit.most(network) * (1 + FIT_ROUNDING)

    def is_broken(self, network: Network) -> Number:
        """Whether the value is over the bound: a bool, or an array of them."""
        return is_over(self.value(network), self.limit.most(network))

    def shortest_period_us(self, network: Network) -> Number:
        """Shortest period at which it is kept; infinite where no longer one helps [us]."""
        return self.limit.shortest_period_us(network, is_shown=self.is_shown)


@dataclass(frozen=True)
class ExactLimit(Limit):
    """A limit on a value that is known exactly, and that no longer period keeps."""

    key: str
    over: str | Callable[[Network], str]
    """Sentence on a broken limit: a format with `value`, `most` and the profile's `bus`; or a function."""
    value_of: Callable[[Network], Number]
    most_of: Callable[[Network], Number]
    way_out: str = ""
    role: Role = "cycle"
    place: str = "cycle.period_us"
    has_rule: bool = False
    is_slow: bool = False

    def value(self, network: Network) -> Number:
        """The value."""
        return self.value_of(network)

    def most(self, network: Network) -> Number:
        """The bound."""
        return self.most_of(network)

    def words(self, network: Network) -> str:
        """Sentence on the excess over the bound."""
        if not isinstance(self.over, str):
            return self.over(network)
        return self.over.format(value=self.value(network), most=self.most(network), bus=network.profile.bus)


class NothingUnknown(Limit):
    """A number of things that are not known must be 0; they keep a limit from being shown, and never break it."""

    def most(self, _network: Network) -> Number:
        """0."""
        return 0

    def perhaps(self, network: Network) -> Number:
        """All of them: what is not known may be well."""
        return self.value(network)


class WakeUp(NothingUnknown):
    """The latest wake-up of measured cycles is no bound: the next cycle may be later.

    Of exchangeable cycles each is as likely the latest. So the next n cycles hold on average n / (n + 1), about one,
    that is later than the worst of n measured ones. Who accepts one missed cycle in as many accepts that; what happens
    in more cycles than were measured, no recording shows.
    """

    key = "wake_up"
    label = "the host's wake-up"
    way_out = "limits.missed_cycles = 1 accepts one later cycle in as many"

    def __init__(self, place: str) -> None:
        self.place = place
        """Key of the latest start of a cycle by the host."""

    def _measured(self, network: Network) -> tuple[Number, Number | None]:
        """The latest start [us], and the number of cycles of which it is the worst; None where it is a bound."""
        bus = network.profile.bus
        name = self.place.removeprefix("bus.")
        return getattr(bus, name), getattr(bus, beside(name, "cycles"))

    def value(self, network: Network) -> Number:
        """Whether a measured worst stands for a bound, and nobody accepts a later cycle, 1 or 0."""
        latest_us, cycles = self._measured(network)
        if cycles is None:
            return 0
        is_accepted = choose(network.profile.limits.missed_cycles >= 1, 1, 0)
        return choose(latest_us > 0, 1 - is_accepted, 0)

    def words(self, network: Network) -> str:
        """The latest start, and the number of the measured cycles."""
        latest_us, cycles = self._measured(network)
        return f"{self.place} = {latest_us:g} is the worst of {int(cycles or 0):,} measured cycles, no bound"


class ShareOfPeriod(Limit):
    """A time that must be over within a share of the period; it must not depend on the period [us]."""

    has_rule = True
    has_period = True

    def share(self, network: Network) -> Number:  # noqa: ARG002 - mostly all of it
        """The share of the period [1]."""
        return 1

    def most(self, network: Network) -> Number:
        """The share of the period [us]."""
        return self.share(network) * network.period_us

    def shortest_period_us(self, network: Network, *, is_shown: bool) -> Number:
        """The period whose share the time fills [us]."""
        return Held(self, is_shown).value(network) / self.share(network)


class Periods(NamedTuple):
    """Communication periods that a kind of bus allows, ascending [us]; empty if it allows every period."""

    us: tuple[float, ...] = ()

    @property
    def longest_us(self) -> float:
        """Longest allowed period [us]; infinite where every period is allowed."""
        return self.us[-1] if self.us else inf

    def allows(self, period_us: float) -> bool:
        """Whether the bus allows a period.

        Examples
        --------
        >>> Periods((250.0, 500.0)).allows(300.0), Periods().allows(300.0)
        (False, True)
        """
        return not self.us or period_us in self.us

    def shortest_us(self, least_us: Number) -> Number:
        """Shortest allowed period of at least `least_us`, float rounding aside; infinite where there is none [us].

        Examples
        --------
        >>> Periods((250.0, 500.0)).shortest_us(250.1), Periods().shortest_us(250.1)
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
        """Sentence that the bus does not allow a period, with the next shorter and longer ones.

        Examples
        --------
        >>> Periods((250.0, 500.0)).refusal(300.0)
        'the bus allows no period of 300 us; the next are 250 and 500 us'
        """
        near = " and ".join(f"{us:g}" for us in self.neighbours(period_us))
        are = "are" if len(self.neighbours(period_us)) > 1 else "is"
        return f"the bus allows no period of {period_us:g} us; the next {are} {near} us"


ANY_PERIOD: Final = Periods()
"""Periods of a bus that allows every period."""

PERIOD_LIMIT: Final = "period"
"""Key of the limit on the period."""


def period_limit(periods: Periods) -> Limit:
    """Limit on the period, which the bus must allow."""
    return ExactLimit(
        PERIOD_LIMIT,
        lambda network: periods.refusal(network.period_us),
        lambda network: choose(periods.shortest_us(network.period_us) > network.period_us, 1, 0),
        lambda _network: 0,
        way_out="choose a period that the bus allows",
        role="period",
        has_rule=True,
    )


def unknown_period(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Check of a rule: the bus must allow the period; the problem names the next shorter and longer ones."""
    periods, period_us = subject.network.bus.periods, subject.profile.cycle.period_us
    if not periods.allows(period_us):
        yield RuleProblem("cycle.period_us", periods.refusal(period_us), *subject.cure())


def nodes_limit(nodes: str, most: Callable[[], float], bus: str, *, of: str = "of a", has_rule: bool = False) -> Limit:
    """Limit on the nodes of a bus, by the names of both; `of` stands between the number and the bus."""
    over, way_out = (
        f"{{value:.0f}} {nodes} are over the {{most:.0f}} {of} {bus}",
        f"a second {bus} has room for {{most:g}} more",
    )
    return ExactLimit("nodes", over, lambda network: network.nodes, lambda _: most(), way_out, has_rule=has_rule)


NODE: Final = "node"
"""Key of the limit on a node's execution."""


def slow_groups(network: Network) -> Iterator[Group]:
    """Groups whose nodes are not shown to finish within their period, in plain numbers."""
    for group in network.groups:
        if _busy_us(group) + COVERAGE * _busy_doubt_us(group) > network.period_us * group.every:
            yield group


def busy_words(group: Group, network: Network) -> str:
    """Words for the execution time of a node of a group, and its period, in plain numbers."""
    doubt_us = COVERAGE * _busy_doubt_us(group)
    either_way = f" +/- {doubt_us:.1f}" if doubt_us else ""
    busy, most = told_apart(_busy_us(group), (network.period_us * group.every))
    return f"a node's execution takes {busy}{either_way} us of its {most} us"


def _busy_us(group: Group) -> Number:
    """Execution time of a node in a cycle: a read and a write, the slowest of each [us]."""
    return total(map(group.slowest_us, TRANSACTION_KINDS))


def _busy_doubt_us(group: Group) -> Number:
    """Standard uncertainty of `_busy_us`: read and write have the same source, so their errors add [us]."""
    return group.read_uncertainty_us + group.write_uncertainty_us


def _all_busy_words(network: Network) -> str:
    busy = ((group.name, busy_words(group, network)) for group in slow_groups(network))
    return "; ".join(f"{name}: {words}" if name else words for name, words in busy)


def _busiest_us(network: Network, coverage: int) -> Number:
    """Largest execution time per cycle (over n for every n-th cycle) plus `coverage` standard uncertainties [us]."""
    if not network.groups:
        return 0.0
    busy_us = ((_busy_us(group) + coverage * _busy_doubt_us(group)) / group.every for group in network.groups)
    return reduce(larger, busy_us)


class BusyNode(ShareOfPeriod):
    """T_exec(read) + T_exec(write) + both worst extras <= n T_s, of every group with data in every n-th cycle."""

    key = NODE
    label = "the execution time of a node"
    way_out = "use a longer period or a faster node"

    def value(self, network: Network) -> Number:
        """The middle of the bounds of the busiest node [us]."""
        return (_busiest_us(network, -COVERAGE) + _busiest_us(network, COVERAGE)) / 2

    def doubt(self, network: Network) -> Number:
        """Half of the distance of these bounds, over k [us]."""
        return (_busiest_us(network, COVERAGE) - _busiest_us(network, -COVERAGE)) / 2 / COVERAGE

    def words(self, network: Network) -> str:
        """The groups that are too slow, and by how much."""
        return _all_busy_words(network)


NODE_LIMIT: Final = BusyNode()
