"""Scans of a bus, LinuxCNC's file, databases of messages, CANopen files: one of each dialect, of our own making."""

import pickle
import re
from pathlib import Path
from typing import Any, Final

import pytest

import busplan
from busplan.sections.base import value_at

FILES: Final = Path(__file__).parent / "files"
MACHINE: Final = [("CP10", 1, 0, 0, 0), ("DI04", 1, 1, 0, 0), ("AX20", 2, 8, 6, 1)]
"""Name, devices, inputs, outputs and axes of the groups of the EtherCAT machine."""


def imported(*names: str, **options: Any) -> busplan.ImportAnswer:
    return busplan.import_profile([FILES / name for name in names], **options)


def groups(answer: busplan.ImportAnswer) -> list[tuple[Any, ...]]:
    return [(each.name, each.nodes, each.read_bytes, each.write_bytes, each.axes) for each in answer.profile.group]


@pytest.mark.parametrize("names", [("slaves.txt", "pdos.txt"), ("pdos.txt", "slaves.txt"), ("slaveinfo.txt",)])
def test_a_scan_has_bytes_and_measured_delays(names: tuple[str, ...]) -> None:
    answer = imported(*names)
    assert groups(answer) == MACHINE
    profile: Any = answer.profile
    # The drives behind the block: 0.67 us to the first, 0.70 to the second; the terminal 0.15.
    assert [group.delay_us for group in profile.group] == [None, 0.15, 0.685]
    assert profile.bus.master == {"slaves": "IgH", "pdos": "IgH", "slaveinfo": "SOEM"}[names[0].partition(".")[0]]
    assert profile.bus.mailbox_bytes == 128
    assert {row.fact.grade for row in answer.rows if row.key == "delay_us"} == {"measured"}
    assert "cycle.period_us = 1000" in answer.sentences()[-1]


def test_an_eni_has_the_frames_and_a_scan_beside_it_the_delays() -> None:
    answer = imported("slaves.txt", "machine.xml")
    profile: Any = answer.profile
    assert groups(answer) == MACHINE
    assert [group.delay_us for group in profile.group] == [None, 0.15, 0.685]
    assert (profile.cycle.period_us, profile.bus.sync_shift, profile.bus.mailbox_bytes) == (500, 0.25, 128)
    # Of the ENI, though the scan is of another master's tool.
    assert (profile.bus.master, profile.bus.process_data) == (None, "LRW-shared")
    assert profile.bus.housekeeping_bytes == (4, 4, 1, 2)
    # 40 bytes of a frame, 12 of each of five datagrams, and their data.
    assert any("its frame takes 10.24 us on the wire, as the profile has" in remark for remark in answer.remarks)
    assert "delay_us = 0.15            # measured: cable included, slaves.txt:39" in answer.text


def test_the_ports_of_a_scan_are_known() -> None:
    assert [value_at(group, "port") for group in imported("slaves.txt", "pdos.txt").profile.group] == [
        "100BASE-TX",
        "E-bus",
        "100BASE-TX",
    ]


def test_a_hop_over_devices_without_clock_is_shared_out(tmp_path: Path) -> None:
    text = (FILES / "slaves.txt").read_text(encoding="utf-8")
    head, _, last = text.partition("=== Master 0, Slave 2 ===")
    drive, _, end = last.partition("=== Master 0, Slave 3 ===")
    drive = drive.replace("clocks: yes, 64 bit", "clocks: no")
    slaves = tmp_path / "slaves.txt"
    slaves.write_text(f"{head}=== Master 0, Slave 2 ==={drive}=== Master 0, Slave 3 ==={end}", encoding="utf-8")
    answer = busplan.import_profile([slaves, FILES / "pdos.txt"])
    assert value_at(answer.profile.group[-1], "delay_us") == 0.35
    assert "shared with 1 without a clock" in answer.text


