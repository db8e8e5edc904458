"""CAN without SYNC: a motor answers the command that it gets, against a simulation of the bus.

The simulation, tests/oracles/request_simulation.py, knows nothing of the model. An adversary puts other messages where
they hurt. For many more networks: python -m tests.buses.can.test_can_requests 0 5000
"""

import sys
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

import pytest

import busplan
from busplan import BusplanError
from busplan.sections.base import value_at
from tests.buses.can.machines import figures, loaded, responses, terms
from tests.oracles.can_frames import most_us
from tests.oracles.request_simulation import Frame, Motor, Sent, simulate
from tests.registers import at_least

CYCLES: Final = 4
Run = Callable[..., Any]
WAYS: Final = ("polled", "burst")


class Message(NamedTuple):
    """Another message."""

    identifier: int
    size: int
    period_us: int
    jitter_us: int = 0


class Arm(NamedTuple):
    """Motors on a bus; the identifier of a motor's command is `command` and its number, that of its answer `answer`."""

    motors: int
    access: str
    sizes: tuple[int, int] = (8, 8)
    """Command and answer [bytes]."""
    exec_us: int = 0
    host_us: int = 0
    adapter_us: tuple[int, int] = (0, 0)
    """From the program to the wire, and from the wire to the program."""
    command: int = 0x101
    answer: int = 0x201
    messages: tuple[Message, ...] = ()
    data_rate: int = 0

    def us(self, size: int, *, is_fd: bool = False) -> int:
        rate = self.data_rate if is_fd else 0
        return round(most_us(size, bit_rate=1000, data_bit_rate=rate) * 10)

    def frames(self, first: int, motor: int, size: int) -> tuple[Frame, ...]:
        """Frames of a command or an answer, in tenths of a microsecond."""
        most = 64 if self.data_rate else 8
        return tuple(
            (first + motor + 0x100 * place, self.us(min(left, most), is_fd=bool(self.data_rate)))
            for place, left in enumerate(range(size, 0, -most))
        )

    def data(self, period_us: float, **bus: Any) -> dict[str, Any]:
        """Sections of a profile of it."""
        rate = {"data_bit_rate_kbit_s": self.data_rate} if self.data_rate else {}
        return {
            "schema_version": 1,
            "name": "arm",
            "description": "an arm",
            "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": self.motors, "access": self.access}
            | {"host_us": self.host_us}
            | dict(zip(("host_write_us", "host_read_us"), self.adapter_us, strict=True))
            | rate
            | bus,
            "cycle": {"period_us": period_us, "slice_ratio": 1},
            "payload": {
                "write_bytes": self.sizes[0],
                "read_bytes": self.sizes[1],
                "command_identifier": self.command,
                "feedback_identifier": self.answer,
            },
            "node": {
                "axes": 1,
                "execution": {"kind": "linear", "grade": "measured", "base_us": self.exec_us, "per_byte_us": 0},
            },
            "message": [
                {
                    "name": f"m{place}",
                    "identifier": message.identifier,
                    "payload_bytes": message.size,
                    "period_us": message.period_us,
                    "jitter_us": message.jitter_us,
                    "deadline_us": 20 * message.period_us,
                }
                for place, message in enumerate(self.messages)
            ],
        }

    def run(self, period: int, drawn: Random | None, queued: list[list[int]]) -> list[Sent]:
        """Simulate it in tenths of a microsecond, with the longest times, or with drawn ones."""
        low = 1.0 if drawn is None else drawn.choice((0.0, 0.5, 1.0))

        def up_to(us: int) -> int:
            return 10 * us if drawn is None else round(10 * us * drawn.uniform(low, 1))

        motors = [
            Motor(
                self.frames(self.command, number, self.sizes[0]),
                self.frames(self.answer, number, self.sizes[1]),
                tuple(up_to(self.exec_us) for _ in range(CYCLES)),
            )
            for number in range(self.motors)
        ]
        hosts = [[up_to(self.host_us) for _ in motors] for _ in range(CYCLES)]
        write_us, read_us = self.adapter_us
        adapter = [[(up_to(write_us), up_to(read_us)) for _ in motors] for _ in range(CYCLES)]
        messages = [
            ((message.identifier, self.us(message.size)), instants)
            for message, instants in zip(self.messages, queued, strict=True)
        ]
        late = 0 if drawn is None else drawn.choice((0, 9))
        starts = [period * cycle for cycle in range(1, CYCLES + 1)]
        return simulate(
            motors,
            messages,
            starts_us=starts,
            host_us=hosts,
            polled=self.access == "polled",
            late_us=late,
            adapter_us=adapter,
        )


