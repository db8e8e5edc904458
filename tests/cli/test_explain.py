"""`busplan explain` as a process: its forms, its options, and what it refuses."""

import csv
import json
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt

from busplan.buses import kind_named
from busplan.questions.explain.derivation import figure_named

Run = Callable[..., Any]
Refused = Callable[..., str]

HOSTILE = """schema_version = 1
name = "<script>alert(1)</script> | `x` @team"
[bus]
kind = "ieee1394"
speed = "S400"
nodes = 2
[cycle]
period_us = 1000
[payload]
read_bytes = 12
write_bytes = 12
[node]
axes = 4
execution = { kind = "linear", base_us = 30, per_byte_us = 0.35 }
"""


def test_a_figure_is_derived_down_to_its_constants(run: Run) -> None:
    done = run("explain", "paper-two-node", "latency.gaps_us", "--transaction", "read")
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout.splitlines()[0] == "gaps_us of paper-two-node at 4 ms, read, paper model: 7.898966 us"
    assert "T_sum = (82 + 48 g) / R\n" in done.stdout
    assert "= (82 + 48 * 63) / 393.216\n" in done.stdout
    assert "GAPS_TICKS " in done.stdout
    assert "published" in done.stdout


@pytest.mark.parametrize("command", ["capacity", "latency", "circle-test"])
def test_every_key_of_a_commands_json_is_explained_with_its_value(run: Run, command: str) -> None:
    listed = json.loads(run("explain", "paper-1ms", "--format", "json").stdout)
    keys = [row["figure"] for row in listed["figures"] if row["command"] == command]
    extras = {"circle-test": ["--contributions"], "capacity": ["--timing", "paper", "--sensitivity"]}
    extra = extras.get(command, ["--timing", "paper"])
    given = json.loads(run(command, "paper-1ms", *extra, "--format", "json").stdout)
    rows = given.get("results") or given["transactions"]
    row = {**given.get("verdicts", [{}])[0], **rows[0]}
    of_broadcasts = {"query_us", "boards_us", "hub_wait_us"} if command == "latency" else set()
    assert set(row) == set(keys) - of_broadcasts
    keys = [key for key in keys if key not in of_broadcasts]
    # The others are compared without a process each, in tests/questions/explain/test_explain.py.
    for key in (keys[0], keys[-1], *keys[5:9]):
        said = json.loads(run("explain", "paper-1ms", f"{command}.{key}", "--format", "json").stdout)
        (value, *_) = (one["value"] for one in said["derivations"])
        if key not in ("text", "warnings", "cheapest_change"):
            assert value == row[key], key
            assert said["derivations"][0]["steps"] == [] or said["derivations"][0]["steps"][-1]["value"] == row[key]


def keys_inside(value: Any) -> set[str]:
    """Every key of a document, however deep; what a change sets has keys of a profile."""
    if isinstance(value, list):
        return set().union(*map(keys_inside, value))
    if isinstance(value, dict):
        return set(value).union(*(keys_inside(one) for key, one in value.items() if key != "changes"))
    return set()


def test_keys_inside_a_figure_mean_the_figure(run: Run, tmp_path: Path) -> None:
    strict = (Path(__file__).resolve().parents[2] / "profiles" / "paper-1ms.toml").read_text(encoding="utf-8")
    (tmp_path / "strict.toml").write_text(
        strict.replace("max_contour_error_mm = 0.025", "max_contour_error_mm = 0.001")
    )
    found = keys_inside(json.loads(run("capacity", "paper-1ms", "--sensitivity", "--format", "json").stdout))
    found |= keys_inside(json.loads(run("latency", "paper-1ms", "--format", "json").stdout))
    circle = run("circle-test", "strict.toml", "--contributions", "--format", "json", cwd=tmp_path)
    found |= keys_inside(json.loads(circle.stdout))
    frame = {"schema", "command", "profile", "results", "transactions", "verdicts"}
    bus = kind_named("ieee1394")
    for key in found - frame:
        figure_named(key, bus=bus)
    assert figure_named("circle-test.removed_mm", bus=bus)[1].key == "contributions"
    assert figure_named("changes", bus=bus)[1].key == "cheapest_change"


def test_options_multiply_as_in_the_commands(run: Run) -> None:
    arguments = (
        "--period",
        "1ms",
        "--period",
        "600us",
        "--set",
        "bus.nodes=3",
        "--set",
        "bus.gap_count=optimal",
        "--timing",
        "both",
    )
    said = json.loads(run("explain", "paper-4ms", "required_us", *arguments, "--format", "json").stdout)
    given = json.loads(run("capacity", "paper-4ms", *arguments, "--format", "json").stdout)
    assert [one["value"] for one in said["derivations"]] == [row["required_us"] for row in given["results"]]
    assert [one["period_us"] for one in said["derivations"]] == [1000.0, 1000.0, 600.0, 600.0]


