"""Parts of a kind of bus: timing models, limits, settings of a plan, and the start of a new profile."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping
from enum import IntEnum
from functools import reduce
from math import inf
from typing import Final, Literal, NamedTuple

from busplan.buses.figure import MARGIN, Figure, Ink
from busplan.buses.network import Group, Network
from busplan.buses.rule import RuleProblem, RuleSubject
from busplan.elementwise import FIT_ROUNDING, Number, choose, larger, next_entry, smaller
from busplan.english import told_apart
from busplan.sourced import Grade

Value = int | float | str
"""A value of a profile's key."""


class TimingModel(NamedTuple):
    """One way to count the cycle of a kind of bus."""

    name: str
    meaning: str
    error: str = "how far the bus is from this timing model is not known"
    """Error of the model in words, where its bias is not known."""


class Safety(NamedTuple):
    """A setting of a bus that is safe or not, whether or not the cycle fits."""

    setting: str = "setting"
    """Name of the setting in sentences."""
    figure: Figure | None = None
    """The figure that says whether every safety limit holds."""
    after_reset: Mapping[str, Value] = {}
    """Keys as they are after a bus reset, until somebody sets them again."""


KeyRole = Literal["cable", "clock", "host", "pipeline"]
"""Part of a machine that a key of any kind stands for: the length of a cable [m], whether the nodes have a common
clock, the host's own time in the cycle, whole periods that the host adds to a loop."""


class Key(NamedTuple):
    """Facts about a key of a profile that its schema does not have."""

    symbol: str = ""
    """Symbol in formulas, if not its name."""
    default: str = ""
    """Name of the constant that is its default."""
    grade: Grade | None = None
    """Best grade that its value can have, if below the grade "given"."""
    meaning: str = ""
    """What a change of it means on the machine, where the key does not say it."""
    chooses: bool = False
    """Whether its value selects a formula: a derivation then lists it among its inputs."""
    role: KeyRole | None = None
    """Part of the machine that the key describes, if other kinds have a key for it, too."""


class EventKind(NamedTuple):
    """Name and colour of a kind of event, or of a stretch of several."""

    key: str
    label: str
    reference: str
    """Number of the equation that its time comes from, or where else it comes from."""
    mark: str
    """Character of the event in a terminal."""
    ink: Ink


IDLE: Final = EventKind("idle", "idle", MARGIN.reference, "~", "idle")
"""The rest of the slice."""


COVERAGE: Final = 2
"""Coverage factor k: k standard uncertainties cover at least 95 %, on one side (JCGM 100, 6.2)."""
KEPT, NOT_SHOWN_KEPT, BROKEN = range(3)
"""Verdicts on a limit, the better first."""


_MOST: Final = 1e300
"""A number so large that none of a plan comes near it, and that may be subtracted from infinity."""


