"""A cycle of the broadcast schedule as latencies and as events; `broadcast_terms` says what the schedule is."""

from collections.abc import Iterator, Mapping, Sequence

from busplan.buses.cycle import BusEvent, BusLatency
from busplan.buses.ieee1394 import figures
from busplan.buses.ieee1394.broadcast_terms import BroadcastTerms, Idle, hub_block_bytes, write_block_bytes
from busplan.buses.ieee1394.constants import (
    BLOCK_READ_REQUEST_BYTES,
    BLOCK_READ_RESPONSE_OVERHEAD_BYTES,
    BLOCK_WRITE_REQUEST_OVERHEAD_BYTES,
)
from busplan.buses.network import Group
from busplan.elementwise import Number, plain


class BroadcastCycle(BroadcastTerms):
    """The query, the nodes' broadcasts, the read of the hub, the write, and the window for non-periodic data."""

    def _phases(self) -> tuple[dict[str, Number], dict[str, Number]]:
        """The phases of the read of all data, from the query to the host, and of the write of all commands."""
        own, sent, gaps = self.delays, self.packets, self.delays.gaps
        common: dict[str, Number] = {
            **dict.fromkeys(("query_us", "boards_us", "hub_wait_us"), 0.0),
            "hops": self.link.hops,
            "gap_count": self.link.gap_count,
            "arbitration_us": own.arbitration_us,
            "acknowledge_us": own.acknowledge_us,
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
            "request_us": own.arbitration_us + sent.hub_request_us,
            "response_us": sent.hub_block_us,
            "request_and_acknowledge_us": own.arbitration_us + sent.hub_request_us + own.acknowledge_us,
            "response_and_acknowledge_us": sent.hub_block_us + own.acknowledge_us,
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
            "request_us": own.arbitration_us + sent.write_us,
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
        """How the bus is set, and the latencies; the paper has no number of nodes for this schedule."""
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

    def stretches(self) -> Iterator[Sequence[BusEvent]]:
        """What no cycle start interrupts: the query, each broadcast, the read of the hub, and the write."""
        yield [BusEvent("sync", "sync_us", plain(self.query_us), "query to all nodes")]
        node, waits_us = 0, plain(self.first_wait_us)
        for group in self.network.groups:
            for _ in range(int(group.nodes)):
                node += 1
                yield list(self._broadcast_events(group, node, waits_us))
                waits_us = plain(self.slot_wait_us(group))
        yield [*_waits(self.hub_wait, "before the hub is read"), *self._hub_events()]
        yield [*_waits(self.idle, "behind the hub's block"), *self._write_events()]
        yield _waits(self.idle, "behind the write")

    def _broadcast_events(self, group: Group, node: int, waits_us: float) -> Iterator[BusEvent]:
        def event(kind: str, term: str, us: Number, label: str) -> BusEvent:
            return BusEvent(kind, f"cycle_{term}_us", plain(us), label, node, "read", "response")

        yield event("subaction_gap", "idle", self.gap_us, "subaction gap before the broadcast")
        yield event("node_wait", "idle", waits_us, "wait of the node")
        yield event("arbitration", "arbitration", self.arbitration_us, "node arbitration")
        yield event("response_data", "data", self.broadcast_us(group), "node broadcast")

    def _hub_events(self) -> Iterator[BusEvent]:
        own, sent = self.delays, self.packets

        def event(kind: str, term: str, us: Number, label: str, packet: str) -> BusEvent:
            return BusEvent(kind, f"cycle_{term}_us", plain(us), label, None, "read", packet)

        yield event("arbitration", "arbitration", own.arbitration_us, "host arbitration", "request")
        yield event("request_data", "data", sent.hub_request_us, "host request to the hub", "request")
        yield event("acknowledge", "acknowledge", own.acknowledge_us, "hub acknowledge", "request")
        yield event("response_data", "data", sent.hub_block_us, "hub's block of all data", "response")
        yield event("acknowledge", "acknowledge", own.acknowledge_us, "host acknowledge", "response")

    def _write_events(self) -> Iterator[BusEvent]:
        own = self.delays

        def event(kind: str, term: str, us: Number, label: str) -> BusEvent:
            return BusEvent(kind, f"cycle_{term}_us", plain(us), label, None, "write", "request")

        yield event("arbitration", "arbitration", own.arbitration_us, "host arbitration")
        yield event("request_data", "data", self.packets.write_us, "commands to all nodes")
        yield event("acknowledge", "acknowledge", own.acknowledge_us, "hub acknowledge")


def _waits(idle: Idle, where: str) -> list[BusEvent]:
    """Idle bus before a request, as events."""
    return [
        BusEvent("arbitration_reset_gap", "cycle_idle_us", plain(idle.gap_us), f"arbitration reset gap {where}"),
        BusEvent("host", "cycle_host_us", plain(idle.host_us), f"host's own time {where}"),
    ]


def _in_order(phases: Mapping[str, Number]) -> dict[str, Number]:
    """Phases in the order of the document."""
    return {figure.key: phases[figure.key] for figure in figures.LATENCY if figure.key in phases}
