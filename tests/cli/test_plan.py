"""`busplan plan`: exit codes, documents, files that are written as a whole or not at all."""

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]

PROFILE = """\
# our machine
schema_version = 1
name = "mine"
[bus]
kind = "ieee1394"
speed = "S400"
nodes = 2        # as built
gap_count = 63   # power-up
[cycle]
period_us = 1000
[payload]
read_bytes = 12
write_bytes = 12
[node]
axes = 4
[node.execution]
kind = "table"
payload_bytes = [4, 64]
time_us = [31.4, 52.4]
"""


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(PROFILE, encoding="utf-8")
    return path


@pytest.fixture
def explain(run: Run) -> Callable[[Path], dict[str, str]]:
    """Grades of the keys that a profile's utilisation rests on."""

    def call(path: Path) -> dict[str, str]:
        document = json.loads(run("explain", path.name, "utilisation", "--format", "json", cwd=path.parent).stdout)
        inputs = [given for derivation in document["derivations"] for given in derivation["inputs"]]
        return {given["name"]: given["grade"] for given in inputs if "." in given["name"]}

    return call


@pytest.fixture
def busplan(busplan: Run) -> Run:
    """Call `plan` in this process."""

    def call(*arguments: object, cwd: Path, stdin: str | None = None) -> Any:
        return busplan("plan", *arguments, cwd=cwd, stdin=stdin)

    return call


def test_apply_changes_the_values_and_nothing_else(busplan: Run, profile: Path) -> None:
    run = busplan(profile.name, "--axes", 15, "--apply", "--format", "json", cwd=profile.parent)
    assert run.returncode == 0
    document = json.loads(run.stdout)
    assert document["goal"] == {"nodes": 4, "axes": 16}
    assert document["recommended_changes"] == {"bus.nodes": 4, "bus.gap_count": 10}
    assert run.stderr == "changed mine.toml: bus.nodes = 4, bus.gap_count = 10\n"
    expected = PROFILE.replace("nodes = 2 ", "nodes = 4 ").replace("gap_count = 63 ", "gap_count = 10 ")
    assert profile.read_text(encoding="utf-8") == expected
    again = busplan(profile.name, "--apply", cwd=profile.parent)
    assert (again.returncode, again.stderr) == (0, "mine.toml: nothing to change, left as it is\n")


def test_a_new_file_holds_the_plan_and_the_old_one_stays(busplan: Run, profile: Path) -> None:
    new = profile.parent / "new.toml"
    run = busplan("-", "--nodes", 4, "--period", "900us", "-o", new.name, cwd=profile.parent, stdin=PROFILE)
    assert (run.returncode, run.stderr) == (0, "wrote new.toml\n")
    data = tomllib.loads(new.read_text(encoding="utf-8"))
    assert (data["bus"]["nodes"], data["cycle"]["period_us"]) == (4, 900)
    assert "servo" not in data
    again = busplan("mine.toml", "-o", new.name, cwd=profile.parent)
    assert (again.returncode, again.stdout) == (2, "")
    assert "--force" in again.stderr
    assert busplan("mine.toml", "-o", new.name, "--force", cwd=profile.parent).returncode == 0
    assert tomllib.loads(new.read_text(encoding="utf-8"))["bus"]["nodes"] == 2
    assert profile.read_text(encoding="utf-8") == PROFILE


def test_a_new_file_keeps_comments_and_has_a_name_of_its_own(busplan: Run, profile: Path) -> None:
    text = PROFILE.replace("[bus]", 'description = """\nTwo nodes,\n1 ms"""\n[bus]')
    profile.write_text(text, encoding="utf-8")
    assert busplan("mine.toml", "--axes", 15, "-o", "new.toml", cwd=profile.parent).returncode == 0
    expected = text.replace("nodes = 2 ", "nodes = 4 ").replace("gap_count = 63 ", "gap_count = 10 ")
    expected = expected.replace('"mine"', '"new"').replace(
        '"""\nTwo nodes,\n1 ms"""', r'"A plan of mine, which is: Two nodes,\n1 ms"'
    )
    assert (profile.parent / "new.toml").read_text(encoding="utf-8") == expected
    # To standard output it has no other name.
    piped = busplan("mine.toml", "--axes", 15, "-o", "-", cwd=profile.parent)
    assert tomllib.loads(piped.stdout)["name"] == "mine"


