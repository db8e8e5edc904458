"""CANopen: who sends what, a master, emergencies, one EDS for several nodes; refusals that say the next step."""

import re
import struct
from pathlib import Path
from typing import Any, Final

import pytest

import busplan

FILES: Final = Path(__file__).parent / "files"
EDS: Final = (FILES / "node.eds").read_text(encoding="utf-8")
EMERGENCY: Final = "\n[1014]\nDefaultValue=$NODEID+0x80\n"
MASTER: Final = """[DeviceInfo]
ProductName=PLC
[DeviceComissioning]
NodeID=127
Baudrate=500
[1005]
ParameterValue=0x40000080
[1006]
ParameterValue=4000
[1017]
ParameterValue=100
[1F80]
ParameterValue=1
[1F81sub5]
ParameterValue=1
[1400sub1]
ParameterValue=0x185
[1600sub0]
ParameterValue=1
[1600sub1]
ParameterValue=0x60410010
[1800sub1]
ParameterValue=0x205
[1A00sub0]
ParameterValue=1
[1A00sub1]
ParameterValue=0x60400010
"""


def imported(folder: Path, files: dict[str, str], **options: Any) -> busplan.ImportAnswer:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return busplan.import_profile([folder / name for name in files], **options)


def messages(answer: busplan.ImportAnswer) -> dict[int, Any]:
    profile: Any = answer.profile
    return {message.identifier: message for message in profile.message}


def dcf(number: int) -> str:
    return f"{EDS}{EMERGENCY}[DeviceComissioning]\nNodeID={number}\nNodeName=Servo\nBaudrate=500\n"


DATABASE: Final = """BU_: DRV3 PLC LAMP
BO_ 131 EMCY3: 8 DRV3
BO_ 291 Temperature: 8 DRV3
BO_ 1539 Sdo: 8 PLC
BO_ 400 Setpoint: 8 PLC
BO_ 292 Lamp: 8 LAMP
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
""" + "".join(f'BA_ "GenMsgCycleTime" BO_ {number} 10;\n' for number in (131, 291, 292, 400, 1539))


def test_messages_of_a_node_have_its_group_for_a_sender(tmp_path: Path) -> None:
    files = {f"{number}.dcf": dcf(number) for number in (1, 2, 3)}
    answer = imported(tmp_path, {**files, "machine.dbc": DATABASE})
    found = messages(answer)
    senders = {number: message.sender for number, message in found.items()}
    # Emergency, heartbeat, a PDO of an event; DRV3 is node 3 in its other message, too; PLC is the host.
    assert {senders[number] for number in (0x83, 0x703, 0x283, 291)} == {"Servo"}
    assert (senders[1539], senders[400], senders[292]) == ("host", "host", "LAMP")
    assert (found[0x83].name, found[0x83].period_us) == ("EMCY3", 10_000)
    # First in, first out, the emergency waits for what its node has queued.
    path = tmp_path / "queues.toml"
    path.write_text(answer.text.replace("[bus]", '[bus]\nqueue = "fifo"'), encoding="utf-8")
    apart = tmp_path / "apart.toml"
    apart.write_text(
        re.sub(r'(name = "EMCY3"\n[^[]*?sender = )"Servo"', r'\1"DRV3"', path.read_text(encoding="utf-8")),
        encoding="utf-8",
    )
    together_us, apart_us = (
        max(
            one["worst_response_us"]
            for one in busplan.latency(each).to_dict()["transactions"]
            if one["transaction"] == "EMCY3"
        )
        for each in (path, apart)
    )
    assert together_us > apart_us


@pytest.mark.parametrize(("stated", "found"), [("", 4000), ("8000", 4000), ("2000", 2000)])
def test_the_cycle_is_that_of_the_sync_in_a_log(stated: str, found: int, tmp_path: Path) -> None:
    lines = [
        f"({1_700_000_000 + cycle * 4e-3 + number * 3e-4:.6f}) can0 {identifier:03X}#{data}\n"
        for cycle in range(400)
        for number, (identifier, data) in enumerate([(0x80, ""), (0x183, "00" * 6), (0x203, "00" * 6)])
    ]
    files = {"3.dcf": dcf(3) + (f"[1006]\nParameterValue={stated}\n" if stated else ""), "bus.log": "".join(lines)}
    profile: Any = imported(tmp_path, files, bit_rate_kbit_s=500).profile
    assert profile.cycle.period_us == pytest.approx(found, rel=1e-6)


def test_an_emergency_is_a_message_though_no_log_has_it(tmp_path: Path) -> None:
    for text, period_us, grade in (
        (EMERGENCY, 1e6, "assumed"),
        (f"{EMERGENCY}[1015]\nDefaultValue=50\n", 5e3, "published"),
    ):
        answer = imported(tmp_path, {"node.eds": EDS + text})
        assert (messages(answer)[0x81].payload_bytes, messages(answer)[0x81].period_us) == (8, period_us)
        (row,) = (row for row in answer.rows if row.dotted == "message.AX30-1-emergency.period_us")
        assert row.fact.grade == grade
    answer = imported(tmp_path, {"node.eds": f"{EDS}[1014]\nDefaultValue=0x80000081\n"})
    assert 0x81 not in messages(answer)


