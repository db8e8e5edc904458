"""Profile of a CAN bus: CANopen nodes in groups, and all other messages."""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from busplan.buses.can.equations import USUAL_DATA_BIT_RATE
from busplan.buses.can.traffic import HOST
from busplan.english import first_of
from busplan.errors import BusplanError
from busplan.questions.import_.can_database import EXTENDED
from busplan.questions.import_.canopen import Pdo
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

if TYPE_CHECKING:
    from busplan.recordings.can_timing import EventModel

_DIRECTIONS: Final = {"feedback": "read_bytes", "command": "write_bytes"}
_FRAME_BYTES: Final = 8
_FD_BYTES: Final = 64
_PDO_STEP: Final = 0x100
_MOST_PDOS: Final = 4
_SYNC_ID: Final = 0x80
_MOST_NODE: Final = 127
_HEARTBEAT_ID: Final = 0x700
_OF_THE_HOST: Final = (0x000, 0x100)
"""Identifiers of NMT and TIME in the predefined connection set (CiA 301). That of SYNC is in the profile."""
_BY_THE_NODE: Final = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, _HEARTBEAT_ID)
_BY_THE_HOST: Final = (0x200, 0x300, 0x400, 0x500, 0x600)
"""Offsets from a node-ID in that set: emergency, TPDOs, SDO and heartbeat; RPDOs and SDO."""
_EMERGENCY_US: Final = 1_000_000.0
"""Assumed time between two emergencies of a node, which it sends once for each fault [us]."""
BIT_RATE: Final = "bit_rate_kbit_s"
LEAST, SHOWN, ASK = "least_bit_rate", "shown_bit_rate", "ask_bit_rate"
"""Keys for a log's own bit rate: the least possible one, the one that its frames show, or the question for it."""
FULLEST, SENT = "fullest", "sent"
"""Keys for the fullest second of a log, and for the stamps of a message in it, with their step [us]."""
MOST_OF_FULLEST: Final = 1.2
"""Largest load of a log's plan over that of its fullest second, in which its messages come at the same times [1]."""
_MOST_JITTER: Final = 0.5
"""Largest jitter of a periodic message whose deadline is its period [periods]."""
_CLEARLY: Final = 0.02
"""Share by which a recorded period must be shorter than a database's to count [1]."""
_DATA_BIT_RATE: Final = "data_bit_rate_kbit_s"
_USUAL_BIT_RATE: Final = 1000
"""Usual bit rate of machines [kbit/s]."""
_USUAL_OF_CARS: Final = 500
"""Usual bit rate of networks of messages alone [kbit/s]."""
_LISTED: Final = 8
_NAMES_OF_CYCLE: Final = ("SYNC", "loop", "feedback", "command")
_OF_A_MESSAGE: Final = ("sender", "payload_bytes", "period_us", "period_grade", "jitter_us", "burst", "deadline_us")
_ASSUME: Final = "a log of the bus beside it shows it, and --period 100ms takes one for all such messages, as assumed"
_BASE_BITS: Final = 11
_EXTENDED_BITS: Final = 29


class MostLoad(NamedTuple):
    """The fullest second of a log."""

    load: Callable[..., float]
    """Load by the bit rate and the data bit rate [kbit/s], each frame as long as the longest of its identifier."""
    seconds: int
    """Seconds of the log with frames [1]."""
    of_seconds: int
    """All seconds of the log, the partial last one included [1]."""


def timing_facts(model: "EventModel", period_us: float, place: str, *, is_periodic: bool) -> Iterator[tuple[str, Fact]]:
    """Jitter and burst of a message by a log; and that it has no deadline, where that is not its period."""
    burst, jitter_us = model
    if jitter_us:
        note = "of the arrival, waiting for other frames included" if is_periodic else "the soonest after another"
        yield "jitter_us", Fact(jitter_us, place, "measured", note)
    if burst > 1:
        yield "burst", Fact(burst, place, "measured", "largest burst")
    if not is_periodic or burst > 1 or jitter_us > _MOST_JITTER * period_us:
        yield "deadline_us", assumed("none", "not given, and the message is not periodic")


class _Node(NamedTuple):
    """A CANopen node in the cycle."""

    number: int
    facts: Facts
    sent: dict[str, list[Pdo]]
    """PDOs of each direction that share one payload."""

    @property
    def every(self) -> int:
        """Number n of the PDOs, which go with every n-th SYNC."""
        return self.sent["feedback"][0].every


