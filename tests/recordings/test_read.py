"""Frames of recordings written by hand, field by field: candump's text, BLF, captures of SocketCAN and EtherCAT."""

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import can
import numpy as np
import pytest

from busplan.errors import BusplanError
from busplan.recordings import written
from busplan.recordings.can import CanFrames, read_can
from busplan.recordings.can_bits import written_bits
from busplan.recordings.capture import CaptureNotes, packets
from busplan.recordings.ethercat import Datagram, EthercatFrames, read_ethercat
from tests.oracles.can_recording import Queued, bits_of
from tests.oracles.ethercat_recording import (
    APRD,
    BWR,
    FPRD,
    FRMW,
    LRW,
    ethernet,
    pcap,
    pcapng,
    register,
    start_up,
    statistics,
)


def nobody(*_: int) -> None:
    """Progress that nobody watches."""


def of_file(content: bytes | str, folder: Path, *, channel: str | None = None, name: str = "bus.log") -> CanFrames:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_can(path, channel=channel, progress=nobody)


# --- CAN --------------------------------------------------------------------------------------------------

LOG = """\
# recorded by hand
(1700000000.000000) can1 7FF#00
(1700000000.000100) can0 181#1122334455667788
(1700000000.000350) can0 18FF0102#0102
(1700000000.000400) can0 20000088#0000000000000000
(1700000000.000500) can0 123#R3
(1700000000.000600) can0 124##1000102030405060708090A0B
(1700000000.000700) can0 00000125##05A
 (1700000000.000900)  can0  181   [2]  0A 0B
 (1700000000.001000)  can0  RX B -       126  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B
 (1700000000.001100)  can0  127   [0]  remote request
"""
ROWS = [
    # Stamp [us], number, identifier, 29 bits, bytes, first eight of them, FD, BRS, remote.
    (100, 2, 0x181, False, 8, 0x1122334455667788, False, False, False),
    (350, 3, 0x18FF0102, True, 2, 0x0102 << 48, False, False, False),
    (500, 5, 0x123, False, 3, 0, False, False, True),
    (600, 6, 0x124, False, 12, 0x0001020304050607, True, True, False),
    (700, 7, 0x125, True, 1, 0x5A << 56, True, False, False),
    (900, 8, 0x181, False, 2, 0x0A0B << 48, False, False, False),
    (1000, 9, 0x126, False, 12, 0x0001020304050607, True, True, False),
    (1100, 10, 0x127, False, 0, 0, False, False, True),
]


def has(frames: CanFrames, rows: list[Any]) -> None:
    """The frames are those of the rows, whose stamps are from the first frame on."""
    stamps, numbers, identifiers, extended, sizes, data, fd, switched, remote = zip(*rows, strict=True)
    assert frames.times_us.tolist() == pytest.approx([us - stamps[0] for us in stamps], abs=0.3)
    assert frames.numbers.tolist() == list(numbers)
    assert frames.identifiers.tolist() == list(identifiers)
    assert frames.extended.tolist() == list(extended)
    assert frames.sizes.tolist() == list(sizes)
    assert frames.data.tolist() == list(data)
    assert frames.is_fd.tolist() == list(fd)
    assert frames.switched.tolist() == list(switched)
    assert frames.remote == sum(remote)
    for bits, row in zip(frames.bits.tolist(), rows, strict=True):
        _, _, identifier, is_extended, size, content, is_fd, _, is_remote = row
        if is_fd or is_remote:
            # A data frame's bits but the data, whatever is stuffed: 34 or 54, CRC included, and 13 behind it.
            fewest = (54 if is_extended else 34) + 13
            assert bits == 0 if is_fd else fewest <= bits < fewest + 10
        else:
            sent = Queued(0.0, identifier, content.to_bytes(8, "big")[:size], is_extended)
            assert bits == bits_of(sent)


