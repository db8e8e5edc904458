"""Logs of CAN motors that answer requests, with known truth, frame by frame. It imports nothing of busplan.

The host sends a request to each node, behind the answer before (polled) or all at once (burst), after some time of its
own. A node queues its answer some time behind the end of its request. The bus and its frames are those of
`can_recording`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from random import Random
from typing import Any

from tests.oracles.can_recording import Logged, Node, Queued, arbitrated, nodes_of, padded

Times = dict[tuple[int, int], float]
"""Time of a node in a cycle [us]."""


@dataclass
class Arm:
    """A machine, its plan, and what it does beside it."""

    plan: dict[str, Any]
    cycles: int = 200
    seed: int = 1
    lost: frozenset[tuple[int, int]] = frozenset()
    """Node and cycle of answers that never come."""
    twice: frozenset[tuple[int, int]] = frozenset()
    slow: Times = field(default_factory=dict)
    """Answers that are queued so much later."""
    late: Times = field(default_factory=dict)
    """Requests that are queued so much later."""
    skipped: frozenset[int] = frozenset()
    """Cycles without a request."""
    own: Times = field(default_factory=dict)
    """What each node took, and the host for each request: set by a run."""
    hosts: Times = field(default_factory=dict)

    def logged(self) -> list[Logged]:
        """All that the bus carries."""
        self.random, bus = Random(self.seed), self.plan["bus"]
        self.polled, self.period_us = bus["access"] == "polled", self.plan["cycle"]["period_us"]
        self.nodes = list(nodes_of(self.plan))
        self.left: dict[tuple[str, int, int], int] = {}
        queued = [*self._messages()]
        if self.polled:
            queued += self._next(0, 0, 0.0)
        else:
            for cycle in range(self.cycles):
                us = cycle * self.period_us
                for number in range(len(self.nodes)):
                    if self._is_due(number, cycle):
                        us += self._host(number, cycle)
                        queued += self._sent("request", number, cycle, us)
        return arbitrated(
            queued,
            bit_us=1000 / bus["bit_rate_kbit_s"],
            data_bit_us=1000 / bus.get("data_bit_rate_kbit_s", bus["bit_rate_kbit_s"]),
            answers=self._answers,
        )

    def _is_due(self, number: int, cycle: int) -> bool:
        return number < len(self.nodes) and cycle not in self.skipped

    def _host(self, number: int, cycle: int) -> float:
        most_us: float = self.plan["bus"].get("host_us", 0.0)
        us = self.random.uniform(0.2, 1) * most_us + self.late.get((number, cycle), 0.0)
        self.hosts[number, cycle] = us
        return us

    def _sent(self, sort: str, number: int, cycle: int, us: float) -> list[Queued]:
        node: Node = self.nodes[number]
        pdos = node.command if sort == "request" else node.feedback
        self.left[sort, number, cycle] = self.left.get((sort, number, cycle), 0) + len(pdos)
        is_fd, extended = "data_bit_rate_kbit_s" in self.plan["bus"], self.plan["bus"].get("identifier_bits") == 29
        return [
            Queued(
                us,
                pdo.identifier,
                self.random.randbytes(padded(pdo.size)),
                extended,
                is_fd,
                True,
                f"{sort} {number}",
                cycle,
            )
            for pdo in pdos
        ]

    def _next(self, number: int, cycle: int, us: float) -> list[Queued]:
        """The next request that is due; each cycle begins at its time, or when the one before is over."""
        while cycle < self.cycles:
            while number < len(self.nodes):
                if self._is_due(number, cycle):
                    return self._sent("request", number, cycle, us + self._host(number, cycle))
                number += 1
            number, cycle = 0, cycle + 1
            us = max(us, cycle * self.period_us)
        return []

    def _answers(self, frame: Logged) -> Iterator[Queued]:
        sort, _, number = frame.queued.stream.partition(" ")
        if sort not in ("request", "answer"):
            return
        key = sort, int(number), frame.queued.number
        self.left[key] -= 1
        if self.left[key]:
            return
        pair, end_us = key[1:], frame.us + 3 * 1000 / self.plan["bus"]["bit_rate_kbit_s"]
        node = self.nodes[pair[0]]
        if sort == "answer":
            if self.polled and pair not in self.twice:
                yield from self._next(pair[0] + 1, pair[1], end_us)
            return
        if pair in self.lost:
            if self.polled:
                yield from self._next(pair[0] + 1, pair[1], end_us + 3 * (node.execution_us + node.extra_us) + 500)
            return
        self.own[pair] = node.execution_us + self.random.uniform(0, node.extra_us) + self.slow.get(pair, 0.0)
        queued_us = end_us + self.own[pair]
        if pair in self.twice:
            self.left["answer", *pair] = 0
            answers = self._sent("answer", *pair, queued_us)
            yield from answers
            yield from (answer._replace(us=queued_us, stream="again") for answer in answers)
            if self.polled:
                yield from self._next(pair[0] + 1, pair[1], queued_us + 2000)
            return
        yield from self._sent("answer", *pair, queued_us)

    def _messages(self) -> Iterator[Queued]:
        for message in self.plan.get("message", ()):
            us = self.random.uniform(0, message["period_us"])
            while us < self.cycles * self.period_us:
                data = self.random.randbytes(message["payload_bytes"])
                yield Queued(us, message["identifier"], data, stream=message["name"])
                us += message["period_us"]
