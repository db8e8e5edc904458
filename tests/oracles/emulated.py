"""Random machines that keep a random plan, and machines with a fault, held against their plans by busplan.

    python -m tests.oracles.emulated --count 100 --seed 1 --kind can --fault "SYNC missing" --keep /tmp/missed

Of each machine a recording is written by `can_recording` or `ethercat_recording`, which know the truth of it. Said are:
how many machines without a fault have an error of the gate; how many of the figures of `measured` lie within their U of
the truth; and how often the gate names each fault. A fault is larger than U, and occurs three times or more.
"""

import argparse
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import ceil
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import tomli_w

import busplan
from tests.oracles import can_recording as can
from tests.oracles import ethercat_recording as ethercat

Plan = dict[str, Any]
TRUTHS: Final = (
    # CAN
    (r"load", "load"),
    (r"last PDO behind SYNC", "last PDO"),
    (r"(.+): period", "{} period"),
    (r"(.+): jitter of the arrival", "{} jitter"),
    (r"(.+): data", "{} data"),
    (r"error frames", "error frames"),
    # EtherCAT
    (r"period", "period"),
    (r"latest start", "latest start"),
    (r"round trip", "round trip"),
    (r"master's time", ("master, least", "master, most")),
    (r"frames in a cycle", "frames in a cycle"),
    (r"datagrams of a cycle", "datagrams"),
    (r"lost frames", "lost"),
    (r"wrong working counters", "wrong"),
    (r".*without a frame", "without a frame"),
)
"""What the emulator calls the truth of a figure, by its whole quantity; two names are ends of a range."""


# --- random plans -------------------------------------------------------------------------------------------


