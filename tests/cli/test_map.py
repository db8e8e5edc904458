"""`busplan map` through the command line: each form, options, refusals."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]
Refused = Callable[..., str]

FEW = ("--x", "bus.nodes=1:3", "--y", "cycle.period_us=500,4000")


def test_options_change_this_design_and_move_the_mark(busplan: Run, tmp_path: Path) -> None:
    options = ("--set", "bus.nodes=3", "--period", "900us", "--set", "bus.gap_count=optimal", "--set", "bus.speed=S200")
    done = busplan("map", "paper-4ms", *options, cwd=tmp_path)
    assert done.returncode == 0
    first, second, *_ = done.stdout.splitlines()
    assert first == "With --set bus.nodes=3 and --set bus.gap_count=optimal and --set bus.speed=S200."
    assert second.endswith("This design (12 axes, period 900 us): fits.")
    assert "> 900 us | #  # [#]" in done.stdout


def test_circles_are_run_here_or_by_workers(busplan: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("busplan.cli.workers.workers", ThreadPoolExecutor)  # of processes a sweep has a test
    small = ("--set", "circle.radius_mm=20", "--set", "circle.ramp_periods=5", "--circle")
    each = [busplan("map", "paper-4ms", *FEW, *small, "--jobs", jobs, cwd=tmp_path) for jobs in (1, 2)]
    assert each[0].stdout == each[1].stdout
    assert {done.returncode for done in each} == {0}
    assert "settings are shown to fit with a circle that passes" in each[0].stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--x", "bus.nodes"), "--x bus.nodes: expected KEY=VALUES, as bus.nodes=1:62"),
        (("--y", "cycle.period_us=fast"), "--y cycle.period_us=fast: 'fast' is not a number"),
        (("--x", "bus.nods=1:3"), "--x bus.nods: unknown key; did you mean nodes?"),
        (("--x", "node=1"), "--x node: "),
        (("--x", "bus.nodes=1:100"), "--x bus.nodes: 100 values; a map shows up to 64 of a key"),
        (("--x", "bus.gap_count=64,65"), "no setting of this map can exist: bus.gap_count 64: expected a whole number"),
        (("--x", "axes=1:3"), "no setting of this map can exist: axes = 1: no whole number of nodes, with 4 axes each"),
        (
            ("--x", "axes=4,8", "--y", "bus.nodes=1:3"),
            "x = axes and y = bus.nodes both vary bus.nodes; give two keys",
        ),
        (("--x", "servo.step_us=10,20"), "--x servo.step_us: no figure of capacity depends on it; add circle"),
        (("--x", "tolerance.max_contour_error_mm=1"), "no figure of capacity depends on it; add circle"),
        (("--x", "limits.max_utilisation=1"), "--x limits.max_utilisation: no figure of capacity depends on it"),
        (("--jobs", "2"), "--jobs: needs --circle"),
        (("--circle", "--jobs", "0"), "--jobs 0: must be 1 or more; "),
        (("--set", "bus.nodes=3", "--set", "bus.nodes=4"), "both set bus.nodes; give one of them"),
        (("-o", "map.pdf"), "for a PDF write .svg: a browser prints it"),
    ],
)
def test_what_cannot_be_done_is_said_and_leaves_nothing(
    refused: Refused, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    assert message in refused("map", "paper-4ms", *arguments, cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []
