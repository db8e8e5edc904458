"""Forms of logs and databases that real files have: each says the same as the form that every tool writes."""

import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan.profile.machine_files import FORMATS

Frame = tuple[float, int, bytes]
FRAMES: list[Frame] = [
    (3000 + number / 100 + offset, identifier, bytes([number % 256, *range(size - 1)]))
    for number in range(100)
    for offset, identifier, size in ((0, 0x123, 8), (0.001, 0x18FEF100, 3))
]
EXTENDED = 0x18FEF100


def candump_l(frame: Frame, channel: str = "can0") -> str:
    stamp, identifier, data = frame
    return f"({stamp:.6f}) {channel} {identifier:0{8 if identifier > 0x7FF else 3}X}#{data.hex().upper()}\n"


def on_terminal(frame: Frame, *, stamp: str = "({:.6f})", marks: str = "") -> str:
    at, identifier, data = frame
    number = f"{identifier:0{8 if identifier > 0x7FF else 3}X}"
    return f" {stamp.format(at)}  can0  {marks}{number}   [{len(data)}]  {' '.join(f'{each:02X}' for each in data)}\n"


def socketcan(frame: Frame) -> bytes:
    """Linux, Documentation/networking/can.rst and the link type 227: identifier and flags, length, flags, data."""
    _, identifier, data = frame
    return struct.pack(">IBBH", identifier | (1 << 31 if identifier > 0x7FF else 0), len(data), 0, 0) + data


def pcap(order: str) -> bytes:
    head = struct.pack(f"{order}IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227)
    packets = [(frame[0], socketcan(frame)) for frame in FRAMES]
    return head + b"".join(
        struct.pack(f"{order}IIII", int(at), round(at % 1 * 1e6), len(packet), len(packet)) + packet
        for at, packet in packets
    )


def pcapng(*, interfaces: int = 1) -> bytes:
    def block(kind: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        return struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12)

    content = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    content += block(1, struct.pack("<HHI", 227, 0, 0)) * interfaces
    for number, frame in enumerate(FRAMES):
        us, packet = round(frame[0] * 1e6), socketcan(frame)
        place = struct.pack("<IIIII", number % interfaces, us >> 32, us & 0xFFFFFFFF, len(packet), len(packet))
        content += block(6, place + packet)
    return content


BIT_RATE = 500
"""These logs are too quiet to show one [kbit/s]."""
TEXTS: dict[str, Callable[[], str | bytes]] = {
    "comments before": lambda: "# recorded on the boat\n#\n\n" + "".join(map(candump_l, FRAMES)),
    "comments between": lambda: "".join(f"# one\n{candump_l(frame)}" for frame in FRAMES),
    "padded stamps": lambda: "".join(candump_l(frame).replace("(", "(   ") for frame in FRAMES),
    "as on a terminal": lambda: "".join(map(on_terminal, FRAMES)),
    "as on a terminal with -x": lambda: "".join(on_terminal(frame, marks="RX - -  ") for frame in FRAMES),
    "the direction": lambda: "".join(candump_l(frame).replace("\n", " R\n") for frame in FRAMES),
    "pcap": lambda: pcap("<"),
    "pcap of the other byte order": lambda: pcap(">"),
    "pcapng": pcapng,
}


def rows(path: Path, **options: Any) -> list[tuple[str, Any]]:
    answer = busplan.import_profile(path, bit_rate_kbit_s=BIT_RATE, **options)
    return [(row.dotted, row.plain) for row in answer.rows]


def written(tmp_path: Path, content: str | bytes, name: str = "drive.log") -> Path:
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("case", TEXTS)
def test_each_form_of_a_log_says_what_candump_l_says(case: str, tmp_path: Path) -> None:
    usual = rows(written(tmp_path, "".join(map(candump_l, FRAMES)), "usual.log"))
    assert ("message.id-0x123.period_us", 10_000) in usual
    assert rows(written(tmp_path, TEXTS[case]())) == usual


def test_a_log_of_can_fd_on_a_terminal_is_that_of_candump_l(tmp_path: Path) -> None:
    data = bytes(range(12))
    usual = "".join(f"({number / 100:.6f}) can0 123##1{data.hex()}\n" for number in range(50))
    shown = "".join(
        f" ({number / 100:.6f})  can0  RX B -  123  [12]  {data.hex(' ').upper()}\n" for number in range(50)
    )
    assert rows(written(tmp_path, shown)) == rows(written(tmp_path, usual, "usual.log"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("".join(on_terminal(frame, stamp="").lstrip("\n") for frame in FRAMES), "line 1 has no time; record with"),
        (pcapng(interfaces=2), "has frames of 2 interfaces; export those of one bus"),
    ],
)
def test_a_log_that_shows_no_times_or_two_buses_is_refused(content: str | bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(busplan.BusplanError, match=words):
        busplan.import_profile(written(tmp_path, content))


def test_a_frame_of_a_capture_that_no_bus_sends_ends_the_log(tmp_path: Path) -> None:
    content = pcap("<")
    at = 24 + 50 * (16 + 16) + 50 * (16 + 11) + 16 + 4
    assert content[at] == len(FRAMES[100][2])
    path = written(tmp_path, content[:at] + b"\xf1" + content[at + 1 :])
    words = "cut or damaged after frame 100, read up to there: data of 241 bytes"
    assert any(words in remark for remark in busplan.import_profile(path, bit_rate_kbit_s=BIT_RATE).remarks)


def test_one_channel_of_several_is_read(tmp_path: Path) -> None:
    both = "".join(candump_l(frame, f"can{number % 2}") for number, frame in enumerate(FRAMES))
    alone = "".join(candump_l(frame, "can1") for frame in FRAMES[1::2])
    log = written(tmp_path, both)
    assert rows(log, channel="can1") == rows(written(tmp_path, alone, "alone.log"))
    with pytest.raises(busplan.BusplanError, match="channel can2: no such channel; there are can0, can1"):
        busplan.import_profile(log, channel="can2")
    plan = busplan.import_profile(log, channel="can1", bit_rate_kbit_s=BIT_RATE).profile
    assert busplan.measured(plan, log, channel="can1").outside == ()
    with pytest.raises(busplan.BusplanError, match="--channel NAME reads one"):
        busplan.measured(plan, log)


DBC = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: A\n\n{messages}\n{attributes}\n'
CYCLE = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'


def database(tmp_path: Path, messages: str, attributes: str = "") -> Path:
    return written(tmp_path, DBC.format(messages=messages, attributes=CYCLE + attributes), "car.dbc")


def test_identifiers_of_29_bits_without_bit_31_are_taken_and_said(tmp_path: Path) -> None:
    text = ' SG_ S : 0|8@1+ (1,0) [0|255] "" A\n'
    for number in (EXTENDED, EXTENDED + (1 << 31)):
        cycle = f'BA_ "GenMsgCycleTime" BO_ {number} 100;\nCM_ BO_ {number} "of the engine";\n'
        answer = busplan.import_profile(database(tmp_path, f"BO_ {number} Engine: 8 A\n{text}", cycle))
        profile: Any = answer.profile
        assert (profile.bus.identifier_bits, profile.message[0].identifier) == (29, EXTENDED)
        assert profile.message[0].period_us == 100_000
        assert any("without bit 31 are taken for 29 bits: 0x18FEF100" in words for words in answer.remarks) == (
            number == EXTENDED
        )


def test_undefined_attributes_and_texts_over_two_lines_are_read(tmp_path: Path) -> None:
    attributes = (
        'BA_ "SingleFrame" BO_ 256 1;\nBA_ "GenMsgCycleTime" BO_ 256 20;\n'
        'VAL_ 256 S 1 "the first;\n of two \\"lines\\"" 0 "off" ;\n'
    )
    text = 'BO_ 256 Speed: 8 A\n SG_ S : 0|8@1+ (1,0) [0|255] "" A\n'
    answer = busplan.import_profile(database(tmp_path, text, attributes))
    profile: Any = answer.profile
    assert [(each.name, each.period_us) for each in profile.message] == [("Speed", 20_000)]
    assert any(
        words.endswith("attributes that it does not define are left out: SingleFrame") for words in answer.remarks
    )


def test_a_period_for_all_is_assumed_and_shows_no_plan_to_fit(tmp_path: Path) -> None:
    path = database(tmp_path, "BO_ 256 Speed: 8 A\nBO_ 257 Torque: 8 A\n", 'BA_ "GenMsgCycleTime" BO_ 257 20;\n')
    alone = busplan.import_profile(path)
    assert any("left out, no file says its period" in words for words in alone.remarks)
    assert busplan.capacity(alone.profile).verdict == "fits"
    answer = busplan.import_profile(path, period_us=100_000)
    profile: Any = answer.profile
    assert [(each.name, each.period_us, each.period_grade) for each in profile.message] == [
        ("Speed", 100_000, "assumed"),
        ("Torque", 20_000, None),
    ]
    assert busplan.capacity(profile).verdict == "not shown to fit"
    measured = busplan.load_profile(profile, changes={"message.Speed.period_grade": "measured"})
    assert busplan.capacity(measured).verdict == "fits"
    assert busplan.check(profile).findings
    with pytest.raises(busplan.BusplanError, match="expected a finite number"):
        busplan.import_profile(path, period_us=float("nan"))


def test_a_message_named_as_a_frame_of_the_cycle_is_renamed_and_said(tmp_path: Path) -> None:
    path = database(tmp_path, "BO_ 256 SYNC: 8 A\n", 'BA_ "GenMsgCycleTime" BO_ 256 20;\n')
    answer = busplan.import_profile(path)
    profile: Any = answer.profile
    assert [each.name for each in profile.message] == ["SYNC-2"]
    assert "SYNC is SYNC-2 in the profile, where SYNC is a frame of the cycle" in answer.remarks


def test_a_log_with_the_predefined_set_says_what_makes_the_cycle(tmp_path: Path) -> None:
    frames = [
        (number / 100 + identifier / 1e6, identifier, bytes(4))
        for number in range(30)
        for identifier in (0x80, 0x181, 0x182, 0x201, 0x202)
    ]
    log = written(tmp_path, "".join(map(candump_l, frames)))
    answer = busplan.import_profile(log, bit_rate_kbit_s=BIT_RATE)
    assert any("SYNC and PDOs of CANopen's nodes n = 1, 2: the EDS or DCF" in words for words in answer.remarks)


KCD = """<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/><Node id="1" name="A"/>
<Bus name="Motor" baudrate="500000"><Message id="0x100" length="8" name="Speed" interval="10"/></Bus>
<Bus name="Comfort" baudrate="125000"><Message id="0x100" length="2" name="Door" interval="100"/></Bus>
</NetworkDefinition>"""


def test_one_bus_of_several_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, KCD, "car.kcd")
    for bus, name, rate in (("Motor", "Speed", 500), ("Comfort", "Door", 125)):
        profile: Any = busplan.import_profile(path, bus=bus).profile
        assert [(each.name, profile.bus.bit_rate_kbit_s) for each in profile.message] == [(name, rate)]
    with pytest.raises(busplan.BusplanError, match=r"messages of 2 buses, Comfort, Motor: .* --bus NAME reads one"):
        busplan.import_profile(path)
    with pytest.raises(busplan.BusplanError, match="bus Body: no messages of such a bus; there are Comfort, Motor"):
        busplan.import_profile(path, bus="Body")


@pytest.mark.parametrize(("option", "words"), [("bus", "database of messages"), ("channel", "CAN log")])
def test_an_option_for_no_file_is_refused(option: str, words: str, tmp_path: Path) -> None:
    path = written(tmp_path, (Path(__file__).parent / "files" / "axis-5.dcf").read_text(), "axis-5.dcf")
    with pytest.raises(busplan.BusplanError, match=f"{option} x: none of the files is a {words}"):
        busplan.import_profile(path, bus="x" if option == "bus" else None, channel="x" if option == "channel" else None)


def test_differences_name_a_message_by_its_name_and_identifier(tmp_path: Path) -> None:
    number = EXTENDED + (1 << 31)
    first = database(tmp_path, f"BO_ {number} Engine: 8 A\n", f'BA_ "GenMsgCycleTime" BO_ {number} 100;\n')
    other = tmp_path / "other.dbc"
    other.write_text(first.read_text().replace("Engine: 8", "Engine: 6"))
    answer = busplan.import_profile([first, other])
    assert any(words.startswith("Engine (0x18FEF100): payload_bytes is 8") for words in answer.remarks)


FILES = sorted((Path(__file__).parent / "files").iterdir())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
@pytest.mark.parametrize("command", ["capacity", "check", "plan"])
def test_a_machine_s_file_that_is_no_profile_is_named(path: Path, command: str, run: Callable[..., Any]) -> None:
    done = run(command, str(path))
    said = done.stdout if command == "check" else done.stderr
    assert "not a profile; convert it with `busplan import " in said
    assert done.returncode == (1 if command == "check" else 2)


def test_the_page_says_of_each_format_what_it_gives_and_what_not() -> None:
    page = (Path(busplan.__file__).parent / "manual" / "import.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?!file |---)(.*?) \| (.*?) \| (.*?) \|$", page, re.MULTILINE)
    assert all(gives and lacks for _, gives, lacks in rows)
    files = " ".join(file for file, _, _ in rows)
    for words in ("ENI", "ethercat-conf.xml", "ethercat slaves -v", "ethercat pdos", "slaveinfo", "DBC", "SYM", "KCD"):
        assert words in files
    for each in FORMATS:
        named = set(re.findall(r"[A-Za-z][A-Za-z.-]{2,}", each.title.partition("(")[0])) - {"root", "text"}
        assert any(word in files for word in named), each.title
    for words in ("ARXML", "candump", "ASC", "BLF", "TRC", "SocketCAN", "EDS", "DCF"):
        assert words in files
