"""Packets of pcap and pcapng files, in pieces, with exact stamps.

Libraries such as dpkt give stamps of pcapng as floats, whose steps are 240 ns by now, more than the jitter of a good
master. So the few fields of a record are read here.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct
from typing import BinaryIO, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.english import printable
from busplan.errors import BusplanError
from busplan.files import require_regular
from busplan.progress import Progress
from busplan.recordings.written import SYNTHETIC

Numbers = npt.NDArray[np.int64]
_PIECE_BYTES: Final = 4_000_000
_MOST_RECORD_BYTES: Final = 1_000_000
"""Longest undamaged record [bytes]; a packet has 262,144 at most."""
ETHERNET, SOCKETCAN = 1, 227
_LINKS: Final = {ETHERNET: "Ethernet", SOCKETCAN: "SocketCAN"}
"""Names of link types."""
_NS: Final = 1_000_000_000
_END_NS: Final = (1 << 33) * _NS
"""First stamp that is damage, in the year 2242 [ns]."""
_LONGEST_NS: Final = 86_400 * _NS
"""Time from one packet to the next in an undamaged file, at most: a day [ns]."""
_PCAP: Final = {
    b"\xd4\xc3\xb2\xa1": ("<", 1000),
    b"\xa1\xb2\xc3\xd4": (">", 1000),
    b"\x4d\x3c\xb2\xa1": ("<", 1),
    b"\xa1\xb2\x3c\x4d": (">", 1),
}
"""Byte order, and duration of a tick [ns], by the first bytes of a pcap file."""
_SECTION: Final = b"\x0a\x0d\x0d\x0a"
_ORDER: Final = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_INTERFACE, _OLD_PACKET, _SIMPLE_PACKET, _STATISTICS, _PACKET = 1, 2, 3, 5, 6
_COMMENT, _RESOLUTION, _OFFSET = 1, 9, 14
"""Options: comment of a section; tick of an interface's stamps, and seconds to add to them."""
_DROPPED: Final = {_PACKET: (4,), _STATISTICS: (5, 7)}
"""Options of a block that count dropped packets: before a packet; by the interface, and by the operating system."""
_MOST_WORDS: Final = 200
"""Bytes of a comment that are read."""
_NOT_COUNTED: Final = 0xFFFF
"""Value of an old packet block that did not count dropped packets."""


class CapturedPackets(NamedTuple):
    """Packets of a capture, in the order of the file."""

    content: npt.NDArray[np.uint8]
    starts: Numbers
    """Offset of each packet in `content`."""
    sizes: Numbers
    """Recorded size of each packet [bytes]."""
    times_ns: Numbers
    """Stamps since 1970 [ns]."""
    numbers: Numbers
    """Number of each packet in the file, from 1, as Wireshark counts: those that are left out have one, too."""


@dataclass
class CaptureNotes:
    """Facts on a capture besides its packets: counts, marks and damage."""

    packets: int = 0
    start_ns: int | None = None
    """Stamp of the first packet of the link type [ns]; None without one."""
    left_out: int = 0
    """Packets of interfaces of another link type, without a stamp, or with a damaged one."""
    dropped: int = 0
    """Packets that the recorder reports as dropped; a pcap file does not count them."""
    interfaces: set[int] = field(default_factory=set)
    """Interfaces with packets in a pcapng file, by number."""
    synthetic: str = ""
    """Words of the file's comment or frames on its emulation; empty for a recording of a machine."""
    broken_at: int | None = None
    """Offset of the damage in the file, from which nothing is read; None for a whole file."""
    is_long: bool = False
    """Whether the file has more packets than are read; `broken_at` is where the next begins."""


MOST_PACKETS: Final = 2_000_000
"""Most packets of a capture that are read, but for the rest of a piece: they bound the memory."""


def is_capture(head: bytes) -> bool:
    """Whether a file with these first four bytes is a pcap or a pcapng file."""
    return head[:4] in _PCAP or head[:4] == _SECTION


def packets(path: Path, notes: CaptureNotes, *, link: int = ETHERNET, progress: Progress) -> Iterator[CapturedPackets]:
    """Packets of one link type in a pcap or pcapng file, in pieces.

    Counts of packets left out go to the notes as the file is read; progress is called with the bytes read and the size
    of the file [bytes]. A file that cannot be read, or is of another format, raises BusplanError.
    """
    require_regular(path, or_written_pipe=True)
    try:
        with path.open("rb") as file:
            yield from _pieces(file, path, notes, link, progress)
    except OSError as error:
        raise BusplanError(f"{path}: cannot be read: {error.strerror}") from None


