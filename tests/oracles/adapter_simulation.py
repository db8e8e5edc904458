"""An event simulation of serial nodes behind a USB adapter, that shares no code with busplan.

The host blocks: it sends a request, and goes on when it has every byte of the answers. The adapter gathers bytes. It
sends them when a packet is full, and when its timer ends, which runs from the last packet, data or not. The host takes
a packet at the next USB frame. Times are in us, as exact fractions.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

Time = Fraction


class Adapter:
    """An adapter whose timer and frames have some phase at the start."""

    def __init__(self, timer: Time, packet_bytes: int, frame: Time, *, timer_phase: Time, frame_phase: Time) -> None:
        self.timer, self.packet_bytes, self.frame, self.frame_phase = timer, packet_bytes, frame, frame_phase
        self.ends = timer_phase
        self.held = 0
        self.taken = Fraction(0)
        """When the host took the last packet."""

    def _send(self, now: Time) -> None:
        self.held = 0
        self.ends = now + self.timer
        wait = (self.frame_phase - now) % self.frame if self.frame else Fraction(0)
        self.taken = now + wait

    def _pass(self, until: Time) -> None:
        """Let the timer end as often as it does before a moment."""
        while self.timer and self.ends < until:
            if not self.held:
                # Packets without data, one after another.
                self.ends += self.timer * max(1, (until - self.ends) // self.timer)
                continue
            self._send(self.ends)

    def byte(self, now: Time) -> None:
        """A byte comes from the wire."""
        self._pass(now)
        self.held += 1
        if self.held == self.packet_bytes or not self.timer:
            self._send(now)

    def all_taken(self, now: Time) -> Time:
        """When the host has every byte that came until now."""
        if self.held:
            self._pass(self.ends + self.timer / 2)
        return max(self.taken, now)


class Exchange(NamedTuple):
    """A request and the answers to it: a wait of a node, and the bytes of its answer."""

    request_bytes: int
    answers: Sequence[tuple[Time, int]] = ()
    pause: Time = Fraction(0)
    """Pause of the host before it."""


def cycle_us(exchanges: Sequence[Exchange], adapter: Adapter, *, start: Time, byte: Time, silence: Time) -> Time:
    """Time of some exchanges, one after another, which a silence of the host ends."""
    now = start
    for exchange in exchanges:
        now += exchange.pause + exchange.request_bytes * byte
        for wait, size in exchange.answers:
            now += wait
            for _ in range(size):
                now += byte
                adapter.byte(now)
        if exchange.answers:
            now = adapter.all_taken(now)
        now += silence
    return now - start


def shares(size: int, requests: int) -> Iterator[int]:
    """Bytes of each request that has a share of some bytes."""
    return (size // requests + (number < size % requests) for number in range(requests))
