"""The latencies of a cycle of the broadcast schedule; `broadcast_terms` says what the schedule is."""

from collections.abc import Mapping

from busplan.buses.cycle import BusLatency
from busplan.buses.ieee1394 import figures
from busplan.buses.ieee1394.broadcast_terms import BroadcastTerms, hub_block_bytes, write_block_bytes
from busplan.buses.ieee1394.constants import (
    BLOCK_READ_REQUEST_BYTES,
    BLOCK_READ_RESPONSE_OVERHEAD_BYTES,
    BLOCK_WRITE_REQUEST_OVERHEAD_BYTES,
)
from busplan.elementwise import Number


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


def _in_order(phases: Mapping[str, Number]) -> dict[str, Number]:
    """Phases in the order of the document."""
    return {figure.key: phases[figure.key] for figure in figures.LATENCY if figure.key in phases}
