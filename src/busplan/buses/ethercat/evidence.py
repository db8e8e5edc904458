"""Figures that vendors and others publish beside what the equations give."""

from collections.abc import Mapping
from typing import Any, Final

from busplan.buses.ethercat.cycle import LAST_BYTE, VENDORS, EthercatCycle
from busplan.buses.ethercat.equations import (
    CLOCK_BYTES,
    DELAY_US,
    SHARED,
    cable_us,
    datagram_bytes,
    device_us,
    frame_bytes,
    room_bytes,
    sending_us,
)
from busplan.buses.ethercat.latency import latencies
from busplan.buses.network import Network
from busplan.buses.published import Comparison, EvidenceSection
from busplan.elementwise import plain

Published = Mapping[str, Any]
_LAYOUT: Final = "frame layout"
_DATA: Final = "ethercat"


def sections(network: Network, published: Published) -> tuple[EvidenceSection, ...]:
    """Compare everything that the data file holds.

    Parameters
    ----------
    network
        Any network, of alike devices.
    published
        The published figures.

    References
    ----------
    The sources of the data file.
    """
    bare = _bare(network)
    return (
        _frame(published),
        _vendors(bare, published),
        _wire(published),
        _pipeline(bare, published),
    )


def _bare(network: Network) -> Network:
    """One device that takes no time, of a master that takes none, and nothing but shared bytes."""
    profile = network.profile
    bus = profile.bus.model_copy(
        update={
            "master_us": 0.0,
            "master_jitter_us": 0.0,
            "mailbox_polls": 0,
            "distributed_clocks": False,
            "sync_shift": 0.0,
            "process_data": SHARED,
            "housekeeping_bytes": (),
        }
    )
    (group,) = network.groups
    said = group.said._replace(node=group.node.model_copy(update={"delay_us": 0.0, "cable_m": 0.0}))
    own = group._replace(said=said, nodes=1, read_execution_us=0.0, write_execution_us=0.0, worst_extra_us=0.0)
    return network._replace(profile=profile.model_copy(update={"bus": bus}), groups=(own,))


def _one_frame_us(bare: Network, size: int, model: str) -> float:
    groups = tuple(one._replace(read_bytes=size, write_bytes=size) for one in bare.groups)
    return plain(EthercatCycle(bare._replace(groups=groups), model).required_us)


def _frame(published: Published) -> EvidenceSection:
    title, given = "EtherCAT: sizes of a frame", published["frame"]
    found = {
        "most process data": ("most_data_bytes", room_bytes(1)),
        "most process data beside the clocks' datagram": (
            "most_data_with_clocks_bytes",
            room_bytes(1) - plain(CLOCK_BYTES["SOEM"]),
        ),
        "shortest frame on the wire": ("shortest_bytes", plain(frame_bytes(datagram_bytes(1)))),
        "longest frame on the wire": ("longest_bytes", plain(frame_bytes(datagram_bytes(room_bytes(1))))),
    }
    return EvidenceSection(
        title,
        f"{given['source']}.",
        tuple(
            Comparison(title, words, "bytes", given[key], _LAYOUT, computed, given["grade"])
            for words, (key, computed) in found.items()
        ),
        _DATA,
    )


def _vendors(bare: Network, published: Published) -> EvidenceSection:
    title, given = "EtherCAT: update times that vendors advertise", published["vendors"]
    rows = zip(given["names"], given["data_bytes"], given["update_us"], strict=True)
    return EvidenceSection(
        title,
        f"{given['source']}. Sources say neither how many devices share the data nor the cables: ours is one frame on "
        "the wire without any, so what is left over is propagation. Of the axes, 8 bytes each way are our assumption. "
        "The vendors' count does not hold for 100 axes: it says more than they do.",
        tuple(
            Comparison(title, name, "us", us, f"{model} model", _one_frame_us(bare, size, model), given["grade"])
            for name, size, us in rows
            for model in (LAST_BYTE, VENDORS)
        ),
        _DATA,
    )


def _wire(published: Published) -> EvidenceSection:
    title, given = "EtherCAT: a frame through six devices", published["wire"]
    e_bus_us = plain(device_us(DELAY_US["E-bus"])) + plain(cable_us(given["cable_m"]))
    computed = plain(sending_us(given["bytes"])) + given["devices"] * e_bus_us
    return EvidenceSection(
        title,
        f"{given['source']}. Ours has E-bus devices, and each cable there and back; theirs counts a cable once.",
        (
            Comparison(
                title, "time on the wire", "us", given["time_us"], f"{LAST_BYTE} model", computed, given["grade"]
            ),
        ),
        _DATA,
    )


def _pipeline(bare: Network, published: Published) -> EvidenceSection:
    title, given = "EtherCAT: run times through a master and a drive", published["pipeline"]
    bus = bare.profile.bus.model_copy(update={"distributed_clocks": True, "pipeline_cycles": 1})
    timed = bare._replace(profile=bare.profile.model_copy(update={"bus": bus}), period_us=given["period_us"])
    found = {one.name: plain(one.phases["end_to_end_us"]) for one in latencies(timed)}
    method, grade = "one cycle in the master", given["grade"]
    return EvidenceSection(
        title,
        f"{given['source']}. Ours has one cycle in the master and SYNC0 at the start of the next, one short frame and "
        "no time of the drive; theirs holds the drive's own cycles, which the source does not part.",
        (
            Comparison(title, "command to drive", "us", given["command_us"], method, found["command"], grade),
            Comparison(title, "feedback to master", "us", given["feedback_us"], method, found["feedback"], grade),
        ),
        _DATA,
    )
