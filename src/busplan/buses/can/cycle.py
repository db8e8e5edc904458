"""The cycle, of SYNC or of requests and answers, with the waits for other messages."""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial, reduce
from itertools import chain
from math import inf
from typing import Final, Literal

from busplan.buses.can.equations import BUS_LOAD, TERMS, bit_us, c, payload_us
from busplan.buses.can.frames import (
    LOOP,
    NAMES,
    NO_DEADLINE_US,
    NOT_BY_PRIORITY,
    REPEATED,
    SYNC,
    Message,
    Pdos,
    Stream,
    Traffic,
    answer_us,
    frame_sizes,
    last_identifier,
    place,
    repeated,
    streams,
    traffic_of,
)
from busplan.buses.can.waiting import (
    before_the_last,
    counted,
    last_in_queue,
    message_responses,
    responses,
    sent_in,
    sync_response,
    waits,
)
from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, Doubt, Premise, Run, summed
from busplan.buses.figure import NONPERIODIC
from busplan.buses.limits import COVERAGE, EventKind
from busplan.buses.network import Group, Network, Rate
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import (
    FIT_ROUNDING,
    Number,
    Traced,
    choose,
    is_off,
    larger,
    named,
    pointwise,
    rounded_up,
    square_root,
    total,
    value_of,
    within,
)
from busplan.english import first_of, plural
from busplan.sections.base import MAX_TIME_US, TRANSACTION_KINDS, TransactionKind

TimingModelName = Literal["worst-stuffing", "no-stuffing"]
WORST: Final[TimingModelName] = "worst-stuffing"
NONE: Final[TimingModelName] = "no-stuffing"


_DAVIS: Final = BUS_LOAD.reference
_QUEUES: Final = "Davis 2011, 2012"
"""Of the response in a queue that is not by priority: Davis, Kollmann, Pollex, Slomka 2011; Davis, Navet 2012."""
EVENTS: Final = (
    EventKind("jitter", "SYNC's jitter", "profile", "j", "contention"),
    EventKind("sync", "SYNC", _DAVIS, "S", "sync"),
    EventKind("wait", "wait for nodes", "profile", "=", "work"),
    EventKind("feedback_frame", "feedback PDO", _DAVIS, "<", "in"),
    EventKind("command_frame", "command PDO", _DAVIS, ">", "out"),
    EventKind("host", "host", "profile", "h", "idle"),
    EventKind("blocking", "lower-priority frame", _DAVIS, "b", "gap"),
    EventKind("message", "higher-priority frame", _DAVIS, "m", "contention"),
    EventKind("repeated", "repeated frame", "Tindell 1994", "r", "contention"),
    EventKind("nonperiodic", "non-periodic window", NONPERIODIC.reference, "N", "reserve"),
)
"""Kinds of events, in the order of the cycle."""
STRETCHES: Final = (
    EventKind("feedback", "feedback", "", "F", "in"),
    EventKind("command", "command", "", "C", "out"),
)
"""Stretches that several events make together."""


PREMISES: Final = (
    Premise("bus.error_period_us", "no repeated frames", 10_000.0),
    Premise("bus.queue", "priority queues", "fifo"),
    Premise("node.queue", "priority queues", "fifo", lambda cycle: cycle.network.profile.bus.queue is None),
    Premise("bus.sync_jitter_us", "SYNC without jitter", 50.0, lambda cycle: cycle.traffic.has_sync),
    Premise("bus.clock_tolerance", "exact clocks", 1e-4),
    Premise("bus.host_us", "an instant host", 100.0, lambda cycle: cycle.waits_for_host),
    Premise("bus.sync_counter", "SYNC without counter", True, lambda cycle: cycle.traffic.has_sync),
    Premise("bus.sync_identifier", "SYNC by its usual identifier", 0x700, lambda cycle: cycle.traffic.has_sync),
    Premise("bus.pipeline_cycles", "commands one cycle later", 2, lambda cycle: cycle.traffic.has_cycle),
    Premise("message", "no other messages"),
    Premise("message.jitter_us", "messages without jitter", 100.0),
)


