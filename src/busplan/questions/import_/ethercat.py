"""Profile of an EtherCAT segment: groups of alike devices, each value with its grade and place."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from busplan.buses import kind_named
from busplan.english import first_of
from busplan.errors import BusplanError
from busplan.questions.import_.igh import PDOS
from busplan.questions.import_.reading import (
    Fact,
    Facts,
    ProfileLine,
    Reading,
    assumed,
    execution_lines,
    group_name,
    lines,
    usual_period,
)

_SIZES: Final = ("read_bytes", "write_bytes")
_ALIKE: Final = (*_SIZES, "axes", "port", "every")
"""Facts that devices of a group share."""
_MOST_SHARE: Final = 0.999
SLOWER: Final = "frames of slower tasks, in every cycle"
_FROM_TASK: Final = "taken to count from the master's task on"
_PER_BYTE: Final = "time per byte"


def rows(machine: Reading) -> Iterator[ProfileLine]:
    """Lines of the profile, without its head.

    No devices, or devices of unknown size, raise BusplanError.
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
    bus, devices = machine.bus, [machine.nodes[number] for number in sorted(machine.nodes)]
    period = bus.get("period_us") or usual_period("ethercat")
    yield ProfileLine("bus", "kind", machine.fact("ethercat", 1))
    yield from lines("bus", _datagrams(bus))
    yield from lines("bus", _clocks(devices, period))
    mailboxes = [facts["mailbox_bytes"] for facts in devices if "mailbox_bytes" in facts]
    if mailboxes:
        yield ProfileLine("bus", "mailbox_polls", assumed(1, "one service request or answer in a cycle"))
        yield ProfileLine("bus", "mailbox_bytes", max(mailboxes, key=lambda mailbox: mailbox.value))
    if any("every" in facts for facts in devices):
        yield ProfileLine("bus", "units", assumed("together", "no file says whether slower tasks meet in a cycle"))
    ethercat = kind_named("ethercat")
    host = ethercat.hosts()[ethercat.starter.host]
    yield ProfileLine("bus", "master_us", assumed(float(host.own_us["ethercat"]), host.own_note()))
    yield ProfileLine("bus", "master_grade", assumed("assumed", "so half of it is its standard uncertainty"))
    yield ProfileLine("cycle", "period_us", period)
    slower_us = sum(map(frame_us, bus["slower"].value)) if "slower" in bus else 0.0
    if slower_us:
        yield ProfileLine("cycle", "nonperiodic_us", Fact(round(slower_us, 6), bus["slower"].place, note=SLOWER))
    taken: set[str] = set()
    for _, numbers in groupby(range(len(devices)), lambda number: _looks(devices[number])):
        first, *more = numbers
        yield from _group(first, [devices[number] for number in (first, *more)], taken)


def _name(facts: Facts) -> str:
    return str(facts["name"].value) if "name" in facts else "device"


def _datagrams(bus: Facts) -> Facts:
    """Datagrams of the master from the files, else those that a master of this name is known to send."""
    if "process_data" in bus:
        return {key: bus[key] for key in ("process_data", "housekeeping_bytes")}
    if "master" not in bus:
        return {}
    facts = {"master": bus["master"]}
    if "further_datagrams" in bus:
        constants, further = kind_named("ethercat").constants, bus["further_datagrams"]
        sizes = (constants[f"{name}[{bus['master'].value}]"] for name in ("HOUSEKEEPING_BYTES", "CLOCK_BYTES"))
        data = [*(int(size - constants["DATAGRAM_BYTES"]) for size in sizes), *[0] * further.value]
        note = f"the master's datagrams, and 0 for the header of each further datagram of {further.note}"
        facts["housekeeping_bytes"] = further._replace(value=data, grade="derived", note=note)
    return facts


