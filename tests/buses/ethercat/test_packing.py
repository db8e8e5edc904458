"""Frames against a writer that puts them together byte by byte, and against published sizes."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.ethercat.equations import datagram_bytes, frame_bytes, room_bytes, sending_us
from tests.registers import at_least

MOST: Final = 1538
BYTE_US: Final = 0.08
Sized = tuple[int, int, int]
"""Devices, inputs and outputs of a group."""


def profile(groups: Sequence[Sized], layout: str = "LRW-shared", *, clocks: bool = False) -> busplan.Profile:
    return (
        kind_named("ethercat")
        .profile_model()
        .model_validate(
            {
                "schema_version": 1,
                "name": "press",
                "bus": {"kind": "ethercat", "master": "SOEM", "process_data": layout, "distributed_clocks": clocks},
                "cycle": {"period_us": 5000.0},
                "group": [
                    {"name": f"g{place}", "nodes": nodes, "read_bytes": read, "write_bytes": write, "axes": 0}
                    for place, (nodes, read, write) in enumerate(groups)
                ],
            }
        )
    )


class Frame(NamedTuple):
    """Length of a frame on the wire [bytes], and which devices have data in it."""

    wire_bytes: int
    devices: tuple[int, ...]


def sent(plan: busplan.Profile) -> list[Frame]:
    """The frames of a cycle, as its timeline has them."""
    lengths_us: list[float] = []
    devices: dict[int, list[int]] = defaultdict(list)
    for event in busplan.timeline(plan, timing_model="last-byte").cycle_events:
        if event.kind == "overhead":
            lengths_us.append(event.duration_us)
        elif event.kind == "data":
            lengths_us[-1] += event.duration_us
            devices[len(lengths_us)].append(event.node or 0)
    return [Frame(round(us / BYTE_US), tuple(devices[number])) for number, us in enumerate(lengths_us, start=1)]


def results(plan: busplan.Profile) -> tuple[Any, dict[str, float]]:
    """The result of the deciding model, and the terms of the vendors' [us]."""
    vendors, last_byte = sorted(busplan.capacity(plan).results, key=lambda result: result.timing_model == "last-byte")
    return last_byte, {term.name: float(term.us) for term in vendors.terms}


# --- the writer -----------------------------------------------------------------------------------------


def datagram(data: bytes) -> bytes:
    return b"command, " + b"i" + data + b"wc"


def on_wire(datagrams: bytes) -> bytes:
    """Preamble, Ethernet header, EtherCAT header, datagrams, padding of the Ethernet payload to 46, check, gap."""
    payload = (b"ec" + datagrams).ljust(46, b"0")
    return b"p" * 8 + b"e" * 14 + payload + b"c" * 4 + b"g" * 12


def body(held: list[tuple[bytes, bytes]], *, is_shared: bool, clocks: bool) -> bytes:
    opened = datagram(b"t" * 8) if clocks else b""
    if not held:
        return opened
    if is_shared:
        return opened + datagram(b"".join(max(both, key=len) for both in held))
    return opened + datagram(b"".join(read for read, _ in held)) + datagram(b"".join(write for _, write in held))


def written(groups: Sequence[Sized], *, is_shared: bool, clocks: bool) -> list[Frame]:
    """Put devices into a frame as long as the whole frame stays within the longest one."""
    frames: list[Frame] = []
    held: list[tuple[bytes, bytes]] = []
    devices: list[int] = []

    def frame(held: list[tuple[bytes, bytes]]) -> bytes:
        return on_wire(body(held, is_shared=is_shared, clocks=clocks and not frames))

    both_ways = [(b"r" * read, b"w" * write) for nodes, read, write in groups for _ in range(nodes)]
    for number, both in enumerate(both_ways, start=1):
        if not any(both):
            continue
        if len(frame([*held, both])) > MOST:
            frames.append(Frame(len(frame(held)), tuple(devices)))
            held, devices = [], []
        held.append(both)
        devices.append(number)
    return [*frames, Frame(len(frame(held)), tuple(devices))]


GROUPS = st.lists(
    st.tuples(
        st.one_of(st.integers(1, 4), st.integers(1, 300)),
        st.one_of(st.integers(1, 30), st.integers(1, 730), st.just(737)),
        st.one_of(st.integers(1, 30), st.integers(1, 730), st.just(737)),
    ),
    min_size=1,
    max_size=4,
)


