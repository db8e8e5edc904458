"""The broadcast schedule: a query, a broadcast of each node, a read of the hub that collected them, a write.

It is that of the da Vinci Research Kit (dVRK). A query is a quadlet write to the hub, which all nodes hear. Each
broadcasts its data without an acknowledge, in the order of the nodes. The hub has all of them in a block, which the
host reads; the answer is concatenated. One block write, to the hub too, has the commands of all nodes. What goes on the
bus goes to the farthest node. No execution time is on the bus.

References
----------
Z. Chen, P. Kazanzides, "Multi-Kilohertz Control of Multiple Robots via IEEE-1394 (FireWire)", TePRA 2014; JHU
mechatronics-firmware and mechatronics-software.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property, partial
from typing import NamedTuple

from busplan.buses.cycle import BUT_FIRST, FIRST, BusEvent, BusLatency, Doubt, Run
from busplan.buses.ieee1394 import equations, figures
from busplan.buses.ieee1394 import transactions as doubts
from busplan.buses.ieee1394.constants import (
    BASE_RATE_MBIT_S,
    BLOCK_READ_REQUEST_BYTES,
    BLOCK_READ_RESPONSE_OVERHEAD_BYTES,
    BLOCK_WRITE_REQUEST_OVERHEAD_BYTES,
    BROADCAST_CLOCK_MHZ,
    BROADCAST_NODE_BYTES,
    BROADCAST_SLOT_CLOCKS,
    FIRST_BROADCAST_CLOCKS,
    HUB_TIMING_BYTES,
    HUB_WAIT_PER_NODE_US,
    HUB_WAIT_US,
    QUADLET_WRITE_REQUEST_BYTES,
    padded_bytes,
)
from busplan.buses.ieee1394.cycle import CycleWithStarts
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, is_off, larger, named, total, traced_with


def hub_block_bytes(network: Network) -> Number:
    """Payload of the hub's block: the data of each node after its quadlet of sequence, and one of timing [bytes].

    Parameters
    ----------
    network
        The network; of any sort.
    """
    return total(group.nodes * _with_quadlet(group.read_bytes) for group in network.groups) + HUB_TIMING_BYTES


def write_block_bytes(network: Network) -> Number:
    """Payload of the write: the command to each node after its header quadlet [bytes].

    Parameters
    ----------
    network
        The network; of any sort.
    """
    return total(group.nodes * _with_quadlet(group.write_bytes) for group in network.groups)


def _with_quadlet(payload_bytes: Number) -> Number:
    return padded_bytes(payload_bytes) + BROADCAST_NODE_BYTES


class Packets(NamedTuple):
    """Data phases of the packets that are not the nodes' own [us]."""

    query_us: Number
    hub_request_us: Number
    hub_block_us: Number
    write_us: Number


class Idle(NamedTuple):
    """Idle bus before a request of the host, or after the last request [us]."""

    gap_us: Number
    """Arbitration reset gap."""
    host_us: Number
    """Host's own time beyond the gap."""

    @property
    def us(self) -> Number:
        """Gap and host's time together."""
        return self.gap_us + self.host_us


