"""Frames of CAN logs as arrays, each with its bits on the wire."""

import logging
import os
import re
import zlib
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from math import nan
from pathlib import Path
from struct import Struct
from typing import Any, BinaryIO, Final, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from busplan.english import first_of, plural
from busplan.errors import BusplanError
from busplan.extras import require_extra
from busplan.files import require_regular
from busplan.progress import Progress
from busplan.recordings.can_bits import CLASSICAL_BYTES, written_bits
from busplan.recordings.capture import SOCKETCAN, CaptureNotes, is_capture, packets
from busplan.recordings.statistics import Events, Floats
from busplan.recordings.written import SYNTHETIC

_EXTENDED, _REMOTE, _FD, _SWITCHED = 1, 2, 4, 8
_ROW: Final = Struct("<dIIQBB")
_ROW_FIELDS: Final = np.dtype(
    [
        ("stamp_s", "<f8"),
        ("number", "<u4"),
        ("identifier", "<u4"),
        ("data", "<u8"),
        ("dlc", "u1"),
        ("flags", "u1"),
    ]
)
"""Data type of a frame while a log is read."""
_ERROR_ROW: Final = Struct("<dI")
_ERROR_FIELDS: Final = np.dtype([("stamp_s", "<f8"), ("number", "<u4")])
"""Data type of an error frame while a log is read."""
_READERS: Final = {b"LOGG": "BLFReader", b"date": "ASCReader", b";": "TRCReader"}
"""Readers of python-can by the first bytes of a file. Any other text is read as candump's."""
_FORMATS: Final = "text of candump, Vector's ASC and BLF, PEAK's TRC, captures of SocketCAN"
_HEAD: Final = r"(?:\([ \t]*([^\s)]+)\)[ \t]+)?([^\s(]\S*)[ \t]+"
_LOGGED: Final = re.compile(
    _HEAD + r"([0-9A-Fa-f]+)#(?:#([0-9A-Fa-f]))?(?:((?:[0-9A-Fa-f]{2})*+)|[Rr](\d{0,2}))(?: [RT])?"
)
"""Line of `candump -l`: stamp, channel, identifier, flags of CAN FD, data, or size of a remote frame."""
_SHOWN: Final = re.compile(
    _HEAD + r"(?:[RT]X ([B-]) [E-] +)?([0-9A-F]{3}|[0-9A-F]{8}) +\[(\d{1,2})\] *"
    r"(?:((?:[0-9A-F]{2} ?)*+)|remote request)(?: *(?:'.*'|ERRORFRAME))?"
)
"""Line of candump's output on a terminal: stamp, channel, mark of a switched bit rate, identifier, size and data."""
_CLASSICAL_SIZE: Final = 1
"""Digits of a classical frame's size on a terminal; an FD frame has two."""
_BASE_DIGITS: Final = 3
"""Digits of an identifier with 11 bits; one with 29 and flags has 8."""
_PACKET: Final = Struct(">IBB2x")
"""SocketCAN's head of a frame: identifier with its flags, size, and flags of CAN FD."""
_ERROR_FLAG, _REMOTE_FLAG, _EXTENDED_FLAG = 1 << 29, 1 << 30, 1 << 31
_IDENTIFIER_BITS: Final = (1 << 29) - 1
_SWITCHED_FLAG, _FD_FLAG = 1, 4
_FD_PACKET_BYTES: Final = 72
_REPORT_EVERY: Final = 5000
"""Frames between two reports of progress."""
_LONG_BYTES: Final = (16, 20, 24, 32, 48, 64)
"""Bytes of the DLC values 10 to 15, as python-can gives `dlc`, even for classical frames, which have 8 bytes."""
_MOST_LINE_BYTES: Final = 4096
"""Longest line of a log of text; a frame has under 300 bytes."""
_MOST_FRAMES: Final = 2_000_000
"""Most frames of a log that are read, an hour of a busy bus: they bound the memory."""
_MOST_IDENTIFIERS: Final = 20_000
"""Most identifiers of a log, many times those of a machine: each has figures of its own, and they bound the memory."""
_MOST_CHANNELS: Final = 256
"""Most channels of a log."""
_SHOWN_CHANNELS: Final = 8
_SHOWN_NAME: Final = 40
_DAY_S: Final = 86_400.0
_LONGEST_S: Final = _DAY_S
"""Time from a frame to the next in an undamaged log, at most [s]."""
_END_S: Final = float(1 << 33)
"""First stamp that is damage, in the year 2242 [s]."""
_MOST_CONTAINER_BYTES: Final = 16_000_000
"""Largest data of a BLF container [bytes]; Vector's and python-can's have 131,072."""
_BLF_OBJECT: Final = Struct("<4s4xII")
"""Header of an object as python-can reads it: signature, size and kind."""
_BLF_METHOD: Final = Struct("<H14x")
_BLF_CONTAINER, _BLF_DEFLATED = 10, 2


