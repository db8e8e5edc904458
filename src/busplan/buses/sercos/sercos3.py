"""SERCOS III: sourced figures, and its telegrams."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import sqrt
from typing import Final, Literal, NamedTuple

from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, OwnFigures
from busplan.buses.limits import Periods
from busplan.buses.network import Network
from busplan.buses.sercos.shared import DELAYS, word_bytes
from busplan.elementwise import Number, choose, is_everywhere, larger, named, rounded_down, rounded_up, smaller, step
from busplan.sections.base import TransactionKind
from busplan.sourced import Constants

Version = Literal["V1.0", "V1.1"]
TimingMethod = Literal["mdt-at-ucc", "mdt-ucc-at", "at-last"]
HotPlug = Literal["first", "all"]

c: Final = Constants("busplan.buses.sercos", "shared.toml", "sercos3.toml")
"""Constants with a source, by their names."""
c.computed("DEVICE_DELAY_SHARE", lambda c: (c.DEVICE_DELAY_US - 0.5) / sqrt(12) / c.DEVICE_DELAY_US)
c.computed("MASTER_JITTER_SHARE", lambda c: 1 / sqrt(12) / c.MASTER_JITTER_US)
c.computed("GAP_SHARE", lambda c: (c.DEFAULT_GAP_BYTES - c.LEAST_GAP_BYTES) / sqrt(12) / c.DEFAULT_GAP_BYTES)

_STEP_US: Final = 250
_LONGEST_US: Final = 65_000
PERIODS: Final = Periods((31.25, 62.5, 125.0, *map(float, range(_STEP_US, _LONGEST_US + 1, _STEP_US))))
"""Communication periods [us], CSMD_TSCYC of CoSeMa."""


class Items(NamedTuple):
    """Pieces of data of one size, each of which stays whole; floats, arrays or traced numbers."""

    pieces: Number
    """Number of pieces [1]."""
    size_bytes: Number
    """Size of each piece [bytes]."""


class Filling(NamedTuple):
    """Filled telegrams of one sort, the last of them open; floats, arrays or traced numbers."""

    telegrams: Number
    """Number of telegrams, the open one included [1]."""
    closed_bytes: Number
    """Data of the telegrams before the open one [bytes]."""
    open_bytes: Number
    """Data of the open telegram [bytes]."""

    @property
    def data_bytes(self) -> Number:
        """Data of all telegrams, padding included [bytes]."""
        return self.closed_bytes + padded_bytes(self.open_bytes)


def padded_bytes(data_bytes: Number) -> Number:
    """Data of a telegram, padding included [bytes].

    Examples
    --------
    >>> padded_bytes(12), padded_bytes(100)
    (40.0, 100)
    """
    return larger(data_bytes, c.LEAST_BYTES)


def filled(items: Iterable[Items], *, first_bytes: Number, next_bytes: Number, name: str = "") -> Filling:
    """Telegrams filled with items in their order; an item that does not fit goes whole into the next telegram.

    The first telegram begins with `first_bytes` of fields, each other one with `next_bytes`; `name` is their name in a
    derivation.

    Examples
    --------
    >>> filled([Items(3, 700)], first_bytes=12, next_bytes=0)
    Filling(telegrams=2, closed_bytes=1412, open_bytes=700)
    """
    filling = Filling(1, 0, first_bytes)
    for place, group in enumerate(items, start=1):
        filling = _with_items(filling, group, next_bytes, f"{name},{place}")
    return filling


def _with_items(before: Filling, items: Items, next_bytes: Number, name: str) -> Filling:
    size_bytes = items.size_bytes
    room = larger(rounded_down((c.MOST_BYTES - before.open_bytes) / size_bytes), 0)
    here = named(smaller(items.pieces, room), f"fit_{name}", f"k_{name}")
    per_telegram = larger(rounded_down((c.MOST_BYTES - next_bytes) / size_bytes), 1)
    more = rounded_up((items.pieces - here) / per_telegram)
    last = items.pieces - here - (more - 1) * per_telegram
    own_bytes = before.open_bytes + here * size_bytes
    closed_bytes = padded_bytes(own_bytes) + (more - 1) * padded_bytes(next_bytes + per_telegram * size_bytes)
    open_bytes = choose(more > 0, next_bytes + last * size_bytes, own_bytes)
    return Filling(
        named(before.telegrams + more, f"telegrams_{name}", f"n_{name}"),
        before.closed_bytes + choose(more > 0, closed_bytes, 0),
        named(open_bytes, f"open_{name}_bytes", f"s_{name}"),
    )


def telegrams_us(filling: Filling, *, gap_bytes: Number) -> Number:
    """Time of telegrams on the wire, each with the gap after it [us].

    (data + telegrams (32 + gap)) 0.08 us.

    Examples
    --------
    >>> telegrams_us(Filling(1, 0, 140), gap_bytes=12)
    14.72
    """
    return (filling.data_bytes + filling.telegrams * (c.OVERHEAD_BYTES + gap_bytes)) * c.BYTE_US


@step("J")
def sync_jitter_us(master_jitter_us: Number, *, gap_bytes: Number) -> Number:
    """Jitter of the synchronisation [us]: half of the master's and of the gap.

    Examples
    --------
    >>> sync_jitter_us(1.0, gap_bytes=25)
    1.5
    """
    return (master_jitter_us + gap_bytes * c.BYTE_US) / 2


@step("t_ring")
def ring_delay_us(
    devices: Number, *, device_delay_us: Number, gap_bytes: Number, component_delay_us: Number = 0.0
) -> Number:
    """Delay of the ring [us]: every device there and back, half a gap, and components that are no devices.

    Examples
    --------
    >>> ring_delay_us(8, device_delay_us=0.9, gap_bytes=25, component_delay_us=1.8)
    17.2
    """
    return 2 * devices * device_delay_us + gap_bytes * c.BYTE_US / 2 + component_delay_us


def start_wait_us(least_us: Number, *, earliest_us: Number) -> Number:
    """Wait before the AT, where the devices ask for a later start, the minimum of S-0-1006 [us].

    `least_us` is the earliest start that they accept, `earliest_us` the start without it, both from the start of the
    cycle.

    Examples
    --------
    >>> start_wait_us(100.0, earliest_us=22.5), start_wait_us(100.0, earliest_us=130.0)
    (77.5, 0.0)
    """
    return larger(least_us - earliest_us, 0.0)


_LIBRARY: Final = "CoSeMa"

MDT_TELEGRAMS: Final = Figure(
    "mdt_telegrams", "n_MDT", _LIBRARY, "master data telegrams of a cycle", "MDT", sort="count", better="less"
)
AT_TELEGRAMS: Final = Figure(
    "at_telegrams", "n_AT", _LIBRARY, "device telegrams of a cycle", "AT", sort="count", better="less"
)
TERMS: Final = (
    Figure("cycle_mdt_us", "MDT", _LIBRARY, "master data telegrams with their gaps", "MDT", ink="out", letter="M"),
    Figure(
        "cycle_wait_us",
        "wait",
        _LIBRARY,
        "wait of the AT for the devices",
        "wait of devices",
        ink="sync",
        letter="W",
        waits_for="nodes",
    ),
    Figure("cycle_at_us", "AT", _LIBRARY, "device telegrams with their gaps", "AT", ink="in", letter="A"),
    Figure(
        "cycle_jitter_us",
        "jitter",
        _LIBRARY,
        "allowances for the jitter",
        "jitter",
        ink="contention",
        letter="J",
        waits_for="host",
    ),
    Figure(
        "cycle_master_us",
        "master",
        _LIBRARY,
        "the master's own time",
        "master",
        ink="work",
        letter="T",
        waits_for="host",
    ),
    Figure(
        "cycle_ring_us",
        "ring",
        _LIBRARY,
        "delay of the ring, where the timing method has it",
        "ring delay",
        ink="long-gap",
        letter="R",
    ),
    NONPERIODIC,
)
"""Terms in the order of the wire, with other frames last."""
COUNTS: Final = (MDT_TELEGRAMS, AT_TELEGRAMS)
FIGURES: Final = BusFigures(
    TERMS,
    added=COUNTS,
    table=COUNTS,
    compared=COUNTS,
    planned=tuple(figure.key for figure in COUNTS),
    latency_rows=DELAYS,
)


@dataclass(frozen=True)
class Sercos3Figures(OwnFigures):
    """Figures of SERCOS III alone, by the keys of `FIGURES`."""

    mdt_telegrams: int
    at_telegrams: int
    cycle_mdt_us: float
    cycle_wait_us: float
    cycle_at_us: float
    cycle_jitter_us: float
    cycle_master_us: float
    cycle_ring_us: float
    nonperiodic_us: float


SORTS: Final[dict[TransactionKind, str]] = {"write": "mdt", "read": "at"}
"""Telegrams that carry a node's payloads, in the order of the cycle."""


