"""The profile of a CAN bus: CANopen nodes in groups, and all other messages."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, Final, NamedTuple

from busplan.buses import kind_named
from busplan.english import first_of
from busplan.errors import BusplanError
from busplan.questions.import_.can_database import EXTENDED
from busplan.questions.import_.canopen import Pdo
from busplan.questions.import_.reading import Fact, Facts, ProfileLine, Reading, group_name, time_us

_DIRECTIONS: Final = {"feedback": "read_bytes", "command": "write_bytes"}
_FRAME_BYTES: Final = 8
_FD_BYTES: Final = 64
_PDO_STEP: Final = 0x100
_MOST_PDOS: Final = 4
_HEARTBEAT_ID: Final = 0x700
BIT_RATE: Final = "bit_rate_kbit_s"
LEAST, SHOWN = "least_bit_rate", "shown_bit_rate"
"""What a log alone says of the bit rate, for `settled`."""
_CLEARLY: Final = 0.02
"""By how much a recorded period is shorter than that of a database where it counts, as a share."""
_DATA_BIT_RATE: Final = "data_bit_rate_kbit_s"
_USUAL_BIT_RATE: Final = 1000
"""Of machines [kbit/s]."""
_USUAL_OF_CARS: Final = 500
"""Of networks of messages alone [kbit/s]."""
_LISTED: Final = 8
_BASE_BITS: Final = 11
_EXTENDED_BITS: Final = 29


class _Node(NamedTuple):
    """A CANopen node in the cycle."""

    number: int
    facts: Facts
    sent: dict[str, list[Pdo]]
    """PDOs of each direction that go in one payload."""

    @property
    def every(self) -> int:
        """They go with every n-th SYNC."""
        return self.sent["feedback"][0].every


def rows(machine: Reading) -> Iterator[ProfileLine]:
    """Lines of the profile, without its head: of messages alone, where no node has PDOs with SYNC both ways.

    Raises
    ------
    BusplanError
        There are no messages either.
    """
    bus = machine.bus
    nodes = list(_nodes(machine))
    usual_bits = _BASE_BITS if nodes else _usual_bits(machine)
    messages = list(message_rows(machine, usual_bits=usual_bits, has_sync=bool(nodes)))
    if not (nodes or messages):
        raise BusplanError(f"{machine.file}: no message with a period, and no node with PDOs", *machine.remarks)
    yield ProfileLine("bus", "kind", Fact("can", machine.place(1)))
    usual = _USUAL_BIT_RATE if nodes else _USUAL_OF_CARS
    assumed = "no file says it; the cable decides" if nodes else "no file says it, and all times follow from it"
    yield ProfileLine("bus", BIT_RATE, bus.get(BIT_RATE) or Fact(usual, "", "assumed", assumed))
    if switches(messages):
        assumed = f"no file says it{'; SYNC and PDOs are FD frames with it, too' if nodes else ''}"
        yield ProfileLine("bus", _DATA_BIT_RATE, bus.get(_DATA_BIT_RATE) or Fact(2000, "", "assumed", assumed))
    if usual_bits != _BASE_BITS:
        yield ProfileLine("bus", "identifier_bits", Fact(usual_bits, machine.place(1), note="of most messages"))
    if nodes:
        yield from _cycle(machine, nodes)
    else:
        machine.remarks.append(
            "Messages alone, without a cycle of SYNC and PDOs: the EDS or DCF of each node beside the file adds it"
        )
    yield from messages


def _cycle(machine: Reading, nodes: list[_Node]) -> Iterator[ProfileLine]:
    """SYNC, its period, and the nodes in groups."""
    for key in ("sync_identifier", "sync_counter"):
        if key in machine.bus:
            yield ProfileLine("bus", key, machine.bus[key])
    yield ProfileLine("bus", "pipeline_cycles", Fact(1, "", "assumed", "the host computes in the next cycle"))
    yield ProfileLine("cycle", "period_us", _period(machine))
    taken: set[str] = set()
    for _, alike in groupby(enumerate(nodes), lambda item: _alike(item[0], item[1])):
        yield from _group([node for _, node in alike], taken)


def switches(messages: list[ProfileLine]) -> bool:
    """Whether lines of messages say that any is a CAN FD frame with a switch of bit rate."""
    return len({row.section for row in messages if row.key == "fd"}) > sum(row.key == "brs" for row in messages)


def _nodes(machine: Reading) -> Iterator[_Node]:
    """Nodes whose PDOs go with every n-th SYNC in both directions, the most often; all other PDOs become messages."""
    for number in sorted(machine.nodes):
        facts = machine.nodes[number]
        both = (set.intersection(*({pdo.every for pdo in facts[key].value} for key in _DIRECTIONS))) - {0}
        if both:
            every = min(both)
            sent = {key: _together([pdo for pdo in facts[key].value if pdo.every == every]) for key in _DIRECTIONS}
            yield _Node(number, facts, sent)


def _together(pdos: list[Pdo]) -> list[Pdo]:
    """The first PDOs that are those of one payload: no more than four, identifiers 256 apart."""
    found = pdos[:1]
    for pdo in pdos[1:]:
        if len(found) == _MOST_PDOS or pdo.identifier != found[-1].identifier + _PDO_STEP:
            break
        found.append(pdo)
    return found


def _alike(place: int, node: _Node) -> tuple[Any, ...]:
    """What neighbours of one group share: sizes, axes, and identifiers that go up by one."""
    sizes = (tuple(pdo.payload_bytes for pdo in node.sent[key]) for key in _DIRECTIONS)
    starts = (node.sent[key][0].identifier - place for key in _DIRECTIONS)
    return (*sizes, *starts, node.every, node.facts["axes"].value)


def _group(nodes: list[_Node], taken: set[str]) -> Iterator[ProfileLine]:
    first = nodes[0]
    section = f"group.{group_name(str(first.facts['name'].value), taken)}"
    numbers = f"{first.number} to {nodes[-1].number}" if len(nodes) > 1 else f"{first.number}"
    identity = first.facts["node_id"]
    note = ", ".join(filter(None, (f"node-ID {numbers}", identity.note)))
    yield ProfileLine(section, "nodes", Fact(len(nodes), identity.place, identity.grade, note))
    axes = first.facts["axes"]
    yield ProfileLine(section, "axes", axes)
    if first.every > 1:
        pdo = first.sent["feedback"][0]
        yield ProfileLine(section, "every", Fact(first.every, pdo.place, note=f"transmission type of {pdo.name}"))
    for key, size in _DIRECTIONS.items():
        pdos = first.sent[key]
        names = ", ".join(pdo.name for pdo in pdos)
        lengths = [pdo.payload_bytes for pdo in pdos]
        if all(length == _FRAME_BYTES for length in lengths[:-1]):
            yield ProfileLine(section, size, Fact(sum(lengths), pdos[0].place, note=names))
        else:
            yield ProfileLine(section, f"{key}_pdos", Fact(lengths, pdos[0].place, note=names))
        yield ProfileLine(
            section, f"{key}_identifier", Fact(pdos[0].identifier, pdos[0].place, note=f"0x{pdos[0].identifier:x}")
        )
    yield ProfileLine(f"{section}.execution", "kind", Fact("linear", "", "assumed"))
    yield ProfileLine(f"{section}.execution", "grade", Fact("assumed", "", "assumed"))
    base = "from SYNC to a queued feedback PDO, and from a command PDO to its effect"
    yield ProfileLine(f"{section}.execution", "base_us", Fact(20, "", "assumed", base))
    yield ProfileLine(f"{section}.execution", "per_byte_us", Fact(0.1, "", "assumed", "what each byte adds"))


def _period(machine: Reading) -> Fact:
    """The period of SYNC."""
    usual = Fact(time_us(kind_named("can").starter.period), "", "assumed", "no file says it; usual on this bus")
    return machine.bus.get("period_us", usual)


def _usual_bits(machine: Reading) -> int:
    """Length of most identifiers of databases and logs [bits]."""
    extended = sum(number >= EXTENDED for number in machine.messages)
    return _EXTENDED_BITS if 2 * extended > len(machine.messages) else _BASE_BITS


def message_rows(machine: Reading, *, usual_bits: int = _BASE_BITS, has_sync: bool = True) -> Iterator[ProfileLine]:
    """Every message that is in no cycle: of databases and logs, PDOs that the cycle has not, heartbeats.

    Parameters
    ----------
    machine
        What the files say.
    usual_bits
        Length of identifiers that a message need not say [bits].
    has_sync
        Whether the profile has a SYNC, which is no message then.
    """
    taken: set[str] = set()
    nodes = {node.number: node for node in _nodes(machine)}
    used = {machine.bus["sync_identifier"].value if "sync_identifier" in machine.bus else 0x80} if has_sync else set()
    for node in nodes.values():
        used |= {pdo.identifier for pdos in node.sent.values() for pdo in pdos}
    left_out: dict[str, list[str]] = {}
    for number in sorted(machine.nodes):
        for found in _of_node(number, machine.nodes[number], nodes.get(number), _period(machine)):
            yield from _message(found, used, taken, left_out, usual_bits=usual_bits)
    for identifier, facts in sorted(machine.messages.items()):
        found = {"identifier": Fact(identifier, facts["name"].place), **facts}
        yield from _message(found, used, taken, left_out, usual_bits=usual_bits)
    for reason, names in left_out.items():
        machine.remarks.append(_left_out(reason, names))


def _of_node(number: int, facts: Facts, node: _Node | None, period: Fact) -> Iterator[Facts]:
    """Messages of a CANopen node beside its cycle."""
    for key in _DIRECTIONS:
        for pdo in facts[key].value:
            if node and pdo in node.sent[key]:
                continue
            us = pdo.every * period.value if pdo.every else pdo.period_us
            grade = period.grade if pdo.every else "published"
            note = f"with every {pdo.every}. SYNC" if pdo.every else pdo.timer
            found = {
                "name": Fact(f"{facts['name'].value}-{number}-{pdo.name}", pdo.place),
                "identifier": Fact(pdo.identifier, pdo.place),
                "payload_bytes": Fact(pdo.payload_bytes, pdo.place),
            }
            yield found | ({"period_us": Fact(us, pdo.place, grade, note)} if us else {})
    if "heartbeat_us" in facts:
        beat = facts["heartbeat_us"]
        yield {
            "name": Fact(f"{facts['name'].value}-{number}-heartbeat", beat.place),
            "identifier": Fact(_HEARTBEAT_ID + number, beat.place, note="0x700 and the node-ID"),
            "payload_bytes": Fact(1, beat.place, note="the state of the node (CiA 301)"),
            "period_us": beat,
        }


def _message(
    found: Facts, used: set[int], taken: set[str], left_out: dict[str, list[str]], *, usual_bits: int
) -> Iterator[ProfileLine]:
    identifier, name = found["identifier"], str(found["name"].value)
    reason = ""
    if identifier.value in used:
        return
    is_fd = "is_fd" in found and found["is_fd"].value
    most_bytes = _FD_BYTES if is_fd else _FRAME_BYTES
    if found["payload_bytes"].value > most_bytes:
        reason = f"over the {most_bytes} bytes of a frame" + ("" if is_fd else ", and no file says that it is CAN FD")
    elif "period_us" not in found:
        reason = "no file says its period; give one that does, or add it by hand"
    if reason:
        left_out.setdefault(reason, []).append(name)
        return
    used.add(identifier.value)
    section = f"message.{group_name(name, taken)}"
    number = identifier.value % EXTENDED
    note = ", ".join(filter(None, (f"0x{number:x}", identifier.note)))
    yield ProfileLine(section, "identifier", identifier._replace(value=number, note=note))
    bits = _EXTENDED_BITS if identifier.value >= EXTENDED else _BASE_BITS
    if bits != usual_bits:
        yield ProfileLine(section, "identifier_bits", identifier._replace(value=bits, note=""))
    if is_fd:
        yield ProfileLine(section, "fd", found["is_fd"])
        if "switches" in found and not found["switches"].value:
            yield ProfileLine(section, "brs", found["switches"])
    yield ProfileLine(section, "payload_bytes", found["payload_bytes"])
    period = found["period_us"]
    yield ProfileLine(section, "period_us", period)
    for key in ("jitter_us", "burst", "deadline_us"):
        if key in found:
            yield ProfileLine(section, key, found[key])


def _left_out(reason: str, names: list[str]) -> str:
    return f"left out, {reason}: {first_of(names, _LISTED)}"


def settled(readings: Sequence[Reading]) -> None:
    """Settle what a log and the databases beside it say of the same: the log says what is sent, and how often.

    Of a message the shorter period and the longer data count, and what the log never has is left out. The bit rate is
    the log's where its frames show one, or need more than a database says.
    """
    for log in (reading for reading in readings if reading.is_log):
        for other in (reading for reading in readings if reading is not log and reading.messages):
            unseen = [number for number in other.messages if number not in log.messages]
            names = [str(other.messages.pop(number)["name"].value) for number in unseen]
            if names:
                log.remarks.append(_left_out(f"never in {log.file}", names))
            for number, facts in other.messages.items():
                _settle_message(log.messages[number], facts, log)
        for other in (reading for reading in readings if reading is not log and BIT_RATE in reading.bus):
            _settle_bit_rate(log, other)


def _settle_message(recorded: Facts, said: Facts, log: Reading) -> None:
    said.pop("switches", None)
    for key in ("name", "is_fd"):
        if key in said:
            recorded.pop(key, None)
    (said if said["payload_bytes"].value < recorded["payload_bytes"].value else recorded).pop("payload_bytes")
    if "period_us" not in said:
        return
    period = said["period_us"]
    if recorded["period_us"].value < period.value * (1 - _CLEARLY):
        del said["period_us"]
        log.remarks.append(
            f"{said['name'].value} comes every {recorded['period_us'].value:,.0f} us in {log.file}, every "
            f"{period.value:,.0f} by {period.place}: the log's is taken"
        )
    else:
        # It comes in the bursts of the log all the same, and its deadline is that of the log.
        del recorded["period_us"]


def _settle_bit_rate(log: Reading, other: Reading) -> None:
    said, least, shown = other.bus[BIT_RATE], log.bus.get(LEAST), log.bus.get(SHOWN)
    if least is None or (least.value <= said.value and (shown is None or shown.value == said.value)):
        log.bus.pop(BIT_RATE, None)
        return
    del other.bus[BIT_RATE]
    log.remarks.append(
        f"{other.file} says {said.value:g} kbit/s and {log.file} shows {log.bus[BIT_RATE].value:g}: the log's is taken"
    )