class CanFrames(NamedTuple):
    """Frames of one channel, n of them in the order of the log."""

    start_s: float
    """Stamp of the first frame [s], since 1970 if the log says so."""
    times_us: Floats
    """Stamps after the first one [us]."""
    numbers: npt.NDArray[np.uint32]
    """Number of each frame among all of the log, from 1; of a capture that of the packet."""
    identifiers: npt.NDArray[np.int64]
    extended: npt.NDArray[np.bool_]
    sizes: npt.NDArray[np.int64]
    """Data bytes by the DLC; 8 for a DLC of 9 to 15 in a classical frame [bytes]."""
    data: npt.NDArray[np.uint64]
    """First 8 bytes of data, the first one in the highest bits; 0 where there are fewer."""
    bits: npt.NDArray[np.int64]
    """Bits on the wire, interframe space included; 0 for a CAN FD frame [bits]."""
    is_fd: npt.NDArray[np.bool_]
    """Whether the frame is one of CAN FD."""
    switched: npt.NDArray[np.bool_]
    """Whether its data are at the data bit rate (BRS)."""
    remote: int
    errors_us: Floats
    """Stamps of the error frames, which are not among the n (remote frames are), after the first frame [us].

    NaN for one without a stamp.
    """
    error_numbers: npt.NDArray[np.int64]
    """Number of each error frame, as those of frames."""
    broken: str
    """Reason why the log ends early; empty for a whole one."""
    lead_us: float = 0.0
    """Time from the first frame of the log, of any channel, to the first of these [us]."""
    synthetic: str = ""
    """Words of the log on its emulation; empty without them."""
    dropped: int | None = None
    """Frames that the recorder reports as dropped; None where the format does not count them."""

    @property
    def errors(self) -> int:
        """Number of error frames."""
        return len(self.errors_us)

    def events(self, values: Floats, frames: npt.NDArray[np.int64]) -> Events:
        """Events of some values, each of a frame by its index."""
        return Events(values, (self.times_us[frames] + self.lead_us) / 1e6, self.numbers[frames])

    def error_events(self) -> Events:
        """Error frames that have a stamp."""
        known = np.isfinite(self.errors_us)
        times_s = (self.errors_us[known] + self.lead_us) / 1e6
        return Events(np.ones(len(times_s)), times_s, self.error_numbers[known])


def read_can(path: Path, *, channel: str | None = None, progress: Progress) -> CanFrames:
    """Read a log of candump, ASC, BLF or TRC, or a capture of SocketCAN.

    `channel` names the one to read of several; progress is called with the bytes read and the size of the file [bytes].
    BusplanError: the file cannot be read, is of no known format or has no frame; it has frames of several channels and
    none is named, or none of the named one; or python-can is not installed.
    """
    require_regular(path)
    try:
        with path.open("rb") as file:
            head = file.read(4)
            size = os.fstat(file.fileno()).st_size
    except OSError as error:
        raise BusplanError(f"{path}: cannot be read: {error.strerror}") from None
    log = _Log(channel)
    if is_capture(head):
        try:
            log.read(_captured(path, log, progress), lambda: None)
        except _DamageError as error:
            log.broken = str(error)
        return log.frames(path)
    name = next((reader for start, reader in _READERS.items() if head.startswith(start)), None)
    if name is not None:
        require_extra("can", extra="import", option=str(path), module="can")
        # Hide python-can's warnings about skipped frames, which are then missing in the figures.
        logging.getLogger("can").addHandler(logging.NullHandler())
    try:
        with path.open("rb") as file:
            reader = _candump(path, file) if name is None else _python_can(name, file)
            log.read(enumerate(reader, start=1), lambda: progress(min(file.tell(), size), size))
    except _DamageError as error:
        log.broken = str(error)
    except BusplanError:
        raise
    except Exception as error:  # noqa: BLE001 - a damaged log fails in many ways
        log.broken = f"{type(error).__name__}: {error}"
    return log.frames(path)


