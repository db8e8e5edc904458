"""Parts of a kind of bus: timing models, limits, settings of a plan, and the start of a new profile."""

from abc import ABC, abstractmethod
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum, unique
from functools import reduce
from math import inf
from typing import Final, Literal, NamedTuple

from busplan.buses.figure import MARGIN, Figure, Ink
from busplan.buses.network import Group, Network
from busplan.buses.rule import RuleProblem, RuleSubject
from busplan.elementwise import FIT_ROUNDING, Number, choose, is_off, is_over, larger, next_entry, smaller, total
from busplan.english import told_apart
from busplan.sections.base import TRANSACTION_KINDS, beside
from busplan.sourced import Grade

Value = int | float | str
"""Value of a profile's key."""


class TimingModel(NamedTuple):
    """One way to count the cycle of a kind of bus."""

    name: str
    meaning: str
    error: str = "the error of this timing model is not known"
    """Error of the model in words, where its bias is not known."""


class Safety(NamedTuple):
    """A setting of a bus that is safe or not, whether or not the cycle fits."""

    setting: str = "setting"
    """Name of the setting in sentences."""
    figure: Figure | None = None
    """Figure that tells whether every safety limit holds."""
    after_reset: Mapping[str, Value] = {}
    """Values of keys after a bus reset, until somebody sets them again."""


KeyRole = Literal["cable", "clock", "host", "pipeline", "wake-up"]
"""Part of a machine that a key of any kind stands for.

It is the length of a cable [m], a common clock of the nodes, the host's own time from what it receives to what it
sends, the whole periods that the host adds to a loop, or the latest start of a cycle by the host.
"""


class Key(NamedTuple):
    """Facts about a key of a profile that its schema does not have."""

    symbol: str = ""
    """Symbol in formulas, if not the key's name."""
    default: str = ""
    """Name of the constant that is the default."""
    grade: Grade | None = None
    """Best grade that the value can have, if below the grade "given"."""
    meaning: str = ""
    """Meaning of a change on the machine, where the key does not give it."""
    chooses: bool = False
    """Whether the value selects a formula; a derivation then lists it among its inputs."""
    role: KeyRole | None = None
    """Part of the machine that the key describes, if other kinds have a key for it, too."""


class EventKind(NamedTuple):
    """Name and colour of a kind of event, or of a stretch of several."""

    key: str
    label: str
    reference: str
    """Number of the equation that gives its time, or another source."""
    mark: str
    """Character of the event in a terminal."""
    ink: Ink


IDLE: Final = EventKind("idle", "idle", MARGIN.reference, ".", "idle")
"""Rest of the slice."""


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


class Starter(NamedTuple):
    """Parts of a new profile that the kind decides."""

    bus: str
    """Section [bus] in TOML, without its nodes and its host."""
    host: str = ""
    """Host of a new profile, unless another is asked for; empty where the profile says nothing of its host."""
    period: str = "1ms"
    """Communication period, unless another is asked for."""
    slice_ratio: str = "1            # the whole period is for communication"
    """Value of cycle.slice_ratio, with a comment."""
    measure: str = "measure it on a node"
    """Advice on finding execution times: a format with `file`, the profile, and `group`, an option of `calibrate`."""
    node: str = ""
    """Commented lines of a node, for keys that have no right default."""
    variants: Mapping[str, str] = {}
    """Other buses of the kind by name: further lines of [bus], as of "can-fd", or a whole section, "profibus"."""
    without_wake_up: tuple[str, ...] = ()
    """Variants that have no key of the host's wake-up."""
    servos: Mapping[str, Mapping[str, tuple[int, str]]] = {}
    """Variants whose nodes are servos of one axis: their data by direction [bytes], each with its meaning."""
    rate: str = ""
    """Key of [bus] with a bit rate that a user is asked for; empty where there is only one."""
    base: str = "time of a node's work in each cycle"
    """Meaning of execution.base_us."""
    bases_us: Mapping[str, int] = {}
    """Value of execution.base_us in variants whose nodes are known to take longer than others [us]."""
    table: str = ""
    """Keys of a published execution time, in place of a guess."""
    tables: Mapping[str, str] = {}
    """The same by variant, where one has its own."""
    more: str = ""
    """Commented lines at the end of the profile."""

    def execution(self, variant: str = "") -> str:
        """Keys of a node's execution time, which is assumed unless the kind, or the variant, has a better one."""
        return (
            self.tables.get(variant)
            or self.table
            or f"""\
kind = "linear"
grade = "assumed"          # between 0 and twice its value
base_us = {self.bases_us.get(variant, 20)}               # assumed: {self.base}
per_byte_us = 0.1          # assumed: time per byte
"""
        )

    def section(self, host: Iterable[str], variant: str) -> str:
        """Section [bus] with lines on the host and those of a variant, or the variant's own section."""
        more = self.variants.get(variant, "")
        bus, more = (more, "") if more.startswith("[bus]") else (self.bus, more)
        given = tuple(host)
        # A commented key is a proposal.
        proposed = tuple(f"# {line.partition('=')[0]}=" for line in given)
        kept = (line for line in bus.splitlines() if not line.startswith(proposed))
        return "\n".join(filter(None, (*kept, *given, more)))


@unique
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
    """Nodes moved to a second bus."""


class Setting(NamedTuple):
    """A setting of the bus that a plan may change without new parts."""

    name: str
    """Name in options, such as gap_count."""
    label: str
    """Name in a sentence, such as gap count."""
    cost: Cost
    keys: tuple[str, ...]
    """Dotted keys that the setting changes."""
    values: tuple[Mapping[str, Value], ...]
    """Other values for this network, as new values by key: safe ones first, then the smallest change."""


class Perturbation(NamedTuple):
    """A small change of a profile that shows its effect on the margin."""

    label: str
    changes: Mapping[str, Value]
    """New value by dotted key."""
    why_not: str = ""
    """Reason why the change cannot be made here; empty where it can."""
    if_nothing: str = ""
    """Reason for an unchanged margin, where there is one."""


class PayloadRange(NamedTuple):
    """Payloads that a plan may choose from: the largest, and the step between them."""

    step_bytes: int
    most_bytes: int
    carrier: str = "a packet"
    """Name, in messages, of the carrier that bounds a payload."""


class PacketTime(NamedTuple):
    """Part of a measured latency that is not the execution [us]."""

    us: float
    """Time of the packets."""
    shortest_us: float = 0.0
    """Shortest time that the bus waits for the node: a latency does not show a shorter execution."""


class MeasuredLatencies(NamedTuple):
    """Calibration of execution times from latencies that were measured on a kind of bus."""

    packets: Callable[[Network, str, str, str, int], PacketTime]
    """Time of the packets of a transaction, by network, name of the group, timing model, "read" or "write", and payload
    [bytes]; raises a BusplanError where its latency could not be measured.
    """
    fit_keys: Callable[[Network, str], dict[str, Value]]
    """Keys of [node.execution] that record how an execution time was fitted, by network and by the timing model whose
    packet times were subtracted.
    """


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
