"""ENI, the configuration of an EtherCAT master (ETG.2100): frames to the byte, devices, clocks and mailboxes."""

import re
from collections.abc import Iterator, Sequence
from math import ceil, lcm
from typing import Final, NamedTuple

from busplan.questions.import_.reading import ControlWords, Fact, Facts, Line, Reading, whole_number
from busplan.questions.import_.xml import Element, parsed

_LRD, _LWR, _LRW = 10, 11, 12
_LOGICAL: Final = (_LRD, _LWR, _LRW)
_SEPARATE, _SHARED, _SPLIT = "LRW-separate", "LRW-shared", "LRD-LWR"
_PORTS: Final = {"Y": "100BASE-TX", "K": "E-bus"}
_CONTROL_WORD: Final = re.compile(r"control[ _-]?word", re.IGNORECASE)
_TYPE: Final = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
_MOST_BYTES: Final = 1486
_MOST_BITS: Final = 8 * 65_536
_MOST_TIME_NS: Final = 10**12
_MOST_DEVICES: Final = 65_535
_MOST_CYCLES: Final = 1000
"""Longest common multiple of rates that a profile accepts [cycles]."""
_SIZES: Final = {"Recv": "read_bytes", "Send": "write_bytes"}
"""Keys of a device's data, by direction."""
_OFFSETS: Final = {"Recv": "InputOffs", "Send": "OutputOffs"}
"""Keys of a datagram for the start of a direction's data in the process image."""


class _Datagram(NamedTuple):
    """A datagram sent in operation."""

    code: int
    length: int
    """Data of the datagram [bytes]."""
    address: int
    """Logical address; -1 without one."""
    image: dict[str, range]
    """Bytes of the process image in the datagram, by direction."""


class _Task(NamedTuple):
    """A task of the master."""

    period: Fact | None
    line: Line
    frames: list[list[_Datagram]]

    @property
    def period_us(self) -> int:
        """Period of the task [us]; 0 if unknown."""
        return int(self.period.value) if self.period else 0

    @property
    def sizes(self) -> list[list[int]]:
        """Sizes of the datagrams of each frame [bytes]."""
        return [[datagram.length for datagram in frame] for frame in self.frames]


def read(content: bytes, name: str) -> Reading:
    """Read an ENI file.

    One that is not valid, or describes no machine, raises BusplanError with its line.
    """
    root = parsed(content, name=name, skipped=("InitCmds", "StringTable"))
    machine = Reading("ethercat", "ENI", name, rank=0)
    config = root.first("Config")
    slaves = list(config.all("Slave")) if config else []
    if config is None or not slaves:
        encrypted = ": it is encrypted; export it without" if root.tag.startswith("Encrypted") else ""
        raise machine.refusal(root.line, f"<{root.tag}> has no Config/Slave that can be read{encrypted}")
    if len(slaves) > _MOST_DEVICES:
        raise machine.refusal(slaves[-1].line, f"more than {_MOST_DEVICES} devices")
    images: dict[str, set[int]] = {direction: set() for direction in _SIZES}
    outputs = list(config.all("ProcessImage/Outputs/Variable"))
    for place, slave in enumerate(slaves):
        machine.nodes[place] = _device(slave, images, outputs, machine)
    _cycle(config, slaves, machine)
    _branches(slaves, machine)
    return machine


def _number(element: Element, path: str, machine: Reading, *, most: int) -> Fact | None:
    """Whole number in an element below this one; None without one."""
    child = element.first(path)
    if child is None or not child.text.strip():
        return None
    return machine.number(child.tag, child.text, child.line, most=most)


def _parts(slave: Element, direction: str, machine: Reading) -> Iterator[tuple[range, Fact]]:
    """Bits of the process image with each part of a device's data, and the length of the part."""
    for part in slave.all(f"ProcessData/{direction}"):
        start = _number(part, "BitStart", machine, most=_MOST_BITS)
        length = _number(part, "BitLength", machine, most=8 * _MOST_BYTES)
        if start and length and length.value:
            yield range(start.value, start.value + length.value), length


