"""An event simulation of a CAN bus with a SYNC cycle, as an oracle: it imports nothing of busplan.

Every sender queues its frames; whenever the bus is free, the queued frame with the smallest identifier goes, and
nothing interrupts it. A sender whose queue is not by priority offers one of its frames at a time: the first that came,
or any of them. The host queues SYNC at the start of each cycle, or so
much later as the caller says. A node queues its feedback some time behind
SYNC, the host queues all commands some time behind the last feedback, and a node executes its command some time behind
its last frame. Other messages are queued whenever the caller says. An error breaks the frame that is on the bus, which
stays queued, and holds the bus for a while. Times are whole numbers of any unit.
"""

from collections import deque
from collections.abc import Callable, Hashable, Mapping, Sequence
from heapq import heappop, heappush
from random import Random
from typing import Final, NamedTuple


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
    every: int = 1
    full: int = 0
    """It sends and takes its frames in this cycle and each `every` cycles before and behind it."""

    def is_due(self, cycle: int) -> bool:
        """Whether it takes part in a cycle."""
        return (cycle - self.full) % self.every == 0


class SimulatedMessage(NamedTuple):
    """Another message: its frame, and the instants at which it is due and queued."""

    frame: Frame
    due_us: tuple[int, ...]
    queued_us: tuple[int, ...]
    sender: Hashable = None
    """Who has it in a queue: `HOST`, the number of a node, or any other device."""


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
    ends_us: tuple[int, ...]
    """End of each frame."""


HOST: Final = "host"
_BY_PRIORITY: Final[Mapping[Hashable, Random | None]] = {}


