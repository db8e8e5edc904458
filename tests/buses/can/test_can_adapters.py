"""The host's adapter: where the program waits for it, in which age it counts, and how many frames it carries."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan import BusplanError
from tests.buses.can.machines import figures, loaded, phases, responses, terms, text_of

Run = Callable[..., Any]
LASTS_US = 55 + 100 + 4 * 95 + 100 + 4 * 95 + 100
"""From SYNC to the last executed command: 4 bytes each way of 4 nodes, all times 100 us."""
WRITE_US, READ_US = 25, 90
"""Kvaser's card: 225 us from program to program, of which 110 are on the wire."""


def machine(access: str = "sync", *, period_us: float = 4000, **bus: Any) -> busplan.Profile:
    """Four nodes whose times are known exactly."""
    execution = {"kind": "linear", "base_us": 100, "per_byte_us": 0, "grade": "measured", "uncertainty_us": 0}
    host = {"host_us": 100, "host_grade": "measured", "host_uncertainty_us": 0}
    return loaded(
        {
            "schema_version": 1,
            "name": "line",
            "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": 4, "access": access, **host, **bus},
            "cycle": {"period_us": period_us},
            "payload": {"read_bytes": 4, "write_bytes": 4},
            "node": {"axes": 1, "execution": execution},
        }
    )


GIVEN: dict[str, Any] = {"host_write_us": WRITE_US, "host_read_us": READ_US}


@pytest.mark.parametrize(("access", "rounds"), [("sync", 1), ("polled", 4), ("burst", 1)])
def test_the_program_waits_once_or_for_each_request(access: str, rounds: int) -> None:
    bare, own = machine(access), machine(access, **GIVEN)
    assert terms(bare)["adapter"] == 0
    assert terms(own) == terms(bare) | {"adapter": rounds * (WRITE_US + READ_US)}
    doubts = {doubt.key: doubt.us for doubt in figures(own).doubts}
    assert doubts["bus.host_write_us"] == pytest.approx(rounds * WRITE_US / 10)
    assert doubts["bus.host_read_us"] == pytest.approx(rounds * READ_US / 10)


# 4 frames of 95 us each way do not hide the adapter; they may hide the host and the nodes.
@pytest.mark.parametrize(("period_us", "verdict"), [(850, "does not fit"), (880, "not shown to fit")])
def test_a_burst_hides_no_adapter(period_us: float, verdict: str) -> None:
    limits = {"limits.reserve": 0.0}
    assert 8 * 95 + WRITE_US + READ_US == 875
    known = busplan.load_profile(machine("burst", period_us=period_us, **GIVEN), changes=limits)
    assert figures(known).verdict == verdict


def test_the_word_has_the_times_that_were_measured_and_a_key_goes_before_it() -> None:
    assert terms(machine(adapter="kvaser-pcie")) == terms(machine(**GIVEN))
    assert terms(machine(adapter="kvaser-pcie", host_read_us=0))["adapter"] == WRITE_US
    assert terms(machine(adapter="none"))["adapter"] == terms(machine(adapter="candlelight"))["adapter"] == 0


@pytest.mark.parametrize(("adapter_us", "is_late"), [(115, False), (4000 - LASTS_US + 101, True)])
def test_a_host_with_cycles_of_its_own_has_the_adapter_in_the_loop_alone(adapter_us: int, *, is_late: bool) -> None:
    bare = machine(pipeline_cycles=1)
    own = machine(pipeline_cycles=1, host_read_us=adapter_us - 1, host_write_us=1)
    assert terms(own) == terms(bare)
    assert terms(bare)["host"] == 0
    for update, most_us in (("on_arrival", 4000 + LASTS_US - 100 + adapter_us), ("next_sync", 8000 + 4000 * is_late)):
        changed = busplan.load_profile(own, changes={"servo.loop": "host", "servo.update": update})
        assert responses(changed)["loop"] == most_us
        assert phases(changed)["loop"]["adapter_us"] == adapter_us


@pytest.mark.parametrize(
    ("update", "bus"),
    [
        ("on_arrival", {"pipeline_cycles": 1, **GIVEN}),
        ("on_arrival", {"pipeline_cycles": 0, **GIVEN}),
        ("on_arrival", {"access": "burst", **GIVEN}),
        ("next_sync", {"pipeline_cycles": 1, **GIVEN}),
        ("next_sync", {"pipeline_cycles": 1, "host_write_us": 3000}),
    ],
)
def test_the_circle_has_the_loop_of_latency(update: str, bus: dict[str, Any]) -> None:
    servo = {"servo.loop": "host", "servo.update": update, "servo.position_gain_per_s": 5.0}
    own = busplan.load_profile(machine(**bus), changes={**servo, "circle.radius_mm": 2.0})
    # Of a burst the command has arrived before the answers.
    answers_us = 4 * 95 + READ_US if bus.get("access") == "burst" else 0
    assert busplan.circle_test(own).results[0].delay_y_us + answers_us == responses(own)["loop"]


