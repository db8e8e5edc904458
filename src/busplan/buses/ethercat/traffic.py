"""What a network sends in a cycle, and how long it takes on its way."""

from collections.abc import Sequence
from typing import NamedTuple

from busplan.buses.ethercat.constants import CLOCK_BYTES, DELAY_UNCERTAINTY_US, DELAY_US, LRW
from busplan.buses.ethercat.equations import (
    cable_us,
    datagram_bytes,
    device_us,
    frame_bytes,
    overhead_bytes,
    sending_us,
)
from busplan.buses.ethercat.packing import Devices, Frame, Packing, frames_of, pack
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, alike, larger, named, plain, total


class Hop(NamedTuple):
    """What a device and the cable to it add to the way, there and back. The numbers may be of any sort."""

    nodes: Number
    device_us: Number
    cable_us: Number


def is_shared(network: Network) -> bool:
    """Whether inputs and outputs share their bytes, as with LRW."""
    shared: bool = network.profile.bus.command == LRW
    return shared


def datagrams(network: Network) -> int:
    """Datagrams of process data in a frame: one of LRW, or one of LRD and one of LWR."""
    return 1 if is_shared(network) else 2


def data_bytes(group: Group, network: Network) -> Number:
    """Bytes of one device in a frame: the larger of input and output, or both [bytes]."""
    both = group.read_bytes, group.write_bytes
    found = larger(*both) if is_shared(network) else total(both)
    return named(found, "device_bytes", f"d{group.name and f',{group.name}'}")


def devices(network: Network) -> tuple[Devices, ...]:
    """All devices in their order."""
    return tuple(Devices(one.nodes, data_bytes(one, network)) for one in network.groups)


def clock_bytes(network: Network) -> Number:
    """The datagram of the distributed clocks, which opens the first frame; 0 without them [bytes]."""
    return datagram_bytes(alike(CLOCK_BYTES, network.nodes)) if network.profile.bus.distributed_clocks else 0.0


def packing(network: Network, each: Sequence[Devices]) -> Packing:
    """All frames of its process data, of all its devices."""
    found = pack(each, datagrams=datagrams(network), first_bytes=clock_bytes(network))
    return found._replace(
        frames=named(found.frames, "frames", "F"),
        datagrams_bytes=named(found.datagrams_bytes, "datagrams_bytes", "G"),
        padding_bytes=named(found.padding_bytes, "padding_bytes", "pad"),
    )


def frames(network: Network) -> tuple[Frame, ...]:
    """The same frames one by one, of plain numbers."""
    return tuple(frames_of(devices(network), datagrams=datagrams(network), first_bytes=plain(clock_bytes(network))))


def hop(group: Group) -> Hop:
    """What each device of a group adds to the way."""
    node = group.node
    delay_us = alike(DELAY_US[node.port], group.nodes) if node.delay_us is None else node.delay_us
    return Hop(group.nodes, device_us(delay_us), cable_us(node.cable_m))


def devices_us(network: Network) -> Number:
    """Delay of all devices there and back [us]."""
    return total(one.nodes * one.device_us for one in map(hop, network.groups))


def devices_doubt_us(network: Network) -> Number:
    """Standard uncertainty of that: of the devices whose delay is taken from their port [us]."""
    return total(
        device_us(one.nodes * DELAY_UNCERTAINTY_US[one.node.port])
        for one in network.groups
        if one.node.delay_us is None
    )


def cables_us(network: Network) -> Number:
    """Delay of all cables there and back [us]."""
    return total(one.nodes * one.cable_us for one in map(hop, network.groups))


def process_us(network: Network) -> Number:
    """All frames of process data on the wire [us]."""
    found = packing(network, devices(network))
    wire_bytes = found.frames * overhead_bytes(found.frames) + found.datagrams_bytes + found.padding_bytes
    return named(sending_us(wire_bytes), "sending_us", "sending")


def mailbox_us(network: Network) -> Number:
    """Frames of all mailbox polls, each with a frame of its own [us]."""
    bus = network.profile.bus
    polls: Number = bus.mailbox_polls
    return polls * mailbox_frame_us(network)


def mailbox_frame_us(network: Network) -> Number:
    """Frame of one mailbox poll [us]."""
    return sending_us(frame_bytes(datagram_bytes(network.profile.bus.mailbox_bytes)))


def arrivals_us(network: Network) -> dict[int, float]:
    """When each device has its command, by its number from 1; of plain numbers [us].

    A device acts when the last byte of its frame has come: a check behind the data says whether the frame is whole.
    """
    now_us = plain(network.profile.bus.master_us)
    sent_us: dict[int, float] = {}
    for one in frames(network):
        now_us += plain(sending_us(frame_bytes(one.datagrams_bytes)))
        sent_us |= dict.fromkeys(one.devices, now_us)
    found, way_us, device = {}, 0.0, 0
    for one_hop in map(hop, network.groups):
        for _ in range(int(plain(one_hop.nodes))):
            device += 1
            way_us += plain(one_hop.device_us + one_hop.cable_us) / 2
            found[device] = sent_us[device] + way_us
    return found