class _Lines:
    """Lines of a log, none of them longer than a log's may be; python-can reads from it as from a file of text."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.read, self.close = file.read, file.close

    def write(self, _: str) -> int:
        """Nothing: python-can takes for a file what could be written."""
        return 0

    def __iter__(self) -> Iterator[str]:
        while content := self._file.readline(_MOST_LINE_BYTES):
            if len(content) == _MOST_LINE_BYTES:
                raise _DamageError(f"a line of {_MOST_LINE_BYTES:,} bytes or more")
            yield content.decode("utf-8", "replace")


class _Frame(NamedTuple):
    """A frame of a text or a capture, with the attributes of python-can's."""

    timestamp: float
    channel: str
    arbitration_id: int
    is_extended_id: bool
    is_remote_frame: bool
    is_error_frame: bool
    is_fd: bool
    bitrate_switch: bool
    dlc: int
    data: bytes


def _candump(path: Path, file: BinaryIO) -> Iterator[_Frame]:
    """Frames of a text of `candump -l`, or of what candump writes on a terminal."""
    last: _Frame | None = None
    for number, content in enumerate(_Lines(file), start=1):
        line = content.strip()
        if not line or line[0] == "#" or (content[0] == "\t" and last is not None and last.is_error_frame):
            # The last: `candump -e` writes in words what an error frame says.
            continue
        frame = _candump_frame(line)
        if frame is None and last is None:
            raise BusplanError(f"{path}: is not a CAN log in a known format: {_FORMATS}")
        if frame is None:
            raise _DamageError(f"line {number} is not a candump line: {line[:60]!r}")
        if line[0] != "(":
            raise _DamageError(f"line {number} has no time; record with `candump -l`")
        last = frame
        yield frame


def _candump_frame(line: str) -> _Frame | None:
    """Frame of a line, with a NaN for a stamp that is missing or no number; None of any other text."""
    data: str | None
    if match := _LOGGED.fullmatch(line):
        stamp, channel, identifier, flags, data, asked = match.groups()
        is_fd, is_switched = flags is not None, flags is not None and bool(int(flags, 16) & _SWITCHED_FLAG)
    elif match := _SHOWN.fullmatch(line):
        stamp, channel, switch, identifier, asked, data = match.groups()
        is_fd, is_switched = len(asked) > _CLASSICAL_SIZE, switch == "B"
    else:
        return None
    number, is_extended = int(identifier, 16), len(identifier) > _BASE_DIGITS
    content = bytes.fromhex(data or "")
    try:
        stamp_s = float(stamp or nan)
    except ValueError:
        stamp_s = nan
    return _Frame(
        stamp_s,
        channel,
        number & _IDENTIFIER_BITS,
        is_extended,
        data is None,
        is_extended and number & _ERROR_FLAG != 0,
        is_fd,
        is_switched,
        int(asked or 0) if data is None else len(content),
        content,
    )


def _captured(path: Path, log: "_Log", progress: Progress) -> Iterator[tuple[int, _Frame]]:
    """Frames of a SocketCAN capture, each with the number of its packet."""
    notes = CaptureNotes()
    for piece in packets(path, notes, link=SOCKETCAN, progress=progress):
        content = piece.content.tobytes()
        log.start_s = None if notes.start_ns is None else notes.start_ns / 1e9
        for start, size, stamp_ns, number in zip(*piece[1:], strict=True):
            if size < _PACKET.size:
                continue
            flagged, length, flags = _PACKET.unpack_from(content, start)
            is_extended = bool(flagged & _EXTENDED_FLAG)
            frame = _Frame(
                int(stamp_ns) / 1e9,
                "0",
                flagged & (_IDENTIFIER_BITS if is_extended else (1 << 11) - 1),
                is_extended,
                bool(flagged & _REMOTE_FLAG),
                bool(flagged & _ERROR_FLAG),
                bool(flags & _FD_FLAG) or size == _FD_PACKET_BYTES,
                bool(flags & _SWITCHED_FLAG),
                length,
                content[start + _PACKET.size : start + min(size, _PACKET.size + length)],
            )
            yield int(number), frame
        if len(notes.interfaces) > 1:
            raise BusplanError(f"{path}: has frames of {len(notes.interfaces)} interfaces; export those of one bus")
    log.synthetic = notes.synthetic
    log.dropped = notes.dropped if notes.interfaces else None
    if notes.broken_at is not None:
        log.broken = f"damaged at byte {notes.broken_at:,}"


