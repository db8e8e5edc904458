"""EtherCAT in equations: sourced constants, lengths and times of frames, and the figures made of them.

Each parameter is a float or an array, and so is the result.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

from busplan.buses.figure import BusFigures, OwnFigures, read_figures
from busplan.buses.published import Spread, data_file, rows_of
from busplan.elementwise import Number, choose, larger
from busplan.sourced import Constants

Port = Literal["100BASE-TX", "E-bus"]
ProcessData = Literal["LRW-separate", "LRW-shared", "LRD-LWR"]
SEPARATE: Final[ProcessData] = "LRW-separate"
SHARED: Final[ProcessData] = "LRW-shared"
SPLIT: Final[ProcessData] = "LRD-LWR"
Starts = Literal["datagram", "frame"]
Master = Literal["SOEM", "IgH", "ethercrab", "TwinCAT", "acontis"]
UNNAMED: Final = "unnamed"
"""Name of the master in a profile that names none."""

LAYOUTS: Final[Mapping[str, ProcessData]] = MappingProxyType(
    {"SOEM": SEPARATE, "IgH": SEPARATE, "ethercrab": SEPARATE, "TwinCAT": SHARED, "acontis": SHARED, UNNAMED: SEPARATE}
)
"""Layout of the process data, by master."""

c: Final = Constants("busplan.buses.ethercat")
"""Constants with a source, by their names."""

_TX: Final = Spread.of(data_file("ethercat")["delays"]["tx_one_way_us"])
c.computed("DELAY_US[100BASE-TX]", lambda _: _TX.mean)
c.computed("DELAY_UNCERTAINTY_US[100BASE-TX]", lambda _: _TX.uncertainty)
c.computed("MEASURED_DELAY_UNCERTAINTY_US", lambda _: 0.010 / 12**0.5)
_PER_BYTE: Final = Spread.of([row["published"] for row in rows_of("ethercat", "bytes")])
c.computed("BYTE_BIAS_US", lambda c: _PER_BYTE.mean - c.BYTE_US)
c.computed("BYTE_BIAS_UNCERTAINTY_US", lambda _: _PER_BYTE.uncertainty)

_BOTH_WAYS: Final = 2


def datagram_bytes(data_bytes: Number) -> Number:
    """Size of a datagram: 10 of header, its data, 2 of working counter [bytes].

    Examples
    --------
    >>> datagram_bytes(8)
    20.0
    """
    return data_bytes + c.DATAGRAM_BYTES


def overhead_bytes() -> Number:
    """Bytes of a frame on the wire besides datagrams and padding: preamble, headers, check and gap [bytes].

    Examples
    --------
    >>> overhead_bytes()
    40.0
    """
    return c.PREAMBLE_BYTES + c.ETHERNET_BYTES + c.HEADER_BYTES + c.CHECK_BYTES + c.GAP_BYTES


def padding_bytes(datagrams_bytes: Number) -> Number:
    """Padding of a frame to the shortest one [bytes]; 0 where there is no frame, that is, no datagrams.

    Examples
    --------
    >>> padding_bytes(20), padding_bytes(100), padding_bytes(0)
    (24.0, 0.0, 0.0)
    """
    short: Number = larger(c.LEAST_FRAME_BYTES - (datagrams_bytes + overhead_bytes()), 0.0)
    return choose(datagrams_bytes > 0, short, 0.0)


def frame_bytes(datagrams_bytes: Number) -> Number:
    """Size of a frame on the wire: preamble, headers, datagrams, check, gap and padding [bytes].

    Examples
    --------
    >>> frame_bytes(datagram_bytes(125)), frame_bytes(datagram_bytes(1)), frame_bytes(datagram_bytes(1486))
    (177.0, 84.0, 1538.0)
    """
    return datagrams_bytes + overhead_bytes() + padding_bytes(datagrams_bytes)


def room_bytes(datagrams: int) -> float:
    """Most process data of a frame with `datagrams` datagrams [bytes].

    Examples
    --------
    >>> room_bytes(1), room_bytes(2)
    (1486.0, 1474.0)
    """
    return c.MOST_FRAME_BYTES - overhead_bytes() - datagrams * c.DATAGRAM_BYTES


def sending_us(wire_bytes: Number) -> Number:
    """Time to send `wire_bytes` [us].

    Examples
    --------
    >>> sending_us(100)
    8.0
    """
    return wire_bytes * c.BYTE_US


def cable_us(cable_length_m: Number) -> Number:
    """Time of a cable there and back [us].

    Examples
    --------
    >>> cable_us(100)
    1.0
    """
    return _BOTH_WAYS * cable_length_m * c.CABLE_US_PER_M


def device_us(delay_us: Number) -> Number:
    """Time of a device there and back, from its delay one way [us].

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


@dataclass(frozen=True)
class EthercatFigures(OwnFigures):
    """Figures of EtherCAT alone, by the keys of `FIGURES`."""

    frames: int
    process_bytes: int
    command_us: float
    sync0_us: float | None
    mean_utilisation: float
    cycle_master_us: float
    cycle_jitter_us: float
    cycle_frames_us: float
    cycle_data_us: float
    cycle_mailbox_us: float
    cycle_devices_us: float
    cycle_cable_us: float
    cycle_receive_us: float
    nonperiodic_us: float
