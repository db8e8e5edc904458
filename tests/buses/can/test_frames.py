"""Frame lengths against published figures, and against frames that are written bit by bit."""

from itertools import cycle, islice

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses.can.equations import frame_bits, frame_us, payload_us

STUFFABLE = {11: 34, 29: 54}
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


def test_the_writer_writes_a_known_frame() -> None:
    # Identifier 0x14, one byte 0x01: its stuff bits by hand.
    bits = before_stuffing(0x14, b"\x01", identifier_bits=11)
    assert "".join(map(str, bits[:27])) == "000000010100000000100000001"
    assert "".join(map(str, stuffed(bits))).startswith("000001001010000010001000001001")


def test_lengths_are_the_published_ones() -> None:
    for identifier_bits, worst, plain in [(11, 55, 47), (29, 80, 67)]:
        for size in range(9):
            # Davis et al. 2007: 55 + 10 s and 80 + 10 s; 47 + 8 s and 67 + 8 s without stuff bits.
            assert frame_bits(size, identifier_bits=identifier_bits, is_stuffed=True) == worst + 10 * size
            assert frame_bits(size, identifier_bits=identifier_bits, is_stuffed=False) == plain + 8 * size


@pytest.mark.parametrize(("rate", "us"), [(1000, 135), (500, 270), (250, 540), (125, 1080)])
def test_times_of_a_full_frame_are_the_published_ones(rate: int, us: float) -> None:
    assert frame_us(8, identifier_bits=11, bit_rate_kbit_s=rate, is_stuffed=True) == us


@pytest.mark.parametrize(("size", "us"), [(1, 65), (8, 135), (9, 135 + 65), (16, 270), (20, 270 + 95), (32, 540)])
def test_a_payload_of_more_than_eight_bytes_takes_more_frames(size: int, us: float) -> None:
    assert payload_us(size, identifier_bits=11, bit_rate_kbit_s=1000, is_stuffed=True) == us


@given(st.sampled_from([11, 29]), st.data(), st.binary(max_size=8))
def test_no_frame_is_longer_than_the_worst_case(identifier_bits: int, draw: st.DataObject, data: bytes) -> None:
    identifier = draw.draw(st.integers(0, 2**identifier_bits - 1))
    actual = written_bits(identifier, data, identifier_bits=identifier_bits)
    least, most = (frame_bits(len(data), identifier_bits=identifier_bits, is_stuffed=one) for one in (False, True))
    assert least <= actual <= most


@pytest.mark.parametrize(
    ("identifier_bits", "identifier", "data", "stuff_bits"),
    [
        (11, 0x000, "", 6),
        (11, 0x078, "e1", 7),
        (11, 0x3E1, "0cfb", 8),
        (11, 0x3FF, "3d07c1f07fe07fe1", 18),
        (29, 0x1F0C13E1, "ff", 11),
        (29, 0x1FF70FFC, "34e007fdf003e1f0", 20),
    ],
)
def test_long_frames_that_a_search_found_come_near_the_worst_case(
    identifier_bits: int, identifier: int, data: str, stuff_bits: int
) -> None:
    # No real frame reaches it: the header's fixed bits and the CRC interrupt the worst pattern.
    size = len(data) // 2
    least, most = (frame_bits(size, identifier_bits=identifier_bits, is_stuffed=one) for one in (False, True))
    actual = written_bits(identifier, bytes.fromhex(data), identifier_bits=identifier_bits)
    assert actual == least + stuff_bits
    assert most - actual <= 9


def test_the_worst_case_is_that_of_the_worst_bits() -> None:
    for identifier_bits in [11, 29]:
        for size in range(9):
            # Five alike, then four of each value in turn: a stuff bit behind each.
            bits = [0, *islice(cycle([0] * 4 + [1] * 4), STUFFABLE[identifier_bits] + 8 * size - 1)]
            assert len(stuffed(bits)) + NEVER_STUFFED == frame_bits(
                size, identifier_bits=identifier_bits, is_stuffed=True
            )


@pytest.mark.parametrize(
    ("identifier", "data", "bits"),
    [
        (0x180, "6a00000000000000", 125),
        (0x221, "c24a058100001510", 117),
        (0x0F4, "8a1a0df213000007", 118),
        (0x6F8, "ff000cfe00000000", 124),
        (0x18EBFF00, "01a00fa6603bd140", 141),
        (0x18EBFF00, "021fde8025dfc02b", 140),
        (0x18EBFF00, "03e1004bffff3c0f", 146),
        (0x18EBFF00, "04004bffffffffff", 146),
    ],
)
def test_frames_have_as_many_bits_as_hardware_counted(identifier: int, data: str, bits: int) -> None:
    # python-can, test/data/logfile.asc and issue_1299.asc. One more frame there, 6F9 05 0C 00 .., has 124 and not 123.
    identifier_bits = 29 if identifier > 0x7FF else 11
    assert written_bits(identifier, bytes.fromhex(data), identifier_bits=identifier_bits) == bits