class Telegrams(NamedTuple):
    """All MDT or all AT of a network; floats, arrays or traced numbers."""

    first_bytes: Number
    """Fields at the start of the first telegram [bytes]."""
    next_bytes: Number
    """Fields at the start of each further telegram [bytes]."""
    items: tuple[Items, ...]
    """Service channels, control or status, then the data of each group."""
    name: str
    """Name in a derivation."""

    @property
    def filling(self) -> Filling:
        """The telegrams filled with their items."""
        return filled(self.items, first_bytes=self.first_bytes, next_bytes=self.next_bytes, name=self.name)


def telegrams_of(network: Network, kind: TransactionKind) -> Telegrams:
    """Telegrams that carry a payload of each node: MDT for "write", AT for "read"."""
    is_in_all = network.profile.bus.hot_plug_field == "all"
    first_bytes: Number = c.HOT_PLUG_BYTES
    if kind == "write":
        first_bytes = first_bytes + c.EXTENDED_BYTES + (c.ALIGNED_BYTES if is_in_all else 0)
    return Telegrams(
        first_bytes,
        c.HOT_PLUG_BYTES if is_in_all else 0,
        (
            Items(network.nodes, c.CHANNEL_BYTES),
            Items(network.nodes, c.DEVICE_BYTES),
            *(
                Items(group.nodes_with(kind), data_bytes(network, group.bytes_of(kind)))
                for group in network.groups
                if group.has(kind)
            ),
        ),
        SORTS[kind].upper(),
    )


def data_bytes(network: Network, payload_bytes: Number) -> Number:
    """Cyclic data of a device in whole words, from V1.1 on with the control of its connection [bytes]."""
    # Where nobody has data there are no pieces; their size still divides the room.
    words: Number = word_bytes(payload_bytes if is_everywhere(payload_bytes > 0) else larger(payload_bytes, 1))
    return words if network.profile.bus.version == "V1.0" else words + c.CONNECTION_BYTES
