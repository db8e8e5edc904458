"""SERCOS I and II: sourced figures, lengths of telegrams, and the cycle."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

from busplan.buses.cycle import ALL, BUT_FIRST, BusEvent, BusLatency, Doubt, Premise, Run
from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, OwnFigures
from busplan.buses.limits import Periods
from busplan.buses.network import Network
from busplan.buses.parts import EventKind
from busplan.buses.sercos.shared import DELAYS, SercosCycle, delays, word_bytes
from busplan.elementwise import Number, choose, rounded_down, step, total
from busplan.sourced import Constants

DataRate = Literal[2, 4, 8, 16]
"""Data rates [Mbit/s]."""

c: Final = Constants("busplan.buses.sercos", "shared.toml", "sercos2.toml")
"""Constants with a source, by their names."""

_STEP_US: Final = 1000
_LONGEST_US: Final = 65_000
PERIODS: Final = Periods((62.5, 125.0, 250.0, 500.0, *map(float, range(_STEP_US, _LONGEST_US + 1, _STEP_US))))
"""Communication periods [us], from sercos.com, cycle times; the longest from Rexroth."""


def telegram_bits(data_bytes: Number, *, is_stuffed: bool) -> Number:
    """Length of a telegram with its flags [bits].

    16 + 8 (s + 3) bits for s data bytes, and with `is_stuffed` the stuff bits of the worst case, floor(8 (s + 3) / 5).
    Floats and arrays are taken.

    Examples
    --------
    >>> telegram_bits(1, is_stuffed=True), telegram_bits(1, is_stuffed=False)
    (54.0, 48.0)
    """
    stuffable: Number = (data_bytes + c.FRAME_BYTES) * c.BITS_PER_BYTE
    bits = stuffable + c.FLAG_BITS
    return bits + rounded_down(stuffable / c.STUFF_STEP_BITS) if is_stuffed else bits


def telegram_us(data_bytes: Number, *, data_rate_mbit_s: Number, is_stuffed: bool) -> Number:
    """Time of a telegram on the ring [us]; see `telegram_bits`.

    Examples
    --------
    >>> telegram_us(1, data_rate_mbit_s=4, is_stuffed=True)
    13.5
    """
    return telegram_bits(data_bytes, is_stuffed=is_stuffed) / data_rate_mbit_s


def start_us(data_rate_mbit_s: Number) -> Number:
    """Time from MST to the first AT, where the drives give no other time [us].

    Examples
    --------
    >>> start_us(4), start_us(16)
    (12.0, 4.0)
    """
    return choose(data_rate_mbit_s > c.SLOW_MBIT_S, c.FAST_START_US, c.SLOW_START_US)


_IEC: Final = "IEC 61491"

DATA_RATE: Final = Figure(
    "data_rate_mbit_s", "f", "profile", "data rate of the ring", "data rate, Mbit/s", sort="count"
)
MDT_BYTES: Final = Figure(
    "mdt_bytes", "s_MDT", _IEC, "data of the master data telegram", "data of the MDT", sort="count"
)
TERMS: Final = (
    Figure("cycle_mst_us", "MST", _IEC, "synchronisation telegram", "MST", ink="sync", letter="S"),
    Figure("cycle_at_us", "AT", _IEC, "telegrams of all drives", "AT", ink="in", letter="A"),
    Figure("cycle_gap_us", "gap", "profile", "gaps between the telegrams of two drives", "gaps", ink="gap", letter="G"),
    Figure("cycle_mdt_us", "MDT", _IEC, "master data telegram", "MDT", ink="out", letter="M"),
    Figure(
        "cycle_wait_us",
        "wait",
        "profile",
        "wait for the drives: before the first AT, after the last, after the MDT",
        "wait for drives",
        ink="work",
        letter="W",
        waits_for="nodes",
    ),
    NONPERIODIC,
)
FIGURES: Final = BusFigures(
    TERMS,
    setup=(DATA_RATE,),
    headings=(DATA_RATE.key,),
    added=(MDT_BYTES,),
    table=(MDT_BYTES,),
    compared=(MDT_BYTES,),
    latency_rows=DELAYS,
)


@dataclass(frozen=True)
class Sercos2Figures(OwnFigures):
    """Figures of SERCOS I and II alone, by the keys of `FIGURES`."""

    data_rate_mbit_s: int
    mdt_bytes: int
    cycle_mst_us: float
    cycle_at_us: float
    cycle_gap_us: float
    cycle_mdt_us: float
    cycle_wait_us: float
    nonperiodic_us: float


TimingModelName = Literal["worst-stuffing", "no-stuffing"]
WORST: Final[TimingModelName] = "worst-stuffing"
NONE: Final[TimingModelName] = "no-stuffing"
_GAP: Final = "gap between the AT of two drives"


_TELEGRAMS: Final = MDT_BYTES.reference
EVENTS: Final = (
    EventKind("mst", "MST", _TELEGRAMS, "S", "sync"),
    EventKind("wait", "wait for drives", "profile", "=", "work"),
    EventKind("at", "AT of a drive", _TELEGRAMS, "<", "in"),
    EventKind("gap", "gap between two drives", "profile", ",", "gap"),
    EventKind("record", "record of a drive", _TELEGRAMS, ">", "out"),
    EventKind("mdt", "MDT, all but the records", _TELEGRAMS, "m", "request"),
    EventKind("nonperiodic", "non-periodic window", NONPERIODIC.reference, "N", "reserve"),
)
"""Kinds of events in the order of the cycle."""
STRETCHES: Final = (
    EventKind("at_stretch", "AT", "", "A", "in"),
    EventKind("mdt_stretch", "MDT", "", "M", "out"),
)
"""Kinds of stretches, each a sequence of events."""


PREMISES: Final = (
    Premise("bus.recovery_us", "no recovery after the MDT", 50.0),
    Premise("bus.at_start_us", "the first AT as early as it can be"),
    Premise("bus.turnaround_us", "the published turn-around"),
    Premise("bus.at_gap_us", "the usual gap between drives"),
    Premise("bus.pipeline_cycles", "commands one cycle later", 2),
)


class Sercos2Cycle(SercosCycle):
    """MST, t1, an AT of each drive with gaps between them, t_ATMT, the MDT, and the drives' recovery."""

    term_figures = TERMS
    record = Sercos2Figures
    premises = PREMISES

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.is_stuffed = model == WORST

    def _telegram_us(self, data_bytes: Number) -> Number:
        rate: Number = self.network.profile.bus.data_rate_mbit_s
        return telegram_us(data_bytes, data_rate_mbit_s=rate, is_stuffed=self.is_stuffed)

    @cached_property
    @step("s_MDT")
    def mdt_bytes(self) -> Number:
        """Data of the MDT, one record for each drive [bytes]."""
        return total((word_bytes(group.write_bytes) + c.RECORD_BYTES) * group.nodes for group in self.network.groups)

    @cached_property
    def start_us(self) -> Number:
        """Time from MST to the first AT [us]."""
        bus = self.network.profile.bus
        given_us: Number | None = bus.at_start_us
        return start_us(bus.data_rate_mbit_s) if given_us is None else given_us

    def written(self) -> Iterator[BusEvent | Run]:
        """MST, the telegrams of all drives, the MDT and its records, with the waits and gaps between them."""
        bus = self.network.profile.bus
        yield BusEvent("mst", "cycle_mst_us", self._telegram_us(c.MST_BYTES), "MST")
        yield BusEvent("wait", "cycle_wait_us", self.start_us, "wait before the first AT")
        for place, group in enumerate(self.network.groups):
            rounds = ALL if place else BUT_FIRST
            at_us = self._telegram_us(word_bytes(group.read_bytes) + c.RECORD_BYTES)
            gap = BusEvent("gap", "cycle_gap_us", bus.at_gap_us, _GAP, rests_on="bus.at_gap_us", rounds=rounds)
            at = BusEvent("at", "cycle_at_us", at_us, "AT of a drive", transaction="at_stretch")
            yield Run((gap, at), group.nodes, place)
        yield BusEvent("wait", "cycle_wait_us", bus.turnaround_us, "wait after the last AT")
        mdt = BusEvent("mdt", "cycle_mdt_us", self._telegram_us(self.mdt_bytes), "MDT", transaction="mdt_stretch")
        yield Run((mdt,), laid_out=lambda _: self._records(mdt.us))
        yield BusEvent("wait", "cycle_wait_us", bus.recovery_us, "recovery of the drives after the MDT")
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "non-periodic window")

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubt of the gap between two drives, which is the same in the whole cycle."""
        return (Doubt("bus.at_gap_us", "gap between two drives", self.by_term["cycle_gap_us"] * c.GAP_SHARE),)

    def figures(self) -> Mapping[str, Number | None]:
        """Data rate, and data of the MDT."""
        return {"data_rate_mbit_s": self.network.profile.bus.data_rate_mbit_s, "mdt_bytes": self.mdt_bytes}

    @property
    def feedback_due_us(self) -> Number:
        """Time by which feedback must be ready [us]: 0, the start of MST."""
        return 0.0

    def both_delays(self) -> tuple[BusLatency, BusLatency]:
        """Age of feedback when the host has it, and delay of a command up to its effect."""
        sent = self.by_term
        before_us = sent["cycle_mst_us"] + self.start_us
        ats_us = sent["cycle_at_us"] + sent["cycle_gap_us"]
        turned_us = before_us + ats_us + self.network.profile.bus.turnaround_us
        return delays(self.network, feedback_us=(before_us, ats_us), command_us=(turned_us, sent["cycle_mdt_us"]))

    def _records(self, mdt_us: float) -> Iterator[BusEvent]:
        """Record of each drive, then the rest of the MDT: flags, address, check sequence and stuff bits."""
        rate, records_us, node = self.network.profile.bus.data_rate_mbit_s, 0.0, 0
        for group in self.network.groups:
            record_us = 8 * (word_bytes(group.write_bytes) + c.RECORD_BYTES) / rate
            for _ in range(int(group.nodes)):
                node += 1
                records_us += record_us
                yield BusEvent("record", "cycle_mdt_us", record_us, "record of a drive", node, "mdt_stretch")
        rest_us = mdt_us - records_us
        yield BusEvent("mdt", "cycle_mdt_us", rest_us, "MDT, all but the records", None, "mdt_stretch")
