"""Frame lengths against published figures, and against frames that are written bit by bit."""

from itertools import cycle, islice, pairwise, product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses.can.equations import fd_frame_bits, frame_bits, frame_us, payload_us
from tests.oracles.can_frames import (
    CRC_17,
    CRC_21,
    DLC_LENGTHS,
    FD_NEVER_STUFFED,
    NEVER_STUFFED,
    before_stuffing,
    crc_fd,
    fd_most_bits,
    fd_written,
    fd_written_bits,
    most_bits,
    stuffed,
    written_bits,
)

STUFFABLE = {11: 34, 29: 54}


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
            assert most_bits(size, identifier_bits=identifier_bits) == worst + 10 * size


@pytest.mark.parametrize("identifier_bits", [11, 29])
def test_the_most_bits_of_an_fd_frame_are_those_that_its_fields_can_have(identifier_bits: int) -> None:
    for size in range(65):
        assert fd_frame_bits(size, identifier_bits=identifier_bits, is_stuffed=True) == fd_most_bits(
            size, identifier_bits=identifier_bits
        )


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


@pytest.mark.parametrize(
    ("identifier_bits", "identifier", "data", "bits"),
    [
        (11, 0x7FF, "", 50),
        (11, 0x795, "0f", 56),
        (11, 0x7FF, "00ff", 69),
        (11, 0x691, "902f89", 75),
        (11, 0x000, "e07c0083", 88),
        (11, 0x1B7, "00ff0707ff", 93),
        (11, 0x000, "d9f73817118d", 100),
        (11, 0x365, "007cfff07c007c", 112),
        (11, 0x0F0, "0700f000830f1f07", 119),
        (29, 0x00000000, "", 74),
        (29, 0x114D4C7D, "ff", 78),
        (29, 0x00F0F0F0, "1f83", 88),
        (29, 0x1A1DB505, "ba97ae", 94),
        (29, 0x00000000, "ff7c7cf0", 110),
        (29, 0x0BEAAE40, "ff83ff7c00", 118),
        (29, 0x00F0F0F0, "dfb5b934157f", 122),
        (29, 0x15C5D62A, "8307e0f87cf8e0", 133),
        (29, 0x1FFFFFFF, "f00ff0ff7c1f83f8", 145),
    ],
)
def test_frames_have_as_many_bits_as_can_utils_counts(
    identifier_bits: int, identifier: int, data: str, bits: int
) -> None:
    # canframelen of can-utils 2020.11 and 2023.03, exact. Of 110,048 frames of all sizes, none had another length; its
    # lengths without stuff bits and in the worst case are those of Davis et al.
    assert written_bits(identifier, bytes.fromhex(data), identifier_bits=identifier_bits) == bits


FD_LONGEST = dict(zip(DLC_LENGTHS, (2, 3, 3, 2, 2, 3, 3, 2, 2, 3, 3, 2, 2, 3, 1, 2), strict=True))
"""By how many data bits the longest frame of a length falls short of the worst case."""


def longest_fd(size: int, *, identifier_bits: int) -> tuple[int, bytes, bool]:
    """Identifier, data and ESI of a frame with the most stuff bits, of all there are.

    What a bit adds rests on the run before it alone: of all beginnings with one run the best is kept.
    """
    header = "0xxxxxxxxxxx00101" if identifier_bits == 11 else "0xxxxxxxxxxx11xxxxxxxxxxxxxxxxxx0101"
    pattern = f"{header}x{DLC_LENGTHS.index(size):04b}{'x' * 8 * size}"
    best: dict[tuple[str, int], tuple[int, str]] = {("", 0): (0, "")}
    for place, said in enumerate(pattern):
        longer: dict[tuple[str, int], tuple[int, str]] = {}
        for (last, run), (count, before) in best.items():
            for bit in "01" if said == "x" else said:
                key = bit, run + 1 if bit == last else 1
                is_full = key[1] == 5 and place < len(pattern) - 1
                key = ("10"[int(bit)], 1) if is_full else key
                longer[key] = max(longer.get(key, (-1, "")), (count + is_full, before + bit))
        best = longer
    _, bits = max(best.values())
    identifier = bits[1:12] if identifier_bits == 11 else bits[1:12] + bits[14:32]
    body = bits[len(header) + 5 :]
    return int(identifier, 2), int(body or "0", 2).to_bytes(size, "big"), bits[len(header)] == "1"


