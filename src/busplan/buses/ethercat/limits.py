"""What EtherCAT forbids: too many devices, a device that no frame holds, a long cable, a command behind SYNC0."""

from functools import reduce
from typing import Final

from busplan.buses.ethercat.constants import BYTE_BIAS_US, MOST_CABLE_M, MOST_DEVICES
from busplan.buses.ethercat.equations import room_bytes
from busplan.buses.ethercat.latency import command_doubt_us, last_command_us, sync0_share
from busplan.buses.ethercat.traffic import datagrams, devices
from busplan.buses.network import Network
from busplan.buses.node_time import NODE_LIMIT
from busplan.buses.parts import NOT_SHOWN_KEPT, Limit, share_limit
from busplan.elementwise import Number, larger, plain, total


def _largest_device(network: Network) -> Number:
    return reduce(larger, (one.data_bytes for one in devices(network)))


def _longest_cable(network: Network) -> Number:
    lengths_m: list[Number] = [one.node.cable_m for one in network.groups]
    return reduce(larger, lengths_m)


def _late_command_us(network: Network) -> Number:
    """When the last device has taken its command, with what bytes take beyond the wire; 0 without clocks [us]."""
    if not network.profile.bus.distributed_clocks:
        return 0.0
    process_bytes = total(one.number * one.data_bytes for one in devices(network))
    return last_command_us(network) + process_bytes * BYTE_BIAS_US


def _words(network: Network) -> str:
    """Say when the last command comes, and whether it is late only if all of the master's time is before the wire."""
    value_us, doubt_us, most_us = (
        plain(one) for one in (_late_command_us(network), SYNC0.uncertainty(network), SYNC0.most(network))
    )
    is_split = SYNC0.verdict_code(network) == NOT_SHOWN_KEPT and value_us - doubt_us > most_us
    where = ", all of bus.master_us before the wire" if is_split else ""
    return f"the last command comes at {value_us:.1f} +/- {doubt_us:.1f} us{where}, SYNC0 at {most_us:.1f} us"


SYNC0: Final = share_limit(
    "sync0",
    "",
    _late_command_us,
    share=sync0_share,
    doubt=lambda network: command_doubt_us(network) if network.profile.bus.distributed_clocks else 0.0,
    perhaps=lambda network: network.profile.bus.master_us if network.profile.bus.distributed_clocks else 0.0,
    way_out="a larger bus.sync_shift moves SYNC0 back",
    has_rule=True,
    says=_words,
)
"""A command must be in every device before SYNC0."""
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
    SYNC0,
)