def test_a_master_is_the_host(tmp_path: Path) -> None:
    axis = (FILES / "axis-5.dcf").read_text(encoding="utf-8")
    answer = imported(tmp_path, {"plc.dcf": MASTER, "axis.dcf": axis})
    profile: Any = answer.profile
    (group,) = profile.group
    assert (group.nodes, group.feedback_identifier, group.command_identifier) == (1, 0x185, 0x205)
    assert (messages(answer)[0x77F].sender, messages(answer)[0x705].sender) == ("host", group.name)
    with pytest.raises(busplan.BusplanError, match=r"plc.dcf: is of the CANopen master .* the host: give the DCF"):
        imported(tmp_path, {"plc.dcf": MASTER})
    # It lists a slave that has no file.
    answer = imported(tmp_path, {"plc.dcf": f"{MASTER}[1F81sub6]\nParameterValue=1\n", "axis.dcf": axis})
    assert any("without a file, so left out: node 6" in remark for remark in answer.remarks)


@pytest.mark.parametrize(
    ("nodes", "numbers"),
    [("3", [1, 2, 3]), (2, [1, 2]), ("1-3,11", [1, 2, 3, 11]), ("8-8", [8]), ([4, 5], [4, 5])],
)
def test_one_eds_stands_for_nodes(nodes: Any, numbers: list[int], tmp_path: Path) -> None:
    answer = imported(tmp_path, {"node.eds": EDS}, nodes=nodes)
    assert sorted(number - 0x700 for number in messages(answer) if number > 0x700) == numbers
    profile: Any = answer.profile
    assert sum(group.nodes for group in profile.group) == len(numbers)


@pytest.mark.parametrize(
    ("nodes", "files", "words"),
    [
        *(
            (nodes, {"a.eds": EDS}, "expected a number of nodes")
            for nodes in ("0", "128", "3-1", "1,1", "x", "", "1--2")
        ),
        ("2", {"a.dcf": dcf(5)}, r"a\.dcf:\d+: NodeID 5 is set"),
        ("2", {"a.eds": EDS, "b.eds": EDS}, r"a\.eds and .*b\.eds are both an EDS"),
        ("2", {"machine.dbc": DATABASE}, "none of the files is an EDS"),
        (
            "2",
            {"a.eds": EDS.replace("$NODEID+0x180", "0x181")},
            (
                r"TPDO1 of node 1 and of node 2 would both have "
                r"identifier 0x181, because the file lacks"
            ),
        ),
    ],
)
def test_nodes_that_files_contradict_are_refused(nodes: str, files: dict[str, str], words: str, tmp_path: Path) -> None:
    with pytest.raises(busplan.BusplanError, match=words):
        imported(tmp_path, files, nodes=nodes)


TWO_ON_A_LINE: Final = """VERSION ""

NS_ :

BS_:

BU_: A B

BO_ 256 Drive: 8 A
 SG_ Mode : 0|8@1+ (1,0) [0|3] "" B

BO_ 257 Brake: 8 A
 SG_ State : 0|8@1+ (1,0) [0|3] "" B

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 10;
BA_ "GenMsgCycleTime" BO_ 257 20;
VAL_ 256 Mode 0 "off" 1 "on" ;VAL_ 257 State 0 "free" 1 "held" ;
"""


def test_two_statements_on_a_line_are_read(tmp_path: Path) -> None:
    assert messages(imported(tmp_path, {"two.dbc": TWO_ON_A_LINE})).keys() == {256, 257}


def test_identifiers_of_a_kcd_without_a_mark_are_taken_and_said(tmp_path: Path) -> None:
    text = (FILES / "machine.kcd").read_text(encoding="utf-8").replace('id="0x100"', 'id="0x18FEF100"')
    answer = imported(tmp_path, {"machine.kcd": text})
    assert 0x18FEF100 in messages(answer)
    assert any("are taken for 29 bits: 0x18FEF100" in remark for remark in answer.remarks)


ARXML: Final = (FILES / "machine.arxml").read_text(encoding="utf-8").replace("<IDENTIFIER>256</IDENTIFIER>", "")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (ARXML, "save the database as DBC"),
        (
            EDS.replace("$NODEID+0x180", "0x80000180").partition("[1400")[0]
            + "[1800sub1]\nDefaultValue=$NODEID+0x180\n",
            "no object in 0x1A00",
        ),
        (struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1), "busplan measured"),
        (struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28), "busplan measured"),
    ],
    ids=["ARXML", "EDS", "pcap", "pcapng"],
)
def test_a_refusal_says_the_next_step(content: str | bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(busplan.BusplanError, match=re.escape(words)) as refused:
        busplan.import_profile(path)
    assert not re.search(r"NoneType|Error|object is", str(refused.value))


def test_typed_terminals_and_drives_have_their_bytes(tmp_path: Path) -> None:
    kinds = {"EK1100": (0, 0, 0), "EL5101": (13, 3, 0), "EL5002": (12, 0, 0), "EL3104": (16, 0, 0), "EL4034": (0, 8, 0)}
    kinds |= {"EL7041": (8, 8, 1), "DeASDA": (20, 10, 1), "ECT60": (29, 11, 1)}
    slaves = "".join(f'<slave idx="{number}" type="{kind}"/>' for number, kind in enumerate(kinds))
    xml = f'<masters><master idx="0" appTimePeriod="1000000">{slaves}</master></masters>'
    profile: Any = imported(tmp_path, {"conf.xml": xml}).profile
    assert {group.name: (group.read_bytes, group.write_bytes, group.axes) for group in profile.group} == kinds
    switched = xml.replace('"DeASDA"/>', '"DeASDA"><modParam name="enableDigitalOutput" value="false"/></slave>')
    with pytest.raises(busplan.BusplanError, match=r"device 6 \(DeASDA\)"):
        imported(tmp_path, {"conf.xml": switched})
