"""Bits of classical CAN frames on the wire, each with the stuff bits of its own data."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

CLASSICAL_BYTES: Final = 8
_CRC_15: Final = 0x4599
_CRC_BITS: Final = 15
_NEVER_STUFFED: Final = 13
"""Bits after the CRC: its delimiter, acknowledge, end of frame and interframe space [bits]."""
_RUN: Final = 5
"""Equal bits after which the opposite one is stuffed."""
_PIECE: Final = 50_000  # Frames whose stuff bits are counted at once.


def written_bits(
    identifiers: npt.NDArray[np.int64],
    extended: npt.NDArray[np.bool_],
    remote: npt.NDArray[np.bool_],
    sizes: npt.NDArray[np.int64],
    data: npt.NDArray[np.uint64],
) -> npt.NDArray[np.int64]:
    """Bits of n frames on the wire, each with its own stuff bits, interframe space included [bits].

    `extended` frames have 29-bit identifiers. `sizes` are DLC values 0..15; above 8 they mean 8 bytes. `data` has up to
    8 bytes of each frame, the first one in the highest bits.

    References
    ----------
    ISO 11898-1; CAN 2.0, 3.1.1 and the generator polynomial 0x4599.

    Examples
    --------
    >>> frame = np.array([0x14]), np.array([False]), np.array([False]), np.array([1]), np.array([1 << 56], np.uint64)
    >>> int(written_bits(*frame)[0])
    58
    """
    bits = np.zeros(len(identifiers), dtype=np.int64)
    sort = sizes * 4 + extended * 2 + remote
    for kind in np.unique(sort):
        places = np.flatnonzero(sort == kind)
        for first in range(0, len(places), _PIECE):
            piece = places[first : first + _PIECE]
            is_extended, is_remote, size = bool(kind & 2), bool(kind & 1), int(kind) // 4
            bits[piece] = _stuffed(
                _columns(identifiers[piece], data[piece], is_extended=is_extended, is_remote=is_remote, size=size)
            )
    return bits


def _columns(
    identifiers: npt.NDArray[np.int64],
    data: npt.NDArray[np.uint64],
    *,
    is_extended: bool,
    is_remote: bool,
    size: int,
) -> list[npt.NDArray[np.uint8]]:
    """Bits of frames of one kind from the start of frame to the data, as one array over all frames for each bit."""

    def constant(*bits: int) -> list[npt.NDArray[np.uint8]]:
        return [np.full(len(identifiers), bit, dtype=np.uint8) for bit in bits]

    def field(numbers: npt.NDArray[Any], width: int, *, above: int = 0) -> list[npt.NDArray[np.uint8]]:
        shifts = range(above + width - 1, above - 1, -1)
        return [(numbers >> numbers.dtype.type(shift) & numbers.dtype.type(1)).astype(np.uint8) for shift in shifts]

    data_bits = 0 if is_remote else 8 * min(size, CLASSICAL_BYTES)
    return [
        *constant(0),  # start of frame
        *field(identifiers, 11, above=18 if is_extended else 0),
        *(constant(1, 1) + field(identifiers, 18) if is_extended else ()),  # SRR, IDE
        *constant(is_remote, 0, 0, *(size >> bit & 1 for bit in (3, 2, 1, 0))),  # RTR, r1 or IDE, r0, DLC
        *field(data, data_bits, above=64 - data_bits),
    ]


def _stuffed(columns: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.int64]:
    """Lengths of frames with CRC, stuff bits and all bits after them [bits]."""
    register = np.zeros(len(columns[0]), dtype=np.int32)
    for bit in columns:
        register = (register << 1 & 0x7FFF) ^ (register >> 14 ^ bit) * _CRC_15
    crc = [(register >> bit & 1).astype(np.uint8) for bit in range(_CRC_BITS - 1, -1, -1)]
    last, run = np.full(len(register), 2, dtype=np.uint8), np.zeros(len(register), dtype=np.uint8)
    stuffed = np.zeros(len(register), dtype=np.int64)
    for bit in (*columns, *crc):
        run = np.where(bit == last, run + np.uint8(1), np.uint8(1))
        is_full = run == _RUN
        stuffed += is_full
        last = np.where(is_full, 1 - bit, bit).astype(np.uint8)
        run = np.where(is_full, np.uint8(1), run)
    return stuffed + len(columns) + _CRC_BITS + _NEVER_STUFFED