class _DamageError(Exception):
    """Damage: something in a log that no bus sends, named by the text."""


def _python_can(reader: str, file: BinaryIO) -> Iterator[Any]:
    """Messages of a log by a reader of python-can."""
    import can  # noqa: PLC0415 - an extra

    if reader == "BLFReader":
        return iter(_bounded_blf()(file))
    return iter(getattr(can, reader)(cast("Any", _Lines(file))))


def _bounded_blf() -> Any:
    """BLF reader of python-can, with a bound on the inflated size of a container."""
    from can.io import blf  # noqa: PLC0415 - as above

    class Reader(blf.BLFReader):  # type: ignore[misc,unused-ignore]
        def __iter__(self) -> Generator[Any, None, None]:
            while head := self.file.read(_BLF_OBJECT.size):
                signature, size, kind = _BLF_OBJECT.unpack(head)
                if signature != b"LOBJ" or size < _BLF_OBJECT.size:
                    raise _DamageError("damaged data where an object of the log should begin")
                if size > _MOST_CONTAINER_BYTES:
                    raise _DamageError(f"an object of over {_MOST_CONTAINER_BYTES:,} bytes")
                content = self.file.read(size - _BLF_OBJECT.size)
                self.file.read(size % 4)
                if kind == _BLF_CONTAINER:
                    yield from self._parse_container(_inflated(content, held=len(self._tail)))

    return Reader


def _inflated(content: bytes, *, held: int) -> bytes:
    """Data of a container; with the `held` bytes of the one before they must not exceed the bound."""
    (method,), data = _BLF_METHOD.unpack_from(content), content[_BLF_METHOD.size :]
    if method == 0:
        return data
    if method != _BLF_DEFLATED:
        raise _DamageError(f"a container that is compressed by method {method}")
    most = max(_MOST_CONTAINER_BYTES - held, 0)
    # One byte more than allowed shows that there are more.
    data = zlib.decompressobj().decompress(data, most + 1)
    if len(data) > most:
        raise _DamageError(f"a container of over {_MOST_CONTAINER_BYTES:,} bytes")
    return data


