"""Figures of EtherCAT at 100 Mbit/s, each with its source and grade."""

from collections.abc import Mapping
from math import sqrt
from types import MappingProxyType
from typing import Final, Literal

from busplan.sourced import Grade, Sourced, constants

Port = Literal["100BASE-TX", "E-bus"]
Command = Literal["LRW", "LRD-LWR"]
LRW: Final[Command] = "LRW"
SPLIT: Final[Command] = "LRD-LWR"

_ETHERNET: Final = "IEEE 802.3"
_ETG: Final = "ETG.1000; SOEM, ethercattype.h"
_ETHERCRAB: Final = "time stamps of distributed clocks in the tests of ethercrab"


def _bytes(value: int, meaning: str, source: str) -> Sourced:
    return Sourced(value, unit="bytes", grade="published", source=source, meaning=meaning)


def _delay(least_us: float, most_us: float, port: str) -> tuple[Sourced, Sourced]:
    """The middle of a range of delays, and its standard uncertainty."""
    said = f"{_ETHERCRAB}: {least_us:g} to {most_us:g} us"

    def of(value: float, grade: Grade, source: str, meaning: str) -> Sourced:
        return Sourced(value, unit="us", grade=grade, source=source, meaning=meaning)

    middle = of((least_us + most_us) / 2, "measured", f"{said}, the middle", f"delay of a device with {port}, one way")
    half_us = (most_us - least_us) / 2
    source = f"{said}, rectangular (JCGM 100, 4.3.7)"
    return middle, of(half_us / sqrt(3), "derived", source, f"standard uncertainty of the delay with {port}")


BYTE_US: Final = Sourced(
    0.08, unit="us", grade="published", source="acontis, cycle time calculator", meaning="time of a byte at 100 Mbit/s"
)
PREAMBLE_BYTES: Final = _bytes(8, "preamble and start of a frame", _ETHERNET)
ETHERNET_BYTES: Final = _bytes(14, "Ethernet header: two addresses and the type", _ETHERNET)
CHECK_BYTES: Final = _bytes(4, "frame check sequence", _ETHERNET)
GAP_BYTES: Final = _bytes(12, "gap behind a frame", _ETHERNET)
HEADER_BYTES: Final = _bytes(2, "EtherCAT header of a frame", _ETG)
DATAGRAM_BYTES: Final = _bytes(12, "header of a datagram, 10, and its working counter, 2", _ETG)
LEAST_FRAME_BYTES: Final = _bytes(84, "shortest frame on the wire, gap included; shorter ones are padded", _ETHERNET)
MOST_FRAME_BYTES: Final = _bytes(1538, "longest frame on the wire, gap included", _ETHERNET)
CLOCK_BYTES: Final = _bytes(8, "system time that the datagram of distributed clocks carries", "SOEM, ethercatmain.c")
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
_TX, _TX_DOUBT = _delay(0.485, 0.725, "100BASE-TX")
_EBUS, _EBUS_DOUBT = _delay(0.145, 0.155, "E-bus")
DELAY_US: Final[Mapping[Port, Sourced]] = MappingProxyType({"100BASE-TX": _TX, "E-bus": _EBUS})
DELAY_UNCERTAINTY_US: Final[Mapping[Port, Sourced]] = MappingProxyType({"100BASE-TX": _TX_DOUBT, "E-bus": _EBUS_DOUBT})
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
    meaning="where SYNC0 of the distributed clocks lies in the cycle, as a share of the period",
)

CONSTANTS: Final = constants({key: one for key, one in globals().items() if not key.startswith("_")})
