"""What EtherCAT forbids: too many devices, a device that no frame holds, a cable that is too long."""

from functools import reduce
from typing import Final

from busplan.buses.ethercat.constants import MOST_CABLE_M, MOST_DEVICES
from busplan.buses.ethercat.equations import room_bytes
from busplan.buses.ethercat.traffic import datagrams, devices
from busplan.buses.network import Network
from busplan.buses.node_time import NODE_LIMIT
from busplan.buses.parts import Limit
from busplan.elementwise import Number, larger


def _largest_device(network: Network) -> Number:
    return reduce(larger, (one.data_bytes for one in devices(network)))


def _longest_cable(network: Network) -> Number:
    lengths_m: list[Number] = [one.node.cable_m for one in network.groups]
    return reduce(larger, lengths_m)


LIMITS: Final = (
    NODE_LIMIT,
    Limit(
        "nodes",
        "{value:.0f} devices are over the {most:.0f} addresses of a segment",
        lambda network: network.nodes,
        lambda _network: MOST_DEVICES,
        way_out=f"a second segment has {MOST_DEVICES:g} more",
    ),
    Limit(
        "payload",
        "a device of {value:.0f} bytes is over the {most:.0f} bytes of a frame, and no device is split",
        _largest_device,
        lambda network: room_bytes(datagrams(network)),
        way_out="a smaller payload would do",
        failure="payload_bytes",
    ),
    Limit(
        "cable",
        "a cable of {value:g} m is over the {most:g} m of 100BASE-TX",
        _longest_cable,
        lambda _network: MOST_CABLE_M,
        way_out="a device between would do",
        failure="cable_m",
    ),
)
