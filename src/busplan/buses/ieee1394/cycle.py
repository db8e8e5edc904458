"""The individual schedule, a read and a write of each node, and the base class of both schedules."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial, reduce
from itertools import product, repeat
from math import ceil, inf
from typing import Final

from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, Doubt, Premise, Run, summed
from busplan.buses.figure import AVAILABLE, NONPERIODIC, Ink, by_key
from busplan.buses.ieee1394 import doubts, equations
from busplan.buses.ieee1394.constants import (
    c,
)
from busplan.buses.ieee1394.doubts import ACKNOWLEDGED, UNACKNOWLEDGED
from busplan.buses.ieee1394.figures import JITTER, LATENCY, READS, SYNC, TERMS, WRITES, Ieee1394Figures
from busplan.buses.ieee1394.timing import NO_PHASES, Delays, Phases, TimingModelName, delays
from busplan.buses.ieee1394.transactions import (
    Exchange,
    GroupHops,
    charges_own_hops,
    events,
    exchange,
    group_hops,
    is_broadcast,
    link_of,
    safe_gap_count_of,
)
from busplan.buses.network import Group, Network
from busplan.buses.parts import EventKind
from busplan.buses.time_slice import required_time_slice_us, time_slice_us
from busplan.elementwise import Number, choose, is_everywhere, is_off, larger, named, rounded_down, smaller, step, total
from busplan.sections.base import TRANSACTION_KINDS, TransactionKind

_PHASES: Final = by_key(LATENCY)


def _kind(key: str, label: str, phase: str, mark: str, ink: Ink) -> EventKind:
    return EventKind(key, label, _PHASES[phase].reference, mark, ink)


def _name_phases(phases: Phases, suffix: str) -> None:
    """Give the phases of a transaction their names in a derivation."""
    for key, us in phases._asdict().items():
        named(us, key, _PHASES[key].symbol + suffix)


EVENTS: Final = (
    EventKind("jitter", "host's jitter", "profile", "j", "contention"),
    EventKind("cycle_start", "cycle start", "profile", "C", "sync"),
    EventKind("sync", "synchronous packet", SYNC.reference, "S", "sync"),
    _kind("arbitration", "arbitration", "arbitration_us", "a", "contention"),
    _kind("request_data", "request data", "request_data_us", ">", "request"),
    _kind("acknowledge", "acknowledge", "acknowledge_us", "k", "acknowledge"),
    _kind("hold", "bus held for the response", "hold_us", "h", "response"),
    _kind("execution", "execution", "execution_us", "=", "work"),
    _kind("worst_extra", "slowest execution", "worst_extra_us", "x", "work"),
    _kind("response_data", "response data", "response_data_us", "<", "response"),
    _kind("subaction_gap", "subaction gap", "subaction_gap_us", ",", "gap"),
    _kind("arbitration_reset_gap", "arbitration reset gap", "arbitration_reset_gap_us", ":", "long-gap"),
    EventKind("node_wait", "wait of a node", "broadcast", "w", "gap"),
    EventKind("allowance", "allowance for a faster node", "idle", "+", "gap"),
    _kind("host", "host", "host_us", "o", "contention"),
    EventKind("retry", "busy retry", "profile", "r", "request"),
    EventKind("nonperiodic", "non-periodic window", NONPERIODIC.reference, "N", "reserve"),
)
"""Kinds of events in the order of the cycle."""
STRETCHES: Final = (
    EventKind("read", "reads", "", "R", "in"),
    EventKind("write", "writes", "", "W", "out"),
)
"""Kinds of stretches, each a sequence of events."""


PREMISES: Final = (
    Premise("", "packets and cables alone, never measured", applies=lambda cycle: not cycle.link.has_gaps),
    Premise("host.transaction_us", "an instant host", 10.0),
    Premise("bus.sync_jitter_us", "cycles without jitter", 20.0),
    Premise("cycle.retries", "no busy retries", 1),
    Premise("bus.isochronous_us", "no isochronous traffic", 20.0, lambda cycle: cycle.network.profile.bus.cycle_master),
    Premise("bus.phy_delay_us", "PHYs of 14 ticks", 0.144),
    Premise("bus.max_hops", "a chain of cables", 63),
)


class CycleWithStarts(BusCycle):
    """One communication cycle with its cycle starts; a subclass gives the packets of its schedule.

    References
    ----------
    Linux, drivers/firewire/core.h: a cycle start goes each 125 us.
    """

    term_figures = TERMS
    record = Ieee1394Figures
    premises = PREMISES
    command_events = (("write", "request_data"), ("write", "execution"), ("write", "worst_extra"))
    model: TimingModelName

    def __init__(self, network: Network, model: TimingModelName) -> None:
        self.network = network
        self.model = model
        self.link = link_of(network)

    @abstractmethod
    def schedule(self) -> Iterator[BusEvent | Run]:
        """Events of the cycle in the order of the protocol, without the retries and the window that follow them."""

    @abstractmethod
    def longest(self, kind: TransactionKind) -> Phases:
        """The maximum of each phase over all reads or all writes [us]."""

    @cached_property
    def delays(self) -> Delays:
        """Arbitration, acknowledge and gaps over the hops to the farthest node [us]."""
        return delays(self.link, model=self.model, alone=self.network.nodes == 1)

    @cached_property
    def cycle_start_us(self) -> Number:
        """Cost of a cycle start [us].

        It destroys idle time that has already run. It goes at S100; without gaps, at the rate of the bus.
        """
        delays = self.delays
        data_us = equations.data_phase_us(
            delays.link.hops,
            hop_us=delays.hop_us,
            packet_bytes=c.CYCLE_START_BYTES,
            data_rate_mbit_s=c.by_key("DATA_RATE_MBIT_S")["S100"] if self.link.has_gaps else self.link.data_rate_mbit_s,
        )
        isochronous_us: Number = self.network.profile.bus.isochronous_us
        return delays.gaps.arbitration_reset_us + delays.arbitration_us + data_us + isochronous_us

    def starts(self, terms_us: Number) -> Number:
        """Number of cycle starts in a cycle whose other terms take `terms_us` [1].

        The smallest whole n with n > (other terms + n start) / 125 us. Less than 1 us between two starts counts as 1
        us: the number stays finite, and the limit of cycle starts reports the fault.
        """
        left_us = c.CYCLE_US - self.cycle_start_us
        return rounded_down(terms_us / larger(left_us, c.LEAST_ASYNCHRONOUS_US)) + 1

    @property
    def _has_starts(self) -> bool:
        return self.model != "paper" and bool(self.network.profile.bus.cycle_master)

    @cached_property
    def _terms_without_starts(self) -> dict[str, Number]:
        return summed(self.runs, (figure.key for figure in TERMS))

    @property
    def _late_us(self) -> Number:
        """Latest start by the host [us]; a cycle start before it delays nothing. The paper has no term for it."""
        jitter_us: Number = self.network.profile.bus.sync_jitter_us
        return 0.0 if self.model == "paper" else jitter_us

    @cached_property
    def _without_starts_us(self) -> Number:
        """Time from the host's start to the end of the cycle, without cycle starts [us]."""
        return total(us for term, us in self._terms_without_starts.items() if term != JITTER.key)

    @cached_property
    def number_of_starts(self) -> Number:
        """Number of cycle starts in the cycle [1]."""
        return self.starts(self._without_starts_us) if self._has_starts else 0

    def written(self) -> Iterator[BusEvent | Run]:
        """All events but the cycle starts: they go between the rounds, and their number depends on these events."""
        late = "latest start by the host"
        yield BusEvent("jitter", JITTER.key, self._late_us, late, rests_on="bus.sync_jitter_us")
        yield from self.schedule()
        retries: Number = self.network.profile.cycle.retries
        if self.model != "paper" and not is_off(retries):
            delays = self.delays
            longest_us = larger(self.longest("read").request_data_us, self.longest("write").request_data_us)
            retry_us = delays.arbitration_us + longest_us + delays.acknowledge_us + delays.gaps.arbitration_reset_us
            yield Run((BusEvent("retry", "retries_us", retry_us, "busy retry of the longest request"),), retries)
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    @property
    def _start(self) -> BusEvent:
        return BusEvent("cycle_start", "cycle_starts_us", self.cycle_start_us, "cycle start")

    @cached_property
    def by_term(self) -> Mapping[str, Number]:
        """Time of each term by its key [us]."""
        starts = (Run((self._start,), self.number_of_starts),) if self._has_starts else ()
        return self._terms_without_starts | summed(starts, (self._start.term,))

    @abstractmethod
    def all_us(self, kind: TransactionKind) -> Number:
        """Time of all reads T_r or all writes T_w of a cycle, gaps included [us]."""

    @cached_property
    @step(READS.symbol)
    def reads_us(self) -> Number:
        """Time T_r of all reads [us]."""
        return self.all_us("read")

    @cached_property
    @step(WRITES.symbol)
    def writes_us(self) -> Number:
        """Time T_w of all writes [us]."""
        return self.all_us("write")

    @property
    def required_time_slice_us(self) -> Number:
        """Time slice that a node needs, equation (2), with jitter, cycle starts and retries beside it [us]."""
        terms, nodes = self.by_term, self.network.nodes
        slice_us = required_time_slice_us(
            self.reads_us,
            writes_us=self.writes_us,
            nonperiodic_us=terms[NONPERIODIC.key],
            sync_us=terms[SYNC.key],
            nodes=nodes,
        )
        added = [us for us in (terms[JITTER.key], terms["cycle_starts_us"], terms["retries_us"]) if not is_off(us)]
        return slice_us + total(added) / nodes if added else slice_us

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:
        """Growth of the cycle when its transactions take longer; cycle starts may be added [us]."""
        if not self._has_starts:
            return extra_us
        before_us = self._without_starts_us + after_us
        more = self.starts(before_us + extra_us) - self.starts(before_us)
        return extra_us + more * self.cycle_start_us

    def sync_jitter_us(self) -> Number:
        """Half of the host's jitter: all of a cycle moves with its start [us]."""
        return self._late_us / 2

    def taking_us(self, group: Group) -> float:
        """Execution time after a write [us]; 0 for a split write, which contains it."""
        is_split = group.node.write_response == "split" and not is_broadcast(self.network)
        return 0.0 if is_split else super().taking_us(group)

    def loop_periods(self, *, at_sync: bool) -> int:
        """Periods inside a loop [1].

        With `at_sync` 1, or more where a node has not executed its command when the next synchronous packet comes; else
        0, as commands take effect on arrival.
        """
        if not at_sync:
            return 0
        behind_us = max(self.taking_us(group) for group in self.network.groups)
        period_us = self.network.period_us
        needed_us = min(self.required_us, period_us)
        return ceil((needed_us + behind_us) / period_us) if behind_us else 1

    def figures(self) -> Mapping[str, Number | None]:
        """Settings of the bus, latencies, gaps, and the number of nodes by equation (11)."""
        read, write, safe = self.longest("read"), self.longest("write"), safe_gap_count_of(self.network)
        return {
            "hops": self.link.hops,
            "gap_count": self.link.gap_count,
            "safe_gap_count": safe,
            "gap_count_safe": self.link.gap_count >= safe,
            "read_latency_us": read.latency_us,
            "write_latency_us": write.latency_us,
            "read_latency_with_gaps_us": read.latency_with_gaps_us,
            "write_latency_with_gaps_us": write.latency_with_gaps_us,
            "read_transaction_us": read.transaction_us,
            "write_transaction_us": write.transaction_us,
            "gaps_us": self.delays.gaps.both_us,
            "subaction_gap_us": self.delays.gaps.subaction_us,
            "arbitration_reset_gap_us": self.delays.gaps.arbitration_reset_us,
            READS.key: self.reads_us,
            WRITES.key: self.writes_us,
            "nodes_eq11": self.published_nodes(),
        }

    def published_nodes(self) -> Number | None:
        """Number of nodes by equation (11) [1]; None where the paper has none for the schedule or the nodes."""
        return None

    @property
    def executes(self) -> bool:
        """Whether execution is on the bus: only split answers put it there; other answers and broadcasts do not."""
        return self.network.bus.has_execution(self.network)

    def each_round(self) -> Iterator[Iterable[BusEvent]]:
        """Rounds of the cycle, node by node; a cycle start goes when it is due, or at the end."""
        starts, start_us = int(self.number_of_starts), self.cycle_start_us
        start = (self._start._replace(us=start_us),)
        sent, now_us = 0, 0.0
        late, *rounds = map(tuple, super().each_round())
        if self._late_us:
            yield late
        for round_ in rounds:
            while sent < starts and now_us >= sent * c.CYCLE_US:
                yield start
                sent, now_us = sent + 1, now_us + start_us
            yield round_
            for event in round_:
                now_us += event.us
        yield from repeat(start, starts - sent)

    def added_before_us(self, sent_us: float) -> float:
        """Time of the cycle starts that are due before a round [us]."""
        due = smaller(self.starts(sent_us - self._late_us), self.number_of_starts)
        return due * self.cycle_start_us


