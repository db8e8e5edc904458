"""First and worst moments: of emulated faults to the frame, and by the numbers that others give frames."""

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import can
import numpy as np
import pytest

import busplan
from busplan.buses.rule import RecordedFigure, Sense
from busplan.recordings.statistics import Events
from tests.oracles import can_recording as log
from tests.oracles import ethercat_recording as capture
from tests.oracles import moments
from tests.oracles.emulated import FAULTS, NoPlaceError, Subject
from tests.registers import at_least

LOCATED = {
    "commands late": "last PDO after SYNC",
    "commands behind the next SYNC": "last PDO after SYNC",
    "SYNC late": "SYNC: jitter of the arrival",
    "SYNC missing": "cycles without SYNC",
    "commands missing": "PDOs missing",
    "feedback missing": "PDOs missing",
    "feedback twice": "PDOs twice",
    "error frames": "error frames",
    "unknown identifier": "frames of no message of the plan",
    "cycles skipped": "cycles without a frame",
    "skipped in a row": "cycles without a frame",
    "frames lost": "lost frames",
    "wrong working counters": "wrong working counters",
    "late start": "latest start",
}
"""Figure of each fault that has a moment."""
FROM_EARLIEST = ("SYNC: jitter of the arrival", "latest start")
"""Figures that count from the earliest event."""
SEEDS = {"can": (42, 9, 26, 34, 16, 22)[: at_least(2)], "ethercat": (1, 3)}
ONE_IS_WORST = 0.02
"""Periods by which one of the late events is later than the others."""


def recorded(subject: Subject, machine: Any) -> tuple[busplan.MeasuredAnswer, list[float], moments.Events]:
    """What busplan finds in the recording of a machine; the stamps of its frames [us], and what happened in it."""
    path = subject.folder / f"moments.{'log' if subject.kind == 'can' else 'pcap'}"
    if subject.kind == "can":
        path.write_bytes(log.recorded(machine)[0])
        return busplan.measured(subject.path, path), *moments.of_log(machine)
    path.write_bytes(capture.recorded(machine, subject.cycles, seed=subject.seed)[0])
    return busplan.measured(subject.path, path), *moments.of_capture(machine, subject.cycles, seed=subject.seed)


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault.name in LOCATED], ids=lambda fault: fault.name)
def test_the_first_and_the_worst_event_of_a_fault_are_found_to_the_frame(
    fault: Any, subjects: Callable[[str, int], Subject]
) -> None:
    found = 0
    for seed in SEEDS[fault.kind]:
        subject = subjects(fault.kind, seed)
        subject.random = Random(f"moments {seed} {fault.name}")
        try:
            machine = fault.machine(subject)
        except NoPlaceError:
            continue
        if late := dict(getattr(machine, "late", {})):
            late[subject.random.choice(sorted(late))] += ONE_IS_WORST * machine.period_us
            machine = replace(machine, late=late)
        if skipped := getattr(machine, "skipped", None):
            # Where the master starts or stops, cycles are left out.
            machine = replace(machine, skipped=frozenset(range(15, subject.cycles - 15)) & skipped)
        answer, stamps_us, events = recorded(subject, machine)
        (figure,) = (figure for figure in answer.figures if figure.quantity == LOCATED[fault.name])
        if figure.verdict != "outside":
            continue
        own = events[figure.quantity]
        if figure.quantity in FROM_EARLIEST:
            earliest = min(event.value for event in own)
            own = [event._replace(value=event.value - earliest) for event in own]
        step_us = getattr(machine, "step_us", 1.0)
        # Beyond U at 99.9 % of normal errors; a count counts from the first on.
        bound = None if figure.unit == "1" else (figure.planned or 0) + 1.645 * (figure.uncertainty or 0)
        doubt_us = (figure.uncertainty or 0) if figure.quantity in FROM_EARLIEST else 0
        first, worst = moments.first_and_worst(own, bound=bound, tolerance=max(2 * step_us, doubt_us))
        assert figure.first_frame in first, seed
        assert figure.worst_frame in worst, seed
        for frame, at_s in ((figure.first_frame, figure.first_s), (figure.worst_frame, figure.worst_s)):
            assert at_s == pytest.approx((stamps_us[frame - 1] - stamps_us[0]) / 1e6, abs=2 * step_us / 1e6 + 1e-6)
        found += 1
    assert found


PLAN = """\
schema_version = 1
name = "alone"
[bus]
kind = "can"
bit_rate_kbit_s = 500
[[message]]
name = "a"
identifier = 0x181
payload_bytes = 2
period_us = 1000
"""


