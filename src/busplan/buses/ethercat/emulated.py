"""Capture of a planned EtherCAT machine: its frames as they leave the master's port, and as they return."""

from collections.abc import Iterator, Sequence
from struct import pack
from typing import Final, NamedTuple

from busplan.buses.emulation import LEAST_SHARE, Emulation, Emulator, Fault
from busplan.buses.ethercat.equations import (
    SHARED,
    SPLIT,
    UNNAMED,
    c,
    frame_bytes,
    room_bytes,
    sending_us,
)
from busplan.buses.ethercat.frames import cables_us, data_bytes, devices_at, devices_us, frames, layout, rates
from busplan.buses.network import Network, hyperperiod
from busplan.recordings.capture import ETHERNET
from busplan.recordings.ethercat import COMMANDS, LOGICAL
from busplan.recordings.written import SYNTHETIC_PORT, pcapng

_CODES: Final = {name: code for code, name in COMMANDS.items()}
_STATE, _SYSTEM_TIME, _MAILBOX = 0x130 << 16, 0x910 << 16, 0x1080 << 16
"""Registers in the address of a datagram: state of a device, its system time, and a usual place of its mailbox."""
_OPERATIONAL: Final = 8
_IMAGE, _OUTPUTS = 0x10000, 0x800000
"""Logical address of the process image, and the bit that marks outputs alone (LWR) in it."""
_MAILBOXES: Final = 0x9000000
"""Logical address of the state of all mailboxes, as TwinCAT sets it."""
_STATION: Final = 0x1001
"""Station address of the first device."""
_AS_ACONTIS: Final = (("NOP", 0, 4), ("APWR", _SYSTEM_TIME, 4), ("BRD", _STATE, 2))
_OF_MASTER: Final = {
    "IgH": (("BRD", _STATE, 2),),
    "TwinCAT": (("NOP", 0, 4), ("BRD", _STATE, 2), ("LRD", _MAILBOXES, 1)),
    "acontis": _AS_ACONTIS,
    UNNAMED: _AS_ACONTIS,
}
"""Command, address and number of data bytes of each datagram that `HOUSEKEEPING_BYTES` counts, by master."""
_PORTS: Final = SYNTHETIC_PORT, bytes([SYNTHETIC_PORT[0] | 2]) + SYNTHETIC_PORT[1:]
"""Source address of a frame that is sent, and of one that has passed a device."""
_LEAST_PACKET: Final = 60

MISSING: Final = Fault("missing-cycle", "the master sends no frame", "cycles without a frame")
LOST: Final = Fault("lost-frame", "a frame does not return", "lost frames")
WRONG: Final = Fault("wrong-working-counter", "no device takes part in a frame", "wrong working counters")
JITTER: Final = Fault("jitter", "the master starts later than its planned jitter", "latest start", "us", 0.25)
FAULTS: Final = (MISSING, LOST, WRONG, JITTER)


class _Datagram(NamedTuple):
    command: str
    address: int
    size: int
    counter: int
    """Working counter when the datagram returns."""

    @property
    def is_logical(self) -> bool:
        return self.command in LOGICAL.values()


_Frame = tuple[_Datagram, ...]


def emulated(network: Network, emulation: Emulation) -> bytes:
    """Capture of a machine that keeps its plan except for the given faults.

    Cycles start evenly within the planned jitter. Frames follow each other, pass all devices and return. The host takes
    half to all of its planned time. Data are random. Stamps count from 0. The network has plain numbers; too many
    frames raise `BusplanError`.
    """
    numbers, polls = range(1, hyperperiod(rates(network)) + 1), int(network.profile.bus.mailbox_polls)
    cycles = [tuple(_cycle(network, number)) for number in numbers]
    filled = [any(entry.data_bytes for entry in devices_at(network, number)) for number in numbers]
    bytes_each = sum(frame_bytes(sum(map(_bytes, frame))) for frames in cycles for frame in frames) / len(cycles)
    emulation.require_few(
        2 * emulation.cycles * (sum(map(len, cycles)) / len(cycles) + polls),
        frames_bytes=2 * emulation.cycles * bytes_each,
    )
    due = [cycle for cycle in range(emulation.cycles - len(cycles)) if filled[cycle % len(cycles)]]
    packets = sorted(_packets(network, emulation, cycles, due), key=lambda packet: packet[0])
    return pcapng(packets, link=ETHERNET, origin=emulation.origin)


def _packets(
    network: Network, emulation: Emulation, cycles: Sequence[tuple[_Frame, ...]], due: Sequence[int]
) -> Iterator[tuple[int, bytes]]:
    """Stamps [ns] and packets, each as sent and then as returned; faults hit the last frame of a cycle that is due."""
    bus, random = network.profile.bus, emulation.random
    jitter_us, bias_us = bus.master_jitter_us, c.BYTE_BIAS_US
    nodes, way_us = int(network.nodes), devices_us(network) + cables_us(network)
    missing, lost, wrong, late = (emulation.drawn(fault, due) for fault in FAULTS)
    free_ns = 0.0
    for cycle in range(emulation.cycles):
        late_us = jitter_us + emulation.faults[JITTER.name] if cycle in late else random.random() * jitter_us
        back_us, of_cycle = way_us + random.uniform(LEAST_SHARE, 1) * bus.master_us, cycles[cycle % len(cycles)]
        # A start on a whole nanosecond, so that stamps lengthen no time.
        sent_ns: float = int(max(1000 * (cycle * network.period_us + late_us), free_ns))
        for number, frame in enumerate((*of_cycle, *_polls(network, cycle)) if cycle not in missing else (), start=1):
            data = [random.randbytes(part.size) if part.is_logical else b"" for part in frame]
            yield int(sent_ns), _packet(frame, data, cycle)
            sent_ns = free_ns = sent_ns + 1000 * sending_us(frame_bytes(sum(map(_bytes, frame))))
            back_us += bias_us * sum(part.size for part in frame if part.is_logical and part.address != _MAILBOXES)
            is_last = number == len(of_cycle)
            if not (is_last and cycle in lost):
                is_taken = not (is_last and cycle in wrong)
                yield int(sent_ns + 1000 * back_us), _packet(frame, data, cycle, passed=nodes, is_taken=is_taken)