class _Log:
    """Frames read so far."""

    def __init__(self, channel: str | None) -> None:
        self._channel = channel
        self._rows = bytearray()
        self._channels: Counter[object] = Counter()
        self._errors = bytearray()
        self.dropped: int | None = None
        self.start_s: float | None = None
        """Stamp of the first frame of any channel [s]."""
        self.broken = self.synthetic = ""

    def read(self, messages: Iterator[tuple[int, Any]], report: Callable[[], None]) -> None:
        """Store all messages, each given with its number."""
        last_s = None
        for number, message in messages:
            if not number % _REPORT_EVERY:
                with suppress(OSError, ValueError):
                    report()
            has_stamp = 0 <= message.timestamp < _END_S
            if self.start_s is None and has_stamp:
                self.start_s = message.timestamp
            if max(len(self._rows) // _ROW.size, len(self._errors) // _ERROR_ROW.size) >= _MOST_FRAMES:
                raise _DamageError(f"it has more than {_MOST_FRAMES:,} frames; give a part of it")
            is_other = self._channel not in (None, str(message.channel))
            if message.is_error_frame:
                if is_other and message.channel is not None:
                    continue
                self._errors += _ERROR_ROW.pack(message.timestamp if has_stamp else nan, number)
                continue
            _require_frame(message, last_s)
            last_s = message.timestamp
            self._channels[message.channel] += 1
            if len(self._channels) > _MOST_CHANNELS:
                raise _DamageError(f"over {_MOST_CHANNELS} channels")
            if is_other:
                continue
            is_fd = message.is_fd
            # CAN FD has no remote frames. One that a log marks so is a data frame whose data the log lost.
            is_remote = message.is_remote_frame and not is_fd
            is_switched = is_fd and message.bitrate_switch
            self._rows += _ROW.pack(
                last_s,
                number,
                message.arbitration_id,
                int.from_bytes(message.data[:CLASSICAL_BYTES].ljust(CLASSICAL_BYTES, b"\0"), "big"),
                message.dlc,
                message.is_extended_id * _EXTENDED | is_remote * _REMOTE | is_fd * _FD | is_switched * _SWITCHED,
            )

    def frames(self, path: Path) -> CanFrames:
        """All frames as arrays."""
        if not self._rows:
            why = f" ({self.broken})" if self.broken else ""
            number = len(self._errors) // _ERROR_ROW.size
            but = f" but {plural(number, 'error frame')}" if number else ""
            if self._channel is not None and self._channels:
                names = first_of([*map(_shown, self._channels)], _SHOWN_CHANNELS)
                raise BusplanError(f"{path}: channel {_shown(self._channel)}: no such channel; there are {names}")
            raise BusplanError(f"{path}: has no CAN frame{but}{why}")
        if len(self._channels) > 1 and self._channel is None:
            counts = self._channels.most_common()
            named = first_of(
                [f"{_shown(channel)} ({plural(count, 'frame')})" for channel, count in counts], _SHOWN_CHANNELS
            )
            raise BusplanError(
                f"{path}: has frames of {len(self._channels)} channels: {named}; --channel NAME reads one"
            )
        rows, errors = np.frombuffer(self._rows, _ROW_FIELDS), np.frombuffer(self._errors, _ERROR_FIELDS)
        stamps, flags = rows["stamp_s"], rows["flags"]
        if (count := len(np.unique(rows["identifier"]))) > _MOST_IDENTIFIERS:
            raise BusplanError(f"{path}: has {count:,} identifiers; of a log at most {_MOST_IDENTIFIERS:,} are read")
        identifiers, sizes = rows["identifier"].astype(np.int64), rows["dlc"].astype(np.int64)
        codes = np.where(sizes < _LONG_BYTES[0], sizes, 10 + np.searchsorted(_LONG_BYTES[:-1], sizes))
        extended, remote, fd, switched = (flags & flag != 0 for flag in (_EXTENDED, _REMOTE, _FD, _SWITCHED))
        return CanFrames(
            float(stamps[0]),
            (stamps - stamps[0]) * 1e6,
            rows["number"].copy(),
            identifiers,
            extended,
            np.where(fd, sizes, np.minimum(sizes, CLASSICAL_BYTES)),
            rows["data"].copy(),
            np.where(fd, 0, written_bits(identifiers, extended, remote, codes, rows["data"])),
            fd,
            switched,
            int(np.count_nonzero(remote)),
            (errors["stamp_s"] - stamps[0]) * 1e6,
            errors["number"].astype(np.int64),
            self.broken,
            float(stamps[0] - (stamps[0] if self.start_s is None else self.start_s)) * 1e6,
            self.synthetic or f"{SYNTHETIC} by the name of its channel" * (SYNTHETIC in self._channels),
            self.dropped,
        )


def _shown(channel: object) -> str:
    """Name of a channel, shortened."""
    name = str(channel)
    return name if len(name) <= _SHOWN_NAME else f"{name[:_SHOWN_NAME]}..."


def _require_frame(message: Any, before_s: float | None) -> None:
    """Raise for a message that cannot be a frame, before any of it is stored."""
    stamp_s, identifier = message.timestamp, message.arbitration_id
    if not 0 <= stamp_s < _END_S:  # NaN is refused, too.
        raise _DamageError(f"a stamp of {stamp_s:g} s")
    if before_s is not None and stamp_s - before_s > _LONGEST_S:
        raise _DamageError(f"a stamp {(stamp_s - before_s) / _DAY_S:,.1f} days after the one before")
    bits = 29 if message.is_extended_id else 11
    if not 0 <= identifier < 1 << bits:
        raise _DamageError(f"an identifier of {identifier:#x}, which has no room in {bits} bits")
    if not 0 <= message.dlc <= _LONG_BYTES[-1] or len(message.data) > _LONG_BYTES[-1]:
        raise _DamageError(f"data of {max(message.dlc, len(message.data))} bytes")
