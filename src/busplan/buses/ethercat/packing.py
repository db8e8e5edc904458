"""Packing of devices into frames: in their order, each whole, a new frame where the next device has no room."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from busplan.buses.ethercat.equations import DATAGRAM_BYTES, padding_bytes, room_bytes
from busplan.elementwise import (
    Number,
    alike,
    choose,
    is_everywhere,
    is_off,
    larger,
    plain,
    rounded_down,
    rounded_up,
    smaller,
    total,
)


class Devices(NamedTuple):
    """Devices that are alike, side by side. The numbers may be of any sort."""

    number: Number
    """Number of devices [1]."""
    data_bytes: Number
    """Bytes of each in a frame [bytes]."""


class Packing(NamedTuple):
    """All frames of the process data. The numbers may be of any sort."""

    frames: Number
    """Number of frames [1]."""
    datagrams_bytes: Number
    """All their datagrams, headers and data [bytes]."""
    padding_bytes: Number
    """Filling of short frames [bytes]."""
    last_bytes: Number
    """Datagrams of the last frame [bytes]."""
    before_bytes: Number
    """Datagrams of the frame before it; 0 where there is none [bytes]."""


def pack(devices: Sequence[Devices], *, datagrams: int, first_bytes: Number) -> Packing:
    """Share out devices among frames.

    Parameters
    ----------
    devices
        Groups of devices in their order, at least one.
    datagrams
        Datagrams of process data in a frame that holds any: 1 of LRW, 2 of LRD and LWR [1].
    first_bytes
        A datagram of another sort that opens the first frame; 0 for none [bytes].

    Returns
    -------
    Packing
        A device that no frame has room for counts as a frame of its own: a limit is broken then.

    Examples
    --------
    >>> pack([Devices(1000, 4)], datagrams=1, first_bytes=0.0)
    Packing(frames=3, datagrams_bytes=4036.0, padding_bytes=0.0, last_bytes=1044.0, before_bytes=1496.0)
    """
    devices = [_with_data(group) for group in devices if not is_everywhere(group.data_bytes <= 0)] or [Devices(0, 1)]
    room = room_bytes(datagrams)
    headers = total([alike(DATAGRAM_BYTES, devices[0].number)] * datagrams)
    free: Number = 0.0
    frames: Number = 0
    present: Number = 0.0
    whole: Number = first_bytes
    padding: Number = 0.0
    before: Number = 0.0
    if not is_off(first_bytes):
        # The first device may have no room beside it, and then it goes alone.
        has_room = room - first_bytes - _first_bytes(devices) >= 0
        free = choose(has_room, room - first_bytes, 0.0)
        present = first_bytes + choose(has_room, headers, 0.0)
        whole = present
        frames = 1
    for group in devices:
        beside = smaller(group.number, rounded_down(free / group.data_bytes))
        behind = group.number - beside
        present, free = present + beside * group.data_bytes, free - beside * group.data_bytes
        each = larger(rounded_down(room / group.data_bytes), 1)
        new = rounded_up(behind / each)
        in_last = (behind - (larger(new, 1) - 1) * each) * group.data_bytes
        opens = behind > 0
        before = choose(opens, choose(new > 1, headers + each * group.data_bytes, present), before)
        padding = padding + choose(opens, padding_bytes(present), 0.0)
        present, free = choose(opens, headers + in_last, present), choose(opens, larger(room - in_last, 0.0), free)
        frames, whole = frames + new, whole + new * headers + group.number * group.data_bytes
    return Packing(frames, whole, padding + padding_bytes(present), present, before)


def _with_data(devices: Devices) -> Devices:
    """The same devices; where an array has couplers, which have no data and are in no frame, as none of a byte."""
    if is_everywhere(devices.data_bytes > 0):
        return devices
    number = choose(devices.data_bytes > 0, devices.number, 0)
    return Devices(number, larger(devices.data_bytes, 1))


def _first_bytes(devices: Sequence[Devices]) -> Number:
    """Data of the first device that is there: at points of an array the first groups may have none [bytes]."""
    first: Number = devices[-1].data_bytes
    for group in reversed(devices[:-1]):
        is_there = group.number > 0
        first = group.data_bytes if is_everywhere(is_there) else choose(is_there, group.data_bytes, first)
    return first


class Frames(NamedTuple):
    """Frames in sequence that hold as many devices of the same size, of plain numbers."""

    first: int
    """First device of the first of them, from 1."""
    devices: int
    """Devices in each; none where only the clocks' datagram had room."""
    datagrams_bytes: float
    """Datagrams of each [bytes]."""
    frames: int = 1
    """Number of frames [1]."""

    def each(self) -> Iterator[range]:
        """Devices of each frame."""
        for frame in range(self.frames):
            first = self.first + frame * self.devices
            yield range(first, first + self.devices)


def frames_of(devices: Sequence[Devices], *, datagrams: int, first_bytes: float) -> Iterator[Frames]:
    """The same frames in their order, of plain numbers; a few entries for each group, however many its devices.

    Parameters
    ----------
    devices, datagrams, first_bytes
        As `pack` takes them.
    """
    room, headers = room_bytes(datagrams), datagrams * float(DATAGRAM_BYTES)
    first, held, opened, filled = 1, 0, first_bytes, 0.0
    for group in devices:
        size, left = plain(group.data_bytes), int(plain(group.number))
        # Couplers have no data, and room in any frame.
        fitting = max(int((room - opened - filled) // size), 0 if held or opened else 1) if size else left
        beside = min(left, fitting)
        held, filled, left = held + beside, filled + beside * size, left - beside
        if left:
            yield Frames(first, held, opened + bool(filled) * headers + filled)
            first, each = first + held, max(int(room // size), 1)
            full = (left - 1) // each
            if full:
                yield Frames(first, each, headers + each * size, full)
            first, held, opened = first + full * each, left - full * each, 0.0
            filled = held * size
    if opened or filled:
        yield Frames(first, held, opened + bool(filled) * headers + filled)
