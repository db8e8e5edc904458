"""CAN frames in equations: sourced constants, lengths and times of frames, and the figures made of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

from busplan.buses.figure import BusFigures, OwnFigures, read_figures
from busplan.elementwise import Number, are_plain, choose, is_off, larger, next_entry, rounded_down, rounded_up, smaller
from busplan.sourced import Constants, cached

BIT_RATES: Final = (10, 20, 50, 125, 250, 500, 800, 1000)
"""Bit rates that CiA 301 names [kbit/s]."""
LEAST_BIT_RATE, MOST_BIT_RATE = 5, 1000
"""Bit rates of transceivers and of the standard, any between them [kbit/s]."""
DATA_BIT_RATES: Final = (1000, 2000, 4000, 5000, 8000)
"""Data bit rates that transceivers of CAN FD are made for, up to those of CiA 601-4 [kbit/s]."""
USUAL_DATA_BIT_RATE: Final = 2000.0
"""Data bit rate that is assumed where no file gives one [kbit/s]."""
MOST_DATA_BIT_RATE: Final = DATA_BIT_RATES[-1]
"""Largest data bit rate of CAN FD [kbit/s]."""
IdentifierBits = Literal[11, 29]

c: Final = Constants("busplan.buses.can")
"""Sourced constants of CAN, by name."""

BASE_BITS: Final = 11
"""Identifier bits of the base format, CAN 2.0A; the extended format, 2.0B, has 29."""
MAX_IDENTIFIER: Final[Mapping[int, int]] = MappingProxyType({11: (1 << 11) - 1, 29: (1 << 29) - 1})
FD_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Lengths of data that the DLC of an FD frame can say; other data is padded to the next [bytes]."""


SATURATED: Final = c.unchanged["SATURATED"]
MOST_STEPS: Final = c.unchanged["MOST_STEPS"]

SECOND_US: Final = 1e6

KBIT_US = 1000
"""Time of a bit at 1 kbit/s [us]."""


def frame_bits(data_bytes: Number, *, identifier_bits: Number, is_stuffed: bool) -> Number:
    """Length of a classical data frame, interframe space included.

    Parameters
    ----------
    data_bytes
        Data of the frame s, 0..8 [bytes]; float or array.
    identifier_bits
        Bits of the identifier, 11 or 29 [1]; float or array.
    is_stuffed
        Whether the stuff bits of the worst case are counted, floor((g + 8 s - 1) / 4), or none.

    Returns
    -------
    float
        g + 8 s + 13 bits and the stuff bits, g = 34 or 54 [bits]; the broadcast shape of the arguments.

    References
    ----------
    Davis et al. 2007, equations (1)-(3).

    Examples
    --------
    >>> frame_bits(8, identifier_bits=11, is_stuffed=True), frame_bits(8, identifier_bits=29, is_stuffed=True)
    (135.0, 160.0)
    >>> frame_bits(8, identifier_bits=11, is_stuffed=False)
    111.0
    """
    stuffable = (
        choose(identifier_bits > BASE_BITS, c.STUFFED_BITS_EXTENDED, c.STUFFED_BITS) + c.BITS_PER_BYTE * data_bytes
    )
    bits: Number = stuffable + c.FIXED_BITS
    return bits + rounded_down((stuffable - 1) / c.STUFF_STEP_BITS) if is_stuffed else bits


def fd_frame_bits(data_bytes: Number, *, identifier_bits: Number, is_stuffed: bool) -> tuple[Number, Number]:
    """Length of a CAN FD frame that switches its bit rate, interframe space included.

    Parameters
    ----------
    data_bytes
        Data of the frame, 0..64 [bytes], padded to the next length p that a DLC can say; float or array.
    identifier_bits, is_stuffed
        As `frame_bits` takes them. The fixed stuff bits of stuff count and CRC are always counted.

    Returns
    -------
    tuple
        Bits at the nominal bit rate, a + 12 with a = 17 or 36, and with stuffing floor((a - 2) / 4) more; bits at the
        data bit rate, d + t + ceil(t / 4) + 1 with d = 5 + 8 p and t = 4 + 17, or 4 + 21 over 16 bytes, and with
        stuffing floor((d + 3) / 4) more [bits]. The longest frames have 1 to 3 data bits less, and with 29 bits of
        identifier 1 nominal bit less, for some bits of the header are fixed.

    References
    ----------
    ISO 11898-1:2015. The sum of both is that of Linux 6.5, include/linux/can/length.h.

    Examples
    --------
    >>> fd_frame_bits(64, identifier_bits=11, is_stuffed=True), fd_frame_bits(10, identifier_bits=29, is_stuffed=False)
    ((32.0, 680.0), (48.0, 129.0))
    """
    opening = choose(identifier_bits > BASE_BITS, c.FD_OPENING_BITS_EXTENDED, c.FD_OPENING_BITS)
    padded_bytes = next_entry(FD_LENGTHS, data_bytes, words="the next length of a DLC")
    stuffable = c.FD_CONTROL_BITS + c.BITS_PER_BYTE * padded_bytes
    tail = c.FD_COUNT_BITS + choose(padded_bytes > c.FD_SHORT_BYTES, c.FD_LONG_CRC_BITS, c.FD_CRC_BITS)
    nominal_bits: Number = opening + c.FD_CLOSING_BITS
    data_bits: Number = stuffable + tail + rounded_up(tail / c.STUFF_STEP_BITS) + c.FD_DELIMITER_BITS
    if not is_stuffed:
        return nominal_bits, data_bits
    # A stuff bit behind the last bit of the opening has the data bit rate.
    return (
        nominal_bits + rounded_down((opening - 2) / c.STUFF_STEP_BITS),
        data_bits + rounded_up(stuffable / c.STUFF_STEP_BITS),
    )


