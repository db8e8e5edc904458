"""One communication cycle on an IEEE 1394 bus: as terms, as events, and the figures that go with it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property, reduce
from itertools import repeat
from typing import Final

from busplan.buses.bus import BusCycle, BusEvent, BusLatency, Doubt, LeftOut, Term
from busplan.buses.figure import AVAILABLE
from busplan.buses.ieee1394 import doubts, equations
from busplan.buses.ieee1394.constants import (
    CYCLE_START_BYTES,
    CYCLE_US,
    DATA_RATE_MBIT_S,
    LEAST_ASYNCHRONOUS_US,
    SYNC_PACKET_BYTES,
    safe_gap_count,
)
from busplan.buses.ieee1394.timing import TIMING_MODELS, Delays, Link, TimingModelName, delays
from busplan.buses.ieee1394.transactions import (
    LATENCY_SYMBOLS,
    Exchange,
    Ways,
    charges_own_hops,
    events,
    exchange,
    link_of,
    ways,
)
from busplan.buses.network import Network
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import Number, is_off, is_one, larger, named, plain, rounded_down, total
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

_OF_TRANSACTIONS: Final = (
    "cycle_arbitration_us",
    "cycle_data_us",
    "cycle_acknowledge_us",
    "cycle_hold_us",
    "cycle_execution_us",
    "cycle_worst_extra_us",
    "cycle_idle_us",
    "cycle_host_us",
)
"""Terms that add up the parts of all transactions."""
_SHOWN: Final = (
    *("latency_us", "latency_with_gaps_us", "transaction_us"),
    *("gaps_us", "subaction_gap_us", "arbitration_reset_gap_us"),
)
"""Phases of a transaction that are figures of a cycle."""


class Ieee1394Cycle(BusCycle):
    """The synchronous packet, a read and then a write of every node, and the window for non-periodic data.

    Every node is charged the hops of the farthest, or, with `charge_hops = "own"`, its own. What all nodes hear, as the
    synchronous packet, goes to the farthest.

    References
    ----------
    Paper, section III-C and equations (2)-(11), Figs. 4, 5 and 7.
    """

    model: TimingModelName

    def __init__(self, network: Network, model: TimingModelName) -> None:
        self.network = network
        self.model = model
        self.link = link_of(network)

    @cached_property
    def exchanges(self) -> tuple[Exchange, ...]:
        """Every transaction of the cycle, group by group."""
        return tuple(
            self._exchange(place, kind, None, suffix=f",{kind}{group.name and f',{group.name}'}")
            for kind in TRANSACTION_KINDS
            for place, group in enumerate(self.network.groups)
        )

    @cached_property
    def _ways(self) -> tuple[Ways, ...]:
        return ways(self.network)

    def _exchange(self, place: int, kind: TransactionKind, hops: Number | None, *, suffix: str = "") -> Exchange:
        """The transaction of a group by its place, with a node at some hops or, without them, on the mean."""
        network, own = self.network, charges_own_hops(self.network)
        link = self.link._replace(hops=self._ways[place].mean if hops is None else hops) if own else self.link
        common = self._delays_of(link, self._delays) if own else self._delays
        return exchange(network, network.groups[place], kind, model=self.model, link=link, common=common, suffix=suffix)

    @cached_property
    def _delays(self) -> Delays:
        return self._delays_of(self.link, None)

    def _delays_of(self, link: Link, shared: Delays | None) -> Delays:
        found = delays(link, model=TIMING_MODELS[self.model], alone=is_one(self.network.nodes), shared=shared)
        for key, number in (
            ("arbitration_us", found.arbitration_us),
            ("acknowledge_us", found.acknowledge_us),
            ("subaction_gap_us", found.gaps.subaction_us),
            ("arbitration_reset_gap_us", found.gaps.arbitration_reset_us),
            ("gaps_us", found.gaps.both_us),
        ):
            named(number, key, LATENCY_SYMBOLS[key])
        return found

    @cached_property
    def sync_us(self) -> Number:
        """CTS, the synchronous packet that opens the cycle [us].

        In `paper` its measured latency; in `standard` a broadcast write without an acknowledge, the host's first packet
        of the interval.
        """
        if self.model == "paper":
            sync = self.network.profile.cycle.sync
            ping_us: Number = sync.ping_us + sync.ping_per_node_us * (self.network.nodes - 1)
            return ping_us
        own, link = self._delays, self.link
        data_us = equations.data_phase_us(
            link.hops, hop_us=own.hop_us, packet_bytes=SYNC_PACKET_BYTES, data_rate_mbit_s=link.data_rate_mbit_s
        )
        return own.arbitration_us + data_us + own.gaps.arbitration_reset_us

    @cached_property
    def retries_us(self) -> Number:
        """Busy retries of the longest request, each with an arbitration reset gap [us]."""
        retries: Number = self.network.profile.cycle.retries
        if is_off(retries):
            return 0.0
        own = self._delays
        longest_us = reduce(larger, (one.phases.request_data_us for one in self.exchanges))
        return retries * (own.arbitration_us + longest_us + own.acknowledge_us + own.gaps.arbitration_reset_us)

    @cached_property
    def cycle_start_us(self) -> Number:
        """What one cycle start costs: it destroys idle time already run, and goes at S100 [us]."""
        own, link = self._delays, self.link
        data_us = equations.data_phase_us(
            link.hops, hop_us=own.hop_us, packet_bytes=CYCLE_START_BYTES, data_rate_mbit_s=DATA_RATE_MBIT_S["S100"]
        )
        isochronous_us: Number = self.network.profile.bus.isochronous_us
        return own.gaps.arbitration_reset_us + own.arbitration_us + data_us + isochronous_us

    def starts(self, others_us: Number) -> Number:
        """Number of cycle starts in a cycle whose other terms take some time [1].

        The smallest whole n with n > (others + n start) / 125 us. Starts that leave less than 1 us to each other are
        counted as if they left that: the number is finite, and the limit of cycle starts is broken.

        Parameters
        ----------
        others_us
            All other terms [us]; of any sort.
        """
        left_us = CYCLE_US - self.cycle_start_us
        return rounded_down(others_us / larger(left_us, LEAST_ASYNCHRONOUS_US)) + 1

    @property
    def _has_starts(self) -> bool:
        return self.model != "paper" and bool(self.network.profile.bus.cycle_master)

    @cached_property
    def _others(self) -> tuple[Term, ...]:
        """All terms but the cycle starts, whose number follows from them."""
        own: dict[str, Number] = dict.fromkeys(_OF_TRANSACTIONS, 0.0)
        for one in self.exchanges:
            by_term: dict[str, list[Number]] = {}
            for part in one.parts:
                if not is_off(part.us):
                    by_term.setdefault(part.term, []).append(part.us)
            for term, parts_us in by_term.items():
                own[term] = own[term] + one.nodes * _sum(parts_us)
        retries_us = 0.0 if self.model == "paper" else self.retries_us
        return (
            Term("sync_us", self.sync_us),
            *(Term(key, us) for key, us in own.items()),
            Term("retries_us", retries_us),
            Term("nonperiodic_us", self.network.nonperiodic_us),
        )

    @cached_property
    def _others_us(self) -> Number:
        return total(one.us for one in self._others)

    @cached_property
    def _number_of_starts(self) -> Number:
        return self.starts(self._others_us) if self._has_starts else 0

    def computed_terms(self) -> tuple[Term, ...]:
        """The cycle in the order of the wire."""
        starts_us = self._number_of_starts * self.cycle_start_us if self._has_starts else 0.0
        return (Term("cycle_starts_us", starts_us), *self._others)

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:
        """What the cycle grows by if its transactions take longer: there may be more cycle starts, too [us]."""
        if not self._has_starts:
            return extra_us
        before_us = self._others_us + after_us
        more = self.starts(before_us + extra_us) - self.starts(before_us)
        return extra_us + more * self.cycle_start_us

    def bias_us(self) -> Number | None:
        """What the transactions take beyond the model, on the mean [us]."""
        if not self._is_known:
            return None
        return doubts.bias_us(self.exchanges, self.network, gap_count=self.link.gap_count)

    def doubts(self) -> tuple[Doubt, ...]:
        """What is not known exactly."""
        if not self._is_known:
            return ()
        # The hops of the synchronous packet, of retries and of cycle starts; those of transactions come to them.
        hop_delays = 2 + 3 * self.network.profile.cycle.retries + 2 * self._number_of_starts
        return doubts.of_cycle(
            self.exchanges, self.network, link=self.link, gaps=self._delays.gaps, hop_delays=hop_delays
        )

    @property
    def _is_known(self) -> bool:
        """Whether the error of the model is known: of the one that decides."""
        return self.model == "standard"

    def figures(self) -> Mapping[str, Number | None]:
        """How the bus is set, the latencies, and the number of nodes as the paper has it."""
        network, read, write = self.network, self._longest("read"), self._longest("write")
        safe = safe_gap_count(self.link.hops)
        given_us = time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)
        return {
            "hops": self.link.hops,
            "gap_count": self.link.gap_count,
            "safe_gap_count": safe,
            "gap_count_safe": self.link.gap_count >= named(safe, "safe_gap_count", "g_safe"),
            "read_latency_us": read["latency_us"],
            "write_latency_us": write["latency_us"],
            "read_latency_with_gaps_us": read["latency_with_gaps_us"],
            "write_latency_with_gaps_us": write["latency_with_gaps_us"],
            "read_transaction_us": read["transaction_us"],
            "write_transaction_us": write["transaction_us"],
            "gaps_us": read["gaps_us"],
            "subaction_gap_us": read["subaction_gap_us"],
            "arbitration_reset_gap_us": read["arbitration_reset_gap_us"],
            "nodes_eq11": equations.published_nodes(
                named(given_us, AVAILABLE.key, AVAILABLE.symbol),
                sync_us=self.sync_us,
                latency_us=(read["latency_us"] + write["latency_us"]) / 2,
                gaps_us=read["gaps_us"],
            )
            if network.is_uniform
            else None,
        }

    def _longest(self, kind: TransactionKind) -> dict[str, Number]:
        """Each of these times of the transactions of one kind with the farthest node of each group, the longest."""
        each = [one.phases for one in self._farthest if one.kind == kind]
        return {key: reduce(larger, (getattr(one, key) for one in each)) for key in _SHOWN}

    @cached_property
    def _farthest(self) -> tuple[Exchange, ...]:
        """Transactions with the farthest node of each group."""
        if not charges_own_hops(self.network):
            return self.exchanges
        return tuple(
            self._exchange(place, kind, self._ways[place].last, suffix=f",{kind}{group.name and f',{group.name}'}")
            for kind in TRANSACTION_KINDS
            for place, group in enumerate(self.network.groups)
        )

    def latencies(self) -> tuple[BusLatency, ...]:
        """One read and one write of the farthest node of each group."""
        places = range(len(self.network.groups))
        found = (self._exchange(place, kind, self._ways[place].last) for place in places for kind in TRANSACTION_KINDS)
        return tuple(
            BusLatency(
                one.kind,
                one.payload_bytes,
                {"hops": one.link.hops, "gap_count": one.link.gap_count, **one.phases._asdict()},
                one.group.name,
            )
            for one in found
        )

    def events(self) -> Iterator[BusEvent]:
        """The cycle in the order of its protocol, node by node; a cycle start goes when it is due, or at the end."""
        starts = self._number_of_starts
        sent, now_us = 0, 0.0
        start = BusEvent("cycle_start", "cycle_starts_us", plain(self.cycle_start_us) if starts else 0.0, "cycle start")
        for stretch in self._stretches():
            while sent < starts and now_us >= sent * CYCLE_US:
                yield start
                sent, now_us = sent + 1, now_us + start.us
            for event in stretch:
                yield event
                now_us += event.us
        for _ in range(int(starts) - sent):
            yield start

    def _stretches(self) -> Iterator[list[BusEvent]]:
        """What no cycle start interrupts."""
        yield [BusEvent("sync", "sync_us", plain(self.sync_us), "synchronous packet")]
        for kind in TRANSACTION_KINDS:
            node = 0
            for place, group in enumerate(self.network.groups):
                for one in self._of_each_node(place, kind, int(group.nodes)):
                    node += 1
                    yield [part._replace(node=node, transaction=kind) for part in events(one, model=self.model)]
        retries = 0 if self.model == "paper" else self.network.profile.cycle.retries
        for _ in range(retries):
            retry_us = plain(self.retries_us) / retries
            yield [BusEvent("retry", "retries_us", retry_us, "busy retry of the longest request")]
        yield [BusEvent("nonperiodic", "nonperiodic_us", plain(self.network.nonperiodic_us), "non-periodic window")]

    def _of_each_node(self, place: int, kind: TransactionKind, nodes: int) -> Iterable[Exchange]:
        """The transaction with each node of a group."""
        if not charges_own_hops(self.network):
            return repeat(
                next(one for one in self.exchanges if one.kind == kind and one.group is self.network.groups[place]),
                nodes,
            )
        return (self._exchange(place, kind, self._ways[place].of_node(number)) for number in range(nodes))

    def left_out(self) -> tuple[LeftOut, ...]:
        """What the cycle could have and does not say."""
        host = () if self.network.profile.host.transaction_us else (LeftOut("host time", "host.transaction_us"),)
        split = {id(one.group) for one in self.exchanges if one.responder.answer == "split"}
        return (
            *host,
            *(
                LeftOut("the slowest execution", group.key("execution.worst_extra_us"))
                for group in self.network.groups
                if id(group) in split and not group.worst_extra_us
            ),
        )


def _sum(parts_us: Sequence[Number]) -> Number:
    """The sum of some parts, one or more; of equal ones as a product, which a derivation shows shorter."""
    first_us = parts_us[0]
    return len(parts_us) * first_us if all(one is first_us for one in parts_us) else total(parts_us)
