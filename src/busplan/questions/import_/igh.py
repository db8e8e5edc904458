"""Output of the IgH master's tool: `ethercat slaves -v` (ports, measured delays, names) and `ethercat pdos` (bytes)."""

import re
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from busplan.questions.import_.reading import ControlWords, Facts, Reading

SLAVES: Final = "ethercat slaves -v"
PDOS: Final = "ethercat pdos"
_HEADER: Final = re.compile(r"=== Master (\d{1,5}), Slave (\d{1,5}) ===")
_PORT: Final = re.compile(
    r"\s+(?P<port>[0-3])\*?\s+(?P<type>MII|EBUS|N/A|N/C|\S+)\s+(?P<link>up|down)\s+\S+\s+\S+\s+(?P<next>\d{1,5}|-)"
    r"\s+(?:\d+|-)\s+(?:\d+|-)\s+(?P<delay>\d{1,9}|-)\s*$"
)
_NAME: Final = re.compile(r"\s+(Order number|Device name): *(\S.*?)\s*$")
_CLOCKS: Final = re.compile(r"\s+Distributed clocks: yes\b")
_MAILBOX: Final = re.compile(r"\s+Standard +RX: 0x[0-9a-fA-F]+/\d+, +TX: 0x[0-9a-fA-F]+/(\d{1,5})")
_SYNC_MANAGER: Final = re.compile(r"SM\d+: PhysAddr 0x[0-9a-fA-F]+, DefaultSize +(\d+)")
_PDO: Final = re.compile(r"\s+(Rx|Tx)PDO 0x")
_ENTRY: Final = re.compile(r"\s+PDO entry 0x([0-9a-fA-F]{4}):([0-9a-fA-F]{1,4}), +(\d{1,5}) bit")
_PORT_TYPES: Final = {"MII": "100BASE-TX", "EBUS": "E-bus"}
_DIRECTIONS: Final = {"Rx": "write_bytes", "Tx": "read_bytes"}


class _Port(NamedTuple):
    """A port of a device as the tool prints it."""

    type: str
    next: int
    delay_ns: int | None
    line: int


def read(text: str, name: str) -> Reading:
    """Read the output of either command, or of both.

    Without a device, with several masters, or with a device twice it raises BusplanError, with its line.
    """
    is_of_pdos = _SYNC_MANAGER.search(text) is not None
    is_of_slaves = re.search(r"^Port +Type", text, re.MULTILINE) is not None
    title = " and ".join([SLAVES] * is_of_slaves + [PDOS] * is_of_pdos) or SLAVES
    machine = Reading("ethercat", title, name, rank=2)
    ports: dict[int, list[_Port]] = {}
    for number, lines in _devices(text, machine).items():
        facts = machine.nodes[number] = {}
        ports[number] = list(_described(lines, facts, machine))
        if any(_SYNC_MANAGER.match(line) for _, line in lines) or (is_of_pdos and not is_of_slaves):
            facts |= _sizes(lines, machine)
    _delays(ports, machine)
    machine.bus["master"] = machine.fact("IgH", 1, "derived", f"{title} is of its tool")
    return machine


def _devices(text: str, machine: Reading) -> dict[int, list[tuple[int, str]]]:
    """Lines of each device, numbered."""
    if not _HEADER.search(text):
        # The tool names the device only if there are several.
        return {0: [*enumerate(text.split("\n"), start=1)]}
    devices: dict[int, list[tuple[int, str]]] = {}
    masters, device = set(), None
    for line, content in enumerate(text.split("\n"), start=1):
        if header := _HEADER.match(content):
            masters.add(header[1])
            if len(masters) > 1:
                raise machine.refusal(line, "a second master: a profile describes one bus; give the text of one master")
            device = devices.setdefault(int(header[2]), [])
        if device is not None:
            device.append((line, content))
        elif _SYNC_MANAGER.match(content):
            raise machine.refusal(line, f"no line === Master 0, Slave 0 === before it: give `{PDOS}` of the whole bus")
    return devices


def _described(lines: list[tuple[int, str]], facts: Facts, machine: Reading) -> Iterator[_Port]:
    """Add name, clocks and mailbox of a device to its facts; yields its ports."""
    for line, content in lines:
        if match := _PORT.match(content):
            if match["link"] == "up" and match["next"] != "-":
                delay = None if match["delay"] == "-" else int(match["delay"])
                yield _Port(match["type"], int(match["next"]), delay, line)
            if match["port"] == "0" and match["type"] in _PORT_TYPES:
                facts["port"] = machine.fact(_PORT_TYPES[match["type"]], line, "measured")
        elif match := _NAME.match(content):
            # The order number, if there is one, is the shorter name.
            facts.setdefault("name", machine.fact(match[2], line))
        elif _CLOCKS.match(content):
            facts["has_clock"] = machine.fact(True, line, "measured")
        elif (match := _MAILBOX.match(content)) and int(match[1]):
            facts["mailbox_bytes"] = machine.fact(int(match[1]), line)


def _sizes(lines: list[tuple[int, str]], machine: Reading) -> Facts:
    """Bytes and axes of a device by the entries of its PDOs, each direction in whole bytes."""
    bits, places, words = {"Rx": 0, "Tx": 0}, dict.fromkeys(_DIRECTIONS, lines[0][0]), ControlWords()
    direction = ""
    for line, content in lines:
        if match := _PDO.match(content):
            direction = match[1]
            if not bits[direction]:
                places[direction] = line
        elif (match := _ENTRY.match(content)) and direction:
            bits[direction] += int(match[3])
            if direction == "Rx":
                words.add(int(match[1], 16), int(match[2], 16), int(match[3]), line)
    sizes = {key: machine.bytes_of(bits[direction], places[direction]) for direction, key in _DIRECTIONS.items()}
    return {**sizes, "axes": words.axes(machine, line=lines[0][0])}


def _delays(ports: Mapping[int, list[_Port]], machine: Reading) -> None:
    """Measured delay of each device but the first: that of the hop to it, cable included.

    A hop over devices without a clock is shared out evenly among them.
    """
    waiting: list[int] = []
    for number, device_ports in ports.items():
        before = next((port for port in device_ports if port.next < number), None)
        if before is None:
            continue
        if not before.delay_ns or "has_clock" not in machine.nodes[number]:
            waiting.append(number)
            continue
        shared = [device for device in waiting if before.next <= device < number] if before.next in waiting else []
        us = before.delay_ns / 1000 / (len(shared) + 1)
        note = f"cable included{f', shared with {len(shared)} without a clock' if shared else ''}"
        for device in (*shared, number):
            machine.nodes[device]["delay_us"] = machine.fact(us, before.line, "measured", note)
        waiting = [device for device in waiting if device not in shared]