def rows(machine: Reading) -> Iterator[ProfileLine]:
    """Lines of the profile, without its head; of messages alone if no node has PDOs with SYNC both ways.

    Without messages, too, it raises BusplanError; also if only a log has them, no bit rate is given and the log shows
    none.
    """
    bus, nodes = machine.bus, list(_nodes(machine))
    _require_slaves(machine)
    runs = [[node for _, node in run] for _, run in groupby(enumerate(nodes), lambda item: _looks(item[0], item[1]))]
    taken: set[str] = set()
    groups = [(group_name(str(run[0].facts["name"].value), taken), run) for run in runs]
    owners = {node.number: name for name, run in groups for node in run}
    extended = sum(number >= EXTENDED for number in machine.messages)
    bits = _EXTENDED_BITS if not nodes and 2 * extended > len(machine.messages) else _BASE_BITS
    messages = list(_messages(machine, nodes, owners, usual_bits=bits))
    if not (nodes or messages):
        reason = "no message with a period, and no node with PDOs"
        raise BusplanError(f"{machine.file}: {reason}; {_ASSUME}", *machine.remarks)
    yield ProfileLine("bus", "kind", machine.fact("can", 1))
    if BIT_RATE not in bus and ASK in bus:
        raise BusplanError(bus[ASK].value)
    usual = assumed(_USUAL_OF_CARS, "not in any file; all times depend on it")
    if nodes:
        usual = assumed(_USUAL_BIT_RATE, "no file says it; the cable decides")
    yield ProfileLine("bus", BIT_RATE, bus.get(BIT_RATE) or usual)
    if sum(row.key == "fd" for row in messages) > sum(row.key == "brs" for row in messages):
        note = f"no file says it{'; SYNC and PDOs are FD frames with it, too' if nodes else ''}"
        yield ProfileLine("bus", _DATA_BIT_RATE, bus.get(_DATA_BIT_RATE) or assumed(USUAL_DATA_BIT_RATE, note))
    if bits != _BASE_BITS:
        yield ProfileLine("bus", "identifier_bits", machine.fact(bits, 1, note="used by most messages"))
    if nodes:
        yield from lines("bus", {key: bus.get(key) for key in ("sync_identifier", "sync_counter")})
        yield ProfileLine("bus", "pipeline_cycles", assumed(1, "the host computes in the next cycle"))
        yield ProfileLine("cycle", "period_us", _period(machine))
        for name, run in groups:
            yield from _group(name, run)
    else:
        machine.remarks.append(
            f"Messages alone, {_cycle_words(machine)}: the EDS or DCF of each node beside the file adds the cycle"
        )
    yield from messages


def _require_slaves(machine: Reading) -> None:
    """Raise BusplanError for a master alone, which names the missing slaves: their files say what is sent."""
    missing = [str(number) for number in machine.slaves if number not in machine.nodes or len(machine.nodes) == 1]
    if not missing:
        return
    if not machine.messages and all("is_host" in facts for facts in machine.nodes.values()):
        raise BusplanError(
            f"{machine.file}: is of the CANopen master (0x1F80, 0x1F81), the host: give the DCF or EDS of its slaves "
            "beside it"
        )
    machine.remarks.append(
        f"{machine.file}: slaves of the master (0x1F81) without a file, so left out: node {first_of(missing, _LISTED)}"
    )


def _cycle_words(machine: Reading) -> str:
    """Words on a cycle of SYNC and PDOs among messages, by the identifiers of CANopen's predefined set (CiA 301)."""
    feedback, command = ({number - start for number in machine.messages} for start in (0x180, 0x200))
    nodes = sorted(number for number in feedback & command if 1 <= number <= _MOST_NODE)
    if _SYNC_ID not in machine.messages or not nodes:
        return "without a cycle of SYNC and PDOs"
    numbers = first_of([*map(str, nodes)], _LISTED)
    return f"though 0x080, 0x180 + n and 0x200 + n are SYNC and PDOs of CANopen's nodes n = {numbers}"


def _period(machine: Reading) -> Fact:
    """Period of SYNC from the files; from a log if no file has it, or if it is shorter there."""
    stated, seen = machine.bus.get("period_us"), machine.messages.get(_sync_id(machine), {}).get("period_us")
    if stated is None:
        return seen or usual_period("can")
    return seen if seen and seen.value < stated.value * (1 - _CLEARLY) else stated


def _sync_id(machine: Reading) -> int:
    """Identifier of SYNC."""
    return int(machine.bus["sync_identifier"].value) if "sync_identifier" in machine.bus else _SYNC_ID


