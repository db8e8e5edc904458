"""Facts that files give of a machine, with grade and place; and several files of one machine as one record."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any, Final, NamedTuple, TypeAlias

from busplan.errors import BusplanError
from busplan.printable import printable
from busplan.profile.write import short_text
from busplan.sourced import Grade

_MAY_DIFFER: Final = ("name", "master", "clock_us")
"""Facts that may differ from file to file."""


Line: TypeAlias = int | str
"""Number of a line, with ":" and the column where the file has long lines."""


class Fact(NamedTuple):
    """A value of a machine, how well it is known, and where it stands."""

    value: Any
    place: str = ""
    """File and line; empty for what no file says."""
    grade: Grade = "published"
    note: str = ""

    @property
    def comment(self) -> str:
        """Grade, note and place, as the comment of a profile's line; empty where there is nothing to say."""
        rest = ", ".join(filter(None, (self.note, self.place)))
        return printable(f"{self.grade}: {rest}") if rest else ""


Facts = dict[str, Fact]


@dataclass
class Reading:
    """Facts of a machine from one file, or from several together.

    Parameters
    ----------
    kind
        Kind of bus.
    title
        The format, as messages name it.
    file
        Name of the file.
    rank
        Where files say different values, that of the smallest rank counts.
    """

    kind: str
    title: str
    file: str
    rank: int
    bus: Facts = field(default_factory=dict)
    """The bus, its master and its cycle."""
    nodes: dict[int, Facts] = field(default_factory=dict)
    """Devices by their place in the segment, from 0; CANopen nodes by their node-ID."""
    messages: dict[int, Facts] = field(default_factory=dict)
    """Messages of a CAN bus by their identifier."""
    lists_all: bool = True
    """Whether the file lists all devices of the machine."""
    is_log: bool = False
    """Whether the file is a recording of the bus."""
    remarks: list[str] = field(default_factory=list)
    """Sentences on what the file says and a profile cannot, or what the file leaves open."""

    def place(self, line: Line) -> str:
        """File and line, for comments."""
        return f"{PurePath(self.file).name}:{line}"

    def refusal(self, line: Line, message: str) -> BusplanError:
        """Make the error for something wrong in the file."""
        return BusplanError(f"{self.file}:{line}: {message}")


def merged(machines: Iterable[Reading]) -> Reading:
    """One record of several files of one machine; where they differ, it says so.

    Raises
    ------
    BusplanError
        They are of two kinds of bus, or have not the same devices.
    """
    first, *others = sorted(machines, key=lambda machine: machine.rank)
    whole = Reading(first.kind, first.title, first.file, first.rank)
    differences: dict[str, list[str]] = {}
    for machine in (first, *others):
        if machine.kind != whole.kind:
            raise BusplanError(
                f"{first.file} is of {whole.kind} and {machine.file} of {machine.kind}: a profile is one bus; give the "
                "files of one"
            )
        _add(whole.bus, machine.bus, "", differences)
        if whole.kind == "can" and (same := whole.nodes.keys() & machine.nodes.keys()):
            raise BusplanError(
                f"{first.file} and {machine.file} are both node {min(same)}; an EDS has no node-ID, give the DCF of "
                "each"
            )
        for whose, of_whole, new in (
            ("node", whole.nodes, machine.nodes),
            ("message", whole.messages, machine.messages),
        ):
            for number, facts in new.items():
                _add(of_whole.setdefault(number, {}), facts, f"{whose} {number}: ", differences)
        whole.remarks += machine.remarks
    if whole.kind == "ethercat":
        _require_one_machine([first, *others])
    for said, *more in differences.values():
        whole.remarks.append(f"{said}; the first is taken{f', in {len(more)} more places, too' if more else ''}")
    return whole


def _require_one_machine(machines: Sequence[Reading]) -> None:
    """Refuse files of different devices; one that needs not list all may have fewer."""
    complete = max(machines, key=lambda machine: (machine.lists_all, len(machine.nodes)))
    for machine in machines:
        unlisted = machine.nodes.keys() - complete.nodes.keys()
        if unlisted or (machine.lists_all and machine.nodes.keys() != complete.nodes.keys()):
            raise BusplanError(
                f"{complete.file} has {len(complete.nodes)} devices and {machine.file} {len(machine.nodes)}: these are "
                "two machines, or one was changed; export both anew"
            )
    missing = [number for number in range(max(complete.nodes, default=0)) if number not in complete.nodes]
    if missing:
        raise BusplanError(
            f"{complete.file}: no device {missing[0]}, though there is device {max(complete.nodes)}; those that it "
            "leaves out delay frames, too: give the text of `ethercat slaves -v` beside it"
        )


def _add(own: Facts, new: Mapping[str, Fact], whose: str, differences: dict[str, list[str]]) -> None:
    for key, fact in new.items():
        known = own.setdefault(key, fact)
        if known.grade == "assumed" != fact.grade:
            own[key] = fact
        elif known.value != fact.value and fact.grade != "assumed" and key not in _MAY_DIFFER:
            values = (f"{short_text(stated.value)} at {stated.place}" for stated in (known, fact))
            differences.setdefault(key, []).append(f"{whose}{key} is {' and '.join(values)}")