def drawn_arm(random: Random) -> Arm:
    """Any arm, with messages before, between and behind its frames."""
    is_fd = random.random() < 0.3
    command, answer = random.choice(((0x101, 0x201), (0x201, 0x101), (0x101, 0x141)))
    return Arm(
        random.randint(1, 6),
        random.choice(WAYS),
        (random.choice((1, 8, 8, 12)), random.choice((1, 8, 8, 20))),
        random.choice((0, 30, 200)),
        random.choice((0, 10, 100)),
        random.choice(((0, 0), (25, 90), (random.randint(0, 300), random.randint(0, 300)))),
        command,
        answer,
        tuple(
            Message(identifier, random.randint(0, 8), random.choice((300, 700, 2000, 9000)), random.choice((0, 0, 400)))
            for identifier in random.sample((0x10, 0x20, 0x180, 0x1F0, 0x700, 0x701), random.randint(0, 4))
        ),
        5000 if is_fd else 0,
    )


def drawn_instants(arm: Arm, random: Random, period: int, hurt: list[int]) -> tuple[list[list[int]], list[list[int]]]:
    """When messages are due and queued: some of them a tick before an instant that hurts."""
    dues, queues = [], []
    for message in arm.messages:
        us, due, queued = random.randint(0, 10 * message.period_us), [], []
        while us < period * (CYCLES + 1):
            near = [instant for instant in hurt if us <= instant - 1 <= us + 10 * message.jitter_us + period // 5]
            if near and random.random() < 0.7:
                us = max(us, random.choice(near) - 1 - (10 * message.jitter_us if random.random() < 0.5 else 0))
            late = random.choice((0, 10 * message.jitter_us, random.randint(0, 10 * message.jitter_us)))
            due.append(us)
            queued.append(us + late)
            us += 10 * message.period_us + random.choice((0, 0, random.randint(0, 5 * message.period_us)))
        dues.append(due)
        queues.append(sorted(queued))
    return dues, queues


def lasts(sent: list[Sent], period: int) -> list[int]:
    """From the start of each cycle until the program has its last answer."""
    return [
        max(frame.known_us for frame in sent if frame.sort == "answer" and frame.cycle == cycle) - period * (cycle + 1)
        for cycle in range(CYCLES)
    ]


def attacked(arm: Arm, random: Random, *, rounds: int = 12) -> tuple[float, float] | None:
    """The longest cycle of many runs and the bound [us]; None where the arm does not fit any period.

    Responses of messages and of the arm's own frames are held against theirs on the way.
    """
    data = arm.data(100_000)
    required_us = sum(terms(loaded(data)).values())
    period_us = required_us * random.choice((1, 1, 1.2, 2))
    if required_us > 60_000 or figures(loaded(arm.data(period_us))).verdict == "does not fit":
        return None
    period, most, hurt = round(10 * period_us), 0, list[int]()
    bounds = responses(loaded(arm.data(period_us)))
    if None in bounds.values():
        return None
    for _ in range(rounds):
        due, queued = drawn_instants(arm, random, period, hurt)
        sent = arm.run(period, random if random.random() < 0.5 else None, queued)
        hurt = sorted({frame.queued_us for frame in sent if frame.sort != "message"})
        worst = max(lasts(sent, period))
        assert worst <= 10 * required_us + 0.01, (arm, worst / 10, required_us)
        for frame in sent:
            name = {"request": "command", "answer": "feedback"}.get(frame.sort, f"m{frame.number}")
            start = due[frame.number][frame.cycle] if frame.sort == "message" else frame.queued_us
            bound = bounds[name]
            assert bound is not None
            assert frame.end_us - start <= 10 * bound + 0.01, (arm, name, (frame.end_us - start) / 10, bound)
        most = max(most, worst)
    return most / 10, required_us


@pytest.mark.parametrize("seed", range(at_least(5, 60)))
def test_no_simulated_cycle_and_no_response_is_longer_than_its_bound(seed: int) -> None:
    random = Random(seed)
    attacked(drawn_arm(random), random)


@pytest.mark.parametrize("way", WAYS)
def test_the_bound_is_reached_where_nothing_is_left_to_chance(way: str) -> None:
    # Of commands at once: nodes whose answers go first, and at once, but for the last, which is the slowest.
    arm = Arm(5, way, exec_us=200, host_us=30 if way == "polled" else 0, command=0x201, answer=0x101)
    sent = arm.run(100_000, None, [])
    if way == "burst":
        motors = [
            Motor(arm.frames(0x201, number, 8), arm.frames(0x101, number, 8), (2000 * (number == 4),) * CYCLES)
            for number in range(5)
        ]
        starts = [100_000 * (cycle + 1) for cycle in range(CYCLES)]
        sent = simulate(motors, [], starts_us=starts, host_us=[[0] * 5] * CYCLES, polled=False)
    assert max(lasts(sent, 100_000)) == pytest.approx(10 * sum(terms(loaded(arm.data(10_000))).values()))


@pytest.mark.parametrize("way", WAYS)
def test_a_cycle_is_the_sum_of_its_parts(way: str) -> None:
    """8 bytes, 11 bits, worst stuffing: 135 bits (Davis 2007)."""
    parts = terms(loaded(Arm(8, way, exec_us=100, host_us=20).data(10_000)))
    waits_us = 800 if way == "polled" else 100
    assert parts["sync"] == 0
    assert (parts["command"], parts["feedback"], parts["host"], parts["wait"]) == (1080, 1080, 160, waits_us)


@pytest.mark.parametrize(
    ("way", "period_us", "frames"), [("polled", 896, 1), ("polled", 895, 2), ("burst", 796, 1), ("burst", 795, 2)]
)
def test_a_message_that_goes_first_comes_as_often_as_the_cycle_lets_it(way: str, period_us: int, frames: int) -> None:
    """Two motors: four frames of 135 us, 10 us of the host for each, 100 us of each, or of both; and a bit of 1 us."""
    first = Message(0x10, 8, period_us)
    own = loaded(Arm(2, way, exec_us=100, host_us=10, messages=(first,)).data(10_000))
    assert terms(own)["interference"] == frames * 135
    assert sum(terms(own).values()) == (760 if way == "polled" else 660) + frames * 135


@pytest.mark.parametrize("way", WAYS)
def test_a_message_that_goes_last_waits_for_one_cycle_where_the_next_is_far(way: str) -> None:
    own = loaded(Arm(2, way, exec_us=100, host_us=10, messages=(Message(0x700, 8, 100_000),)).data(10_000))
    assert responses(own)["m0"] == 5 * 135


@pytest.mark.parametrize(("access", "most"), [("sync", ", 80 allowed"), ("polled", "")])
def test_a_load_has_a_limit_beside_it_where_the_plan_has_one(access: str, most: str) -> None:
    # 16 frames of 135 us, and SYNC of 55.
    data = Arm(8, "polled").data(10_000 if access == "sync" else 2000, access=access)
    said = " ".join(str(busplan.capacity(loaded(data))).split())
    assert f"load {22.1 if access == 'sync' else 108} %{most} " in said
    assert ("the bus load with the longest bits is 108.0%, over that of a bus" in said) == (access == "polled")


@pytest.mark.parametrize(("way", "number"), [("polled", 6), ("burst", 2)])
def test_so_many_frames_of_a_lower_priority_block(way: str, number: int) -> None:
    lower = Message(0x700, 8, 200)
    blocked = terms(loaded(Arm(3, way, exec_us=50, messages=(lower,)).data(10_000, bit_rate_kbit_s=1000)))
    assert blocked["blocking"] == number * 135


def test_an_arm_of_eight_has_the_load_that_was_published() -> None:
    """enactic/openarm_ros2, issue 82: about 22 %, 8 bytes each way, 125 Hz, 1 Mbit/s."""
    profile = busplan.load_profile("can-motors-8")
    assert figures(profile, "no-stuffing").own.bus_load == pytest.approx(0.222)
    assert figures(profile).own.bus_load == pytest.approx(0.27)
    assert figures(profile).verdict == "fits"


@pytest.mark.parametrize("way", WAYS)
def test_nine_motors_that_ran_at_1_khz_are_not_said_not_to_fit(way: str) -> None:
    """enactic/openarm, issue 34: CAN FD at 1 and 5 Mbit/s, payload and times not said; here 8 bytes and none."""
    result = figures(loaded(Arm(9, way, data_rate=5000).data(1000)))
    assert result.verdict in ("fits", "not shown to fit")
    assert result.own.bus_load == pytest.approx(0.99)


def test_no_load_is_too_large_where_the_cycle_fits_unless_the_profile_says_so() -> None:
    data = Arm(8, "burst").data(2200)
    assert figures(loaded(data)).own.bus_load > 0.95
    assert figures(loaded(data)).exceeded == ()
    data["limits"] = {"max_load": 0.8}
    assert figures(loaded(data)).exceeded == ("load",)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("bus.sync_counter", True),
        ("bus.queue", "fifo"),
        ("payload.every", 2),
        ("servo.update", "next_sync"),
    ],
)
def test_what_needs_a_sync_is_refused_without_it(key: str, value: Any) -> None:
    data = Arm(2, "polled").data(10_000)
    section, name = key.split(".")
    data.setdefault(section, {})[name] = value
    if section == "servo":
        assert loaded(data)  # nodes that close their loop themselves wait for no SYNC
        data["servo"]["loop"] = "host"
    with pytest.raises(BusplanError, match=f'{key} = .*: .* SYNC.*, and bus.access = "polled" has none'):
        loaded(data)