def _pieces(
    file: BinaryIO, path: Path, notes: CaptureNotes, link: int, progress: Progress
) -> Iterator[CapturedPackets]:
    """Packets of each piece of the file, up to its end or to the first damage."""
    total = path.stat().st_size
    head = file.read(24)
    walker: _Walker
    if head[:4] in _PCAP:
        walker, held, at = _Pcap(head, path, notes, link), b"", len(head)
    elif head[:4] == _SECTION:
        walker, held, at = _PcapNg(notes, link), head, 0
    else:
        raise BusplanError(f"{path}: is not a pcap or pcapng file")
    before: int | None = None
    while True:
        content = held + file.read(_PIECE_BYTES)
        rows, used = walker.walk(content)
        if rows:
            starts, sizes, times, numbers = np.array(rows, dtype=np.int64).T
            leaps = np.flatnonzero(np.diff(times, prepend=times[0] if before is None else before) > _LONGEST_NS)
            good = slice(leaps[0] if len(leaps) else None)
            notes.packets += len(starts[good])
            if len(starts[good]):
                whole = np.frombuffer(content, dtype=np.uint8)
                yield CapturedPackets(whole, starts[good], sizes[good], times[good], numbers[good])
            if len(leaps):
                notes.broken_at = at + int(starts[leaps[0]])
                return
            before = int(times[-1])
        at += used
        if notes.packets >= MOST_PACKETS:
            notes.broken_at, notes.is_long = at, True
            return
        is_last = len(content) - len(held) < _PIECE_BYTES
        held = content[used:]
        progress(min(at, total), total)
        if walker.is_broken or (is_last and held) or len(held) > _MOST_RECORD_BYTES:
            notes.broken_at = at
            return
        if is_last:
            return


class _Walker(ABC):
    """Reader of consecutive records."""

    is_broken = False
    """Whether a record is damaged, so that the next cannot be found."""

    def __init__(self, notes: CaptureNotes) -> None:
        self.notes = notes
        self._packets = 0

    def number(self, time_ns: int | None = None) -> int:
        """Number of the next packet, which may have a stamp [ns]."""
        self._packets += 1
        if self.notes.start_ns is None:
            self.notes.start_ns = time_ns
        return self._packets

    @abstractmethod
    def walk(self, content: bytes) -> tuple[list[tuple[int, int, int, int]], int]:
        """Offset, size, stamp and number of each whole packet, and the number of bytes used."""


class _Pcap(_Walker):
    def __init__(self, head: bytes, path: Path, notes: CaptureNotes, wanted: int) -> None:
        super().__init__(notes)
        order, self._tick_ns = _PCAP[head[:4]]
        if len(head) < 24:  # noqa: PLR2004 - the header of the file
            raise BusplanError(f"{path}: ends within the header of a pcap file")
        link = Struct(f"{order}I").unpack_from(head, 20)[0] & 0xFFFF
        if link != wanted:
            raise BusplanError(f"{path}: is a capture of link type {link}, expected {wanted}, {_LINKS[wanted]}")
        self._header = Struct(f"{order}IIII")

    def walk(self, content: bytes) -> tuple[list[tuple[int, int, int, int]], int]:
        rows, at, end = [], 0, len(content) - self._header.size
        while at <= end:
            seconds, ticks, size, _ = self._header.unpack_from(content, at)
            if size > _MOST_RECORD_BYTES:
                self.is_broken = True
                break
            if at + 16 + size > len(content):
                break
            time_ns = seconds * _NS + ticks * self._tick_ns
            rows.append((at + 16, size, time_ns, self.number(time_ns)))
            at += 16 + size
        return rows, at


class _Interface(NamedTuple):
    link: int
    ticks: int
    """Ticks of the stamps in a second."""
    offset_ns: int


