"""`--set KEY=VALUE` on every command that reads a profile: computed, said, refused, written, and repeated by a page."""

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.registers import COMMANDS

Run = Callable[..., Any]
Refused = Callable[..., str]

SHIPPED = Path(__file__).parents[2] / "profiles"
PROFILE = """\
schema_version = 1
name = "mine"
[bus]
kind = "ieee1394"
speed = "S400"
nodes = 2        # as built
gap_count = 10   # busplan: ignore[BP110] chosen with the drive's maker
[cycle]
period_us = 2000 # as the drives
[payload]
read_bytes = 12
write_bytes = 12
[node]
axes = 4
[node.execution]
kind = "linear"
base_us = 30
per_byte_us = 0.35
[servo]
position_gain_per_s = 50
velocity_feedforward = 0
[circle]
radius_mm = 5
feed_mm_per_min = 3000
ramp_periods = 20
"""
SET = ("--set", "node.axes=3", "--set", "bus.speed=S200")
SAID = "With --set node.axes=3 and --set bus.speed=S200."
VALUES = {"node.axes": 3, "bus.speed": "S200"}
EVERY = {
    "capacity": ("mine.toml",),
    "latency": ("mine.toml",),
    "circle-test": ("mine.toml",),
    "explain": ("mine.toml", "required_us"),
    "timeline": ("mine.toml",),
    "map": ("mine.toml",),
    "explore": ("mine.toml", "--x", "axes=3,6", "--y", "cycle.period_us=500,1000"),
    "compare": ("mine.toml",),
    "report": ("mine.toml",),
    "plan": ("mine.toml",),
    "sweep": ("mine.toml", "--vary", "bus.nodes=1:3"),
    "diff": ("mine.toml", "paper-1ms"),
    "calibrate": ("mine.toml", "table-1.csv"),
    "check": ("mine.toml", "--no-circle"),
}
WITHOUT_PROFILE = {"rule", "schema", "manual", "evidence", "paper", "profiles", "init", "import"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine.toml").write_text(PROFILE, encoding="utf-8")
    return tmp_path


@pytest.fixture
def edited(tmp_path: Path) -> Path:
    """The profile with the changes in its file, under the same name."""
    folder = tmp_path / "edited"
    folder.mkdir()
    text = PROFILE.replace("axes = 4", "axes = 3").replace("S400", "S200")
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    return folder


def test_every_command_that_reads_a_profile_is_tried_here() -> None:
    # `measured` is tried beside its recordings, `emulate` with its own kinds of bus.
    assert {*EVERY, *WITHOUT_PROFILE, "measured", "emulate"} == set(COMMANDS)


@pytest.mark.slow
@pytest.mark.parametrize("command", EVERY)
def test_every_answer_is_that_of_the_edited_file_and_says_so(
    run: Run, folder: Path, edited: Path, command: str
) -> None:
    form = "--format=json"
    # The other side of a diff gets the changes, too.
    other = SET if command == "diff" else ()
    changed = run(command, *EVERY[command], *SET, form, cwd=folder)
    file = run(command, *EVERY[command], *other, form, cwd=edited)
    assert changed.returncode == file.returncode
    document, expected = json.loads(changed.stdout), json.loads(file.stdout)
    assert list(document)[:3] == ["schema", "command", "changes_of_both" if command == "diff" else "changes"]
    assert document["changes_of_both" if command == "diff" else "changes"] == VALUES
    assert without_changes(document) == without_changes(expected)
    if command != "diff":
        assert "changes" not in expected


def without_changes(item: Any) -> Any:
    """A document without what names the options: the keys of --set, and the end of a finding."""
    if isinstance(item, dict):
        kept = {key: one for key, one in item.items() if one != VALUES}
        return {key: without_changes(one) for key, one in kept.items() if key not in ("recommended_changes", "changes")}
    if isinstance(item, list):
        return [without_changes(one) for one in item]
    return item.removesuffix(f" ({SAID[0].lower()}{SAID[1:-1]})") if isinstance(item, str) else item


def test_a_short_form_is_the_key_it_stands_for(run: Run, folder: Path) -> None:
    by_short, by_set = (
        json.loads(run("plan", "mine.toml", *asked, "--format", "json", cwd=folder).stdout)
        for asked in (("--period", "1ms", "--nodes", "3"), ("--set", "cycle.period_us=1000", "--set", "bus.nodes=3"))
    )
    assert by_set.pop("changes") == {"cycle.period_us": 1000, "bus.nodes": 3}
    assert by_short == by_set


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("plan", "mine.toml", "--set", "bus.nodes=3", "--nodes", "4"),
            "--nodes 4 and --set bus.nodes=3: both set bus.nodes; give one of them",
        ),
        (
            ("capacity", "mine.toml", "--set", "cycle.period_us=500", "--period", "4ms"),
            "--set cycle.period_us=500 and --period 4ms: both set cycle.period_us; give one of them",
        ),
        (
            ("sweep", "mine.toml", "--vary", "bus.nodes=1:3", "--set", "bus.nodes=3"),
            "--set bus.nodes=3 and --vary bus.nodes: both set bus.nodes; give one of them",
        ),
        (
            ("plan", "mine.toml", "--axes", "8", "--set", "bus.nodes=3"),
            "--set bus.nodes=3 and --axes 8: give one of them",
        ),
        (
            ("check", "mine.toml", "--baseline", "b.json", "--update-baseline", *SET),
            "--update-baseline: cannot be used with --set node.axes=3 and --set bus.speed=S200: it records the files",
        ),
        (
            ("calibrate", "mine.toml", "table-1.csv", "--apply", "--set", "node.execution.base_us=3"),
            "--set node.execution.base_us=3 and --apply: both set node.execution.base_us; give one of them",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_and_the_file_stays(
    refused: Refused, folder: Path, arguments: tuple[str, ...], said: str
) -> None:
    assert refused(*arguments, cwd=folder).startswith(said)
    assert (folder / "mine.toml").read_text(encoding="utf-8") == PROFILE


def test_apply_of_a_plan_writes_the_changes_with_the_recommendation(run: Run, folder: Path) -> None:
    execution = 'node.execution={kind="table", payload_bytes=[4, 64], time_us=[20, 40]}'
    asked = ("--set", "cycle.period_us=400", "--set", execution, "--set", "limits.reserve=0.05", "--nodes", "3")
    done = run("plan", "mine.toml", "--apply", *asked, "--format", "json", cwd=folder)
    assert done.returncode == 0, done.stderr
    text = (folder / "mine.toml").read_text(encoding="utf-8")
    data, document = tomllib.loads(text), json.loads(done.stdout)
    assert re.search(r"^period_us = 400 +# as the drives$", text, re.MULTILINE)
    assert re.search(r"^nodes = 3 +# as built$", text, re.MULTILINE)
    assert data["node"]["execution"] == {"kind": "table", "payload_bytes": [4, 64], "time_us": [20, 40]}
    assert data["limits"] == {"reserve": 0.05}
    assert 'node.execution.kind = "table", node.execution.payload_bytes = [4, 64], ' in done.stderr
    for key, value in document["recommended_changes"].items():
        section, _, name = key.partition(".")
        assert key == "node.execution" or data[section][name] == value
    assert set(document["recommended_changes"]) > {"cycle.period_us", "bus.nodes", "node.execution", "limits.reserve"}


def test_a_new_profile_has_the_changes_and_a_plan_keeps_them(run: Run, folder: Path) -> None:
    asked = ("--set", "cycle={period_us=150, slice_ratio=0.5}", "--set", "node.axes=2", "--axes", "6")
    done = run("plan", "mine.toml", "-o", "-", *asked, cwd=folder)
    assert "With --set cycle={period_us=150, slice_ratio=0.5} and --set node.axes=2." in done.stderr
    assert "3 nodes (6 axes) at 150 us" in done.stderr
    # Neither the period nor the slice ratio may change, and nothing else helps.
    assert (done.returncode, done.stdout) == (1, "")
    asked = ("--set", "cycle={period_us=900, slice_ratio=0.5}", *asked[2:])
    new = tomllib.loads(run("plan", "mine.toml", "-o", "-", *asked, cwd=folder).stdout)
    assert (new["cycle"], new["node"]["axes"], new["bus"]["nodes"]) == ({"period_us": 900.0, "slice_ratio": 0.5}, 2, 3)


def test_apply_of_a_calibration_does_not_write_the_bench(run: Run, tmp_path: Path) -> None:
    bench = tmp_path / "bench.toml"
    bench.write_bytes((SHIPPED / "paper-two-node.toml").read_bytes())
    before = tomllib.loads(bench.read_text(encoding="utf-8"))
    asked = ("--apply", "--set", "cycle.nonperiodic_us=5", "--set", "bus.nodes=2")
    done = run("calibrate", "bench.toml", "table-1.csv", *asked, cwd=tmp_path)
    assert done.stderr.startswith("wrote [node.execution] of bench.toml; ")
    data = tomllib.loads(bench.read_text(encoding="utf-8"))
    assert (data["cycle"], data["bus"]) == (before["cycle"], before["bus"])


def test_findings_are_at_the_place_of_the_key_and_say_the_change(run: Run, folder: Path) -> None:
    done = run("check", "mine.toml", "--no-circle", "--set", "cycle.period_us=200", cwd=folder)
    assert done.returncode == 1
    (line,) = done.stdout.splitlines()
    assert line.startswith("mine.toml:9:1: BP101 error: cycle.period_us: the cycle needs ")
    assert " (with --set cycle.period_us=200); " in line
    said = "checked 1 profile: 1 error, 0 warnings; 1 circle test not run; 1 finding suppressed"
    assert done.stderr == f"With --set cycle.period_us=200.\n{said}\n"


def test_a_suppression_works_and_is_not_idle_for_another_value(run: Run, folder: Path) -> None:
    def findings(*options: str) -> str:
        return str(run("check", "mine.toml", "--no-circle", *options, cwd=folder).stdout)

    (folder / "mine.toml").write_text(PROFILE.replace("gap_count = 10", "gap_count = 7"), encoding="utf-8")
    assert "BP902 warning: BP110 has nothing to suppress" in findings()
    assert findings("--set", "bus.gap_count=optimal") == ""
    # A larger one is the finding that the comment suppresses.
    assert findings("--set", "bus.gap_count=63") == ""
    uncommented = PROFILE.replace("busplan: ignore[BP110]", "")
    (folder / "mine.toml").write_text(uncommented, encoding="utf-8")
    assert "BP110 warning: bus.gap_count" in findings("--set", "bus.gap_count=63")


def test_figures_of_the_changed_profile_are_compared_with_the_baseline(run: Run, folder: Path) -> None:
    run("check", "mine.toml", "--no-circle", "--baseline", "b.json", "--update-baseline", cwd=folder)
    kept = (folder / "b.json").read_bytes()
    done = run("check", "mine.toml", "--no-circle", "--baseline", "b.json", "--set", "node.axes=3", cwd=folder)
    assert done.returncode == 1
    assert "BP301 error: node.axes: 3, was 4: safe axes fell from" in done.stdout
    assert (folder / "b.json").read_bytes() == kept


def test_the_commands_of_a_page_repeat_the_changes(run: Run, shell: Run, folder: Path) -> None:
    asked = ("--set", 'node.execution={kind="linear", base_us=30, per_byte_us=0.1}', "--set=cycle.period_us=1000")
    done = run("report", "mine.toml", *asked, "--format", "json", cwd=folder)
    answers = json.loads(done.stdout)["profiles"][0]["answers"]
    page = run("report", "mine.toml", *asked, "--format", "markdown", cwd=folder).stdout
    lines = re.findall(r"```sh\n(.*)\n```", page)
    assert {*answers} >= {"capacity", "latency", "timeline", "map", "explain"}
    for document, line in zip(answers.values(), lines, strict=True):
        own = json.loads(shell(f"{line} --format json", cwd=folder).stdout)
        # The page names them once, for all.
        assert own.pop("changes")["node.execution"] == {"kind": "linear", "base_us": 30, "per_byte_us": 0.1}
        assert own == document


def test_a_picture_says_the_changes(run: Run, folder: Path) -> None:
    picture = run("timeline", "mine.toml", "--set", "bus.speed=S200", "--format", "svg", cwd=folder).stdout
    assert "With --set bus.speed" in picture
    run("circle-test", "mine.toml", "--set", "bus.speed=S200", "-o", "c.svg", cwd=folder)
    run("map", "mine.toml", "--x", "bus.nodes=1:3", "--set", "bus.speed=S200", "-o", "s.svg", cwd=folder)
    for name, said in (("c.svg", "--set bus.speed=S200"), ("s.svg", "With --set bus.speed=S200.")):
        assert said in (folder / name).read_text(encoding="utf-8")
