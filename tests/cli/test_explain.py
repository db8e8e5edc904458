"""`busplan explain` as a process: its forms, its options, and what it refuses."""

import csv
import json
from collections.abc import Callable
from io import StringIO
from typing import Any

import pytest

Run = Callable[..., Any]
Refused = Callable[..., str]


def test_a_figure_is_derived_down_to_its_constants(run: Run) -> None:
    done = run("explain", "paper-two-node", "latency.gaps_us", "--transaction", "read")
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout.splitlines()[0] == "gaps_us of paper-two-node at 4 ms, read, paper model: 7.898966 us"
    assert "T_sum = (82 + 48 g) / R\n" in done.stdout
    assert "= (82 + 48 * 63) / 393.216\n" in done.stdout
    assert "GAPS_TICKS " in done.stdout
    assert "published" in done.stdout


def test_without_a_figure_what_the_verdict_rests_on_comes_before_the_figures(run: Run) -> None:
    done = run("explain", "paper-4ms")
    assert done.returncode == 0
    assert done.stdout.startswith("What the verdict on paper-4ms rests on, the least well known first\n")
    assert "\nFigures to explain\n" in done.stdout
    assert "latency   latency_with_gaps_us" in done.stdout
    registry = json.loads(run("explain", "paper-4ms", "--format", "json").stdout)
    assert set(registry) == {"schema", "command", "profile", "assumptions", "figures", "equations", "constants"}
    rows = list(csv.DictReader(StringIO(run("explain", "paper-4ms", "--format", "csv").stdout)))
    assert rows == registry["figures"]


def test_the_rows_of_csv_are_the_steps_of_json(run: Run) -> None:
    question = ("explain", "paper-4ms", "required_us", "--timing-model", "both")
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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("paper-4ms", "requird_us"), "did you mean required_us"),
        (("paper-4ms", "max_contour_error_mm"), "no such figure"),
        (("paper-4ms", "required_us", "--period", "4"), "with its unit"),
        (("no-such", "required_us"), "no such file"),
        (("paper-4ms", "--period", "1ms", "--timing-model", "both"), "period_us and timing_model: goes with a figure"),
        (("paper-4ms", "max_nodes"), "max_nodes: no equation leads to it in paper-4ms"),
    ],
)
def test_what_cannot_be_explained_is_refused(refused: Refused, arguments: tuple[str, ...], said: str) -> None:
    assert said in refused("explain", *arguments)