def test_without_a_figure_all_are_listed(run: Run) -> None:
    done = run("explain", "paper-4ms")
    assert done.returncode == 0
    assert "circle-test  circular_deviation_mm" in done.stdout
    registry = json.loads(run("explain", "paper-4ms", "--format", "json").stdout)
    assert {"assumptions", "figures", "equations", "constants"} <= set(registry)
    grades = {"published", "derived", "recalled", "measured", "calibrated", "assumed"}
    assert {row["grade"] for row in registry["constants"]} <= grades
    page = run("explain", "paper-4ms", "--format", "markdown").stdout.splitlines()
    assert page[0] == "### The figures of `paper-4ms`"
    assert page[2] == "What the figures of `paper-4ms` rest on, the least well known first:"
    rows = list(csv.DictReader(StringIO(run("explain", "paper-4ms", "--format", "csv").stdout)))
    assert rows == registry["figures"]


@pytest.mark.parametrize(("name", "has_bias"), [("sercos2-servo-8", False), ("paper-4ms", True)])
def test_a_bias_that_nobody_knows_is_not_listed(run: Run, name: str, has_bias: bool) -> None:
    listed = [one["figure"] for one in json.loads(run("explain", name, "--format", "json").stdout)["figures"]]
    assert ("bias_us" in listed) == has_bias


def test_the_rows_of_csv_are_the_steps_of_json(run: Run) -> None:
    question = ("explain", "paper-4ms", "required_us", "--timing", "both")
    rows = list(csv.DictReader(StringIO(run(*question, "--format", "csv").stdout)))
    found = json.loads(run(*question, "--format", "json").stdout)["derivations"]
    steps = [(one, number, step) for one in found for number, step in enumerate(one["steps"], start=1)]
    assert len(rows) == len(steps) > 30
    for row, (one, number, step) in zip(rows, steps, strict=True):
        assert (row["profile"], row["command"], row["figure"]) == ("paper-4ms", "capacity", "required_us")
        assert (row["timing_model"], row["transaction"], float(row["period_us"])) == (one["timing_model"], "", 4000)
        assert row["step"] == str(number)
        keys = ("reference", "symbol", "formula", "numbers", "unit")
        assert {key: row[key] for key in keys} == {key: step[key] for key in keys}
        assert row["value"] == str(step["value"])
    assert list(rows[0]) == [
        *("profile", "command", "figure", "timing_model", "transaction", "period_us"),
        *("step", "reference", "symbol", "formula", "numbers", "value", "unit"),
    ]


def test_an_input_is_one_row_without_a_formula(run: Run) -> None:
    (row,) = csv.DictReader(StringIO(run("explain", "paper-4ms", "period_us", "--format", "csv").stdout))
    assert (row["symbol"], row["formula"], row["numbers"], row["value"]) == ("T_s", "", "", "4000.0")


def test_what_has_parts_is_json_in_its_cell(run: Run) -> None:
    question = ("explain", "paper-1ms", "cheapest_change")
    *_, row = csv.DictReader(StringIO(run(*question, "--format", "csv").stdout))
    (one,) = json.loads(run(*question, "--format", "json").stdout)["derivations"]
    assert json.loads(row["value"]) == one["value"]
    assert run(*question).stdout.startswith(
        "cheapest_change of paper-1ms at 1 ms, standard model: bus.gap_count = 10\n"
    )


def test_markdown_shows_a_hostile_name_and_does_nothing_with_it(run: Run, tmp_path: Path) -> None:
    (tmp_path / "hostile.toml").write_text(HOSTILE)
    done = run("explain", "hostile.toml", "required_us", "--format", "markdown", cwd=tmp_path)
    page = MarkdownIt("commonmark", {"html": True}).enable("table").render(done.stdout)
    assert "<script>" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; | `x` @team</code>" in page
    assert page.count("<table>") == 2
    widths = {line.count("|") - line.count("\\|") for line in done.stdout.splitlines() if line.startswith("|")}
    assert len(widths) == 2


def test_a_circle_that_is_not_simulated_says_why(run: Run) -> None:
    done = run("explain", "paper-1ms", "circular_deviation_mm", "--period", "200us")
    assert done.returncode == 0
    assert "not simulated: the cycle does not fit the bus" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("paper-4ms", "requird_us"), "did you mean required_us"),
        (("paper-4ms", "required_us", "--period", "4"), "with its unit"),
        (("no-such", "required_us"), "no such file"),
        (("paper-4ms", "--period", "1ms", "--timing", "both"), "--period and --timing: goes with a FIGURE"),
        (("can-servo-8", "bias_us"), "bias_us: no bias is known for this bus, CAN"),
        (("paper-4ms", "max_contour_error_mm", "--period", "1050us"), "multiple"),
    ],
)
def test_what_cannot_be_explained_is_refused(refused: Refused, arguments: tuple[str, ...], said: str) -> None:
    assert said in refused("explain", *arguments)
