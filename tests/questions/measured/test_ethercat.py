"""Captures of simulated machines: what they do is found again within its own U; what they hide is said."""

import csv
import json
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.errors import BusplanError
from tests.oracles.ethercat_recording import (
    APRD,
    FPRD,
    FRMW,
    LRW,
    Machine,
    ethernet,
    pcapng,
    register,
    simulated,
    start_up,
)

if TYPE_CHECKING:
    from subprocess import CompletedProcess

Run = Callable[..., "CompletedProcess[str]"]
Refused = Callable[..., str]
FILES = Path(__file__).parent / "files"
OF_THE_EXAMPLE = Machine(devices=8, datagrams=((LRW, 0x10000, 160), (FRMW, 0, 8)))
"""As ethercat-servo-8, but faster than planned."""
PLAN = busplan.load_profile(
    "ethercat-servo-8",
    changes={"bus.nodes": 4, "payload.read_bytes": 10, "payload.write_bytes": 10, "node.cable_length_m": 0},
)


def of_packets(
    packets: list[tuple[float, bytes]], tmp_path: Path, *, plan: Any = PLAN, **options: Any
) -> busplan.MeasuredAnswer:
    path = tmp_path / "capture.pcapng"
    path.write_bytes(pcapng(packets))
    return busplan.measured(plan, path, **options)


def of_machine(
    machine: Machine, tmp_path: Path, *, cycles: int = 1200, seed: int = 1, **options: Any
) -> busplan.MeasuredAnswer:
    return of_packets(simulated(machine, cycles, seed=seed), tmp_path, **options)


def figure(answer: busplan.MeasuredAnswer, start: str) -> Any:
    (recorded,) = (figure for figure in answer.figures if f"{figure.quantity} ".startswith(start))
    return recorded


def test_the_shipped_recording_is_what_the_simulation_writes() -> None:
    assert (FILES / "capture.pcapng").read_bytes() == pcapng(simulated(OF_THE_EXAMPLE, 60))


@given(
    st.sampled_from([250.0, 500.0, 1000.0, 4000.0]),
    st.floats(0.5, 60.0),
    st.floats(2.0, 80.0),
    st.floats(0.1, 40.0),
    st.integers(1, 10**6),
)
def test_period_jitter_and_masters_time_are_found_again_within_u(
    tmp_path_factory: pytest.TempPathFactory,
    period_us: float,
    jitter_us: float,
    host_us: float,
    spread_us: float,
    seed: int,
) -> None:
    machine = Machine(period_us=period_us, jitter_us=jitter_us, host_us=host_us, host_spread_us=spread_us)
    answer = of_machine(machine, tmp_path_factory.mktemp("found"), seed=seed, quantile=0.9)
    period, jitter, master = (figure(answer, start) for start in ("period", "latest start", "master's time"))
    assert period.recorded == pytest.approx(period_us, abs=10 * jitter_us / 1200**1.5 + 1e-4)
    assert jitter.recorded is not None
    assert jitter.uncertainty is not None
    # Some standard deviations more than U, for there are many examples.
    assert jitter.recorded == pytest.approx(0.9 * jitter_us, abs=3 * jitter.uncertainty)
    edits = answer.edits
    doubt: Any = edits["bus.master_uncertainty_us"]
    # The delay of a device is rounded in the simulation: 8 times 0.8 ns.
    assert edits["bus.master_us"] == pytest.approx(host_us + 0.9 * spread_us, abs=6 * doubt + 0.01)
    assert edits["bus.master_us"] == pytest.approx(master.recorded, abs=0.001)
    assert doubt < max(spread_us, 0.1)