def _bytes(part: _Datagram) -> int:
    return part.size + int(c.DATAGRAM_BYTES)


def _packet(frame: _Frame, data: Sequence[bytes], cycle: int, *, passed: int = 0, is_taken: bool = True) -> bytes:
    """A frame without its check sequence: as sent, or after it has passed some devices."""
    body = b""
    for place, (part, content) in enumerate(zip(frame, data, strict=True), start=1):
        address, state = part.address, _OPERATIONAL if passed and part.address & ~0xFFFF == _STATE else 0
        if part.command in ("APWR", "ARMW", "BRD"):
            address += passed  # Each device adds 1.
        size = part.size | (0x8000 if place < len(frame) else 0)
        body += pack("<BBIHH", _CODES[part.command], cycle % 256, address, size, 0)
        body += content or state.to_bytes(part.size, "little")
        body += pack("<H", part.counter if passed and is_taken else 0)
    head = b"\xff" * 6 + _PORTS[bool(passed)] + b"\x88\xa4" + pack("<H", len(body) | 0x1000)
    return (head + body).ljust(_LEAST_PACKET, b"\0")


def _cycle(network: Network, number: int) -> Iterator[_Frame]:
    """Frames of process data in cycle `number` of the hyperperiod, which counts from 1."""
    places: list[tuple[int, int, int]] = []  # Inputs, outputs and logical address of each device.
    address = _IMAGE
    for group, rate in zip(network.groups, rates(network), strict=True):
        both = int(group.read_bytes), int(group.write_bytes)
        for _ in range(int(group.nodes)):
            places.append((*(both if rate.is_due(number) else (0, 0)), address))
            address += int(data_bytes(group, network))
    parts = tuple(_own(network))
    for run in frames(network, devices_at(network, number)):
        for carried in run.by_frame():
            there = [places[device - 1] for device in carried if any(places[device - 1][:2])]
            yield from _fitting((*parts, *(_process(there, layout(network)) if there else ())))
            parts = ()


def _fitting(parts: _Frame) -> Iterator[_Frame]:
    """Frames filled with the datagrams; state checks of many devices fill frames of their own."""
    frame: _Frame = ()
    for part in parts:
        if frame and sum(map(_bytes, (*frame, part))) > room_bytes(0):
            yield frame
            frame = ()
        frame += (part,)
    yield frame


def _process(devices: Sequence[tuple[int, int, int]], layout_name: str) -> _Frame:
    """Datagrams of process data in a frame; `devices` has the inputs, outputs and address of each device."""
    reads, writes, (address, *_) = zip(*devices, strict=True)
    reading, writing = (sum(size > 0 for size in sizes) for sizes in (reads, writes))
    if layout_name == SPLIT:
        outputs = _Datagram("LWR", address | _OUTPUTS, sum(writes), writing)
        return _Datagram("LRD", address, sum(reads), reading), outputs
    size = sum(map(max, reads, writes)) if layout_name == SHARED else sum(reads) + sum(writes)
    # The working counter rises by 1 for a read of a device, by 2 for a write.
    return (_Datagram("LRW", address, size, reading + 2 * writing),)


def _own(network: Network) -> Iterator[_Datagram]:
    """Datagrams that the master adds to the first frame."""
    bus, nodes = network.profile.bus, int(network.nodes)
    master = bus.master or UNNAMED
    if bus.housekeeping_bytes is not None:
        yield from (_Datagram("NOP", 0, int(size), 0) for size in bus.housekeeping_bytes)
        return
    counters = {"NOP": 0, "APWR": 1}
    yield from (_Datagram(*part, counters.get(part[0], nodes)) for part in _OF_MASTER.get(master, ()))
    if bus.distributed_clocks:
        command, station = ("FRMW", _STATION) if master in ("SOEM", "IgH", "ethercrab") else ("ARMW", 0)
        yield _Datagram(command, _SYSTEM_TIME | station, int(c.by_key("CLOCK_BYTES")[master] - c.DATAGRAM_BYTES), nodes)
    if master in c.by_key("STATE_CHECK_BYTES"):
        size = int(c.by_key("STATE_CHECK_BYTES")[master] - c.DATAGRAM_BYTES)
        yield from (_Datagram("FPRD", _STATE | _STATION + node, size, 1) for node in range(nodes))


def _polls(network: Network, cycle: int) -> Iterator[_Frame]:
    """Mailbox polls of a cycle, of one device after the other; all are empty."""
    polls, size = (int(getattr(network.profile.bus, f"mailbox_{key}")) for key in ("polls", "bytes"))
    for poll in range(cycle * polls, (cycle + 1) * polls):
        yield (_Datagram("FPRD", _MAILBOX | _STATION + poll % int(network.nodes), size, 0),)


EMULATOR: Final = Emulator(FAULTS, (".pcapng",), lambda network: network.period_us, emulated)