def simulate(
    sync: Frame,
    nodes: Sequence[SimulatedNode],
    messages: Sequence[SimulatedMessage],
    *,
    period_us: int,
    host_us: Sequence[int],
    late_us: int = 0,
    sync_late_us: Sequence[int] = (),
    errors_us: Sequence[int] = (),
    error_us: int = 0,
    orders: Mapping[Hashable, Random | None] = _BY_PRIORITY,
    adapter_us: Sequence[Sequence[tuple[int, int]]] = (),
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
    sync_late_us
        How late SYNC is queued, cycle by cycle; without it never.
    errors_us, error_us
        Instants of errors, ascending, and how long each holds the bus. Those without a frame on the bus do nothing.
    orders
        Senders whose queue is not by priority: None where it is first in, first out, else what draws any of it.
    adapter_us
        From the end of a feedback frame to the host's program, and from there to the queued command, of each node,
        cycle by cycle; without it no time.
    """
    bus = _Bus(sync, nodes, messages, period_us, host_us, sync_late_us or (0,) * len(host_us))
    bus.orders, bus.adapter_us = orders, adapter_us or ([(0, 0)] * len(nodes),) * len(host_us)
    bus.run(late_us, errors_us, error_us)
    return Run(
        tuple(bus.ends),
        tuple(bus.syncs),
        tuple(map(tuple, bus.feedback)),
        tuple(bus.commands),
        tuple(map(tuple, bus.responses)),
        tuple(bus.frame_ends),
    )


SYNC, FEEDBACK, COMMAND, MESSAGE = range(4)


class _Bus:
    """A bus while it runs; what it has measured counts from the start of each cycle."""

    def __init__(
        self,
        sync: Frame,
        nodes: Sequence[SimulatedNode],
        messages: Sequence[SimulatedMessage],
        period_us: int,
        host_us: Sequence[int],
        sync_late_us: Sequence[int],
    ) -> None:
        self.nodes, self.messages, self.period_us, self.host_us = nodes, messages, period_us, host_us
        cycles = len(host_us)
        self.syncs, self.commands, self.ends = [0] * cycles, [0] * cycles, [0] * cycles
        self.feedback = [[0] * len(nodes) for _ in range(cycles)]
        self.responses: list[list[int]] = [[] for _ in messages]
        self.missing = [sum(len(node.feedback) for node in nodes if node.is_due(cycle)) for cycle in range(cycles)]
        """Feedback frames that have not arrived, of each cycle."""
        self.adapter_us: Sequence[Sequence[tuple[int, int]]] = ()
        self.known_us = [0] * cycles
        """When the host's program has all feedback that has arrived, of each cycle."""
        self.unsent = [[len(node.command) for node in nodes] for _ in range(cycles)]
        """Command frames that have not arrived, of each cycle and node."""
        self.queue: list[tuple[int, int, int, tuple[int, ...]]] = []
        """When each frame is queued, its identifier, its time, and whose it is."""
        self.frame_ends: list[int] = []
        self.orders = _BY_PRIORITY
        self.waiting: dict[Hashable, list[tuple[int, int, tuple[int, ...]]]] = {}
        """Frames of a queue that is not by priority, beside the one that it offers."""
        for cycle in range(cycles):
            self.put(cycle * period_us + sync_late_us[cycle], sync, SYNC, cycle)
        for number, message in enumerate(messages):
            for instance, when_us in enumerate(message.queued_us):
                self.put(when_us, message.frame, MESSAGE, number, instance)

    def put(self, when_us: int, frame: Frame, *owner: int) -> None:
        """Queue a frame."""
        heappush(self.queue, (when_us, frame.identifier, frame.us, owner))

    def sender(self, sort: int, *whose: int) -> Hashable:
        """Who has a frame in its queue."""
        if sort == MESSAGE:
            return self.messages[whose[0]].sender
        return whose[1] if sort == FEEDBACK else HOST

    def offered(self, frame: tuple[int, int, tuple[int, ...]]) -> bool:
        """Whether a queued frame takes part in the arbitration at once; else it waits for others of its sender."""
        sender = self.sender(*frame[2])
        if sender not in self.orders:
            return True
        waiting = self.waiting.get(sender)
        if waiting is None:
            self.waiting[sender] = []
            return True
        waiting.append(frame)
        return False

    def next_of(self, owner: tuple[int, ...]) -> list[tuple[int, int, tuple[int, ...]]]:
        """What a queue offers behind a frame that has gone."""
        sender = self.sender(*owner)
        if sender not in self.orders:
            return []
        waiting, random = self.waiting[sender], self.orders[sender]
        if not waiting:
            del self.waiting[sender]
            return []
        if random is None:
            return [waiting.pop(0)]
        # Frames of one identifier stay in their order.
        drawn = random.choice(waiting)[0]
        return [waiting.pop(next(place for place, frame in enumerate(waiting) if frame[0] == drawn))]

    def run(self, late_us: int, errors_us: Sequence[int], error_us: int) -> None:
        """Send every frame: whenever the bus is free, that of the smallest identifier."""
        errors = deque(errors_us)
        pending: list[tuple[int, int, tuple[int, ...]]] = []
        now_us = 0
        while self.queue or pending:
            if not pending:
                now_us = max(now_us, self.queue[0][0])
            while self.queue and self.queue[0][0] <= now_us + late_us:
                frame = heappop(self.queue)[1:]
                if self.offered(frame):
                    heappush(pending, frame)
            while errors and errors[0] < now_us:
                errors.popleft()
            if errors and errors[0] < now_us + pending[0][1]:
                now_us = errors.popleft() + error_us
                continue
            _, us, (sort, *whose) = heappop(pending)
            now_us += us
            for frame in self.next_of((sort, *whose)):
                heappush(pending, frame)
            self.frame_ends.append(now_us)
            _ARRIVED[sort](self, now_us, *whose)

    def sync_arrived(self, now_us: int, cycle: int) -> None:
        """Every node begins to execute."""
        self.syncs[cycle] = now_us - cycle * self.period_us
        for number, node in enumerate(self.nodes):
            if not node.is_due(cycle):
                continue
            ready_us = now_us + node.read_us[cycle]
            self.feedback[cycle][number] = ready_us - cycle * self.period_us
            for frame in node.feedback:
                self.put(ready_us, frame, FEEDBACK, cycle, number)
        if not self.missing[cycle]:
            self.compute(now_us, cycle)

    def feedback_arrived(self, now_us: int, cycle: int, number: int) -> None:
        """When its program has the last feedback the host begins to compute."""
        self.missing[cycle] -= 1
        self.ends[cycle] = max(self.ends[cycle], now_us - cycle * self.period_us)
        self.known_us[cycle] = max(self.known_us[cycle], now_us + self.adapter_us[cycle][number][0])
        if not self.missing[cycle]:
            self.compute(self.known_us[cycle], cycle)

    def compute(self, now_us: int, cycle: int) -> None:
        """The host computes the commands."""
        ready_us = now_us + self.host_us[cycle]
        for place, node in enumerate(self.nodes):
            queued_us = ready_us + self.adapter_us[cycle][place][1]
            for frame in node.command if node.is_due(cycle) else ():
                self.commands[cycle] = max(self.commands[cycle], queued_us - cycle * self.period_us)
                self.put(queued_us, frame, COMMAND, cycle, place)

    def command_arrived(self, now_us: int, cycle: int, number: int) -> None:
        """Behind its last frame the node executes its command."""
        self.unsent[cycle][number] -= 1
        if not self.unsent[cycle][number]:
            end_us = now_us + self.nodes[number].write_us[cycle] - cycle * self.period_us
            self.ends[cycle] = max(self.ends[cycle], end_us)

    def message_arrived(self, now_us: int, number: int, instance: int) -> None:
        """Its response ends."""
        self.responses[number].append(now_us - self.messages[number].due_us[instance])


_ARRIVED: Final[tuple[Callable[..., None], ...]] = (
    _Bus.sync_arrived,
    _Bus.feedback_arrived,
    _Bus.command_arrived,
    _Bus.message_arrived,
)
