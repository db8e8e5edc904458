"""EtherCAT frames of a capture: stamps, datagrams and working counters, as arrays."""

from collections.abc import Callable
from pathlib import Path
from struct import Struct
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.english import plural
from busplan.errors import BusplanError
from busplan.progress import Progress
from busplan.recordings.capture import CapturedPackets, CaptureNotes, Numbers, packets
from busplan.recordings.statistics import Events, Floats
from busplan.recordings.written import SYNTHETIC, SYNTHETIC_PORT

_TYPE: Final = 0x88A4
_VLAN: Final = (0x8100, 0x88A8)
_DATAGRAMS: Final = 1
"""Type in the EtherCAT header of a frame of datagrams."""
_DEVICES_BIT: Final = 0x02
"""Bit of the source address that devices set in a frame on its way back."""
LOGICAL: Final = {10: "LRD", 11: "LWR", 12: "LRW"}
COMMANDS: Final = {
    **LOGICAL,
    **dict(enumerate(("NOP", "APRD", "APWR", "APRW", "FPRD", "FPWR", "FPRW", "BRD", "BWR", "BRW"))),
    13: "ARMW",
    14: "FRMW",
}
_FIELD_BYTES: Final = 7
"""Bytes that describe a datagram: command + 1 (0 where there is no datagram), logical address, size."""
_OVERHEAD_BYTES: Final = 12  # Header of 10 bytes, and working counter of 2.
_APRD, _FPRD, _BRD, _BWR = 1, 4, 7, 8
_PORT_TIMES: Final = range(0x0900, 0x0910)
"""Registers of the receive times of ports 0 to 3, 4 bytes each (ETG.1000.4, distributed clocks)."""
_PORTS: Final = 4
_HEAD: Final = Struct("<BBHHH")
"""Head of a datagram: command, index, address of the device, register, and size with its flags."""


class Datagram(NamedTuple):
    """A datagram of a frame, without its index and working counter."""

    command: int
    address: int
    """Logical address; 0 for other commands."""
    data_bytes: int

    @property
    def is_logical(self) -> bool:
        """Whether the datagram has a logical address, as for process data or for the master's own reads."""
        return self.command in LOGICAL


class Latch(NamedTuple):
    """A broadcast write at which every device latches the receive times of its ports, and the times read after it."""

    devices: int
    """Number of devices that the write passed. Each adds 1 to its address."""
    ports_ns: dict[tuple[int, int], dict[int, int]]
    """Receive times of ports by number, modulo 2^32 [ns], by command and address of the read."""


class EthercatFrames(NamedTuple):
    """Frames of one master, n of them in the order of the file."""

    times_ns: Numbers
    returned: npt.NDArray[np.bool_]
    """Whether the frame had passed a device, which sets a bit of its source address."""
    layout: Numbers
    """Index in `layouts` of the frame's datagrams."""
    key: Numbers
    """Key of the datagrams with their indexes. A frame returns with the key with which it was sent."""
    counters: Numbers
    """Key of the working counters. Frames with the same counters have the same key."""
    layouts: tuple[tuple[Datagram, ...], ...]
    notes: CaptureNotes
    others: int
    """Number of packets that are not EtherCAT frames of datagrams."""
    cut: int
    """Number of EtherCAT frames that the recorder cut."""
    latches: tuple[Latch, ...]
    """Broadcast writes whose port receive times were read."""
    unlatched: int
    """Number of reads of port receive times without a broadcast write before."""
    numbers: npt.NDArray[np.int32]
    """Number of each frame's packet in the file, from 1."""

    def events(self, values: Floats, frames: Numbers) -> Events:
        """Events of some values, each of a frame by its index."""
        times_s = (self.times_ns[frames] - (self.notes.start_ns or 0)) / 1e9
        return Events(values, times_s, self.numbers[frames])


def read_ethercat(path: Path, *, progress: Progress) -> EthercatFrames:
    """Read the EtherCAT frames of a pcap or pcapng file.

    Progress is called with the bytes read and the size of the file [bytes]. BusplanError: the file cannot be read, has
    no EtherCAT frame, has frames of several masters, or does not tell sent frames from returned ones.
    """
    notes, reader = CaptureNotes(), _Reader()
    for piece in packets(path, notes, progress=progress):
        reader.read(piece)
    return reader.frames(path, notes)


