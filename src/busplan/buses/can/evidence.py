"""Published figures of CAN beside what the equations give."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from busplan.buses.can.constants import BASE_BITS, EXPECTED_STUFFING
from busplan.buses.can.equations import bit_us, frame_bits, frame_us
from busplan.buses.can.response import Response, Sender, worst_response
from busplan.buses.published import Comparison, EvidenceSection
from busplan.elementwise import plain

Published = Mapping[str, Any]
"""The published figures, as a data file of the package holds them."""
_WORST: Final = "worst stuffing"
_PLAIN: Final = "no stuffing"
_EXPECTED: Final = f"{EXPECTED_STUFFING:g} of the stuffing"


def can_sections(published: Published, paper: Published) -> tuple[EvidenceSection, ...]:
    """Compare published frames, loads and response times with what the equations give, and the row of the paper.

    Parameters
    ----------
    published
        What is published of CAN.
    paper
        What the paper publishes, a figure of a CAN system among it.
    """
    return (
        _lengths(published["frames"]),
        _counted(published["bits"]),
        _logged(published["log"]),
        _times(published["times"]),
        _example("CAN: a worked example, five messages", published["example"]),
        _axes(published["axes"]),
        _example("CAN: the worst instance is not the first", published["instances"]),
        _system(paper["can"]),
    )


def _lengths(given: Published) -> EvidenceSection:
    title = "CAN: bits of a frame, the space of 3 bits behind it included"

    def compared() -> Iterator[Comparison]:
        for method, key in ((_WORST, "stuffed_bits"), (_PLAIN, "plain_bits")):
            for identifier_bits, row in zip(given["identifier_bits"], given[key], strict=True):
                for size, bits in zip(given["payload_bytes"], row, strict=True):
                    computed = frame_bits(size, identifier_bits=identifier_bits, is_stuffed=method == _WORST)
                    quantity = f"{size} bytes, {identifier_bits} bits of identifier, {method}"
                    yield Comparison(title, quantity, "bits", bits, "frame", plain(computed), given["grade"])

    return EvidenceSection(title, f"{given['source']}.", tuple(compared()), "can")


def _counted(given: Published) -> EvidenceSection:
    """Bits of frames on a bus: each lies between no stuff bits and the most."""
    size, title = given["payload_bytes"], f"CAN: bits of frames of {given['payload_bytes']} bytes that hardware counted"

    def compared() -> Iterator[Comparison]:
        for number, (identifier_bits, bits) in enumerate(
            zip(given["identifier_bits"], given["bits"], strict=True), start=1
        ):
            plain_bits, stuffed_bits = (
                plain(frame_bits(size, identifier_bits=identifier_bits, is_stuffed=one)) for one in (False, True)
            )
            quantity = f"frame {number}, {identifier_bits} bits of identifier"
            for method, computed in _methods(plain_bits, stuffed_bits):
                yield Comparison(title, quantity, "bits", bits, method, computed, given["grade"])

    return EvidenceSection(title, f"{given['source']}.", tuple(compared()), "can")


def _logged(given: Published) -> EvidenceSection:
    title = "CAN: the load of a log"
    found = (
        Comparison(title, "bus load", "1", given["load"], method, computed, given["grade"])
        for method, computed in _methods(given["plain_load"], given["stuffed_load"])
    )
    return EvidenceSection(title, f"{given['source']}.", tuple(found), "can")


def _methods(least: float, most: float) -> tuple[tuple[str, float], ...]:
    """A figure without stuff bits and with the most, and with as many as are expected."""
    return (_WORST, most), (_EXPECTED, least + float(EXPECTED_STUFFING) * (most - least)), (_PLAIN, least)


def _times(given: Published) -> EvidenceSection:
    size, title = given["payload_bytes"], f"CAN: time of a frame of {given['payload_bytes']} bytes"
    pairs = zip(given["bit_rate_kbit_s"], given["frame_us"], strict=True)
    found = tuple(
        Comparison(title, f"{rate} kbit/s", "us", us, _WORST, _frame_us(size, rate), given["grade"])
        for rate, us in pairs
    )
    return EvidenceSection(title, f"{given['source']}.", found, "can")


def _frame_us(size: int, rate: int) -> float:
    return plain(frame_us(size, identifier_bits=BASE_BITS, bit_rate_kbit_s=rate, is_stuffed=True))


def _example(title: str, given: Published) -> EvidenceSection:
    """Response times of some messages, and their load where the source has it."""
    rate = given["bit_rate_kbit_s"]
    senders = [
        Sender(_frame_us(size, rate), period_us)
        for size, period_us in zip(given["payload_bytes"], given["period_us"], strict=True)
    ]
    found = [
        Comparison(title, f"response of {name}", "us", given["response_us"][name], _WORST, own.us, given["grade"])
        for place, name in enumerate(given["names"])
        if name in given["response_us"] and (own := _response(senders, place, rate))
    ]
    if "load" in given:
        found.append(_load(title, given, senders))
    return EvidenceSection(title, f"{given['source']}.", tuple(found), "can")


def _response(senders: Sequence[Sender], place: int, rate: int) -> Response | None:
    blocking_us = max((one.frames_us for one in senders[place + 1 :]), default=0.0)
    return worst_response(senders[place], senders[:place], blocking_us=blocking_us, bit_us=plain(bit_us(rate)))


def _load(title: str, given: Published, senders: Sequence[Sender]) -> Comparison:
    return Comparison(title, "bus load", "1", given["load"], _WORST, sum(one.load for one in senders), given["grade"])


def _axes(given: Published) -> EvidenceSection:
    title = f"CAN: the load of {given['axes']} axes at {given['period_us']} us"
    each = Sender(_frame_us(given["payload_bytes"], given["bit_rate_kbit_s"]), given["period_us"])
    return EvidenceSection(title, f"{given['source']}.", (_load(title, given, [each] * (2 * given["axes"])),), "can")


def _system(given: Published) -> EvidenceSection:
    title, size = "CAN: the system that the paper compares itself with", given["payload_bytes"]
    wire_us, us = _frame_us(size, 1000 * given["can_rate_mbit_s"]), given["can_latency_us"]
    return EvidenceSection(
        title,
        f"Paper, {given['source']}, reference [48]: {us} us at {given['can_rate_mbit_s']} Mbit/s. A frame takes "
        f"{wire_us:.0f} us of it on the wire; the other {(us - wire_us) / 1000:.1f} ms are the host's, and no "
        "figure of the bus. It tests no schedule.",
        (Comparison(title, f"{size} bytes", "us", us, "frame on the wire", wire_us),),
        "paper",
    )