@pytest.mark.parametrize("ending", ["log", "asc", "blf"])
def test_frames_of_all_channels_and_error_frames_are_counted(ending: str, tmp_path: Path) -> None:
    """The ninth frame of 0x181 is longer than planned: the 13th of the file, behind two of others and two errors."""
    path, plan = tmp_path / f"bus.{ending}", tmp_path / "plan.toml"
    plan.write_text(PLAN)

    def message(at_s: float, *, channel: int = 0, identifier: int = 0x181, size: int = 2, **more: Any) -> can.Message:
        options = {"is_extended_id": False, "data": bytes(size), "channel": channel, **more}
        return can.Message(timestamp=1_700_000_000 + at_s, arbitration_id=identifier, **options)

    sent = [message(0.0, channel=1, identifier=0x7FF), message(0.5, identifier=0x80)]
    sent += [message(1 + place / 1000, size=7 if place == 8 else 2) for place in range(30)]
    sent[5:5] = [message(1.0025, is_error_frame=True)] * 2
    with can.Logger(str(path)) as writer:
        for frame in sent:
            writer(frame)
    answer = busplan.measured(plan, path, channel="can0" if ending == "log" else "0")
    data = next(figure for figure in answer.figures if figure.quantity == "a: data")
    assert (data.first_frame, data.worst_frame) == (13, 13)
    assert data.first_s == pytest.approx(1.008, abs=1e-4)
    errors = next(figure for figure in answer.figures if figure.quantity == "error frames")
    assert (errors.recorded, errors.first_frame) == (2, 6)
    assert errors.first_s == pytest.approx(1.0025, abs=1e-4)


@pytest.mark.parametrize("form", [capture.pcap, capture.pcapng])
def test_packets_of_others_are_counted_as_wireshark_does(form: Callable[..., bytes], tmp_path: Path) -> None:
    machine = capture.Machine(lost=frozenset({70, 90}))
    packets = capture.simulated(machine, 200)
    arp = b"\xff" * 6 + b"\2" * 6 + b"\x08\x06" + bytes(46)
    packets = sorted([*packets, (0.0, arp), *((place * 1000.0 + 500, arp) for place in range(0, 200, 3))])
    content, before = form(packets), 0
    if form is capture.pcapng:
        # A simple packet block behind the interface: a packet without a stamp.
        head, before = 28 + int.from_bytes(content[32:36], "little"), 1
        content = content[:head] + struct.pack("<IIIII", 3, 20, 4, 0, 20) + content[head:]
    (tmp_path / "bus.pcap").write_bytes(content)
    answer = busplan.measured("ethercat-servo-8", tmp_path / "bus.pcap")
    lost = next(figure for figure in answer.figures if figure.quantity == "lost frames")
    sent_us = [us for us, content in packets if content != arp and 70_000 <= us < 70_500]
    assert (lost.recorded, len(sent_us)) == (2, 1)
    number = [us for us, _ in packets].index(sent_us[0]) + 1 + before
    assert (lost.first_frame, lost.worst_frame) == (number, number)
    # From the first packet, which is another's.
    assert lost.first_s == pytest.approx(sent_us[0] / 1e6, abs=1e-9)


@pytest.mark.parametrize(
    ("uncertainty", "values", "sense", "first", "worst"),
    [
        (5.0, [104, 107, 120, 109], "at most", 3, 3),  # outside is what is over 100 + 1.645 U
        (5.0, [96, 93, 80, 91], "at least", 3, 3),
        (5.0, [104, 95, 80, 91], "equal", 3, 3),
        (4.0, [101, 107, 120, 109], "at most", 2, 3),
        (20.0, [99, 101, 107, 120], "at most", 2, 4),  # not shown is what is over the plan
        (0.0, [99, 90, 100, 100], "at most", None, 3),
    ],
)
def test_the_first_event_is_the_first_with_the_verdict_of_its_figure(
    uncertainty: float, values: list[float], sense: Sense, first: int | None, worst: int
) -> None:
    recorded = float(min(values) if sense == "at least" or min(values) == 80 else max(values))
    events = Events(np.array(values, float), np.arange(4.0), np.arange(1, 5))
    found = RecordedFigure("cycle", "us", 100.0, recorded, uncertainty, sense, 4).located(events)
    assert (found.first_frame, found.worst_frame) == (first, worst)
    assert found.first_s == (None if first is None else first - 1.0)
