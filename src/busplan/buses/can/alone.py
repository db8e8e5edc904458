"""Loads and response times, which every CAN network has; and a network of messages alone."""

from abc import abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from math import inf
from typing import ClassVar, Final, Literal, Self

from busplan.buses.can.equations import TERMS, CanMessageFigures, c
from busplan.buses.can.latency import phases
from busplan.buses.can.traffic import NO_DEADLINE_US, NOT_BY_PRIORITY, REPEATED, Message, Traffic, traffic_of
from busplan.buses.can.waiting import message_responses
from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, Premise, Run
from busplan.buses.network import Network
from busplan.elementwise import Number, choose, named, total, within
from busplan.english import first_of, plural
from busplan.sections.base import MAX_TIME_US

TimingModelName = Literal["worst-stuffing", "no-stuffing"]
WORST_STUFFING: Final[TimingModelName] = "worst-stuffing"
NO_STUFFING: Final[TimingModelName] = "no-stuffing"

_TIMES: Final = ("host_write_us", "host_read_us")
"""Keys of the adapter's times."""


def _is_unknown(cycle: "CanCycle", *names: str) -> bool:
    """Whether some of these numbers of the host's adapter is neither given nor said by its word."""
    bus = cycle.network.profile.bus
    return bus.adapter != "none" and any(bus.of_adapter(name) is None for name in names)


PREMISES: Final = (
    Premise("bus.error_period_us", "no repeated frames", 10_000.0),
    Premise("bus.queue", "priority queues", "fifo"),
    Premise("node.queue", "priority queues", "fifo", lambda cycle: cycle.network.profile.bus.queue is None),
    Premise("bus.sync_jitter_us", "SYNC without jitter", 50.0),
    Premise("bus.clock_tolerance", "exact clocks", 1e-4),
    Premise("bus.host_us", "an instant host", 100.0, lambda cycle: cycle.waits_for_host),
    Premise("bus.adapter", "an adapter without delay", "kvaser-pcie", lambda cycle: _is_unknown(cycle, *_TIMES)),
    Premise("bus.host_write_us", "an adapter without delay", 100.0, lambda cycle: _is_unknown(cycle, "host_write_us")),
    Premise("bus.host_read_us", "an adapter without delay", 100.0, lambda cycle: _is_unknown(cycle, "host_read_us")),
    Premise("bus.max_frames_s", "an adapter without ceiling", 5000.0, lambda cycle: _is_unknown(cycle, "max_frames_s")),
    Premise("bus.sync_counter", "SYNC without counter", True),
    Premise("bus.sync_identifier", "SYNC by its usual identifier", 0x700),
    Premise("bus.pipeline_cycles", "commands one cycle later", 2),
    Premise("message", "no other messages"),
    Premise("message.jitter_us", "messages without jitter", 100.0),
)
"""Premises of a cycle of SYNC; those of other networks are among them."""
OF_SYNC: Final = frozenset({"bus.sync_jitter_us", "bus.sync_counter", "bus.sync_identifier"})
"""Premises of SYNC."""
_OF_CYCLE: Final = OF_SYNC | {"bus.host_us", "bus.pipeline_cycles", "bus.adapter", *(f"bus.{name}" for name in _TIMES)}