GRADED = """\
schema_version = 1
name = "graded"
[bus]
kind = "ieee1394"
speed = "S400"             # published: of its data sheet
nodes = 2
gap_count = 63             # measured: with gscanbus
[cycle]                    # published: in the drawing
period_us = 1000           # assumed: what the mechanics ask for
[payload]                  # assumed
read_bytes = 12
write_bytes = 12
[node]
axes = 4
[node.execution]
kind = "linear"
base_us = 60
per_byte_us = 0.3          # derived
grade = "measured"
"""
INLINE = """\
schema_version = 1
name = "inline"
cycle = {period_us = 1000} # assumed
bus.kind = "ieee1394"
bus.speed = "S400"         # published: of its data sheet
bus.nodes = 2
bus.gap_count = 63         # measured: with gscanbus
""" + GRADED[GRADED.index("[payload]") :]


def test_no_grade_is_better_after_a_plan(
    busplan: Run, explain: Callable[[Path], dict[str, str]], profile: Path
) -> None:
    profile.write_text(GRADED, encoding="utf-8")
    before = explain(profile)
    assert (before["cycle.period_us"], before["bus.gap_count"]) == ("assumed", "measured")
    given = ("mine.toml", "--nodes", 9, "--set", "payload.read_bytes=16", "--free", "gap_count,slice_ratio,period")
    run = busplan(*given, "-o", "new.toml", "--format", "json", cwd=profile.parent)
    changes = json.loads(run.stdout)["recommended_changes"]
    assert {*changes} == {"bus.nodes", "payload.read_bytes", "bus.gap_count", "cycle.slice_ratio", "cycle.period_us"}
    assert busplan(*given, "--apply", cwd=profile.parent).returncode == 0
    for path in (profile, profile.parent / "new.toml"):
        after = explain(path)
        # A chosen value is not measured or published, and another assumption is one still.
        assert after == {**before, "bus.gap_count": "given", "cycle.slice_ratio": "given"}
        text = path.read_text(encoding="utf-8")
        assert "# was measured: with gscanbus" in text
        assert re.search(r"^slice_ratio = 0\.\d+  # not published$", text, re.MULTILINE)


def test_a_layout_that_cannot_be_edited_loses_no_grade(
    busplan: Run, explain: Callable[[Path], dict[str, str]], profile: Path
) -> None:
    profile.write_text(INLINE, encoding="utf-8")
    refused = busplan("mine.toml", "--set", "cycle.slice_ratio=0.7", "--apply", cwd=profile.parent)
    assert (refused.returncode, "by hand" in refused.stderr) == (2, True)
    assert busplan("mine.toml", "--set", "cycle.slice_ratio=0.7", "-o", "new.toml", cwd=profile.parent).returncode == 0
    before, after = explain(profile), explain(profile.parent / "new.toml")
    assert before["cycle.period_us"] == after["cycle.period_us"] == "assumed"
    assert before["bus.gap_count"] == after["bus.gap_count"] == "measured"
    assert after == {**before, "cycle.slice_ratio": "given"}


def test_a_plan_is_applied_and_reported_in_one_call(busplan: Run, profile: Path) -> None:
    run = busplan("mine.toml", "--nodes", 4, "--apply", "-o", "report.json", cwd=profile.parent)
    assert (run.returncode, run.stdout) == (0, "")
    assert run.stderr == "changed mine.toml: bus.nodes = 4, bus.gap_count = 10\nwrote report.json\n"
    document = json.loads((profile.parent / "report.json").read_text(encoding="utf-8"))
    assert document["recommended_changes"] == {"bus.nodes": 4, "bus.gap_count": 10}
    assert "nodes = 4 " in profile.read_text(encoding="utf-8")