def test_a_log_has_each_field_of_each_frame(tmp_path: Path) -> None:
    frames = of_file(LOG, tmp_path, channel="can0")
    has(frames, ROWS)
    assert frames.start_s == pytest.approx(1_700_000_000.0001, abs=1e-6)
    # The first frame of the log is another channel's.
    assert frames.lead_us == pytest.approx(100, abs=0.3)
    assert (frames.errors, frames.error_numbers.tolist()) == (1, [4])
    assert frames.errors_us.tolist() == pytest.approx([300], abs=0.3)
    errors = frames.error_events()
    assert errors.times_s.tolist() == pytest.approx([400e-6], abs=3e-7)
    assert (errors.frames.tolist(), errors.values.tolist()) == ([4], [1])
    of_two = frames.events(np.array([7.0, 8.0]), np.array([1, 3]))
    assert (of_two.frames.tolist(), of_two.values.tolist()) == ([3, 6], [7, 8])
    assert of_two.times_s.tolist() == pytest.approx([350e-6, 600e-6], abs=3e-7)
    assert (frames.broken, frames.synthetic, frames.dropped) == ("", "", None)
    other = of_file(LOG, tmp_path, channel="can1")
    assert (other.identifiers.tolist(), other.numbers.tolist(), other.lead_us, other.errors) == ([0x7FF], [1], 0, 0)


def packet_of(row: Any) -> bytes:
    """Linux, Documentation/networking/can.rst and link type 227."""
    _, _, identifier, is_extended, size, data, fd, switched, remote = row
    word = identifier | is_extended << 31 | remote << 30
    content = b"" if remote else data.to_bytes(8, "big")[:size].ljust(size, b"\xee")
    if fd:
        return struct.pack(">IBBH", word, size, 4 | switched, 0) + content.ljust(64, b"\0")
    return struct.pack(">IBBH", word, size, 0, 0) + content.ljust(8, b"\0")


ERROR = struct.pack(">IBBH", 1 << 29 | 4, 8, 0, 0) + bytes(8)
SHORT = b"\0" * 7


def captured(form: Callable[..., bytes], **options: Any) -> bytes:
    """The log's frames of can0 as a capture, whose fourth packet is an error frame and whose first is no frame."""
    content = [(0.0, SHORT), *((row[0], packet_of(row)) for row in ROWS), (400.0, ERROR)]
    whole = form(sorted(content), **options)
    at = 20 if form is pcap else whole.index(struct.pack("<I", 65535)) - 4
    return whole[:at] + struct.pack("<H", 227) + whole[at + 2 :]


@pytest.mark.parametrize("form", [pcap, pcapng])
def test_a_capture_of_socketcan_has_what_the_log_has(form: Callable[..., bytes], tmp_path: Path) -> None:
    frames = of_file(captured(form), tmp_path)
    has(frames, ROWS)
    assert frames.start_s == pytest.approx(1_700_000_000.0001, abs=1e-6)
    assert frames.lead_us == pytest.approx(100, abs=0.3)
    assert (frames.errors, frames.error_numbers.tolist()) == (1, [4])
    assert (frames.broken, frames.synthetic) == ("", "")
    assert frames.dropped == (None if form is pcap else 0)


def test_a_capture_of_socketcan_that_is_cut_or_drops_says_so(tmp_path: Path) -> None:
    whole = captured(pcapng)
    size = len(whole) - whole.rindex(struct.pack("<I", 6) + struct.pack("<I", 32 + 16))
    cut = of_file(whole[:-1], tmp_path)
    assert (len(cut.times_us), cut.broken) == (len(ROWS) - 1, f"damaged at byte {len(whole) - size:,}")
    assert of_file(whole + statistics(5, 12), tmp_path).dropped == 12
    # From whole frames to 29 bits, and data of 72 bytes even where the flag of CAN FD is missing.
    plain = whole.replace(struct.pack(">IBB", 0x124, 12, 5), struct.pack(">IBB", 0x124, 12, 1))
    has(of_file(plain, tmp_path), ROWS)


