"""What a verdict on CAN rests on: a bit rate that is assumed, priority queues, no repeated frames."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import busplan
from tests.buses.can.machines import figures

Run = Callable[..., Any]
HEAD = """\
schema_version = 1
name = "line"

[bus]
kind = "can"
bit_rate_kbit_s = 500      # assumed: the least usual one that the log allows
"""
MESSAGES = """
[[message]]
name = "door"
identifier = 0x100
payload_bytes = 8
period_us = 10000
"""
MACHINE = """\
nodes = 2

[cycle]
period_us = 4000

[payload]
read_bytes = 8
write_bytes = 8

[node]
axes = 1

[node.execution]
kind = "linear"
grade = "measured"
base_us = 50
per_byte_us = 0
"""
KEY = "bus.bit_rate_kbit_s"


@pytest.fixture(params=[HEAD + MESSAGES, HEAD + MACHINE], ids=["messages", "machine"])
def plan_file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / "line.toml"
    path.write_text(request.param, encoding="utf-8")
    return path


@pytest.mark.parametrize("form", ["table", "markdown", "html"])
def test_the_card_says_what_it_rests_on_in_every_form(run: Run, plan_file: Path, form: str) -> None:
    said = run("capacity", plan_file.name, "--format", form, cwd=plan_file.parent).stdout.replace("\\", "")
    assert "no repeated frames, priority queues" in said
    assert "bus.bit_rate_kbit_s: look it up in the configuration of the nodes" in said


def test_so_do_the_lines_of_json(run: Run, plan_file: Path) -> None:
    document = json.loads(run("capacity", plan_file.name, "--format", "json", cwd=plan_file.parent).stdout)
    lines = document["verdicts"][0]["lines"]
    words = [part["words"] for part in document["verdicts"][0]["rests_on"]]
    assert words[:2] == ["no repeated frames", "priority queues"]
    assert {"label": "assumed", "text": "bus.bit_rate_kbit_s: look it up in the configuration of the nodes"} in lines


ERRORS = "error_period_us = 100000\n"


def test_errors_are_what_it_rests_on_then(run: Run, plan_file: Path) -> None:
    plan_file.write_text(plan_file.read_text("utf-8").replace(HEAD, HEAD + ERRORS), encoding="utf-8")
    said = run("capacity", plan_file.name, cwd=plan_file.parent).stdout
    assert "no repeated frames" not in said


def test_the_margin_is_said_in_repeated_frames(run: Run, plan_file: Path) -> None:
    said = run("capacity", plan_file.name, cwd=plan_file.parent).stdout
    (margin,) = re.findall(
        r"repeated frames +up to (\d+) in a row keep the verdict, one more makes ([\w ]+) late", said
    )
    most, late = int(margin[0]), margin[1]
    assert late == ("door" if "door" in plan_file.read_text("utf-8") else "the cycle")
    # So many errors in a row, and no other: the verdict is the same, and with one more it is not.
    for burst, verdict in ((most, True), (most + 1, False)):
        errors = {"bus.error_period_us": 1e9, "bus.error_burst": burst}
        (result,) = busplan.capacity(busplan.load_profile(plan_file, changes=errors)).figures[:1]
        assert (result.verdict == "fits") is verdict


def test_an_endless_response_is_laid_to_the_errors_that_make_it(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    text = HEAD + "error_period_us = 332\n" + MESSAGES.replace("10000", "1000")
    path.write_text(text, encoding="utf-8")
    assert (
        "for with it and repeated frames the bus has a load of 127.0%;" in run("check", path.name, cwd=tmp_path).stdout
    )
    # Without errors it is in time; a single one in each 332 us is too many.
    assert "repeated frames a single one makes door late" in run("capacity", path.name, cwd=tmp_path).stdout


def test_a_timeline_shows_repeated_frames(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text(HEAD + ERRORS + "error_burst = 2\n" + MACHINE, encoding="utf-8")
    events = json.loads(run("timeline", path.name, "--format", "json", cwd=tmp_path).stdout)["events"]
    # 31 bits and 8 bytes, at 2 us a bit.
    assert [one["duration_us"] for one in events if one["kind"] == "repeated"] == [2 * (31 + 135)] * 2


def test_a_plan_that_fails_has_no_margin_in_repeated_frames(run: Run, plan_file: Path) -> None:
    changes = (
        "--set",
        "message.door.deadline_us=100" if "door" in plan_file.read_text("utf-8") else "cycle.period_us=500",
    )
    done = run("capacity", plan_file.name, *changes, cwd=plan_file.parent)
    assert "FIT" in done.stdout
    assert "\n  repeated frames" not in done.stdout
    assert "up to" not in done.stdout


def test_an_assumed_bit_rate_warns_where_it_stands(run: Run, plan_file: Path) -> None:
    done = run("check", plan_file.name, cwd=plan_file.parent)
    assert "line.toml:6:1: BP112 warning: bus.bit_rate_kbit_s: an assumption, which carries " in done.stdout
    assert done.returncode == 0


def test_every_later_answer_calls_it_assumed(run: Run, plan_file: Path) -> None:
    # That of a machine is longer, of the same answers.
    reports = [("report", "--no-circle")] * ("door" in plan_file.read_text("utf-8"))
    for arguments in (
        ("explain", "bus_load"),
        ("explain", "worst_response_us"),
        ("capacity", "--set", "limits.max_load=0.5"),
        *reports,
    ):
        command, *rest = arguments
        said = run(command, plan_file.name, *rest, cwd=plan_file.parent).stdout
        lines = [part for part in said.splitlines() if KEY in part]
        assert any("assumed" in part or "look it up" in part for part in lines), command


def test_compare_names_it_beside_what_other_kinds_assume(run: Run, tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text(HEAD + MACHINE, encoding="utf-8")
    document = json.loads(
        run("compare", "line.toml", "--buses", "can,ethercat", "--format", "json", cwd=tmp_path).stdout
    )
    own = next(one for one in document["buses"] if one["kind"] == "can")
    assert [(one["key"], one["source"]) for one in own["assumed"]] == [(KEY, "profile")]


def test_a_bit_rate_that_is_given_warns_of_nothing(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text((HEAD + MACHINE).replace("assumed: the least usual", "set: the usual"), encoding="utf-8")
    assert busplan.check(path).findings == ()


def test_a_bit_rate_that_carries_little_is_no_warning(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    slow = (HEAD + MACHINE).replace("base_us = 50", "base_us = 1900")
    path.write_text(slow.replace("period_us = 4000", "period_us = 100000"), encoding="utf-8")
    assert busplan.check(path).findings == ()


@pytest.mark.parametrize("name", ["can-servo-8", "can-fd-arm-7", "can-motors-8"])
def test_slow_oscillators_are_a_doubt_of_cycle_load_and_responses(name: str) -> None:
    exact, slow = (
        busplan.load_profile(name, changes={"bus.clock_tolerance": share, "cycle.period_us": 1e6})
        for share in (0.0, 0.01)
    )
    each = [figures(exact), figures(slow)]
    assert each[0].terms == each[1].terms
    # All frames, and nothing else, take 1 % longer.
    frames_us = sum(term.us for term in each[0].terms if term.name not in ("wait", "host"))
    late_us, slow_us = (
        2 * sum(doubt.us for doubt in one.doubts if doubt.key in ("bus.clock_tolerance", "fd_late_bits"))
        for one in each
    )
    assert slow_us == pytest.approx(late_us + 0.01 * (frames_us + late_us))


@pytest.mark.parametrize("name", ["can-servo-8", "can-fd-arm-7", "can-motors-8"])
def test_a_response_with_slow_oscillators_is_explained(name: str) -> None:
    slow = busplan.load_profile(name, changes={"bus.clock_tolerance": 0.01})
    derivations = busplan.explain(slow, "worst_response_us").to_dict()["derivations"]
    assert all("bus.clock_tolerance" in [given["name"] for given in each["inputs"]] for each in derivations)


@pytest.mark.parametrize("name", ["can-servo-8", "can-fd-arm-7", "can-motors-8"])
def test_a_response_with_repeated_frames_is_explained(name: str) -> None:
    disturbed = busplan.load_profile(name, changes={"bus.error_period_us": 1e5})
    derivations = busplan.explain(disturbed, "worst_response_us").to_dict()["derivations"]
    assert all("bus.error_period_us" in [given["name"] for given in each["inputs"]] for each in derivations)
    assert any("1 repeated frames of" in str(each) for each in derivations)


def test_a_load_kept_by_exact_clocks_alone_is_not_shown() -> None:
    load = figures(busplan.load_profile("can-servo-8")).own.bus_load
    for share, verdict in ((0.0, "fits"), (0.005, "fits"), (0.0158, "not shown to fit")):
        changes = {"bus.clock_tolerance": share, "limits.max_load": 1.01 * load}
        assert figures(busplan.load_profile("can-servo-8", changes=changes)).verdict == verdict


def test_the_period_that_keeps_a_load_counts_slow_oscillators() -> None:
    exact, slow = (
        figures(busplan.load_profile("can-servo-8", changes={"bus.clock_tolerance": share, "limits.max_load": 0.3}))
        for share in (0.0, 0.01)
    )
    assert slow.safe_min_period_us > 1.01 * exact.safe_min_period_us


@pytest.mark.parametrize(("share", "kept"), [(0.0, 3), (0.0158, 2)])
def test_so_does_the_margin_in_repeated_frames(share: float, kept: int) -> None:
    changes = {
        "bus.clock_tolerance": share,
        "message.sdo-response.deadline_us": 5000,
        "node.execution.grade": "measured",
    }
    (card,) = busplan.capacity(busplan.load_profile("can-servo-8", changes=changes)).to_dict()["verdicts"]
    (words,) = (line["text"] for line in card["lines"] if line["label"] == "repeated frames")
    assert words == f"up to {kept} in a row keep the verdict, one more makes sdo-response late"
