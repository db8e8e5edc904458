"""Sourced figures of SERCOS I and II, and the length of their telegrams, for numbers of any sort.

References
----------
IEC 61491; ISO/IEC 13239 (HDLC): a 0 is put after five 1s between the flags.
"""

from typing import Final, Literal

from busplan.buses import sercos
from busplan.buses.limits import Periods
from busplan.elementwise import Number, choose, rounded_down
from busplan.sourced import Sourced, constants

DataRate = Literal[2, 4, 8, 16]
"""Data rates [Mbit/s]."""

_CODE: Final = "sercos2-linuxcnc, a master that drives a ring"
_KOLLMORGEN: Final = "Kollmorgen, sercos IDN set of S300/S700"
_HDLC: Final = "sercos.com, telegrams of SERCOS I and II: a 0 after five 1s"


def _bytes(value: int, meaning: str, *, source: str = _CODE) -> Sourced:
    return Sourced(value, unit="bytes", grade="published", source=source, meaning=meaning)


def _us(value: float, meaning: str, *, symbol: str = "") -> Sourced:
    return Sourced(value, unit="us", grade="published", source=_KOLLMORGEN, meaning=meaning, symbol=symbol)


BITS_PER_BYTE: Final = Sourced(8, unit="bits", grade="published", source="definition", meaning="bits of a byte")
FLAG_BITS: Final = Sourced(
    16, unit="bits", grade="published", source=_CODE, meaning="opening and closing flag of a telegram, never stuffed"
)
STUFF_STEP_BITS: Final = Sourced(
    5, unit="bits", grade="published", source=_HDLC, meaning="bits for each stuff bit in the worst case"
)
FRAME_BYTES: Final = _bytes(3, "address 1 and check sequence 2 of a telegram")
MST_BYTES: Final = _bytes(1, "data of the synchronisation telegram")
RECORD_BYTES: Final = _bytes(4, "status 2 and service 2 of an AT; control 2 and service 2 of a record of the MDT")
MOST_MDT_BYTES: Final = _bytes(65_534, "most data of the MDT", source=_KOLLMORGEN)
MOST_DRIVE_BYTES: Final = _bytes(
    32, "data of a drive that can be configured in either direction", source="Rexroth, IndraDrive MPx-02"
)
MOST_DRIVES: Final = Sourced(
    254, unit="1", grade="published", source="sercos.de, introduction", meaning="drives of a ring"
)
SLOW_MBIT_S: Final = Sourced(
    4, unit="Mbit/s", grade="published", source=_KOLLMORGEN, meaning="fastest rate of the slow start"
)
SLOW_START_US: Final = _us(12, "from MST to the first AT at 2 and 4 Mbit/s, t1min", symbol="t_1")
FAST_START_US: Final = _us(4, "from MST to the first AT at 8 and 16 Mbit/s, t1min", symbol="t_1")
TURNAROUND_US: Final = _us(12, "from the last AT to the MDT, t_ATMT", symbol="t_ATMT")

GAP_SHARE: Final = Sourced(
    0.1,
    unit="1",
    grade="assumed",
    source="chosen, as of an execution time that is assumed",
    meaning="standard uncertainty of the gap between two drives, as a share of it",
)

_STEP_US: Final = 1000
_LONGEST_US: Final = 65_000
PERIODS: Final = Periods((62.5, 125.0, 250.0, 500.0, *map(float, range(_STEP_US, _LONGEST_US + 1, _STEP_US))))
"""Communication periods: sercos.com, cycle times; the longest by Rexroth."""
PERIODS_SOURCE: Final = (
    "62.5, 125, 250 and 500 us, and multiples of 1 ms (sercos.com), up to 65 ms (Rexroth); a drive may know fewer, as "
    "0.5, 1, 2, ... 8 ms (Kollmorgen)"
)

CONSTANTS: Final = {**sercos.CONSTANTS, **constants(globals())}


def telegram_bits(data_bytes: Number, *, is_stuffed: bool) -> Number:
    """Length of a telegram with its flags.

    Parameters
    ----------
    data_bytes
        Data of the telegram s [bytes]; float or array.
    is_stuffed
        Whether the stuff bits of the worst case are counted, floor(8 (s + 3) / 5), or none.

    Returns
    -------
    float
        16 + 8 (s + 3) bits and the stuff bits [bits]; the shape of the argument.

    Examples
    --------
    >>> telegram_bits(1, is_stuffed=True), telegram_bits(1, is_stuffed=False)
    (54.0, 48.0)
    """
    stuffable: Number = (data_bytes + FRAME_BYTES) * BITS_PER_BYTE
    bits = stuffable + FLAG_BITS
    return bits + rounded_down(stuffable / STUFF_STEP_BITS) if is_stuffed else bits


def telegram_us(data_bytes: Number, *, data_rate_mbit_s: Number, is_stuffed: bool) -> Number:
    """Time of a telegram on the ring [us].

    Parameters
    ----------
    data_bytes, is_stuffed
        As `telegram_bits` takes them.
    data_rate_mbit_s
        Data rate [Mbit/s]; float or array.

    Examples
    --------
    >>> telegram_us(1, data_rate_mbit_s=4, is_stuffed=True)
    13.5
    """
    return telegram_bits(data_bytes, is_stuffed=is_stuffed) / data_rate_mbit_s


def start_us(data_rate_mbit_s: Number) -> Number:
    """From MST to the first AT, where the drives say no other time [us].

    Examples
    --------
    >>> start_us(4), start_us(16)
    (12.0, 4.0)
    """
    return choose(data_rate_mbit_s > SLOW_MBIT_S, FAST_START_US, SLOW_START_US)