@pytest.mark.parametrize(
    ("text", "channel", "words"),
    [
        (LOG, None, "has frames of 2 channels: can0 (8 frames), can1 (1 frame); --channel NAME reads one"),
        (LOG, "can2", "channel can2: no such channel; there are can1, can0"),
        (LOG, "x" * 40, f"channel {'x' * 40}: no such channel; there are can1, can0"),
        (LOG, "x" * 41, f"channel {'x' * 40}...: no such channel; there are can1, can0"),
        ("(1.0) can0 20000088#\n" * 2, None, "has no CAN frame but 2 error frames"),
        ("# nothing\n", None, "has no CAN frame"),
        ("(-1) can0 181#\n", None, "has no CAN frame (a stamp of -1 s)"),
        (" can0  181   [2]  0A 0B\n", None, "has no CAN frame (line 1 has no time; record with `candump -l`)"),
        ("181#0011\n", None, None),
    ],
)
def test_a_log_without_the_frames_that_are_asked_for_is_refused(
    text: str, channel: str | None, words: str | None, tmp_path: Path
) -> None:
    with pytest.raises(BusplanError) as caught:
        of_file(text, tmp_path, channel=channel)
    unknown = "text of candump, Vector's ASC and BLF, PEAK's TRC, captures of SocketCAN"
    words = words or f"is not a CAN log in a known format: {unknown}"
    assert str(caught.value) == f"{tmp_path}/bus.log: {words}"


@pytest.mark.parametrize(
    ("line", "broken"),
    [
        ("nonsense", "line 2 is not a candump line: 'nonsense'"),
        ("n" * 61, f"line 2 is not a candump line: '{'n' * 60}'"),
        ("n" * 4094, f"line 2 is not a candump line: '{'n' * 60}'"),
        ("n" * 4095, "a line of 4,096 bytes or more"),
        ("can0 181#00", "line 2 has no time; record with `candump -l`"),
        ("(8589934592.0) can0 181#00", "a stamp of 8.58993e+09 s"),
        ("(1.0) can0 181##1" + 65 * "00", "data of 65 bytes"),
        ("(86401.0) can0 181#00", ""),
        ("(86401.1) can0 181#00", "a stamp 1.0 days after the one before"),
        ("(1.0) can0 181##1" + 64 * "00", ""),
    ],
)
def test_a_line_that_is_no_frame_ends_the_log(line: str, broken: str, tmp_path: Path) -> None:
    frames = of_file(f"(1.0) can0 180#00\n{line}\n(86401.0) can0 182#00\n", tmp_path)
    assert (frames.broken, len(frames.times_us)) == (broken, 1 if broken else 3)


def test_an_error_frame_without_a_stamp_is_one_that_came_at_no_time(tmp_path: Path) -> None:
    stamps = ("-0.5", "8589934592.0", "0", "1.5", "nan")
    lines = "".join(f"({stamp}) can0 20000088#\n" for stamp in stamps)
    frames = of_file(f"{lines}(1.0) can0 181#\n", tmp_path)
    assert (frames.broken, frames.errors, frames.error_numbers.tolist()) == ("", 5, [1, 2, 3, 4, 5])
    found = frames.error_events()
    # The log begins with the third.
    assert (found.times_s.tolist(), found.frames.tolist()) == ([0, 1.5], [3, 4])
    assert frames.lead_us == 1e6


def test_progress_is_the_part_of_the_log_that_was_read(tmp_path: Path) -> None:
    path, told = tmp_path / "bus.log", list[tuple[int, int]]()
    path.write_text("(1700000000.000000) can0 123#\n" * 11_000)
    read_can(path, progress=lambda *sizes: told.append(sizes))
    (first, size), (second, _) = told
    assert size == path.stat().st_size == 30 * 11_000
    assert 30 * 5000 <= first < second < size


def test_text_of_candump_is_what_python_can_reads(tmp_path: Path) -> None:
    random, path = Random(3), tmp_path / "bus.log"
    with can.CanutilsLogWriter(str(path)) as log:
        for number in range(300):
            is_fd, extended = random.random() < 0.4, random.random() < 0.4
            size = random.choice((*range(9), *(12, 16, 20, 24, 32, 48, 64) * is_fd))
            log(
                can.Message(
                    1_700_000_000 + number / 7,
                    random.randrange(1 << (29 if extended else 11)),
                    is_extended_id=extended,
                    is_fd=is_fd,
                    bitrate_switch=is_fd and random.random() < 0.5,
                    error_state_indicator=is_fd and random.random() < 0.5,
                    is_error_frame=random.random() < 0.1,
                    is_rx=random.random() < 0.5,
                    data=random.randbytes(size),
                )
            )
    with path.open("a") as log_with_flags:
        # The flag of 29 bits is no part of the identifier.
        log_with_flags.write("(1700000050.000000) vcan0 80000181#0A\n")
    numbered = list(enumerate(can.CanutilsLogReader(str(path)), start=1))
    sent = [(number, message) for number, message in numbered if not message.is_error_frame]
    start_s = sent[0][1].timestamp
    frames = of_file(path.read_bytes(), tmp_path)
    has(
        frames,
        [
            (
                (message.timestamp - start_s) * 1e6,
                number,
                message.arbitration_id,
                message.is_extended_id,
                message.dlc,
                int.from_bytes(bytes(message.data[:8]).ljust(8, b"\0"), "big"),
                message.is_fd,
                message.bitrate_switch,
                False,
            )
            for number, message in sent
        ],
    )
    assert frames.errors == len(numbered) - len(sent)


