"""The frames of an EtherCAT cycle: datagrams, how they are packed, and units of their own."""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import accumulate, chain
from math import lcm
from typing import Final, NamedTuple

from busplan.buses.ethercat.equations import (
    CLOCK_BYTES,
    DATAGRAM_BYTES,
    DELAY_UNCERTAINTY_US,
    DELAY_US,
    HOUSEKEEPING_BYTES,
    LAYOUTS,
    MEASURED_DELAY_UNCERTAINTY_US,
    SHARED,
    SPLIT,
    STATE_CHECK_BYTES,
    UNNAMED,
    ProcessData,
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
    plain,
    pointwise,
    rounded_down,
    rounded_up,
    smaller,
    square_root,
    total,
    traced_with,
)
from busplan.errors import BusplanError


class Devices(NamedTuple):
    """Devices that are alike, side by side. The numbers may be of any sort."""

    number: Number
    """Number of devices [1]."""
    data_bytes: Number
    """Bytes of each in a frame [bytes]."""


class Packing(NamedTuple):
    """All frames of the process data. The numbers may be of any sort."""

    frames: Number
    """Number of frames [1]."""
    datagrams_bytes: Number
    """All their datagrams, headers and data [bytes]."""
    padding_bytes: Number
    """Filling of short frames [bytes]."""
    last_bytes: Number
    """Datagrams of the last frame [bytes]."""
    before_bytes: Number
    """Datagrams of the frame before it; 0 where there is none [bytes]."""


def pack(devices: Sequence[Devices], *, datagrams: int, first_bytes: Number) -> Packing:
    """Share out devices among frames.

    Parameters
    ----------
    devices
        Groups of devices in their order, at least one.
    datagrams
        Datagrams of process data in a frame that holds any: 1 of LRW, 2 of LRD and LWR [1].
    first_bytes
        A datagram of another sort that opens the first frame; 0 for none [bytes].

    Returns
    -------
    Packing
        A device that no frame has room for counts as a frame of its own: a limit is broken then.

    Examples
    --------
    >>> pack([Devices(1000, 4)], datagrams=1, first_bytes=0.0)
    Packing(frames=3, datagrams_bytes=4036.0, padding_bytes=0.0, last_bytes=1044.0, before_bytes=1496.0)
    """
    devices = [_with_data(group) for group in devices if not is_everywhere(group.data_bytes <= 0)] or [Devices(0, 1)]
    room = room_bytes(datagrams)
    headers = total([traced_with(DATAGRAM_BYTES, devices[0].number)] * datagrams)
    free: Number = 0.0
    frames: Number = 0
    present: Number = 0.0
    whole: Number = first_bytes
    padding: Number = 0.0
    before: Number = 0.0
    if not is_off(first_bytes):
        # The first device may have no room beside it, and then it goes alone.
        has_room = room - first_bytes - _first_bytes(devices) >= 0
        free = choose(has_room, room - first_bytes, 0.0)
        present = first_bytes + choose(has_room, headers, 0.0)
        whole = present
        frames = 1
    for group in devices:
        beside = smaller(group.number, rounded_down(free / group.data_bytes))
        behind = group.number - beside
        present, free = present + beside * group.data_bytes, free - beside * group.data_bytes
        each = larger(rounded_down(room / group.data_bytes), 1)
        new = rounded_up(behind / each)
        in_last = (behind - (larger(new, 1) - 1) * each) * group.data_bytes
        opens = behind > 0
        before = choose(opens, choose(new > 1, headers + each * group.data_bytes, present), before)
        padding = padding + choose(opens, padding_bytes(present), 0.0)
        present, free = choose(opens, headers + in_last, present), choose(opens, larger(room - in_last, 0.0), free)
        frames, whole = frames + new, whole + new * headers + group.number * group.data_bytes
    return Packing(frames, whole, padding + padding_bytes(present), present, before)


def _with_data(devices: Devices) -> Devices:
    """The same devices; where an array has couplers, which have no data and are in no frame, as none of a byte."""
    if is_everywhere(devices.data_bytes > 0):
        return devices
    number = choose(devices.data_bytes > 0, devices.number, 0)
    return Devices(number, larger(devices.data_bytes, 1))


