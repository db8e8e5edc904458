"""What a machine on CAN does wrong is an error of `check --recording`, and what a log cannot show is said."""

from collections.abc import Callable
from itertools import accumulate
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from tests.oracles.can_recording import Queued, arbitrated, candump
from tests.registers import at_least

CYCLE = """schema_version = 1
name = "cyc"
[bus]
kind = "can"
bit_rate_kbit_s = 1000
[cycle]
period_us = 4000
[[group]]
name = "fast"
nodes = 2
axes = 1
read_bytes = 8
write_bytes = 8
execution = {kind = "linear", base_us = 100, per_byte_us = 0, grade = "measured"}
[[group]]
name = "slow"
nodes = 2
axes = 1
read_bytes = 8
write_bytes = 8
every = 4
execution = {kind = "linear", base_us = 100, per_byte_us = 0, grade = "measured"}
"""


def machine(
    cycles: int = 400,
    *,
    period_us: float = 4000.0,
    late_us: Callable[[int, int], float] = lambda _cycle, _identifier: 0.0,
    sends: Callable[[int, int], bool] = lambda _cycle, _identifier: True,
) -> list[Queued]:
    """The machine of `CYCLE`: how late each frame is, and whether it comes at all."""
    random = Random(1)
    queued = []
    for cycle in range(cycles):
        start = cycle * period_us
        groups = (1, 2, 3, 4) if cycle % 4 == 0 else (1, 2)
        frames = [(0x80, 0.0, b"")]
        frames += [(0x180 + node, 150.0, random.randbytes(8)) for node in groups]
        frames += [(0x200 + node, 700.0, random.randbytes(8)) for node in groups]
        queued += [
            Queued(start + after + late_us(cycle, identifier), identifier, data)
            for identifier, after, data in frames
            if sends(cycle, identifier)
        ]
    return queued


def errors(queued: list[Queued], folder: Path, *, more: str = "", plan: str = CYCLE) -> dict[str, str]:
    """Words of each BP40x of `check --recording`, by figure."""
    (folder / "plan.toml").write_text(plan)
    (folder / "bus.log").write_text(candump(arbitrated(queued)) + more)
    answer = busplan.check(folder / "plan.toml", recording=folder / "bus.log")
    findings = [finding for finding in answer.files[0].findings if finding.code.startswith("BP40")]
    assert answer.passed == (not any(finding.severity == "error" for finding in findings))
    return {finding.problem.partition(": ")[2]: finding.code for finding in findings}


def test_a_machine_within_its_plan_has_no_finding(tmp_path: Path) -> None:
    assert errors(machine(), tmp_path) == {}


def test_commands_late_beyond_the_next_sync_are_told_by_their_own(tmp_path: Path) -> None:
    late = errors(machine(late_us=lambda cycle, frame: 3300.0 * (frame > 0x200 and cycle % 33 == 5)), tmp_path)
    assert set(late.values()) == {"BP401"}
    named = ["fast command: response", "last PDO after SYNC", "slow command: response"]
    assert sorted(words.partition(": 4")[0] for words in late) == named


def test_commands_late_in_one_of_ten_due_cycles_are_told(tmp_path: Path) -> None:
    # Of every fourth SYNC: late by more than a cycle, and still before they are due again.
    late = errors(machine(late_us=lambda cycle, frame: 5000.0 * (frame == 0x203 and cycle % 40 == 0)), tmp_path)
    of_cycle, of_commands = late
    assert of_cycle.startswith("last PDO after SYNC: 57"), of_cycle
    assert "(the latest: command of slow 1 (0x203))" in of_commands


