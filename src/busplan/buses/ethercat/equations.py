"""EtherCAT in equations: sourced constants, lengths and times of frames, and the figures made of them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from busplan.buses.figure import NONPERIODIC, BusFigures, Figure
from busplan.buses.published import Spread, published, rows_of
from busplan.elementwise import Number, choose, larger, plain, traced_with
from busplan.sourced import Grade, Sourced, constants

Port = Literal["100BASE-TX", "E-bus"]
ProcessData = Literal["LRW-separate", "LRW-shared", "LRD-LWR"]
SEPARATE: Final[ProcessData] = "LRW-separate"
SHARED: Final[ProcessData] = "LRW-shared"
SPLIT: Final[ProcessData] = "LRD-LWR"
Master = Literal["SOEM", "IgH", "ethercrab", "TwinCAT", "acontis"]
UNNAMED: Final = "unnamed"
"""The master of a profile that names none."""

_ETHERNET: Final = "IEEE 802.3"
_ETG: Final = "ETG.1000; SOEM, ethercattype.h"
_MEASURED: Final = published("ethercat")["delays"]
_COPIES: Final = "round trips of 72 to 1064 bytes in three captures of SOEM, dumps of ethercrab"


def _bytes(value: int, meaning: str, source: str) -> Sourced:
    return Sourced(value, unit="bytes", grade="published", source=source, meaning=meaning)


def _delay(spread: Spread, port: str, source: str) -> tuple[Sourced, Sourced]:
    """The mean delay of the devices of a port, and the standard uncertainty of a further kind of device."""
    mean = Sourced(
        spread.mean,
        unit="us",
        grade="measured",
        source=f"{source}, their mean",
        meaning=f"one-way delay of a device with {port} ports",
    )
    doubt = Sourced(
        spread.uncertainty,
        unit="us",
        grade="derived",
        source=f"{source}, their sd sqrt(1 + 1/n)",
        meaning=f"standard uncertainty of the delay of all {port} devices of a machine, one way",
    )
    return mean, doubt


BYTE_US: Final = Sourced(
    0.08, unit="us", grade="published", source="acontis, cycle time calculator", meaning="time of a byte at 100 Mbit/s"
)
PREAMBLE_BYTES: Final = _bytes(8, "preamble and start of a frame", _ETHERNET)
ETHERNET_BYTES: Final = _bytes(14, "Ethernet header: two addresses and the type", _ETHERNET)
CHECK_BYTES: Final = _bytes(4, "frame check sequence", _ETHERNET)
GAP_BYTES: Final = _bytes(12, "gap after a frame", _ETHERNET)
HEADER_BYTES: Final = _bytes(2, "EtherCAT header of a frame", _ETG)
DATAGRAM_BYTES: Final = _bytes(12, "header of a datagram, 10, and its working counter, 2", _ETG)
LEAST_FRAME_BYTES: Final = _bytes(84, "shortest frame on the wire, gap included; shorter ones are padded", _ETHERNET)
MOST_FRAME_BYTES: Final = _bytes(1538, "longest frame on the wire, gap included", _ETHERNET)
MAILBOX_BYTES: Final = _bytes(128, "data of a mailbox", "Lenze, communication manual E84AYCET: at most 128")
MOST_DEVICES: Final = Sourced(
    65535, unit="1", grade="published", source="ETG.1000: addresses of 16 bits", meaning="devices of one segment"
)
MOST_CABLE_M: Final = Sourced(
    100, unit="m", grade="published", source=_ETHERNET, meaning="longest cable of 100BASE-TX between two devices"
)
CABLE_US_PER_M: Final = Sourced(
    0.005, unit="us/m", grade="published", source="SOEM issue 585: 5 ns/m", meaning="delay of a metre of cable"
)
_TX, _TX_DOUBT = _delay(Spread.of(_MEASURED["tx_one_way_us"]), "100BASE-TX", _MEASURED["source"])
_EBUS, _EBUS_DOUBT = _delay(
    Spread(_MEASURED["e_bus_one_way_us"], _MEASURED["e_bus_uncertainty_us"]), "E-bus", _MEASURED["source"]
)
DELAY_US: Final[Mapping[Port, Sourced]] = MappingProxyType({"100BASE-TX": _TX, "E-bus": _EBUS})
DELAY_UNCERTAINTY_US: Final[Mapping[Port, Sourced]] = MappingProxyType({"100BASE-TX": _TX_DOUBT, "E-bus": _EBUS_DOUBT})
MEASURED_DELAY_UNCERTAINTY_US: Final = Sourced(
    0.010 / 12**0.5,
    unit="us",
    grade="derived",
    source="a step of 10 ns of the devices' clocks, rectangular (JCGM 100, 4.3.7)",
    meaning="standard uncertainty of a measured delay, each device by itself",
)
_PER_BYTE: Final = Spread.of([row["published"] for row in rows_of("ethercat", "bytes")])
BYTE_BIAS_US: Final = Sourced(
    _PER_BYTE.mean - BYTE_US,
    unit="us",
    grade="derived",
    source=f"{_COPIES}, their mean less the time on the wire",
    meaning="what a byte of process data takes beyond the wire, about a copy in the host",
)
BYTE_BIAS_UNCERTAINTY_US: Final = Sourced(
    _PER_BYTE.uncertainty,
    unit="us",
    grade="derived",
    source=f"{_COPIES}, their sd sqrt(1 + 1/n)",
    meaning="standard uncertainty of that, all bytes together",
)
UNMEASURED_MASTER_SHARE: Final = Sourced(
    0.5,
    unit="1",
    grade="assumed",
    source="chosen: published times of like hosts differ by as much",
    meaning="standard uncertainty of a master's time that nobody has measured, as a share of it",
)


def _by_master(datagrams: str) -> Mapping[str, Sourced]:
    """Datagrams that each master adds to a frame, headers and working counters included [bytes]."""
    return MappingProxyType({name: _datagrams(**of[datagrams]) for name, of in _MASTERS.items() if datagrams in of})


def _datagrams(commands: str, sizes: list[int], source: str, grade: Grade = "published") -> Sourced:
    meaning = f"datagrams of the master: {commands}, data {' + '.join(map(str, sizes)) or '0'}"
    value = sum(sizes) + len(sizes) * DATAGRAM_BYTES
    return Sourced(value, unit="bytes", grade=grade, source=source, meaning=meaning)


_MASTERS: Final = published("ethercat")["masters"]
LAYOUTS: Final[Mapping[str, ProcessData]] = MappingProxyType(
    {name: master["process_data"] for name, master in _MASTERS.items()}
)
"""Layout of the process data by master."""
HOUSEKEEPING_BYTES: Final = _by_master("every_cycle")
"""Datagrams that each master adds to the first frame of every cycle, without that of distributed clocks."""
CLOCK_BYTES: Final = _by_master("clocks")
"""Datagram of distributed clocks, which each master adds to them."""
STATE_CHECK_BYTES: Final = _by_master("every_device")
"""Datagram for each device, by master: it reads the state of all devices in every cycle."""
PIPELINE_CYCLES: Final = Sourced(
    1,
    unit="1",
    grade="assumed",
    source="chosen: a frame that brings feedback cannot take the command computed from it",
    meaning="cycles from the frame that brings feedback to the one that takes the command computed from it",
)
SYNC_SHIFT: Final = Sourced(
    0.5,
    unit="1",
    grade="assumed",
    source="chosen: the middle of the cycle",
    meaning="where SYNC0 of the distributed clocks lies after the master's task, as a share of the period",
)

CONSTANTS: Final = constants({key: value for key, value in globals().items() if not key.startswith("_")})


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


def cable_us(cable_m: Number) -> Number:
    """Time that a cable takes there and back [us].

    Parameters
    ----------
    cable_m
        Its length [m]; float or array.

    Examples
    --------
    >>> cable_us(100)
    1.0
    """
    return _BOTH_WAYS * cable_m * CABLE_US_PER_M


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

FRAMES: Final = Figure("frames", "F", FRAME, "frames of process data in a cycle", "frames", sort="count", better="less")
PROCESS: Final = Figure(
    "process_bytes", "D", "profile", "process data of all devices", "process data", sort="count", better="less"
)
COMMAND: Final = Figure(
    "command_us",
    "t_cmd",
    "profile",
    "when the last device has taken its command at the latest, from the master's task",
    "last command taken",
    better="less",
)
SYNC0: Final = Figure(
    "sync0_us", "t_sync", "profile", "the first SYNC0 of the distributed clocks after the master's task", "SYNC0"
)
MEAN: Final = Figure(
    "mean_utilisation",
    "U_mean",
    "profile",
    "share of the slice that the mean cycle uses, 0..1; the fullest uses more where groups have every > 1",
    "mean load",
    "%",
    decimals=2,
    better="less",
)
OWN: Final = (FRAMES, PROCESS, COMMAND, SYNC0, MEAN)
TERMS: Final = (
    Figure("cycle_master_us", "T_master", "profile", "the master's own time", "master", ink="contention", letter="M"),
    Figure(
        "cycle_jitter_us",
        "J",
        "profile",
        "how late the frames may start",
        "master's jitter",
        ink="contention",
        letter="J",
    ),
    Figure(
        "cycle_frames_us",
        "frames",
        FRAME,
        "preambles, headers, checks, gaps and padding of the frames, and the master's own datagrams",
        "frame overhead",
        ink="gap",
        letter="F",
    ),
    Figure("cycle_data_us", "data", FRAME, "process data of all devices", "process data", ink="out", letter="D"),
    Figure("cycle_mailbox_us", "mailbox", FRAME, "frames of mailbox polls", "mailbox", ink="acknowledge", letter="B"),
    Figure(
        "cycle_devices_us",
        "devices",
        "DC time stamps",
        "delay of all devices, there and back",
        "devices",
        ink="work",
        letter="H",
    ),
    Figure("cycle_cable_us", "cables", "SOEM", "delay of all cables, there and back", "cables", ink="sync", letter="L"),
    Figure(
        "cycle_receive_us",
        "receive",
        "acontis",
        "the last frame once more, as vendors count its reception",
        "receiving again",
        ink="in",
        letter="R",
    ),
    NONPERIODIC,
)
"""In the order of the wire."""

LATENCY_TABLE: Final = (
    Figure("drive_us", "T_exec", "profile", "the device's own time", "device"),
    Figure("frame_wait_us", "wait", "profile", "wait of feedback for the next frame", "wait for a frame"),
    Figure("pipeline_us", "n T_s", "profile", "cycles that the master computes in", "master's pipeline"),
    Figure("master_us", "T_master", "profile", "the master's own time for a frame", "master"),
    Figure("jitter_us", "J", "profile", "how late the frame may start", "jitter"),
    Figure("sending_us", "sending", FRAME, "all frames of process data on the wire", "sending"),
    Figure("path_us", "path", "DC time stamps", "delay of devices and cables on the way", "devices and cables"),
    Figure(
        "sync_wait_us", "SYNC0", "profile", "wait of a command for SYNC0 of the distributed clocks", "wait for SYNC0"
    ),
    Figure("end_to_end_us", "L", "profile", "all of it", "end to end", better="less"),
)
"""In the order in which they add up."""
FIGURES: Final = BusFigures(
    TERMS,
    added=OWN,
    table=OWN[:-1],
    compared=OWN[:-1],
    planned=(FRAMES.key,),
    latency_rows=LATENCY_TABLE,
    has_many_transactions=True,
)
