"""ENI files: their frames come out to the byte, with their devices, clocks and mailboxes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import busplan
from busplan.sections.base import value_at

NOP, APWR, BRD, LRD, LWR, LRW, ARMW = 0, 2, 7, 10, 11, 12, 13


class Device(NamedTuple):
    """A device: bits of its inputs and outputs, and where they lie in the image."""

    name: str
    inputs: int
    outputs: int
    inputs_at: int = 0
    outputs_at: int = 0
    physics: str = "YY"
    axes: int = 0
    clock_ns: int = 0
    shift_ns: int = 0
    mailbox: int = 0


def line_of(count: int, inputs: int, outputs: int) -> list[Device]:
    """Drives alike, each with the same bytes in both directions of the image."""
    size = 8 * max(inputs, outputs)
    return [
        Device(f"Slave_{1001 + n} [Drive ]", 8 * inputs, 8 * outputs, n * size, n * size, "YY", 1, 1_000_000, 0, 140)
        for n in range(count)
    ]


def eni(
    devices: Sequence[Device],
    tasks: Sequence[tuple[int | None, Sequence[Sequence[tuple[int, int]]]]],
    *,
    root: str = "EtherCATConfig",
    mailbox_states: bool = False,
) -> str:
    """An ENI file: devices, and tasks with their period [us] and frames of (command, bytes)."""
    states = "<MailboxStates><StartAddr>150994944</StartAddr><Count>1</Count></MailboxStates>" if mailbox_states else ""
    slaves = "\n".join(_slave(number, device) for number, device in enumerate(devices))
    cyclic = "\n".join(_task(period, frames, mailbox_states=mailbox_states) for period, frames in tasks)
    return f"""<?xml version="1.0"?>
<{root} Version="1.3">
<Config>
<Master><Info><Name><![CDATA[Master]]></Name></Info>{states}
<InitCmds><InitCmd><Cmd>7</Cmd><Data>0000</Data></InitCmd></InitCmds></Master>
{slaves}
{cyclic}
</Config>
</{root}>
"""


def _slave(number: int, device: Device) -> str:
    spans = (("Send", device.outputs, device.outputs_at), ("Recv", device.inputs, device.inputs_at))
    data = "".join(
        f"<{tag}><BitStart>{start}</BitStart><BitLength>{bits}</BitLength></{tag}>"
        for tag, bits, start in spans
        if bits
    )
    words = "".join(
        f"<Entry><Index>#x{0x6040 + 0x800 * axis:x}</Index><BitLen>16</BitLen></Entry>" for axis in range(device.axes)
    )
    clock = (
        f"<DC><CycleTime0>{device.clock_ns}</CycleTime0><ShiftTime>{device.shift_ns}</ShiftTime></DC>"
        if device.clock_ns
        else ""
    )
    box = f"<Mailbox><Recv><Length>{device.mailbox}</Length></Recv></Mailbox>" if device.mailbox else ""
    before = f"<PreviousPort><Port>B</Port><PhysAddr>{1000 + number}</PhysAddr></PreviousPort>" if number else ""
    return f"""<Slave>