def bit_us(bit_rate_kbit_s: Number) -> Number:
    """Time of a bit [us].

    Examples
    --------
    >>> bit_us(250)
    4.0
    """
    return KBIT_US / bit_rate_kbit_s


def frame_us(
    data_bytes: Number,
    *,
    identifier_bits: Number,
    bit_rate_kbit_s: Number,
    data_bit_rate_kbit_s: Number = 0.0,
    late_bits: Number = 0.0,
    is_stuffed: bool,
) -> Number:
    """Time of a data frame on the wire: classical, or of CAN FD with a data bit rate [us].

    Nodes far apart make a CAN FD frame longer by some late nominal bits, 0..`FD_LATE_BITS`.

    Examples
    --------
    >>> frame_us(8, identifier_bits=11, bit_rate_kbit_s=500, is_stuffed=True)
    270.0
    >>> frame_us(8, identifier_bits=11, bit_rate_kbit_s=500, data_bit_rate_kbit_s=2000, is_stuffed=True)
    121.5
    """
    given = data_bytes, identifier_bits, bit_rate_kbit_s, data_bit_rate_kbit_s, late_bits, is_stuffed
    return (_of_plain if are_plain(*given) else _frame_us)(*given)


def _frame_us(
    data_bytes: Number,
    identifier_bits: Number,
    bit_rate_kbit_s: Number,
    data_bit_rate_kbit_s: Number,
    late_bits: Number,
    is_stuffed: bool,
) -> Number:
    if not is_off(data_bit_rate_kbit_s):
        nominal, data = fd_frame_bits(data_bytes, identifier_bits=identifier_bits, is_stuffed=is_stuffed)
        nominal = nominal if is_off(late_bits) else nominal + late_bits
        return nominal * bit_us(bit_rate_kbit_s) + data * bit_us(data_bit_rate_kbit_s)
    bits = frame_bits(data_bytes, identifier_bits=identifier_bits, is_stuffed=is_stuffed)
    return bits * bit_us(bit_rate_kbit_s)


_of_plain: Final = cached(4096)(_frame_us)


def payload_us(
    payload_bytes: Number,
    *,
    frame_bytes: tuple[float, ...] = (),
    identifier_bits: Number,
    bit_rate_kbit_s: Number,
    data_bit_rate_kbit_s: Number = 0.0,
    late_bits: Number = 0.0,
    is_stuffed: bool,
) -> Number:
    """Time of all frames of a payload: each is filled before the next, and the last has the rest [us].

    `frame_bytes` is the most data of each frame in their order, by default of classical ones; further ones are as the
    last.

    Examples
    --------
    >>> wire = {"identifier_bits": 11, "bit_rate_kbit_s": 1000, "is_stuffed": True}
    >>> payload_us(10, **wire), payload_us(12, frame_bytes=(6, 6), **wire)
    (210.0, 230.0)
    """

    def of_frame(data_bytes: Number) -> Number:
        return frame_us(
            data_bytes,
            identifier_bits=identifier_bits,
            bit_rate_kbit_s=bit_rate_kbit_s,
            data_bit_rate_kbit_s=data_bit_rate_kbit_s,
            late_bits=late_bits,
            is_stuffed=is_stuffed,
        )

    def if_any(data_bytes: Number) -> Number:
        return choose(data_bytes > 0, of_frame(data_bytes), 0.0)

    *first_bytes, most_bytes = frame_bytes or (c.FRAME_BYTES,)
    first_us: Number = 0.0
    rest_bytes = payload_bytes
    for size in first_bytes:
        first_us = first_us + if_any(smaller(rest_bytes, size))
        rest_bytes = larger(rest_bytes - size, 0)
    full = rounded_down(rest_bytes / most_bytes)
    others_us = full * of_frame(float(most_bytes)) + if_any(rest_bytes - most_bytes * full)
    return first_us + others_us if first_bytes else others_us


def share_bytes(payload_bytes: Number, *, pdos: Number) -> Number:
    """Payload of each of a node's PDOs in one direction, shared out evenly [bytes].

    Examples
    --------
    >>> share_bytes(16, pdos=2), share_bytes(17, pdos=2)
    (8, 9)
    """
    return rounded_up(payload_bytes / pdos)


_FIGURES: Final = read_figures("busplan.buses.can")
BUS_LOAD: Final = _FIGURES["loads"][0]
TERMS: Final = _FIGURES["terms"]
LATENCY_TABLE: Final = _FIGURES["latency"]
FIGURES: Final = BusFigures(
    TERMS,
    setup=_FIGURES["setup"],
    headings=("bit_rate_kbit_s",),
    added=_FIGURES["loads"],
    table=_FIGURES["loads"],
    compared=_FIGURES["loads"],
    planned=(BUS_LOAD.key,),
    latency_rows=LATENCY_TABLE,
    has_many_transactions=True,
    deadlines=("worst_response_us", "deadline_us"),
)


@dataclass(frozen=True)
class CanMessageFigures(OwnFigures):
    """Figures of a CAN network of messages alone, by the keys of `FIGURES`."""

    bit_rate_kbit_s: float
    bus_load: float
    expected_load: float


@dataclass(frozen=True)
class CanFigures(CanMessageFigures):
    """Figures of a CAN network with a cycle: those of its messages, and its terms."""

    cycle_jitter_us: float
    cycle_sync_us: float
    cycle_wait_us: float
    cycle_feedback_us: float
    cycle_adapter_us: float
    cycle_host_us: float
    cycle_command_us: float
    cycle_blocking_us: float
    cycle_interference_us: float
    nonperiodic_us: float
