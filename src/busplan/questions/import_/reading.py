"""Facts of a machine with their places in files, merged over several files, and lines of a profile."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from math import ceil
from pathlib import PurePath
from typing import Any, Final, NamedTuple, TypeAlias

from busplan.buses import kind_named
from busplan.english import printable
from busplan.errors import BusplanError
from busplan.profile.document import MAX_FILE_BYTES
from busplan.profile.edit import short_text, value_text, whole
from busplan.sourced import Grade

_MAY_DIFFER: Final = ("name", "master", "clock_us")
"""Facts that may differ from file to file."""
_CONTROL_WORDS: Final = range(0x6040, 0xA000, 0x800)
"""Indexes of the axes' control words in a drive (CiA 402), 0x800 apart. Terminals have bits at 0x7040, too."""
_CONTROL_WORD_BITS: Final = 16

Line: TypeAlias = int | str
"""Number of a line, followed by ":" and the column if the file has long lines."""


class Fact(NamedTuple):
    """A value of a machine, with its grade and its place."""

    value: Any
    place: str = ""
    """File and line; empty for a value that no file gives."""
    grade: Grade = "published"
    note: str = ""

    @property
    def comment(self) -> str:
        """Grade, note and place, as the comment of a profile's line; empty without note and place."""
        rest = ", ".join(filter(None, (self.note, self.place)))
        return printable(f"{self.grade}: {rest}") if rest else ""


Facts = dict[str, Fact]


def assumed(value: object, note: str = "") -> Fact:
    """A value that no file gives."""
    return Fact(value, "", "assumed", note)


@dataclass
class Reading:
    """Facts of a machine from one file, or from several together."""

    kind: str
    title: str
    """Name of the format in messages."""
    file: str
    """Name of the file."""
    rank: int
    """Rank among files with different values, of which the smallest counts."""
    bus: Facts = field(default_factory=dict)
    """Facts of the bus, its master and its cycle."""
    nodes: dict[int, Facts] = field(default_factory=dict)
    """Devices by place in the segment, from 0; CANopen nodes by node-ID."""
    messages: dict[int, Facts] = field(default_factory=dict)
    """Messages of a CAN bus by identifier."""
    lists_all: bool = True
    """Whether the file lists all devices of the machine."""
    is_log: bool = False
    """Whether the file is a recording of the bus."""
    is_database: bool = False
    """Whether the file is a database of messages."""
    slaves: tuple[int, ...] = ()
    """Node-IDs of the slaves of a CANopen master's DCF, or its own if it lists none."""
    remarks: list[str] = field(default_factory=list)
    """Sentences on facts that a profile cannot hold, and on gaps in the file."""

    def place(self, line: Line) -> str:
        """File and line, for comments."""
        return f"{PurePath(self.file).name}:{line}"

    def fact(self, value: object, line: Line, grade: Grade = "published", note: str = "") -> Fact:
        """A value in a line of the file."""
        return Fact(value, self.place(line), grade, note)

    def bytes_of(self, bits: int, line: Line) -> Fact:
        """Size of a device's data in whole bytes [bytes]."""
        return self.fact(ceil(bits / 8), line, note=f"{bits} bits")

    def number(self, key: str, text: str, line: Line, *, most: int) -> Fact:
        """A whole number, decimal or as #x1a00 or 0x1a00.

        A text that is no whole number from 0 to the largest raises BusplanError.
        """
        value = whole_number(text)
        if value is None or not 0 <= value <= most:
            shown = repr(text.strip()[:40])
            raise self.refusal(line, f"{key} {shown}: expected a whole number from 0 to {most}")
        return self.fact(value, line)

    def refusal(self, line: Line, message: str) -> BusplanError:
        """Error for something wrong in the file."""
        return BusplanError(f"{self.file}:{line}: {message}")


def whole_number(text: str) -> int | None:
    """A whole number, decimal or as #x1a00 or 0x1a00; None for any other text."""
    match = re.fullmatch(r"(?:(?:#x|0x)([0-9a-f]{1,16})|(-?[0-9]{1,18}))", text.strip().lower())
    return None if match is None else int(match[1], 16) if match[1] else int(match[2])


