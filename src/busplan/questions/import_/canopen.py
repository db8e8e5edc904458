"""CANopen EDS and DCF (CiA 306): PDOs with identifiers, mapping and transmission type, SYNC, heartbeat, node-ID."""

import re
from collections.abc import Iterable, Iterator
from math import ceil
from typing import Final, NamedTuple

from busplan.english import first_of
from busplan.errors import ArgumentError, BusplanError
from busplan.questions.import_.reading import ControlWords, Facts, Reading, assumed

_SECTION: Final = re.compile(r"\s*\[([^\]\n]{1,100})\]\s*$")
_VALUE: Final = re.compile(r"\s*([^=;\n]{1,100}?)\s*=\s*(.*?)\s*$")
_NUMBER: Final = re.compile(
    r"(?:\$NODEID\s*\+\s*)?(0x[0-9a-f]{1,8}|0+|[1-9][0-9]{0,9})(?:\s*\+\s*\$NODEID)?", re.IGNORECASE
)
_TPDO, _RPDO, _MAPPING, _MOST_PDOS = 0x1800, 0x1400, 0x200, 512
_SYNC_ID, _SYNC_PERIOD, _HEARTBEAT, _SYNC_COUNTER = 0x1005, 0x1006, 0x1017, 0x1019
_EMERGENCY, _EMERGENCY_INHIBIT = 0x1014, 0x1015
_EMERGENCY_ID: Final = 0x80
_STARTUP, _SLAVES, _IS_MASTER, _IS_SLAVE = 0x1F80, 0x1F81, 1, 1
"""Objects of the NMT master with their lowest bits: the device is the master; a node is its slave (CiA 302-2)."""
_INVALID: Final = 1 << 31
_EXTENDED: Final = 1 << 29
_IDENTIFIER: Final = (1 << 11) - 1
_EVERY_SYNC, _LAST_SYNC_TYPE = 1, 240
_MOST_NODE: Final = 127
_MOST_SECTIONS: Final = 100_000
"""Most sections of a file, several times those of a large drive: they bound the memory."""
_PREDEFINED_PDOS: Final = 4
"""PDOs of a direction whose identifiers are 0x180 to 0x500 plus the node-ID (CiA 301)."""
_MOST_MAPPED: Final = 64
_INHIBIT_US: Final = 100
_LISTED: Final = 4
_SYNC_BITS: Final = 47
"""Shortest frame without data, interframe space included (ISO 11898-1) [bits]."""
_FASTEST_KBIT_S: Final = 1000

_Section = dict[str, tuple[str, int]]
"""Text and line of each value."""


class _Number(NamedTuple):
    """A number in the file."""

    value: int
    line: int


class Pdo(NamedTuple):
    """A PDO that is sent."""

    identifier: int
    payload_bytes: int
    every: int
    """Number n of a PDO with every n-th SYNC; 0 for one that an event sends."""
    period_us: float
    """Shortest time between two frames that events send [us]; 0 if unknown."""
    timer: str
    """Timer with that time, in words for a comment."""
    place: str
    name: str


def node_ids(nodes: str | int | Iterable[int]) -> tuple[int, ...]:
    """Node-IDs, from their number or a list of them.

    Anything else, a node-ID outside 1 to 127, and one that comes twice raise BusplanError.

    Examples
    --------
    >>> node_ids("3"), node_ids("1-3,11"), node_ids(2), node_ids([5])
    ((1, 2, 3), (1, 2, 3, 11), (1, 2), (5,))
    """
    shown, wanted = (
        str(nodes)[:40],
        f"a number of nodes, as 8, or node-IDs from 1 to {_MOST_NODE}, each once, as 1-8,11",
    )
    refusal = ArgumentError(f"nodes {shown}: expected {wanted}")
    if isinstance(nodes, str):
        if not re.fullmatch(r"\s*\d{1,3}(?:\s*[-,]\s*\d{1,3})*\s*", nodes):
            raise refusal
        ends = [[int(end) for end in part.split("-")] for part in nodes.split(",")]
        if any(part not in ([part[0]], [part[0], max(part)]) for part in ends):
            raise refusal
        nodes = ends[0][0] if ends == [ends[0][:1]] else [n for part in ends for n in range(part[0], part[-1] + 1)]
    numbers = tuple(range(1, nodes + 1) if isinstance(nodes, int) else nodes)
    if not numbers or len(set(numbers)) < len(numbers) or not all(1 <= number <= _MOST_NODE for number in numbers):
        raise refusal
    return numbers


