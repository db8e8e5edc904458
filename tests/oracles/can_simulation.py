"""An event simulation of a CAN bus with a SYNC cycle, as an oracle: it imports nothing of busplan.

Every sender queues its frames; whenever the bus is free, the queued frame with the smallest identifier goes, and nothing
interrupts it. The host queues SYNC at the start of each cycle. A node queues its feedback some time behind SYNC, the
host queues all commands some time behind the last feedback, and a node executes its command some time behind its last
frame. Other messages are queued whenever the caller says. Times are whole numbers of any unit.
"""

from collections.abc import Sequence
from heapq import heappop, heappush
from typing import NamedTuple


class Frame(NamedTuple):
    """One frame on the bus."""

    identifier: int
    us: int


class SimulatedNode(NamedTuple):
    """A node: its frames in either direction, and its times in each cycle."""

    feedback: tuple[Frame, ...]
    command: tuple[Frame, ...]
    read_us: tuple[int, ...]
    """From the end of SYNC to its queued feedback, cycle by cycle."""
    write_us: tuple[int, ...]
    """From the end of its last command frame to its effect, cycle by cycle."""


class SimulatedMessage(NamedTuple):
    """Another message: its frame, and the instants at which it is due and queued."""

    frame: Frame
    due_us: tuple[int, ...]
    queued_us: tuple[int, ...]


class Run(NamedTuple):
    """What a run took."""

    cycles_us: tuple[int, ...]
    """From the start of each cycle to the effect of its last command."""
    syncs_us: tuple[int, ...]
    """From the start of each cycle to the end of SYNC."""
    feedback_us: tuple[tuple[int, ...], ...]
    """From the start of each cycle to the queued feedback of each node."""
    commands_us: tuple[int, ...]
    """From the start of each cycle to the queued commands."""
    responses_us: tuple[tuple[int, ...], ...]
    """From the due instant of each instance of each message to its end, of those that were sent."""


def simulate(
    sync: Frame,
    nodes: Sequence[SimulatedNode],
    messages: Sequence[SimulatedMessage],
    *,
    period_us: int,
    host_us: Sequence[int],
    late_us: int = 0,
) -> Run:
    """Run as many cycles as there are host times.

    Parameters
    ----------
    sync
        The frame that opens a cycle.
    nodes, messages
        Who sends beside the host.
    period_us
        From one SYNC to the next.
    host_us
        From the last feedback to the queued commands, cycle by cycle.
    late_us
        A frame that is queued so long behind the start of another still takes part in its arbitration.
    """
    count = len(host_us)
    queue: list[tuple[int, int, tuple[int, ...]]] = []  # when, identifier, whose

    def put(when_us: int, frame: Frame, *owner: int) -> None:
        heappush(queue, (when_us, frame.identifier, owner))

    frames = {sync.identifier: sync}
    for node in nodes:
        frames |= {one.identifier: one for one in (*node.feedback, *node.command)}
    frames |= {one.frame.identifier: one.frame for one in messages}
    for cycle in range(count):
        put(cycle * period_us, sync, SYNC, cycle)
    for number, message in enumerate(messages):
        for instance, when_us in enumerate(message.queued_us):
            put(when_us, message.frame, MESSAGE, number, instance)

    syncs, commands = [0] * count, [0] * count
    feedback = [[0] * len(nodes) for _ in range(count)]
    ends = [0] * count
    missing = [sum(len(one.feedback) for one in nodes)] * count
    unsent = [[len(one.command) for one in nodes] for _ in range(count)]
    responses: list[list[int]] = [[] for _ in messages]
    pending: list[tuple[int, tuple[int, ...]]] = []
    now_us = 0
    while queue or pending:
        if not pending:
            now_us = max(now_us, queue[0][0])
        while queue and queue[0][0] <= now_us + late_us:
            _, identifier, owner = heappop(queue)
            heappush(pending, (identifier, owner))
        identifier, (sort, *whose) = heappop(pending)
        now_us += frames[identifier].us
        if sort == MESSAGE:
            number, instance = whose
            responses[number].append(now_us - messages[number].due_us[instance])
            continue
        cycle = whose[0]
        if sort == SYNC:
            syncs[cycle] = now_us - cycle * period_us
            for number, node in enumerate(nodes):
                ready_us = now_us + node.read_us[cycle]
                feedback[cycle][number] = ready_us - cycle * period_us
                for frame in node.feedback:
                    put(ready_us, frame, FEEDBACK, cycle, number)
        elif sort == FEEDBACK:
            missing[cycle] -= 1
            if not missing[cycle]:
                commands[cycle] = now_us + host_us[cycle] - cycle * period_us
                for number, node in enumerate(nodes):
                    for frame in node.command:
                        put(now_us + host_us[cycle], frame, COMMAND, cycle, number)
        else:
            number = whose[1]
            unsent[cycle][number] -= 1
            if not unsent[cycle][number]:
                ends[cycle] = max(ends[cycle], now_us + nodes[number].write_us[cycle] - cycle * period_us)
    return Run(tuple(ends), tuple(syncs), tuple(map(tuple, feedback)), tuple(commands), tuple(map(tuple, responses)))


SYNC, FEEDBACK, COMMAND, MESSAGE = range(4)