def _clocks(devices: Sequence[Facts], period: Fact) -> Facts:
    """Distributed clocks if a device acts at SYNC0, or may, and the shift of SYNC0."""
    configured, possible, shifts = (
        [facts[key] for facts in devices if key in facts] for key in ("clock_us", "has_clock", "shift_us")
    )
    facts = {}
    if configured:
        facts["distributed_clocks"] = configured[0]._replace(value=True)
    elif possible:
        note = "devices have clocks; no file says whether they act at SYNC0"
        facts["distributed_clocks"] = Fact(True, possible[0].place, "assumed", note)
    if shifts:
        # The earliest SYNC0 decides. One at a task is that of the next task.
        soonest = min(shifts, key=lambda shift: shift.value % period.value or period.value)
        share = min(soonest.value % period.value / period.value, _MOST_SHARE)
        note = f"{soonest.value:g} us, {soonest.note or _FROM_TASK}"
        shift = Fact(round(share, 6), soonest.place, soonest.grade if soonest.note else "assumed", note)
        if not share and soonest.grade != "derived":
            note = "ShiftTime is 0, but counts from the clocks' cycle; no file says where the master's task lies"
            shift = Fact(0.5, soonest.place, "assumed", note)
        facts["sync_shift"] = shift
    return facts


def _looks(facts: Facts) -> tuple[object, ...]:
    """Features that neighbours of one group share: bytes, axes, port and rate, and whether their delay is known."""
    return (*(facts[key].value if key in facts else None for key in _ALIKE), "delay_us" in facts)


def _group(number: int, devices: Sequence[Facts], taken: set[str]) -> Iterator[ProfileLine]:
    """Lines of alike devices side by side; delays are averaged, so that their sum stays.

    `number` is the place of the first one in the segment; `taken` are the names of earlier groups.
    """
    first, last = devices[0], devices[-1]
    section = f"group.{group_name(_name(first), taken)}"
    names = list(dict.fromkeys(map(_name, devices)))
    numbers = f"device {number}" if len(devices) == 1 else f"devices {number} to {number + len(devices) - 1}"
    title = f"{numbers}: {', '.join(names[:4])}{', ...' if names[4:] else ''}"
    place = first["name"].place if "name" in first else ""
    axes = first.get("axes") or assumed(0, "no file lists its PDOs")
    facts = {
        "nodes": Fact(len(devices), place, first[_SIZES[0]].grade, title),
        "axes": axes,
        **{key: first.get(key) for key in (*_SIZES, "every", "port")},
    }
    if "delay_us" in first:
        delays = [facts["delay_us"] for facts in devices]
        values_us = [delay.value for delay in delays]
        least_us, most_us = min(values_us), max(values_us)
        spread = f"{least_us:g} to {most_us:g}, their mean" if least_us < most_us else ""
        until = f" to {last['delay_us'].place}" if len(delays) > 1 else ""
        facts["delay_us"] = delays[0]._replace(
            value=round(sum(values_us) / len(delays), 6),
            note=", ".join(filter(None, (delays[0].note, spread))),
            place=delays[0].place + until,
        )
    yield from lines(section, facts)
    if axes.value:
        base = assumed(20, "from SYNC0 to feedback, and from the frame to a command that is taken")
        yield from execution_lines(section, base, assumed(0.1, _PER_BYTE))
    else:
        base = assumed(0, "no drive: what is in its frame is taken at once")
        yield from execution_lines(section, base, assumed(0, _PER_BYTE))


def frame_us(sizes: Sequence[int]) -> float:
    """Time of a frame on the wire, from the data sizes of its datagrams [us]."""
    constants = kind_named("ethercat").constants
    names = ("PREAMBLE_BYTES", "ETHERNET_BYTES", "HEADER_BYTES", "CHECK_BYTES", "GAP_BYTES")
    whole = sum(constants[name] for name in names) + sum(size + constants["DATAGRAM_BYTES"] for size in sizes)
    return float(max(whole, constants["LEAST_FRAME_BYTES"]) * constants["BYTE_US"])
