"""Time on the wire of the frames of a CAN log."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from busplan.buses.can.equations import BASE_BITS, bit_us, c, frame_us
from busplan.recordings.can import CanFrames
from busplan.recordings.statistics import Floats


class WireTimes(NamedTuple):
    """Times of n frames on the wire."""

    us: Floats
    """By the bits of each classical frame; of CAN FD with half of the possible stuff bits [us]."""
    worst_us: Floats
    """With the most stuff bits [us]."""
    none_us: Floats
    """Without stuff bits [us]."""
    least_us: Floats
    """With its own stuff bits, of CAN FD without [us]."""


def wire_times(
    frames: CanFrames, taken: npt.NDArray[np.int64], *, bit_rate_kbit_s: float, data_bit_rate_kbit_s: float
) -> WireTimes:
    """Times of some frames of a log on the wire; a data bit rate of 0 gives no time to those that switch."""
    is_fd, switched = frames.is_fd[taken], frames.switched[taken]

    def each_us(*, is_stuffed: bool) -> Floats:
        us = np.zeros(len(taken))
        for places, data_rate in (
            (~is_fd, 0.0),
            (is_fd & ~switched, bit_rate_kbit_s),
            (is_fd & switched & bool(data_bit_rate_kbit_s), data_bit_rate_kbit_s),
        ):
            us[places] = frame_us(
                np.minimum(frames.sizes[taken[places]], c.FD_FRAME_BYTES if data_rate else c.FRAME_BYTES),
                identifier_bits=np.where(frames.extended[taken[places]], 29, BASE_BITS),
                bit_rate_kbit_s=bit_rate_kbit_s,
                data_bit_rate_kbit_s=data_rate,
                is_stuffed=is_stuffed,
            )
        return us

    worst_us, none_us = each_us(is_stuffed=True), each_us(is_stuffed=False)
    # Of CAN FD the stuff bits are not known: any number of the possible ones.
    us = np.where(is_fd, (worst_us + none_us) / 2, frames.bits[taken] * bit_us(bit_rate_kbit_s))
    return WireTimes(us, worst_us, none_us, np.where(is_fd, none_us, us))