def test_linuxcnc_has_the_period_and_asks_for_the_bytes_of_typed_devices() -> None:
    answer = imported("ethercat-conf.xml", "pdos.txt")
    profile: Any = answer.profile
    assert [group[1:] for group in groups(answer)] == [group[1:] for group in MACHINE]
    assert (profile.cycle.period_us, profile.bus.sync_shift, profile.bus.distributed_clocks) == (500, 0.25, True)
    # BRD and FRMW of the master, and the headers of two further domains.
    assert profile.bus.housekeeping_bytes == (2, 4, 0, 0)
    with pytest.raises(busplan.BusplanError, match=r"device 0 \(CP10\), 1 \(DI04\) has .* `ethercat pdos`"):
        imported("ethercat-conf.xml")


def test_linuxcnc_may_leave_devices_out_that_a_scan_lists(tmp_path: Path) -> None:
    text = (FILES / "ethercat-conf.xml").read_text(encoding="utf-8")
    conf = tmp_path / "ethercat-conf.xml"
    conf.write_text(text.replace('    <slave idx="1" type="DI04" name="inputs"/>\n', ""), encoding="utf-8")
    assert len(busplan.import_profile([conf, FILES / "pdos.txt", FILES / "slaves.txt"]).profile.group) == 3
    with pytest.raises(busplan.BusplanError, match="no device 1, though there is device 3"):
        busplan.import_profile([conf])


def test_files_that_differ_say_so(tmp_path: Path) -> None:
    text = (
        (FILES / "ethercat-conf.xml")
        .read_text(encoding="utf-8")
        .replace('idx="603f" subIdx="00" bitLen="16"', 'idx="603f" subIdx="00" bitLen="8"')
    )
    (tmp_path / "conf.xml").write_text(text, encoding="utf-8")
    answer = busplan.import_profile([FILES / "pdos.txt", tmp_path / "conf.xml"])
    (said,) = (remark for remark in answer.remarks if "read_bytes" in remark)
    assert said.startswith("node 2: read_bytes is 7 at conf.xml:9 and 8 at pdos.txt:14; the first is used, in 1 more")
    assert answer.profile.group[-1].read_bytes == 7


def test_files_of_two_machines_are_refused(tmp_path: Path) -> None:
    shorter = (FILES / "pdos.txt").read_text(encoding="utf-8").partition("=== Master 0, Slave 3")[0]
    (tmp_path / "pdos.txt").write_text(shorter, encoding="utf-8")
    with pytest.raises(busplan.BusplanError, match=r"has 4 devices and .*pdos.txt 3: these are two machines"):
        busplan.import_profile([FILES / "slaves.txt", tmp_path / "pdos.txt"])
    with pytest.raises(busplan.BusplanError, match=r"is of can and .* of ethercat: a profile describes one bus"):
        imported("axis-5.dcf", "slaves.txt")
    with pytest.raises(busplan.BusplanError, match="are both node 5"):
        imported("axis-5.dcf", str(_copy(FILES / "axis-5.dcf", tmp_path / "other.dcf")))


def _copy(old: Path, new: Path) -> Path:
    new.write_bytes(old.read_bytes())
    return new


# --- CAN ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "message"), [("dbc", "Pressure"), ("kcd", "Pressure"), ("sym", "Pressure"), ("arxml", "PressureFrame")]
)
def test_messages_of_a_database_go_beside_the_nodes_of_a_dcf(name: str, message: str) -> None:
    answer = imported("axis-5.dcf", f"machine.{name}")
    profile: Any = answer.profile
    assert (profile.bus.bit_rate_kbit_s, profile.cycle.period_us) == (500, 4000)
    (group,) = profile.group
    assert (group.name, group.axes, group.read_bytes, group.write_bytes) == ("axis-five", 1, 6, 6)
    assert (group.feedback_identifier, group.command_identifier) == (0x185, 0x205)
    of_database = [(message, 0x100, 8, 20_000)]
    if name == "dbc":
        assert profile.message[-1].identifier_bits == 29
        of_database += [("Foreign", 0x18FEF1FE, 8, 100_000)]
    assert [(each.name, each.identifier, each.payload_bytes, each.period_us) for each in profile.message] == [
        ("axis-five-5-TPDO2", 0x285, 2, 10_000),
        ("axis-five-5-heartbeat", 0x705, 1, 250_000),
        *of_database,
    ]
    if name in ("dbc", "kcd"):
        assert any("no file says its period" in remark and remark.endswith(": Door") for remark in answer.remarks)
    lines = (FILES / f"machine.{name}").read_text(encoding="utf-8").splitlines()
    place = next(row.fact.place for row in answer.rows if row.dotted == f"message.{message}.payload_bytes")
    assert message in lines[int(place.rpartition(":")[2]) - 1]


