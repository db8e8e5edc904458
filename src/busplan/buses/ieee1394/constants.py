"""Constants of IEEE 1394: rates, limits, packet sizes, gap counts and the constants of the equations.

`constants.toml` has unit, source and grade of every figure that somebody published or measured. What holds by
definition (bits of a byte, a field of six bits) is a plain number here.
"""

from typing import Final, Literal

from busplan.elementwise import Number, from_table, rounded_up
from busplan.sourced import Constants

Speed = Literal["S100", "S200", "S400", "S800", "S1600", "S3200"]

c: Final = Constants("busplan.buses.ieee1394")
"""Constants with a source, by their names."""

BETA_SPEEDS: Final = ("S800", "S1600", "S3200")
"""Speeds of IEEE 1394b. Its arbitration has no gaps and no published time, so each computed time is a lower bound."""
MAX_GAP_COUNT: Final = 63
"""Largest value of the PHY's six-bit gap count, and its value after power-up."""

BITS_PER_BYTE: Final = 8
QUADLET_BYTES: Final = 4
"""Size of a quadlet, the unit of every packet (paper, section I)."""

c.computed("SYNC_PACKET_BYTES", lambda c: c.QUADLET_WRITE_REQUEST_BYTES)

GAP_COUNT_BY_HOPS: Final = (
    5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43, 46, 48, 51, 54, 57, 59, 62,
)  # fmt: skip
"""Smallest safe gap count for 1, 2, ... hops; source: `GAP_COUNT_TABLE_HOPS`."""
c.computed("GAP_COUNT_TABLE_HOPS", lambda _: len(GAP_COUNT_BY_HOPS))


def safe_gap_count(hops: Number) -> Number:
    """Smallest gap count that is safe for a bus of `hops` cable hops between its two farthest nodes [1].

    The power-up value 63 holds beyond the 23 hops of the published table. A plain number below 1 raises ValueError.

    References
    ----------
    The source of `GAP_COUNT_TABLE_HOPS`.

    Examples
    --------
    >>> safe_gap_count(1), safe_gap_count(16), safe_gap_count(40)
    (5, 43, 63)
    """
    if isinstance(hops, int) and hops < 1:
        raise ValueError(f"hops must be 1 or more, got {hops}")
    words = f"the table of smallest safe gap counts at H hops; {MAX_GAP_COUNT} beyond it"
    return from_table((*GAP_COUNT_BY_HOPS, MAX_GAP_COUNT), hops - 1, words=words, sources=(c.GAP_COUNT_TABLE_HOPS,))


def padded_bytes(payload_bytes: Number) -> Number:
    """Payload padded to whole quadlets, as it travels in a block packet [bytes].

    Examples
    --------
    >>> padded_bytes(12), padded_bytes(13)
    (12, 16)
    """
    return rounded_up(payload_bytes / QUADLET_BYTES) * QUADLET_BYTES
