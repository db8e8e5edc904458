"""SYNC that comes late: the cycle ends before the next one, a log shows it, and keys that say nothing are refused."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from tests.buses.can.machines import figures, loaded, responses, terms
from tests.registers import at_least

Run = Callable[..., Any]
PLAN = """\
schema_version = 1
name = "line"
[bus]
kind = "can"
bit_rate_kbit_s = 1000
nodes = 4
host_us = 100
host_grade = "measured"
sync_jitter_us = 0
[cycle]
period_us = 1240
[payload]
read_bytes = 4
write_bytes = 4
[node]
axes = 1
[node.execution]
kind = "linear"
base_us = 100
per_byte_us = 0
grade = "measured"
uncertainty_us = 0
"""
LASTS_US = 1115.0
"""From SYNC to the last executed command: 55 + 100 + 4 * 95 + 100 + 4 * 95 + 100."""


def plan(folder: Path, jitter_us: float = 0, **changes: Any) -> busplan.Profile:
    """The plan with a jitter of SYNC, and other values by dotted key, __ for the dot."""
    path = folder / "line.toml"
    path.write_text(PLAN)
    others = {key.replace("__", "."): value for key, value in changes.items()}
    return busplan.load_profile(path, changes={"bus.sync_jitter_us": jitter_us, **others})


@pytest.mark.parametrize(
    ("jitter_us", "verdict"), [(0, "fits"), (105, "fits"), (106, "not shown to fit"), (146, "does not fit")]
)
def test_the_cycle_ends_before_the_next_sync(jitter_us: float, verdict: str, tmp_path: Path) -> None:
    profile = plan(tmp_path, jitter_us)
    assert sum(terms(profile).values()) == LASTS_US + jitter_us
    assert terms(profile)["jitter"] == jitter_us
    # U is 20 us, of the host.
    assert figures(profile).verdict == verdict


def test_other_messages_meet_the_next_sync_sooner(tmp_path: Path) -> None:
    message = '[[message]]\nname = "low"\nidentifier = 0x700\npayload_bytes = 8\nperiod_us = 100000\n'
    path = tmp_path / "low.toml"
    text = PLAN.replace("nodes = 4", "nodes = 3").replace("base_us = 100", "base_us = 0")
    path.write_text(text.replace("host_us = 100", "host_us = 0") + message)

    def found(period_us: float, jitter_us: float) -> Any:
        changes = {
            "bus.sync_jitter_us": jitter_us,
            "cycle.period_us": period_us,
            "servo.update": "on_arrival",
        }
        return responses(busplan.load_profile(path, changes=changes))

    punctual, late = found(770, 0), found(770, 20)
    assert late["SYNC"] == punctual["SYNC"] + 20
    assert late["loop"] == punctual["loop"] + 20
    # low waits for the PDOs of two cycles and a SYNC, or of three and two SYNCs.
    two_us, three_us = (cycles * 6 * 95 + (cycles - 1) * 55 + 135 for cycles in (2, 3))
    # The third cycle's come two periods behind the first's, which may be J late: J is worth half of it in the period.
    for period_us, jitter_us in ((760, 0), (765, 10), (770, 20), (780, 40)):
        assert found(period_us, jitter_us)["low"] == three_us
        assert found(period_us + 0.5, jitter_us)["low"] == two_us


def test_a_late_sync_reaches_the_circle_and_the_timeline(tmp_path: Path) -> None:
    (first, *_) = busplan.timeline(plan(tmp_path, 30)).to_dict()["events"]
    assert (first["kind"], first["duration_us"]) == ("jitter", 30)
    punctual, late = (
        busplan.circle_test(busplan.load_profile("can-servo-8", changes={"bus.sync_jitter_us": us})).results[0]
        for us in (0, 40)
    )
    # Half of it either way.
    assert late.jitter_us == punctual.jitter_us + 20


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("sync_jitter_us = 0", "sync_jitter_us = 1240", "9:1: bus.sync_jitter_us = 1240: is not under cycle.period_us"),
        ("sync_jitter_us = 0", "sync_jitter_us = -1", "9:1: bus.sync_jitter_us = -1"),
        ("sync_jitter_us = 0", 'sync_jitter_us = 0\naccess = "polled"', "9:1: bus.sync_jitter_us = 0: asks for SYNC"),
        (
            "sync_jitter_us = 0",
            'access = "polled"\npipeline_cycles = 0',
            "10:1: bus.pipeline_cycles = 0: asks for SYNC",
        ),
    ],
)
def test_what_has_no_meaning_is_refused(old: str, new: str, words: str, run: Run, tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text(PLAN.replace(old, new))
    done = run("capacity", "line.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert f"line.toml:{words}" in done.stderr


def test_a_window_about_sync0_is_within_a_period(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text(ETHERCAT.format(1000))
    assert busplan.capacity(path).verdict
    path.write_text(ETHERCAT.format(1001))
    with pytest.raises(busplan.BusplanError, match=r"line\.toml:\d+:\d+: node\.sync_window_us = 1001: is over"):
        busplan.capacity(path)


ETHERCAT = """\
schema_version = 1
name = "line"
[bus]
kind = "ethercat"
nodes = 4
distributed_clocks = true
[cycle]
period_us = 1000
[payload]
read_bytes = 4
write_bytes = 4
[node]
axes = 1
sync_window_us = {}
[node.execution]
kind = "linear"
base_us = 10
per_byte_us = 0
grade = "measured"
"""


def test_a_log_of_late_syncs_shows_the_key_that_plans_them(run: Run, tmp_path: Path) -> None:
    (tmp_path / "late.toml").write_text(PLAN.replace("sync_jitter_us = 0", "sync_jitter_us = 20"))
    (tmp_path / "line.toml").write_text(PLAN)
    log = tmp_path / "bus.log"
    assert run("emulate", "late.toml", "--cycles", "200", "--output", log.name, cwd=tmp_path).returncode == 0
    # As if a machine had sent it.
    log.write_text(re.sub(r"\) \S+ ", ") can0 ", log.read_text()))
    assert run("check", "late.toml", "--recording", log.name, cwd=tmp_path).returncode == 0
    done = run("check", "line.toml", "--recording", log.name, cwd=tmp_path)
    assert done.returncode == 1
    assert "SYNC: jitter of the arrival" in done.stdout
    run("measured", "line.toml", log.name, "--apply", cwd=tmp_path)
    (written_us,) = re.findall(r"^sync_jitter_us = ([\d.]+)", (tmp_path / "line.toml").read_text(), re.MULTILINE)
    assert 15 < float(written_us) < 25
    (cycles,) = re.findall(r"^sync_jitter_cycles = (\d+)", (tmp_path / "line.toml").read_text(), re.MULTILINE)
    assert int(cycles) == len(re.findall(" 080#", log.read_text()))
    # It is no bound: the recording keeps the plan, and no plan is shown to fit with it.
    done = run("check", "line.toml", "--recording", log.name, cwd=tmp_path)
    assert re.findall(r"BP\d+", done.stdout) == ["BP114"]
    assert f"is the worst of {int(cycles):,} measured cycles, no bound" in done.stdout
    with (tmp_path / "line.toml").open("a") as file:
        file.write("[limits]\nmissed_cycles = 1\n")
    assert run("check", "line.toml", "--recording", log.name, cwd=tmp_path).returncode == 0


def test_it_is_said_how_late_sync_may_come(run: Run, tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text(PLAN)
    said = run("capacity", "line.toml", "--sensitivity", cwd=tmp_path).stdout
    # 1240 - 1115 - U.
    assert re.search(r"bus\.sync_jitter_us +0 +10[45]\S* +time", said)


def network(nodes: int, reserve: float, queue: str, period_us: float, deadline_us: float) -> busplan.Profile:
    """A machine with another message."""
    message = {"name": "low", "identifier": 0x700, "payload_bytes": 8, "period_us": 20_000, "deadline_us": deadline_us}
    return loaded(
        {
            "schema_version": 1,
            "name": "line",
            "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": nodes, "queue": queue},
            "cycle": {"period_us": period_us},
            "payload": {"read_bytes": 8, "write_bytes": 8},
            "node": {
                "axes": 1,
                "execution": {"kind": "linear", "base_us": 50, "per_byte_us": 0, "grade": "measured"},
            },
            "message": [{**message, "sender": "host"}],
            "limits": {"reserve": reserve},
        }
    )


@pytest.mark.slow
@given(
    nodes=st.integers(1, 6),
    reserve=st.sampled_from([0.0, 0.1, 0.3]),
    queue=st.sampled_from(["priority", "fifo", "single-buffer"]),
    period_us=st.sampled_from([3000.0, 4000.0, 5000.0]),
    deadline_us=st.sampled_from([2000.0, 3000.0, 10_000.0]),
)
@settings(max_examples=at_least(6))
def test_so_many_repeated_frames_as_the_card_says_leave_the_verdict(**drawn: Any) -> None:
    profile = network(**drawn)
    answer = busplan.capacity(profile)
    (card,) = answer.to_dict()["verdicts"]
    said = [line["text"] for line in card["lines"] if line["label"] == "repeated frames"]
    assert bool(said) is (answer.verdict == "fits")
    if not said or "not tried" in said[0]:
        return
    found = re.match(r"up to (\d+) in a row keep the verdict, one more", said[0])
    most = int(found[1]) if found else 0
    for burst, verdict in ((most, True), (most + 1, False)):
        if burst:
            errors = {"error_period_us": 1e9, "error_burst": burst}
            bus = profile.bus.model_copy(update=errors)
            assert (busplan.capacity(profile.model_copy(update={"bus": bus})).verdict == "fits") is verdict