def test_a_database_alone_is_a_network_of_messages() -> None:
    answer = imported("machine.dbc")
    profile: Any = answer.profile
    assert not profile.has_cycle
    assert profile.bus.bit_rate_kbit_s == 500
    assert [(each.name, each.identifier, each.payload_bytes, each.period_us) for each in profile.message] == [
        ("Pressure", 0x100, 8, 20_000),
        ("Foreign", 0x18FEF1FE, 8, 100_000),
    ]
    assert [each.sender for each in profile.message] == ["Drive", "Drive"]
    left_out, alone = answer.remarks
    assert left_out.endswith(": Door")
    assert alone.startswith("Messages alone, without a cycle")
    assert busplan.capacity(profile).verdict == "fits"


def test_a_database_without_a_period_is_refused_with_what_was_left_out(tmp_path: Path) -> None:
    text = (FILES / "machine.dbc").read_text(encoding="utf-8")
    (tmp_path / "none.dbc").write_text("".join(line for line in text.splitlines(True) if "CycleTime" not in line))
    with pytest.raises(busplan.BusplanError) as refused:
        imported(str(tmp_path / "none.dbc"))
    first, left_out = refused.value.problems
    assert "no message with a period, and no node with PDOs; a log of the bus beside it shows it" in first
    assert "no file says its period" in left_out


def fd_database(folder: Path, *, rate: str = 'BA_ "BaudrateCANFD" 5000000;\n') -> Path:
    """The database with a long message of CAN FD, and one that is as long and of which nothing says what it is."""
    text = (FILES / "machine.dbc").read_text(encoding="utf-8")
    messages = "BO_ 258 Long: 48 Drive\n\nBO_ 259 Parts: 64 Drive\n\n"
    formats = '"StandardCAN","ExtendedCAN",' + '"reserved",' * 12 + '"StandardCAN_FD","ExtendedCAN_FD"'
    definitions = f'BA_DEF_ BO_ "VFrameFormat" ENUM {formats};\nBA_DEF_ "BaudrateCANFD" INT 0 16000000;\n'
    values = 'BA_ "VFrameFormat" BO_ 258 14;\nBA_ "VFrameFormat" BO_ 256 14;\n'
    values += 'BA_ "GenMsgCycleTime" BO_ 258 10;\nBA_ "GenMsgCycleTime" BO_ 259 10;\n'
    text = text.replace("BA_DEF_ BO_", f"{messages}{definitions}BA_DEF_ BO_", 1)
    path = folder / "fd.dbc"
    path.write_text(text + rate + values, encoding="utf-8")
    return path


def test_messages_of_can_fd_are_brought_in(tmp_path: Path) -> None:
    answer = imported("axis-5.dcf", str(fd_database(tmp_path)))
    profile: Any = answer.profile
    assert (profile.bus.bit_rate_kbit_s, profile.bus.data_bit_rate_kbit_s) == (500, 5000)
    messages = {each.name: (each.fd, each.payload_bytes) for each in profile.message[2:]}
    assert messages == {"Pressure": (True, 8), "Long": (True, 48), "Foreign": (False, 8)}
    assert "left out, over the 8 bytes of a frame, and no file says that it is CAN FD: Parts" in answer.remarks


def test_a_data_bit_rate_that_no_file_says_is_assumed(tmp_path: Path) -> None:
    path = fd_database(tmp_path, rate="")
    for answer in (busplan.import_profile(path), imported("axis-5.dcf", str(path))):
        assert {row.dotted for row in answer.rows if row.fact.grade == "assumed"} >= {"bus.data_bit_rate_kbit_s"}


