"""Frames of an EtherCAT cycle: devices packed into datagrams, groups at their rates, and delays on the path."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, compress
from math import isqrt, lcm
from typing import Final, NamedTuple

from busplan.buses.cycle import Doubt
from busplan.buses.ethercat.equations import (
    LAYOUTS,
    SHARED,
    SPLIT,
    UNNAMED,
    ProcessData,
    Starts,
    c,
    cable_us,
    datagram_bytes,
    device_us,
    frame_bytes,
    overhead_bytes,
    padding_bytes,
    room_bytes,
    sending_us,
)
from busplan.buses.network import Group, Network, Rate, numbers_by_due
from busplan.elementwise import (
    Number,
    choose,
    is_everywhere,
    is_off,
    larger,
    named,
    pointwise,
    rounded_down,
    rounded_up,
    smaller,
    square_root,
    step,
    total,
)
from busplan.errors import BusplanError
from busplan.sourced import cached


class Devices(NamedTuple):
    """Adjacent devices with the same process data; floats, arrays or traced numbers."""

    number: Number
    """Number of devices [1]."""
    data_bytes: Number
    """Process data of each device [bytes]."""
    starts: Starts | None = None
    """Datagram or frame that the devices open; None where their data follow in the datagram before."""


class Packing(NamedTuple):
    """Frames of the process data of a cycle; floats, arrays or traced numbers."""

    frames: Number
    datagrams_bytes: Number
    """Datagrams of all frames, headers and data [bytes]."""
    padding_bytes: Number
    """Padding of short frames [bytes]."""
    last_bytes: Number
    """Datagrams of the last frame [bytes]."""
    before_bytes: Number
    """Datagrams of the last frame but one [bytes]; 0 where there is none."""

    @property
    def wire_bytes(self) -> Number:
        """Bytes of all frames on the wire [bytes]."""
        return self.frames * overhead_bytes() + self.datagrams_bytes + self.padding_bytes


def pack(devices: Sequence[Devices], *, datagrams: int, first_bytes: Number) -> Packing:
    """Frames into which the devices fit, in the order of the segment.

    `devices` has at least one group. `datagrams` of process data are in each frame that holds any: 1 for LRW, 2 for LRD
    and LWR [1]. `first_bytes` are the master's own datagrams, which open the first frame [bytes]. A device too large
    for a frame counts as one frame; a limit is broken then.

    Examples
    --------
    >>> pack([Devices(1000, 4)], datagrams=1, first_bytes=0.0)
    Packing(frames=3, datagrams_bytes=4036.0, padding_bytes=0.0, last_bytes=1044.0, before_bytes=1496.0)
    """
    devices = [_with_data(group) for group in devices if not is_everywhere(group.data_bytes <= 0)] or [Devices(0, 1)]
    room = room_bytes(datagrams)
    headers = total([c.DATAGRAM_BYTES] * datagrams)
    free: Number = 0.0  # Bytes for data in the open frame, which is the last so far.
    frames: Number = 0
    last: Number = 0.0
    datagrams_bytes: Number = first_bytes
    padding: Number = 0.0
    before: Number = 0.0
    behind: Number = 0  # Devices so far.
    if not is_off(first_bytes):
        # The master's datagrams go alone where the first device has no room after them.
        has_room = room - first_bytes - _first_device_bytes(devices) >= 0
        free = choose(has_room, room - first_bytes, 0.0)
        follows, is_filled = choose(has_room, headers, 0.0), total(group.number for group in devices) > 0
        # Without process data the master's datagrams go alone, without a header for data.
        last = first_bytes + (follows if is_everywhere(is_filled) else choose(is_filled, follows, 0.0))
        datagrams_bytes = last
        frames = 1
    for group in devices:
        if group.starts:
            left = larger(free - headers, 0.0) if group.starts == "datagram" else 0.0
            free = choose(behind > 0, left, free)
        fitting = smaller(group.number, rounded_down(free / group.data_bytes))
        if group.starts:
            joining = choose(behind > 0, choose(fitting > 0, headers, 0.0), 0.0)
            last, datagrams_bytes = last + joining, datagrams_bytes + joining
        behind = behind + group.number
        rest = group.number - fitting
        last, free = last + fitting * group.data_bytes, free - fitting * group.data_bytes
        per_frame = larger(rounded_down(room / group.data_bytes), 1)
        new = rounded_up(rest / per_frame)
        in_last = (rest - (larger(new, 1) - 1) * per_frame) * group.data_bytes
        opens = rest > 0
        before = choose(opens, choose(new > 1, headers + per_frame * group.data_bytes, last), before)
        padding = padding + choose(opens, padding_bytes(last), 0.0)
        last, free = choose(opens, headers + in_last, last), choose(opens, larger(room - in_last, 0.0), free)
        frames, datagrams_bytes = frames + new, datagrams_bytes + new * headers + group.number * group.data_bytes
    return Packing(frames, datagrams_bytes, padding + padding_bytes(last), last, before)


def _with_data(devices: Devices) -> Devices:
    """The devices; array points without data, which are in no frame, become 0 devices of 1 byte."""
    if is_everywhere(devices.data_bytes > 0):
        return devices
    number = choose(devices.data_bytes > 0, devices.number, 0)
    return Devices(number, larger(devices.data_bytes, 1), devices.starts)


def _first_device_bytes(devices: Sequence[Devices]) -> Number:
    """Data of the first device with data [bytes]; in an array, the first groups of a point may be empty."""
    first: Number = devices[-1].data_bytes
    for group in reversed(devices[:-1]):
        is_there = group.number > 0
        first = group.data_bytes if is_everywhere(is_there) else choose(is_there, group.data_bytes, first)
    return first


class FrameRun(NamedTuple):
    """Equal frames in sequence, each with the same number of devices, in plain numbers."""

    first: int
    """Number of the first device in the first frame, from 1."""
    devices: int
    """Devices in each frame; 0 where only the master's own datagrams had room."""
    datagrams_bytes: float
    """Datagrams of each frame [bytes]."""
    frames: int = 1

    def by_frame(self) -> Iterator[range]:
        """Device numbers in each frame."""
        for frame in range(self.frames):
            first = self.first + frame * self.devices
            yield range(first, first + self.devices)


