"""Emulated machines: without a fault there is no error, figures lie within their U of the truth, faults are named."""

import re
import subprocess
import sys
from collections.abc import Callable
from itertools import islice, pairwise
from pathlib import Path

import can
import pytest

from tests.oracles import can_recording
from tests.oracles.emulated import FAULTS, HIDDEN, Fault, Subject
from tests.registers import at_least

ALL_SEEDS = {"can": (42, 9, 22, 16, 26, 34), "ethercat": (1, 3, 8, 14, 21, 31)}
SEEDS = {kind: seeds[: at_least(3)] for kind, seeds in ALL_SEEDS.items()}
Subjects = Callable[[str, int], Subject]


@pytest.mark.slow
@pytest.mark.parametrize("kind", SEEDS)
def test_a_machine_that_keeps_its_plan_has_no_error(kind: str, subjects: Subjects) -> None:
    errors = {seed: subjects(kind, seed).clean.errors for seed in SEEDS[kind]}
    assert errors == {seed: [] for seed in SEEDS[kind]}


@pytest.mark.parametrize("kind", SEEDS)
def test_figures_lie_within_their_u_of_the_truth(kind: str, subjects: Subjects) -> None:
    judged = [(seed, *pair) for seed in SEEDS[kind] for pair in subjects(kind, seed).clean.judged()]
    beside = [(seed, name) for seed, name, is_within in judged if not is_within]
    assert len(judged) >= 40
    # U is one of 95 %.
    assert len(beside) <= 0.05 * len(judged), beside


@pytest.mark.slow
@pytest.mark.parametrize("fault", [*FAULTS, *HIDDEN], ids=lambda fault: f"{fault.kind}: {fault.name}")
def test_a_fault_larger_than_u_is_named_and_a_recording_that_shows_nothing_says_so(
    fault: Fault, subjects: Subjects
) -> None:
    recordings = ((seed, subjects(fault.kind, seed).with_fault(fault)) for seed in ALL_SEEDS[fault.kind])
    judged = ((seed, fault.is_named(recording)) for seed, recording in recordings if recording is not None)
    named = dict(islice(judged, at_least(2)))
    assert len(named) >= 2
    assert [seed for seed, is_named in named.items() if not is_named] == []


# --- the emulators themselves -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS["can"])
def test_the_smallest_identifier_goes_and_the_bus_waits_for_nobody(seed: int, subjects: Subjects) -> None:
    logged = can_recording.simulated(subjects("can", seed).machine())[:1500]
    space_us = 3000 / subjects("can", seed).plan["bus"]["bit_rate_kbit_s"]
    starts = [frame.us + space_us - frame.wire_us for frame in logged]
    ends = [0.0, *(frame.us + space_us for frame in logged)]
    for place, (frame, start_us) in enumerate(zip(logged, starts, strict=True)):
        assert start_us == pytest.approx(max(ends[place], frame.queued.us), abs=1e-3)
        order = frame.identifier << 18 * (not frame.extended)
        waiting = [late for late in logged[place + 1 : place + 60] if late.queued.us < start_us - 1e-3]
        assert all(order <= late.identifier << 18 * (not late.extended) for late in waiting)
    assert all(after >= before - 1e-3 for before, after in pairwise(starts))


def test_python_can_reads_what_is_written(subjects: Subjects) -> None:
    for seed in SEEDS["can"]:
        subject = subjects("can", seed)
        machine = subject.machine()
        machine.destroyed = frozenset({30, 50})
        logged = can_recording.simulated(machine)
        path = subject.folder / "whole.log"
        path.write_text(can_recording.candump(logged))
        read = list(can.CanutilsLogReader(str(path)))
        assert [message.is_error_frame for message in read] == [frame.is_error for frame in logged]
        for message, frame in zip(read, logged, strict=True):
            assert message.timestamp == pytest.approx(1_700_000_000 + frame.us / 1e6, abs=2e-6)
            if not frame.is_error:
                assert (message.arbitration_id, message.is_extended_id) == (frame.identifier, frame.extended)
                assert (bytes(message.data), message.is_fd) == (frame.data, frame.fd)
                assert message.bitrate_switch == (frame.fd and frame.queued.switched)


def test_frames_of_an_ethercat_cycle_are_as_many_and_as_long_as_planned(subjects: Subjects) -> None:
    for seed in SEEDS["ethercat"]:
        clean = subjects("ethercat", seed).clean
        names = [name for name in clean.figures if re.match("(frames in|datagrams of) a cycle", name)]
        assert len(names) >= 2
        assert [clean.figures[name].planned for name in names] == [clean.truth.get(name, 0) for name in names]


def test_the_emulators_know_nothing_of_busplan() -> None:
    names = "tests.oracles.can_recording, tests.oracles.ethercat_recording"
    code = f"import sys, {names}; assert not [name for name in sys.modules if name.startswith('busplan')]"
    subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2], check=True)