def test_an_eds_has_defaults_and_says_so() -> None:
    answer = imported("node.eds")
    assert any("read as an EDS, the defaults of a device, here as node 1" in remark for remark in answer.remarks)
    assert {"bus.bit_rate_kbit_s", "group.AX30.nodes", "cycle.period_us"} <= {
        row.dotted for row in answer.rows if row.fact.grade == "assumed"
    }


def changed(tmp_path: Path, name: str, *pairs: tuple[str, str]) -> busplan.ImportAnswer:
    """A file of ours with other words, imported."""
    text = (FILES / name).read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return busplan.import_profile(path)


def test_a_bit_rate_of_zero_is_one_that_is_not_set(tmp_path: Path) -> None:
    answer = changed(tmp_path, "axis-5.dcf", ("Baudrate=500", "Baudrate=0"))
    profile: Any = answer.profile
    assert profile.bus.bit_rate_kbit_s == 1000
    assert {row.fact.grade for row in answer.rows if row.key == "bit_rate_kbit_s"} == {"assumed"}
    assert any(remark.endswith("Baudrate = 0: not set") for remark in answer.remarks)


@pytest.mark.parametrize(("period_us", "is_taken"), [(1, False), (93, False), (94, True), (2000, True)])
def test_a_period_shorter_than_sync_itself_is_not_set(tmp_path: Path, period_us: int, is_taken: bool) -> None:
    """SYNC has 47 bits at 500 kbit/s, 94 us."""
    answer = changed(tmp_path, "axis-5.dcf", ("ParameterValue=4000", f"ParameterValue={period_us}"))
    profile: Any = answer.profile
    assert (profile.cycle.period_us == period_us) is is_taken
    assert any("its frame takes 94: the period is taken as not set" in remark for remark in answer.remarks) != is_taken


def test_mappings_in_the_compact_form_are_those_in_the_long_one(tmp_path: Path) -> None:
    """CiA 306: CompactSubObj for the number, and the section [1A00Value] for the values."""
    text = (FILES / "axis-5.dcf").read_text(encoding="utf-8")
    compact = tmp_path / "axis-5.dcf"
    for index in ("1A00", "1600"):
        values = re.findall(rf"\[{index}sub([1-9])\]\n(?:\w+=.*\n)*?(?:DefaultValue|ParameterValue)=(\S+)\n", text)
        assert values
        text = re.sub(rf"\[{index}sub\d\]\n(?:\w+=.*\n)+\n?", "", text)
        lines = "".join(f"{sub}={value}\n" for sub, value in values)
        text += f"\n[{index}]\nCompactSubObj={len(values)}\n[{index}Value]\nNrOfEntries=9\n{lines}"
    compact.write_text(text, encoding="utf-8")
    shown = [(row.dotted, row.plain) for row in busplan.import_profile(compact).rows]
    assert shown == [(row.dotted, row.plain) for row in imported("axis-5.dcf").rows]


def test_identifiers_without_node_id_say_the_node(tmp_path: Path) -> None:
    pairs = [(f"$NODEID+0x{start:x}", f"0x{start + 32:x}") for start in (0x180, 0x280, 0x200)]
    text = (FILES / "node.eds").read_text(encoding="utf-8")
    answer = changed(tmp_path, "node.eds", *(pair for pair in pairs if pair[0] in text))
    assert "node-ID 32, no NodeID in the file, that of its identifiers" in answer.text


def test_couplers_and_digital_terminals_are_known_by_their_type(tmp_path: Path) -> None:
    answer = changed(tmp_path, "ethercat-conf.xml", ('type="CP10"', 'type="EK1100"'), ('type="DI04"', 'type="EL1859"'))
    assert groups(answer) == [("EK1100", 1, 0, 0, 0), ("EL1859", 1, 1, 1, 0), *groups(answer)[2:]]
    with pytest.raises(busplan.BusplanError, match=r"how many bytes device 1 \(EL6900\) has in a cycle is not known"):
        changed(tmp_path, "ethercat-conf.xml", ('type="CP10"', 'type="EK1100"'), ('type="DI04"', 'type="EL6900"'))


