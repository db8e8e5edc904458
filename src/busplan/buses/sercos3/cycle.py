"""The cycle of SERCOS III: MDT, AT, the channel for other frames, and what the window of the master keeps free."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Final, Literal

from busplan.buses.cycle import BusCycle, BusEvent, BusLatency, LeftOut, Term
from busplan.buses.network import Network
from busplan.buses.sercos import delays
from busplan.buses.sercos3.constants import (
    BYTE_US,
    CHANNEL_US,
    HARDWARE_CHANNELS,
    HEADER_US,
    MOST_BYTES,
    OVERHEAD_BYTES,
)
from busplan.buses.sercos3.equations import (
    Filling,
    padded_bytes,
    ring_delay_us,
    sync_jitter_us,
    telegrams_us,
)
from busplan.buses.sercos3.telegrams import SORTS, Telegrams, telegrams_of
from busplan.elementwise import Number, larger, named, plain, smaller
from busplan.sections.transactions import TransactionKind

TimingModelName = Literal["window", "telegrams"]
WINDOW: Final[TimingModelName] = "window"
TELEGRAMS: Final[TimingModelName] = "telegrams"


class Sercos3Cycle(BusCycle):
    """MDT, AT, the channel for other frames, and under the model `window` jitter, the master and the ring.

    The window is that of CoSeMa: by the timing method it asks that the channel for other frames ends before the next
    cycle begins, or before the AT do. What the nodes execute runs beside the telegrams.
    """

    def __init__(self, network: Network, model: str) -> None:
        self.network = network
        self.is_window = model == WINDOW
        self.method: str = network.profile.bus.timing_method

    @cached_property
    def fillings(self) -> dict[TransactionKind, Filling]:
        """MDT and AT, filled."""
        return {kind: telegrams_of(self.network, kind).filling for kind in SORTS}

    def _telegrams_us(self, kind: TransactionKind) -> Number:
        return telegrams_us(self.fillings[kind], gap_bytes=self.network.profile.bus.gap_bytes)

    @cached_property
    def jitter_us(self) -> Number:
        """Jitter of the synchronisation [us]."""
        bus = self.network.profile.bus
        return named(sync_jitter_us(bus.master_jitter_us, gap_bytes=bus.gap_bytes), "sync_jitter_us", "J")

    @cached_property
    def ring_us(self) -> Number:
        """Delay of the ring; none under the model `telegrams` [us]."""
        bus = self.network.profile.bus
        if not self.is_window:
            return 0.0
        delay_us: Number = bus.device_delay_us
        found = ring_delay_us(self.network.nodes, device_delay_us=delay_us, gap_bytes=bus.gap_bytes)
        return named(found, "ring_delay_us", "t_ring")

    def _kept_us(self) -> tuple[Number, Number, Number]:
        """What the window keeps free for jitter, the master, and the ring [us]."""
        if not self.is_window:
            return 0.0, 0.0, 0.0
        delay_us: Number = self.network.profile.bus.master_delay_us
        if self.method == "mdt-at-ucc":
            return 3 * self.jitter_us, delay_us + HEADER_US, 0.0
        channels_us = smaller(self.network.nodes, HARDWARE_CHANNELS) * CHANNEL_US
        jitters = 2 if self.method == "at-last" else 3
        return jitters * self.jitter_us, larger(delay_us, channels_us - self.jitter_us), self.ring_us

    def computed_terms(self) -> tuple[Term, ...]:
        """The telegrams, and what the window keeps free."""
        jitter_us, master_us, ring_us = self._kept_us()
        return (
            Term("cycle_mdt_us", self._telegrams_us("write")),
            Term("cycle_at_us", self._telegrams_us("read")),
            Term("cycle_jitter_us", jitter_us),
            Term("cycle_master_us", master_us),
            Term("cycle_ring_us", ring_us),
            Term("nonperiodic_us", self.network.nonperiodic_us),
        )

    def left_out(self) -> tuple[LeftOut, ...]:
        """The channel for other frames."""
        return () if self.network.nonperiodic_us else (LeftOut("the channel for other frames", "cycle.nonperiodic_us"),)

    def figures(self) -> Mapping[str, Number | None]:
        """How many telegrams there are."""
        return {f"{sort}_telegrams": self.fillings[kind].telegrams for kind, sort in SORTS.items()}

    def _start_us(self) -> Number:
        """From the start of a cycle in the master to the first byte: its delay ends with the first header [us]."""
        if not self.is_window:
            return 0.0
        delay_us: Number = self.network.profile.bus.master_delay_us
        return larger(delay_us - HEADER_US, 0.0)

    def latencies(self) -> tuple[BusLatency, ...]:
        """How old feedback is when the host has it, and how late a command takes effect."""
        return delays(
            self.network,
            feedback_us=(0.0, self._telegrams_us("read")),
            command_us=(self._start_us(), self._telegrams_us("write")),
            ring_us=self.ring_us,
        )

    def events(self) -> Iterator[BusEvent]:
        """Telegram by telegram and device by device."""
        jitter_us, master_us, ring_us = map(plain, self._kept_us())
        other = BusEvent(
            "nonperiodic", "nonperiodic_us", plain(self.network.nonperiodic_us), "channel for other frames"
        )
        is_last = self.method == "mdt-at-ucc"
        yield from self._sent("write")
        yield from () if is_last else (other,)
        yield from self._sent("read")
        yield BusEvent("ring", "cycle_ring_us", ring_us, "the last telegram goes round the ring")
        yield from (other,) if is_last else ()
        yield BusEvent("jitter", "cycle_jitter_us", jitter_us, "allowances for the jitter")
        yield BusEvent("master", "cycle_master_us", master_us, "the master's own time before the next cycle")

    def _sent(self, kind: TransactionKind) -> Iterator[BusEvent]:
        """All telegrams of one sort."""
        sort, gap = SORTS[kind], self.network.profile.bus.gap_bytes
        term = f"cycle_{sort}_us"
        for number, telegram in enumerate(_laid_out(telegrams_of(self.network, kind))):
            label, data = f"{sort.upper()}{number}", [(size, node) for size, node in telegram if node]
            used = sum(size for size, _ in telegram)
            fields = used - sum(size for size, _ in data)
            head_us = (OVERHEAD_BYTES + fields) * BYTE_US
            yield BusEvent(f"{sort}_frame", term, head_us, f"{label}: its own fields", None, sort)
            for size, node in data:
                yield BusEvent(f"{sort}_data", term, size * BYTE_US, f"{label}: data of a device", node, sort)
            padding_us = (plain(padded_bytes(used)) - used) * BYTE_US
            yield BusEvent("gap", term, padding_us + gap * BYTE_US, f"gap behind {label}", None, sort)


def _laid_out(telegrams: Telegrams) -> list[list[tuple[float, int]]]:
    """The pieces of each telegram of plain numbers: bytes, and the device whose data they are; 0 for other fields."""
    found = [[(plain(telegrams.first_bytes), 0)]]
    used, node = plain(telegrams.first_bytes), 0
    for place, items in enumerate(telegrams.items):
        size, has_owner = plain(items.size_bytes), place >= _FIELDS
        for _ in range(int(plain(items.pieces))):
            if used + size > MOST_BYTES:
                used = plain(telegrams.next_bytes)
                found.append([(used, 0)])
            node += has_owner
            found[-1].append((size, node if has_owner else 0))
            used += size
    return found


_FIELDS: Final = 2
"""Items before the data of devices: service channels, and control or status."""