class CanCycle(BusCycle):
    """SYNC's jitter, SYNC, the wait for the slowest node, feedback PDOs, the host, command PDOs, and the window.

    A network of messages alone has no cycle: then no term takes time, and only loads and response times are there.

    All nodes execute at once: feedback waits for the slowest of them, and so does the next SYNC behind the commands.
    Before SYNC, the last feedback and the commands a frame of a lower priority may be on the wire; frames of higher
    priorities go whenever they are queued.

    Without SYNC the host sends a command to each node, which answers it with its feedback: one node after another, or
    all commands at once, whose last answer comes no later than all frames and the slowest node together.
    """

    term_figures = TERMS
    premises = PREMISES
    command_events = (("command", "command_frame"),)

    def __init__(
        self, network: Network, model: str, number: int | None = None, *, traffic: Traffic | None = None
    ) -> None:
        self.network = network
        self.model = model
        self.number = number
        traffic = traffic or traffic_of(network)
        self.traffic = traffic if model == WORST else replace(traffic, is_stuffed=False)
        """SYNC, PDOs and other messages, by default the network's; their frames as long as in the timing model."""

    @property
    def rates(self) -> tuple[Rate, ...]:
        """The rate of each group; all count from the same SYNC."""
        return tuple(Rate(int(group.every)) for group in self.network.groups)

    def at(self, number: int) -> "CanCycle":
        """A cycle of the common multiple of the rates; other messages are all there."""
        return CanCycle(self.network, self.model, number)

    @cached_property
    def _groups(self) -> tuple[Group, ...]:
        """Groups whose PDOs are in it."""
        if self.number is None:
            return self.network.groups
        groups = zip(self.network.groups, self.rates, strict=True)
        return tuple(group for group, rate in groups if rate.is_due(self.number))

    @cached_property
    def _due(self) -> frozenset[str] | None:
        """Their names; None for the cycle that the verdict is for, which no other exceeds."""
        return None if self.number is None else frozenset(group.name for group in self._groups)

    def _frame_us(self, data_bytes: Number, form: Traffic | Message | None = None) -> Number:
        """Time of a frame of the cycle, or of a message [us]."""
        return self.traffic.frame_us(data_bytes, form or self.traffic)

    @cached_property
    def _pdos(self) -> tuple[tuple[Pdos, Number], ...]:
        """All PDOs, each with its time."""

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
    def _messages(self) -> tuple[tuple[Message, Number], ...]:
        """All other messages, each with the time of its frame."""
        return tuple(
            (message, named(self._frame_us(message.payload_bytes, message), f"{message.name}_us", f"C,{message.name}"))
            for message in self.traffic.messages
        )

    @cached_property
    def _before(self) -> tuple[tuple[Message, Number, Number], ...]:
        """Messages that may go before the last PDO, each with the time of its frame, and whether it does."""
        messages = ((message, us, self._goes_before_last(message)) for message, us in self._messages)
        before = tuple(message for message in messages if message[2] is not False)
        return before if is_off(self.traffic.error_burst) else (*before, (*self._repeated, True))

    @property
    def _repeated(self) -> tuple[Message, Number]:
        """What errors cost the cycle, as a message that goes before all, and its time."""
        traffic = self.traffic
        us = traffic.ask(
            lambda traffic: repeated(streams(traffic), traffic).frame_us, words="31 bits and the longest frame of all"
        )
        period_us = traffic.error_period_us
        message = Message(REPEATED, -1, 0, period_us, 0.0, period_us, burst=traffic.error_burst)
        return message, named(us, "repeated_us", "C,repeated")

    @cached_property
    def sync_us(self) -> Number:
        """SYNC; 0 without it [us]."""
        return self._frame_us(self.traffic.sync_bytes) if self.traffic.has_sync else 0.0

    def _wait_us(self, kind: TransactionKind, *, uncertainties: int = 0) -> Number:
        """The slowest execution of any node, with some standard uncertainties of each [us]."""
        if not self._groups:
            return 0.0
        if not self.traffic.has_sync:
            return answer_us(self._groups, access=self.traffic.access, uncertainties=uncertainties)
        return reduce(larger, (_execution_us(group, kind, uncertainties) for group in self._groups))

    def _frames(self, kind: TransactionKind) -> Iterator[Run]:
        """All PDOs of one direction, node by node; a timeline shows their frames."""
        name = NAMES[kind]
        for number, (pdos, us) in enumerate(pair for pair in self._pdos if pair[0].kind == kind):
            if self._due is None or pdos.group in self._due:
                event = BusEvent(f"{name}_frame", f"cycle_{name}_us", us, f"{name} PDO", transaction=name)
                yield Run((event,), pdos.pdos, number, partial(self._of_pdo, event, pdos))

    def _of_pdo(self, event: BusEvent, pdos: Pdos, _number: Number) -> Iterator[BusEvent]:
        return (event._replace(us=self._frame_us(size)) for size in frame_sizes(pdos))

    def _requests(self) -> Iterator[Run]:
        """Requests and answers without SYNC; all at once go before the first answer, as the bound has it."""
        host = BusEvent("host", "cycle_host_us", self.network.profile.bus.host_us, "host", rests_on="bus.host_us")
        wait = BusEvent("wait", "cycle_wait_us", self._wait_us("read"), "wait for the slowest answer")
        commands, answers = [*self._frames("write")], [*self._frames("read")]
        if self.traffic.access == "burst":
            yield from (Run((host,), self.traffic.requests), *commands, Run((wait,)), *answers)
            return
        for group, command, answer in zip(self._groups, commands, answers, strict=True):
            us = answer_us([group], access="burst")
            executes = wait._replace(us=us, label="wait for the answer", transaction=NAMES["read"])
            events = (host, *command.events, executes, *answer.events)
            yield command._replace(events=events, laid_out=partial(self._of_request, host, command, executes, answer))

    @staticmethod
    def _of_request(host: BusEvent, command: Run, wait: BusEvent, answer: Run, number: Number) -> Iterator[BusEvent]:
        """The frames of a request and of its answer."""
        for before, run in ((host, command), (wait, answer)):
            yield before
            if run.laid_out:
                yield from run.laid_out(number)

    @cached_property
    def _parts(self) -> tuple[tuple[Run, ...], ...]:
        """SYNC and the wait for feedback; feedback and the host; commands and the wait for their execution."""
        if not self.traffic.has_sync:
            return (tuple(self._requests()),)
        sync = BusEvent("sync", "cycle_sync_us", self.sync_us, "SYNC")
        ready = BusEvent("wait", "cycle_wait_us", self._wait_us("read"), "wait for the slowest feedback")
        host_us = self.traffic.host_us if self._groups else 0.0
        host = BusEvent("host", "cycle_host_us", host_us, "host", rests_on="bus.host_us")
        executed_us = self._wait_us("write")
        executed = BusEvent("wait", "cycle_wait_us", executed_us, "wait for the slowest execution of a command")
        return (
            (Run((sync,)), Run((ready,))),
            (*self._frames("read"), Run((host,))),
            (*self._frames("write"), Run((executed,))),
        )

    def written(self) -> Iterator[BusEvent | Run]:
        """The cycle node by node, with other messages as late for the commands as they can be."""
        if not self.traffic.has_cycle:
            return
        *before, commands = self._parts
        blocking_us, counts = self._waits
        blocking = BusEvent("blocking", "cycle_blocking_us", blocking_us, "messages of a lower priority")
        jitter_us, late = self.traffic.sync_jitter_us, "latest start of SYNC"
        yield BusEvent("jitter", "cycle_jitter_us", jitter_us, late, rests_on="bus.sync_jitter_us")
        if self.traffic.has_sync:
            opening, feedback = before
            yield Run((blocking,), laid_out=lambda _: self._blocks(blocking, 0, 1))
            yield from opening
            yield Run((), laid_out=lambda _: self._blocks(blocking, 1, 2))
            yield from feedback
            yield Run((), laid_out=lambda _: self._blocks(blocking, 2, None))
        else:
            yield blocking
        for count, (message, us, _) in zip(counts, self._before, strict=True):
            label = "repeated frame" if message.name == REPEATED else f"message {message.name}"
            kind = "repeated" if message.name == REPEATED else "message"
            yield Run((BusEvent(kind, "cycle_interference_us", us, label),), count)
        yield from commands
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    def _blocks(self, blocking: BusEvent, first: int, end: int | None) -> Iterator[BusEvent]:
        """Some of the frames of lower priorities: before SYNC, before the feedback, or behind it."""
        waited = waits(self.traffic, self._on_bus_us, self._due)
        for message in waited.blocks()[first:end]:
            yield blocking._replace(us=message.frame_us, label=f"message {message.name} of a lower priority")

    @cached_property
    def _terms(self) -> dict[str, Number]:
        """Time of the terms without those of other messages [us]."""
        keys = ("cycle_sync_us", "cycle_wait_us", "cycle_feedback_us", "cycle_host_us", "cycle_command_us")
        if not self.traffic.has_cycle:
            return dict.fromkeys(keys, 0.0)
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
        """Blocking by frames of lower priorities, and interference by those of higher ones [us].

        Parameters
        ----------
        extra_us
            By how much the rest takes longer [us].
        """
        blocking_us, counts = self._waits if is_off(extra_us) else self._waits_beside(self._on_bus_us + extra_us)
        return blocking_us + self._higher_us(counts)

    @property
    def _is_disturbed(self) -> bool:
        """Whether it may wait for other messages or for repeated frames."""
        return bool(self._messages or self._before)

    @cached_property
    def _waits(self) -> tuple[Number, tuple[Number, ...]]:
        return self._waits_beside(self._on_bus_us + 0.0)

    def _waits_beside(self, others_us: Number) -> tuple[Number, tuple[Number, ...]]:
        """Blocking [us], and how many frames of each message go before the last PDO [1]."""
        if not self._is_disturbed:
            return 0.0, ()
        others_us = named(others_us, "others_us", "others")

        def figure(key: str, words: str) -> Number:
            def of(traffic: Traffic, others_us: Number) -> Number:
                number: Number = getattr(waits(traffic, others_us, self._due), key)
                return number

            return self.traffic.ask(of, others_us, words=words)

        blocked = "3 B" if self.traffic.has_sync else "blocking"
        words = f"w = others + {blocked} + sum of ceil((w + J + bit) / T) C, the smallest one, or a bound at high load"
        lasts_us = named(figure("lasts_us", words), "busy_us", "w")
        counts = tuple(self._higher(lasts_us))
        if not self.traffic.has_sync:
            return larger(lasts_us - others_us - self._higher_us(counts), 0.0), counts
        return figure("blocking_us", "the 3 longest frames of a lower priority that can be there in w"), counts

    def _higher_us(self, counts: Iterable[Number]) -> Number:
        """Time of the frames that go before the last PDO, by their number [us]."""
        return total(count * us for count, (_, us, _) in zip(counts, self._before, strict=True))

    def _higher(self, lasts_us: Number) -> Iterator[Number]:
        """Frames of each message that may go before the last PDO, in a span of time [1]."""
        window_us = lasts_us + bit_us(self.traffic.bit_rate_kbit_s)
        for message, _, goes_before in self._before:
            of_node = rounded_up((window_us + self._jitter_us(message)) / message.period_us)
            of_node = of_node if is_off(message.burst - 1) else of_node + message.burst - 1
            yield choose(goes_before, _of_all(message, of_node), 0)

    def _jitter_us(self, message: Message) -> Number:
        """How late a message comes to the frames of the cycle; from a queue, as late as that offers it [us]."""
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
        if not self._is_disturbed or not self.traffic.has_cycle:
            return extra_us
        return extra_us + self._waits_us(after_us + extra_us) - self._waits_us(after_us)

    def possible_us(self) -> Number:
        """What the bound adds to what is surely needed [us].

        It is what queues add that are not by priority, and the times of a burst that its frames may hide.
        """
        if self.traffic.access == "burst":
            return self._terms["cycle_wait_us"] + self._terms["cycle_host_us"]
        if not self.traffic.queues:
            return 0.0
        return larger(self.required_us - self._of(replace(self.traffic, queues=frozenset())).required_us, 0.0)

    def _of(self, traffic: Traffic) -> "CanCycle":
        """The same cycle with other traffic."""
        return CanCycle(self.network, self.model, self.number, traffic=traffic)

    @property
    def waits_for_host(self) -> bool:
        """Whether the cycle contains the host's own time; of plain numbers."""
        return self.traffic.has_cycle and not (self.traffic.has_sync and self.network.profile.bus.pipeline_cycles)

    def doubts(self) -> tuple[Doubt, ...]:
        """The execution time and longer FD frames, by half of what they change; and the host's own time."""
        if not self.traffic.has_cycle:
            return ()
        kinds = TRANSACTION_KINDS if self.traffic.has_sync else TRANSACTION_KINDS[:1]
        swing_us = total((self._wait_us(kind, uncertainties=2) - self._wait_us(kind)) / 2 for kind in kinds)
        key = "node.execution" if self.network.is_uniform else "group.execution"
        bus = self.network.profile.bus
        once_us = choose(bus.pipeline_cycles > 0, 0.0, bus.host_doubt_us)
        host_us = once_us if self.traffic.has_sync else self.traffic.requests * bus.host_doubt_us
        doubts = Doubt(key, "execution time", swing_us), Doubt("bus.host_us", "the host's own time", host_us)
        if self.traffic.longest is self.traffic:
            return doubts
        late_us = (self._of(self.traffic.longest).required_us - self.required_us) / 2
        key = "bus.clock_tolerance" if bus.clock_tolerance else "fd_late_bits"
        return *doubts, Doubt(key, "clocks that are not exact, and long FD frames", late_us)

    def figures(self) -> Mapping[str, Number | None]:
        """The bit rate and the load of the bus."""
        least, most = (CanCycle(self.network, model).load for model in (NONE, WORST))
        return {
            "bit_rate_kbit_s": self.traffic.bit_rate_kbit_s,
            "bus_load": self.load,
            "expected_load": least + c.EXPECTED_STUFFING * (most - least),
        }

    @cached_property
    def load(self) -> Number:
        """Share of the bus that all messages take, 0..1 [1]."""
        if not self.traffic.has_cycle:
            return self._messages_load
        return self._mean_us / self.traffic.period_us + self._messages_load

    @property
    def _in_cycle_us(self) -> Number:
        return self.sync_us + self._terms["cycle_feedback_us"] + self._terms["cycle_command_us"]

    @property
    def _mean_us(self) -> Number:
        """SYNC and PDOs of the mean cycle [us]."""
        if not self.traffic.has_rates:
            return self._in_cycle_us
        return self.sync_us + total(pdos.pdos * us / pdos.every for pdos, us in self._pdos)

    @property
    def _messages_load(self) -> Number:
        return total(_of_all(message, us) / message.period_us for message, us in self._messages)

    @property
    def load_period_us(self) -> Number:
        """The shortest period that keeps `limits.max_load`; infinite where the other messages take all of it [us]."""
        left = self.network.profile.most_load - self._messages_load
        if not self.traffic.has_cycle:
            return choose(left >= 0, 0.0, inf)
        return choose(left > 0, self._mean_us / larger(left, FIT_ROUNDING), inf)

    def _queues(self) -> str:
        """Orders of queues that the profile gives, and the senders, so that a misspelt one is seen; else empty."""
        bus = self.network.profile.bus
        orders = {group.node.queue or bus.queue for group in self.network.groups} | {bus.queue}
        known = sorted(order for order in orders if order is not None)
        words = " and ".join(known)
        if any(order in NOT_BY_PRIORITY for order in known):
            senders = dict.fromkeys(message.sender for message in self.network.profile.message if message.sender)
            words += f" (senders {first_of(list(senders), 8)})" if senders else ""
        return words

    def card_lines(self, fits: Callable[[Network], bool]) -> tuple[tuple[str, str], ...]:
        """Load beside its limit, if there is one, and the message that comes closest to its deadline."""
        most = self.network.profile.most_load
        words = f"{_short(100 * self.load)} %" + (f", {_short(100 * most)} allowed" if most < 1 else "")
        if self.traffic.has_rates:
            fullest = self._in_cycle_us / self.traffic.period_us + self._messages_load
            words += f"; {_short(100 * fullest)} % with all PDOs in every cycle"
        lines = [("load", words)]
        if queues := self._queues():
            lines.append(("queues", queues))
        if self._messages:
            answers = message_responses(self.traffic.longest)
            latest, worst = max(answers, key=lambda pair: pair[1].us / pair[0].deadline_us)
            due = "without a deadline" if latest.deadline_us == NO_DEADLINE_US else f"of {_short(latest.deadline_us)}"
            response = f"{_short(worst.us)} us {due}"
            words = response if worst.us < inf else "without a worst-case response time"
            free = sum(message.deadline_us == NO_DEADLINE_US for message, _ in answers)
            others = f"; {plural(free, 'message')} without a deadline" if free and "without" not in words else ""
            lines.append(("latest message", f"{latest.name}, {words}{others}"))
        possible_us = self.possible_us()
        if possible_us:
            why = "frames of a burst wait" if self.traffic.access == "burst" else "messages in queues wait"
            lines.append(("upper bound", f"{why} up to {_short(possible_us)} us; they may wait less"))
        tried = range(int(c.MOST_REPEATED) + 1)
        if fits(self._with_burst(0)):
            most = bisect_left(tried, 1, lo=1, key=lambda number: not fits(self._with_burst(number))) - 1
            kept = f"up to {most} in a row keep the verdict, one more" if most else "a single one"
            broken = self._broken_with(most + 1) if most < c.MOST_REPEATED else " was not tried"
            lines.append((REPEATED, kept + broken))
        return tuple(lines)

    def _with_burst(self, repeated: int) -> Network:
        """The network with some repeated frames in a row; 0 without errors."""
        profile = self.network.profile
        period_us = (profile.bus.error_period_us or MAX_TIME_US) if repeated else None
        errors = {"error_burst": repeated or None, "error_period_us": period_us}
        bus = profile.bus.model_copy(update=errors)
        return self.network._replace(profile=profile.model_copy(update={"bus": bus}))

    def _broken_with(self, repeated: int) -> str:
        """What some repeated frames in a row break, in words."""
        late = self._late_with(repeated)
        return f" makes {late} late" if late else " is not shown to fit"

    def _late_with(self, repeated: int) -> str:
        """What is late, or not shown to be in time, with some repeated frames in a row; empty where nothing is."""
        traffic = replace(traffic_of(self.network), error_burst=repeated).longest
        trial = CanCycle(self.network, self.model, traffic=traffic)
        for message, worst in message_responses(trial.traffic, is_verdict=True):
            if not within(worst.us, message.deadline_us):
                return message.name
        if not trial.traffic.has_cycle:
            return ""
        doubt_us = COVERAGE * square_root(total(doubt.us * doubt.us for doubt in trial.doubts()))
        slice_us = time_slice_us(self.network.period_us, slice_ratio=self.network.slice_ratio, nodes=1)
        return "" if within(trial.required_us + trial.added_us(doubt_us), slice_us) else "the cycle"

    def latencies(self) -> tuple[BusLatency, ...]:
        """The worst-case response of SYNC, of each group's last PDO in either direction, and of each other message."""
        if self.model == WORST and self.traffic.longest is not self.traffic:
            return self._of(self.traffic.longest).latencies()
        sync = ((SYNC, ""),) if self.traffic.has_sync else ()
        cycle = (*sync, *((pdos.name, pdos.group) for pdos in self.traffic.pdos))
        names = (*cycle, *((message.name, "") for message in self.traffic.messages))
        loop = (BusLatency(LOOP, None, self._loop()),) if cycle else ()
        return (
            *(BusLatency(name, None, self._phases(place, name), group) for place, (name, group) in enumerate(names)),
            *loop,
        )

    def _loop(self) -> dict[str, Number]:
        """Parts of the way from the instant of SYNC to the last executed command that rests on it."""
        us = self.by_term
        parts_us = {
            "jitter_us": us["cycle_jitter_us"],
            "blocking_us": us["cycle_blocking_us"],
            "interference_us": us["cycle_interference_us"],
            "backlog_us": 0.0,
            "frame_us": self._in_cycle_us,
            "execution_us": us["cycle_wait_us"] + self.traffic.host_us,
            "pipeline_us": self._pipeline_cycles * self.network.period_us,
        }
        return _numbered(parts_us, identifier=inf, data_bytes=inf, instance=inf, deadline_us=inf)

    @property
    def _pipeline_cycles(self) -> Number:
        """Cycles from the one that brings feedback to the one that takes its commands, of the slowest group [1]."""
        cycles = self._pipeline
        if not self.traffic.has_rates:
            return cycles
        due: Iterator[Number] = (rounded_up(cycles / pdos.every) * pdos.every for pdos in self.traffic.pdos)
        return reduce(larger, due)

    def loop_periods(self, *, at_sync: bool) -> int:
        """The host's pipeline, and the period to the next SYNC."""
        return super().loop_periods(at_sync=at_sync) + int(self._pipeline)

    @property
    def _pipeline(self) -> Number:
        """The host's pipeline; without SYNC at least 1, for a command goes before its feedback [1]."""
        cycles: Number = self.network.profile.bus.pipeline_cycles
        return cycles if self.traffic.has_sync else larger(cycles, 1)

    def sync_jitter_us(self) -> Number:
        """Half of SYNC's jitter and of what may hold it up; infinite without an end, 0 where no SYNC is sent [us]."""

        def held_up_us(traffic: Traffic) -> Number:
            worst = sync_response(traffic)
            return choose(worst.us < inf, worst.blocking_us + worst.interference_us, inf)

        if not self.traffic.has_sync:
            return 0.0
        held_us = self.traffic.ask(held_up_us, words="frames before SYNC, B + I")
        return (self.traffic.sync_jitter_us + held_us) / 2

    def _phases(self, place: int, name: str) -> dict[str, Number]:
        """Figures of the stream at a place among those that end a PDO or a message; of no arrays."""

        def figure(key: str, words: str, *behind: Number) -> Number:
            def of(traffic: Traffic, *_: Number) -> float:
                stream, worst = responses(traffic)[place]
                if key in Stream._fields or key == "last":
                    number: float = getattr(stream, key)
                else:
                    number = getattr(worst, key) if worst.us < inf else inf
                return number

            return self.traffic.ask(of, *behind, words=words)

        # A derivation says which frames were counted, and what a queue does that is not by priority.
        point, words, last = self.traffic.point, ("", ""), None
        if isinstance(point, Traced):
            traffic = self.traffic.at(point.value)
            words, last = counted(traffic, place), last_in_queue(traffic, place)
        blocks, before = (f": {frames}" if frames else "" for frames in words)
        behind: tuple[Number, ...] = ()
        of_queue, source, lower = "", "", name
        higher = f"of higher priorities before {name}"
        if last is not None:
            of_queue, source, lower = "(L)", _QUEUES, "L"
            higher = f"of its queue and of higher priorities than L before {name}"
            is_late = any(message.name == name for message in self.traffic.messages)
            said = (
                f"the lowest priority in the queue, {int(last.last):#x} of {last.label}: "
                f"{name} waits for all before it{', and comes to others R - C later' if is_late else ''} "
                "(Davis, Kollmann, Pollex, Slomka 2011; Davis, Navet 2012)"
            )
            identifier = self.traffic.ask(lambda _: last.last, words=said)
            behind = (named(identifier, "last_in_queue", "L", source),)
        frame_us = figure("frame_us", f"the last frame of {name}")
        instance = figure("instance", f"the worst instance of {name} in the busy period, from 0")
        period_us = named(figure("period_us", f"period of {name}"), "period_us", "T")
        periods = instance
        if any(value_of(message.burst) > 1 for message in self.traffic.messages if message.name == name):
            burst = named(figure("burst", f"frames of {name} that may come at once"), "burst", "b")
            periods = instance - burst + 1
        parts_us = {
            "jitter_us": named(figure("jitter_us", f"how late {name} may be queued"), "jitter_us", "J"),
            "blocking_us": named(
                figure("blocking_us", f"the longest frame of a lower priority than {lower}{blocks}", *behind),
                "blocking_us",
                f"B{of_queue}",
                source,
            ),
            "interference_us": named(
                figure("interference_us", f"frames {higher}, in its worst instance{before}", *behind),
                "interference_us",
                f"I{of_queue}",
                source,
            ),
            "backlog_us": named(
                choose(instance < inf, instance * frame_us - periods * period_us, instance), "backlog_us", "q (C - T)"
            ),
            "frame_us": named(frame_us, "frame_us", "C"),
            "execution_us": 0.0,
            "pipeline_us": 0.0,
        }
        messages = self.network.profile.message
        has_deadline = not any(isinstance(each.deadline_us, str) for each in messages if each.name == name)
        return _numbered(
            parts_us,
            source,
            identifier=figure("last", f"identifier of {name}"),
            data_bytes=figure("data_bytes", f"data of {name}"),
            instance=instance,
            deadline_us=figure("deadline_us", f"deadline of {name}") if has_deadline else inf,
        )


def _numbered(parts_us: Mapping[str, Number], source: str = "", **figures: Number) -> dict[str, Number]:
    """The figures of a latency with the sum of its parts, and its source where it is not that of the figure."""
    deadline_us = figures.pop("deadline_us")
    response_us = named(total(parts_us.values()), "worst_response_us", "R", source)
    return {**figures, **parts_us, "worst_response_us": response_us, "deadline_us": deadline_us}


def _short(number: float) -> str:
    """A number with one decimal, where it is not whole."""
    return f"{number:.1f}".removesuffix(".0")


def _execution_us(group: Group, kind: TransactionKind, uncertainties: int) -> Number:
    """The slowest execution of a group's nodes, with some standard uncertainties [us]."""
    execution_us, doubt_us = (
        (group.read_execution_us, group.read_uncertainty_us)
        if kind == "read"
        else (group.write_execution_us, group.write_uncertainty_us)
    )
    slowest_us = execution_us + group.worst_extra_us
    return slowest_us + uncertainties * doubt_us if uncertainties else slowest_us


def _of_all(message: Message, number: Number) -> Number:
    """A number of a message, of all nodes that send it."""
    return number if is_off(message.senders - 1) else message.senders * number