<Info><Name><![CDATA[{device.name}]]></Name>
<PhysAddr>{1001 + number}</PhysAddr><Physics>{device.physics}</Physics></Info>
<ProcessData>{data}<RxPdo Sm="2"><Index>#x1600</Index>{words}</RxPdo></ProcessData>
{box}{before}{clock}
</Slave>"""


def _task(period: int | None, frames: Sequence[Sequence[tuple[int, int]]], *, mailbox_states: bool) -> str:
    def command(code: int, size: int) -> str:
        address = 150_994_944 if mailbox_states and (code, size) == (LRD, 1) else 16_777_216
        where = f"<Addr>{address}</Addr>" if code in (LRD, LWR, LRW) else "<Adp>0</Adp><Ado>304</Ado>"
        return f"<Cmd><State>OP</State><Cmd>{code}</Cmd>{where}<DataLength>{size}</DataLength></Cmd>"

    time = "" if period is None else f"<CycleTime>{period}</CycleTime>"
    body = "\n".join(f"<Frame>{''.join(command(*each) for each in frame)}</Frame>" for frame in frames)
    return f"<Cyclic>{time}\n{body}\n</Cyclic>"


ACONTIS = ((BRD, 2), (NOP, 4), (ARMW, 4), (APWR, 4))
"""What EC-Engineer adds to the first frame."""


def imported(text: str, folder: Path) -> busplan.ImportAnswer:
    (folder / "machine.xml").write_text(text, encoding="utf-8")
    return busplan.import_profile(folder / "machine.xml")


def frames_us(profile: busplan.Profile) -> float:
    """Frames of the last-byte model, and what is kept for those that it has not."""
    terms = {term.key: term.us for term in busplan.capacity(profile).verdicts[0].deciding.terms}
    return sum(float(terms[key]) for key in ("cycle_frames_us", "cycle_data_us", "nonperiodic_us"))


def acontis(count: int, inputs: int, outputs: int) -> str:
    frame = [*ACONTIS, (LRW, count * max(inputs, outputs))]
    return eni(line_of(count, inputs, outputs), [(1000, [frame])])


IMU = Device("Imu", 112, 0, 568)
WHEELS = [Device(f"Wheel{n}", 112, 48, 776 + 112 * n, 776 + 112 * n, axes=1, clock_ns=10_000_000) for n in range(4)]
# Bytes of devices and datagrams as in the files; the time on the wire was counted from those by hand.
REAL: dict[str, tuple[str, float]] = {
    "kpierczy/ethercat-lib tests/data/test_eni.xml (TwinCAT)": (
        eni(
            [IMU, *WHEELS],
            [(10_000, [[(NOP, 4), (ARMW, 4), (LRD, 1), (LRD, 14), (LRW, 56), (BRD, 2)]])],
            mailbox_states=True,
        ),
        15.44,
    ),
    "magnate3/rocos-ethercat config/eni.xml (EC-Engineer)": (acontis(1, 14, 14), 10.24),
    "config/bcr_eni.xml": (acontis(3, 14, 14), 12.48),
    "config/eni4.xml": (acontis(4, 14, 14), 13.60),
    "config/eni7.xml": (acontis(7, 22, 14), 21.44),
    "config/eni_tech6.xml": (acontis(6, 16, 12), 16.80),
    "config/eni1.xml (KPA)": (
        eni([Device("Drive", 112, 128, clock_ns=1_000_000)], [(None, [[(LRD, 14), (LWR, 16)]])]),
        7.52,
    ),
}


@pytest.mark.parametrize("file", REAL)
def test_frames_take_the_time_of_real_files(file: str, tmp_path: Path) -> None:
    text, us = REAL[file]
    answer = imported(text, tmp_path)
    assert frames_us(answer.profile) == pytest.approx(us, abs=1e-9)
    assert answer.profile.cycle.nonperiodic_us == 0
    assert f"its frame takes {us:.2f} us on the wire, as the profile has" in answer.remarks[-1]


def test_a_value_says_its_line_and_grade(tmp_path: Path) -> None:
    text = REAL["kpierczy/ethercat-lib tests/data/test_eni.xml (TwinCAT)"][0]
    answer = imported(text, tmp_path)
    lines = text.splitlines()
    rows = {row.dotted: row.fact for row in answer.rows}
    assert (rows["cycle.period_us"].value, rows["cycle.period_us"].grade) == (10_000, "published")
    for key, tag in (
        ("cycle.period_us", "CycleTime"),
        ("group.Imu.read_bytes", "Recv"),
        ("bus.process_data", "Cyclic"),
    ):
        file, _, line = rows[key].place.partition(":")
        assert file == "machine.xml"
        assert f"<{tag}>" in lines[int(line) - 1]
    assert (rows["group.Wheel0.axes"].grade, rows["bus.master_us"].grade) == ("derived", "assumed")
    assert "read_bytes = 14            # published: machine.xml:" in answer.text
    assert "Not known, so assumed: bus.sync_shift = 0.5, " in answer.sentences()[-1]
    assert value_at(answer.profile, "bus.housekeeping_bytes") == (4, 4, 1, 2, 0)
    card = str(busplan.capacity(answer.profile)).partition("\n\n")[0].splitlines()
    assert list(answer.sentences()[-1 - len(card) : -1]) == card


BITS = [
    Device("Coupler", 0, 0, physics="YK"),
    Device("Term 2 (DI4)", 4, 0, 48, physics="KK"),
    Device("Term 3 (DI4)", 4, 0, 52, physics="KK"),
    Device("Axis", 48, 32, 0, axes=2, clock_ns=500_000, shift_ns=125_000, mailbox=96),
]


def test_devices_of_a_few_bits_share_bytes_and_couplers_have_none(tmp_path: Path) -> None:
    # 6 bytes of the drive, 1 of both terminals; outputs in bytes of their own.
    answer = imported(eni(BITS, [(500, [[(LRW, 11)]])]), tmp_path)
    profile: Any = answer.profile
    assert [(group.name, group.read_bytes, group.write_bytes, group.port) for group in profile.group] == [
        ("Coupler", 0, 0, "100BASE-TX"),
        ("DI4", 1, 0, "E-bus"),
        ("DI4-2", 0, 0, "E-bus"),
        ("Axis", 6, 4, "100BASE-TX"),
    ]
    assert profile.bus.process_data == "LRW-separate"
    assert (profile.bus.mailbox_bytes, profile.bus.sync_shift, profile.group[-1].axes) == (96, 0.25, 2)
    assert frames_us(profile) == pytest.approx(84 * 0.08)  # 40 + 12 + 11 bytes are padded


FRAMES: dict[str, tuple[Sequence[Sequence[tuple[int, int]]], float]] = {
    "gaps in the image": ([[(BRD, 2), (LRW, 20)]], 86 * 0.08),
    "gaps, and no datagram to say them in": ([[(LRW, 200)]], 252 * 0.08),
    "inputs alone": ([[(LRD, 10)]], 84 * 0.08),
    "a frame for each unit": ([[(BRD, 2), (LRW, 5)], [(LRW, 5)]], 2 * 84 * 0.08),
    "data without outputs and inputs together": ([[(LRD, 6), (LWR, 4), (LRD, 40)]], 126 * 0.08),
}


@pytest.mark.parametrize("case", FRAMES)
def test_other_layouts_take_their_time_too(case: str, tmp_path: Path) -> None:
    frames, us = FRAMES[case]
    device = Device("Axis", 48, 32, axes=1)
    assert frames_us(imported(eni([device], [(1000, frames)]), tmp_path).profile) == pytest.approx(us, abs=1e-6)


def test_gaps_in_the_image_are_in_a_datagram(tmp_path: Path) -> None:
    profile: Any = imported(
        eni([Device("Axis", 48, 32, axes=1)], [(1000, FRAMES["gaps in the image"][0])]), tmp_path
    ).profile
    # 10 bytes of the device, 10 of gaps beside the BRD of 2.
    assert (profile.bus.housekeeping_bytes, profile.cycle.nonperiodic_us) == ((12,), 0)


def test_two_frames_hold_what_one_cannot(tmp_path: Path) -> None:
    devices = line_of(150, 14, 14)
    answer = imported(eni(devices, [(4000, [[*ACONTIS, (LRW, 1400)], [(LRW, 700)]])]), tmp_path)
    wire = 40 + sum(12 + size for _, size in ACONTIS) + 12 + 1400 + 40 + 12 + 700
    assert frames_us(answer.profile) == pytest.approx(wire * 0.08, abs=1e-6)


def test_a_slower_task_is_counted_in_every_cycle(tmp_path: Path) -> None:
    devices = [Device("Axis", 48, 48, axes=1)]
    text = eni(devices, [(2000, [[(LRW, 100)]]), (500, [[(LRW, 6)]])])
    answer = imported(text, tmp_path)
    assert answer.profile.cycle.period_us == 500
    assert answer.profile.cycle.nonperiodic_us == pytest.approx(152 * 0.08)
    assert any("a further task of 2000 us" in remark for remark in answer.remarks)


def two_tasks(slower_us: int, *, start: int = 6) -> str:
    """An axis in every cycle, and terminals of 100 bytes in the cycles of a slower task."""
    devices = [
        Device("Axis", 48, 48, axes=1),
        *(Device(f"Terminal{n}", 400, 0, inputs_at=8 * (6 + 50 * n)) for n in range(2)),
    ]
    text = eni(devices, [(500, [[(BRD, 2), (LRW, 6)]]), (slower_us, [[(LRD, 100)]])])
    for code, offset in ((LRW, 0), (LRD, start)):
        where = f"<InputOffs>{offset}</InputOffs><OutputOffs>{offset}</OutputOffs>"
        text = text.replace(f"<Cmd>{code}</Cmd>", f"<Cmd>{code}</Cmd>{where}")
    return text


def test_devices_of_a_slower_task_go_in_every_nth_cycle(tmp_path: Path) -> None:
    answer = imported(two_tasks(2000), tmp_path)
    profile = answer.profile
    groups: Any = profile.group
    assert [(group.nodes, group.read_bytes, group.every) for group in groups] == [(1, 6, 1), (2, 50, 4)]
    assert (profile.cycle.period_us, value_at(profile, "bus.units")) == (500, "together")
    # Both frames to the byte where the tasks meet; what the slower frame has beside its data counts in every cycle.
    fast, slow = 40 + 14 + 12 + 6, 40 + 12 + 100
    assert frames_us(profile) == pytest.approx((max(fast, 84) + slow) * 0.08)
    deciding = busplan.capacity(profile).verdicts[0].deciding
    mean = busplan.EthercatFigures.of(deciding).mean_utilisation
    assert isinstance(mean, float)
    assert mean < deciding.utilisation
    assert not any("further task" in remark for remark in answer.remarks)


@pytest.mark.parametrize(("slower_us", "start"), [(1250, 6), (2000, 0), (2000, 56), (5_000_000, 6)])
def test_a_slower_task_without_known_devices_or_a_whole_rate_is_in_every_cycle(
    tmp_path: Path, slower_us: int, start: int
) -> None:
    answer = imported(two_tasks(slower_us, start=start), tmp_path)
    assert all(value_at(group, "every") == 1 for group in answer.profile.group)
    assert any("a further task" in remark for remark in answer.remarks)


def test_a_command_of_another_state_is_in_no_cycle(tmp_path: Path) -> None:
    text = eni([Device("Axis", 48, 48, axes=1)], [(500, [[(BRD, 200), (LRW, 60)]])])
    answer = imported(
        text.replace("<State>OP</State><Cmd>7<", "<State>PREOP</State><State>SAFEOP</State><Cmd>7<"), tmp_path
    )
    assert frames_us(answer.profile) == pytest.approx(112 * 0.08)


def test_what_only_looks_encrypted_is_read_and_a_branch_is_said(tmp_path: Path) -> None:
    text = eni(line_of(3, 4, 4), [(1000, [[(LRW, 12)]])], root="EncryptedEtherCATConfig")
    answer = imported(
        text.replace("<PhysAddr>1002</PhysAddr></PreviousPort>", "<PhysAddr>1001</PhysAddr></PreviousPort>"), tmp_path
    )
    assert any("device 2 is on a branch" in remark for remark in answer.remarks)
    with pytest.raises(busplan.BusplanError, match=r"machine.xml:1: <EncryptedEtherCATConfig> .* it is encrypted"):
        imported("<EncryptedEtherCATConfig><Data>AAAA</Data></EncryptedEtherCATConfig>", tmp_path)


REFUSED = {
    "no number": (("<BitLength>112</BitLength>", "<BitLength>many</BitLength>"), "BitLength 'many': expected a whole"),
    "too much": (
        ("<BitLength>112</BitLength>", "<BitLength>99999999</BitLength>"),
        "expected a whole number from 0 to",
    ),
    "no length": (("<DataLength>2</DataLength>", ""), "a cyclic Cmd without Cmd or DataLength"),
    "negative": (("<CycleTime>1000</CycleTime>", "<CycleTime>-5</CycleTime>"), "CycleTime '-5': expected a whole"),
    "a bus without devices": (("<Slave>", "<Gone>"), "not valid XML: mismatched tag"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_has_its_line(case: str, tmp_path: Path) -> None:
    (old, new), words = REFUSED[case]
    text = acontis(1, 14, 14)
    assert old in text
    with pytest.raises(busplan.BusplanError, match=rf"machine.xml:\d+(:\d+)?: .*{words}"):
        imported(text.replace(old, new), tmp_path)
