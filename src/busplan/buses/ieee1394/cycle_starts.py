"""Common to all schedules of an IEEE 1394 bus: delays, busy retries, and the cycle starts between packets."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import repeat
from math import ceil
from typing import Final

from busplan.buses.cycle import BusCycle, BusEvent, LeftOut, Run, summed
from busplan.buses.figure import NONPERIODIC, Ink, by_key
from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import (
    CYCLE_START_BYTES,
    CYCLE_US,
    DATA_RATE_MBIT_S,
    LEAST_ASYNCHRONOUS_US,
    safe_gap_count,
)
from busplan.buses.ieee1394.figures import LATENCY, SYNC, TERMS
from busplan.buses.ieee1394.timing import TIMING_MODELS, Delays, Link, TimingModelName, delays
from busplan.buses.ieee1394.transactions import LATENCY_SYMBOLS, is_broadcast, link_of
from busplan.buses.network import Group, Network
from busplan.buses.parts import EventKind
from busplan.elementwise import Number, is_off, larger, named, plain, rounded_down, smaller, total

_PHASES: Final = by_key(LATENCY)


def _kind(key: str, label: str, phase: str, mark: str, ink: Ink) -> EventKind:
    return EventKind(key, label, _PHASES[phase].reference, mark, ink)


EVENTS: Final = (
    EventKind("cycle_start", "cycle start", "profile", "C", "sync"),
    EventKind("sync", "synchronous packet", SYNC.reference, "S", "sync"),
    _kind("arbitration", "arbitration", "arbitration_us", "a", "contention"),
    _kind("request_data", "request data", "request_data_us", ">", "request"),
    _kind("acknowledge", "acknowledge", "acknowledge_us", "k", "acknowledge"),
    _kind("hold", "bus held for the response", "hold_us", "h", "response"),
    _kind("execution", "execution", "execution_us", "=", "work"),
    _kind("worst_extra", "slowest execution", "worst_extra_us", "x", "work"),
    _kind("response_data", "response data", "response_data_us", "<", "response"),
    _kind("subaction_gap", "subaction gap", "subaction_gap_us", ".", "gap"),
    _kind("arbitration_reset_gap", "arbitration reset gap", "arbitration_reset_gap_us", ":", "long-gap"),
    EventKind("node_wait", "wait of a node", "broadcast", "w", "gap"),
    EventKind("allowance", "allowance for a faster node", "idle", "+", "gap"),
    _kind("host", "host", "host_us", "o", "contention"),
    EventKind("retry", "busy retry", "profile", "r", "request"),
    EventKind("nonperiodic", "non-periodic window", NONPERIODIC.reference, "N", "reserve"),
)
"""Kinds of events, in the order of the cycle."""
STRETCHES: Final = (
    EventKind("read", "reads", "", "R", "in"),
    EventKind("write", "writes", "", "W", "out"),
)
"""Stretches that several events make together."""


class CycleWithStarts(BusCycle):
    """One communication cycle; what the host and the nodes send in it is that of a schedule.

    References
    ----------
    Linux, drivers/firewire/core.h: a cycle start goes each 125 us.
    """

    term_figures = TERMS
    command_events = (("write", "request_data"), ("write", "execution"), ("write", "worst_extra"))
    model: TimingModelName

    def __init__(self, network: Network, model: TimingModelName) -> None:
        self.network = network
        self.model = model
        self.link = link_of(network)

    @abstractmethod
    def schedule(self) -> Iterator[BusEvent | Run]:
        """The cycle in the order of its protocol, without retries and the window, which follow it."""

    @property
    @abstractmethod
    def longest_request_us(self) -> Number:
        """Data phase of the longest packet that the host sends to a node [us]."""

    @cached_property
    def delays(self) -> Delays:
        """Delays of any packet, over the hops of the farthest node."""
        return self.delays_of(self.link, None)

    def delays_of(self, link: Link, shared: Delays | None) -> Delays:
        """Arbitration, acknowledge and gaps over some way, with their names for a derivation.

        Parameters
        ----------
        link
            The way.
        shared
            The delays over other hops of the bus, where they have been computed.
        """
        own = delays(link, model=TIMING_MODELS[self.model], alone=self.network.nodes == 1, shared=shared)
        for key, number in (
            ("arbitration_us", own.arbitration_us),
            ("acknowledge_us", own.acknowledge_us),
            ("subaction_gap_us", own.gaps.subaction_us),
            ("arbitration_reset_gap_us", own.gaps.arbitration_reset_us),
            ("gaps_us", own.gaps.both_us),
        ):
            named(number, key, LATENCY_SYMBOLS[key])
        return own

    @cached_property
    def cycle_start_us(self) -> Number:
        """Cost of a cycle start: it destroys idle time already run, and goes at S100 [us]."""
        own, link = self.delays, self.link
        data_us = equations.data_phase_us(
            link.hops, hop_us=own.hop_us, packet_bytes=CYCLE_START_BYTES, data_rate_mbit_s=DATA_RATE_MBIT_S["S100"]
        )
        isochronous_us: Number = self.network.profile.bus.isochronous_us
        return own.gaps.arbitration_reset_us + own.arbitration_us + data_us + isochronous_us

    def starts(self, others_us: Number) -> Number:
        """Number of cycle starts in a cycle whose other terms take some time [1].

        The smallest whole n with n > (others + n start) / 125 us. Starts that leave less than 1 us to each other are
        counted as if they left that: the number is finite, and the limit of cycle starts is broken.

        Parameters
        ----------
        others_us
            All other terms [us]; of any sort.
        """
        left_us = CYCLE_US - self.cycle_start_us
        return rounded_down(others_us / larger(left_us, LEAST_ASYNCHRONOUS_US)) + 1

    @property
    def _has_starts(self) -> bool:
        return self.model != "paper" and bool(self.network.profile.bus.cycle_master)

    @cached_property
    def _others_by_term(self) -> dict[str, Number]:
        return summed(self.runs, (figure.key for figure in TERMS))

    @cached_property
    def _others_us(self) -> Number:
        return total(self._others_by_term.values())

    @cached_property
    def number_of_starts(self) -> Number:
        """Cycle starts in the cycle [1]."""
        return self.starts(self._others_us) if self._has_starts else 0

    def written(self) -> Iterator[BusEvent | Run]:
        """All but the cycle starts: these go between its rounds, and their number rests on it."""
        yield from self.schedule()
        retries: Number = self.network.profile.cycle.retries
        if self.model != "paper" and not is_off(retries):
            own, longest_us = self.delays, self.longest_request_us
            retry_us = own.arbitration_us + longest_us + own.acknowledge_us + own.gaps.arbitration_reset_us
            yield Run((BusEvent("retry", "retries_us", retry_us, "busy retry of the longest request"),), retries)
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    @property
    def _start(self) -> BusEvent:
        return BusEvent("cycle_start", "cycle_starts_us", self.cycle_start_us, "cycle start")

    @cached_property
    def by_term(self) -> Mapping[str, Number]:
        """Time of each term, by its key [us]."""
        starts = (Run((self._start,), self.number_of_starts),) if self._has_starts else ()
        return self._others_by_term | summed(starts, (self._start.term,))

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:
        """Growth of the cycle if its transactions take longer: there may be more cycle starts, too [us]."""
        if not self._has_starts:
            return extra_us
        before_us = self._others_us + after_us
        more = self.starts(before_us + extra_us) - self.starts(before_us)
        return extra_us + more * self.cycle_start_us

    def taking_us(self, group: Group) -> float:
        """Nothing after a split write, which holds the execution; else the node executes beside the bus [us]."""
        is_split = group.node.write_response == "split" and not is_broadcast(self.network)
        return 0.0 if is_split else super().taking_us(group)

    def loop_periods(self, *, at_sync: bool) -> int:
        """One, or more where a node has not executed its command when the next synchronous packet comes."""
        if not at_sync:
            return 0
        behind_us = max(self.taking_us(group) for group in self.network.groups)
        period_us = plain(self.network.period_us)
        needed_us = min(plain(self.required_us), period_us)
        return max(1, ceil((needed_us + behind_us) / period_us)) if behind_us else 1

    def setup(self) -> dict[str, Number]:
        """Settings of the bus, by key of their figures."""
        safe = safe_gap_count(self.link.hops)
        return {
            "hops": self.link.hops,
            "gap_count": self.link.gap_count,
            "safe_gap_count": safe,
            "gap_count_safe": self.link.gap_count >= named(safe, "safe_gap_count", "g_safe"),
        }

    @property
    def is_known(self) -> bool:
        """Whether bias and doubts of the model are known: those of `standard`, which decides, are."""
        return self.model == "standard"

    def left_out(self) -> tuple[LeftOut, ...]:
        """Host time, where the profile does not say it."""
        return () if self.network.profile.host.transaction_us else (LeftOut("host time", "host.transaction_us"),)

    def each_round(self) -> Iterator[Iterable[BusEvent]]:
        """The cycle in the order of its protocol, node by node; a cycle start goes when it is due, or at the end."""
        starts, start_us = int(plain(self.number_of_starts)), plain(self.cycle_start_us)
        start = (self._start._replace(us=start_us),)
        sent, now_us = 0, 0.0
        for events in map(tuple, super().each_round()):
            while sent < starts and now_us >= sent * CYCLE_US:
                yield start
                sent, now_us = sent + 1, now_us + start_us
            yield events
            for event in events:
                now_us += plain(event.us)
        yield from repeat(start, starts - sent)

    def added_before_us(self, sent_us: float) -> float:
        """The cycle starts that are due before a round [us]."""
        due = smaller(self.starts(sent_us), self.number_of_starts)
        return plain(due) * plain(self.cycle_start_us)
