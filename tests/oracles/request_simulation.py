"""An event simulation of a CAN bus whose nodes answer requests, as an oracle: it imports nothing of busplan.

The host hands a request to its controller after some time of its own: each behind the answer before (`polled`), or one
behind the other without waiting (burst). The host's adapter takes a while from the program to the controller, and from
the end of an answer to the program. A node queues its answer some time behind the end of its request. Whenever the
bus is free the queued frame with the smallest identifier goes, and nothing interrupts it. Other messages are queued
when the caller says. Times are whole numbers of any unit.
"""

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

Frame = tuple[int, int]
"""Identifier and time."""


class Motor(NamedTuple):
    """A node: its frames, and its time from request to answer, cycle by cycle."""

    request: tuple[Frame, ...]
    answer: tuple[Frame, ...]
    exec_us: tuple[int, ...]


class Sent(NamedTuple):
    """A frame that was sent: what it is, and when it was queued, began and ended."""

    sort: str
    number: int
    """Node, or message."""
    cycle: int
    """Cycle, or instance."""
    queued_us: int
    start_us: int
    end_us: int
    known_us: int
    """When the host's program has an answer; of others as it ended."""


def simulate(
    motors: Sequence[Motor],
    messages: Sequence[tuple[Frame, Sequence[int]]],
    *,
    starts_us: Sequence[int],
    host_us: Sequence[Sequence[int]],
    polled: bool,
    late_us: int = 0,
    adapter_us: Sequence[Sequence[tuple[int, int]]] = (),
) -> list[Sent]:
    """Run a cycle from each of some instants on.

    Parameters
    ----------
    motors
        Nodes in the order of their requests.
    messages
        Each frame with the instants at which it is queued.
    starts_us
        Instants at which the cycles begin; each must be over when the next begins.
    host_us
        The host's time for each request, by cycle.
    polled
        Whether each request waits for the answer before.
    late_us
        A frame that is queued so long behind the start of another still takes part in its arbitration.
    adapter_us
        From the program to the controller, and from an answer's end to the program, of each request, by cycle; without
        it no time.
    """
    bus = _Bus(motors, host_us, adapter_us or [[(0, 0)] * len(motors)] * len(starts_us), polled=polled)
    for place, (frame, queued_us) in enumerate(messages):
        for instance, when_us in enumerate(queued_us):
            bus.put(when_us, [frame], "message", place, instance)
    for cycle, start_us in enumerate(starts_us):
        when_us = start_us
        for number in range(1 if polled else len(motors)):
            when_us += host_us[cycle][number]
            bus.put(when_us + bus.adapter_us[cycle][number][0], motors[number].request, "request", number, cycle)
    return bus.run(late_us)


class _Bus:
    """A bus while it runs."""

    def __init__(
        self,
        motors: Sequence[Motor],
        host_us: Sequence[Sequence[int]],
        adapter_us: Sequence[Sequence[tuple[int, int]]],
        *,
        polled: bool,
    ) -> None:
        self.motors, self.host_us, self.adapter_us, self.polled = motors, host_us, adapter_us, polled
        self.running = count()
        self.coming: list[tuple[int, int, Frame, str, int, int]] = []
        self.left: dict[tuple[str, int, int], int] = {}

    def put(self, when_us: int, frames: Sequence[Frame], sort: str, number: int, cycle: int) -> None:
        """Queue all frames of a request, an answer or a message."""
        self.left[sort, number, cycle] = len(frames)
        for frame in frames:
            heappush(self.coming, (when_us, next(self.running), frame, sort, number, cycle))

    def run(self, late_us: int) -> list[Sent]:
        """Send every frame: whenever the bus is free, that of the smallest identifier."""
        pending: list[tuple[int, int, int, int, str, int, int]] = []
        sent: list[Sent] = []
        now_us = 0
        while self.coming or pending:
            if not pending:
                now_us = max(now_us, self.coming[0][0])
            while self.coming and self.coming[0][0] <= now_us + late_us:
                when_us, run, (identifier, us), sort, number, cycle = heappop(self.coming)
                heappush(pending, (identifier, run, us, when_us, sort, number, cycle))
            _, _, us, when_us, sort, number, cycle = heappop(pending)
            start_us, now_us = now_us, now_us + us
            known_us = now_us + (self.adapter_us[cycle][number][1] if sort == "answer" else 0)
            sent.append(Sent(sort, number, cycle, when_us, start_us, now_us, known_us))
            self.left[sort, number, cycle] -= 1
            if not self.left[sort, number, cycle]:
                self.arrived(known_us, sort, number, cycle)
        return sent

    def arrived(self, now_us: int, sort: str, number: int, cycle: int) -> None:
        """A motor answers a request; behind an answer a host that waits sends the next request."""
        if sort == "request":
            self.put(now_us + self.motors[number].exec_us[cycle], self.motors[number].answer, "answer", number, cycle)
        elif sort == "answer" and self.polled and number + 1 < len(self.motors):
            when_us = now_us + self.host_us[cycle][number + 1] + self.adapter_us[cycle][number + 1][0]
            self.put(when_us, self.motors[number + 1].request, "request", number + 1, cycle)
