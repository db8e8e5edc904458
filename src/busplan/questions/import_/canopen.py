"""CANopen EDS and DCF (CiA 306): PDOs with identifiers, mapping and transmission type, SYNC, heartbeat, node-ID."""

import re
from collections.abc import Iterator
from math import ceil
from typing import Final, NamedTuple

from busplan.questions.import_.eni import CONTROL_WORDS, axes_fact
from busplan.questions.import_.reading import Fact, Reading

_SECTION: Final = re.compile(r"\s*\[([^\]\n]{1,100})\]\s*$")
_VALUE: Final = re.compile(r"\s*([^=;\n]{1,100}?)\s*=\s*(.*?)\s*$")
_NUMBER: Final = re.compile(r"(?:\$NODEID\s*\+\s*)?(0x[0-9a-f]{1,8}|[0-9]{1,10})(?:\s*\+\s*\$NODEID)?", re.IGNORECASE)
_TPDO, _RPDO, _MAPPING, _MOST_PDOS = 0x1800, 0x1400, 0x200, 512
_SYNC_ID, _SYNC_PERIOD, _HEARTBEAT, _SYNC_COUNTER = 0x1005, 0x1006, 0x1017, 0x1019
_INVALID: Final = 1 << 31
_EXTENDED: Final = 1 << 29
_IDENTIFIER: Final = (1 << 11) - 1
_EVERY_SYNC, _LAST_SYNC_TYPE, _NO_SYNC_TYPE = 1, 240, 0
_MOST_NODE: Final = 127
_MOST_MAPPED: Final = 64
_INHIBIT_US: Final = 100

_Sections = dict[str, dict[str, tuple[str, int]]]


class Pdo(NamedTuple):
    """A PDO that is sent."""

    identifier: int
    payload_bytes: int
    every: int
    """Sent with every n-th SYNC; 0 where an event sends it."""
    period_us: float
    """Shortest time between two frames that events send; 0 where it is not known."""
    timer: str
    """Timer that gives that time, in words for a comment."""
    place: str
    name: str


def read(text: str, name: str) -> Reading:
    """Read an EDS or DCF.

    Raises
    ------
    BusplanError
        A number is none, or it is a device without PDOs; with its line.
    """
    sections = _sections(text)
    setup = sections.get("devicecomissioning") or sections.get("devicecommissioning") or {}
    is_set = "nodeid" in setup
    machine = Reading("can", "DCF" if is_set else "EDS", name, rank=0, lists_all=False)
    device = _Device(sections, machine)
    node, line = device.number(setup, "nodeid") or (1, 1)
    if not 1 <= node <= _MOST_NODE:
        raise machine.refusal(line, f"NodeID {node}: expected 1 to {_MOST_NODE}")
    device.node = node
    facts = machine.nodes[node] = {}
    title, place = setup.get("nodename") or sections.get("deviceinfo", {}).get("productname") or ("node", 1)
    facts["name"] = Fact(title or "node", machine.place(place))
    given = Fact(node, machine.place(line), note="") if is_set else Fact(node, "", "assumed", "an EDS has no node-ID")
    facts["node_id"] = given
    if rate := device.number(setup, "baudrate"):
        machine.bus["bit_rate_kbit_s"] = Fact(rate[0], machine.place(rate[1]))
    words: dict[int, int] = {}
    facts["feedback"] = Fact(tuple(device.pdos(_TPDO, {})), machine.place(1))
    facts["command"] = Fact(tuple(device.pdos(_RPDO, words)), machine.place(1))
    facts["axes"] = axes_fact(words, machine, line=1)
    if not facts["feedback"].value and not facts["command"].value:
        raise machine.refusal(1, "no PDO that is sent and has a mapping")
    _bus(device, machine)
    if (beat := device.value(_HEARTBEAT, None)) and beat[0]:
        facts["heartbeat_us"] = Fact(beat[0] * 1000, machine.place(beat[1]))
    if not is_set:
        machine.remarks.append(f"{name}: an EDS has the defaults of a device, a DCF what it is set to")
    return machine


