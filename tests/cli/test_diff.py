"""`busplan diff` as users and gates call it: figures of the other commands, exit codes, revisions, refusals."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]
Refused = Callable[..., str]

PAIRS = [("paper-1ms", "paper-optimal-gap"), ("paper-4ms", "paper-two-node"), ("paper-dma", "paper-1ms")]
JSON = ("--format", "json")
GATE = "--fail-on-regression"


def answer(run: Run, *arguments: str, **options: Any) -> Any:
    return json.loads(run(*arguments, *JSON, **options).stdout)


def expected(run: Run, name: str) -> dict[tuple[str, str], Any]:
    """Figures of one profile by part and name, as the commands that compute them give them."""
    capacity = answer(run, "capacity", name)
    by_model = {one["timing_model"]: one for one in capacity["results"]}
    deciding = by_model["standard"]
    found = {("plan", key): value for key, value in deciding.items()}
    found |= {(model, key): value for model, one in by_model.items() for key, value in one.items()}
    for one in answer(run, "latency", name)["transactions"]:
        key = f"{one['transaction']}_latency"
        found[one["timing_model"], f"{key}_us"] = one["latency_us"]
        found[one["timing_model"], f"{key}_with_gaps_us"] = one["latency_with_gaps_us"]
    return found


@pytest.mark.parametrize("pair", PAIRS)
def test_every_figure_is_that_of_its_own_command(run: Run, pair: tuple[str, str]) -> None:
    figures = answer(run, "diff", *pair)["figures"]
    assert {one["part"] for one in figures} == {"plan", "paper", "standard"}
    for side, name in zip("ab", pair, strict=True):
        known = expected(run, name)
        for one in figures:
            assert one[side] == known[one["part"], one["figure"]], one
    for one in figures:
        if one["difference"] is not None:
            assert one["difference"] == one["b"] - one["a"]
        if one["relative_difference"] is not None:
            assert one["relative_difference"] == pytest.approx((one["b"] - one["a"]) / abs(one["a"]))


# --- the gate ---------------------------------------------------------------------------------------------


def test_a_report_exits_0_and_a_gate_1_on_a_regression(run: Run) -> None:
    worse, better = ("diff", "paper-optimal-gap", "paper-1ms"), ("diff", "paper-1ms", "paper-optimal-gap")
    assert (run(*worse).returncode, run(*worse).stderr) == (0, "")
    assert (run(*better, GATE).returncode, run(*better, GATE).stderr) == (0, "")
    done = run(*worse, GATE)
    assert (done.returncode, done.stdout) == (1, run(*worse).stdout)
    assert done.stderr.startswith("regression: B is worse in 16 figures: corrected margin, safe nodes, safe axes, ")
    for form in ("json", "markdown", "html", "csv"):
        assert run(*worse, GATE, "--format", form).returncode == 1


def test_a_regression_under_the_model_that_does_not_decide_counts(run: Run, repository: Path) -> None:
    line = repository / "profiles" / "line.toml"
    text = line.read_text(encoding="utf-8")
    # More payload overhead costs the paper's packets only; the standard's have their own.
    line.write_text(text.replace("write_bytes = 12", "write_bytes = 12\noverhead_bytes = 24"), encoding="utf-8")
    arguments = ("diff", "HEAD:profiles/line.toml", "profiles/line.toml", GATE)
    done = run(*arguments, cwd=repository)
    assert done.returncode == 1
    assert "margin (paper)" in done.stderr
    assert run(*arguments, "--timing-model", "standard", cwd=repository).returncode == 0
    assert run(*arguments, "--tolerance", "5", cwd=repository).returncode == 0
    assert run(*arguments, "--tolerance", "0.1", cwd=repository).returncode == 1


# --- what A and B may be ----------------------------------------------------------------------------------


def test_a_file_against_its_own_history(run: Run, repository: Path) -> None:
    document = answer(run, "diff", "HEAD~1:profiles/line.toml", "profiles/line.toml", cwd=repository)
    assert document["a"]["argument"] == "HEAD~1:profiles/line.toml"
    assert document["changes"] == [
        {"key": "cycle.period_us", "a": 4000.0, "a_source": "file", "b": 1000.0, "b_source": "file"}
    ]
    assert answer(run, "diff", "v1:./line.toml", "main:./line.toml", cwd=repository / "profiles")["changes"]
    assert answer(run, "diff", "HEAD:profiles/line.toml", "profiles/line.toml", cwd=repository)["same"]


def test_a_process_in_a_hook_reads_the_same_revision(run: Run, repository: Path) -> None:
    # A relative GIT_DIR is what git gives to its hooks.
    hook = {"GIT_DIR": ".git", "GIT_INDEX_FILE": ".git/index", "GIT_PREFIX": ""}
    arguments = ("diff", "v1:./line.toml", "line.toml")
    done = run(*arguments, cwd=repository / "profiles", env=hook)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == run(*arguments, cwd=repository / "profiles").stdout


def test_standard_input_is_one_side(run: Run, refused: Refused, repository: Path) -> None:
    text = (repository / "profiles" / "line.toml").read_bytes()
    there = answer(run, "diff", "v1:profiles/line.toml", "-", cwd=repository, stdin=text)
    back = answer(run, "diff", "-", "v1:profiles/line.toml", cwd=repository, stdin=text)
    assert [one["key"] for one in there["changes"] + back["changes"]] == ["cycle.period_us"] * 2
    assert refused("diff", "-", "-", stdin=text) == ("-: standard input can be read once; give files for the others")


def test_what_is_wrong_with_either_side_is_said_together(refused: Refused, repository: Path) -> None:
    (repository / "bad.toml").write_text("x", encoding="utf-8")
    said = refused("diff", "v1:broken.toml", "bad.toml", cwd=repository).splitlines()
    assert [line.partition(": ")[0] for line in said] == ["v1:broken.toml:6:1", "bad.toml:1:2"]
    said = refused("diff", "nope:bad.toml", "none.toml", cwd=repository).splitlines()
    assert said[0].startswith("nope:bad.toml: no file of that name; of REV:path git says: fatal: ")
    assert said[1].startswith("none.toml: no such file")
    assert len(refused("diff", "none.toml", "none.toml", cwd=repository).splitlines()) == 1