def read(text: str, name: str, *, nodes: tuple[int, ...] = ()) -> Reading:
    """Read an EDS or DCF; `nodes` are the nodes that an EDS describes, one without them.

    BusplanError, with its line: a number is invalid, the device has no PDOs, or a DCF, which has a node-ID of its own,
    is to describe other nodes.
    """
    sections = _sections(text, name)
    setup = sections.get("devicecomissioning") or sections.get("devicecommissioning") or {}
    is_set = "nodeid" in setup
    machine = Reading("can", "DCF" if is_set else "EDS", name, rank=0, lists_all=False)
    device = _Device(sections, machine)
    node = device.number(setup, "nodeid") or device.node_of_identifiers() or _Number(1, 1)
    if not 1 <= node.value <= _MOST_NODE:
        raise machine.refusal(node.line, f"NodeID {node.value}: expected 1 to {_MOST_NODE}")
    if is_set and nodes:
        raise machine.refusal(
            setup["nodeid"][1], f"NodeID {node.value} is set: a DCF is of one node; --nodes is for an EDS"
        )
    device.node = node.value
    machine.bus = _bus(device, setup)
    title, line = setup.get("nodename") or sections.get("deviceinfo", {}).get("productname") or ("node", 1)
    for number in nodes or (node.value,):
        device.node = number
        facts = machine.nodes[number] = {"name": machine.fact(title or "node", line)}
        if nodes:
            facts["node_id"] = assumed(number, "--nodes")
        elif is_set:
            facts["node_id"] = machine.fact(*node)
        else:
            note = "no NodeID in the file" + (", that of its identifiers" if node.line > 1 else "")
            facts["node_id"] = assumed(number, note)
        facts |= _node(device)
    if len(nodes) > 1:
        _require_apart(machine)
    if slaves := device.slaves():
        machine.rank, machine.slaves = -1, slaves
    elif not is_set and not nodes:
        machine.remarks.append(
            f"{name}: without NodeID under [DeviceComissioning] it is read as an EDS, the defaults of a device, here "
            f"as node {node.value}; give the DCF of the node, which the tool that configures it writes, or the nodes "
            "that it stands for by --nodes"
        )
    return machine


def _node(device: "_Device") -> Facts:
    """Data that a node sends and takes. The PDOs of a master are those of its slaves, in the other direction."""
    machine, words = device.machine, ControlWords()
    if is_master := bool(device.slaves()):
        facts = {"is_host": machine.fact(True, 1), "feedback": machine.fact((), 1), "command": machine.fact((), 1)}
    else:
        facts = {
            "feedback": machine.fact(tuple(device.pdos(_TPDO, ControlWords())), 1),
            "command": machine.fact(tuple(device.pdos(_RPDO, words)), 1),
            "axes": words.axes(machine, line=1),
        }
    if not (is_master or facts["feedback"].value or facts["command"].value):
        off = f" ({first_of(device.off, _LISTED)})" if device.off else ""
        raise machine.refusal(
            1,
            f"no PDO is switched on and has a mapping{off}: switch them on in the tool that configures the node, and "
            "give the DCF that it writes",
        )
    if (beat := device.value(_HEARTBEAT)) and beat.value:
        facts["heartbeat_us"] = machine.fact(beat.value * 1000, beat.line)
    emergency = device.value(_EMERGENCY)
    if emergency and not emergency.value & (_INVALID | _EXTENDED):
        identifier = emergency.value & _IDENTIFIER
        # Some files leave the node-ID out, and 0x80 itself is SYNC.
        identifier += device.node * (identifier == _EMERGENCY_ID)
        facts["emergency"] = machine.fact(identifier, emergency.line, note=f"0x{_EMERGENCY:X}")
        if (inhibit := device.value(_EMERGENCY_INHIBIT)) and inhibit.value:
            facts["emergency_us"] = machine.fact(inhibit.value * _INHIBIT_US, inhibit.line, note="inhibit time")
    return facts


