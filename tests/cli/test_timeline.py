"""`busplan timeline` through the command line: contract, options together, files, errors."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]


def test_json_holds_the_contract_and_agrees_with_capacity(busplan: Run, tmp_path: Path) -> None:
    options = ("--set", "bus.nodes=7", "--set", "bus.gap_count=optimal", "--period", "2ms")
    run = busplan("timeline", "paper-1ms", *options, "--timing-model", "standard", "--format", "json", cwd=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    document = json.loads(run.stdout)
    assert (document["schema"], document["command"], document["profile"]) == (1, "timeline", "paper-1ms")
    assert document["timing_model"] == "standard"
    for event in document["events"]:
        assert {"kind", "node", "transaction", "start_us", "end_us"} <= set(event)
        assert event["transaction"] in ("read", "write", None)
        assert (event["node"] is None) == (event["transaction"] is None)
    other = busplan("capacity", "paper-1ms", *options, "--timing-model", "standard", "--format", "json", cwd=tmp_path)
    (figures,) = json.loads(other.stdout)["results"]
    for key in ("required_us", "available_us", "margin_us", "fits", "gap_count", "period_us"):
        assert document[key] == figures[key]
    busy = [event for event in document["events"] if event["kind"] != "idle"]
    assert abs(busy[-1]["end_us"] - figures["required_us"]) <= 1e-9
    assert document["events"][-1]["end_us"] == figures["available_us"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--from", "5"], "--from 5: expected a time with its unit, as 4ms, 250us or 0.001s"),
        (["--from", "9us", "--to", "9us"], "--from 9us --to 9us: the window must end after it begins"),
        (["--from", "3ms"], "the window from 3000 us shows nothing: the cycle runs from 0 to 2000 us"),
        (["--transaction", "read:3"], "--transaction read:3: expected read or write and a node from 1 to 2, as read:1"),
        (["--transaction", "ping:1"], "--transaction ping:1: expected read or write"),
        (
            ["--transaction", "read:1", "--from", "1ms", "--timing-model", "paper"],
            "shows nothing: the read of node 1 runs from 0.4 to 52.07",
        ),
        (["--set", "bus.nodes=1000000"], "a timeline shows up to 1000 nodes; one bus carries 62"),
        (["--timing-model", "both"], "both"),
        (["--cycle", "0"], "cycle 0: expected a whole number from 1"),
        (["--cycle", "first"], "--cycle first: expected a whole number from 1, worst or median"),
    ],
)
def test_what_cannot_be_done_is_said_and_leaves_nothing(
    busplan: Run, tmp_path: Path, arguments: list[str], message: str
) -> None:
    run = busplan("timeline", "paper-4ms", *arguments, cwd=tmp_path)
    assert run.returncode == 2
    assert message in run.stderr
    assert "Traceback" not in run.stderr
    assert run.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_a_drawing_takes_the_width_of_its_terminal(on_terminal: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    _, shown = on_terminal("timeline", "paper-4ms", cwd=tmp_path, env={"COLUMNS": "117", "TERM": "dumb"})
    assert {len(line) for line in shown.splitlines() if line.count("|") == 2} == {117}


def test_a_cycle_of_a_recording_is_shown_beside_the_plan(busplan: Run, tmp_path: Path) -> None:
    pytest.importorskip("can", reason="needs python-can, which reads logs")
    busplan("emulate", "can-servo-8", "--cycles", "40", "-o", "bus.log", cwd=tmp_path)
    log = (tmp_path / "bus.log").read_bytes()
    beside = ("timeline", "can-servo-8", "--recording", "bus.log")
    document = json.loads(busplan(*beside, "--format", "json", cwd=tmp_path).stdout)
    assert (document["schema"], document["command"], document["chosen"], document["cycles"]) == (
        1,
        "timeline",
        "worst",
        39,
    )
    for lane in ("recorded", "planned"):
        spent = sum(event["duration_us"] for event in document["events"] if event["lane"] == lane)
        assert spent == pytest.approx(document[f"{lane}_us"])
        assert sum(share[f"{lane}_us"] for share in document["shares"]) == pytest.approx(spent)
    shown = busplan(*beside, "--cycle", "17", "--all", cwd=tmp_path)
    assert (shown.returncode, shown.stderr) == (0, "")
    for words in ("cycle 17 of 39 whole ones, from frame ", "planned ", "wire ", "feedback of node 3 (0x183)"):
        assert words in shown.stdout
    for arguments, message in (
        (("--cycle", "40"), "--cycle 40: bus.log has no such whole cycle; its cycles are 1 to 39"),
        (("--cycle", "0"), "--cycle 0: expected a whole number from 1, worst or median"),
        (
            ("--transaction", "feedback:1"),
            "--transaction feedback:1: a recording is shown by whole cycles; leave it out",
        ),
        (("--channel", "can7"), "channel can7: no such channel; there are synthetic"),
        (("-o", "bus.log", "--format", "json"), "--output bus.log"),
    ):
        refused = busplan(*beside, *arguments, cwd=tmp_path)
        assert (refused.returncode, refused.stdout) == (2, "")
        assert message in refused.stderr
    for arguments, message in (
        (("--cycle", "median"), "--cycle median: needs --recording FILE; a planned cycle has a number from 1"),
        (("--channel", "can0"), "--channel: needs --recording FILE"),
    ):
        assert message in busplan("timeline", "can-servo-8", *arguments, cwd=tmp_path).stderr
    assert (tmp_path / "bus.log").read_bytes() == log