def test_the_jitter_is_the_worst_of_the_cycles_of_the_recording(tmp_path: Path) -> None:
    seen = of_machine(Machine(), tmp_path)
    latest, edits = figure(seen, "latest start"), dict(seen.edits)
    assert edits["bus.master_jitter_cycles"] == latest.events
    # The worst of more cycles stays where it is kept, and gives way to a later start.
    for jitter_us, cycles, is_kept in ((500.0, latest.events, True), (500.0, 10, False), (0.001, 10**6, False)):
        planned = {"bus.master_jitter_us": jitter_us, "bus.master_jitter_cycles": cycles}
        plan = busplan.load_profile(PLAN, changes=planned)
        again = busplan.measured(plan, tmp_path / "capture.pcapng").edits
        assert ("bus.master_jitter_us" not in again) is is_kept
    rare = busplan.measured(PLAN, tmp_path / "capture.pcapng", quantile=0.99).edits
    assert rare["bus.master_jitter_cycles"] == 100


def test_an_applied_profile_takes_as_long_as_the_machine_did(tmp_path: Path) -> None:
    # Neither the copy of the bytes nor the doubt of the delays is counted twice.
    machine = Machine(jitter_us=0.001, host_spread_us=0.001)
    answer = of_machine(machine, tmp_path)
    trip = figure(answer, "round trip ").recorded
    keys = {key: value for key, value in answer.edits.items() if value is not None}
    applied = busplan.load_profile(PLAN, changes={**keys, "bus.mailbox_polls": 0})
    (deciding,) = (result for result in busplan.capacity(applied).results if result.timing_model == "last-byte")
    assert deciding.bias_us is not None
    assert trip == pytest.approx(deciding.required_us + deciding.bias_us, abs=0.01)


def test_a_slow_outlier_is_the_worst_case(tmp_path: Path) -> None:
    answer = of_machine(Machine(late={600: 700.0}), tmp_path)
    jitter = figure(answer, "latest start")
    assert jitter.recorded == pytest.approx(710, abs=11)
    assert jitter.verdict == "outside"
    assert figure(answer, "period").recorded == pytest.approx(1000, abs=0.01)
    assert answer.edits["bus.master_uncertainty_us"] is None
    assert figure(of_machine(Machine(late={600: 700.0}), tmp_path, quantile=0.99), "latest start").verdict == "within"


def test_what_is_lost_wrong_or_not_sent_is_counted(tmp_path: Path) -> None:
    machine = Machine(
        lost=frozenset({50, 51, 700}), wrong=frozenset({70, 900}), skipped=frozenset({100, 101, 500}), has_index=False
    )
    for has_index in (True, False):
        machine.has_index = has_index
        answer = of_machine(machine, tmp_path)
        assert figure(answer, "lost frames").recorded == 3
        assert figure(answer, "wrong working counters").recorded == 2
        assert figure(answer, "cycles without a frame").recorded == 3
        assert figure(answer, "master's time").recorded == pytest.approx(40, abs=0.2)
        missed = ["cycles without a frame", "lost frames", "wrong working counters"]
        assert [figure.quantity for figure in answer.outside] == missed


def test_the_frame_that_is_still_on_its_way_is_not_lost(tmp_path: Path) -> None:
    packets = simulated(Machine(), 100)
    assert figure(of_packets(packets[:-1], tmp_path), "lost frames").recorded == 0
    answer = of_packets(packets[1:], tmp_path)
    assert figure(answer, "lost frames").recorded == 0
    assert "1 frame returned without having been seen to be sent." in answer.remarks


def test_the_drift_of_the_recorders_clock_is_no_jitter(tmp_path: Path) -> None:
    # 40 ppm more at the end than at the beginning, as a crystal that warms up: 0.2 ms over 6 s.
    packets = [(time + 40e-6 * time**2 / 12e6, packet) for time, packet in simulated(Machine(), 6000)]
    answer = of_packets(packets, tmp_path, quantile=0.99)
    assert figure(answer, "latest start").recorded == pytest.approx(19.8, abs=1.5)
    assert figure(answer, "period").verdict == "within"


def test_a_clock_that_is_set_back_is_said(tmp_path: Path) -> None:
    packets = simulated(Machine(), 1000)
    back = [(time - 5_000.3 * (time > 600_000), packet) for time, packet in packets]
    answer = of_packets(back, tmp_path)
    assert any("set back 1 time" in remark for remark in answer.remarks)
    assert figure(answer, "latest start").recorded == pytest.approx(20, abs=0.5)
    assert figure(answer, "latest start").events in {600, 601}
    assert figure(answer, "lost frames").recorded == 0