class _PcapNg(_Walker):
    _order: str
    _head: Struct
    _fields: Struct
    """Structs in the section's byte order: head of a block (kind, size), and fields of a packet."""

    def __init__(self, notes: CaptureNotes, link: int) -> None:
        super().__init__(notes)
        self._link = link
        self._interfaces: list[_Interface] = []

    def walk(self, content: bytes) -> tuple[list[tuple[int, int, int, int]], int]:
        rows: list[tuple[int, int, int, int]] = []
        at = 0
        while at + 12 <= len(content):
            is_section = content[at : at + 4] == _SECTION
            if is_section:
                if content[at + 8 : at + 12] not in _ORDER:
                    self.is_broken = True
                    break
                self._order, self._interfaces = _ORDER[content[at + 8 : at + 12]], []
                self._head, self._fields = Struct(f"{self._order}II"), Struct(f"{self._order}IIII")
            kind, size = self._head.unpack_from(content, at)
            if size < 12 or size % 4 or size > _MOST_RECORD_BYTES:  # noqa: PLR2004 - the shortest block
                self.is_broken = True
                break
            if at + size > len(content):
                break
            if is_section:
                self._find_mark(content[at + 24 : at + size - 4])
            else:
                self._block(rows, kind, content, at, size)
            at += size
        return rows, at

    def _block(self, rows: list[tuple[int, int, int, int]], kind: int, content: bytes, at: int, size: int) -> None:
        end, notes = at + size - 4, self.notes
        if kind == _PACKET and size >= 32:  # noqa: PLR2004 - the fields of a packet
            number, high, low, kept = self._fields.unpack_from(content, at + 8)
            kept = min(kept, size - 32)
            self._packet(rows, number, high << 32 | low, at + 28, kept)
            options = at + 28 + (kept + 3) // 4 * 4
            if options < end:
                notes.dropped += self._dropped(content[options:end], _PACKET)
        elif kind == _OLD_PACKET and size >= 32:  # noqa: PLR2004 - its fields
            number, dropped, high, low, kept = Struct(f"{self._order}HHIII").unpack_from(content, at + 8)
            notes.dropped += dropped if dropped != _NOT_COUNTED else 0
            self._packet(rows, number, high << 32 | low, at + 28, min(kept, size - 32))
        elif kind == _SIMPLE_PACKET:
            self.number()
            notes.left_out += 1
        elif kind == _INTERFACE and size >= 20:  # noqa: PLR2004 - its fields
            self._interfaces.append(self._interface(content[at + 8 : end]))
        elif kind == _STATISTICS:
            # A block of statistics counts all drops of its interface so far, those already counted by packets included.
            notes.dropped = max(notes.dropped, self._dropped(content[at + 20 : end], _STATISTICS))

    def _packet(self, rows: list[tuple[int, int, int, int]], number: int, ticks: int, at: int, size: int) -> None:
        if number < len(self._interfaces):
            interface = self._interfaces[number]
            time_ns = ticks * _NS // interface.ticks + interface.offset_ns
            if interface.link == self._link and 0 <= time_ns < _END_NS:
                self.notes.interfaces.add(number)
                rows.append((at, size, time_ns, self.number(time_ns)))
                return
        self.number()
        self.notes.left_out += 1

    def _dropped(self, options: bytes, kind: int) -> int:
        """Number of dropped packets in the options of a block."""
        number = Struct(f"{self._order}Q")
        return sum(
            number.unpack(value)[0]
            for code, value in self._options(options)
            if code in _DROPPED[kind] and len(value) == number.size
        )

    def _find_mark(self, options: bytes) -> None:
        """Note the words of a section's comment on an emulated recording."""
        for code, value in self._options(options):
            text = printable(value[:_MOST_WORDS].decode("utf-8", "replace"))
            if code == _COMMENT and text.startswith(f"{SYNTHETIC}:"):
                self.notes.synthetic = text

    def _options(self, content: bytes) -> Iterator[tuple[int, bytes]]:
        """Code and value of each option."""
        field, at = Struct(f"{self._order}HH"), 0
        while at + 4 <= len(content):
            code, size = field.unpack_from(content, at)
            yield code, content[at + 4 : at + 4 + size]
            at += 4 + (size + 3) // 4 * 4

    def _interface(self, body: bytes) -> _Interface:
        (link,) = Struct(f"{self._order}H").unpack_from(body)
        ticks, offset_ns = 1_000_000, 0
        for code, value in self._options(body[8:]):
            if code == _RESOLUTION and value:
                ticks = 2 ** (value[0] & 0x7F) if value[0] & 0x80 else 10 ** min(value[0], 18)
            elif code == _OFFSET and len(value) == 8:  # noqa: PLR2004 - a number of 64 bits
                offset_ns = Struct(f"{self._order}q").unpack(value)[0] * _NS
        return _Interface(link, ticks, offset_ns)
