"""Filling of the telegrams against telegrams that are written byte by byte, and against published numbers of drives."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import busplan
from busplan.buses.sercos.sercos3 import PERIODS

BYTE_NS = 80


class Device(NamedTuple):
    """What a device takes and gives in a cycle [bytes]."""

    mdt: int
    at: int


class Written(NamedTuple):
    """What stands on the wire."""

    telegrams: int
    bytes_with_gaps: int


def written(data: Sequence[int], *, is_mdt: bool, version: str, hot_plug: str, gap: int) -> Written:
    """Write each telegram byte by byte: what is in it first, then the Ethernet frame around it.

    A device's data are whole words, as CoSeMa takes the length of a connection (CSMD_RND_UP_2).
    """
    hot_plug_field = bytes(8)
    first = bytearray(hot_plug_field)
    if is_mdt:
        first += bytes(4) if hot_plug == "first" else bytes(6)
    fields = [first]

    def put(piece: bytes) -> None:
        if len(fields[-1]) + len(piece) > 1494:
            fields.append(bytearray(hot_plug_field if hot_plug == "all" else b""))
        fields[-1].extend(piece)

    for _ in data:
        put(b"service"[:6])
    for _ in data:
        put(b"DV")
    for size in data:
        put((b"CC" if version == "V1.1" else b"") + bytes(size) + bytes(size % 2))
    wire = bytearray()
    for one in fields:
        wire += b"\x55" * 7 + b"\xd5" + bytes(6 + 6) + b"\x88\xcd" + bytes(6)
        wire += bytes(one).ljust(40, b"\x00") + bytes(4) + bytes(gap)
    return Written(len(fields), len(wire))


def profile_of(devices: Sequence[Device], *, version: str, hot_plug: str, gap: int) -> busplan.Profile:
    """A profile with a group for each run of devices that are alike."""
    runs: list[tuple[Device, int]] = []
    for one in devices:
        if runs and runs[-1][0] == one:
            runs[-1] = (one, runs[-1][1] + 1)
        else:
            runs.append((one, 1))
    groups = "".join(
        f'[[group]]\nname = "g{place}"\nnodes = {count}\naxes = 1\nread_bytes = {one.at}\nwrite_bytes = {one.mdt}\n'
        'execution = {kind = "linear", base_us = 1, per_byte_us = 0}\n'
        for place, (one, count) in enumerate(runs)
    )
    bus = f'kind = "sercos3"\nversion = "{version}"\nhot_plug_field = "{hot_plug}"\ngap_bytes = {gap}'
    with TemporaryDirectory() as folder:
        path = Path(folder, "ring.toml")
        text = f'schema_version = 1\nname = "ring"\n[bus]\n{bus}\n[cycle]\nperiod_us = 1000\n{groups}'
        path.write_text(text, encoding="utf-8")
        return busplan.load_profile(path)


SIZES = st.one_of(st.integers(1, 40), st.sampled_from([200, 700, 1400]))
DEVICES = st.lists(st.tuples(st.builds(Device, SIZES, SIZES), st.integers(1, 60)), min_size=1, max_size=4).map(
    lambda runs: [one for one, count in runs for _ in range(count)]
)


@given(DEVICES, st.sampled_from(["V1.0", "V1.1"]), st.sampled_from(["first", "all"]), st.integers(12, 60))
@example([Device(1480, 1480)], "V1.0", "first", 12)  # behind a first telegram that is padded
def test_telegrams_are_those_that_are_written(devices: list[Device], version: str, hot_plug: str, gap: int) -> None:
    profile = profile_of(devices, version=version, hot_plug=hot_plug, gap=gap)
    (figures,) = busplan.capacity(profile, timing_model="telegrams").results
    found = figures.by_key()
    for sort in ("mdt", "at"):
        sizes = [getattr(one, sort) for one in devices]
        expected = written(sizes, is_mdt=sort == "mdt", version=version, hot_plug=hot_plug, gap=gap)
        assert found[f"{sort}_telegrams"] == expected.telegrams
        assert found[f"cycle_{sort}_us"] == pytest.approx(expected.bytes_with_gaps * BYTE_NS / 1000, rel=1e-12)


def test_evidence_has_the_residual_of_each() -> None:
    ((section,),) = (kind.sections for kind in busplan.evidence("sercos3").kinds)
    found = {(one.quantity, one.method): one.residual for one in section.comparisons}
    assert found["drives, 8 bytes at 31.25 us", "telegrams, gap 12"] == 0
    assert found["drives, 8 bytes at 31.25 us", "telegrams, gap 37"] == -1
    assert found["drives, 16 bytes at 1000 us", "telegrams, gap 12"] == -6
    assert found["drives, 16 bytes at 1000 us", "telegrams, gap 37"] == -6
    least = [one for one in section.comparisons if one.method == "telegrams, gap 12"]
    assert all(one.computed == pytest.approx(one.published, rel=0.06) for one in least)
    assert "least gap" in section.note


def test_periods_are_those_of_the_library() -> None:
    # CSMD_TSCYC: three short ones, then multiples of 250 us up to 65 ms.
    short = [31.25, 62.5, 125.0]
    assert [one for one in PERIODS.us if one < 250] == short
    assert set(PERIODS.us) - set(short) == {250.0 * n for n in range(1, 261)}
