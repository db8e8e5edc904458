"""Length of the telegrams of SERCOS I and II, for numbers of any sort.

References
----------
IEC 61491; ISO/IEC 13239 (HDLC): a 0 is put behind five 1s between the flags.
"""

from busplan.buses.sercos2.constants import (
    BITS_PER_BYTE,
    FAST_START_US,
    FLAG_BITS,
    FRAME_BYTES,
    SLOW_MBIT_S,
    SLOW_START_US,
    STUFF_STEP_BITS,
)
from busplan.elementwise import Number, choose, rounded_down


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