def frames_of(devices: Sequence[Devices], *, datagrams: int, first_bytes: float) -> Iterator[FrameRun]:
    """Frames that `pack` counts, in their order and in plain numbers: a few runs for a group of any size."""
    room, headers = room_bytes(datagrams), datagrams * float(c.DATAGRAM_BYTES)
    first, held, opened, filled = 1, 0, first_bytes, 0.0
    for group in devices:
        size, left = group.data_bytes, int(group.number)
        if group.starts and filled and size and left:
            if group.starts == "datagram" and opened + filled + headers + size <= room:
                filled += headers
            else:
                yield FrameRun(first, held, opened + headers + filled)
                first, held, opened, filled = first + held, 0, 0.0, 0.0
        # Couplers have no data and fit into any frame.
        fitting = max(int((room - opened - filled) // size), 0 if held or opened else 1) if size else left
        added = min(left, fitting)
        held, filled, left = held + added, filled + added * size, left - added
        if left:
            yield FrameRun(first, held, opened + bool(filled) * headers + filled)
            first, in_frame = first + held, max(int(room // size), 1)
            full = (left - 1) // in_frame
            if full:
                yield FrameRun(first, in_frame, headers + in_frame * size, full)
            first, held, opened = first + full * in_frame, left - full * in_frame, 0.0
            filled = held * size
    if opened or filled:
        yield FrameRun(first, held, opened + bool(filled) * headers + filled)


MOST_CYCLES: Final = 1000
"""Longest hyperperiod that is computed [cycles]."""
_MOST_WORK: Final = 800_000
_WORK_BESIDE: Final = 40
"""Most groups squared, times their cycles and what takes as long as so many: the time to count nodes of each group."""


class Unit(NamedTuple):
    """Devices of a group whose process data are in every n-th cycle, in plain numbers."""

    every: int
    """Distance n of the cycles with the unit's data [cycles]."""
    devices: int
    data_bytes: float
    """Process data of each device [bytes]."""
    starts: Starts | None = None

    def present(self, *, is_due: bool) -> Devices:
        """Devices of the unit in a cycle; they have no data where the unit is not due."""
        return Devices(self.devices, self.data_bytes * is_due, self.starts)


class UnitCycle(NamedTuple):
    """Cycles of the hyperperiod that have the same units, in plain numbers."""

    due: tuple[bool, ...]
    """Whether each unit is in these cycles."""
    numbers: tuple[int, ...]
    """Cycle numbers, from 1."""
    wire_bytes: float
    """All frames of process data on the wire [bytes]."""
    last_bytes: float
    """Datagrams of the last frame [bytes]."""
    data_bytes: float


def checked_hyperperiod(rates: Sequence[int]) -> int:
    """Number of cycles after which all units repeat [1].

    Raises `BusplanError` where it exceeds `MOST_CYCLES`, or less for many groups.
    """
    cycles, groups = lcm(*rates), len(rates)
    most = min(MOST_CYCLES, _MOST_WORK // max(groups, 1) ** 2 - _WORK_BESIDE)
    if cycles > max(most, 1):
        shown, most_groups = ", ".join(map(str, sorted(set(rates)))), isqrt(_MOST_WORK // (_WORK_BESIDE + 2))
        of_groups = f"{most} of {groups} groups" if groups <= most_groups else f"{most_groups} groups at several rates"
        raise BusplanError(
            f"the rates of {shown} repeat together only after {cycles} cycles; busplan computes at most "
            f"{MOST_CYCLES if most == MOST_CYCLES else of_groups}"
        )
    return cycles


def unit_rates(units: Sequence[Unit], *, is_spread: bool) -> tuple[Rate, ...]:
    """Rate and first cycle of each unit.

    Spread: units are placed fastest first, then largest first, each at the start where the fullest of its cycles has
    the fewest bytes so far. Together: all start in cycle 1.

    Examples
    --------
    >>> units = Unit(1, 8, 20), Unit(2, 4, 10), Unit(4, 1, 30), Unit(4, 2, 10)
    >>> [rate.first for rate in unit_rates(units, is_spread=True)]
    [1, 1, 2, 4]
    """
    starts = [0] * len(units)
    filled_bytes = [0.0] * checked_hyperperiod([unit.every for unit in units])
    sizes_bytes = [unit.devices * unit.data_bytes for unit in units]
    for index in sorted(range(len(units)), key=lambda index: (units[index].every, -sizes_bytes[index])):
        every = units[index].every
        if is_spread:
            starts[index] = min(range(every), key=lambda start: max(filled_bytes[start::every]))
        for cycle in range(starts[index], len(filled_bytes), every):
            filled_bytes[cycle] += sizes_bytes[index]
    return tuple(Rate(unit.every, start + 1) for unit, start in zip(units, starts, strict=True))


@cached(maxsize=1 << 8)
def unit_cycles(
    units: tuple[Unit, ...], *, is_spread: bool, datagrams: int, first_bytes: float
) -> tuple[UnitCycle, ...]:
    """Distinct cycles of the hyperperiod, the fullest first; the units are in the order of the segment.

    `is_spread` spreads slower units over the cycles as evenly as possible; otherwise they share a cycle. Raises
    `BusplanError` where the hyperperiod exceeds `MOST_CYCLES`.
    """
    whole, cycles = [unit.present(is_due=True) for unit in units], []
    for due, numbers in numbers_by_due(unit_rates(units, is_spread=is_spread)).items():
        present = [*compress(whole, due)]
        runs = list(frames_of(present, datagrams=datagrams, first_bytes=first_bytes))
        wire_bytes = total(run.frames * frame_bytes(run.datagrams_bytes) for run in runs)
        last_bytes = runs[-1].datagrams_bytes if runs else 0.0
        data_bytes = sum(group.number * group.data_bytes for group in present)
        cycles.append(UnitCycle(due, numbers, wire_bytes, last_bytes, data_bytes))
    return tuple(sorted(cycles, key=lambda cycle: (-cycle.wire_bytes, -cycle.data_bytes)))


def layout(network: Network) -> ProcessData:
    """Layout of the process data: that of the profile, else that of its master."""
    bus = network.profile.bus
    return bus.process_data or LAYOUTS[bus.master or UNNAMED]


def datagrams(network: Network) -> int:
    """Number of datagrams of process data in a frame [1]: one LRW, or an LRD and an LWR."""
    return 2 if layout(network) == SPLIT else 1


def data_bytes(group: Group, network: Network) -> Number:
    """Process data of a device [bytes]: the larger of inputs and outputs where they share bytes, else their sum."""
    both = group.read_bytes, group.write_bytes
    size_bytes = larger(*both) if layout(network) == SHARED else total(both)
    return named(size_bytes, "device_bytes", f"d{group.name and f',{group.name}'}")


def has_rates(network: Network) -> bool:
    """Whether the data of some group are not in every cycle."""
    return any(group.is_slower for group in network.groups)


def rates(network: Network) -> tuple[Rate, ...]:
    """Rate and first cycle of each group, in plain numbers."""
    units, _ = _units(network, _cycle_inputs(network, _all_devices(network)))
    return unit_rates(units, is_spread=network.profile.bus.units == "spread")


def cycles_of(network: Network) -> tuple[UnitCycle, ...]:
    """Distinct cycles of the hyperperiod, the fullest first, in plain numbers."""
    return _cycles(network, _cycle_inputs(network, _all_devices(network)))


def devices(network: Network) -> tuple[Devices, ...]:
    """All devices in their order, with their data in the fullest cycle; 0 for devices that are not in it."""
    whole = _all_devices(network)
    if not has_rates(network):
        return whole
    words = "whether the group goes in the fullest cycle"
    due = pointwise(lambda *numbers: _cycles(network, numbers)[0].due, *_cycle_inputs(network, whole), words=words)
    return tuple(
        entry._replace(data_bytes=choose(is_due > 0, entry.data_bytes, 0)) if group.is_slower else entry
        for entry, group, is_due in zip(whole, network.groups, due, strict=True)
    )


def devices_at(network: Network, number: int) -> tuple[Devices, ...]:
    """All devices in their order, with their data in cycle `number` of the hyperperiod, from 1; in plain numbers."""
    return tuple(
        group if rate.is_due(number) else group._replace(data_bytes=0)
        for group, rate in zip(_all_devices(network), rates(network), strict=True)
    )


def mean_wire_bytes(network: Network, *, with_reception: Number) -> Number:
    """Frames of process data of the mean cycle [bytes]; `with_reception` counts the last frame of each cycle twice."""

    def at_point(with_reception: float, *numbers: float) -> float:
        sum_bytes = cycles = 0.0
        for cycle in _cycles(network, numbers):
            # A cycle without process data may have no frame.
            last_bytes = frame_bytes(cycle.last_bytes) if with_reception and cycle.last_bytes else 0.0
            sum_bytes += len(cycle.numbers) * (cycle.wire_bytes + last_bytes)
            cycles += len(cycle.numbers)
        return sum_bytes / cycles

    words = "the mean over the common multiple of the rates"
    return pointwise(at_point, with_reception, *_cycle_inputs(network, _all_devices(network)), words=words)


def moves_us(network: Network, group: int) -> Number:
    """Range of the end times of a device's frame over the cycles with its data, the largest of group `group` [us].

    Frames start at the same time in each cycle; units that are not in every cycle make them longer.
    """
    if not has_rates(network):
        return 0.0

    def at_point(*numbers: float) -> float:
        units, first_bytes = _units(network, numbers)
        cycles = [
            _frame_ends(network, units, cycle.due, first_bytes)
            for cycle in _cycles(network, numbers)
            if cycle.due[group]
        ]
        first = sum(unit.devices for unit in units[:group]) + 1
        devices = range(first, first + units[group].devices)
        # The end changes only at the first device of a frame.
        starts = {device + 1 for ends in cycles for device, _ in ends if device + 1 in devices}
        moved_bytes = 0.0
        for device in starts.union(devices[:1]):
            sent = [ends[min(bisect_left(ends, (device,)), len(ends) - 1)][1] for ends in cycles]
            moved_bytes = max(moved_bytes, max(sent) - min(sent))
        return sending_us(moved_bytes)

    words = "the latest end of the device's frame less the earliest, over the cycles with its data"
    return pointwise(at_point, *_cycle_inputs(network, _all_devices(network)), words=words)


def _frame_ends(
    network: Network, units: Sequence[Unit], due: Sequence[bool], first_bytes: float
) -> list[tuple[int, float]]:
    """Last device of each frame of a cycle, and bytes on the wire by the end of the frame [bytes]; in plain numbers."""
    present = [unit.present(is_due=is_due) for unit, is_due in zip(units, due, strict=True)]
    ends, sent_bytes = [], 0.0
    for run in frames_of(present, datagrams=datagrams(network), first_bytes=first_bytes):
        for carried in run.by_frame():
            sent_bytes += frame_bytes(run.datagrams_bytes)
            ends.append((carried.stop - 1, sent_bytes))
    return ends


def _all_devices(network: Network) -> tuple[Devices, ...]:
    """All devices in their order, with their data whether their group is due or not."""
    return tuple(Devices(group.nodes, data_bytes(group, network), _starts(group)) for group in network.groups)


def _starts(group: Group) -> Starts | None:
    """Datagram or frame that a group opens; None where it follows in the datagram before, and for [node]."""
    starts: Starts | None = getattr(group.node, "starts", None)
    return starts


def _cycle_inputs(network: Network, whole: Sequence[Devices]) -> tuple[Number, ...]:
    """Flat inputs of the cycles for `pointwise`: the master's datagrams; rate, devices and bytes of each group."""
    units = ((group.every, *devices[:2]) for group, devices in zip(network.groups, whole, strict=True))
    return (housekeeping_bytes(network), *chain.from_iterable(units))


def _units(network: Network, numbers: Iterable[float]) -> tuple[tuple[Unit, ...], float]:
    """Units, and the master's own datagrams [bytes], from the flat inputs of `_cycle_inputs`."""
    first_bytes, *of_units = numbers
    columns = zip(of_units[::3], of_units[1::3], of_units[2::3], map(_starts, network.groups), strict=True)
    units = (Unit(int(every), int(nodes), data_bytes, starts) for every, nodes, data_bytes, starts in columns)
    return tuple(units), first_bytes


def _cycles(network: Network, numbers: Iterable[float]) -> tuple[UnitCycle, ...]:
    """Distinct cycles, from the flat inputs of `_cycle_inputs`."""
    units, first_bytes = _units(network, numbers)
    is_spread = network.profile.bus.units == "spread"
    return unit_cycles(units, is_spread=is_spread, datagrams=datagrams(network), first_bytes=first_bytes)


def housekeeping_bytes(network: Network) -> Number:
    """Datagrams that the master adds to the first frame, that of distributed clocks included [bytes]."""
    bus = network.profile.bus
    if bus.housekeeping_bytes is not None:
        return total(datagram_bytes(size) for size in bus.housekeeping_bytes)
    tables = (
        (c.by_key("HOUSEKEEPING_BYTES"), c.by_key("CLOCK_BYTES"))
        if bus.distributed_clocks
        else (c.by_key("HOUSEKEEPING_BYTES"),)
    )
    added: list[Number] = [table[bus.master or UNNAMED] for table in tables if table[bus.master or UNNAMED]]
    if bus.master in c.by_key("STATE_CHECK_BYTES"):
        checks_bytes = network.nodes * c.by_key("STATE_CHECK_BYTES")[bus.master]
        # State checks of many devices fill frames of their own: their overhead counts here.
        added += [checks_bytes, rounded_down(checks_bytes / room_bytes(0)) * overhead_bytes()]
    return total(added)


def packing(network: Network, present: Sequence[Devices]) -> Packing:
    """Frames of process data of the devices in `present`."""
    packed = pack(present, datagrams=datagrams(network), first_bytes=housekeeping_bytes(network))
    return packed._replace(
        frames=named(packed.frames, "frames", "F"),
        datagrams_bytes=named(packed.datagrams_bytes, "datagrams_bytes", "G"),
        padding_bytes=named(packed.padding_bytes, "padding_bytes", "pad"),
    )


def frames(network: Network, present: Sequence[Devices]) -> tuple[FrameRun, ...]:
    """Frames of `packing` in their order, in plain numbers."""
    first_bytes = housekeeping_bytes(network)
    return tuple(frames_of(present, datagrams=datagrams(network), first_bytes=first_bytes))


@step("sending", "sending_us")
def process_us(network: Network, present: Sequence[Devices]) -> Number:
    """Time on the wire of the frames of process data of some devices [us]."""
    return sending_us(packing(network, present).wire_bytes)


def mailbox_frame_us(network: Network) -> Number:
    """Time on the wire of the frame of a mailbox poll [us]."""
    return sending_us(frame_bytes(datagram_bytes(network.profile.bus.mailbox_bytes)))


def hop_us(group: Group) -> Number:
    """Delay of a device of a group, there and back: twice its `delay_us` [us]."""
    node = group.node
    return device_us(c.by_key("DELAY_US")[node.port] if node.delay_us is None else node.delay_us)


def devices_us(network: Network) -> Number:
    """Delay of all devices there and back [us]."""
    return total(group.nodes * hop_us(group) for group in network.groups)


def cables_us(network: Network) -> Number:
    """Delay of all cables there and back [us]."""
    return total(group.nodes * cable_us(group.node.cable_length_m) for group in network.groups)


def devices_doubts(network: Network) -> Iterator[Doubt]:
    """Uncertainties of the delays there and back: fully correlated for a port type, independent for measured delays."""
    for port, uncertainty_us in c.by_key("DELAY_UNCERTAINTY_US").items():
        of_port = [group for group in network.groups if group.node.delay_us is None and group.node.port == port]
        if of_port:
            us = total(group.nodes for group in of_port) * uncertainty_us
            yield Doubt(of_port[0].key("delay_us"), f"delay of {port} devices", device_us(us))
    measured = [group for group in network.groups if group.node.delay_us is not None]
    if measured:
        us = square_root(total(group.nodes for group in measured)) * c.MEASURED_DELAY_UNCERTAINTY_US
        yield Doubt(measured[0].key("delay_us"), "step of the clocks that measured delays", device_us(us))
