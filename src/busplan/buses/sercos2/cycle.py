"""The cycle of SERCOS I and II: MST, the telegrams of all drives, and one telegram to all of them."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Final, Literal

from busplan.buses.cycle import BusEvent, BusLatency, Doubt, LeftOut, Term
from busplan.buses.network import Network
from busplan.buses.sercos import SercosCycle, delays, word_bytes
from busplan.buses.sercos2.equations import GAP_SHARE, MST_BYTES, RECORD_BYTES, start_us, telegram_us
from busplan.elementwise import Number, named, plain, total

TimingModelName = Literal["worst-stuffing", "no-stuffing"]
WORST: Final[TimingModelName] = "worst-stuffing"
NONE: Final[TimingModelName] = "no-stuffing"
_RESTS_ON: Final = {"cycle_gap_us": "bus.at_gap_us"}
"""The key that a term comes from alone."""


class Sercos2Cycle(SercosCycle):
    """MST, t1, one AT of each drive with gaps between them, t_ATMT, the MDT, and the drives' recovery."""

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.is_stuffed = model == WORST

    def _telegram_us(self, data_bytes: Number) -> Number:
        rate: Number = self.network.profile.bus.data_rate_mbit_s
        return telegram_us(data_bytes, data_rate_mbit_s=rate, is_stuffed=self.is_stuffed)

    @cached_property
    def _ats_us(self) -> tuple[Number, ...]:
        """The AT of a drive of each group [us]."""
        return tuple(self._telegram_us(word_bytes(one.read_bytes) + RECORD_BYTES) for one in self.network.groups)

    @cached_property
    def mdt_bytes(self) -> Number:
        """Data of the MDT, a record for each drive [bytes]."""
        found = total((word_bytes(one.write_bytes) + RECORD_BYTES) * one.nodes for one in self.network.groups)
        return named(found, "mdt_bytes", "s_MDT")

    @cached_property
    def start_us(self) -> Number:
        """From MST to the first AT [us]."""
        bus = self.network.profile.bus
        said: Number | None = bus.at_start_us
        return start_us(bus.data_rate_mbit_s) if said is None else said

    @cached_property
    def _sent_us(self) -> dict[str, Number]:
        bus = self.network.profile.bus
        pairs = zip(self.network.groups, self._ats_us, strict=True)
        return {
            "cycle_mst_us": self._telegram_us(MST_BYTES),
            "cycle_at_us": total(us * one.nodes for one, us in pairs),
            "cycle_gap_us": (self.network.nodes - 1) * bus.at_gap_us,
            "cycle_mdt_us": self._telegram_us(self.mdt_bytes),
            "cycle_wait_us": self.start_us + bus.turnaround_us + bus.recovery_us,
            "nonperiodic_us": self.network.nonperiodic_us,
        }

    def computed_terms(self) -> tuple[Term, ...]:
        """The telegrams, the gaps, and the waits for the drives."""
        return tuple(Term(key, us, _RESTS_ON.get(key, "")) for key, us in self._sent_us.items())

    def doubts(self) -> tuple[Doubt, ...]:
        """The gap between two drives, which is the same in the whole cycle."""
        return (Doubt("bus.at_gap_us", "gap between two drives", self._sent_us["cycle_gap_us"] * GAP_SHARE),)

    def left_out(self) -> tuple[LeftOut, ...]:
        """The drives' recovery behind the MDT."""
        said = self.network.profile.bus.recovery_us
        return () if said else (LeftOut("the recovery of the drives behind the MDT", "bus.recovery_us"),)

    def figures(self) -> Mapping[str, Number | None]:
        """The data rate, and the data of the MDT."""
        return {"data_rate_mbit_s": self.network.profile.bus.data_rate_mbit_s, "mdt_bytes": self.mdt_bytes}

    @property
    def feedback_due_us(self) -> Number:
        """Feedback is that of the start of MST [us]."""
        return 0.0

    def latencies(self) -> tuple[BusLatency, ...]:
        """How old feedback is when the host has it, and how late a command takes effect."""
        sent = self._sent_us
        before_us = sent["cycle_mst_us"] + self.start_us
        ats_us = sent["cycle_at_us"] + sent["cycle_gap_us"]
        turned_us = before_us + ats_us + self.network.profile.bus.turnaround_us
        return delays(self.network, feedback_us=(before_us, ats_us), command_us=(turned_us, sent["cycle_mdt_us"]))

    def events(self) -> Iterator[BusEvent]:
        """Telegram by telegram, and in the MDT drive by drive."""
        bus = self.network.profile.bus
        yield BusEvent("mst", "cycle_mst_us", plain(self._sent_us["cycle_mst_us"]), "MST")
        yield BusEvent("wait", "cycle_wait_us", plain(self.start_us), "wait before the first AT")
        node = 0
        for one, us in zip(self.network.groups, self._ats_us, strict=True):
            for _ in range(int(plain(one.nodes))):
                node += 1
                if node > 1:
                    yield BusEvent("gap", "cycle_gap_us", plain(bus.at_gap_us), "gap between the AT of two drives")
                yield BusEvent("at", "cycle_at_us", plain(us), "AT of a drive", node, "at_stretch")
        yield BusEvent("wait", "cycle_wait_us", plain(bus.turnaround_us), "wait behind the last AT")
        yield from self._mdt_events()
        yield BusEvent("wait", "cycle_wait_us", plain(bus.recovery_us), "recovery of the drives behind the MDT")
        yield BusEvent("nonperiodic", "nonperiodic_us", plain(self.network.nonperiodic_us), "non-periodic window")

    def _mdt_events(self) -> Iterator[BusEvent]:
        """The record of each drive, then all else of the MDT: flags, address, check sequence and stuff bits."""
        rate, whole_us, records_us, node = (
            plain(self.network.profile.bus.data_rate_mbit_s),
            plain(self._sent_us["cycle_mdt_us"]),
            0.0,
            0,
        )
        for one in self.network.groups:
            record_us = 8 * (plain(word_bytes(one.write_bytes)) + RECORD_BYTES) / rate
            for _ in range(int(plain(one.nodes))):
                node += 1
                records_us += record_us
                yield BusEvent("record", "cycle_mdt_us", record_us, "record of a drive", node, "mdt_stretch")
        yield BusEvent("mdt", "cycle_mdt_us", whole_us - records_us, "MDT, all but the records", None, "mdt_stretch")
