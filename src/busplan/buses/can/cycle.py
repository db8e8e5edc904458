"""The SYNC cycle: SYNC, feedback, the host, commands, and what other messages make it wait for."""

from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache, partial, reduce
from itertools import chain, islice
from math import inf
from typing import Final, Literal

from busplan.buses.can.constants import EXPECTED_STUFFING
from busplan.buses.can.equations import bit_us, frame_us, payload_us
from busplan.buses.can.response import Response
from busplan.buses.can.streams import Stream, frame_sizes, streams
from busplan.buses.can.traffic import LOOP, NAMES, SYNC, Message, Pdos, Sent, Traffic, traffic_of, without_times
from busplan.buses.can.waiting import is_higher, last_cyclic, response, waits
from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, Doubt, LeftOut, Term
from busplan.buses.network import Group, Network
from busplan.elementwise import FIT_ROUNDING, Number, choose, is_off, larger, named, plain, rounded_up, total
from busplan.sections.transactions import TRANSACTION_KINDS, TransactionKind

TimingModelName = Literal["worst-stuffing", "no-stuffing"]
WORST: Final[TimingModelName] = "worst-stuffing"
NONE: Final[TimingModelName] = "no-stuffing"
_RESTS_ON: Final = {"cycle_host_us": "bus.host_us"}
"""The key that a term comes from alone."""


