"""Filling and time of the telegrams of SERCOS III, for numbers of any sort.

References
----------
CoSeMa V6.1, the common SERCOS master library: telegram assignment and timing methods.
"""

from collections.abc import Iterable
from typing import NamedTuple

from busplan.buses.sercos3.constants import BYTE_US, LEAST_BYTES, MOST_BYTES, OVERHEAD_BYTES
from busplan.elementwise import Number, choose, larger, named, rounded_down, rounded_up, smaller


class Items(NamedTuple):
    """Some pieces of data that are not split. The numbers may be of any sort."""

    pieces: Number
    """How many [1]."""
    size_bytes: Number
    """Of each [bytes]."""


class Filling(NamedTuple):
    """Telegrams of one sort that are filled, the last of them open. The numbers may be of any sort."""

    telegrams: Number
    """How many, the open one among them [1]."""
    closed_bytes: Number
    """Data of those before the open one [bytes]."""
    open_bytes: Number
    """Data of the open one [bytes]."""

    @property
    def data_bytes(self) -> Number:
        """Data of all of them, padded [bytes]."""
        return self.closed_bytes + padded_bytes(self.open_bytes)


def padded_bytes(data_bytes: Number) -> Number:
    """Data of a telegram, with what is padded [bytes].

    Examples
    --------
    >>> padded_bytes(12), padded_bytes(100)
    (40.0, 100)
    """
    return larger(data_bytes, LEAST_BYTES)


def filled(items: Iterable[Items], *, first_bytes: Number, next_bytes: Number, name: str = "") -> Filling:
    """Fill telegrams with items in their order: what does not fit into one goes whole into the next.

    Parameters
    ----------
    items
        They, like ones together.
    first_bytes
        What the first telegram begins with [bytes].
    next_bytes
        What each other telegram begins with [bytes].
    name
        What a derivation calls the telegrams.

    Examples
    --------
    >>> filled([Items(3, 700)], first_bytes=12, next_bytes=0)
    Filling(telegrams=2, closed_bytes=1412, open_bytes=700)
    """
    found = Filling(1, 0, first_bytes)
    for place, one in enumerate(items, start=1):
        found = _with_items(found, one, next_bytes, f"{name},{place}")
    return found


def _with_items(before: Filling, items: Items, next_bytes: Number, name: str) -> Filling:
    size_bytes = items.size_bytes
    room = larger(rounded_down((MOST_BYTES - before.open_bytes) / size_bytes), 0)
    here = named(smaller(items.pieces, room), f"fit_{name}", f"k_{name}")
    each = larger(rounded_down((MOST_BYTES - next_bytes) / size_bytes), 1)
    more = rounded_up((items.pieces - here) / each)
    last = items.pieces - here - (more - 1) * each
    own_bytes = before.open_bytes + here * size_bytes
    closed_bytes = padded_bytes(own_bytes) + (more - 1) * padded_bytes(next_bytes + each * size_bytes)
    open_bytes = choose(more > 0, next_bytes + last * size_bytes, own_bytes)
    return Filling(
        named(before.telegrams + more, f"telegrams_{name}", f"n_{name}"),
        before.closed_bytes + choose(more > 0, closed_bytes, 0),
        named(open_bytes, f"open_{name}_bytes", f"s_{name}"),
    )


def telegrams_us(filling: Filling, *, gap_bytes: Number) -> Number:
    """Time of telegrams on the wire, each with the gap behind it [us].

    Parameters
    ----------
    filling
        The telegrams.
    gap_bytes
        Gap between two telegrams [bytes]; float or array.

    Returns
    -------
    float
        (data + telegrams (32 + gap)) 0.08 us.

    Examples
    --------
    >>> telegrams_us(Filling(1, 0, 140), gap_bytes=12)
    14.72
    """
    return (filling.data_bytes + filling.telegrams * (OVERHEAD_BYTES + gap_bytes)) * BYTE_US


def sync_jitter_us(master_jitter_us: Number, *, gap_bytes: Number) -> Number:
    """Jitter of the synchronisation: half of the master's and of the gap [us].

    Examples
    --------
    >>> sync_jitter_us(1.0, gap_bytes=25)
    1.5
    """
    return (master_jitter_us + gap_bytes * BYTE_US) / 2


def ring_delay_us(
    devices: Number, *, device_delay_us: Number, gap_bytes: Number, component_delay_us: Number = 0.0
) -> Number:
    """Delay of the ring: there and back through every device, half a gap, and what is no device [us].

    Examples
    --------
    >>> ring_delay_us(8, device_delay_us=0.9, gap_bytes=25, component_delay_us=1.8)
    17.2
    """
    return 2 * devices * device_delay_us + gap_bytes * BYTE_US / 2 + component_delay_us


def start_wait_us(least_us: Number, *, earliest_us: Number) -> Number:
    """Wait before the AT, where the devices ask for a later start, the minimum of S-0-1006 [us].

    Parameters
    ----------
    least_us
        The least time that they ask for, from the start of the cycle [us].
    earliest_us
        When the AT could begin without it [us].

    Examples
    --------
    >>> start_wait_us(100.0, earliest_us=22.5), start_wait_us(100.0, earliest_us=130.0)
    (77.5, 0.0)
    """
    return larger(least_us - earliest_us, 0.0)
