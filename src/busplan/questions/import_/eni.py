"""ENI, the configuration of an EtherCAT master (ETG.2100): frames to the byte, devices, clocks and mailboxes."""

import re
from collections.abc import Iterator, Mapping
from math import ceil, lcm
from typing import Final

from busplan.questions.import_.reading import Element, Fact, Line, Reading, parsed

TITLE: Final = "ENI"
_LRD, _LWR, _LRW = 10, 11, 12
_SEPARATE, _SHARED, _SPLIT = "LRW-separate", "LRW-shared", "LRD-LWR"
_PORTS: Final = {"Y": "100BASE-TX", "K": "E-bus"}
CONTROL_WORDS: Final = range(0x6040, 0x8000, 0x800)
"""Index of the control word of each axis of a drive (CiA 402); one more for each further axis."""
_CONTROL_WORD: Final = re.compile(r"control[ _-]?word", re.IGNORECASE)
_TYPE: Final = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
_MOST_BYTES: Final = 1486
_MOST_BITS: Final = 8 * 65_536
_MOST_TIME_NS: Final = 10**12
_MOST_DEVICES: Final = 65_535
_MOST_CYCLES: Final = 1000
"""Longest common multiple of rates that a profile takes."""
_OFFSETS: Final = (("Recv", "InputOffs"), ("Send", "OutputOffs"))
"""Data of a device, and the key of a datagram that says where they begin in the process image."""


def read(content: bytes, name: str) -> Reading:
    """Read an ENI file.

    Raises
    ------
    BusplanError
        It is not valid, or says no machine; with its line.
    """
    root = parsed(content, name=name, skipped=("InitCmds", "StringTable"))
    machine = Reading("ethercat", TITLE, name, rank=0)
    config = root.first("Config")
    slaves = list(config.all("Slave")) if config else []
    if config is None or not slaves:
        encrypted = ": it is encrypted; export it without" if root.tag.startswith("Encrypted") else ""
        raise machine.refusal(root.line, f"<{root.tag}> has no Config/Slave that can be read{encrypted}")
    if len(slaves) > _MOST_DEVICES:
        raise machine.refusal(slaves[-1].line, f"more than {_MOST_DEVICES} devices")
    images: dict[str, set[int]] = {"Send": set(), "Recv": set()}
    outputs = list(config.all("ProcessImage/Outputs/Variable"))
    for number, slave in enumerate(slaves):
        machine.nodes[number] = dict(_device(slave, images, outputs, machine))
    _cycle(config, machine)
    _branches(slaves, machine)
    return machine


def number(element: Element, path: str, machine: Reading, *, most: int) -> tuple[int, Line] | None:
    """Whole number in an element below this one, and its line; None where there is none.

    Raises
    ------
    BusplanError
        Not a whole number from 0 to the largest.
    """
    child = element.first(path)
    if child is None or not child.text.strip():
        return None
    value = whole_number(child.text)
    if value is None or not 0 <= value <= most:
        shown = child.text.strip()[:40]
        raise machine.refusal(child.line, f"{child.tag} {shown!r}: expected a whole number from 0 to {most}")
    return value, child.line


def whole_number(text: str) -> int | None:
    """A whole number, decimal or as #x1a00 or 0x1a00; None for any other text."""
    text = text.strip().lower()
    match = re.fullmatch(r"(?:(?:#x|0x)([0-9a-f]{1,16})|(-?[0-9]{1,18}))", text)
    return None if match is None else int(match[1], 16) if match[1] else int(match[2])


