"""Figures of CAN frames and messages for rows of evidence; each function takes any cycle of the kind."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final, Literal

from busplan.buses.can import equations
from busplan.buses.can.equations import SECOND_US, c
from busplan.buses.can.streams import streams
from busplan.buses.can.traffic import Message, Traffic
from busplan.buses.can.waiting import message_responses

Stuffing = Literal["worst", "expected", "none"]
"""Stuff bits of a frame: the most, as many as measured frames have, or none."""


def stuffed(_cycle: object, *, least: float, most: float, stuffing: Stuffing) -> float:
    """A figure between that without stuff bits and that with the most."""
    shares: Mapping[Stuffing, float] = {"expected": float(c.EXPECTED_STUFFING), "none": 0}
    return most if stuffing == "worst" else least + shares[stuffing] * (most - least)


def frame_bits(cycle: object, *, payload_bytes: int, identifier_bits: int, stuffing: Stuffing) -> float:
    """Length of a frame, the space of 3 bits behind it included [bits]."""
    least, most = (
        equations.frame_bits(payload_bytes, identifier_bits=identifier_bits, is_stuffed=is_stuffed)
        for is_stuffed in (False, True)
    )
    return stuffed(cycle, least=least, most=most, stuffing=stuffing)


def fd_frame_bits(cycle: object, *, payload_bytes: int, identifier_bits: int, stuffing: Stuffing) -> float:
    """Length of a CAN FD frame at both bit rates, the space of 3 bits behind it included [bits]."""
    least, most = (
        sum(equations.fd_frame_bits(payload_bytes, identifier_bits=identifier_bits, is_stuffed=is_stuffed))
        for is_stuffed in (False, True)
    )
    return stuffed(cycle, least=least, most=most, stuffing=stuffing)


def frame_us(
    cycle: object,
    *,
    payload_bytes: int,
    identifier_bits: int,
    bit_rate_kbit_s: float,
    stuffing: Stuffing,
    data_bit_rate_kbit_s: float = 0.0,
) -> float:
    """Time of a frame, the space of 3 bits behind it included [us]."""
    least, most = (
        equations.frame_us(
            payload_bytes,
            identifier_bits=identifier_bits,
            bit_rate_kbit_s=bit_rate_kbit_s,
            data_bit_rate_kbit_s=data_bit_rate_kbit_s,
            is_stuffed=is_stuffed,
        )
        for is_stuffed in (False, True)
    )
    return stuffed(cycle, least=least, most=most, stuffing=stuffing)


def frames_s(cycle: object, **frame: Any) -> float:
    """Frames a second on a full bus, by the arguments of `frame_us` [1/s]."""
    return SECOND_US / frame_us(cycle, **frame)


def response_us(
    _cycle: object, *, message: int, bit_rate_kbit_s: int, payload_bytes: Sequence[int], period_us: Sequence[float]
) -> float | None:
    """Worst-case response time of a message, counted from 1 in the order of identifiers [us]; None without an end."""
    _, worst = message_responses(_messages(bit_rate_kbit_s, payload_bytes, period_us))[message - 1]
    return None if worst.us == inf else worst.us


def load(_cycle: object, *, bit_rate_kbit_s: int, payload_bytes: Sequence[int], period_us: Sequence[float]) -> float:
    """Share of the bus that messages take [1]."""
    traffic = streams(_messages(bit_rate_kbit_s, payload_bytes, period_us))
    return float(sum(stream.frame_us / stream.period_us for stream in traffic))


def _messages(bit_rate_kbit_s: int, payload_bytes: Sequence[int], period_us: Sequence[float]) -> Traffic:
    """Messages alone by payload [bytes] and period [us], in the order of identifiers."""
    messages = (
        Message(f"{place}", place, size, us, jitter_us=0.0, deadline_us=us)
        for place, (size, us) in enumerate(zip(payload_bytes, period_us, strict=True))
    )
    return Traffic(bit_rate_kbit_s=bit_rate_kbit_s, messages=tuple(messages))


_OF_ROWS: Final = (stuffed, frame_bits, fd_frame_bits, frame_us, frames_s, response_us, load)
FUNCTIONS: Final = {function.__name__: function for function in _OF_ROWS}