def test_a_command_rests_on_the_feedback_of_the_cycle_before() -> None:
    profile = loaded(Arm(2, "polled", exec_us=100, host_us=10).data(10_000))
    assert responses(profile)["loop"] == pytest.approx(10_000 + 2 * (10 + 135 + 100 + 135))


def test_plan_asks_for_all_at_once_where_one_by_one_is_too_slow(run: Run) -> None:
    done = run("plan", "can-motors-8", "--nodes", "16", "--period", "8ms")
    assert done.stdout.startswith('can-motors-8 with 16 nodes (16 axes) at 8 ms: set bus.access = "burst" (if ')
    assert run("capacity", "can-motors-8", "--set", "bus.nodes=16", "--set", "bus.access=burst").returncode == 0


def test_the_card_says_how_many_buses_carry_all_motors(run: Run) -> None:
    card = run("capacity", "can-motors-8", "--set", "bus.nodes=30").stdout
    assert "  buses           3 such buses, of 10 nodes or fewer\n" in card
    for nodes, verdict in ((10, "fits"), (11, "not shown to fit")):
        assert busplan.capacity(busplan.load_profile("can-motors-8", changes={"bus.nodes": nodes})).verdict == verdict
    assert "\n  buses " not in run("capacity", "can-motors-8").stdout


