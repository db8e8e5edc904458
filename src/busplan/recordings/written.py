"""Writer of recordings that no recorder made: pcapng and candump's text, each marked as synthetic."""

from collections.abc import Iterable, Mapping
from struct import pack
from typing import Final

SYNTHETIC: Final = "synthetic"
"""Name of the interface in an emulated recording, and the first word of its comment.

In a CAN log the name is the mark: readers of candump's text, python-can among them, accept no comment, but any name in
each line.
"""
SYNTHETIC_PORT: Final = bytes.fromhex("00005e005301")
"""Source of the frames of an emulated capture: an address for documentation, which no port has (RFC 7042)."""
_SECTION, _INTERFACE, _PACKET = 0x0A0D0D0A, 1, 6
_COMMENT, _NAME, _RESOLUTION = 1, 2, 9
"""Options: comment of any block, name of an interface, and tick of its stamps."""
_ORDER: Final = 0x1A2B3C4D
_NANOSECONDS: Final = 9
_LONGEST_PACKET: Final = 65535


def pcapng(packets: Iterable[tuple[int, bytes]], *, link: int, origin: str) -> bytes:
    """A pcapng file of one interface of some link type, from ascending stamps [ns] and contents.

    `origin` follows "synthetic: " in the comment of the section.

    References
    ----------
    IETF draft-ietf-opsawg-pcapng: opt_comment of a section, if_name and if_tsresol of an interface.
    """
    section = pack("<IHHq", _ORDER, 1, 0, -1) + _options({_COMMENT: f"{SYNTHETIC}: {origin}".encode()})
    options = _options({_NAME: SYNTHETIC.encode(), _RESOLUTION: bytes([_NANOSECONDS])})
    interface = pack("<HHI", link, 0, _LONGEST_PACKET) + options
    return b"".join((_block(_SECTION, section), _block(_INTERFACE, interface), *map(_packet, packets)))


def _options(options: Mapping[int, bytes]) -> bytes:
    parts = (pack("<HH", code, len(value)) + value + bytes(-len(value) % 4) for code, value in options.items())
    return b"".join((*parts, bytes(4)))


def _block(kind: int, body: bytes) -> bytes:
    size = pack("<I", len(body) + 12)
    return pack("<I", kind) + size + body + size


def _packet(packet: tuple[int, bytes]) -> bytes:
    time_ns, content = packet
    fields = pack("<IIIII", 0, time_ns >> 32, time_ns & 0xFFFFFFFF, len(content), len(content))
    return _block(_PACKET, fields + content + bytes(-len(content) % 4))


def candump(frames: Iterable[tuple[int, str]]) -> bytes:
    """Text of `candump -l`, from stamps [us] and frames in candump's form.

    Examples
    --------
    >>> candump([(2_000_007, "181#0011")]).decode().rstrip()
    '(0000000002.000007) synthetic 181#0011'
    """
    lines = (f"({us // 1_000_000:010}.{us % 1_000_000:06}) {SYNTHETIC} {frame}\n" for us, frame in frames)
    return "".join(lines).encode()