def test_a_bus_of_one_device_has_no_heading(tmp_path: Path) -> None:
    text = (FILES / "pdos.txt").read_text(encoding="utf-8")
    path = tmp_path / "pdos.txt"
    path.write_text(text.partition("=== Master 0, Slave 3 ===\n")[2], encoding="utf-8")
    assert groups(busplan.import_profile(path)) == [("device", 1, 8, 6, 1)]


ENTRIES = {
    "the control word of a third axis": ("0x7040:00, 16 bit", 2),
    "a bit of a terminal": ("0x7040:01,  1 bit", 1),
    "a part of an object": ("0x6840:01, 16 bit", 1),
    "another width": ("0x6840:00, 32 bit", 1),
}


@pytest.mark.parametrize("case", ENTRIES)
def test_a_control_word_is_an_output_of_16_bits_without_subindex(case: str, tmp_path: Path) -> None:
    entry, axes = ENTRIES[case]
    answer = changed(tmp_path, "pdos.txt", ("0x607a:00, 32 bit", entry), ("0x6064:00, 32 bit", "0x6840:00, 16 bit"))
    assert groups(answer)[-1][-1] == axes
    number, bits = (int(part) for part in re.findall(r":(\d+), +(\d+)", entry)[0])
    mapped = f"0x{entry[2:6]}:0x{number:02x} 0x{bits:02x}"
    answer = changed(tmp_path, "slaveinfo.txt", ("0x607A:0x00 0x20", mapped))
    assert groups(answer)[-1][-1] == axes


PDOS = {
    # Bytes of both PDOs and type of the second -> bytes of the group, and the message that the second is.
    "behind a full one": ((8, 4, 1), 12, []),
    "behind one that is not full": ((6, 4, 1), 10, []),
    "with every fourth SYNC": ((8, 4, 4), 8, [(0x285, 4, 16_000)]),
}


@pytest.mark.parametrize("case", PDOS)
def test_a_second_pdo_goes_where_the_profile_can_say_it(case: str, tmp_path: Path) -> None:
    (first, second, kind), size, messages = PDOS[case]
    text = (FILES / "axis-5.dcf").read_text(encoding="utf-8")
    for old, new in (
        ("0x60640020", f"0x6064{8 * first - 16:04x}"),
        ("[1801sub2]\nDefaultValue=255", f"[1801sub2]\nDefaultValue={kind}"),
        ("0x60770010", f"0x6077{8 * second:04x}"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "axis.dcf"
    path.write_text(text, encoding="utf-8")
    profile: Any = busplan.import_profile(path).profile
    assert profile.node_groups[0].bytes_of("read") == size
    assert (profile.group[0].feedback_pdos == (first, second)) is (size == 10)
    found = [(each.identifier, each.payload_bytes, each.period_us) for each in profile.message]
    assert [each for each in found if each[0] != 0x705] == messages


def test_a_node_with_every_fourth_sync_is_a_group_of_its_own(tmp_path: Path) -> None:
    text = (FILES / "axis-5.dcf").read_text(encoding="utf-8")
    for index in ("1800", "1400"):
        head, section, rest = text.partition(f"[{index}sub2]\n")
        assert section
        line, _, rest = rest.partition("\n")
        assert line == "DefaultValue=1"
        text = f"{head}{section}DefaultValue=4\n{rest}"
    path = tmp_path / "axis.dcf"
    path.write_text(text, encoding="utf-8")
    answer = busplan.import_profile(path)
    profile: Any = answer.profile
    assert [group.every for group in profile.group] == [4]
    assert "transmission type of TPDO1" in answer.text


def test_the_answer_has_every_form_and_can_be_pickled(tmp_path: Path) -> None:
    answer = imported("machine.xml", "slaves.txt")
    assert pickle.loads(pickle.dumps(answer)).to_dict() == answer.to_dict()
    for ending in ("json", "csv", "md", "html", "txt"):
        answer.save(tmp_path / f"answer.{ending}")
        assert "delay_us" in (tmp_path / f"answer.{ending}").read_text(encoding="utf-8")
    assert repr(answer) == "<ImportAnswer: machine EtherCAT, 4 nodes, 2 axes, 500 us NOT SHOWN TO FIT>"