class BroadcastCycle(CycleWithStarts):
    """The query, the nodes' broadcasts, the read of the hub, the write, and the window for non-periodic data.

    References
    ----------
    `busplan manual models`, the broadcast schedule.
    """

    @cached_property
    def packets(self) -> Packets:
        """Data phases of query, hub and write [us]."""
        sizes = (
            QUADLET_WRITE_REQUEST_BYTES,
            BLOCK_READ_REQUEST_BYTES,
            BLOCK_READ_RESPONSE_OVERHEAD_BYTES + hub_block_bytes(self.network),
            BLOCK_WRITE_REQUEST_OVERHEAD_BYTES + write_block_bytes(self.network),
        )
        return Packets(*map(self._data_us, sizes))

    def _data_us(self, packet_bytes: Number) -> Number:
        return equations.data_phase_us(
            self.link.hops,
            hop_us=self.delays.hop_us,
            packet_bytes=packet_bytes,
            data_rate_mbit_s=self.link.data_rate_mbit_s,
        )

    @property
    def _is_isochronous(self) -> bool:
        return bool(self.network.profile.cycle.broadcast_request != "priority")

    @property
    def _is_timed(self) -> bool:
        return bool(self.network.profile.cycle.broadcast_request == "timed")

    @cached_property
    def gap_us(self) -> Number:
        """Idle bus before each broadcast: none for an isochronous request [us]."""
        return 0.0 if self._is_isochronous else self.delays.gaps.subaction_us

    @cached_property
    def first_wait_us(self) -> Number:
        """Wait of the first node after the query, beyond its gap [us]."""
        return larger(self._clocks_us(FIRST_BROADCAST_CLOCKS) - self.gap_us, 0.0)

    def _clocks_us(self, clocks: Number) -> Number:
        return traced_with(clocks, self.link.hops) / BROADCAST_CLOCK_MHZ

    def slot_wait_us(self, group: Group) -> Number:
        """Wait of the next node after the broadcast of a node, where each has its own time [us].

        With unlike nodes it is the most: a node that is late because of a long broadcast waits less.

        Parameters
        ----------
        group
            The node's group.
        """
        if not self._is_timed:
            return 0.0
        sent_us = self.arbitration_us + self.broadcast_us(group)
        return larger(self._clocks_us(BROADCAST_SLOT_CLOCKS) - sent_us, 0.0)

    @cached_property
    def slot_waits_us(self) -> Number:
        """Wait of all nodes for their times after the first; nobody waits after the last [us]."""
        groups = self.network.groups
        return total(group.nodes * self.slot_wait_us(group) for group in groups) - self.slot_wait_us(groups[-1])

    @cached_property
    def arbitration_us(self) -> Number:
        """Arbitration of a broadcast: an isochronous request waits for no part of the gap count [us]."""
        if not self._is_isochronous:
            return self.delays.arbitration_us
        return equations.arbitration_phase_us(
            self.link.hops, hop_us=self.delays.hop_us, gap_count=0, gap_clock_mbit_s=BASE_RATE_MBIT_S
        )

    def broadcast_us(self, group: Group) -> Number:
        """Data phase of the broadcast of a node [us].

        Parameters
        ----------
        group
            The node's group.
        """
        return self._data_us(BLOCK_WRITE_REQUEST_OVERHEAD_BYTES + _with_quadlet(group.read_bytes))

    @cached_property
    def query_us(self) -> Number:
        """The query with its acknowledge [us]."""
        found_us = self.delays.arbitration_us + self.packets.query_us + self.delays.acknowledge_us
        return named(found_us, "query_us", "T_query")

    @property
    def node_waits_us(self) -> Number:
        """Idle bus before all broadcasts [us]."""
        return self.first_wait_us + self.network.nodes * self.gap_us + self.slot_waits_us

    @cached_property
    def boards_us(self) -> Number:
        """All broadcasts with their gaps [us]."""
        each_us = self.gap_us + self.arbitration_us
        sent_us = total(group.nodes * (each_us + self.broadcast_us(group)) for group in self.network.groups)
        return named(self.first_wait_us + sent_us + self.slot_waits_us, "boards_us", "T_boards")

    @cached_property
    def hub_us(self) -> Number:
        """The read of the hub: request, acknowledge, concatenated block and its acknowledge [us]."""
        delays, sent = self.delays, self.packets
        return (
            delays.arbitration_us
            + sent.hub_request_us
            + delays.acknowledge_us
            + sent.hub_block_us
            + delays.acknowledge_us
        )

    @cached_property
    def write_us(self) -> Number:
        """The write with its acknowledge [us]."""
        return self.delays.arbitration_us + self.packets.write_us + self.delays.acknowledge_us

    @cached_property
    def hub_wait(self) -> Idle:
        """From the last broadcast to the read of the hub.

        The host waits 10 + 5 N us after the query, and knows nothing of the broadcasts. Its own time follows that, or
        the last broadcast if it is later.
        """
        return self._idle(self.host_us, late_us=self.late_us)

    @cached_property
    def late_us(self) -> Number:
        """Rest of the host's wait when the last broadcast ends [us]."""
        wait_us = traced_with(HUB_WAIT_US, self.network.nodes) + HUB_WAIT_PER_NODE_US * self.network.nodes
        return named(larger(wait_us - self.boards_us, 0.0), "late_us", "late")

    @cached_property
    def idle(self) -> Idle:
        """After the read of the hub, and after the write."""
        return self._idle(self.host_us)

    @property
    def host_us(self) -> Number:
        """The host's own time before each of its requests [us]."""
        host_us: Number = self.network.profile.host.transaction_us
        return host_us

    def _idle(self, host_us: Number, *, late_us: Number = 0.0) -> Idle:
        """Idle bus before a request of the host, whose own time overlaps the gap."""
        gap_us = self.delays.gaps.arbitration_reset_us
        if is_off(host_us) and is_off(late_us):
            return Idle(gap_us, 0.0)
        return Idle(gap_us, larger(late_us + host_us - gap_us, 0.0))

    @property
    def longest_request_us(self) -> Number:
        """Data phase of the write [us]."""
        return self.packets.write_us

    def schedule(self) -> Iterator[BusEvent | Run]:
        """The query, at which the nodes sample, each broadcast, the read of the hub, and the write."""
        delays, sent, waits_us = self.delays, self.packets, self.first_wait_us
        yield BusEvent("sync", "sync_us", self.query_us, "query to all nodes")
        for place, group in enumerate(self.network.groups):
            part = partial(_part, "read", "response")
            wait, next_us = part("node_wait", "idle", waits_us, "wait of the node"), self.slot_wait_us(group)
            events = (
                part("subaction_gap", "idle", self.gap_us, "subaction gap before the broadcast"),
                wait._replace(rounds=FIRST),
                wait._replace(us=next_us, rounds=BUT_FIRST),
                part("arbitration", "arbitration", self.arbitration_us, "node arbitration"),
                part("response_data", "data", self.broadcast_us(group), "node broadcast"),
            )
            yield Run(events, group.nodes, place)
            waits_us = next_us
        request, response, write = (
            partial(_part, *of) for of in (("read", "request"), ("read", "response"), ("write", "request"))
        )
        read_hub = (
            request("arbitration", "arbitration", delays.arbitration_us, "host arbitration"),
            request("request_data", "data", sent.hub_request_us, "host request to the hub"),
            request("acknowledge", "acknowledge", delays.acknowledge_us, "hub acknowledge"),
            response("response_data", "data", sent.hub_block_us, "hub's block of all data"),
            response("acknowledge", "acknowledge", delays.acknowledge_us, "host acknowledge"),
        )
        write_hub = (
            write("arbitration", "arbitration", delays.arbitration_us, "host arbitration"),
            write("request_data", "data", sent.write_us, "commands to all nodes"),
            write("acknowledge", "acknowledge", delays.acknowledge_us, "hub acknowledge"),
        )
        yield Run((*_waits(self.hub_wait, "before the hub is read"), *read_hub))
        yield Run((*_waits(self.idle, "after the hub's block"), *write_hub))
        yield Run(_waits(self.idle, "after the write"))

    def _phases(self) -> tuple[dict[str, Number], dict[str, Number]]:
        """The phases of the read of all data, from the query to the host, and of the write of all commands."""
        delays, sent, gaps = self.delays, self.packets, self.delays.gaps
        common: dict[str, Number] = {
            **dict.fromkeys(("query_us", "boards_us", "hub_wait_us"), 0.0),
            "hops": self.link.hops,
            "gap_count": self.link.gap_count,
            "arbitration_us": delays.arbitration_us,
            "acknowledge_us": delays.acknowledge_us,
            "hold_us": 0.0,
            "execution_us": 0.0,
            "worst_extra_us": 0.0,
            "subaction_gap_us": gaps.subaction_us,
            "arbitration_reset_gap_us": gaps.arbitration_reset_us,
            "gaps_us": gaps.both_us,
        }
        read_us = self.query_us + self.boards_us + self.hub_wait.us + self.hub_us
        write_us = self.write_us
        read: dict[str, Number] = {
            "query_us": self.query_us,
            "boards_us": self.boards_us,
            "hub_wait_us": self.hub_wait.us,
            "request_bytes": BLOCK_READ_REQUEST_BYTES,
            "response_bytes": BLOCK_READ_RESPONSE_OVERHEAD_BYTES + hub_block_bytes(self.network),
            "request_data_us": sent.hub_request_us,
            "response_data_us": sent.hub_block_us,
            "request_us": delays.arbitration_us + sent.hub_request_us,
            "response_us": sent.hub_block_us,
            "request_and_acknowledge_us": delays.arbitration_us + sent.hub_request_us + delays.acknowledge_us,
            "response_and_acknowledge_us": sent.hub_block_us + delays.acknowledge_us,
            "latency_us": read_us,
            "latency_with_gaps_us": read_us + gaps.both_us,
            "idle_us": self.node_waits_us + self.hub_wait.gap_us + self.idle.gap_us,
            "host_us": self.hub_wait.host_us + self.idle.host_us,
            "transaction_us": read_us + self.idle.us,
        }
        write: dict[str, Number] = {
            "request_bytes": BLOCK_WRITE_REQUEST_OVERHEAD_BYTES + write_block_bytes(self.network),
            "response_bytes": 0,
            "request_data_us": sent.write_us,
            "response_data_us": 0.0,
            "request_us": delays.arbitration_us + sent.write_us,
            "response_us": 0.0,
            "request_and_acknowledge_us": write_us,
            "response_and_acknowledge_us": 0.0,
            "latency_us": write_us,
            "latency_with_gaps_us": write_us + gaps.both_us,
            "idle_us": self.idle.gap_us,
            "host_us": self.idle.host_us,
            "transaction_us": write_us + self.idle.us,
        }
        return _in_order({**common, **read}), _in_order({**common, **write})

    def figures(self) -> Mapping[str, Number | None]:
        """Settings of the bus, and the latencies; the paper has no number of nodes for this schedule."""
        read, write = self._phases()
        shown = ("latency_us", "latency_with_gaps_us", "transaction_us")
        return {
            **self.setup(),
            **{f"{kind}_{key}": phases[key] for kind, phases in (("read", read), ("write", write)) for key in shown},
            **{key: read[key] for key in ("gaps_us", "subaction_gap_us", "arbitration_reset_gap_us")},
            "nodes_eq11": None,
        }

    def latencies(self) -> tuple[BusLatency, ...]:
        """The data of a node to the host, and a command to it; they are those of all nodes."""
        read, write = self._phases()
        return tuple(
            latency
            for group in self.network.groups
            for latency in (
                BusLatency("read", group.read_bytes, read, group.name),
                BusLatency("write", group.write_bytes, write, group.name),
            )
        )

    def bias_us(self) -> Number | None:
        """Time of the packets beyond the model, on the mean [us]."""
        return doubts.broadcast_bias_us(self.halves, with_gap=self.with_gap, gap_count=self.link.gap_count)

    def doubts(self) -> tuple[Doubt, ...]:
        """Inputs that are not known exactly."""
        retries, nodes = self.network.profile.cycle.retries, self.network.nodes
        return doubts.of_broadcast(
            self.halves,
            with_gap=self.with_gap,
            link=self.link,
            # Of the query, of arbitration and data of each broadcast, of the hub's packets, and of the write.
            hop_delays=3 + 2 * nodes + 5 + 3 + 3 * retries + 2 * self.number_of_starts,
            host_swing_us=self._host_swing_us(),
        )

    @property
    def halves(self) -> Number:
        """Packets: the query, each broadcast, two of the hub, the write, and retries [1]."""
        return named(self.network.nodes + 4 + self.network.profile.cycle.retries, "halves", "halves")

    @property
    def with_gap(self) -> Number:
        """Packets with the gap term of equation (4) in their arbitration [1]."""
        return 4 + self.network.profile.cycle.retries if self._is_isochronous else self.halves

    def _host_swing_us(self) -> Number:
        """Change by a standard uncertainty of the host: half the larger of two steps, two up and two down [us]."""
        step_us: Number = self.network.profile.host.standard_uncertainty_us
        if is_off(step_us):
            return 0.0

        def waits_us(host_us: Number) -> Number:
            return self._idle(host_us, late_us=self.late_us).us + 2 * self._idle(host_us).us

        above_us, own_us, below_us = (waits_us(self.host_us + steps * step_us) for steps in (2, 0, -2))
        return larger(above_us - own_us, own_us - below_us) / 2


def _part(transaction: str, packet: str, kind: str, term: str, us: Number, label: str) -> BusEvent:
    return BusEvent(kind, f"cycle_{term}_us", us, label, transaction=transaction, packet=packet)


def _waits(idle: Idle, where: str) -> tuple[BusEvent, BusEvent]:
    """Idle bus before a request, as events."""
    host = f"host's own time {where}"
    return (
        BusEvent("arbitration_reset_gap", "cycle_idle_us", idle.gap_us, f"arbitration reset gap {where}"),
        BusEvent("host", "cycle_host_us", idle.host_us, host, rests_on="host.transaction_us"),
    )


def _in_order(phases: Mapping[str, Number]) -> dict[str, Number]:
    """Phases in the order of the document."""
    return {figure.key: phases[figure.key] for figure in figures.LATENCY if figure.key in phases}