def execution(random: Random, most_us: float) -> Plan:
    """Execution time of a node."""
    base_us = round(random.uniform(0.1, 1) * most_us)
    extra_us = random.choice((0, base_us // 5))
    grade = random.choice(("measured", "assumed"))
    return {"kind": "linear", "base_us": base_us, "per_byte_us": 0.5, "worst_extra_us": extra_us, "grade": grade}


def can_plan(random: Random) -> Plan:
    """Nodes that are alike, groups, or messages alone; classical or FD."""
    rate, fd, extended = random.choice((125, 250, 500, 1000)), random.random() < 0.3, random.random() < 0.2
    bus: Plan = {"kind": "can", "bit_rate_kbit_s": rate}
    if fd:
        bus["data_bit_rate_kbit_s"] = rate * random.choice((1, 2, 4))
    if extended:
        bus["identifier_bits"] = 29
    plan: Plan = {"bus": bus}
    form = random.choice(("nodes", "groups", "messages"))
    if form != "messages":
        bus |= random.choice(({"pipeline_cycles": 1}, {"host_us": random.randint(20, 300), "host_grade": "measured"}))
        bus["sync_counter"] = random.random() < 0.3
        plan["cycle"] = {"period_us": random.choice((1000, 2000, 4000, 5000))}
    if form == "nodes":
        bus["nodes"] = random.randint(1, 8)
        plan["payload"] = pdos(random, fd=fd)
        plan["node"] = {"axes": random.randint(1, 2), "execution": execution(random, 300)}
    elif form == "groups":
        plan["group"] = [
            {"name": name, "nodes": random.randint(1, 4), "axes": 1, "execution": execution(random, 300)}
            | pdos(random, fd=fd)
            for name in ("drives", "valves", "inputs")[: random.randint(1, 3)]
        ]
    # Blocks of 16 identifiers before and behind those of PDOs.
    blocks = random.sample((*range(8), *range(0x59, 0x78)), random.randint(form == "messages", 8))
    plan["message"] = [can_message(random, plan, 16 * block, has_nodes=form != "messages") for block in blocks]
    plan["limits"] = {"max_load": random.choice((0.6, 0.8, 0.95))}
    return plan


def pdos(random: Random, *, fd: bool) -> Plan:
    """Payload of a node."""
    most = random.choice((8, 8, 64 if fd else 20))
    found: Plan = {"read_bytes": random.randint(1, most), "write_bytes": random.randint(1, most)}
    found["every"] = random.choice((1, 1, 2, 5))
    if random.random() < 0.2:
        found = {"feedback_pdos": [random.randint(1, 8) for _ in range(2)], "command_pdos": [6], "pdo_per": "axis"}
    return found


def can_message(random: Random, plan: Plan, identifier: int, *, has_nodes: bool) -> Plan:
    """Another message."""
    fd = "data_bit_rate_kbit_s" in plan["bus"] and random.random() < 0.7
    period_us = random.choice((5, 10, 20, 50, 100, 200)) * 1000
    message: Plan = {"name": f"message-{identifier:x}", "identifier": identifier + 1, "period_us": period_us}
    message["payload_bytes"] = random.randint(0, 64 if fd else 8)
    message["jitter_us"] = round(random.choice((0, 0.05, 0.3, 1)) * period_us)
    message["deadline_us"] = round(random.choice((1, 1, 2, 0.5)) * period_us)
    if fd:
        message["fd"] = True
    if has_nodes and random.random() < 0.2:
        message["per_node"] = True
    elif random.random() < 0.2:
        message |= {"identifier_bits": 29, "identifier": identifier << 18 | random.randrange(1 << 18)}
    return message


def ethercat_plan(random: Random) -> Plan:
    """Devices that are alike, or groups at several rates."""
    master_us = random.choice((5, 25, 60, 150))
    bus: Plan = {"kind": "ethercat", "master_us": master_us, "master_jitter_us": random.choice((1, 10, 10, 30))}
    bus["master_grade"] = random.choice(("measured", "measured", "assumed"))
    bus["distributed_clocks"] = random.random() < 0.6
    bus["units"] = random.choice(("spread", "spread", "together"))
    if random.random() < 0.8:
        bus["master"] = random.choice(("SOEM", "IgH", "ethercrab", "TwinCAT", "acontis"))
    if random.random() < 0.2:
        bus["process_data"] = random.choice(("LRW-separate", "LRW-shared", "LRD-LWR"))
    if random.random() < 0.2:
        bus["mailbox_polls"] = 1
    plan: Plan = {"bus": bus, "cycle": {"period_us": random.choice((250, 500, 1000, 2000))}}
    if random.random() < 0.4:
        bus["nodes"] = random.randint(1, 40)
        plan["payload"] = {"read_bytes": random.randint(1, 60), "write_bytes": random.randint(1, 60)}
        plan["node"] = {"axes": 1, "execution": execution(random, 60)} | port(random)
        return plan
    rates = [1 if random.random() < 0.9 else 2] + [random.choice((1, 2, 2, 4, 8)) for _ in range(random.randint(1, 4))]
    random.shuffle(rates)
    plan["group"] = [
        {"name": f"unit-{place}", "nodes": random.randint(1, 10), "axes": random.randint(0, 1), "every": every}
        | {"read_bytes": random.randint(1, 40), "write_bytes": random.randint(1, 40)}
        | {"execution": execution(random, 60)}
        | port(random)
        for place, every in enumerate(rates)
    ]
    return plan


def port(random: Random) -> Plan:
    """Ports of a device, and the cable to it."""
    ports: tuple[Plan, ...] = ({}, {"port": "E-bus"}, {"cable_m": random.randint(1, 20)}, {"delay_us": 0.72})
    return random.choice(ports)


def fitting(kind: str, seed: int, folder: Path) -> tuple[Plan, Path]:
    """A random plan that fits by busplan, and its file; periods that are too short are doubled."""
    random = Random(f"{kind} {seed}")
    path = folder / "plan.toml"
    while True:
        plan = {"schema_version": 1, "name": f"{kind}-{seed}"} | PLANS[kind](random)
        for _ in range(6):
            path.write_text(tomli_w.dumps(plan))
            if busplan.capacity(path).fits:
                return plan, path
            for section in (*filter(None, [plan.get("cycle")]), *plan.get("message", ())):
                section |= {key: 2 * section[key] for key in ("period_us", "deadline_us") if key in section}


PLANS: Final = {"can": can_plan, "ethercat": ethercat_plan}


# --- one machine --------------------------------------------------------------------------------------------


@dataclass
class Subject:
    """A random plan, a machine that keeps it, and its recordings."""

    kind: str
    seed: int
    folder: Path

    def __post_init__(self) -> None:
        self.plan, self.path = fitting(self.kind, self.seed, self.folder)
        self.random = Random(self.seed)
        self.cycles = self.length()
        self.recorder = self.random.choice(("1 us", "1 us", "100 us", "1 ms", "late")) if self.kind == "can" else ""

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

    def recorded(self, machine: Any, name: str = "keeps") -> tuple[Path, dict[str, float]]:
        """Recording of a machine, and its truth."""
        path = self.folder / f"{name.replace(' ', '-')}.{'log' if self.kind == 'can' else 'pcap'}"
        if self.kind == "can":
            text, truth = can.recorded(machine)
            path.write_text(text)
        else:
            content, truth = ethercat.recorded(machine, self.cycles, seed=self.seed)
            path.write_bytes(content)
        return path, truth

    @cached_property
    def clean(self) -> tuple[Path, dict[str, float]]:
        """Recording of the machine that keeps its plan."""
        return self.recorded(self.machine())

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Figures of that recording by their quantity."""
        return {figure.quantity: figure for figure in busplan.measured(self.path, self.clean[0]).figures}

    def judged(self) -> Iterator[tuple[str, bool]]:
        """Name of the truth of each figure that has one, and whether the figure lies within its U of it."""
        for quantity, figure in self.figures.items():
            for pattern, names in TRUTHS:
                match = re.fullmatch(pattern, quantity)
                if match is None:
                    continue
                ends = [
                    self.clean[1].get(name.format(*match.groups()))
                    for name in ((names,) if isinstance(names, str) else names)
                ]
                is_judged = figure.uncertainty is not None or figure.unit in ("1", "bytes")
                if figure.recorded is not None and is_judged and None not in ends:
                    u = (figure.uncertainty or 0) + 1e-6
                    is_within = min(ends) - u <= figure.recorded <= max(ends) + u  # type: ignore[type-var,operator]
                    yield re.sub(r"\(\.\+\)|\.\*", "…", pattern), is_within
                break

    def beyond(self, quantity: str) -> float:
        """A value three U beyond the planned one."""
        figure = self.figures.get(quantity)
        if figure is None or figure.planned is None:
            raise NoPlaceError
        return float(figure.planned + 3 * figure.uncertainty)

    def some(self, every: int = 0) -> frozenset[int]:
        """Some cycles of the recording; five of them or more have PDOs, those of nodes with a rate where it is said."""
        nodes = list(can.nodes_of(self.plan)) if self.kind == "can" else []
        each = every or min((node.every for node in nodes), default=1)
        number = max(self.cycles // 50, 5 * each)
        if 2 * number > self.cycles or (self.kind == "can" and not nodes):
            raise NoPlaceError
        return frozenset(self.random.sample(range(3, self.cycles), number))

    def found(self, recording: Path) -> list[tuple[str, str]]:
        """Severity and words of what the gate finds in a recording."""
        (file,) = busplan.check(self.path, recording=recording, circle=False).files
        if file.failure:
            return [("refused", file.failure)]
        return [(one.severity, one.message) for one in file.findings if one.code.startswith("BP40")]

    def found_with(self, fault: "Fault") -> list[tuple[str, str]] | None:
        """The same of a machine with a fault; None where the plan has no place for it."""
        self.random = Random(f"{self.seed} {fault.name}")
        try:
            return self.found(self.recorded(fault.machine(self), fault.name)[0])
        except NoPlaceError:
            return None


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
    """What a finding that names it says, as a regular expression."""


def commands_late(subject: Subject, least: float, most: float) -> Any:
    """Commands so late, in periods, that the last PDO is surely behind its plan."""
    late_us = max(subject.beyond("last PDO behind SYNC"), least * subject.machine().period_us)
    if late_us > most * subject.machine().period_us:
        raise NoPlaceError
    return replace(subject.machine(), late=dict.fromkeys(subject.some(), late_us))


def slow_commands_late(subject: Subject) -> Any:
    """The same of the nodes that are not due in every cycle."""
    slower = {number: node.every for number, node in enumerate(can.nodes_of(subject.plan)) if node.every > 1}
    if not slower:
        raise NoPlaceError
    machine = commands_late(subject, 0, 1.9)
    late = dict.fromkeys(subject.some(max(slower.values())), max(machine.late.values()))
    return replace(machine, late=late, late_nodes=frozenset(slower))


def of_plan(subject: Subject, change: Callable[[Plan], bool], **more: Any) -> Any:
    """A machine of a plan with a change."""
    plan = deepcopy(subject.plan)
    if not change(plan):
        raise NoPlaceError
    return replace(subject.machine(plan), **more)


def other_period(subject: Subject) -> Any:
    """A machine at another period."""
    if "cycle" not in subject.plan:
        raise NoPlaceError
    period_us = subject.plan["cycle"]["period_us"] * subject.random.choice((2.0, 1.05, 0.98))
    return subject.machine({**subject.plan, "cycle": {"period_us": period_us}})


def longer(plan: Plan) -> bool:
    """Make a message longer by a byte, of FD by as many as a frame can."""
    for message in plan["message"]:
        size = can.padded(message["payload_bytes"])
        if size < (64 if message.get("fd") else 8):
            message["payload_bytes"] = can.padded(size + 1)
            return True
    return False


def often(subject: Subject) -> Any:
    """The most frequent message comes twice as often."""
    messages = subject.plan["message"]
    place = min(range(len(messages)), key=lambda place: float(messages[place]["period_us"]), default=None)
    if place is None or messages[place]["period_us"] * 10 > subject.cycles * subject.machine().period_us:
        raise NoPlaceError
    half_us = messages[place]["period_us"] / 2
    faster = {**messages[place], "period_us": half_us, "jitter_us": min(messages[place]["jitter_us"], half_us)}
    plan = {**subject.plan, "message": [*messages[:place], faster, *messages[place + 1 :]]}
    return replace(subject.machine(plan), manners={faster["name"]: "periodic"})


def unplanned(subject: Subject) -> Any:
    """Ten frames or so of a message that is not planned."""
    period_us = subject.cycles * subject.machine().period_us / 10
    more = {"name": "unplanned", "identifier": 0x7EF, "identifier_bits": 11, "payload_bytes": 4, "period_us": period_us}
    return subject.machine({**subject.plan, "message": [*subject.plan["message"], more]})


def late_starts(subject: Subject) -> Any:
    """Starts surely later than planned."""
    late_us = subject.beyond("latest start") + subject.plan["bus"]["master_jitter_us"]
    return replace(subject.machine(), late=dict.fromkeys(subject.some(), late_us))


def more_devices(subject: Subject) -> Any:
    """So many couplers more that the round trip is surely longer than planned."""
    machine = subject.machine()
    more = ceil((subject.beyond("round trip") - subject.clean[1]["round trip"]) / (2 * ethercat.HOP_US))
    return replace(machine, line_us=machine.line_us + 2 * ethercat.HOP_US * max(more, 1))


def more_bytes(plan: Plan) -> bool:
    """All devices have more inputs and outputs."""
    for section in plan.get("group", [plan.get("payload")]):
        section |= {"read_bytes": section["read_bytes"] + 4, "write_bytes": section["write_bytes"] + 4}
    return True


def in_a_row(subject: Subject) -> frozenset[int]:
    """A quarter of all cycles."""
    return frozenset(range(20, 20 + subject.cycles // 4))


ERRORS: Final = frozenset(range(40, 140, 20))
"""Places of error frames in the log."""
BEHIND: Final = "last PDO|late"
MISSED: Final = "missing|missed|without a frame|skipped"
FAULTS: Final = (
    Fault("can", "commands late", lambda s: commands_late(s, 0, 0.9), BEHIND),
    Fault("can", "commands behind the next SYNC", lambda s: commands_late(s, 1.1, 1.9), BEHIND),
    Fault("can", "late in some due cycles", slow_commands_late, BEHIND),
    Fault("can", "SYNC missing", lambda s: replace(s.machine(), no_sync=s.some()), f"{MISSED}|SYNC"),
    Fault("can", "commands missing", lambda s: replace(s.machine(), no_commands=s.some()), f"{MISSED}|command"),
    Fault("can", "feedback missing", lambda s: replace(s.machine(), no_feedback=s.some()), f"{MISSED}|feedback"),
    Fault("can", "feedback twice", lambda s: replace(s.machine(), twice=s.some()), "feedback|twice|PDO"),
    Fault("can", "other period", other_period, "period"),
    Fault("can", "error frames", lambda s: replace(s.machine(), destroyed=ERRORS), "error frame"),
    Fault("can", "longer payload", lambda s: of_plan(s, longer), "data"),
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
    Fault("ethercat", "more bytes", lambda s: of_plan(s, more_bytes), "datagrams|bytes"),
    Fault("ethercat", "more devices", more_devices, "trip|master|device"),
)
HIDDEN: Final = (
    Fault("can", "stamps of whole seconds", lambda s: replace(s.machine(), step_us=1e6), ""),
    Fault("can", "few frames", lambda s: replace(s.machine(), cycles=1), ""),
    Fault("ethercat", "stamps of no port", lambda s: replace(s.machine(), at_port=False), ""),
    Fault("ethercat", "dropped packets", lambda s: replace(s.machine(), form="pcapng ns", dropped=5), ""),
)
"""Recordings that do not show whether a machine keeps its plan: any word of the gate is right."""


# --- many machines ------------------------------------------------------------------------------------------


class Tried(NamedTuple):
    """What busplan says of a machine."""

    recorder: str
    errors: tuple[str, ...]
    """Of the machine without a fault."""
    judged: tuple[tuple[str, bool], ...]
    found: dict[str, tuple[bool, bool]]
    """Of each fault whether there is an error, and one that names it; of recordings that hide, whether any word."""


def tried(kind: str, seed: int, only: str = "", keep: Path | None = None) -> Tried:
    """Emulate a machine, and it with each fault."""
    with TemporaryDirectory() as name:
        subject = Subject(kind, seed, Path(name) if keep is None else keep / f"{kind}-{seed}")
        subject.folder.mkdir(parents=True, exist_ok=True)
        errors = tuple(words for severity, words in subject.found(subject.clean[0]) if severity != "warning")
        each = {}
        for fault in (*FAULTS, *HIDDEN):
            if fault.kind != kind or only not in fault.name:
                continue
            findings = subject.found_with(fault)
            if findings is not None:
                said = [words for severity, words in findings if severity != "warning" or not fault.named]
                each[fault.name] = bool(said), any(re.search(fault.named, words) for words in said)
        return Tried(subject.recorder or subject.machine().form, errors, tuple(subject.judged()), each)


def main() -> None:
    """Try many machines, and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=20, help="machines of each kind")
    parser.add_argument("--seed", type=int, default=1, help="of the first of them")
    parser.add_argument("--kind", choices=PLANS, action="append", help="kind of bus; without it both")
    parser.add_argument("--fault", default="", help="only faults with this in their name")
    parser.add_argument("--keep", type=Path, help="folder for all plans and recordings")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    said = parser.parse_args()
    for kind in said.kind or PLANS:
        seeds = range(said.seed, said.seed + said.count)
        with ProcessPoolExecutor(said.jobs) as pool:
            each = list(pool.map(partial(tried, kind, only=said.fault, keep=said.keep), seeds))
        print(f"\n{kind}: {len(each)} machines, {sum(bool(one.errors) for one in each)} have an error without a fault")
        table("stamps", "errors", ((one.recorder, (bool(one.errors),)) for one in each))
        table("error without a fault", "", ((quantity_of(words), ()) for one in each for words in one.errors))
        table("figure", "within U", ((name, (is_within,)) for one in each for name, is_within in one.judged))
        table("fault", "error  named", (pair for one in each for pair in one.found.items()))
        wrong = [seed for seed, one in zip(seeds, each, strict=True) if one.errors]
        print(f"seeds with an error without a fault: {', '.join(map(str, wrong)) or 'none'}")


def quantity_of(words: str) -> str:
    """What a finding is about, without its key and numbers, the same for all messages."""
    return re.sub(r"^\S+: |[:,]? [\d.,]+ .*", "", re.sub(r"message-\w+", "…", words)) or words


def table(name: str, shares: str, rows: Iterable[tuple[str, tuple[bool, ...]]]) -> None:
    """Print how many rows of each name there are, and the shares of their values."""
    by_name: dict[str, list[tuple[bool, ...]]] = defaultdict(list)
    for key, values in rows:
        by_name[key].append(values)
    print(f"\n{name:40}     n  {shares}")
    for key, values in by_name.items():
        means = (f"{sum(column) / len(column):8.1%}" for column in zip(*values, strict=True))
        print(f"{key:40} {len(values):5}", *means)


if __name__ == "__main__":
    main()
