"""Output of SOEM's `slaveinfo`: bits, delays since the first clock, ports and clocks."""

import re
from typing import Final

from busplan.questions.import_.reading import ControlWords, Fact, Facts, Reading

_SLAVE: Final = re.compile(r"Slave:(\d{1,5})\s*$")
_KEYS: Final = re.compile(r" (Name|Output size|Input size|Delay|Has DC|Activeports|MBX length wr): *(.*?)\s*$")
_READ_LENGTH: Final = re.compile(r"rd: *(\d{1,5})")
_MANAGER: Final = re.compile(r"\s+SM\d+ (inputs|outputs)\s*$")
_MAPPED: Final = re.compile(r"\s+\[0x[0-9A-Fa-f]{4}\.\d\] 0x([0-9A-Fa-f]{4}):0x([0-9A-Fa-f]{2}) 0x([0-9A-Fa-f]{2})")
_DELAY: Final = re.compile(r"(\d{1,9})\[ns\]")
_SIZES: Final = {"Output size": "write_bytes", "Input size": "read_bytes"}
_BRANCH, _END = 3, 1


def read(text: str, name: str) -> Reading:
    """Read the output of slaveinfo.

    A missing device, or one without size, raises BusplanError with its line.
    """
    machine = Reading("ethercat", "slaveinfo", name, rank=3)
    totals_ns: dict[int, tuple[int, int]] = {}
    ports: dict[int, int] = {}
    for number, lines in enumerate(_slaves(text, machine)):
        facts = machine.nodes[number] = {}
        for line, content in lines:
            if match := _KEYS.match(content):
                _describe(match[1], match[2], line, facts, machine)
                if match[1] == "Delay" and (delay := _DELAY.match(match[2])):
                    totals_ns[number] = int(delay[1]), line
                elif match[1] == "Activeports":
                    ports[number] = match[2].count("1")
        for title, key in _SIZES.items():
            if key not in facts:
                raise machine.refusal(lines[0][0], f"slave {number + 1} has no {title}: cut off?")
        facts["axes"] = _axes(lines, machine)
    _hops(totals_ns, ports, machine)
    machine.bus["master"] = machine.fact("SOEM", 1, "derived", "slaveinfo is of its tools")
    return machine


def _axes(lines: list[tuple[int, str]], machine: Reading) -> Fact:
    words, mapped, direction = ControlWords(), None, ""
    for line, content in lines:
        if match := _MANAGER.match(content):
            direction = match[1]
        elif match := _MAPPED.match(content):
            mapped = mapped or line
            if direction == "outputs":
                index, sub, bits = (int(number, 16) for number in match.groups())
                words.add(index, sub, bits, line)
    return words.axes(machine, line=mapped)


def _slaves(text: str, machine: Reading) -> list[list[tuple[int, str]]]:
    """Lines of each device, numbered."""
    slaves: list[list[tuple[int, str]]] = []
    for line, content in enumerate(text.split("\n"), start=1):
        if match := _SLAVE.match(content):
            slaves.append([])
            if int(match[1]) != len(slaves):
                raise machine.refusal(line, f"slave {match[1]} where slave {len(slaves)} is due: give all of the text")
        if slaves:
            slaves[-1].append((line, content))
    return slaves


def _describe(key: str, value: str, line: int, facts: Facts, machine: Reading) -> None:
    if key in _SIZES and (bits := re.match(r"(\d{1,6})bits", value)):
        facts[_SIZES[key]] = machine.bytes_of(int(bits[1]), line)
    elif key == "Name" and value:
        facts["name"] = machine.fact(value, line)
    elif key == "Has DC" and value == "1":
        facts["has_clock"] = machine.fact(True, line, "measured")
    elif key == "MBX length wr" and (length := _READ_LENGTH.search(value)) and int(length[1]):
        facts["mailbox_bytes"] = machine.fact(int(length[1]), line)


def _hops(totals_ns: dict[int, tuple[int, int]], ports: dict[int, int], machine: Reading) -> None:
    """Delay of each device but the first, from the time of a frame on its way from the first clock to it.

    That way leads through earlier branches there and back: all devices between a device and its parent.
    """
    hops_ns: dict[int, int] = {}
    for number in range(1, len(machine.nodes)):
        before = _parent(number, ports)
        between = [hops_ns.get(device) for device in range(before + 1, number)]
        is_timed = all("has_clock" in machine.nodes[device] and device in totals_ns for device in (before, number))
        if not is_timed or None in between:
            continue
        hop_ns = totals_ns[number][0] - totals_ns[before][0] - 2 * sum(ns for ns in between if ns)
        if hop_ns > 0:
            hops_ns[number] = hop_ns
            delay = machine.fact(hop_ns / 1000, totals_ns[number][1], "measured", "cable included")
            machine.nodes[number]["delay_us"] = delay


def _parent(number: int, ports: dict[int, int]) -> int:
    """Device to which a device is connected. Devices at an end close their branch."""
    ends = 0
    for before in range(number - 1, 0, -1):
        count = ports.get(before, 2)
        ends += -1 if count == _END else max(count - 2, 0)
        if ends >= 0 and count > _END:
            return before
    return 0