def _bytes_of(bits: range) -> range:
    return range(bits.start // 8, ceil(bits.stop / 8))


def _device(slave: Element, images: dict[str, set[int]], outputs: list[Element], machine: Reading) -> Facts:
    """Facts of a device.

    `images` are the bytes of the process image of earlier devices, by direction; those of this one are added. `outputs`
    are variables of the process image.
    """
    info = slave.first("Info") or slave
    title, physics = info.first("Name"), info.first("Physics")
    text = title.text.strip() if title else ""
    kind = _TYPE.search(text)
    facts = {"name": machine.fact(kind[1] if kind else text or "device", title.line if title else slave.line)}
    letter = physics.text.strip()[:1].upper() if physics else ""
    if physics and letter in _PORTS:
        facts["port"] = machine.fact(_PORTS[letter], physics.line, note=f"Physics {physics.text.strip()[:8]}")
    sent: range | None = None
    for direction, key in _SIZES.items():
        first, size, bits = machine.fact(0, slave.line), 0, 0
        for span, length in _parts(slave, direction, machine):
            new = set(_bytes_of(span)) - images[direction]
            images[direction] |= new
            first, size, bits = length, size + len(new), bits + len(span)
            sent = span if direction == "Send" else sent
        shares = f"{bits} bits in bytes of its neighbours" if bits > 8 * size else ""
        facts[key] = first._replace(value=size, note=shares)
    facts["axes"] = _axes(slave, sent, outputs, machine)
    clock = slave.first("DC")
    cycle = clock and _number(clock, "CycleTime0", machine, most=_MOST_TIME_NS)
    if clock and cycle and cycle.value:
        facts["clock_us"] = cycle._replace(value=cycle.value / 1000)
        shift = clock.first("ShiftTime")
        shift_ns = whole_number(shift.text) if shift else None
        if shift and shift_ns is not None:
            facts["shift_us"] = machine.fact(shift_ns / 1000, shift.line)
    mailbox = slave.first("Mailbox/Recv")
    longest = mailbox and _number(mailbox, "Length", machine, most=_MOST_BITS)
    if longest and longest.value:
        facts["mailbox_bytes"] = longest
    return facts


def _axes(slave: Element, sent: range | None, outputs: list[Element], machine: Reading) -> Fact:
    """Axes of a device: control words of CiA 402 in its PDOs, or among the names of its outputs."""
    words, pdos = ControlWords(), list(slave.all("ProcessData/RxPdo"))
    for pdo in [pdo for pdo in pdos if "Sm" in pdo.attributes] or pdos:
        for entry in pdo.all("Entry"):
            parts = (entry.first(tag) for tag in ("Index", "SubIndex", "BitLen"))
            index, sub, bits = (whole_number(part.text) if part else None for part in parts)
            words.add(index, sub, bits, entry.line)
    if not words.lines and sent:
        for variable in outputs:
            title, offset = variable.first("Name"), _number(variable, "BitOffs", machine, most=_MOST_BITS)
            if title and offset and offset.value in sent and _CONTROL_WORD.search(title.text):
                words.lines[offset.value] = title.line
    # A device without outputs is no drive.
    is_listed = bool(words.lines or pdos or sent is None)
    return words.axes(machine, line=(pdos[0].line if pdos else slave.line) if is_listed else None)


def _cycle(config: Element, slaves: Sequence[Element], machine: Reading) -> None:
    """Period, and contents of the frames of a cycle."""
    tasks = sorted((_task(task, machine) for task in config.all("Cyclic")), key=lambda task: task.period_us)
    if tasks and tasks[0].period and tasks[0].period_us:
        machine.bus["period_us"] = tasks[0].period
    else:
        clocks = [facts["clock_us"] for facts in machine.nodes.values() if "clock_us" in facts]
        if clocks:
            machine.bus["period_us"] = min(clocks)._replace(note="of the clocks; no Cyclic/CycleTime")
    if not tasks or not tasks[0].frames:
        machine.remarks.append(f"{machine.file}: no Cyclic/Frame: which datagrams the master sends is not known")
        return
    has_rates = _rates(slaves, tasks, machine)
    _frames(config, tasks[0], machine)
    for task in tasks[1:]:
        if has_rates:
            # All frames go in the cycle in which the tasks meet.
            machine.bus["frames"].value.extend(task.sizes)
            continue
        machine.bus.setdefault("slower", machine.fact([], task.line)).value.extend(task.sizes)
        machine.remarks.append(
            f"{machine.file}:{task.line}: a further task of {task.period_us if task.period else 'unknown'} us: its "
            "frames are counted in every cycle, in cycle.nonperiodic_us"
        )


def _task(task: Element, machine: Reading) -> _Task:
    period = _number(task, "CycleTime", machine, most=_MOST_TIME_NS)
    frames = [list(_datagrams(frame, machine)) for frame in task.all("Frame")]
    return _Task(period, task.line, [frame for frame in frames if frame])


def _datagrams(frame: Element, machine: Reading) -> Iterator[_Datagram]:
    for command in frame.all("Cmd"):
        states = [state.text.strip() for state in command.all("State")]
        if states and "OP" not in states:
            continue
        code = _number(command, "Cmd", machine, most=255)
        length = _number(command, "DataLength", machine, most=_MOST_BYTES)
        data = command.first("Data")
        if length is None and data is not None:
            length = machine.fact(len(data.text.strip()) // 2, data.line)
        if code is None or length is None:
            raise machine.refusal(command.line, "a cyclic Cmd without Cmd or DataLength")
        address = _number(command, "Addr", machine, most=2**32 - 1)
        starts = {
            direction: whole_number(offset.text)
            for direction, key in _OFFSETS.items()
            if code.value in _LOGICAL and (offset := command.first(key))
        }
        image = {key: range(start, start + length.value) for key, start in starts.items() if start is not None}
        yield _Datagram(code.value, length.value, address.value if address else -1, image)


def _rates(slaves: Sequence[Element], tasks: Sequence[_Task], machine: Reading) -> bool:
    """Give devices of slower tasks their rate, if the file assigns devices to tasks.

    Returns whether each device belongs to a single task, and all periods are multiples of the shortest.
    """
    shortest_us = tasks[0].period_us
    rates = [task.period_us // shortest_us if shortest_us else 0 for task in tasks]
    are_multiples = all(rate and rate * shortest_us == task.period_us for rate, task in zip(rates, tasks, strict=True))
    if len(tasks) == 1 or not are_multiples or lcm(*rates) > _MOST_CYCLES:
        return False
    task_of: list[int | None] = []
    for slave in slaves:
        parts = [(direction, _bytes_of(bits)) for direction in _SIZES for bits, _ in _parts(slave, direction, machine)]
        serving = {_serving(tasks, direction, part) for direction, part in parts} or {0}
        task_of.append(serving.pop() if len(serving) == 1 else None)
    if None in task_of:
        return False
    for place, number in enumerate(task_of):
        if number:
            note = f"its task has {rates[number]} times the shortest period"
            machine.nodes[place]["every"] = machine.fact(rates[number], tasks[number].line, note=note)
    return True


def _serving(tasks: Sequence[_Task], direction: str, part: range) -> int | None:
    """Index of the first task with a datagram that has a part of the process image; None without one."""
    for number, task in enumerate(tasks):
        spans = (datagram.image.get(direction, range(0)) for frame in task.frames for datagram in frame)
        if any(part[0] in span and part[-1] in span for span in spans):
            return number
    return None


def _frames(config: Element, task: _Task, machine: Reading) -> None:
    """Layout and housekeeping with which the frames of the fastest task come out to the byte."""
    states = _mailbox_states(config, machine)
    process: list[_Datagram] = []
    housekeeping: list[int] = []
    for datagram in (datagram for frame in task.frames for datagram in frame):
        if datagram.code in _LOGICAL and datagram.address not in states:
            process.append(datagram)
        else:
            housekeeping.append(datagram.length)
    served = [facts for facts in machine.nodes.values() if "every" not in facts]
    pairs = [(facts["read_bytes"].value, facts["write_bytes"].value) for facts in served]
    separate, shared = sum(map(sum, pairs)), sum(map(max, pairs))
    total = sum(datagram.length for datagram in process)
    if any(datagram.code == _LRW for datagram in process) or len(process) < len((_LRD, _LWR)):
        # A total below the sum of both directions needs bytes that both share.
        layout = _SHARED if total < separate else _SEPARATE
    else:
        layout = _SPLIT
    needed = shared if layout == _SHARED else separate
    # After a full frame, the profile's next datagram begins a new one, too.
    headers = 2 if layout == _SPLIT else 1
    further = [0] * max(len(process) - headers * len(task.frames), 0)
    gaps, notes = total - needed, [f"{len(process)} datagrams of process data"] if further else []
    if gaps > 0 and (further or housekeeping):
        (further or housekeeping)[-1] += gaps
        notes.append(f"{gaps} bytes are gaps in the image")
    elif gaps:
        machine.remarks.append(
            f"{machine.file}:{task.line}: {total} bytes of process data, but {needed} bytes in its devices; the "
            "latter is used"
        )
    machine.bus["process_data"] = machine.fact(layout, task.line)
    machine.bus["housekeeping_bytes"] = machine.fact([*housekeeping, *further], task.line, note=", ".join(notes))
    machine.bus["frames"] = machine.fact(task.sizes, task.line)


def _mailbox_states(config: Element, machine: Reading) -> range:
    """Logical addresses of the states of mailboxes, which belong to no device's process data."""
    start = _number(config, "Master/MailboxStates/StartAddr", machine, most=2**32 - 1)
    count = _number(config, "Master/MailboxStates/Count", machine, most=_MOST_DEVICES)
    return range(start.value, start.value + max(count.value if count else 1, 1)) if start else range(0)


def _branches(slaves: list[Element], machine: Reading) -> None:
    """Mark devices that are not connected to the device before them."""
    addresses = [_number(slave, "Info/PhysAddr", machine, most=65_535) for slave in slaves]
    for place, slave in enumerate(slaves[1:], start=1):
        port, before = slave.first("PreviousPort"), addresses[place - 1]
        parent = port and _number(port, "PhysAddr", machine, most=65_535)
        if parent and before and parent.value != before.value:
            machine.nodes[place]["branch"] = parent