@pytest.mark.parametrize("identifier_bits", [11, 29])
@pytest.mark.parametrize("size", DLC_LENGTHS)
def test_the_longest_fd_frames_come_near_the_worst_case(size: int, identifier_bits: int) -> None:
    identifier, data, is_passive = longest_fd(size, identifier_bits=identifier_bits)
    nominal, fast = fd_written_bits(identifier, data, identifier_bits=identifier_bits, is_passive=is_passive)
    worst = fd_frame_bits(size, identifier_bits=identifier_bits, is_stuffed=True)
    # No frame reaches it: FDF and BRS are 1 with a 0 between them, and the DLC is given.
    assert worst == (nominal + (identifier_bits == 29), fast + FD_LONGEST[size])


def test_the_longest_fd_frame_without_data_is_the_longest_of_all_of_them() -> None:
    lengths = [
        sum(fd_written_bits(identifier, b"", identifier_bits=11, is_passive=is_passive))
        for identifier, is_passive in product(range(1 << 11), (False, True))
    ]
    identifier, data, is_passive = longest_fd(0, identifier_bits=11)
    assert max(lengths) == sum(fd_written_bits(identifier, data, identifier_bits=11, is_passive=is_passive))


def test_the_worst_case_of_fd_is_that_of_the_worst_bits() -> None:
    for identifier_bits, opening in [(11, 17), (29, 36)]:
        for size in DLC_LENGTHS:
            least, most = (
                fd_frame_bits(size, identifier_bits=identifier_bits, is_stuffed=one) for one in (False, True)
            )
            worst = [0, *islice(cycle([0] * 4 + [1] * 4), opening - 1)]
            # A stuff bit behind its last bit has the data bit rate.
            assert len(stuffed(worst[:-1])) - (opening - 1) == most[0] - least[0]
            # The opening may end with four alike.
            body = [0] * 4 + [0, *islice(cycle([1] * 4 + [0] * 4), 4 + 8 * size)]
            assert len(stuffed(body)) - len(body) == most[1] - least[1]


@given(st.sampled_from([11, 29]), st.data(), st.sampled_from(DLC_LENGTHS), st.booleans())
def test_no_fd_frame_is_longer_than_the_worst_case(
    identifier_bits: int, draw: st.DataObject, size: int, is_passive: bool
) -> None:
    identifier = draw.draw(st.integers(0, 2**identifier_bits - 1))
    data = bytes(draw.draw(st.lists(st.sampled_from([0x00, 0xFF, 0x0F, 0x87, 0x55]), min_size=size, max_size=size)))
    actual = fd_written_bits(identifier, data, identifier_bits=identifier_bits, is_passive=is_passive)
    each = (fd_frame_bits(size, identifier_bits=identifier_bits, is_stuffed=one) for one in (False, True))
    for least, bits, most in zip(next(each), actual, next(each), strict=True):
        assert least <= bits <= most


@pytest.mark.parametrize(("size", "crc"), [(0, CRC_17), (16, CRC_17), (20, CRC_21), (64, CRC_21)])
def test_the_writer_of_fd_frames_keeps_the_rules(size: int, crc: tuple[int, int]) -> None:
    nominal, fast = fd_written(0x123, bytes(range(7, 7 + size)), identifier_bits=11)
    width, _ = crc
    fixed = 1 + (4 + width - 1) // 4
    tail = fast[-(4 + width + fixed) :]
    before = fast[: -len(tail)]
    # Fixed stuff bits differ from what they follow, and what they keep apart is the count and a CRC that divides.
    assert all(bit != last for last, bit in list(pairwise([before[-1], *tail]))[::5])
    count_and_crc = [bit for place, bit in enumerate(tail) if place % 5]
    assert len(count_and_crc) == 4 + width
    assert sum(count_and_crc[:4]) % 2 == 0
    assert not any(crc_fd([*nominal, *before, *count_and_crc], *crc))
    least = fd_frame_bits(size, identifier_bits=11, is_stuffed=False)
    assert len(nominal) + len(before) - 17 - 5 - 8 * size == len(nominal) + len(fast) + FD_NEVER_STUFFED + 1 - sum(
        least
    )