def test_channels_are_counted_up_to_a_bound(tmp_path: Path) -> None:
    def log(channels: int) -> str:
        return "".join(f"(1.{number:06d}) can{number} 181#00\n" for number in range(channels))

    with pytest.raises(BusplanError, match=r"has frames of 256 channels: .* and 248 more; --channel NAME reads one$"):
        of_file(log(256), tmp_path)
    assert of_file(log(256), tmp_path, channel="can9").broken == ""
    assert of_file(log(257), tmp_path, channel="can9").broken == "over 256 channels"


def test_bits_of_frames_are_those_written_one_by_one(tmp_path: Path) -> None:
    random, sent = Random(1), []
    for _ in range(150):
        extended = random.random() < 0.4
        data = bytes(random.choice((0, 0, 255, 255, 0x0F, 0xC3, 0x3E, random.randrange(256))) for _ in range(8))
        identifier = random.choice((0, 1 << 10, random.randrange(1 << (29 if extended else 11))))
        sent.append(Queued(0.0, identifier, data[: random.randint(0, 8)], extended))
    names = [f"{frame.identifier:0{8 if frame.extended else 3}X}#{frame.data.hex()}" for frame in sent]
    frames = of_file("".join(f"(1.0) can0 {name}\n" for name in names), tmp_path)
    assert frames.bits.tolist() == [*map(bits_of, sent)]


def test_a_classical_frame_has_8_bytes_whatever_more_its_length_code_says(tmp_path: Path) -> None:
    """ISO 11898-1: codes 9 to 15 mean 8 bytes, and stand on the wire as they are."""
    head = "date Sam Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\ninternal events logged\n"
    codes, data = [*range(8, 16)], 0x0011223344556677
    lines = [f"{code / 100:.6f} 1  181  Rx   d {code:X} {data.to_bytes(8, 'big').hex(' ')}\n" for code in codes]
    frames = of_file(head + "".join(lines), tmp_path, name="bus.asc")
    assert frames.sizes.tolist() == [8] * 8
    alike = np.zeros(8, dtype=bool)
    expected = written_bits(np.full(8, 0x181), alike, alike, np.array(codes), np.full(8, data, dtype=np.uint64))
    assert frames.bits.tolist() == expected.tolist()
    assert len({*expected.tolist()}) > 1


@pytest.fixture(scope="module")
def blf(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, bytes]:
    """A BLF of ten frames, by python-can: its head, and the data of its container."""
    path = tmp_path_factory.mktemp("blf") / "bus.blf"
    with can.Logger(str(path)) as writer:
        for number in range(10):
            stamp_s, data = 1_700_000_000 + number, bytes([number])
            writer(can.Message(stamp_s, arbitration_id=0x181, is_extended_id=False, data=data, channel=0))
    content = path.read_bytes()
    at = content.index(b"LOBJ")
    return content[:at], zlib.decompress(content[at + 32 :])