def test_frames_of_a_cycle_are_those_that_come_as_often(tmp_path: Path) -> None:
    packets = []
    for cycle in range(100):
        for place, (address, size) in enumerate(((0x10000, 1000), (0x20000, 600))):
            datagrams = ((LRW, address, size), *(((FRMW, 0, 8),) if not place else ()))
            sent = cycle * 1000 + place * 100.0
            counters = (3,) * len(datagrams)
            packets += [
                (sent, ethernet(datagrams, index=place, counters=counters)),
                (sent + 130, ethernet(datagrams, index=place, counters=counters, returned=True)),
            ]
        mailbox = ((FPRD, 0, 128),)
        packets += [
            (cycle * 1000 + 400.0, ethernet(mailbox, index=9, counters=(1,))),
            (cycle * 1000 + 430.0, ethernet(mailbox, index=9, counters=(1,), returned=True)),
        ]
    # The recording begins within a cycle.
    answer = of_packets(sorted(packets)[2:], tmp_path, plan="ethercat-servo-8")
    assert figure(answer, "frames in a cycle").recorded == 2
    assert figure(answer, "frames in a cycle").verdict == "outside"
    assert figure(answer, "datagrams").recorded == 1600 + 12 + 12 + 20
    assert figure(answer, "datagrams").note == "LRW 1000 FRMW 8 | LRW 600"
    assert figure(answer, "round trip ").recorded == pytest.approx(230, abs=0.01)
    assert figure(answer, "period").recorded == pytest.approx(1000, abs=0.01)


def test_other_datagrams_than_planned_are_measured(tmp_path: Path) -> None:
    machine = Machine(datagrams=((LRW, 0x10000, 80), (FPRD, 0, 2), (FRMW, 0, 8)), counters=(12, 1, 4))
    answer = of_machine(machine, tmp_path, cycles=100)
    assert answer.edits["bus.housekeeping_bytes"] == [2, 8]
    assert figure(answer, "datagrams").verdict == "outside"
    assert "bus.housekeeping_bytes" not in of_machine(Machine(), tmp_path, cycles=100).edits


@pytest.mark.parametrize("byte_us", [0.0841, 0.08])
def test_the_time_of_a_byte_is_found_from_frames_of_several_sizes(byte_us: float, tmp_path: Path) -> None:
    noise = np.random.default_rng(1)
    packets = []
    for number in range(400):
        size = (72, 300, 1064)[number % 3]
        datagrams = ((FPRD, 0, size),)
        back = number * 1000 + 40 + (size + 12 + 40) * byte_us + float(noise.normal(0, 0.5))
        packets += [
            (number * 1000.0, ethernet(datagrams, index=number % 256, counters=(1,))),
            (back, ethernet(datagrams, index=number % 256, counters=(1,), returned=True)),
        ]
    answer = of_packets(packets, tmp_path)
    of_byte = figure(answer, "time of a byte")
    assert of_byte.recorded == pytest.approx(byte_us, abs=0.0003)
    # 100 Mbit/s take 0.08 us for a byte: a slope of less by no more than its U is no proof that the host waited.
    assert of_byte.hidden == ""
    assert of_byte.planned == pytest.approx(0.0835, abs=0.0002)
    assert "no frame of process data" in answer.shows_nothing[0]
    assert answer.edits == {}


def test_a_frame_that_waits_for_another_says_no_time_of_a_byte(tmp_path: Path) -> None:
    # Both stamped as they were handed over; the small one waits until the large one is sent.
    large, small = ((LRW, 0x10000, 1000),), ((LRW, 0x20000, 80),)
    packets = simulated(Machine(datagrams=large, counters=(3,)), 100) + [
        (time + 1 + 85 * bool(packet[6] & 2), packet)
        for time, packet in simulated(Machine(datagrams=small, counters=(3,)), 100)
    ]
    answer = of_packets(sorted(packets), tmp_path)
    assert not [figure for figure in answer.figures if figure.quantity == "time of a byte"]