class _Reader:
    """Frames of the pieces read so far."""

    def __init__(self) -> None:
        self._parts: list[tuple[npt.NDArray[np.generic], ...]] = []
        self._keys: dict[bytes, int] = {}
        self._layouts: dict[bytes, int] = {}
        self._layout_of_key: list[int] = []
        self._counters: dict[bytes, int] = {}
        self._masters: dict[int, int] = {}
        self._others = self._cut = self._unlatched = 0
        self._latches: list[Latch] = []

    def read(self, piece: CapturedPackets) -> None:
        """Read a piece."""
        content, ends = piece.content, piece.starts + piece.sizes
        # Zeros after the end let a header be read before it is known to be whole.
        content = np.concatenate((content, np.zeros(64, dtype=np.uint8)))
        at = piece.starts + 12
        kind = _word(content, at)
        for _ in range(2):
            tagged = np.isin(kind, _VLAN) & (at + 6 <= ends)
            at = at + 4 * tagged
            kind = _word(content, at)
        fits = (at + 4 <= ends) & (kind == _TYPE)
        fits[fits] &= content[at[fits] + 3] >> 4 == _DATAGRAMS
        self._others += int(np.count_nonzero(~fits))
        if not fits.any():
            return
        starts, at, ends, times = piece.starts[fits], at[fits] + 4, ends[fits], piece.times_ns[fits]
        numbers = piece.numbers[fits].astype(np.int32)
        whole, key_rows, counter_rows, on_port_times = _datagrams(content, at, ends)
        self._cut += int(np.count_nonzero(~whole))
        for frame, header in sorted(on_port_times):
            if whole[frame] and content[starts[frame] + 6] & _DEVICES_BIT:
                self._port_times(content[header:])
        starts, times, key_rows, counter_rows = starts[whole], times[whole], key_rows[whole], counter_rows[whole]
        numbers = numbers[whole]
        if not len(starts):
            return
        returned = content[starts + 6] & _DEVICES_BIT != 0
        keys = _row_numbers(key_rows, self._keys, self._new_key)
        counters = _row_numbers(counter_rows, self._counters, lambda _: None)
        self._count_masters(content, starts[~returned])
        self._parts.append((times, returned, keys.astype(np.int32), counters.astype(np.int32), numbers))

    def _count_masters(self, content: npt.NDArray[np.uint8], starts: Numbers) -> None:
        address = np.zeros(len(starts), dtype=np.int64)
        for byte in range(6):
            address = address << 8 | content[starts + 6 + byte]
        for value, count in zip(*np.unique(address, return_counts=True), strict=True):
            self._masters[int(value)] = self._masters.get(int(value), 0) + int(count)

    def _port_times(self, datagram: npt.NDArray[np.uint8]) -> None:
        """Read a returned datagram that reads or latches port receive times."""
        command, _, address, register, size = _HEAD.unpack(datagram[: _HEAD.size].tobytes())
        size &= 0x7FF
        if command == _BWR:
            if register == _PORT_TIMES.start:
                self._latches.append(Latch(address, {}))
            return
        content = datagram[10 : 12 + size].tobytes()
        if command not in (_APRD, _FPRD, _BRD) or content[size:] != b"\x01\0":
            return
        if not self._latches:
            self._unlatched += 1
            return
        times_ns = self._latches[-1].ports_ns.setdefault((command, address), {})
        for port in range(_PORTS):
            at = _PORT_TIMES[4 * port] - register
            if 0 <= at <= size - 4:
                times_ns[port] = int.from_bytes(content[at : at + 4], "little")

    def _new_key(self, key: bytes) -> None:
        """Record the layout of a new key: its datagrams without their indexes."""
        size = _FIELD_BYTES + 1
        key += bytes(-len(key) % size)
        layout = b"".join(key[at + 1 : at + size] for at in range(0, len(key), size))
        self._layout_of_key.append(self._layouts.setdefault(layout, len(self._layouts)))

    def frames(self, path: Path, notes: CaptureNotes) -> EthercatFrames:
        """Frames of all pieces."""
        if not self._parts:
            cut = f", {self._cut:,} of them cut: record whole packets" if self._cut else ""
            raise BusplanError(
                f"{path}: has no whole EtherCAT frame (type 0x88A4) among {notes.packets:,} Ethernet packets{cut}"
            )
        if not self._masters:
            raise BusplanError(
                f"{path}: all frames have a source address with the bit 0x02 of its first byte, which devices set in "
                "frames that return: sent and returned frames cannot be told apart; give the master's port an address "
                "without it, and record again"
            )
        if len(self._masters) > 1:
            named = ", ".join(
                f"{address.to_bytes(6, 'big').hex(':')} ({plural(count, 'frame')})"
                for address, count in self._masters.items()
            )
            raise BusplanError(
                f"{path}: has frames of {len(self._masters)} masters: {named}; keep the frames of one, as in Wireshark "
                "with the filter eth.src"
            )
        if int.from_bytes(SYNTHETIC_PORT) in self._masters:
            notes.synthetic = notes.synthetic or f"{SYNTHETIC} by the address of its port"
        times, returned, keys, counters, numbers = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        layouts = tuple(map(_datagrams_of, self._layouts))
        layout = np.array(self._layout_of_key, dtype=np.int64)[keys]
        return EthercatFrames(
            times,
            returned,
            layout,
            keys,
            counters,
            layouts,
            notes,
            self._others,
            self._cut,
            tuple(latch for latch in self._latches if latch.ports_ns),
            self._unlatched,
            numbers,
        )


