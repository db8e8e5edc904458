"""Length of the telegrams against telegrams that are written bit by bit."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses.sercos.sercos2 import PERIODS, start_us, telegram_bits, telegram_us

FLAG = [0, 1, 1, 1, 1, 1, 1, 0]


def bits_of(data: bytes) -> list[int]:
    """The bits of some bytes, the least significant first."""
    return [byte >> place & 1 for byte in data for place in range(8)]


def check_sequence(data: bytes) -> bytes:
    """The frame check sequence of HDLC, CRC-16/X-25."""
    register = 0xFFFF
    for bit in bits_of(data):
        register = (register >> 1) ^ (0x8408 if (register ^ bit) & 1 else 0)
    return (register ^ 0xFFFF).to_bytes(2, "little")


def stuffed(bits: list[int]) -> list[int]:
    """Bits with a 0 behind each five 1s."""
    found: list[int] = []
    ones = 0
    for bit in bits:
        found.append(bit)
        ones = ones + 1 if bit else 0
        if ones == 5:
            found.append(0)
            ones = 0
    return found


def written(address: int, data: bytes) -> list[int]:
    """A whole telegram."""
    body = bytes([address]) + data
    return [*FLAG, *stuffed(bits_of(body + check_sequence(body))), *FLAG]


def test_the_check_sequence_is_that_of_hdlc() -> None:
    assert check_sequence(b"123456789") == (0x906E).to_bytes(2, "little")


@given(st.integers(0, 255), st.binary(min_size=1, max_size=60))
def test_no_telegram_is_longer_than_the_worst_case(address: int, data: bytes) -> None:
    actual = len(written(address, data))
    assert telegram_bits(len(data), is_stuffed=False) <= actual <= telegram_bits(len(data), is_stuffed=True)


def test_the_worst_case_is_that_of_ones_alone() -> None:
    for size in range(1, 40):
        # One bit in five and no more: an address, data and a check sequence of 1s alone.
        bits = [1] * (8 * (1 + size + 2))
        assert 16 + len(stuffed(bits)) == telegram_bits(size, is_stuffed=True)


def test_long_telegrams_of_ones_come_near_it() -> None:
    data = b"\xff" * 40
    # Address and data are 1s; the check sequence alone is not.
    assert telegram_bits(40, is_stuffed=True) - len(written(0xFF, data)) <= 16 // 5


@pytest.mark.parametrize(("rate", "mst_us"), [(2, 27.0), (4, 13.5), (8, 6.75), (16, 3.375)])
def test_a_synchronisation_telegram_has_54_bits(rate: int, mst_us: float) -> None:
    assert telegram_us(1, data_rate_mbit_s=rate, is_stuffed=True) == mst_us


def test_drives_start_as_their_manual_says() -> None:
    # Kollmorgen, IDN 3: 12 us at 2 to 4 Mbit/s, 4 us at 8 to 16 Mbit/s.
    assert [start_us(rate) for rate in (2, 4, 8, 16)] == [12, 12, 4, 4]


def test_periods_hold_those_of_the_drives_manual() -> None:
    # Kollmorgen, IDN 2: 500, 1000, 2000, ... 8000 us; sercos.com: 62.5, 125, 250, 500 us, and multiples of 1 ms.
    assert {500.0, *(1000.0 * n for n in range(1, 9))} <= set(PERIODS.us)
    assert PERIODS.us[:5] == (62.5, 125.0, 250.0, 500.0, 1000.0)