class ControlWords:
    """Control words of CiA 402 among the outputs of a device, one for each axis."""

    def __init__(self) -> None:
        self.lines: dict[int, Line] = {}
        """Line of each control word, by index of its object."""

    def add(self, index: int | None, sub: int | None, bits: int | None, line: Line) -> None:
        """Add an object mapped as an output, if it is a control word."""
        if index is not None and index in _CONTROL_WORDS and not sub and bits == _CONTROL_WORD_BITS:
            self.lines.setdefault(index, line)

    def axes(self, machine: Reading, *, line: Line | None) -> Fact:
        """Axes of the device; a `line` of None means that the file does not list its PDOs."""
        if line is None:
            return assumed(0, "no file says which PDOs it has")
        if not self.lines:
            return machine.fact(0, line, "derived", "no control word of CiA 402 in its PDOs")
        return machine.fact(len(self.lines), next(iter(self.lines.values())), "derived", "control words of CiA 402")


def merged(readings: Iterable[Reading]) -> Reading:
    """One record of several files of one machine, with remarks on their differences.

    Files of two kinds of bus, or of different devices, raise BusplanError.
    """
    ranked = sorted(readings, key=lambda reading: reading.rank)
    first = ranked[0]
    machine = Reading(first.kind, first.title, first.file, first.rank)
    differences: dict[str, list[str]] = {}
    for reading in ranked:
        if reading.kind != machine.kind:
            raise BusplanError(
                f"{first.file} is of {machine.kind} and {reading.file} of {reading.kind}: a profile describes one "
                "bus; give "
                "the files of one"
            )
        if machine.kind == "can" and (both := machine.nodes.keys() & reading.nodes.keys()):
            raise BusplanError(
                f"{first.file} and {reading.file} are both node {min(both)}; an EDS has no node-ID, give the DCF of "
                "each"
            )
        _add(machine.bus, reading.bus, "", differences)
        for number, facts in reading.nodes.items():
            _add(machine.nodes.setdefault(number, {}), facts, f"node {number}: ", differences)
        for number, facts in reading.messages.items():
            known = machine.messages.setdefault(number, {})
            # Bit 31 marks identifiers of 29 bits.
            shown = f"0x{number % (1 << 31):0{8 if number >> 31 else 3}X}"
            _add(known, facts, f"{(known | facts)['name'].value} ({shown}): ", differences)
        machine.slaves += reading.slaves
        machine.remarks += reading.remarks
    if machine.kind == "ethercat":
        _require_one_machine(ranked)
    for words, *more in differences.values():
        machine.remarks.append(f"{words}; the first is used{f', in {len(more)} more places, too' if more else ''}")
    return machine


def _add(facts: Facts, new: Mapping[str, Fact], owner: str, differences: dict[str, list[str]]) -> None:
    for key, fact in new.items():
        before = facts.setdefault(key, fact)
        if before.grade == "assumed" != fact.grade:
            facts[key] = fact
        elif before.value != fact.value and fact.grade != "assumed" and key not in _MAY_DIFFER:
            values = (f"{short_text(stated.value)} at {stated.place}" for stated in (before, fact))
            differences.setdefault(key, []).append(f"{owner}{key} is {' and '.join(values)}")


def _require_one_machine(readings: Sequence[Reading]) -> None:
    """Raise BusplanError for files of different devices. A file that need not list all may have fewer."""
    complete = max(readings, key=lambda reading: (reading.lists_all, len(reading.nodes)))
    for reading in readings:
        unlisted = reading.nodes.keys() - complete.nodes.keys()
        if unlisted or (reading.lists_all and reading.nodes.keys() != complete.nodes.keys()):
            raise BusplanError(
                f"{complete.file} has {len(complete.nodes)} devices and {reading.file} {len(reading.nodes)}: these are "
                "two machines, or one was changed; export both anew"
            )
    missing = [number for number in range(max(complete.nodes, default=0)) if number not in complete.nodes]
    if missing:
        raise BusplanError(
            f"{complete.file}: no device {missing[0]}, though there is device {max(complete.nodes)}; those that it "
            "leaves out delay frames, too: give the text of `ethercat slaves -v` beside it"
        )


