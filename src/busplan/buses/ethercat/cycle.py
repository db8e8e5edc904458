"""The cycle: the master, all frames one behind the other, their way through all devices and back, and the window."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Final, Literal

from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, Doubt, LeftOut, Term
from busplan.buses.ethercat.equations import (
    BYTE_BIAS_UNCERTAINTY_US,
    BYTE_BIAS_US,
    device_us,
    frame_bytes,
    overhead_bytes,
    sending_us,
)
from busplan.buses.ethercat.latency import last_command_us, latencies, loop_periods, sync0_us
from busplan.buses.ethercat.packing import Devices, Packing
from busplan.buses.ethercat.traffic import (
    cables_us,
    data_bytes,
    devices,
    devices_doubts,
    devices_us,
    frames,
    hop,
    mailbox_frame_us,
    mailbox_us,
    packing,
)
from busplan.buses.network import Network
from busplan.elementwise import Number, choose, larger, named, plain, total

TimingModelName = Literal["last-byte", "vendors"]
LAST_BYTE: Final[TimingModelName] = "last-byte"
VENDORS: Final[TimingModelName] = "vendors"


_LEFT_OUT: Final = {
    "bus.master_us": "the master's own time",
    "bus.master_jitter_us": "the master's jitter",
    "bus.mailbox_polls": "mailbox polls",
}
"""Keys of [bus] that a cycle lacks where they are 0."""


class EthercatCycle(BusCycle):
    """The master's time and jitter, frames, devices and cables there and back, and the window."""

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.counts_reception = model == VENDORS

    @cached_property
    def _devices(self) -> tuple[Devices, ...]:
        return devices(self.network)

    @cached_property
    def packing(self) -> Packing:
        """All frames of process data."""
        return packing(self.network, self._devices)

    @cached_property
    def process_bytes(self) -> Number:
        """Process data of all devices [bytes]."""
        return named(total(one.number * one.data_bytes for one in self._devices), "process_bytes", "D")

    @cached_property
    def _overhead_bytes(self) -> Number:
        found = self.packing
        headers = found.datagrams_bytes - self.process_bytes
        return found.frames * overhead_bytes(found.frames) + headers + found.padding_bytes

    @cached_property
    def _receive_us(self) -> Number:
        """The last frame once more, where it is counted [us]."""
        if not self.counts_reception:
            return 0.0
        last_us = sending_us(frame_bytes(self.packing.last_bytes))
        return choose(self.network.profile.bus.mailbox_polls > 0, mailbox_frame_us(self.network), last_us)

    @property
    def most_required_us(self) -> Number:
        """No less than with fewer devices: a short last frame takes less to receive than the full one before it."""
        if not self.counts_reception:
            return self.required_us
        last_us, before_us = (
            sending_us(frame_bytes(one)) for one in (self.packing.last_bytes, self.packing.before_bytes)
        )
        polls = self.network.profile.bus.mailbox_polls
        lost_us = choose(self.packing.before_bytes > 0, larger(before_us - 2 * last_us, 0.0), 0.0)
        return self.required_us + choose(polls > 0, 0.0, lost_us)

    def computed_terms(self) -> tuple[Term, ...]:
        """The cycle in the order of the wire."""
        return (
            Term("cycle_master_us", self.network.profile.bus.master_us, "bus.master_us"),
            Term("cycle_jitter_us", self.network.profile.bus.master_jitter_us, "bus.master_jitter_us"),
            Term("cycle_frames_us", sending_us(self._overhead_bytes)),
            Term("cycle_data_us", sending_us(self.process_bytes)),
            Term("cycle_mailbox_us", mailbox_us(self.network), "bus.mailbox_polls"),
            Term("cycle_devices_us", devices_us(self.network)),
            Term("cycle_cable_us", cables_us(self.network)),
            Term("cycle_receive_us", self._receive_us),
            Term("nonperiodic_us", self.network.nonperiodic_us),
        )

    def bias_us(self) -> Number:
        """What process data take beyond the wire: about a copy in the host [us]."""
        return self.process_bytes * BYTE_BIAS_US

    def doubts(self) -> tuple[Doubt, ...]:
        """The delays of devices, the master's own time, and what bytes take beyond the wire."""
        devices = (Doubt(one.key, one.label, device_us(one.one_way_us)) for one in devices_doubts(self.network))
        return (
            *devices,
            Doubt("bus.master_us", "the master's own time", self.network.profile.bus.master_doubt_us),
            Doubt("bytes", "what a byte takes beyond the wire", self.process_bytes * BYTE_BIAS_UNCERTAINTY_US),
        )

    def left_out(self) -> tuple[LeftOut, ...]:
        """The master's own time and jitter, mailbox polls, and cables without a length."""
        bus = self.network.profile.bus
        found = {key: getattr(bus, key.removeprefix("bus.")) for key in _LEFT_OUT}
        found |= {one.key("cable_m"): one.node.cable_m for one in self.network.groups if one.node.port != "E-bus"}
        return tuple(LeftOut(_LEFT_OUT.get(key, "cables"), key) for key, value in found.items() if not value)

    def events(self) -> Iterator[BusEvent]:
        """Frame by frame with the data of each device, then the last byte through all devices and back."""
        bus = self.network.profile.bus
        yield BusEvent("master", "cycle_master_us", plain(bus.master_us), "master")
        yield BusEvent("jitter", "cycle_jitter_us", plain(bus.master_jitter_us), "latest start of the frames")
        yield from self._frames()
        for number in range(1, int(plain(bus.mailbox_polls)) + 1):
            yield BusEvent("mailbox", "cycle_mailbox_us", plain(mailbox_frame_us(self.network)), f"mailbox {number}")
        way = list(self._way())
        yield from way
        yield from reversed([one._replace(label=one.label.replace("to", "back from", 1)) for one in way])
        yield BusEvent("receive", "cycle_receive_us", plain(self._receive_us), "last frame again")
        yield BusEvent("nonperiodic", "nonperiodic_us", plain(self.network.nonperiodic_us), "non-periodic window")

    def _frames(self) -> Iterator[BusEvent]:
        """What each frame has beside its data, then the data of each of its devices."""
        sizes = [
            plain(data_bytes(one, self.network)) for one in self.network.groups for _ in range(int(plain(one.nodes)))
        ]
        for number, one in enumerate(frames(self.network), start=1):
            own = [(device, sizes[device - 1]) for device in one.devices]
            overhead = plain(frame_bytes(one.datagrams_bytes)) - sum(size for _, size in own)
            yield BusEvent(
                "overhead", "cycle_frames_us", plain(sending_us(overhead)), f"headers of frame {number}", None, "frame"
            )
            for device, size in own:
                us = plain(sending_us(size))
                yield BusEvent("data", "cycle_data_us", us, f"data of device {device}", device, "frame")

    def _way(self) -> Iterator[BusEvent]:
        """The last byte to each device and through it."""
        device = 0
        for one in map(hop, self.network.groups):
            for _ in range(int(plain(one.nodes))):
                device += 1
                cable_us, device_us = plain(one.cable_us) / 2, plain(one.device_us) / 2
                yield BusEvent("cable", "cycle_cable_us", cable_us, f"cable to device {device}", device, "way")
                yield BusEvent("device", "cycle_devices_us", device_us, f"way to device {device}", device, "way")

    def figures(self) -> Mapping[str, Number | None]:
        """Frames and process data, and whether commands come before SYNC0."""
        has_clocks = self.network.profile.bus.distributed_clocks
        return {
            "frames": self.packing.frames,
            "process_bytes": self.process_bytes,
            "command_us": last_command_us(self.network),
            "sync0_us": sync0_us(self.network) if has_clocks else None,
        }

    def loop_periods(self, *, at_sync: bool) -> int:
        """The master's pipeline, and the cycles that feedback and command wait for a frame and for SYNC0."""
        return loop_periods(self.network, at_sync=at_sync)

    def latencies(self) -> tuple[BusLatency, ...]:
        """The worst case of a command, of feedback, and of both, for each group."""
        return latencies(self.network)
