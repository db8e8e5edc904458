"""The cycle: the master, all frames in sequence, their path through devices and back, and the non-periodic window."""

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Final, Literal, cast

from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, Doubt, Premise, Run
from busplan.buses.ethercat.equations import (
    FRAME,
    LATENCY_TABLE,
    MEAN,
    TERMS,
    EthercatFigures,
    c,
    cable_us,
    frame_bytes,
    overhead_bytes,
    sending_us,
)
from busplan.buses.ethercat.frames import (
    Devices,
    Packing,
    cables_us,
    cycles_of,
    devices,
    devices_at,
    devices_doubts,
    devices_us,
    frames,
    has_rates,
    hop_us,
    mailbox_frame_us,
    mean_wire_bytes,
    packing,
    process_us,
    rates,
)
from busplan.buses.figure import NONPERIODIC
from busplan.buses.network import Group, Network, Rate
from busplan.buses.parts import EventKind
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import Number, choose, larger, named, rounded_up, square_root, step, total

if TYPE_CHECKING:
    from busplan.buses.ethercat.section import EthercatBus

TimingModelName = Literal["last-byte", "vendors"]
LAST_BYTE: Final[TimingModelName] = "last-byte"
VENDORS: Final[TimingModelName] = "vendors"
EVENTS: Final = (
    EventKind("master", "master", "profile", "M", "contention"),
    EventKind("jitter", "master's jitter", "profile", "j", "contention"),
    EventKind("overhead", "frame overhead", FRAME, "f", "gap"),
    EventKind("data", "process data", FRAME, ">", "out"),
    EventKind("mailbox", "mailbox poll", FRAME, "b", "acknowledge"),
    EventKind("cable", "cable", "SOEM", "-", "sync"),
    EventKind("device", "device", "DC time stamps", "=", "work"),
    EventKind("receive", "reception", "acontis", "<", "in"),
    EventKind("nonperiodic", "non-periodic window", NONPERIODIC.reference, "N", "reserve"),
)
"""Kinds of events in the order of the cycle."""
STRETCHES: Final = (
    EventKind("frame", "frames", "", "F", "out"),
    EventKind("way", "way through the devices", "", "W", "work"),
)
"""Kinds of stretches, each a sequence of events."""


def sync0_us(network: Network) -> Number:
    """Time from the master's task to the first SYNC0 [us]; 0 without distributed clocks."""
    return sync0_share(network) * network.period_us if network.profile.bus.distributed_clocks else 0.0


def sync0_share(network: Network) -> Number:
    """Share of the period up to the first SYNC0 [1]; 1 for a shift of 0, since frames follow the SYNC0 at the task."""
    shift = network.profile.bus.sync_shift
    return choose(shift > 0, shift, 1)


PREMISES: Final = (
    Premise("bus.master_us", "an instant master", 40.0),
    Premise("bus.master_jitter_us", "no jitter of the master", 20.0),
    Premise("bus.mailbox_polls", "no mailbox polls", 1),
    Premise("node.cable_length_m", "cables of length 0", 10.0),
    Premise("node.delay_us", "usual delays of devices"),
    Premise("bus.master", "the frames of a usual master"),
    Premise("bus.process_data", "the frames of a usual master"),
    Premise("bus.pipeline_cycles", "commands one cycle later", 2),
)