def test_objects_of_a_blf_are_read_up_to_the_first_that_cannot_be_one(blf: tuple[bytes, bytes], tmp_path: Path) -> None:
    head, data = blf

    def object_of(kind: int, content: bytes, *, signature: bytes = b"LOBJ", size: int | None = None) -> bytes:
        size = 16 + len(content) if size is None else size
        return struct.pack("<4sHHII", signature, 16, 1, size, kind) + content + bytes(size % 4)

    def container(method: int, content: bytes) -> bytes:
        return object_of(10, struct.pack("<H6xII", method, len(content), 0) + content)

    def read(*objects: bytes) -> tuple[int, str]:
        frames = of_file(head + b"".join(objects), tmp_path, name="bus.blf")
        assert frames.data.tolist() == [number % 10 << 56 for number in range(len(frames.data))]
        assert frames.times_us[:10].tolist() == [number * 1e6 for number in range(10)]
        return len(frames.data), frames.broken

    plain, deflated = container(0, data), container(2, zlib.compress(data))
    other = object_of(65, b"another object")
    assert read(plain) == read(deflated) == read(other, plain, other) == (10, "")
    assert read(plain, deflated) == (20, "")
    # A frame goes on in the next container.
    assert read(container(0, data[:200]), other, container(2, zlib.compress(data[200:]))) == (10, "")
    broken = "damaged data where an object of the log should begin"
    for damaged, why in (
        (object_of(10, b"", signature=b"LOBX"), broken),
        (object_of(10, b"", size=15), broken),
        (object_of(65, b"", size=16_000_001), "an object of over 16,000,000 bytes"),
        (container(1, data), "a container that is compressed by method 1"),
    ):
        assert read(plain, damaged, plain) == (10, why)
    assert read(plain, object_of(10, b"", size=16)[:16], plain)[1].startswith("error: unpack_from requires")
    # An object that goes on from one container to the next is held, up to 16 MB.
    begun = container(2, zlib.compress(struct.pack("<4sHHII", b"LOBJ", 16, 1, 2**32 - 256, 1) + bytes(10**7 - 16), 1))
    for size, why in ((6 * 10**6, ""), (6 * 10**6 + 1, "a container of over 16,000,000 bytes")):
        assert read(plain, begun, container(2, zlib.compress(bytes(size), 1))) == (10, why)


# --- EtherCAT ---------------------------------------------------------------------------------------------

SENT = ((LRW, 0x10203040, 1400), (FRMW, 0x1300000, 8))


def of_capture(frames: list[tuple[float, bytes]], folder: Path) -> EthercatFrames:
    path = folder / "bus.pcapng"
    path.write_bytes(pcapng(frames))
    return read_ethercat(path, progress=nobody)


def test_a_capture_has_each_field_of_each_frame(tmp_path: Path) -> None:
    def frame(index: int, *counters: int, datagrams: Any = SENT, tag: bytes = b"") -> bytes:
        return ethernet(datagrams, index=index, counters=counters or (0, 0), returned=bool(counters), tag=tag)

    arp, cut = b"\xff" * 12 + b"\x08\x06" + bytes(46), frame(3)[:-1]
    tagged = frame(1, 3, 4, tag=b"\x81\x00\x00\x05")
    sent = [frame(1), tagged, arp, frame(2), frame(2, 3, 0), frame(2, 3, 4), cut, frame(1, datagrams=SENT[:1])]
    found = of_capture([(100.0 + 10 * place, content) for place, content in enumerate(sent)], tmp_path)
    start_ns = 1_700_000_000 * 10**9 + 100_000
    assert found.notes.start_ns == start_ns
    assert (found.times_ns - start_ns).tolist() == [0, 10_000, 30_000, 40_000, 50_000, 70_000]
    assert found.numbers.tolist() == [1, 2, 4, 5, 6, 8]
    assert found.returned.tolist() == [False, True, False, True, True, False]
    assert [found.layouts[number] for number in found.layout.tolist()] == [
        *[(Datagram(LRW, 0x10203040, 1400), Datagram(FRMW, 0, 8))] * 5,
        (Datagram(LRW, 0x10203040, 1400),),
    ]
    assert [datagram.is_logical for datagram in found.layouts[found.layout[0]]] == [True, False]
    # A frame returns with its key, and only its index tells it from the next one.
    first, back, second, *others, short = found.key.tolist()
    assert (first, second) == (back, others[0])
    assert (others[0] == others[1], len({first, second, short})) == (True, 3)
    sent_counters, counters, _, wrong, right, _ = found.counters.tolist()
    assert (counters == right, len({sent_counters, counters, wrong})) == (True, 3)
    assert (found.others, found.cut, found.latches, found.unlatched) == (1, 1, (), 0)
    of_one = found.events(np.array([5.0]), np.array([3]))
    assert (of_one.values.tolist(), of_one.times_s.tolist(), of_one.frames.tolist()) == ([5], [40e-6], [5])


