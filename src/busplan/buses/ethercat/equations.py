"""EtherCAT in equations: sourced constants, lengths and times of frames, and the figures made of them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from busplan.buses.figure import BusFigures, read_figures
from busplan.buses.published import Spread, published, rows_of
from busplan.elementwise import Number, choose, larger, plain, traced_with
from busplan.sourced import Constants

Port = Literal["100BASE-TX", "E-bus"]
ProcessData = Literal["LRW-separate", "LRW-shared", "LRD-LWR"]
SEPARATE: Final[ProcessData] = "LRW-separate"
SHARED: Final[ProcessData] = "LRW-shared"
SPLIT: Final[ProcessData] = "LRD-LWR"
Starts = Literal["datagram", "frame"]
Master = Literal["SOEM", "IgH", "ethercrab", "TwinCAT", "acontis"]
UNNAMED: Final = "unnamed"
"""The master of a profile that names none."""

LAYOUTS: Final[Mapping[str, ProcessData]] = MappingProxyType(
    {"SOEM": SEPARATE, "IgH": SEPARATE, "ethercrab": SEPARATE, "TwinCAT": SHARED, "acontis": SHARED, UNNAMED: SEPARATE}
)
"""Layout of the process data by master."""

CONSTANTS: Final = Constants("busplan.buses.ethercat")
"""Every constant with a source, by its name here."""

BYTE_US: Final = CONSTANTS["BYTE_US"]
PREAMBLE_BYTES: Final = CONSTANTS["PREAMBLE_BYTES"]
ETHERNET_BYTES: Final = CONSTANTS["ETHERNET_BYTES"]
CHECK_BYTES: Final = CONSTANTS["CHECK_BYTES"]
GAP_BYTES: Final = CONSTANTS["GAP_BYTES"]
HEADER_BYTES: Final = CONSTANTS["HEADER_BYTES"]
DATAGRAM_BYTES: Final = CONSTANTS["DATAGRAM_BYTES"]
LEAST_FRAME_BYTES: Final = CONSTANTS["LEAST_FRAME_BYTES"]
MOST_FRAME_BYTES: Final = CONSTANTS["MOST_FRAME_BYTES"]
MAILBOX_BYTES: Final = CONSTANTS["MAILBOX_BYTES"]
MOST_DEVICES: Final = CONSTANTS["MOST_DEVICES"]
MOST_CABLE_M: Final = CONSTANTS["MOST_CABLE_M"]
CABLE_US_PER_M: Final = CONSTANTS["CABLE_US_PER_M"]
_TX: Final = Spread.of(published("ethercat")["delays"]["tx_one_way_us"])
CONSTANTS.computed("DELAY_US[100BASE-TX]", _TX.mean)
CONSTANTS.computed("DELAY_UNCERTAINTY_US[100BASE-TX]", _TX.uncertainty)
DELAY_US: Final = CONSTANTS.by_key("DELAY_US")
"""One-way delay of a device by the ports that it has."""
DELAY_UNCERTAINTY_US: Final = CONSTANTS.by_key("DELAY_UNCERTAINTY_US")
MEASURED_DELAY_UNCERTAINTY_US: Final = CONSTANTS.computed("MEASURED_DELAY_UNCERTAINTY_US", 0.010 / 12**0.5)
_PER_BYTE: Final = Spread.of([row["published"] for row in rows_of("ethercat", "bytes")])
BYTE_BIAS_US: Final = CONSTANTS.computed("BYTE_BIAS_US", _PER_BYTE.mean - BYTE_US)
BYTE_BIAS_UNCERTAINTY_US: Final = CONSTANTS.computed("BYTE_BIAS_UNCERTAINTY_US", _PER_BYTE.uncertainty)
HOUSEKEEPING_BYTES: Final = CONSTANTS.by_key("HOUSEKEEPING_BYTES")
"""Datagrams that each master adds to the first frame of every cycle, without that of distributed clocks."""
CLOCK_BYTES: Final = CONSTANTS.by_key("CLOCK_BYTES")
"""Datagram of distributed clocks, which each master adds to them."""
STATE_CHECK_BYTES: Final = CONSTANTS.by_key("STATE_CHECK_BYTES")
"""Datagram for each device, by master: it reads the state of all devices in every cycle."""
PIPELINE_CYCLES: Final = CONSTANTS["PIPELINE_CYCLES"]
SYNC_SHIFT: Final = CONSTANTS["SYNC_SHIFT"]

_BOTH_WAYS: Final = 2


def datagram_bytes(data_bytes: Number) -> Number:
    """Bytes of a datagram: 10 of header, its data, 2 of working counter [bytes].

    Parameters
    ----------
    data_bytes
        Its data [bytes]; float or array.

    Examples
    --------
    >>> datagram_bytes(8)
    20.0
    """
    return data_bytes + DATAGRAM_BYTES


def overhead_bytes(like: Number) -> Number:
    """Bytes of a frame on the wire without datagrams and padding: preamble, headers, check and gap [bytes].

    Parameters
    ----------
    like
        A number whose sort the result takes: float, array or traced.

    Examples
    --------
    >>> overhead_bytes(1)
    40.0
    """
    return traced_with(PREAMBLE_BYTES, like) + ETHERNET_BYTES + HEADER_BYTES + CHECK_BYTES + GAP_BYTES


def padding_bytes(datagrams_bytes: Number) -> Number:
    """Bytes that fill a frame up to the shortest one; 0 for no frame [bytes].

    Parameters
    ----------
    datagrams_bytes
        All its datagrams; 0 where there is no frame [bytes]; float or array.

    Examples
    --------
    >>> padding_bytes(20), padding_bytes(100), padding_bytes(0)
    (24.0, 0.0, 0.0)
    """
    short: Number = larger(LEAST_FRAME_BYTES - (datagrams_bytes + overhead_bytes(datagrams_bytes)), 0.0)
    return choose(datagrams_bytes > 0, short, 0.0)


def frame_bytes(datagrams_bytes: Number) -> Number:
    """Bytes of a frame on the wire: preamble, headers, datagrams, check, gap and padding [bytes].

    Parameters
    ----------
    datagrams_bytes
        All its datagrams [bytes]; float or array.

    Examples
    --------
    >>> frame_bytes(datagram_bytes(125)), frame_bytes(datagram_bytes(1)), frame_bytes(datagram_bytes(1486))
    (177.0, 84.0, 1538.0)
    """
    return datagrams_bytes + overhead_bytes(datagrams_bytes) + padding_bytes(datagrams_bytes)


def room_bytes(datagrams: int) -> float:
    """Most process data of a frame with a number of datagrams [bytes].

    Parameters
    ----------
    datagrams
        Number of its datagrams [1].

    Examples
    --------
    >>> room_bytes(1), room_bytes(2)
    (1486.0, 1474.0)
    """
    return plain(MOST_FRAME_BYTES - plain(overhead_bytes(1)) - datagrams * DATAGRAM_BYTES)


def sending_us(wire_bytes: Number) -> Number:
    """Time of some bytes on the wire [us].

    Parameters
    ----------
    wire_bytes
        The bytes [bytes]; float or array.

    Examples
    --------
    >>> sending_us(100)
    8.0
    """
    return wire_bytes * BYTE_US


def cable_us(cable_length_m: Number) -> Number:
    """Time that a cable takes there and back [us].

    Parameters
    ----------
    cable_length_m
        Its length [m]; float or array.

    Examples
    --------
    >>> cable_us(100)
    1.0
    """
    return _BOTH_WAYS * cable_length_m * CABLE_US_PER_M


def device_us(delay_us: Number) -> Number:
    """Time that a device takes there and back [us].

    Parameters
    ----------
    delay_us
        Its delay one way [us]; float or array.

    Examples
    --------
    >>> device_us(0.5)
    1.0
    """
    return _BOTH_WAYS * delay_us


FRAME: Final = "IEEE 802.3, ETG.1000"

_FIGURES: Final = read_figures("busplan.buses.ethercat")
OWN: Final = _FIGURES["own"]
MEAN: Final = OWN[-1]
TERMS: Final = _FIGURES["terms"]
LATENCY_TABLE: Final = _FIGURES["latency"]
FIGURES: Final = BusFigures(
    TERMS,
    added=OWN,
    table=OWN[:-1],
    compared=OWN[:-1],
    planned=("frames",),
    latency_rows=LATENCY_TABLE,
    has_many_transactions=True,
)
