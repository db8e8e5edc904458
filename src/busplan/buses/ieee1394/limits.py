"""What the standard forbids, and what leaves no time. A gap count below the table fits, but is not safe."""

from math import inf
from typing import Final

from busplan.buses.ieee1394.broadcast import hub_block_bytes, write_block_bytes
from busplan.buses.ieee1394.constants import (
    CYCLE_US,
    LEAST_ASYNCHRONOUS_US,
    MAX_BROADCAST_NODES,
    MAX_HOPS,
    MAX_NODES,
    MAX_PAYLOAD_BYTES,
    REFERENCE_CABLE_M,
    safe_gap_count,
)
from busplan.buses.ieee1394.cycle import Ieee1394Cycle
from busplan.buses.ieee1394.transactions import gap_count_of, hops_of, is_broadcast
from busplan.buses.network import Network
from busplan.buses.parts import Limit
from busplan.elementwise import Number


def _most_payload(network: Network) -> Number:
    return MAX_PAYLOAD_BYTES[network.profile.bus.speed]


def _cycle_start_us(network: Network) -> Number:
    is_sent = network.profile.bus.cycle_master
    return Ieee1394Cycle(network, "standard").cycle_start_us if is_sent else 0.0


_ONE_BY_ONE: Final = 'cycle.schedule = "individual" has no such limit'

LIMITS: Final = (
    Limit(
        "payload",
        "a payload of {value:.0f} bytes is over the {most:.0f} bytes of {bus.speed}",
        lambda network: network.largest_payload_bytes,
        _most_payload,
        way_out="a faster bus or a smaller payload would do",
        failure="payload_bytes",
        has_rule=True,
    ),
    Limit(
        "nodes",
        "{value:.0f} nodes are over the {most:.0f} of one bus",
        lambda network: network.nodes,
        lambda _network: MAX_NODES,
        way_out=f"a second bus has {MAX_NODES:g} more",
        has_rule=True,
    ),
    Limit(
        "hops",
        "{value:.0f} hops are over the {most:.0f} of one bus",
        hops_of,
        lambda _network: MAX_HOPS,
        way_out=f"a tree with bus.max_hops = {MAX_HOPS:g} or less has room for {MAX_NODES:g} nodes",
        has_rule=True,
    ),
    Limit(
        "broadcasting nodes",
        "{value:.0f} nodes are over the {most:.0f} that a hub collects data of",
        lambda network: network.nodes if is_broadcast(network) else 0,
        lambda network: MAX_BROADCAST_NODES if is_broadcast(network) else inf,
        way_out=_ONE_BY_ONE,
    ),
    Limit(
        "hub block",
        "the hub's block of {value:.0f} bytes is over the {most:.0f} bytes of {bus.speed}",
        lambda network: hub_block_bytes(network) if is_broadcast(network) else 0,
        _most_payload,
        way_out=f"less read from each node, or {_ONE_BY_ONE}",
    ),
    Limit(
        "write block",
        "the write of {value:.0f} bytes is over the {most:.0f} bytes of {bus.speed}",
        lambda network: write_block_bytes(network) if is_broadcast(network) else 0,
        _most_payload,
        way_out=f"less written to each node, or {_ONE_BY_ONE}",
    ),
    Limit(
        "cycle starts",
        "a cycle start takes {value:.3f} us, over {most:.3f} us: no time is left for the nodes until the next one",
        _cycle_start_us,
        lambda _network: CYCLE_US - LEAST_ASYNCHRONOUS_US,
        way_out="less bus.isochronous_us, or no cycle master, leaves time",
    ),
    Limit(
        "gap table",
        "gap count {most:.0f} is unsafe for the hops; the smallest safe one is {value:.0f}",
        lambda network: safe_gap_count(hops_of(network)),
        gap_count_of,
        way_out=f"for cables of more than {REFERENCE_CABLE_M:g} m none is known to be safe",
        is_safety=True,
    ),
)
