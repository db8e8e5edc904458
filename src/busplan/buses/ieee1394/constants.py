"""Constants of IEEE 1394: rates, limits, packet sizes, gap counts and the constants of the equations.

Every figure that somebody published or measured is a `Sourced` float: it names its unit, its source and how well it
is known. What is so by definition (the bits of a byte, a field of six bits) is a plain number. "Paper" is
G. Gu, L. Zhu, Z. Xiong, H. Ding, "Design of a Distributed Multiaxis Motion Control System Using the
IEEE-1394 Bus", IEEE Transactions on Industrial Electronics 57 (12), December 2010, pp. 4209 ff.
"""

from types import MappingProxyType
from typing import Final, Literal

from busplan.elementwise import Number, from_table, rounded_up
from busplan.sourced import Sourced, constants

Speed = Literal["S100", "S200", "S400"]


def _published(value: float, unit: str, meaning: str, source: str, *, symbol: str = "") -> Sourced:
    """A figure that was read in a public source."""
    return Sourced(value, unit=unit, grade="published", source=source, meaning=meaning, symbol=symbol)


# --- rates -----------------------------------------------------------------------------------------------

BASE_RATE_MBIT_S: Final = _published(
    98.304,
    "Mbit/s",
    "base rate: S100's data rate, and the clock that gaps and PHY delays are counted in",
    "IEEE 1394-1995; the gap tables of Linux, Apple and JHU do not depend on the packet speed",
    symbol="C",
)
DATA_RATE_MBIT_S: Final = MappingProxyType(
    {
        speed: _published(
            multiple * BASE_RATE_MBIT_S,
            "Mbit/s",
            f"data rate of {speed}",
            "IEEE 1394a" if speed != "S400" else "IEEE 1394a; paper, section IV-A",
            symbol="R",
        )
        for speed, multiple in {"S100": 1, "S200": 2, "S400": 4}.items()
    }
)
"""Data rate by speed code, in Mbit/s (which is bit/us)."""

# --- limits ----------------------------------------------------------------------------------------------

MAX_NODES: Final = _published(
    62,
    "nodes",
    "largest number of distributed nodes on one bus",
    "paper, section I: 63 nodes on one bus, the host is one of them",
)
MAX_HOPS: Final = _published(
    16, "hops", "largest number of cable hops between two nodes", "paper, section I; IEEE project page"
)
MAX_GAP_COUNT: Final = 63
"""The gap count is a six-bit field of the PHY; 63 is also its value after power-up."""

MAX_PAYLOAD_BYTES: Final = MappingProxyType(
    {
        speed: _published(
            limit,
            "bytes",
            f"largest payload of an asynchronous packet at {speed}",
            "IEEE 1394a, as in the Sederta driver header",
        )
        for speed, limit in {"S100": 512, "S200": 1024, "S400": 2048}.items()
    }
)
"""Largest asynchronous payload by speed code, in bytes."""

# --- packets on the wire, CRCs included --------------------------------------------------------------------


def _packet(size: int, meaning: str) -> Sourced:
    return _published(size, "bytes", meaning, "JHU mechatronics-firmware, FireWire.v; the header formats of IEEE 1394")


QUADLET_BYTES: Final = 4
"""A quadlet, the unit of every packet (paper, section I)."""
QUADLET_READ_REQUEST_BYTES: Final = _packet(16, "quadlet read request")
QUADLET_READ_RESPONSE_BYTES: Final = _packet(20, "quadlet read response")
QUADLET_WRITE_REQUEST_BYTES: Final = _packet(20, "quadlet write request")
BLOCK_READ_REQUEST_BYTES: Final = _packet(20, "block read request")
BLOCK_READ_RESPONSE_OVERHEAD_BYTES: Final = _packet(24, "block read response without its payload")
BLOCK_WRITE_REQUEST_OVERHEAD_BYTES: Final = _packet(24, "block write request without its payload")
WRITE_RESPONSE_BYTES: Final = _packet(16, "write response")

# --- constants of equations (4)-(6), (10) and (15) ---------------------------------------------------------

_TICKS = "gap clock ticks"
_GROWTH = "gap clock ticks per gap count"
REFERENCE_CABLE_M: Final = _published(
    4.5, "m", "length of the standard cable that CABLE_DELAY_US holds for", "paper, sections I and IV-A"
)
CABLE_DELAY_US: Final = _published(0.023, "us", "signal delay of one standard cable", "eqs (4)-(6); 4.5 m at 5.05 ns/m")
PHY_DELAY_TICKS: Final = _published(
    14,
    _TICKS,
    "repeat delay of one PHY",
    "eqs (4)-(6); at the base rate 0.142 us: TI TSB12LV41, p. 3-43, has 144 ns in the worst case",
)
ARBITRATION_GAP_TICKS: Final = _published(4, _GROWTH, "arbitration delay for each unit of the gap count", "eq (4)")
ARBITRATION_HOLD_US: Final = Sourced(
    1.63,
    unit="us",
    grade="recalled",
    source="published in eq (4); that it is MAX_BUS_HOLD, 160 base-rate ticks, is the likeliest reading",
    meaning="constant part of the arbitration phase",
)
DATA_END_US: Final = Sourced(
    0.25,
    unit="us",
    grade="recalled",
    source="published in eq (6); that it is DATA_END_TIME, 0.24-0.26 us, is the likeliest reading",
    meaning="constant part of the acknowledge phase",
)


def _gap_part(ticks: int, unit: str, meaning: str) -> Sourced:
    apart = "eq (10) taken apart: 82 + 48 g = (29 + 16 g) + (53 + 32 g); a threshold of idle bus, TI TSB12LV01B, p. 7-6"
    return Sourced(ticks, unit=unit, grade="derived", source=apart, meaning=meaning)


