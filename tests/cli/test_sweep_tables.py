"""`busplan sweep` into Parquet, and its summary over seeds, through the command line."""

import csv
import json
import statistics
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]
Refused = Callable[..., str]
LOSSY = ("sweep", "paper-4ms", "--set", "circle.radius_mm=20", "--set", "delivery.loss_probability=0.001", "--circle")
SEEDS = ("--vary", "delivery.seed=1:12", "--jobs", "1")


def parquet(path: Path) -> Any:
    return pytest.importorskip("pyarrow.parquet").ParquetFile(path)


def test_the_ending_chooses_parquet_and_a_pipe_gets_the_same_bytes(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    grid = ("sweep", "paper-4ms", "--vary", "bus.gap_count=7,optimal", "--vary", "cycle.period_us=300:400:#3")
    done = run(*grid, "-o", "rows.parquet", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.endswith("wrote rows.parquet\n")
    assert [path.name for path in tmp_path.iterdir()] == ["rows.parquet"]
    run(*grid, "-o", "rows.json", cwd=tmp_path)
    rows = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))["rows"]
    found = parquet(tmp_path / "rows.parquet").read().to_pylist()
    assert [row["margin_us"] for row in found] == [row["margin_us"] for row in rows]
    with (tmp_path / "piped").open("wb") as pipe:
        assert run(*grid, "--format", "parquet", inside={"stdout": pipe.fileno()}).returncode == 0
    assert (tmp_path / "piped").read_bytes() == (tmp_path / "rows.parquet").read_bytes()


@pytest.mark.parametrize(
    ("options", "option"),
    [(("-o", "rows.parquet"), "--output rows.parquet"), (("--format", "parquet"), "--format parquet")],
)
def test_without_pyarrow_the_extra_is_named_before_any_work(
    refused: Refused, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], option: str
) -> None:
    monkeypatch.setattr("busplan.extras.find_spec", lambda _name: None)
    said = refused("sweep", "paper-4ms", "--vary", "cycle.period_us=1:900000000", *options, cwd=tmp_path)
    assert said == f"{option} needs pyarrow: install it with the extra, as in pip install 'busplan[table]'"
    assert list(tmp_path.iterdir()) == []


def test_a_summary_is_that_of_the_single_rows(run: Run, tmp_path: Path) -> None:
    over = ("--vary", "cycle.period_us=500,4000")
    single = run(*LOSSY, *SEEDS, *over, "--format", "json", cwd=tmp_path)
    summed = run(*LOSSY, *SEEDS, *over, "--summary", "--format", "json", cwd=tmp_path)
    assert (single.returncode, summed.returncode) == (0, 0), single.stderr + summed.stderr
    document = json.loads(summed.stdout)
    rows, each = document["rows"], json.loads(single.stdout)["rows"]
    assert (document["seeds"], document["points"], document["varied"]) == (12, 2, {"cycle.period_us": 2})
    assert [(row["cycle.period_us"], row["timing_model"], row["seeds"]) for row in rows] == [
        (period, model, 12) for period in (500, 4000) for model in ("paper", "standard")
    ]
    for row in rows:
        own = [one for one in each if all(one[key] == row[key] for key in ("cycle.period_us", "timing_model"))]
        assert len(own) == 12
        assert row["margin_us"] == own[0]["margin_us"]
        assert row["failed_share"] == sum(not one["passed"] for one in own) / 12
        errors = [one["max_contour_error_mm"] for one in own]
        if None in errors:
            # What does not fit is not simulated, and always fails.
            assert (row["failed_share"], row["max_contour_error_mean_mm"]) == (1.0, None)
            continue
        assert row["max_contour_error_worst_mm"] == max(errors)
        assert row["max_contour_error_mean_mm"] == pytest.approx(statistics.fmean(errors))
        assert row["max_contour_error_std_mm"] == pytest.approx(statistics.stdev(errors), rel=1e-6)
    assert {row["failed_share"] for row in rows} - {0.0, 1.0}, "some seeds fail and some do not"
    assert (
        "The circle holds every tolerance with each of 12 seeds at 0 of 2 points, fails with some at" in summed.stderr
    )


def test_every_form_has_the_summary(run: Run, tmp_path: Path) -> None:
    forms = ["rows.txt", "rows.md", "rows.html", "rows.csv", "rows.json"]
    if find_spec("pyarrow"):
        forms.append("rows.parquet")
    few = ("--vary", "delivery.seed=1,2", "--jobs", "1", "--summary")
    for name in forms:
        done = run(*LOSSY, *few, "-o", name, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    (row, _) = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))["rows"]
    assert next(iter(row)) == "timing_model"
    for name in forms[:3]:
        assert "failed" in (tmp_path / name).read_text(encoding="utf-8")
    (line, _) = csv.DictReader((tmp_path / "rows.csv").read_text(encoding="utf-8").splitlines())
    assert float(line["max_contour_error_p95_mm"]) == row["max_contour_error_p95_mm"]
    if "rows.parquet" in forms:
        assert parquet(tmp_path / "rows.parquet").read().to_pylist()[0]["failed_share"] == row["failed_share"]


REFUSALS = {
    "--vary delivery.seed=1:9 --summary": "--summary: goes with --circle",
    "--vary bus.nodes=1:9 --circle --summary": "summary: is over seeds, and none vary; add delivery.seed",
    "--vary delivery.seed=1:9 --vary bus.nodes=1:200 --circle --summary": "200 points with 9 seeds each are",
    "--vary delivery.seed=1:9 --circle --summary --columns passed": "--columns passed: no such column",
    "--vary delivery.seed=1:9 --circle --summary --plot x.svg": "none varies but the seed",
    "--vary bus.nodes=1:9 --format parquet --top 3": "--top: goes with --format table, markdown or html; parquet has",
}


@pytest.mark.parametrize("line", REFUSALS)
def test_refusals(refused: Refused, line: str, tmp_path: Path) -> None:
    if "parquet" in line:
        pytest.importorskip("pyarrow")
    assert REFUSALS[line] in refused("sweep", "paper-4ms", *line.split(), cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_terminal_gets_no_parquet(on_terminal: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    sweep = ("sweep", "paper-4ms", "--vary", "bus.nodes=1:2", "--format", "parquet")
    code, shown = on_terminal(*sweep, cwd=tmp_path, env={"COLUMNS": "200"})
    assert (code, shown) == (2, "--format parquet: is not for a terminal; give -o FILE.parquet, or use a pipe\n")
