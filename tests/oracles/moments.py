"""When what happened in a recording of an emulated machine, by the emulator's own words.

A moment is the number of a frame in the file, from 1. It imports nothing of busplan.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Final, NamedTuple

from tests.oracles import can_recording as can
from tests.oracles import ethercat_recording as ethercat


class Event(NamedTuple):
    """An event of a figure."""

    frame: int
    value: float = 1.0
    """How late it is [us], or how many it counts for."""


Events = Mapping[str, list[Event]]
"""Events of a recording, by the quantity of their figure."""


Numbered = list[tuple[int, can.Logged]]
"""Frames with their numbers."""


def of_log(machine: can.Machine) -> tuple[list[float], Events]:
    """Stamp of each frame of a machine's log [us], and the events in it."""
    _, logged, _ = can.in_log(machine)
    found: dict[str, list[Event]] = defaultdict(list)
    sent: dict[tuple[str, int], Numbered] = defaultdict(list)
    for number, frame in enumerate(logged, start=1):
        if frame.is_error:
            found["error frames"].append(Event(number))
        elif frame.queued.stream == "unplanned":
            found["frames of no message of the plan"].append(Event(number))
        else:
            sent[frame.queued.stream, frame.identifier].append((number, frame))
    syncs = {frame.queued.number: (number, frame.us) for number, frame in sent.get(("SYNC", 0x80), ())}
    for before, after in pairwise(sorted(syncs)):
        if after - before > 1:
            found["cycles without SYNC"].append(Event(syncs[before][0], after - before - 1))
    for number, frame in sent.get(("SYNC", 0x80), ()):
        found["SYNC: jitter of the arrival"].append(Event(number, frame.us - frame.queued.due_us))
    missing = Counter[int]()
    for node in can.nodes_of(machine.plan):
        for pdo in node.feedback + node.command:
            if frames := sent.get((pdo.stream, pdo.identifier)):
                missing.update(_of_pdo(frames, node.every, syncs, found))
    found["PDOs missing"] = [Event(frame, often) for frame, often in missing.items()]
    return [frame.us for frame in logged], found


def _of_pdo(
    frames: Numbered, every: int, syncs: dict[int, tuple[int, float]], found: dict[str, list[Event]]
) -> Iterator[int]:
    """Events of the frames of an identifier; yields the SYNC of each that is missing."""
    # Frames that overtake each other are alike in a log: they come in their order.
    order = sorted(frame.queued.number for _, frame in frames)
    # What the last SYNC asked for may come when the log has ended.
    due = [number for number in sorted(syncs) if (number - order[0]) % every == 0][:-1]
    yield from (syncs[number][0] for number in set(due) - set(order))
    before = None
    for (number, frame), cycle in zip(frames, order, strict=True):
        # Of two after the first SYNC at which it is due, one may be of a SYNC before the log.
        if cycle == before and due and cycle > due[0]:
            found["PDOs twice"].append(Event(number))
        before = cycle
        if cycle in syncs:
            late = Event(number, frame.us - syncs[cycle][1])
            found["last PDO after SYNC"].append(late)
            found[f"{frame.queued.stream}: response"].append(late)


PROCESS: Final = (ethercat.LRD, ethercat.LWR, ethercat.LRW)
MAILBOXES: Final = 0x9000000


def of_capture(machine: ethercat.Machine, cycles: int, *, seed: int) -> tuple[list[float], Events]:
    """Stamp of each packet of a machine's capture [us], and the events in it."""
    packets = ethercat.in_capture(machine, cycles, seed=seed)
    found: dict[str, list[Event]] = defaultdict(list)
    late_us = [late for late, _ in ethercat.starts_and_hosts(machine, cycles + 2, seed=seed)]
    first: dict[int, int] = {}
    for number, packet in enumerate(packets, start=1):
        cycle = packet.trip.cycle
        is_data = _has_process_data(packet.trip.datagrams)
        if cycle in machine.lost and not packet.returned:
            found["lost frames"].append(Event(number))
        if cycle in machine.wrong and packet.returned and is_data:
            found["wrong working counters"].append(Event(number))
        if is_data and not packet.returned and cycle not in first:
            first[cycle] = number
            found["latest start"].append(Event(number, late_us[cycle]))
    # Of a cycle that the capture has in part nobody knows more.
    sent = Counter(packet.trip.cycle for packet in packets if not packet.returned and not packet.trip.is_poll)
    seen = sorted(cycle for cycle in first if sent[cycle] == len(machine.frames(cycle)))
    for before, after in pairwise(seen):
        due = sum(any(map(_has_process_data, machine.frames(cycle))) for cycle in range(before + 1, after))
        if due:
            found["cycles without a frame"].append(Event(first[before], due))
    return [packet.us for packet in packets], found


def _has_process_data(datagrams: ethercat.Datagrams) -> bool:
    return any(command in PROCESS and at != MAILBOXES for command, at, _ in datagrams)


def first_and_worst(
    events: Iterable[Event], *, bound: float | None, tolerance: float
) -> tuple[frozenset[int], frozenset[int]]:
    """Frames that may be the first event beyond a bound, and the worst of all, for values known to a tolerance.

    Without a bound all events count, and the first of equal ones is the worst. Mostly each is one frame.
    """
    ordered = sorted(events)
    most = max(event.value for event in ordered)
    if bound is None:
        worst = next(event.frame for event in ordered if event.value == most)
        return frozenset({ordered[0].frame}), frozenset({worst})
    surely = next((event.frame for event in ordered if event.value > bound + tolerance), ordered[-1].frame)
    first = {event.frame for event in ordered if event.value > bound - tolerance and event.frame <= surely}
    return frozenset(first), frozenset(event.frame for event in ordered if event.value >= most - tolerance)