class Limit(NamedTuple):
    """A `value` that must not exceed a bound, `most`, and the words for a network where it does.

    Value and doubt must not decrease as nodes are added.
    """

    key: str
    over: str | Callable[[Network], str]
    """Sentence on a limit that is broken or not shown to be kept: a format with `value`, its `uncertainty`, `most` and
    the profile's `bus`; or a function that writes it."""
    value: Callable[[Network], Number]
    most: Callable[[Network], Number]
    doubt: Callable[[Network], Number] | None = None
    """Standard uncertainty of value - bound, both times; None if both are exact."""
    perhaps: Callable[[Network], Number] | None = None
    """Part of the value that is only possible: it can keep the limit from being shown to be kept, but not break it."""
    period: "Callable[[Limit, Network], Number] | None" = None
    """Shortest period that keeps the limit, for a network [us]; None where a longer period does not help."""
    way_out: str = ""
    """Advice for a network that has no room for more nodes because of this limit: a format with `most`, and with the
    constants of the kind as `c`."""
    role: Literal["cycle", "safety", "period"] = "cycle"
    """cycle: a part of the verdict. safety: not a part of the verdict, but no advice breaks it. period: depends on the
    period alone, and a plan chooses no period that breaks it."""
    place: str = "cycle.period_us"
    """Key at which the rule of the verdict reports it."""
    has_rule: bool = False
    """Whether a rule of the kind reports the broken limit; otherwise the rule of the verdict does."""
    is_slow: bool = False
    """Whether its value and period are slow to compute, and of plain numbers: it is evaluated last."""
    label: str = ""
    """What limits, in a few words, where the key does not say it."""

    of_deadlines: bool = False
    """Whether it must be kept for messages to be shown to keep their deadlines."""

    @property
    def nominal(self) -> "Limit":
        """The same limit without uncertainty."""
        return self._replace(doubt=None, perhaps=None)

    @property
    def shown(self) -> "Limit":
        """The limit on value + U: a network that keeps it is shown to keep this one."""
        if self.doubt is None and self.perhaps is None:
            return self
        return self.nominal._replace(value=lambda network: self.value(network) + self.uncertainty(network))

    def uncertainty(self, network: Network) -> Number:
        """Expanded uncertainty U of the value, two standard uncertainties; 0 where it is exact."""
        return 0.0 if self.doubt is None else COVERAGE * self.doubt(network)

    def least_value(self, network: Network) -> Number:
        """Lower bound of the value: value - U, without the part that is only possible."""
        least = self.value(network) if self.doubt is None else self.value(network) - self.uncertainty(network)
        if self.perhaps is None:
            return least
        possible = self.perhaps(network)
        return choose(possible < inf, least - smaller(possible, _MOST), -inf)

    def is_broken(self, network: Network) -> Number:
        """Whether a network surely breaks it, at the lower bound of the value: a bool, or an array of them."""
        return self.least_value(network) > self.most(network) * (1 + FIT_ROUNDING)

    def excess(self, network: Network) -> Number:
        """By how much the lower bound of the value is over `most`: more than 0 where a network surely breaks it."""
        return self.least_value(network) - self.most(network) * (1 + FIT_ROUNDING)

    def verdict_code(self, network: Network) -> Number:
        """Tell whether it is `KEPT`, `NOT_SHOWN_KEPT` or `BROKEN`."""
        surely = choose(self.is_broken(network), BROKEN, KEPT)
        if self.doubt is None and self.perhaps is None:
            return surely
        return larger(surely, choose(self.shown.is_broken(network), NOT_SHOWN_KEPT, KEPT))

    def shortest_period_us(self, network: Network) -> Number:
        """Shortest period that keeps it; infinite where no longer one does [us]."""
        return inf if self.period is None else self.period(self, network)

    def advice(self, network: Network) -> str:
        """`way_out` for a network."""
        return (
            self.way_out.format(most=self.most(network), c=network.bus.constants)
            if "{" in self.way_out
            else self.way_out
        )

    def words(self, network: Network) -> str:
        """Say by how much a network breaks it."""
        if not isinstance(self.over, str):
            return self.over(network)
        value, most, uncertainty = self.value(network), self.most(network), self.uncertainty(network)
        return self.over.format(value=value, uncertainty=uncertainty, most=most, bus=network.profile.bus)


def share_of_period(
    key: str,
    over: Callable[[Network], str],
    *,
    us: Callable[[Network], Number],
    share: Callable[[Network], Number],
    doubt: Callable[[Network], Number],
    perhaps: Callable[[Network], Number] | None = None,
    way_out: str,
) -> Limit:
    """The limit of a time that must be over within a share of the period; a rule of its own reports it.

    Parameters
    ----------
    key, over, doubt, perhaps, way_out
        As `Limit` has them.
    us
        The time; it must not depend on the period [us].
    share
        The share [1].
    """

    def most_us(network: Network) -> Number:
        return share(network) * network.period_us

    def period_us(limit: Limit, network: Network) -> Number:
        return limit.least_value(network) / share(network)

    return Limit(key, over, us, most_us, doubt, perhaps, period_us, way_out, has_rule=True)


