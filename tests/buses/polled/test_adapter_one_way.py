"""Nodes behind an adapter that are only read or only written, beside the event simulation."""

from collections.abc import Iterator
from fractions import Fraction
from random import Random

from tests.buses.polled.test_adapter import RandomBus, ends_us
from tests.oracles.adapter_simulation import Exchange
from tests.registers import at_least


class OneWayBus(RandomBus):
    """A random bus some of whose groups are only read or only written."""

    def __init__(self, rng: Random) -> None:
        super().__init__(rng)
        ways = {}
        for nodes, read, write in self.groups:
            is_read, is_written = rng.choice([(0, 1), (1, 0), (1, 1), (1, 1)])
            ways[read * is_read, write * is_written] = nodes
        self.groups = [(nodes, *sizes) for sizes, nodes in ways.items()]
        # Where a pause or a repeated request comes is another question.
        self.host = self.retries = 0

    def exchanges(self) -> list[Exchange]:
        wait = self.silence + self.delay + self.own
        return [*self._reads(wait), *([] if self.way == "exchange" else self._writes(wait))]

    def _reads(self, wait: Fraction) -> Iterator[Exchange]:
        groups, frames = self.groups, self.frames
        for nodes, read, write in groups:
            if self.way == "exchange" and not read:
                yield from [Exchange(frames.write[0] + write, [(wait, frames.write[1])])] * nodes
            elif self.way == "exchange" and not write:
                yield from [Exchange(frames.read[0], [(wait, frames.read[1] + read)])] * nodes
            elif read:
                self.groups = [(nodes, read, write)]
                yield from super()._reads(wait)
        self.groups = groups

    def _writes(self, wait: Fraction) -> Iterator[Exchange]:
        groups = self.groups
        for group in groups:
            self.groups = [group] if group[2] else []
            yield from super()._writes(wait)
        self.groups = groups


def test_a_cycle_with_nodes_of_one_way_is_never_outside_its_ends() -> None:
    for seed in range(at_least(75)):
        bus = OneWayBus(Random(seed))
        least_us, most_us = ends_us(bus.profile())
        assert least_us * (1 - 1e-9) <= bus.simulated_us() <= most_us * (1 + 1e-9), (seed, vars(bus))