def _nodes(machine: Reading) -> Iterator[_Node]:
    """Nodes whose PDOs go with every n-th SYNC in both directions, for the least n; other PDOs become messages."""
    for number, facts in sorted(machine.nodes.items()):
        rates = (set.intersection(*({pdo.every for pdo in facts[key].value} for key in _DIRECTIONS))) - {0}
        if rates:
            sent = {key: _together([pdo for pdo in facts[key].value if pdo.every == min(rates)]) for key in _DIRECTIONS}
            yield _Node(number, facts, sent)


def _together(pdos: list[Pdo]) -> list[Pdo]:
    """First PDOs of one payload: no more than four, with identifiers 256 apart."""
    together = pdos[:1]
    for pdo in pdos[1:_MOST_PDOS]:
        if pdo.identifier != together[-1].identifier + _PDO_STEP:
            break
        together.append(pdo)
    return together


def _looks(place: int, node: _Node) -> tuple[Any, ...]:
    """Features that neighbours of one group share: sizes, axes, rate, and identifiers that go up by one."""
    sizes = (tuple(pdo.payload_bytes for pdo in node.sent[key]) for key in _DIRECTIONS)
    starts = (node.sent[key][0].identifier - place for key in _DIRECTIONS)
    return (*sizes, *starts, node.every, node.facts["axes"].value)


def _group(name: str, nodes: list[_Node]) -> Iterator[ProfileLine]:
    first, identity = nodes[0], nodes[0].facts["node_id"]
    section = f"group.{name}"
    numbers = f"{first.number} to {nodes[-1].number}" if len(nodes) > 1 else f"{first.number}"
    note = ", ".join(filter(None, (f"node-ID {numbers}", identity.note)))
    facts = {"nodes": identity._replace(value=len(nodes), note=note), "axes": first.facts["axes"]}
    if first.every > 1:
        pdo = first.sent["feedback"][0]
        facts["every"] = Fact(first.every, pdo.place, note=f"transmission type of {pdo.name}")
    for key, size in _DIRECTIONS.items():
        pdos = first.sent[key]
        place, identifier, lengths = pdos[0].place, pdos[0].identifier, [pdo.payload_bytes for pdo in pdos]
        names = ", ".join(pdo.name for pdo in pdos)
        if all(length == _FRAME_BYTES for length in lengths[:-1]):
            facts[size] = Fact(sum(lengths), place, note=names)
        else:
            facts[f"{key}_pdos"] = Fact(lengths, place, note=names)
        facts[f"{key}_identifier"] = Fact(identifier, place, note=f"0x{identifier:x}")
    yield from lines(section, facts)
    base = assumed(20, "from SYNC to a queued feedback PDO, and from a command PDO to its effect")
    yield from execution_lines(section, base, assumed(0.1, "time per byte"))


def _messages(
    machine: Reading, nodes: Sequence[_Node], owners: dict[int, str], *, usual_bits: int
) -> Iterator[ProfileLine]:
    """Messages outside the cycle: of databases and logs, other PDOs, heartbeats, emergencies.

    With any node in the cycle, SYNC is no message. `owners` are the groups of nodes by node-ID. `usual_bits` is the
    length of identifiers that a message need not give [bits].
    """
    taken = set(_NAMES_OF_CYCLE)
    cycle = {node.number: [pdo for pdos in node.sent.values() for pdo in pdos] for node in nodes}
    used = {pdo.identifier for pdos in cycle.values() for pdo in pdos}
    if nodes:
        used.add(_sync_id(machine))
    left_out: dict[str, list[str]] = {}
    messages = [
        _joined(facts, machine)
        for number, node in sorted(machine.nodes.items())
        for facts in _of_node(number, node, cycle.get(number, []), _period(machine))
    ]
    messages += (
        {"identifier": Fact(identifier, facts["name"].place), **facts}
        for identifier, facts in sorted(machine.messages.items())
    )
    _set_senders(messages, machine, owners)
    for facts in messages:
        name = str(facts["name"].value)
        if facts["identifier"].value in used:
            continue
        if reason := _obstacle(facts):
            left_out.setdefault(reason, []).append(name)
        else:
            used.add(facts["identifier"].value)
            free = group_name(name, taken)
            if name in _NAMES_OF_CYCLE:
                machine.remarks.append(f"{name} is {free} in the profile, where {name} is a frame of the cycle")
            yield from lines(f"message.{free}", _message(facts, usual_bits))
    machine.remarks += [_left_out(reason, names) for reason, names in left_out.items()]


