"""The SYNC cycle: SYNC, feedback, command, and the other messages that arrive while it lasts."""

from collections.abc import Iterator, Mapping
from functools import cached_property, partial, reduce
from itertools import chain
from math import inf
from typing import Final, Literal

from busplan.buses.can.equations import frame_us, payload_us
from busplan.buses.can.response import Sender, settled_us
from busplan.buses.can.streams import frame_sizes, response, streams
from busplan.buses.can.traffic import NAMES, SYNC, Message, Pdos, Traffic, traffic_of
from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, Doubt, LeftOut, Term
from busplan.buses.network import Group, Network
from busplan.elementwise import FIT_ROUNDING, Number, choose, larger, named, plain, pointwise, rounded_up, total
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

TimingModelName = Literal["worst-stuffing", "no-stuffing"]
WORST: Final[TimingModelName] = "worst-stuffing"
NONE: Final[TimingModelName] = "no-stuffing"


class CanCycle(BusCycle):
    """SYNC, the wait for the slowest node, all feedback PDOs, all command PDOs, other messages, and the window.

    All nodes execute at once: feedback waits for the slowest of them, and so does the next SYNC behind the commands.
    """

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.is_stuffed = model == WORST

    @cached_property
    def traffic(self) -> Traffic:
        """What the network sends."""
        return traffic_of(self.network)

    @cached_property
    def _wire(self) -> dict[str, Number]:
        return {"identifier_bits": self.traffic.identifier_bits, "bit_rate_kbit_s": self.traffic.bit_rate_kbit_s}

    def _frame_us(self, data_bytes: Number) -> Number:
        return frame_us(data_bytes, **self._wire, is_stuffed=self.is_stuffed)

    def _pdo_us(self, one: Pdos) -> Number:
        found = payload_us(one.payload_bytes, **self._wire, is_stuffed=self.is_stuffed)
        return named(found, f"{one.name}_us", f"PDO,{one.name}{one.group and f',{one.group}'}")

    @cached_property
    def _pdos(self) -> tuple[tuple[Pdos, Number], ...]:
        """All PDOs, each with its time."""
        return tuple((one, self._pdo_us(one)) for one in self.traffic.pdos)

    @cached_property
    def _messages(self) -> tuple[tuple[Message, Number], ...]:
        """All other messages, each with the time of its frame."""
        return tuple(
            (one, named(self._frame_us(one.payload_bytes), f"{one.name}_us", f"C,{one.name}"))
            for one in self.traffic.messages
        )

    def _all_us(self, kind: TransactionKind) -> Number:
        return total(one.pdos * us for one, us in self._pdos if one.kind == kind)

    @cached_property
    def sync_us(self) -> Number:
        """SYNC [us]."""
        return self._frame_us(self.traffic.sync_bytes)

    def _wait_us(self, kind: TransactionKind, *, uncertainties: int = 0) -> Number:
        """The slowest execution of any node, with some standard uncertainties of each [us]."""
        return reduce(larger, (_execution_us(one, kind, uncertainties) for one in self.network.groups))

    @cached_property
    def _others(self) -> dict[str, Number]:
        """All terms but the messages, whose number follows from them."""
        return {
            "cycle_sync_us": self.sync_us,
            "cycle_wait_us": total(self._wait_us(kind) for kind in TRANSACTION_KINDS),
            "cycle_feedback_us": self._all_us("read"),
            "cycle_command_us": self._all_us("write"),
            "nonperiodic_us": self.network.nonperiodic_us,
        }

    @cached_property
    def _others_us(self) -> Number:
        return total(self._others.values())

    def _counts(self, others_us: Number) -> tuple[Number, ...]:
        """How many of each message arrive in a cycle whose other terms take some time [1]."""
        if not self._messages:
            return ()
        numbers = [number for one, us in self._messages for number in (us, one.period_us, one.jitter_us)]
        lasts_us = named(
            pointwise(
                _settled, others_us, *numbers, words="w = others + sum of ceil((w + J) / T) C, a bound at high load"
            ),
            "busy_us",
            "w",
        )
        return tuple(rounded_up((lasts_us + one.jitter_us) / one.period_us) for one, _ in self._messages)

    def _messages_us(self, others_us: Number) -> Number:
        counts = self._counts(others_us)
        return total(count * us for count, (_, us) in zip(counts, self._messages, strict=True))

    def computed_terms(self) -> tuple[Term, ...]:
        """The cycle in the order of the wire."""
        *others, last = self._others.items()
        messages = Term("cycle_messages_us", self._messages_us(self._others_us))
        return (*(Term(*one) for one in others), messages, Term(*last))

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:
        """What the cycle grows by if its nodes take longer: more messages may arrive, too [us]."""
        if not self._messages:
            return extra_us
        before_us = self._others_us + after_us
        return extra_us + self._messages_us(before_us + extra_us) - self._messages_us(before_us)

    def doubts(self) -> tuple[Doubt, ...]:
        """The execution time: what two standard uncertainties more change, halved."""
        swing_us = total((self._wait_us(kind, uncertainties=2) - self._wait_us(kind)) / 2 for kind in TRANSACTION_KINDS)
        key = "node.execution" if self.network.is_uniform else "group.execution"
        return (Doubt(key, "execution time", swing_us),)

    def left_out(self) -> tuple[LeftOut, ...]:
        """The slowest execution, and what else is on the bus."""
        slowest = (
            LeftOut("the slowest execution", group.key("execution.worst_extra_us"))
            for group in self.network.groups
            if not group.worst_extra_us
        )
        others = () if self._messages or self.network.nonperiodic_us else (LeftOut("other messages", "message"),)
        return (*slowest, *others)

    def events(self) -> Iterator[BusEvent]:
        """The cycle node by node, then the messages that arrive meanwhile."""
        yield BusEvent("sync", "cycle_sync_us", plain(self.sync_us), "SYNC")
        for kind in TRANSACTION_KINDS:
            waiting_us = plain(self._wait_us(kind))
            if kind == "read":
                yield BusEvent("wait", "cycle_wait_us", waiting_us, "wait for the slowest feedback")
            yield from self._frames(kind)
        for count, (one, us) in zip(self._counts(self._others_us), self._messages, strict=True):
            for _ in range(int(plain(count))):
                yield BusEvent("message", "cycle_messages_us", plain(us), f"message {one.name}")
        yield BusEvent("wait", "cycle_wait_us", waiting_us, "wait for the slowest execution of a command")
        yield BusEvent("nonperiodic", "nonperiodic_us", plain(self.network.nonperiodic_us), "non-periodic window")

    def _frames(self, kind: TransactionKind) -> Iterator[BusEvent]:
        """All frames of one direction, node by node."""
        name, node = NAMES[kind], 0
        own = (one for one, _ in self._pdos if one.kind == kind)
        for group, one in zip(self.network.groups, own, strict=True):
            nodes = int(plain(group.nodes))
            pdos = int(plain(one.pdos)) // nodes
            for _ in range(nodes):
                node += 1
                for size in chain.from_iterable(frame_sizes(one) for _ in range(pdos)):
                    us = plain(self._frame_us(size))
                    yield BusEvent(f"{name}_frame", f"cycle_{name}_us", us, f"{name} PDO", node, name)

    def figures(self) -> Mapping[str, Number | None]:
        """The bit rate and the load of the bus."""
        return {"bit_rate_kbit_s": self.traffic.bit_rate_kbit_s, "bus_load": self.load}

    @cached_property
    def load(self) -> Number:
        """Share of the bus that all messages take, 0..1 [1]."""
        return self._in_cycle_us / self.traffic.period_us + self._messages_load

    @property
    def _in_cycle_us(self) -> Number:
        return self.sync_us + self._all_us("read") + self._all_us("write")

    @property
    def _messages_load(self) -> Number:
        return total(us / one.period_us for one, us in self._messages)

    @property
    def load_period_us(self) -> Number:
        """The shortest period that keeps `limits.max_load`; infinite where the other messages take all of it [us]."""
        left = self.network.profile.limits.max_load - self._messages_load
        return choose(left > 0, self._in_cycle_us / larger(left, FIT_ROUNDING), inf)

    def latencies(self) -> tuple[BusLatency, ...]:
        """The worst-case response of SYNC, of each group's last PDO in either direction, and of each other message."""
        pdos = ((one.name, one.group) for one in self.traffic.pdos)
        names = ((SYNC, ""), *pdos, *((one.name, "") for one in self.traffic.messages))
        return tuple(
            BusLatency(name, None, self._phases(place, name), group) for place, (name, group) in enumerate(names)
        )

    def _phases(self, place: int, name: str) -> dict[str, Number]:
        """Figures of the stream at a place among those that end a PDO or a message."""

        def found(key: str, words: str) -> Number:
            phase = partial(_phase, self.traffic, self.is_stuffed, place, key)
            return pointwise(phase, *self.traffic.numbers(), words=words)

        jitter_us = found("jitter_us", f"how late {name} may be queued")
        frame_us_ = found("frame_us", f"the last frame of {name}")
        blocking_us = found("blocking_us", f"the longest frame of a lower priority than {name}")
        interference_us = found("interference_us", f"frames of higher priorities before {name}, in its worst instance")
        instance = found("instance", f"the worst instance of {name} in the busy period, from 0")
        period_us = named(found("period_us", f"period of {name}"), "period_us", "T")
        backlog_us = choose(instance < inf, instance * frame_us_ - instance * period_us, instance)
        parts_us = {
            "jitter_us": named(jitter_us, "jitter_us", "J"),
            "blocking_us": named(blocking_us, "blocking_us", "B"),
            "interference_us": named(interference_us, "interference_us", "I"),
            "backlog_us": named(backlog_us, "backlog_us", "q (C - T)"),
            "frame_us": named(frame_us_, "frame_us", "C"),
        }
        return {
            "identifier": found("last", f"identifier of {name}"),
            "data_bytes": found("data_bytes", f"data of {name}"),
            "instance": instance,
            **parts_us,
            "worst_response_us": total(parts_us.values()),
            "deadline_us": found("deadline_us", f"deadline of {name}"),
        }