def _device(
    slave: Element, images: dict[str, set[int]], outputs: list[Element], machine: Reading
) -> Iterator[tuple[str, Fact]]:
    """Facts of a device."""
    info = slave.first("Info") or slave
    title = info.first("Name")
    text = title.text.strip() if title else ""
    kind = _TYPE.search(text)
    yield "name", Fact(kind[1] if kind else text or "device", machine.place(title.line if title else slave.line))
    physics = info.first("Physics")
    letter = physics.text.strip()[:1].upper() if physics else ""
    if physics and letter in _PORTS:
        yield "port", Fact(_PORTS[letter], machine.place(physics.line), note=f"Physics {physics.text.strip()[:8]}")
    spans = {}
    for tag, key in (("Recv", "read_bytes"), ("Send", "write_bytes")):
        line: Line = slave.line
        size = bits = 0
        for part in slave.all(f"ProcessData/{tag}"):
            start = number(part, "BitStart", machine, most=_MOST_BITS)
            length = number(part, "BitLength", machine, most=8 * _MOST_BYTES)
            if start and length and length[0]:
                spans[tag] = range(start[0], start[0] + length[0])
                own = set(range(start[0] // 8, ceil((start[0] + length[0]) / 8))) - images[tag]
                images[tag] |= own
                line, size, bits = length[1], size + len(own), bits + length[0]
        shares = f"{bits} bits in bytes of its neighbours" if bits > 8 * size else ""
        yield key, Fact(size, machine.place(line), note=shares)
    yield "axes", _axes(slave, spans.get("Send"), outputs, machine)
    clock = slave.first("DC")
    cycle = clock and number(clock, "CycleTime0", machine, most=_MOST_TIME_NS)
    if clock and cycle and cycle[0]:
        yield "clock_us", Fact(cycle[0] / 1000, machine.place(cycle[1]))
        shift = clock.first("ShiftTime")
        shift_ns = whole_number(shift.text) if shift else None
        if shift and shift_ns is not None:
            yield "shift_us", Fact(shift_ns / 1000, machine.place(shift.line))
    mailbox = slave.first("Mailbox/Recv")
    longest = number(mailbox, "Length", machine, most=_MOST_BITS) if mailbox else None
    if longest and longest[0]:
        yield "mailbox_bytes", Fact(longest[0], machine.place(longest[1]))


def _axes(slave: Element, span: range | None, outputs: list[Element], machine: Reading) -> Fact:
    """Axes of a device: the control words of CiA 402 in its PDOs, or among the names of its outputs."""
    words: dict[int, Line] = {}
    pdos = list(slave.all("ProcessData/RxPdo"))
    for pdo in [pdo for pdo in pdos if "Sm" in pdo.attributes] or pdos:
        for entry in pdo.all("Entry/Index"):
            index = whole_number(entry.text)
            if index is not None and index in CONTROL_WORDS:
                words.setdefault(index, entry.line)
    if not words and span:
        for variable in outputs:
            title, offset = variable.first("Name"), number(variable, "BitOffs", machine, most=_MOST_BITS)
            if title and offset and offset[0] in span and _CONTROL_WORD.search(title.text):
                words[offset[0]] = title.line
    listed = next((pdo.line for pdo in slave.all("ProcessData/RxPdo")), None)
    # A device without outputs is no drive.
    line = next(iter(words.values())) if words else listed or (slave.line if span is None else None)
    return axes_fact(words, machine, line=line)


def axes_fact(words: Mapping[int, Line], machine: Reading, *, line: Line | None) -> Fact:
    """Axes of a device by the lines of its control words.

    Parameters
    ----------
    words
        Line of each control word.
    machine
        The record of the file.
    line
        Line of its PDOs; None where the file does not list them.
    """
    if line is None:
        return Fact(0, grade="assumed", note="which PDOs it has no file says")
    if not words:
        return Fact(0, machine.place(line), "derived", "no control word of CiA 402 in its PDOs")
    return Fact(len(words), machine.place(next(iter(words.values()))), "derived", "control words of CiA 402")


def _cycle(config: Element, machine: Reading) -> None:
    """The period, and what goes in the frames of a cycle."""
    tasks = []
    for task in config.all("Cyclic"):
        period = number(task, "CycleTime", machine, most=_MOST_TIME_NS)
        frames = [list(_commands(frame, machine)) for frame in task.all("Frame")]
        tasks.append((period, task, [frame for frame in frames if frame]))
    tasks.sort(key=lambda task: task[0][0] if task[0] else 0)
    if tasks and tasks[0][0] and tasks[0][0][0]:
        machine.bus["period_us"] = Fact(tasks[0][0][0], machine.place(tasks[0][0][1]))
    else:
        clocks = [facts["clock_us"] for facts in machine.nodes.values() if "clock_us" in facts]
        if clocks:
            machine.bus["period_us"] = min(clocks)._replace(note="of the clocks; no Cyclic/CycleTime")
    if not tasks or not tasks[0][2]:
        machine.remarks.append(f"{machine.file}: no Cyclic/Frame: which datagrams the master sends is not known")
        return
    has_rates = _rates(config, [(period[0] if period else 0, task) for period, task, _ in tasks], machine)
    _frames(config, tasks[0][2], tasks[0][1].line, machine)
    for period, task, frames in tasks[1:]:
        if has_rates:
            # All of them are in the cycle in which the tasks meet.
            machine.bus["frames"].value.extend(map(_sizes, frames))
            continue
        machine.bus.setdefault("slower", Fact([], machine.place(task.line))).value.extend(map(_sizes, frames))
        machine.remarks.append(
            f"{machine.file}:{task.line}: a further task of {period[0] if period else 'unknown'} us: its frames are "
            "counted in every cycle, in cycle.nonperiodic_us"
        )


def _rates(config: Element, tasks: list[tuple[int, Element]], machine: Reading) -> bool:
    """Give devices of slower tasks their rate, where the file says which devices each task serves.

    Returns
    -------
    bool
        Whether each device belongs to a single task, and all periods are multiples of the shortest.
    """
    shortest = tasks[0][0]
    rates = [period // shortest if shortest else 0 for period, _ in tasks]
    is_whole = all(rate and rate * shortest == period for rate, (period, _) in zip(rates, tasks, strict=True))
    if len(tasks) == 1 or not is_whole or lcm(*rates) > _MOST_CYCLES:
        return False
    served = [{tag: list(_image_spans(task, key, machine)) for tag, key in _OFFSETS} for _, task in tasks]
    found: dict[int, int] = {}
    for place, slave in enumerate(config.all("Slave")):
        parts = [(tag, part) for tag, _ in _OFFSETS for part in _parts(slave, tag, machine)]
        own = {
            next(
                (
                    task
                    for task, spans in enumerate(served)
                    if any(part[0] in span and part[-1] in span for span in spans[tag])
                ),
                -1,
            )
            for tag, part in parts
        }
        if -1 in own or len(own) > 1:
            return False
        found[place] = own.pop() if own else 0
    for place, number in found.items():
        if number:
            note = f"its task has {rates[number]} times the shortest period"
            machine.nodes[place]["every"] = Fact(rates[number], machine.place(tasks[number][1].line), note=note)
    return True


def _image_spans(task: Element, key: str, machine: Reading) -> Iterator[range]:
    """Bytes of the process image that each datagram of a task has."""
    for command in task.all("Frame/Cmd"):
        start = number(command, key, machine, most=_MOST_BITS)
        length = number(command, "DataLength", machine, most=_MOST_BYTES)
        code = number(command, "Cmd", machine, most=255)
        if start and length and code and code[0] in (_LRD, _LWR, _LRW):
            yield range(start[0], start[0] + length[0])


def _parts(slave: Element, tag: str, machine: Reading) -> Iterator[range]:
    """Bytes of the process image of each part of a device's data."""
    for part in slave.all(f"ProcessData/{tag}"):
        start = number(part, "BitStart", machine, most=_MOST_BITS)
        length = number(part, "BitLength", machine, most=8 * _MOST_BYTES)
        if start and length and length[0]:
            yield range(start[0] // 8, ceil((start[0] + length[0]) / 8))


def _sizes(frame: list[tuple[int, int, int]]) -> list[int]:
    return [length for _, length, _ in frame]


def _commands(frame: Element, machine: Reading) -> Iterator[tuple[int, int, int]]:
    """Command, bytes of data and logical address of each datagram that is sent in operation."""
    for command in frame.all("Cmd"):
        states = [state.text.strip() for state in command.all("State")]
        if states and "OP" not in states:
            continue
        code = number(command, "Cmd", machine, most=255)
        length = number(command, "DataLength", machine, most=_MOST_BYTES)
        data = command.first("Data")
        if length is None and data is not None:
            length = (len(data.text.strip()) // 2, data.line)
        if code is None or length is None:
            raise machine.refusal(command.line, "a cyclic Cmd without Cmd or DataLength")
        address = number(command, "Addr", machine, most=2**32 - 1)
        yield code[0], length[0], address[0] if address else -1


def _frames(config: Element, frames: list[list[tuple[int, int, int]]], line: Line, machine: Reading) -> None:
    """Layout and housekeeping, so that the frames come out to the byte."""
    states = _mailbox_states(config, machine)
    process: list[tuple[int, int]] = []
    others: list[int] = []
    for code, length, address in (command for frame in frames for command in frame):
        if code in (_LRD, _LWR, _LRW) and address not in states:
            process.append((code, length))
        else:
            others.append(length)
    place = machine.place(line)
    own = [facts for facts in machine.nodes.values() if "every" not in facts]
    pairs = [(facts["read_bytes"].value, facts["write_bytes"].value) for facts in own]
    separate, shared = sum(map(sum, pairs)), sum(map(max, pairs))
    total = sum(length for _, length in process)
    codes = {code for code, _ in process}
    if _LRW in codes or len(process) < len((_LRD, _LWR)):
        # A total below the sum of both directions can only be of bytes that both share.
        layout = _SHARED if total < separate else _SEPARATE
    else:
        layout = _SPLIT
    needed = shared if layout == _SHARED else separate
    # Where a frame is full, the profile's next datagram begins a new frame, too.
    headers = 2 if layout == _SPLIT else 1
    further = [0] * max(len(process) - headers * len(frames), 0)
    gaps = total - needed
    notes = [f"{len(process)} datagrams of process data" if further else ""]
    if gaps > 0 and (further or others):
        (further or others)[-1] += gaps
        notes.append(f"{gaps} bytes are gaps in the image")
    elif gaps:
        machine.remarks.append(
            f"{machine.file}:{line}: process data are {total} bytes, its devices have {needed}: those are taken"
        )
    machine.bus["process_data"] = Fact(layout, place)
    machine.bus["housekeeping_bytes"] = Fact([*others, *further], place, note=", ".join(filter(None, notes)))
    machine.bus["frames"] = Fact([_sizes(frame) for frame in frames], place)


def _mailbox_states(config: Element, machine: Reading) -> range:
    """Logical addresses of the states of mailboxes, which no device's process data are."""
    start = number(config, "Master/MailboxStates/StartAddr", machine, most=2**32 - 1)
    count = number(config, "Master/MailboxStates/Count", machine, most=_MOST_DEVICES)
    return range(start[0], start[0] + max(count[0] if count else 1, 1)) if start else range(0)


def _branches(slaves: list[Element], machine: Reading) -> None:
    """Mark devices that are not connected to the device before them."""
    addresses = [number(slave, "Info/PhysAddr", machine, most=65_535) for slave in slaves]
    for place, slave in enumerate(slaves[1:], start=1):
        port = slave.first("PreviousPort")
        before = port and number(port, "PhysAddr", machine, most=65_535)
        own = addresses[place - 1]
        if before and own and before[0] != own[0]:
            machine.nodes[place]["branch"] = Fact(before[0], machine.place(before[1]))