@pytest.mark.parametrize(
    ("queued", "figures"),
    [
        (machine(200, period_us=8000.0), {"SYNC: period"}),
        (machine(sends=lambda cycle, _frame: cycle % 10 != 7), {"cycles without SYNC"}),
        (machine(sends=lambda cycle, frame: frame != 0x80 or cycle % 10 != 7), {"cycles without SYNC"}),
        (machine(sends=lambda cycle, frame: frame < 0x200 or cycle % 20 != 8), {"PDOs missing"}),
        (machine(sends=lambda _cycle, frame: frame != 0x202), {"PDOs missing", "not shown"}),
        (
            [*machine(), *(frame._replace(us=frame.us + 50) for frame in machine(3) if frame.identifier == 0x201)],
            {"PDOs twice: 2 recorded"},
        ),
    ],
    ids=["half the rate", "no cycle", "no SYNC", "no commands", "a command never", "twice"],
)
def test_what_should_be_there_and_is_not_is_an_error(queued: list[Queued], figures: set[str], tmp_path: Path) -> None:
    words = errors(queued, tmp_path)
    assert len(words) == len(figures), words
    for figure in figures:
        assert any(text.startswith(figure) for text in words), words


def test_error_frames_and_a_limit_of_what_may_be_missed(tmp_path: Path) -> None:
    more = "".join(f"(1700000000.{number:06d}) can0 20000080#0000000000000000\n" for number in range(9))
    assert any(
        "error frames: 9 recorded, at most 0 planned" in words for words in errors(machine(), tmp_path, more=more)
    )
    assert errors(machine(), tmp_path, more=more, plan=CYCLE + "[limits]\nmissed_cycles = 9\n") == {}
    without = machine(sends=lambda cycle, frame: frame != 0x201 or cycle not in (50, 90))
    assert errors(without, tmp_path, plan=CYCLE + "[limits]\nmissed_cycles = 2\n") == {}
    assert len(errors(without, tmp_path, plan=CYCLE + "[limits]\nmissed_cycles = 1\n")) == 1


def test_a_log_that_shows_nothing_fails_the_gate(tmp_path: Path) -> None:
    codes = errors(machine(3), tmp_path)
    assert set(codes.values()) == {"BP403"}
    seconds = [frame._replace(us=frame.us // 1e6 * 1e6) for frame in arbitrated(machine(800))]
    (tmp_path / "bus.log").write_text(candump(seconds))
    answer = busplan.check(tmp_path / "plan.toml", recording=tmp_path / "bus.log")
    codes = {finding.code: finding.message for finding in answer.files[0].findings}
    assert "its stamps have steps of 1,000,000 us, and a cycle lasts 4,000" in codes["BP403"]


@settings(max_examples=at_least(5, 40))
@given(st.lists(st.floats(0, 3.4), min_size=3, max_size=40), st.sets(st.integers(5, 9), max_size=1))
def test_pdos_that_come_in_their_order_are_those_of_their_syncs(
    tmp_path_factory: pytest.TempPathFactory, late: list[float], lost: set[int]
) -> None:
    """Each PDO of a node is late by so many periods, and never before the PDO before it."""
    periods = [0.1, 0.1, *late, *(0.1 for _ in range(10))]
    queued_us = list(accumulate(((cycle + after) * 4000.0 for cycle, after in enumerate(periods)), max))
    late_us = [us - cycle * 4000.0 for cycle, us in enumerate(queued_us)]

    def recorded(queued: list[Queued]) -> dict[str, float | None]:
        folder = tmp_path_factory.mktemp("late")
        (folder / "plan.toml").write_text(CYCLE)
        (folder / "bus.log").write_text(candump(arbitrated(queued)))
        answer = busplan.measured(folder / "plan.toml", folder / "bus.log")
        return {figure.quantity: figure.recorded for figure in answer.figures}

    of_late = recorded(machine(len(late_us), late_us=lambda cycle, frame: late_us[cycle] * (frame == 0x201)))
    assert (of_late["PDOs missing"], of_late["PDOs twice"]) == (0, 0)
    assert of_late["last PDO after SYNC"] == pytest.approx(max(1300, 700 + max(late_us)), abs=700)
    sent = recorded(machine(sends=lambda cycle, frame: frame != 0x203 or cycle // 4 not in lost))
    assert (sent["PDOs missing"], sent["PDOs twice"]) == (len(lost), 0)