def _execution_us(group: Group, kind: TransactionKind, uncertainties: int) -> Number:
    """The slowest execution of a group's nodes, with some standard uncertainties [us]."""
    own = group.read_execution_us if kind == "read" else group.write_execution_us
    slowest_us = own + group.worst_extra_us
    if not uncertainties:
        return slowest_us
    doubt_us = group.read_uncertainty_us if kind == "read" else group.write_uncertainty_us
    return slowest_us + uncertainties * doubt_us


def _settled(others_us: float, *numbers: float) -> float:
    """The span in which all messages that arrive in it are sent, of their times, periods and jitters in one row."""
    return settled_us(others_us, [Sender(*numbers[place : place + 3]) for place in range(0, len(numbers), 3)])


def _phase(traffic: Traffic, is_stuffed: bool, place: int, key: str, *numbers: float) -> float:
    """One figure of the response of the stream at a place; infinite where it does not exist."""
    plain_traffic = traffic.with_numbers(*numbers)
    each = streams(plain_traffic, is_stuffed=is_stuffed)
    own = [one for one in each if one.is_end][place]
    if hasattr(own, key):
        said: float = getattr(own, key)
        return said
    worst = response(own, each, bit_rate_kbit_s=plain(plain_traffic.bit_rate_kbit_s))
    found: float = inf if worst is None else getattr(worst, key)
    return found
