"""Files of captures: all forms of stamps, what stands between, and files that are cut or damaged."""

import re
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.errors import BusplanError
from tests.oracles.ethercat_recording import Machine, pcap, pcapng, simulated, statistics

PACKETS = simulated(Machine(), 40)
PLAN = busplan.load_profile(
    "ethercat-servo-8",
    changes={"bus.nodes": 4, "payload.read_bytes": 10, "payload.write_bytes": 10, "node.cable_length_m": 0},
)
Recorded = dict[str, float | None]


def measured(content: bytes, folder: Path) -> busplan.MeasuredAnswer:
    path = folder / "capture"
    path.write_bytes(content)
    return busplan.measured(PLAN, path)


def recorded(content: bytes, folder: Path) -> Recorded:
    """Recorded value of each figure."""
    return {figure.quantity: figure.recorded for figure in measured(content, folder).figures}


def broken_at(answer: busplan.MeasuredAnswer) -> int | None:
    """Byte from which on the file is not read; None of a whole file."""
    remarks = (re.match(r"The file is cut or damaged from byte ([\d,]+) on", remark) for remark in answer.remarks)
    return next((int(match[1].replace(",", "")) for match in remarks if match), None)


FORMS = {
    **{
        f"pcap {order} {nano}": (pcap(PACKETS, order=order, nano=nano), 1 if nano else 1000)
        for order in "<>"
        for nano in (True, False)
    },
    **{
        f"pcapng {order} {resolution}": (pcapng(PACKETS, order=order, resolution=resolution), step)
        for order in "<>"
        for resolution, step in ((9, 1), (6, 1000), (None, 1000), (8, 10))
    },
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_has_the_same_stamps_to_its_step(form: str, tmp_path: Path) -> None:
    content, step_ns = FORMS[form]
    exact = recorded(pcapng(PACKETS), tmp_path)
    answer = measured(content, tmp_path)
    assert answer.day == "2023-11-14"
    assert f"Stamps have steps of {step_ns / 1000:g} us." in answer.remarks
    assert [figure.quantity for figure in answer.figures] == list(exact)
    for figure in answer.figures:
        allowed = 2 * step_ns / 1000 if figure.unit == "us" else 0
        assert figure.recorded == pytest.approx(exact[figure.quantity], abs=allowed), figure.quantity


def test_stamps_in_binary_fractions(tmp_path: Path) -> None:
    content = pcapng(PACKETS, start_s=0)
    # Of 2^-9 s instead of 10^-9 s.
    answer = measured(content.replace(b"\x09\x00\x01\x00\x09", b"\x09\x00\x01\x00\x89"), tmp_path)
    (period,) = (figure for figure in answer.figures if figure.quantity == "period")
    assert period.recorded == pytest.approx(1000 * 1e9 / 2**9, rel=1e-3)


def test_tags_and_other_protocols(tmp_path: Path) -> None:
    tags = (b"", b"\x81\x00\x00\x05", b"\x88\xa8\x00\x05\x81\x00\x00\x05")
    tagged = [(us, frame[:12] + tags[place % 3] + frame[12:]) for place, (us, frame) in enumerate(PACKETS)]
    frame = PACKETS[0][1]
    others = [b"\xff" * 12 + b"\x08\x00" + bytes(46), b"", b"\xff" * 13, frame[:14] + b"\x10\x40" + frame[16:]]
    mixed = [*tagged[:9], *((tagged[8][0], other) for other in others), *tagged[9:]]
    answer = measured(pcapng(mixed), tmp_path)
    assert "Left out: 4 packets of other protocols or interfaces, or without a time." in answer.remarks
    assert {figure.quantity: figure.recorded for figure in answer.figures} == recorded(pcapng(PACKETS), tmp_path)


@given(st.integers(0, 4000), st.booleans())
def test_a_file_may_end_anywhere(tmp_path_factory: pytest.TempPathFactory, end: int, is_ng: bool) -> None:
    whole = pcapng(PACKETS) if is_ng else pcap(PACKETS)
    try:
        answer = measured(whole[:end], tmp_path_factory.mktemp("cut"))
    except BusplanError:
        assert end < 400
        return
    (lost,) = (figure for figure in answer.figures if figure.quantity == "lost frames")
    assert (lost.recorded, lost.events <= 40) == (0, True)
    at = broken_at(answer)
    assert at is None or at <= end
    # Nothing behind the last whole record is read.
    assert recorded(whole[: end if at is None else at], tmp_path_factory.mktemp("whole")) == {
        figure.quantity: figure.recorded for figure in answer.figures
    }


@given(st.integers(24, 3000), st.binary(min_size=1, max_size=40), st.booleans())
def test_damage_is_no_failure_of_the_program(
    tmp_path_factory: pytest.TempPathFactory, at: int, damage: bytes, is_ng: bool
) -> None:
    whole = pcapng(PACKETS) if is_ng else pcap(PACKETS)
    try:
        measured(whole[:at] + damage + whole[at + len(damage) :], tmp_path_factory.mktemp("damaged"))
    except BusplanError:
        return


def test_a_cut_file_says_where(tmp_path: Path) -> None:
    content = pcapng(PACKETS)
    size = 32 + len(PACKETS[-1][1]) + -len(PACKETS[-1][1]) % 4
    assert broken_at(measured(content[:-10], tmp_path)) == len(content) - size
    assert recorded(content[:-10], tmp_path) == recorded(content[:-size], tmp_path)
    assert broken_at(measured(content, tmp_path)) is None
    # A record of pcap has 16 bytes before its packet.
    content, size = pcap(PACKETS), 16 + len(PACKETS[-1][1])
    assert broken_at(measured(content[:-10], tmp_path)) == len(content) - size
    assert recorded(content[:-10], tmp_path) == recorded(content[:-size], tmp_path)
    assert broken_at(measured(content, tmp_path)) is None


def test_an_interface_that_is_no_ethernet_is_left_out(tmp_path: Path) -> None:
    content = pcapng(PACKETS)
    assert content[36:38] == b"\x01\x00"
    with pytest.raises(BusplanError, match="no whole EtherCAT frame"):
        measured(content[:36] + b"\x69\x00" + content[38:], tmp_path)
    with pytest.raises(BusplanError, match="link type 105, expected 1, Ethernet"):
        measured(pcap(PACKETS)[:20] + b"\x69\x00\x00\x00", tmp_path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_packets_without_a_time_or_an_interface_are_left_out_and_counted(order: str, tmp_path: Path) -> None:
    packet = PACKETS[-1][1]

    def block(kind: int, *head: int, fields: str) -> bytes:
        filled = struct.pack(f"{order}{fields}", *head) + packet + bytes(-len(packet) % 4)
        return struct.pack(f"{order}II", kind, len(filled) + 12) + filled + struct.pack(f"{order}I", len(filled) + 12)

    content = pcapng(PACKETS, order=order)
    simple = block(3, len(packet), fields="I")
    no_interface = block(6, 1, 0, 0, len(packet), len(packet), fields="IIIII")
    in_2286 = block(6, 0, *divmod(10**10 * 10**9, 2**32), len(packet), len(packet), fields="IIIII")
    answer = measured(content + simple + no_interface + in_2286, tmp_path)
    assert "Left out: 3 packets of other protocols or interfaces, or without a time." in answer.remarks
    # An old packet block is a packet as any other; 65,535 means that nobody counted what was dropped.
    ticks = 1_700_000_000 * 10**9 + round(PACKETS[-1][0] * 1000)
    for dropped, said in ((65_535, ()), (7, ("the recorder dropped or cut 7 packets",))):
        old = block(2, 0, dropped, ticks >> 32, ticks & 0xFFFFFFFF, len(packet), len(packet), fields="HHIIII")
        answer = measured(pcapng(PACKETS[:-1], order=order) + old, tmp_path)
        assert {figure.quantity: figure.recorded for figure in answer.figures} == recorded(content, tmp_path)
        assert answer.shows_nothing == said


@pytest.mark.parametrize("order", ["<", ">"])
def test_packets_that_the_recorder_dropped_are_counted(order: str, tmp_path: Path) -> None:
    def dropped(content: bytes) -> tuple[str, ...]:
        return measured(content, tmp_path).shows_nothing

    content, words = pcapng(PACKETS, order=order), "the recorder dropped or cut {} packets"
    assert dropped(content) == ()
    for code, reasons in ((5, (words.format(12),)), (7, (words.format(12),)), (4, ())):
        assert dropped(content + statistics(code, 12, order=order)) == reasons
    # Statistics count from the start on: the last ones count.
    both = content + statistics(5, 3, order=order) + statistics(5, 12, order=order)
    assert dropped(both) == (words.format(12),)
    before = pcapng(PACKETS, order=order, dropped_before={3: 2, 20: 5})
    assert dropped(before) == (words.format(7),)
    assert recorded(before, tmp_path) == recorded(content, tmp_path)
