"""LinuxCNC's ethercat-conf.xml: period, devices, bits of their PDOs, SYNC0's shift, and sync units."""

import re
import tomllib
from functools import cache
from importlib.resources import files
from typing import Any, Final

from busplan.questions.import_.reading import ControlWords, Fact, Line, Reading, whole_number
from busplan.questions.import_.xml import Element, parsed

_DIRECTIONS: Final = {"out": "write_bytes", "in": "read_bytes"}
_MOST_TIME_NS: Final = 10**12
_MOST_BITS: Final = 8 * 1486


def read(content: bytes, name: str) -> Reading:
    """Read a configuration of linuxcnc-ethercat.

    One that is not valid, or has several masters, raises BusplanError with its line.
    """
    root = parsed(content, name=name)
    machine = Reading("ethercat", "ethercat-conf.xml", name, rank=1, lists_all=False)
    masters = list(root.all("master"))
    if len(masters) != 1:
        line = masters[1].line if masters else root.line
        raise machine.refusal(line, f"{len(masters)} masters: a profile describes one bus; give a file of one <master>")
    master = masters[0]
    period = _number(master, "appTimePeriod", machine, most=_MOST_TIME_NS)
    if period and period.value:
        machine.bus["period_us"] = period._replace(value=period.value / 1000)
    machine.bus["master"] = machine.fact("IgH", master.line, "derived", "the master of linuxcnc-ethercat")
    units: dict[str, Line] = {}
    for slave in master.all("slave"):
        number = _number(slave, "idx", machine, most=65_535)
        if number is None or number.value in machine.nodes:
            idx = number and number.value
            raise machine.refusal(slave.line, f"slave idx {idx}: expected a number that no other slave has")
        _device(slave, number.value, machine)
        units.setdefault(slave.attributes.get("syncUnit", ""), slave.line)
        rate = slave.attributes.get("syncUnitCycle", "*1")
        if rate not in ("*1", "1"):
            machine.remarks.append(
                f"{name}:{slave.line}: syncUnitCycle {rate[:20]}: a profile has one rate; its bytes are counted in "
                "every cycle"
            )
    if not machine.nodes:
        raise machine.refusal(master.line, "<master> has no <slave>")
    if len(units) > 1:
        line = list(units.values())[-1]
        machine.bus["further_datagrams"] = machine.fact(len(units) - 1, line, note=f"{len(units)} sync units")
    return machine


def _device(slave: Element, number: int, machine: Reading) -> None:
    facts = machine.nodes[number] = {}
    kind = slave.attributes.get("type", "device")
    name = slave.attributes.get("name", kind) if kind == "generic" else kind
    facts["name"] = machine.fact(name, slave.line)
    managers = list(slave.all("syncManager"))
    if any(True for manager in managers for _ in manager.all("pdo")):
        bits, words, line = dict.fromkeys(_DIRECTIONS, 0), ControlWords(), managers[0].line
        for manager in managers:
            direction = manager.attributes.get("dir", "")
            for entry in manager.all("pdo/pdoEntry"):
                if direction not in bits:
                    raise machine.refusal(manager.line, f"syncManager dir {direction[:20]!r}: expected in or out")
                length = _number(entry, "bitLen", machine, most=_MOST_BITS)
                bits[direction] += length.value if length else 0
                index, sub = (whole_number(f"0x{entry.attributes.get(key, '')}") for key in ("idx", "subIdx"))
                if direction == "out":
                    words.add(index, sub, length and length.value, entry.line)
        facts |= {key: machine.bytes_of(bits[direction], line) for direction, key in _DIRECTIONS.items()}
        facts["axes"] = words.axes(machine, line=line)
    elif kind in (known := _terminals())["inputs"] | known["outputs"] and not _switches(slave):
        facts |= {
            key: machine.bytes_of(known[way].get(kind, 0), slave.line)
            for way, key in (("inputs", "read_bytes"), ("outputs", "write_bytes"))
        }
        facts["axes"] = machine.fact(known["axes"].get(kind, 0), slave.line, "derived", f"of {kind}, by its driver")
    clock = slave.first("dcConf")
    if clock:
        facts["clock_us"] = machine.fact(0.0, clock.line)
        shift = clock.attributes.get("sync0Shift", "0")
        if not re.fullmatch(r"-?\d{1,12}", shift):
            raise machine.refusal(clock.line, f"sync0Shift {shift[:40]!r}: expected whole nanoseconds")
        facts["shift_us"] = machine.fact(int(shift) / 1000, clock.line, "derived", "from the master's task on")


def _switches(slave: Element) -> bool:
    """Whether the file switches process data on or off, which the table of terminals does not cover."""
    return any(each.attributes.get("name", "").lower().startswith("enable") for each in slave.all("modParam"))


@cache
def _terminals() -> dict[str, dict[str, int]]:
    """Bits of devices' inputs and outputs, and axes of drives, by type of device."""
    table: dict[str, Any] = tomllib.loads((files(__package__) / "terminals.toml").read_text(encoding="utf-8"))
    return {way: table[way] for way in ("inputs", "outputs", "axes")}


def _number(element: Element, key: str, machine: Reading, *, most: int) -> Fact | None:
    """A whole number of an attribute; None if it is missing."""
    text = element.attributes.get(key)
    return None if text is None else machine.number(key, text, element.line, most=most)
