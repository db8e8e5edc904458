"""Random machines that keep a random plan, and machines with a fault, held against their plans by busplan.

A recording of each machine is written by `can_recording` or `ethercat_recording`, which know its truth. A fault is
larger than U, and occurs three times or more.
"""

import re
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import ceil
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

import busplan
from tests.oracles import can_recording as can
from tests.oracles import ethercat_recording as ethercat
from tests.oracles.random_plans import Plan, fitting

TRUTHS: Final = (
    # CAN
    (r"load", ("load",)),
    (r"last PDO (?:behind|after) SYNC", ("last PDO",)),
    (r"(.+): period", ("{} period",)),
    (r"(.+): jitter of the arrival", ("{} jitter",)),
    (r"(.+): sooner than its period", ("{} sooner",)),
    (r"(.+): data", ("{} data",)),
    (r"(.+): response", ("{} response",)),
    (r"cycles without SYNC", ("SYNC missing",)),
    (r"PDOs (missing|twice)", ("PDOs {}",)),
    (r"error frames", ("error frames",)),
    # EtherCAT
    (r"(period|latest start)", ("{}",)),
    (r"((?:round trip|frames in a cycle|datagrams of a cycle)(?: with .*)?)", ("{}",)),
    (r"master's time", ("master, least", "master, most")),
    (r"lost frames", ("lost",)),
    (r"wrong working counters", ("wrong",)),
    (r"cycles without a frame", ("without a frame",)),
)
"""What the emulator calls the truth of a figure, by its whole quantity; two names are ends of a range."""


# --- one machine --------------------------------------------------------------------------------------------


