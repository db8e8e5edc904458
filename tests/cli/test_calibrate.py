"""`busplan calibrate`: the documents, the profile's file, and what is refused."""

import csv
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from busplan import load_profile

Run = Callable[..., Any]

SHIPPED = Path(__file__).parents[2] / "profiles"


def execution_in(path: Path) -> Any:
    """The execution time that a file has."""
    return tomllib.loads(path.read_text(encoding="utf-8-sig"))["node"]["execution"]


MEASURED = "payload_bytes,latency_us\n4,48\n4,49\n64,80\n64,81\n256,160\n256,400\n256,161\n"


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_bytes((SHIPPED / "paper-two-node.toml").read_bytes())
    (tmp_path / "m.csv").write_text(MEASURED, encoding="utf-8")
    return path


def test_the_shipped_example_is_near_the_shipped_table(busplan: Run, tmp_path: Path) -> None:
    run = busplan("calibrate", "paper-two-node", "table-1.csv", "--format", "json", cwd=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    document = json.loads(run.stdout)
    assert (document["schema"], document["command"], document["profile"]) == (1, "calibrate", "paper-two-node")
    shipped = execution_in(SHIPPED / "paper-two-node.toml")
    found = document["execution"]
    assert (found["payload_bytes"], found["grade"]) == (shipped["payload_bytes"], shipped["grade"])
    # The shipped one has the halves of Table I as measured; these have the residual of the model, and say so.
    assert found["time_us"] == pytest.approx(shipped["time_us"], abs=2.3)
    assert (found["residual"], found["measured_gap_count"], document["applied_to"]) == ("standard", 63, None)
    people = busplan("calibrate", "paper-two-node", "table-1.csv", cwd=tmp_path).stdout
    assert "T_exec = T_lant - packets, eq (3): by the standard timing model for S400, 1 hop, gap count 63.\n" in people
    assert f"\ntime_us = {found['time_us']}\n" in people


def test_apply_writes_the_table_and_its_provenance_in_place_and_twice_is_once(busplan: Run, bench: Path) -> None:
    before = bench.read_text()
    run = busplan("calibrate", "bench.toml", "m.csv", "--timing-model", "standard", "--apply", cwd=bench.parent)
    assert (run.returncode, run.stderr[:36]) == (0, "wrote [node.execution] of bench.toml")
    note = "# busplan calibrate: median of 6 measurements in m.csv, 1 slow in worst_extra_us, packets by the standard "
    after = bench.read_text()
    old, new = before.splitlines(), after.splitlines()
    at = next(index for index, line in enumerate(new) if line.startswith(note))
    start = old.index("[node.execution]") + 1
    # The note stands above the comments of the section.
    assert new[:at] + new[at + 1 : start + 1] == old[:start]
    assert new[start + 1 :][:2] == [
        'grade = "measured"',
        'kind = "table"             # or "linear": base_us, per_byte_us',
    ]
    # Half of 0.5, 0.5 and 1 us off the median: 1.4826 * 0.5 us, whatever the outlier.
    assert [new[start + 3], *new[start + 5 :]] == [
        "payload_bytes = [4, 64, 256]",
        *("uncertainty_us = 0.707", 'residual = "standard"', "measured_gap_count = 63", "worst_extra_us = 239.501"),
    ]
    execution = load_profile(bench).node_groups[0].node.execution
    assert (execution.grade, execution.uncertainty_us) == ("measured", 0.707)
    busplan("calibrate", "bench.toml", "m.csv", "--timing-model", "standard", "--apply", cwd=bench.parent)
    assert bench.read_text() == after


def with_a_line(bench: Path) -> str:
    """The text of a profile whose execution time is a line, with comments."""
    text = bench.read_text()
    kept = text[: text.index('kind = "table"')]
    return f'{kept}kind = "linear"\nbase_us = 30.0  # least\nper_byte_us = 0.35  # derived: by Li\n'


def test_apply_from_a_line_to_a_table(busplan: Run, bench: Path) -> None:
    bench.write_bytes(b"\xef\xbb\xbf" + with_a_line(bench).encode().replace(b"\n", b"\r\n"))
    run = busplan("calibrate", "bench.toml", "-", "--apply", cwd=bench.parent, stdin=MEASURED)
    assert run.returncode == 0
    execution = execution_in(bench)
    fitted = {"residual", "measured_gap_count", "uncertainty_us", "worst_extra_us"}
    assert set(execution) == {"grade", "kind", "payload_bytes", "time_us", *fitted}
    # The timing model that decides, whatever leads the tables of the profile.
    assert "in <stdin>, 1 slow in worst_extra_us, packets by the standard model" in bench.read_text()
    content = bench.read_bytes()
    assert content.startswith(b"\xef\xbb\xbf")
    assert content.count(b"\n") == content.count(b"\r\n")


@pytest.mark.parametrize(
    ("timing", "options", "residual", "gap_count"),
    [
        ("paper", (), "paper", 63),
        ("standard", (), "standard", 63),
        ("standard", ("--set", "bus.gap_count=10"), "standard", 10),
    ],
)
def test_what_a_time_was_fitted_against_is_written_and_weighed(
    busplan: Run, bench: Path, timing: str, options: tuple[str, ...], residual: str, gap_count: int
) -> None:
    run = busplan("calibrate", "bench.toml", "m.csv", "--timing-model", timing, *options, "--apply", cwd=bench.parent)
    assert run.returncode == 0, run.stderr
    execution = execution_in(bench)
    assert (execution["residual"], execution["measured_gap_count"]) == (residual, gap_count)
    document = json.loads(busplan("capacity", "bench.toml", "--format", "json", cwd=bench.parent).stdout)
    (deciding,) = [one for one in document["results"] if one["timing_model"] == "standard"]
    # Two transactions of two halves: the mean residual of Table I is in a time that was fitted against the standard,
    # and the gap term counts from the gap count of the bench.
    b_us = 0 if residual == "standard" else 0.8270253906
    d_us = 2 * (gap_count - 63) / 98.304 if residual == "standard" else 0
    assert deciding["bias_us"] == pytest.approx(4 * (b_us + d_us))


def test_comments_are_kept_but_for_grades_of_the_old_values(busplan: Run, bench: Path) -> None:
    bench.write_text(with_a_line(bench))
    run = busplan("calibrate", "bench.toml", "m.csv", "--apply", cwd=bench.parent)
    assert run.returncode == 0
    assert run.stderr.endswith("; your comments are kept: see whether they hold of the new values\n")
    lines = bench.read_text().splitlines()
    assert {"# least", "# was derived: by Li"} <= set(lines)
    assert any(line.startswith("# Derived from Table I") for line in lines)


def test_an_outlier_is_no_entry_and_every_form_of_answer_says_so(busplan: Run, bench: Path) -> None:
    run = busplan("calibrate", "bench.toml", "m.csv", "--apply", "--format", "json", cwd=bench.parent)
    document = json.loads(run.stdout)
    (outlier,) = document["outliers"]
    assert (outlier["line"], round(outlier["off_us"])) == (7, 239)
    worst_us = document["worst_extra_us"]
    # The median of the two that are left is half a microsecond less.
    assert worst_us == pytest.approx(outlier["off_us"] + 0.5, abs=0.002)
    assert document["execution"]["worst_extra_us"] == worst_us
    assert "in m.csv, 1 slow in worst_extra_us, packets by the standard model" in bench.read_text()
    csv_ = busplan("calibrate", "bench.toml", "m.csv", "--format", "csv", cwd=bench.parent).stdout
    assert [row["left_out"] for row in csv.DictReader(csv_.splitlines())] == ["0", "0", "1"]
    assert document["unchecked_bytes"] == [4, 64]


def test_a_layout_that_cannot_be_edited_is_left_with_the_lines_to_change(busplan: Run, bench: Path) -> None:
    text = bench.read_text()
    start = text.index("[node.execution]")
    inline = 'execution = { kind = "linear", base_us = 3, per_byte_us = 0.5 }  # mine\n'
    bench.write_text(text[:start] + inline)
    before = bench.read_bytes()
    run = busplan("calibrate", "bench.toml", "m.csv", "--apply", cwd=bench.parent)
    assert (run.returncode, run.stdout) == (2, "")
    first, note, header, *lines = run.stderr.splitlines()
    assert first.endswith(", so that it stays as it is; change these lines by hand:")
    assert note.startswith("# busplan calibrate: median of 6 measurements in m.csv, 1 slow in worst_extra_us, packets ")
    assert header == "[node.execution]"
    assert [line.partition(" = ")[0] for line in lines] == [
        *("kind", "grade", "uncertainty_us", "payload_bytes", "time_us", "residual", "measured_gap_count"),
        "worst_extra_us",
        *("# remove base_us", "# remove per_byte_us"),
    ]
    assert bench.read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("paper-4ms", "m.csv", "--apply"), "--apply: paper-4ms is a shipped profile and stays as it is; busplan init"),
        (("-", "m.csv", "--apply"), "--apply: standard input cannot be written back; give the profile as a file"),
        (("-", "-"), "only one of PROFILE and MEASUREMENTS can be standard input"),
        (("bench.toml", "none.csv"), "none.csv: no such file, and no shipped example of that name; shipped is table-1"),
        (("bench.toml", "far.csv", "--apply"), "bench.toml: with the changes, payload.read_bytes = 4: is outside the"),
        (
            ("bench.toml", "short.csv"),
            "short.csv: every latency is too short: is latency_us in us?\nshort.csv:2: latency ",
        ),
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


def test_a_group_is_calibrated_by_its_name(run: Run, refused: Run, tmp_path: Path) -> None:
    (tmp_path / "g.toml").write_text((SHIPPED / "gantry-24.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert "gantry-24 has the groups drives, tool, io; give" in str(
        refused("calibrate", "g.toml", "table-1.csv", cwd=tmp_path)
    )
    unknown = refused("calibrate", "g.toml", "table-1.csv", "--group", "x", cwd=tmp_path)
    assert "--group x: gantry-24 has the groups drives" in str(unknown)
    done = run("calibrate", "g.toml", "table-1.csv", "--group", "tool", "--apply", cwd=tmp_path)
    assert done.returncode == 0
    assert "\n[group.execution]  # of tool\n" in done.stdout
    drives, tool, io = load_profile(tmp_path / "g.toml").group
    assert [one.execution.grade for one in (drives, tool, io)] == ["assumed", "derived", "assumed"]