HOPS_NS = (700, 690, 820)
CLOCKS_NS = (2**32 - 1000, 5, 77_000, 2**31 + 4)
"""Of the first device wraps while the frame is behind it."""


@pytest.mark.parametrize(("read", "width", "port"), [(FPRD, 16, 1), (APRD, 16, 3), (FPRD, 4, 1)])
def test_port_times_say_the_delay_of_each_device_of_a_line(tmp_path: Path, read: int, width: int, port: int) -> None:
    machine = Machine(host_spread_us=0.001, hop_us=0.7367)
    started = start_up(HOPS_NS, clocks_ns=CLOCKS_NS, ports=port, read=read, width=width)
    answer = of_packets(started + simulated(machine, 100), tmp_path)
    *delays, mean = (figure for figure in answer.figures if "delay of device" in figure.quantity)
    assert [figure.recorded for figure in delays] == [0.7, 0.69, 0.82]
    assert [figure.quantity for figure in delays] == [f"delay of device {number}" for number in (2, 3, 4)]
    assert [figure.planned for figure in delays] == pytest.approx([0.698] * 3, abs=0.001)
    assert (mean.quantity, mean.verdict) == ("mean delay of devices 2 to 4", "within")
    assert mean.recorded == pytest.approx(0.736667)
    assert answer.edits["node.delay_us"] == pytest.approx(0.736667)
    # The master's time is what the measured delays leave.
    assert answer.edits["bus.master_us"] == pytest.approx(30, abs=0.01)
    exact = busplan.load_profile(PLAN, changes={"node.delay_us": 0.6, "node.cable_length_m": 10})
    beside = of_packets(started + simulated(machine, 100), tmp_path, plan=exact)
    assert figure(beside, "delay of device 2").planned == pytest.approx(0.65)
    assert "mean delay of devices 2 to 4" in [figure.quantity for figure in beside.outside]
    assert beside.edits["node.delay_us"] == pytest.approx(0.736667 - 0.05)
    # A plan that a recording was written into holds it, though no device has its mean.
    applied = busplan.load_profile(PLAN, changes={"node.delay_us": answer.edits["node.delay_us"]})
    again = of_packets(started + simulated(machine, 100), tmp_path, plan=applied)
    assert figure(again, "mean delay").verdict == "within"
    assert again.edits["bus.master_us"] == pytest.approx(30, abs=0.01)
    assert answer.notes["node"] == "busplan measured: the mean of 1 event in capture.pcapng of 2023-11-14"


def test_what_port_times_do_not_say_is_said(tmp_path: Path) -> None:
    cycles = simulated(Machine(), 100)

    def remark(started: list[tuple[float, bytes]]) -> str:
        answer = of_packets(started + cycles, tmp_path)
        assert "node.delay_us" not in answer.edits
        return next(remark for remark in answer.remarks if "ort times" in remark)

    whole = start_up(HOPS_NS, clocks_ns=CLOCKS_NS)
    assert "read 4 times without the broadcast write" in remark(whole[2:])
    assert "the write passed 4 devices, and those of 3 were read" in remark(whole[:-2])
    assert "No delays of devices by port times: there is 1 device." in remark(start_up((), clocks_ns=(5,)))
    ports = b"".join(value.to_bytes(4, "little") for value in (10, 500, 300, 0))
    branch = (-500.0, register(FPRD, 0x1001, 0x900, ports, 1, returned=True))
    assert "times of 3 ports: it is a branch" in remark([*whole, branch])
    stale = (-500.0, register(FPRD, 0x1003, 0x900, ports[:8] + bytes(8), 1, returned=True))
    assert "0 devices have a time of port 0 alone" in remark([*whole, stale])
    no_port = (-500.0, register(FPRD, 0x1001, 0x900, bytes(4) + ports[4:8] + bytes(8), 1, returned=True))
    assert "no time of its port 0" in remark([*whole, no_port])
    turned = (-500.0, register(FPRD, 0x1001, 0x900, ports[4:8] + ports[:4] + bytes(8), 1, returned=True))
    assert "by another port than 0" in remark([*whole, turned])
    alike = (-500.0, register(FPRD, 0x1001, 0x900, whole[3][1][-18:-2], 1, returned=True))
    assert "as far from the end as others" in remark([*whole, alike])
    unread = [(time, frame[:-2] + bytes(2) if len(frame) == 44 else frame) for time, frame in whole]
    assert not any("ort times" in remark for remark in of_packets(unread + cycles, tmp_path).remarks)
    # A line of another length than planned is shown, with nothing beside it.
    fewer = of_packets(start_up(HOPS_NS[1:], clocks_ns=CLOCKS_NS[1:]) + cycles, tmp_path)
    assert (figure(fewer, "delay of device 2").planned, figure(fewer, "delay of device 2").recorded) == (None, 0.69)
    assert "node.delay_us" not in fewer.edits