def test_frames_that_cannot_be_told_apart_are_refused(tmp_path: Path) -> None:
    own = [(float(place), ethernet(SENT, index=place, counters=(0, 0))) for place in range(3)]
    local = [(us, packet[:6] + b"\x02" + packet[7:]) for us, packet in own]
    with pytest.raises(BusplanError, match=r"all frames have a source address with the bit 0x02 of its first byte"):
        of_capture(local, tmp_path)
    others = [(us + 0.5, packet[:11] + b"\x99" + packet[12:]) for us, packet in own[:1]]
    masters = r"2 masters: 00:11:22:33:44:55 \(3 frames\), 00:11:22:33:44:99 \(1 frame\); keep the frames of one"
    with pytest.raises(BusplanError, match=masters):
        of_capture(sorted(own + others), tmp_path)
    cut = [(us, packet[:-1]) for us, packet in own]
    with pytest.raises(BusplanError, match=r"type 0x88A4\) among 4 Ethernet packets, 3 of them cut: record whole"):
        of_capture([*cut, (9.0, bytes(60))], tmp_path)


def test_port_times_are_those_behind_the_last_write_that_latches_them(tmp_path: Path) -> None:
    hops_ns, clocks_ns = (700, 690), (2**32 - 1000, 5, 77_000)
    first, second = start_up(hops_ns, clocks_ns=clocks_ns), start_up(hops_ns, clocks_ns=(1, 2, 3), read=APRD, width=4)
    cycle = [(9e3 + place, ethernet(SENT, index=place, counters=(1, 1))) for place in range(2)]
    # Reads of no port's time, of an answer that no device gave, and of another register.
    none = [
        (6e3, register(FPRD, 0x1000, 0x910, bytes(8), 1, returned=True)),
        (6.1e3, register(FPRD, 0x1001, 0x900, b"\7" * 16, 0, returned=True)),
        (6.2e3, register(FPRD, 0x1001, 0x904, b"\7" * 3, 1, returned=True)),
        (6.3e3, register(BWR, 3, 0x904, bytes(4), 3, returned=True)),
    ]
    later = [(us + 5000, packet) for us, packet in second]
    before, after = of_capture(first + later + none + cycle, tmp_path).latches
    assert before.devices == after.devices == 3
    # From one port to the other there and back: twice all hops behind the device.
    assert before.ports_ns == {
        (FPRD, 0x1000): {0: 2**32 - 1000, 1: 2 * (700 + 690) - 1000, 2: 0, 3: 0},
        (FPRD, 0x1001): {0: 5, 1: 5 + 2 * 690, 2: 0, 3: 0},
        (FPRD, 0x1002): {0: 77_000, 1: 0, 2: 0, 3: 0},
    }
    assert after.ports_ns == {
        (APRD, 3): {0: 1, 1: 1 + 2 * (700 + 690), 2: 0, 3: 0},
        (APRD, 2): {0: 2, 1: 2 + 2 * 690, 2: 0, 3: 0},
        (APRD, 1): {0: 3, 1: 0, 2: 0, 3: 0},
    } | {(FPRD, 0x1001): {}}
    found = of_capture([*first[2:], *cycle], tmp_path)
    assert (found.latches, found.unlatched) == ((), 3)


# --- captures ---------------------------------------------------------------------------------------------


def block(kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    return struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12)


