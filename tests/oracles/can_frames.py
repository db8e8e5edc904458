"""Frames of CAN and CAN FD, bit by bit. It imports nothing of busplan.

The lengths of classical frames are those of can-utils' canframelen (exact) and those that hardware has counted:
tests/buses/can/test_frames.py holds them. No tool is known that counts the stuff bits of an FD frame.
"""

from functools import cache

NEVER_STUFFED = 13
CRC_15 = 0x4599


def crc_15(bits: list[int]) -> list[int]:
    """The CRC of classical CAN over some bits."""
    register = 0
    for bit in bits:
        register = (register << 1 ^ (CRC_15 if bit ^ (register >> 14) else 0)) & 0x7FFF
    return binary(register, 15)


def binary(number: int, width: int) -> list[int]:
    """Bits of a number, the most significant first."""
    return [number >> place & 1 for place in reversed(range(width))]


def before_stuffing(identifier: int, data: bytes, *, identifier_bits: int) -> list[int]:
    """Start of frame, arbitration, control, data and CRC (CAN 2.0, 3.1.1)."""
    if identifier_bits == 11:
        header = [0, *binary(identifier, 11), 0, 0, 0]  # RTR, IDE, r0
    else:
        lower = binary(identifier & 0x3FFFF, 18)
        header = [0, *binary(identifier >> 18, 11), 1, 1, *lower, 0, 0, 0]  # SRR, IDE; RTR, r1, r0
    bits = [*header, *binary(len(data), 4), *(bit for byte in data for bit in binary(byte, 8))]
    return [*bits, *crc_15(bits)]


def stuffed(bits: list[int]) -> list[int]:
    """The bits with one of the other value behind each five alike, stuff bits counted among them."""
    found: list[int] = []
    run = 0
    for bit in bits:
        run = run + 1 if found and found[-1] == bit else 1
        found.append(bit)
        if run == 5:
            found.append(1 - bit)
            run = 1
    return found


def written_bits(identifier: int, data: bytes, *, identifier_bits: int) -> int:
    """Length of that very frame, interframe space included."""
    return len(stuffed(before_stuffing(identifier, data, identifier_bits=identifier_bits))) + NEVER_STUFFED


CRC_17, CRC_21 = (17, 0x1685B), (21, 0x102899)
"""Width and polynomial of the checks of CAN FD (ISO 11898-1:2015)."""
DLC_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
FD_NEVER_STUFFED = 12
"""Acknowledge and its delimiter, end of frame, space of 3 bits."""


def crc_fd(bits: list[int], width: int, polynomial: int) -> list[int]:
    """The CRC of CAN FD over some bits: it begins with a 1 and zeros."""
    register, mask = 1 << (width - 1), (1 << width) - 1
    for bit in bits:
        register = (register << 1 ^ (polynomial if bit ^ (register >> (width - 1)) else 0)) & mask
    return binary(register, width)


def fd_header(identifier: int, *, identifier_bits: int, is_switched: bool = True) -> list[int]:
    """Start of frame to BRS, the bit that switches the bit rate."""
    if identifier_bits == 11:
        return [0, *binary(identifier, 11), 0, 0, 1, 0, int(is_switched)]  # RRS, IDE, FDF, res, BRS
    upper, lower = binary(identifier >> 18, 11), binary(identifier & 0x3FFFF, 18)
    return [0, *upper, 1, 1, *lower, 0, 1, 0, int(is_switched)]  # SRR, IDE; RRS, FDF, res, BRS


def fd_body(data: bytes, *, is_passive: bool) -> list[int]:
    """ESI, DLC and data."""
    return [
        int(is_passive),
        *binary(DLC_LENGTHS.index(len(data)), 4),
        *(bit for byte in data for bit in binary(byte, 8)),
    ]


def fd_stuffed(header: list[int], body: list[int]) -> tuple[list[int], list[int]]:
    """Both parts with stuff bits: that behind the header has the new rate; behind the body is the fixed one alone."""
    parts: tuple[list[int], list[int]] = ([], [])
    last, run = -1, 0
    bits = [*header, *body]
    for place, bit in enumerate(bits):
        run = run + 1 if bit == last else 1
        parts[place >= len(header)].append(bit)
        last = bit
        if run == 5 and place < len(bits) - 1:
            last, run = 1 - bit, 1
            parts[place >= len(header) - 1].append(last)
    return parts


def fd_written(
    identifier: int, data: bytes, *, identifier_bits: int, is_passive: bool = False, is_switched: bool = True
) -> tuple[list[int], list[int]]:
    """Bits of that very frame at both rates, from the start of frame to the CRC."""
    header = fd_header(identifier, identifier_bits=identifier_bits, is_switched=is_switched)
    body = fd_body(data, is_passive=is_passive)
    nominal, fast = fd_stuffed(header, body)
    count = (len(nominal) + len(fast) - len(header) - len(body)) % 8
    gray = binary(count ^ count >> 1, 3)
    tail = [*gray, sum(gray) % 2]
    tail += crc_fd([*nominal, *fast, *tail], *(CRC_21 if len(data) > 16 else CRC_17))
    for place, bit in enumerate(tail):
        if place % 4 == 0:
            fast.append(1 - fast[-1])
        fast.append(bit)
    return nominal, fast


def fd_written_bits(
    identifier: int, data: bytes, *, identifier_bits: int, is_passive: bool = False, is_switched: bool = True
) -> tuple[int, int]:
    """Length of that very frame at both rates, interframe space included; without a switch all at the nominal one."""
    nominal, fast = fd_written(
        identifier, data, identifier_bits=identifier_bits, is_passive=is_passive, is_switched=is_switched
    )
    both = len(nominal) + FD_NEVER_STUFFED, len(fast) + 1
    return both if is_switched else (sum(both), 0)


STUFF_STEP = 4
"""Bits from one stuff bit to the next where they come closest: a stuff bit counts among the next five alike."""


@cache
def most_bits(size: int, *, identifier_bits: int) -> int:
    """Most bits of any frame with so much data, interframe space included."""
    open_to_stuffing = len(before_stuffing(0, bytes(size), identifier_bits=identifier_bits))
    stuff_bits = len(range(5, open_to_stuffing + 1, STUFF_STEP))
    return open_to_stuffing + stuff_bits + NEVER_STUFFED


@cache
def fd_most_bits(size: int, *, identifier_bits: int) -> tuple[int, int]:
    """Most bits at each rate of any FD frame with so much data, each part by itself; interframe space included."""
    padded = next(length for length in DLC_LENGTHS if length >= size)
    header = len(fd_header(0, identifier_bits=identifier_bits))
    body = len(fd_body(bytes(padded), is_passive=False))
    # The stuff bit behind the last bit of the header has the rate of the body, and none comes behind the body's last.
    stuff_bits = len(range(5, header, STUFF_STEP)), len(range(0, body, STUFF_STEP))
    tail = 4 + (CRC_21 if padded > 16 else CRC_17)[0]
    fixed = len(range(0, tail, STUFF_STEP))
    return header + stuff_bits[0] + FD_NEVER_STUFFED, body + stuff_bits[1] + tail + fixed + 1


def most_us(size: int, *, identifier_bits: int = 11, bit_rate: float, data_bit_rate: float = 0) -> float:
    """Longest time of a frame at bit rates in kbit/s, of CAN FD with a data bit rate [us]."""
    if not data_bit_rate:
        return most_bits(size, identifier_bits=identifier_bits) * 1000 / bit_rate
    nominal, fast = fd_most_bits(size, identifier_bits=identifier_bits)
    return nominal * 1000 / bit_rate + fast * 1000 / data_bit_rate