def test_stamps_that_were_not_taken_at_the_port_are_said(tmp_path: Path) -> None:
    packets = simulated(Machine(), 100)
    quick = [(time - 44.0 * (place % 2), packet) for place, (time, packet) in enumerate(packets)]
    answer = of_packets(quick, tmp_path)
    assert "sooner than it takes to send them" in answer.shows_nothing[0]
    assert answer.edits == {}
    # A single frame may be taken for another one.
    packets = simulated(Machine(host_spread_us=0.1), 200)
    answer = of_packets(
        [(time - 44.0 * (place == 101), packet) for place, (time, packet) in enumerate(packets)], tmp_path
    )
    assert any("1 frame returned sooner" in remark for remark in answer.remarks)
    assert not answer.shows_nothing


@contextmanager
def refusal(words: str) -> Iterator[None]:
    with pytest.raises(BusplanError, match=words):
        yield


def test_what_cannot_be_told_is_refused(tmp_path: Path) -> None:
    packets = simulated(Machine(), 50)
    other = [(time + 300, packet[:7] + b"\x99" + packet[8:]) for time, packet in packets]
    with refusal("frames of 2 masters: 00:11:22:33:44:55 .50 frames., 00:99:22:33:44:55 .50 frames.; keep the frames"):
        of_packets(sorted(packets + other), tmp_path)
    local = [(time, packet[:6] + b"\x02" + packet[7:]) for time, packet in packets]
    with refusal("cannot be told apart"):
        of_packets(local, tmp_path)
    with refusal("none of its 50 EtherCAT frames returned; record both ways"):
        of_packets([packet for packet in packets if not packet[1][6] & 2], tmp_path)
    with refusal("has no whole EtherCAT frame .type 0x88A4. among 0 Ethernet packets"):
        of_packets([], tmp_path)
    with refusal("100 of them cut: record whole packets"):
        of_packets([(time, packet[:40]) for time, packet in packets], tmp_path)
    with refusal("busplan reads no recordings of bus.kind ieee1394; latencies in a CSV file are for busplan calibrate"):
        of_packets(packets, tmp_path, plan="paper-4ms")
    with refusal("busplan reads no recordings of bus.kind sercos3$"):
        of_packets(packets, tmp_path, plan="sercos3-servo-8")
    with refusal("quantile 0.3: expected a share of 0.5 to 1"):
        of_packets(packets, tmp_path, quantile=0.3)
    for name in ("-", "a\0b"):
        with refusal("a recording is read from a file"):
            busplan.measured(PLAN, name)
    with refusal("cannot be read: No such file"):
        busplan.measured(PLAN, tmp_path / "nowhere.pcap")
    (tmp_path / "text.pcap").write_text("a,b\n1,2\n")
    with refusal("text.pcap: is not a pcap or pcapng file"):
        busplan.measured(PLAN, tmp_path / "text.pcap")


