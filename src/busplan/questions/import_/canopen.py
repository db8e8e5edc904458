"""CANopen EDS and DCF (CiA 306): PDOs with identifiers, mapping and transmission type, SYNC, heartbeat, node-ID."""

import re
from collections.abc import Iterator
from math import ceil
from typing import Final, NamedTuple

from busplan.questions.import_.reading import ControlWords, Facts, Reading, assumed

_SECTION: Final = re.compile(r"\s*\[([^\]\n]{1,100})\]\s*$")
_VALUE: Final = re.compile(r"\s*([^=;\n]{1,100}?)\s*=\s*(.*?)\s*$")
_NUMBER: Final = re.compile(
    r"(?:\$NODEID\s*\+\s*)?(0x[0-9a-f]{1,8}|0+|[1-9][0-9]{0,9})(?:\s*\+\s*\$NODEID)?", re.IGNORECASE
)
_TPDO, _RPDO, _MAPPING, _MOST_PDOS = 0x1800, 0x1400, 0x200, 512
_SYNC_ID, _SYNC_PERIOD, _HEARTBEAT, _SYNC_COUNTER = 0x1005, 0x1006, 0x1017, 0x1019
_INVALID: Final = 1 << 31
_EXTENDED: Final = 1 << 29
_IDENTIFIER: Final = (1 << 11) - 1
_EVERY_SYNC, _LAST_SYNC_TYPE = 1, 240
_MOST_NODE: Final = 127
_PREDEFINED_PDOS: Final = 4
"""PDOs of a direction whose identifiers are 0x180 to 0x500 and the node-ID (CiA 301)."""
_MOST_MAPPED: Final = 64
_INHIBIT_US: Final = 100
_SYNC_BITS: Final = 47
"""Shortest frame without data, interframe space included (ISO 11898-1)."""
_FASTEST_KBIT_S: Final = 1000

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
    node = device.number(setup, "nodeid") or device.node_of_identifiers() or _Number(1, 1)
    if not 1 <= node.value <= _MOST_NODE:
        raise machine.refusal(node.line, f"NodeID {node.value}: expected 1 to {_MOST_NODE}")
    device.node, words = node.value, ControlWords()
    title, line = setup.get("nodename") or sections.get("deviceinfo", {}).get("productname") or ("node", 1)
    machine.bus = _bus(device, setup)
    facts = machine.nodes[node.value] = {
        "name": machine.fact(title or "node", line),
        "node_id": machine.fact(*node)
        if is_set
        else assumed(node.value, "no NodeID in the file" + (", that of its identifiers" if node.line > 1 else "")),
        "feedback": machine.fact(tuple(device.pdos(_TPDO, ControlWords())), 1),
        "command": machine.fact(tuple(device.pdos(_RPDO, words)), 1),
        "axes": words.axes(machine, line=1),
    }
    if not facts["feedback"].value and not facts["command"].value:
        raise machine.refusal(1, "no PDO that is sent and has a mapping")
    if (beat := device.value(_HEARTBEAT)) and beat.value:
        facts["heartbeat_us"] = machine.fact(beat.value * 1000, beat.line)
    if not is_set:
        machine.remarks.append(
            f"{name}: without NodeID under [DeviceComissioning] it is read as an EDS, the defaults of a device, here "
            f"as node {node.value}; give the DCF of the node, which the tool that configures it writes"
        )
    return machine


def _bus(device: "_Device", setup: _Section) -> Facts:
    """Bit rate, period and SYNC."""
    fact, facts = device.machine.fact, {}
    rate = device.number(setup, "baudrate")
    if rate and rate.value:
        facts["bit_rate_kbit_s"] = fact(*rate)
    elif rate:
        device.machine.remarks.append(f"{device.machine.file}:{rate.line}: Baudrate = 0: not set")
    if (period := device.value(_SYNC_PERIOD)) and period.value:
        sync_us = _SYNC_BITS * 1000 / (rate.value if rate and rate.value else _FASTEST_KBIT_S)
        if period.value < sync_us:
            device.machine.remarks.append(
                f"{device.machine.file}:{period.line}: a SYNC every {period.value} us, and its frame takes "
                f"{sync_us:.0f}: the period is taken as not set"
            )
        else:
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
            raise self.machine.refusal(line, f"{key} {text[:40]!r}: expected a number, as 384, 0x180 or $NODEID+0x180")
        return _Number(int(match[1], 0) + self.node * ("$nodeid" in text.lower()), line)

    def value(self, index: int, sub: int | None = None) -> _Number | None:
        """Value that an object is set to, else its default; also of an object in the compact form of CiA 306."""
        section = self.sections.get(f"{index:x}" if sub is None else f"{index:x}sub{sub:x}", {})
        value = self.number(section, "parametervalue") or self.number(section, "defaultvalue")
        if value is not None or sub is None:
            return value
        whole = self.sections.get(f"{index:x}", {})
        count = self.number(whole, "compactsubobj")
        if count is None or not count.value or sub > count.value:
            return None
        if not sub:
            return count
        return self.number(self.sections.get(f"{index:x}value", {}), str(sub)) or self.number(whole, "defaultvalue")

    def node_of_identifiers(self) -> _Number | None:
        """The node-ID that all identifiers of PDOs without $NODEID are of, by the predefined connection set."""
        texts = [
            self.sections.get(f"{first + number:x}sub1", {}).get("defaultvalue", ("", 0))
            for first in (_TPDO, _RPDO)
            for number in range(_PREDEFINED_PDOS)
        ]
        fixed = [(int(text, 0), line) for text, line in texts if re.fullmatch("0x[0-9a-f]{1,8}", text, re.IGNORECASE)]
        nodes = {identifier & _MOST_NODE for identifier, _ in fixed if not identifier & _INVALID}
        return _Number(nodes.pop(), fixed[0][1]) if len(nodes) == 1 and nodes != {0} else None

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
                words.add(entry.value >> 16, entry.value >> 8 & 0xFF, entry.value & 0xFF, entry.line)
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
