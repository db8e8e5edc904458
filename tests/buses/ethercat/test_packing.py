"""Frames against a writer that puts them together byte by byte, and against published sizes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from busplan.buses.ethercat.equations import datagram_bytes, frame_bytes, room_bytes, sending_us
from busplan.buses.ethercat.frames import Devices, frames_of, pack
from busplan.elementwise import Traced, plain

MOST, LEAST = 1538, 84


class Written(NamedTuple):
    """A frame as bytes, and which devices have data in it."""

    bytes: bytes
    devices: tuple[int, ...]


def one_by_one(
    devices: Sequence[Devices], *, datagrams: int, first_bytes: float
) -> list[tuple[float, tuple[int, ...]]]:
    """Bytes and devices of each frame."""
    runs = frames_of(devices, datagrams=datagrams, first_bytes=first_bytes)
    return [(plain(frame_bytes(run.datagrams_bytes)), tuple(held)) for run in runs for held in run.by_frame()]


def datagram(data: bytes) -> bytes:
    return b"command, " + b"i" + data + b"wc"


def on_wire(datagrams: bytes) -> bytes:
    """Preamble, Ethernet header, EtherCAT header, datagrams, padding of the Ethernet payload to 46, check, gap."""
    payload = (b"ec" + datagrams).ljust(46, b"0")
    return b"p" * 8 + b"e" * 14 + payload + b"c" * 4 + b"g" * 12


def body(held: list[tuple[bytes, bytes]], *, is_shared: bool, clocks: bool) -> bytes:
    found = datagram(b"t" * 8) if clocks else b""
    if not held:
        return found
    if is_shared:
        return found + datagram(b"".join(max(one, key=len) for one in held))
    return found + datagram(b"".join(one for one, _ in held)) + datagram(b"".join(one for _, one in held))


def written(devices: list[tuple[int, int]], *, is_shared: bool, clocks: bool) -> list[Written]:
    """Put devices into a frame as long as the whole frame stays within the longest one."""
    found: list[Written] = []
    held: list[tuple[bytes, bytes]] = []
    place: list[int] = []
    for number, (read, write) in enumerate(devices, start=1):
        own = b"r" * read, b"w" * write
        more = on_wire(body([*held, own], is_shared=is_shared, clocks=clocks and not found))
        if len(more) > MOST:
            found.append(Written(on_wire(body(held, is_shared=is_shared, clocks=clocks and not found)), tuple(place)))
            held, place = [], []
        held.append(own)
        place.append(number)
    found.append(Written(on_wire(body(held, is_shared=is_shared, clocks=clocks and not found)), tuple(place)))
    return found


def sized(read: int, write: int, *, is_shared: bool) -> int:
    return max(read, write) if is_shared else read + write


GROUPS = st.lists(
    st.tuples(
        st.one_of(st.integers(1, 4), st.integers(1, 300)),
        st.one_of(st.integers(1, 30), st.integers(1, 730), st.just(737)),
        st.one_of(st.integers(1, 30), st.integers(1, 730), st.just(737)),
    ),
    min_size=1,
    max_size=4,
)


@given(GROUPS, st.booleans(), st.booleans())
@example([(1, 1466, 1)], True, True)  # all the room beside the clocks
@example([(2, 1467, 1)], True, True)  # one byte more: the clocks go alone, in a padded frame
@example([(1, 727, 727), (1, 1, 1)], False, True)
@example([(3, 737, 737)], False, False)
def test_frames_are_those_of_a_writer(groups: list[tuple[int, int, int]], is_shared: bool, clocks: bool) -> None:
    each = [(read, write) for nodes, read, write in groups for _ in range(nodes)]
    whole = written(each, is_shared=is_shared, clocks=clocks)
    own = [Devices(nodes, sized(read, write, is_shared=is_shared)) for nodes, read, write in groups]
    datagrams, first = 1 if is_shared else 2, 20.0 if clocks else 0.0
    found = pack(own, datagrams=datagrams, first_bytes=first)
    assert found.frames == len(whole)
    assert found.frames * 40 + found.datagrams_bytes + found.padding_bytes == sum(len(one.bytes) for one in whole)
    assert frame_bytes(found.last_bytes) == len(whole[-1].bytes)
    assert found.before_bytes == 0 if len(whole) == 1 else frame_bytes(found.before_bytes) == len(whole[-2].bytes)
    assert one_by_one(own, datagrams=datagrams, first_bytes=first) == [(len(one.bytes), one.devices) for one in whole]


@given(GROUPS, st.booleans(), st.integers(0, 4))
@example([(1, 1466, 1)], True, 0)
@example([(2, 1467, 1)], True, 0)
def test_devices_without_data_are_in_no_frame(groups: list[tuple[int, int, int]], clocks: bool, place: int) -> None:
    own = [Devices(nodes, max(read, write)) for nodes, read, write in groups]
    couplers = [*own[:place], Devices(2000, 0), *own[place:]]
    first = 20.0 if clocks else 0.0
    found = pack(own, datagrams=1, first_bytes=first)
    assert pack(couplers, datagrams=1, first_bytes=first) == found
    frames = list(frames_of(couplers, datagrams=1, first_bytes=first))
    alone = list(frames_of(own, datagrams=1, first_bytes=first))
    assert [one.datagrams_bytes for one in frames] == [one.datagrams_bytes for one in alone]
    sizes = np.array([0, 5])
    together = pack([*own, Devices(3, sizes)], datagrams=1, first_bytes=first)
    with_five = pack([*own, Devices(3, 5)], datagrams=1, first_bytes=first)
    for one, without, five in zip(together, found, with_five, strict=True):
        assert np.broadcast_to(np.asarray(one), sizes.shape).tolist() == [without, five]


@given(st.integers(1, 1486), st.booleans(), st.integers(1, 200))
def test_an_array_and_a_traced_number_pack_as_each_number(size: int, clocks: bool, other: int) -> None:
    first, nodes = 20.0 if clocks else 0.0, np.arange(1, 60)
    together = pack([Devices(nodes, size), Devices(3, other)], datagrams=1, first_bytes=first)
    for index, count in enumerate(nodes.tolist()):
        alone = pack([Devices(count, size), Devices(3, other)], datagrams=1, first_bytes=first)
        assert [float(np.broadcast_to(np.asarray(one), nodes.shape)[index]) for one in together] == list(alone)
    traced = pack([Devices(Traced(7.0), size), Devices(3, other)], datagrams=1, first_bytes=first)
    plain = pack([Devices(7, size), Devices(3, other)], datagrams=1, first_bytes=first)
    assert [one.value if isinstance(one, Traced) else one for one in traced] == list(plain)


@pytest.mark.parametrize(("data", "wire"), [(1, 84), (32, 84), (33, 85), (125, 177), (1486, 1538)])
def test_frames_have_published_lengths(data: int, wire: int) -> None:
    assert frame_bytes(datagram_bytes(data)) == wire
    assert sending_us(wire) == pytest.approx(0.08 * wire)


def test_a_frame_has_room_for_1486_bytes_and_20_less_beside_the_clocks() -> None:
    assert room_bytes(1) == 1486
    assert pack([Devices(1, 1486)], datagrams=1, first_bytes=0.0).frames == 1
    assert pack([Devices(2, 743)], datagrams=1, first_bytes=0.0).frames == 1
    assert pack([Devices(2, 733)], datagrams=1, first_bytes=20.0).frames == 1
    assert pack([Devices(2, 734)], datagrams=1, first_bytes=20.0).frames == 2


def test_a_first_device_that_has_no_room_beside_the_clocks_leaves_them_alone() -> None:
    assert one_by_one([Devices(1, 1486)], datagrams=1, first_bytes=20.0) == [(84, ()), (1538, (1,))]


def test_a_device_is_never_split() -> None:
    frames = one_by_one([Devices(3, 800)], datagrams=1, first_bytes=0.0)
    assert [devices for _, devices in frames] == [(1,), (2,), (3,)]


def test_groups_share_a_frame_at_their_boundary() -> None:
    frames = one_by_one([Devices(150, 10), Devices(2, 700), Devices(1, 100)], datagrams=1, first_bytes=0.0)
    assert [devices[:1] + devices[-1:] for _, devices in frames] == [(1, 148), (149, 152), (153, 153)]


def test_frames_of_many_devices_are_counted_and_not_listed() -> None:
    runs = list(frames_of([Devices(10**6, 16), Devices(10**6, 8)], datagrams=1, first_bytes=20.0))
    assert len(runs) <= 2 * 3
    assert (
        sum(run.frames for run in runs)
        == pack([Devices(10**6, 16), Devices(10**6, 8)], datagrams=1, first_bytes=20.0).frames
    )