_COMMENTS_AT: Final = 27
_LONGEST_NAME: Final = 32
_LONGEST_PROFILE_NAME: Final = 100
_UNITS: Final = {"us": 1.0, "ms": 1000.0}


class ProfileLine(NamedTuple):
    """A line of a profile."""

    section: str
    """Name of the section: bus, cycle, group.NAME, group.NAME.execution or message.NAME."""
    key: str
    fact: Fact

    @property
    def dotted(self) -> str:
        """Dotted key of the line."""
        return f"{self.section}.{self.key}"

    @property
    def plain(self) -> Any:
        """Value as in TOML."""
        return whole(self.fact.value)


def lines(section: str, facts: Mapping[str, Fact | None]) -> Iterator[ProfileLine]:
    """Lines for the known facts of a section."""
    return (ProfileLine(section, key, fact) for key, fact in facts.items() if fact is not None)


def execution_lines(group: str, base: Fact, per_byte: Fact) -> Iterator[ProfileLine]:
    """Section of a group's execution time, which no file gives."""
    facts = {"kind": assumed("linear"), "grade": assumed("assumed"), "base_us": base, "per_byte_us": per_byte}
    return lines(f"{group}.execution", facts)


def usual_period(kind: str) -> Fact:
    """Usual period on a kind of bus [us]."""
    text = kind_named(kind).starter.period
    return assumed(float(text[:-2]) * _UNITS[text[-2:]], "no file says it; usual on this bus")


def group_name(text: str, taken: set[str]) -> str:
    """A name for a group that is valid and not yet taken: letters, digits, - and _.

    Examples
    --------
    >>> taken = set()
    >>> group_name("L7EC-1000S/C(COE)", taken), group_name("L7EC-1000S/C(COE)", taken), group_name("2 drives", taken)
    ('L7EC-1000S-C-COE', 'L7EC-1000S-C-COE-2', 'n2-drives')
    """
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-")[:_LONGEST_NAME] or "node"
    name = name if name[0].isalpha() else f"n{name}"
    free, number = name, 1
    while free in taken:
        number += 1
        free = f"{name}-{number}"
    taken.add(free)
    return free


def profile_text(rows: Sequence[ProfileLine], *, name: str, readings: Sequence[Reading]) -> str:
    """Text of a profile, from lines that are sorted by section; the readings are for its description.

    A text larger than a profile may be raises BusplanError.
    """
    sources = ", ".join(f"{PurePath(reading.file).name} ({reading.title})" for reading in readings)
    head = [
        "schema_version = 1",
        f"name = {value_text(printable(name)[:_LONGEST_PROFILE_NAME].strip() or 'machine')}",
        f"description = {value_text(printable(f'Imported from {sources}')[:2000])}",
    ]
    text = "".join(f"{line}\n" for line in (*head, *_sections(rows)))
    content = text.encode("utf-8", "backslashreplace")
    if len(content) > MAX_FILE_BYTES:
        count = sum(row.key == "nodes" for row in rows)
        raise BusplanError(
            f"the profile would be larger than {MAX_FILE_BYTES:,} bytes: {count} groups of devices that differ from "
            "their neighbours; import a part of the machine"
        )
    return content.decode()


def _sections(rows: Sequence[ProfileLine]) -> Iterator[str]:
    for section, section_rows in groupby(rows, lambda row: row.section):
        yield ""
        first, _, rest = section.partition(".")
        name, _, inner = rest.partition(".")
        if inner:
            yield f"[{first}.{inner}]"
        elif name:
            yield f"[[{first}]]"
            yield f"name = {value_text(name)}"
        else:
            yield f"[{first}]"
        for row in section_rows:
            line, comment = f"{row.key} = {short_text(row.fact.value)}", row.fact.comment
            yield f"{line:{_COMMENTS_AT - 1}} # {comment}" if comment else line
