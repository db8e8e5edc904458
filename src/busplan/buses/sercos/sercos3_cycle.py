"""The cycle of SERCOS III: MDT, AT, the channel for other frames, and the times that the master's window keeps free."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Final, Literal

from busplan.buses.cycle import BusEvent, BusLatency, Doubt, Premise, Run
from busplan.buses.figure import NONPERIODIC
from busplan.buses.network import Network
from busplan.buses.parts import EventKind
from busplan.buses.sercos.sercos3 import (
    MDT_TELEGRAMS,
    SORTS,
    TERMS,
    Filling,
    Sercos3Figures,
    Telegrams,
    c,
    padded_bytes,
    ring_delay_us,
    start_wait_us,
    sync_jitter_us,
    telegrams_of,
    telegrams_us,
)
from busplan.buses.sercos.shared import SercosCycle, delays
from busplan.elementwise import Number, choose, larger, smaller, total
from busplan.sections.base import TransactionKind

TimingModelName = Literal["window", "telegrams"]
WINDOW: Final[TimingModelName] = "window"
TELEGRAMS: Final[TimingModelName] = "telegrams"


_COSEMA: Final = MDT_TELEGRAMS.reference
EVENTS: Final = (
    EventKind("mdt_frame", "MDT, its own fields", _COSEMA, "m", "request"),
    EventKind("mdt_data", "data to a device", _COSEMA, ">", "out"),
    EventKind("wait", "wait of the devices", _COSEMA, "w", "sync"),
    EventKind("at_frame", "AT, its own fields", _COSEMA, "a", "response"),
    EventKind("at_data", "data of a device", _COSEMA, "<", "in"),
    EventKind("gap", "gap and padding", _COSEMA, ",", "gap"),
    EventKind("ring", "ring delay", _COSEMA, "o", "long-gap"),
    EventKind("jitter", "jitter allowance", _COSEMA, "j", "contention"),
    EventKind("master", "master", _COSEMA, "=", "work"),
    EventKind("nonperiodic", "channel for other frames", NONPERIODIC.reference, "N", "reserve"),
)
"""Kinds of events in the order of the cycle."""
STRETCHES: Final = (EventKind("mdt", "MDT", "", "M", "out"), EventKind("at", "AT", "", "A", "in"))
"""Kinds of stretches, each a sequence of events."""


PREMISES: Final = (
    Premise("bus.at_start_us", "no least time before the AT", 50.0),
    Premise("bus.device_delay_us", "published delays"),
    Premise("bus.component_delay_us", "published delays"),
    Premise("bus.master_delay_us", "a published master"),
    Premise("bus.master_jitter_us", "a published master"),
    Premise("bus.gap_bytes", "the usual gap between telegrams"),
    Premise("bus.pipeline_cycles", "commands one cycle later", 2),
)


class Sercos3Cycle(SercosCycle):
    """MDT, AT, the channel for other frames, and under the model `window` jitter, the master, the ring and the devices.

    The window is that of CoSeMa: depending on the timing method, the channel for other frames must end before the next
    cycle begins, or before the AT begin. Nodes execute beside the telegrams.
    """

    term_figures = TERMS
    record = Sercos3Figures
    premises = PREMISES

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.is_window = model == WINDOW
        self.method: str = network.profile.bus.timing_method

    @cached_property
    def fillings(self) -> dict[TransactionKind, Filling]:
        """MDT and AT, filled with their data."""
        return {kind: telegrams_of(self.network, kind).filling for kind in SORTS}

    def _telegrams_us(self, kind: TransactionKind) -> Number:
        return telegrams_us(self.fillings[kind], gap_bytes=self.network.profile.bus.gap_bytes)

    @cached_property
    def jitter_us(self) -> Number:
        """Jitter of the synchronisation [us]."""
        bus = self.network.profile.bus
        return sync_jitter_us(bus.master_jitter_us, gap_bytes=bus.gap_bytes)

    @cached_property
    def ring_us(self) -> Number:
        """Delay of the ring [us]; 0 under the model `telegrams`."""
        bus = self.network.profile.bus
        if not self.is_window:
            return 0.0
        delay_us: Number = bus.device_delay_us
        return ring_delay_us(
            self.network.nodes,
            device_delay_us=delay_us,
            gap_bytes=bus.gap_bytes,
            component_delay_us=bus.component_delay_us,
        )

    @property
    def _jitters(self) -> tuple[int, int]:
        """Number of jitters kept free: before the earliest AT, and in the whole cycle [1]."""
        return {"mdt-at-ucc": (1, 3), "mdt-ucc-at": (2, 3), "at-last": (1, 2)}[self.method]

    @property
    def _has_ring(self) -> bool:
        return self.is_window and self.method != "mdt-at-ucc"

    @cached_property
    def _master_us(self) -> Number:
        """Time that the window keeps free for the master [us]."""
        if not self.is_window:
            return 0.0
        delay_us: Number = self.network.profile.bus.master_delay_us
        if self.method == "mdt-at-ucc":
            return delay_us + c.HEADER_US
        channels_us = smaller(self.network.nodes, c.HARDWARE_CHANNELS) * c.CHANNEL_US
        return larger(delay_us, channels_us - self.jitter_us)

    @cached_property
    def _start_wait_us(self) -> Number:
        """Wait of the AT for the devices [us]."""
        least_us: Number | None = self.network.profile.bus.at_start_us
        return 0.0 if least_us is None or not self.is_window else start_wait_us(least_us, earliest_us=self._earliest_us)

    @property
    def _earliest_us(self) -> Number:
        """Earliest start of the AT, from the start of the cycle [us]."""
        before_us = self.network.nonperiodic_us if self._has_ring else 0.0
        return self._telegrams_us("write") + before_us + self._jitters[0] * self.jitter_us

    def written(self) -> Iterator[BusEvent | Run]:
        """The telegrams, the wait for the devices, and the times that the window keeps free."""
        channel = BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "channel for other frames")
        is_last = self.method == "mdt-at-ucc"
        jitter_us = self._jitters[1] * self.jitter_us if self.is_window else 0.0
        yield self._run("write")
        if not is_last:
            yield channel
        wait = "wait of the devices before the AT"
        yield BusEvent("wait", "cycle_wait_us", self._start_wait_us, wait, rests_on="bus.at_start_us")
        yield self._run("read")
        ring_us = self.ring_us if self._has_ring else 0.0
        yield BusEvent("ring", "cycle_ring_us", ring_us, "the last telegram goes round the ring")
        if is_last:
            yield channel
        yield BusEvent("jitter", "cycle_jitter_us", jitter_us, "allowances for the jitter")
        master = "the master's own time before the next cycle"
        yield BusEvent("master", "cycle_master_us", self._master_us, master, rests_on="bus.master_delay_us")

    def _run(self, kind: TransactionKind) -> Run:
        """All telegrams of one sort, which a timeline shows device by device."""
        sort = SORTS[kind]
        telegrams = BusEvent(f"{sort}_frame", f"cycle_{sort}_us", self._telegrams_us(kind), sort.upper())
        return Run((telegrams,), laid_out=lambda _: self._telegrams(kind))

    def doubts(self) -> tuple[Doubt, ...]:
        """Doubts of inputs that are published only as a range: a device's delay, the master's jitter, and the gap.

        Each is the same in the whole cycle. A wait for the devices may hide some of it.
        """
        bus = self.network.profile.bus
        if not self.is_window or bus.ring_grade == "measured":
            return ()
        jitters, rings = self._jitters[1], 1 if self._has_ring else 0
        count = total(filling.telegrams for filling in self.fillings.values())
        gap_us: Number = bus.gap_bytes * c.BYTE_US * (count + (jitters + rings) / 2)
        delays_us: Number = 2 * rings * self.network.nodes * bus.device_delay_us
        is_published: bool = bus.master_jitter_cycles is None
        jitter_us: Number = jitters / 2 * bus.master_jitter_us * c.MASTER_JITTER_SHARE if is_published else 0.0
        return (
            Doubt("bus.gap_bytes", "gap between telegrams", gap_us * c.GAP_SHARE),
            Doubt("bus.master_jitter_us", "jitter of the master", jitter_us),
            Doubt("bus.device_delay_us", "delay of the devices", delays_us * c.DEVICE_DELAY_SHARE),
        )

    def figures(self) -> Mapping[str, Number | None]:
        """Numbers of MDT and AT telegrams [1]."""
        return {f"{sort}_telegrams": self.fillings[kind].telegrams for kind, sort in SORTS.items()}

    def _start_us(self) -> Number:
        """Time from the start of a cycle in the master to the first byte [us]: its delay ends with the first header."""
        if not self.is_window:
            return 0.0
        delay_us: Number = self.network.profile.bus.master_delay_us
        return larger(delay_us - c.HEADER_US, 0.0)

    @property
    def feedback_due_us(self) -> Number:
        """Time by which feedback must be ready [us]: the first AT begins then; "at-last" ends the AT with the cycle."""
        mdt_us, sent = self._telegrams_us("write"), self.by_term
        if not self.is_window:
            return mdt_us
        if self.method == "at-last":
            behind_us = sent["cycle_at_us"] + sent["cycle_ring_us"] + self._master_us + self.jitter_us
            return self.network.period_us - behind_us
        start_us, other_us = mdt_us + self.jitter_us, self.network.nonperiodic_us
        if self.method == "mdt-ucc-at":
            start_us = choose(other_us > 0, start_us + self.jitter_us + other_us + self.ring_us, start_us)
        at_start_us = self.network.profile.bus.at_start_us
        return self._start_us() + (start_us if at_start_us is None else larger(start_us, at_start_us))

    def both_delays(self) -> tuple[BusLatency, BusLatency]:
        """Age of feedback when the host has it, and delay of a command up to its effect."""
        return delays(
            self.network,
            feedback_us=(0.0, self._telegrams_us("read")),
            command_us=(self._start_us(), self._telegrams_us("write")),
            ring_us=self.ring_us,
        )

    def _telegrams(self, kind: TransactionKind) -> Iterator[BusEvent]:
        """Events of all telegrams of one sort."""
        sort, gap = SORTS[kind], self.network.profile.bus.gap_bytes
        term = f"cycle_{sort}_us"
        for number, telegram in enumerate(_laid_out(telegrams_of(self.network, kind))):
            label, data = f"{sort.upper()}{number}", [(size, node) for size, node in telegram if node]
            used = sum(size for size, _ in telegram)
            fields = used - sum(size for size, _ in data)
            head_us = (c.OVERHEAD_BYTES + fields) * c.BYTE_US
            yield BusEvent(f"{sort}_frame", term, head_us, f"{label}: its own fields", None, sort)
            for size, node in data:
                yield BusEvent(f"{sort}_data", term, size * c.BYTE_US, f"{label}: data of a device", node, sort)
            padding_us = (padded_bytes(used) - used) * c.BYTE_US
            yield BusEvent("gap", term, padding_us + gap * c.BYTE_US, f"gap after {label}", None, sort)


def _laid_out(telegrams: Telegrams) -> list[list[tuple[float, int]]]:
    """Pieces of each telegram, in plain numbers: bytes, and the device whose data they are, 0 for other fields."""
    laid_out = [[(telegrams.first_bytes, 0)]]
    used, node = telegrams.first_bytes, 0
    for place, items in enumerate(telegrams.items):
        size, has_owner = items.size_bytes, place >= _FIELDS
        for _ in range(int(items.pieces)):
            if used + size > c.MOST_BYTES:
                used = telegrams.next_bytes
                laid_out.append([(used, 0)])
            node += has_owner
            laid_out[-1].append((size, node if has_owner else 0))
            used += size
    return laid_out


_FIELDS: Final = 2
"""Number of items before the data of devices: service channels, and control or status."""