SUBACTION_GAP_TICKS: Final = _gap_part(29, _TICKS, "constant part of the subaction gap")
SUBACTION_GAP_TICKS_PER_COUNT: Final = _gap_part(16, _GROWTH, "growth of the subaction gap with the gap count")
RESET_GAP_TICKS: Final = _gap_part(53, _TICKS, "constant part of the arbitration reset gap")
RESET_GAP_TICKS_PER_COUNT: Final = _gap_part(32, _GROWTH, "growth of the arbitration reset gap with the gap count")
GAPS_TICKS: Final = _published(82, _TICKS, "constant part of both gaps together", "eq (10)")
GAPS_TICKS_PER_COUNT: Final = _published(48, _GROWTH, "growth of both gaps together with the gap count", "eq (10)")
BITS_PER_BYTE: Final = 8
EQ15_CONSTANT_US: Final = _published(
    3.11, "us", "eqs (4)-(6) at one hop, gap count 63 and S400, each rounded to two decimals and added", "eq (15)"
)

# --- cycle starts ------------------------------------------------------------------------------------------

CYCLE_US: Final = _published(
    125,
    "us",
    "time from one cycle start to the next",
    "Linux, drivers/firewire/core.h: 8000 cycles a second",
    symbol="T_iso",
)
CYCLE_START_BYTES: Final = _published(
    20, "bytes", "cycle start packet on the wire", "the header formats of IEEE 1394: 160 bits, sent at S100"
)
LEAST_ASYNCHRONOUS_US: Final = Sourced(
    1,
    unit="us",
    grade="assumed",
    source="chosen: no packet is shorter",
    meaning="time between two cycle starts below which none is left for asynchronous packets",
)
SYNC_PACKET_BYTES: Final = Sourced(
    QUADLET_WRITE_REQUEST_BYTES,
    unit="bytes",
    grade="derived",
    source="a broadcast quadlet write: paper, section III-C, and the header formats of IEEE 1394",
    meaning="synchronous packet on the wire",
)

# --- the broadcast schedule --------------------------------------------------------------------------------

_SOFTWARE = "JHU mechatronics-software, BasePort.cpp and FirewirePort.cpp"
_FIRMWARE = "JHU mechatronics-firmware, FireWire.v up to Rev 7"

MAX_BROADCAST_NODES: Final = _published(
    16, "nodes", "largest number of nodes that the hub collects data from", f"{_SOFTWARE}: BoardIO::MAX_BOARDS"
)
BROADCAST_CLOCK_MHZ: Final = _published(
    49.152, "MHz", "clock of the nodes", f"{_SOFTWARE}: the system clock of the FPGA"
)
FIRST_BROADCAST_CLOCKS: Final = _published(
    150, "clocks", "how long the first node waits after the query", f"{_FIRMWARE}, HubReg.v from Rev 8"
)
BROADCAST_SLOT_CLOCKS: Final = _published(
    256,
    "clocks",
    "from a node's time to broadcast to the next node's time, with timed requests",
    f"{_FIRMWARE}: 256 clocks for each board before it",
)
HUB_WAIT_US: Final = _published(
    10, "us", "wait of the host after the query, whatever the number of nodes", f"{_SOFTWARE}: 10 + 5 N"
)
HUB_WAIT_PER_NODE_US: Final = _published(
    5, "us", "further wait of the host after the query for each node", f"{_SOFTWARE}: 10 + 5 N"
)
BROADCAST_NODE_BYTES: Final = _published(
    4,
    "bytes",
    "what each node adds to a broadcast, to the hub's block and to the write, beside its payload",
    f"{_SOFTWARE}: a quadlet of sequence before the data, a header quadlet before the command (Rev 8)",
)
HUB_TIMING_BYTES: Final = _published(
    4, "bytes", "timing at the end of the hub's block", f"{_SOFTWARE}: the last quadlet of the hub's block"
)

# --- how well the model is known --------------------------------------------------------------------------

PHY_DELAY_HALF_WIDTH_US: Final = Sourced(
    0.020,
    unit="us",
    grade="assumed",
    source="chosen: PHYs repeat faster than the worst case of 144 ns",
    meaning="half of the range that the repeat delay of a PHY lies in",
)

# --- measured and set on the paper's bench: what a profile has that does not say otherwise ------------------

PING_US: Final = Sourced(
    0.3,
    unit="us",
    grade="measured",
    source="paper, section IV-A",
    meaning="latency of a ping to one node",
)
PING_PER_NODE_US: Final = Sourced(
    0.1,
    unit="us",
    grade="measured",
    source="paper, section IV-A",
    meaning="what each further node adds to a ping",
)
SLICE_RATIO: Final = _published(
    0.5, "1", "share of the period that is for communication", "paper, section III-E, eq (11)"
)
PACKET_OVERHEAD_BYTES: Final = _published(
    20, "bytes", "overhead of each packet in the paper's model", "paper, section IV-A"
)

# --- gap count ---------------------------------------------------------------------------------------------

GAP_COUNT_BY_HOPS: Final = (
    5, 7, 8, 10, 13, 16, 18, 21, 24, 26, 29, 32, 35, 37, 40, 43, 46, 48, 51, 54, 57, 59, 62,
)  # fmt: skip
"""Smallest safe gap count for 1, 2, ... hops; see `GAP_COUNT_TABLE_HOPS`."""
GAP_COUNT_TABLE_HOPS: Final = _published(
    len(GAP_COUNT_BY_HOPS),
    "hops",
    "most hops in the table of smallest safe gap counts, for cables of 4.5 m",
    "P1394a table C-2, 1394a table E-1, as Apple, JHU and, to 15 hops, Linux carry it",
)


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


CONSTANTS: Final = constants(globals())
"""Every constant with a source, by its name here."""
