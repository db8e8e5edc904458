"""`busplan circle-test` as it is typed: exit codes, documents, files."""

import csv
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]

QUICK = """
schema_version = 1
name = "quick"
bus = { kind = "ieee1394", speed = "S400", nodes = 2 }
cycle.period_us = 2000
payload = { read_bytes = 12, write_bytes = 12 }
node = { axes = 4, execution = { kind = "linear", base_us = 30, per_byte_us = 0.35 } }
[servo]
position_gain_per_s = 50
velocity_feedforward = 0
[circle]
radius_mm = 25
feed_mm_per_min = 3000
ramp_periods = 20
"""


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    path = tmp_path / "quick.toml"
    path.write_text(QUICK, encoding="utf-8")
    return path


@pytest.fixture
def circle_test(busplan: Run) -> Run:
    """Ask for a circle test, in this process."""

    def call(*arguments: object, cwd: Path) -> Any:
        return busplan("circle-test", *arguments, cwd=cwd)

    return call


def test_a_missed_tolerance_is_exit_1_with_its_size_and_what_to_attack(circle_test: Run, profile: Path) -> None:
    profile.write_text(QUICK + "[tolerance]\nmax_contour_error_mm = 0.001\n", encoding="utf-8")
    run = circle_test(profile, cwd=profile.parent)
    assert run.returncode == 1
    assert "FAILED, the largest contour error of " in run.stdout
    assert " um over its 1 um" in run.stdout
    assert "Attack velocity feedforward first" in run.stdout


def test_a_cycle_that_does_not_fit_is_exit_1_without_figures(circle_test: Run, profile: Path) -> None:
    run = circle_test(profile, "--period", "100us", "--format", "json", cwd=profile.parent)
    assert run.returncode == 1
    (result,) = json.loads(run.stdout)["results"]
    assert [failure["name"] for failure in result["failures"]] == ["required_us"]
    assert result["max_contour_error_mm"] is None
    table = circle_test(profile, "--period", "100us", cwd=profile.parent)
    assert table.returncode == 1
    assert "the cycle does not fit the bus" in table.stdout


def test_an_unstable_loop_is_exit_1_and_never_nan(circle_test: Run, profile: Path) -> None:
    profile.write_text(QUICK.replace("position_gain_per_s = 50", "position_gain_per_s = 30000"), encoding="utf-8")
    run = circle_test(profile, "--format", "json", cwd=profile.parent)
    assert run.returncode == 1
    assert "NaN" not in run.stdout
    assert "Infinity" not in run.stdout
    (result,) = json.loads(run.stdout)["results"]
    assert (result["stable"], result["failures"][0]["name"]) == (False, "stability")
    assert "the position loop is unstable" in circle_test(profile, cwd=profile.parent).stdout


def test_trace_has_every_nth_step_of_each_period(circle_test: Run, profile: Path) -> None:
    run = circle_test(
        profile, "--period", "2ms", "--period", "4ms", "--trace", "t.csv", "--every", "100", cwd=profile.parent
    )
    assert (run.returncode, run.stderr) == (0, "wrote t.csv\n")
    with (profile.parent / "t.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "period_us",
        "time_us",
        "command_x_mm",
        "command_y_mm",
        "x_mm",
        "y_mm",
        "contour_error_mm",
    ]
    assert {row["period_us"] for row in rows} == {"2000.0", "4000.0"}
    for row in rows:
        error_mm = math.hypot(float(row["x_mm"]), float(row["y_mm"])) - 25
        assert float(row["contour_error_mm"]) == pytest.approx(error_mm, abs=1e-12)
        assert float(row["time_us"]) % 10_000 == 0


def test_a_step_that_does_not_divide_the_period_is_a_shorter_one_that_does(circle_test: Run, profile: Path) -> None:
    periods = ("--period", "50us", "--period", "2050us", "--set", "limits.reserve=0", "--set", "bus.nodes=1")
    run = circle_test(profile, *periods, "--format", "json", cwd=profile.parent)
    # In whole nanoseconds, where one is near: 2050 us are 25 of 82 us.
    assert [result["step_us"] for result in json.loads(run.stdout)["results"]] == [50, 82]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "c.pdf"], "for a PDF write .svg: a browser prints it"),
        (["--trace", "no/where/t.csv"], "cannot be written"),
        (["--trace", "."], "cannot be written"),
        (["--every", "5"], "needs --trace"),
        (["--every", "0", "--trace", "t.csv"], "--every 0: must be 1 or more; "),
        (["--set", "circle.radius_mm=0"], "--set circle.radius_mm=0: must be 0.001 or more"),
        (["--set", "circle.feed_mm_per_min=1e6"], "feed_mm_per_min"),
        (["--set", "delivery.seed=-1"], "--set delivery.seed=-1: must be 0 or more"),
    ],
)
def test_bad_input_is_exit_2_with_one_message_and_no_file(
    circle_test: Run, profile: Path, arguments: list[str], message: str
) -> None:
    run = circle_test(profile, *arguments, cwd=profile.parent)
    assert run.returncode == 2
    assert run.stdout == ""
    assert message in run.stderr
    assert "Traceback" not in run.stderr
    assert [path.name for path in profile.parent.iterdir()] == ["quick.toml"]


def test_without_a_circle_the_answer_is_told_and_the_old_plot_stays(circle_test: Run, profile: Path) -> None:
    old = profile.parent / "c.png"
    old.write_bytes(b"old")
    run = circle_test(profile, "-o", "c.png", "--period", "100us", cwd=profile.parent)
    assert run.returncode == 2
    assert "nothing to draw: no period fits the bus" in run.stderr
    assert "wrote" not in run.stderr
    said = circle_test(profile, "--period", "100us", cwd=profile.parent)
    assert (said.returncode, said.stdout.count("\n"), "NOT RUN" in said.stdout) == (1, 1, True)
    assert old.read_bytes() == b"old"
    assert len(list(profile.parent.iterdir())) == 2


def test_the_report_the_trace_and_the_plot_go_to_their_files(circle_test: Run, profile: Path) -> None:
    files = ("-o", "report.md", "--trace", "t.csv", "--every", "1000")
    run = circle_test(profile, *files, cwd=profile.parent)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "wrote t.csv\nwrote report.md\n")
    assert "### Circle test of `quick`\n" in (profile.parent / "report.md").read_text(encoding="utf-8")
    for name, start in (("c.png", b"\x89PNG"), ("c.svg", b"<svg")):
        assert circle_test(profile, "-o", name, cwd=profile.parent).stderr == f"wrote {name}\n"
        assert (profile.parent / name).read_bytes().startswith(start)
    assert "path with magnified error" in (profile.parent / "c.svg").read_text(encoding="utf-8")


def test_a_broken_resvg_is_said_before_the_simulation(run: Run, profile: Path) -> None:
    package = profile.parent / "broken" / "resvg_py"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise RuntimeError('wrong ABI')", encoding="utf-8")
    broken = {"FORK_FIRST": "import sys; sys.path.insert(0, 'broken')"}
    done = run("circle-test", profile.name, "-o", "c.png", cwd=profile.parent, env=broken)
    assert done.returncode == 2
    assert "does not load (RuntimeError: wrong ABI)" in done.stderr
    assert not (profile.parent / "c.png").exists()


def test_plain_python_without_a_compiled_kernel_gives_the_same_document(
    run: Run, profile: Path, no_compiler: Mapping[str, str]
) -> None:
    arguments = "circle-test", str(profile), "--format", "json"
    plain = run(*arguments, env=no_compiler)
    assert (plain.returncode, plain.stderr) == (0, "")
    assert plain.stdout == run(*arguments).stdout