def option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def test_each_interface_has_its_ticks_and_its_offset(tmp_path: Path) -> None:
    """RFC draft pcapng: if_tsresol is a power of ten, or of two with its highest bit; if_tsoffset has seconds."""
    interfaces = {
        (): 10**6,
        ((9, b"\x09"),): 10**9,
        ((2, b"a name"), (9, b"\x8a"), (14, struct.pack("<q", 5))): 2**10,
        ((14, struct.pack("<q", -3)), (9, b"\x00")): 1,
        ((14, b"\1"), (9, b"")): 10**6,
        ((9, b"\x13"),): 10**18,  # more digits than a stamp has room for
    }
    offsets_s = (0, 0, 5, -3, 0, 0)
    comment = "synthetic: of a test" + "." * 300
    words = option(1, comment.encode()) + option(2, b"synthetic: hardware") + option(1, b"a comment")
    content = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1) + words)
    for options in interfaces:
        content += block(1, struct.pack("<HHI", 1, 0, 0) + b"".join(option(*one) for one in options))
    content += block(0xBAD, b"a custom block")
    content += block(6, struct.pack("<IIIII", 0, 0, 0, 4, 4) + b"1970")
    for number, ticks in enumerate(interfaces.values()):
        at = (10 + number) * ticks + ticks // 4
        fields = struct.pack("<IIIII", number, at >> 32, at & 0xFFFFFFFF, number + 1, number + 1)
        content += block(6, fields + bytes([65 + number] * (number + 1)))
    path, notes, calls = tmp_path / "bus.pcapng", CaptureNotes(), []
    path.write_bytes(content)
    (piece,) = packets(path, notes, progress=lambda *sizes: calls.append(sizes))
    # A quarter of a second is no tick of whole seconds.
    expected = [(10 + number + offset) * 10**9 + 250_000_000 for number, offset in enumerate(offsets_s)]
    expected[3] -= 250_000_000
    assert piece.times_ns.tolist() == [0, *expected]
    assert piece.numbers.tolist() == [1, 2, 3, 4, 5, 6, 7]
    read = [piece.content[at : at + size].tobytes() for at, size in zip(piece.starts, piece.sizes, strict=True)]
    assert read == [b"1970", b"A", b"BB", b"CCC", b"DDDD", b"EEEEE", b"FFFFFF"]
    assert (notes.packets, notes.start_ns, notes.left_out, notes.dropped) == (7, 0, 0, 0)
    assert (notes.interfaces, notes.broken_at, notes.is_long) == ({0, 1, 2, 3, 4, 5}, None, False)
    assert notes.synthetic == comment[:200]
    assert calls == [(len(content), len(content))]


def test_a_comment_of_an_interface_is_no_mark_of_the_file(tmp_path: Path) -> None:
    words = option(1, b"synthetic: an interface")
    content = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    content += block(1, struct.pack("<HHI", 1, 0, 0) + words) + block(0xBAD, bytes(40))
    path, notes = tmp_path / "bus.pcapng", CaptureNotes()
    path.write_bytes(content)
    assert (list(packets(path, notes, progress=nobody)), notes.synthetic, notes.broken_at) == ([], "", None)


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="this system names no open files")
def test_a_pipe_that_a_shell_opened_is_read_to_its_end() -> None:
    """As of `busplan measured PROFILE <(command)`."""
    reading, writing = os.pipe()
    whole = pcapng([(0.0, b"one"), (1.0, b"two")])
    os.write(writing, whole)
    os.close(writing)
    notes = CaptureNotes()
    (piece,) = packets(Path(f"/dev/fd/{reading}"), notes, progress=nobody)
    os.close(reading)
    assert (len(piece.starts), notes.packets, notes.broken_at) == (2, 2, None)


@pytest.mark.parametrize(
    ("damage", "used"),
    [
        (struct.pack("<II", 6, 8), True),  # shorter than the shortest block
        (struct.pack("<II", 6, 34), True),  # of no whole words
        (struct.pack("<II", 6, 1_000_004), True),  # longer than any
        (struct.pack("<II", 0x0A0D0D0A, 28) + b"\1\2\3\4", True),  # a section of no byte order
        (struct.pack("<II", 6, 1_000_000), True),  # cut
        (block(6, bytes(16)), False),  # a packet without its fields
        (block(1, b"\1\0\0\0"), False),  # an interface without them
    ],
)
def test_a_block_that_cannot_be_one_ends_a_capture_where_it_begins(damage: bytes, used: bool, tmp_path: Path) -> None:
    whole = pcapng([(0.0, b"one"), (1.0, b"two")])
    path, notes = tmp_path / "bus.pcapng", CaptureNotes()
    path.write_bytes(whole + damage + bytes(8 * used) + whole[28:])
    pieces = list(packets(path, notes, progress=nobody))
    assert sum(len(piece.starts) for piece in pieces) == (2 if used else 4)
    assert notes.broken_at == (len(whole) if used else None)