class CanCycle(BusCycle):
    """SYNC, the wait for the slowest node, all feedback PDOs, the host, all command PDOs, and the window.

    All nodes execute at once: feedback waits for the slowest of them, and so does the next SYNC behind the commands.
    Before SYNC, the last feedback and the commands a frame of a lower priority may be on the wire; frames of higher
    priorities go whenever they are queued.
    """

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.is_stuffed = model == WORST

    @cached_property
    def traffic(self) -> Traffic:
        """What the network sends."""
        return traffic_of(self.network)

    @cached_property
    def _sent(self) -> Sent:
        return Sent(self.traffic)

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
    def _own(self) -> dict[str, Number]:
        """The terms that no other message is in."""
        return {
            "cycle_sync_us": self.sync_us,
            "cycle_wait_us": total(self._wait_us(kind) for kind in TRANSACTION_KINDS),
            "cycle_feedback_us": self._all_us("read"),
            "cycle_host_us": self.traffic.host_us,
            "cycle_command_us": self._all_us("write"),
        }

    @cached_property
    def _on_bus_us(self) -> Number:
        """From SYNC to the end of the last command, but for other messages [us]."""
        waits_us = {"cycle_wait_us": self._wait_us("read")}
        return total((self._own | waits_us).values())

    def _waits_us(self, extra_us: Number = 0.0) -> tuple[Number, Number]:
        """Blocking by frames of lower priorities, and interference by those of higher ones [us].

        Parameters
        ----------
        extra_us
            By how much the rest takes longer [us].
        """
        return self._own_waits_us if is_off(extra_us) else self._waits_beside_us(self._on_bus_us + extra_us)

    @cached_property
    def _own_waits_us(self) -> tuple[Number, Number]:
        """The same where nothing takes longer [us]."""
        return self._waits_beside_us(self._on_bus_us + 0.0)

    def _waits_beside_us(self, others_us: Number) -> tuple[Number, Number]:
        if not self._messages:
            return 0.0, 0.0
        others_us = named(others_us, "others_us", "others")

        def found(key: str, words: str) -> Number:
            return self._sent.of(partial(_waits, self.is_stuffed, key), others_us, words=words)

        words = "w = others + 3 B + sum of ceil((w + J + bit) / T) C, the smallest one, or a bound of it at high load"
        lasts_us = named(found("lasts_us", words), "busy_us", "w")
        blocking_us = found("blocking_us", "the 3 longest frames of a lower priority that can be there in w")
        counts = self._higher(lasts_us)
        return blocking_us, total(count * us for count, (_, us) in zip(counts, self._messages, strict=True))

    def _higher(self, lasts_us: Number) -> Iterator[Number]:
        """How many frames of each message go before the last PDO in a span of time [1]."""
        window_us = lasts_us + bit_us(self.traffic.bit_rate_kbit_s)
        for one, _ in self._messages:
            count = rounded_up((window_us + one.jitter_us) / one.period_us)
            yield choose(is_higher(one.identifier, self._last), count, 0)

    @cached_property
    def _last(self) -> Number:
        """The largest identifier of SYNC and all PDOs."""
        sent, words = Sent(without_times(self.traffic)), "the largest identifier of SYNC and all PDOs"
        return named(sent.of(_last, words=words), "last_identifier", "id_last")

    def computed_terms(self) -> tuple[Term, ...]:
        """The cycle in the order of the wire."""
        blocking_us, interference_us = self._waits_us()
        return (
            *(Term(key, us, _RESTS_ON.get(key, "")) for key, us in self._own.items()),
            Term("cycle_blocking_us", blocking_us),
            Term("cycle_interference_us", interference_us),
            Term("nonperiodic_us", self.network.nonperiodic_us),
        )

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:
        """What the cycle grows by if its nodes take longer: more messages may arrive, too [us]."""
        if not self._messages:
            return extra_us
        return extra_us + total(self._waits_us(after_us + extra_us)) - total(self._waits_us(after_us))

    def doubts(self) -> tuple[Doubt, ...]:
        """The execution time, what two standard uncertainties more change, halved, and the host's own time."""
        swing_us = total((self._wait_us(kind, uncertainties=2) - self._wait_us(kind)) / 2 for kind in TRANSACTION_KINDS)
        key = "node.execution" if self.network.is_uniform else "group.execution"
        bus = self.network.profile.bus
        host_us = choose(bus.pipeline_cycles > 0, 0.0, bus.host_doubt_us)
        return Doubt(key, "execution time", swing_us), Doubt("bus.host_us", "the host's own time", host_us)

    def left_out(self) -> tuple[LeftOut, ...]:
        """The host's own time, the slowest execution, and what else is on the bus."""
        bus = self.network.profile.bus
        host = () if bus.pipeline_cycles or bus.host_us else (LeftOut("host time", "bus.host_us"),)
        slowest = (
            LeftOut("the slowest execution", group.key("execution.worst_extra_us"))
            for group in self.network.groups
            if not group.worst_extra_us
        )
        others = () if self._messages or self.network.nonperiodic_us else (LeftOut("other messages", "message"),)
        return (*host, *slowest, *others)

    def events(self) -> Iterator[BusEvent]:
        """The cycle node by node, with other messages as late for the commands as they can be."""
        found = waits(self.traffic, plain(self._on_bus_us), is_stuffed=self.is_stuffed)
        blocks = (
            BusEvent("blocking", "cycle_blocking_us", one.frame_us, f"message {one.name} of a lower priority")
            for one in found.blocks()
        )
        yield from islice(blocks, 1)
        yield BusEvent("sync", "cycle_sync_us", plain(self.sync_us), "SYNC")
        yield BusEvent("wait", "cycle_wait_us", plain(self._wait_us("read")), "wait for the slowest feedback")
        yield from islice(blocks, 1)
        yield from self._frames("read")
        yield BusEvent("host", "cycle_host_us", plain(self.traffic.host_us), "host")
        yield from blocks
        for count, (one, us) in zip(self._higher(found.lasts_us), self._messages, strict=True):
            for _ in range(int(plain(count))):
                yield BusEvent("message", "cycle_interference_us", plain(us), f"message {one.name}")
        yield from self._frames("write")
        waiting_us = plain(self._wait_us("write"))
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
        least, most = (CanCycle(self.network, model).load for model in (NONE, WORST))
        return {
            "bit_rate_kbit_s": self.traffic.bit_rate_kbit_s,
            "bus_load": self.load,
            "expected_load": least + EXPECTED_STUFFING * (most - least),
        }

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
        found = (BusLatency(name, None, self._phases(place, name), group) for place, (name, group) in enumerate(names))
        return (*found, BusLatency(LOOP, None, self._loop()))

    def _loop(self) -> dict[str, Number]:
        """Parts of the way from SYNC to the last executed command that rests on it."""
        blocking_us, interference_us = self._waits_us()
        parts_us = {
            "jitter_us": 0.0,
            "blocking_us": blocking_us,
            "interference_us": interference_us,
            "backlog_us": 0.0,
            "frame_us": self._in_cycle_us,
            "execution_us": self._own["cycle_wait_us"] + self.traffic.host_us,
            "pipeline_us": self.network.profile.bus.pipeline_cycles * self.network.period_us,
        }
        return _numbered(parts_us, identifier=inf, data_bytes=inf, instance=inf, deadline_us=inf)

    def loop_periods(self, *, at_sync: bool) -> int:
        """The host's pipeline, and the period to the next SYNC."""
        return super().loop_periods(at_sync=at_sync) + int(plain(self.network.profile.bus.pipeline_cycles))

    def sync_jitter_us(self) -> Number:
        """Half of what messages may hold SYNC up [us]."""
        return self.sync_spread_us / 2

    @cached_property
    def sync_spread_us(self) -> Number:
        """How much later than without other messages SYNC may end, B + I [us]; infinite where it has no end."""
        phases = self._phases(0, SYNC)
        return named(phases["blocking_us"] + phases["interference_us"], "sync_spread_us", "B + I")

    def _phases(self, place: int, name: str) -> dict[str, Number]:
        """Figures of the stream at a place among those that end a PDO or a message."""

        def found(key: str, words: str) -> Number:
            return self._sent.of_points(partial(_phase, self.is_stuffed, place, key), words=words)

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
            "execution_us": 0.0,
            "pipeline_us": 0.0,
        }
        return _numbered(
            parts_us,
            identifier=found("last", f"identifier of {name}"),
            data_bytes=found("data_bytes", f"data of {name}"),
            instance=instance,
            deadline_us=found("deadline_us", f"deadline of {name}"),
        )


