"""What every schedule of an IEEE 1394 bus has: its delays, its busy retries, the cycle starts between its packets."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import chain, repeat
from math import ceil

from busplan.buses.cycle import BusCycle, BusEvent, LeftOut, Term
from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import (
    CYCLE_START_BYTES,
    CYCLE_US,
    DATA_RATE_MBIT_S,
    LEAST_ASYNCHRONOUS_US,
    safe_gap_count,
)
from busplan.buses.ieee1394.timing import TIMING_MODELS, Delays, Link, TimingModelName, delays
from busplan.buses.ieee1394.transactions import LATENCY_SYMBOLS, is_broadcast, link_of
from busplan.buses.network import Group, Network
from busplan.elementwise import Number, is_off, larger, named, plain, rounded_down, total


class CycleWithStarts(BusCycle):
    """One communication cycle; what the host and the nodes send in it is that of a schedule.

    References
    ----------
    Linux, drivers/firewire/core.h: a cycle start goes each 125 us.
    """

    model: TimingModelName

    def __init__(self, network: Network, model: TimingModelName) -> None:
        self.network = network
        self.model = model
        self.link = link_of(network)

    @cached_property
    @abstractmethod
    def other_terms(self) -> tuple[Term, ...]:
        """All terms but the cycle starts, whose number follows from them."""

    @property
    @abstractmethod
    def longest_request_us(self) -> Number:
        """Data phase of the longest packet that the host sends to one node [us]."""

    @abstractmethod
    def stretches(self) -> Iterable[Sequence[BusEvent]]:
        """The cycle in the order of its protocol, by what no cycle start interrupts."""

    @cached_property
    def delays(self) -> Delays:
        """What does not depend on the packet, over the hops of the farthest node."""
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
        found = delays(link, model=TIMING_MODELS[self.model], alone=self.network.nodes == 1, shared=shared)
        for key, number in (
            ("arbitration_us", found.arbitration_us),
            ("acknowledge_us", found.acknowledge_us),
            ("subaction_gap_us", found.gaps.subaction_us),
            ("arbitration_reset_gap_us", found.gaps.arbitration_reset_us),
            ("gaps_us", found.gaps.both_us),
        ):
            named(number, key, LATENCY_SYMBOLS[key])
        return found

    @cached_property
    def retries_us(self) -> Number:
        """Busy retries of the longest request, each with an arbitration reset gap [us]."""
        retries: Number = self.network.profile.cycle.retries
        if self.model == "paper" or is_off(retries):
            return 0.0
        own, longest_us = self.delays, self.longest_request_us
        return retries * (own.arbitration_us + longest_us + own.acknowledge_us + own.gaps.arbitration_reset_us)

    @cached_property
    def cycle_start_us(self) -> Number:
        """What one cycle start costs: it destroys idle time already run, and goes at S100 [us]."""
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
    def _others_us(self) -> Number:
        return total(one.us for one in self.other_terms)

    @cached_property
    def number_of_starts(self) -> Number:
        """Cycle starts in the cycle [1]."""
        return self.starts(self._others_us) if self._has_starts else 0

    def computed_terms(self) -> tuple[Term, ...]:
        """The cycle in the order of the wire."""
        starts_us = self.number_of_starts * self.cycle_start_us if self._has_starts else 0.0
        return (Term("cycle_starts_us", starts_us), *self.other_terms)

    def added_us(self, extra_us: Number, *, after_us: Number = 0.0) -> Number:
        """What the cycle grows by if its transactions take longer: there may be more cycle starts, too [us]."""
        if not self._has_starts:
            return extra_us
        before_us = self._others_us + after_us
        more = self.starts(before_us + extra_us) - self.starts(before_us)
        return extra_us + more * self.cycle_start_us

    def taking_us(self, group: Group) -> float:
        """Nothing behind a split write, which holds the execution; else the node executes beside the bus [us]."""
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
        """How the bus is set, by key of its figures."""
        safe = safe_gap_count(self.link.hops)
        return {
            "hops": self.link.hops,
            "gap_count": self.link.gap_count,
            "safe_gap_count": safe,
            "gap_count_safe": self.link.gap_count >= named(safe, "safe_gap_count", "g_safe"),
        }

    @property
    def is_known(self) -> bool:
        """Whether the error of the model is known: of the one that decides."""
        return self.model == "standard"

    def left_out(self) -> tuple[LeftOut, ...]:
        """What the cycle could have and does not say: host time."""
        return () if self.network.profile.host.transaction_us else (LeftOut("host time", "host.transaction_us"),)

    def events(self) -> Iterator[BusEvent]:
        """The cycle in the order of its protocol, node by node; a cycle start goes when it is due, or at the end."""
        starts = self.number_of_starts
        sent, now_us = 0, 0.0
        start = BusEvent("cycle_start", "cycle_starts_us", plain(self.cycle_start_us) if starts else 0.0, "cycle start")
        for stretch in chain(self.stretches(), self._behind()):
            while sent < starts and now_us >= sent * CYCLE_US:
                yield start
                sent, now_us = sent + 1, now_us + start.us
            for event in stretch:
                yield event
                now_us += event.us
        for _ in range(int(starts) - sent):
            yield start

    def _behind(self) -> Iterator[tuple[BusEvent]]:
        """Retries and the non-periodic window, behind what a schedule sends."""
        retries = 0 if self.model == "paper" else self.network.profile.cycle.retries
        if retries:
            retry_us = plain(self.retries_us) / retries
            yield from repeat(
                (BusEvent("retry", "retries_us", retry_us, "busy retry of the longest request"),), retries
            )
        yield (BusEvent("nonperiodic", "nonperiodic_us", plain(self.network.nonperiodic_us), "non-periodic window"),)