class CanCycle(BusCycle):
    """Loads, and response times of messages: of every CAN network, with a cycle or without."""

    term_figures = TERMS
    record: ClassVar[type[CanMessageFigures]] = CanMessageFigures

    def __init__(
        self, network: Network, model: str, number: int | None = None, *, traffic: Traffic | None = None
    ) -> None:
        self.network = network
        self.model = model
        self.number = number
        traffic = traffic or traffic_of(network)
        self.traffic = traffic if model == WORST_STUFFING else replace(traffic, is_stuffed=False)
        """Traffic, by default the network's; its frames are as long as in the timing model."""

    @classmethod
    def made(cls, network: Network, model: str, traffic: Traffic) -> Self:
        """The cycle of a network's traffic under a timing model, which the traffic keeps: each limit asks for it."""
        if (cls, model) not in traffic.results:
            traffic.results[cls, model] = cls(network, model, traffic=traffic)
        cycle: Self = traffic.results[cls, model]
        return cycle

    def of(self, traffic: Traffic) -> Self:
        """The cycle of other traffic of the same sort."""
        if self.number is None:
            return self.made(self.network, self.model, traffic)
        return type(self)(self.network, self.model, self.number, traffic=traffic)

    @cached_property
    def messages(self) -> tuple[tuple[Message, Number], ...]:
        """All messages beside SYNC and PDOs, each with the time of its frame [us]."""
        return tuple((message, self._message_us(message)) for message in self.traffic.messages)

    def _message_us(self, message: Message) -> Number:
        us = self.traffic.frame_us(message.payload_bytes, message)
        return named(us, f"{message.name}_us", f"C,{message.name}")

    def figures(self) -> Mapping[str, Number | None]:
        """The bit rate, and the load of the bus, also with as many stuff bits as measured frames have."""
        sent = traffic_of(self.network)
        least, most = (self.made(self.network, model, sent).load for model in (NO_STUFFING, WORST_STUFFING))
        return {
            "bit_rate_kbit_s": self.traffic.bit_rate_kbit_s,
            "bus_load": self.load,
            "expected_load": least + c.EXPECTED_STUFFING * (most - least),
        }

    @property
    @abstractmethod
    def load(self) -> Number:
        """Share of the bus that everything takes, 0..1 [1]."""

    @property
    def fullest_load(self) -> Number:
        """Share of the bus that everything takes with all PDOs in every cycle, 0..1 [1]."""
        return self.load

    @property
    def messages_load(self) -> Number:
        """Share of the bus that messages beside SYNC and PDOs take, 0..1 [1]."""
        return total(message.of_all(us) / message.period_us for message, us in self.messages)

    @property
    @abstractmethod
    def load_period_us(self) -> Number:
        """The shortest period that keeps `limits.max_load`; infinite where the messages alone take more [us]."""

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
        """Load beside its limit, queues, the message that comes closest to its deadline, and errors that still fit."""
        most = self.network.profile.most_load
        words = f"{_short(100 * self.load)} %" + (f", {_short(100 * most)} allowed" if most < 1 else "")
        if self.traffic.has_rates:
            words += f"; {_short(100 * self.fullest_load)} % with all PDOs in every cycle"
        lines = [("load", words)]
        if queues := self._queues():
            lines.append(("queues", queues))
        if self.messages:
            lines.append(("latest message", self._latest_words()))
        tried = range(int(c.MOST_REPEATED) + 1)
        if fits(self._with_burst(0)):
            repeated = bisect_left(tried, 1, lo=1, key=lambda number: not fits(self._with_burst(number))) - 1
            kept = f"up to {repeated} in a row keep the verdict, one more" if repeated else "a single one"
            broken = self._broken_with(repeated + 1) if repeated < c.MOST_REPEATED else " was not tried"
            lines.append((REPEATED, kept + broken))
        return tuple(lines)

    def _latest_words(self) -> str:
        """The message that comes closest to its deadline, and how many have none."""
        answers = message_responses(self.traffic.longest)
        latest, worst = max(answers, key=lambda pair: pair[1].us / pair[0].deadline_us)
        if worst.us == inf:
            return f"{latest.name}, without a worst-case response time"
        if latest.deadline_us == NO_DEADLINE_US:
            return f"{latest.name}, {_short(worst.us)} us without a deadline"
        free = sum(message.deadline_us == NO_DEADLINE_US for message, _ in answers)
        others = f"; {plural(free, 'message')} without a deadline" if free else ""
        return f"{latest.name}, {_short(worst.us)} us of {_short(latest.deadline_us)}{others}"

    def _with_burst(self, repeated: int) -> Network:
        """The network with some repeated frames in a row; 0 without errors."""
        profile = self.network.profile
        if not repeated and profile.bus.error_period_us is None:
            return self.network
        period_us = (profile.bus.error_period_us or MAX_TIME_US) if repeated else None
        errors = {"error_burst": repeated or None, "error_period_us": period_us}
        bus = profile.bus.model_copy(update=errors)
        return self.network._replace(profile=profile.model_copy(update={"bus": bus}))

    def _broken_with(self, repeated: int) -> str:
        """Words on the first thing that some repeated frames in a row make late."""
        traffic = replace(traffic_of(self.network), error_burst=repeated).longest
        late = self.of(traffic).first_late()
        return f" makes {late} late" if late else " is not shown to fit"

    def first_late(self) -> str:
        """The first message that is late, or not shown to be in time, by its name; empty without one."""
        answers = message_responses(self.traffic, is_verdict=True)
        return next((message.name for message, worst in answers if not within(worst.us, message.deadline_us)), "")

    def latencies(self) -> tuple[BusLatency, ...]:
        """The worst-case response of each frame that ends a part of the cycle, and of each message."""
        if self.model == WORST_STUFFING and self.traffic.longest is not self.traffic:
            return self.of(self.traffic.longest).latencies()
        names = (*self.ends, *((message.name, "") for message in self.traffic.messages))
        return tuple(
            BusLatency(name, None, phases(self.traffic, place, name), group)
            for place, (name, group) in enumerate(names)
        )

    @property
    def ends(self) -> tuple[tuple[str, str], ...]:
        """Name and group of each frame that ends a part of the cycle, in the order of `waiting.worst_cases`."""
        return ()


class MessagesAlone(CanCycle):
    """A network of messages alone, with a cycle in which no term takes time."""

    premises = tuple(premise for premise in PREMISES if premise.key not in _OF_CYCLE)

    def written(self) -> Iterator[BusEvent | Run]:
        """No events: there is no cycle."""
        return iter(())

    @property
    def load(self) -> Number:
        """Share of the bus that the messages take, 0..1 [1]."""
        return self.messages_load

    @property
    def load_period_us(self) -> Number:
        """The shortest period that keeps `limits.max_load`; infinite where the messages take more [us]."""
        return choose(self.network.profile.most_load - self.messages_load >= 0, 0.0, inf)


def _short(number: float) -> str:
    """A number with one decimal, where it is not whole."""
    return f"{number:.1f}".removesuffix(".0")