class Starter(NamedTuple):
    """Parts of a new profile that the kind decides."""

    bus: str
    """Section [bus], as TOML without its nodes and its host."""
    hosts: Mapping[str, str] = {}
    """Hosts to choose from by name, each with its lines of [bus]; none where the host plays no part."""
    host: str = ""
    """Host of a new profile, unless another is asked for."""
    period: str = "1ms"
    """Communication period, unless another is asked for."""
    slice_ratio: str = "1            # the whole period is for communication"
    """Value of cycle.slice_ratio, with a comment."""
    measure: str = "measure it on a node"
    """Advice how to find execution times: a format with `file`, the profile, and `group`, an option of `calibrate`."""
    node: str = ""
    """Commented lines of a node, for what no default is right for."""
    variants: Mapping[str, str] = {}
    """Another bus of the kind by its name: further lines of [bus], as of "can-fd", or a whole section, "profibus"."""
    rate: str = ""
    """Key of [bus] with a bit rate that a user is asked for; empty where there is one alone."""
    base: str = "what a node does in each cycle"
    """Meaning of execution.base_us."""
    table: str = ""
    """Keys of an execution time that was published, in place of a guess."""
    more: str = ""
    """Commented lines at the end of the profile."""

    @property
    def execution(self) -> str:
        """Keys of a node's execution time, which is assumed."""
        return (
            self.table
            or f"""\
kind = "linear"
grade = "assumed"          # between nothing and twice its value
base_us = 20               # assumed: {self.base}
per_byte_us = 0.1          # assumed: what each byte adds
"""
        )

    def section(self, host: str | None = None, variant: str = "") -> str:
        """Section [bus] with the lines of a host, by default of `host`, and those of a variant, or its own section."""
        more = self.variants.get(variant, "")
        bus, more = (more, "") if more.startswith("[bus]") else (self.bus, more)
        return "\n".join(filter(None, (bus, self.hosts.get(host or self.host), more)))


class Cost(IntEnum):
    """Cost of a change of a network, the cheapest first: the order of plans, of advice and of cures."""

    REGISTER = 1
    """A number in the nodes, such as a gap count."""
    HOST_TIME = 2
    """The slice ratio: the host computes in the rest of the period."""
    RESPONSES = 3
    """The way nodes answer: their firmware."""
    SCHEDULE = 4
    """The way the host asks nodes: the firmware of host and nodes."""
    PAYLOAD = 5
    """Data of a cycle."""
    PERIOD = 6
    """A requirement of the machine."""
    NODES = 7
    """Nodes that go to a second bus."""


class Setting(NamedTuple):
    """A setting of the bus that a plan may change without new parts."""

    name: str
    """Name in options: gap_count."""
    label: str
    """Name in a sentence: gap count."""
    cost: Cost
    keys: tuple[str, ...]
    """Dotted keys that it changes."""
    values: tuple[Mapping[str, Value], ...]
    """Other values that this network could have, as new values by key: safe ones first, then the smallest change."""


class Perturbation(NamedTuple):
    """A small change of a profile, made to see what it does to the margin."""

    label: str
    changes: Mapping[str, Value]
    """New value by dotted key."""
    why_not: str = ""
    """Why it cannot be made here; empty where it can."""
    if_nothing: str = ""
    """Why the margin stays as it is, where it does."""


class PayloadRange(NamedTuple):
    """Payloads that a plan may choose from: the largest, and the step between them."""

    step_bytes: int
    most_bytes: int
    carrier: str = "a packet"
    """What holds a payload and bounds it, for messages."""


class PacketTime(NamedTuple):
    """Part of a measured latency that is not the execution [us]."""

    us: float
    """Time of the packets."""
    shortest_us: float = 0.0
    """Shortest time that the bus waits for the node: a latency does not show a shorter execution."""


class MeasuredLatencies(NamedTuple):
    """Calibration of execution times from latencies that were measured on a kind of bus."""

    packets: Callable[[Network, str, str, str, int], PacketTime]
    """Time of the packets of a transaction, by network, name of the group, timing model, "read" or "write", and
    payload [bytes]; a BusplanError where its latency could not be measured."""
    fit_keys: Callable[[Network, str], dict[str, Value]]
    """Keys of [node.execution] that record how an execution time was fitted, by network and by the timing model whose
    packet times were subtracted."""


