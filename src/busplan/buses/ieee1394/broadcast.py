"""The broadcast schedule: a query, a broadcast of each node, a read of the hub that collected them, a write.

It is the schedule of the da Vinci Research Kit (dVRK). The query is a quadlet write to the hub, and all nodes hear it.
Each node then broadcasts its data without an acknowledge, in the order of the nodes. The hub collects them in a block,
which the host reads; the answer is concatenated. One block write, also to the hub, carries the commands of all nodes.
Every packet goes to the farthest node. No execution time is on the bus.

References
----------
Z. Chen, P. Kazanzides, "Multi-Kilohertz Control of Multiple Robots via IEEE-1394 (FireWire)", TePRA 2014; JHU
mechatronics-firmware and mechatronics-software.
"""

from collections.abc import Iterator
from functools import cached_property, partial

from busplan.buses.cycle import BUT_FIRST, FIRST, BusEvent, BusLatency, Doubt, Run
from busplan.buses.ieee1394 import doubts, equations
from busplan.buses.ieee1394.constants import (
    c,
    padded_bytes,
)
from busplan.buses.ieee1394.cycle import CycleWithStarts
from busplan.buses.ieee1394.doubts import ACKNOWLEDGED, CONCATENATED, UNACKNOWLEDGED
from busplan.buses.ieee1394.timing import IdleTime, Phases, Responder, idle_time, transaction
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, choose, is_everywhere, is_off, larger, step, total
from busplan.sections.base import TransactionKind


def hub_block_bytes(network: Network) -> Number:
    """Payload of the hub's block: a sequence quadlet and the data of each node, and one timing quadlet [bytes]."""
    return (
        total(group.nodes_with("read") * _with_quadlet(group.read_bytes) for group in network.groups)
        + c.HUB_TIMING_BYTES
    )


def write_block_bytes(network: Network) -> Number:
    """Payload of the write: a header quadlet and the command of each node [bytes]."""
    return total(group.nodes_with("write") * _with_quadlet(group.write_bytes) for group in network.groups)


def _with_quadlet(payload_bytes: Number) -> Number:
    return padded_bytes(payload_bytes) + c.BROADCAST_NODE_BYTES


