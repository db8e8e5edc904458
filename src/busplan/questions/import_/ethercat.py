"""The profile of an EtherCAT segment: groups of devices that are alike, each value with its grade and place."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final, NamedTuple

from busplan.buses import kind_named
from busplan.english import first_of
from busplan.errors import BusplanError
from busplan.questions.import_.igh import PDOS
from busplan.questions.import_.reading import Fact, Facts, ProfileLine, Reading, group_name, time_us

_SIZES: Final = ("read_bytes", "write_bytes")
_MOST_SHARE: Final = 0.999
_EXECUTION: Final = {
    True: {
        "base_us": Fact(20, "", "assumed", "from SYNC0 to feedback, and from the frame to a command that is taken"),
        "per_byte_us": Fact(0.1, "", "assumed", "what each byte adds"),
    },
    False: {
        "base_us": Fact(0, "", "assumed", "no drive: what is in its frame is taken at once"),
        "per_byte_us": Fact(0, "", "assumed", "what each byte adds"),
    },
}
"""Execution time of devices with and without axes."""


class _Group(NamedTuple):
    """Devices side by side that are alike."""

    first: int
    devices: list[Facts]


def rows(machine: Reading) -> Iterator[ProfileLine]:
    """Lines of the profile, without its head.

    Raises
    ------
    BusplanError
        Devices of unknown bytes, or none.
    """
    if not machine.nodes:
        raise BusplanError(f"{machine.file}: no devices")
    unknown = [number for number, facts in machine.nodes.items() if not facts.keys() >= {*_SIZES}]
    if unknown:
        names = [f"{number} ({_name(machine.nodes[number])})" for number in unknown]
        raise BusplanError(
            f"{machine.file}: how many bytes device {first_of(names, 5)} has in a cycle is not known (the first is "
            f"0); give the text of `{PDOS}` beside it, as in busplan import {machine.file} pdos.txt"
        )
    for number, facts in machine.nodes.items():
        if "branch" in facts and "delay_us" not in facts:
            machine.remarks.append(
                f"{facts['branch'].place}: device {number} is on a branch: the delay of the port there is not counted"
            )
    starter = kind_named("ethercat").starter
    bus, devices = machine.bus, [machine.nodes[number] for number in sorted(machine.nodes)]
    period = bus.get("period_us") or Fact(time_us(starter.period), "", "assumed", "no file says it; usual on this bus")
    yield ProfileLine("bus", "kind", Fact("ethercat", machine.place(1)))
    yield from _master(bus)
    yield from _clocks(devices, period)
    yield from _mailbox(devices)
    if any("every" in facts for facts in devices):
        note = "whether slower tasks meet in a cycle no file says"
        yield ProfileLine("bus", "units", Fact("together", "", "assumed", note))
    master_us = next(line for line in starter.hosts[starter.host].splitlines() if line.startswith("master_us"))
    value, _, note = master_us.partition("=")[2].partition("#")
    yield ProfileLine("bus", "master_us", Fact(float(value), "", "assumed", note.strip().removeprefix("assumed: ")))
    yield ProfileLine(
        "bus", "master_grade", Fact("assumed", "", "assumed", "so half of it is its standard uncertainty")
    )
    yield ProfileLine("cycle", "period_us", period)
    slower_us = sum(map(frame_us, bus["slower"].value)) if "slower" in bus else 0.0
    if slower_us:
        note = "frames of slower tasks, in every cycle"
        yield ProfileLine("cycle", "nonperiodic_us", Fact(round(slower_us, 6), bus["slower"].place, note=note))
    taken: set[str] = set()
    for group in _groups(devices):
        yield from _group(group, group_name(_name(group.devices[0]), taken))


def _name(facts: Facts) -> str:
    return str(facts["name"].value) if "name" in facts else "device"


def _master(bus: Facts) -> Iterator[ProfileLine]:
    """Datagrams of the master: from the files, else those that a master of this name is known to send."""
    if "process_data" in bus:
        yield ProfileLine("bus", "process_data", bus["process_data"])
        yield ProfileLine("bus", "housekeeping_bytes", bus["housekeeping_bytes"])
        return
    if "master" not in bus:
        return
    yield ProfileLine("bus", "master", bus["master"])
    if "further_datagrams" in bus:
        known = kind_named("ethercat").constants
        own = (known[f"{name}[{bus['master'].value}]"] for name in ("HOUSEKEEPING_BYTES", "CLOCK_BYTES"))
        further = bus["further_datagrams"]
        sizes = [*(int(size - known["DATAGRAM_BYTES"]) for size in own), *[0] * further.value]
        note = f"those of the master, and 0 for the header of each further datagram of {further.note}"
        yield ProfileLine("bus", "housekeeping_bytes", further._replace(value=sizes, grade="derived", note=note))


def _clocks(devices: Sequence[Facts], period: Fact) -> Iterator[ProfileLine]:
    """Distributed clocks where a device acts at SYNC0, or may."""
    configured = [facts["clock_us"] for facts in devices if "clock_us" in facts]
    possible = [facts["has_clock"] for facts in devices if "has_clock" in facts]
    if configured:
        yield ProfileLine("bus", "distributed_clocks", configured[0]._replace(value=True))
    elif possible:
        note = "devices have clocks; whether they act at SYNC0 no file says"
        yield ProfileLine("bus", "distributed_clocks", Fact(True, possible[0].place, "assumed", note))
    shifts = [facts["shift_us"] for facts in devices if "shift_us" in facts]
    if not shifts:
        return
    # The earliest SYNC0 decides; one at a task is that of the next.
    soonest = min(shifts, key=lambda shift: shift.value % period.value or period.value)
    share = min(soonest.value % period.value / period.value, _MOST_SHARE)
    if share or soonest.grade == "derived":
        note = soonest.note or "taken to count from the master's task on"
        grade = soonest.grade if soonest.note else "assumed"
        yield ProfileLine(
            "bus", "sync_shift", Fact(round(share, 6), soonest.place, grade, f"{soonest.value:g} us, {note}")
        )
    else:
        note = "ShiftTime is 0, but counts from the clocks' cycle; where the master's task lies no file says"
        yield ProfileLine("bus", "sync_shift", Fact(0.5, soonest.place, "assumed", note))


def _mailbox(devices: Sequence[Facts]) -> Iterator[ProfileLine]:
    """One poll of the largest mailbox."""
    mailboxes = [facts["mailbox_bytes"] for facts in devices if "mailbox_bytes" in facts]
    if mailboxes:
        yield ProfileLine("bus", "mailbox_polls", Fact(1, "", "assumed", "one service request or answer in a cycle"))
        yield ProfileLine("bus", "mailbox_bytes", max(mailboxes, key=lambda mailbox: mailbox.value))


def _groups(devices: Sequence[Facts]) -> Iterator[_Group]:
    """Neighbours that are alike in type and bytes; delays are averaged, so that their sum stays."""

    def looks(number: int) -> tuple[object, ...]:
        facts = devices[number]
        said = (facts[key].value if key in facts else None for key in (*_SIZES, "axes", "port", "every"))
        return (*said, "delay_us" in facts)

    for _, numbers in groupby(range(len(devices)), looks):
        own = list(numbers)
        yield _Group(own[0], [devices[number] for number in own])


def _group(group: _Group, name: str) -> Iterator[ProfileLine]:
    first, last = group.devices[0], group.devices[-1]
    section = f"group.{name}"
    names = list(dict.fromkeys(map(_name, group.devices)))
    numbers = f"device {group.first}" if len(group.devices) == 1 else f"devices {group.first} to "
    numbers += str(group.first + len(group.devices) - 1) if len(group.devices) > 1 else ""
    title = f"{numbers}: {', '.join(names[:4])}{', ...' if names[4:] else ''}"
    place = first["name"].place if "name" in first else ""
    yield ProfileLine(section, "nodes", Fact(len(group.devices), place, first[_SIZES[0]].grade, title))
    axes = first.get("axes") or Fact(0, "", "assumed", "no file lists its PDOs")
    yield ProfileLine(section, "axes", axes)
    for key in _SIZES:
        yield ProfileLine(section, key, first[key])
    if "every" in first:
        yield ProfileLine(section, "every", first["every"])
    if "port" in first:
        yield ProfileLine(section, "port", first["port"])
    if "delay_us" in first:
        delays = [facts["delay_us"] for facts in group.devices]
        mean = sum(delay.value for delay in delays) / len(delays)
        least, most = (function(delay.value for delay in delays) for function in (min, max))
        note = ", ".join(filter(None, (delays[0].note, f"{least:g} to {most:g}, their mean" if least < most else "")))
        until = f" to {last['delay_us'].place}" if len(delays) > 1 else ""
        yield ProfileLine(
            section, "delay_us", delays[0]._replace(value=round(mean, 6), note=note, place=delays[0].place + until)
        )
    yield ProfileLine(f"{section}.execution", "kind", Fact("linear", "", "assumed"))
    yield ProfileLine(f"{section}.execution", "grade", Fact("assumed", "", "assumed"))
    for key, fact in _EXECUTION[axes.value > 0].items():
        yield ProfileLine(f"{section}.execution", key, fact)


def frame_us(sizes: Sequence[int]) -> float:
    """Time of a frame on the wire by the data of its datagrams [us]."""
    known = kind_named("ethercat").constants
    names = ("PREAMBLE_BYTES", "ETHERNET_BYTES", "HEADER_BYTES", "CHECK_BYTES", "GAP_BYTES")
    whole = sum(known[name] for name in names) + sum(size + known["DATAGRAM_BYTES"] for size in sizes)
    return float(max(whole, known["LEAST_FRAME_BYTES"]) * known["BYTE_US"])