def _require_apart(machine: Reading) -> None:
    """Raise BusplanError for identifiers that several nodes have: without $NODEID they belong to one."""
    owners: dict[int, int] = {}
    for number, facts in machine.nodes.items():
        for pdo in facts["feedback"].value:
            if owners.setdefault(pdo.identifier, number) != number:
                raise BusplanError(
                    f"{pdo.place}: {pdo.name} of node {owners[pdo.identifier]} and of node {number} would both "
                    f"have identifier 0x{pdo.identifier:x}, because the file lacks $NODEID: give the DCF of each node"
                )


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
    """Objects of a device."""

    def __init__(self, sections: dict[str, _Section], machine: Reading) -> None:
        self.sections, self.machine, self.node = sections, machine, 1
        self.off: list[str] = []
        """PDOs that are not sent, each with the reason."""

    def number(self, section: _Section, key: str) -> _Number | None:
        """A number, plus the node-ID where it has that; None if it is missing or empty."""
        text, line = section.get(key, ("", 0))
        if not text:
            return None
        match = _NUMBER.fullmatch(text)
        if match is None:
            raise self.machine.refusal(line, f"{key} {text[:40]!r}: expected a number, as 384, 0x180 or $NODEID+0x180")
        return _Number(int(match[1], 0) + self.node * ("$nodeid" in text.lower()), line)

    def value(self, index: int, sub: int | None = None) -> _Number | None:
        """Configured value of an object, else its default; also for an object in the compact form of CiA 306."""
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
        """Node-ID to which all PDOs' identifiers without $NODEID belong, by the predefined connection set."""
        texts = [
            self.sections.get(f"{first + number:x}sub1", {}).get("defaultvalue", ("", 0))
            for first in (_TPDO, _RPDO)
            for number in range(_PREDEFINED_PDOS)
        ]
        fixed = [(int(text, 0), line) for text, line in texts if re.fullmatch("0x[0-9a-f]{1,8}", text, re.IGNORECASE)]
        nodes = {identifier & _MOST_NODE for identifier, _ in fixed if not identifier & _INVALID}
        return _Number(nodes.pop(), fixed[0][1]) if len(nodes) == 1 and nodes != {0} else None

    def slaves(self) -> tuple[int, ...]:
        """Node-IDs of a master's slaves if it lists them, else its own; none for another device."""
        startup = self.value(_STARTUP)
        listed = ((node, self.value(_SLAVES, node)) for node in range(1, _MOST_NODE + 1))
        slaves = tuple(node for node, entry in listed if entry and entry.value & _IS_SLAVE)
        return slaves or ((self.node,) if startup and startup.value & _IS_MASTER else ())

    def pdos(self, first: int, words: ControlWords) -> Iterator[Pdo]:
        """PDOs of a direction that are sent; their control words go into `words`."""
        direction = "TPDO" if first == _TPDO else "RPDO"
        for number in range(_MOST_PDOS):
            identifier = self.value(first + number, 1)
            if identifier is None:
                continue
            name = f"{direction}{number + 1}"
            if identifier.value & _INVALID:
                self.off.append(f"{name}: bit 31 of 0x{first + number:X}sub1")
                continue
            size = self._mapped_bytes(first + _MAPPING + number, words)
            if not size:
                self.off.append(f"{name}: no object in 0x{first + _MAPPING + number:X}")
                continue
            if identifier.value & _EXTENDED:
                raise self.machine.refusal(identifier.line, "a PDO of 29 bits; a profile's PDOs have 11")
            kind, inhibit, event = (self.value(first + number, sub) for sub in (2, 3, 5))
            every = kind.value if kind and _EVERY_SYNC <= kind.value <= _LAST_SYNC_TYPE else 0
            us, timer = event.value * 1000 if event else 0, "event timer; without an inhibit time it may come sooner"
            if inhibit and inhibit.value:
                us, timer = inhibit.value * _INHIBIT_US, "inhibit time"
            place = self.machine.place(identifier.line)
            yield Pdo(identifier.value & _IDENTIFIER, size, every, us, timer, place, name)

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


def _sections(text: str, name: str) -> dict[str, _Section]:
    """Keys and values of each section, with their lines; case does not count in names.

    BusplanError, with its line: more sections than a device has.
    """
    sections: dict[str, _Section] = {}
    section: _Section = {}
    for line, content in enumerate(text.split("\n"), start=1):
        if match := _SECTION.match(content):
            section = sections.setdefault(match[1].strip().lower(), {})
            if len(sections) > _MOST_SECTIONS:
                raise BusplanError(f"{name}:{line}: more than {_MOST_SECTIONS:,} sections; no such file is a device's")
        elif match := _VALUE.match(content):
            section.setdefault(match[1].lower(), (match[2], line))
    return sections