@pytest.mark.slow
@settings(max_examples=at_least(20))
@given(GROUPS, st.booleans(), st.booleans(), st.integers(0, 4))
@example([(1, 1466, 1)], True, True, 0)  # all the room beside the clocks
@example([(2, 1467, 1)], True, True, 0)  # one byte more: the clocks go alone, in a padded frame
@example([(1, 727, 727), (1, 1, 1)], False, True, 1)
@example([(3, 737, 737)], False, False, 2)
def test_frames_are_those_of_a_writer(groups: list[Sized], is_shared: bool, clocks: bool, coupler: int) -> None:
    groups = [*groups[:coupler], (20, 0, 0), *groups[coupler:]]
    plan = profile(groups, "LRW-shared" if is_shared else "LRD-LWR", clocks=clocks)
    frames = written(groups, is_shared=is_shared, clocks=clocks)
    result, vendors_us = results(plan)
    assert sent(plan) == frames
    assert result.own.frames == len(frames)
    sending = sum(frame.wire_bytes for frame in frames) * BYTE_US
    assert vendors_us["frames"] + vendors_us["data"] == pytest.approx(sending)
    assert vendors_us["receive"] == pytest.approx(frames[-1].wire_bytes * BYTE_US)


@pytest.mark.slow
@settings(max_examples=at_least(5))
@given(st.integers(1, 1486), st.booleans(), st.integers(1, 200))
def test_a_sweep_and_a_derivation_have_what_each_number_of_devices_has(size: int, clocks: bool, other: int) -> None:
    plan = profile([(1, size, 0), (3, other, 0)], clocks=clocks)
    nodes = list(range(1, 60))
    swept = busplan.sweep(
        plan, vary={"group.g0.nodes": nodes, "group.g1.read_bytes": [0, other]}, timing_model=["vendors"]
    )
    for place in range(0, len(swept["required_us"]), 7):
        changes = {key: swept[key][place].item() for key in ("group.g0.nodes", "group.g1.read_bytes")}
        (alone,) = busplan.capacity(busplan.load_profile(plan, changes=changes), timing_model=["vendors"]).results
        assert swept["required_us"][place] == pytest.approx(alone.required_us, rel=1e-12)
        assert swept["frames"][place] == busplan.EthercatFigures.of(alone).frames
    explained = busplan.explain(plan, "required_us", timing_model=["vendors"]).derivations[0]
    assert explained.value == busplan.capacity(plan, timing_model=["vendors"]).results[0].required_us


@pytest.mark.parametrize(("data", "wire"), [(1, 84), (32, 84), (33, 85), (125, 177), (1486, 1538)])
def test_frames_have_published_lengths(data: int, wire: int) -> None:
    assert frame_bytes(datagram_bytes(data)) == wire
    assert sending_us(wire) == pytest.approx(0.08 * wire)


def test_a_frame_has_room_for_1486_bytes_and_20_less_beside_the_clocks() -> None:
    assert room_bytes(1) == 1486
    for devices, clocks, frames in (
        ((1, 1486, 0), False, 1),
        ((2, 743, 0), False, 1),
        ((2, 733, 0), True, 1),
        ((2, 734, 0), True, 2),
    ):
        assert len(sent(profile([devices], clocks=clocks))) == frames


def test_a_first_device_that_has_no_room_beside_the_clocks_leaves_them_alone() -> None:
    assert sent(profile([(1, 1486, 0)], clocks=True)) == [(84, ()), (1538, (1,))]


def test_a_device_is_never_split() -> None:
    assert [frame.devices for frame in sent(profile([(3, 800, 0)]))] == [(1,), (2,), (3,)]


def test_groups_share_a_frame_at_their_boundary() -> None:
    frames = sent(profile([(150, 10, 0), (2, 700, 0), (1, 100, 0)]))
    assert [frame.devices[:1] + frame.devices[-1:] for frame in frames] == [(1, 148), (149, 152), (153, 153)]


def test_frames_of_many_devices_are_counted_and_not_listed() -> None:
    (result,) = busplan.capacity(
        profile([(10**6, 16, 0), (10**6, 8, 0)], clocks=True), timing_model=["last-byte"]
    ).results
    # 92 devices have room in a frame, 91 beside the clocks, and 185 of the smaller ones.
    whole, left = divmod(10**6 - 91, 92)
    assert busplan.EthercatFigures.of(result).frames == 1 + whole + -(-(10**6 + left * 2) // 185)