@pytest.mark.parametrize("option", [["--apply"], ["-o", "new.toml"]])
def test_without_a_plan_nothing_is_written(busplan: Run, profile: Path, option: list[str]) -> None:
    before = sorted(profile.parent.iterdir())
    run = busplan(profile.name, "--set", "bus.gap_count=3", *option, cwd=profile.parent)
    assert run.returncode == 1
    assert "NO PLAN" in run.stdout
    assert "not written" in run.stderr
    assert sorted(profile.parent.iterdir()) == before
    assert profile.read_text(encoding="utf-8") == PROFILE


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["paper-1ms", "--apply"], "busplan init"),
        (["-", "--apply"], "give the profile as a file"),
        (["mine.toml", "--nodes", "2", "--axes", "8"], "give one of them"),
        (["mine.toml", "--apply", "-o", "x.toml"], "give one of them"),
        (["mine.toml", "--force"], "needs -o"),
        (["mine.toml", "--force", "-o", "report.md"], "needs -o NEW.toml"),
        (["mine.toml", "-o", "link.md"], "would overwrite mine.toml, which is read"),
        (["mine.toml", "-o", "page.htm", "--format", "html"], "--output page.htm: expected a name ending in .toml"),
        (["mine.toml", "-o", "-", "--format", "json"], "standard output takes one document"),
        (["mine.toml", "-o", "mine.toml", "--force"], "would overwrite mine.toml, which is read"),
        (["gantry-24", "--axes", "30"], "say --set group.drives.nodes=6 or --set group.tool.nodes=3\n"),
        (["mine.toml", "-o", "no/such/folder.toml"], "no folder"),
        (
            ["mine.toml", "--free", "cabling"],
            "--free cabling: there is nothing of that name to free on a bus of kind",
        ),
        (["mine.toml", "--free", ""], "there are gap_count, slice_ratio, responses, schedule, payload, period, nodes"),
        (["mine.toml", "--free", "period", "--period", "1ms"], "--free period: cycle.period_us was given a value"),
    ],
)
def test_what_cannot_be_done_is_said(busplan: Run, profile: Path, arguments: list[str], words: str) -> None:
    (profile.parent / "link.md").symlink_to("mine.toml")
    run = busplan(*arguments, cwd=profile.parent)
    assert (run.returncode, run.stdout) == (2, "")
    assert words in run.stderr
    assert "Traceback" not in run.stderr
    assert profile.read_text(encoding="utf-8") == PROFILE


def test_a_reserve_is_kept_and_written_and_the_gate_passes(busplan: Run, run: Run, profile: Path) -> None:
    done = busplan(
        "mine.toml", "--axes", 16, "--set", "limits.reserve=0.2", "--apply", "--format", "json", cwd=profile.parent
    )
    assert done.returncode == 0
    assert tomllib.loads(profile.read_text(encoding="utf-8"))["limits"] == {"reserve": 0.2}
    assert json.loads(done.stdout)["recommended_changes"]["limits.reserve"] == 0.2
    checked = run("check", "mine.toml", cwd=profile.parent)
    assert (checked.returncode, "error" in checked.stdout) == (0, False)
    # Nothing is left to change.
    again = busplan("mine.toml", "--apply", cwd=profile.parent)
    assert again.stderr == "mine.toml: nothing to change, left as it is\n"


def test_only_what_is_freed_is_changed(busplan: Run, profile: Path) -> None:
    asked = ("mine.toml", "--nodes", 7, "--period", "1ms", "--format", "json")
    for free, code, keys in (
        ("slice_ratio", 1, None),
        ("gap_count, responses", 0, {"bus.nodes", "node.read_response", "node.write_response", "bus.gap_count"}),
    ):
        done = busplan(*asked, "--free", free, cwd=profile.parent)
        document = json.loads(done.stdout)
        assert done.returncode == code
        assert document["free"] == [name.strip() for name in free.split(",")]
        changes = document["recommended_changes"]
        assert (changes if changes is None else set(changes)) == keys
        assert bool(document["relaxations"]) == (code == 1)
