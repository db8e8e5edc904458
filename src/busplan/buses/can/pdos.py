"""A cycle with PDOs: what a cycle of SYNC shares with one of requests, and its waits for other messages."""

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial, reduce
from itertools import chain
from math import inf
from typing import ClassVar, Self

from busplan.buses.can.alone import CanCycle
from busplan.buses.can.equations import TERMS, CanFigures, bit_us, payload_us
from busplan.buses.can.latency import numbered
from busplan.buses.can.streams import frame_sizes, last_identifier, place, repeated, streams
from busplan.buses.can.traffic import LOOP, NAMES, REPEATED, Message, Pdos, Traffic
from busplan.buses.can.waiting import before_the_last, longest_cycle, sent_in
from busplan.buses.cycle import BusEvent, BusLatency, Doubt, Run, summed
from busplan.buses.limits import COVERAGE
from busplan.buses.network import Group, Rate
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import (
    FIT_ROUNDING,
    Number,
    choose,
    is_everywhere,
    is_off,
    larger,
    named,
    pointwise,
    rounded_up,
    square_root,
    total,
    within,
)
from busplan.sections.base import TRANSACTION_KINDS, TransactionKind
from busplan.sections.cycle import time_uncertainty_us


class PdoCycle(CanCycle):
    """A cycle of feedback and command PDOs, in which other messages come as late for the commands as they can."""

    record = CanFigures
    command_events = (("command", "command_frame"),)
    executions: ClassVar[tuple[TransactionKind, ...]]
    """Executions that the cycle waits for, one after the other."""
    blocked: ClassVar[str]
    """Frames of lower priorities, as a derivation writes them."""

    @property
    @abstractmethod
    def sync_us(self) -> Number:
        """SYNC; 0 without it [us]."""

    @abstractmethod
    def _wait_us(self, kind: TransactionKind, *, uncertainties: int = 0) -> Number:
        """Wait for nodes, with some standard uncertainties of each execution [us]."""

    @property
    @abstractmethod
    def _parts(self) -> tuple[tuple[Run, ...], ...]:
        """Parts of the cycle without other messages, the commands last."""

    @abstractmethod
    def _opened(self, blocking: BusEvent) -> Iterator[BusEvent | Run]:
        """Parts before the commands, and the frames of lower priorities."""

    @abstractmethod
    def _blocking_us(self, lasts_us: Number, others_us: Number, counts: Iterable[Number]) -> Number:
        """Frames of lower priorities in a cycle that lasts so long, with some counts of higher ones [us]."""

    @abstractmethod
    def _of_host_us(self, us: Number) -> Number:
        """A time of the host's own for each command, in the whole cycle [us]."""

    @abstractmethod
    def _of_adapter_us(self, us: Number) -> Number:
        """A time of the host's adapter for each wait of the program, in the whole cycle [us]."""

    def _adapter(self, of_cycle: Callable[[Number], Number]) -> tuple[BusEvent, BusEvent]:
        """The host's adapter from the wire to the program, and from the program to the wire."""
        bus = self.network.profile.bus

        def event(name: str, us: Number, way: str) -> BusEvent:
            return BusEvent("adapter", "cycle_adapter_us", of_cycle(us), way, rests_on=bus.adapter_key(name))

        return (
            event("host_read_us", bus.read_us, "adapter, from the wire to the program"),
            event("host_write_us", bus.write_us, "adapter, from the program to the wire"),
        )

    @property
    @abstractmethod
    def _pipeline(self) -> Number:
        """Cycles from the one that brings feedback to the one that takes the command computed from it [1]."""

    @property
    def waits_for_host(self) -> bool:
        """Whether the cycle contains the host's own time; of plain numbers."""
        return True

    @property
    def rates(self) -> tuple[Rate, ...]:
        """Rate of each group, counted from the same SYNC for all."""
        return tuple(Rate(int(group.every)) for group in self.network.groups)

    def at(self, number: int) -> Self:
        """The cycle with a number in the common multiple of the rates; all other messages are in it."""
        return type(self)(self.network, self.model, number)

    @cached_property
    def _groups(self) -> tuple[Group, ...]:
        """Groups whose PDOs are in the cycle."""
        if self.number is None:
            return self.network.groups
        groups = zip(self.network.groups, self.rates, strict=True)
        return tuple(group for group, rate in groups if rate.is_due(self.number))

    @cached_property
    def _due(self) -> frozenset[str] | None:
        """Names of these groups; None for the cycle of the verdict, which no other exceeds."""
        return None if self.number is None else frozenset(group.name for group in self._groups)

    @cached_property
    def _pdos(self) -> tuple[tuple[Pdos, Number], ...]:
        """All PDOs, each with the time of its frames [us]."""

        def time(pdos: Pdos) -> Number:
            us = payload_us(
                pdos.payload_bytes,
                frame_bytes=pdos.frame_bytes,
                identifier_bits=self.traffic.identifier_bits,
                bit_rate_kbit_s=self.traffic.bit_rate_kbit_s,
                data_bit_rate_kbit_s=self.traffic.data_bit_rate_kbit_s,
                late_bits=self.traffic.late_bits,
                is_stuffed=self.traffic.is_stuffed,
            )
            return named(us, f"{pdos.name}_us", f"PDO,{pdos.name}{pdos.group and f',{pdos.group}'}")

        return tuple((pdos, time(pdos)) for pdos in self.traffic.pdos)

    @cached_property
    def _before(self) -> tuple[tuple[Message, Number, Number], ...]:
        """Messages that may go before the last PDO, each with the time of its frame [us], and whether it does."""
        messages = ((message, us, self._goes_before_last(message)) for message, us in self.messages)
        before = tuple(message for message in messages if message[2] is not False)
        return before if is_off(self.traffic.error_burst) else (*before, (*self._repeated, True))

    @property
    def _repeated(self) -> tuple[Message, Number]:
        """Repeated frames, as a message that goes before all, and its time [us]."""
        traffic = self.traffic
        us = traffic.ask(
            lambda traffic: repeated(streams(traffic), traffic).frame_us, words="31 bits and the longest frame of all"
        )
        period_us = traffic.error_period_us
        message = Message(REPEATED, -1, 0, period_us, 0.0, period_us, burst=traffic.error_burst)
        return message, named(us, "repeated_us", "C,repeated")

    def _frames(self, kind: TransactionKind) -> Iterator[Run]:
        """PDOs of one direction, node by node; a timeline shows their frames."""
        name = NAMES[kind]
        for number, (pdos, us) in enumerate(pair for pair in self._pdos if pair[0].kind == kind):
            if self._due is None or pdos.group in self._due:
                event = BusEvent(f"{name}_frame", f"cycle_{name}_us", us, f"{name} PDO", transaction=name)
                yield Run((event,), pdos.number, number, partial(self._of_pdo, event, pdos))

    def _of_pdo(self, event: BusEvent, pdos: Pdos, _number: Number) -> Iterator[BusEvent]:
        return (event._replace(us=self.traffic.frame_us(size, self.traffic)) for size in frame_sizes(pdos))

    def written(self) -> Iterator[BusEvent | Run]:
        """The cycle node by node, with other messages as late for the commands as they can be."""
        blocking_us, counts = self._waits
        jitter_us, late = self.traffic.sync_jitter_us, "latest start of SYNC"
        yield BusEvent("jitter", "cycle_jitter_us", jitter_us, late, rests_on="bus.sync_jitter_us")
        yield from self._opened(BusEvent("blocking", "cycle_blocking_us", blocking_us, "messages of a lower priority"))
        for count, (message, us, _) in zip(counts, self._before, strict=True):
            label = "repeated frame" if message.name == REPEATED else f"message {message.name}"
            kind = "repeated" if message.name == REPEATED else "message"
            yield Run((BusEvent(kind, "cycle_interference_us", us, label),), count)
        yield from self._parts[-1]
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    @cached_property
    def _terms(self) -> dict[str, Number]:
        """Time of the terms without those of other messages [us]."""
        of_parts = "sync", "wait", "feedback", "adapter", "host", "command"
        keys = [f"cycle_{name}_us" for name in of_parts]
        return summed(chain.from_iterable(self._parts), keys)

    @cached_property
    def by_term(self) -> Mapping[str, Number]:
        """Time of each term, by its key [us]."""
        rest = (run for run in self.runs if not any(event.term in self._terms for event in run.events))
        return summed(rest, (figure.key for figure in TERMS)) | self._terms

    @cached_property
    def _on_bus_us(self) -> Number:
        """From SYNC to the end of the last command, without other messages [us]."""
        return total((self._terms | {"cycle_wait_us": self._wait_us("read")}).values())

    def _waits_us(self, extra_us: Number) -> Number:
        """Blocking and interference by other messages, where the rest of the cycle takes `extra_us` longer [us]."""
        blocking_us, counts = self._waits if is_off(extra_us) else self._waits_beside(self._on_bus_us + extra_us)
        return blocking_us + self._higher_us(counts)

    @property
    def _is_disturbed(self) -> bool:
        """Whether it may wait for other messages or for repeated frames."""
        return bool(self.messages or self._before)

    @cached_property
    def _waits(self) -> tuple[Number, tuple[Number, ...]]:
        return self._waits_beside(self._on_bus_us + 0.0)

    def _waits_beside(self, others_us: Number) -> tuple[Number, tuple[Number, ...]]:
        """Blocking [us], and the number of frames of each message that go before the last PDO [1]."""
        if not self._is_disturbed:
            return 0.0, ()
        others_us = named(others_us, "others_us", "others")

        words = (
            f"w = others + {self.blocked} + sum of ceil((w + J + bit) / T) C, the smallest one, or a bound at high load"
        )
        lasts_us = named(self._waited("lasts_us", others_us, words), "busy_us", "w")
        counts = tuple(self._higher(lasts_us))
        return self._blocking_us(lasts_us, others_us, counts), counts

    def _waited(self, key: str, others_us: Number, words: str) -> Number:
        """A figure of the cycle with other messages, by its name in `LongestCycle`."""

        def of(traffic: Traffic, others_us: Number) -> Number:
            number: Number = getattr(longest_cycle(traffic, others_us, self._due), key)
            return number

        return self.traffic.ask(of, others_us, words=words)

    def _higher_us(self, counts: Iterable[Number]) -> Number:
        """Time of the frames that go before the last PDO, by their number [us]."""
        return total(count * us for count, (_, us, _) in zip(counts, self._before, strict=True))

    def _higher(self, lasts_us: Number) -> Iterator[Number]:
        """Frames of each message that may go before the last PDO, in a span of time [1]."""
        window_us = lasts_us + bit_us(self.traffic.bit_rate_kbit_s)
        for message, _, goes_before in self._before:
            of_node = rounded_up((window_us + self._jitter_us(message)) / message.period_us)
            of_node = of_node if is_off(message.burst - 1) else of_node + message.burst - 1
            yield choose(goes_before, message.of_all(of_node), 0)

    def _jitter_us(self, message: Message) -> Number:
        """Latest arrival of a message at the frames of the cycle: from a queue, as late as that offers it [us]."""
        if not self.traffic.queues or message.name == REPEATED:
            return message.jitter_us

        words = f"how late {message.name} may come, or its queue offers it"
        return self.traffic.ask(lambda traffic: before_the_last(traffic, self._due, message.name)[1], words=words)

    def _goes_before_last(self, message: Message) -> Number:
        """Whether a message goes before the last of SYNC and all PDOs."""
        if self.traffic.queues:
            words = "the queue of SYNC or of a PDO may hold a larger identifier, and this goes before that"
            return self.traffic.ask(lambda traffic: before_the_last(traffic, self._due, message.name)[0], words=words)
        if message.identifier_bits is self.traffic.identifier_bits:
            return message.identifier <= self._last

        def is_before(*numbers: float) -> bool:
            identifier, bits, last, last_bits = map(int, numbers)
            return bool(place(identifier, bits) <= place(last, last_bits))

        numbers = message.identifier, message.identifier_bits, self._last, self.traffic.identifier_bits
        return pointwise(is_before, *numbers, words="the first 11 bits decide, then the base frame goes first")

    @cached_property
    def _last(self) -> Number:
        """The largest identifier of SYNC and all PDOs."""

        def last(traffic: Traffic) -> Number:
            cyclic = [stream for stream in streams(traffic) if not stream.is_message]
            identifier: Number = last_identifier(cyclic if self._due is None else sent_in(cyclic, self._due))
            return identifier

        identifier = self.traffic.ask(last, words="the largest identifier of SYNC and all PDOs")
        return named(identifier, "last_identifier", "id_last")

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:
        """Growth of the cycle if its nodes take longer: more messages may arrive, too [us]."""
        if not self._is_disturbed:
            return extra_us
        return extra_us + self._waits_us(after_us + extra_us) - self._waits_us(after_us)

    def possible_us(self) -> Number:
        """Part of the cycle that only queues add which are not by priority [us]."""
        if not self.traffic.queues:
            return 0.0
        return larger(self.required_us - self.of(replace(self.traffic, queues=frozenset())).required_us, 0.0)

    def doubts(self) -> tuple[Doubt, ...]:
        """Execution times and longer FD frames, by half of what they change; the host's own time and its adapter's."""
        swing_us = total((self._wait_us(kind, uncertainties=2) - self._wait_us(kind)) / 2 for kind in self.executions)
        key = "node.execution" if self.network.is_uniform else "group.execution"
        bus = self.network.profile.bus
        doubts = (
            Doubt(key, "execution time", swing_us),
            Doubt("bus.host_us", "the host's own time", self._of_host_us(bus.host_doubt_us)),
            *(
                Doubt(bus.adapter_key(name), label, self._of_adapter_us(time_uncertainty_us(us, is_guess=False)))
                for name, label, us in (
                    ("host_write_us", "the adapter's time to the wire", bus.write_us),
                    ("host_read_us", "the adapter's time to the program", bus.read_us),
                )
                if not is_off(us)
            ),
        )
        if self.traffic.longest is self.traffic:
            return doubts
        late_us = (self.of(self.traffic.longest).required_us - self.required_us) / 2
        key = "bus.clock_tolerance" if self.network.profile.bus.clock_tolerance else "fd_late_bits"
        return *doubts, Doubt(key, "clocks that are not exact, and long FD frames", late_us)

    @cached_property
    def load(self) -> Number:
        """Share of the bus that everything takes, 0..1 [1]."""
        return self._mean_us / self.traffic.period_us + self.messages_load

    @property
    def fullest_load(self) -> Number:
        """Share of the bus that everything takes with all PDOs in every cycle, 0..1 [1]."""
        return self._in_cycle_us / self.traffic.period_us + self.messages_load

    @property
    def _in_cycle_us(self) -> Number:
        """SYNC and PDOs of the cycle [us]."""
        return self.sync_us + self._terms["cycle_feedback_us"] + self._terms["cycle_command_us"]

    @property
    def _mean_us(self) -> Number:
        """SYNC and PDOs of the mean cycle [us]."""
        if not self.traffic.has_rates:
            return self._in_cycle_us
        return self.sync_us + total(pdos.number * us / pdos.every for pdos, us in self._pdos)

    @property
    def load_period_us(self) -> Number:
        """The shortest period that keeps `limits.max_load`; infinite where the other messages take all of it [us]."""
        left = self.network.profile.most_load - self.messages_load
        return choose(left > 0, self._mean_us / larger(left, FIT_ROUNDING), inf)

    def first_late(self) -> str:
        """The first message, or the cycle, that is late, or not shown to be in time; empty without one."""
        if late := super().first_late():
            return late
        doubt_us = COVERAGE * square_root(total(doubt.us * doubt.us for doubt in self.doubts()))
        slice_us = time_slice_us(self.network.period_us, slice_ratio=self.network.slice_ratio, nodes=1)
        return "" if within(self.required_us + self.added_us(doubt_us), slice_us) else "the cycle"

    @property
    def ends(self) -> tuple[tuple[str, str], ...]:
        """Name and group of the last PDO of each group in each direction."""
        return tuple(
            (pdos.name, pdos.group) for pdos in self.traffic.pdos if not is_everywhere(pdos.payload_bytes <= 0)
        )

    def latencies(self) -> tuple[BusLatency, ...]:
        """The worst-case responses, and the way from SYNC to the last executed command."""
        answers = super().latencies()
        is_closed = all(any(group.has(kind) for group in self.network.groups) for kind in TRANSACTION_KINDS)
        if not is_closed or any(answer.name == LOOP for answer in answers):
            return answers
        return *answers, BusLatency(LOOP, None, self._loop())

    @cached_property
    def _loop_us(self) -> dict[str, Number]:
        """Parts of a loop over the host without whole cycles and the wait for SYNC [us]."""
        us = self.by_term
        return {
            "jitter_us": us["cycle_jitter_us"],
            "blocking_us": us["cycle_blocking_us"],
            "interference_us": us["cycle_interference_us"],
            "backlog_us": 0.0,
            "frame_us": self._in_cycle_us,
            "execution_us": us["cycle_wait_us"] + self.traffic.host_us,
            "adapter_us": us["cycle_adapter_us"] + self.traffic.lag_us,
        }

    def _loop(self) -> dict[str, Number]:
        """Parts of the way from the instant of SYNC to the last executed command that rests on it, or to its SYNC."""
        pipeline_us, wait_us = self._pipeline_cycles * self.network.period_us, 0.0
        if self.takes_at_sync:
            late_us = self.network.period_us * self._late_cycles
            due_us = self.network.period_us if is_off(late_us) else self.network.period_us + late_us
            wait_us = named(larger(due_us - total(self._loop_us.values()), 0.0), "sync_wait_us", "wait")
        parts_us = self._loop_us | {"pipeline_us": pipeline_us, "sync_wait_us": wait_us}
        return numbered(parts_us, identifier=inf, data_bytes=inf, instance=inf, deadline_us=inf)

    @property
    def _late_cycles(self) -> Number:
        """Cycles by which commands miss their SYNC for the adapter's time beside the cycle [1]."""
        if is_off(self.traffic.lag_us):
            return 0
        return larger(rounded_up(total(self._loop_us.values()) / self.network.period_us), 1) - 1

    def host_lag_us(self) -> float:
        """The adapter's time that is in no cycle, for the host computes in cycles of its own [us]."""
        return self.traffic.lag_us

    @property
    def _pipeline_cycles(self) -> Number:
        """Cycles from the one that brings feedback to the one that takes its commands, of the slowest group [1]."""
        cycles = self._pipeline
        if not self.traffic.has_rates:
            return cycles
        due: Iterator[Number] = (rounded_up(cycles / pdos.every) * pdos.every for pdos in self.traffic.pdos)
        return reduce(larger, due)

    def loop_periods(self, *, at_sync: bool) -> int:
        """The host's pipeline, and the periods to the next SYNC."""
        late = int(self._late_cycles) if at_sync else 0
        return super().loop_periods(at_sync=at_sync) + int(self._pipeline) + late