def _of_node(number: int, node: Facts, cycle: Sequence[Pdo], period: Fact) -> Iterator[Facts]:
    """Messages of a CANopen node besides the PDOs of its cycle."""
    name = f"{node['name'].value}-{number}"
    for pdo in (pdo for key in _DIRECTIONS for pdo in node[key].value if pdo not in cycle):
        facts = {
            "name": Fact(f"{name}-{pdo.name}", pdo.place),
            "identifier": Fact(pdo.identifier, pdo.place),
            "payload_bytes": Fact(pdo.payload_bytes, pdo.place),
        }
        if pdo.every:
            note = f"with every {pdo.every}. SYNC"
            facts["period_us"] = Fact(pdo.every * period.value, pdo.place, period.grade, note)
        elif pdo.period_us:
            facts["period_us"] = Fact(pdo.period_us, pdo.place, note=pdo.timer)
        yield facts
    if "heartbeat_us" in node:
        beat = node["heartbeat_us"]
        yield {
            "name": Fact(f"{name}-heartbeat", beat.place),
            "identifier": Fact(_HEARTBEAT_ID + number, beat.place, note="0x700 and the node-ID"),
            "payload_bytes": Fact(1, beat.place, note="the state of the node (CiA 301)"),
            "period_us": beat,
        }

    if "emergency" in node:
        emergency = node["emergency"]
        yield {
            "name": Fact(f"{name}-emergency", emergency.place),
            "identifier": emergency,
            "payload_bytes": Fact(_FRAME_BYTES, emergency.place, note="error code, register and data (CiA 301)"),
            "period_us": node.get("emergency_us") or assumed(_EMERGENCY_US, "sent at a fault; one per second"),
        }


def _joined(facts: Facts, machine: Reading) -> Facts:
    """A node's message with its facts from a database and a log: its name, and how often it was seen."""
    number = facts["identifier"].value
    seen = dict(machine.messages.get(number, {}))
    if not seen:
        return facts
    facts = dict(facts)
    if seen["name"].value != f"id-{number:#x}":
        del facts["name"]
    if seen["payload_bytes"].value > facts["payload_bytes"].value:
        del facts["payload_bytes"]
    stated, other = facts.get("period_us"), seen.get("period_us")
    if stated and other and stated.grade == "assumed":
        del facts["period_us"]
    elif stated and other and other.value < stated.value * (1 - _CLEARLY):
        del facts["period_us"]
        machine.remarks.append(
            f"{(seen | facts)['name'].value} comes every {other.value:,.0f} us by {other.place}, every "
            f"{stated.value:,.0f} by {stated.place}: the shorter is used"
        )
    return seen | facts


def _shown_senders(machine: Reading, owners: dict[int, str]) -> dict[int, tuple[str, str]]:
    """Sender of each identifier, and the source for it: the nodes' files, else the predefined connection set."""
    devices = {
        number: HOST if "is_host" in facts else owners.get(number, f"{facts['name'].value}-{number}"[:100])
        for number, facts in machine.nodes.items()
    }
    shown = dict.fromkeys(_OF_THE_HOST if devices else (), (HOST, "by the predefined set"))
    for number, device in devices.items():
        for starts, sender in ((_BY_THE_NODE, device), (_BY_THE_HOST, HOST)):
            shown |= {start + number: (sender, f"of node {number} by the predefined set") for start in starts}
    for number, facts in machine.nodes.items():
        shown |= {pdo.identifier: (HOST, f"to node {number}") for pdo in facts["command"].value}
    # Data that a node sends to another are no command of the host.
    for number, facts in machine.nodes.items():
        sent = [pdo.identifier for pdo in facts["feedback"].value]
        sent += [facts["emergency"].value] if "emergency" in facts else []
        shown |= dict.fromkeys(sent, (devices[number], f"of node {number}"))
    return shown


def _set_senders(messages: Sequence[Facts], machine: Reading, owners: dict[int, str]) -> None:
    """Give each message that CANopen shows to be of a node its group, its node or the host.

    A node that sends one of them in a database sends its other messages there, too.
    """
    shown = _shown_senders(machine, owners)
    known: dict[object, set[str]] = {}
    for facts in messages:
        number = facts["identifier"].value
        if number in shown:
            sender, note = shown[number]
            if "sender" in facts:
                known.setdefault(facts["sender"].value, set()).add(sender)
                note = f"{note}, {facts['sender'].value} in {facts['sender'].place}"
            facts["sender"] = Fact(sender, "", "derived", note)
    for facts in messages:
        if "sender" in facts and facts["identifier"].value not in shown:
            device = facts["sender"]
            if len(same := known.get(device.value, set())) == 1:
                facts["sender"] = Fact(
                    next(iter(same)), device.place, "derived", f"{device.value} sends its messages, too"
                )


def _is_fd(facts: Facts) -> bool:
    return "is_fd" in facts and bool(facts["is_fd"].value)