def _first_bytes(devices: Sequence[Devices]) -> Number:
    """Data of the first device that is there: at points of an array the first groups may have none [bytes]."""
    first: Number = devices[-1].data_bytes
    for group in reversed(devices[:-1]):
        is_there = group.number > 0
        first = group.data_bytes if is_everywhere(is_there) else choose(is_there, group.data_bytes, first)
    return first


class Frames(NamedTuple):
    """Frames in sequence that hold as many devices of the same size, of plain numbers."""

    first: int
    """First device of the first of them, from 1."""
    devices: int
    """Devices in each; none where only the clocks' datagram had room."""
    datagrams_bytes: float
    """Datagrams of each [bytes]."""
    frames: int = 1
    """Number of frames [1]."""

    def each(self) -> Iterator[range]:
        """Devices of each frame."""
        for frame in range(self.frames):
            first = self.first + frame * self.devices
            yield range(first, first + self.devices)


def frames_of(devices: Sequence[Devices], *, datagrams: int, first_bytes: float) -> Iterator[Frames]:
    """The same frames in their order, of plain numbers; a few entries for each group, however many its devices.

    Parameters
    ----------
    devices, datagrams, first_bytes
        As `pack` takes them.
    """
    room, headers = room_bytes(datagrams), datagrams * float(DATAGRAM_BYTES)
    first, held, opened, filled = 1, 0, first_bytes, 0.0
    for group in devices:
        size, left = plain(group.data_bytes), int(plain(group.number))
        # Couplers have no data, and room in any frame.
        fitting = max(int((room - opened - filled) // size), 0 if held or opened else 1) if size else left
        beside = min(left, fitting)
        held, filled, left = held + beside, filled + beside * size, left - beside
        if left:
            yield Frames(first, held, opened + bool(filled) * headers + filled)
            first, each = first + held, max(int(room // size), 1)
            full = (left - 1) // each
            if full:
                yield Frames(first, each, headers + each * size, full)
            first, held, opened = first + full * each, left - full * each, 0.0
            filled = held * size
    if opened or filled:
        yield Frames(first, held, opened + bool(filled) * headers + filled)


MOST_CYCLES: Final = 1000
"""Longest common multiple of the rates that is looked through [1]."""


class Unit(NamedTuple):
    """The devices of a group, whose process data go in every n-th cycle; of plain numbers."""

    every: int
    """n [1]."""
    devices: int
    data_bytes: float
    """Bytes of each in a frame [bytes]."""


class UnitCycle(NamedTuple):
    """Cycles with the same units in them."""

    due: tuple[bool, ...]
    """Whether each unit goes."""
    numbers: tuple[int, ...]
    """Which of the common multiple, from 1."""
    wire_bytes: float
    """All frames of process data on the wire [bytes]."""
    last_bytes: float
    """Datagrams of the last frame [bytes]."""
    data_bytes: float
    """All process data [bytes]."""


def common_multiple(rates: Sequence[int]) -> int:
    """Cycles until all units meet again [1].

    Raises
    ------
    BusplanError
        More than are looked through.
    """
    cycles = lcm(*rates)
    if cycles > MOST_CYCLES:
        shown = ", ".join(map(str, sorted(set(rates))))
        raise BusplanError(f"rates of {shown} meet every {cycles} cycles; {MOST_CYCLES} are looked through at most")
    return cycles


def starts(units: Sequence[Unit], *, is_spread: bool) -> tuple[int, ...]:
    """First cycle of each unit, from 0.

    Spread, the faster unit is placed first, of one rate the larger, each where the fullest of its cycles has the fewest
    bytes so far. Together, all start in the first.

    Examples
    --------
    >>> starts([Unit(1, 8, 20), Unit(2, 4, 10), Unit(4, 1, 30), Unit(4, 2, 10)], is_spread=True)
    (0, 0, 1, 3)
    """
    found = [0] * len(units)
    cycles = common_multiple([unit.every for unit in units])
    filled = [0.0] * cycles
    sizes = [unit.devices * unit.data_bytes for unit in units]
    for place in sorted(range(len(units)), key=lambda place: (units[place].every, -sizes[place])):
        every = units[place].every
        if is_spread:
            found[place] = min(range(every), key=lambda start: max(filled[start::every]))
        for cycle in range(found[place], cycles, every):
            filled[cycle] += sizes[place]
    return tuple(found)


def unit_rates(units: Sequence[Unit], *, is_spread: bool) -> tuple[Rate, ...]:
    """The rate of each unit with its first cycle."""
    first = starts(units, is_spread=is_spread)
    return tuple(Rate(unit.every, start + 1) for unit, start in zip(units, first, strict=True))


@lru_cache(maxsize=1 << 12)
def unit_cycles(
    units: tuple[Unit, ...], *, is_spread: bool, datagrams: int, first_bytes: float
) -> tuple[UnitCycle, ...]:
    """The cycles of the common multiple that differ, the fullest first.

    Parameters
    ----------
    units
        In the order of the segment.
    is_spread
        Whether units at slower rates go in different cycles as evenly as possible; otherwise they meet.
    datagrams, first_bytes
        As `pack` takes them.

    Raises
    ------
    BusplanError
        The rates meet too seldom.
    """
    packed = []
    for due, numbers in numbers_by_due(unit_rates(units, is_spread=is_spread)).items():
        own = [Devices(unit.devices, unit.data_bytes * is_due) for unit, is_due in zip(units, due, strict=True)]
        frames = pack(own, datagrams=datagrams, first_bytes=first_bytes)
        wire_bytes = plain(
            frames.frames * overhead_bytes(frames.frames) + frames.datagrams_bytes + frames.padding_bytes
        )
        data_bytes = plain(sum(one.number * one.data_bytes for one in own))
        packed.append(UnitCycle(due, numbers, wire_bytes, plain(frames.last_bytes), data_bytes))
    return tuple(sorted(packed, key=lambda cycle: (-cycle.wire_bytes, -cycle.data_bytes)))


class Hop(NamedTuple):
    """Delay of a device and of the cable to it, there and back. The numbers may be of any sort."""

    nodes: Number
    device_us: Number
    cable_us: Number


class DevicesDoubt(NamedTuple):
    """Uncertainty of the delays of some devices. The number may be of any sort."""

    key: str
    """Dotted key that would say them better."""
    label: str
    one_way_us: Number
    """Standard uncertainty of all of them together, one way [us]."""


def layout(network: Network) -> ProcessData:
    """Layout of the process data: as the profile says, else as its master has it."""
    bus = network.profile.bus
    return bus.process_data or LAYOUTS[bus.master or UNNAMED]


def datagrams(network: Network) -> int:
    """Datagrams of process data in a frame: LRW, or LRD and LWR."""
    return 2 if layout(network) == SPLIT else 1


def data_bytes(group: Group, network: Network) -> Number:
    """Bytes of a device in a frame: the larger of input and output where they share bytes, else both [bytes]."""
    both = group.read_bytes, group.write_bytes
    size_bytes = larger(*both) if layout(network) == SHARED else total(both)
    return named(size_bytes, "device_bytes", f"d{group.name and f',{group.name}'}")


def devices(network: Network, *, beside: int | None = None) -> tuple[Devices, ...]:
    """All devices in their order, as the fullest cycle has them: a device that does not go in it has no data.

    Parameters
    ----------
    network
        The network.
    beside
        Place of a group: of the cycles in which it goes the fullest; of all without it.
    """
    each = _each(network)
    if not has_rates(network):
        return each
    numbers = _of_units(network, each)

    def due(place: int) -> Number:
        def plainly(*values: float) -> float:
            cycles = (cycle.due for cycle in _unit_cycles(network, values))
            return float(next(due for due in cycles if beside is None or due[beside])[place])

        return pointwise(plainly, *numbers, words="whether the group goes in the fullest cycle")

    return tuple(
        own._replace(data_bytes=choose(due(place) > 0, own.data_bytes, 0)) if group.is_slower else own
        for place, (own, group) in enumerate(zip(each, network.groups, strict=True))
    )


def devices_at(network: Network, number: int) -> tuple[Devices, ...]:
    """All devices in their order, as a cycle of the common multiple has them, from 1; of plain numbers."""
    return tuple(
        own if rate.is_due(number) else own._replace(data_bytes=0)
        for own, rate in zip(_each(network), rates(network), strict=True)
    )


def rates(network: Network) -> tuple[Rate, ...]:
    """The rate of each group with its first cycle; of plain numbers."""
    _, units = _units(map(plain, _of_units(network, _each(network))))
    return unit_rates(units, is_spread=network.profile.bus.units == "spread")


def has_rates(network: Network) -> bool:
    """Whether a group does not go in every cycle."""
    return any(group.is_slower for group in network.groups)


def mean_wire_bytes(network: Network, *, with_last: Number) -> Number:
    """Frames of process data of the mean cycle, with the last frame of each once more where that holds [bytes]."""

    def plainly(with_last: float, *numbers: float) -> float:
        cycles = _unit_cycles(network, numbers)
        each = []
        for cycle in cycles:
            # A cycle without process data may have no frame.
            last_bytes = plain(frame_bytes(cycle.last_bytes)) if with_last and cycle.last_bytes else 0.0
            each.append((len(cycle.numbers), cycle.wire_bytes + last_bytes))
        return sum(number * own_bytes for number, own_bytes in each) / sum(number for number, _ in each)

    words = "the mean over the common multiple of the rates"
    return pointwise(plainly, with_last, *_of_units(network, _each(network)), words=words)


def cycles_of(network: Network) -> tuple[UnitCycle, ...]:
    """The cycles of the common multiple that differ, the fullest first; of plain numbers."""
    return _unit_cycles(network, [plain(number) for number in _of_units(network, _each(network))])


def _each(network: Network) -> tuple[Devices, ...]:
    """All devices in their order, whatever their rate."""
    return tuple(Devices(group.nodes, data_bytes(group, network)) for group in network.groups)


def _of_units(network: Network, each: Sequence[Devices]) -> tuple[Number, ...]:
    """What the cycles of units rest on: the datagrams of the master; rate, devices and bytes of each group."""
    units = ((group.every, *own) for group, own in zip(network.groups, each, strict=True))
    return (housekeeping_bytes(network), *chain.from_iterable(units))


def _units(numbers: Iterable[float]) -> tuple[float, tuple[Unit, ...]]:
    """The datagrams of the master [bytes], and the units, of numbers as `_of_units` has them."""
    first_bytes, *each = numbers
    return first_bytes, tuple(
        Unit(int(rate), int(nodes), size) for rate, nodes, size in zip(each[::3], each[1::3], each[2::3], strict=True)
    )


def _unit_cycles(network: Network, numbers: Iterable[float]) -> tuple[UnitCycle, ...]:
    first_bytes, units = _units(numbers)
    return unit_cycles(
        units,
        is_spread=network.profile.bus.units == "spread",
        datagrams=datagrams(network),
        first_bytes=first_bytes,
    )


def housekeeping_bytes(network: Network) -> Number:
    """The datagrams that the master adds to the first frame, those of distributed clocks among them [bytes]."""
    bus = network.profile.bus
    if bus.housekeeping_bytes is not None:
        return total(datagram_bytes(traced_with(size, network.nodes)) for size in bus.housekeeping_bytes)
    tables = (HOUSEKEEPING_BYTES, CLOCK_BYTES) if bus.distributed_clocks else (HOUSEKEEPING_BYTES,)
    added = [
        traced_with(table[bus.master or UNNAMED], network.nodes) for table in tables if table[bus.master or UNNAMED]
    ]
    if bus.master in STATE_CHECK_BYTES:
        checks_bytes = network.nodes * STATE_CHECK_BYTES[bus.master]
        # Those of many devices fill frames of their own, whose headers count here.
        added += [checks_bytes, rounded_down(checks_bytes / room_bytes(0)) * overhead_bytes(network.nodes)]
    return total(added)


def packing(network: Network, each: Sequence[Devices]) -> Packing:
    """All frames of its process data, of all its devices."""
    packed = pack(each, datagrams=datagrams(network), first_bytes=housekeeping_bytes(network))
    return packed._replace(
        frames=named(packed.frames, "frames", "F"),
        datagrams_bytes=named(packed.datagrams_bytes, "datagrams_bytes", "G"),
        padding_bytes=named(packed.padding_bytes, "padding_bytes", "pad"),
    )


def frames(network: Network, each: Sequence[Devices]) -> tuple[Frames, ...]:
    """The same frames in their order, of plain numbers."""
    first_bytes = plain(housekeeping_bytes(network))
    return tuple(frames_of(each, datagrams=datagrams(network), first_bytes=first_bytes))


def hop(group: Group) -> Hop:
    """Delay of each device of a group, and of the cable to it."""
    node = group.node
    delay_us = traced_with(DELAY_US[node.port], group.nodes) if node.delay_us is None else node.delay_us
    return Hop(group.nodes, device_us(delay_us), cable_us(node.cable_m))


def devices_us(network: Network) -> Number:
    """Delay of all devices there and back [us]."""
    return total(step.nodes * step.device_us for step in map(hop, network.groups))


def devices_doubts(network: Network) -> Iterator[DevicesDoubt]:
    """Uncertainties of the delays: those of a port err together, measured delays each by itself."""
    for port, uncertainty_us in DELAY_UNCERTAINTY_US.items():
        own = [group for group in network.groups if group.node.delay_us is None and group.node.port == port]
        if own:
            nodes = total(group.nodes for group in own)
            yield DevicesDoubt(own[0].key("delay_us"), f"delay of {port} devices", nodes * uncertainty_us)
    own = [group for group in network.groups if group.node.delay_us is not None]
    if own:
        us = square_root(total(group.nodes for group in own)) * MEASURED_DELAY_UNCERTAINTY_US
        yield DevicesDoubt(own[0].key("delay_us"), "step of the clocks that measured delays", us)


def cables_us(network: Network) -> Number:
    """Delay of all cables there and back [us]."""
    return total(step.nodes * step.cable_us for step in map(hop, network.groups))


def process_us(network: Network, each: Sequence[Devices] | None = None) -> Number:
    """All frames of process data on the wire, of all its devices; without them of the fullest cycle [us]."""
    packed = packing(network, devices(network) if each is None else each)
    wire_bytes = packed.frames * overhead_bytes(packed.frames) + packed.datagrams_bytes + packed.padding_bytes
    return named(sending_us(wire_bytes), "sending_us", "sending")


def mailbox_us(network: Network) -> Number:
    """Frames of all mailbox polls, each with a frame of its own [us]."""
    bus = network.profile.bus
    polls: Number = bus.mailbox_polls
    return polls * mailbox_frame_us(network)


def mailbox_frame_us(network: Network) -> Number:
    """Frame of a mailbox poll [us]."""
    return sending_us(frame_bytes(datagram_bytes(network.profile.bus.mailbox_bytes)))


def arrival_us(network: Network, device: int) -> float:
    """When a device has its command, from the start of a cycle of plain numbers [us].

    It acts when the last byte of its frame has come: a check after the data says whether the frame is whole. The
    frames start as late as the master's jitter lets them.

    Parameters
    ----------
    network
        The network.
    device
        Number of the device, from 1.
    """
    sent_us = plain(network.profile.bus.master_us + network.profile.bus.master_jitter_us)
    ends = accumulate(int(plain(group.nodes)) for group in network.groups)
    own = next(place for place, end in enumerate(ends) if device <= end)
    for run in frames(network, devices(network, beside=own)):
        frame_us, before = plain(sending_us(frame_bytes(run.datagrams_bytes))), device - run.first
        if before < run.devices * run.frames:
            sent_us += (before // run.devices + 1) * frame_us
            break
        sent_us += run.frames * frame_us
    way_us, left = 0.0, device
    for step in map(hop, network.groups):
        passed = min(left, int(plain(step.nodes)))
        way_us += passed * plain(step.device_us + step.cable_us) / 2
        left -= passed
    return sent_us + way_us