def _word(content: npt.NDArray[np.uint8], at: Numbers) -> Numbers:
    return content[at].astype(np.int64) << 8 | content[at + 1]


def _datagrams(
    content: npt.NDArray[np.uint8], at: Numbers, ends: Numbers
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.uint8], npt.NDArray[np.uint8], list[tuple[int, int]]]:
    """Wholeness of each frame; index, command, address and size of its datagrams; and its working counters.

    The fourth result has frame and offset of each datagram on port receive times.
    """
    whole, walking = np.ones(len(at), dtype=np.bool_), np.ones(len(at), dtype=np.bool_)
    last = len(content) - 16
    keys, counters = [], []
    on_port_times: list[tuple[int, int]] = []
    while walking.any():
        header = np.minimum(at, last)
        command = content[header]
        size = content[header + 6].astype(np.int64) | (content[header + 7].astype(np.int64) & 7) << 8
        counter_at = at + size + 10
        fits = walking & (counter_at + 2 <= ends)
        whole &= fits | ~walking
        is_logical = fits & np.isin(command, tuple(LOGICAL))
        is_port_time = fits & ~is_logical & (content[header + 5] == _PORT_TIMES.start >> 8)
        is_port_time &= content[header + 4] < len(_PORT_TIMES)
        on_port_times += [(int(frame), int(header[frame])) for frame in np.flatnonzero(is_port_time)]
        key = np.zeros((len(at), _FIELD_BYTES + 1), dtype=np.uint8)
        key[:, 0] = content[header + 1]
        key[:, 1] = command + 1
        for byte in range(4):
            key[:, 2 + byte] = np.where(is_logical, content[header + 2 + byte], 0)
        key[:, 6], key[:, 7] = size & 255, size >> 8
        counter_at = np.minimum(counter_at, last)
        counter = np.stack((content[counter_at], content[counter_at + 1]), axis=1)
        key[~fits], counter[~fits] = 0, 0
        keys.append(key)
        counters.append(counter)
        walking = fits & (content[header + 7] & 0x80 != 0)
        at = at + size + _OVERHEAD_BYTES
    return whole, np.concatenate(keys, axis=1), np.concatenate(counters, axis=1), on_port_times


def _row_numbers(rows: npt.NDArray[Any], numbers: dict[bytes, int], on_new: Callable[[bytes], None]) -> Numbers:
    """Numbers of rows of bytes, of shape (n, width). Equal rows have the same number, and new rows get the next ones.

    `numbers`, by the bytes of a row, keeps them over all pieces of a file. `on_new` is called with each new row, in the
    order of the numbers.
    """
    flat = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.shape[1]))).ravel()
    unique, inverse = np.unique(flat, return_inverse=True)
    of_unique = np.empty(len(unique), dtype=np.int64)
    for index, row in enumerate(unique):
        content = row.tobytes().rstrip(b"\0")
        if content not in numbers:
            numbers[content] = len(numbers)
            on_new(content)
        of_unique[index] = numbers[content]
    return of_unique[inverse.ravel()]


def _datagrams_of(layout: bytes) -> tuple[Datagram, ...]:
    parts = (layout[at : at + _FIELD_BYTES] for at in range(0, len(layout), _FIELD_BYTES))
    return tuple(
        Datagram(part[0] - 1, int.from_bytes(part[1:5], "little"), int.from_bytes(part[5:7], "little"))
        for part in parts
    )
