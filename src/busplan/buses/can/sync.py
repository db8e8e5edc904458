"""A cycle of SYNC: SYNC, feedback of all nodes, commands to all nodes."""

from collections.abc import Iterable, Iterator
from functools import cached_property, reduce
from math import inf

from busplan.buses.can.alone import PREMISES
from busplan.buses.can.pdos import PdoCycle
from busplan.buses.can.traffic import SYNC, Traffic
from busplan.buses.can.waiting import longest_cycle, sync_response
from busplan.buses.cycle import BusEvent, Run
from busplan.buses.network import Group
from busplan.elementwise import Number, choose, is_off, larger
from busplan.sections.base import TRANSACTION_KINDS, TransactionKind


class SyncCycle(PdoCycle):
    """SYNC's jitter, SYNC, the wait for the slowest node, feedback PDOs, the host, command PDOs, and the window.

    All nodes execute at once: feedback waits for the slowest of them, and so does the next SYNC behind the commands.
    The host's adapter comes before and behind the host. It holds up SYNC, too, each by the same time: what it varies by
    is SYNC's jitter. Before SYNC, the last feedback and the commands a frame of a lower priority may be on the wire;
    frames of higher priorities go whenever they are queued.
    """

    premises = PREMISES
    executions = TRANSACTION_KINDS
    blocked = "3 B"

    @property
    def waits_for_host(self) -> bool:
        """Whether the host computes within the cycle."""
        return not self.network.profile.bus.pipeline_cycles

    @cached_property
    def sync_us(self) -> Number:
        """SYNC [us]."""
        return self.traffic.frame_us(self.traffic.sync_bytes, self.traffic)

    def _wait_us(self, kind: TransactionKind, *, uncertainties: int = 0) -> Number:
        """The slowest execution of any node, with some standard uncertainties of each [us]."""
        if not self._groups:
            return 0.0
        return reduce(larger, (_execution_us(group, kind, uncertainties) for group in self._groups))

    @cached_property
    def _parts(self) -> tuple[tuple[Run, ...], ...]:
        """SYNC and the wait for feedback; feedback and the host; commands and the wait for their execution."""
        sync = BusEvent("sync", "cycle_sync_us", self.sync_us, "SYNC")
        ready = BusEvent("wait", "cycle_wait_us", self._wait_us("read"), "wait for the slowest feedback")
        host_us = self.traffic.host_us if self._groups else 0.0
        host = BusEvent("host", "cycle_host_us", host_us, "host", rests_on="bus.host_us")
        read, write = self._adapter(self._of_adapter_us if self._groups else lambda _: 0.0)
        executed_us = self._wait_us("write")
        executed = BusEvent("wait", "cycle_wait_us", executed_us, "wait for the slowest execution of a command")
        return (
            (Run((sync,)), Run((ready,))),
            (*self._frames("read"), Run((read, host, write))),
            (*self._frames("write"), Run((executed,))),
        )

    def _opened(self, blocking: BusEvent) -> Iterator[BusEvent | Run]:
        opening, feedback, _ = self._parts
        yield Run((blocking,), laid_out=lambda _: self._blocks(blocking, 0, 1))
        yield from opening
        yield Run((), laid_out=lambda _: self._blocks(blocking, 1, 2))
        yield from feedback
        yield Run((), laid_out=lambda _: self._blocks(blocking, 2, None))

    def _blocks(self, blocking: BusEvent, first: int, end: int | None) -> Iterator[BusEvent]:
        """Some of the frames of lower priorities: before SYNC, before the feedback, or behind it."""
        waited = longest_cycle(self.traffic, self._on_bus_us, self._due)
        for message in waited.blocks()[first:end]:
            yield blocking._replace(us=message.frame_us, label=f"message {message.name} of a lower priority")

    def _blocking_us(self, lasts_us: Number, others_us: Number, counts: Iterable[Number]) -> Number:  # noqa: ARG002
        words = "the 3 longest frames of a lower priority that can be there in w"
        return self._waited("blocking_us", others_us, words)

    def _of_host_us(self, us: Number) -> Number:
        return 0.0 if is_off(us) else choose(self._pipeline > 0, 0.0, us)

    _of_adapter_us = _of_host_us

    @property
    def _pipeline(self) -> Number:
        cycles: Number = self.network.profile.bus.pipeline_cycles
        return cycles

    @property
    def ends(self) -> tuple[tuple[str, str], ...]:
        """SYNC, and name and group of the last PDO of each group in each direction."""
        return (SYNC, ""), *super().ends

    def sync_jitter_us(self) -> Number:
        """Half of SYNC's jitter and of what may hold it up; infinite without an end [us]."""

        def held_up_us(traffic: Traffic) -> Number:
            worst = sync_response(traffic)
            return choose(worst.us < inf, worst.blocking_us + worst.interference_us, inf)

        held_us = self.traffic.ask(held_up_us, words="frames before SYNC, B + I")
        return (self.traffic.sync_jitter_us + held_us) / 2


def _execution_us(group: Group, kind: TransactionKind, uncertainties: int) -> Number:
    """The slowest execution of a group's nodes, with some standard uncertainties [us]."""
    doubt_us = group.read_uncertainty_us if kind == "read" else group.write_uncertainty_us
    slowest_us = group.slowest_us(kind)
    return slowest_us + uncertainties * doubt_us if uncertainties else slowest_us