@dataclass
class Subject:
    """A random plan, a machine that keeps it, and its recordings."""

    kind: str
    seed: int
    folder: Path
    times_u: float = 3.0
    """How far a fault is beyond its plan, in U of the machine without it."""
    events: int = 5
    """How often it occurs, at least."""

    def __post_init__(self) -> None:
        self.plan, self.path = fitting(self.kind, self.seed, self.folder)
        self.random = Random(self.seed)
        self.cycles = self.length()
        self.recorder = self.random.choice(("1 us", "1 us", "100 us", "1 ms", "late")) if self.kind == "can" else ""
        # Stamps of 1 ms show nothing of a cycle under 2 ms.
        if self.recorder == "1 ms" and self.plan.get("cycle", {}).get("period_us", 2000) < 2000:
            self.recorder = "1 us"

    def length(self) -> int:
        """Cycles of the recording."""
        if self.kind == "ethercat":
            return round(10 ** self.random.uniform(1.7, 3.2))
        frames = sum(len(node.feedback + node.command) / node.every for node in can.nodes_of(self.plan))
        return round(10 ** self.random.uniform(2.5, 3.7) / (frames + 2)) + 20

    def machine(self, plan: Plan | None = None) -> Any:
        """A machine that keeps a plan, by default its own."""
        plan = plan or self.plan
        if self.kind == "ethercat":
            return ethercat.planned(plan, seed=self.seed)
        clock = 1 + Random(self.seed).uniform(-4e-5, 4e-5)
        step_us, latency_us = {"100 us": (100, 0), "1 ms": (1000, 0), "late": (1, 400)}.get(self.recorder, (1, 0))
        return can.Machine(plan, self.cycles, self.seed, clock, step_us=step_us, latency_us=latency_us)

    def recorded(self, machine: Any, name: str = "keeps") -> "Recording":
        """Recording of a machine, what it has in truth, and what busplan finds in it."""
        path = self.folder / f"{name.replace(' ', '-')}.{'log' if self.kind == 'can' else 'pcap'}"
        if self.kind == "can":
            content, truth = can.recorded(machine)
        else:
            content, truth = ethercat.recorded(machine, self.cycles, seed=self.seed)
        path.write_bytes(content)
        (file,) = busplan.check(self.path, recording=path, circle=False).files
        if file.failure:
            return Recording(self.path, path, truth, (("refused", file.failure),))
        findings = ((finding.severity, finding.message) for finding in file.findings if finding.code.startswith("BP40"))
        return Recording(self.path, path, truth, tuple(findings))

    @cached_property
    def clean(self) -> "Recording":
        """Of the machine that keeps its plan."""
        return self.recorded(self.machine())

    def with_fault(self, fault: "Fault") -> "Recording | None":
        """Of a machine with a fault; None where the plan has no place for it."""
        self.random = Random(f"{self.seed} {fault.name}")
        try:
            return self.recorded(fault.machine(self), fault.name)
        except NoPlaceError:
            return None

    def beyond(self, pattern: str) -> float:
        """A value some U beyond the planned one, of the first figure of such a quantity."""
        figures = (figure for quantity, figure in self.clean.figures.items() if re.fullmatch(pattern, quantity))
        figure = next(figures, None)
        if figure is None or None in (figure.planned, figure.recorded):
            raise NoPlaceError
        return float(figure.planned + self.times_u * (figure.uncertainty or 0))

    def some(self, every: int = 0) -> frozenset[int]:
        """Some cycles of the recording; in so many events the nodes have PDOs, those of a rate if it is given."""
        nodes = list(can.nodes_of(self.plan)) if self.kind == "can" else []
        rate = every or min((node.every for node in nodes), default=1)
        number = max(self.cycles // 50, self.events * rate)
        if 2 * number > self.cycles or (self.kind == "can" and not nodes):
            raise NoPlaceError
        return frozenset(self.random.sample(range(3, self.cycles), number))


@dataclass(frozen=True)
class Recording:
    """A recording."""

    profile: Path
    path: Path
    truth: dict[str, float]
    findings: tuple[tuple[str, str], ...]
    """Severity and words of what the gate finds."""

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Figures of `measured` by their quantity."""
        return {figure.quantity: figure for figure in busplan.measured(self.profile, self.path).figures}

    @property
    def errors(self) -> list[str]:
        """Words of what is no warning."""
        return [words for severity, words in self.findings if severity != "warning"]

    def judged(self) -> Iterator[tuple[str, bool]]:
        """Name of each figure whose truth is known, and whether it lies within its U of it.

        Counts and bytes without a U are exact; other figures without one say nothing.
        """
        for (quantity, figure), (pattern, names) in product(self.figures.items(), TRUTHS):
            match = re.fullmatch(pattern, quantity)
            keys = [name.format(*match.groups()) for name in names] if match else []
            ends = [self.truth[key] for key in keys if key in self.truth]
            is_said = figure.uncertainty is not None or figure.unit in ("1", "bytes")
            if ends and is_said and figure.recorded is not None:
                u = (figure.uncertainty or 0) + 1e-6
                yield quantity_of(quantity), min(ends) - u <= figure.recorded <= max(ends) + u


class NoPlaceError(Exception):
    """The plan has no place for a fault."""


# --- faults -------------------------------------------------------------------------------------------------


class Fault(NamedTuple):
    """A fault of a machine."""

    kind: str
    name: str
    machine: Callable[[Subject], Any]
    """The machine that has it."""
    named: str
    """What an error that names it says, as a regular expression; empty where any word of the gate does."""

    def is_named(self, recording: Recording) -> bool:
        """Whether the gate names it."""
        words = recording.errors if self.named else [words for _, words in recording.findings]
        return any(re.search(self.named, message) for message in words)


def commands_late(subject: Subject, least: float, most: float) -> Any:
    """Commands so late, in periods, that the last PDO is surely behind its plan."""
    late_us = max(subject.beyond("last PDO .*"), least * subject.machine().period_us)
    if late_us > most * subject.machine().period_us:
        raise NoPlaceError
    return replace(subject.machine(), late=dict.fromkeys(subject.some(), late_us))


def slow_commands_late(subject: Subject) -> Any:
    """The same of the nodes that are not due in every cycle."""
    slower = {number: node.every for number, node in enumerate(can.nodes_of(subject.plan)) if node.every > 1}
    machine = commands_late(subject, 0, 1.9)
    late = dict.fromkeys(subject.some(max(slower.values(), default=subject.cycles)), max(machine.late.values()))
    return replace(machine, late=late, late_nodes=frozenset(slower))


def sync_late(subject: Subject) -> Any:
    """SYNC with a jitter that is surely beyond its planned one."""
    late_us = 2 * subject.beyond("SYNC: jitter of the arrival")
    if late_us > subject.machine().period_us / 2:
        raise NoPlaceError
    return replace(subject.machine(), sync_jitter_us=late_us)


def other_period(subject: Subject) -> Any:
    """A machine at another period."""
    if "cycle" not in subject.plan:
        raise NoPlaceError
    period_us = subject.plan["cycle"]["period_us"] * subject.random.choice((2.0, 1.05, 0.98))
    return subject.machine(subject.plan | {"cycle": {"period_us": period_us}})


def most_frequent(subject: Subject) -> tuple[Plan, Plan]:
    """A plan to be changed, and in it the message of the shortest period; thirty of it come or so."""
    plan = deepcopy(subject.plan)
    message: Plan | None = min(plan["message"], key=lambda message: float(message["period_us"]), default=None)
    if message is None or message["period_us"] * 30 > subject.cycles * subject.machine().period_us:
        raise NoPlaceError
    return plan, message


def longer(subject: Subject) -> Any:
    """The most frequent message is longer by a byte, or by as many as a frame of FD has more."""
    plan, message = most_frequent(subject)
    size = can.padded(message["payload_bytes"])
    if size == (64 if message.get("fd") else 8):
        raise NoPlaceError
    message["payload_bytes"] = can.padded(size + 1)
    return subject.machine(plan)


def often(subject: Subject) -> Any:
    """The most frequent message comes twice as often."""
    plan, message = most_frequent(subject)
    message["period_us"] /= 2
    message["jitter_us"] = min(message["jitter_us"], message["period_us"])
    return replace(subject.machine(plan), manners={message["name"]: "periodic"})


def unplanned(subject: Subject) -> Any:
    """A message that is not planned, ten times."""
    period_us = subject.cycles * subject.machine().period_us / 10
    more = {"name": "unplanned", "identifier": 0x7EF, "identifier_bits": 11, "payload_bytes": 4, "period_us": period_us}
    return subject.machine(subject.plan | {"message": [*subject.plan["message"], more]})


def late_starts(subject: Subject) -> Any:
    """Starts surely later than planned."""
    late_us = subject.beyond("latest start") + subject.plan["bus"]["master_jitter_us"]
    return replace(subject.machine(), late=dict.fromkeys(subject.some(), late_us))


def more_devices(subject: Subject) -> Any:
    """So many couplers more that the round trip is surely longer than planned."""
    machine = subject.machine()
    more = ceil((subject.beyond("round trip( with .*)?") - subject.clean.truth["round trip"]) / (2 * ethercat.HOP_US))
    return replace(machine, line_us=machine.line_us + 2 * ethercat.HOP_US * max(more, 1))


def more_bytes(subject: Subject) -> Any:
    """All devices have more inputs and outputs."""
    plan = deepcopy(subject.plan)
    for section in plan.get("group") or [plan["payload"]]:
        section |= {"read_bytes": section["read_bytes"] + 4, "write_bytes": section["write_bytes"] + 4}
    return subject.machine(plan)


def in_a_row(subject: Subject) -> frozenset[int]:
    """A quarter of all cycles."""
    return frozenset(range(20, 20 + subject.cycles // 4))


ERRORS: Final = frozenset(range(40, 140, 20))
"""Places of error frames in the log."""
BEHIND: Final = "last PDO|late"
MISSED: Final = "missing|missed|without|skipped"
FAULTS: Final = (
    Fault("can", "commands late", lambda s: commands_late(s, 0, 0.9), BEHIND),
    Fault("can", "commands behind the next SYNC", lambda s: commands_late(s, 1.1, 1.9), BEHIND),
    Fault("can", "late in some due cycles", slow_commands_late, BEHIND),
    Fault("can", "SYNC late", sync_late, "SYNC|late"),
    Fault("can", "SYNC missing", lambda s: replace(s.machine(), no_sync=s.some()), f"{MISSED}|SYNC"),
    Fault("can", "commands missing", lambda s: replace(s.machine(), no_commands=s.some()), f"{MISSED}|command"),
    Fault("can", "feedback missing", lambda s: replace(s.machine(), no_feedback=s.some()), f"{MISSED}|feedback"),
    Fault("can", "feedback twice", lambda s: replace(s.machine(), twice=s.some()), "feedback|twice|PDO"),
    Fault("can", "other period", other_period, "period"),
    Fault("can", "error frames", lambda s: replace(s.machine(), destroyed=ERRORS), "error frame"),
    Fault("can", "longer payload", longer, "data"),
    Fault("can", "unknown identifier", unplanned, "7ef|no message"),
    Fault("can", "message too often", often, "period|distance|often"),
    Fault("ethercat", "cycles skipped", lambda s: replace(s.machine(), skipped=s.some()), MISSED),
    Fault("ethercat", "skipped in a row", lambda s: replace(s.machine(), skipped=in_a_row(s)), MISSED),
    Fault("ethercat", "frames lost", lambda s: replace(s.machine(), lost=s.some()), "lost"),
    Fault("ethercat", "wrong working counters", lambda s: replace(s.machine(), wrong=s.some()), "counter"),
    Fault("ethercat", "late start", late_starts, "start"),
    Fault(
        "ethercat", "slower master", lambda s: replace(s.machine(), host_us=s.beyond("master's time")), "master|trip"
    ),
    Fault("ethercat", "other period", other_period, "period"),
    Fault("ethercat", "more bytes", more_bytes, "datagrams|bytes"),
    Fault("ethercat", "more devices", more_devices, "trip|master|device"),
)
HIDDEN: Final = (
    Fault("can", "stamps of whole seconds", lambda s: replace(s.machine(), step_us=1e6), ""),
    Fault("can", "few frames", lambda s: replace(s.machine(), cycles=1), ""),
    Fault("ethercat", "stamps of no port", lambda s: replace(s.machine(), at_port=False), ""),
    Fault("ethercat", "dropped packets", lambda s: replace(s.machine(), form="pcapng ns", dropped=5), ""),
)
"""Recordings that do not show whether a machine keeps its plan."""


def quantity_of(words: str) -> str:
    """A figure, or what a finding is about, without key, names and numbers."""
    words = re.sub(r"^\w+\.\S+: |^name: |[:,]? [\d.,]+ .*| with .*", "", words)
    return re.sub(r".+(?=: (period|jitter|data|shortest|sooner))", "…", words)