CAN_UTILS_FD = {
    0: ((46, 57), (64, 80), (23, 28)),
    1: ((54, 67), (72, 90), (31, 38)),
    2: ((62, 77), (80, 100), (39, 48)),
    3: ((70, 87), (88, 110), (47, 58)),
    4: ((78, 97), (96, 120), (55, 68)),
    5: ((86, 107), (104, 130), (63, 78)),
    6: ((94, 117), (112, 140), (71, 88)),
    7: ((102, 127), (120, 150), (79, 98)),
    8: ((110, 137), (128, 160), (87, 108)),
    12: ((142, 177), (160, 200), (119, 148)),
    16: ((178, 222), (196, 245), (155, 193)),
    20: ((210, 262), (228, 285), (187, 233)),
    24: ((242, 302), (260, 325), (219, 273)),
    32: ((306, 382), (324, 405), (283, 353)),
    48: ((434, 542), (452, 565), (411, 513)),
    64: ((562, 702), (580, 725), (539, 673)),
}
"""What canframelen of can-utils 2023.03 said for each length, without stuff bits and in the worst case: bits of a frame
at both rates with 11 and with 29 bits of identifier, and those at the data bit rate. Its file is that of 2021.08 to
2025.01. It has no exact count of FD frames."""


@pytest.mark.parametrize(("place", "identifier_bits"), [(0, 11), (1, 29)])
@pytest.mark.parametrize("size", DLC_LENGTHS)
def test_fd_lengths_of_can_utils_fall_short_by_what_it_leaves_out(size: int, place: int, identifier_bits: int) -> None:
    said = CAN_UTILS_FD[size]
    both, worst = said[place]
    nominal, fast = fd_frame_bits(size, identifier_bits=identifier_bits, is_stuffed=False)
    # ISO 11898-1:2015, 10.4.2.6 and 10.5: a stuff count of 4 bits, and a fixed stuff bit before it and behind each four
    # bits. The CRC has 17 bits up to 16 bytes; can-utils takes 21 from 16 on.
    missing = 4 + (7 if size > 16 else 6) - (4 if size == 16 else 0)
    assert fast - said[-1][0] == missing
    # In all it leaves out ESI, DLC, one of BRS and the delimiter of the CRC, and with 29 bits of identifier SRR.
    assert nominal + fast - both == missing + 1 + 4 + 1 + (identifier_bits == 29)
    # Its worst case is 5 / 4 of that. Some frame is longer.
    identifier, data, is_passive = longest_fd(size, identifier_bits=identifier_bits)
    longest = sum(fd_written_bits(identifier, data, identifier_bits=identifier_bits, is_passive=is_passive))
    assert worst < longest <= sum(fd_frame_bits(size, identifier_bits=identifier_bits, is_stuffed=True))


@pytest.mark.parametrize(("identifier_bits", "header"), [(11, 22), (29, 41)])
@pytest.mark.parametrize("size", DLC_LENGTHS)
def test_fd_lengths_are_those_of_linux(size: int, identifier_bits: int, header: int) -> None:
    # Linux 6.5, include/linux/can/length.h: bits at both rates. Only header and data have stuff bits that vary.
    stuffable, others = header + 8 * size, (33 if size > 16 else 28) + 9 + 3
    least, most = (
        sum(fd_frame_bits(size, identifier_bits=identifier_bits, is_stuffed=is_stuffed)) for is_stuffed in (False, True)
    )
    assert (least, most) == (stuffable + others, stuffable + (stuffable - 1) // 4 + others)


@pytest.mark.parametrize(("size", "padded"), [(8, 8), (9, 12), (13, 16), (21, 24), (33, 48), (49, 64)])
def test_fd_data_is_padded_to_a_length_of_the_dlc(size: int, padded: int) -> None:
    short, long = (fd_frame_bits(one, identifier_bits=29, is_stuffed=True) for one in (size, padded))
    assert short == long


@pytest.mark.parametrize(("size", "us"), [(1, 32 + 45 / 5), (64, 32 + 680 / 5), (65, 32 + 680 / 5 + 32 + 45 / 5)])
def test_an_fd_payload_takes_frames_of_64_bytes(size: int, us: float) -> None:
    found = payload_us(
        size,
        frame_bytes=(64,),
        identifier_bits=11,
        bit_rate_kbit_s=1000,
        data_bit_rate_kbit_s=5000,
        is_stuffed=True,
    )
    assert found == pytest.approx(us)
