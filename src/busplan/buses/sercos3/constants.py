"""Figures of SERCOS III, each with its source and grade."""

from math import sqrt
from typing import Final, Literal

from busplan.buses import sercos
from busplan.buses.limits import Periods
from busplan.sourced import Sourced, constants

Version = Literal["V1.0", "V1.1"]
TimingMethod = Literal["mdt-at-ucc", "mdt-ucc-at", "at-last"]
HotPlug = Literal["first", "all"]

_COSEMA: Final = "CoSeMa V6.1, the common SERCOS master library"
_PAGE: Final = "sercos.com, performance of SERCOS III"


def _bytes(value: int, meaning: str) -> Sourced:
    return Sourced(value, unit="bytes", grade="published", source=_COSEMA, meaning=meaning)


def _us(value: float, meaning: str, *, symbol: str = "") -> Sourced:
    return Sourced(value, unit="us", grade="published", source=_COSEMA, meaning=meaning, symbol=symbol)


BYTE_US: Final = _us(0.08, "time of a byte at 100 Mbit/s", symbol="t_byte")
OVERHEAD_BYTES: Final = _bytes(32, "preamble 8, addresses 12, type 2, header 6 and check sequence 4 of a telegram")
HEADER_US: Final = _us(2.24, "from the preamble to the end of the header, 28 bytes", symbol="t_TH")
LEAST_BYTES: Final = _bytes(40, "least data of a telegram; less is padded")
MOST_BYTES: Final = _bytes(1494, "most data of a telegram")
HOT_PLUG_BYTES: Final = _bytes(8, "hot-plug field")
EXTENDED_BYTES: Final = _bytes(4, "extended function field of the first MDT")
ALIGNED_BYTES: Final = _bytes(
    2, "more of it where every telegram has a hot-plug field, before V1.3 of the specification"
)
CHANNEL_BYTES: Final = _bytes(6, "service channel of a device")
DEVICE_BYTES: Final = _bytes(2, "control, or status, of a device")
CONNECTION_BYTES: Final = _bytes(2, "connection control of a device's cyclic data, from V1.1 on")
MOST_TELEGRAMS: Final = Sourced(
    4, unit="1", grade="published", source=_COSEMA, meaning="MDT, and as many AT, of a cycle"
)
MOST_DEVICES: Final = Sourced(511, unit="1", grade="published", source="sercos.com; CoSeMa", meaning="devices")
DEFAULT_GAP_BYTES: Final = _bytes(37, "gap between telegrams that every device takes")
LEAST_GAP_BYTES: Final = _bytes(12, "least gap between telegrams, that of Ethernet")
DEVICE_DELAY_US: Final = _us(0.9, "delay of a device, one way", symbol="t_dev")
COMPONENT_DELAY_US: Final = _us(1.8, "delay of all components in the ring that are no devices", symbol="t_comp")
MASTER_JITTER_US: Final = Sourced(
    1.0, unit="us", grade="published", source=f"{_PAGE}: a sub-microsecond jitter", meaning="jitter of the master"
)
MASTER_DELAY_US: Final = _us(2.56, "from the start of a cycle in the master to the end of the first header")
CHANNEL_US: Final = _us(0.4, "time of the master's hardware for a service channel")
HARDWARE_CHANNELS: Final = Sourced(
    32, unit="1", grade="published", source=_COSEMA, meaning="service channels that its hardware serves"
)
DEVICE_DELAY_SHARE: Final = Sourced(
    0.4 / sqrt(12) / 0.9,
    unit="1",
    grade="derived",
    source=f"{_COSEMA}: 0.5 to 0.9 us, typically",
    meaning="standard uncertainty of the delay of a device, as a share of it",
)
MASTER_JITTER_SHARE: Final = Sourced(
    1 / sqrt(12),
    unit="1",
    grade="derived",
    source=f"{_PAGE}: anything below it",
    meaning="standard uncertainty of the master's jitter, as a share of it",
)
GAP_SHARE: Final = Sourced(
    25 / sqrt(12) / 37,
    unit="1",
    grade="derived",
    source=f"{_COSEMA}: 12 to 37 bytes",
    meaning="standard uncertainty of the gap between two telegrams, as a share of it",
)
LEAST_UCC_US: Final = _us(125.0, "shortest channel for other frames that the master opens")

_STEP_US: Final = 250
_LONGEST_US: Final = 65_000
PERIODS: Final = Periods((31.25, 62.5, 125.0, *map(float, range(_STEP_US, _LONGEST_US + 1, _STEP_US))))
"""Communication periods, CSMD_TSCYC of CoSeMa."""
PERIODS_SOURCE: Final = f"31.25, 62.5 and 125 us, and multiples of 250 us up to 65 ms ({_COSEMA})"

CONSTANTS: Final = {**sercos.CONSTANTS, **constants(globals())}