def test_few_cycles_have_no_period(tmp_path: Path) -> None:
    answer = of_machine(Machine(), tmp_path, cycles=5)
    assert answer.shows_nothing == ("it has 5 cycles, but a period needs at least 10",)
    assert (figure(answer, "master's time").events, figure(answer, "master's time").verdict) == (5, "not shown")
    reasons = {one.quantity: one.hidden for one in answer.figures if one.hidden}
    few = "5 cycles, but a period needs at least 10"
    assert {name: reasons[name] for name in ("period", "latest start")} == {"period": few, "latest start": few}


# --- the command ----------------------------------------------------------------------------------------


def test_every_form_has_the_same_figures(run: Run) -> None:
    words = ("measured", "ethercat-servo-8", str(FILES / "capture.pcapng"), "--quantile", "0.9")
    document = json.loads(run(*words, "--format", "json").stdout)
    assert document == busplan.measured("ethercat-servo-8", FILES / "capture.pcapng", quantile=0.9).to_dict()
    rows = list(csv.DictReader(run(*words, "--format", "csv").stdout.splitlines()))
    assert [row["quantity"] for row in rows] == [figure["quantity"] for figure in document["figures"]]
    assert document["day"] == "2023-11-14"
    assert document["outside"] == []
    text = run(*words).stdout
    assert "capture.pcapng: 9 of 9 figures within the plan." in text
    assert "bus.master_us = " in text


def test_set_changes_the_plan_that_is_compared(run: Run) -> None:
    words = ("measured", "ethercat-servo-8", str(FILES / "capture.pcapng"), "--set", "bus.master_jitter_us=3")
    document = json.loads(run(*words, "--format", "json").stdout)
    assert document["changes"] == {"bus.master_jitter_us": 3}
    assert document["outside"] == ["latest start"]


def test_apply_writes_what_was_measured_with_its_origin(run: Run, refused: Refused, tmp_path: Path) -> None:
    run("init", "press", "--from", "ethercat-servo-8", cwd=tmp_path)
    path = tmp_path / "press.toml"
    words = ("measured", "press.toml", str(FILES / "capture.pcapng"))
    applied = run(*words, "--quantile", "0.9", "--apply", cwd=tmp_path)
    assert applied.returncode == 0, applied.stderr
    new = path.read_text()
    assert "# busplan measured: 90 % of 60 events in capture.pcapng of 2023-11-14\n[bus]" in new
    profile: Any = busplan.load_profile(path)
    assert (profile.bus.master_grade, profile.bus.master_us) == ("measured", pytest.approx(39, abs=1))
    assert profile.bus.master_uncertainty_us is not None
    assert "# was assumed: a tuned Linux" in new
    # The worst case has no uncertainty of its own, and the old comment is replaced.
    assert run(*words, "--apply", "--format", "json", cwd=tmp_path).returncode == 0
    newest = path.read_text()
    assert newest.count("# busplan measured: ") == 1
    assert "the worst of 60 events" in newest
    assert "master_uncertainty_us" not in newest
    assert "shipped profile" in refused("measured", "ethercat-servo-8", words[2], "--apply")
    assert "--set bus.master_us=1" in refused(*words, "--apply", "--set", "bus.master_us=1", cwd=tmp_path)


def test_packets_of_others_and_packets_without_a_time_are_counted_together(tmp_path: Path) -> None:
    other = b"\xff" * 12 + b"\x08\x00" + bytes(46)
    packets = simulated(Machine(devices=4), 60)
    content = pcapng([*packets, *((packets[-1][0], other) for _ in range(3))])
    # A simple packet block has no stamp.
    without_time = struct.pack("<3I", 3, 16 + len(other), len(other)) + other + struct.pack("<I", 16 + len(other))
    path = tmp_path / "capture.pcapng"
    path.write_bytes(content + 2 * without_time)
    assert (
        "Left out: 5 packets of other protocols or interfaces, or without a time."
        in busplan.measured(PLAN, path).remarks
    )
