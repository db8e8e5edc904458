"""Figures of classical CAN, of CAN FD and of a CANopen cycle, each with its source and grade."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from busplan.sourced import Sourced, constants

BIT_RATES: Final = (10, 20, 50, 125, 250, 500, 800, 1000)
"""Bit rates that CiA 301 names [kbit/s]."""
LEAST_BIT_RATE, MOST_BIT_RATE = 5, 1000
"""Bit rates of transceivers and of the standard, any between them [kbit/s]."""
DATA_BIT_RATES: Final = (1000, 2000, 4000, 5000, 8000)
"""Data bit rates that transceivers of CAN FD are made for, up to those of CiA 601-4 [kbit/s]."""
MOST_DATA_BIT_RATE: Final = DATA_BIT_RATES[-1]
"""Largest data bit rate of CAN FD [kbit/s]."""
IdentifierBits = Literal[11, 29]

_DAVIS: Final = "Davis, Burns, Bril, Lukkien 2007; linux-can/can-utils, canframelen"
_ISO: Final = "ISO 11898-1:2015, CAN FD frame with bit-rate switch"
_CIA_301: Final = "CiA 301, pre-defined connection set; esd C.3032.21, 8.5"


def _bits(value: int, meaning: str, *, symbol: str = "", source: str = _DAVIS) -> Sourced:
    return Sourced(value, unit="bits", grade="published", source=source, meaning=meaning, symbol=symbol)


def _identifier(value: int, meaning: str) -> Sourced:
    return Sourced(value, unit="1", grade="published", source=_CIA_301, meaning=meaning)


BASE_BITS: Final = 11
"""Identifier bits of the base format, CAN 2.0A; the extended format, 2.0B, has 29."""
STUFFED_BITS: Final = _bits(34, "bits of a base frame without data that may be stuffed", symbol="g")
STUFFED_BITS_EXTENDED: Final = _bits(54, "bits of an extended frame without data that may be stuffed", symbol="g")
FIXED_BITS: Final = _bits(13, "bits that are never stuffed: delimiters, acknowledge, end of frame, space of 3 bits")
STUFF_STEP_BITS: Final = _bits(4, "bits for each stuff bit in the worst case, behind the first")
BITS_PER_BYTE: Final = Sourced(8, unit="bits", grade="published", source="definition", meaning="bits of a byte")
FRAME_BYTES: Final = Sourced(
    8, unit="bytes", grade="published", source="CAN 2.0, DLC 0..8", meaning="most data of one frame"
)

FD_OPENING_BITS: Final = _bits(17, "bits of an FD base frame up to the switch of bit rate", symbol="a", source=_ISO)
FD_OPENING_BITS_EXTENDED: Final = _bits(
    36, "bits of an FD extended frame up to the switch of bit rate", symbol="a", source=_ISO
)
FD_CLOSING_BITS: Final = _bits(
    12, "bits of an FD frame at the nominal bit rate behind its CRC: acknowledge, end of frame, space of 3", source=_ISO
)
FD_CONTROL_BITS: Final = _bits(5, "bits before the data of an FD frame: ESI and DLC", source=_ISO)
FD_COUNT_BITS: Final = _bits(4, "stuff count of an FD frame", source=_ISO)
FD_CRC_BITS: Final = _bits(17, "CRC of an FD frame of up to 16 bytes", symbol="crc", source=_ISO)
FD_LONG_CRC_BITS: Final = _bits(21, "CRC of a longer FD frame", symbol="crc", source=_ISO)
FD_SHORT_BYTES: Final = Sourced(
    16, unit="bytes", grade="published", source=_ISO, meaning="most data of an FD frame with the short CRC"
)
FD_DELIMITER_BITS: Final = _bits(1, "CRC delimiter of an FD frame", source=_ISO)
FD_FRAME_BYTES: Final = Sourced(64, unit="bytes", grade="published", source=_ISO, meaning="most data of one FD frame")
FD_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Lengths that the DLC of an FD frame can say; other data is padded to the next [bytes]."""

MAX_IDENTIFIER: Final[Mapping[int, int]] = MappingProxyType({11: (1 << 11) - 1, 29: (1 << 29) - 1})

SYNC_IDENTIFIER: Final = _identifier(0x80, "identifier of SYNC")
FEEDBACK_IDENTIFIER: Final = _identifier(0x181, "identifier of TPDO1 of node 1, 180h + node-ID")
COMMAND_IDENTIFIER: Final = _identifier(0x201, "identifier of RPDO1 of node 1, 200h + node-ID")
PDO_STEP: Final = _identifier(0x100, "from the identifier of a PDO to that of the next PDO of the same node")
MOST_PDOS: Final = _identifier(4, "PDOs of one node in one direction")
MOST_NODES: Final = _identifier(127, "node-IDs")
MOST_EVERY: Final = Sourced(
    240,
    unit="1",
    grade="published",
    source="CiA 301, transmission types",
    meaning="SYNCs from a PDO to the next, at most",
)

PIPELINE_CYCLES: Final = Sourced(
    0,
    unit="1",
    grade="assumed",
    source="chosen: commands follow the feedback that they rest on, in one cycle",
    meaning="cycles from the one that brings feedback to the one that takes the command computed from it",
)
UNMEASURED_SHARE: Final = Sourced(
    0.5,
    unit="1",
    grade="assumed",
    source="chosen: the host's time of like machines differs by ten times",
    meaning="standard uncertainty of a host's time that nobody has measured, as a share of it",
)
MOST_BLOCKS: Final = Sourced(
    3,
    unit="1",
    grade="derived",
    source="one frame before SYNC, before the last feedback, and before the commands",
    meaning="frames of a lower priority that a cycle waits for, at most",
)

MAX_LOAD: Final = Sourced(
    0.8, unit="1", grade="published", source="Lenze system-bus manual", meaning="largest bus load of a plan"
)
SATURATED: Final = Sourced(
    0.9999,
    unit="1",
    grade="assumed",
    source="chosen: a load so near 1 has a busy period without use",
    meaning="load from which on no response time is computed",
)
MOST_STEPS: Final = Sourced(
    2000,
    unit="1",
    grade="assumed",
    source="chosen: a bus below a load of 0.9 takes some ten",
    meaning="steps of a busy period from which on no response time is computed",
)
EXPECTED_STUFFING: Final = Sourced(
    0.4,
    unit="1",
    grade="calibrated",
    source="bits that hardware counted (python-can's logs), and the load of a log at 500 kbit/s: within 4 %",
    meaning="share of the possible stuff bits that frames have",
)

CONSTANTS: Final = constants(globals())
