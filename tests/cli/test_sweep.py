"""`busplan sweep` through the command line: documents, files, interruption, refusals."""

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]


def test_the_ending_of_the_file_chooses_the_form_and_every_form_has_the_same_rows(busplan: Run, tmp_path: Path) -> None:
    grid = ["--vary", "bus.gap_count=7,optimal", "--vary", "cycle.period_us=300:400:#3"]
    for name in ("rows.csv", "rows.json"):
        run = busplan("sweep", "paper-4ms", *grid, "-o", name, cwd=tmp_path)
        assert (run.returncode, run.stdout) == (0, "")
        assert run.stderr.endswith(f"wrote {name}\n")
    lines = json.loads((tmp_path / "rows.json").read_text())["rows"]
    rows = list(csv.DictReader((tmp_path / "rows.csv").read_text().splitlines()))
    for line, row in zip(lines, rows, strict=True):
        assert list(line) == list(row)
        for name, value in line.items():
            written = " ".join(value) if isinstance(value, list) else "" if value is None else value
            assert row[name] == (str(written).lower() if isinstance(value, bool) else str(written)), name
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rows.csv", "rows.json"]


def test_the_first_rows_have_the_forms_for_people(busplan: Run, tmp_path: Path) -> None:
    grid = ["--vary", "bus.nodes=1:16"]
    for form, name in (("markdown", "rows.md"), ("html", "rows.html"), ("table", "rows.txt")):
        shown = busplan("sweep", "paper-4ms", *grid, "--format", form, cwd=tmp_path)
        assert (shown.returncode, shown.stderr) == (0, "")
        run = busplan("sweep", "paper-4ms", *grid, "-o", name, cwd=tmp_path)
        assert (run.returncode, run.stdout) == (0, "")
        fits = "13 shown to fit (standard model), 16 fit by the paper model."
        assert run.stderr == f"paper-4ms: 16 points; {fits}\nwrote {name}\n"
        assert (tmp_path / name).read_text(encoding="utf-8") == shown.stdout
    rows = [line for line in (tmp_path / "rows.md").read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    assert rows[0].startswith("| bus.nodes | timing\\_model | required\\_us |")
    assert [row.split(" | ")[0] for row in rows[2:]] == [f"| {number}" for number in range(1, 11) for _ in "ab"]
    whole = busplan("sweep", "paper-4ms", *grid, "--all", cwd=tmp_path).stdout
    assert "32 rows." in whole.splitlines()
    refused = busplan("sweep", "paper-4ms", *grid, "-o", "rows.out", cwd=tmp_path)
    assert refused.returncode == 2
    assert "--output rows.out: expected a name ending in .txt, .md, .html, .csv, .json, .parquet, " in refused.stderr
    document = json.loads(busplan("sweep", "paper-4ms", *grid, "--format", "json", cwd=tmp_path).stdout)
    page = (tmp_path / "rows.html").read_text(encoding="utf-8")
    times = re.findall(r'<data value="([^"]*)" data-unit="us"', page)
    assert {float(value) for value in times if value != "null"} <= {
        value for row in document["rows"] for key, value in row.items() if key.endswith("_us")
    }


@pytest.mark.slow
def test_circle_tests_add_their_columns_and_processes_change_nothing(run: Run, tmp_path: Path) -> None:
    circle = ("--set", "circle.radius_mm=20", "--set", "circle.feed_mm_per_min=15000", "--format", "json")
    grid = ("sweep", "paper-4ms", "--vary", "cycle.period_us=500,4000", "--circle", *circle)
    alone, together = run(*grid, "--jobs", "1", cwd=tmp_path), run(*grid, "--jobs", "2", cwd=tmp_path, env={})
    assert (alone.returncode, together.returncode) == (0, 0), alone.stderr + together.stderr
    assert alone.stdout == together.stdout
    rows = json.loads(alone.stdout)["rows"]
    assert [(row["cycle.period_us"], row["timing_model"], row["fits"]) for row in rows] == [
        (500, "standard", False),
        (500, "paper", True),
        (4000, "standard", True),
        (4000, "paper", True),
    ]
    # What does not fit is not simulated, and does not pass.
    assert (rows[0]["max_contour_error_mm"], rows[0]["passed"]) == (None, False)
    (result,) = json.loads(run("circle-test", "paper-4ms", *circle, cwd=tmp_path).stdout)["results"]
    keys = {"mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm", "phase_margin_deg", "passed"}
    assert {key: rows[2][key] for key in keys} == {key: result[key] for key in keys}


REFUSALS = {
    "--vary bus.nodes=1:9 --top 3": "no such option: --top",
    "--vary bus.nodes=1:9 --jobs 2": "--jobs: needs --circle",
    "--vary bus.nods=1": "--vary bus.nods: unknown key; did you mean nodes?",
    "--vary cycle.period_us=1:9000 --circle": "more circle tests than the 1,000",
    "--vary bus.nodes=1:9 -o rows.npz": "expected a name ending in .txt, .md, .html, .csv, .json, .parquet",
}


@pytest.mark.parametrize("line", REFUSALS)
def test_refusals(busplan: Run, line: str, tmp_path: Path) -> None:
    run = busplan("sweep", "paper-4ms", *line.split(), cwd=tmp_path)
    assert (run.returncode, run.stdout) == (2, "")
    assert REFUSALS[line] in run.stderr
    assert list(tmp_path.iterdir()) == []