def test_a_new_profile_of_motors_has_no_sync(run: Run, tmp_path: Path) -> None:
    assert run("init", "arm", "--bus", "can-motors", cwd=tmp_path).returncode == 0
    profile = busplan.load_profile(tmp_path / "arm.toml")
    assert value_at(profile, "bus.access") == "polled"
    assert terms(profile)["sync"] == 0


@pytest.mark.parametrize(("motors", "execution_us", "verdict"), [(9, 0, 1), (9, 100, 1), (9, 400, 1), (11, 0, 2)])
def test_motors_whose_frames_may_hide_all_times_are_not_shown_not_to_fit(
    motors: int, execution_us: int, verdict: int
) -> None:
    # Nine ran at 1 kHz and 5 Mbit/s; frames of eleven do not fit into a millisecond.
    changes = {"bus.nodes": motors, "bus.host_us": 10, "cycle.period_us": 1000, "node.execution.base_us": execution_us}
    found = busplan.capacity(busplan.load_profile("can-fd-motors-8", changes=changes)).results[0]
    assert found.verdict == ("fits", "not shown to fit", "does not fit")[verdict]


def test_a_lower_message_blocks_as_often_as_its_deadline_lets_it() -> None:
    messages = [{"name": "low", "identifier": 0x700, "payload_bytes": 8, "period_us": 20_000}]
    alone = busplan.load_profile("can-motors-8", changes={"bus.access": "burst"})
    alone_us = figures(alone).required_us
    # One that has waited since its start may go, and the next one too; a short deadline leaves one.
    for deadline_us, frames in ((20_000, 2), (500, 1)):
        changes = {"bus.access": "burst", "message": [{**messages[0], "deadline_us": deadline_us}]}
        arm = busplan.load_profile("can-motors-8", changes=changes)
        found = figures(arm)
        assert found.required_us == pytest.approx(alone_us + frames * 135)


def test_the_host_is_a_doubt_of_each_command() -> None:
    arm = busplan.load_profile("can-motors-8", changes={"bus.host_us": 20.0, "bus.host_uncertainty_us": 5.0})
    found = figures(arm)
    assert next(doubt.us for doubt in found.doubts if doubt.key == "bus.host_us") == 8 * 5.0


def main(first: int, number: int) -> None:
    """Attack many arms, and say how close they came by the way of access."""
    closest = dict.fromkeys(WAYS, 0.0)
    tried = dict.fromkeys(WAYS, 0)
    for seed in range(first, first + number):
        random = Random(seed)
        arm = drawn_arm(random)
        result = attacked(arm, random)
        if result and arm.messages:
            tried[arm.access] += 1
            closest[arm.access] = max(closest[arm.access], result[0] / result[1])
    sys.stdout.write(f"{tried} {closest}\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