class Periods(NamedTuple):
    """Communication periods that a kind of bus allows, ascending; empty if it allows every period [us]."""

    us: tuple[float, ...] = ()

    @property
    def longest_us(self) -> float:
        """The longest of them; infinite where every period will do [us]."""
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
        """The shortest allowed period of at least a time, float rounding aside; infinite where there is none [us].

        Parameters
        ----------
        least_us
            The time [us]; of any sort.

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
        """Say that the bus does not allow a period, and which are next to it.

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
        lambda network: periods.refusal(network.period_us),
        lambda network: choose(periods.shortest_us(network.period_us) > network.period_us, 1, 0),
        lambda _network: 0,
        way_out="a period that the bus allows will do",
        role="period",
        has_rule=True,
    )


def unknown_period(subject: RuleSubject) -> Iterator[RuleProblem]:
    """Check of a rule: the bus must allow the period; the problem names the next shorter and longer ones."""
    periods, period_us = subject.network.bus.periods, subject.profile.cycle.period_us
    if not periods.allows(period_us):
        yield RuleProblem("cycle.period_us", periods.refusal(period_us), *subject.cure())


def nodes_limit(nodes: str, most: Callable[[], float], bus: str, *, of: str = "of a", has_rule: bool = False) -> Limit:
    """The limit on the nodes of a bus.

    Parameters
    ----------
    nodes, bus
        What they are called.
    most
        Function that gives the most nodes of a bus [1].
    of
        Words between the number and the bus.
    has_rule
        As `Limit` has it.
    """
    over, way_out = f"{{value:.0f}} {nodes} are over the {{most:.0f}} {of} {bus}", f"a second {bus} has {{most:g}} more"
    return Limit("nodes", over, lambda network: network.nodes, lambda _: most(), way_out=way_out, has_rule=has_rule)


NODE: Final = "node"
"""Key of the limit."""


def slow_groups(network: Network) -> Iterator[Group]:
    """Groups whose nodes are not shown to finish within their period; of plain numbers."""
    for group in network.groups:
        if _busy_us(group) + COVERAGE * _busy_doubt_us(group) > network.period_us * group.every:
            yield group


def busy_words(group: Group, network: Network) -> str:
    """Say how long a node of a group executes, and its period; of plain numbers."""
    doubt_us = COVERAGE * _busy_doubt_us(group)
    either_way = f" +/- {doubt_us:.1f}" if doubt_us else ""
    busy, most = told_apart(_busy_us(group), (network.period_us * group.every))
    return f"a node executes for {busy}{either_way} us of {most} us"


def _busy_us(group: Group) -> Number:
    """Execution time of a node in a cycle: a read and a write, the slowest of each [us]."""
    return group.read_execution_us + group.write_execution_us + 2 * group.worst_extra_us


def _busy_doubt_us(group: Group) -> Number:
    """Standard uncertainty of that time: read and write have the same source, so their errors add [us]."""
    return group.read_uncertainty_us + group.write_uncertainty_us


def _all_busy_words(network: Network) -> str:
    busy = ((group.name, busy_words(group, network)) for group in slow_groups(network))
    return "; ".join(f"{name}: {words}" if name else words for name, words in busy)


def _busiest_us(network: Network, coverage: int) -> Number:
    """Most execution time per cycle, divided by n for every n-th cycle, plus `coverage` standard uncertainties [us]."""
    if not network.groups:
        return 0.0
    busy_us = ((_busy_us(group) + coverage * _busy_doubt_us(group)) / group.every for group in network.groups)
    return reduce(larger, busy_us)


NODE_LIMIT: Final = share_of_period(
    NODE,
    _all_busy_words,
    us=lambda network: (_busiest_us(network, -COVERAGE) + _busiest_us(network, COVERAGE)) / 2,  # middle of its bounds
    share=lambda _network: 1,
    doubt=lambda network: (_busiest_us(network, COVERAGE) - _busiest_us(network, -COVERAGE)) / 2 / COVERAGE,
    way_out="a longer period or a faster node would do",
)._replace(label="the execution time of a node")
"""T_exec(read) + T_exec(write) + both worst extras <= n T_s, of every group with data in every n-th cycle."""
