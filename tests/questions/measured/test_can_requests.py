"""Logs of motors without SYNC: what an independent machine did is found again, and each fault with its frame."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from tomllib import loads
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from tests.oracles.can_recording import Logged, Queued, arbitrated, candump
from tests.oracles.can_requests import Arm
from tests.registers import at_least

WAYS = ("polled", "burst")
SEEDS = range(at_least(4))


def plan_text(random: Random, access: str, period_us: float) -> str:
    """Profile of some motors, perhaps in two groups, perhaps beside other messages."""
    fd = random.random() < 0.2
    text = [
        'schema_version = 1\nname = "arm"',
        f'[bus]\nkind = "can"\nbit_rate_kbit_s = {random.choice((500, 1000))}\naccess = "{access}"',
        f"host_us = {random.randrange(5, 120)}",
        f"[cycle]\nperiod_us = {period_us}\nslice_ratio = 1\n[limits]\nmax_load = 0.99",
    ]
    if fd:
        text[1] += "\ndata_bit_rate_kbit_s = 2000"
    two = random.random() < 0.4
    size = random.choice((4, 8, 8, 12))

    def nodes() -> Iterator[str]:
        yield f"axes = 1\nread_bytes = {size}\nwrite_bytes = {random.choice((2, 8, size))}"

    def execution() -> str:
        times = f"base_us = {random.randrange(20, 250)}\nper_byte_us = 0\nworst_extra_us = {random.randrange(10, 90)}"
        return f'kind = "linear"\ngrade = "measured"\n{times}'

    if two:
        for place, name in enumerate(("arm", "hand")):
            text.append(f'[[group]]\nname = "{name}"\nnodes = {random.randrange(1, 5)}')
            text.append(f"command_identifier = {0x101 + 16 * place}\nfeedback_identifier = {0x301 + 16 * place}")
            text += nodes()
            text.append(f"[group.execution]\n{execution()}")
    else:
        text[1] += f"\nnodes = {random.randrange(2, 9)}"
        text.append(f"[payload]\nread_bytes = {size}\nwrite_bytes = {random.choice((2, 8, size))}")
        text.append("command_identifier = 0x101\nfeedback_identifier = 0x301\n[node]\naxes = 1")
        text.append(f"[node.execution]\n{execution()}")
    for number in range(random.choice((0, 0, 1, 2))):
        identifier = (0x50, 0x700)[number]
        text.append(
            f'[[message]]\nname = "other-{number}"\nidentifier = {identifier}\n'
            f"payload_bytes = {random.randrange(1, 9)}\n"
            f'period_us = {random.randrange(9000, 40000)}\ndeadline_us = "none"'
        )
    return "\n".join(text) + "\n"


class Subject(NamedTuple):
    """A plan that fits, and its file."""

    path: Path
    plan: dict[str, Any]


def subject(seed: int, access: str, folder: Path) -> Subject:
    path = folder / "arm.toml"
    path.write_text(plan_text(Random(seed), access, 100_000.0))
    required_us = busplan.capacity(path).results[0].required_us
    path.write_text(plan_text(Random(seed), access, round(required_us * Random(-seed).uniform(1.1, 2))))
    return Subject(path, loads(path.read_text()))


class Compared(NamedTuple):
    """A log beside its plan."""

    answer: busplan.MeasuredAnswer
    figures: dict[str, Any]
    logged: list[Logged]
    """From the second cycle on, as in the log."""


def compared(machine: Arm, path: Path, start: float = 1.5) -> Compared:
    start_us = start * machine.plan["cycle"]["period_us"]
    logged = [frame for frame in machine.logged() if frame.us >= start_us]
    log = path.with_suffix(".log")
    log.write_text(candump(logged))
    answer = busplan.measured(path, log)
    return Compared(answer, {figure.quantity: figure for figure in answer.figures}, logged)


def frame_of(found: Compared, sort: str, number: int, cycle: int, *, place: int = 0) -> int:
    """Number in the log of a frame of a request or an answer."""
    frames = [
        at
        for at, frame in enumerate(found.logged, start=1)
        if frame.queued.stream == (f"{sort} {number}" if sort != "again" else sort) and frame.queued.number == cycle
    ]
    return frames[place]


@pytest.mark.slow
@pytest.mark.parametrize("access", WAYS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_machine_that_keeps_its_plan_is_within_it_and_its_times_are_the_true_ones(
    seed: int, access: str, tmp_path: Path
) -> None:
    path, plan = subject(seed, access, tmp_path)
    machine = Arm(plan, seed=seed)
    found = compared(machine, path)
    assert found.answer.outside == ()
    # At the very end of what the plan allows stamps do not show that a time is within.
    assert all(
        figure.residual <= figure.uncertainty for figure in found.figures.values() if figure.verdict == "not shown"
    )
    assert found.answer.shows_nothing == ()

    start_us = 1.5 * plan["cycle"]["period_us"]
    names = [name for name in found.figures if name.endswith(": request to answer")]
    assert len(names) == (len(machine.nodes) if len(machine.nodes) > 1 else 0)
    for number, name in enumerate(names):
        figure = found.figures[name]
        true_us = max(
            us
            for (node, cycle), us in machine.own.items()
            if node == number and cycle * plan["cycle"]["period_us"] > start_us
        )
        assert figure.recorded <= true_us + figure.uncertainty
        if access == "polled" and "message" not in plan:
            assert figure.recorded == pytest.approx(true_us, abs=figure.uncertainty)
    if access == "polled" and "next request of the host" in found.figures:
        host = found.figures["next request of the host"]
        assert host.recorded <= max(machine.hosts.values()) + host.uncertainty
        if "message" not in plan:
            assert host.recorded >= 0.8 * max(machine.hosts.values()) - host.uncertainty


@pytest.mark.slow
@pytest.mark.parametrize("access", WAYS)
@pytest.mark.parametrize("seed", SEEDS)
def test_each_fault_is_found_at_its_frame(seed: int, access: str, tmp_path: Path) -> None:
    path, plan = subject(seed, access, tmp_path)
    clean, random = Arm(plan, seed=seed), Random(seed)
    clean.logged()
    cycles = sorted(random.sample(range(20, 180, 2), 5))
    last = len(clean.nodes) - 1
    hit = frozenset((last, cycle) for cycle in cycles)
    period_us = plan["cycle"]["period_us"]

    lost = compared(replace(clean, lost=hit), path)
    figure = lost.figures["answers missing"]
    assert (figure.recorded, figure.verdict) == (5, "outside")
    assert figure.first_frame == frame_of(lost, "request", last, cycles[0], place=-1)

    twice = compared(replace(clean, twice=hit), path)
    figure = twice.figures["answers twice"]
    assert (figure.recorded, figure.verdict) == (5, "outside")
    assert figure.first_frame == frame_of(twice, "again", last, cycles[0], place=-1)

    late_us = 0.2 * period_us + 500
    slow = compared(replace(clean, slow={(last, cycles[2]): late_us, (last, cycles[3]): 1.1 * late_us}), path)
    figure = slow.figures["request to answer"]
    assert figure.verdict == "outside"
    assert figure.first_frame == frame_of(slow, "answer", last, cycles[2])
    assert figure.worst_frame == frame_of(slow, "answer", last, cycles[3])

    if last:
        host = compared(replace(clean, late={(last, cycles[1]): late_us}), path)
        figure = host.figures["next request of the host"]
        assert figure.verdict == "outside"
        assert figure.first_frame == figure.worst_frame == frame_of(host, "request", last, cycles[1])

    skipped = compared(replace(clean, skipped=frozenset(cycles)), path)
    assert skipped.figures["cycles without requests"].recorded == 5


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_what_was_measured_makes_a_plan_that_holds(seed: int, tmp_path: Path) -> None:
    path, plan = subject(seed, "polled", tmp_path)
    slower = replace(Arm(plan, seed=seed), plan=loads(path.read_text()))
    for group in slower.plan.get("group", [slower.plan.get("node")]):
        group["execution"]["base_us"] += 150
    found = compared(slower, path)
    assert "request to answer" in {figure.quantity for figure in found.answer.outside}
    changed = {key: value for key, value in found.answer.edits.items() if value is not None}
    period = {"cycle.period_us": plan["cycle"]["period_us"]}
    profile = busplan.load_profile(path, changes=changed | period)
    again = busplan.measured(profile, path.with_suffix(".log"))
    assert {figure.quantity for figure in again.outside} <= {"last answer after the first request"}
    base_us = next(value for key, value in changed.items() if key.endswith("execution.base_us"))
    first = slower.plan.get("group", [slower.plan.get("node")])[0]["execution"]
    assert first["base_us"] - 5 <= base_us <= first["base_us"] + first["worst_extra_us"] + 5


ECHO = (
    'schema_version = 1\nname = "echo"\n[bus]\nkind = "can"\nbit_rate_kbit_s = 500\nnodes = 1\naccess = "polled"\n'
    "[cycle]\nperiod_us = 10000\n[payload]\nread_bytes = 8\nwrite_bytes = 8\ncommand_identifier = 0x100\n"
    "feedback_identifier = 0x200\n[node]\naxes = 1\n"
    '[node.execution]\nkind = "linear"\nbase_us = 300\nper_byte_us = 0\n'
)


def test_an_echo_that_takes_789_us_is_mostly_wire(tmp_path: Path) -> None:
    """8 bytes, 11 bits, 500 kbit/s, there and back in 789 us (Zahhask45/Team04_DrivaPi): 56 to 68 % is wire."""
    (tmp_path / "echo.toml").write_text(ECHO)
    random, sent = Random(1), list[Logged]()
    for cycle in range(100):
        (request,) = arbitrated([Queued(cycle * 10_000, 0x100, random.randbytes(8))], bit_us=2)
        (answer,) = arbitrated([Queued(0, 0x200, random.randbytes(8))], bit_us=2)
        sent += [request, answer._replace(us=cycle * 10_000 + 789)]
    (tmp_path / "echo.log").write_text(candump(sent))
    answer_of = busplan.measured(tmp_path / "echo.toml", tmp_path / "echo.log")
    recorded: dict[str, Any] = {figure.quantity: figure.recorded for figure in answer_of.figures}
    assert recorded["last answer after the first request"] == pytest.approx(789, abs=10)
    assert 0.56 <= recorded["wire of that time"] <= 0.68
    frames_us = sum(frame.wire_us for frame in sent) / 100
    assert recorded["request to answer"] == pytest.approx(789 - frames_us, abs=40)
    # 500 kbit/s takes twice as long for each bit: what is not wire would stay at 1 Mbit/s.
    assert 789 - frames_us / 2 == pytest.approx(541, abs=20)


def test_frames_of_others_hide_a_part_of_an_answer(tmp_path: Path) -> None:
    """Three that go first come 400 us behind the request, and the answer behind them: it took 400 us or more."""
    (tmp_path / "echo.toml").write_text(ECHO)
    queued = []
    for start_us in range(0, 1_000_000, 10_000):
        others = [Queued(start_us + 700, 0x50 + number, bytes(8)) for number in range(3)]
        queued += [Queued(start_us, 0x100, bytes(8)), *others, Queued(start_us + 800, 0x200, bytes(8))]
    logged = arbitrated(queued, bit_us=2)
    (tmp_path / "echo.log").write_text(candump(logged))
    answer = busplan.measured(tmp_path / "echo.toml", tmp_path / "echo.log")
    (figure,) = (figure for figure in answer.figures if figure.quantity == "request to answer")
    assert figure.recorded == pytest.approx(700 - logged[0].us, abs=10)
    assert answer.edits == {}


@pytest.mark.parametrize(("read_bytes", "write_bytes"), [(8, 4), (4, 8)])
def test_the_planned_answer_is_that_of_the_slower_of_read_and_write(
    read_bytes: int, write_bytes: int, tmp_path: Path
) -> None:
    times = {"base_us": 100.0, "per_byte_us": 10.0, "worst_extra_us": 7.0}
    changes = {"payload.read_bytes": read_bytes, "payload.write_bytes": write_bytes}
    plan = busplan.load_profile(
        "can-motors-8", changes=changes | {f"node.execution.{key}": us for key, us in times.items()}
    )
    busplan.emulate(plan, cycles=10).save(tmp_path / "motors.log")
    answer = busplan.measured(plan, tmp_path / "motors.log")
    (planned_us,) = (figure.planned for figure in answer.figures if figure.quantity == "request to answer")
    assert planned_us == 100 + 8 * 10 + 7


ANY = st.builds(
    Queued,
    st.integers(0, 60_000).map(float),
    st.sampled_from([0x141, 0x142, 0x148, 0x241, 0x242, 0x248, 0x50, 0x700]),
    st.binary(max_size=8),
)


@pytest.mark.parametrize("access", WAYS)
@given(frames=st.lists(ANY, min_size=1, max_size=80))
def test_any_log_beside_motors_gives_a_document(
    tmp_path_factory: pytest.TempPathFactory, access: str, frames: list[Queued]
) -> None:
    path = tmp_path_factory.mktemp("any") / "any.log"
    path.write_text(candump(arbitrated(frames)))
    plan = busplan.load_profile("can-motors-8", changes={"bus.access": access})
    assert busplan.measured(plan, path).to_dict()["command"] == "measured"


def test_the_gate_names_the_slow_node(tmp_path: Path) -> None:
    path, plan = subject(3, "polled", tmp_path)
    machine = Arm(plan, seed=3)
    machine.logged()
    compared(replace(machine, slow={(len(machine.nodes) - 1, 50): 5000.0}), path)
    (file,) = busplan.check(path, recording=path.with_suffix(".log"), circle=False).files
    words = [finding.message for finding in file.findings if finding.code == "BP401"]
    assert any("request to answer" in message for message in words), file
