"""Constants of IEEE 1394: rates, limits, packet sizes, gap counts and the constants of the equations.

`constants.toml` has the unit, the source and the grade of every figure that somebody published or measured. What is so
by definition (the bits of a byte, a field of six bits) is a plain number here.
"""

from typing import Final, Literal

from busplan.elementwise import Number, from_table, rounded_up
from busplan.sourced import Constants

Speed = Literal["S100", "S200", "S400", "S800", "S1600", "S3200"]

CONSTANTS: Final = Constants("busplan.buses.ieee1394")
"""Every constant with a source, by its name here."""

BASE_RATE_MBIT_S: Final = CONSTANTS["BASE_RATE_MBIT_S"]
DATA_RATE_MBIT_S: Final = CONSTANTS.by_key("DATA_RATE_MBIT_S")
"""Data rate by speed code, in Mbit/s (which is bit/us)."""
BETA_SPEEDS: Final = ("S800", "S1600", "S3200")
"""Speeds of IEEE 1394b, whose arbitration has no gaps and no published time: what is computed is a lower bound."""
BETA_ARBITRATION_US: Final = CONSTANTS["BETA_ARBITRATION_US"]
BETA_ACKNOWLEDGE_US: Final = CONSTANTS["BETA_ACKNOWLEDGE_US"]
BETA_PHY_DELAY_US: Final = CONSTANTS["BETA_PHY_DELAY_US"]
MAX_NODES: Final = CONSTANTS["MAX_NODES"]
MAX_HOPS: Final = CONSTANTS["MAX_HOPS"]
MAX_GAP_COUNT: Final = 63
"""The gap count is a six-bit field of the PHY; 63 is also its value after power-up."""
MAX_PAYLOAD_BYTES: Final = CONSTANTS.by_key("MAX_PAYLOAD_BYTES")
"""Largest asynchronous payload by speed code, in bytes."""

BITS_PER_BYTE: Final = 8
QUADLET_BYTES: Final = 4
"""A quadlet, the unit of every packet (paper, section I)."""
QUADLET_READ_REQUEST_BYTES: Final = CONSTANTS["QUADLET_READ_REQUEST_BYTES"]
QUADLET_READ_RESPONSE_BYTES: Final = CONSTANTS["QUADLET_READ_RESPONSE_BYTES"]
QUADLET_WRITE_REQUEST_BYTES: Final = CONSTANTS["QUADLET_WRITE_REQUEST_BYTES"]
BLOCK_READ_REQUEST_BYTES: Final = CONSTANTS["BLOCK_READ_REQUEST_BYTES"]
BLOCK_READ_RESPONSE_OVERHEAD_BYTES: Final = CONSTANTS["BLOCK_READ_RESPONSE_OVERHEAD_BYTES"]
BLOCK_WRITE_REQUEST_OVERHEAD_BYTES: Final = CONSTANTS["BLOCK_WRITE_REQUEST_OVERHEAD_BYTES"]
WRITE_RESPONSE_BYTES: Final = CONSTANTS["WRITE_RESPONSE_BYTES"]

