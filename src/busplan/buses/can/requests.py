"""A cycle of requests and answers: no SYNC, the host sends a command to each node, which answers with its feedback."""

from collections.abc import Iterable, Iterator
from functools import cached_property, partial
from itertools import chain

from busplan.buses.can.alone import OF_SYNC, PREMISES
from busplan.buses.can.pdos import PdoCycle
from busplan.buses.can.traffic import NAMES, answer_us
from busplan.buses.cycle import BusEvent, Run
from busplan.elementwise import Number, larger
from busplan.sections.base import TRANSACTION_KINDS, TransactionKind


class RequestCycle(PdoCycle):
    """Requests and answers: one node after another (polled), or all commands at once (burst), and the window.

    The host's adapter is in each request and answer; of commands at once, before the first and behind the last answer.
    The last answer to commands at once comes no later than all frames and the slowest node together.
    """

    premises = tuple(premise for premise in PREMISES if premise.key not in OF_SYNC)
    # A node answers when it has executed, read and write side by side.
    executions = TRANSACTION_KINDS[:1]
    blocked = "blocking"

    @property
    def _is_burst(self) -> bool:
        """Whether the host sends all commands at once."""
        return self.traffic.access == "burst"

    @property
    def takes_at_sync(self) -> bool:
        """No: there is no SYNC to wait for."""
        return False

    @property
    def sync_us(self) -> Number:
        """No SYNC [us]."""
        return 0.0

    def _wait_us(self, kind: TransactionKind, *, uncertainties: int = 0) -> Number:  # noqa: ARG002 - both side by side
        """Wait for all nodes one by one, or for the slowest, with some standard uncertainties of each [us]."""
        if not self._groups:
            return 0.0
        return answer_us(self._groups, access=self.traffic.access, uncertainties=uncertainties)

    @cached_property
    def _parts(self) -> tuple[tuple[Run, ...], ...]:
        """All requests and answers."""
        return (tuple(self._requests()),)

    def _requests(self) -> Iterator[Run]:
        """Requests and answers; requests at once all go before the first answer, as the bound has it."""
        host = BusEvent("host", "cycle_host_us", self.network.profile.bus.host_us, "host", rests_on="bus.host_us")
        read, write = self._adapter(lambda us: us)
        wait = BusEvent("wait", "cycle_wait_us", self._wait_us("read"), "wait for the slowest answer")
        commands, answers = [*self._frames("write")], [*self._frames("read")]
        if self._is_burst:
            yield from (
                Run((host,), self.traffic.requests),
                Run((write,)),
                *commands,
                Run((wait,)),
                *answers,
                Run((read,)),
            )
            return
        for group, command, answer in zip(self._groups, commands, answers, strict=True):
            us = answer_us([group], access="burst")
            executes = wait._replace(us=us, label="wait for the answer", transaction=NAMES["read"])
            parts = (host, write), command, (executes,), answer, (read,)
            events = chain.from_iterable(part.events if isinstance(part, Run) else part for part in parts)
            yield command._replace(events=tuple(events), laid_out=partial(self._of_request, parts))

    @staticmethod
    def _of_request(parts: Iterable[Run | tuple[BusEvent, ...]], number: Number) -> Iterator[BusEvent]:
        """The frames of a request and of its answer, with the times between them."""
        for part in parts:
            if not isinstance(part, Run):
                yield from part
            elif part.laid_out:
                yield from part.laid_out(number)

    def _opened(self, blocking: BusEvent) -> Iterator[BusEvent | Run]:
        yield blocking

    def _blocking_us(self, lasts_us: Number, others_us: Number, counts: Iterable[Number]) -> Number:
        return larger(lasts_us - others_us - self._higher_us(counts), 0.0)

    def possible_us(self) -> Number:
        """Part of the cycle that only queues add which are not by priority, or times that a burst may hide [us]."""
        if self._is_burst:
            return self._terms["cycle_wait_us"] + self._terms["cycle_host_us"]
        return super().possible_us()

    def _of_host_us(self, us: Number) -> Number:
        return self.traffic.requests * us

    def _of_adapter_us(self, us: Number) -> Number:
        return us if self._is_burst else self.traffic.requests * us

    @property
    def _pipeline(self) -> Number:
        # A command goes before the feedback of its cycle.
        return larger(self.network.profile.bus.pipeline_cycles, 1)