class BroadcastCycle(CycleWithStarts):
    """The query, the nodes' broadcasts, the read of the hub, the write, and the window for non-periodic data.

    References
    ----------
    `busplan manual models`, the broadcast schedule.
    """

    @cached_property
    @step("T_query")
    def query_us(self) -> Number:
        """Time of the query with its acknowledge [us]."""
        data_us = self.delays.data_us(c.QUADLET_WRITE_REQUEST_BYTES)
        return self.delays.arbitration_us + data_us + self.delays.acknowledge_us

    @property
    def _is_isochronous(self) -> bool:
        return bool(self.network.profile.cycle.broadcast_request != "priority")

    @property
    def _is_timed(self) -> bool:
        return bool(self.network.profile.cycle.broadcast_request == "timed")

    @cached_property
    def gap_us(self) -> Number:
        """Idle bus before each broadcast [us]; none for an isochronous request."""
        return 0.0 if self._is_isochronous else self.delays.gaps.subaction_us

    @cached_property
    def _broadcasting(self) -> tuple[Group, ...]:
        """Groups that broadcast data."""
        return tuple(group for group in self.network.groups if group.has("read"))

    def _if_any(self, kind: TransactionKind, number: Number) -> Number:
        """A number of the broadcasts and the read of the hub, or of the write; 0 where no node has data for it."""
        nodes = total(group.nodes_with(kind) for group in self.network.groups)
        return number if is_everywhere(nodes > 0) else choose(nodes > 0, number, 0.0)

    @cached_property
    def first_wait_us(self) -> Number:
        """Wait of the first node after the query, beyond its gap [us]."""
        return self._if_any("read", larger(self._clocks_us(c.FIRST_BROADCAST_CLOCKS) - self.gap_us, 0.0))

    def _clocks_us(self, clocks: Number) -> Number:
        return clocks / c.BROADCAST_CLOCK_MHZ

    def slot_wait_us(self, group: Group) -> Number:
        """Wait of the next node after a broadcast of the group, where each node has its own time [us].

        It is an upper bound for unlike nodes: a node that a long broadcast delays waits less.
        """
        if not self._is_timed:
            return 0.0
        sent_us = self.arbitration_us + self.broadcast_us(group)
        return larger(self._clocks_us(c.BROADCAST_SLOT_CLOCKS) - sent_us, 0.0)

    @cached_property
    def slot_waits_us(self) -> Number:
        """Wait of all nodes after the first for their own times [us]; no wait follows the last broadcast."""
        last_us: Number = 0.0
        for group in self._broadcasting:
            last_us = choose(group.bytes_of("read") > 0, self.slot_wait_us(group), last_us)
        groups = self._broadcasting
        return total(group.nodes_with("read") * self.slot_wait_us(group) for group in groups) - last_us

    @cached_property
    def arbitration_us(self) -> Number:
        """Arbitration of a broadcast [us]; an isochronous request waits for no part of the gap count."""
        if not self._is_isochronous or not self.link.has_gaps:
            return self.delays.arbitration_us
        return equations.arbitration_phase_us(
            self.link.hops, hop_us=self.delays.hop_us, gap_count=0, gap_clock_mbit_s=c.BASE_RATE_MBIT_S
        )

    def broadcast_us(self, group: Group) -> Number:
        """Data phase of a broadcast of the group [us]."""
        return self.delays.data_us(c.BLOCK_WRITE_REQUEST_OVERHEAD_BYTES + _with_quadlet(group.read_bytes))

    @property
    def _broadcasts(self) -> Number:
        """Broadcasts of a cycle [1]."""
        return total(group.nodes_with("read") for group in self.network.groups)

    @property
    def node_waits_us(self) -> Number:
        """Idle bus before all broadcasts [us]."""
        return self.first_wait_us + self._broadcasts * self.gap_us + self.slot_waits_us

    @cached_property
    @step("T_boards")
    def boards_us(self) -> Number:
        """Time of all broadcasts, gaps included [us]."""
        each_us = self.gap_us + self.arbitration_us
        sent_us = total(group.nodes_with("read") * (each_us + self.broadcast_us(group)) for group in self._broadcasting)
        return self.first_wait_us + sent_us + self.slot_waits_us

    @cached_property
    def hub(self) -> Phases:
        """The read of the hub's block; its answer is concatenated."""
        responder = Responder(0.0, "concatenated", host_us=self.host_us)
        return self._transaction("read", hub_block_bytes(self.network), responder)

    @cached_property
    def write(self) -> Phases:
        """The write of all commands to the hub; its acknowledge is the answer."""
        responder = Responder(0.0, "unified", host_us=self.host_us)
        return self._transaction("write", write_block_bytes(self.network), responder)

    def _transaction(self, kind: TransactionKind, payload_bytes: Number, responder: Responder) -> Phases:
        phases = transaction(
            kind, model=self.model, delays=self.delays, payload_bytes=payload_bytes, responder=responder
        )
        return Phases(*(self._if_any(kind, us) for us in phases))

    @cached_property
    @step("late")
    def late_us(self) -> Number:
        """Rest of the host's wait when the last broadcast ends [us]."""
        wait_us = c.HUB_WAIT_US + c.HUB_WAIT_PER_NODE_US * self.network.nodes
        return self._if_any("read", larger(wait_us - self.boards_us, 0.0))

    @cached_property
    def hub_wait(self) -> IdleTime:
        """Idle bus from the last broadcast to the read of the hub.

        The host waits 10 + 5 N us after the query and does not watch the broadcasts. Its own time follows that wait, or
        the last broadcast if it ends later.
        """
        return self._idle(self.late_us + self.host_us, "read")

    def _idle(self, host_us: Number, kind: TransactionKind) -> IdleTime:
        """Idle bus before a request of the host, whose own time overlaps the gap."""
        idle = idle_time("unified", gaps=self.delays.gaps, execution_us=0.0, host_us=host_us)
        return IdleTime(*(self._if_any(kind, us) for us in idle))

    @property
    def host_us(self) -> Number:
        """The host's own time before all its requests [us]."""
        host_us: Number = self.network.profile.host.transaction_us
        return host_us

    def schedule(self) -> Iterator[BusEvent | Run]:
        """The query, at which the nodes sample, each broadcast, the read of the hub, and the write."""
        delays, hub, waits_us = self.delays, self.hub, self.first_wait_us
        request, response, write = (
            partial(_part, *packet) for packet in (("read", "request"), ("read", "response"), ("write", "request"))
        )
        yield BusEvent("sync", "sync_us", self.query_us, "query to all nodes")
        for place, group in enumerate(self.network.groups):
            if not group.has("read"):
                continue
            wait, next_us = response("node_wait", "idle", waits_us, "wait of the node"), self.slot_wait_us(group)
            events = (
                response("subaction_gap", "idle", self.gap_us, "subaction gap before the broadcast"),
                wait._replace(rounds=FIRST),
                wait._replace(us=next_us, rounds=BUT_FIRST),
                response("arbitration", "arbitration", self.arbitration_us, "node arbitration"),
                response("response_data", "data", self.broadcast_us(group), "node broadcast"),
            )
            yield Run(tuple(event._replace(us=group.if_any("read", event.us)) for event in events), group.nodes, place)
            waits_us = choose(group.bytes_of("read") > 0, next_us, waits_us)
        read_hub = (
            request("arbitration", "arbitration", delays.arbitration_us, "host arbitration"),
            request("request_data", "data", hub.request_data_us, "host request to the hub"),
            request("acknowledge", "acknowledge", delays.acknowledge_us, "hub acknowledge"),
            response("response_data", "data", hub.response_data_us, "hub's block of all data"),
            response("acknowledge", "acknowledge", delays.acknowledge_us, "host acknowledge"),
        )
        write_hub = (
            write("arbitration", "arbitration", delays.arbitration_us, "host arbitration"),
            write("request_data", "data", self.write.request_data_us, "commands to all nodes"),
            write("acknowledge", "acknowledge", delays.acknowledge_us, "hub acknowledge"),
        )
        parts: tuple[tuple[TransactionKind, tuple[BusEvent, ...]], ...] = (
            ("read", (*_waits(self.hub_wait, "before the hub is read"), *read_hub)),
            ("read", _waits(IdleTime(hub.idle_us, hub.host_us), "after the hub's block")),
            ("write", (*write_hub, *_waits(IdleTime(self.write.idle_us, self.write.host_us), "after the write"))),
        )
        for kind, part in parts:
            if any(group.has(kind) for group in self.network.groups):
                yield Run(tuple(event._replace(us=self._if_any(kind, event.us)) for event in part))

    @cached_property
    def read(self) -> Phases:
        """The read of all data, from the query to the host."""
        latency_us = self.query_us + self.boards_us + self.hub_wait.us + self.hub.latency_us
        return self.hub._replace(
            latency_us=latency_us,
            latency_with_gaps_us=latency_us + self.hub.gaps_us,
            idle_us=self.node_waits_us + self.hub_wait.idle_us + self.hub.idle_us,
            host_us=self.hub_wait.host_us + self.hub.host_us,
            transaction_us=latency_us + (self.hub.idle_us + self.hub.host_us),
        )

    def all_us(self, kind: TransactionKind) -> Number:
        """Time of the nodes' broadcasts and the read of the hub, or of the write of all commands [us]."""
        if kind == "write":
            return self.write.transaction_us
        return self.boards_us + self.hub_wait.us + self.hub.transaction_us

    def longest(self, kind: TransactionKind) -> Phases:
        """Phases of the read of all data, or of the write of all commands [us]."""
        return self.read if kind == "read" else self.write

    def latencies(self) -> tuple[BusLatency, ...]:
        """Latencies of data to the host and of commands to the nodes; they are the same for all nodes."""
        link = {"hops": self.link.hops, "gap_count": self.link.gap_count}
        before_hub = {"query_us": self.query_us, "boards_us": self.boards_us, "hub_wait_us": self.hub_wait.us}
        read = {**link, **before_hub, **self.read._asdict(), "all_us": self.reads_us}
        write = {**link, **dict.fromkeys(before_hub, 0.0), **self.write._asdict(), "all_us": self.writes_us}
        return tuple(
            latency
            for group in self.network.groups
            for latency in (
                BusLatency("read", group.read_bytes, read, group.name),
                BusLatency("write", group.write_bytes, write, group.name),
            )
            if latency.payload_bytes
        )

    def bias_us(self) -> Number | None:
        """Mean time of the packets beyond the model [us]."""
        if not self.link.has_gaps:
            return 0.0
        with_gap_us = self.with_gap * doubts.gap_term_us(self.link.gap_count)
        return self.halves * doubts.residual().mean_us + with_gap_us

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubt of each input that is not known exactly."""
        retries, nodes = self.network.profile.cycle.retries, self._broadcasts
        query = retry = hub_request = ACKNOWLEDGED
        broadcast = start = UNACKNOWLEDGED
        hub, write = self._if_any("read", hub_request + CONCATENATED), self._if_any("write", ACKNOWLEDGED)
        hop_delays = query + broadcast * nodes + hub + write + retry * retries + start * self.number_of_starts
        return doubts.of_inputs(
            residual_us=self.halves * doubts.residual().uncertainty_us,
            gap_term_us=self.with_gap * doubts.gap_term_us(self.link.gap_count),
            phy_delays=hop_delays * self.link.hops,
            link=self.link,
            host_us=self._host_swing_us(),
        )

    @property
    @step("halves")
    def halves(self) -> Number:
        """Packets of the cycle: the query, each broadcast, two of the hub, the write, and retries [1]."""
        return self._broadcasts + self._of_host + self.network.profile.cycle.retries

    @property
    def _of_host(self) -> Number:
        """Packets of the cycle without broadcasts: the query, two of the hub, the write [1]."""
        of_read, of_write = self._if_any("read", 2), self._if_any("write", 1)
        return 1 + of_read + of_write

    @property
    def with_gap(self) -> Number:
        """Packets with the gap term of equation (4) in their arbitration [1]."""
        return self._of_host + self.network.profile.cycle.retries if self._is_isochronous else self.halves

    def _host_swing_us(self) -> Number:
        """Change of the cycle by a standard uncertainty of the host's time [us]."""
        step_us: Number = self.network.profile.host.standard_uncertainty_us
        if is_off(step_us):
            return 0.0

        def waits_us(steps: int) -> Number:
            host_us, reset_us = self.host_us + steps * step_us, self.delays.gaps.arbitration_reset_us
            after_us = larger(reset_us, host_us)
            before_us = larger(reset_us, self.late_us + host_us)
            return self._if_any("read", before_us + after_us) + self._if_any("write", after_us)

        return doubts.swing_us(waits_us)


def _part(transaction: str, packet: str, kind: str, term: str, us: Number, label: str) -> BusEvent:
    return BusEvent(kind, f"cycle_{term}_us", us, label, transaction=transaction, packet=packet)


def _waits(idle: IdleTime, where: str) -> tuple[BusEvent, BusEvent]:
    """Events of the idle bus before a request."""
    host = f"host's own time {where}"
    return (
        BusEvent("arbitration_reset_gap", "cycle_idle_us", idle.idle_us, f"arbitration reset gap {where}"),
        BusEvent("host", "cycle_host_us", idle.host_us, host, rests_on="host.transaction_us"),
    )
