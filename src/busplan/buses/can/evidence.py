"""Figures of CAN frames and messages for rows of evidence; each function takes any cycle of the kind."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal

from busplan.buses.can import equations
from busplan.buses.can.constants import BASE_BITS, EXPECTED_STUFFING
from busplan.buses.can.response import Sender, worst_response
from busplan.elementwise import plain

Stuffing = Literal["worst", "expected", "none"]
"""Number of stuff bits: the most, as many as measured frames have, or none."""


def stuffed(_cycle: object, *, least: float, most: float, stuffing: Stuffing) -> float:
    """A figure between that without stuff bits and that with the most."""
    shares: Mapping[Stuffing, float] = {"worst": 1, "expected": float(EXPECTED_STUFFING), "none": 0}
    return most if stuffing == "worst" else least + shares[stuffing] * (most - least)


def frame_bits(cycle: object, *, payload_bytes: int, identifier_bits: int, stuffing: Stuffing) -> float:
    """Length of a frame, the space of 3 bits behind it included [bits]."""
    least, most = (
        plain(equations.frame_bits(payload_bytes, identifier_bits=identifier_bits, is_stuffed=is_stuffed))
        for is_stuffed in (False, True)
    )
    return stuffed(cycle, least=least, most=most, stuffing=stuffing)


def fd_frame_bits(cycle: object, *, payload_bytes: int, identifier_bits: int, stuffing: Stuffing) -> float:
    """Length of a CAN FD frame at both bit rates, the space of 3 bits behind it included [bits]."""
    least, most = (
        plain(sum(equations.fd_frame_bits(payload_bytes, identifier_bits=identifier_bits, is_stuffed=is_stuffed)))
        for is_stuffed in (False, True)
    )
    return stuffed(cycle, least=least, most=most, stuffing=stuffing)


def response_us(
    _cycle: object, *, message: int, bit_rate_kbit_s: int, payload_bytes: Sequence[int], period_us: Sequence[float]
) -> float | None:
    """Worst-case response time of a message, counted from 1 in the order of identifiers [us]; None without an end."""
    senders = _senders(bit_rate_kbit_s, payload_bytes, period_us)
    own, higher, lower = senders[message - 1], senders[: message - 1], senders[message:]
    blocking_us = max((sender.frames_us for sender in lower), default=0.0)
    bit_us = plain(equations.bit_us(bit_rate_kbit_s))
    worst = worst_response(own, higher, blocking_us=blocking_us, bit_us=bit_us)
    return None if worst is None else float(worst.us)


def load(_cycle: object, *, bit_rate_kbit_s: int, payload_bytes: Sequence[int], period_us: Sequence[float]) -> float:
    """Share of the bus that messages take [1]."""
    return float(sum(sender.load for sender in _senders(bit_rate_kbit_s, payload_bytes, period_us)))


def _senders(bit_rate_kbit_s: int, payload_bytes: Sequence[int], period_us: Sequence[float]) -> list[Sender]:
    """Messages with the stuff bits of the worst case, by payload [bytes] and period [us]."""
    wire: dict[str, Any] = {"identifier_bits": BASE_BITS, "bit_rate_kbit_s": bit_rate_kbit_s, "is_stuffed": True}
    sizes = zip(payload_bytes, period_us, strict=True)
    return [Sender(plain(equations.frame_us(size, **wire)), each_us) for size, each_us in sizes]


FUNCTIONS: Final = {function.__name__: function for function in (stuffed, frame_bits, fd_frame_bits, response_us, load)}
