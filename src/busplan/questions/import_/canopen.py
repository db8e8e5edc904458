"""CANopen EDS and DCF (CiA 306): PDOs with identifiers, mapping and transmission type, SYNC, heartbeat, node-ID."""

import re
from collections.abc import Iterator
from math import ceil
from typing import Final, NamedTuple

from busplan.questions.import_.reading import ControlWords, Facts, Reading, assumed

_SECTION: Final = re.compile(r"\s*\[([^\]\n]{1,100})\]\s*$")
_VALUE: Final = re.compile(r"\s*([^=;\n]{1,100}?)\s*=\s*(.*?)\s*$")
_NUMBER: Final = re.compile(r"(?:\$NODEID\s*\+\s*)?(0x[0-9a-f]{1,8}|[0-9]{1,10})(?:\s*\+\s*\$NODEID)?", re.IGNORECASE)
_TPDO, _RPDO, _MAPPING, _MOST_PDOS = 0x1800, 0x1400, 0x200, 512
_SYNC_ID, _SYNC_PERIOD, _HEARTBEAT, _SYNC_COUNTER = 0x1005, 0x1006, 0x1017, 0x1019
_INVALID: Final = 1 << 31
_EXTENDED: Final = 1 << 29
_IDENTIFIER: Final = (1 << 11) - 1
_EVERY_SYNC, _LAST_SYNC_TYPE = 1, 240
_MOST_NODE: Final = 127
_MOST_MAPPED: Final = 64
_INHIBIT_US: Final = 100

_Section = dict[str, tuple[str, int]]
"""Text of each value, and its line."""


class _Number(NamedTuple):
    """A number of the file."""

    value: int
    line: int


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
    node = device.number(setup, "nodeid") or _Number(1, 1)
    if not 1 <= node.value <= _MOST_NODE:
        raise machine.refusal(node.line, f"NodeID {node.value}: expected 1 to {_MOST_NODE}")
    device.node, words = node.value, ControlWords()
    title, line = setup.get("nodename") or sections.get("deviceinfo", {}).get("productname") or ("node", 1)
    machine.bus = _bus(device, setup)
    facts = machine.nodes[node.value] = {
        "name": machine.fact(title or "node", line),
        "node_id": machine.fact(*node) if is_set else assumed(node.value, "an EDS has no node-ID"),
        "feedback": machine.fact(tuple(device.pdos(_TPDO, ControlWords())), 1),
        "command": machine.fact(tuple(device.pdos(_RPDO, words)), 1),
        "axes": words.axes(machine, line=1),
    }
    if not facts["feedback"].value and not facts["command"].value:
        raise machine.refusal(1, "no PDO that is sent and has a mapping")
    if (beat := device.value(_HEARTBEAT)) and beat.value:
        facts["heartbeat_us"] = machine.fact(beat.value * 1000, beat.line)
    if not is_set:
        machine.remarks.append(f"{name}: an EDS has the defaults of a device, a DCF what it is set to")
    return machine


def _bus(device: "_Device", setup: _Section) -> Facts:
    """Bit rate, period and SYNC."""
    fact, facts = device.machine.fact, {}
    if rate := device.number(setup, "baudrate"):
        facts["bit_rate_kbit_s"] = fact(*rate)
    if (period := device.value(_SYNC_PERIOD)) and period.value:
        facts["period_us"] = fact(*period)
    if sync := device.value(_SYNC_ID):
        facts["sync_identifier"] = fact(sync.value & _IDENTIFIER, sync.line)
    if (counter := device.value(_SYNC_COUNTER)) and counter.value > 1:
        facts["sync_counter"] = fact(True, counter.line)
    return facts


class _Device:
    """The objects of a device."""

    def __init__(self, sections: dict[str, _Section], machine: Reading) -> None:
        self.sections, self.machine, self.node = sections, machine, 1

    def number(self, section: _Section, key: str) -> _Number | None:
        """A number, the node-ID in it added; None where it is missing or empty."""
        text, line = section.get(key, ("", 0))
        if not text:
            return None
        match = _NUMBER.fullmatch(text)
        if match is None:
            raise self.machine.refusal(line, f"{key} {text[:40]!r}: expected a number, as 0x180 or $NODEID+0x180")
        return _Number(int(match[1], 0) + self.node * ("$nodeid" in text.lower()), line)

    def value(self, index: int, sub: int | None = None) -> _Number | None:
        """Value that an object is set to, else its default."""
        section = self.sections.get(f"{index:x}" if sub is None else f"{index:x}sub{sub:x}", {})
        return self.number(section, "parametervalue") or self.number(section, "defaultvalue")

    def pdos(self, first: int, words: ControlWords) -> Iterator[Pdo]:
        """The PDOs of a direction that are sent; control words that they have go into `words`."""
        direction = "TPDO" if first == _TPDO else "RPDO"
        for number in range(_MOST_PDOS):
            identifier = self.value(first + number, 1)
            if identifier is None or identifier.value & _INVALID:
                continue
            size = self._mapped_bytes(first + _MAPPING + number, words)
            if not size:
                continue
            if identifier.value & _EXTENDED:
                raise self.machine.refusal(identifier.line, "a PDO of 29 bits; a profile's PDOs have 11")
            kind, inhibit, event = (self.value(first + number, sub) for sub in (2, 3, 5))
            every = kind.value if kind and _EVERY_SYNC <= kind.value <= _LAST_SYNC_TYPE else 0
            us, timer = event.value * 1000 if event else 0, "event timer; without an inhibit time it may come sooner"
            if inhibit and inhibit.value:
                us, timer = inhibit.value * _INHIBIT_US, "inhibit time"
            place = self.machine.place(identifier.line)
            yield Pdo(identifier.value & _IDENTIFIER, size, every, us, timer, place, f"{direction}{number + 1}")

    def _mapped_bytes(self, index: int, words: ControlWords) -> int:
        count = self.value(index, 0) or _Number(0, 0)
        if count.value > _MOST_MAPPED:
            raise self.machine.refusal(count.line, f"{count.value} mapped objects: expected 0 to {_MOST_MAPPED}")
        bits = 0
        for sub in range(1, count.value + 1):
            if entry := self.value(index, sub):
                bits += entry.value & 0xFF
                words.add(entry.value >> 16, entry.line)
        return ceil(bits / 8)


def _sections(text: str) -> dict[str, _Section]:
    """Keys and values of each section with their lines; names without case."""
    sections: dict[str, _Section] = {}
    section: _Section = {}
    for line, content in enumerate(text.split("\n"), start=1):
        if match := _SECTION.match(content):
            section = sections.setdefault(match[1].strip().lower(), {})
        elif match := _VALUE.match(content):
            section.setdefault(match[1].lower(), (match[2], line))
    return sections