@pytest.mark.parametrize(
    ("bus", "key"),
    [
        ({}, {"bus.adapter", "bus.host_write_us", "bus.host_read_us", "bus.max_frames_s"}),
        ({"adapter": "kvaser-pcie"}, {"bus.max_frames_s"}),
        ({"adapter": "candlelight"}, {"bus.host_write_us", "bus.host_read_us"}),
        ({"adapter": "none"}, set()),
        (GIVEN | {"max_frames_s": 9000}, set()),
    ],
)
def test_what_is_not_known_of_the_adapter_is_said(bus: dict[str, Any], key: set[str]) -> None:
    rests_on = {part.key: part.words for part in busplan.capacity(machine(**bus)).verdicts[0].rests_on}
    assert {name for name, words in rests_on.items() if words.startswith("an adapter without")} == key


# 1 SYNC, 4 feedback and 4 commands in 4000 us.
@pytest.mark.parametrize(("most", "exceeded"), [(2250, ()), (2249, ("adapter",))])
def test_all_frames_of_the_bus_go_through_the_adapter(most: float, exceeded: tuple[str, ...]) -> None:
    found = figures(machine(max_frames_s=most))
    assert found.exceeded == exceeded
    assert found.min_period_us == pytest.approx(9e6 / most)


def test_a_plan_finds_the_period_that_the_adapter_carries(run: Run, tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text(text_of(machine(max_frames_s=1500)))
    card = run("capacity", "line.toml", cwd=tmp_path).stdout
    assert "2250.0 frames a second, over the 1500.0 of the host's adapter" in " ".join(card.split())
    planned = json.loads(run("plan", "line.toml", "--free", "cycle.period_us", "--format", "json", cwd=tmp_path).stdout)
    assert "6 ms" in json.dumps(planned) or "6000" in json.dumps(planned)
    checked = run("check", "line.toml", "--no-circle", cwd=tmp_path)
    assert checked.returncode == 1
    assert "frames a second" in checked.stdout


def test_messages_alone_have_a_ceiling_and_no_program_that_waits() -> None:
    message = {"name": "door", "identifier": 1, "payload_bytes": 1, "period_us": 1000}
    car = {"schema_version": 1, "name": "car", "message": [message]}
    bus = {"kind": "can", "bit_rate_kbit_s": 1000}
    assert figures(loaded({**car, "bus": bus | {"max_frames_s": 999}})).exceeded == ("adapter",)
    assert figures(loaded({**car, "bus": bus | {"max_frames_s": 1000}})).exceeded == ()
    for key in GIVEN:
        with pytest.raises(BusplanError, match=f"bus.{key} = 1.*: asks for nodes"):
            loaded({**car, "bus": bus | {key: 1}})


def test_a_log_holds_the_adapter_and_the_host_in_one(run: Run, tmp_path: Path) -> None:
    slow = machine(host_write_us=250, host_read_us=250)
    (tmp_path / "slow.toml").write_text(text_of(slow))
    (tmp_path / "line.toml").write_text(text_of(machine(**GIVEN)))
    log = tmp_path / "bus.log"
    assert run("emulate", "slow.toml", "--cycles", "200", "--output", log.name, cwd=tmp_path).returncode == 0
    log.write_text(re.sub(r"\) \S+ ", ") can0 ", log.read_text()))
    assert run("check", "slow.toml", "--recording", log.name, cwd=tmp_path).returncode == 0
    done = run("check", "line.toml", "--recording", log.name, cwd=tmp_path)
    assert done.returncode == 1
    assert "first command after the last feedback" in done.stdout
    run("measured", "line.toml", log.name, "--apply", cwd=tmp_path)
    # Half to all of the host's 100 us, and 500 of the adapter, less the 115 that the plan gives.
    (written_us,) = re.findall(r"^host_us = ([\d.]+)", (tmp_path / "line.toml").read_text(), re.MULTILINE)
    assert 550 - 115 < float(written_us) < 600 - 115 + 30
    assert run("check", "line.toml", "--recording", log.name, cwd=tmp_path).returncode == 0


def test_sensitivity_has_both_ways_of_the_adapter(run: Run, tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text(text_of(machine("polled", **GIVEN)))
    said = run("capacity", "line.toml", "--sensitivity", "--all", cwd=tmp_path).stdout
    assert re.search(r"adapter to the wire \+10 us +25 -> 35 us +-40\b", said)
    assert re.search(r"adapter from the wire \+10 us +90 -> 100 us +-40\b", said)
