"""An event simulation of a CAN bus whose nodes answer requests, as an oracle: it imports nothing of busplan.

The host hands a request to its controller after some time of its own: each behind the answer before (`polled`), or one
behind the other without waiting (burst). A node queues its answer some time behind the end of its request. Whenever the
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


def simulate(
    motors: Sequence[Motor],
    messages: Sequence[tuple[Frame, Sequence[int]]],
    *,
    starts_us: Sequence[int],
    host_us: Sequence[Sequence[int]],
    polled: bool,
    late_us: int = 0,
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
    """
    running = count()
    coming: list[tuple[int, int, Frame, str, int, int]] = []
    pending: list[tuple[int, int, int, int, str, int, int]] = []
    left: dict[tuple[str, int, int], int] = {}
    sent: list[Sent] = []

    def put(when_us: int, frames: Sequence[Frame], sort: str, number: int, cycle: int) -> None:
        left[sort, number, cycle] = len(frames)
        for frame in frames:
            heappush(coming, (when_us, next(running), frame, sort, number, cycle))

    for place, (frame, queued_us) in enumerate(messages):
        for instance, when_us in enumerate(queued_us):
            put(when_us, [frame], "message", place, instance)
    for cycle, start_us in enumerate(starts_us):
        when_us = start_us
        for number in range(1 if polled else len(motors)):
            when_us += host_us[cycle][number]
            put(when_us, motors[number].request, "request", number, cycle)
    now_us = 0
    while coming or pending:
        if not pending:
            now_us = max(now_us, coming[0][0])
        while coming and coming[0][0] <= now_us + late_us:
            when_us, run, (identifier, us), *whose = heappop(coming)
            heappush(pending, (identifier, run, us, when_us, *whose))
        _, _, us, when_us, sort, number, cycle = heappop(pending)
        sent.append(Sent(sort, number, cycle, when_us, now_us, now_us + us))
        now_us += us
        left[sort, number, cycle] -= 1
        if left[sort, number, cycle]:
            continue
        if sort == "request":
            put(now_us + motors[number].exec_us[cycle], motors[number].answer, "answer", number, cycle)
        elif sort == "answer" and polled and number + 1 < len(motors):
            put(now_us + host_us[cycle][number + 1], motors[number + 1].request, "request", number + 1, cycle)
    return sent
