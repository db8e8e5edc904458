"""`busplan calibrate`: the documents, the profile's file, and what is refused."""

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from busplan.profile.shipped import load, locate

Run = Callable[..., "subprocess.CompletedProcess[str]"]

MEASURED = "payload_bytes,latency_us\n4,48\n4,49\n64,80\n64,81\n256,160\n256,400\n256,161\n"

# The file is killed at the worst moments: before the new one is whole, before it takes the name, and just after.
KILL = """
import os, sys
def die(*_args, **_kwargs):
    os.kill(os.getpid(), 9)
{patch}
sys.argv = ["busplan", "calibrate", "bench.toml", "m.csv", "--form", "linear", "--apply"]
from busplan.cli import run
run()
"""
KILLS = {
    "half-written": """
from busplan.cli import output
def half(self, data):
    os.write(self.fileno(), bytes(data)[: len(data) // 2])
    die()
output._Raw.write = half
""",
    "not yet on the disk": "os.fsync = die",
    "not yet renamed": "import pathlib\npathlib.Path.replace = die",
}


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_bytes(locate("paper-two-node")[0].read_bytes())
    (tmp_path / "m.csv").write_text(MEASURED, encoding="utf-8")
    return path


def test_the_shipped_example_gives_the_shipped_table(busplan: Run, tmp_path: Path) -> None:
    run = busplan("calibrate", "paper-two-node", "table-1.csv", "--format", "json", cwd=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    document = json.loads(run.stdout)
    assert (document["schema"], document["command"], document["profile"]) == (1, "calibrate", "paper-two-node")
    assert document["execution"] == load("paper-two-node").document.data()["node"]["execution"]
    assert (document["way"], document["rms_residual_us"], document["applied_to"]) == ("measured-halves", 0, None)
    people = busplan("calibrate", "paper-two-node", "table-1.csv", cwd=tmp_path).stdout
    assert "T_exec = T_lant - 2 (T1+T2), both as measured; the timing model is not used" in people
    assert "\ntime_us = [36.7, 36.3, 44.7, 53.1, 81.7, 135.5, 212.2, 405.2]\n" in people


def test_apply_writes_the_table_and_its_provenance_in_place_and_twice_is_once(busplan: Run, bench: Path) -> None:
    before = bench.read_text()
    run = busplan("calibrate", "bench.toml", "m.csv", "--timing", "standard", "--robust", "--apply", cwd=bench.parent)
    assert (run.returncode, run.stderr[:36]) == (0, "wrote [node.execution] of bench.toml")
    note = (
        "# busplan calibrate: table (median) of 7 measurements in m.csv, packets by the standard model, rms residual "
    )
    after = bench.read_text()
    old, new = before.splitlines(), after.splitlines()
    at = next(index for index, line in enumerate(new) if line.startswith(note))
    assert new[:at] + new[at + 1 : at + 2] == old[: at + 1]
    assert new[at + 1 :][1:3] == [
        'grade = "measured"',
        'kind = "table"             # or "linear": base_us, per_byte_us',
    ]
    assert new[-2] == "payload_bytes = [4, 64, 256]"
    assert load(str(bench)).profile.node.execution.grade == "measured"
    busplan("calibrate", "bench.toml", "m.csv", "--timing", "standard", "--robust", "--apply", cwd=bench.parent)
    assert bench.read_text() == after


def test_apply_of_the_shipped_example_is_derived_and_changes_nothing_else(busplan: Run, bench: Path) -> None:
    before = bench.read_text()
    run = busplan("calibrate", "bench.toml", "table-1.csv", "--apply", "--format", "csv", cwd=bench.parent)
    rows = list(csv.DictReader(run.stdout.splitlines()))
    assert [row["execution_us"] for row in rows] == ["36.7", "36.3", "44.7", "53.1", "81.7", "135.5", "212.2", "405.2"]
    assert {row["profile"] for row in rows} == {"paper-two-node"}
    added = [line for line in bench.read_text().splitlines() if line not in before.splitlines()]
    assert added == [
        "# busplan calibrate: table (mean) of 8 measurements in table-1.csv, T1+T2 as measured, rms residual 0.000 us"
    ]


def test_apply_from_a_table_to_a_line_and_back(busplan: Run, bench: Path) -> None:
    bench.write_bytes(b"\xef\xbb\xbf" + bench.read_bytes().replace(b"\n", b"\r\n"))
    run = busplan("calibrate", "bench.toml", "-", "--form", "linear", "--apply", cwd=bench.parent, stdin=MEASURED)
    assert run.returncode == 0
    execution = load(str(bench)).document.data()["node"]["execution"]
    assert set(execution) == {"grade", "kind", "base_us", "per_byte_us"}
    assert "in <stdin>, packets by the paper model" in bench.read_text()
    content = bench.read_bytes()
    assert content.startswith(b"\xef\xbb\xbf")
    assert content.count(b"\n") == content.count(b"\r\n")
    busplan("calibrate", "bench.toml", "m.csv", "--form", "table", "--apply", cwd=bench.parent)
    assert set(load(str(bench)).document.data()["node"]["execution"]) == {"grade", "kind", "payload_bytes", "time_us"}


def test_a_comment_of_a_key_that_goes_is_kept_on_a_line_of_its_own(busplan: Run, bench: Path) -> None:
    text = bench.read_text().replace("payload_bytes = [4, 16", "payload_bytes = [  # from the bench\n4, # least\n16")
    assert "# from the bench" in text
    bench.write_text(text.replace("405.2]", "405.2]  # by Li"))
    run = busplan("calibrate", "bench.toml", "m.csv", "--form", "linear", "--apply", cwd=bench.parent)
    assert (run.returncode, run.stderr) == (0, "wrote [node.execution] of bench.toml; every comment of yours is kept\n")
    lines = bench.read_text().splitlines()
    assert {"# from the bench", "# least", "# by Li"} <= set(lines)


def test_a_layout_that_cannot_be_edited_is_left_with_the_lines_to_change(busplan: Run, bench: Path) -> None:
    text = bench.read_text()
    start = text.index("[node.execution]")
    inline = 'execution = { kind = "table", payload_bytes = [4, 64, 256], time_us = [3, 5.5, 9] }  # mine\n'
    bench.write_text(text[:start] + inline)
    before = bench.read_bytes()
    run = busplan("calibrate", "bench.toml", "m.csv", "--form", "linear", "--apply", cwd=bench.parent)
    assert (run.returncode, run.stdout) == (2, "")
    first, note, header, *lines = run.stderr.splitlines()
    assert first.endswith(", so that it stays as it is; change these lines by hand:")
    assert note.startswith("# busplan calibrate: linear (least squares) of 7 measurements in m.csv, ")
    assert header == "[node.execution]"
    assert [line.partition(" = ")[0] for line in lines] == [
        *("kind", "grade", "base_us", "per_byte_us", "# remove payload_bytes", "# remove time_us")
    ]
    assert bench.read_bytes() == before


@pytest.mark.parametrize("moment", KILLS)
def test_a_kill_while_writing_leaves_the_profile_whole(bench: Path, moment: str) -> None:
    before = bench.read_bytes()
    run = subprocess.run(
        [sys.executable, "-c", KILL.format(patch=KILLS[moment])], cwd=bench.parent, check=False, capture_output=True
    )
    assert run.returncode == -signal.SIGKILL
    assert bench.read_bytes() == before
    # What was being written had no name yet, where the system has such files.
    left = [path.name for path in bench.parent.iterdir() if path.name.startswith(".bench.toml.")]
    assert len(left) == (0 if hasattr(os, "O_TMPFILE") and moment in {"half-written", "not yet on the disk"} else 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("paper-4ms", "m.csv", "--apply"), "--apply: paper-4ms is a shipped profile and stays as it is; busplan init"),
        (("-", "m.csv", "--apply"), "--apply: standard input cannot be written back; give the profile as a file"),
        (("-", "-"), "only one of PROFILE and MEASUREMENTS can be standard input"),
        (("bench.toml", "none.csv"), "none.csv: no such file, and no shipped example of that name; shipped is table-1"),
        (("bench.toml", "."), ".: is a directory; give a file"),
        (("bench.toml", "far.csv", "--apply"), "bench.toml: with the changes, payload.read_bytes = 4: is outside the"),
        (("bench.toml", "short.csv"), "short.csv:2: latency 0.05 us at 4 bytes is below the "),
        (("bench.toml", "bad.csv"), "bad.csv:2:3: latency_us 'x': expected a number"),
    ],
)
def test_refused_with_exit_2_and_nothing_written(
    busplan: Run, bench: Path, arguments: tuple[str, ...], message: str
) -> None:
    header = "payload_bytes,latency_us\n"
    for name, row in (("far.csv", "64,90"), ("short.csv", "4,0.05"), ("bad.csv", "4,x")):
        (bench.parent / name).write_text(f"{header}{row}\n", encoding="utf-8")
    before = bench.read_bytes()
    run = busplan("calibrate", *arguments, cwd=bench.parent)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith(message)
    assert bench.read_bytes() == before


def test_bench_options_move_the_packets_and_outliers_are_warned_of(busplan: Run, bench: Path) -> None:
    run = busplan("calibrate", "bench.toml", "m.csv", "--nodes", 5, "--gap-count", 10, cwd=bench.parent)
    assert (
        "(T1+T2) - (T4+T5), eq (3): both halves by the paper timing model for S400, 5 hops, gap count 10." in run.stdout
    )
    assert (
        "Warning: 1 outlier, more than 3.5 robust standard deviations off: line 7; with a pull on this fit"
        in run.stdout
    )