def _obstacle(facts: Facts) -> str:
    """Reason why a message is left out; empty for none."""
    most_bytes, why = (_FD_BYTES, "") if _is_fd(facts) else (_FRAME_BYTES, ", and no file says that it is CAN FD")
    if facts["payload_bytes"].value > most_bytes:
        return f"over the {most_bytes} bytes of a frame{why}"
    return "" if "period_us" in facts else f"no file says its period; {_ASSUME}"


def _message(facts: Facts, usual_bits: int) -> dict[str, Fact | None]:
    """Section of a message in the profile."""
    identifier, switches = facts["identifier"], facts.get("switches")
    number = identifier.value % EXTENDED
    bits = _EXTENDED_BITS if identifier.value >= EXTENDED else _BASE_BITS
    note = ", ".join(filter(None, (f"0x{number:x}", identifier.note)))
    return {
        "identifier": identifier._replace(value=number, note=note),
        "identifier_bits": None if bits == usual_bits else identifier._replace(value=bits, note=""),
        "fd": facts["is_fd"] if _is_fd(facts) else None,
        "brs": switches if _is_fd(facts) and switches and not switches.value else None,
        **{key: facts.get(key) for key in _OF_A_MESSAGE},
    }


def _left_out(reason: str, names: list[str]) -> str:
    return f"left out, {reason}: {first_of(names, _LISTED)}"


def settle(readings: Sequence[Reading]) -> None:
    """Settle contradictions between a log and databases; the log determines which messages are sent, and how often.

    The shorter period and the longer data of a message count, and messages that the log never has are left out. The bit
    rate is the log's if its frames show one, or need more than a database has.
    """
    for log in (reading for reading in readings if reading.is_log):
        for database in (reading for reading in readings if reading is not log):
            unseen = [number for number in database.messages if number not in log.messages]
            names = [str(database.messages.pop(number)["name"].value) for number in unseen]
            if names:
                log.remarks.append(_left_out(f"never in {log.file}", names))
            for number, facts in database.messages.items():
                _settle_message(log.messages[number], facts, log)
            if BIT_RATE in database.bus:
                _settle_bit_rate(log, database)


def assume_periods(machine: Reading, period_us: float) -> None:
    """Give every message without a period an assumed one [us]."""
    for facts in machine.messages.values():
        if "period_us" not in facts:
            facts["period_us"] = assumed(period_us, "no file says it; --period gives it to all such messages")
            facts["period_grade"] = assumed("assumed", "so the plan is not shown to fit")


def _settle_message(recorded: Facts, stated: Facts, log: Reading) -> None:
    stated.pop("switches", None)
    for key in ("name", "is_fd"):
        if key in stated:
            recorded.pop(key, None)
    (stated if stated["payload_bytes"].value < recorded["payload_bytes"].value else recorded).pop("payload_bytes")
    if "period_us" not in stated:
        return
    period = stated["period_us"]
    if recorded["period_us"].value < period.value * (1 - _CLEARLY):
        del stated["period_us"]
        log.remarks.append(
            f"{stated['name'].value} comes every {recorded['period_us'].value:,.0f} us in {log.file}, every "
            f"{period.value:,.0f} by {period.place}: the log's is used"
        )
        return
    # The message comes as early as in the log all the same.
    times_us, error_us = recorded[SENT].value
    # It needs numpy, and most files have no stamps.
    from busplan.recordings.can_timing import event_model

    model = event_model(times_us, period.value, stamp_error_us=error_us, tolerance=0.0)
    for key in ("period_us", "jitter_us", "burst", "deadline_us"):
        recorded.pop(key, None)
    recorded.update(timing_facts(model, period.value, PurePath(log.file).name, is_periodic=True))


def give_bit_rate(machine: Reading, bit_rate_kbit_s: float) -> None:
    """Set the user's bit rate [kbit/s].

    If frames of a log need more, it raises BusplanError.
    """
    if LEAST in machine.bus:
        from busplan.recordings.can_timing import require_bit_rate

        require_bit_rate(bit_rate_kbit_s, machine.bus[LEAST].value)
    machine.bus[BIT_RATE] = Fact(bit_rate_kbit_s, note="as given to import")


def _settle_bit_rate(log: Reading, database: Reading) -> None:
    stated, least, shown = database.bus[BIT_RATE], log.bus[LEAST].value.surely, log.bus.get(SHOWN)
    if least <= stated.value and (shown is None or shown.value == stated.value):
        log.bus.pop(BIT_RATE, None)
        return
    del database.bus[BIT_RATE]
    found = f"shows {shown.value:g}: the log's is used" if shown else f"needs at least {least:.3g}"
    log.remarks.append(f"{database.file} says {stated.value:g} kbit/s and {log.file} {found}")