def _bus(device: "_Device", machine: Reading) -> None:
    if (period := device.value(_SYNC_PERIOD, None)) and period[0]:
        machine.bus["period_us"] = Fact(period[0], machine.place(period[1]))
    if sync := device.value(_SYNC_ID, None):
        machine.bus["sync_identifier"] = Fact(sync[0] & _IDENTIFIER, machine.place(sync[1]))
    if (counter := device.value(_SYNC_COUNTER, None)) and counter[0] > 1:
        machine.bus["sync_counter"] = Fact(True, machine.place(counter[1]))


class _Device:
    """The objects of a device."""

    def __init__(self, sections: _Sections, machine: Reading) -> None:
        self.sections, self.machine, self.node = sections, machine, 1

    def number(self, section: dict[str, tuple[str, int]], key: str) -> tuple[int, int] | None:
        """A number and its line; None where it is missing or empty."""
        text, line = section.get(key, ("", 0))
        if not text:
            return None
        match = _NUMBER.fullmatch(text)
        if match is None:
            raise self.machine.refusal(line, f"{key} {text[:40]!r}: expected a number, as 0x180 or $NODEID+0x180")
        return int(match[1], 0) + self.node * ("$nodeid" in text.lower()), line

    def value(self, index: int, sub: int | None) -> tuple[int, int] | None:
        """Value that an object is set to, else its default."""
        section = self.sections.get(f"{index:x}" if sub is None else f"{index:x}sub{sub:x}", {})
        return self.number(section, "parametervalue") or self.number(section, "defaultvalue")

    def pdos(self, first: int, words: dict[int, int]) -> Iterator[Pdo]:
        """The PDOs of a direction that are sent; lines of control words go into `words`."""
        direction = "TPDO" if first == _TPDO else "RPDO"
        for number in range(_MOST_PDOS):
            identifier = self.value(first + number, 1)
            if identifier is None or identifier[0] & _INVALID:
                continue
            size = self._mapped_bytes(first + _MAPPING + number, words)
            if not size:
                continue
            if identifier[0] & _EXTENDED:
                raise self.machine.refusal(identifier[1], "a PDO of 29 bits; a profile's PDOs have 11")
            kind = (self.value(first + number, 2) or (_NO_SYNC_TYPE, 0))[0]
            every = kind if _EVERY_SYNC <= kind <= _LAST_SYNC_TYPE else 0
            inhibit = self.value(first + number, 3)
            event = self.value(first + number, 5)
            us, timer = event[0] * 1000 if event else 0, "event timer; without an inhibit time it may come sooner"
            if inhibit and inhibit[0]:
                us, timer = inhibit[0] * _INHIBIT_US, "inhibit time"
            place = self.machine.place(identifier[1])
            yield Pdo(identifier[0] & _IDENTIFIER, size, every, us, timer, place, f"{direction}{number + 1}")

    def _mapped_bytes(self, index: int, words: dict[int, int]) -> int:
        count = self.value(index, 0) or (0, 0)
        if count[0] > _MOST_MAPPED:
            raise self.machine.refusal(count[1], f"{count[0]} mapped objects: expected 0 to {_MOST_MAPPED}")
        bits = 0
        for sub in range(1, count[0] + 1):
            entry = self.value(index, sub)
            if entry:
                bits += entry[0] & 0xFF
                if entry[0] >> 16 in CONTROL_WORDS:
                    words.setdefault(entry[0] >> 16, entry[1])
        return ceil(bits / 8)


def _sections(text: str) -> _Sections:
    """Keys and values of each section with their lines; names without case."""
    sections: _Sections = {}
    own: dict[str, tuple[str, int]] = {}
    for line, content in enumerate(text.split("\n"), start=1):
        if match := _SECTION.match(content):
            own = sections.setdefault(match[1].strip().lower(), {})
        elif match := _VALUE.match(content):
            own.setdefault(match[1].lower(), (match[2], line))
    return sections
