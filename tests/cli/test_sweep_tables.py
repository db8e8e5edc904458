"""`busplan sweep` into Parquet, through the command line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.extras import needed

Run = Callable[..., Any]
Refused = Callable[..., str]


def parquet(path: Path) -> Any:
    return needed("pyarrow.parquet").ParquetFile(path)


@pytest.mark.slow
def test_the_ending_chooses_parquet_and_a_pipe_gets_the_same_bytes(run: Run, tmp_path: Path) -> None:
    needed("pyarrow")
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


def test_a_terminal_gets_no_parquet(on_terminal: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    needed("pyarrow")
    sweep = ("sweep", "paper-4ms", "--vary", "bus.nodes=1:2", "--format", "parquet")
    code, shown = on_terminal(*sweep, cwd=tmp_path, env={"COLUMNS": "200"})
    assert (code, shown) == (2, "--format parquet: is not for a terminal; give -o FILE.parquet, or use a pipe\n")