class Ieee1394Cycle(CycleWithStarts):
    """The synchronous packet, a read and then a write of every node, and the window for non-periodic data.

    The times of a node count the hops of the farthest node or, with `charge_hops = "own"`, its own; its arbitration
    counts its own hops only where the host is the root. Packets for all nodes, such as the synchronous packet, always
    go to the farthest.

    References
    ----------
    Paper, section III-C and equations (2)-(11), Figs. 4, 5 and 7.
    """

    @cached_property
    def exchanges(self) -> tuple[Exchange, ...]:
        """Transactions of the cycle, each with the mean node of its group."""
        return self._exchanges([hops.mean for hops in self._hops])

    @cached_property
    def _farthest(self) -> tuple[Exchange, ...]:
        """Transactions with the farthest node of each group."""
        is_mean = not charges_own_hops(self.network)
        return self.exchanges if is_mean else self._exchanges([hops.last for hops in self._hops])

    @cached_property
    def _hops(self) -> tuple[GroupHops, ...]:
        if charges_own_hops(self.network):
            return group_hops(self.network)
        return tuple(GroupHops.alike(self.link.hops) for _ in self.network.groups)

    def _exchanges(self, hops: Sequence[Number]) -> tuple[Exchange, ...]:
        """Transactions of all groups, each with a node at the given hops; a derivation tells their phases apart."""
        places = range(len(self.network.groups))
        groups = self.network.groups
        exchanges = tuple(
            self._exchange(place, kind, hops[place])
            for kind in TRANSACTION_KINDS
            for place in places
            if groups[place].has(kind)
        )
        for sent in exchanges:
            _name_phases(sent.phases, f",{sent.kind}{sent.group.name and f',{sent.group.name}'}")
        return exchanges

    def _exchange(self, place: int, kind: TransactionKind, hops: Number) -> Exchange:
        """Transaction with a node at the given hops, of the group at `place`."""
        delays = self.delays_to(hops)
        return exchange(self.network, self.network.groups[place], kind, model=self.model, delays=delays)

    def delays_to(self, hops: Number) -> Delays:
        """Delays to a node at the given hops; its arbitration goes to the root, which may be any node [us]."""
        farthest = self.delays
        if not charges_own_hops(self.network):
            return farthest
        delays = farthest.over(hops)
        if self.network.profile.bus.root == "host":
            return delays
        return delays._replace(arbitration_us=farthest.arbitration_us, arbitration_hops=farthest.arbitration_hops)

    def delays_to_farthest(self, name: str) -> Delays:
        """Delays to the farthest node of the group of that name [us]."""
        groups = enumerate(self.network.groups)
        place = next(place for place, group in groups if name in [member.name for member in group.members])
        return self.delays_to(self._hops[place].last)

    @cached_property
    def sync_us(self) -> Number:
        """Time CTS of the synchronous packet that opens the cycle [us].

        In `paper` it is the measured latency; in `standard` a broadcast write without an acknowledge, which is the
        host's first packet of the fairness interval.
        """
        if self.model == "paper":
            sync = self.network.profile.cycle.sync
            ping_us: Number = sync.ping_us + sync.ping_per_node_us * (self.network.nodes - 1)
            return ping_us
        delays = self.delays
        return delays.arbitration_us + delays.data_us(c.SYNC_PACKET_BYTES) + delays.gaps.arbitration_reset_us

    def schedule(self) -> Iterator[BusEvent | Run]:
        """The synchronous packet, then each transaction of every node."""
        yield BusEvent("sync", "sync_us", self.sync_us, "synchronous packet")
        places = {id(group): place for place, group in enumerate(self.network.groups)}
        for kind in TRANSACTION_KINDS:
            for transaction in self.exchanges:
                if transaction.kind == kind:
                    place = places[id(transaction.group)]
                    yield Run(transaction.parts, transaction.nodes, place, partial(self._laid_out, transaction, place))

    def _laid_out(self, transaction: Exchange, place: int, number: Number) -> Iterator[BusEvent]:
        """Events of the transaction with one node of a group; `number` counts the group's nodes from 0."""
        if charges_own_hops(self.network):
            transaction = self._exchange(place, transaction.kind, self._hops[place].of_node(number))
        return events(transaction, model=self.model)

    def all_us(self, kind: TransactionKind) -> Number:
        """Time of the reads or writes of all nodes, gaps included [us]."""
        sent = (exchange for exchange in self.exchanges if exchange.kind == kind)
        return total(exchange.nodes * exchange.phases.transaction_us for exchange in sent)

    def bias_us(self) -> Number | None:
        """Mean time that the transactions take beyond the model [us]; None under the paper model."""
        if self.model == "paper":
            return None
        return doubts.bias_us(self.exchanges, self.network, link=self.link)

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubt of each input that is not known exactly."""
        if self.model == "paper":
            return ()
        # The synchronous packet, retries and cycle starts; `of_cycle` adds the transactions.
        hop_delays = UNACKNOWLEDGED + ACKNOWLEDGED * self.network.profile.cycle.retries
        hop_delays += UNACKNOWLEDGED * self.number_of_starts
        return doubts.of_cycle(self.exchanges, self.network, delays=self.delays, hop_delays=hop_delays)

    def longest(self, kind: TransactionKind) -> Phases:
        """The maximum of each phase over the reads or writes with the farthest node of each group [us]."""
        sent = [(sent.group, sent.phases) for sent in self._farthest if sent.kind == kind]
        if not sent:
            return NO_PHASES
        columns = zip(*([group.if_any(kind, us) for us in phases] for group, phases in sent), strict=True)
        return Phases(*(reduce(larger, column) for column in columns))

    def published_nodes(self) -> Number | None:
        """Number of nodes by equation (11) [1]; None where nodes differ or data go one way alone."""
        network = self.network
        if not network.is_uniform or not all(map(network.groups[0].has, TRANSACTION_KINDS)):
            return None
        read, write = self.longest("read"), self.longest("write")
        given_us = time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)
        nodes = equations.published_nodes(
            named(given_us, AVAILABLE.key, AVAILABLE.symbol),
            sync_us=self.sync_us,
            latency_us=(read.latency_us + write.latency_us) / 2,
            gaps_us=self.delays.gaps.both_us,
        )
        has_both: Number = smaller(network.groups[0].read_bytes, network.groups[0].write_bytes) > 0
        return nodes if is_everywhere(has_both) else choose(has_both, nodes, inf)

    def latencies(self) -> tuple[BusLatency, ...]:
        """Latencies of a read and of a write, with the farthest node of each group."""
        latencies, all_us = [], {"read": self.reads_us, "write": self.writes_us}
        for (place, group), kind in product(enumerate(self.network.groups), TRANSACTION_KINDS):
            if not group.has(kind):
                continue
            sent = self._exchange(place, kind, self._hops[place].last)
            link = sent.delays.link
            phases = {"hops": link.hops, "gap_count": link.gap_count, **sent.phases._asdict(), "all_us": all_us[kind]}
            latencies.append(BusLatency(kind, sent.payload_bytes, phases, sent.group.name))
        return tuple(latencies)