REFERENCE_CABLE_M: Final = CONSTANTS["REFERENCE_CABLE_M"]
CABLE_DELAY_US: Final = CONSTANTS["CABLE_DELAY_US"]
PHY_DELAY_TICKS: Final = CONSTANTS["PHY_DELAY_TICKS"]
ARBITRATION_GAP_TICKS: Final = CONSTANTS["ARBITRATION_GAP_TICKS"]
ARBITRATION_HOLD_US: Final = CONSTANTS["ARBITRATION_HOLD_US"]
DATA_END_US: Final = CONSTANTS["DATA_END_US"]
SUBACTION_GAP_TICKS: Final = CONSTANTS["SUBACTION_GAP_TICKS"]
SUBACTION_GAP_TICKS_PER_COUNT: Final = CONSTANTS["SUBACTION_GAP_TICKS_PER_COUNT"]
RESET_GAP_TICKS: Final = CONSTANTS["RESET_GAP_TICKS"]
RESET_GAP_TICKS_PER_COUNT: Final = CONSTANTS["RESET_GAP_TICKS_PER_COUNT"]
GAPS_TICKS: Final = CONSTANTS["GAPS_TICKS"]
GAPS_TICKS_PER_COUNT: Final = CONSTANTS["GAPS_TICKS_PER_COUNT"]
EQ15_CONSTANT_US: Final = CONSTANTS["EQ15_CONSTANT_US"]
CYCLE_US: Final = CONSTANTS["CYCLE_US"]
CYCLE_START_BYTES: Final = CONSTANTS["CYCLE_START_BYTES"]
LEAST_ASYNCHRONOUS_US: Final = CONSTANTS["LEAST_ASYNCHRONOUS_US"]
SYNC_PACKET_BYTES: Final = CONSTANTS.computed("SYNC_PACKET_BYTES", QUADLET_WRITE_REQUEST_BYTES)
MAX_BROADCAST_NODES: Final = CONSTANTS["MAX_BROADCAST_NODES"]
BROADCAST_CLOCK_MHZ: Final = CONSTANTS["BROADCAST_CLOCK_MHZ"]
FIRST_BROADCAST_CLOCKS: Final = CONSTANTS["FIRST_BROADCAST_CLOCKS"]
BROADCAST_SLOT_CLOCKS: Final = CONSTANTS["BROADCAST_SLOT_CLOCKS"]
HUB_WAIT_US: Final = CONSTANTS["HUB_WAIT_US"]
HUB_WAIT_PER_NODE_US: Final = CONSTANTS["HUB_WAIT_PER_NODE_US"]
BROADCAST_NODE_BYTES: Final = CONSTANTS["BROADCAST_NODE_BYTES"]
HUB_TIMING_BYTES: Final = CONSTANTS["HUB_TIMING_BYTES"]
PHY_DELAY_HALF_WIDTH_US: Final = CONSTANTS["PHY_DELAY_HALF_WIDTH_US"]
PING_US: Final = CONSTANTS["PING_US"]
PING_PER_NODE_US: Final = CONSTANTS["PING_PER_NODE_US"]
SLICE_RATIO: Final = CONSTANTS["SLICE_RATIO"]
PACKET_OVERHEAD_BYTES: Final = CONSTANTS["PACKET_OVERHEAD_BYTES"]

GAP_COUNT_BY_HOPS: Final = (
    5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43, 46, 48, 51, 54, 57, 59, 62,
)  # fmt: skip
"""Smallest safe gap count for 1, 2, ... hops; see `GAP_COUNT_TABLE_HOPS`."""
GAP_COUNT_TABLE_HOPS: Final = CONSTANTS.computed("GAP_COUNT_TABLE_HOPS", len(GAP_COUNT_BY_HOPS))


def safe_gap_count(hops: Number) -> Number:
    """Smallest gap count that is safe for a bus of that many hops.

    Parameters
    ----------
    hops
        Largest number of cable hops between two nodes, 1 or more [1]; of any sort.

    Returns
    -------
    int
        Gap count of the published table; the power-up value 63 beyond its 23 hops.

    Raises
    ------
    ValueError
        `hops` is a plain number below 1.

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
    return from_table((*GAP_COUNT_BY_HOPS, MAX_GAP_COUNT), hops - 1, words=words, sources=(GAP_COUNT_TABLE_HOPS,))


def padded_bytes(payload_bytes: Number) -> Number:
    """Payload filled up to whole quadlets, as it travels in a block packet [bytes].

    Parameters
    ----------
    payload_bytes
        Payload [bytes]; of any sort.

    Returns
    -------
    int
        The next multiple of 4 [bytes].

    Examples
    --------
    >>> padded_bytes(12), padded_bytes(13)
    (12, 16)
    """
    return rounded_up(payload_bytes / QUADLET_BYTES) * QUADLET_BYTES