class EthercatCycle(BusCycle):
    """The master's time and jitter, frames, devices and cables there and back, and the non-periodic window."""

    term_figures = TERMS
    record = EthercatFigures
    premises = PREMISES

    def __init__(self, network: Network, model: str, number: int | None = None) -> None:
        self.network = network
        self.bus = cast("EthercatBus", network.profile.bus)
        """Section [bus] of the profile."""
        self.model = model
        self.number = number
        self.counts_reception = model == VENDORS

    @property
    def rates(self) -> tuple[Rate, ...]:
        """Rate and first cycle of each group."""
        return rates(self.network)

    def at(self, number: int) -> "EthercatCycle":
        """Cycle `number` of the hyperperiod."""
        return EthercatCycle(self.network, self.model, number)

    @property
    def fullest(self) -> int:
        """Number of the first cycle with the most bytes on the wire."""
        return cycles_of(self.network)[0].numbers[0]

    @cached_property
    def _devices(self) -> tuple[Devices, ...]:
        return devices(self.network) if self.number is None else devices_at(self.network, self.number)

    @cached_property
    def packing(self) -> Packing:
        """Frames of the process data."""
        return packing(self.network, self._devices)

    @cached_property
    @step("D")
    def process_bytes(self) -> Number:
        """Process data of all devices [bytes]."""
        return total(group.number * group.data_bytes for group in self._devices)

    @cached_property
    def _overhead_bytes(self) -> Number:
        packed = self.packing
        headers = packed.datagrams_bytes - self.process_bytes
        return packed.frames * overhead_bytes() + headers + packed.padding_bytes

    @cached_property
    def _receive_us(self) -> Number:
        """Time to receive the last frame, in the vendors' model [us]."""
        if not self.counts_reception:
            return 0.0
        is_empty = self.number is not None and not self.packing.frames
        last_us = 0.0 if is_empty else sending_us(frame_bytes(self.packing.last_bytes))
        return choose(self.bus.mailbox_polls > 0, mailbox_frame_us(self.network), last_us)

    @property
    def most_required_us(self) -> Number:
        """Upper bound over all smaller node counts [us]: one more node may open a short frame, which arrives sooner."""
        if not self.counts_reception:
            return self.required_us
        last_us, before_us = (
            sending_us(frame_bytes(datagrams_bytes))
            for datagrams_bytes in (self.packing.last_bytes, self.packing.before_bytes)
        )
        polls = self.bus.mailbox_polls
        # Without that frame its sending and reception do not count; the reception of the frame before does.
        lost_us = choose(self.packing.before_bytes > 0, larger(before_us - 2 * last_us, 0.0), 0.0)
        return self.required_us + choose(polls > 0, 0.0, lost_us)

    def written(self) -> Iterator[BusEvent | Run]:
        """The master, its frames, the last byte through all devices and back, and the non-periodic window."""
        bus = self.bus
        yield BusEvent("master", "cycle_master_us", bus.master_us, "master", rests_on="bus.master_us")
        late_us, late = bus.master_jitter_us, "latest start of the frames"
        yield BusEvent("jitter", "cycle_jitter_us", late_us, late, rests_on="bus.master_jitter_us")
        headers = BusEvent("overhead", "cycle_frames_us", sending_us(self._overhead_bytes), "headers")
        data = BusEvent("data", "cycle_data_us", sending_us(self.process_bytes), "data")
        yield Run((headers, data), laid_out=lambda _: self._frames())
        poll_us = mailbox_frame_us(self.network)
        poll = BusEvent("mailbox", "cycle_mailbox_us", poll_us, "mailbox", rests_on="bus.mailbox_polls")
        yield Run((poll,), bus.mailbox_polls, laid_out=lambda number: [poll._replace(label=f"mailbox {number + 1}")])
        cables = BusEvent("cable", "cycle_cable_us", cables_us(self.network), "cables")
        hops = BusEvent("device", "cycle_devices_us", devices_us(self.network), "devices")
        yield Run((cables, hops), laid_out=lambda _: self._way())
        yield BusEvent("receive", "cycle_receive_us", self._receive_us, "reception of the last frame")
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    def bias_us(self) -> Number:
        """Time of process data beyond the wire [us]: about one copy in the host."""
        return self.process_bytes * c.BYTE_BIAS_US

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubts of the devices' delays, of the master's own time, and of the time of bytes beyond the wire."""
        return (
            *devices_doubts(self.network),
            Doubt("bus.master_us", "the master's own time", self.bus.master_doubt_us),
            Doubt("bytes", "time of a byte beyond the wire", self.process_bytes * c.BYTE_BIAS_UNCERTAINTY_US),
        )

    def _frames(self) -> Iterator[BusEvent]:
        """Events of the frames: of each its overhead, then the data of each device in it."""
        sizes = [group.data_bytes for group in self._devices for _ in range(int(group.number))]
        number = 0
        for run in frames(self.network, self._devices):
            for carried in run.by_frame():
                number += 1
                overhead = frame_bytes(run.datagrams_bytes) - sum(sizes[device - 1] for device in carried)
                us, label = sending_us(overhead), f"headers of frame {number}"
                yield BusEvent("overhead", "cycle_frames_us", us, label, None, "frame")
                for device in carried:
                    us = sending_us(sizes[device - 1])
                    yield BusEvent("data", "cycle_data_us", us, f"data of device {device}", device, "frame")

    def _way(self) -> Iterator[BusEvent]:
        """Events of the last byte's path to each device, through it, and back."""
        way: list[BusEvent] = []
        back: list[BusEvent] = []
        device = 0
        for group in self.network.groups:
            to_us, through_us = cable_us(group.node.cable_length_m) / 2, hop_us(group) / 2
            for _ in range(int(group.nodes)):
                device += 1
                cable = BusEvent("cable", "cycle_cable_us", to_us, f"cable to device {device}", device, "way")
                through = BusEvent("device", "cycle_devices_us", through_us, f"way to device {device}", device, "way")
                way += [cable, through]
                back += [
                    cable._replace(label=f"cable back from device {device}"),
                    through._replace(label=f"way back from device {device}"),
                ]
        yield from way
        yield from reversed(back)

    def figures(self) -> Mapping[str, Number | None]:
        """Frames, process data, time of the last command, time of SYNC0, and the mean load."""
        return {
            "frames": self.packing.frames,
            "process_bytes": self.process_bytes,
            "command_us": self.last_command_us,
            "sync0_us": sync0_us(self.network) if self.bus.distributed_clocks else None,
            MEAN.key: self._mean_us / self._given_us,
        }

    def card_lines(self, fits: Callable[[Network], bool]) -> tuple[tuple[str, str], ...]:  # noqa: ARG002 - its margin is said elsewhere
        """Lines on the cycle of the verdict and on the mean cycle; none where all groups have the same rate."""
        if not has_rates(self.network):
            return ()
        cycles = cycles_of(self.network)
        names = (group.name for group, is_due in zip(self.network.groups, cycles[0].due, strict=True) if is_due)
        shown, number = ", ".join(names) or "no group", sum(len(cycle.numbers) for cycle in cycles)
        mean_us, given_us = self._mean_us, self._given_us
        return (
            ("fullest cycle", f"carries {shown}; {len(cycles[0].numbers)} of {number} cycles do"),
            ("mean cycle", f"{mean_us:.1f} us, {mean_us / given_us:.0%}".replace("%", " %")),
        )

    @property
    def _given_us(self) -> Number:
        network = self.network
        return time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)

    @property
    def _mean_us(self) -> Number:
        """Time that the mean cycle needs [us]."""
        network = self.network
        if not has_rates(network):
            return self.required_us
        polls: Number = network.profile.bus.mailbox_polls
        receives_last: Number = polls <= 0 if self.counts_reception else False
        last_us = choose(receives_last, self._receive_us, 0.0)
        others_us = self.required_us - process_us(network, self._devices) - last_us
        return others_us + sending_us(mean_wire_bytes(network, with_reception=receives_last))

    def arrival_us(self, node: int) -> float:
        """Time from the start of a cycle to the command of device `node`, which counts from 1, in plain numbers [us].

        A device takes its command at the end of its frame, after the check sequence. The frames are those of the
        fullest cycle and start as late as the master's jitter allows. A device without data in them counts as if it
        were in the last frame.
        """
        network = self.network
        sent_us = network.profile.bus.master_us + network.profile.bus.master_jitter_us
        for run in frames(network, devices(network)):
            frame_us, before = sending_us(frame_bytes(run.datagrams_bytes)), node - run.first
            if before < run.devices * run.frames:
                sent_us += (before // run.devices + 1) * frame_us
                break
            sent_us += run.frames * frame_us
        way_us, left = 0.0, node
        for group in network.groups:
            passed = min(left, int(group.nodes))
            way_us += passed * (hop_us(group) + cable_us(group.node.cable_length_m)) / 2
            left -= passed
        return float(sent_us + way_us)

    @property
    def takes_at_sync(self) -> bool:
        """Whether commands wait for SYNC0: without distributed clocks a drive acts when its frame has passed."""
        return super().takes_at_sync and self.bus.distributed_clocks

    def sampled_us(self) -> float:
        """Time of SYNC0, at which drives sample; 0 without distributed clocks [us]."""
        return float(sync0_us(self.network))

    def loop_periods(self, *, at_sync: bool) -> int:
        """Periods inside a loop: the master's pipeline, and the waits for a frame and for SYNC0 [1].

        The slowest group counts; groups at slower rates are left out.
        """
        network, period_us = self.network, self.network.period_us
        shift_us = self.sampled_us()
        last_us = self.arrival_us(int(network.nodes))

        def waits(group: Group) -> float:
            sampled = _until_taken((shift_us + group.slowest_us("read")) / period_us) if group.has("read") else 1
            late_us = last_us + group.slowest_us("write") - shift_us
            return sampled + (max(rounded_up(late_us / period_us), 0) if at_sync and group.has("write") else 0)

        groups = [group for group in network.groups if not group.is_slower] or network.groups
        return int(max(map(waits, groups)) + network.profile.bus.pipeline_cycles)

    def latencies(self) -> tuple[BusLatency, ...]:
        """Worst case of a command, of feedback, and of a loop over both, for each group."""
        latencies = []
        for group in self.network.groups:
            command, feedback = self._command(group), self._feedback(group)
            # The master's pipeline begins with the cycle that brings the feedback.
            drive_us = feedback["drive_us"] + command["drive_us"]
            loop = {**command, "drive_us": drive_us, "frame_wait_us": feedback["frame_wait_us"]}
            is_read, is_written = group.has("read"), group.has("write")
            for name, phases, is_there in (
                ("command", command, is_written),
                ("feedback", feedback, is_read),
                ("loop", loop, is_read and is_written),
            ):
                if not is_there:
                    continue
                whole_us = {LATENCY_TABLE[-1].key: total(phases.values())}
                latencies.append(BusLatency(name, None, phases | whole_us, group.name))
        return tuple(latencies)

    @property
    def last_command_us(self) -> Number:
        """Latest time from the master's task until the last device has taken its command [us]."""
        taken_us = (group.if_any("write", self._taken_us(group)) for group in self.network.groups)
        return reduce(larger, taken_us)

    @property
    def command_doubt_us(self) -> Number:
        """Standard uncertainty of `last_command_us`: master, devices one way, bytes and slowest execution [us]."""
        execution_us = reduce(larger, (group.write_uncertainty_us for group in self.network.groups))
        parts = (
            self.bus.master_doubt_us,
            *(doubt.us / 2 for doubt in devices_doubts(self.network)),
            self.process_bytes * c.BYTE_BIAS_UNCERTAINTY_US,
            execution_us,
        )
        return square_root(total(part * part for part in parts))

    @cached_property
    def _sent_us(self) -> Number:
        """Time of all frames of process data of the fullest cycle [us]."""
        return process_us(self.network, devices(self.network))

    @cached_property
    @step("way")
    def _way_us(self) -> Number:
        """Delay of devices and cables to the last device and back [us]."""
        return devices_us(self.network) + cables_us(self.network)

    @step("t_cmd", "command_us")
    def _taken_us(self, group: Group) -> Number:
        """Latest time at which a group has taken its command, as if it stood at the end of the segment [us]."""
        bus = self.bus
        on_wire_us = bus.master_us + bus.master_jitter_us + self._sent_us + self._way_us / 2
        return on_wire_us + group.slowest_us("write")

    def _command(self, group: Group) -> dict[str, Number]:
        """Phases of a command, from the cycle with the feedback it is computed from to its effect [us]."""
        network, bus = self.network, self.bus
        taken_us = self._taken_us(group)
        wait_us: Number = 0.0
        if self.takes_at_sync:
            late = larger(rounded_up((taken_us - sync0_us(network)) / network.period_us), 0)
            wait_us = sync0_us(network) + late * network.period_us - taken_us
        return {
            "drive_us": group.slowest_us("write"),
            "frame_wait_us": 0.0,
            "pipeline_us": named(bus.pipeline_cycles * _period_us(group, network), "pipeline_us", "n T_s"),
            "master_us": bus.master_us,
            "jitter_us": bus.master_jitter_us,
            "sending_us": self._sent_us,
            "path_us": self._way_us / 2,
            "sync_wait_us": wait_us,
        }

    def _feedback(self, group: Group) -> dict[str, Number]:
        """Phases of feedback, from the sample through the wait for a frame until the master has all frames [us]."""
        network, bus = self.network, self.bus
        ready_us = group.slowest_us("read")
        ready_at_us = sync0_us(network) + ready_us
        period_us = _period_us(group, network)
        return {
            "drive_us": ready_us,
            "frame_wait_us": _until_taken(ready_at_us / period_us) * period_us - ready_at_us,
            "pipeline_us": 0.0,
            "master_us": bus.master_us,
            "jitter_us": bus.master_jitter_us,
            "sending_us": self._sent_us + bus.mailbox_polls * mailbox_frame_us(network),
            "path_us": self._way_us,
            "sync_wait_us": 0.0,
        }


def _period_us(group: Group, network: Network) -> Number:
    """Time from one cycle with the group's data to the next [us]."""
    return group.every * network.period_us if group.is_slower else network.period_us


def _until_taken(ready: Number) -> Number:
    """Periods from a cycle's task to the frame that takes its sample, ready after `ready` of them; 1 or more."""
    return larger(rounded_up(ready), 1)