def test_what_is_written_is_what_the_formats_say() -> None:
    """Blocks of the draft on pcapng, each written by hand."""
    content = written.pcapng([(5 * 2**32 + 7, b"seven b"), (2**63, b"four")], link=227, origin="a test")
    assert content == b"".join(
        (
            block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1) + option(1, b"synthetic: a test") + bytes(4)),
            block(1, struct.pack("<HHI", 227, 0, 65535) + option(2, b"synthetic") + option(9, b"\x09") + bytes(4)),
            block(6, struct.pack("<IIIII", 0, 5, 7, 7, 7) + b"seven b"),
            block(6, struct.pack("<IIIII", 0, 2**31, 0, 4, 4) + b"four"),
        )
    )
    lines = [(1_700_000_000_000_001, "181#00"), (999_999, "7FF#")]
    assert written.candump(lines) == b"(1700000000.000001) synthetic 181#00\n(0000000000.999999) synthetic 7FF#\n"


@pytest.mark.parametrize("form", [pcap, pcapng])
@pytest.mark.parametrize("at_once", [1, 50, 1000])
def test_a_file_is_read_in_pieces_of_any_size(
    form: Callable[..., bytes], at_once: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    contents = [bytes([65 + number]) * (number * 7 % 30) for number in range(40)]
    path, notes = tmp_path / "bus.pcap", CaptureNotes()
    path.write_bytes(form([(10.0 * number, content) for number, content in enumerate(contents)]))
    monkeypatch.setattr("busplan.recordings.capture._PIECE_BYTES", at_once)
    read, times_ns, calls = [], [], []
    for piece in packets(path, notes, progress=lambda *sizes: calls.append(sizes)):
        read += [piece.content[at : at + size].tobytes() for at, size in zip(piece.starts, piece.sizes, strict=True)]
        times_ns += piece.times_ns.tolist()
    assert read == contents
    assert [us - times_ns[0] for us in times_ns] == [10_000 * number for number in range(40)]
    assert (notes.packets, notes.broken_at) == (40, None)
    assert calls == sorted(calls)
    assert calls[-1] == (path.stat().st_size,) * 2


@pytest.mark.parametrize("form", [pcap, pcapng])
def test_so_many_packets_are_read_and_no_more(
    form: Callable[..., bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "bus.pcap"
    written_after = [form([(10.0 * number, b"same") for number in range(count)]) for count in (3, 5)]
    path.write_bytes(written_after[1])
    monkeypatch.setattr("busplan.recordings.capture._PIECE_BYTES", len(written_after[0]) - 24 * (form is pcap))
    for most, is_long in ((3, True), (4, False)):
        monkeypatch.setattr("busplan.recordings.capture.MOST_PACKETS", most)
        notes = CaptureNotes()
        count = sum(len(piece.starts) for piece in packets(path, notes, progress=nobody))
        # The rest of a piece is read, too.
        assert count == (3 if is_long else 5)
        assert (notes.is_long, notes.broken_at) == (True, len(written_after[not is_long]))


def test_so_many_frames_of_a_log_are_read_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("busplan.recordings.can._MOST_FRAMES", 3)
    frames, errors = "(1.0) can0 181#00\n", "(1.0) can0 20000088#\n"
    for log, broken in (
        (3 * frames, ""),
        (2 * errors + frames, ""),
        (4 * frames, "it has more than 3 frames; give a part of it"),
        (frames + 4 * errors, "it has more than 3 frames; give a part of it"),
    ):
        found = of_file(log, tmp_path)
        assert (found.broken, found.errors <= 3, len(found.times_us) <= 3) == (broken, True, True)


def test_data_of_more_bytes_than_a_frame_has_end_a_capture(tmp_path: Path) -> None:
    long = struct.pack(">IBBH", 0x181, 65, 4, 0) + bytes(65)
    whole = captured(pcap)
    record = struct.pack("<IIII", 1_700_000_000, 2_000_000, len(long), len(long)) + long
    frames = of_file(whole + record + whole[24:], tmp_path)
    assert (len(frames.times_us), frames.broken) == (len(ROWS), "data of 65 bytes")


def test_a_capture_is_synthetic_by_the_address_of_its_port(tmp_path: Path) -> None:
    own, other = (
        of_capture([(0.0, ethernet(SENT, index=0, counters=(0, 0), master=master))], tmp_path).notes.synthetic
        for master in (written.SYNTHETIC_PORT, bytes(6))
    )
    assert (own, other) == ("synthetic by the address of its port", "")
    assert of_file("(1.0) synthetic 181#\n", tmp_path).synthetic == "synthetic by the name of its channel"
