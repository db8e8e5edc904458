"""The individual schedule, a read and a write of each node, and the figures that go with it."""

from collections.abc import Iterator, Mapping
from functools import cached_property, partial, reduce
from typing import Final

from busplan.buses.cycle import BusEvent, BusLatency, Doubt, LeftOut, Run
from busplan.buses.figure import AVAILABLE
from busplan.buses.ieee1394 import doubts, equations
from busplan.buses.ieee1394.constants import SYNC_PACKET_BYTES
from busplan.buses.ieee1394.cycle_starts import CycleWithStarts
from busplan.buses.ieee1394.timing import Delays, Link
from busplan.buses.ieee1394.transactions import (
    Exchange,
    Ways,
    charges_own_hops,
    events,
    exchange,
    ways,
)
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import Number, larger, named
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

_SHOWN: Final = (
    *("latency_us", "latency_with_gaps_us", "transaction_us"),
    *("gaps_us", "subaction_gap_us", "arbitration_reset_gap_us"),
)
"""Phases of a transaction that are figures of a cycle."""


class Ieee1394Cycle(CycleWithStarts):
    """The synchronous packet, a read and then a write of every node, and the window for non-periodic data.

    The times of a node count the hops of the farthest node or, with `charge_hops = "own"`, its own; its arbitration
    counts its own only where the host is the root. What all nodes hear, as the synchronous packet, goes to the
    farthest.

    References
    ----------
    Paper, section III-C and equations (2)-(11), Figs. 4, 5 and 7.
    """

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
        common = self._own_delays(link) if own else self.delays
        return exchange(network, network.groups[place], kind, model=self.model, link=link, common=common, suffix=suffix)

    def _own_delays(self, link: Link) -> Delays:
        """Delays over a node's own hops; its arbitration goes to the root, which may be any node."""
        own = self.delays_of(link, self.delays)
        is_at_host = self.network.profile.bus.root == "host"
        return own if is_at_host else own._replace(arbitration_us=self.delays.arbitration_us)

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
        own, link = self.delays, self.link
        data_us = equations.data_phase_us(
            link.hops, hop_us=own.hop_us, packet_bytes=SYNC_PACKET_BYTES, data_rate_mbit_s=link.data_rate_mbit_s
        )
        return own.arbitration_us + data_us + own.gaps.arbitration_reset_us

    @property
    def longest_request_us(self) -> Number:
        """Data phase of the longest request, to the farthest node of its group [us]."""
        return reduce(larger, (transaction.phases.request_data_us for transaction in self._farthest))

    def schedule(self) -> Iterator[BusEvent | Run]:
        """The synchronous packet, and each transaction of every node."""
        yield BusEvent("sync", "sync_us", self.sync_us, "synchronous packet")
        for kind in TRANSACTION_KINDS:
            for place, transaction in enumerate(each for each in self.exchanges if each.kind == kind):
                yield Run(transaction.parts, transaction.nodes, place, partial(self._laid_out, transaction, place))

    def _laid_out(self, transaction: Exchange, place: int, number: Number) -> Iterator[BusEvent]:
        """The transaction with a node of a group, by the node's number in it from 0."""
        if charges_own_hops(self.network):
            transaction = self._exchange(place, transaction.kind, self._ways[place].of_node(number))
        return events(transaction, model=self.model)

    def bias_us(self) -> Number | None:
        """Mean time that the transactions take beyond the model [us]; None under the paper model."""
        if not self.is_known:
            return None
        return doubts.bias_us(self.exchanges, self.network, gap_count=self.link.gap_count)

    def doubts(self) -> tuple[Doubt, ...]:
        """Inputs that are not known exactly."""
        if not self.is_known:
            return ()
        # Hops of the synchronous packet, of retries and of cycle starts; `of_cycle` adds those of transactions.
        hop_delays = 2 + 3 * self.network.profile.cycle.retries + 2 * self.number_of_starts
        return doubts.of_cycle(
            self.exchanges, self.network, link=self.link, gaps=self.delays.gaps, hop_delays=hop_delays
        )

    def figures(self) -> Mapping[str, Number | None]:
        """Settings of the bus, the latencies and gaps, and the number of nodes by equation (11)."""
        network, read, write = self.network, self._longest("read"), self._longest("write")
        given_us = time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)
        return {
            **self.setup(),
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
        """The longest of each phase, over the reads or writes with the farthest node of each group."""
        each = [transaction.phases for transaction in self._farthest if transaction.kind == kind]
        return {key: reduce(larger, (getattr(phases, key) for phases in each)) for key in _SHOWN}

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
        """A read and a write of the farthest node of each group."""
        places = range(len(self.network.groups))
        farthest = (
            self._exchange(place, kind, self._ways[place].last) for place in places for kind in TRANSACTION_KINDS
        )
        return tuple(
            BusLatency(
                transaction.kind,
                transaction.payload_bytes,
                {
                    "hops": transaction.link.hops,
                    "gap_count": transaction.link.gap_count,
                    **transaction.phases._asdict(),
                },
                transaction.group.name,
            )
            for transaction in farthest
        )

    def left_out(self) -> tuple[LeftOut, ...]:
        """Parts of the cycle that the profile does not give."""
        split = {id(transaction.group) for transaction in self.exchanges if transaction.responder.answer == "split"}
        return (
            *super().left_out(),
            *(
                LeftOut("the slowest execution", group.key("execution.worst_extra_us"))
                for group in self.network.groups
                if id(group) in split and not group.worst_extra_us
            ),
        )