def _numbered(parts_us: Mapping[str, Number], **others: Number) -> dict[str, Number]:
    """The figures of a latency with the sum of its parts."""
    deadline_us = others.pop("deadline_us")
    return {**others, **parts_us, "worst_response_us": total(parts_us.values()), "deadline_us": deadline_us}


def _execution_us(group: Group, kind: TransactionKind, uncertainties: int) -> Number:
    """The slowest execution of a group's nodes, with some standard uncertainties [us]."""
    own = group.read_execution_us if kind == "read" else group.write_execution_us
    slowest_us = own + group.worst_extra_us
    if not uncertainties:
        return slowest_us
    doubt_us = group.read_uncertainty_us if kind == "read" else group.write_uncertainty_us
    return slowest_us + uncertainties * doubt_us


def _waits(is_stuffed: bool, key: str, traffic: Traffic, others_us: Number) -> Number:
    """One figure of what a cycle waits for."""
    found: Number = getattr(waits(traffic, others_us, is_stuffed=is_stuffed), key)
    return found


def _last(traffic: Traffic) -> Number:
    found: Number = last_cyclic(streams(traffic, is_stuffed=True))
    return found


def _phase(is_stuffed: bool, place: int, key: str, traffic: Traffic) -> float:
    """One figure of the stream at a place among those that end a PDO or a message, and of its response.

    It is infinite where it does not exist.
    """
    own, worst = _answer(traffic, place, is_stuffed=is_stuffed)
    said: float = getattr(own if hasattr(own, key) else worst, key, inf)
    return said


@lru_cache(maxsize=1024)
def _answer(traffic: Traffic, place: int, *, is_stuffed: bool) -> tuple[Stream, Response | None]:
    """The stream at a place among those that end a PDO or a message, with its response."""
    own = next(islice((one for one in streams(traffic, is_stuffed=is_stuffed) if one.is_end), place, None))
    return own, response(own, traffic, is_stuffed=is_stuffed)
